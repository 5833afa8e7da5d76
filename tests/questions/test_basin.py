"""Basins: where starts lead, against a boundary from another integrator; the same whatever comes between."""

import json
import math
import re
from io import StringIO
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import xarray
from matplotlib.path import Path as Polygon
from matplotlib.text import Text
from rich.console import Console
from scipy.integrate import solve_ivp

import drumsqueal as ds
from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import to_json
from drumsqueal.findings.kinds import Kind
from drumsqueal.questions.sweep import answer
from drumsqueal.questions.sweep import file as file_module
from drumsqueal.questions.sweep import in_python as study_module
from drumsqueal.questions.sweep import points as body_module
from drumsqueal.questions.sweep import study as sweep_study
from drumsqueal.questions.sweep.found import Basin, find_basin, number_motions
from drumsqueal.questions.sweep.points import COMPUTED, LEADS, NOT_YET, BodyPlan, blank, in_si, read_box
from drumsqueal.questions.sweep.study import compute
from drumsqueal.scene import COORDINATES, SceneError, load_scene
from drumsqueal.scene.plan import sample
from drumsqueal.scene.variation import read_variation

SPEED, DAMPING = 1.5, 0.1
BOX = {"displacement": {"X": (-2.0, 2.0)}, "velocity": {"X": (-2.0, 2.0)}}


def block() -> ds.Model:
    """A block that is quiet, or sticks and slips: bistable from 1.1513 to 1.8366 m/s."""
    return ds.block_on_belt(ds.ExponentialLaw(1.0, 0.5, 2.0), damping=DAMPING, belt_speed=SPEED)


@pytest.fixture(scope="module")
def bistable() -> ds.Scene:
    return load_scene("scenarios/damped.toml", ["drum.speed=15", "simulate.duration=0.02"])


def ranges(scene: ds.Scene, *texts: str) -> list[ds.Variation]:
    return [read_variation(text, scene, option="--vary", points=None, starts=True) for text in texts]


def boundary_of_the_block() -> Polygon:
    """The unstable cycle, which never sticks: backwards in time all slipping motion between the two ends on it."""

    def backwards(_: float, state: np.ndarray) -> list[float]:
        x, v = state
        pull = 0.5 * (math.exp(-2 * abs(v - SPEED)) - math.exp(-2 * SPEED))  # beyond that of steady sliding
        return [-v, DAMPING * v + x - pull]

    found = solve_ivp(backwards, (0, 600), [0.01, 0.0], rtol=1e-10, atol=1e-12, max_step=0.05)
    x, v = found.y
    assert v[found.t > 590].max() < SPEED
    first, last = np.flatnonzero((v[:-1] < 0) & (v[1:] >= 0))[-2:]
    return Polygon(np.stack([x, v], 1)[first : last + 2])


