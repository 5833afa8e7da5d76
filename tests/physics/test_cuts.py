"""Where quadratures cut, and the nodes they take there: against roots and sums in NumPy."""

from functools import partial
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.friction_law import (
    ExponentialLaw,
    StepLaw,
    TabulatedLaw,
    _end_of_stretch,
    _is_resolved,
    breakpoints,
    find_breakpoints,
    is_gradual,
    kinks,
    static_coefficient,
    with_breakpoints,
)
from drumsqueal.physics.quadrature.area import (
    CLEAR,
    CLOSE,
    FAR,
    NARROWEST,
    REACH,
    AreaSurface,
    LineVelocity,
    _is_straight,
    _pressed,
    _slowest,
    _where_reached,
    distances,
    find_breaks,
    graded,
    runaway_distances,
)
from drumsqueal.physics.quadrature.cells import Cells, Sampled
from drumsqueal.physics.quadrature.cut_cells import PLAIN_POINTS, Powers, line_nodes
from drumsqueal.physics.quadrature.lines import (
    LineCells,
    _counted,
    _with_neighbours,
    half_rule,
    legendre_across,
    onto_lines,
    sets_of_lines,
)
from drumsqueal.physics.quadrature.surface import Boundaries, Level, complex_roots, resolved

HALF, RADIUS = 1.1, 0.11
WIDTH: Any = 0.04
LINING: Any = SimpleNamespace(half_angle=np.asarray(HALF), width=WIDTH, outer_radius=RADIUS)
KINKS: Any = np.array([0.2, 0.55])

# --- along the arc ---------------------------------------------------------------------------------------------------

PRESSURE = Level(1.0, -0.9, 0.8, 20.0, -31.0)
SLIP = Level(-0.5, 0.35, 0.4, 9.0, 14.0)
AXIAL = Level(0.11, -0.2, 0.3)


@Interpreted
def breaks(pressure, slip, axial, kinks):
    boundaries = Boundaries(pressure, slip, axial, kinks, kinks, False)
    found, angles = find_breaks(LINING, boundaries), jnp.asarray([-1.0, 0.2, 0.7, 1.1])
    stretches = AreaSurface()._stretches(LINING, boundaries)
    return found, distances(found, angles), runaway_distances([pressure], WIDTH / 2, angles), stretches


