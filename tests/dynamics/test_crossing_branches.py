"""Where branches of cycles cross, fold, double their period or begin a torus, on motions that are known exactly.

With s = x² + x′², x″ + x + D(s) x′ = 0 has the cycles D(s) = 0 of 1 rad/s: s′ = −2 D x′², so that a small disturbance
of s grows in a period by exp(−2π s D′(s)). A second coordinate y, of which x knows nothing while it is zero, adds the
multipliers of its own linear equation.
"""

import dataclasses
from collections.abc import Callable
from functools import cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy
from scipy.integrate import solve_ivp
from scipy.optimize import OptimizeResult, brentq

from drumsqueal.dynamics.cycles import continuation
from drumsqueal.dynamics.cycles.branches import CycleFamily
from drumsqueal.dynamics.cycles.continuation import Ended, Track
from drumsqueal.dynamics.cycles.cycle import BranchEnd, Cycle, CycleBranch, Diagram, Event, RangeKind
from drumsqueal.dynamics.cycles.search import Seed
from drumsqueal.dynamics.ensemble import Family, directions
from drumsqueal.errors import CycleError
from drumsqueal.physics.effects.effect import Action, Effect
from drumsqueal.physics.friction_law import ConstantLaw
from drumsqueal.physics.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.questions.cycle.study import diagram_verdict, find_cycle, follow_cycles
from drumsqueal.questions.motion.study import study_motion
from drumsqueal.questions.onset.study import study_onset
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import point_at
from drumsqueal.solve.shooting import Closed, Shooting, _folds, find_crossing
from drumsqueal.solve.transient.flow import Flow

PERIOD = 2 * np.pi
ROUND = {"displacement": {"X": 1.0}}


class Force(Effect):
    """A force of one's own, which depends on a number, displacement and velocity."""

    law: Callable = eqx.field(static=True)
    number: Any

    def act(self, moment, q, v):
        force = self.law(self.number, q, v)
        return Action(force, sum(part * speed for part, speed in zip(force, v, strict=True)))

    def potential_energy(self, moment, q):
        return 0.0 * q[0]


def one(law):
    """A block of 1 kg on 1 N/m with a force and no friction, on a belt that it never comes to be as fast as."""

    def model(number):
        block = block_on_belt(ConstantLaw(0.0), belt_speed=5.0)
        return dataclasses.replace(block, others=(*block.others, Force(law, number)))

    return model


def two(law, stiffness, damping=0.0):
    """One that also moves across on a spring of its own (N/m), with a dashpot (N s/m) there."""
    how = {"springs": np.diag([1.0, stiffness / 2]), "contact_stiffness": stiffness / 2, "belt_speed": 5.0}

    def model(number):
        dashpots = np.diag([0.0, damping])
        block = sprung_block_on_belt(ConstantLaw(0.0), mass=[1, 1], damping=dashpots, separation=False, **how)
        return dataclasses.replace(block, others=(*block.others, Force(law, number)))

    return model


def size(q, v):
    return q[0] ** 2 + v[0] ** 2


def exchange(middle, gap=0.0):
    """Cycles s = middle ± p, which exchange stability at p = 0; with a gap, s = middle ± √(p² + gap)."""
    return lambda p, q, v: (-((size(q, v) - middle) ** 2 - p**2 - gap) * v[0],)


def fold(p, q, v):
    return (-((size(q, v) - 1) ** 2 - p) * v[0],)


def alone(p, q, v):
    """The cycle s = 1 at p = 0, and none elsewhere."""
    return (-((size(q, v) - 1) ** 2 + p**2) * v[0],)


def leans(slope):
    """Cycles s = 1, and s − 1 = u with p = slope × u + u²."""
    return lambda p, q, v: (-(size(q, v) - 1) * ((size(q, v) - 1) * (size(q, v) - 1 + slope) - p) * v[0],)