def test_chances_are_of_the_starts_of_which_it_is_clear_where_they_lead():
    # Of eight starts four squeal, in two ways, one decays, one runs away; two are not clear.
    leads = [Kind.SQUEALS, Kind.DECAYS, Kind.SQUEALS, Kind.UNDECIDED, Kind.SQUEALS, Kind.RUNS_AWAY, Kind.GROWS]
    leads += [Kind.SQUEALS]
    energy = np.array([1.0, 0.0, 8.0, 0.0, 1.2, 0.0, 0.0, 1.1])
    frequency = np.array([900.0, np.nan, 1400.0, np.nan, 920.0, np.nan, np.nan, 910.0])
    amplitude = np.zeros((8, 2))
    amplitude[[0, 2, 4, 7]] = [[1e-5, 0.0], [5e-5, 1e-3], [2e-5, 0.0], [3e-5, 0.0]]
    dimension = ("sample",)
    data = xarray.Dataset(
        {
            "leads_to": (dimension, [LEADS.index(each) for each in leads]),
            "kinetic_energy": (dimension, energy),
            "main_frequency": (dimension, frequency),
            "main_coordinate": (dimension, [1, -1, 0, -1, 1, -1, -1, 1]),
            "amplitude": ((*dimension, "coordinate"), amplitude),
            "smallest_force": (dimension, [3.0, 2.0, -1.5, 9.0, 3.0, 3.0, 3.0, 3.0]),
        }
    )
    data["attractor"] = (dimension, number_motions(data))
    box = read_box({"velocity": {"Tz": (0.0, 2.0)}, "displacement": {"X": (-1.0, 1.0)}}, in_si(("X", "Tz")))
    model: Any = SimpleNamespace(names=("X", "Tz"))
    plan = BodyPlan(model, box, draws=8, seed=1, sample_rate=10.0, tolerance=1e-6, solver="auto")
    found = find_basin(data, plan)
    assert found.attractor.tolist() == [2, 0, 1, -1, 2, -1, -1, 2]
    assert (found.squeal.count, found.decay.count, found.squeal.total) == (4, 1, 6)
    assert (found.unclear, found.elsewhere, found.coordinate) == (2, {"runs away": 1}, "Tz")
    loud, faint = found.attractors
    starts = [dict(zip(plan.keys, each, strict=True)) for each in plan.values(0, 8).tolist()]
    assert [(each.number, each.chance.count, each.start) for each in (loud, faint)] == [
        (1, 1, starts[2]), (2, 3, starts[0]),
    ]  # fmt: skip
    displacement, velocity = plan.start(plan.values(2, 3)[0])
    assert (displacement.tolist(), velocity.tolist()) == (
        [starts[2]["displacement.X"], 0.0], [0.0, starts[2]["velocity.Tz"]],
    )  # fmt: skip
    assert [plan.unit(key) for key in ("displacement.X", "velocity.Tz")] == ["m", "rad/s"]
    # Medians over the starts that lead there.
    assert (faint.frequency_Hz, faint.kinetic_energy_J, faint.amplitude) == (910.0, 1.1, {"X": 2e-5, "Tz": 0.0})
    assert found.notes == ("the contact pulls: the normal force fell to −1.5 N; use separation=True",)
    assert repr(found).startswith("Basin of 6 starts: 66.7 % (")
    assert "(1400 Hz 16.7 %, 910 Hz 50 %), 2 unclear; the contact pulls" in repr(found)


# --- bodies ---------------------------------------------------------------------------------------------------------


