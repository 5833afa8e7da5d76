"""Springs and forces at points of the shoe, and its own elasticity: tables within a table, and lists of them."""

import math
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drumsqueal.scene import (
    Profile,
    Scene,
    SceneError,
    load_scene,
    number_units,
    quantity_of,
    scene_from_dict,
    setting_keys,
)
from drumsqueal.scene.plan import MOST_POINTS, sample
from drumsqueal.scene.quantities import parse_quantity
from drumsqueal.scene.uncertain import Uniform
from drumsqueal.scene.usual import unusual
from drumsqueal.scene.variation import Written, read_variation

NOMINAL = Path(__file__).parents[2] / "scenarios" / "nominal.toml"
PUSHED = """
[shoe]
outer_radius = "100 mm"
thickness = "20 mm"
width = "36.5 mm"
arc_angle = "130 deg"
density = "7820 kg/m^3"

[shoe.elastic]
young = "210 GPa"
poisson = 0.3
up_to = "12 kHz"

[[shoe.spring]]
at = ["-90 mm", "20 mm", "0 mm"]
direction = [3.0, 4.0, 0.0]
stiffness = "1e9 N/m"
damping = "100 N s/m"

[[shoe.spring]]
at = ["-90 mm", "20 mm", 0]
direction = [4.0, -3.0, 0.0]
stiffness = "1e3 kN/mm"

[[shoe.force]]
at = ["40 mm", "95 mm", "0 mm"]
direction = [1.0, 0.0, 0.0]
size = "2279 N"

[contact]
stiffness = "0.35e11 N/m^3"

[drum]
speed = "5 rad/s"

[steady]
state = "self-consistent"

[simulate]
duration = "0.1 s"
sample_rate = "50 kHz"
"""


@pytest.fixture(scope="module")
def tables():
    return tomllib.loads(PUSHED)


@pytest.fixture(scope="module")
def scene(tables):
    return scene_from_dict(tables)


@pytest.fixture
def setting(tmp_path):
    file = tmp_path / "pushed.toml"
    file.write_text(PUSHED, encoding="utf-8")
    return lambda *changes: load_scene(file, changes)


def reloaded(scene: Scene) -> Scene:
    return scene_from_dict(tomllib.loads(scene.to_toml()))


def test_a_pushed_shoe_in_numbers(scene):
    numbers = {key: value for key, value in scene.numbers().items() if key.count(".") > 1}
    assert numbers == {
        "shoe.elastic.young": 210e9,
        "shoe.elastic.poisson": 0.3,
        "shoe.spring.0.at": (-0.09, 0.02, 0.0),
        "shoe.spring.0.direction": (0.6, 0.8, 0.0),
        "shoe.spring.0.radius": 0.002,
        "shoe.spring.0.stiffness": 1e9,
        "shoe.spring.0.damping": 100.0,
        "shoe.spring.1.at": (-0.09, 0.02, 0.0),
        "shoe.spring.1.direction": (0.8, -0.6, 0.0),
        "shoe.spring.1.radius": 0.002,
        "shoe.spring.1.stiffness": 1e9,
        "shoe.spring.1.damping": 0.0,
        "shoe.force.0.at": (0.04, 0.095, 0.0),
        "shoe.force.0.direction": (1.0, 0.0, 0.0),
        "shoe.force.0.radius": 0.002,
        "shoe.force.0.size": 2279.0,
    }
    assert scene.shoe.elastic is not None
    assert scene.shoe.elastic.up_to == 12e3
    assert scene.contact.normal_load == 0
    assert scene.shoe.sector == {key: value for key, value in scene.shoe.model_dump().items() if type(value) is float}


def test_every_number_can_be_put_back_and_survives_a_file(scene):
    written = scene.with_values(scene.numbers())
    assert written.numbers() == scene.numbers()
    assert written.with_values(written.numbers()) == written
    for each in (scene, written):
        assert reloaded(each) == each
        assert reloaded(each).to_toml() == each.to_toml()


