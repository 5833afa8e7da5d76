"""Modes and inertia of a shoe from modal results of another code, which are known at nodes alone."""

import functools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import Delaunay, QhullError

from drumsqueal.errors import RequestError
from drumsqueal.files.universal import MODES, UNITS, read_datasets
from drumsqueal.physics.bodies.elements import Indices, Reals
from drumsqueal.physics.bodies.lining_surface import ROUND, WHOLE, CylinderSurface, SampledSurface, arc_of, project
from drumsqueal.physics.bodies.mesh_files import MASS_UNITS, USUAL_MASS
from drumsqueal.physics.bodies.solid_elements import Inertia, inertia_of, rigid_motions
from drumsqueal.physics.bodies.solid_modes import SolidModes, principal_axes, signs_at_corner

# Modal results of other codes as they stand in their files: nodes, frequencies and shapes of a free body. Beside these
# modal masses (m,), and metres and kilograms of the file's units where it states them.

Units = tuple[float, float] | None
NODES, _SYSTEMS = (15, 2411), 2420  # datasets


class ModalResults(NamedTuple):
    """Nodes (n, 3) in m, frequencies (m,) in Hz that rise, and shapes (m, n, 3) in kg^-½, of unit modal mass."""

    nodes: Reals
    frequencies: Reals
    shapes: Reals


def read_modal_results(path: str | Path, unit: str = "auto", mass_unit: str = "auto") -> ModalResults:
    """Read a universal file or .npz; "auto" is the unit that the file states, or of masses the usual one with a length.

    Raises RequestError.
    """
    path = Path(path)
    if path.suffix.lower() not in (".unv", ".uff", ".uf", ".u55", ".npz"):
        raise RequestError(f"{path} is neither a universal file (.unv, .uff) nor .npz; export one of them")
    written, modal_mass, units = _read_npz(path) if path.suffix.lower() == ".npz" else _read_universal(path)
    _check(written, modal_mass, path)
    length, mass = _factors(units, path, unit, mass_unit)
    order = np.argsort(written.frequencies, kind="stable")
    shapes = written.shapes / np.sqrt(modal_mass * mass)[:, None, None]
    return ModalResults(written.nodes * length, written.frequencies[order], shapes[order])


def _factors(units: Units, path: Path, unit: str, mass_unit: str) -> tuple[float, float]:
    """Metres and kilograms that the file's units are."""
    lengths = {"m": 1.0, "mm": 1e-3}
    if units is None:
        if unit == "auto":
            raise RequestError(f'{path} does not state its units; add unit = "mm", or "m"')
        return lengths[unit], MASS_UNITS[USUAL_MASS[unit] if mass_unit == "auto" else mass_unit]
    for key, given, stated, known in (
        ("unit", unit, units[0], lengths),
        ("mass_unit", mass_unit, units[1], MASS_UNITS),
    ):
        if given != "auto" and abs(stated / known[given] - 1) > 1e-6:
            si = "m" if key == "unit" else "kg"
            raise RequestError(
                f'{key} = "{given}", and dataset {UNITS} of {path} states {stated:.6g} {si}; leave {key} out, or take '
                f"dataset {UNITS} out of the file"
            )
    return units


def _read_npz(path: Path) -> tuple[ModalResults, Reals, Units]:
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
    return ModalResults(nodes, frequencies, shapes), mass, None


