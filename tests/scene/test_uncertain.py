"""Distributions of a scene's numbers: read exactly or refused in one line, and drawn from as they say."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from drumsqueal.scene import Scene, SceneError, load_scene, scene_from_dict, uncertain_units
from drumsqueal.scene.uncertain import LogNormal, Normal, Uniform, reach
from drumsqueal.scene.variation import read_variation

TRUCK = Path(__file__).parents[1] / "data" / "truck.toml"
FRACTIONS = np.linspace(0.001, 0.999, 201)


def normal(**parameters) -> dict:
    return {"distribution": "normal", **parameters}


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (Uniform(2.0, 5.0), stats.uniform(2, 3)),
        (Normal(5.0, 0.5), stats.norm(5, 0.5)),
        (Normal(5.0, 2.0, low=4.0), stats.truncnorm(-0.5, np.inf, 5, 2)),
        (Normal(5.0, 2.0, 4.0, 4.5), stats.truncnorm(-0.5, -0.25, 5, 2)),
        (LogNormal(2000.0, 1.2), stats.lognorm(np.log(1.2), scale=2000)),
    ],
)
def test_quantiles_are_those_of_the_distribution(ours, theirs):
    # Two ways to the same inverse of the normal distribution: some rounding of probabilities near 1.
    np.testing.assert_allclose(ours.quantile(FRACTIONS), theirs.ppf(FRACTIONS), rtol=1e-12)


def test_a_truncated_lognormal_keeps_its_shape():
    whole, cut = stats.lognorm(np.log(1.5), scale=3), LogNormal(3.0, 1.5, 2.0, 6.0)
    low, high = whole.cdf([2.0, 6.0])
    np.testing.assert_allclose(cut.quantile(FRACTIONS), whole.ppf(low + FRACTIONS * (high - low)), rtol=1e-12)
    assert reach(cut) == pytest.approx((2.0, 6.0), rel=1e-8)


def test_a_scene_holds_its_distributions_in_SI(nominal, tmp_path):
    table = {
        "drum.speed": normal(mean="48 rpm", deviation="3 rpm"),
        "friction": {"static": normal(mean=0.5, deviation=0.02)},
    }
    scene = nominal.with_values({"uncertain": table})
    assert scene.uncertain == {
        "drum.speed": Normal(48 * np.pi / 30, 3 * np.pi / 30),
        "friction.static": Normal(0.5, 0.02),
    }
    file = tmp_path / "scene.toml"
    file.write_text(scene.to_toml())
    assert load_scene(file) == scene
    # Quoted keys of the file are met by the dotted path of --set.
    changed = load_scene(
        file, ["uncertain.friction.static.mean=0.6", 'uncertain.drum.speed={distribution="uniform",low=1,high=2}']
    )
    assert changed.uncertain == {"drum.speed": Uniform(1.0, 2.0), "friction.static": Normal(0.6, 0.02)}
    assert load_scene(file, ["uncertain=none"]) == nominal


def test_a_deviation_in_per_cent_is_one_of_the_mean(nominal):
    """Of a plain number, too, where 10 % could be read as 0.1; and of one that is itself in per cent."""
    damped = nominal.with_values({"damping": {"ratio": 0.02}})
    table = {
        "friction.static": normal(mean=0.5, deviation="4 %"),
        "damping.ratio": normal(mean="2 %", deviation="10 percent", low="0.1 %"),
        "contact.stiffness": normal(mean="35 N/mm^3", deviation="10%", low=1.0),
        "start.displacement.Y": normal(mean="-1 mm", deviation="5 %"),
    }
    found = damped.with_values({"uncertain": table}).uncertain
    assert found is not None
    deviations = {key: each.deviation for key, each in found.items() if isinstance(each, Normal)}
    assert deviations == pytest.approx(
        {"friction.static": 0.02, "damping.ratio": 0.002, "contact.stiffness": 3.5e9, "start.displacement.Y": 5e-5},
        rel=1e-15,  # products of rounded numbers
    )
    assert isinstance(found["damping.ratio"], Normal)
    assert found["damping.ratio"].low == 0.001  # of a bound there is no mean


def test_each_shoe_has_the_uncertain_numbers_that_concern_it():
    """Quoted or not, those of both and its own, under the keys of its scene alone."""
    some = normal(mean=0.48, deviation=0.01)
    alike = {"drum.speed": normal(mean=5.5, deviation=0.1), "friction": {"static": some}}
    with_own = load_scene(TRUCK, ['shoe.1.friction={law="constant",coefficient=0.3}'])
    for quoted in (True, False):
        thickness, start = normal(mean=0.04, deviation=1e-4), {"distribution": "uniform", "low": 0.0, "high": 1e-6}
        own = (
            {"shoe.0.thickness": thickness, "start.displacement.leading.Y": start}
            if quoted
            else {"shoe": {"0": {"thickness": thickness}}, "start": {"displacement": {"leading": {"Y": start}}}}
        )
        leading, trailing = with_own.with_values({"uncertain": {**alike, **own}}).alone
        assert leading.uncertain is not None
        assert set(leading.uncertain) == {"drum.speed", "friction.static", "shoe.thickness", "start.displacement.Y"}
        assert set(trailing.uncertain or {}) == {"drum.speed"}  # its friction is its own


WRONG = [
    ({"friction.static": normal(mean=0.5, deviation="10 N")}, "a plain number is wanted"),
    ({"friction.static": normal(mean=0, deviation="10 %")}, "the deviation must be above 0"),
    ({"friction.statik": normal(mean=1, deviation=1)}, "did you mean friction.static?"),
    ({"drum.density": normal(mean=7000, deviation=10)}, "did you mean drum.elastic.density?"),
    ({"friction.static": normal(mean=0.5, devation=0.1)}, "did you mean deviation?"),
    ({"friction.static": normal(mean=0.5)}, "uncertain.friction.static.deviation: the key is missing"),
    ({"friction.static": {"mean": 0.5}}, "write distribution = "),
    ({"friction.static": {"distribution": "gauss"}}, '= "gauss": write "uniform" or "normal" or "lognormal"'),
    ({"friction.static": 0.5}, "this must be a distribution"),
    ({"drum.speed": normal(mean="5 Hz", deviation=1)}, "not a unit of angular speed"),
    ({"drum.speed": normal(mean=5, deviation=0)}, "the deviation must be above 0"),
    ({"drum.speed": {"distribution": "uniform", "low": 2, "high": 2}}, "high must be above low"),
    ({"drum.speed": normal(mean=5, deviation=1, low=30)}, "leave 0 of the distribution"),
    ({"drum.speed": {"distribution": "lognormal", "median": 5, "geometric_deviation": 0.9}}, "must be above 1"),
    ({"drum.speed": {"distribution": "lognormal", "median": 5, "geometric_deviation": 1e300}}, "beyond all numbers"),
    ({"friction.coefficient": normal(mean=0.5, deviation=0.01)}, "this scene has no such number"),
    ({"damping.ratio": normal(mean=0.5, deviation=0.01)}, "this scene has no such number"),
    ({"drum.speed": normal(mean=5, deviation=1), "drum": {"speed": normal(mean=5, deviation=1)}}, "there twice"),
    (3, "this must be a table"),
]


@pytest.mark.parametrize(("table", "said"), WRONG)
def test_a_wrong_table_is_refused_in_one_line(nominal, table, said):
    with pytest.raises(SceneError) as caught:
        nominal.with_values({"uncertain": table})
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "said"),
    [
        (
            "shoe.leading.thickness",
            "did you mean shoe.thickness, or of several shoes shoe.0.thickness, shoe.1.thickness and so on?",
        ),
        (
            "trailing.thickness",
            "did you mean shoe.thickness, or of several shoes shoe.0.thickness, shoe.1.thickness and so on?",
        ),
        (
            "shoe.leading.contact.stiffness",
            "did you mean of several shoes shoe.0.contact.stiffness, shoe.1.contact.stiffness and so on?",
        ),
        ("shoe.thickness", "this scene has 2 of shoe; write shoe.0 (leading) or shoe.1 (trailing)"),
        (
            "shoe.0.contact.stiffness",
            "this scene has no such number, or has a list there; remove it here, or give it one value",
        ),
        ("shoe.2.thickness", "this scene has 2 of shoe; write shoe.0 (leading) or shoe.1 (trailing)"),
    ],
)
def test_a_number_of_one_of_several_shoes_is_asked_for_by_the_key_that_is_taken(key, said):
    scene = load_scene("simplex")
    with pytest.raises(SceneError) as caught:
        scene.with_values({"uncertain": {key: normal(mean=0.006, deviation=1e-4)}})
    assert str(caught.value).endswith(said)
    found = scene.with_values({"uncertain": {"shoe.1.thickness": normal(mean=0.006, deviation=1e-4)}})
    assert list(found.uncertain or {}) == ["shoe.1.thickness"]


@pytest.mark.parametrize("key", ["shoe.leading.thickness", "leading.thickness", "shoe.thickness"])
def test_a_range_of_one_of_several_shoes_is_asked_for_by_its_number(key):
    with pytest.raises(SceneError, match=r"write shoe\.0 \(leading\) or shoe\.1 \(trailing\)$"):
        read_variation(f"{key}=0.005..0.007", load_scene("simplex"))


def test_a_distribution_that_reaches_an_invalid_value_is_refused_until_it_is_truncated(nominal):
    # 0.5 less 6.36 deviations is below 0; 0.5 less 6.36 times 0.07 is not.
    with pytest.raises(SceneError, match=r"samples reach -0\.13.*must not be below 0; truncate"):
        nominal.with_values({"uncertain": {"friction.static": normal(mean=0.5, deviation=0.1)}})
    nominal.with_values({"uncertain": {"friction.static": normal(mean=0.5, deviation=0.07)}})
    cut = nominal.with_values({"uncertain": {"friction.static": normal(mean=0.5, deviation=0.1, low=0)}})
    assert reach(cut.uncertain["friction.static"])[0] >= 0
    with pytest.raises(SceneError, match=r"samples reach 0\.2, and the thickness must be smaller than shoe"):
        nominal.with_values({"uncertain": {"shoe.thickness": {"distribution": "uniform", "low": 0.01, "high": 0.2}}})


NUMBER = st.floats(allow_nan=True, allow_infinity=True) | st.sampled_from(
    ["1 kN", "3 rpm", "x", "", True, None, [], {}]
)
WRITTEN = st.dictionaries(
    st.sampled_from(["distribution", "mean", "deviation", "low", "high", "median", "geometric_deviation", "odd"]),
    st.sampled_from(["normal", "uniform", "lognormal", "other"]) | NUMBER,
    max_size=6,
)


@settings(max_examples=300)
@given(st.dictionaries(st.sampled_from([*uncertain_units(), "friction", "odd", ""]), WRITTEN | NUMBER, max_size=3))
def test_whatever_is_written_is_read_or_refused_in_one_line(table):
    try:
        scene = NOMINAL.with_values({"uncertain": table})
    except SceneError as error:
        lines = str(error).count("\n") + 1
    else:
        lines = 1
        assert scene_from_dict(tomllib.loads(scene.to_toml())) == scene
    assert lines == 1


@settings(max_examples=200)
@given(
    mean=st.floats(-1e3, 1e3),
    deviation=st.floats(1e-3, 1e3),
    low=st.none() | st.floats(-2.0, 1.0),
    width=st.floats(0.01, 3.0),
    open_above=st.booleans(),
)
def test_no_draw_leaves_the_limits(mean, deviation, low, width, open_above):
    low = None if low is None else mean + low * deviation
    high = None if open_above else (mean if low is None else low) + width * deviation
    cut = Normal(mean, deviation, low, high)
    smallest, largest = reach(cut)
    assert low is None or smallest >= low
    assert high is None or largest <= high
    values = cut.quantile(FRACTIONS)
    assert np.all(np.diff(values) >= 0)
    assert smallest <= values[0] <= values[-1] <= largest


NOMINAL: Scene = load_scene(__file__.replace("tests/scene/test_uncertain.py", "scenarios/nominal.toml"))
