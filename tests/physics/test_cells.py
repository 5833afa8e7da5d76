"""Contact integrals over cells: against closed forms, the exact rigid surface, and brute force on the true levels."""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array

from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.effects.contact import Contact, Levels
from drumsqueal.physics.effects.friction import Friction, UnitVelocity
from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.physics.effects.pressure import Unilateral
from drumsqueal.physics.friction_law import (
    ExponentialLaw,
    FrictionLaw,
    StepLaw,
    breakpoints,
    friction_law,
    kinks,
)
from drumsqueal.physics.quadrature.area import AreaSurface
from drumsqueal.physics.quadrature.cells import CellNodes, Cells, Sampled, Spread, cells_for
from drumsqueal.physics.quadrature.lines import LineCells, across_width, half_rule, lines_for
from drumsqueal.physics.quadrature.surface import Boundaries, Level

SHOE = RigidShoe(0.1, 0.02, 0.0365, np.radians(130.0), 7820.0)
R, HALF_ANGLE, HALF_WIDTH, AREA = 0.1, float(SHOE.half_angle), 0.0365 / 2, float(SHOE.area)
CELLS = Cells()
NODES = CELLS.nodes(SHOE)
FALLING = ExponentialLaw(0.5, 0.3, 1.0)
EVEN = ExponentialLaw(0.4, 0.4, 1.0)  # the same μ everywhere, in the same program
NONE = jnp.zeros(0)
# A law with kinks at both ends of its points.
TABLE = friction_law("table", speed=np.array([0.2, 0.4, 0.6]), coefficient=np.array([0.5, 0.4, 0.2]))


def friction(level, slip, axial, law):
    """Pressure and tractions along θ and z, for a pressure level of any scale."""
    pressure = jnp.where(level < 0, 0.0, level)
    along, across = UnitVelocity().traction(law, pressure, slip, axial)
    return pressure, along, across


def totals_of(levels, law: FrictionLaw, surface) -> dict[str, Array]:
    """Forces and first moments of pressure and friction, over the area."""
    level, slip, axial = levels

    def densities(nodes):
        found = friction(level.at(nodes), slip.at(nodes), None if axial is None else axial.at(nodes), law)
        parts = {}
        for name, part in zip(("normal", "along", "across"), found, strict=True):
            if part is not None:
                arms = {"": 1.0, "x": nodes.cosine, "y": nodes.sine, "z": nodes.z / HALF_WIDTH}
                parts |= {name + key: part * arm * nodes.weight / AREA for key, arm in arms.items()}
        return parts

    return surface.integrate(SHOE, Boundaries(level, slip, axial, breakpoints(law), kinks(law), False), densities)


@eqx.filter_jit
def over_cells(values, law: FrictionLaw = FALLING, cells: Cells = CELLS):
    odd = False, False, isinstance(cells, LineCells)
    return totals_of([Sampled(*each) for each in zip(values, odd, strict=True)], law, cells)


@eqx.filter_jit
def exactly(levels, law: FrictionLaw):
    return totals_of(levels, law, AreaSurface(always_split=True))


def largest_difference(one, other) -> float:
    return max(abs(float(one[name] - other[name])) for name in other)


def rigid_state(generator: np.random.Generator) -> tuple[Level, Level, Level]:
    """Levels of a rigid shoe beyond the edges, V_z from next to nothing to more than V_θ."""

    def terms(size: float, count: int) -> list[Array]:  # arrays, so that all states share a program
        scale = size * np.array([1, 1, 0.3 / HALF_WIDTH, 0.3 / HALF_WIDTH])[:count]
        return [jnp.asarray(each) for each in scale * generator.normal(size=count)]

    pressure, slip, axial = (10 ** generator.uniform(*range_) for range_ in ((-0.5, 0.7), (-0.5, 0.7), (-4, 1)))
    return Level(1.0, *terms(pressure, 4)), Level(-0.5, *terms(slip, 4)), Level(*terms(axial, 2), *terms(axial, 1))


