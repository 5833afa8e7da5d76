"""Noise matrices: cells as they are alone, tables that are wrong, and a matrix that was cut off."""

import csv
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import drumsqueal as ds
from along_y import AlongY, brake_along_y
from drumsqueal.dynamics.ensemble import Start
from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import FILES, to_json
from drumsqueal.findings.schema import read_findings
from drumsqueal.questions.sweep import matrix_cells
from drumsqueal.questions.sweep.answer import draw_matrix
from drumsqueal.questions.sweep.matrix_cells import CellFound, NoiseMatrix, in_rows
from drumsqueal.questions.sweep.matrix_plan import read_matrix
from drumsqueal.scene import load_scene

DATA = Path(__file__).parents[1] / "data"
TABLE = (DATA / "matrix.toml").read_text(encoding="utf-8")


@pytest.fixture
def table(tmp_path) -> Path:
    path = tmp_path / "noise.toml"
    path.write_text(TABLE)
    return path


@pytest.fixture(scope="module")
def found() -> NoiseMatrix:
    """The study itself, which takes ten seconds."""
    return ds.study_matrix(DATA / "matrix.toml")


@pytest.fixture(scope="module")
def stored() -> NoiseMatrix:
    """What it gave, as `tests/data/make.py` has written it: enough to print and to draw."""
    return read_findings(DATA / "matrix.json", NoiseMatrix)


@pytest.mark.thorough
def test_the_stored_matrix_is_what_the_study_gives(found, stored):
    assert (stored.headline, stored.axes) == (found.headline, found.axes)
    for there, here in zip(stored.cells, found.cells, strict=True):
        numbers = {key: value for key, value in here.model_dump().items() if isinstance(value, float)}
        # Cycles are met to 1e-6. The loudest 50 ms of a stop are of a motion that fluctuates, and round-off, which each
        # processor has of its own, decides where it is by then.
        known = pytest.approx(numbers, rel=1e-4 if here.levels["procedure"] == "drag" else 1e-2, nan_ok=True)
        assert {key: getattr(there, key) for key in numbers} == known
        assert there.model_copy(update=numbers) == here.model_copy(update=numbers)


def test_the_command_tells_which_cells_squeal_and_how_loud(drumsqueal, tmp_path, as_kept):
    (tmp_path / "y.toml").write_text(brake_along_y().to_toml())
    table = tmp_path / "noise.toml"
    table.write_text('scenes = ["y.toml"]\n[vary]\n"drum.speed" = ["5 rad/s", "60 rad/s"]\n[procedures.drag]\n')
    folder = tmp_path / "out"
    status, printed, errors = drumsqueal("matrix", str(table), "-o", str(folder))
    assert (status, errors) == (0, "")
    as_kept("matrix", printed, folder)
    assert {path.name for path in folder.iterdir()} == set(FILES["matrix"])
    assert "1 of 2 cells squeal" in printed
    loud, quiet = read_findings(folder / "matrix.json", NoiseMatrix).cells
    for cell, speed in ((loud, 5), (quiet, 60)):
        known = AlongY(brake_along_y(f"drum.speed={speed}")).growth_rate
        assert cell.growth_rate_1_per_s == pytest.approx(known, rel=1e-9)
    frequency, amplitude, _ = AlongY(brake_along_y()).cycle
    assert (loud.verdict, loud.after, quiet.verdict) == ("squeals", "small", "quiet")
    # Its kinetic energy is judged steady to a thousandth; a cycle of slip that reverses is a sine to some thousandths.
    assert loud.frequency_Hz == pytest.approx(frequency, rel=1e-4)
    assert loud.velocity_m_per_s == pytest.approx(math.tau * frequency * amplitude / math.sqrt(2), rel=5e-3)
    rows = list(csv.DictReader((folder / "matrix.csv").read_text().splitlines()))
    assert [row["frequency_Hz"] for row in rows] == [str(loud.frequency_Hz), ""]


