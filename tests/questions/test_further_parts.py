"""Further parts of cycles, fits, sweeps, benches and readers, each against what is written out by hand."""

import io
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray
from rich.console import Console

from drumsqueal.dynamics.cycles import cycle as orbit
from drumsqueal.dynamics.cycles import search
from drumsqueal.dynamics.cycles.cycle import describe
from drumsqueal.errors import CycleError, Ending, IntegrationError
from drumsqueal.findings.growth_phase import CLEAN_FRACTION, Note, _measure
from drumsqueal.findings.signals import growth, recurrence
from drumsqueal.findings.vibration import Vibration
from drumsqueal.questions.accuracy import study as bench_module
from drumsqueal.questions.accuracy import study as reference_module
from drumsqueal.questions.accuracy.study import Benchmark, Measurement
from drumsqueal.questions.compare import study as compare_study
from drumsqueal.questions.effects.reductions import reductions_of
from drumsqueal.questions.export import signals as signals_module
from drumsqueal.questions.fit import answer as fit_answer
from drumsqueal.questions.fit.estimate import Eigenmodes
from drumsqueal.questions.fit.record import RecordKind
from drumsqueal.questions.fit.study import FittedLine, FittedNumber
from drumsqueal.questions.onset.found import FollowedMode
from drumsqueal.questions.sweep import answer as matrix_answer
from drumsqueal.questions.sweep import found as summary
from drumsqueal.questions.sweep.file import _same
from drumsqueal.questions.sweep.matrix_cells import CellFound, NoiseMatrix
from drumsqueal.questions.sweep.points import COMPUTED, NONE, CellVerdict
from drumsqueal.solve import shooting as shooting_module
from drumsqueal.solve.shooting import Closed, ShootingStart, floquet_of
from drumsqueal.solve.transient.flow import StickTransition

RNG = np.random.default_rng(31)


def printed(show: Any, *given: Any) -> list[str]:
    """The lines that are printed, each with one blank between its words."""
    console = Console(width=400, record=True, file=io.StringIO())
    show(console, *given)
    return [" ".join(line.split()) for line in console.export_text().splitlines() if line.strip()]


# --- orbits ----------------------------------------------------------------------------------------------------------

SCALE = np.array([2.0, 0.5, 0.25, 4.0])


def shooting_of(transition: np.ndarray, rate: Any = (3.0, -4.0), flow: Any = None) -> tuple[Any, Any]:
    """A closed motion of one coordinate with this derivative of its flow, and flows that are asked for besides."""
    found = SimpleNamespace(transition=transition, rate=np.array(rate), lost=0, pattern="slides", changes=())
    closed = Closed(np.array([0.5, 2.0, 1.6, 0.75]), found, 3e-11, 4)  # pyright: ignore[reportArgumentType]
    model = SimpleNamespace(names=("X",), mass=np.array([2.0]))

    def unscaled(unknowns):
        values = unknowns * SCALE
        return values[:-2], float(values[-2]), float(values[-1])

    return SimpleNamespace(
        scale=SCALE, unscaled=unscaled, models=lambda p: (("at", p) if flow is None else model, None),
        flow=flow or (lambda unknowns: found),
    ), closed  # fmt: skip


def with_rate(value: float, rate: Any = (3.0, -4.0)) -> np.ndarray:
    """A matrix that carries a rate into itself, and multiplies what is across by a value."""
    along = np.array(rate) / np.linalg.norm(rate)
    across = np.array([-along[1], along[0]]) + 0.3 * along
    basis = np.column_stack([along, across])
    return basis @ np.diag([1.0, value]) @ np.linalg.inv(basis)


def test_multipliers_are_those_of_tangents_unless_neighbours_disagree_and_carry_the_rate(monkeypatch):
    asked = []

    def neighbours(model, size, state, units, period):
        asked.append((model, size.tolist(), state.tolist(), units.tolist(), period))
        return None, near

    monkeypatch.setattr(shooting_module, "neighbours", neighbours)
    tangents, near = with_rate(0.6), with_rate(0.6) + 1e-5
    multipliers, error, apart = floquet_of(*shooting_of(tangents))
    assert asked == [(("at", 3.0), [2.0, 0.5], [0.5, 2.0], [[1.0, 0.0], [0.0, 1.0]], pytest.approx(0.4))]
    np.testing.assert_allclose(multipliers, [0.6])
    assert error < 1e-12
    assert apart == pytest.approx(1e-5 / np.abs(near).max())
    near = with_rate(-0.8)
    multipliers, error, apart = floquet_of(*shooting_of(tangents))
    np.testing.assert_allclose(multipliers, [-0.8])
    assert apart == pytest.approx(np.abs(tangents - near).max() / np.abs(near).max())
    # Neighbours that do not carry the rate into itself, or whose pattern is another, are on the other side.
    near = with_rate(-0.8) + 0.1
    np.testing.assert_allclose(floquet_of(*shooting_of(tangents))[0], [0.6])
    near = with_rate(-0.8)
    for sign in (1, -1):

        def flow(unknowns, sign=sign):
            other = sign * (unknowns[1] - 2.0) > 0.5e-6
            return SimpleNamespace(pattern="sticks" if other else "slides")

        shooting, closed = shooting_of(tangents, flow=flow)
        np.testing.assert_allclose(floquet_of(shooting, closed)[0], [0.6])
    near = np.array([[1.0, np.nan], [0.0, 1.0]])
    with pytest.raises(CycleError, match="not followed over a period"):
        floquet_of(*shooting_of(tangents))


