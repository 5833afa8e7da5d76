"""What the contact asks of a quadrature over the lining, level functions, and several sums in one pass over nodes.

The pressure before separation and the slip velocity of a rigid shoe are level functions: constant + cosine + sine on
every line z = const. So the boundaries of the contact and of the slip-reversed region are roots in closed form. A
quadrature that splits there is exact to round-off with a few nodes; one that does not puts a kink into the motion
whenever a boundary passes a node.
"""

from collections.abc import Callable
from math import factorial
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

SINE_TERMS, COSINE_TERMS = 10, 11  # Taylor terms that reach round-off up to π/2


def sine_cosine(angle: Array) -> tuple[Array, Array]:
    """Sine and cosine for |angle| ≤ π to round-off, by Taylor series of half the angle.

    sin x = 2 sin(x/2) cos(x/2), cos x = 1 − 2 sin²(x/2). XLA calls a scalar library function for the built-in ones on
    CPU; polynomials vectorise, which makes the contact integral about three times faster.
    """
    half = angle / 2
    square = half * half
    sine, cosine = jnp.zeros_like(half), jnp.zeros_like(half)
    for k in reversed(range(SINE_TERMS)):
        sine = sine * square + (-1) ** k / factorial(2 * k + 1)
    for k in reversed(range(COSINE_TERMS)):
        cosine = cosine * square + (-1) ** k / factorial(2 * k)
    sine = sine * half
    return 2 * sine * cosine, 1 - 2 * sine * sine


class Places(Protocol):
    """Where nodes of a quadrature are."""

    @property
    def cosine(self) -> Array:
        """cos θ."""
        ...

    @property
    def sine(self) -> Array:
        """sin θ."""
        ...

    @property
    def z(self) -> Array | None:
        """z (m), None on the line z = 0."""
        ...


class Level(NamedTuple):
    """L(θ, z) = constant + (cosine + cosine_slope z) cos θ + (sine + sine_slope z) sin θ."""

    constant: Array | complex
    cosine: Array | complex
    sine: Array | complex
    cosine_slope: Array | complex = 0.0
    sine_slope: Array | complex = 0.0

    def on_line(self, z: Array) -> "Level":
        """Return the level on the lines z, whose coefficients have the shape of z."""
        cosine = self.cosine + self.cosine_slope * z
        sine = self.sine + self.sine_slope * z
        return Level(self.constant + jnp.zeros_like(cosine), cosine, sine)

    def value(self, cosine: Any, sine: Any, z: Any) -> Any:
        """Evaluate at cos θ, sin θ and z (m): numbers, arrays of NumPy or of JAX."""
        return self.constant + (self.cosine + self.cosine_slope * z) * cosine + (self.sine + self.sine_slope * z) * sine

    def over(self, cosine: Array, sine: Array, z: Array | None) -> Array:
        """Evaluate at cos θ, sin θ and z (None on the line z = 0)."""
        if z is None:
            return jnp.asarray(self.constant + self.cosine * cosine + self.sine * sine)
        return jnp.asarray(self.value(cosine, sine, z))

    def at(self, nodes: "Places") -> Array:
        """Evaluate at nodes of a quadrature."""
        return self.over(nodes.cosine, nodes.sine, nodes.z)

    def scaled(self, factor: Array, offset: Array) -> "Level":
        """Offset + factor · level."""
        nothing = isinstance(self.constant, float) and self.constant == 0  # which stays out of the program
        constant = offset if nothing else offset + factor * self.constant
        return Level(constant, *(factor * each for each in self[1:]))

    def bound(self, half_width: Array) -> Array:
        """A bound of its size anywhere on the circle and within |z| ≤ half the width (m)."""
        slopes = abs(self.cosine_slope) + abs(self.sine_slope)
        return abs(self.constant) + abs(self.cosine) + abs(self.sine) + half_width * slopes


def swing(level: Level, half_width: Array) -> Array:
    """Bound of max(|p|, |m|), p, m = (b + b′z) ∓ i (c + c′z), over the lining."""
    middle = _largest(level.cosine, level.sine)
    return middle + half_width * _largest(level.cosine_slope, level.sine_slope)


