"""The lining's temperature and the fade of friction: closed forms, an independent integration, a lining that sticks."""

import dataclasses
import itertools
import json
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drumsqueal.files.history_file import Reached, ResumePoint, _digest, _from_plain, _to_plain
from drumsqueal.findings.history import signals_of
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.effects.friction import Temperature
from drumsqueal.physics.friction_law import ExponentialLaw, StepLaw
from drumsqueal.physics.inventory import take_inventory
from drumsqueal.physics.model import build_model
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.scene import SceneError
from drumsqueal.simulation import run
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.transient.integrate import integrate, integrate_many

TABLE = {"heat_capacity": "300 J/K", "cooling": "2 W/K", "fade": "0.001 1/K"}


def warm(model, heat_capacity, cooling, fade=0.0):
    return dataclasses.replace(model, remembering=(Temperature(heat_capacity, cooling, fade),))


def follow(model, steady, displacement, velocity, **how: Any):
    """Chunks of a transient."""
    return integrate(model, np.array(steady), np.array(displacement), np.array(velocity), **how)


def joined(chunks):
    """Time, displacement (k,), temperature (k,) and error of the energy balance (k,)."""
    parts = [(c.time, c.displacement[:, 0], c.remembered["lining_temperature"], c.energy_balance_error) for c in chunks]
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


@pytest.mark.thorough(but=["dopri8"])
@pytest.mark.parametrize("solver", ["dopri8", "tsit5", "sdirk4"])
def test_a_constant_heat_flow_warms_as_the_closed_form_says(solver):
    """A block at rest on a belt of 2 m/s under 10 N: P = μ N V = 8 W, ϑ = P/h (1 − exp(−h t/C))."""
    model = warm(block_on_belt(StepLaw(0.4, 0.4), load=10.0, belt_speed=2.0), 5.0, 3.0)
    chunks = follow(model, [4.0], [0.0], [0.0], duration=8.0, sample_rate=100.0, tolerance=1e-8, solver=solver)
    time, place, rise, error = joined(chunks)
    np.testing.assert_allclose(place, 4.0, rtol=1e-12)
    # Steps err by a hundredth of the tolerance each, of 1 K or of the rise; there are at most some hundred of them.
    np.testing.assert_allclose(rise, 8 / 3 * (1 - np.exp(-3 * time / 5)), rtol=0, atol=1e-8)
    assert np.abs(error).max() < 1e-7  # of 128 J that friction turned into heat


