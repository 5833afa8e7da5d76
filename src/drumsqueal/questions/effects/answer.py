"""What a study of effects writes and prints."""

import math

from rich import box
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from drumsqueal.files.output_folder import EFFECTS, EFFECTS_TABLE, REDUCED_SCENE
from drumsqueal.questions.effects.figure import draw_effects
from drumsqueal.questions.effects.study import EffectStudy
from drumsqueal.questions.effects.variants import Variant
from drumsqueal.scene.quantities import ROUND_OFF, percent, printable
from drumsqueal.terminal.runner import Answer
from drumsqueal.terminal.tables import print_table, rows_to_csv

UNSHOWN = 1e-4  # a relative change below it has no digits on the terminal
# Of the fields of a change.
HEADINGS = {
    "growth_rate": "growth\nrates\n%",
    "onset_frequency": "onset\nfreq.\n%",
    "amplitude": "end\nampl.\n%",
    "main_frequency": "end\nfreq.\n%",
}


def print_study(console: Console, study: EffectStudy) -> None:
    """Print every run with its cost and its changes, and what follows from them."""
    headings = "time\n\nms/ms", "eval.\n\nper ms", *HEADINGS.values()
    columns = "left out or reduced", *(Column(heading, justify="right") for heading in headings)
    table = Table(*columns, title="What each effect costs and changes", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for variant in study.variants:
        needed = study.needs(variant)
        name = Text(f"{variant.label} *" if needed else variant.label, style="bold" if needed else "")
        costs = f"{variant.time_per_ms:.3g}", f"{variant.evaluations_per_ms:.0f}"
        table.add_row(name, *(("-", "-") if math.isnan(variant.time_per_ms) else costs), *_changes(variant))
    print_table(console, table)
    for line in (f"{_explained(study)} * needed within {percent(study.within)}.", *study.remarks):
        console.print(line, style="dim")
    console.print(study.verdict, style="bold")


def reduced_scene(study: EffectStudy) -> str | None:
    """The scene with what it needs, as a file that states what was left out; None before the study is over."""
    if study.reduced_scene is None:
        return None
    remarks = "".join(f"# {printable(remark)}\n" for remark in (study.verdict, *study.remarks))
    return f"{remarks}{study.reduced_scene.to_toml()}"


def _changes(variant: Variant) -> list[str]:
    if variant.answer is None:
        return ["failed", *[""] * (len(HEADINGS) - 1)]
    if variant.change is None:
        return [""] * len(HEADINGS)
    return [_change(getattr(variant.change, field)) for field in HEADINGS]


def _change(value: float | None) -> str:
    if value is None:
        return "-"
    if math.isinf(value):
        return "lost"
    return "<0.01" if ROUND_OFF < abs(value) < UNSHOWN else percent(value, "+").removesuffix(" %")


def _explained(study: EffectStudy) -> str:
    answer = study.variants[0].answer
    text = "Time and evaluations for a simulated millisecond. Changes from the whole scene: of growth rates and onset "
    text += "frequencies the largest over the modes"
    if answer is not None and answer.carriers:
        text += (
            f"; at the end, of the amplitude (half peak to peak) the largest over {', '.join(answer.carriers)}, and "
        )
        text += "of the frequency of the strongest line, which may be another one"
    return f"{text}."


EFFECTS_ANSWER = Answer(
    words=print_study,
    tables={EFFECTS_TABLE: lambda study: rows_to_csv(study.runs), REDUCED_SCENE: reduced_scene},
    figures={EFFECTS: draw_effects},
)
