"""A page about what a folder holds, a run, an onset or a matrix: read, filled in and written as one file.

Each of its figures is also in words, for those who see none. A policy forbids the network and other scripts.
"""

import base64
import hashlib
import importlib.metadata
import math
import re
import shlex
import struct
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray
from rich.console import Console

from drumsqueal.dynamics.cycles.cycle import RangeKind
from drumsqueal.errors import Ending, RequestError
from drumsqueal.files.history_file import SavedHistory, read_history
from drumsqueal.files.output_folder import HISTORY, RESUME, SUMMARY, figure_file, run_figures, write_whole
from drumsqueal.findings.brake import brake_sentences
from drumsqueal.findings.columns import Column, columns_of, shown_columns
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.prediction import PredictedMode
from drumsqueal.findings.ramp import ramp_sentences
from drumsqueal.findings.saturation import Saturation
from drumsqueal.findings.schema import Finding, read_findings
from drumsqueal.findings.signals.sound import CD_RATE, resample, to_sound, wav_bytes
from drumsqueal.findings.verdict import SHIFT, difference_is_no_error, hertz, rate_text, shift_words, state_headline
from drumsqueal.ordinary import read_ordinary
from drumsqueal.physics.model import at_lining
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.animate.section import animate
from drumsqueal.questions.export.signals import default_signal, make_channels
from drumsqueal.questions.onset.found import OnsetStudy
from drumsqueal.questions.sweep.matrix_cells import CellFound, NoiseMatrix, shown_levels
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.scene.quantities import percent, printable
from drumsqueal.scene.variation import Variation, read_variation
from drumsqueal.simulation import Prepared, compared, prepare

MEGABYTE = 1e6
_HERE = Path(__file__).parent
_SIGNATURE = b"\x89PNG\r\n\x1a\n"


class Picture(NamedTuple):
    """A picture in the page: heading, what it shows, file name, size in points, and itself."""

    heading: str
    text: str
    file: str
    width: int
    height: int
    uri: str


def picture(path: Path, words: tuple[str, str]) -> Picture | None:
    """Read a PNG file; None where there is none. Raises RequestError for what is no PNG."""
    try:
        # 64 MiB at most; the pictures of drumsqueal have some 1 MB.
        content = read_ordinary(path, 64 * 2**20)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise RequestError(f"{path}: cannot be read ({error.strerror or error})") from None
    if content[:8] != _SIGNATURE or content[12:16] != b"IHDR" or len(content) < 24:
        raise RequestError(f"{path} is not a PNG file, as the figures of drumsqueal are; run the scene again")
    width, height = struct.unpack(">II", content[16:24])
    return Picture(*words, path.name, width, height, data_uri("image/png", content))


