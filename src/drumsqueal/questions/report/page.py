"""The page: the template filled in with all that it needs, and each of its figures in words for those who see none.

A policy forbids the network and other scripts.
"""

import base64
import hashlib
import importlib.metadata
import math
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup, escape

from drumsqueal.errors import RequestError
from drumsqueal.files import output_folder
from drumsqueal.findings.brake import brake_sentences
from drumsqueal.findings.columns import Column, columns_of
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.prediction import PredictedMode
from drumsqueal.findings.ramp import ramp_sentences
from drumsqueal.findings.verdict import SHIFT, rate_text, shift_words
from drumsqueal.ordinary import read_ordinary
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.onset.found import OnsetStudy
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import percent

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


def about_scene(scene: Scene) -> dict[str, Any]:
    """What a template takes of the scene."""
    toml = scene.to_toml()
    return {
        "title": scene.title or "Untitled scene",
        "tolerance": scene.simulate.tolerance,
        "toml": toml,
        "toml_uri": data_uri("application/toml", toml.encode()),
    }


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
    if found.smallest_kick_sought:
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


def _pressure(summary: RunFindings) -> list[str]:
    return [] if summary.brake is None else list(brake_sentences(summary.brake))


_FIGURES: dict[str, tuple[str, Callable[[RunFindings], list[str]]]] = {
    output_folder.GROWTH: ("Growth of the modes", _growth),
    output_folder.SPECTROGRAM: ("Spectrogram", _spectrogram),
    output_folder.SPECTRA: ("Spectra", _spectra),
    output_folder.PHASE: ("Phase portrait", _phase),
    output_folder.CONTACT: ("Contact along the arc", _contact),
    output_folder.EIGENVALUES: ("Eigenvalues", _eigenvalues),
    output_folder.FREQUENCY: ("Frequency over time", _frequency),
    output_folder.PRESSURE: ("Pressure on the lining", _pressure),
    output_folder.WATERFALL: ("Waterfall", _waterfall),
}
