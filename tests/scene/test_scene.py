"""A scene is read exactly or refused in one line that says where, what and how to mend it."""

import json
import math
import os
import pickle
import tempfile
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drumsqueal.scene import COORDINATES, Profile, Scene, SceneError, ShoeTable, load_scene, quantities, scene_from_dict
from drumsqueal.scene.file import OPTIONAL_TABLES
from drumsqueal.scene.laws import LAWS
from drumsqueal.scene.quantities import PerCoordinate, Quantity, Table, as_first, parse_quantity
from drumsqueal.scene.shoes import BY_COORDINATE
from drumsqueal.scene.tables import ContactTable, Drum
from drumsqueal.scene.usual import USUAL, unusual

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NOMINAL = SCENARIOS / "nominal.toml"
CUP = (
    '{thickness="12 mm", width="60 mm", back_plate="8 mm", hub_radius="50 mm", young="120 GPa", poisson=0.26, '
    'density="7200 kg/m^3", up_to="8 kHz"}'
)
SHIPPED = sorted(SCENARIOS.glob("*.toml"))

NUMERIC_KEYS = [
    "shoe.outer_radius",
    "shoe.thickness",
    "shoe.width",
    "shoe.arc_angle",
    "shoe.density",
    "support.upper_stiffness",
    "support.lower_stiffness",
    "contact.stiffness",
    "contact.normal_load",
    "friction.static",
    "friction.kinetic",
    "friction.decay",
    "drum.speed",
    "damping.ratio",
    "start.displacement.Y",
    "start.velocity.Tx",
    "simulate.duration",
    "simulate.sample_rate",
    "simulate.tolerance",
]
OTHER_KEYS = [
    "title",
    "shoe",
    "support",
    "contact",
    "contact.separation",
    "contact.normal_load.time",
    "friction",
    "friction.law",
    "friction.direction",
    "drum",
    "damping",
    "steady",
    "steady.state",
    "start",
    "start.displacement",
    "simulate",
    "simulate.coordinates",
    "unknown",
    "shoe.unknown",
    "shoe.elastic",
    "shoe.spring",
    "shoe.spring.0",
    "shoe.force",
]
PUSHED_KEYS = [
    "shoe",
    "shoe.elastic",
    "shoe.elastic.up_to",
    "shoe.spring",
    "shoe.spring.0",
    "shoe.spring.1.at",
    "shoe.spring.1.at.2",
    "shoe.spring.0.direction",
    "shoe.force.0.size",
    "contact.normal_load",
]


def nominal(*changes: str) -> Scene:
    return load_scene(NOMINAL, changes)


PUSHED = (
    'shoe.elastic={young="210 GPa", poisson=0.3, up_to="12 kHz"}',
    'shoe.spring=[{at=["-90 mm", "20 mm", "0 mm"], direction=[3, 4, 0], stiffness="1e9 N/m", damping="100 N s/m"}, '
    "{at=[-0.09, 0.02, 0], direction=[4, -3, 0], stiffness=1e9}]",
    'shoe.force=[{at=["40 mm", "95 mm", "0 mm"], direction=[1, 0, 0], size="2279 N"}]',
    "steady.state=self-consistent",
    "support=none",
    'contact={stiffness="0.35e11 N/m^3"}',
)


def pushed(*changes: str) -> Scene:
    return nominal(*PUSHED, *changes)


def reloaded(scene: Scene) -> Scene:
    return scene_from_dict(tomllib.loads(scene.to_toml()))


def refusal(*changes: str) -> str:
    with pytest.raises(SceneError) as caught:
        nominal(*changes)
    line = str(caught.value)
    assert line.isprintable()
    assert "validation error" not in line
    assert "pydantic" not in line
    return line


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_scenes_load_and_survive_a_round_trip(path, tmp_path):
    scene = load_scene(path)
    copy = tmp_path / "copy.toml"
    copy.write_text(scene.to_toml(), encoding="utf-8")
    assert load_scene(copy) == scene
    assert scene.with_values({}) == scene
    assert pickle.loads(pickle.dumps(scene)) == scene
    assert scene.title
    assert path.read_text(encoding="utf-8").startswith("# ")


def test_the_shipped_scenes_are_what_their_names_say():
    assert {path.stem for path in SHIPPED} >= {
        *("nominal", "constant_friction", "damped", "self_consistent", "out_of_plane", "ramp", "rocking", "stop"),
    }
    base = nominal()
    named = {path.stem: load_scene(path) for path in SHIPPED}
    assert named["damped"] == base.with_values({"title": named["damped"].title, "damping.ratio": 0.005})
    assert named["self_consistent"].steady.state == "self-consistent"
    assert named["out_of_plane"].start.displacement["Tx"] == 2e-6
    assert named["out_of_plane"].start.velocity == {"Z": 1e-3}
    assert named["stop"].drum.speed == Profile((0.0, 0.3), (5.0, 0.0))
    friction = named["constant_friction"].friction
    assert friction is not None
    assert friction.law == "constant"
    assert friction.model_dump() == {"direction": "unit-velocity", "law": "constant", "coefficient": 0.4}