def _read_universal(path: Path) -> tuple[ModalResults, Reals, Units]:
    normal, of_real, of_complex = 2, 2, 5  # type of an analysis, and of data
    sets = read_datasets(path, (*NODES, MODES, _SYSTEMS))
    nodes = [each for each in sets if each["type"] in NODES]
    # Specific data types: not known, general, displacement.
    shapes = [each for each in sets if each["type"] == MODES and each.get("spec_data_type", 8) in (0, 1, 8)]
    modes = [each for each in shapes if each["analysis_type"] == normal and each["data_type"] == of_real]
    if len(modes) < len(shapes) and any(each["data_type"] == of_complex for each in shapes):
        raise RequestError(f"the modes in {path} are complex; export the real modes of the undamped shoe")
    if not nodes or not modes:
        lacks = f"nodes (dataset {NODES[0]} or {NODES[1]})" if not nodes else f"normal modes (dataset {MODES})"
        raise RequestError(f"{path} holds no {lacks}; export nodes and normal modes")
    _check_global(nodes, [each for each in sets if each["type"] == _SYSTEMS], path)
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
    return ModalResults(places[first][np.searchsorted(labels, moved)], frequencies, found), masses, units


def _check_global(nodes: list[dict[str, Any]], tables: list[dict[str, Any]], path: Path) -> None:
    """Raise RequestError of nodes whose places or displacements are along other axes than x, y, z."""
    used = {int(each) for found in nodes for key in ("def_cs", "disp_cs") for each in found[key]}
    for table in tables:
        for label, kind, axes in zip(table["CS_sys_labels"], table["CS_types"], table["CS_matrices"], strict=True):
            # Type 0 is a Cartesian system; 1e-6 of its axes, which files have to seven digits.
            if label in used and (kind != 0 or np.any(np.abs(axes - np.eye(4, 3)) > 1e-6)):
                raise RequestError(
                    f"{path}: nodes are in the coordinate system {label}, which is not the global one; export places "
                    "and shapes along global x, y and z"
                )


def _check(written: ModalResults, modal_mass: Reals, path: Path) -> None:
    for what, count in (("nodes", len(written.nodes)), ("modes", len(written.frequencies))):
        if not count:
            raise RequestError(f"{path} holds no {what}; export nodes and normal modes")
    if not all(np.all(np.isfinite(each)) for each in (*written, modal_mass)):
        raise RequestError(f"{path} holds numbers that are not finite; export it again")
    still = np.flatnonzero(np.all(written.shapes == 0, axis=(1, 2)))
    if len(still):
        raise RequestError(f"{path}: the shape of mode {still[0] + 1} is zero at all nodes; export its displacements")
    wrong = np.flatnonzero(modal_mass <= 0)
    if len(wrong):
        raise RequestError(
            f"{path}: the modal mass of mode {wrong[0] + 1} is {modal_mass[wrong[0]]:g}, and must be positive; "
            "export modal masses, or shapes of unit modal mass with 1"
        )


NEAR = 1e-3  # m from a node: how far a point of a spring or of a force may be


class LiningNodes(NamedTuple):
    """The surface, which of the nodes (l,) are on it, and the area of each (l,)."""

    surface: CylinderSurface
    nodes: Indices
    area: Reals


def find_given_modes(results: ModalResults, highest_hz: float) -> SolidModes:
    """Elastic modes up to a frequency, and the inertia that the rigid-body modes hold. Raises RequestError."""
    lining, elastic = find_lining(results.nodes), elastic_modes(results)
    kept = elastic[results.frequencies[elastic] <= highest_hz]
    shapes = results.shapes[kept]
    x, y, z = results.nodes[lining.nodes].T
    theta = np.arctan2(y, x)
    cosine, sine = np.cos(theta), np.sin(theta)
    u_x, u_y, u_z = shapes[:, lining.nodes].transpose(2, 0, 1)
    polar = np.stack([cosine * u_x + sine * u_y, cosine * u_y - sine * u_x, u_z], axis=1)
    coefficients, errors = project(SampledSurface(theta, z, lining.area, polar), lining.surface, of_nodes=True)
    signs = signs_at_corner(coefficients)[:, None, None]
    inertia = find_inertia(results)
    moments, axes = principal_axes(inertia.tensor)
    return SolidModes(
        frequencies=results.frequencies[kept],
        mass=inertia.mass,
        centre=inertia.centre,
        moments=moments,
        axes=axes,
        lining=lining.surface,
        coefficients=coefficients * signs[..., None],
        fit_error=float(np.max(errors, initial=0.0)),
        shapes=shapes * signs,
        moved=functools.partial(_motion_of_nodes, results.nodes, shapes * signs),
    )


