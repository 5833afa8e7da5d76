"""A page about what a folder holds: read, filled in and written as one file."""

import math
import shlex
from collections import Counter
from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.dynamics.cycles.cycle import RangeKind
from drumsqueal.errors import Ending, RequestError
from drumsqueal.files.output_folder import figure_file, write_whole
from drumsqueal.findings.columns import shown_columns
from drumsqueal.findings.schema import Finding, read_findings
from drumsqueal.findings.verdict import hertz
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.onset.found import OnsetStudy
from drumsqueal.questions.report.moving import animate
from drumsqueal.questions.report.page import MEGABYTE, about_scene, picture, render
from drumsqueal.questions.report.run_page import run_content
from drumsqueal.questions.report.words import onset_words
from drumsqueal.questions.sweep.matrix_found import CellFound, NoiseMatrix, shown_levels
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.quantities import printable
from drumsqueal.scene.variation import Variation, read_variation
from drumsqueal.simulation import prepare

# The page of a study of the onset: summary, table, figure, and the shapes of the modes at the critical values.


SAME = 1e-6  # relative: a mode at a critical value is the one with this frequency
CUT_OFF = "This study is not complete: it was cut off before the ranges were found."
_NOT_DRAWN = "The figure is not in the folder: the study was cut off before it was drawn."
NO_FIGURE = "The figure is not in the folder: the study was cut off before it was drawn, or the figure was removed."
_NO_MODES = "There is no critical value with a mode that oscillates, so that no shape is shown."
_IT = {
    RangeKind.NOWHERE: "there is no steady sliding",
    RangeKind.STABLE: "it is stable",
    RangeKind.NEUTRAL: "it is neutral",
    RangeKind.UNDECIDED: "it is undecided",
    RangeKind.BISTABLE: "it is bistable",
    RangeKind.SQUEALS: "it squeals",
}
_ABOUT = "The shapes were recomputed from the scene, at the critical values, when this page was made."


def _onset_content(folder: Path, progress: Progress = silent) -> tuple[OnsetStudy, dict[str, Any]]:
    """A study and what else the template takes, from its folder. Raises RequestError for files that are none of it."""
    if not (folder / "onset.json").exists():
        raise RequestError(f"{folder}: there is onset.csv, but no onset.json; study the onset again")
    found = read_findings(folder / "onset.json", OnsetStudy)
    drawn = picture(folder / figure_file("onset"), onset_words(found))
    complete, along = found.outcome is Ending.COMPLETE, found.variation
    flags = f"{' --smallest-kick' * found.smallest_kick_sought}{' --cycles' if found.cycles else ''}"
    sought = f"--along {shlex.quote(_range(along, found.scene))} --within {found.kicked_range_sought_within!r}{flags}"
    return found, {
        "kind": "report of a study of the onset",
        "complete": complete,
        "pictures": [] if drawn is None else [drawn],
        "missing": "" if drawn is not None else NO_FIGURE if complete else _NOT_DRAWN,
        "rows": [row for row in found.in_order if row.asked],
        "column": f"{along.key}, {along.shown_unit}" if along.shown_unit else along.key,
        "per": 1 / along.size,
        "equals": f" (1 {along.given} is {along.size:.6g} {along.unit})" if along.given else "",
        "warning": None if complete else CUT_OFF,
        "headline": found.verdict or _so_far(found),
        "animation": _animation(found, progress),
        "animation_note": _NO_MODES,
        "about": _ABOUT,
        "command": f"drumsqueal onset scene.toml -o out/again {sought}",
    }


def _so_far(found: OnsetStudy) -> str:
    """What a study has that was cut off: how many values do what, and what the eigenvalues say of all."""
    along = found.variation
    low, high = sorted((along.first, along.last))
    kinds = Counter(row.kind for row in found.in_order if row.asked)
    each = ", ".join(f"{_IT[kind]} at {count} of them" for kind, count in kinds.items())
    values = f"{len(along.values)} values of {along.key} from {along.shown(low):.6g} to {along.with_unit(high)}"
    done = f"{kinds.total()} of {values} are done{f': {each}' if each else ''}"
    changes = [
        f"{each.label} {'loses' if each.destabilises else 'gains'} stability as the value rises past "
        f"{along.with_unit(each.value)}{f' ({hertz(each.frequency_Hz)})' if each.frequency_Hz > 0 else ''}"
        for each in found.critical_values
    ]
    return f"{done}. By the eigenvalues {' and '.join(changes) or 'no mode gains or loses stability there'}."


