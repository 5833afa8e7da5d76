"""What a run found, in one paragraph: the prediction, and what the transient did with it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from drumsqueal.errors import Ending
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.ramp import predicted_squeal, ramp_sentences
from drumsqueal.findings.signals.regime import Cause, rest_words, written_frequencies
from drumsqueal.scene.quantities import percent
from drumsqueal.solve.linear.modes import NEUTRAL_FRACTION, divergence_words

if TYPE_CHECKING:
    from drumsqueal.findings.compare import RunFindings
    from drumsqueal.findings.saturation import Saturation

SHIFT = 1e-3  # of a frequency: less needs no explanation


def state_verdict(found: RunFindings) -> str:
    """Return prediction and transient in one paragraph."""
    rate = found.prediction.divergence
    grows = [f"squeal in {', '.join(found.prediction.unstable)}"] if found.prediction.unstable else []
    grows += [] if rate is None else [divergence_words(rate)]
    predicted = " and ".join(grows) if found.prediction.unstable else " but ".join(["no squeal", *grows])
    time = f" at t = {found.predicted_at_s:g} s" if found.changing else ""
    if found.ramp is not None and found.ramp.lines and rate is None:
        predicted, time = predicted_squeal(found.ramp), ""
    sentences = [f"The linear model predicts {predicted}{time}; {_transient(found)}."]
    return " ".join([*sentences, *(ramp_sentences(found.ramp, found.scene) if found.ramp else ()), *_remarks(found)])


def state_headline(found: RunFindings) -> str | None:
    """Return the finding in a sentence or two; None where there is no frequency to report."""
    saturation, unstable = found.saturation, bool(found.prediction.unstable)
    if found.sticking is not None and found.sticks_at_the_end:
        before = "The brake squeals until, from" if found.edge_reached_s and unstable else "From"
        return f"{before} {found.sticking.to_the_end_from_s:.4g} s on, the whole lining sticks to the drum."
    if saturation is None or saturation.main is None or saturation.regime.kind is Kind.STEADY:
        return None
    verb = "vibrates, not yet settled," if saturation.regime.kind is Kind.UNDECIDED else "squeals"
    text = f"The brake {'vibrates' if found.forced else verb} at {hertz(saturation.main.frequency_Hz)}"
    shift, mode, frequency = saturation.frequency_shift, saturation.nearest_mode, found.frequency
    if shift is not None:
        of = f"the onset predicted for {mode}" if unstable else f"the predicted frequency of mode {mode}"
        text += f", {shift_words(shift)} {of} ({hertz(saturation.main.frequency_Hz / (1 + shift))})"
    if frequency is None or abs(frequency.shift) < SHIFT:
        return f"{text}."
    alone = frequency.predicted_by_contact_loss_shift
    # 0.3 relative; a shift that loss of contact alone would give to within this is called consistent with it
    if alone > 0 or abs(alone / frequency.shift - 1) > 0.3:
        return f"{text}."
    return (
        f"{text}. That is consistent with the loss of contact: on average {percent(saturation.contact_fraction)} of "
        "the lining touches the drum, and the reduced mean contact stiffness alone would "
        f"lower mode {frequency.mode} to {hertz(frequency.predicted_by_contact_loss_Hz)}."
    )


def hertz(frequency: float) -> str:
    """A frequency in three digits."""
    return f"{frequency / 1e3:.3g} kHz" if frequency >= 999.5 else f"{frequency:.3g} Hz"


def difference_is_no_error(found: RunFindings) -> str:
    """Why a prediction for one time and a mean over many are not compared."""
    predicted = f"Drum speed, load or force change: the prediction is for t = {found.predicted_at_s:g} s"
    until = found.growth.linear_until_s
    if not until > 0:
        return f"{predicted}; the motion is nonlinear from the start, and no mean is measured"
    return f"{predicted}, the mean is that from 0 to {until:.4g} s, so that their difference is no error"


def shift_words(shift: float) -> str:
    """Where a frequency lies that differs by this fraction: "at", "24.5 % below" or "3.0 % above" the other one."""
    # 5e-4 of a frequency: less is no difference in four digits
    return "at" if abs(shift) < 5e-4 else f"{100 * abs(shift):.1f} % {'below' if shift < 0 else 'above'}"


def rate_text(rate: float, frequency: float) -> str:
    """A growth rate (1/s) in four digits with its sign; 0 where it is round-off compared with the frequency (Hz)."""
    return "0" if abs(rate) < NEUTRAL_FRACTION * frequency else f"{rate:+#.4g}".removesuffix(".").replace("-", "−")


def _transient(found: RunFindings) -> str:
    if found.sticking is None:
        return f"nothing was computed beyond the prediction ({found.outcome})"
    boundary, saturation, moved_by = found.edge_reached_s, found.saturation, found.moved_by
    if boundary is None and found.forced:
        done = f"under the harmonic force the transient reaches no contact boundary in {found.recorded_s:g} s"
    elif boundary is None:
        done = _within_the_boundaries(found)
    elif saturation is None:
        done = f"the motion reaches a contact boundary at {boundary:.4g} s, too late to show what it settles to"
    elif found.ramp is not None and found.ramp.squeals and not found.sticks_at_the_end:
        done = f"the transient reaches a contact boundary at {boundary:.4g} s"
    else:
        settled = "comes to stick" if found.sticks_at_the_end else _settled(saturation, bool(found.prediction.unstable))
        done = f"the transient reaches a contact boundary at {boundary:.4g} s and {settled}"
    if found.motion_ratio is None and boundary is not None and not found.forced:
        done = f"nothing was started, but {f'the {moved_by} moves the shoe' if moved_by else 'round-off grows'}: {done}"
    sticking = found.sticking
    if sticking.to_the_end_from_s is not None:
        done += f"; from {sticking.to_the_end_from_s:.4g} s on the whole lining sticks to the drum"
    elif sticking.spells:
        how_long = "for an instant" if sticking.share == 0 else f"for {percent(sticking.share)} of the time"
        done += f"; the whole lining sticks to the drum {how_long}"
    if found.largest_rotation_rad > Criteria.small_rotation:
        angle = f"{found.largest_rotation_rad:.2g} rad"
        done += f"; the shoe turns by {angle}, where small rotations, and so the model, no longer hold"
    if found.ending is not Ending.COMPLETE:
        done += f" (the run {'was ' if found.ending is Ending.INTERRUPTED else ''}{found.outcome})"
    return done


def _remarks(found: RunFindings) -> Iterator[str]:
    """What explains the frequency, what warmth does to friction, and forces less accurate than the motion."""
    frequency, warm = found.frequency, found.lining_temperature
    if frequency is not None and abs(frequency.shift) >= SHIFT:
        shift = frequency.predicted_by_contact_loss_shift
        yield (
            f"{'Reduced mean' if shift < 0 else 'Mean'} contact stiffness alone would "
            f"{'lower' if shift < 0 else 'raise'} mode {frequency.mode} to "
            f"{frequency.predicted_by_contact_loss_Hz:.0f} Hz, {shift_words(shift)} its onset frequency."
        )
    if warm is not None:
        yield (
            f"The lining warms up by {warm.end_K:.3g} K by the end, by which friction loses "
            f"{percent(1 - warm.friction_left)}; the linear model is that of the cold lining."
        )
    error = None if found.accuracy is None else found.accuracy.quadrature_error_over_normal_force
    tolerance = found.scene.simulate.tolerance
    if error is not None and error > tolerance:
        digit = 10.0 ** (math.floor(math.log10(error)) - 1)
        yield (
            f"Warning: the contact forces are wrong by up to {digit * math.ceil(error / digit):.2g} of the largest "
            f"normal force, more than the tolerance of {tolerance:.2g}: the motion or the friction law varies too fast "
            "for the quadrature over the lining, and the motion is no more accurate than its forces."
        )


def _within_the_boundaries(found: RunFindings) -> str:
    ratio, duration, moved_by = found.motion_ratio, found.recorded_s, found.moved_by
    if ratio is None and moved_by:
        return (
            f"nothing was started, but the {moved_by} moves the shoe: the transient reaches no contact boundary in "
            f"{duration:g} s"
        )
    if ratio is None:
        return "nothing was started, and the transient reaches no contact boundary"
    if ratio > 1.1:  # times the start: what the motion must reach by the end to have grown
        return (
            f"the motion grows {ratio:.3g} times but reaches no contact boundary in {duration:g} s, too short to "
            "show more"
        )
    growing = [mode.predicted_growth_rate_1_per_s for mode in found.modes if mode.unstable and mode.excited]
    divergence = found.prediction.divergence
    if not found.prediction.unstable and divergence is None:
        return f"the transient agrees: nothing grows within {duration:g} s"
    if found.prediction.unstable and not growing:
        return f"the start excites none of the unstable modes, and the transient does not grow within {duration:g} s"
    rate = max([*growing, divergence or 0.0])
    # 10 times: a predicted growth that shows even of a mode that starts as a tenth of the motion
    if rate * duration < math.log(10):
        reach = math.exp(rate * duration)
        return f"{duration:g} s are too short to compare: the fastest growth would be by a factor of {reach:.4g}"
    return f"the transient does not grow within {duration:g} s"


def _settled(saturation: Saturation, unstable: bool) -> str:
    regime, main, shift = saturation.regime, saturation.main, saturation.frequency_shift
    if regime.cause is Cause.RESTS_ELSEWHERE:
        return f"comes to rest in another equilibrium, {rest_words(regime.numbers)}"
    if regime.kind is Kind.STEADY and main is not None:
        return "decays to steady sliding, within the contact boundaries and where every mode decays"
    what = {
        Kind.STEADY: "settles to steady sliding",
        Kind.PERIODIC: "settles to a periodic motion",
        Kind.QUASI_PERIODIC: "settles to a motion",
        Kind.IRREGULAR: "settles to an irregular motion",
        Kind.UNDECIDED: "has not settled by the end of the record",
    }[regime.kind]
    if regime.kind is Kind.QUASI_PERIODIC:
        # No record tells a torus from a cycle whose frequencies lock at a ratio of large numbers.
        fundamentals = written_frequencies(regime.base_frequencies_Hz, regime.base_uncertainties_Hz, most=4)
        what += f" of {fundamentals}, quasi-periodic or locked to repeat after many periods"
    if main is None or shift is None:
        return what
    of = "the onset frequency of" if unstable else "the frequency of mode"
    where = f"{main.frequency_Hz:.0f} Hz, {shift_words(shift)} {of} {saturation.nearest_mode}"
    touches, slips_back = percent(saturation.contact_fraction), percent(saturation.slip_reversed_fraction)
    return (
        f"{what}. Most kinetic energy is at {where}; on average {touches} of the lining is in contact, and the slip is "
        f"reversed on {slips_back} of it"
    )
