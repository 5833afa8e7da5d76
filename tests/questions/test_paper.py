"""The paper's figures from one command: the scene, the curves, and statements that a number decides."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.files.output_folder import FILES, PAPER_FIGURES, figure_file
from drumsqueal.physics.model import build_model
from drumsqueal.progress import silent
from drumsqueal.questions.commands.onset import EXAMPLE, example
from drumsqueal.scene import COORDINATES, load_scene
from drumsqueal.scene.file import seo_kang_brake
from drumsqueal.solve.linear.modes import analyse_stability

paper = example()
ROOT = Path(__file__).parents[2]
BRIEF = {"simulate.duration": 0.1}  # s: growth can be measured, and the fastest saturate


@pytest.fixture(scope="module", autouse=True)
def _few_points():
    """Fewer points on a line, and fewer transients: what is tested does not hang on how many there are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper, "POINTS", 25)
        patch.setattr(paper, "AXES", tuple(replace(axis, transients=axis.transients[-2:]) for axis in paper.AXES))
        yield


@pytest.fixture(scope="module")
def study() -> Any:
    return paper.study(seo_kang_brake().with_values(BRIEF))


def statement(study: Any, says: str) -> Any:
    (found,) = (each for each in study.statements if each.statement.startswith(says))
    return found


def altered(study: Any, **changes) -> dict[str, str]:
    """The verdicts with other friction curves, curves or transients than the study's."""
    parts = {
        "friction": study.friction,
        "curves": study.curves,
        "points": study.points,
        "disturbed": study.disturbed,
    } | changes
    shoe = build_model(study.scene).shoe
    return {each.statement: each.verdict for each in paper.check_statements(shoe, **parts)}


def test_the_packaged_brake_is_that_of_the_shipped_scene(nominal):
    brake = seo_kang_brake()
    assert brake.numbers() == nominal.numbers()
    assert brake.model_copy(update={"title": nominal.title}) == nominal


def test_settings_act_on_the_packaged_brake():
    assert seo_kang_brake(["drum.speed=3"]).drum.speed == 3


@pytest.mark.thorough  # 22 s: all curves of the paper, for all in this file
def test_one_program_for_many_numbers_gives_the_eigenvalues_of_each(study):
    for figure, k in (("7", 3), ("9", 20), ("5", 24)):
        curve = study.curves[figure]
        alone = analyse_stability(
            build_model(seo_kang_brake().with_values({curve.axis.key: curve.values[k]}), coordinates=COORDINATES)
        )
        for name in paper.SQUEALING:
            (mode,) = (mode for mode in alone.modes if mode.name == name)
            # Two programs and two quadratures round differently: some epsilons of the largest eigenvalue.
            assert abs(curve.spectrum.of(name)[k] - mode.eigenvalue) < 1e-13 * np.abs(alone.eigenvalues).max()


@pytest.mark.thorough
def test_a_coordinate_that_no_longer_oscillates_has_its_slower_eigenvalue_and_a_drift_is_left_out(study):
    spectrum = study.curves["7"].spectrum
    values, slow = spectrum.eigenvalues[0], spectrum.of("Tx")[0]
    assert slow.imag == 0
    assert spectrum.of("Tx")[-1].imag > 0
    assert slow.real == np.sort(values[values.imag == 0].real)[-2]  # the largest is the drift of Z, which is zero
    assert np.all(spectrum.of("Z").real < 0)
    assert np.all(spectrum.drifting.sum(axis=1) == 1)


def test_the_friction_curve_is_equation_16_and_its_slope_equation_19(nominal):
    curve = paper.friction_curve(nominal)
    slip = 0.1 * curve.speed
    assert curve.coefficient == pytest.approx(0.3 + 0.2 * np.exp(-slip), rel=1e-14)
    assert curve.slope == pytest.approx(-0.2 * np.exp(-slip), rel=1e-14)


DEPENDS: dict[
    str, tuple[float | None, float | None]
] = {  # the number in each reading; None where it needs a finer axis
    "Every frequency rises with the contact stiffness": (None, 0.0),
    "With constant friction the frequencies are much as with falling friction": (None, None),
    "The slope μt grows in proportion as the drum slows down": (0.101, 0.0066),
    "At low speeds the squeal propensity of Z, Tx and Ty is suppressed": (None, -208.0),
    "Friction damping is proportional to 1/Ω": (0.133, None),
    "X, Y and Tz move the lining mainly along the sliding direction": (0.331, 1.0),
    "A larger arc angle changes the growth rates of X and Tz little": (0.161, 0.623),
}
NOT_CONFIRMED = (
    "With contact stiffness every mode has a frequency",
    "A larger arc angle lowers the growth rates of X, Y and Tz",
)


