"""Branches of cycles that double their period, jump, come to rest or are there already."""

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from drumsqueal.dynamics.cycles import branches as family_module
from drumsqueal.dynamics.cycles.branches import (
    SAME_VALUE,
    CycleFamily,
    DiagramBuilder,
    _is_on,
    is_branch_cycle,
    repeats,
)
from drumsqueal.dynamics.cycles.continuation import Track
from drumsqueal.dynamics.cycles.cycle import SAME, BranchEnd, Cycle, CycleBranch, Diagram, Event
from drumsqueal.errors import CycleError
from drumsqueal.findings.vibration import amplitudes_apart
from drumsqueal.physics.friction_law import ExponentialLaw, StepLaw
from drumsqueal.physics.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.questions.cycle.study import diagram_verdict, end_words
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import Critical
from drumsqueal.solve.shooting import Shooting, ShootingStart, scale_near
from drumsqueal.solve.transient.flow import flow
from drumsqueal.solve.transient.integrate import integrate

RANGE = (0.045, 0.06)  # m/s, about a window in which the cycles of the block on two springs have doubled their period


def with_derivative(model):
    return jax.jit(lambda value: jax.jvp(model, (value,), (1.0,)))


def two_springs(speed):
    how = {"mass": [1.0, 1.0], "springs": [[2.0, 1.0], [1.0, 2 - 4 / 3]], "damping": [[0.05, 0.0], [0.0, 0.05]]}
    return sprung_block_on_belt(StepLaw(0.7, 0.45), contact_stiffness=4 / 3, load=1.0, belt_speed=speed, **how)


def coulomb(speed):
    return block_on_belt(StepLaw(1.0, 0.5), belt_speed=speed)


def after(cycle, duration):
    """Where a transient from a cycle is after a time."""
    how: Any = {"duration": duration, "sample_rate": 20 / duration, "tolerance": 1e-12, "solver": "dopri8"}
    *_, chunk = integrate(cycle.model, np.zeros(2), cycle.state[:2], cycle.state[2:], **how)
    return np.concatenate([chunk.displacement[-1], chunk.velocity[-1]])


def test_a_branch_leaves_a_hopf_point_along_the_mode_that_neither_grows_nor_decays(monkeypatch):
    rates = {"X": -80.0, "Y": 1e-9, "Tz": 35.0}
    modes = [SimpleNamespace(name=name, growth_rate=rate) for name, rate in rates.items()]
    monkeypatch.setattr(family_module, "point_at", lambda *_: SimpleNamespace(modes=modes, steady=np.zeros(3)))
    tried = []

    def reach(model, mode):
        tried.append(mode.name)
        raise CycleError("no further")

    monkeypatch.setattr(family_module, "reach", reach)
    nowhere: Any = lambda value: (None, None)  # noqa: E731
    with pytest.raises(CycleError):
        CycleFamily(nowhere, RANGE).from_hopf(Critical(0.05, 0.0, "Y", 1.0, True), lambda _: None)
    assert tried == ["Y"]


def made_up(value: float, amplitude: float, period: float, multipliers: Any = (), rattle: float = 1e-18) -> Any:
    return Cycle.model_construct(
        value=value, amplitude={"X": amplitude, "Y": 2 * amplitude, "still": rattle}, period_s=period, what=None,
        multipliers=np.array(multipliers), model=SimpleNamespace(mass=np.array([1.0, 1.0, 1e-4])),
    )  # fmt: skip


