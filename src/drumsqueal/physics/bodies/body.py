"""What effects, contact and solvers ask of a body: the names of its coordinates, its mass and how its surface moves.

Displacements, velocities and generalised forces have one entry for each coordinate that is kept, in the order of
`names`. A tuple of scalars may hold literal zeros, which cost nothing when compiled.
"""

from collections.abc import Mapping
from typing import Any, Protocol

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

Scalar = Array | float
Motion = tuple[Scalar, ...] | Array
"""One entry for each kept coordinate: displacements, velocities or generalised forces."""
WRITTEN_OUT = 6  # coordinates, one by one, at most


class Body(Protocol):
    """What moves, whatever its shape."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the kept coordinates."""
        ...

    @property
    def mass(self) -> Any:
        """Diagonal of the mass matrix (n,)."""
        ...

    @property
    def symmetric(self) -> tuple[bool, ...]:
        """Which coordinates move every line across the sliding direction alike: the others rest in steady sliding."""
        ...

    @property
    def area(self) -> Any:
        """What the preload acts on (m²): its force over the preload."""
        ...

    @property
    def velocity_with_drum(self) -> Motion:
        """Velocities that move with a drum of 1 rad/s, or a belt of 1 m/s, as well as the kept coordinates can."""
        ...

    @property
    def follows(self) -> bool:
        """Whether the kept coordinates can move so."""
        ...

    def slides(self, *, axially: bool) -> tuple[bool, ...]:
        """Which coordinates move what is rubbed along the sliding direction or, if asked, also across it."""
        ...

    def largest(self, q: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bounds of the displacement into what rubs on the body, and along it, anywhere in the contact.

        `q` has displacements (m, rad) or velocities by name, zero where not named.
        """
        ...

    def surface(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Displacement into what rubs on the body, and along it, of points spread over the contact (points, n), each.

        One column a coordinate, for 1 m or 1 rad of it.
        """
        ...


def cartesian(displacement: tuple, angle: Any) -> tuple[Any, Any, Any]:
    """(u_x, u_y, u_z) from (u_r, u_θ, u_z) at angles (rad)."""
    radial, along, axial = displacement
    cosine, sine = np.cos(angle), np.sin(angle)
    return radial * cosine - along * sine, radial * sine + along * cosine, axial


def dot(force: Motion, motion: Motion) -> Scalar:
    """Power of a generalised force at a velocity, or its work along a displacement."""
    if isinstance(force, tuple):
        return sum(f * x for f, x in zip(force, motion, strict=True))
    return jnp.sum(force * whole(motion))


def scalars(motion: Array) -> Motion:
    """The entries of an array (n,), one by one: what a body then leaves out of its sums is not in the program.

    Beyond six it stays an array, for the time to compile grows with all that is written out.
    """
    return tuple(jnp.unstack(motion)) if motion.shape[0] <= WRITTEN_OUT else motion


def whole(motion: Motion) -> Array:
    """The array (n,) of entries one by one, literal zeros among them."""
    return jnp.stack([each + jnp.zeros(()) for each in motion]) if isinstance(motion, tuple) else motion


def times(factor: Scalar, motion: Motion) -> Motion:
    """A multiple of a motion or of a force."""
    return tuple(factor * each for each in motion) if isinstance(motion, tuple) else factor * motion


def opposite(motion: Motion) -> Motion:
    """A motion or a force the other way."""
    return tuple(-each for each in motion) if isinstance(motion, tuple) else -motion


def add(*motions: Motion) -> Motion:
    """The sum of motions or forces."""
    if all(isinstance(each, tuple) for each in motions):
        return tuple(sum(parts) for parts in zip(*motions, strict=True))
    return sum(whole(each) for each in motions)  # pyright: ignore[reportReturnType]


def product(matrix: Array, motion: Motion) -> Motion:
    """A matrix (m, n) times a motion (n,): (m,)."""
    if isinstance(motion, tuple):
        return tuple(sum(a * x for a, x in zip(matrix[k], motion, strict=True)) for k in range(matrix.shape[0]))
    return jnp.sum(matrix * motion, axis=1)
