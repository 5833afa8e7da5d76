"""Whatever terminal, pipe or folder a command is started with, it prints all that it has to, or fails and says why."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import check_apart
from drumsqueal.terminal.streams import NARROWEST, prepare_streams
from processes import MAIN, posix

NOMINAL = str(Path(__file__).parents[2] / "scenarios" / "nominal.toml")


@pytest.mark.parametrize(
    ("columns", "kept"),
    [
        *((width, None) for width in ("0", "000", "", "-5", "abc", "8e1", "²", "99999999999999999999", " 80")),
        *((width, str(NARROWEST)) for width in ("1", "10", "23")),
        *((width, width) for width in ("24", "80", "10000")),
    ],
)
def test_what_is_no_width_is_left_out_and_a_narrow_one_is_wide_enough_for_text(columns, kept, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    prepare_streams()
    assert os.environ.get("COLUMNS") == kept


def test_a_letter_that_the_encoding_lacks_is_replaced(monkeypatch):
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, "ascii"))
    prepare_streams()
    sys.stdout.write("R β b, 10³ Hz\n")
    sys.stdout.flush()
    assert written.getvalue() == b"R ? b, 10? Hz\n"


def started(closed: str, *arguments: str, code: str = MAIN) -> subprocess.CompletedProcess:
    """The program, with some of its standard streams closed by the shell."""
    command = ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True)


@posix
@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_no_file_takes_the_number_of_a_closed_stream(closed, tmp_path):
    """Or what is printed would go into it."""
    code = """
import os, sys
from drumsqueal.terminal.streams import prepare_streams
prepare_streams()
with open(sys.argv[1], "w") as file:
    file.write(str(file.fileno() > 2 and None not in (sys.stdout, sys.stderr)))
"""
    started(closed, str(tmp_path / "found"), code=code)
    assert (tmp_path / "found").read_text() == "True"


@posix
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("closed", "arguments", "status", "errors"),
    [
        (">&-", ("--version",), 1, "drumsqueal: standard output is closed; open it, or print nothing with --quiet\n"),
        (">&-", ("--help",), 1, "drumsqueal: standard output is closed; open it, or print nothing with --quiet\n"),
        (">&-", ("scenes", "--json", "-"), 1, "drumsqueal: standard output is closed"),
        (">&-", ("scenes", "--quiet"), 0, ""),
        (">&-", ("check", "nowhere"), 2, "drumsqueal: nowhere: there is no such file"),
        ("2>&-", ("check", "nowhere"), 2, ""),
        ("<&- >&- 2>&-", ("check", "nowhere"), 2, ""),
        pytest.param(
            "2>/dev/full",
            *(("check", "nowhere"), 2, ""),
            marks=pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a device that is full"),
        ),
        ("<&- >&- 2>&-", ("scenes",), 1, ""),
    ],
)
def test_a_closed_stream_fails_where_something_is_printed_to_it(closed, arguments, status, errors):
    found = started(closed, *arguments)
    assert found.returncode == status
    assert found.stderr.startswith(errors)
    assert found.stderr.count("\n") == bool(errors)


@posix
def test_a_folder_that_is_gone_is_named_by_the_file_that_was_to_be_there(monkeypatch, tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with pytest.raises(RequestError, match=r"^copy\.toml: this file cannot be written \(No such file or directory\)"):
        check_apart(Path("copy.toml"), [Path(NOMINAL)])
