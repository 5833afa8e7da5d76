"""What accuracy costs: the independent quadratures and reference, the word that `tolerance` keeps, and the study."""

import csv
import dataclasses
import io
import tomllib
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from along_y import OPTIONS, AlongY, brake_along_y
from drumsqueal.errors import Ending
from drumsqueal.files.output_folder import FILES, to_json, write_json
from drumsqueal.findings.schema import read_findings
from drumsqueal.physics.model import Model, build_model
from drumsqueal.physics.quadrature.independent import FEJER, TANH_SINH, FixedGrid, IndependentSurface, rule_of
from drumsqueal.physics.quadrature.surface import Surface
from drumsqueal.questions.accuracy import study as bench
from drumsqueal.questions.accuracy import study as reference
from drumsqueal.questions.accuracy.answer import simulate_block, to_csv
from drumsqueal.questions.accuracy.study import (
    AccuracyStudy,
    Reference,
    feature_errors,
    find_reference,
    sizes_of,
    study_accuracy,
    trajectory_error,
)
from drumsqueal.scene import COORDINATES, Scene, load_scene
from drumsqueal.simulation import prepare, transient
from processes import PATIENCE

SCENARIOS = Path(__file__).parents[2] / "scenarios"
REFERENCE = Path(__file__).parents[1] / "solve" / "reference"
SIZE_Q, SIZE_V = np.array([7e-6, 7e-6, 7e-5]), np.array([0.3, 0.3, 3.0])  # beyond the edges of the nominal scene


@pytest.fixture(autouse=True, scope="module")
def _unhurried():
    """No run and no reference is cut short, however slow the machine is or however busy."""
    with pytest.MonkeyPatch.context() as patch:
        for limit in ("PATIENCE", "LONGEST"):
            patch.setattr(f"drumsqueal.questions.accuracy.study.{limit}", PATIENCE)
        yield


act = jax.jit(lambda model, q, v: model.act(0.0, q, v))


def on(model: Model, surface: Surface) -> Model:
    """The model with another quadrature."""
    return dataclasses.replace(model, contact=dataclasses.replace(model.lining, surface=surface))


