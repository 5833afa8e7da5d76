"""What a scene calls for, without its numbers: it decides what is in the compiled program, and what is left out."""

import math
from typing import Any, NamedTuple

import numpy as np

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.free_modes import FreeModes, find_free_modes
from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.quadrature.arc import LONG_ARC
from drumsqueal.scene import COORDINATES, Profile, Scene, SceneError
from drumsqueal.scene.coordinates import in_order
from drumsqueal.scene.usual import unusual

SHAPING = ("shoe.outer_radius", "shoe.thickness", "shoe.width", "shoe.arc_angle", "shoe.elastic.poisson")
GIVEN = "given in Python"  # in place of the name of a friction law
STEP_OF_DEGREES = 4
WAVENUMBERS, SHAPES = "shoe.elastic.wavenumbers", "shoe.elastic.shapes"  # of the free modes, among a model's numbers


class Composition(NamedTuple):
    """Coordinates (by name) and effects of a model; hashable, so that it can be static."""

    coordinates: tuple[str, ...]
    long_arc: bool
    separation: bool
    friction_law: str | None
    friction_direction: str | None
    steady_state: str
    support: bool
    damping: bool
    temperature: bool
    forced: tuple[str, ...]
    springs: int = 0
    pushes: int = 0
    planar: bool = True
    symmetric_modes: tuple[bool, ...] = ()


class Inventory(NamedTuple):
    """What a model includes and what it leaves out, in words."""

    includes: tuple[str, ...]
    leaves_out: tuple[str, ...]


def compose(scene: Scene) -> Composition:
    """Read off a scene which effects and coordinates its transient calls for."""
    _check_modes_named(scene)
    friction = scene.friction
    return Composition(
        coordinates=kept_coordinates(scene),
        long_arc=scene.shoe.arc_angle > LONG_ARC,
        separation=scene.contact.separation,
        friction_law=None if friction is None else friction.law,
        friction_direction=None if friction is None else friction.direction,
        steady_state=scene.steady.state,
        support=scene.support is not None,
        damping=scene.damping is not None,
        temperature=scene.temperature is not None,
        forced=forced_coordinates(scene),
        springs=len(scene.shoe.spring),
        pushes=len(scene.shoe.force),
        planar=scene.shoe.in_plane,
        symmetric_modes=modes.symmetric if (modes := free_modes(scene)) else (),
    )


def free_modes(scene: Scene) -> FreeModes | None:
    """The free modes of the scene's shoe up to the frequency that it asks for; None of a rigid one."""
    shoe, elastic = scene.shoe, scene.shoe.elastic
    if elastic is None:
        return None
    highest = 2 * math.pi * elastic.up_to * math.sqrt(shoe.density / elastic.young)
    try:
        return find_free_modes(shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle, elastic.poisson, highest)
    except ArithmeticError as error:
        raise RequestError(f"the shoe's free modes were not found: {error}") from None
    except RequestError as error:  # which a number in a wrong unit may have brought about
        raise RequestError("; ".join([str(error), *unusual(scene)])) from None


def free_frequencies(scene: Scene) -> list[float]:
    """Frequencies (Hz) of those modes."""
    modes, elastic = free_modes(scene), scene.shoe.elastic
    if modes is None or elastic is None:
        return []
    return (modes.wavenumbers * math.sqrt(elastic.young / scene.shoe.density) / (2 * math.pi)).tolist()


def numbers_of(scene: Scene) -> dict[str, Any]:
    """The numbers that a model is assembled from: those of the scene, and the free modes of its shoe."""
    modes = free_modes(scene)
    return scene.numbers() | ({} if modes is None else modal_numbers(modes))


def modal_numbers(modes: FreeModes, most: int | None = None) -> dict[str, Any]:
    """Wavenumbers and shapes of so many modes, polynomials with zeros beyond their degrees.

    So that shoes of about one size, whose shapes are of other degrees, share a program.
    """
    degrees = ((0, -degree % STEP_OF_DEGREES) for degree in modes.coefficients.shape[2:])
    shapes = np.pad(modes.coefficients[:most], ((0, 0), (0, 0), *degrees))
    return {WAVENUMBERS: modes.wavenumbers[:most], SHAPES: shapes}


def shaping_numbers(scene: Scene) -> tuple[str, ...]:
    """Keys of the numbers with which the shapes of the shoe's free modes change: none of a rigid shoe."""
    modes = free_modes(scene)
    return SHAPING if modes is not None and modes.symmetric else ()


def check_shapes_stay(scene: Scene, key: str) -> None:
    """Raise RequestError for a number that a model cannot follow: the shapes of the shoe's free modes change with it.

    Density and Young's modulus are followed exactly, for they only scale the modes.
    """
    if key in shaping_numbers(scene):
        raise RequestError(
            f"{key}: the free modes of the elastic shoe change with it, and are found for one value after the other "
            f"only by: drumsqueal sweep SCENE --vary {key}=FROM..TO; or leave out shoe.elastic"
        )


def _check_modes_named(scene: Scene) -> None:
    """Raise SceneError where a free mode is started, forced or listed that the shoe does not have."""
    elastic, simulate = scene.shoe.elastic, scene.simulate
    if elastic is None:
        return
    listed = () if simulate.coordinates == "auto" else simulate.coordinates
    tables = {("start", kind): tuple(table) for kind, table in scene.start}
    tables |= {("simulate", "coordinates"): listed}
    tables |= {} if scene.forcing is None else {("forcing", "amplitude"): tuple(scene.forcing.amplitude)}
    known = coordinates_of(scene)
    for path, names in tables.items():
        for name in names:
            if name not in known:
                count = len(known) - len(COORDINATES)
                has = f"{count} free mode{'s' * (count != 1)}" if count else "no free mode"
                cure = "" if count == 0 else f" (E1{f' to E{count}' if count > 1 else ''})"
                reason = f"the shoe has {has}{cure} up to {elastic.up_to:g} Hz"
                raise SceneError(
                    f"{reason}; raise shoe.elastic.up_to, or leave out {name}",
                    path if path[0] == "simulate" else (*path, name),
                )


