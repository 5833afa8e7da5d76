"""What the lining does, to be heard: the record and the motion after growth, as WAV files inside the page."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.files.saved_history import SavedHistory
from drumsqueal.findings.saturation import Saturation
from drumsqueal.findings.signals.resampling import resample
from drumsqueal.findings.signals.sound import CD_RATE, to_sound, wav_bytes
from drumsqueal.findings.verdict import hertz
from drumsqueal.questions.export.signals import default_signal, make_channels
from drumsqueal.questions.report.page import data_uri

SLOWER = 4  # times, so that what is too high to be heard well is heard
RECORD_S = 1.0  # of the record that is played at most
AFTER_S = 0.2  # of the motion after growth that is played with the growth, at most, of a longer record
REPEATED_S = 3.0  # that the motion after growth is repeated to
FADE_S = 0.01  # over which one repetition goes over into the next
SHORTEST_S = 2 * FADE_S
QUIET = 1e-9  # m/s: what moves less is not played


class Clip(NamedTuple):
    """A sound: heading, what is to be heard, its length (s), the velocity (m/s) of its loudest sample, and its WAV.

    `tone` states the pitch to listen for, where there is one.
    """

    heading: str
    text: str
    seconds: float
    peak: float
    uri: str
    tone: str


def clips(history: SavedHistory, saturation: Saturation | None, *, settles: bool) -> list[Clip]:
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
    if np.ptp(record) < QUIET:
        return []
    growing = "as it was" if since is None else "first the growth, then the motion that it leads to"
    span = f"From {first:.4g} to {last:.4g} s, {RECORD_S:g} s at most of a record of {time[-1]:.4g} s"
    if first == 0 and last == time[-1]:
        span = f"The whole record, {last:.4g} s"
    lower = f"every frequency {SLOWER} times lower"
    found = [
        _clip("The record", f"{span}, at its own speed: {growing}.", record, 1, title),
        _clip(f"The record, {SLOWER} times slower", f"{span}, {lower}: {growing}.", record, SLOWER, title),
    ]
    if saturation is None or since is None or not settles:
        return found
    part = _heard(surface[(time >= since) & (time < since + REPEATED_S)], history.sample_rate)
    if part.size < SHORTEST_S * CD_RATE or np.ptp(part) < QUIET:
        return found
    tone = ""
    if saturation.main is not None:
        line = saturation.main.frequency_Hz
        tone = f"The main line is a tone of {hertz(line)}, {hertz(line / SLOWER)} where it is slower."
    for slow in (1, SLOWER):
        repeated, times = _repeated(part, REPEATED_S / slow)
        slower = "" if slow == 1 else f", {slow} times slower"
        more = (
            f"Its {part.size / CD_RATE:.3g} s of record, cut where the motion is most like its beginning, are played "
            f"{times} times with cross-fades of {FADE_S * 1e3:g} ms: a beat at that rate is that of the repetition, "
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
    fade = round(FADE_S * CD_RATE)
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


def _clip(heading: str, text: str, velocity: NDArray[np.float64], slow: int, title: str, tone: str = "") -> Clip:
    # What is slower has the same samples at a lower rate.
    sound = to_sound(velocity, CD_RATE, slow=slow, rate=CD_RATE // slow)
    comment = f"{heading}: velocity of the lining's surface; one step is {sound.scale:.6g} m/s"
    seconds = sound.samples.size / sound.sample_rate
    return Clip(heading, text, seconds, sound.peak, data_uri("audio/wav", wav_bytes(sound, title, comment)), tone)
