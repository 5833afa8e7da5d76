"""Files that may be anybody's: only ordinary ones of a sane size are opened, and no data that lie in other files."""

import json
import os
import random
import resource
import shutil
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import wavfile

from drumsqueal import compilation
from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.files import history_file
from drumsqueal.files.history_file import read_history
from drumsqueal.files.in_place import variable
from drumsqueal.files.output_folder import EARLIER, FILES, set_aside
from drumsqueal.ordinary import NotOrdinaryError, read_ordinary
from drumsqueal.questions.compare.measured import read_measured
from drumsqueal.scene import SceneError, load_scene
from processes import posix

pytestmark = posix
NOMINAL = str(Path(__file__).parents[2] / "scenarios" / "nominal.toml")
SEED, FLIPS = 11, 60


@pytest.fixture(scope="module")
def ran(tmp_path_factory, nominal, quiet_reply, empty) -> Path:
    """The folder of a short run, its figures empty."""

    from drumsqueal.questions.run.answer import run_into
    from drumsqueal.simulation import prepare

    folder = tmp_path_factory.mktemp("ran")
    with pytest.MonkeyPatch.context() as patch:
        empty(patch)
        run_into(prepare(nominal.with_values({"simulate.duration": 0.01})), quiet_reply(folder))
    return folder


@pytest.fixture
def folder(ran, tmp_path) -> Path:
    return Path(shutil.copytree(ran, tmp_path / "out"))


# --- what is no ordinary file ---------------------------------------------------------------------------------------


def a_pipe(path: Path) -> None:
    os.mkfifo(path)


def a_device(path: Path) -> None:
    path.symlink_to("/dev/zero")  # which never ends


def a_loop(path: Path) -> None:
    path.symlink_to(path)


def far_too_large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(2**40)  # takes no room


PLACES = (a_pipe, a_device, a_loop, far_too_large, Path.mkdir)


@pytest.mark.parametrize("put", PLACES)
@pytest.mark.parametrize("name", ["summary.json", "history.nc", "growth.png"])
def test_a_report_neither_hangs_nor_reads_on_for_ever(drumsqueal, folder, put, name):
    (folder / name).unlink()
    put(folder / name)
    status, printed, errors = drumsqueal("report", str(folder))
    if put is a_loop and name != "growth.png":  # leads nowhere: it is not there, and the page is without it
        assert status == 0
        return
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert f"{folder / name}: cannot be read (" in errors or (name == "history.nc" and f"{folder / name}" in errors)
    assert not (folder / "report.html").exists()


@pytest.mark.parametrize("put", PLACES)
def test_other_readers_refuse_the_same(drumsqueal, tmp_path, put):
    path = tmp_path / "it.toml"
    put(path)
    with pytest.raises(SceneError, match=r"not an ordinary file|larger than|directory|cannot be read"):
        load_scene(path)
    with pytest.raises(RequestError, match=r"not an ordinary file|larger than|is a folder|no such file"):
        read_measured(path)
    if not path.is_dir():
        with pytest.raises(RequestError, match=r"not an ordinary file|larger than|no such file"):
            read_history(path)
    for command in (("run", str(path), "-o", str(tmp_path / "a")), ("export", str(path), "--to", "csv")):
        status, _, errors = drumsqueal(*command)
        assert (status, errors.count("\n")) == (2, 1)


@pytest.mark.parametrize("put", [a_pipe, a_device, far_too_large])
def test_a_run_is_not_resumed_from_such(drumsqueal, folder, put):
    (folder / "resume.json").unlink(missing_ok=True)
    put(folder / "resume.json")
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(folder), "--resume", "--set", "simulate.duration=0.01")
    assert (status, errors.count("\n")) == (2, 1)