def test_starts_are_computed_batch_by_batch_in_memory_or_into_a_file_that_is_gone_on_with(tmp_path, monkeypatch):
    """Made-up motions: starts beyond 1.5 squeal, in one way where X begins below zero, in another above."""
    asked: list[Any] = []

    def made_up(plan, first, stop, threads=None, look=None):
        asked.append((first, stop, threads, plan.sample_rate, plan.tolerance, plan.solver))
        if len(asked) == limit:
            raise KeyboardInterrupt
        x, v = plan.values(first, stop).T
        far, above = np.hypot(x, v) > 1.5, x > 0
        columns = blank(plan, stop - first)
        columns["outcome"][:] = COMPUTED
        columns["leads_to"][:] = np.where(far, LEADS.index(Kind.SQUEALS), LEADS.index(Kind.DECAYS))
        columns["kinetic_energy"][:] = np.where(above, 5.0, 2.0) + 0.01 * x
        columns["main_frequency"][:] = np.where(above, 30.0, 40.0)
        columns["main_coordinate"][far] = 0
        columns["amplitude"][:, 0] = x**2
        return columns

    limit = 0
    monkeypatch.setattr(body_module, "program_of", lambda model: "which takes time to trace")
    monkeypatch.setattr(sweep_study, "BATCH_OF_TRANSIENTS", 9)
    for module in (sweep_study, file_module):
        monkeypatch.setattr(module, "compute", made_up)
    body = block()
    found = ds.study_basin(body, BOX, samples=40, seed=4, sample_rate=17.0, tolerance=3e-7, solver="tsit5", threads=3)
    batches = [(0, 9), (9, 18), (18, 27), (27, 36), (36, 40)]
    assert asked == [(*each, 3, 17.0, 3e-7, "tsit5") for each in batches]
    plan = BodyPlan(body, read_box(BOX, in_si(("X",))), 40, 4, 17.0, 3e-7, "tsit5")
    np.testing.assert_array_equal(found.starts, plan.values(0, 40))
    x, v = found.starts.T
    wanted = np.where(np.hypot(x, v) <= 1.5, 0, np.where(x > 0, 1, 2))
    np.testing.assert_array_equal(found.attractor, wanted)
    assert (found.squeal.count, found.squeal.total, found.unclear) == ((wanted > 0).sum(), 40, 0)
    for each, frequency in zip(found.attractors, (30.0, 40.0), strict=True):
        mine = wanted == each.number
        assert (each.chance.count, each.frequency_Hz) == (mine.sum(), frequency)
        assert each.kinetic_energy_J == pytest.approx(np.median((5.0 if each.number == 1 else 2.0) + 0.01 * x[mine]))
        assert each.amplitude == {"X": pytest.approx(np.median(x[mine] ** 2))}
        assert each.start == {"displacement.X": x[mine][0], "velocity.X": v[mine][0]}
    # Into a file: what was stopped goes on with the batches that are missing, and what is complete is read.
    file, limit = tmp_path / "basin.nc", len(asked) + 3
    how: Any = {"samples": 40, "seed": 4, "sample_rate": 17.0, "tolerance": 3e-7, "solver": "tsit5", "file": file}
    with pytest.raises(KeyboardInterrupt):
        ds.study_basin(body, BOX, **how, threads=2)
    with xarray.open_dataset(file, engine="h5netcdf") as there:
        assert (there["outcome"].values != NOT_YET).sum() == 18
    asked.clear()
    limit, seen = 0, []
    again = ds.study_basin(body, BOX, **how, threads=2, progress=lambda *given: seen.append(given))
    assert asked == [(*each, 2, 17.0, 3e-7, "tsit5") for each in batches[2:]]
    assert [each for each in seen if each[0] == "sweeping"] == [("sweeping", k, 40) for k in (18, 27, 36, 40)]
    assert again.model_dump_json() == found.model_dump_json()
    np.testing.assert_array_equal(again.attractor, wanted)
    asked.clear()
    read = ds.study_basin(body, BOX, **how)
    assert (asked, read.model_dump_json()) == ([], found.model_dump_json())
    np.testing.assert_array_equal(read.attractor, wanted)
    with pytest.raises(RequestError, match="another set of points"):
        ds.study_basin(body, BOX, **(how | {"seed": 5}))
    # 200 starts with the seed 0, unless it is said otherwise.
    monkeypatch.setattr(study_module, "_sample_rate", lambda model, given: 17.0 if given is None else given)
    usual = ds.study_basin(body, BOX)
    np.testing.assert_array_equal(usual.starts, plan._replace(draws=200, seed=0).values(0, 200))
    assert asked[-1] == (198, 200, None, 17.0, 1e-6, "auto")


@pytest.mark.thorough
def test_starts_of_a_block_lead_where_the_unstable_cycle_parts_them(tmp_path):
    file = tmp_path / "basin.nc"
    done = []

    def stop(what: str, points: float = 0.0, _: float | None = None) -> None:
        done.append(points)
        if what == "sweeping" and len(done) > 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ds.study_basin(block(), BOX, samples=6, file=file, progress=stop)
    with xarray.open_dataset(file, engine="h5netcdf") as there:
        assert (there["outcome"].values == NOT_YET).all()
    found = ds.study_basin(block(), BOX, samples=6, file=file)
    inside = boundary_of_the_block().contains_points(found.starts)
    assert 0 < inside.sum() < 6
    assert (found.attractor == np.where(inside, 0, 1)).all()
    assert (found.squeal.count, found.squeal.total, found.unclear) == (6 - inside.sum(), 6, 0)
    # It sticks, so that it moves as fast as the belt, and slips off where static friction gives way.
    (squeal,) = found.attractors
    assert squeal.frequency_Hz == pytest.approx(0.1583, abs=2e-4)
    assert len(repr(found)) < 200
    # Another study is not taken for this one, and what is complete is read.
    with pytest.raises(RequestError, match="another set of points"):
        ds.study_basin(block(), BOX, samples=7, file=file)
    with pytest.raises(RequestError, match="another model"):
        ds.study_basin(ds.block_on_belt(lambda s: 0.5 + 0 * s, damping=0.1, belt_speed=1.5), BOX, samples=6, file=file)
    again = ds.study_basin(block(), BOX, samples=6, file=file, progress=lambda *_: pytest.fail("it computes"))
    assert (again.attractor == found.attractor).all()
    assert again.model_dump_json() == found.model_dump_json()


