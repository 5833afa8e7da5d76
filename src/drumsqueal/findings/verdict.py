"""What a run says in one sentence: the prediction, and what the transient did with it."""

import math
from typing import NamedTuple

from drumsqueal.findings.frequency import FrequencyDrift
from drumsqueal.findings.quadrature import QuadratureError
from drumsqueal.findings.saturation import Saturation
from drumsqueal.findings.signals import told_frequencies
from drumsqueal.findings.sticking import Sticking
from drumsqueal.scene.quantities import percent
from drumsqueal.solve.linear.modes import Mode, Stability

GROWN = 1.1  # times the start: what the motion must reach by the end to have grown
CLEAR_GROWTH = 10  # times: a predicted growth that shows even of a mode that starts as a tenth of the motion
SMALL_ROTATION = 0.1  # rad; the cosine that the model takes for 1 is off by half a per cent there
SHIFT = 1e-3  # of a frequency: less needs no explanation
DIGITS = 4  # of a frequency
_SETTLED = {
    "steady": "settles to steady sliding",
    "periodic": "settles to a periodic motion",
    "quasi-periodic": "settles to a quasi-periodic motion",
    "irregular": "settles to an irregular motion",
    "unknown": "has not settled by the end of the record",
}


class Temperature(NamedTuple):
    """Rise of the lining's temperature at the end (K), and the fraction of friction that is then left."""

    end: float
    friction_left: float


def state_verdict(
    stability: Stability,
    *,
    changing: bool,
    forced: bool,
    moved_by: str,
    excited: tuple[Mode, ...],
    motion_ratio: float | None,
    edge: float | None,
    saturation: Saturation | None,
    frequency: FrequencyDrift | None,
    duration: float,
    rotation: float,
    sticking: Sticking,
    cut_off: str | None,
    quadrature: QuadratureError | None,
    temperature: Temperature | None = None,
) -> str:
    """Return prediction and outcome in one sentence.

    `changing` tells that drum speed or load change, `forced` that a harmonic force acts, `moved_by` what else pushes
    the shoe ("changing load", or nothing), `excited` are the modes that the start holds, `motion_ratio` is the motion
    at the end over that at the start (None without a start), `edge` the time of the first edge (s), `frequency` how a
    mode's frequency went from onset to saturation, `duration` that of the record (s), `rotation` the largest rotation
    of the shoe (rad), `sticking` tells when the lining sticks, `cut_off` says why it ends early, and `quadrature` is
    the error of the contact forces. `temperature` is how far the lining warms up, where the scene follows it.
    """
    time = f" at t = {stability.time:g} s" if changing else ""
    predicted = f"The linear model predicts {_prediction(stability)}{time}"
    if edge is None and forced:
        done = f"under the harmonic force the transient reaches no edge in {duration:g} s"
    elif edge is None:
        done = _below_the_edges(stability, excited, motion_ratio, moved_by, duration)
    elif saturation is None:
        done = f"the motion reaches an edge at {edge:.4g} s, too late to tell what it settles to"
    else:
        settled = "comes to stick" if sticking.to_the_end else _settled(saturation, stability)
        done = f"the transient reaches an edge at {edge:.4g} s and {settled}"
    if motion_ratio is None and edge is not None and not forced:
        done = f"nothing was started, but {f'the {moved_by} moves the shoe' if moved_by else 'round-off grows'}: {done}"
    if sticking.spells:
        done += f"; {_sticks(sticking)}"
    if rotation > SMALL_ROTATION:
        done += f"; the shoe turns by {rotation:.2g} rad, where small rotations, and so the model, no longer hold"
    if cut_off:
        done += f" (the run {'was ' if cut_off.startswith('interrupted') else ''}{cut_off})"
    return f"{predicted}; {done}.{_why(frequency)}{_warmed(temperature)}{_inaccurate(quadrature)}"


def difference_is_no_error(time: float | None, until: float) -> str:
    """Why a prediction for one time (s, None: not known) and a mean up to another are not compared."""
    at = "one time" if time is None else f"t = {time:g} s"
    return (
        f"Drum speed or load change: the prediction is for {at}, the mean is that from 0 to {until:.4g} s, so that "
        "their difference is no error"
    )


