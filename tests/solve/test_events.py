"""Where within a step slip ends, and where friction gives way: of motions that are known in closed form."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from drumsqueal.solve.transient.events import AT_THE_END, Attempt, SlipStep, fraction_to_release, fraction_to_stick
from drumsqueal.solve.transient.flow import _pushed
from drumsqueal.solve.transient.runge_kutta import DEFAULT, make_solver
from drumsqueal.solve.transient.stepping import _pieces
from drumsqueal.solve.transient.sticking import StictionMargin

LEAST = 1e-3


@eqx.filter_jit
def rests_at(cubics, leasts):
    """Of each motion x = c0 + c1 s + c2 s² + c3 s³ (4, 2) in two directions, over a step from s = 0 to 1."""

    def one(c, least):
        def inside(s):
            return c[0] + s * (c[1] + s * (c[2] + s * c[3]))

        step = SlipStep(inside(0.0), inside(1.0), c[1], c[1] + 2 * c[2] + 3 * c[3])
        return fraction_to_stick(step, inside, lambda x: jnp.sqrt(jnp.sum(x * x)), least)

    return jax.vmap(one)(cubics, leasts)


def along(*coefficients, across=0.0):
    """A motion in the first direction, and something constant in the second."""
    first = np.zeros(4)
    first[: len(coefficients)] = coefficients
    return np.stack([first, [across, 0, 0, 0]], axis=1)


def from_roots(*roots, height=1.0):
    return along(*(height * np.polynomial.polynomial.polyfromroots(roots)))


LINE = np.stack([np.array([0.6, -2.0, 0, 0]), np.array([-0.3, 1.0, 0, 0])], axis=1)  # both zero at 0.3
RESTS = {
    "a line through rest": (LINE, 0.3),
    "a line that misses it": (LINE + along(across=0.02), 1.0),
    "so little that it counts": (LINE + along(across=0.5e-3), 0.3),
    "away from rest": (along(0.5, 0.3), 1.0),
    "at rest when it starts": (along(0.5e-3, 0.4), 1.0),
    "the end": (along(0.8, -0.8), 1.0),
    "just short of the end": (along(0.8 * (1 - 1e-10), -0.8), AT_THE_END),
    # A parabola down to its minimum within what counts as none and back: its lines go by way of that instant.
    "touches at 0.4": (from_roots(0.4, 0.4, height=3.0), 0.4),
    "touches nearly": (from_roots(0.4, 0.4, height=3.0) + along(0.01), 1.0),
}


def by_definition(c, least):
    """The fraction by two straight lines, by way of the instant between at which slip is least or reversed most."""
    x = [np.polynomial.Polynomial(each) for each in c.T]
    before, after = c[0], c.sum(axis=0)
    returns = before @ after > 0

    def at(s):
        return np.array([each(s) for each in x])

    def growth(s):
        motion = at(s)
        rate = np.array([each.deriv()(s) for each in x])
        return (before if returns and motion @ before < 0 else motion) @ rate

    low, high = 0.0, 1.0
    turns = growth(0.0) < 0 < growth(1.0)
    for _ in range(12 if turns else 0):
        middle = (low + high) / 2
        low, high = (middle, high) if growth(middle) < 0 else (low, middle)
    found = []
    for start, end in [(before, at(high)), (at(high), after)][: 1 + turns]:
        way = np.clip(-start @ (end - start) / np.sum((end - start) ** 2), 0, 1)
        found.append(way if np.linalg.norm(start + way * (end - start)) < least else np.nan)
    if np.linalg.norm(before) < least:
        return 1.0
    if np.isfinite(found[0]):
        return found[0] * high
    return high + found[1] * (1 - high) if turns and np.isfinite(found[1]) else 1.0


def test_a_step_ends_where_slip_does():
    named = np.array([cubic for cubic, _ in RESTS.values()])
    # x = 3 (s − 0.3)(s − 0.6): lines go by way of s = 0.45, where it is reversed most, and cross zero on the way there.
    there_and_back = from_roots(0.3, 0.6, height=3.0)
    some = np.random.default_rng(6).normal(size=(400, 4, 2)) * np.array([1, 3, 4, 3])[:, None]
    cubics = np.concatenate([named, [there_and_back, -there_and_back], some])
    leasts = np.full(len(cubics), LEAST)
    leasts[-len(some) :] = 0.4
    found = np.asarray(rests_at(cubics, leasts))
    # The instant of least slip is halved to 2.4e-4; lines from there are as far off.
    for (name, (_, wanted)), each in zip(RESTS.items(), found, strict=False):
        assert each == pytest.approx(wanted, abs=0 if wanted in (1.0, AT_THE_END) else 3e-4), name
    before, least = 0.54, -3 * 0.15**2
    np.testing.assert_allclose(found[len(named) : len(named) + 2], 0.45 * before / (before - least), atol=3e-4)
    wanted = np.array([by_definition(*each) for each in zip(some, leasts[-len(some) :], strict=True)])
    np.testing.assert_allclose(found[-len(some) :], wanted, rtol=0, atol=1e-9)
    assert 50 < np.sum((wanted > 0) & (wanted < 1)) < 350


# --- friction gives way ----------------------------------------------------------------------------------------------

START, END, TIMING = 0.2, 1.7, 1e-12


@eqx.filter_jit
def gives_way(parameters):
    """What is spare is a + b t + c sin(ωt + φ), looked at often enough for ω."""

    def one(p):
        a, b, c, omega, phase = p

        def spare(time, near):
            del near

            def value(t):
                return a + b * t + c * jnp.sin(omega * t + phase)

            at, change = jax.jvp(value, (time,), (jnp.ones_like(time),))
            return StictionMargin(at, change, jnp.zeros(1))

        nothing = jnp.zeros(1)
        ends = jnp.asarray(START), jnp.asarray(END)
        attempt = Attempt(*ends, nothing, nothing, nothing, nothing, lambda time: nothing, {}, ends)
        return fraction_to_release(attempt, spare, jnp.abs(omega) * (c != 0), jnp.asarray(TIMING))

    return jax.vmap(one)(parameters)


RELEASES = {
    "a ramp": (0.8, -1.0, 0.0, 1.0, 0.0),
    "a ramp that lasts": (1.8, -1.0, 0.0, 1.0, 0.0),
    "a sine that dips shortly": (0.9995, 0.0, 1.0, 40.0, 0.3),
    "a sine that does not": (1.0005, 0.0, 1.0, 40.0, 0.3),
    "a sine on a ramp": (1.3, -0.2, 1.0, 17.0, -1.0),
    "at once": (-0.1, 0.5, 0.0, 1.0, 0.0),
    "the end": (END - 1e-14, -1.0, 0.0, 1.0, 0.0),
}


def test_friction_gives_way_where_nothing_is_spare_any_more():
    found = np.asarray(gives_way(np.array([*RELEASES.values()])))
    times = np.linspace(START, END, 3_000_001)
    for (name, (a, b, c, omega, phase)), each in zip(RELEASES.items(), found, strict=True):
        negative = np.flatnonzero(a + b * times + c * np.sin(omega * times + phase) < 0)
        if name == "the end":
            assert each == AT_THE_END
        elif negative.size == 0:
            assert each == 1.0, name
        else:  # to the distance of the points looked at; no sooner than it counts in time
            first = max(times[negative[0]] - START, TIMING)
            assert each == pytest.approx(first / (END - START), abs=5e-7), name
            assert each > 0


# --- tangents --------------------------------------------------------------------------------------------------------


LOCAL = 0.02  # of a step's error: what is lost to it counts


def rate(y, p):
    """Of a pendulum whose stiffness is p."""
    return jnp.stack([y[1], -p * jnp.sin(y[0]) - 0.4 * y[1]])


@eqx.filter_jit
def pushed(start, h, tangents, longest):
    """A step of the default method, tangents through it, and the derivatives of the step itself."""
    solver, piece = make_solver(DEFAULT), (jnp.asarray(-1.0), jnp.asarray(9.0))

    def step(y, p):
        first = rate(y, p)
        return solver.step(
            solver.prepared(lambda t, y, _: rate(y, p), y), 0.0, h, y, first, piece, jnp.asarray(False)
        ), first

    (end, _, dense, _, last), first = step(start, 3.0)
    attempt = Attempt(jnp.zeros(()), h, start, end, first, last, lambda time: start, dense, piece)

    def derivatives(y):
        return jnp.vstack([jax.jacfwd(rate)(y, 3.0).T, jax.jacfwd(rate, 1)(y, 3.0)])

    found = _pushed(attempt, tangents, derivatives, jnp.asarray(LOCAL), longest)
    by_state, by_p = jax.jacfwd(lambda y, p: step(y, p)[0][0], (0, 1))(start, 3.0)
    slopes = derivatives(start), derivatives(end)
    return found, by_state, by_p, first, last, slopes


@pytest.mark.parametrize("shifted", [False, True])
def test_tangents_through_a_step_are_its_derivatives(shifted):
    start, h = np.array([0.7, -0.3]), 0.05
    tangents = np.array([[1.0, 0.2], [-0.3, 1.5], [0.4, 0.6]])
    longest = 20.0 if shifted else 0.1
    given = start, np.asarray(h), tangents, np.asarray(longest)
    found, by_state, by_p, first, last, slopes = jax.tree.map(np.asarray, pushed(*given))
    shift = np.zeros((3, 1))
    if shifted:  # in a short step: along the motion, by which the change of the Jacobian moves them least
        of_rate = first @ (slopes[1][:2] - slopes[0][:2])
        of_tangents = tangents @ (slopes[1][:2] - slopes[0][:2])
        of_tangents[2] += slopes[1][2] - slopes[0][2]
        shift = (of_tangents @ of_rate / (of_rate @ of_rate + (LOCAL / longest / h) ** 2))[:, None]
    wanted = (tangents - shift * first) @ by_state.T + shift * last
    wanted[2] += by_p
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
    assert np.any(shift) == shifted


def test_what_is_prescribed_is_asked_for_within_its_piece():
    firsts, lasts, coming = (np.asarray(each) for each in eqx.filter_jit(_pieces)(jnp.asarray([1.0, 4.0]), 2.5))
    np.testing.assert_array_equal(coming, [-1.5, 1.5, np.inf])
    margin = 2 * np.finfo(float).eps
    np.testing.assert_allclose(firsts, [-np.inf, -1.5, 1.5], rtol=1e-14)
    assert firsts[1] + 2.5 >= 1.0
    assert lasts[0] + 2.5 <= 1.0
    assert firsts[2] - coming[1] == pytest.approx(4 * margin, rel=0.3)
    assert coming[1] - lasts[1] == pytest.approx(4 * margin, rel=0.3)
    assert lasts[2] == np.inf
