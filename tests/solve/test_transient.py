"""The transient against reference trajectories, exact solutions, its own tolerance and the balance of energy."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import numpy as np
import pytest
import scipy.linalg

from drumsqueal.errors import IntegrationError
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from drumsqueal.physics.friction_law import ConstantLaw
from drumsqueal.physics.model import build_model
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.scene import COORDINATES, Scene
from drumsqueal.simulation import run
from drumsqueal.solve.linear.steady import linear_model, steady_sliding
from drumsqueal.solve.transient import stick_slip
from drumsqueal.solve.transient.integrate import _Transient, integrate
from drumsqueal.solve.transient.segment import first_step
from drumsqueal.solve.transient.state import CHUNK_SAMPLES

ALL = COORDINATES
REFERENCE = Path(__file__).parent / "reference"


class Record(NamedTuple):
    """A transient: time (k,), displacement from steady sliding and velocity (k, n), energies (k,), steps."""

    time: np.ndarray
    vibration: np.ndarray
    velocity: np.ndarray
    kinetic: np.ndarray
    balance_error: np.ndarray
    steps: int
    chunks: int


def simulate(scene: Scene, coordinates: tuple[str, ...] | None = None) -> Record:
    """Integrate a scene's start over its own coordinates, or over others."""
    model = build_model(scene, coordinates=coordinates)
    steady = np.asarray(steady_sliding(model))
    chunks = list(
        integrate(
            model,
            steady,
            np.array([scene.start.displacement.get(name, 0.0) for name in model.names]),
            np.array([scene.start.velocity.get(name, 0.0) for name in model.names]),
            duration=scene.simulate.duration,
            sample_rate=scene.simulate.sample_rate,
            tolerance=scene.simulate.tolerance,
        )
    )
    time, displacement, velocity, kinetic, error = (
        np.concatenate([getattr(chunk, name) for chunk in chunks])
        for name in ("time", "displacement", "velocity", "kinetic_energy", "energy_balance_error")
    )
    steps = sum(chunk.steps for chunk in chunks)
    return Record(time, displacement - steady, velocity, kinetic, error, steps, len(chunks))


def started(scene: Scene, displacement, velocity=None, *, duration, sample_rate, tolerance=1e-9, **values) -> Scene:
    return scene.with_values(
        {
            "start.displacement": displacement,
            "start.velocity": velocity or {},
            "simulate.duration": duration,
            "simulate.sample_rate": sample_rate,
            "simulate.tolerance": tolerance,
            **{key.replace("__", "."): value for key, value in values.items()},
        }
    )


