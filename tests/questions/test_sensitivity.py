"""How growth rates go with a scene's numbers, and the smallest change that makes a brake stable."""

import csv
import json
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from along_y import OPTIONS, AlongY, brake_along_y
from drumsqueal.coordinates import largest_of
from drumsqueal.dynamics.attractor import Response, SteadyResponse, VelocityPerturbation
from drumsqueal.dynamics.ensemble import Start
from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import FILES, to_json
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.schema import read_findings
from drumsqueal.findings.vibration import beyond_boundaries
from drumsqueal.physics.model import build_model
from drumsqueal.progress import silent
from drumsqueal.questions.sensitivity import answer, disturbing
from drumsqueal.questions.sensitivity.answer import (
    as_it_is,
    draw_quiet,
    modes_that_matter,
    not_found,
    sensitivity_answer,
    squeal_words,
    without_answer,
)
from drumsqueal.questions.sensitivity.disturbing import (
    DISTURBANCE,
    RANDOM,
    BrakeVariant,
    DisturbedSqueal,
    Disturber,
    Origin,
    Trial,
    disturbed,
    nonlinear_decay,
    squealing,
)
from drumsqueal.questions.sensitivity.quieting import (
    FURTHER,
    PRECISION,
    Alone,
    LineSearch,
    Quietening,
    Quieting,
    search,
)
from drumsqueal.questions.sensitivity.stabilising import (
    LEAST,
    MARGIN,
    Caution,
    Change,
    Problem,
    cautions,
    numbers_of,
    rounded,
    size_of,
    variable_numbers,
)
from drumsqueal.questions.sensitivity.study import (
    SensitivityStudy,
    at_one_time,
    check_request,
    operating,
    study_sensitivity,
    where,
    where_else,
)
from drumsqueal.scene import COORDINATES, load_scene
from drumsqueal.scene.file import replace_value
from drumsqueal.scene.variation import Written, read_variation
from drumsqueal.simulation import run
from drumsqueal.solve.linear.family import eigenvalue_gradient, state_matrix_of
from drumsqueal.solve.linear.modes import DRIFT_FRACTION, analyse_stability

NOMINAL = Path(__file__).parents[2] / "scenarios" / "nominal.toml"
BRIEF = {"simulate.duration": 0.05}
# Next to none, 1e-7 of what friction gives: the programs are those of a damped brake, which other tests use.
SCARCELY = 1e-9
SQUEALING = ("X", "Y", "Tz")


@pytest.fixture(scope="module")
def damped(nominal):
    """The brake with damping: Y and Tz remain unstable."""
    return nominal.with_values(BRIEF | {"damping": {"ratio": 0.001}})


@pytest.fixture(scope="module")
def study(damped) -> SensitivityStudy:
    return study_sensitivity(damped)


@pytest.fixture(scope="module")
def undamped(nominal) -> SensitivityStudy:
    return study_sensitivity(nominal.with_values(BRIEF | {"damping": {"ratio": SCARCELY}}))


def growth(study: SensitivityStudy, key: str) -> np.ndarray:
    (row,) = (row for row in study.numbers if row.key == key)
    return np.array(row.growth_per_percent_1_per_s)


def of_squealing(study: SensitivityStudy, values) -> np.ndarray:
    """The entries of the modes in the plane, which are lightly damped."""
    return np.array([value for mode, value in zip(study.modes, values, strict=True) if mode.name in SQUEALING])


@pytest.mark.thorough
def test_every_number_of_the_scene_has_a_row(damped, study):
    assert {row.key for row in study.numbers} == set(damped.numbers())


def test_derivatives_agree_with_central_differences(study, undamped):
    # The differences of ±0.1 % are off by their second order, some millionths.
    for each in (study, undamped):
        assert each.largest_deviation_from_central_differences < 1e-5


def test_derivatives_agree_with_whole_analyses_on_both_sides(damped, study):
    # Not through the study's own program: each side is a scene of its own.
    step = 1e-4
    for key in ("friction.static", "shoe.arc_angle", "damping.ratio", "contact.stiffness"):
        value = damped.numbers()[key]
        sides = [
            analyse_stability(
                build_model(damped.with_values({key: value * (1 + sign * step)}), coordinates=COORDINATES)
            ).modes
            for sign in (1, -1)
        ]
        rates = [np.array([mode.growth_rate for mode in modes]) for modes in sides]
        by_difference = (rates[0] - rates[1]) / (2 * step) / 100
        # Second order of 1e-4, and round-off of the eigenvalues over the step.
        assert growth(study, key) == pytest.approx(by_difference, abs=1e-6 * np.abs(by_difference).max())


def test_the_load_s_derivative_is_the_growth_rate_itself(undamped):
    # Equation (29): without structural damping C is proportional to p0 and K does not hold it, so that to first order
    # in C every real part is proportional to the load. What is left is of third order, (C/ω)³: below 1e-4 here.
    rates = of_squealing(undamped, [mode.growth_rate_1_per_s for mode in undamped.modes])
    found = of_squealing(undamped, growth(undamped, "contact.normal_load"))
    assert found == pytest.approx(rates / 100, rel=1e-4)


def test_density_scales_growth_in_closed_form(undamped):
    # In M q̈ + C q̇ + K q a factor a of M divides first-order growth by a.
    rates = of_squealing(undamped, [mode.growth_rate_1_per_s for mode in undamped.modes])
    (row,) = (row for row in undamped.numbers if row.key == "shoe.density")
    assert of_squealing(undamped, row.growth_per_percent_1_per_s) == pytest.approx(-rates / 100, rel=1e-4)


def test_density_scales_frequencies_in_closed_form(undamped):
    # As 1/√ρ to first order: −0.5 % for +1 %, and the derivative is that over 1 % of the density.
    frequencies = of_squealing(undamped, [mode.frequency_Hz for mode in undamped.modes])
    (row,) = (row for row in undamped.numbers if row.key == "shoe.density")
    assert of_squealing(undamped, row.frequency_per_percent_Hz) == pytest.approx(-0.005 * frequencies, rel=1e-4)
    found = of_squealing(undamped, row.frequency_Hz_per_SI)
    assert found == pytest.approx(-frequencies / (2 * row.value_SI), rel=1e-4)
    rates = of_squealing(undamped, [mode.growth_rate_1_per_s for mode in undamped.modes])
    assert of_squealing(undamped, row.growth_per_SI) == pytest.approx(-rates / row.value_SI, rel=1e-4)


