"""What a scene could do without: each of its effects left out, or reduced to a simpler one.

The answer of one shoe alone stands under the names of the brake that it was taken from, along its axes.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.coordinates import is_of_drum, is_static, shoe_of
from drumsqueal.findings.compare import SceneAnswer, answer_of
from drumsqueal.physics.basis import lining_stiffness
from drumsqueal.physics.composition import (
    coordinates_of,
    forced_coordinates,
    kept_coordinates,
    linear_coordinates,
    plane_of,
)
from drumsqueal.physics.elasticity import (
    count_modes,
    drum_modes,
    drum_names,
    elastic_frequencies,
    elastic_names,
    resolved,
    up_to_of,
)
from drumsqueal.physics.model import Model
from drumsqueal.scene import Profile, Scene, Schedule, quantity_of
from drumsqueal.scene.laws.constant import ConstantFriction
from drumsqueal.scene.shoes import NamedShoe
from drumsqueal.scene.tables import ContactTable
from drumsqueal.simulation import Result


def answer_in(brake: Scene, scene: Scene, left_out: Sequence[int], run: Result, linear: Model) -> SceneAnswer:
    """The answer of a run of a scene that leaves out shoes of the brake; `linear` is its model of all coordinates."""
    history, stability = run.history, run.stability
    if scene.several or not brake.several:
        return answer_of(history, run.findings, stability, linear)
    (k,) = (k for k in range(len(brake.shoes)) if k not in left_out)
    shoe = brake.shoes[k]
    assert isinstance(shoe, NamedShoe)
    turn = turn_of_drum(scene, stability.coordinates, shoe.position)
    mine = [history["coordinate"].values.tolist().index(name) for name in stability.coordinates]
    turned = {name: history[name].copy() for name in ("displacement", "velocity")}
    for each in turned.values():
        each[:, mine] = each.values[:, mine] @ turn.T
    return _renamed(answer_of(history.assign(turned), run.findings, stability.turned(turn), linear), brake.prefixes[k])


def along_own_axes(brake: Scene, number: int) -> Scene:
    """The brake with one of its shoes alone, its drum started and forced as it is in the brake: in its modes alone.

    How it yields besides is another under each shoe.
    """
    one, shoe = brake.alone[number], brake.shoes[number]
    assert isinstance(shoe, NamedShoe)
    moved = {".".join(path): table for path, table in one.by_coordinate.items() if any(map(is_of_drum, table))}
    if not moved:
        return one
    names = [name for name in drum_names(one) if not is_static(name)]
    turn, values = turn_of_drum(one, names, shoe.position), {}
    for key, table in moved.items():
        turned = turn.T @ [table.get(name, 0.0) for name in names]
        of_drum = {name: value for name, value in zip(names, turned.tolist(), strict=True) if value != 0}
        values[key] = {name: value for name, value in table.items() if not is_of_drum(name)} | of_drum
    return one.with_values(values)


def turn_of_drum(scene: Scene, names: Sequence[str], position: float) -> NDArray[np.float64]:
    """The matrix (n, n) by which coordinates of a shoe alone become those along axes at which it stands turned (rad).

    A pair of the drum, of n waves, is turned by n times the angle: seen from elsewhere, another sum of both is the
    cosine. A rigid shoe and its own shapes go with it, and how the drum yields besides its modes.
    """
    turn, modes = np.eye(len(names)), drum_modes(scene)
    if modes is None:
        return turn
    of_drum = zip(drum_names(scene), modes.harmonics, modes.wavenumbers, strict=True)
    rows = [(names.index(name), n, wave) for name, n, wave in of_drum if name in names and not is_static(name)]
    k = 0
    while k < len(rows) - 1:
        (one, n, wave), (other, *same) = rows[k : k + 2]
        if n and same == [n, wave]:
            cosine, sine = np.cos(n * position), np.sin(n * position)
            turn[np.ix_([one, other], [one, other])] = [[cosine, -sine], [sine, cosine]]
            k += 1
        k += 1
    return turn


def _renamed(answer: SceneAnswer, prefix: str) -> SceneAnswer:
    """The answer with what the coordinates of its shoe begin with in the brake."""

    def brakes(name: str) -> str:
        return name if is_of_drum(name) else f"{prefix}{name}"

    main = answer.main
    return replace(
        answer,
        modes={brakes(label): mode for label, mode in answer.modes.items()},
        unstable=tuple(map(brakes, answer.unstable)),
        amplitude={brakes(name): size for name, size in answer.amplitude.items()},
        carriers=tuple(map(brakes, answer.carriers)),
        main=main and replace(main, coordinate=brakes(main.coordinate)),
    )


NOTHING = "none"  # what becomes of an effect that is left out


class Reduction(NamedTuple):
    """One effect, what it becomes, and the values of the scene that do it (as `Scene.with_values` takes them).

    `springs` are places of springs at points that are left out, `without` coordinates. `shoe` is the number of the shoe
    that has the effect, of several; where `leaves_shoe`, that shoe is what is left out.
    """

    effect: str
    becomes: str
    values: Mapping[str, Any]
    springs: tuple[int, ...] = ()
    without: tuple[str, ...] = ()
    shoe: int | None = None
    leaves_shoe: bool = False

    def __str__(self) -> str:
        """Effect and what becomes of it: "separation → bonded"."""
        return f"{self.effect} → {self.becomes}"


class BendingBody(NamedTuple):
    """One that bends: what it is called, the key of the table by which it does, and the names of all of its shapes.

    `scene` is the one that knows its shapes, that of the shoe alone, as those of a `kind`, "shoe" or "drum".
    """

    name: str
    kind: str
    scene: Scene
    key: str
    shapes: tuple[str, ...]
    shoe: int | None = None

    @property
    def effect(self) -> str:
        """The effect by which it bends."""
        return f"elasticity of {self.name}"

    @property
    def fewer(self) -> str:
        """The effect of fewer of its modes."""
        plain = {"the shoe": "elastic modes", "the drum": "drum modes"}
        return plain.get(self.name, f"elastic modes of {self.name}")

    @property
    def up_to(self) -> float:
        """Up to which frequency (Hz) its modes are kept."""
        return up_to_of(self.scene, self.kind)

    @property
    def frequencies(self) -> list[float]:
        """Those of its modes (Hz), which are the first of its shapes."""
        return elastic_frequencies(self.scene, self.kind)[: count_modes(self.scene, self.kind)]


def bodies_of(scene: Scene) -> tuple[BendingBody, ...]:
    """The shoes and the drum, those of them that bend."""
    found = []
    for k, one in enumerate(resolved(scene).alone):
        shapes = tuple(f"{scene.prefixes[k]}{each}" for each in elastic_names(one))
        name, key, shoe = scene.shoe_names[k], scene.key_of(k, "shoe.elastic"), k if scene.several else None
        found.append(BendingBody(name or "the shoe", "shoe", one, key, shapes, shoe))
    found.append(BendingBody("the drum", "drum", scene, scene.elastic_table("drum")[0], drum_names(scene)))
    return tuple(each for each in found if each.scene.elastic_table(each.kind)[1] is not None)


def reductions_of(scene: Scene) -> tuple[Reduction, ...]:
    """Every reduction that changes something in the scene; any number of them can be put together, in this order.

    But for all shoes, of which one must stay.
    """
    return tuple(_reductions(scene))


def reduce(scene: Scene, reductions: Sequence[Reduction]) -> Scene:
    """Return the scene with these reductions, in the order of `reductions_of`."""
    without = {name for reduction in reductions for name in reduction.without}
    kept = [name for name in coordinates_of(scene) if name not in without]
    values = _over(scene, kept) if without else {}
    for reduction in reductions:
        values |= reduction.values
    for k, shoe in enumerate(scene.shoes):
        places = {place for each in reductions if each.shoe in (None, k) for place in each.springs}
        if places:
            left = [each.model_dump() for place, each in enumerate(shoe.spring) if place not in places]
            values[scene.key_of(k, "shoe.spring")] = left or None
    left_out, (drum, _) = shoes_left_out(reductions), scene.elastic_table("drum")
    if drum in values and len(scene.shoes) - len(left_out) > 1:
        # Shoes on a rigid drum are problems of their own. With the drum's modes held still they are the same problems
        # in one model, so that every quantity can be compared under its name.
        del values[drum]
        if values.get("simulate.coordinates", "auto") == "auto":
            moving, gone = kept_coordinates(scene.with_values(values)), [scene.prefixes[k] for k in left_out]
            shoes = [name for name in moving if not is_of_drum(name) and shoe_of(name) not in gone]
            values["simulate.coordinates"] = shoes
    return _without_shoes(scene, values, left_out) if left_out else scene.with_values(values)


def shoes_left_out(reductions: Sequence[Reduction]) -> tuple[int, ...]:
    """The numbers of the shoes that these leave out."""
    return tuple(reduction.shoe for reduction in reductions if reduction.leaves_shoe and reduction.shoe is not None)


def what_counts(reductions: Sequence[Reduction], left_out: Sequence[int] | None = None) -> tuple[Reduction, ...]:
    """Those that still change something: not what is reduced of a shoe that is left out, by these if not told."""
    gone = shoes_left_out(reductions) if left_out is None else left_out
    return tuple(each for each in reductions if each.leaves_shoe or each.shoe not in gone)


def _without_shoes(scene: Scene, values: dict[str, Any], left_out: Sequence[int]) -> Scene:
    """The scene with values, of the other shoes, whose coordinates are all that it starts, forces and lists."""
    left = [k for k in range(len(scene.shoes)) if k not in left_out]
    # Listed last: while a shoe is there, one of its coordinates has to be among them.
    listed = values.get("simulate.coordinates", "auto")
    whole = scene.with_values({**values, "simulate.coordinates": "auto"})
    if len(left) == 1:
        (k,) = left
        one, prefix = along_own_axes(whole, k), scene.prefixes[k]
        own = listed if isinstance(listed, str) else [name.removeprefix(prefix) for name in listed]
        return one.with_values({"simulate.coordinates": own})
    # Keys of what is uncertain count the shoes that there were.
    shoes = [whole.shoes[k].model_dump(exclude_none=True) for k in left]
    return whole.with_values({"shoe": shoes, "uncertain": None, "simulate.coordinates": listed})


def _reductions(scene: Scene) -> Iterator[Reduction]:
    kept, plane, moving = set(kept_coordinates(scene)), set(plane_of(scene)), set(linear_coordinates(scene))
    # Several shoes are on a drum that bends, which moves them out of the plane.
    if kept - plane and kept & plane and not scene.several:
        yield Reduction(
            "space", "plane", {}, without=tuple(name for name in coordinates_of(scene) if name not in plane)
        )
    for k, (name, prefix) in enumerate(zip(scene.shoe_names, scene.prefixes, strict=True)):
        if scene.several:
            own = tuple(each for each in coordinates_of(scene) if shoe_of(each) == prefix)
            yield Reduction(f"shoe {name}", NOTHING, {}, without=own, shoe=k, leaves_shoe=True)
    for body in bodies_of(scene):
        if moving.intersection(body.shapes):
            yield Reduction(body.effect, "rigid", {body.key: None}, without=body.shapes, shoe=body.shoe)
    for table in _tables(scene, "contact"):
        if not table.content.linear:
            kept = {key: each for key, each in table.content.model_dump().items() if key not in ContactTable.usual}
            # Shoes that have the table together may be pushed apart: each gets its own line.
            shoes = [table.shoe] if table.shoe is not None else _without_own(scene, "contact")
            keys = [table.key] if len(shoes) == 1 else [f"shoe.{k}.contact" for k in shoes]
            stiffness = [lining_stiffness(scene.alone[k]) for k in shoes]
            lines = {key: {**kept, "stiffness": each} for key, each in zip(keys, stiffness, strict=True)}
            yield Reduction(f"stiffening{table.of}", "linear", lines, shoe=table.shoe)
    separating = [table for table in _tables(scene, "contact") if table.content.separation]
    if separating:
        bonded = {f"{table.key}.separation": False for table in separating}
        of, shoe = (separating[0].of, separating[0].shoe) if len(separating) == 1 else ("", None)
        yield Reduction(f"separation{of}", "bonded", bonded, shoe=shoe)
    for table in _tables(scene, "friction"):
        yield from _friction(scene, table)
    if scene.support is not None:
        yield Reduction("support springs", NOTHING, {"support": None})
    for table in _tables(scene, "damping"):
        yield from _left_out("damping", table, {"ratio": 0.0})
    if scene.temperature is not None:
        yield Reduction("temperature", NOTHING, {"temperature": None})
    yield from _springs(scene)
    if forced_coordinates(scene):
        yield Reduction("harmonic force", NOTHING, {"forcing": None})
    if scene.steady.state == "self-consistent" and any(_tables(scene, "friction")) and not scene.pushed:
        yield Reduction("steady drag", "balanced", {"steady.state": "uniform-pressure"})
    named = {"drum.speed": "speed profile", "contact.normal_load": "load profile"}
    for key, schedule in scene.schedules().items():
        if isinstance(schedule, Profile):
            start, unit = _at_start(schedule), quantity_of(key, scene).unit
            shoe = int(key.split(".")[1]) if scene.several and key.startswith("shoe.") else None
            yield Reduction(named.get(key, f"profile of {key}"), f"{start:.4g} {unit}", {key: start}, shoe=shoe)


def _springs(scene: Scene) -> Iterator[Reduction]:
    """Each point of a shoe that springs take hold of."""
    for k, shoe in enumerate(scene.shoes):
        points: dict[tuple[float, ...], list[int]] = {}
        for place, spring in enumerate(shoe.spring):
            points.setdefault(tuple(spring.at), []).append(place)
        for each in points.values():
            label = f"spring{'s'[: len(each) > 1]} {', '.join(map(str, each))}{_of(scene, k)}"
            yield Reduction(label, NOTHING, {}, springs=tuple(each), shoe=k if scene.several else None)


def _of(scene: Scene, shoe: int) -> str:
    """What the effects of one of several shoes are called besides."""
    return f" of {scene.shoe_names[shoe]}" if scene.several else ""


class _Table(NamedTuple):
    """A table that serves all shoes, or one that a shoe has of its own: key, content and what is said of its effects.

    `otherwise` says whether a table that serves all takes its place where it is left out.
    """

    key: str
    content: Any
    of: str = ""
    shoe: int | None = None
    otherwise: bool = False


def _tables(scene: Scene, name: str) -> Iterator[_Table]:
    """Those of that name that a shoe goes by; damping is the drum's, too."""
    shared = getattr(scene, name)
    by = _without_own(scene, name)
    if shared is not None and (by or name == "damping"):
        # That of the only shoe without a table of its own goes where that shoe goes.
        yield _Table(name, shared, shoe=by[0] if scene.several and len(by) == 1 and name != "damping" else None)
    for k in range(len(scene.shoes)):
        if k not in by:
            content = getattr(scene.shoes[k], name)
            yield _Table(scene.key_of(k, name), content, _of(scene, k), k, otherwise=shared is not None)


