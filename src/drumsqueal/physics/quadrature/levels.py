"""Level functions of the lining: constant + cosine + sine on every line z = const, and where they vanish.

Both the pressure before separation and the slip velocity of a rigid shoe are of this form, so the boundaries of the
contact and of the slip-reversed region are roots in closed form. A quadrature that splits there is exact to round-off
with a few nodes; one that does not puts a kink into the motion whenever a boundary passes a node.
"""

from math import factorial
from typing import Any, NamedTuple, Protocol

import jax.numpy as jnp
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
