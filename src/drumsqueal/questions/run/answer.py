"""One run into one folder: the history grows on disk while it is integrated, then findings, figures and words."""

import math
from contextlib import ExitStack
from pathlib import Path

from rich.console import Console

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
from drumsqueal.findings.brake import brake_sentences
from drumsqueal.findings.columns import Column
from drumsqueal.findings.compare import INSTANTS, RunFindings
from drumsqueal.findings.growth_phase import ModeComparison
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.prediction import predict
from drumsqueal.findings.ramp import Ramp, value_words
from drumsqueal.findings.saturation import duration_for
from drumsqueal.findings.squeals import Instant, SquealEnd, name_of_key, unit_of_key
from drumsqueal.findings.verdict import difference_is_no_error
from drumsqueal.physics.model import at_lining
from drumsqueal.progress import Progress
from drumsqueal.questions.run.drawing import Second, draw
from drumsqueal.scene import Scene
from drumsqueal.simulation import Prepared, Result, collect, compared
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.solve.transient.runge_kutta import AUTO, IMPLICIT
from drumsqueal.terminal.reply import Reply, print_place
from drumsqueal.terminal.tables import print_cells, print_model, print_rows

ENDS = {SquealEnd.DIES_OUT: "dies out", SquealEnd.STICKS: "sticks", SquealEnd.RECORD: "record ends"}


def print_findings(console: Console, found: RunFindings) -> None:
    """Print what the model holds, and the comparison of prediction and transient."""
    print_model(console, found.model)
    if found.held_though_they_would_move:
        held = ", ".join(found.held_though_they_would_move)
        console.print(f"Held at zero, though the other coordinates would move them: {held}", style="bold")
    for line in () if found.brake is None else brake_sentences(found.brake):
        console.print(line)
    words = {"predicted": "predicted", "measured": "measured"}
    if found.changing:
        words = {"predicted": f"at t = {found.predicted_at_s:g} s", "measured": "mean"}
    print_rows(console, "Onset: eigenvalues against the transient", ModeComparison, found.modes, **words)
    resolution = sorted(mode.frequency_resolution_Hz for mode in found.modes if mode.frequency_resolution_Hz)
    if resolution:
        ends = " to ".join(dict.fromkeys(f"{end:.3g}" for end in (resolution[0], resolution[-1])))
        console.print(
            f"Measured from 0 to {found.growth.linear_until_s:.4g} s; spectral resolution {ends} Hz, peaks interpolated"
        )
    if found.changing:
        console.print(difference_is_no_error(found))
    for note in dict.fromkeys(mode.note for mode in found.modes if mode.note):
        labels = ", ".join(mode.label for mode in found.modes if mode.note is note)
        console.print(f"{labels}: {note}", style="dim")
    if found.ramp is not None and found.ramp.squeals:
        _print_squeals(console, found.ramp, found.scene)
    if found.ramp is not None and found.ramp.passages:
        _print_passages(console, found.ramp)
    _print_saturation(console, found)
    if (
        found.integration is not None
        and found.integration.implicit_fraction > 0
        and found.scene.simulate.solver == AUTO
    ):
        took = f"{100 * found.integration.implicit_fraction:.3g} % of the time"
        console.print(f"Friction is stiff: the implicit method {IMPLICIT} took {took}")
    _print_accuracy(console, found)
    console.print(found.verdict, style="bold")


def _print_squeals(console: Console, ramp: Ramp, scene: Scene) -> None:
    what, unit = (" and ".join(dict.fromkeys(map(words, ramp.keys))) for words in (name_of_key, unit_of_key))
    rows = []
    for each in ramp.squeals:
        size = f"{1e6 * each.amplitude:.3g}"
        if each.line is not None:
            factor, size_unit, shown = at_lining(scene, each.line.coordinate)
            size = f"{factor * each.amplitude:.3g} {size_unit} {shown}"
        rows.append(
            (
                *_moment(each.sets_in, ramp),
                value_words(each.largest, ramp.keys, unit=False),
                size,
                each.line and each.line.frequency_Hz,
                value_words(each.sustained_until, ramp.keys, unit=False),
                *_moment(each.ends, ramp),
                ENDS[each.end],
            )
        )
    changing = Column("{unit}", ">", unit=unit)
    columns = (
        *(Column("sets in", ".4f", unit="s"), changing, Column("largest", ">", unit=unit)),
        *(Column("size", ">"), Column("line", ".0f", unit="Hz"), Column("lasts to", ">", unit=unit)),
        *(Column("ends", ".4f", unit="s"), changing, Column("how")),
    )
    title = f"Squeal while {what} {'changes' if len(ramp.keys) == 1 else 'change'}"
    print_cells(console, title, columns, rows, tight=True)


def _print_passages(console: Console, ramp: Ramp) -> None:
    unit = " and ".join(dict.fromkeys(unit_of_key(key) for key in ramp.keys))
    changing = Column("{unit}", ">", unit=unit)
    columns = (
        *(Column("mode"), Column("unstable\nfrom s", ".4f"), changing, Column("to s", ".4f"), changing),
        *(Column("e-folds\nneeded", ".2f"), Column("at hand", ".2f")),
        *(Column("boundary\npredicted", ".4f"), changing, Column("reached", ".4f"), changing),
    )
    rows = (
        (
            each.mode,
            *_moment(each.unstable_from, ramp),
            *_moment(each.unstable_until, ramp),
            each.growth_needed if math.isfinite(each.growth_needed or 0.0) else None,
            each.growth_available,
            *_moment(each.predicted, ramp),
            *_moment(each.measured, ramp),
        )
        for each in ramp.passages
    )
    title = "Growth integrated along the way: ∫ Re λ dt against the transient"
    print_cells(console, title, columns, rows, tight=True)


def _moment(instant: Instant | None, ramp: Ramp) -> tuple[float | None, str]:
    """Time, and what changes, at an instant."""
    return (None, "") if instant is None else (instant.time_s, value_words(instant, ramp.keys, unit=False))


def _print_saturation(console: Console, found: RunFindings) -> None:
    saturation = found.saturation
    if saturation is None:
        return
    when = "At its end" if saturation.regime.kind is Kind.STEADY else "After growth"
    console.print(f"{when}, from {saturation.start_s:.4g} s: {saturation.regime.reason}")
    needed, boundary = saturation.regime.record_needed_s, found.edge_reached_s
    if needed is not None and boundary is not None:
        duration = f"{duration_for(needed, boundary):.4g} s"
        console.print(f"To record that long after growth, set simulate.duration to {duration}")


def _print_accuracy(console: Console, found: RunFindings) -> None:
    accuracy = found.accuracy
    if accuracy is None:
        return
    of_motion = accuracy.energy_balance_error_over_kinetic_energy
    of_friction = accuracy.energy_balance_error_over_friction_work
    parts = [f"{of_motion:.1e} of the largest kinetic energy"] if of_motion < 1 else []  # or there is next to no motion
    parts += [f"{of_friction:.1e} of the work of friction"] if of_friction > 0 else []
    if parts:
        console.print(f"Energy balance error: {', '.join(parts)}")
    error = accuracy.quadrature_error_over_normal_force
    if error is not None:
        console.print(
            f"Contact forces: quadrature error {error:.1e} of the largest normal force, estimated with a finer rule at "
            f"{INSTANTS} instants"
        )


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
