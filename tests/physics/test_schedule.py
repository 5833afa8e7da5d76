"""Quantities prescribed over time: piecewise linear, held outside; and transients that see every corner of them."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from drumsqueal.physics.effects.forcing import PointForces
from drumsqueal.physics.effects.operation import Constant, OperatingPoint, Operation, PiecewiseLinear
from drumsqueal.physics.friction_law import ConstantLaw, StepLaw
from drumsqueal.physics.model import build_model
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.simulation import run
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.linear.steady import linearise
from drumsqueal.solve.transient.integrate import integrate, integrate_many
from profiles import unchanging

value = st.floats(-1e3, 1e3)
steps = st.lists(st.tuples(st.floats(1e-3, 10.0), value), min_size=1, max_size=6)


at = jax.jit(jax.vmap(lambda profile, time: profile.at(time), in_axes=(None, 0)))  # compiled once a number of points


@given(st.floats(-5.0, 5.0), value, steps)
@settings(derandomize=True, max_examples=60)
def test_a_profile_is_what_interpolation_gives(start, first, rest):
    time = start + np.concatenate([[0.0], np.cumsum([step for step, _ in rest])])
    values = np.array([first, *(v for _, v in rest)])
    profile = PiecewiseLinear(time, values)
    sought = np.concatenate([time, (time[1:] + time[:-1]) / 2, [time[0] - 1.0, time[-1] + 1.0]])
    found, rate = (np.asarray(x) for x in at(profile, sought))
    np.testing.assert_allclose(found, np.interp(sought, time, values), rtol=1e-12, atol=1e-9)
    # The slope is that of the piece to the right; before the first and from the last point on there is none.
    slopes = np.append(np.diff(values) / np.diff(time), 0.0)
    index = np.searchsorted(time, sought, side="right") - 1
    np.testing.assert_allclose(rate, np.where(index < 0, 0.0, slopes[index]), rtol=1e-12)


def test_a_constant_has_no_rate():
    moment = Operation(Constant(5.0), Constant(2e5)).at(jnp.asarray(0.3))
    assert (float(moment.drum_speed), float(moment.preload), moment.preload_rate) == (5.0, 2e5, None)


def test_a_moment_has_the_rate_of_the_load():
    speed, load = (np.array([5.0, 4.0]), np.array([1e5, 3e5]))
    moment = Operation(PiecewiseLinear(np.array([0.0, 1.0]), speed), PiecewiseLinear(np.array([0.0, 2.0]), load)).at(
        0.5
    )
    assert moment.preload_rate is not None
    found = (float(moment.drum_speed), float(moment.preload), float(moment.preload_rate))
    assert found == pytest.approx((4.5, 1.5e5, 1e5))


def test_forces_at_points_push_by_what_moves_along_them_and_do_work_as_they_rise():
    # 10 N that rise by 3 N/s and constant −4 N, by how far 1 of each coordinate moves their points along them.
    along, q = np.array([[1.0, 0.5], [2.0, -1.0]]), (0.2, 0.4)
    pushes, moment = PointForces(along), OperatingPoint(0.0, 0.0, 0.0, None, pushes=((10.0, 3.0), (-4.0, None)))  # pyright: ignore[reportArgumentType]
    action = pushes.act(moment, q, (5.0, 7.0))
    np.testing.assert_allclose(np.asarray(action.force), [10 - 8, 5 + 4], rtol=1e-15)
    # U = −Σ F_j u_j with u = (0.4, 0) m; what raises a force that has gone along takes −Ḟ u of it.
    assert float(pushes.potential_energy(moment, q)) == pytest.approx(-4.0, rel=1e-15)
    assert float(action.power) == pytest.approx(-1.2, rel=1e-15)


# --- corners in a transient ------------------------------------------------------------------------------------------

REST = np.zeros(1)
ULP = np.spacing(0.0021)
# Of 20 ns between two samples, of two round-offs of the time, at samples, and several between two samples; 50 kHz.
PULSES = {
    "time": [
        0,
        0.00123,
        0.00123001,
        0.00123002,
        0.0021,
        0.0021 + ULP,
        0.0021 + 2 * ULP,
        0.0025,
        0.00252,
        0.0025203,
        0.0026,
    ],
    "value": [200.0, 200, 4e6, 200, 200, 1e5, 200, 200, 300, 200, 250],
}


def linear_shoe(nominal, **values):
    """Bonded, with constant friction: linear, and pushed by the load, for friction drags it along.

    But for sin(2 Tz) of the supports: at 200 N, with Tz of some 1e-6, that is some 1e-11 of its slope.
    """
    linear = {"friction": {"law": "constant", "coefficient": 0.3, "direction": "unit-velocity"}}
    linear |= {"contact.separation": False, "damping": {"ratio": 0.02}, "start.displacement": {}}
    linear |= {"steady.state": "self-consistent", "contact.normal_load": PULSES, "simulate.duration": 0.004}
    return nominal.with_values(linear | values)


def exact(scene, times) -> np.ndarray:
    """Displacement (k, 3) from steady sliding by matrix exponentials from corner to corner, with load and rate."""
    model, load = build_model(scene), scene.contact.normal_load
    n, area = len(model.names), float(model.body.area)

    def force(value):
        pressed = dataclasses.replace(model, operation=Operation(model.operation.drum_speed, Constant(value / area)))
        return np.asarray(pressed.act(0.0, jnp.zeros(n), jnp.zeros(n))[0])

    matrix = np.zeros((2 * n + 2, 2 * n + 2))
    matrix[: 2 * n, : 2 * n] = linearise(model, jnp.zeros(n)).state_matrix()
    matrix[n : 2 * n, 2 * n] = (force(1.0) - force(0.0)) / np.asarray(model.mass)
    matrix[2 * n, 2 * n + 1] = 1.0
    nodes = np.union1d(times, load.time)
    values = np.interp(nodes, load.time, load.value) - load.value[0]
    state, states = np.zeros(2 * n + 2), []
    for k, width in enumerate(np.diff(nodes, append=nodes[-1] + 1)):
        state[2 * n :] = values[k], np.diff(values[k : k + 2], append=0.0)[0] / width
        states.append(state)
        state = scipy.linalg.expm(matrix * width) @ state
    return np.array(states)[np.isin(nodes, times)][:, :n]


@pytest.mark.thorough
@pytest.mark.parametrize(("solver", "tolerance"), [("dopri8", 1e-9), ("sdirk4", 1e-6)])
def test_pulses_between_samples_move_a_linear_shoe_as_they_should(nominal, solver, tolerance):
    scene = linear_shoe(nominal, **{"simulate.solver": solver, "simulate.tolerance": tolerance})
    result = run(scene)
    found = result.history["displacement"].sel(coordinate=["X", "Y", "Tz"]).values
    wanted = exact(scene, result.history["time"].values)
    # Errors of some thousand steps add up to less than the tolerance; 4e-10 and 2e-9 were found. A pulse that is
    # stepped over is missing as a whole.
    assert np.max(np.abs(found - found[0] - wanted) / np.abs(wanted).max(axis=0)) < tolerance
    assert np.abs(wanted).max() > 1e-7
    # The power of a load that changes jumps at its corners.
    energy = np.abs(result.history["energy_balance_error"]).max() / result.history["kinetic_energy"].max()
    assert energy < 10 * tolerance
    # It was not started, and no harmonic force acts; nor is it round-off that grows.
    assert "the changing load moves the shoe" in result.findings.verdict
    assert "round-off" not in result.findings.verdict
    assert {mode.note for mode in result.findings.modes} == {"moved by the changing load"}


@pytest.mark.thorough
def test_many_transients_and_one_that_is_taken_up_again_see_every_corner(nominal):
    # Pulses in the second chunk, which has 500 samples, one of them beginning with it.
    pulses = {"time": [0, 0.01, 0.010001, 0.010002, 0.013331, 0.013332], "value": [200, 200, 4e4, 200, 200, 300]}
    scene = linear_shoe(nominal, **{"contact.normal_load": pulses})
    model, rest = build_model(scene), np.zeros(3)
    how: Any = {"duration": 0.025, "sample_rate": 5e4, "tolerance": 1e-9}
    steady = analyse_stability(model).steady_state
    chunks = list(integrate(model, steady, rest, rest, **how))
    for again, chunk in zip(integrate(model, steady, rest, rest, since=chunks[0].end, **how), chunks[1:], strict=True):
        np.testing.assert_array_equal(again.displacement, chunk.displacement)
    alone = np.concatenate([chunk.displacement for chunk in chunks]) - steady
    many = list(integrate_many([model] * 2, *(np.stack([x, x]) for x in (steady, rest, rest)), **how))
    found = np.concatenate([batch.vibration[1] for batch in many])
    assert np.abs(alone).max() > 1e-8
    assert np.max(np.abs(found - alone)) < 1e-9 * np.abs(alone).max()  # the same method in another program


@pytest.mark.thorough
def test_ten_thousand_corners_cost_a_step_or_two_each():
    # A mass that is drawn by friction under a load that jitters: m v̇ = μ p(t), until the belt's speed, far away.
    rng = np.random.default_rng(4)
    time, load = np.sort(rng.uniform(0, 1, 10_000)), rng.uniform(0, 2, 10_000)
    model = block_on_belt(ConstantLaw(0.5), stiffness=1e-12, belt_speed=100.0)
    model = dataclasses.replace(model, operation=Operation(Constant(100.0), PiecewiseLinear(time, load)))
    chunks = list(integrate(model, REST, REST, REST, duration=1.0, sample_rate=100.0, tolerance=1e-9))
    wanted = 0.5 * (np.trapezoid(load, time) + load[0] * time[0] + load[-1] * (1 - time[-1]))
    assert chunks[-1].velocity[-1, 0] == pytest.approx(wanted, rel=1e-9)
    assert not chunks[-1].implicit.any()  # corners are no reason to call for the implicit method
    assert sum(chunk.steps for chunk in chunks) < 2.5 * time.size


@pytest.mark.thorough(but=["1"])
@pytest.mark.parametrize("parts", [1, 400])
def test_a_load_that_goes_between_two_samples_lets_a_stuck_block_go(parts):
    # The spring's 0.5 N is held by up to 1 N, which falls to nothing within 10 ms and comes back, between two samples.
    corners = np.concatenate([np.linspace(0.51, 0.52, parts + 1), np.linspace(0.52, 0.53, parts + 1)[1:]])
    load = PiecewiseLinear(corners, np.abs(corners - 0.52) / 0.01)
    model = dataclasses.replace(block_on_belt(StepLaw(1.0, 0.5)), operation=Operation(unchanging(0.0, 4), load))
    chunks = list(integrate(model, REST, REST + 0.5, REST, duration=3.0, sample_rate=10.0, tolerance=1e-9))
    changes = [change for chunk in chunks for change in chunk.changes]
    assert [sticks for _, sticks in changes] == [True, False, True]
    # Of the spring's 0.125 J friction takes what is lost, by a load that changes meanwhile.
    assert all(np.max(np.abs(chunk.energy_balance_error)) < 1e-8 for chunk in chunks)
    # It goes when half the load is left, at 0.515 s. From there on ẍ = −0.5 + 0.5 p(t) but for the spring's 1e-5.
    assert changes[1][0] == pytest.approx(0.515, abs=1e-9)
    grid = np.linspace(0.515, 0.53, 100_001)
    speed = -scipy.integrate.cumulative_simpson(0.5 - 0.5 * np.abs(grid - 0.52) / 0.01, x=grid, initial=0)
    moved = scipy.integrate.simpson(speed, x=grid)
    # Then friction and spring balance but for what it has moved: a quarter of an oscillation of 2π s.
    assert chunks[-1].displacement[5, 0] == 0.5
    wanted = 0.5 + moved * np.cos(0.07) + speed[-1] * np.sin(0.07)
    assert chunks[-1].displacement[6, 0] == pytest.approx(wanted, abs=1e-7)
    assert changes[2][0] == pytest.approx(0.53 + np.arctan2(-speed[-1], -moved), abs=1e-3)


def test_a_load_profile_presses_by_its_share_of_the_lining(nominal):
    # p0 = N / (R α w): at its corners, between them, and held before the first and behind the last.
    scene = nominal.with_values({"contact.normal_load": {"time": [1.0, 3.0], "value": [2000.0, 1000.0]}})
    shoe, operation = scene.shoe, build_model(scene, coordinates=("Y",)).operation
    area = shoe.outer_radius * shoe.arc_angle * shoe.width
    found = [float(operation.at(time).preload) for time in (0.0, 1.0, 2.5, 3.0, 9.0)]
    np.testing.assert_allclose(found, np.array([2000.0, 2000.0, 1250.0, 1000.0, 1000.0]) / area, rtol=1e-14)
