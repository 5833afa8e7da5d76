"""A branch of cycles along a parameter, by pseudo-arclength through its folds, and what happens on it.

Unknowns are the state, the period and the parameter, scaled to order one. From a cycle and the tangent there the next
one is predicted, and corrected at right angles to it. At a fold the parameter turns round, and the branch goes on.
Source of the method: H. B. Keller, "Numerical solution of bifurcation and nonlinear eigenvalue problems", Applications
of Bifurcation Theory, Academic Press 1977; of the names: Y. A. Kuznetsov, Elements of Applied Bifurcation Theory.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import scipy

from drumsqueal.dynamics.cycles.cycle import (
    SAME,
    BranchEnd,
    Cycle,
    CycleBranch,
    Event,
    describe,
    floquet_of,
    off_between,
    unlike,
)
from drumsqueal.errors import CycleError
from drumsqueal.physics.friction_law import static_coefficient
from drumsqueal.solve.shooting import (
    SINGULAR,
    Closed,
    Crossing,
    Shooting,
    ShootingStart,
    Vector,
    find_crossing,
    scale_near,
    sides,
)
from drumsqueal.solve.transient.flow import slip_speeds

FIRST_STEP, LEAST_STEP, LONGEST_STEP = 0.02, 1e-6, 0.15  # of arclength, in the scaled unknowns
FASTER, SLOWER = 1.6, 0.5
EASY, HARD = 4, 6  # steps of Newton
CORNER_STEPS = (1e-3, 4e-3, 1.6e-2, 6.4e-2)
LOCATED = 1e-5  # of a step: how well an instability, or the turn of a fold, is found along the branch
MOST_POINTS = 400


class Ended(NamedTuple):
    """Why a branch goes on no further; the detail says how it was lost."""

    end: BranchEnd
    detail: str = ""


class _GrazingError(CycleError):
    """The motion jumps away at a grazing bifurcation."""


class _Place(NamedTuple):
    """A cycle on a branch, and the crossing with another one that lies on the step that led there, if one does."""

    closed: Closed
    tangent: Vector
    cycle: Cycle
    crossing: Crossing | None = None


class Track:
    """One branch being followed."""

    def __init__(
        self,
        shooting: Shooting,
        bounds: tuple[float, float],
        steady_at: Callable[[float], Vector | None],
        start: BranchEnd,
        on_branch: Callable[[CycleBranch], object],
    ) -> None:
        """Follow within bounds of the parameter; `steady_at` gives steady sliding q* (n,), None where there is none.

        `on_branch` is called after each cycle, with those up to it, from a `start`.
        """
        self._shooting, self._bounds, self._steady_at = shooting, bounds, steady_at
        self._start, self._on_branch = start, on_branch
        self.cycles: list[Cycle] = []

    def follow(self, closed: Closed, ahead: Vector) -> Ended:
        """Follow from a cycle in the direction that has a part along `ahead` (2n + 2,); returns why it ended.

        `cycles` grows as it goes, the cycle of the start included.
        """
        try:
            start = place = self._cut_anew(self._place(closed, ahead))
            step = FIRST_STEP
            self._keep(place.cycle)
            for _ in range(MOST_POINTS):
                following, step, corner = self._next(place, step)
                bound = float(np.clip(following.cycle.value, *self._bounds))
                if bound != following.cycle.value:
                    return self._to_bound(place, following, bound)
                if self._at_rest(place, following):
                    # Next to a Hopf point hardly anything slips slower; what still sticks moves as slowly as the drum.
                    return Ended(BranchEnd.STANDSTILL if place.cycle.sticking_phases else BranchEnd.HOPF)
                if self._is_back(start, place, following):
                    self._keep(start.cycle)
                    return Ended(BranchEnd.LOOP)
                # Whatever changes at a corner does so there.
                ended = None if corner else self._look_between(place, following, step)
                if ended is not None:
                    return Ended(ended)
                self._keep(following.cycle)
                step = min(step * (FASTER if following.closed.steps <= EASY else 1.0), LONGEST_STEP)
                step = step * SLOWER if following.closed.steps >= HARD else step
                place = self._rescaled(self._cut_anew(following))
        except _GrazingError:
            return Ended(BranchEnd.GRAZING)
        except CycleError as error:
            return Ended(BranchEnd.LOST, str(error))
        return Ended(BranchEnd.LOST, f"after {MOST_POINTS} points")

    def _keep(self, cycle: Cycle) -> None:
        self.cycles.append(cycle)
        self._on_branch(CycleBranch(start=self._start, end=BranchEnd.CUT_OFF, cycles=tuple(self.cycles)))

    def _place(self, closed: Closed, ahead: Vector) -> _Place:
        return _Place(closed, self._tangent(closed, ahead), describe(self._shooting, closed))

    def _cut_anew(self, place: _Place) -> _Place:
        """The place seen from where the contact slips fastest, if it slips slowly where the period is cut.

        There it would soon stick, or reverse its slip, and the flow jump from one cycle to the next.
        """
        samples = place.cycle.samples
        speeds = np.asarray(slip_speeds(place.cycle.model, samples.velocity))
        fastest = int(np.argmax(speeds))
        # Where slip at its cut is less than 0.3 of the fastest of a cycle another cut is taken.
        if speeds[0] > 0.3 * speeds[fastest]:
            return place
        later = float(samples.time[fastest] - samples.time[0])
        closed, ahead = self._shooting.moved(place.closed, place.tangent, later)
        return place._replace(closed=closed, tangent=self._tangent(closed, ahead))

    def _rescaled(self, place: _Place) -> _Place:
        """The place in the scale of its cycle, where that has outgrown the present one.

        On a slow drum the period grows as the drum's speed falls; and what is still at a pitchfork or a period doubling
        moves on the branch that begins there.
        """
        state, period, value = self._shooting.unscaled(place.closed.unknowns)
        steady, units = self._steady_at(value), np.ones(place.tangent.size)
        units[-2] = place.closed.unknowns[-2]
        if steady is not None:
            near = (
                scale_near(place.cycle.model, ShootingStart(state, period, ""), steady)[:-2] / self._shooting.scale[:-2]
            )
            # 3.0 times its scale that a coordinate may move before it is measured anew: at 30 times a search is lost
            units[:-2] = near if np.max(near) > 3.0 else 1.0
        rescaled = 1.5  # change of the period after which it is measured in that of the present cycle
        if 1 / rescaled < units[-2] < rescaled and np.all(units[:-2] == 1):
            return place
        self._shooting = self._shooting.in_units(units)
        unknowns, tangent = place.closed.unknowns / units, place.tangent / units
        closed = place.closed._replace(unknowns=unknowns, flow=self._shooting.flow(unknowns))
        return place._replace(closed=closed, tangent=tangent / np.linalg.norm(tangent))

    def _tangent(self, closed: Closed, ahead: Vector) -> Vector:
        """The direction of the branch at a cycle (2n + 2,), of length one, with a part along `ahead`."""
        matrix = self._bordered(closed, ahead)
        tangent = np.linalg.lstsq(matrix, np.eye(len(matrix))[-1], rcond=SINGULAR)[0]
        return tangent / np.linalg.norm(tangent)

    def _bordered(self, closed: Closed, row: Vector) -> Vector:
        """The derivative of what vanishes on a branch (2n + 2, 2n + 2), and a row."""
        found = closed.flow
        phase = np.append(found.rate / np.linalg.norm(found.rate), [0.0, 0.0])
        return np.vstack([self._shooting.jacobian(found), phase, row])

    def _same_way(self, place: _Place, closed: Closed, tangent: Vector) -> bool:
        """Whether a tangent at a cycle leads the way along the branch that it has at a place.

        The sign of det [derivative; tangent] is kept through folds, and across corners, where only the derivative
        normal to the boundary jumps. It changes where another branch crosses.
        Source: E. L. Allgower and K. Georg, Numerical Continuation Methods, Springer 1990, sections 2.1 and 14.2.
        """
        matrices = self._bordered(place.closed, place.tangent), self._bordered(closed, tangent)
        before, after = (np.linalg.slogdet(matrix)[0] for matrix in matrices)
        return bool(before * after >= 0)

    def _next(self, place: _Place, step: float) -> tuple[_Place, float, bool]:
        """The next place, the step that led there, and whether a corner lies between.

        Raises CycleError where there is none.
        """
        why = ""
        while step >= LEAST_STEP:
            following, why = None, f"Newton's method fails with the smallest step at {place.cycle.value:.6g}"
            try:
                following = self._advance(place, step)
            except CycleError as error:
                # As near to where it cannot go on as the smallest step brings it.
                if step <= 100 * LEAST_STEP:
                    raise
                why = str(error)
            if following is not None:
                return following, step, False
            step *= SLOWER
        following = self._around(place)
        if following is None:
            if self._jumps_ahead(place):
                self.cycles[-1] = place.cycle.model_copy(update={"what": Event.GRAZING})
                raise _GrazingError
            raise CycleError(why)
        grazes = following.closed.flow.pattern != place.closed.flow.pattern
        turns = place.tangent[-1] * following.tangent[-1] < 0
        what = Event.GRAZING if grazes else Event.FOLD if turns else Event.CORNER
        self.cycles[-1] = place.cycle.model_copy(update={"what": what})
        return following, CORNER_STEPS[0], True

    def _advance(self, place: _Place, step: float) -> _Place | None:
        """The place at the end of a step, None where that is too long. Raises CycleError where the branch ends."""
        closed = self._corrected(place, step)
        if closed is None or np.linalg.norm(closed.unknowns - place.closed.unknowns) > 3 * step:
            return None
        if closed.flow.pattern != place.closed.flow.pattern:  # behind a corner, where the branch may turn round
            return None
        tangent = self._tangent(closed, place.tangent)
        # The cosine of the angle between two neighbouring tangents is 0.9 at least,
        if tangent @ place.tangent < 0.9 and step > LEAST_STEP / SLOWER:
            return None
        same_way = self._same_way(place, closed, tangent)
        # and 0.999 where a real multiplier passes 1 without a fold: at a corner the branch turns by more.
        if tangent @ place.tangent < 0.999 and not same_way:
            return None  # behind a corner, too, and on the way back to it
        crossing = None if same_way else self._crossing_between(place.closed, closed)
        following = _Place(closed, tangent, describe(self._shooting, closed), crossing)
        # Where no branch crosses on the way the step led to another one.
        astray = crossing is None and not same_way
        # 2e-3 a step that is not made shorter for that
        return None if step > 2e-3 and (astray or _may_cross_twice(place.cycle, following.cycle)) else following

    def _around(self, place: _Place) -> _Place | None:
        """A place behind a corner of the branch, if there is one.

        Where slip just comes to reverse on the lining the flow map has two derivatives, one for either side, and the
        branch two directions. The derivative a little ahead is that of the other side.
        """
        old = place.closed
        for step in CORNER_STEPS:
            ahead = self._shooting.flow(old.unknowns + step * place.tangent)
            direction = self._tangent(old._replace(flow=ahead), place.tangent)
            for sign in (1.0, -1.0):
                closed = self._shooting.close(old.unknowns + sign * step * direction, direction, old.flow.rate)
                if closed is None:
                    continue
                way = closed.unknowns - old.unknowns
                length = float(np.linalg.norm(way))
                onwards = self._same_way(place, closed, way / length)
                if step / 3 < length < 3 * step and onwards:
                    try:
                        return self._place(closed, way / length)
                    except CycleError:
                        continue
        return None

    def _jumps_ahead(self, place: _Place) -> bool:
        """Whether it grazes next where static friction exceeds what slides: what touches the drum then jumps away."""
        friction = place.cycle.model.contact.friction
        if friction is None or static_coefficient(friction.law) <= friction.law.coefficient(jnp.zeros(())):
            return False
        unknowns, ahead = place.closed.unknowns, CORNER_STEPS[0] * place.tangent
        return self._shooting.flow(unknowns + ahead).pattern != place.closed.flow.pattern

    def _corrected(self, place: _Place, step: float) -> Closed | None:
        guess = place.closed.unknowns + step * place.tangent
        return self._shooting.close(guess, place.tangent, place.closed.flow.rate)

    def _to_bound(self, place: _Place, beyond: _Place, bound: float) -> Ended:
        """Keep the cycle at the bound itself, with its very value, once. Raises CycleError where there is none."""
        before, after = place.cycle.value, beyond.cycle.value
        # 1e-9 of the range: a cycle so near to its end is at its end
        if abs(bound - before) < 1e-9 * (self._bounds[1] - self._bounds[0]):
            self.cycles[-1] = self.cycles[-1].model_copy(update={"value": bound})
            return Ended(BranchEnd.BOUND)
        near, far = place.closed.unknowns, beyond.closed.unknowns
        fraction = (bound - before) / (after - before)
        guesses = ((1 - fraction) * near + fraction * far, near, far)
        at_bound = (np.append(guess[:-1], bound / self._shooting.scale[-1]) for guess in guesses)
        closed = next(filter(None, map(self._shooting.close, at_bound)), None)
        if closed is None:
            raise CycleError(f"Newton's method fails between {before:.6g} and the end of the range")
        crossing, (low, high) = beyond.crossing, self._bounds
        if crossing is not None and not low <= self._shooting.unscaled(crossing.closed.unknowns)[2] <= high:
            crossing = None
        last = self._place(closed, beyond.tangent)._replace(crossing=crossing)
        ended = self._look_between(place, last, float(np.linalg.norm(closed.unknowns - near)))
        if ended is not None:
            return Ended(ended)
        self._keep(last.cycle.model_copy(update={"value": bound}))
        return Ended(BranchEnd.BOUND)

    def _at_rest(self, place: _Place, following: _Place) -> bool:
        """Whether the branch has shrunk to steady sliding: beyond that it would go on as its own mirror image."""
        vibrations = []
        for each in (place, following):
            steady = self._steady_at(each.cycle.value)
            if steady is None:
                return False
            vibrations.append(self._shooting.vibration(each.closed, steady))
        before, after = vibrations
        # 2e-3 scaled amplitude at which a branch ends at the steady sliding that it came from
        return bool(before @ after < 0 or np.max(np.abs(after)) < 2e-3)

    def _is_back(self, start: _Place, place: _Place, following: _Place) -> bool:
        """Whether the step to a place leads through the cycle of the start, the same way: maybe at another phase."""
        if start.tangent[-1] * following.tangent[-1] <= 0 or len(self.cycles) <= 4:  # a closed loop has more
            return False
        first = start.cycle
        return off_between(place.cycle, following.cycle, first.value, first.period_s, first.amplitude) < SAME

    def _look_between(self, a: _Place, b: _Place, step: float) -> BranchEnd | None:
        """Find folds, crossings, and where multipliers cross the unit circle, on the way from one place to the next.

        Returns the end of the branch, if one lies there. It is a period doubling, and not a fold, where cycles of twice
        the period turn round, and a pitchfork where those that lack a symmetry do: the branch goes back as it came,
        half a period later, or as its mirror image.
        """
        turns = a.tangent[-1] * b.tangent[-1] < 0
        if turns and halves(self._shooting, a.closed) @ halves(self._shooting, b.closed) < 0:
            self._keep_doubling(a, b, step)
            return BranchEnd.DOUBLING
        if b.crossing is not None:
            with suppress(CycleError):
                return self._keep_crossing(b.crossing, b.closed.unknowns - a.closed.unknowns)
        if turns:
            self._locate(a, step, Event.FOLD, lambda closed: float(self._tangent(closed, a.tangent)[-1]))
            return None
        one, other = a.cycle.unstable_directions, b.cycle.unstable_directions
        if one == other or min(abs(a.cycle.largest - 1), abs(b.cycle.largest - 1)) < LOCATED**2:
            return None
        rank = min(one, other)
        self._locate(a, step, None, lambda closed: float(np.abs(floquet_of(self._shooting, closed)[0][rank])) - 1)
        return None

    def _crossing_between(self, a: Closed, b: Closed) -> Crossing | None:
        """The crossing with another branch between two cycles, if it is found."""
        way = b.unknowns - a.unknowns
        with suppress(CycleError):
            found = find_crossing(self._shooting, a.unknowns + way / 2)
            # On the way, as far as the branch bends.
            if np.linalg.norm(found.closed.unknowns - a.unknowns - way / 2) < np.linalg.norm(way):
                return found
        return None

    def _keep_crossing(self, found: Crossing, way: Vector) -> BranchEnd | None:
        """Keep the cycle in which another branch crosses; the branch ends there if its sides are mirror images."""
        own, other = found.split(way)
        what = Event.PITCHFORK if found.pitchfork else Event.TRANSCRITICAL
        ends = own[-1] == 0 and is_mirrored(self._shooting, found.closed.unknowns, own)
        cycle = describe(self._shooting, found.closed)
        self._keep(cycle.model_copy(update={"what": what, "crossing": other * self._shooting.scale}))
        return BranchEnd.PITCHFORK if ends else None

    def _locate(self, a: _Place, step: float, kind: Event | None, measure: Callable[[Closed], float]) -> None:
        """Keep the cycle at which a measure vanishes, between a place and the end of the step from it."""

        def at(length: float) -> Closed:
            closed = a.closed if length == 0 else self._corrected(a, length)
            if closed is None:
                raise CycleError("Newton's method fails on the way")
            return closed

        try:
            length: Any = scipy.optimize.brentq(lambda length: measure(at(length)), 0.0, step, xtol=LOCATED * step)
            closed = at(length)
            cycle = describe(self._shooting, closed)
        except (CycleError, ValueError):
            return  # the branch itself goes on, without the name of what happened
        self._keep(cycle.model_copy(update={"what": kind or _kind(cycle)}))

    def _keep_doubling(self, a: _Place, b: _Place, step: float) -> None:
        """Keep the cycle at which both halves of the period become alike, between a place and the next one."""
        one, other = (float(np.linalg.norm(halves(self._shooting, place.closed))) for place in (a, b))
        cycle = min((one, a.cycle), (other, b.cycle), key=lambda pair: pair[0])[1]
        # The other branch crosses there: just beside it Newton's method may fail, and a value is as good.
        with suppress(CycleError):
            closed = self._corrected(a, step * one / (one + other))
            cycle = cycle if closed is None else describe(self._shooting, closed)
        self._keep(cycle.model_copy(update={"what": Event.DOUBLING}))


def is_mirrored(shooting: Shooting, at: Vector, along: Vector) -> bool:
    """Whether the sides of a branch that folds in a crossing (2n + 2,) are mirror images, by period and amplitudes.

    They are not where no cycle is found on a side, nor where images exchange coordinates: then both are followed.
    """
    try:
        one, other = (describe(shooting, each) for each in sides(shooting, at, along)[1])
    except CycleError:
        return False
    # Relative difference in period and amplitudes of the cycles on both sides: of images 1e-8, as well as cycles close,
    # of others about twice BESIDE.
    return unlike(one, other.period_s, other.amplitude) < 1e-3


def halves(shooting: Shooting, closed: Closed) -> Vector:
    """By how much a state (2n,), scaled, differs from that after half of the period."""
    halved = closed.unknowns * np.append(np.ones(closed.unknowns.size - 2), [0.5, 1.0])
    return shooting.flow(halved).end - closed.unknowns[:-2]


def _may_cross_twice(a: Cycle, b: Cycle) -> bool:
    """Whether a multiplier may have left the unit circle and come back: it moves by more than its way to the circle."""
    one, other = np.abs(a.multipliers), np.abs(b.multipliers)
    away = np.minimum(np.abs(one - 1), np.abs(other - 1))
    stays = (one > 1) == (other > 1)  # what crosses is found
    # In a step a multiplier may go as far as its way to the unit circle, and 0.015 in any case.
    return bool(np.any(stays & (np.abs(one - other) > np.maximum(away, 0.015))))


def _kind(cycle: Cycle) -> Event:
    """What the multiplier that lies on the unit circle says."""
    nearest = cycle.multipliers[np.argmin(np.abs(np.abs(cycle.multipliers) - 1))]
    if abs(nearest.imag) > 1e-3:  # |Im μ| above which two multipliers that leave the circle are a pair
        return Event.NEIMARK_SACKER
    return Event.DOUBLING if nearest.real < 0 else Event.BRANCHING