@pytest.mark.thorough
def test_cells_squeal_as_onset_and_transients_say(found):
    cells = {(each.levels["drum.speed"], each.levels["procedure"]): each for each in found.cells}
    assert len(cells) == 6
    # Below 10.61 rad/s steady sliding is unstable, up to 47.9 rad/s it is bistable, and beyond it is stable.
    after = {speed: cells[speed, "drag"].after for speed in found.axes["drum.speed"]}
    assert after == {"5 rad/s": "small", "15 rad/s": "large, along Y", "60 rad/s": None}
    assert [cells[speed, "drag"].unstable for speed in after] == [True, False, False]
    assert cells["60 rad/s", "drag"].verdict == "quiet"
    squeal = cells["15 rad/s", "drag"]
    assert squeal.frequency_Hz == pytest.approx(950.7, abs=1)
    # The shoe moves as in a run from such a disturbance: v = √(2T/m).
    scene = load_scene("scenarios/damped.toml", ["drum.speed=15", "start.velocity.Y=1.5"])
    result = ds.run(scene)
    late = result.history.isel(time=slice(-5000, None))
    energy = float(late["kinetic_energy"].mean())
    mass = float(ds.build_model(scene).mass[1])
    assert squeal.velocity_m_per_s == pytest.approx(math.sqrt(2 * energy / mass), rel=0.02)
    assert squeal.level_dB == pytest.approx(20 * math.log10(squeal.velocity_m_per_s / 1e-9))
    # A disturbance that decays is no squeal of the stop; one that lasts is.
    assert cells["60 rad/s", "stop"].verdict in ("quiet", "squeals")
    stop = cells["15 rad/s", "stop"]
    assert stop.verdict == "squeals"
    assert 7.5 <= stop.speed_rad_per_s <= 15
    assert stop.velocity_m_per_s < 1.1 * squeal.velocity_m_per_s


@pytest.mark.thorough
def test_a_matrix_that_was_cut_off_goes_on_and_is_the_same(drumsqueal, table, found, tmp_path, monkeypatch):
    from drumsqueal.questions.sweep.study import compute

    folder, done = tmp_path / "out", []

    def stopped(plan, first, stop, *_, **__):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(first)
        return compute(plan, first, stop)

    with monkeypatch.context() as patch:
        patch.setattr("drumsqueal.questions.sweep.file.compute", stopped)
        status, _, errors = drumsqueal("matrix", str(table), "-o", str(folder))
    assert (status, "2 of 6 points were computed" in errors) == (1, True)
    status, printed, errors = drumsqueal("matrix", str(table), "-o", str(folder), "--resume")
    assert (status, errors) == (0, "")
    assert {path.name for path in folder.iterdir()} == set(FILES["matrix"])
    assert (folder / "matrix.json").read_text() == to_json(found)
    assert f"{found.squeal} of 6 cells squeal" in printed
    rows = list(csv.DictReader((folder / "matrix.csv").read_text().splitlines()))
    assert [row["drum.speed"] for row in rows] == [each.levels["drum.speed"] for each in found.cells]
    assert json.loads((folder / "matrix.json").read_text())["axes"]["procedure"] == ["drag", "stop"]
    status, _, errors = drumsqueal("matrix", str(table), "-o", str(folder), "--resume")
    assert (status, "nothing to resume" in errors) == (2, True)
    table.write_text(TABLE.replace("15 rad/s", "16 rad/s"))
    status, _, errors = drumsqueal("matrix", str(table), "-o", str(folder), "--resume")
    assert (status, "another set of points" in errors) == (2, True)


