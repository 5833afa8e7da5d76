"""A pushed shoe against the statics of the textbooks, and against a rigid shoe that shares no code with the package."""

import math
import pickle
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

from brakes import SCENES, RigidShoe, brake_of, leading_shoe, pin, textbook
from drumsqueal.errors import NoSteadySliding, SteadyStateError
from drumsqueal.findings import brake as brake_module
from drumsqueal.findings.brake import Reaction, Sense, ShoeAsBrake, brake_sentences, describe_brake, shoes_of
from drumsqueal.findings.prediction import turned_far
from drumsqueal.findings.verdict import difference_is_no_error
from drumsqueal.physics.friction_law import ConstantLaw
from drumsqueal.physics.model import build_model
from drumsqueal.scene import SceneError, load_scene
from drumsqueal.simulation import held_coordinates, prepare, run, steady_at_start
from drumsqueal.solve.linear.family import analyse_many, spectra_of
from drumsqueal.solve.linear.modes import Stability
from drumsqueal.solve.linear.steady import steady_sliding

STIFF = 1e12  # N/m, 30,000 times the lining
FORCE = [{"at": [0.045, -0.10, 0.0], "direction": [1.0, 0.0, 0.0], "size": 2280.0}]
TWO = [*FORCE, {"at": [0.10, -0.02, 0.0], "direction": [0.8, -0.6, 0.0], "size": 900.0}]
CASES = {
    "leading": {},
    "trailing": {"drum.speed": -10.0},
    "far pin": {"shoe.spring": pin(0.14, 70, STIFF)},
    "near pin": {"shoe.spring": pin(0.07, 65, STIFF), "drum.speed": -10.0},
    "short lining": {"shoe.arc_angle": math.radians(70), "shoe.spring": pin(0.12, 80, STIFF)},
    "middle not opposite the pin": {"shoe.arc_angle": math.radians(90), "shoe.spring": pin(0.1227, 120, STIFF)},
    "more friction": {"friction.coefficient": 0.55},
    "two forces": {"shoe.force": TWO},
    "two forces, trailing": {"shoe.force": TWO, "drum.speed": -10.0, "friction.coefficient": 0.45},
}


def stiff(values):
    return leading_shoe({"shoe.spring": pin(0.12265, 63, STIFF), "contact.stiffness": 1e9, "damping": None} | values)


@pytest.mark.thorough(but=["leading", "trailing"])
@pytest.mark.parametrize("name", CASES)
def test_torque_and_pressure_are_the_textbooks(name):
    scene = stiff(CASES[name])
    brake, expected = brake_of(scene), textbook(scene)
    # What a pin of this stiffness gives way makes 1e-5; the next test shows how that falls.
    assert brake.brake_torque_N_m == pytest.approx(expected.torque, rel=1e-4)
    assert brake.largest_pressure_Pa == pytest.approx(expected.largest, rel=1e-4)
    numbers = scene.numbers()
    speed = numbers["drum.speed"]
    assert isinstance(speed, float)
    applied = sum(np.sum(value) for key, value in numbers.items() if key.endswith(".size"))
    assert brake.brake_factor == pytest.approx(expected.torque / (applied * 0.15), rel=1e-4)
    assert brake.sense is (Sense.LEADING if speed > 0 else Sense.TRAILING)
    half = math.degrees(scene.shoe.arc_angle / 2)
    assert brake.leading_end_deg == pytest.approx(-math.copysign(half, speed))


def test_published_numbers_of_an_internal_expanding_brake():
    # Budynas & Nisbett, Shigley's Mechanical Engineering Design, Example 16-2: 1000 kPa and 366 N m on the right-hand
    # shoe, 443 kPa and 162 N m on the other, printed to three digits.
    leading, trailing = (brake_of(load_scene_of(name)) for name in ("leading_shoe", "trailing_shoe"))
    assert leading.brake_torque_N_m == pytest.approx(366, abs=0.5)
    assert leading.largest_pressure_Pa == pytest.approx(1000e3, rel=1e-3)
    assert trailing.brake_torque_N_m == pytest.approx(162, abs=0.5)
    assert trailing.largest_pressure_Pa == pytest.approx(443e3, rel=1e-3)
    assert (leading.sense, trailing.sense) == (Sense.LEADING, Sense.TRAILING)