def test_an_orbit_is_described_by_its_samples_over_a_period(monkeypatch):
    n, period = 64, 0.4
    time = 1.5 + period * np.arange(n + 1) / n
    omega = 2 * np.pi / period
    fraction = np.linspace(0.5, 0.9, n + 1)
    samples = SimpleNamespace(
        time=time, displacement=(3.0 + 0.2 * np.sin(omega * time + 0.3))[:, None], changes=[],
        velocity=(0.2 * omega * np.cos(omega * time + 0.3))[:, None],
        observation=SimpleNamespace(contact_fraction=fraction, slip_reversed_fraction=fraction**2),
    )  # fmt: skip
    monkeypatch.setattr(orbit, "_sample", lambda model, state, period: samples)
    monkeypatch.setattr(orbit, "_check_changes", lambda *given: None)
    monkeypatch.setattr(orbit, "floquet_of", lambda shooting, closed: (np.array([0.25 + 0j]), 1e-9, 2e-9))
    shooting, closed = shooting_of(with_rate(0.6), flow=lambda unknowns: None)
    closed.flow.changes = ((0.1, StickTransition.STICKS), (0.25, StickTransition.SLIPS))
    found = describe(shooting, closed)
    assert (found.period_s, found.value, found.residual) == (pytest.approx(0.4), 3.0, 3e-11)
    assert found.amplitude == {"X": pytest.approx(0.2, rel=1e-5)}
    assert found.contact_fraction == pytest.approx(fraction[:-1].mean())
    assert found.slip_reversed_fraction == pytest.approx(np.mean(fraction[:-1] ** 2))
    assert (found.sticking_fraction, found.sticking_phases) == (pytest.approx(0.15 / 0.4), 1)
    assert (found.displacement, found.velocity, found.main_coordinate) == ({"X": 1.0}, {"X": 1.0}, "X")
    assert (found.unit_multiplier_error, found.tangent_error, found.largest) == (1e-9, 2e-9, 0.25)


def test_a_start_that_sticks_is_moved_to_where_it_slips_fastest(monkeypatch):
    def chunk(speeds: Any, sticks: bool, changes: Any = ()) -> Any:
        speeds = np.array(speeds)
        return SimpleNamespace(
            displacement=10 + speeds[:, None], velocity=speeds[:, None], changes=changes,
            observation=SimpleNamespace(sticking=np.array([sticks])),
        )  # fmt: skip

    changes = [(0.0, True), (0.05, False), (0.1, True), (0.2, True)]
    taken = {0.5: chunk([1.0, -2.0, 0.5], True, changes), 0.1: chunk([0.1, 0.7, 7.0, 0.2], False)}
    monkeypatch.setattr(orbit, "_sample", lambda model, state, time: taken[time])
    monkeypatch.setattr(orbit, "slip_speeds", lambda model, velocity: np.abs(velocity[:, 0]))
    start = ShootingStart(np.array([3.0, 4.0]), 0.5, "so")
    assert orbit.cut_in_slip(None, start).state.tolist() == [17.0, 7.0]  # pyright: ignore[reportArgumentType]
    taken[0.1] = chunk([0.1], False)
    assert orbit.cut_in_slip(None, start).state.tolist() == [8.0, -2.0]  # pyright: ignore[reportArgumentType]
    taken[0.5] = chunk([1.0, -2.0], True)  # it sticks before and after, and never begins to
    assert orbit.cut_in_slip(None, start).state.tolist() == [8.0, -2.0]  # pyright: ignore[reportArgumentType]
    taken[0.5] = chunk([1.0, -2.0], False)
    assert orbit.cut_in_slip(None, start) is start  # pyright: ignore[reportArgumentType]

    def fails(model, state, time):
        raise CycleError("so")

    monkeypatch.setattr(orbit, "_sample", fails)
    assert orbit.cut_in_slip(None, start) is start  # pyright: ignore[reportArgumentType]


