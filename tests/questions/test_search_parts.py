"""The search for the onset of squeal, in a world of motions whose borders are known."""

import math
from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.dynamics.attractor import SMALL_START, Response, SteadyResponse, VelocityPerturbation
from drumsqueal.dynamics.cycles.cycle import RangeKind
from drumsqueal.dynamics.ensemble import IntegratorOptions, Start
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.questions.onset import study as study_module
from drumsqueal.questions.onset.found import Row
from drumsqueal.questions.onset.study import LinearOnset, _Search, compare
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import Branches, Critical

HOPF, FOLD = 5.0, 3.37  # steady sliding is unstable above the one, and a squeal there is down to the other
QUIET_SIZES, LOUD_SIZES = (1.0, 2.0, 4.0, 8.0), (1.5, 3.0, 6.0, 12.0)  # of disturbances along X and along Y


def point(value: float) -> Any:
    nowhere = "locked" if value < 0.5 else ""
    return SimpleNamespace(
        value=value, reason=nowhere, unstable=not nowhere and value > HOPF, growth_rate=value - HOPF, modes=()
    )


def motion(name: str, value: float, size: float, start: str) -> SteadyResponse:
    """The first motion grows with the value, the second one is ten times as loud; its state has its size."""
    rms = {"A": 1 + 0.02 * value, "B": 10.0}[name]
    frequency = {"A": 100.0, "B": 300.0}[name]
    return SteadyResponse(
        start=start, amplitude={"X": 2 * rms}, rms={"X": rms}, frequency_Hz=frequency, line_of="X",
        kinetic_energy_J=rms**2, share_of_contact_loss=1.0, share_of_slip_reversal=2.0, drift=0.0,
        state=np.array([[0.0], [size]]),
    )  # fmt: skip


class World:
    """A needs a size above a border that falls to nothing at the Hopf point; B one above 11.5, and is left of 4.3.

    A motion that was A decays slowly just left of the fold: in fewer than ten rounds it is there still.
    """

    def __init__(self) -> None:
        self.ran: list[tuple[float, str, float, int]] = []
        self.known: list[dict[float, Sequence[SteadyResponse]]] = []

    def leads(self, value: float, start: Start, rounds: int) -> tuple[Kind, SteadyResponse | None]:
        size = float(np.abs(start.velocity).max())
        if 2.6 < value < 4.3 and size > 11.5:
            return Kind.SQUEALS, motion("B", value, 20.0, start.name)
        ghost = FOLD - 0.1 < value <= FOLD and rounds < Criteria.lasting
        if value > HOPF or ((value > FOLD or ghost) and size > 5 * (HOPF - value) / (HOPF - FOLD)):
            return Kind.SQUEALS, motion("A", value, 7.5, start.name)
        return Kind.DECAYS, None

    def find(self, family, tasks, how, *, rounds=Criteria.persistent, known=None, progress=None) -> Iterator[Response]:
        assert how.sample_rate == 9.0
        self.known.append(dict(known or {}))
        for at, start in tasks:
            self.ran.append((at.value, start.name, float(np.abs(start.velocity).max()), rounds))
            leads, found = self.leads(at.value, start, rounds)
            yield Response(
                start=start.name, leads_to=leads, simulated_s=0.1 * rounds, outcome="complete",
                disturbance=start.disturbance, from_value=start.from_value, motion=found, value=at.value,
            )  # fmt: skip


def direction(name: str, sizes: tuple[float, ...]) -> Any:
    def start(size: float) -> Start:
        disturbance = VelocityPerturbation(
            mode=name,
            forwards=True,
            velocity={"X": size},
            speed_m_per_s=size,
            energy_J=size**2,
            boundary_ratio=size / 2,
        )
        return Start(f"disturbance {name} {size:g}", np.zeros(1), np.array([size]), disturbance=disturbance)

    return SimpleNamespace(sizes=list(sizes), boundary_ratio=0.5, start=start)