def load_scene_of(name):
    return load_scene(SCENES / f"{name}.toml")


def test_several_shoes_are_summed_up_as_one_brake_and_each_has_its_sentences(monkeypatch):
    # Two shoes of a brake, 60 and 20 N m, pushed by 100 N each on a drum of 0.15 m; they lock at 0.6 times five times
    # what raises friction to the limit, or not at all.
    def shoe(torque, force, energised, sense) -> ShoeAsBrake:
        return ShoeAsBrake(
            time_s=0.0, brake_torque_N_m=torque, normal_force_N=1500.0, mean_pressure_Pa=3e5, largest_pressure_Pa=4e5,
            largest_pressure_at_deg=-20.0, smallest_pressure_Pa=1e5, smallest_pressure_at_deg=55.0,
            contact_fraction=0.75, leading_end_deg=-60.0, trailing_end_deg=60.0, friction_coefficient=0.4,
            reactions=(Reaction(at_m=(0.01, -0.02, 0.0), springs=(0, 2), force_N=(300.0, -400.0, 1e-9)),),
            angle_deg=(), pressure_Pa=(), applied_force_N=force, self_energisation=energised, sense=sense,
        )  # fmt: skip

    shoes = {
        "leading": shoe(60.0, 100.0, 1.5, Sense.LEADING),
        "trailing": shoe(20.0, 100.0, 0.7, Sense.TRAILING),
    }
    frictions = [SimpleNamespace(law=ConstantLaw(0.4)), None]
    sides = [
        (SimpleNamespace(places=(k,)), SimpleNamespace(contact=SimpleNamespace(friction=each)))
        for k, each in enumerate(frictions)
    ]
    moment = SimpleNamespace(drum_speed=-10.0, pushes=[(100.0, None)] * 2, preload=0.0, further=[(0.0, None)])
    model = SimpleNamespace(
        balanced=False, pushed=True, sides=sides, contact=SimpleNamespace(radius=0.15),
        operation=SimpleNamespace(at=lambda _: moment), frozen=lambda _: model,
    )  # fmt: skip
    alone = [SimpleNamespace(shoe=SimpleNamespace(force=(1,)))] * 2
    scene = SimpleNamespace(
        several=True, alone=alone, shoe_names=tuple(shoes), shoes=(), elastic_table=lambda body: (body, None)
    )
    raised = SimpleNamespace(displacement=np.full(2, np.nan), runs_off=True, fraction=0.6, frictionless=np.zeros(2))
    factors, described = [], iter(shoes.values())
    monkeypatch.setattr(brake_module, "while_sliding", lambda model: (model, 0.0))
    monkeypatch.setattr(brake_module, "raise_friction", lambda model, factor: factors.append(factor) or raised)
    monkeypatch.setattr(brake_module, "_describe", lambda *_: next(described))
    stability = SimpleNamespace(steady_state=np.zeros(2), time=0.0)
    found: Any = describe_brake(scene, model, stability)  # pyright: ignore[reportArgumentType]
    assert factors == [pytest.approx(5.0 / 0.4)]  # up to a coefficient of 5
    assert (found.brake_torque_N_m, found.applied_force_N) == (80.0, 200.0)
    assert found.brake_factor == pytest.approx(80.0 / (200.0 * 0.15))
    assert (found.locking_coefficient, found.no_locking_up_to) == (pytest.approx(3.0), None)
    assert (found.friction_coefficient, shoes_of(found)) == (pytest.approx(0.4), shoes)
    said = list(brake_sentences(found))
    assert said[:2] == [
        "Brake torque of all shoes 80 N m in steady sliding, brake factor 2.667: torque over 200 N times the drum's "
        "radius.",
        "Self-locking begins at 7.5 times the friction here: the largest coefficient is then 3.",
    ]
    assert said[2:7] == [
        "leading: Brake torque 60 N m in steady sliding.",
        "leading: Leading shoe: friction presses it on; the normal force of 1500 N is 1.5 times that without friction.",
        "leading: Pressure up to 400 kPa at -20 deg, down to 100 kPa at +55 deg; 75 % of the lining touches.",
        "leading: The drum comes in at -60 deg (leading end of the lining) and leaves at +60 deg (trailing end).",
        "leading: Force of springs 0 and 2 at (10, -20, 0) mm on the shoe: (300, -400, 0) N, 500 N in all.",
    ]
    assert said[8].startswith("trailing: Trailing shoe: friction pushes it off;")
    known = found.model_copy(update={"locking_coefficient": None, "no_locking_up_to": 5.0})
    assert list(brake_sentences(known))[1] == "No self-locking up to a coefficient of friction of 5."


