"""What effects, contact and solvers ask of a body: the names of its coordinates, its mass and how its surface moves.

Displacements, velocities and generalised forces have one entry for each coordinate that is kept, in the order of
`names`. A tuple of scalars may hold literal zeros, which cost nothing when compiled.
"""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from drumsqueal.physics.quadrature.levels import Level
from drumsqueal.physics.quadrature.surface import Densities, Lining, Nodes

Scalar = Array | float
Motion = tuple[Scalar, ...] | Array
"""One entry for each kept coordinate: displacements, velocities or generalised forces."""


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
    def following(self) -> Motion:
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


class LinedBody(Body, Lining, Protocol):
    """A body whose lining rubs on a drum; its surface moves by levels, constant + cosine + sine on each line."""

    def radial(self, q: Motion) -> Level:
        """u_r of the lining (m)."""
        ...

    def along(self, v: Motion, turning: Scalar = 0.0) -> Level:
        """u_θ of the lining (m), or its rate relative to a drum that turns at some speed (rad/s)."""
        ...

    def axial(self, v: Motion) -> Level:
        """u_z of the lining (m), or its rate."""
        ...

    def displacement(
        self, q: Mapping[str, ArrayLike], angle: ArrayLike, z: ArrayLike = 0.0, radius: ArrayLike | None = None
    ) -> tuple:
        """(u_r, u_θ, u_z) at angles (rad), z and a radius (m; the lining's unless given), of coordinates by name."""
        ...

    def tractions(self, nodes: Nodes, load: Array, drag: Array | None, lateral: Array | None) -> Densities:
        """What is summed over the nodes: load, drag along θ and lateral force along z are in N."""
        ...

    def resultant(self, total: Densities) -> Motion:
        """Generalised force of the summed tractions and the summed drag, the transpose of the shape functions."""
        ...

    def radial_resultant(self) -> Motion:
        """∫ φ^r dA: the generalised force of unit pressure is its negative."""
        ...

    def tangential_resultant(self) -> Motion:
        """∫ φ^θ dA: the generalised force of unit traction along θ."""
        ...

    def radial_stiffness(self) -> Array:
        """∫ φ^r φ^r dA, shape (n, n): the stiffness of full contact per unit contact stiffness."""
        ...


def displace(body: LinedBody, q: Mapping[str, Any], x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
    """(u_x, u_y, u_z) of points of a body (m, from the drum's axis), of coordinates by name, zero where not named."""
    angle = np.arctan2(y, x)
    radial, along, axial = body.displacement(q, angle, z, np.hypot(x, y))
    cosine, sine = np.cos(angle), np.sin(angle)
    return radial * cosine - along * sine, radial * sine + along * cosine, axial


def dot(force: Motion, motion: Motion) -> Scalar:
    """Power of a generalised force at a velocity, or its work along a displacement."""
    return sum(f * x for f, x in zip(force, motion, strict=True))


def scalars(motion: Array) -> Motion:
    """The entries of an array (n,), one by one: what a body then leaves out of its sums is not in the program."""
    return tuple(motion[k] for k in range(motion.shape[0]))