@pytest.mark.parametrize("name", ["spring", "force"])
def test_a_patch_is_a_tenth_of_the_thickness_unless_it_is_written_and_a_rigid_shoe_has_none(setting, name):
    key = f"shoe.{name}.0.radius"
    assert "\nradius" not in setting().to_toml()
    assert setting("shoe.thickness=30 mm").numbers()[key] == pytest.approx(3e-3)
    for written, wanted in (("8 mm", 8e-3), ("0 mm", 0.0), ("0", 0.0)):
        scene = setting(f"{key}={written}")
        assert scene.numbers()[key] == wanted == reloaded(scene).numbers()[key]
        rigid = scene.with_values({"shoe.elastic": None})
        assert key not in rigid.numbers()
        with pytest.raises(SceneError, match=rf"{key} changes nothing while the shoe is rigid; add a table"):
            read_variation(f"{key}=1 mm..8 mm", rigid)
        assert rigid.to_toml() != setting("shoe.elastic=none").to_toml()  # and may bend again


def test_a_rigid_shoe_that_nothing_pushes_is_written_as_before():
    scene = load_scene(NOMINAL)
    sector = {"outer_radius", "thickness", "width", "arc_angle", "density"}
    assert scene.shoe.model_dump().keys() == scene.shoe.model_dump(mode="json").keys() == sector
    assert scene.model_dump(exclude_none=True)["shoe"].keys() == sector


def test_a_force_may_follow_a_profile(scene):
    values = {"shoe.force.0.size": {"time": [0, "10 ms"], "value": [0, "-2 kN"]}}
    pushed = scene.with_values(values)
    assert pushed.shoe.force[0].size == Profile((0.0, 0.01), (0.0, -2000.0))
    numbers = pushed.numbers()
    assert numbers["shoe.force.0.size.time"] == (0.0, 0.01)
    assert numbers["shoe.force.0.size.value"] == (0.0, -2000.0)
    assert "shoe.force.0.size" not in numbers
    assert pushed.with_values(numbers).numbers() == numbers
    assert pushed == reloaded(pushed)
    assert pushed.schedules() == {
        "drum.speed": 5.0,
        "contact.normal_load": 0.0,
        "shoe.force.0.size": pushed.shoe.force[0].size,
    }


component = st.floats(allow_nan=False, allow_infinity=False) | st.sampled_from([0.0, 5e-324, 1e-310, 1e308, 1.0])


@settings(derandomize=True)
@given(vector=st.tuples(component, component, component).filter(any))
def test_a_direction_is_normalised_once_and_for_all(vector):
    base = tomllib.loads(PUSHED)
    base["shoe"]["spring"][0]["direction"] = list(vector)
    scene = scene_from_dict(base)
    direction = scene.shoe.spring[0].direction
    assert math.hypot(*direction) == pytest.approx(1, abs=1e-15)
    largest = max(vector, key=abs)
    along = [each / largest for each in vector]
    assert direction == pytest.approx([each / math.hypot(*along) * math.copysign(1, largest) for each in along])
    assert reloaded(scene) == scene
    assert scene.with_values({"shoe.spring.0.direction": direction}).shoe.spring[0].direction == direction


def test_only_what_lies_in_the_plane_is_in_the_plane(scene):
    assert scene.shoe.in_plane
    assert load_scene(NOMINAL).shoe.in_plane
    for key in ("shoe.spring.1.at", "shoe.spring.0.direction", "shoe.force.0.at", "shoe.force.0.direction"):
        assert not scene.with_values({key: (0.01, 0.1, 1e-3)}).shoe.in_plane


@pytest.mark.parametrize(
    ("change", "key", "value"),
    [
        ("shoe.elastic.young=70e9", "shoe.elastic.young", 70e9),
        ('shoe.elastic.young="70 GPa"', "shoe.elastic.young", 70e9),
        ("shoe.spring.0.stiffness=2e9", "shoe.spring.0.stiffness", 2e9),
        ("shoe.spring.1.damping=3 N*s/m", "shoe.spring.1.damping", 3.0),
        ("shoe.spring.1.damping=3 N·s/m", "shoe.spring.1.damping", 3.0),
        ("shoe.spring.1.damping=3 kg/s", "shoe.spring.1.damping", 3.0),
        ("shoe.spring.1.radius=8 mm", "shoe.spring.1.radius", 8e-3),
        ("shoe.force.0.size=3 kN", "shoe.force.0.size", 3e3),
        ("shoe.spring.0.at=[0, 0, '1 mm']", "shoe.spring.0.at", (0.0, 0.0, 1e-3)),
        ("shoe.spring.0.at.2=1 mm", "shoe.spring.0.at", (-0.09, 0.02, 1e-3)),
    ],
)
def test_settings_reach_into_lists(setting, change, key, value):
    scene, before = setting(change), setting()
    assert scene.numbers() == before.numbers() | {key: value}
    assert before.with_values({key: value}) == scene


