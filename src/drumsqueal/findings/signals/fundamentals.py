"""Fundamental frequencies of a motion: the fewest of which all its lines are integer combinations."""

import itertools
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.signals.lines import Lines

MOST_FUNDAMENTALS, FEWEST_OF_A_TORUS = 3, 2
# Combinations up to some order lie so dense that a line is near one of them by chance. Where that is likelier than
# this, the line's frequency is not known well enough to say so.
CHANCE = 0.02
# A fundamental closer to a stronger line than this fraction of itself is replaced by its distance from it, a slow
# modulation.
MODULATION = 0.1


class Fundamentals(NamedTuple):
    """Fundamental frequencies (d,) with uncertainty in Hz, by rising frequency, and what of the motion they explain.

    `combinations` (m, d) are the integers k of each of the m lines, f = Σ k_i base_i; zeros where a line is none of
    them. `explained` is the fraction of the variance in lines that are.
    """

    frequency_Hz: NDArray[np.float64]
    uncertainty_Hz: NDArray[np.float64]
    combinations: NDArray[np.int64]
    explained: float

    def fewest(self, lines: Lines, enough: float) -> "Fundamentals":
        """Those two of three that explain so much of the variance by themselves; all of them where none do."""
        if len(self.frequency_Hz) <= FEWEST_OF_A_TORUS:
            return self
        alone = [float(lines.fraction[(own == 0) & self._matched].sum()) for own in self.combinations.T]
        k = int(np.argmax(alone))
        if alone[k] < enough:
            return self
        kept = np.where((self.combinations[:, [k]] == 0), self.combinations, 0)
        frequencies, uncertainties = np.delete(self.frequency_Hz, k), np.delete(self.uncertainty_Hz, k)
        return Fundamentals(frequencies, uncertainties, np.delete(kept, k, axis=1), alone[k])

    @property
    def _matched(self) -> NDArray[np.bool_]:
        return np.any(self.combinations != 0, axis=1)


def find_fundamentals(lines: Lines) -> Fundamentals:
    """Find the fewest fundamental frequencies of which the lines are integer combinations, at most three.

    The lines are taken one after the other, the strongest first. One at f_j is Σ_i k_ji b_i of the fundamentals there
    are so far when it lies within their joint uncertainty, for the k of lowest order Σ|k|. One that is nowhere near any
    combination is another fundamental, or its distance from a stronger line is, where that is less than a tenth of f_j.
    A line whose uncertainty lets it be near some combination by chance, with N combinations of that order or less below
    the highest line F with a probability of 2 N u/F above 2 %, is neither: it stays unexplained. Fundamentals that are
    locked, Σ k_i b_i = 0 within their uncertainty and beyond chance, are rewritten as one fundamental fewer.
    Fundamentals are reported as the strongest lines that generate all, and fitted to all lines that they explain,
    weighted by their uncertainties.

    No fundamental below the lines' resolution is reported, and none where the lines need more than three.

    Source: the strongest independent lines as fundamentals, J. Laskar, "Introduction to frequency map analysis", in
    Hamiltonian Systems with Three or More Degrees of Freedom, NATO ASI Series C 533, 1999.
    """
    lattice = _Lattice(lines)
    for j in range(lines.frequency_Hz.size):
        lattice.take(j)
    return lattice.fitted()


def multiples_of(lines: Lines, frequency: float) -> Fundamentals:
    """The lines as multiples of the one frequency (Hz) with which a motion was found to repeat, fitted to them.

    A line is one where it lies so near to a multiple as 2 % of all frequencies do.
    """
    order = np.rint(lines.frequency_Hz / frequency)
    order[np.abs(lines.frequency_Hz - order * frequency) > CHANCE / 2 * frequency] = 0
    weight = order / lines.uncertainty_Hz**2
    fitted, spread = weight @ lines.frequency_Hz / (weight @ order), 1 / np.sqrt(weight @ order)
    explained = float(lines.fraction[order > 0].sum())
    return Fundamentals(np.array([fitted]), np.array([spread]), order.astype(np.int64)[:, None], explained)