def _without_own(scene: Scene, name: str) -> list[int]:
    """The shoes that have no table of that name of their own."""
    return [k for k, shoe in enumerate(scene.shoes) if not (scene.several and getattr(shoe, name) is not None)]


def _left_out(effect: str, table: _Table, zero: Mapping[str, Any], **besides: None) -> Iterator[Reduction]:
    """The table left out: that of one shoe, to whom another would come, becomes zero."""
    nothing = zero if table.otherwise else None
    if nothing != table.content.model_dump():
        yield Reduction(f"{effect}{table.of}", NOTHING, {table.key: nothing, **besides}, shoe=table.shoe)


def fewest_modes(body: BendingBody, suffices: Callable[[Reduction], bool]) -> Reduction | None:
    """The fewest modes of a body that bends that suffice, by bisection; None where it takes all of them.

    With more modes errors are taken to be smaller. Modes of one frequency, as a drum's pairs, stay together.
    """
    frequencies = sorted(set(body.frequencies))
    too_few, enough, found = 0, len(frequencies), None
    while enough - too_few > 1:
        count = (too_few + enough) // 2
        reduction = _modes(body, frequencies, count)
        if suffices(reduction):
            enough, found = count, reduction
        else:
            too_few = count
    return found


def _modes(body: BendingBody, frequencies: Sequence[float], count: int) -> Reduction:
    """Those of the modes that have so many frequencies: those below a round frequency between two.

    How the body yields besides is another with fewer modes: none of those shapes is the whole scene's.
    """
    last, following = frequencies[count - 1 : count + 1]
    between = (float(f"{(last + following) / 2:.{digits}g}") for digits in range(1, 16))
    limit = next((each for each in between if last < each < following), following)
    number = sum(each <= last for each in body.frequencies)
    becomes = f"{number} below {limit / 1e3:.6g} kHz"
    return Reduction(body.fewer, becomes, {f"{body.key}.up_to": limit}, without=body.shapes[number:], shoe=body.shoe)


