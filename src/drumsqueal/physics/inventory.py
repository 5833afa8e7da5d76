"""What a scene's transient includes and leaves out, in words."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

from drumsqueal.coordinates import is_static, listed
from drumsqueal.physics.composition import coordinates_of, forced_coordinates, kept_coordinates
from drumsqueal.physics.elasticity import (
    count_modes,
    drum_modes,
    drum_names,
    elastic_frequencies,
    elastic_names,
    resolved,
    symmetric_modes,
    up_to_of,
)
from drumsqueal.scene import Profile, Scene


class Inventory(NamedTuple):
    """What a model includes and what it leaves out, in words."""

    includes: tuple[str, ...]
    leaves_out: tuple[str, ...]


Fact = tuple[bool, str]
"""Whether something is there, and what that means, in words."""


def take_inventory(scene: Scene, given_law: str = "") -> Inventory:
    """Say what a scene's transient includes and leaves out; `given_law` is the one given in Python."""
    scene = resolved(scene)
    found = [
        *_coordinates(scene),
        *_of_shoes(scene, lambda one: _contact(one, given_law)),
        *_bodies(scene),
        *_of_shoes(scene, _operation),
    ]
    return Inventory(*(tuple(words for there, words in found if there is part) for part in (True, False)))


def _of_shoes(scene: Scene, facts: Callable[[Scene], Iterable[Fact]]) -> Iterator[Fact]:
    """The facts of each shoe; what all have in common is said once, without a name."""
    each = {name: list(facts(one)) for name, one in zip(scene.shoe_names, scene.alone, strict=True)}
    for fact in dict.fromkeys(fact for found in each.values() for fact in found):
        names = [name for name, found in each.items() if fact in found]
        yield fact if len(names) == len(each) else (fact[0], f"{' and '.join(names)}: {fact[1]}")


def _coordinates(scene: Scene) -> Iterator[Fact]:
    kept = kept_coordinates(scene)
    yield True, f"coordinates {listed(kept)}"
    if scene.several:
        yield True, f"{len(scene.shoes)} shoes that feel each other through the drum"
    left = tuple(name for name in coordinates_of(scene) if name not in kept)
    if left:
        why = "nothing moves them" if scene.simulate.coordinates == "auto" else "not listed"
        yield False, f"coordinates {listed(left)} ({why})"


def _contact(scene: Scene, given_law: str) -> Iterator[Fact]:
    """Of one shoe."""
    if scene.contact.separation:
        yield True, "contact that separates"
    else:
        yield False, "separation (the contact is bonded, and also pulls)"
        yield True, "bonded contact"
    if not scene.contact.linear:
        yield True, "contact stiffness that changes with compression"
    friction = scene.friction
    if friction is None:
        yield False, "friction"
        return
    yield True, f"friction: law {given_law}" if given_law else f"friction: {friction.name}"
    if friction.direction == "unit-velocity":
        yield True, "friction along the unit slip velocity"
    else:
        yield False, "friction across the sliding direction (it acts along the arc only)"


def _bodies(scene: Scene) -> Iterator[Fact]:
    """How shoes and drum bend, and what holds and pushes the shoes."""
    for name, one in zip(scene.shoe_names, scene.alone, strict=True):
        if one.shoe.elastic is not None:
            shoe = f"the {name} shoe" if name else "the shoe"
            yield _bending(shoe, "free mode", elastic_names(one), up_to_of(one, "shoe"))
    if scene.elastic_table("drum")[1] is not None:
        yield _bending("the drum", "mode", drum_names(scene), up_to_of(scene, "drum"))
    yield scene.support is not None, "support springs"
    for key in ("spring", "force"):
        acting = [each for shoe in scene.shoes for each in getattr(shoe, key)]
        what, them = (f"{len(acting)} {key}s at points", "them") if len(acting) > 1 else (f"a {key} at a point", "it")
        if acting:
            yield True, f"{what}{_patches_in_words(scene, key, them)}"


def _bending(body: str, mode: str, names: Sequence[str], up_to: float) -> Fact:
    """Whether a body bends in shapes of these names, and in which kind of modes (Hz)."""
    if all(map(is_static, names)):
        return bool(names), f"bending of {body}{', nearly static' * bool(names)} (no {mode} up to {up_to:g} Hz)"
    return True, f"bending of {body}, {mode}s up to {up_to:g} Hz"


