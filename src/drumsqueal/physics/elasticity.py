"""The elastic modes of a scene's shoe and drum: their names, frequencies and shapes, found once for each scene."""

import functools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.physics.basis import Part, Side, motions, side_of, yielding
from drumsqueal.physics.bodies.drum_modes import MOST_AROUND, DrumModes, find_drum_modes
from drumsqueal.physics.bodies.free_modes import MOST_OF_DENTS, FreeModes, find_free_modes, shortest_waves
from drumsqueal.physics.bodies.given_modes import find_given_modes
from drumsqueal.physics.bodies.held_points import patch_rows
from drumsqueal.physics.bodies.solid_elements import masses_of
from drumsqueal.physics.bodies.solid_mesh import SolidMesh
from drumsqueal.physics.bodies.solid_modes import EVERYWHERE, Material, SolidModes, find_clamped_drum, find_free_solid
from drumsqueal.physics.structure import DRUM_SHAPES, DRUM_WAVENUMBERS, MESH, SHAPES, WAVENUMBERS, Composition
from drumsqueal.precision import real
from drumsqueal.scene import COORDINATES, Scene
from drumsqueal.scene.coordinates import DRUM, shape_names
from drumsqueal.scene.mesh import SIZES, DrumMesh, MeshMaterial, ShoeMesh
from drumsqueal.scene.shoe_modes import ShoeModes
from drumsqueal.scene.usual import unusual

Reals = NDArray[np.float64]

SHAPING = ("shoe.outer_radius", "shoe.thickness", "shoe.width", "shoe.arc_angle", "shoe.elastic.poisson")
DRUM_SHAPING = ("shoe.outer_radius", *(f"drum.elastic.{key}" for key in ("thickness", "width", "back_plate")))
DRUM_SHAPING += ("drum.elastic.hub_radius", "drum.elastic.poisson")
STEP_OF_DEGREES = 4
UNBENT = 1.0  # Pa: of a mesh that is rigid, and has no modes that this could change
# Times the frequency up to which shapes are kept: so far own modes are among those from which they are taken. What is
# beyond yields nearly statically, which answers to forces hold.
TRIED = 2.0
# Times that frequency: shapes that would ring above it get as much more mass, or they would hold up the integration of
# motion that they follow statically. Their stiffness, which is what they are for, is as it is.
HEAVIER = 4.0
MOST_BRAKES = 32
# Motion is resolved where growth rates stay as they are, to 1/s or to a fraction, which experiments cannot tell apart,
# with shapes up to so many times the frequency, which are some so many times as many of a plate.
MORE, CLOSE, CLOSE_FRACTION = 1.6, 1.0, 0.01
MOST_STEPS = 4
COUPLING = 0.5  # the coefficient of friction with which that is looked for
# What shapes depend on, of the brake's numbers.
YIELDING = ("shoe.", "drum.elastic.", "drum.mesh.", "contact.stiffness", "support.")


def up_to_of(scene: Scene, body: str) -> float:
    """Up to which frequency (Hz) motion of the "shoe" or the "drum" is resolved."""
    _, table = scene.elastic_table(body)
    return _found_up_to(scene) if table.up_to == "auto" else table.up_to


def free_modes(scene: Scene) -> FreeModes | None:
    """In which shapes the scene's sector bends: free modes up to the frequency asked for, and what `basis.py` adds.

    None of a rigid one, and of a file.
    """
    shoe = scene.shoe
    return None if shoe.elastic is None or shoe.solid is not None else _shoe_in_brake(scene)


def drum_modes(scene: Scene) -> DrumModes | None:
    """The same of the scene's drum, by its modes when clamped at its hub; None of a rigid one."""
    return None if scene.elastic_table("drum")[1] is None else _drum_in_brake(scene)


