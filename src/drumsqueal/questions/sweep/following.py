"""Modes along one number of a sweep: one by their shapes or, where these continue none of the scene, by eigenvalues."""

import numpy as np
import xarray
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from drumsqueal.questions.sweep.points import NONE, modes_in

# Distance of two eigenvalues over their size from which they are two modes, and what another name adds to it.
OTHER_MODE, OTHER_NAME = 0.5, 0.1


def modes_along(sweep: xarray.Dataset) -> list[tuple[str, NDArray[np.complex128]]]:
    """The label, as in `modes_in`, and the eigenvalues (points,) of each mode along one number, NaN where it is not.

    They come by rising frequency.
    """
    eigenvalues, found = sweep["growth_rate"].values + 2j * np.pi * sweep["frequency"].values, []
    numbered = sweep.assign(mode_number=(sweep["mode_number"].dims, _numbers(sweep, eigenvalues)))
    for label, places in modes_in(numbered).items():
        points, ranks = np.nonzero(places & np.isfinite(eigenvalues))
        along = np.full(len(eigenvalues), complex(np.nan, np.nan))
        along[points] = eigenvalues[points, ranks]
        if points.size:
            found.append((label, along))
    return sorted(found, key=lambda mode: np.nanmean(mode[1].imag))


def end_of(eigenvalues: NDArray[np.complex128]) -> int:
    """The last point at which a mode is."""
    return int(np.flatnonzero(np.isfinite(eigenvalues))[-1])


def _numbers(sweep: xarray.Dataset, eigenvalues: NDArray[np.complex128]) -> NDArray[np.int64]:
    """Numbers of the modes (points, mode): those of the scene itself, and others for what continues none of these.

    Such modes are joined from point to point to those with the nearest eigenvalues. What is far from all is another
    mode: a shoe that bends may have more of them at one point than at another. Numbers of the scene stand as they are,
    and no two modes of a point have the same one.
    """
    there = np.isfinite(eigenvalues)
    numbers = np.where(there, sweep["mode_number"].values, NONE).astype(np.int64)
    of_scene = numbers.max(initial=NONE)
    for k in range(len(numbers)):
        now, before = np.flatnonzero(there[k]), np.flatnonzero(there[k - 1] & (k > 0))
        distances = _distances(sweep, eigenvalues, numbers, k, before, now)
        for old, new in zip(*linear_sum_assignment(np.minimum(distances, OTHER_MODE)), strict=True):
            number, own = int(numbers[k - 1, before[old]]), int(numbers[k, now[new]])
            if distances[old, new] >= OTHER_MODE:
                continue
            if own == NONE and number not in numbers[k]:
                numbers[k, now[new]] = number
            elif own != NONE and number > of_scene and not _meet(numbers, number, own):
                numbers[numbers == number] = own
        others = now[numbers[k, now] == NONE]
        numbers[k, others] = numbers.max() + 1 + np.arange(others.size)
    return numbers


def _meet(numbers: NDArray[np.int64], one: int, other: int) -> bool:
    """Whether both numbers are there at one point."""
    return bool(((numbers == one).any(axis=1) & (numbers == other).any(axis=1)).any())


def _distances(
    sweep: xarray.Dataset,
    eigenvalues: NDArray[np.complex128],
    numbers: NDArray[np.int64],
    k: int,
    before: NDArray[np.int64],
    now: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Of eigenvalues at point k from those expected by the two points before, over their size (before, now).

    Where there is but one point before, names count, too. Modes in the plane and out of it do not know of each other.
    """
    names, planes, shapes = (
        (sweep[name].values[k - 1, before][:, None], sweep[name].values[k, now])
        for name in ("mode_coordinate", "mode_in_plane", "mode_number")
    )
    here, last = eigenvalues[k, now], eigenvalues[k - 1, before]
    same = (numbers[k - 2] == numbers[k - 1, before][:, None]) & (k > 1)
    known = same.any(axis=1)
    expected = np.where(known, 2 * last - eigenvalues[k - 2, same.argmax(axis=1)], last)
    found = np.abs(here - expected[:, None]) / np.maximum(np.abs(last)[:, None], np.abs(here))
    found += np.where((names[0] != names[1]) & ~known[:, None], OTHER_NAME, 0.0)
    found[(planes[0] != planes[1]) & (np.minimum(*planes) >= 0)] = OTHER_MODE
    sure = np.minimum(*shapes) >= 0
    return np.where(sure, np.where(shapes[0] == shapes[1], 0.0, OTHER_MODE), found)
