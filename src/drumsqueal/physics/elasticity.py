"""The elastic modes of a scene's shoe and drum: their names, frequencies and shapes, found once for each scene."""

import functools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.drum_modes import DrumModes, find_drum_modes
from drumsqueal.physics.bodies.free_modes import FreeModes, find_free_modes
from drumsqueal.physics.bodies.given_modes import find_given_modes
from drumsqueal.physics.bodies.solid_elements import masses_of
from drumsqueal.physics.bodies.solid_mesh import SolidMesh
from drumsqueal.physics.bodies.solid_modes import EVERYWHERE, Material, SolidModes, find_clamped_drum, find_free_solid
from drumsqueal.scene import Scene
from drumsqueal.scene.coordinates import DRUM
from drumsqueal.scene.mesh import SIZES, DrumMesh, MeshMaterial, ShoeMesh
from drumsqueal.scene.shoe_modes import ShoeModes
from drumsqueal.scene.usual import unusual

Reals = NDArray[np.float64]

SHAPING = ("shoe.outer_radius", "shoe.thickness", "shoe.width", "shoe.arc_angle", "shoe.elastic.poisson")
DRUM_SHAPING = ("shoe.outer_radius", *(f"drum.elastic.{key}" for key in ("thickness", "width", "back_plate")))
DRUM_SHAPING += ("drum.elastic.hub_radius", "drum.elastic.poisson")
STEP_OF_DEGREES = 4
UNBENT = 1.0  # Pa: of a mesh that is rigid, and has no modes that this could change
# Of the modes, among a model's numbers.
WAVENUMBERS, SHAPES = "shoe.elastic.wavenumbers", "shoe.elastic.shapes"
MESH = "shoe.mesh."
DRUM_WAVENUMBERS, DRUM_SHAPES = "drum.elastic.wavenumbers", "drum.elastic.shapes"
MODAL = ".elastic.shapes"  # with which the keys of both end, of several shoes, too


def free_modes(scene: Scene) -> FreeModes | None:
    """The free modes of the scene's sector up to the frequency that it asks for; None of a rigid one, and of a file."""
    shoe, elastic = scene.shoe, scene.shoe.elastic
    if elastic is None or shoe.solid is not None:
        return None
    highest = 2 * math.pi * elastic.up_to * math.sqrt(shoe.density / elastic.young)
    try:
        return find_free_modes(shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle, elastic.poisson, highest)
    except ArithmeticError as error:
        raise RequestError(f"the shoe's free modes were not found: {error}") from None
    except RequestError as error:  # which a number in a wrong unit may have brought about
        raise RequestError("; ".join([str(error), *unusual(scene)])) from None


def drum_modes(scene: Scene) -> DrumModes | None:
    """The modes of the scene's drum, clamped at its hub, up to the frequency that it asks for; None of a rigid one."""
    _, drum = scene.elastic_table("drum")
    if drum is None:
        return None
    highest = 2 * math.pi * drum.up_to * math.sqrt(drum.density / drum.young)
    if scene.drum.mesh is not None:
        return _drum_mesh_modes(drum, highest)
    sizes = drum.thickness, drum.width, drum.back_plate, drum.hub_radius
    try:
        return find_drum_modes(scene.shoes[0].outer_radius, *sizes, drum.poisson, highest)
    except RequestError as error:  # which a number in a wrong unit may have brought about
        raise RequestError("; ".join([str(error), *unusual(scene)])) from None


def mesh_modes(scene: Scene) -> SolidModes | None:
    """Inertia and free modes of the scene's mesh or modal results, none of a rigid one's; None of a sector."""
    solid: Any = scene.shoe.solid
    return None if solid is None else _mesh_modes(solid, *_solid_of(scene))


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
        return (), 0.0 if elastic is None else elastic.up_to
    own = Material(*(UNBENT, 0.0) if elastic is None else (elastic.young, elastic.poisson), shoe.density)
    named = () if shoe.mesh is None else shoe.mesh.material
    return _materials(named, own), 0.0 if elastic is None else elastic.up_to


def _materials(
    named: tuple[MeshMaterial, ...], own: Material, young: float = 1.0, density: float = 1.0
) -> tuple[tuple[str, Material], ...]:
    """Materials by sets of elements, and of those in none of them, for so large a unit of E and ρ."""
    found = [(each.set, Material(each.young, each.poisson, each.density)) for each in named]
    return tuple((key, Material(e / young, nu, rho / density)) for key, (e, nu, rho) in [*found, (EVERYWHERE, own)])


@functools.lru_cache(maxsize=32)
def _mesh_modes(solid: ShoeMesh | ShoeModes, materials: tuple[tuple[str, Material], ...], up_to: float) -> SolidModes:
    if isinstance(solid, ShoeModes):
        return find_given_modes(solid.read(), up_to)
    try:
        return find_free_solid(solid.read(), dict(materials), solid.lining, up_to)
    except ArithmeticError as error:
        raise RequestError(f"the shoe's free modes were not found: {error}") from None