def _largest(b: Array | complex, c: Array | complex) -> Array:
    b, c = jnp.asarray(b), jnp.asarray(c)
    if jnp.iscomplexobj(b) or jnp.iscomplexobj(c):
        return jnp.maximum(jnp.abs(b - 1j * c), jnp.abs(b + 1j * c))
    return jnp.sqrt(b * b + c * c)


def quarter_tangents(level: Level) -> list[tuple[Array, Array]]:
    """Roots θ of a + b cos θ + c sin θ in [−π, π] as tan(θ/4): two pairs of whether there, and where; shape of a.

    tan(θ/2) solves (a − b) t² + 2c t + (a + b) = 0; with q = −(c ± s), s² = b² + c² − a² and the sign that does not
    cancel, it is q/(a − b) and (a + b)/q. tan(θ/4) = sin(θ/2)/(1 + cos(θ/2)) is finite also where that is not, and
    needs no function that XLA calls a library for. Roots that are not there have some finite value and no gradient.
    """
    a, b, c = (jnp.asarray(x) for x in (level.constant, level.cosine, level.sine))
    discriminant = b * b + c * c - a * a
    real_pair = discriminant > 0
    # The inner `where` keeps gradients finite where there is no root.
    s = jnp.sqrt(jnp.where(real_pair, discriminant, 1.0))
    q = jnp.where(c < 0, s - c, -s - c)
    halves = ((q, a - b), (a + b, q))  # (y, x) with tan(θ/2) = y/x
    return [(real_pair, jnp.where(x < 0, -y, y) / (jnp.sqrt(x * x + y * y) + jnp.abs(x))) for y, x in halves]


def real_roots(level: Level, half_angle: Array) -> tuple[Array, Array]:
    """Roots θ of a + b cos θ + c sin θ inside the arc: whether there (2, ...), and where (2, ...) in rad."""
    pairs = quarter_tangents(level)
    angle = 4 * jnp.arctan(jnp.stack([tangent for _, tangent in pairs]))
    return jnp.stack([there for there, _ in pairs]) & (jnp.abs(angle) < half_angle), angle


def complex_roots(level: Level) -> tuple[Array, Array, Array]:
    """Roots θ of a + b cos θ + c sin θ with complex a, b, c: whether there, Re θ and |Im θ|, each (2, ...), in rad.

    With ζ = exp(iθ): (b − ic) ζ² + 2a ζ + (b + ic) = 0. They are the branch points of |V| when the level is
    V_θ + i V_z: where slip reverses (Re θ), and over what angle the direction V/|V| turns there (|Im θ|).
    """
    a, b, c = (jnp.asarray(x, dtype=complex) for x in (level.constant, level.cosine, level.sine))
    leading, trailing = b - 1j * c, b + 1j * c
    large, small, found = _quadratic(leading, a, trailing)
    zeta = jnp.stack([large, small])
    modulus = jnp.abs(jnp.where(found, zeta, 1.0))
    there = found & (modulus > 0) & jnp.isfinite(modulus)
    zeta = jnp.where(there, zeta, 1.0)
    return there, jnp.arctan2(zeta.imag, zeta.real), jnp.abs(jnp.log(jnp.abs(zeta)))


def _quadratic(p: Array, r: Array, s: Array) -> tuple[Array, Array, Array]:
    """Roots of p x² + 2 r x + s = 0 over the complex numbers without cancellation, and whether each exists (2, ...)."""
    discriminant = r * r - p * s
    split = discriminant != 0
    root = jnp.where(split, jnp.sqrt(jnp.where(split, discriminant, 1.0)), 0.0)
    root = jnp.where((jnp.conj(r) * root).real < 0, -root, root)
    mixed = -(r + root)
    has_first, has_second = (p != 0), (mixed != 0)
    first = mixed / jnp.where(has_first, p, 1.0)
    second = jnp.where(has_second, s / jnp.where(has_second, mixed, 1.0), 0.0)
    # mixed = 0 means a double root at zero (r = discriminant = 0 with p ≠ 0) or nothing to solve.
    return first, second, jnp.stack([has_first, has_second | has_first])


Densities = dict[str, Array]
"""What is summed, by name: its value times the weight at each node."""


