"""Modes along a parameter whose eigenvalues are known in closed form: oscillators that do not feel each other."""

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from drumsqueal.errors import NoSteadySliding, SteadyStateError
from drumsqueal.physics.friction_law import ExponentialLaw
from drumsqueal.physics.model import build_model
from drumsqueal.solve.linear import branches, family, steady
from drumsqueal.solve.linear.branches import DIVERGENCE, Point, continued, follow_modes
from drumsqueal.solve.linear.family import EigenvalueSet, _informative, _own, eigenvalue_gradient
from drumsqueal.solve.linear.modes import (
    AboutSteady,
    Mode,
    Stability,
    assurance,
    eigensystem,
    growing_without_oscillation,
    matched,
    name_modes,
    overlap_of,
    solve_modes,
    stability_of,
    undamped_modes,
)
from drumsqueal.solve.linear.steady import Linear

NAMES, MASS = ("X", "Y", "Tz"), np.array([2.0, 0.5, 0.03])


def damping(p):
    """−2 Re λ (1/s) of the three: one sets in at 0.3, one ends at 0.7, one decays throughout."""
    return np.array([2 * (0.3 - p), 2 * (p - 0.7), 0.8 + 0 * p])


def stiffness(p):
    """ω² (1/s²): two frequencies cross at p = 0.5; the third falls below zero at 0.62."""
    return np.array([(10 + 4 * (p - 0.5)) ** 2, (10 - 6 * (p - 0.5)) ** 2, 50 * (0.62 - p)])


def matrix_at(p):
    """In coordinates scaled by other units, which change no eigenvalue."""
    scale = np.array([1.0, 3.0, 0.2])
    return np.block(
        [[np.zeros((3, 3)), np.eye(3)], [-np.diag(stiffness(p)) * scale / scale[:, None], -np.diag(damping(p))]]
    )


def exact(p):
    return -damping(p) / 2 + np.sqrt(damping(p) ** 2 / 4 - stiffness(p) + 0j)


HERE: Any = None  # the models along the parameter, which `at` does without


def at(_, p):
    """As `point_at`, but for the model."""
    if 0.1 < p < 0.2:
        return branches.Point(p, reason="none there")
    matrix = matrix_at(p)
    eigenvalues, modes = solve_modes(NAMES, MASS, matrix)
    return Point(p, np.array([p, 0, 0]), modes, eigenvalues, matrix=matrix, vibrations=modes)


@pytest.fixture(autouse=True)
def _known(monkeypatch):
    monkeypatch.setattr(branches, "point_at", at)


def test_modes_are_followed_through_a_crossing_and_their_critical_values_are_found():
    calls = []
    found = follow_modes(HERE, [0.9, 0.0, 0.15, 0.25, 0.55], lambda *said: calls.append(said))
    assert calls == [("eigenvalues", k, 5) for k in range(5)]
    values = np.array([point.value for point in found.points])
    np.testing.assert_array_equal(values, np.sort(values))
    assert set(values) >= {0.9, 0.0, 0.15, 0.25, 0.55}
    by_label = {branch.label: branch for branch in found.branches}
    assert set(by_label) == set(NAMES)
    for k, name in enumerate(NAMES):
        branch = by_label[name]
        there = np.isfinite(branch.eigenvalues)
        np.testing.assert_allclose(branch.eigenvalues[there], [exact(p)[k] for p in branch.values[there]], rtol=1e-10)
        assert branch.values[~there].tolist() == [0.15]
    # The third oscillates as long as its damping leaves it, ω² > 0.4².
    assert max(by_label["Tz"].values) < 0.62 - 0.16 / 50 < min(values[values > max(by_label["Tz"].values)])
    critical = {each.label: each for each in found.critical}
    assert [each.label for each in found.critical] == ["X", DIVERGENCE, "Y"]
    for label, value, grows, hertz in (
        ("X", 0.3, True, abs(exact(0.3)[0].imag) / 2 / np.pi),
        (DIVERGENCE, 0.62, True, 0.0),
        ("Y", 0.7, False, abs(exact(0.7)[1].imag) / 2 / np.pi),
    ):
        each = critical[label]
        # To a part in 1e12 of the range, and what round-off of the eigenvalue leaves; a divergence to 1e-7 of the
        # largest eigenvalue, over a slope of 50/0.8.
        near = 1e-11 if label != DIVERGENCE else 1e-7 * 20 / 50
        assert each.value == pytest.approx(value, abs=near)
        assert each.destabilises is grows
        assert each.frequency_Hz == pytest.approx(hertz, rel=1e-9)
        assert (1e-13 if label == DIVERGENCE else 0.9e-12) <= each.uncertainty < 1e-10
    between = [point for point in found.points if 0.62 < point.value < 0.7]
    assert between  # to decide whether anything grows there
    assert all(point.unstable for point in between)