class _Lattice:
    """What some fundamentals generate, and which of the lines are in it."""

    def __init__(self, lines: Lines) -> None:
        self.lines = lines
        self.combinations = np.zeros((lines.frequency_Hz.size, 0), dtype=np.int64)

    @property
    def matched(self) -> NDArray[np.bool_]:
        """Which lines are combinations (m,)."""
        return np.any(self.combinations != 0, axis=1)

    @property
    def count(self) -> int:
        """How many fundamentals there are."""
        return self.combinations.shape[1]

    def take(self, j: int) -> None:
        """Find the next line among the combinations, or make another fundamental of it."""
        near, clear = self._nearest(j)
        if near is not None:
            if clear:
                self.combinations[j] = near
            return
        before = self.combinations
        self.combinations = np.hstack([before, np.zeros((before.shape[0], 1), dtype=np.int64)])
        self.combinations[j, -1] = 1
        # As a distance from a stronger line that is a combination, which changes nothing of what is generated.
        stronger = np.flatnonzero(self.matched[:j])
        gaps = np.abs(self.lines.frequency_Hz[stronger] - self.lines.frequency_Hz[j])
        if gaps.size and gaps.min() < MODULATION * self.lines.frequency_Hz[j]:
            neighbour = stronger[np.argmin(gaps)]
            self.combinations[j] += self.combinations[neighbour]
        self._unlock()
        if self.count > MOST_FUNDAMENTALS:
            self.combinations = before

    def fitted(self) -> Fundamentals:
        """The strongest lines, or distances from them, that generate all lines; fitted, positive, rising."""
        if self.count == 0:
            return Fundamentals(np.zeros(0), np.zeros(0), self.combinations, 0.0)
        self._rewrite()
        values, spread = self._fit()
        combinations = self.combinations * np.where(values < 0.0, -1, 1)
        rising = np.argsort(np.abs(values))
        explained = float(self.lines.fraction[self.matched].sum())
        return Fundamentals(np.abs(values)[rising], spread[rising], combinations[:, rising], explained)

    def _fit(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Fundamentals and their uncertainty by least squares from the lines that they explain."""
        weight = 1.0 / self.lines.uncertainty_Hz[self.matched]
        matrix = self.combinations[self.matched] * weight[:, None]
        right = self.lines.frequency_Hz[self.matched] * weight
        fundamentals = np.linalg.lstsq(matrix, right, rcond=None)[0]
        scatter = float(np.sum((matrix @ fundamentals - right) ** 2)) / max(1, right.size - fundamentals.size)
        covariance = np.linalg.inv(matrix.T @ matrix)
        return fundamentals.astype(np.float64), np.sqrt(max(1.0, scatter) * np.diag(covariance))

    def _nearest(self, j: int) -> tuple[NDArray[np.int64] | None, bool]:
        """The combination of lowest order within reach of a line, None without one; and whether it is beyond chance."""
        if self.count == 0:
            return None, True
        values, spread = self._fit()
        # Highest order |k1| + |k2| + … of a combination that a line may be, by how many fundamentals there are.
        grid, order = _vectors(self.count, {1: 2000, 2: 40, 3: 20}[self.count])
        frequency = grid @ values
        tolerance = np.sqrt(self.lines.uncertainty_Hz[j] ** 2 + grid**2 @ spread**2)
        near = np.flatnonzero(np.abs(np.abs(frequency) - self.lines.frequency_Hz[j]) <= tolerance)
        if near.size == 0:
            return None, True
        highest = float(self.lines.frequency_Hz.max())
        dense = np.count_nonzero((order <= order[near[0]]) & (np.abs(frequency) <= highest))
        clear = 2.0 * tolerance[near[0]] * dense / highest <= CHANCE
        return grid[near[0]] * (-1 if frequency[near[0]] < 0.0 else 1), clear

    def _unlock(self) -> None:
        """Rewrite fundamentals between which there is an integer relation as one fundamental fewer."""
        if self.count < 2:
            return
        values, spread = self._fit()
        # The highest order of a relation Σ k_i b_i = 0 that locks fundamentals to one another: 3 f1 = 2 f2 leaves one.
        grid, order = _vectors(self.count, {2: 200, 3: 40, 4: 12}[self.count])
        tolerance = np.sqrt(grid**2 @ spread**2)
        # Combinations up to an order spread over some range on either side of zero.
        likely = 2.0 * tolerance * np.arange(1, order.size + 1) / (order * np.abs(values).max())
        zero = np.flatnonzero((np.abs(grid @ values) <= tolerance) & (likely <= CHANCE))
        if zero.size:
            self.combinations = self.combinations @ _kernel(grid[zero[0]])
            self._rewrite()
            self._unlock()

    def _rewrite(self) -> None:
        """Take the strongest lines as fundamentals where they generate all: the determinant of their integers is ±1."""
        lines = np.flatnonzero(self.matched)
        vectors = self.combinations[lines]
        sets = np.array(list(itertools.combinations(range(lines.size), self.count)))
        generating = sets[np.abs(np.round(np.linalg.det(vectors[sets]))) == 1]
        if generating.size == 0:
            return
        matrix = vectors[generating[0]]
        for place, line in enumerate(generating[0].tolist()):
            frequency = self.lines.frequency_Hz[lines]
            gaps = np.abs(frequency[:line] - frequency[line])
            if gaps.size and gaps.min() < MODULATION * frequency[line]:
                modulated = matrix.copy()
                modulated[place] -= vectors[int(np.argmin(gaps))]
                matrix = modulated if abs(round(np.linalg.det(modulated))) == 1 else matrix
        self.combinations = np.round(self.combinations @ np.linalg.inv(matrix)).astype(np.int64)


@cache
def _vectors(count: int, most: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All integer vectors up to an order, one of each pair ±k, by rising order; and the orders."""
    grid = np.stack(np.meshgrid(*[np.arange(-most, most + 1)] * count, indexing="ij"), axis=-1).reshape(-1, count)
    order = np.abs(grid).sum(axis=1)
    leading = grid[np.arange(len(grid)), np.argmax(grid != 0, axis=1)] > 0
    kept = (order > 0) & (order <= most) & leading
    by_order = np.argsort(order[kept], kind="stable")
    return grid[kept][by_order], order[kept][by_order]


def _kernel(relation: NDArray[np.int64]) -> NDArray[np.int64]:
    """Integer vectors (d, d − 1) that span all x with relation · x = 0, by Euclid's algorithm on columns.

    Where relation · b = 0 the fundamentals are b = kernel · b', and the b' generate what the b do.
    """
    left, unimodular = relation.copy(), np.eye(relation.size, dtype=np.int64)
    while np.count_nonzero(left) > 1:
        others = np.flatnonzero(left)
        pivot = others[np.argmin(np.abs(left[others]))]
        for i in others[others != pivot]:
            times = left[i] // left[pivot]
            left[i] -= times * left[pivot]
            unimodular[:, i] -= times * unimodular[:, pivot]
    return np.delete(unimodular, np.flatnonzero(left)[0], axis=1)
