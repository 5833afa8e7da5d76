"""Where a motion comes to rest: in steady sliding, or elsewhere, in another equilibrium of the model.

Between two samples the momentum changes by the impulse of the forces. Near steady sliding that is the impulse of the
linear springs and dashpots about it; at rest elsewhere these pull, and nothing moves.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import jax
import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.signals.regime import STEADY
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import growing_without_oscillation, solve_modes
from drumsqueal.solve.linear.steady import sliding_near
from drumsqueal.solve.transient.resolution import least_energy

# Of the largest impulse: what departs less from the linear one is led by it. At another equilibrium, and at the one
# that lies between, nothing pulls, so that the departure is all of the linear impulse: this is halfway there.
LED = 0.5
HARDLY = 0.1  # of the impulse of the linear springs: only where what moves is less is an equilibrium looked for
NEARLY_LINEAR = 0.5  # of the linear rate: what decays so fast is led by the linear model
SAME = 1e-6  # of the pull of the linear springs: equilibria that Newton's method finds agree to 1e-13 of it


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
    return rate < NEARLY_LINEAR * linear


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
    if departure <= LED * max(pull, moves):
        return Rest(near=True)
    energy, resolved = np.concatenate(twice_kinetic), float(least_energy(model))
    stored = abs((ends[1] * root) @ springs @ ends[1]) / 2
    if max(stored, energy.max()) < resolved:
        return Rest(near=True)
    found = Rest(near=False) if moves > HARDLY * pull else _find_equilibrium(model, steady, springs, ends)
    before, after = (float(half.mean()) for half in np.array_split(energy, 2))
    rate = rate_of_halves(before, after, len(energy) * step)
    # Where it neither stands still nor falls as small motion about the place does, it may swing there for ever.
    rests = after < max(resolved, STEADY**2 * stored) or (found.linear < 0 and falls_as_small(rate, found.linear))
    return found if rests else Rest(near=False)


def _find_equilibrium(
    model: Model, steady: NDArray[np.float64], springs: NDArray[np.float64], ends: NDArray[np.float64]
) -> Rest:
    """The equilibrium that Newton's method comes to from both ends of a motion, where it is stable and another."""
    stiffness = springs * np.sqrt(np.asarray(model.mass))[:, None]
    own, load = np.abs(np.diag(stiffness)), np.abs(stiffness @ ends[1])
    one, other = (jax.tree.map(np.asarray, sliding_near(model, steady + end, own, load)) for end in ends)
    place, apart = one[0] - steady, one[0] - other[0]
    most = SAME * np.linalg.norm(springs @ ends[1])
    if not np.linalg.norm(springs @ apart) <= most or np.linalg.norm(springs @ place) <= most:
        return Rest(near=False)
    eigenvalues, modes = solve_modes(model.names, np.asarray(model.mass), one[1].state_matrix())
    grows = growing_without_oscillation(eigenvalues) is not None or any(mode.unstable for mode in modes)
    return Rest(near=False, elsewhere=None if grows else place, linear=float(np.max(eigenvalues.real)))
