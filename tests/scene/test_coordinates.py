"""What a coordinate's name says: kind, units and place, for rigid shoes, small bodies and shoes that bend."""

import pytest

from drumsqueal.coordinates import (
    DISPLACEMENT,
    ELASTIC,
    ROTATION,
    at_surface,
    column_unit,
    in_order,
    is_coordinate,
    kind_of,
    largest_of,
    listed,
    place_of,
    unit_of,
    units_of,
)
from drumsqueal.scene import COORDINATES, SceneError

FREE = tuple(f"E{k}" for k in range(1, 13))
ALL = (*COORDINATES, *FREE)


def test_each_name_is_of_one_kind():
    assert [kind_of(name) for name in COORDINATES] == [DISPLACEMENT] * 3 + [ROTATION] * 3
    assert {kind_of(name) for name in FREE} == {ELASTIC}
    # No other name is a free mode's: neither a number that is none, nor a word that begins so.
    assert not any(is_coordinate(name) for name in ("E0", "E", "E01", "e1", "E1.5", "Txy", "T", "", 1, None))


def test_units_say_what_a_number_is():
    assert [unit_of(name, "µ") for name in ("X", "Tz", "E3")] == ["µm", "µrad", "µm kg^0.5"]
    assert units_of(COORDINATES) == "m (X, Y, Z), rad (Tx, Ty, Tz)"  # as every history has had it
    assert units_of(COORDINATES, "/s") == "m/s (X, Y, Z), rad/s (Tx, Ty, Tz)"
    assert units_of(ALL) == "m (X, Y, Z), rad (Tx, Ty, Tz), m kg^0.5 (E1 to E12)"
    mixed = ("X", "leading.E1", "E1", "E2", "E4", "E5", "E6", "S7", "S8", "S9", "drum.E1", "drum.E2", "drum.E3")
    assert listed(mixed) == "X, leading.E1, E1, E2, E4 to E6, S7 to S9, drum.E1 to drum.E3"
    assert not any(" " in column_unit(name) for name in ALL)
    assert [at_surface(name) for name in ("X", "Tz", "E1")] == ["X", "R Tz", "E1 at the lining"]


def test_every_coordinate_has_its_place():
    assert [place_of(name) for name in ALL] == list(range(len(ALL)))
    assert in_order(reversed(ALL)) == ALL  # and not by letters, in which E10 comes before E2


def test_the_largest_are_shown_in_the_order_of_all():
    sizes = dict(zip(ALL, [3.0, 1.0, 2.0] * 6, strict=True))
    shown, others = largest_of(sizes)
    assert shown == tuple(name for name in ALL if sizes[name] == 3.0)
    assert {*shown, *others} == {*ALL}
    assert largest_of({"X": 0.0, "Y": 1.0}) == (("X", "Y"), ())


@pytest.mark.parametrize(
    "key", ["start.displacement.E1", "start.velocity.E2", "forcing.amplitude.E1", "simulate.coordinates"]
)
def test_a_rigid_shoe_has_no_free_modes(nominal, key):
    forcing = {"forcing": {"amplitude": {}, "frequency": 1000.0}} if key.startswith("forcing") else {}
    value = ["X", "Y", "E1"] if key == "simulate.coordinates" else 1e-7
    with pytest.raises(SceneError, match="the shoe is rigid and has no elastic mode E"):
        nominal.with_values({"start": {}, **forcing, key: value})