def states_of(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Times and states (k, 2n) of a scene's transient."""
    chunks = list(transient(prepare(scene)))
    states = np.concatenate([np.hstack([chunk.displacement, chunk.velocity]) for chunk in chunks])
    return np.concatenate([chunk.time for chunk in chunks]), states


# --- quadratures that share nothing with the engine's ----------------------------------------------------------------


@pytest.mark.thorough(but=["Fej\\xe9r"])
@pytest.mark.parametrize("rule", [TANH_SINH, FEJER])
def test_rules_integrate_what_is_known(rule):
    point, weight = rule_of(rule)
    assert_allclose(np.sum(weight), 2, rtol=1e-14)
    assert_allclose(np.sum(weight * np.exp(point)), np.e - 1 / np.e, rtol=1e-14)
    assert_allclose(np.sum(weight / (2 + point)), np.log(3), rtol=1e-13)


@pytest.mark.thorough(but=["True-tanh-sinh", "True-Fej\\xe9r"])
@pytest.mark.parametrize("rule", [TANH_SINH, FEJER])
@pytest.mark.parametrize("spatial", [False, True])
def test_independent_quadratures_agree_with_the_engine_in_the_plane(nominal, rule, spatial):
    # Both find the edges in closed form, each in its own, and are exact between them: 4e-13 of the load was found.
    model = build_model(nominal)
    generator = np.random.default_rng(5)
    for _ in range(40):
        q, v = (jnp.asarray(generator.uniform(-1, 1, 3) * size) for size in (SIZE_Q, SIZE_V))
        engine, power = act(model, q, v)
        other, other_power = act(on(model, IndependentSurface(rule, spatial)), q, v)
        assert np.max(np.abs(engine - other) / np.array([1, 1, 0.1])) < 1e-11 * 2000
        assert abs(power - other_power) < 1e-11 * 2000


@pytest.mark.thorough
def test_independent_quadrature_agrees_with_the_engine_in_space(nominal):
    # Below the edges, where both are exact; beyond them the fixed lines are not.
    model = build_model(nominal, coordinates=COORDINATES)
    generator = np.random.default_rng(6)
    q = jnp.asarray(generator.uniform(-1, 1, 6) * 1e-7 * np.array([1, 1, 1, 10, 10, 10]))
    v = jnp.asarray(generator.uniform(-1, 1, 6) * 1e-2 * np.array([1, 1, 1, 10, 10, 10]))
    engine, other = act(model, q, v)[0], act(on(model, IndependentSurface(TANH_SINH, True)), q, v)[0]
    assert np.max(np.abs(engine - other)) < 1e-11 * 2000


def test_a_fixed_grid_comes_closer_with_its_square_where_boundaries_cross_it(nominal):
    # The midpoint rule is of second order, and no better with kinks: ten times the nodes, some hundredth of the error.
    model = build_model(nominal)
    generator = np.random.default_rng(7)
    errors = dict.fromkeys((40, 400), 0.0)
    for _ in range(20):
        q, v = (jnp.asarray(generator.uniform(-1, 1, 3) * size) for size in (SIZE_Q, 0 * SIZE_V))
        exact = act(model, q, v)[0]
        for nodes in errors:
            found = act(on(model, FixedGrid(nodes, False)), q, v)[0]
            errors[nodes] = max(errors[nodes], float(np.max(np.abs(found - exact))))
    assert 50 < errors[40] / errors[400] < 200


# --- the reference ---------------------------------------------------------------------------------------------------


def test_the_reference_is_that_of_an_independent_code(nominal):
    # 1 ms of the reference trajectory in the plane, in which the lining lifts off; good to 1e-8 over its 20 ms.
    wanted = np.loadtxt(REFERENCE / "transient_inplane_large.csv", delimiter=",", skiprows=1)
    upto = wanted[:, 0] <= 0.001 + 1e-9
    model, start = build_model(nominal), wanted[0, 1:]
    found = find_reference(model, np.zeros(3), start, wanted[upto, 0])
    sizes = np.abs(wanted[upto, 1:]).max(axis=0)
    assert trajectory_error(found.states, wanted[upto, 1:], sizes) < 1e-8
    assert 0 < found.uncertainty(0.001) < 1e-8
    assert 0 < found.confirmed(0.001) < 1e-6
    assert trajectory_error(found.other, wanted[upto, 1:], sizes) < 1e-8
    np.testing.assert_allclose(sizes_of(found.states, model), sizes, rtol=1e-7)


def test_errors_are_measured_against_the_motion_so_far(monkeypatch):
    # A motion that grows by e² in 2 s, and another that is off by a thousandth of it up to 1 s and by half from there.
    monkeypatch.setattr(reference, "motion_scale", lambda *_: SimpleNamespace(flat=lambda: np.zeros(3)))
    model: Any = SimpleNamespace(names=("X",), mass=np.ones(1), stiffness=np.eye(1))
    time = np.linspace(0.0, 2.0, 201)
    states = np.exp(time)[:, None] * [1.0, -2.0]
    off = np.where(time <= 1.0, 1e-3, 0.5)[:, None]
    found = Reference(time, states, states * (1 + off), states * (1 - 2 * off), model)
    assert found.uncertainty(1.0) == pytest.approx(1e-3)
    assert found.confirmed(1.0) == pytest.approx(2e-3)
    assert found.uncertainty(2.0) == pytest.approx(0.5)
    longer = np.vstack([states * [1.0, 1.01], np.full((50, 2), np.inf)])
    assert found.error(longer, 1.0) == pytest.approx(0.01)


# --- tolerance keeps its word ----------------------------------------------------------------------------------------

# Until the first edge of each, or as long as the scene takes to run in a test.
UNTIL = {
    "nominal": 0.05,
    "constant_friction": 0.05,
    "damped": 0.05,
    "self_consistent": 0.03,
    "out_of_plane": 0.02,
    "stop": 0.05,
}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "solver"),
    [
        *((name, "dopri8") for name in UNTIL if name != "stop"),
        pytest.param("stop", "dopri8", marks=pytest.mark.thorough),
        ("nominal", "tsit5"),
        ("nominal", "dopri5"),
    ],
)
def test_what_is_got_is_what_tolerance_asks_for(name, solver):
    # The largest error of any state over its largest value. A factor of ten either way is the promise; 0.06 to 6 was
    # found over these scenes, methods and tolerances.
    scene = load_scene(SCENARIOS / f"{name}.toml").with_values({"simulate.duration": UNTIL[name]})
    rest = np.asarray(prepare(scene).stability.steady_state)
    _, wanted = states_of(scene.with_values({"simulate.tolerance": 1e-12}))
    n = wanted.shape[1] // 2
    at_rest = np.concatenate([rest if n == 6 else rest[[0, 1, 5]], np.zeros(n)])
    for tolerance in (1e-3, 1e-5, 1e-7, 1e-9):
        values = {"simulate.tolerance": tolerance, "simulate.solver": solver}
        vibration = states_of(scene.with_values(values))[1] - at_rest
        got = trajectory_error(vibration, wanted - at_rest, sizes_of(wanted - at_rest, prepare(scene).model))
        assert got < 10 * tolerance
        assert got > tolerance / 50  # nor is time wasted on more


