"""Sweeps: every point as it would be alone, whatever comes with it; chances that are known; what a kill leaves."""

import json
import math
import re
import signal
import sys
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray
from rich.console import Console
from scipy.optimize import brentq

import drumsqueal as ds
from drumsqueal.dynamics.ensemble import point_of, round_of
from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.files.output_folder import FILES, to_json
from drumsqueal.findings.decay import Rest
from drumsqueal.findings.schema import read_findings
from drumsqueal.progress import silent
from drumsqueal.questions.sweep import file as sweep_file
from drumsqueal.questions.sweep import study
from drumsqueal.questions.sweep.answer import _print_linear, sweep_into
from drumsqueal.questions.sweep.figure import end_of, modes_along
from drumsqueal.questions.sweep.file import RUNNING, SweepFile
from drumsqueal.questions.sweep.found import SweepStudy, chance, rank_correlation, study_chance, summarise
from drumsqueal.questions.sweep.points import (
    AT_REST,
    FOLDED,
    NONE,
    NOT_YET,
    OUTCOME,
    TRENDS,
    blank,
    names_of,
    squealing,
    to_dataset,
)
from drumsqueal.scene import COORDINATES, SceneError, load_scene
from drumsqueal.scene.plan import Plan, grid, sample
from drumsqueal.scene.variation import Variation, read_variation
from drumsqueal.terminal.reply import Reply
from processes import communicate, killed, posix, start

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NOMINAL, UNCERTAIN = str(SCENARIOS / "nominal.toml"), str(SCENARIOS / "uncertain.toml")
TRUCK = Path(__file__).parents[1] / "data" / "truck.toml"
SIX = COORDINATES


@pytest.fixture(scope="module")
def damped() -> ds.Scene:
    return load_scene(SCENARIOS / "damped.toml")


def same(first: xarray.Dataset, second: xarray.Dataset) -> bool:
    """Equal in every bit of every number."""
    return all(first[name].values.tobytes() == second[name].values.tobytes() for name in first.variables)


# --- points ---------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_a_grid_is_what_every_point_is_alone(damped):
    speeds, loads = np.linspace(1, 40, 5), ["0.5 kN", "2 kN", "4 kN"]
    found = ds.sweep_parameters(damped, {"drum.speed": speeds, "contact.normal_load": loads})
    assert found["growth_rate"].dims == ("drum.speed", "contact.normal_load", "mode")
    for speed in speeds:
        for load in (500.0, 2000.0, 4000.0):
            point = found.sel({"drum.speed": speed, "contact.normal_load": load})
            scene = damped.with_values({"drum.speed": float(speed), "contact.normal_load": load})
            alone = ds.analyse_stability(ds.build_model(scene, coordinates=SIX))
            count = len(alone.modes)
            # One program for many and one for one: up to the last bits of the matrix, and what they do to eigenvalues.
            size = np.abs(alone.eigenvalues).max()
            growth, frequency = (
                [getattr(mode, name) for mode in alone.modes] for name in ("growth_rate", "frequency_Hz")
            )
            np.testing.assert_allclose(point["growth_rate"].values[:count], growth, rtol=0, atol=1e-13 * size)
            np.testing.assert_allclose(point["frequency"].values[:count], frequency, rtol=0, atol=1e-13 * size)
            assert np.isnan(point["growth_rate"].values[count:]).all()
            names = [COORDINATES[index] for index in point["mode_coordinate"].values[:count]]
            assert names == [mode.name for mode in alone.modes]
            assert (point["mode_coordinate"].values[count:] == -1).all()
            assert point["unstable"].values[:count].tolist() == [mode.unstable for mode in alone.modes]
            assert point["squeal"].item() == bool(alone.unstable)
            assert point["largest_pressure"].item() == pytest.approx(alone.pressure_range[1], rel=1e-12)
    assert {0, 1} == set(found["squeal"].values.ravel())


@pytest.mark.thorough
def test_a_drum_at_rest_leaves_a_gap_with_a_reason(damped, drumsqueal, tmp_path):
    found = ds.sweep_parameters(damped, {"drum.speed": [5.0, 0.0]})
    assert found["outcome"].values.tolist() == [0, AT_REST]
    assert np.isnan(found["largest_growth_rate"].values).tolist() == [False, True]
    assert found["squeal"].values.tolist() == [1, -1]
    flags = found["outcome"].attrs
    assert len(flags["flag_meanings"].split()) == len(flags["flag_values"])
    arguments = ("sweep", str(SCENARIOS / "damped.toml"), "-o", str(tmp_path), "--vary", "drum.speed=0..5x2")
    assert "1 of 2 points: no steady sliding: the drum is at rest" in drumsqueal(*arguments)[1]


@pytest.mark.thorough
def test_scenes_of_several_kinds_go_together(damped):
    # Arcs beyond 130° have more nodes, and so a program of their own.
    found = ds.sweep_parameters(damped, {"shoe.arc_angle": ["130 deg", "140 deg"], "drum.speed": [5.0, 6.0]})
    for k, angle in enumerate(("130 deg", "140 deg")):
        scene = damped.with_values({"shoe.arc_angle": angle})
        alone = ds.analyse_stability(ds.build_model(scene, coordinates=SIX))
        growth = found["growth_rate"].values[k, 0, : len(alone.modes)]
        np.testing.assert_allclose(growth, [mode.growth_rate for mode in alone.modes], rtol=1e-9)


