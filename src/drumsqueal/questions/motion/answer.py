"""What the study of a motion writes and prints."""

from rich.console import Console

from drumsqueal.files.output_folder import CONVERGENCE, LINES, MOTION_SUMMARY, MOTION_TABLE, SECTION
from drumsqueal.findings.signals.regime_words import written_frequencies
from drumsqueal.findings.vibration import unit_of
from drumsqueal.questions.motion.attractor import Kind, written_exponents
from drumsqueal.questions.motion.figure import combination, draw_convergence, draw_lines, draw_section
from drumsqueal.questions.motion.study import MotionStudy
from drumsqueal.terminal.runner import Answer
from drumsqueal.terminal.tables import rows_to_csv


def print_study(console: Console, study: MotionStudy) -> None:
    """Print the kind of motion and the evidence."""
    settled = "settled" if study.settled else "decaying" if study.kind is Kind.STEADY else "not settled"
    console.print(f"Recorded from {study.recorded_from_s:.4g} s ({settled}) for {study.recorded_for_s:.4g} s")
    found = study.fundamentals
    if found is not None and found.frequency_Hz.size and study.lines is not None:
        frequencies = written_frequencies(found.frequency_Hz.tolist(), found.uncertainty_Hz.tolist(), 8)
        one, matched = found.frequency_Hz.size == 1, (found.combinations != 0).any(axis=1).sum()
        what = (
            f"frequency {frequencies}: multiples of it" if one else f"frequencies {frequencies}: combinations of them"
        )
        console.print(
            f"Fundamental {what} are {matched} of {study.lines.frequency_Hz.size} lines, "
            f"{found.explained:.3%} of the variance"
        )
    if study.exponents is not None:
        console.print(f"Lyapunov exponents {', '.join(written_exponents(study.exponents))} 1/s")
    for limit in study.not_determined:
        console.print(f"Limited: {limit}", style="dim")
    unknown = study.kind is Kind.NOT_DETERMINED
    what = "The kind of motion is not determined." if unknown else f"The motion is {study.kind}."
    console.print(f"{what} {study.reason}", style="bold")


def lines_table(study: MotionStudy) -> str:
    """The lines and what they are combinations of, as CSV."""
    lines, fundamentals, rows = study.lines, study.fundamentals, []
    if lines is None or fundamentals is None:
        return rows_to_csv(rows)
    for k in range(lines.frequency_Hz.size):
        integers = fundamentals.combinations[k].tolist()
        row: dict[str, object] = {
            "frequency_Hz": lines.frequency_Hz[k],
            "uncertainty_Hz": lines.uncertainty_Hz[k],
            "share_of_variance": lines.fraction[k],
            "combination": combination(integers),
        }
        row |= {f"k{place}": times for place, times in enumerate(integers, start=1)}
        row |= {
            f"amplitude_{name}_{unit_of(name)}": abs(lines.amplitude[k, c]) for c, name in enumerate(study.coordinates)
        }
        rows.append(row)
    return rows_to_csv(rows)


MOTION = Answer(
    words=print_study,
    summary=MOTION_SUMMARY,
    tables={MOTION_TABLE: lines_table},
    figures={LINES: draw_lines, SECTION: draw_section, CONVERGENCE: draw_convergence},
)
