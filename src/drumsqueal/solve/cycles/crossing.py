"""Where two branches of cycles cross: the cycle itself, and the directions in which the branches go through it.

There the derivative G (2n + 1, 2n + 2) of what vanishes on a branch loses a rank. With β b added to what vanishes, and
G bordered so that it keeps its rank, the cycle is a regular solution, which Newton's method finds from some way off; on
the branch itself it loses its way next to the crossing.
Sources: W. Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, sections 3.3 and 4.1.2; of
the directions: H. B. Keller, as in `continuation.py`.
"""

from typing import NamedTuple

import numpy as np
import scipy

from drumsqueal.errors import CycleError
from drumsqueal.solve.cycles.floquet import NEUTRAL
from drumsqueal.solve.cycles.shooting import CLOSED, Closed, Shooting, Vector, is_near
from drumsqueal.solve.transient.flow import Flow

NUDGE = 1e-5  # of the scale: steps of differences; the flow's errors of 1e-10 and less over it are 1e-5
BESIDE = 0.02  # of the scale: how far the first cycle of another branch is from the one where that begins
NEARER = 6  # tries, each half as far as the one before: at last 6e-4 of the scale


class Crossing(NamedTuple):
    """The cycle on two branches, and the directions (2, 2n + 2), of length one, in which they go through it.

    At a pitchfork, where one of the branches folds, that has a component of exactly zero along the parameter.
    """

    closed: Closed
    directions: Vector

    @property
    def pitchfork(self) -> bool:
        """Whether one of the branches folds there."""
        return not self.directions[:, -1].all()

    def split(self, along: Vector) -> tuple[Vector, Vector]:
        """The direction nearest to one, and the other."""
        own = int(np.argmax(np.abs(self.directions @ along)))
        return self.directions[own], self.directions[1 - own]


def find_crossing(shooting: Shooting, guess: Vector) -> Crossing:
    """The crossing of two branches near a guess (2n + 2,). Raises CycleError where none is found."""
    first = _flow(shooting, guess)
    phase = np.append(first.rate / np.linalg.norm(first.rate), [0.0, 0.0])
    left, _, right = np.linalg.svd(_slopes(shooting, first, phase))
    column, rows = left[:, -1], right[-2:]

    def equations(shifted: Vector) -> Vector:
        unknowns, found = _at(shooting, guess, shifted)
        vanishing = np.append(found.end - unknowns[:-2], phase @ (unknowns - guess))
        slopes = _slopes(shooting, found, phase)
        bordered = np.block([[slopes, column[:, None]], [rows, np.zeros((2, 1))]])
        lost = np.linalg.lstsq(bordered.T, np.eye(len(bordered))[-1])[0][-2:]
        return np.append(vanishing + (shifted[-1] - 1) * column, lost)

    # The relative change in the unknowns that ends the search, as far as a cycle closes, is 1e-10.
    options = {"xtol": 1e-10, "eps": NUDGE**2}
    # Around 1, for the steps of its differences are relative. It stops at round-off, too, without success by its own
    # measure, and anywhere where it stalls: what it leaves decides.
    shifted = scipy.optimize.root(equations, np.ones(guess.size + 1), method="hybr", options=options).x
    unknowns, found = _at(shooting, guess, shifted)
    residual = float(np.max(np.abs(found.end - unknowns[:-2])))
    # By |ψᵀG|, ψ of about length one, G keeps its rank, and as far from 1 is the multiplier that is 1 at a crossing.
    if not (residual < CLOSED and np.max(np.abs(equations(shifted)[-2:])) < NEUTRAL):
        raise CycleError("no crossing of branches is found")
    closed = Closed(unknowns, found, residual, 0)
    directions = _directions(shooting, unknowns, phase)
    steepest = int(np.argmin(np.arctan2(np.abs(directions[:, -1]), np.linalg.norm(directions[:, :-1], axis=1))))
    if _folds(shooting, closed, directions[steepest]):
        directions[steepest, -1] = 0.0
        directions[steepest] /= np.linalg.norm(directions[steepest])
    return Crossing(closed, directions)


def _folds(shooting: Shooting, closed: Closed, along: Vector) -> bool:
    """Whether a branch folds in a crossing: in no unit of the parameter, by its slope there over its bend.

    Raises CycleError where there is no cycle beside it.
    """
    step, beside = sides(shooting, closed.unknowns, along)
    values = [float(each.unknowns[-1]) for each in beside]
    # Its slope takes a branch 0.1 of what it bends that far from a crossing: then it folds within 1e-3 of the scale of
    # the crossing, on half the way of the shortest step that a branch is followed by without need.
    return abs(step) < 0.1 * abs(sum(values) / 2 - closed.unknowns[-1])


def sides(shooting: Shooting, at: Vector, along: Vector) -> tuple[float, list[Closed]]:
    """How far the parameter moves along a branch from a crossing to cycles on both sides, and these.

    They are nearer where the motion hardly changes with the parameter, and Newton's method loses its way so far off.
    """
    motion = np.append(along[:-1], 0.0)
    for size in BESIDE / 2 ** np.arange(NEARER):
        side = size * along / np.linalg.norm(motion)
        beside = [shooting.close(at + way, motion) for way in (side, -side)]
        found = [each for each in beside if each is not None]
        if len(found) == len(beside):
            return float(side[-1]), found
    raise CycleError("Newton's method finds no cycle of a branch next to where it crosses another one")


def _directions(shooting: Shooting, unknowns: Vector, phase: Vector) -> Vector:
    """Those in the null space V of G with ψᵀ D²G[V a, V a] = 0, ψᵀ G = 0. Raises CycleError where none are."""
    left, _, right = np.linalg.svd(_slopes(shooting, _flow(shooting, unknowns), phase))
    across, basis = left[:, -1], right[-2:]

    def turned(along: Vector) -> Vector:
        ends = [_slopes(shooting, _flow(shooting, unknowns + sign * NUDGE * along), phase) for sign in (1, -1)]
        return across @ (ends[0] - ends[1]) @ basis.T / (2 * NUDGE)

    form = np.array([turned(along) for along in basis])
    sizes, axes = np.linalg.eigh((form + form.T) / 2)
    if not sizes[0] < 0 < sizes[1]:
        raise CycleError("no branches cross there")
    pair = np.array([[np.sqrt(sizes[1]), sign * np.sqrt(-sizes[0])] for sign in (1, -1)]) @ axes.T @ basis
    return pair / np.linalg.norm(pair, axis=1)[:, None]


def _at(shooting: Shooting, guess: Vector, shifted: Vector) -> tuple[Vector, Flow]:
    unknowns = guess + shifted[:-1] - 1
    return unknowns, _flow(shooting, unknowns)


def _flow(shooting: Shooting, unknowns: Vector) -> Flow:
    found = shooting.flow(unknowns) if is_near(unknowns) else None
    if found is None or not found.reached or not np.all(np.isfinite(found.transition)):
        raise CycleError("the search for a crossing of branches is lost")
    return found


def _slopes(shooting: Shooting, found: Flow, phase: Vector) -> Vector:
    """The derivative G of what vanishes on a branch, the phase condition last."""
    return np.vstack([shooting.jacobian(found), phase])
