"""What a long computation reports on its way; whoever listens may stop it by raising an exception."""

import functools
import html
import inspect
import multiprocessing
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

MOST_SILENT = 2.0  # s, until a file is told what is being done
Progress = Callable[[str, float, float | None], None]
"""Called with what is being done, how much of it is done, and the whole (None: not known), in any one unit."""


def silent(what: str, done: float = 0.0, total: float | None = None) -> None:
    """Report nothing."""


def named(progress: Progress, what: str) -> Progress:
    """What reports under another name."""
    return lambda _, done=0.0, total=None: progress(what, done, total)


def with_bar(function: Any, module: str) -> Any:
    """A function that shows a bar while it computes, unless its caller takes what it reports as `progress`.

    It is the one that is found in `module`, for pickle. What reports nothing is returned as it is.
    """
    if not inspect.isfunction(function) or "progress" not in inspect.signature(function).parameters:
        return function

    @functools.wraps(function)
    def with_progress(*arguments: Any, **keywords: Any) -> Any:
        given = inspect.signature(function).bind_partial(*arguments, **keywords).arguments
        if "progress" in given or not _is_watched():
            return function(*arguments, **keywords)
        with bar() as progress:
            return function(*arguments, **keywords, progress=progress)

    with_progress.__module__ = module
    return with_progress


def _is_watched() -> bool:
    """Whether this is where the user is: no thread and no process that works for another one."""
    return threading.current_thread() is threading.main_thread() and multiprocessing.parent_process() is None


@contextmanager
def bar(console: "Console | None" = None) -> Iterator[Progress]:
    """A hook that shows a bar while the block lasts, in a notebook or a terminal.

    Elsewhere it prints lines on a console that is given, and is silent without one.
    """
    if console is None and "ipykernel" in sys.modules:
        with _notebook_bar() as show:
            yield show
        return
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    if console is not None and not console.is_terminal:
        with nullcontext(silent) if console.quiet else _lines(console) as show:
            yield show
        return
    console = Console(stderr=True) if console is None else console
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    shown = Bar(*columns, TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal)
    with shown:
        task = shown.add_task("preparing", total=None)
        yield lambda what, done=0.0, total=None: shown.update(task, description=what, completed=done, total=total)


@contextmanager
def _lines(console: "Console") -> Iterator[Progress]:
    """A hook that prints from time to time what is being done: for a file, in which a bar cannot be drawn."""
    latest = stage = "preparing"
    since, ended = time.monotonic(), threading.Event()

    def show(what: str, done: float = 0.0, total: float | None = None) -> None:
        nonlocal latest, stage, since
        if what != stage:
            stage, since = what, time.monotonic()
        latest = f"{what}: {100 * done / total:.0f} %" if total and done else what

    def speak() -> None:
        begun, said = time.monotonic(), ""
        # At a tenth of the time that it has taken: some sixty lines in an hour.
        while not ended.wait(max(MOST_SILENT, (time.monotonic() - begun) / 10)):
            line = f"{latest} ({time.monotonic() - since:.0f} s so far)"
            if latest != said:
                line = said = latest
            try:  # rich would take a pipe that nobody reads for a reason to end, and to print nothing any more
                console.file.write(f"{line}\n")
                console.file.flush()
            except (OSError, ValueError):
                return

    speaker = threading.Thread(target=speak, daemon=True)
    speaker.start()
    try:
        yield show
    finally:
        ended.set()
        speaker.join()


@contextmanager
def _notebook_bar() -> Iterator[Progress]:
    """One of the page itself: what rich shows in a notebook takes a package of its own."""
    from IPython.display import HTML, display  # pyright: ignore[reportMissingImports]

    place: Any = display(HTML(""), display_id=True)

    def show(what: str, done: float = 0.0, total: float | None = None) -> None:
        part = f'value="{done / total:.4f}"' if total else ""
        place.update(HTML(f"<progress {part}></progress> {html.escape(what)}"))

    try:
        yield show
    finally:
        place.update(HTML(""))
