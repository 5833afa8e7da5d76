"""A periodic motion: Newton's method on the flow over a period, Floquet multipliers, and whether it is stable."""

from collections.abc import Callable
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, PlainSerializer, computed_field

from drumsqueal.errors import CycleError, IntegrationError
from drumsqueal.findings.part import Finding, Held, Number
from drumsqueal.physics.model import Model
from drumsqueal.solve.motion import turning_points
from drumsqueal.solve.transient.flow import APART, Change, Flow, flow, neighbours, slip_speeds, state_size
from drumsqueal.solve.transient.integrate import Chunk, integrate
from drumsqueal.solve.transient.state import CHUNK_SAMPLES

TOLERANCE = 1e-10  # of the flow, as a scene's
CLOSED = 1e-10  # the largest scaled difference between a state and itself a period later that counts as none
SETTLED = 1e-9  # the largest scaled step of Newton after which the next one would be round-off
NEWTON_STEPS = 15
HALVINGS = 4
PATIENCE, PROGRESS = 6, 0.1  # after so many steps the residual must have come down to this fraction
LONGEST_STEP = 0.3  # of Newton, in the scale of the motion
WORST = 30.0  # scaled state or ratio of periods beyond which a search is lost
SINGULAR = 1e-11  # singular values below this fraction of the largest are none: a coordinate that nothing holds

SAMPLES = CHUNK_SAMPLES  # of a period
ASTRAY = 1e-3  # of what a period does to a disturbance: neighbours are good to 1e-5 of it
NEUTRAL = 1e-6  # a multiplier that is this near to the unit circle cannot be distinguished from one on it

Vector = NDArray[np.float64]
Models = Callable[[float], tuple[Model, Model | None]]
"""The model at a value of the parameter, and its derivative with respect to that (None: there is no parameter)."""


class Start(NamedTuple):
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

    def __init__(self, models: Models, scale: Vector, on_flow: Callable[[], object] = lambda: None) -> None:
        """Take the models along the parameter, and what state, period (s) and parameter (2n + 2,) are measured in.

        `on_flow` is called before each integration.
        """
        self.models, self.scale, self._on_flow = models, scale, on_flow

    def in_units(self, units: Vector) -> "Shooting":
        """The same equations with unknowns in other units (2n + 2,), as multiples of the present ones."""
        return Shooting(self.models, self.scale * units, self._on_flow)

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
        return flow(model, self.scale[:-2], unknowns[:-2], period, TOLERANCE, change)

    def jacobian(self, found: Flow) -> Vector:
        """∂(φ − y)/∂(y, T, p) (2n, 2n + 2), scaled."""
        period, parameter = self.scale[-2:]
        transition = found.transition - np.eye(found.end.size)
        return np.column_stack([transition, found.rate * period, found.sensitivity * parameter])

    def moved(self, closed: Closed, direction: Vector, time: float) -> tuple[Closed, Vector]:
        """The same motion from a state on it that comes a time (s) later, and a direction (2n + 2,) taken there."""
        _, _, parameter = self.unscaled(closed.unknowns)
        model, change = self.models(parameter)
        found = flow(model, self.scale[:-2], closed.unknowns[:-2], time, TOLERANCE, change)
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
        for count in range(NEWTON_STEPS):
            if not np.isfinite(size) or (count >= PATIENCE and size > PROGRESS * first):
                return None
            right = np.concatenate([unknowns[:-2] - found.end, border @ (guess - unknowns)])
            matrix = np.concatenate([self.jacobian(found), border])
            # Least squares: a coordinate that nothing holds may stay where it is.
            step = np.linalg.lstsq(matrix, right, rcond=SINGULAR)[0]
            longest = float(np.max(np.abs(step)))
            if size < CLOSED and longest < SETTLED:
                return Closed(unknowns, found, size, count)
            step *= min(1.0, LONGEST_STEP / longest)
            for _ in range(HALVINGS):
                trial = unknowns + step
                if not (np.max(np.abs(trial[:-2])) < WORST and 1 / WORST < trial[-2] < WORST):
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


