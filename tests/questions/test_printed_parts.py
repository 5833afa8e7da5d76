"""What commands print and say, line by line, of findings whose numbers differ everywhere."""

import io
import math
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from drumsqueal.dynamics.cycles.cycle import Event
from drumsqueal.dynamics.cycles.cycle import RangeKind as Outcome
from drumsqueal.findings.columns import to_uncertainty
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.ramp import Ramp
from drumsqueal.findings.squeals import Instant, SquealEnd
from drumsqueal.questions import check as check_answer
from drumsqueal.questions.check import Amount
from drumsqueal.questions.fit import study as fit_words
from drumsqueal.questions.fit.record import RecordKind
from drumsqueal.questions.fit.study import Combination, FittedLine, FittedNumber
from drumsqueal.questions.onset import found as onset_words
from drumsqueal.questions.run import answer as run_words
from drumsqueal.scene.variation import Variation

SPEED, LOAD = "drum.speed", "contact.normal_load"


def printed(show: Any, *given: Any) -> list[str]:
    """The lines that are printed, each with one blank between its words."""
    console = Console(width=400, record=True, file=io.StringIO())
    show(console, *given)
    return [" ".join(line.split()) for line in console.export_text().splitlines() if line.strip()]


# --- a run -----------------------------------------------------------------------------------------------------------


def instant(time: float, speed: float, load: float = 7.0) -> Instant:
    return Instant(
        time_s=time, drum_speed_rad_per_s=speed, normal_load_N=load, drum_speed_rate_rad_per_s2=-2.0,
        normal_load_rate_N_per_s=3.0, driven={SPEED: (speed, -2.0), LOAD: (load, 3.0)},
    )  # fmt: skip


def a_run(**more: Any) -> Any:
    modes = (
        SimpleNamespace(
            label="X", predicted_frequency_Hz=101.234, measured_frequency_Hz=102.346, frequency_error=0.0123,
            predicted_growth_rate_1_per_s=4.5678, measured_growth_rate_1_per_s=-5.6789, growth_rate_error=-0.234,
            frequency_resolution_Hz=2.5, note="",
        ),
        SimpleNamespace(
            label="Y", predicted_frequency_Hz=201.5, measured_frequency_Hz=None, frequency_error=None,
            predicted_growth_rate_1_per_s=-1.5, measured_growth_rate_1_per_s=None, growth_rate_error=None,
            frequency_resolution_Hz=None, note="too faint",
        ),
        SimpleNamespace(
            label="Z", predicted_frequency_Hz=301.5, measured_frequency_Hz=None, frequency_error=None,
            predicted_growth_rate_1_per_s=-2.5, measured_growth_rate_1_per_s=None, growth_rate_error=None,
            frequency_resolution_Hz=1.25, note="too faint",
        ),
    )  # fmt: skip
    known: dict[str, Any] = {
        "model": {"includes": ("a", "b"), "leaves_out": ()}, "held_though_they_would_move": (), "brake": None,
        "modes": modes, "growth": SimpleNamespace(linear_until_s=0.1234567), "changing": False, "predicted_at_s": 0.25,
        "ramp": None, "saturation": None, "integration": None, "accuracy": None, "verdict": "So it is.",
        "edge_reached_s": None, "scene": SimpleNamespace(simulate=SimpleNamespace(solver="auto")),
    }  # fmt: skip
    return SimpleNamespace(**(known | more))