def test_tables_within_the_shoe_can_be_left_out(setting, scene):
    rigid = setting("shoe.elastic=none")
    assert rigid == scene.with_values({"shoe.elastic": None})
    assert rigid.shoe.elastic is None
    free = setting("shoe.spring=none")
    assert free == scene.with_values({"shoe.spring": None}) == scene.with_values({"shoe.spring": []})
    assert free.shoe.spring == ()
    assert load_scene(NOMINAL, ["shoe.elastic=none", "shoe.force=none"]) == load_scene(NOMINAL)


@pytest.mark.parametrize(
    ("change", "place", "cure"),
    [
        ("shoe.spring.0.stifness=1", "shoe.spring.0.stifness", "did you mean shoe.spring.0.stiffness?"),
        ("shoe.elastic.yuong=1", "shoe.elastic.yuong", "did you mean shoe.elastic.young?"),
        ("shoe.young=1", "shoe.young", "did you mean shoe.elastic.young?"),
        ("shoe.force.0.force=1", "shoe.force.0.force", "the keys here are at, direction, radius, size"),
        ("shoe.spring=[{}]", "shoe.spring.0.at", 'add it to [[shoe.spring]], such as at = ["40 mm", "95 mm", "0 mm"]'),
        ("shoe.elastic={young=7e10, up_to=1e4}", "shoe.elastic.poisson", "to [shoe.elastic], such as poisson = 0.3"),
        ("shoe.elastic={poisson=0.3, up_to=1e4}", "shoe.elastic.young", 'to [shoe.elastic], such as young = "210 GPa"'),
        ("shoe.spring.1.stiffness=1 N", 'shoe.spring.1.stiffness = "1 N"', 'a stiffness such as "1e8 N/m"'),
        ("shoe.spring.1.stiffness=-1", "shoe.spring.1.stiffness = -1", "not be below 0 N/m"),
        ("shoe.spring.1.damping=-1", "shoe.spring.1.damping = -1", "not be below 0 N*s/m"),
        ("shoe.spring.1.damping=1 N/m", "shoe.spring.1.damping", 'a damping such as "100 N s/m"'),
        ("shoe.spring.1.radius=-1 mm", 'shoe.spring.1.radius = "-1 mm"', "not be below 0 m"),
        ("shoe.spring.1.radius=3 N", "shoe.spring.1.radius", 'a length such as "100 mm"'),
        ("shoe.spring.0.at=[1, 2]", "shoe.spring.0.at = [1, 2]", "a list of three, along x, y and z"),
        ("shoe.spring.0.at=1", "shoe.spring.0.at = 1", "a list of three"),
        ("shoe.force.0.at=[0, 0, '1 s']", 'shoe.force.0.at[2] = "1 s"', "not a unit of length"),
        ("shoe.force.0.direction=[0, 0, 0]", "shoe.force.0.direction = [0, 0, 0]", "such as [0.0, 1.0, 0.0]"),
        ("shoe.force.0.direction=[0, 0, '1 m']", "shoe.force.0.direction[2]", "a plain number"),
        ("shoe.force.0.size={time=[0,1], value=[0,'1 m']}", "shoe.force.0.size.value[1]", "not a unit of force"),
        ("shoe.elastic.poisson=0.5", "shoe.elastic.poisson = 0.5", "not be above 0.49"),
        ("shoe.elastic.poisson=-0.1", "shoe.elastic.poisson = -0.1", "not be below 0"),
        ("shoe.elastic.young=0", "shoe.elastic.young = 0", "above 0 Pa"),
        ("shoe.elastic.up_to=0 Hz", "shoe.elastic.up_to", "above 0 Hz"),
        ("shoe.elastic=3", "shoe.elastic = 3", "write it as [shoe.elastic] with its keys"),
        ("shoe.spring=[3]", "shoe.spring[0] = 3", "write it as [[shoe.spring]] with its keys"),
        ("shoe.spring={}", "shoe.spring = {}", "a list of tables; write each of them as [[shoe.spring]]"),
        ("shoe=[{}, {}]", "shoe.0.outer_radius", "the key is missing; add it to [[shoe]], such as outer_radius"),
        ("shoe.mesh.file='shoe.inp'", "shoe.mesh.unit", "the key is missing; add it to [shoe.mesh]"),
        ("steady.state=uniform-pressure", "steady.state", 'would do nothing; write state = "self-consistent"'),
        ("shoe.force=none", "contact.normal_load", "nothing presses the lining on the drum; add normal_load"),
        ("shoe.force=none", "contact.normal_load", "a table [[shoe.force]]"),
        (
            "start.displacement.E01=1",
            "start.displacement.E01",
            "E1, E2, ... of an elastic shoe, and drum.E1, drum.E2, ... of an elastic drum",
        ),
        ("start.displacement.E1=1 m", 'start.displacement.E1 = "1 m"', 'such as "1e-6 m*kg^0.5"'),
        ("start.velocity.E1=1 m/s", "start.velocity.E1", 'such as "1e-3 m*kg^0.5/s"'),
        ("forcing={amplitude={E1='1 N'}, frequency=1}", "forcing.amplitude.E1", 'such as "10 N/kg^0.5"'),
    ],
)
def test_a_wrong_value_names_its_key_and_the_cure(setting, change, place, cure):
    with pytest.raises(SceneError) as caught:
        setting(change)
    assert str(caught.value).startswith(f"--set {change}: {place}")
    assert cure in str(caught.value)


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ("shoe.spring.2.stiffness=1", "this scene has 2 of shoe.spring; write shoe.spring.0 to shoe.spring.1"),
        ("shoe.spring.-1.stiffness=1", "counted from 0"),
        ("shoe.spring.01.stiffness=1", "counted from 0"),
        ("shoe.spring.stiffness.0=1", "counted from 0"),
        ("shoe.spring." + "9" * 5000 + ".stiffness=1", "counted from 0"),
        ("shoe.force.1.size=1", "this scene has 1 of shoe.force; write shoe.force.0"),
        ("shoe.spring.0.at.3=1", "write shoe.spring.0.at.0 to shoe.spring.0.at.2"),
        ("shoe.width.0=1", "shoe.width is a value, not a table, so it has no key 0"),
        ("shoe.spring.0.at.0.x=1", "shoe.spring.0.at.0 is a value, not a table"),
    ],
)
def test_an_entry_that_is_not_there_is_refused_with_what_is(setting, change, cause):
    with pytest.raises(SceneError) as caught:
        setting(change)
    assert cause in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_an_entry_of_a_list_that_is_not_there_is_refused():
    cure = r"shoe\.spring\.0\.stiffness: this scene has no shoe\.spring; add a table \[\[shoe\.spring\]\]"
    with pytest.raises(SceneError, match=cure):
        load_scene(NOMINAL, ["shoe.spring.0.stiffness=1"])


