"""The parts of following a branch of cycles, on equations that are lines, planes and curves."""

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.dynamics.cycles import continuation
from drumsqueal.dynamics.cycles.branches import _with_doubling
from drumsqueal.dynamics.cycles.continuation import Ended, Track, _kind, _may_cross_twice, _Place
from drumsqueal.dynamics.cycles.cycle import SAME, BranchEnd, Cycle, CycleBranch, Event, off_between
from drumsqueal.errors import CycleError
from drumsqueal.solve.shooting import Closed, Crossing

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
    return Track(shooting or Plane(), bounds, steady, BranchEnd.HOPF, lambda branch: None)  # pyright: ignore[reportArgumentType]


def test_a_tangent_keeps_the_equations_and_the_phase_and_leads_ahead():
    ahead = RNG.normal(size=4)
    found = track()._tangent(closed_at(np.ones(4)), ahead)
    np.testing.assert_allclose(JACOBIAN @ found, 0, atol=1e-12)
    assert found[:2] @ RATE == pytest.approx(0, abs=1e-12)
    assert np.linalg.norm(found) == pytest.approx(1)
    assert found @ ahead > 0
    np.testing.assert_allclose(track()._tangent(closed_at(np.ones(4)), -ahead), -found)


@pytest.mark.parametrize(("multiplier", "what"), [(-1 - 1e-12, Event.DOUBLING), (-1 + 1e-9, None), (1.0, None)])
def test_the_branch_that_another_one_doubles_has_the_doubling_where_its_multiplier_is_exact(multiplier, what):
    """It was left without a name, and how its stability changes unexplained."""
    cycles = (cycle(0.9, multipliers=(-0.9,)), cycle(1.0, multipliers=(multiplier,)), cycle(1.1, multipliers=(-1.1,)))
    branch = CycleBranch(start=BranchEnd.CUT_OFF, end=BranchEnd.CUT_OFF, cycles=cycles)
    found = _with_doubling(branch, 1.0 + 1e-9)
    assert [each.what for each in found.cycles] == [None, what, None]
    located = branch.model_copy(update={"cycles": (cycles[0], cycles[1].model_copy(update={"what": Event.FOLD}))})
    assert _with_doubling(located, 1.0) == located


def test_a_way_is_kept_where_the_determinant_keeps_its_sign():
    follow, ahead = track(), RNG.normal(size=4)
    here = place(tangent=follow._tangent(closed_at(np.ones(4)), ahead))
    assert follow._same_way(here, here.closed, here.tangent)
    assert not follow._same_way(here, here.closed, -here.tangent)
    assert follow._same_way(here, here.closed, here.tangent + 0.1 * ahead)


def test_halves_are_the_state_after_half_of_the_period_and_that_of_the_start():
    # The flow multiplies the state by ten times the period: 2 → 1, so by 10.
    np.testing.assert_allclose(continuation.halves(track()._shooting, closed_at([1.0, 2.0, 2.0, 0.25])), [9.0, 18.0])


def is_between(a: Cycle, b: Cycle, one: Cycle) -> bool:
    return off_between(a, b, one.value, one.period_s, one.amplitude) < SAME


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
    assert follow._to_bound(a, b, 1.3) == Ended(BranchEnd.BOUND)
    first = (2.5, 1.0, 3.0)[fails]  # three quarters of the way, and then from either side
    np.testing.assert_allclose(shooting.guesses[-1][0], [first, 2.0, 2.0, 1.3 / 4.0])
    assert kept[0].value == 1.3
    assert looked[0][0] is a
    assert looked[0][2] == pytest.approx(np.hypot(first - 1.0, 0.075))


