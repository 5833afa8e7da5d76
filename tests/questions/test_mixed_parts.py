"""Modes along a sweep, cells of a matrix, disturbances of a brake and rivals of a fit, against sums written out."""

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import xarray

from drumsqueal.dynamics.cycles import branches
from drumsqueal.dynamics.cycles.branches import DiagramBuilder
from drumsqueal.dynamics.cycles.cycle import BranchEnd, Event
from drumsqueal.dynamics.ensemble import PerturbationDirection, Start
from drumsqueal.errors import CycleError
from drumsqueal.findings.kinds import Kind
from drumsqueal.questions.fit.study import _Result
from drumsqueal.questions.sensitivity import disturbing
from drumsqueal.questions.sensitivity.disturbing import DisturbedSqueal, Disturber, Trial, squealing
from drumsqueal.questions.sweep import figure
from drumsqueal.questions.sweep.figure import OTHER_MODE, OTHER_NAME, _distances, _meet, end_of, modes_along
from drumsqueal.questions.sweep.matrix_cells import REFERENCE, _cell
from drumsqueal.scene import Scene

# --- modes along one number ------------------------------------------------------------------------------------------


def sweep_of(values, numbers, coordinate: Any = 0, in_plane: Any = 1) -> xarray.Dataset:
    """A sweep of eigenvalues (points, modes), whose modes are those of the scene by their numbers, −1 for none."""
    values, shape = np.asarray(values, dtype=complex), np.shape(values)
    columns = {
        "growth_rate": values.real, "frequency": values.imag / (2 * np.pi), "mode_number": np.asarray(numbers),  # pyright: ignore[reportAttributeAccessIssue]
        "mode_coordinate": np.broadcast_to(np.asarray(coordinate), shape).copy(),
        "mode_in_plane": np.broadcast_to(np.asarray(in_plane), shape).copy(),
    }  # fmt: skip
    return xarray.Dataset({name: (("point", "mode"), each) for name, each in columns.items()})


def distances(values, numbers, k=1, before=(0, 1), now=(0, 1), **more):
    sweep = sweep_of(values, numbers, **more)
    own = sweep["mode_number"].values
    return _distances(sweep, np.asarray(values, dtype=complex), own, k, np.array(before), np.array(now))


def test_modes_are_apart_by_their_eigenvalues_over_their_size():
    values = [[1 + 10j, 2 + 40j], [1 + 12j, 1 + 44j]]
    own = np.abs(np.subtract.outer(np.array(values[0]), np.array(values[1])))
    size = np.maximum.outer(np.abs(values[0]), np.abs(values[1]))
    none = np.full((2, 2), -1)
    np.testing.assert_allclose(distances(values, none), own / size)
    # Another name counts where there is but one point before, and modes of another plane are others.
    names = [[0, 1], [0, 0]]
    np.testing.assert_allclose(
        distances(values, none, coordinate=names), own / size + OTHER_NAME * np.array([[0, 0], [1, 1]])
    )
    planes = [[1, 0], [1, -1]]
    wanted = own / size
    wanted[1, 0] = OTHER_MODE
    np.testing.assert_allclose(distances(values, none, in_plane=planes), wanted)


def test_modes_of_the_scene_are_told_by_their_numbers_the_first_too():
    values = [[1 + 10j, 2 + 40j], [1 + 12j, 1 + 44j]]
    found = distances(values, [[0, 1], [1, 0]])
    np.testing.assert_array_equal(found, [[OTHER_MODE, 0], [0, OTHER_MODE]])
    found = distances(values, [[0, 1], [0, -1]])
    assert found[0, 0] == 0
    assert found[1, 0] == OTHER_MODE
    assert found[1, 1] == pytest.approx(abs(1 - 4j) / abs(1 + 44j))


def test_from_two_points_on_the_next_eigenvalue_is_expected_in_line():
    values = [[10j, 40j], [13j, 39j], [16j, 37j]]
    numbers = np.array([[7, 8], [7, 8], [-1, -1]])
    sweep = sweep_of(values, np.full((3, 2), -1), coordinate=[[0, 1], [0, 1], [1, 0]])
    found = _distances(sweep, np.array(values), numbers, 2, np.array([0, 1]), np.array([0, 1]))
    np.testing.assert_allclose(found, [[0, 21 / 37], [22 / 39, 1 / 39]])


def test_modes_are_followed_where_they_go_on_and_end_where_they_are_no_more(monkeypatch):
    def modes_in(sweep):
        numbers = sweep["mode_number"].values
        return {f"mode {k}": numbers == k for k in np.unique(numbers[numbers >= 0])}

    monkeypatch.setattr(figure, "modes_in", modes_in)
    nan = complex(np.nan, np.nan)
    values = [[10j, 40j, nan], [12j, 42j, 300j], [14j, nan, 310j]]
    found = modes_along(sweep_of(values, np.full((3, 3), -1)))
    assert len(found) == 3
    for (_, along), k in zip(found, range(3), strict=True):
        np.testing.assert_allclose(along, np.array(values)[:, k])
    assert [end_of(along) for _, along in found] == [2, 1, 2]
    assert _meet(np.array([[1, 2], [3, 1]]), 1, 2)
    assert not _meet(np.array([[1, 2], [3, 1]]), 2, 3)