def _once(find: Callable[[Scene], Any]) -> Callable[[Scene], Any]:
    """Find shapes once for all scenes that have the same bodies, springs and stiffness of the lining."""
    known: dict[Any, Any] = {}

    @functools.wraps(find)
    def of(scene: Scene) -> Any:
        numbers = (item for item in scene.numbers().items() if item[0].startswith(YIELDING) and ".size" not in item[0])
        tables = [scene.elastic_table("drum")[1], *(shoe.elastic for shoe in scene.shoes)]
        up_to = tuple(table and table.up_to for table in tables)
        places = tuple(getattr(shoe, "position", 0.0) for shoe in scene.shoes)
        key = (
            tuple(numbers),
            scene.steady.state,
            up_to,
            places,
            tuple(shoe.solid for shoe in scene.shoes),
            scene.drum.mesh,
            _patches(scene),
        )
        if key not in known:
            if len(known) >= MOST_BRAKES:
                known.pop(next(iter(known)))
            known[key] = find(scene)
        return known[key]

    return of


@_once
def _shoe_in_brake(scene: Scene) -> Any:
    """Shapes of a shoe with its drum, other shoes left out."""
    trial, elastic = _trial_of_shoe(scene), scene.shoe.elastic
    assert elastic is not None
    whole, parts = _assembled(scene)
    parity = np.array(trial.symmetric if scene.planar else [False] * len(parts[0].own))
    return trial.combined(_sums(parts[0], whole, up_to_of(scene, "shoe"), parity))


@_once
def _drum_in_brake(scene: Scene) -> DrumModes:
    trial = _trial_of_drum(scene)
    assert trial is not None
    whole, parts = _assembled(scene)
    return trial.combined(_sums(parts[-1], whole, up_to_of(scene, "drum")))


def _sums(part: Part, whole: Side, up_to: float, parity: NDArray[np.bool_] | None = None) -> Reals:
    """A body's modes up to a frequency (Hz), and sums of its other trial shapes in which it yields besides, (k, m)."""
    highest = 2 * np.pi * up_to
    count = int(np.sum(part.own <= highest))
    groups = np.zeros(len(part.own), dtype=bool) if parity is None else parity
    more = yielding(part, count, whole.stiffness, motions(whole, highest), groups)
    sums = np.concatenate([np.eye(len(part.own))[:, :count], *more], axis=1)
    frequencies = np.sqrt(np.einsum("ij,i->j", sums**2, part.own**2))
    sums *= np.minimum(1.0, HEAVIER * highest / frequencies)
    return sums[:, np.argsort(frequencies, kind="stable")].T


@_once
def _found_up_to(scene: Scene) -> float:
    """The least frequency (Hz) with which eigenvalues stay as they are with half as many again, found step by step.

    From the highest frequency of rigid bodies on the lining on, without damping and with a coefficient of friction as
    high as linings have, so that it is the same for all of them. Modal results are taken as far as they go.
    """
    given = [shoe.modes.read().frequencies.max() for shoe in scene.shoes if shoe.modes and shoe.elastic]
    if given:
        return float(min(given))
    up_to = _highest_of_rigid(scene)
    before = _eigenvalues(_with_up_to(scene, up_to), up_to)
    for _ in range(MOST_STEPS):
        after = _eigenvalues(_with_up_to(scene, MORE * up_to), up_to)
        growing = before[before.real > CLOSE].imag
        compared = before[before.imag <= (np.max(growing) if growing.size else 2 * np.pi * up_to)]
        known: Any = np.append(after, np.inf)  # nothing is near where nothing is found
        nearest = known[np.argmin(np.abs(compared[:, None] - known), axis=1)]
        change = np.abs(nearest.real - compared.real)
        if np.all(change <= np.maximum(CLOSE, CLOSE_FRACTION * np.abs(compared.real))):
            break
        up_to, before = MORE * up_to, after
    return up_to


def _open_tables(scene: Scene) -> Iterator[str]:
    """Keys of the tables whose frequency is to be found."""
    tables = [(scene.key_of(k, "shoe.elastic"), shoe.elastic) for k, shoe in enumerate(scene.shoes)]
    return (key for key, table in [*tables, scene.elastic_table("drum")] if table and table.up_to == "auto")