@pytest.mark.thorough
def test_levels_of_a_rigid_shoe_as_the_exact_surface():
    """Errors over the load: of all states within 1e-6."""
    generator, errors = np.random.default_rng(3), []
    for _ in range(40):
        levels = rigid_state(generator)
        errors.append(largest_difference(over_cells([each.at(NODES) for each in levels]), exactly(levels, FALLING)))
    assert max(errors) < 1e-6


LINES = LineCells()


@pytest.mark.thorough
@pytest.mark.parametrize("cells", [CELLS, pytest.param(LINES, marks=pytest.mark.slow)], ids=["whole", "lines"])
def test_forces_follow_boundaries_through_nodes_and_sides(cells: Cells):
    """Closed forms at every position: with pressure 1 + θ and θ − θ₀ slip, F = −μ ∫ N sgn dA; and lifting likewise.

    A rule that does not cut has kinks of 1e-3 at nodes; 1e-11 is round-off of a level's polynomial.
    """
    nodes = cells.nodes(SHOE)
    theta, ones = nodes.theta, jnp.ones(nodes.theta.size)
    sides = np.linspace(-HALF_ANGLE, HALF_ANGLE, cells.along + 1)[1:-1]
    places = np.unique(np.concatenate([np.asarray(theta)[:: cells.order], sides, sides + 1e-9, np.linspace(-1, 1, 15)]))
    law, strip, B = EVEN, 2 * HALF_WIDTH * R / AREA, HALF_ANGLE
    for place in places:
        found = over_cells([2 + theta, theta - place, 0 * ones], law, cells)
        before, after = ((2 * b + b**2 / 2) - (2 * a + a**2 / 2) for a, b in ((-B, place), (place, B)))
        assert abs(found["along"] + 0.4 * strip * (after - before)) < 1e-11
        found = over_cells([theta - place, -ones, 0 * ones], law, cells)
        assert abs(found["normal"] - strip * (B - place) ** 2 / 2) < 1e-11
        assert abs(found["along"] - 0.4 * strip * (B - place) ** 2 / 2) < 1e-11


@pytest.mark.thorough
def test_patches_appear_and_grow_continuously():
    """An elliptic patch that lifts or slips back: level (θ/a)² + (z/d)² − t, t from nothing to several cells."""
    a, d, theta, z = 0.31, 0.011, NODES.theta, NODES.z
    ones = jnp.ones(CELLS.count)
    for centre in (0.02, 0.13, float(NODES.theta[150])):
        bowl = ((theta - centre) / a) ** 2 + ((z - 0.003) / d) ** 2
        whole = float(jnp.sum(bowl * NODES.weight)) / AREA
        for t in [0, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 0.05, 0.1, 0.2, 0.4, 0.7]:
            patch = np.pi * a * d * R / AREA
            lifting = over_cells([bowl - t, -ones, 0 * ones], EVEN)
            assert abs(lifting["normal"] - (whole - t + patch * t**2 / 2)) < 1e-6
            turning = over_cells([ones, bowl - t, 0 * ones], EVEN)
            assert abs(turning["along"] + 0.4 * (1 - 2 * patch * t)) < 1e-6


@pytest.mark.thorough
def test_patches_of_mirrored_motion_appear_and_grow_continuously():
    """An elliptic patch about the middle of the width, or one that begins on an edge, which lines would miss.

    The lining is bent across 1.3 and 0.5 times as much as along; a plate that bends freely, by Poisson's ratio at most.
    What eight lines miss of an end between them is found to be 2.5e-6 at most. Bent 8 times as much, ends come between
    lines on which pressure varies as fast as along: 2.4e-5. Twelve lines leave half of either.
    """
    a, nodes = 0.31, LINES.nodes(SHOE)
    theta, zeta = nodes.theta, nodes.z / HALF_WIDTH
    for centre in (0.02, 0.13, float(nodes.theta[60])):
        for d, edge, largest in ((1.5, 0.0, 3e-6), (2.5, 1.0, 1e-6), (0.6, 0.0, 3e-5)):
            bowl = ((theta - centre) / a) ** 2 + jnp.abs(zeta**2 - edge) / d**2
            whole = float(jnp.sum(bowl * nodes.weight)) / AREA
            for t in (1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 0.05, 0.1, 0.2, 0.3):
                heights, weights = np.polynomial.legendre.leggauss(40)
                end = min(d * np.sqrt(t), 1.0) if edge == 0 else np.sqrt(max(1 - t * d**2, 0.0))
                low, high = (0.0, end) if edge == 0 else (end, 1.0)
                x = (1 - np.cos(np.pi * (heights + 1) / 2)) / 2  # crowds to both ends
                dx = np.pi / 4 * np.sin(np.pi * (heights + 1) / 2) * weights
                depth = t - np.abs((low + (high - low) * x) ** 2 - edge) / d**2
                missing = 4 / 3 * a * np.maximum(depth, 0) ** 1.5 @ dx * (high - low) / (2 * HALF_ANGLE)
                found = over_cells([bowl - t, -jnp.ones(LINES.count), 0 * theta], EVEN, LINES)
                assert abs(found["normal"] - (whole - t + missing)) < largest * whole