def test_a_run_is_printed_with_prediction_measurement_and_error_of_each_mode():
    lines = printed(run_words.print_findings, a_run())
    for line in (
        "X 101.23 102.35 +1.2e-02 +4.568 -5.679 -2.3e-01", "Y 201.50 - - -1.500 - -",
        "Measured from 0 to 0.1235 s; spectral resolution 1.25 to 2.5 Hz, peaks interpolated", "Y, Z: too faint",
    ):  # fmt: skip
        assert lines.count(line) == 1, (line, lines)
    assert lines[-1] == "So it is."
    assert not any(
        line.startswith(("Held", "Friction is", "Energy", "Contact", "After growth", "Drum")) for line in lines
    )
    modes = a_run().modes
    modes[0].frequency_error = modes[0].growth_rate_error = None  # as where the prediction is for one time
    lines = printed(run_words.print_findings, a_run(
        changing=True, held_though_they_would_move=("Tx", "Ty"), modes=modes[:1],
        integration=SimpleNamespace(implicit_fraction=0.1234),
    ))  # fmt: skip
    assert "Held at zero, though the other coordinates would move them: Tx, Ty" in lines
    assert "X 101.23 102.35 +4.568 -5.679" in lines
    assert "Measured from 0 to 0.1235 s; spectral resolution 2.5 Hz, peaks interpolated" in lines
    assert any("at t = 0.25 s" in line and "mean" in line for line in lines)
    assert any(line.endswith("took 12.3 % of the time") for line in lines)
    assert any(line.startswith("Drum speed, load or force change") for line in lines)
    explicit: Any = SimpleNamespace(simulate=SimpleNamespace(solver="kvaerno5"))
    for scene, share in ((explicit, 0.5), (a_run().scene, 0.0)):
        lines = printed(
            run_words.print_findings, a_run(scene=scene, integration=SimpleNamespace(implicit_fraction=share), modes=())
        )
        assert not any(line.startswith(("Friction is", "Measured from")) for line in lines)


def test_what_a_run_saturates_to_and_how_accurate_it_is_is_printed():
    regime = SimpleNamespace(kind=Kind.PERIODIC, reason="it repeats", record_needed_s=None)
    saturation = SimpleNamespace(start_s=0.345678, regime=regime)
    accuracy = SimpleNamespace(
        energy_balance_error_over_kinetic_energy=2.34e-7, energy_balance_error_over_friction_work=3.46e-9,
        quadrature_error_over_normal_force=4.56e-8,
    )  # fmt: skip
    found = a_run(saturation=saturation, accuracy=accuracy, edge_reached_s=0.2)
    lines = printed(run_words.print_findings, found)
    assert "After growth, from 0.3457 s: it repeats" in lines
    assert not any(line.startswith("To record") for line in lines)
    assert "Energy balance error: 2.3e-07 of the largest kinetic energy, 3.5e-09 of the work of friction" in lines
    assert any(
        line.startswith("Contact forces: quadrature error 4.6e-08 of the largest normal force") for line in lines
    )
    regime.kind, regime.record_needed_s = Kind.STEADY, 0.5
    accuracy.energy_balance_error_over_kinetic_energy, accuracy.quadrature_error_over_normal_force = 1.0, None
    lines = printed(run_words.print_findings, found)
    assert "At its end, from 0.3457 s: it repeats" in lines
    duration = f"{run_words.duration_for(0.5, 0.2):.4g}"
    assert f"To record that long after growth, set simulate.duration to {duration} s" in lines
    assert "Energy balance error: 3.5e-09 of the work of friction" in lines
    assert not any(line.startswith("Contact forces") for line in lines)
    accuracy.energy_balance_error_over_friction_work, found.edge_reached_s = 0.0, None
    lines = printed(run_words.print_findings, found)
    assert not any(line.startswith(("Energy balance", "To record")) for line in lines)


def a_ramp(keys: tuple[str, ...], line: Any) -> Ramp:
    squeal = SimpleNamespace(
        sets_in=instant(0.1, 11.0, 21.0), largest=instant(0.2, 12.0, 22.0), sustained_until=instant(0.3, 13.0, 23.0),
        ends=instant(0.4, 14.0, 24.0), amplitude=3.456e-5, line=line, end=SquealEnd.STICKS,
    )  # fmt: skip
    passage = SimpleNamespace(
        mode="X", unstable_from=instant(0.5, 15.0, 25.0), unstable_until=instant(0.6, 16.0, 26.0), growth_needed=7.891,
        growth_available=8.912, predicted=instant(0.7, 17.0, 27.0), measured=None,
    )  # fmt: skip
    endless = SimpleNamespace(**(vars(passage) | {"growth_needed": math.inf, "measured": instant(0.8, 18.0, 28.0)}))
    return Ramp.model_construct(keys=keys, squeals=(squeal,), passages=(passage, endless), lines=(), hysteresis=())


