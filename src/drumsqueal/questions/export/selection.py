"""Which part of a history goes out, and at which rate; what a lower rate cannot hold is reported."""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from drumsqueal.errors import RequestError, SteadyStateError
from drumsqueal.files.saved_history import UNEVEN, SavedHistory
from drumsqueal.findings.signals.resampling import PASSES, fraction_above, reach, resample
from drumsqueal.findings.time_window import time_window
from drumsqueal.questions.export.channels import FLAG, UNKNOWN, Channel, Channels
from drumsqueal.questions.export.signals import make_channels, names_of
from drumsqueal.scene.quantities import percent

if TYPE_CHECKING:
    from drumsqueal.solve.linear.modes import Stability

LEAST_FRACTION = 1e-4  # of a signal's energy, a hundredth of its amplitude: less is lost without a word
LOWEST = 200  # times the rate may be below the history's: the filter grows as long
MOST_SAMPLES = 2 * 10**8  # of all signals together: 1.6 GB


class Part(NamedTuple):
    """What is asked for: signals (None for all), from and until when (s), and the rate (Hz); None is the history's.

    A sound is `slow` times slower than it was, and is resampled to `slow` times the rate.
    """

    signals: tuple[str, ...] | None = None
    since: float | None = None
    until: float | None = None
    rate: float | None = None
    slow: float = 1.0


def select(saved: SavedHistory, part: Part, *, predicts: bool) -> tuple[Channels, list[str]]:
    """Take this part of a history, and what is to be said of it, such as what a lower rate filters out.

    Without a rate, or at the history's own, samples are as they were recorded. Flags such as sticking are taken from
    the nearest sample, all else is limited to the new band. `predicts` asks for the eigenvalues, too. Raises
    RequestError for signals that are not there, for a part of fewer than two samples, and for a rate out of proportion.
    """
    own, names = _own_rate(saved), names_of(part.signals, saved)
    rate = own if part.rate is None else part.rate * part.slow
    begin, latest = (float(saved.data["time"].values[k]) for k in (0, -1))
    first, last = time_window("the history", (begin, latest), 1 / own, part.since, part.until)
    place, end = (first - begin) * own, (last - begin) * own  # in samples from the first of the history on
    if rate == own:  # the samples within the part
        place = np.ceil(place - UNEVEN)
        end = np.floor(end + UNEVEN)
    count = int((end - place) * rate / own + UNEVEN) + 1
    if rate < own / LOWEST:
        why = f"--rate {rate / part.slow:.6g} Hz is less than 1/{LOWEST} of the history's {own:.6g} Hz"
        raise RequestError(f"{why}; take at least {own / LOWEST / part.slow:.6g} Hz")
    if count < 2:
        why = f"{first:.6g} to {last:.6g} s hold {count} samples at {rate:.6g} Hz, at least two are needed"
        raise RequestError(f"{why}; take more of the history, or a higher --rate")
    if count * len(names[0]) > MOST_SAMPLES:
        why = f"{count} samples of {len(names[0])} signals are more than are written at a time"
        raise RequestError(f"{why}; take a part with --from, --until, --signals, or a lower --rate")
    remarks = list(names[1])
    if not saved.complete:
        remarks.append(f"the run is incomplete ({saved.outcome}); what it computed is exported")
    if rate == own:
        channels = make_channels(saved, names[0], slice(int(place), int(place) + count))
    else:
        # What lies before and after the part is known, and the filter sees it.
        beyond = reach(own, rate)
        low, high = max(int(place) - beyond, 0), int(end) + beyond + 2
        recorded = make_channels(saved, names[0], slice(low, high))
        remarks += _lost(recorded, own, rate, part)
        channels = _resampled(recorded, own, place - low, count, rate)
    stability, unknown = _predicted(saved) if predicts else (None, {})
    start, texts = float(begin + place / own), _texts(saved) | unknown
    return Channels(start, rate, tuple(channels), texts, saved.scene, stability, part.slow), remarks


def _own_rate(saved: SavedHistory) -> float:
    """The sample rate (Hz) as the scene has it, where that is the history's."""
    asked = saved.scene.simulate.sample_rate
    return asked if abs(saved.sample_rate / asked - 1) < UNEVEN else saved.sample_rate


def _resampled(recorded: Sequence[Channel], own: float, place: float, count: int, rate: float) -> list[Channel]:
    """Channels at so many times from a place (samples) on, at a rate (Hz)."""
    places = place + np.arange(count) * (own / rate)
    smooth = [channel for channel in recorded if _is_smooth(channel)]
    found = {}
    if smooth:
        values = np.stack([channel.values for channel in smooth], axis=1)
        columns = resample(values, own, places / own, rate)
        found = {channel.name: columns[:, k] for k, channel in enumerate(smooth)}
    size = recorded[0].values.size
    nearest = np.clip(np.floor(places + 0.5).astype(int), 0, size - 1)
    return [
        channel._replace(values=found[channel.name] if channel.name in found else channel.values[nearest])
        for channel in recorded
    ]


def _lost(recorded: Sequence[Channel], own: float, rate: float, part: Part) -> list[str]:
    """One line on what the rate cannot hold; nothing where that is next to nothing."""
    if rate >= own:
        return []
    lost = [
        (channel.name, *fraction_above(channel.values, own, rate / 2)) for channel in recorded if _is_smooth(channel)
    ]
    lost = sorted((found for found in lost if found[1] > LEAST_FRACTION), key=lambda found: -found[1])
    if not lost:
        return []
    name, fraction, line = lost[0]
    others = f", and some of {len(lost) - 1} more" if len(lost) > 1 else ""
    slower = "" if part.slow == 1 else f", {part.slow:g} times slower,"
    why = (
        f"a rate of {rate / part.slow:.6g} Hz{slower} holds what is below {rate / 2:.6g} Hz: {percent(fraction)} of "
        f"the energy of {name} lies above, most at {line:.5g} Hz{others}; it is filtered out, as it would be aliased"
    )
    keeps = line / PASSES / part.slow
    return [f"{why}; {np.ceil(keeps):.6g} Hz would keep that line" if line / PASSES < own else why]


def _is_smooth(channel: Channel) -> bool:
    return channel.quantity != FLAG


def _texts(saved: SavedHistory) -> dict[str, str]:
    attributes = saved.data.attrs
    held = json.loads(attributes["versions"]) if "versions" in attributes else {}
    texts = {
        "title": saved.scene.title,
        "scene": saved.scene.to_toml(),
        "versions": " ".join(f"{name} {version}" for name, version in held.items()),
        "outcome": saved.outcome,
        "source": saved.path.name,
        "measured_from": str(attributes.get("measured_from", "")),
    }
    return texts | ({"friction_law": str(attributes["friction_law"])} if saved.given_law else {})


def _predicted(saved: SavedHistory) -> tuple["Stability | None", dict[str, str]]:
    """The modes of steady sliding, or None and why not."""
    if saved.given_law:
        return None, {UNKNOWN: "the friction law was given in Python"}
    from drumsqueal.physics.composition import linear_coordinates
    from drumsqueal.physics.model import build_model
    from drumsqueal.solve.linear.modes import analyse_stability

    try:
        return analyse_stability(build_model(saved.scene, coordinates=linear_coordinates(saved.scene))), {}
    except SteadyStateError as error:
        return None, {UNKNOWN: str(error)}
