"""A periodic motion as it was computed: one period of samples, Floquet multipliers, and whether it is stable."""

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, PlainSerializer, computed_field
from scipy.interpolate import CubicHermiteSpline

from drumsqueal.errors import CycleError, IntegrationError
from drumsqueal.findings.part import Finding, Held, Number
from drumsqueal.physics.model import Model
from drumsqueal.questions.cycle.shooting import TOLERANCE, Closed, Shooting, Vector
from drumsqueal.solve.transient.flow import neighbours
from drumsqueal.solve.transient.integrate import Chunk, integrate
from drumsqueal.solve.transient.state import CHUNK_SAMPLES

SAMPLES = CHUNK_SAMPLES  # of a period
ASTRAY = 1e-3  # of what a period does to a disturbance: neighbours are good to 1e-5 of it
NEUTRAL = 1e-6  # a multiplier that is this near to the unit circle is on it, for all that can be told


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
    """What happens at a cycle on a branch; at a corner slip just comes to reverse."""

    FOLD = "fold"
    NEIMARK_SACKER = "Neimark-Sacker"
    DOUBLING = "period doubling"
    BRANCHING = "branch point"
    CORNER = "corner"


class Cycle(Finding):
    """A periodic motion of a model: its period (s) and a state on it, displacement from q = 0 and velocity.

    `multipliers` are the Floquet multipliers, the largest first, without the trivial one that belongs to the motion
    along the cycle. That one must be 1; its error is `unit_multiplier_error`. `tangent_error` is by how much tangents
    and neighbouring motions disagree about what a period does to a disturbance, of the largest (see `floquet_of`).
    `residual` is the periodicity residual: how far the state is from itself after a period, in the scale of the motion.
    `amplitude` is half the peak-to-peak values (m, rad), the fractions are means over the period, and
    `main_coordinate` has most kinetic energy. On a branch, `value` is the parameter and `what` happens there.
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
        """Whether a multiplier is too near to the unit circle to tell."""
        return abs(self.largest - 1) < NEUTRAL


def describe(shooting: Shooting, closed: Closed) -> Cycle:
    """Sample a closed motion over its period.

    Raises CycleError where the lining sticks on it as a whole, and as `floquet_of` does.
    """
    state, period, parameter = shooting.unscaled(closed.unknowns)
    model = shooting.models(parameter)[0]
    names, values = model.names, state.tolist()
    samples = sample(model, state, period)
    multipliers, unit_error, tangent_error = floquet_of(shooting, closed)
    observed = samples.observation
    kinetic = np.asarray(model.mass) * np.mean(samples.velocity**2, axis=0)
    return Cycle(
        period_s=period,
        amplitude={name: _amplitude(samples, k) for k, name in enumerate(names)},
        main_coordinate=names[int(np.argmax(kinetic))],
        multipliers=multipliers,
        unit_multiplier_error=unit_error,
        tangent_error=tangent_error,
        residual=closed.residual,
        # Over one period of even samples the mean leaves out the last, which is the first again.
        contact_fraction=float(np.mean(observed.contact_fraction[:-1])),
        slip_reversed_fraction=float(np.mean(observed.slip_reversed_fraction[:-1])),
        displacement=dict(zip(names, values[: len(names)], strict=True)),
        velocity=dict(zip(names, values[len(names) :], strict=True)),
        value=parameter,
        samples=samples,
        model=model,
    )


def sample(model: Model, state: Vector, period: float) -> Chunk:
    """One period of even samples (k,), both ends included. Raises CycleError where the lining sticks as a whole."""
    n = len(model.names)
    how: dict[str, Any] = {"duration": period, "sample_rate": SAMPLES / period, "tolerance": TOLERANCE}
    try:
        (chunk,) = integrate(model, np.zeros(n), state[:n], state[n:], solver="dopri8", **how)
    except (IntegrationError, ValueError) as error:
        raise CycleError(f"the motion cannot be sampled over its period: {error}") from None
    if chunk.changes or chunk.observation.sticking.any():
        raise CycleError("the lining comes to rest on the drum as a whole: cycles that stick are not followed")
    return chunk


def floquet_of(shooting: Shooting, closed: Closed) -> tuple[NDArray[np.complex128], float, float]:
    """Multipliers, unit error and tangent error of a closed motion, as in `Cycle`.

    The multipliers are the tangents' where tangents and neighbours agree to 1e-3. Where they do not, as pairs of edges
    are born, the tangents may have been led astray; or the motion all but grazes an edge and the neighbours are on
    either side of it, where the flow has another derivative each. Then they do not carry the motion's own rate over a
    period into itself, and the tangents, of the side on which the motion is, hold. Raises CycleError where neighbours
    are lost.
    """
    _, period, parameter = shooting.unscaled(closed.unknowns)
    tangents, rate = closed.flow.transition, closed.flow.rate
    size, units = shooting.scales.state, np.eye(len(rate))
    beside = np.asarray(neighbours(shooting.models(parameter)[0], size, closed.unknowns[:-2], units, period)[1])
    if not np.all(np.isfinite(beside)):
        raise CycleError("motions beside it are not followed over a period")
    largest = np.max(np.abs(beside))
    tangent_error = float(np.max(np.abs(tangents - beside)) / largest)
    if tangent_error >= ASTRAY:
        # What nothing depends on comes back as it was but for round-off, of which `floquet` knows nothing.
        free = np.all(tangents == units, axis=0)
        multipliers, unit_error = floquet(np.where(free, units, beside), rate)
        if unit_error < ASTRAY * largest:
            return multipliers, unit_error, tangent_error
    return *floquet(tangents, rate), tangent_error


def floquet(transition: Vector, rate: Vector) -> tuple[NDArray[np.complex128], float]:
    """Eigenvalues of ∂y(T)/∂y(0) (2n, 2n), largest first, without that of the rate ẏ, and how far that one is from 1.

    In a basis that begins with ẏ/|ẏ| the matrix is [[1, *], [0, B]], and B has the others. A displacement that nothing
    depends on is left out: its multiplier is 1 whatever the motion.
    """
    units = np.eye(len(rate))
    held = [k for k in range(len(rate)) if not np.array_equal(transition[:, k], units[k])]
    matrix, along = transition[np.ix_(held, held)], rate[held] / np.linalg.norm(rate[held])
    unit_error = float(np.linalg.norm(matrix @ along - along))
    basis = np.linalg.qr(np.column_stack([along, np.eye(len(along))]))[0]
    multipliers = np.linalg.eigvals((basis.T @ matrix @ basis)[1:, 1:]).astype(np.complex128)
    return multipliers[np.lexsort((-multipliers.imag, -np.abs(multipliers)))], unit_error


def _amplitude(samples: Chunk, k: int) -> float:
    """Half the peak-to-peak value of coordinate k, of the cubic through displacements and velocities."""
    curve = CubicHermiteSpline(samples.time, samples.displacement[:, k], samples.velocity[:, k])
    turns = curve.derivative().roots(extrapolate=False)
    values = np.concatenate([samples.displacement[:, k], curve(turns[np.isfinite(turns)])])
    return float(np.ptp(values) / 2)