# --- keys of a brake -------------------------------------------------------------------------------------------------


def test_a_number_of_one_shoe_has_the_key_of_its_own_table_or_the_shared_one():
    shoes = [SimpleNamespace(support=None, contact=object()), SimpleNamespace(support=object(), contact=None)]
    brake: Any = SimpleNamespace(several=True, prefixes=("a.", "b."), shoes=shoes)

    def key_of(shoe: int, key: str) -> str:
        return Scene.key_of(brake, shoe, key)

    assert key_of(1, "start.displacement.X") == "start.displacement.b.X"
    assert key_of(1, "start.displacement.drum.C2") == "start.displacement.drum.C2"
    assert key_of(1, "shoe.width") == "shoe.1.width"
    assert key_of(0, "contact.stiffness") == "shoe.0.contact.stiffness"
    assert key_of(1, "contact.stiffness") == "contact.stiffness"
    assert key_of(1, "drum.speed") == "drum.speed"
    brake.several = False
    assert key_of(0, "shoe.width") == "shoe.width"


# --- cells of a matrix -----------------------------------------------------------------------------------------------


def test_a_cell_has_its_level_over_a_nanometre_a_second_and_says_after_what():
    plan: Any = SimpleNamespace(levels=lambda number: {"speed": f"level {number}"})
    names = ("squeal", "outcome", "after", "unstable", "along")
    numbers = ("growth_rate", "frequency", "velocity", "time", "speed", "small_frequency", "small_velocity")
    columns = {name: np.array([0, 0]) for name in names}
    columns |= {name: np.array([k + 1.0, k + 0.5]) for k, name in enumerate(numbers)}
    columns |= {"velocity": np.array([0.02, 0.0]), "along": np.array([1, -1]), "unstable": np.array([-1, 1])}
    found = [_cell(columns, plan, k, ["X", "Tz"]) for k in range(2)]
    assert found[0].level_dB == pytest.approx(20 * math.log10(0.02 / REFERENCE))
    assert found[0].level_dB > 0
    assert math.isnan(found[1].level_dB)
    assert [each.unstable for each in found] == [None, True]
    assert found[1].levels == {"speed": "level 1"}
    assert (found[1].growth_rate_1_per_s, found[1].frequency_Hz, found[1].time_s) == (0.5, 1.5, 3.5)
    assert (found[1].speed_rad_per_s, found[1].small_frequency_Hz, found[1].small_velocity_m_per_s) == (4.5, 5.5, 6.5)


# --- disturbances ----------------------------------------------------------------------------------------------------


def motion(energy: float, kind: str) -> Any:
    return SimpleNamespace(kinetic_energy_J=energy, kind=kind, like=lambda other: other.kind == kind)


def trial(energy: float = 0.0, kind: str | None = None, leads=Kind.DECAYS, **at: float) -> Any:
    return SimpleNamespace(at=at, motion=None if kind is None else motion(energy, kind), leads_to=leads)


def test_squeals_that_differ_are_told_apart_at_each_operating_point_the_loudest_first():
    trials = (trial(1.0, "a"), trial(), trial(3.0, "a"), trial(2.0, "b"), trial(0.5, "a", speed=2.0))
    assert squealing(trials) == (trials[3], trials[0], trials[4])


def test_a_brake_is_quiet_where_it_is_stable_at_every_point_and_all_decays():
    calm, grows, none = (
        SimpleNamespace(reason=reason, unstable=unstable) for reason, unstable in (("", []), ("", ["X"]), ("lifts", []))
    )
    squeals = next(each for each in Kind if each is not Kind.DECAYS)
    decays, goes_on = (Trial.model_construct(at={}, leads_to=leads, motion=None) for leads in (Kind.DECAYS, squeals))
    for points, trials, stable, quiet in (
        ((calm, calm), (decays,), True, True),
        ((calm, grows), (decays,), False, False),
        ((none, calm), (decays,), False, False),
        ((calm,), (decays, goes_on), True, False),
    ):
        judged = DisturbedSqueal.of(points, trials)  # pyright: ignore[reportArgumentType]
        assert (judged.steady_sliding_stable, judged.quiet) == (stable, quiet)


