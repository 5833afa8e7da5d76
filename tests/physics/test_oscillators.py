"""The oscillators of the documentation: its examples run as they stand there, and print the published figures."""

import dataclasses
import re
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drumsqueal import integrate
from drumsqueal.errors import Ending, IntegrationError
from drumsqueal.physics.effects.effect import Action, Effect
from drumsqueal.physics.friction_law import ConstantLaw, ExponentialLaw, StepLaw, TabulatedLaw
from drumsqueal.physics.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.questions.cycle.study import find_cycle
from drumsqueal.questions.onset.study import study_onset
from drumsqueal.scene.variation import Variation
from drumsqueal.solve import motion as motion_module
from drumsqueal.solve.linear.modes import analyse_stability

PAGE = (Path(__file__).parents[2] / "docs" / "oscillators.md").read_text(encoding="utf-8")
IMPORTS, *_ = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
EXAMPLES = re.findall(r"```python\n((?:(?!```).)*?)```\n\n```text\n(.*?)```", PAGE, flags=re.DOTALL)
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.\d+")

LEINE = 1.13394468  # m, the largest displacement
# What each example prints, as published or in closed form; in a pair, with how far off it may be, elsewhere 1.1e-7, to
# which the published figure and the printed one are rounded. Nothing is published of None.
PUBLISHED = [
    [5.0, 3.9026054, 8.9026054, 0.5385165, 8.9026054, 0.0],
    # A smoothed law is known to three digits: a period of 11.901 s and 0.92 %.
    [12.0010313, -0.55543269, LEINE, (11.901, 5e-4), None, ((1 - 0.0092) * LEINE, 5e-5 * LEINE)],
    [1.03, -0.83, 0.63, -0.43, 0.23, -0.03, -0.03, 5 * np.pi / 2, 5.0],
    [0.75, np.sqrt(2), 0.2020718, 1.4285773],
    [4.4851447, 0.6835692, None],  # of the witness in tests/hard/test_lift_off.py
    [
        *(0.1, 0.0998748, 0.6616761, 0.5, 0.4838438, 0.5477484, 1.0, 8 / 3 / np.pi, 8 / 9 / np.pi),
        *(None, (0.6530018, 5e-7), (0.6530018, 5e-7)),  # printed with six digits
    ],
    # Grazing as of a return map of another code, printed with four digits.
    [1.1512925, 0.8, 0.0509483, 0.9987013, None, (1.836601, 5e-5), 0.8, (1.1512925, 5e-5), (1.836601, 5e-5)],
    [4.7680220, 4.7680220],  # 4 K(1/4)/√2
]


def numbers(text: str) -> list[str]:
    return NUMBER.findall(text)


@pytest.mark.thorough(but=["2", "3"])
@pytest.mark.parametrize("k", range(len(PUBLISHED)))
def test_examples_print_what_stands_below_them_and_that_is_what_was_published(k, capsys):
    code, shown = EXAMPLES[k]
    assert len([line for line in code.splitlines() if line]) <= 12
    names: dict = {"__name__": "oscillators"}
    exec(compile(IMPORTS, "oscillators.md", "exec"), names)  # the point of this test
    exec(compile(code, "oscillators.md", "exec"), names)
    printed = capsys.readouterr().out
    assert NUMBER.sub("", printed) == NUMBER.sub("", shown)
    for value, said in zip(numbers(printed), numbers(shown), strict=True):
        last = 10.0 ** -len(said.partition(".")[2])  # another machine rounds otherwise
        assert float(value) == pytest.approx(float(said), abs=1.5 * last)
    for value, published in zip(numbers(printed), PUBLISHED[k], strict=True):
        wanted, far = published if isinstance(published, tuple) else (published, 1.1e-7)
        assert wanted is None or float(value) == pytest.approx(wanted, abs=far)


def test_every_example_is_tested():
    assert len(EXAMPLES) == len(PUBLISHED) == PAGE.count("```text")


def pulled():
    return block_on_belt(ConstantLaw(0.3), stiffness=2.0, belt_speed=1.0, forces={"X": 0.2})


def test_a_constant_force_displaces_steady_sliding():
    assert analyse_stability(pulled()).steady_state == pytest.approx([0.25], rel=1e-12)  # (μN + F)/k


@pytest.mark.thorough
def test_a_constant_force_is_in_the_balance_of_energy():
    block = pulled()
    motion = integrate(block, {"displacement": {"X": 0.1}}, 20.0, sample_rate=10.0, tolerance=1e-9)
    # Friction is the same while it slips one way: x = 0.25 + 0.1 cos ωt. The tolerance over three periods.
    wanted = 0.25 + 0.1 * np.cos(np.sqrt(2) * motion.time)
    np.testing.assert_allclose(motion.displacement[:, 0], wanted, atol=1e-8)
    assert np.max(np.abs(motion.energy_balance_error)) < 1e-8


