"""The rigid motion of a shoe that is given as a solid mesh: its inertia, about principal axes of its own."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.bodies.body import Motion, Scalar
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe, Six
from drumsqueal.precision import real

TURNS = ("Tx", "Ty", "Tz")


class RigidMesh(RigidShoe):
    """A shoe of which only the lining is a sector's: mass m (kg), centre (3,) in m, moments (3,) about `axes` (3, 3).

    X, Y and Z are displacements of the centre along x, y and z; Tx, Ty and Tz are rotations about the principal axes,
    the columns of `axes`, which are those nearest to x, y and z: so the mass matrix is diagonal.
    """

    m: Array = eqx.field(converter=real, kw_only=True)
    centre: Array = eqx.field(converter=real, kw_only=True)
    moments: Array = eqx.field(converter=real, kw_only=True)
    axes: Array = eqx.field(converter=real, kw_only=True)

    @property
    def centroid(self) -> Array:
        """How far the centre of gravity is from the drum's axis along x (m)."""
        return self.centre[0]

    @property
    def inertia(self) -> Six:
        """Mass and principal moments of inertia."""
        return Six(self.m, self.m, self.m, *self.moments)

    @property
    def following(self) -> Motion:
        """Velocities of a shoe that turns with a drum of 1 rad/s."""
        return self.keep(Six(-self.centre[1], self.centre[0], 0.0, *self.axes[2]))

    def displacement(
        self, q: Mapping[str, ArrayLike], angle: ArrayLike, z: ArrayLike = 0.0, radius: ArrayLike | None = None
    ) -> tuple:
        """(u_r, u_θ, u_z) at angles (rad), z and a radius (m; the lining's unless given), of coordinates by name."""
        of_jax = isinstance(angle, Array)
        trigonometry = jnp if of_jax else np
        centre, axes, R = (each if of_jax else np.asarray(each) for each in (self.centre, self.axes, self.outer_radius))
        radius = R if radius is None else radius
        cosine, sine = trigonometry.cos(angle), trigonometry.sin(angle)
        arm = radius * cosine - centre[0], radius * sine - centre[1], z - centre[2]
        turn: list[Any] = [sum(q[name] * axes[k, j] for j, name in enumerate(TURNS) if name in q) for k in range(3)]
        x, y, axial = (
            q.get(name, 0.0) + turn[k - 2] * arm[k - 1] - turn[k - 1] * arm[k - 2] for k, name in enumerate("XYZ")
        )
        return x * cosine + y * sine, y * cosine - x * sine, axial

    def shapes_at(self, point: Array, radius: Scalar = 0.0) -> Array:
        """Displacements (u_x, u_y, u_z) of a point (3,) in m for 1 m or 1 rad of each coordinate, (3, n)."""
        del radius
        turned = jnp.cross(self.axes.T, point - self.centre).T
        every: dict[str, Array] = dict(
            zip(("X", "Y", "Z", *TURNS), jnp.concatenate([jnp.eye(3), turned], axis=1).T, strict=True)
        )
        return jnp.stack([every[name] for name in self.names], axis=1)
