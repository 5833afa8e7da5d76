"""Whether friction gives way within a step in which the lining sticks, and after what fraction of it.

What friction has to spare is looked at often enough for what moves meanwhile, by its value and its rate. Where it falls
at one look and rises at the next the least between them is sought, for friction may have given way there. What is
needed grows at a corner where another motion becomes the one that is resisted least: no corner is a minimum.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from drumsqueal.solve.transient.events import AT_THE_END, JUST_SHORT
from drumsqueal.solve.transient.stepping import Attempt
from drumsqueal.solve.transient.sticking import Spare

TIMING = 1e-14  # of all the time of a call, in which it is counted: how well the end of sticking is found
LOOKS_A_STEP = 4  # at least: ramps of load and speed have no period
STEEPER = 2.0  # times the tangents that a minimum is judged by, for slower and faster motions bend them
INNER = 0.1  # of where a minimum is sought: a look is no nearer to an end


class _Look(NamedTuple):
    """A time (s after the start of the chunk), and what friction has to spare then."""

    time: Array
    spare: Spare


class _Search(NamedTuple):
    """Friction holds up to `low`; at `high`, if that is not at infinity, it does not, or has had a minimum before it.

    `at_low` and `at_high` are what false position goes by, `time` is the next one to look at.
    """

    low: _Look
    high: _Look
    at_low: Array
    at_high: Array
    time: Array

    @property
    def brackets(self) -> Array:
        """Whether friction gives way between the two."""
        return (self.high.time < jnp.inf) & (self.high.spare.value < 0)

    @property
    def narrows(self) -> Array:
        """Whether a minimum is sought between the two."""
        return (self.high.time < jnp.inf) & ~self.brackets


def fraction_to_release(attempt: Attempt, spare: Callable[[Array, Any], Spare], fastest: Array, timing: Array) -> Array:
    """Fraction of the step after which friction gives way, to a `timing` (s), or 1 where it holds to the end.

    `spare` looks at a time, beginning with the motion that was resisted least a moment ago (None: there is none);
    `fastest` (rad/s) is the highest frequency of what moves or acts meanwhile.
    """
    length = attempt.end - attempt.start
    period = 2 * jnp.pi / jnp.where(fastest > 0, fastest, 1.0)
    # 1 / 16 of the shortest period: from its fall to its rise a sine is convex then, and above its tangents
    often = jnp.minimum(jnp.where(fastest > 0, (1 / 16) * period, jnp.inf), length / LOOKS_A_STEP)
    apart = jnp.maximum(often, timing)  # or time would stand still

    def look(now: _Search) -> _Search:
        here = _Look(now.time, spare(now.time, now.low.spare.weakest))
        holds, bracketed = ~(here.spare.value < 0), now.brackets  # also where it is undefined
        follows = holds & (bracketed | (now.narrows & (here.spare.rate < 0)))
        low, high = _either(follows, here, now.low), _either(follows, now.high, here)
        passed = holds & ~bracketed & ~_may_dip(low, high, timing)
        low, high = _either(passed, high, low), _either(passed, nowhere, high)
        at_low = jnp.where(follows, here.spare.value, jnp.where(bracketed, now.at_low / 2, low.spare.value))
        at_high = jnp.where(follows, now.at_high / 2, here.spare.value)
        return _next(_Search(low, high, at_low, at_high, now.time))

    def _next(now: _Search) -> _Search:
        low, high = now.low, now.high
        ahead, width = jnp.minimum(low.time + apart, attempt.end), high.time - low.time
        root = low.time + width * now.at_low / (now.at_low - now.at_high) + timing / 2  # Illinois
        level = jnp.clip(low.spare.rate / (low.spare.rate - high.spare.rate), INNER, 1 - INNER)
        inside = jnp.where(now.brackets, jnp.clip(root, low.time, high.time), low.time + level * width)
        return now._replace(time=jnp.where(high.time < jnp.inf, inside, ahead))

    def unfinished(now: _Search) -> Array:
        ahead = now.narrows | (now.low.time < attempt.end)
        return jnp.where(now.brackets, now.high.time - now.low.time > timing, ahead)

    one, motion = jnp.ones(()), jax.eval_shape(spare, attempt.start, None).weakest
    before = _Look(attempt.start, Spare(one, 0 * one, jnp.zeros(motion.shape)))
    nowhere = before._replace(time=jnp.full((), jnp.inf))
    found = jax.lax.while_loop(unfinished, look, _Search(before, nowhere, one, -one, attempt.start)).high.time
    fraction = jnp.where(found < attempt.end - timing, jnp.maximum(found - attempt.start, timing) / length, AT_THE_END)
    # A step that is made again just short of where it ends would be stretched to that end once more.
    fraction = jnp.where(fraction < JUST_SHORT, fraction, AT_THE_END)
    return jnp.where(found < jnp.inf, fraction, 1.0)


def _may_dip(low: _Look, high: _Look, timing: Array) -> Array:
    """Whether friction could give way between two looks at which it holds: it falls, rises, and tangents get so low."""
    width, falls, rises = high.time - low.time, -STEEPER * low.spare.rate, STEEPER * high.spare.rate
    turns = (falls > 0) & (rises > 0) & (width > timing)
    where = (low.spare.value - high.spare.value + rises * width) / jnp.where(turns, falls + rises, 1.0)
    convex = (where >= 0) & (where <= width)
    return turns & ~(convex & (low.spare.value - falls * where >= 0))


def _either(yes: Array, one: Any, other: Any) -> Any:
    return jax.tree.map(lambda x, y: jnp.where(yes, x, y), one, other)
