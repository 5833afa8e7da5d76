"""Quadrature over the whole lining where nothing has a boundary: pressed everywhere, and slip far from its reversal.

What then is integrated is smooth all over the lining, and a fixed product of Gauss rules is exact to round-off with a
tenth of the nodes that a single piece of the arc takes where there are boundaries.
"""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.arc import NODES_LONG_ARC, compact_nodes
from drumsqueal.physics.quadrature.levels import Level, sine_cosine
from drumsqueal.physics.quadrature.sums import Densities, sum_together
from drumsqueal.physics.quadrature.surface import Boundaries, Lining, Nodes, resolved

ALONG, ACROSS = 16, 8  # nodes along the arc and across the lining
# How far off the branch points of |V| must be. Along the arc, at least this many half arcs from the real axis: Gauss
# rules then converge like 3.6^(−2 n), to 1e-18. Across, the swing of the velocity, at most this fraction of its mean,
# leaves them 3.3 half widths away: 6.5^(−2 n), 1e-13.
CLEARANCE = 1.65
LARGEST_SWING = 0.3


def smooth_nodes(lining: Lining) -> Nodes:
    """Nodes (across, along); nothing is split."""
    along, along_weight = np.polynomial.legendre.leggauss(ALONG)
    across, across_weight = np.polynomial.legendre.leggauss(ACROSS)
    half_angle, half_width = lining.half_angle, lining.width / 2
    sine, cosine = sine_cosine(half_angle * along)
    weight = lining.outer_radius * half_angle * half_width * across_weight[:, None] * along_weight
    return Nodes(cosine[None], sine[None], (half_width * across)[:, None], weight)


class SteadySurface(eqx.Module):
    """The lining in steady sliding and in motion infinitely near to it, in the plane and in space.

    Slip is far from its reversal, and nothing differs across the lining but infinitely little: only where it has lifted
    off the arc is `cut`, straight across. There the pressure vanishes, so that a boundary that moves changes nothing to
    first order. This takes a tenth of the program that looks for boundaries wherever they may be.
    """

    cut: bool = eqx.field(static=True)

    @property
    def spatial(self) -> bool:
        """Whether the nodes differ across the lining."""
        return True

    def integrate(self, lining: Lining, boundaries: Boundaries, densities: Callable[[Nodes], Densities]) -> Densities:
        """Sums of the densities."""
        if not self.cut:
            return sum_together([densities(smooth_nodes(lining))])
        arc = compact_nodes(lining, boundaries, NODES_LONG_ARC)
        across, weight = np.polynomial.legendre.leggauss(ACROSS)
        cosine, sine, along = (jnp.ravel(each)[None] for each in (arc.cosine, arc.sine, arc.weight))
        return sum_together(
            [densities(Nodes(cosine, sine, (lining.width / 2 * across)[:, None], weight[:, None] / 2 * along))]
        )


def is_smooth(lining: Lining, boundaries: Boundaries) -> Array:
    """Whether the lining has no boundary, pressed and slipping one way everywhere, nor a branch point of |V| near it.

    With V_θ + i V_z = a + (p e^{iθ} + m e^{−iθ})/2 there is none with |Im θ| < y as long as max(|p|, |m|) cosh y < |a|.
    Nor may the friction law be steep. The condition is sufficient, not necessary: its bounds are over the whole circle.
    """
    pressure, slip, axial, breakpoints, _ = boundaries
    smooth = jnp.asarray(True)
    if pressure is not None:
        smooth &= pressure.constant >= _swing(pressure, lining.width / 2)
    if slip is not None:
        smooth &= jnp.abs(slip.constant) >= _swing(slip, lining.width / 2)
        turn = slip if axial is None else Level(*(u + 1j * w for u, w in zip(slip, axial, strict=True)))
        swing, mean = _swing(turn, lining.width / 2), jnp.abs(turn.constant)
        fraction = jnp.minimum(LARGEST_SWING, 1 / jnp.cosh(CLEARANCE * lining.half_angle))
        smooth &= (swing <= fraction * mean) & resolved(breakpoints, mean - swing, mean + swing)
    return smooth


def _swing(level: Level, half_width: Array) -> Array:
    """Bound of max(|p|, |m|), p, m = (b + b′z) ∓ i (c + c′z), over the lining."""
    middle = _largest(level.cosine, level.sine)
    return middle + half_width * _largest(level.cosine_slope, level.sine_slope)


def _largest(b: Array | complex, c: Array | complex) -> Array:
    return jnp.maximum(jnp.abs(b - 1j * c), jnp.abs(b + 1j * c))