def test_a_mode_that_grows_between_two_values_only_is_seen(monkeypatch):
    def turning(_, p):
        matrix = matrix_at(0.5)
        rate = 0.02 - 3 * (p - 0.47) ** 2
        matrix[3, 3], matrix[4, 4] = 2 * rate, -1.0
        eigenvalues, modes = solve_modes(NAMES, MASS, matrix)
        return Point(p, np.zeros(3), modes, eigenvalues)

    monkeypatch.setattr(branches, "point_at", turning)
    found = follow_modes(HERE, [0.0, 0.3, 0.6, 0.9])
    assert [(each.label, each.destabilises) for each in found.critical] == [("X", True), ("X", False)]
    reach = np.sqrt(0.02 / 3)
    np.testing.assert_allclose([each.value for each in found.critical], [0.47 - reach, 0.47 + reach], atol=1e-10)


@pytest.mark.parametrize("drifts", [False, True])
def test_growth_that_turns_into_a_divergence_is_no_mode_that_sets_in(monkeypatch, drifts):
    # x'' + d x' + x = 0 grows for d < 0 throughout: up to d = -2 without oscillation. Beside it one that decays, and
    # one on which nothing acts, a double zero which is one to round-off alone.
    def damped(_, d):
        stiffness, damping = np.diag([1.0, 4.0, 0.0 if drifts else 9.0]), np.diag([d, 0.1, 0.0 if drifts else 0.2])
        damping[2, 0] = 0.3
        matrix = np.block([[np.zeros((3, 3)), np.eye(3)], [-stiffness, -damping]])
        eigenvalues, modes = solve_modes(NAMES, np.ones(3), matrix)
        return Point(d, np.zeros(3), modes, eigenvalues, matrix=matrix)

    monkeypatch.setattr(branches, "point_at", damped)
    (critical,) = follow_modes(HERE, [-3.0, -2.6, -1.2, -1.0]).critical
    assert (critical.label, critical.destabilises) == ("divergence", False)
    assert critical.value == pytest.approx(-2.0, abs=1e-8)  # a double root is known to the root of round-off
    (critical,) = follow_modes(HERE, [-1.0, -0.5, 1.0]).critical
    assert (critical.label, critical.destabilises) == ("X", False)
    assert critical.value == pytest.approx(0.0, abs=1e-9)


def test_a_mode_that_sets_in_as_a_divergence_ends_is_found_beside_it(monkeypatch):
    # One grows more than the other at all values: how many real parts are positive tells of neither.
    def changing(_, p):
        matrix = np.zeros((4, 4))
        matrix[:2, 2:], matrix[2:, :2] = np.eye(2), np.diag([0.5 - p, -9.0])
        matrix[2:, 2:] = np.diag([-2.0, p - 0.4])
        eigenvalues, modes = solve_modes(NAMES[:2], np.ones(2), matrix)
        return Point(p, np.zeros(2), modes, eigenvalues, matrix=matrix)

    monkeypatch.setattr(branches, "point_at", changing)
    found = follow_modes(HERE, [0.0, 1.0]).critical
    assert [(each.label, each.destabilises) for each in found] == [("Y", True), ("divergence", False)]
    np.testing.assert_allclose([each.value for each in found], [0.4, 0.5], atol=1e-6)  # a drift is below 3e-7 1/s