@pytest.mark.parametrize(
    ("ratio", "beyond", "kind", "outcome"),
    [
        (0.3, [True] * 90 + [False] * 10, None, Kind.DECAYS),  # beyond the boundaries at first only
        (
            0.9,
            [False] * 99 + [True],
            Kind.PERIODIC,
            Kind.SQUEALS,
        ),  # smaller than it began, and lifting off still
        (0.9, [True] * 100, Kind.UNDECIDED, Kind.UNDECIDED),
        (1.1, [False] * 100, Kind.QUASI_PERIODIC, Kind.SQUEALS),  # sustained within the boundaries
        (1.1, [False] * 100, Kind.STEADY, Kind.UNDECIDED),
        (None, [False] * 100, None, Kind.NOT_STARTED),
    ],
)
def test_a_transient_decays_where_it_is_smaller_and_within_the_boundaries_at_last(
    monkeypatch, ratio, beyond, kind, outcome
):
    saturation = None
    if kind is not None:
        saturation = SimpleNamespace(regime=SimpleNamespace(kind=kind), main=SimpleNamespace(frequency_Hz=950.0))
    findings = SimpleNamespace(motion_ratio=ratio, saturation=saturation)
    result = SimpleNamespace(findings=findings, history=None, stability=SimpleNamespace(contact_fractions=()))
    patches = {
        "prepare": lambda _: SimpleNamespace(linear=None),
        "run_whole": lambda *_: result,
        "Vibration": lambda *_: SimpleNamespace(time=np.linspace(0, 0.2, 100)),
        "beyond_boundaries": lambda *_: np.array(beyond),
    }
    for name, patch in patches.items():
        monkeypatch.setattr(disturbing, name, patch)
    found = nonlinear_decay(cast("Any", None))
    assert (found.outcome, found.motion_ratio) == (outcome, ratio)
    assert found.frequency_Hz == (950.0 if outcome is Kind.SQUEALS else None)
    assert found.duration_s == (None if ratio is None else 0.2)


@pytest.mark.thorough
def test_numbers_without_effect_have_none(nominal, undamped):
    forced = nominal.with_values({"forcing": {"amplitude": {"Y": 1.0}, "frequency": 100.0}})
    keys = tuple(forced.numbers())
    _, derivatives = state_matrix_of(forced, keys)(np.array(list(forced.numbers().values())))
    without = [k for k, key in enumerate(keys) if key.startswith("forcing.")]
    assert len(without) == 3
    assert not derivatives[without].any()
    # No spring acts on the modes out of the plane; on the others both act in the sum of them alone.
    upper, lower = growth(undamped, "support.upper_stiffness"), growth(undamped, "support.lower_stiffness")
    for mode, first, second in zip(undamped.modes, upper, lower, strict=True):
        if mode.name in SQUEALING:
            assert second == pytest.approx(6 * first, rel=1e-9)
        else:
            assert max(abs(first), abs(second)) <= undamped.round_off_1_per_s


@pytest.mark.thorough
def test_the_points_of_a_measured_curve_are_reported_as_not_covered(nominal):
    curve = {"law": "table", "speed": [0.0, 0.5, 2.0], "coefficient": [0.5, 0.42, 0.35]}
    study = study_sensitivity(nominal.with_values(BRIEF | {"friction": curve}))
    assert study.not_covered == ("friction.speed", "friction.coefficient")
    assert {row.key for row in study.numbers} == set(study.scene.numbers()) - set(study.not_covered)


def test_rows_are_sorted_by_what_they_do_to_unstable_modes(study):
    relevant = list(study.relevant)
    assert [study.modes[k].unstable for k in relevant] == [True] * len(relevant)
    sizes = [max(abs(row.growth_per_percent_1_per_s[k]) for k in relevant) for row in study.numbers]
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


def problem_of(scene, keys, state_matrix=None) -> Problem:
    evaluate = state_matrix or state_matrix_of(scene, tuple(numbers_of(scene)))
    return Problem(Written(scene), tuple(keys), evaluate, silent)


@pytest.mark.thorough
def test_one_number_is_changed_just_as_far_as_its_closed_form(nominal):
    # Without damping real parts are those of C = −μt p0 ∫φ^θφ^θ: they vanish with μs − μk, and are −1 1/s a little
    # beyond. Each is, to first order in C, in proportion to μs − μk, from +34.2 of X for 0.2: −1 at −0.2/34.19.
    problem = problem_of(nominal.with_values(BRIEF), ["friction.static"])
    x = problem.smallest_change(MARGIN)
    assert problem.largest(x) == pytest.approx(-MARGIN, rel=1e-3)
    assert problem.after(x) == pytest.approx(0.3 - 0.2 / 34.19, rel=1e-3)


@pytest.mark.thorough
def test_the_smallest_change_is_smaller_than_along_any_single_number_or_the_gradient(damped, study):
    keys = ["friction.static", "friction.kinetic", "damping.ratio"]
    problem = problem_of(study.scene, keys, study.state_matrix)
    together = problem.smallest_change(MARGIN)
    assert problem.decays(together, MARGIN)
    for key in keys:
        one = problem_of(study.scene, [key], study.state_matrix)
        alone = one.smallest_change(MARGIN)
        assert not one.decays(alone, MARGIN) or np.linalg.norm(together) < np.linalg.norm(alone)
    after = dict(zip(keys, problem.after(together).tolist(), strict=True))
    again = analyse_stability(build_model(study.scene.with_values(after), coordinates=COORDINATES))
    held = np.abs(again.eigenvalues) > DRIFT_FRACTION * np.abs(again.eigenvalues).max()
    assert again.eigenvalues[held].real.max() <= -MARGIN * (1 - 2e-3)


# --- quiet, not only stable -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bistable(nominal):
    """A brake whose modes all decay, and that squeals for ever once it is disturbed."""
    return nominal.with_values({"damping": {"ratio": 0.005}, "drum.speed": 20.0, "simulate.duration": 0.1})


@pytest.fixture(scope="module")
def bistable_study(bistable) -> SensitivityStudy:
    return study_sensitivity(bistable, until_stable=True, keys=["damping.ratio"])


@pytest.mark.slow  # some 80 s, of transients
def test_a_stable_brake_that_squeals_when_disturbed_is_not_called_quiet(bistable, bistable_study):
    squeal = bistable_study.squeal
    assert bistable_study.stable
    assert squeal is not None
    assert squeal.steady_sliding_stable
    # As `onset --smallest-disturbance` finds it: 0.609 ± 0.006 J along Y lead to 946 Hz; sizes double here.
    assert squeal.smallest_disturbance.energy_J / 4 < 0.609 < squeal.smallest_disturbance.energy_J
    assert squeal.largest_that_decays.energy_J < 0.609
    assert squeal.smallest_disturbance.motion.frequency_Hz == pytest.approx(946, abs=1)
    assert "squeals after a large disturbance" in squeal_words(squeal, bistable)