def test_the_nominal_scene_in_numbers():
    scene = nominal()
    assert scene.numbers() == {
        "shoe.outer_radius": 0.1,
        "shoe.thickness": 0.02,
        "shoe.width": 0.0365,
        "shoe.arc_angle": pytest.approx(math.radians(130), rel=1e-15),
        "shoe.density": 7820.0,
        "support.upper_stiffness": 1e8,
        "support.lower_stiffness": 6e8,
        "contact.stiffness": 0.35e11,
        "contact.normal_load": 2000.0,
        "friction.static": 0.5,
        "friction.kinetic": 0.3,
        "friction.decay": 1.0,
        "drum.speed": 5.0,
    }
    assert scene.damping is None
    assert scene.contact.separation is True
    assert scene.start.displacement == {"Y": 1e-7, "Tz": 1e-6}
    assert scene.simulate.coordinates == "auto"


def test_numbers_of_a_profile_are_its_points_and_can_be_put_back():
    scene = load_scene(SCENARIOS / "stop.toml")
    numbers = scene.numbers()
    assert numbers["drum.speed.time"] == (0.0, 0.3)
    assert numbers["drum.speed.value"] == (5.0, 0.0)
    assert "drum.speed" not in numbers
    assert scene.with_values(numbers) == scene
    slower = scene.with_values({"drum.speed.value": ("30 rpm", 0)})
    assert slower.drum.speed == Profile((0, 0.3), (math.pi, 0))


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (3, "m", 3.0),
        (-0.5, "", -0.5),
        ("100 mm", "m", 0.1),
        ("100mm", "m", 0.1),
        ("  1e8 N/m ", "N/m", 1e8),
        ("200 N/mm", "N/m", 2e5),
        ("0.35e11 N/m^3", "N/m^3", 0.35e11),
        ("35 N/mm³", "N/m^3", 35e9),
        ("1 N/mm**3", "N/m^3", 1e9),
        ("36.5 µm", "m", 36.5e-6),
        ("7.82 g/cm^3", "kg/m^3", 7820.0),
        ("180 deg", "rad", math.pi),
        ("180°", "rad", math.pi),
        ("1 turn", "rad", 2 * math.pi),
        ("30 rpm", "rad/s", math.pi),
        ("1 rev/s", "rad/s", 2 * math.pi),
        ("180 deg/s", "rad/s", math.pi),
        ("-5 rad/s", "rad/s", -5.0),
        ("50 kHz", "Hz", 50e3),
        ("5 1/s", "Hz", 5.0),
        ("40 ms", "s", 0.04),
        ("1 s/m", "s/m", 1.0),
        ("2 kN", "N", 2000.0),
        ("50 %", "", 0.5),
        ("1 bar", "Pa", 1e5),
    ],
)
def test_quantities_are_read_in_their_unit(value, unit, expected):
    number = parse_quantity(value, unit)
    assert type(number) is float
    assert number == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(("written", "unit"), [*quantities._USUAL, *((unit, unit) for unit in quantities._EXPECTED)])
@pytest.mark.parametrize("number", [1.0, 36.5, 7.3e-7, -0.35e11])
def test_usual_units_are_converted_as_by_pint_to_the_last_bit(number, written, unit):
    registry = quantities._registry()
    wanted = registry.Quantity(number, registry.parse_units(written)).to(registry.parse_units(unit)).magnitude
    assert parse_quantity(f"{number!r} {written}", unit) == wanted