def _with_up_to(scene: Scene, up_to: float) -> Scene:
    """The scene with a frequency (Hz) in place of each that is to be found."""
    return scene.with_values({f"{key}.up_to": up_to for key in _open_tables(scene)})


def _highest_of_rigid(scene: Scene) -> float:
    """The highest frequency (Hz) of rigid shoes on a rigid drum, in full contact. Raises RequestError where it is 0."""
    bare: dict[str, Any] = {f"{body}.elastic": None for body in ("shoe", "drum")} | {"drum.mesh": None}
    bare |= {"start.displacement": {}, "start.velocity": {}, "forcing": None, "uncertain": None}
    found = []
    for one in scene.alone:
        rigid = one.with_values({**bare, "simulate.coordinates": "auto"})
        side, _ = _side(rigid, 0.0)
        scale = 1 / np.sqrt(side.mass)
        found.append(np.linalg.eigvalsh(scale[:, None] * side.stiffness * scale)[-1])
    if max(found) <= 0:
        raise RequestError(
            'up_to = "auto" begins at the highest frequency of rigid bodies, and nothing holds a shoe here: write a '
            "frequency, or a contact stiffness above 0"
        )
    return float(np.sqrt(max(found)) / (2 * np.pi))


def _eigenvalues(scene: Scene, below: float) -> NDArray[np.complex128]:
    """Those (1/s) up to a frequency (Hz), the growing one of each two, of all that bends as far as the scene states."""
    whole, parts = _assembled(scene)
    bodies = [up_to_of(one, "shoe") if one.shoe.elastic is not None else None for one in scene.alone]
    bodies.append(up_to_of(scene, "drum") if scene.elastic_table("drum")[1] is not None else None)
    elastic = np.concatenate([part.places for part in parts])
    columns = [np.delete(np.eye(len(whole.mass)), elastic, axis=1)]
    for part, up_to in zip(parts, bodies, strict=True):
        if up_to is not None:
            columns.append(np.zeros((len(whole.mass), len(sums := _sums(part, whole, up_to)))))
            columns[-1][part.places] = sums.T
    kept = np.concatenate(columns, axis=1)
    forces = kept.T @ (whole.stiffness - COUPLING * whole.drag) @ kept
    values = np.sqrt(-np.linalg.eigvals(np.linalg.solve(kept.T @ (whole.mass[:, None] * kept), forces)).astype(complex))
    values: Any = np.abs(values.real) + 1j * np.abs(values.imag)  # of each four ±λ, ±λ*
    return values[(values.imag > 0) & (values.imag <= 2 * np.pi * MORE * below)]


def _assembled(scene: Scene) -> tuple[Side, list[Part]]:
    """The frictionless brake over trial shapes, and the parts of its shoes and of the drum."""
    if any(_open_tables(scene)):
        scene = _with_up_to(scene, _found_up_to(scene))  # of the whole brake: each shoe alone would find its own
    sides = [_side(one, getattr(shoe, "position", None)) for one, shoe in zip(scene.alone, scene.shoes, strict=True)]
    of_drum = _own_frequencies(scene, "drum")
    ends = np.cumsum([0, *(len(side.mass) - len(of_drum) for side, _ in sides)])
    drum = ends[-1] + np.arange(len(of_drum))
    size = ends[-1] + len(of_drum)
    mass, stiffness, drag = (
        np.ones(size),
        np.diag(np.concatenate([np.zeros(ends[-1]), of_drum**2])),
        np.zeros((size, size)),
    )
    parts, loads = [], []
    for first, last, (side, own) in zip(ends[:-1], ends[1:], sides, strict=True):
        places = np.concatenate([np.arange(first, last), drum])
        mass[places] = side.mass
        stiffness[np.ix_(places, places)] += side.stiffness
        drag[np.ix_(places, places)] += side.drag
        loads.append(np.zeros((len(side.loads), size)))
        loads[-1][:, places] = side.loads
        elastic = np.arange(last - len(own), last)
        stiffness[elastic, elastic] += own**2
        parts.append(Part(elastic, own))
    return Side(mass, stiffness, drag, np.concatenate(loads)), [*parts, Part(drum, of_drum)]