def test_random_disturbances_have_every_mode_in_a_size_between_the_least_and_the_largest():
    shapes = {"a": np.array([[1.0, 0.0], [0.0, 0.0]]), "b": np.array([[0.0, 0.0], [0.0, 1.0]])}
    reach = {"a": [2.0, 8.0], "b": [5.0], "c": []}
    family: Any = SimpleNamespace(
        model_at=lambda value: value,
        vibrations=lambda point: list(reach),
        reach=lambda mode, model: (shapes.get(mode, np.zeros((2, 2))), reach[mode]),
    )
    starts = disturbing._random_starts(family, SimpleNamespace(value=1.0))  # pyright: ignore[reportArgumentType]
    assert len(starts) == disturbing.RANDOM
    assert [each.start.name for each in starts[:2]] == ["random 1", "random 2"]
    one = np.abs([each.start.vibration[0] for each in starts])
    other = np.abs([each.start.velocity[1] for each in starts])
    assert one.max() <= PerturbationDirection.largest / 2.0
    assert other.max() <= PerturbationDirection.largest / 5.0
    # Sizes are drawn evenly by their logarithm, from the least one on; the phase takes some of it.
    least, large = PerturbationDirection.smallest, PerturbationDirection.largest
    for sizes, low, high in ((one, least / 8, large / 2), (other, least / 5, large / 5)):
        middle = np.median(np.log(sizes))
        assert np.log(low) < middle < np.log(high)
        assert abs(middle + np.log(2) / 2 - (np.log(low) + np.log(high)) / 2) < 0.25 * np.log(high / low)
    family.reach = lambda mode, model: (np.zeros((2, 2)), [])
    assert disturbing._random_starts(family, SimpleNamespace(value=1.0)) == []  # pyright: ignore[reportArgumentType]


def test_a_mode_is_disturbed_both_ways_but_for_the_largest_forwards(monkeypatch):
    made = [
        SimpleNamespace(
            mode=SimpleNamespace(label="X"), forwards=forwards, sizes=(1.0, 2.0, 4.0),
            disturbance=lambda size: SimpleNamespace(energy_J=size**2 / 2),
            start=lambda size: Start("", np.zeros(1), np.array([size])),
        )
        for forwards in (True, False)
    ]  # fmt: skip
    monkeypatch.setattr(disturbing, "directions", lambda point, family: made)
    nothing: Any = None
    found = disturbing._both_ways(nothing, nothing)
    assert [each.start.name for each in found] == [
        "X forwards, 0.5 J", "X forwards, 2 J", "X backwards, 0.5 J", "X backwards, 2 J", "X backwards, 8 J",
    ]  # fmt: skip


def test_the_fastest_mode_is_sampled_two_and_a_half_times_and_slow_brakes_run_apart(monkeypatch):
    disturber = object.__new__(Disturber)
    simulate = SimpleNamespace(sample_rate=1000.0, tolerance=1e-6, solver="auto")
    disturber._scene = SimpleNamespace(simulate=simulate)  # pyright: ignore[reportAttributeAccessIssue]
    monkeypatch.setattr(disturbing, "round_seconds", lambda points, moving: max(each.seconds for each in points))

    def point(seconds: float, *frequencies: float) -> Any:
        modes = [SimpleNamespace(frequency_Hz=each) for each in frequencies]
        return SimpleNamespace(seconds=seconds, vibrations=modes)

    family: Any = SimpleNamespace(moving=("X",))
    points = [point(0.1, 100, 300), point(0.12, 500), point(0.3, 50)]
    asked = []

    def attractors(family, some, how, *, progress):
        asked.append((how.sample_rate, how.round_seconds, [start for _, start in some]))
        return [f"response {start}" for _, start in some]

    monkeypatch.setattr(disturbing, "find_attractors", attractors)
    tasks: Any = [(points[0], 0), (points[2], 1), (points[1], 2)]
    assert list(disturber._responses(family, tasks, lambda *_: None)) == ["response 0", "response 2", "response 1"]  # pyright: ignore[reportArgumentType]
    assert asked == [(1250.0, 0.12, [0, 2]), (1000.0, 0.3, [1])]


# --- a fit -----------------------------------------------------------------------------------------------------------


def test_a_number_is_determined_where_every_rival_has_it_within_its_uncertainty():
    own = SimpleNamespace(
        x=np.array([1.0, 2.0, 3.0]), errors=np.array([0.1, 0.2, 0.1]), factor_95=2.0,
        determined=np.array([True, True, False]),
    )  # fmt: skip
    near, far = (SimpleNamespace(x=own.x + off) for off in ([0.19, -0.39, 0.0], [0.0, 0.41, 0.0]))
    known: dict[str, Any] = {"estimate": own, "lines": (), "observations": 3}
    assert _Result(**known).determined.tolist() == [True, True, False]
    assert _Result(**known, rivals=(near,)).determined.tolist() == [True, True, False]  # pyright: ignore[reportArgumentType]
    assert _Result(**known, rivals=(near, far)).determined.tolist() == [True, False, False]  # pyright: ignore[reportArgumentType]
    assert _Result(**known, known=False).determined.tolist() == [False] * 3


