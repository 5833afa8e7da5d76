"""New values go into a scene file with the units of the old ones, rounded away from these."""

import math
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drumsqueal.scene import load_scene, scene_from_dict
from drumsqueal.scene.file import replace_value
from drumsqueal.scene.variation import Written

PLAIN = Written(load_scene(Path(__file__).parents[2] / "scenarios" / "nominal.toml"))
IN_UNITS = {unit: PLAIN.with_values({"support.lower_stiffness": f"1e6 {unit}"}) for unit in ("N/m", "kN/mm", "GN/m")}


@pytest.fixture
def tables(nominal):
    written = nominal.model_dump(exclude_none=True)
    for key, value in {"drum.speed": "30 rpm", "contact.normal_load": "2 kN", "shoe.thickness": "20 mm"}.items():
        written = replace_value(written, key, value)
    return written


def test_values_keep_their_units_and_few_digits(tables):
    written = Written(scene_from_dict(tables), tables)
    after = {
        "drum.speed": written.outward("drum.speed", math.pi * 1.0234, math.pi, 0.02),
        "contact.normal_load": written.outward("contact.normal_load", 1500.4, 2000.0, 0.02),
        "shoe.thickness": written.outward("shoe.thickness", 0.0202262, 0.02, 0.02),
        "friction.static": written.outward("friction.static", 0.4501, 0.5, 0.02),
        "support.lower_stiffness": written.outward("support.lower_stiffness", 1.0161e9, 6e8, 0.02),
    }
    assert after == {
        "drum.speed": "30.71 rpm",
        "contact.normal_load": "1.5 kN",
        "shoe.thickness": "20.23 mm",
        "friction.static": 0.45,
        "support.lower_stiffness": 1.02e9,
    }
    changed = written.with_values(after)
    assert changed.scene.shoe.thickness == pytest.approx(0.02023, rel=1e-14)
    assert 'speed = "30.71 rpm"' in changed.to_toml()
    assert written.shown("drum.speed", math.pi) == pytest.approx(30)


@pytest.mark.parametrize(
    ("value", "before", "within", "inward", "wanted"),
    [
        (0.1949, 0.1, 0.1, False, 0.2),  # two digits, where these are near enough
        (0.1949, 0.1, 0.1, True, 0.19),
        (0.1949, 0.1, 0.01, False, 0.195),
        (0.1049, 0.3, 0.1, False, 0.1),  # away from the old value is down
        (0.1049, 0.3, 0.1, True, 0.11),
        (0.1049, 0.3, 0.001, False, 0.1049),
    ],
)
def test_a_value_has_as_few_digits_as_the_change_allows(value, before, within, inward, wanted):
    assert PLAIN.outward("friction.static", value, before, within, inward=inward) == wanted


def test_a_file_of_the_changed_scene_loads_to_it(tables, tmp_path):
    changed = Written(scene_from_dict(tables), tables).with_values({"shoe.thickness": "21 mm", "friction.static": 0.45})
    path = tmp_path / "scene.toml"
    path.write_text(changed.to_toml(), encoding="utf-8")
    assert load_scene(path) == changed.scene


def test_a_profile_that_has_become_one_value_and_a_new_table_are_in_the_file(tables):
    profile = replace_value(tables, "drum.speed", {"time": [0, 1], "value": ["30 rpm", "0 rpm"]})
    frozen = scene_from_dict(profile).with_values({"drum.speed": math.pi, "damping": {"ratio": 0.0}})
    assert Written(frozen, profile).with_values({}).scene == frozen


@example(1.5, 1.000000000001, 0.02)
@given(st.floats(1e-12, 1e12), st.floats(1e-3, 1e3), st.sampled_from([0.02, 0.2]))
def test_rounding_leads_away_from_the_old_value_and_not_far(before, factor, within):
    value = before * factor
    after = PLAIN.outward("contact.stiffness", value, before, within)
    assert (after - before) * (value - before) >= 0
    # Fifteen digits are all that a value has.
    assert abs(after - before) >= abs(value - before) * (1 - 1e-12) - 1e-14 * value
    assert abs(after - value) <= within * abs(value - before) * (1 + 1e-9) + 1e-14 * value


@given(st.floats(1e-3, 1e12), st.sampled_from(["N/m", "kN/mm", "GN/m"]), st.integers(1, 15))
def test_a_value_that_was_read_from_a_file_is_written_as_it_was(value, unit, digits):
    written = IN_UNITS[unit]
    of_file = written.read("support.lower_stiffness", f"{value:.{digits}g} {unit}")
    assert written.read("support.lower_stiffness", written.exact("support.lower_stiffness", of_file)) == of_file


def test_a_value_is_written_with_the_digits_that_it_was_read_with(tables):
    written = Written(scene_from_dict(tables), tables)
    assert written.exact("shoe.thickness", written.read("shoe.thickness", "20.3 mm")) == "20.3 mm"
