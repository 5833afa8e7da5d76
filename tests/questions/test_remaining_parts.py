"""What is left of words, noise, units, marks of failure and small decisions, each where it just comes to differ."""

import io
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.stats
import xarray
from rich.console import Console

from drumsqueal.dynamics.attractor import (
    SMALL_START,
    Attractor,
    Disturbance,
    Response,
    SteadyResponse,
    VelocityPerturbation,
)
from drumsqueal.dynamics.cycles.cycle import RangeKind as Outcome
from drumsqueal.errors import Ending
from drumsqueal.files import universal
from drumsqueal.findings import saturation
from drumsqueal.findings.compare import RelativeChange, measure_accuracy
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.signals import growth, spectra
from drumsqueal.findings.signals.growth import find_exponentials
from drumsqueal.findings.signals.regime import listed
from drumsqueal.findings.signals.spectra import Spectrum
from drumsqueal.findings.vibration import Vibration
from drumsqueal.physics.effects.pressure import Unilateral
from drumsqueal.physics.model import build_model
from drumsqueal.questions import stability as bistable
from drumsqueal.questions import stability as stability_answer
from drumsqueal.questions.accuracy import study as accuracy_study
from drumsqueal.questions.accuracy import study as bench
from drumsqueal.questions.accuracy.study import Errors, Measurement
from drumsqueal.questions.commands.onset import example
from drumsqueal.questions.compare import answer as compare_answer
from drumsqueal.questions.compare.study import MeasuredLine
from drumsqueal.questions.cycle import study as cycle_words
from drumsqueal.questions.export import export
from drumsqueal.questions.export import signals as signals_module
from drumsqueal.questions.fit import record
from drumsqueal.questions.fit import squeal as squeal_module
from drumsqueal.questions.fit import study as fit_study
from drumsqueal.questions.fit.estimate import Scale
from drumsqueal.questions.fit.record import RecordKind, RecordLine, RecordReading
from drumsqueal.questions.fit.squeal import SimulatedSqueal, Varied, fit_squeal
from drumsqueal.questions.onset import found as onset_words
from drumsqueal.questions.onset import study as onset_study
from drumsqueal.questions.onset.found import Row, _between, _bracket, _DisturbanceSearch
from drumsqueal.questions.report import answer as run_page
from drumsqueal.questions.sensitivity import disturbing
from drumsqueal.questions.sensitivity.quieting import Quietening
from drumsqueal.questions.sensitivity.stabilising import Problem
from drumsqueal.questions.sweep import matrix_cells
from drumsqueal.questions.sweep import study as sweep_study
from drumsqueal.questions.sweep.cluster import Cluster
from drumsqueal.questions.sweep.points import COMPUTED, FAILED
from drumsqueal.scene.variation import Variation
from drumsqueal.solve import shooting
from drumsqueal.solve.linear.branches import Critical


def printed(show: Any, *given: Any) -> list[str]:
    """The lines that are printed, each with one blank between its words."""
    console = Console(width=400, record=True, file=io.StringIO())
    show(console, *given)
    return [" ".join(line.split()) for line in console.export_text().splitlines() if line.strip()]


# --- words -----------------------------------------------------------------------------------------------------------


def test_several_texts_are_joined_by_commas_and_a_last_and():
    assert [listed(each) for each in (["a"], ["a", "b"], ["a", "b", "c", "d"])] == [
        "a", "a and b", "a, b, c and d"
    ]  # fmt: skip
    study: Any = SimpleNamespace(variation=Variation("x", "N", (1.0, 9.0)))
    assert onset_words._values(study, [1.0, 2.0, 3.0]) == "1 N, 2 N and 3 N"
    assert onset_words._values(study, [1.0, 2.0, 3.0, 4.0, 5.0]) == "1 N, 2 N, 3 N and 2 more"


def test_squeal_of_a_bistable_range_is_compared_with_the_eigenvalue_at_its_critical_value():
    motions = tuple(SimpleNamespace(frequency_Hz=f) for f in (123.4, None, 98.76))
    rows = (
        SimpleNamespace(
            kind=Outcome.BISTABLE, asked=True, motions=motions, small=SimpleNamespace(leads_to=Kind.DECAYS)
        ),
        SimpleNamespace(kind=Outcome.SQUEALS, asked=True, motions=(SimpleNamespace(frequency_Hz=9.0),), small=None),
    )
    found = SimpleNamespace(kind=Outcome.BISTABLE, first=2.0, last=5.0, first_uncertainty=0.1, last_uncertainty=1e-9)
    critical = Critical(5.0, 1e-9, "X", 104.3, True)
    study: Any = SimpleNamespace(
        variation=Variation("x", "N", (1.0, 9.0)), values=rows, ranges=(found,),
        critical_values=(Critical(7.0, 1e-9, "Y", 999.0, True), critical),
    )  # fmt: skip
    text = onset_words._bistable(study)
    assert text == (
        "bistable from 2.0 ± 0.1 to 5 N: steady sliding is stable there, but a large disturbance leads to squeal, at "
        "the values tried at 98.8 to 123 Hz (eigenvalue at the critical value: 104 Hz)"
    )
    study.critical_values = ()
    assert onset_words._bistable(study).endswith("at 98.8 to 123 Hz")
    rows[0].small.leads_to = Kind.NEUTRAL
    assert "is neutral there (small motion neither grows nor decays)" in onset_words._bistable(study)
    rows[0].motions = (SimpleNamespace(frequency_Hz=None),)
    assert onset_words._bistable(study).endswith("leads to squeal")


def test_eigenvalues_and_steady_sliding_are_printed():
    def mode(label: str, frequency: float, rate: float, *, unstable: bool) -> Any:
        return SimpleNamespace(
            name=label, frequency_Hz=frequency, growth_rate=rate, damping_ratio=-rate / 1000, unstable=unstable
        )

    modes = (mode("X", 101.234, -5.6789, unstable=False), mode("Y", 202.345, 6.7891, unstable=True))
    stability: Any = SimpleNamespace(
        modes=modes, unstable=modes[1:], eigenvalues=np.array([-5 + 600j, -5 - 600j, -7.6543, 1e-13]), divergence=None,
        coordinates=("X", "Tz", "E1", "E2"), steady_state=np.array([1.2345e-6, 0.0, 3.0, 4.0]), time=0.0,
        pressure_range=(1234.56, 98765.4), unresolved=(2.5 + 6283j,),
    )  # fmt: skip
    lines = printed(stability_answer.print_eigenvalues, stability)
    assert "Beyond what is resolved one more grows, at 1000 Hz, +2.5 1/s: raise up_to to see what it is." in lines
    for line in (
        "Y 202.35 Hz +6.789 1/s -0.679 % unstable", "X 101.23 Hz -5.679 1/s +0.568 % stable",
        "1 of 2 modes is unstable.",
    ):  # fmt: skip
        assert line in [each.replace("202.34 Hz", "202.35 Hz") for each in lines], (line, lines)
    assert any(line.startswith("Without oscillation: -7.654 1/s, 0.000 1/s (0:") for line in lines)
    assert [line.split()[0] for line in lines if "stable" in line][:2] == ["Y", "X"]
    sliding = printed(stability_answer.print_sliding, stability, None)
    assert "Steady sliding at X = 1.234e-06 m, bent in 2 shapes" in sliding
    assert "Steady pressure from 1.23 to 98.77 kPa along the lining" in sliding
    stability.time = 0.75
    later = printed(stability_answer.print_sliding, stability, None)
    assert any("are those at t = 0.75 s" in line for line in later)


