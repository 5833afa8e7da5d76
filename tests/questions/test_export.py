"""Histories in other programs' formats, read back by readers of their own, number by number."""

import csv
import importlib.util
import json
import re
import tomllib
import wave
from itertools import pairwise

import h5py
import numpy as np
import pandas
import pyarrow.parquet
import pytest
import pyuff
import scipy.io
import scipy.signal

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import FORMATS, find_format, part_of
from drumsqueal.findings.history import SIGNALS, TEMPERATURE
from drumsqueal.physics.model import build_model
from drumsqueal.questions.export.signals import _RECORDED, surface_velocity
from drumsqueal.scene import COORDINATES, scene_from_dict
from drumsqueal.simulation import run
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.transient.sticking import accelerations

RATE = 50e3
MOTIONS = [f"{kind}_{name}" for kind in ("displacement", "velocity", "acceleration") for name in ("X", "Y", "Tz")]
ENDS = ("_leading", "_leading_along", "_trailing", "_trailing_along")
SURFACE = ["surface_velocity" + which for which in ("", "_radial", *ENDS)]
ALL = [*MOTIONS, *SURFACE, *SIGNALS]


@pytest.fixture(scope="module")
def ran(nominal):
    """Thirty milliseconds from beyond the edges of contact and slip."""
    start = {"start.displacement": {"Y": 2e-5, "Tz": 2e-4}, "simulate.duration": 0.03, "title": "Bremse Nº 1"}
    return run(nominal.with_values(start)).history


@pytest.fixture
def history(ran, tmp_path):
    path = tmp_path / "history.nc"
    ran.to_netcdf(path, engine="h5netcdf")
    return path


@pytest.fixture
def exported(history, drumsqueal):
    """Export the history as a format with options; the file, and what was said of it."""

    def call(to, *options):
        status, printed, errors = drumsqueal("export", str(history), "--to", to, *options)
        assert status == 0, errors
        return history.with_suffix(FORMATS[to].suffix), printed, errors

    return call


def recorded(ran, name):
    kind, _, coordinate = name.partition("_")
    return ran[name].values if name in ran else ran[kind].sel(coordinate=coordinate).values


RECORDED = [name for name in ALL if name not in SURFACE and not name.startswith("acceleration")]


def test_csv_reads_back_to_the_last_bit(ran, exported, monkeypatch):
    monkeypatch.setattr("drumsqueal.questions.export.export._BLOCK", 700)  # three blocks
    path, printed, errors = exported("csv")
    assert errors == ""
    assert "26 signals, 1501 samples at 50000 Hz from 0 to 0.03 s" in printed
    assert printed.endswith(f"Results are in {path}\n")
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    values = np.array(rows, dtype=float)
    assert [name.rpartition(" (")[0] for name in head] == ["time", *ALL]
    units = dict(zip(["time", *ALL], (name.rpartition(" (")[2].removesuffix(")") for name in head), strict=True))
    assert units["displacement_Tz"] == "rad"
    assert units["velocity_Y"] == units["surface_velocity"] == "m/s"
    assert units["acceleration_Tz"] == "rad/s^2"
    assert units["brake_torque"] == "N m"
    np.testing.assert_array_equal(values[:, 0], np.arange(1501) / RATE)
    table = pandas.read_csv(path)  # one line of names, as every program expects
    assert list(table) == head
    np.testing.assert_allclose(table.to_numpy(), values, rtol=1e-14)  # it rounds in its own way
    for name in RECORDED:
        np.testing.assert_array_equal(values[:, head.index(f"{name} ({units[name]})")], recorded(ran, name))


def test_the_answer_as_json_says_what_is_in_the_file(history, drumsqueal):
    call = ("export", str(history), "--to", "wav", "--rate", "8 kHz")
    status, printed, errors = drumsqueal(*call, "--json", "-")
    told = json.loads(printed)
    assert (status, told["signals"], told["samples"]) == (0, {"surface_velocity": "m/s"}, 241)
    assert told["remarks"][0] in errors
    assert drumsqueal(*call, "--overwrite", "--quiet") == (0, "", "")


def test_npz_reads_back(ran, exported):
    path, _, _ = exported("npz")
    with np.load(path) as file:  # without pickle
        assert file["signals"].tolist() == ALL
        assert dict(zip(file["signals"].tolist(), file["units"].tolist(), strict=True))["normal_force"] == "N"
        assert (file["sample_rate"], str(file["title"]), str(file["outcome"])) == (RATE, "Bremse Nº 1", "complete")
        assert str(file["scene"]) == ran.attrs["scene"]
        modes = {name.removeprefix("mode_"): file[name] for name in file.files if name.startswith("mode_")}
        check_modes(ran, modes, file["coordinates"], file["eigenvalues"], file["steady_state"])
        assert file["coordinate_units"].tolist() == ["m", "m", "m", "rad", "rad", "rad"]
        np.testing.assert_array_equal(file["time"], ran["time"].values)
        for name in RECORDED:
            np.testing.assert_array_equal(file[name], recorded(ran, name))


