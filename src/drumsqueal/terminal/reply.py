"""The one way in which a command works and answers: in words on its console, or as JSON in their place.

It claims its files, shows progress, looks for Ctrl-C, keeps what was done until then, writes JSON, tables and figures,
and prints what was found and where the files are.
"""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from rich.console import Console, ConsoleRenderable, RenderHook
from rich.control import Control
from rich.segment import ControlType

from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.files.claims import claim_file, claim_folder
from drumsqueal.files.output_folder import (
    check_apart,
    check_output,
    check_output_file,
    figure_file,
    files_of,
    folder_of,
    is_made,
    not_taken,
    set_aside,
    to_json,
    unusable,
    write_json,
    write_whole,
)
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.progress import Progress, bar
from drumsqueal.scene.quantities import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
    def with_folder(
        cls,
        results: str,
        output: Path | None,
        read: Sequence[Path],
        quiet: bool,
        json_file: str | None,
        *,
        overwrite: bool,
    ) -> "Reply":
        """That of a command which reads some files and leaves such `results` in a folder.

        Without `output` that is the one of `folder_of` for the first file that is read. Raises RequestError where
        results lie there already and are not to be overwritten, one would replace another file, or another command is
        at that folder.
        """
        folder = output or folder_of(results, read[0].stem)
        files = files_of(results, folder)
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
        reply.folder, reply._files = folder, files
        reply._remark(remark)
        return reply

    @classmethod
    def with_file(
        cls, file: Path, read: Iterable[Path], quiet: bool, json_file: str | None, *, overwrite: bool
    ) -> "Reply":
        """That of a command which reads some files and writes one. Raises RequestError as `with_folder` does."""
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
            remark = claim_file(path, option)
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


F = TypeVar("F")


class Record(Protocol):
    """A file that a study fills while it computes, and that holds how the study ended."""

    def stopped(self, reason: str) -> str:
        """Note why the study ended early, and return what the file holds, in words."""
        ...

    def completed(self) -> None:
        """Note that the study and all its files are complete."""
        ...


@dataclass(frozen=True)
class Answer(Generic[F]):
    """How the findings of a question become files, figures and words.

    `summary` names the JSON file; `tables` and `figures` make the content of each file, or None where there is nothing
    to show; `words` prints. `filled` is the file that the study itself fills while it computes. `data` makes
    what the JSON holds.
    """

    words: Callable[[Console, F], None]
    summary: str | None = None
    tables: Mapping[str, Callable[[F], str | bytes | None]] = field(default_factory=dict)
    figures: Mapping[str, Callable[[F], "Figure | None"]] = field(default_factory=dict)
    filled: str | None = None
    data: Callable[[F], object] = lambda found: found

    def write(self, folder: Path, found: F) -> None:
        """Write JSON and tables, each whole or not at all. Raises OSError."""
        if self.summary is not None:
            write_json(self.data(found), folder / self.summary)
        for name, make in self.tables.items():
            content = make(found)
            if content is not None:
                write_whole(folder / name, content.encode() if isinstance(content, str) else content)

    def draw(self, folder: Path, found: F) -> list[str]:
        """Write the figures, each whole or not at all, and return the names of those that had nothing to show.

        Raises OSError, and KeyboardInterrupt between two figures.
        """
        left_out = []
        for name, make in self.figures.items():
            stop_if_interrupted()
            if not draw_figure(folder, name, make(found)):
                left_out.append(figure_file(name))
        return left_out

    @property
    def files(self) -> tuple[str, ...]:
        """All names that may be written."""
        first = [name for name in (self.filled, self.summary) if name is not None]
        return (*first, *self.tables, *map(figure_file, self.figures))


def draw_figure(folder: Path, name: str, figure: "Figure | None") -> bool:
    """Write a figure, whole or not at all; whether there is one, that is something to show. Raises OSError."""
    if figure is None:
        return False
    from drumsqueal.terminal.style import save_figure

    save_figure(figure, folder / figure_file(name))
    return True


def answer(
    reply: Reply,
    how: Answer[F],
    find: Callable[[Progress, Callable[[F], None]], F],
    *,
    record: Record | None = None,
    resume: bool = False,
) -> F:
    """Find, and write, draw, print and send what was found; return it.

    `find` takes a hook for progress, which raises KeyboardInterrupt after Ctrl-C, and one that keeps what was found so
    far. `record` is the file that it fills, which stays where it is to `resume`. Raises IntegrationError for what
    failed or was interrupted, with where that is.
    """
    folder = reply.folder
    gone_on_with = [how.filled] if resume and how.filled else ()
    with reply.replacing(but=gone_on_with), kept_in(folder, how.files, record):
        with reply.progress() as progress:
            found = find(progress, lambda so_far: how.write(folder, so_far))
        how.write(folder, found)
        left_out = how.draw(folder, found)
        stop_if_interrupted()
        if record is not None:  # not before its results are there: what is complete is not resumed
            record.completed()
    how.words(reply.console, found)
    print_place(reply.console, folder, how.files, left_out)
    reply.send(how.data(found))
    return found


def answer_without_folder(reply: Reply, words: Callable[[Console, F], None], find: Callable[[Progress], F]) -> F:
    """Find, print and send what was found, and say where the file is that `find` has written, if it is one; return it.

    `find` takes a hook for progress, which raises KeyboardInterrupt after Ctrl-C.
    """
    with reply.progress() as progress:
        found = find(progress)
    words(reply.console, found)
    if reply.file is not None:
        reply.console.print(printable(f"Results are in {reply.file}"), soft_wrap=True)
    reply.send(found)
    return found


@contextmanager
def kept_in(folder: Path, files: Sequence[str], record: Record | None = None) -> Iterator[None]:
    """Turn Ctrl-C, a failure and a full disk into an IntegrationError that says where what was done until then is."""
    interrupted = "interrupted by the user"

    def kept(reason: str) -> str:
        if record is not None:
            return record.stopped(reason)
        there = [name for name in files if (folder / name).exists()]
        return f"what was done until then is in {folder / there[0]}" if there else "nothing was kept"

    try:
        yield
    except KeyboardInterrupt:
        raise IntegrationError(f"{interrupted}; {kept(interrupted)}") from None
    except IntegrationError as error:
        raise type(error)(f"{error}; {kept(f'failed: {error}')}") from None
    except OSError as error:
        reason = not_taken(error, folder)
        raise IntegrationError(f"{reason}; {kept(reason)}") from None


def print_place(console: Console, folder: Path, files: Sequence[str], left_out: Sequence[str] = ()) -> None:
    """Print where the files are, and which figures had nothing to show."""
    if left_out:
        console.print(f"Not written, nothing to show: {', '.join(left_out)}", style="dim")
    there = [name for name in files if (folder / name).exists()]
    console.print(printable(f"Results are in {folder}: {', '.join(there)}"), soft_wrap=True)
