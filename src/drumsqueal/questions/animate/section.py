"""The shoe in section across the drum's axis: its outline and displacement, and the lines of it that a page animates.

Points are (x, y) in mm: x from the drum's axis through the middle of the lining, y at right angles to it, the way in
which a drum of positive speed carries that middle.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.vibration import characteristic_lengths
from drumsqueal.physics.bodies.brake import Placed, placed, turned
from drumsqueal.simulation import Prepared
from drumsqueal.solve.linear.modes import NEUTRAL_FRACTION, Mode, Stability

Points = NDArray[np.float64]
Motion = Mapping[str, ArrayLike]
"""Displacements (m, rad) by the names of the coordinates."""

MILLI = 1e3
CIRCLE = np.linspace(-np.pi, np.pi, 361)
"""Angles (rad) at which the drum is drawn."""


def shoe_outline(part: Placed) -> Points:
    """Return the outline (n, 2) in mm, closed, of a shoe in section at z = 0.

    The outer arc comes first, from θ = −β/2 to β/2, then the inner one back.
    """
    shoe, half = part.shoe, float(part.shoe.half_angle)
    angles = part.position + np.linspace(-half, half, 61)  # along each arc of the outline
    outer = float(shoe.outer_radius)
    arcs = [on_circle(outer, angles), on_circle(outer - float(shoe.thickness), angles[::-1])]
    return np.concatenate([*arcs, arcs[0][:1]])


def lining_parts(part: Placed, edges: NDArray[np.float64], depths: tuple[float, float]) -> Points:
    """Return the corners (parts, 4, 2) in mm of what lies between angles `edges` (parts + 1,) at two depths (m)."""
    outer, inner = (on_circle(float(part.shoe.outer_radius) - depth, part.position + edges) for depth in depths)
    return np.stack([outer[:-1], outer[1:], inner[1:], inner[:-1]], axis=1)


def on_circle(radius: float, angles: ArrayLike) -> Points:
    """Points (n, 2) in mm at angles θ (rad) on a circle about the drum's axis, radius in m."""
    angles = np.asarray(angles)
    return MILLI * radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def moved(points: Points, part: Placed, motion: Motion, z: ArrayLike = 0.0) -> NDArray:
    """Return the displacement (..., 2) in mm of points (..., 2) in mm of a shoe at z (m), real or complex.

    That is the model's own displacement, linear in the rotation: magnified far, the shoe grows by half the square of
    the drawn rotation.
    """
    along_x, along_y, _ = part.displaced(motion, points[..., 0] / MILLI, points[..., 1] / MILLI, z)
    return MILLI * np.stack([along_x, along_y], axis=-1)


def moved_drum(angles: NDArray[np.float64], part: Placed, motion: Mapping[str, Any], z: Any = 0.0) -> NDArray:
    """Return the displacement (..., 2) in mm of points of the drum's inner surface at angles θ (rad) and z (m)."""
    along_x, along_y, _ = part.of_drum(motion, angles, z)
    return MILLI * np.stack([along_x, along_y], axis=-1)


def largest_displacement(parts: Sequence[Placed], motion: Motion, z: float = 0.0) -> float:
    """Largest displacement (m) of any point of the outlines, and of the drum's, at z (m) over a motion (frames,)."""
    # The modulus of what is linear in the point is convex: it is largest on the outline.
    frames = {name: np.asarray(values)[..., None] for name, values in motion.items()}
    every = [*(moved(shoe_outline(part), part, frames, z) for part in parts), moved_drum(CIRCLE, parts[0], frames, z)]
    return max(float(np.hypot(*np.moveaxis(each, -1, 0)).max()) for each in every) / MILLI


PERIOD_S = 2.0  # of every mode as it is drawn
DRUM = 1.1  # outer over inner radius of the drum that is drawn; it has no thickness in the model
FLAT = 1e-9  # of the displacement: less motion out of the plane is round-off
# Seen from the front and from above: z comes forward, to the left and down.
OBLIQUE = (-0.5, -0.4)
ROUND = 3  # digits after the point, of mm
Complex = NDArray[np.complex128]
Shape = Mapping[str, complex]


def animate(prepared: Prepared, modes: Sequence[Mode]) -> dict[str, Any]:
    """What the page needs of modes: lines (mm), displacements (mm) as real and imaginary parts, and words."""
    body, stability = prepared.linear.body, prepared.stability
    radius = MILLI * float(prepared.linear.contact.radius)
    moving = [_moving(body, stability, mode) for mode in modes]
    width = max(float(part.shoe.width) for part in placed(body))
    beyond = 0.0 if all(mode["flat"] for mode in moving) else MILLI * width / 2 * max(map(abs, OBLIQUE))
    # The picture goes on beyond the drum by 2 %.
    return {
        "radius": round(radius, ROUND),
        "outer": round(DRUM * radius, ROUND),
        "box": round(1.02 * DRUM * radius + beyond, ROUND),
        "turns": float(np.sign(prepared.linear.operation.at(stability.time).drum_speed)),
        "period_s": PERIOD_S,
        "modes": moving,
    }


