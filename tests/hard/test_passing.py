"""No step goes past an instant of rest without taking note of it, whatever the numbers."""

import numpy as np
import pytest

from bodies import HyperbolicLaw
from drumsqueal.physics.laws.friction_law import ExponentialLaw, StepLaw
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.solve.transient import integrate as integration
from drumsqueal.solve.transient.stick_slip import StickSlip

SEED = 0  # of which one among the first twelve would go past


class Watched(StickSlip):
    """Keeps how far beyond rest, over the slip that counts as none, each stretch of slip went."""

    beyond: list[float]

    def _slip(self, state, span, step):
        segment, least = super()._slip(state, span, step), self._slip_and_least(state, span)[1]
        belt = float(self._model.operation.at(0.0).drum_speed)
        slip = np.append(segment.states.velocity[:, 0], segment.final.velocity[0]) - belt
        way = np.sign(float(state.velocity[0]) - belt)
        Watched.beyond.append(float(np.nanmax(-way * slip)) / least)
        return segment


def draw(random):
    """A block, its start, and a tolerance from 1e-11 to 1e-3: with a belt or none, damped or not, of three laws."""
    kinetic, stiffness = random.uniform(0.05, 1.0), 10 ** random.uniform(-1, 2)
    static = kinetic * random.choice([1.0, random.uniform(1.0, 2.0)])
    laws = StepLaw(static, kinetic), ExponentialLaw(static, kinetic, random.uniform(0.1, 10.0)), HyperbolicLaw()
    damping, speed = random.choice([0.0, random.uniform(0, 0.5)]), random.choice([0.0, random.uniform(0.01, 1.0)])
    model = block_on_belt(laws[random.integers(3)], stiffness=stiffness, damping=damping, belt_speed=speed)
    start = np.array([random.uniform(-3, 3) / stiffness]), np.array([random.uniform(-2, 2)])
    return model, start, np.sqrt(stiffness), 10 ** random.uniform(-11, -3)


@pytest.mark.parametrize("count", [12, pytest.param(400, marks=pytest.mark.slow)])
def test_no_step_goes_past_rest(monkeypatch, count):
    # Without the search of `passing` one in forty goes past, by up to a thousand million times what counts as none.
    monkeypatch.setattr(integration, "StickSlip", Watched)
    random = np.random.default_rng(SEED)
    for _ in range(count):
        model, start, omega, tolerance = draw(random)
        Watched.beyond = []
        how = {"duration": 40 / omega, "sample_rate": 100 * omega, "tolerance": tolerance}
        assert list(integration.integrate(model, np.zeros(1), *start, **how))
        assert max(Watched.beyond) <= 1, (model, start, tolerance)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_a_block_that_just_touches_rest(tolerance):
    # A belt that is hardly slower than the block's fastest motion: slip goes to nought and back within a step.
    model = block_on_belt(StepLaw(0.1, 0.1), belt_speed=1.0 - 1e-5)
    chunks = list(
        integration.integrate(
            model, np.array([0.1]), np.array([1.0]), np.zeros(1), duration=20.0, sample_rate=50.0, tolerance=tolerance
        )
    )
    changes = [change for chunk in chunks for change in chunk.changes]
    # It sticks from where it is as fast as the belt to where the spring holds it back with all of friction.
    assert [sticks for _, sticks in changes[:2]] == [True, False]
    # A slip of a millionth, which counts as none at that tolerance, is there 5 % earlier.
    lasts = np.sqrt(2e-5)
    assert changes[0][0] == pytest.approx(1.5 * np.pi - lasts, abs=0.06 * lasts)
    assert changes[1][0] == pytest.approx(1.5 * np.pi, abs=1e-5)