@pytest.mark.parametrize(
    ("value", "unit", "cause"),
    [
        ("100 s", "m", '"s" (second) is not a unit of length; write a length such as "100 mm" or a number in m'),
        ("5 Hz", "rad/s", '"Hz" (hertz) is not a unit of angular speed'),
        ("5 1/s", "rad/s", "not a unit of angular speed"),
        ("5 rad/s", "Hz", "not a unit of frequency"),
        ("5 rpm", "Hz", "not a unit of frequency"),
        ("5 %", "rad", "not a unit of angle"),
        ("5 m", "J", 'not the like of J; write a value such as "1 J" or a number in J'),
        ("0.1", "m", 'the unit is missing; write 0.1 as a number in m, or "0.1 m"'),
        ("0.5", "", "write 0.5 without the quotes"),
        ("3 dB", "", "a plain number is wanted"),
        ("3 rad", "", "a plain number is wanted"),
        ("5 degC", "m", "not a unit of length"),
        ("5 degC*degC", "m", "not a unit of length"),
        ("5 furlings", "m", 'unknown unit "furlings"'),
        ("5 nan", "m", "unknown unit"),
        ("5 __class__", "m", "unknown unit"),
        ("5 m m", "m", '"m*m" (meter ** 2) is not a unit of length'),
        ("36,5 mm", "m", 'a decimal point and no comma; write "36.5 mm"'),
        ("0,45", "", "a decimal point and no comma; write 0.45"),
        ("mm", "m", "not a number followed by a unit"),
        ("", "m", "not a number followed by a unit"),
        ("9**9**9 m", "m", "not a number followed by a unit"),
        ("9 m**9**9**9", "m", "not a number followed by a unit"),
        ("9 m^99", "m", "not a number followed by a unit"),
        ("9 km³³³³³³³³³³³", "m", "not a number followed by a unit"),
        ("(1).__class__", "m", "not a number followed by a unit"),
        ("٣ m", "m", "not a number followed by a unit"),
        ("1 m" + "*m" * 40, "m", "not a number followed by a unit"),
        ("nan m", "m", "not a number followed by a unit"),
        ("1e400 m", "m", "finite"),
        ("1e308 km", "m", "finite"),
        (math.nan, "m", "finite"),
        (math.inf, "m", "finite"),
        (10**400, "m", "finite"),
        pytest.param(10**5000, "m", "finite", id="too long to print"),
        (True, "m", "not a number"),
        (None, "m", "not a number"),
        ([1.0], "m", "not a number"),
        (1j, "m", "not a number"),
    ],
)
def test_what_is_no_quantity_is_refused_with_the_cause(value, unit, cause):
    with pytest.raises(SceneError) as caught:
        parse_quantity(value, unit)
    line = str(caught.value)
    assert cause in line
    assert line.isprintable()