def _friction(scene: Scene, table: _Table) -> Iterator[Reduction]:
    # The law first: it replaces the whole table, into which the direction then goes. Without any friction there is no
    # direction either, so that leaving it out comes last.
    friction = table.content
    if not isinstance(friction, ConstantFriction):
        sliding = friction.at(scene.shoes[0].outer_radius * abs(_at_start(scene.drum.speed)))
        law = {table.key: friction.constant(sliding)}
        yield Reduction(f"{friction.name}{table.of}", f"μ {sliding:.4g}", law, shoe=table.shoe)
    if friction.direction == "unit-velocity":
        along = {f"{table.key}.direction": "tangential"}
        yield Reduction(f"unit velocity{table.of}", "tangential", along, shoe=table.shoe)
    if isinstance(friction, ConstantFriction):
        heated = {} if scene.temperature is None else {"temperature": None}  # which nothing else heats
        yield from _left_out("friction", table, friction.constant(0.0), **heated)


def _over(scene: Scene, names: Sequence[str]) -> dict[str, Any]:
    """Values by which no other coordinate is started, forced or listed."""
    values: dict[str, Any] = {}
    for (table, key), numbers in scene.by_coordinate.items():
        kept = {name: value for name, value in numbers.items() if name in names}
        values |= {f"{table}.{key}": kept} if table == "start" or any(kept.values()) else {table: None}
    if scene.simulate.coordinates == coordinates_of(scene):
        values["simulate.coordinates"] = "auto"  # which keeps the eigenvalues of all
    elif scene.simulate.coordinates != "auto":
        values["simulate.coordinates"] = [name for name in scene.simulate.coordinates if name in names]
    return values


def _at_start(schedule: Schedule) -> float:
    return float(np.interp(0.0, schedule.time, schedule.value)) if isinstance(schedule, Profile) else schedule