def test_a_cycle_of_a_start_is_none_where_it_is_at_rest_or_one_of_a_family(monkeypatch):
    known: dict[str, Any] = {"vibration": 1.1e-4, "multipliers": np.array([0.5 + 0j])}

    class Made:
        def __init__(self, models, scale, on_flow) -> None:
            assert models(7.0) == ("model", None)
            assert (scale, on_flow()) == ("scale", "flowed")

        def scaled(self, state, period, value):
            return state, period, value

        def close(self, guess):
            assert guess == ("state", 0.3, 0.0)
            return known.get("closed", "closed")

        def vibration(self, closed, steady):
            assert steady == "steady"
            return np.array([0.0, -known["vibration"]])

    cycle = SimpleNamespace(
        multipliers=known["multipliers"], model_copy=lambda update: SimpleNamespace(**vars(cycle), **update)
    )
    monkeypatch.setattr(search, "Shooting", Made)
    monkeypatch.setattr(search, "cut_in_slip", lambda model, start: start._replace(state="state"))
    monkeypatch.setattr(search, "scale_near", lambda model, start, steady: "scale")
    monkeypatch.setattr(search, "_shortest", lambda shooting, closed: f"shortest {closed}")
    monkeypatch.setattr(search, "describe", lambda shooting, closed: cycle if closed == "shortest closed" else None)

    def found() -> Any:
        return search.cycle_from("model", ShootingStart("before", 0.3, "so"), "steady", lambda: "flowed")  # pyright: ignore[reportArgumentType]

    assert math.isnan(found().value)
    known["vibration"] = 0.9e-4
    with pytest.raises(CycleError, match="ends at steady sliding"):
        found()
    known["vibration"], cycle.multipliers = 1.0, np.array([0.3, 1 + 0.9e-6j])
    with pytest.raises(CycleError, match="continuous family"):
        found()
    cycle.multipliers = np.array([0.3, 1 + 1.1e-6j])
    found()
    known["closed"] = None
    with pytest.raises(CycleError, match="finds none"):
        found()
    assert [search._and_others(count) for count in (0, 1, 2)] == ["", " and 1 other start", " and 2 other starts"]


# --- fits ------------------------------------------------------------------------------------------------------------


def test_a_fit_is_printed_with_its_numbers_and_lines():
    def number(key: str, wide: float | None, **more: Any) -> FittedNumber:
        known: dict[str, Any] = {
            "unit": "mm", "scene_value": 36.5, "fitted_value": 40.123, "standard_uncertainty": wide,
            "scene_value_SI": 0.0365, "fitted_value_SI": 0.040123, "uncertainty_SI": wide,
        }  # fmt: skip
        return FittedNumber(key=key, uncertainty=wide, determined=wide is not None, **(known | more))

    lines = (
        FittedLine(
            measured_Hz=123.456, uncertainty_Hz=0.234, mode="X", before_Hz=111.222, after_Hz=122.333,
            measured_growth_rate_1_per_s=-4.567, growth_rate_uncertainty_1_per_s=0.346,
            before_growth_rate_1_per_s=5.678, after_growth_rate_1_per_s=-6.789,
        ),
        FittedLine(measured_Hz=234.567, uncertainty_Hz=1.5),
    )  # fmt: skip
    fit: Any = SimpleNamespace(
        numbers=(number("a", 0.25), number("b", None, unit="", scene_value_SI=0.0)), lines=lines, notes=("a note",),
        record_kind=RecordKind.LINEAR, from_s=0.123456, until_s=0.98765, sample_rate_Hz=51200.0, channel="mic",
        reason="why",
        verdict="So it is.", missed=False, written=None, fitted_scene=SimpleNamespace(to_toml=lambda: "[shoe]\n"),
    )  # fmt: skip
    shown = printed(fit_answer.print_fit, fit)
    for line in (
        "a 36.50 40.12 0.25 mm +9.93 yes", "b 36.50 40.12 - SI - no",
        "X 123.46 0.23 111.22 122.33 -4.57 0.35 +5.68 -6.79", "- 234.57 1.5 - - - - - -",
        "Measured: mic, 0.1235 to 0.9877 s at 51200 Hz; why", "So it is.", "Note: a note",
    ):  # fmt: skip
        assert shown.count(line) == 1, (line, shown)
    fit.record_kind = RecordKind.SATURATED  # lines of squeal are of no mode, and neither grow nor decay
    fit.lines = (
        FittedLine(measured_Hz=123.456, uncertainty_Hz=0.234, before_Hz=111.222, after_Hz=122.333),
        FittedLine(measured_Hz=234.567, uncertainty_Hz=1.5),
    )
    shown = printed(fit_answer.print_fit, fit)
    assert "123.46 0.23 111.22 122.33" in shown
    assert "234.57 1.5 - -" in shown
    assert fit_answer.fitted_scene(fit) == "# So it is.\n[shoe]\n"
    fit.written = SimpleNamespace(to_toml=lambda: "[drum]\n")
    assert fit_answer.fitted_scene(fit) == "# So it is.\n[drum]\n"
    fit.missed = True
    assert fit_answer.fitted_scene(fit) is None