@pytest.mark.parametrize(
    ("change", "place", "cure"),
    [
        ("shoe.outer_radius=100 s", 'shoe.outer_radius = "100 s"', 'a length such as "100 mm"'),
        ("shoe.outer_raduis=1", "shoe.outer_raduis", "did you mean shoe.outer_radius?"),
        ("simulat.x=1", "simulat:", "did you mean simulate?"),
        ("duration=1", "duration:", "did you mean simulate.duration?"),
        ("extra.key=1", "extra:", "the keys here are title, shoe"),
        (
            "lining.thickness=1",
            "lining:",
            "unknown key; the keys here are title, shoe",
        ),  # a table is no value elsewhere
        ("mesh.file=1", "mesh:", "did you mean shoe.mesh?"),
        (
            "shoe={}",
            "shoe.outer_radius",
            'such as outer_radius = "100 mm" (and 4 more to mend: [2] shoe.thickness: the key is missing; add it to ',
        ),
        ("shoe=3", "shoe = 3", "write it as [shoe]"),
        ("drum=none", 'drum = "none"', "write it as [drum]"),
        ("title=3", "title = 3", "a text in quotes"),
        (r'title="a\u0000b"', 'title = "a\\u0000b"', "letter 2 is the control character U+0000; leave it out"),
        (r'title="\u009b2J"', "title = ", "control character U+009B"),
        ("shoe.width=0", "shoe.width = 0", "above 0 m"),
        ("shoe.width=-1 mm", 'shoe.width = "-1 mm"', "above 0 m"),
        ("shoe.width=true", "shoe.width = true", "a number in m"),
        ("shoe.width=2020-01-01", "shoe.width = <date>", "a number in m"),
        ("shoe.thickness=0.1", "shoe.thickness = 0.1", "smaller than shoe.outer_radius, 0.1 m"),
        ("shoe.arc_angle=361 deg", "shoe.arc_angle = ", "360 deg"),
        ("shoe.density=nan", "shoe.density = NaN", "finite"),
        ("support.upper_stiffness=-1", "support.upper_stiffness = -1", "not be below 0 N/m"),
        ("contact.stiffness=-1", "contact.stiffness = -1", "not be below 0"),
        ("contact.normal_load=-1", "contact.normal_load = -1", "not be below 0 N"),
        ("contact.normal_load={time=[0,1],value=[0,-1]}", "contact.normal_load.value[1] = -1", "not be below 0 N"),
        ("contact.separation=1", "contact.separation = 1", "true or false"),
        ("friction.law=constant", "friction.static", 'belongs to law "exponential"'),
        ("friction.law=stribek", 'friction.law = "stribek"', '"constant" or "exponential"'),
        ("friction={static=1}", "friction.law", 'law = "constant" or "exponential"'),
        ("friction=3", "friction = 3", "must be a table"),
        ("friction.static=-0.1", "friction.static = -0.1", "not be below 0"),
        ("friction.decay=1 m/s", "friction.decay", 'such as "1 s/m"'),
        ("friction.direction=radial", 'friction.direction = "radial"', '"unit-velocity" or "tangential"'),
        ("friction.statik=1", "friction.statik", "did you mean friction.static?"),
        ("drum.speed=5 Hz", 'drum.speed = "5 Hz"', '"48 rpm"'),
        ("drum.speed={time=[0,1]}", "drum.speed", "{ time = [...], value = [...] }"),
        ("drum.speed={time=[0,1],value=[1,2,3]}", "drum.speed", "one value for every time"),
        ("drum.speed={time=[0],value=[1]}", "drum.speed", "a plain value if it is constant"),
        ("drum.speed={time=[0,0],value=[1,2]}", "drum.speed.time[1] = 0.0", "must increase"),
        ('drum.speed={time=[0,"1 m"],value=[1,2]}', 'drum.speed.time[1] = "1 m"', "a time such as"),
        ('drum.speed={time=[0,1],value=[1,"2 m"]}', 'drum.speed.value[1] = "2 m"', "an angular speed such as"),
        ("drum.speed={time=0,value=1}", "drum.speed.value = 1", "a list of values"),
        ("damping.ratio=-0.1", "damping.ratio = -0.1", "not be below 0"),
        ("steady.state=selfconsistent", 'steady.state = "selfconsistent"', '"uniform-pressure" or "self-consistent"'),
        ("start.displacement={Q=1}", "start.displacement.Q", "X, Y, Z, Tx, Ty, Tz"),
        ("start.displacement=1", "start.displacement = 1", "a table of coordinates"),
        ("start.displacement.Tz=1 mm", "start.displacement.Tz", "not a unit of angle"),
        ("start.velocity.Y=1 mm", "start.velocity.Y", "not a unit of velocity"),
        ("simulate.duration=0", "simulate.duration = 0", "above 0 s"),
        ("simulate.duration=0.40001", "simulate.duration = 0.40001", "the nearest duration that fits is 0.4 s"),
        ("simulate.duration=1e-9", "simulate.duration", "the nearest duration that fits is 2e-05 s"),
        ("simulate.duration=3000 s", "simulate.duration = 3000", "a history of about 30 GB"),
        ("simulate.duration=1e300", "simulate.duration", "GB"),
        ("simulate.sample_rate=50 rpm", "simulate.sample_rate", '"50 kHz"'),
        ("simulate.tolerance=1", "simulate.tolerance = 1", "not be above 0.1"),
        ("simulate.tolerance=1e-14", "simulate.tolerance", "not be below 1e-12"),
        ("simulate.coordinates=[]", "simulate.coordinates = []", '["X", "Y", "Tz"]'),
        ("simulate.coordinates=all", "simulate.coordinates", 'write "auto"'),
        ('simulate.coordinates=["X","Q"]', 'simulate.coordinates[1] = "Q"', "X, Y, Z, Tx, Ty, Tz"),
        ('simulate.coordinates=["X","X"]', "simulate.coordinates[1]", "leave one out"),
        ('simulate.coordinates=["X"]', "start.displacement.Y = 1e-07", "among simulate.coordinates"),
    ],
)
def test_a_wrong_value_names_its_key_and_the_cure(change, place, cure):
    line = refusal(change)
    assert line.startswith(f"--set {change}: {place}")
    assert cure in line


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ("drum.speed", "write KEY=VALUE"),
        ("=3", "this is no key"),
        ("drum..speed=3", "this is no key"),
        (".".join("a" * 5000) + "=3", "this is no key"),
        ("shoe.width.x=3", "shoe.width is a value, not a table"),
    ],
)
def test_a_setting_that_fits_nowhere_is_refused(change, cause):
    assert cause in refusal(change)


def test_several_mistakes_are_all_named_with_their_reasons():
    line = refusal("shoe.width=1 s", "shoe.density=1 s", "drum.speed=1 s")
    alone = [refusal(change).partition(": ")[2] for change in ("shoe.width=1 s", "shoe.density=1 s", "drum.speed=1 s")]
    assert line.endswith(f": {alone[0]} (and 2 more to mend: [2] {alone[1]}; [3] {alone[2]})")


