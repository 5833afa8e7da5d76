"""Equilibria under friction: damped Newton, and where that fails the path of equilibria from no friction to all of it.

Coordinates are scaled by the roots of their own stiffness, so that neither units nor proportions count: a rotation
next to a translation, a soft support next to a stiff pin.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

# Forces are balanced when what is left is this fraction of those that cancel in it, and this fraction of the load.
ROUND_OFF, OF_LOAD = 1e-13, 1e-8
# Where Newton's steps get no shorter, so much is round-off: a pin ten thousand times as stiff as the lining leaves it.
LEAST, NEARLY = 64 * np.finfo(np.float64).eps, 1e-5
# Points on the way need not be balanced: where Newton's step is so short, of displacements and of the friction, what it
# leaves is as its square, less than tells one limit from another.
CLOSE = 1e-5
NEWTON_STEPS = 30  # of each try; five do where the start is near
FIRST_LENGTH, LEAST_LENGTH = 0.1, 1e-5  # of a step along the path, on which all of the friction is 1
RUNS_OFF = 1e4  # along the path where it is lost: farther, it does so, too
# Where it runs off, the fraction of the friction is nearly s − c/L at a length L, so that two points tell the limit s.
# It is known once the next two tell the same; all of the friction is out of reach where that is far beyond the limit.
SAME_LIMIT, SHORT_OF_ALL = 1e-5, 100.0  # part of the limit, times what is left up to it

SCALE, DIRECT, FRICTIONLESS, FOLLOW, ARRIVE, FOUND, NOT_FOUND = range(7)

Forces = Callable[[Array], tuple[Array, Array]]


class _Newton(NamedTuple):
    """Newton's method on its way: the last point taken with its matrix and its step, and the point to try next."""

    point: Array
    matrix: Array
    step: Array
    trial: Array
    damping: Array
    count: Array
    size: Array
    own: Array
    balanced: Array
    nearly: Array
    close: Array
    failed: Array


class _Path(NamedTuple):
    """The search on its way: its stage, the last equilibrium and the direction there, and what to try next.

    `speed` is how far the first equilibrium moves with the friction: lengths along the path count in it. `root` (n,) is
    that of each coordinate's own stiffness, `load` the largest force; both are found at the first stage, so that what
    the forces are made of is traced only once. `frictionless` (n,) is the equilibrium without friction. `limit` is the
    fraction of the friction at which the path seems to run off to infinity, `short` whether it does, short of all.
    """

    root: Array
    load: Array
    frictionless: Array
    stage: Array
    base: Array
    direction: Array
    length: Array
    speed: Array
    guess: Array
    row: Array
    count: Array
    limit: Array
    short: Array


class Equilibrium(NamedTuple):
    """Displacement x (n,), NaN where none was found; then `fraction` is that of the friction up to which there is one.

    `runs_off` says whether the equilibrium runs off to infinity there. `frictionless` (n,) is the equilibrium without
    friction from which the path was followed, NaN where it was not, or where there is none.
    """

    displacement: Array
    fraction: Array
    runs_off: Array
    frictionless: Array


class _System(NamedTuple):
    """A Newton step's matrix and right-hand side, the sizes of forces (n,) and each coordinate's own stiffness (n,).

    And whether forces are balanced, and nearly so.
    """

    matrix: Array
    right: Array
    size: Array
    own: Array
    balanced: Array
    nearly: Array


class _Problem(NamedTuple):
    """The forces on scaled coordinates: `root` (n,) of each one's own stiffness, and the load, the largest force."""

    forces: Forces
    root: Array
    load: Array

    def scaled(self, z: Array) -> tuple[Array, Array]:
        force, size = self.forces(jnp.append(z[:-1] / self.root, z[-1]))
        return force / self.root, size / self.root

    def newton_system(self, z: Array, row: Array) -> _System:
        """The equations of the step at a point."""
        n = self.root.size
        force, along, size = jax.linearize(self.scaled, z, has_aux=True)
        slope = jax.vmap(along, out_axes=-1)(jnp.eye(n + 1))
        cancelling = jnp.max(size + jnp.abs(slope[:, :n]) @ jnp.abs(z[:n]))
        left = jnp.max(jnp.abs(force))
        balanced = left <= jnp.minimum(ROUND_OFF * cancelling, OF_LOAD * self.load)
        nearly = left <= jnp.minimum(LEAST * cancelling, NEARLY * self.load)
        # A coordinate that nothing holds and nothing pushes stays where it is.
        idle = ~(jnp.any(slope[:, :n] != 0, axis=0) | jnp.any(slope != 0, axis=1))
        own = jnp.abs(jnp.diag(slope[:, :n]))
        slope = slope.at[:, :n].add(jnp.diag(jnp.where(idle, 1.0, 0.0)))
        return _System(jnp.vstack([slope, row]), jnp.append(-force, 0.0), size, own, balanced, nearly)


