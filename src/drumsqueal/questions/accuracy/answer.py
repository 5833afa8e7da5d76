"""What a study of accuracy writes and prints."""

import math
from functools import partial
from itertools import groupby

import tomli_w
from rich import box
from rich.console import Console
from rich.table import Column, Table

from drumsqueal.files.output_folder import ACCURACY_TABLE, BLOCK, CAUSES, EVALUATIONS, WORK
from drumsqueal.questions.accuracy.bench import Measurement
from drumsqueal.questions.accuracy.figure import draw_causes, draw_work
from drumsqueal.questions.accuracy.study import AccuracyStudy
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.runner import Answer
from drumsqueal.terminal.tables import print_table, rows_to_csv

HEADINGS = ("time\nms/ms", "eval.\nper ms", "growth\nphase", "beyond\nit", "features", "energy")
MANY = 99.5  # ms, from which on a time is written without an exponent


def print_study(console: Console, study: AccuracyStudy) -> None:
    """Print every measurement, how good the reference is, and what meets the target."""
    columns = Column("run", vertical="bottom"), *(Column(each, justify="right", vertical="bottom") for each in HEADINGS)
    look = {"box": box.SIMPLE_HEAD, "pad_edge": False, "padding": (0, 1, 0, 0)}
    table = Table(*columns, title="What accuracy costs in time", **look)
    for _, line in groupby(study.measurements, key=lambda each: each.contender.line):
        for measurement in line:
            if not math.isnan(measurement.compile_seconds):  # it was tried
                table.add_row(measurement.contender.name, *_cells(measurement))
        table.add_section()
    print_table(console, table)
    for remark in study.remarks:
        console.print(remark, style="dim")
    console.print(study.verdict, style="bold")
    console.print(simulate_block(study))


def simulate_block(study: AccuracyStudy) -> str:
    """The `[simulate]` table that meets the target, or a comment that none does."""
    if study.simulate is None:
        return f"# no run meets {study.target:.0e}\n"
    return tomli_w.dumps({"simulate": study.simulate})


def settings_file(study: AccuracyStudy) -> str | None:
    """That table under what was found; None before the study is over."""
    return f"# {printable(study.verdict)}\n{simulate_block(study)}" if study.verdict else None


def to_csv(study: AccuracyStudy) -> str:
    """One row a run, with every repeat's time, the versions and the machine."""
    machine = {"machine": study.machine, "processor": study.processor, "cores": study.cores}
    return rows_to_csv([row | machine | study.versions for row in study.runs])


def _cells(measurement: Measurement) -> list[str]:
    errors = measurement.errors
    if errors is None:
        return ["failed"]
    found = (errors.trajectory, errors.beyond, errors.largest_feature, errors.energy)
    evaluations = measurement.evaluations_per_ms
    counted = "-" if math.isnan(evaluations) else f"{evaluations:.0f}"
    time = measurement.time_per_ms
    return [
        f"{time:.2g}" if time < MANY else f"{time:.0f}",
        counted,
        *("-" if e is None else f"{e:.0e}" for e in found),
    ]


ACCURACY = Answer(
    words=print_study,
    tables={ACCURACY_TABLE: to_csv, BLOCK: settings_file},
    figures={
        WORK: partial(draw_work, against="time"),
        EVALUATIONS: partial(draw_work, against="evaluations"),
        CAUSES: draw_causes,
    },
)