def _motion_of_nodes(nodes: Reals, shapes: Reals, points: Reals, radii: Reals) -> Reals:
    """u_x, u_y, u_z (k, 3, m) at points (k, 3): means over the nodes within radii (k,), or of the nearest one."""
    away = np.linalg.norm(nodes - points[:, None], axis=2)
    within = away <= np.maximum(radii, np.min(away, axis=1))[:, None]
    return np.einsum("kn,mni->kim", within / np.sum(within, axis=1, keepdims=True), shapes)


def nearest_nodes(nodes: Reals, points: Reals) -> tuple[Indices, Reals]:
    """The node (k,) that is nearest to each of the points (k, 3), and how far it is (k,) in m."""
    away = np.linalg.norm(nodes - points[:, None], axis=2)
    return np.argmin(away, axis=1), np.min(away, axis=1)


def elastic_modes(results: ModalResults) -> Indices:
    """Which of the modes are elastic; raises RequestError unless the others are six rigid motions near 0 Hz."""
    rigid, _ = _rigid_parts(results)
    count, elastic = int(np.sum(rigid)), np.flatnonzero(~rigid)
    cure = "export all modes from 0 Hz on of the shoe with nothing holding it, the six rigid-body modes among them"
    if count != 6:
        raise RequestError(f"{count} of the modes are rigid-body modes, and must be 6; {cure}")
    lowest = np.min(results.frequencies[elastic], initial=np.inf)
    highest = np.max(np.abs(results.frequencies[rigid]))
    if highest > 0.1 * lowest:  # of the lowest elastic frequency: a rigid motion above that is one on springs
        raise RequestError(
            f"a rigid-body mode is at {highest:.4g} Hz, as something holds the shoe, and must be near 0; {cure}"
        )
    return elastic


def _rigid_parts(results: ModalResults) -> tuple[Any, Any]:
    """Which modes are rigid motions (m,), and the nearest rigid motion of each (6, m), by least squares."""
    motions, flat = rigid_motions(results.nodes), results.shapes.reshape(len(results.shapes), -1).T
    found = np.linalg.lstsq(motions, flat)[0]
    missed, total = (np.sum(each**2, axis=0) for each in (flat - motions @ found, flat))
    # A rigid motion may miss 1e-2 of a shape. Elastic ones are orthogonal to these, and miss nearly all.
    return missed < 1e-2**2 * total, found


def find_inertia(results: ModalResults) -> Inertia:
    """Mass, centre and tensor of inertia by the rigid-body modes.

    With R the rigid motions of all nodes, modes φ_j = R r_j of unit modal mass have r_jᵀ (RᵀMR) r_k = δ_jk. So the
    rigid mass matrix RᵀMR is the inverse of Σ r_j r_jᵀ.
    """
    elastic, (_, parts) = elastic_modes(results), _rigid_parts(results)
    parts, moved = np.delete(parts, elastic, axis=1), np.delete(results.shapes, elastic, axis=0)
    sizes = np.linalg.norm(moved, axis=2), np.max(np.abs(moved), axis=2)
    own_masses = "export shapes of unit modal mass, or the modal masses that belong to the shapes"
    for scaled_to, each, reach in (
        ("the same largest displacement", np.max(sizes[0], axis=1), "the distance of the farthest node"),
        ("the same largest displacement", np.max(sizes[1], axis=1), "the distance of the farthest node"),
        ("one length as vectors", np.linalg.norm(sizes[0], axis=1), "that of equal masses at all nodes"),
    ):
        # 1e-4 of a displacement or a modal mass, of which files have six digits: below it two are the same
        if np.ptp(each) < 1e-4 * np.max(each):
            raise RequestError(
                f"the rigid-body modes have {scaled_to} for the same modal mass: each radius of gyration would be "
                f"{reach}. The shapes were scaled to it, and the modal masses are not theirs; {own_masses}"
            )
    values = np.linalg.svd(parts / np.linalg.norm(parts, axis=1, keepdims=True), compute_uv=False)
    alike = 1e-2  # of the mass: how far it may differ along x, y and z
    if values[-1] < alike * values[0]:
        raise RequestError("the six rigid-body modes are not independent; export each of them once")
    inner: Any = np.linalg.inv(parts @ parts.T)
    masses = np.diag(inner)[:3]
    if np.max(np.abs(inner[:3, :3] - np.mean(masses) * np.eye(3))) > alike * np.mean(masses):
        raise RequestError(
            f"by its rigid-body modes the shoe weighs {', '.join(f'{each:.4g}' for each in masses)} kg along x, y and "
            f"z, which must be equal; {own_masses}"
        )
    return inertia_of(inner)