@pytest.mark.thorough
def test_a_file_of_another_law_of_the_same_name_is_not_taken_for_this_one(tmp_path):
    def study(law, **how: Any) -> Basin:
        body = ds.block_on_belt(law, damping=0.1, belt_speed=1.5)
        small = {"velocity": {"X": (-0.1, 0.1)}}
        return ds.study_basin(body, small, samples=2, sample_rate=20, file=tmp_path / "basin.nc", **how)

    flat, falling = lambda s: 0.3 + 0 * s, lambda s: 0.3 + 0.5 * jnp.exp(-s)
    found = study(flat)
    for other in (falling, lambda s: 0.3 + 1e-12 + 0 * s):
        with pytest.raises(RequestError, match="another model"):
            study(other)
    again = study(lambda s: 0.3 + 0 * s, progress=lambda *_: pytest.fail("it computes"))
    assert again.model_dump_json() == found.model_dump_json()


@pytest.mark.parametrize(
    ("box", "message"),
    [
        ({}, "no ranges"),
        ({"speed": {"X": (0, 1)}}, "neither displacement nor velocity"),
        ({"velocity": {"Y": (0, 1)}}, "velocity.Y: this body has the coordinates X"),
        ({"velocity": {"X": (1, 0)}}, "velocity.X: the first value must be below the second"),
        ({"velocity": {"X": 1.0}}, "velocity.X: give it two values"),
        ({"velocity": {"X": "ab"}}, "velocity.X: give it two values.*got 'ab'"),
        ({"velocity": {"X": ("a", "b")}}, "velocity.X: its two values must be numbers"),
        ({"velocity": {"X": (None, 1.0)}}, "velocity.X: its two values must be numbers"),
        ({"velocity": (-1, 1)}, "velocity: say which coordinate has this range"),
        ([("velocity", 1.0)], "write it as"),
    ],
)
def test_a_wrong_box_is_refused(box, message):
    with pytest.raises(RequestError, match=message):
        ds.study_basin(block(), box)


@pytest.mark.parametrize(
    ("ends", "message"),
    [
        (("a", "b"), "velocity.Y: this is not a number"),
        ((None, 1.0), "velocity.Y: this is not a number"),
        (("1 m/s", "-1 m/s"), "velocity.Y: the first value must be below the second"),
    ],
)
def test_a_wrong_box_of_a_scene_is_refused(bistable, ends, message):
    with pytest.raises(RequestError, match=message):
        ds.study_basin(bistable, {"velocity": {"Y": ends}})


def test_what_keeps_moving_has_no_basin(bistable):
    driven = ds.block_on_belt(lambda s: 0.5 + 0 * s, belt_speed=1.0, forces={"X": (0.1, 0.2)})
    with pytest.raises(ValueError, match="a force keeps"):
        ds.study_basin(driven, BOX)
    with pytest.raises(RequestError, match="number of samples"):
        ds.study_basin(block(), BOX, samples=0)
    box = {"velocity": {"Y": ("-1 m/s", "1 m/s")}}
    forced = {"forcing": {"frequency": 1000.0, "amplitude": {"Y": 1.0}}}
    with pytest.raises(SceneError, match="a force keeps"):
        ds.study_basin(bistable.with_values(forced), box)
    run_up = {"drum.speed": {"time": [0.0, 1.0], "value": [5.0, 6.0]}}
    with pytest.raises(SceneError, match="constant"):
        ds.study_basin(bistable.with_values(run_up), box)


