"""Trial shapes of a scene's shoe and drum, of which some are kept: found up to a frequency that is given, and numbers.

They are a body's own modes, and how it yields to smooth pressures on the lining and to forces at patches of springs.
"""

import functools
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.drum_modes import MOST_AROUND, Cup, DrumModes, drum_shapes_at, find_drum_modes
from drumsqueal.physics.bodies.elements import Reals
from drumsqueal.physics.bodies.free_modes import MOST_OF_DENTS, FreeModes, Patch, find_free_modes, shortest_waves
from drumsqueal.physics.bodies.given_modes import find_given_modes
from drumsqueal.physics.bodies.mode_shapes import Sector
from drumsqueal.physics.bodies.solid_elements import EVERYWHERE, Material, masses_of
from drumsqueal.physics.bodies.solid_mesh import SolidMesh
from drumsqueal.physics.bodies.solid_modes import SolidModes, find_clamped_drum, find_free_solid, patch_rows
from drumsqueal.physics.shoe_building import DRUM_SHAPES, DRUM_WAVENUMBERS, MESH, SHAPES, WAVENUMBERS
from drumsqueal.scene import Scene
from drumsqueal.scene.mesh import SIZES, DrumMesh, MeshMaterial, ShoeMesh, ShoeModes
from drumsqueal.scene.usual import unusual

Materials = tuple[tuple[str, Material], ...]

UNBENT = 1.0  # Pa: of a mesh that is rigid, and has no modes that this could change
# Times the frequency up to which shapes are kept: so far own modes are among those from which they are taken. What is
# beyond yields nearly statically, which answers to forces hold.
TRIED = 2.0
STEP_OF_DEGREES = 4


def trial_shoe(scene: Scene) -> Any:
    """The shapes from which those of a shoe are taken; of a rigid one None or, of a file, its inertia without any."""
    shoe, (_, elastic), patches = scene.shoe, scene.elastic_table("shoe"), patches_of(scene)
    solid: Any = shoe.solid
    if elastic is None and solid is None:
        return None
    up_to, highest, waves = 0.0, 0.0, 0.0
    if elastic is not None:
        up_to = TRIED * elastic.up_to
        highest = 2 * math.pi * up_to * math.sqrt(shoe.density / elastic.young)
        waves = shortest_waves(shoe.thickness, elastic.poisson, highest)
    with _as_request(scene, "shoe's free"):
        if shoe.modes is not None:
            return _given_modes(solid, up_to)
        if shoe.mesh is not None:
            return _mesh_modes(solid, materials_of(scene), up_to, waves, patches)
        assert elastic is not None
        sector = Sector(shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle)
        return find_free_modes(sector, elastic.poisson, highest, patches)


def trial_drum(scene: Scene) -> DrumModes | None:
    """The same of the drum, by its modes when clamped at its hub."""
    _, drum = scene.elastic_table("drum")
    if drum is None:
        return None
    highest = TRIED * 2 * math.pi * drum.up_to * math.sqrt(drum.density / drum.young)
    with _as_request(scene, "drum's"):
        if scene.drum.mesh is not None:
            return _drum_mesh_modes(drum, highest)
        sizes = drum.thickness, drum.width, drum.back_plate, drum.hub_radius
        return find_drum_modes(Cup(scene.shoes[0].outer_radius, *sizes), drum.poisson, highest, dents=True)


@contextmanager
def _as_request(scene: Scene, whose: str) -> Iterator[None]:
    """Raise what fails as a RequestError, which a number in a wrong unit may have brought about."""
    try:
        yield
    except ArithmeticError as error:
        raise RequestError(f"the {whose} modes were not found: {error}") from None
    except RequestError as error:
        raise RequestError("; ".join([str(error), *unusual(scene)])) from None


def patches_of(scene: Scene) -> tuple[Patch, ...]:
    """Where springs and forces act on the scene's shoe, and over which radius."""
    held = scene.shoe.with_radii
    places: Any = ((*each.at, each.radius or 0.0) for each in (*held.spring, *held.force))
    return tuple(dict.fromkeys(places))


def materials_of(scene: Scene) -> Materials:
    """Those of a shoe's mesh, by sets of elements."""
    shoe, elastic = scene.shoe, scene.shoe.elastic
    assert shoe.mesh is not None
    young, poisson = (UNBENT, 0.0) if elastic is None else (elastic.young, elastic.poisson)
    return _materials(shoe.mesh.material, Material(young, poisson, shoe.density))


def _materials(named: tuple[MeshMaterial, ...], own: Material, young: float = 1.0, density: float = 1.0) -> Materials:
    """Materials by sets of elements, and of those in none of them, for so large a unit of E and ρ."""
    found = [(each.set, Material(each.young, each.poisson, each.density)) for each in named]
    return tuple((key, Material(e / young, nu, rho / density)) for key, (e, nu, rho) in [*found, (EVERYWHERE, own)])


def meshes_of(scene: Scene) -> Iterator[tuple[str, str, SolidMesh, Reals]]:
    """Of each mesh the body, the file, the elements and the mass of each of these (e,), in kg."""
    for name, one in zip(scene.shoe_names, scene.alone, strict=True):
        if (shoe := one.shoe.mesh) is not None:
            yield f"{name} shoe".strip(), shoe.file, shoe.read(), masses_of(shoe.read(), dict(materials_of(one)))
    if (drum := scene.drum.mesh) is not None:
        materials = _materials(drum.material, Material(drum.young, drum.poisson, drum.density))
        yield "drum", drum.file, drum.read(), masses_of(drum.read(), dict(materials))


