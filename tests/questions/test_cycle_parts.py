"""The parts of a search for cycles: returns, gains along modes, multipliers, what lies between two cycles."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.dynamics.cycles import branches as branches_module
from drumsqueal.dynamics.cycles import cycle as orbit
from drumsqueal.dynamics.cycles import search
from drumsqueal.dynamics.cycles.branches import _aligned, _ends_at, _left_behind, _meet, is_branch_cycle
from drumsqueal.dynamics.cycles.continuation import Ended
from drumsqueal.dynamics.cycles.cycle import (
    BranchEnd,
    Cycle,
    CycleBranch,
    Diagram,
    Event,
    OffBranch,
    Unfollowed,
    Why,
    off_between,
    steady_sliding,
    unlike,
)
from drumsqueal.dynamics.cycles.search import RecordedMotion, _disturbances, _lasting, _shortest, _starts
from drumsqueal.errors import CycleError
from drumsqueal.questions.cycle import study
from drumsqueal.questions.cycle import study as words_module
from drumsqueal.solve.shooting import Closed, ShootingStart, floquet
from drumsqueal.solve.transient.flow import StickTransition

RNG = np.random.default_rng(9)


def cycle(
    value: float = 1.0, period: float = 0.5, x: float = 2.0, tz: float = 0.1, largest: float = 0.5, **more: Any
) -> Cycle:
    known: dict[str, Any] = {
        "period_s": period, "amplitude": {"X": x, "Tz": tz}, "main_coordinate": "X", "unit_multiplier_error": 0.0,
        "multipliers": np.array([largest, 0.1], dtype=complex), "tangent_error": 0.0, "residual": 0.0,
        "contact_fraction": 1.0, "slip_reversed_fraction": 0.0, "displacement": {"X": x, "Tz": 0.0},
        "velocity": {"X": 0.0, "Tz": tz}, "value": value, "model": SimpleNamespace(mass=np.array([1.0, 4.0])),
    }  # fmt: skip
    return Cycle(**(known | more))


def test_a_cycle_between_two_has_their_period_and_sizes_in_proportion():
    a, b = cycle(1.0, 0.5, 2.0, 0.1), cycle(3.0, 0.9, 4.0, 0.4)
    middle = {"X": 2.5, "Tz": 0.175}
    assert off_between(a, b, 1.5, 0.6, middle) == pytest.approx(0.0, abs=1e-12)
    assert off_between(b, a, 1.5, 0.6 * math.exp(0.2), middle) == pytest.approx(0.2)
    assert off_between(a, b, 1.5, 0.6, {"X": 2.5, "Tz": 0.175 * math.exp(-0.3)}) == pytest.approx(0.3)
    assert math.isinf(off_between(a, b, 3.1, 0.6, middle))
    assert math.isinf(off_between(a, a, 1.0, 0.5, a.amplitude))
    assert unlike(a, 0.5 * math.exp(-0.3), {"X": 2.0, "Tz": 0.1 * math.exp(0.2)}) == pytest.approx(0.3)
    assert unlike(a, 0.5 * math.exp(0.1), {"X": 2.0, "Tz": 0.1 * math.exp(-0.2)}) == pytest.approx(0.2)
    assert (a.frequency_Hz, a.stable, a.neutral, a.unstable_directions) == (2.0, True, False, 0)
    np.testing.assert_array_equal(a.state, [2.0, 0.0, 0.0, 0.1])
    for largest, stable, neutral, count in (
        (1 + 2e-6, False, False, 1),
        (1 - 0.9e-6, True, True, 0),
        (-1.5, False, False, 1),
    ):
        found = cycle(largest=largest)
        assert (found.stable, found.neutral, found.unstable_directions) == (stable, neutral, count)


def test_multipliers_are_the_eigenvalues_without_that_of_the_motion_itself():
    values = np.array([1.0, -0.7, 0.3 + 0.4j, 0.3 - 0.4j])
    basis = RNG.normal(size=(4, 4))
    block = np.array([[1, 0, 0, 0], [0, -0.7, 0, 0], [0, 0, 0.3, -0.4], [0, 0, 0.4, 0.3]])
    matrix = basis @ block @ np.linalg.inv(basis)
    found, error = floquet(matrix, 3.0 * basis[:, 0])
    np.testing.assert_allclose(found, [-0.7, *values[2:]], atol=1e-12)
    assert error == pytest.approx(0.0, abs=1e-12)
    assert floquet(matrix, basis[:, 0] + basis[:, 1])[1] > 0.1
    # A coordinate that nothing depends on is left out, and as many as are lost are zero.
    wide = np.zeros((5, 5))
    wide[:2, :2], wide[:2, 3:], wide[3:, :2], wide[3:, 3:], wide[2, 2] = (
        matrix[:2, :2],
        matrix[:2, 2:],
        matrix[2:, :2],
        matrix[2:, 2:],
        1.0,
    )
    held, _ = floquet(wide, np.insert(basis[:, 0], 2, 7.0))
    np.testing.assert_allclose(held, found, atol=1e-12)
    block[1, 1] = 1e-17
    lost, _ = floquet(basis @ block @ np.linalg.inv(basis), basis[:, 0], lost=1)
    np.testing.assert_allclose(lost[:2], values[2:], atol=1e-12)
    assert lost[2] == 0


def test_phases_of_sticking_last_to_the_next_change():
    changes = (
        (0.1, StickTransition.STICKS),
        (0.25, StickTransition.SLIPS),
        (0.3, StickTransition.REVERSES),
        (0.4, StickTransition.STICKS),
    )
    assert orbit._sticking(changes, 0.9) == pytest.approx([0.15, 0.5])
    assert orbit._sticking((), 0.9) == []
    found: Any = SimpleNamespace(changes=changes)
    samples = [(0.1004, True), (0.2496, False), (0.4, True)]
    orbit._check_changes(SimpleNamespace(changes=samples), found, 0.5)  # pyright: ignore[reportArgumentType]
    for wrong in (samples[:2], [(0.1006, True), *samples[1:]], [(0.1, False), *samples[1:]]):
        with pytest.raises(CycleError, match="nearly grazes"):
            orbit._check_changes(SimpleNamespace(changes=wrong), found, 0.5)  # pyright: ignore[reportArgumentType]


def test_a_record_returns_first_where_it_comes_nearest():
    # A torus of 5 Hz and 5 √2 Hz, sampled at 200 Hz: returns after 5 and 7 turns of either, or 2 and 3.
    time = 4.0 + np.arange(1200) / 200.0
    states = np.stack([3 * np.cos(2 * np.pi * 5 * time), 0.2 * np.sin(2 * np.pi * 5 * 2**0.5 * time)], axis=1)
    scale = np.array([3.0, 0.2])
    found = list(search.returns(time, states, scale, 4.0))
    longest = int(6 / 4.0 * 200)
    away = np.array([np.abs((states[lag:] - states[:-lag]) / scale).max(axis=1).min() for lag in range(2, longest + 1)])
    minima = [k + 2 for k in range(1, len(away) - 1) if away[k] <= min(away[k - 1], away[k + 1])]
    wanted: list[int] = []
    for lag in sorted(minima, key=lambda lag: away[lag - 2]):
        if len(wanted) < 4 and all(abs(lag - other) > 0.05 * other for other in wanted):
            wanted.append(lag)
    assert [round(each.period * 200) for each in found] == wanted
    assert len(wanted) == 4
    for each, lag in zip(found, wanted, strict=True):
        gaps = np.abs((states[lag:] - states[:-lag]) / scale).max(axis=1)
        np.testing.assert_array_equal(each.state, states[np.argmin(gaps)])
        assert each.origin == f"where the transient nearly returns at {time[np.argmin(gaps)]:.4g} s"


def mode(right: np.ndarray, frequency: float = 50.0, rate: float = 0.0) -> Any:
    return SimpleNamespace(
        name="X",
        label="X (2)",
        right=right,
        eigenvalue=rate + 2j * np.pi * frequency,
        frequency_Hz=frequency,
        growth_rate=rate,
    )


@pytest.fixture
def lining(monkeypatch) -> None:
    monkeypatch.setattr(search, "at_lining", lambda model, name, size: (1e6, "µm", name))


@pytest.mark.usefixtures("lining")
def test_a_start_along_a_mode_has_its_shape_and_period():
    right = np.array([1.0, 0.3 - 0.2j, 9.0, 9.0])
    found = search.modal_start(None, np.array([5.0, 6.0]), mode(right), 1e-3)  # pyright: ignore[reportArgumentType]
    # q = Re a φ e^{iωt}, so that v = Re i ω a φ at the start.
    np.testing.assert_allclose(found.state[:2], [5.0 + 1e-3, 6.0 + 0.3e-3])
    np.testing.assert_allclose(found.state[2:], (1j * 2 * np.pi * 50 * 1e-3 * right[:2]).real)
    assert found.period == pytest.approx(0.02)
    assert found.origin == "a motion along mode X (2) with 1e+03 µm of X"


@pytest.mark.usefixtures("lining")
def test_motions_along_modes_begin_where_friction_gives_as_much_as_damping_takes(monkeypatch):
    shape, mass, frequency = np.array([1.0, 0.3 - 0.2j, 0, 0]), np.array([2.0, 5.0]), 2 * np.pi * 50
    monkeypatch.setattr(search, "reach", lambda model, mode: 0.1)
    # W(a) = −a² (a − 0.01)(a − 0.2) in the units of its round-off, which hides what is smaller.
    energy = np.sum(mass * np.abs(shape[:2]) ** 2) / 2 * frequency**3

    def work(size):
        def given(model, steady, asked, omega, amplitudes):
            np.testing.assert_array_equal(asked, shape[:2])
            assert omega == frequency
            np.testing.assert_allclose(amplitudes, 0.1 * np.geomspace(1e-3, 4.0, 80))
            return -size * energy * amplitudes**2 * (amplitudes - 0.01) * (amplitudes - 0.2)

        return given

    model: Any = SimpleNamespace(mass=mass)
    stability: Any = SimpleNamespace(steady_state=np.zeros(2), vibrations=(mode(shape),))
    monkeypatch.setattr(search, "_work", work(1.0))
    found = [float(each.state[0]) for each in search.modal_starts(model, stability)]
    # Amplitudes are 11 % apart; between two of them the work is linear in the logarithm, which it is to 1 %.
    assert found == pytest.approx([0.2, 0.01], rel=0.01)
    tried = 0.1 * np.geomspace(1e-3, 4.0, 80)
    done = work(1.0)(None, None, shape[:2], frequency, tried)
    for each in found:
        k = int(np.searchsorted(tried, each)) - 1
        ends = np.argsort(done[k : k + 2])
        assert each == pytest.approx(np.exp(np.interp(0.0, done[k + ends], np.log(tried[k + ends]))), rel=1e-12)
    # Where |a − 0.01| 0.19 × 11 % is round-off, the smaller is not known.
    monkeypatch.setattr(search, "_work", work(1e-9 / 2e-4))
    assert [float(each.state[0]) for each in search.modal_starts(model, stability)] == pytest.approx([0.2], rel=0.01)


def record(**changed: Any) -> RecordedMotion:
    known: dict[str, Any] = {"time": np.arange(100) / 10.0, "states": RNG.normal(size=(100, 4)), "words": "so"}
    return RecordedMotion(**(known | changed))


def test_a_search_begins_at_the_end_of_a_periodic_record_or_at_its_last_releases():
    (found,) = _lasting(periodic := record(period=0.7), "the transient")
    assert (found.period, found.origin) == (0.7, "the end of the transient")
    np.testing.assert_array_equal(found.state, periodic.states[-1])
    released = record(releases=(1.0, 2.5, 4.5, 7.03))
    found = list(_lasting(released, "it"))
    assert [each.period for each in found] == pytest.approx([2.53, 4.53])
    for each in found:
        np.testing.assert_array_equal(each.state, released.states[71])
    late = record(releases=(1.0, 11.0))
    (found,) = _lasting(late, "it")
    np.testing.assert_array_equal(found.state, late.states[99])
    assert list(_lasting(record(releases=(1.0,)), "it")) == []


def test_returns_are_sought_in_a_record_that_moves_and_is_long_enough(monkeypatch):
    monkeypatch.setattr(search, "returns", lambda time, states, scale, lowest: [("return", lowest)])
    monkeypatch.setattr(search, "modal_starts", lambda model, stability: ["mode"])
    monkeypatch.setattr(search, "_size_of", lambda transient, states: None)
    transient: Any = SimpleNamespace(lowest_frequency_Hz=5.0, model=None, stability=None)

    def begun(given: RecordedMotion) -> list[Any]:
        return [each.origin if isinstance(each, ShootingStart) else each for each in _starts(transient, given)]

    assert begun(record()) == [("return", 5.0), "mode"]
    assert begun(record(period=0.7)) == ["the end of the transient"]
    short = {"time": np.arange(63.0), "states": RNG.normal(size=(63, 4))}
    for none in (record(at_rest=True), record(states=np.ones((100, 4))), record(**short)):
        assert begun(none) == ["mode"]
    transient.lowest_frequency_Hz = None
    assert begun(record()) == ["mode"]


def test_a_large_disturbance_is_a_motion_along_a_mode_three_times_as_fast_as_the_drum(monkeypatch):
    monkeypatch.setattr(search, "reach", lambda model, mode: 0.02)
    right = np.array([1.0, 0.3 - 0.2j, 9.0, 9.0])
    transient = search.motion.Transient(
        SimpleNamespace(names=("X", "Tz")), SimpleNamespace(vibrations=(mode(right),)), np.zeros(2), np.zeros(2), {}  # pyright: ignore[reportArgumentType]
    )  # pyright: ignore[reportArgumentType]  # fmt: skip
    ((words, found),) = _disturbances(transient)
    assert words == "after a large disturbance along mode X (2)"
    np.testing.assert_allclose(found.displacement, 0.06 * right[:2].real)  # pyright: ignore[reportAttributeAccessIssue]
    np.testing.assert_allclose(found.velocity, (2j * np.pi * 50 * 0.06 * right[:2]).real)


def test_of_a_motion_that_repeats_within_its_period_the_shortest_is_taken():
    # It repeats after a third of the period, and nearly after a sixth.
    def flow(unknowns):
        part = unknowns[-2]
        off = 0.9e-5 if part == pytest.approx(0.4) else 1.1e-5 if part == pytest.approx(0.2) else 1.0
        return SimpleNamespace(end=unknowns[:-2] + off)

    closed = Closed(np.array([1.0, 2.0, 1.2, 7.0]), None, 0.0, 1)  # pyright: ignore[reportArgumentType]
    shooting: Any = SimpleNamespace(flow=flow, close=lambda unknowns: ("closed", unknowns.tolist()))
    assert _shortest(shooting, closed) == ("closed", [1.0, 2.0, pytest.approx(0.4), 7.0])
    shooting.close = lambda unknowns: None
    assert _shortest(shooting, closed) is closed


# --- branches --------------------------------------------------------------------------------------------------------


def branch(*cycles: Cycle, start: BranchEnd = BranchEnd.BOUND, end: BranchEnd = BranchEnd.BOUND) -> CycleBranch:
    return CycleBranch(start=start, end=end, cycles=cycles)


def test_a_branch_ends_at_a_hopf_point_near_in_value_and_frequency():
    hopf: Any = SimpleNamespace(value=10.0, frequency_Hz=2.0)
    for value, period, ends in ((10.19, 0.5, True), (10.21, 0.5, False), (9.81, 0.509, True), (10.0, 0.512, False)):
        one = branch(cycle(value, period), cycle(4.0), start=BranchEnd.HOPF)
        assert _ends_at(one, hopf, 10.0) == ends
        assert (
            _ends_at(
                one.model_copy(update={"cycles": one.cycles[::-1], "start": BranchEnd.LOST, "end": BranchEnd.HOPF}),
                hopf,
                10.0,
            )
            == ends
        )
        assert not _ends_at(one.model_copy(update={"start": BranchEnd.LOST}), hopf, 10.0)


def test_branches_meet_where_the_same_happens_at_one_value_with_one_period_or_twice_or_half_of_it():
    here = cycle(10.0, 0.5, what=Event.DOUBLING)
    for value, period, what, meets in (
        (10.0 + 0.9e-4, 0.509, Event.DOUBLING, True), (10.0 + 1.1e-4, 0.5, Event.DOUBLING, False),
        (10.0, 0.511, Event.DOUBLING, False), (10.0, 1.0, Event.DOUBLING, True), (10.0, 0.25, Event.DOUBLING, True),
        (10.0, 0.5, Event.FOLD, False), (10.0, 1.5, Event.DOUBLING, False),
    ):  # fmt: skip
        there = cycle(value, period, what=what)
        assert _meet(here, there, 10.0) == meets
        moved = _aligned(branch(cycle(3.0), here), [branch(cycle(2.0), there)], 10.0)
        assert [each.value for each in moved.cycles] == [3.0, there.value if meets else 10.0]


def test_what_begins_where_two_branches_meet_is_not_left_behind():
    family: Any = SimpleNamespace(low=1.0, high=20.0)
    doubling = cycle(10.0, what=Event.DOUBLING, largest=-1.0)
    one = branch(cycle(5.0), doubling, cycle(15.0, largest=1.5))
    (found,) = _left_behind([one], family)
    other = branch(cycle(10.0, 1.0, what=Event.DOUBLING), cycle(12.0, 1.0), start=BranchEnd.DOUBLING)
    assert _left_behind([one, other], family) == []
    assert (found.low, found.high) == (10.0, 15.0)  # where the branch goes on without being stable


def test_motions_on_a_branch_are_those_between_two_of_its_cycles():
    one = branch(cycle(1.0, 0.5, 2.0), cycle(3.0, 0.7, 3.0), cycle(5.0, 0.7, 3.0))
    middle = {"X": 2.5, "Tz": 0.1}
    assert branches_module._is_on([one], 2.0, 0.6, middle)
    assert branches_module._is_on([one], 5.0, 0.7, one.cycles[2].amplitude)
    assert not branches_module._is_on([one], 5.5, 0.7, one.cycles[2].amplitude)
    assert branches_module._is_on([one], 2.0, 0.6 * 1.019, middle)
    assert not branches_module._is_on([one], 2.0, 0.6 * 1.021, middle)
    near = cycle(2.0, 0.6 * 1.2, 2.5)
    assert not is_branch_cycle([one], near, lambda a, b: [])
    assert is_branch_cycle([one], near, lambda a, b: [cycle(2.0, 0.6 * 1.2 * (1 + 0.9e-4), 2.5)])
    assert not is_branch_cycle([one], near, lambda a, b: [cycle(2.0, 0.6 * 1.2 * (1 + 1.1e-4), 2.5)])
    assert not is_branch_cycle([one], cycle(2.0, 0.6 * 1.4, 2.5), lambda a, b: [cycle(2.0, 0.6 * 1.4, 2.5)])
    assert not is_branch_cycle([one], cycle(2.0, 0.6, 2.5, largest=1.5), lambda a, b: [])


def test_a_motion_is_on_the_cycle_that_newton_finds_if_that_is_stable_and_as_large(monkeypatch):
    given: list[Any] = []
    model: Any = SimpleNamespace(mass=np.array([1.0, 4.0]))
    states = np.array([[-2.0, 0.0, 0.0, 0.0], [2.0, 0.2, 0.0, 0.0], [1.0, 0.1, 7.0, 8.0]])
    settled, seed = record(states=states, period=0.5), search.Seed(3.0, {}, 2.0)

    def closed(found: Cycle, of: RecordedMotion = settled) -> Cycle:
        monkeypatch.setattr(search, "cycle_from", lambda model, start, steady, on_flow: given.append(start) or found)
        return search.closed_from(seed, of, model, np.zeros(2), lambda: None)

    assert closed(cycle(1.0, x=2.0 * 1.049)).value == 3.0
    assert given[0].period == 0.5
    np.testing.assert_array_equal(given[0].state, states[-1])
    with pytest.raises(CycleError, match="another cycle, of 2 Hz"):
        closed(cycle(1.0, x=2.0 * 1.06))
    with pytest.raises(CycleError, match="unstable cycle near it"):
        closed(cycle(1.0, largest=1.1))
    assert closed(cycle(1.0, largest=1 + 0.5e-6)).value == 3.0
    with pytest.raises(CycleError, match=r"^it so$"):
        closed(cycle(1.0, largest=1.1), record(states=states))
    assert closed(cycle(1.0), record(states=states)).value == 3.0
    assert given[-1].period == 0.5  # that of its line
    seed = search.Seed(3.0, {})
    with pytest.raises(CycleError, match=r"^it so$"):
        closed(cycle(1.0), record(states=states))


def test_cycles_of_a_branch_are_closed_from_between_two_of_its_own(monkeypatch):
    asked: list[Any] = []

    class Shooting:
        def scaled(self, state, period, value):
            asked.append((np.round(state, 9).tolist(), round(period, 9), value))
            return len(asked)

        def close(self, unknowns):
            return None if unknowns == 2 else unknowns

    family = branches_module.CycleFamily(lambda value: (None, None), (0.0, 10.0))  # pyright: ignore[reportArgumentType]
    monkeypatch.setattr(family, "steady_at", lambda value: np.zeros(2))
    monkeypatch.setattr(family, "_shooting", lambda *given: Shooting())
    monkeypatch.setattr(branches_module, "describe", lambda shooting, closed: closed)
    a, b = cycle(1.0, 0.5, 2.0, 0.1), cycle(3.0, 0.9, 4.0, 0.4)
    assert list(family.between(1.5, a, b)) == [1, 3]
    assert asked == [
        ([2.5, 0.0, 0.0, 0.175], 0.6, 1.5),
        ([2.0, 0.0, 0.0, 0.1], 0.5, 1.5),
        ([4.0, 0.0, 0.0, 0.4], 0.9, 1.5),
    ]
    assert branches_module.VALUES == 60


def test_the_first_cycle_beside_another_is_nearer_where_the_range_ends_first():
    family = branches_module.CycleFamily(lambda value: (None, None), (0.0, 10.0))  # pyright: ignore[reportArgumentType]
    tried = []

    class Shooting:
        def close(self, guess, way):
            tried.append(guess[-1])
            return SimpleNamespace(unknowns=guess)

        def unscaled(self, unknowns):
            return None, None, unknowns[-1]

    at, way = np.array([0.0, 0.0, 9.995]), np.array([0.0, 0.0, 1.0])
    found = family._beside(Shooting(), at, way)  # pyright: ignore[reportArgumentType]
    assert found is not None
    assert tried == pytest.approx([9.995 + 0.02 / 2**k for k in range(3)])
    assert family._beside(Shooting(), at + 0.0049, way) is None  # pyright: ignore[reportArgumentType]
    assert len(tried) == 9


# --- diagrams --------------------------------------------------------------------------------------------------------


def lost(one: CycleBranch, *, followed=(), low: float = 0.0, high: float = 9.0) -> list[tuple[str, float, float]]:
    return [(each.reason, each.low, each.high) for each in one.not_followed(low, high, followed)]


def test_a_branch_leaves_behind_what_lies_beyond_an_end_at_which_it_is_lost_or_jumps():
    up, down = (cycle(3.0), cycle(5.0)), (cycle(5.0), cycle(3.0))
    ends: dict[str, Any] = {
        "start": BranchEnd.BOUND,
        "end": BranchEnd.LOST,
        "end_detail": "so",
        "start_detail": "other",
    }
    assert lost(CycleBranch(cycles=up, **ends)) == [("so", 5.0, 9.0)]
    assert lost(CycleBranch(cycles=down, **ends)) == [("so", 0.0, 3.0)]
    ends |= {"start": BranchEnd.LOST, "end": BranchEnd.HOPF}
    assert lost(CycleBranch(cycles=up, **ends)) == [("other", 0.0, 3.0)]
    assert lost(CycleBranch(cycles=down, **ends)) == [("other", 5.0, 9.0)]
    assert lost(CycleBranch(cycles=(cycle(4.0),), **ends)) == [("other", 0.0, 9.0)]  # which way it goes is not known
    grazes = CycleBranch(start=BranchEnd.HOPF, end=BranchEnd.GRAZING, cycles=up)
    assert lost(grazes) == [("what the motion jumps to at the grazing at 5", 5.0, 9.0)]
    alone = tuple(each.model_copy(update={"amplitude": {"X": 1.0}}) for each in up)
    assert lost(CycleBranch(start=BranchEnd.HOPF, end=BranchEnd.GRAZING, cycles=alone)) == []
    doubled = CycleBranch(start=BranchEnd.DOUBLING, end=BranchEnd.PITCHFORK, cycles=up)
    assert lost(doubled, followed=(3.0,)) == [("what else is at the pitchfork point at 5", 0.0, 9.0)]
    assert lost(doubled, followed=(5.0,)) == [("what else is at the period doubling at 3", 0.0, 9.0)]
    assert (
        lost(doubled, followed=(3.0, 5.0))
        == lost(CycleBranch(start=BranchEnd.HOPF, end=BranchEnd.LOOP, cycles=up))
        == []
    )


def long_branch() -> CycleBranch:
    """Stable up to a doubling at 2, unstable to a fold at 4, stable to 3 and, nobody knows how, not from 2.5 on."""
    doubling, fold = cycle(2.0, largest=-1.0, what=Event.DOUBLING), cycle(4.0, largest=1.0, what=Event.FOLD)
    first, last = (cycle(1.0), doubling, cycle(3.0, largest=1.5)), (cycle(2.5, largest=1.2), cycle(2.2, largest=2.0))
    return CycleBranch(start=BranchEnd.PITCHFORK, end=BranchEnd.BOUND, cycles=(*first, fold, cycle(3.0), *last))


def test_a_branch_falls_into_pieces_that_are_stable_or_not():
    one = long_branch()
    pieces = [([each.value for each in cycles], stable) for cycles, stable in one.pieces()]
    assert pieces == [([1.0, 2.0], True), ([2.0, 3.0, 4.0], False), ([4.0, 3.0], True), ([3.0, 2.5, 2.2], False)]
    assert [(each.what, each.value) for each in one.special] == [(Event.DOUBLING, 2.0), (Event.FOLD, 4.0)]
    assert [each.value for each in one.meeting()] == [1.0, 2.0]  # where it begins, and where another one does
    unknown = ("how stability changes between 2.5 and 3", 2.2, 3.0)  # and what else is where it is unstable
    assert lost(one, followed=(1.0,)) == [("what begins at the period doubling at 2", 2.0, 4.0), unknown]
    assert lost(one, followed=(1.0, 2.0)) == [unknown]
    assert lost(one)[0] == ("what else is at the pitchfork point at 1", 0.0, 9.0)


def test_a_diagram_has_the_ranges_of_its_stable_cycles_and_where_some_may_have_been_missed():
    cycles = cycle(6.0), cycle(7.0, what=Event.GRAZING), cycle(6.5, what=Event.FOLD)
    other = CycleBranch(start=BranchEnd.HOPF, end=BranchEnd.LOST, cycles=cycles)
    missed = (Unfollowed(reason="so", low=7.5, high=8.2), Unfollowed(reason="so", low=1.6, high=1.8))
    found = Diagram(
        steady_sliding_stable=((1.5, 3.5), (6.9, 9.0)), steady_sliding_unstable=(), branches=(long_branch(), other),
        not_followed=missed,
    )  # fmt: skip
    assert found.stable_cycles == ((1.0, 2.0), (3.0, 4.0), (6.0, 7.0))
    assert found.squeals_only_when_disturbed == ((1.5, 2.0), (3.0, 3.5), (6.9, 7.0))
    assert (found.folds, found.grazings, found.doublings) == ((4.0, 6.5), (7.0,), (2.0,))
    assert found.squeals_unknown == ((7.5, 8.2),)  # from 1.6 to 1.8 one is stable in any case
    nothing = found.model_copy(update={"branches": ()})
    assert nothing.squeals_unknown == found.steady_sliding_stable


def test_steady_sliding_is_stable_between_critical_values_by_the_nearest_point():
    known = ((0.5, True, ""), (2.0, False, ""), (4.5, False, ""), (6.0, True, ""), (8.0, False, "x"))
    points = [SimpleNamespace(value=value, reason=reason, unstable=unstable) for value, unstable, reason in known]
    critical = [SimpleNamespace(value=value) for value in (1.0, 3.0, 5.0, 7.0)]
    linear: Any = SimpleNamespace(points=points, critical=critical)
    assert steady_sliding(linear, 0.0, 9.0, stable=True) == ((1.0, 5.0),)
    assert steady_sliding(linear, 0.0, 9.0, stable=False) == ((0.0, 1.0), (5.0, 7.0))


# --- branches that begin somewhere -----------------------------------------------------------------------------------


class Line:
    """A scale of one for a state of two coordinates; what is closed is what was guessed."""

    def __init__(self, closes=lambda guess: True) -> None:
        self.scale, self.guesses, self._closes = np.array([1.0, 2.0, 1.0, 1.0, 0.5, 4.0]), [], closes
        self.twice = 0

    def scaled(self, state, period, value):
        return np.array([*state, period, value]) / self.scale

    def unscaled(self, unknowns):
        given = unknowns * self.scale
        return given[:-2], float(given[-2]), float(given[-1])

    def close(self, guess, way=None):
        self.guesses.append((guess, way))
        return Closed(guess, None, 0.0, 1) if self._closes(guess) else None  # pyright: ignore[reportArgumentType]

    def flow(self, unknowns):
        """Half a period later the state is as far on the other side of (1, 1, 1, 1), while `twice` are none."""
        self.twice -= 1
        end = unknowns[:-2] + (0.0 if self.twice >= 0 else 1.0)
        return SimpleNamespace(transition=np.diag([0.5, -0.97, 1.0, 0.2]), end=end)


@pytest.fixture
def family(monkeypatch) -> Any:
    """A family whose branches are two cycles from where they begin; `asked` has how they were followed."""
    models: Any = lambda value: (("model", value), None)  # noqa: E731
    found: Any = branches_module.CycleFamily(models, (0.0, 10.0))
    found.shooting, found.asked, found.ends = Line(), [], {}

    def follow(shooting, closed, ahead, start, on_branch):
        found.asked.append((closed.unknowns.tolist(), ahead.tolist(), start, on_branch))
        end = found.ends.get(np.sign(ahead[-1]), Ended(BranchEnd.BOUND, "so"))
        if isinstance(end, CycleError):
            raise end
        at = closed.unknowns[-1] * 4
        return [cycle(at, 1.0), cycle(at + np.sign(ahead[-1]), 1.0)], end

    monkeypatch.setattr(found, "steady_at", lambda value: np.array([0.1, 0.2]))
    monkeypatch.setattr(found, "_shooting", lambda value, start, steady: found.shooting)
    monkeypatch.setattr(found, "_follow", follow)
    return found


def values_of(found: CycleBranch) -> list[float]:
    return [each.value for each in found.cycles]


def test_a_branch_begins_at_a_hopf_point_along_the_mode_that_neither_grows_nor_decays(family, monkeypatch):
    steady = np.array([0.3, 0.4])
    modes = [SimpleNamespace(growth_rate=rate, label=name) for name, rate in (("a", 3.0), ("b", -0.01), ("c", -2.0))]
    monkeypatch.setattr(
        branches_module, "point_at", lambda model_at, value: SimpleNamespace(modes=modes, steady=steady)
    )
    monkeypatch.setattr(branches_module, "reach", lambda model, mode: 5.0)
    begun = []

    def modal_start(model, steady, mode, amplitude):
        begun.append((model, mode.label, amplitude))
        return ShootingStart(np.array([amplitude, 1.0, 2.0, 3.0]), 0.25, "so")

    monkeypatch.setattr(branches_module, "modal_start", modal_start)
    critical: Any = SimpleNamespace(value=6.0)
    on_branch: Any = object()
    found = family.from_hopf(critical, on_branch)
    assert begun == [(("model", 6.0), "b", pytest.approx(0.1)), (("model", 6.0), "b", 5.0)]
    ((guess, way),) = family.shooting.guesses
    np.testing.assert_allclose(guess, [0.1, 0.5, 2.0, 3.0, 0.5, 1.5])
    np.testing.assert_allclose(way, [0.1 - 0.3, 0.5 - 0.2, 2.0, 3.0, 0.0, 0.0])  # from steady sliding
    ((closed, ahead, start, given),) = family.asked
    assert (closed, ahead, start, given) == (guess.tolist(), way.tolist(), BranchEnd.HOPF, on_branch)
    assert (found.start, found.end, found.end_detail, len(found.cycles)) == (BranchEnd.HOPF, BranchEnd.BOUND, "so", 2)
    family.shooting = Line(lambda guess: False)
    with pytest.raises(CycleError, match="finds no cycle next to it"):
        family.from_hopf(critical, on_branch)


def test_a_doubled_branch_begins_along_what_changes_its_sign_in_a_period(family):
    doubled = cycle(8.0, 0.25, multipliers=np.array([-0.97, 0.5]), what=Event.DOUBLING)
    found = family.from_doubling(doubled, None)
    ((guess, way), *_) = family.shooting.guesses
    at = family.shooting.scaled(doubled.state, 0.5, 8.0)
    np.testing.assert_allclose(way, [0, 1, 0, 0, 0, 0])
    np.testing.assert_allclose(guess, at + 0.02 * way)
    assert family.asked[0][2] is BranchEnd.DOUBLING
    assert (found.start, found.end) == (BranchEnd.DOUBLING, BranchEnd.BOUND)
    assert (found.cycles[0].value, found.cycles[0].period_s) == (8.0, 0.5)
    np.testing.assert_allclose(found.cycles[0].multipliers, [0.97**2, 0.25])
    # What is the same after half the period is the other cycle twice, and its own lie nearer.
    family.shooting = Line()
    family.shooting.twice = 3  # flows: that over the period, and two over halves
    family.from_doubling(doubled, None)
    steps = [np.linalg.norm(guess - at) for guess, _ in family.shooting.guesses]
    assert steps == pytest.approx([0.02, 0.01, 0.005])
    family.shooting = Line(lambda guess: False)
    with pytest.raises(CycleError, match="no cycle of twice the period"):
        family.from_doubling(doubled, None)


def test_a_branch_that_crosses_another_is_followed_to_both_sides(family, monkeypatch):
    crossed = cycle(8.0, 0.25, crossing=np.array([0.3, 0.0, 0.0, 0.0, 0.0, 1.6]))
    way = np.array([0.3, 0, 0, 0, 0, 0.4]) / 0.5
    found = family.from_crossing(crossed, None)
    at = family.shooting.scaled(crossed.state, 0.25, 8.0)
    np.testing.assert_allclose([guess for guess, _ in family.shooting.guesses], [at - 0.02 * way, at + 0.02 * way])
    np.testing.assert_allclose([ahead for _, ahead, *_ in family.asked], [-way, way])
    step = 4 * 0.02 * 0.8
    assert values_of(found) == pytest.approx([8 - step - 1, 8 - step, 8.0, 8 + step, 8 + step + 1])
    family.ends = {-1.0: Ended(BranchEnd.GRAZING, "a"), 1.0: CycleError("b")}
    found = family.from_crossing(crossed, None)
    assert (found.start, found.start_detail, found.end, found.end_detail) == (
        BranchEnd.GRAZING,
        "a",
        BranchEnd.LOST,
        "b",
    )
    assert values_of(found) == pytest.approx([8 - step - 1, 8 - step, 8.0])
    family.ends = {-1.0: CycleError("a"), 1.0: CycleError("b")}
    with pytest.raises(CycleError, match=r"^b$"):
        family.from_crossing(crossed, None)
    family.ends = {-1.0: Ended(BranchEnd.LOOP)}
    found = family.from_crossing(crossed, None)
    assert (found.start, found.end, len(found.cycles)) == (BranchEnd.LOOP, BranchEnd.LOOP, 2)
    upright, asked = cycle(8.0, 0.25, crossing=np.array([0.3, 0.8, 0.0, 0.0, 0.0, 0.0])), len(family.asked)
    family.ends = {}
    for mirrored, start, ways in ((True, BranchEnd.PITCHFORK, [1]), (False, BranchEnd.BOUND, [-1, 1])):
        monkeypatch.setattr(branches_module, "is_mirrored", lambda shooting, at, way, mirrored=mirrored: mirrored)
        found = family.from_crossing(upright, None)
        assert (found.start, found.end, len(found.cycles)) == (start, BranchEnd.BOUND, 1 + 2 * len(ways))
        np.testing.assert_allclose(
            [ahead for _, ahead, *_ in family.asked[asked:]], np.outer(ways, [0.6, 0.8, 0, 0, 0, 0])
        )
        asked = len(family.asked)


def test_a_branch_of_a_cycle_is_followed_down_and_up(family):
    family.ends = {-1.0: Ended(BranchEnd.LOST, "a"), 1.0: Ended(BranchEnd.GRAZING, "b")}
    found = family.both_ways(cycle(8.0, 0.25))
    assert values_of(found) == [7.0, 8.0, 9.0]
    assert (found.start, found.start_detail, found.end, found.end_detail) == (
        BranchEnd.LOST,
        "a",
        BranchEnd.GRAZING,
        "b",
    )
    assert [each[1] for each in family.asked] == [[0, 0, 0, 0, 0, -1.0], [0, 0, 0, 0, 0, 1.0]]
    family.ends = {-1.0: Ended(BranchEnd.LOOP)}
    assert values_of(family.both_ways(cycle(8.0, 0.25))) == [8.0, 7.0]
    family.shooting = Line(lambda guess: False)
    with pytest.raises(CycleError, match="loses the cycle"):
        family.both_ways(cycle(8.0, 0.25))


def test_what_another_branch_meets_is_crossed_doubled_or_halved(family, monkeypatch):
    for name in ("from_crossing", "from_doubling", "both_ways"):
        monkeypatch.setattr(family, name, lambda cycle, on_branch, name=name: (name, cycle.period_s))
    monkeypatch.setattr(branches_module, "_with_doubling", lambda branch, value: (*branch, value))
    assert family.meeting(cycle(8.0, 0.25, crossing=np.ones(6)), None) == ("from_crossing", 0.25)
    assert family.meeting(cycle(8.0, 0.25, what=Event.DOUBLING, largest=-1.01), None) == ("from_doubling", 0.25)
    assert family.meeting(cycle(8.0, 0.25, what=Event.DOUBLING, largest=1.01), None) == ("both_ways", 0.125, 8.0)
    with pytest.raises(CycleError, match="what begins at a branch point is not followed"):
        family.meeting(cycle(8.0, 0.25, what=Event.BRANCHING), None)


def test_a_motion_that_begins_at_rest_on_the_drum_is_closed_where_it_sticks_again(family, monkeypatch):
    sticks, released = True, ShootingStart(np.ones(4), 0.3, "so")
    monkeypatch.setattr(branches_module, "can_stick", lambda model, at_rest: sticks and not at_rest)
    monkeypatch.setattr(branches_module, "released_start", lambda model, steady: released)
    monkeypatch.setattr(branches_module, "cycle_from", lambda model, start, steady, on_flow: cycle(1.0, start.period))
    found = family.sticking_at(7.0)
    assert (found.value, found.period_s) == (7.0, 0.3)
    released = None
    assert family.sticking_at(7.0) is None
    sticks, released = False, ShootingStart(np.ones(4), 0.3, "so")
    assert family.sticking_at(7.0) is None
    sticks = True
    monkeypatch.setattr(family, "steady_at", lambda value: None)
    assert family.sticking_at(7.0) is None
    with pytest.raises(CycleError, match="no steady sliding"):
        family.both_ways(cycle(8.0, 0.25))
    assert list(family.between(1.5, cycle(1.0), cycle(2.0))) == []


# --- which motions begin a branch ------------------------------------------------------------------------------------


def test_the_motion_of_a_seed_is_recorded_from_its_start_on(monkeypatch):
    states = np.array([[1.0, 5.0, 0.1, 0.2], [3.0, -1.0, 0.3, 0.4], [2.0, 0.0, 0.5, 0.6]])
    oscillations, asked = [object()], []
    monkeypatch.setattr(search, "analyse_stability", lambda model: SimpleNamespace(oscillations=oscillations))
    monkeypatch.setattr(
        search.motion, "constant_transient", lambda model, start, **how: asked.append((start, how)) or "transient"
    )
    monkeypatch.setattr(search, "recorded", lambda transient, progress, what: record(states=states))
    model: Any = SimpleNamespace(names=("X", "Tz"))
    seed = search.Seed(7.0, {"displacement": {"X": 1.0}}, 33.0)
    found = search.recorded_at(seed, model, lambda *_: None)
    assert found.amplitude.tolist() == [1.0, 3.0]
    assert asked[0] == (
        {"displacement": {"X": 1.0}}, {"duration": None, "sample_rate": None, "tolerance": 1e-8, "solver": "auto"}
    )  # fmt: skip
    states = np.zeros((0, 4))
    with pytest.raises(CycleError, match=r"^it so$"):
        search.recorded_at(seed, model, lambda *_: None)
    oscillations.clear()
    with pytest.raises(CycleError, match="nothing oscillates"):
        search.recorded_at(seed, model, lambda *_: None)


EMPTY = Diagram(steady_sliding_stable=(), steady_sliding_unstable=(), branches=(), notes=("before",))


def test_motions_begin_a_branch_each_where_they_are_on_none(monkeypatch):
    """Motions at 1 to 8: no steady sliding, not recorded, at rest, on a branch, not closed twice, and not followed."""
    family: Any = SimpleNamespace(
        model_at=lambda value: SimpleNamespace(names=("X",), at=value), on_flow="flow",
        steady_at=lambda value: None if value == 1.0 else np.zeros(2), leaving=lambda value: some[1:2],
    )  # fmt: skip

    def recorded_at(seed, model, progress):
        assert model.at == seed.value
        if seed.value == 2.0:
            raise CycleError("not recorded")
        states = np.array([[-seed.value, 0.0], [seed.value, 0.0]])
        period = None if seed.value == 6.0 else 0.25
        return record(states=states, period=period, ends_at_rest=seed.value == 3.0)

    def closed_from(seed, found, model, steady, on_flow):
        assert on_flow == "flow"
        if seed.value in (5.0, 6.0):
            raise CycleError(f"not closed {seed.value:g}")
        return cycle(seed.value)

    def from_cycle(self, cycle, kind):
        assert kind == f"motion found at {cycle.value:g}, the "
        if cycle.value == 7.0:
            self.note("lost")
        else:
            self._update(branches=(*self.diagram.branches, branch(cycle)))

    monkeypatch.setattr(branches_module, "recorded_at", recorded_at)
    monkeypatch.setattr(branches_module, "closed_from", closed_from)
    monkeypatch.setattr(branches_module.DiagramBuilder, "from_cycle", from_cycle)
    monkeypatch.setattr(branches_module, "_is_on", lambda branches, value, period, amplitude: value == 4.0)
    some = [search.Seed(float(k), {}, 9.0) for k in range(1, 9)]
    built = branches_module.DiagramBuilder(family, EMPTY)
    built.from_seeds(some)
    found = built.diagram
    assert [values_of(each) for each in found.branches] == [[8.0]]
    assert [(each.value, each.why, each.reason, each.frequency_Hz, each.amplitude) for each in found.off_branches] == [
        (2.0, Why.NOT_RECORDED, "not recorded", 9.0, {}), (5.0, Why.NOT_CLOSED, "not closed 5", 4.0, {"X": 5.0}),
        (6.0, Why.NOT_PERIODIC, "not closed 6", 9.0, {"X": 6.0}), (7.0, Why.NOT_FOLLOWED, "lost", 4.0, {"X": 7.0}),
    ]  # fmt: skip
    built.from_steady_sliding(2.0)  # of what leaves steady sliding and is on no branch nothing is said
    assert built.diagram.off_branches == found.off_branches


def test_branches_begin_at_hopf_points_at_motions_from_rest_and_at_those_that_are_known(monkeypatch):
    """Of a family of models: nine values of the range, of which the second is lost and the fourth sticks."""
    asked: list[Any] = []

    def of(models, low, high, progress, on_diagram):
        asked.append((models, low, high))
        return branches_module.DiagramBuilder(family, EMPTY)

    def sticking_at(value):
        asked.append(value)
        if value == 3.0:
            raise CycleError("why")
        return cycle(value) if value == 5.0 else None

    def from_cycle(self, cycle, kind):
        self._update(branches=(branch(cycle, cycle.model_copy(update={"value": 9.0})),))
        self.note(kind)

    def from_seed(self, seed):
        self.note(str(seed))
        return []

    family: Any = SimpleNamespace(
        low=2.0, high=10.0, sticking_at=sticking_at, leaving=lambda value: [f"leaving {value}"]
    )
    monkeypatch.setattr(study.DiagramBuilder, "of", of)
    monkeypatch.setattr(study.DiagramBuilder, "from_cycle", from_cycle)
    monkeypatch.setattr(study.DiagramBuilder, "_from_seed", from_seed)
    monkeypatch.setattr(study.DiagramBuilder, "from_hopf_points", lambda self: asked.append("Hopf points"))
    monkeypatch.setattr(study, "diagram_verdict", lambda diagram, whole: f"{whole.key} {whole.values}")
    found = study.follow_cycles("models", (10.0, 2.0), seeds=["seed"])  # pyright: ignore[reportArgumentType, reportCallIssue]
    assert asked == [("models", 2.0, 10.0), "Hopf points", *range(2, 11)]
    lost = "from rest on the drum: why"
    assert found.stable_cycles == ((5.0, 9.0),)
    leaving = (f"leaving {value}" for value in (2.0, 3.0, 4.0, 10.0))
    assert found.notes == ("before", lost, "sticking ", "seed", *leaving)
    assert [(each.reason, each.low, each.high) for each in found.not_followed] == [(lost, 2.0, 10.0)]
    assert found.verdict == "the parameter (2.0, 10.0)"
    assert len(found.branches) == 1
    for wrong in ((1.0, 1.0), (0.0, math.inf)):
        with pytest.raises(ValueError, match="from one finite number to another"):
            study.follow_cycles("models", wrong)  # pyright: ignore[reportArgumentType, reportCallIssue]


def test_motions_that_are_on_no_branch_go_on_where_they_are_alike():
    def off(value: float, size: float | None, why: Why = Why.NOT_CLOSED) -> OffBranch:
        amplitude = {} if size is None else {"X": size}
        return OffBranch(value=value, frequency_Hz=None, amplitude=amplitude, why=why, reason="so")

    one = off(1.0, 2.0)
    alike = words_module.ALIKE
    assert words_module._goes_on(one, off(2.0, 2.0 * math.exp(0.99 * alike)))
    assert not words_module._goes_on(one, off(2.0, 2.0 * math.exp(1.01 * alike)))
    assert not words_module._goes_on(one, off(1.0, 2.0))
    assert not words_module._goes_on(one, off(2.0, 2.0, Why.NOT_PERIODIC))
    assert not words_module._goes_on(one, off(2.0, None))
    assert not words_module._goes_on(off(2.0, None), one)


@pytest.mark.parametrize(("stable", "disturbed"), [((True, False), 0), ((False, True), 0), ((False, False), 2)])
def test_a_search_goes_on_from_large_disturbances_until_a_stable_cycle_is_found(monkeypatch, stable, disturbed):
    found = {f"start {k}": cycle(1.0, 0.5 + k, largest=0.5 if each else 1.5) for k, each in enumerate(stable)}
    found |= {"after a": found["start 0"], "after b": cycle(1.0, 9.0, largest=0.2)}
    ran: list[str] = []

    def recorded(transient, progress, what):
        ran.append(what)
        return SimpleNamespace(words="so", of=what)

    def begun(*origins: str) -> list[ShootingStart]:
        return [ShootingStart(np.ones(4), 0.5, each) for each in origins]

    def cycle_from(model, start, steady, report):
        if start.origin not in found:
            raise CycleError("none")
        return found[start.origin]

    monkeypatch.setattr(search, "recorded", recorded)
    monkeypatch.setattr(search, "_starts", lambda transient, record: begun("start 0", "lost", "start 1"))
    monkeypatch.setattr(search, "_disturbances", lambda transient: [("a", "ta"), ("b", "tb"), ("c", "tc")])
    monkeypatch.setattr(search, "_lasting", lambda after, words: begun(f"after {words[-1]}"))
    monkeypatch.setattr(search, "cycle_from", cycle_from)
    transient: Any = SimpleNamespace(model=None, stability=SimpleNamespace(steady_state=np.zeros(2)))
    (done, *others), words = search.search(transient, lambda *_: None)
    best = "after b" if disturbed else f"start {stable.index(True)}"
    assert (done.found_from, words, done.period_s) == (best, "so", found[best].period_s)
    assert [each.found_from for each in others] == [each for each in ("start 0", "start 1") if each != best]
    assert ran == ["transient", "transient a", "transient b"][: 1 + disturbed]
