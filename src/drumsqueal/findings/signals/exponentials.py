"""Growing and decaying lines of a record: frequency, growth rate, amplitude, and how uncertain noise leaves them."""

import math
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.checks import finite_record, positive

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
        before = fit.copy()
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

    def copy(self) -> "_Fit":
        other = object.__new__(_Fit)
        other.__dict__.update(self.__dict__)
        return other

    def add(self, eigenvalue: complex) -> None:
        """Take a line in and refine all by the Levenberg–Marquardt method on the variable projection."""
        self.eigenvalues = np.array([*self.eigenvalues, eigenvalue], dtype=np.complex128)
        self._update()
        damping = 1e-3
        for _ in range(STEPS):
            jacobian = self._jacobian()
            normal, slope = jacobian.T @ jacobian, jacobian.T @ self.rest
            scale = np.diag(normal)
            before, size = self.copy(), float(self.rest @ self.rest)
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
