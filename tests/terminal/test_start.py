"""What a command asks for before it answers: packages that it imports, programs that it traces; and what it shows."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from drumsqueal.files.output_folder import FIGURES, HISTORY, SUMMARY
from drumsqueal.questions.run import answer, drawing, figures
from drumsqueal.simulation import prepare
from processes import PATIENCE, communicate, posix, shown_on, start, wait_until

NOMINAL = str(Path(__file__).parents[2] / "scenarios" / "nominal.toml")
# Each takes a tenth of a second or more to load.
TRACING = {"diffrax", "optimistix", "lineax"}
HEAVY = TRACING | {
    "pint", "dask", "xarray", "pandas", "h5py", "h5netcdf", "matplotlib", "jinja2",
    "scipy.signal", "scipy.stats", "scipy.interpolate", "scipy.optimize", "scipy.io",
}  # fmt: skip
WITH_HISTORY = {"xarray", "pandas", "h5py", "h5netcdf"}
DRAWING = {"matplotlib", "scipy.interpolate", "scipy.optimize"}
# What a command does need of these, once its programs are compiled.
NEEDED = {
    "stability": set(),
    "check": {"scipy.optimize"},  # to tell which of the modes without damping it is that friction overdamps
    "run": WITH_HISTORY | DRAWING | {"scipy.signal", "scipy.stats"},
    "export": WITH_HISTORY,
    "report": WITH_HISTORY | {"jinja2"},
    "compare": WITH_HISTORY | DRAWING | {"scipy.io"},
}
# It says on its standard error what it traced, compiled and imported.
TOLD = """
import os, sys
os.environ["JAX_LOG_COMPILES"] = "1"
from drumsqueal.__main__ import main
main()
print("imported", *sys.modules, file=sys.stderr)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory, cache) -> Path:
    """A folder with a short run, and a sound of it."""
    folder = tmp_path_factory.mktemp("start")
    for arguments in (
        ("run", NOMINAL, "-o", "run", "--set", "simulate.duration=0.08"),
        ("export", "run", "--to", "wav"),
    ):
        process = start(cache, *arguments, folder=folder)
        assert communicate(process)[1] == ""
    return folder


@pytest.mark.thorough
@pytest.mark.parametrize(
    "command",
    [
        ("stability", NOMINAL),
        ("check", NOMINAL),
        ("run", NOMINAL, "-o", "again", "--overwrite", "--set", "simulate.duration=0.08"),
        ("export", "run", "--to", "csv", "--overwrite"),
        ("report", "run", "--overwrite"),
        ("compare", "run", "run/history.wav", "-o", "compared", "--overwrite"),
    ],
    ids=lambda command: command[0],
)
def test_a_second_start_compiles_nothing_and_imports_only_what_it_needs(command, folder, cache):
    communicate(start(cache, *command, folder=folder))
    process = start(cache, *command, folder=folder, code=TOLD)
    _, errors = communicate(process)
    assert process.returncode == 0
    lines = errors.splitlines()
    assert [line for line in lines if "Compiling" in line] == []
    # What NumPy evaluates is traced anew, under the one name `flat`: that takes a tenth of a second, and no program.
    assert {line.split()[2] for line in lines if line.startswith("Finished tracing")} <= {"flat"}
    imported = set(next(line for line in lines if line.startswith("imported")).split())
    assert "jax" in imported
    assert imported & HEAVY <= NEEDED[command[0]]


def test_help_imports_nothing_that_computes():
    code = "import sys; sys.argv[1:] = ['run', '--help']\ntry: from drumsqueal.__main__ import main; main()\n"
    code += "finally: print('imported', *sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert not set(done.stderr.split()) & (HEAVY | {"jax", "equinox", "scipy"})