def _side(scene: Scene, position: float | None) -> tuple[Side, Reals]:
    """One shoe with the drum under it, and the shoe's own frequencies."""
    shoe, drum = _trial_of_shoe(scene), _trial_of_drum(scene)
    value = scene.numbers() | ({} if position is None else {"shoe.position": position})
    value |= _numbers_of_mesh(scene, shoe) if scene.shoe.solid is not None else {}
    value |= modal_numbers(shoe) if isinstance(shoe, FreeModes) else {}
    value |= {} if drum is None else drum_numbers(drum) | _ring(scene)
    own, of_drum = _own_frequencies(scene, "shoe"), _own_frequencies(scene, "drum")
    composition = Composition(
        coordinates=(*COORDINATES, *shape_names(0, len(own)), *shape_names(0, len(of_drum), DRUM)),
        steady_state=scene.steady.state,
        support=scene.support is not None,
        springs=len(scene.shoe.spring),
        pushes=len(scene.shoe.force),
        symmetric_modes=(False,) * len(own),
        mesh=scene.shoe.solid is not None,
    )
    needed = {key: real(each) for key, each in value.items() if key.startswith((*YIELDING, "shoe.position"))}
    return side_of(composition, needed), own


def _own_frequencies(scene: Scene, body: str) -> Reals:
    """Circular frequencies (rad/s) of the trial shapes of the "shoe" or the "drum"; none of a rigid one."""
    trial = _trial_of_drum(scene) if body == "drum" else _trial_of_shoe(scene)
    return 2 * np.pi * np.array(_hertz(scene, body, trial))


def _patches(scene: Scene) -> tuple[tuple[float, float, float, float], ...]:
    """Where springs and forces act on the scene's shoe, and over which radius."""
    shoes = [shoe.with_radii for shoe in scene.shoes]
    places: Any = ((*each.at, each.radius or 0.0) for shoe in shoes for each in (*shoe.spring, *shoe.force))
    return tuple(dict.fromkeys(places))


def _trial_of_shoe(scene: Scene) -> Any:
    """The shapes from which those of a shoe are taken; None of a rigid one."""
    shoe, elastic = scene.shoe, scene.shoe.elastic
    if shoe.solid is not None:
        return _trial_of_mesh(scene)
    if elastic is None:
        return None
    highest = TRIED * 2 * math.pi * up_to_of(scene, "shoe") * math.sqrt(shoe.density / elastic.young)
    sizes = shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle
    try:
        return find_free_modes(*sizes, elastic.poisson, highest, _patches(scene))
    except ArithmeticError as error:
        raise RequestError(f"the shoe's free modes were not found: {error}") from None
    except RequestError as error:  # which a number in a wrong unit may have brought about
        raise RequestError("; ".join([str(error), *unusual(scene)])) from None


def _trial_of_drum(scene: Scene) -> DrumModes | None:
    """The same of the drum."""
    _, drum = scene.elastic_table("drum")
    if drum is None:
        return None
    highest = TRIED * 2 * math.pi * up_to_of(scene, "drum") * math.sqrt(drum.density / drum.young)
    if scene.drum.mesh is not None:
        return _drum_mesh_modes(drum, highest)
    sizes = drum.thickness, drum.width, drum.back_plate, drum.hub_radius
    try:
        return find_drum_modes(scene.shoes[0].outer_radius, *sizes, drum.poisson, highest, dents=True)
    except RequestError as error:  # which a number in a wrong unit may have brought about
        raise RequestError("; ".join([str(error), *unusual(scene)])) from None


def mesh_modes(scene: Scene) -> SolidModes | None:
    """Inertia and shapes of the scene's mesh or modal results, none of a rigid one's; None of a sector."""
    if scene.shoe.solid is None:
        return None
    return _trial_of_mesh(scene) if scene.shoe.elastic is None else _shoe_in_brake(scene)