@pytest.mark.thorough
def test_a_mode_is_one_in_all_samples_whatever_it_is_called(tmp_path, drumsqueal):
    """By an independent model both modes grow in every sample, 1850 Hz as X in some and as Y in others."""
    printed = drumsqueal("sweep", str(TRUCK), "--set", "shoe=leading", "--random", "60", "-o", str(tmp_path))[1]
    assert re.search(r"Y \(2\) +100\.00 %", printed)
    found = json.loads((tmp_path / "sweep.json").read_text())["chance"]["modes"]
    assert {name: each["count"] for name, each in found.items()}["Y"] == 60
    with xarray.open_dataset(tmp_path / "sweep.nc", engine="h5netcdf") as sweep:
        second = np.isin(sweep["mode_number"].values, 3)  # by rising frequency: Tx, Y, Ty and this one
        assert second.sum() == 60
        assert len(np.unique(sweep["mode_coordinate"].values[second])) == 2
        assert np.ptp(sweep["frequency"].values[second]) < 500  # Hz; the next modes are 700 and 1800 Hz away


@pytest.mark.parametrize(("random", "passed"), [("leading", "trailing"), ("trailing", "leading")])
def test_a_shoe_of_which_nothing_is_uncertain_is_passed_over(random, passed, drumsqueal, monkeypatch, tmp_path):
    taken = []
    monkeypatch.setattr(study, "check_plan", lambda plan: taken.append(plan.keys))
    monkeypatch.setattr("drumsqueal.questions.sweep.answer.sweep_into", lambda *_, **__: None)
    k = ("leading", "trailing").index(random)
    own = f'uncertain={{"shoe.{k}.thickness" = {{distribution="normal", mean=0.04, deviation="2 %"}}}}'
    status, printed, _ = drumsqueal("sweep", str(TRUCK), "--set", own, "--random", "8", "-o", str(tmp_path))
    assert (status, taken) == (0, [("shoe.thickness",)])
    assert "Passed over: --random 8: no number here is uncertain" in " ".join(printed.split())
    assert f"{passed} shoe" in printed


def made_of(numbers: list[list[int]], coordinates: list[list[int]]) -> xarray.Dataset:
    """A sweep of nothing but these numbers and coordinates of modes; all of them grow, one more in each sample."""
    columns = {"mode_number": numbers, "mode_coordinate": coordinates, "unstable": coordinates}
    data: dict[str, Any] = {name: (("sample", "mode"), np.array(each)) for name, each in columns.items()}
    data["squeal"] = ("sample", np.ones(len(numbers), int))
    data["largest_growth_rate"] = ("sample", np.arange(len(numbers), dtype=float))
    made = xarray.Dataset(data)
    made["mode_coordinate"].attrs["flag_meanings"] = " ".join(("none", *SIX))
    return made


@pytest.mark.parametrize(
    ("numbers", "coordinates", "share"),
    [
        # One mode, X in one sample and Y in two, beside Y itself: it has the name that it mostly has.
        ([[1, 2]] * 3, [[1, 0], [1, 1], [1, 1]], {"Y": 1.0, "Y (2)": 1.0}),
        ([[1, 2]] * 3, [[1, 0], [1, 0], [1, 1]], {"X": 1.0, "Y": 1.0}),
        # What continues no mode of the scene goes by its coordinate.
        ([[1, -1], [1, -1], [1, -1]], [[1, 5], [1, 5], [1, -1]], {"Y": 1.0, "Tz": 2 / 3}),
        ([[-1, -1]] * 2, [[1, 0], [1, 1]], {"X": 0.5, "Y": 1.0}),
    ],
)
def test_the_probability_of_a_mode_does_not_go_by_its_names(numbers, coordinates, share):
    sweep = made_of(numbers, coordinates)
    sweep["unstable"].values[:] = sweep["mode_coordinate"].values >= 0
    found = study_chance(sweep)
    assert found is not None
    assert {name: each.share for name, each in found.modes.items()} == pytest.approx(share)


def test_modes_whose_shapes_are_no_longer_known_are_joined_along_straight_lines():
    # One line rises from 100 Hz to 190 Hz and crosses one that falls. Nothing slides at the seventh of ten points. Each
    # has its own order, and only the rising line continues a mode of the scene, at its two ends.
    rising, falling = np.linspace(100.0, 190.0, 10), np.linspace(163.0, 73.0, 10)
    lines, rates = np.stack([rising, falling], axis=1), np.tile([1.0, -2.0], (10, 1))
    lines[6], rates[6] = np.nan, np.nan
    order = np.argsort(lines, axis=1)
    there, ends = np.isfinite(lines), np.isin(np.arange(10), [0, 9])[:, None]
    columns = {
        "frequency": np.take_along_axis(lines, order, axis=1), "growth_rate": np.take_along_axis(rates, order, axis=1),
        "mode_number": np.where((order == 0) & ends, 0, NONE),
        "mode_coordinate": np.where(there, 1, NONE), "mode_in_plane": np.where(there, 1, NONE),
    }  # fmt: skip
    sweep = xarray.Dataset({name: (("drum.speed", "mode"), each) for name, each in columns.items()})
    sweep["mode_coordinate"].attrs["flag_meanings"] = " ".join(("none", *SIX))
    found = sorted((mode for _, mode in modes_along(sweep)), key=lambda mode: (np.nanmean(mode.real), end_of(mode)))
    # Beyond the gap nothing says which of the two the falling line is.
    for mode, points, column in zip(found, (slice(0, 6), slice(7, 10), slice(None)), (1, 1, 0), strict=True):
        wanted = np.full((2, 10), np.nan)
        wanted[:, points] = rates[points, column], 2 * np.pi * lines[points, column]
        np.testing.assert_allclose([mode.real, mode.imag], wanted, rtol=1e-15)


def test_draws_hang_on_the_seed_and_their_number_alone(nominal):
    ranges = [
        read_variation("drum.speed=1..40", nominal, points=None),
        read_variation("friction.static=0.4..0.6", nominal, points=None),
    ]
    whole = sample(nominal, ranges, 1000, seed=3).values(0, 1000)
    assert np.array_equal(sample(nominal, ranges, 100, seed=3).values(17, 100), whole[17:100])
    assert not np.array_equal(sample(nominal, ranges, 1000, seed=4).values(0, 1000), whole)
    assert (whole.min(axis=0) > [1, 0.4]).all()
    assert (whole.max(axis=0) < [40, 0.6]).all()
    # Independent and uniform: means and correlation within four standard errors.
    fractions = (whole - [1, 0.4]) / [39, 0.2]
    np.testing.assert_allclose(fractions.mean(axis=0), 0.5, atol=4 / np.sqrt(12 * 1000))
    assert abs(np.asarray(np.corrcoef(fractions.T))[0, 1]) < 4 / np.sqrt(1000)