@pytest.mark.slow  # some 80 s, of transients
def test_its_change_makes_it_quiet_and_hardly_less_does_not(bistable, bistable_study):
    quiet, squeal = bistable_study.quiet, bistable_study.squeal
    assert quiet.quiet
    assert quiet.succeeded
    (row,) = bistable_study.alone
    assert row.quiet.after == pytest.approx(quiet.changes[0].after, rel=PRECISION)  # each search knows it so well
    # The squeal itself, followed from below by no code of the search: it goes on with less damping, and not with this.
    names = ("X", "Y", "Tz")
    state = squeal.motions[0].state
    for factor, decays in ((1.0, True), (1 - 4 * PRECISION, False)):
        after = 0.005 + factor * (quiet.changes[0].after - 0.005)
        start = {
            name: dict(zip(names, part.tolist(), strict=True))
            for name, part in zip(("displacement", "velocity"), state, strict=True)
        }
        scene = bistable.with_values({"damping.ratio": after, "start": start, "simulate.duration": 0.4})
        energy = run(scene).history["kinetic_energy"]
        assert (float(energy.sel(time=slice(0.35, None)).max()) < 1e-6 * float(energy.max())) is decays


@pytest.mark.slow  # some 80 s, of transients
def test_no_small_change_and_few_digits_are_left_in_the_answer(bistable):
    search_ = Quietening(bistable, ["friction.static", "shoe.width"])
    squeal = search_.squeal()
    assert squeal is not None
    alone = search_.alone(squeal.squealing)
    assert [each.key for each in alone] == ["friction.static", "shoe.width"]  # the least change first
    assert alone[0].quiet is not None
    assert alone[0].quiet.after == float(f"{alone[0].quiet.after:.3g}")


def test_the_scene_that_is_written_has_the_numbers_that_were_proven(damped):
    """Two digits of 54.9 MN/m are 54 MN/m: rounded a second time it would be another brake."""
    search_ = Quietening(damped, ["support.lower_stiffness", "friction.static"])
    numbers = {"support.lower_stiffness": 5.49e7, "friction.static": 0.3457}
    quiet = search_._quieting(numbers, None)  # pyright: ignore[reportPrivateUsage]
    assert {each.key: each.after for each in quiet.changes} == numbers
    for each in quiet.changes:
        assert quiet.scene.numbers()[each.key] == each.after


def test_the_one_way_in_which_the_numbers_of_a_stable_brake_change_is_told():
    alone = (Alone(key="shoe.width", lowest=0.01, highest=1.0),)
    assert "way in which the least stable mode decays faster: shoe.width" in without_answer(alone, stable_now=True)[0]
    assert "way in which" not in without_answer(alone, stable_now=False)[0]


@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_rounding_stays_within_the_bounds(nominal, unit):
    """Two digits of a whole turn, 6.3 rad, are no shoe."""
    written = Written(nominal, replace_value(nominal.model_dump(exclude_none=True), "shoe.arc_angle", f"2.27 {unit}"))
    before, most = nominal.shoe.arc_angle, 2 * np.pi
    after = rounded(written, "shoe.arc_angle", most, before, (0.227, most))
    assert most - 1e-5 < after <= most
    nominal.with_values({"shoe.arc_angle": after})


def test_a_position_at_which_there_is_no_brake_is_not_tried():
    """Up to 2.2 there is one, and from 1.9 on it is quiet: further out than 2 only the one at 2.2 is tried."""

    class Judge:
        def judge(self, brakes, what):
            return [Judged(quiet=brake.numbers["x"] >= 1.9) for brake in brakes]

    class Judged:
        squealing = ()

        def __init__(self, quiet):
            self.quiet = quiet

    line = LineSearch(lambda x: {"x": x} if x <= 2.2 else None, [1.0, 2.0, 4.0], 0.0)
    search([line], cast("Any", Judge()), silent, "")
    assert line.quiet_at is not None
    assert 1.9 <= line.quiet_at <= 1.9 * (1 + PRECISION)
    nowhere = LineSearch(lambda _: None, [1.0, 2.0], 0.0)
    search([nowhere], cast("Any", Judge()), silent, "")
    assert nowhere.quiet_at is None


@pytest.mark.parametrize("ending", [Kind.RUNS_AWAY, Kind.FAILED, Kind.UNDECIDED])
def test_a_brake_that_was_not_seen_to_decay_is_not_called_quiet(study, ending):
    trials = tuple(Trial.model_construct(leads_to=each, motion=None) for each in (Kind.DECAYS, ending))
    squeal = DisturbedSqueal.model_construct(steady_sliding_stable=True, quiet=False, motions=(), disturbances=trials)
    stable = study.model_copy(update={"modes": (), "divergence_rate_1_per_s": None, "squeal": squeal})
    assert not stable.needs_no_change
    words = as_it_is(stable)
    assert words is not None
    assert "nothing to make quiet" not in words
    assert f"1 of the 2 tried do not decay either ({ending})" in words


@pytest.mark.thorough
def test_a_brake_without_load_at_the_time_that_counts_is_refused(nominal):
    rising = nominal.with_values(BRIEF | {"contact.normal_load": {"time": [0.0, 0.1], "value": [0.0, 2000.0]}})
    with pytest.raises(RequestError, match="normal_load is 0 N at t = 0 s"):
        check_request(rising, None, until_stable=True)
    with pytest.raises(RequestError, match="normal_load is 0 N at t = 0 s"):
        study_sensitivity(rising, until_stable=True)


def test_quiet_between_two_that_squeal_is_passed_over():
    class Judge:
        """Quiet from 0.5 to 0.52, and from 1.3 on."""

        def judge(self, brakes, what):
            self.tried = [brake.numbers["x"] for brake in brakes]
            return [Judged(quiet=0.5 <= x <= 0.52 or x >= 1.3) for x in self.tried]

    class Judged:
        squealing = ()

        def __init__(self, quiet):
            self.quiet = quiet

    line = LineSearch(lambda x: {"x": x}, [0.51, 1.0, 2.0, 4.0], 0.0)
    search([line], cast("Any", Judge()), silent, "")
    assert line.quiet_at is not None
    assert 1.3 <= line.quiet_at <= 1.3 * (1 + PRECISION)
    window = LineSearch(lambda x: {"x": x}, [0.51, 1.0], 0.0)
    search([window], cast("Any", Judge()), silent, "")
    assert window.quiet_at is None
    assert min(FURTHER) * 0.51 > 0.52  # what shows that it is a window


