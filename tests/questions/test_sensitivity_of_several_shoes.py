"""Numbers of several shoes: one radius for all, and what is of the vehicle and not of the design."""

import numpy as np
import pytest

import drums
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.elasticity import shaping_numbers
from drumsqueal.physics.model import build_model
from drumsqueal.progress import silent
from drumsqueal.questions.sensitivity import study
from drumsqueal.questions.sensitivity.stabilising import numbers_of, variable_numbers
from drumsqueal.solve.linear.modes import analyse_stability

PUSH = {"at": [0.08, 0.0, 0.0], "direction": [1.0, 0.0, 0.0], "size": 500.0}
RADII = ("shoe.0.outer_radius", "shoe.1.outer_radius")


@pytest.fixture(scope="module")
def both(nominal):
    """Two shoes on a drum that bends."""
    cup = {**drums.CUP, "up_to": 700.0}
    return drums.several(nominal, {"leading": 0.0, "trailing": np.pi}, cup, arc_angle=1.9)


def modes(scene):
    """Those that oscillate, by rising frequency."""
    return analyse_stability(build_model(scene, coordinates=linear_coordinates(scene))).modes


def test_the_radius_of_all_shoes_is_one_number(both, monkeypatch):
    assert not set(RADII) & set(numbers_of(both))
    assert set(RADII) <= set(shaping_numbers(both))
    assert [key for key in study._shaping(both) if key.endswith("outer_radius")] == ["shoe.0.outer_radius"]
    monkeypatch.setattr(study, "_shaping", lambda _: ("shoe.0.outer_radius",))
    values = np.array(list(numbers_of(both).values()))
    (row,) = study._by_free_modes(modes(both), both, values, silent)
    radius, step = both.shoes[0].outer_radius, study.MODES_STEP
    ends = (both.with_values(dict.fromkeys(RADII, (1 + sign * step) * radius)) for sign in (1, -1))
    above, below = (np.array([mode.frequency_Hz for mode in modes(end)]) for end in ends)
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
