"""How growth rates go with a scene's numbers, and the smallest change that makes a brake stable."""

import json

import numpy as np
import pytest

from drumsqueal.comparison.departure import beyond_edges
from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import QUIET_SCENE, SENSITIVITY_FILES, SENSITIVITY_TABLE
from drumsqueal.linear.gradients import eigenvalue_gradient
from drumsqueal.linear.modes import analyse_stability
from drumsqueal.model import build_model
from drumsqueal.scene import load_scene
from drumsqueal.simulation import run
from drumsqueal.studies.decay import KICK, kicked, nonlinear_decay
from drumsqueal.studies.quieting import LEAST, MARGIN, largest_growth, quieten, variable_numbers
from drumsqueal.studies.sensitivity import SensitivityStudy, at_one_time, study_sensitivity

PLANE = {"simulate.coordinates": ["X", "Y", "Tz"], "simulate.duration": 0.05}  # compiles in a tenth of the time


@pytest.fixture(scope="module")
def damped(nominal):
    """The plane's brake with damping, a force that does nothing to growth, and all numbers that a scene can have."""
    more = {"damping": {"ratio": 0.004}, "forcing": {"amplitude": {"Y": 1.0}, "frequency": 100.0}}
    return nominal.with_values(PLANE | more)


@pytest.fixture(scope="module")
def study(damped) -> SensitivityStudy:
    return study_sensitivity(damped)


@pytest.fixture(scope="module")
def undamped(nominal) -> SensitivityStudy:
    return study_sensitivity(nominal.with_values(PLANE))


def growth(study: SensitivityStudy, key: str) -> np.ndarray:
    (row,) = (row for row in study.rows if row.key == key)
    return row.growth_per_percent


def test_every_number_of_the_scene_has_a_row(damped, study):
    assert {row.key for row in study.rows} == set(damped.numbers())


def test_derivatives_agree_with_central_differences(study, undamped):
    # The differences of ±0.1 % are off by their second order, some millionths.
    for each in (study, undamped):
        assert each.deviation < 1e-5


def test_derivatives_agree_with_whole_analyses_on_both_sides(damped, study):
    # Not through the study's own program: each side is a scene of its own.
    step = 1e-4
    for key in ("friction.static", "shoe.arc_angle", "damping.ratio", "contact.stiffness"):
        value = damped.numbers()[key]
        sides = [
            analyse_stability(build_model(damped.with_values({key: value * (1 + sign * step)}))).modes
            for sign in (1, -1)
        ]
        rates = [np.array([mode.growth_rate for mode in modes]) for modes in sides]
        by_difference = (rates[0] - rates[1]) / (2 * step) / 100
        # Second order of 1e-4, and round-off of the eigenvalues over the step.
        assert growth(study, key) == pytest.approx(by_difference, abs=1e-6 * np.abs(by_difference).max())


def test_the_load_s_derivative_is_the_growth_rate_itself(undamped):
    # Equation (29): without structural damping C is proportional to p0 and K does not hold it, so that to first order
    # in C every real part is proportional to the load. What is left is of third order, (C/ω)³: below 1e-4 here.
    rates = np.array([mode.growth_rate for mode in undamped.modes])
    assert growth(undamped, "contact.normal_load") == pytest.approx(rates / 100, rel=1e-4)


def test_density_scales_growth_and_frequency_in_closed_form(undamped):
    # In M q̈ + C q̇ + K q a factor a of M divides first-order growth by a and frequencies by √a.
    rates = np.array([mode.growth_rate for mode in undamped.modes])
    assert growth(undamped, "shoe.density") == pytest.approx(-rates / 100, rel=1e-4)
    (row,) = (row for row in undamped.rows if row.key == "shoe.density")
    frequencies = np.array([mode.frequency_Hz for mode in undamped.modes])
    assert row.frequency_per_percent_Hz == pytest.approx(-frequencies / 200, rel=1e-4)


def test_numbers_without_effect_have_none(study, undamped):
    for key in ("forcing.frequency", "forcing.amplitude.Y", "forcing.phase"):
        assert np.abs(growth(study, key)).max() <= study.round_off
    # Both springs act in the sum of them alone.
    upper, lower = growth(undamped, "support.upper_stiffness"), growth(undamped, "support.lower_stiffness")
    assert lower == pytest.approx(6 * upper, rel=1e-9)


def test_rows_are_sorted_by_what_they_do_to_unstable_modes(study):
    told = list(study.told)
    assert [study.modes[k].unstable for k in told] == [True] * len(told)
    sizes = [np.abs(row.growth_per_percent[told]).max() for row in study.rows]
    assert sizes == sorted(sizes, reverse=True)


def test_near_equal_eigenvalues_keep_their_own_derivatives():
    # A = diag(p, 1 + 1e-9, −p): the derivatives are 1, 0 and −1, however near the first two are.
    matrix, change = np.diag([1.0, 1 + 1e-9, -1.0]), np.diag([1.0, 0.0, -1.0])
    values, right = np.linalg.eig(matrix)
    left = np.linalg.inv(right).conj().T
    found = [eigenvalue_gradient(left[:, k], right[:, k], change[None])[0] for k in np.argsort(values)]
    assert found == [-1, 1, 0]


def test_a_profile_counts_as_its_first_value(nominal):
    profile = {"drum.speed": {"time": [0, 1], "value": [5, 1]}}
    assert at_one_time(nominal.with_values(profile), 0.0) == nominal


