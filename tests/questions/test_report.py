"""The page about a run or an onset: it says what its files say, to everybody, and needs no network."""

import base64
import hashlib
import io
import itertools
import json
import re
import shlex
import shutil
import wave
from html.parser import HTMLParser
from pathlib import Path

import h5py
import numpy as np
import pytest

from browser import BROWSER, Browser
from drumsqueal.dynamics.attractor import Response
from drumsqueal.dynamics.saturated import Saturated
from drumsqueal.files.history_file import read_history
from drumsqueal.files.output_folder import FIGURES, FILES, REPORT, RUN_FILES, figure_file, to_json
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.signals.spectra import amplitude_spectrum, peak_near
from drumsqueal.physics.model import build_model
from drumsqueal.questions.animate import section as moving
from drumsqueal.questions.onset import study as study_module
from drumsqueal.questions.onset.answer import ONSET
from drumsqueal.questions.onset.study import study_onset
from drumsqueal.questions.report import answer as onset_page_module
from drumsqueal.questions.report import answer as page
from drumsqueal.questions.report import answer as run_page_module
from drumsqueal.questions.report.answer import RECORD_S, _played, figure_words, write_page
from drumsqueal.questions.run import answer as run_job
from drumsqueal.questions.sweep.matrix_cells import NoiseMatrix
from drumsqueal.scene import COORDINATES, load_scene
from drumsqueal.scene.variation import read_variation
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.modes import analyse_stability

DAMPED = Path(__file__).parents[2] / "scenarios" / "damped.toml"
TITLE = (
    'A "quiet" <script>document.documentElement.dataset.harmed = 1</script></title><img src=x onerror=alert(1)> & shoe'
)
RPM = 60 / (2 * np.pi)  # in a rad/s
EMPTY = {"area", "base", "br", "col", "hr", "img", "input", "link", "meta", "source", "track", "wbr"}
chromium = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")