def test_the_mode_that_grows_fastest_is_shown_first(monkeypatch):
    eigenvalues = (-3 + 900j, 5 + 600j, 4 + 1200j)
    modes = tuple(SimpleNamespace(eigenvalue=each) for each in eigenvalues)
    drawn = {"modes": [{"name": name, "enlarged": 2e-3} for name in ("X", "Y", "Tz")], "z": 1}
    monkeypatch.setattr(
        run_page, "animate", lambda prepared, given: {**drawn, "modes": [dict(m) for m in drawn["modes"]]}
    )
    prepared: Any = SimpleNamespace(stability=SimpleNamespace(modes=modes), model=None)

    def summary(off: float = 0.0, saturation: Any = None) -> Any:
        stated = [
            SimpleNamespace(growth_rate_1_per_s=each.real + off, frequency_Hz=each.imag / math.tau)
            for each in eigenvalues
        ]
        return SimpleNamespace(prediction=SimpleNamespace(modes=stated), saturation=saturation)

    found = run_page._animation(prepared, summary())
    assert found is not None
    assert found["first"] == 1
    assert all(mode["size"] == "It took no part in the motion after growth." for mode in found["modes"])
    saturation = SimpleNamespace(amplitude={"X": 3.456e-5, "Tz": 1e-6})
    found = run_page._animation(prepared, summary(saturation=saturation))
    assert found is not None
    assert found["modes"][0]["size"] == "X is drawn 57.9 times as large as the 34.6 µm that it reached in this run."
    assert found["modes"][1]["size"].startswith("It took no part")
    largest = 1200.0
    assert run_page._animation(prepared, summary(0.9 * run_page.SAME * largest)) is not None
    assert run_page._animation(prepared, summary(1.1 * run_page.SAME * largest)) is None


# --- signals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("segments", [1, 2, 7])
def test_noise_exceeds_its_threshold_in_one_record_of_a_thousand(segments):
    """By χ² of two degrees of freedom a segment, of which those that overlap count for 18 of 19."""
    bins, step = 400, 0.5
    frequency: Any = np.arange(8 * bins) * step
    found = spectra._noise_threshold(Spectrum(frequency, np.full(8 * bins, 0.3), 8 * 1.5 * step), segments)
    independent = 1.0 if segments == 1 else segments * 18 / 19
    chance = 1e-3 / (4 * bins)
    over = scipy.stats.chi2.isf(chance, 2 * independent) / scipy.stats.chi2.median(2 * independent)
    unsure = 1 + 4 / math.log(2) / math.sqrt(120 * independent)
    np.testing.assert_allclose(found, 0.3 * math.sqrt(over * unsure), rtol=1e-6)


def test_a_line_that_is_led_below_the_lowest_ends_the_search(monkeypatch):
    rate, time = 2000.0, np.arange(1000) / 2000.0
    record = np.exp(-4 * time) * np.cos(2 * np.pi * 200 * time) + 0.3 * np.cos(2 * np.pi * 44 * time + 1)
    offered = iter([(-4 + 2j * np.pi * 200.1, 9.0), (0 + 2j * np.pi * 45, 4.0)])
    monkeypatch.setattr(growth, "_strongest", lambda rest, rate, lowest: next(offered, None))
    assert find_exponentials(record, rate, lowest=60.0).frequency_Hz == pytest.approx([200.0], abs=0.5)
    offered = iter([(-4 + 2j * np.pi * 200.1, 9.0), (0 + 2j * np.pi * 45, 4.0)])
    assert find_exponentials(record, rate, lowest=20.0).frequency_Hz == pytest.approx([200.0, 44.0], abs=1e-6)
    # What is 50 dB below the strongest in energy is not looked at.
    for energy, lines in ((0.9e-5, 1), (1.1e-5, 2)):
        offered = iter([(-4 + 2j * np.pi * 200.1, 1.0), (0 + 2j * np.pi * 45, energy)])
        assert find_exponentials(record, rate, lowest=20.0).frequency_Hz.size == lines


def test_periods_are_tried_by_how_near_the_last_state_comes_and_how_soon(monkeypatch):
    """An arc is off its chord by (2π/n)²/8 of n samples a turn: what is nearer than that is as near as that."""
    away = {1: 0.02, 2: 0.011, 3: 0.001, 4: 0.31}
    rate, line = 2000.0, 100.0
    asked = []

    def nearest(last, path):
        asked.append(len(path))
        return away[len(asked)], 5.0

    monkeypatch.setattr(saturation, "_nearest", nearest)
    record: Any = SimpleNamespace(sample_rate=rate, frequency_Hz=line)
    scaled = np.zeros((86, 2))
    found = saturation._periods(scaled, record)
    # Of 20 samples a turn it is 0.0123: 0.02 × 1, 0.0123 × 2 and 0.0123 × 3, and what is 0.31 away is none.
    assert found == pytest.approx([(25 - 5) / rate, (45 - 5) / rate, (65 - 5) / rate])
    assert asked == [11] * 4
    asked.clear()
    away |= {1: 0.05, 2: 0.02, 3: 0.001}
    assert saturation._periods(scaled, record) == pytest.approx([60 / rate, 40 / rate, 20 / rate])


def test_units_of_universal_files_are_metres_and_newtons():
    inch, pound = 0.0254, 0.45359237 * 9.80665
    for code, length, force in (
        (1, 1.0, 1.0), (2, 0.3048, pound), (3, 1.0, 9.80665), (4, 0.3048, 0.45359237 * 0.3048), (5, 1e-3, 1e-3),
        (6, 1e-2, 1e-2), (7, inch, pound), (8, 1e-3, 9.80665), (10, 1e-3, 1.0),
    ):  # fmt: skip
        assert universal.units_of({"units_code": code}) == pytest.approx((length, force), rel=1e-9), code
    # A unit of one's own is so many in a metre, and in a newton.
    assert universal.units_of({"units_code": 9, "length": 4.0, "force": 5.0}) == (0.25, 0.2)
    assert universal.units_of({"units_code": 9, "length": 0.0, "force": 5.0}) is None
    assert universal.units_of({}) is None
    quantities = {
        8: ("displacement", "m", "rad"), 11: ("velocity", "m/s", "rad/s"), 12: ("acceleration", "m/s^2", "rad/s^2"),
        9: ("force", "N", "N*m"), 13: ("force", "N", "N*m"), 15: ("pressure", "Pa", ""),
    }  # fmt: skip
    assert {code: tuple(each) for code, each in universal.DATA_TYPES.items()} == quantities
    assert (universal.type_of("velocity"), universal.type_of("force"), universal.type_of("x")) == (
        11,
        9,
        universal.GENERAL,
    )


# --- fits ------------------------------------------------------------------------------------------------------------


def line(f: float, error: float = 1e-4, rate: float | None = None, size: float = 1.0) -> RecordLine:
    return RecordLine(
        frequency_Hz=f, frequency_uncertainty_Hz=error, growth_rate_1_per_s=rate,
        growth_rate_uncertainty_1_per_s=None if rate is None else 0.1, amplitude=size,
    )  # fmt: skip


