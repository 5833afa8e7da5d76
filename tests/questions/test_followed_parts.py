"""Cycles of a scene along one of its numbers: what begins where, in which order, and what is reported on the way."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.dynamics.cycles import branches
from drumsqueal.dynamics.cycles.cycle import BranchEnd, Cycle, CycleBranch, Diagram
from drumsqueal.dynamics.cycles.search import Seed
from drumsqueal.errors import CycleError, Ending
from drumsqueal.questions.cycle import study
from drumsqueal.questions.cycle.study import CycleBranches
from drumsqueal.questions.sensitivity import answer as sensitivity_words
from drumsqueal.questions.sensitivity import stabilising
from drumsqueal.solve.linear.branches import Branches, Critical


def cycle(value: float, frequency: float, **more: Any) -> Cycle:
    known: dict[str, Any] = {
        "period_s": 1 / frequency, "amplitude": {"X": 1e-5}, "main_coordinate": "X", "unit_multiplier_error": 0.0,
        "multipliers": np.array([0.5 + 0j]), "tangent_error": 0.0, "residual": 0.0, "contact_fraction": 1.0,
        "slip_reversed_fraction": 0.0, "displacement": {"X": 0.0}, "velocity": {"X": 0.0}, "value": value,
        "model": SimpleNamespace(mass=np.array([1.0])),
    }  # fmt: skip
    return Cycle(**(known | more))


CRITICAL = Critical(5.0, 1e-6, "X", 100.0, True)
EMPTY = Diagram(
    linear=Branches((), (), (CRITICAL,)), branches=(), steady_sliding_stable=((1.0, 5.0),),
    steady_sliding_unstable=((5.0, 9.0),),
)  # fmt: skip


@pytest.fixture
def followed(monkeypatch) -> dict[str, Any]:
    """What following a scene asks for, along a drum speed from 1 to 9 rad/s."""
    seen: dict[str, Any] = {"progress": [], "kept": []}

    def of(model_at, low, high, *, progress, on_diagram):
        seen["range"] = low, high
        progress("eigenvalues", 1.0, 2.0)

        def from_hopf_points():
            for count in range(1, 13):
                on_branch = tuple(cycle(1.0 + 0.25 * k, 100.0) for k in range(count))
                found = (CycleBranch(start=BranchEnd.HOPF, end=BranchEnd.CUT_OFF, cycles=on_branch),)
                built.diagram = EMPTY.model_copy(update={"branches": found})
                on_diagram(built.diagram)
            progress("more")

        def from_seeds(seeds):
            seen["seeds"] = seeds
            progress("seeds")

        built = SimpleNamespace(
            diagram=EMPTY, from_hopf_points=from_hopf_points, from_seeds=from_seeds,
            from_cycle=lambda found, kind: seen["own"].append((found.value, found.frequency_Hz, kind)),
            note=lambda note: seen["own"].append(note),
        )  # fmt: skip
        return built

    def search(transient, progress):
        seen["own"] = []
        progress("own")
        if seen["lost"]:
            raise CycleError("so")
        return [cycle(math.nan, 70.0), cycle(math.nan, 90.0)], "settles"

    seen["lost"] = False
    monkeypatch.setattr(study, "checked_range", lambda scene, variation: None)
    monkeypatch.setattr(study, "constant_transient", lambda scene: None)
    monkeypatch.setattr(study, "search", search)
    monkeypatch.setattr(study, "DiagramBuilder", SimpleNamespace(of=of))
    monkeypatch.setattr(study, "diagram_verdict", lambda diagram, along: f"along {along.key}")
    return seen


@pytest.mark.parametrize("along", ["drum.speed=1..9", "drum.speed=9..1"])
def test_branches_of_a_scene_begin_at_hopf_points_then_at_its_own_cycle_and_at_seeds(nominal, followed, along):
    seeds = [Seed(2.0, {})]
    found = study.follow_cycles(
        nominal, along, seeds=seeds, progress=lambda *given: followed["progress"].append(given),
        keep=followed["kept"].append,
    )  # fmt: skip
    assert isinstance(found, CycleBranches)
    assert (followed["range"], followed["seeds"]) == ((1.0, 9.0), seeds)
    assert followed["own"] == [(5.0, pytest.approx(70.0), "scene's own "), (5.0, pytest.approx(90.0), "scene's own ")]
    assert (found.outcome, found.verdict, found.critical_values) == (Ending.COMPLETE, "along drum.speed", (CRITICAL,))
    assert (found.parameter.low, found.parameter.high, found.scene) == (1.0, 9.0, nominal)
    # Every tenth cycle is kept, from the first on; where it is is said as long as a branch is followed.
    assert [len(each.branches[0].cycles) for each in followed["kept"]] == [1, 11]
    assert {each.outcome for each in followed["kept"]} == {Ending.CUT_OFF}
    assert followed["progress"] == [
        ("eigenvalues", 1.0, 2.0), ("more, branch 1, drum.speed = 3.75 rad/s", 0.0, None), ("own", 0.0, None),
        ("seeds", 0.0, None),
    ]  # fmt: skip
    followed["lost"] = True
    study.follow_cycles(nominal, along)
    assert followed["own"] == ["at the scene's own drum.speed, 5 rad/s: so"]
    followed.pop("own")
    study.follow_cycles(nominal, "drum.speed=6..9")
    assert "own" not in followed  # 5 rad/s lie outside


def test_a_range_that_is_none_is_refused():
    for ends in ((1.0, 1.0), (1.0, math.inf), (math.nan, 2.0)):
        with pytest.raises(ValueError, match="from one finite number to another"):
            study.follow_cycles(lambda value: None, ends)  # pyright: ignore[reportArgumentType, reportCallIssue]
    with pytest.raises(CycleError, match="no cycle was found in this range; a; b"):
        study.found_some(EMPTY.model_copy(update={"notes": ("a", "b")}))  # pyright: ignore[reportArgumentType]
    some: Any = SimpleNamespace(branches=("one",))
    assert study.found_some(some) is some


def test_a_cycle_begins_a_branch_where_it_is_on_none(monkeypatch):
    asked = []

    def follow(self, origin, follow):
        asked.append((origin, follow("on branch")))

    def is_branch_cycle(known, each, between):
        assert between("a", "b") == ("between", 5.0, "a", "b")
        return each.frequency_Hz == pytest.approx(70.0)

    monkeypatch.setattr(branches.DiagramBuilder, "_follow", follow)
    monkeypatch.setattr(branches, "is_branch_cycle", is_branch_cycle)
    family: Any = SimpleNamespace(
        both_ways=lambda cycle, on_branch: ("both", cycle, on_branch), between=lambda *given: ("between", *given)
    )
    built, (one, other) = branches.DiagramBuilder(family, EMPTY), (cycle(5.0, 70.0), cycle(5.0, 90.0))
    built.from_cycle(one, "scene's own ")
    built.from_cycle(other, "scene's own ")
    assert asked == [("from the scene's own cycle of 90 Hz", ("both", other, "on branch"))]


def test_a_branch_ends_at_a_hopf_point_within_a_fiftieth_of_the_range_and_of_its_frequency():
    def ends(
        value: float,
        frequency: float,
        start: BranchEnd = BranchEnd.HOPF,
        end: BranchEnd = BranchEnd.BOUND,
        *,
        low: float = 3.0,
    ) -> bool:
        cycles = (cycle(value, frequency), cycle(value + 2, 50.0))
        if start is not BranchEnd.HOPF:
            cycles = cycles[::-1]
        return branches._ends_at(CycleBranch(start=start, end=end, cycles=cycles), CRITICAL, 9.0 - low)

    # Of a range of 6, a fiftieth is 0.12.
    for value, frequency, wanted in (
        (5.11, 100.0, True), (4.89, 100.0, True), (5.13, 100.0, False), (4.87, 100.0, False), (5.0, 101.9, True),
        (5.0, 98.1, True), (5.0, 102.1, False), (5.0, 97.9, False),
    ):  # fmt: skip
        assert ends(value, frequency) == wanted, (value, frequency)
        assert ends(value, frequency, BranchEnd.BOUND, BranchEnd.HOPF) == wanted
        assert not ends(value, frequency, BranchEnd.LOOP, BranchEnd.LOOP)


# --- quiet brakes ----------------------------------------------------------------------------------------------------


def test_where_there_is_no_steady_sliding_every_mode_grows_without_bound():
    problem: Any = stabilising.Problem.__new__(stabilising.Problem)
    problem._own = [0, 2]
    matrix = np.array([[0.0, 1.0], [-900.0, 0.6]])
    derivatives = np.arange(12.0).reshape(3, 2, 2)
    slopes = np.array([2.0, -3.0])
    for lost in ("matrix", "derivatives"):
        bad = np.array(matrix if lost == "matrix" else derivatives)
        bad.flat[1] = np.nan
        problem._evaluate = lambda numbers, bad=bad, lost=lost: (
            (bad, derivatives) if lost == "matrix" else (matrix, bad)
        )
        rates, slope = problem._rates(np.zeros(3), slopes)
        assert rates.tolist() == [stabilising.NOWHERE] * 2
        assert slope.tolist() == [[0.0, 0.0]] * 2
    problem._evaluate = lambda numbers: (matrix, derivatives)
    rates, slope = problem._rates(np.zeros(3), slopes)
    assert rates == pytest.approx([0.3, 0.3])
    # Re λ is half the trace: its derivative is half of that of each derivative, times the slope of the number.
    traces = np.array([np.trace(derivatives[k]) / 2 for k in (0, 2)]) * slopes
    np.testing.assert_allclose(slope, [traces, traces])


def test_changes_are_named_the_largest_first_and_the_smaller_ones_counted():
    def change(key: str, logarithm: float) -> Any:
        return SimpleNamespace(key=key, logarithm=logarithm, before_in_unit=1.0, after_in_unit=1 + logarithm, unit="mm")

    def said(*logarithms: float) -> str:
        changes = [change(f"n{k}", x) for k, x in enumerate(logarithms)]
        return sensitivity_words._changes(SimpleNamespace(changes=changes, scene=None))  # pyright: ignore[reportArgumentType]

    assert said() == "nothing changed"
    assert said(0.1, -0.3) == "n1 changed from 1 to 0.7 mm, n0 changed from 1 to 1.1 mm"
    assert said(0.1, 0.2, 0.3, 0.4).endswith("n1 changed from 1 to 1.2 mm and 1 smaller change")
    assert said(0.1, 0.2, 0.3, 0.4, 0.5).endswith(" and 2 smaller changes")
    assert said(0.1, 0.2, 0.3, 0.4, 0.5).startswith("n4 changed")