class Turning:
    """Two coordinates on a drum that slows down from 20 to 10 rad/s in 0.1 s, as a procedure sees them."""

    names, mass, rate = ("X", "Tz"), np.array([0.5, 1e-3]), 20e3
    operation: Any = SimpleNamespace(
        at=lambda time: SimpleNamespace(drum_speed=20.0 - 100.0 * time),
        drum_speed=SimpleNamespace(value=np.array([20.0, 10.0]), at=lambda time: (20.0 - 100.0 * time, None)),
    )

    def __init__(self, monkeypatch, decay, slowest, size=1.0):
        """Motion in proportion to the speed, times size e^(decay t), of modes that change at the `slowest` rate."""
        time = np.arange(2001) / self.rate
        size = size * (1 - 5 * time) * np.exp(decay * time)
        phase = 2 * np.pi * time[:, None] * [1000.0, 3000.0]
        velocity = size[:, None] * [1.0, 5.0] * np.cos(phase)
        chunks = [
            SimpleNamespace(time=time[some], vibration=0 * velocity[None, some], velocity=velocity[None, some])
            for some in (slice(0, 700), slice(700, None))
        ]
        modes = [SimpleNamespace(growth_rate=rate) for rate in (-100.0, slowest)]
        patches = {
            "integrate_many": lambda *_, **__: (chunk for chunk in chunks),
            "point_in_time": lambda *_: None,
            "least_energy": lambda _: 1e-24,
            "boundary_fractions": lambda model, q, v, moments: np.ones((2, 1, q["X"].size)),
        }
        for name, patch in patches.items():
            monkeypatch.setattr(matrix_cells, name, patch)
        simulate = SimpleNamespace(sample_rate=self.rate, duration=0.1, tolerance=1e-6, solver="auto")
        self.start = Start("small", np.zeros(2), np.zeros(2))
        self.cell: Any = SimpleNamespace(
            starts=[self.start], scene=SimpleNamespace(simulate=simulate), model=self, linear=self,
            stability=SimpleNamespace(steady_state=np.zeros(2)),
            family=SimpleNamespace(shown=lambda vector: vector, modes=lambda _: modes),
        )  # fmt: skip


def test_squeal_that_weakens_with_the_drum_s_speed_is_squeal(monkeypatch):
    found, outcome = matrix_cells._through(Turning(monkeypatch, 0.0, -4.0).cell, None, lambda *_: None)
    ((start, velocity, frequency, time, speed),) = found
    assert (start.name, outcome) == ("small", matrix_cells.COMPUTED)
    # X has 0.5 kg (1 m/s)², Tz 1e-3 kg m² (5 rad/s)²: its rate is larger, its energy a twentieth.
    assert frequency == pytest.approx(1000, rel=1e-3)
    # Of windows of 50 ms the first, its middle at 25 ms; mean square speeds there are (1 + 7/8 ...)²/2 of 1 to 3/4.
    assert (time, speed) == (pytest.approx(0.025), pytest.approx(17.5))
    mean = (1**3 - 0.75**3) / 3 / 0.25 / 2
    assert velocity == pytest.approx(math.sqrt((0.5 + 25e-3) * mean / 0.5), rel=1e-3)


def test_a_disturbance_that_falls_faster_than_the_drum_is_none(monkeypatch):
    # At 30 1/s, and the modes at 40: it is on its way out when the procedure ends; modes at 70 would be twice as fast.
    assert matrix_cells._through(Turning(monkeypatch, -30.0, -40.0).cell, None, lambda *_: None) == (
        [],
        matrix_cells.STILL_FALLS,
    )
    found, outcome = matrix_cells._through(Turning(monkeypatch, -30.0, -70.0).cell, None, lambda *_: None)
    assert (len(found), outcome) == (1, matrix_cells.COMPUTED)


@pytest.mark.parametrize(("size", "squeals"), [(1e-13, 0), (1e-11, 1)])
def test_what_rests_beyond_a_contact_boundary_is_no_squeal(monkeypatch, size, squeals):
    # 0.5 kg (1e-12 m/s)² are what counts as rest here.
    found, outcome = matrix_cells._through(Turning(monkeypatch, 0.0, -4.0, size).cell, None, lambda *_: None)
    assert (len(found), outcome) == (squeals, matrix_cells.COMPUTED)