def scene_of(ran):
    return scene_from_dict(tomllib.loads(ran.attrs["scene"]))


def predicted(ran):
    return analyse_stability(build_model(scene_of(ran), coordinates=COORDINATES))


def check_modes(ran, modes, coordinates, eigenvalues, steady):
    wanted = predicted(ran)
    assert coordinates.tolist() == list(wanted.coordinates)
    assert modes["name"].tolist() == [mode.label for mode in wanted.modes]
    np.testing.assert_array_equal(eigenvalues, wanted.eigenvalues)
    np.testing.assert_array_equal(steady, wanted.steady_state)
    value = modes["eigenvalue"]
    assert set(value) <= set(eigenvalues)
    np.testing.assert_array_equal(value, [mode.eigenvalue for mode in wanted.modes])
    np.testing.assert_allclose(modes["frequency_Hz"], value.imag / (2 * np.pi), rtol=1e-15)
    np.testing.assert_array_equal(modes["growth_rate_1_per_s"], value.real)
    np.testing.assert_allclose(modes["damping_ratio"], -value.real / np.abs(value), rtol=1e-15)
    assert modes["shape"].shape == (6, 5)
    for shape, mode in zip(modes["shape"].T, wanted.modes, strict=True):  # a column for each
        np.testing.assert_array_equal(shape, mode.right[:6])


def check_prediction(lines, ran):
    modes = predicted(ran).modes
    assert len(lines) == len(modes) == 5
    for line, mode in zip(lines, modes, strict=True):
        name, frequency, unit, growth = line.split()
        assert (name, unit) == (mode.name, "Hz")
        assert float(frequency) == pytest.approx(mode.frequency_Hz, rel=1e-5)  # six digits
        assert float(growth.removesuffix("/s")) == pytest.approx(mode.growth_rate, rel=1e-5)


def test_mat_reads_back(ran, exported):
    path, _, _ = exported("mat")
    file = scipy.io.loadmat(path, simplify_cells=True)
    assert not h5py.is_hdf5(path)  # version 5, which every MATLAB and Octave reads
    assert (file["fs"], file["title"], file["scene"]) == (RATE, "Bremse Nº 1", ran.attrs["scene"])
    assert file["units"]["velocity_Tz"] == "rad/s"
    assert file["units"]["smallest_pressure"] == "Pa"
    assert file["units"]["steady_state"].tolist() == ["m", "m", "m", "rad", "rad", "rad"]
    check_modes(ran, file["modes"], file["coordinates"], file["eigenvalues"], file["steady_state"])
    raw = scipy.io.loadmat(path)
    assert raw["velocity_X"].shape == raw["t"].shape == (1501, 1)  # columns
    assert raw["modes"]["frequency_Hz"][0, 0].shape == (5, 1)
    names = [name for name in raw if not name.startswith("__")]
    assert all(len(name) <= 31 and re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name) for name in names)  # in MATLAB, too
    assert set(file["units"]) <= set(names)
    np.testing.assert_array_equal(file["t"], ran["time"].values)
    for name in RECORDED:
        np.testing.assert_array_equal(file[name], recorded(ran, name))


def test_parquet_reads_back(ran, exported):
    path, _, _ = exported("parquet")
    table = pyarrow.parquet.read_table(path)
    assert table.column_names == ["time", *ALL]
    assert table.schema.field("friction_power").metadata[b"units"] == b"W"
    texts = {name.decode(): text.decode() for name, text in table.schema.metadata.items()}
    assert (float(texts["sample_rate"]), texts["title"]) == (RATE, "Bremse Nº 1")
    assert texts["scene"] == ran.attrs["scene"]
    check_prediction(texts["eigenvalues"].splitlines(), ran)
    for name in ("time", *RECORDED):
        np.testing.assert_array_equal(table[name].to_numpy(), recorded(ran, name))
    meaning = table.schema.field("surface_velocity_leading").metadata[b"meaning"]
    assert meaning == b"radial velocity at theta = -beta/2"  # whichever way the drum turns


def datasets(path):
    """Split a universal file into its datasets: number and lines, between lines of -1 in columns 5 and 6."""
    lines, found = path.read_bytes().decode("ascii").split("\n"), []
    assert lines.pop() == ""
    while lines:
        assert lines.pop(0).rstrip() == "    -1"
        end = next(k for k, line in enumerate(lines) if line.rstrip() == "    -1")
        found.append((int(lines[0][:6]), lines[1:end]))
        del lines[: end + 1]
    return found