@pytest.mark.thorough
def test_a_harmonic_force_by_name_acts_on_its_coordinate():
    # Without friction and coupling: m y″ + (k + k3) y = A sin(Ωt + ψ) from rest, of which the phase makes a cosine.
    block = sprung_block_on_belt(
        ConstantLaw(0.0),
        mass=[1.0, 1.0],
        springs=np.diag([1.0, 2.0]),
        contact_stiffness=2.0,
        forces={"Y": (0.3, 0.5 / np.pi, np.pi / 2)},  # so small that it does not lift off
    )
    motion = integrate(block, {}, 20.0, sample_rate=10.0, tolerance=1e-9, origin=[0.0, 0.0])
    wanted = (np.cos(motion.time) - np.cos(2 * motion.time)) * 0.3 / (4.0 - 1.0)
    np.testing.assert_allclose(motion.displacement[:, 1], wanted, atol=1e-7)  # the tolerance over twenty radians
    np.testing.assert_array_equal(motion.displacement[:, 0], 0.0)


def test_damping_of_a_sprung_block_is_that_of_its_coordinates():
    block = sprung_block_on_belt(
        ConstantLaw(0.0), mass=[1.0, 1.0], springs=np.eye(2), contact_stiffness=0.0, damping=np.diag([0.1, 0.4])
    )
    rates = sorted(mode.growth_rate for mode in analyse_stability(block).modes)
    assert rates == pytest.approx([-0.2, -0.05], rel=1e-12)  # −c/2m


def test_a_body_that_nothing_drags_starts_where_its_springs_are_unloaded():
    motion = integrate(block_on_belt(StepLaw(0.3, 0.3)), {"velocity": [0.5]}, 0.2, sample_rate=10.0)
    assert motion.names == ("X",)
    assert (motion.displacement[0, 0], motion.velocity[0, 0]) == (0.0, 0.5)
    assert motion.outcome == "complete"


@pytest.mark.parametrize(("depth", "energy"), [(0.02, 0.004), (-0.5, 0.475)])
def test_a_load_that_rises_does_work_on_a_block_that_has_lifted_off(depth, energy):
    # N = max(0, 1 + 20 y): pressed, U = ½ k y², and lifted, U = −p0²/2k − p0 y, of which ∂U/∂p0 = e − y with e = −p0/k.
    # Friction of 0.3 N drags a block that moves at 2 m/s on a belt of 5 m/s along.
    block = sprung_block_on_belt(
        ConstantLaw(0.3), mass=[1.0, 1.0], springs=np.eye(2), contact_stiffness=20.0, belt_speed=5.0
    )
    moment = block.operation.at(0.0)._replace(preload_rate=jnp.asarray(3.0))
    q, v = (jnp.asarray(0.0), jnp.asarray(depth)), (jnp.asarray(2.0), jnp.asarray(0.0))
    normal = max(0.0, 1 + 20 * depth)
    assert float(block.contact.potential_energy(moment, q)) == pytest.approx(energy, rel=1e-12)
    action = block.contact.act(moment, q, v)
    np.testing.assert_allclose(np.asarray(action.force), [0.3 * normal, 1 - normal], rtol=1e-12)
    wanted = 0.3 * normal * 2 + (3 * (-1 / 20 - depth) if normal == 0 else 0.0)
    assert float(action.power) == pytest.approx(wanted, rel=1e-12)
    assert float(action.heat) == pytest.approx(0.3 * normal * 3, rel=1e-12)


def test_what_was_computed_before_a_failure_is_kept(monkeypatch):
    chunks = motion_module.chunks_of

    def failing(*arguments, **how):
        yield next(chunks(*arguments, **how))
        raise IntegrationError("the step size collapsed")

    monkeypatch.setattr(motion_module, "chunks_of", failing)
    block = block_on_belt(StepLaw(0.3, 0.3), belt_speed=1.0)
    motion = integrate(block, {}, 1000.0, sample_rate=10.0)
    assert motion.outcome.ending is Ending.FAILED
    assert motion.outcome == "failed: the step size collapsed"
    assert 0 < motion.time.size < 10_000
    assert motion.velocity.shape == (motion.time.size, 1)


@pytest.mark.thorough
def test_a_block_that_rests_turns_nowhere():
    motion = integrate(block_on_belt(ConstantLaw(0.3)), {"velocity": [0.2]}, 10.0, sample_rate=20.0)
    assert motion.changes
    assert motion.turning_points("X")[0].size == 0


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"start": {"speed": [1.0]}}, "start: 'speed' is neither displacement nor velocity"),
        ({"start": {"velocity": {"Y": 1.0}}}, "velocity: 'Y' is no coordinate of this model; it has X"),
        ({"start": {"displacement": [1.0, 2.0]}}, r"displacement: a number for each of X is needed, got shape \(2,\)"),
        ({"origin": 1.0}, r"origin: a number for each of X"),
        ({"duration": 0.0}, "one sample at least"),
        ({"sample_rate": np.nan}, "one sample at least"),
    ],
)
def test_what_cannot_be_integrated_is_refused(wrong, why):
    block = block_on_belt(ConstantLaw(0.3), belt_speed=1.0)
    with pytest.raises(ValueError, match=why):
        integrate(block, **({"start": {}, "duration": 1.0, "sample_rate": 10.0} | wrong))


