"""Whether a motion that has not settled decays to rest: whether it is below the contact boundaries and falls."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import jax
import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.signals.regime import Cause, Regime
from drumsqueal.findings.vibration import Vibration, boundary_ratio, changes
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.branches import Point
from drumsqueal.solve.linear.modes import (
    NEUTRAL_FRACTION,
    Mode,
    Stability,
    growing_without_oscillation,
    solve_modes,
    without_oscillation,
)
from drumsqueal.solve.linear.steady import sliding_near
from drumsqueal.solve.transient.state import least_energy

# Where a motion comes to rest: in steady sliding, or elsewhere, in another equilibrium of the model.
#
# Between two samples the momentum changes by the impulse of the forces. Near steady sliding that is the impulse of the
# linear springs and dashpots about it; at rest elsewhere these pull, and nothing moves.


class Rest(NamedTuple):
    """Whether a motion is near steady sliding, led by the linear model; else the equilibrium elsewhere where it rests.

    `elsewhere` (n,) is measured from steady sliding, None where it rests nowhere else, moves, or is where small motion
    grows. `linear` is the rate (1/s) of what decays slowest about it.
    """

    near: bool
    elsewhere: NDArray[np.float64] | None = None
    linear: float = -np.inf


def falls_as_small(rate: float, linear: float) -> bool:
    """Whether a motion that changes at this rate (1/s) falls at least half as fast as a small one, at `linear`."""
    return rate < Criteria.nearly_linear * linear


def rate_of_halves(before: float, after: float, seconds: float) -> float:
    """Growth rate (1/s) of the rms by the mean squares in both halves of so many seconds; 0 where nothing moves.

    That is half the logarithm of their ratio over half the time.
    """
    return math.log(after / before) / seconds if min(before, after) > 0 else 0.0


def find_rest(
    model: Model,
    steady: NDArray[np.float64],
    matrix: NDArray[np.float64],
    pieces: Iterable[tuple[NDArray[np.float64], NDArray[np.float64]]],
    step: float,
) -> Rest:
    """Find whether a motion is near steady sliding q* (n,), or rests elsewhere.

    `matrix` (2n, 2n) is that of the linear model there, and `pieces` are displacements from q* and velocities (k, n),
    sampled a `step` (s) apart. What drives a model that changes with time, or keeps it moving, is not looked at.
    """
    if model.forced or model.remembering or not model.operation.constant:
        return Rest(near=True)
    n, root = len(steady), np.sqrt(np.asarray(model.mass))
    springs, dashpots = (-matrix[n:, part] * root[:, None] for part in (slice(n), slice(n, None)))
    departure = moves = pull = 0.0
    least, ends = np.inf, np.zeros((2, n))  # where the springs pull least, and most
    twice_kinetic = [np.zeros(0)]  # energies (J)
    for displacement, velocity in pieces:
        gained, moved = np.diff(velocity, axis=0), np.diff(displacement, axis=0)
        twice_kinetic.append(velocity**2 @ root**2)
        if not len(gained):
            continue
        # Means between two samples by the cubic through displacements and velocities: to the fourth order.
        means = (displacement[:-1] + displacement[1:]) / 2 - step / 12 * gained
        impulse, answer = step * means @ springs.T, gained * root + moved @ dashpots.T
        pulls = np.linalg.norm(impulse, axis=1)
        departure = max(departure, np.linalg.norm(impulse + answer, axis=1).max())
        moves = max(moves, np.linalg.norm(answer, axis=1).max())
        if pulls.min() < least:
            least, ends[0] = pulls.min(), means[pulls.argmin()]
        if pulls.max() > pull:
            pull, ends[1] = pulls.max(), means[pulls.argmax()]
    if departure <= Criteria.led * max(pull, moves):
        return Rest(near=True)
    energy, resolved = np.concatenate(twice_kinetic), float(least_energy(model))
    stored = abs((ends[1] * root) @ springs @ ends[1]) / 2
    if max(stored, energy.max()) < resolved:
        return Rest(near=True)
    # 0.1 of the impulse of the linear springs: only where what moves is less is an equilibrium looked for
    found = Rest(near=False) if moves > 0.1 * pull else _find_equilibrium(model, steady, springs, ends)
    before, after = (float(half.mean()) for half in np.array_split(energy, 2))
    rate = rate_of_halves(before, after, len(energy) * step)
    # Where it neither stands still nor falls as small motion about the place does, it may swing there for ever.
    rests = after < max(resolved, Criteria.steady**2 * stored) or (
        found.linear < 0 and falls_as_small(rate, found.linear)
    )
    return found if rests else Rest(near=False)


def _find_equilibrium(
    model: Model, steady: NDArray[np.float64], springs: NDArray[np.float64], ends: NDArray[np.float64]
) -> Rest:
    """The equilibrium that Newton's method comes to from both ends of a motion, where it is stable and another."""
    stiffness = springs * np.sqrt(np.asarray(model.mass))[:, None]
    own, load = np.abs(np.diag(stiffness)), np.abs(stiffness @ ends[1])
    one, other = (jax.tree.map(np.asarray, sliding_near(model, steady + end, own, load)) for end in ends)
    place, apart = one[0] - steady, one[0] - other[0]
    most = Criteria.same_place * np.linalg.norm(springs @ ends[1])
    if not np.linalg.norm(springs @ apart) <= most or np.linalg.norm(springs @ place) <= most:
        return Rest(near=False)
    eigenvalues, modes = solve_modes(model.names, np.asarray(model.mass), one[1].state_matrix())
    grows = growing_without_oscillation(eigenvalues) is not None or any(mode.unstable for mode in modes)
    return Rest(near=False, elsewhere=None if grows else place, linear=float(np.max(eigenvalues.real)))