def test_a_motion_lies_on_a_branch_between_two_of_its_cycles():
    # Amplitude and period go with the value: 1.25 m and 2.25 s a quarter of the way from 1 to 2.
    branch: Any = SimpleNamespace(cycles=[made_up(1.0, 1.0, 2.0), made_up(2.0, 2.0, 3.0), made_up(3.0, 3.0, 4.0)])
    on = {"X": 1.25, "Y": 2.5, "still": 3e-18}
    assert _is_on([branch], 1.25, 2.25, on)
    assert not _is_on([branch], 1.75, 2.25, on)
    assert not _is_on([branch], 3.5, 2.25, on)  # beyond its end
    for period, amplitude in ((2.25 * (1 + 2 * SAME), on), (2.25, on | {"Y": 2.5 * (1 + 2 * SAME)})):
        assert not _is_on([branch], 1.25, period, amplitude)
    assert _is_on([branch], 1.25, 2.25 * (1 + SAME / 2), on | {"Y": 2.5 * (1 - SAME / 2)})
    # A cycle that is a little off is compared with that of the branch at its value, and one off a fold is not on it.
    near = made_up(1.25, 1.25 * 1.1, 2.25)
    asked = []

    def between(a, b, closed=None):
        asked.append((a.value, b.value))
        return [] if closed is None else [closed]

    assert is_branch_cycle((branch,), made_up(1.25, 1.25, 2.25), between)
    assert not asked
    assert not is_branch_cycle((branch,), near, between)
    assert asked == [(1.0, 2.0)]
    assert is_branch_cycle((branch,), near, lambda a, b: between(a, b, near))
    assert not is_branch_cycle((branch,), made_up(1.25, 1.25, 2.25, multipliers=[2.0]), between)
    # Round-off decides to which side of the unit circle a multiplier on it is counted, and where what is still is.
    neutral = made_up(1.25, 1.25, 2.25, multipliers=[1 + 1e-12], rattle=7e-18)
    assert is_branch_cycle((branch,), neutral, between)
    # A branch is another one again where all but its ends are on it.
    again: Any = SimpleNamespace(cycles=[made_up(0.5, 9.0, 9.0), *(made_up(v, v, 1 + v) for v in (1.5, 2.5)), near])
    nothing: Any = SimpleNamespace(between=lambda *_: ())
    assert repeats(again, branch, nothing)
    again.cycles[1] = made_up(1.5, 1.6, 2.5)
    assert not repeats(again, branch, nothing)


@pytest.mark.parametrize(
    ("one", "other", "apart"),
    [
        ((1.0, 2e-18), (1.0, 7e-20), 0.0),  # still but for round-off
        ((1.0, 0.0), (1.1, 3e-16), np.log(1.1)),
        ((1.0, 0.3), (1.0, 0.6), np.log(2.0)),
        ((1.0, 0.005), (1.0, 0.03), np.log(3.0)),  # 0.01 √kg m is a thousandth of the motion
        ((0.0, 0.0), (0.0, 0.0), 0.0),
    ],
)
def test_motions_differ_by_what_each_coordinate_has_of_them_and_not_by_round_off(one, other, apart):
    # Of 100 kg and 1 kg a thousandth of the motion is √100 · 1.0/1000 = 0.01 of the second coordinate.
    motions = [dict(zip("XY", each, strict=True)) for each in (one, other)]
    for first, second in (motions, reversed(motions)):
        assert amplitudes_apart(first, second, np.array([100.0, 1.0])) == pytest.approx(apart, abs=1e-12)


def diagram_of(*branches, family):
    built = DiagramBuilder(family, Diagram(steady_sliding_stable=(RANGE,), steady_sliding_unstable=(), branches=()))
    for branch in branches:
        built._add(branch)
    return built.diagram


@pytest.fixture(scope="module")
def family():
    return CycleFamily(with_derivative(two_springs), RANGE)


@pytest.fixture(scope="module")
def simple(family):
    """The branch of the cycles that stick once, downwards, in steps as long as in a range twelve times as wide."""
    cycle, steady = family.sticking_at(0.0595), family.steady_at(0.0595)
    scale = scale_near(cycle.model, ShootingStart(cycle.state, cycle.period_s, ""), steady, 0.18)
    shooting = Shooting(with_derivative(two_springs), scale)
    closed = shooting.close(shooting.scaled(cycle.state, cycle.period_s, 0.0595))
    assert closed is not None
    track = Track(shooting, RANGE, family.steady_at, BranchEnd.CUT_OFF, lambda _: None)
    ended = track.follow(closed, -np.eye(closed.unknowns.size)[-1])
    return CycleBranch(start=BranchEnd.CUT_OFF, end=ended.end, cycles=tuple(track.cycles))