def _moving(body: Any, stability: Stability, mode: Mode) -> dict[str, Any]:
    coordinates, parts = stability.coordinates, placed(body)
    shape, right = mode.shape(coordinates), mode.right[: len(coordinates)]
    sizes = np.abs(right * characteristic_lengths(coordinates, body))
    flat = bool(sizes[~np.array(body.symmetric)].max(initial=0.0) < FLAT * sizes.max())
    lines = [line for part in parts for line in (_section(part, shape) if flat else _body(part, shape))]
    drawn = 0.08 * MILLI * float(body.outer_radius)  # of the outer radius: the largest motion as it is drawn
    magnification = drawn / max(_largest(moved) for _, moved in lines)
    neutral = abs(mode.growth_rate) < NEUTRAL_FRACTION * mode.frequency_Hz
    energy = stability.mass * np.abs(right) ** 2
    fractions = zip(coordinates, (energy / energy.sum()).tolist(), strict=True)
    # Less than 5e-3 of the kinetic energy is not reported.
    return {
        "label": mode.label,
        "name": mode.name,
        "frequency_Hz": mode.frequency_Hz,
        "growth_rate_1_per_s": 0.0 if neutral else mode.growth_rate,
        "unstable": mode.unstable,
        "stability": "unstable" if mode.unstable else "stable",
        "flat": flat,
        "slowed": mode.frequency_Hz * PERIOD_S,
        "shares": {name: each for name, each in sorted(fractions, key=lambda f: -f[1]) if each > 5e-3},
        # What the named coordinate does where the largest motion of the shoe is drawn, in m or rad times `enlarged`.
        "enlarged": magnification,
        "drawn_mm": drawn,
        "lines": [
            {"at": _rounded(at), "re": _rounded(magnification * moved.real), "im": _rounded(magnification * moved.imag)}
            for at, moved in lines
        ],
        "depth": [] if flat else _rounded(_project(np.array([0.0, 0.0, MILLI * float(parts[0].shoe.width) / 2]))),
    }


def _section(part: Placed, shape: Shape) -> list[tuple[NDArray[np.float64], Complex]]:
    """The outline in section at z = 0, and a cross at the centre of gravity."""
    arm = 0.03 * MILLI * float(part.shoe.outer_radius)
    x, y = turned(MILLI * float(part.shoe.centroid), 0.0, part.position)
    cross = [np.array([[x - arm, y], [x + arm, y]]), np.array([[x, y - arm], [x, y + arm]])]
    return [(at, moved(at, part, shape)) for at in (shoe_outline(part), *cross)]


def _body(part: Placed, shape: Shape) -> list[tuple[NDArray[np.float64], Complex]]:
    """Back and front face and the edges between them, projected on the picture."""
    shoe, beta = part.shoe, float(part.shoe.half_angle)
    half, radii = float(shoe.width) / 2, (float(shoe.outer_radius), float(shoe.outer_radius) - float(shoe.thickness))
    ends = part.position + np.array([-beta, 0.0, beta])
    corners = np.concatenate([on_circle(radius, ends) for radius in radii])
    lines = []
    for z in (-half, half):
        at = shoe_outline(part)
        lines.append(_projected(at, np.full(len(at), z), part, shape))
    for corner in corners:
        lines.append(_projected(np.stack([corner, corner]), np.array([-half, half]), part, shape))
    return lines


def _projected(
    at: NDArray[np.float64], z: NDArray[np.float64], part: Placed, shape: Shape
) -> tuple[NDArray[np.float64], Complex]:
    place = np.column_stack([at, MILLI * z])
    found = [np.broadcast_to(each, z.shape) for each in part.displaced(shape, *place.T / MILLI)]
    return _project(place), _project(MILLI * np.stack(found, axis=1))


def _project(points: Any) -> Any:
    """Points (..., 3) on the picture (..., 2)."""
    return np.stack([points[..., 0] + OBLIQUE[0] * points[..., 2], points[..., 1] + OBLIQUE[1] * points[..., 2]], -1)


def _largest(moved: Complex) -> float:
    """The longest half axis of the ellipses that points with these displacements (n, 2) run through."""
    both = np.sum(np.abs(moved) ** 2, axis=1)
    return float(np.sqrt((both + np.abs(np.sum(moved**2, axis=1))) / 2).max())


def _rounded(points: NDArray[np.float64]) -> list[float]:
    return [round(float(value), ROUND) for value in points.ravel()]
