"""The page of a study of the onset: summary, table, figure, and the shapes of the modes at the critical values."""

import shlex
from pathlib import Path
from typing import Any

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import ONSET, ONSET_SUMMARY, ONSET_TABLE, figure_file
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.report.found import Critical, Onset, read_rows, read_summary, scene_of
from drumsqueal.report.inline import data_uri, picture
from drumsqueal.report.moving import animate
from drumsqueal.report.words import onset_words
from drumsqueal.scene import Scene
from drumsqueal.simulation import prepare

SAME = 1e-6  # relative: a mode at a critical value is the one with this frequency
CUT_OFF = "This study is not complete: it was cut off, and only the table of the values that were done is left."
NO_MODES = "There is no critical value with a mode that oscillates, so that no shape is shown."
ABOUT = "The shapes were computed anew from the scene, at the critical values, as this page was made."


def onset_content(folder: Path) -> dict[str, Any]:
    """What the template takes, from the folder of a study. Raises RequestError for files that are none of a study."""
    found = read_summary(folder / ONSET_SUMMARY, Onset) if (folder / ONSET_SUMMARY).exists() else None
    rows = read_rows(folder / ONSET_TABLE) if (folder / ONSET_TABLE).exists() else []
    drawn = picture(folder / figure_file(ONSET), onset_words(found))
    content: dict[str, Any] = {
        "kind": "report of a study of the onset",
        "found": found,
        "pictures": [] if drawn is None else [drawn],
        "rows": [_row(row, folder / ONSET_TABLE) for row in rows if row["asked"] == "yes"],
        "column": next(iter(rows[0])) if rows else "",
    }
    if found is None:
        told = f"{len(content['rows'])} values were done."
        return content | {"title": "Onset", "warning": CUT_OFF, "headline": told}
    scene = scene_of(folder / ONSET_SUMMARY, found.scene)
    toml, along = scene.to_toml(), found.parameter
    ends = f"{along.key}={along.values[0]!r}..{along.values[-1]!r}x{len(along.values)}"
    within = f"--within {found.kicked_range_sought_within!r}"
    unit = f", {along.unit}" if along.unit else ""
    return content | {
        "column": f"{along.key}{unit}",
        "title": scene.title or "Untitled scene",
        "warning": None,
        "headline": found.verdict,
        "animation": _animation(scene, found),
        "animation_note": NO_MODES,
        "about": ABOUT,
        "tolerance": scene.simulate.tolerance,
        "toml": toml,
        "toml_uri": data_uri("application/toml", toml.encode()),
        "command": f"drumsqueal onset scene.toml -o out/again --along {shlex.quote(ends)} {within}",
    }


def _row(row: dict[str, str], path: Path) -> dict[str, Any]:
    """One value as the page shows it."""
    try:
        return {
            "value": float(next(iter(row.values()))),
            "kind": row["kind"],
            "growth": _maybe(row["largest_growth_rate_1_per_s"]),
            "small": row["small_start_leads_to"],
            "frequency": _maybe(row["strongest_frequency_Hz"]),
            "motions": row["motions"],
        }
    except ValueError:
        raise RequestError(f"{path} is damaged: there is no number where one was to be; study the onset anew") from None


def _maybe(text: str) -> float | None:
    return float(text) if text else None


def _animation(scene: Scene, found: Onset) -> dict[str, Any] | None:
    """The mode at each critical value that oscillates; None where there is none."""
    made: list[dict[str, Any]] = []
    animation: dict[str, Any] = {}
    for critical in found.critical_values:
        moving = _at(scene, found.parameter.key, critical)
        stop_if_interrupted()
        if moving is not None:
            animation = moving
            made += [mode | {"label": critical.label} for mode in moving["modes"]]
    unit = f" {found.parameter.unit}" if found.parameter.unit else ""
    for mode in made:
        mode["size"] = f"At {found.parameter.key} = {mode['value']:.6g}{unit}, where it neither grows nor decays."
        mode["at"] = f"at {mode['value']:.6g}{unit}"
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
