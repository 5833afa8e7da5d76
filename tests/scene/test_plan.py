"""Which points a sweep has: their order, what is drawn for a seed, and how much of them is too much."""

from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import RequestError
from drumsqueal.scene.plan import draw, grid, sample
from drumsqueal.scene.uncertain import Normal, Uniform
from drumsqueal.scene.variation import Variation, read_variation


def speeds(values: Any) -> Variation:
    return Variation("drum.speed", "rad/s", values)


def test_points_of_a_grid_run_fastest_along_the_last_number(nominal):
    load = read_variation("contact.normal_load=1 kN..3 kNx3", nominal, option="--vary")
    plan = grid(nominal, [speeds((2.0, 5.0)), load])
    assert (plan.keys, plan.dimensions, plan.shape, plan.points) == (("drum.speed", load.key),) * 2 + ((2, 3), 6)
    wanted = [[speed, force] for speed in (2.0, 5.0) for force in (1e3, 2e3, 3e3)]
    np.testing.assert_array_equal(plan.values(0, 6), wanted)
    np.testing.assert_array_equal(plan.values(2, 5), wanted[2:5])
    assert plan.ends == {"drum.speed": (2.0, 5.0), load.key: (1e3, 3e3)}
    assert (plan.unit(load.key), plan.unit("drum.speed")) == ("kN", "rad/s")
    assert (plan.listed(load.key, 2e3), plan.listed("friction.static", 0.4)) == (2.0, 0.4)
    assert plan.unit("friction.static") == "1"
    there = plan.scene_at(wanted[4]).numbers()
    assert (there["drum.speed"], there[load.key]) == (5.0, 2e3)
    assert plan.describe() == {"transient": False, "vary": {"drum.speed": [2.0, 5.0, 2], load.key: [1e3, 3e3, 3]}}


def test_a_sample_is_the_quantile_at_a_place_that_its_seed_and_number_decide():
    distributions = [Uniform(2.0, 5.0), Normal(3.0, 0.5), Uniform(-1.0, 1.0)]
    raw = np.random.PCG64(42).random_raw(30).reshape(10, 3)
    fractions = ((raw >> np.uint64(32)).astype(float) + 0.5) / 2**32
    wanted = np.stack([each.quantile(fractions[:, k]) for k, each in enumerate(distributions)], axis=1)
    np.testing.assert_array_equal(draw(distributions, 42, 0, 10), wanted)
    np.testing.assert_array_equal(draw(distributions, 42, 4, 7), wanted[4:7])
    assert not np.any(draw(distributions, 43, 0, 10) == wanted)


def test_ranges_go_before_what_is_uncertain_and_starts_count_for_transients_alone(nominal):
    table = {
        "drum.speed": {"distribution": "normal", "mean": 5.0, "deviation": 0.1},
        "friction.static": {"distribution": "uniform", "low": 0.4, "high": 0.5},
        "start.velocity.Y": {"distribution": "uniform", "low": 0.0, "high": 1e-3},
    }
    scene = nominal.with_values({"uncertain": table})
    plan = sample(scene, [speeds((7.0, 3.0))], 5, seed=3)
    assert dict(plan.distributions) == {"drum.speed": Uniform(3.0, 7.0), "friction.static": Uniform(0.4, 0.5)}
    assert (plan.dimensions, plan.shape, plan.points, plan.starts) == (("sample",), (5,), 5, ())
    assert plan.scene == nominal
    assert plan.describe()["distributions"]["drum.speed"] == {
        "distribution": "uniform", "low": 3.0, "high": 7.0, "unit": "rad/s"
    }  # fmt: skip
    np.testing.assert_array_equal(plan.values(1, 3), draw([Uniform(3.0, 7.0), Uniform(0.4, 0.5)], 3, 1, 3))
    moving = sample(scene, [], 5, transient=True)
    assert moving.starts == ("start.velocity.Y",)
    assert set(moving.keys) == set(table)


@pytest.mark.parametrize(
    ("counts", "transient", "said"),
    [
        ((11, 10**6), False, "1.1e+07 points would need a file of about 1.76 GB and about 1.1 hours of computing; "),
        ((11, 10**6), True, "about 2.64 GB and about 1.1 hours of computing, transients aside; take at most 1e7 "),
        ((10**7, 625), False, "6.25e+09 points would need a file of about 1 TB and about 625 hours of"),
        ((10**7, 62), False, "a file of about 99.2 GB"),
        ((10**7, 10**7), False, "a file of about 16 PB and about 1.14e+03 years"),
    ],
)  # fmt: skip
def test_more_points_than_can_be_had_are_refused_with_what_they_would_need(nominal, counts, transient, said):
    varied = [speeds(range(counts[0])), speeds(range(counts[1]))._replace(key="friction.static")]
    with pytest.raises(RequestError) as caught:
        grid(nominal, varied, transient=transient)
    assert said in str(caught.value)


def test_ten_million_points_are_not_too_many(nominal):
    varied = [
        speeds(np.linspace(1.0, 2.0, 10**4)),
        speeds(np.linspace(0.1, 0.2, 10**3))._replace(key="friction.static"),
    ]
    assert grid(nominal, varied).points == 10**7


def test_a_corner_that_no_scene_takes_is_named_in_the_units_that_were_given(nominal):
    thick = read_variation("shoe.thickness=10 mm..80 mmx2", nominal, option="--vary")
    with pytest.raises(RequestError) as caught:
        grid(nominal, [thick, Variation("shoe.outer_radius", "m", (0.05, 0.1))])
    told = "the sweep comes to shoe.thickness = 80 mm, shoe.outer_radius = 0.05 m: shoe.thickness = 0.08: the thickness"
    assert told in str(caught.value)
    # What is not in one table is not asked for together.
    grid(nominal, [thick, speeds((2.0, 3.0))])