@pytest.mark.thorough
@pytest.mark.parametrize("slope", [0.1, 1.0, 10.0])
def test_slip_reversal_on_lines_against_adaptive_sums(slope: float):
    """V_θ = slope (θ − θ₀ − c z²) and V_z ∝ z, whose ratio turns the more along a line the nearer it is to the middle.

    Gauss's rule on as many lines errs by up to 6e-5: sums over a line have a logarithm of z.
    """
    nodes, arm = LINES.nodes(SHOE), 0.03
    zeta = nodes.z / HALF_WIDTH

    def levels(theta, zeta):
        return (
            1 + 0.3 * theta + 0.02 * zeta**2,
            slope * (theta - place - 0.01 * zeta**2),
            arm * zeta * (1 + 0.2 * theta),
        )

    point, weight = np.polynomial.legendre.leggauss(80)
    heights, across = (1 + point) / 2, weight / 2
    heights, across = heights**3, across * 3 * heights**2
    for place in (-0.9, -0.31, 0.0, 0.123, 0.5, 1.1):
        found = over_cells(levels(nodes.theta, zeta), FALLING, LINES)
        wanted = np.zeros(3)
        for z, part in zip(heights, across, strict=True):
            turn = place + 0.01 * z**2
            width = max(arm * z / slope, 1e-9)
            for end in (-HALF_ANGLE, HALF_ANGLE):
                most = np.arcsinh((end - turn) / width)
                t, along = most * (1 + point) / 2, most * weight / 2
                theta, dtheta = turn + width * np.sinh(t), np.abs(width * np.cosh(t) * along)
                normal, slip, axial = levels(theta, z)
                speed = np.hypot(slip, axial)
                force = -(0.3 + 0.2 * np.exp(-speed)) * normal / speed * dtheta * part / (2 * HALF_ANGLE)
                wanted += np.sum(force * slip), np.sum(force * slip * np.sin(theta)), np.sum(force * axial * z)
        for name, value in zip(("along", "alongy", "acrossz"), wanted, strict=True):
            assert abs(found[name] - value) < 1e-6


def test_slip_that_turns_within_a_cell_reverses_on_both_sides_of_the_turn():
    """Of V_θ = h² − (θ − c)² the lining slips backwards for 2h about c: R b (2h − (β − 2h)) is forward less back."""
    surface = LineCells(across=1)
    theta = np.asarray(surface.nodes(SHOE).theta)

    @Interpreted
    def net(values):
        slip = Sampled(values)
        boundaries = Boundaries(None, slip, None, NONE, NONE, False)  # pyright: ignore[reportArgumentType]
        return surface.integrate(SHOE, boundaries, lambda nodes: {"net": jnp.sign(slip.at(nodes)) * nodes.weight})

    width = 2 * HALF_ANGLE / surface.along
    for centre, half in ((width / 2, 0.3 * width), (0.3 * width, 0.2 * width), (width / 2, 1.2 * width)):
        found = net(half**2 - (theta - centre) ** 2)["net"]
        # A cell holds one or both of its ends; a parabola is known exactly.
        assert found == pytest.approx(R * 2 * HALF_WIDTH * (4 * half - 2 * HALF_ANGLE), rel=1e-12)