def test_modes_are_not_those_that_do_not_oscillate():
    """A real eigenvalue whose eigenvector is that of a mode of the scene is none of its modes; nor is a slow one."""
    modes = Eigenmodes.__new__(Eigenmodes)
    modes._mass = np.ones(3)
    matrix = np.zeros((6, 6))
    matrix[:3, 3:] = np.eye(3)
    matrix[3:, :3] = -np.diag([1e-30, 2500.0, 8100.0])
    modes._evaluate = lambda numbers: (matrix, np.zeros((1, 6, 6)))  # pyright: ignore[reportAttributeAccessIssue]
    modes.modes = tuple(SimpleNamespace(right=np.eye(6)[k] + 0j, label=str(k)) for k in (2, 1))  # pyright: ignore[reportAttributeAccessIssue]
    np.testing.assert_allclose(modes.at(np.zeros(1)).eigenvalues, [90j, 50j], atol=1e-9)
    modes.modes = tuple(SimpleNamespace(right=np.eye(6)[k] + 0j, label=str(k)) for k in (0, 1))  # pyright: ignore[reportAttributeAccessIssue]
    assert modes.at(np.zeros(1)).eigenvalues[1] == pytest.approx(50j)
    assert modes.at(np.zeros(1)).eigenvalues[0].imag == pytest.approx(90.0)  # of what oscillates it is the rest


# --- growth ----------------------------------------------------------------------------------------------------------


def growing(
    own: np.ndarray, modal: np.ndarray, recorded: int | None = None, frequency: float = 50.0, *others: float
) -> Any:
    """What is measured of a mode of which the record has a signal and a complex amplitude, sampled at 1 kHz."""
    time = np.arange(own.size) / 1000.0
    mode: Any = SimpleNamespace(name="X", frequency_Hz=frequency)
    vibration: Any = SimpleNamespace(
        time=np.arange(recorded or own.size) / 1000.0, sample_rate=1000.0, modal=lambda mode, part: modal,
        column=lambda name, part: own, largest=lambda part: np.array([np.abs(own).max(), 2.0]),
    )  # fmt: skip
    stability: Any = SimpleNamespace(modes=(mode, *(SimpleNamespace(frequency_Hz=f) for f in others)))
    return _measure(mode, stability, vibration, slice(0, time.size))


def test_a_mode_is_measured_while_it_is_a_thirtieth_of_what_its_coordinate_has_done():
    time = np.arange(1000) / 1000.0
    modal: Any = np.exp((-8 + 2j * np.pi * 50.2) * time)
    found = growing(modal.real, modal)
    assert found["note"] is Note.MEASURED
    assert found["measured_growth_rate_1_per_s"] == pytest.approx(-8.0, rel=1e-6)
    assert found["frequency_from_phase_Hz"] == pytest.approx(50.2)
    assert found["measured_frequency_Hz"] == pytest.approx(50.2, abs=1.0)
    # What it was largest counts: it falls to 0.03 of that after ln(1/0.03)/8 s.
    last = 1 + math.floor(1000 * math.log(1 / CLEAN_FRACTION) / 8)
    assert found["frequency_resolution_Hz"] == pytest.approx(1500 / last)
    assert found["measured_growth"].rate_1_per_s == found["measured_growth_rate_1_per_s"]
    assert growing(modal.real[:100], modal[:100], 200)["note"] is Note.SOON_NONLINEAR  # 4.97 periods
    assert growing(modal.real[:100], modal[:100])["note"] is Note.FEW_PERIODS
    assert growing(modal.real[:101], modal[:101], 200)["note"] is Note.MEASURED
    assert growing(modal.real[:15], modal[:15])["note"] is Note.TOO_SHORT
    assert growing(modal.real[:15], modal[:15], 16)["note"] is Note.NONLINEAR
    assert growing(modal.real[:16], modal[:16], None, 400.0)["note"] is not Note.TOO_SHORT
    assert growing(0 * time, modal)["note"] is Note.NOT_EXCITED
    assert growing(modal.real, 1.9e-12 * modal)["note"] is Note.NOT_EXCITED
    hidden = np.where(time < 0.05, 1.0, 0.01) * modal
    assert growing(np.cos(2 * np.pi * 9 * time), hidden)["note"] is Note.HIDDEN


