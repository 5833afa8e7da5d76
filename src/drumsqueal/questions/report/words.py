"""What a page says in words: the finding in one sentence, and each figure for those who do not see it."""

import math
from collections.abc import Callable

from drumsqueal.files import output_folder
from drumsqueal.findings.compare import ModeComparison, RunFindings
from drumsqueal.findings.frequency import FrequencyDrift
from drumsqueal.findings.prediction import PredictedMode
from drumsqueal.findings.saturation import Saturation
from drumsqueal.questions.onset.found import OnsetStudy
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import percent
from drumsqueal.solve.linear.modes import NEUTRAL_FRACTION

EXPLAINS = 0.3  # relative; loss of contact is named as the cause of a shift that it gives to within this
SHIFT = 1e-3  # of a frequency: less needs no explanation
_VERB = {
    "periodic": "squeals",
    "quasi-periodic": "squeals",
    "irregular": "squeals",
    "unknown": "vibrates, not yet settled,",
}


def headline(summary: RunFindings, scene: Scene) -> str:
    """The finding in one sentence, the whole verdict where there is no frequency to tell."""
    saturation, sticking = summary.saturation, summary.sticking
    if sticking is not None and sticking.to_the_end_from_s is not None:
        before = "The brake squeals until, from" if _squeals_at_first(summary) else "From"
        return f"{before} {sticking.to_the_end_from_s:.4g} s on, the whole lining sticks to the drum."
    if saturation is None or saturation.main is None or saturation.regime.kind == "steady":
        return summary.verdict or "There is no verdict: nothing was computed beyond the prediction."
    verb = "vibrates" if scene.forcing is not None else _VERB.get(saturation.regime.kind, "vibrates")
    text = f"The brake {verb} at {hertz(saturation.main.frequency_Hz)}"
    return f"{text}{_shifted(saturation, summary)}{_because(saturation, summary.frequency)}."


def _squeals_at_first(summary: RunFindings) -> bool:
    boundary = summary.edge_reached_s
    return bool(boundary) and any(mode.unstable for mode in summary.prediction.modes)


def hertz(frequency: float) -> str:
    """A frequency in three digits."""
    return f"{frequency / 1e3:.3g} kHz" if frequency >= 999.5 else f"{frequency:.3g} Hz"


def _shifted(saturation: Saturation, summary: RunFindings) -> str:
    shift, mode = saturation.frequency_shift, saturation.nearest_mode
    if shift is None or mode is None:
        return ""
    unstable = any(each.unstable for each in summary.prediction.modes)
    of = f"the onset predicted for {mode}" if unstable else f"the predicted frequency of mode {mode}"
    predicted = next(
        (m.frequency_Hz for m, label in zip(summary.prediction.modes, summary.prediction.labels, strict=True)
         if label == mode),
        None,
    )  # fmt: skip
    where = "" if predicted is None else f" ({hertz(predicted)})"
    if abs(shift) < SHIFT:
        return f", at {of}{where}"
    return f", {percent(abs(shift))} {'below' if shift < 0 else 'above'} {of}{where}"


def _because(saturation: Saturation, frequency: FrequencyDrift | None) -> str:
    """The cause, where loss of contact gives the shift."""
    if frequency is None or abs(frequency.shift) < SHIFT:
        return ""
    predicted = frequency.predicted_by_contact_loss_shift
    if abs(predicted / frequency.shift - 1) > EXPLAINS:
        return ""
    return (
        f", because the lining loses contact: on average {percent(saturation.contact_fraction)} of it touches the "
        f"drum, and that alone puts {frequency.mode} at {hertz(frequency.predicted_by_contact_loss_Hz)}"
    )


def figure_words(name: str, summary: RunFindings, scene: Scene) -> tuple[str, str]:
    """A heading for a figure of a run, and what it shows in words and numbers."""
    heading, text = _FIGURES[name]
    return heading, " ".join(text(summary, scene))