def fields(line, *widths):
    places = np.cumsum([0, *widths])
    assert len(line.rstrip()) <= places[-1]
    return [line[a:b].strip() for a, b in pairwise(places)]


def function(lines):
    """A dataset 58 by the columns of its published definition, in the case of real, double, evenly spaced values."""
    assert all(len(line) <= 80 for line in lines)
    one = fields(lines[5], 5, 10, 5, 10, 1, 10, 10, 4, 1, 10, 10, 4)
    kind, count, even, start, interval, _ = fields(lines[6], 10, 10, 10, 13, 13, 13)
    values = [float(line[k : k + 20]) for line in lines[11:] for k in range(0, len(line.rstrip()), 20)]
    assert (kind, even, int(count)) == ("4", "1", len(values))
    return {
        "texts": [line.rstrip() for line in lines[:5]],
        "type": one[0],
        "name": one[5],
        "node": one[6],
        "direction": one[7],
        "reference": one[9:],
        "start": float(start),
        "interval": float(interval),
        "abscissa": fields(lines[7], 10, 5, 5, 5, 1, 20, 1, 20),
        "ordinate": fields(lines[8], 10, 5, 5, 5, 1, 20, 1, 20),
        "denominator": fields(lines[9], 10, 5, 5, 5, 1, 20, 1, 20)[0],
        "values": np.array(values),
    }


def functions(found):
    return {read["texts"][0].partition(":")[0]: read for read in (function(each) for kind, each in found if kind == 58)}


def nodes(lines):
    """A dataset 2411: the place of each node, and the system of its displacements, by its number."""
    heads = [[int(field) for field in fields(line, 10, 10, 10, 10)] for line in lines[::2]]
    places = [[float(field) for field in fields(line, 25, 25, 25)] for line in lines[1::2]]
    return {head[0]: (np.array(place), head[2]) for head, place in zip(heads, places, strict=True)}


# specific data type, powers of length, force and temperature, units, node, direction
CODES = {
    "displacement_X": ("8 0 0 0", "m", "1", "1"),
    "displacement_Tz": ("8 0 0 0", "rad", "1", "6"),
    "velocity_Y": ("11 0 0 0", "m/s", "1", "2"),
    "acceleration_X": ("12 0 0 0", "m/s^2", "1", "1"),
    "acceleration_Tz": ("12 0 0 0", "rad/s^2", "1", "6"),
    "surface_velocity": ("11 0 0 0", "m/s", "2", "2"),
    "surface_velocity_radial": ("11 0 0 0", "m/s", "2", "1"),
    "surface_velocity_leading": ("11 0 0 0", "m/s", "3", "1"),
    "surface_velocity_trailing_along": ("11 0 0 0", "m/s", "4", "2"),
    "brake_torque": ("1 1 1 0", "N m", "0", "0"),
    "normal_force": ("9 0 1 0", "N", "0", "0"),
    "smallest_pressure": ("15 -2 1 0", "Pa", "0", "0"),
    "contact_fraction": ("1 0 0 0", "1", "0", "0"),
    "friction_power": ("1 1 1 0", "W", "0", "0"),
    "kinetic_energy": ("1 1 1 0", "J", "0", "0"),
}


def test_the_universal_file_reads_back_by_its_published_columns(ran, exported):
    path, printed, _ = exported("uff58")
    assert "six digits" not in printed  # 20 µs are exact
    found = datasets(path)
    assert [number for number, _ in found] == [151, 164, 2420, 2411, 82, *[55] * 5, *[58] * len(ALL)]
    head, units, *_ = (lines for _, lines in found)
    assert [line.rstrip() for line in head[:2]] == ["Bremse No 1", "history.nc; complete"]
    assert (head[5].rstrip(), len(head)) == ("drumsqueal", 7)
    assert fields(units[0], 10, 20, 10) == ["1", "SI: metre, newton", "1"]
    factors = [units[1][k : k + 25].replace("D", "e") for k in (0, 25, 50)]
    assert [float(text) for text in factors] == [1, 1, 1]  # what is divided by to come to SI
    found = functions(found)
    assert list(found) == ALL
    assert len({read["name"] for read in found.values()}) == len(ALL)
    for name, read in found.items():
        assert (read["type"], read["start"], read["interval"], read["denominator"]) == ("1", 0.0, 2e-5, "0")
        assert read["abscissa"][0] == "17"
        assert read["abscissa"][5::2] == ["time", "s"]
        assert read["reference"] == ["NONE", "0", "0"]
        assert read["texts"][1] == "Bremse No 1; complete"  # in ASCII, of which columns are counted
        assert read["texts"][2].startswith("sample rate 50000.0 Hz from 0 s")
        check_prediction("; ".join(read["texts"][3:]).split("; "), ran)
        if name in SURFACE:  # whole, with the place
            assert read["texts"][0].endswith((" its middle", " theta = -beta/2", " theta = +beta/2"))
        if name in CODES:
            assert (" ".join(read["ordinate"][:4]), read["ordinate"][7], read["node"], read["direction"]) == CODES[name]
        if name in RECORDED:
            np.testing.assert_allclose(read["values"], recorded(ran, name), rtol=5.1e-12, atol=0)  # twelve digits


