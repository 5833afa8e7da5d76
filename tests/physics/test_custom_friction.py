"""A friction law given in Python: the same as the built-in one where it is the same, and refused in words."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from drumsqueal import TabulatedLaw, build_model, growth_rate, run
from drumsqueal.scene import COORDINATES
from drumsqueal.solve.linear.modes import analyse_stability


def exponential(slip_speed):
    return 0.3 + 0.2 * jnp.exp(-1.0 * slip_speed)


def exponential_in_numpy(slip_speed: float) -> float:
    return 0.3 + 0.2 * float(np.exp(-slip_speed)) if slip_speed > 0 else 0.5


class Stribeck(eqx.Module):
    """Falls, and rises again with the viscous part."""

    viscous: jax.Array

    def coefficient(self, slip_speed):
        return exponential(slip_speed) + self.viscous * slip_speed


ALL = COORDINATES
SHORT = {"simulate.duration": 0.004, "start.displacement": {"Y": 2e-5, "Tz": 1e-4}}  # beyond both boundaries


@pytest.mark.thorough
def test_the_same_law_gives_the_same_eigenvalues_and_motion(nominal):
    own = analyse_stability(build_model(nominal, coordinates=ALL))
    given = analyse_stability(build_model(nominal, coordinates=ALL, friction_law=exponential))
    np.testing.assert_allclose(given.eigenvalues, own.eigenvalues, rtol=0, atol=1e-11 * 5e4)
    scene = nominal.with_values(SHORT | {"simulate.tolerance": 1e-10})
    difference = run(scene, friction_law=exponential).history["displacement"] - run(scene).history["displacement"]
    # A law of which nothing is known has the lining always split: other nodes, and so the tolerance and no less.
    assert np.abs(difference).max() < 1e-9 * 2e-5


@pytest.mark.thorough
def test_a_table_of_a_python_function_is_as_good_as_its_step(nominal):
    # The error of a cubic spline: 5/384 h⁴ max|μ''''| = 0.0026 h⁴ for values, and so to the fourth power.
    speeds = jnp.linspace(0, 2, 777)
    errors = []
    for points in (101, 201):
        law = TabulatedLaw.from_function(exponential_in_numpy, largest_speed=2.0, points=points)
        errors.append(float(np.max(np.abs(law.coefficient(speeds) - exponential(speeds)))))
    assert errors[0] < 0.0026 * 0.02**4 * 3  # three times at the ends
    assert 10 < errors[0] / errors[1] < 20
    law = TabulatedLaw.from_function(exponential_in_numpy, largest_speed=2.0)
    assert float(law.coefficient(jnp.asarray(5.0))) == pytest.approx(exponential_in_numpy(2.0), rel=1e-12)
    own = analyse_stability(build_model(nominal, coordinates=ALL))
    tabulated = analyse_stability(build_model(nominal, coordinates=ALL, friction_law=law))
    # Growth takes the slope of the law: third order in the step of 1e-3 m/s.
    np.testing.assert_allclose(tabulated.eigenvalues, own.eigenvalues, rtol=0, atol=1e-9 * 5e4)


@pytest.mark.thorough
def test_parameters_of_a_law_are_swept_and_differentiated_without_another_trace(nominal):
    traces = []

    @jax.jit
    def rate(viscous):
        traces.append(1)
        return growth_rate(build_model(nominal, friction_law=Stribeck(viscous)), "Y")

    # The slope of the friction curve is −μt + viscous, and the growth rate is linear in it as long as it is small.
    falling = 0.2 * np.exp(-0.5)
    values = [float(rate(np.float64(x))) for x in (0.0, 0.5 * falling, falling)]
    assert traces == [1]
    assert values[0] == pytest.approx(76.15675376696663, rel=1e-9)
    assert values[1] == pytest.approx((values[0] + values[2]) / 2, rel=2e-2)
    slope = float(jax.grad(rate)(np.float64(0.0)))
    assert slope == pytest.approx((float(rate(np.float64(1e-5))) - float(rate(np.float64(-1e-5)))) / 2e-5, rel=1e-5)


class Plain(eqx.Module):
    """A law that holds a number and a function of Python, not arrays."""

    scale: float
    shape: Any

    def coefficient(self, slip_speed):
        """μ at slip speeds (m/s)."""
        return self.scale * self.shape(slip_speed)


@pytest.mark.thorough
def test_a_law_may_hold_what_is_no_array(nominal):
    given = build_model(nominal, friction_law=Plain(1.0, exponential))
    state = jnp.asarray([1e-6, 2e-6, 0.0]), jnp.asarray([0.1, 0.2, 0.1])
    np.testing.assert_allclose(given.act(0.0, *state)[0], build_model(nominal).act(0.0, *state)[0], rtol=1e-10)


@pytest.mark.thorough
def test_a_law_that_encloses_what_is_differentiated_is_traced_with_it(nominal):
    # Nothing can be sampled there, so that the contact is cut for any law; forces are linear in μ.
    def force(scale):
        model = build_model(nominal, friction_law=lambda speed: scale * (1 + 0.5 * jnp.exp(-speed)))
        return model.act(0.0, jnp.zeros(3), jnp.asarray([0.1, 0.2, 0.1]))[0][0]

    value, slope = jax.jit(force)(0.3), jax.grad(force)(0.3)
    assert value == pytest.approx(float(force(0.3)), rel=1e-12)
    assert 0.3 * slope == pytest.approx(float(value), rel=1e-9)  # nothing else pushes X: the pressure is balanced
    # A law without anything traced is sampled all the same where the model is built within a program.
    inside = jax.jit(lambda q: build_model(nominal, friction_law=exponential).act(0.0, q, jnp.ones(3))[0])(jnp.zeros(3))
    np.testing.assert_allclose(inside, build_model(nominal).act(0.0, jnp.zeros(3), jnp.ones(3))[0], rtol=1e-10)


def test_a_law_that_is_not_finite_at_slow_slip_is_refused(nominal):
    with pytest.raises(ValueError, match="must be finite; this law gives nan at slow slip"):
        build_model(nominal, friction_law=lambda speed: 0.3 * speed / speed)


@pytest.mark.thorough
def test_history_and_inventory_say_that_a_law_was_given(nominal):
    result = run(nominal.with_values(SHORT), friction_law=exponential)
    assert result.history.attrs["friction_law"] == "exponential, given in Python"
    assert "friction: law exponential, given in Python" in result.findings.model["includes"]
    assert "friction_law" not in run(nominal.with_values(SHORT)).history.attrs


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (exponential_in_numpy, "cannot be traced by JAX .* TabulatedLaw.from_function"),
        (lambda speed: "slippery", "cannot be traced by JAX .* not a valid JAX type"),
        (lambda speed: jnp.sum(speed, axis=0), "one coefficient for every slip speed"),
        (0.4, "cannot be traced by JAX"),
    ],
)
def test_a_law_that_is_none_is_refused(nominal, law, said):
    with pytest.raises(TypeError, match=said):
        build_model(nominal, friction_law=law)


def test_a_law_without_friction_is_refused(nominal):
    with pytest.raises(ValueError, match="has no friction"):
        build_model(nominal.with_values({"friction": None}), friction_law=exponential)


@pytest.mark.parametrize(("speed", "points"), [(0.0, 100), (1.0, 3), (-1.0, 100)])
def test_a_table_needs_points_and_a_range(speed, points):
    with pytest.raises(ValueError, match="at least 4 points"):
        TabulatedLaw.from_function(exponential_in_numpy, largest_speed=speed, points=points)


def test_a_table_of_nothing_finite_is_refused():
    with pytest.raises(ValueError, match=r"not finite at a slip speed of 0 m/s"):
        TabulatedLaw.from_function(lambda s: 1 / s if s else float("inf"), largest_speed=1.0)