@pytest.mark.parametrize("surface", [CELLS, LineCells()], ids=["whole", "lines"])
def test_bounds_of_levels_are_reached_between_nodes(surface: Cells):
    """Of 1 − (θ/B)² and z θ, whose largest values lie at none of the nodes."""
    nodes = surface.nodes(SHOE)
    for level, largest in (
        (Sampled(1 - (nodes.theta / HALF_ANGLE) ** 2), 1.0),
        (Sampled(nodes.z / HALF_WIDTH * nodes.theta / HALF_ANGLE, odd=True), 1.0),
        (Sampled(-2 + 0 * nodes.theta), 2.0),
    ):
        assert float(jnp.max(jnp.abs(level.values))) <= largest + 1e-14
        assert largest - 1e-12 <= float(surface.bound(level)) <= 1.05 * largest


@pytest.mark.parametrize(("degrees", "lines"), [(4, 4), (8, 4), (12, 4), (13, 7), (15, 8), (30, 9)])
def test_lines_know_levels_of_as_many_degrees_across_as_shapes_have(degrees: int, lines: int):
    """The highest even power of them in the middle of the width and at its edge, as far as there are such rules.

    Four lines do for twelve degrees, of which the last are small.
    """
    chosen = lines_for(degrees)
    assert chosen.across == lines
    power = (degrees - 1) // 2 * 2
    values = across_width(lines, (0.0, 1.0), odd=False) @ half_rule(lines)[0] ** power
    if power < 2 * lines:
        np.testing.assert_allclose(values, [0.0, 1.0], atol=1e-11)  # round-off of the powers' inverse
    else:
        assert np.max(np.abs(values - [0.0, 1.0])) > 1e-6


@pytest.mark.parametrize(("degrees", "cells"), [(3, Cells(6, 1, 9)), (16, Cells(6, 1, 9)), (20, Cells(8, 2, 7))])
def test_shapes_of_more_degrees_take_two_cells_across(degrees: int, cells: Cells):
    assert cells_for(degrees) == cells


def wavy(generator: np.random.Generator, theta, z):
    """A smooth level as of elastic modes: waves down to a third of the arc, quartics across."""
    zeta, total = z / HALF_WIDTH, 0.0
    for _ in range(6):
        wave, phase = generator.uniform(0, 3 * np.pi / HALF_ANGLE), generator.uniform(0, 2 * np.pi)
        shape = np.polynomial.polynomial.polyval(zeta, generator.normal(size=5) * [1, 0.6, 0.4, 0.25, 0.15])
        total = total + 0.3 * np.cos(wave * theta + phase) * shape
    return total


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1, 6])
def test_levels_of_elastic_modes_against_brute_force(seed: int):
    """The true levels, not the polynomials, on a grid that resolves turn (V_z = 0.2) and contact boundary to 1e-7."""

    def levels(theta, z):
        generator = np.random.default_rng(seed)
        return [1 + 2 * wavy(generator, theta, z), -0.5 + wavy(generator, theta, z), 0.2 + 0 * theta]

    point, weight = np.polynomial.legendre.leggauss(4)
    theta, z = (
        np.ravel((np.arange(panels)[:, None] + (1 + point) / 2) * 2 / panels - 1) * size
        for panels, size in ((500, HALF_ANGLE), (200, HALF_WIDTH))
    )
    weights = np.tile(weight / 2, 200)[:, None] / 200 * (np.tile(weight / 2, 500) / 500)
    grid = np.meshgrid(theta, z)
    level, slip, axial = (jnp.asarray(each) for each in levels(*grid))
    parts = friction(level, slip, axial, FALLING)
    found = over_cells([jnp.asarray(each) for each in levels(np.asarray(NODES.theta), np.asarray(NODES.z))])
    for name, part in zip(("normal", "along", "across"), parts, strict=True):
        arms = {"": 1.0, "x": np.cos(grid[0]), "y": np.sin(grid[0]), "z": grid[1] / HALF_WIDTH}
        for key, arm in arms.items():
            assert abs(found[name + key] - np.sum(np.asarray(part) * arm * weights)) < 1e-6


