"""A sweep into one folder: its file fills on disk batch by batch, then summary and figures."""

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

from rich.console import Console

from drumsqueal.errors import IntegrationError
from drumsqueal.files.output_folder import SWEEP, not_taken
from drumsqueal.findings.history import COMPLETE
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.sweep.file import SweepFile
from drumsqueal.questions.sweep.points import Columns
from drumsqueal.questions.sweep.results import Summary, print_sweep, write_results
from drumsqueal.questions.sweep.study import batches, compute
from drumsqueal.scene.plan import Plan
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.progress import counting_bar

Batches = list[tuple[int, int]]  # the first point of each, and the one after the last
Source = Callable[[Plan, Batches], Iterator[tuple[int, Columns]]]
_AGAIN = "--resume goes on from there"


def here(plan: Plan, left: Batches) -> Iterator[tuple[int, Columns]]:
    """Compute the batches in this process: the first point of each, and its results."""
    for first, stop in left:
        yield first, compute(plan, first, stop)


def sweep_into(folder: Path, plan: Plan, console: Console, source: Source = here, *, resume: bool = False) -> Summary:
    """Compute a sweep into the folder, write its figures, print and return what it found.

    `source` computes the batches, in any order. Raises IntegrationError for a sweep that failed, was interrupted or did
    not fit on the disk: the points computed until then are in the file.
    """
    file = SweepFile(folder / SWEEP, plan)
    try:
        if resume:
            file.take_up()
        else:
            file.create()
    except KeyboardInterrupt:
        raise IntegrationError("interrupted by the user; nothing was kept") from None
    except OSError as error:
        raise IntegrationError(f"{not_taken(error, folder)}; nothing was kept") from None
    summary, outcome = None, COMPLETE
    try:
        _fill(file, plan, console, source)
        summary = write_results(folder, plan)
    except KeyboardInterrupt:
        outcome = "interrupted by the user"
    except IntegrationError as error:
        outcome = f"failed: {error}"
    except OSError as error:
        outcome = not_taken(error, folder)
    if summary is None:
        outcome += f"; {int(file.computed().sum())} of {plan.points} points were computed"
        file.end(outcome)
        raise IntegrationError(f"{outcome} and are in {file.path}; {_AGAIN}")
    file.end(outcome)  # not before its results are there: what is complete is not resumed
    print_sweep(console, plan, summary)
    console.print(printable(f"Results, summary and figures are in {folder}"), soft_wrap=True)
    return summary


def _fill(file: SweepFile, plan: Plan, console: Console, source: Source) -> None:
    """Compute what is missing, each batch once."""
    computed = file.computed()
    left = {first: stop for first, stop in batches(plan) if not computed[first:stop].all()}
    done = plan.points - sum(stop - first for first, stop in left.items())
    with counting_bar(console) as progress, closing(source(plan, list(left.items()))) as stream:  # pyright: ignore
        task = progress.add_task("sweeping", total=plan.points, completed=done)
        stop_if_interrupted()
        for first, columns in stream:
            stop = left.pop(first)
            file.write(first, columns)
            progress.update(task, advance=stop - first)
            stop_if_interrupted()