def test_the_line_of_a_mode_is_sought_half_way_to_the_next_and_a_quarter_of_its_own_at_most():
    time = np.arange(1000) / 1000.0
    modal = np.exp(2j * np.pi * 50 * time)
    for line, others, found in (
        (61.0, (), True), (64.0, (), False), (54.0, (60.0,), True), (57.0, (60.0,), False), (61.0, (50.0,), True),
        (46.0, (40.0, 90.0), True), (43.5, (40.0, 90.0), False),
    ):  # fmt: skip
        own = np.cos(2 * np.pi * line * time)
        measured = growing(own, modal, None, 50.0, *others)
        assert (abs((measured["measured_frequency_Hz"] or 0.0) - line) < 0.2) == found, (line, others)


def test_rates_that_are_tried_double_up_to_e_folds_of_twenty_samples():
    found = growth._rates(170, 50.0)
    np.testing.assert_allclose(found, np.array([-8.0, -4, -2, -1, 0, 1, 2, 4, 8]) / 3.4)
    assert growth._rates(19, 50.0).tolist() == [0.0]
    assert len(growth._rates(20, 50.0)) == 3


def test_the_smallest_error_of_all_lags_is_returned():
    time = np.arange(600)
    motion = np.sin(2 * np.pi * time / 30.3)[:, None]
    motion = motion / np.sqrt(np.mean(motion**2))
    found, smallest = recurrence.find_recurrences(motion, 100.0)
    assert [each.period for each in found] == [pytest.approx(30.3, rel=1e-4)]
    assert smallest is not None
    assert smallest <= found[0].error <= 1e-3
    noise = RNG.normal(size=(600, 1))
    assert recurrence.find_recurrences(noise / np.sqrt(np.mean(noise**2)), 60.0)[0] == []


# --- benches ---------------------------------------------------------------------------------------------------------


def test_states_are_measured_against_their_largest_values_by_the_energy_of_springs_too(monkeypatch):
    """Kinetic plus elastic energy: that of the second state is largest, though it moves least."""
    model: Any = SimpleNamespace(
        names=("X", "Y"), mass=np.array([2.0, 1.0]), stiffness=np.array([[90.0, -30], [-30, 50]])
    )
    states = np.array([[0.1, 0.0, 1.0, 2.0], [1.0, -1.0, 0.5, 0.0], [-1.1, -1.0, 0.9, 1.0]])
    asked = []

    def motion_scale(of, state):
        asked.append((np.asarray(state[0]).tolist(), np.asarray(state[1]).tolist()))
        return SimpleNamespace(flat=lambda: np.array([1e9, 1.0, 1.0, 1.0, 1.0]))

    monkeypatch.setattr(reference_module, "motion_scale", motion_scale)
    sizes = reference_module.sizes_of(states, model)
    assert asked == [([1.0, -1.0], [0.5, 0.0])]
    assert sizes[0] == pytest.approx(1e9 * reference_module.UNMOVED)
    assert sizes[1:].tolist() == [1.0, 1.0, 2.0]


def test_a_contender_is_run_once_to_compile_and_again_where_it_is_short(monkeypatch):
    clock = [0.0]
    took = [0.07, 0.05, 0.06, 0.04, 0.03, 0.09, 0.08]
    takes = iter([9.0, 2.0, *took, 1e9])
    monkeypatch.setattr(bench_module.time, "perf_counter", lambda: clock[0])
    chunk = SimpleNamespace(evaluations=700)

    def follow(prepared, take, progress, what):
        clock[0] += next(takes)
        take(chunk)

    monkeypatch.setattr(bench_module, "follow", follow)
    values = []
    of: Any = Benchmark.__new__(Benchmark)
    scene = SimpleNamespace(with_values=lambda given: values.append(given) or "scene")
    of.prepared = SimpleNamespace(scene=scene, _replace=lambda **more: more)
    of.time, of.progress = np.array([0.0, 0.25]), lambda *_: None
    of.reference = SimpleNamespace(time=np.array([0.0, 0.1]))
    of._errors = lambda prepared, chunks, whole: (len(chunks), whole)
    configuration: Any = SimpleNamespace(solver="s", tolerance=1e-5, whole=True, model="m")
    found = of.measure(configuration, "so")
    assert values == [{"simulate.solver": "s", "simulate.tolerance": 1e-5, "simulate.duration": 0.25}]
    assert (found.outcome, found.simulated, found.evaluations, found.errors) == (Ending.COMPLETE, 0.25, 700, (1, True))
    assert found.compile_seconds == pytest.approx(7.0)
    assert found.seconds == pytest.approx(took)
    assert found.time_per_ms == pytest.approx(0.06 / 0.25)
    assert found.evaluations_per_ms == pytest.approx(2.8)
    takes = iter([2.0, 3.0, bench_module.SHORT + 0.1])
    configuration.whole = False
    found = of.measure(configuration, "so")
    assert (found.compile_seconds, len(found.seconds), found.simulated) == (0.0, 1, 0.1)

    def fails(prepared, take, progress, what):
        raise IntegrationError("why")

    monkeypatch.setattr(bench_module, "follow", fails)
    lost = of.measure(configuration, "so")
    assert (lost.outcome, lost.reason, lost.simulated) == (Ending.FAILED, "why", 0.1)
    assert math.isnan(lost.compile_seconds)
    assert math.isnan(Measurement(configuration, Ending.FAILED).time_per_ms)