@pytest.fixture(scope="module")
def doubled(family, simple):
    return family.from_doubling(simple.special[0], lambda _: None)


@pytest.mark.thorough
def test_no_window_of_instability_is_stepped_over(simple):
    # An independent return map has the multiplier -1.0072 at 0.051 m/s, and -1 at about 0.0498 and 0.0517 m/s.
    above, below = simple.special
    assert (above.what, below.what) == (Event.DOUBLING, Event.DOUBLING)
    assert (above.value, below.value) == (pytest.approx(0.0517, abs=1e-4), pytest.approx(0.0498, abs=1e-4))
    assert [stable for _, stable in simple.pieces()] == [True, False, True]
    for cycle in (above, below):
        assert abs(cycle.multipliers[0] + 1) < 1e-4  # 1e-5 of a step of at most 0.15, in which it changes by 1 at most
    middle = min(simple.cycles, key=lambda cycle: abs(cycle.value - 0.051))
    assert middle.multipliers[0].real == pytest.approx(-1.0072, abs=1e-3)  # at 0.051, where it is largest


@pytest.mark.thorough
def test_cycles_of_twice_the_period_are_followed_from_one_doubling_to_the_next(family, simple, doubled):
    assert (doubled.start, doubled.end) == (BranchEnd.DOUBLING, BranchEnd.DOUBLING)
    above, below = simple.special
    ends = doubled.cycles[0].value, doubled.cycles[-1].value
    # The value is a parabola of the way along the branch, of which the end is found to a hundredth of a step.
    assert ends == (above.value, pytest.approx(below.value, abs=1e-5 * (RANGE[1] - RANGE[0])))
    assert all(cycle.stable for cycle in doubled.cycles[1:-1])
    # The transient of an independent code is released every 7.19 and 6.49 s in turn at 0.0505 m/s.
    rising = sorted(doubled.cycles[1:-1], key=lambda cycle: cycle.value)
    period = np.interp(0.0505, [cycle.value for cycle in rising], [cycle.period_s for cycle in rising])
    assert period == pytest.approx(7.19 + 6.49, abs=0.01)
    # And the package's own, which knows no tangents, is back after the whole of the period and not after half of it.
    cycle = rising[len(rising) // 2]
    half = np.concatenate([after(cycle, cycle.period_s / 2), after(cycle, cycle.period_s)]) - np.tile(cycle.state, 2)
    assert np.max(np.abs(half[:4])) > 1e-3
    assert np.max(np.abs(half[4:])) < 1e-7


@pytest.mark.thorough
def test_a_doubling_whose_value_is_known_from_the_doubled_cycles_is_not_followed_again(
    family, simple, doubled, monkeypatch
):
    shift, again = SAME_VALUE / 3 * (RANGE[1] - RANGE[0]), []
    shifted = tuple(cycle.model_copy(update={"value": cycle.value + shift}) for cycle in doubled.cycles)
    there = diagram_of(doubled.model_copy(update={"cycles": shifted}), family=family)
    monkeypatch.setattr(family, "from_doubling", lambda cycle, _: again.append(cycle) or doubled)
    built = DiagramBuilder(family, there)
    built._follow("", lambda _: simple)
    found = built.diagram
    assert again == []
    assert len(found.branches) == 2
    assert found.not_followed == ()
    # A branch that is there already adds nothing, and nothing begins on it that was not looked for.
    built._follow("", lambda _: simple)
    assert built.diagram is found
    assert again == []


@pytest.mark.thorough
def test_where_doubled_cycles_are_not_followed_squeal_is_unknown_and_where_they_are_it_is_known(
    family, simple, doubled
):
    above, below = simple.special
    alone = diagram_of(simple, family=family)
    assert alone.squeals_unknown == ((below.value, above.value),)
    assert alone.doublings == (below.value, above.value)
    speed = Variation("belt speed", "m/s", RANGE)
    assert "unknown from 0.0498 to 0.0517 m/s" in diagram_verdict(alone, speed)
    both = diagram_of(simple, doubled, family=family)
    assert both.doublings == alone.doublings
    assert both.folds == ()
    assert (both.squeals_unknown, both.not_followed) == ((), ())
    ((low, high),) = both.stable_cycles
    assert (low, high) == (RANGE[0], pytest.approx(0.0595))
    assert "period doubling at 0.0498, 0.0517 m/s" in diagram_verdict(both, speed)


@pytest.mark.thorough
def test_what_begins_where_a_stable_piece_ends_is_unknown_as_far_as_the_branch_goes(simple):
    at = simple.cycles.index(simple.special[0])
    ends = CycleBranch(start=BranchEnd.CUT_OFF, end=BranchEnd.BOUND, cycles=simple.cycles[: at + 2])
    (unknown,) = ends.not_followed(*RANGE)
    assert (unknown.low, unknown.high) == (simple.cycles[at + 1].value, simple.special[0].value)
    # What is followed already is known; where an unstable piece ends otherwise nothing begins.
    assert ends.not_followed(*RANGE, {simple.special[0].value}) == ()


@pytest.mark.thorough
def test_where_a_motion_of_two_coordinates_jumps_it_is_not_known_what_to(simple):
    jumps = CycleBranch(start=BranchEnd.BOUND, end=BranchEnd.GRAZING, cycles=tuple(reversed(simple.cycles[:3])))
    (unknown,) = jumps.not_followed(*RANGE)
    assert (unknown.low, unknown.high) == (simple.cycles[0].value, RANGE[1])


@pytest.mark.thorough
def test_a_branch_is_there_once(family, simple):
    at = len(simple.cycles) // 2
    halves = [
        CycleBranch(start=BranchEnd.BOUND, end=BranchEnd.LOST, end_detail="here", cycles=simple.cycles[: at + 1]),
        CycleBranch(start=BranchEnd.LOST, end=BranchEnd.BOUND, cycles=simple.cycles[at:]),
    ]
    pieces = diagram_of(*halves, family=family)
    assert len(pieces.branches) == 2
    assert any(each.reason == "here" for each in pieces.not_followed)
    for found in (diagram_of(*halves, simple, family=family), diagram_of(simple, *halves, family=family)):
        assert found.branches == (simple,)
        assert not any(each.reason == "here" for each in found.not_followed)


@pytest.mark.thorough
def test_cycles_of_a_belt_that_stops_end_there_and_at_no_hopf_point():
    def falling_friction(speed):
        return block_on_belt(ExponentialLaw(1.0, 0.5, 2.0), damping=0.1, belt_speed=speed)

    slow = CycleFamily(with_derivative(falling_friction), (-0.1, 0.1))
    cycle = slow.sticking_at(0.09)
    assert cycle is not None
    branch = slow.both_ways(cycle)
    assert {branch.start, branch.end} == {BranchEnd.STANDSTILL, BranchEnd.BOUND}
    assert "where the drum stands still" in " ".join(end_words(branch))


@pytest.mark.thorough
@pytest.mark.parametrize("speed", [1e-2, 1e-4])
def test_a_slow_belt_takes_no_more_steps(speed):
    # It sticks for 1/V, and slips round all of a circle but the arc on which it would be as fast as the belt.
    exact = 1 / speed + 2 * np.pi - 2 * np.arctan(0.5 / speed)
    cycle = CycleFamily(with_derivative(coulomb), (speed / 2, speed)).sticking_at(speed)
    assert cycle is not None
    assert cycle.period_s == pytest.approx(exact, rel=1e-9)
    size = jnp.array([1.0, 1.0])
    assert flow(cycle.model, size, cycle.state, cycle.period_s, 1e-10).steps < 150  # 93 at 0.01 m/s, 78 at 0.0001