@pytest.mark.thorough
def test_the_directions_of_a_universal_file_are_those_of_its_nodes(exported):
    path, _, _ = exported("uff58", "--signals", "velocity," + ",".join(SURFACE))
    found = datasets(path)
    (systems, points, outline) = (next(lines for kind, lines in found if kind == one) for one in (2420, 2411, 82))
    assert [line.split()[:2] for line in systems[2::6]] == [["1", "0"], ["2", "1"]]  # Cartesian, cylindrical
    for k in (0, 6):  # both with the axes of the drum
        matrix = [[float(field) for field in fields(line, 25, 25, 25)] for line in systems[k + 4 : k + 8]]
        np.testing.assert_array_equal(matrix, np.vstack([np.eye(3), np.zeros(3)]))
    points = nodes(points)
    c, s = 0.1 * np.cos(np.deg2rad(65)), 0.1 * np.sin(np.deg2rad(65))
    wanted = {1: [72.1956531e-3, 0, 0], 2: [0.1, 0, 0], 3: [c, -s, 0], 4: [c, s, 0]}
    assert {point: system for point, (_, system) in points.items()} == {1: 1, 2: 2, 3: 2, 4: 2}
    for point, (place, _) in points.items():
        np.testing.assert_allclose(place, wanted[point], atol=1e-11)  # c is given to nine digits
    assert set(outline[2].split()) == {str(point) for point in points}
    moves = {(int(read["node"]), int(read["direction"])): read["values"] for read in functions(found).values()}
    assert sorted(moves) == [(1, 1), (1, 2), (1, 6), (2, 1), (2, 2), (3, 1), (3, 2), (4, 1), (4, 2)]
    for point in (2, 3, 4):  # a rigid body: v + ω × (p − g), seen in the cylindrical system at its own angle
        x, y, _ = points[point][0] - points[1][0]
        velocity = np.array([moves[1, 1] - moves[1, 6] * y, moves[1, 2] + moves[1, 6] * x])
        angle = np.arctan2(*points[point][0][1::-1])
        for direction, axis in ((1, [np.cos(angle), np.sin(angle)]), (2, [-np.sin(angle), np.cos(angle)])):
            # Twelve digits of each; the terms that cancel are no larger than 10 m/s.
            np.testing.assert_allclose(moves[point, direction], axis @ velocity, atol=1e-10)


def test_the_modes_of_a_universal_file_move_its_nodes(ran, exported):
    path, _, _ = exported("uff58", "--signals", "normal_force")
    found = datasets(path)
    points = nodes(next(lines for kind, lines in found if kind == 2411))
    shapes = [lines for kind, lines in found if kind == 55]
    for number, (lines, mode) in enumerate(zip(shapes, predicted(ran).modes, strict=True), start=1):
        assert lines[0].startswith(f"mode {mode.label} {mode.frequency_Hz:.6g} Hz")
        # structural, complex eigenvalues, translations, displacement, complex, three values a node
        assert fields(lines[5], *[10] * 6) == ["1", "3", "2", "8", "5", "3"]
        assert fields(lines[6], *[10] * 4) == ["2", "6", "0", str(number)]
        real, imaginary, *modal = (float(field) for field in fields(lines[7], *[13] * 6))
        assert complex(real, imaginary) == pytest.approx(mode.eigenvalue, rel=1e-5)  # six digits
        assert not any(modal)
        assert [int(line) for line in lines[8::2]] == list(points)
        for point, line in zip(points, lines[9::2], strict=True):
            numbers = [float(field) for field in fields(line, *[13] * 6)]
            wanted = mode.right[:3] + np.cross(mode.right[3:6], points[point][0] - points[1][0])
            np.testing.assert_allclose(np.array(numbers[::2]) + 1j * np.array(numbers[1::2]), wanted, rtol=1e-5)