def free_modes_in_words(scene: Scene) -> str | None:
    """At which frequencies a shoe that bends does so when nothing holds it, and which way; None of a rigid one."""
    modes, shoe = free_modes(scene), scene.shoe
    if modes is None or shoe.elastic is None:
        return None
    if not modes.symmetric:
        return (
            f"The shoe has no free mode up to {shoe.elastic.up_to:g} Hz, so it is rigid here: how it yields in higher "
            "modes, which counts below them, too, is left out; raise shoe.elastic.up_to to include it"
        )
    frequencies = modes.wavenumbers * math.sqrt(shoe.elastic.young / shoe.density) / (2 * math.pi)
    named = [f"E{k} {frequency:.0f} Hz" for k, frequency in enumerate(frequencies, start=1)]
    parts = []
    for symmetric, way in ((True, "in the plane"), (False, "out of it")):
        some = [name for name, even in zip(named, modes.symmetric, strict=True) if even == symmetric]
        parts += [f"{', '.join(some)} {way}"] if some else []
    return f"The shoe bends; its free modes, when nothing holds it: {'; '.join(parts)}"


def coordinates_of(scene: Scene) -> tuple[str, ...]:
    """All coordinates that the scene's body has: the rigid ones, then the elastic ones."""
    return *COORDINATES, *elastic_names(scene)


def plane_of(scene: Scene) -> tuple[str, ...]:
    """Those of them that move every line across the lining alike, see `Body.symmetric`."""
    return *IN_PLANE, *elastic_names(scene, symmetric=True)


def elastic_names(scene: Scene, *, symmetric: bool = False) -> tuple[str, ...]:
    """Names of the free modes of the scene's shoe, E1, E2 and so on; of those that are symmetric about z = 0."""
    modes = free_modes(scene)
    even = () if modes is None else modes.symmetric
    return tuple(f"E{k}" for k, each in enumerate(even, start=1) if each or not symmetric)


def kept_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates that can move: those listed, or for "auto" the plane's unless something moves out of it."""
    if scene.simulate.coordinates != "auto":
        return scene.simulate.coordinates
    plane = plane_of(scene)
    return plane if scene.shoe.in_plane and moved_coordinates(scene) <= set(plane) else coordinates_of(scene)


def moved_coordinates(scene: Scene) -> set[str]:
    """Coordinates that the start or a force sets in motion by itself."""
    tables = (scene.start.displacement, scene.start.velocity)
    return {name for table in tables for name, value in table.items() if value != 0} | set(forced_coordinates(scene))


def forced_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates that a harmonic force acts on, in their order."""
    amplitude = {} if scene.forcing is None else scene.forcing.amplitude
    return in_order(name for name, value in amplitude.items() if value != 0)


def linear_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates of the eigenvalue problem: those listed, or all: a mode is unstable whether started or not."""
    return coordinates_of(scene) if scene.simulate.coordinates == "auto" else kept_coordinates(scene)


def take_inventory(scene: Scene, given_law: str = "") -> Inventory:
    """Say what a scene's transient includes and leaves out; `given_law` is the one given in Python."""
    composition, friction = compose(scene), scene.friction
    kept = composition.coordinates
    includes = [f"coordinates {', '.join(kept)}"]
    leaves_out = []
    left = tuple(name for name in coordinates_of(scene) if name not in kept)
    if left:
        why = "nothing moves them" if scene.simulate.coordinates == "auto" else "not listed"
        leaves_out.append(f"coordinates {', '.join(left)} ({why})")

    def place(there: bool, name: str, otherwise: str) -> None:
        (includes if there else leaves_out).append(name if there else otherwise)

    place(composition.separation, "contact that separates", "separation (the contact is bonded, and also pulls)")
    if not composition.separation:
        includes.append("bonded contact")
    if friction is None:
        leaves_out.append("friction")
    else:
        includes.append(f"friction: law {given_law}" if given_law else f"friction: {friction.name}")
        place(
            friction.direction == "unit-velocity",
            "friction along the unit slip velocity",
            "friction across the sliding direction (it acts along the arc only)",
        )
    if scene.shoe.elastic is not None:
        up_to = f"up to {scene.shoe.elastic.up_to:g} Hz"
        bends = bool(elastic_names(scene))
        place(bends, f"bending of the shoe, free modes {up_to}", f"bending of the shoe (no free mode {up_to})")
    place(composition.support, "support springs", "support springs")
    for count, one, several in (
        (composition.springs, "a spring", "springs"),
        (composition.pushes, "a force", "forces"),
    ):
        if count:
            includes.append(f"{one} at a point" if count == 1 else f"{count} {several} at points")
    place(composition.damping, "structural damping", "structural damping")
    place(bool(composition.forced), "harmonic force", "harmonic force")
    place(composition.temperature, "lining temperature and fade of friction", "lining temperature and fade of friction")
    if friction is not None:
        place(
            composition.steady_state == "self-consistent",
            "drag of friction on the steady state",
            "drag of friction on the steady state (the assembly balances it)",
        )
    place(isinstance(scene.drum.speed, Profile), "changing drum speed", "changes of the drum speed")
    place(isinstance(scene.contact.normal_load, Profile), "changing load", "changes of the load")
    if composition.pushes:
        changing = any(isinstance(force.size, Profile) for force in scene.shoe.force)
        place(changing, "changing force at a point", "changes of the forces at points")
    return Inventory(tuple(includes), tuple(leaves_out))