def load_reference(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Time (k,) and displacements with velocities (k, 2n); every second sample of an independent program's record.

    It is a separate program (NumPy, SciPy's DOP853 at 1e-12, numba; no automatic differentiation, no JAX), its own
    error about 2e-9 (small), 1e-8 (large) and 4e-8 (spatial) of each column's largest value. In SI units.
    """
    table = np.loadtxt(REFERENCE / f"{name}.csv", delimiter=",", skiprows=1)
    return table[:, 0], table[:, 1:]


SMALL = {"X": 1e-8, "Y": 1e-8, "Tz": 1e-7}
LARGE = {"X": 1e-6, "Y": 3e-5, "Tz": 1e-4}
SPATIAL = {"X": 1e-6, "Y": 2e-5, "Tx": 2e-4, "Ty": 1e-4, "Tz": 1e-4}


def errors_against(scene: Scene, name: str, every: int) -> np.ndarray:
    """Largest error of every displacement and velocity over that column's largest value."""
    record = simulate(scene)
    time, wanted = load_reference(name)
    np.testing.assert_allclose(record.time[::every], time, rtol=1e-12, atol=1e-12)
    found = np.hstack([record.vibration, record.velocity])[::every]
    return np.max(np.abs(found - wanted), axis=0) / np.max(np.abs(wanted), axis=0)


# --- references ------------------------------------------------------------------------------------------------------


# 7.5e-9 and, in space, 1.8e-8 were found: the references' own errors, and what the tolerance adds over some hundred
# periods; those bounds leave a factor 5 for another machine's rounding. Beyond boundaries (large) rounding alone moves
# the end of the record: 6.5e-9 to 6.3e-8 were found of the same steps in programs compiled differently, and 4e-8 to
# 7e-8 at a third and a tenth of this tolerance.
@pytest.mark.parametrize(
    ("name", "start", "bound"),
    [("transient_inplane_small", SMALL, 4e-8), ("transient_inplane_large", LARGE, 1.5e-7)],
    ids=["small", "large"],
)
def test_plane_references(nominal, name, start, bound):
    scene = started(nominal, start, duration=0.02, sample_rate=1e4)
    assert np.max(errors_against(scene, name, every=2)) < bound


def test_spatial_reference(nominal):
    scene = started(nominal, SPATIAL, {"Z": 0.05}, duration=0.0045, sample_rate=4e4)
    assert np.max(errors_against(scene, "transient_spatial", every=2)) < 1e-7


def test_errors_fall_with_the_tolerance(nominal):
    # Contact loss and slip reversal throughout. The tolerance is on a step's error, a tenth of it, and errors add up
    # over a hundred periods: within a factor 50 of it. 1.5e-4, 7.3e-6 and 4.0e-8 were found.
    errors = [
        np.max(
            errors_against(
                started(nominal, LARGE, duration=0.02, sample_rate=1e4, tolerance=tolerance),
                "transient_inplane_large",
                every=2,
            )
        )
        for tolerance in (1e-4, 1e-6, 1e-8)
    ]
    for error, tolerance in zip(errors, (1e-4, 1e-6, 1e-8), strict=True):
        assert error < 50 * tolerance
    assert errors[0] > 5 * errors[1] > 25 * errors[2]


# --- exact solutions -------------------------------------------------------------------------------------------------


def exact(scene: Scene, record: Record, coordinates=None) -> np.ndarray:
    """Displacements from steady sliding and velocities (k, 2n) of the linear model, by the matrix exponential."""
    model = build_model(scene, coordinates=coordinates)
    steady, linear = linear_model(model)
    assert not steady.any()
    start = np.concatenate([record.vibration[0], record.velocity[0]])
    step = scipy.linalg.expm(np.asarray(linear.state_matrix()) * (record.time[1] - record.time[0]))
    states = [start]
    for _ in record.time[1:]:
        states.append(step @ states[-1])
    return np.array(states)


def fraction_of_largest(found: Record, wanted: np.ndarray) -> np.ndarray:
    difference = np.hstack([found.vibration, found.velocity]) - wanted
    largest = np.max(np.abs(wanted), axis=0)
    return np.max(np.abs(difference), axis=0)[largest > 0] / largest[largest > 0]


@pytest.mark.thorough
@pytest.mark.parametrize("coordinates", [["X", "Y", "Tz"], ["X", "Y", "Z", "Tx", "Ty", "Tz"]], ids=["plane", "space"])
def test_bonded_without_friction_is_linear(nominal, coordinates):
    # Linear but for sin(2 Tz) of the supports, which at 1e-7 rad is 1e-14 from its slope. Z stays where it is put. Over
    # 74 periods of Tz a tolerance of 1e-9 adds up to 4.9e-9, and of the energy to 3.4e-9.
    start = {"X": 1e-8, "Y": 2e-8, "Tz": 1e-7, "Z": 1e-8, "Tx": 3e-7, "Ty": -2e-7}
    scene = started(
        nominal,
        {name: start[name] for name in coordinates},
        duration=0.01,
        sample_rate=1e4,
        friction=None,
        contact__separation=False,
        simulate__coordinates=coordinates,
    )
    record = simulate(scene)
    assert np.max(fraction_of_largest(record, exact(scene, record))) < 2e-8
    # Nothing dissipates and nothing drives: the energy stays.
    assert np.max(np.abs(record.balance_error)) < 2e-8 * record.kinetic.max()


@pytest.mark.thorough
def test_axial_motion_decays_as_friction_demands(nominal):
    # Z alone: m w″ = −μ(|V|) N w′/|V|, which for w′ = 1e-3 RΩ is w′ exp(−μ0 N t/(m RΩ)) to second order, 1e-6.
    scene = started(
        nominal, {}, {"Z": 5e-4}, duration=0.004, sample_rate=1e4, tolerance=1e-6, simulate__coordinates=["Z"]
    )
    record = simulate(scene)
    rate = 0.42130613194252666 * 2000.0 / (1.1657162284483753 * 0.5)
    np.testing.assert_allclose(record.velocity[:, 0], 5e-4 * np.exp(-rate * record.time), rtol=0, atol=2e-6 * 5e-4)
    np.testing.assert_allclose(
        record.vibration[:, 0], 5e-4 / rate * (1 - np.exp(-rate * record.time)), rtol=0, atol=2e-6 * 5e-4 / rate
    )


def test_small_motion_departs_from_the_linear_one_by_second_order(nominal):
    # 10 ms of the nominal brake below all boundaries: twice the amplitude, four times the difference.
    differences = []
    for amplitude in (5e-8, 1e-7, 2e-7):
        scene = started(
            nominal, {"Y": amplitude, "Tz": 10 * amplitude}, duration=0.01, sample_rate=1e4, tolerance=1e-12
        )
        record = simulate(scene)
        wanted = exact(scene, record)
        differences.append(np.max(np.abs(record.vibration - wanted[:, :3]), axis=0))
        assert np.max(fraction_of_largest(record, wanted)) < 1e-2
    slopes = np.log2(np.array(differences[1:]) / np.array(differences[:-1]))
    np.testing.assert_allclose(slopes, 2.0, atol=0.05)


# --- steady sliding --------------------------------------------------------------------------------------------------


@pytest.mark.thorough(but=["uniform-pressure-1e-06", "uniform-pressure-1e-09"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("state", ["uniform-pressure", "self-consistent"])
def test_steady_sliding_is_held(nominal, state, tolerance):
    values = {} if state == "uniform-pressure" else {"damping": {"ratio": 0.005}}
    scene = started(nominal, {}, duration=0.02, sample_rate=1e4, tolerance=tolerance, steady__state=state, **values)
    record = simulate(scene)
    # Round-off of forces of 2000 N, 1e-12 N at most, over stiffnesses of 1e7 N/m and more, and the residual of the
    # steady state, grown by e^1.5 in this time: below a tenth of a femtometre. Squeal starts from 1e-7 m.
    assert np.max(np.abs(record.vibration)) < 1e-16
    assert np.all(np.isfinite(record.velocity))


@pytest.mark.parametrize("size", [1e-10, 1e-12])
def test_a_tiny_start_is_followed_as_well(nominal, size):
    # A tenth of a nanometre: the forces of the displacement are still 1e7 round-offs of the load.
    scene = started(nominal, {"Y": size}, duration=0.02, sample_rate=1e4)
    record = simulate(scene)
    wanted = exact(scene, record)[:, :3]
    # At this amplitude the motion is linear to 1e-5; of 2000 N a round-off of 2e-13 N is 1e-9 of what Y feels.
    assert np.max(np.abs(record.vibration - wanted), axis=0)[1] < 1e-4 * np.max(np.abs(wanted[:, 1]))


@pytest.mark.thorough
def test_a_decaying_motion_is_followed_down_to_rest(nominal):
    # Constant friction and 2 % damping: Y falls by e^(−179 t). Compared with the drum's 422 W its energy is round-off
    # after 50 ms, and the steps must not care.
    friction = {"friction": {"law": "constant", "coefficient": 0.4}, "damping": {"ratio": 0.02}}
    scene = started(nominal.with_values(friction), {"Y": 1e-7}, duration=0.1, sample_rate=2e4)
    record = simulate(scene)
    wanted = exact(scene, record)[:, :3]
    assert np.max(np.abs(record.vibration - wanted)) < 1e-4 * 1e-7
    assert np.max(np.abs(record.vibration[-100:, 1])) == pytest.approx(np.max(np.abs(wanted[-100:, 1])), rel=1e-2)
    assert np.max(np.abs(wanted[-100:, 1])) < 1e-14


# --- energy ----------------------------------------------------------------------------------------------------------

RISE = {"time": [0.0, 0.004, 0.011], "value": [2000.0, 2600.0, 1500.0]}
STOP = {"time": [0.002, 0.018], "value": [5.0, 3.5]}


# In the default tier the power of profiles is that of physics/test_acting.py, and the balance that of the blocks in
# physics/test_schedule.py and hard/test_published.py.
@pytest.mark.thorough(but=["nominal-large"])
@pytest.mark.parametrize("start", [SMALL, LARGE], ids=["small", "large"])
@pytest.mark.parametrize(
    "values",
    [
        {},
        {"contact__normal_load": RISE, "drum__speed": STOP},
        {"steady__state": "self-consistent", "damping": {"ratio": 0.005}},
    ],
    ids=["nominal", "profiles", "self-consistent and damped"],
)
def test_energy_balance_closes(nominal, values, start):
    scene = started(nominal, start, duration=0.02, sample_rate=1e4, tolerance=1e-8, **values)
    record = simulate(scene)
    # Energies are of second order, so twice the error of the motion, and the work is integrated to the same tolerance:
    # a factor 50 of it for a hundred periods; 3.8e-8 was found.
    assert np.max(np.abs(record.balance_error)) < 5e-7 * record.kinetic.max()


@pytest.mark.thorough
def test_energy_balance_closes_in_space(nominal):
    # The power of friction is as good as the area integral, 1e-6 where V_z is small across a reversal; 3e-9 was found.
    scene = started(nominal, SPATIAL, {"Z": 0.05}, duration=0.0045, sample_rate=4e4)
    record = simulate(scene)
    assert np.max(np.abs(record.balance_error)) < 1e-7 * record.kinetic.max()


# --- programs that must agree ----------------------------------------------------------------------------------------


def test_left_out_coordinates_would_have_stayed_zero(nominal):
    # Out-of-plane forces of a motion in the plane cancel over the width to round-off. Both integrate to 1e-9 with steps
    # of their own; below the boundaries the integrals are the same to round-off, so that is all that may differ.
    scene = started(nominal, {"Y": 1e-6, "Tz": 1e-5}, duration=0.0045, sample_rate=4e4)
    plane, space = simulate(scene), simulate(scene, ALL)
    assert plane.vibration.shape[1] == 3
    largest = np.max(np.abs(plane.vibration), axis=0)
    assert np.max(np.abs(space.vibration[:, [0, 1, 5]] - plane.vibration) / largest) < 5e-8
    assert np.max(np.abs(space.vibration[:, 2])) < 1e-9 * largest[1]
    assert np.max(np.abs(space.vibration[:, [3, 4]])) < 1e-9 * largest[2]


@pytest.mark.thorough
def test_flat_profiles_are_constants(nominal):
    flat = {
        "contact.normal_load": {"time": [0.0, 0.01], "value": [2000.0, 2000.0]},
        "drum.speed": {"time": [0.0, 0.01], "value": [5.0, 5.0]},
    }
    plain, profiled = (
        simulate(started(nominal.with_values(values), LARGE, duration=0.02, sample_rate=1e4)) for values in ({}, flat)
    )
    # The same equations, but compiled apart: round-off, grown over a hundred periods with boundaries.
    largest = np.max(np.abs(plain.vibration), axis=0)
    assert np.max(np.abs(profiled.vibration - plain.vibration) / largest) < 1e-8


# --- samples and failures --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("samples", [1, CHUNK_SAMPLES, CHUNK_SAMPLES + 1, 2 * CHUNK_SAMPLES + 137])
def test_samples_are_uniform_and_chunks_leave_no_seam(nominal, samples):
    scene = started(nominal, SMALL, duration=samples / 1e5, sample_rate=1e5)
    record = simulate(scene)
    assert record.chunks == -(-samples // CHUNK_SAMPLES)
    np.testing.assert_allclose(record.time, np.arange(samples + 1) / 1e5, rtol=1e-15, atol=0)
    # Nothing happens at a seam: the motion is that of the reference, the linear one to a part in 1e3 at this amplitude,
    # and its difference from it has no jump there.
    difference = np.hstack([record.vibration, record.velocity]) - exact(scene, record)
    fraction = np.abs(difference) / np.max(np.abs(np.hstack([record.vibration, record.velocity])), axis=0)
    assert np.max(fraction) < 1e-3
    for seam in range(CHUNK_SAMPLES, samples, CHUNK_SAMPLES):
        assert np.all(np.abs(fraction[seam + 1] - fraction[seam]) < 1e-4)
    assert np.max(np.abs(record.balance_error)) < 1e-7 * record.kinetic.max()


def test_a_chunked_run_follows_the_reference_as_one_chunk_does(nominal):
    # 1000 samples in two chunks; every tenth is a sample of the record of 200, of which every second is kept.
    scene = started(nominal, LARGE, duration=0.02, sample_rate=5e4)
    record = simulate(scene)
    assert record.chunks == 2
    time, wanted = load_reference("transient_inplane_large")
    np.testing.assert_allclose(record.time[::10], time, rtol=1e-12, atol=1e-12)
    found = np.hstack([record.vibration, record.velocity])[::10]
    assert np.max(np.abs(found - wanted) / np.max(np.abs(wanted), axis=0)) < 1e-7


@pytest.fixture
def _few_steps(monkeypatch):
    """Give every chunk 400 steps, and as many again for its length."""
    monkeypatch.setattr(stick_slip, "STEP_BUDGET", 400)


@pytest.mark.usefixtures("_few_steps")
def test_a_stuck_integration_keeps_what_it_has(nominal):
    scene = started(nominal, LARGE, duration=0.02, sample_rate=5e4).with_values({"simulate.solver": "dopri8"})
    model, chunks = build_model(scene), []
    start = np.array([scene.start.displacement[name] for name in model.names])
    stream = integrate(
        model, np.zeros(3), start, np.zeros(3), duration=0.02, sample_rate=5e4, tolerance=1e-9, solver="dopri8"
    )
    with pytest.raises(IntegrationError, match=r"step size collapsed: .* past t = 0\.00") as failure:
        chunks.extend(stream)  # which keeps what came before the failure
    assert len(chunks) == 1
    assert np.all(np.isfinite(chunks[0].displacement))
    assert chunks[0].time.size == chunks[0].kinetic_energy.size == chunks[0].observation.brake_torque.size
    # So many, and as many again each 100 radians of the fastest mode; a sample's interval is 0.9 of them.
    radians = 0.01 / float(first_step(model)) * chunks[0].time[-1]
    assert chunks[0].steps == pytest.approx(400 * (1 + radians / 100), abs=5)
    assert f"collapsed: {chunks[0].steps:,} steps were" in str(failure.value)

    result = run(scene)
    assert result.findings.outcome == f"failed: {failure.value}"
    assert result.history.attrs["outcome"] == result.findings.outcome
    time, displacement = result.history["time"].values, result.history["displacement"].values
    np.testing.assert_array_equal(time, chunks[0].time)
    assert 10 < time.size < 500
    np.testing.assert_allclose(time, np.arange(time.size) / 5e4, rtol=1e-15)
    assert f"t = {time[-1]:.6g} s" in result.findings.outcome
    # What was kept is good: every tenth sample is one of the reference's.
    reference_time, wanted = load_reference("transient_inplane_large")
    kept = reference_time <= time[-1]
    found = displacement[::10][: kept.sum()][:, [0, 1, 5]]
    assert np.max(np.abs(found - wanted[kept, :3]) / np.max(np.abs(wanted[:, :3]), axis=0)) < 1e-7


@pytest.mark.usefixtures("_few_steps")
def test_undefined_motion_is_a_failure_in_words(nominal):
    model, start = build_model(nominal), np.array([np.nan, 0, 0])
    with pytest.raises(IntegrationError, match=r"t = 0 s"):
        list(integrate(model, np.zeros(3), start, np.zeros(3), duration=0.02, sample_rate=1e4, tolerance=1e-9))


def test_a_sample_at_a_change_is_of_what_begins_then():
    # A step of many transients side by side: the lining sticks from 0.2 s to 0.3 s, or all the while.
    transient = object.__new__(_Transient)
    for changes, sticks, wanted in (
        ([(0.2, True), (0.3, False)], False, [False, True, True, False, False]),
        ([(0.2, False), (0.3, True)], True, [True, False, False, True, True]),
        ([], True, [True] * 5),
    ):
        transient._run = cast("Any", SimpleNamespace(changes=changes, sticks=sticks))
        assert transient.sticks_at(np.array([0.0, 0.2, 0.25, 0.3, 0.4])).tolist() == wanted


def test_friction_jumps_where_a_drum_stops_starts_and_turns_round():
    # From 6 to −2 m/s in 4 s it turns round at 3 s; it stops at 6 s, stands until 8 s and starts again.
    speed = PiecewiseLinear(np.array([0.0, 4.0, 6.0, 8.0, 9.0]), np.array([6.0, -2.0, 0.0, 0.0, 5.0]))
    block = block_on_belt(ConstantLaw(0.3))
    turning = dataclasses.replace(block, operation=Operation(speed, Constant(1.0)))
    jumps, margin = stick_slip._jumps(turning)
    np.testing.assert_allclose(jumps, [0.0, 3.0, 6.0, 8.0], rtol=1e-15)
    assert 0 < margin < 1e-10
    np.testing.assert_array_equal(stick_slip._jumps(block)[0], [0.0])