@pytest.mark.thorough
def test_what_is_confirmed_what_is_not_and_what_hangs_on_a_reading(study):
    verdicts = {each.statement: each.verdict for each in study.statements}
    assert len(verdicts) == 26
    assert {says for says, verdict in verdicts.items() if verdict is paper.Verdict.NOT_CONFIRMED} == set(NOT_CONFIRMED)
    hang = {says for says, verdict in verdicts.items() if verdict is paper.Verdict.DEPENDS}
    assert hang == {*DEPENDS, "Without linear instability there is no squeal"}
    assert paper.Verdict.NOT_DECIDED not in verdicts.values()


@pytest.mark.thorough
@pytest.mark.parametrize(("says", "numbers"), DEPENDS.items())
def test_both_readings_have_their_numbers(study, says, numbers):
    readings = statement(study, says).readings
    assert {reading.holds for reading in readings} == {True, False}
    for reading, number in zip(readings, numbers, strict=True):
        if number is not None:  # of the same brake on axes of 121 points, and here they have 25
            assert reading.value == pytest.approx(number, rel=0.06, abs=1e-9)


@pytest.mark.thorough
def test_a_brake_that_damping_makes_stable_squeals_after_a_large_disturbance(study):
    constant, damped = statement(study, "Without linear instability").readings
    assert constant.holds
    assert not damped.holds
    model = build_model(study.disturbed[1].scene, coordinates=COORDINATES)
    rates = [mode.growth_rate for mode in analyse_stability(model).modes]
    assert -2 < max(rates) < 0  # a twentieth more damping than Y's 0.0085 takes 76 1/s × 0.05 = 3.8, less what X adds
    assert damped.value is not None
    assert damped.value > 0.1  # of the lining out of contact; 1 % would be squeal


def test_verdicts_follow_from_the_readings():
    def verdict(*numbers: float | None) -> str:
        return paper.says("5", "It is so", *(("number", number, "> 1 Hz") for number in numbers)).verdict

    assert verdict(2.0) is paper.Verdict.CONFIRMED
    assert verdict(2.0, 0.5) is paper.Verdict.DEPENDS
    assert verdict(2.0, None) is paper.Verdict.NOT_DECIDED
    assert verdict(1.0) is paper.Verdict.NOT_CONFIRMED


def test_the_largest_rise_is_that_over_any_distance():
    assert paper.largest_rise(np.array([3.0, 1.0, 2.0, 1.5, 2.5])) == 1.5
    assert paper.largest_rise(np.array([3.0, 2.0, 0.5])) == -1.0


@pytest.mark.thorough
def test_the_fractions_of_the_lining_s_motion_are_those_of_pure_translations(study):
    # Of X alone, with u_r = cos θ and u_θ = −sin θ, the tangential share is (β − sin β)/2β; of Z alone u_z is all.
    beta = study.scene.shoe.arc_angle
    told = dict(part.split() for part in statement(study, "X, Y and Tz move").readings[0].detail.split(", "))
    # X holds little else, a hundredth of its motion.
    assert float(told["X"]) == pytest.approx((beta - np.sin(beta)) / (2 * beta), abs=0.01)
    told = dict(part.split() for part in statement(study, "Z, Tx and Ty move").readings[0].detail.split(", "))
    assert float(told["Z"]) == pytest.approx(1, abs=0.01)


@pytest.mark.thorough
def test_constant_friction_fails_what_the_falling_curve_holds(study):
    swapped = {**study.curves, "5": study.curves["6"]}
    verdicts = altered(study, curves=swapped)
    assert verdicts["With contact stiffness X, Y and Tz are unstable"] is paper.Verdict.NOT_CONFIRMED
    swapped = {**study.curves, "6": study.curves["5"]}
    assert (
        altered(study, curves=swapped)["With constant friction (μ = 0.4) no mode is unstable"]
        is paper.Verdict.NOT_CONFIRMED
    )


@pytest.mark.thorough
def test_a_rising_curve_a_bent_line_and_a_figure_read_backwards_fail(study):
    assert study.friction is not None
    friction = replace(study.friction, slope=-study.friction.slope)
    assert (
        altered(study, friction=friction)["The coefficient of friction falls with the speed"]
        is paper.Verdict.NOT_CONFIRMED
    )
    bent = replace(study.curves["8"], values=np.sqrt(study.curves["8"].values))
    assert (
        altered(study, curves={**study.curves, "8": bent})[
            "The growth rates of X, Y and Tz rise linearly with the load"
        ]
        is paper.Verdict.NOT_CONFIRMED
    )
    backwards = replace(study.curves["10"], values=study.curves["10"].values[::-1])
    assert (
        altered(study, curves={**study.curves, "10": backwards})[
            "A larger radius lowers the growth rates of X, Y and Tz"
        ]
        is paper.Verdict.NOT_CONFIRMED
    )