@pytest.mark.thorough
def test_a_brake_is_disturbed_in_every_way_before_it_counts_as_quiet(bistable):
    disturber = Disturber(bistable)
    loud, quiet = disturber.judge([BrakeVariant({}), BrakeVariant({"damping.ratio": 0.02})], "")
    assert not loud.quiet
    assert quiet.quiet
    assert {each.leads_to for each in quiet.disturbances} == {Kind.DECAYS}
    disturbances = [each.disturbance for each in quiet.disturbances if each.disturbance is not None]
    backwards, forwards = (
        {(each.mode, each.energy_J) for each in disturbances if each.forwards is way} for way in (False, True)
    )
    assert backwards == forwards
    assert len(disturbances) == 2 * len(forwards)  # each once
    assert {mode for mode, _ in forwards} == {"Y", "X", "Tz"}
    number = Counter(each.kind for each in quiet.disturbances)
    assert number == {Origin.OWN: 1, Origin.DISPLACEMENT: 1, Origin.MODE: len(disturbances), Origin.RANDOM: RANDOM}


@pytest.mark.thorough
def test_the_smallest_disturbance_is_told_with_the_largest_that_decays_in_the_same_mode_and_way(bistable):
    def trial(energy_J: float, leads_to: Kind, *, forwards: bool = True, mode: str | None = "Y") -> Trial:
        moving = {"velocity": {"Y": 1.0}, "speed_m_per_s": 1.0, "energy_J": energy_J}
        disturbance = mode and VelocityPerturbation(mode=mode, forwards=forwards, boundary_ratio=1.0, **moving)
        kind, start = (Origin.MODE if disturbance else Origin.OWN), f"{mode} {forwards} {energy_J}"
        motion = SteadyResponse.model_construct(
            start=start, frequency_Hz=900.0, line_of=None, kinetic_energy_J=1.0, amplitude={}, rms={}
        )
        squeals = leads_to is Kind.SQUEALS
        return Trial.model_construct(
            start=start,
            kind=kind,
            disturbance=disturbance or None,
            leads_to=leads_to,
            motion=motion if squeals else None,
            **moving,
        )

    largest = trial(1.0, Kind.DECAYS)
    trials = (
        trial(0.5, Kind.SQUEALS, mode=None),  # its own start, a velocity of less energy, is along no mode
        trial(0.5, Kind.DECAYS),
        largest,
        trial(1.5, Kind.RUNS_AWAY),
        trial(1.8, Kind.DECAYS, forwards=False),
        trial(1.9, Kind.DECAYS, mode="X"),
        trial(2.0, Kind.SQUEALS),
        trial(4.0, Kind.DECAYS),
    )
    squeal = DisturbedSqueal.model_construct(
        steady_sliding_stable=True, quiet=False, motions=(trials[6].motion,), disturbances=trials
    )
    assert squeal.smallest_disturbance is trials[6]
    assert squeal.largest_that_decays is largest
    told = squeal_words(squeal, bistable)
    assert "A velocity along mode Y of 2 J (1 m/s of the lining's surface) leads to squeal at 900 Hz" in told
    assert "1 J in the same way decays" in told


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        (["friction.statik"], "not a number of this scene"),
        (["friction.static", "friction.static"], "named twice"),
        (["forcing.frequency"], "does not act"),
        (["friction.decay"], "it is 0"),
        (["drum.speed"], "changes over time"),
    ],
)
def test_what_cannot_be_varied_is_refused(damped, keys, told):
    profile, force = {"time": [0, 1], "value": [5, 4]}, {"amplitude": {"Y": 1.0}, "frequency": 100.0}
    scene = damped.with_values({"friction.decay": 0.0, "drum.speed": profile, "forcing": force})
    with pytest.raises(RequestError, match=told):
        variable_numbers(scene, keys)


def test_damping_may_be_added_and_by_default_the_design_changes(nominal):
    scene, keys = variable_numbers(nominal, ["damping.ratio"])
    assert scene.damping is not None
    assert keys == ("damping.ratio",)
    _, keys = variable_numbers(nominal)
    assert "friction.static" in keys
    assert not {"drum.speed", "contact.normal_load", "shoe.outer_radius"} & set(keys)


@pytest.mark.thorough
def test_what_pushes_a_shoe_is_given_and_what_holds_and_bends_it_is_designed(nominal):
    at = {"at": [0, 0.1, 0], "direction": [1, 0, 0]}
    tables = {"shoe.spring": [{**at, "stiffness": 1e9}], "shoe.force": [{**at, "size": 1000}]}
    elastic = {"young": 210e9, "poisson": 0.3, "up_to": 1e4}
    scene = nominal.with_values({**tables, "shoe.elastic": elastic, "steady.state": "self-consistent"})
    scene, keys = variable_numbers(scene)
    assert [key for key in keys if key.count(".") > 1] == [
        # Poisson's ratio changes the shapes of the modes; the radius of the patch has its default.
        *("shoe.elastic.young", "shoe.spring.0.radius", "shoe.spring.0.stiffness"),
    ]


@pytest.mark.thorough
def test_a_disturbance_starts_beyond_the_contact_boundary_and_growth_is_no_decay(nominal):
    scene = nominal.with_values({"damping": {"ratio": 0.02}, "simulate.duration": 0.05})
    start = disturbed(scene)
    lost = 2000 / (0.1 * scene.shoe.arc_angle * 0.0365) / 0.35e11
    assert start.start.displacement["Y"] == pytest.approx(DISTURBANCE * lost)
    result = run(start)
    assert beyond_boundaries(result.history, result.stability.contact_fractions, build_model(start)).any()
    own = nonlinear_decay(scene)
    assert (own.outcome, own.decays) == (Kind.DECAYS, True)
    growing = nonlinear_decay(nominal.with_values({"simulate.duration": 0.05}))
    assert growing.decays is not True


# --- the smallest change --------------------------------------------------------------------------------------------


def test_a_search_without_result_says_what_is_left(damped):
    quiet = Quieting(
        found=True, quiet=False, changes=(), norm_of_relative_changes=0.0, largest_growth_rate_1_per_s=-1.0,
        scene=Written(damped).scene,
    )  # fmt: skip

    def said(*trials: Trial) -> str:
        found = quiet.model_copy(update={"disturbances": trials})
        return not_found(cast("Any", SimpleNamespace(quiet=found, alone=[SimpleNamespace(key="damping.ratio")])))

    none = "no change of damping.ratio within the bounds was found after which no disturbance squeals"
    decays = "with nothing changed every mode decays"
    assert said() == f"{none}; {decays}, but the brake has not been shown to be quiet"
    motion = SteadyResponse.model_construct(amplitude={"Y": 1e-5}, frequency_Hz=800.0, line_of="Y")
    squealing = Trial.model_construct(kind=Origin.EARLIER, start="a run", at={}, disturbance=None, motion=motion)
    told = f"{none}; {decays}, but there is still squeal at 800 Hz, Y ±10 µm (from a run, before the change)"
    assert said(squealing) == told