# --- sweeps, matrices, exports ---------------------------------------------------------------------------------------


def test_modes_that_grow_are_counted_at_points_and_named_where_most(monkeypatch):
    """Two values of one number, three of another, and four modes at each point."""
    unstable, growth = np.zeros((2, 3, 4), dtype=int), RNG.uniform(-9, -1, size=(2, 3, 4))
    for at, rate in (((0, 1, 2), 3.0), ((1, 2, 2), 7.0), ((1, 2, 3), 5.0), ((1, 0, 0), 99.0)):
        unstable[at], growth[at] = 1, rate
    where = np.zeros((2, 3, 4), dtype=bool)
    where[..., 2:] = True
    frequency = 100 + np.arange(24.0).reshape(2, 3, 4)
    data = xarray.Dataset(
        {
            "unstable": (("a", "b", "mode"), unstable), "growth_rate": (("a", "b", "mode"), growth),
            "frequency": (("a", "b", "mode"), frequency),
        },
        {"a": [10.0, 20.0], "b": [1.0, 2.0, 3.0]},
    )  # fmt: skip
    monkeypatch.setattr(summary, "modes_in", lambda data: {"X": where, "none": np.zeros_like(where)})
    plan: Any = SimpleNamespace(keys=("a", "b"), draws=0)
    (found,) = summary._unstable_modes(data, plan).values()
    assert (found.unstable_points, found.largest_growth_rate_1_per_s) == (2, 7.0)
    assert (found.frequency_there_Hz, found.where) == (frequency[1, 2, 2], {"a": 20.0, "b": 3.0})
    flat = xarray.Dataset(
        {
            name: (("sample", "mode"), data[name].values.reshape(6, 4))
            for name in ("unstable", "growth_rate", "frequency")
        },
        {"a": ("sample", np.arange(6.0)), "b": ("sample", 10 + np.arange(6.0))},
    )
    monkeypatch.setattr(summary, "modes_in", lambda data: {"X": where.reshape(6, 4)})
    plan.draws = 6
    assert summary._unstable_modes(flat, plan)["X"].where == {"a": 5.0, "b": 15.0}


def test_transients_of_a_sweep_have_their_largest_amplitudes_as_far_as_they_were_computed(monkeypatch):
    data = xarray.Dataset({
        "trend": ("k", [0, 1, 0, 1, 1]), "outcome": ("k", [COMPUTED, COMPUTED, COMPUTED, NONE, COMPUTED]),
        "amplitude": (("k", "coordinate"), [[1e-5, 4e-6], [2e-5, 1e-6], [3e-6, 5e-6], [9.0, 9.0], [1e-6, 2e-6]]),
        "simulated": ("k", [1.0, 2.5, 3.0, 4.0, 2.0]),
    })  # fmt: skip
    monkeypatch.setattr(summary, "undecided", lambda data: np.array([False, True, False, False, True]))
    monkeypatch.setattr(summary, "squealing", lambda data: np.array([True, True, False, False, True]))
    monkeypatch.setattr(summary, "names_in", lambda data, name: ("X", "Tz"))
    found = summary._responses(data)
    assert (found.points_with_squeal, found.points_not_settled, found.longest_of_them_s) == (3, 2, 2.5)
    assert found.trends == {summary.TRENDS[0]: 2, summary.TRENDS[1]: 1, "not settled": 2}
    assert found.largest_amplitude == {"X": 2e-5, "Tz": 5e-6}


def test_two_descriptions_are_the_same_but_for_round_off():
    one = {"a": [1.0, 2.0, {"b": "x", "c": 3.0}]}
    assert _same(one, {"a": [1.0 + 1e-13, 2.0, {"b": "x", "c": 3.0 - 1e-12}]})
    for other in (
        {"a": [1.0, 2.1, {"b": "x", "c": 3.0}]}, {"a": [1.0, 2.0, {"b": "y", "c": 3.0}]}, {"a": [1.0, 2.0]},
        {"a": [1.0, 2.0, {"b": "x"}]}, {"a": [1.0 + 1e-11, 2.0, {"b": "x", "c": 3.0}]}, {"b": one["a"]},
    ):  # fmt: skip
        assert not _same(one, other)


