"""Which part of a history an animation shows, in how many frames, and how far magnified."""

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.findings.signals.spectra import amplitude_spectrum, spectral_peaks
from drumsqueal.findings.time_window import time_window
from drumsqueal.findings.vibration import FEWEST_FOR_SPECTRUM
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.model import Model
from drumsqueal.questions.run.figures.view import REST

FRAMES_PER_SECOND = 25  # 40 ms a frame, which GIF, counting in hundredths of a second, holds exactly
PERIODS = 3  # of the main line, shown unless other times are asked for
FRAMES, MODE_FRAMES = 150, 50  # unless a speed is asked for
FEWEST_A_PERIOD, MOST = 8, 750  # frames; with fewer a period, the picture would show another motion than there was
LOOKED_AT = 0.05  # s, in which the main line is looked for
FRACTION = 0.3  # of the shoe's thickness that the largest displacement takes in the picture

Values = NDArray[np.float64]


def main_frequency(model: Model, time: Values, states: Values, start: float | None, end: float | None) -> float | None:
    """Frequency (Hz) of the strongest line of the coordinate with most kinetic energy near what is shown, if any."""
    # No less than 50 ms, where there are: a few periods alone would tell their frequency badly.
    if end is None:
        end = float(time[-1]) if start is None else min(start + LOOKED_AT, float(time[-1]))
    begin = end - LOOKED_AT if start is None else min(start, end - LOOKED_AT)
    part = slice(*np.searchsorted(time, [begin - 1e-12, end + 1e-12]).tolist())
    if time[part].size < FEWEST_FOR_SPECTRUM:
        return None
    energy = np.asarray(model.mass) * np.var(states[part, len(model.names) :], axis=0)
    record = states[part, int(np.argmax(energy))]
    if not np.ptp(record) > REST:
        return None
    spectrum = amplitude_spectrum(record, (time.size - 1) / float(time[-1] - time[0]))
    peaks = spectral_peaks(spectrum, count=1, floor=0.5)
    return float(peaks.frequency_Hz[0]) if peaks.frequency_Hz.size else None


def find_window(time: Values, main: float | None, start: float | None, end: float | None) -> tuple[float, float]:
    """First and last time (s) shown: the last three periods unless asked otherwise. Raises RequestError."""
    first, last = float(time[0]), float(time[-1])
    since, until = time_window("the history", (first, last), (last - first) / max(time.size - 1, 1), start, end)
    span = last - first if main is None else min(PERIODS / main, last - first)
    if start is None and not (end is None and main is None):
        since = max(first, until - span)
    if end is None:
        until = min(last, since + span)
    return since, until


def count_frames(
    span: float, main: float | None, slow: float | None, usual: int = FRAMES, *, closed: bool = False
) -> int:
    """Number of frames; a closed loop does not show its first frame twice. Raises RequestError for too few or many."""
    periods = span * main if main else 1.0
    fewest = int(np.ceil(FEWEST_A_PERIOD * periods)) + (not closed)
    if slow is None:
        if fewest > MOST:
            raise RequestError(
                f"these {span:.4g} s hold {periods:.0f} periods of {main:.4g} Hz, and {MOST} frames show "
                f"{MOST // FEWEST_A_PERIOD}; give nearer times with --from and --until"
            )
        return max(usual, fewest)
    frames = round(span * slow * FRAMES_PER_SECOND) + (not closed)
    if not fewest <= frames <= max(MOST, fewest):
        least, most = ((count - (not closed)) / FRAMES_PER_SECOND / span for count in (fewest, max(MOST, fewest)))
        raise RequestError(
            f"--slow {slow:g}: that makes {frames} frames of {span:.4g} s; {FEWEST_A_PERIOD} a period are needed and "
            f"{max(MOST, fewest)} are the most: take {np.ceil(least):.0f} to {np.floor(most):.0f}, or other times"
        )
    return frames


def find_magnification(shoe: RigidShoe, largest: float, wanted: float | None, window: tuple[float, float]) -> float:
    """Factor at which the largest displacement (m) is drawn, if none is wanted as a fraction of the thickness.

    Raises RequestError where nothing moves, and where it would be drawn further than the shoe is thick.
    """
    if not largest > REST:
        raise RequestError(f"nothing moves from {window[0]:.6g} to {window[1]:.6g} s; give other times")
    thickness = float(shoe.thickness)
    if wanted is None:
        exact = FRACTION * thickness / largest
        step = 10.0 ** (np.floor(np.log10(exact)) - 1)
        return float(np.floor(exact / step) * step)  # two digits, which can be told in the picture
    if wanted * largest > thickness:
        raise RequestError(
            f"--magnify {wanted:g}: the shoe would be drawn further from its place than it is thick; "
            f"take at most {thickness / largest:.4g}"
        )
    return wanted