def _patches_in_words(scene: Scene, key: str, them: str) -> str:
    """Over which distances around them springs or forces act on shoes that bend; "" at points alone."""
    bending = (one.shoe.with_radii for one in scene.alone if elastic_names(one))
    radii = sorted({each.radius for shoe in bending for each in getattr(shoe, key)})
    return f", over {' and '.join(f'{1e3 * radius:.4g} mm' for radius in radii)} around {them}" if any(radii) else ""


def _operation(scene: Scene) -> Iterator[Fact]:
    """Of one shoe."""

    def said(there: bool, words: str, otherwise: str) -> Fact:
        return there, words if there else otherwise

    yield scene.damping is not None, "structural damping"
    yield bool(forced_coordinates(scene)), "harmonic force"
    yield scene.temperature is not None, "lining temperature and fade of friction"
    if scene.friction is not None:
        drag = "drag of friction on the steady state"
        there = scene.steady.state == "self-consistent"
        yield said(there, drag, f"{drag} (the assembly balances it)")
    yield said(isinstance(scene.drum.speed, Profile), "changing drum speed", "changes of the drum speed")
    yield said(isinstance(scene.contact.normal_load, Profile), "changing load", "changes of the load")
    if scene.shoe.force:
        changing = any(isinstance(force.size, Profile) for force in scene.shoe.force)
        yield said(changing, "changing force at a point", "changes of the forces at points")


def bending_in_words(scene: Scene) -> Iterator[str]:
    """Of each shoe and of the drum, if it bends, at which frequencies."""
    scene = resolved(scene)
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
    names = elastic_names(scene)
    if not names:
        return (
            f"The shoe has no free mode up to {up_to_of(scene, 'shoe'):g} Hz, so it is rigid here: how it yields in "
            "higher modes, which counts below them, too, is left out; raise shoe.elastic.up_to to include it"
        )
    besides = _besides(names, "the lining and to springs")
    if not count_modes(scene, "shoe"):
        return f"The shoe has no free mode up to {up_to_of(scene, 'shoe'):g} Hz{besides}"
    frequencies = zip(names, elastic_frequencies(scene, "shoe"), strict=True)
    named = [f"{name} {f:.0f} Hz" for name, f in frequencies if not is_static(name)]
    if shoe.solid is not None:
        return f"The shoe bends; its free modes, when nothing holds it: {', '.join(named)}{besides}"
    parts = []
    for symmetric, way in ((True, "in the plane"), (False, "out of it")):
        some = [name for name, each in zip(named, even, strict=False) if each == symmetric]
        parts += [f"{', '.join(some)} {way}"] if some else []
    return f"The shoe bends; its free modes, when nothing holds it: {'; '.join(parts)}{besides}"


def _besides(names: Sequence[str], pressing: str) -> str:
    """Which of a body's shapes are no modes, and what they are for; "" if there are none."""
    static = [name for name in names if is_static(name)]
    if not static:
        return ""
    which = " to ".join(dict.fromkeys((static[0], static[-1])))
    return f"; {which}: how it yields{' besides' * (len(static) < len(names))} to {pressing}"


def drum_modes_in_words(scene: Scene) -> str | None:
    """At which frequencies a drum that bends does so without shoes, in how many waves around; None of a rigid one."""
    modes, (table, drum) = drum_modes(scene), scene.elastic_table("drum")
    if modes is None or drum is None:
        return None
    names = drum_names(scene)
    if not names:
        return (
            f"The drum has no mode up to {up_to_of(scene, 'drum'):g} Hz, so it is rigid here; raise {table}.up_to to "
            "include how it yields"
        )
    besides = _besides(names, "the lining")
    if not count_modes(scene, "drum"):
        return f"The drum has no mode up to {up_to_of(scene, 'drum'):g} Hz{besides}"
    waves = zip(names, elastic_frequencies(scene, "drum"), modes.harmonics.tolist(), strict=True)
    rows = groupby((each for each in waves if not is_static(each[0])), lambda each: each[1:])
    parts = [f"{', '.join(name for name, *_ in group)} {f:.0f} Hz (n = {n})" for (f, n), group in rows]
    return f"The drum bends; its modes without shoes, of n waves around: {'; '.join(parts)}{besides}"