def data_uri(kind: str, content: bytes) -> str:
    """The content as an address that holds it."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def render(template: str, content: dict[str, Any]) -> str:
    """Fill in a template of this folder; whatever comes from a scene is escaped.

    The page states its own size, and allows by their hashes only its own style and script.
    """
    style, script = ((_HERE / name).read_text(encoding="utf-8") for name in ("style.css", "view.js"))
    hashes = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (style, script))
    policy = (
        "default-src 'none'; img-src data:; media-src data:; style-src 'sha256-{}'; script-src 'sha256-{}'; "
        "base-uri 'none'; form-action 'none'"
    ).format(*hashes)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "breakable": breakable, "at_lining": at_lining, "cell": cell}
    environment.globals["columns_of_mode"] = columns_of(PredictedMode)
    given = content | {
        "maker": importlib.metadata.version("drumsqueal"),
        # Not escaped, for they are ours: what a browser takes as text to the end of the element.
        "style": Markup(style),
        "script": Markup(script),
        "policy": policy,
    }
    page = environment.get_template(template)
    size = len(page.render(**given, size="0.00 MB").encode())
    return page.render(**given, size=f"{size / MEGABYTE:.2f} MB")


def breakable(text: str) -> str:
    """A dotted key, or the heading of a column, that may go on in the next line after a dot or an underscore."""
    return Markup(re.sub(r"[._](?=\w)", r"\g<0><wbr>", str(escape(text))))


def cell(value: Any, column: Column) -> str:
    """A value of a result as its column shows it."""
    return number(value, column.digits, column.factor) if isinstance(value, int | float) else value or "–"


def number(value: float | None, form: str = ".4g", factor: float = 1.0) -> str:
    """A number as it reads well, and as it was found for programs; a dash where there is none."""
    if value is None or math.isnan(value):
        return Markup('<span class="none">–<span class="unseen"> not reported</span></span>')
    shown = format(value if factor == 1 else factor * value, form) if value else "0"
    shown = shown.lstrip("+-") if float(shown) == 0 else shown  # round-off has no sign
    shown = re.sub(r"e([+-])0", r"e\1", shown).replace("e+", "e").replace("-", "−")
    return Markup('<data value="{}">{}</data>').format(repr(value), shown)


def figure_words(name: str, summary: RunFindings) -> tuple[str, str]:
    """A heading for a figure of a run, and what it shows in words and numbers."""
    heading, text = _FIGURES[name]
    return heading, " ".join(text(summary))


def onset_words(found: OnsetStudy) -> tuple[str, str]:
    """The same for the figure of an onset."""
    along = found.variation
    low, high = (along.with_unit(end) for end in sorted((along.first, along.last)))
    parts = [f"Three plots over {along.key} from {low} to {high}: amplitude, frequency and growth rate."]
    if found.smallest_disturbance_sought:
        parts.append("Below them the smallest disturbance that starts squeal, where one was found.")
    for each in found.ranges:
        parts.append(f"{each.kind.capitalize()} from {along.with_unit(each.first)} to {along.with_unit(each.last)}.")
    parts += [f"{each.label} has zero growth rate at {along.with_unit(each.value)}." for each in found.critical_values]
    return "Amplitude, frequency and growth rate along the parameter", " ".join(parts)


def _growth(summary: RunFindings) -> list[str]:
    text = ["Amplitude of each mode over time on a logarithmic axis, with the predicted growth as dashed lines."]
    for mode in summary.modes:
        rate = mode.measured_growth_rate_1_per_s
        if rate is not None:
            measured = f"{'rises' if rate > 0 else 'falls'} at {rate_text(rate, mode.predicted_frequency_Hz)}"
            predicted = rate_text(mode.predicted_growth_rate_1_per_s, mode.predicted_frequency_Hz)
            text.append(f"{mode.label} {measured} per second, predicted {predicted}.")
    if summary.edge_reached_s is not None:
        text.append(f"The straight lines bend after {summary.edge_reached_s:.4g} s, the first contact boundary.")
    return text + _contact_fraction(summary)


def _contact_fraction(summary: RunFindings) -> list[str]:
    saturation = summary.saturation
    if saturation is None:
        return ["Below it, the fraction of the lining in contact."]
    return [
        f"Below it, the fraction of the lining in contact: {percent(saturation.contact_fraction)} on average after "
        f"growth, with the slip reversed on {percent(saturation.slip_reversed_fraction)}."
    ]


def _spectrogram(summary: RunFindings) -> list[str]:
    text = ["Frequencies over time; brighter is stronger."]
    if summary.ramp is not None:
        lines = "Lines mark the frequencies of the eigenvalues along the way, solid where they are unstable."
        return [*text, lines, "Below them the drum speed or the load, grey where it squeals.", *_main_line(summary)]
    pairs, kinds = summary.prediction.labelled.items(), []
    for kind in (True, False):
        named = [f"{label} {m.frequency_Hz:.0f} Hz" for label, m in pairs if m.unstable is kind and _moves(m, summary)]
        kinds += [f"{'unstable' if kind else 'stable'} {', '.join(named)}"] if named else []
    if kinds:
        text.append(f"Dotted lines mark the predicted frequencies of the modes that move: {'; '.join(kinds)}.")
    return text + _main_line(summary)


def _waterfall(summary: RunFindings) -> list[str]:
    text = [
        "Spectra over the drum speed or the load, one panel for each way; brighter is stronger.",
        "Dotted lines mark the frequencies of the eigenvalues, solid pieces of them where these are unstable.",
    ]
    return text if summary.ramp is None else [*text, *ramp_sentences(summary.ramp, summary.scene)]


def _moves(mode: PredictedMode, summary: RunFindings) -> bool:
    """Whether the coordinate of a mode moves after growth or, without such a part, grows or decays measurably."""
    if summary.saturation is not None:
        return summary.saturation.amplitude.get(mode.name, 0.0) > 0
    measured = summary.modes
    return any(m.name == mode.name and m.measured_growth_rate_1_per_s is not None for m in measured)


def _main_line(summary: RunFindings) -> list[str]:
    saturation = summary.saturation
    if saturation is None or saturation.main is None:
        return []
    text = f"After growth the line with most kinetic energy is at {saturation.main.frequency_Hz:.0f} Hz"
    shift = saturation.frequency_shift
    if shift is not None and abs(shift) >= SHIFT:
        text += f", {shift_words(shift)} {saturation.nearest_mode}"
    return [f"{text}."]


def _spectra(summary: RunFindings) -> list[str]:
    text = ["Spectra of the displacement, in the growth phase and after it."]
    measured = summary.modes
    peaks = [f"{m.label} at {m.measured_frequency_Hz:.0f} Hz" for m in measured if m.measured_frequency_Hz is not None]
    if peaks:
        text.append(f"In the growth phase there are peaks of {', '.join(peaks)}.")
    return text + _main_line(summary)


def _phase(summary: RunFindings) -> list[str]:
    text = ["Velocity of the lining's surface against its displacement at the end of the record."]
    if summary.saturation is not None:
        kind = summary.saturation.regime.kind
        named = {Kind.UNDECIDED: "not settled", Kind.STEADY: "at rest, or on its way there"}.get(kind, kind)
        text.append("The whole lining sticks." if summary.sticks_at_the_end else f"The motion is {named}.")
    if isinstance(summary.scene.drum.speed, float):
        limit = abs(summary.scene.shoes[0].outer_radius * summary.scene.drum.speed)
        text.append(f"The lining overtakes the drum beyond {limit:.3g} m/s.")
    return text


def _contact(summary: RunFindings) -> list[str]:
    if summary.sticks_at_the_end:
        return ["Contact pressure along the arc at the end of the record, where the whole lining sticks to the drum."]
    half = max(math.degrees(shoe.arc_angle) / 2 for shoe in summary.scene.shoes)
    text = [f"Contact pressure along the arc, from −{half:.3g} to {half:.3g} degrees, over the last periods."]
    if summary.saturation is None:
        return text
    fraction = summary.saturation.contact_fraction
    text.append(f"Grey is where the lining is off the drum: {percent(1 - fraction)} of it on average.")
    text.append(f"The slip is reversed on {percent(summary.saturation.slip_reversed_fraction)}.")
    return text


def _eigenvalues(summary: RunFindings) -> list[str]:
    text = ["Eigenvalues in the complex plane: growth rate to the right, frequency upwards."]
    for unstable, place in ((True, "Unstable, right of the axis"), (False, "Stable, left of it or on it")):
        named = [
            f"{m.name} with {m.frequency_Hz:.0f} Hz and {rate_text(m.growth_rate_1_per_s, m.frequency_Hz)} per second"
            for m in summary.prediction.modes
            if m.unstable is unstable
        ]
        text.append(f"{place}: {'; '.join(named) or 'none'}.")
    return text


def _frequency(summary: RunFindings) -> list[str]:
    found = summary.frequency
    if found is None:
        return ["Frequency of the leading mode over time."]
    return [
        f"Frequency of {found.mode} over time: from {found.onset_Hz:.0f} Hz, its eigenvalue, to "
        f"{found.saturated_Hz:.0f} Hz.",
        f"Loss of contact alone predicts {found.predicted_by_contact_loss_Hz:.0f} Hz; √(contact fraction) is a cruder "
        "estimate, the eigenvalue's frequency times the root of the mean fraction of the lining in contact.",
        *_contact_fraction(summary),
    ]


_FIGURES: dict[str, tuple[str, Callable[[RunFindings], list[str]]]] = {
    "growth": ("Growth of the modes", _growth),
    "spectrogram": ("Spectrogram", _spectrogram),
    "spectra": ("Spectra", _spectra),
    "phase": ("Phase portrait", _phase),
    "contact": ("Contact along the arc", _contact),
    "eigenvalues": ("Eigenvalues", _eigenvalues),
    "frequency": ("Frequency over time", _frequency),
    "pressure": ("Pressure on the lining", lambda found: list(brake_sentences(found.brake)) if found.brake else []),
    "waterfall": ("Waterfall", _waterfall),
}


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
    why = "The shapes are left out: the eigenvalues that this version computes differ from those of the run."
    if prepared is None:
        why = "The friction law was given in Python and is not in the folder: the shapes cannot be computed without it."
    return found, {
        "kind": "report of a run",
        "warning": _warning(found, folder),
        "headline": headline or found.verdict,
        "verdict": headline and found.verdict,
        "computed_now": not (folder / SUMMARY).exists(),
        "changes": "; speed or load change, and these hold at the beginning" if changes else "",
        "no_error": difference_is_no_error(found),
        "animation": None if prepared is None else _animation(prepared, found),
        "animation_note": why,
        "about": "The shapes were recomputed from the scene when this page was made.",
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


# The page of a study of the onset: summary, table, figure, and the shapes of the modes at the critical values.


_IT = {
    RangeKind.NOWHERE: "there is no steady sliding",
    RangeKind.STABLE: "it is stable",
    RangeKind.NEUTRAL: "it is neutral",
    RangeKind.UNDECIDED: "it is undecided",
    RangeKind.BISTABLE: "it is bistable",
    RangeKind.SQUEALS: "it squeals",
}


def _onset_content(folder: Path, progress: Progress = silent) -> tuple[OnsetStudy, dict[str, Any]]:
    """A study and what else the template takes, from its folder. Raises RequestError for files that are none of it."""
    if not (folder / "onset.json").exists():
        raise RequestError(f"{folder}: there is onset.csv, but no onset.json; study the onset again")
    found = read_findings(folder / "onset.json", OnsetStudy)
    drawn = picture(folder / figure_file("onset"), onset_words(found))
    complete, along = found.outcome is Ending.COMPLETE, found.variation
    missing = "The figure is not in the folder: the study was cut off before it was drawn"
    flags = f"{' --smallest-disturbance' * found.smallest_disturbance_sought}{' --cycles' if found.cycles else ''}"
    sought = f"--along {shlex.quote(_range(along, found.scene))} --within {found.bistable_range_sought_within!r}{flags}"
    return found, {
        "kind": "report of a study of the onset",
        "complete": complete,
        "pictures": [] if drawn is None else [drawn],
        "missing": "" if drawn is not None else f"{missing}{', or the figure was removed' * complete}.",
        "rows": [row for row in found.in_order if row.asked],
        "column": f"{along.key}, {along.shown_unit}" if along.shown_unit else along.key,
        "per": 1 / along.size,
        "equals": f" (1 {along.given} is {along.size:.6g} {along.unit})" if along.given else "",
        "warning": None if complete else "This study is not complete: it was cut off before the ranges were found.",
        "headline": found.verdict or _so_far(found),
        "animation": _modes_at(found, progress),
        "animation_note": "There is no critical value with a mode that oscillates, so that no shape is shown.",
        "about": "The shapes were recomputed from the scene, at the critical values, when this page was made.",
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


def _modes_at(found: OnsetStudy, progress: Progress) -> dict[str, Any] | None:
    """The mode at each critical value that oscillates, where this version has it; None where there is none."""
    made: list[dict[str, Any]] = []
    animation: dict[str, Any] = {}
    along = found.variation
    for critical in found.critical_values:
        progress("modes", 0.0, None)
        if not critical.frequency_Hz > 0:
            continue
        prepared = prepare(found.scene.with_values({along.key: critical.value}))
        # A mode at a critical value is the one with its frequency, but for round-off.
        same = [
            m for m in prepared.stability.modes if math.isclose(m.frequency_Hz, critical.frequency_Hz, rel_tol=1e-6)
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
        "missing": ""
        if drawn
        else "The figure is not in the folder: the matrix has too many cells for one, or the figure was removed.",
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
        toml = found.scene.to_toml()
        content |= {"title": found.title or "Untitled scene", "tolerance": found.scene.simulate.tolerance}
        content |= {"toml": toml, "toml_uri": data_uri("application/toml", toml.encode())}
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
