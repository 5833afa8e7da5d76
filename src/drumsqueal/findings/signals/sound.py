"""A motion as sound: resampled for a loudspeaker, scaled to 16 bits, and wrapped as a WAV file.

scipy.io.wavfile and the standard library's wave write no texts, in which the scale of the samples stands.
"""

import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.resampling import resample
from drumsqueal.findings.signals.spectra import finite_record, positive

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


# Source: ISO 1683:2015, Acoustics — Preferred reference values for acoustical and vibratory levels; for sound in air.
_STANDARD = {
    "m": _LevelReference(1e-12, "1 pm", STANDARD),
    "m/s": _LevelReference(1e-9, "1 nm/s", STANDARD),
    "m/s^2": _LevelReference(1e-6, "1 µm/s²", STANDARD),
    "Pa": _LevelReference(2e-5, "20 µPa", STANDARD),
    "N": _LevelReference(1e-6, "1 µN", STANDARD),
}


def level_reference(unit: str) -> _LevelReference:
    """The reference of levels in an SI unit: that of ISO 1683, and 1 of the unit for what it does not name."""
    return _STANDARD.get(unit, _LevelReference(1.0, f"1 {unit}"))


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