def test_singularities_of_the_integral_across_are_found_where_they_are():
    pressed, turning, lateral = (Level(*map(jnp.asarray, each)) for each in (PRESSURE, SLIP, AXIAL))
    parted = breaks(pressed, turning, lateral, np.asarray(KINKS))
    found, away, runaway, stretches = jax.tree.map(np.asarray, parted)
    theta = found.angle + 1j * found.distance
    w = WIDTH / 2

    def parts(level, at):
        """What does not depend on z, and what z multiplies."""
        return level[0] + level[1] * np.cos(at) + level[2] * np.sin(at), level[3] * np.cos(at) + level[4] * np.sin(at)

    def speeds(at, z):
        """|V|² of real θ as a function of complex ones."""
        slip, slope = parts(SLIP, at)
        return (slip + z * slope) ** 2 + parts(AXIAL, at)[0] ** 2

    def turn(at):
        return tuple(one + 1j * other for one, other in zip(parts(SLIP, at), parts(AXIAL, at), strict=True))

    def either(function):
        """Smallest of a function at θ and at its conjugate: distances are without a sign."""
        return lambda at: np.minimum(np.abs(function(at)), np.abs(function(np.conj(at))))

    groups = [
        *(
            either(lambda at, z=z: parts(PRESSURE, at)[0] + z * parts(PRESSURE, at)[1])
            for _ in range(2)
            for z in (-w, w)
        ),
        *(either(lambda at, z=z: turn(at)[0] + z * turn(at)[1]) for _ in range(2) for z in (-w, w)),
        *[either(lambda at: parts(AXIAL, at)[0])] * 2,
        *[either(lambda at: turn(at)[0] * parts(PRESSURE, at)[1] - turn(at)[1] * parts(PRESSURE, at)[0])] * 4,
        *(either(lambda at, z=z, s=s: speeds(at, z) - s * s) for _ in range(4) for z in (-w, w) for s in KINKS),
        *(either(lambda at, s=s: parts(AXIAL, at)[0] - s) for _ in range(2) for s in (*KINKS, *-KINKS)),
    ]
    assert len(groups) == theta.size
    kept = 0
    for k, (function, at) in enumerate(zip(groups, theta, strict=True)):
        real = at.real + 0j if k < 4 else at  # those of the pressure are real, and taken to be far
        if found.distance[k] < FAR or found.split[k]:
            assert function(np.array([real]))[0] < 1e-9, k
            kept += 1
    assert kept > 20
    assert np.all(found.distance[:4] == FAR)
    # Splits are where one is close to the lining; those where boundaries meet only where the other runs over it.
    near = (np.abs(found.angle) < HALF) & (found.distance < CLOSE * HALF)
    np.testing.assert_array_equal(found.split[14:], near[14:])
    np.testing.assert_array_equal(found.split[4:8], near[4:8])
    runs = {}
    for name, level in (("slip", SLIP), ("pressure", PRESSURE)):
        value, slope = parts(level, found.angle)
        runs[name] = np.abs(value) <= REACH * w * np.abs(slope)
    np.testing.assert_array_equal(found.split[8:10], (near & runs["slip"])[8:10])
    np.testing.assert_array_equal(found.split[10:14], (near & runs["pressure"])[10:14])
    assert found.split[:4].any()
    assert found.split[8:14].any()
    # How far angles are from the nearest of them, all around.
    angles = np.array([-1.0, 0.2, 0.7, 1.1])
    apart = np.abs(np.angle(np.exp(1j * (angles[:, None] - found.angle))))
    np.testing.assert_allclose(away, np.minimum((apart + found.distance).min(axis=1), FAR), rtol=1e-9)
    middle = (angles[1:] + angles[:-1]) / 2
    value, slope = parts(PRESSURE, middle)
    crossed = np.abs(value) <= REACH * w * np.abs(slope)
    size = np.abs(parts(PRESSURE, angles)[1]) / np.hypot(*PRESSURE[3:])
    np.testing.assert_allclose(runaway, np.where(crossed, [size[:-1], size[1:]], FAR), rtol=1e-9)
    assert 0 < crossed.sum() < 3
    # Pieces cover the arc once, ends at the splits among them, and their panels are no longer than the way to the next.
    there = stretches.length != 0
    both = np.stack([stretches.start, stretches.start + stretches.length])[:, there]
    low, high = np.sort(both.min(axis=0)), np.sort(both.max(axis=0))
    np.testing.assert_allclose([low[0], high[-1]], [-HALF, HALF], rtol=1e-12)
    np.testing.assert_allclose(low[1:], high[:-1], atol=1e-12)
    ends = np.unique(np.concatenate([low, high]))
    for angle in found.angle[found.split]:
        assert np.abs(ends - angle).min() < 1e-9
    gap = np.minimum(stretches.reach * np.abs(stretches.length), FAR)[there]
    real = np.maximum(distance_to(found, stretches.start[there]) / CLEAR, NARROWEST * HALF)
    assert np.all(gap <= real * (1 + 1e-9))


def distance_to(found, angles):
    apart = np.abs(np.angle(np.exp(1j * (angles[:, None] - found.angle))))
    return np.minimum((apart + found.distance).min(axis=1), FAR)


STRAIGHT = (0.02, KINKS), (1e-4, KINKS), (1e-4, [0.95]), (0.02, [])
RANGES = (0.31, 0.5), (0.35, 0.56), (0.25, 0.31), (1.0, 5.0), (0.0, 0.29)


@eqx.filter_jit
def on_lines(value, slope, axial, distance):
    """Two lines across, on |z| ≤ 0.02 m, whose levels are value + slope z."""
    low, high = jnp.full(value.shape, -0.02), jnp.full(value.shape, 0.02)
    velocity = LineVelocity(value, slope, axial)
    return {
        "pressed": _pressed(value, slope, jnp.asarray(0.02)),
        "slowest": _slowest(value, slope, low, high),
        "reached": _where_reached(jnp.asarray(0.5), jnp.abs(value) / 4, jnp.abs(axial), slope),
        "straight": [_is_straight(velocity, jnp.asarray(half), jnp.asarray(some)) for half, some in STRAIGHT],
        "graded": graded(distance, 16, 1e-8),
        "resolved": [resolved(jnp.asarray([0.3, 0.9]), *map(jnp.asarray, each)) for each in RANGES],
    }