def test_a_file_is_read_up_to_a_size(tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(b"x" * 100)
    with pytest.raises(NotOrdinaryError, match="larger"):
        read_ordinary(path, 99)
    assert read_ordinary(path, 100) == b"x" * 100


# --- data that lie in other files -----------------------------------------------------------------------------------


def external_storage(file: h5py.File, secret: Path) -> None:
    was = variable(file, "normal_force")
    del file["normal_force"]
    made = file.create_dataset("normal_force", was.shape, "f8", external=[(str(secret), 0, 8 * was.shape[0])])
    made.attrs["DIMENSION_LIST"] = was.attrs["DIMENSION_LIST"]


def external_link(file: h5py.File, secret: Path) -> None:
    with h5py.File(secret, "w") as other:
        other["x"] = np.ones(variable(file, "normal_force").shape)
    del file["normal_force"]
    file["normal_force"] = h5py.ExternalLink(str(secret), "x")


def virtual(file: h5py.File, secret: Path) -> None:
    shape = variable(file, "normal_force").shape
    with h5py.File(secret, "w") as other:
        other["x"] = np.ones(shape)
    layout = h5py.VirtualLayout(shape, "f8")
    layout[:] = h5py.VirtualSource(str(secret), "x", shape)
    del file["normal_force"]
    file.create_virtual_dataset("normal_force", layout)


def soft_link(file: h5py.File, secret: Path) -> None:
    del file["normal_force"]
    file["normal_force"] = h5py.SoftLink("/normal_force")


def a_group_in_itself(file: h5py.File, secret: Path) -> None:
    file["again"] = file["/"]


def beside_the_results(file: h5py.File, secret: Path) -> None:
    file.create_dataset("more", (8,), "f8", external=[(str(secret), 0, 64)])


def more_than_there_is(file: h5py.File, secret: Path) -> None:
    file.create_dataset("more", (2**34,), "f8", chunks=(1024,))


@pytest.mark.parametrize(
    "lead",
    [external_storage, external_link, virtual, soft_link, a_group_in_itself, beside_the_results, more_than_there_is],
)
def test_data_in_other_files_are_not_exported(drumsqueal, folder, tmp_path, lead):
    secret = tmp_path / "secret.bin"
    secret.write_bytes(b"\1" * 10_000)
    with h5py.File(folder / "history.nc", "r+") as file:
        lead(file, secret)
    for command in (("export", str(folder), "--to", "csv"), ("report", str(folder))):
        status, _, errors = drumsqueal(*command)
        assert (status, errors.count("\n")) == (2, 1)
        assert f"{folder / 'history.nc'}: cannot be read (" in errors or "cannot be read (" in errors
    assert not (folder / "history.csv").exists()


def compressed(file: h5py.File) -> None:
    file.create_dataset("more", (2 * 10**6,), "f8", chunks=(10**5,), compression="gzip", data=np.zeros(2 * 10**6))


def test_a_history_that_claims_much_more_than_it_holds_is_refused(folder):
    with h5py.File(folder / "history.nc", "r+") as file:
        compressed(file)
    with pytest.raises(RequestError, match="claims to hold more data"):
        read_history(folder / "history.nc")


def test_what_no_run_writes_brings_about_no_warning(folder):
    with h5py.File(folder / "history.nc", "r+") as file:
        file["more"] = np.zeros(7)  # without dimensions
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        assert read_history(folder / "history.nc").complete
    assert [str(each.message) for each in heard] == []


def test_too_little_memory_is_not_a_damaged_history(drumsqueal, folder, monkeypatch):
    def none_left(*_, **__):
        raise MemoryError

    monkeypatch.setattr(history_file.xarray, "load_dataset", none_left)
    status, _, errors = drumsqueal("export", str(folder), "--to", "csv")
    told = f"too little memory (to read {folder / 'history.nc'})"
    assert (status, told in errors) == (1, True)


# --- faults at random -----------------------------------------------------------------------------------------------


def test_damaged_histories_are_read_or_refused_in_one_line(folder):
    path, faults = folder / "history.nc", random.Random(SEED)
    whole = path.read_bytes()
    for _ in range(FLIPS):
        content = bytearray(whole)
        for _ in range(faults.randrange(1, 8)):
            content[faults.randrange(min(len(content), 2 ** faults.randrange(8, 17)))] ^= 1 << faults.randrange(8)
        path.write_bytes(content[: faults.choice((None, faults.randrange(len(content))))])
        told = ""
        try:
            read_history(path)
        except RequestError as error:
            told = str(error)
        assert not told or (str(path) in told and "\n" not in told)


WRONG = {
    "a frequency of 0": lambda told: told["prediction"]["modes"][0].update(frequency_Hz=0),
    "a negative one": lambda told: told["growth"]["modes"][1].update(predicted_frequency_Hz=-1.0),
    "not a number": lambda told: told["prediction"]["modes"][0].update(damping_ratio=float("nan")),
    "a list": lambda told: told.update(prediction=[]),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_summary_with_what_cannot_be_is_refused(drumsqueal, folder, what):
    told = json.loads((folder / "summary.json").read_text())
    WRONG[what](told)
    (folder / "summary.json").write_text(json.dumps(told))
    status, _, errors = drumsqueal("report", str(folder))
    assert (status, errors.count("\n")) == (2, 1)
    assert f"{folder / 'summary.json'}: " in errors


ROWS = [f"{k / 1000},{k % 7}" for k in range(200)]


@pytest.mark.parametrize(
    ("heading", "more", "told"),
    [
        ("x" * 200_000, [], "a cell is longer than 128 kB in the line that begins 'time (s),xxxx"),
        ("x", [f'0.2,"{"1" * 200_000}"', "0.201,1"], "a cell is longer than 128 kB in the line that begins '0.2,"),
        ("x", ['0.2,"1', *20_000 * ROWS[:1]], "line 202: a quotation mark is missing; correct or remove the line"),
    ],
)
def test_a_field_without_end_is_refused(tmp_path, heading, more, told):
    path = tmp_path / "a.csv"
    path.write_text("\n".join([f"time (s),{heading}", *ROWS, *more]))
    with pytest.raises(RequestError) as caught:
        read_measured(path)
    assert told in str(caught.value)
    assert len(str(caught.value)) < 500


def test_a_sound_beyond_all_numbers_is_refused(tmp_path):
    path = tmp_path / "a.wav"
    wavfile.write(path, 44_100, np.tile([-1e308, 1e308], 1000))
    with pytest.raises(RequestError, match=r"is 1e\+308 without a unit at the most"):
        read_measured(path)


# --- no room --------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_a_disk_that_is_full_is_told_with_the_file(drumsqueal, folder, tmp_path):
    targets = {
        "a.csv": ("export", str(folder), "--to", "csv", "-o"),
        "a.mat": ("export", str(folder), "--to", "mat", "-o"),
        "a.npz": ("export", str(folder), "--to", "npz", "-o"),
        "a.parquet": ("export", str(folder), "--to", "parquet", "-o"),
        "a.uff": ("export", str(folder), "--to", "uff58", "-o"),
        "a.wav": ("export", str(folder), "--to", "wav", "-o"),
        "a.html": ("report", str(folder), "-o"),
        "a.json": ("stability", NOMINAL, "--json"),
        "a.toml": ("scenes", "nominal", "-o"),
    }
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for name, command in targets.items():
        path = tmp_path / name
        resource.setrlimit(resource.RLIMIT_FSIZE, (500, before[1]))  # bytes a file
        try:
            status, _, errors = drumsqueal(*command, str(path))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert (status, errors) == (1, f"drumsqueal: {path} cannot be written (File too large)\n")
    assert {path.name for path in tmp_path.iterdir()} == {"out"}


def test_a_sweep_on_a_full_disk_names_its_file_and_no_error_number(drumsqueal, tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    folder = tmp_path / "out"
    command = ("sweep", NOMINAL, "--vary", "drum.speed=1..9x3", "-o", str(folder))
    folder.mkdir()
    for name in FILES["sweep"]:
        (folder / name).write_text("of value")
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, before[1]))
    try:
        status, _, errors = drumsqueal(*command, "--overwrite")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    told = f"drumsqueal: failed: the disk does not take the results ({folder / 'sweep.nc'}: File too large; "
    assert (status, errors.startswith(told), "Errno" in errors) == (1, True, False)
    assert errors.endswith(f"nothing was kept; the earlier results are in {folder}\n")
    assert {path.name: path.read_text() for path in folder.iterdir()} == dict.fromkeys(FILES["sweep"], "of value")


@pytest.mark.parametrize("error", [IntegrationError("stopped"), RequestError("no"), KeyboardInterrupt()])
@pytest.mark.parametrize("written", [(), ("a",)])
def test_earlier_results_go_when_others_are_complete_and_come_back_when_there_are_none(tmp_path, error, written):
    for name in ("a", "b", "mine"):
        (tmp_path / name).write_text("old")

    @set_aside(tmp_path, ("a", "b", "c"))
    def stops():
        assert {path.name for path in tmp_path.iterdir()} == {"mine", EARLIER}
        for name in written:
            (tmp_path / name).write_text("new")
        raise error

    with pytest.raises(type(error)):
        stops()
    place = tmp_path / EARLIER if written else tmp_path
    assert {name: (place / name).read_text() for name in ("a", "b")} == dict.fromkeys("ab", "old")
    with set_aside(tmp_path, ("a", "b", "c")) as gone:
        assert gone == ["a", "b"]
        (tmp_path / "c").write_text("new")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"mine": "old", "c": "new"}