def onset_words(found: OnsetStudy) -> tuple[str, str]:
    """The same for the figure of an onset."""
    heading, along = "Amplitude, frequency and growth rate along the parameter", found.variation
    low, high = (along.with_unit(end) for end in sorted((along.first, along.last)))
    parts = [f"Three plots over {along.key} from {low} to {high}: amplitude, frequency and growth rate."]
    if found.smallest_kick_sought:
        parts.append("Below them the smallest disturbance that starts squeal, where one was found.")
    ranges = [
        (each.kind.capitalize(), along.with_unit(each.first), along.with_unit(each.last)) for each in found.ranges
    ]
    parts += [f"{kind} from {first} to {last}." for kind, first, last in ranges]
    parts += [f"{each.label} has zero growth rate at {along.with_unit(each.value)}." for each in found.critical_values]
    return heading, " ".join(parts)


def _growth(summary: RunFindings, _: Scene) -> list[str]:
    text = ["Amplitude of each mode over time on a logarithmic axis, with the predicted growth as dashed lines."]
    growth = summary.growth
    text += [_rates(mode) for mode in growth.modes if mode.measured_growth_rate_1_per_s is not None]
    if growth.edge_reached_s is not None:
        text.append(f"The straight lines bend after {growth.edge_reached_s:.4g} s, the first contact boundary.")
    return text + _contact_fraction(summary)


def _rates(mode: ModeComparison) -> str:
    verb = "rises" if (mode.measured_growth_rate_1_per_s or 0.0) > 0 else "falls"
    return (
        f"{mode.label} {verb} at {signed(mode.measured_growth_rate_1_per_s or 0.0, mode.predicted_frequency_Hz)} per "
        f"second, predicted {signed(mode.predicted_growth_rate_1_per_s, mode.predicted_frequency_Hz)}."
    )


def signed(rate: float, frequency: float) -> str:
    """A growth rate (1/s) in four digits with its sign; 0 where it is round-off beside the frequency (Hz)."""
    return "0" if abs(rate) < NEUTRAL_FRACTION * frequency else f"{rate:+.4g}".replace("-", "−")


def _contact_fraction(summary: RunFindings) -> list[str]:
    saturation = summary.saturation
    if saturation is None:
        return ["Below it, the fraction of the lining in contact."]
    return [
        f"Below it, the fraction of the lining in contact: {percent(saturation.contact_fraction)} on average after "
        f"growth, with the slip reversed on {percent(saturation.slip_reversed_fraction)}."
    ]


def _spectrogram(summary: RunFindings, _: Scene) -> list[str]:
    text = ["Frequencies over time; brighter is stronger."]
    pairs = list(zip(summary.prediction.labels, summary.prediction.modes, strict=True))
    kinds = []
    for kind in (True, False):
        named = [f"{label} {m.frequency_Hz:.0f} Hz" for label, m in pairs if m.unstable is kind and _moves(m, summary)]
        kinds += [f"{'unstable' if kind else 'stable'} {', '.join(named)}"] if named else []
    if kinds:
        text.append(f"Dotted lines mark the predicted frequencies of the modes that move: {'; '.join(kinds)}.")
    return text + _main_line(summary)


def _moves(mode: PredictedMode, summary: RunFindings) -> bool:
    """Whether the coordinate of a mode moves after growth or, without such a part, grows or decays measurably."""
    if summary.saturation is not None:
        return summary.saturation.amplitude.get(mode.name, 0.0) > 0
    measured = summary.modes
    return any(m.label.split()[0] == mode.name and m.measured_growth_rate_1_per_s is not None for m in measured)


def _main_line(summary: RunFindings) -> list[str]:
    saturation = summary.saturation
    if saturation is None or saturation.main is None:
        return []
    text = f"After growth the line with most kinetic energy is at {saturation.main.frequency_Hz:.0f} Hz"
    shift = saturation.frequency_shift
    if shift is not None and abs(shift) >= SHIFT:
        text += f", {percent(abs(shift))} {'below' if shift < 0 else 'above'} {saturation.nearest_mode}"
    return [f"{text}."]