@pytest.mark.thorough
def test_an_altered_brake_is_held_against_the_same_statements():
    rising = {"friction.static": 0.3, "friction.kinetic": 0.5}  # friction that rises with the speed feeds nothing
    verdicts = {
        each.statement: each.verdict for each in paper.study(seo_kang_brake().with_values(BRIEF | rising)).statements
    }
    assert verdicts["The coefficient of friction falls with the speed"] is paper.Verdict.NOT_CONFIRMED
    assert verdicts["With contact stiffness X, Y and Tz are unstable"] is paper.Verdict.NOT_CONFIRMED
    assert verdicts["With constant friction (μ = 0.4) no mode is unstable"] is paper.Verdict.CONFIRMED


@pytest.mark.thorough
def test_transients_measure_what_the_eigenvalues_say(study):
    for figure, points in study.points.items():
        for point in points:
            assert point.comparison is not None, (figure, point.why_not)
            for mode in point.comparison.modes:
                if mode.name in ("Y", "Tz") and mode.unstable:
                    # The growth phase is read below a tenth of the edges; what the paper's figures are held to is 1 %.
                    assert mode.growth_rate_error == pytest.approx(0, abs=1e-3), (figure, mode.name)


def test_a_straight_line_is_one_and_a_bent_one_is_off_by_its_bow():
    x = np.linspace(0, 1, 101)
    assert paper.off_line(x, 3 * x - 1) < 1e-14
    # The best line of x² by least squares is x − 1/6, off by 1/6 at both ends for many points.
    assert paper.off_line(x, x**2) == pytest.approx(1 / 6, rel=0.02)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"drum.speed": {"time": [0, 1], "value": [5, 4]}}, "drum.speed changes over time"),
        ({"friction": None}, "has no friction"),
        ({"support": None, "simulate.coordinates": ["Y", "Tz"]}, "six coordinates"),
        ({"contact.stiffness": 0.0}, "must not be 0"),
    ],
)
def test_what_is_no_brake_of_the_paper_is_refused(nominal, change, told):
    with pytest.raises(RequestError, match=told):
        paper.check_brake(nominal.with_values(change))