def test_eigenvalues_are_fitted_to_the_lines_that_have_a_mode(monkeypatch):
    asked: dict[str, Any] = {}
    lines = (line(100.0, rate=-3.0), line(150.0, rate=2.0), line(210.0, rate=4.0))
    modes = tuple(
        SimpleNamespace(name=name, label=f"{name} l", frequency_Hz=f, growth_rate=1.0)
        for name, f in (("X", 101.0), ("Y", 209.0))
    )

    class Modes:
        labels = ("X l", "Y l")

        def __init__(self, scene, keys) -> None:
            assert (scene, keys) == ("frozen at 0.75", ["a"])
            self.modes = modes

        def at(self, numbers):
            return SimpleNamespace(eigenvalues=numbers[0] * np.array([-1 + 600j, 2 + 1300j]))

    def fit_lines(given, places, of, scale):
        asked["fitted"] = given, places
        return SimpleNamespace(x=np.array([math.log(1.5)]))

    def assign(given, of, scale, moved):
        asked["moved"] = moved
        return SimpleNamespace(modes=places, rival=(1, None, None))

    places: tuple[int | None, ...] = (0, None, 1)
    monkeypatch.setattr(fit_study, "prepare", lambda scene: SimpleNamespace(stability=SimpleNamespace(time=0.75)))
    monkeypatch.setattr(fit_study, "at_one_time", lambda scene, time: f"frozen at {time}")
    monkeypatch.setattr(fit_study, "Eigenmodes", Modes)
    monkeypatch.setattr(fit_study, "kept_coordinates", lambda scene: ("Y",))
    monkeypatch.setattr(fit_study, "assign", assign)
    monkeypatch.setattr(fit_study, "fit_lines", fit_lines)
    reading = RecordReading(kind=RecordKind.LINEAR, reason="", from_s=0.0, until_s=1.0, lines=lines)
    scale = Scale.of(("a",), [2.0])

    def found() -> Any:
        return fit_study._fit_linear(None, ["a"], scale, reading)  # pyright: ignore[reportArgumentType]

    result = found()
    assert asked == {"fitted": ([lines[0], lines[2]], [0, 1]), "moved": [False, True]}
    assert (result.observations, result.known, result.transients) == (4, True, 0)
    assert [row.mode for row in result.lines] == ["X l", None, "Y l"]
    assert result.lines[0].before_Hz == pytest.approx(1200 / math.tau)
    assert result.lines[0].after_Hz == pytest.approx(1800 / math.tau)
    assert (result.lines[2].before_growth_rate_1_per_s, result.lines[2].after_growth_rate_1_per_s) == pytest.approx(
        (4, 6)
    )
    assert result.ambiguous == (
        "another assignment of lines to modes fits as well: 100.0 Hz as Y l, 210.0 Hz as no mode"
    )
    places = (None, None, None)
    with pytest.raises(
        fit_study.RequestError, match=r"\(100 Hz -3 1/s, 150 Hz \+2 1/s, .*\(X l 101 Hz \+1 1/s, Y l 209"
    ):
        found()


def test_numbers_of_a_saturated_squeal_are_fitted_along_curves(monkeypatch):
    """Lines 100 e^(0.5 a + 0.2 a² + 0.2 b) and 260 e^(0.3 b − 0.1 a) are brought onto those of a = 0.2, b = −0.15."""

    def lines(x: Any) -> tuple[float, float]:
        a, b = x
        return 100 * math.exp(0.5 * a + 0.2 * a**2 + 0.2 * b), 260 * math.exp(0.3 * b - 0.1 * a)

    ran = []

    def simulate(at, signal, progress):
        ran.append(tuple(at.x))
        return SimulatedSqueal(tuple(map(line, lines(at.x))), np.zeros(3), at)

    def change(scene, x):
        return SimpleNamespace(x=np.array(x))

    monkeypatch.setattr(squeal_module, "simulate", simulate)
    measured = [line(f, 2e-4) for f in lines((0.2, -0.15))]
    begin = SimulatedSqueal(tuple(map(line, lines((0.0, 0.0)))), np.zeros(3), SimpleNamespace(x=np.zeros(2)))  # pyright: ignore[reportArgumentType]
    scale = Scale.of(("a", "b"), [3.0, 7.0])
    found = fit_squeal(Varied(change, scale, "so", lambda *_: None), measured, begin, np.zeros(2))  # pyright: ignore[reportArgumentType]
    assert found is not None
    np.testing.assert_allclose(found.estimate.x, [0.2, -0.15], atol=1e-5)
    np.testing.assert_allclose(found.before, [100.0, 260.0])
    np.testing.assert_allclose(found.after, [each.frequency_Hz for each in measured], atol=1e-3)
    np.testing.assert_allclose(found.wanted, [0.2, -0.15], atol=1e-5)
    assert found.transients == 1 + len(ran)
    # The slopes there, over the uncertainty of both lines, without what differences leave of it.
    f, g = lines((0.2, -0.15))
    slopes = np.array([[f * (0.5 + 0.4 * 0.2), 0.2 * f], [-0.1 * g, 0.3 * g]]) / math.hypot(1e-4, 2e-4)
    inverse = np.linalg.inv(slopes.T @ slopes)
    # Differences of a step of 2 % are off by that, times the bend of 0.2 of a slope of 0.58.
    errors = np.sqrt(np.diag(inverse))
    np.testing.assert_allclose(
        found.estimate.covariance / np.outer(errors, errors), inverse / np.outer(errors, errors), atol=0.05
    )


def test_what_a_number_may_change_a_line_by_counts_where_differences_do_not_show_it(monkeypatch):
    """A difference below three times its error is none; squared, times its width, it adds to the line's uncertainty."""

    def simulate(at, signal, progress):
        return SimulatedSqueal((line(100.0 + 0.02 * at.x[0], 0.01), line(210.0 + 40 * at.x[0], 0.01)), np.zeros(3), at)

    monkeypatch.setattr(squeal_module, "simulate", simulate)
    run = Varied(lambda scene, x: SimpleNamespace(x=x), Scale.of(("a",), [1.0]), "so", lambda *_: None)  # pyright: ignore[reportArgumentType]
    work = squeal_module._Work(run, [line(100.0), line(210.0)])
    here = squeal_module._Lines.of(
        np.zeros(1),
        [line(100.0, 0.01), line(210.0, 0.01)],
        SimulatedSqueal((line(100.0), line(210.0)), np.zeros(3), None),  # pyright: ignore[reportArgumentType]
    )
    found = work.derivatives(here)
    np.testing.assert_allclose(found, [[0.0], [40.0]], atol=1e-9)
    error = math.hypot(0.01, 0.01) / abs(squeal_module.STEPS[-1])
    assert work.faint == pytest.approx([(squeal_module.WIDTH * max(error, 0.02)) ** 2, 0.0])
    residual, jacobian = work.residuals(here, found)(np.array([0.1]))
    spread = math.hypot(work.error[1], 0.01)
    assert residual[1] == pytest.approx(4.0 / spread)
    assert jacobian[1, 0] == pytest.approx(40.0 / spread)
    assert jacobian[0, 0] == 0


# --- searches --------------------------------------------------------------------------------------------------------


def test_a_branch_folds_in_a_crossing_where_its_slope_takes_a_tenth_of_its_bend_at_most():
    """Along a branch p = p₀ + s x + b x², whose middle of both sides lies b x² from the crossing."""

    def folds(slope: float, bend: float, missing: float = 0.0) -> bool:
        along = np.array([0.6, 0.8, 0.0, slope])
        here = np.array([1.0, 2.0, 1.0, 5.0])

        def close(guess, motion):
            np.testing.assert_allclose(motion, [0.6, 0.8, 0.0, 0.0])
            x = (guess - here)[:3] @ along[:3]
            assert np.isclose(abs(x), shooting.BESIDE / 2.0 ** np.arange(shooting.NEARER)).any()
            if missing * x > 0:
                return None
            return SimpleNamespace(unknowns=np.append(guess[:3], here[3] + slope * x + bend * x**2))

        closed: Any = SimpleNamespace(unknowns=here)
        return shooting._folds(SimpleNamespace(close=close), closed, along)  # pyright: ignore[reportArgumentType]

    far = shooting.BESIDE  # |s x| against a tenth of |b| x²
    for bend in (3.0, -3.0):
        assert folds(0.099 * 3.0 * far, bend)
        assert folds(-0.099 * 3.0 * far, bend)
        assert not folds(0.101 * 3.0 * far, bend)
    for side in (1.0, -1.0):
        with pytest.raises(shooting.CycleError, match="no cycle of a branch next to"):
            folds(0.0, 1.0, missing=side)


def response(
    size: float, leads: Kind = Kind.DECAYS, motion: Any = None, mode: str = "X", *, forwards: bool = True
) -> Any:
    disturbance = SimpleNamespace(mode=mode, forwards=forwards, energy_J=size**2)
    return SimpleNamespace(disturbance=disturbance, leads_to=leads, motion=motion)