def test_squeals_and_passages_of_a_ramp_are_printed_at_their_instants(nominal):
    one = a_ramp((SPEED,), SimpleNamespace(coordinate="Tz", frequency_Hz=543.21))
    lines = printed(run_words.print_findings, a_run(ramp=one, scene=nominal))
    assert "Squeal while drum speed changes" in lines
    assert "0.1000 11 12 34.6 µrad Tz 543 13 0.4000 14 sticks" in lines
    assert "X 0.5000 15 0.6000 16 7.89 8.91 0.7000 17 - -" in lines
    assert "X 0.5000 15 0.6000 16 - 8.91 0.7000 17 0.8000 18" in lines
    both = a_ramp((SPEED, LOAD), None)
    lines = printed(run_words.print_findings, a_run(ramp=both, scene=nominal))
    assert "Squeal while drum speed and load change" in lines
    assert "0.1000 11, 21 12, 22 34.6 - 13, 23 0.4000 14, 24 sticks" in lines


# --- a check ---------------------------------------------------------------------------------------------------------


def test_a_check_is_printed_with_its_numbers_its_meshes_and_what_a_run_takes():
    amount = lambda n: Amount(elements=n, volume_m3=n * 1.5e-9, mass_kg=n * 0.25)  # noqa: E731
    mesh = SimpleNamespace(
        body="shoe", file="a.inp", elements_by_type={"C3D8": 5, "C3D4": 7}, whole=amount(12),
        sets={"lining": amount(3)}, point_masses=2, point_masses_kg=0.125,
        lowest_m=(-1.5, 2.5, 3.5), highest_m=(4.5, 5.5, 6.5), notes=("a mesh's note",),
    )  # fmt: skip
    found: Any = SimpleNamespace(
        title="", model={"includes": ("a",), "leaves_out": ("b", "c")}, meshes=(mesh,), brake=None, growing=(),
        numbers={"load": SimpleNamespace(value=1234.5678, unit="N", meaning="on it")}, highest_frequency_Hz=4321.098,
        least_sample_rate_Hz=8765.43, samples=5001, history_bytes=7.89e6, estimate=None, warnings=("a warning",),
        scene=SimpleNamespace(simulate=SimpleNamespace(sample_rate=20000.0, duration=0.25)),
        prediction=SimpleNamespace(resolution=None),
    )  # fmt: skip
    lines = printed(check_answer.print_check, found)
    assert lines[0] == "The scene: no mistakes found"
    for line in (
        "load 1234.57 N on it", "Mesh of the shoe, a.inp: 5 C3D8, 7 C3D4", "all 12 18 mm^3 3 kg",
        "lining 3 4.5 mm^3 0.75 kg", "Point masses at 2 nodes, in addition: 0.125 kg",
        "Bounding box: x -1.5 to 4.5 m, y 2.5 to 5.5 m, z 3.5 to 6.5 m",
        "Note: a mesh's note", "No mode grows.",
        "Highest frequency 4321.1 Hz: at least 8765.4 samples a second are needed, and 20000 are taken",
        "5001 samples in 0.25 s, history.nc of about 7.9 MB",
        "How long a run takes was not measured: --measure does, or measure=True in Python", "Note: a warning",
    ):  # fmt: skip
        assert lines.count(line) == 1, (line, lines)
    found.title, found.growing = "A brake", (growth(), growth())
    lines = printed(check_answer.print_check, found)
    assert lines[0] == "A brake: no mistakes found"
    assert sum(line.startswith("Tz grows: 99.99 Hz, +3.142 1/s") for line in lines) == 2
    assert "No mode grows." not in lines


def growth(share: float = 0.123, time: float | None = 0.4567) -> Any:
    return SimpleNamespace(
        label="Tz", frequency_Hz=99.987, growth_rate=3.1416, start_boundary_ratio=share, edge_time=time
    )


def test_a_growing_mode_is_said_with_the_way_to_the_boundary_that_is_left():
    begins = "Tz grows: 99.99 Hz, +3.142 1/s; the start"
    way = f"{begins} is 0.12 of the way to the nearest contact boundary"
    assert check_answer._grows(growth()) == f"{way}, which this mode alone reaches after 0.457 s"
    assert check_answer._grows(growth(time=0.0)) == f"{way}, and so beyond it"
    assert check_answer._grows(growth(time=None)) == f"{begins} does not excite it"