def cut_in_slip(model: Model, start: Start) -> Start:
    """The start, moved to where the contact slips fastest in the period from there, if it sticks in it.

    Where it sticks, a state may not be varied: it would not stick then. Where it slips, the flow is smooth, and what
    sticking forgets are columns of zero of its derivative, not of φ − y.
    """
    try:
        whole = _sample(model, start.state, start.period)
        if not whole.observation.sticking.any():
            return start
        # On a slow drum it sticks for almost all of the period, and slips between two samples of that only.
        slipping = [_sample(model, start.state, time) for time in _first_sticking(whole)]
    except CycleError:
        return start
    states = np.vstack([np.hstack([each.displacement, each.velocity]) for each in (whole, *slipping)])
    fastest = int(np.argmax(slip_speeds(model, states[:, states.shape[1] // 2 :])))
    return start._replace(state=states[fastest])


def _first_sticking(samples: Chunk) -> list[float]:
    """When (s) the contact first begins to stick after the start, if it does."""
    return [time for time, sticks in samples.changes if sticks and time > 0][:1]


def scale_near(model: Model, start: Start, steady: Vector, parameter: float = 1.0) -> Vector:
    """What state, period and parameter (2n + 2,) of a cycle are measured in, from a start near it."""
    n = len(steady)
    size = state_size(model, jnp.asarray(start.state[:n] - steady), jnp.asarray(start.state[n:]))
    return np.append(np.asarray(size), [start.period, parameter])


def _size(found: Flow, unknowns: Vector) -> float:
    sound = bool(found.reached) and all(np.all(np.isfinite(part)) for part in (found.transition, found.sensitivity))
    return float(np.max(np.abs(found.end - unknowns[:-2]))) if sound else np.inf


def _pairs(values: Any) -> Any:
    """Real and imaginary parts of complex numbers (k,), as the file has them."""
    return [[value.real, value.imag] for value in values.tolist()] if isinstance(values, np.ndarray) else values


if TYPE_CHECKING:
    Multipliers = NDArray[np.complex128]
else:
    Multipliers = Annotated[
        tuple[tuple[Number, Number], ...],
        BeforeValidator(_pairs),
        AfterValidator(lambda pairs: np.array([complex(*pair) for pair in pairs], dtype=np.complex128)),
        PlainSerializer(_pairs),
    ]


class Event(StrEnum):
    """What happens at a cycle on a branch.

    At a corner slip just comes to reverse on a part of the lining. At a grazing bifurcation the contact as a whole just
    comes to move with the drum: on one side of it the cycle sticks once more, or reverses its slip, than on the other.
    """

    FOLD = "fold"
    NEIMARK_SACKER = "Neimark-Sacker"
    DOUBLING = "period doubling"
    BRANCHING = "branch point"
    CORNER = "corner"
    GRAZING = "grazing"


class Cycle(Finding):
    """A periodic motion of a model: its period (s) and a state on it, displacement from q = 0 and velocity.

    `multipliers` are the Floquet multipliers, the largest first, without the trivial one that belongs to the motion
    along the cycle. That one must be 1; its error is `unit_multiplier_error`. `tangent_error` is by how much tangents
    and neighbouring motions disagree about what a period does to a disturbance, of the largest (see `floquet_of`).
    `residual` is the periodicity residual: how far the state is from itself after a period, in the scale of the motion.
    `amplitude` is half the peak-to-peak values (m, rad), the fractions are means over the period, and
    `main_coordinate` has most kinetic energy. The contact sticks as a whole in `sticking_phases` of a period, for
    `sticking_fraction` of it; each direction of slip that it loses then has a multiplier of zero. On a branch, `value`
    is the parameter and `what` happens there.
    `samples` holds one period.
    """

    period_s: float
    amplitude: dict[str, float]
    main_coordinate: str
    multipliers: Multipliers
    unit_multiplier_error: Number
    tangent_error: Number
    residual: Number
    contact_fraction: float
    slip_reversed_fraction: float
    sticking_fraction: float = 0.0
    sticking_phases: int = 0
    displacement: dict[str, float]
    velocity: dict[str, float]
    value: Number = np.nan
    what: Event | None = None
    samples: Any = Held
    model: Any = Held

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates that move."""
        return tuple(self.amplitude)

    @property
    def state(self) -> Vector:
        """Displacement from q = 0 and velocity (2n,)."""
        return np.array([*self.displacement.values(), *self.velocity.values()])

    @computed_field
    @property
    def frequency_Hz(self) -> float:
        """1/T (Hz)."""
        return 1 / self.period_s

    @property
    def largest(self) -> float:
        """The largest modulus of a multiplier: what a small disturbance is multiplied by in a period, at worst."""
        return float(np.abs(self.multipliers[0])) if self.multipliers.size else 0.0

    @property
    def unstable_directions(self) -> int:
        """How many multipliers lie outside the unit circle."""
        return int(np.sum(np.abs(self.multipliers) > 1))

    @computed_field
    @property
    def stable(self) -> bool:
        """Whether every small disturbance dies out."""
        return self.largest < 1

    @computed_field
    @property
    def neutral(self) -> bool:
        """Whether a multiplier is too near to the unit circle to be distinguished from one on it."""
        return abs(self.largest - 1) < NEUTRAL


def describe(shooting: Shooting, closed: Closed) -> Cycle:
    """Sample a closed motion over its period. Raises CycleError as `floquet_of` does, and beside grazing.

    That is where the sampled motion does not stick and slip at the times at which the flow does.
    """
    state, period, parameter = shooting.unscaled(closed.unknowns)
    model = shooting.models(parameter)[0]
    names, n = model.names, len(model.names)
    samples = _sample(model, state, period)
    _check_changes(samples, closed.flow, period)
    multipliers, unit_error, tangent_error = floquet_of(shooting, closed)
    observed = samples.observation
    moved, speed = samples.displacement, samples.velocity
    turns = (turning_points(samples.time, moved[:, k], speed[:, k])[1] for k in range(n))
    sizes = (float(np.ptp(np.concatenate([moved[:, k], values]))) / 2 for k, values in enumerate(turns))
    stuck = _sticking(closed.flow.changes, period)
    kinetic = np.asarray(model.mass) * np.mean(speed**2, axis=0)
    return Cycle(
        period_s=period,
        amplitude=dict(zip(names, sizes, strict=True)),
        main_coordinate=names[int(np.argmax(kinetic))],
        multipliers=multipliers,
        unit_multiplier_error=unit_error,
        tangent_error=tangent_error,
        residual=closed.residual,
        # Over one period of even samples the mean leaves out the last, which is the first again.
        contact_fraction=float(np.mean(observed.contact_fraction[:-1])),
        slip_reversed_fraction=float(np.mean(observed.slip_reversed_fraction[:-1])),
        sticking_fraction=sum(stuck) / period,
        sticking_phases=len(stuck),
        displacement=dict(zip(names, state[:n].tolist(), strict=True)),
        velocity=dict(zip(names, state[n:].tolist(), strict=True)),
        value=parameter,
        samples=samples,
        model=model,
    )


def _sample(model: Model, state: Vector, period: float) -> Chunk:
    """One period of even samples (k,), both ends included. Raises CycleError where it fails."""
    n = len(model.names)
    how: dict[str, Any] = {"duration": period, "sample_rate": SAMPLES / period, "tolerance": TOLERANCE}
    try:
        (chunk,) = integrate(model, np.zeros(n), state[:n], state[n:], solver="dopri8", **how)
    except (IntegrationError, ValueError) as error:
        raise CycleError(f"the motion cannot be sampled over its period: {error}") from None
    return chunk


def _check_changes(samples: Chunk, found: Flow, period: float) -> None:
    """Raise CycleError unless samples stick and slip as the flow does: they differ by errors that a period enlarges."""
    wanted = [(time, what is Change.STICKS) for time, what in found.changes if what is not Change.REVERSES]
    alike = len(wanted) == len(samples.changes) and all(
        sticks == begins and abs(time - when) < ASTRAY * period
        for (time, sticks), (when, begins) in zip(wanted, samples.changes, strict=True)
    )
    if not alike:
        raise CycleError(
            "the contact sticks or slips at other times when the same motion is integrated again: it nearly grazes "
            "a further change, and errors of integration decide"
        )


def _sticking(changes: tuple[tuple[float, Change], ...], period: float) -> list[float]:
    """How long (s) each phase of sticking lasts."""
    ends = [*(time for time, _ in changes), period][1:]
    return [end - time for (time, what), end in zip(changes, ends, strict=False) if what is Change.STICKS]


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