@functools.lru_cache(maxsize=32)
def _drum_mesh_modes(drum: DrumMesh, highest: float) -> DrumModes:
    """As the cup's: for its own E = 1 Pa and ρ = 1 kg/m³, up to a wavenumber (1/m)."""
    own = Material(drum.young, drum.poisson, drum.density)
    materials = dict(_materials(drum.material, own, drum.young, drum.density))
    found = find_clamped_drum(drum.read(), materials, drum.surface, drum.clamped, highest / (2 * math.pi))
    wavenumbers = 2 * math.pi * found.frequencies
    return DrumModes(wavenumbers, found.harmonics, found.coefficients, math.nan, found.fit_error)


@functools.lru_cache(maxsize=32)
def _moved_points(
    solid: ShoeMesh | ShoeModes,
    materials: tuple[tuple[str, Material], ...],
    up_to: float,
    points: tuple[tuple[tuple[float, ...], float], ...],
) -> Any:
    """How its modes move points, each with the radius of its patch, (k, 3, m)."""
    of_file: Any = solid
    return _mesh_modes(of_file, materials, up_to).motion_at(*map(np.array, zip(*points, strict=True)))


def elastic_frequencies(scene: Scene, body: str) -> list[float]:
    """Frequencies (Hz) of the "shoe"'s free modes, or of the "drum"'s; none of a rigid one."""
    drum = body == "drum"
    if not drum and scene.shoe.solid is not None:
        return _of_mesh(scene).frequencies.tolist()
    modes, (_, elastic) = (drum_modes(scene) if drum else free_modes(scene)), scene.elastic_table(body)
    if modes is None or elastic is None:
        return []
    density = elastic.density if drum else scene.shoe.density
    return (modes.wavenumbers * math.sqrt(elastic.young / density) / (2 * math.pi)).tolist()


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
    """Names of the free modes of the scene's shoe, E1, E2 and so on; of those that are symmetric about z = 0."""
    even = symmetric_modes(scene)
    return tuple(f"E{k}" for k, each in enumerate(even, start=1) if each or not symmetric)


def drum_names(scene: Scene) -> tuple[str, ...]:
    """Names of the modes of the scene's drum: drum.E1, drum.E2 and so on."""
    modes = drum_modes(scene)
    return () if modes is None else tuple(f"{DRUM}E{k + 1}" for k in range(len(modes.wavenumbers)))


def numbers_of(scene: Scene) -> dict[str, Any]:
    """The numbers that a model is assembled from: those of the scene, and the modes of its shoes and its drum."""
    found, drum = scene.numbers(), drum_modes(scene)
    for k, one in enumerate(scene.alone):
        shoe = free_modes(one)
        of_shoe = ({} if shoe is None else modal_numbers(shoe)) | mesh_numbers(one)
        found |= {scene.key_of(k, key): each for key, each in of_shoe.items()}
    if scene.drum.mesh is not None:
        ring = scene.drum.mesh.cylinder("surface", whole_circle=True)
        found |= {"drum.mesh.width": ring.width, "drum.mesh.offset": ring.z0}
    return found | ({} if drum is None else drum_numbers(drum))


def mesh_numbers(scene: Scene, most: int | None = None) -> dict[str, Any]:
    """Sizes and inertia of a scene's file, so many of its modes, and how they move points of springs and forces."""
    shoe = scene.shoe
    file: Any = shoe.solid
    if file is None:
        return {}
    modes, solid = _of_mesh(scene), _solid_of(scene)
    held = shoe.with_radii
    points = tuple((tuple(each.at), each.radius or 0.0) for each in (*held.spring, *held.force))
    found = {f"shoe.{key}": getattr(shoe, key) for key in (*SIZES, "density")}
    found |= {MESH + key: getattr(modes, key) for key in ("mass", "centre", "moments", "axes")}
    found |= {MESH + "frequencies": modes.frequencies[:most], MESH + "shapes": modes.coefficients[:most]}
    return found | ({MESH + "points": _moved_points(file, *solid, points)[..., :most]} if points else {})


def modal_numbers(modes: FreeModes, most: int | None = None) -> dict[str, Any]:
    """Wavenumbers and shapes of so many modes, polynomials with zeros beyond their degrees.

    So that shoes of about one size, whose shapes are of other degrees, share a program.
    """
    degrees = ((0, -degree % STEP_OF_DEGREES) for degree in modes.coefficients.shape[2:])
    shapes = np.pad(modes.coefficients[:most], ((0, 0), (0, 0), *degrees))
    return {WAVENUMBERS: modes.wavenumbers[:most], SHAPES: shapes}


def drum_numbers(modes: DrumModes, most: int | None = None) -> dict[str, Any]:
    """The same of a drum."""
    shapes = modes.coefficients[:most]
    across = np.pad(shapes, ((0, 0), (0, 0), (0, 0), (0, -shapes.shape[-1] % STEP_OF_DEGREES)))
    return {DRUM_WAVENUMBERS: modes.wavenumbers[:most], DRUM_SHAPES: across}


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