@pytest.mark.thorough
def test_what_the_transients_prove_quiet_needs_no_margin(bistable):
    search = Quietening(bistable, ["damping.ratio"], margin=1e6)
    assert search._quieting({}, DisturbedSqueal.of((), ())).succeeded
    assert not search._quieting({}, None).succeeded


def test_twice_and_half_are_equally_far_and_zero_is_finite():
    assert size_of("friction.static", 0.5, 1.0) == -size_of("friction.static", 0.5, 0.25) == np.log(2)
    lower = [size_of("friction.static", 0.5, 0.5 * ratio) for ratio in (0.5, LEAST, 0.05, 0.0)]
    assert lower == sorted(lower, reverse=True)
    assert lower[-1] == pytest.approx(np.log(LEAST) - 1)  # the tangent of the logarithm at a tenth, to its end
    assert size_of("damping.ratio", 0.0, 0.01) == np.log(2)  # in units of 0.01


def test_numbers_and_sizes_of_changes_are_each_other_s_inverse(damped):
    problem = problem_of(damped, ["friction.static", "damping.ratio", "friction.kinetic"])
    for x in ([-0.5, 0.7, -3.0], [1.0, -1.0, 2.0]):
        np.testing.assert_allclose(problem.sizes(problem.after(np.array(x))), x, rtol=1e-12)
    assert problem.after(problem.low)[0] == 0  # exactly
    step, x = 1e-6, np.array([-0.5, 0.7, -2.5])
    for k in range(3):
        sides = [problem.rates(x + sign * step * np.eye(3)[k])[0] for sign in (1, -1)]
        by_difference = np.nan_to_num((sides[0] - sides[1]) / (2 * step))  # of a free drift there is none
        scale = np.abs(by_difference).max()
        np.testing.assert_allclose(problem.rates(x)[1][:, k], by_difference, atol=1e-4 * scale)  # round-off over step


@pytest.mark.parametrize("start", [[1.6, 1.6, 0.5], [0.0, 4.0, 0.0]])
def test_a_change_is_made_smaller_to_the_least_of_a_border_that_is_known(start):
    """Quiet from the plane a·x = 1 on: its nearest point to none is a/|a|², whether from a mix or from one number."""
    normal = np.array([1.0, 0.5, 0.0])

    class Judge:
        def judge(self, brakes, what):
            assert not any(brake.thorough for brake in brakes)
            return [Judged(quiet=normal @ brake.numbers >= 1) for brake in brakes]

    class Judged:
        def __init__(self, quiet):
            self.quiet = quiet

    of: Any = object.__new__(Quietening)
    of._problem, of._disturber, of._progress = SimpleNamespace(in_file=lambda x: x), Judge(), silent
    found = of._shrink(np.array(start), np.ones(3), (), ())
    assert normal @ found >= 1
    assert np.linalg.norm(found) < 1.05 / np.linalg.norm(normal)  # steps of 4 %, turns of a quarter
    assert found[2] == 0  # what does nothing is left out


def test_single_changes_are_ranked_by_the_logarithm(damped):
    def row(key: str, before: float, after: float) -> Alone:
        change = Change.of(Written(damped), key, before, after)
        return Alone(key=key, lowest=0.0, highest=1.0, quiet=change)

    # −62.9 % is a factor of 2.7, +88 % one of 1.9.
    assert row("friction.static", 0.45, 0.167).rank > row("damping.ratio", 0.003, 0.00565).rank


def test_friction_that_rises_with_speed_is_flagged(nominal):
    before = nominal.with_values({"friction.static": 0.45, "friction.kinetic": 0.35})
    assert cautions(before, {"friction.static": 0.36}) == ()
    assert cautions(before, {"friction.static": 0.167}) == (Caution.RISING,)
    assert cautions(before, {"friction.kinetic": 0.5, "shoe.width": 0.331}) == (Caution.RISING, Caution.WIDE)
    assert cautions(before.with_values({"friction.static": 0.3}), {"friction.static": 0.2}) == ()  # it did before


def squeal_of(energy: float, frequency: float = 950.0) -> SteadyResponse:
    return SteadyResponse(
        start="", amplitude={"Y": 1e-5}, rms={"Y": 7e-6}, frequency_Hz=frequency, line_of="Y", kinetic_energy_J=energy,
        share_of_contact_loss=1.0, share_of_slip_reversal=1.0, drift=0.0, state=np.array([[1e-5], [0.2]]),
    )  # fmt: skip


def trial_of(motion: SteadyResponse | None, **at: float) -> Trial:
    return Trial(
        at=at, start="", kind=Origin.OWN, displacement={}, velocity={}, energy_J=None, speed_m_per_s=None,
        leads_to=Kind.DECAYS if motion is None else Kind.SQUEALS, simulated_s=0.1, motion=motion,
    )  # fmt: skip


def test_squeals_that_are_alike_are_told_once_a_point_the_largest_first():
    # Energies within e^0.5 and frequencies within 5 % are alike.
    faint, loud = trial_of(squeal_of(1.0)), trial_of(squeal_of(9.0))
    like, elsewhere, higher = (
        trial_of(squeal_of(1.5)),
        trial_of(squeal_of(1.0), speed=3.0),
        trial_of(squeal_of(1.0, 1e3)),
    )
    assert squealing([trial_of(None), faint, like, loud, elsewhere, higher]) == (loud, faint, elsewhere, higher)