def test_a_table_that_is_misspelt_is_not_missing_too():
    tables = tomllib.loads((SCENARIOS / "nominal.toml").read_text())
    tables["drums"] = tables.pop("drum")
    with pytest.raises(SceneError) as caught:
        scene_from_dict(tables)
    assert str(caught.value) == "scene: drums: unknown key; did you mean drum?"


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_a_scene_may_begin_with_a_byte_order_mark(tmp_path, end):
    content = b"\xef\xbb\xbf" + NOMINAL.read_bytes().replace(b"\n", end)
    (tmp_path / "a.toml").write_bytes(content)
    assert load_scene(tmp_path / "a.toml") == load_scene(NOMINAL)
    (tmp_path / "a.toml").write_bytes(content + b"[friction]" + end)
    with pytest.raises(SceneError, match=r"not TOML: Cannot declare .*\(at line"):
        load_scene(tmp_path / "a.toml")


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        (b"title = ", "not TOML"),
        (b"title = 'a'\n[friction]\nstatic = 0,45  # dry", "line 3: a number takes a decimal point and no comma"),
        (b"[start]\ndisplacement = { X = 1, Y = -0,5e-6 }", "write Y = -0.5e-6"),
        (b"title = '0,45'\nx = = 1", "not TOML"),
        (b"x" * 2**20 + b" = 0,45", "not TOML"),
        (b"\xff\xfe", "not UTF-8"),
        (b"x = " + b"[" * 100_000, "nested too deeply"),
        (b"x = " + b"9" * 5000, "an integer has more digits than can be read"),
        (b"#" * (17 * 2**20), "the file of 17 MB is larger than 16 MB"),
        (b"", "table is missing"),
        (b'\\"' * 2**20, "not TOML"),
        (b'x = """' + b'\\"' * 2**20, "not TOML"),
    ],
    ids=[
        "broken",
        "comma",
        "inner comma",
        "comma in text",
        "long comma",
        "encoding",
        "nested",
        "digits",
        "large",
        "empty",
        "quotes",
        "open string",
    ],
)
def test_a_file_that_is_no_scene_is_refused_by_name(content, cause, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(content)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert str(caught.value).startswith(str(path))
    assert cause in str(caught.value)


@pytest.mark.parametrize("setting", ["a" * 130_000, "a" * 130_000 + "=1", "title=" + "a" * 130_000, "x." * 60_000])
def test_an_enormous_setting_is_refused_in_a_short_line(setting):
    with pytest.raises(SceneError) as caught:
        load_scene(NOMINAL, [setting])
    assert len(str(caught.value)) < 1000


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_what_never_ends_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    for path in (tmp_path / "pipe.toml", "/dev/zero"):
        with pytest.raises(SceneError, match="not an ordinary file"):
            load_scene(path)


def test_a_path_that_is_no_file_is_refused_by_name(tmp_path):
    with pytest.raises(SceneError, match="this is a directory"):
        load_scene(tmp_path)
    with pytest.raises(SceneError, match=r"absent\.toml: there is no such file"):
        load_scene(tmp_path / "absent.toml")
    with pytest.raises(SceneError, match="cannot be read"):
        load_scene("x" * 5000)
    with pytest.raises(SceneError):
        load_scene("null\0character")


@pytest.mark.parametrize(
    "data",
    [3, None, [], {1: 2}, {"shoe": {1: 2}}, {"shoe": 10**5000}, {"title": "\ud800"}],
    ids=["number", "nothing", "list", "numbered", "numbered table", "long integer", "half a character"],
)
def test_what_is_no_mapping_of_tables_is_refused(data):
    with pytest.raises(SceneError) as caught:
        scene_from_dict(data, source="here")
    assert str(caught.value).startswith("here: ")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("changes", "values"),
    [
        (["drum.speed=3"], {"drum.speed": 3}),
        (["drum.speed=3"], {"drum.speed": "3 rad/s"}),
        (['drum.speed="30 rpm"'], {"drum.speed": "30 rpm"}),
        (["drum.speed=30 rpm"], {"drum.speed": "30 rpm"}),
        (["drum.speed={time=[0, 1], value=[1, 2]}"], {"drum.speed": Profile((0, 1), (1, 2))}),
        (["drum.speed={time=[0, 1], value=[1, 2]}"], {"drum.speed": {"time": (0, "1 s"), "value": (1, 2)}}),
        (["steady.state=self-consistent"], {"steady.state": "self-consistent"}),
        (["start.displacement={Y = 1e-5}"], {"start.displacement": {"Y": 1e-5}}),
        (["start.displacement.X=1 um"], {"start.displacement.X": "1 um"}),
        (["friction=none"], {"friction": None}),
        (["support=none", "damping=none"], {"support": None, "damping": None}),
        (["damping.ratio=1 %"], {"damping.ratio": 0.01}),
        (['friction={law="constant", coefficient=0.4}'], {"friction": {"law": "constant", "coefficient": 0.4}}),
        (["contact.separation=false"], {"contact.separation": False}),
        (['simulate.coordinates=["Tz", "Y"]'], {"simulate.coordinates": ["Y", "Tz"]}),
        (
            ['forcing={amplitude={Y="10 N", Tz="0.5 N*m"}, frequency="1 kHz"}'],
            {"forcing": {"amplitude": {"Y": 10, "Tz": 0.5}, "frequency": 1e3}},
        ),
        (["title=a = b"], {"title": "a = b"}),
        (["title=1\nshoe = 2"], {"title": "1\nshoe = 2"}),
        (["title="], {"title": ""}),
        ([r'title="a\tb\r\n制动 🚗"'], {"title": "a\tb\r\n制动 🚗"}),
        (["drum.speed=1", "drum.speed=2"], {"drum.speed": 2}),
    ],
)
def test_settings_and_values_agree_and_survive_a_round_trip(changes, values):
    scene = nominal(*changes)
    assert scene == nominal().with_values(values)
    assert reloaded(scene) == scene


