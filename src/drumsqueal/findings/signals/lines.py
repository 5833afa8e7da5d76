"""Spectral lines of a motion, refined far below the width of a bin, and the fundamental frequencies of them all."""

import itertools
import math
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.spectra import finite_record, hann, positive

# Half the width of the main lobe of the Hann window, in bins 1/T: lines closer than this are one to it.
MAIN_LOBE = 2.0
# A weak component next to a line stands this far from it at most (bins): there it could pull the line's frequency.
NEIGHBOURHOOD = 4.0
# Shift, in bins, of the maximum of a Hann-windowed line by a neighbour, over the ratio of their amplitudes where that
# is small: max |∫ w τ sin(uτ) dτ| / ∫ w τ² dτ / 2π over the neighbour's distance u, with ∫ w = 1; it is 0.58.
PULL = 0.6
PIECE = 2**13  # samples, of which all waves are in memory at a time
SWEEPS, SETTLED = 6, 1e-6  # over all lines, and the shift (bins) that ends them


class Lines(NamedTuple):
    """m lines of k signals, strongest first: frequency and its uncertainty (m,) in Hz, complex amplitudes (m, k).

    Line j of signal c is Re(amplitude_jc e^(2πi f_j t)) with t from the first sample. `fraction` (m,) is what each line
    holds of the variance of the signals scaled to unit rms, `left` what no line holds. Lines closer than
    `resolution_Hz` are not resolved.
    """

    frequency_Hz: NDArray[np.float64]
    uncertainty_Hz: NDArray[np.float64]
    amplitude: NDArray[np.complex128]
    fraction: NDArray[np.float64]
    left: float
    resolution_Hz: float


def find_lines(signals: ArrayLike, sample_rate: float, *, count: int = 40, floor: float = 1e-2) -> Lines:
    """Find the lines of signals (time, k), which share their frequencies: x_c(t) = m_c + Σ_j Re(a_jc e^(2πi f_j t)).

    Each signal is scaled to unit rms. Line by line the frequency is taken where the windowed Fourier sum of the rest,

        P(f) = Σ_c |Σ_t w(t) r_c(t) e^(−2πi f t)|²,   w the Hann window,

    is largest, refined by Newton's method, and all amplitudes are fitted anew by least squares with the weight w. Then
    every frequency is refined again together with all others until none moves. At most `count` lines are taken, down to
    `floor` times the strongest amplitude (0 < floor < 1), and none closer to another one, to zero or to half the sample
    rate (Hz) than the main lobe of the window, 2/T.

    The uncertainty of a frequency is 0.6/T times the residual next to the line (largest amplitude within four bins)
    over the line's own amplitude: how far a line hidden there would pull it. That is an estimate, to a factor of three
    for a neighbour a bin away; what is nearer than that is the same line.

    Raises ValueError for NaN, fewer than 16 samples, signals at rest, and for arguments of wrong sign.

    Source: J. Laskar, "The chaotic motion of the solar system: a numerical estimate of the size of the chaotic zones",
    Icarus 88, 1990, for frequencies refined one after the other; here of several signals, with least squares in place
    of orthogonalisation.
    """
    record = finite_record("signals", signals, dimensions=2)
    rate = positive("sample_rate", sample_rate)
    if count < 1:
        raise ValueError(f"count must be at least 1, got {count}")
    if not 0.0 < floor < 1.0:
        raise ValueError(f"floor must lie between 0 and 1, got {floor}")
    centred = record - record.mean(axis=0)
    size = np.sqrt(np.mean(centred**2, axis=0))
    if not np.all(size > 0.0):
        raise ValueError("signals must all move: one of them is constant")
    search = _Search(centred / size)
    search.find(count, floor)
    search.settle()
    return search.lines(rate, size)


def change_of_lines(signals: ArrayLike, sample_rate: float, frequencies: ArrayLike) -> NDArray[np.float64]:
    """By what lines (m,) at known frequencies (Hz) grow from the first half of signals (time, k) to the second.

    That is the ratio, less 1, of the amplitudes that are fitted to each half as in `find_lines`.
    """
    record = finite_record("signals", signals, dimensions=2)
    half = record.shape[0] // 2
    sizes = []
    for part in (record[:half], record[-half:]):
        search = _Search(part / np.sqrt(np.mean(record**2, axis=0)))
        search.frequency = np.asarray(frequencies, dtype=np.float64) * half / positive("sample_rate", sample_rate)
        search.fit_anew()
        sizes.append(search.sizes())
    return sizes[1] / sizes[0] - 1.0


