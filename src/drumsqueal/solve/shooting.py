"""A periodic motion by shooting, its Floquet multipliers, and where two branches of such motions cross.

Newton's method closes the flow over a period. Multipliers are what a period does to small disturbances. Where branches
cross, the derivative G (2n + 1, 2n + 2) of what vanishes on a branch loses a rank. With β b added to what vanishes, and
G bordered so that it keeps its rank, the cycle is a regular solution, which Newton's method finds from some way off; on
the branch itself it loses its way next to the crossing.
Sources: W. Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, sections 3.3 and 4.1.2; of
the directions: H. B. Keller, as in `continuation.py`.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import scipy
from numpy.typing import NDArray

from drumsqueal.errors import CycleError
from drumsqueal.physics.model import Model
from drumsqueal.solve.transient.flow import APART, Flow, flow, neighbours, state_size

TOLERANCE = 1e-10  # of the flow, as a scene's
CLOSED = 1e-10  # the largest scaled difference between a state and itself a period later that counts as none
PATIENCE, PROGRESS = 6, 0.1  # after so many steps the residual must have come down to this fraction
SINGULAR = 1e-11  # singular values below this fraction of the largest are none: a coordinate that nothing holds

Vector = NDArray[np.float64]
Models = Callable[[float], tuple[Model, Model | None]]
"""The model at a value of the parameter, and its derivative with respect to that (None: there is no parameter)."""


class ShootingStart(NamedTuple):
    """A state (2n,), displacement from q = 0 and velocity, a period (s), and where that comes from."""

    state: Vector
    period: float
    origin: str


class Closed(NamedTuple):
    """A scaled state (2n,), period and parameter, (2n + 2,) in all, and the flow from there over a period.

    `residual` is the largest scaled difference between the state and itself a period later, `steps` how many Newton
    made.
    """

    unknowns: Vector
    flow: Flow
    residual: float
    steps: int


class Shooting:
    """The equations φ(y, T, p) − y = 0 with a phase condition and one more condition that fixes the parameter."""

    def __init__(
        self,
        models: Models,
        scale: Vector,
        on_flow: Callable[[], object] = lambda: None,
        flow: Callable[..., Flow] = flow,
    ) -> None:
        """Take the models along the parameter, and what state, period (s) and parameter (2n + 2,) are measured in.

        `on_flow` is called before each integration, which is done by `flow`.
        """
        self.models, self.scale, self._on_flow, self._follow = models, scale, on_flow, flow

    def in_units(self, units: Vector) -> "Shooting":
        """The same equations with unknowns in other units (2n + 2,), as multiples of the present ones."""
        return Shooting(self.models, self.scale * units, self._on_flow, self._follow)

    def scaled(self, state: Vector, period: float, parameter: float) -> Vector:
        """The unknowns (2n + 2,) of a state (m, m/s, rad, rad/s), a period (s) and a parameter."""
        return np.append(state, [period, parameter]) / self.scale

    def unscaled(self, unknowns: Vector) -> tuple[Vector, float, float]:
        """State, period and parameter."""
        values = unknowns * self.scale
        return values[:-2], float(values[-2]), float(values[-1])

    def flow(self, unknowns: Vector) -> Flow:
        """The flow over a period."""
        self._on_flow()
        _, period, parameter = self.unscaled(unknowns)
        model, change = self.models(parameter)
        return self._follow(model, self.scale[:-2], unknowns[:-2], period, TOLERANCE, change)

    def jacobian(self, found: Flow) -> Vector:
        """∂(φ − y)/∂(y, T, p) (2n, 2n + 2), scaled."""
        period, parameter = self.scale[-2:]
        transition = found.transition - np.eye(found.end.size)
        return np.column_stack([transition, found.rate * period, found.sensitivity * parameter])

    def moved(self, closed: Closed, direction: Vector, time: float) -> tuple[Closed, Vector]:
        """The same motion from a state on it that comes a time (s) later, and a direction (2n + 2,) taken there."""
        _, _, parameter = self.unscaled(closed.unknowns)
        model, change = self.models(parameter)
        found = self._follow(model, self.scale[:-2], closed.unknowns[:-2], time, TOLERANCE, change)
        unknowns = np.append(found.end, closed.unknowns[-2:])
        along = found.transition @ direction[:-2] + found.sensitivity * self.scale[-1] * direction[-1]
        return closed._replace(unknowns=unknowns, flow=self.flow(unknowns)), np.append(along, direction[-2:])

    def vibration(self, closed: Closed, steady: Vector) -> Vector:
        """A scaled state (2n,) from steady sliding q* (n,)."""
        return closed.unknowns[:-2] - np.append(steady, np.zeros_like(steady)) / self.scale[:-2]

    def close(self, guess: Vector, condition: Vector | None = None, phase: Vector | None = None) -> Closed | None:
        """Solve from a guess (2n + 2,); None where Newton's method does not get there.

        With `condition`·(x − guess) = 0, by default at the parameter of the guess. The phase condition is that the
        state moves from the guess at right angles to `phase` (2n,), by default the rate there. Steps are cut where the
        residual would not fall.
        """
        unknowns, found = guess, self.flow(guess)
        across = found.rate if phase is None else phase
        along = np.eye(guess.size)[-1] if condition is None else condition
        border = np.zeros((2, guess.size))
        border[0, :-2], border[1] = across / np.linalg.norm(across), along / np.linalg.norm(along)
        first = size = _size(found, unknowns)
        for count in range(15):  # steps of Newton
            if not np.isfinite(size) or (count >= PATIENCE and size > PROGRESS * first):
                return None
            right = np.concatenate([unknowns[:-2] - found.end, border @ (guess - unknowns)])
            matrix = np.concatenate([self.jacobian(found), border])
            # Least squares: a coordinate that nothing holds may stay where it is.
            step = np.linalg.lstsq(matrix, right, rcond=SINGULAR)[0]
            longest = float(np.max(np.abs(step)))
            # After a step of Newton of 1e-9 the next one would be round-off.
            if size < CLOSED and longest < 1e-9:
                return Closed(unknowns, found, size, count)
            step *= min(1.0, 0.3 / longest)  # of Newton, in the scale of the motion
            for _ in range(4):  # halvings
                trial = unknowns + step
                if not is_near(trial):
                    return None
                following = self.flow(trial)
                now = _size(following, trial)
                if now < size or now < CLOSED:
                    break
                step /= 2
            else:
                # No step makes it smaller: that may be round-off, where it is small enough.
                return Closed(unknowns, found, size, count) if size < CLOSED else None
            unknowns, found, size = trial, following, now
        return None


def is_near(unknowns: Vector) -> bool:
    """Whether state and period (2n + 2,), scaled, are not so far off that a search is lost."""
    worst = 30.0  # scaled state or ratio of periods beyond which a search is lost
    return bool(np.max(np.abs(unknowns[:-2])) < worst and 1 / worst < unknowns[-2] < worst)


def scale_near(model: Model, start: ShootingStart, steady: Vector, parameter: float = 1.0) -> Vector:
    """What state, period and parameter (2n + 2,) of a cycle are measured in, from a start near it."""
    n = len(steady)
    size = state_size(model, jnp.asarray(start.state[:n] - steady), jnp.asarray(start.state[n:]))
    return np.append(np.asarray(size), [start.period, parameter])


def _size(found: Flow, unknowns: Vector) -> float:
    sound = bool(found.reached) and all(np.all(np.isfinite(part)) for part in (found.transition, found.sensitivity))
    return float(np.max(np.abs(found.end - unknowns[:-2]))) if sound else np.inf


ASTRAY = 1e-3  # of what a period does to a disturbance: neighbours are good to 1e-5 of it
NEUTRAL = 1e-6  # a multiplier that is this near to the unit circle cannot be distinguished from one on it


def floquet_of(shooting: Shooting, closed: Closed) -> tuple[NDArray[np.complex128], float, float]:
    """Multipliers, unit error and tangent error of a closed motion, as in `Cycle`.

    The multipliers are the tangents' where tangents and neighbours agree to 1e-3. Where they do not, as pairs of
    contact boundaries appear, the tangents may have been led astray; or the motion all but grazes a boundary and the
    neighbours are on either side of it, where the flow has another derivative each. Then they do not carry the motion's
    own rate over a period into itself, or stick or reverse their slip where the motion does not, and the tangents, of
    the side on which the motion is, hold. Raises CycleError where neighbours are lost.
    """
    _, period, parameter = shooting.unscaled(closed.unknowns)
    tangents, rate = closed.flow.transition, closed.flow.rate
    size, units = shooting.scale[:-2], np.eye(len(rate))
    given = shooting.models(parameter)[0], size, closed.unknowns[:-2], units, period
    near = np.asarray(neighbours(*given)[1])
    if not np.all(np.isfinite(near)):
        raise CycleError("nearby motions are not followed over a period")
    largest = np.max(np.abs(near))
    tangent_error = float(np.max(np.abs(tangents - near)) / largest)
    if tangent_error >= ASTRAY and not _grazes(shooting, closed):
        # What nothing depends on comes back as it was but for round-off, of which `floquet` knows nothing.
        free = np.all(tangents == units, axis=0)
        multipliers, unit_error = floquet(np.where(free, units, near), rate)
        if unit_error < ASTRAY * largest:
            return multipliers, unit_error, tangent_error
    return *floquet(tangents, rate, closed.flow.lost), tangent_error


def _grazes(shooting: Shooting, closed: Closed) -> bool:
    """Whether motions as far away as neighbours stick or reverse their slip otherwise."""
    steps = APART * np.eye(closed.unknowns.size)[:-2]
    return any(
        shooting.flow(closed.unknowns + sign * step).pattern != closed.flow.pattern
        for step in steps
        for sign in (1, -1)
    )


def floquet(transition: Vector, rate: Vector, lost: int = 0) -> tuple[NDArray[np.complex128], float]:
    """Eigenvalues of ∂y(T)/∂y(0) (2n, 2n), largest first, without that of the rate ẏ, and how far that one is from 1.

    In a basis that begins with ẏ/|ẏ| the matrix is [[1, *], [0, B]], and B has the others. A displacement that nothing
    depends on is left out: its multiplier is 1 whatever the motion. As many as directions are `lost` are zero exactly:
    those of a matrix with a rank so much lower, of which round-off would leave the root of itself.
    """
    held = np.flatnonzero(np.any(transition != np.eye(len(rate)), axis=0))
    matrix, along = transition[np.ix_(held, held)], rate[held] / np.linalg.norm(rate[held])
    unit_error = float(np.linalg.norm(matrix @ along - along))
    basis = np.linalg.qr(np.column_stack([along, np.eye(len(along))]))[0]
    across = (basis.T @ matrix @ basis)[1:, 1:]
    if lost:
        left, sizes, right = np.linalg.svd(across)
        kept = len(sizes) - lost
        across = scipy.linalg.block_diag((right[:kept] @ left[:, :kept]) * sizes[:kept], np.zeros((lost, lost)))
    multipliers = np.linalg.eigvals(across).astype(np.complex128)
    return multipliers[np.lexsort((-multipliers.imag, -np.abs(multipliers)))], unit_error


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
