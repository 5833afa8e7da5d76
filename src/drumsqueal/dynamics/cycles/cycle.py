"""A periodic motion as it is found: one period of it, its Floquet multipliers, and whether it is stable."""

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, PlainSerializer, computed_field

from drumsqueal.errors import CycleError, IntegrationError
from drumsqueal.findings.schema import Finding, Held, Number
from drumsqueal.findings.vibration import amplitudes_apart
from drumsqueal.physics.model import Model
from drumsqueal.solve.cycles.floquet import ASTRAY, NEUTRAL, floquet_of
from drumsqueal.solve.cycles.shooting import TOLERANCE, Closed, Shooting, ShootingStart, Vector
from drumsqueal.solve.motion import turning_points
from drumsqueal.solve.transient.flow import Flow, StickTransition, slip_speeds
from drumsqueal.solve.transient.integrate import Chunk, integrate
from drumsqueal.solve.transient.state import CHUNK_SAMPLES

SAME = 0.02  # relative difference in period and amplitudes of what is taken for the same cycle


def cut_in_slip(model: Model, start: ShootingStart) -> ShootingStart:
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
    Two branches cross at a transcritical point, where they exchange stability, and at a pitchfork point, where one of
    them folds, mostly as its cycles have lost a symmetry of the other's. A branch point is either, or a fold, where it
    was not found out which.
    """

    FOLD = "fold"
    NEIMARK_SACKER = "Neimark-Sacker"
    DOUBLING = "period doubling"
    BRANCHING = "branch point"
    TRANSCRITICAL = "transcritical point"
    PITCHFORK = "pitchfork point"
    CORNER = "corner"
    GRAZING = "grazing"

    @property
    def in_words(self) -> str:
        """Its name within a sentence."""
        return f"{self} point" if self is Event.NEIMARK_SACKER else str(self)


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
    `samples` holds one period, and `crossing` the direction (2n + 2,) in which another branch goes through it: of the
    state, the period and the parameter, the latter exactly zero where that branch folds, at a pitchfork point.
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
    crossing: Any = Held

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


def unlike(one: Cycle, period: float, amplitude: Mapping[str, float]) -> float:
    """By how much a cycle and a motion of a period (s) and amplitudes (m, rad) differ: the largest |ln| of a ratio."""
    return max(abs(math.log(one.period_s / period)), amplitudes_apart(one.amplitude, amplitude, one.model.mass))


def off_between(a: Cycle, b: Cycle, value: float, period: float, amplitude: Mapping[str, float]) -> float:
    """By how much a motion at a value differs from what lies there on the way from one cycle to another, as `unlike`.

    Infinite where the value is not between theirs.
    """
    if a.value == b.value or (a.value - value) * (b.value - value) > 0:
        return math.inf
    fraction = (value - a.value) / (b.value - a.value)
    sizes = {name: (1 - fraction) * size + fraction * b.amplitude[name] for name, size in a.amplitude.items()}
    middle = {"period_s": (1 - fraction) * a.period_s + fraction * b.period_s, "amplitude": sizes}
    return unlike(a.model_copy(update=middle), period, amplitude)


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
    how: dict[str, Any] = {"duration": period, "sample_rate": CHUNK_SAMPLES / period, "tolerance": TOLERANCE}
    try:
        (chunk,) = integrate(model, np.zeros(n), state[:n], state[n:], solver="dopri8", **how)
    except (IntegrationError, ValueError) as error:
        raise CycleError(f"the motion cannot be sampled over its period: {error}") from None
    return chunk


def _check_changes(samples: Chunk, found: Flow, period: float) -> None:
    """Raise CycleError unless samples stick and slip as the flow does: they differ by errors that a period enlarges."""
    wanted = [
        (time, what is StickTransition.STICKS) for time, what in found.changes if what is not StickTransition.REVERSES
    ]
    alike = len(wanted) == len(samples.changes) and all(
        sticks == begins and abs(time - when) < ASTRAY * period
        for (time, sticks), (when, begins) in zip(wanted, samples.changes, strict=True)
    )
    if not alike:
        raise CycleError(
            "the contact sticks or slips at other times when the same motion is integrated again: it nearly grazes "
            "a further change, and errors of integration decide"
        )


def _sticking(changes: tuple[tuple[float, StickTransition], ...], period: float) -> list[float]:
    """How long (s) each phase of sticking lasts."""
    ends = [*(time for time, _ in changes), period][1:]
    return [end - time for (time, what), end in zip(changes, ends, strict=False) if what is StickTransition.STICKS]