@pytest.fixture
def world(monkeypatch) -> World:
    made = World()
    monkeypatch.setattr(study_module, "find_attractors", made.find)
    monkeypatch.setattr(study_module, "point_at", lambda linear_at, value: point(value))

    def directions(at, family, signs):
        assert signs == (1,)
        return [direction("X", QUIET_SIZES), direction("Y", LOUD_SIZES)]

    monkeypatch.setattr(study_module, "directions", directions)
    return made


def predicted(*values: float, highest: float = 0.0) -> LinearOnset:
    """That of values of steady sliding up to the largest of them, or further."""

    def small_start(at, model, size=0.1):
        assert model == ("model", at.value)
        return Start(SMALL_START, np.zeros(1), np.array([-size]))

    family: Any = SimpleNamespace(
        model_at=lambda value: ("model", value), small_start=small_start, moving=("X",), names=("X",)
    )
    critical = Critical(HOPF, 1e-6, "X", 100.0, True)
    linear = Branches(
        tuple(point(value) for value in sorted({*values, *np.arange(0.1, max(highest, *values), 0.25)})),
        (),
        (critical,),
    )
    return LinearOnset(None, Variation("v", "N", values), family, None, linear, IntegratorOptions(9.0, 1e-6))  # pyright: ignore[reportArgumentType]


def test_starts_of_every_value_run_the_largest_first_and_each_value_is_kept_once_it_is_complete(world):
    kept: list[list[float]] = []
    search = _Search(predicted(1.0, 4.0, 6.0), lambda rows: kept.append([r.value for r in rows]), lambda *_: None)
    search.from_disturbances()
    first = [("small", 0.1), ("disturbance X 8", 8.0), ("disturbance Y 12", 12.0)]
    rest = [("disturbance X 1", 1.0), ("disturbance X 2", 2.0), ("disturbance X 4", 4.0)]
    rest += [("disturbance Y 1.5", 1.5), ("disturbance Y 3", 3.0), ("disturbance Y 6", 6.0)]
    # Where steady sliding is unstable a size within the contact boundaries, below 2, is only another small one.
    above = [each for each in rest if each[1] > 2]
    ran = [(value, (name, size)) for value, name, size, rounds in world.ran if rounds == Criteria.persistent]
    values = [1.0, 4.0, 6.0]
    assert ran == [(v, each) for v in values for each in first] + [
        (v, each) for v in values for each in (rest if v < HOPF else above)
    ]
    assert kept == [[1.0], [1.0, 4.0], [1.0, 4.0, 6.0]]
    # What is found by then is known to the other starts.
    assert [motion.start for motion in world.known[1][4.0]] == ["disturbance Y 12", "disturbance X 8"]
    assert [len(row.starts) for row in search.rows] == [9, 9, 6]
    assert [row.kind for row in search.rows] == [RangeKind.STABLE, RangeKind.BISTABLE, RangeKind.SQUEALS]
    assert [each.rms for each in search.rows[1].motions] == [{"X": 10.0}, {"X": 1.08}]


def test_starts_of_more_values_than_run_at_once_run_eight_at_a_time(world):
    values = tuple(np.linspace(1.0, 2.0, 10).tolist())
    search = _Search(predicted(*values), lambda rows: None, lambda *_: None)
    search.from_disturbances()
    order = list(dict.fromkeys(value for value, name, *_ in world.ran if name == SMALL_START))
    assert order == list(values)
    last_of_first = max(k for k, ran in enumerate(world.ran) if ran[0] == values[7])
    assert min(k for k, ran in enumerate(world.ran) if ran[0] == values[8]) == last_of_first + 1


def test_values_without_steady_sliding_and_stretches_without_a_value_have_their_rows(world):
    search = _Search(predicted(0.2, 1.0, 4.9, highest=8.0), lambda rows: None, lambda *_: None)
    search.from_disturbances()
    # 5.1 … 7.85 is unstable and was not asked for: one in its middle is.
    assert [(row.value, row.asked) for row in search.rows] == [
        (0.2, True), (1.0, True), (4.9, True), (pytest.approx(6.35), False)
    ]  # fmt: skip
    assert search.rows[0].kind is RangeKind.NOWHERE
    assert search.rows[0].starts == ()