def find_lining(nodes: Reals) -> LiningNodes:
    """The nodes at the largest radius about z; raises RequestError where they do not fill a rectangle in θ and z."""
    radii = np.hypot(nodes[:, 0], nodes[:, 1])
    radius = float(np.max(radii))
    on = np.flatnonzero(radii > (1 - ROUND) * radius)
    theta, z = np.arctan2(nodes[on, 1], nodes[on, 0]), nodes[on, 2]
    what = f"the {len(on)} nodes at the largest radius about z, {radius:.6g} m, which are taken to be the lining's"
    try:
        triangles = Delaunay(np.stack([radius * theta, z], axis=1)).simplices
    except (QhullError, ValueError):
        raise RequestError(
            f"{what}, lie in one line; the axis of the drum must be z, and the lining outermost"
        ) from None
    arc, width = arc_of(theta, "lining"), float(np.ptp(z))
    corners = np.stack([theta, z], axis=1)[triangles]  # (t, 3, 2)
    along, across = (corners[:, 1:] - corners[:, :1]).transpose(1, 0, 2)
    areas = np.abs(along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]) / 2
    spans = np.ptp(corners, axis=1)
    usual = np.array([_median(each, areas) for each in spans.T])
    distances = np.array([arc, width]) / usual
    # Beyond three times the usual distance between nodes there is a gap.
    share = np.sum(areas[np.all(spans <= 3.0 * usual, axis=1)]) / (arc * width)
    if abs(share - 1) > WHOLE:
        raise RequestError(
            f"{what}, fill {100 * share:.3g} % of {np.degrees(arc):.4g} deg by {width:.4g} m; they must fill a whole "
            "rectangle in θ and z, without holes or slots, and nothing else may be as far out"
        )
    fewest = 8, 2  # distances between nodes along the lining and across it
    if np.any(distances < np.array(fewest) - 0.5):
        lines = " by ".join(f"{each + 1:.0f}" for each in distances)
        raise RequestError(f"{what}, are too few: some {lines}; it takes {fewest[0] + 1} by {fewest[1] + 1} at least")
    area: Any = np.bincount(triangles.ravel(), np.repeat(areas / 3, 3), minlength=len(on))
    edges = float(distances[0] / 2), float(distances[1] / 2)  # of elements with nodes in the middles of their edges
    return LiningNodes(CylinderSurface(radius, arc, width, float((np.max(z) + np.min(z)) / 2), edges), on, area)


def _median(values: Reals, weights: Reals) -> float:
    """The value below which half of the weights are."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, total[-1] / 2)]])


def depth_of(nodes: Reals) -> float:
    """How far the nodes reach from the lining inwards (m): what is drawn as the thickness of the shoe."""
    radii = np.hypot(nodes[:, 0], nodes[:, 1])
    # 0.02 of the radius is drawn where the nodes are those of the lining alone.
    return float(max(np.ptp(radii), 0.02 * np.max(radii)))
