"""The parts of what makes a brake quiet: derivatives, limits, sizes of changes, and the motion at the end."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.kinds import Kind
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from drumsqueal.physics.effects.pressure import Unilateral
from drumsqueal.questions.sensitivity import disturbing, study
from drumsqueal.questions.sensitivity.disturbing import _deepest, nonlinear_decay
from drumsqueal.questions.sensitivity.quieting import _next_to, _stable_from, ladder_to
from drumsqueal.questions.sensitivity.stabilising import Change, Problem, _limits, _widest, numbers_of
from drumsqueal.questions.sensitivity.study import points_of
from drumsqueal.scene.variation import Written
from findings.fakes import two_shoes

RNG = np.random.default_rng(6)
SPRINGS = np.array([[50.0, 8.0], [-6.0, 90.0]])


def matrix_of(p: np.ndarray) -> np.ndarray:
    """The state matrix of two coordinates by three numbers: of the springs, of the damping, of one coupling."""
    springs = SPRINGS * [[p[0], p[2]], [1.0, p[0]]]
    return np.block([[np.zeros((2, 2)), np.eye(2)], [-springs, -p[1] * np.diag([0.3, 0.1])]])


def evaluate(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    steps = 1e-6 * np.eye(3)
    return matrix_of(p), np.array([(matrix_of(p + step) - matrix_of(p - step)) / 2e-6 for step in steps])


def modes_at(p: np.ndarray) -> list[Any]:
    values, left, right = scipy.linalg.eig(matrix_of(p), left=True)
    found = []
    for k in sorted(range(4), key=lambda k: values[k].imag):
        if values[k].imag > 0:
            own = left[:, k] / np.conj(left[:, k].conj() @ right[:, k])
            found.append(SimpleNamespace(eigenvalue=values[k], right=right[:, k], left=own))
    return found


def test_differences_follow_each_mode_on_both_sides_of_a_number():
    p = np.array([1.2, 0.8, 0.0])
    found = study._differences(tuple(modes_at(p)), evaluate, p, lambda *_: None)
    assert np.isnan(found[:, 2]).all()  # a number that is zero has no per cent
    for j in range(2):
        step = np.zeros(3)
        step[j] = 1e-3 * p[j]
        above, below = ([m.eigenvalue for m in modes_at(p + s * step)] for s in (1, -1))
        np.testing.assert_allclose(found[:, j], (np.array(above) - below) / (2 * step[j]), rtol=1e-8)


def test_a_row_has_changes_per_cent_and_derivatives_in_Hz():
    row = study._row("shoe.width", 0.04, np.array([2 + 6j, -1 - 3j]), np.array([2.5 + 1j, complex(np.nan, np.nan)]))
    assert (row.key, row.value_SI) == ("shoe.width", 0.04)
    assert row.growth_per_percent_1_per_s == pytest.approx((8e-4, -4e-4))
    assert row.growth_per_percent_by_differences_1_per_s == (pytest.approx(1e-3), None)
    assert row.frequency_per_percent_Hz == pytest.approx((24e-4 / (2 * np.pi), -12e-4 / (2 * np.pi)))
    assert row.growth_per_SI == (2.0, -1.0)
    assert row.frequency_Hz_per_SI == pytest.approx((6 / (2 * np.pi), -3 / (2 * np.pi)))
    values = np.array([2.0, 10.0])
    derivatives, differences = np.array([[1 + 1j, 3j]]), np.array([[1.5 + 1j, complex(np.nan, np.nan)]])
    assert study._deviation(values, derivatives, differences) == pytest.approx(2 * 0.5 / 30)
    assert study._deviation(values, 0 * derivatives, differences) == 0.0


def test_a_scene_at_one_time_has_the_values_of_its_profiles_there(nominal):
    scene = nominal.with_values({
        "drum.speed": {"time": [0.0, 2.0], "value": [4.0, 8.0]},
        "contact.normal_load": {"time": [1.0, 3.0], "value": [500.0, 1500.0]},
    })  # fmt: skip
    found = study.at_one_time(scene, 1.5)
    assert (found.drum.speed, found.contact.normal_load) == (7.0, 750.0)
    assert study.at_one_time(nominal, 1.5) == nominal


@pytest.fixture
def problem(nominal) -> Problem:
    """Three numbers of a brake, two of which decide a state matrix, at two operating points."""
    scene = nominal.with_values({"damping": {"ratio": 0.0}})

    def state_matrix(numbers):
        given = dict(zip(own, numbers, strict=True))
        p = np.array([given["shoe.width"] / 0.0365, 1 + given["damping.ratio"], given["drum.speed"] / 5])
        matrix, slopes = evaluate(p)
        wide = np.zeros((len(own), 4, 4))
        for key, slope, size in zip(
            ("shoe.width", "damping.ratio", "drum.speed"), slopes, (0.0365, 1.0, 5.0), strict=True
        ):
            wide[own.index(key)] = slope / size
        return matrix, wide

    keys = ("shoe.width", "damping.ratio", "friction.static")
    own = list(Problem(Written(scene), keys, None, lambda *_: None).numbers)  # pyright: ignore[reportArgumentType]
    points = ({}, {"drum.speed": 30.0})
    return Problem(Written(scene), keys, state_matrix, lambda *_: None, points)


def test_growth_rates_and_their_slopes_are_those_of_the_changed_numbers_at_every_point(problem):
    x = np.array([0.3, 0.02, -0.1])
    after = problem.after(x)
    np.testing.assert_allclose(after, [0.0365 * np.exp(0.3), 0.01 * np.expm1(0.02), problem.before[2] * np.exp(-0.1)])
    np.testing.assert_allclose(problem.sizes(after), x)
    rates, slopes = problem.rates(x)
    p = [np.array([np.exp(0.3), 1 + after[1], s]) for s in (1.0, 6.0)]
    wanted = []
    for each in p:
        values = np.linalg.eigvals(matrix_of(each))
        wanted += [values[k].real for k in np.lexsort((values.real, values.imag))]
    np.testing.assert_allclose(rates, wanted, atol=1e-12)
    assert problem.largest(x) == pytest.approx(max(wanted))
    for j in range(3):
        step = np.zeros(3)
        step[j] = 1e-5
        numeric = (problem.rates(x + step)[0] - problem.rates(x - step)[0]) / 2e-5
        np.testing.assert_allclose(slopes[:, j], numeric, atol=1e-6)
    assert problem.decays(x, 0.5) == (max(wanted) <= -0.5 * 0.999)
    assert problem.limits["damping.ratio"] == (0.0, 1.0)
    assert problem.limits["shoe.width"] == pytest.approx((0.00365, 0.365))
    np.testing.assert_array_equal(problem.after(problem.low), [problem.limits[key][0] for key in problem.keys])
    np.testing.assert_array_equal(problem.after(problem.high + 1), [problem.limits[key][1] for key in problem.keys])


def test_a_free_drift_does_not_grow(nominal):
    def largest(drift: float) -> float:
        """Of a real eigenvalue, and of an oscillation at 100 rad/s: below 1e-7 of that it drifts."""
        matrix = np.array([[drift, 0.0, 0.0], [0.0, -2.0, 100.0], [0.0, -100.0, -2.0]])
        slopes = np.zeros((len(numbers_of(nominal)), 3, 3))
        problem = Problem(Written(nominal), ("shoe.width",), lambda _: (matrix, slopes), lambda *_: None)
        return problem.largest(np.zeros(1))

    assert largest(5e-6) == pytest.approx(-2.0)
    assert largest(2e-5) == pytest.approx(2e-5)


def test_numbers_stay_within_a_tenth_and_ten_times_and_a_shoe_a_sector(nominal):
    numbers = {key: value for key, value in nominal.numbers().items() if isinstance(value, float)}

    def limits(key: str, *points: dict[str, float]) -> tuple[float, float]:
        return _limits(key, numbers, nominal, [{}, *points])

    assert limits("friction.static") == pytest.approx((0.0, 10 * numbers["friction.static"]))
    assert limits("shoe.density") == pytest.approx((0.1 * numbers["shoe.density"], 10 * numbers["shoe.density"]))
    assert limits("contact.normal_load")[0] == pytest.approx(0.1 * numbers["contact.normal_load"])
    middle = math.sqrt(numbers["shoe.thickness"] * numbers["shoe.outer_radius"])
    assert limits("shoe.thickness")[1] == pytest.approx(0.99 * middle)
    assert limits("shoe.outer_radius")[0] == pytest.approx(middle / 0.99)
    assert limits("shoe.arc_angle")[1] == pytest.approx(2 * np.pi)

    def shoe(position: float, arc: float) -> Any:
        return SimpleNamespace(position=position, arc_angle=arc)

    three: Any = SimpleNamespace(shoes=(shoe(0.1, 1.0), shoe(2.6, 1.4), shoe(5.5, 0.6)))
    # To the one at 5.5 rad it is 0.883 rad across zero: both grow by as much.
    assert _widest("shoe.0.arc_angle", three) == pytest.approx(2 * np.pi - 5.4 + (1.0 - 0.6) / 2)
    assert _widest("shoe.1.arc_angle", three) == pytest.approx(2.5 + (1.4 - 1.0) / 2)


def test_one_number_alone_is_changed_further_and_further_to_its_bound():
    asked: list[list[float]] = []

    def largest(x):
        asked.append(x.tolist())
        return 3.0 - 5.0 * x[1]

    problem: Any = SimpleNamespace(largest=largest)
    up, down = (ladder_to(farthest, 0.1, 2.0, 8) for farthest in (1.7, 0.95))
    assert up == pytest.approx([0.1, 0.2, 0.4, 0.8, 1.6, 1.7])
    assert down == pytest.approx([0.1, 0.2, 0.4, 0.8, 0.95])
    assert ladder_to(1.65, 0.1, 2.0, 8) == pytest.approx([0.1, 0.2, 0.4, 0.8, 1.65])
    assert ladder_to(0.0, 0.1, 2.0, 8) == []
    assert _stable_from(problem, np.array([0.0, 1.0]), up, 0.5) == pytest.approx(0.7, rel=1e-5)
    assert all(each[0] == 0 for each in asked)
    assert _stable_from(problem, np.array([0.0, -1.0]), down, 0.5) is None


def test_the_numbers_of_a_change_are_those_that_change_with_few_digits(nominal):
    problem = Problem(Written(nominal), ("shoe.width", "friction.static"), None, lambda *_: None)  # pyright: ignore[reportArgumentType]
    found = problem.in_file(np.array([0.0, 0.3]))
    assert found == {"friction.static": 0.675}  # 0.5 e^0.3 = 0.67493; 0.68 is further by more than 2 % of the change
    assert problem.in_file(np.zeros(2)) == {}
    np.testing.assert_allclose(problem.sizes_of(found), [0.0, np.log(0.675 / 0.5)])
    exact = problem.exact(np.array([0.0, 0.3]))
    assert exact == {"shoe.width": 0.0365, "friction.static": pytest.approx(0.5 * np.exp(0.3), rel=1e-14)}


def test_smaller_changes_lose_a_part_or_take_one_at_the_cost_of_the_others():
    whole, ways = np.array([0.6, 0.0, -0.8]), np.array([1.0, -1.0, -1.0])
    found = {tuple(np.round(each, 9)) for each in _next_to(whole, ways, 0.5, 0.85)}
    wanted = {(0.0, 0.0, -0.8), (0.3, 0.0, -0.8), (0.6, 0.0, 0.0), (0.6, 0.0, -0.4)}
    for k, way in enumerate(ways):
        for step in (0.5, -0.5):
            turned = whole.copy()
            turned[k] += step * way  # of a size of one
            turned[turned * ways < 0] = 0.0
            wanted.add(tuple(np.round(0.85 * turned / np.linalg.norm(turned), 9)))
    assert found == {each for each in wanted if np.linalg.norm(each) <= 0.98}
    assert _next_to(np.array([0.5]), np.array([1.0]), 0.25, 0.99) == [np.array([0.25])]


def test_operating_points_are_all_combinations_but_that_of_the_scene():
    own = {"drum.speed": 5.0, "contact.normal_load": 2000.0}
    found = points_of({"drum.speed": (5.0, 8.0), "contact.normal_load": (2000.0, 1000.0)}, own)
    assert found == (
        {},
        {"drum.speed": 5.0, "contact.normal_load": 1000.0},
        {"drum.speed": 8.0, "contact.normal_load": 2000.0},
        {"drum.speed": 8.0, "contact.normal_load": 1000.0},
    )
    assert points_of({}, own) == ({},)


# --- how a transient ends --------------------------------------------------------------------------------------------


def test_the_mean_pressure_presses_the_lining_in_most_at_a_corner_of_what_changes(monkeypatch):
    model = two_shoes(loads=(PiecewiseLinear([1.0, 3.0], [0.0, 900.0]), Constant(700.0)))
    model.contact.laws = [Unilateral(3.0e7), Unilateral(1.3e7)]
    model.operation = Operation(Constant(5.0), PiecewiseLinear([1.0, 3.0], [100.0, 2500.0]), (), (Constant(700.0),))
    monkeypatch.setattr(disturbing, "moments_at", lambda operation, times: times)
    monkeypatch.setattr(disturbing, "mean_pressures", lambda model, times: [100.0 + 800 * times, 0 * times + 700.0])
    assert _deepest(model) == pytest.approx(max(2500.0 / 3.0e7, 700.0 / 1.3e7))
    model.contact.laws[1] = Unilateral(0.0)  # which nothing is pressed into
    assert _deepest(model) == pytest.approx(2500.0 / 3.0e7)
    model.operation = Operation(Constant(5.0), Constant(100.0), (), (Constant(700.0),))
    model.contact.laws[1] = Unilateral(1e12)
    assert _deepest(model) == pytest.approx(100.0 / 3.0e7)


@pytest.mark.parametrize(
    ("ratio", "last", "kind", "outcome"),
    [
        (0.9, False, Kind.PERIODIC, Kind.DECAYS), (1.0, False, Kind.PERIODIC, Kind.SQUEALS),
        (0.9, True, Kind.QUASI_PERIODIC, Kind.SQUEALS), (0.9, True, Kind.IRREGULAR,
        Kind.SQUEALS),
        (2.0, True, Kind.UNDECIDED, Kind.UNDECIDED), (2.0, True, Kind.STEADY,
        Kind.UNDECIDED),
        (2.0, True, None, Kind.UNDECIDED), (None, True, Kind.PERIODIC, Kind.NOT_STARTED),
    ],
)  # fmt: skip
def test_a_transient_decays_where_it_is_smaller_and_its_last_tenth_within_the_boundaries(
    monkeypatch, ratio, last, kind, outcome
):
    time = np.arange(100) / 10.0
    beyond = np.arange(100) < 90  # up to the last tenth
    beyond[90] = last
    saturation = (
        None
        if kind is None
        else SimpleNamespace(regime=SimpleNamespace(kind=kind), main=SimpleNamespace(frequency_Hz=7.0))
    )
    findings = SimpleNamespace(motion_ratio=ratio, saturation=saturation)
    stability = SimpleNamespace(contact_fractions=(0.9,))
    result = SimpleNamespace(findings=findings, history="history", stability=stability)
    monkeypatch.setattr(disturbing, "prepare", lambda scene: SimpleNamespace(linear="linear"))
    monkeypatch.setattr(disturbing, "run_whole", lambda prepared, progress: result)
    monkeypatch.setattr(disturbing, "Vibration", lambda history, stability: SimpleNamespace(time=time))
    monkeypatch.setattr(
        disturbing, "beyond_boundaries", lambda *given: beyond if given == ("history", (0.9,), "linear") else None
    )
    found = nonlinear_decay(None)  # pyright: ignore[reportArgumentType]
    assert found.outcome is outcome
    assert found.decays is {Kind.DECAYS: True, Kind.SQUEALS: False}.get(outcome)
    if outcome is not Kind.NOT_STARTED:
        assert (found.motion_ratio, found.duration_s) == (ratio, 9.9)
    assert (found.kind, found.frequency_Hz) == ((kind, 7.0) if outcome is Kind.SQUEALS else (None, None))

    def fails(prepared, progress):
        raise IntegrationError("so")

    monkeypatch.setattr(disturbing, "run_whole", fails)
    assert nonlinear_decay(None) == disturbing.Decay(outcome=Kind.FAILED, reason="so")  # pyright: ignore[reportArgumentType]


def test_a_change_is_told_in_the_unit_of_the_file(nominal):
    tables = nominal.model_dump(exclude_none=True)
    written = Written(nominal, tables | {"shoe": tables["shoe"] | {"width": "36.5 mm"}})
    found = Change.of(written, "shoe.width", 0.0365, 0.0511)
    assert (found.unit, found.before_in_unit, found.after_in_unit) == ("mm", pytest.approx(36.5), pytest.approx(51.1))
    assert (found.relative, found.logarithm) == (pytest.approx(0.4), pytest.approx(np.log(1.4)))
    damping = Change.of(written, "damping.ratio", 0.0, 0.02)
    assert (damping.relative, damping.logarithm) == (2.0, pytest.approx(np.log(3.0)))