def buckles(p, q, v):
    """Cycles y = 0, s = 1, and from p = 1 on y² = (p − 1)/(p + 1), s = 1 − y²."""
    return (-(size(q, v) - 1 + q[1] ** 2) * v[0], p * size(q, v) * q[1] - q[1] ** 3 - 0.5 * v[1])


def flutters(p, q, v):
    """On s = 1, y″ + (0.3 − p) y′ + 2 y = 0."""
    return (-(size(q, v) - 1) * v[0], -(0.3 - p * size(q, v)) * v[1] - q[1] ** 2 * v[1])


def swings(p, q, v):
    """On x = cos t, y″ + 0.1 y′ + (1/4 + p cos t) y = 0: Mathieu's equation."""
    return (-(size(q, v) - 1) * v[0], -0.1 * v[1] - p * q[0] * q[1] - q[1] ** 3)


# The crossing itself, on flows of SciPy


def shooting(law, stiffness):
    """The equations of a closed motion with a flow of SciPy's, so many springs in N/m."""
    n = len(stiffness)

    def rate(state, p):
        q, v = state[:n], state[n:]
        return jnp.concatenate([v, jnp.array(law(p, q, v)) - jnp.array(stiffness) * q])

    rates = jax.jit(lambda state, p: (rate(state, p), *jax.jacfwd(rate, (0, 1))(state, p)))

    def moved(time, packed, p):
        state, tangents = packed[: 2 * n], packed[2 * n :].reshape(2 * n, 2 * n + 1)
        velocity, slopes, of_number = (np.asarray(each) for each in rates(state, p))
        following = slopes @ tangents
        following[:, -1] += of_number
        return np.append(velocity, following)

    def flow(p, scale, state, duration, tolerance, change):
        start = np.append(state, np.eye(2 * n, 2 * n + 1))
        end = solve_ivp(moved, (0, duration), start, "DOP853", rtol=1e-11, atol=1e-11, args=(p,)).y[:, -1]
        tangents = end[2 * n :].reshape(2 * n, 2 * n + 1)
        rate = np.asarray(rates(end[: 2 * n], p)[0])
        return Flow(end[: 2 * n], rate, tangents[:, :-1], tangents[:, -1], 1, True)

    numbers: Any = lambda p: (p, None)  # noqa: E731
    return Shooting(numbers, np.append(np.ones(2 * n), [PERIOD, 1.0]), flow=flow)


