"""Contact boundaries of two unlike shoes on a drum that turns backwards, against sums written out."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.findings import vibration
from drumsqueal.findings.vibration import (
    amplitudes_at_boundary,
    boundary_fractions,
    boundary_ratios,
    boundary_ratios_by_shoe,
    idle_shoes,
    mean_pressures,
    surface_levels,
)
from drumsqueal.physics.effects.operation import Constant, PiecewiseLinear
from drumsqueal.physics.model import build_model
from drumsqueal.scene import load_scene
from findings.fakes import LOADS, NAMES, OWN, RADIUS, SHARES, STIFFNESS, two_shoes

TIMES = np.array([0.5, 1.5, 2.5, 4.0])
SPEEDS = np.interp(TIMES, [0.0, 2.0, 5.0], [-6.0, -3.0, -1.5])
PRESSURES = np.interp(TIMES, [1.0, 3.0], [0.0, 900.0]), np.full(4, 700.0)
MOTION = np.random.default_rng(1).normal(size=(2, TIMES.size, len(NAMES))) * [[[1e-5]], [[0.2]]]


def named(columns: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(NAMES, columns.T, strict=True))


def at_times() -> Any:
    preloads = tuple((np.asarray(each), None) for each in PRESSURES)
    return SimpleNamespace(time=TIMES, drum_speed=SPEEDS, preloads=preloads)


def wanted(model) -> np.ndarray:
    """k_c max u_r over p0 and max v_θ over R |Ω| of each shoe (2, shoe, time), the bounds of the stand-ins."""
    found = np.zeros((2, 2, TIMES.size))
    for j, (share, (_, side)) in enumerate(zip(SHARES, model.sides, strict=True)):
        into, along = side.body.surface()
        for t in range(TIMES.size):
            q, v = (part[t, list(share.places)] for part in MOTION)
            with np.errstate(divide="ignore"):
                found[0, j, t] = STIFFNESS[j] * np.abs(into).max(axis=0) @ np.abs(q) / PRESSURES[j][t]
            found[1, j, t] = np.abs(along).max(axis=0) @ np.abs(v) / (RADIUS * abs(SPEEDS[t]))
    found[0, 0, 0] = 0.0  # at 0.5 s nothing presses the first shoe, and the second one is pressed
    return found


def test_a_motion_comes_to_the_boundaries_of_each_shoe_by_its_own_pressure_and_the_drums_speed():
    model = two_shoes()
    found = boundary_fractions(model, *map(named, MOTION), at_times())  # pyright: ignore[reportCallIssue]
    np.testing.assert_allclose(found, wanted(model), rtol=1e-12)
    assert idle_shoes(model, TIMES).tolist() == [[True, False, False, False], [False] * 4]
    # At t = 0, when the first shoe is idle.
    lost, back = boundary_ratios_by_shoe(model, *MOTION)
    still = wanted(model) * [[[1.0]], [[1.0]]]
    of_speed = still[1] * np.abs(SPEEDS) / 6.0
    np.testing.assert_allclose(back, of_speed.max(axis=1), rtol=1e-12)
    np.testing.assert_allclose(lost, [0.0, still[0, 1].max()], rtol=1e-12)
    assert boundary_ratios(model, *MOTION) == pytest.approx((still[0, 1].max(), of_speed.max()), rel=1e-12)


def test_without_friction_separation_or_motion_there_is_no_way_to_a_boundary():
    model = two_shoes(frictions=(False, True), stiffness=(STIFFNESS[0], 0.0))
    found = boundary_fractions(model, *map(named, MOTION), at_times())  # pyright: ignore[reportCallIssue]
    expected = wanted(two_shoes())
    expected[1, 0], expected[0, 1] = 0.0, 0.0
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    # Nothing presses any shoe, and the drum stands: any motion is beyond all bounds, and none is not.
    idle = two_shoes(loads=(Constant(0.0), Constant(0.0)))
    moment: Any = SimpleNamespace(time=0.0, drum_speed=0.0, preloads=((np.asarray(0.0), None),) * 2)
    one = {name: np.array([0.0, 1e-9 if name == "b.Y" else 0.0]) for name in NAMES}
    assert boundary_fractions(idle, one, one, moment).tolist() == [[[0.0, 0.0], [0.0, np.inf]]] * 2


def test_the_mean_pressure_of_shoes_that_nothing_pushes_is_their_preload():
    found = mean_pressures(two_shoes(), at_times())
    np.testing.assert_array_equal(found, PRESSURES)


@pytest.mark.parametrize("pushed", [False, True])
def test_a_mode_alone_reaches_the_nearest_boundary_of_any_shoe(pushed):
    rng = np.random.default_rng(3)
    model = two_shoes(pushed=pushed, loads=(PiecewiseLinear([1.0, 3.0], [0.0, 900.0]), LOADS[1]))
    shapes = rng.normal(size=(4, 12)) + 1j * rng.normal(size=(4, 12))
    shapes[:, 6:] *= [[3.0], [300.0], [30.0], [3.0]]
    steady = 1e-6 * rng.normal(size=(4, 6))
    modes: Any = [SimpleNamespace(right=shape) for shape in shapes]
    found = amplitudes_at_boundary(model, modes, steady, TIMES.tolist())
    levels = surface_levels(model, steady, TIMES.tolist())
    ends, lifted = [], []
    for t, shape in enumerate(shapes):
        nearest, lost = [], []
        for j, (share, (_, side)) in enumerate(zip(SHARES, model.sides, strict=True)):
            into, along = side.body.surface()
            own = list(share.places)
            level = PRESSURES[j][t] + STIFFNESS[j] * into @ steady[t, own]
            np.testing.assert_allclose(levels[j][t], level, rtol=1e-12)
            lifts = np.sort(np.abs(level) / (STIFFNESS[j] * np.abs(into @ shape[own])))
            if not (t == 0 and j == 0):  # an idle shoe has no contact to lose
                lost.append(lifts[0] if level.min() > 0 and not pushed else lifts[1])  # a tenth of 11 points
            nearest.append(RADIUS * abs(SPEEDS[t]) / np.abs(along @ shape[6:][own]).max())
        ends.append(min(nearest + lost))
        lifted.append(min(lost))
    np.testing.assert_allclose(found, ends, rtol=1e-12)
    smooth = two_shoes(
        pushed=pushed, frictions=(False, False), loads=(PiecewiseLinear([1.0, 3.0], [0.0, 900.0]), LOADS[1])
    )
    np.testing.assert_allclose(amplitudes_at_boundary(smooth, modes, steady, TIMES.tolist()), lifted, rtol=1e-12)
    unbounded = two_shoes(frictions=(False, False), stiffness=(0.0, 0.0))
    assert amplitudes_at_boundary(unbounded, modes, steady, TIMES.tolist()).tolist() == [np.inf] * 4
    assert [len(each) for each in OWN] == [len(share.places) for share in SHARES]


def test_how_a_pushed_brake_is_pressed_is_found_once_for_all_its_modes(monkeypatch):
    asked = []
    usual = vibration._normal_forces
    monkeypatch.setattr(vibration, "_normal_forces", lambda model: asked.append(model) or usual(model))
    pushed, harder = (build_model(load_scene("leading_shoe", [f"shoe.force.0.size={size}"])) for size in (2e3, 4e3))
    at = pushed.operation.at(0.0)
    found = [float(mean_pressures(model, at)[0]) for model in (pushed, pushed, harder, pushed)]
    assert len(asked) == 2
    assert found[0] == found[1] == found[3]
    assert found[2] == pytest.approx(2 * found[0])