def test_an_optional_table_left_out_is_no_effect_and_no_number():
    scene = nominal("friction=none", "support=none")
    assert scene.friction is None
    assert scene.support is None
    assert not {key.split(".")[0] for key in scene.numbers()} & {"friction", "support", "damping"}


def test_every_table_that_may_be_missing_can_be_left_out():
    for within, table in {"": Scene, "shoe.": ShoeTable, "drum.": Drum}.items():
        missing = {key for key, field in table.model_fields.items() if type(None) in get_args(field.annotation)}
        assert {f"{within}{key}" for key in missing} <= set(OPTIONAL_TABLES)


def test_every_unit_of_a_scene_can_be_written_in_it():
    tables = [
        Scene,
        *Table.__subclasses__(),
        *(each for table in Table.__subclasses__() for each in table.__subclasses__()),
    ]
    readers = [each for table in tables for field in table.model_fields.values() for each in field.metadata]
    units = {each.unit for each in readers if isinstance(each, Quantity)} - {""}
    for each in readers:
        if isinstance(each, PerCoordinate):
            units |= {each.length_unit, each.angle_unit, each.modal_unit}
    assert {"N/kg^0.5", "m*kg^0.5/s", "rad/s", "Pa"} <= units
    for unit in units:
        assert parse_quantity(f"2 {unit}", unit) == pytest.approx(2, rel=1e-15)


def by_coordinate(table: type[Table]) -> tuple[str, ...]:
    fields = table.model_fields.items()
    return tuple(key for key, field in fields if any(isinstance(each, PerCoordinate) for each in field.metadata))


def test_what_has_a_number_for_each_coordinate_is_known_and_takes_coordinates_that_there_are():
    fields = ((name, (field.annotation, *get_args(field.annotation))) for name, field in Scene.model_fields.items())
    tables = {
        name: each for name, kinds in fields for each in kinds if isinstance(each, type) and issubclass(each, Table)
    }
    assert {name: by_coordinate(table) for name, table in tables.items() if by_coordinate(table)} == BY_COORDINATE
    filled = nominal().with_values({"forcing": {"amplitude": {"Y": 1.0}, "frequency": 100.0}})
    assert {table for table, _ in filled.by_coordinate} == set(BY_COORDINATE), "fill in the new table here"
    for table, key in filled.by_coordinate:
        for wrong in ("foo.Y", "E1", "drum.E1"):
            with pytest.raises(SceneError, match=wrong):
                filled.with_values({f"{table}.{key}": {wrong: 1.0, "Y": 1.0}})


def test_only_optional_tables_can_be_left_out():
    for key in ("drum", "drum.speed", "friction.law"):
        with pytest.raises(
            SceneError,
            match=r"only the tables support, .*, shoe.elastic, shoe.mesh, shoe.modes, drum.elastic, .* can be left out",
        ):
            nominal().with_values({key: None})


def test_a_scene_cannot_be_changed_nor_slipped_past_the_checks():
    scene = nominal()
    with pytest.raises(ValueError, match="frozen"):
        scene.shoe.width = 1.0
    given_table = {"law": "constant", "coefficient": 0.4}
    scene.with_values({"friction": given_table, "friction.coefficient": 0.3})
    assert given_table["coefficient"] == 0.4
    tampered: ShoeTable = scene.shoe.model_copy(update={"width": -1.0})
    with pytest.raises(SceneError, match=r"shoe\.width"):
        scene.with_values({"shoe": tampered})


def test_a_profile_checks_itself():
    assert Profile((0, 1), (1, 2)) == Profile((0.0, 1.0), (1.0, 2.0))
    with pytest.raises(SceneError, match=r"time\[1\]"):
        Profile((1, 0), (1, 2))
    with pytest.raises(SceneError, match="1000000 points would take about 56 MB"):
        Profile(range_of := tuple(range(1_000_000)), range_of)


@pytest.mark.parametrize("coordinates", ["auto", ["Tz", "Y"]])
def test_a_scene_is_written_as_json_without_a_word(coordinates):
    scene = nominal().with_values({"simulate.coordinates": coordinates})
    tables = scene.model_dump(mode="json", exclude_none=True)  # pydantic warns of values that are not as declared
    assert scene_from_dict(json.loads(json.dumps(tables))) == scene


