"""Floquet multipliers of a closed motion: what a period does to small disturbances of it."""

import numpy as np
import scipy
from numpy.typing import NDArray

from drumsqueal.errors import CycleError
from drumsqueal.solve.cycles.shooting import Closed, Shooting, Vector
from drumsqueal.solve.transient.flow import APART, neighbours

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