@pytest.mark.parametrize(
    ("seconds", "evaluations", "whole", "said"),
    [
        (None, None, None, "Computing time unknown: the integration fails soon after the start"),
        (0.567, 1234.0, 3.456, "about 0.6 s of integration (1.2e+03 evaluations), 3.5 s in all once it is compiled"),
        (1.26, None, None, "about 1.3 s of integration"),
        (119.0, math.nan, 120.0, "about 1.2e+02 s of integration, 2 min in all once it is compiled"),
        (7100.0, None, 7290.0, "about 1.2e+02 min of integration, 2 h in all once it is compiled"),
        (7200.0, None, 18000.0, "about 2 h of integration, 5 h in all once it is compiled"),
    ],
)
def test_the_time_of_a_run_is_said_in_seconds_minutes_or_hours(seconds, evaluations, whole, said):
    estimate = SimpleNamespace(integration_s=seconds, evaluations=evaluations, run_s=whole)
    text = check_answer._takes(SimpleNamespace(estimate=estimate))  # pyright: ignore[reportArgumentType]
    assert text.removeprefix("Estimated from short pieces of the run: ") == said


# --- a fit -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "uncertainty", "said"),
    [
        (123456.0, 700.0, "1.2346e5"), (123456.0, 7000.0, "1.235e5"), (-0.012346, 0.003, "-0.0123"),
        (2.5, 900.0, "2.5"),
        (2 / 3, 1e-15, "0.666666666667"), (2 / 3, 0.0, "0.666667"), (0.0, 0.3, "0.00000"),
    ],
)  # fmt: skip
def test_a_value_has_the_digits_that_two_of_its_uncertainty_need(value, uncertainty, said):
    assert to_uncertainty(value, uncertainty) == said


def number(key: str, uncertainty: float | None = 0.012, **more: Any) -> FittedNumber:
    known: dict[str, Any] = {
        "unit": "mm", "scene_value": 1.0, "fitted_value": 1.2345, "standard_uncertainty": uncertainty,
        "determined": uncertainty is not None, "scene_value_SI": 1e-3, "fitted_value_SI": 1.2345e-3,
        "uncertainty_SI": uncertainty,
    }  # fmt: skip
    return FittedNumber(key=key, uncertainty=uncertainty, **(known | more))


def line(measured: float, before: float | None, after: float | None, rates: Any = (None,) * 3) -> FittedLine:
    return FittedLine(
        measured_Hz=measured, uncertainty_Hz=0.1, mode="X" if before else None, before_Hz=before, after_Hz=after,
        measured_growth_rate_1_per_s=rates[0], before_growth_rate_1_per_s=rates[1], after_growth_rate_1_per_s=rates[2],
    )  # fmt: skip


def a_fit(**more: Any) -> Any:
    known: dict[str, Any] = {
        "missed": False, "record_kind": RecordKind.LINEAR, "fixed": (), "chi_square_per_freedom": 1.5,
        "observations": 4,
        "lines": (line(100.0, 95.0, 100.1), line(200.0, 220.0, 199.0), line(300.0, None, None)),
        "numbers": (number("a"), number("b", None), number("c", 0.3)), "open_combinations": (), "ambiguous": None,
        "reading": SimpleNamespace(left_out_Hz=()),
    }  # fmt: skip
    of = SimpleNamespace(**(known | more))
    of.determined = tuple(each for each in of.numbers if each.determined)
    return of


def test_a_fit_is_said_with_its_numbers_and_how_far_lines_were_and_are_off():
    text = fit_words.describe_fit(a_fit())
    assert text == (
        "The record gives a = 1.234 ± 0.012 mm and c = 1.23 ± 0.30 mm (95 % confidence, if every other number of the "
        "scene is exact); the eigenvalues, up to 10 % off before, are now within 0.5 % of the measured lines. "
        "Not determined: b."
    )
    rated = (line(100.0, 95.0, 100.0, (-3.0, 7.0, -3.5)), line(200.0, 200.0, 200.0, (5.0, 4.0, 5.12)))
    text = fit_words.describe_fit(a_fit(lines=rated, numbers=(number("a", unit=""),)))
    assert text.startswith("The record gives a = 1.234 ± 0.012 (95 %")
    assert text.endswith(
        "the eigenvalues, up to 5 % in frequency and 10 1/s in growth rate off before, are now within 0.001 % and "
        "0.50 1/s of the measured lines."
    )
    none = a_fit(numbers=(number("a", None), number("b", None)), record_kind=RecordKind.SATURATED)
    assert fit_words.describe_fit(none).startswith(
        "The record determines none of a, b alone; the lines of the scene's squeal, up to"
    )
    total = Combination(
        powers={}, relative_uncertainty=0.1, factors={"b": -0.5, "a": 1.0}, value=3.4567, uncertainty=0.12, unit="N"
    )
    text = fit_words.describe_fit(a_fit(numbers=none.numbers, fixed=(total,)))
    assert "alone (±: 95 % confidence, if every" in text
    assert text.endswith(" Near these values only this counts: a - 0.5 b = 3.46 ± 0.12 N.")
    # Which of two equals is the larger one, round-off decides: they come as they were asked for.
    for near in (0.9997, 1 - 1e-16, 1.0):
        for factors, terms in (({"a": near, "b": 1.0}, "a + b"), ({"b": 1.0, "a": near}, "b + a")):
            whole = total.model_copy(update={"factors": factors, "unit": ""})
            assert fit_words._sum(whole) == f"Only their sum counts: {terms} = 3.46 ± 0.12"
    assert fit_words._sum(whole.model_copy(update={"factors": {"a": 0.998, "b": 1.0}})).startswith("Near these values")


