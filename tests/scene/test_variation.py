"""A number over a range, as the command line has it."""

import math
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drumsqueal.scene import Scene, SceneError, load_scene
from drumsqueal.scene.variation import MOST_POINTS, POINTS, Variation, read_variation


@pytest.mark.parametrize(
    ("text", "key", "unit", "values"),
    [
        ("drum.speed=1..4x4", "drum.speed", "rad/s", (1, 2, 3, 4)),
        (" drum.speed = 1 .. 3 x 2 ", "drum.speed", "rad/s", (1, 3)),
        ("drum.speed=30 rpm..60 rpmx3", "drum.speed", "rad/s", (math.pi, 1.5 * math.pi, 2 * math.pi)),
        ("drum.speed=30..60 rpm", "drum.speed", "rad/s", (math.pi, 2 * math.pi)),
        ("contact.normal_load=500 N..4 kN x 2", "contact.normal_load", "N", (500, 4000)),
        ("friction.static=40 %..0.5e0x2", "", "", ()),
        ("friction.static=40 %..50 %×2", "friction.static", "", (0.4, 0.5)),
        ("drum.speed=5..-5x3", "drum.speed", "rad/s", (5, 0, -5)),
        ("shoe.arc_angle=1e1..2.e+1degx2", "shoe.arc_angle", "rad", (math.pi / 18, math.pi / 9)),
        ("support.upper_stiffness=0..1e8x2", "support.upper_stiffness", "N/m", (0, 1e8)),
    ],
)
def test_ranges(nominal, text, key, unit, values):
    if not key:
        with pytest.raises(SceneError, match=r"unit of 0\.5e0 is missing"):
            read_variation(text, nominal)
        return
    found = read_variation(text, nominal)
    assert (found.key, found.unit) == (key, unit)
    assert (found.first, found.last) == pytest.approx((values[0], values[-1]), rel=1e-15)
    assert len(found.values) == (len(values) if "x" in text.rsplit("..")[-1] or "×" in text else POINTS)
    if len(found.values) == len(values):
        assert found.values == pytest.approx(values, rel=1e-15, abs=1e-15)


def test_a_force_has_the_unit_of_its_coordinate(nominal):
    forced = nominal.with_values({"forcing": {"amplitude": {"Y": 1.0, "Tz": 2.0}, "frequency": 100.0}})
    assert read_variation("forcing.amplitude.Y=1 N..2 N", forced).unit == "N"
    assert read_variation("forcing.amplitude.Tz=1..2", forced).unit == "N*m"


def test_a_range_alone(nominal):
    assert read_variation("drum.speed=1..40", nominal, points=None) == Variation("drum.speed", "rad/s", (1.0, 40.0))
    with pytest.raises(SceneError, match="takes no number of values; leave out x5"):
        read_variation("drum.speed=1..40x5", nominal, points=None)
    for text in ("drum.speed", "drum.speed=3"):  # what is advised is what is taken
        with pytest.raises(SceneError, match=r"such as drum\.speed=1\.\.40$"):
            read_variation(text, nominal, points=None)


@pytest.mark.parametrize(
    ("text", "unit", "shown"),
    [
        ("drum.speed=30 rpm..60 rpm x3", "rpm", (30, 45, 60)),
        ("drum.speed=30..60rpm", "rpm", None),
        ("shoe.arc_angle=60 deg..170 deg x2", "deg", (60, 170)),
        ("friction.static=40 %..50 % x2", "%", (40, 50)),
        ("drum.speed=1 rad/s..3 rad/s x3", "rad/s", (1, 2, 3)),
        ("drum.speed=1..3x3", "rad/s", (1, 2, 3)),
        ("contact.normal_load=500 N..4 kN x2", "N", (500, 4000)),  # two units: in SI
    ],
)
def test_values_are_shown_in_the_unit_that_was_given(nominal, text, unit, shown):
    found = read_variation(text, nominal)
    assert found.shown_unit == unit
    if shown is not None:
        assert [found.shown(value) for value in found.values] == pytest.approx(shown, rel=1e-14)
    assert found.with_unit(found.last) == f"{found.shown(found.last):.6g} {unit}"


@pytest.mark.parametrize("text", ["70e9..210e9 x3", "70e9..210e9 Pa x3", "70..210 GPa x3", "0.07 TPa..210 GPa x3"])
def test_an_elastic_modulus_is_shown_in_gigapascals(nominal, text):
    bending = nominal.with_values({"shoe.elastic": {"young": 210e9, "poisson": 0.3, "up_to": 5e3}})
    found = read_variation(f"shoe.elastic.young={text}", bending)
    assert [found.with_unit(value) for value in found.values] == ["70 GPa", "140 GPa", "210 GPa"]
    assert found.values == pytest.approx((7e10, 1.4e11, 2.1e11), rel=1e-14)  # the scene takes pascals


@pytest.mark.parametrize(
    ("text", "value", "brief"),
    [
        ("drum.speed=50..60 rpm", 52.1053, "52.1"),  # a hundredth of 10 rpm
        ("drum.speed=50..51 rpm", 50.5263, "50.53"),
        ("shoe.elastic.young=70..210 GPa", 123.456, "123"),
        ("friction.static=0.4..0.6", 0.412345, "0.412"),  # three digits at least
        ("drum.speed=1..400", 1.23456, "1.23"),
        ("drum.speed=1..400", 0.0, "0"),
    ],
)
def test_a_value_in_brief_is_known_to_a_hundredth_of_the_range_in_its_unit(nominal, text, value, brief):
    bending = nominal.with_values({"shoe.elastic": {"young": 210e9, "poisson": 0.3, "up_to": 5e3}})
    found = read_variation(text, bending)
    assert found.brief(value * found.size) == brief


