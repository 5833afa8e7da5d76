"""What a scene's transient includes and leaves out, in words."""

from collections.abc import Iterator
from itertools import groupby
from typing import NamedTuple

from drumsqueal.physics.composition import compose, coordinates_of
from drumsqueal.physics.elasticity import drum_modes, drum_names, elastic_frequencies, elastic_names, symmetric_modes
from drumsqueal.scene import Profile, Scene


class Inventory(NamedTuple):
    """What a model includes and what it leaves out, in words."""

    includes: tuple[str, ...]
    leaves_out: tuple[str, ...]


def take_inventory(scene: Scene, given_law: str = "") -> Inventory:
    """Say what a scene's transient includes and leaves out; `given_law` is the one given in Python."""
    composition, friction = compose(scene), scene.friction
    kept = composition.coordinates
    includes = [f"coordinates {', '.join(kept)}"]
    if scene.several:
        includes.append(f"{len(scene.shoes)} shoes that feel each other through the drum")
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
    for name, one in zip(scene.shoe_names, scene.alone, strict=True):
        if one.shoe.elastic is not None:
            shoe, up_to = f"the {name} shoe" if name else "the shoe", f"up to {one.shoe.elastic.up_to:g} Hz"
            bends = bool(elastic_names(one))
            place(bends, f"bending of {shoe}, free modes {up_to}", f"bending of {shoe} (no free mode {up_to})")
    if (drum := scene.elastic_table("drum")[1]) is not None:
        up_to = f"up to {drum.up_to:g} Hz"
        bends = bool(drum_names(scene))
        place(bends, f"bending of the drum, modes {up_to}", f"bending of the drum (no mode {up_to})")
    place(composition.support, "support springs", "support springs")
    pushes = [force for shoe in scene.shoes for force in shoe.force]
    for count, one, several in (
        (sum(len(shoe.spring) for shoe in scene.shoes), "a spring", "springs"),
        (len(pushes), "a force", "forces"),
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
    if pushes:
        changing = any(isinstance(force.size, Profile) for force in pushes)
        place(changing, "changing force at a point", "changes of the forces at points")
    return Inventory(tuple(includes), tuple(leaves_out))


def bending_in_words(scene: Scene) -> Iterator[str]:
    """Of each shoe and of the drum, if it bends, at which frequencies."""
    for name, one in zip(scene.shoe_names, scene.alone, strict=True):
        of_shoe = free_modes_in_words(one)
        if of_shoe is not None:
            yield f"{name}: {of_shoe}" if name else of_shoe
    of_drum = drum_modes_in_words(scene)
    if of_drum is not None:
        yield of_drum


def free_modes_in_words(scene: Scene) -> str | None:
    """At which frequencies a shoe that bends does so when nothing holds it, and which way; None of a rigid one."""
    shoe, even = scene.shoe, symmetric_modes(scene)
    if shoe.elastic is None:
        return None
    if not even:
        return (
            f"The shoe has no free mode up to {shoe.elastic.up_to:g} Hz, so it is rigid here: how it yields in higher "
            "modes, which counts below them, too, is left out; raise shoe.elastic.up_to to include it"
        )
    named = [f"E{k} {f:.0f} Hz" for k, f in enumerate(elastic_frequencies(scene, "shoe"), start=1)]
    if shoe.solid is not None:
        return f"The shoe bends; its free modes, when nothing holds it: {', '.join(named)}"
    parts = []
    for symmetric, way in ((True, "in the plane"), (False, "out of it")):
        some = [name for name, each in zip(named, even, strict=True) if each == symmetric]
        parts += [f"{', '.join(some)} {way}"] if some else []
    return f"The shoe bends; its free modes, when nothing holds it: {'; '.join(parts)}"


def drum_modes_in_words(scene: Scene) -> str | None:
    """At which frequencies a drum that bends does so without shoes, in how many waves around; None of a rigid one."""
    modes, (table, drum) = drum_modes(scene), scene.elastic_table("drum")
    if modes is None or drum is None:
        return None
    if not drum_names(scene):
        return (
            f"The drum has no mode up to {drum.up_to:g} Hz, so it is rigid here; raise {table}.up_to to include how it "
            "yields"
        )
    waves = zip(drum_names(scene), elastic_frequencies(scene, "drum"), modes.harmonics.tolist(), strict=True)
    rows = groupby(waves, lambda each: each[1:])
    parts = [f"{', '.join(name for name, *_ in group)} {f:.0f} Hz (n = {n})" for (f, n), group in rows]
    return f"The drum bends; its modes without shoes, of n waves around: {'; '.join(parts)}"