@pytest.mark.thorough
def test_the_error_falls_with_the_stiffness_of_the_pin():
    errors = []
    for stiffness in (1e9, 1e10, 1e11):
        scene = stiff({"shoe.spring": pin(0.12, 75, stiffness)})
        errors.append(abs(brake_of(scene).brake_torque_N_m / textbook(scene).torque - 1))
    assert errors[0] < 0.05
    assert errors[1] < 0.15 * errors[0]
    assert errors[2] < 0.15 * errors[1]


@pytest.mark.thorough(but=["10.0"])
@pytest.mark.parametrize("speed", [10.0, -10.0])
def test_a_shoe_on_a_sliding_abutment(speed):
    # One spring along y: N = A cos θ + B sin θ, and two forces and a moment give A, B and the reaction, whatever the
    # stiffness: nothing else holds the shoe.
    friction, at, radius, half, width = 0.3, np.array([0.08, 0.11 * speed / 10, 0.0]), 0.15, math.radians(50), 0.032
    force = {"at": [0.12, math.copysign(0.03, speed), 0.0], "direction": [1.0, 0.0, 0.0], "size": 2000.0}
    scene = leading_shoe(
        {
            "shoe.arc_angle": 2 * half,
            "shoe.spring": [{"at": at.tolist(), "direction": [0.0, 1.0, 0.0], "stiffness": 1e8}],
            "shoe.force": [force],
            "friction.coefficient": friction,
            "drum.speed": speed,
            "damping": None,
        }
    )
    cc, ss = half + math.sin(2 * half) / 2, half - math.sin(2 * half) / 2
    drag, area = math.copysign(friction, speed), radius * width
    balance = np.array(
        [
            [area * cc, drag * area * ss, 0.0],
            [-drag * area * cc, area * ss, -1.0],
            [drag * area * radius * 2 * math.sin(half), 0.0, at[0]],
        ]
    )
    pushed = np.array([force["size"], 0.0, force["at"][1] * force["size"]])
    a, b, reaction = np.linalg.solve(balance, pushed)
    assert a * math.cos(half) > abs(b) * math.sin(half), "all of it touches"
    brake = brake_of(scene)
    assert brake.contact_fraction == pytest.approx(1)
    torque = friction * area * radius * a * 2 * math.sin(half)
    assert brake.brake_torque_N_m == pytest.approx(torque, rel=1e-9)
    assert brake.reactions[0].force_N == pytest.approx((0.0, reaction, 0.0), rel=1e-9, abs=1e-9)


@pytest.mark.thorough(but=["short lining"])
@pytest.mark.parametrize("name", ["far pin", "short lining", "middle not opposite the pin"])
def test_self_locking_begins_where_the_moment_of_friction_is_that_of_the_pressure(name):
    scene = stiff(CASES[name])
    limit = textbook(scene).locks_at
    assert brake_of(scene).locking_coefficient == pytest.approx(limit, rel=2e-3)
    with pytest.raises(SceneError, match="self-locking") as caught:
        prepare(scene.with_values({"friction.coefficient": 1.02 * limit}))
    assert str(NoSteadySliding.SELF_LOCKING) in str(caught.value)