# --- scenes ---------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_where_a_start_leads_hangs_neither_on_its_batch_nor_on_threads(bistable):
    some = ranges(bistable, "start.velocity.Y=-1.5..1.5", "start.displacement.Y=-200..200 µm")
    plan = sample(bistable, some, 10, seed=3, transient=True)
    whole = compute(plan, 0, 10, threads=2)
    assert set(whole["leads_to"]) == {LEADS.index(Kind.DECAYS), LEADS.index(Kind.SQUEALS)}
    parts = [compute(plan, first, stop, threads=1) for first, stop in ((0, 3), (3, 10))]
    for name, values in whole.items():
        assert np.concatenate([part[name] for part in parts]).tobytes() == values.tobytes(), name
    # One brake: its eigenvalues are those of the scene itself.
    own = ds.analyse_stability(ds.build_model(bistable, coordinates=COORDINATES))
    assert whole["largest_growth_rate"] == pytest.approx(max(mode.growth_rate for mode in own.modes), rel=1e-9)
    # The start that is run by itself ends as it does here.
    loud = int(np.flatnonzero(whole["leads_to"] == LEADS.index(Kind.SQUEALS))[0])
    alone = plan.scene_at(plan.values(loud, loud + 1)[0]).with_values({"simulate.duration": 0.4})
    motion = ds.run(alone).findings.saturation
    assert motion is not None
    assert motion.amplitude["Y"] == pytest.approx(whole["amplitude"][loud, 1], rel=0.01)


@pytest.mark.thorough
def test_a_sweep_of_starts_goes_on_and_says_which_fraction_squeals(drumsqueal, bistable, tmp_path, monkeypatch):
    monkeypatch.setattr("drumsqueal.questions.sweep.study.BATCH_OF_TRANSIENTS", 4)
    arguments = ["sweep", "scenarios/damped.toml", "--set", "drum.speed=15", "--set", "simulate.duration=0.02"]
    arguments += ["--vary", "start.velocity.Y=-1.5..1.5", "--vary", "start.displacement.Y=-200..200 µm"]
    arguments += ["--random", "8", "--seed", "3", "--transient", "-o", str(tmp_path)]
    filled = []

    def stopped(plan, first, stop, *_, **__):
        if filled:
            raise KeyboardInterrupt
        filled.append(first)
        return compute(plan, first, stop)

    with monkeypatch.context() as patch:
        patch.setattr("drumsqueal.questions.sweep.file.compute", stopped)
        status, _, errors = drumsqueal(*arguments)
    assert (status, "4 of 8 points were computed" in errors) == (1, True)
    status, printed, errors = drumsqueal(*arguments, "--resume")
    assert (status, errors) == (0, "")
    assert {path.name for path in tmp_path.iterdir()} == {"sweep.nc", "sweep.json", "basin.png"}
    assert "By the eigenvalues steady sliding is stable" in printed
    basin = json.loads((tmp_path / "sweep.json").read_text())["basin"]
    # The same from Python, without a file.
    box = {"velocity": {"Y": (-1.5, 1.5)}, "displacement": {"Y": ("-200 µm", 200e-6)}}
    once = ds.study_basin(bistable, box, samples=8, seed=3)
    assert json.loads(to_json(once)) == basin
    assert once.squeal.count + once.decay.count == once.squeal.total == 8
    assert once.attractors[0].frequency_Hz == pytest.approx(950.7, abs=1)
    text = f"{once.squeal.in_words} of the disturbances squeal"
    assert text in " ".join(printed.split())
    with xarray.open_dataset(tmp_path / "sweep.nc", engine="h5netcdf") as there:
        assert there["attractor"].values.tolist() == once.attractor.tolist()


def test_starts_need_transients(drumsqueal, tmp_path):
    vary = ("--vary", "start.velocity.Y=-1..1x5", "-o", str(tmp_path / "out"))
    status, _, errors = drumsqueal("sweep", "scenarios/damped.toml", *vary)
    assert (status, errors.count("\n"), "add --transient" in errors) == (2, 1, True)
    status, _, errors = drumsqueal("onset", "scenarios/damped.toml", "--along", "start.velocity.Y=-1..1x5")
    assert (status, "where the transient starts" in errors) == (2, True)
    assert not (tmp_path / "out").exists()


# --- attractors -----------------------------------------------------------------------------------------------------