# --- branches --------------------------------------------------------------------------------------------------------


class Diagram:
    """One of branches by their names."""

    def __init__(self, names: tuple[Any, ...], notes: tuple[str, ...] = ()) -> None:
        self.branches, self.notes, self.not_followed = names, notes, ()

    def model_copy(self, update: dict[str, Any]) -> Any:
        made = Diagram(self.branches, self.notes)
        made.__dict__.update(self.__dict__ | update)
        return made


def branch(name: str, *meeting: float, start: BranchEnd = BranchEnd.HOPF, what: Event = Event.DOUBLING) -> Any:
    special = [SimpleNamespace(value=each, what=what) for each in meeting]
    return SimpleNamespace(name=name, start=start, cycles=special, special=special, meeting=lambda: special)


def added(self: DiagramBuilder, new: Any) -> bool:
    self._update(branches=(*self.diagram.branches, new))
    return True


def test_what_meets_a_new_branch_is_followed_where_it_is_on_no_other(monkeypatch):
    monkeypatch.setattr(branches, "_meet", lambda one, other, width: abs(one.value - other.value) < 0.01 * width)

    monkeypatch.setattr(DiagramBuilder, "_add", added)
    asked, kept = [], []

    def meeting(cycle, keep):
        asked.append(cycle.value)
        if cycle.value == 5.0:
            raise CycleError("lost")
        keep(branch("partly"))
        return branch(f"of {cycle.value}")

    family: Any = SimpleNamespace(low=0.0, high=10.0, width=10.0, meeting=meeting)
    start: Any = Diagram((branch("first", 2.0), branch("second", 9.0)))
    new = branch("new", 1.0, 2.05, 5.0, 7.0)

    def follow(keep) -> Any:
        keep(branch("part"))
        return new

    built = DiagramBuilder(family, start, on_diagram=lambda diagram: kept.append(diagram.branches))
    built._follow("here", follow)
    found: Any = built.diagram
    assert asked == [1.0, 5.0, 7.0]
    assert [each.name for each in found.branches] == ["first", "second", "new", "of 1.0", "of 7.0"]
    assert [[each.name for each in names][-1] for names in kept] == ["part", "partly", "partly"]


@pytest.mark.parametrize(
    ("start", "what", "third", "names"),
    [
        (BranchEnd.LOOP, Event.DOUBLING, 1.03, ["first", "second", "third", "fourth"]),
        (BranchEnd.DOUBLING, Event.DOUBLING, 1.04, ["first", "second", "third", "fourth"]),
        (BranchEnd.DOUBLING, Event.PITCHFORK, 1.03, ["first", "second", "third", "fourth"]),
        # All further doublings would lie between 1.03 and 1.03 + 0.03/(4.67 − 1), less than a thousandth of the range.
        (BranchEnd.DOUBLING, Event.DOUBLING, 1.03, ["first", "second"]),
    ],
)
def test_a_branch_that_another_one_meets_is_followed_as_that_one_is(monkeypatch, start, what, third, names):
    monkeypatch.setattr(branches, "_meet", lambda one, other, width: one.value == other.value)
    monkeypatch.setattr(DiagramBuilder, "_add", added)
    on = {
        1.0: branch("second", 1.0, third, start=start, what=what),
        third: branch("third", third, 3.0),
        3.0: branch("fourth"),
    }
    family: Any = SimpleNamespace(low=0.0, high=10.0, width=10.0, meeting=lambda cycle, keep: on[cycle.value])
    empty = cast("Any", Diagram(()))
    built = DiagramBuilder(family, empty)
    built._follow("here", lambda keep: branch("first", 1.0, start=start))
    found: Any = built.diagram
    assert [each.name for each in found.branches] == names


def test_a_branch_takes_the_place_of_its_parts_and_is_left_where_it_is_one(monkeypatch):
    monkeypatch.setattr(branches, "repeats", lambda one, other, between: one.name in other.name and one is not other)
    monkeypatch.setattr(branches, "_aligned", lambda branch, others, width: branch)
    monkeypatch.setattr(branches, "_left_behind", lambda those, family: [f"left by {each.name}" for each in those])
    family: Any = SimpleNamespace(low=0.0, high=1.0, width=1.0, between=None)
    start: Any = Diagram((branch("a"), branch("xyz")))
    built = DiagramBuilder(family, start)
    assert not built._add(branch("y"))
    assert built.diagram is start
    start.not_followed = ("left by a", "left by xyz", "else")
    assert built._add(branch("abc"))
    found = built.diagram
    assert [each.name for each in found.branches] == ["xyz", "abc"]  # pyright: ignore[reportAttributeAccessIssue]
    assert found.not_followed == ("else", "left by xyz", "left by abc")