def test_a_cycle_at_the_end_of_the_range_is_kept_once():
    follow = track(bounds=(0.0, 1.0))
    follow.cycles = [cycle(0.5, x=3.0), cycle(0.75, x=4.0), cycle(1.0 - 1e-10, x=5.0)]
    assert follow._to_bound(place((1, 2, 2, 0.25 - 2e-11)), place((1, 2, 2, 0.3)), 1.0) == Ended(BranchEnd.BOUND)
    assert [(each.value, each.amplitude["X"]) for each in follow.cycles] == [(0.5, 3.0), (0.75, 4.0), (1.0, 5.0)]


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
    # Where what the contact does changes, too, it grazes, turned or not.
    for beyond in (place(tangent=(0.6, 0, 0, 0.8)), place(tangent=(0.6, 0, 0, -0.8))):
        beyond.closed.flow.pattern = "sticks"
        follow = track()
        follow.cycles = [cycle(0.5), cycle(1.0)]
        monkeypatch.setattr(follow, "_advance", lambda place, step: None)
        monkeypatch.setattr(follow, "_around", lambda place, beyond=beyond: beyond)
        follow._next(here, 0.1)
        assert [each.what for each in follow.cycles] == [None, Event.GRAZING]


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
    monkeypatch.setattr(continuation, "halves", lambda shooting, closed: sizes[float(closed.unknowns[0])])
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


# --- whole branches --------------------------------------------------------------------------------------------------


class Curve:
    """Cycles of state x, period 2 T and parameter 2 p on a curve H(x, p) = 0, with T = 1 + x/10; y fixes the phase."""

    def __init__(self, curve, *, pattern=lambda x: "slides", reached=lambda x: True, steps=lambda x: 3) -> None:
        self.scale, self._curve = np.array([1.0, 1.0, 2.0, 2.0]), curve
        self._pattern, self._reached, self._steps = pattern, reached, steps
        self.closed_with: list[Any] = []

    def unscaled(self, unknowns):
        return unknowns[:2] * self.scale[:2], float(2 * unknowns[2]), float(2 * unknowns[3])

    def in_units(self, units):
        np.testing.assert_allclose(units, 1.0)
        return self

    def flow(self, unknowns):
        x, _, period, parameter = unknowns
        end = unknowns[:2] + np.array([self._curve(x, parameter), period - 1 - x / 10])
        return SimpleNamespace(end=end, rate=np.array([0.0, 7.0]), pattern=self._pattern(x), at=unknowns)

    def jacobian(self, found):
        step, (x, _, _, parameter) = 1e-7, found.at
        by_x = (self._curve(x + step, parameter) - self._curve(x - step, parameter)) / (2 * step)
        by_p = (self._curve(x, parameter + step) - self._curve(x, parameter - step)) / (2 * step)
        return np.array([[by_x, 0, 0, by_p], [-0.1, 0, 1, 0]])

    def vibration(self, closed, steady):
        return closed.unknowns[:2] - np.append(steady, 0.0)

    def close(self, guess, condition=None, phase=None):
        condition = np.array([0, 0, 0, 1.0]) if condition is None else condition
        unknowns = np.array(guess, dtype=float)
        for _ in range(40):
            found = self.flow(unknowns)
            missing = np.array([*(found.end - unknowns[:2]), unknowns[1] - guess[1], condition @ (unknowns - guess)])
            matrix = np.vstack([self.jacobian(found), [0, 1, 0, 0], condition])
            unknowns = unknowns - np.linalg.solve(matrix, missing)
            if np.abs(missing).max() < 1e-12:
                break
        else:
            return None
        self.closed_with.append((guess, phase))
        if not self._reached(unknowns[0]):
            return None
        return Closed(unknowns, self.flow(unknowns), 0.0, self._steps(unknowns[0]))  # pyright: ignore[reportArgumentType]


@pytest.fixture
def along(monkeypatch):
    """Follow a curve from x upwards in a direction of x; returns how it ended and its cycles."""

    def followed(
        curve: Curve, x: float, bounds, *, y=0.3, way=1.0, p=0.0, steady=lambda value: None,
        multipliers=lambda x: (0.5,), **more,
    ):  # fmt: skip
        def described(shooting, closed):
            assert shooting is curve
            state, period, value = curve.unscaled(closed.unknowns)
            samples = SimpleNamespace(time=np.zeros(1), velocity=None)
            found = multipliers(state[0])
            return cycle(value, period, state[0] + 3, found, displacement={"X": state[0]}, samples=samples, **more)

        monkeypatch.setattr(continuation, "describe", described)
        monkeypatch.setattr(continuation, "slip_speeds", lambda model, velocity: np.ones(1))
        monkeypatch.setattr(continuation, "scale_near", lambda *_: np.ones(4))
        monkeypatch.setattr(
            continuation, "floquet_of", lambda shooting, closed: (np.array(multipliers(closed.unknowns[0])), 0.0)
        )
        branches: list[Any] = []
        follow = Track(curve, bounds, steady, BranchEnd.DOUBLING, branches.append)  # pyright: ignore[reportArgumentType]
        ended = follow.follow(curve.close(np.array([x, y, 1, p]), np.array([1.0, 0, 0, 0])), np.array([way, 0, 0, 0]))  # pyright: ignore[reportArgumentType]
        assert [len(each.cycles) for each in branches] == list(range(1, len(branches) + 1))
        assert all(each.start is BranchEnd.DOUBLING and each.end is BranchEnd.CUT_OFF for each in branches)
        cycles = follow.cycles
        for each in cycles:
            u, p = each.displacement["X"], each.value / 2
            assert curve._curve(u, p) == pytest.approx(0.0, abs=1e-9)
            assert each.period_s == pytest.approx(2 + u / 5)
        return ended, cycles

    return followed


