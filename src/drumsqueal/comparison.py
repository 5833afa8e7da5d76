"""The linear prediction against what the transient does: onset frequency, growth, saturated motion."""

from typing import NamedTuple

import numpy as np
import xarray

from drumsqueal.departure import FEWEST_SAMPLES, Departure, edge_share
from drumsqueal.model import Model
from drumsqueal.modes import Mode, Stability
from drumsqueal.saturation import Saturation, describe_saturation
from drumsqueal.signals import Growth, amplitude_spectrum, fit_growth, modal_frequency, peak_near

# The motion counts as linear while it stays below this share of the edges, contact loss and slip reversal.
LINEAR_SHARE = 0.1
# A mode is followed while it makes up at least this share of what its own coordinate has done so far: a weaker one
# drowns in what the others feed into it at second order of their size.
CLEAN_SHARE = 3e-2
UNEXCITED_SHARE = 1e-12  # of the largest displacement: a mode below it is not there
FEWEST_PERIODS = 5  # of a mode, for its frequency and growth to be measured
GROWN = 1.1  # times the start: what the motion must reach by the end to have grown
NEUTRAL_SHARE = 1e-9  # of the frequency: a growth rate below it is none, and has no relative error


class ModeComparison(NamedTuple):
    """One mode: what the eigenvalue says and what the transient did; None where that cannot be told, and why."""

    name: str
    unstable: bool
    predicted_frequency_Hz: float
    predicted_growth_rate: float
    measured_frequency_Hz: float | None
    frequency_resolution_Hz: float | None
    phase_frequency_Hz: float | None
    measured_growth: Growth | None
    note: str

    @property
    def frequency_error(self) -> float | None:
        """Measured over predicted frequency, less 1."""
        if self.measured_frequency_Hz is None:
            return None
        return self.measured_frequency_Hz / self.predicted_frequency_Hz - 1

    @property
    def growth_error(self) -> float | None:
        """Measured over predicted growth rate, less 1; None for a mode that neither grows nor decays."""
        if (
            self.measured_growth is None
            or abs(self.predicted_growth_rate) < NEUTRAL_SHARE * self.predicted_frequency_Hz
        ):
            return None
        return self.measured_growth.rate_1_per_s / self.predicted_growth_rate - 1


class Comparison(NamedTuple):
    """End of the growth phase (s), first edge (s), each mode, the saturated motion and a verdict in one sentence.

    `edge_reached_s` and `saturation` are None where the motion reached no edge; `motion_ratio` is the largest
    departure in the last tenth of the record over that in the first tenth.
    """

    growth_end_s: float
    edge_reached_s: float | None
    motion_ratio: float
    modes: tuple[ModeComparison, ...]
    saturation: Saturation | None
    verdict: str


