"""What studies of effects, accuracy, sensitivity, sweeps and onsets are made of, and what they print."""

import io
import math
import queue
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import xarray
from rich.console import Console

from drumsqueal.dynamics.cycles.cycle import RangeKind
from drumsqueal.errors import Ending, IntegrationError, RequestError
from drumsqueal.findings.compare import RelativeChange, SceneAnswer
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.saturation import SpectralLine
from drumsqueal.questions.accuracy import study as bench
from drumsqueal.questions.effects import answer as effects_answer
from drumsqueal.questions.effects import reductions as in_brake
from drumsqueal.questions.effects import study as effects_study
from drumsqueal.questions.effects import study as variants_module
from drumsqueal.questions.effects.study import Variant, VariantRuns
from drumsqueal.questions.onset import answer as onset_answer
from drumsqueal.questions.onset import found as onset_words
from drumsqueal.questions.sensitivity import answer as sensitivity_answer
from drumsqueal.questions.sensitivity.stabilising import Change as NumberChange
from drumsqueal.questions.sweep import answer as sweep_answer
from drumsqueal.questions.sweep.cluster import Cluster, _check_cluster
from drumsqueal.questions.sweep.found import Chance, UnstableMode
from drumsqueal.questions.sweep.points import COMPUTED, NOT_TAKEN, OUTCOMES
from drumsqueal.scene.variation import Variation
from findings.fakes import mode_of


def printed(show: Any, *given: Any) -> list[str]:
    """The lines that are printed, each with one blank between its words."""
    console = Console(width=400, record=True, file=io.StringIO())
    show(console, *given)
    return [" ".join(line.split()) for line in console.export_text().splitlines() if line.strip()]


# --- effects ---------------------------------------------------------------------------------------------------------


def answer(**more: Any) -> SceneAnswer:
    known: dict[str, Any] = {
        "modes": {"X": mode_of(100.0, 3.0), "drum.E1": mode_of(200.0, -4.0)}, "unstable": ("X",),
        "amplitude": {"X": 1e-5, "drum.E1": 2e-5}, "carriers": ("X", "drum.E1"), "main": SpectralLine("X", 99.0, 3e-3),
        "rotation": 0.01,
    }  # fmt: skip
    return SceneAnswer(**(known | more))


def variant(label: str = "so", whole: SceneAnswer | None = None, **more: Any) -> Variant:
    known: dict[str, Any] = {
        "reductions": (), "scene": SimpleNamespace(several=False), "outcome": Ending.COMPLETE, "time_per_ms": 1.2345,
        "evaluations_per_ms": 678.9, "answer": whole, "change": None,
    }  # fmt: skip
    return Variant(label=label, **(known | more))


def test_effects_are_printed_with_what_they_cost_and_change():
    change = RelativeChange(0.01234, -5e-5, math.inf, None)
    shown = (
        variant("whole scene", answer()), variant("tilt", answer(), change=change),
        variant("none", time_per_ms=math.nan, evaluations_per_ms=math.nan),
        variant("exact", answer(carriers=()), change=RelativeChange(0.0, 1e-16, -0.5, 2e-4)),
    )  # fmt: skip
    of: Any = SimpleNamespace(
        variants=shown, needs=lambda each: each.label == "tilt", within=0.02, remarks=("a remark",), verdict="So it is."
    )
    lines = printed(effects_answer.print_study, of)
    for line in ("whole scene 1.23 679", "tilt * 1.23 679 +1.2 <0.01 lost -", "none - - failed", "So it is."):
        assert lines.count(line) == 1, (line, lines)
    assert any(line.startswith("exact 1.23 679") and "-50" in line for line in lines)
    assert any(
        "the largest over X, drum.E1, and of the frequency" in line and "needed within 2 %" in line for line in lines
    )
    of.variants = (variant("whole scene", answer(carriers=())),)
    assert not any("at the end" in line for line in printed(effects_answer.print_study, of))
    of.reduced_scene = None
    assert effects_answer.reduced_scene(of) is None
    of.reduced_scene = SimpleNamespace(to_toml=lambda: "[shoe]\n")
    assert effects_answer.reduced_scene(of) == "# So it is.\n# a remark\n[shoe]\n"


