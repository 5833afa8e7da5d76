"""No step goes past an instant of rest without taking note of it, whatever the numbers."""

import numpy as np
import pytest

from bodies import HyperbolicLaw
from drumsqueal.physics.friction_law import ExponentialLaw, StepLaw
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.solve.transient.integrate import integrate, start_state
from drumsqueal.solve.transient.segment import advance, first_step, no_rows
from drumsqueal.solve.transient.state import Span

SEED = 0  # of which one among the first twelve would go past


BUDGET = np.array([1e5, 1e5])  # steps, far more than needed


def overshoots(model, place, speed, omega, tolerance):
    """How far beyond rest, over the slip that counts as none, each stretch of slip goes: change by change."""
    belt = float(model.operation.at(0.0).drum_speed)
    state, step, sticks, halted = start_state(model, place, speed), first_step(model), False, False
    span = Span(np.float64(0), np.float64(0.08 / omega), np.int64(500))
    while span.offset < span.length:
        slips = not sticks and not halted
        segment = advance(
            model, np.zeros(1), state, span, np.float64(tolerance), step, BUDGET, no_rows(model, observes=False),
            np.bool_(sticks), np.bool_(halted), could_stick=True, most_changes=0 if slips else 1,
        )  # fmt: skip
        if slips and segment.time > span.offset:
            slip = np.append(segment.states.velocity[:, 0], segment.final.velocity) - belt
            least = tolerance * np.hypot(omega * segment.final.vibration[0], segment.final.velocity[0])
            yield np.nanmax(-np.sign(state.velocity[0] - belt) * slip) / least
        assert segment.reached or segment.halted
        halted, sticks, state, step = slips and segment.halted, segment.sticks, segment.final, segment.step
        span = span._replace(offset=np.float64(segment.time))


def draw(random):
    """A block, its start, and a tolerance from 1e-11 to 1e-3: with a belt or none, damped or not, of three laws."""
    kinetic, stiffness = random.uniform(0.05, 1.0), 10 ** random.uniform(-1, 2)
    static = kinetic * random.choice([1.0, random.uniform(1.0, 2.0)])
    laws = StepLaw(static, kinetic), ExponentialLaw(static, kinetic, random.uniform(0.1, 10.0)), HyperbolicLaw()
    damping, speed = random.choice([0.0, random.uniform(0, 0.5)]), random.choice([0.0, random.uniform(0.01, 1.0)])
    model = block_on_belt(laws[random.integers(3)], stiffness=stiffness, damping=damping, belt_speed=speed)
    start = np.array([random.uniform(-3, 3) / stiffness]), np.array([random.uniform(-2, 2)])
    return model, *start, np.sqrt(stiffness), 10 ** random.uniform(-11, -3)


@pytest.mark.thorough
@pytest.mark.parametrize("count", [12, pytest.param(400, marks=pytest.mark.slow)])
def test_no_step_goes_past_rest(count):
    # Without the search of `passing` one in forty goes past, by up to a thousand million times what counts as none.
    random = np.random.default_rng(SEED)
    for _ in range(count):
        drawn = draw(random)
        assert max(overshoots(*drawn)) <= 1, drawn


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_a_block_that_just_touches_rest(tolerance):
    # A belt that is hardly slower than the block's fastest motion: slip goes to nought and back within a step.
    model = block_on_belt(StepLaw(0.1, 0.1), belt_speed=1.0 - 1e-5)
    chunks = list(
        integrate(
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
    # Steps are made again where they went past rest; none is kept that was not made.
    assert all(0 <= chunk.rejected_steps < chunk.steps for chunk in chunks)
    assert sum(chunk.rejected_steps for chunk in chunks) > 0
