"""The page of a run: what its folder holds, and the shapes of its modes computed anew from its scene."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import Ending, RequestError
from drumsqueal.files.history_file import SavedHistory, read_history
from drumsqueal.files.output_folder import HISTORY, RESUME, SUMMARY, figure_file, run_figures
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.saturation import Saturation
from drumsqueal.findings.schema import read_findings
from drumsqueal.findings.signals.sound import CD_RATE, resample, to_sound, wav_bytes
from drumsqueal.findings.verdict import difference_is_no_error, hertz, state_headline
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.export.signals import default_signal, make_channels
from drumsqueal.questions.report.moving import animate
from drumsqueal.questions.report.page import data_uri, picture
from drumsqueal.questions.report.words import figure_words
from drumsqueal.scene import Profile, Scene
from drumsqueal.simulation import Prepared, compared, prepare

# What the lining does, to be heard: the record and the motion after growth, as WAV files inside the page.


_SLOWER = 4  # times, so that what is too high to be heard well is heard
RECORD_S = 1.0  # of the record that is played at most
AFTER_S = 0.2  # of the motion after growth that is played with the growth, at most, of a longer record
REPEATED_S = 3.0  # that the motion after growth is repeated to
_FADE_S = 0.01  # over which one repetition goes over into the next
_SHORTEST_S = 2 * _FADE_S
_QUIET = 1e-9  # m/s: what moves less is not played


class _Clip(NamedTuple):
    """A sound: heading, what is to be heard, its length (s), the velocity (m/s) of its loudest sample, and its WAV.

    `tone` states the pitch to listen for, where there is one.
    """

    heading: str
    text: str
    seconds: float
    peak: float
    uri: str
    tone: str


def clips(history: SavedHistory, saturation: Saturation | None, *, settles: bool) -> list[_Clip]:
    """The sounds of a history; none where nothing moves enough.

    What is heard is the velocity u̇_θ along the drum in the middle of the lining, θ = z = 0; of several linings, of the
    one that comes to move most. The motion after growth is repeated only where it `settles`: a brake that comes to rest
    has no motion that repeats.
    """
    since = None if saturation is None else saturation.start_s
    title = history.scene.title
    (channel,) = make_channels(history, [default_signal(history)], slice(None))
    surface = channel.values
    time = history.data["time"].values - history.data["time"].values[0]
    first, last = _played(time[-1], since)
    record = _heard(surface[(time >= first) & (time <= last)], history.sample_rate)
    if np.ptp(record) < _QUIET:
        return []
    growing = "as it was" if since is None else "first the growth, then the motion that it leads to"
    span = f"From {first:.4g} to {last:.4g} s, {RECORD_S:g} s at most of a record of {time[-1]:.4g} s"
    if first == 0 and last == time[-1]:
        span = f"The whole record, {last:.4g} s"
    lower = f"every frequency {_SLOWER} times lower"
    found = [
        _clip("The record", f"{span}, at its own speed: {growing}.", record, 1, title),
        _clip(f"The record, {_SLOWER} times slower", f"{span}, {lower}: {growing}.", record, _SLOWER, title),
    ]
    if saturation is None or since is None or not settles:
        return found
    part = _heard(surface[(time >= since) & (time < since + REPEATED_S)], history.sample_rate)
    if part.size < _SHORTEST_S * CD_RATE or np.ptp(part) < _QUIET:
        return found
    tone = ""
    if saturation.main is not None:
        line = saturation.main.frequency_Hz
        tone = f"The main line is a tone of {hertz(line)}, {hertz(line / _SLOWER)} where it is slower."
    for slow in (1, _SLOWER):
        repeated, times = _repeated(part, REPEATED_S / slow)
        slower = "" if slow == 1 else f", {slow} times slower"
        more = (
            f"Its {part.size / CD_RATE:.3g} s of record, cut where the motion is most like its beginning, are played "
            f"{times} times with cross-fades of {_FADE_S * 1e3:g} ms: a beat at that rate is that of the repetition, "
            "not of the brake."
        )
        found.append(_clip(f"After growth{slower}", more, repeated, slow, title, tone))
    return found


def _played(end: float, saturated_from: float | None) -> tuple[float, float]:
    """What is played of a record that ends at `end` (s): with growth, up to some of the motion that follows it."""
    if end <= RECORD_S:
        return 0.0, end
    last = end if saturated_from is None else min(end, saturated_from + AFTER_S)
    first = 0.0 if saturated_from is None else max(0.0, last - RECORD_S)
    return first, min(last, first + RECORD_S)


def _heard(velocity: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """A velocity at the rate of a sound."""
    if velocity.size < 2:
        return np.zeros(1)
    times = np.arange(int((velocity.size - 1) / rate * CD_RATE) + 1) / CD_RATE
    return resample(velocity[:, None], rate, times, CD_RATE)[:, 0]


def _repeated(part: NDArray[np.float64], seconds: float) -> tuple[NDArray[np.float64], int]:
    """The part as often as it takes to fill the time (s), and how often.

    It is cut where what follows is most like its beginning, and faded over into that.
    """
    fade = round(_FADE_S * CD_RATE)
    likeness = np.correlate(part, part[:fade], mode="valid")
    step = part.size // 2 + int(np.argmax(likeness[part.size // 2 :]))
    times = max(1, int(np.ceil((seconds * CD_RATE - fade) / step)))
    rise = np.linspace(0.0, 1.0, fade)  # with its mirror image 1 all along: nothing becomes louder than it was
    piece = part[: step + fade].copy()
    piece[:fade] *= rise
    piece[-fade:] *= rise[::-1]
    whole = np.zeros(times * step + fade)
    for k in range(times):
        whole[k * step : k * step + piece.size] += piece
    return whole, times


def _clip(heading: str, text: str, velocity: NDArray[np.float64], slow: int, title: str, tone: str = "") -> _Clip:
    # What is slower has the same samples at a lower rate.
    sound = to_sound(velocity, CD_RATE, slow=slow, rate=CD_RATE // slow)
    comment = f"{heading}: velocity of the lining's surface; one step is {sound.scale:.6g} m/s"
    seconds = sound.samples.size / sound.sample_rate
    return _Clip(heading, text, seconds, sound.peak, data_uri("audio/wav", wav_bytes(sound, title, comment)), tone)


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