def test_lines_across_are_cut_where_their_levels_are_zero_and_speeds_are_those_of_kinks():
    value, slope = np.array([0.3, -0.4, 0.5, -0.6, 0.0]), np.array([-30.0, 40.0, 2.0, 3.0, 0.0])
    axial, distance = np.array([0.1, -0.2, 0.3, -0.4, 0.05]), np.array([1e-6, 1e-3, 0.1, 2.0, 50.0])
    found = jax.tree.map(np.asarray, on_lines(value, slope, axial, distance))
    # Pressed up to z = 0.01, from there on, all across, nowhere, and all across where it just touches.
    np.testing.assert_allclose(found["pressed"], [[-0.02, 0.01, -0.02, -0.02, -0.02], [0.01, 0.02, 0.02, -0.02, 0.02]])
    np.testing.assert_allclose(found["slowest"], [[0.01, 0.01, -0.02, 0.02, 0.02], [0, 0, 0.46, 0.54, 0]], atol=1e-15)
    reach = np.sqrt(0.25 - axial**2) - np.abs(value) / 4
    np.testing.assert_allclose(found["reached"][:4], (np.maximum(reach, 0) / np.abs(slope + (slope == 0)))[:4])
    assert [bool(each) for each in found["straight"]] == [False, False, True, False]
    points, weights = found["graded"]
    np.testing.assert_allclose(weights.sum(axis=0), 1.0, rtol=1e-9)
    # ∫ dx/√(x² + δ²) over [0, 1] is arsinh(1/δ); farther than ten lengths it is not felt.
    wanted = np.arcsinh(1 / distance)
    np.testing.assert_allclose(np.sum(weights / np.sqrt(points**2 + distance**2), axis=0), wanted, rtol=1e-10)
    # Between two of a law's speeds, and no more than a third of what is between.
    assert [bool(each) for each in found["resolved"]] == [True, False, False, True, False]


@pytest.mark.parametrize(
    ("value", "slope", "axial"),
    [(0.3, -30.0, 1e-5), (0.3, -30.0, 0.07), (-0.9, 41.0, 1e-3), (0.8, 21.0, 0.19)],  # turned inside, and off an end
)
def test_friction_across_a_line_is_summed_to_its_turn_and_between_the_kinks_of_its_law(value, slope, axial):
    low, high = -0.02, 0.019
    speeds, coefficients = [0.0, *KINKS, 9.0], [0.5, 0.4, 0.36, 0.31]

    def tractions(z):
        """Along the drum and across it; the former is odd about the turn, so that errors there cancel."""
        slip = value + slope * z
        speed = np.hypot(slip, axial)
        return np.interp(speed, speeds, coefficients) * np.array([slip, axial + 0 * slip]) / speed

    line = [np.full(1, each) for each in (value, slope, axial, low, high)]
    found = Interpreted(lambda v, s, a, *ends: AreaSurface()._turning(LineVelocity(v, s, a), KINKS, *ends))(*line)
    z, weight = found
    assert weight.shape[1:] == (1 + KINKS.size, 2, 1)
    assert weight.sum() == pytest.approx(high - low, rel=1e-9)
    breaks = [-value / slope] + [(side * np.sqrt(k**2 - axial**2) - value) / slope for k in KINKS for side in (-1, 1)]
    breaks += [-value / slope + side * axial / abs(slope) * 10.0**k for k in range(5) for side in (-1, 1)]
    breaks = np.unique(np.clip([low, *breaks, high], low, high))
    for k in range(2):
        wanted = sum(quad(lambda z: tractions(z)[k], *ends, epsabs=1e-14)[0] for ends in pairwise(breaks))  # noqa: B023
        # Sixteen nodes next to a turn are good to 1e-9 of the line's length.
        assert np.sum(weight * tractions(z)[k]) == pytest.approx(wanted, abs=1e-9 * (high - low))


