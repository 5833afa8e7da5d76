"""Numbers of several shoes: one radius for all, and what is of the vehicle and not of the design."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import drums
from drumsqueal.errors import RequestError
from drumsqueal.findings import vibration
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.elasticity import shaping_numbers
from drumsqueal.physics.model import build_model
from drumsqueal.progress import silent
from drumsqueal.questions import check as checking
from drumsqueal.questions.onset.study import predict
from drumsqueal.questions.sensitivity import study
from drumsqueal.questions.sensitivity.disturbing import DISTURBANCE, disturbed
from drumsqueal.questions.sensitivity.quieting import Quietening
from drumsqueal.questions.sensitivity.stabilising import Caution, _limits, cautions, numbers_of, variable_numbers
from drumsqueal.questions.sensitivity.study import check_points, operating, where
from drumsqueal.scene import SceneError
from drumsqueal.scene.variation import Variation, Written
from drumsqueal.solve.linear.modes import analyse_stability

PUSH = {"at": [0.08, 0.0, 0.0], "direction": [1.0, 0.0, 0.0], "size": 500.0}
RADII = ("shoe.0.outer_radius", "shoe.1.outer_radius")


@pytest.fixture(scope="module")
def both(nominal):
    """Two shoes on a drum that bends."""
    cup = {**drums.CUP, "up_to": 700.0}
    return drums.several(nominal, {"leading": 0.0, "trailing": np.pi}, cup, arc_angle=1.9)


def stability(scene):
    """Of all its coordinates."""
    return analyse_stability(build_model(scene, coordinates=linear_coordinates(scene)))


@pytest.mark.thorough
def test_the_radius_of_all_shoes_is_one_number(both, monkeypatch):
    assert not set(RADII) & set(numbers_of(both))
    assert set(RADII) <= set(shaping_numbers(both))
    assert [key for key in study._shaping(both) if key.endswith("outer_radius")] == ["shoe.0.outer_radius"]
    monkeypatch.setattr(study, "_shaping", lambda _: ("shoe.0.outer_radius",))
    (row,) = study._by_free_modes(stability(both), both, silent)
    radius, step = both.shoes[0].outer_radius, study.MODES_STEP
    ends = (both.with_values(dict.fromkeys(RADII, (1 + sign * step) * radius)) for sign in (1, -1))
    above, below = (np.array([mode.frequency_Hz for mode in stability(end).modes]) for end in ends)
    wanted = (above - below) / (2 * step * radius)
    np.testing.assert_allclose(row.frequency_Hz_per_SI, wanted, rtol=1e-3, atol=1e-3 * np.abs(wanted).max())


def test_what_is_of_the_vehicle_is_held_for_every_shoe(both):
    own = {**both.model_dump(exclude_none=True)["contact"], "normal_load": 700.0}
    pushed = {"shoe.0.force": [PUSH], "shoe.1.contact": own, "steady.state": "self-consistent"}
    _, chosen = variable_numbers(both.with_values(pushed))
    assert {"shoe.1.contact.stiffness", "shoe.0.thickness", "shoe.1.thickness", "contact.stiffness"} <= set(chosen)
    held = {"shoe.0.force.0.size", "shoe.1.contact.normal_load", "contact.normal_load", "drum.speed", *RADII}
    assert not held & set(chosen)
    assert not [key for key in chosen if ".force." in key]


def test_places_of_shoes_do_not_change_and_their_linings_leave_each_other_room(both):
    _, chosen = variable_numbers(both)
    assert not [key for key in chosen if key.endswith("position")]
    with pytest.raises(RequestError, match=r"^--vary shoe\.1\.position: 0 deg may be anywhere"):
        variable_numbers(both, ["shoe.1.position"])
    arcs = ("shoe.0.arc_angle", "shoe.1.arc_angle")
    assert set(arcs) <= set(chosen)

    def widest(*points):
        return {key: _limits(key, numbers_of(both), both, points)[1] for key in arcs}

    both.with_values(widest({}))
    nearer = {"shoe.1.position": 2.5}
    both.with_values(nearer | widest({}, nearer))
    assert sum(widest({}, nearer).values()) == pytest.approx(2 * 2.5)


LAW = {"law": "exponential", "static": 0.45, "kinetic": 0.35, "decay": 1.0}


@pytest.fixture(scope="module")
def own(both):
    """The same without friction and load but in tables of the second shoe."""
    contact = {"stiffness": 1e9, "normal_load": 700.0}
    return both.with_values(
        {"friction": None, "contact.normal_load": 0.0, "shoe.1.friction": LAW, "shoe.1.contact": contact}
    )


def test_what_squeals_by_the_tables_of_one_shoe_is_disturbed(own):
    def decaying(values):
        return -np.eye(2), np.zeros((values.size, 2, 2))

    assert Quietening(own, ["shoe.1.friction.static"], state_matrix=decaying)._disturber is not None
    study._check_load(own, 0.0)
    with pytest.raises(RequestError, match=r"contact\.normal_load and shoe\.1\.contact\.normal_load are 0 N"):
        study._check_load(own.with_values({"shoe.1.contact.normal_load": 0.0}), 0.0)
    # What is refused is the harmonic force, not that there is no friction.
    forced = own.with_values({"forcing": {"amplitude": {"leading.Y": 1.0}, "frequency": 100.0}})
    with pytest.raises(RequestError, match=r"^forcing"):
        predict(forced, Variation("drum.speed", "rad/s", (1.0, 2.0)))


@pytest.mark.thorough
def test_a_disturbance_is_beyond_the_boundary_of_the_shoe_that_is_pressed_in_most(both, own, monkeypatch):
    shoe = both.shoes[1]
    area = shoe.outer_radius * shoe.arc_angle * shoe.width
    assert disturbed(own).start.displacement["leading.Y"] == pytest.approx(DISTURBANCE * 700 / area / 1e9)
    pushed = own.with_values({"shoe.0.force": [PUSH], "steady.state": "self-consistent"})
    forces = [pressure * area for pressure in (4e6, 1e5)]
    monkeypatch.setattr(vibration, "_normal_forces", lambda _: forces)
    assert disturbed(pushed).start.displacement["leading.Y"] == pytest.approx(DISTURBANCE * 4e6 / 0.35e11)


def test_numbers_of_each_shoe_are_cautioned_of(own):
    assert cautions(own, {"shoe.1.friction.static": 0.4, "shoe.1.width": 0.05}) == ()
    assert cautions(own, {"shoe.1.friction.static": 0.2}) == (Caution.RISING,)
    assert cautions(own, {"shoe.1.width": 0.2}) == (Caution.WIDE,)


def test_operating_points_of_each_shoe(both, own):
    load = Variation("shoe.1.contact.normal_load", "N", (0.0, 100.0))
    with pytest.raises(RequestError, match=r"^--at shoe\.1\.contact\.normal_load: a lining without load"):
        check_points(own, [load], None)
    places = [Variation("shoe.0.position", "rad", (0.0, 0.8)), Variation("shoe.1.position", "rad", (2.5, np.pi))]
    with pytest.raises(SceneError, match="overlap"):
        check_points(both, places, None)
    found = operating(own, own, 0.0, Written(own), [])
    assert where(found) == "a drum speed of 5 rad/s and a load of 0 N and a load of shoe 1 of 700 N"


def test_a_drum_that_comes_to_rest_under_one_shoe_is_remarked(own):
    scene = own.with_values({"drum.speed": {"time": [0.0, 1.0], "value": [5.0, 0.0]}})
    steady = {"coordinates": (), "steady_state": np.zeros(0), "contact_fraction": 1.0, "pressure_range": (1.0, 1.0)}
    stability = SimpleNamespace(**steady, divergence=None, time=0.0)
    prepared: Any = SimpleNamespace(scene=scene, stability=stability, linear=SimpleNamespace(pushed=False), held=())
    (said,) = checking._about_the_steady_state(prepared)
    assert said.startswith("The drum comes to rest")