def compare(history: xarray.Dataset, stability: Stability, model: Model) -> Comparison:
    """Compare a history with the eigenvalues of its steady state.

    `stability` may hold more coordinates than moved. The growth phase lasts until the motion comes to 10 % of an edge.
    """
    departure = Departure(history, stability)
    time = departure.time
    share = edge_share(departure, stability, model)
    nonlinear, reached = np.flatnonzero(share >= LINEAR_SHARE), np.flatnonzero(share >= 1)
    growing = slice(0, int(nonlinear[0]) if nonlinear.size else time.size)
    modes = tuple(_compare_mode(mode, stability, departure, growing) for mode in stability.modes)
    edge = float(time[reached[0]]) if reached.size else None
    saturation = None if edge is None else describe_saturation(history, departure, stability, edge)
    tenth = max(1, time.size // 10)
    start = share[:tenth].max()
    ratio = float(share[-tenth:].max() / start) if start > 0 else 1.0
    return Comparison(
        growth_end_s=float(time[max(growing.stop - 1, 0)]),
        edge_reached_s=edge,
        motion_ratio=ratio,
        modes=modes,
        saturation=saturation,
        verdict=_verdict(stability, edge, ratio, saturation, float(time[-1])),
    )


def _compare_mode(mode: Mode, stability: Stability, departure: Departure, growing: slice) -> ModeComparison:
    result = ModeComparison(mode.name, mode.unstable, mode.frequency_Hz, mode.growth_rate, None, None, None, None, "")
    time, displacement = departure.time[growing], departure.displacement[growing]
    if time.size < FEWEST_SAMPLES:
        return result._replace(note="the start is too large: the motion is nonlinear at once")
    signal = departure.modal(mode)[growing]
    size = np.abs(signal)
    main = stability.coordinates.index(mode.name)
    if size.max() <= UNEXCITED_SHARE * np.abs(displacement).max():
        return result._replace(note="not excited by this start")
    clean = size >= CLEAN_SHARE * np.maximum.accumulate(np.abs(displacement[:, main]))
    last = time.size if clean.all() else int(np.argmin(clean))
    if last < FEWEST_SAMPLES or (time[last - 1] - time[0]) * mode.frequency_Hz < FEWEST_PERIODS:
        return result._replace(
            note=f"fewer than {FEWEST_PERIODS} periods before it has died out or the motion is nonlinear"
        )
    spectrum = amplitude_spectrum(displacement[:last, main], departure.sample_rate)
    peak = peak_near(spectrum, mode.frequency_Hz, half_width=_reach(mode, stability))
    return result._replace(
        measured_frequency_Hz=None if peak is None else peak.frequency_Hz,
        frequency_resolution_Hz=spectrum.resolution_Hz,
        phase_frequency_Hz=modal_frequency(time[:last], signal[:last]),
        measured_growth=fit_growth(time[:last], size[:last]),
        note="" if peak is not None else "no line of its own in the spectrum",
    )


def _reach(mode: Mode, stability: Stability) -> float:
    """Half the distance to the next mode's frequency (Hz), at most a quarter of the mode's own."""
    apart = [abs(other.frequency_Hz - mode.frequency_Hz) / 2 for other in stability.modes if other is not mode]
    return min([mode.frequency_Hz / 4, *(distance for distance in apart if distance > 0)])


def _verdict(
    stability: Stability, edge: float | None, ratio: float, saturation: Saturation | None, duration: float
) -> str:
    """What a reader wants to know first, in one sentence."""
    names = ", ".join(mode.name for mode in stability.unstable)
    predicted = f"The linear model predicts squeal in {names}" if names else "The linear model predicts no squeal"
    if edge is None:
        if ratio > GROWN:
            done = f"the motion grows {ratio:.3g} times but reaches no edge in {duration:g} s, too short to tell more"
        elif names:
            done = f"the transient does not grow within {duration:g} s"
        else:
            done = f"the transient agrees: nothing grows within {duration:g} s"
        return f"{predicted}; {done}."
    if saturation is None:
        return f"{predicted}; the motion reaches an edge at {edge:.4g} s, too late to tell what it settles to."
    kinds = {
        "steady": "settles to steady sliding",
        "periodic": "settles to a periodic motion",
        "neither": "settles to no periodic motion",
        "unknown": "has not settled by the end of the record",
    }
    what = f"{predicted}; the transient reaches an edge at {edge:.4g} s and {kinds[saturation.regime.kind]}"
    if saturation.main is None or saturation.frequency_shift is None or saturation.regime.kind == "steady":
        return f"{what}."
    side = "below" if saturation.frequency_shift < 0 else "above"
    return (
        f"{what}, strongest at {saturation.main.frequency_Hz:.0f} Hz, {abs(saturation.frequency_shift):.1%} {side} "
        f"the onset frequency of {saturation.nearest_mode}, with {saturation.contact_fraction:.0%} of the lining in "
        f"contact and the slip reversed on {saturation.slip_reversed_fraction:.1%} of it on average."
    )