@pytest.mark.parametrize(
    ("forces", "why"),
    [({"Y": 1.0}, "forces: 'Y' is no coordinate of this body; it has X"), ({"X": (1.0,)}, "forces: X must be")],
)
def test_a_force_that_is_none_is_refused(forces, why):
    with pytest.raises(ValueError, match=why):
        block_on_belt(ConstantLaw(0.3), forces=forces)


class CubicSpring(Effect):
    """F = −κ x³."""

    stiffness: jax.Array = eqx.field(converter=jnp.asarray)

    def act(self, moment, q, v):
        """The force; all of it comes from the potential."""
        del moment, v
        return Action((-self.stiffness * q[0] ** 3,), 0.0)

    def potential_energy(self, moment, q):
        """κ x⁴/4 (J)."""
        del moment
        return self.stiffness * q[0] ** 4 / 4


def stiffening(speed):
    """m x″ + c x′ + x + x³ = μ sgn(V − x′), μ = 0.5 + 0.5 exp(−2 s)."""
    block = block_on_belt(ExponentialLaw(1.0, 0.5, 2.0), damping=0.1, belt_speed=speed)
    return dataclasses.replace(block, others=(*block.others, CubicSpring(1.0)))


@pytest.mark.thorough
def test_a_cycle_with_a_force_of_ones_own_is_that_of_another_integration():
    speed = 0.8
    cycle = find_cycle(stiffening(speed), {"displacement": {"X": 0.5}}, 200.0, sample_rate=10.0)
    # It is released where x + x³ + c V = μ(0) = 1, slips until it is as fast as the belt again, and sticks until then.
    released = float(np.roots([1.0, 0.0, 1.0, 0.1 * speed - 1.0])[-1].real)

    def rate(_, u):
        return [u[1], 0.5 + 0.5 * np.exp(-2 * (speed - u[1])) - 0.1 * u[1] - u[0] - u[0] ** 3]

    def caught(time, u):
        return speed - u[1] if time > 0.5 else 1.0

    caught.terminal = True

    def turns(_, u):
        return u[1]

    found = solve_ivp(rate, (0, 20), [released, speed - 1e-9], events=[caught, turns], rtol=1e-11, atol=1e-12)
    places = found.y_events[1][:, 0]
    period = found.t[-1] + (released - found.y[0, -1]) / speed
    # Slip begins with a slip speed of 1e-9 m/s, and takes some 1e-4 s to grow by the root of that.
    assert cycle.period_s == pytest.approx(period, abs=1e-3)
    assert cycle.amplitude["X"] == pytest.approx(np.ptp(places) / 2, rel=1e-6)


@pytest.mark.thorough
def test_the_onset_of_a_body_with_a_force_of_ones_own_has_its_frequency():
    onset = study_onset(stiffening, Variation("V", "m/s", (1.0, 1.3)), sample_rate=10.0)
    (critical,) = onset.critical_values
    assert critical.value == pytest.approx(0.5 * np.log(10), rel=1e-9)
    steady = float(np.roots([1.0, 0.0, 1.0, -0.55])[-1].real)  # x + x³ = μ(V)
    assert critical.frequency_Hz == pytest.approx(np.sqrt(1 + 3 * steady**2) / (2 * np.pi), rel=1e-9)


def test_models_and_laws_are_shown_with_their_numbers():
    law = ExponentialLaw(1.0, 0.5, 2.0)
    assert repr(law) == "ExponentialLaw(static=1, kinetic=0.5, decay=2 s/m)"
    assert repr(StepLaw(1.0, 0.5)) == "StepLaw(static=1, kinetic=0.5)"
    table = TabulatedLaw.from_function(lambda slip: 0.5 - 0.1 * slip, 2.0, points=5)
    assert repr(table) == "TabulatedLaw(5 points, step=0.5 m/s)"
    assert repr(stiffening(1.2)) == (
        "Model(Block: X 1 kg; speed 1.2 m/s, load 1 N; Bonded contact of 0 N/m; "
        f"{law}; Springs(matrix=1); Damping(matrix=0.1); CubicSpring(stiffness=1))"
    )
    block = sprung_block_on_belt(StepLaw(1.0, 0.5), mass=[1.0, 2.0], springs=[[2, 1], [1, 2]], contact_stiffness=0.7)
    assert "Y 2 kg; " in repr(block)
    assert "Unilateral contact of 0.7 N/m; StepLaw(static=1, kinetic=0.5); Springs(matrix=2, 1; 1, 2))" in repr(block)
    shown = []
    jax.jit(lambda mu: shown.append(repr(ConstantLaw(mu))))(0.3)
    assert shown == ["ConstantLaw(coefficient=traced)"]