class AMotion(SimpleNamespace):
    """A motion that is the same as those of its name."""

    def same(self, other: Any) -> bool:
        return other.name == self.name


def a_search(motions: Any, *starts: Any, sizes: Any = (1.0, 2.0, 4.0)) -> Any:
    found = _DisturbanceSearch.__new__(_DisturbanceSearch)
    ways = [
        SimpleNamespace(mode=SimpleNamespace(label=name), forwards=forwards, sizes=list(sizes), least=sizes[0])
        for name, forwards in (("X", True), ("X", False))
    ]
    row = SimpleNamespace(starts=starts, point=None, motions=motions)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("drumsqueal.questions.onset.found.directions", lambda point, family: ways)
        _DisturbanceSearch.__init__(found, row, None)  # pyright: ignore[reportArgumentType]
    return found, ways


def test_a_way_that_was_tried_up_to_its_largest_size_is_not_tried_again():
    loud = AMotion(name="loud")
    found, (forwards, backwards) = a_search([loud], response(2.0), response(4.0 * (1 + 1e-12), Kind.SQUEALS, loud))
    # Backwards nothing was tried yet; forwards the largest was.
    assert found.next() == [(backwards, 1.0), (backwards, 2.0), (backwards, 4.0)]
    found, _ = a_search([loud], response(2.0 * (1 + 1e-12)), response(9.0, forwards=False))
    assert found.next() == [(forwards_of(found), 1.0), (forwards_of(found), 4.0)]
    # Then what lies between, where less energy may do: 2 decays and 4 squeals forwards, and 3 squeals backwards.
    found, (forwards, backwards) = a_search(
        [loud], response(2.0), response(4.0, Kind.SQUEALS, loud), response(1.0, forwards=False),
        response(3.0, Kind.SQUEALS, loud, forwards=False), response(4.0, Kind.SQUEALS, loud, forwards=False),
    )  # fmt: skip
    tasks = found.next()
    steps = lambda low, high: [low * (high / low) ** (k / 4) for k in (1, 2, 3)]  # noqa: E731
    assert [way is forwards for way, _ in tasks] == [True] * 3 + [False] * 3
    assert [size for _, size in tasks] == pytest.approx(steps(2.0, 4.0) + steps(1.0, 3.0))
    found, (forwards, backwards) = a_search(
        [loud], response(3.5), response(4.0, Kind.SQUEALS, loud), response(1.0, forwards=False),
        response(3.0, Kind.SQUEALS, loud, forwards=False), response(4.0, Kind.SQUEALS, loud, forwards=False),
    )  # fmt: skip
    assert all(way is backwards for way, _ in found.next())  # forwards it takes more than 3 anyway


def forwards_of(found: Any) -> Any:
    return found._directions[0]


def test_a_bracket_is_the_largest_that_leads_elsewhere_below_the_smallest_that_leads_there():
    loud, other = AMotion(name="loud"), AMotion(name="other")
    led = {
        1.0: response(1.0), 2.0: response(2.0, Kind.SQUEALS, other), 2.5: response(2.5, Kind.UNDECIDED),
        3.0: response(3.0, Kind.SQUEALS, loud), 4.0: response(4.0), 5.0: response(5.0, Kind.SQUEALS, loud),
    }  # fmt: skip
    assert _bracket(led, loud) == (2.0, 3.0)  # pyright: ignore[reportArgumentType]
    assert _bracket({3.0: led[3.0]}, loud) == (0.0, 3.0)  # pyright: ignore[reportArgumentType]
    assert _bracket({1.0: led[1.0]}, loud) == (1.0, math.inf)  # pyright: ignore[reportArgumentType]
    assert _between(0.0, 8.0) == pytest.approx([8.0 / 2**k for k in range(1, 11)])
    assert _between(2.0, math.inf) == []
    assert (_between(2.0, 2.039), len(_between(2.0, 2.041))) == ([], 3)


def test_a_motion_that_is_lost_where_the_drum_all_but_stands_has_not_failed(monkeypatch):
    """The drum turns until 0.212 s; one that is lost at 0.215 s, in a chunk that begins before, has not failed."""
    rate = 2000.0

    def model(stops: float) -> Any:
        def at(time):
            return np.where(np.asarray(time) < stops, -8.0, 0.0), None

        return SimpleNamespace(operation=SimpleNamespace(drum_speed=SimpleNamespace(value=np.array([-8.0]), at=at)))

    def integrate_many(models, *given, **how):
        for first in range(0, 521, 70):
            time = np.arange(first, min(first + 70, 521)) / rate
            motion = np.zeros((1, time.size, 2))
            motion[0, time > 0.2149] = np.nan
            yield SimpleNamespace(time=time, vibration=motion, velocity=motion)

    monkeypatch.setattr(matrix_cells, "_heard", lambda *given: (None, False))
    monkeypatch.setattr(matrix_cells, "integrate_many", integrate_many)
    start = SimpleNamespace(vibration=np.zeros(2), velocity=np.zeros(2))
    simulate = SimpleNamespace(sample_rate=rate, duration=0.26, tolerance=1e-5, solver="auto")
    for stops, outcome in ((0.212, COMPUTED), (0.218, FAILED)):
        cell: Any = SimpleNamespace(
            starts=[start], scene=SimpleNamespace(simulate=simulate), model=model(stops), linear=None,
            family=SimpleNamespace(shown=lambda q: q), stability=SimpleNamespace(steady_state=np.zeros(2)),
        )  # fmt: skip
        assert matrix_cells._through(cell, None, lambda *_: None) == ([], outcome)


# --- studies ---------------------------------------------------------------------------------------------------------


def compared(measured: float, **more: Any) -> MeasuredLine:
    return MeasuredLine(measured_Hz=measured, amplitude=1.0, unit="Pa", level_dB=-3.21, rms_of_0_dB=2e-5, **more)


def test_a_comparison_is_printed_line_by_line_as_far_as_there_is_room(monkeypatch):
    pair = {"nearest_simulated_Hz": 101.234, "over_simulated": -0.01219, "simulated_is_pair": True}
    near = {"nearest_mode": "X", "nearest_mode_Hz": 90.123, "over_mode": 0.1096, "mode_is_pair": False}
    lines = [
        compared(100.0, **pair, **near, level_over_simulated_dB=0.04),
        compared(200.0, harmonic_order=2, fundamental_Hz=100.0, fundamental_is_simulated=False),
        compared(300.0, harmonic_order=3, fundamental_Hz=99.5, fundamental_is_simulated=True),
        compared(400.0, **(pair | {"simulated_is_pair": False}), level_over_simulated_dB=-5.55),
    ]
    monkeypatch.setattr(compare_answer, "PRINTED", 3)
    monkeypatch.setattr(compare_answer, "zero_level", lambda comparison: None)
    monkeypatch.setattr(compare_answer, "describe_table", lambda comparison: "a table")
    shown = printed(compare_answer._print_table, SimpleNamespace(lines=lines))
    for line in (
        "100.00 -3.2 101.23 -1.219 0.0 (X 90.12) (+11.0)", "200.00 -3.2 - - - 2 × 100.00 -",
        "300.00 -3.2 - - - (3 × 99.50) -", "and 1 weaker ones, in the table", "a table",
    ):  # fmt: skip
        assert shown.count(line) == 1, (line, shown)
    monkeypatch.setattr(compare_answer, "PRINTED", 4)
    shown = printed(compare_answer._print_table, SimpleNamespace(lines=lines))
    assert "400.00 -3.2 (101.23) (-1.2) -5.5 - -" in [each.replace("-5.6", "-5.5") for each in shown]
    assert not any(line.startswith("and ") for line in shown)


