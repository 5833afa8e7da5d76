"""Growth rates: of an amplitude, of modes, of the lines of a record with noise, and of what lies next to a motion.

The straight line is not fitted by scipy.stats.linregress, whose standard error is round-off for a clean exponential.
"""

import math
from copy import copy
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.spectra import finite_record, increasing_times, positive


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


FLOOR_WIDTH = 200  # bins over which the noise about a line is the median
STEPS, TRIALS = 12, 8  # of the joint refinement, and of a step with more and more damping
CROWD, CLOSE = 3, 0.1  # so many lines, so close in frequency, stand for one whose growth is no exponential
LN2 = math.log(2)  # median of the squared amplitude of noise over its mean


class Exponentials(NamedTuple):
    """m lines a e^(λ t) of a record, strongest first: frequency (Hz) and growth rate (1/s) (m,) with standard errors.

    `amplitude` (m,) is the largest one of each within the record, in its unit. `rest` (time,) is what they leave.
    """

    frequency_Hz: NDArray[np.float64]
    frequency_error_Hz: NDArray[np.float64]
    rate_1_per_s: NDArray[np.float64]
    rate_error_1_per_s: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    rest: NDArray[np.float64]


def find_exponentials(signal: ArrayLike, sample_rate: float, *, lowest: float = 0.0, most: int = 8) -> Exponentials:
    """Find lines that grow or decay: x(t) = c + Σ_j Re(a_j e^(λ_j t)) + noise, λ = σ + 2πi f, f ≥ `lowest` (Hz).

    Line by line the one is added whose energy in the rest, |Σ r e^(λ̄ t)|² / Σ e^(2σt), is largest over frequencies and
    a row of rates σ, and all λ are refined together by least squares. It ends where noise would show as much with
    a probability of 1e-3, 50 dB below the strongest line, or where three lines lie within 10 %: they then stand for one
    that is no exponential (`is_crowded`). Standard errors are those of least squares with the noise
    that is left about each line, so that coloured noise and what the model lacks count where they matter.

    `signal` has shape (time,), in any unit. Raises ValueError for NaN and fewer than 16 samples.

    Source: G. H. Golub and V. Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares problems
    whose variables separate", SIAM Journal on Numerical Analysis 10, 1973; standard errors by the Jacobian, as in Y.
    Hua and T. K. Sarkar, IEEE Transactions on Acoustics, Speech and Signal Processing 38, 1990.
    """
    record, rate = finite_record("signal", signal), positive("sample_rate", sample_rate)
    time = np.arange(record.size) / rate
    fit = _Fit(record, time)
    strongest = 0.0
    while fit.eigenvalues.size < most and not is_crowded(fit.eigenvalues.imag):
        found = _strongest(fit.rest, rate, lowest)
        if found is None or found[1] < 1e-5 * strongest:  # of the strongest line's energy: 50 dB
            break
        before = copy(fit)
        fit.add(found[0])
        low = fit.eigenvalues.imag < 2 * np.pi * lowest
        if not fit.settled or np.any(low) or float(fit.rest @ fit.rest) >= float(before.rest @ before.rest):
            fit = before
            break
        strongest = max(strongest, found[1])
    return fit.lines(rate)


def is_crowded(frequency: NDArray[np.float64], crowd: int = CROWD) -> bool:
    """Whether so many frequencies, lie within 10 % of each other."""
    ordered = np.sort(frequency)
    return bool(np.any(ordered[crowd - 1 :] <= (1 + CLOSE) * ordered[: 1 - crowd]))


def _rates(samples: int, sample_rate: float) -> NDArray[np.float64]:
    """Growth rates (1/s) that are tried: from none to e-folds of twenty samples, both ways."""
    duration = samples / sample_rate
    sizes = [0.0]
    while (following := max(1.0, 2 * sizes[-1])) <= samples / 20:
        sizes.append(following)
    return np.array([*(-x for x in sizes[:0:-1]), *sizes]) / duration


