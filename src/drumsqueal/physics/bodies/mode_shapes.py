"""Mode shapes of an annular sector as products of Legendre polynomials, smooth everywhere and their slopes known.

u_r, u_θ, u_z = Σ c_abk P_a(ξ) P_b(η) P_k(ζ), where r, θ and z run from −1 to 1 as ξ, η and ζ within the sector.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array


class Sector(NamedTuple):
    """Outer radius R, thickness h inwards, width b (m) and arc angle β (rad): |θ| ≤ β/2, |z| ≤ b/2."""

    outer_radius: Any
    thickness: Any
    width: Any
    arc_angle: Any


def shapes_at(coefficients: Any, sector: Sector, r: Any, theta: Any, z: Any) -> Any:
    """u_r, u_θ, u_z of each shape (..., 3, n) at points of the sector, whose places (m, rad) broadcast.

    Coefficients are (n, 3, degrees of r, of θ, of z). What is of NumPy gives an array of NumPy, else one of JAX.
    """
    return _sum(coefficients, _bases(coefficients, sector, (r, theta, z)))


def shapes_held_at(coefficients: Any, sector: Sector, x: Any, y: Any, z: Any) -> Any:
    """u_x, u_y, u_z of each shape (3, n) at one point (m), off the sector at the end of a rigid arm from it.

    The arm a starts at the nearest point of the sector and moves with it: u + ½ (∇ × u) × a.
    """
    xp = _library_of(coefficients, *sector, x, y, z)
    r, theta, height = place = nearest_point(sector, x, y, z)
    bases, slopes = (_bases(coefficients, sector, place, slopes=each) for each in (False, True))
    u = _sum(coefficients, bases)
    along_r, along_theta, along_z = (
        _sum(coefficients, [slopes[j] if j == k else bases[j] for j in range(3)]) for k in range(3)
    )
    curl = xp.stack(
        [
            along_theta[2] / r - along_z[1],
            along_z[0] - along_r[2],
            along_r[1] + (u[1] - along_theta[0]) / r,
        ]
    )
    cosine, sine = xp.cos(theta), xp.sin(theta)
    arm = xp.stack([x - r * cosine, y - r * sine, z - height])[:, None]
    held = [_cartesian(vector, cosine, sine, xp) for vector in (u, curl / 2)]
    return held[0] + xp.cross(held[1], arm, axis=0)


def nearest_point(sector: Sector, x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
    """(r, θ, z) of the point of a sector that is nearest to one at x, y and z; of two, the one of greater θ."""
    R, h, b, beta = sector
    xp = _library_of(*sector, x, y, z)
    angle = xp.arctan2(y, x)
    end = xp.where(angle < 0, -beta / 2, beta / 2)
    beyond = xp.maximum(xp.abs(angle) - beta / 2, 0.0)
    theta = xp.where(beyond > 0, end, angle)
    # Beyond an end, r is that of the foot of the perpendicular on the end's plane.
    r = xp.clip(xp.hypot(x, y) * xp.cos(beyond), R - h, R)
    return r, theta, xp.clip(z, -b / 2, b / 2)


def _bases(coefficients: Any, sector: Sector, place: Sequence[Any], *, slopes: bool = False) -> list[Any]:
    """Polynomials of ξ, of η and of ζ at places, or their derivatives along r, θ and z."""
    R, h, b, beta = sector
    xp = _library_of(coefficients, *sector, *place)
    scaled = ((place[0] - R + h / 2) * 2 / h, place[1] * 2 / beta, place[2] * 2 / b)
    return [
        legendre(xp.asarray(at), n, 2 / size if slopes else None)
        for at, n, size in zip(scaled, coefficients.shape[2:], (h, beta, b), strict=True)
    ]


def _sum(coefficients: Any, bases: Sequence[Any]) -> Any:
    """Shapes (..., 3, n) from polynomials at places."""
    xp = _library_of(coefficients, *bases)
    return xp.einsum("...a,...b,...k,jcabk->...cj", *bases, coefficients, optimize=True)


def legendre(x: Any, count: int, scale: Any = None) -> Any:
    """P_0 to P_{count − 1} at places (..., count), or their derivatives times a scale.

    (k + 1) P_{k+1} = (2k + 1) x P_k − k P_{k−1} and P'_{k+1} = P'_{k−1} + (2k + 1) P_k.
    """
    xp = jnp if isinstance(x, Array) else np
    values, slopes = [xp.ones_like(x), x], [xp.zeros_like(x), xp.ones_like(x)]
    for k in range(1, count - 1):
        values.append(((2 * k + 1) * x * values[k] - k * values[k - 1]) / (k + 1))
        slopes.append(slopes[k - 1] + (2 * k + 1) * values[k])
    found = values if scale is None else [scale * slope for slope in slopes]
    return xp.stack(found[:count], axis=-1)


def _cartesian(vector: Any, cosine: Any, sine: Any, xp: Any) -> Any:
    return xp.stack([cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1], vector[2]])


def _library_of(*given: Any) -> Any:
    return jnp if any(isinstance(each, Array) for each in given) else np
