"""Where motions come to rest: x″ + c x′ + x (x − 1)(x − 2) = 0, which rests at 0 and 2, by SciPy and in closed form."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import drumsqueal as ds
from drumsqueal.dynamics.cycles.search import regime_words
from drumsqueal.findings import decay
from drumsqueal.findings.decay import Rest, decay_to_rest, find_rest
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.signals.regime import Cause, Regime
from drumsqueal.findings.vibration import Vibration
from drumsqueal.physics.effects.damping import damping_matrix, frictionless_modes
from drumsqueal.physics.effects.effect import Action, Effect

STEP = 0.1  # s: 45 samples in a period of small motion about 0 or 2


class Cubic(Effect):
    """A force −(a x³ + b x²)."""

    cubic: Any = eqx.field(converter=jnp.asarray)
    square: Any = eqx.field(converter=jnp.asarray)

    def act(self, moment, q, v):
        return Action((-self.cubic * q[0] ** 3 - self.square * q[0] ** 2,), 0.0)


def oscillator(stiffness=2.0, square=-3.0, damping=0.3, speed=5.0, law=None) -> ds.Model:
    """x″ + c x′ + k x + b x² + x³ = 0 on a belt: with k = 2 and b = −3 it rests at 0 and 2, with −1 and 0 at ±1."""
    law = ds.ConstantLaw(0.0) if law is None else law
    block = ds.block_on_belt(law, stiffness=stiffness, damping=damping, belt_speed=speed)
    return dataclasses.replace(block, others=(*block.others, Cubic(1.0, square)))


def motion(start, seconds, since=0.0, damping=0.3, stiffness=2.0, square=-3.0):
    """Displacement and velocity (k, 1) of the oscillator, by SciPy."""

    def rate(_, state):
        x, v = state
        return v, -damping * v - stiffness * x - square * x**2 - x**3

    times = np.arange(since, since + seconds, STEP)
    found = solve_ivp(rate, (0, times[-1]), start, t_eval=times, rtol=1e-10, atol=1e-13)
    return found.y[0][:, None], found.y[1][:, None]


def rest_of(pieces, model=None):
    model = oscillator() if model is None else model
    stability = ds.analyse_stability(model)
    return find_rest(model, stability.steady_state, stability.matrix, pieces, STEP)


def test_a_linear_motion_is_near_steady_sliding_however_it_falls_and_is_sampled(monkeypatch):
    asked = Rest(near=False, elsewhere=np.ones(3), linear=-0.1)
    monkeypatch.setattr(decay, "_find_equilibrium", lambda *_: asked)
    # Two modes of 1 and 26 rad/s, at 2.4 samples in a period of the faster one, and a coordinate that nothing holds.
    springs = np.array([[1.0, 20.0, 0.0], [2.0, 676.0, 0.0], [0.0, 0.0, 0.0]])
    matrix = np.block([[np.zeros((3, 3)), np.eye(3)], [-springs, -np.diag([0.3, 0.5, 0.2])]])
    values, vectors = np.linalg.eig(matrix)
    amplitudes = np.linalg.solve(vectors, [1.0, 0.5, 3.0, 0.0, 0.0, 0.1])
    times = np.arange(0.0, 30.0, STEP)
    state = (vectors @ (amplitudes[:, None] * np.exp(np.outer(values, times)))).real.T
    operation = SimpleNamespace(constant=True)
    model: Any = SimpleNamespace(forced=False, remembering=(), operation=operation, mass=np.ones(3))
    monkeypatch.setattr(decay, "least_energy", lambda _: 1e-24)

    def found(displacement, falls=1.0):
        moved, velocity = falls * state[:, :3] + np.array(displacement), falls * state[:, 3:]
        pieces: Any = [(moved[:150], velocity[:150]), (moved[150:], velocity[150:])]
        return find_rest(model, np.zeros(3), matrix, pieces, STEP)

    assert found([0.0, 0.0, 0.0]).near
    assert found([0.0, 0.0, 1e3]).near  # where it is along this one is no matter
    assert found([0.0, 0.5, 0.0]) == Rest(near=False)  # it has yet to come to rest
    assert found([0.0, 0.5, 0.0], falls=1e-3) is asked
    assert found([0.0, 1e-14, 0.0], falls=0.0).near  # less is stored there than is resolved
    model.forced = True
    assert found([0.0, 0.5, 0.0]).near  # nothing comes to rest


def test_what_creeps_back_is_near_steady_sliding():
    # x″ + 20 x′ + x = 0: at −0.0501 1/s nothing but the dashpot answers the spring.
    rate = -10 + np.sqrt(99.0)
    displacement = 0.3 * np.exp(rate * np.arange(0.0, 20.0, STEP))[:, None]
    assert rest_of(
        [(displacement, rate * displacement)], ds.block_on_belt(ds.ConstantLaw(0.0), damping=20.0, belt_speed=5.0)
    ).near


@pytest.mark.parametrize(
    ("start", "since", "near"),
    [
        ((0.2, 0.0), 0.0, True),
        ((0.2, 0.0), 100.0, True),  # 6e-8 m are left
        ((3.0, 0.0), 0.0, False),  # it passes 0 and 2
        ((1.0001, 0.0), 0.0, False),  # it leaves 1
    ],
)
def test_what_swings_past_another_equilibrium_is_not_near_steady_sliding(start, since, near):
    found = rest_of([motion(start, 20.0, since)])
    assert (found.near, found.elsewhere) == (near, None)


def test_what_rests_elsewhere_is_known_exactly_and_only_where_it_stays():
    # At 60 s the motion from 2.5 is still 2e-5 m from 2; at 1 nothing moves either, but it is a saddle.
    found = rest_of([motion((2.5, 0.0), 20.0, 60.0)])
    assert found.elsewhere == pytest.approx([2.0], rel=1e-12)
    still = np.ones((100, 1)), np.zeros((100, 1))
    saddle = rest_of([still])
    assert (saddle.near, saddle.elsewhere) == (False, None)
    assert saddle.linear == pytest.approx(-0.15 + np.sqrt(0.15**2 + 1), rel=1e-12)  # λ² + 0.3 λ − 1 = 0 at 1
    assert rest_of([(np.full((100, 1), 0.1), np.zeros((100, 1)))]).elsewhere is None  # which leads to steady sliding
    # Where steady sliding itself is unstable, x³ − x, it rests at 1 all the same.
    found = rest_of([motion((0.5, 0.0), 20.0, 60.0, stiffness=-1.0, square=0.0)], oscillator(-1.0, 0.0))
    assert found.elsewhere == pytest.approx([1.0], rel=1e-12)


@pytest.mark.parametrize("size", [0.02, 0.05, 0.1])
@pytest.mark.parametrize(("rate", "rests"), [(-0.15, True), (-0.05, False), (0.0, False), (0.02, False)])
def test_what_swings_about_another_equilibrium_for_ever_does_not_rest_there(size, rate, rests):
    # Small motion about 2 is that of 2 + A e^(−0.15 t) cos √2 t; what falls by less than half as fast may go on.
    times = np.arange(0.0, 40.0, STEP)
    envelope, turn = size * np.exp(rate * times), np.sqrt(2.0) * times
    displacement = 2.0 + envelope * np.cos(turn)
    velocity = envelope * (rate * np.cos(turn) - np.sqrt(2.0) * np.sin(turn))
    found = rest_of([(displacement[:, None], velocity[:, None])])
    assert (found.near, found.elsewhere is not None) == (False, rests)


@pytest.mark.parametrize(("start", "damping"), [((2.02, 0.0), -0.002), ((1.0 + 1e-9, 0.0), 0.3)])
def test_a_motion_that_leaves_an_unstable_equilibrium_does_not_rest_there(start, damping):
    model = oscillator(damping=damping)
    stability = ds.analyse_stability(model)
    displacement, velocity = motion(start, 20.0, damping=damping)
    chunk: Any = type("Chunk", (), {})
    chunk.time, chunk.displacement, chunk.velocity = np.arange(len(displacement)) * STEP, displacement, velocity
    unknown = Regime(kind=Kind.UNDECIDED, cause=Cause.DRIFTS, numbers={"amplitude_drift": 0.1, "mean_drift": 0.0})
    vibration = Vibration.of([chunk], stability)
    assert decay_to_rest(unknown, vibration, slice(None), stability, stability.modes, model) is unknown


def test_a_record_that_rests_elsewhere_does_not_decay_to_steady_sliding():
    model = oscillator()
    stability = ds.analyse_stability(model)
    displacement, velocity = motion((2.5, 0.0), 80.0)
    chunk: Any = type("Chunk", (), {})
    chunk.time, chunk.displacement, chunk.velocity = np.arange(len(displacement)) * STEP, displacement, velocity
    vibration = Vibration.of([chunk], stability)
    unknown = Regime(kind=Kind.UNDECIDED, cause=Cause.DRIFTS, numbers={"amplitude_drift": -0.5, "mean_drift": 0.0})
    found = decay_to_rest(unknown, vibration, slice(500, None), stability, stability.modes, model)
    assert (found.kind, found.cause) == (Kind.STEADY, Cause.RESTS_ELSEWHERE)
    assert found.numbers == {"X": pytest.approx(2.0, rel=1e-12)}
    assert found.reason == "Nothing moves: the motion rests in another equilibrium, at X = 2 m from steady sliding."
    assert regime_words(found) == "comes to rest in another equilibrium, at X = 2 m from steady sliding"


@pytest.mark.parametrize(("stiffness", "says"), [(-1.0, True), (2.0, False)])
def test_a_static_instability_is_called_one(stiffness, says):
    # λ² + 0.3 λ − 1 = 0.
    stability = ds.analyse_stability(oscillator(stiffness))
    said = "divergence without oscillation at +0.8612 1/s"
    assert (f"Steady sliding is statically unstable: {said}" in " ".join(str(stability).split())) == says
    assert (said in repr(stability)) == says
    if says:
        assert stability.divergence == pytest.approx(-0.15 + np.sqrt(0.15**2 + 1), rel=1e-12)


def test_what_a_negative_spring_drives_away_has_the_time_scale_of_that():
    # −36 and 100 N/m on 4 kg. Without one, errors of what then rests elsewhere would be measured by its speed alone.
    mass, stiffness = jnp.full(2, 4.0), jnp.diag(jnp.array([-36.0, 100.0]))
    omega, _ = frictionless_modes(mass, stiffness)
    np.testing.assert_allclose(omega, [-3.0, 5.0])
    # What does not oscillate has no share in damping that is a ratio of that of modes: 2 × 0.1 × 5 1/s × 4 kg.
    np.testing.assert_allclose(damping_matrix(0.1, mass, stiffness), np.diag([0.0, 4.0]), atol=1e-15)


BOX = {"displacement": {"X": (-2.0, 4.0)}, "velocity": {"X": (-2.0, 2.0)}}


# On a belt of 500 m/s every motion is small beside slip reversal; with 5 N s/m nothing oscillates.
@pytest.mark.thorough
@pytest.mark.parametrize(("damping", "speed"), [(0.3, 5.0), (0.3, 500.0), (5.0, 5.0), (0.05, 500.0)])
def test_starts_in_two_wells_rest_where_another_integrator_says(damping, speed):
    found = ds.study_basin(oscillator(damping=damping, speed=speed), BOX, samples=40)
    # By then what is left of motion is e^-9 of it at most.
    ends = np.array([motion(start, 1.0, 20 / damping + 40 * damping, damping)[0][-1, 0] for start in found.starts])
    assert np.all(np.minimum(abs(ends), abs(ends - 2)) < 0.01)
    (place,) = found.rests
    assert (found.attractor == np.where(ends > 1, place.number, 0)).all()
    assert place.place == {"X": pytest.approx(2.0, rel=1e-12)}
    assert (found.decay.count, place.chance.count, found.unclear) == ((ends < 1).sum(), (ends > 1).sum(), 0)
    assert found.elsewhere == {"rests elsewhere": place.chance.count}
    assert f"{place.chance.percent} rest at X = 2 m from steady sliding" in repr(found)


@pytest.mark.thorough
def test_starts_of_what_diverges_rest_on_either_side_or_nowhere():
    found = ds.study_basin(oscillator(-1.0, 0.0), BOX, samples=20)
    ends = np.array([motion(start, 1.0, 99.0, stiffness=-1.0, square=0.0)[0][-1, 0] for start in found.starts])
    assert (found.attractor == [1 if (end > 0) == (ends[0] > 0) else 2 for end in ends]).all()
    assert sorted(each.place["X"] for each in found.rests) == pytest.approx([-1.0, 1.0], rel=1e-12)
    # Without the cubic spring it goes on for ever.
    endless = ds.block_on_belt(ds.ConstantLaw(0.0), stiffness=-1.0, damping=0.3, belt_speed=5.0)
    found = ds.study_basin(endless, BOX, samples=3)
    assert repr(found) == "Basin: of none of the 3 starts it is clear where it leads, so that no fraction is known"


@pytest.mark.thorough
def test_the_onset_says_where_starts_rest_elsewhere():
    def model_at(damping):
        return oscillator(damping=damping, law=ds.ConstantLaw(0.1))

    study = ds.study_onset(model_at, ds.Variation("damping", "N s/m", (0.3, 0.5)), sample_rate=10.0)
    low, high = np.sort(np.roots([1.0, -3.0, 2.0, -0.1]).real)[[0, 2]]  # x (x − 1)(x − 2) = 0.1
    places = [each.rests_at["X"] for row in study.values for each in row.starts if each.rests_at]
    assert places == pytest.approx([high - low] * len(places), rel=1e-12)
    assert {each.leads_to for row in study.values for each in row.starts} == {"decays", "rests elsewhere"}
    said = "A transient came to rest in another equilibrium, no squeal, at 0.3 N s/m and 0.5 N s/m"
    assert any(each.startswith(said) for each in study.warnings)