@pytest.mark.thorough
def test_what_is_computed_hangs_neither_on_the_batch_nor_on_threads(damped):
    short = damped.with_values({"simulate.duration": 0.02})
    speed = read_variation("drum.speed=1..10", short, points=None)
    plan = sample(short, [speed], 20, transient=True)
    whole = study.compute(plan, 0, 20, threads=2)
    part = study.compute(plan, 3, 14, threads=1)
    for name, values in part.items():
        assert values.tobytes() == whole[name][3:14].tobytes(), name
    assert (whole[OUTCOME] == 0).all()
    assert (whole["main_frequency"] > 0).all()


@pytest.mark.thorough
def test_the_transients_of_a_sweep_are_those_of_a_run(damped):
    scene = damped.with_values({"simulate.duration": 0.1, "contact.normal_load": 4000.0})
    found = ds.sweep_parameters(scene, {"drum.speed": [3.0]}, transient=True).isel({"drum.speed": 0})
    run = ds.run(scene.with_values({"drum.speed": 3.0}))
    assert run.findings.saturation is not None
    main = run.findings.saturation.main
    assert main is not None
    late = run.history["displacement"].values[len(run.history["time"]) // 2 :]
    # The methods are the same, the local tolerance 1e-6; at saturation neighbours do not come apart here.
    np.testing.assert_allclose(found["amplitude"].values, np.ptp(late, axis=0) / 2, rtol=1e-3)
    assert found["main_frequency"].item() == pytest.approx(main.frequency_Hz, rel=0.01)


def test_points_without_a_transient_say_why(damped):
    slow = damped.with_values({"simulate.duration": 0.01, "simulate.sample_rate": 10_000.0})
    found = ds.sweep_parameters(slow, {"drum.speed": [3.0]}, transient=True)
    assert found["outcome"].item() == FOLDED
    assert np.isnan(found["amplitude"].values).all()
    assert found["largest_growth_rate"].item() > 0  # the linear part is there


# --- chance ---------------------------------------------------------------------------------------------------------


def test_the_chance_of_squeal_is_the_known_one(damped):
    # Squeal below a critical speed, found as a root; uniform draws fall below it with a chance that is a ratio.
    def growth(speed: float) -> float:
        stability = ds.analyse_stability(ds.build_model(damped, {"drum.speed": speed}, coordinates=SIX))
        return max(mode.growth_rate for mode in stability.modes)

    critical = brentq(growth, 5.0, 15.0, xtol=1e-10)
    assert isinstance(critical, float)
    low, high = 5.0, 15.0
    known = (critical - low) / (high - low)
    # Of 20 seeds one is expected to miss by more than the interval; this one does not.
    found = ds.sweep_parameters(damped, {"drum.speed": [low, high]}, random=1000, seed=2)
    assert np.array_equal(found["squeal"].values == 1, found["drum.speed"].values < critical)
    chances = study_chance(found)
    assert chances is not None
    assert chances.squeal.low < known < chances.squeal.high
    assert chances.squeal.high - chances.squeal.low < 0.07
    assert chances.modes["Y"] == chances.squeal
    # The growth rate only falls with the speed.
    assert chances.correlations == {"drum.speed": pytest.approx(-1.0)}


def test_wilsons_interval():
    # Its ends are the chances at which the share found lies 1.96 standard errors off: (p − q)² = z² q(1 − q)/n.
    z = 1.959963984540054
    for count, total in ((0, 10), (3, 10), (887, 1000), (10, 10)):
        found, p = chance(count, total), count / total
        roots = np.roots([1 + z * z / total, -2 * p - z * z / total, p * p])
        assert sorted(roots.real) == pytest.approx([found.low, found.high], abs=1e-9)


def test_wilsons_interval_holds_the_chance_as_often_as_it_says(damped):
    plan = sample(damped, [read_variation("drum.speed=0..1", damped, points=None)], 200_000, seed=1)
    hits = plan.values(0, 200_000).reshape(1000, 200) < 0.3
    inside = [each.low <= 0.3 <= each.high for each in (chance(int(count), 200) for count in hits.sum(axis=1))]
    # 950 of 1000 are expected, with a standard deviation of 7; discreteness takes Wilson's some 1 % off that.
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)


def test_rank_correlation():
    x = np.linspace(1, 2, 20)
    assert rank_correlation(x, np.exp(x)) == pytest.approx(1)
    assert rank_correlation(x, -(x**3)) == pytest.approx(-1)
    assert rank_correlation(x, np.ones(20)) is None
    assert rank_correlation(x[:3], x[:3]) is None


# --- files ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def small(monkeypatch) -> None:
    monkeypatch.setattr(study, "BATCH", 8)


def plan_of(scene: ds.Scene, *ranges: str) -> Plan:
    return grid(scene, [read_variation(text, scene) for text in ranges])


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("drum.speed=5..20x2", [7, 7]),  # the scene turns at 5 rad/s
        ("shoe.elastic.young=1e11..2e11x2", [7, 7]),  # which only scales the free modes
        # Free modes change their order on the way: those of 20 mm are numbered as the scene's own, and no others.
        ("shoe.thickness=0.01..0.02x2", [NONE, 7]),
        ("shoe.arc_angle=100deg..110degx2", [NONE, NONE]),
    ],
)
def test_modes_are_those_of_the_scene_as_long_as_its_free_modes_keep_their_shapes(nominal, monkeypatch, text, numbers):
    table = {"young": "200 GPa", "poisson": 0.3, "up_to": "3 kHz"}
    scene = nominal.with_values({"shoe.elastic": table})
    monkeypatch.setattr(study, "continued", lambda model_at, own, there: [7])
    plan = grid(scene, [read_variation(text, scene)])
    there: Any = SimpleNamespace(modes=["one"], coordinates=("X",))
    assert [study._numbers(plan, point, there, there) for point in range(2)] == [[number] for number in numbers]