def points_of(names, stiffness, damping):
    """As `point_at`, of bodies of unit mass of which both are diagonal, functions of the value."""

    def at(_, p):
        n, top = len(names), np.hstack([np.zeros((len(names), len(names))), np.eye(len(names))])
        matrix = np.vstack([top, np.hstack([-np.diag(stiffness(p)), -np.diag(damping(p))])])
        eigenvalues, modes = solve_modes(names, np.ones(n), matrix)
        return Point(p, np.zeros(n), modes, eigenvalues, matrix=matrix)

    return at


@pytest.mark.parametrize("oscillates", [True, False])
def test_what_sets_in_of_shapes_in_which_a_body_yields_is_no_mode(monkeypatch, oscillates):
    # E1 decays, or creeps; S2 grows from 0.45 on, beyond what is resolved.
    points = points_of(
        ("E1", "S2"), lambda p: [4.0 if oscillates else 1.0, 100.0], lambda p: [0.2 + 5 * (not oscillates), 0.45 - p]
    )
    monkeypatch.setattr(branches, "point_at", points)
    assert follow_modes(HERE, [0.0, 0.25, 0.6, 1.0]).critical == ()


def test_a_mode_that_sets_in_within_a_divergence_is_found(monkeypatch):
    # Y diverges from 0.4 to 0.54, between two values that show nothing of it; X grows from 0.5 on.
    points = points_of(NAMES[:2], lambda p: [100.0, 4 * (p - 0.4) * (p - 0.54)], lambda p: [0.5 - p, 1.0])
    monkeypatch.setattr(branches, "point_at", points)
    found = follow_modes(HERE, [0.0, 0.3, 0.6, 0.9]).critical
    assert [(each.label, each.destabilises) for each in found] == [
        ("divergence", True),
        ("X", True),
        ("divergence", False),
    ]
    # What is below 1e-7 of the largest eigenvalue, 1e-6 1/s, is no divergence yet.
    np.testing.assert_allclose([each.value for each in found], [0.4, 0.5, 0.54], atol=4e-6)


def test_a_jump_of_the_model_is_told_by_what_grows_on_either_side(monkeypatch):
    # X grows below 0.5, and is not there beyond: Y diverges.
    points = points_of(
        NAMES[:2],
        lambda p: [100.0, 50.0 if p < 0.5 else -1.0],
        lambda p: [-0.1 if p < 0.5 else 0.5, 0.2],
    )
    monkeypatch.setattr(branches, "point_at", points)
    found = follow_modes(HERE, [0.0, 0.3, 0.7, 1.0]).critical
    assert [(each.label, each.destabilises) for each in found] == [("X", False), ("divergence", True)]
    np.testing.assert_allclose([each.value for each in found], 0.5, atol=1e-11)


def test_a_point_tells_what_grows_most():
    low, high = at(None, 0.5), at(None, 0.8)
    assert low.growth_rate == pytest.approx(0.2, rel=1e-9)
    assert low.unstable
    assert low.divergence is None
    diverges = -0.4 + np.sqrt(0.16 + 50 * 0.18)
    assert high.divergence == pytest.approx(diverges, rel=1e-12)
    assert high.growth_rate == pytest.approx(diverges, rel=1e-12)
    assert not high.neutral
    none = branches.Point(0.1, reason="none")
    assert np.isnan(none.growth_rate)
    assert (none.reason, none.unstable) == ("none", False)


def about(matrix) -> Any:
    found: Any = np.zeros(3), MASS, matrix, (1.0, 2.0), 0.5, (0.5,)
    return AboutSteady(*found)


def stability(p) -> Stability:
    return stability_of(NAMES, about(matrix_at(p)), 0.7)


