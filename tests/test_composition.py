"""What a scene calls for, what it leaves out, and whether it says so."""

import numpy as np
import pytest

from drumsqueal.composition import take_inventory
from drumsqueal.simulation import held_coordinates, run


@pytest.mark.parametrize(
    ("kept", "started", "held"),
    [
        # Friction drives Y and Tz by the pressure that X makes; nothing in the plane moves what is out of it.
        (["Y"], {"Y": 1e-7}, ("X", "Tz")),
        (["Y", "Tz"], {"Y": 1e-7}, ("X",)),
        (["X", "Y", "Tz"], {"Y": 1e-7}, ()),
        (["X", "Y", "Z", "Tx", "Ty", "Tz"], {"Z": 1e-7}, ()),
        # Friction across the arc couples Z to Ty, friction along it Ty to Tx. What nothing starts is not held.
        (["Z"], {"Z": 1e-7}, ("Tx", "Ty")),
        (["X"], {}, ()),
    ],
)
def test_a_list_that_holds_what_would_move_says_so(nominal, kept, started, held):
    scene = nominal.with_values({"simulate.coordinates": kept, "start.displacement": started})
    assert set(held_coordinates(scene)) == set(held)


def test_nothing_is_held_where_the_coordinates_are_found(nominal):
    assert held_coordinates(nominal) == ()


def test_what_is_held_moves_when_it_is_let_go(nominal):
    short = {"simulate.duration": 0.002, "start.displacement": {"Y": 1e-7}}
    held = run(nominal.with_values(short | {"simulate.coordinates": ["Y"]}))
    free = run(nominal.with_values(short | {"simulate.coordinates": ["X", "Y", "Z", "Tx", "Ty", "Tz"]}))
    moved = free.history["displacement"]
    largest = {str(name): float(np.abs(moved.sel(coordinate=name)).max()) for name in moved["coordinate"].values}
    assert {name for name, size in largest.items() if size > 1e-15 and name != "Y"} == set(held.held)


def test_the_inventory_of_the_nominal_scene(nominal):
    inventory = take_inventory(nominal)
    assert inventory.includes == (
        "coordinates X, Y, Tz",
        "contact that separates",
        "friction: exponential law",
        "friction along the unit slip velocity",
        "support springs",
    )
    assert {each.split(" (")[0] for each in inventory.leaves_out} == {
        "coordinates Z, Tx, Ty",
        "structural damping",
        "harmonic force",
        "drag of friction on the steady state",
        "changes of the drum speed",
        "changes of the load",
    }


def test_every_effect_is_either_included_or_left_out(nominal):
    everything = nominal.with_values(
        {
            "damping": {"ratio": 0.01},
            "forcing": {"amplitude": {"Z": 1.0}, "frequency": 100.0},
            "steady.state": "self-consistent",
            "drum.speed": {"time": [0, 1], "value": [5, 4]},
            "contact.normal_load": {"time": [0, 1], "value": [2000, 2100]},
        }
    )
    assert take_inventory(everything).leaves_out == ()
    least = nominal.with_values({"support": None, "friction": None, "contact.separation": False})
    assert take_inventory(least).includes == ("coordinates X, Y, Tz", "bonded contact")