@pytest.mark.thorough
def test_modes_of_fewer_coordinates_have_their_places(ran, history, drumsqueal):
    kept = {"simulate.coordinates": ["X", "Tz"], "start.displacement": {"Tz": 2e-4}}
    scene = scene_of(ran).with_values(kept)
    with h5py.File(history, "r+") as file:
        file.attrs["scene"] = scene.to_toml()
    first, _ = analyse_stability(build_model(scene, coordinates=("X", "Tz"))).modes
    for to in ("mat", "uff58"):
        assert drumsqueal("export", str(history), "--to", to, "--signals", "normal_force")[0] == 0
    found = scipy.io.loadmat(history.with_suffix(".mat"), simplify_cells=True)
    assert found["coordinates"].tolist() == ["X", "Tz"]
    np.testing.assert_array_equal(found["modes"]["shape"][:, 0], first.right[:2])
    lines = next(lines for kind, lines in datasets(history.with_suffix(".uff")) if kind == 55)
    middle = [float(field) for field in fields(lines[11], *[13] * 6)]
    wanted = [first.right[0], (0.1 - 72.1956531e-3) * first.right[1], 0]  # u_x, and R − c from the centre of gravity
    np.testing.assert_allclose(np.array(middle[::2]) + 1j * np.array(middle[1::2]), wanted, rtol=1e-5)


def test_the_universal_file_reads_back_by_pyuff(ran, exported):
    path, _, _ = exported("uff58", "--signals", "velocity,sticking", "--from", "0.01 s", "--until", "0.02")
    sets = pyuff.UFF(str(path)).read_sets()
    assert [found["type"] for found in sets] == [151, 164, 2420, 2411, 82, *[55] * 5, *[58] * 4]
    _, _, systems, points, outline, *modes = sets[:-4]
    assert (systems["CS_sys_labels"], systems["CS_types"]) == ([1, 2], [0, 1])
    assert points["node_nums"].tolist() == [1, 2, 3, 4]
    assert outline["nodes"].tolist() == [3, 2, 4, 1, 3]
    for found, mode in zip(modes, predicted(ran).modes, strict=True):
        assert found["eig"] == pytest.approx(mode.eigenvalue, rel=1e-5)
        np.testing.assert_allclose([found[f"r{k}"][0] for k in (1, 2, 3)], mode.right[:3], rtol=1e-5)
    signals = sets[-4:]
    assert [found["rsp_ent_name"] for found in signals] == ["vel_X", "vel_Y", "vel_Tz", "sticking"]
    np.testing.assert_allclose(signals[1]["x"], ran["time"].values[500:1001], rtol=1e-12)
    wanted = ran["velocity"].sel(coordinate="Y").values[500:1001]
    np.testing.assert_allclose(signals[1]["data"], wanted, rtol=5.1e-12)


def test_times_of_more_than_six_digits_are_told(history, exported):
    path, printed, _ = exported("uff58", "--signals", "normal_force", "--rate", "44.1 kHz")
    assert "six digits of the interval, 2.267573696e-05 s; ID line 3" in printed
    assert function(datasets(path)[-1][1])["texts"][2].startswith("sample rate 44100.0 Hz from 0 s")
    with h5py.File(history, "r+") as file:  # as of a long run
        time = file["time"]
        assert isinstance(time, h5py.Dataset)
        time[:] = time[:] + 12.34
    path, printed, _ = exported("uff58", "--signals", "normal_force", "--from", "12.34566 s", "--overwrite")
    assert "six digits of the start, 12.34566 s; ID line 3" in printed
    read = function(datasets(path)[-1][1])
    assert (read["texts"][2][:36], read["start"]) == ("sample rate 50000.0 Hz from 12.34566", 12.3457)


@pytest.mark.parametrize("slow", [1, 4])
def test_the_sound_reads_back(ran, exported, slow):
    path, printed, _ = exported("wav", "--slow", str(slow))
    with wave.open(str(path)) as file:
        assert (file.getnchannels(), file.getsampwidth(), file.getframerate()) == (1, 2, 44100)
        heard = np.frombuffer(file.readframes(file.getnframes()), "<i2")
    assert np.abs(heard).max() == round(32767 * 10 ** (-1 / 20))
    content = path.read_bytes()
    told = content[content.index(b"ICMT") + 8 :].split(b"\0")[0].decode()
    scale = float(told.partition("one step of the samples is ")[2].split()[0])
    assert "m/s" in told
    assert ("played 4 times slower" in told) == ("played 4 times slower" in printed) == (slow == 4)
    # SciPy's resampler, of another filter: between them lies what is above 20 kHz, and its ringing at the ends.
    y, turn = (ran["velocity"].sel(coordinate=name).values for name in ("Y", "Tz"))
    velocity = y + (0.1 - 72.1956531e-3) * turn  # along the drum, at the lining's middle
    other = scipy.signal.resample_poly(velocity, 441 * slow, 500)[: heard.size]
    inside = slice(200 * slow, -200 * slow)
    wanted = (other - other.mean())[inside]
    assert np.abs(heard[inside] * scale - wanted).max() < 0.02 * np.abs(wanted).max()
    assert np.corrcoef(heard[inside], wanted)[0, 1] > 0.9999


