"""What an eigenvalue problem prints, and what it leaves open: whether a large disturbance leads to squeal."""

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text

from drumsqueal.coordinates import is_elastic, unit_of
from drumsqueal.findings.brake import Brakes, ShoeAsBrake, brake_sentences
from drumsqueal.findings.columns import Column, columns_of, values_of
from drumsqueal.findings.prediction import PredictedMode, predict, sliding_later, turned_far
from drumsqueal.physics.composition import moved_coordinates
from drumsqueal.scene import Profile, Scene
from drumsqueal.scene.file import written
from drumsqueal.scene.quantities import RPM, printable
from drumsqueal.scene.variation import Variation
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


def bistable_words(
    scene: Scene, stability: Stability, file: Path, settings: Sequence[str], *, squeals: bool = False
) -> str | None:
    """The sentence for a scene, which may squeal from its own start; None where nothing presses, where `onset` does not
    take the scene, and for shoes that share a drum that bends, where it does not end in reasonable time.

    `file` and `settings` (those of --set) are given to the command that finds out.
    """
    speed = scene.drum.speed
    if stability.divergence is not None or scene.forcing is not None or scene.several:
        return None
    if isinstance(speed, Profile) or any(isinstance(each, Profile) for each in scene.schedules().values()):
        return None
    if not (moved_coordinates(scene) and scene.rubs and scene.pressed):
        return None
    given = [part for each in settings for part in ("--set", each)]
    rpm = math.isclose(speed / RPM, float(f"{speed / RPM:.4g}"), rel_tol=1e-9)  # where that is a round number
    # The study looks from 0.9 to 1.1 times the drum's speed, and at that speed itself in the middle.
    ends = tuple(each * speed for each in (0.9, 1.1))
    range_ = Variation("drum.speed", "rad/s", ends, "rpm" if rpm else "rad/s", RPM if rpm else 1.0)
    first, last = range_.listed(range_.first), range_.listed(range_.last)
    along = f"drum.speed={first:.10g}..{last:.10g} {range_.given} x 3"
    command = shlex.join(["drumsqueal", "onset", written(file), *given, "--along", along])
    if squeals or stability.unstable:
        return f"Other disturbances may lead to another squeal; which there are, and what leads to each: {command}"
    return (
        "A large disturbance may still lead to sustained squeal (the bistable, subcritical range); "
        f"to find out: {command}"
    )


def print_bistable(
    console: Console, scene: Scene, stability: Stability, file: Path, settings: Sequence[str], *, squeals: bool = False
) -> None:
    """Print the sentence, where there is one."""
    sentence = bistable_words(scene, stability, file, settings, squeals=squeals)
    if sentence is not None:
        console.print(printable(sentence), soft_wrap=True)