def test_a_load_may_be_left_out_only_where_a_force_takes_its_place():
    contact = {"stiffness": 1e10}
    with pytest.raises(SceneError, match="nothing presses the lining"):
        load_scene(NOMINAL).with_values({"contact": contact})
    unloaded = load_scene(NOMINAL).with_values({"contact": {**contact, "normal_load": 0}})
    assert unloaded.contact.normal_load == 0
    force = {"at": [0, 0.1, 0], "direction": [1, 0, 0], "size": 10}
    both = {"shoe.force": [force], "steady.state": "self-consistent", "contact.normal_load": "2 kN"}
    assert load_scene(NOMINAL).with_values(both).contact.normal_load == 2000


def test_springs_at_points_go_with_uniform_pressure():
    spring = {"at": [0, 0.1, 0], "direction": [0, 0, 2], "stiffness": "1 kN/mm"}
    scene = load_scene(NOMINAL).with_values({"shoe.spring": [spring]})
    assert scene.steady.state == "uniform-pressure"
    assert scene.shoe.spring[0].direction == (0.0, 0.0, 1.0)


# Elastic modes as coordinates.


def test_elastic_modes_can_be_started_forced_and_listed(scene):
    amplitude = {"E1": "1 N/kg^0.5"}
    moved = scene.with_values(
        {
            "start.displacement": {"E1": "1e-6 m*kg^0.5", "E12": 1e-7, "Tz": 1e-6},
            "start.velocity": {"E3": "2 mm*kg^0.5/s"},
            "forcing": {"amplitude": amplitude, "frequency": 1000},
            "simulate.coordinates": ["E12", "Tz", "E3", "E1", "X", "E2"],
        }
    )
    assert moved.start.displacement == {"E1": 1e-6, "E12": 1e-7, "Tz": 1e-6}
    assert moved.start.velocity == {"E3": pytest.approx(2e-3, rel=1e-15)}
    assert moved.simulate.coordinates == ("X", "Tz", "E1", "E2", "E3", "E12")
    assert moved.numbers()["forcing.amplitude.E1"] == 1.0
    assert quantity_of("forcing.amplitude.E1", moved).unit == "N/kg^0.5"
    assert moved.starts()["start.displacement.E12"] == 1e-7
    assert moved.starts()["start.velocity.E2"] == 0.0
    assert reloaded(moved) == moved
    either = moved.with_values({"simulate.coordinates": "auto"})
    assert list(either.starts())[6:9] == [f"start.displacement.{name}" for name in ("E1", "E3", "E12")]
    assert read_variation("start.velocity.E3=1e-3..2e-3", either, starts=True).unit == "m*kg^0.5/s"