@pytest.mark.slow
def test_kinks_of_a_law_are_cut():
    """Slip speeds from 0 to 0.8 m/s pass both ends of the table; without cuts at them the force is off by 5e-6."""
    levels = Level(2.0, 0.3, 0.4), Level(-0.35, 0.1, 0.4, 2.0, 1.0), Level(0.05, 0.02, 0.03)
    found = over_cells([each.at(NODES) for each in levels], TABLE)
    assert largest_difference(found, exactly(levels, TABLE)) < 1e-6


class SampledShoe(RigidShoe):
    """A rigid shoe whose levels are known by their values at the nodes of cells, as those of an elastic one."""

    def radial(self, q) -> Sampled:  # pyright: ignore[reportIncompatibleMethodOverride]
        return Sampled(super().radial(q).at(NODES))  # pyright: ignore[reportArgumentType]

    def along(self, v, turning=0.0) -> Sampled:  # pyright: ignore[reportIncompatibleMethodOverride]
        return Sampled(super().along(v, turning).at(NODES))  # pyright: ignore[reportArgumentType]

    def axial(self, v) -> Sampled:  # pyright: ignore[reportIncompatibleMethodOverride]
        return Sampled(super().axial(v).at(NODES))  # pyright: ignore[reportArgumentType]

    def tractions(self, nodes, load, drag, lateral):  # pyright: ignore[reportIncompatibleMethodOverride]
        del nodes
        return {name: Spread(each) for name, each in zip(("r", "t", "z"), (-load, drag, lateral), strict=True)}  # pyright: ignore[reportArgumentType]

    def resultant(self, total):
        shoe = RigidShoe(0.1, 0.02, 0.0365, np.radians(130.0), 7820.0)
        force = []
        for unit in np.eye(6):
            shapes = shoe.radial(tuple(unit)), shoe.along(tuple(unit)), shoe.axial(tuple(unit))
            force.append(sum(jnp.sum(shape.at(NODES) * total[name]) for shape, name in zip(shapes, "rtz", strict=True)))
        return tuple(force)


def contacts() -> tuple[Callable, Callable]:
    """Generalised forces (6,) by the exact surface and by cells, of displacements and rates (6,)."""
    moment = OperatingPoint(0.0, jnp.asarray(5.0), jnp.asarray(241499.6), None)

    def forces(shoe, surface):
        contact = Contact(shoe, Unilateral(0.35e11), Friction(FALLING, UnitVelocity()), surface)
        return lambda q, v: jnp.stack(contact.act(moment, tuple(q), tuple(v)).force)

    sampled = SampledShoe(0.1, 0.02, 0.0365, np.radians(130.0), 7820.0)
    return forces(SHOE, AreaSurface(always_split=True)), forces(sampled, CELLS)


@pytest.mark.slow
def test_contact_of_sampled_levels_as_of_exact_ones():
    """Forces of all six coordinates and, sliding on with a part lifted off, their derivatives."""
    exact, sampled = (eqx.filter_jit(each) for each in contacts())
    load = 241499.6 * AREA
    scale = load * np.array([1, 1, 1, R, R, R])
    generator = np.random.default_rng(11)
    size = np.array([1, 1, 1, 20, 20, 10])
    for speed in (0.1, 0.7):
        q, v = generator.normal(size=6) * 8e-6 * size, generator.normal(size=6) * speed * size
        assert np.all(np.abs(exact(q, v) - sampled(q, v)) < 1e-6 * scale)
    q, v = np.array([-4e-6, 6e-6, 0, 1e-4, 1e-4, 2e-5]), np.array([0.02, -0.03, 0.01, 0.1, 0.2, 0.1])
    for argument in (0, 1):
        one, other = (eqx.filter_jit(jax.jacfwd(each, argument))(q, v) for each in (exact, sampled))
        assert np.all(np.abs(one - other) < 1e-6 * np.abs(np.asarray(one)).max(axis=1, keepdims=True))