def test_motions_are_numbered_by_energy_whatever_their_order():
    decays, squeals, grows = (LEADS.index(each) for each in (Kind.DECAYS, Kind.SQUEALS, Kind.GROWS))
    leads = np.array([squeals, decays, squeals, squeals, grows, squeals])
    energy = np.array([1.0, 1e-20, 9.0, 1.3, 5.0, 1.1])
    frequency = np.array([700.0, np.nan, 700.0, 705.0, 700.0, 970.0])
    columns = {"leads_to": leads, "kinetic_energy": energy, "main_frequency": frequency}
    data = xarray.Dataset({name: ("sample", values) for name, values in columns.items()})
    assert number_motions(data).tolist() == [2, 0, 1, 2, -1, 3]
    order = [5, 3, 1, 0, 2, 4]
    assert number_motions(data.isel(sample=order)).tolist() == [3, 2, 0, 2, 1, -1]


def of_rests(places, leads=Kind.RESTS) -> tuple[Basin, BodyPlan, xarray.Dataset]:
    """The basin of starts that rest at places (m); one more leads elsewhere."""
    codes = np.array([LEADS.index(leads)] * len(places) + [LEADS.index(Kind.FAILED)])
    data = xarray.Dataset({name: ("sample", np.zeros(codes.size)) for name in ("kinetic_energy", "main_frequency")})
    data["main_coordinate"] = ("sample", np.full(codes.size, -1))
    data["leads_to"] = ("sample", codes)
    data["rest"] = (("sample", "coordinate"), np.array([[*places, np.nan]]).T)
    data["amplitude"] = 0 * data["rest"]
    data = data.assign_coords(coordinate=["X"])
    assert number_motions(data, of_one_brake=False).max() <= 0  # each would have a place of its own
    data["attractor"] = ("sample", number_motions(data))
    box = read_box({"velocity": {"X": (0.0, 2.0)}}, in_si(("X",)))
    model: Any = SimpleNamespace(names=("X",))
    plan = BodyPlan(model, box, draws=codes.size, seed=1, sample_rate=10.0, tolerance=1e-6, solver="auto")
    return find_basin(data, plan), plan, data


def test_each_place_where_starts_rest_elsewhere_is_another_attractor():
    basin, plan, _ = of_rests([2.0, 2.0 * (1 - 1e-12), -3.0, 2.0])
    assert basin.attractor.tolist() == [1, 1, 2, 1, -1]
    one, other = basin.rests
    assert (one.number, one.chance.count, one.place) == (1, 3, {"X": 2.0})
    assert (other.number, other.chance.count, other.place) == (2, 1, {"X": -3.0})
    assert other.start == {"velocity.X": plan.values(2, 3)[0, 0]}
    assert (basin.squeal.count, basin.decay.count, basin.squeal.total, basin.unclear) == (0, 0, 4, 1)
    assert (basin.attractors, basin.elsewhere) == ((), {"rests elsewhere": 4})
    assert "75 % rest at X = 2 m from steady sliding, 25 % rest at X = -3 m" in repr(basin)


@pytest.mark.parametrize("leads", [Kind.RESTS, Kind.UNDECIDED])
def test_a_basin_names_its_rests_or_says_that_nothing_is_known(monkeypatch, leads):
    basin, plan, data = of_rests([2.0, -3.0], leads)
    monkeypatch.setattr(answer, "at_lining", lambda *_: (1.0, "m", "X"))
    monkeypatch.setattr(BodyPlan, "about", {"title": "two wells"})
    console = Console(width=200, record=True, file=StringIO())
    answer.print_basin(console, basin, plan)
    printed = console.export_text()
    figure = answer.draw_basin(data, plan, basin)
    drawn = " ".join(text.get_text() for text in figure.findobj(Text))
    for text in (printed, drawn, repr(basin)):
        assert "nan" not in text
    if leads is Kind.RESTS:
        assert re.search(r"rest 2 +50\.0 %", printed)
        assert "Rest 2 is another equilibrium, at X = -3 m from steady sliding; it follows, for instance, on" in printed
        assert "rest 1, at X = 2 m from steady sliding (50 %)" in drawn
    else:
        assert printed.startswith("Of none of the 3 starts it is clear where it leads, so that no fraction is known")
        assert "of none of the 3 starts it is clear where it leads" in drawn
