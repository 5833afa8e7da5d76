"""Growth rates and modal amplitudes of a transient.

The straight line is not fitted by scipy.stats.linregress, whose standard error is round-off for a clean exponential.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.checks import finite_record, increasing_times


class Growth(NamedTuple):
    """An exponential fitted to an amplitude; `standard_error` is that of the rate, in 1/s."""

    rate_1_per_s: float
    standard_error: float
    amplitude_at_start: float


def fit_growth(time: ArrayLike, amplitude: ArrayLike) -> Growth:
    """Fit amplitude = a₀ e^(σ (t − t₀)) by least squares of log amplitude against time.

    `time` (samples,) in s, increasing, t₀ its first entry; `amplitude` (samples,) positive, in any unit. σ in 1/s.

    The samples of an amplitude are not independent, so the textbook standard error s/√Sxx is too small. It is
    multiplied by √((1 + r)/(1 − r)), with r the correlation of neighbouring residuals: n samples that each remember
    the one before are worth n (1 − r)/(1 + r) independent ones. r is corrected for its bias in a detrended short
    record, (n r + 2)/(n − 4), and held between 0 and the value at which one independent sample is left. A bend of
    the data (saturation, a second mode) counts as correlation, too, so that it widens the error rather than hiding
    in it; but the rate is then the mean slope. Two thirds of the rates then lie
    within one standard error where 13 independent samples or more are left; where there are 4 it is 15 % too small,
    and one rate in twenty is off by three of them.

    Raises ValueError for fewer than 6 samples, for NaN, for an amplitude that is not positive and for times out of
    order.

    Source: G. V. Bayley and J. M. Hammersley, "The 'effective' number of independent observations in an
    autocorrelated time series", Supplement to the Journal of the Royal Statistical Society 8, 1946; the bias, F. H.
    C. Marriott and J. A. Pope, "Bias in the estimation of autocorrelations", Biometrika 41, 1954, extended to a
    removed trend.
    """
    # A straight line and the correction for correlated residuals use four of them.
    fewest_for_growth = 6
    sizes = finite_record("amplitude", amplitude, minimum=fewest_for_growth)
    times = increasing_times("time", time, sizes.size, minimum=fewest_for_growth)
    if np.any(sizes <= 0.0):
        raise ValueError(f"amplitude must be positive everywhere, got {sizes.min():g} at index {int(sizes.argmin())}")
    centred, logarithm = times - times.mean(), np.log(sizes)
    spread = float(centred @ centred)
    rate = float(centred @ logarithm) / spread
    residual = logarithm - logarithm.mean() - rate * centred
    variance = float(residual @ residual) / (sizes.size - 2)
    error = math.sqrt(variance / spread * _correlation_factor(residual))
    start = math.exp(float(logarithm.mean()) + rate * float(centred[0]))
    return Growth(rate, error, start)


def modal_amplitudes(left_eigenvectors: ArrayLike, states: ArrayLike) -> NDArray[np.complex128]:
    """Return the complex amplitude ψ_kᴴ y(t) of each mode in a motion, shape (time, k).

    `left_eigenvectors` (2n, k), one column a mode; `states` (time, 2n), displacements and velocities as deviations
    from the state at which the modes were computed. With Aᴴψ_k = λ̄_k ψ_k the amplitude obeys ȧ = λ_k a while the
    motion is linear, and with ψ_kᴴφ_k = 1 it is the factor of the right eigenvector φ_k; the normalisation is the
    caller's.

    Raises ValueError when the shapes do not match or the states are not finite.
    """
    left = np.asarray(left_eigenvectors, dtype=np.complex128)
    motion = finite_record("states", states, dimensions=2, minimum=1)
    if left.ndim != 2 or left.shape[0] != motion.shape[1]:
        raise ValueError(
            f"left_eigenvectors must have shape (2n, k) with 2n = {motion.shape[1]} as in states, got {left.shape}"
        )
    if not np.all(np.isfinite(left)):
        raise ValueError("left_eigenvectors holds NaN or infinite values")
    return motion @ left.conj()


def modal_frequency(time: ArrayLike, modal_signal: ArrayLike) -> float:
    """Return the frequency of one complex modal amplitude in Hz: the slope of its unwrapped phase over 2π.

    `time` (samples,) in s, increasing; `modal_signal` (samples,) complex and nowhere zero. The slope is fitted by least
    squares, and is negative for an amplitude that turns clockwise. Neighbouring samples must lie less than half a turn
    apart: with a coarser sampling a fast rotation looks like a slower one.

    Raises ValueError for fewer than 2 samples, for NaN, for zeros and for times out of order.
    """
    signal = np.asarray(modal_signal, dtype=np.complex128)
    size = finite_record("modal_signal", np.abs(signal), minimum=2)
    times = increasing_times("time", time, size.size, minimum=2)
    if np.any(size == 0.0):
        raise ValueError(f"modal_signal is zero at index {int(size.argmin())}: it has no phase there")
    centred = times - times.mean()
    return float(centred @ np.unwrap(np.angle(signal)) / (centred @ centred)) / (2.0 * math.pi)


def _correlation_factor(residual: NDArray[np.float64]) -> float:
    """Return (1 + r)/(1 − r), from 1 (independent residuals) up to the number of samples (one independent one)."""
    n, power = residual.size, float(residual @ residual)
    if power == 0.0:
        return 1.0
    measured = float(residual[1:] @ residual[:-1]) / power
    correlation = min(max((n * measured + 2.0) / (n - 4.0), 0.0), (n - 1.0) / (n + 1.0))
    return (1.0 + correlation) / (1.0 - correlation)
