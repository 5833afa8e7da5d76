"""Set-up that several test files share."""

import gc
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

# Before NumPy is there: threads of two processes that wait for one another take a processor each.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import pytest
from hypothesis import HealthCheck, settings
from jax._src import compilation_cache as lookups
from jax.experimental.compilation_cache import compilation_cache
from matplotlib.figure import Figure

import drumsqueal.precision  # noqa: F401 - switches it on before any test, also where a file runs alone
from answers import Answers
from drumsqueal import command_line as cli
from drumsqueal import programs, progress
from drumsqueal.compilation import _processor
from drumsqueal.interrupts import noted_interrupts
from drumsqueal.physics.bodies import mode_shapes
from drumsqueal.questions.run import drawing, figures
from drumsqueal.scene import Scene, load_scene
from drumsqueal.terminal.reply import Reply

# Error checks that are compiled in would hide behind NaN, or change what is compiled, were this set from outside.
assert "EQX_ON_ERROR" not in os.environ, "unset EQX_ON_ERROR to run the tests"

# However long an example takes, and however slowly they are drawn: that says how busy the machine is.
settings.register_profile("unhurried", settings.default, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("unhurried")


def pytest_addoption(parser):
    parser.addoption("--optimised", action="store_true", help="compile as for users, which takes three times as long")
    parser.addoption(
        "--within", type=float, metavar="SECONDS", help="start no test later than this; print how many remain"
    )
    parser.addoption("--keep-answers", action="store_true", help="keep what commands answer, see tests/answers.py")
    parser.addoption("--begin-at", metavar="COMMIT", help="first test to run, derived from this hexadecimal number")


def pytest_configure(config):
    seconds = config.getoption("--within")
    # A tenth of the time went into looking for garbage among all that JAX keeps of what it has traced.
    gc.set_threshold(50_000, 20, 100)
    config.stash[DEADLINE] = float("inf") if seconds is None else time.monotonic() + seconds
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a job in the background
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if not config.getoption("--optimised"):
        # Optimising is half of compiling, and this way of compiling loops two fifths of the rest; what programs compute
        # is the same to round-off. XLA reads the flag once, before its first program; JAX before 0.11 knows it.
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} --xla_cpu_use_fusion_emitters=false"
        jax.config.update("jax_disable_most_optimizations", True)
    # Lines that tell a file how far a command has come would be among what it prints, as the machine is busy.
    progress.MOST_SILENT = threading.TIMEOUT_MAX
    # What is printed is as wide as on a terminal.
    os.environ["COLUMNS"] = "80"
    os.environ.pop("FORCE_COLOR", None)


# Markers by the folder of a test: what to run after a change. Slow tests are not among them: `-m slow` runs those.
AREAS = {
    "scene": "scenes",
    "physics": "physics",
    "solve": "physics",
    "hard": "physics",
    "findings": "physics",
    "dynamics": "physics",
}
# Every compiled program is mapped into memory some ten times; Linux ends a process with more than 65,530 such maps.
MAPS, MOST_MAPS = Path("/proc/self/maps"), 20_000
DRAWS = re.compile("animation|axes|axis|colour|draw|figure|frame|painted|picture|report")
# Different programs that a whole tier may compile, in all of its processes: as many as were counted and a twentieth for
# other versions of JAX. Compiling them takes half of the tests' time. Those of processes that tests start do not count.
MOST_PROGRAMS = {"not thorough and not slow": 985, "not slow": 3590}
PROGRAMS: set[str] = set()
DEADLINE, NOT_REACHED = pytest.StashKey[float](), "not reached in time"


@pytest.hookimpl(wrapper=True)  # before and after `-m` selects
def pytest_collection_modifyitems(config, items):
    _keep_quick_ones(items, whole=config.args_source == config.ArgsSource.TESTPATHS)
    for item in items:
        folder = item.path.relative_to(Path(__file__).parent).parts[0]
        if item.get_closest_marker("slow"):
            continue
        item.add_marker(AREAS.get(folder, "commands"))
        if DRAWS.search(f"{item.path.stem} {item.originalname}"):
            item.add_marker("figures")
    yield
    if (commit := config.getoption("--begin-at")) and items:
        first = int(commit, 16) % len(items)
        items[:] = items[first:] + items[:first]


def _keep_quick_ones(items, *, whole: bool) -> None:
    """Parameters that a test marked `thorough(but=[...])` names stay in the default tier; each name has to be one."""
    named, met = set(), set()
    for item in items:
        marker = next(item.iter_markers("thorough"), None)
        quick = marker.kwargs.get("but", ()) if marker else ()
        test = item.nodeid.partition("[")[0]
        named |= {(test, name) for name in quick}
        if hasattr(item, "callspec") and item.callspec.id in quick:
            met.add((test, item.callspec.id))
            item.own_markers.remove(marker)
    if whole and named != met:
        raise pytest.UsageError(f"thorough(but=...) names parameters that do not exist: {sorted(named - met)}")