def test_modes_of_an_end_are_those_of_the_start_by_their_shapes(monkeypatch):
    assert continued(HERE, stability(0.0), stability(0.01)) == [0, 1, 2]
    # X and Y change places in the order of frequency on the way, at p = 0.5.
    ends = [mode.name for mode in stability(0.55).modes]
    starts = [mode.name for mode in stability(0.25).modes]
    monkeypatch.setattr(branches, "point_at", lambda _, s: at(None, 0.25 + 0.3 * s))
    assert continued(HERE, stability(0.25), stability(0.55)) == [starts.index(name) for name in ends]
    assert ends != starts


# --- modes -----------------------------------------------------------------------------------------------------------


def test_a_stability_is_what_was_found_about_it():
    found = stability(0.45)
    assert (found.coordinates, found.pressure_range, found.contact_fraction, found.time) == (
        NAMES,
        (1.0, 2.0),
        0.5,
        0.7,
    )
    assert found.contact_fractions == (0.5,)
    assert [mode.name for mode in found.unstable] == ["X", "Y"]
    largest = np.sort(np.abs(exact(0.45).imag))[-1] / 2 / np.pi
    assert found.highest_frequency_Hz == pytest.approx(largest, rel=1e-12)
    ratio = {mode.name: mode.damping_ratio for mode in found.modes}
    for k, name in enumerate(NAMES):
        assert ratio[name] == pytest.approx(damping(0.45)[k] / 2 / np.sqrt(stiffness(0.45)[k]), rel=1e-9)
    some = found.over(("Tz", "X"))
    assert (some.coordinates, [mode.name for mode in some.modes]) == (("Tz", "X"), ["Tz", "X"])
    np.testing.assert_array_equal(some.mass, MASS[[2, 0]])
    np.testing.assert_array_equal(some.matrix, found.matrix[np.ix_([2, 0, 5, 3], [2, 0, 5, 3])])
    for mode in some.modes:
        np.testing.assert_allclose(some.matrix @ mode.right, mode.eigenvalue * mode.right, atol=1e-12)
    with pytest.raises(SteadyStateError, match=str(NoSteadySliding.NOT_FINITE)[:20]):
        stability_of(NAMES, about(np.full((6, 6), np.nan)))


def test_eigenvectors_are_scaled_to_the_named_coordinate_and_to_each_other():
    random = np.random.default_rng(2)
    matrix = matrix_at(0.4) + 0.3 * np.vstack([np.zeros((3, 6)), random.uniform(-1, 1, (3, 6))])
    modes = solve_modes(NAMES, MASS, matrix)[1]
    for mode in modes:
        k = NAMES.index(mode.name)
        assert k == np.argmax(np.abs(mode.right[:3]) * np.sqrt(MASS))
        assert mode.right[k] == pytest.approx(1.0)
        assert np.vdot(mode.left, mode.right) == pytest.approx(1.0)
        np.testing.assert_allclose(matrix @ mode.right, mode.eigenvalue * mode.right, atol=1e-10)
        np.testing.assert_allclose(matrix.T @ mode.left, np.conj(mode.eigenvalue) * mode.left, atol=1e-9)
    assert [mode.eigenvalue.imag for mode in modes] == sorted(mode.eigenvalue.imag for mode in modes)
    values, right, left = eigensystem(matrix)
    np.testing.assert_allclose(left.conj().T @ right, np.eye(6), atol=1e-12)
    own = np.array([int(np.argmin(np.abs(values - mode.eigenvalue))) for mode in modes])
    overlap = overlap_of(modes, right, left)
    np.testing.assert_allclose(overlap, np.eye(6)[own], atol=1e-10)
    # Two more of one name are numbered; what has no damping is a mode of stiffness and mass alone.
    found = [Mode("", "", 1j, False, np.array([1, 0.1, 0.1, 0, 0, 0], complex), np.ones(6, complex))] * 3
    assert [mode.label for mode in name_modes(NAMES, MASS, found)] == ["X", "X (2)", "X (3)"]
    bare = undamped_modes(NAMES, MASS, matrix_at(0.5))
    np.testing.assert_allclose([mode.eigenvalue for mode in bare], 1j * np.sqrt(np.sort(stiffness(0.5))), atol=1e-9)