def test_a_panel_is_summed_over_what_presses_and_over_what_has_lifted():
    start, stop = -0.5, 0.15  # where some of each line across presses

    def densities(nodes):
        sums = {"area": nodes.weight, "lever": nodes.z * nodes.weight}
        return sums | {"size": jnp.abs(PRESSURE.at(nodes)) * nodes.weight}

    def summed(start, stop):
        none = jnp.zeros(0)
        boundaries = Boundaries(PRESSURE, None, None, none, none, True, False)
        return AreaSurface()._panel(LINING, boundaries, densities, start, stop)

    found = Interpreted(summed)(np.asarray(start), np.asarray(stop))
    theta = start + (stop - start) * (np.arange(600) + 0.5) / 600
    z = WIDTH * ((np.arange(600) + 0.5) / 600 - 0.5)[:, None]
    level = PRESSURE.value(np.cos(theta), np.sin(theta), z)
    assert 0.2 < np.mean(level > 0) < 0.8
    area = RADIUS * (stop - start) * WIDTH
    assert found["area"] == pytest.approx(area, rel=1e-12)
    assert found["lever"] == pytest.approx(0.0, abs=1e-12 * area)
    # Midpoints on both sides of a kink.
    assert found["size"] == pytest.approx(np.mean(np.abs(level)) * area, rel=1e-5)


def test_a_complex_level_with_one_root_has_that_one():
    # (b − ic) ζ² + 2a ζ + b + ic with b = ic: ζ = −b/a, the other root being at infinity.
    a, b = np.array([-0.5, 0.7]), np.array([0.3 + 0.4j, -0.2 + 0.1j])
    level: Any = a + 0j, b, -1j * b
    there, angle, distance = jax.tree.map(np.asarray, jax.jit(complex_roots)(Level(*level)))
    assert there.tolist() == [[False, False], [True, True]]
    np.testing.assert_allclose(np.exp(1j * angle[1]), -b / a / np.abs(b / a), rtol=1e-12)
    np.testing.assert_allclose(distance[1], np.abs(np.log(np.abs(b / a))), rtol=1e-12)


# --- cells and lines -------------------------------------------------------------------------------------------------


@Interpreted
def of_a_line(pressure, slip, axial, half):
    powers = Powers(pressure[:, None], slip[:, None], axial[:, None])
    return [line_nodes(powers, half, jnp.asarray(KINKS), jnp.asarray(True), lifted=each) for each in (True, False)]


@pytest.mark.parametrize("half", [1, 2])
def test_nodes_of_a_line_are_cut_at_its_boundaries(half):
    # Pressed for s < 0.6; slip turns at 0.1 and reverses at −0.4 and 0.6.
    pressure, slip = np.array([0.6, -1.0, 0.0, 0.0]), np.array([-0.24, -0.2, 1.0, 0.0])
    axial = np.array([0.07, 0.02, 0.0, 0.0])
    both = jax.tree.map(np.asarray, of_a_line(pressure, slip, axial, np.array([half])))
    low, high = {1: (-1, 0.1), 2: (0.1, 1)}[half]
    assert both[0][1].sum() == pytest.approx(high - low, rel=1e-10)
    assert both[1][1].sum() == pytest.approx(min(high, 0.6) - low, rel=1e-10)

    def speed(s):
        return np.hypot(np.polyval(slip[::-1], s), np.polyval(axial[::-1], s))

    def force(s, mu):
        return mu(speed(s)) * np.maximum(np.polyval(pressure[::-1], s), 0) * np.polyval(slip[::-1], s) / speed(s)

    s = np.linspace(low, high, 4001)
    corners = [s[k] for cut in KINKS for k in np.flatnonzero(np.diff(np.sign(speed(s) - cut)))]
    points = [p for p in (-0.4, 0.1, 0.6, *corners) if low < p < high]
    # Where the law has a kink lines are cut to what six of Newton's steps leave.
    laws = {1e-9: lambda speed: 0.4 + 0 * speed, 5e-6: lambda speed: np.interp(speed, KINKS, [0.5, 0.3])}
    for near, mu in laws.items():
        wanted = quad(force, low, high, args=(mu,), points=points, epsabs=1e-12, limit=500)[0]
        for point, weight in both:
            assert np.sum(force(point, mu) * weight) == pytest.approx(wanted, abs=near)


@Interpreted
def of_what_presses(pressure):
    return line_nodes(Powers(pressure, None, None), jnp.zeros(4), jnp.zeros(0), jnp.asarray(True), lifted=False)