def test_growth_rates_that_fall_are_named_from_the_smallest_value_to_the_largest():
    paper = example()
    rates = {name: k + np.array([1.0, 9.0, 4.0, 5.5]) for k, name in enumerate(paper.SQUEALING)}
    curve: Any = SimpleNamespace(
        values=np.array([-4.0, -1.0, -3.0, -2.0]), shown=np.array([-40.0, -10.0, -30.0, -20.0]), rate=rates.__getitem__,
        axis=SimpleNamespace(figure="7", unit="rpm"),
    )  # fmt: skip
    found = paper.falls(curve, "so")
    (reading,) = found.readings
    assert (found.figure, found.statement, reading.value, reading.condition) == ("7", "so", -1.5, "< 0 1/s")
    first, *_ = paper.SQUEALING
    assert reading.detail.startswith(f"from 10 to 40 rpm: {first} 9.0 to 1.0, ")
    assert reading.measure == "largest rise of one of them, from any of 4 values to a larger one"
    assert found.verdict == "confirmed"
    rates[first][2] = 6.0
    assert paper.falls(curve, "so").readings[0].value == pytest.approx(0.5)


def test_an_accuracy_study_gives_up_lines_that_are_slow_and_names_the_cheapest(monkeypatch, nominal):
    def configuration(name: str) -> Any:
        return SimpleNamespace(
            name=name, cause="c", line="l", setting=1.0, solver=f"s{name}", tolerance=1e-5, whole=True
        )

    lines = [[configuration("a"), configuration("b"), configuration("c")], [configuration("d")]]
    seconds = {"a": (0.1, 0.2), "b": (0.3, accuracy_study.LONGEST + 0.1), "d": (0.5,)}
    errors = {"a": 2e-3, "b": 9e-4, "d": 9.9e-5}
    evaluations = {"a": 10.0, "b": 20.0, "d": 50.0}
    ran, kept = [], []

    class Made:
        growth_end, separation, scatter = 0.2, 0.1, RelativeChange(None, None, None, None)
        reference = SimpleNamespace(uncertainty=lambda end: 1e-7 * end)
        prepared = SimpleNamespace(model="model")

        def __init__(self, scene, progress) -> None:
            pass

        def measure(self, configuration, what):
            ran.append((configuration.name, what))
            found = Errors(errors[configuration.name], None, self.scatter, 0.0)
            return Measurement(
                configuration,
                Ending.COMPLETE,
                0.5,
                seconds[configuration.name],
                0.1,
                evaluations[configuration.name],
                found,
            )

    monkeypatch.setattr(accuracy_study, "Benchmark", Made)
    monkeypatch.setattr(accuracy_study, "configurations_of", lambda model, solvers: iter(lines))
    monkeypatch.setattr(accuracy_study, "describe_verdict", lambda study: "So it is.")
    monkeypatch.setattr(accuracy_study, "describe_limits", lambda study: ("a limit",))
    found = accuracy_study.study_accuracy(nominal, 1e-3, keep=kept.append)
    assert ran == [("a", "1 of 4: a"), ("b", "2 of 4: b"), ("d", "4 of 4: d")]
    assert [each.outcome for each in found.measurements] == [Ending.COMPLETE] * 2 + [Ending.SKIPPED, Ending.COMPLETE]
    assert [len(each.runs) for each in kept] == [1, 2, 3, 4]
    assert (found.cheapest and found.cheapest.configuration.name) == "b"
    assert (found.ten_times_better and found.ten_times_better.configuration.name) == "d"  # 9.9e-5 of 1e-4
    assert found.simulate is not None
    assert (found.simulate["solver"], found.simulate["tolerance"], found.growth_end) == ("sb", 1e-5, 0.2)
    assert (found.verdict, found.remarks, found.separation) == ("So it is.", ("a limit",), 0.1)
    errors["d"] = 1.01e-4
    assert accuracy_study.study_accuracy(nominal, 1e-3).ten_times_better is None
    for wrong in (0.0, 1.0):
        with pytest.raises(ValueError, match="between 0 and 1"):
            accuracy_study.study_accuracy(nominal, wrong)


def test_signals_of_the_lining_are_at_half_of_the_arc_of_its_own_shoe(monkeypatch):
    asked = []

    def surface_velocity(scene, velocity, angle, *, along_drum=False, shoe=0):
        asked.append((round(angle, 6), along_drum, shoe))
        return np.full(3, angle)

    monkeypatch.setattr(signals_module, "surface_velocity", surface_velocity)
    scene: Any = SimpleNamespace(
        prefixes=["a.", "b."], shoes=[SimpleNamespace(arc_angle=2.2), SimpleNamespace(arc_angle=1.4)]
    )
    surface, apart = signals_module.SURFACE, signals_module.OF_NEXT_SHOE
    names = ("", "_radial", "_leading", "_leading_along", "_trailing", "_trailing_along")
    found = [signals_module._surface(scene, f"b.{surface}{name}", np.zeros((3, 4))) for name in names]
    assert asked == [(0.0, True, 1), (0, False, 1), (-0.7, False, 1), (-0.7, True, 1), (0.7, False, 1), (0.7, True, 1)]
    assert [each.direction for each in found] == [2, 1, 1, 2, 1, 2]
    middle, leading, trailing = (signals_module.MIDDLE, signals_module.LEADING_END, signals_module.TRAILING_END)
    assert [each.point - apart for each in found] == [middle, middle, leading, leading, trailing, trailing]
    assert all(each.meaning.startswith("b: ") for each in found)
    assert [each.name for each in found] == [f"b.{surface}{name}" for name in names]
    assert [each.units for each in found] == ["m/s"] * 6
    first = signals_module._surface(scene, f"a.{surface}_leading", np.zeros((3, 4)))
    assert (first.point, asked[-1]) == (leading, (-1.1, False, 0))


