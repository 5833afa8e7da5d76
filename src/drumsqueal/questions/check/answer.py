"""What a check prints."""

import math

from rich.console import Console

from drumsqueal.findings.brake import brake_sentences
from drumsqueal.findings.columns import Column, columns_of, values_of
from drumsqueal.findings.prediction import resolution_in_words
from drumsqueal.questions.check.study import Amount, Check, MeshContents, PredictedGrowth
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.tables import print_cells, print_model, print_notes


def print_check(console: Console, found: Check) -> None:
    """Print numbers, growing modes, the record, the time it takes, and the warnings."""
    simulate = found.scene.simulate
    console.print(printable(f"{found.title or 'The scene'}: no mistakes found"), style="bold")
    print_model(console, found.model)
    columns = Column("number"), Column("value", ".6g"), Column("unit", missing=""), Column("meaning")
    numbers = ((name, each.value, each.unit, each.meaning) for name, each in found.numbers.items())
    print_cells(console, "What follows from it", columns, numbers)
    for mesh in found.meshes:
        _print_mesh(console, mesh)
    if found.brake is not None:
        for line in brake_sentences(found.brake):
            console.print(line)
    for line in [_grows(growth) for growth in found.growing] or ["No mode grows."]:
        console.print(line)
    print_notes(console, resolution_in_words(found.prediction.resolution))
    console.print(
        f"Highest frequency {found.highest_frequency_Hz:.5g} Hz: at least {found.least_sample_rate_Hz:.5g} samples a "
        f"second are needed, and {simulate.sample_rate:g} are taken"
    )
    size = f"about {found.history_bytes / 1e6:.2g} MB"
    console.print(f"{found.samples} samples in {simulate.duration:g} s, history.nc of {size}")
    console.print(_takes(found))
    print_notes(console, found.warnings)


def _print_mesh(console: Console, mesh: MeshContents) -> None:
    """Elements by type, volume and mass by set, and the bounding box, to compare with one's own model."""
    types = ", ".join(f"{count} {name}" for name, count in mesh.elements_by_type.items())
    console.print(printable(f"Mesh of the {mesh.body}, {mesh.file}: {types}"))
    columns = Column("set"), *columns_of(Amount).values()
    amounts = (("all", mesh.whole), *mesh.sets.items())
    rows = ((printable(name), *values_of(each)) for name, each in amounts)
    print_cells(console, "", columns, rows)
    if mesh.point_masses:
        places = "1 node" if mesh.point_masses == 1 else f"{mesh.point_masses} nodes"
        console.print(f"Point masses at {places}, in addition: {mesh.point_masses_kg:.6g} kg")
    ranges = zip("xyz", mesh.lowest_m, mesh.highest_m, strict=True)
    console.print(f"Bounding box: {', '.join(f'{axis} {low:.6g} to {high:.6g} m' for axis, low, high in ranges)}")
    print_notes(console, map(printable, mesh.notes))


def _grows(growth: PredictedGrowth) -> str:
    grows = f"{growth.label} grows: {growth.frequency_Hz:.2f} Hz, {growth.growth_rate:+.3f} 1/s"
    if growth.edge_time is None:
        return f"{grows}; the start does not excite it"
    start = f"{grows}; the start is {growth.start_share:.2g} of the way to the nearest contact boundary"
    if growth.edge_time == 0:
        return f"{start}, and so beyond it"
    return f"{start}, which this mode alone reaches after {growth.edge_time:.3g} s"


def _takes(found: Check) -> str:
    """The time of a run, as the estimate that it is."""
    if found.estimate is None:
        return "How long a run takes was not measured: --measure does, or measure=True in Python"
    seconds, evaluations, whole = found.estimate.integration_s, found.estimate.evaluations, found.estimate.run_s
    if seconds is None:
        return "Computing time unknown: the integration fails soon after the start"
    counted = "" if evaluations is None or math.isnan(evaluations) else f" ({evaluations:.2g} evaluations)"
    text = f"Estimated from short pieces of the run: about {_duration(seconds)} of integration{counted}"
    return text if whole is None else f"{text}, {_duration(whole)} in all once it is compiled"


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.1g} s" if seconds < 1 else f"{seconds:.2g} s"
    return f"{seconds / 60:.2g} min" if seconds < 7200 else f"{seconds / 3600:.2g} h"