def find_equilibrium(forces: Forces, n: int, *, directly: ArrayLike = True) -> Equilibrium:
    """The displacement at which the forces vanish with all of the friction.

    `forces` takes x and, last, the fraction s of the friction that acts (n + 1,), and returns the sum of the forces
    and the sum of their magnitudes (n,). Newton's method starts from x = 0; where it fails, from the equilibrium
    without friction along the path of equilibria, round its turns, as far as s = 1. Not `directly`, it is followed from
    there at once: what is found then hangs together with the equilibrium without friction.
    """
    zero, one, all_friction, nowhere = jnp.zeros(n + 1), jnp.ones(()), _all_friction(n), jnp.full(n, jnp.nan)
    stage, guess = jnp.where(directly, DIRECT, FRICTIONLESS), jnp.where(directly, all_friction, zero)
    first = _Path(
        jnp.ones(n),
        zero[0],
        nowhere,
        stage,
        zero,
        zero,
        one,
        one,
        guess,
        all_friction,
        jnp.zeros((), int),
        zero[0],
        zero[0] > 0,
    )
    start = first._replace(stage=jnp.full_like(stage, SCALE), guess=all_friction)
    path = jax.lax.while_loop(lambda path: path.stage < FOUND, partial(_search, forces, first), start)
    found = path.stage == FOUND
    far = jnp.linalg.norm(path.base[:n]) > RUNS_OFF * path.speed
    reached = jnp.where(path.short | far, path.limit, path.base[n])
    displacement = jnp.where(found, path.guess[:n] / path.root, jnp.nan)
    return Equilibrium(displacement, jnp.where(found, 1.0, reached), (far | path.short) & ~found, path.frictionless)


def equilibrium_near(forces: Forces, guess: Array, own: Array, load: Array) -> Array:
    """The displacement at which the forces vanish that Newton's method comes to from a guess (n,); NaN for none.

    Coordinates are scaled by each one's stiffness `own` (n,), and forces count by the `load` (N, N m).
    """
    root = _root(own)
    problem = _Problem(forces, root, jnp.max(load / root))
    row = _all_friction(guess.size)
    found = _newton(problem, jnp.append(guess * root, 1.0), row, jnp.ones(()), jnp.asarray(NEWTON_STEPS))
    return jnp.where(found.balanced, _polished(found)[:-1] / root, jnp.nan)


def _root(own: Array) -> Array:
    """What scales each coordinate: the root of its own stiffness or, where it has none, of the largest."""
    largest = jnp.max(own)
    return jnp.sqrt(jnp.where(own > 0, own, jnp.where(largest > 0, largest, 1.0)))


def _all_friction(n: int) -> Array:
    """All of the friction on a shoe that is not displaced: as a point, and as the row that keeps s as it is."""
    return jnp.zeros(n + 1).at[n].set(1.0)


def _newton(
    problem: _Problem, guess: Array, row: Array, speed: Array, most: Array, on_the_way: ArrayLike = False
) -> _Newton:
    """Damped Newton steps from a guess, at `most` so many, with one more equation: the row times each step is zero."""

    def norm(z: Array) -> Array:
        return jnp.linalg.norm(jnp.append(z[:-1] / speed, z[-1]))

    def step(at: _Newton) -> _Newton:
        matrix, right, size, own, balanced, nearly = problem.newton_system(at.trial, row)
        both = jnp.linalg.solve(jnp.stack([at.matrix, matrix]), jnp.stack([right, right])[:, :, None])
        simplified, new = both[:, :, 0]
        # 0.25 of a damped step, by which the next one must be shorter (Deuflhard's natural monotonicity test)
        shorter = norm(simplified) <= (1 - 0.25 * at.damping) * norm(at.step)
        taken = (at.count == 0) | balanced | shorter
        damping = jnp.where(at.count == 0, 1.0, jnp.where(taken, jnp.minimum(1.0, 2 * at.damping), at.damping / 2))
        point, matrix, new = (
            jnp.where(taken, a, b) for a, b in ((at.trial, at.point), (matrix, at.matrix), (new, at.step))
        )
        usable = jnp.all(jnp.isfinite(new)) & (damping >= 1e-4) & (at.count < most)
        nearly = jnp.where(taken, nearly, at.nearly)
        trial = point + damping * new
        close = jnp.asarray(on_the_way) & (jnp.max(jnp.abs(new[:-1])) <= CLOSE * jnp.max(jnp.abs(point[:-1])))
        close = close & (jnp.abs(new[-1]) <= CLOSE)
        return _Newton(point, matrix, new, trial, damping, at.count + 1, size, own, balanced, nearly, close, ~usable)

    zero, no = jnp.zeros_like(guess), jnp.zeros((), bool)
    none, count = zero[:-1], jnp.zeros((), int)
    start = _Newton(guess, jnp.eye(guess.size), zero, guess, jnp.ones(()), count, none, none, no, no, no, no)
    end = jax.lax.while_loop(lambda at: ~(at.balanced | at.close | at.failed), step, start)
    point = jnp.where(end.close, end.point + end.step, end.point)
    return end._replace(point=point, balanced=end.balanced | end.nearly | end.close)


