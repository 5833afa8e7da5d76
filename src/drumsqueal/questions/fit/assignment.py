"""Which measured line is which mode."""

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.questions.fit.estimate import Estimate, Scale, estimate
from drumsqueal.questions.fit.record import RecordLine
from drumsqueal.scene import Scene
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.family import eigenvalue_gradient, state_matrix_of
from drumsqueal.solve.linear.modes import Mode, eigensystem
from drumsqueal.solve.linear.tracking import assurance, matched

# Eigenvalues as functions of some numbers of a scene, with their derivatives, mode by mode.


LEAST = 1e-12  # of the largest |λ|; below it an eigenvalue does not oscillate


class _Eigenlines(NamedTuple):
    """λ (modes,) in 1/s and ∂λ/∂p (modes, k); NaN where there is no steady sliding."""

    eigenvalues: NDArray[np.complex128]
    gradients: NDArray[np.complex128]


class Eigenmodes:
    """The oscillating modes of a scene as its numbers change: each is followed by its shape.

    The scene has no profiles (`at_one_time`). Raises SceneError where it has no steady sliding.
    """

    def __init__(self, scene: Scene, keys: Sequence[str]) -> None:
        """Name the scene and the numbers, by key, that change."""
        stability = prepare(scene).stability
        self.modes: tuple[Mode, ...] = stability.modes
        self._mass = stability.mass
        self._evaluate = state_matrix_of(scene, tuple(keys))

    @property
    def labels(self) -> tuple[str, ...]:
        """Of the modes, by rising frequency in the scene."""
        return tuple(mode.label for mode in self.modes)

    def at(self, numbers: NDArray[np.float64]) -> _Eigenlines:
        """Eigenvalues and derivatives at these numbers (k,), in SI, in the order of `labels`.

        Which eigenvalue is which mode is the assignment of eigenvectors to those of the scene with the largest sum of
        overlaps: modes that cross keep their names.
        """
        matrix, derivatives = self._evaluate(numbers)
        count = len(self.modes)
        if not (np.isfinite(matrix).all() and np.isfinite(derivatives).all()):
            return _Eigenlines(np.full(count, np.nan + 0j), np.full((count, numbers.size), np.nan + 0j))
        eigenvalues, right, left = eigensystem(matrix)
        n = self._mass.size
        overlap = np.array([assurance(self._mass, mode.right[:n], right[:n]) for mode in self.modes])
        overlap[:, eigenvalues.imag <= LEAST * np.abs(eigenvalues).max()] = -1.0
        chosen = [*matched(overlap).values()]
        gradients = [eigenvalue_gradient(left[:, k], right[:, k], derivatives) for k in chosen]
        return _Eigenlines(eigenvalues[chosen], np.array(gradients).reshape(count, numbers.size))


# A model of a brake has its frequencies to a percent or so and its growth rates to a third; a number is off by half.
MODEL_FREQUENCY, MODEL_RATE, LEAST_RATE, LIKELY = 0.01, 0.3, 10.0, 0.5
LOOSE = 0.2  # of log frequency, by which assignments are sorted before they are tried
TRIED = 12
# What it costs to leave the strongest line out; a weaker one less, by the fourth root of its amplitude.
MISSED, BY_AMPLITUDE = 25.0, 0.25
UNMOVED = 6.0  # what it costs to take a mode that nothing moves in the scene's own run
AMBIGUOUS = 4.0  # difference in cost below which another assignment fits as well


class Assignment(NamedTuple):
    """The place of each line's mode, or None, by line; its cost; and the next best one, where that is as likely."""

    modes: tuple[int | None, ...]
    cost: float
    rival: tuple[int | None, ...] | None = None