def test_a_notebook_shows_the_table_of_the_command(stored):
    for shown in (str(stored), stored._repr_html_()):
        assert f"{stored.squeal} of 6 cells squeal" in shown
        assert "Damped brake" in shown
    read = NoiseMatrix.model_validate_json(to_json(stored))
    assert [each.disturbance for each in read.cells] == [each.disturbance for each in stored.cells]
    assert str(read) == str(stored)


def test_the_figure_has_a_cell_for_each(stored):
    columns, rows = in_rows(stored)
    assert columns == stored.axes["drum.speed"]
    assert [label for label, _ in rows] == ["drag", "stop"]
    figure = draw_matrix(stored)
    assert figure is not None
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert len(texts) == 6
    assert sum(text.endswith("Hz") for text in texts) == stored.squeal


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("title", "titel", "titel: unknown key; did you mean title"),
        ('scenes = ["damped"]', "scenes = []", "scenes: write a list"),
        ('"15 rad/s"', '"15 rad"', "the cell drum.speed = 15 rad"),
        ("speed = [1.0, 0.5]", "speed = [1.0]", "procedures.stop: time must begin at 0 s"),
        ("speed = [1.0, 0.5]", "speed = [0.0, 0.5]", "the drum must turn at the start"),
        ("speed = [1.0, 0.5]", "spede = [1.0, 0.5]", "procedures.stop.spede: unknown key"),
        ('"0.2 s"', '"0.045 s"', "procedures.stop: it must last 0.05 s or longer"),
        (TABLE[TABLE.index("[proc") :], "[procedures]", "procedures: write at least one"),
        ('"drum.speed" =', "scene =", "scene: there are two axes of this name"),
        ("[procedures.drag]", '[levels."drum.speed"]\nslow = { "drum.speed" = 1 }', "drum.speed: there are two axes"),
        ("[procedures.drag]", '[levels.slow]\nslow = { "drum.speed" = 1 }', "drum.speed and slow both set drum.speed"),
        ('["5 rad/s", "15 rad/s", "60 rad/s"]', "[[5]]", "vary: drum.speed: .* is no number"),
        ('["5 rad/s", "15 rad/s", "60 rad/s"]', "[{a = 1}]", "vary: drum.speed: .* is no number"),
        ('["5 rad/s", "15 rad/s", "60 rad/s"]', "[5, 5]", "vary: drum.speed: 5 is there twice"),
    ],
)
def test_a_wrong_table_is_refused(table, old, new, message):
    table.write_text(TABLE.replace(old, new))
    with pytest.raises(RequestError, match=message):
        read_matrix(table)


def test_levels_set_several_numbers_and_scenes_combine(table):
    hot = '{ "friction.static" = 0.4, "friction.kinetic" = 0.28 }'
    levels = f'[levels.temperature]\ncold = {{ "friction.static" = 0.5 }}\nhot = {hot}\n'
    table.write_text(TABLE.replace('["damped"]', '["damped", "nominal"]') + levels)
    plan = read_matrix(table)
    assert plan.keys == ("drum.speed", "temperature", "scene", "procedure")
    assert plan.points == 3 * 2 * 2 * 2
    scene, procedure = plan.scene_at(plan.points - 1)
    numbers = scene.numbers()
    assert [numbers[key] for key in ("friction.static", "friction.kinetic", "drum.speed")] == [0.4, 0.28, 60.0]
    assert scene.damping is None
    ran = procedure.over(scene)
    assert (ran.numbers()["drum.speed.value"], ran.simulate.duration) == ((60.0, 30.0), 0.2)


def test_scenes_of_one_file_name_in_two_folders_are_two(table):
    for folder in "ab":
        (table.parent / folder).mkdir()
        (table.parent / folder / "s.toml").write_text(load_scene("scenarios/damped.toml").to_toml())
    table.write_text(TABLE.replace('["damped"]', '["a/s.toml", "b/s.toml"]'))
    plan = read_matrix(table)
    assert plan.points == 2 * 3 * 2
    assert list(plan.axes["scene"]) == ["a/s.toml", "b/s.toml"]


