"""Tables that are written as CSV, read back: numbers that differ everywhere stand in their own columns."""

import csv
import io
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray
from rich.console import Console

from drumsqueal.dynamics.attractor import Disturbance, Response, SteadyResponse, VelocityPerturbation
from drumsqueal.dynamics.cycles.cycle import BranchEnd, Cycle, CycleBranch, Event, OffBranch, RangeKind, Unfollowed, Why
from drumsqueal.errors import Ending
from drumsqueal.findings.compare import RelativeChange
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.schema import Parameter
from drumsqueal.questions.accuracy import answer as accuracy_answer
from drumsqueal.questions.accuracy import study as accuracy_study
from drumsqueal.questions.accuracy.study import Errors, Measurement
from drumsqueal.questions.compare import answer as compare_answer
from drumsqueal.questions.compare.study import ComparedMode, MeasuredComparison, MeasuredLine, SimulatedLine
from drumsqueal.questions.cycle import answer as cycle_answer
from drumsqueal.questions.onset import answer as onset_answer
from drumsqueal.questions.onset import found as onset_words
from drumsqueal.questions.onset.found import FollowedMode, Onset, Row, find_ranges
from drumsqueal.questions.sensitivity import answer as sensitivity_answer
from drumsqueal.questions.sensitivity.study import Sensitivity
from drumsqueal.questions.sweep import answer as matrix_answer
from drumsqueal.questions.sweep import matrix_cells as matrix_found
from drumsqueal.questions.sweep.points import LOCKED
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import Critical

NONE = math.nan