# --- the study -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def study() -> AccuracyStudy:
    """A short, small study: 6 ms of the nominal scene from a start that reaches edges after some of them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench, "TOLERANCES", (1e-2, 1e-4, 1e-6))
        patch.setattr(bench, "NODES", (2, 8))
        patch.setattr(bench, "GRID", (40, 160))
        patch.setattr(bench, "WIDTHS", (1e-1, 1e-3))
        scene = load_scene(SCENARIOS / "nominal.toml").with_values(
            {"simulate.duration": 0.006, "start.displacement": {"Y": 6e-6}}
        )
        return study_accuracy(scene, 1e-3, solvers=["diffrax.Tsit5"])


@pytest.mark.thorough
def test_every_line_of_the_study_gets_better(study):
    lines: dict[str, list[float]] = {}
    for each in study.measurements:
        assert each.outcome == Ending.COMPLETE
        assert each.errors is not None
        lines.setdefault(each.configuration.line, []).append(each.errors.beyond or each.errors.trajectory or 0.0)
        assert each.time_per_ms > 0
    steps = {"tsit5", "dopri5", "dopri8", "sdirk4", "diffrax.Tsit5"}
    assert set(lines) == {*steps, "split lining", "fixed grid", "smoothed"}
    for errors in lines.values():
        assert all(later < earlier / 5 for earlier, later in pairwise(errors))


@pytest.mark.thorough
def test_the_cheapest_meets_the_target_and_nothing_that_does_is_cheaper(study):
    best = study.cheapest
    assert best is not None
    assert best.errors is not None
    assert best.errors.trajectory is not None
    assert best.errors.trajectory <= 1e-3
    assert best.errors.energy <= 1e-3
    enough = [
        each.evaluations
        for each in study.measurements
        if each.configuration.whole
        and each.errors is not None
        and (each.errors.trajectory or 0) <= 1e-3
        and (each.errors.largest_feature or 0) <= 1e-3
        and each.errors.energy <= 1e-3
    ]
    assert best.evaluations == min(enough)
    values = {f"simulate.{key}": value for key, value in tomllib.loads(simulate_block(study))["simulate"].items()}
    simulate = study.scene.with_values(values).simulate
    assert (simulate.solver, simulate.tolerance) == (best.configuration.solver, best.configuration.tolerance)
    assert best.configuration.solver in study.verdict


@pytest.mark.thorough
def test_the_reference_is_better_than_what_it_judges(study):
    finest = min(each.errors.trajectory for each in study.measurements if each.errors and each.errors.trajectory)
    assert study.reference.uncertainty(study.growth_end) < finest
    assert any("uncertain" in remark or "differs by" in remark for remark in study.remarks)


@pytest.mark.thorough
def test_the_table_has_every_run_with_versions_and_machine(study):
    rows = list(csv.DictReader(io.StringIO(to_csv(study))))
    assert len(rows) == len(study.measurements)
    assert all(row["processor"] and row["jax"] and row["cores"] for row in rows)
    assert [float(row["setting"]) for row in rows[:3]] == [1e-2, 1e-4, 1e-6]
    assert {row["evaluations"] for row in rows if row["line"] == "sdirk4"} == {""}


@pytest.mark.thorough
def test_the_findings_read_back_as_what_was_written(study, tmp_path):
    write_json(study, tmp_path / "accuracy.json")
    assert to_json(read_findings(tmp_path / "accuracy.json", AccuracyStudy)) == to_json(study)


def test_the_growth_rate_of_a_neutral_mode_is_measured_against_the_record():
    errors = feature_errors({("growth_rate", "X"): 1e-9}, {("growth_rate", "X"): 3e-5}, duration=0.1)
    assert errors.growth_rate == pytest.approx(3e-6, rel=1e-3)


@pytest.mark.thorough
def test_what_only_round_off_moves_is_not_measured_against_itself(nominal):
    # Without friction nothing but round-off moves X when Y is started.
    scene = nominal.with_values({"friction": None, "simulate.duration": 0.002})
    model, (_, states) = prepare(scene).model, states_of(scene)
    sizes = sizes_of(states, model)
    assert np.abs(states[:, 0]).max() < 1e-12 * np.abs(states[:, 1]).max()
    assert sizes[0] > 1e-7 * sizes[1]
    np.testing.assert_array_equal(sizes[[1, 4]], np.abs(states).max(axis=0)[[1, 4]])


def test_a_scene_at_rest_is_refused_and_nothing_written(drumsqueal, tmp_path):
    out = tmp_path / "out"
    settings = ["--set", "start.displacement={}"]
    status, _, error = drumsqueal("accuracy", str(SCENARIOS / "nominal.toml"), "-o", str(out), *settings)
    assert status == 2
    assert "nothing moves" in error
    assert error.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("scene", "solver", "reason"),
    [("nominal", "diffrax.Tsi5", "one of auto, "), ("stop", "diffrax.Tsit5", "at rest at t = 0.3 s: where the lining")],
)
def test_a_solver_that_cannot_run_the_scene_is_refused_and_nothing_written(drumsqueal, tmp_path, scene, solver, reason):
    out, scene = tmp_path / "out", str(SCENARIOS / f"{scene}.toml")
    status, printed, error = drumsqueal("accuracy", scene, "-o", str(out), "--solver", solver)
    assert (status, printed) == (2, "")
    assert reason in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_a_lost_feature_is_infinitely_wrong():
    best = {("growth_rate", "Y"): 76.0, ("onset_frequency", "Y"): 1424.0, ("main_frequency", ""): 1076.0}
    errors = feature_errors(best, {("growth_rate", "Y"): 76.076, ("main_frequency", ""): 1076.0}, 0.4)
    assert errors.growth_rate == pytest.approx(1e-3)
    assert errors.onset_frequency == np.inf
    assert (errors.main_frequency, errors.amplitude) == (0.0, None)


@pytest.mark.parametrize("target", ["0", "2", "many"])
def test_a_wrong_target_is_refused_and_nothing_written(drumsqueal, tmp_path, target):
    out = tmp_path / "out"
    status, printed, error = drumsqueal("accuracy", str(SCENARIOS / "nominal.toml"), "-o", str(out), "--target", target)
    assert (status, printed) == (2, "")
    assert f"--target {target}" in error
    assert error.count("\n") == 1
    assert not out.exists()


@pytest.mark.thorough(but=["dopri8"])  # both loops are compared on oscillators in `tests/solve`, quickly
@pytest.mark.parametrize("solvers", ["dopri8", "dopri8 diffrax.Dopri8"])
def test_the_command_measures_the_error_that_a_brake_along_y_has(drumsqueal, tmp_path, monkeypatch, solvers, as_kept):
    monkeypatch.setattr(bench, "SOLVERS", ("dopri8",))
    for name, few in {"TOLERANCES": (1e-4,), "NODES": (), "GRID": (), "WIDTHS": ()}.items():
        monkeypatch.setattr(bench, name, few)
    settings = ("start.displacement={Y = 6e-6}", "simulate.duration=0.001")
    how = (*OPTIONS, *(word for setting in settings for word in ("--set", setting)), "--target", "1e-2")
    _, *other = solvers.split()
    how = (*how, *(word for name in other for word in ("--solver", name)))
    status, printed, error = drumsqueal("accuracy", str(SCENARIOS / "damped.toml"), "-o", str(tmp_path), *how)
    assert (status, error) == (0, "")
    if not other:
        as_kept("accuracy", "", tmp_path)  # it prints times
    assert {path.name for path in tmp_path.iterdir()} == set(FILES["accuracy"])
    chosen = tomllib.loads((tmp_path / "simulate.toml").read_text())["simulate"]
    assert (chosen["solver"], chosen["tolerance"]) == ("dopri8", 1e-4)
    assert "the cheapest is dopri8 at tolerance 0.0001" in " ".join(printed.split())
    rows = list(csv.DictReader((tmp_path / "accuracy.csv").read_text().splitlines()))
    assert [row["line"] for row in rows] == solvers.split()
    assert max(map(len, printed.splitlines()[:-1])) <= 80  # the last ends in a path
    # The same method by another loop: the same error, but for the contact boundary on which one ends a step.
    for row in rows:
        assert float(row["error_trajectory"]) == pytest.approx(float(rows[0]["error_trajectory"]), rel=0.5)
    # The same run against SciPy's solution of its one equation.
    scene = brake_along_y(*settings, "simulate.solver=dopri8", "simulate.tolerance=1e-4")
    times, states = states_of(scene)
    known = AlongY(scene).motion(6e-6, times)
    off = (np.abs(states - known).max(axis=0) / np.abs(known).max(axis=0)).max()
    assert float(rows[0]["error_trajectory"]) == pytest.approx(off, rel=1e-3)


@pytest.mark.thorough
def test_the_command_writes_its_files_and_says_what_to_set(drumsqueal, tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "SOLVERS", ("dopri8",))
    for name, few in {"TOLERANCES": (1e-2, 1e-4), "NODES": (8,), "GRID": (40,), "WIDTHS": (1e-2,)}.items():
        monkeypatch.setattr(bench, name, few)
    settings = ["--set", "simulate.duration=0.004", "--set", "start.displacement={Y = 6e-6}"]
    out = tmp_path / "out"
    status, printed, error = drumsqueal(
        "accuracy", str(SCENARIOS / "nominal.toml"), "-o", str(out), "--target", "1e-2", *settings
    )
    assert (status, error) == (0, "")
    assert {path.name for path in out.iterdir()} == set(FILES["accuracy"])
    assert "the cheapest is dopri8" in " ".join(printed.split())
    assert tomllib.loads((out / "simulate.toml").read_text())["simulate"]["solver"] == "dopri8"
    assert max(map(len, printed.splitlines()[:-1])) <= 80  # the last ends in a path
    assert "…" not in printed
