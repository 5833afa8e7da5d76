"""What the study of sensitivity writes, draws and prints."""

import numpy as np
from matplotlib.figure import Figure
from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.files.output_folder import QUIET_SCENE, SENSITIVITY, SENSITIVITY_SUMMARY, SENSITIVITY_TABLE
from drumsqueal.questions.sensitivity.decay import Decay, Outcome
from drumsqueal.questions.sensitivity.quieting import Change, Quieting
from drumsqueal.questions.sensitivity.study import SensitivityStudy
from drumsqueal.scene.quantities import printable
from drumsqueal.scene.variation import unit_of
from drumsqueal.terminal import style
from drumsqueal.terminal.runner import Answer
from drumsqueal.terminal.style import frame, new_figure, styled
from drumsqueal.terminal.tables import print_table, rows_to_csv

LEAST_PLAIN = 0.01  # 1/s
ROW = 0.8  # of the distance between two numbers that their bars take up
HATCHES = ("", "////", "....")  # of a second and a third mode of one name
NEGLIGIBLE = 1e-4  # relative change that the sentence leaves out


def print_study(console: Console, study: SensitivityStudy) -> None:
    """Print every number with the change of every growth rate per +1 %, and the smallest change that was found."""
    table = Table(title="Change of each growth rate per +1 %, in 1/s", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("number")
    table.add_column("SI value", justify="right")
    for mode in study.modes:
        heading = f"{mode.label}\n{mode.frequency_Hz:.0f} Hz\n{mode.growth_rate_1_per_s:+.4g}"
        table.add_column(heading, justify="right")
    for row in study.numbers:
        table.add_row(
            row.key, f"{row.value_SI:.3g}", *(_change(study, each) for each in row.growth_per_percent_1_per_s)
        )
    print_table(console, table)
    names = ", ".join(study.modes[k].label for k in study.relevant)
    kind = "unstable modes" if study.modes[study.relevant[0]].unstable else "modes"
    console.print(
        f"Sorted by the largest change of the {kind} {names}; 0: below round-off. Automatic derivatives and central "
        f"differences of ±0.1 % agree to {study.largest_deviation_from_central_differences:.1g} of the largest.",
        style="dim",
    )
    if study.divergence_rate_1_per_s is not None:
        console.print(
            f"A motion without oscillation also grows: {study.divergence_rate_1_per_s:+.4g} 1/s.", style="dim"
        )
    if study.quiet is not None:
        _print_quiet(console, study.quiet)
    elif study.until_stable:
        console.print("Nothing in this scene is unstable: there is nothing to make quiet.", style="bold")


def _print_quiet(console: Console, quiet: Quieting) -> None:
    title = "The smallest change that makes every mode decay" if quiet.found else "The change with the least growth"
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("number", "before, SI", "after, SI", "change"):
        table.add_column(heading, justify="left" if heading == "number" else "right")
    for change in _by_size(quiet):
        relative = f"{100 * change.relative:+.3g} %" if change.before else "new"
        table.add_row(change.key, f"{change.before:.6g}", f"{change.after:.6g}", relative)
    print_table(console, table)
    if quiet.found:
        console.print(printable(quiet_sentence(quiet)), style="bold")


def _by_size(quiet: Quieting) -> list[Change]:
    return sorted(quiet.changes, key=lambda each: -abs(each.relative))


def quiet_sentence(quiet: Quieting) -> str:
    """What to change, what the eigenvalues say of it, and what the transients do."""
    large = [change for change in _by_size(quiet) if abs(change.relative) > NEGLIGIBLE]
    named = ", ".join(
        f"{each.key} changed from {each.before:.4g} to {each.after:.4g} {unit_of(each.key, quiet.scene)}".rstrip()
        for each in large[:3]
    )
    more = f" and {len(large) - 3} smaller changes" if len(large) > 3 else ""
    stable = f"Stable with {named}{more}: every growth rate is {quiet.largest_growth_rate_1_per_s:.3g} 1/s or below."
    return " ".join([stable, *map(_ending, quiet.transients)])


def not_found(quiet: Quieting) -> str:
    """Why a search has no result."""
    names = ", ".join(change.key for change in quiet.changes)
    least = f"the largest growth rate can be brought down to {quiet.largest_growth_rate_1_per_s:+.4g} 1/s"
    return f"no change of {names} within the bounds makes every mode decay; {least}"


def _ending(decay: Decay) -> str:
    """How a transient of the changed scene ends."""
    mostly = "" if decay.frequency_Hz is None else f", mostly at {decay.frequency_Hz:.0f} Hz"
    ends = {
        Outcome.DECAYS: "the transient decays; at its end there is neither lift-off nor slip reversal",
        Outcome.SQUEALS: f"the transient keeps squealing: its motion is {decay.kind}{mostly}",
        Outcome.NOT_SETTLED: f"the transient has not settled within {decay.duration_s} s; run it for longer",
        Outcome.NOT_STARTED: "no transient was run, because nothing was started",
        Outcome.FAILED: f"the transient failed: {decay.reason}",
    }
    return f"From {decay.start} {ends[decay.outcome]}."


def sensitivity_table(study: SensitivityStudy) -> str:
    """One row a number and mode, as CSV: derivatives in SI and per +1 %, and the same by central differences."""
    rows = []
    for row in study.numbers:
        by_mode = row.model_dump(exclude={"key", "value_SI"})
        for k, mode in enumerate(study.modes):
            of_mode = {
                "number": row.key,
                "value_SI": row.value_SI,
                "mode": mode.label,
                "frequency_Hz": mode.frequency_Hz,
                "growth_rate_1_per_s": mode.growth_rate_1_per_s,
            }
            rows.append(of_mode | {name: values[k] for name, values in by_mode.items()})
    return rows_to_csv(rows)


def quiet_scene(study: SensitivityStudy) -> str | None:
    """The changed scene as a file, headed by what was found; None where there is none."""
    if study.quiet is None or not study.quiet.found:
        return None
    return f"# {printable(quiet_sentence(study.quiet))}\n{study.quiet.scene.to_toml()}"


def _change(study: SensitivityStudy, value: float) -> str:
    if abs(value) <= study.round_off_1_per_s:
        return "0"
    return f"{value:+.2g}" if abs(value) >= LEAST_PLAIN else f"{value:+.0e}"  # so that six modes fit on a terminal


@styled()
def draw_sensitivity(study: SensitivityStudy) -> Figure:
    """Draw the change of the growth rates of the modes that matter, per +1 % of each number."""
    shown = [study.modes[k] for k in study.relevant]
    kind = "unstable modes" if shown[0].unstable else "no mode is unstable; all"
    figure = new_figure(study.title, f"what +1 % of each number does to the growth rates ({kind})")
    axes = figure.subplots()
    places = np.arange(len(study.numbers))
    height = ROW / len(shown)
    for k, mode in enumerate(shown):
        values = [row.growth_per_percent_1_per_s[study.relevant[k]] for row in study.numbers]
        shift = (k - (len(shown) - 1) / 2) * height
        earlier = sum(other.name == mode.name for other in shown[:k])
        label = f"{mode.label}: {mode.frequency_Hz:.0f} Hz, {mode.growth_rate_1_per_s:+.3g} 1/s"
        hatch = HATCHES[min(earlier, len(HATCHES) - 1)]
        axes.barh(places + shift, values, height=height, color=style.COLOUR[mode.name], hatch=hatch, label=label)
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    axes.set_yticks(places, [row.key for row in study.numbers])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(study.numbers) - 0.5, -0.5)
    for place in places[1:]:
        axes.axhline(place - 0.5, color=style.FAINT, linewidth=0.4, zorder=0.5)
    frame(axes, "Change of the growth rate per +1 % (1/s): to the left it grows slower, to the right faster", None)
    figure.legend(loc="outside lower center", ncols=min(len(shown), 3))
    return figure


SENSITIVITY_ANSWER = Answer(
    words=print_study,
    summary=SENSITIVITY_SUMMARY,
    tables={SENSITIVITY_TABLE: sensitivity_table, QUIET_SCENE: quiet_scene},
    figures={SENSITIVITY: draw_sensitivity},
)
