"""What a run prints on the terminal, on a console that takes no markup: text is text."""

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.findings.accuracy import INSTANTS
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.saturation import duration_for
from drumsqueal.findings.signals.regime import Kind
from drumsqueal.findings.verdict import difference_is_no_error
from drumsqueal.solve.transient.runge_kutta import AUTO, IMPLICIT
from drumsqueal.terminal.tables import print_model, print_table


def print_findings(console: Console, found: RunFindings) -> None:
    """Print what the model holds, and the comparison of prediction and transient."""
    print_model(console, found.model)
    if found.held_though_they_would_move:
        held = ", ".join(found.held_though_they_would_move)
        console.print(f"Held at zero, though the other coordinates would move them: {held}", style="bold")
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
        growth = [f"{mode.predicted_growth_rate_1_per_s:+.3f}", _shown(mode.measured_growth_rate_1_per_s, "+.3f")]
        if not found.changing:
            frequency.append(_shown(mode.frequency_error, "+.1e"))
            growth.append(_shown(mode.growth_rate_error, "+.1e"))
        table.add_row(mode.label, *frequency, *growth)
    return table


def _shown(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


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
