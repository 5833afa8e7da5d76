"""A motion as sound: resampled for a loudspeaker, scaled to 16 bits, and wrapped as a WAV file.

scipy.io.wavfile and the standard library's wave write no texts, in which the scale of the samples stands. Resampling is
not by scipy.signal.resample_poly or soxr: they take the motion beyond the ends for rest, a line or a mirror image, and
are off by 7 to 50 % of the largest amplitude there where this is off by 1e-5; and their times are not free.
"""

import math
import struct
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.spectra import finite_record, positive

# In fractions of the lower of the two rates: what passes, to 5e-5, and what is stopped, to 1e-5 (100 dB). The window's
# shape and length for these are those of Kaiser's formulas: A = 2.285 Δω N + 7.95 dB, shape 0.1102 (A − 8.7),
# and a few samples more, for the window here ends at zero.
PASSES, STOPS = 0.45, 0.5
_HALF, _SHAPE = 68, 10.0  # half the length of the filter, in samples of the lower rate, and its shape
_FITTED, _ORDER = 1024, 96  # samples, and coefficients, of the prediction beyond the ends


def reach(sample_rate: float, rate: float) -> int:
    """How many samples on either side of a time `resample` looks at."""
    return math.ceil(_HALF / min(1.0, rate / sample_rate)) + 1