def test_a_small_perturbation_that_squeals_is_made_smaller_three_times(world):
    value = HOPF - 0.03 * (HOPF - FOLD) / 5  # where 0.03 is enough, and 0.1 too much
    search = _Search(predicted(1.0, value), lambda rows: None, lambda *_: None)
    search.from_disturbances()
    (row,) = [row for row in search.rows if row.value == value]
    assert [each.start for each in row.starts if each.disturbance is None] == [
        "0.1 of the contact boundary",
        SMALL_START,
    ]
    assert row.small is not None
    assert row.small.leads_to is Kind.DECAYS
    (squealing,) = [each for each in row.starts if each.start.startswith("0.1")]
    assert squealing.motion is not None
    assert squealing.motion.start == squealing.start
    assert [(name, size) for at, name, size, _ in world.ran if at == value and name == SMALL_START] == [
        (SMALL_START, 0.1), (SMALL_START, pytest.approx(0.01))
    ]  # fmt: skip
    nearest = HOPF - 1e-9
    search = _Search(predicted(1.0, nearest), lambda rows: None, lambda *_: None)
    search.from_disturbances()
    (row,) = [row for row in search.rows if row.value == nearest]
    names = [each.start for each in row.starts if each.disturbance is None]
    assert names == [f"{size} of the contact boundary" for size in ("0.1", "0.01", "0.001")] + [SMALL_START]
    sizes = [size for at, name, size, _ in world.ran if at == nearest and name == SMALL_START]
    assert sizes == pytest.approx([0.1, 0.01, 0.001, 1e-4])


def test_motions_go_over_to_neighbours_in_larger_and_larger_sizes_as_far_as_they_last(world):
    values = (1.0, 2.5, 3.0, 3.6, 4.2, 4.6, 6.0)
    search = _Search(predicted(*values), lambda rows: None, lambda *_: None)
    search.from_disturbances()
    world.ran.clear()
    search.from_neighbours()
    ran = [(value, name) for value, name, _, rounds in world.ran if rounds == Criteria.persistent]
    # Both are known at 3.6 and 4.2; B, which lasts from 2.6 on, was found at 3.0, and A only where it is.
    a, b = {4.6: ["A"], 4.2: ["A", "B"], 3.6: ["A", "B"], 3.0: ["B"]}, 2.5
    for value, names in a.items():
        (row,) = [row for row in search.rows if row.value == value]
        assert {100.0: "A", 300.0: "B"}.keys() >= {each.frequency_Hz for each in row.motions}
        assert sorted({100.0: "A", 300.0: "B"}[each.frequency_Hz or 0] for each in row.motions) == names
    times = ["from 3", "1.2 times from 3", "1.5 times from 3"]
    assert [name for value, name in ran if value == b] == times  # quiet there, whatever the size
    assert [name for value, name in ran if value == 4.6] == ["from 4.2"]  # B, which ends: it squeals there anyway
    assert [name for value, name in ran if value == 3.0] == ["from 3.6"]  # A
    assert [name for value, name in ran if value in (3.6, 4.2, 1.0)] == []
    assert [name for value, name in ran if value == 6.0] == []  # it has A, and 4.6 has nothing else
    sizes = [size for value, name, size, _ in world.ran if value == b and "from 3" in name]
    assert sizes == pytest.approx([20.0, 24.0, 30.0])
    (row,) = [row for row in search.rows if row.value == 4.6]
    assert next(each for each in row.starts if each.start == "from 4.2").from_value == 4.2
    world.ran.clear()
    search.from_neighbours()
    assert world.ran == []