def stability_about(stiffness: np.ndarray, damping: np.ndarray) -> Stability:
    """About steady sliding of unit masses X, Y and Tz."""
    matrix = np.block([[np.zeros((3, 3)), np.eye(3)], [-stiffness, -damping]])
    about = AboutSteady(np.zeros(3), np.ones(3), matrix, (np.zeros(()), np.zeros(())), np.ones(()), ())  # pyright: ignore[reportArgumentType]
    return stability_of(NAMES, about)


@pytest.mark.parametrize(
    ("drag", "own", "labels"), [(0.1, ["X", "Y", "Tz"], ["X", "Y", "Tz"]), (9.0, ["X", "Tz"], ["X", "Tz", "Y"])]
)
def test_what_damping_keeps_from_oscillating_is_among_what_may_vibrate(drag, own, labels):
    # X, Y and Tz at 1, 2 and 3 rad/s; beyond 4 1/s Y creeps.
    stability = stability_about(np.diag([1.0, 4.0, 9.0]), np.diag([0.1, drag, 0.1]))
    assert [mode.label for mode in stability.oscillations] == own
    assert [mode.label for mode in stability.vibrations] == labels
    assert stability.vibrations[labels.index("Y")].eigenvalue.imag == pytest.approx(2.0, rel=1e-2)


@pytest.mark.parametrize("creeping", [0, 1, 2])
def test_what_creeps_is_known_by_its_shape_where_two_modes_have_one_name(creeping):
    # X is the largest part of the first two, at 1 and 2 rad/s.
    s = np.sqrt(0.5)
    shapes = np.array([[s, s, 0], [0.5, -0.5, s], [0.5, -0.5, -s]])
    drag = np.where(np.arange(3) == creeping, 9.0, 0.1)
    stability = stability_about(shapes * [1, 4, 9] @ shapes.T, shapes * drag @ shapes.T)
    assert [mode.name for mode in undamped_modes(NAMES, np.ones(3), stability.matrix)].count("X") == 2
    assert len(stability.oscillations) == 2
    assert sorted(mode.eigenvalue.imag for mode in stability.vibrations) == pytest.approx([1, 2, 3], rel=2e-3)
    # Disturbances are told apart by the labels of their modes.
    assert len({mode.label for mode in stability.vibrations}) == 3


def test_what_nothing_holds_does_not_vibrate():
    # Three masses in a row between two springs, drawn from the generator's first hundred: round-off makes of the
    # double zero of their common motion now two real numbers, now an oscillation.
    draw = np.random.default_rng(1)
    for _ in range(100):
        (a, b), mass = draw.uniform(0.5, 2, 2) * 1e6, draw.uniform(0.5, 2, 3)
        stiffness = np.array([[a, -a, 0], [-a, a + b, -b], [0, -b, b]]) / mass[:, None]
        stability = stability_about(stiffness, np.diag(draw.uniform(10, 300, 3)))
        assert len(stability.oscillations) == 2
        assert stability.vibrations == stability.oscillations


def test_only_what_is_real_and_stands_out_of_round_off_grows_without_oscillation():
    assert growing_without_oscillation(np.array([3.0, 2.0, -9.0, 100j])) == 3.0
    assert growing_without_oscillation(np.array([3.0 + 1j, -9.0, 100j])) is None
    assert growing_without_oscillation(np.array([1e-6, -9.0, 100j])) is None  # of a drift
    assert growing_without_oscillation(np.array([2e-5, 100j])) == 2e-5


# --- many sets of numbers --------------------------------------------------------------------------------------------