@pytest.fixture(scope="session", autouse=True)
def _compiled_once(cache):
    """What takes long to compile is compiled once, also where several processes share it."""
    # Where the program keeps its own below a folder of caches.
    jax.config.update("jax_compilation_cache_dir", str(cache / "drumsqueal" / _processor()))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    compilation_cache.reset_cache()  # what was compiled before settled that there is none
    # That cache goes by what is computed; executables go by all of the sources, and every change fills it anew.
    programs.folder = None
    # Of programs that are not kept there few are remembered, and a session has dozens: each was traced time and again.
    programs.MOST_UNTOLD = 64
    get = lookups.get_executable_and_time
    lookups.get_executable_and_time = lambda key, *others: PROGRAMS.add(key) or get(key, *others)
    mode_shapes.folder = cache / "free-modes"  # which goes by the sources that find them


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    if time.monotonic() > item.config.stash[DEADLINE]:
        pytest.skip(NOT_REACHED)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    PROGRAMS.update(getattr(node, "workeroutput", {}).get("programs", ()))


def pytest_sessionfinish(session):
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["programs"] = sorted(PROGRAMS)
    elif session.exitstatus == 0 and len(PROGRAMS) > _most_programs(session.config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter, config):
    left = sum(NOT_REACHED in str(report.longrepr) for report in terminalreporter.stats.get("skipped", []))
    if config.getoption("--within") is not None:
        terminalreporter.write_line(f"{left} tests were {NOT_REACHED}")
    most = _most_programs(config)
    if len(PROGRAMS) > most:
        terminalreporter.write_line(
            f"{len(PROGRAMS)} different programs, where MOST_PROGRAMS allows {most:g}: this fails"
        )
    elif most < float("inf"):
        terminalreporter.write_line(f"{len(PROGRAMS)} different programs of at most {most:g}")


def _most_programs(config) -> float:
    """How many it may be where a whole tier was asked for."""
    whole = config.args_source == config.ArgsSource.TESTPATHS and not config.option.keyword
    return MOST_PROGRAMS.get(config.option.markexpr, float("inf")) if whole else float("inf")


@pytest.fixture(autouse=True, scope="module")
def _few_programs():
    yield
    if MAPS.exists() and MAPS.read_bytes().count(b"\n") > MOST_MAPS:
        jax.clear_caches()


@pytest.fixture(autouse=True)
def _double_precision():
    """Every test starts and ends in double precision, which the import of the package switches on."""
    yield
    assert jax.config.read("jax_enable_x64")


@pytest.fixture(autouse=True)
def _one_process(monkeypatch):
    """A run in this process draws all of its figures itself, as on a single core."""
    monkeypatch.setattr(drawing, "cores", lambda: 1)


@pytest.fixture(scope="session")
def nominal() -> Scene:
    """Return the paper's brake (Seo & Kang 2023, Table 1), as it is shipped."""
    return load_scene(Path(__file__).parents[1] / "scenarios" / "nominal.toml")


@pytest.fixture(scope="session")
def as_kept(request) -> Answers:
    """Compares what a command printed and wrote with what is kept of it."""
    return Answers(keep=request.config.getoption("--keep-answers"))


@pytest.fixture(scope="session")
def cache(request, tmp_path_factory) -> Path:
    """Folder of caches, with the compiled programs that a session's processes share and later sessions find again.

    JAX finds a program by all of its operations, by how it is compiled and by what compiles it, so that a change of the
    sources compiles anew what it changes and nothing else; `pytest --cache-clear` empties the folder.
    """
    kept = getattr(request.config, "cache", None)  # None with `-p no:cacheprovider`
    return tmp_path_factory.mktemp("cache") if kept is None else kept.mkdir("compiled")


@pytest.fixture(scope="session")
def empty() -> Callable[[pytest.MonkeyPatch], None]:
    """Have runs draw empty figures until a patch is undone, where what else they do is tested: it takes nine tenths."""
    drawings = dict.fromkeys(figures._DRAWINGS, lambda view: Figure(figsize=(1, 1)))
    return lambda patch: patch.setattr(figures, "_DRAWINGS", drawings)


@pytest.fixture
def empty_figures(empty, monkeypatch) -> None:
    """Have the runs of a test draw empty figures; by its own patches, which are undone in order."""
    empty(monkeypatch)


@pytest.fixture(scope="session")
def command_tree() -> Any:
    """All commands, made once: that takes 14 ms."""
    return cli.command_tree()


@pytest.fixture(name="drumsqueal")
def _command_line(monkeypatch, capsys, command_tree) -> Callable[..., tuple[int, str, str]]:
    """Run the command line in this process: exit status, standard output, standard error."""
    monkeypatch.setattr(cli, "prepare_environment", lambda: None)  # JAX is imported already
    monkeypatch.setattr(cli, "command_tree", lambda: command_tree)

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["drumsqueal", *arguments])
        status = 0
        try:
            with noted_interrupts():
                cli.main()
        except SystemExit as stop:
            status = int(stop.code or 0)
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


@pytest.fixture(scope="session")
def quiet_reply() -> Callable[[Path], Reply]:
    """How a command answers that prints nothing, and leaves what it writes in a folder."""

    def quietly(folder: Path) -> Reply:
        reply = Reply(True, None, overwrite=False)
        reply.folder = folder
        return reply

    return quietly