def test_the_loudest_cell_of_a_matrix_is_named_by_the_axes_that_have_several_levels():
    def cell(verdict: CellVerdict, mu: str, hot: str, level: float = math.nan, **more: Any) -> CellFound:
        known: dict[str, Any] = {
            "outcome": "why", "unstable": True, "growth_rate_1_per_s": 1.0, "frequency_Hz": 543.21,
            "velocity_m_per_s": 0.012345, "after": None, "time_s": math.nan, "speed_rad_per_s": math.nan,
            "small_frequency_Hz": math.nan, "small_velocity_m_per_s": math.nan,
        }  # fmt: skip
        return CellFound(verdict=verdict, level_dB=level, levels={"one": "x", "mu": mu, "hot": hot}, **(known | more))

    cells = (
        cell(CellVerdict.SQUEALS, "0.3", "no", 98.76, after="large, along X"), cell(CellVerdict.SQUEALS, "0.4", "no",
        99.87),
        cell(CellVerdict.QUIET, "0.3", "yes"), cell(CellVerdict.NOT_CLEAR, "0.4", "yes"), cell(CellVerdict.UNDECIDED,
        "0.5", "no"),
        cell(CellVerdict.NOT_COMPUTED, "0.5", "yes"),
    )  # fmt: skip
    found = NoiseMatrix(
        title="", axes={"one": ["x"], "mu": ["0.3", "0.4", "0.5"], "hot": ["no", "yes"]}, cells=cells, squeal=2,
        squeal_after_large_only=1, not_clear=2,
    )  # fmt: skip
    shown = printed(matrix_answer.print_matrix, found)
    headline = "2 of 6 cells squeal, 1 of them after a large disturbance only; 1 is quiet, 2 not clear, 1 not computed"
    for line in (
        headline, "Loudest: 0.0123 m/s rms of the shoe at 543.2 Hz, at hot no, mu 0.4",
        "no 0.3 543.2 98.8 large, along X",
        "no 0.4 543.2 99.9", f"{CellVerdict.NOT_CLEAR} (hot yes, mu 0.4): why",
        f"{CellVerdict.UNDECIDED} (hot no, mu 0.5): why",
        f"{CellVerdict.NOT_COMPUTED} (hot yes, mu 0.5): why",
    ):  # fmt: skip
        assert shown.count(line) == 1, (line, shown)
    timed = cells[1].model_copy(update={"time_s": 1.2345, "speed_rad_per_s": 6.789})
    shown = printed(matrix_answer.print_matrix, found.model_copy(update={"cells": (timed, *cells[2:])}))
    assert "no 0.4 543.2 99.9 1.23 6.79" in shown
    quiet = found.model_copy(update={"squeal": 0, "not_clear": 0, "cells": (cells[2], cells[2])})
    assert printed(matrix_answer.print_matrix, quiet) == ["0 of 2 cells squeal; 2 are quiet"]


def test_signals_of_the_second_shoe_are_at_points_of_its_own():
    scene: Any = SimpleNamespace(prefixes=["a.", "b."])
    first, second, rotation, modal = (
        signals_module._motion(kind, name, scene, np.zeros(3))
        for kind, name in (("velocity", "a.Y"), ("velocity", "b.Y"), ("displacement", "b.Tz"), ("velocity", "b.E2"))
    )
    apart = signals_module.OF_NEXT_SHOE
    assert (first.point, first.direction) == (signals_module.CENTRE_OF_GRAVITY, 2)
    assert (second.point, second.direction) == (signals_module.CENTRE_OF_GRAVITY + apart, 2)
    assert apart > 0
    assert (rotation.direction, rotation.units, rotation.quantity) == (6, "rad", "displacement")
    assert rotation.meaning == "displacement of rotation b.Tz at the centre of gravity"
    assert (second.units, second.name, second.meaning) == (
        "m/s",
        "velocity_b.Y",
        "velocity b.Y at the centre of gravity",
    )
    assert (modal.point, modal.direction, modal.meaning) == (0, 0, "velocity of the amplitude of mode b.E2")
    static = signals_module._motion("displacement", "b.S3", scene, np.zeros(3))
    assert static.meaning == "amplitude of shape b.S3"


def test_springs_at_one_point_are_left_out_together(nominal):
    spring = {"at": (0.1, 0.02, 0.0), "direction": (1.0, 0.0, 0.0), "stiffness": 1e7}
    scene = nominal.with_values({
        "support": None,
        "shoe.spring": [spring, spring | {"at": (0.09, -0.02, 0.0)}, spring | {"direction": (0.0, 1.0, 0.0)}],
    })  # fmt: skip
    springs = {str(each.effect): each.springs for each in reductions_of(scene) if each.springs}
    assert springs == {"springs 0, 2": (0, 2), "spring 1": (1,)}