def is_decaying(fraction: float, rate: float, linear: float) -> bool:
    """Whether a motion at this fraction of the contact boundaries that changes at this rate (1/s) decays.

    Within a tenth of the contact boundaries it must fall, below them at least half as fast as the slowest mode at
    `linear` (1/s).
    """
    return (fraction < Criteria.small and rate < 0) or (fraction < Criteria.beyond and falls_as_small(rate, linear))


class Slowest(NamedTuple):
    """What is least stable: its label, its growth rate (1/s), and the frequency (Hz) that sets how long a record is."""

    label: str
    rate: float
    frequency_Hz: float


def least_stable(about: Stability | Point, modes: Sequence[Mode]) -> Slowest:
    """Of these modes, and of what does not oscillate, what grows fastest or else decays slowest; without any, a rate 0.

    What decays without oscillation counts where nothing oscillates about steady sliding, in a time 1/|λ|.
    """
    found, rate = [Slowest(mode.label, mode.growth_rate, mode.frequency_Hz) for mode in modes], about.divergence
    if rate is None and not about.modes:
        rate = max(without_oscillation(about.eigenvalues).tolist(), default=0.0)
        rate = rate if rate < -NEUTRAL_FRACTION * np.max(np.abs(about.eigenvalues), initial=0.0) else None
    found += [] if rate is None else [Slowest("the overdamped motion", rate, abs(rate) / math.tau)]
    return max(found, key=lambda each: each.rate, default=Slowest("", 0.0, 0.0))


def slowest(about: Stability | Point, modes: Sequence[Mode]) -> Slowest | None:
    """The least stable of these modes and of what does not oscillate; None unless all of it decays."""
    found = least_stable(about, modes)
    return found if found.rate < -NEUTRAL_FRACTION * found.frequency_Hz else None


def decay_to_rest(
    regime: Regime, vibration: Vibration, part: slice, stability: Stability, modes: Sequence[Mode], model: Model
) -> Regime:
    """Return the regime of a part of the record, steady where what had not settled decays to rest.

    `modes` are those that take part; all of them must decay. Rest stays rest, and what is left of it grows no more: its
    round-off is no irregular motion. What rests elsewhere than in steady sliding is steady, too, and its place is in
    the numbers, by the coordinates.
    """
    if regime.kind is Kind.PERIODIC or model.forced or changes(model, vibration.time[part]):
        return regime
    known, fraction = slowest(stability, modes), 0.0
    if known is not None:
        part, fraction = _below_boundaries(vibration, part, known, model)
    if regime.kind.squeals and (known is None or fraction >= Criteria.steady):
        return regime
    pieces = ((displacement, velocity) for _, displacement, velocity in vibration.pieces(part))
    rest = find_rest(model, stability.steady_state, stability.matrix, pieces, 1 / vibration.sample_rate)
    if rest.elsewhere is not None:
        place = dict(zip(stability.coordinates, rest.elsewhere.tolist(), strict=True))
        return Regime(kind=Kind.STEADY, cause=Cause.RESTS_ELSEWHERE, numbers=place)
    if known is None or not rest.near:
        return regime
    if regime.kind is Kind.STEADY or fraction < Criteria.steady:
        return _steady(regime, Cause.RESIDUAL_MOTION, known, boundary_fraction=fraction)
    rate = _rate(vibration, part, stability.mass)
    if not is_decaying(fraction, rate, known.rate):
        return regime
    return _steady(regime, Cause.DECAYS, known, rate_1_per_s=rate)


def _below_boundaries(vibration: Vibration, part: slice, slow: Slowest, model: Model) -> tuple[slice, float]:
    """The part from where the motion came below the boundaries on, if that lasts for long enough; its largest ratio."""
    first, stop, _ = part.indices(vibration.time.size)
    ratio = boundary_ratio(vibration, model)[first:stop]
    since = int(np.max(np.flatnonzero(ratio >= Criteria.beyond), initial=-1)) + 1
    if (ratio.size - since) * slow.frequency_Hz > Criteria.periods * vibration.sample_rate:
        ratio, part = ratio[since:], slice(first + since, stop)
    return part, float(ratio.max())


def _steady(regime: Regime, cause: Cause, slow: Slowest, **numbers: float) -> Regime:
    numbers["mode_growth_rate_1_per_s"] = slow.rate
    drift = regime.amplitude_drift
    return Regime(kind=Kind.STEADY, cause=cause, numbers=numbers, mode=slow.label, amplitude_drift=drift)


def _rate(vibration: Vibration, part: slice, mass: NDArray[np.float64]) -> float:
    first, stop, _ = part.indices(vibration.time.size)
    half = first + (stop - first) // 2
    before, after = (vibration.mean_square_velocity(each) for each in (slice(first, half), slice(half, stop)))
    return rate_of_halves(float(mass @ before), float(mass @ after), (stop - first) / vibration.sample_rate)
