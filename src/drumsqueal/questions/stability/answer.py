"""What an eigenvalue problem prints on the terminal."""

import math

from rich.console import Console
from rich.text import Text

from drumsqueal.coordinates import is_elastic, unit_of
from drumsqueal.findings.brake import Brakes, ShoeAsBrake, brake_sentences
from drumsqueal.findings.columns import Column, columns_of, values_of
from drumsqueal.findings.prediction import PredictedMode, predict, sliding_later, turned_far
from drumsqueal.solve.linear.modes import UNDAMPED_FRACTION, Stability, divergence_words, without_oscillation
from drumsqueal.terminal.tables import print_cells, print_notes


def print_stability(console: Console, stability: Stability) -> None:
    """Print the eigenvalues and steady sliding, as of a scene whose assembly balances it."""
    print_eigenvalues(console, stability)
    print_sliding(console, stability, None)


def print_eigenvalues(console: Console, stability: Stability) -> None:
    """Print the modes, the unstable ones first, and the other eigenvalues."""
    rows = (
        (label, *values_of(mode), Text("unstable", style="bold red") if mode.unstable else "stable")
        for label, mode in sorted(predict(stability).labelled.items(), key=lambda each: not each[1].unstable)
    )
    columns = Column("mode"), *columns_of(PredictedMode).values(), Column()
    print_cells(console, "Modes of steady sliding", columns, rows)
    unstable, modes = len(stability.unstable), len(stability.modes)
    if modes:
        of = "1 mode" if modes == 1 else f"{modes} modes"
        console.print(f"{unstable} of {of} {'is' if unstable == 1 else 'are'} unstable.")
    for each in stability.unresolved:
        beyond = f"{each.imag / math.tau:.0f} Hz, {each.real:+.3g} 1/s"
        console.print(f"Beyond what is resolved one more grows, at {beyond}: raise up_to to see what it is.")
    largest = max(abs(stability.eigenvalues), default=0.0)
    if real := without_oscillation(stability.eigenvalues).tolist():
        rounded = [0.0 if abs(value) < UNDAMPED_FRACTION * largest else value for value in real]  # off round-off
        drifts = " (0: nothing holds this motion, and nothing drives it)" if 0.0 in rounded else ""
        console.print("Without oscillation: " + ", ".join(f"{value:.3f} 1/s" for value in rounded) + drifts)
    if stability.divergence is not None:
        console.print(f"Steady sliding is statically unstable: {divergence_words(stability.divergence)}")


def print_sliding(console: Console, stability: Stability, brake: ShoeAsBrake | Brakes | None) -> None:
    """Print where the shoe slides steadily and how it is pressed, as a brake if given."""
    moved = {n: q for n, q in zip(stability.coordinates, stability.steady_state, strict=True) if q != 0}
    if moved:
        places = [f"{name} = {q:.4g} {unit_of(name)}" for name, q in moved.items() if not is_elastic(name)]
        places += [f"bent in {len(moved) - len(places)} shapes"] if len(moved) > len(places) else []
        console.print("Steady sliding at " + ", ".join(places))
    print_notes(console, turned_far(stability))
    if stability.time > 0:
        console.print(sliding_later(stability))
    if brake is not None:
        for line in brake_sentences(brake):
            console.print(line, soft_wrap=True)
        return
    low, high = stability.pressure_range
    console.print(f"Steady pressure from {low / 1e3:.2f} to {high / 1e3:.2f} kPa along the lining")
