"""How a command answers: in words on its console, or as JSON in their place; and what it claims for itself."""

import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console, ConsoleRenderable, RenderHook
from rich.control import Control
from rich.segment import ControlType

from drumsqueal.errors import RequestError
from drumsqueal.files.claims import claim_file, claim_folder
from drumsqueal.files.output_folder import (
    check_apart,
    check_output,
    check_output_file,
    is_made,
    set_aside,
    to_json,
    unusable,
    write_json,
)
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.progress import Progress, bar
from drumsqueal.scene.quantities import printable

UNBROKEN = 10_000  # columns where nobody looks on: a sentence then is one line, and no table is cut


class Reply:
    """How a command answers: in words on its `console`, or as JSON in their place, or (`--quiet`) not at all.

    What the command writes is claimed for it, until `main` ends.
    """

    folder, _files = Path(), ()
    file: Path | None = None  # the one that the command writes, where that is no folder

    def __init__(self, quiet: bool, json_file: str | None, *, overwrite: bool, apart_from: Iterable[Path] = ()) -> None:
        """Raises RequestError where the JSON file cannot be written, is there and is not to be overwritten, or would
        replace another file that is read or written.
        """
        if json_file == "":
            raise RequestError("--json: the name of the file is empty; write one, or - for standard output")
        self._file, self._quiet = json_file, quiet
        if self._path is not None and not _is_stream(self._path):
            check_apart(self._path, apart_from, option="--json")
            self._claim_file(self._path, overwrite=overwrite, option="--json")
        self.console = make_console(quiet=quiet or json_file is not None)
        if self.console.is_terminal and not (self.console.quiet or self.console.is_dumb_terminal):
            _Notice(self.console)

    @classmethod
    def next_to(
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
        reply.folder, reply._files = folder, tuple(files)
        reply._remark(remark)
        return reply

    @classmethod
    def with_file(
        cls, file: Path, read: Iterable[Path], quiet: bool, json_file: str | None, *, overwrite: bool
    ) -> "Reply":
        """That of a command which reads some files and writes one. Raises RequestError as `next_to` does."""
        check_apart(file, read)
        reply = cls(quiet, json_file, overwrite=overwrite, apart_from=(*read, file))
        reply._claim_file(file, overwrite=overwrite, option="-o")
        reply.file = file
        return reply

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """A hook that shows how far a computation has come, and looks for Ctrl-C wherever it is called.

        On a terminal it draws a bar; where answers go into a file, a pipe or JSON it is on standard error, as a bar or
        as lines.
        """
        answers = self.console.is_terminal and not self.console.quiet
        with bar(self.console if answers else make_console(stderr=True, quiet=self._quiet)) as shown:

            def show(what: str, done: float = 0.0, total: float | None = None) -> None:
                stop_if_interrupted()
                shown(what, done, total)

            yield show

    @contextmanager
    def replacing(self, *, but: Iterable[str] = ()) -> Iterator[None]:
        """Replace earlier results by those of the block, as `set_aside` does; say what others had made of them.

        Raises RequestError where the folder cannot be written.
        """
        with set_aside(self.folder, self._files, but=but) as gone:
            yield
        made = list(filter(is_made, gone))
        if made:  # it will not come again by itself
            self.console.print(f"Removed with the results that they were made of: {', '.join(made)}")

    def _claim_file(self, path: Path, *, overwrite: bool, option: str) -> None:
        check_output_file(path, overwrite=overwrite, option=option)
        try:
            remark = claim_file(path, f"name another file with {option}")
        except OSError as error:
            raise unusable(path, error, option, "file") from None
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


class _Notice(RenderHook):
    """A word on a terminal while the package loads, in the place of what is printed first."""

    last: "_Notice | None" = None

    def __init__(self, console: Console) -> None:
        self._console, self._shown, _Notice.last = console, True, self
        console.push_render_hook(self)
        console.file.write("loading ...")  # of characters that every terminal has
        console.file.flush()

    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        """Clear the line before the first thing that is printed."""
        if not self._shown:
            return renderables
        self._shown = False
        return [Control(ControlType.CARRIAGE_RETURN, (ControlType.ERASE_IN_LINE, 2)), *renderables]

    def clear(self) -> None:
        """Clear the line now, for what is printed elsewhere."""
        if self._shown:
            self._console.print(end="")


def clear_notice() -> None:
    """Take away the word that is shown while the package loads, if it still is."""
    if _Notice.last is not None:
        _Notice.last.clear()


def _is_stream(path: Path) -> bool:
    """Whether this is a pipe or a device: what is there is not replaced, but written to."""
    try:
        return path.exists() and not path.is_file() and not path.is_dir()
    except (OSError, ValueError):
        return False


def make_console(*, stderr: bool = False, quiet: bool = False) -> Console:
    """A console that shows text as it is: what users write is neither markup nor the name of an emoji.

    Colours and widths are those of a terminal that is one; into a file or a pipe, lines are not broken.
    """
    console = Console(stderr=stderr, highlight=False, markup=False, emoji=False, quiet=quiet)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = UNBROKEN
    return console
