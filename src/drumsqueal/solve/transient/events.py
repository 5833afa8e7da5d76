"""Where a step should have ended: at a kink of the force, where nothing slips any more, or where friction gives way."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.solve.transient.sticking import StictionMargin


class Attempt(NamedTuple):
    """A step: its ends in time, the states (n,) and slopes (n,) there, and the state at any time between them.

    `dense` is what the method interpolates from: of an explicit one "k", h times the slopes of its stages (s, n).
    `piece` are the first and the last time at which to ask for what is prescribed.
    """

    start: Array
    end: Array
    before: Array
    after: Array
    slope_before: Array
    slope_after: Array
    inside: Callable[[Array], Array]
    dense: dict[str, Any]
    piece: tuple[Array, Array]


class Bracket(NamedTuple):
    """Two places between which a number falls through zero, and what false position takes for its values there."""

    low: Any
    at_low: Array
    high: Any
    at_high: Array

    @property
    def root(self) -> Array:
        """Where a line between the two is zero."""
        return self.low + (self.high - self.low) * self.at_low / (self.at_low - self.at_high)

    def narrowed(self, place: Any, value: Array, below: Array) -> "Bracket":
        """With a place between, which the zero lies `below` or above: the end that stays counts half (Illinois)."""
        return Bracket(
            jnp.where(below, self.low, place), jnp.where(below, self.at_low / 2, value),
            jnp.where(below, place, self.high), jnp.where(below, value, self.at_high / 2),
        )  # fmt: skip


def chosen(yes: Array, one: Any, other: Any) -> Any:
    """One tree of arrays, or another one."""
    return jax.tree.map(lambda x, y: jnp.where(yes, x, y), one, other)


# Steps that end where the force has a kink, so that none goes over it: its order holds on either side only.
#
# Over a kink the error falls like the second or third power of the step, not the ninth, and the estimate of it is none.
# Over growing transients of the nominal scene and beyond their contact boundaries, a step that is not kept over a kink
# and made again up to it takes a third fewer steps at equal error (medians over eight starts, errors of 1e-2 to 1e-6).
# Beyond a boundary that appears inside the arc forces change like the root of the time since: steps in that root,
# instead of time, were tried in the nominal scene, and were no fewer at a tolerance of 1e-3 and a tenth fewer at 1e-8.


_ABOUT = 0.2  # of the way to either end of a step: how far from an extreme the points lie by which it is found


def fraction_to_excursion(kinks: Callable[[Any], Array], before: Array, middle: Array, after: Array) -> Array:
    """Fraction of a step at which a number has come to the other side of zero, to which it goes back; 0 if none has.

    Nothing else shows that: the step's evaluations may all lie beside it. Numbers (k,) at both ends and in the middle
    say by their parabolas which come near zero; the extremes of those are looked for in `kinks`, the first one counts.
    """
    bend, slope = 2 * (before + after - 2 * middle), 4 * middle - 3 * before - after
    place = _vertex(bend, slope)
    way = -slope * place / 2  # from the start to the vertex, and back
    turns = ((before > 0) == (after > 0)) & (before * bend > 0) & (place > 0) & (place < 1)
    # 0.1 of the way to the extreme and back: what comes so near to zero by the parabola is looked at
    near = turns & (before / jnp.where(turns, way, 1.0) - 1 < 0.1)

    def look(which: Array) -> Array:
        about = place[which]
        low, high = about * (1 - _ABOUT), about + _ABOUT * (1 - about)
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

    # How close to the kink a step is to end, of its length; closer takes longer to find and makes no fewer steps.
    near_kink, most_looks = 1e-3, 10

    def look(now: tuple[Bracket, Array]) -> tuple[Bracket, Array]:
        bracket, count = now
        fraction = jnp.clip(bracket.root + near_kink / 2, bracket.low, bracket.high)
        value = first(kinks(fraction))
        return bracket.narrowed(fraction, value, ~(value > 0)), count + 1

    def unfinished(now: tuple[Bracket, Array]) -> Array:
        bracket, count = now
        return (bracket.high - bracket.low > near_kink) & (count < most_looks)

    looks = jnp.where(jnp.any(changed), 0, most_looks)
    start = Bracket(jnp.zeros(()), first(before), jnp.asarray(end, float), first(after))
    found, _ = jax.lax.while_loop(unfinished, look, (start, looks))
    return jnp.where(found.low > 0, found.high, 1.0)


# Whether a step of the transient went past an instant at which nothing slips, and how far it should have gone.
#
# An error estimate does not show this: the evaluations of a step may all lie on one side of the jump of friction there,
# or the jump be small compared with the other forces.


NEAR = 2.0  # times the square of the way a step can go: what is further from rest is not looked at
JUST_SHORT = 1 - 1e-9  # of a step: one that ends so little after rest ends at rest, for again it would be no shorter
AT_THE_END = 1 - np.finfo(np.float64).epsneg  # of a step: it is over at its end


class SlipStep(NamedTuple):
    """Slip motion and its change over the step, h times its rate, at both ends (n,), in units that make them alike."""

    before: Array
    after: Array
    change_before: Array
    change_after: Array


def fraction_to_stick(
    step: SlipStep, inside: Callable[[Array], Array], slip: Callable[[Array], Array], least: Array
) -> Array:
    """Fraction of the step after which slip is below `least`, or 1 where it does not get there before the end.

    `inside` gives the slip motion (n,) at a fraction of the step, `slip` the slip speed of a motion. Along straight
    lines from the start to the end, or by way of the instant between where slip is least.
    """
    return jax.lax.cond(_gets_near(step), lambda: _fraction(step, inside, slip, least), lambda: jnp.ones(()))


def _gets_near(step: SlipStep) -> Array:
    """Whether the step is long enough to get to rest at all, by bounds on its cubic; most are not, and this is cheap.

    |x(s) − x(0)| ≤ |x(1) − x(0)| + 4/27 (|ẋ(0)| + |ẋ(1)|), and a square of three terms is at most thrice their squares.
    """
    change, bow = step.after - step.before, (4 / 27) ** 2
    rates = step.change_before * step.change_before + step.change_after * step.change_after
    return jnp.sum(step.before * step.before) <= NEAR * 3 * jnp.sum(change * change + bow * rates)


def _fraction(step: SlipStep, inside: Callable[[Array], Array], slip: Callable[[Array], Array], least: Array) -> Array:
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


def _turn(step: SlipStep) -> Array:
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

    # Twelve halvings of a step, in search of where slip turns round inside it.
    found = jax.lax.while_loop(lambda now: turns & (now[2] < 12), halve, (zero, one, jnp.zeros((), int)))
    return jnp.where(turns, found[1], 1.0)


# Whether friction gives way within a step in which the lining sticks, and after what fraction of it.
#
# What friction has to spare is looked at often enough for what moves meanwhile, by its value and its rate. Where it
# falls at one look and rises at the next the least between them is sought, for friction may have given way there. What
# is needed grows at a corner where another motion becomes the one that is resisted least: no corner is a minimum.


TIMING = 1e-14  # of all the time of a call, in which it is counted: how well the end of sticking is found


class _Look(NamedTuple):
    """A time (s after the start of the chunk), and what friction has to spare then."""

    time: Array
    spare: StictionMargin


class _Search(NamedTuple):
    """Friction holds up to `low`; at `high`, if that is not at infinity, it does not, or has had a minimum before it.

    `bracket` is between the two where it does not, `time` is the next one to look at.
    """

    low: _Look
    high: _Look
    bracket: Bracket
    time: Array

    @property
    def brackets(self) -> Array:
        """Whether friction gives way between the two."""
        return (self.high.time < jnp.inf) & (self.high.spare.value < 0)

    @property
    def narrows(self) -> Array:
        """Whether a minimum is sought between the two."""
        return (self.high.time < jnp.inf) & ~self.brackets


def fraction_to_release(
    attempt: Attempt, spare: Callable[[Array, Any], StictionMargin], fastest: Array, timing: Array
) -> Array:
    """Fraction of the step after which friction gives way, to a `timing` (s), or 1 where it holds to the end.

    `spare` looks at a time, beginning with the motion that was resisted least a moment ago (None: there is none);
    `fastest` (rad/s) is the highest frequency of what moves or acts meanwhile.
    """
    length = attempt.end - attempt.start
    period = 2 * jnp.pi / jnp.where(fastest > 0, fastest, 1.0)
    # 1 / 16 of the shortest period: from its fall to its rise a sine is convex then, and above its tangents. Four
    # looks a step at least: ramps of load and speed have no period.
    often = jnp.minimum(jnp.where(fastest > 0, (1 / 16) * period, jnp.inf), length / 4)
    apart = jnp.maximum(often, timing)  # or time would stand still

    def look(now: _Search) -> _Search:
        here = _Look(now.time, spare(now.time, now.low.spare.weakest))
        holds, bracketed = ~(here.spare.value < 0), now.brackets  # also where it is undefined
        follows = holds & (bracketed | (now.narrows & (here.spare.rate < 0)))
        low, high = chosen(follows, here, now.low), chosen(follows, now.high, here)
        passed = holds & ~bracketed & ~_may_dip(low, high, timing)
        low, high = chosen(passed, high, low), chosen(passed, nowhere, high)
        fresh = Bracket(low.time, low.spare.value, high.time, here.spare.value)
        narrower = now.bracket.narrowed(here.time, here.spare.value, ~follows)
        return _next(_Search(low, high, chosen(bracketed, narrower, fresh), now.time))

    inner = 0.1  # of where a minimum is sought: a look is no nearer to an end

    def _next(now: _Search) -> _Search:
        low, high = now.low, now.high
        ahead, width = jnp.minimum(low.time + apart, attempt.end), high.time - low.time
        root = now.bracket.root + timing / 2
        level = jnp.clip(low.spare.rate / (low.spare.rate - high.spare.rate), inner, 1 - inner)
        inside = jnp.where(now.brackets, jnp.clip(root, low.time, high.time), low.time + level * width)
        return now._replace(time=jnp.where(high.time < jnp.inf, inside, ahead))

    def unfinished(now: _Search) -> Array:
        ahead = now.narrows | (now.low.time < attempt.end)
        return jnp.where(now.brackets, now.high.time - now.low.time > timing, ahead)

    one, motion = jnp.ones(()), jax.eval_shape(spare, attempt.start, None).weakest
    before = _Look(attempt.start, StictionMargin(one, 0 * one, jnp.zeros(motion.shape)))
    nowhere = before._replace(time=jnp.full((), jnp.inf))
    start = _Search(before, nowhere, Bracket(attempt.start, one, nowhere.time, -one), attempt.start)
    found = jax.lax.while_loop(unfinished, look, start).high.time
    fraction = jnp.where(found < attempt.end - timing, jnp.maximum(found - attempt.start, timing) / length, AT_THE_END)
    # A step that is made again just short of where it ends would be stretched to that end once more.
    fraction = jnp.where(fraction < JUST_SHORT, fraction, AT_THE_END)
    return jnp.where(found < jnp.inf, fraction, 1.0)


def _may_dip(low: _Look, high: _Look, timing: Array) -> Array:
    """Whether friction could give way between two looks at which it holds: it falls, rises, and tangents get so low."""
    steeper = 2.0  # times the tangents that a minimum is judged by, for slower and faster motions bend them
    width, falls, rises = high.time - low.time, -steeper * low.spare.rate, steeper * high.spare.rate
    turns = (falls > 0) & (rises > 0) & (width > timing)
    where = (low.spare.value - high.spare.value + rises * width) / jnp.where(turns, falls + rises, 1.0)
    convex = (where >= 0) & (where <= width)
    return turns & ~(convex & (low.spare.value - falls * where >= 0))
