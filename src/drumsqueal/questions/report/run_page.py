"""The page of a run: what its folder holds, and the shapes of its modes computed anew from its scene."""

import math
from pathlib import Path
from typing import Any

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import FIGURES, HISTORY, RESUME, SUMMARY, figure_file
from drumsqueal.files.saved_history import read_history
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.outcome import Ending
from drumsqueal.findings.schema import read_findings
from drumsqueal.findings.verdict import difference_is_no_error
from drumsqueal.findings.vibration import ROTATIONS
from drumsqueal.questions.report.inline import data_uri, picture
from drumsqueal.questions.report.moving import animate, most_unstable
from drumsqueal.questions.report.sound import SLOWER, clips
from drumsqueal.questions.report.words import figure_words, headline, hertz
from drumsqueal.scene import Profile, Scene
from drumsqueal.simulation import Prepared, compared, prepare

SAME = 1e-6  # relative, of the largest eigenvalue: another version may differ by round-off
GIVEN_LAW = "The friction law was given in Python and is not in the folder: the shapes cannot be computed without it."
OTHER_MODES = "The shapes are left out: computed anew by this version, the eigenvalues differ from those of the run."
ABOUT = "The shapes were computed anew from the scene as this page was made."


def run_content(folder: Path) -> dict[str, Any]:
    """What the template takes, from the folder of a run. Raises RequestError for files that are none of a run."""
    history = read_history(folder / HISTORY) if (folder / HISTORY).exists() else None
    given_law = history is not None and history.given_law
    if (folder / SUMMARY).exists():
        summary = read_findings(folder / SUMMARY, RunFindings)
        scene = summary.scene
        if history is not None and history.scene != scene:
            raise RequestError(f"{folder}: {SUMMARY} and {HISTORY} are of different scenes; report on one run's folder")
        prepared = None if given_law else prepare(scene)
    else:
        assert history is not None
        if given_law:
            raise RequestError(
                f"{folder}: there is neither {SUMMARY} nor the friction law that it would take to make one"
            )
        scene = history.scene
        prepared = prepare(scene)
        summary = compared(prepared, history.data).findings
    pictures = {name: picture(folder / figure_file(name), figure_words(name, summary, scene)) for name in FIGURES}
    since = None if summary.saturation is None else summary.saturation.start_s
    toml = scene.to_toml()
    modes = list(zip(summary.prediction.labels, summary.prediction.modes, strict=True))
    return {
        "title": scene.title or "Untitled scene",
        "kind": "report of a run",
        "warning": _warning(summary, folder),
        "headline": headline(summary, scene),
        "summary": summary,
        "computed_now": not (folder / SUMMARY).exists(),
        "modes": modes,
        "changes": "; speed or load change, and these are of the beginning" if _changes(scene) else "",
        "changing": summary.changing,
        "no_error": difference_is_no_error(summary),
        "unstable": ", ".join(summary.prediction.unstable),
        "without_oscillation": summary.prediction.without_oscillation,
        "animation": None if prepared is None else _animation(prepared, summary),
        "animation_note": GIVEN_LAW if prepared is None else OTHER_MODES,
        "about": ABOUT,
        "clips": [] if history is None else clips(history, since, settles=not _changes(scene)),
        "heard": _heard(summary),
        "pictures": [each for each in pictures.values() if each is not None],
        "missing": _missing([figure_file(name) for name, each in pictures.items() if each is None], summary, folder),
        "tolerance": scene.simulate.tolerance,
        "limits": _left_out(summary),
        "toml": toml,
        "toml_uri": data_uri("application/toml", toml.encode()),
        "command": "drumsqueal run scene.toml -o out/again",
    }


def _changes(scene: Scene) -> bool:
    return isinstance(scene.drum.speed, Profile) or isinstance(scene.contact.normal_load, Profile)


def _warning(summary: RunFindings, folder: Path) -> str | None:
    again = " drumsqueal run with --resume goes on from there." if (folder / RESUME).exists() else ""
    if summary.ending is not Ending.COMPLETE:
        return f"This run is not complete: {summary.outcome}.{again}"
    return f"This run was cut off once its record was complete, before all was drawn.{again}" if again else None


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
    speed = float(prepared.linear.operation.at(stability.time).drum_speed)
    animation = animate(prepared.linear.shoe, stability.coordinates, stability.mass, stability.modes, speed)
    reached = {} if summary.saturation is None else summary.saturation.amplitude
    for mode in animation["modes"]:
        mode |= {"at": "", "size": _size(mode, reached.get(mode["name"], 0.0))}
    return animation | {"first": most_unstable(stability.modes)}


def _size(mode: dict[str, Any], reached: float) -> str:
    """How much larger than life the picture is, where the run came to a motion of that coordinate (m or rad)."""
    if not reached > 0:
        return "It took no part in the motion after growth."
    unit = "µrad" if mode["name"] in ROTATIONS else "µm"
    times = float(f"{mode['enlarged'] / reached:.3g}")
    here = f"the {1e6 * reached:.3g} {unit} that it reached in this run"
    return f"{mode['name']} is drawn {times:.10g} times as large as {here}."


def _heard(summary: RunFindings) -> str:
    """What pitch to listen for."""
    saturation = summary.saturation
    if saturation is None or saturation.main is None:
        return ""
    line = saturation.main.frequency_Hz
    return f"The main line is a tone of {hertz(line)}, {hertz(line / SLOWER)} where it is slower."


def _left_out(summary: RunFindings) -> list[str]:
    """What the model leaves out, in words."""
    left = summary.model.get("leaves_out", [])
    return [f"Left out of this run: {'; '.join(left)}."] if left else []