def meshes_of(scene: Scene) -> Iterator[tuple[str, str, SolidMesh, Reals]]:
    """Of each mesh the body, the file, the elements and the mass of each of these (e,), in kg."""
    for name, one in zip(scene.shoe_names, scene.alone, strict=True):
        if (shoe := one.shoe.mesh) is not None:
            mesh = shoe.read()
            yield f"{name} shoe".strip(), shoe.file, mesh, masses_of(mesh, dict(_solid_of(one)[0]))
    if (drum := scene.drum.mesh) is not None:
        mesh, own = drum.read(), Material(drum.young, drum.poisson, drum.density)
        yield "drum", drum.file, mesh, masses_of(mesh, dict(_materials(drum.material, own)))


def _solid_of(scene: Scene) -> tuple[tuple[tuple[str, Material], ...], float]:
    """Materials by sets of elements, and up to which frequency (Hz) modes are asked for."""
    shoe, elastic = scene.shoe, scene.shoe.elastic
    if shoe.modes is not None:
        return (), 0.0 if elastic is None else up_to_of(scene, "shoe")
    own = Material(*(UNBENT, 0.0) if elastic is None else (elastic.young, elastic.poisson), shoe.density)
    named = () if shoe.mesh is None else shoe.mesh.material
    return _materials(named, own), 0.0 if elastic is None else up_to_of(scene, "shoe")


def _materials(
    named: tuple[MeshMaterial, ...], own: Material, young: float = 1.0, density: float = 1.0
) -> tuple[tuple[str, Material], ...]:
    """Materials by sets of elements, and of those in none of them, for so large a unit of E and ρ."""
    found = [(each.set, Material(each.young, each.poisson, each.density)) for each in named]
    return tuple((key, Material(e / young, nu, rho / density)) for key, (e, nu, rho) in [*found, (EVERYWHERE, own)])


def _trial_of_mesh(scene: Scene) -> SolidModes:
    shoe, elastic = scene.shoe, scene.shoe.elastic
    file: Any = shoe.solid
    waves = 0.0
    if elastic is not None and shoe.mesh is not None:
        highest = TRIED * 2 * math.pi * up_to_of(scene, "shoe") * math.sqrt(shoe.density / elastic.young)
        waves = shortest_waves(shoe.thickness, elastic.poisson, highest)
    return _solid_modes(file, *_solid_of(scene), waves, _patches(scene))


@functools.lru_cache(maxsize=32)
def _solid_modes(
    solid: ShoeMesh | ShoeModes,
    materials: tuple[tuple[str, Material], ...],
    up_to: float,
    waves: float,
    patches: tuple[tuple[float, float, float, float], ...],
) -> SolidModes:
    if isinstance(solid, ShoeModes):
        return find_given_modes(solid.read(), TRIED * up_to)
    mesh, sizes, held = solid.read(), solid.sizes(), None
    pressures = _pressures(waves, sizes["outer_radius"] * sizes["arc_angle"], sizes["width"]) if waves else None
    if pressures is not None and patches:
        held = patch_rows(mesh, np.array(patches)[:, :3], np.array(patches)[:, 3])
    try:
        return find_free_solid(mesh, dict(materials), solid.lining, TRIED * up_to, pressures, held)
    except ArithmeticError as error:
        raise RequestError(f"the shoe's free modes were not found: {error}") from None


def _pressures(waves: float, along: float, across: float) -> tuple[int, int]:
    """How many polynomials follow waves (1/m) on a lining so long and so wide (m)."""
    along, across = (min(math.ceil(waves * size / 2), MOST_OF_DENTS) + 1 for size in (along, across))
    return along, across