@pytest.mark.thorough
def test_the_command_writes_its_files(drumsqueal, tmp_path):
    out = tmp_path / "paper"
    status, printed, error = drumsqueal("paper", "-o", str(out), "--set", "simulate.duration=0.1")
    assert (status, error) == (0, "")
    assert {path.name for path in out.iterdir()} == set(FILES["paper"])
    assert "Of 26 statements" in printed
    found = json.loads((out / "statements.json").read_text())
    verdicts = [each["verdict"] for each in found["statements"]]
    assert verdicts.count("not confirmed") == 2
    assert verdicts.count("depends on a reading that the text does not fix") == 8
    words = " ".join(printed.split())  # lines are as wide as the terminal
    assert "16 are confirmed, 2 are not confirmed and 8 depend on a reading that the text does not fix" in words
    with (out / "statements.csv").open(newline="") as file:
        readings = list(csv.DictReader(file))
    assert len(readings) == sum(len(each["readings"]) for each in found["statements"]) == 35
    with (out / "paper.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["figure"] for row in rows} == set(PAPER_FIGURES)
    assert {row["source"] for row in rows if row["figure"] == "9"} == {"eigenvalue", "transient", "saturated motion"}
    last = [row for row in rows if (row["figure"], row["source"], row["mode"]) == ("8", "eigenvalue", "Y")][-1]
    # At twice the load it grows twice as fast as `run` prints, at the same frequency.
    assert float(last["value_SI"]) == pytest.approx(4000)
    assert float(last["frequency_Hz"]) == pytest.approx(1424.32, abs=0.5)
    assert float(last["growth_rate_1_per_s"]) == pytest.approx(2 * 76.157, rel=1e-3)
    for figure in PAPER_FIGURES.values():
        assert (out / figure_file(figure)).stat().st_size > 10_000


def test_the_command_draws_every_figure_of_a_bonded_brake(drumsqueal, tmp_path, monkeypatch, as_kept):
    """Three points a line and one transient a figure, with as few programs as there can be.

    Bonded and damped; and friction that is constant is by the same law, which does not fall then.
    """
    monkeypatch.setattr(paper, "POINTS", 3)
    monkeypatch.setattr(paper, "AXES", tuple(replace(axis, transients=(1.0,)) for axis in paper.AXES))
    monkeypatch.setattr(paper, "constant_friction", lambda scene: {"friction.static": 0.4, "friction.kinetic": 0.4})
    settings = ("simulate.duration=0.002", "contact.separation=false", "damping.ratio=0.001")
    how = [word for setting in settings for word in ("--set", setting)]
    status, printed, error = drumsqueal("paper", "-o", str(tmp_path), *how)
    assert (status, error) == (0, "")
    as_kept("paper", printed, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(FILES["paper"])
    for figure in PAPER_FIGURES.values():
        assert (tmp_path / figure_file(figure)).stat().st_size > 10_000
    found = json.loads((tmp_path / "statements.json").read_text())
    assert f"Of {len(found['statements'])} statements" in printed
    verdicts = {each["statement"]: each["verdict"] for each in found["statements"]}
    assert verdicts["The growth rates of X, Y and Tz rise linearly with the load"] == "confirmed"
    section = (ROOT / "docs" / "json.md").read_text().partition("### paper\n")[2].partition("###")[0]
    assert re.findall(r"`(\w+)`", section.partition("Keys: ")[2]) == list(found)
    with (tmp_path / "paper.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["figure"] for row in rows} == set(PAPER_FIGURES)
    of_load = [row for row in rows if (row["figure"], row["source"], row["mode"]) == ("8", "eigenvalue", "Y")]
    load, rate = ([float(row[name]) for row in of_load] for name in ("value_SI", "growth_rate_1_per_s"))
    # What friction feeds is proportional to the load, and 76.157 1/s at 2000 N, as `run` prints it without damping.
    assert load == [50, 2025, 4000]
    assert (rate[-1] - rate[0]) / 3950 == pytest.approx(76.157 / 2000, rel=1e-3)


def test_a_wrong_request_writes_nothing(drumsqueal, tmp_path):
    status, printed, error = drumsqueal("paper", "-o", str(tmp_path / "out"), "--set", "friction=none")
    assert status == 2
    assert printed == ""
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_an_interrupted_study_keeps_its_curves(drumsqueal, tmp_path, monkeypatch):
    def pressed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(paper, "run_points", pressed)
    out = tmp_path / "out"
    status, _, error = drumsqueal("paper", "-o", str(out))
    assert status == 1
    assert "interrupted by the user; what was done until then is in" in error
    assert {path.name for path in out.iterdir()} == {"paper.csv", "statements.csv", "statements.json"}
    verdicts = [each["verdict"] for each in json.loads((out / "statements.json").read_text())["statements"]]
    assert (len(verdicts), verdicts[-3:]) == (26, ["not decided"] * 3)  # those that take transients
    assert "not decided" not in verdicts[:-3]
    assert "the transient was not run" in (out / "paper.csv").read_text()


def test_a_file_of_the_same_numbers_is_the_same_brake(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(seo_kang_brake().to_toml(), encoding="utf-8")
    assert load_scene(file) == seo_kang_brake()


def test_the_example_takes_public_names_only():
    text = (ROOT / EXAMPLE).read_text(encoding="utf-8")
    assert not re.findall(r"^\s*(?:from drumsqueal\.|import drumsqueal)", text, re.MULTILINE)
    assert re.search(r"^from drumsqueal import \(", text, re.MULTILINE)


def test_the_example_alone_writes_the_files_of_the_command(tmp_path, monkeypatch, capsys):
    """Of a study that made no transient."""
    monkeypatch.setattr(paper, "POINTS", 3)
    monkeypatch.setattr(paper, "run_points", lambda points, progress: points)
    paper.main(tmp_path / "made" / "here")
    assert {path.name for path in (tmp_path / "made" / "here").iterdir()} == set(FILES["paper"])
    assert "Of 26 statements" in capsys.readouterr().out
    assert len(json.loads((tmp_path / "made" / "here" / "statements.json").read_text())["statements"]) == 26


def test_a_transient_that_is_interrupted_ends_the_study(nominal, monkeypatch):
    for outcome in ("interrupted by the user after t = 0.1 s", "interrupted by the user before the first samples"):
        points = [paper.Point("5", "a", 1.0, nominal)]

        def run(*_: Any, outcome: str = outcome) -> Any:
            if "before" in outcome:
                raise IntegrationError(outcome)
            return SimpleNamespace(findings=SimpleNamespace(outcome=outcome))

        monkeypatch.setattr(paper, "run", run)
        with pytest.raises(KeyboardInterrupt):
            paper.run_points(points, silent)
