"""Whether a step of the transient went past an instant at which nothing slips, and how far it should have gone.

An error estimate does not show this: the evaluations of a step may all lie on one side of the jump of friction there,
or the jump be small compared with the other forces.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

NEAR = 2.0  # times the square of the way a step can go: what is further from rest is not looked at
JUST_SHORT = 1 - 1e-9  # of a step: one that ends so little after rest ends at rest, for again it would be no shorter
AT_THE_END = 1 - np.finfo(np.float64).epsneg  # of a step: it is over at its end
HALVINGS = 12  # of a step, in search of where slip turns round inside it


class Step(NamedTuple):
    """Slip motion and its change over the step, h times its rate, at both ends (n,), in units that make them alike."""

    before: Array
    after: Array
    change_before: Array
    change_after: Array


def fraction_to_rest(
    step: Step, inside: Callable[[Array], Array], slip: Callable[[Array], Array], least: Array
) -> Array:
    """Fraction of the step after which slip is below `least`, or 1 where it does not get there before the end.

    `inside` gives the slip motion (n,) at a fraction of the step, `slip` the slip speed of a motion. Along straight
    lines from the start to the end, or by way of the instant between where slip is least.
    """
    return jax.lax.cond(_gets_near(step), lambda: _fraction(step, inside, slip, least), lambda: jnp.ones(()))


def _gets_near(step: Step) -> Array:
    """Whether the step is long enough to get to rest at all, by bounds on its cubic; most are not, and this is cheap.

    |x(s) − x(0)| ≤ |x(1) − x(0)| + 4/27 (|ẋ(0)| + |ẋ(1)|), and a square of three terms is at most thrice their squares.
    """
    change, bow = step.after - step.before, (4 / 27) ** 2
    rates = step.change_before * step.change_before + step.change_after * step.change_after
    return jnp.sum(step.before * step.before) <= NEAR * 3 * jnp.sum(change * change + bow * rates)


def _fraction(step: Step, inside: Callable[[Array], Array], slip: Callable[[Array], Array], least: Array) -> Array:
    turn = _turn(step)
    middle = jax.lax.while_loop(
        lambda now: (turn < 1) & ~now[1],
        lambda _: (inside(turn), jnp.asarray(True)),
        (step.after, jnp.asarray(False)),
    )[0]
    first, found = _nearest(step.before, middle, slip, least)
    second, found_later = _nearest(middle, step.after, slip, least)
    later = jnp.where((turn < 1) & found_later, turn + second * (1 - turn), 1.0)
    fraction = jnp.where(found, first * turn, later)
    fraction = jnp.where((fraction >= JUST_SHORT) & (fraction < 1), AT_THE_END, fraction)
    return jnp.where(slip(step.before) < least, 1.0, fraction)  # at its start it is known already


def _nearest(start: Array, end: Array, slip: Callable[[Array], Array], least: Array) -> tuple[Array, Array]:
    """Fraction of a straight line between two motions at which it is nearest to rest, and whether that is rest."""
    change = end - start
    size = jnp.sum(change * change)
    fraction = jnp.clip(-jnp.sum(start * change) / jnp.where(size > 0, size, 1.0), 0.0, 1.0)
    return fraction, slip(start + fraction * change) < least


def _turn(step: Step) -> Array:
    """Fraction of the step at which slip is least, where it falls at first and rises in the end; else 1.

    Of the cubic through the motions and their rates at both ends, by halving. Where slip reverses and comes back within
    the step, that is where it is reversed most, and not where it vanishes: lines that end there do not cross zero.
    """
    returns = jnp.sum(step.before * step.after) > 0

    def growth(fraction: Array) -> Array:
        rest, ahead = 1 - fraction, step.after - step.before
        slope_before, slope_after = step.change_before, step.change_after
        bow = rest * (slope_before - ahead) - fraction * (slope_after - ahead)
        motion = rest * step.before + fraction * step.after + fraction * rest * bow
        rate = ahead + (rest - fraction) * bow + fraction * rest * (2 * ahead - slope_before - slope_after)
        reversed_slip = returns & (jnp.sum(motion * step.before) < 0)
        return jnp.sum(jnp.where(reversed_slip, step.before, motion) * rate)

    zero, one = jnp.zeros(()), jnp.ones(())
    turns = (growth(zero) < 0) & (growth(one) > 0)

    def halve(now: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        low, high, count = now
        middle = (low + high) / 2
        falls = growth(middle) < 0
        return jnp.where(falls, middle, low), jnp.where(falls, high, middle), count + 1

    found = jax.lax.while_loop(lambda now: turns & (now[2] < HALVINGS), halve, (zero, one, jnp.zeros((), int)))
    return jnp.where(turns, found[1], 1.0)