class Page(HTMLParser):
    """The elements of a page in their order: tag, attributes, text in them, and the tags around them."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.source = path.read_text(encoding="utf-8")
        self.elements: list[dict] = []
        self._open: list[dict] = []
        self.feed(self.source)
        self.close()
        assert not self._open, "not all elements are closed"

    def handle_starttag(self, tag, attrs):
        assert len({name for name, _ in attrs}) == len(attrs)
        element = {"tag": tag, "text": "", "inside": [each["tag"] for each in self._open], **dict(attrs)}
        self.elements.append(element)
        if tag not in EMPTY:
            self._open.append(element)

    def handle_endtag(self, tag):
        if tag not in EMPTY:
            assert self._open.pop()["tag"] == tag

    def handle_data(self, data):
        for element in self._open:
            element["text"] += data

    def all(self, *tags: str) -> list[dict]:
        return [element for element in self.elements if element["tag"] in tags]

    def one(self, name: str) -> dict:
        (found,) = [element for element in self.elements if element.get("id") == name]
        return found

    @property
    def numbers(self) -> dict[float, str]:
        return {float(element["value"]): element["text"] for element in self.all("data")}


@pytest.fixture(scope="module")
def run_folder(nominal, tmp_path_factory, quiet_reply):
    folder = tmp_path_factory.mktemp("run")
    # Less accurate than usual, which takes less time: what is told of a run is tested, and not the run.
    quick = {"simulate.duration": 0.25, "simulate.tolerance": 1e-5}
    scene = nominal.with_values({"title": TITLE, **quick})
    run_job.run_into(prepare(scene), quiet_reply(folder))
    return reported(folder, "run")


@pytest.fixture(scope="module")
def onset_folder(tmp_path_factory):
    """The critical value is real; where the transients lead is made up."""

    def made_up(family, tasks, how, *, rounds, known=None, progress):
        for point, start in tasks:
            lasts = point.value < 25 and (point.unstable or start.name != "small")
            one = np.array([1e-5])
            motion = Saturated(one, one, (0.0, 1.5), 1000.0, "Y", 1.0, 0.0, 1.0, one, one, "complete")
            yield Response.of(point.value, start.name, Kind.SQUEALS if lasts else Kind.DECAYS, motion, 0.1, ("Y",))

    folder = tmp_path_factory.mktemp("onset")
    alone = ['simulate.coordinates=["Y"]', "start.displacement={Y = 1e-7}"]
    scene = load_scene(DAMPED, alone)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_module, "find_attractors", made_up)
        study = study_onset(scene, "drum.speed=10 rpm..400 rpm x4", within=0.02)
    ONSET.write(folder, study)
    ONSET.draw(folder, study)
    return reported(folder, "onset")


def reported(folder: Path, kind: str) -> Path:
    """The folder with the page about it, which is made once."""
    write_page(folder / REPORT, folder, kind)
    return folder


@pytest.fixture(scope="module")
def run_page(run_folder):
    return Page(run_folder / REPORT)


@pytest.fixture(scope="module")
def onset_page(onset_folder):
    return Page(onset_folder / REPORT)


@pytest.fixture
def folder(run_folder, tmp_path):
    """A copy of a run, without the page, that a test may change."""
    return Path(shutil.copytree(run_folder, tmp_path / "run", ignore=shutil.ignore_patterns(REPORT)))


@pytest.fixture
def report(drumsqueal):
    def make(folder, *more):
        status, printed, errors = drumsqueal("report", str(folder), "--overwrite", *more)
        assert (status, errors) == (0, "")
        assert "MB and needs no network" in printed
        return Page(folder / REPORT)

    return make


@pytest.fixture(params=["run", "onset"])
def made(request, run_page, onset_page):
    return run_page if request.param == "run" else onset_page


# --- what it says ----------------------------------------------------------------------------------------------------


def test_the_numbers_are_those_of_the_summary(run_folder, run_page):
    page, summary = run_page, json.loads((run_folder / "summary.json").read_text())
    unshown = "frequency_from_phase_Hz"
    modes = [{key: mode[key] for key in mode if key != unshown} for mode in summary["growth"]["modes"]]
    wanted = [value for mode in modes for value in mode.values() if isinstance(value, float)]
    wanted += [mode[key] for mode in summary["prediction"]["modes"] for key in ("frequency_Hz", "damping_ratio")]
    wanted += list(summary["accuracy"].values())
    saturation = summary["saturation"]
    wanted += [saturation["main"]["frequency_Hz"], saturation["frequency_shift"], saturation["contact_fraction"]]
    wanted += [saturation["regime"]["resolution_Hz"], saturation["slip_reversed_fraction"]]
    wanted += [summary["frequency"]["predicted_by_contact_loss_shift"], summary["growth"]["linear_until_s"]]
    wanted += [summary["integration"]["steps"], summary["integration"]["rejected_steps"]]
    assert len(wanted) > 40
    assert set(wanted) <= set(page.numbers)
    for mode in summary["prediction"]["modes"]:
        value = complex(mode["growth_rate_1_per_s"], 2 * np.pi * mode["frequency_Hz"])
        assert min(abs(shown / (-2 * value.real / value.imag) - 1) for shown in page.numbers) < 1e-12
    assert page.one("verdict")["text"] == summary["verdict"]


def test_what_is_read_is_what_programs_read(made):
    """Beside every number stands what was found, in more digits; shares are in per cent, sizes in µm, speeds in rpm."""
    assert len(made.numbers) > 15
    for value, text in made.numbers.items():
        shown = float(text.replace("−", "-"))
        if value == 0:
            assert shown == 0
            continue
        digits = len(re.sub(r"e.*|[^0-9]", "", text).lstrip("0")) or 1
        # Half a step of the last digit, of a number that may begin with 1.
        assert min(abs(shown / value / factor - 1) for factor in (1, 100, 1e6, RPM)) <= 0.51 * 10.0 ** (1 - digits), (
            text
        )


def test_the_finding_comes_with_what_explains_it(run_page, onset_page, onset_folder):
    assert re.fullmatch(
        r"The brake squeals at 1\.0\d kHz, 2\d\.\d % below the onset predicted for Y \(1\.42 kHz\)\. That is "
        r"consistent with the loss of contact: on average 6\d % of the lining touches the drum, and the reduced mean "
        r"contact stiffness alone would lower mode Y to 1\.0\d kHz\.",
        run_page.one("headline")["text"],
    )
    summary = json.loads((onset_folder / "onset.json").read_text())
    assert onset_page.one("headline")["text"] == summary["verdict"]


def test_the_scene_and_the_command_give_the_same_again(run_folder, onset_folder, run_page, onset_page, tmp_path):
    for folder, shown, written in ((run_folder, run_page, "summary.json"), (onset_folder, onset_page, "onset.json")):
        summary = json.loads((folder / written).read_text())
        (link,) = [each for each in shown.all("a") if "download" in each]
        file = tmp_path / link["download"]
        file.write_bytes(base64.b64decode(link["href"].partition(",")[2]))
        scene = load_scene(file)
        assert json.loads(json.dumps(scene.model_dump(mode="json"))) == summary["scene"]
        assert file.read_text() in [each["text"] for each in shown.all("pre")]
        command = shlex.split(shown.one("command")["text"])
        assert command[:3] == ["drumsqueal", "run" if folder == run_folder else "onset", "scene.toml"]
        if folder == onset_folder:
            variation = read_variation(command[command.index("--along") + 1], scene)
            wanted = summary["parameter"]
            assert (variation.key, variation.unit, list(variation.values)) == tuple(wanted.values())[:3]
            assert float(command[command.index("--within") + 1]) == summary["bistable_range_sought_within"]
            assert "--smallest-disturbance" not in command
        assert all(f">{version}<" in shown.source for version in summary["versions"].values())


def test_a_command_to_be_copied_holds_no_other(onset_folder, report, tmp_path):
    summary = json.loads((onset_folder / "onset.json").read_text())
    summary["parameter"]["key"] = "drum.speed; echo harmed #"
    summary["critical_values"] = []
    (tmp_path / "onset.json").write_text(json.dumps(summary))
    command = shlex.split(report(tmp_path).one("command")["text"])
    assert command[command.index("--along") + 1].startswith("drum.speed; echo harmed #=")


def test_the_command_seeks_the_smallest_disturbance_where_it_was_sought(onset_folder, report, tmp_path):
    summary = json.loads((onset_folder / "onset.json").read_text())
    (tmp_path / "onset.json").write_text(json.dumps(summary | {"smallest_disturbance_sought": True}))
    page = report(tmp_path)
    assert page.one("command")["text"].endswith(" --smallest-disturbance")


def test_every_figure_is_there_in_full_and_in_words(run_folder, run_page):
    figures = [each for each in run_page.all("img") if each["src"].startswith("data:image/png")]
    assert [base64.b64decode(each["src"].partition(",")[2]) for each in figures] == [
        (run_folder / figure_file(name)).read_bytes() for name in FIGURES
    ]
    assert all(re.search(r"\d", each["alt"]) and len(each["alt"]) > 80 for each in figures)
    assert (run_folder / REPORT).stat().st_size < 5e6
    assert f"{(run_folder / REPORT).stat().st_size / 1e6:.2f} MB" in run_page.all("footer")[0]["text"]


# --- what moves and what sounds --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def shoe(run_folder):
    return build_model(read_history(run_folder).scene).shoe


def test_the_modes_move_as_rigid_bodies_with_the_shapes_of_the_eigenvectors(run_folder, run_page, shoe):
    stability = analyse_stability(build_model(read_history(run_folder).scene, coordinates=COORDINATES))
    data = json.loads(run_page.one("animation")["text"])
    assert [mode["label"] for mode in data["modes"]] == [mode.label for mode in stability.modes]
    assert data["modes"][data["first"]]["label"] == "Y"  # which grows fastest
    phases = np.exp(1j * np.linspace(0, 2 * np.pi, 721))
    for shown, mode in zip(data["modes"], stability.modes, strict=True):
        lines = {key: [np.reshape(line[key], (-1, 2)) for line in shown["lines"]] for key in ("at", "re", "im")}
        parts = {key: np.concatenate(each) for key, each in lines.items()}
        moved = parts["re"] + 1j * parts["im"]
        # As far as is told, to the half degree of the phases and the three digits after the point of what is in mm.
        farthest = np.max(np.linalg.norm(np.real(moved[:, :, None] * phases), axis=1))
        assert farthest == pytest.approx(shown["drawn_mm"], abs=2e-3)
        assert shown["flat"] == (mode.name in ("X", "Y", "Tz"))
        if not shown["flat"]:
            continue
        # u = X − y Tz and v = Y + (x − c) Tz at all points: solved for the three of them, in mm and rad.
        x, y, one, zero = *parts["at"].T, np.ones(len(moved)), np.zeros(len(moved))
        lever = x - 1e3 * float(shoe.centroid)
        rows = np.concatenate([np.stack([one, zero, -y], axis=1), np.stack([zero, one, lever], axis=1)])
        found, _, _, _ = np.linalg.lstsq(rows.astype(complex), moved.T.ravel(), rcond=None)
        np.testing.assert_allclose(rows @ found, moved.T.ravel(), rtol=0, atol=1e-3)
        shape = mode.right[[stability.coordinates.index(name) for name in ("X", "Y", "Tz")]]
        lengths = np.array([1.0, 1.0, 100.0])  # mm on the lining for 1 mm, and for 1 rad
        wanted = shown["enlarged"] * shape * [1e3, 1e3, 1.0]
        np.testing.assert_allclose(found * lengths, wanted * lengths, rtol=0, atol=2e-3)


def test_a_point_runs_through_its_ellipse_the_way_it_moves(run_folder):
    # X = cos ωt and Y = −sin ωt, as the real part of (1, i) e^(iωt): the cross at the centre of gravity moves so.
    prepared = prepare(read_history(run_folder).scene)
    names = prepared.stability.coordinates
    shape = np.array([{"X": 1, "Y": 1j}.get(name, 0) for name in names])
    mode = prepared.stability.modes[0]._replace(right=np.concatenate([shape, 0 * shape]))
    (shown,) = moving.animate(prepared, [mode])["modes"]
    cross, size = shown["lines"][-1], shown["drawn_mm"]
    np.testing.assert_allclose(cross["re"], [size, 0, size, 0], rtol=0, atol=1e-3)  # of a circle, as large as is drawn
    np.testing.assert_allclose(cross["im"], [0, size, 0, size], rtol=0, atol=1e-3)


def test_fractions_of_a_mode_are_those_of_its_kinetic_energy(run_folder):
    # X of 1 m, Tz of 20 rad and so little of Y that it is not named, of a shoe of 1 kg or so and some g m².
    prepared = prepare(read_history(run_folder).scene)
    names, mass = prepared.stability.coordinates, prepared.stability.mass
    shape = np.array([{"X": 1, "Y": 0.01, "Tz": 20j}.get(name, 0) for name in names])
    mode = prepared.stability.modes[0]._replace(right=np.concatenate([shape, 0 * shape]))
    (shown,) = moving.animate(prepared, [mode])["modes"]
    translation, rotation = mass[names.index("X")], 400 * mass[names.index("Tz")]
    whole = 1.0001 * translation + rotation
    wanted = {"X": translation / whole, "Tz": rotation / whole}
    assert shown["shares"] == pytest.approx(wanted, rel=1e-12)
    assert list(shown["shares"]) == sorted(wanted, key=lambda name: -wanted[name])


def test_the_size_of_a_mode_is_told_beside_what_it_reached(run_folder, run_page):
    reached = json.loads((run_folder / "summary.json").read_text())["saturation"]["amplitude"]
    data = json.loads(run_page.one("animation")["text"])
    assert data["turns"] == 1  # against the clock, as the drum
    for mode in data["modes"]:
        if not reached.get(mode["name"]):
            assert mode["size"] == "It took no part in the motion after growth."
            continue
        found = re.fullmatch(r"\w+ is drawn ([\d.]+) times as large as the ([\d.]+) µ\w+ that .*", mode["size"])
        assert found is not None
        times, size = map(float, found.groups())
        assert size == pytest.approx(1e6 * reached[mode["name"]], rel=6e-3)  # three digits
        # The named coordinate is 1 m or rad in the eigenvector, which is drawn `enlarged` times.
        assert times * size == pytest.approx(1e6 * mode["enlarged"], rel=1.2e-2)


def test_a_mode_across_the_drum_is_seen_at_a_slant(run_folder, run_page, shoe):
    """A corner of the shoe in Tx: u = (z Ty, −z Tx, Z + y Tx − (x − c) Ty), seen as x − z/2 and y − 0.4 z."""
    mode = json.loads(run_page.one("animation")["text"])["modes"][0]
    assert mode["name"] == "Tx"
    stability = analyse_stability(build_model(read_history(run_folder).scene, coordinates=COORDINATES))
    along, tx, ty = (stability.modes[0].right[stability.coordinates.index(name)] for name in ("Z", "Tx", "Ty"))
    x, y, z = 100 * np.cos(np.radians(65)), 100 * np.sin(np.radians(65)), 36.5 / 2
    u, v, w = z * ty, -z * tx, 1e3 * along + y * tx - (x - 1e3 * float(shoe.centroid)) * ty
    front, corner = mode["lines"][1], slice(2 * 60, 2 * 61)  # the last of 61 points on the outer arc
    np.testing.assert_allclose(front["at"][corner], [x - 0.5 * z, y - 0.4 * z], rtol=0, atol=1e-3)
    found = np.array(front["re"][corner]) + 1j * np.array(front["im"][corner])
    np.testing.assert_allclose(found, mode["enlarged"] * np.array([u - 0.5 * w, v - 0.4 * w]), rtol=0, atol=1e-3)


def sounds(page: Page) -> list[tuple[int, np.ndarray]]:
    found = []
    for element in page.all("audio"):
        assert "autoplay" not in element
        assert "controls" in element
        with wave.open(io.BytesIO(base64.b64decode(element["src"].partition(",")[2]))) as file:
            assert (file.getnchannels(), file.getsampwidth()) == (1, 2)
            found.append((file.getframerate(), np.frombuffer(file.readframes(file.getnframes()), "<i2").astype(float)))
    return found


def test_a_short_record_is_heard_whole_and_of_a_long_one_is_said_which_part():
    assert _played(0.4, None) == _played(0.4, 0.19) == (0.0, 0.4)
    assert _played(RECORD_S, 0.5) == (0.0, RECORD_S)
    # The growth and a fifth of a second of what follows.
    assert _played(10.0, 2.0) == pytest.approx((1.2, 2.2))
    assert _played(10.0, 0.1) == pytest.approx((0.0, 0.3))
    assert _played(10.0, None) == (0.0, 1.0)


def test_the_end_of_a_stop_is_not_heard_again_and_again(folder, report, nominal, monkeypatch):
    """Of a brake that comes to rest there is the record alone, and the modes are of its beginning."""
    assert run_page_module._changes(load_scene(DAMPED.with_name("stop.toml")))
    assert not run_page_module._changes(nominal)
    monkeypatch.setattr(run_page_module, "_changes", lambda scene: True)
    summary = json.loads((folder / "summary.json").read_text()) | {"changing": True}
    (folder / "summary.json").write_text(json.dumps(summary))
    page = report(folder)
    assert len(sounds(page)) == 2
    assert "these hold at the beginning" in page.one("prediction-caption")["text"]
    # Nor is there an error between one time and a mean over many.
    assert "the prediction is for t = 0 s, the mean is that from 0 to" in page.one("growth-caption")["text"]
    table = page.one("growth")["text"]
    assert "at t = 0 s" in table
    assert "mean" in table
    assert "relative error" not in table
    assert "measured" not in table.replace("not measured", "")


def test_what_part_of_the_record_is_heard_is_told(run_page):
    (told,) = [each["text"] for each in run_page.all("figcaption") if "at its own speed" in each["text"]]
    assert told.startswith("The whole record, 0.25 s, at its own speed")


def test_the_squeal_is_heard_at_its_frequency_and_slower(run_folder, run_page, shoe):
    line = json.loads((run_folder / "summary.json").read_text())["saturation"]["main"]["frequency_Hz"]
    played = sounds(run_page)
    assert [rate for rate, _ in played] == [44100, 11025, 44100, 11025]
    for (rate, samples), slow in zip(played, (1, 4, 1, 4), strict=True):
        peak = peak_near(amplitude_spectrum(samples, rate), line / slow, half_width=0.02 * line / slow)
        assert peak is not None
        # What is repeated has lines at the multiples of one over its length alone, of 0.1 to 0.15 s.
        assert peak.frequency_Hz == pytest.approx(line / slow, abs=5.0 / slow)
        assert np.abs(samples).max() == pytest.approx(32767 * 10 ** (-1 / 20), abs=1)  # 1 dB below full scale
    velocity = read_history(run_folder).data["velocity"].sel
    surface = velocity(coordinate="Y") + (0.1 - float(shoe.centroid)) * velocity(coordinate="Tz")
    loudest = [float(each["value"]) for each in run_page.all("data") if "figcaption" in each["inside"]][1::2]
    # Between its samples, 6.8 a period at 7.4 kHz, a motion may reach 10 % more; and its mean is left out.
    assert all(0.9 <= value / float(np.abs(surface).max()) <= 1.1 for value in loudest)


def test_what_does_not_move_has_no_sound(report, nominal, tmp_path, quiet_reply, empty_figures):
    scene = nominal.with_values({"simulate.duration": 0.002, "start.displacement": {}})
    run_job.run_into(prepare(scene), quiet_reply(tmp_path))
    page = report(tmp_path)
    assert page.all("audio") == []
    assert "nothing was started" in page.one("headline")["text"]


# --- runs that did not end well --------------------------------------------------------------------------------------


def test_a_run_that_was_cut_off_says_so_on_top(folder, report):
    summary = json.loads((folder / "summary.json").read_text())
    summary |= {"outcome": "interrupted by the user after t = 0.25 s", "ending": "interrupted"}
    (folder / "history.nc").unlink()  # only to be quicker
    (folder / "summary.json").write_text(json.dumps(summary))
    page = report(folder)
    warning = page.one("warning")
    assert "not complete: interrupted by the user after t = 0.25 s" in warning["text"]
    assert "header" in warning["inside"]


@pytest.mark.thorough
def test_a_history_without_a_summary_is_judged_now(folder, report, run_page):
    (folder / "summary.json").unlink()
    (folder / "phase.png").unlink()
    with h5py.File(folder / "history.nc", "r+") as history:
        history.attrs["outcome"] = "incomplete: the run was killed"
        history.attrs["ending"] = "cut off"
    page = report(folder)
    assert "the run was killed" in page.one("warning")["text"]
    assert "phase.png" in page.source
    # The same numbers, told by the same code from the same samples.
    assert set(page.numbers) == set(run_page.numbers)


def test_a_run_without_samples_shows_its_prediction(folder, report):
    summary = json.loads((folder / "summary.json").read_text())
    summary |= dict.fromkeys(("saturation", "frequency", "accuracy", "integration", "sticking"), None)
    summary |= {"outcome": "failed: the step size collapsed", "ending": "failed"}
    summary["growth"] = {"linear_until_s": 0.0, "edge_reached_s": None, "modes": []}
    (folder / "summary.json").write_text(json.dumps(summary))
    for path in (folder / "history.nc", *folder.glob("*.png")):
        path.unlink()
    page = report(folder)
    assert "failed: the step size collapsed" in page.one("warning")["text"]
    assert {mode["frequency_Hz"] for mode in summary["prediction"]["modes"]} <= set(page.numbers)


def test_a_study_is_shown_in_the_unit_in_which_it_was_asked_for(onset_folder, onset_page):
    page = onset_page
    (critical,) = json.loads((onset_folder / "onset.json").read_text())["critical_values"]
    # Programs read SI, and people what was asked for, to ten digits.
    assert float(page.numbers[critical["value"]]) == pytest.approx(critical["value"] * RPM, rel=1e-9)
    headings = {each["text"].split(",")[-1].strip() for each in page.all("th") if each["text"].startswith("drum.")}
    assert headings == {"rpm"}
    assert page.all("caption")[0]["text"] == "Ranges of drum.speed, rpm (1 rpm is 0.10472 rad/s)"
    values = [each["text"] for each in page.all("th") if each.get("scope") == "row" and "tbody" in each["inside"]]
    assert {"10", "140", "270", "400"} <= set(values)
    assert page.one("command")["text"].count("rpm") == 2
    told = " ".join(each["alt"] for each in page.all("img"))
    assert "from 10 rpm to 400 rpm" in told
    animation = json.loads(page.one("animation")["text"])
    assert animation["modes"][0]["at"].endswith(" rpm")
    seen = re.sub(r"<script.*?</script>|<pre.*?</pre>", "", page.source, flags=re.DOTALL)
    assert seen.count("rad/s") == 3  # in the captions alone
    assert "drum.<wbr>speed, rpm</th>" in page.source  # a long key goes on in the next line


def test_a_range_goes_into_the_command_in_its_unit_only_where_that_gives_the_same_values(nominal):
    asked = read_variation("drum.speed=10 rpm..400 rpm x4", nominal)
    assert onset_page_module._range(asked, nominal) == "drum.speed=10 rpm..400 rpm x4"
    in_si = f"drum.speed={asked.first!r}..{asked.last!r}x4"
    assert onset_page_module._range(asked._replace(size=1.0), nominal) == in_si
    assert onset_page_module._range(asked._replace(given="fathoms"), nominal) == in_si


def test_a_noise_matrix_is_a_page_with_a_row_for_each_cell(report, tmp_path):
    """One cell squeals after a large disturbance, one is undecided at its end; the other numbers are not reported."""
    numbers = dict.fromkeys(("small_frequency_Hz", "small_velocity_m_per_s", "time_s", "speed_rad_per_s"), np.nan)
    loud = {"frequency_Hz": 950.7, "velocity_m_per_s": 1.2, "level_dB": 181.6, "after": "large, along Y"}
    still = {"frequency_Hz": np.nan, "velocity_m_per_s": np.nan, "level_dB": np.nan, "after": None}
    common = {"unstable": False, "growth_rate_1_per_s": -15.5} | numbers
    cells = [
        {"levels": {"drum.speed": "15"}, "verdict": "squeals", "outcome": "computed", **loud, **common},
        {"levels": {"drum.speed": "60"}, "verdict": "undecided at its end", "outcome": "it falls", **still, **common},
    ]
    counts = {"squeal": 1, "squeal_after_large_only": 1, "not_clear": 1}
    found = NoiseMatrix.model_validate({"title": TITLE, "axes": {"drum.speed": ["15", "60"]}, "cells": cells, **counts})
    (tmp_path / "matrix.json").write_text(to_json(found))
    made = report(tmp_path)
    assert made.one("headline")["text"] == f"{found.headline}."
    assert "1 of 2 cells squeal, 1 of them after a large disturbance only; 0 are quiet, 1 not clear" in found.headline
    assert {950.7: "950.7", 181.6: "181.6", -15.5: "−15.5"}.items() <= made.numbers.items()
    assert "undecided at its end: it falls" in made.source
    assert "nan" not in made.source.partition("<main")[2].partition("<dialog")[0].lower()
    assert "<script>document" not in made.source  # what a table names is escaped


def test_a_table_without_its_summary_is_refused(onset_folder, drumsqueal, tmp_path):
    shutil.copy(onset_folder / "onset.csv", tmp_path)
    status, _, errors = drumsqueal("report", str(tmp_path))
    assert (status, errors.count("\n")) == (2, 1)
    assert "there is onset.csv, but no onset.json" in errors


def test_a_study_that_was_cut_off_says_what_was_asked_and_predicted(onset_folder, report, tmp_path):
    whole = json.loads((onset_folder / "onset.json").read_text())
    done = [each for each in whole["values"] if each["asked"]][:3]
    cut = {"outcome": "cut off", "verdict": None, "warnings": [], "ranges": [], "values": done, "cycles": None}
    (tmp_path / "onset.json").write_text(json.dumps(whole | cut))
    page = report(tmp_path)
    assert "not complete" in page.one("warning")["text"]
    (critical,) = whole["critical_values"]
    assert page.one("headline")["text"] == (
        "3 of 4 values of drum.speed from 10 to 400 rpm are done: it squeals at 1 of them, it is bistable at 1 "
        "of them, it is stable at 1 of them. By the eigenvalues Y gains stability as the value rises past "
        f"{RPM * critical['value']:.6g} rpm "
        f"({critical['frequency_Hz'] / 1e3:.3g} kHz)."
    )
    assert page.all("h1")[0]["text"] == whole["scene"]["title"]
    assert page.one("command")["text"].startswith("drumsqueal onset scene.toml")
    assert page.one("animation")
    assert "cut off before it was drawn" in page.one("missing")["text"]
    assert not [each for each in page.elements if each.get("id") == "ranges"]
    # A whole study without its figure is not called cut off.
    (tmp_path / "onset.json").write_text(
        json.dumps(whole | {"cycles": {"branches": [], "steady_sliding_stable": [], "steady_sliding_unstable": []}})
    )
    page = report(tmp_path)
    assert "or the figure was removed" in page.one("missing")["text"]
    assert page.one("command")["text"].endswith(" --cycles")


def test_why_a_figure_is_missing(folder, report):
    """Nothing but the outcome and the file to resume from are looked at."""
    (folder / "frequency.png").unlink()
    (folder / "history.nc").unlink()  # only to be quicker
    assert "too little motion" in report(folder).one("missing")["text"]
    (folder / "resume.json").write_text("{}")
    page = report(folder)
    assert page.one("missing")["text"] == (
        "Not in the folder: frequency.png. The run was cut off before they were drawn."
    )
    assert "--resume continues" in page.one("warning")["text"]
    summary = json.loads((folder / "summary.json").read_text())
    summary |= {"outcome": "interrupted by the user after t = 0.02 s", "ending": "interrupted"}
    (folder / "summary.json").write_text(json.dumps(summary))
    page = report(folder)
    assert "interrupted by the user after t = 0.02 s" in page.one("missing")["text"]
    assert "too little" not in page.one("missing")["text"]


def test_a_run_that_ends_sticking_says_so(folder, report):
    summary = json.loads((folder / "summary.json").read_text())
    summary["sticking"] = {"share": 0.1, "spells": 1, "first_s": 0.2, "to_the_end_from_s": 0.2}
    (folder / "summary.json").write_text(json.dumps(summary))
    (folder / "history.nc").unlink()  # only to be quicker
    page = report(folder)
    headline = page.one("headline")["text"]
    assert headline == "The brake squeals until, from 0.2 s on, the whole lining sticks to the drum."
    told = {each["id"]: each["alt"] for each in page.all("img")}
    assert "sticks" in told["figure-4"]  # phase
    assert "Grey" not in told["figure-5"]  # of what is not seen in the figure of the contact
    assert "sticks in the end" in page.source


def test_modes_of_another_version_are_not_shown_as_those_of_the_run(folder, report):
    summary = json.loads((folder / "summary.json").read_text())
    summary["prediction"]["modes"][2]["frequency_Hz"] *= 1.001
    (folder / "history.nc").unlink()  # only to be quicker
    (folder / "summary.json").write_text(json.dumps(summary))
    page = report(folder)
    assert "differ from those of the run" in page.source
    assert not [each for each in page.elements if each.get("id") == "animation"]


# --- wrong requests --------------------------------------------------------------------------------------------------


def without(data, *path):
    *inner, last = path
    for key in inner:
        data = data[key]
    del data[last]


@pytest.mark.parametrize(
    ("path", "told"),
    [
        (("prediction", "modes", 0, "frequency_Hz"), "prediction.modes.0.frequency_Hz: field required"),
        (("growth", "edge_reached_s"), "growth.edge_reached_s: field required"),
        (("versions",), "versions: field required"),
        (("scene", "shoe", "width"), "the scene in it is not one that this version of drumsqueal takes"),
    ],
)
def test_a_summary_of_another_version_is_refused_in_one_line(folder, drumsqueal, path, told):
    summary = json.loads((folder / "summary.json").read_text())
    without(summary, *path)
    (folder / "summary.json").write_text(json.dumps(summary))
    status, printed, errors = drumsqueal("report", str(folder))
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert told in errors
    assert not (folder / REPORT).exists()


@pytest.mark.parametrize(
    ("break_it", "told"),
    [
        (lambda folder: (folder / "summary.json").write_text("{"), "summary.json is damaged"),
        (lambda folder: (folder / "summary.json").write_text("[1]"), "summary.json: the whole of it"),
        (lambda folder: (folder / "summary.json").write_bytes(b"\xff\xfe"), "summary.json is damaged"),
        (lambda folder: (folder / "history.nc").write_text("a,b"), "not NetCDF-4"),
        (lambda folder: (folder / "phase.png").write_text("<svg>"), "phase.png is not a PNG"),
        (lambda folder: (folder / "onset.csv").write_text("kind\n"), "holds the results of run and onset"),
        (lambda folder: [path.unlink() for path in folder.iterdir()], "does not hold a run"),
        (lambda folder: shutil.rmtree(folder), "not there"),
        (lambda folder: (folder / REPORT).write_text("mine"), "report.html exists; add --overwrite"),
        (lambda folder: (folder / REPORT).mkdir(), "report.html is a folder"),
    ],
)
def test_wrong_folders_are_refused_in_one_line(folder, drumsqueal, break_it, told):
    break_it(folder)
    before = sorted(folder.iterdir()) if folder.exists() else None
    status, printed, errors = drumsqueal("report", str(folder))
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert told in errors
    assert (sorted(folder.iterdir()) if folder.exists() else None) == before


def test_summary_and_history_must_be_of_one_run(folder, drumsqueal):
    summary = json.loads((folder / "summary.json").read_text())
    summary["scene"]["drum"]["speed"] = 6.0
    (folder / "summary.json").write_text(json.dumps(summary))
    status, _, errors = drumsqueal("report", str(folder))
    assert (status, errors.count("\n")) == (2, 1)
    assert "are of different scenes" in errors


@pytest.mark.parametrize("content", ["a,b\n1,2\n", "", "\0"])
def test_a_table_that_is_none_is_refused(drumsqueal, tmp_path, content):
    (tmp_path / "onset.csv").write_text(content)
    status, _, errors = drumsqueal("report", str(tmp_path))
    assert (status, errors.count("\n")) == (2, 1)
    assert "onset.csv" in errors


def test_the_page_goes_where_it_is_wanted(folder, drumsqueal, tmp_path):
    file = tmp_path / "elsewhere.html"
    (folder / "history.nc").unlink()  # only to be quicker
    assert drumsqueal("report", str(folder), "-o", str(file))[0] == 0
    assert not (folder / REPORT).exists()
    assert drumsqueal("report", str(folder), "-o", str(file))[0] == 2
    status, printed, _ = drumsqueal("report", str(folder), "-o", str(file), "--overwrite", "--json", "-")
    told = json.loads(printed)
    assert (status, told["page"], told["bytes"]) == (0, str(file), file.stat().st_size)
    assert told["finding"].startswith("The brake squeals")
    assert drumsqueal("report", str(folder), "-o", str(tmp_path / "no folder" / "a.html"))[0] == 2
    assert REPORT in RUN_FILES  # and so goes when the folder is run into anew
    assert REPORT in FILES["onset"]


# --- for everybody, and from nowhere ---------------------------------------------------------------------------------


def test_ids_labels_headings_and_tables_are_in_order(made):
    ids = [each["id"] for each in made.elements if "id" in each]
    assert len(ids) == len(set(ids))
    for element in made.elements:
        for key in ("aria-labelledby", "aria-describedby", "for", "data-figure"):
            assert set(element.get(key, "").split()) <= set(ids), element
        if element["tag"] == "a" and element["href"].startswith("#"):
            assert element["href"][1:] in ids
    # The heading of the dialog stands last, in the page's own order.
    levels = [int(each["tag"][1]) for each in made.all("h1", "h2", "h3", "h4")]
    assert levels.count(1) == 1
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in itertools.pairwise(levels))
    assert all(each["alt"] for each in made.all("img") if each["id"] != "zoomed")
    labelled = {each["for"] for each in made.all("label") if "for" in each}
    for control in made.all("input"):
        assert control.get("id") in labelled or "label" in control["inside"]
    assert all(each["text"].strip() for each in made.all("button", "legend", "caption", "h2", "h3", "title", "a"))
    assert len(made.all("caption")) == len(made.all("table")) > 0
    assert all(each.get("scope") in ("col", "row", "colgroup") for each in made.all("th"))
    assert made.all("html")[0]["lang"] == "en"
    assert [len(made.all(tag)) for tag in ("main", "header", "footer", "nav", "dialog")] == [1] * 5
    assert made.all("a")[0]["href"] == "#main"
    assert not [each for each in made.elements if "style" in each or any(key.startswith("on") for key in each)]


def test_nothing_is_asked_of_the_network(made):
    for element in made.elements:
        for key in ("src", "href", "srcset", "action", "data", "poster", "xlink:href"):
            assert element.get(key, "data:").startswith(("data:", "#")), element
    (style,) = made.all("style")
    assert "url(" not in style["text"]
    assert "@import" not in style["text"]
    # A name of a namespace is no address.
    addresses = set(re.findall(r"https?://[^\s\"'<>]*", made.source))
    assert addresses <= {"http://www.w3.org/2000/svg"}


def test_the_policy_allows_what_is_ours_and_nothing_else(made):
    (policy,) = [each["content"] for each in made.all("meta") if each.get("http-equiv") == "Content-Security-Policy"]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert rules["img-src"] == rules["media-src"] == "data:"
    scripts = [each["text"] for each in made.all("script") if each.get("type") != "application/json"]
    for texts, rule in ((scripts, "script-src"), ([each["text"] for each in made.all("style")], "style-src")):
        (text,) = texts
        assert rules[rule] == f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def test_what_a_title_says_is_text(run_page):
    page = run_page
    assert page.all("h1")[0]["text"] == TITLE
    assert page.all("title")[0]["text"].startswith(TITLE)
    assert len(page.all("script")) == 2  # ours, and the shapes of the modes
    assert not [each for each in page.elements if "onerror" in each]


def test_colours_stand_out_in_light_and_in_dark():
    """Contrast by the Web Content Accessibility Guidelines 2.2: 4.5 for text, 3 for what is drawn."""
    style = (Path(page.__file__).parent / "style.css").read_text()
    light, dark = (
        dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6})", block))
        for block in re.findall(r":root \{(.*?)\}", style, re.DOTALL)[:2]
    )
    assert light.keys() == dark.keys()

    def brightness(colour):
        parts = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
        return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]

    def contrast(a, b):
        low, high = sorted((brightness(a), brightness(b)))
        return (high + 0.05) / (low + 0.05)

    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)  # a known one
    for colours in (light, dark):
        for ink in ("ink", "quiet", "link"):
            assert contrast(colours[ink], colours["paper"]) >= 4.5
            assert contrast(colours[ink], colours["raised"]) >= 4.5
        assert contrast(colours["warn-ink"], colours["warn"]) >= 4.5
        assert contrast(colours["shoe"], colours["paper"]) >= 3
        assert contrast(colours["shoe"], colours["drum"]) >= 3
        assert contrast(colours["drum-ink"], colours["drum"]) >= 3


# --- in a browser ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser():
    with Browser() as started:
        yield started


@chromium
@pytest.mark.parametrize(("width", "height"), [(390, 844), (1280, 900), (320, 640)])
@pytest.mark.parametrize("which", ["run", "onset"])
def test_it_fits_every_window(browser, run_folder, onset_folder, which, width, height):
    folder = run_folder if which == "run" else onset_folder
    browser.open(folder / REPORT, width=width, height=height)
    assert browser.evaluate("innerWidth") == width
    assert browser.evaluate("document.documentElement.scrollWidth <= innerWidth")
    if width < 1280:
        touched = "[...document.querySelectorAll('button, .choice, nav a')].filter(each => each.offsetHeight)"
        assert browser.evaluate(f"{touched}.every(each => each.offsetHeight >= 24)")
    assert browser.messages == []
    assert {address.partition(":")[0] for address in browser.requests} <= {"file", "data"}
    assert browser.evaluate("document.documentElement.dataset.harmed ?? 'unharmed'") == "unharmed"


@chromium
def test_a_figure_is_enlarged_and_put_away_by_keyboard(browser, run_folder):
    browser.open(run_folder / REPORT)
    browser.evaluate("document.querySelectorAll('.enlarge')[1].focus()")
    browser.press("Enter", 13, "\r")
    assert browser.evaluate("document.getElementById('zoom').open")
    assert browser.evaluate("zoomed.alt === document.getElementById('figure-2').alt && zoomed.naturalWidth") == 1338
    assert browser.evaluate("document.getElementById('zoom-title').textContent") == "Spectrogram"
    before = browser.evaluate("zoomed.clientWidth")
    browser.evaluate("document.getElementById('larger').focus()")
    browser.press("Enter", 13, "\r")
    assert browser.evaluate("zoomed.clientWidth") == pytest.approx(1.5 * before, abs=2)
    assert browser.evaluate("pane.scrollWidth > pane.clientWidth")
    browser.press("Escape", 27)
    browser.until("!document.getElementById('zoom').open")
    assert browser.evaluate("document.activeElement === document.querySelectorAll('.enlarge')[1]")


@chromium
def test_modes_are_chosen_and_stopped_by_keyboard(browser, run_folder):
    browser.open(run_folder / REPORT)
    moving = "document.querySelector('#now polyline').getAttribute('points')"
    assert browser.evaluate("document.getElementById('play').textContent") == "Pause"
    before = browser.evaluate(moving)
    browser.until(f"{moving} !== {json.dumps(before)}")
    browser.evaluate("document.getElementById('play').focus()")
    browser.press(" ", 32, " ")
    assert browser.evaluate("document.getElementById('play').textContent") == "Play"
    before = browser.evaluate(moving)
    browser.evaluate("document.querySelector('input[name=mode]:checked').focus()")
    browser.press("ArrowDown", 40)
    assert browser.evaluate("document.querySelector('input[name=mode]:checked').value") == "3"
    assert "Mode X: 4392 Hz" in browser.evaluate("document.getElementById('mode-text').textContent")
    assert browser.evaluate(moving) != before
    assert browser.messages == []


@chromium
def test_what_one_prefers_is_respected(browser, run_folder):
    quiet = {"prefers-reduced-motion": "reduce", "prefers-color-scheme": "dark"}
    browser.open(run_folder / REPORT, features=quiet)
    assert browser.evaluate("document.getElementById('play').textContent") == "Play"
    assert browser.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 26)"
    browser.open(run_folder / REPORT)
    assert browser.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"


@chromium
def test_the_sounds_can_be_played(browser, run_folder, run_page):
    browser.open(run_folder / REPORT)
    browser.until("[...document.querySelectorAll('audio')].every(each => each.readyState > 0 || each.error)")
    lengths = browser.evaluate("[...document.querySelectorAll('audio')].map(each => each.duration)")
    played = [samples.size / rate for rate, samples in sounds(run_page)]
    assert lengths == pytest.approx(played, abs=1e-3)
    assert browser.evaluate("[...document.querySelectorAll('audio')].every(each => each.paused)")


def test_the_lines_of_stable_modes_are_not_called_unstable(run_folder):
    data = json.loads((run_folder / "summary.json").read_text())
    for mode in data["prediction"]["modes"]:
        mode["unstable"] = mode["name"] == "Y"
    told = figure_words("spectrogram", RunFindings.model_validate(data))[1]
    unstable, stable = re.search(r"modes that move: unstable (.*?); stable (.*?)\.", told).groups()  # pyright: ignore
    assert re.fullmatch(r"Y \d+ Hz", unstable)
    assert re.fullmatch(r"X \d+ Hz, Tz \d+ Hz", stable)