def test_accelerations_are_those_of_the_equation_of_motion(ran, exported):
    path, _, _ = exported("npz", "--signals", "acceleration,velocity_Y", "--from", "0.004 s")
    rows, kept = slice(200, None), [0, 1, 5]
    q, v = (ran[name].values[rows, kept] for name in ("displacement", "velocity"))
    model = build_model(scene_of(ran))
    wanted = accelerations(model, ran["time"].values[rows], q, v, np.zeros(len(q)))  # proven in a test of its own
    with np.load(path) as file:
        for k, name in enumerate(("X", "Y", "Tz")):
            # One program for all samples, but not in the same blocks.
            np.testing.assert_allclose(file[f"acceleration_{name}"], wanted[:, k], rtol=1e-12)
        slope = np.gradient(file["velocity_Y"], 1 / RATE)
        # Differences lower a line by (ωh)²/6: 0.5 % at 1.4 kHz, 14 % at 7.4 kHz, where there is less.
        assert np.abs(slope - file["acceleration_Y"])[1:-1].max() < 0.14 * np.abs(slope).max()


def test_the_surface_moves_as_the_kinematics_say(nominal):
    velocity = np.random.default_rng(2).normal(size=(5, 6))
    c, R, half = 72.1956531e-3, 0.1, np.deg2rad(65)
    for angle in (0.0, -half, half):
        centre = np.array([c, 0.0, 0.0])
        point = R * np.array([np.cos(angle), np.sin(angle), 0.0])
        moves = velocity[:, :3] + np.cross(velocity[:, 3:], point - centre)  # of a rigid body
        e_r, e_theta = np.array([np.cos(angle), np.sin(angle), 0]), np.array([-np.sin(angle), np.cos(angle), 0])
        for direction, along in ((e_r, False), (e_theta, True)):
            found = surface_velocity(nominal, velocity, angle, along_drum=along)
            np.testing.assert_allclose(found, moves @ direction, rtol=1e-8, atol=1e-9)  # c is given to nine digits


def test_a_part_is_cut_out_and_keeps_its_times(ran, exported):
    path, _, _ = exported("npz", "--from", "10.01 ms", "--until", "0.02 s", "--signals", "displacement_Z,velocity_X")
    with np.load(path) as file:
        np.testing.assert_allclose(file["time"], ran["time"].values[501:1001], rtol=1e-14)
        np.testing.assert_array_equal(file["velocity_X"], recorded(ran, "velocity_X")[501:1001])
        assert not file["displacement_Z"].any()  # does not move, and comes where it is asked for by name


def test_a_part_that_is_resampled_knows_what_lies_around_it(ran, exported):
    options = ("--signals", "velocity_X,velocity_Tz,sticking", "--rate", "20 kHz", "--overwrite")
    path, _, errors = exported("npz", *options)
    assert errors.count("\n") == 1
    with np.load(path) as file:
        whole = {name: file[name] for name in ("time", "velocity_X", "velocity_Tz")}
        assert set(file["sticking"]) <= {0.0, 1.0}
    exported("npz", *options, "--from", "0.01 s", "--until", "0.02 s")
    with np.load(path) as file:
        np.testing.assert_allclose(file["time"], whole["time"][200:401], rtol=1e-12)
        for name in ("velocity_X", "velocity_Tz"):
            np.testing.assert_allclose(file[name], whole[name][200:401], rtol=0, atol=1e-9 * np.abs(whole[name]).max())


