"""Mode shapes: of an annular sector as products of Legendre polynomials, and any that were once found and are kept.

Of a sector u_r, u_θ, u_z = Σ c_abk P_a(ξ) P_b(η) P_k(ζ), where r, θ and z run from −1 to 1 as ξ, η and ζ within it.
"""

import functools
import hashlib
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.polynomial.legendre import leggauss

from drumsqueal.compilation import cache_folder, is_private, keep, load_kept
from drumsqueal.physics.bodies.elements import Reals

# Least squares on n equispaced points are well conditioned up to a degree of some 2.5 sqrt(n).
STABLE, MOST = 2.4, 40


def fewest(energy: Reals) -> int:
    """How many degrees hold all shapes but for what is not needed, by the squares of each one's parts (n, degrees)."""
    tail = np.sqrt(np.cumsum(energy[:, ::-1], axis=1)[:, ::-1])
    # Higher degrees with less in all than 3e-5 of a shape, root mean squares compared, are left out.
    return int(np.max(np.sum(tail > 3e-5 * tail[:, :1], axis=1), initial=0))


def harmonics(theta: Any, count: int, xp: Any = np) -> Any:
    """1, cos θ, sin θ, cos 2θ, … at angles (rad), (..., count), by the library `xp`: NumPy, or JAX's."""
    order, is_sine = (np.arange(count) + 1) // 2, (np.arange(count) % 2 == 0) & (np.arange(count) > 0)
    phases = xp.asarray(theta)[..., None] * order
    return xp.where(is_sine, xp.sin(phases), xp.cos(phases))


def signs_of(place: Reals) -> Reals:
    """What makes the first of u_r, u_θ and u_z that moves much at a place (3, n) positive, of each shape (n,)."""
    # 0.1 of the largest displacement of a place: more than round-off by far
    moves = np.abs(place) > 0.1 * np.max(np.abs(place), axis=0, initial=0.0)
    return np.sign(np.take_along_axis(place, np.argmax(moves, axis=0)[None], axis=0)[0])


class Sector(NamedTuple):
    """Outer radius R, thickness h inwards, width b (m) and arc angle β (rad): |θ| ≤ β/2, |z| ≤ b/2."""

    outer_radius: Any
    thickness: Any
    width: Any
    arc_angle: Any


ACROSS, WEIGHTS = leggauss(3)  # of a patch, along each of its three edges
LEAST_RADIUS = 1e-7  # m: a smaller patch is a point, whose turn is half the curl of the shapes, to six digits


def shapes_at(coefficients: Any, sector: Sector, r: Any, theta: Any, z: Any) -> Any:
    """u_r, u_θ, u_z of each shape (..., 3, n) at points of the sector, whose places (m, rad) broadcast.

    Coefficients are (n, 3, degrees of r, of θ, of z). What is of NumPy gives an array of NumPy, else one of JAX.
    """
    bases = _bases(coefficients.shape[2:], sector, (r, theta, z))
    xp = _library_of(coefficients, *bases)
    return xp.einsum("...a,...b,...k,jcabk->...cj", *bases, coefficients, optimize=True)


def shapes_held_at(coefficients: Any, sector: Sector, x: Any, y: Any, z: Any, radius: Any = 0.0) -> Any:
    """u_x, u_y, u_z of each shape (3, n) at one point (m), which a patch of a radius (m) holds by a rigid arm.

    The patch is a box around the nearest point of the sector, as far as it is within the sector, by its Gauss points.
    It moves by its mean and turns by half the curl of the linear motion that is nearest to its own, by least squares.
    """
    xp = _library_of(coefficients, *sector, x, y, z, radius)
    lines = _patch(sector, nearest_point(sector, x, y, z), xp.maximum(radius, LEAST_RADIUS))
    bases = _bases(coefficients.shape[2:], sector, lines)
    u = xp.einsum("xa,yb,zk,jcabk->cxyzj", *bases, coefficients, optimize=True)
    return _held(u, lines, xp.stack([x, y, z]))


def products_held_at(degrees: tuple[int, int, int], sector: Sector, *patch: float) -> Reals:
    """The same along x, y, z, of u_r, u_θ, u_z that are one product of polynomials each (3, 3, degrees)."""
    *point, radius = patch
    lines = _patch(sector, nearest_point(sector, *point), max(radius, LEAST_RADIUS))
    products = np.einsum("xa,yb,zk->xyzabk", *_bases(degrees, sector, lines)).reshape(*map(len, lines), -1)
    each = (_held(products * np.eye(3)[c][:, None, None, None, None], lines, np.array(point)) for c in range(3))
    return np.stack(list(each), axis=1).reshape(3, 3, *degrees)