def test_a_cell_without_steady_sliding_says_why(table):
    still = TABLE.replace('"5 rad/s", "15 rad/s", "60 rad/s"', '"0 rad/s"')
    table.write_text(still[: still.index("[procedures.stop]")])
    found = ds.study_matrix(table)
    (cell,) = found.cells
    assert (cell.verdict, cell.outcome) == ("not computed", "no steady sliding: the drum is at rest")
    assert (found.not_clear, found.headline) == (0, "0 of 1 cells squeal; 0 are quiet, 1 not computed")


def _cells(table, scene, *procedures) -> list[CellFound]:
    text = f'scenes = ["{scene}"]\n[vary]\n"drum.speed" = [5]\n[procedures.drag]\n'
    for name, times, speeds in procedures:
        text += f"[procedures.{name}]\ntime = {[f'{time} s' for time in times]}\nspeed = {speeds}\n"
    table.write_text(text)
    return list(ds.study_matrix(table).cells)


@pytest.mark.slow
def test_a_procedure_of_constant_speed_sounds_as_the_drag_does(table):
    """After the small start; frequency and level are those of the loudest squeal, whichever start leads to it."""
    drag, hold = _cells(table, "nominal", ("hold", [0, 0.3], [1, 1]))
    # Three squeals coexist at constant speed; in a procedure a large disturbance itself may be louder than its squeal.
    assert (drag.disturbance, drag.after) == ("small", "small; the loudest: large, along Y")
    assert drag.velocity_m_per_s > 1.05 * drag.small_velocity_m_per_s
    assert (hold.after, hold.velocity_m_per_s) == ("small", hold.small_velocity_m_per_s)
    # The loudest 50 ms of a motion that fluctuates against its mean over a longer time.
    assert hold.small_frequency_Hz == pytest.approx(drag.small_frequency_Hz, rel=0.05)
    assert hold.small_velocity_m_per_s == pytest.approx(drag.small_velocity_m_per_s, rel=0.19)  # 1.5 dB


@pytest.mark.thorough
def test_a_procedure_that_ends_while_a_disturbance_falls_is_undecided(table):
    """At 60 rad/s every disturbance decays; in 50 ms the large ones do not come below the contact boundaries."""
    text = TABLE[: TABLE.index("[procedures.drag]")].replace('"5 rad/s", "15 rad/s", ', "")
    ends = {"short": 0.05, "long": 0.3}
    procedures = (f'[procedures.{name}]\ntime = ["0 s", "{end} s"]\nspeed = [1, 1]\n' for name, end in ends.items())
    table.write_text(text + "".join(procedures))
    found = ds.study_matrix(table)
    short, long = found.cells
    assert (short.verdict, found.not_clear) == ("undecided at its end", 1)
    assert found.headline == "0 of 2 cells squeal; 1 is quiet, 1 not clear"
    assert short.outcome == "a disturbance still falls when the procedure ends"
    assert (long.verdict, long.outcome) == ("quiet", "computed")
    assert "undecided at its end (procedure short): a disturbance still falls" in " ".join(str(found).split())


@pytest.mark.thorough  # 27 s: a tenth of a second of squeal, twice
def test_the_end_of_a_procedure_counts(table):
    """Of 99 ms the last 50 squeal: a window that began at 50 ms would not be full."""
    _, whole, cut = _cells(table, "nominal", ("whole", [0, 0.1], [1, 1]), ("cut", [0, 0.099], [1, 1]))
    assert cut.verdict == whole.verdict == "squeals"
    assert cut.time_s == pytest.approx(0.074, abs=1e-3)
    assert cut.level_dB == pytest.approx(whole.level_dB, abs=1)