def test_limits_of_a_study_of_effects_are_what_was_not_compared_and_noise(nominal):
    def said(whole: Any = None, noise: Any = None, scene: Any = nominal) -> list[str]:
        return [each.split(":")[0] for each in effects_study.describe_limits(scene, whole, noise, 0.01)]

    quiet = RelativeChange(0.009, None, -0.002, 0.0)
    unknown = "The effect of the tolerance is unknown"
    assert said(answer(), quiet) == []
    assert said(None, None) == [unknown]
    assert said(answer(carriers=(), main=None), quiet) == ["The whole scene is at rest at the end"]
    assert said(answer(main=None), quiet) == ["The frequency at the end is not compared"]
    assert effects_study.describe_limits(nominal, answer(), RelativeChange(0.02, math.inf, -0.03, 0.009), 0.01) == (
        "A tenth of the tolerance changes the growth rates by 2 %: less does not count.",
        "The onset frequencies are not compared: at a tenth of the tolerance they are altogether different.",
        "A tenth of the tolerance changes the amplitude at the end by 3 %: less does not count.",
    )
    ramp = nominal.with_values({"drum.speed": {"time": [0.0, 1.0], "value": [5.0, 1.0]}})
    assert said(answer(), quiet, ramp) == ["Growth rates and onset frequencies are those at t = 0"]


def test_what_further_shapes_would_change_is_said_of_a_scene_that_bends(monkeypatch):
    prepared = SimpleNamespace(linear="model", stability="modes")
    monkeypatch.setattr(effects_study, "prepare", lambda of: prepared)
    monkeypatch.setattr(effects_study, "resolution_of", lambda *of: None if of[0] == "rigid" else of)
    monkeypatch.setattr(effects_study, "resolution_in_words", lambda found: [f"of {' '.join(found)}"] if found else [])
    assert effects_study.describe_truncation("bent") == ("of bent model modes",)  # pyright: ignore[reportArgumentType]
    assert effects_study.describe_truncation("rigid") == ()  # pyright: ignore[reportArgumentType]


def test_runs_are_said_that_failed_squeal_otherwise_or_turn_too_far():
    shown = [
        variant("whole", answer()), variant("same", answer()), variant("lost", outcome=Ending.FAILED, reason="why"),
        variant("quiet", answer(unstable=())), variant("other", answer(unstable=("Y", "X"))),
        variant("far", answer(rotation=0.2)), variant("near", answer(rotation=0.0999)),
    ]  # fmt: skip
    lost, *others = effects_study.describe_runs(shown)
    assert lost.startswith("lost: ")
    assert lost.endswith("why")
    assert others == [
        "quiet: no squeal instead of squeal in X", "other: squeal in Y, X instead of squeal in X",
        "far: the shoe turns by 0.2 rad, where the model no longer holds",
    ]  # fmt: skip
    shown[0] = replace(shown[0], scene=SimpleNamespace(several=True))  # pyright: ignore[reportArgumentType]
    assert any("a shoe turns" in each for each in effects_study.describe_runs(shown))


def test_a_pair_of_modes_of_the_drum_is_turned_by_its_waves_times_the_angle(monkeypatch):
    modes = SimpleNamespace(harmonics=(0, 2, 2, 3, 3, 2, 4, 4), wavenumbers=(0.0, 1.0, 1.0, 1.0, 1.0, 5.0, 7.0, 7.0))
    drum = (*(f"drum.E{k}" for k in range(1, 7)), "drum.S7", "drum.S8")
    monkeypatch.setattr(in_brake, "drum_modes", lambda scene: modes)
    monkeypatch.setattr(in_brake, "drum_names", lambda scene: drum)
    names = ("Y", "drum.E3", "drum.E2", "drum.E1", "drum.E4", "drum.E5", "drum.E6")
    turn = in_brake.turn_of_drum(None, names, 0.3)  # pyright: ignore[reportArgumentType]
    wanted = np.eye(7)
    for (a, b), n in (((2, 1), 2), ((4, 5), 3)):
        c, s = math.cos(n * 0.3), math.sin(n * 0.3)
        wanted[a, a], wanted[a, b], wanted[b, a], wanted[b, b] = c, -s, s, c
    np.testing.assert_allclose(turn, wanted)
    # Of a pair of which one is not among the names nothing turns; nor without modes of the drum.
    np.testing.assert_array_equal(in_brake.turn_of_drum(None, ("drum.E2", "drum.E5"), 0.3), np.eye(2))  # pyright: ignore[reportArgumentType]
    monkeypatch.setattr(in_brake, "drum_modes", lambda scene: None)
    np.testing.assert_array_equal(in_brake.turn_of_drum(None, names, 0.3), np.eye(7))  # pyright: ignore[reportArgumentType]