class Lining(Protocol):
    """The surface that is integrated over: |θ| ≤ half_angle (rad) on a radius (m), and a width (m) across."""

    @property
    def outer_radius(self) -> Any:
        """R (m)."""
        ...

    @property
    def half_angle(self) -> Array:
        """β/2 (rad)."""
        ...

    @property
    def width(self) -> Any:
        """b (m)."""
        ...

    @property
    def area(self) -> Array:
        """R β b (m²)."""
        ...


class Nodes(NamedTuple):
    """Quadrature nodes on the lining: cos θ, sin θ, z (m, None on the line z = 0) and weight (m²)."""

    cosine: Array
    sine: Array
    z: Array | None
    weight: Array


class Boundaries(NamedTuple):
    """The levels whose roots are boundaries: k (u0 + u_r), V_θ, and V_z (None: no boundaries of that kind).

    Where the pressure's level is negative the lining does not press; V_z is the same all across the lining. The slip
    speeds that cut the friction law are its `breakpoints` (K,), rising, in m/s; `kinks` are those of them that a
    quadrature has to cut it at, too, that is graded towards where the slip vanishes. Unless `lifted` counts, what is
    summed is zero where the lining does not press. What is summed `rarely` may take longer for a shorter program. The
    pressure is not smooth where one of the levels `knots`, with a constant (K,), is zero: cut there, in the plane.
    """

    pressure: Level | None
    slip: Level | None
    axial: Level | None
    breakpoints: Array
    kinks: Array
    lifted: bool
    rarely: bool = False
    knots: Level | None = None


def resolved(speeds: Array, slowest: Array, fastest: Array) -> Array:
    """Whether the friction law needs no cuts at its slip speeds (K,) where the slip is between two others (m/s)."""
    if speeds.size == 0:
        return jnp.asarray(True)
    bounds = jnp.concatenate([jnp.zeros(1), speeds, jnp.full(1, jnp.inf)])
    width = bounds[1:] - bounds[:-1]
    met = (bounds[:-1] < fastest) & (bounds[1:] > slowest)
    # Slip speeds that lie within a third of a stretch of the friction law are resolved by a quadrature that does not
    # look for them. Of exp(−α s) that is a factor of exp(4), and eight Gauss nodes on each piece of the arc err by
    # 1.5e-11.
    return ~jnp.any(met & (fastest - slowest > (1 / 3) * width)) & (jnp.sum(met) < 2)


class Surface(Protocol):
    """A quadrature; `spatial` says whether it knows that the lining is wide."""

    @property
    def spatial(self) -> bool:
        """Whether the nodes differ across the lining."""
        ...

    def integrate(self, lining: Lining, boundaries: Boundaries, densities: Callable[[Any], Any]) -> Densities:
        """Sums over the lining of densities times weights, which are smooth between the boundaries."""
        ...


def sum_together(found: Densities) -> Densities:
    """Sum of each density over all nodes.

    Over the first of several axes it is summed first: that fills the lanes of a processor, where a running sum waits
    for each of its terms.
    """
    return _reduce(sum_over_points(found) if next(iter(found.values())).ndim > 1 else found)


@jax.custom_jvp
def _reduce(densities: Densities) -> Densities:
    """One reduction with several operands is one loop in the compiled program.

    Separate sums are one loop each, and XLA computes what they share, an exponential excepted, once for each of them.
    """
    shape = next(iter(densities.values())).shape
    zeros = jax.tree.map(lambda density: np.zeros((), density.dtype), densities)
    return jax.lax.reduce(densities, zeros, _add, tuple(range(len(shape))))


def _add(one: Densities, other: Densities) -> Densities:
    return jax.tree.map(jnp.add, one, other)


@_reduce.defjvp
def _(densities: tuple[Densities], tangents: tuple[Densities]) -> tuple[Densities, Densities]:
    return _reduce(*densities), jax.tree.map(jnp.sum, *tangents)


@jax.custom_jvp
def sum_over_points(densities: dict[Any, Array]) -> dict[Any, Array]:
    """Sums over the first axis alone, in one loop."""
    zeros = jax.tree.map(lambda density: np.zeros((), density.dtype), densities)
    return jax.lax.reduce(densities, zeros, _add, (0,))


@sum_over_points.defjvp
def _(densities: tuple[dict], tangents: tuple[dict]) -> tuple[dict, dict]:
    return sum_over_points(*densities), jax.tree.map(lambda tangent: jnp.sum(tangent, axis=0), *tangents)
