"""The one way in which a command works: claims its files, shows progress, looks for Ctrl-C, keeps what was done until
then, writes JSON, tables and figures, prints what was found and where the files are."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from rich.console import Console

from drumsqueal.errors import IntegrationError
from drumsqueal.files.output_folder import figure_file, not_taken, write_json, write_whole
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.progress import Progress as Hook
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.reply import Reply

if TYPE_CHECKING:
    from matplotlib.figure import Figure

F = TypeVar("F")
INTERRUPTED = "interrupted by the user"


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
    find: Callable[[Hook, Callable[[F], None]], F],
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


def answer_without_folder(reply: Reply, words: Callable[[Console, F], None], find: Callable[[Hook], F]) -> F:
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

    def kept(reason: str) -> str:
        if record is not None:
            return record.stopped(reason)
        there = [name for name in files if (folder / name).exists()]
        return f"what was done until then is in {folder / there[0]}" if there else "nothing was kept"

    try:
        yield
    except KeyboardInterrupt:
        raise IntegrationError(f"{INTERRUPTED}; {kept(INTERRUPTED)}") from None
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
