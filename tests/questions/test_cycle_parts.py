"""The parts of a search for cycles: returns, gains along modes, multipliers, what lies between two cycles."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import CycleError
from drumsqueal.questions.cycle import branches as branches_module
from drumsqueal.questions.cycle import family as family_module
from drumsqueal.questions.cycle import orbit, search, seeds, starts
from drumsqueal.questions.cycle.branches import _aligned, _ends_at, _left_behind, _meet
from drumsqueal.questions.cycle.diagram import Branch, End
from drumsqueal.questions.cycle.orbit import Cycle, Event, between, floquet, unlike
from drumsqueal.questions.cycle.search import Record, _disturbances, _lasting, _shortest, _starts
from drumsqueal.solve.shooting import Closed, Start
from drumsqueal.solve.transient.flow import Change

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
    found = between(a, b, 1.5)
    assert (found.value, found.period_s) == (1.5, pytest.approx(0.6))
    assert found.amplitude == pytest.approx({"X": 2.5, "Tz": 0.175})
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
    changes = ((0.1, Change.STICKS), (0.25, Change.SLIPS), (0.3, Change.REVERSES), (0.4, Change.STICKS))
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
    found = list(starts.returns(time, states, scale, 4.0))
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
    monkeypatch.setattr(starts, "at_lining", lambda model, name, size: (1e6, "µm", name))


@pytest.mark.usefixtures("lining")
def test_a_start_along_a_mode_has_its_shape_and_period():
    right = np.array([1.0, 0.3 - 0.2j, 9.0, 9.0])
    found = starts.modal_start(None, np.array([5.0, 6.0]), mode(right), 1e-3)  # pyright: ignore[reportArgumentType]
    # q = Re a φ e^{iωt}, so that v = Re i ω a φ at the start.
    np.testing.assert_allclose(found.state[:2], [5.0 + 1e-3, 6.0 + 0.3e-3])
    np.testing.assert_allclose(found.state[2:], (1j * 2 * np.pi * 50 * 1e-3 * right[:2]).real)
    assert found.period == pytest.approx(0.02)
    assert found.origin == "a motion along mode X (2) with 1e+03 µm of X"


@pytest.mark.usefixtures("lining")
def test_motions_along_modes_begin_where_friction_gives_as_much_as_damping_takes(monkeypatch):
    shape, mass, frequency = np.array([1.0, 0.3 - 0.2j, 0, 0]), np.array([2.0, 5.0]), 2 * np.pi * 50
    monkeypatch.setattr(starts, "reach", lambda model, mode: 0.1)
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
    monkeypatch.setattr(starts, "_work", work(1.0))
    found = [float(each.state[0]) for each in starts.modal_starts(model, stability)]
    # Amplitudes are 11 % apart; between two of them the work is linear in the logarithm, which it is to 1 %.
    assert found == pytest.approx([0.2, 0.01], rel=0.01)
    tried = 0.1 * np.geomspace(1e-3, 4.0, 80)
    done = work(1.0)(None, None, shape[:2], frequency, tried)
    for each in found:
        k = int(np.searchsorted(tried, each)) - 1
        ends = np.argsort(done[k : k + 2])
        assert each == pytest.approx(np.exp(np.interp(0.0, done[k + ends], np.log(tried[k + ends]))), rel=1e-12)
    # Where |a − 0.01| 0.19 × 11 % is round-off, the smaller is not known.
    monkeypatch.setattr(starts, "_work", work(1e-9 / 2e-4))
    assert [float(each.state[0]) for each in starts.modal_starts(model, stability)] == pytest.approx([0.2], rel=0.01)


def record(**changed: Any) -> Record:
    known: dict[str, Any] = {"time": np.arange(100) / 10.0, "states": RNG.normal(size=(100, 4)), "words": "so"}
    return Record(**(known | changed))


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

    def begun(given: Record) -> list[Any]:
        return [each.origin if isinstance(each, Start) else each for each in _starts(transient, given)]

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


def branch(*cycles: Cycle, start: End = End.BOUND, end: End = End.BOUND) -> Branch:
    return Branch(start=start, end=end, cycles=cycles)


def test_a_branch_ends_at_a_hopf_point_near_in_value_and_frequency():
    hopf: Any = SimpleNamespace(value=10.0, frequency_Hz=2.0)
    for value, period, ends in ((10.19, 0.5, True), (10.21, 0.5, False), (9.81, 0.509, True), (10.0, 0.512, False)):
        one = branch(cycle(value, period), cycle(4.0), start=End.HOPF)
        assert _ends_at(one, hopf, 10.0) == ends
        assert (
            _ends_at(
                one.model_copy(update={"cycles": one.cycles[::-1], "start": End.LOST, "end": End.HOPF}), hopf, 10.0
            )
            == ends
        )
        assert not _ends_at(one.model_copy(update={"start": End.LOST}), hopf, 10.0)


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
    other = branch(cycle(10.0, 1.0, what=Event.DOUBLING), cycle(12.0, 1.0), start=End.DOUBLING)
    assert _left_behind([one, other], family) == []
    assert (found.low, found.high) == (10.0, 15.0)  # where the branch goes on without being stable


def test_motions_on_a_branch_are_those_between_two_of_its_cycles():
    one = branch(cycle(1.0, 0.5, 2.0), cycle(3.0, 0.7, 3.0), cycle(5.0, 0.7, 3.0))
    assert seeds._around([one], 2.0) == [(one.cycles[0], one.cycles[1])]
    assert len(seeds._around([one], 3.0)) == 2
    assert seeds._around([one], 5.5) == []
    middle = {"X": 2.5, "Tz": 0.1}
    assert seeds.on_branch([one], 0.6, middle, 2.0)
    assert seeds.on_branch([one], 0.6 * 1.019, middle, 2.0)
    assert not seeds.on_branch([one], 0.6 * 1.021, middle, 2.0)
    near = cycle(2.0, 0.6 * 1.2, 2.5)
    assert not seeds.is_branch_cycle([one], near, lambda a, b: [])
    assert seeds.is_branch_cycle([one], near, lambda a, b: [cycle(2.0, 0.6 * 1.2 * (1 + 0.9e-4), 2.5)])
    assert not seeds.is_branch_cycle([one], near, lambda a, b: [cycle(2.0, 0.6 * 1.2 * (1 + 1.1e-4), 2.5)])
    assert not seeds.is_branch_cycle([one], cycle(2.0, 0.6 * 1.4, 2.5), lambda a, b: [cycle(2.0, 0.6 * 1.4, 2.5)])
    assert not seeds.is_branch_cycle([one], cycle(2.0, 0.6, 2.5, largest=1.5), lambda a, b: [])


def test_a_motion_is_on_the_cycle_that_newton_finds_if_that_is_stable_and_as_large(monkeypatch):
    given: list[Any] = []
    model: Any = SimpleNamespace(mass=np.array([1.0, 4.0]))
    settled = seeds.Settled(3.0, 0.5, {"X": 2.0, "Tz": 0.1}, 2.0, np.ones(4), "so")

    def closed(found: Cycle, of: seeds.Settled = settled) -> Cycle:
        monkeypatch.setattr(seeds, "cycle_from", lambda model, start, steady, on_flow: given.append(start) or found)
        return seeds.closed_from(of, model, np.zeros(2), lambda: None)

    assert closed(cycle(1.0, x=2.0 * 1.049)).value == 3.0
    assert given[0].period == 0.5
    with pytest.raises(CycleError, match="another cycle, of 2 Hz"):
        closed(cycle(1.0, x=2.0 * 1.06))
    with pytest.raises(CycleError, match="unstable cycle near it"):
        closed(cycle(1.0, largest=1.1))
    assert closed(cycle(1.0, largest=1 + 0.5e-6)).value == 3.0
    with pytest.raises(CycleError, match=r"^it so$"):
        closed(cycle(1.0, largest=1.1), settled._replace(period=None))


def test_cycles_of_a_branch_are_closed_from_between_two_of_its_own(monkeypatch):
    asked: list[Any] = []

    class Shooting:
        def scaled(self, state, period, value):
            asked.append((np.round(state, 9).tolist(), round(period, 9), value))
            return len(asked)

        def close(self, unknowns):
            return None if unknowns == 2 else unknowns

    family = family_module.Family(lambda value: (None, None), (0.0, 10.0))  # pyright: ignore[reportArgumentType]
    monkeypatch.setattr(family, "steady_at", lambda value: np.zeros(2))
    monkeypatch.setattr(family, "_shooting", lambda *given: Shooting())
    monkeypatch.setattr(family_module, "describe", lambda shooting, closed: closed)
    a, b = cycle(1.0, 0.5, 2.0, 0.1), cycle(3.0, 0.9, 4.0, 0.4)
    assert list(family.between(1.5, a, b)) == [1, 3]
    assert asked == [
        ([2.5, 0.0, 0.0, 0.175], 0.6, 1.5),
        ([2.0, 0.0, 0.0, 0.1], 0.5, 1.5),
        ([4.0, 0.0, 0.0, 0.4], 0.9, 1.5),
    ]
    assert branches_module.VALUES == 60


def test_the_first_cycle_beside_another_is_nearer_where_the_range_ends_first():
    family = family_module.Family(lambda value: (None, None), (0.0, 10.0))  # pyright: ignore[reportArgumentType]
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