def cubic(x: float, p: float) -> float:
    return p - (x**3 - 0.3 * x)


def test_a_branch_is_followed_through_its_folds_in_steps_that_go_by_newtons(along):
    """The cubic of which the slope vanishes at x² = 0.1."""

    def steps(x: float) -> int:
        return (3, 4, 5, 6, 4)[int(abs(1e3 * x)) % 5]

    ended, cycles = along(Curve(cubic, steps=steps), -0.8, (-2.0, 0.5))
    assert ended == Ended(BranchEnd.BOUND)
    folds = [each for each in cycles if each.what is Event.FOLD]
    assert [each.displacement["X"] for each in folds] == pytest.approx([-(0.1**0.5), 0.1**0.5], abs=3e-6)
    assert [each.what for each in cycles if each not in folds] == [None] * (len(cycles) - 2)
    assert cycles[-1].value == 0.5
    places = [(each.displacement["X"], each.period_s / 2, each.value / 2) for each in cycles if each not in folds]
    made, step = [], 0.02
    for (x, *a), (y, *b) in pairwise(places):
        tangent = np.array([1, 0.1, 3 * x**2 - 0.3])
        made.append(tangent @ np.array([y - x, *np.subtract(b, a)]) / np.linalg.norm(tangent))
    for x, one in zip((each[0] for each in places[1:-1]), made[:-1], strict=True):
        assert one == pytest.approx(step, rel=1e-6)
        step = min(step * (1.6 if steps(x) <= 4 else 1.0), 0.15) * (0.5 if steps(x) >= 6 else 1.0)
    assert max(made) == pytest.approx(0.15)
    assert made[-1] < step


def test_a_branch_that_comes_back_is_a_loop(along):
    ended, cycles = along(Curve(lambda x, p: x**2 + (p - 0.1) ** 2 - 0.25), 0.3, (-9.0, 9.0))
    assert ended == Ended(BranchEnd.LOOP)
    assert cycles[0] is cycles[-1]
    folds = [each for each in cycles if each.what is Event.FOLD]
    assert [each.value / 2 for each in folds] == pytest.approx([0.6, -0.4], abs=1e-8)
    assert [each.displacement["X"] for each in folds] == pytest.approx([0.0, 0.0], abs=1e-5)


@pytest.mark.parametrize(("sticks", "end"), [(0, BranchEnd.HOPF), (2, BranchEnd.STANDSTILL)])
def test_a_branch_that_shrinks_to_steady_sliding_ends_there(along, sticks, end):
    ended, cycles = along(
        Curve(lambda x, p: p - x**2), 0.7, (-9.0, 9.0), y=0.0, way=-1.0, steady=lambda value: np.zeros(1),
        sticking_phases=sticks,
    )  # fmt: skip
    assert ended == Ended(end)
    assert 0 < cycles[-1].displacement["X"] < 0.2