@pytest.mark.thorough
def test_what_is_spread_does_the_same_work():
    """Polynomials in θ and z times what is spread sum to their integral, also from within cut cells."""
    nodes = NODES
    level = Sampled(nodes.theta - 0.1 + 2e4 * nodes.z**2)

    @jax.jit
    def total(level: Sampled):
        def densities(nodes: CellNodes):
            pressure = jnp.maximum(level.at(nodes), 0.0) * nodes.weight
            return {"spread": Spread(pressure), "work": pressure * (nodes.theta**3 + nodes.z**2 * nodes.theta)}

        boundaries = Boundaries(level, None, None, NONE, NONE, False)  # pyright: ignore[reportArgumentType]
        return CELLS.integrate(SHOE, boundaries, densities)

    found = total(level)
    work = jnp.sum(found["spread"] * (nodes.theta**3 + nodes.z**2 * nodes.theta))
    assert abs(work - found["work"]) < 1e-14 * float(jnp.max(nodes.theta) ** 3)


# --- polynomials of few degrees, which cells and lines know exactly --------------------------------------------------

CUTS = np.array([0.2, 0.6])
FEW = Cells(5, 2, 5)
KINKED = friction_law("table", speed=CUTS, coefficient=np.array([0.5, 0.3]))


def polynomial_levels(theta, zeta, *, mirrored):
    """Pressure, V_θ and V_z, whose roots run from side to side of the lining; V_θ turns within the arc."""
    along = -0.3 + 0.5 * theta - 0.3 * theta**2
    if mirrored:
        return 0.4 + theta + 0.3 * zeta**2, along + 0.1 * zeta**2, zeta * (0.15 + 0.05 * theta)
    return 0.4 + theta + 0.3 * zeta, along + 0.35 + 0.1 * zeta, 0.12 - 0.05 * theta + 0.06 * zeta


@Interpreted
def spread_out(values, surface: Cells, law: FrictionLaw, odd: bool):
    pressure, slip, axial = (Sampled(each, odd=odd and k == 2) for k, each in enumerate(values))

    def densities(nodes):
        level = pressure.at(nodes)
        pressed, along, across = friction(level, slip.at(nodes), axial.at(nodes), law)
        touching = jnp.where(level >= 0, nodes.weight, 0.0)
        spread = Spread(along * nodes.weight), Spread(across * nodes.weight, odd=odd)
        return {"load": pressed * nodes.weight, "touching": touching, "along": spread[0], "across": spread[1]}

    boundaries = Boundaries(pressure, slip, axial, breakpoints(law), kinks(law), False)  # pyright: ignore[reportArgumentType]
    return surface.integrate(SHOE, boundaries, densities)


def work_of(surface: Cells, law: FrictionLaw, *, mirrored: bool):
    """Load and extent (m²), and the work of friction at polynomials of θ and z."""
    nodes = surface.nodes(SHOE)
    theta, zeta = np.asarray(nodes.theta), np.asarray(nodes.z) / HALF_WIDTH
    values = [jnp.asarray(each) for each in polynomial_levels(theta, zeta, mirrored=mirrored)]
    found = spread_out(values, surface, law, isinstance(surface, LineCells))
    along, across = (np.asarray(found[name]) for name in ("along", "across"))
    arms = along.sum(), along @ (theta**2 + zeta**2), across @ zeta, across @ (zeta * theta)
    return np.array([float(found["load"]), float(found["touching"]), *arms])


