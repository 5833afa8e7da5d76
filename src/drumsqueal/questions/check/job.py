"""A scene explained before it is run: on the terminal and as plain data."""

import math
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.findings.history import versions
from drumsqueal.findings.prediction import predict
from drumsqueal.questions.check.study import Check, Growth, check_scene
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.quantities import printable
from drumsqueal.scene.usual import unusual
from drumsqueal.terminal.tables import print_notes, print_table

# What a run takes beside its integration goes with the speed of the machine, as does loading the package: comparison,
# figures and programs fetched from the cache took so many times as long, for the shipped scenes.
BESIDE = 4.0
LOADED = 0.3  # s; loading that is faster did not happen, for all was loaded before


def check(scene: Scene, console: Console, loading: float) -> tuple[Check, dict[str, Any]]:
    """Explain a scene, print and return it, also as plain data; `loading` (s) is what it took to load the package.

    Raises SceneError for a scene that cannot be run.
    """
    with console.status("compiling and timing pieces of the transient"):
        try:
            found = check_scene(scene)
        except SceneError:  # which a number in a wrong unit may have brought about
            print_notes(console, unusual(scene))
            raise
    whole = _whole(found, loading)
    print_check(console, found, whole)
    return found, to_data(found, whole)


def _whole(found: Check, loading: float) -> float | None:
    """The time of a whole `drumsqueal run` (s) whose programs are compiled."""
    if found.run_time.seconds is None or loading < LOADED:
        return None
    return found.run_time.seconds + (1 + BESIDE) * loading


def print_check(console: Console, found: Check, whole: float | None) -> None:
    """Print numbers, growing modes, the record, the time it takes, and the warnings."""
    inventory, simulate = found.prepared.inventory, found.scene.simulate
    console.print(printable(f"{found.scene.title or 'The scene'}: no mistakes found"), style="bold")
    console.print(f"Includes: {'; '.join(inventory.includes)}", style="dim")
    console.print(f"Leaves out: {'; '.join(inventory.leaves_out) or 'nothing'}", style="dim")
    table = Table(title="What follows from it", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("number")
    table.add_column("value", justify="right")
    table.add_column("unit")
    table.add_column("meaning")
    for number in found.numbers:
        table.add_row(number.name, f"{number.value:.6g}", number.unit, number.meaning)
    print_table(console, table)
    if not found.growing:
        console.print("No mode grows.")
    for growth in found.growing:
        console.print(_grows(growth))
    console.print(
        f"Highest frequency {found.least_sample_rate / 2:.5g} Hz: at least {found.least_sample_rate:.5g} samples a "
        f"second are needed, and {simulate.sample_rate:g} are taken"
    )
    console.print(f"{found.samples} samples in {simulate.duration:g} s, history.nc of {_megabytes(found)}")
    console.print(_takes(found, whole))
    print_notes(console, found.warnings)


def _grows(growth: Growth) -> str:
    told = f"{growth.label} grows: {growth.frequency_Hz:.2f} Hz, {growth.growth_rate:+.3f} 1/s"
    if growth.edge_time is None:
        return f"{told}; the start does not excite it"
    edge = "beyond an edge from the start" if growth.edge_time == 0 else f"at an edge after {growth.edge_time:.3g} s"
    return f"{told}; starts at {growth.start_share:.2g} of the nearest edge and, alone, is {edge}"


def _megabytes(found: Check) -> str:
    return f"about {found.history_bytes / 1e6:.2g} MB"


def _takes(found: Check, whole: float | None) -> str:
    """The time of a run, said to be an estimate."""
    time = found.run_time
    if time.seconds is None:
        return "How long it takes cannot be told: the integration fails soon after the start"
    counted = (
        "" if time.evaluations is None or math.isnan(time.evaluations) else f" ({time.evaluations:.2g} evaluations)"
    )
    told = f"Estimated here, from pieces of it: about {_duration(time.seconds)} of integration{counted}"
    return told if whole is None else f"{told}, {_duration(whole)} in all once it is compiled"


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.1g} s" if seconds < 1 else f"{seconds:.2g} s"
    return f"{seconds / 60:.2g} min" if seconds < 7200 else f"{seconds / 3600:.2g} h"


def to_data(found: Check, whole: float | None) -> dict[str, Any]:
    """Everything of a check in SI; None for what could not be told."""
    prepared = found.prepared
    return {
        "title": found.scene.title,
        "numbers": {each.name: {"value": each.value, "unit": each.unit} for each in found.numbers},
        "prediction": predict(prepared.stability).model_dump(mode="json"),
        "growing": [each._asdict() for each in found.growing],
        "start_share_of_contact_loss": found.start_shares[0],
        "start_share_of_slip_reversal": found.start_shares[1],
        "first_edge_s": found.edge_time,
        "highest_frequency_Hz": found.least_sample_rate / 2,
        "least_sample_rate_Hz": found.least_sample_rate,
        "samples": found.samples,
        "history_bytes": found.history_bytes,
        "estimate": {
            "integration_s": found.run_time.seconds,
            "evaluations": found.run_time.evaluations,
            "run_s": whole,
        },
        "warnings": list(found.warnings),
        "model": {key: list(words) for key, words in prepared.inventory._asdict().items()},
        "scene": found.scene.model_dump(mode="json"),
        "versions": versions(),
    }