def _search(forces: Forces, first: _Path, path: _Path) -> _Path:
    """Try the guess, and decide what to try next: once coordinates are scaled, what comes `first`."""
    stage = path.stage
    most = jnp.where(stage == SCALE, 0, NEWTON_STEPS)
    found = _newton(_Problem(forces, path.root, path.load), path.guess, path.row, path.speed, most, stage == FOLLOW)
    root = _root(found.own)  # coordinates are not scaled yet at the first stage
    first = first._replace(root=root, load=jnp.max(found.size / root))
    return jax.tree.map(partial(jnp.where, stage == SCALE), first, _next(path, found))


def _next(path: _Path, found: _Newton) -> _Path:
    """What to try next after a guess."""
    n, all_friction, stage = path.root.size, _all_friction(path.root.size), path.stage
    beyond = (stage == FOLLOW) & found.balanced & (found.point[n] >= 1)
    onward = found.balanced & ((stage == FRICTIONLESS) | ((stage == FOLLOW) & ~beyond))
    tangent, speed, weight = _heading(path, found, all_friction)
    base, direction = jnp.where(onward, found.point, path.base), jnp.where(onward, tangent, path.direction)
    # 5 Newton steps to a point of the path, after which the next one is four times as far and not twice
    farther = jnp.where(found.count <= 5, 4, 2) * path.length
    length = jnp.where(onward, farther, jnp.where(beyond, path.length, path.length / 2))
    length = jnp.where(stage <= FRICTIONLESS, FIRST_LENGTH, length)
    # After 60 steps, or 1e5 along the path, decimetres where friction moves a lining by micrometres: there it runs off.
    lost = (length < LEAST_LENGTH) | (path.count > 60) | (jnp.linalg.norm(weight * base) > 1e5)
    lost = lost | (base[n] < 0)  # back where there is no friction
    limit, short = _runs_off(path, base, weight)
    short = short & onward
    lost = lost | short | ((stage == FRICTIONLESS) & ~found.balanced) | ~jnp.all(jnp.isfinite(direction))
    following = jnp.where(beyond, ARRIVE, jnp.where(stage == DIRECT, FRICTIONLESS, FOLLOW))
    done = found.balanced & ((stage == DIRECT) | (stage == ARRIVE))
    next_stage = jnp.where(done, FOUND, jnp.where(lost, NOT_FOUND, following))
    guess = jnp.where(beyond, _back(path, found), base + length * direction)
    guess = jnp.where(done, _polished(found), jnp.where(stage == DIRECT, 0.0, guess))
    row = jnp.where(beyond | (stage == DIRECT), all_friction, weight**2 * direction)
    at_rest = jnp.where((stage == FRICTIONLESS) & found.balanced, _polished(found)[:n] / path.root, path.frictionless)
    return path._replace(
        frictionless=at_rest,
        stage=next_stage,
        base=base,
        direction=direction,
        length=length,
        speed=speed,
        guess=guess,
        row=row,
        count=path.count + 1,
        limit=jnp.where(onward, limit, path.limit),
        short=short,
    )


def _heading(path: _Path, found: _Newton, all_friction: Array) -> tuple[Array, Array, Array]:
    """The direction of the path at an equilibrium, and the speed and weight by which lengths along it count."""
    n = all_friction.size - 1
    tangent = jnp.linalg.solve(found.matrix, all_friction)
    speed = jnp.where(path.stage == FRICTIONLESS, jnp.linalg.norm(tangent[:n]), path.speed)
    speed = jnp.where(speed > 0, speed, 1.0)
    weight = jnp.append(jnp.full(n, 1 / speed), 1.0)
    return tangent / jnp.linalg.norm(weight * tangent), speed, weight


def _runs_off(path: _Path, base: Array, weight: Array) -> tuple[Array, Array]:
    """The fraction of the friction to which the path tends, by its last two points, and whether it ends there."""
    n = path.root.size
    before, now = (jnp.linalg.norm((weight * each)[:n]) for each in (path.base, base))
    limit = (now * base[n] - before * path.base[n]) / (now - before)
    same = jnp.abs(limit - path.limit) < SAME_LIMIT * limit
    return limit, (now > RUNS_OFF) & same & (SHORT_OF_ALL * jnp.abs(limit - base[n]) < 1 - limit)


def _back(path: _Path, found: _Newton) -> Array:
    """Where the path went beyond s = 1, straight back between the two."""
    return path.base + (found.point - path.base) * (1 - path.base[-1]) / (found.point[-1] - path.base[-1])


def _polished(found: _Newton) -> Array:
    """The equilibrium found, with the last Newton step where that is small."""
    # 1e-8 of the displacement: the last Newton step is added where it is smaller, and no null direction
    small = jnp.max(jnp.abs(found.step)) <= 1e-8 * jnp.max(jnp.abs(found.point[:-1]))
    return found.point + jnp.where(small, found.step, 0.0)