@pytest.mark.parametrize("thickness", ["0.01..0.08", "0.08..0.01"])
@pytest.mark.parametrize("radius", ["0.05..0.15", "0.15..0.05"])
def test_numbers_that_fail_together_are_named_alone_in_few_tries(damped, monkeypatch, thickness, radius):
    others = ["shoe.width=0.01..0.02", "shoe.arc_angle=1..2", "shoe.density=1000..2000", "damping.ratio=0.01..0.02"]
    others, tries, own = [f"{each}x2" for each in others], [], ds.Scene.with_values
    monkeypatch.setattr(ds.Scene, "with_values", lambda scene, values: tries.append(values) or own(scene, values))
    ranges = [*others[:2], f"shoe.outer_radius={radius}x2", f"shoe.thickness={thickness}x2", *others[2:]]
    told = "the sweep comes to shoe.outer_radius = 0.05 m, shoe.thickness = 0.08 m: "
    with pytest.raises(RequestError, match=re.escape(told)):
        plan_of(damped, *ranges)
    variations = [read_variation(text, damped) for text in (*others, "shoe.thickness=0.01..0.04x2", ranges[2])]
    tries.clear()
    grid(damped, variations)
    shoe = [each for each in tries if "shoe.width" in each]
    assert len(shoe) == 5 + 2  # of 32 corners


def stopped_after(batches: int, error: BaseException) -> Callable:
    def source(plan, left, _):
        for k, (first, stop) in enumerate(left):
            if k == batches:
                raise error
            yield first, study.compute(plan, first, stop)

    return source


def into(folder: Path) -> Reply:
    reply = Reply(True, None, overwrite=False)
    reply.folder = folder
    return reply


@pytest.mark.usefixtures("small")
def test_a_sweep_that_was_cut_off_goes_on_and_leaves_the_same_file(drumsqueal, damped, tmp_path):
    vary = ("--vary", "drum.speed=1..40x7", "--vary", "contact.normal_load=500..4000x4")
    arguments = (str(SCENARIOS / "damped.toml"), *vary)
    plan = plan_of(damped, "drum.speed=1..40x7", "contact.normal_load=500..4000x4")
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    assert drumsqueal("sweep", *arguments, "-o", str(whole))[0] == 0
    cut.mkdir()
    with pytest.raises(IntegrationError, match=r"interrupted by the user; 16 of 28 points .* --resume continues"):
        sweep_into(into(cut), plan, stopped_after(2, KeyboardInterrupt()))
    with xarray.open_dataset(cut / "sweep.nc", engine="h5netcdf") as there:
        assert there.attrs["outcome"] == "interrupted by the user; 16 of 28 points were computed"
        missing = there["outcome"].values.ravel() == NOT_YET
        assert missing.tolist() == [False] * 16 + [True] * 12
        assert (np.isnan(there["largest_growth_rate"].values.ravel()) == missing).all()
    # Another sweep, and another scene, do not go on with it.
    status, _, errors = drumsqueal(
        "sweep", *arguments[:-1], "contact.normal_load=500..4000x5", "-o", str(cut), "--resume"
    )
    assert status == 2
    assert "vary was" in errors
    status, _, errors = drumsqueal("sweep", *arguments, "--set", "friction.static=0.6", "-o", str(cut), "--resume")
    assert (status, errors.count("\n")) == (2, 1)
    assert "friction.static was 0.5 in the run and is 0.6 here" in errors
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("drumsqueal.questions.sweep.file.versions", lambda: {"jax": "0.1"})
        status, _, errors = drumsqueal("sweep", *arguments, "-o", str(cut), "--resume")
    assert (status, errors.count("\n"), "go back to those" in errors) == (2, 1, True)
    status, printed, errors = drumsqueal("sweep", *arguments, "-o", str(cut), "--resume")
    assert (status, errors) == (0, "")
    assert "Squeal at" in printed
    # It grows most where the drum is slowest and the load largest.
    told = json.loads((cut / "sweep.json").read_text())["modes"]["Y"]["where"]
    assert told == {"drum.speed": 1.0, "contact.normal_load": 4000.0}
    for name in ("sweep.nc", "sweep.json"):
        assert (cut / name).read_bytes() == (whole / name).read_bytes()
    status, _, errors = drumsqueal("sweep", *arguments, "-o", str(cut), "--resume")
    assert (status, "the sweep is complete, there is nothing to resume" in errors) == (2, True)
    status, _, errors = drumsqueal("sweep", *arguments, "--set", "friction.static=0.6", "-o", str(cut), "--resume")
    assert (status, "friction.static" in errors, "complete" in errors) == (2, True, False)
    status, _, errors = drumsqueal(
        "sweep", *arguments[:-1], "contact.normal_load=500..4000x5", "-o", str(cut), "--resume"
    )
    assert (status, "resume with the same sweep" in errors, "complete" in errors) == (2, True, False)
    # From Python it is the same.
    with xarray.open_dataset(whole / "sweep.nc", engine="h5netcdf") as file:
        found = ds.sweep_parameters(
            damped,
            {"drum.speed": np.array(plan.variations[0].values), "contact.normal_load": plan.variations[1].values},
        )
        assert same(found.drop_attrs(), file.load().drop_attrs())


