"""Brakes that change more and more along a line: from where on they are quiet, by transients from disturbances.

All lines are searched together. On each, positions are tried further and further out until one is quiet; then the gap
between it and the last that squeals is halved. What squeals at a position goes on, as a disturbance, at the next ones.
Quiet in between two that squeal is no answer: a brake must also stay quiet a little further out.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from drumsqueal.progress import Progress
from drumsqueal.questions.sensitivity.disturbing import BrakeVariant, Disturber, Judged, Trial

PRECISION = 0.04  # of a position: how far the first quiet one and the last that squeals may be apart

FURTHER = (1.1, 1.25)  # times a position: brakes that must be quiet, too, as far as the bounds allow

Numbers = Mapping[str, float]


class LineSearch:
    """Positions tried along a line, and what is known of them.

    The numbers of a brake are a function of its position, None where there is no brake; `ladder` has the positions to
    try, outwards, until one is quiet. Up to `squeals_at` none is, and `carried` is the squeal of the brake at position
    zero. What is quiet is tried from every disturbance unless it is not to be proven.
    """

    def __init__(
        self,
        numbers_at: Callable[[float], Numbers | None],
        ladder: Iterable[float],
        squeals_at: float,
        carried: Sequence[Trial] = (),
        *,
        farthest: float = math.inf,
        proven: bool = True,
    ) -> None:
        """Begin with nothing tried; `farthest` is the last position within the bounds."""
        self._farthest = farthest
        self.numbers_at, self._ladder = numbers_at, iter(ladder)
        self.squeals_at, self.quiet_at = squeals_at, None
        self._carried, self._last, self._confirmed, self._proven = tuple(carried), (), False, proven
        self._further = self._next_further()

    def _next_further(self) -> float | None:
        return next((each for each in self._ladder if each > self.squeals_at), None)

    @property
    def position(self) -> float | None:
        """What is to be tried next; None where the search is at its end."""
        if self.quiet_at is None:
            return self._further
        if self.quiet_at - self.squeals_at > PRECISION * self.quiet_at:
            return (self.squeals_at + self.quiet_at) / 2
        return None if self._confirmed or not self._proven else self.quiet_at

    @property
    def confirms(self) -> bool:
        """Whether what is tried next has been quiet already and is to be tried from every disturbance."""
        return self.quiet_at is not None and self.position == self.quiet_at

    @property
    def next_brakes(self) -> list[BrakeVariant]:
        """The brake at that position, with the squeal that may go on in it, and those further out where it is quiet.

        None at all where there is no brake at that position, which then counts as one that squeals.
        """
        assert self.position is not None
        carried = (*self._last, *(each for each in self._carried if not any(each is known for known in self._last)))
        further = [each * self.position for each in FURTHER if each * self.position <= self._farthest]
        positions = [self.position, *(further if self.confirms else ())]
        numbers = [self.numbers_at(each) for each in positions]
        if numbers[0] is None:
            return []
        return [BrakeVariant(each, carried) for each in numbers if each is not None]

    def take(self, judged: Sequence[Judged]) -> None:
        """Note what became of the brakes that were tried."""
        position, confirmed = self.position, self.confirms
        assert position is not None
        if judged and all(each.quiet for each in judged):
            self.quiet_at, self._confirmed = position, confirmed
            return
        self.squeals_at, self._confirmed = position, False
        self._last = next((each.squealing for each in judged if each.squealing), self._last)
        if confirmed:
            self.quiet_at = None
        if self.quiet_at is None and self._further is not None and self._further <= position:
            self._further = self._next_further()


def search(
    lines: Sequence[LineSearch],
    disturber: Disturber,
    progress: Progress,
    what: str,
    *,
    given_up: Callable[[LineSearch], bool] = lambda _: False,
) -> None:
    """Find on each line from where on its brakes are quiet, unless it is to be given up."""
    while True:
        going = [line for line in lines if line.position is not None and not given_up(line)]
        progress(what, len(lines) - len(going), len(lines))
        if not going:
            return
        tried = [(line, brake, line.confirms and not k) for line in going for k, brake in enumerate(line.next_brakes)]
        found = disturber.judge([brake for _, brake, _ in tried], what, [thorough for *_, thorough in tried])
        for line in going:
            line.take([judged for (other, *_), judged in zip(tried, found, strict=True) if other is line])
