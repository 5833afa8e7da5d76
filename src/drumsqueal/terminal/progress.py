"""The bars that show how far the simulated time, or the number of points, has come."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


def progress_bar(console: Console) -> Progress:
    """A bar whose tasks tell in their field `reached` how far they have come; nothing where there is no terminal."""
    return _shown(
        console, TextColumn("{task.description}"), BarColumn(), TextColumn("simulated {task.fields[reached]}"),
        TimeRemainingColumn(),
    )  # fmt: skip


def counting_bar(console: Console) -> Progress:
    """A bar of things done, such as points or steps; nothing where there is no terminal."""
    return _shown(console, TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())


def spinner(console: Console) -> Progress:
    """What is being done, and since when, where nobody knows how much there is; nothing where there is no terminal."""
    return _shown(console, SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())


@contextmanager
def telling(console: Console) -> Iterator[Callable[[str], None]]:
    """What is being done in words, on a terminal: call what it gives with them."""
    with spinner(console) as progress:
        task = progress.add_task("compiling", total=None)
        yield lambda words: progress.update(task, description=words)


def _shown(console: Console, *columns: ProgressColumn) -> Progress:
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