@cache
def crossing(law, *guess):
    """The equations, with springs of 1 N/m, and the crossing that is found from a guess: once for all tests."""
    equations = shooting(law, np.ones(len(guess) // 2 - 1))
    return equations, find_crossing(equations, np.array(guess))


EXCHANGING = exchange(1.0), 1.03, 0.1, 0.99, 0.05
BUCKLING = buckles, 0.99, 0.02, 0.1, -0.02, 1.01, 1.05


def test_branches_cross_where_cycles_exchange_stability():
    _, found = crossing(*EXCHANGING)
    # To 1e-10, by which a cycle closes.
    np.testing.assert_allclose(found.closed.unknowns[-2:], [1.0, 0.0], rtol=0, atol=1e-9)
    state = found.closed.unknowns[:2]
    assert np.hypot(*state) == pytest.approx(1.0, abs=1e-9)
    # √s = 1 ± p/2, to differences over 1e-5 of what is known to 1e-10.
    slopes = found.directions[:, :2] @ state / found.directions[:, -1]
    np.testing.assert_allclose(np.sort(slopes), [-0.5, 0.5], rtol=0, atol=1e-4)
    along = np.append(0.5 * state, [0.0, 1.0])
    own, other = found.split(along)
    assert abs(own @ along) > 0.99 * np.linalg.norm(along) > abs(other @ along)


def test_branches_cross_where_cycles_lose_a_symmetry_and_one_leaves_without_a_change_of_the_number():
    _, found = crossing(*BUCKLING)
    np.testing.assert_allclose(found.closed.unknowns[[1, -2, -1]], [0.0, 1.0, 1.0], rtol=0, atol=1e-9)
    symmetric, broken = found.split(np.eye(6)[-1])
    # By differences over 1e-5 of what is known to 1e-10: y alone, and s = 1 whatever p is, but for the phase of both.
    assert broken[-1] == 0
    assert abs(broken[1]) > 0.999
    assert abs(symmetric[1]) < 1e-4
    assert abs(symmetric[-1]) > 0.999


def test_a_pitchfork_is_one_where_the_mirror_image_comes_half_a_period_later():
    """With x y² the mirrored motion is (−x, −y): at one phase both sides of the branch differ by more than a sign."""

    def law(p, q, v):
        along, across = buckles(p, q, v)
        return (along, across + q[0] * q[1] ** 2)

    found = find_crossing(shooting(law, [1.0, 1.0]), np.array([0.99, 0.02, 0.1, -0.02, 1.01, 1.05]))
    assert found.pitchfork
    assert found.closed.unknowns[-1] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("known", "pitchfork", "width"),
    [  # over 1e5 a slope of 2 is one of 2e-5, over 1e-3 an error of 1e-6 is one of 1e-3
        (EXCHANGING, False, 1e5),
        ((leans(0.1), 1.03, 0.1, 0.99, 0.01), False, 1e5),
        (BUCKLING, True, 1e-3),
    ],
    ids=["transcritical", "leaning", "pitchfork"],
)
def test_what_a_crossing_is_does_not_depend_on_the_range(known, pitchfork, width):
    equations, found = crossing(*known)
    assert found.pitchfork == pitchfork
    steepest = min(found.directions, key=lambda each: abs(each[-1]))
    units = np.append(np.ones(found.closed.unknowns.size - 1), width)
    closed = found.closed._replace(unknowns=found.closed.unknowns / units)
    assert _folds(equations.in_units(units), closed, steepest / units) == pitchfork


@pytest.mark.parametrize(("law", "start"), [(fold, 0.02), (exchange(1.0, 0.01), 0.02), (alone, 0.02)])
def test_branches_do_not_cross_that_fold_or_come_near_each_other_and_a_cycle_that_is_alone_is_on_none(law, start):
    with pytest.raises(CycleError):
        find_crossing(shooting(law, [1.0]), np.array([1.0, 0.05, 1.0, start]))


def test_a_regular_cycle_at_which_the_search_stalls_is_no_crossing(monkeypatch):
    equations = shooting(exchange(1.0), [1.0])
    regular = equations.close(np.array([1.03, 0.0, 1.0, 0.05]))  # s = 1.05 at p = 0.05
    assert regular is not None
    monkeypatch.setattr(scipy.optimize, "root", lambda _, start, **how: OptimizeResult(x=start, success=False))
    with pytest.raises(CycleError, match="no crossing of branches is found"):
        find_crossing(equations, regular.unknowns)


def bare(shooting, closed):
    """A cycle of a shooting on a flow of SciPy's: where it is, and no motion."""
    (x, v), period, value = shooting.unscaled(closed.unknowns)
    how = {"displacement": {"X": x}, "velocity": {"X": v}, "period_s": period, "value": value}
    return Cycle.model_construct(**how, multipliers=np.ones(1))


@pytest.mark.thorough(but=["0.03-found0"])
@pytest.mark.parametrize(("bound", "found"), [(0.03, [Event.TRANSCRITICAL, None]), (-0.03, [None])])
def test_a_crossing_on_the_last_step_is_found_if_it_is_within_the_range(monkeypatch, bound, found):
    monkeypatch.setattr(continuation, "describe", bare)
    equations = shooting(exchange(1.0), [1.0])
    track = Track(equations, (-0.5, bound), lambda _: None, BranchEnd.BOUND, lambda _: None)
    # On s = 1 + p, from p = −0.05 to 0.05.
    closed = [equations.close(np.array([np.sqrt(1 + p), 0.0, 1.0, p])) for p in (-0.05, 0.05)]
    place, beyond = (track._place(each, np.eye(4)[-1]) for each in closed if each is not None)
    crossing = find_crossing(equations, np.array([1.01, 0.0, 1.0, 0.01]))
    assert track._to_bound(place, beyond._replace(crossing=crossing), bound) == (BranchEnd.BOUND, "")
    assert [each.what for each in track.cycles] == found
    assert track.cycles[-1].value == bound


@pytest.mark.parametrize("lost", [-1.0, 1.0, 0.0])
def test_of_a_branch_through_a_crossing_one_side_is_kept_if_the_other_is_lost(monkeypatch, lost):
    equations = shooting(exchange(1.0), [1.0])
    closed = equations.close(np.array([1.0, 0.0, 1.0, 0.0]))
    assert closed is not None
    cycle = bare(equations, closed).model_copy(update={"crossing": np.array([0.5, 0.0, 0.0, 1.0])})

    def followed(family, shooting, closed, ahead, start, on_branch):
        if ahead[-1] * lost >= 0:
            raise CycleError("it is lost")
        return [bare(shooting, closed)], Ended(BranchEnd.BOUND)

    monkeypatch.setattr(CycleFamily, "_shooting_from", lambda family, cycle: equations)
    monkeypatch.setattr(CycleFamily, "_follow", followed)
    family = CycleFamily(lambda p: pytest.fail("no model is needed"), (-0.5, 0.5))
    if not lost:
        with pytest.raises(CycleError, match="it is lost"):
            family.from_crossing(cycle, lambda _: None)
        return
    branch = family.from_crossing(cycle, lambda _: None)
    (gone,) = branch.not_followed(-0.5, 0.5)
    assert gone.reason == "it is lost"
    assert (gone.low, gone.high) == ((0.0, 0.5) if lost > 0 else (-0.5, 0.0))


@pytest.mark.parametrize("low", [-0.5, -0.002])
def test_the_first_cycle_of_a_branch_from_a_crossing_is_within_the_range(low):
    equations, none = shooting(exchange(1.0), [1.0]), lambda p: pytest.fail("no model is needed")
    closed = CycleFamily(none, (low, 0.5))._beside(
        equations, np.array([1.0, 0.0, 1.0, 0.0]), np.array([0.5, 0, 0, -1.0])
    )
    assert closed is not None
    assert low <= closed.unknowns[-1] < 0
    # On s = 1 − p, to the 1e-10 by which a cycle closes over the 4π × 2e-3 by which its disturbances grow.
    assert closed.unknowns[:2] @ closed.unknowns[:2] == pytest.approx(1 - closed.unknowns[-1], abs=1e-8)


@pytest.mark.parametrize("event", [Event.TRANSCRITICAL, Event.PITCHFORK])
def test_the_verdict_calls_a_crossing_a_point(event):
    none: Any = None
    closed = Closed(np.array([1.0, 0.0, 1.0, 0.25]), flow=none, residual=0.0, steps=0)
    cycle = bare(shooting(fold, [1.0]), closed).model_copy(update={"amplitude": {"X": 1.0}, "what": event})
    branch = CycleBranch(start=BranchEnd.BOUND, end=BranchEnd.BOUND, cycles=(cycle,))
    found = Diagram(steady_sliding_stable=((0.0, 1.0),), steady_sliding_unstable=(), branches=(branch,))
    name = {Event.TRANSCRITICAL: "transcritical", Event.PITCHFORK: "pitchfork"}[event]
    assert f"({name} point at 0.25 m/s)" in diagram_verdict(found, Variation("belt speed", "m/s", (0.0, 1.0)))


# Whole branches


def follow(model, low, high, *values, start=ROUND):
    return follow_cycles(model, (low, high), seeds=[Seed(value, start) for value in values])


def events(diagram):
    return [{(cycle.what, round(cycle.value, 6)) for cycle in branch.special} for branch in diagram.branches]


@pytest.mark.thorough
@pytest.mark.parametrize("middle", [1.0, 2.0])
def test_cycles_that_exchange_stability_are_stable_up_to_the_crossing_from_both_sides(middle):
    # With 2.0 steady sliding is overdamped: x″ + (4 − p²) x′ + x = 0.
    start = {"displacement": {"X": np.sqrt(middle + 0.25)}}
    found = follow(one(exchange(middle)), -0.5, 0.5, 0.3, start=start)
    assert len(found.branches) == 2
    for branch in found.branches:
        (crossing,) = branch.special
        assert crossing.what is Event.TRANSCRITICAL
        assert abs(crossing.value) < 1e-9  # as folds: by the 1e-10 to which a cycle closes
        for cycle in branch.cycles:
            s = cycle.amplitude["X"] ** 2
            assert abs(s - middle) == pytest.approx(abs(cycle.value), abs=1e-7)  # peaks between samples
            assert cycle.period_s == pytest.approx(PERIOD, rel=1e-9)
            # Multipliers are those of neighbours where tangents differ by 1e-3 from them: where they are thousands.
            assert cycle.multipliers[0] == pytest.approx(np.exp(-4 * np.pi * (s - middle) * s), rel=1e-3, abs=1e-9)
    assert found.stable_cycles == ((-0.5, 0.5),)
    assert found.squeals_only_when_disturbed == ((-0.5, 0.5),)
    assert (found.squeals_unknown, found.not_followed, found.folds) == ((), (), ())
    assert found.verdict is not None
    assert "(transcritical point at " in found.verdict


@pytest.mark.thorough
@pytest.mark.parametrize("gap", [1e-6, -1e-6])
def test_branches_that_only_come_near_each_other_are_not_taken_for_one(gap):
    found = follow(one(exchange(1.0, gap)), -0.5, 0.5, 0.3, start={"displacement": {"X": 1.1}})
    (branch,) = found.branches
    if gap > 0:  # s = 1 + √(p² + gap) is stable all along
        assert branch.special == ()
        assert found.stable_cycles == ((-0.5, 0.5),)
    else:  # it folds where p² = −gap
        assert [cycle.what for cycle in branch.special] == [Event.FOLD]
        assert found.folds == (pytest.approx(1e-3, abs=1e-8),)
        assert found.stable_cycles == (pytest.approx((1e-3, 0.5), abs=1e-8),)
    assert found.squeals_unknown == ()


@pytest.mark.thorough
@pytest.mark.parametrize("at", [0.7, 1.5])
def test_cycles_that_lose_a_symmetry_begin_at_a_pitchfork_from_whichever_side_it_is_found(at):
    found = follow(two(buckles, 1.0), 0.5, 1.6, at, start={"displacement": {"X": 0.9, "Y": 0.4}})
    assert sorted(map(len, events(found))) == [1, 1]
    assert all(each == {(Event.PITCHFORK, 1.0)} for each in events(found))
    for branch in found.branches:
        for cycle in branch.cycles:
            p, s, y = cycle.value, cycle.amplitude["X"] ** 2, cycle.displacement["Y"]
            broken = abs(y) > 1e-6
            assert s == pytest.approx(2 / (p + 1) if broken else 1.0, abs=1e-7)
            assert y**2 == pytest.approx((p - 1) / (p + 1) if broken else 0.0, abs=1e-9)
            if not broken and cycle.what is None:
                own = np.exp(PERIOD * np.roots([1, 0.5, 1 - p]))  # y″ + y′/2 + (1 − p) y = 0
                wanted = np.sort_complex([np.exp(-PERIOD), *own])
                np.testing.assert_allclose(np.sort_complex(cycle.multipliers), wanted, rtol=1e-6, atol=1e-7)
    assert found.stable_cycles == ((0.5, 1.6),)
    assert (found.squeals_unknown, found.not_followed, found.folds) == ((), (), ())


def mathieu(p):
    """The multipliers of Mathieu's equation over a period."""
    how = {"rtol": 1e-11, "atol": 1e-12, "args": (p,)}
    rate = lambda t, y, p: [y[1], -0.1 * y[1] - (0.25 + p * np.cos(t)) * y[0]]  # noqa: E731
    ends = [solve_ivp(rate, (0, PERIOD), unit, "DOP853", **how).y[:, -1] for unit in np.eye(2)]
    return np.linalg.eigvals(np.array(ends).T)


@pytest.mark.thorough
@pytest.mark.parametrize("at", [0.06, 0.4])
def test_a_period_doubling_is_one_from_whichever_side_it_is_found(at):
    exact = brentq(lambda p: mathieu(p).real.min() + 1, 0.05, 0.2, xtol=1e-12)
    found = follow(two(swings, 0.25), 0.05, 0.6, at, start={"displacement": {"X": 1.0, "Y": 0.3}})
    # Ends of branches at a doubling are parabolas over the number, found to a hundredth of a step.
    assert {what for each in events(found) for what, _ in each} == {Event.DOUBLING}
    assert found.doublings == (pytest.approx(exact, abs=1e-6),)
    assert len(found.branches) == 2
    assert found.stable_cycles == ((0.05, 0.6),)
    assert found.not_followed == ()


@pytest.mark.thorough
def test_a_fold_and_a_torus_are_what_they_are():
    folding = follow(one(fold), -0.2, 0.4, 0.2, start={"displacement": {"X": 1.3}})
    assert events(folding) == [{(Event.FOLD, 0.0)}]
    assert folding.stable_cycles == (pytest.approx((0.0, 0.4), abs=1e-9),)
    turning = follow(two(flutters, 2.0), 0.1, 0.5, 0.2)
    assert events(turning) == [{(Event.NEIMARK_SACKER, 0.3)}]
    (lost,) = turning.not_followed
    assert (lost.low, lost.high) == pytest.approx((0.3, 0.5), abs=1e-9)


# A coordinate that is still, or coupled to nothing


@pytest.mark.thorough
@pytest.mark.parametrize("push", [0.0, 1e-17])
@pytest.mark.parametrize("damping", [0.1, 0.0])
def test_a_coordinate_that_moves_by_round_off_makes_no_other_cycle(push, damping):
    law = exchange(1.0)
    model = two(lambda p, q, v: (*law(p, q, v), push * q[0]), 3.0, damping)
    found = follow(model, 0.05, 0.5, 0.1, 0.3, 0.5, start={"displacement": {"X": 1.2}})
    assert len(found.branches) == 1
    assert (found.off_branches, found.notes) == ((), ())


# A body that is overdamped at rest


@pytest.mark.thorough
def test_a_body_that_is_overdamped_at_rest_has_cycles_all_the_same():
    body = one(exchange(2.0))(0.35)
    # From a start beyond the unstable cycle, and from none: then along the shape that it has without damping.
    for start in ({"displacement": {"X": 1.6}}, {}):
        cycle = find_cycle(body, start)
        assert cycle.stable
        assert cycle.amplitude["X"] == pytest.approx(np.sqrt(2.35), rel=1e-8)
        assert cycle.multipliers[0] == pytest.approx(np.exp(-4 * np.pi * 0.35 * 2.35), rel=1e-5)


def beside(p, q, v):
    """X overdamped at rest, with cycles all the same, and Y, which oscillates, on a spring between them."""
    (force,), pull = exchange(2.0)(p, q, v), 0.02 * (q[0] - q[1])
    return (force - pull, pull - 0.5 * v[1])


@pytest.mark.thorough
def test_a_coordinate_that_is_overdamped_beside_one_that_oscillates_has_its_cycle_all_the_same():
    found = find_cycle(two(beside, 5.0)(0.35), {})
    # Two per cent of the spring change the cycle by as much.
    assert found.stable
    assert found.amplitude["X"] == pytest.approx(np.sqrt(2.35), rel=0.02)


def test_what_is_overdamped_beside_what_oscillates_is_disturbed_too():
    model = two(beside, 5.0)(0.35)
    family = Family(lambda value: model, model.names, model.names)
    point = point_at(family.model_at, 0.35)
    assert [mode.name for mode in point.modes] == ["Y"]
    along_y, along_x = directions(point, family, (1,))
    assert [along_y.mode.name, along_x.mode.name] == ["Y", "X"]
    # But for the spring between them X moves at 1 rad/s without damping; 1 J gives 1 kg √2 m/s, one way or the other.
    assert along_x.mode.frequency_Hz == pytest.approx(1 / PERIOD, rel=0.02)
    assert abs(along_x.disturbance(1.0).velocity["X"]) == pytest.approx(np.sqrt(2), rel=0.02)
    # Slip reverses at the 5 m/s of the belt.
    assert (along_x.sizes[0], along_x.sizes[-1]) == pytest.approx((0.1 * 5 / np.sqrt(2), 3 * 5 / np.sqrt(2)), rel=0.02)


@pytest.mark.thorough
def test_a_disturbance_starts_the_cycle_of_what_is_overdamped_beside_what_oscillates():
    def law(p, q, v):
        return (*exchange(2.0)(p, q, v), -0.5 * v[1])

    # Y, which nothing couples to X, comes near no boundary and is not disturbed.
    study = study_onset(two(law, 5.0), Variation("p", "", (0.25, 0.35)), sample_rate=10.0)
    assert len(study.values) == 2
    for row in study.values:
        assert row.kind is RangeKind.BISTABLE
        (motion,) = row.motions
        # As samples show it: one in a sixtieth of a period, and a hundred periods.
        assert motion.amplitude["X"] == pytest.approx(np.sqrt(2 + row.value), rel=2e-3)
        assert motion.frequency_Hz == pytest.approx(1 / PERIOD, rel=1e-3)


def doubling(times, guess):
    """State and force at which x″ + 0.3 x′ − x + x³ = p cos 1.2 t doubles so many periods, by SciPy's Poincaré map."""

    def rate(t, z, p):
        (x, v, a, b), stiffness = (z[0], z[1], z[2:4], z[4:]), 3 * z[0] ** 2 - 1
        return [v, x - x**3 - 0.3 * v + p * np.cos(1.2 * t), *b, *(-stiffness * a - 0.3 * b)]

    def equations(unknowns):
        *start, p = unknowns
        how: Any = {"method": "DOP853", "args": (p,), "rtol": 1e-10, "atol": 1e-11}
        end = solve_ivp(rate, (0, times * PERIOD / 1.2), [*start, 1, 0, 0, 1], **how).y[:, -1]
        state, transition = end[:2], end[2:].reshape(2, 2)
        return [*(state - start), np.linalg.det(transition + np.eye(2))]

    found = scipy.optimize.root(equations, guess)
    assert found.success
    return found.x[-1]


@pytest.mark.thorough
def test_cycles_of_twice_the_period_are_followed_until_their_periods_double_in_turn():
    def law(p, q, v):  # Y turns at 1.2 rad/s and forces X, which without it is a Duffing oscillator with two wells
        x, y = q
        return (2 * x - x**3 - 0.3 * v[0] + p * y, -(y**2 + (v[1] / 1.2) ** 2 - 1) * v[1])

    start = {"displacement": {"X": 1.0, "Y": 1.0}}
    found = follow(two(law, 1.44), 0.2, 0.3, 0.2, start=start)
    periods = [branch.cycles[0].period_s * 1.2 / PERIOD for branch in found.branches]
    # Where sixteen periods begin the first cycle that is tried lies beyond their own doubling, and may be found or not.
    assert periods[:4] == pytest.approx([1, 2, 4, 8], rel=1e-9)
    guesses = [(0.41, 0.32, 0.266), (0.215, 0.22, 0.287), (0.182, 0.189, 0.291)]
    exact = [doubling(2**k, guess) for k, guess in enumerate(guesses)]
    # Found to 1e-5 of a step along the branch, in which the force changes by 1e-3 or so.
    assert found.doublings[:3] == pytest.approx(exact, abs=1e-7)
    ((_, end),) = found.stable_cycles
    assert end == found.doublings[-1]
    # Beyond it there is no more than the rest of a cascade.
    assert found.doublings[3] - exact[2] == pytest.approx((exact[2] - exact[1]) / 4.67, rel=0.02)


@pytest.mark.thorough
def test_a_branch_that_crosses_one_which_crosses_another_is_followed():
    def law(p, q, v):
        s = size(q, v)
        return (-(s - 1) * (s - 1 - p) * (s - 2 + p) * v[0],)

    found = follow(one(law), -0.3, 0.8, 0.2, start={"displacement": {"X": 1.02}})
    assert events(found) == [
        {(Event.TRANSCRITICAL, 0.0)},
        {(Event.TRANSCRITICAL, 0.0), (Event.TRANSCRITICAL, 0.5)},
        {(Event.TRANSCRITICAL, 0.5)},
    ]
    assert not any("begins" in each.reason for each in found.not_followed)


@pytest.mark.thorough
def test_crossings_are_found_where_the_motion_changes_little_with_the_number():
    """Cycles s = 1 ± (p² − 0.04) cross at ±0.2, at slopes of 0.4 in s, beyond which a branch is far off its tangent."""

    def law(p, q, v):
        return (-0.5 * ((size(q, v) - 1) ** 2 - (p**2 - 0.04) ** 2) * v[0],)

    found = follow(one(law), -0.5, 0.6, 0.0, start={"displacement": {"X": 1.05}})
    assert events(found) == [{(Event.TRANSCRITICAL, -0.2), (Event.TRANSCRITICAL, 0.2)}] * 2
    assert (found.stable_cycles, found.squeals_unknown, found.not_followed) == (((-0.5, 0.6),), (), ())


def uneven(p, q, v):
    """Cycles s = 1, stable up to p = 0, and s = 1 ± √p, stable, no mirror images of each other."""
    return (-(size(q, v) - 1) * ((size(q, v) - 1) ** 2 - p) * v[0],)


@pytest.mark.thorough
@pytest.mark.parametrize("seeds", [[], [(-0.2, 1.1)], [(0.25, 1.3)]], ids=["unseeded", "trunk", "arm"])
def test_both_arms_of_a_pitchfork_are_followed_where_they_are_no_mirror_images(seeds):
    """Steady sliding is unstable throughout, x″ − (1 − p) x′ + x = 0: what leaves it ends in one of the cycles."""
    found = follow_cycles(one(uneven), (-0.4, 0.5), seeds=[Seed(p, {"displacement": {"X": x}}) for p, x in seeds])
    assert events(found) == [{(Event.PITCHFORK, 0.0)}] * 2
    arms, trunk = sorted(found.branches, key=lambda branch: branch.cycles[0].value < 0)
    values = np.array([cycle.value for cycle in arms.cycles])
    s = np.array([cycle.amplitude["X"] ** 2 for cycle in arms.cycles])
    np.testing.assert_allclose((s - 1) ** 2, values, rtol=0, atol=1e-7)  # peaks between samples
    assert sorted([s[0], s[-1]]) == pytest.approx([1 - np.sqrt(0.5), 1 + np.sqrt(0.5)], abs=1e-7)
    assert [cycle.amplitude["X"] for cycle in trunk.cycles] == pytest.approx([1.0] * len(trunk.cycles), abs=1e-7)
    assert (found.stable_cycles, found.squeals_unknown, found.not_followed) == (((-0.4, 0.5),), (), ())


@pytest.mark.thorough
@pytest.mark.parametrize(("start", "kind"), [(1.6, "periodic"), (0.5, "steady")])
def test_what_an_overdamped_body_does_is_known_from_its_motion(start, kind):
    # 100 periods of 2π s without damping, for which it takes no longer than an oscillating body.
    motion = study_motion(one(exchange(2.0))(0.35), {"displacement": {"X": start}}, 100 * PERIOD, sample_rate=2.0)
    assert motion.regime.kind == kind
    if kind == "periodic":
        assert motion.base_frequencies_Hz == (pytest.approx(1 / PERIOD, rel=1e-5),)