def test_a_brake_is_disturbed_stage_by_stage_until_it_squeals(monkeypatch):
    # One mode along Y of 2 kg, in sizes of 1, 2 and 4 J^½ both ways, and what a brake's number says of it.
    ran = []

    class Way:
        sizes, mode = [1.0, 2.0, 4.0], SimpleNamespace(label="Y", frequency_Hz=1000.0)

        def __init__(self, sign):
            self.forwards, self.sign = sign > 0, sign

        def disturbance(self, size):
            speed = self.sign * size
            return VelocityPerturbation(
                mode="Y", forwards=self.forwards, velocity={"Y": speed}, speed_m_per_s=size, energy_J=size**2,
                boundary_ratio=size,
            )  # fmt: skip

        def start(self, size):
            return Start("", np.zeros(1), np.array([self.sign * size]), disturbance=self.disturbance(size))

    class Family:
        def __init__(self, model_at, moving, names):
            self.model_at, self.moving = model_at, moving

        def vibrations(self, point):
            return [Way.mode]

        def reach(self, mode, model):
            return np.array([[0j], [1.0 + 0j]]), [1.0]

    def model_of(scene, numbers=None, coordinates=None):
        return SimpleNamespace(names=("Y",), mass=np.array([2.0]), number=(numbers or {}).get("x"))

    def find(family, tasks, how, *, progress):
        assert how.sample_rate == 2500.0  # 2.5 samples a period of 1 kHz, where the scene has fewer
        for point, start in tasks:
            number = family.model_at(point.value).number
            ran.append(number)
            squeals = number == 2.0 and start.velocity[0] < 0
            leads = Kind.SQUEALS if squeals else Kind.DECAYS
            yield Response(
                start=start.name, leads_to=leads, simulated_s=0.5, outcome="complete", value=point.value,
                motion=squeal_of(1.0) if squeals else None,
            )  # fmt: skip

    def point_at(linear_at, value):
        return SimpleNamespace(
            value=value,
            reason="",
            unstable=linear_at(value).number == 3.0,
            modes=[Way.mode],
            vibrations=[Way.mode],
            steady=np.zeros(1),
        )

    patches = {
        "build_model": model_of, "linear_coordinates": lambda _: ("Y",), "find_attractors": find, "Family": Family,
        "point_at": point_at, "directions": lambda point, family, signs=(1, -1): [Way(sign) for sign in signs],
        "disturbed": lambda scene: "beyond", "round_seconds": lambda *_: 1.0,
        "start_of": lambda scene, names: (np.full(1, 2e-5 if scene == "beyond" else 1e-6), np.zeros(1)),
        "surface_speed": lambda model, velocity: float(abs(velocity[0])),
    }  # fmt: skip
    for name, patch in patches.items():
        monkeypatch.setattr(disturbing, name, patch)
    scene: Any = SimpleNamespace(forcing=None, simulate=SimpleNamespace(sample_rate=1e3, tolerance=1e-6, solver="auto"))
    scene.with_values = lambda _: scene
    disturber = Disturber(scene)
    brakes = [BrakeVariant({"x": number}, thorough=number > 0) for number in (0.0, 1.0, 2.0, 3.0)]
    judged = disturber.judge(brakes, "")
    # Its own start, the displacement and the mode forwards; the five other sizes and ways, and the random ones.
    counts = [len(each.disturbances) for each in judged]
    assert counts == [3, 3 + 5 + RANDOM, 3 + 5, 0]
    assert [each.quiet for each in judged] == [True, True, False, False]
    assert [each.steady_sliding_stable for each in judged] == [True, True, True, False]
    kinds = [Counter(trial.kind for trial in each.disturbances) for each in judged]
    assert kinds[1] == {Origin.OWN: 1, Origin.DISPLACEMENT: 1, Origin.MODE: 6, Origin.RANDOM: RANDOM}
    # As words that follow "from".
    starts = [trial.start for trial in judged[1].disturbances if trial.kind in (Origin.OWN, Origin.DISPLACEMENT)]
    assert sorted(starts) == ["a displacement of three compressions", "its own start"]
    along = [trial for trial in judged[2].disturbances if trial.kind is Origin.MODE]
    assert [trial.velocity["Y"] for trial in along] == [4.0, 1.0, 2.0, -1.0, -2.0, -4.0]
    assert [trial.energy_J for trial in along] == [16.0, 1.0, 4.0, 1.0, 4.0, 16.0]  # 2 kg v²/2
    assert [trial.leads_to for trial in along] == [Kind.DECAYS] * 3 + [Kind.SQUEALS] * 3
    assert (judged[1].disturbances[0].energy_J, judged[1].disturbances[0].displacement) == (None, {"Y": 1e-6})
    # None is run again, and squeal of a similar brake is tried first, then in larger multiples.
    before = len(ran)
    carried = (trial_of(squeal_of(1.0)),)
    (again, first) = disturber.judge([BrakeVariant({"x": 1.0}), BrakeVariant({"x": 5.0}, carried)], "")
    assert again.disturbances == judged[1].disturbances
    assert len(ran) - before == len(first.disturbances) == 1 + 3 + 2 + 5 + RANDOM
    earlier = [trial.velocity["Y"] for trial in first.disturbances if trial.kind is Origin.EARLIER]
    assert earlier == pytest.approx([0.2, 0.24, 0.3])
    assert first.disturbances[0].kind is Origin.EARLIER


@pytest.mark.thorough
def test_a_disturbance_that_a_brake_has_had_is_not_run_again(bistable, monkeypatch):
    disturber, run = Disturber(bistable), []
    original = disturber._run  # pyright: ignore[reportPrivateUsage]

    def counted(*args):
        for each in original(*args):
            run.append(each)
            yield each

    monkeypatch.setattr(disturber, "_run", counted)
    quiet = BrakeVariant({"damping.ratio": 0.02})
    disturber.judge([quiet._replace(thorough=False)], "")
    first = len(run)
    (judged,) = disturber.judge([quiet], "")
    assert judged.quiet
    assert len(run) == len(judged.disturbances) > first > 0
    disturber.judge([quiet], "")
    assert len(run) == len(judged.disturbances)


# --- where it is quiet ----------------------------------------------------------------------------------------------


@pytest.mark.thorough  # 24 s: proofs at two speeds by transients
def test_a_brake_is_quiet_only_where_it_is_quiet_at_every_point(nominal):
    """With 0.5 % of damping sliding at 70 rad/s is quiet, and at 20 rad/s a large disturbance leads to squeal."""
    scene = nominal.with_values({"damping": {"ratio": 0.005}, "drum.speed": 70.0, "simulate.duration": 0.1})
    (alone,) = Disturber(scene).judge([BrakeVariant({})], "")
    assert alone.quiet
    (both,) = Disturber(scene, points=({}, {"drum.speed": 20.0})).judge([BrakeVariant({})], "")
    assert not both.quiet
    assert {tuple(each.at.items()) for each in both.disturbances if each.leads_to is not Kind.DECAYS} == {
        (("drum.speed", 20.0),)
    }