def test_what_presses_of_a_line_is_summed_on_two_stretches_at_most():
    """Above one root, below one, outside two and between two; all of a line, and none."""
    # Pressures (lines): 0.3 + s, 0.3 − s, s² − 1/4, 1/4 − s², by their powers.
    pressure = np.array([[0.3, 0.3, -0.25, 0.25], [1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0], [0.0] * 4])
    for lift, lengths in ((0.0, (1.3, 1.3, 1.0, 1.0)), (2.0, (2.0,) * 4), (-2.0, (0.0,) * 4)):
        lifted = pressure + lift * np.array([1.0, 0.0, 0.0, 0.0])[:, None]
        both = np.array(of_what_presses(lifted))
        assert both.shape == (2, PLAIN_POINTS, 2 * 4)
        point, weight = both.reshape(2, -1, 4)  # of each line
        np.testing.assert_allclose(weight.sum(axis=0), lengths, atol=1e-12)
        for k, powers in enumerate(lifted.T):
            level = np.polynomial.Polynomial(powers)
            assert np.all(level(point[:, k]) * weight[:, k] >= 0)
            wanted = quad(lambda s: max(level(s), 0.0), -1, 1, points=[-0.5, -0.3, 0.3, 0.5], epsabs=1e-13)[0]  # noqa: B023
            assert np.sum(level(point[:, k]) * weight[:, k]) == pytest.approx(wanted, abs=1e-11)


@pytest.mark.parametrize("count", [1, 3, 6])
def test_rules_and_polynomials_across_half_the_width_are_exact(count):
    place, weight = half_rule(count)
    assert np.all((place > 0) & (place < 1))
    for k in range(count):
        assert weight @ place ** (2 * k) == pytest.approx(1 / (2 * k + 1), rel=1e-11)
        log = weight @ (place ** (2 * k + 2) * np.log(place))  # ∫ z^n log z = −1/(n + 1)²
        assert log == pytest.approx(-1 / (2 * k + 3) ** 2, rel=1e-9)
    places, weights, even, odd = sets_of_lines(count)
    np.testing.assert_array_equal([places[0], weights[0]], [place, weight])
    assert places.shape == (3, count)
    for n in (0, 2 * count - 1, 4 * count - 1):  # the others together are Gauss's rule
        assert np.sum(weights[1:] * places[1:] ** n) == pytest.approx(1 / (n + 1), rel=1e-11)
    for first, matrix in ((0, even), (1, odd)):
        for power in range(first, 2 * count, 2):
            np.testing.assert_allclose(matrix @ place**power, places**power, atol=1e-9)
        table = legendre_across(count, odd=bool(first))
        for k in range(count):
            values = np.polynomial.legendre.legval(place, np.eye(2 * count)[2 * k + first])
            np.testing.assert_allclose(table @ values, np.eye(count)[k], atol=1e-9)


@eqx.filter_jit
def beside(ends, near, which):
    return _with_neighbours(ends, near), _counted(which)


def test_cells_are_cut_where_levels_may_vanish_and_slip_is_not_looked_at_where_nothing_presses():
    """Of five cells pressed all over, lifted, half of each, just touching, and pressed where slip is far from zero."""
    cells, point = Cells(along=5, across=1, order=3), np.array([-0.7, 0.0, 0.7])
    tilted = np.broadcast_to(point, (3, 3))
    pressure = np.stack([np.ones((3, 3)), -np.ones((3, 3)), -0.2 + tilted, np.zeros((3, 3)), 2.0 + tilted])
    slip = np.stack([0.1 * tilted] * 4 + [4.0 + 0.1 * tilted])
    none: Any = np.zeros(0)

    def near(pressure, slip):
        first: Any = Sampled(pressure.ravel())
        second: Any = Sampled(slip.ravel())
        return cells._near(Boundaries(first, second, None, none, none, False, False))

    slipping, pressing, ends = Interpreted(near)(pressure, slip)
    assert slipping.tolist() == [True, False, True, True, False]
    assert pressing.tolist() == [False, False, True, False, False]
    assert not ends.any()


def test_cells_without_a_gap_go_together_and_are_counted_row_by_row():
    ends = np.array([0, 0, 1, 0, 0, 1, 0, 0], bool)
    near = np.array([1, 1, 1, 0, 1, 0, 1, 1], bool)
    which = np.array([[1, 0, 1], [0, 1, 1]], bool)
    together, counted = beside(ends, near, which)
    assert np.asarray(together).tolist() == [True, True, True, False, False, False, False, False]
    assert np.asarray(counted).tolist() == np.cumsum(which).tolist()