def _held(u: Any, lines: Sequence[Any], point: Any) -> Any:
    """How a point (3,) in m moves (3, n) with a patch, of which u (3, r, θ, z, n) are motions at its Gauss points."""
    xp = _library_of(u, *lines, point)
    r, theta, height = lines[0][:, None, None], lines[1][:, None], lines[2]
    cosine, sine = xp.cos(theta), xp.sin(theta)
    places = xp.stack(xp.broadcast_arrays(r * cosine, r * sine, height)).reshape(3, -1)
    moved = _cartesian(u, cosine[..., None], sine[..., None], xp).reshape(3, places.shape[1], -1)
    weights = (WEIGHTS[:, None, None] * WEIGHTS[:, None] * WEIGHTS * r).ravel()
    weights = weights / xp.sum(weights)
    middle, mean = places @ weights, xp.einsum("cpj,p->cj", moved, weights)
    arms = places - middle[:, None]
    slopes = _inverse((weights * arms) @ arms.T, xp) @ (weights * arms)  # of a linear motion, by displacements
    turn = xp.sum(xp.cross(slopes[..., None], moved - mean[:, None], axis=0), axis=1) / 2
    return mean + xp.cross(turn, (point - middle)[:, None], axis=0)


def _inverse(matrix: Any, xp: Any) -> Any:
    """Of a matrix (3, 3), by its rows' products."""
    a, b, c = matrix
    columns = xp.stack([xp.cross(b, c), xp.cross(c, a), xp.cross(a, b)], axis=1)
    return columns / xp.sum(a * columns[:, 0])


def _patch(sector: Sector, middle: tuple[Any, Any, Any], radius: Any) -> list[Any]:
    """r, θ and z (3,) each, of the Gauss points of a box around a point of a sector, as far as it is within that."""
    R, h, b, beta = sector
    xp = _library_of(*sector, *middle, radius)
    halves, ends = (radius, radius / middle[0], radius), ((R - h, R), (-beta / 2, beta / 2), (-b / 2, b / 2))
    found = []
    for place, half, (first, last) in zip(middle, halves, ends, strict=True):
        low, high = xp.maximum(place - half, first), xp.minimum(place + half, last)
        found.append((low + high) / 2 + (high - low) / 2 * ACROSS)
    return found


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


def _bases(degrees: Sequence[int], sector: Sector, place: Sequence[Any]) -> list[Any]:
    """So many polynomials of ξ, of η and of ζ at places."""
    R, h, b, beta = sector
    xp = _library_of(*sector, *place)
    scaled = ((place[0] - R + h / 2) * 2 / h, place[1] * 2 / beta, place[2] * 2 / b)
    return [legendre(xp.asarray(at), n) for at, n in zip(scaled, degrees, strict=True)]


def legendre(x: Any, count: int) -> Any:
    """P_0 to P_{count − 1} at places (..., count): (k + 1) P_{k+1} = (2k + 1) x P_k − k P_{k−1}."""
    xp = jnp if isinstance(x, Array) else np

    def following(two: tuple[Any, Any], k: Any) -> tuple[tuple[Any, Any], Any]:
        before, last = two
        new = ((2 * k + 1) * x * last - k * before) / (k + 1)
        return (last, new), new

    ones, values = xp.ones_like(x), [xp.ones_like(x), x][:count]
    if isinstance(x, Array) and count > 2:  # one step in a program and not all of them
        _, rest = jax.lax.scan(following, (ones, x), jnp.arange(1.0, count - 1))
        return jnp.moveaxis(jnp.concatenate([jnp.stack(values), rest]), 0, -1)
    for k in range(1, count - 1):
        values.append(following((values[k - 1], values[k]), k)[1])
    return xp.stack(values, axis=-1)


def _cartesian(vector: Any, cosine: Any, sine: Any, xp: Any) -> Any:
    return xp.stack([cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1], vector[2]])


def _library_of(*given: Any) -> Any:
    return jnp if any(isinstance(each, Array) for each in given) else np


folder: Path | None = cache_folder() / "modes"
"""Where they are kept; None for nowhere."""


def kept(what: str, told: Iterable[float | bytes], find: Callable[[], Mapping[str, Any]]) -> Mapping[str, Any]:
    """Arrays by name, those kept if the same sources found them of the same bodies from the same numbers."""
    path = kept_at(what, told)
    arrays = None if path is None else _unpacked(load_kept(path))
    if arrays is not None:
        return arrays
    found = find()
    if path is not None:
        stream = io.BytesIO()
        np.savez(stream, **found)
        keep(path, stream.getvalue(), most=512 * 2**20)
    return found


def kept_at(what: str, told: Iterable[float | bytes]) -> Path | None:
    """The file of a result; None where none is kept."""
    if folder is None or not is_private(folder):
        return None
    digest = hashlib.sha256(_sources() + what.encode())
    numbers = (each if isinstance(each, bytes) else float(each).hex().encode() for each in told)
    digest.update(b"\n".join([*numbers, *(version(name).encode() for name in ("scikit-fem", "scipy", "numpy"))]))
    return folder / digest.hexdigest()


@functools.cache
def _sources() -> bytes:
    """Of all that shapes are computed by."""
    return b"".join(path.read_bytes() for path in sorted(Path(__file__).parents[1].rglob("*.py")))


def _unpacked(content: bytes | None) -> dict[str, Any] | None:
    if content is None:
        return None
    with suppress(Exception), np.load(io.BytesIO(content), allow_pickle=False) as file:
        return dict(file)
    return None