def test_the_linear_problem_holds_at_every_point(nominal):
    scene = nominal.with_values(BRIEF | {"damping": {"ratio": 0.005}, "drum.speed": 20.0})
    evaluate = state_matrix_of(scene, tuple(numbers_of(scene)))
    problem = Problem(Written(scene), ("friction.static",), evaluate, silent, ({}, {"drum.speed": 5.0}))
    assert problem_of(scene, ["friction.static"], evaluate).largest(np.zeros(1)) < 0 < problem.largest(np.zeros(1))
    slower = problem_of(scene.with_values({"drum.speed": 5.0}), ["friction.static"])
    assert problem.largest(np.zeros(1)) == pytest.approx(slower.largest(np.zeros(1)), rel=1e-9)


def test_the_points_are_every_combination_and_the_scene_itself(nominal):
    ranges = [
        read_variation(text, nominal, option="--at") for text in ("drum.speed=5..7x3", "contact.normal_load=1..2 kNx2")
    ]
    found = operating(nominal, nominal, 0.0, Written(nominal), ranges)
    assert found.time_s is None
    assert found.points[0] == {}
    assert len(found.points) == 6  # 5 rad/s with 2 kN is the scene
    assert {"drum.speed": 7.0, "contact.normal_load": 1000.0} in found.points
    words = f"{where(found)}{where_else(found)}"
    assert words == (
        "a drum speed of 5 rad/s and a load of 2000 N and at drum.speed from 5 to 7 rad/s (3 values) "
        "with contact.normal_load from 1 to 2 kN (2 values)"
    )


@pytest.mark.thorough
def test_a_speed_that_changes_is_reported_with_its_time(nominal):
    profile = nominal.with_values(BRIEF | {"drum.speed": {"time": [0, 1], "value": [5, 1]}})
    study = study_sensitivity(profile)
    assert where(study.operating) == "a drum speed of 5 rad/s and a load of 2000 N (at t = 0 s)"


@pytest.mark.parametrize(
    ("unstable", "squeals", "order", "said"),
    [
        ((), ("Y",), "abc", "the mode that squeals"),
        ((), ("Y", "X"), "cab", "the modes that squeal"),
        ((), (), "bac", "the least stable mode"),
        (("Tz",), ("Y",), "bac", "the unstable mode"),
        (("X", "Y"), ("Tz",), "cab", "the unstable modes"),
    ],
)
def test_the_number_comes_first_that_changes_most_what_matters(unstable, squeals, order, said):
    modes = [
        SimpleNamespace(name=name, unstable=name in unstable, growth_rate_1_per_s=rate)
        for name, rate in (("X", -3.0), ("Y", -2.0), ("Tz", -1.0))
    ]
    by_mode = {"a": (2.0, -3.0, 5.0), "b": (0.0, 2.0, -6.0), "c": (-9.0, 1.0, 0.0)}
    numbers = tuple(SimpleNamespace(key=key, growth_per_percent_1_per_s=rates) for key, rates in by_mode.items())
    squeal = SimpleNamespace(motions=[SimpleNamespace(line_of=name) for name in squeals])
    found = SensitivityStudy.model_construct(modes=tuple(modes), numbers=numbers, squeal=squeal).in_order()
    assert "".join(row.key for row in found.numbers) == order
    assert modes_that_matter(found) == said


@pytest.mark.slow  # the study of the slow ones above
def test_without_unstable_modes_the_numbers_are_sorted_by_the_mode_that_squeals(bistable_study):
    (relevant,) = bistable_study.relevant
    assert bistable_study.modes[relevant].name == "Y"
    sizes = [abs(row.growth_per_percent_1_per_s[relevant]) for row in bistable_study.numbers]
    assert sizes == sorted(sizes, reverse=True)
    assert modes_that_matter(bistable_study) == "the mode that squeals"


@pytest.mark.slow  # the study of the slow ones above
def test_the_figure_of_what_makes_it_quiet_has_a_row_for_each_number(bistable_study):
    figure = draw_quiet(bistable_study)
    assert figure is not None
    (axes,) = figure.axes
    assert [each.get_text() for each in axes.get_yticklabels()] == ["damping.ratio"]
    assert [cast("Rectangle", each).get_width() for each in axes.patches] == [bistable_study.alone[0].quiet.logarithm]
    assert draw_quiet(bistable_study.model_copy(update={"alone": ()})) is None


def test_what_makes_it_quiet_is_drawn_only_where_that_was_asked_for():
    plain, searched = (sensitivity_answer(until_stable=until_stable).files for until_stable in (False, True))
    assert set(searched) - set(plain) == {"quiet.png"}  # a plain study has none, and does not say that it is missing


