"""The numbered points of the shoe, for formats that know of geometry: where they are, and how they move."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.physics.bodies.body import displace
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.scene import Scene

CENTRE_OF_GRAVITY, MIDDLE, LEADING_END, TRAILING_END = 1, 2, 3, 4
"""0 is no point, for what belongs to the whole lining."""
POINTS = {
    CENTRE_OF_GRAVITY: "centre of gravity",
    MIDDLE: "middle of the lining",
    LEADING_END: "end of the lining where the drum enters at positive speed",
    TRAILING_END: "end of the lining where the drum leaves at positive speed",
}
OUTLINE = (LEADING_END, MIDDLE, TRAILING_END, CENTRE_OF_GRAVITY, LEADING_END)
"""Points that a line joins, to be drawn."""


def positions(scene: Scene) -> NDArray[np.float64]:
    """Places (4, 3) in m of the points, from the drum's axis: x through the middle of the lining, z along the axis.

    (c, 0, 0), then R (cos θ, sin θ, 0) at θ = 0, −β/2 and β/2.
    """
    shoe = scene.shoe
    angles = np.array([0.0, -shoe.arc_angle / 2, shoe.arc_angle / 2])
    lining = shoe.outer_radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)
    return np.vstack([[float(RigidShoe(**shoe.model_dump()).centroid), 0.0, 0.0], lining])


def moved(scene: Scene, q: Mapping[str, ArrayLike]) -> NDArray[np.complex128]:
    """Displacements (4, 3) of the points along x, y and z (m), of coordinates by name."""
    found = displace(RigidShoe(**scene.shoe.model_dump()), q, *positions(scene).T)
    return np.stack([np.broadcast_to(part, len(POINTS)) for part in found], axis=1).astype(np.complex128)