@pytest.mark.usefixtures("small")
def test_killed_between_results_and_their_marks_nothing_is_lost(damped, tmp_path, monkeypatch):
    plan = plan_of(damped, "drum.speed=1..40x20")
    file = SweepFile(tmp_path / "sweep.nc", plan)
    file.create(silent)
    results = study.compute(plan, 8, 16)
    fill, calls = sweep_file.fill, []

    def killed(*arguments):
        calls.append(arguments)
        if len(calls) == 2:
            raise KeyboardInterrupt
        fill(*arguments)

    monkeypatch.setattr(sweep_file, "fill", killed)
    with pytest.raises(KeyboardInterrupt):
        file.write(8, results)
    assert not file.computed().any()
    monkeypatch.setattr(sweep_file, "fill", fill)
    file.write(8, results)
    assert file.computed().tolist() == [False] * 8 + [True] * 8 + [False] * 4
    with xarray.open_dataset(file.path, engine="h5netcdf") as there:
        assert there.attrs["outcome"] == RUNNING
        assert np.array_equal(there["largest_growth_rate"].values[8:16], results["largest_growth_rate"])


@pytest.mark.usefixtures("small")
def test_a_failure_keeps_what_was_computed(damped, tmp_path):
    plan = plan_of(damped, "drum.speed=1..40x20")
    failing = stopped_after(1, IntegrationError("the scheduler of the cluster was lost"))
    with pytest.raises(IntegrationError, match=r"the scheduler .* was lost; 8 of 20 points were computed"):
        sweep_into(into(tmp_path), plan, failing)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.nc"]
    with xarray.open_dataset(tmp_path / "sweep.nc", engine="h5netcdf") as there:
        assert there.attrs["outcome"].startswith("failed: the scheduler of the cluster was lost; 8 of 20")