@pytest.mark.thorough
@pytest.mark.parametrize("solver", ["dopri8", "sdirk4"])
def test_fading_friction_agrees_with_an_independent_integration(solver):
    """A block that swings on a belt that it never sticks to, against SciPy's DOP853 at 1e-12."""
    law = ExponentialLaw(0.6, 0.3, 1.5)
    model = warm(block_on_belt(law, load=3.0, damping=0.05, stiffness=4.0, belt_speed=1.5), 2.0, 0.3, 0.05)
    steady = analyse_stability(model).steady_state
    cold = 0.3 + 0.3 * math.exp(-1.5 * 1.5)
    assert steady == pytest.approx([3 * cold / 4], rel=1e-12)  # at the temperature of the start

    def rates(_, state):
        x, v, rise = state
        slip = 1.5 - v
        friction = (0.3 + 0.3 * math.exp(-1.5 * slip)) * 3 * max(0.0, 1 - 0.05 * rise)
        return [v, friction - 0.05 * v - 4 * x, (friction * slip - 0.3 * rise) / 2]

    chunks = follow(model, steady, [0.1], [0.3], duration=20.0, sample_rate=50.0, tolerance=1e-9, solver=solver)
    time, place, rise, error = joined(chunks)
    wanted = solve_ivp(rates, (0, 20), [steady[0] + 0.1, 0.3, 0.0], "DOP853", time, rtol=1e-12, atol=1e-13).y
    assert wanted[2].max() > 3.9  # K: a fifth of the friction has gone
    # Ten times the tolerance, as trajectories are promised.
    np.testing.assert_allclose(place, wanted[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(rise, wanted[2], rtol=0, atol=1e-8 * wanted[2].max())
    assert np.abs(error).max() < 1e-7


def test_a_lining_that_sticks_cools_and_its_grip_has_faded():
    """Coulomb's block: while it sticks ϑ falls like exp(−h t/C), and it slips where k x = μs N (1 − γ ϑ)."""
    model = warm(block_on_belt(StepLaw(1.0, 0.5), belt_speed=0.2), 0.5, 0.05, 0.2)
    how = {"duration": 40.0, "sample_rate": 50.0, "tolerance": 1e-9}
    chunks = list(follow(model, [0.0], [0.0], [0.0], **how))
    time, place, rise, _ = joined(chunks)
    changes = [change for chunk in chunks for change in chunk.changes]
    spells = [(a, b) for (a, sticks), (b, slips) in itertools.pairwise(changes) if sticks and not slips]
    assert len(spells) >= 2
    for begin, end in spells:
        within = (time > begin) & (time < end)
        t, warmth = time[within], rise[within]
        np.testing.assert_allclose(warmth, warmth[0] * np.exp(-0.05 * (t - t[0]) / 0.5), rtol=1e-8)
        released = place[within][-1] + 0.2 * (end - t[-1])
        left = 1 - 0.2 * warmth[-1] * math.exp(-0.05 * (end - t[-1]) / 0.5)
        assert released == pytest.approx(left, rel=1e-6)  # of the time found, by bisection of the friction's reserve
    assert rise.max() > 0.05

    # From a checkpoint within, it goes on as without a break.
    checkpoint = chunks[1].end
    assert checkpoint is not None
    again = joined(follow(model, [0.0], [0.0], [0.0], **how, since=checkpoint))
    np.testing.assert_array_equal(again[2], rise[-again[2].size :])


def test_many_at_once_are_what_each_is_alone():
    models = [warm(block_on_belt(StepLaw(mu, mu), load=10.0, belt_speed=2.0), 5.0, 3.0, 0.1) for mu in (0.2, 0.4)]
    start = np.array([[0.1], [0.2]])
    how: Any = {"duration": 3.0, "sample_rate": 100.0, "tolerance": 1e-8}
    steady, rest = np.array([[2.0], [4.0]]), np.zeros((2, 1))
    together = np.concatenate([c.vibration for c in integrate_many(models, steady, start, rest, **how)], axis=1)
    for k, model in enumerate(models):
        alone = joined(follow(model, steady[k], start[k], rest[k], **how, solver="dopri8"))[1]
        # What is left of the friction moves the block by more than the tolerance; they differ by the rounding.
        assert np.ptp(alone) > 0.2
        np.testing.assert_allclose(together[k, :, 0] + steady[k], alone, rtol=0, atol=1e-12)


@pytest.fixture
def cold(nominal):
    """Return steady sliding under constant friction, which heats by 0.4 · 2000 N · 0.5 m/s = 400 W."""
    values = {"simulate.duration": 0.01, "start.displacement": {}, "friction": {"law": "constant", "coefficient": 0.4}}
    return nominal.with_values(values)


def test_the_lining_of_a_scene_warms_by_what_friction_makes_and_its_eigenvalues_are_those_of_the_cold_one(cold):
    scene = cold.with_values({"temperature": TABLE})
    assert set(signals_of(scene)) - set(signals_of(cold)) == {"lining_temperature"}
    assert "lining temperature and fade of friction" in take_inventory(scene).includes
    assert "lining temperature and fade of friction" in take_inventory(cold).leaves_out
    model, rest = build_model(scene), np.zeros(3)
    warming = Interpreted(lambda model, rise: model.rates(0.0, rest, rest, rise)[2])(model, np.array([30.0]))
    np.testing.assert_allclose(warming, (400 * (1 - 0.001 * 30) - 2 * 30) / 300, rtol=1e-12)
    hot, wanted = (analyse_stability(build_linear(each)).eigenvalues for each in (scene, cold))
    np.testing.assert_array_equal(hot, wanted)


@pytest.mark.thorough
def test_a_scene_with_a_temperature(cold):
    """Its history and verdict; eigenvalues are those of the cold lining."""
    result = run(cold.with_values({"temperature": TABLE}))
    history = result.history
    assert history["lining_temperature"].attrs["units"] == "K"
    wanted = 400 / 2 * (1 - np.exp(-2 * history["time"].values / 300))
    # It fades by 1.3e-5 at the end, of which the mean counts.
    np.testing.assert_allclose(history["lining_temperature"].values, wanted, rtol=1e-5, atol=1e-12)
    fading = 400 * (1 - 0.001 * history["lining_temperature"].values)
    np.testing.assert_allclose(history["friction_power"].values, fading, rtol=1e-9)
    assert "The lining warms up by 0.0133 K by the end, by which friction loses 0.0013 %" in result.findings.verdict
    np.testing.assert_array_equal(result.stability.eigenvalues, analyse_stability(build_linear(cold)).eigenvalues)


def build_linear(scene):
    return build_model(scene, coordinates=("X", "Y", "Z", "Tx", "Ty", "Tz"))


def test_without_it_nothing_is_in_the_program(nominal):
    def traced(scene):
        model = build_model(scene)
        memory = model.first_memory
        return jax.make_jaxpr(lambda q, v: model.rates(0.0, q, v, memory))(jnp.zeros(3), jnp.zeros(3))

    cold = build_model(nominal)
    assert cold.first_memory is None
    assert cold.remembered == ()
    act = jax.make_jaxpr(lambda q, v: cold.act(0.0, q, v))(jnp.zeros(3), jnp.zeros(3))
    assert str(traced(nominal)) == str(act)
    hot = traced(nominal.with_values({"temperature": TABLE}))
    assert len(hot.out_avals) == len(act.out_avals) + 1


@pytest.mark.thorough
def test_a_point_to_go_on_from_keeps_the_temperature(nominal):
    scene = nominal.with_values({"temperature": TABLE, "simulate.duration": 0.02, "start.displacement.Y": 1e-7})
    chunk = next(iter(follow(build_model(scene), np.zeros(3), [0, 1e-7, 0], np.zeros(3), duration=0.02,
                                sample_rate=50e3, tolerance=1e-6)))  # fmt: skip
    assert chunk.end is not None
    point = ResumePoint(Reached(501, chunk.steps, chunk.rejected_steps), chunk.end)
    digest = _digest(scene)
    again = _from_plain(json.loads(json.dumps(_to_plain(point, digest))), scene)
    assert chunk.end.state.memory is not None
    np.testing.assert_array_equal(again.checkpoint.state.memory, chunk.end.state.memory)
    with pytest.raises(ValueError, match="another memory"):
        _from_plain({**_to_plain(point, digest), "memory": [1.0, 2.0]}, scene)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"friction": None}, "temperature: without friction nothing heats the lining"),
        ({"temperature.heat_capacity": "0 J/K"}, "temperature.heat_capacity"),
        ({"temperature.fade": "1 K"}, "not a unit of fraction per temperature"),
        ({"temperature.cooling": "-1 W/K"}, "temperature.cooling"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(nominal, values, said):
    with pytest.raises(SceneError, match=said) as caught:
        nominal.with_values({"temperature": TABLE} | values)
    assert "\n" not in str(caught.value)
