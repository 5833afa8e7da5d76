"""One run into one folder: the history grows on disk while the bar moves, then summary and figures."""

import importlib
import threading
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.errors import IntegrationError
from drumsqueal.files.history_file import HistoryFile, Reached
from drumsqueal.files.output_folder import HISTORY, RESUME, not_taken
from drumsqueal.files.resumption import Point, ResumeFile
from drumsqueal.findings.history import COMPLETE
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.simulation import Prepared, collect, compared
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.terminal.progress import progress_bar


def run_into(folder: Path, prepared: Prepared, console: Console, since: Point | None = None) -> dict[str, Any]:
    """Run a prepared scene, write history, summary and figures into the folder, print and return the comparison.

    `since` a point that an earlier run in this folder has reached, it goes on from there. Raises IntegrationError for a
    run that failed, was interrupted or did not fit on the disk, after writing what was computed; the message says why
    and what is where.
    """
    reached = Reached() if since is None else since.reached
    history = HistoryFile(folder / HISTORY, prepared.scene, prepared.model.names, reached)
    resume, outcome = ResumeFile(folder / RESUME, prepared.scene), ""
    with ExitStack() as files:
        try:
            outcome = _integrate(history, resume, prepared, console, since)
            from drumsqueal.questions.run.results import print_results, write_prediction, write_results

            stop_if_interrupted()
            if not history.exists:
                write_prediction(folder, prepared, outcome)
                raise IntegrationError(f"{outcome}; what was computed is in {folder}")
            result = compared(prepared, files.enter_context(history.reading()))
            stop_if_interrupted()
            summary, left_out = write_results(folder, prepared, result)
            if outcome == COMPLETE:
                resume.remove()
        except KeyboardInterrupt:
            raise IntegrationError(f"interrupted by the user; {_kept(history, outcome)}{_again(resume)}") from None
        except OSError as error:
            raise IntegrationError(f"{not_taken(error, folder)}; {_kept(history, outcome)}{_again(resume)}") from None
        print_results(folder, result, left_out, console)
        if outcome != COMPLETE:
            raise IntegrationError(f"{outcome}; what was computed is in {folder}{_again(resume)}")
        return summary


def _integrate(
    history: HistoryFile, resume: ResumeFile, prepared: Prepared, console: Console, since: Point | None
) -> str:
    """Integrate into the history, and return the outcome."""
    # What compares and draws is loaded while compiled code runs: a second that nobody waits for.
    loading = threading.Thread(target=importlib.import_module, args=("drumsqueal.questions.run.results",))
    if since is not None:
        history.take_up()
    with progress_bar(console) as progress:
        task = progress.add_task("compiling", total=prepared.scene.simulate.duration, reached="")

        def keep(chunk: Chunk) -> None:
            if loading.ident is None:
                loading.start()
            history.append(chunk)
            if chunk.end is not None:
                resume.note(Point(history.reached, chunk.end))
            reached = float(chunk.time[-1])
            progress.update(task, description="integrating", completed=reached, reached=f"{reached:.4f} s")

        fails = False
        try:
            outcome = collect(prepared, keep, since and since.checkpoint)
            fails = outcome.startswith("failed")
        except OSError as error:
            first = history.reached.samples / prepared.scene.simulate.sample_rate
            cause = f"the disk did not take the samples from t = {first:.6g} s on"
            outcome = f"failed: {cause} ({error.strerror or error})"
        resume.write()
        history.end(outcome)
        if fails:  # and would fail again
            resume.remove()
    return outcome


def _again(resume: ResumeFile) -> str:
    return "; --resume goes on from there" if resume.exists else ""


def _kept(history: HistoryFile, outcome: str) -> str:
    if not history.exists:
        return "nothing was kept"
    return f"the {'complete ' if outcome == COMPLETE else ''}history is in {history.path}"