def test_what_is_no_failure_to_write_is_not_called_one(drumsqueal, monkeypatch):
    def refused(*_):
        raise PermissionError(13, "Permission denied", "/somewhere")

    monkeypatch.setattr("drumsqueal.questions.commands.onset.load_scene", refused)
    assert drumsqueal("stability", NOMINAL)[2] == "drumsqueal: /somewhere: Permission denied\n"


def test_too_little_address_space_is_found_before_jax_is_loaded(drumsqueal, monkeypatch, tmp_path):
    limit = 1_400_000_000
    assert compilation.resource is not None
    monkeypatch.setattr(compilation.resource, "getrlimit", lambda _: (limit, limit))
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path / "out"))
    assert (status, errors.count("\n"), list(tmp_path.iterdir())) == (2, 1, [])
    assert "the address space is limited to 1.4 GB" in errors
    # On three of its cores, of which there may be more, it takes 2.7 GB.
    monkeypatch.setattr(compilation.os, "sched_getaffinity", lambda _: {0, 1, 5}, raising=False)
    monkeypatch.setattr(compilation.resource, "getrlimit", lambda _: (2_690_000_000, 0))
    with pytest.raises(RequestError, match=r"limited to 2\.69 GB, and computing here takes 2\.7 GB"):
        compilation.check_address_space()
    monkeypatch.setattr(compilation.resource, "getrlimit", lambda _: (limit, limit))
    assert "ulimit -v unlimited" in errors
    assert drumsqueal("scenes", "-q")[0] == 0
