"""The page of a study of the onset: summary, table, figure, and the shapes of the modes at the critical values."""

import math
import shlex
from collections import Counter
from pathlib import Path
from typing import Any

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import ONSET, ONSET_SUMMARY, ONSET_TABLE, figure_file
from drumsqueal.findings.schema import read_findings
from drumsqueal.findings.verdict import hertz
from drumsqueal.outcome import Ending
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.cycle.diagram import RangeKind
from drumsqueal.questions.onset.found import OnsetStudy
from drumsqueal.questions.report.moving import animate
from drumsqueal.questions.report.page import picture
from drumsqueal.questions.report.words import onset_words
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.variation import Variation, read_variation
from drumsqueal.simulation import prepare

SAME = 1e-6  # relative: a mode at a critical value is the one with this frequency
CUT_OFF = "This study is not complete: it was cut off before the ranges were found."
NOT_DRAWN = "The figure is not in the folder: the study was cut off before it was drawn."
NO_FIGURE = "The figure is not in the folder: the study was cut off before it was drawn, or the figure was removed."
NO_MODES = "There is no critical value with a mode that oscillates, so that no shape is shown."
IT = {
    RangeKind.NOWHERE: "there is no steady sliding",
    RangeKind.STABLE: "it is stable",
    RangeKind.NEUTRAL: "it is neutral",
    RangeKind.UNDECIDED: "it is undecided",
    RangeKind.BISTABLE: "it is bistable",
    RangeKind.SQUEALS: "it squeals",
}
ABOUT = "The shapes were recomputed from the scene, at the critical values, when this page was made."


def onset_content(folder: Path, progress: Progress = silent) -> tuple[OnsetStudy, dict[str, Any]]:
    """A study and what else the template takes, from its folder. Raises RequestError for files that are none of it."""
    if not (folder / ONSET_SUMMARY).exists():
        raise RequestError(f"{folder}: there is {ONSET_TABLE}, but no {ONSET_SUMMARY}; study the onset again")
    found = read_findings(folder / ONSET_SUMMARY, OnsetStudy)
    drawn = picture(folder / figure_file(ONSET), onset_words(found))
    complete, along = found.outcome is Ending.COMPLETE, found.variation
    flags = f"{' --smallest-kick' * found.smallest_kick_sought}{' --cycles' if found.cycles else ''}"
    sought = f"--along {shlex.quote(_range(along, found.scene))} --within {found.kicked_range_sought_within!r}{flags}"
    return found, {
        "kind": "report of a study of the onset",
        "complete": complete,
        "pictures": [] if drawn is None else [drawn],
        "missing": "" if drawn is not None else NO_FIGURE if complete else NOT_DRAWN,
        "rows": [row for row in found.in_order if row.asked],
        "column": f"{along.key}, {along.shown_unit}" if along.shown_unit else along.key,
        "per": 1 / along.size,
        "equals": f" (1 {along.given} is {along.size:.6g} {along.unit})" if along.given else "",
        "warning": None if complete else CUT_OFF,
        "headline": found.verdict or _so_far(found),
        "animation": _animation(found, progress),
        "animation_note": NO_MODES,
        "about": ABOUT,
        "command": f"drumsqueal onset scene.toml -o out/again {sought}",
    }


def _so_far(found: OnsetStudy) -> str:
    """What a study has that was cut off: how many values do what, and what the eigenvalues say of all."""
    along = found.variation
    low, high = sorted((along.first, along.last))
    kinds = Counter(row.kind for row in found.in_order if row.asked)
    each = ", ".join(f"{IT[kind]} at {count} of them" for kind, count in kinds.items())
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