@pytest.mark.thorough(but=["even"])
@pytest.mark.parametrize("law", [StepLaw(0.4, 0.4), KINKED], ids=["even", "kinked"])
def test_what_cells_spread_over_pieces_does_the_work_of_friction(law):
    # On each of forty lines across, Gauss's rule between all roots; |V| is nowhere below 0.03 m/s.
    def roots(level, at):
        """Where a square in θ through three of its values vanishes."""
        found = np.roots(np.polyfit(at, level, len(at) - 1))
        return found.real[np.abs(found.imag) < 1e-12]

    (x, w), (y, v) = np.polynomial.legendre.leggauss(12), np.polynomial.legendre.leggauss(40)
    total = np.zeros(6)
    for zeta, share in zip(y, v, strict=True):
        at = np.linspace(-1, 1, 5) * HALF_ANGLE
        pressure, slip, axial = polynomial_levels(at, zeta, mirrored=False)
        cuts = [roots(pressure[:2], at[:2]), *(roots(slip**2 + axial**2 - cut**2, at) for cut in CUTS)]
        ends = np.clip(np.concatenate([np.linspace(-1, 1, 81) * HALF_ANGLE, *cuts]), -HALF_ANGLE, HALF_ANGLE)
        ends = np.unique(ends)
        half = np.diff(ends)[:, None] / 2
        theta, weight = (ends[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()
        pressure, slip, axial = polynomial_levels(theta, zeta, mirrored=False)
        speed, pressed = np.hypot(slip, axial), np.maximum(pressure, 0)
        drag = -(np.interp(speed, CUTS, [0.5, 0.3]) if law is KINKED else 0.4) * pressed / speed
        parts = pressed, pressure >= 0, drag * slip, drag * slip * (theta**2 + zeta**2), drag * axial * zeta
        parts = [*parts, drag * axial * zeta * theta]
        total += share * np.array([np.sum(each * weight) for each in parts])
    # Where lines of equal speed leave the lining between forty lines, 1e-6 is lost.
    np.testing.assert_allclose(work_of(FEW, law, mirrored=False), R * HALF_WIDTH * total, rtol=3e-6, atol=1e-9)


@pytest.mark.thorough
def test_lines_do_the_work_of_cells_where_the_plane_mirrors_it():
    found, wanted = (work_of(each, KINKED, mirrored=True) for each in (LineCells(5, 4, 5), FEW))
    # The extent jumps where pressure vanishes: as a recorded number, not as accurate.
    np.testing.assert_allclose(found[[0, 2, 3, 4, 5]], wanted[[0, 2, 3, 4, 5]], rtol=3e-6, atol=1e-9)
    assert found[1] == pytest.approx(wanted[1], rel=1e-3)


STEADY = Cells(5, 2, 5, slips=False)


@Interpreted
def forces_on(values, cells: Cells, change):
    """Forces on all nodes and how they change with the levels, cut at the boundary of contact."""

    def densities(levels, nodes):
        pressure, slip, axial = (each.at(nodes) for each in levels)
        pressed, along, across = friction(pressure, slip, axial, FALLING)
        spread = {"radial": -pressed, "along": along, "axial": across}
        heat = {"heat": along * nodes.weight}
        return {name: Spread(each * nodes.weight) for name, each in spread.items()} | heat

    def forces(values):
        sampled: Any = [Sampled(each) for each in values]
        levels = Levels(*sampled)
        boundaries = Boundaries(levels.pressure, levels.slip, levels.axial, breakpoints(FALLING), kinks(FALLING), False)
        if cells.slopes:
            return cells.forces(SHOE, boundaries, levels, densities)
        return cells.integrate(SHOE, boundaries, partial(densities, levels))

    return jax.jvp(forces, (values,), (change,))


@pytest.mark.parametrize("block", [3, 16])
def test_forces_change_with_levels_in_each_cell_as_central_differences(block):
    theta, zeta = (np.asarray(each) for each in (STEADY.nodes(SHOE).theta, STEADY.nodes(SHOE).z / HALF_WIDTH))
    pressure, slip, axial = polynomial_levels(theta, zeta, mirrored=False)
    values = tuple(map(jnp.asarray, (pressure, slip - 2.0, axial)))
    change = tuple(jnp.asarray((1 + k * theta) * (1 + zeta)) for k in range(3))
    arms = np.stack([np.ones_like(theta), theta, zeta, theta * zeta, theta**2])
    cells = dataclasses.replace(STEADY, slopes=Levels._fields, block=block)
    found, slopes = forces_on(values, cells, change)
    step = 1e-4
    ahead, wanted, behind = (
        forces_on(tuple(v + k * step * d for v, d in zip(values, change, strict=True)), STEADY, change)[0]
        for k in (1, 0, -1)
    )
    for name in ("radial", "along", "axial"):
        size = float(np.max(np.abs(wanted[name])))
        np.testing.assert_allclose(found[name], wanted[name], rtol=0, atol=1e-14 * size)
        # 6e-8 was found, a hundred times as much with ten times the step.
        central = arms @ (ahead[name] - behind[name]) / (2 * step)
        np.testing.assert_allclose(arms @ slopes[name], central, rtol=0, atol=2e-7 * float(np.max(np.abs(central))))
    assert np.isnan(found["heat"])  # sums are not asked for