@pytest.mark.thorough
def test_the_longest_profiles_survive_a_round_trip_through_a_file(tmp_path):
    points = tuple(-1 / (number + 3) for number in range(100_000))
    scene = nominal().with_values({"drum.speed": Profile(points, points)})
    path = tmp_path / "long.toml"
    path.write_text(scene.to_toml(), encoding="utf-8")
    assert load_scene(path) == scene


def test_whole_numbers_do_as_well_as_floats():
    changes = {"shoe.arc_angle": 2, "shoe.density": 7820, "friction.static": 1, "simulate.sample_rate": 50000}
    scene = nominal().with_values(changes)
    assert all(isinstance(scene.numbers()[key], float) for key in list(changes)[:3])
    assert reloaded(scene) == scene


# Profiles and tables among the garbage, so that every branch of the reading meets it.
scalars = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=80)
    | st.sampled_from(["9**9**9", "1 m", "1 Hz", "0.1", "auto", "constant", 10**400, *COORDINATES])
    | st.builds("{} {}".format, st.floats(), st.sampled_from(["m", "rad", "s", "kHz", "rpm", "degC", "dB", "N/m^3"]))
)
garbage = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text(max_size=4) | st.sampled_from(["time", "value", "law", "Y"]), inner, max_size=3)
    ),
    max_leaves=8,
)


def outcome(make: Callable[[], Scene]) -> tuple[Scene | None, str]:
    """Return the scene, once it has survived a round trip, or the line that refuses it; any other error gets out."""
    line = ""
    try:
        scene = make()
    except SceneError as error:
        scene, line = None, str(error)
    assert line.isprintable()
    assert scene is None or reloaded(scene) == scene
    return scene, line


@pytest.mark.thorough
@settings(derandomize=True, max_examples=600)
@given(key=st.sampled_from(NUMERIC_KEYS + OTHER_KEYS), value=garbage)
def test_any_garbage_in_any_key_loads_or_is_refused(key, value):
    scene, line = outcome(lambda: nominal().with_values({key: value}))
    assert scene or key.split(".")[0] in line


@pytest.mark.thorough
@settings(derandomize=True, max_examples=300)
@given(key=st.sampled_from(PUSHED_KEYS), value=garbage | st.lists(scalars, min_size=3, max_size=3))
def test_any_garbage_in_any_key_of_a_pushed_shoe_loads_or_is_refused(key, value):
    scene, line = outcome(lambda: pushed().with_values({key: value}))
    assert scene or key.split(".")[0] in line


@pytest.mark.thorough
@settings(derandomize=True, max_examples=300)
@given(key=st.sampled_from(NUMERIC_KEYS), value=st.integers() | st.floats())
def test_any_number_in_any_numeric_key_loads_or_is_refused_by_key(key, value):
    scene, _ = outcome(lambda: nominal().with_values({key: value}))
    if scene and key in scene.numbers():
        assert scene.numbers()[key] == float(value)


setting = st.text(max_size=60) | st.builds("{}={}".format, st.sampled_from(NUMERIC_KEYS + OTHER_KEYS), st.text())


@pytest.mark.thorough(but=["120"])
@pytest.mark.parametrize("examples", [120, 300])
def test_any_setting_is_taken_or_refused(examples):
    @settings(derandomize=True, max_examples=examples)
    @given(change=setting)
    def taken_or_refused(change):
        outcome(lambda: nominal(change))

    taken_or_refused()


@settings(derandomize=True, max_examples=100)
@given(content=st.binary(max_size=200))
def test_any_bytes_are_a_scene_or_refused(content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_bytes(content)
        with pytest.raises(SceneError):
            load_scene(path)


def test_a_harmonic_force_is_numbers_by_coordinate():
    scene = nominal('forcing={amplitude={Y="10 N"}, frequency="1 kHz", phase="90 deg"}')
    numbers = {key: value for key, value in scene.numbers().items() if key.startswith("forcing")}
    assert numbers == {
        "forcing.amplitude.Y": 10.0,
        "forcing.frequency": 1000.0,
        "forcing.phase": pytest.approx(math.pi / 2, rel=1e-15),
    }


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ('forcing={amplitude={}, frequency="1 kHz"}', "forcing.amplitude: no coordinate has a force"),
        ('forcing={amplitude={Y="10 m"}, frequency="1 kHz"}', "write a force such as"),
        ('forcing={amplitude={Tz="10 N"}, frequency="1 kHz"}', "write a moment such as"),
        ('forcing={amplitude={Y=1}, frequency="0 Hz"}', "the value must be above 0 Hz"),
        ("forcing={amplitude={Y=1}}", "forcing.frequency: the key is missing"),
    ],
)
def test_a_wrong_force_is_refused(change, said):
    assert said in refusal(change)


