"""What the commands share: arguments, options, and how they answer."""

import math
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from drumsqueal.errors import RequestError
from drumsqueal.files.claims import claim_file, claim_folder
from drumsqueal.files.json_file import to_json, write_json
from drumsqueal.files.output_folder import MADE_FILES, check_apart, check_output, check_output_file, clear, unusable
from drumsqueal.scene.quantities import SceneError, parse_quantity, printable
from drumsqueal.scene.shipped import find_scene
from drumsqueal.terminal.completion import complete_scene, complete_setting

UsageError: type[typer.BadParameter] = typer.BadParameter.__mro__[1]  # any misuse; it has no public name of its own
LONGEST = 1000.0  # s, of what is recorded or computed at an option's wish
UNBROKEN = 10_000  # columns where nobody looks on: a sentence then is one line, and no table is cut


def read_folder(text: str) -> Path:
    """A folder's name."""
    if not text:  # which would be the folder one is in
        raise typer.BadParameter("the name of the folder is empty")
    return Path(text)


def read_file(text: str) -> Path:
    """A file's name."""
    if not text:
        raise typer.BadParameter("the name of the file is empty")
    return Path(text)


def output_option(default: str) -> Any:
    """The option -o of a command whose results go to out/`default` without it."""
    told = f"Folder of the results (default: out/{default})."
    return typer.Option("-o", "--output", metavar="DIR", parser=read_folder, help=told)


SceneFile = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE",
        parser=find_scene,
        help="Scene file (TOML), or the name of a shipped scene.",
        show_default=False,
        autocompletion=complete_scene,
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a value of the scene, e.g. drum.speed=3. Repeatable.",
        autocompletion=complete_setting,
    ),
]
Since = Annotated[
    str | None, typer.Option("--from", metavar="TIME", help='From this time of the record on, e.g. "0.1 s".')
]
Until = Annotated[str | None, typer.Option("--until", metavar="TIME", help='Until this time of it, e.g. "200 ms".')]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace results that are there already.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with a run that was cut off.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
JsonFile = Annotated[
    str | None,
    typer.Option("--json", metavar="FILE", help="Write the result as JSON instead of printing; - for standard output."),
]


class Reply:
    """How a command answers: in words on its `console`, or as JSON in their place, or (`--quiet`) not at all.

    What the command writes is claimed for it, until `main` ends.
    """

    _folder, _files = Path(), ()

    def __init__(self, quiet: bool, json_file: str | None, *, overwrite: bool, apart_from: Iterable[Path] = ()) -> None:
        """Raises RequestError where the JSON file cannot be written, is there and is not to be overwritten, or would
        replace one of those that are read and written beside it.
        """
        if json_file == "":
            raise RequestError("--json: the name of the file is empty; write one, or - for standard output")
        self._file, self._quiet = json_file, quiet
        if self._path is not None and not _is_stream(self._path):
            check_apart(self._path, apart_from, option="--json")
            self._claim_file(self._path, overwrite=overwrite, option="--json")
        self.console = make_console(quiet=quiet or json_file is not None)

    @classmethod
    def beside(
        cls,
        folder: Path,
        files: Iterable[str],
        read: Iterable[Path],
        quiet: bool,
        json_file: str | None,
        *,
        overwrite: bool,
    ) -> "Reply":
        """That of a command which reads some files and writes others, of these names, into a folder.

        Raises RequestError where they lie there already and are not to be overwritten, one would replace another, or
        another command is at that folder.
        """
        check_output(folder, files, overwrite=overwrite)
        written = [folder / name for name in files]
        for path in written:
            check_apart(path, read)
        try:
            remark = claim_folder(folder)
        except OSError as error:
            raise unusable(folder, error) from None
        check_output(folder, files, overwrite=overwrite)  # again: another command may just have ended
        reply = cls(quiet, json_file, overwrite=overwrite, apart_from=(*read, *written))
        reply._folder, reply._files = folder, tuple(files)
        reply._remark(remark)
        return reply

    @classmethod
    def with_file(
        cls, file: Path, read: Iterable[Path], quiet: bool, json_file: str | None, *, overwrite: bool
    ) -> "Reply":
        """That of a command which reads some files and writes one. Raises RequestError as `beside` does."""
        check_apart(file, read)
        reply = cls(quiet, json_file, overwrite=overwrite, apart_from=(*read, file))
        reply._claim_file(file, overwrite=overwrite, option="-o")
        return reply

    def clear(self, *, but: Iterable[str] = ()) -> None:
        """Clear the folder of earlier results, `but` for some; say what of it other commands had made of those.

        Raises RequestError where the folder cannot be written.
        """
        made = [name for name in clear(self._folder, self._files, but=but) if name in MADE_FILES]
        if made:  # it will not come again by itself
            self.console.print(f"Removed with the results that they were made of: {', '.join(made)}")

    def _claim_file(self, path: Path, *, overwrite: bool, option: str) -> None:
        check_output_file(path, overwrite=overwrite, option=option)
        try:
            remark = claim_file(path, f"name another file with {option}")
        except OSError as error:
            told = f"{path}: this file cannot be written ({error.strerror or error}); name another with {option}"
            raise RequestError(told) from None
        check_output_file(path, overwrite=overwrite, option=option)  # again: another command may just have ended
        self._remark(remark)

    def _remark(self, remark: str) -> None:
        if remark:
            make_console(stderr=True, quiet=self._quiet).print(f"drumsqueal: {printable(remark)}", soft_wrap=True)

    @property
    def _path(self) -> Path | None:
        return None if self._file in (None, "-") else Path(str(self._file))

    def send(self, data: Any) -> None:
        """Write the summary where it was asked for. Raises OSError."""
        if self._file is None:
            return
        if self._path is None:
            sys.stdout.write(to_json(data))
            sys.stdout.flush()
        elif _is_stream(self._path):
            self._path.write_text(to_json(data), encoding="utf-8")
        else:
            write_json(data, self._path)