def test_a_fit_that_misses_says_by_how_much():
    failed = a_fit(missed=True, chi_square_per_freedom=150.0)
    assert fit_words.describe_fit(failed) == (
        "The fit has failed: it misses the lines by 12 times their uncertainty, up to 0.5 % in frequency, so that "
        "nothing is determined: other numbers of the scene differ, too, or the record is of another brake."
    ).replace(" in frequency, so", ", so")
    assert fit_words.describe_notes(failed) == ("not used, near no mode: 300.0 Hz",)
    rated = a_fit(chi_square_per_freedom=150.0, lines=(line(100.0, 95.0, 101.0, (-3.0, 7.0, -3.5)),))
    assert "up to 1 % in frequency and 0.50 1/s in growth rate" in fit_words.why_missed(rated)
    assert [fit_words._misses(a_fit(chi_square_per_freedom=chi)) for chi in (None, 9.0, 12.25, 99.0, 101.0)] == [
        "", "", "3.5", "9.9", "10"
    ]  # fmt: skip


def test_notes_of_a_fit_tell_what_tests_it_and_what_is_open():
    notes = fit_words.describe_notes(a_fit(
        chi_square_per_freedom=16.0, ambiguous="or else", open_combinations=({"b": 0.9, "x": -0.5, "y": 0.08},),
        fixed=(Combination(powers={"x": -0.5, "b": 1.0}, relative_uncertainty=0.0234),),
        numbers=(number("a", at_bound=True), number("b", None), number("d", None)),
        reading=SimpleNamespace(left_out_Hz=(1.0, 2.0, 3.0, 4.0, 5.0, 6.06, 7.0)),
    ))  # fmt: skip
    assert notes == (
        "b and x are not told apart: the lines fit with other values of these as well",
        "b × x^-0.5 is known to ± 2.3 %, near the fitted values",
        "the lines still miss by 4.0 times their uncertainty: other numbers differ, too, or the model lacks something; "
        "the uncertainties are widened by that factor",
        "d: not determined, for the lines are missed by more than their uncertainty, which widens that of a number too "
        "far",
        "or else",
        "a: at the end of what is tried, 20 times or a twentieth of the scene's value",
        "not used, near no mode: 300.0 Hz",
        "harmonics, combinations and faint lines, which are of no mode: 1.0, 2.0, 3.0, 4.0, 5.0, 6.1 Hz",
    )
    saturated = a_fit(
        record_kind=RecordKind.SATURATED, chi_square_per_freedom=None, observations=1, numbers=(number("a"),),
        lines=(line(100.0, 99.0, 100.21), line(200.0, 199.0, 200.39), line(300.0, None, None)),
    )  # fmt: skip
    assert fit_words.describe_notes(saturated) == (
        "1 frequency for 1 number: nothing tests the fit; where another number of the scene is wrong, the error may be "
        "many times the ±",
        "the search stopped short of 100.0 Hz: the squeal jumps to another motion on the way there",
        "not used, like none of the simulated squeal: 300.0 Hz",
    )
    two = a_fit(chi_square_per_freedom=None, observations=2, numbers=(number("a", None), number("b", None)))
    assert fit_words._tested(two) == ["2 frequencies and growth rates for 2 numbers: nothing tests the fit"]
    two.record_kind = RecordKind.SATURATED
    assert fit_words._tested(two)[0].startswith("2 lines for")
    assert fit_words._open({"a": 1.0}).startswith("a is not determined")
    assert fit_words._open({"a": 1.0, "b": 0.5, "c": 0.2}).startswith("a, b and c are not told apart")


