"""The shoe in section across the drum's axis: its outline and parts of its lining, displaced and magnified.

Points are (x, y) in mm: x from the drum's axis through the middle of the lining, y at right angles to it, the way in
which a drum of positive speed carries that middle.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.physics.bodies.rigid_shoe import TX, TY, TZ, RigidShoe, X, Y
from drumsqueal.scene import COORDINATES
from drumsqueal.solve.linear.modes import Mode

Points = NDArray[np.float64]

MILLI = 1e3
ARC_POINTS = 61  # along each arc of the outline


def shoe_outline(shoe: RigidShoe, motion: ArrayLike = (0.0, 0.0, 0.0), magnification: float = 1.0) -> Points:
    """Return the outline (n, 2) in mm, closed, of the shoe moved by X, Y (m) and Tz (rad), magnified.

    The outer arc comes first, from θ = −β/2 to β/2, then the inner one back.
    """
    half = float(shoe.half_angle)
    angles = np.linspace(-half, half, ARC_POINTS)
    outer = float(shoe.outer_radius)
    arcs = [on_circle(outer, angles), on_circle(outer - float(shoe.thickness), angles[::-1])]
    outline = np.concatenate([*arcs, arcs[0][:1]])
    return displaced(outline, float(shoe.centroid), motion, magnification)


def lining_parts(shoe: RigidShoe, edges: NDArray[np.float64], depths: tuple[float, float]) -> Points:
    """Return the corners (parts, 4, 2) in mm of what lies between angles `edges` (parts + 1,) at two depths (m)."""
    outer, inner = (on_circle(float(shoe.outer_radius) - depth, edges) for depth in depths)
    return np.stack([outer[:-1], outer[1:], inner[1:], inner[:-1]], axis=1)


def on_circle(radius: float, angles: ArrayLike) -> Points:
    """Points (n, 2) in mm at angles θ (rad) on a circle about the drum's axis, radius in m."""
    angles = np.asarray(angles)
    return MILLI * radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def displaced(points: Points, centroid: float, motion: ArrayLike, magnification: float = 1.0) -> Points:
    """Return points (..., 2) in mm of the shoe moved by X, Y (m) and the small rotation Tz (rad), magnified.

    u = (X − y Tz, Y + (x − c) Tz), with c the distance (m) of the centre of gravity from the drum's axis. That is the
    model's own displacement, linear in the rotation: magnified far, the shoe grows by half the square of the drawn
    rotation.
    """
    x_shift, y_shift, turn = magnification * np.asarray(motion, dtype=float)
    x, y = points[..., 0], points[..., 1]
    moved = (x + MILLI * x_shift - y * turn, y + MILLI * y_shift + (x - MILLI * centroid) * turn)
    return np.stack(moved, axis=-1)


def whole_shape(coordinates: Sequence[str], mode: Mode) -> NDArray[np.complex128]:
    """The displacements of a mode (6,), complex, zero where a coordinate is not among its own."""
    shape = np.zeros(len(COORDINATES), dtype=np.complex128)
    shape[[COORDINATES.index(name) for name in coordinates]] = mode.right[: len(coordinates)]
    return shape


def on_line(states: NDArray[np.float64], z: float) -> NDArray[np.float64]:
    """Motion (..., 3) in the plane, as X, Y, Tz, that the section at z (m) makes of all six coordinates (..., 6).

    (X + z Ty, Y − z Tx, Tz): the same for velocities.
    """
    return np.stack([states[..., X] + z * states[..., TY], states[..., Y] - z * states[..., TX], states[..., TZ]], -1)


def largest_displacement(shoe: RigidShoe, motions: NDArray[np.float64]) -> float:
    """Largest displacement (m) of any point of the outline over motions (..., 3)."""
    # The modulus of what is linear in the point is convex: it is largest on the outline.
    outline = shoe_outline(shoe) / MILLI
    shift, turn = motions[..., None, :2], motions[..., None, 2]
    arm_x, arm_y = outline[:, 0] - float(shoe.centroid), outline[:, 1]
    return float(np.hypot(shift[..., 0] - arm_y * turn, shift[..., 1] + arm_x * turn).max())
