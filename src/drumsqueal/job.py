"""One run into one folder: the history grows on disk while the bar moves, then summary and figures."""

import importlib
import threading
from pathlib import Path

from rich.console import Console

from drumsqueal.errors import IntegrationError
from drumsqueal.history import COMPLETE, HistoryFile
from drumsqueal.integrate import Chunk
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.output_folder import HISTORY
from drumsqueal.progress import progress_bar
from drumsqueal.simulation import Prepared, collect, finish


def run_into(folder: Path, prepared: Prepared, console: Console) -> None:
    """Run a prepared scene, write history, summary and figures into the folder and print the comparison.

    Raises IntegrationError for a run that failed, was interrupted or did not fit on the disk, after writing what was
    computed; the message says why and what is where.
    """
    history, outcome = HistoryFile(folder / HISTORY, prepared.scene, prepared.model.names), ""
    try:
        chunks, outcome = _integrate(history, prepared, console)
        from drumsqueal.results import print_results, write_prediction, write_results

        stop_if_interrupted()
        if not chunks:
            write_prediction(folder, prepared, outcome)
            raise IntegrationError(f"{outcome}; what was computed is in {folder}")
        result = finish(prepared, chunks, outcome)
        stop_if_interrupted()
        write_results(folder, prepared, result)
    except KeyboardInterrupt:
        raise IntegrationError(f"interrupted by the user; {_kept(history, outcome)}") from None
    except OSError as error:
        cause = f"failed: the disk does not take the results ({error.strerror or error})"
        raise IntegrationError(f"{cause}; {_kept(history, outcome)}") from None
    print_results(folder, result, console)
    if outcome != COMPLETE:
        raise IntegrationError(f"{outcome}; what was computed is in {folder}")


def _integrate(history: HistoryFile, prepared: Prepared, console: Console) -> tuple[list[Chunk], str]:
    """The chunks, which are in the history, too, and the outcome."""
    with progress_bar(console) as progress:
        task = progress.add_task("compiling", total=prepared.scene.simulate.duration, reached="")

        def keep(chunk: Chunk) -> None:
            if not history.exists:
                # What compares and draws is loaded while compiled code runs: a second that nobody waits for.
                threading.Thread(target=importlib.import_module, args=("drumsqueal.results",)).start()
            try:
                history.append(chunk)
            except OSError as error:
                cause = f"the disk did not take the samples from t = {chunk.time[0]:.6g} s on"
                raise IntegrationError(f"{cause} ({error.strerror or error})") from None
            reached = float(chunk.time[-1])
            progress.update(task, description="integrating", completed=reached, reached=f"{reached:.4f} s")

        chunks, outcome = collect(prepared, keep)
        history.end(outcome)
    return chunks, outcome


def _kept(history: HistoryFile, outcome: str) -> str:
    if not history.exists:
        return "nothing was kept"
    return f"the {'complete ' if outcome == COMPLETE else ''}history is in {history.path}"