def test_a_forced_coordinate_must_be_listed():
    said = refusal("forcing={amplitude={Z=1}, frequency=10}", 'simulate.coordinates=["X", "Y", "Tz"]')
    assert "forcing.amplitude.Z = 1.0: Z is forced but not among simulate.coordinates" in said


@pytest.mark.parametrize(
    ("settings", "blamed"),
    [
        (["foo=1"], "--set foo=1: foo: unknown key"),
        (["drum.speed=3", "foo=1", "drum.speed=4"], "--set foo=1: foo: unknown key"),
        (["drum.speed=1 m", "drum.speed=2 m"], '--set drum.speed=1 m: drum.speed = "2 m": '),
        (["drum.speed=1 m", "drum.speed=2", "drum.sped=3"], "--set drum.sped=3: drum.sped: unknown key"),
    ],
)
def test_a_setting_is_blamed_for_what_it_breaks(settings, blamed):
    with pytest.raises(SceneError) as caught:
        load_scene(SCENARIOS / "nominal.toml", settings)
    assert str(caught.value).startswith(blamed)


def test_a_file_is_blamed_for_what_was_wrong_before(tmp_path):
    file = tmp_path / "made.toml"
    file.write_text((SCENARIOS / "nominal.toml").read_text() + "\n[foo]\n")
    with pytest.raises(SceneError, match=r"made.toml: foo: unknown key"):
        load_scene(file, ["drum.speed=3"])


# What brakes have.


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_scenes_are_usual(path):
    assert list(unusual(load_scene(path))) == []


@pytest.mark.parametrize(
    "values",
    [
        # The hub brake of a bicycle, the drum of a scooter, the rear axle of a heavy truck.
        {"shoe.outer_radius": 0.035, "shoe.thickness": 0.006, "shoe.width": 0.02, "contact.normal_load": 60.0},
        {"shoe.outer_radius": 0.055, "shoe.thickness": 0.008, "shoe.width": 0.025, "drum.speed": 140.0},
        {"shoe.outer_radius": 0.21, "shoe.thickness": 0.03, "shoe.width": 0.22, "contact.normal_load": 9e4},
        {"support": None, "friction": None, "contact.normal_load": 0.0, "drum.speed": -20.0},
        {"friction.static": 0.3, "friction.kinetic": 0.3},
    ],
)
def test_brakes_from_bicycles_to_trucks_are_usual(values):
    assert list(unusual(load_scene(NOMINAL).with_values(values))) == []


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        (
            "shoe.outer_radius",
            160,
            "shoe.outer_radius = 160 m is far from what drum brakes have, 30 to 500 mm; did you mean 160 mm?",
        ),
        ("shoe.width", "6 m", "did you mean 6 cm?"),
        ("shoe.density", 7.2, "did you mean 7.2 g/cm^3?"),
        (
            "contact.normal_load",
            4,
            "contact.normal_load = 4 N is far from what drum brakes have, 10 N to 300 kN; did you mean 4 kN?",
        ),
        ("contact.stiffness", 35, "did you mean 35 N/mm^3?"),
        ("drum.speed", -900, "did you mean -900 rpm?"),
        ("drum.speed", {"time": [0, 1], "value": [5, 900]}, "drum.speed.value[1] = 900 rad/s"),
        (
            "damping",
            {"ratio": 0.3},
            "damping.ratio = 0.3 is far from what drum brakes have, 0 to 0.1 (10 %); did you mean 0.3 %?",
        ),
        ("friction.static", 0.2, "friction.static = 0.2 is below friction.kinetic = 0.3"),
        ("friction.kinetic", 30, "did you mean 30 %?"),
        ("shoe.arc_angle", "200 deg", "is far from what drum brakes have, 20 to 180 deg."),
    ],
)
def test_what_no_brake_has_is_reported_with_what_may_be_meant(key, value, said):
    assert said in " ".join(unusual(load_scene(NOMINAL).with_values({key: value})))


def test_every_physical_number_of_a_brake_has_its_range():
    scene = pushed("damping.ratio=0.01", f"drum.elastic={CUP}")
    single = {as_first(key) for key, value in scene.numbers().items() if isinstance(value, float)}
    supported = {f"support.{name}_stiffness" for name in ("upper", "lower")}
    placed = {"drum.elastic.offset"}  # of any size
    of_a_mesh = {f"drum.mesh.{key}" for key in ("density", "young", "poisson")}
    single -= {f"contact.{key}" for key in ContactTable.usual}  # beside its keys
    assert {*USUAL} - of_a_mesh == {key for key in single if not key.startswith("friction.")} - placed | supported
    for law in LAWS.values():
        assert {*law.usual} == {*law.number_keys()}