def _warmed(temperature: Temperature | None) -> str:
    if temperature is None:
        return ""
    warm = f" The lining warms up by {temperature.end:.3g} K by the end"
    lost = 1 - temperature.friction_left
    return f"{warm}, by which friction loses {percent(lost)}; the linear model is that of the cold lining."


def _inaccurate(quadrature: QuadratureError | None) -> str:
    """Warn where the integrals over the lining are worse than the integration in time."""
    if quadrature is None or quadrature.fraction <= quadrature.tolerance:
        return ""
    return (
        f" Warning: the contact forces are wrong by up to {quadrature.fraction:.1g} of the largest normal force, more "
        f"than the tolerance of {quadrature.tolerance:.1g}: the friction law varies too fast for the quadrature over "
        "the lining, and the motion is no more accurate than its forces."
    )


def _why(frequency: FrequencyDrift | None) -> str:
    """Say what explains the frequency, where there is a shift to explain."""
    if frequency is None or abs(frequency.shift) < SHIFT:
        return ""
    predicted = frequency.contact_loss_shift
    side = "below" if predicted < 0 else "above"
    return (
        f" Loss of contact alone, averaged over the motion, puts {frequency.mode} at "
        f"{frequency.softening.contact_loss_Hz:.0f} Hz, {abs(predicted):.1%} {side}."
    )


def _prediction(stability: Stability) -> str:
    names = ", ".join(mode.label for mode in stability.unstable)
    drift = "" if stability.divergence is None else f"divergence without oscillation at {stability.divergence:+.4g} 1/s"
    if names:
        return f"squeal in {names}" + (f" and {drift}" if drift else "")
    return f"no squeal but {drift}" if drift else "no squeal"


def _below_the_edges(
    stability: Stability, excited: tuple[Mode, ...], motion_ratio: float | None, moved_by: str, duration: float
) -> str:
    if motion_ratio is None and moved_by:
        return (
            f"nothing was started, but the {moved_by} moves the shoe: the transient reaches no edge in {duration:g} s"
        )
    if motion_ratio is None:
        return "nothing was started, and the transient reaches no edge"
    if motion_ratio > GROWN:
        return (
            f"the motion grows {motion_ratio:.3g} times but reaches no edge in {duration:g} s, too short to tell more"
        )
    growing = [mode.growth_rate for mode in excited if mode.unstable]
    if not stability.unstable and stability.divergence is None:
        return f"the transient agrees: nothing grows within {duration:g} s"
    if stability.unstable and not growing:
        return f"the start excites none of the unstable modes, and the transient does not grow within {duration:g} s"
    rate = max([*growing, stability.divergence or 0.0])
    if rate * duration < math.log(CLEAR_GROWTH):
        reach = math.exp(rate * duration)
        return f"{duration:g} s are too short to tell: the fastest growth would be by a factor of {reach:.4g}"
    return f"the transient does not grow within {duration:g} s"


def _sticks(sticking: Sticking) -> str:
    if sticking.to_the_end:
        return f"from {sticking.spells[-1][0]:.4g} s on the whole lining sticks to the drum"
    if sticking.share == 0:
        return "the whole lining sticks to the drum for an instant"
    return f"the whole lining sticks to the drum for {100 * sticking.share:.3g} % of the time"


def _settled(saturation: Saturation, stability: Stability) -> str:
    regime = saturation.regime
    if regime.kind == "steady" and saturation.main is not None:
        return "decays to steady sliding, below the edges and where every mode decays"
    what = _SETTLED[regime.kind]
    if regime.kind == "quasi-periodic":
        what += f" of {told_frequencies(regime.base_frequencies_Hz, regime.base_uncertainties_Hz, DIGITS)}"
    if saturation.main is None or saturation.frequency_shift is None:
        return what
    shift = saturation.frequency_shift
    side = "at" if abs(shift) < 5e-4 else f"{abs(shift):.1%} {'below' if shift < 0 else 'above'}"
    of = "the onset frequency of" if stability.unstable else "the frequency of mode"
    return (
        f"{what}, with most kinetic energy at {saturation.main.frequency_Hz:.0f} Hz, {side} {of} "
        f"{saturation.nearest_mode}, with {saturation.contact_fraction:.0%} of the lining in contact and the slip "
        f"reversed on {saturation.slip_reversed_fraction:.1%} of it on average"
    )