def read(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def number(row: dict[str, str], name: str) -> float | None:
    return float(row[name]) if row[name] else None


# --- onset -----------------------------------------------------------------------------------------------------------


def motion(start: str, energy: float, frequency: float | None = None) -> SteadyResponse:
    state = np.array([[energy, 2 * energy], [3 * energy, -energy]])
    return SteadyResponse(
        start=start, amplitude={"X": 1e-5 * energy, "Tz": 1e-4 * energy},
        rms={"X": 0.7e-5 * energy, "Tz": 6e-5 * energy}, frequency_Hz=frequency,
        line_of=None if frequency is None else "Tz", kinetic_energy_J=energy,
        share_of_contact_loss=0.1, share_of_slip_reversal=0.2, drift=0.0, state=state,
    )  # fmt: skip


def disturbance(speed: float, mode: str = "Tz (2)") -> VelocityPerturbation:
    return VelocityPerturbation(
        mode=mode, forwards=True, velocity={"X": speed, "Tz": 0.0}, speed_m_per_s=speed, energy_J=speed**2,
        boundary_ratio=3 * speed,
    )  # fmt: skip


def response(start: str, leads: Kind, seconds: float, **more: Any) -> Response:
    return Response(start=start, leads_to=leads, simulated_s=seconds, outcome="it failed so", **more)


@pytest.fixture
def onset() -> Onset:
    loud, faint = motion("disturbance", 9.0, 400.0), motion("small", 2.0, 300.0)
    smallest = Disturbance(
        **dict(disturbance(0.5, "X")), speed_uncertainty_m_per_s=0.01, energy_uncertainty_J=0.02, leads_to=loud
    )
    rows = (
        Row(value=1.0, asked=True, no_steady_sliding=None, unstable=True, largest_growth_rate_1_per_s=7.0, starts=(
            response("small", Kind.SQUEALS, 1.5, motion=faint),
            response("disturbance", Kind.SQUEALS, 2.5, motion=loud, disturbance=disturbance(2.0)),
            response("disturbance 2", Kind.SQUEALS, 3.5, motion=loud, disturbance=disturbance(1.0)),
        )),
        Row(value=2.0, asked=False, no_steady_sliding=None, unstable=False, largest_growth_rate_1_per_s=-3.0, starts=(
            response("small", Kind.DECAYS, 4.5), response("bad", Kind.FAILED, 0.5),
            response("from 1", Kind.SQUEALS, 5.5, motion=loud, from_value=1.0),
        ), smallest_disturbances=(smallest,)),
        Row(value=4.0, asked=True, no_steady_sliding="it lifts off", unstable=False, largest_growth_rate_1_per_s=NONE),
    )  # fmt: skip
    modes = (FollowedMode(
        label="X (2)", values=(1.0, 2.0), frequency_Hz=(70.0, math.nan), growth_rate_1_per_s=(8.0, -9.0)
    ),)  # fmt: skip
    critical = Critical(value=1.7, uncertainty=0.01, label="Tz (3)", frequency_Hz=50.0, destabilises=False)
    return Onset(
        parameter=Parameter.of(Variation("drum.speed", "rad/s", (4.0, 1.0), "rpm", 2 * math.pi / 60)), modes=modes,
        critical_values=(critical,), bistable_range_sought_within=1e-3, coordinates=("X", "Tz"), values=rows,
    )  # fmt: skip


def test_the_table_of_an_onset_has_its_rows_as_they_were_asked_for(onset):
    rows = read(onset_answer.onset_table(onset))
    assert [number(row, "drum.speed_rpm") for row in rows] == pytest.approx([v * 30 / math.pi for v in (4.0, 2.0, 1.0)])
    assert [row["kind"] for row in rows] == ["no steady sliding", "bistable", "squeals"]
    assert [row["asked"] for row in rows] == ["yes", "no", "yes"]
    assert [number(row, "largest_growth_rate_1_per_s") for row in rows] == [None, -3.0, 7.0]
    assert [number(row, "frequency_X (2)_Hz") for row in rows] == [None, None, 70.0]
    assert [number(row, "growth_rate_X (2)_1_per_s") for row in rows] == [None, -9.0, 8.0]
    assert [row["note"] for row in rows] == ["it lifts off", "bad: it failed so", ""]
    assert [row["motions"] for row in rows] == ["0", "1", "2"]
    nowhere, bistable, squeals = rows
    for start, cells in {
        "small": ("small", "squeals", 2e-5, 2e-4, 300.0, 1.5),
        "strongest": ("disturbance", "squeals", 9e-5, 9e-4, 400.0, 2.5),
    }.items():  # fmt: skip
        assert (squeals[f"{start}_start"], squeals[f"{start}_start_leads_to"]) == cells[:2]
        names = ("amplitude_X_m", "amplitude_Tz_rad", "frequency_Hz", "simulated_s")
        assert [number(squeals, f"{start}_{name}") for name in names] == pytest.approx(cells[2:])
    assert (bistable["small_start_leads_to"], bistable["small_amplitude_X_m"]) == ("decays", "")
    assert (bistable["strongest_start"], number(bistable, "strongest_simulated_s")) == ("from 1", 5.5)
    # Motions by what leads to them: a small perturbation first, and of the disturbances the smallest.
    assert [squeals[f"motion_{k}_after"] for k in (1, 2)] == ["a small perturbation", "1 m/s along Tz (2)"]
    assert [number(squeals, f"motion_{k}_frequency_Hz") for k in (1, 2)] == [300.0, 400.0]
    assert [number(squeals, f"motion_{k}_amplitude_X_m") for k in (1, 2)] == pytest.approx([2e-5, 9e-5])
    assert [number(squeals, f"motion_{k}_disturbance_energy_J") for k in (1, 2)] == [None, 1.0]
    assert bistable["motion_1_after"].endswith("m/s along X")
    assert (number(bistable, "motion_1_disturbance_speed_m_per_s"), bistable["motion_2_after"]) == (0.5, "")
    names = ("speed_m_per_s", "speed_uncertainty_m_per_s", "energy_J", "energy_uncertainty_J", "boundary_ratio")
    assert [number(bistable, f"smallest_disturbance_{name}") for name in names] == pytest.approx(
        [0.5, 0.01, 0.25, 0.02, 1.5]
    )
    assert (bistable["smallest_disturbance_mode"], squeals["smallest_disturbance_mode"]) == ("X", "")
    assert not any(nowhere[name] for name in nowhere if name.startswith(("small_", "strongest", "motion_")))


def test_an_onset_knows_its_motions_its_seeds_and_its_main_coordinate(onset):
    one, two, three = onset.values
    assert [each.kind for each in onset.values] == [RangeKind.SQUEALS, RangeKind.BISTABLE, RangeKind.NOWHERE]
    assert [each.kinetic_energy_J for each in one.motions] == [9.0, 2.0]
    assert (one.strongest.starts, one.strongest.disturbance.speed_m_per_s) == (("disturbance", "disturbance 2"), 1.0)
    assert (one.strongest.after_small, one.led_to[0].after_small) == (False, True)
    assert (two.strongest.from_values, two.strongest.smallest_disturbance) == ((1.0,), two.smallest_disturbances[0])
    assert (one.growth_rate, three.growth_rate, three.strongest, two.smallest_disturbance) == (
        7.0, None, None, two.smallest_disturbances[0]
    )  # fmt: skip
    assert onset.in_order == (three, two, one)
    assert onset.coordinate == "Tz"
    # Of what was asked for alone.
    assert [(each.value, each.frequency_Hz) for each in onset.seeds] == [(1.0, 400.0), (1.0, 300.0)]
    np.testing.assert_array_equal(onset.seeds[0].start["displacement"], [9.0, 18.0])
    np.testing.assert_array_equal(onset.seeds[0].start["velocity"], [27.0, -9.0])


def a_row(value: float, kind: RangeKind) -> Any:
    return SimpleNamespace(value=value, kind=kind)


def test_ranges_end_at_critical_values_or_halfway_between_their_rows():
    kinds = (
        RangeKind.STABLE,
        RangeKind.STABLE,
        RangeKind.SQUEALS,
        RangeKind.BISTABLE,
        RangeKind.STABLE,
        RangeKind.NOWHERE,
    )
    rows = [a_row(float(k), kind) for k, kind in enumerate(kinds)]
    at = [
        SimpleNamespace(value=value, uncertainty=u) for value, u in ((1.2, 0.01), (1.4, 0.02), (2.3, 0.03), (2.6, 0.04))
    ]
    points = [SimpleNamespace(value=value, reason="x" if value > 4.3 else "") for value in (4.0, 4.1, 4.3, 4.6, 5.0)]
    found = find_ranges(rows, at, 0.1, points)  # pyright: ignore[reportArgumentType]
    assert [each.kind for each in found] == [*kinds[1:]]
    ends = [(0.0, None), (1.2, 0.01), (2.6, 0.04), (3.5, 0.5), (pytest.approx(4.45), pytest.approx(0.15)), (5.0, None)]
    assert [(each.first, each.first_uncertainty) for each in found] == ends[:-1]
    assert [(each.last, each.last_uncertainty) for each in found] == ends[1:]
    (_, other) = find_ranges(rows[3:5], (), 0.7)
    assert other.first_uncertainty == 0.7


# --- others ----------------------------------------------------------------------------------------------------------


def test_the_table_of_sensitivities_has_a_row_for_each_number_and_mode():
    modes = [
        SimpleNamespace(label=n, frequency_Hz=f, growth_rate_1_per_s=g)
        for n, f, g in (("X", 5.0, -1.0), ("Y", 7.0, 2.0))
    ]
    names = ("growth_per_percent_1_per_s", "growth_per_percent_by_differences_1_per_s", "frequency_per_percent_Hz",
             "growth_per_SI", "frequency_Hz_per_SI")  # fmt: skip
    numbers = [
        Sensitivity(
            key=key,
            value_SI=10.0 * k,
            **{n: (100 * k + 10 * j + 1.0, 100 * k + 10 * j + 2.0) for j, n in enumerate(names)},
        )  # pyright: ignore[reportArgumentType]
        for k, key in enumerate(("a", "b"), start=1)
    ]
    rows = read(sensitivity_answer.sensitivity_table(SimpleNamespace(numbers=numbers, modes=modes)))  # pyright: ignore[reportArgumentType]
    assert [(row["number"], row["value_SI"], row["mode"]) for row in rows] == [
        ("a", "10.0", "X"), ("a", "10.0", "Y"), ("b", "20.0", "X"), ("b", "20.0", "Y")
    ]  # fmt: skip
    assert [number(row, "frequency_Hz") for row in rows] == [5.0, 7.0] * 2
    assert [number(row, "growth_rate_1_per_s") for row in rows] == [-1.0, 2.0] * 2
    for j, name in enumerate(names):
        assert [number(row, name) for row in rows] == [100 * k + 10 * j + m for k in (1, 2) for m in (1.0, 2.0)]


def a_cycle(value: float, *multipliers: complex, what: Event | None = None) -> Cycle:
    shares: dict[str, Any] = {"contact_fraction": 0.9, "slip_reversed_fraction": 0.1, "sticking_fraction": 0.2}
    errors: dict[str, Any] = {"residual": 1e-9 * value, "unit_multiplier_error": 2e-9, "tangent_error": 3e-9}
    return Cycle(
        period_s=0.01 * value, amplitude={"X": 1e-5 * value, "Tz": 2e-4}, main_coordinate="X", value=value, what=what,
        multipliers=np.array(multipliers, dtype=complex), displacement={"X": 0.0}, velocity={"X": 0.0},
        **shares, **errors,
    )  # fmt: skip


def test_the_table_of_branches_has_a_row_for_each_cycle():
    one = CycleBranch(
        start=BranchEnd.HOPF,
        end=BranchEnd.BOUND,
        cycles=(a_cycle(1.0, 0.5 - 0.1j, -0.2), a_cycle(2.0, 3.0, -1.5, what=Event.FOLD)),
    )
    two = CycleBranch(start=BranchEnd.LOST, end=BranchEnd.LOOP, cycles=(a_cycle(4.0, 1.0, 0.3),))
    speed = Parameter.of(Variation("drum.speed", "rad/s", (1.0, 4.0)))
    rows = read(cycle_answer.branches_table(SimpleNamespace(parameter=speed, branches=(one, two))))  # pyright: ignore[reportArgumentType]
    assert [row["branch"] for row in rows] == ["1", "1", "2"]
    assert [number(row, "drum.speed_rad_per_s") for row in rows] == [1.0, 2.0, 4.0]
    assert [row["what"] for row in rows] == ["", "fold", ""]
    assert [number(row, "frequency_Hz") for row in rows] == pytest.approx([100.0, 50.0, 25.0])
    assert [(row["stable"], row["unstable_directions"]) for row in rows] == [
        ("yes", "0"),
        ("no", "2"),
        ("neutral", "0"),
    ]
    assert [number(row, "amplitude_X_m") for row in rows] == pytest.approx([1e-5, 2e-5, 4e-5])
    assert [number(rows[0], f"multiplier_{k}_{part}") for k in (1, 2) for part in ("re", "im")] == [
        0.5,
        -0.1,
        -0.2,
        0.0,
    ]
    assert [number(rows[0], name) for name in ("contact_fraction", "slip_reversed_fraction", "sticking_fraction")] == [
        0.9, 0.1, 0.2
    ]  # fmt: skip
    assert [number(rows[1], name) for name in ("residual", "unit_multiplier_error", "tangent_error")] == [
        2e-9,
        2e-9,
        3e-9,
    ]
    assert [(what, each.value) for what, each in cycle_answer.milestones(one)] == [
        ("first cycle", 1.0), (Event.FOLD, 2.0)
    ]  # fmt: skip
    assert [(what, each.value) for what, each in cycle_answer.milestones(two)] == [("end", 4.0)]


@pytest.mark.parametrize("unit", ["m/s", None])
def test_the_table_of_a_comparison_ends_with_what_was_not_measured(unit):
    def measured(frequency: float, **more: Any) -> MeasuredLine:
        return MeasuredLine(
            measured_Hz=frequency, amplitude=2.0, unit="m/s", level_dB=-frequency, rms_of_0_dB=1.0, **more
        )

    lines = (
        measured(10.0, nearest_simulated_Hz=11.0, simulated_is_pair=True, nearest_mode="X", mode_is_pair=False),
        measured(20.0, nearest_simulated_Hz=22.0, simulated_is_pair=False, nearest_mode="Y", mode_is_pair=True),
    )
    simulated = [SimulatedLine(frequency_Hz=f, amplitude=1.0, not_measurable=f > 30) for f in (11.0, 22.0, 33.0)]
    modes = [
        ComparedMode(label=n, frequency_Hz=f, growth_rate_1_per_s=0.0, unstable=False, not_measurable=f > 30)
        for n, f in (("X", 12.0), ("Y", 21.0), ("Z", 40.0))
    ]
    of = MeasuredComparison.model_construct(
        lines=lines, modes=tuple(modes), simulated=SimpleNamespace(lines=simulated), amplitudes_in=unit
    )
    rows = read(compare_answer.to_csv(of))
    level = "level_dB" if unit else "level_dB_re_largest"
    assert [row["line"] for row in rows] == [
        "measured", "measured", "simulated, not measured", "simulated, not measurable", "predicted, not measured",
        "predicted, not measurable",
    ]  # fmt: skip
    assert [number(row, level) for row in rows[:2]] == [-10.0, -20.0]
    assert [number(row, "nearest_simulated_Hz") for row in rows] == [11.0, 22.0, 22.0, 33.0, None, None]
    assert [(row["nearest_mode"], number(row, "nearest_mode_Hz")) for row in rows[2:]] == [
        ("", None), ("", None), ("X", 12.0), ("Z", 40.0)
    ]  # fmt: skip


def test_a_cell_of_a_matrix_has_its_numbers_and_the_matrix_counts_them():
    numbers = {
        "squeal": [1, 0, 2, 3, 1, -1], "outcome": [0, 0, 0, 0, 0, LOCKED], "unstable": [1, 0, 0, 1, 0, -1],
        "after": [0, -1, -1, -1, 1, -1], "along": [-1, -1, -1, -1, 1, -1], "velocity": [2e-3, 0, 0, 0, 5e-3, np.nan],
    }  # fmt: skip
    floats = {name: 10.0 * k + np.arange(6) for k, name in enumerate(
        ("growth_rate", "frequency", "time", "speed", "small_frequency", "small_velocity"), start=1)}  # fmt: skip
    floats["small_velocity"][3] = np.nan
    data = xarray.Dataset({name: ("cell", np.array(values)) for name, values in (numbers | floats).items()})
    levels = {f"l{k}": {} for k in range(6)}
    plan: Any = SimpleNamespace(
        points=6, title="so", axes={"load": levels}, levels=lambda number: {"load": list(levels)[number]},
    )  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(matrix_found, "names_in", lambda data, name: ("X", "Tz (2)") if name == "along" else ())
        found = matrix_found.find_matrix(data, plan)
    assert (found.title, found.axes, len(found.cells)) == ("so", {"load": [f"l{k}" for k in range(6)]}, 6)
    assert (found.squeal, found.squeal_after_large_only, found.not_clear) == (2, 1, 2)
    rows = read(matrix_answer.matrix_table(found))
    assert [row["load"] for row in rows] == [f"l{k}" for k in range(6)]
    assert [row["verdict"] for row in rows] == [
        "squeals", "quiet", "not clear", "undecided at its end", "squeals", "not computed"
    ]  # fmt: skip
    assert [row["unstable"] for row in rows] == ["True", "False", "False", "True", "False", ""]
    assert [row["after"] for row in rows] == ["small", "", "", "", "large, along Tz (2)", ""]
    assert [row["disturbance"] for row in rows] == ["small", "", "", "", "large", ""]
    assert [number(row, "velocity_m_per_s") for row in rows] == [2e-3, 0.0, 0.0, 0.0, 5e-3, None]
    assert [number(row, "level_dB") for row in rows] == [
        pytest.approx(20 * math.log10(2e6)), None, None, None, pytest.approx(20 * math.log10(5e6)), None
    ]  # fmt: skip
    names = ("growth_rate_1_per_s", "frequency_Hz", "time_s", "speed_rad_per_s", "small_frequency_Hz")
    for k, name in enumerate(names, start=1):
        assert [number(row, name) for row in rows] == [10.0 * k + j for j in range(6)]
    assert [number(row, "small_velocity_m_per_s") for row in rows] == [60.0, 61.0, 62.0, None, 64.0, 65.0]
    assert rows[5]["outcome"].startswith("no steady sliding: friction exceeds")


def test_the_table_of_an_accuracy_study_has_every_repeat_and_every_error():
    configuration: Any = SimpleNamespace(cause="step", line="dopri8", setting="1e-6", solver="auto", tolerance=1e-6)
    features = RelativeChange(1e-3, None, 3e-3, 4e-3)
    done = Measurement(
        configuration, Ending.COMPLETE, 0.5, (3.0, 1.0, 2.0), 0.25, 900.0, Errors(1e-4, 2e-4, features, 5e-4)
    )  # pyright: ignore[reportArgumentType]
    failed = Measurement(configuration, Ending.FAILED, reason="so")  # pyright: ignore[reportArgumentType]
    runs = tuple(map(accuracy_study._row, (done, failed)))
    of: Any = SimpleNamespace(runs=runs, machine="arm", processor="p", cores=3, versions={"jax": "7"})
    one, two = read(accuracy_answer.to_csv(of))
    assert [one[name] for name in ("cause", "line", "setting", "solver", "tolerance", "outcome")] == [
        "step", "dopri8", "1e-6", "auto", "1e-06", "complete"
    ]  # fmt: skip
    assert (one["seconds"], one["machine"], one["processor"], one["cores"], one["jax"]) == (
        "3 1 2",
        "arm",
        "p",
        "3",
        "7",
    )
    names = ("simulated_ms", "time_per_simulated_ms", "first_call_extra_seconds", "evaluations")
    assert [number(one, name) for name in names] == [500.0, 4.0, 0.25, 900.0]
    errors = (
        "trajectory",
        "beyond_edges",
        "growth_rate",
        "onset_frequency",
        "amplitude",
        "main_frequency",
        "energy_balance",
    )
    assert [number(one, f"error_{name}") for name in errors] == [1e-4, 2e-4, 1e-3, None, 3e-3, 4e-3, 5e-4]
    assert (two["outcome"], two["seconds"], two["simulated_ms"], two["error_trajectory"]) == ("failed: so", "", "", "")


def limits(**more: Any) -> tuple[str, ...]:
    reference = SimpleNamespace(time=np.array([0.0, 0.02]), uncertainty=lambda end: 10 * end, confirmed=lambda end: end)
    known: dict[str, Any] = {"reference": reference, "growth_end": 0.01, "separation": None, "measurements": ()}
    return accuracy_study.describe_limits(SimpleNamespace(**(known | more)))  # pyright: ignore[reportArgumentType]


def test_an_accuracy_study_says_how_far_its_reference_goes():
    first, second, third = limits()
    assert "until 10 ms (the growth phase; beyond the first contact boundary, until 20 ms)" in first
    assert "differs by 1e-01 (drawn as the floor), LSODA at 1e-12 by 1e-02" in second
    assert third.startswith("Nearby trajectories stay together")
    first, _, third, fourth = limits(growth_end=0.05, separation=0.003, measurements=(
        SimpleNamespace(errors=None, ended="too slow", configuration=SimpleNamespace(name="a")),
        SimpleNamespace(errors=1, ended="complete", configuration=SimpleNamespace(name="b")),
        SimpleNamespace(errors=None, ended="too slow", configuration=SimpleNamespace(name="c")),
    ))  # fmt: skip
    assert "until 20 ms (as far as the reference got in its time)" in first
    assert third.startswith("At 3 ms nearby trajectories are a hundred times")
    assert fourth == "a; c: too slow."


def test_the_verdict_of_an_accuracy_study_names_the_cheapest_and_what_ten_times_better_takes():
    def found(evaluations: float, largest: float | None = 1e-5) -> Any:
        configuration = SimpleNamespace(solver=f"s{evaluations:g}", tolerance=1e-6)
        return SimpleNamespace(
            configuration=configuration,
            evaluations=evaluations,
            time_per_ms=2.0,
            errors=SimpleNamespace(largest_feature=largest),
        )

    def verdict(**more: Any) -> str:
        simulate = SimpleNamespace(duration=0.4)
        known = {
            "target": 1e-4, "growth_end": 0.5, "reference": SimpleNamespace(uncertainty=lambda end: 1e-3 * end),
            "cheapest": found(300.0), "ten_times_better": found(900.0), "scatter": RelativeChange(1e-6, None, 4e-5,
            None),
            "scene": SimpleNamespace(simulate=simulate),
        }  # fmt: skip
        return accuracy_study.describe_verdict(SimpleNamespace(**(known | more)))  # pyright: ignore[reportArgumentType]

    assert verdict() == (
        "Within 1e-04 in trajectory, features and energy, the cheapest is s300 at tolerance 1e-06: 300 evaluations, "
        "800 ms for 0.4 s. Ten times better takes 3 times as many (s900 at 1e-06)."
    )
    assert "(features within twice their scatter of 6e-05)" in verdict(scatter=RelativeChange(1e-6, None, 6e-5, None))
    assert "so short a record has no features" in verdict(cheapest=found(300.0, None))
    assert verdict(ten_times_better=None).endswith("No run is ten times better.")
    same = found(300.0)
    assert verdict(cheapest=same, ten_times_better=same).endswith("It is even ten times better.")
    assert verdict(cheapest=None).endswith("together. The reference itself is good to 5e-04.")
    assert verdict(cheapest=None, growth_end=0.05).endswith("together.")


# --- what is printed -------------------------------------------------------------------------------------------------


def printed(show: Any, found: Any) -> list[str]:
    """The lines that are printed, each with one blank between its words."""
    console = Console(width=200, record=True, file=io.StringIO())
    show(console, found)
    return [" ".join(line.split()) for line in console.export_text().splitlines() if line.strip()]


def test_a_cycle_is_printed_with_each_pair_of_multipliers_once():
    one = a_cycle(1.0, 0.5 - 0.5j, 0.5 + 0.5j, -0.2, 0.1).model_copy(update={"samples": None})
    other = SimpleNamespace(
        main_coordinate="X", amplitude={"X": 3e-5}, model=None, neutral=False, stable=False, frequency_Hz=70.0,
        found_from="there",
    )  # fmt: skip
    of = SimpleNamespace(
        amplitude=one.amplitude, model=None, multipliers=one.multipliers, unit_multiplier_error=2e-9, residual=1e-9,
        found_from="here", transient="settled", others=(other,), verdict="So it is.",
    )  # fmt: skip
    lines = printed(cycle_answer.print_cycle, of)
    for line in (
        "X 10 µm", "Tz 200 µrad", "0.707107 ±45.00", "0.200000 180.00", "0.100000 0.00",
        "Periodicity residual 1.0e-09 of the motion; error of the trivial Floquet multiplier 2.0e-09",
        "Start of the search: here. The transient settled.",
        "Another cycle: an unstable limit cycle at 70 Hz, 30 µm in X, from there.", "So it is.",
    ):  # fmt: skip
        assert lines.count(line) == 1, line
    assert "0.707107 ±-45.00" not in lines


def test_branches_are_printed_by_their_ends_and_what_happens_on_them(monkeypatch):
    cycles = a_cycle(1.0, 0.5 - 0.1j, -0.2), a_cycle(2.0, 3.0, -1.5, what=Event.FOLD)
    one = CycleBranch(start=BranchEnd.HOPF, end=BranchEnd.BOUND, cycles=cycles)
    monkeypatch.setattr(cycle_answer, "at_lining", lambda scene, name: (1e6, "µ", name))
    critical = Critical(value=4.5, uncertainty=0.1, label="Tz (2)", frequency_Hz=50.0, destabilises=False)
    of = SimpleNamespace(
        parameter=Parameter.of(Variation("drum.speed", "rad/s", (1.0, 4.0), "rpm", 2 * math.pi / 60)), branches=(one,),
        critical_values=(critical,), verdict="So it is.", scene=None, subject="the brake", notes=("a note",),
        not_followed=(Unfollowed(reason="so", low=1.0, high=2.0),), off_branches=(OffBranch(
            value=1.5, frequency_Hz=9.0, amplitude={}, why=Why.NOT_CLOSED, reason="it jumps"),),
    )  # fmt: skip
    monkeypatch.setattr(cycle_answer, "missing_words", lambda found: ["missing"])
    monkeypatch.setattr(cycle_answer, "end_words", lambda branch: [f"{branch.start} to {branch.end}"])
    lines = printed(cycle_answer.print_branches, of)
    rpm = 30 / math.pi
    for line in (
        f"1 first cycle {rpm:.7g} 100.0 10 200 0.5099", f"1 fold {2 * rpm:.7g} 50.0 20 200 3.0000",
        f"Steady sliding becomes stable in Tz (2) as the value rises past drum.speed = {4.5 * rpm:.7g} rpm",
        "Branch 1 Hopf to end of the range", "missing", "So it is.",
    ):  # fmt: skip
        assert lines.count(line) == 1, (line, lines)
    # Of many coordinates those that move the lining most have columns, by how far a radian takes it.
    names = [f"n{k}" for k in range(9)]
    model = SimpleNamespace(
        shoe=SimpleNamespace(characteristic_lengths=lambda: dict.fromkeys(names, 1.0) | {"n8": 10.0})
    )
    many = [SimpleNamespace(names=names, amplitude={name: 1.0 + k for k, name in enumerate(names)}, model=model)]
    shown, others = cycle_answer._columns(SimpleNamespace(branches=[SimpleNamespace(cycles=many)]))  # pyright: ignore[reportArgumentType]
    assert set(shown) | set(others) == set(names)
    assert "n8" in shown
    assert "n0" in others


def test_a_value_is_written_with_its_uncertainty_where_that_is_worth_it():
    along = Variation("drum.speed", "rad/s", (1.0, 4.0), "rpm", 2 * math.pi / 60)
    plain = Variation("x", "", (1.0, 4.0))
    assert onset_words._value(plain, 1000.0, 0.9e-3) == "1000"
    assert onset_words._value(plain, -1000.0, 1.1e-3) == "-1000.000 ± 0.001"
    assert onset_words._value(plain, 1234.5678, None) == "1234.57"
    assert onset_words._value(plain, 0.01, 0.9e-8, "exactly") == "exactly"
    assert onset_words._value(along, math.pi, math.pi / 300) == "30.0 ± 0.1"
    critical = Critical(value=math.pi, uncertainty=math.pi / 300, label="Y", frequency_Hz=0.5, destabilises=True)
    assert onset_words.critical_words(critical, along) == (
        "Y loses stability at 0.5 Hz as the value rises past drum.speed = 30.0 ± 0.1 rpm"
    )
