"""A study of sensitivity as a table: on the terminal, as CSV and as plain data; the quiet scene in one sentence."""

import math
from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.findings.history import versions
from drumsqueal.questions.sensitivity.decay import Decay
from drumsqueal.questions.sensitivity.quieting import Quieting
from drumsqueal.questions.sensitivity.study import PERCENT, Sensitivity, SensitivityStudy
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.tables import print_table, rows_to_csv

LEAST_PLAIN = 0.01  # 1/s
NEGLIGIBLE = 1e-4  # relative change that the sentence leaves out


def print_sensitivity(console: Console, study: SensitivityStudy) -> None:
    """Print every number with the change of every growth rate per +1 %."""
    table = Table(title="Change of each growth rate per +1 %, in 1/s", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("number")
    table.add_column("SI value", justify="right")
    for mode in study.modes:
        heading = f"{mode.label}\n{mode.frequency_Hz:.0f} Hz\n{mode.growth_rate:+.4g}"
        table.add_column(heading, justify="right")
    for row in study.rows:
        table.add_row(row.key, f"{row.value:.3g}", *(_change(study, value) for value in row.growth_per_percent))
    print_table(console, table)
    told = ", ".join(study.modes[k].label for k in study.told)
    kind = "unstable modes" if study.stability.unstable else "modes"
    console.print(
        f"By the largest change of the {kind} {told}; 0: none to round-off. Automatic derivatives and central "
        f"differences of ±0.1 % agree to {study.deviation:.1g} of the largest.",
        style="dim",
    )
    if study.stability.divergence is not None:
        console.print(f"A motion without oscillation grows, too: {study.stability.divergence:+.4g} 1/s.", style="dim")


def print_quieting(console: Console, quiet: Quieting, decays: Sequence[Decay]) -> None:
    """Print the changes one by one, and the sentence."""
    table = Table(title="The smallest change that makes every mode decay", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("number", "before, SI", "after, SI", "change"):
        table.add_column(heading, justify="left" if heading == "number" else "right")
    for change in sorted(quiet.changes, key=lambda each: -abs(each.relative)):
        told = f"{100 * change.relative:+.3g} %" if change.before else "new"
        table.add_row(change.key, f"{change.before:.6g}", f"{change.after:.6g}", told)
    print_table(console, table)
    console.print(printable(quiet_sentence(quiet, decays)), style="bold")


def quiet_sentence(quiet: Quieting, decays: Sequence[Decay]) -> str:
    """What to change, what the eigenvalues say of it, and what the transients do."""
    large = [change for change in quiet.changes if abs(change.relative) > NEGLIGIBLE]
    large.sort(key=lambda each: -abs(each.relative))
    named = ", ".join(f"{change.key} changed from {change.before:.4g} to {change.after:.4g}" for change in large[:3])
    more = f" and {len(large) - 3} smaller changes" if len(large) > 3 else ""
    told = "".join(f"; from {decay.start} the transient {_ending(decay)}" for decay in decays)
    return f"Stable with {named}{more}: every growth rate is {quiet.largest_growth:.3g} 1/s or below{told}."


def _ending(decay: Decay) -> str:
    return "was not run, for nothing was started" if decay.outcome == "nothing was started" else decay.outcome


def to_csv(study: SensitivityStudy) -> str:
    """One row a number and mode: derivatives in SI and per +1 %, and the same by central differences."""
    rows = []
    for row in study.rows:
        for k, mode in enumerate(study.modes):
            rows.append(
                {
                    "number": row.key,
                    "value_SI": row.value,
                    "mode": mode.label,
                    "frequency_Hz": mode.frequency_Hz,
                    "growth_rate_1_per_s": mode.growth_rate,
                    "growth_per_percent_1_per_s": float(row.growth_per_percent[k]),
                    "growth_per_percent_by_differences_1_per_s": _by_differences(row, k),
                    "frequency_per_percent_Hz": float(row.frequency_per_percent_Hz[k]),
                    "growth_per_SI": float(row.derivative[k].real),
                    "frequency_Hz_per_SI": float(row.derivative[k].imag) / math.tau,
                }
            )
    return rows_to_csv(rows)


def _by_differences(row: Sensitivity, k: int) -> float | None:
    value = PERCENT * row.value * float(row.difference[k].real)
    return value if math.isfinite(value) else None


def describe_study(
    study: SensitivityStudy, quiet: Quieting | None = None, decays: Sequence[Decay] = ()
) -> dict[str, Any]:
    """The study as plain data; the quiet scene is None where it was not asked for."""
    return {
        "title": study.scene.title,
        "modes": [
            {
                "label": mode.label,
                "frequency_Hz": mode.frequency_Hz,
                "growth_rate_1_per_s": mode.growth_rate,
                "unstable": mode.unstable,
            }
            for mode in study.modes
        ],
        "numbers": [
            {
                "key": row.key,
                "value_SI": row.value,
                "growth_per_percent_1_per_s": row.growth_per_percent.tolist(),
                "growth_per_percent_by_differences_1_per_s": [_by_differences(row, k) for k in range(len(study.modes))],
                "frequency_per_percent_Hz": row.frequency_per_percent_Hz.tolist(),
                "growth_per_SI": row.derivative.real.tolist(),
                "frequency_Hz_per_SI": (row.derivative.imag / math.tau).tolist(),
            }
            for row in study.rows
        ],
        "largest_deviation_from_central_differences": study.deviation,
        "round_off_1_per_s": study.round_off,
        "scene": study.scene.model_dump(mode="json"),
        "versions": versions(),
        "quiet": None if quiet is None else _describe_quiet(quiet, decays),
    }


def _describe_quiet(quiet: Quieting, decays: Sequence[Decay]) -> dict[str, Any]:
    return {
        "found": quiet.found,
        "changes": [{**change._asdict(), "relative": change.relative} for change in quiet.changes],
        "norm_of_relative_changes": quiet.norm,
        "largest_growth_rate_1_per_s": quiet.largest_growth,
        "transients": [decay._asdict() for decay in decays],
        "scene": quiet.scene.model_dump(mode="json"),
    }


def _change(study: SensitivityStudy, value: float) -> str:
    if abs(value) <= study.round_off:
        return "0"
    return f"{value:+.2g}" if abs(value) >= LEAST_PLAIN else f"{value:+.0e}"  # so that six modes fit on a terminal
