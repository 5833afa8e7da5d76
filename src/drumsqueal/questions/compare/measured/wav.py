"""WAV files: whole numbers of any length and floating point, several channels; 1 is full scale."""

import warnings

import numpy as np
from scipy.io import wavfile

from drumsqueal.errors import RequestError
from drumsqueal.questions.compare.measured.record import Asked, Measured
from drumsqueal.questions.compare.measured.sampling import Sampling

CLIPPED = 1 - 1e-4  # of full scale; 16 bit reach 1 − 3e-5 upwards


def read_wav(asked: Asked) -> Measured:
    """Read a channel of a WAV file, in full scales without a unit. Raises RequestError for one cut short or damaged."""
    path, rate = asked.path, asked.rate
    try:
        with warnings.catch_warnings(record=True) as noted:
            warnings.simplefilter("always")
            own_rate, data = wavfile.read(path)
    except Exception as error:  # scipy raises nearly all there is on a file that is damaged
        damaged = f"{path}: this WAV file is damaged, or of a kind that is not read ({error})"
        raise RequestError(f"{damaged}; PCM and floating point are") from None
    if any("prematurely" in str(note.message) or "Incomplete" in str(note.message) for note in noted):
        raise RequestError(f"{path}: the WAV file is cut short; copy it again")
    columns = data.reshape(len(data), -1)
    names = [f"channel {k + 1}" for k in range(columns.shape[1])]
    at = asked.pick(names)
    remarks: list[str] = []
    if rate is not None:
        remarks.append(f"the sample rate is that of --rate, not the {own_rate} Hz of the file")
    elif not own_rate > 0:
        raise RequestError(f"{path}: the WAV file states a sample rate of {own_rate} Hz; give --rate")
    values = np.asarray(columns[:, at], dtype=np.float64)
    if data.dtype.kind in "iu":
        bits = 8 * data.dtype.itemsize  # scipy puts 24 bits into the upper ones of 32
        values = (values - (128.0 if data.dtype.kind == "u" else 0.0)) / 2.0 ** (bits - 1)
        clipped = int(np.sum(np.abs(values) >= CLIPPED))
        if clipped > 1:
            remarks.append(
                f"{clipped} samples are at full scale: clipping adds harmonics and combinations of the lines"
            )
    return asked.measured(names[at], None, Sampling(float(rate or own_rate), 0.0), values, remarks)
