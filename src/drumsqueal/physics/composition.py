"""What a scene calls for, without its numbers: it decides what is in the compiled program, and what is left out."""

from typing import NamedTuple

from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.quadrature.arc import LONG_ARC
from drumsqueal.scene import COORDINATES, Profile, Scene

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


class Inventory(NamedTuple):
    """What a model includes and what it leaves out, in words."""

    includes: tuple[str, ...]
    leaves_out: tuple[str, ...]


def compose(scene: Scene) -> Composition:
    """Read off a scene which effects and coordinates its transient calls for."""
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
    )


def kept_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates that can move: those listed, or for "auto" the plane's three unless something moves out of it."""
    if scene.simulate.coordinates != "auto":
        return scene.simulate.coordinates
    return IN_PLANE if moved_coordinates(scene) <= set(IN_PLANE) else COORDINATES


def moved_coordinates(scene: Scene) -> set[str]:
    """Coordinates that the start or a force sets in motion by itself."""
    tables = (scene.start.displacement, scene.start.velocity)
    return {name for table in tables for name, value in table.items() if value != 0} | set(forced_coordinates(scene))


def forced_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates that a harmonic force acts on, in their order."""
    amplitude = {} if scene.forcing is None else scene.forcing.amplitude
    return tuple(name for name in COORDINATES if amplitude.get(name, 0.0) != 0)


def linear_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates of the eigenvalue problem: those listed, or all: a mode is unstable whether started or not."""
    return COORDINATES if scene.simulate.coordinates == "auto" else kept_coordinates(scene)


def take_inventory(scene: Scene, given_law: str = "") -> Inventory:
    """Say what a scene's transient includes and leaves out; `given_law` is the one given in Python."""
    composition, friction = compose(scene), scene.friction
    kept = composition.coordinates
    includes = [f"coordinates {', '.join(kept)}"]
    leaves_out = []
    if len(kept) < len(COORDINATES):
        why = "nothing moves them" if scene.simulate.coordinates == "auto" else "not listed"
        leaves_out.append(f"coordinates {', '.join(name for name in COORDINATES if name not in kept)} ({why})")

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
    place(composition.support, "support springs", "support springs")
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
    return Inventory(tuple(includes), tuple(leaves_out))