def test_followed_modes_have_frequencies_and_growth_rates():
    branch: Any = SimpleNamespace(
        label="Tz (2)", values=np.array([1.0, 2.0]), eigenvalues=np.array([-3 + 60j, 4 + 70j])
    )
    found = FollowedMode.of(branch)
    assert (found.values, found.growth_rate_1_per_s, found.name) == ((1.0, 2.0), (-3.0, 4.0), "Tz")
    assert found.frequency_Hz == pytest.approx((60 / (2 * np.pi), 70 / (2 * np.pi)))


def test_a_harmonic_of_a_simulated_line_counts_where_the_fundamental_is_not_measured(monkeypatch):
    """Measured 200 Hz goes with simulated 201 Hz, twice 100.5 Hz, which goes with no measured line, or with one."""
    harmonic = SimpleNamespace(order=2, fundamental=0)
    resolution = SimpleNamespace(spectrum=SimpleNamespace(resolution_Hz=1.0))
    measured: Any = SimpleNamespace(frequency_Hz=np.array([90.0, 200.0]), amplitude=None, tones=resolution)
    simulated: Any = SimpleNamespace(frequency_Hz=np.array([100.5, 201.0]), amplitude=None, tones=resolution)
    found = {90.0: [None, None], 100.5: [None, harmonic]}
    monkeypatch.setattr(compare_study, "find_harmonics", lambda f, amplitude, resolution: found[f[0]])

    def match(reference: int, *, paired: bool) -> Any:
        return SimpleNamespace(reference=reference, paired=paired)

    known = {"harmonic_order": 2, "fundamental_Hz": 100.5, "fundamental_is_simulated": True}
    for first, second, wanted in (
        (None, match(1, paired=True), known), (match(0, paired=False), match(1, paired=True), known),
        (match(0, paired=True), match(1, paired=True), {}), (None, match(1, paired=False), {}), (None, None, {}),
    ):  # fmt: skip
        assert compare_study._harmonics(measured, simulated, [first, second]) == [{}, wanted]
    found[90.0] = [None, harmonic]
    (_, own) = compare_study._harmonics(measured, simulated, [match(0, paired=True), match(1, paired=True)])
    assert own == {"harmonic_order": 2, "fundamental_Hz": 90.0, "fundamental_is_simulated": False}


def test_a_vibration_is_read_from_its_columns_and_pieces(monkeypatch):
    monkeypatch.setattr("drumsqueal.findings.vibration.PIECE", 7)
    values = RNG.normal(size=(2, 20, 3))
    history = xarray.Dataset(
        {name: (("time", "coordinate"), each) for name, each in zip(("displacement", "velocity"), values, strict=True)},
        {"time": 0.5 + np.arange(20) / 8.0, "coordinate": ["Tz", "lost", "X"]},
    )
    steady = np.array([0.3, -0.7])
    of = Vibration(history, SimpleNamespace(coordinates=("X", "Tz"), steady_state=steady))  # pyright: ignore[reportArgumentType]
    moved, speed = values[0][:, [2, 0]] - steady, values[1][:, [2, 0]]
    part = slice(3, 18)
    np.testing.assert_allclose(of.displacement, moved)
    np.testing.assert_allclose(of.read("velocity", part), speed[part])
    np.testing.assert_allclose(of.column("Tz", part), moved[part, 1])
    np.testing.assert_allclose(of.column("X", part, of="velocity"), speed[part, 0])
    np.testing.assert_allclose(of.about(np.full((15, 2), 0.1), part), values[0][part][:, [2, 0]] - 0.1)
    np.testing.assert_allclose(of.extremes(part), [moved[part].min(axis=0), moved[part].max(axis=0)])
    np.testing.assert_allclose(of.largest(part), np.abs(moved[part]).max(axis=0))
    np.testing.assert_allclose(of.mean_square_velocity(part), np.mean(speed[part] ** 2, axis=0))
    assert of.sample_rate == pytest.approx(8.0)
    assert of.largest_rotation == pytest.approx(np.abs(moved[:, 1]).max())
    assert of.started
    assert [(rows.start, rows.stop) for rows, *_ in of.pieces(part)] == [(0, 7), (7, 14), (14, 15)]
    left = RNG.normal(size=4) + 1j * RNG.normal(size=4)
    wanted = 2 * np.hstack([moved, speed])[part] @ left.conj()
    np.testing.assert_allclose(of.modal(SimpleNamespace(left=left), part), wanted)  # pyright: ignore[reportArgumentType]
    assert list(of.spectra(slice(0, 15))) == []
    names = [name for name, _ in of.spectra(slice(0, 16))]
    assert names == ["X", "Tz"]
    assert [name for name, _ in of.spectra(slice(0, 16), ["Tz"])] == ["Tz"]
