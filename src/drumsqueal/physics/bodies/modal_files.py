"""Modal results of other codes as they stand in their files: nodes, frequencies and shapes of a free body."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.files.universal import MODES, UNITS, read_datasets

Reals = NDArray[np.float64]

UNIVERSAL = (".unv", ".uff", ".uf", ".u55")
LENGTHS, MASSES = {"m": 1.0, "mm": 1e-3}, {"kg": 1.0, "t": 1e3}
USUAL_MASS = {"m": "kg", "mm": "t"}  # with N and s, in which the codes' own units are consistent
NODES, SYSTEMS = (15, 2411), 2420  # datasets
_CARTESIAN = 0  # type of a system of coordinates
ROUNDED = 1e-6  # of its axes, which files have to seven digits
_NORMAL, _REAL, _COMPLEX = 2, 2, 5  # type of an analysis, and of data
_MOTIONS = (0, 1, 8)  # specific data types: not known, general, displacement


class ModalResults(NamedTuple):
    """Nodes (n, 3) in m, frequencies (m,) in Hz that rise, and shapes (m, n, 3) in kg^-½, of unit modal mass."""

    nodes: Reals
    frequencies: Reals
    shapes: Reals


class _Written(NamedTuple):
    """The same and the modal masses (m,) in the units of a file, which are in m and in kg where it states them."""

    nodes: Reals
    frequencies: Reals
    shapes: Reals
    modal_mass: Reals
    units: tuple[float, float] | None


def read_modal_results(path: str | Path, unit: str = "auto", mass_unit: str = "auto") -> ModalResults:
    """Read a universal file or .npz; "auto" is the unit that the file states, or of masses the usual one with a length.

    Raises RequestError.
    """
    path = Path(path)
    if path.suffix.lower() not in (*UNIVERSAL, ".npz"):
        raise RequestError(f"{path} is neither a universal file (.unv, .uff) nor .npz; export one of them")
    written = _read_npz(path) if path.suffix.lower() == ".npz" else _read_universal(path)
    _check(written, path)
    length, mass = _factors(written, path, unit, mass_unit)
    order = np.argsort(written.frequencies, kind="stable")
    shapes = written.shapes / np.sqrt(written.modal_mass * mass)[:, None, None]
    return ModalResults(written.nodes * length, written.frequencies[order], shapes[order])


def _factors(written: _Written, path: Path, unit: str, mass_unit: str) -> tuple[float, float]:
    """Metres and kilograms that the file's units are."""
    if written.units is None:
        if unit == "auto":
            raise RequestError(f'{path} does not state its units; add unit = "mm", or "m"')
        return LENGTHS[unit], MASSES[USUAL_MASS[unit] if mass_unit == "auto" else mass_unit]
    for key, given, stated, known in (
        ("unit", unit, written.units[0], LENGTHS),
        ("mass_unit", mass_unit, written.units[1], MASSES),
    ):
        if given != "auto" and abs(stated / known[given] - 1) > 1e-6:
            si = "m" if key == "unit" else "kg"
            raise RequestError(
                f'{key} = "{given}", and dataset {UNITS} of {path} states {stated:.6g} {si}; leave {key} out, or take '
                f"dataset {UNITS} out of the file"
            )
    return written.units


def _read_npz(path: Path) -> _Written:
    names = ("nodes", "frequencies", "shapes", "modal_mass")
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {name: np.asarray(file[name]) for name in names if name in file}
    except Exception as error:  # of NumPy, zipfile and zlib
        raise RequestError(f"{path} cannot be read as .npz; write it by numpy.savez") from error
    missing = [name for name in names if name not in found]
    if missing:
        raise RequestError(f"{path} has no array {', '.join(missing)}; it must hold {', '.join(names)}")
    if any(np.iscomplexobj(each) for each in found.values()):
        raise RequestError(f"the modes in {path} are complex; export the real modes of the undamped shoe")
    try:
        nodes, frequencies, shapes, mass = (np.asarray(found[name], dtype=float) for name in names)
        mass = np.broadcast_to(mass, frequencies.shape)
    except ValueError:
        raise RequestError(f"{path}: the arrays must be of numbers, and modal_mass one or one for each mode") from None
    wanted = (len(frequencies) if frequencies.ndim == 1 else -1, len(nodes) if nodes.ndim == 2 else -1, 3)
    if shapes.shape != wanted or nodes.shape[1:] != (3,):
        raise RequestError(
            f"{path}: nodes {nodes.shape}, frequencies {frequencies.shape} and shapes {shapes.shape} must be (n, 3), "
            "(m,) and (m, n, 3)"
        )
    return _Written(nodes, frequencies, shapes, mass, None)


