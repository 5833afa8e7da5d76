"""The study of a motion into one folder: summary, lines and figures."""

from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.files.json_file import write_json
from drumsqueal.files.output_folder import CONVERGENCE, LINES, MOTION_SUMMARY, MOTION_TABLE, SECTION, write_whole
from drumsqueal.findings.departure import unit_of
from drumsqueal.findings.history import versions
from drumsqueal.findings.signals import told_frequencies
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.motion.attractor import Kind, told_exponents
from drumsqueal.questions.motion.figure import combination, draw_convergence, draw_lines, draw_section
from drumsqueal.questions.motion.study import LONGEST_START, MotionStudy, study_motion
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.progress import progress_bar
from drumsqueal.terminal.study import rows_to_csv, told_what_is_kept
from drumsqueal.terminal.style import save_figures


def study_into(folder: Path, scene: Scene, duration: float, at_most: float, console: Console) -> dict[str, Any]:
    """Study the motion of a scene, write summary, lines and figures into the folder, print and return what was found.

    Summary and lines are there before nearby motions are followed. Raises IntegrationError for a study that failed or
    was interrupted.
    """
    with told_what_is_kept(folder / MOTION_SUMMARY):
        with progress_bar(console) as progress:
            task = progress.add_task("compiling", total=LONGEST_START + duration, reached="")

            def show(label: str, reached: float) -> None:
                progress.update(task, description=label, completed=reached, reached=f"{reached:.4f} s")

            keep = partial(_write, folder)
            study = study_motion(scene, duration, at_most=at_most, on_progress=show, on_lines=keep)
        found = _write(folder, study)
        stop_if_interrupted()
        figures = {LINES: draw_lines(study), SECTION: draw_section(study), CONVERGENCE: draw_convergence(study)}
        save_figures({name: figure for name, figure in figures.items() if figure is not None}, folder)
        stop_if_interrupted()
    print_study(console, study)
    left = "Summary, lines and figures are" if study.lines is not None else "Summary is"
    console.print(printable(f"{left} in {folder}"), soft_wrap=True)
    return found


def _write(folder: Path, study: MotionStudy) -> dict[str, Any]:
    found = to_data(study)
    write_json(found, folder / MOTION_SUMMARY)
    write_whole(folder / MOTION_TABLE, rows_to_csv(_rows(study)).encode())
    return found


def print_study(console: Console, study: MotionStudy) -> None:
    """Print the kind of motion and the evidence."""
    settled = "settled" if study.settled else "decaying" if study.kind == "steady" else "not settled"
    console.print(f"Recorded from {study.settled_s:.4g} s ({settled}) for {study.duration_s:.4g} s")
    if study.bases is not None and study.bases.frequency_Hz.size and study.lines is not None:
        told = told_frequencies(study.bases.frequency_Hz.tolist(), study.bases.uncertainty_Hz.tolist(), 8)
        one, matched = study.bases.frequency_Hz.size == 1, (study.bases.combinations != 0).any(axis=1).sum()
        what = f"frequency {told}: multiples of it" if one else f"frequencies {told}: combinations of them"
        console.print(
            f"Fundamental {what} are {matched} of {study.lines.frequency_Hz.size} lines, "
            f"{study.bases.explained:.3%} of the variance"
        )
    if study.exponents is not None:
        console.print(f"Lyapunov exponents {', '.join(told_exponents(study.exponents))} 1/s")
    for limit in study.limits:
        console.print(f"Limited: {limit}", style="dim")
    unknown = study.kind is Kind.NOT_DETERMINED
    what = "The kind of motion is not determined." if unknown else f"The motion is {study.kind}."
    console.print(f"{what} {study.reason}", style="bold")


def to_data(study: MotionStudy) -> dict[str, Any]:
    """Everything found as plain data; None for what was not determined."""
    bases, exponents = study.bases, study.exponents
    return {
        "title": study.scene.title,
        "kind": study.kind,
        "reason": study.reason,
        "attractor": study.attractor._asdict(),
        "settled": study.settled,
        "recorded_from_s": study.settled_s,
        "recorded_for_s": study.duration_s,
        "regime": study.regime._asdict(),
        "base_frequencies_Hz": None if bases is None else bases.frequency_Hz.tolist(),
        "base_uncertainties_Hz": None if bases is None else bases.uncertainty_Hz.tolist(),
        "explained_share": None if bases is None else bases.explained,
        "resolution_Hz": None if study.lines is None else study.lines.resolution_Hz,
        "lyapunov_exponents_1_per_s": None if exponents is None else exponents.exponent_1_per_s.tolist(),
        "lyapunov_standard_errors_1_per_s": None if exponents is None else exponents.standard_error_1_per_s.tolist(),
        "lyapunov_uncertainties_1_per_s": None if exponents is None else exponents.uncertainty_1_per_s.tolist(),
        "chaotic": None if exponents is None or study.kind is Kind.NOT_DETERMINED else exponents.chaotic,
        "section": {"of": list(study.section_of), "points": len(study.section)},
        "not_determined": list(study.limits),
        "scene": study.scene.model_dump(mode="json"),
        "versions": versions(),
    }


def _rows(study: MotionStudy) -> list[dict[str, Any]]:
    lines, bases = study.lines, study.bases
    if lines is None or bases is None:
        return []
    rows = []
    for k in range(lines.frequency_Hz.size):
        integers = bases.combinations[k].tolist()
        row: dict[str, Any] = {
            "frequency_Hz": lines.frequency_Hz[k],
            "uncertainty_Hz": lines.uncertainty_Hz[k],
            "share_of_variance": lines.share[k],
            "combination": combination(integers),
        }
        row |= {f"k{place}": times for place, times in enumerate(integers, start=1)}
        row |= {
            f"amplitude_{name}_{unit_of(name)}": abs(lines.amplitude[k, c]) for c, name in enumerate(study.coordinates)
        }
        rows.append(row)
    return rows