@pytest.mark.parametrize(
    ("values", "place"),
    [
        ({"start.displacement.E1": 0}, "start.displacement.E1"),
        ({"start.velocity.E2": 1}, "start.velocity.E2"),
        ({"forcing": {"amplitude": {"E1": 1}, "frequency": 1}}, "forcing.amplitude.E1"),
        ({"simulate.coordinates": ["X", "Y", "Tz", "E1"]}, "simulate.coordinates"),
    ],
)
def test_a_rigid_shoe_has_no_elastic_modes(values, place):
    with pytest.raises(SceneError, match=rf"{place}.*: the shoe is rigid .* add a table \[shoe.elastic\]"):
        load_scene(NOMINAL).with_values(values)


def test_an_elastic_mode_that_is_started_must_be_listed(scene):
    with pytest.raises(SceneError, match="E2 is started but not among"):
        scene.with_values({"simulate.coordinates": ["X", "Y", "Tz", "E1"], "start.displacement.E2": 1})


@pytest.mark.parametrize("unit", ["m*kg^0.5", "m kg^0.5", "m * kg**0.5", "m·kg^0.5"])
def test_a_product_may_be_written_with_a_space(unit):
    assert parse_quantity(f"2 {unit}", "m*kg^0.5") == 2.0


# What goes by the numbers of a scene.


@pytest.mark.parametrize(
    ("text", "unit", "ends"),
    [
        ("shoe.spring.0.stiffness=1e8..1e10x20", "N/m", (1e8, 1e10)),
        ("shoe.spring.1.damping=0 N s/m..10 N s/m", "N*s/m", (0, 10)),
        ("shoe.elastic.young=70 GPa..210 GPa", "Pa", (70e9, 210e9)),
        ("shoe.force.0.size=-1 kN..1 kN", "N", (-1000, 1000)),
    ],
)
def test_numbers_within_the_shoe_can_be_varied(scene, text, unit, ends):
    found = read_variation(text, scene)
    assert (found.unit, found.first, found.last) == (unit, *ends)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("shoe.spring.2.stiffness=1..2", r"has 2 of shoe\.spring; write shoe\.spring\.0 to shoe\.spring\.1"),
        ("shoe.spring.0.stifness=1..2", r"did you mean shoe\.spring\.0\.stiffness\?"),
        ("shoe.spring.0.at=1..2", r"is a list .*--set shoe\.spring\.0\.at=\[\.\.\.\]"),
        ("shoe.elastic.up_to=1..2", "no number of this scene's brake"),
        ("shoe.elastic.poisson=0.3..0.6", "must not be above 0.49"),
    ],
)
def test_mistakes_in_ranges(scene, text, said):
    with pytest.raises(SceneError, match=said):
        read_variation(text, scene)