def test_values_at_cells_are_taken_to_lines_by_their_polynomials():
    # Cubic in z within each of three cells across, and different in each; two shapes at once.
    cells, lines = Cells(2, 3, 4), LineCells(2, 4, 4)
    x = np.polynomial.legendre.leggauss(4)[0]
    zeta = ((2 * np.arange(3)[:, None] + 1 + x) / 3 - 1)[:, None, :, None]  # cells across, along, nodes across, along
    along = np.arange(2)[:, None, None] + x / 3

    def field(zeta, k):
        return (1 + 0.3 * k + along) * (0.2 - zeta + (0.7 + k) * zeta**3)

    values = np.stack([np.broadcast_to(field(zeta, k), (3, 2, 4, 4)).ravel() for k in (0, 1)])
    places = half_rule(4)[0]
    found = np.asarray(jax.jit(lambda values: onto_lines(cells, lines, values))(values))
    wanted = [np.stack([field(z, k)[:, 0] for z in places], axis=-1).swapaxes(0, 1).ravel() for k in (0, 1)]
    np.testing.assert_allclose(found, wanted, rtol=1e-11)


# --- laws given in Python --------------------------------------------------------------------------------------------


def kinked(speeds) -> Any:
    return np.maximum(0.5 - np.asarray(speeds), 0.2)


def chebyshev(order, speeds) -> Any:
    return np.cos(order * np.arccos(2 * (speeds - 0.2) / 0.5 - 1))


def undefined(speeds) -> Any:
    return np.where(speeds > 0.3, np.nan, 1.0)


def test_a_law_is_cut_where_it_has_a_kink_and_nowhere_else():
    # From rest, and from 0.1 m/s on, polynomials hold up to the kink at 0.3 m/s, and a part in 1e12 beyond.
    for low in (0.0, 0.1):
        assert _end_of_stretch(kinked, low, 1e-12) == pytest.approx(0.3, rel=1e-11)
    assert _end_of_stretch(kinked, 0.3, 1e-12) == 1e3
    # Of x² = (s − low)/length polynomials of degree 31: Chebyshev's fifteenth, and all but 2⁻³² of his sixteenth.
    for power, there in ((15, True), (16, False)):
        assert _is_resolved(partial(chebyshev, power), 0.2, 0.5, 1e-11) is there
    assert not _is_resolved(undefined, 0.2, 0.5, 1e-3)


def test_a_measured_law_knows_its_cuts_and_whether_it_is_gradual():
    law = with_breakpoints(SimpleLaw(lambda s: jnp.maximum(0.5 - s, 0.2)))
    np.testing.assert_allclose(breakpoints(law), [0.3], rtol=1e-11)
    np.testing.assert_allclose(kinks(law), [0.3], rtol=1e-11)
    assert not is_gradual(law)
    assert float(static_coefficient(law)) == 0.5
    even = with_breakpoints(SimpleLaw(lambda s: 0.4 + 0 * s))
    assert (breakpoints(even).size, kinks(even).size) == (0, 0)
    assert find_breakpoints(even).size == 0
    step = StepLaw(0.7, 0.4)
    assert (float(static_coefficient(step)), float(step.coefficient(jnp.zeros(()))), breakpoints(step).size) == (
        0.7,
        0.4,
        0,
    )


def test_a_law_that_knows_its_cuts_or_is_traced_is_not_sampled():
    own = ExponentialLaw(0.5, 0.3, 2.0)
    assert with_breakpoints(own) is own
    kept = []
    jax.eval_shape(lambda s: kept.append(with_breakpoints(SimpleLaw(lambda v: s * (v + 1)))) or s, 0.3)
    assert isinstance(kept[0], SimpleLaw)


class SimpleLaw(eqx.Module):
    """μ of a function."""

    function: Any = eqx.field(static=True)

    def coefficient(self, slip_speed):
        return self.function(slip_speed)


def test_a_table_is_a_spline_held_beyond_its_end():
    def law(speed):
        return 0.3 + 0.2 * np.exp(-2 * speed)

    table = TabulatedLaw.from_function(law, 1.5, points=61)
    speeds = np.array([0.0, 0.013, 0.4, 0.77, 1.49, 1.5, 1.6, 9.0])
    found = eqx.filter_jit(lambda table, at: table.coefficient(at))(table, speeds)
    np.testing.assert_allclose(found, law(np.minimum(speeds, 1.5)), atol=3e-9)  # the fourth power of 25 mm/s
