"""A study of effects as a table: on the terminal and as CSV."""

import math
from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from drumsqueal.findings.departure import unit_of
from drumsqueal.findings.history import versions
from drumsqueal.questions.effects.study import ROUND_OFF, EffectStudy, percent, remarks, reservations, verdict
from drumsqueal.questions.effects.variants import Variant
from drumsqueal.terminal.tables import print_table, rows_to_csv

UNSHOWN = 1e-4  # a relative change below it has no digits on the terminal
# Of the fields of a change, in their order.
HEADINGS = ("growth\nrates\n%", "onset\nfreq.\n%", "end\nampl.\n%", "end\nfreq.\n%")


def print_study(console: Console, study: EffectStudy) -> None:
    """Print every run with its cost and its changes, and what follows from them."""
    table = Table(title="What each effect costs and changes", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("left out or reduced")
    table.add_column("time\n\nms/ms", justify="right")
    table.add_column("eval.\n\nper ms", justify="right")
    for heading in HEADINGS:
        table.add_column(heading, justify="right")
    for variant in study.variants:
        needed = study.needs(variant)
        name = Text(f"{variant.label} *" if needed else variant.label, style="bold" if needed else "")
        table.add_row(name, *_costs(variant), *_changes(variant))
    print_table(console, table)
    footnote = f"{_explained(study)} * needed within {percent(study.within)}."
    for line in (footnote, *remarks(study), *reservations(study)):
        console.print(line, style="dim")
    console.print(verdict(study), style="bold")


def to_csv(variants: Sequence[Variant], study: EffectStudy | None = None) -> str:
    """One row a run: cost, eigenvalues, the motion at the end, and relative changes from the whole scene.

    Which effects the scene needs is in it once the study is over.
    """
    return rows_to_csv(_rows(variants, study))


def to_data(study: EffectStudy) -> dict[str, Any]:
    """The same rows, what follows from them, and the reduced scene, as plain data."""
    return {
        "title": study.scene.title,
        "within": study.within,
        "verdict": verdict(study),
        "remarks": [*remarks(study), *reservations(study)],
        "runs": _rows(study.variants, study),
        "reduced_scene": study.reduced.model_dump(mode="json"),
        "scene": study.scene.model_dump(mode="json"),
        "versions": versions(),
    }


def _rows(variants: Sequence[Variant], study: EffectStudy | None) -> list[dict[str, Any]]:
    rows = [_row(variant, variants[0]) for variant in variants]
    for row, variant in zip(rows, variants, strict=True):
        if study is not None and len(variant.reductions) == 1:
            row["needed"] = "yes" if study.needs(variant) else "no"
    return rows


def _row(variant: Variant, whole: Variant) -> dict[str, Any]:
    row: dict[str, Any] = {
        "run": variant.label,
        "left_out": "; ".join(map(str, variant.reductions)),
        "outcome": variant.outcome,
        "computing_ms_per_simulated_ms": _number(variant.time_per_ms),
        "evaluations_per_simulated_ms": _number(variant.evaluations_per_ms),
    }
    answer = variant.answer
    if answer is not None and whole.answer is not None:
        for label, mode in answer.modes.items():
            row[f"frequency_{label}_Hz"] = mode.frequency_Hz
            row[f"growth_rate_{label}_1_per_s"] = mode.growth_rate
        for name in whole.answer.amplitude:
            row[f"end_amplitude_{name}_{unit_of(name)}"] = answer.amplitude.get(name, 0.0)
        row["end_frequency_Hz"] = None if answer.main is None else answer.main.frequency_Hz
    if variant.change is not None:
        row |= {f"change_of_{field}": _number(value) for field, value in variant.change._asdict().items()}
    return row


def _number(value: float | None) -> float | None:
    """An empty cell for what is not known; an infinite change, of what one of two runs lacks, is written inf."""
    return None if value is None or math.isnan(value) else value


def _costs(variant: Variant) -> tuple[str, str]:
    if math.isnan(variant.time_per_ms):
        return "-", "-"
    return f"{variant.time_per_ms:.3g}", f"{variant.evaluations_per_ms:.0f}"


def _changes(variant: Variant) -> list[str]:
    if variant.answer is None:
        return ["failed", *[""] * (len(HEADINGS) - 1)]
    if variant.change is None:
        return [""] * len(HEADINGS)
    return [_change(value) for value in variant.change]


def _change(value: float | None) -> str:
    if value is None:
        return "-"
    if math.isinf(value):
        return "lost"
    return "<0.01" if ROUND_OFF < abs(value) < UNSHOWN else percent(value, "+").removesuffix(" %")


def _explained(study: EffectStudy) -> str:
    answer = study.variants[0].answer
    text = (
        "Time and evaluations for a simulated millisecond. Changes from the whole scene: of growth rates and onset "
        "frequencies the largest over the modes"
    )
    if answer is None or not answer.carriers:
        return f"{text}."
    return (
        f"{text}; at the end, of the amplitude (half peak to peak) the largest over {', '.join(answer.carriers)}, and "
        "of the frequency of the strongest line, which may be another one."
    )