@pytest.mark.parametrize("turned", [True, False])
def test_a_branch_goes_on_behind_a_corner_at_which_it_turns(along, turned):
    """Behind x = p = 0.1 one of them goes back, twice as fast as the other goes on."""

    def bent(x: float, p: float) -> float:
        a, b = (x, p) if turned else (p, x)
        return float(b - np.where(a < 0.1, a, 0.3 - 2 * a))

    ended, cycles = along(Curve(bent), -0.3, (-0.7, 0.9))
    assert ended == Ended(BranchEnd.BOUND)
    (k,) = [k for k, each in enumerate(cycles) if each.what is not None]
    assert cycles[k].what is (Event.FOLD if turned else Event.CORNER)
    # It is left as near to the corner as the smallest step brings it, and gone on with a little behind it.
    assert cycles[k].displacement["X"] == pytest.approx(0.1, abs=5e-6)
    beyond = np.hypot(cycles[k + 1].displacement["X"] - 0.1, cycles[k + 1].value / 2 - 0.1)
    assert 1e-3 / 3 < beyond < 3e-3
    assert cycles[-1].value == (-0.7 if turned else 0.9)


def test_a_branch_that_only_bends_at_a_corner_goes_through_it(along):
    ended, cycles = along(Curve(lambda x, p: p - np.where(x < 0.1, x, 6 * x - 0.5)), -0.3, (-0.7, 0.9))
    assert ended == Ended(BranchEnd.BOUND)
    assert not any(each.what for each in cycles)
    assert min(abs(each.displacement["X"] - 0.1) for each in cycles) < 2e-6


def friction(static: float) -> Any:
    law = SimpleNamespace(coefficient=lambda speed: 0.3 + speed, static=static)
    return SimpleNamespace(mass=np.ones(1), contact=SimpleNamespace(friction=SimpleNamespace(law=law)))


def test_a_branch_grazes_where_its_pattern_changes_and_ends_where_the_motion_jumps_away(along, monkeypatch):
    monkeypatch.setattr(continuation, "static_coefficient", lambda law: law.static)

    def pattern(x: float) -> str:
        return "slides" if x < 0.1 else "sticks"

    ended, cycles = along(Curve(cubic, pattern=pattern), -0.1, (-1.0, 0.5), model=friction(0.3))
    assert ended == Ended(BranchEnd.BOUND)
    grazes, folds = ([each.displacement["X"] for each in cycles if each.what is e] for e in (Event.GRAZING, Event.FOLD))
    assert (grazes, folds) == (pytest.approx([0.1], abs=5e-6), pytest.approx([0.1**0.5], abs=3e-6))
    for static, end in ((0.31, Ended(BranchEnd.GRAZING)), (0.3, BranchEnd.LOST)):
        ended, cycles = along(
            Curve(cubic, pattern=pattern, reached=lambda x: x < 0.1), -0.1, (-1.0, 0.5), model=friction(static)
        )
        assert cycles[-1].displacement["X"] == pytest.approx(0.1, abs=5e-6)
        if end is BranchEnd.LOST:
            lost = f"Newton's method fails with the smallest step at {cycles[-1].value:.6g}"
            assert (ended, cycles[-1].what) == (Ended(BranchEnd.LOST, lost), None)
        else:
            assert (ended, cycles[-1].what, cycles[-2].what) == (end, Event.GRAZING, None)


@pytest.mark.parametrize(
    ("at", "what"),
    [(lambda x: (-0.6 - x, 0.1), Event.DOUBLING), (lambda x: (x + 1.2, -0.2), Event.BRANCHING)],
)  # fmt: skip
def test_a_multiplier_crosses_the_circle_where_it_does(along, at, what):
    """A multiplier −0.6 − x comes to −1 at 0.4, and one of x + 1.2 leaves the circle at −0.2."""
    ended, cycles = along(Curve(lambda x, p: p - x), -0.55, (-2.0, 1.4), multipliers=at)
    assert ended == Ended(BranchEnd.BOUND)
    (found,) = [each for each in cycles if each.what is not None]
    assert found.what is what
    assert found.displacement["X"] == pytest.approx(0.4 if what is Event.DOUBLING else -0.2, abs=2e-6)