def _strongest(rest: NDArray[np.float64], rate: float, lowest: float) -> tuple[complex, float] | None:
    """λ of the strongest line in a rest, and its energy; None where none stands out of the noise."""
    count = rest.size
    time = np.arange(count) / rate
    length = int(scipy.fft.next_fast_len(2 * count, real=True) or 0)  # padded
    frequency = np.arange(length // 2 + 1) * rate / length
    rates = _rates(count, rate)
    best: tuple[float, complex, float] | None = None
    least = -math.log(1e-3 / (frequency.size * rates.size))  # probability that white noise alone shows a line
    for sigma in rates:
        weight = np.exp(sigma * time - max(0.0, sigma * time[-1]))
        energy = float(weight @ weight)
        power = np.abs(np.asarray(scipy.fft.rfft(weight * rest, length))) ** 2 / energy
        width = max(1.0, abs(sigma) / (2 * np.pi))  # Hz; a line that is broader than its distance from zero is none
        open_bins = (frequency >= max(lowest, 2 * rate / count, width)) & (frequency <= 0.5 * rate - 2 * rate / count)
        if not np.any(open_bins):
            continue
        k = int(np.argmax(np.where(open_bins, power, 0.0)))
        around = power[max(0, k - FLOOR_WIDTH) : k + FLOOR_WIDTH + 1]
        if power[k] > least * np.median(around) / LN2 and (best is None or power[k] > best[0]):
            best = (power[k], complex(sigma, 2 * np.pi * frequency[k]), float(power[k]))
    return None if best is None else (best[1], best[2])


class _Fit:
    """λ (m,) of a record (time,), its linear part, and the rest."""

    def __init__(self, record: NDArray[np.float64], time: NDArray[np.float64]) -> None:
        self.record, self.time = record, time
        self.eigenvalues: NDArray[np.complex128] = np.zeros(0, dtype=np.complex128)
        self.settled = True
        self._update()

    def add(self, eigenvalue: complex) -> None:
        """Take a line in and refine all by the Levenberg–Marquardt method on the variable projection."""
        self.eigenvalues = np.array([*self.eigenvalues, eigenvalue], dtype=np.complex128)
        self._update()
        damping = 1e-3
        for _ in range(STEPS):
            jacobian = self._jacobian()
            normal, slope = jacobian.T @ jacobian, jacobian.T @ self.rest
            scale = np.diag(normal)
            before, size = copy(self), float(self.rest @ self.rest)
            for _ in range(TRIALS):
                step = np.linalg.solve(normal + damping * np.diag(scale), slope)
                self.eigenvalues = np.asarray(before.eigenvalues + step[::2] + 1j * step[1::2], dtype=np.complex128)
                self._update()
                if float(self.rest @ self.rest) <= size:
                    damping = max(damping / 100, 1e-12)
                    break
                damping *= 10
            else:
                self.__dict__.update(before.__dict__)
                return
            # 1e-8 shift, over the largest |λ|, that ends it
            if np.max(np.abs(self.eigenvalues - before.eigenvalues)) <= 1e-8 * np.max(np.abs(self.eigenvalues)):
                return
        self.settled = damping < 1.0

    def lines(self, rate: float) -> Exponentials:
        """The lines by their largest amplitude, with standard errors from the noise about each."""
        columns = self._waves.T
        pairs = self.factors[1:].reshape(-1, 2)
        amplitude = np.hypot(*pairs.T) if pairs.size else np.zeros(0)
        order = np.argsort(-amplitude, kind="stable")
        errors = np.zeros((self.eigenvalues.size, 2))
        if self.eigenvalues.size:
            basis = np.concatenate([columns, self._jacobian(projected=False)], axis=1)
            size = np.maximum(np.linalg.norm(basis, axis=0), np.finfo(np.float64).tiny)
            inverse = np.linalg.pinv((basis / size).T @ (basis / size), hermitian=True) / np.outer(size, size)
            covariance = inverse[columns.shape[1] :, columns.shape[1] :]
            noise = np.array([self._noise(value, rate) for value in self.eigenvalues])
            errors = np.sqrt(np.maximum(np.diag(covariance).reshape(-1, 2), 0.0) * noise[:, None])
        values: NDArray[np.complex128] = self.eigenvalues[order]
        spread = errors[order]
        return Exponentials(
            values.imag / (2 * np.pi),
            spread[:, 1] / (2 * np.pi),
            values.real,
            spread[:, 0],
            amplitude[order],
            self.rest,
        )

    def _noise(self, eigenvalue: complex, rate: float) -> float:
        """Variance a sample of white noise as strong as the rest is about a line."""
        count = self.rest.size
        spectrum = np.abs(np.asarray(scipy.fft.rfft(self.rest))) ** 2 / count
        place = eigenvalue.imag / (2 * np.pi) * count / rate
        # 6.0 bins about a line from which its own noise is taken, at least: there it pulls the line
        width = 6.0 + abs(eigenvalue.real) / (2 * np.pi) * count / rate
        near = spectrum[max(0, int(place - width)) : int(place + width) + 2]
        wide = spectrum[max(0, int(place - FLOOR_WIDTH)) : int(place + FLOOR_WIDTH) + 2]
        # The rest has lost what the lines took next to them: the noise further off is the least there is.
        return max(float(np.mean(near)), float(np.median(wide)) / LN2)

    def _update(self) -> None:
        """Waves, their factors and the rest for the present λ. Each wave is scaled to 1 where it is largest."""
        start = np.maximum(self.eigenvalues.real, 0.0) * self.time[-1]
        waves = np.exp(self.eigenvalues[:, None] * self.time - start[:, None])
        rows = [np.ones(self.time.size)]
        for wave in waves:
            rows += [wave.real, wave.imag]
        self._waves = np.array(rows)
        gram, right = self._waves @ self._waves.T, self._waves @ self.record
        self.factors = np.asarray(np.linalg.lstsq(gram, right, rcond=None)[0], dtype=np.float64)
        self.rest = self.record - self.factors @ self._waves

    def _jacobian(self, *, projected: bool = True) -> NDArray[np.float64]:
        """∂(model)/∂(σ, ω) (time, 2m); projected, less what the linear part can take of it (Kaufman)."""
        columns = []
        for k in range(self.eigenvalues.size):
            real, imaginary = self._waves[1 + 2 * k], self._waves[2 + 2 * k]
            cosine, sine = self.factors[1 + 2 * k], self.factors[2 + 2 * k]
            columns.append(self.time * (cosine * real + sine * imaginary))
            columns.append(self.time * (sine * real - cosine * imaginary))
        derivative = np.array(columns).T
        if not projected:
            return derivative
        gram = self._waves @ self._waves.T
        return derivative - self._waves.T @ np.linalg.lstsq(gram, self._waves @ derivative, rcond=None)[0]


SURE = 3.0  # standard errors


class Exponents(NamedTuple):
    """Lyapunov exponents (k,) and their standard errors in 1/s, largest first, and their means until each time (s).

    `running` (intervals, k) are the means from the end of the alignment until `time_s` (intervals,).
    """

    exponent_1_per_s: NDArray[np.float64]
    standard_error_1_per_s: NDArray[np.float64]
    time_s: NDArray[np.float64]
    running_1_per_s: NDArray[np.float64]

    @property
    def averaged_s(self) -> float:
        """The time (s) that the means are over."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def resolution_1_per_s(self) -> float:
        """What cannot be distinguished from zero: growth or decay by e^5 in the whole record.

        Tangents along the motion, and along a torus, neither grow nor shrink for ever but vary by some e-folds.
        """
        # What grows or decays by less than five e-folds in the whole record cannot be distinguished from zero.
        return 5.0 / self.averaged_s

    @property
    def uncertainty_1_per_s(self) -> NDArray[np.float64]:
        """What an exponent (k,) must exceed to have a known sign: three standard errors, and the resolution."""
        return np.maximum(SURE * self.standard_error_1_per_s, self.resolution_1_per_s)

    @property
    def significant(self) -> NDArray[np.bool_]:
        """Which exponents (k,) are above or below zero beyond their uncertainty."""
        return np.abs(self.exponent_1_per_s) > self.uncertainty_1_per_s

    @property
    def zero(self) -> NDArray[np.bool_]:
        """Which exponents (k,) are zero to the resolution; the sign of one that is neither is not known."""
        return np.abs(self.exponent_1_per_s) <= self.resolution_1_per_s

    @property
    def chaotic(self) -> bool:
        """Whether nearby motions separate exponentially: the largest exponent is significantly positive."""
        return bool(self.significant[0] and self.exponent_1_per_s[0] > 0)


def orthonormalised(tangents: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Make orthonormal what orthonormal tangents (n, k) have become, and return by how much they grew, as logs (k,).

    Source: G. Benettin, L. Galgani, A. Giorgilli and J.-M. Strelcyn, "Lyapunov characteristic exponents for smooth
    dynamical systems and for Hamiltonian systems", Meccanica 15, 1980.
    """
    turned, triangle = np.linalg.qr(np.asarray(tangents))
    return turned, np.log(np.maximum(np.abs(np.diag(triangle)), np.finfo(np.float64).tiny))


def lyapunov_exponents(growth: ArrayLike, interval: float) -> Exponents:
    """Return the exponents λ = ⟨growth⟩/interval from log growths (intervals, k) of tangents, one interval (s) each.

    The first tenth, in which tangents align, is left out. The standard error is that of the means of ten blocks. It
    knows nothing of what is slower than a block.

    Raises ValueError for fewer than 20 intervals and for NaN.
    """
    blocks = 10
    logs = finite_record("growth", growth, dimensions=2, minimum=2 * blocks)
    step = positive("interval", interval)
    # 0.1 first fraction of the record, in which tangents turn to where they grow
    kept = logs[round(0.1 * logs.shape[0]) :] / step
    means = np.array([block.mean(axis=0) for block in np.array_split(kept, blocks)])
    count = np.arange(1, kept.shape[0] + 1)
    first = logs.shape[0] - kept.shape[0]
    falling = np.argsort(-kept.mean(axis=0))  # nearly equal ones come in any order
    return Exponents(
        kept.mean(axis=0)[falling],
        (means.std(axis=0, ddof=1) / np.sqrt(blocks))[falling],
        (first + count) * step,
        (np.cumsum(kept, axis=0) / count[:, None])[:, falling],
    )
