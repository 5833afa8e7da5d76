"""What a scene calls for, without its numbers: it decides what is in the compiled program, and what is left out."""

from typing import NamedTuple

from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.elasticity import drum_names, elastic_names, symmetric_modes
from drumsqueal.physics.quadrature.arc import LONG_ARC
from drumsqueal.scene import COORDINATES, Scene, SceneError
from drumsqueal.scene.coordinates import in_order, is_elastic, is_of_drum

GIVEN = "given in Python"  # in place of the name of a friction law


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
    mesh: bool = False


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
        planar=is_planar(scene),
        symmetric_modes=symmetric_modes(scene),
        mesh=scene.shoe.solid is not None,
    )


def is_planar(scene: Scene) -> bool:
    """Whether nothing moves the shoe out of the plane in which it is dragged.

    The plate of an elastic drum does, and a mesh or modal results are not asked whether the plane mirrors it.
    """
    return scene.shoe.in_plane and scene.drum.elastic is None and scene.shoe.solid is None


def _check_modes_named(scene: Scene) -> None:
    """Raise SceneError where a mode is started, forced or listed that the shoe or the drum does not have."""
    simulate = scene.simulate
    listed = () if simulate.coordinates == "auto" else simulate.coordinates
    tables = {("start", kind): tuple(table) for kind, table in scene.start}
    tables |= {("simulate", "coordinates"): listed}
    tables |= {} if scene.forcing is None else {("forcing", "amplitude"): tuple(scene.forcing.amplitude)}
    known = coordinates_of(scene)
    for path, names in tables.items():
        for name in names:
            if name not in known:
                body, kind = ("drum", "mode") if is_of_drum(name) else ("shoe", "free mode")
                elastic = getattr(scene, body).elastic
                own = [each for each in known if is_elastic(each) and is_of_drum(each) is is_of_drum(name)]
                has = f"{len(own)} {kind}{'s' * (len(own) != 1)}" if own else f"no {kind}"
                which = "" if not own else f" ({own[0]}{f' to {own[-1]}' if len(own) > 1 else ''})"
                reason = f"the {body} has {has}{which} up to {elastic.up_to:g} Hz"
                raise SceneError(
                    f"{reason}; raise {body}.elastic.up_to, or leave out {name}",
                    path if path[0] == "simulate" else (*path, name),
                )


def coordinates_of(scene: Scene) -> tuple[str, ...]:
    """All coordinates that the scene's bodies have: the rigid ones, then the shoe's elastic ones, then the drum's."""
    return *COORDINATES, *elastic_names(scene), *drum_names(scene)


def plane_of(scene: Scene) -> tuple[str, ...]:
    """Those of them that move every line across the lining alike, see `Body.symmetric`: none of an elastic drum's."""
    return *IN_PLANE, *elastic_names(scene, symmetric=True)


def kept_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates that can move: those listed, or for "auto" the plane's unless something moves out of it."""
    if scene.simulate.coordinates != "auto":
        return scene.simulate.coordinates
    plane = plane_of(scene)
    return plane if is_planar(scene) and moved_coordinates(scene) <= set(plane) else coordinates_of(scene)


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
