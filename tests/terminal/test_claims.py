"""Of two commands that would write into one folder, or one file, at once, the second is refused and changes nothing."""

import errno
import os
import signal
import subprocess
from pathlib import Path

import pytest

from drumsqueal.errors import RequestError
from drumsqueal.files import claims
from drumsqueal.files.claims import LOCK, claim_file, claim_folder, claim_results, claims_released
from processes import communicate, held, next_line, posix, start, wait_until, watched

pytestmark = posix
NOMINAL = str(Path(__file__).parents[2] / "scenarios" / "nominal.toml")
SHORT = ("--set", "simulate.duration=0.001")
ROUNDS, TOGETHER = 20, 4
# In each round it claims when all are there, holds that until all have tried, and says whether it got it.
RACE = """
import sys
from pathlib import Path
from drumsqueal.errors import RequestError
from drumsqueal.files.claims import claim_file, claim_folder, claims_released
kind, goal, meet, mine, rounds, count = *sys.argv[1:5], *map(int, sys.argv[5:])
def meet_at(name):
    (Path(meet) / f"{name}-{mine}").touch()
    while len(list(Path(meet).glob(f"{name}-*"))) < count:
        pass
for k in range(rounds):
    meet_at(f"begin{k}")
    with claims_released():
        try:
            (claim_folder if kind == "folder" else claim_file)(Path(goal))
            print("got it")
        except RequestError as error:
            print(error)
        meet_at(f"tried{k}")
    meet_at(f"end{k}")
    if Path(goal).parent.parent.exists() and kind == "folder" or Path(goal).exists():
        print("something is left")
    meet_at(f"looked{k}")
"""
HOLD = """
import os, sys, time
from pathlib import Path
from drumsqueal.files import claims
parent = os.getppid()
with claims.claims_released():
    getattr(claims, sys.argv[1])(Path(sys.argv[2]))
    print("held", flush=True)
    while os.getppid() == parent:
        time.sleep(0.1)
"""


def test_a_share_in_a_folder_is_no_claim_of_it(tmp_path):
    with claims_released():
        claim_results(tmp_path)
        claim_results(tmp_path)  # which may be shared, also with oneself
        with pytest.raises(RequestError, match="is in use by"):
            claim_folder(tmp_path)
    with claims_released():
        claim_folder(tmp_path)
        claim_folder(tmp_path)
        claim_results(tmp_path)  # who has it alone may read it, too
    assert not (tmp_path / LOCK).exists()


@pytest.fixture
def begin(cache):
    """Start a process that lasts until the test ends at the longest."""
    begun: list[subprocess.Popen] = []

    def begin_one(*arguments: str, code: str) -> subprocess.Popen:
        begun.append(start(cache, *arguments, code=code))
        return begun[-1]

    yield begin_one
    for process in begun:
        with process:  # which closes its pipes
            process.kill()


@pytest.fixture
def hold(begin):
    """Have another process claim something, until the test ends."""

    def claim(kind: str, path: Path) -> subprocess.Popen:
        process = begin(kind, str(path), code=HOLD)
        assert next_line(process.stdout) == "held\n"
        return process

    return claim


@pytest.mark.thorough  # what may happen between two of them is played by itself in tests below
@pytest.mark.parametrize("kind", ["folder", "file"])
def test_of_many_at_once_one_gets_it_and_nothing_is_left(begin, tmp_path, kind):
    goal, meet = tmp_path / "goal" / "deep" / "out" if kind == "folder" else tmp_path / "a.csv", tmp_path / "meet"
    meet.mkdir()
    counts = (str(ROUNDS), str(TOGETHER))
    begun = [begin(kind, str(goal), str(meet), str(k), *counts, code=RACE) for k in range(TOGETHER)]
    # Where one fails the others wait for it in vain.
    wait_until(lambda: None not in (ends := [process.poll() for process in begun]) or any(ends))
    assert [process.poll() for process in begun] == [0] * TOGETHER
    answers = [communicate(process)[0].splitlines() for process in begun]
    for found in zip(*answers, strict=True):
        assert found.count("got it") == 1, found
        assert sum(told.startswith(f"{goal} is in use by ") for told in found) == TOGETHER - 1, found
    assert len(answers[0]) == ROUNDS
    assert [path.name for path in tmp_path.iterdir()] == ["meet"]


@pytest.mark.thorough
def test_two_runs_started_together_do_not_mix(begin, tmp_path):
    folder, there, go = tmp_path / "out", tmp_path / "there", tmp_path / "go"
    short = ("run", NOMINAL, "-o", str(folder), "-q", *SHORT)
    # Whoever has the folder does not go on before the other one, be it late, has been refused or has it, too.
    there.mkdir()
    begun = [
        begin(*short, *more, code=watched("drumsqueal.terminal.reply:Reply", "with_folder", held(there / name, go)))
        for name, more in (("plain", ()), ("overwriting", ("--overwrite",)))
    ]
    wait_until(lambda: len(list(there.iterdir())) + sum(process.poll() is not None for process in begun) == 2)
    go.touch()
    ended = [(communicate(process)[1], process.returncode) for process in begun]
    assert sorted(status for _, status in ended) == [0, 2]
    refused = next(errors for errors, status in ended if status == 2)
    assert refused.count("\n") == 1
    assert f"{folder} is in use by drumsqueal run, process " in refused
    assert "wait until it has ended, or choose another folder with -o" in refused
    assert (folder / "summary.json").exists()
    assert not (folder / LOCK).exists()