def test_a_trailing_shoe_does_not_lock():
    scene = stiff({"drum.speed": -10.0})
    assert math.isinf(textbook(scene).locks_at)
    brake = brake_of(scene)
    assert brake.locking_coefficient is None
    assert brake.no_locking_up_to == 5


LIFTED = {
    "a stiff lining and a soft pin": {"contact.stiffness": 2e10, "shoe.spring": pin(0.1, 40, 3e7)},
    "a force that pulls one end away": {
        "shoe.force": [*FORCE, {"at": [0.10, 0.10, 0.0], "direction": [-0.6, -0.8, 0.0], "size": 6000.0}],
        "shoe.spring": pin(0.1, 63, 2e7),
    },
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", LIFTED)
def test_part_of_the_lining_is_off_the_drum(name):
    scene = stiff(LIFTED[name])
    brake, alone = brake_of(scene), RigidShoe(scene)
    q = alone.steady()
    assert 0.1 < alone.touching(q) < 0.95
    # Contact ends between two of 400 points.
    assert brake.contact_fraction == pytest.approx(alone.touching(q), abs=5e-3)
    assert brake.brake_torque_N_m == pytest.approx(alone.torque(q), rel=1e-4)


@pytest.mark.thorough
def test_a_spring_and_a_force_off_the_middle_plane():
    springs = [
        {"at": [0.0557, 0.1093, z], "direction": d, "stiffness": 2e9}
        for z in (-0.01, 0.012)
        for d in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    ]
    scene = stiff({"shoe.spring": springs, "shoe.force": [FORCE[0] | {"at": [0.045, -0.1, 0.003]}]})
    prepared, alone = prepare(scene), RigidShoe(scene)
    q = alone.steady(("X", "Y", "Z", "Tx", "Ty", "Tz"))
    assert abs(q[3]) > 1e-6
    assert abs(q[4]) > 1e-6
    found = prepared.stability
    assert found.coordinates == ("X", "Y", "Z", "Tx", "Ty", "Tz")
    # The point of contact where it ends lies between two points of the independent shoe.
    assert found.steady_state == pytest.approx(q, rel=1e-4, abs=1e-9)


@pytest.mark.parametrize("speed", [10.0, -10.0])
def test_eigenvalues_of_a_pinned_shoe(speed):
    springs = [each | {"damping": 200.0} for each in pin(0.12, 75, 3e8)]
    scene = stiff({"shoe.spring": springs, "drum.speed": speed, "contact.stiffness": 2e10})
    alone = RigidShoe(scene)
    expected, found = alone.eigenvalues(alone.steady()), prepare(scene).stability.eigenvalues
    distance = np.abs(expected[:, None] - found[None, :])
    assert alone.touching(alone.steady()) == 1
    # Z is free: its two eigenvalues are 0 and round-off, or far from all others.
    assert distance.min(axis=1).max() < 1e-6 * np.abs(expected).max()
    assert distance.min(axis=0).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.thorough
def test_energy_of_a_transient_is_balanced_and_dampers_take_it():
    values = {
        "shoe.spring": pin(0.12, 75, 1e9),
        "contact.stiffness": 1e10,
        "friction.coefficient": 1e-9,  # next to none, so that nothing but the dampers takes energy
        "start.displacement": {"X": 1e-6, "Y": 1e-6},
        "simulate.duration": 0.004,
    }
    free, damped = (
        run(stiff(values | {"shoe.spring": [each | {"damping": c} for each in values["shoe.spring"]]}))
        for c in (0.0, 2000.0)
    )
    ends = []
    for result in (free, damped):
        accuracy = result.findings.accuracy
        assert accuracy is not None
        assert accuracy.energy_balance_error_over_kinetic_energy < 1e-5
        energy = (result.history["kinetic_energy"] + result.history["potential_energy"]).values
        ends.append(energy[-1] - energy[0])
    kinetic = float(free.history["kinetic_energy"].max())
    assert abs(ends[0]) < 1e-3 * kinetic
    assert ends[1] < -0.05 * kinetic


@pytest.mark.thorough
def test_a_transient_lands_on_the_corners_of_a_force():
    profile = {"time": [0.0, 0.00103, 0.00207], "value": [1000.0, 2500.0, 1500.0]}  # corners between two samples
    scene = stiff({"shoe.spring": pin(0.12, 75, 1e9), "shoe.force.0.size": profile, "simulate.duration": 0.003})
    corners = build_model(scene).operation.corners
    assert corners is not None
    assert np.asarray(corners).tolist() == profile["time"]
    result = run(scene)
    accuracy = result.findings.accuracy
    assert accuracy is not None
    assert accuracy.energy_balance_error_over_kinetic_energy < 1e-5
    assert result.findings.moved_by == "changing force"
    assert result.findings.ramp is not None
    assert result.findings.ramp.keys == ("shoe.force.0.size",)


@pytest.mark.thorough
@pytest.mark.parametrize("key", ["shoe.spring.0.stiffness", "shoe.force.0.size"])
def test_gradients_with_respect_to_springs_and_forces(key):
    scene = stiff({"shoe.spring": pin(0.12, 75, 1e8)})
    at = float(np.asarray(scene.numbers()[key]))

    def torque(value):
        model = build_model(scene, {key: value})
        q = steady_sliding(model)
        return model.contact.observe(model.operation.at(0.0), tuple(q), (0.0,) * 3).brake_torque

    slope, step = float(jax.grad(torque)(at)), 1e-4 * at
    difference = (float(torque(at + step)) - float(torque(at - step))) / (2 * step)
    assert slope != 0
    # Of central differences with this step, whose round-off and third derivative are some 1e-8.
    assert slope == pytest.approx(difference, rel=1e-6)


@pytest.mark.thorough
def test_nothing_is_measured_against_a_mean_pressure_of_zero():
    found = run(leading_shoe({"simulate.duration": 0.002})).findings
    assert found.growth.linear_until_s == pytest.approx(0.002)
    assert found.edge_reached_s is None
    assert "beyond" not in found.verdict


BENDS = {"young": 210e9, "poisson": 0.3, "up_to": 12e3}


@pytest.mark.thorough
def test_a_pushed_shoe_that_hardly_bends_has_the_pressure_of_a_rigid_one():
    # At q = 0 nothing presses yet: there the cells' pressure has to have the slope of contact. A shoe ten thousand
    # times as stiff as steel bends by 1e-4 of what one of steel does, which changes the torque by 8 %.
    rigid = leading_shoe({})
    stiff = rigid.with_values({"shoe.elastic": BENDS | {"young": 210e13, "up_to": 1200e3}})
    section: Any = dict.fromkeys(("shoe.spring.0.radius", "shoe.spring.1.radius", "shoe.force.0.radius"), 5e-3)
    steel = rigid.with_values({"shoe.elastic": BENDS}).with_values(section)
    torque, of_stiff, of_steel = (brake_of(scene).brake_torque_N_m for scene in (rigid, stiff, steel))
    assert of_stiff == pytest.approx(torque, rel=1e-4)
    # 395.4 N m by 252 frame elements on a unilateral foundation, with rigid levers from the whole section to pin and
    # cylinder; 389.0 with modes to 5 kHz alone and 393.2 to 12 kHz, as their flexibility comes in slowly.
    assert of_steel == pytest.approx(395.4, rel=0.01)


@pytest.mark.thorough(but=["speed1"])
@pytest.mark.parametrize("speed", [10.0, {"time": [0.0, 0.2, 0.3], "value": [0.0, 0.0, 10.0]}])
def test_a_force_that_starts_from_zero_makes_the_brake_of_its_first_corner_at_which_the_drum_turns(speed):
    force = {"shoe.force": [FORCE[0] | {"size": {"time": [0.0, 0.1, 0.3], "value": [0.0, 1140.0, 2280.0]}}]}
    size, time = (1140.0, 0.1) if speed == 10.0 else (2280.0, 0.3)
    scene = leading_shoe(force | {"drum.speed": speed})
    found, constant = brake_of(scene), brake_of(leading_shoe({"shoe.force": [FORCE[0] | {"size": size}]}))
    assert found == constant.model_copy(update={"time_s": time})
    assert next(brake_sentences(found)).startswith(
        f"Brake torque {found.brake_torque_N_m:.4g} N m in steady sliding at t"
    )
    assert not steady_at_start(prepare(scene)).any()  # nothing acts there yet, and springs hold it at zero


@pytest.mark.thorough
def test_coordinates_of_a_pushed_shoe_can_be_listed():
    scene = leading_shoe({"simulate.coordinates": ["X", "Y"]})
    assert held_coordinates(scene) == ("Tz",)


@pytest.mark.thorough
def test_a_bonded_contact_beyond_self_locking_has_no_steady_sliding():
    # A linear contact has an equilibrium there, too: one that pulls all over.
    scene = leading_shoe({"contact.separation": False, "friction.coefficient": 1.2})
    with pytest.raises(SceneError, match=r"self-locking.*begins at a coefficient of friction of"):
        prepare(scene)


@pytest.mark.thorough
def test_many_scenes_beyond_self_locking_have_its_limit_each_also_from_another_process():
    scenes = [leading_shoe({"friction.coefficient": mu}) for mu in (0.32, 0.9)]
    slides, locks = analyse_many(scenes)
    assert isinstance(slides, Stability)
    assert pickle.loads(pickle.dumps(locks)).reason is NoSteadySliding.SELF_LOCKING
    assert "begins at a coefficient of friction of 0.828" in str(pickle.loads(pickle.dumps(locks)))
    with pytest.raises(SteadyStateError, match=r"begins at a coefficient of friction of 0\.828"):
        spectra_of(leading_shoe({}), {"friction.coefficient": [0.32, 0.9]})


@pytest.mark.thorough
def test_a_shoe_that_a_force_from_zero_brings_on_does_not_squeal_by_that():
    # All modes decay; while the shoe comes on, ever more of its lining touches the drum.
    force = {"shoe.force": [FORCE[0] | {"size": {"time": [0.0, 0.005], "value": [0.0, 2280.0]}}]}
    found = run(leading_shoe(force | {"simulate.duration": 0.01})).findings
    assert found.edge_reached_s is None
    assert found.ramp is not None
    assert found.ramp.squeals == ()
    assert "no mean is measured" in difference_is_no_error(found)


# What is said of shoes that do not brake, or that the model does not hold for.


@pytest.mark.parametrize(
    ("values", "reason", "said"),
    [
        ({"shoe.force.0.size": -2280}, NoSteadySliding.PULLED_OFF, "turn shoe.force towards the drum"),
        ({"shoe.force.0.direction": [-1, 0, 0]}, NoSteadySliding.PULLED_OFF, "not even without friction"),
        ({"shoe.spring": []}, NoSteadySliding.NOT_HELD, "it moves freely in Y and Tz; add a spring"),
    ],
)
def test_a_shoe_that_nothing_presses_or_holds_is_not_said_to_lock(values, reason, said):
    with pytest.raises(SceneError, match=said) as caught:
        prepare(leading_shoe(values))
    assert str(reason) in str(caught.value)


@pytest.mark.parametrize("size", [0.0, {"time": [0, 0.01], "value": [0, 0]}])
def test_a_shoe_that_nothing_ever_presses_is_refused(size):
    with pytest.raises(SceneError, match=r"shoe\.force\.0\.size: .* nothing ever presses the lining on the drum"):
        prepare(leading_shoe({"shoe.force.0.size": size}))


def test_where_a_load_presses_too_there_is_no_brake_factor():
    brake = brake_of(leading_shoe({"contact.normal_load": 2000}))
    assert brake.brake_factor is None
    assert "brake factor" not in " ".join(brake_sentences(brake))


@pytest.mark.parametrize(("coefficient", "turned"), [(0.32, []), (0.82, ["0.25 rad"])])
def test_steady_sliding_beyond_small_rotations_is_reported(coefficient, turned):
    said = list(turned_far(prepare(leading_shoe({"friction.coefficient": coefficient})).stability))
    assert [each in line for each, line in zip(turned, said, strict=True)] == [True] * len(turned)
