"""Lines of two records paired one to one; none is forced into a pair."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

WIDEST = 0.05  # relative: what lies further apart is not the same line
# Levels that differ by so much part two lines as much as frequencies that differ by WIDEST do: a strong line is rather
# the strong one next to it than a faint one nearer by, unless the levels are those of quite another point.
APART_DB = 40.0


@dataclass(frozen=True)
class Match:
    """The reference that a line goes with (an index), measured over reference less 1, and whether they are a pair.

    Where they are none it is the reference nearest in frequency.
    """

    reference: int
    difference: float
    paired: bool


def match_lines(
    lines: ArrayLike,
    references: ArrayLike,
    *,
    widest: float = WIDEST,
    levels: tuple[ArrayLike, ArrayLike] | None = None,
) -> list[Match | None]:
    """Pair lines (Hz), the strongest first, with reference frequencies (Hz); None for each where there is no reference.

    Each line in turn takes, among the references that are left within `widest` of their frequency, the one with the
    smallest

        |f/f_r − 1| / WIDEST + |L − L_r| / APART_DB,

    the second term only where `levels` (dB) of lines and references are given.
    """
    found, known = np.asarray(lines, dtype=np.float64), np.asarray(references, dtype=np.float64)
    if not known.size:
        return [None] * found.size
    own, theirs = (np.asarray(level, dtype=np.float64) for level in levels or (found * 0, known * 0))
    free = np.ones(known.size, dtype=bool)
    matches: list[Match | None] = []
    for line, level in zip(found, own, strict=True):
        difference = line / known - 1
        open_to = free & (np.abs(difference) <= widest)
        cost = np.abs(difference) / WIDEST + np.abs(level - theirs) / APART_DB
        best = int(np.argmin(np.where(open_to, cost, np.inf)) if open_to.any() else np.argmin(np.abs(difference)))
        free[best] &= not open_to[best]
        matches.append(Match(best, float(difference[best]), bool(open_to[best])))
    return matches


def fraction_covered(references: ArrayLike, lowest: float, highest: float, *, widest: float = WIDEST) -> float:
    """The fraction of the frequencies from lowest to highest (Hz) that lie within `widest` of a reference.

    It is the probability that a line which has nothing to do with the references finds one all the same.
    """
    covered, reached = 0.0, lowest
    for reference in np.sort(np.asarray(references, dtype=np.float64)):
        begin, end = max(reached, reference * (1 - widest)), min(highest, reference * (1 + widest))
        if end > begin:
            covered, reached = covered + end - begin, end
    return covered / (highest - lowest) if highest > lowest else 0.0