def _spectra(summary: RunFindings, _: Scene) -> list[str]:
    text = ["Spectra of the displacement, in the growth phase and after it."]
    measured = summary.modes
    peaks = [f"{m.label} at {m.measured_frequency_Hz:.0f} Hz" for m in measured if m.measured_frequency_Hz is not None]
    if peaks:
        text.append(f"In the growth phase there are peaks of {', '.join(peaks)}.")
    return text + _main_line(summary)


def _phase(summary: RunFindings, scene: Scene) -> list[str]:
    text = ["Velocity of the lining's surface against its displacement at the end of the record."]
    if summary.saturation is not None:
        sticks = summary.sticking is not None and summary.sticking.to_the_end_from_s is not None
        text.append("The whole lining sticks." if sticks else f"The motion is {_kind(summary.saturation)}.")
    if isinstance(scene.drum.speed, float):
        limit = abs(scene.shoe.outer_radius * scene.drum.speed)
        text.append(f"The lining overtakes the drum beyond {limit:.3g} m/s.")
    return text


def _kind(saturation: Saturation) -> str:
    kind = saturation.regime.kind
    return {"unknown": "not settled", "steady": "at rest, or on its way there"}.get(kind, kind)


def _contact(summary: RunFindings, scene: Scene) -> list[str]:
    if summary.sticking is not None and summary.sticking.to_the_end_from_s is not None:
        return ["Contact pressure along the arc at the end of the record, where the whole lining sticks to the drum."]
    half = math.degrees(scene.shoe.arc_angle) / 2
    text = [f"Contact pressure along the arc, from −{half:.3g} to {half:.3g} degrees, over the last periods."]
    if summary.saturation is None:
        return text
    fraction = summary.saturation.contact_fraction
    text.append(f"Grey is where the lining is off the drum: {percent(1 - fraction)} of it on average.")
    text.append(f"The slip is reversed on {percent(summary.saturation.slip_reversed_fraction)}.")
    return text


def _eigenvalues(summary: RunFindings, _: Scene) -> list[str]:
    text = ["Eigenvalues in the complex plane: growth rate to the right, frequency upwards."]
    for unstable, place in ((True, "Unstable, right of the axis"), (False, "Stable, left of it or on it")):
        found = [m for m in summary.prediction.modes if m.unstable is unstable]
        named = [_eigenvalue(mode) for mode in found]
        text.append(f"{place}: {'; '.join(named) or 'none'}.")
    return text


def _eigenvalue(mode: PredictedMode) -> str:
    rate = signed(mode.growth_rate_1_per_s, mode.frequency_Hz)
    return f"{mode.name} with {mode.frequency_Hz:.0f} Hz and {rate} per second"


def _frequency(summary: RunFindings, _: Scene) -> list[str]:
    found = summary.frequency
    if found is None:
        return ["FrequencyDrift of the leading mode over time."]
    return [
        f"FrequencyDrift of {found.mode} over time: from {found.onset_Hz:.0f} Hz, its eigenvalue, to "
        f"{found.saturated_Hz:.0f} Hz.",
        f"Loss of contact alone predicts {found.predicted_by_contact_loss_Hz:.0f} Hz; √(contact fraction) is a cruder "
        "estimate, the eigenvalue's frequency times the root of the mean fraction of the lining in contact.",
        *_contact_fraction(summary),
    ]


_FIGURES: dict[str, tuple[str, Callable[[RunFindings, Scene], list[str]]]] = {
    output_folder.GROWTH: ("Growth of the modes", _growth),
    output_folder.SPECTROGRAM: ("Spectrogram", _spectrogram),
    output_folder.SPECTRA: ("Spectra", _spectra),
    output_folder.PHASE: ("Phase portrait", _phase),
    output_folder.CONTACT: ("Contact along the arc", _contact),
    output_folder.EIGENVALUES: ("Eigenvalues", _eigenvalues),
    output_folder.FREQUENCY: ("FrequencyDrift over time", _frequency),
}
