"""Quantities prescribed over time: piecewise linear, held outside, with the slope that belongs to them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drumsqueal.effects.operation import Operation
from drumsqueal.effects.schedule import Constant, Profile

value = st.floats(-1e3, 1e3)
steps = st.lists(st.tuples(st.floats(1e-3, 10.0), value), min_size=1, max_size=6)


@given(st.floats(-5.0, 5.0), value, steps)
@settings(derandomize=True, max_examples=60, deadline=None)
def test_a_profile_is_what_interpolation_gives(start, first, rest):
    time = start + np.concatenate([[0.0], np.cumsum([step for step, _ in rest])])
    values = np.array([first, *(v for _, v in rest)])
    profile = Profile(time, values)
    sought = np.concatenate([time, (time[1:] + time[:-1]) / 2, [time[0] - 1.0, time[-1] + 1.0]])
    found, rate = (np.asarray(x) for x in jax.jit(jax.vmap(profile.at))(sought))
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
    moment = Operation(Profile(np.array([0.0, 1.0]), speed), Profile(np.array([0.0, 2.0]), load)).at(0.5)
    assert moment.preload_rate is not None
    found = (float(moment.drum_speed), float(moment.preload), float(moment.preload_rate))
    assert found == pytest.approx((4.5, 1.5e5, 1e5))
