"""Steps that end where the force has a kink, so that none goes over it: its order holds on either side only.

Over a kink the error falls like the second or third power of the step, not the ninth, and the estimate of it is none.
Over growing transients of the nominal scene and beyond their contact boundaries, a step that is not kept over a kink
and made again up to it takes a third fewer steps at equal error (medians over eight starts, errors of 1e-2 to 1e-6).
Beyond a boundary that appears inside the arc forces change like the root of the time since: steps in that root, instead
of time, were tried in the nominal scene, and were no fewer at a tolerance of 1e-3 and a tenth fewer at 1e-8.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

NEAR = 1e-3  # of a step: how close to the kink it is to end; closer takes longer to find and makes no fewer steps
MOST_LOOKS = 10
ABOUT = 0.2  # of the way to either end of a step: how far from an extreme the points lie by which it is found
CLOSE = 0.1  # of the way to the extreme and back: what comes so near to zero by the parabola is looked at


def fraction_to_excursion(kinks: Callable[[Any], Array], before: Array, middle: Array, after: Array) -> Array:
    """Fraction of a step at which a number has come to the other side of zero, to which it goes back; 0 if none has.

    Nothing else shows that: the step's evaluations may all lie beside it. Numbers (k,) at both ends and in the middle
    say by their parabolas which come near zero; the extremes of those are looked for in `kinks`, the first one counts.
    """
    bend, slope = 2 * (before + after - 2 * middle), 4 * middle - 3 * before - after
    place = _vertex(bend, slope)
    way = -slope * place / 2  # from the start to the vertex, and back
    turns = ((before > 0) == (after > 0)) & (before * bend > 0) & (place > 0) & (place < 1)
    near = turns & (before / jnp.where(turns, way, 1.0) - 1 < CLOSE)

    def look(which: Array) -> Array:
        about = place[which]
        low, high = about * (1 - ABOUT), about + ABOUT * (1 - about)
        here, there, beyond = (kinks(each)[which] for each in (low, about, high))
        # Newton's divided differences.
        first, second = (there - here) / (about - low), (beyond - there) / (high - about)
        curve = (second - first) / (high - low)
        best = jnp.clip((low + about) / 2 + _vertex(curve, first), 0.0, 1.0)
        return jnp.where(near[which] & ((kinks(best)[which] > 0) != (before[which] > 0)), best, jnp.inf)

    def first() -> Array:
        return jnp.min(jax.lax.map(look, jnp.arange(before.size)))

    found = jax.lax.cond(jnp.any(near), first, lambda: jnp.full((), jnp.inf))
    return jnp.where(jnp.isfinite(found), found, 0.0)


def _vertex(bend: Array, slope: Array) -> Array:
    """Where the slope of a parabola, `slope` at first, is zero."""
    return -slope / jnp.where(bend != 0, 2 * bend, 1.0)


def fraction_to_kink(kinks: Callable[[Any], Array], end: ArrayLike = 1.0) -> Array:
    """Fraction of a step just after which the first kink up to `end` lies; 1 where there is none, or at its start.

    `kinks` gives numbers (k,) at a fraction of the step, of which one changes its sign there. The first one that does,
    in units of its change up to the end, is followed to zero by false position (Illinois).
    """
    before, after = kinks(0.0), kinks(end)
    changed = (before > 0) != (after > 0)
    unit = jnp.where(changed, before - after, 1.0)

    def first(levels: Array) -> Array:
        return jnp.min(jnp.where(changed, levels / unit, jnp.inf))

    def look(now: tuple[Array, ...]) -> tuple[Array, ...]:
        low, at_low, high, at_high, count = now
        fraction = jnp.clip(low + (high - low) * at_low / (at_low - at_high) + NEAR / 2, low, high)
        value = first(kinks(fraction))
        return (
            jnp.where(value > 0, fraction, low), jnp.where(value > 0, value, at_low / 2),
            jnp.where(value > 0, high, fraction), jnp.where(value > 0, at_high / 2, value), count + 1,
        )  # fmt: skip

    def unfinished(now: tuple[Array, ...]) -> Array:
        low, _, high, _, count = now
        return (high - low > NEAR) & (count < MOST_LOOKS)

    looks = jnp.where(jnp.any(changed), 0, MOST_LOOKS)
    start = jnp.zeros(()), first(before), jnp.asarray(end, float), first(after), looks
    low, _, high, _, _ = jax.lax.while_loop(unfinished, look, start)
    return jnp.where(low > 0, high, 1.0)
