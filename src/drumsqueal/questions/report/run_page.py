"""The page of a run: what its folder holds, and the shapes of its modes computed anew from its scene."""

import math
from pathlib import Path
from typing import Any

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import HISTORY, RESUME, SUMMARY, figure_file, run_figures
from drumsqueal.files.saved_history import read_history
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.schema import read_findings
from drumsqueal.findings.verdict import difference_is_no_error, state_headline
from drumsqueal.outcome import Ending
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.report.moving import animate
from drumsqueal.questions.report.page import picture
from drumsqueal.questions.report.sound import clips
from drumsqueal.questions.report.words import figure_words
from drumsqueal.scene import Profile, Scene
from drumsqueal.simulation import Prepared, compared, prepare

SAME = 1e-6  # relative, of the largest eigenvalue: another version may differ by round-off
GIVEN_LAW = "The friction law was given in Python and is not in the folder: the shapes cannot be computed without it."
OTHER_MODES = "The shapes are left out: the eigenvalues that this version computes differ from those of the run."
ABOUT = "The shapes were recomputed from the scene when this page was made."


def run_content(folder: Path) -> tuple[RunFindings, dict[str, Any]]:
    """What a run found and what else the template takes. Raises RequestError for files that are none of a run."""
    history = read_history(folder / HISTORY) if (folder / HISTORY).exists() else None
    given_law = history is not None and history.given_law
    prepared = None
    if (folder / SUMMARY).exists():
        found = read_findings(folder / SUMMARY, RunFindings)
        if history is not None and history.scene != found.scene:
            raise RequestError(f"{folder}: {SUMMARY} and {HISTORY} are of different scenes; report on one run's folder")
        if not given_law:
            prepared = prepare(found.scene)
    else:
        assert history is not None
        if given_law:
            raise RequestError(f"{folder}: there is neither {SUMMARY} nor the friction law that it takes to make one")
        prepared = prepare(history.scene)
        found = compared(prepared, history.data).findings
    names = run_figures(changing=found.changing, brake=found.brake is not None)
    pictures = {name: picture(folder / figure_file(name), figure_words(name, found)) for name in names}
    changes, headline = _changes(found.scene), state_headline(found)
    return found, {
        "kind": "report of a run",
        "warning": _warning(found, folder),
        "headline": headline or found.verdict,
        "verdict": headline and found.verdict,
        "computed_now": not (folder / SUMMARY).exists(),
        "changes": "; speed or load change, and these hold at the beginning" if changes else "",
        "no_error": difference_is_no_error(found),
        "animation": None if prepared is None else _animation(prepared, found),
        "animation_note": GIVEN_LAW if prepared is None else OTHER_MODES,
        "about": ABOUT,
        "clips": [] if history is None else clips(history, found.saturation, settles=not changes),
        "pictures": [each for each in pictures.values() if each is not None],
        "missing": _missing([figure_file(name) for name, each in pictures.items() if each is None], found, folder),
        "command": "drumsqueal run scene.toml -o out/again",
    }


def _changes(scene: Scene) -> bool:
    return any(isinstance(each, Profile) for each in scene.schedules().values())


def _warning(summary: RunFindings, folder: Path) -> str | None:
    again = " drumsqueal run with --resume continues from there." if (folder / RESUME).exists() else ""
    if summary.ending is not Ending.COMPLETE:
        return f"This run is not complete: {summary.outcome}.{again}"
    return f"This run was interrupted before all figures were drawn; its record is complete.{again}" if again else None


def _missing(files: list[str], summary: RunFindings, folder: Path) -> str:
    """Why figures are not in the folder."""
    if not files:
        return ""
    if summary.ending is not Ending.COMPLETE:
        early = "its record ends too early for them, or they were not drawn"
        why = f"The run is not complete ({summary.outcome}): {early}"
    elif (folder / RESUME).exists():
        why = "The run was cut off before they were drawn"
    else:
        why = "A run leaves out a figure for which its record holds too little, or too little motion"
    return f"Not in the folder: {', '.join(files)}. {why}."


def _animation(prepared: Prepared, summary: RunFindings) -> dict[str, Any] | None:
    """The modes, moving; None where they are not those of the summary."""
    stability = prepared.stability
    stated = [complex(mode.growth_rate_1_per_s, math.tau * mode.frequency_Hz) for mode in summary.prediction.modes]
    largest = max((abs(value) for value in stated), default=0.0)
    found = [mode.eigenvalue for mode in stability.modes]
    if len(found) != len(stated) or any(abs(a - b) > SAME * largest for a, b in zip(found, stated, strict=True)):
        return None
    animation = animate(prepared, stability.modes)
    reached = {} if summary.saturation is None else summary.saturation.amplitude
    for mode in animation["modes"]:
        mode |= {"at": "", "size": _size(mode, reached.get(mode["name"], 0.0), prepared.model)}
    fastest = max(range(len(found)), key=lambda k: found[k].real, default=0)  # which is shown first
    return animation | {"first": fastest}


def _size(mode: dict[str, Any], reached: float, model: Any) -> str:
    """How much larger than life the picture is, where the run came to a motion of that coordinate (m or rad)."""
    if not reached > 0:
        return "It took no part in the motion after growth."
    times = float(f"{mode['enlarged'] / reached:.3g}")
    scale, unit, shown = at_lining(model, mode["name"])
    here = f"the {scale * reached:.3g} {unit} that {'it' if shown == mode['name'] else shown} reached in this run"
    return f"{mode['name']} is drawn {times:.10g} times as large as {here}."