def test_flags_are_those_of_the_nearest_sample(history, exported):
    flags = (np.arange(1501) // 7) % 2
    with h5py.File(history, "r+") as file:
        variable = file["sticking"]
        assert isinstance(variable, h5py.Dataset)
        variable[:] = flags
    path, _, _ = exported("npz", "--signals", "sticking", "--rate", "30 kHz")
    with np.load(path) as file:
        np.testing.assert_array_equal(file["sticking"], flags[np.rint(np.arange(901) * 5 / 3).astype(int)])


def test_the_drum_enters_at_the_leading_end(ran, exported):
    path, _, _ = exported("npz", "--signals", "surface_velocity_leading,surface_velocity_trailing")
    x, y, turn = (recorded(ran, f"velocity_{name}") for name in ("X", "Y", "Tz"))
    lift = (y - 72.1956531e-3 * turn) * np.sin(np.deg2rad(65))  # θ rises the way in which the drum turns
    with np.load(path) as file:
        for end, sign in (("leading", -1), ("trailing", 1)):
            wanted = x * np.cos(np.deg2rad(65)) + sign * lift
            np.testing.assert_allclose(file[f"surface_velocity_{end}"], wanted, rtol=1e-7, atol=1e-9)


def test_the_ends_of_the_lining_are_known_along_the_drum_too(ran, exported):
    # u_θ = −Ẋ sin θ + (Ẏ − c Ṫz) cos θ + R Ṫz at θ = ∓65°, and at the middle.
    path, _, _ = exported("npz", "--signals", ",".join([SURFACE[0], "surface_velocity_leading_along", SURFACE[-1]]))
    x, y, turn = (recorded(ran, f"velocity_{name}") for name in ("X", "Y", "Tz"))
    with np.load(path) as file:
        for end, degrees in (("", 0.0), ("_leading_along", -65.0), ("_trailing_along", 65.0)):
            angle = np.deg2rad(degrees)
            wanted = -x * np.sin(angle) + (y - 72.1956531e-3 * turn) * np.cos(angle) + 0.1 * turn
            np.testing.assert_allclose(file[f"surface_velocity{end}"], wanted, rtol=1e-7, atol=1e-9)


def test_what_a_low_rate_loses_is_told(exported):
    _, _, errors = exported("csv", "--signals", "velocity_X", "--rate", "5 kHz")
    assert errors.count("\n") == 1
    assert "a rate of 5000 Hz holds what is below 2500 Hz" in errors
    assert "% of the energy of velocity_X lies above, most at" in errors
    assert "it is filtered out, as it would be aliased" in errors
    assert exported("csv", "--signals", "velocity_X", "--rate", "100 kHz", "--overwrite")[2] == ""


def test_a_run_that_was_cut_off_goes_out_as_far_as_it_got(history, drumsqueal):
    with h5py.File(history, "r+") as file:
        for name in ("displacement", "velocity"):
            variable = file[name]
            assert isinstance(variable, h5py.Dataset)
            variable[700:] = np.nan
        file.attrs["outcome"], file.attrs["ending"] = "interrupted by the user after t = 0.01398 s", "interrupted"
    status, printed, errors = drumsqueal("export", str(history.parent), "--to", "npz", "--signals", "velocity")
    assert status == 0
    assert "700 samples" in printed
    assert "the run is incomplete (interrupted by the user" in errors
    with np.load(history.with_suffix(".npz")) as file:
        assert str(file["outcome"]).startswith("interrupted")


def test_without_its_friction_law_there_are_no_accelerations(history, drumsqueal):
    with h5py.File(history, "r+") as file:
        file.attrs["friction_law"] = "stribeck, given in Python"
    status, _, errors = drumsqueal("export", str(history), "--to", "npz")
    assert status == 0
    assert "accelerations are left out: the friction law was given in Python" in errors
    with np.load(history.with_suffix(".npz")) as file:
        assert file["signals"].tolist() == [name for name in ALL if not name.startswith("acceleration")]
        assert str(file["eigenvalues_unknown"]) == "the friction law was given in Python"
        assert not {"eigenvalues", "mode_name", "steady_state"} & set(file.files)
        assert str(file["friction_law"]) == "stribeck, given in Python"
    assert drumsqueal("export", str(history), "--to", "mat", "--quiet")[0] == 0
    file = scipy.io.loadmat(history.with_suffix(".mat"))
    assert file["eigenvalues_unknown"] == "the friction law was given in Python"
    assert not {"eigenvalues", "modes", "steady_state"} & set(file)
    assert drumsqueal("export", str(history), "--to", "uff58", "--quiet")[0] == 0
    found = datasets(history.with_suffix(".uff"))
    assert 55 not in [number for number, _ in found]
    assert function(found[-1][1])["texts"][3] == "unknown: the friction law was given in Python"
    status, _, errors = drumsqueal("export", str(history), "--to", "csv", "--signals", "acceleration_X")
    assert (status, errors.count("\n")) == (2, 1)


WRONG = {
    "format": (["--to", "pdf"], "write one of csv, mat, npz, parquet, uff58, wav"),
    "signal": (["--signals", "velocity_Q"], "did you mean velocity_"),
    "nothing like a signal": (["--signals", "%"], "there are displacement, velocity, acceleration, surface_velocity"),
    "no signal": (["--signals", ""], "there is no such signal"),
    "time": (["--from", "3 m"], '--from 3 m: write a time such as "0.1 s" ("m" (meter) is not a unit of time)'),
    "times the wrong way round": (["--from", "0.02", "--until", "0.01"], "is not before --until"),
    "beyond the end": (["--until", "3 s"], "--until 3 s: the history has 0 to 0.03 s"),
    "before the start": (["--from", "-1"], "the history has 0 to 0.03 s"),
    "one sample": (["--from", "0.01", "--until", "0.010019"], "hold 1 samples"),
    "rate": (["--rate", "5 s"], '--rate 5 s: write a rate such as "20 kHz"'),
    "no rate": (["--rate", "0"], "--rate 0: write a rate"),
    "a rate far too low": (["--rate", "100 Hz"], "take at least 250 Hz"),
    "a rate far too high": (["--rate", "1e15 Hz"], "more than are written at a time"),
    "a slow table": (["--slow", "4"], "--slow 4 is for a sound"),
    "no speed": (["--to", "wav", "--slow", "0"], "write how many times slower"),
    "two sounds": (["--to", "wav", "--signals", "velocity_X,velocity_Y"], "a sound is of one signal"),
    "a group as a sound": (["--to", "wav", "--signals", "velocity"], "a sound is of one signal"),
    "silence": (["--to", "wav", "--signals", "displacement_Z"], "there is nothing to hear"),
    "an odd rate of a sound": (["--to", "wav", "--rate", "44100.5"], "a whole number of Hz"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_request_gets_one_line_and_status_2(history, drumsqueal, case):
    options, told = WRONG[case]
    to = () if "--to" in options else ("--to", "csv")
    status, printed, errors = drumsqueal("export", str(history), *to, *options)
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert told in errors
    assert [path.name for path in history.parent.iterdir()] == [history.name]


@pytest.mark.parametrize("content", [b"", b"time,Y\n0,1\n", "cut short"], ids=["empty", "another's", "cut short"])
def test_what_is_no_history_gets_one_line_and_status_2(history, drumsqueal, content):
    history.write_bytes(history.read_bytes()[:20_000] if content == "cut short" else content)
    status, printed, errors = drumsqueal("export", str(history), "--to", "csv")
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert str(history) in errors
    assert [path.name for path in history.parent.iterdir()] == [history.name]


def test_nothing_is_overwritten_unasked(history, drumsqueal):
    there = history.with_suffix(".csv")
    there.write_text("of value")
    before = history.read_bytes()
    status, _, errors = drumsqueal("export", str(history), "--to", "csv")
    assert (status, there.read_text()) == (2, "of value")
    assert "exists; add --overwrite" in errors
    status, _, errors = drumsqueal("export", str(history), "--to", "csv", "-o", str(history), "--overwrite")
    assert status == 2
    assert f"{history} would replace {history}, which is read or written, too" in errors
    (history.parent / "link.nc").symlink_to(history)
    for named in ("link.nc", "sub/../history.nc", there.name):
        (history.parent / "sub").mkdir(exist_ok=True)
        json_file = str(history.parent / named)
        status, _, errors = drumsqueal("export", str(history), "--to", "csv", "--json", json_file, "--overwrite")
        assert (status, there.read_text()) == (2, "of value")
        assert "which is read or written, too; name another with --json" in errors
    assert history.read_bytes() == before
    arguments = ("--signals", "normal_force", "--overwrite")
    assert drumsqueal("export", str(history), "--to", "csv", *arguments)[0] == 0
    assert there.read_text().startswith("time (s),normal_force (N)\n")
    assert not part_of(there).exists()


def test_an_extra_that_is_not_installed_is_named(history, drumsqueal, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *more: None if name == "pyarrow" else find(name, *more)
    )
    status, printed, errors = drumsqueal("export", str(history), "--to", "parquet")
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert 'pip install "drumsqueal[parquet]"' in errors


def test_every_recorded_signal_can_go_out():
    assert list(_RECORDED) == [*SIGNALS, *TEMPERATURE]


@pytest.mark.parametrize("to", FORMATS)
def test_a_full_disk_leaves_nothing_half_written(history, drumsqueal, to, monkeypatch):
    real = type(history).replace

    def full(self, target):
        if self.name.endswith(".part"):
            raise OSError(28, "No space left on device")
        return real(self, target)

    monkeypatch.setattr(type(history), "replace", full)
    status, printed, errors = drumsqueal("export", str(history), "--to", to, "--signals", "velocity_X")
    assert (status, printed, errors.count("\n")) == (1, "", 1)
    assert "No space left" in errors
    assert [path.name for path in history.parent.iterdir()] == [history.name]


def test_a_format_goes_by_the_ending_of_its_files_too():
    assert find_format("uff") == find_format("unv") == find_format("uff58")
    with pytest.raises(RequestError, match="there is no such format"):
        find_format("uf")
