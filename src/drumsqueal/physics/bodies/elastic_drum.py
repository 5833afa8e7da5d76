"""The drum that bends: how its modes move the surface that a lining rubs on, while it turns under them.

The drum is a body of revolution, so its modes stay fixed in space; gyroscopic and convective terms, of the order of
drum speed over circular frequency, are left out.
"""

from typing import Any

import equinox as eqx
import numpy as np
from jax import Array

from drumsqueal.physics.bodies.drum_modes import drum_shapes_at
from drumsqueal.precision import real


class ElasticDrum(eqx.Module):
    """Modes of a drum: `frequencies` ω_j (m,) in rad/s and `shapes` ψ_j (m, 3, …) of unit modal mass (kg^-½).

    Coefficients are as in `drum_modes.py`, on the ring |z − offset| ≤ width/2 (m). A coordinate η_j is in m kg^½.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    frequencies: Array = eqx.field(converter=real)
    shapes: Array = eqx.field(converter=real)
    width: Array = eqx.field(converter=real)
    offset: Array = eqx.field(converter=real)

    def shapes_at(self, angle: Any, z: Any, some: Any = slice(None)) -> Any:
        """u_r, u_θ, u_z of all modes or some (..., 3, m) at points of the inner surface, at angles (rad) and z (m)."""
        given: Any = self.shapes, self.width, self.offset
        shapes, width, offset = given if isinstance(angle, Array) else map(np.asarray, given)
        return drum_shapes_at(shapes[some], width / 2, angle, z - offset)