def test_numbers_of_tables_that_are_not_there_are_refused_with_the_cure(scene):
    for text, said in (
        ("shoe.elastic.young=1..2", r"has no table shoe\.elastic; add it with all its keys"),
        ("shoe.spring.0.damping=1..2", r"has no shoe\.spring; add a table \[\[shoe\.spring\]\]"),
    ):
        with pytest.raises(SceneError, match=said):
            read_variation(text, load_scene(NOMINAL))
    profile = scene.with_values({"shoe.force.0.size": {"time": [0, 1], "value": [0, 1]}})
    for key in ("shoe.force.0.size", "shoe.force.0.size.value"):
        with pytest.raises(SceneError, match=r"shoe\.force\.0\.size is a profile over time .* --set shoe\.force\.0"):
            read_variation(f"{key}=1..2", profile)


def test_keys_and_units_name_the_first_of_a_list(scene):
    single = [key for key, value in scene.numbers().items() if isinstance(value, float)]
    assert {key for key in single if ".1." not in key} <= set(number_units())
    for key in single:
        assert quantity_of(key, scene).unit == number_units()[key.replace(".1.", ".0.")]
    assert {"shoe.elastic.up_to", "shoe.spring.0.at", "shoe.force.0.size"} < set(setting_keys())
    assert "shoe.elastic.up_to" not in number_units()
    assert not {"shoe.elastic", "shoe.spring", "shoe.force"} & set(setting_keys())


@pytest.mark.parametrize("quoted", [True, False])
def test_numbers_within_the_shoe_may_be_uncertain(tables, quoted):
    spread = {"distribution": "uniform", "low": "1e8 N/m", "high": "1e9 N/m"}
    table = {"shoe.spring.1.stiffness": spread} if quoted else {"shoe": {"spring": {"1": {"stiffness": spread}}}}
    scene = scene_from_dict({**tables, "uncertain": table})
    assert scene.uncertain == {"shoe.spring.1.stiffness": Uniform(1e8, 1e9)}
    assert reloaded(scene) == scene
    plan = sample(scene, [], 10)
    assert plan.scene_at(plan.values(0, 1)[0]).shoe.spring[1].stiffness == plan.values(0, 1)[0, 0]
    with pytest.raises(SceneError, match=r"uncertain\.shoe\.spring\.2\.stiffness: this scene has no such number"):
        scene_from_dict({**tables, "uncertain": {"shoe.spring.2.stiffness": spread}})


def test_many_uncertain_springs_are_checked_table_by_table(scene):
    # Twenty tables of two numbers have 80 corners, one table of forty would have 1e12.
    springs = scene.with_values({"shoe.spring": [scene.shoe.spring[0].model_dump()] * 20})
    spread = {"distribution": "uniform", "low": 1.0, "high": 2.0}
    keys = [f"shoe.spring.{k}.{name}" for k in range(20) for name in ("stiffness", "damping")]
    plan = sample(springs.with_values({"uncertain": dict.fromkeys(keys, spread)}), [], MOST_POINTS)
    assert plan.keys == tuple(keys)


def test_a_new_value_keeps_the_unit_of_the_file(tables, scene):
    written = Written(scene, tables)
    assert written.unit("shoe.spring.1.stiffness") == "kN/mm"
    assert written.exact("shoe.spring.1.stiffness", 2e9) == "2e3 kN/mm"
    after = written.with_values({"shoe.spring.1.stiffness": "2e3 kN/mm"})
    assert after.scene == scene.with_values({"shoe.spring.1.stiffness": 2e9})
    assert scene_from_dict(tomllib.loads(after.to_toml())) == after.scene


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("shoe.elastic.young", 210, "did you mean 210 GPa?"),
        ("shoe.spring.1.stiffness", 500, "shoe.spring.1.stiffness = 500 N/m is far from what drum brakes have"),
        ("shoe.force.0.size", 0.5, "did you mean 0.5 kN?"),
        ("shoe.force.0.size", {"time": [0, 1], "value": [0, 0.5]}, "shoe.force.0.size.value[1] = 0.5 N"),
        ("shoe.force.0.at", (10e3, 0, 0), "shoe.force.0.at is 1e+04 m from the middle of the drum"),
        ("shoe.spring.1.at", (0, 0.2, -10), "shoe.spring.1.at is 10 m from the middle of the drum"),
    ],
)
def test_what_no_brake_has_is_reported(scene, key, value, said):
    assert not list(unusual(scene))
    assert said in " ".join(unusual(scene.with_values({key: value})))