def _read_universal(path: Path) -> _Written:
    sets = read_datasets(path, (*NODES, MODES, SYSTEMS))
    nodes = [each for each in sets if each["type"] in NODES]
    shapes = [each for each in sets if each["type"] == MODES and each.get("spec_data_type", 8) in _MOTIONS]
    modes = [each for each in shapes if each["analysis_type"] == _NORMAL and each["data_type"] == _REAL]
    if len(modes) < len(shapes) and any(each["data_type"] == _COMPLEX for each in shapes):
        raise RequestError(f"the modes in {path} are complex; export the real modes of the undamped shoe")
    if not nodes or not modes:
        lacks = f"nodes (dataset {NODES[0]} or {NODES[1]})" if not nodes else f"normal modes (dataset {MODES})"
        raise RequestError(f"{path} holds no {lacks}; export nodes and normal modes")
    _check_global(nodes, [each for each in sets if each["type"] == SYSTEMS], path)
    labels = np.concatenate([np.asarray(each["node_nums"], dtype=int) for each in nodes])
    places = np.concatenate([np.stack([each[axis] for axis in "xyz"], axis=1).astype(float) for each in nodes])
    labels, first, same = np.unique(labels, return_index=True, return_inverse=True)
    if np.any(other := np.any(places != places[first][same], axis=1)):
        raise RequestError(f"{path}: node {labels[same[np.argmax(other)]]} has two places; number nodes anew")
    moved = np.unique(np.concatenate([each["node_nums"] for each in modes]))
    lost = np.setdiff1d(moved, labels)
    if len(lost):
        raise RequestError(f"{path}: {len(lost)} nodes of its modes have no place, the first is {lost[0]}; export them")
    found = np.zeros((len(modes), len(moved), 3))  # a node that does not move may be left out of a mode
    for shape, each in zip(found, modes, strict=True):
        shape[np.searchsorted(moved, each["node_nums"])] = np.stack([each[r] for r in ("r1", "r2", "r3")], axis=1)
    frequencies, masses = (np.array([each[key] for each in modes], dtype=float) for key in ("freq", "modal_m"))
    stated, *others = {each["units"] for each in (*nodes, *modes)}
    if others:
        raise RequestError(f"{path} states other units for some of its nodes and modes; export all in the same")
    # The unit of mass is that which a force of one gives one unit of length a second squared.
    units = None if stated is None else (stated[0], stated[1] / stated[0])
    return _Written(places[first][np.searchsorted(labels, moved)], frequencies, found, masses, units)


def _check_global(nodes: list[dict[str, Any]], tables: list[dict[str, Any]], path: Path) -> None:
    """Raise RequestError of nodes whose places or displacements are along other axes than x, y, z."""
    used = {int(each) for found in nodes for key in ("def_cs", "disp_cs") for each in found[key]}
    for table in tables:
        for label, kind, axes in zip(table["CS_sys_labels"], table["CS_types"], table["CS_matrices"], strict=True):
            if label in used and (kind != _CARTESIAN or np.any(np.abs(axes - np.eye(4, 3)) > ROUNDED)):
                raise RequestError(
                    f"{path}: nodes are in the coordinate system {label}, which is not the global one; export places "
                    "and shapes along global x, y and z"
                )


def _check(written: _Written, path: Path) -> None:
    for what, count in (("nodes", len(written.nodes)), ("modes", len(written.frequencies))):
        if not count:
            raise RequestError(f"{path} holds no {what}; export nodes and normal modes")
    if not all(np.all(np.isfinite(each)) for each in written[:4]):
        raise RequestError(f"{path} holds numbers that are not finite; export it again")
    still = np.flatnonzero(np.all(written.shapes == 0, axis=(1, 2)))
    if len(still):
        raise RequestError(f"{path}: the shape of mode {still[0] + 1} is zero at all nodes; export its displacements")
    wrong = np.flatnonzero(written.modal_mass <= 0)
    if len(wrong):
        raise RequestError(
            f"{path}: the modal mass of mode {wrong[0] + 1} is {written.modal_mass[wrong[0]]:g}, and must be positive; "
            "export modal masses, or shapes of unit modal mass with 1"
        )