WRITERS = {
    "run": (NOMINAL,),
    "run --overwrite": (NOMINAL, "--overwrite"),
    "run --resume": (NOMINAL, "--resume"),
    "onset": (NOMINAL, "--along", "drum.speed=1..9"),
    "sweep": (NOMINAL, "--vary", "drum.speed=1..9"),
    "cycle": (NOMINAL,),
    "sensitivity": (NOMINAL,),
    "accuracy": (NOMINAL,),
    "effects": (NOMINAL,),
    "paper": (),
    "motion": (NOMINAL,),
    "fit": (NOMINAL, "rig.wav", "--vary", "contact.stiffness"),
}


@pytest.fixture(scope="module")
def in_use(cache, tmp_path_factory):
    """A folder that another process has, with what it has written so far."""
    folder = tmp_path_factory.mktemp("claimed") / "out"
    with start(cache, "claim_folder", str(folder), code=HOLD) as process:
        try:
            assert next_line(process.stdout) == "held\n"
            (folder / "history.nc.part").write_text("half written by the other")
            yield folder
        finally:
            process.kill()


@pytest.mark.parametrize("command", WRITERS)
def test_a_folder_in_use_is_refused_and_stays_as_it_is(drumsqueal, in_use, command):
    folder = in_use
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    status, printed, errors = drumsqueal(command.split()[0], *WRITERS[command], "-o", str(folder))
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert f"{folder} is in use by " in errors
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_what_a_command_writes_is_not_read_or_added_to(drumsqueal, tmp_path, hold):
    folder, beside = tmp_path / "out", tmp_path / "beside"
    hold("claim_folder", folder)
    beside.mkdir()
    (folder / "history.nc").write_text("half written by the other")
    before = sorted(folder.iterdir())
    for arguments in (
        ("report", str(folder)),
        ("report", str(folder), "-o", str(beside / "page.html")),
        ("export", str(folder), "--to", "csv"),
        ("export", str(folder / "history.nc"), "--to", "csv", "-o", str(beside / "a.csv")),
        ("animate", str(folder), "-o", str(beside / "a.gif")),
        ("compare", str(folder), str(beside), "-o", str(beside / "compared")),
        ("scenes", "nominal", "-o", str(folder / "a.toml")),
        ("stability", NOMINAL, "--json", str(folder / "a.json")),
    ):
        status, _, errors = drumsqueal(*arguments)
        assert (status, errors.count("\n")) == (2, 1)
        assert f"{folder} is in use by " in errors
        assert "wait until it has ended, or " in errors
        assert (sorted(folder.iterdir()), list(beside.iterdir())) == (before, [])


def test_files_beside_one_another_are_written_at_once_the_same_one_is_not(drumsqueal, tmp_path, hold):
    hold("claim_file", tmp_path / "a.toml")
    status, _, errors = drumsqueal("scenes", "nominal", "-o", str(tmp_path / "a.toml"))
    assert (status, f"{tmp_path / 'a.toml'} is in use by " in errors) == (2, True)
    assert drumsqueal("scenes", "nominal", "-o", str(tmp_path / "b.toml"))[0] == 0
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path))  # which would clear the folder
    assert (status, f"{tmp_path} is in use by " in errors) == (2, True)


def test_a_fraction_in_a_folder_waits_for_a_neighbour_that_gives_up_its_own(tmp_path, monkeypatch):
    # Which has the folder alone while it removes the lock; a claim to have it alone is refused at once.
    assert claims.fcntl is not None
    flock, waited = claims.fcntl.flock, []
    monkeypatch.setattr(claims.time, "sleep", waited.append)

    def refused_twice(descriptor: int, how: int) -> None:
        if how & claims.fcntl.LOCK_SH and len(waited) < 2:
            raise BlockingIOError(errno.EWOULDBLOCK, "")
        flock(descriptor, how)

    monkeypatch.setattr(claims.fcntl, "flock", refused_twice)
    with claims_released():
        claim_file(tmp_path / "a.csv")
        assert len(waited) == 2
    descriptor = os.open(tmp_path / LOCK, os.O_RDWR | os.O_CREAT)
    flock(descriptor, claims.fcntl.LOCK_EX)
    for claim in (claim_folder, lambda place: claim_file(place / "a.csv")):
        with pytest.raises(RequestError, match="in use"):
            claim(tmp_path)
    assert len(waited) == 2 + 4  # none of them by the first, which wants it alone
    os.close(descriptor)