def _is_stream(path: Path) -> bool:
    """Whether this is a pipe or a device: what is there is not replaced, but written to."""
    try:
        return path.exists() and not path.is_file() and not path.is_dir()
    except (OSError, ValueError):
        return False


def read_share(text: str, option: str) -> float:
    """A share between 0 and 1 from "1 %" or "0.01"."""
    wrong = f'{option} {text}: write a share between 0 and 100 %, such as "1 %" or 0.01'
    share = _read(text, "", wrong)
    if not 0 < share < 1:
        raise RequestError(wrong)
    return share


def read_time(text: str | None, option: str) -> float | None:
    """A time (s) from "20 ms" or "0.02", which may lie before zero; None where it was not given."""
    return None if text is None else _read(text, "s", f'{option} {text}: write a time such as "0.1 s"')


def read_duration(text: str, option: str) -> float:
    """How long (s) from "20 ms" or "0.02"."""
    wrong = f'{option} {text}: write a time up to {LONGEST:g} s, such as "5 s"'
    time = _read(text, "s", wrong)
    if not 0 < time <= LONGEST:
        raise RequestError(wrong)
    return time


def read_rate(text: str | None, option: str) -> float | None:
    """A rate (Hz), positive, from "20 kHz" or "20000"; None where it was not given."""
    if text is None:
        return None
    wrong = f'{option} {text}: write a rate such as "20 kHz"'
    rate = _read(text, "Hz", wrong)
    if not rate > 0:
        raise RequestError(wrong)
    return rate


def _read(text: str, unit: str, wrong: str) -> float:
    """A finite number in an SI unit; `wrong` is said of what is none."""
    try:
        value = float(text)
    except ValueError:
        try:
            value = float(parse_quantity(text, unit))
        except SceneError as error:
            raise RequestError(f"{wrong} ({error.reason.partition(';')[0]})") from None
    if not math.isfinite(value):
        raise RequestError(wrong)
    return value


def make_console(*, stderr: bool = False, quiet: bool = False) -> Console:
    """A console that shows text as it is: what users write is neither markup nor the name of an emoji.

    Colours and widths are those of a terminal that is one; into a file or a pipe, lines are not broken.
    """
    console = Console(stderr=stderr, highlight=False, markup=False, emoji=False, quiet=quiet)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = UNBROKEN
    return console