def test_the_command_writes_how_growth_rates_change(drumsqueal, tmp_path, as_kept):
    damping = f"damping.ratio={SCARCELY}"
    status, printed, error = drumsqueal("sensitivity", str(NOMINAL), "-o", str(tmp_path), "--set", damping)
    assert (status, error) == (0, "")
    as_kept("sensitivity", printed, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {*FILES["sensitivity"]} - {"quiet.toml", "quiet.png"}
    modes = {
        mode.label: mode
        for mode in analyse_stability(build_model(load_scene(NOMINAL, [damping]), coordinates=COORDINATES)).modes
    }
    with (tmp_path / "sensitivity.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["number"] == "contact.normal_load"]
    assert {row["mode"] for row in rows} == modes.keys()
    for row in rows:
        if row["mode"] in SQUEALING:
            # Without damping it is proportional to the load, to third order (C/ω)³: see above.
            known = modes[row["mode"]].growth_rate / 100
            assert float(row["growth_per_percent_1_per_s"]) == pytest.approx(known, rel=1e-4)
    found = read_findings(tmp_path / "sensitivity.json", SensitivityStudy)
    assert to_json(found) == (tmp_path / "sensitivity.json").read_text()
    assert [mode.growth_rate_1_per_s for mode in found.modes] == pytest.approx(
        [modes[mode.label].growth_rate for mode in found.modes], rel=1e-9
    )
    assert "Change of each growth rate per +1 %" in printed


@pytest.mark.slow  # 90 s and more, of transients
@pytest.mark.parametrize(
    ("damping", "speed", "key", "before"),
    [
        (0.005, 20, "damping.ratio", 0.005),  # stable, but it squeals when it is disturbed
        (0.0, 5, "friction.static", 0.5),  # unstable
    ],
)
def test_the_command_writes_a_quiet_scene_that_is_one(drumsqueal, tmp_path, damping, speed, key, before):
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    text = NOMINAL.read_text(encoding="utf-8").replace('"0.4 s"', '"0.05 s"').replace('"5 rad/s"', f'"{speed} rad/s"')
    scene.write_text(f"{text}\n[damping]\nratio = {damping}\n", encoding="utf-8")
    status, printed, error = drumsqueal("sensitivity", str(scene), "-o", str(out), "--until", "stable", "--vary", key)
    assert (status, error) == (0, "")
    assert {path.name for path in out.iterdir()} == set(FILES["sensitivity"])
    point = f"Quiet at a drum speed of {speed} rad/s and a load of 2000 N with {key}"
    assert f"{point} changed from {before} to" in " ".join(printed.split())
    quiet = load_scene(out / "quiet.toml")
    assert not analyse_stability(build_model(quiet, coordinates=COORDINATES)).unstable
    found = json.loads((out / "sensitivity.json").read_text())
    assert found["operating"]["own"][0]["values"] == [speed]
    assert found["quiet"]["transients"][0]["start"] == "its own start"
    assert len(found["quiet"]["transients"]) == 1  # the disturbances hold all other starts
    assert found["quiet"]["quiet"] is True
    assert {each["leads_to"] for each in found["quiet"]["disturbances"]} == {"decays"}
    text = (out / "quiet.toml").read_text()
    assert " ".join(text.replace("#", " ").split()).startswith(point)
    assert 'thickness = "20 mm"' in text
    assert "…" not in printed  # no number is cut off
    with (out / "sensitivity.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:  # the same numbers under the same names
        (number,) = (each for each in found["numbers"] if each["key"] == row["number"])
        k = [mode["label"] for mode in found["modes"]].index(row["mode"])
        for name in number.keys() - {"key", "value_SI"}:
            assert number[name][k] == (float(row[name]) if row[name] else None), name
    assert len(rows) == len(found["numbers"]) * len(found["modes"])
    text = (out / "sensitivity.json").read_text()
    again = read_findings(out / "sensitivity.json", SensitivityStudy)
    assert again.quiet is not None
    assert again.quiet.scene == quiet
    assert to_json(again) == text
    status, printed, _ = drumsqueal(
        "sensitivity", str(out / "quiet.toml"), "-o", str(tmp_path / "b"), "--until", "stable"
    )
    assert status == 0
    assert "Nothing in this scene is unstable" in printed
    assert not (tmp_path / "b" / "quiet.toml").exists()


@pytest.mark.thorough  # 24 s: a search with its proof by transients
def test_the_command_finds_the_friction_that_makes_a_brake_along_y_quiet(drumsqueal, tmp_path):
    settings = ("--set", "simulate.duration=0.02s", "--until", "stable", "--vary", "friction.static")
    status, printed, error = drumsqueal(
        "sensitivity", "scenarios/damped.toml", *OPTIONS, *settings, "-o", str(tmp_path)
    )
    assert (status, error) == (0, "")
    assert {path.name for path in tmp_path.iterdir()} == set(FILES["sensitivity"])
    # The growth rate is linear in it, and −1 1/s is wanted; what is written has three digits, on the quiet side.
    rates = [AlongY(brake_along_y(f"friction.static={static}")).growth_rate for static in (0.4, 0.5)]
    exact = 0.5 + 0.1 * (-1 - rates[1]) / (rates[1] - rates[0])
    (change,) = json.loads((tmp_path / "sensitivity.json").read_text())["quiet"]["changes"]
    assert exact - 1e-3 <= change["after"] <= exact
    assert f"friction.static changed from 0.5 to {change['after']}" in " ".join(printed.split())
    assert AlongY(load_scene(tmp_path / "quiet.toml")).growth_rate <= -1


@pytest.mark.thorough
def test_a_search_that_cannot_succeed_says_how_far_it_came(drumsqueal, tmp_path):
    # Without damping, along Y alone: ten times as heavy it grows a tenth as fast, but ever grows.
    settings = ("damping.ratio=0", "simulate.duration=0.02s")
    brief = (word for setting in settings for word in ("--set", setting))
    arguments = ("scenarios/damped.toml", *OPTIONS, *brief, "-o", str(tmp_path))
    status, _, error = drumsqueal("sensitivity", *arguments, "--until", "stable", "--vary", "shoe.density")
    assert status == 1
    least = AlongY(brake_along_y(*settings)).growth_rate * LEAST
    assert "no change of shoe.density within the bounds was found that brings every growth rate to" in error
    assert f"the largest growth rate can be brought down to +{least:.3g} 1/s" in error
    assert {path.name for path in tmp_path.iterdir()} == {*FILES["sensitivity"]} - {"quiet.toml"}
    failed = json.loads((tmp_path / "sensitivity.json").read_text())["quiet"]
    assert not failed["found"]
    assert failed["largest_growth_rate_1_per_s"] == pytest.approx(least, rel=1e-9)
    assert failed["changes"][0]["before"] / failed["changes"][0]["after"] == pytest.approx(LEAST)


@pytest.mark.parametrize(
    "wrong",
    [
        ("--until", "quiet"),
        ("--vary", "friction.static"),
        ("--until", "stable", "--vary", "friction.statik"),
        ("--until", "stable", "--vary", ""),
        ("--at", "drum.speed=3..8"),
        ("--until", "stable", "--at", "drum.speed=-3..8"),
        ("--until", "stable", "--at", "drum.sped=3..8"),
        ("--until", "stable", "--at", "contact.normal_load=0..1000"),
        ("--until", "stable", "--at", "drum.speed=3..8x11", "--at", "contact.normal_load=1..2x11"),
        ("--until", "stable", "--at", "drum.speed=3..8", "--vary", "drum.speed"),
    ],
)
def test_wrong_requests_write_nothing(drumsqueal, tmp_path, wrong):
    status, printed, error = drumsqueal("sensitivity", str(NOMINAL), "-o", str(tmp_path / "out"), *wrong)
    assert (status, printed) == (2, "")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_wrong_request_clears_nothing_either(drumsqueal, tmp_path):
    (tmp_path / "sensitivity.csv").write_text("of value")
    still = ("friction=none", "support=none", "contact.stiffness=0")
    settings = [word for setting in still for word in ("--set", setting)]
    status, printed, error = drumsqueal("sensitivity", str(NOMINAL), "-o", str(tmp_path), "--overwrite", *settings)
    assert (status, printed, error.count("\n")) == (2, "", 1)
    assert "nothing oscillates" in error
    assert (tmp_path / "sensitivity.csv").read_text() == "of value"


def test_modes_without_a_column_are_named(study, monkeypatch):
    monkeypatch.setattr(answer, "largest_of", lambda sizes: largest_of(sizes, 1))
    left_out = sorted(study.modes, key=lambda mode: -mode.growth_rate_1_per_s)[1:]
    named = ", ".join(mode.label for mode in study.modes if mode in left_out)
    assert f"Without {named}: their growth rates are lower than those shown" in " ".join(str(study).split())
