"""The page of a study of the onset: summary, table, figure, and the shapes of the modes at the critical values."""

import shlex
from collections import Counter
from pathlib import Path
from typing import Any

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import ONSET, ONSET_SUMMARY, ONSET_TABLE, figure_file
from drumsqueal.findings.outcome import Ending
from drumsqueal.findings.schema import read_findings
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.onset.found import Kind, OnsetStudy
from drumsqueal.questions.report.inline import data_uri, picture
from drumsqueal.questions.report.moving import animate
from drumsqueal.questions.report.words import hertz, onset_words
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.variation import Variation, read_variation
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.branches import Critical

SAME = 1e-6  # relative: a mode at a critical value is the one with this frequency
CUT_OFF = "This study is not complete: it was cut off before the ranges were found."
NOT_DRAWN = "The figure is not in the folder: the study was cut off before it was drawn."
NO_FIGURE = "The figure is not in the folder: the study was cut off before it was drawn, or the figure was taken away."
NO_MODES = "There is no critical value with a mode that oscillates, so that no shape is shown."
IT = {
    Kind.NOWHERE: "there is no steady sliding",
    Kind.STABLE: "it is stable",
    Kind.NEUTRAL: "it is neutral",
    Kind.UNDECIDED: "it is undecided",
    Kind.BISTABLE: "it is bistable",
    Kind.SQUEALS: "it squeals",
}
ABOUT = "The shapes were computed anew from the scene, at the critical values, as this page was made."


def onset_content(folder: Path, progress: Progress = silent) -> dict[str, Any]:
    """What the template takes, from the folder of a study. Raises RequestError for files that are none of a study."""
    if not (folder / ONSET_SUMMARY).exists():
        raise RequestError(f"{folder}: there is {ONSET_TABLE}, but no {ONSET_SUMMARY}; study the onset anew")
    found = read_findings(folder / ONSET_SUMMARY, OnsetStudy)
    drawn = picture(folder / figure_file(ONSET), onset_words(found))
    complete = found.outcome is Ending.COMPLETE
    scene, along = found.scene, found.variation
    toml = scene.to_toml()
    unit = f", {along.shown_unit}" if along.shown_unit else ""
    return {
        "kind": "report of a study of the onset",
        "found": found,
        "complete": complete,
        "pictures": [] if drawn is None else [drawn],
        "missing": "" if drawn is not None else NO_FIGURE if complete else NOT_DRAWN,
        "rows": [row for row in found.in_order if row.asked],
        "column": f"{along.key}{unit}",
        "per": 1 / along.size,
        "equals": f" (1 {along.given} is {along.size:.6g} {along.unit})" if along.given else "",
        "title": scene.title or "Untitled scene",
        "warning": None if complete else CUT_OFF,
        "headline": found.verdict or _so_far(found),
        "animation": _animation(found, progress),
        "animation_note": NO_MODES,
        "about": ABOUT,
        "tolerance": scene.simulate.tolerance,
        "toml": toml,
        "toml_uri": data_uri("application/toml", toml.encode()),
        "command": f"drumsqueal onset scene.toml -o out/again --along {shlex.quote(_range(along, scene))} "
        f"--within {found.kicked_range_sought_within!r}{' --smallest-kick' * found.smallest_kick_sought}"
        f"{' --cycles' if found.cycles else ''}",
    }


def _so_far(found: OnsetStudy) -> str:
    """What a study has that was cut off: how many values do what, and what the eigenvalues say of all."""
    along = found.variation
    low, high = sorted((along.first, along.last))
    kinds = Counter(row.kind for row in found.in_order if row.asked)
    each = ", ".join(f"{IT[kind]} at {count} of them" for kind, count in kinds.items())
    values = f"{len(along.values)} values of {along.key} from {along.shown(low):.6g} to {along.with_unit(high)}"
    done = f"{kinds.total()} of {values} are done{f': {each}' if each else ''}"
    return f"{done}. By the eigenvalues {_critical(found, along)}."


def _critical(found: OnsetStudy, along: Variation) -> str:
    if not found.critical_values:
        return "no mode gains or loses stability there"
    return " and ".join(
        f"{each.label} {'loses' if each.destabilises else 'gains'} stability as the value rises past "
        f"{along.with_unit(each.value)}{f' ({hertz(each.frequency_Hz)})' if each.frequency_Hz > 0 else ''}"
        for each in found.critical_values
    )


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
    """The mode at each critical value that oscillates; None where there is none."""
    made: list[dict[str, Any]] = []
    animation: dict[str, Any] = {}
    along = found.variation
    for critical in found.critical_values:
        moving = _at(found.scene, along.key, critical)
        progress("modes", 0.0, None)
        if moving is not None:
            animation = moving
            made += [mode | {"label": critical.label} for mode in moving["modes"]]
    for mode in made:
        mode["size"] = f"At {along.key} = {along.with_unit(mode['value'])}, where it neither grows nor decays."
        mode["at"] = f"at {along.with_unit(mode['value'])}"
    return animation | {"modes": made, "first": 0} if made else None


def _at(scene: Scene, key: str, critical: Critical) -> dict[str, Any] | None:
    """The mode at a critical value; None for a divergence, and where this version has no such mode there."""
    if not critical.frequency_Hz > 0:
        return None
    prepared = prepare(scene.with_values({key: critical.value}))
    stability = prepared.stability
    modes = [m for m in stability.modes if abs(m.frequency_Hz - critical.frequency_Hz) <= SAME * critical.frequency_Hz]
    if not modes:
        return None
    speed = float(prepared.linear.operation.at(stability.time).drum_speed)
    animation = animate(prepared.linear.shoe, stability.coordinates, stability.mass, modes[:1], speed)
    for mode in animation["modes"]:
        # Round-off decides the sign of a growth rate that is zero.
        mode |= {"value": critical.value, "growth_rate_1_per_s": 0.0, "unstable": False, "stability": "at its onset"}
    return animation
