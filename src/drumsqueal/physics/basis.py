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
from drumsqueal.physics.bodies.rigid_shoe import Support
from drumsqueal.physics.effects.points import against
from drumsqueal.physics.shoes import along_points, build_shoe
from drumsqueal.physics.structure import Composition

Reals = NDArray[np.float64]

# Of a mode of the brake, the root of the fraction of its strain energy: directions in which no mode has more are left
# out. With half of it, growth rates of the shipped brakes change by less than 0.2 of 1 1/s or 1 %.
NEGLIGIBLE = 0.02
STILL = 1e-6  # of the highest frequency: what nothing holds, and which strains nothing


class Part(NamedTuple):
    """A body's places among the coordinates of the brake (m,), and its own frequencies (m,) in rad/s there."""

    places: NDArray[np.int64]
    own: Reals


@Interpreted
def frictionless(composition: Composition, value: Mapping[str, Array]) -> tuple[Array, Array]:
    """Mass (n,) and stiffness (n, n) of one shoe in full contact, without what the bodies' own modes are held by."""
    shoe = build_shoe(composition, value)
    springs, _ = along_points(composition, value, shoe)
    stiffness = value["contact.stiffness"] * shoe.radial_stiffness()
    if composition.springs:
        strengths = jnp.stack([value[f"shoe.spring.{k}.stiffness"] for k in range(composition.springs)])
        stiffness = stiffness + against(springs, strengths)
    if composition.support:
        stiffness = (
            stiffness + Support(*(value[f"support.{side}_stiffness"] for side in ("upper", "lower")), shoe).stiffness()
        )
    return shoe.mass, stiffness


def brakes_modes(mass: Reals, stiffness: Reals, highest: float) -> tuple[Reals, Reals]:
    """Circular frequencies (k,) up to the highest, and shapes (n, k) of unit mass; none of what nothing holds."""
    scale = 1 / np.sqrt(mass)
    squares, shapes = scipy.linalg.eigh(scale[:, None] * stiffness * scale, subset_by_value=(-np.inf, highest**2))
    moving = squares > (STILL * highest) ** 2
    return np.sqrt(squares[moving]), scale[:, None] * shapes[:, moving]


def yielding(part: Part, count: int, modes: tuple[Reals, Reals], groups: NDArray[Any]) -> Iterator[Reals]:
    """Sums (m, k) of a body's trial shapes beyond its first modes, for each of its groups of shapes (m,).

    Orthonormal, and diagonal in the body's own stiffness.
    """
    frequencies, shapes = modes
    for group in np.unique(groups):
        mine = np.flatnonzero((groups == group) & (np.arange(len(groups)) >= count))
        own = part.own[mine]
        # By strain energy: a mode of unit mass has ω²/2 of it in all.
        directions, sizes, _ = np.linalg.svd(
            own[:, None] * shapes[part.places[mine]] / frequencies, full_matrices=False
        )
        found = np.linalg.qr(directions[:, sizes > NEGLIGIBLE] / own[:, None])[0]
        found = found @ np.linalg.eigh(found.T @ (own[:, None] ** 2 * found))[1]
        whole = np.zeros((len(groups), found.shape[1]))
        whole[mine] = found
        yield whole