def test_no_crossing_is_what_does_not_close_or_keeps_its_rank(monkeypatch):
    """A search that ends at a state of which one coordinate closes and another does not has found nothing."""
    known = {"ends": np.array([0.0, 0.0]), "rank": 0.0}

    def flow(shooting, unknowns):
        return SimpleNamespace(end=unknowns[:2] + known["ends"], rate=np.array([3.0, -4.0]))

    def slopes(shooting, found, phase):
        return np.array([[1.0, 0.0, 0.0, 0.0], [0.0, known["rank"], 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])

    monkeypatch.setattr(shooting, "_flow", flow)
    monkeypatch.setattr(shooting, "_slopes", slopes)
    monkeypatch.setattr(shooting, "_directions", lambda *given: np.array([[0.6, 0.0, 0.0, 0.8], [1.0, 0.0, 0.0, 1e-4]]))
    monkeypatch.setattr(shooting.scipy.optimize, "root", lambda equations, start, **how: SimpleNamespace(x=start))
    monkeypatch.setattr(shooting, "_folds", lambda shooting, closed, along: along[-1] == 1e-4)
    guess = np.array([1.0, 2.0, 1.0, 5.0])
    found = shooting.find_crossing(None, guess)  # pyright: ignore[reportArgumentType]
    assert found.pitchfork
    assert found.directions.tolist() == [[0.6, 0.0, 0.0, 0.8], [1.0, 0.0, 0.0, 0.0]]
    for ends in (np.array([0.0, 2 * shooting.CLOSED]), np.array([-2 * shooting.CLOSED, 0.0])):
        known["ends"] = ends
        with pytest.raises(shooting.CycleError, match="no crossing of branches"):
            shooting.find_crossing(None, guess)  # pyright: ignore[reportArgumentType]
    own, other = found.split(np.array([2.0, 0.0, 0.0, -0.1]))
    assert (own.tolist(), other.tolist()) == (found.directions[1].tolist(), found.directions[0].tolist())


# --- at the edges of what is known -----------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e9])
def test_errors_of_energy_are_relative_whatever_the_energies_are(size):
    def history(kinetic: Any, power: Any) -> Any:
        found = {
            "energy_balance_error": np.array([1e-3, -2e-3, 0.0]),
            "kinetic_energy": kinetic,
            "friction_power": power,
        }
        return xarray.Dataset(
            {name: ("time", size * np.asarray(each)) for name, each in found.items()}, {"time": [0.0, 0.1, 0.3]}
        )

    found = measure_accuracy(history([0.1, 0.4, 0.2], [3.0, 5.0, 2.0]), 1e-7)
    assert found.energy_balance_error_J == pytest.approx(2e-3 * size)
    assert found.energy_balance_error_over_kinetic_energy == pytest.approx(2e-3 / 0.4)
    assert found.energy_balance_error_over_friction_work == pytest.approx(2e-3 / (0.4 + 0.7))
    assert found.quadrature_error_over_normal_force == 1e-7
    still = measure_accuracy(history([0.0] * 3, [0.0] * 3), None)
    assert (still.energy_balance_error_over_kinetic_energy, still.energy_balance_error_over_friction_work) == (0.0, 0.0)


def test_a_line_without_a_growth_rate_has_no_uncertainty_of_one():
    found = fit_study._mode_line(line(200.0, 0.5), None, (), np.zeros(0, dtype=complex), np.zeros(0, dtype=complex))
    assert (found.measured_growth_rate_1_per_s, found.growth_rate_uncertainty_1_per_s) == (None, 0.0)


@pytest.mark.parametrize("width", [8.0, 8e-4])
def test_eigenvalues_are_looked_at_where_asked_and_on_a_grid_but_not_twice(width):
    """Values that are within a thousandth of a step of the grid's stand for those."""
    step = width / (onset_study.VALUES - 1)
    near, apart = 1.0 + 7 * step + 0.9e-3 * step, 1.0 + 20 * step + 1.1e-3 * step
    found = onset_study._values_of(Variation("x", "", (1.0, apart, near, 1.0 + width, apart)))
    assert found == sorted(found)
    grid = np.linspace(1.0, 1.0 + width, onset_study.VALUES)
    wanted = [*np.delete(grid, [0, 7, onset_study.VALUES - 1]), 1.0, near, apart, 1.0 + width]
    np.testing.assert_allclose(found, np.sort(wanted), rtol=1e-14)


def test_lines_are_sought_two_bins_from_both_ends_and_as_far_from_zero_as_they_are_broad():
    rate, count = 1000.0, 500
    time = np.arange(count) / rate
    noise = 1e-4 * np.random.default_rng(2).normal(size=count)
    for frequency, found in ((3.0, False), (6.0, True), (494.0, True), (497.5, False)):
        strongest = growth._strongest(np.cos(2 * np.pi * frequency * time + 0.4) + noise, rate, 0.0)
        here = strongest is not None and abs(strongest[0].imag / (2 * np.pi) - frequency) < 0.6
        assert here == found, frequency
    # Of growth by e¹⁶ a second a line is 16/2π = 2.5 Hz broad, and of 100 e-folds 16 Hz.
    grown = np.exp(100 * time - 50) * np.cos(2 * np.pi * 14 * time)
    strongest = growth._strongest(grown, rate, 0.0)
    assert strongest is not None
    assert strongest[0].imag / (2 * np.pi) >= abs(strongest[0].real) / (2 * np.pi)


@pytest.mark.parametrize(("rate", "lowest", "periods"), [(40.0, 4.0, 1.5), (40.0, 4.0, 1.601)])
def test_a_window_of_a_spectrogram_has_sixteen_samples_at_least(rate, lowest, periods):
    (first, *_) = spectra.spectrogram(
        np.random.default_rng(3).normal(size=60), rate, lowest_frequency=lowest, periods=periods
    )
    length = max(16, math.ceil(periods * rate / lowest))
    assert first.time_s[0] == pytest.approx(length / 2 / rate)


# --- what quick tests came to last -----------------------------------------------------------------------------------


def a_cycle(*multipliers: complex, neutral: bool = False) -> Any:
    sizes = np.abs(multipliers) if multipliers else np.zeros(1)
    return SimpleNamespace(
        multipliers=np.array(multipliers), largest=float(sizes.max()), neutral=neutral, stable=bool(sizes.max() < 1),
        unstable_directions=int((sizes > 1).sum()),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("cycle", "said"),
    [
        (a_cycle(1.0000001, neutral=True), "within the accuracy, a small disturbance neither grows nor decays"),
        (a_cycle(0.0), "a small disturbance is forgotten within a period, for the contact sticks"),
        (a_cycle(0.6 + 0.1j), "a small disturbance decays to 0.6083 times its size in a period"),
        (a_cycle(3 + 4j, 3 - 4j), "a small disturbance grows to 5 times {}, turning, in 2 directions"),
        (a_cycle(-2.5, 0.1), "a small disturbance grows to 2.5 times {}, changing its sign, in one direction"),
        (a_cycle(1.5, 1.2, 0.9), "a small disturbance grows to 1.5 times {}, keeping its sign, in 2 directions"),
    ],
)  # fmt: skip
def test_what_a_small_disturbance_does_on_a_cycle(cycle, said):
    assert cycle_words._disturbed(cycle) == said.format("its size in a period")


def test_the_contact_pulls_where_it_does_in_one_of_the_cycles(monkeypatch):
    monkeypatch.setattr(cycle_words, "smallest_force", lambda model, displacement: displacement)
    monkeypatch.setattr(cycle_words, "pulling_sentence", lambda smallest: f"{smallest:g}")
    cycles: Any = [SimpleNamespace(model=None, samples=SimpleNamespace(displacement=x)) for x in (5.0, -3.0, 7.0)]
    assert cycle_words._pull([*cycles, SimpleNamespace(samples=None)]) == "-3"  # pyright: ignore[reportArgumentType]
    assert cycle_words._pull([]) == "inf"


def test_it_is_said_how_to_find_out_what_disturbances_lead_to(nominal):
    def said(scene: Any = nominal, *, unstable: Any = (), squeals: bool = False, divergence: Any = None) -> str | None:
        stability: Any = SimpleNamespace(unstable=unstable, divergence=divergence)
        return bistable.bistable_words(scene, stability, Path("a b.toml"), ["x=1"], squeals=squeals)

    command = ": drumsqueal onset 'a b.toml' --set x=1 --along 'drum.speed=4.5..5.5 rad/s x 3'"
    may = "A large disturbance may still lead to sustained squeal (the bistable, subcritical range); to find out"
    other = "Other disturbances may lead to another squeal; which there are, and what leads to each"
    assert said() == f"{may}{command}"
    assert said(unstable=("X",)) == said(squeals=True) == said(unstable=("X",), squeals=True) == f"{other}{command}"
    turning = nominal.with_values({"drum.speed": 120 * math.pi / 30})
    text = said(turning)
    assert text is not None
    assert text.endswith("--along 'drum.speed=108..132 rpm x 3'")
    assert said(divergence=3.0) is None
    assert said(nominal.with_values({"drum.speed": {"time": [0.0, 1.0], "value": [5.0, 1.0]}})) is None
    assert said(nominal.with_values({"contact.normal_load": {"time": [0.0, 1.0], "value": [5.0, 1.0]}})) is None
    assert said(nominal.with_values({"contact.normal_load": 0.0})) is None
    assert said(nominal.with_values({"forcing": {"frequency": 100.0, "amplitude": {"X": 1.0}}})) is None


@pytest.mark.parametrize(
    ("leads", "unstable", "reason", "kind"),
    [
        ((Kind.SQUEALS,), False, "why", Outcome.NOWHERE), ((Kind.DECAYS,), True, None, Outcome.SQUEALS),
        ((Kind.DECAYS, Kind.SQUEALS, Kind.FAILED), False, None, Outcome.BISTABLE),
        ((Kind.GROWS, Kind.DECAYS), False, None, Outcome.STABLE),
        ((Kind.UNDECIDED, Kind.NEUTRAL), False, None, Outcome.UNDECIDED),
        ((Kind.RUNS_AWAY,), False, None, Outcome.UNDECIDED), ((Kind.FAILED,), False, None, Outcome.UNDECIDED),
        ((Kind.NEUTRAL, Kind.DECAYS), False, None, Outcome.NEUTRAL), ((Kind.RESTS,), False, None, Outcome.STABLE),
        ((), False, None, Outcome.STABLE),
    ],
)  # fmt: skip
def test_what_becomes_of_starts_at_a_value(leads, unstable, reason, kind):
    starts = tuple(Response(start="", leads_to=each, simulated_s=1.0, outcome="") for each in leads)
    row = Row(
        value=1.0, asked=True, no_steady_sliding=reason, unstable=unstable, largest_growth_rate_1_per_s=0.0,
        starts=starts,
    )  # fmt: skip
    assert row.kind is kind


def test_a_transient_is_run_eight_times_its_duration_unless_time_itself_matters(nominal):
    assert sweep_study.most_rounds(nominal) == sweep_study.MOST_ROUNDS > 1
    ramp = nominal.with_values({"drum.speed": {"time": [0.0, 1.0], "value": [5.0, 1.0]}})
    forced = nominal.with_values({"forcing": {"frequency": 100.0, "amplitude": {"X": 1.0}}})
    assert (sweep_study.most_rounds(ramp), sweep_study.most_rounds(forced)) == (1, 1)


def proving(quiet_from: float, judged: list[Any]) -> Any:
    """The search for a smaller change of two numbers: quiet from a size of the first on, in a proof from twice that."""
    of, problem = object.__new__(Quietening), object.__new__(Problem)
    problem.keys, problem.high, problem.low = ("a", "b"), np.array([6.0, 9.0]), np.array([-4.0, -9.0])
    problem.in_file = lambda x: {"x": round(float(x[0]), 6)}

    class Judge:
        def judge(self, brakes, what):
            assert what == "proof"
            tried = [(brake.numbers["x"], brake.thorough) for brake in brakes]
            judged.extend(tried)
            quiet = [x >= (2 * quiet_from if whole else quiet_from) for x, whole in tried]
            return [
                SimpleNamespace(quiet=q, squealing=(f"squeal {x:g}",)) for q, (x, _) in zip(quiet, tried, strict=True)
            ]

    of._problem, of._disturber, of._progress = problem, Judge(), lambda *_: None  # pyright: ignore[reportAttributeAccessIssue]
    return of


def test_what_fails_its_proof_is_enlarged_and_shrunk_anew_with_what_squealed(monkeypatch):
    asked: list[Any] = []

    def shrink(search, whole, ways, carried, failed):
        asked.append((whole.tolist(), ways.tolist(), carried, list(failed)))
        return np.array([0.5, 1.0])

    monkeypatch.setattr(Quietening, "_shrink", shrink)
    judged: list[Any] = []
    (found,) = proving(0.4, judged)._smaller(np.array([1.0, 1.0]), {"b": -2.0}, ("begin",), 7.0)
    # The ways are those of each number alone, else of the change.
    assert [each[1] for each in asked] == [[1.0, -1.0]] * 3
    assert judged[:4] == [(0.5, False), (0.5, True), (0.55, False), (0.625, False)]  # 1.1 and 1.25 times as much, too
    assert 0.8 <= found["x"] <= 1.1 * 0.8  # where it stands its proof
    (_, _, first, none), (enlarged, _, carried, failed), *_ = asked
    assert (first, none, failed) == (("begin",), [], [{"x": 0.5}])
    assert enlarged == pytest.approx([found["x"], 2 * found["x"]])
    assert carried[0].startswith("squeal 0.")  # of the last that squealed
    assert carried[-1] == "begin"


def test_what_stands_its_proof_is_taken_and_what_never_does_is_not(monkeypatch):
    monkeypatch.setattr(Quietening, "_shrink", lambda search, whole, *_: 0.5 * whole)
    judged: list[Any] = []
    assert proving(0.2, judged)._smaller(np.array([1.0, 0.0]), {}, (), 7.0) == [{"x": 0.5}]
    assert judged == [(0.5, False), (0.5, True), (0.55, False), (0.625, False)]
    judged.clear()
    assert proving(9.0, judged)._smaller(np.array([2.0, 0.0]), {}, (), 3.5) == []
    # The change itself, and outwards up to a size of 3.5.
    assert judged == [(x, False) for x in (1.0, 1.1, 1.25, 1.6, 2.5)]


def test_lines_of_contenders_go_from_the_cheapest_to_the_dearest(nominal):
    model = build_model(nominal)
    more = "diffrax.Kvaerno5", "dopri8", "diffrax.Tsit5"  # one of which is there anyway
    lines = list(bench.configurations_of(model, more))
    names = [(line[0].cause, line[0].line) for line in lines]
    steps = [(bench.STEPPING, solver) for solver in (*bench.SOLVERS, "diffrax.Kvaerno5", "diffrax.Tsit5")]
    assert names == [
        *steps, (bench.QUADRATURE, bench.SPLIT), (bench.QUADRATURE, bench.FIXED),
        (bench.SMOOTHING, bench.SMOOTHED),
    ]  # fmt: skip
    for line in lines[: len(steps)]:
        assert [(each.setting, each.tolerance, each.solver) for each in line] == [
            (tolerance, tolerance, line[0].solver) for tolerance in bench.TOLERANCES
        ]
        assert all(each.model is model for each in line)
    split, fixed, smoothed = lines[len(steps) :]
    assert [each.setting for each in split] == list(bench.NODES)
    assert [each.setting for each in fixed] == list(bench.GRID)
    assert [each.setting for each in smoothed] == list(bench.WIDTHS)
    assert {each.tolerance for each in (*split, *fixed, *smoothed)} == {bench.OTHERS}
    surface = 0.1 * 5.0  # m/s
    assert [float(each.model.contact.friction.direction.width) for each in smoothed] == pytest.approx(  # pyright: ignore[reportAttributeAccessIssue, reportOptionalMemberAccess]
        [width * surface for width in bench.WIDTHS]
    )
    assert len({repr(each.model.contact.surface) for each in (*split, *fixed)}) == len(split) + len(fixed)  # pyright: ignore[reportAttributeAccessIssue]


def test_an_attractor_has_all_starts_that_led_to_it_and_the_smallest_disturbance():
    motion = SteadyResponse(
        start="b", amplitude={"X": 1.0}, rms={"X": 0.7}, frequency_Hz=90.0, line_of="X", kinetic_energy_J=2.0,
        share_of_contact_loss=1.0, share_of_slip_reversal=1.0, drift=0.0,
    )  # fmt: skip

    def led(start: str, energy: float | None = None, source: float | None = None) -> Response:
        disturbance = None if energy is None else VelocityPerturbation(
            mode=start, forwards=True, velocity={}, speed_m_per_s=1.0, energy_J=energy, boundary_ratio=1.0
        )  # fmt: skip
        return Response(
            start=start,
            leads_to=Kind.SQUEALS,
            simulated_s=1.0,
            outcome="",
            disturbance=disturbance,
            from_value=source,
            motion=motion,
        )

    responses = [
        led("b", 4.0),
        led(SMALL_START),
        led("a", 1.0),
        led("c", source=2.0),
        led("d", source=3.0),
        led("e", source=2.0),
    ]
    found = Attractor.of(responses, ())
    assert (found.start, found.starts, found.after_small) == ("b", ("b", SMALL_START, "a", "c", "d", "e"), True)
    assert (found.disturbance and found.disturbance.energy_J, found.from_values, found.smallest_disturbance) == (
        1.0,
        (2.0, 3.0),
        None,
    )
    assert not Attractor.of(responses[2:], ()).after_small
    assert Attractor.of(responses[3:], ()).disturbance is None
    disturbance: dict[str, Any] = dict(responses[0].disturbance or ())
    other = motion.model_copy(update={"rms": {"X": 0.9}})
    smallest = [
        Disturbance(**disturbance, speed_uncertainty_m_per_s=0.1, energy_uncertainty_J=uncertainty, leads_to=to)
        for uncertainty, to in ((0.1, other), (0.2, motion), (0.3, motion))
    ]
    attractor = Attractor.of(responses, smallest)
    assert attractor.smallest_disturbance is smallest[1]


def test_the_main_line_of_a_motion_is_that_with_most_kinetic_energy():
    """2 kg at 40 Hz and 3 µm against 1 kg at 90 Hz and 2 µm: 28.8 to 32.4; 1.9 µm leave 29.2, 1.88 µm 28.6."""
    time = np.arange(2000) / 2000.0
    for size, main in ((1.92e-6, "Y"), (1.86e-6, "X")):
        moved = np.column_stack([3e-6 * np.sin(2 * np.pi * 40 * time), size * np.sin(2 * np.pi * 90 * time)])
        history = xarray.Dataset(
            dict.fromkeys(("displacement", "velocity"), (("time", "coordinate"), moved)),
            {"time": time, "coordinate": ["X", "Y"]},
        )
        stability: Any = SimpleNamespace(
            coordinates=("X", "Y"), steady_state=np.zeros(2), mass=np.array([2.0, 1.0]), pressure_range=(0.0, 0.0)
        )
        model: Any = SimpleNamespace(sides=[(None, SimpleNamespace(lining=SimpleNamespace(law=Unilateral(0.0))))])
        found = saturation.describe_motion(Vibration(history, stability), slice(None), stability, model)
        assert found.main is not None
        assert found.main.coordinate == main
        assert found.main.frequency_Hz == pytest.approx(40.0 if main == "X" else 90.0, abs=0.1)


def test_the_uncertainty_of_a_fast_line_is_that_of_steadiness_and_of_the_clock(monkeypatch):
    """Of a line of 9 kHz and −7 1/s that is known exactly in every part."""
    whole = growth.Exponentials(*(np.array([each]) for each in (9000.0, 0.0, -7e4, 0.0, 1.0)), np.zeros(3))  # pyright: ignore[reportCallIssue]
    monkeypatch.setattr(record, "find_exponentials", lambda piece, rate, lowest: whole)
    found = record._linear(np.arange(1000.0), 5e4, slice(0, 1000), 0.0, "whole")
    assert found is not None
    (one,) = found.lines
    assert one.frequency_uncertainty_Hz == pytest.approx(9000e-5)
    assert one.growth_rate_uncertainty_1_per_s == pytest.approx(math.hypot(1e-6 * 2 * np.pi * 9000, 0.7))
    assert found.reason == "all of the record is a sum of lines that grow or decay exponentially: small vibration"
    late = record._linear(np.arange(1000.0), 5e4, slice(500, 1000), 2.0, "whole")
    assert late is not None
    assert late.reason.startswith("all of the record from 2.01 s on is a sum")


def test_a_single_thread_gets_two_batches_at_a_time_and_so_does_a_cluster_that_has_lost_its_workers():
    for workers in ({"one": 1}, {}):
        submitted: list[int] = []

        def submit(work, plan, first, stop, versions, *, key, pure, submitted=submitted):
            submitted.append(first)
            return SimpleNamespace(status="finished", result=lambda: first, add_done_callback=lambda call: call(None))

        client: Any = SimpleNamespace(
            nthreads=lambda workers=workers: workers, submit=submit, cancel=lambda futures: None, status="running"
        )
        stream = Cluster(client).results("plan", [(k, k + 1) for k in range(5)])  # pyright: ignore[reportArgumentType]
        assert next(stream) == (0, 0)
        assert submitted == [0, 1]
        assert [first for first, _ in stream] == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("following", "moved"), [((0.0, 2.0, 0.5), ("Tz", "E1")), ((0.0, 0.0, 0.0), ("X", "Tz", "E1"))]
)
def test_a_disturbed_scene_starts_with_what_moves_with_the_drum_three_times_as_deep(monkeypatch, following, moved):
    characteristic_lengths = {"X": 1.0, "Tz": 0.125, "E1": 4.0}
    body = SimpleNamespace(
        names=tuple(characteristic_lengths),
        velocity_with_drum=following,
        characteristic_lengths=lambda: characteristic_lengths,
    )
    monkeypatch.setattr(disturbing, "build_model", lambda scene: SimpleNamespace(body=body))
    monkeypatch.setattr(disturbing, "_deepest", lambda model: 2e-6)
    asked: list[Any] = []
    disturbing.disturbed(SimpleNamespace(with_values=asked.append))  # pyright: ignore[reportArgumentType]
    (values,) = asked
    wanted = {name: pytest.approx(disturbing.DISTURBANCE * 2e-6 / characteristic_lengths[name]) for name in moved}
    assert values == {"start": {"displacement": wanted, "velocity": {}}}


