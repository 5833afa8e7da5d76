"""The parts of following a branch of cycles, on equations that are straight lines and planes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import CycleError
from drumsqueal.questions.cycle import continuation
from drumsqueal.questions.cycle.continuation import Ended, Track, _kind, _may_cross_twice, _Place, is_between
from drumsqueal.questions.cycle.diagram import End
from drumsqueal.questions.cycle.orbit import Cycle, Event
from drumsqueal.solve.shooting import Closed

RNG = np.random.default_rng(21)
SCALE = np.array([2.0, 0.5, 0.25, 4.0])
JACOBIAN = RNG.normal(size=(2, 4))
RATE = np.array([3.0, -4.0])


def cycle(value: float = 1.0, period: float = 0.5, x: float = 2.0, multipliers=(0.5,), **more: Any) -> Cycle:
    known: dict[str, Any] = {
        "period_s": period, "amplitude": {"X": x}, "main_coordinate": "X", "unit_multiplier_error": 0.0,
        "multipliers": np.array(multipliers, dtype=complex), "tangent_error": 0.0, "residual": 0.0,
        "contact_fraction": 1.0, "slip_reversed_fraction": 0.0, "displacement": {"X": x}, "velocity": {"X": 0.0},
        "value": value, "model": SimpleNamespace(mass=np.array([1.0])),
    }  # fmt: skip
    return Cycle(**(known | more))


class Plane:
    """Equations whose flow turns the state with the period, and whose derivative is the same everywhere."""

    def __init__(self, scale=SCALE, jacobian=JACOBIAN, fails: int = 0) -> None:
        self.scale, self._jacobian, self.fails, self.guesses = scale, jacobian, fails, []

    def flow(self, unknowns):
        return SimpleNamespace(end=10 * unknowns[:2] * unknowns[2], rate=RATE, pattern="slides")

    def jacobian(self, found):
        return self._jacobian

    def unscaled(self, unknowns):
        values = unknowns * self.scale
        return values[:-2], float(values[-2]), float(values[-1])

    def in_units(self, units):
        return Plane(self.scale * units, self._jacobian)

    def vibration(self, closed, steady):
        return closed.unknowns[:2] - np.append(steady, 0.0) / self.scale[:2]

    def close(self, guess, condition=None, phase=None):
        self.guesses.append((guess, condition, phase))
        return None if len(self.guesses) <= self.fails else closed_at(guess)

    def moved(self, closed, direction, time):
        return closed_at(closed.unknowns + time), direction + np.array([time, 0, 0, 0])


def closed_at(unknowns, steps: int = 3) -> Any:
    flow = SimpleNamespace(end=np.zeros(2), rate=RATE, pattern="slides")
    return Closed(np.asarray(unknowns, dtype=float), flow, 0.0, steps)  # pyright: ignore[reportArgumentType]


def place(unknowns=(1.0, 2.0, 2.0, 0.25), tangent=(0.0, 0.0, 0.0, 1.0), crossing: Any = None, **more: Any) -> Any:
    closed = closed_at(unknowns)
    return _Place(closed, np.asarray(tangent), cycle(closed.unknowns[3] * SCALE[3], **more), crossing)


def track(shooting: Any = None, steady=lambda value: None, bounds=(0.0, 2.0)) -> Any:
    return Track(shooting or Plane(), bounds, steady, End.HOPF, lambda branch: None)  # pyright: ignore[reportArgumentType]


def test_a_tangent_keeps_the_equations_and_the_phase_and_leads_ahead():
    ahead = RNG.normal(size=4)
    found = track()._tangent(closed_at(np.ones(4)), ahead)
    np.testing.assert_allclose(JACOBIAN @ found, 0, atol=1e-12)
    assert found[:2] @ RATE == pytest.approx(0, abs=1e-12)
    assert np.linalg.norm(found) == pytest.approx(1)
    assert found @ ahead > 0
    np.testing.assert_allclose(track()._tangent(closed_at(np.ones(4)), -ahead), -found)


def test_a_way_is_kept_where_the_determinant_keeps_its_sign():
    follow, ahead = track(), RNG.normal(size=4)
    here = place(tangent=follow._tangent(closed_at(np.ones(4)), ahead))
    assert follow._same_way(here, here.closed, here.tangent)
    assert not follow._same_way(here, here.closed, -here.tangent)
    assert follow._same_way(here, here.closed, here.tangent + 0.1 * ahead)


def test_halves_are_the_state_after_half_of_the_period_and_that_of_the_start():
    # The flow multiplies the state by ten times the period: 2 → 1, so by 10.
    np.testing.assert_allclose(track()._halves(closed_at([1.0, 2.0, 2.0, 0.25])), [9.0, 18.0])


def test_a_cycle_is_on_the_way_between_two_if_it_is_as_they_are_there():
    a, b = cycle(1.0, 0.5, 2.0), cycle(3.0, 0.7, 4.0)
    assert is_between(a, b, cycle(2.0, 0.6, 3.0))
    assert is_between(b, a, cycle(2.0, 0.6, 3.05))
    assert not is_between(a, b, cycle(2.0, 0.6, 3.1))
    assert not is_between(a, b, cycle(2.0, 0.62, 3.0))
    assert not is_between(a, b, cycle(3.5, 0.75, 4.5))
    assert not is_between(a, cycle(1.0), cycle(1.0))


@pytest.mark.parametrize(
    ("one", "other", "wanted"),
    [
        ((0.5,), (0.7,), False),  # 0.2 of 0.3 to the circle
        ((0.5,), (0.76,), True),
        ((1.3,), (1.1,), True),
        ((0.8,), (1.2,), False),  # it crosses, which is found
        ((0.999,), (0.99,), False),  # it may move by so much in any case
        ((0.999,), (0.98,), True),
        ((0.5, 0.2), (0.5, -0.2), False),
    ],
)
def test_a_multiplier_may_cross_twice_where_it_moves_farther_than_to_the_circle(one, other, wanted):
    assert _may_cross_twice(cycle(multipliers=one), cycle(multipliers=other)) is wanted


def test_what_happens_is_said_by_the_multiplier_nearest_to_the_circle():
    assert _kind(cycle(multipliers=(1.5, -1.0001, 0.2))) is Event.DOUBLING
    assert _kind(cycle(multipliers=(1.5, 0.9999, 0.2))) is Event.BRANCHING
    pair = np.exp(2j)
    assert _kind(cycle(multipliers=(1.5, pair, pair.conj()))) is Event.NEIMARK_SACKER
    assert _kind(cycle(multipliers=(-1.0 + 5e-4j,))) is Event.DOUBLING


def test_a_branch_is_at_rest_where_it_goes_through_steady_sliding_or_is_as_small():
    steady = {1.0: np.array([2.0]), 1.2: np.array([2.4])}
    follow = track(steady=lambda value: steady.get(round(value, 6)))
    a = place((1.5, 0.2, 2.0, 0.25))  # vibration (0.5, 0.2), from 2.0/2.0
    assert not follow._at_rest(a, place((1.8, 0.1, 2.0, 0.3)))
    assert follow._at_rest(a, place((0.7, -0.1, 2.0, 0.3)))  # the mirror image of one (1.7, 0.1)
    assert follow._at_rest(a, place((1.2 + 1.9e-3, 1e-3, 2.0, 0.3)))
    assert not follow._at_rest(a, place((1.2 + 2.1e-3, 1e-3, 2.0, 0.3)))
    assert not follow._at_rest(a, place((0.7, -0.1, 2.0, 0.4)))  # without steady sliding


def test_a_loop_is_closed_where_its_start_lies_on_a_step_the_same_way():
    follow = track()
    start, a, b = place(tangent=(0, 0, 0, 0.5)), place((1, 2, 2, 0.2)), place((1, 2, 2, 0.3), (0, 0, 0, 0.7))
    follow.cycles = [cycle()] * 5
    assert follow._is_back(start, a, b)
    assert not follow._is_back(start, a, b._replace(tangent=-b.tangent))
    assert not follow._is_back(start, b, place((1, 2, 2, 0.4), (0, 0, 0, 0.7)))
    follow.cycles = [cycle()] * 4
    assert not follow._is_back(start, a, b)


def test_a_cycle_is_cut_where_it_slips_fastest_if_it_slips_slowly_where_it_is_cut(monkeypatch):
    samples = SimpleNamespace(time=np.array([3.0, 3.5, 4.25]), velocity=None)
    here = place(tangent=(0, 0, 0, 1.0), samples=samples)
    for speeds, moved in (([0.31, 0.5, 1.0], 0.0), ([0.29, 0.5, 1.0], 1.25), ([0.1, 1.0, 0.5], 0.5)):
        monkeypatch.setattr(continuation, "slip_speeds", lambda model, velocity, speeds=speeds: speeds)
        found = track()._cut_anew(here)
        np.testing.assert_allclose(found.closed.unknowns, here.closed.unknowns + moved)
        if moved:
            turned = track()._tangent(found.closed, here.tangent + np.array([moved, 0, 0, 0]))
            np.testing.assert_allclose(found.tangent, turned)


def test_a_place_is_scaled_anew_where_its_period_has_grown_or_its_motion_outgrown_it(monkeypatch):
    same = place((1.0, 2.0, 1.4, 0.25), (0.6, 0, 0, 0.8))
    assert track()._rescaled(same) is same
    longer = place((1.0, 2.0, 1.6, 0.25), (0.6, 0.0, 0.48, 0.64))
    follow = track()
    found = follow._rescaled(longer)
    np.testing.assert_allclose(follow._shooting.scale, SCALE * [1, 1, 1.6, 1])
    np.testing.assert_allclose(found.closed.unknowns, [1.0, 2.0, 1.0, 0.25])
    wanted = np.array([0.6, 0.0, 0.3, 0.64])
    np.testing.assert_allclose(found.tangent, wanted / np.linalg.norm(wanted))
    monkeypatch.setattr(
        continuation, "scale_near", lambda model, start, steady: np.append(start.state * [4, 0.5], [0, 0])
    )
    # The state 2, 1 gives scales of 8, 0.5: 4 and 1 times the present ones.
    follow = track(steady=lambda value: np.array([value]))
    found = follow._rescaled(same)
    np.testing.assert_allclose(follow._shooting.scale, SCALE * [4, 1, 1.4, 1])
    np.testing.assert_allclose(found.closed.unknowns, [0.25, 2.0, 1.0, 0.25])
    monkeypatch.setattr(continuation, "scale_near", lambda model, start, steady: np.append(SCALE[:2] * 2.9, [0, 0]))
    assert track(steady=lambda value: np.array([value]))._rescaled(same) is same


@pytest.mark.parametrize("fails", [0, 1, 2, 3])
def test_at_the_end_of_the_range_the_cycle_has_its_very_value(monkeypatch, fails):
    shooting = Plane(fails=fails)
    follow, kept = track(shooting, bounds=(0.0, 1.3)), []
    a, b = place((1.0, 2.0, 2.0, 0.25)), place((3.0, 2.0, 2.0, 0.35))  # 1.0 and 1.4
    looked = []
    follow._place = lambda closed, ahead: _Place(closed, ahead, cycle(7.0))
    follow._look_between = lambda one, other, step: looked.append((one, other, step))
    follow._keep = kept.append
    if fails == 3:
        with pytest.raises(CycleError, match=r"between 1 and the end"):
            follow._to_bound(a, b, 1.3)
        return
    assert follow._to_bound(a, b, 1.3) == Ended(End.BOUND)
    first = (2.5, 1.0, 3.0)[fails]  # three quarters of the way, and then from either side
    np.testing.assert_allclose(shooting.guesses[-1][0], [first, 2.0, 2.0, 1.3 / 4.0])
    assert kept[0].value == 1.3
    assert looked[0][0] is a
    assert looked[0][2] == pytest.approx(np.hypot(first - 1.0, 0.075))


def test_a_cycle_at_the_end_of_the_range_is_kept_once():
    follow = track(bounds=(0.0, 1.0))
    follow.cycles = [cycle(0.5), cycle(1.0 - 1e-10)]
    assert follow._to_bound(place((1, 2, 2, 0.25 - 2e-11)), place((1, 2, 2, 0.3)), 1.0) == Ended(End.BOUND)
    assert [each.value for each in follow.cycles] == [0.5, 1.0]


def test_a_step_is_predicted_along_the_tangent_and_corrected_across_it():
    shooting = Plane()
    here = place(tangent=(0.6, 0, 0, 0.8))
    track(shooting)._corrected(here, 0.5)
    guess, condition, phase = shooting.guesses[0]
    np.testing.assert_allclose(guess, here.closed.unknowns + np.array([0.3, 0, 0, 0.4]))
    np.testing.assert_allclose(condition, here.tangent)
    assert phase is RATE


def test_a_step_that_fails_is_halved_until_it_is_made(monkeypatch):
    follow, tried = track(), []

    def advance(place, step):
        tried.append(step)
        return place if step < 0.03 else None

    monkeypatch.setattr(follow, "_advance", advance)
    here = place()
    assert follow._next(here, 0.1) == (here, 0.025, False)
    assert tried == [0.1, 0.05, 0.025]
    monkeypatch.setattr(follow, "_advance", lambda place, step: None)
    monkeypatch.setattr(follow, "_around", lambda place: None)
    monkeypatch.setattr(follow, "_jumps_ahead", lambda place: False)
    with pytest.raises(CycleError, match=r"smallest step at 1"):
        follow._next(here, 0.1)


def test_a_corner_is_named_by_what_changes_there(monkeypatch):
    here = place(tangent=(0, 0, 0, 1.0))
    for beyond, what in (
        (place(tangent=(0.6, 0, 0, 0.8)), Event.CORNER),
        (place(tangent=(0.6, 0, 0, -0.8)), Event.FOLD),
    ):
        follow = track()
        follow.cycles = [cycle(0.5), cycle(1.0)]
        monkeypatch.setattr(follow, "_advance", lambda place, step: None)
        monkeypatch.setattr(follow, "_around", lambda place, beyond=beyond: beyond)
        assert follow._next(here, 0.1) == (beyond, 1e-3, True)
        assert [each.what for each in follow.cycles] == [None, what]


def test_a_fold_is_where_the_tangent_has_no_part_along_the_parameter(monkeypatch):
    follow, kept = track(), []
    monkeypatch.setattr(follow, "_corrected", lambda place, length: closed_at([length, 0, 1, 1]))
    monkeypatch.setattr(continuation, "describe", lambda shooting, closed: cycle(closed.unknowns[0]))
    follow._keep = kept.append
    follow._locate(place((0.0, 2.0, 2.0, 0.25)), 0.1, Event.FOLD, lambda closed: 0.03 - closed.unknowns[0])
    assert kept[0].value == pytest.approx(0.03, abs=1e-6)
    assert kept[0].what is Event.FOLD
    follow._locate(place((0.0, 2.0, 2.0, 0.25)), 0.02, Event.FOLD, lambda closed: 0.03 - closed.unknowns[0])
    assert len(kept) == 1  # nothing changes its sign


def test_a_doubling_is_where_both_halves_are_nearest_to_alike(monkeypatch):
    follow, kept, lengths = track(), [], []
    sizes = {1.0: np.array([3.0, 4.0]), 3.0: np.array([0.0, -15.0])}
    monkeypatch.setattr(follow, "_halves", lambda closed: sizes[float(closed.unknowns[0])])
    monkeypatch.setattr(continuation, "describe", lambda shooting, closed: cycle(9.0))
    follow._keep = kept.append
    a, b = place((1.0, 2.0, 2.0, 0.25)), place((3.0, 2.0, 2.0, 0.35))
    for found, value in ((closed_at(np.ones(4)), 9.0), (None, 1.0)):
        monkeypatch.setattr(follow, "_corrected", lambda place, length, found=found: lengths.append(length) or found)
        follow._keep_doubling(a, b, 0.4)
        assert kept[-1].value == value
        assert kept[-1].what is Event.DOUBLING
    assert lengths == pytest.approx([0.1, 0.1])


@pytest.mark.parametrize(
    ("one", "other", "asked"),
    [((0.9,), (1.1,), True), ((1.1, 0.5), (1.2, 0.6), False), ((1.2, 1.1), (1.3, 0.8), True)],
)
def test_an_instability_is_looked_for_where_its_multiplier_has_crossed(monkeypatch, one, other, asked):
    follow, seen = track(), []
    monkeypatch.setattr(continuation, "floquet_of", lambda shooting, closed: (np.array([1.5, -1.25]), 0.0))
    follow._locate = lambda a, step, kind, measure: seen.append((step, kind, measure(None)))
    a, b = place(multipliers=one), place((1, 2, 2, 0.3), multipliers=other)
    assert follow._look_between(a, b, 0.2) is None
    rank = min(np.count_nonzero(np.abs(each) > 1) for each in (one, other))
    assert seen == ([(0.2, None, [0.5, 0.25][rank])] if asked else [])