def test_one_number_is_changed_just_as_far_as_its_closed_form(nominal):
    # Without damping real parts are those of C = −μt p0 ∫φ^θφ^θ: they vanish with μs − μk, and are −1 1/s a little
    # beyond. Each is, to first order in C, in proportion to μs − μk, from +34.2 of X for 0.2: −1 at −0.2/34.19.
    quiet = quieten(nominal.with_values(PLANE), ["friction.static"])
    (change,) = quiet.changes
    assert quiet.found
    assert quiet.largest_growth == pytest.approx(-MARGIN, rel=1e-3)
    assert change.after == pytest.approx(0.3 - 0.2 / 34.19, rel=1e-3)


def test_the_smallest_change_is_smaller_than_along_any_single_number_or_the_gradient(damped, study):
    keys = ["friction.static", "friction.kinetic", "damping.ratio"]
    together = quieten(study.scene, keys, state_matrix=study.state_matrix)
    assert together.found
    for key in keys:
        alone = quieten(study.scene, [key], state_matrix=study.state_matrix)
        assert not alone.found or together.norm < alone.norm
    again = analyse_stability(build_model(together.scene))
    assert largest_growth(again.eigenvalues) <= -MARGIN * (1 - 2e-3)


def test_a_search_that_cannot_succeed_says_how_far_it_came(nominal):
    scene = nominal.with_values(PLANE)
    failed = quieten(scene, ["shoe.density"])  # heavier grows more slowly, but ever grows
    assert not failed.found
    assert failed.largest_growth > 0
    assert failed.changes[0].after / failed.changes[0].before >= LEAST


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        (["friction.statik"], "no number of this scene"),
        (["friction.static", "friction.static"], "named twice"),
        (["forcing.frequency"], "does not act"),
        (["friction.decay"], "it is 0"),
        (["drum.speed"], "changes over time"),
    ],
)
def test_what_cannot_be_varied_is_refused(damped, keys, told):
    scene = damped.with_values({"friction.decay": 0.0, "drum.speed": {"time": [0, 1], "value": [5, 4]}})
    with pytest.raises(RequestError, match=told):
        variable_numbers(scene, keys)


def test_damping_may_be_added_and_by_default_the_design_changes(nominal):
    scene, keys = variable_numbers(nominal, ["damping.ratio"])
    assert scene.damping is not None
    assert keys == ("damping.ratio",)
    _, keys = variable_numbers(nominal)
    assert "friction.static" in keys
    assert not {"drum.speed", "contact.normal_load", "shoe.outer_radius"} & set(keys)


def test_a_kick_starts_beyond_the_edges_and_constant_friction_is_told_apart(nominal):
    scene = nominal.with_values({"damping": {"ratio": 0.02}, "simulate.duration": 0.05})
    start = kicked(scene)
    lost = 2000 / (0.1 * scene.shoe.arc_angle * 0.0365) / 0.35e11
    assert start.start.displacement["Y"] == pytest.approx(KICK * lost)
    result = run(start)
    assert beyond_edges(result.history, result.stability, build_model(start)).any()
    own, kick = nonlinear_decay(scene)
    assert own.decays is True
    assert kick.motion_ratio is not None
    growing, _ = nonlinear_decay(nominal.with_values({"simulate.duration": 0.05}))
    assert growing.decays is not True


def test_the_command_writes_a_quiet_scene_that_is_one(drumsqueal, tmp_path):
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    nominal = load_scene("scenarios/nominal.toml", ['simulate.coordinates=["X", "Y", "Tz"]', "simulate.duration=0.05"])
    scene.write_text(nominal.to_toml(), encoding="utf-8")
    arguments = ("sensitivity", str(scene), "-o", str(out), "--until", "stable", "--vary", "friction.static")
    status, printed, error = drumsqueal(*arguments)
    assert (status, error) == (0, "")
    assert {path.name for path in out.iterdir()} == set(SENSITIVITY_FILES)
    assert "every growth rate is -1 1/s or below" in " ".join(printed.split())
    quiet = load_scene(out / QUIET_SCENE)
    assert not analyse_stability(build_model(quiet)).unstable
    found = json.loads((out / "sensitivity.json").read_text())
    assert found["quiet"]["transients"][0]["start"] == "its own start"
    status, printed, _ = drumsqueal(
        "sensitivity", str(out / QUIET_SCENE), "-o", str(tmp_path / "b"), "--until", "stable"
    )
    assert status == 0
    assert "Nothing in this scene is unstable" in printed
    assert not (tmp_path / "b" / QUIET_SCENE).exists()
    arguments = ("sensitivity", str(scene), "-o", str(tmp_path / "c"), "--until", "stable", "--vary", "shoe.density")
    status, _, error = drumsqueal(*arguments)
    assert status == 1
    assert "no change of shoe.density" in error
    assert (tmp_path / "c" / SENSITIVITY_TABLE).exists()


@pytest.mark.parametrize(
    "wrong",
    [
        ("--until", "quiet"),
        ("--vary", "friction.static"),
        ("--until", "stable", "--vary", "friction.statik"),
        ("--until", "stable", "--vary", ""),
    ],
)
def test_wrong_requests_write_nothing(drumsqueal, tmp_path, wrong):
    status, printed, error = drumsqueal("sensitivity", "scenarios/nominal.toml", "-o", str(tmp_path / "out"), *wrong)
    assert (status, printed) == (2, "")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
