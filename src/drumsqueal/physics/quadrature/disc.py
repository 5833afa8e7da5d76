"""Integrals over a disc that slides and spins, along lines through its instantaneous centre of rotation.

On such a line all slip velocities are at right angles to it, and grow in proportion to the distance from that centre:
friction has one direction on either side of it, and no integral meets the turn of the direction inside.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.arc import sort_by_counting

# The lines' angle is the Gudermannian of t, tan(χ/2) = tanh(t/2), and the trapezoidal rule is taken in t: however near
# the centre of rotation is to the rim, what is integrated is analytic for |Im t| < π/2, and the rule's error is
# some thousand times exp(−π²/STEP), 5e-13; beyond the last line it leaves out 2 exp(−28), as much.
STEP = 0.28
LINES = 101
# Gauss points on each stretch of a line: two are exact where the coefficient of friction is constant.
POINTS, POINTS_CONSTANT = 16, 2


class DiscNodes(NamedTuple):
    """Nodes (m,) on half of the disc, the other half being its mirror image about a line along X.

    Place x (m) along the line of each, from the foot of the perpendicular from the centre; cosine and sine of that
    line's angle, and the weight (m²), which counts both halves. The slip velocity is speed · (cosine, sine), with the
    speed (m/s) negative beyond the centre of rotation; at the other half its sine has the other sign.
    """

    place: Array
    cosine: Array
    sine: Array
    speed: Array
    weight: Array


def disc_nodes(radius: Array, sliding: Array, spinning: Array, speeds: Array) -> DiscNodes:
    """Nodes for a centre that slides at u ≥ 0 along X and a spin of ω ≥ 0, given by u and Rω (m/s), not both zero.

    A line at angle φ passes the disc's centre at h = (u/ω) sin φ. Where Rω ≥ u the lines are parametrised by φ = χ, and
    elsewhere by h = R sin χ. A line is cut at the centre of rotation, or at its middle where that is off the disc, and
    where the slip speed is one of those that cut the friction law (K,).
    """
    outside = sliding > spinning
    largest = jnp.where(outside, sliding, spinning)
    ratio = jnp.where(outside, spinning, sliding) / largest
    t = STEP * np.arange(LINES)
    # cos χ = 1/cosh t, √(1 − ratio² sin² χ) and their quotient, which stays finite where both vanish.
    cosine, sine = 1 / np.cosh(t), np.tanh(t)
    quotient = jnp.sqrt(1 + (1 - ratio) * (1 + ratio) * np.sinh(t) ** 2)
    root = cosine * quotient
    half, lean = jnp.where(outside, cosine, root), jnp.where(outside, root, ratio * cosine)
    slope = jnp.where(outside, ratio, 1.0)
    middle = jnp.where(outside, 0.0, -lean)
    x, fraction = np.polynomial.legendre.leggauss(POINTS if speeds.size else POINTS_CONSTANT)
    signed = jnp.concatenate([-speeds, speeds])[:, None] / largest
    varies = slope > 0
    cuts = jnp.where(varies, (signed - lean) / jnp.where(varies, slope, 1.0), 0.0)
    ends = sort_by_counting(jnp.concatenate([jnp.stack([-half, middle, half]), jnp.clip(cuts, -half, half)]))[
        :, :, None
    ]
    low, high = ends[:-1], ends[1:]
    place = (low + high) / 2 + (high - low) / 2 * x
    level = lean[:, None] + slope * place
    # dA = |level| dx dφ, of which dφ = dχ, or cos χ/√(…) dχ where lines are parametrised by h; dχ = cos χ dt.
    step = STEP * np.where(t == 0, 1.0, 2.0) * cosine * jnp.where(outside, 1 / quotient, 1.0)
    weight = (high - low) / 2 * fraction * step[:, None] * jnp.abs(level)
    angle = (jnp.where(outside, root, cosine), jnp.where(outside, ratio * sine, sine))
    lines = (jnp.broadcast_to(each[:, None], place.shape) for each in angle)
    across, along = (each.ravel() for each in lines)
    return DiscNodes(radius * place.ravel(), across, along, largest * level.ravel(), radius**2 * weight.ravel())
