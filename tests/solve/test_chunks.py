"""How a transient is taken through time: chunks, jumps of the drum, methods, and what is asked of a start."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import Ending, IntegrationError
from drumsqueal.physics.effects.damping import Damping
from drumsqueal.physics.effects.friction import Friction, Tangential, Temperature
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from drumsqueal.physics.effects.pressure import Bonded, Unilateral
from drumsqueal.physics.effects.springs import Springs
from drumsqueal.physics.friction_law import ConstantLaw
from drumsqueal.physics.model import Model
from drumsqueal.physics.small_bodies import Block, PointContact
from drumsqueal.solve.motion import (
    collect,
    constant_transient,
    follow,
    pulling,
    pulling_sentence,
    smallest_force,
    smallest_recorded,
    start_of,
    turning_points,
)
from drumsqueal.solve.transient import sticking as module
from drumsqueal.solve.transient.integrate import _Transient, _why, count_evaluations
from drumsqueal.solve.transient.segment import CORNER_BUDGET, STEP_BUDGET, first_step
from drumsqueal.solve.transient.state import Span
from drumsqueal.solve.transient.stick_slip import EXPLICIT_BUDGET, MARGIN, Choice, Method, StickSlip, _jumps
from drumsqueal.solve.transient.sticking import accelerations

MASS, STIFFNESS = np.array([0.7, 1.9]), 50.0
SPRINGS = np.array([[11.0, -4.0], [-4.0, 23.0]])


def block(
    speed: Any = -0.3, load: Any = 3.0, *, separation=True, stiffness=STIFFNESS, friction: Any = 0.4, remembering=()
):
    law = (Unilateral if separation else Bonded)(stiffness)
    contact = PointContact(Block(MASS), law, friction and Friction(ConstantLaw(friction), Tangential()))
    speed, load = (each if isinstance(each, PiecewiseLinear) else Constant(each) for each in (speed, load))
    others = Springs(SPRINGS), Damping(0.01 * SPRINGS)
    return Model(Operation(speed, load), contact, others, MASS, SPRINGS + np.diag([0, stiffness]), remembering)


# --- a chunk through its changes -------------------------------------------------------------------------------------

STOPS = PiecewiseLinear([0.0, 1.0, 2.0, 3.0, 4.0], [4.0, -12.0, -12.0, 0.0, 0.0])  # turns at 0.25 s, rests from 3 s on


def stick_slip(model, **how):
    return StickSlip(model, np.zeros(2), np.float64(1e-8), "auto", **how)


def ended(**what) -> Any:
    """A segment, as far as it is looked at."""
    return SimpleNamespace(**{"halted": False, "steps": 7, "changes": np.zeros(0)} | what)


def test_a_chunk_is_cut_at_the_next_jump_of_friction():
    times, margin = _jumps(block(STOPS))
    np.testing.assert_allclose(times, [0.0, 0.25, 3.0], rtol=1e-14)
    assert margin == MARGIN * 4
    run = stick_slip(block(STOPS))
    span = Span(np.float64(0.2), np.float64(0.1), np.int64(10))
    inside, fresh = run._between_jumps(span)
    assert not fresh
    assert float(inside.until) == pytest.approx(0.05)
    assert (float(inside.after), float(inside.before)) == (pytest.approx(0.0, abs=1e-11), pytest.approx(0.25))
    assert float(inside.after) > 0.0
    assert float(inside.before) < 0.25
    beyond, fresh = run._between_jumps(span._replace(offset=np.float64(0.05)))
    assert fresh
    assert beyond.until == np.inf  # the next jump is after its end, at 1.2 s
    assert (float(beyond.after), float(beyond.before)) == (pytest.approx(0.25), pytest.approx(3.0))
    last, _ = run._between_jumps(span._replace(start=np.float64(3.5)))
    assert (float(last.after), float(last.before)) == (pytest.approx(3.0), np.inf)
    # Of its corners those count that are within; and the explicit method has fewer steps where another may take over.
    more = CORNER_BUDGET * 1
    np.testing.assert_allclose(run._budget(span), EXPLICIT_BUDGET * 100 ** (1 / 8) + [more, 0.0])
    fixed = StickSlip(block(STOPS), np.zeros(2), np.float64(1e-8), "tsit5")
    later = span._replace(start=np.float64(0.5), samples=np.int64(30))
    np.testing.assert_allclose(fixed._budget(later), [STEP_BUDGET + 3 * CORNER_BUDGET, STEP_BUDGET])
    # At rest a block may stick, whatever follows it; it is asked once for each jump.
    assert run._may_stick(last)
    assert run._may == {float(last.after): True}
    assert not stick_slip(block(STOPS, friction=None))._may_stick(last)


def test_changes_are_kept_with_their_times_and_the_method_that_slipped():
    run = stick_slip(block())
    run.solvers, run.changes = set(), []
    span = Span(np.float64(2.0), np.float64(0.1), np.int64(10), offset=np.float64(0.2))
    run._note(ended(changes=np.array([0.3, 0.5]), time=0.8), span, sticks=False)
    assert run.changes == [(2.3, True), (2.5, False)]
    assert (run.sticks, run.solvers) == (False, {"dopri8"})
    # It sticks up to an end at which nothing more happens, in no time.
    run.changes, run.solvers = [], set()
    run._note(ended(changes=np.array([0.2]), time=1.0), span, sticks=False)
    assert run.changes == [(2.2, True)]
    assert (run.sticks, run.solvers) == (True, set())


def test_chatter_within_a_hundredth_of_a_radian_does_not_go_on():
    run, step = stick_slip(block()), float(first_step(block()))
    span = Span(np.float64(0), np.float64(0.1), np.int64(10), offset=np.float64(0.2))
    for way, goes in ((0.5, False), (1.5, True)):
        assert run._goes_on(ended(time=0.2 + way * step, halted=True), span) == goes
    assert not run._goes_on(ended(time=0.3, steps=0), span)
    assert run._goes_on(ended(time=0.3), span)
    assert run.choice.method == Method("sdirk4", 1, 1)
    omega = np.sqrt(np.linalg.eigvalsh((SPRINGS + np.diag([0, STIFFNESS])) / np.sqrt(np.outer(MASS, MASS))))
    assert step == pytest.approx(0.01 / omega[-1], rel=1e-12)


def test_a_method_of_ones_own_stays():
    choice = Choice("tsit5", 1e-6)
    choice.begin()
    assert not choice.switch()
    assert (choice.solver, choice.budget.tolist()) == ("tsit5", [STEP_BUDGET] * 2)
    taken = Choice("auto", 1e-6, Method("sdirk4", 4, 2))
    assert taken.budget.tolist() == [STEP_BUDGET] * 2
    taken.begin()
    assert taken.method == Method("sdirk4", 4, 3)


def test_evaluations_are_counted_of_one_explicit_method():
    segment: Any = SimpleNamespace(steps=10)
    assert count_evaluations(segment, {"dopri8"}) == 131
    assert count_evaluations(segment, {"tsit5"}) == 61
    assert np.isnan(count_evaluations(segment, {"sdirk4"}))
    assert np.isnan(count_evaluations(segment, {"sdirk4", "dopri8"}))
    assert np.isnan(count_evaluations(segment, set()))


def test_samples_of_one_among_many_are_told_to_stick_from_a_change_on():
    one: Any = _Transient.__new__(_Transient)
    time = np.array([0.0, 0.5, 1.0, 1.5, 2.0])
    one._run = SimpleNamespace(changes=[(0.5, True), (1.2, False), (1.9, True)], sticks=True)
    assert one.sticks_at(time).tolist() == [False, True, True, False, True]
    one._run = SimpleNamespace(changes=[], sticks=True)
    assert one.sticks_at(time).all()


def test_why_an_integration_stopped_is_said_with_its_time_and_steps():
    record: Any = SimpleNamespace(friction_power=np.array([5.0, 1.0, 5.0]), normal_force=np.array([2e3, 2e3, 2e3]))
    chunk: Any = SimpleNamespace(time=np.array([2.0, 2.25, 2.5]), observation=record)
    final = (np.zeros(2),)

    def why(last, **what):
        return _why(ended(**{"time": 0.125, "final": final, "reached": False, "steps": 4321} | what), chunk, last)

    assert "infinite or undefined after t = 2.5 s" in _why(ended(time=0.125, final=final, reached=True), chunk, 2)
    assert "undefined after t = 2.25 s" in why(1, final=(np.array([np.inf]),))
    assert "1,000 times just after t = 2.125 s" in why(0, halted=True)
    # Friction of 1 W under 2 kN is that of half a millimetre a second, and 5 W of more than one.
    assert "4,321 steps were not enough to get past t = 2.25 s, where the lining all but sticks" in why(1)
    assert "past t = 2.5 s; a larger simulate.tolerance may help" in why(2)


# --- accelerations of a record ---------------------------------------------------------------------------------------


def test_accelerations_of_a_long_record_are_those_of_each_state(monkeypatch):
    # More than two blocks, of 512 each, some of them stuck to the belt.
    model = block(PiecewiseLinear([0.0, 9.0], [-0.2, -4.7]), remembering=(Temperature(200.0, 3.0, 0.011),))
    random = np.random.default_rng(4)
    count = 1300
    times, memory = random.uniform(0, 9, count), random.uniform(0, 40, (count, 1))
    q, v = random.uniform(-0.05, 0.05, (count, 2)), random.uniform(-6, 6, (count, 2))
    sticks = random.uniform(size=count) < 0.3
    found = accelerations(model, times, q, v, sticks, memory)
    belt = -0.2 - 0.5 * times
    pressed = np.maximum(0.0, 3.0 + STIFFNESS * q[:, 1])
    drag = -0.4 * (1 - 0.011 * memory[:, 0]) * pressed * np.sign(v[:, 0] - belt)
    force = np.stack([drag, 3.0 - pressed], axis=1) - q @ SPRINGS - 0.01 * v @ SPRINGS
    wanted = force / MASS
    wanted[sticks, 0] = -0.5
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)
    calls = []
    monkeypatch.setattr(module, "stop_if_interrupted", lambda: calls.append(1))
    accelerations(model, times, q, v, sticks, memory)
    assert len(calls) == -(-(~sticks).sum() // 512) + -(-sticks.sum() // 512)


# --- a motion --------------------------------------------------------------------------------------------------------


def test_a_transient_lasts_and_is_sampled_by_its_slowest_and_fastest_oscillation():
    model = block(separation=False)
    start, unknown = {"displacement": {"Y": 2e-3}, "velocity": [0.1, -0.2]}, {"duration": None, "sample_rate": None}
    found = constant_transient(model, start, **unknown, tolerance=1e-7)
    hertz = [mode.frequency_Hz for mode in found.stability.modes]
    assert len(hertz) == 2
    assert found.how["duration"] == pytest.approx(200 / min(hertz))
    assert found.how["sample_rate"] == pytest.approx(20 * max(hertz))
    assert found.how["tolerance"] == 1e-7
    assert found.lowest_frequency_Hz == pytest.approx(min(hertz) / 2)
    np.testing.assert_array_equal(found.displacement, [0.0, 2e-3])
    np.testing.assert_array_equal(found.velocity, [0.1, -0.2])
    given = constant_transient(model, {}, duration=3.0, sample_rate=2.001 * max(hertz))
    assert given.how == {"duration": 3.0, "sample_rate": 2.001 * max(hertz)}
    folds, lasts = {"duration": 3.0, "sample_rate": 1.999 * max(hertz)}, {"duration": 0.0, "sample_rate": None}
    for wrong, words in ((folds, "at least"), (lasts, "positive")):
        with pytest.raises(ValueError, match=words):
            constant_transient(model, {}, **wrong)
    with pytest.raises(ValueError, match="changes with time"):
        constant_transient(block(load=PiecewiseLinear([0.0, 1.0], [1.0, 2.0])), {}, duration=None, sample_rate=None)


def test_a_start_is_by_names_or_in_their_order():
    displacement, velocity = start_of(("X", "Y"), {"displacement": {"Y": 3.0}, "velocity": [1.0, 2.0]})
    assert (displacement.tolist(), velocity.tolist()) == ([0.0, 3.0], [1.0, 2.0])
    wrongs = {"neither": {"speed": {}}, "no coordinate": {"velocity": {"Z": 1.0}}, "for each": {"velocity": [1.0]}}
    for words, wrong in wrongs.items():
        with pytest.raises(ValueError, match=words):
            start_of(("X", "Y"), wrong)


def test_a_cubic_turns_round_where_its_derivative_vanishes():
    time = np.array([0.0, 0.7, 1.1, 2.0, 2.5, 3.0])
    place = np.poly1d([1.0, -4.5, 6.0, 2.0])  # its derivative 3 (t − 1)(t − 2)
    times, places = turning_points(time, place(time), place.deriv()(time))
    np.testing.assert_allclose(times, [1.0, 2.0][: len(times)], atol=1e-12)
    np.testing.assert_allclose(places, place(times), rtol=1e-12)
    assert len(times) >= 1
    resting = turning_points(time, np.ones(6), np.zeros(6))
    assert resting[0].size == 0


def chunks(ends, error=None) -> Any:
    for end in ends:
        yield SimpleNamespace(time=np.array([end - 0.5, end]))
    if error is not None:
        raise error


def test_chunks_are_taken_until_enough_or_the_end_and_what_stops_them_is_said():
    taken, said = [], []

    def take(chunk):
        taken.append(chunk.time[-1])
        return len(taken) == 2

    follow(chunks([1.0, 2.0, 3.0]), 9.0, take, lambda *words: said.append(words), what="going")
    assert taken == [1.0, 2.0]
    first = ("going, first samples", 0.0, None)
    assert said == [first, ("going, 1.0000 s", 1.0, 9.0), ("going, 2.0000 s", 2.0, 9.0)]
    kept: list[Any] = []
    assert collect(chunks([1.0, 2.0]), 2.0, kept.append).ending is Ending.COMPLETE
    assert len(kept) == 2
    failed = collect(chunks([1.0], IntegrationError("lost")), 2.0, kept.append)
    assert (failed.ending, str(failed)) == (Ending.FAILED, "failed: lost")
    stopped = collect(chunks([1.25], KeyboardInterrupt()), 2.0, kept.append)
    assert (stopped.ending, "after t = 1.25 s" in stopped) == (Ending.INTERRUPTED, True)
    early = collect(chunks([], KeyboardInterrupt()), 2.0, kept.append)
    assert "before the first" in early
    assert "after t = 0.75 s" in collect(chunks([], KeyboardInterrupt()), 2.0, kept.append, reached=0.75)


def test_a_bonded_contact_pulls_where_its_least_force_is_negative():
    place = np.array([[0.3, -0.02], [9.0, -0.07], [0.0, 0.01]])
    assert smallest_force(block(separation=False), place) == pytest.approx(3.0 - 50 * 0.07, rel=1e-12)
    assert smallest_recorded(block(separation=False), np.array([3.0, -2.0, 5.0])) == -2.0
    for other in (block(), block(separation=False, stiffness=0.0)):
        assert smallest_force(other, place) == np.inf
        assert smallest_recorded(other, np.array([-1.0])) == np.inf
    assert pulling(0.0) == ""
    assert "−1.5 N" in pulling(-1.5)
    assert "without bound" in pulling(-2e30)
    assert pulling_sentence(-1.5).startswith(" The contact pulls")
    assert pulling_sentence(2.0) == ""
