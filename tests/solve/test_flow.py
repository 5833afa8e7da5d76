"""The flow of a block that slips, sticks and slips again, and its derivatives, against its motion in closed form."""

import dataclasses
from typing import Any

import jax
import numpy as np
import pytest
from scipy.optimize import brentq

from drumsqueal.physics.laws.friction_law import StepLaw
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.solve.transient.flow import Change, flow

MASS, STIFFNESS, LOAD, STATIC, KINETIC, BELT = 0.7, 3.0, 2.0, 0.6, 0.35, 0.25
DURATION = 4.0


def after(given):
    """Of a place, a velocity and the belt's: where it is in the end, and when it sticks and slips."""
    place, velocity, belt = given
    omega, middle = np.sqrt(STIFFNESS / MASS), KINETIC * LOAD / STIFFNESS

    def slipping(x, v, time):
        cosine, sine = np.cos(omega * time), np.sin(omega * time)
        return middle + (x - middle) * cosine + v / omega * sine, v * cosine - (x - middle) * omega * sine

    times = np.linspace(0.05, DURATION, 2001)
    behind = slipping(place, velocity, times)[1] < belt
    k = int(np.flatnonzero(behind[:-1] & ~behind[1:])[0])
    stops: Any = brentq(lambda t: slipping(place, velocity, t)[1] - belt, times[k], times[k + 1], xtol=1e-15)
    held_to = STATIC * LOAD / STIFFNESS
    slips = stops + (held_to - slipping(place, velocity, stops)[0]) / belt
    return np.array(slipping(held_to, belt, DURATION - slips)), stops, slips


@pytest.mark.thorough
def test_a_block_that_sticks_and_slips_has_the_derivatives_of_its_motion():
    model = block_on_belt(StepLaw(STATIC, KINETIC), mass=MASS, stiffness=STIFFNESS, load=LOAD, belt_speed=BELT)
    still = jax.tree.map(np.zeros_like, model)
    faster = dataclasses.replace(still.operation.drum_speed, value=np.asarray(1.0))
    change = dataclasses.replace(still, operation=dataclasses.replace(still.operation, drum_speed=faster))
    size, start = np.array([0.3, 0.4]), np.array([0.5, -0.1])
    found = flow(model, size, start / size, DURATION, 1e-10, change)
    given = np.append(start, BELT)
    end, stops, slips = after(given)
    np.testing.assert_allclose(found.end * size, end, rtol=1e-8)
    assert found.pattern == (Change.STICKS, Change.SLIPS)
    np.testing.assert_allclose([when for when, _ in found.changes], [stops, slips], rtol=1e-9)
    assert (found.lost, found.reached) == (1, True)
    # Of its place, its velocity and the belt's: differences over 1e-6.
    moved = [(after(given + h)[0] - after(given - h)[0]) / 2e-6 for h in 1e-6 * np.eye(3)]
    np.testing.assert_allclose(found.transition * size[:, None] / size, np.stack(moved[:2], axis=1), rtol=1e-6)
    np.testing.assert_allclose(found.sensitivity * size, moved[2], rtol=1e-6)
    omega, middle = np.sqrt(STIFFNESS / MASS), KINETIC * LOAD / STIFFNESS
    np.testing.assert_allclose(found.rate * size, [end[1], -(omega**2) * (end[0] - middle)], rtol=1e-7)