def test_a_program_that_was_killed_has_no_claim(drumsqueal, tmp_path, hold):
    process = hold("claim_folder", tmp_path)
    with pytest.raises(RequestError, match="in use"):
        claim_folder(tmp_path)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert (tmp_path / LOCK).exists()
    with claims_released():
        assert claim_folder(tmp_path) == ""
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_request_leaves_neither_folder_nor_lock(drumsqueal, tmp_path):
    folder = tmp_path / "deep" / "out"
    for wrong in (("--set", "simulate.sample_rate=1000"), ("--resume",), ("--json", str(tmp_path / "no" / "a.json"))):
        status, _, _ = drumsqueal("run", NOMINAL, "-o", str(folder), *wrong)
        assert (status, list(tmp_path.iterdir())) == (2, [])


def test_a_lock_that_its_holder_removes_while_another_waits_for_it_is_none(tmp_path, monkeypatch):
    # The other has opened the lock file already when its holder removes it: its lock is then of a file that is gone.
    open_it, first = claims._opened, []

    def opened(lock: Path, *, create: bool) -> int:
        descriptor = open_it(lock, create=create)
        if not first:
            first.append(descriptor)
            lock.unlink()
        return descriptor

    monkeypatch.setattr(claims, "_opened", opened)
    with claims_released():
        claim_folder(tmp_path / "out")
        (claim,) = claims._held.values()
        assert os.path.samestat(os.fstat(claim.descriptor), (tmp_path / "out" / LOCK).stat())


@pytest.mark.parametrize("refused", [errno.ENOLCK, errno.ENOTSUP])
def test_a_file_system_without_locks_is_said_to_be_one(drumsqueal, tmp_path, monkeypatch, refused):
    def no_locks(*_):
        raise OSError(refused, os.strerror(refused))

    assert claims.fcntl is not None
    monkeypatch.setattr(claims.fcntl, "flock", no_locks)
    status, _, errors = drumsqueal("scenes", "nominal", "-o", str(tmp_path / "a.toml"))
    assert status == 0
    assert "its file system has no file locks; make sure that no other command writes there" in errors
    assert [path.name for path in tmp_path.iterdir()] == ["a.toml"]


def test_a_lock_that_is_refused_for_another_reason_stays_with_its_holder(tmp_path, monkeypatch):
    def refuse(code: int) -> None:
        def refused(*_):
            raise OSError(code, os.strerror(code))

        monkeypatch.setattr(claims.fcntl, "flock", refused)

    (tmp_path / LOCK).write_text("of another")
    for code in (errno.EBADF, errno.EINVAL):  # NFS: to lock alone what may only be read
        refuse(code)
        with pytest.raises(OSError, match=os.strerror(code)):
            claim_folder(tmp_path)
    refuse(errno.ENOLCK)
    assert "no file locks" in claim_folder(tmp_path)
    assert (tmp_path / LOCK).read_text() == "of another"


@pytest.mark.parametrize("claim", [claim_folder, claim_results])
def test_who_gives_up_a_claim_leaves_the_lock_of_another_alone(tmp_path, claim):
    with claims_released():
        claim(tmp_path)
        (tmp_path / LOCK).unlink()  # as a script that cleans up does, after which another command has claimed it
        (tmp_path / LOCK).write_text("of another")
    assert (tmp_path / LOCK).read_text() == "of another"


def test_what_is_no_lock_file_is_not_followed(tmp_path):
    os.mkfifo(tmp_path / LOCK)
    with pytest.raises(RequestError, match="not an ordinary file; remove it"):
        claim_folder(tmp_path)
    (tmp_path / LOCK).unlink()
    (tmp_path / LOCK).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match="symbolic links"):
        claim_folder(tmp_path)
    assert not (tmp_path / "elsewhere").exists()


def test_results_are_read_where_nothing_can_be_written(tmp_path, monkeypatch):
    monkeypatch.setattr(claims.os, "access", lambda *_: False)
    with claims_released():
        claim_results(tmp_path)
        assert list(tmp_path.iterdir()) == []
        claim_file(tmp_path / "a.csv")  # which has a share in the folder
        claim_results(tmp_path)
        assert len(claims._held) == 2


@pytest.mark.thorough(but=["at the start"])
@pytest.mark.parametrize(
    ("owner", "name", "loads"),
    [
        # Before JAX is loaded, and so long before anything is compiled or written.
        ("drumsqueal.terminal.reply:Reply", "with_folder", "import sys; sys.modules['jax'] = None"),
        ("drumsqueal.files.output_folder", "write_whole", ""),  # of the first chunk
    ],
    ids=["at the start", "while it integrates"],
)
def test_a_command_that_runs_holds_its_folder(begin, tmp_path, owner, name, loads):
    folder, there, go = tmp_path / "out", tmp_path / "there", tmp_path / "go"
    process = begin("run", NOMINAL, "-o", str(folder), *SHORT, code=f"{loads}\n{watched(owner, name, held(there, go))}")
    wait_until(there.exists, process)
    with pytest.raises(RequestError, match="in use by drumsqueal run, process"):
        claim_folder(folder)
    go.touch()
    _, errors = communicate(process)
    assert (process.returncode, "jax" in errors, folder.exists()) == ((1, True, False) if loads else (0, False, True))
    with claims_released():
        assert claim_folder(folder) == ""
