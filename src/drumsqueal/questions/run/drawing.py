"""Figures of a run drawn by two processes: the second one loads what draws while the first one computes.

Where there is none, or it fails, the first one draws all of them.
"""

import importlib
import os
import pickle
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drumsqueal.compilation import cores, hidden_from_xarray
from drumsqueal.files.output_folder import figure_file, run_figures
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.terminal.reply import draw_figure

if TYPE_CHECKING:
    from drumsqueal.physics.model import Model
    from drumsqueal.simulation import Result

# The package is found where the first process found it.
SERVE = "import sys; sys.path[:] = {path!r}; from drumsqueal.questions.run.drawing import serve; serve()"


class Second:
    """The second process. It ends when its standard input does, and so with the first one, however that ends."""

    def __init__(self) -> None:
        """Start it; Ctrl-C is for the first one alone. Raises OSError."""
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        command = [sys.executable, "-c", SERVE.format(path=sys.path)]
        self._process = subprocess.Popen(command, **pipes, start_new_session=True)

    def tell(self, thing: Any) -> None:
        """Send it something. Raises OSError where it is no more, and what pickle raises."""
        assert self._process.stdin is not None
        pickle.dump(thing, self._process.stdin)
        self._process.stdin.flush()

    def hear(self) -> Any:
        """What it sends. Raises EOFError where it is no more."""
        assert self._process.stdout is not None
        return pickle.load(self._process.stdout)

    def end(self) -> None:
        """End it; between two figures it has nothing to finish."""
        self._process.kill()
        self._process.communicate()


@contextmanager
def second_process() -> Iterator[Second | None]:
    """The second process while the block lasts; None where there is no core for it, or none can be started."""
    second = None
    if cores() > 1:
        with suppress(OSError):
            second = Second()
    try:
        yield second
    finally:
        if second is not None:
            second.end()


def serve() -> None:
    """Be the second process: draw the figures that the first one names."""
    answers, sys.stdout = os.fdopen(os.dup(1), "wb"), sys.stderr
    with hidden_from_xarray(), suppress(EOFError, BrokenPipeError):
        # What figures and the result are made of, before there is one.
        for name in ("drumsqueal.questions.run.figures", "drumsqueal.findings.compare", "h5netcdf", "xarray"):
            importlib.import_module(name)
        from drumsqueal.questions.run.figures import drawings

        folder, result, model = pickle.load(sys.stdin.buffer)
        figures = drawings(result, model)
        answer: bool | OSError = True  # ready
        while True:
            pickle.dump(answer, answers)
            answers.flush()
            name = pickle.load(sys.stdin.buffer)
            try:
                answer = draw_figure(folder, name, figures[name](None))
            except OSError as error:
                answer = error


def draw(folder: Path, result: "Result", model: "Model", second: Second | None) -> list[str]:
    """Write the figures, each whole or not at all, and return the names of those that had nothing to show.

    Raises OSError, and KeyboardInterrupt between two figures.
    """
    names = run_figures(changing=result.findings.changing, brake=result.findings.brake is not None)
    left, drawn, failed = deque[str](names), dict[str, bool](), list[OSError]()
    helps = threading.Event()  # while the second one may have a figure; until it is ready nobody waits for it

    def delegate(second: Second) -> None:
        """From the last on, while there are any."""
        name = None
        try:
            second.tell((folder, result, model))
            second.hear()
            helps.set()
            while (name := _taken(left.pop)) is not None:
                second.tell(name)
                answer = second.hear()
                if isinstance(answer, OSError):
                    failed.append(answer)
                    left.clear()
                else:
                    drawn[name] = answer
        except Exception:  # whatever it is, the first process draws what the second one did not
            if name is not None:
                left.append(name)
        helps.clear()

    helper = threading.Thread(target=delegate, args=(second,), daemon=True)
    if second is not None:
        helper.start()
    try:
        from drumsqueal.questions.run.figures import drawings  # while the second one draws already

        figures = drawings(result, model)
        while left or helps.is_set() or left:  # what it takes or puts back it does while it helps
            stop_if_interrupted()
            name = _taken(left.popleft)
            if name is None:
                helper.join()
            else:
                drawn[name] = draw_figure(folder, name, figures[name](None))
    finally:
        left.clear()
        if helps.is_set():
            helper.join()
    if failed:
        raise failed[0]
    return [figure_file(name) for name in names if not drawn[name]]


def _taken(take: Callable[[], str]) -> str | None:
    """What is taken from a queue that another thread may have emptied."""
    try:
        return take()
    except IndexError:
        return None