@pytest.mark.thorough(but=["KeyboardInterrupt"])
@pytest.mark.parametrize("stopped", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_a_sweep_without_its_figures_is_not_complete(drumsqueal, tmp_path, monkeypatch, stopped):
    arguments = ("sweep", str(SCENARIOS / "damped.toml"), "--vary", "drum.speed=1..40x4", "-o", str(tmp_path))

    def fail(*_):
        raise stopped

    with monkeypatch.context() as patch:
        patch.setattr("drumsqueal.terminal.style.save_figure", fail)
        status, printed, errors = drumsqueal(*arguments)
    assert (status, printed, errors.count("\n")) == (1, "", 1)
    assert "4 of 4 points were computed" in errors
    status, _, errors = drumsqueal(*arguments, "--resume")
    assert (status, errors) == (0, "")
    assert {path.name for path in tmp_path.iterdir()} == {"sweep.nc", "sweep.json", "stability.png"}
    assert "nothing to resume" in drumsqueal(*arguments, "--resume")[2]


@posix
@pytest.mark.slow
def test_killed_at_any_moment_the_file_is_readable_and_the_sweep_goes_on(drumsqueal, cache, tmp_path):
    arguments = ("sweep", UNCERTAIN, "--random", "6000")
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    assert drumsqueal(*arguments, "-o", str(whole))[0] == 0
    for seconds, resume in ((1e-3, ()), (0.3, ("--resume",))):
        # Of 24 batches no start computes more than eight.
        ends = killed("drumsqueal.questions.sweep.file:SweepFile", "write", seconds=seconds, most=8)
        process = start(cache, *arguments, "-o", str(cut), *resume, code=ends)
        communicate(process)
        assert process.returncode == -signal.SIGPROF
        assert 0 < computed(cut) < 6000
    status, _, errors = drumsqueal(*arguments, "-o", str(cut), "--resume")
    assert (status, errors) == (0, "")
    assert (cut / "sweep.nc").read_bytes() == (whole / "sweep.nc").read_bytes()


def computed(folder: Path) -> int:
    with xarray.open_dataset(folder / "sweep.nc", engine="h5netcdf") as there:
        return int((there["outcome"].values != NOT_YET).sum())


# --- the command ----------------------------------------------------------------------------------------------------


def test_a_random_sweep_tells_the_chance(drumsqueal, tmp_path):
    status, printed, errors = drumsqueal("sweep", UNCERTAIN, "--random", "64", "--seed", "5", "-o", str(tmp_path))
    assert (status, errors) == (0, "")
    assert "Probability of squeal by eigenvalues, 64 samples" in printed
    assert "Rank correlation" in printed
    assert {path.name for path in tmp_path.iterdir()} == {"sweep.nc", "sweep.json", "chance.png"}
    summary = json.loads((tmp_path / "sweep.json").read_text())
    assert summary["chance"]["squeal"]["total"] == 64
    assert summary["sweep"]["seed"] == 5
    assert to_json(read_findings(tmp_path / "sweep.json", SweepStudy)) == (tmp_path / "sweep.json").read_text()
    with xarray.open_dataset(tmp_path / "sweep.nc", engine="h5netcdf") as found:
        assert found.sizes == {"sample": 64, "mode": 6}
        assert "drum.speed" in found.coords
        assert all(found[name].attrs.get("units") for name in found.data_vars)
        assert int(found["squeal"].sum()) == summary["chance"]["squeal"]["count"]
    assert drumsqueal("sweep", UNCERTAIN, "--random", "64", "-o", str(tmp_path))[0] == 2


@pytest.mark.thorough
@pytest.mark.parametrize(
    "vary", [("drum.speed=2..20x4",), ("drum.speed=2..20x3", "contact.normal_load=1..4e3x3", "damping.ratio=0..0.01x2")]
)
def test_figures_of_a_sweep_with_transients(drumsqueal, tmp_path, vary):
    options = [word for text in vary for word in ("--vary", text)]
    arguments = (str(SCENARIOS / "damped.toml"), *options, "--transient", "--set", "simulate.duration=0.01")
    status, printed, errors = drumsqueal("sweep", *arguments, "-o", str(tmp_path))
    assert (status, errors) == (0, "")
    assert "Transients at their end" in printed
    assert to_json(read_findings(tmp_path / "sweep.json", SweepStudy)) == (tmp_path / "sweep.json").read_text()
    assert {path.name for path in tmp_path.iterdir()} == {*FILES["sweep"]} - {"chance.png", "basin.png"}


REFUSED = [
    ((), "there is nothing to sweep"),
    (("--vary", "drum.sped=1..4"), "did you mean drum.speed?"),
    (("--vary", "drum.speed=1..4", "--vary", "drum.speed=2..3"), "drum.speed: this is varied twice"),
    (("--random", "10"), "no number here is uncertain"),
    (("--random", "0", "--vary", "drum.speed=1..4"), "write a number of samples"),
    (("--seed", "1", "--vary", "drum.speed=1..4"), "is the seed of --random"),
    (("--random", "10", "--vary", "drum.speed=1..4x5"), "leave out x5"),
    (("--vary", "shoe.thickness=0.01..0.08", "--vary", "shoe.outer_radius=0.05..0.1"), "the thickness must be smaller"),
    (("--vary", "drum.speed=1..4", "--cluster", "here"), "write local, or the address of a scheduler"),
    (("--vary", "drum.speed=1..4", "--resume"), "there is no sweep to resume"),
    (("--vary", "drum.speed=1..4", "--transient", "--set", "start={}"), "nothing moves in the transients"),
    (
        tuple(f"--vary={key}=1..2x10000" for key in ("drum.speed", "contact.normal_load", "friction.static")),
        "1e+12 points would need a file of about 160 TB and about 11.4 years of computing; take at most 1e7 points",
    ),
]


@pytest.mark.parametrize(("arguments", "told"), REFUSED)
def test_a_wrong_request_writes_nothing(drumsqueal, tmp_path, arguments, told):
    status, printed, errors = drumsqueal("sweep", NOMINAL, "-o", str(tmp_path / "out"), *arguments)
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert told in errors
    assert not (tmp_path / "out").exists()


def test_python_refuses_in_words(nominal):
    with pytest.raises(SceneError, match=r"did you mean drum\.speed"):
        ds.sweep_parameters(nominal, {"drum.sped": [1]})
    with pytest.raises(SceneError, match=r"contact.normal_load = -1"):
        ds.sweep_parameters(nominal, {"contact.normal_load": [1, -1]})
    with pytest.raises(RequestError, match="nothing to sweep"):
        ds.sweep_parameters(nominal)


# --- cluster --------------------------------------------------------------------------------------------------------


def test_without_the_extra_one_line_says_what_to_install(drumsqueal, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    arguments = ("sweep", NOMINAL, "--vary", "drum.speed=1..4", "--cluster", "local")
    status, _, errors = drumsqueal(*arguments, "-o", str(tmp_path / "out"))
    assert (status, errors.count("\n")) == (2, 1)
    assert 'pip install "drumsqueal[cluster]"' in errors
    assert not (tmp_path / "out").exists()


@pytest.mark.thorough
def test_transients_run_on_until_they_settle_and_those_that_have_not_are_marked(damped, monkeypatch):
    # Y grows by 44 1/s, from a seventieth of the edges: after 0.05 s it is nine times its start, below them.
    scene = damped.with_values({"simulate.duration": 0.05})
    found = ds.sweep_parameters(scene, {"drum.speed": [4.0]}, transient=True).isel({"drum.speed": 0})
    run = ds.run(scene.with_values({"drum.speed": 4.0, "simulate.duration": 0.4})).history["displacement"].values
    assert found["settled"].item() == 1
    assert 0.05 < found["simulated"].item() <= 16 * 0.05
    # The cycle that it settles to; a tenth of the linear rate leaves 4 1/s, a fifth in 0.05 s at the most.
    np.testing.assert_allclose(found["amplitude"].values[1], np.ptp(run[-1000:, 1]) / 2, rtol=0.2)
    monkeypatch.setattr(study, "MOST_ROUNDS", 1)
    cut = ds.sweep_parameters(scene, {"drum.speed": [4.0]}, transient=True).isel({"drum.speed": 0})
    assert (cut["settled"].item(), cut["simulated"].item()) == (0, 0.05)
    assert cut["amplitude"].values[1] < 0.5 * found["amplitude"].values[1]


def test_a_sweep_in_rpm_has_its_results_in_rpm(drumsqueal, tmp_path):
    scene, vary = str(SCENARIOS / "damped.toml"), ("--vary", "drum.speed=20..80 rpm x 4")
    status, printed, errors = drumsqueal("sweep", scene, *vary, "-o", str(tmp_path))
    assert (status, errors) == (0, "")
    assert "drum.speed 20 rpm" in printed
    with xarray.open_dataset(tmp_path / "sweep.nc", engine="h5netcdf") as found:
        assert found["drum.speed"].values.tolist() == [20.0, 40.0, 60.0, 80.0]
        assert found["drum.speed"].attrs["units"] == "rpm"
        in_si = ds.sweep_parameters(load_scene(scene), {"drum.speed": [20 * np.pi / 30]})
        assert found["largest_growth_rate"].values[0] == pytest.approx(in_si["largest_growth_rate"].item(), rel=1e-12)
    summary = json.loads((tmp_path / "sweep.json").read_text())
    assert summary["sweep"]["vary"] == {"drum.speed": pytest.approx([20 * np.pi / 30, 80 * np.pi / 30, 4], rel=1e-15)}
    assert (summary["units"], summary["modes"]["Y"]["where"]) == ({"drum.speed": "rpm"}, {"drum.speed": 20.0})


@pytest.mark.usefixtures("small")
@pytest.mark.thorough(but=["how0"])
@pytest.mark.parametrize("how", [(), ("--random", "20")])
def test_a_sweep_in_rpm_goes_on_in_another_unit_and_keeps_its_own(drumsqueal, tmp_path, monkeypatch, how):
    command = ("sweep", str(SCENARIOS / "damped.toml"), *how, "-o", str(tmp_path), "--vary")
    counted = "" if how else " x 20"
    with monkeypatch.context() as patch:
        patch.setattr("drumsqueal.terminal.style.save_figure", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        assert drumsqueal(*command, f"drum.speed=60..130 rpm{counted}")[0] == 1
    # 60 rpm are 360 deg/s, 130 rpm 780 deg/s.
    assert drumsqueal(*command, f"drum.speed=360..781 deg/s{counted}", "--resume")[0] == 2
    status, printed, errors = drumsqueal(*command, f"drum.speed=360..780 deg/s{counted}", "--resume")
    assert (status, errors) == (0, "")
    summary = json.loads((tmp_path / "sweep.json").read_text())
    assert summary["units"] == {"drum.speed": "rpm"}
    with xarray.open_dataset(tmp_path / "sweep.nc", engine="h5netcdf") as found:
        assert 60 <= found["drum.speed"].values.min() < found["drum.speed"].values.max() <= 130
        assert found["drum.speed"].attrs["units"] == "rpm"
    if how:
        drawn = summary["sweep"]["distributions"]["drum.speed"]
        assert (drawn["unit"], drawn["high"]) == ("rad/s", pytest.approx(130 * np.pi / 30, rel=1e-12))
    else:
        assert " rpm" in printed


@pytest.mark.parametrize(
    ("modes", "rate", "said"),
    [
        ({}, 0.0, "stable"),
        ({}, 2.5, "unstable: divergence without oscillation at +2.5 1/s"),
        ({"Y": 950.0}, 2.5, "unstable: Y (950 Hz), divergence without oscillation at +2.5 1/s"),
    ],
)
def test_a_basin_says_what_the_eigenvalues_do(modes, rate, said):
    found: Any = SimpleNamespace(
        modes={name: SimpleNamespace(frequency_there_Hz=f) for name, f in modes.items()},
        data={"divergence_rate": xarray.DataArray([rate])},
    )
    console = Console(width=200, record=True, file=StringIO())
    _print_linear(console, found)
    assert console.export_text() == f"By the eigenvalues steady sliding is {said}\n"


AWAY, ELSEWHERE = (Rest(near=False, elsewhere=place) for place in (None, np.ones(1)))


@pytest.mark.parametrize(
    ("rates", "divergence", "changed", "earlier", "wanted"),
    [
        # Where all decay, at 20 1/s the slowest: rest, a steady motion, and one that falls half as fast as that.
        ((-20.0, -300.0), None, {"at_rest": True, "trend": "at rest", "rate": 50.0}, math.inf, True),
        ((-20.0, -300.0), None, {"outcome": "failed: ...", "trend": "failed"}, math.inf, True),
        ((-20.0, -300.0), None, {}, math.inf, True),
        ((-20.0, -300.0), None, {"trend": "decays", "rate": -11.0}, math.inf, True),
        ((-20.0, -300.0), None, {"trend": "decays", "rate": -9.0}, math.inf, False),
        ((-20.0, -300.0), None, {"trend": "decays", "rate": -11.0, "ratios": (0.95, 0.2)}, math.inf, False),
        # Where nothing oscillates, at least half as fast as the slower of −4 and −1000 1/s.
        ((), None, {"trend": "decays", "rate": -1.9}, math.inf, False),
        ((), None, {"trend": "decays", "rate": -2.1}, math.inf, True),
        # What is not near steady sliding does not decay to it; what has come to rest elsewhere, where it stays, has.
        ((-20.0, -300.0), None, {"trend": "decays", "rate": -11.0, "rest": Rest(near=False)}, math.inf, False),
        ((-20.0, -300.0), None, {"at_rest": True, "rest": AWAY}, math.inf, False),
        ((-20.0,), 40.0, {"trend": "rests elsewhere", "rest": ELSEWHERE}, math.inf, True),
        # Where something grows at 40 1/s: beyond a boundary, and slower than a tenth of that, by one or the other rate.
        ((-20.0, 40.0), None, {"ratios": (0.2, 1.5), "rate": 3.9}, math.inf, True),
        ((-20.0, 40.0), None, {"ratios": (0.2, 1.5), "rate": 4.1}, math.inf, False),
        ((-20.0, 40.0), None, {"ratios": (1.5, 0.2), "rate": 5.0}, -3.9, True),
        ((-20.0, 40.0), None, {"ratios": (0.5, 0.8), "rate": 0.0}, math.inf, False),
        ((-20.0, 40.0), None, {"ratios": (0.2, 1.5), "rate": 3.9, "trend": "grows"}, math.inf, False),
        ((-20.0,), 40.0, {"ratios": (0.2, 1.5), "rate": 3.9}, math.inf, True),
        ((-20.0,), 30.0, {"ratios": (0.2, 1.5), "rate": 3.9}, math.inf, False),
    ],
)
def test_when_a_transient_has_settled(rates, divergence, changed, earlier, wanted):
    ratios = changed.pop("ratios", (0.5, 0.5))
    rest = Rest(near=True)
    motion: Any = SimpleNamespace(at_rest=False, trend="settled", rate=0.0, boundary_ratios=ratios, rest=rest)
    vars(motion).update({"failed": "outcome" in changed} | changed)
    modes = [SimpleNamespace(growth_rate=rate, label="Y", frequency_Hz=1e3) for rate in rates]
    stability: Any = SimpleNamespace(
        modes=modes, unstable=[m for m in modes if m.growth_rate > 0], divergence=divergence,
        eigenvalues=np.array([-4.0, -1e3]),
    )  # fmt: skip
    assert study.has_settled(motion, stability, earlier) == wanted


def test_a_round_lasts_until_the_slowest_mode_has_decayed_but_no_longer_than_a_hundred_periods():
    def seconds(*modes) -> float:
        found = [
            SimpleNamespace(name=name, growth_rate=rate, frequency_Hz=f, damping_ratio=-rate / (2 * math.pi * f))
            for name, rate, f in modes
        ]
        stability: Any = SimpleNamespace(
            modes=found,
            vibrations=found,
            steady_state=np.zeros(2),
            eigenvalues=np.array([-5 + 1e3j, -7j] if modes else [0.0, 4.0, -8.0, -1e-9]),
            matrix=np.eye(4),
        )
        point = point_of(3, stability)
        assert (point.value, point.largest) == (3.0, pytest.approx(abs(-5 + 1e3j) if modes else 8.0))
        return round_of(stability, ("X", "Y"))

    # Three time constants of 20 1/s, 0.15 s; twenty periods of 100 Hz, 0.2 s; a hundred of them, 1 s, at the longest.
    assert seconds(("X", -20.0, 1000.0), ("Y", -40.0, 400.0), ("Z", -1e-3, 10.0)) == pytest.approx(0.15)
    assert seconds(("X", -40.0, 100.0), ("Y", 90.0, 400.0)) == pytest.approx(0.2)
    assert seconds(("X", -1.0, 100.0)) == pytest.approx(1.0)
    # Where nothing oscillates, a hundred times 2π over the slowest rate, 4 1/s; 1e-9 1/s are round-off.
    assert seconds() == pytest.approx(100 * 2 * math.pi / 4)


def test_squeal_of_a_stable_point_reaches_either_boundary(damped):
    # Where all modes decay, what has settled below both contact boundaries only decays slowly.
    plan = plan_of(damped, "drum.speed=1..5x5")._replace(transient=True)
    columns = blank(plan, 5)
    columns["outcome"][:] = 0
    columns["settled"][:] = 1
    columns["trend"][:] = TRENDS.index("settled")
    columns["squeal"][:] = [0, 0, 0, 0, 1]
    columns["separation_ratio"][:] = [1.5, 0.2, 0.5, 1.5, 0.2]
    columns["reversal_ratio"][:] = [0.2, 1.5, 0.2, 1.5, 0.2]
    data = to_dataset(plan, columns, "")
    assert squealing(data).tolist() == [True, True, False, True, True]


def test_a_mode_is_counted_once_a_point_and_named_where_it_grows_most(damped):
    plan = plan_of(damped, "drum.speed=1..4x4")
    columns = blank(plan, 4)
    names = names_of(plan)
    y, tz = names.index("Y"), names.index("Tz")
    columns["outcome"][:] = 0
    columns["squeal"][:] = [1, 1, 1, 0]
    columns["divergence_rate"][:] = [np.nan, 2.0, -1.0, np.nan]
    which, growth, unstable = (columns[name] for name in ("mode_coordinate", "growth_rate", "unstable"))
    # Two modes are named Y at the first point; that of Tz decays at the second, and grows most at the third.
    for point, modes in enumerate([[(y, 5.0), (y, 9.0)], [(y, 7.0), (tz, -3.0)], [(tz, 80.0)], [(y, -1.0)]]):
        for place, (name, rate) in enumerate(modes):
            which[point, place], growth[point, place], unstable[point, place] = name, rate, rate > 0
            columns["frequency"][point, place] = 1000 * (point + 1) + place
    found = summarise(to_dataset(plan, columns, ""), plan)
    assert (found.points, found.points_with_squeal, found.points_with_divergence) == (4, 3, 1)
    assert {name: mode.unstable_points for name, mode in found.modes.items()} == {"Y": 2, "Tz": 1}
    assert (found.modes["Y"].largest_growth_rate_1_per_s, found.modes["Y"].frequency_there_Hz) == (9.0, 1001.0)
    assert (found.modes["Y"].where, found.modes["Tz"].where) == ({"drum.speed": 1.0}, {"drum.speed": 3.0})


def test_a_point_that_has_not_settled_counts_as_that_alone(damped):
    plan = plan_of(damped, "drum.speed=1..3x3")._replace(transient=True)
    columns = blank(plan, 3)
    columns["outcome"][:] = 0
    columns["squeal"][:] = 1
    columns["separation_ratio"][:] = columns["reversal_ratio"][:] = 2.0
    columns["settled"][:] = [1, 1, 0]
    columns["trend"][:] = [TRENDS.index(name) for name in ("decays", "settled", "settled")]
    found = summarise(to_dataset(plan, columns, ""), plan).transients
    assert found is not None
    assert found.trends == {"decays": 1, "settled": 1, "not settled": 1}
    assert (found.points_with_squeal, found.points_not_settled) == (1, 1)


@pytest.mark.thorough
def test_where_nothing_grows_there_is_no_table(drumsqueal, tmp_path):
    arguments = (
        str(SCENARIOS / "constant_friction.toml"),
        "--set",
        "damping.ratio=0.01",
        "--vary",
        "drum.speed=1..20x3",
    )
    status, printed, _ = drumsqueal("sweep", *arguments, "-o", str(tmp_path / "out"))
    assert status == 0
    assert "Squeal at 0 of 3 points, by eigenvalues\n" in printed
    assert "most 1/s" not in printed


BENDING = {"young": 210e9, "poisson": 0.3, "up_to": 3e3}


def test_values_that_the_scene_takes_nowhere_are_refused_with_the_first_reason(nominal):
    scene = nominal.with_values({"shoe.elastic": BENDING})
    with pytest.raises(RequestError, match=r"none of these values; at the first point: .* did you mean 70 GPa\?"):
        ds.sweep_parameters(scene, {"shoe.elastic.young": [70.0, 140.0, 210.0]})


@pytest.mark.thorough
def test_where_some_values_are_not_taken_the_first_reason_is_printed(nominal):
    plan = grid(nominal.with_values({"shoe.elastic": BENDING}), [Variation("shoe.elastic.young", "Pa", (210e9, 70.0))])
    words = " ".join(str(summarise(sweep_file.in_memory(plan), plan)).split())
    assert "1 of 2 points: the scene does not take these values; the first: the shoe has some" in words