class AShoe(SimpleNamespace):
    """A shoe of a brake at a position (rad)."""


def test_the_answer_of_a_shoe_alone_is_turned_and_named_as_in_its_brake(monkeypatch):
    names = ["lost", "drum.E1", "X", "drum.E2"]
    turn = np.array([[0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [0.8, 0.0, -0.6]])
    rng = np.random.default_rng(2)
    history = xarray.Dataset(
        {name: (("time", "coordinate"), rng.normal(size=(5, 4))) for name in ("displacement", "velocity")},
        {"coordinate": names},
    )
    asked = []

    def turn_of_drum(scene, coordinates, position):
        assert (coordinates, position) == (("X", "drum.E1", "drum.E2"), 2.1)
        return turn

    def answer_of(history, findings, stability, linear):
        asked.append(history)
        assert (findings, linear) == ("findings", "linear")
        np.testing.assert_array_equal(stability, turn)
        return answer()

    monkeypatch.setattr(in_brake, "turn_of_drum", turn_of_drum)
    monkeypatch.setattr(in_brake, "answer_of", answer_of)
    monkeypatch.setattr(in_brake, "NamedShoe", AShoe)
    stability = SimpleNamespace(coordinates=("X", "drum.E1", "drum.E2"), turned=lambda turn: turn)
    run: Any = SimpleNamespace(history=history, stability=stability, findings="findings")
    brake: Any = SimpleNamespace(
        several=True, shoes=[AShoe(position=1.1), AShoe(position=2.1), AShoe(position=3.1)], prefixes=["a.", "b.", "c."]
    )
    scene: Any = SimpleNamespace(several=False)
    found = in_brake.answer_in(brake, scene, (0, 2), run, "linear")  # pyright: ignore[reportArgumentType]
    mine = [2, 1, 3]
    for name in ("displacement", "velocity"):
        before, after = history[name].values, asked[0][name].values
        np.testing.assert_allclose(after[:, mine], before[:, mine] @ turn.T)
        np.testing.assert_array_equal(after[:, 0], before[:, 0])
    assert list(found.modes) == ["b.X", "drum.E1"]
    assert (found.unstable, found.carriers) == (("b.X",), ("b.X", "drum.E1"))
    assert found.amplitude == {"b.X": 1e-5, "drum.E1": 2e-5}
    assert found.main == SpectralLine("b.X", 99.0, 3e-3)
    assert in_brake._renamed(answer(main=None), "b.").main is None


def test_a_run_costs_what_its_chunks_took_and_is_stopped_at_twenty_times_the_whole(monkeypatch):
    clock, takes = [0.0], [0.5]
    monkeypatch.setattr(variants_module.time, "perf_counter", lambda: clock[0])
    chunk: Any = SimpleNamespace(time=np.array([0.0, 0.25]), evaluations=900)
    last: Any = SimpleNamespace(time=np.array([0.25, 0.4]), evaluations=300)
    followed = []

    def follow(prepared, take, progress, what):
        followed.append(what)
        if take(chunk) is True:  # compiling takes long, and is not counted
            clock[0] += 77.0
            return
        for each in (last,):
            progress(what, 0.25, 0.4)
            clock[0] += takes[0]
            take(each)
        progress(what, 0.4, 0.4)

    monkeypatch.setattr(variants_module, "follow", follow)
    monkeypatch.setattr(variants_module, "prepare", lambda scene: SimpleNamespace(linear="linear"))
    monkeypatch.setattr(variants_module, "check_transient", lambda prepared: None)
    monkeypatch.setattr(variants_module, "finish", lambda prepared, chunks, outcome: len(chunks))
    monkeypatch.setattr(variants_module, "answer_in", lambda brake, scene, out, run, linear: run)
    monkeypatch.setattr(variants_module, "change_of", lambda whole, other: (whole, other))
    monkeypatch.setattr(variants_module, "reduce", lambda scene, reductions: scene)
    simulate = SimpleNamespace(tolerance=1e-6, duration=0.4)
    scene: Any = SimpleNamespace(simulate=simulate, with_values=lambda values: (scene, values)[0])
    reported = []
    bench = VariantRuns(scene, reported.append, lambda *_: None)
    whole, noise = reported
    assert (whole.label, whole.answer, whole.change) == ("whole scene", 2, None)
    assert whole.time_per_ms == pytest.approx(0.5 / 0.4)  # s a simulated s are ms a ms
    assert whole.evaluations_per_ms == pytest.approx(1200 / 400)
    assert (noise.label, bench.noise) == ("tolerance / 10", (2, 2))
    takes[0] = 10.5
    slow = bench.run("slow")
    assert (slow.outcome, slow.answer) == (Ending.FAILED, None)
    assert slow.reason == "it takes more than 20 times as long as the whole scene"
    takes[0] = 9.9  # never before 10 s
    assert bench.run("dear").outcome is Ending.COMPLETE
    assert bench._limit == 10.0
    takes[0] = 0.3
    again = bench.timed_again()
    assert [each.time_per_ms for each in again] == pytest.approx([0.3 / 0.4, 0.3 / 0.4, slow.time_per_ms, 0.3 / 0.4])
    # Again while all took less than a second: 0.5 + 0.3 + 0.3; the dear one once.
    assert [len(run.times) for run in bench._runs] == [3, 3, 1, 2]
    assert "whole scene, timed again" in followed


# --- accuracy --------------------------------------------------------------------------------------------------------


def test_smoothed_friction_is_that_without_its_jump_at_reversal():
    law: Any = SimpleNamespace(coefficient=lambda speed: 0.3 + 0.2 * jnp.exp(-speed))
    for slip, axial in ((0.7, None), (-0.4, None), (0.6, -0.8), (0.0, 0.3), (0.0, 0.0)):
        of = bench.SmoothedDirection(0.05, axial is not None)
        given = None if axial is None else jnp.asarray(axial)
        along, across = of.traction(law, jnp.asarray(9.0), jnp.asarray(slip), given)
        speed = math.hypot(slip, axial or 0.0)
        fraction = -(0.3 + 0.2 * math.exp(-speed)) * 9.0 / math.sqrt(speed**2 + 0.05**2)
        assert float(along) == pytest.approx(fraction * slip, rel=1e-6)
        assert (across is None) == (axial is None)
        assert across is None or float(across) == pytest.approx(fraction * (axial or 0.0), rel=1e-6)


def configuration(cause: str, line: str, setting: float, solver: str = "dopri8") -> Any:
    return bench.Configuration(cause, line, setting, solver, 1e-6, None)  # pyright: ignore[reportArgumentType]


def test_contenders_have_names_and_explicit_methods_run_the_whole_record():
    assert configuration(bench.STEPPING, "dopri8", 1e-3).name == "dopri8, 0.001"
    assert configuration(bench.QUADRATURE, "fixed grid", 40).name == "fixed grid, 40 nodes"
    assert configuration(bench.QUADRATURE, bench.CELLS, 4).name == "cells, 4 along"
    assert configuration(bench.SMOOTHING, "smoothed", 0.01).name == "smoothed, 0.01 of RΩ"
    assert configuration(bench.STEPPING, "a", 1.0).whole
    assert not configuration(bench.STEPPING, "a", 1.0, "kvaerno5").whole
    assert not configuration(bench.SMOOTHING, "a", 1.0).whole


# --- sensitivity -----------------------------------------------------------------------------------------------------


def a_change(key: str, before: float, after: float, unit: str = "", size: float = 1.0) -> NumberChange:
    return NumberChange(
        key=key, before=before, after=after, unit=unit, before_in_unit=before / size, after_in_unit=after / size
    )


def test_a_search_for_quiet_is_printed_number_by_number(nominal, monkeypatch):
    monkeypatch.setattr(sensitivity_answer, "as_it_is", lambda study: "As it is.")
    monkeypatch.setattr(sensitivity_answer, "cautions_of", lambda alone: ("a caution",))
    monkeypatch.setattr(sensitivity_answer, "without_answer", lambda alone, stable: (f"none, stable {stable}",))
    monkeypatch.setattr(sensitivity_answer, "quiet_sentence", lambda quiet, operating: f"Quiet, {operating}.")
    width, stiff = a_change("shoe.width", 0.0365, 0.04, "mm", 1e-3), a_change("friction.static", 0.5, 0.375)
    new = a_change("damping.ratio", 0.0, 0.02)

    def alone(key: str, stable: Any, quiet: Any) -> Any:
        return SimpleNamespace(key=key, stable=stable, quiet=quiet, change=quiet or stable)

    quiet = SimpleNamespace(
        quiet=True, found=True, succeeded=True, changes=(stiff, width, new), scene_file="[shoe]\n",
        scene=nominal.with_values({"damping.ratio": 0.02}),
    )  # fmt: skip
    study: Any = SimpleNamespace(
        alone=(alone("shoe.width", stiff, width), alone("friction.static", stiff, None), alone("x", None, None)),
        stable=False, scene=nominal, quiet=quiet, operating="at 5 rad/s",
    )  # fmt: skip
    lines = printed(sensitivity_answer._print_search, study)
    assert lines[0] == "As it is."
    for line in (
        "shoe.width 36.5 mm 0.375 -25 % 40 mm +9.59 %",
        "friction.static 0.5 0.375 -25 % none found", "a caution", "none, stable False",
        "friction.static 0.5 0.375 -25 %",
        "shoe.width 36.5 40 mm +9.59 %", "damping.ratio 0 0.02 new", "Quiet, at 5 rad/s.",
    ):  # fmt: skip
        assert line in lines, (line, lines)
    assert "The smallest change found that makes the brake quiet" in " ".join(lines)  # a title over two lines
    assert [line.split()[0] for line in lines[-5:-1]][-3:] == sorted(
        ("friction.static", "shoe.width", "damping.ratio"),
        key=lambda key: -abs(next(each.logarithm for each in quiet.changes if each.key == key)),
    )
    study.stable, quiet.quiet, quiet.succeeded = True, False, False
    lines = printed(sensitivity_answer._print_search, study)
    assert "shoe.width 36.5 mm 40 mm +9.59 %" in lines
    assert "friction.static 0.5 none found" in lines
    assert "The smallest change that makes every mode decay" in " ".join(lines)
    assert not any(line.startswith("Quiet,") for line in lines)
    assert sensitivity_answer.quiet_scene(study) is None
    quiet.found = False
    assert "The change with the least growth" in " ".join(printed(sensitivity_answer._print_search, study))
    quiet.succeeded = True
    monkeypatch.setattr(sensitivity_answer, "quiet_sentence", lambda quiet, operating: "word " * 30)
    head, second, rest = sensitivity_answer.quiet_scene(study).split("\n", 2)  # pyright: ignore[reportOptionalMemberAccess]
    assert (head, second, rest) == ("# " + " ".join(["word"] * 22), "# " + " ".join(["word"] * 8), "[shoe]\n")
    study.alone, study.quiet = (alone("x", None, None),), None
    assert "Each number alone, the least change first" not in printed(sensitivity_answer._print_search, study)
    assert sensitivity_answer.quiet_scene(study) is None


def test_a_change_of_a_growth_rate_is_printed_from_round_off_on():
    of: Any = SimpleNamespace(round_off_1_per_s=1e-4)
    shown = [sensitivity_answer._change(of, value) for value in (1e-4, -1.1e-4, 0.0099, 0.01, -1.26, 123.4)]
    assert shown == ["0", "-1e-04", "+1e-02", "+0.01", "-1.3", "+1.2e+02"]


# --- sweeps ----------------------------------------------------------------------------------------------------------


def a_sweep(nominal, **more: Any) -> Any:
    modes = {
        "X": UnstableMode(
            unstable_points=3, largest_growth_rate_1_per_s=12.3456, frequency_there_Hz=456.789,
            where={"drum.speed": 5.4321, "friction.static": 0.5},
        )
    }  # fmt: skip
    outcomes = {OUTCOMES[COMPUTED]: 7, OUTCOMES[NOT_TAKEN]: 2, "another": 1}
    known: dict[str, Any] = {
        "basin": None, "chance": None, "modes": modes, "transients": None, "points": 10,
        "points_with_squeal": 4, "points_with_divergence": 0, "outcomes": outcomes,
        "units": {"drum.speed": "rad/s", "friction.static": "1"},
        "plan": SimpleNamespace(keys=("drum.speed",), scene=nominal),
        "data": {"outcome": SimpleNamespace(values=np.array([[COMPUTED, COMPUTED], [NOT_TAKEN, COMPUTED]]))},
    }  # fmt: skip
    return SimpleNamespace(**(known | more))


def test_a_sweep_is_printed_mode_by_mode_and_by_what_became_of_its_points(nominal, monkeypatch):
    monkeypatch.setattr(sweep_answer, "refusal", lambda plan, number: f"refused at {number}")
    lines = printed(sweep_answer.print_study, a_sweep(nominal))
    assert lines[0] == "Squeal at 4 of 10 points, by eigenvalues"
    assert "X 3 +12.346 456.79 drum.speed 5.432 rad/s, friction.static 0.5" in lines
    assert f"2 of 10 points: {OUTCOMES[NOT_TAKEN]}; the first: refused at 2" in lines
    assert "1 of 10 points: another" in lines
    assert not any(OUTCOMES[COMPUTED] in line for line in lines[3:] if "7 of" in line)
    assert not any("diverges" in line or "Transients" in line or "elastic" in line for line in lines)
    lines = printed(sweep_answer.print_study, a_sweep(nominal, modes={}, points_with_divergence=3))
    assert lines[0] == "Squeal at 4 of 10 points, by eigenvalues"
    assert "Steady sliding diverges without oscillation at 3 points" in lines
    transients = SimpleNamespace(
        trends={"decay": 3, "grow": 5}, points_with_squeal=2, points_not_settled=1, longest_of_them_s=1.23456
    )
    lines = printed(sweep_answer.print_study, a_sweep(nominal, transients=transients))
    assert "Transients at their end: 3 decay, 5 grow" in lines
    assert "By the transients, from the scene's own start: squeal at 2 of 8 points (25 %)" in lines
    assert any(line.startswith("1 of 8 transients has not settled after 1.23 s") for line in lines)
    transients.points_not_settled = 2
    assert any(
        "2 of 8 transients have not" in x
        for x in printed(sweep_answer.print_study, a_sweep(nominal, transients=transients))
    )
    transients.trends, transients.points_not_settled = {}, 0
    lines = printed(sweep_answer.print_study, a_sweep(nominal, transients=transients))
    assert "Transients at their end: none" in lines
    assert "By the transients, from the scene's own start: squeal at 2 of 0 points" in lines
    assert not any("not settled" in line for line in lines)


def test_a_sweep_of_samples_is_printed_with_probabilities_and_what_they_depend_on(nominal, monkeypatch):
    monkeypatch.setattr(sweep_answer, "refusal", lambda plan, number: "refused")

    def chance(share: float) -> Any:
        return Chance(count=round(99 * share), total=99, share=share, low=share / 2, high=share * 1.5)

    found = SimpleNamespace(
        squeal=chance(0.4), modes={"X": chance(0.3), "Y": chance(0.1)}, noise=0.234,
        known_correlations={"a": 0.567, "b": -0.891},
    )  # fmt: skip
    lines = printed(sweep_answer.print_study, a_sweep(nominal, chance=found))
    assert "Probability of squeal by eigenvalues, 99 samples" in lines
    assert "any 40.00 % 20.00 % 60.00 %" in lines
    assert "X 30.00 % 15.00 % 45.00 % +12.346 456.79" in lines
    assert "Y 10.00 % 5.00 % 15.00 %" in lines
    assert "Rank correlation with the largest growth rate (below 0.23 it is not significant): a +0.57, b -0.89" in lines
    found.known_correlations = {}
    assert not any("Rank" in line for line in printed(sweep_answer.print_study, a_sweep(nominal, chance=found)))


class Client:
    """A cluster of two workers of one and two threads, whose batches end in an order of its own."""

    def __init__(self, fails: dict[int, Any] | None = None) -> None:
        self.submitted: list[int] = []
        self.cancelled: list[Any] = []
        self.status, self.fails = "running", fails or {}
        self.waiting: list[Any] = []

    def nthreads(self) -> dict[str, int]:
        return {"one": 1, "two": 2}

    def submit(self, work, plan, first, stop, versions, *, key, pure):
        assert key.endswith(f"-{first}")
        assert not pure
        self.submitted.append(first)
        future = SimpleNamespace(
            status="finished", result=lambda: (plan, first, stop), exception=lambda: None, **self.fails.get(first, {})
        ) if first not in self.fails else SimpleNamespace(**self.fails[first])  # fmt: skip
        future.add_done_callback = lambda call: (self.waiting.append(call), call(None))
        return future

    def cancel(self, futures) -> None:
        self.cancelled = futures


def test_batches_are_handed_out_two_for_each_thread_and_come_back_with_their_first_point():
    client: Any = Client()
    left = [(3 * k, 3 * k + 3) for k in range(9)]
    looked = []
    stream = Cluster(client).results("plan", left, lambda: looked.append(1))  # pyright: ignore[reportArgumentType]
    assert next(stream) == (0, ("plan", 0, 3))
    assert client.submitted == [0, 3, 6, 9, 12, 15]
    assert next(stream)[0] == 3
    assert client.submitted == [0, 3, 6, 9, 12, 15, 18]
    rest = dict(stream)
    assert list(rest) == [6, 9, 12, 15, 18, 21, 24]
    assert rest[24] == ("plan", 24, 27)
    assert client.cancelled == []
    assert len(looked) == 9
    stream: Any = Cluster(client).results("plan", left)  # pyright: ignore[reportArgumentType]
    next(stream)
    stream.close()
    assert len(client.cancelled) == 5


@pytest.mark.parametrize(
    ("future", "said"),
    [
        ({"status": "error", "exception": lambda: ValueError("so")}, "a worker of the cluster failed, ValueError: so"),
        ({"status": "cancelled"}, "the scheduler of the cluster was lost"),
        ({"status": "error", "exception": lambda: type("KilledWorker", (Exception,), {})()}, "number 3 on"),
    ],
)
def test_a_batch_that_fails_says_why(future, said):
    client: Any = Client({3: future})
    with pytest.raises(IntegrationError, match=said):
        list(Cluster(client).results("plan", [(0, 3), (3, 6)]))  # pyright: ignore[reportArgumentType]

    def lost():
        raise OSError

    client = Client({0: {"status": "finished", "result": lost}})
    with pytest.raises(IntegrationError, match="scheduler of the cluster was lost"):
        list(Cluster(client).results("plan", [(0, 3)]))  # pyright: ignore[reportArgumentType]


def test_a_scheduler_is_waited_for_twenty_seconds(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("drumsqueal.questions.sweep.cluster.time.monotonic", lambda: clock[0])
    client: Any = Client()
    of = Cluster(client)
    client.status = "connecting"
    of._look_for_scheduler()
    clock[0] += 19.9
    of._look_for_scheduler()
    client.status = "running"
    of._look_for_scheduler()
    client.status = "connecting"
    clock[0] += 10.0
    of._look_for_scheduler()  # it was there meanwhile
    clock[0] += 20.1
    with pytest.raises(IntegrationError, match="was lost"):
        of._look_for_scheduler()
    client.status, of._lost_since = "closed", None
    with pytest.raises(IntegrationError, match="was lost"):
        of._look_for_scheduler()
    ready: Any = queue.SimpleQueue()
    ready.put(7)
    assert of._next(ready, lambda: None) == 7


def test_a_cluster_is_local_or_an_address():
    for name in ("local", "tcp://host:8786", "tls://10.0.0.1:1"):
        _check_cluster(name)
    for name in ("here", "tcp://host", "host:8786", "http://host:1", "tcp://host:8786/x"):
        with pytest.raises(RequestError, match="write local, or the address of a scheduler"):
            _check_cluster(name)


# --- onset -----------------------------------------------------------------------------------------------------------


def an_onset(*rows: Any, **more: Any) -> Any:
    known: dict[str, Any] = {
        "variation": Variation("drum.speed", "rad/s", (1.0, 9.0), "rpm", 2 * math.pi / 60), "coordinate": "X",
        "rubbing": "the lining", "in_order": rows, "values": rows, "critical_values": (), "warnings": (),
        "verdict": "So it is.", "cycles": None, "scene": None, "ranges": (),
    }  # fmt: skip
    return SimpleNamespace(**(known | more))


def a_row(value: float, *smallest: Any, **more: Any) -> Any:
    least = min(smallest, key=lambda each: each.energy_J, default=None)
    known: dict[str, Any] = {
        "value": value, "kind": RangeKind.BISTABLE, "asked": True, "small": None, "growth_rate": -1.234, "led_to": (),
        "motions": tuple(each.leads_to for each in smallest), "smallest_disturbances": smallest,
        "smallest_disturbance": least,
    }  # fmt: skip
    return SimpleNamespace(**(known | more))


def smallest(mode: str, speed: float, amplitude: float, frequency: float | None) -> Any:
    motion = SimpleNamespace(amplitude={"X": amplitude}, frequency_Hz=frequency)
    return SimpleNamespace(
        mode=mode, speed_m_per_s=speed, speed_uncertainty_m_per_s=speed / 50, energy_J=speed**2, leads_to=motion,
        energy_uncertainty_J=speed**2 / 30, boundary_ratio=2.3456 * speed,
    )  # fmt: skip


def test_the_smallest_disturbances_are_printed_by_their_energy_at_each_value():
    rpm = 30 / math.pi
    rows = (
        a_row(1.5, smallest("Y", 0.5, 1.2346e-5, 98.76), smallest("X", 0.25, 2.3456e-5, None)),
        a_row(2.5, growth_rate=None, kind=RangeKind.STABLE, asked=False, small=None),
        a_row(3.5, growth_rate=None, kind=RangeKind.STABLE, small=SimpleNamespace(motion=None, leads_to=Kind.DECAYS)),
    )
    lines = printed(onset_answer.print_study, an_onset(*rows))
    assert f"{1.5 * rpm:.5g} X 0.250 ± 0.005 0.062 ± 0.002 0.586 23.46" in lines
    assert f"{1.5 * rpm:.5g} Y 0.50 ± 0.01 0.250 ± 0.008 1.17 12.35 98.76" in lines
    assert next(line for line in lines if " ± " in line).split()[1] == "X"
    assert f"{1.5 * rpm:.5g} bistable -1.23 -" in lines
    assert f"{3.5 * rpm:.5g} stable - a small perturbation decays" in lines
    assert not any(line.startswith(f"{2.5 * rpm:.5g} ") for line in lines)
    assert lines[-1] == "So it is."
    text = onset_words._smallest_disturbances(an_onset(*rows, a_row(4.5, smallest("Y", 0.1, 1e-5, 9.0))))
    assert text == (
        f" The smallest disturbance along a mode that starts squeal, as the velocity of the lining's surface, is 0.100 "
        f"± 0.002 m/s (0.01 J) at {4.5 * rpm:.6g} rpm to 0.250 ± 0.005 m/s (0.062 J) at {1.5 * rpm:.6g} rpm at the "
        "values tried."
    )
    assert onset_words._smallest_disturbances(an_onset(rows[1])) == ""


@pytest.mark.parametrize(
    ("kinds", "said"),
    [
        ((RangeKind.SQUEALS, RangeKind.STABLE), "elsewhere no start that was tried squeals"),
        ((RangeKind.STABLE, RangeKind.NEUTRAL), "no start that was tried squeals"),
        ((RangeKind.NEUTRAL,), "motion neither grows nor decays: its amplitude is that of the initial perturbation"),
        ((RangeKind.NEUTRAL, RangeKind.SQUEALS), "elsewhere motion neither grows nor decays"),
        ((RangeKind.SQUEALS,), ""), ((RangeKind.UNDECIDED,), ""),
    ],
)  # fmt: skip
def test_where_nothing_is_bistable_it_is_said_what_starts_do(kinds, said):
    text = onset_words._quiet(an_onset(ranges=tuple(SimpleNamespace(kind=kind) for kind in kinds)))
    assert text.startswith(said)
    assert bool(text) == bool(said)
