"""Modes along one number of a sweep: which eigenvalue at a point goes on which at the point before."""

from itertools import count

import numpy as np
import xarray
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from drumsqueal.questions.sweep.points import names_in

# Distance of two eigenvalues over their size from which they are two modes, and what another name adds to it.
OTHER_MODE, OTHER_NAME = 0.5, 0.1


def modes_along(sweep: xarray.Dataset) -> list[tuple[str, NDArray[np.complex128]]]:
    """The label and the eigenvalues of each mode along one number: "X", and "X (2)" where there is another at a point.

    They come by rising frequency. Where a mode ends, another of its name may have its label from there on.
    """
    names, found = names_in(sweep), []
    for coordinates, eigenvalues in sorted(_followed(sweep), key=lambda mode: np.nanmean(mode[1].imag)):
        name, there = names[int(np.bincount(coordinates[coordinates >= 0]).argmax())], np.isfinite(eigenvalues)
        taken = {label for label, others in found if np.any(there & np.isfinite(others))}
        label = next(each for k in count(1) if (each := name if k == 1 else f"{name} ({k})") not in taken)
        found.append((label, eigenvalues))
    return found


def end_of(eigenvalues: NDArray[np.complex128]) -> int:
    """The last point at which a mode is."""
    return int(np.flatnonzero(np.isfinite(eigenvalues))[-1])


def _followed(sweep: xarray.Dataset) -> list[tuple[NDArray[np.int8], NDArray[np.complex128]]]:
    """Each mode along one number: its largest coordinates and its eigenvalues (points,), -1 and NaN where it is not.

    From point to point the eigenvalues are joined that are nearest to those expected from the two points before, which
    tells modes apart whose names or ranks change; where there is but one point before, the names count, too. What is
    far from all that is expected is another mode: a shoe that bends may have more of them at one point than at another.
    So is one that moves in the plane beside one that moves out of it: they do not know of each other.
    """
    eigenvalues = sweep["growth_rate"].values + 2j * np.pi * sweep["frequency"].values
    coordinates, planes = sweep["mode_coordinate"].values, sweep["mode_in_plane"].values
    found: list[tuple[NDArray[np.int8], NDArray[np.complex128]]] = []
    living: list[tuple[NDArray[np.int8], NDArray[np.complex128]]] = []
    before = np.zeros(0, np.int8)
    nowhere = np.full(len(eigenvalues), complex(np.nan, np.nan))
    for k, here in enumerate(eigenvalues):
        ranks = np.flatnonzero(np.isfinite(here))
        distances = _distances(living, k, coordinates[k, ranks], here[ranks])
        plane = planes[k, ranks]
        distances[(before[:, None] != plane) & (np.minimum(before[:, None], plane) >= 0)] = OTHER_MODE
        olds, news = linear_sum_assignment(np.minimum(distances, OTHER_MODE))
        pairs = [(old, new) for old, new in zip(olds, news, strict=True) if distances[old, new] < OTHER_MODE]
        of = {int(ranks[new]): living[old] for old, new in pairs}
        living = []
        for rank in ranks.tolist():
            if rank not in of:
                found.append((np.full(len(eigenvalues), -1, np.int8), nowhere.copy()))
            mode = of.get(rank, found[-1])
            mode[0][k], mode[1][k] = coordinates[k, rank], here[rank]
            living.append(mode)
        before = plane
    return found


def _distances(
    living: list[tuple[NDArray[np.int8], NDArray[np.complex128]]],
    k: int,
    coordinates: NDArray[np.int8],
    here: NDArray[np.complex128],
) -> NDArray[np.float64]:
    """Of eigenvalues at point k from those expected there, over their size (modes before, eigenvalues)."""
    found = np.zeros((len(living), len(here)))
    for row, (names, values) in zip(found, living, strict=True):
        last, earlier = values[k - 1], values[k - 2] if k > 1 else np.nan
        known = np.isfinite(earlier)
        row[:] = np.abs(here - (2 * last - earlier if known else last)) / np.maximum(np.abs(last), np.abs(here))
        if not known:
            row[:] += np.where(coordinates == names[k - 1], 0.0, OTHER_NAME)
    return found