def resample(values: ArrayLike, sample_rate: float, times: ArrayLike, rate: float) -> NDArray[np.float64]:
    """Signals (n, k), sampled at `sample_rate` (Hz) from 0 s on, at times (m,) that come at `rate` (Hz): shape (m, k).

    y(t) = Σ_j x_j c sinc(c (t f − j)) w((t f − j)/half), c = 0.95 min(1, rate/f), w Kaiser's window: up to 0.45 of the
    lower rate what there is passes to 5e-5, without delay, and beyond 0.5 of it, where it would fold, it is lowered by
    100 dB. Beyond its ends a signal goes on as linear prediction has it, for which a sum of some 48 lines, steady or
    growing, is no surprise, so that a filter does not ring there; for others the last samples are less sure. Raises
    ValueError for values that are not finite and rates that are not positive.
    """
    array = finite_record("values", values, dimensions=2, minimum=2)
    ratio = min(1.0, positive("rate", rate) / positive("sample_rate", sample_rate))
    cutoff, half = (PASSES + STOPS) * ratio, _HALF / ratio
    beyond = reach(sample_rate, rate)
    longer = np.concatenate([_predicted(array[::-1], beyond)[::-1], array, _predicted(array, beyond)])
    places = np.asarray(times, dtype=np.float64) * sample_rate + beyond
    offsets = np.arange(2 * beyond - 1) - (beyond - 1)
    result = np.empty((places.size, array.shape[1]))
    block = max(1, 2**20 // offsets.size)  # weights at a time: 8 MB
    for first in range(0, places.size, block):
        place = places[first : first + block]
        near = np.clip(np.rint(place).astype(int), beyond - 1, len(longer) - beyond)[:, None] + offsets
        distance = place[:, None] - near
        inside = np.sqrt(np.clip(1 - (distance / half) ** 2, 0, None))
        # Less the 1 that Kaiser's window ends with: where it ends is then of no importance.
        window = (scipy.special.i0(_SHAPE * inside) - 1) / (scipy.special.i0(_SHAPE) - 1)
        weights = cutoff * np.sinc(cutoff * distance) * window
        for k in range(array.shape[1]):
            result[first : first + block, k] = np.einsum("ji,ji->j", weights, longer[near, k])
    return result


def _predicted(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """How signals (n, k) go on for so many samples: x_n = Σ a_i x_(n−i), the smallest a that fits the last ones."""
    result = np.empty((count, values.shape[1]))
    for k, signal in enumerate(values[-_FITTED:].T):
        order = max(1, min(_ORDER, signal.size // 3))
        rows = np.lib.stride_tricks.sliding_window_view(signal, order)
        # The smallest solution: what is left over of it decays (Kumaresan & Tufts, IEEE Trans. ASSP 30 (1982) 833).
        # Below 1e-9 of the largest singular value there is only round-off.
        coefficients = np.linalg.lstsq(rows[:-1], signal[order:], rcond=1e-9)[0]
        # Within half a span of what was there: a motion that grows does so slowly, and a bad fit does no harm.
        low, high = signal.min(), signal.max()
        margin = (high - low) / 2
        line = np.concatenate([signal[-order:], np.empty(count)])
        for i in range(count):
            line[order + i] = np.clip(line[i : order + i] @ coefficients, low - margin, high + margin)
        result[:, k] = line[order:]
    return result


def fraction_above(values: ArrayLike, sample_rate: float, frequency: float) -> tuple[float, float]:
    """Fraction of the energy of a signal (n,), its mean left out, above a frequency (Hz), and the strongest line there.

    From the periodogram with a Hann window; the fraction is 0 for a signal that is constant. Raises ValueError.
    """
    signal = finite_record("values", values, minimum=2)
    frequencies, power = scipy.signal.periodogram(signal, positive("sample_rate", sample_rate), window="hann")
    above = frequencies > frequency
    total = power.sum()
    if not (total > 0 and above.any()):
        return 0.0, frequency
    return float(power[above].sum() / total), float(frequencies[above][np.argmax(power[above])])


# Levels in decibels, of rms values over the reference values of ISO 1683.


STANDARD = "ISO 1683"


class _LevelReference(NamedTuple):
    """The rms value of 0 dB in the SI unit, as an amount with its unit, and the standard that it is from, if any."""

    rms: float
    amount: str
    standard: str = ""

    @property
    def written(self) -> str:
        """Amount and standard."""
        return f"{self.amount} ({self.standard})" if self.standard else self.amount


def level_reference(unit: str) -> _LevelReference:
    """The reference of levels in an SI unit: that of ISO 1683, and 1 of the unit for what it does not name."""
    # Source: ISO 1683:2015, Acoustics — Preferred reference values for acoustical and vibratory levels; for sound in
    # air.
    standard = {
        "m": _LevelReference(1e-12, "1 pm", STANDARD),
        "m/s": _LevelReference(1e-9, "1 nm/s", STANDARD),
        "m/s^2": _LevelReference(1e-6, "1 µm/s²", STANDARD),
        "Pa": _LevelReference(2e-5, "20 µPa", STANDARD),
        "N": _LevelReference(1e-6, "1 µN", STANDARD),
    }
    return standard.get(unit, _LevelReference(1.0, f"1 {unit}"))


def level_dB(amplitude: NDArray[np.float64] | float, rms_of_0_dB: float) -> NDArray[np.float64]:
    """The level L = 20 lg(A / (√2 r)) of sines of amplitude A, r the rms value of 0 dB; −240 dB at the least."""
    return 20 * np.log10(np.maximum(np.asarray(amplitude) / (np.sqrt(2) * rms_of_0_dB), 1e-12))


CD_RATE = 44_100  # Hz, which every player takes
FULL_SCALE = 32767  # steps
HEADROOM_DB = 1.0  # below full scale: room for what a player's filter makes of peaks between the samples


class Sound(NamedTuple):
    """16-bit samples (n,) at `sample_rate` (Hz), the `scale` of one step in the signal's units, and its `peak`."""

    samples: NDArray[np.int16]
    sample_rate: int
    scale: float
    peak: float


def to_sound(velocity: ArrayLike, sample_rate: float, *, slow: float = 1.0, rate: int = CD_RATE) -> Sound:
    """Turn a velocity (n,) sampled at `sample_rate` (Hz) into a sound at `rate` (Hz), `slow` times slower than it was.

    Its mean is left out, and its peak put 1 dB below full scale: velocity − mean = scale · samples, to half a step.
    A line of frequency f is heard at f/slow. What is sampled at rate · slow already is not resampled. Raises ValueError
    for numbers that make no sense and for a velocity that is constant.
    """
    values = finite_record("velocity", velocity, minimum=2)
    # 1e-12 of the largest value: what moves less is constant but for round-off
    if np.ptp(values) <= 1e-12 * np.abs(values).max():
        raise ValueError("velocity is constant: there is nothing to hear")
    wanted = positive("slow", slow) * positive("rate", rate)
    if sample_rate != wanted:
        length = (values.size - 1) / positive("sample_rate", sample_rate)
        values = resample(values[:, None], sample_rate, np.arange(int(length * wanted) + 1) / wanted, wanted)[:, 0]
    values = values - values.mean()
    peak = float(np.abs(values).max())
    scale = peak / (FULL_SCALE * 10 ** (-HEADROOM_DB / 20))
    return Sound(np.rint(values / scale).astype(np.int16), rate, scale, peak)


def wav_bytes(sound: Sound, title: str = "", comment: str = "") -> bytes:
    """Return a WAV file: RIFF with one channel of 16-bit PCM, and title and comment in its LIST INFO chunk.

    Source: Multimedia Programming Interface and Data Specifications 1.0 (IBM and Microsoft, 1991).
    """
    rate = sound.sample_rate
    description = struct.pack("<HHIIHH", 1, 1, rate, 2 * rate, 2, 16)  # PCM, one channel, two bytes a sample
    fields = {b"INAM": title, b"ICMT": comment, b"ISFT": "drumsqueal"}
    texts = b"".join(_chunk(name, text.encode() + b"\0") for name, text in fields.items() if text)
    data = sound.samples.astype("<i2").tobytes()
    chunks = _chunk(b"fmt ", description) + _chunk(b"LIST", b"INFO" + texts) + _chunk(b"data", data)
    return _chunk(b"RIFF", b"WAVE" + chunks)


def _chunk(name: bytes, content: bytes) -> bytes:
    return name + struct.pack("<I", len(content)) + content + bytes(len(content) % 2)