@functools.lru_cache(maxsize=32)
def _drum_mesh_modes(drum: DrumMesh, highest: float) -> DrumModes:
    """As the cup's: for its own E = 1 Pa and ρ = 1 kg/m³, up to a wavenumber (1/m)."""
    own = Material(drum.young, drum.poisson, drum.density)
    materials = dict(_materials(drum.material, own, drum.young, drum.density))
    ring, mesh = drum.cylinder("surface", whole_circle=True), drum.read()
    thickness = float(mesh.volumes.sum()) / (2 * math.pi * ring.radius * ring.width)  # its back plate counts as well
    waves = shortest_waves(thickness, drum.poisson, highest)
    pressures = min(int(waves * ring.radius), MOST_AROUND), _pressures(waves, 0.0, ring.width)[1]
    surface = drum.surface, drum.clamped
    return find_clamped_drum(mesh, materials, *surface, highest / (2 * math.pi), pressures)


def elastic_frequencies(scene: Scene, body: str) -> list[float]:
    """Frequencies (Hz) of the shapes of the "shoe" or of the "drum"; none of a rigid one.

    Up to the frequency asked for they are those of free modes, of a drum when clamped at its hub.
    """
    if body == "drum":
        return _hertz(scene, body, drum_modes(scene))
    return _hertz(scene, body, free_modes(scene) if scene.shoe.solid is None else mesh_modes(scene))


def count_modes(scene: Scene, body: str) -> int:
    """How many of the shapes are free modes, or the clamped drum's."""
    _, elastic = scene.elastic_table(body)
    return 0 if elastic is None else sum(each <= up_to_of(scene, body) for each in elastic_frequencies(scene, body))


def _hertz(scene: Scene, body: str, found: Any) -> list[float]:
    _, elastic = scene.elastic_table(body)
    if isinstance(found, SolidModes):
        return found.frequencies.tolist()
    if found is None or elastic is None:
        return []
    density = elastic.density if body == "drum" else scene.shoe.density
    return (found.wavenumbers * math.sqrt(elastic.young / density) / (2 * math.pi)).tolist()


def _of_mesh(scene: Scene) -> SolidModes:
    modes = mesh_modes(scene)
    assert modes is not None
    return modes


def symmetric_modes(scene: Scene) -> tuple[bool, ...]:
    """Which of the shoe's free modes the plane z = 0 mirrors: of those of a file, none is taken to be."""
    if scene.shoe.solid is not None:
        return (False,) * len(_of_mesh(scene).frequencies)
    modes = free_modes(scene)
    return () if modes is None else modes.symmetric


def elastic_names(scene: Scene, *, symmetric: bool = False) -> tuple[str, ...]:
    """Names of the shapes of the scene's shoe, E1, E2 and so on; of those that are symmetric about z = 0."""
    even = symmetric_modes(scene)
    names = shape_names(count_modes(scene, "shoe"), len(even))
    return tuple(name for name, each in zip(names, even, strict=True) if each or not symmetric)


def drum_names(scene: Scene) -> tuple[str, ...]:
    """Names of the shapes of the scene's drum: drum.E1, drum.E2 and so on."""
    modes = drum_modes(scene)
    return () if modes is None else shape_names(count_modes(scene, "drum"), len(modes.wavenumbers), DRUM)


def numbers_of(scene: Scene) -> dict[str, Any]:
    """The numbers that a model is assembled from: those of the scene, and the modes of its shoes and its drum."""
    found, drum = scene.numbers(), drum_modes(scene)
    for k, one in enumerate(scene.alone):
        shoe = free_modes(one)
        of_shoe = ({} if shoe is None else modal_numbers(shoe)) | mesh_numbers(one)
        found |= {scene.key_of(k, key): each for key, each in of_shoe.items()}
    return found | _ring(scene) | ({} if drum is None else drum_numbers(drum))


def _ring(scene: Scene) -> dict[str, float]:
    """Width and offset (m) of a meshed drum's surface."""
    if scene.drum.mesh is None:
        return {}
    ring = scene.drum.mesh.cylinder("surface", whole_circle=True)
    return {"drum.mesh.width": ring.width, "drum.mesh.offset": ring.z0}


