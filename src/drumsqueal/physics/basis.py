"""In which shapes a body of a brake bends: its own modes, and how else it yields in the modes of the whole brake.

The lining's stiffness dents shoe and drum where they touch, and so do springs. A body's own modes build a dent slowly:
none of them has forces on its surface. So what is kept besides comes from the modes of the frictionless brake with its
lining in full contact, up to the same frequency: each mode's part in the body, as far as its own modes do not hold it.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jax import Array
from numpy.typing import NDArray

from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.bodies.rigid_shoe import Support
from drumsqueal.physics.shoes import along_points, build_shoe, spring_matrix
from drumsqueal.physics.structure import Composition

Reals = NDArray[np.float64]

# Of motions of the brake, the root of the fraction of their energy: directions in which they have no more are left out.
# With half of it, growth rates of elastic_drum up to 8 kHz change by 0.1 1/s.
NEGLIGIBLE = 0.02
STILL = 1e-4  # of the highest frequency: what nothing holds, and which strains nothing
# Steady sliding decides which part of the lining touches, and growth rates with it: it is to be five times as exact as
# modes are, for coefficients of friction of which the fourth power is nothing.
STEADY, DRAGS = 5.0, 4


class Part(NamedTuple):
    """A body's places among the coordinates of the brake (m,), and its own frequencies (m,) in rad/s there."""

    places: NDArray[np.int64]
    own: Reals


class Side(NamedTuple):
    """One shoe with the drum under it, over their trial shapes: what acts but for what holds the bodies' own modes.

    Mass (n,), stiffness (n, n) of springs and of the lining in full contact; `drag` (n, n), the force along the arc of
    that lining's pressure; and `loads` (k, n), forces of 1 N and an even pressure of 1 Pa, that move it steadily.
    """

    mass: Any
    stiffness: Any
    drag: Any
    loads: Any


@Interpreted
def side_of(composition: Composition, value: Mapping[str, Array]) -> Side:
    """Find these of a composition; loads only where its steady state is not that of even pressure."""
    shoe, law = build_shoe(composition, value), value["contact.stiffness"]
    springs, pushes = along_points(composition, value, shoe)
    stiffness = law * shoe.radial_stiffness()
    if composition.springs:
        stiffness = stiffness + spring_matrix(composition, value, springs, "stiffness")
    if composition.support:
        support = Support(value["support.upper_stiffness"], value["support.lower_stiffness"], shoe)
        stiffness = stiffness + support.stiffness()
    assert isinstance(shoe, ElasticShoe)  # as one of several shoes, or one that bends, is
    drag = law * (shoe.sampled[1] * shoe.weights) @ shoe.sampled[0].T
    loads = jnp.zeros((0, len(shoe.names)))
    if composition.steady_state != "uniform-pressure":
        loads = jnp.concatenate([pushes, (shoe.sampled[0] @ shoe.weights)[None]])
    return Side(shoe.mass, stiffness, drag, loads)


def motions(whole: Side, highest: float) -> Reals:
    """What a brake does, of unit energy in its stiffness each (n, k): its modes up to a frequency, and steady sliding.

    Of steady sliding what answers to the loads without friction, to the drag of that, and so on: their sums are its
    steady states at any coefficient of friction.
    """
    scale = 1 / np.sqrt(whole.mass)
    limits = -np.inf, highest**2
    squares, shapes = scipy.linalg.eigh(scale[:, None] * whole.stiffness * scale, subset_by_value=limits)
    moving = squares > (STILL * highest) ** 2
    found = [scale[:, None] * shapes[:, moving] / np.sqrt(squares[moving])]
    held = scipy.linalg.cho_factor(whole.stiffness + np.diag(whole.mass) * (STILL * highest) ** 2)
    steady = scipy.linalg.cho_solve(held, whole.loads.T)
    for _ in range(DRAGS * (len(whole.loads) > 0)):
        energies = np.sum(steady * (whole.stiffness @ steady), axis=0)
        steady = steady[:, energies > 0] / np.sqrt(energies[energies > 0])  # none where nothing drags
        found.append(STEADY * steady)
        steady = scipy.linalg.cho_solve(held, whole.drag @ steady)
    return np.concatenate(found, axis=1)


def yielding(part: Part, count: int, stiffness: Reals, moved: Reals, groups: NDArray[Any]) -> Iterator[Reals]:
    """Sums (m, k) of a body's trial shapes beyond its first modes, for each of its groups of shapes (m,).

    Orthonormal, and diagonal in the body's own stiffness. `stiffness` (n, n) and motions `moved` (n, j) of unit energy
    are those of the brake.
    """
    for group in np.unique(groups):
        mine = np.flatnonzero((groups == group) & (np.arange(len(groups)) >= count))
        places = part.places[mine]
        # By energy: what a body's part stores, and what it stores in lining and springs.
        root = np.linalg.cholesky(stiffness[np.ix_(places, places)])
        directions, sizes, _ = np.linalg.svd(root.T @ moved[places], full_matrices=False)
        found = scipy.linalg.solve_triangular(root.T, directions[:, sizes > NEGLIGIBLE])
        found = np.linalg.qr(found)[0]
        found = found @ np.linalg.eigh(found.T @ (part.own[mine][:, None] ** 2 * found))[1]
        whole = np.zeros((len(groups), found.shape[1]))
        whole[mine] = found
        yield whole