def _range(along: Variation, scene: Scene) -> str:
    """The range as `--along` takes it: in the unit in which it was given where that gives the very same values."""
    count = len(along.values)
    if along.given:
        first, last = (f"{along.shown(value):.12g} {along.given}" for value in (along.first, along.last))
        written = f"{along.key}={first}..{last} x{count}"
        try:
            if read_variation(written, scene).values == along.values:
                return written
        except SceneError:  # a unit or a key that is none: the summary was changed by hand
            pass
    return f"{along.key}={along.first!r}..{along.last!r}x{count}"


def _animation(found: OnsetStudy, progress: Progress) -> dict[str, Any] | None:
    """The mode at each critical value that oscillates, where this version has it; None where there is none."""
    made: list[dict[str, Any]] = []
    animation: dict[str, Any] = {}
    along = found.variation
    for critical in found.critical_values:
        progress("modes", 0.0, None)
        if not critical.frequency_Hz > 0:
            continue
        prepared = prepare(found.scene.with_values({along.key: critical.value}))
        same = [
            m for m in prepared.stability.modes if math.isclose(m.frequency_Hz, critical.frequency_Hz, rel_tol=SAME)
        ]
        if same:
            value = along.with_unit(critical.value)
            animation = animate(prepared, same[:1])
            made += [
                mode
                | {
                    "label": critical.label,
                    "at": f"at {value}",
                    "size": f"At {along.key} = {value}, where it neither grows nor decays.",
                    # Round-off decides the sign of a growth rate that is zero.
                    "growth_rate_1_per_s": 0.0,
                    "unstable": False,
                    "stability": "at its onset",
                }
                for mode in animation["modes"]
            ]
    return animation | {"modes": made, "first": 0} if made else None


# The page of a noise matrix: which cells squeal, at what frequency, how loud, and after what disturbance.


_NO_MATRIX_FIGURE = "The figure is not in the folder: the matrix has too many cells for one, or the figure was removed."


def _matrix_content(folder: Path) -> tuple[NoiseMatrix, dict[str, Any]]:
    """A noise matrix and what else the template takes. Raises RequestError for files that are none of it."""
    if not (folder / "matrix.json").exists():
        raise RequestError(f"{folder}: there is matrix.nc, but no matrix.json; resume the noise matrix")
    found = read_findings(folder / "matrix.json", NoiseMatrix)
    text = f"{found.headline}. Each that squeals has its frequency and is coloured by its level; the table has both."
    drawn = picture(folder / figure_file("matrix"), ("Noise matrix", text))
    return found, {
        "kind": "report of a noise matrix",
        "title": found.title or "Noise matrix",
        "warning": None,
        "headline": f"{found.headline}.",
        "pictures": [] if drawn is None else [drawn],
        "missing": "" if drawn else _NO_MATRIX_FIGURE,
        "rows": [(cell, shown_levels(found, cell)) for cell in found.cells],
        "columns": shown_columns(CellFound, found.cells),
    }


class Page(Finding):
    """A page: the finding at its head, the warning below it (None: none), the file and its size in bytes."""

    finding: str
    warning: str | None
    page: str
    bytes: int


def write_page(file: Path, folder: Path, kind: str, progress: Progress = silent) -> Page:
    """Write the page of a folder that holds results of the command `kind`, "run", "onset" or "matrix".

    Raises RequestError for files that this version does not take, and OSError.
    """
    progress("reading", 0.0, None)
    if kind == "matrix":
        found, content = _matrix_content(folder)
    else:
        found, content = run_content(folder) if kind == "run" else _onset_content(folder, progress)
        content |= about_scene(found.scene)
    progress("writing the page", 0.0, None)
    page = render(f"{kind}.html", content | {"found": found}).encode()
    progress("writing the page", 1.0, 1.0)
    write_whole(file, page)
    return Page(finding=content["headline"], warning=content["warning"], page=str(file), bytes=len(page))


def print_page(console: Console, page: Page) -> None:
    """Print the finding, the warning and how large the page is."""
    console.print(printable(page.finding), style="bold")
    if page.warning:
        console.print(printable(page.warning))
    console.print(f"The page has {page.bytes / MEGABYTE:.2f} MB and needs no network")