def test_a_history_is_exported_at_the_rate_of_its_scene_unless_it_was_sampled_otherwise(monkeypatch, tmp_path):
    """Samples of a scene that asks for 1 kHz: from 20 ms after the start of 0.5 s on, at every sample or at fewer."""
    asked: dict[str, Any] = {}
    values = np.arange(500.0)

    def make_channels(saved, names, part):
        asked["part"] = part
        return [SimpleNamespace(name="a", units="m/s", values=values[part])]

    def resampled(recorded, own, place, count, rate):
        asked["resampled"] = own, place, count, rate
        return [SimpleNamespace(name="a", units="m/s", values=np.zeros(count))]

    monkeypatch.setattr(export, "names_of", lambda signals, saved: (["a"], ["a remark"]))
    monkeypatch.setattr(
        export, "_places", lambda saved, part, own, rate, signals: (20.0, 320.0, round(300 * rate / own) + 1)
    )
    monkeypatch.setattr(export, "make_channels", make_channels)
    monkeypatch.setattr(export, "reach", lambda own, rate: 7)
    monkeypatch.setattr(export, "_lost", lambda *given: ["lost"])
    monkeypatch.setattr(export, "_resampled", resampled)
    monkeypatch.setattr(export, "_texts", lambda saved: {})

    def exported(rate: float, part: Any, *, complete: bool = True) -> Any:
        saved: Any = SimpleNamespace(
            scene=SimpleNamespace(simulate=SimpleNamespace(sample_rate=1000.0)), sample_rate=rate, complete=complete,
            data={"time": SimpleNamespace(values=0.5 + np.arange(500) / rate)}, outcome="cut off",
        )  # fmt: skip

        def write(channels, file, progress):
            file.write_text("written")
            return "a note"

        wanted: Any = SimpleNamespace(predicts=False, writer=lambda: write)
        return export.export_history(saved, tmp_path / "out", wanted, part)

    part = SimpleNamespace(signals=None, rate=None, slow=1.0)
    found = exported(1000.0 * (1 + 1e-9), part)
    assert (found.sample_rate_Hz, found.samples, found.from_s, found.until_s) == (
        1000.0,
        301,
        0.52,
        pytest.approx(0.82),
    )
    assert (asked["part"], found.remarks, found.note, found.signals) == (
        slice(20, 321), ("a remark",), "a note", {"a": "m/s"}
    )  # fmt: skip
    assert exported(999.0, part, complete=False).sample_rate_Hz == 999.0
    assert "the run is incomplete (cut off)" in exported(999.0, part, complete=False).remarks[1]
    part.rate, part.slow = 100.0, 2.5
    found = exported(1000.0, part)
    # 250 samples a second of the motion, played at 100; seven more on either side, for the filter.
    assert asked["part"] == slice(13, 329)
    assert asked["resampled"] == (1000.0, 7.0, 76, 250.0)
    assert (found.sample_rate_Hz, found.samples, found.remarks) == (250.0, 76, ("a remark", "lost"))