# --- where cycles contradict transients ------------------------------------------------------------------------------


def contradicted(cycles: Any, *ranges: Any) -> list[str]:
    study: Any = SimpleNamespace(cycles=cycles, ranges=ranges, variation=Variation("x", "N", (1.0, 9.0)))
    return onset_words._contradictions(study)


def a_range(first: float, last: float, before: float | None = 0.1, after: float | None = 0.2, kind=Outcome.BISTABLE):
    return SimpleNamespace(kind=kind, first=first, last=last, first_uncertainty=before, last_uncertainty=after)


def test_cycles_contradict_transients_where_they_end_elsewhere_by_more_than_is_known(monkeypatch):
    asked = []

    def ends_cycles(cycles, value, end, found):
        asked.append((value, end))
        return known

    monkeypatch.setattr(onset_words, "_ends_cycles", ends_cycles)
    known = True
    cycles: Any = SimpleNamespace(squeals_only_when_disturbed=[(3.05, 4.0), (4.5, 6.3), (8.0, 9.0)])
    assert contradicted(None, a_range(3.0, 6.0)) == []
    (one,) = contradicted(cycles, a_range(3.0, 6.0))  # within 0.1 of the first end, 0.3 from the last
    assert one.startswith("The limit cycles end the bistable range at 6.3 N, not at 6.0 ± 0.2 N, where transients do:")
    assert asked == [(6.3, 6.0)]
    (one,) = contradicted(cycles, a_range(2.9, 6.2))
    assert one.startswith("The limit cycles end the bistable range at 3.05 N, not at 2.9 ± 0.1 N")
    assert len(contradicted(cycles, a_range(2.9, 6.0))) == 2
    assert contradicted(cycles, a_range(2.9, 6.0, None, None)) == []
    assert contradicted(cycles, a_range(2.9, 6.0, kind=Outcome.SQUEALS)) == []
    assert contradicted(cycles, a_range(6.3, 8.0)) == []  # they only touch
    known = False
    assert contradicted(cycles, a_range(2.9, 6.0)) == []


def test_cycles_are_known_to_end_at_bifurcations_from_which_they_are_followed():
    fold, corner = SimpleNamespace(value=2.0, what=Event.FOLD), SimpleNamespace(value=3.0, what=Event.CORNER)
    known: dict[str, Any] = {
        "branches": (SimpleNamespace(special=(fold, corner)),), "steady_sliding_stable": ((0.0, 5.0), (6.0, 9.0)),
        "steady_sliding_unstable": ((5.0, 5.5),), "not_followed": (), "off_branches": (),
    }  # fmt: skip
    found: Any = a_range(1.0, 8.0)

    def ends(value: float, end: float = 2.5, **more: Any) -> bool:
        return onset_words._ends_cycles(SimpleNamespace(**(known | more)), value, end, found)  # pyright: ignore[reportArgumentType]

    # A fold, and where steady sliding gains or loses stability; no corner, and no end of what was looked at.
    assert [ends(value) for value in (2.0, 5.0, 3.0, 0.0, 6.0, 5.5)] == [True, True, False, False, False, False]
    for low, high, followed in (
        (2.1, 2.4, False),
        (2.6, 3.0, True),
        (1.0, 1.9, True),
        (1.0, 2.0, False),
        (2.5, 3, False),
    ):
        lost = (SimpleNamespace(low=low, high=high),)
        assert ends(2.0, not_followed=lost) == followed
        assert ends(5.0, 5.0 + 2.5 - 2.0, not_followed=(SimpleNamespace(low=low + 3, high=high + 3),)) == followed
    for at, on in ((0.9, True), (1.0, False), (4.0, False), (8.0, False), (8.1, True)):
        assert ends(2.0, off_branches=(SimpleNamespace(value=at),)) == on
    fold.value = 0.5  # beyond the range, where none of its motions says anything
    assert ends(0.5, off_branches=(SimpleNamespace(value=4.0),))