def test_the_heading_of_a_column_has_the_unit(nominal):
    for text, heading in (
        ("drum.speed=1..2", "drum.speed_rad_per_s"),
        ("contact.stiffness=1..2", "contact.stiffness_N_per_m3"),
        ("friction.static=0.4..0.6", "friction.static"),
    ):
        assert read_variation(text, nominal).column == heading


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("drum.speed", r"write KEY=FROM\.\.TO\[xN\]"),
        ("drum.speed=", "nothing is no range"),
        ("drum.speed=3", r"3 is no range; write FROM\.\.TO"),
        ("drum.speed=1..2..3", "is no range"),
        ("drum.speed=1...2", "is no range"),
        ("drum.speed=2..2", "begins where it ends"),
        ("drum.speed=60 rpm..6.283185307179586", "unit of 6.283185307179586 is missing"),
        ("drum.speed=1..60,5", "60,5: a number takes a decimal point and no comma"),
        ("drum.speed=nan..5", "nan: this is not a number followed by a unit"),
        ("drum.speed=1..60x2.5", r"x2\.5: the number of values must be a whole number"),
        ("drum.speed=1 rpm..60 rpm x -3", "x-3: the number of values must be a whole number"),
        ("drum.speed=1..2x1", "from 2 to 10000"),
        (f"drum.speed=1..2x{MOST_POINTS + 1}", "from 2 to 10000"),
        ("drum.speed=1..2x" + "9" * 5000, "from 2 to 10000"),
        ("drum.speed=1 Hz..2 Hz", "not a unit of angular speed"),
        ("drum.speed=1e400..2", "must be finite"),
        ("friction.static=-1..2", "must not be below 0"),
        ("shoe.thickness=1 mm..200 mm", "smaller than shoe.outer_radius"),
        ("drum.sped=1..2", r"did you mean drum\.speed\?"),
        ("speed=1..2", r"did you mean drum\.speed\?"),
        ("friction.law=1..2", "no number of this scene"),
        ("simulate.duration=1..2", r"the nearest are .*; drumsqueal sensitivity SCENE lists all$"),
        ("damping.ratio=0..1", "has no table damping"),
        ("=1..2", "nothing is no number"),
        ("drum.speed=1..2\x1b[2J", r"\?\[2J"),
    ],
)
def test_mistakes(nominal, text, said):
    with pytest.raises(SceneError, match=said) as caught:
        read_variation(text, nominal)
    assert str(caught.value).startswith("--along ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["nominal", "leading_shoe"])
def test_a_key_with_a_place_too_many_or_too_few_is_refused(name):
    scene = load_scene(name)
    for key in [*scene.numbers(), *scene.starts()]:
        parts = key.split(".")
        for k in range(len(parts)):
            more = (".".join([*parts[: k + 1], place, *parts[k + 1 :]]) for place in ("0", "9", "x"))
            for wrong in {*more, ".".join(parts[:k] + parts[k + 1 :])} - scene.numbers().keys():
                with pytest.raises(SceneError) as caught:
                    read_variation(f"{wrong}=1..2", scene)
                assert str(caught.value).startswith(f"--along {wrong}=1..2: ")
                assert "\n" not in str(caught.value)


def test_a_profile_has_no_value_to_vary():
    stop = load_scene(Path(__file__).parents[2] / "scenarios" / "stop.toml")
    for key in ("drum.speed", "drum.speed.value"):
        with pytest.raises(SceneError, match="profile over time"):
            read_variation(f"{key}=1..2", stop)


def test_values_that_do_not_differ_are_refused(nominal):
    with pytest.raises(SceneError, match="too narrow for 40 values"):
        read_variation("drum.speed=1..1.0000000000000002", nominal)


@given(
    first=st.floats(1e-6, 1e6),
    last=st.floats(1e-6, 1e6),
    count=st.none() | st.integers(2, 200),
    gap=st.sampled_from(["", " "]),
    unit=st.sampled_from(["", "rad/s", "rpm"]),
)
def test_what_is_written_is_read(nominal, first, last, count, gap, unit):
    written = (
        f"drum.speed={first!r}{gap}{unit}{gap}..{gap}{last!r}{gap}{unit}{'' if count is None else f'{gap}x{count}'}"
    )
    assume(first == last or abs(last - first) > 1e-12 * first)  # 200 values must differ
    if first == last:
        with pytest.raises(SceneError, match="begins where it ends"):
            read_variation(written, nominal)
        return
    found = read_variation(written, nominal)
    factor = math.tau / 60 if unit == "rpm" else 1.0
    assert len(found.values) == (count or POINTS)
    # Both ends to the last digits; in between evenly, in order.
    assert (found.first, found.last) == pytest.approx((factor * first, factor * last), rel=1e-14)
    steps = [b - a for a, b in zip(found.values, found.values[1:], strict=False)]
    assert all((step > 0) == (last > first) for step in steps)
    assert steps == pytest.approx([(found.last - found.first) / len(steps)] * len(steps), rel=1e-6, abs=1e-9)


@given(text=st.text(max_size=40))
def test_any_text_is_read_or_refused(nominal, text):
    for written in (text, f"drum.speed={text}", f"drum.speed=1..{text}"):
        try:
            found = read_variation(written, nominal)
        except SceneError:
            continue
        assert isinstance(nominal.with_values({found.key: found.first}), Scene)
        assert all(map(math.isfinite, found.values))