def mesh_numbers(scene: Scene) -> dict[str, Any]:
    """Sizes and inertia of a scene's file, its shapes, and how they move points of springs and forces."""
    return {} if scene.shoe.solid is None else _numbers_of_mesh(scene, _of_mesh(scene))


def _numbers_of_mesh(scene: Scene, modes: SolidModes) -> dict[str, Any]:
    shoe, held = scene.shoe, scene.shoe.with_radii
    points = [*held.spring, *held.force]
    found = {f"shoe.{key}": getattr(shoe, key) for key in (*SIZES, "density")}
    found |= {MESH + key: getattr(modes, key) for key in ("mass", "centre", "moments", "axes")}
    found |= {MESH + "frequencies": modes.frequencies, MESH + "shapes": modes.coefficients}
    if points:
        moved = modes.motion_at([each.at for each in points], [each.radius or 0.0 for each in points])
        found[MESH + "points"] = moved
    return found


def modal_numbers(modes: FreeModes) -> dict[str, Any]:
    """Wavenumbers and shapes of a shoe, polynomials with zeros beyond their degrees.

    So that shoes of about one size, whose shapes are of other degrees, share a program.
    """
    degrees = ((0, -degree % STEP_OF_DEGREES) for degree in modes.coefficients.shape[2:])
    shapes = np.pad(modes.coefficients, ((0, 0), (0, 0), *degrees))
    return {WAVENUMBERS: modes.wavenumbers, SHAPES: shapes}


def drum_numbers(modes: DrumModes) -> dict[str, Any]:
    """The same of a drum."""
    shapes = modes.coefficients
    across = np.pad(shapes, ((0, 0), (0, 0), (0, 0), (0, -shapes.shape[-1] % STEP_OF_DEGREES)))
    return {DRUM_WAVENUMBERS: modes.wavenumbers, DRUM_SHAPES: across}


def shaping_numbers(scene: Scene) -> tuple[str, ...]:
    """Keys of the numbers with which the shapes of the shoe's and the drum's modes change: none of rigid ones."""
    return tuple(dict.fromkeys((*_shaping_the_shoes(scene), *_shaping_the_drum(scene))))


def _shaping_the_shoes(scene: Scene) -> tuple[str, ...]:
    return tuple(scene.key_of(k, key) for k, one in enumerate(scene.alone) for key in _shaping_the_shoe(one))


def _shaping_the_shoe(scene: Scene) -> tuple[str, ...]:
    """Of a mesh, all that its materials are, on which its inertia depends, too; of a file, the patches of its nodes."""
    if scene.shoe.solid is None:
        return SHAPING * bool(elastic_names(scene))
    materials = ("shoe.density", "shoe.elastic", "shoe.mesh")
    return tuple(key for key in scene.numbers() if key.startswith(materials) or key.endswith(".radius"))


def _shaping_the_drum(scene: Scene) -> tuple[str, ...]:
    """Of a mesh of several materials, all that they are."""
    mesh = scene.drum.mesh
    shaping = DRUM_SHAPING if mesh is None else ("drum.mesh." if mesh.material else "drum.mesh.poisson",)
    shaping = tuple(each for key in shaping for each in scene.as_one(scene.key_of(0, key)))
    return tuple(key for key in scene.numbers() if drum_names(scene) and key.startswith(shaping))


def check_shapes_stay(scene: Scene, key: str) -> None:
    """Raise RequestError for a number that a model cannot follow: the shapes of elastic modes change with it.

    Density and Young's modulus are followed exactly, for they only scale the modes.
    """
    if key in shaping_numbers(scene):
        shaping = {"shoe": _shaping_the_shoes(scene), "drum": _shaping_the_drum(scene)}
        bodies = [name for name, keys in shaping.items() if key in keys]
        raise RequestError(
            f"{key}: the modes of the elastic {' and '.join(bodies)} change with it, and are found for one value after "
            f"the other only by: drumsqueal sweep SCENE --vary {key}=FROM..TO; or leave out "
            f"{' and '.join(scene.elastic_table(name)[0] for name in bodies)}"
        )
