"""One run into one folder: the history grows on disk while it is integrated, then findings and figures."""

from contextlib import ExitStack
from pathlib import Path

from drumsqueal.errors import Ending, IntegrationError, Outcome
from drumsqueal.files.history_file import HistoryFile, Reached, ResumeFile, ResumePoint
from drumsqueal.files.output_folder import (
    EARLIER,
    HISTORY,
    RESUME,
    SUMMARY,
    figure_file,
    not_taken,
    run_figures,
    write_json,
)
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.prediction import predict
from drumsqueal.progress import Progress
from drumsqueal.questions.run.drawing import Second, draw
from drumsqueal.questions.run.words import print_findings
from drumsqueal.simulation import Prepared, Result, collect, compared
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.terminal.reply import Reply, print_place


def run_into(
    prepared: Prepared, reply: Reply, since: ResumePoint | None = None, second: Second | None = None
) -> RunFindings:
    """Run a prepared scene, write history, findings and figures into the reply's folder, print and return the findings.

    `second` is a process that helps to draw. `since` a point that an earlier run in this folder has reached, it goes on
    from there. Raises IntegrationError for a run that failed, was interrupted or did not fit on the disk, after writing
    what was computed; the message says why and what is where.
    """
    folder, reached = reply.folder, Reached() if since is None else since.reached
    history = HistoryFile(folder / HISTORY, prepared.scene, prepared.model.names, reached)
    resume, outcome = ResumeFile(folder / RESUME, prepared.scene), None
    with ExitStack() as files:
        try:
            with reply.progress() as progress:
                outcome = _integrate(history, resume, prepared, progress, since)
                progress("comparing", 0.0, None)
                result = _find(files, history, prepared, outcome, folder, progress)
            left_out = draw(folder, result, prepared.model, second)
            if outcome.ending is Ending.COMPLETE:
                resume.remove()
        except KeyboardInterrupt:
            raise IntegrationError(f"interrupted by the user; {_kept(history, outcome)}{_again(resume)}") from None
        except OSError as error:
            raise IntegrationError(f"{not_taken(error, folder)}; {_kept(history, outcome)}{_again(resume)}") from None
    print_findings(reply.console, result.findings)
    names = run_figures(changing=result.findings.changing, brake=result.findings.brake is not None)
    print_place(reply.console, folder, (HISTORY, SUMMARY, *map(figure_file, names)), left_out)
    if outcome.ending is not Ending.COMPLETE:
        raise IntegrationError(f"{outcome}; what was computed is in {folder}{_again(resume)}")
    return result.findings


def _find(
    files: ExitStack, history: HistoryFile, prepared: Prepared, outcome: Outcome, folder: Path, progress: Progress
) -> Result:
    """Compare with the prediction and write what was found, which of a run without samples is the prediction alone."""
    if not history.exists:
        if (folder / EARLIER).exists():  # which come back
            raise IntegrationError(outcome)
        found = RunFindings(
            scene=prepared.scene,
            outcome=outcome,
            ending=outcome.ending,
            prediction=predict(prepared.stability),
            model=prepared.inventory._asdict(),
        )
        write_json(found, folder / SUMMARY)
        raise IntegrationError(f"{outcome}; what was computed is in {folder}")
    result = compared(prepared, files.enter_context(history.reading()))
    progress("writing", 0.0, None)
    write_json(result.findings, folder / SUMMARY)
    return result


def _integrate(
    history: HistoryFile, resume: ResumeFile, prepared: Prepared, progress: Progress, since: ResumePoint | None
) -> Outcome:
    """Integrate into the history, and return the outcome."""
    if since is not None:
        history.take_up()

    def keep(chunk: Chunk) -> None:
        history.append(chunk)
        if chunk.end is not None:
            resume.note(ResumePoint(history.reached, chunk.end))

    try:
        outcome = collect(prepared, keep, progress, since and since.checkpoint)
    except OSError as error:
        first = history.reached.samples / prepared.scene.simulate.sample_rate
        cause = f"the disk did not take the samples from t = {first:.6g} s on"
        outcome = Outcome(Ending.FAILED, f"failed: {cause} ({error.strerror or error})")
        resume.write()
        history.end(outcome)
        return outcome
    resume.write()
    history.end(outcome)
    if outcome.ending is Ending.FAILED:  # and would fail again
        resume.remove()
    return outcome


def _again(resume: ResumeFile) -> str:
    return "; --resume continues from there" if resume.exists else ""


def _kept(history: HistoryFile, outcome: Outcome | None) -> str:
    if not history.exists:
        return "nothing was kept"
    complete = outcome is not None and outcome.ending is Ending.COMPLETE
    return f"the {'complete ' if complete else ''}history is in {history.path}"