def test_where_another_branch_crosses_both_directions_are_kept(along, monkeypatch):
    """Two lines p = x and p = 0.12 − x/2, which cross at 0.08."""
    curve = Curve(lambda x, p: (p - x) * (p + x / 2 - 0.12))
    directions, asked = np.array([[1, 0, 0.1, -0.5], [1, 0, 0.1, 1.0]]), []
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    unknowns = np.array([0.08, 0.3, 1.008, 0.08])

    def found(shooting, guess):
        asked.append(guess)
        return Crossing(Closed(unknowns, None, 0.0, 1), directions)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(continuation, "find_crossing", found)
    ended, cycles = along(curve, -0.3, (-0.9, 0.8), p=-0.3)
    assert ended == Ended(BranchEnd.BOUND)
    ((k, crosses),) = [(k, each) for k, each in enumerate(cycles) if each.what is not None]
    assert (crosses.what, crosses.value) == (Event.TRANSCRITICAL, pytest.approx(0.16))
    np.testing.assert_allclose(crosses.crossing, directions[0] * curve.scale)
    middle = (cycles[k - 1].displacement["X"] + cycles[k + 1].displacement["X"]) / 2
    assert asked[-1] == pytest.approx([middle, 0.3, 1 + middle / 10, middle])
    # The sides of a branch that another one crosses as its mirror are those of one: there it ends.
    for upright, mirrored, end in ((1, True, BranchEnd.PITCHFORK), (1, False, None), (0, True, None)):
        monkeypatch.setattr(continuation, "is_mirrored", lambda shooting, at, way, mirrored=mirrored: mirrored)
        turned = directions.copy()
        turned[upright, -1] = 0.0
        follow, kept = track(curve), []
        monkeypatch.setattr(follow, "_keep", kept.append)
        crossing = Crossing(Closed(unknowns, None, 0.0, 1), turned)  # pyright: ignore[reportArgumentType]
        assert follow._keep_crossing(crossing, np.array([1.0, 0, 0, 1.5])) == end
        assert (kept[0].what, kept[0].value) == (Event.PITCHFORK, pytest.approx(0.16))
        np.testing.assert_allclose(kept[0].crossing, turned[0] * curve.scale)
    # One that lies farther off than the step is long is another one.
    far = Crossing(Closed(unknowns + 0.5 * np.eye(4)[0], None, 0.0, 1), directions)  # pyright: ignore[reportArgumentType]
    monkeypatch.setattr(continuation, "find_crossing", lambda shooting, guess: far)
    a, b = closed_at(unknowns - 0.1), closed_at(unknowns + 0.1)
    assert track(curve)._crossing_between(a, b) is None
    assert track(curve)._crossing_between(closed_at(unknowns - 0.3), closed_at(unknowns + 0.3)) is far


@pytest.mark.parametrize(("length", "found"), [(0.3e-3, False), (0.4e-3, True), (2.9e-3, True), (3.1e-3, False)])
def test_behind_a_corner_a_cycle_counts_that_is_about_a_step_away(monkeypatch, length, found):
    here = place(tangent=(0, 0, 0, 1.0))

    class Away(Plane):
        def close(self, guess, condition=None, phase=None):
            if np.linalg.norm(guess - here.closed.unknowns) > 1.1e-3:  # of the first of the steps alone
                return None
            np.testing.assert_allclose(np.linalg.norm(guess - here.closed.unknowns), 1e-3)
            return closed_at(here.closed.unknowns + length * (guess - here.closed.unknowns) / 1e-3)

    follow = track(Away())
    monkeypatch.setattr(follow, "_same_way", lambda place, closed, tangent: True)
    monkeypatch.setattr(follow, "_place", lambda closed, ahead: (closed, ahead))
    beyond = follow._around(here)
    assert (beyond is not None) == found
    if beyond is not None:
        way = beyond[0].unknowns - here.closed.unknowns
        np.testing.assert_allclose(beyond[1], way / np.linalg.norm(way))
    monkeypatch.setattr(follow, "_same_way", lambda place, closed, tangent: False)
    assert follow._around(here) is None


def test_a_multiplier_that_lies_on_the_circle_at_an_end_is_not_looked_for(monkeypatch):
    follow, asked = track(), []
    monkeypatch.setattr(follow, "_locate", lambda *given: asked.append(given))
    for one, other in ((1 - 0.9e-10, 1.2), (0.8, 1 + 0.9e-10)):
        assert follow._look_between(place(multipliers=(one,)), place(multipliers=(other,)), 0.2) is None
    assert asked == []
    for one, other in ((1 - 1.1e-10, 1.2), (0.8, 1 + 1.1e-10)):
        follow._look_between(place(multipliers=(one,)), place(multipliers=(other,)), 0.2)
    assert len(asked) == 2