def test_a_family_squeals_from_its_fold_to_its_hopf_point_and_beyond(world):
    """A ends at 3.37, beside which it seems to last: ten rounds show that it does not. B ends at 2.6, and A is known
    at 4.0 by its own start."""
    seen: list[Any] = []
    study = compare(predicted(1.0, 2.0, 3.3, 4.0, 6.0), 1e-3, keep=seen.append)
    assert [each.kind for each in study.ranges] == [RangeKind.STABLE, RangeKind.BISTABLE, RangeKind.SQUEALS]
    stable, bistable, squeals = study.ranges
    assert (stable.first, squeals.last) == (1.0, 6.0)
    assert (squeals.first, squeals.first_uncertainty) == (HOPF, 1e-6)
    assert abs(bistable.first - 2.6) <= 0.005 * 1.001
    assert bistable.first_uncertainty == pytest.approx(0.005, rel=0.01)
    assert (study.bistable_range_sought_within, study.smallest_disturbance_sought, study.coordinates) == (
        1e-3,
        False,
        ("X",),
    )
    assert study.outcome == "complete"
    assert all(each.outcome != "complete" for each in seen)
    (ghost,) = [row for row in study.values if row.value == 3.3]
    assert [each.frequency_Hz for each in ghost.motions] == [300.0]
    # It seemed to last, for 0.3 s, and 1 s more show that it decays.
    carried = [each for each in ghost.starts if each.from_value == 4.0 and each.simulated_s > 1]
    assert [(each.leads_to, each.motion is None, each.simulated_s) for each in carried] in (
        [(Kind.DECAYS, True, pytest.approx(1.3))], []
    )  # fmt: skip
    # Ends are closed in by thirds: two values at a time.
    tried = sorted(row.value for row in study.values if not row.asked)
    assert sum(2.0 < value < 3.3 for value in tried) == 2 * math.ceil(math.log(1.3 / 0.005, 3))
    assert min(abs(value - 2.6) for value in tried) < 0.005


def test_squeal_right_next_to_a_critical_value_is_looked_for_and_its_end_found(world):
    """Without a value between the fold and the Hopf point, A is found a thousandth beside that, on the stable side."""
    for values in ((1.0, 2.0, 6.0), (6.0, 2.0, 1.0)):
        study = compare(predicted(*values), 1e-3)
        assert [each.kind for each in study.ranges] == [RangeKind.STABLE, RangeKind.BISTABLE, RangeKind.SQUEALS]
        assert abs(study.ranges[1].first - FOLD) <= 0.005 * 1.001
        assert any(row.value == pytest.approx(HOPF - 0.005) for row in study.values)


def test_a_row_next_to_a_critical_value_is_tried_on_the_stable_side_alone(world, monkeypatch):
    tried: list[Any] = []
    search = _Search(predicted(1.0, 6.0), lambda rows: None, lambda *_: None)
    monkeypatch.setattr(search, "_try", lambda values, source: tried.append((values, source.value)))
    search.from_disturbances()
    low, high = search.rows
    search._look_next_to_critical(low, high, 0.1)
    search._look_next_to_critical(high, low, 0.1)
    assert tried == [([pytest.approx(4.9)], 6.0)]
    search._look_next_to_critical(low, high, 4.1)  # beyond the stable row
    assert len(tried) == 1
    near = Row.at(point(4.9), asked=True)
    search._look_next_to_critical(near, high.model_copy(update={"starts": ()}), 1e-3)  # without a motion
    assert len(tried) == 1
    upper = high.model_copy(update={"value": 9.0, "unstable": False, "starts": ()})
    lower = high.model_copy(update={"value": 4.0})
    search._look_next_to_critical(lower, upper, 0.1)
    assert tried[1:] == [([pytest.approx(5.1)], 4.0)]
    search._look_next_to_critical(high, upper, 0.1)  # no critical value lies between
    assert len(tried) == 2


def test_an_end_that_is_undecided_is_closed_in_no_further(world, monkeypatch):
    search = _Search(predicted(1.0, 4.0), lambda rows: None, lambda *_: None)
    search.from_disturbances()
    asked: list[list[float]] = []

    def try_at(values, source):
        asked.append([round(value, 6) for value in values])
        assert source.strongest
        return [SimpleNamespace(value=v, kind=kind_at(v), strongest=True) for v in values]

    def kind_at(value: float) -> RangeKind:
        return RangeKind.BISTABLE if value > 2.7 else undecided if value > 2.2 else RangeKind.STABLE

    monkeypatch.setattr(search, "_try", try_at)
    a: Any = SimpleNamespace(value=4.0, kind=RangeKind.BISTABLE, strongest=True)
    b: Any = SimpleNamespace(value=1.0, kind=RangeKind.STABLE, strongest=True)
    undecided = RangeKind.UNDECIDED
    search._close_in(a, b, 0.02)
    assert asked == [[3.0, 2.0], [round(3 - 1 / 3, 6), round(3 - 2 / 3, 6)]]
    asked.clear()
    undecided = RangeKind.BISTABLE  # then 2.2 it is
    search._close_in(a, b, 0.02)
    assert len(asked) == math.ceil(math.log(3 / 0.02, 3))
    assert min(abs(v - 2.2) for each in asked for v in each) <= 0.02
    asked.clear()
    a.strongest = None
    search._close_in(a, b, 0.02)
    assert asked == []