def test_each_coordinate_has_the_two_eigenvalues_that_hold_most_of_its_kinetic_energy():
    # Three that hardly feel each other; of the light one displacements are largest in every mode of the others.
    coupled = matrix_at(0.45)
    coupled[5, 0] = 900.0  # Tz follows X some ten times as far, with a seventieth of its mass
    eigenvalues, right = np.linalg.eig(coupled)
    order = np.array([4, 1, 5, 0, 3, 2])
    eigenvalues, right = eigenvalues[order], right[:, order]
    found = _own(eigenvalues, right, MASS)
    np.testing.assert_allclose(found, exact(0.45), rtol=1e-9)
    drifts = np.array([[0.0, 1e-9, 2e-6, 5j, -5j, 1.0]])
    spectrum = EigenvalueSet(NAMES, MASS[None], np.zeros((1, 3, 3)), drifts, right[None], found[None])
    np.testing.assert_array_equal(spectrum.of("Y"), found[[1]])
    assert spectrum.drifting.tolist() == [[True, True, False, False, False, False]]
    # Without oscillation it is the least stable one, but for a drift.
    assert _informative(np.array([-3.0 + 0j, -0.5 + 0j]), 10.0) == -0.5
    assert _informative(np.array([1e-9 + 0j, -0.5 + 0j]), 10.0) == -0.5
    assert _informative(np.array([1e-9 + 0j, -1e-9 + 0j]), 10.0) == 0
    # Both are measured against the largest: an imaginary part of 1e-9 of it is none, and a drift is 1e-7 of it.
    assert _informative(np.array([-3.0 - 4e-6j, -1.0 + 4e-6j]), 1e4) == -1.0 + 4e-6j
    assert _informative(np.array([4e-4 + 0j, -0.5 + 0j]), 1e4) == -0.5


def test_spectra_of_many_sets_are_those_of_each(monkeypatch):
    matrices, scene = np.stack([matrix_at(0.45), matrix_at(0.25)]), cast("Any", "scene")
    for each in matrices:
        each[5, 0] = 900.0
    linear = SimpleNamespace(mass=np.stack([MASS, MASS]), damping=np.zeros((2, 3, 3)))
    for name, stub in {
        "check_shapes_stay": lambda *_: None, "_as_arrays": lambda _: {"b": 1.0}, "_kind": lambda _: ("kind", ()),
        "linear_coordinates": lambda _: NAMES,
        "_linear_models": lambda *_: (linear, matrices),
    }.items():  # fmt: skip
        monkeypatch.setattr(family, name, stub)
    found = family.spectra_of(scene, {"a": np.array([1.0, 2.0])})
    np.testing.assert_allclose(found.own, [exact(0.45), exact(0.25)], rtol=1e-9)
    np.testing.assert_array_equal(found.mass, linear.mass)
    for matrix, values, right in zip(matrices, found.eigenvalues, found.right, strict=True):
        np.testing.assert_allclose(matrix @ right, right * values, atol=1e-9)


def test_what_moves_what_is_read_in_coordinates_of_one_unit(monkeypatch):
    mass = np.array([4.0, 1e-4, 1.0])
    stiffness = np.array([[8.0, 1e-12, 0.0], [2e-10, 3e-4, 0.0], [0.0, 0.0, 5e-11]])
    damping = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 0.0], [1e-9, 0.0, 0.0]])
    monkeypatch.setattr(steady, "linear_model", lambda _: (None, Linear(mass, damping, stiffness)))
    # Over √(m_i m_j) the largest are 3/s² and 1/s: 2e-10/0.02 counts beside them, 1e-12/0.02 and 5e-11 do not.
    scaled = np.sqrt(np.outer(mass, mass))
    wanted = (np.abs(stiffness) / scaled > 1e-10 * 3) | (np.abs(damping) / scaled > 1e-10 * 1)
    np.testing.assert_array_equal(steady.coupling(HERE), wanted)
    assert wanted.tolist() == [[True, False, True], [True, True, False], [True, False, False]]
    matrix = Linear(mass, damping, stiffness).state_matrix()
    np.testing.assert_array_equal(matrix[:3], np.eye(6)[3:])
    np.testing.assert_allclose(matrix[3:], -np.hstack([stiffness, damping]) / mass[:, None])