@posix
def test_a_terminal_shows_a_word_before_anything_that_computes_is_loaded(tmp_path):
    # Were JAX imported before the word, there would be none.
    code = "import sys; sys.modules['jax'] = None\nfrom drumsqueal.__main__ import main; main()"
    import pty  # which Windows has not

    leader, follower = pty.openpty()
    command = [sys.executable, "-c", code, "stability", NOMINAL]
    environment = os.environ | {"TERM": "xterm"}
    with subprocess.Popen(command, stdout=follower, stderr=follower, env=environment) as process:
        os.close(follower)
        shown = shown_on(leader)
        assert process.wait(timeout=PATIENCE) == 1
    assert shown.startswith(b"loading ...")
    assert b"unexpectedly" in shown


# Figures by two processes.


@pytest.fixture(scope="module")
def prepared(nominal):
    return prepare(nominal.with_values({"simulate.duration": 0.004}))


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


ALL = {HISTORY, SUMMARY, *(f"{name}.png" for name in FIGURES if name not in ("spectrogram", "frequency"))}


@pytest.mark.thorough
def test_a_second_process_draws_and_both_together_draw_each_figure_once(prepared, tmp_path, monkeypatch, quiet_reply):
    own, told, heard = [], [], []
    draw, tell, hear = drawing.draw_figure, drawing.Second.tell, drawing.Second.hear

    def draw_with_the_second_at_work(folder, name, figure):
        assert second is not None
        wait_until(lambda: len(told) > 1, second._process)  # at first of the run; else the first one may draw them all
        own.append(name)
        return draw(folder, name, figure)

    def talk(self, thing):
        tell(self, thing)
        told.append(thing)

    def listen(self):
        heard.append(hear(self))
        return heard[-1]

    monkeypatch.setattr(drawing, "draw_figure", draw_with_the_second_at_work)
    monkeypatch.setattr(drawing.Second, "tell", talk)
    monkeypatch.setattr(drawing.Second, "hear", listen)
    monkeypatch.setattr(drawing, "cores", lambda: 2)
    with drawing.second_process() as second:
        assert second is not None
        answer.run_into(prepared, quiet_reply(tmp_path), second=second)
    assert len(heard) > 1  # at first that it is ready
    assert len(own) + len(heard) - 1 == len(FIGURES)
    assert files(tmp_path) == ALL


@pytest.mark.thorough
@pytest.mark.parametrize("program", ["/bin/false", "/nowhere/python"])
def test_where_the_second_process_fails_the_first_one_draws_all(program, prepared, tmp_path, monkeypatch, quiet_reply):
    monkeypatch.setattr(drawing, "cores", lambda: 2)
    monkeypatch.setattr(sys, "executable", program)
    with drawing.second_process() as second:
        answer.run_into(prepared, quiet_reply(tmp_path), second=second)
    assert files(tmp_path) == ALL


class Hanging:
    """A second process that is never ready."""

    def __init__(self):
        self.ended = threading.Event()

    def tell(self, thing):
        pass

    def hear(self):
        self.ended.wait()
        raise EOFError


@pytest.mark.thorough
def test_nobody_waits_for_a_second_process_that_is_not_ready(prepared, tmp_path, quiet_reply):
    second = Hanging()
    answer.run_into(prepared, quiet_reply(tmp_path), second=second)  # pyright: ignore[reportArgumentType]
    second.ended.set()
    assert files(tmp_path) == ALL


class Failing:
    """A second process whose first figure does not fit on the disk."""

    def __init__(self):
        self.told = []

    def tell(self, thing):
        self.told.append(thing)

    def hear(self):
        return OSError(28, "No space left on device", "growth.png")


def test_a_full_disk_is_reported_whoever_finds_it(prepared, tmp_path, monkeypatch, quiet_reply):
    second = Failing()

    def draw_when_the_second_has_a_figure(view):
        wait_until(lambda: len(second.told) > 1)
        return Figure((1, 1))

    monkeypatch.setattr(figures, "_DRAWINGS", dict.fromkeys(FIGURES, draw_when_the_second_has_a_figure))
    with pytest.raises(Exception, match=r"growth\.png: No space left on device"):
        answer.run_into(prepared, quiet_reply(tmp_path), second=second)  # pyright: ignore[reportArgumentType]