def test_what_a_row_tries_elsewhere_goes_on_where_it_did_not_last_in_larger_sizes(world):
    search = _Search(predicted(1.0, 4.0), lambda rows: None, lambda *_: None)
    search.from_disturbances()
    world.ran.clear()
    source = search.rows[-1]
    first, second = search._try([3.5, 2.0], source)
    ran = [(value, name, rounds) for value, name, _, rounds in world.ran]
    assert ran[:2] == [
        (3.5, "from 4", Criteria.lasting),
        (2.0, "from 4", Criteria.lasting),
    ]  # the strongest, B, once lasts at 3.5
    assert ran[2:] == [
        (2.0, f"{times}from 4", Criteria.lasting)
        for times in ("1.2 times ", "1.5 times ", "", "1.2 times ", "1.5 times ")
    ]
    assert (first.kind, second.kind, first.asked, second.asked) == (RangeKind.BISTABLE, RangeKind.STABLE, False, False)
    assert [size for value, _, size, _ in world.ran if value == 2.0] == pytest.approx([20, 24, 30, 7.5, 9, 11.25])


def test_motions_that_are_nearly_alike_are_run_on_to_tell_them_apart(world, monkeypatch):
    asked: list[Any] = []
    search = _Search(predicted(1.0, 4.0), lambda rows: None, lambda *_: None)
    search.from_disturbances()
    monkeypatch.setattr(search, "_run_on", lambda what, motions: asked.append((what, motions)))
    search._tell_apart()
    assert asked.pop() == ("telling motions apart", [])  # of what is alone, or unlike the others, nothing
    row = search.rows[-1]
    twin = motion("A", 4.0, 3.0, "twin").model_copy(update={"rms": {"X": 1.2}, "kinetic_energy_J": 1.2**2})
    more = row.starts[0].model_copy(update={"motion": twin, "leads_to": Kind.SQUEALS})
    search._rows[4.0] = row.model_copy(update={"starts": (*row.starts, more)})
    search._tell_apart()
    ((what, alike),) = asked
    assert what == "telling motions apart"
    assert {(each.value, a.rms["X"]) for each, a in alike} == {(4.0, 1.2), (4.0, 1.08)}


def test_a_motion_that_is_run_on_takes_what_became_of_it_and_is_run_on_once(world, monkeypatch):
    search = _Search(predicted(1.0, 3.3, 4.0), lambda rows: None, lambda *_: None)
    monkeypatch.setattr(search, "_tell_apart", lambda: None)
    search.from_disturbances()
    (row,) = [row for row in search.rows if row.value == 3.3]
    assert len(row.motions) == 2  # the ghost of A, and B
    told = [(row, each) for each in row.motions]
    assert search._run_on("so", told)
    (row,) = [row for row in search.rows if row.value == 3.3]
    assert [each.frequency_Hz for each in row.motions] == [300.0]
    ended = {each.start: each for each in row.starts if each.simulated_s > 1}
    assert set(ended) == {"disturbance X 8", "disturbance Y 12", "disturbance Y 6"}  # A takes 5.2
    assert ended["disturbance X 8"].leads_to is Kind.DECAYS
    assert ended["disturbance Y 12"].motion is not None
    assert ended["disturbance Y 12"].motion.start == "disturbance Y 12"
    assert all(each.simulated_s == pytest.approx(1.3) for each in ended.values())
    assert not search._run_on("so", [(row, row.motions[0])])