def assign(lines: Sequence[RecordLine], modes: Eigenmodes, scale: Scale, moved: Sequence[bool]) -> Assignment:
    """Assign lines to modes in order of frequency, no two to one mode; a line may be of none.

    The likeliest assignments are each fitted, with frequencies to 1 % and growth rates to 30 %, and the one is taken
    that needs the least misfit, change of the numbers and lines left out.
    """
    frequency = np.array([mode.frequency_Hz for mode in modes.modes])
    measured = np.array([line.frequency_Hz for line in lines])
    loudest = max(line.amplitude for line in lines)
    missed = [MISSED * (line.amplitude / loudest) ** BY_AMPLITUDE for line in lines]

    def at_first(choice: tuple[int | None, ...]) -> float:
        pairs = [(j, k) for j, k in enumerate(choice) if k is not None]
        apart = sum((np.log(measured[j] / frequency[k]) / LOOSE) ** 2 for j, k in pairs)
        return float(apart) + _left(choice, missed, moved)

    possible = sorted(_choices(measured, frequency), key=at_first)[:TRIED]
    costs = []
    for choice in possible:
        taken = [(line, k) for line, k in zip(lines, choice, strict=True) if k is not None]
        cost = _left(choice, missed, moved)
        if taken:
            loose = [_loose(line) for line, _ in taken]
            found = fit_lines(loose, [k for _, k in taken], modes, scale)
            cost += found.chi_square + float(np.sum((found.x / LIKELY) ** 2))
        costs.append(cost)
    order = np.argsort(costs, kind="stable")
    best = possible[order[0]]
    rivals = (possible[k] for k in order[1:] if costs[k] - costs[order[0]] < AMBIGUOUS)
    # One that merely leaves a line out is none.
    others = (each for each in rivals if any(a is not None and a != b for a, b in zip(each, best, strict=True)))
    return Assignment(best, float(costs[order[0]]), next(others, None))


def _left(choice: tuple[int | None, ...], missed: Sequence[float], moved: Sequence[bool]) -> float:
    out = sum(cost for cost, k in zip(missed, choice, strict=True) if k is None)
    return out + UNMOVED * sum(k is not None and not moved[k] for k in choice)


def _choices(lines: NDArray[np.float64], modes: NDArray[np.float64]) -> Iterator[tuple[int | None, ...]]:
    """Every assignment that keeps the order of frequencies and is not too far off."""
    order = np.argsort(lines, kind="stable").tolist()
    for count in range(min(lines.size, modes.size) + 1):
        for chosen in itertools.combinations(order, count):
            for places in itertools.combinations(range(modes.size), count):
                # 0.4 of log frequency, between a line and its mode in the scene
                if all(abs(np.log(lines[j] / modes[k])) <= 0.4 for j, k in zip(chosen, places, strict=True)):
                    taken = dict(zip(chosen, places, strict=True))
                    yield tuple(taken.get(j) for j in range(lines.size))


def _loose(line: RecordLine) -> RecordLine:
    rate, error = line.growth_rate_1_per_s, line.growth_rate_uncertainty_1_per_s
    f = float(np.hypot(line.frequency_uncertainty_Hz, MODEL_FREQUENCY * line.frequency_Hz))
    if rate is not None and error is not None:
        error = float(np.hypot(error, MODEL_RATE * abs(rate) + LEAST_RATE))
    return line.model_copy(update={"frequency_uncertainty_Hz": f, "growth_rate_uncertainty_1_per_s": error})


def fit_lines(lines: Sequence[RecordLine], places: Sequence[int], modes: Eigenmodes, scale: Scale) -> Estimate:
    """Fit numbers so that the eigenvalues at these places are those of the lines: Im λ/2π and, where known, Re λ."""
    frequency = np.array([line.frequency_Hz for line in lines])
    spread = np.array([line.frequency_uncertainty_Hz for line in lines])
    damped = [
        (j, line.growth_rate_1_per_s, line.growth_rate_uncertainty_1_per_s)
        for j, line in enumerate(lines)
        if line.growth_rate_1_per_s is not None and line.growth_rate_uncertainty_1_per_s is not None
    ]
    rated = [j for j, _, _ in damped]
    rate, rate_spread = np.array([rate for _, rate, _ in damped]), np.array([error for _, _, error in damped])
    chosen = np.array(places, dtype=np.intp)

    def residuals(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        found = modes.at(scale.numbers(x))
        values, slopes = found.eigenvalues[chosen], found.gradients[chosen] * scale.slopes(x)
        first = (values.imag / (2 * np.pi) - frequency) / spread, slopes.imag / (2 * np.pi) / spread[:, None]
        if not rated:
            return first
        second = (values.real[rated] - rate) / rate_spread, slopes.real[rated] / rate_spread[:, None]
        return np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1]])

    return estimate(residuals, scale)