class _Search:
    """Lines of a record (time, k) of unit rms; frequencies are in bins, times from −1/2 to 1/2 of the record.

    Waves are made a piece at a time: those of a line in a piece are those at its start, turned.
    """

    def __init__(self, record: NDArray[np.float64]) -> None:
        self.record, self.rest, self.samples = record, record, record.shape[0]
        self.window = hann(self.samples) / (self.samples / 2)
        self.length = int(scipy.fft.next_fast_len(2 * self.samples, real=True) or 0)  # padded
        self.bins = np.arange(self.length // 2 + 1) * (self.samples / self.length)
        self.frequency = np.zeros(0)
        self.waves = dict[float, NDArray[np.complex128]]()  # of each line, over as long as a piece
        self.factors = np.zeros((1, record.shape[1]))  # of a constant, then of cosine and sine of each line

    def find(self, count: int, floor: float) -> None:
        """Add lines one after the other, the strongest first."""
        highest = 0.5 * self.samples - MAIN_LOBE
        open_bins = (self.bins >= MAIN_LOBE) & (self.bins <= highest)
        self.fit_anew()
        while self.frequency.size < count:
            power = np.where(open_bins, self._power(), 0.0)
            best = int(np.argmax(power))
            if power[best] == 0.0:
                return
            own = self._refined(float(self.bins[best]))
            near = np.min(np.abs(self.frequency - own), initial=math.inf)
            if near < MAIN_LOBE or not MAIN_LOBE <= own <= highest:
                open_bins &= np.abs(self.bins - self.bins[best]) > 0.5  # the flank of a line that is there
                continue
            self.frequency = np.append(self.frequency, own)
            self._project(added=True)
            self._fit()
            size = self.sizes()
            if size[-1] < floor * size.max():
                kept = size >= floor * size.max()
                rows = np.concatenate([[True], np.repeat(kept, 2)])
                self.frequency, self.right = self.frequency[kept], self.right[rows]
                self.gram = self.gram[np.ix_(rows, rows)]
                self._fit()
                return
            open_bins &= np.abs(self.bins - own) >= MAIN_LOBE

    def settle(self) -> None:
        """Refine every frequency together with all others until none moves."""
        for _ in range(SWEEPS):
            moved = 0.0
            for j in range(self.frequency.size):
                factors = self.factors[1 + 2 * j : 3 + 2 * j]
                self._add_to_rest(self.frequency[j], factors)
                place = self._refined(float(self.frequency[j]))
                self._add_to_rest(place, -factors)
                moved = max(moved, abs(place - self.frequency[j]))
                self.frequency[j] = place
            self.fit_anew()
            if moved < SETTLED:
                return

    def lines(self, rate: float, size: NDArray[np.float64]) -> Lines:
        """The lines in units of the signals, whose rms was `size`, sampled at a rate (Hz)."""
        order = np.argsort(-self.sizes(), kind="stable")
        frequency, found = self.frequency[order], self.factors[1:].reshape(-1, 2, self.record.shape[1])[order]
        amplitude = found[:, 0] - 1j * found[:, 1]
        strength = np.sqrt(np.sum(np.abs(amplitude) ** 2, axis=1))
        around = 2.0 * np.sqrt(self._power())
        pulled = [around[np.abs(self.bins - f) <= NEIGHBOURHOOD].max() for f in frequency]
        # 1e-5 bins; what is left of the start, or of the integration, turns a phase as far as that
        uncertainty = np.maximum(PULL * np.array(pulled) / strength, 1e-5)
        # The window takes the rest as it takes the lines, whatever lies at the ends of the record.
        variance = sum(float(np.sum(self.window[rows] @ self.record[rows] ** 2)) for rows, _ in self._pieces())
        left = sum(float(np.sum(self.window[rows] @ self.rest[rows] ** 2)) for rows, _ in self._pieces())
        to_start = np.exp(-1j * np.pi * frequency)[:, None]  # phases as from the middle, until here
        bin_width = rate / self.samples
        return Lines(
            frequency * bin_width,
            uncertainty * bin_width,
            amplitude * to_start * size,
            0.5 * strength**2 / variance,
            left / variance,
            MAIN_LOBE * bin_width,
        )

    def _pieces(self) -> Iterator[tuple[slice, NDArray[np.float64]]]:
        """Rows of the record, and their times, piece by piece."""
        for first in range(0, self.samples, PIECE):
            rows = slice(first, min(first + PIECE, self.samples))
            yield rows, (np.arange(rows.start, rows.stop) - 0.5 * self.samples) / self.samples

    def _columns(self) -> Iterator[tuple[slice, NDArray[np.float64]]]:
        """A constant, then cosine and sine of each line (rows, 1 + 2 lines), piece by piece."""
        known, frequencies = self.waves, self.frequency.tolist()
        since = 2j * np.pi * np.arange(min(PIECE, self.samples)) / self.samples
        self.waves = {f: known[f] if f in known else np.exp(f * since) for f in frequencies}
        for rows, time in self._pieces():
            columns = np.ones((1 + 2 * len(frequencies), time.size))
            for f, pair in zip(frequencies, columns[1:].reshape(-1, 2, time.size), strict=True):
                wave = self.waves[f][: time.size] * np.exp(2j * np.pi * f * time[0])
                pair[:] = wave.real, wave.imag
            yield rows, columns.T

    def _power(self) -> NDArray[np.float64]:
        """P at every bin, of the rest."""
        power = np.zeros(self.bins.size)
        for column in self.rest.T:
            transform = np.asarray(scipy.fft.rfft(self.window * column, self.length))
            power += np.abs(transform) ** 2
        return power

    def _refined(self, start: float) -> float:
        """Where P of the rest has its maximum, near a frequency."""
        place = start
        for _ in range(4):  # steps of Newton
            moments = np.zeros((3, self.rest.shape[1]), dtype=np.complex128)
            for rows, time in self._pieces():
                turn = 2.0 * np.pi * time
                wave = np.exp(-1j * turn * place)
                moments += np.stack([wave, turn * wave, turn**2 * wave]) @ (self.window[rows, None] * self.rest[rows])
            value, first, second = moments[0], -1j * moments[1], -moments[2]
            slope = 2.0 * float(np.sum(first * value.conj()).real)
            bend = 2.0 * float(np.sum(second * value.conj()).real + np.sum(np.abs(first) ** 2))
            step = -slope / bend if bend < 0.0 else math.copysign(0.25, slope)
            step = max(-0.5, min(0.5, step))
            place += step
            if abs(step) < SETTLED:
                break
        return place

    def _add_to_rest(self, frequency: float, factors: NDArray[np.float64]) -> None:
        """Add cosine and sine of a frequency, with factors (2, k), to the rest."""
        for rows, time in self._pieces():
            angle = 2.0 * np.pi * frequency * time
            self.rest[rows] += np.stack([np.cos(angle), np.sin(angle)], axis=1) @ factors

    def _project(self, *, added: bool = False) -> None:
        """Weighted products of the columns with one another and with the record; where a line was added, its own."""
        count = 1 + 2 * self.frequency.size
        new = slice(count - 2 if added else 0, count)
        products, right = np.zeros((count, count - new.start)), np.zeros((count - new.start, self.record.shape[1]))
        for rows, columns in self._columns():
            weighted = self.window[rows, None] * columns[:, new]
            products += columns.T @ weighted
            right += weighted.T @ self.record[rows]
        if added:
            self.gram = np.block([[self.gram, products[:-2]], [products[:-2].T, products[-2:]]])
            self.right = np.concatenate([self.right, right])
        else:
            self.gram, self.right = products, right

    def fit_anew(self) -> None:
        """Fit the amplitudes of all lines."""
        self._project()
        self._fit()

    def _fit(self) -> None:
        self.factors = np.asarray(np.linalg.lstsq(self.gram, self.right, rcond=None)[0], dtype=np.float64)
        rest = np.empty_like(self.record) if self.rest is self.record else self.rest
        for rows, columns in self._columns():
            rest[rows] = self.record[rows] - columns @ self.factors
        self.rest = rest

    def sizes(self) -> NDArray[np.float64]:
        """The amplitude of each line over all signals (m,)."""
        return np.sqrt(np.sum(self.factors[1:].reshape(-1, 2 * self.record.shape[1]) ** 2, axis=1))


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
        matched = np.any(self.combinations != 0, axis=1)
        alone = [float(lines.fraction[(own == 0) & matched].sum()) for own in self.combinations.T]
        k = int(np.argmax(alone))
        if alone[k] < enough:
            return self
        kept = np.where((self.combinations[:, [k]] == 0), self.combinations, 0)
        frequencies, uncertainties = np.delete(self.frequency_Hz, k), np.delete(self.uncertainty_Hz, k)
        return Fundamentals(frequencies, uncertainties, np.delete(kept, k, axis=1), alone[k])


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