@functools.lru_cache(maxsize=32)
def _given_modes(modes: ShoeModes, up_to: float) -> SolidModes:
    return find_given_modes(modes.read(), up_to)


@functools.lru_cache(maxsize=32)
def _mesh_modes(
    shoe: ShoeMesh,
    materials: Materials,
    up_to: float,
    waves: float,
    patches: tuple[Patch, ...],
) -> SolidModes:
    """Up to a frequency (Hz), and with waves (1/m) of pressures; without these it is rigid."""
    mesh, sizes, pressures, held = shoe.read(), shoe.sizes(), None, None
    if waves:
        pressures = _count(waves, sizes["outer_radius"] * sizes["arc_angle"]), _count(waves, sizes["width"])
        held = patch_rows(mesh, np.array(patches)[:, :3], np.array(patches)[:, 3]) if patches else None
    return find_free_solid(mesh, dict(materials), shoe.lining, up_to, pressures, held)


def _count(waves: float, size: float) -> int:
    """How many polynomials follow waves (1/m) along a lining of that size (m)."""
    return min(math.ceil(waves * size / 2), MOST_OF_DENTS) + 1


@functools.lru_cache(maxsize=32)
def _drum_mesh_modes(drum: DrumMesh, highest: float) -> DrumModes:
    """As the cup's: for its own E = 1 Pa and ρ = 1 kg/m³, up to a wavenumber (1/m)."""
    own = Material(drum.young, drum.poisson, drum.density)
    materials = dict(_materials(drum.material, own, drum.young, drum.density))
    ring, mesh = drum.cylinder("surface", whole_circle=True), drum.read()
    mesh = mesh._replace(point_masses=mesh.point_masses / drum.density)
    thickness = float(mesh.volumes.sum()) / (2 * math.pi * ring.radius * ring.width)  # its back plate counts as well
    waves = shortest_waves(thickness, drum.poisson, highest)
    pressures = min(int(waves * ring.radius), MOST_AROUND), _count(waves, ring.width)
    surface = drum.surface, drum.clamped
    return find_clamped_drum(mesh, materials, *surface, highest / (2 * math.pi), pressures)


def frequencies_of(scene: Scene, body: str, shapes: Any) -> Reals:
    """Those (Hz) of shapes of the scene's "shoe" or "drum"; none of a rigid one."""
    _, elastic = scene.elastic_table(body)
    if isinstance(shapes, SolidModes):
        return shapes.frequencies
    if shapes is None or elastic is None:
        return np.zeros(0)
    density = elastic.density if body == "drum" else scene.shoe.density
    return shapes.wavenumbers * math.sqrt(elastic.young / density) / (2 * math.pi)


def numbers_of_shoe(scene: Scene, shapes: Any) -> dict[str, Any]:
    """What a model takes of a shoe's shapes; of a file sizes and inertia, too, and how points of springs move.

    Polynomials have zeros beyond their degrees, so that shoes of about one size, whose shapes are of other degrees,
    share a program.
    """
    if isinstance(shapes, FreeModes):
        degrees = ((0, -degree % STEP_OF_DEGREES) for degree in shapes.coefficients.shape[2:])
        padded = np.pad(shapes.coefficients, ((0, 0), (0, 0), *degrees))
        return {WAVENUMBERS: shapes.wavenumbers, SHAPES: padded}
    if shapes is None:
        return {}
    found = {f"shoe.{key}": getattr(scene.shoe, key) for key in (*SIZES, "density")}
    found |= {MESH + key: getattr(shapes, key) for key in ("mass", "centre", "moments", "axes", "frequencies")}
    found[MESH + "shapes"] = shapes.coefficients
    held = scene.shoe.with_radii
    if points := [*held.spring, *held.force]:
        found[MESH + "points"] = shapes.motion_at([each.at for each in points], [each.radius or 0.0 for each in points])
    return found


def numbers_of_drum(scene: Scene, shapes: DrumModes | None) -> dict[str, Any]:
    """The same of a drum: of a mesh width and offset (m) of its surface, too."""
    if shapes is None:
        return {}
    across = (0, -shapes.coefficients.shape[-1] % STEP_OF_DEGREES)
    padded = np.pad(shapes.coefficients, ((0, 0), (0, 0), (0, 0), across))
    found = {DRUM_WAVENUMBERS: shapes.wavenumbers, DRUM_SHAPES: padded}
    if scene.drum.mesh is not None:
        width, offset = _ring(scene)
        found |= {"drum.mesh.width": width, "drum.mesh.offset": offset}
    return found


def _ring(scene: Scene) -> tuple[float, float]:
    """Width and offset (m) of the surface of a drum that bends."""
    if scene.drum.mesh is None:
        assert scene.drum.elastic is not None
        return scene.drum.elastic.width, scene.drum.elastic.offset
    ring = scene.drum.mesh.cylinder("surface", whole_circle=True)
    return ring.width, ring.z0


def on_drum(scene: Scene, shapes: DrumModes, angle: Reals, z: Reals) -> Reals:
    """u_r and u_θ (2, m, n) of a drum's shapes of unit modal mass, at angles on it (rad) and z (m) of a lining."""
    (_, drum), (width, offset) = scene.elastic_table("drum"), _ring(scene)
    assert drum is not None
    found = drum_shapes_at(shapes.coefficients[:, :2], width / 2, angle, z - offset)
    return np.moveaxis(found, 0, -1) / math.sqrt(drum.density)