def test_a_free_motion_is_named_by_the_coordinates_that_it_moves_by_a_tenth_at_least(nominal):
    """In coordinates of one unit, by the root of their mass; steady sliding balanced in each of them."""
    scene = nominal.with_values({"support": None, "steady.state": "self-consistent"})
    model = build_model(scene)
    root, free = np.sqrt(np.asarray(model.mass)), np.array([0.08, 1.0, 0.13])
    held = np.eye(3) - np.outer(free, free) / (free @ free)
    with pytest.raises(SteadyStateError, match="it moves freely in Y and Tz; add a spring"):
        steady.check_held(dataclasses.replace(model, stiffness=held * np.outer(root, root)))
    steady.check_held(dataclasses.replace(model, stiffness=np.eye(3)))


def test_a_gradient_is_that_of_the_eigenvalue():
    direction = np.random.default_rng(7).uniform(-1, 1, (2, 6, 6))
    values, right, left = eigensystem(matrix_at(0.45))
    for k in range(6):
        found = eigenvalue_gradient(left[:, k], right[:, k], direction)
        for each, of in zip(found, direction, strict=True):
            after, before = (np.linalg.eigvals(matrix_at(0.45) + step * of) for step in (1e-6, -1e-6))
            moved = after[np.argmin(np.abs(after - values[k]))] - before[np.argmin(np.abs(before - values[k]))]
            assert each == pytest.approx(moved / 2e-6, rel=1e-5)


def test_why_there_is_no_steady_sliding_is_read_off_the_path(monkeypatch):
    law = ExponentialLaw(0.5, 0.3, 2.0)
    contact = SimpleNamespace(friction=SimpleNamespace(law=law), radius=0.1)
    operation = SimpleNamespace(at=lambda time: SimpleNamespace(drum_speed=-2.0))
    model: Any = SimpleNamespace(contact=contact, operation=operation, sides=(1,))

    def why(*, runs_off, rests, sides=(1,)):
        model.sides, still = sides, np.zeros(2) if rests else np.full(2, np.nan)
        found = SimpleNamespace(runs_off=runs_off, fraction=0.4, frictionless=still)
        monkeypatch.setattr(steady, "raise_friction", lambda _, factor: found if factor == 1 else None)
        return str(steady.no_steady_sliding(model))

    # Of μ at 0.2 m/s two fifths.
    said, here = why(runs_off=True, rests=True), 0.3 + 0.2 * np.exp(-0.4)
    assert f"begins at a coefficient of friction of {0.4 * here:.4g}, and at 0.2 m/s the scene has {here:.4g}" in said
    assert "begins at 40 % of the friction" in why(runs_off=True, rests=True, sides=(1, 2))
    assert why(runs_off=False, rests=True).startswith(str(NoSteadySliding.NOT_FOUND)[:30])
    assert why(runs_off=False, rests=False).startswith(str(NoSteadySliding.PULLED_OFF)[:30])


def test_shapes_are_alike_by_their_displacements_in_the_mass_metric():
    rng, mass = np.random.default_rng(3), np.array([2.0, 0.5, 7.0])
    shape, others = (rng.normal(size=(3, k)) + 1j * rng.normal(size=(3, k)) for k in (1, 4))
    others[:, 2] = (2 - 3j) * shape[:, 0]
    found = assurance(mass, shape[:, 0], others)
    a, b = np.sqrt(mass)[:, None] * shape, np.sqrt(mass)[:, None] * others
    np.testing.assert_allclose(found, np.abs(a[:, 0].conj() @ b) / (np.linalg.norm(a) * np.linalg.norm(b, axis=0)))
    assert found[2] == pytest.approx(1.0)


def test_modes_are_matched_by_the_largest_sum_of_overlaps():
    overlap = np.array([[0.6, 0.5, 0.1], [0.7, 0.2, 0.3]])
    assert matched(overlap) == {0: 1, 1: 0}  # 1.2 in all, and not 0.6 + 0.3
    assert matched(overlap, 0.5) == {0: 1, 1: 0}
    assert matched(overlap, 0.51) == {1: 0}
