"""What a run prints on the terminal, on a console that takes no markup: text is text."""

import math

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.findings.accuracy import INSTANTS
from drumsqueal.findings.brake import brake_sentences
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.instant import Instant, name_of_key, unit_of_key
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.ramp import Ramp, value_words
from drumsqueal.findings.saturation import duration_for
from drumsqueal.findings.squeals import SquealEnd
from drumsqueal.findings.verdict import difference_is_no_error
from drumsqueal.physics.model import at_lining
from drumsqueal.scene import Scene
from drumsqueal.solve.transient.runge_kutta import AUTO, IMPLICIT
from drumsqueal.terminal.tables import print_model, print_table, signed

ENDS = {SquealEnd.DIES_OUT: "dies out", SquealEnd.STICKS: "sticks", SquealEnd.RECORD: "record ends"}


def print_findings(console: Console, found: RunFindings) -> None:
    """Print what the model holds, and the comparison of prediction and transient."""
    print_model(console, found.model)
    if found.held_though_they_would_move:
        held = ", ".join(found.held_though_they_would_move)
        console.print(f"Held at zero, though the other coordinates would move them: {held}", style="bold")
    for line in () if found.brake is None else brake_sentences(found.brake):
        console.print(line)
    print_table(console, _growth_table(found))
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
        print_table(console, _squeal_table(found.ramp, found.scene))
    if found.ramp is not None and found.ramp.passages:
        print_table(console, _passage_table(found.ramp))
    _print_saturation(console, found)
    if found.integration is not None and found.integration.implicit_share > 0 and found.scene.simulate.solver == AUTO:
        took = f"{100 * found.integration.implicit_share:.3g} % of the time"
        console.print(f"Friction is stiff: the implicit method {IMPLICIT} took {took}")
    _print_accuracy(console, found)
    console.print(found.verdict, style="bold")


def _growth_table(found: RunFindings) -> Table:
    table = Table(title="Onset: eigenvalues against the transient", box=box.SIMPLE_HEAD)
    predicted, measured = "predicted", "measured"
    if found.changing:
        predicted, measured = f"at t = {found.predicted_at_s:g} s", "mean"
    table.add_column("mode")
    for quantity, unit in (("frequency", "Hz"), ("growth", "1/s")):
        table.add_column(f"{quantity}\n{predicted}\n{unit}", justify="right")
        table.add_column(f"{quantity}\n{measured}\n{unit}", justify="right")
        if not found.changing:  # or it would compare one time with a mean over many
            table.add_column("error", justify="right")
    for mode in found.modes:
        frequency = [f"{mode.predicted_frequency_Hz:.2f}", _shown(mode.measured_frequency_Hz, ".2f")]
        growth = [signed(mode.predicted_growth_rate_1_per_s, "+.3f"), _shown(mode.measured_growth_rate_1_per_s, "+.3f")]
        if not found.changing:
            frequency.append(_shown(mode.frequency_error, "+.1e"))
            growth.append(_shown(mode.growth_rate_error, "+.1e"))
        table.add_row(mode.label, *frequency, *growth)
    return table


def _squeal_table(ramp: Ramp, scene: Scene) -> Table:
    what, unit = (" and ".join(dict.fromkeys(map(words, ramp.keys))) for words in (name_of_key, unit_of_key))
    title = f"Squeal while {what} {'changes' if len(ramp.keys) == 1 else 'change'}"
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=0)
    for header in (
        "sets in\ns",
        f"\n{unit}",
        f"largest\n{unit}",
        "\nsize",
        "line\nHz",
        f"lasts to\n{unit}",
        "ends\ns",
        f"\n{unit}",
    ):
        table.add_column(header, justify="right")
    table.add_column("\nhow")
    for each in ramp.squeals:
        size = f"{1e6 * each.amplitude:.3g}"
        if each.line is not None:
            factor, unit, shown = at_lining(scene, each.line.coordinate)
            size = f"{factor * each.amplitude:.3g} {unit} {shown}"
        table.add_row(
            *_moment(each.sets_in, ramp),
            value_words(each.largest, ramp.keys, unit=False),
            size,
            "-" if each.line is None else f"{each.line.frequency_Hz:.0f}",
            value_words(each.sustained_until, ramp.keys, unit=False),
            *_moment(each.ends, ramp),
            ENDS[each.end],
        )
    return table


def _passage_table(ramp: Ramp) -> Table:
    unit = " and ".join(dict.fromkeys(unit_of_key(key) for key in ramp.keys))
    table = Table(
        title="Growth integrated along the way: ∫ Re λ dt against the transient", box=box.SIMPLE_HEAD, padding=0
    )
    table.add_column("\nmode")
    for header in (
        "unstable\nfrom s", f"\n{unit}", "\nto s", f"\n{unit}", "e-folds\nneeded", "\nat hand",
        "boundary\npredicted", f"\n{unit}", "\nreached", f"\n{unit}",
    ):  # fmt: skip
        table.add_column(header, justify="right")
    for each in ramp.passages:
        table.add_row(
            each.mode,
            *_moment(each.unstable_from, ramp),
            *_moment(each.unstable_until, ramp),
            _shown(each.growth_needed if math.isfinite(each.growth_needed or 0.0) else None, ".2f"),
            f"{each.growth_available:.2f}",
            *_moment(each.predicted, ramp),
            *_moment(each.measured, ramp),
        )
    return table


def _moment(instant: Instant | None, ramp: Ramp) -> tuple[str, str]:
    """Time, and what changes, at an instant."""
    if instant is None:
        return "-", "-"
    return f"{instant.time_s:.4f}", value_words(instant, ramp.keys, unit=False)


def _shown(value: float | None, form: str) -> str:
    return "-" if value is None else signed(value, form)


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
