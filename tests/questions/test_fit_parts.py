"""The parts of a fit one by one: stretches, envelopes, drifts, assignments, what stays known of numbers."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy

from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.findings.signals.growth import Exponentials
from drumsqueal.questions.compare.record import Measured
from drumsqueal.questions.fit import estimate as estimate_module
from drumsqueal.questions.fit import record, squeal
from drumsqueal.questions.fit import squeal as squeal_module
from drumsqueal.questions.fit import study as study_module
from drumsqueal.questions.fit.estimate import (
    PERCENT_95,
    Eigenmodes,
    Scale,
    _choices,
    _left,
    _loose,
    assess,
    assign,
    estimate,
    fit_lines,
)
from drumsqueal.questions.fit.record import RecordKind, RecordLine
from drumsqueal.questions.fit.squeal import SimulatedSqueal, Varied, _Lines, _Work, pair_squeal, started

RATE = 5000.0
RNG = np.random.default_rng(12)


def measured(values: np.ndarray, start: float = 2.0) -> Measured:
    return Measured("mic", "Pa", RATE, start, values, ())


def test_of_a_long_record_the_stretch_about_its_largest_value_is_taken(monkeypatch):
    monkeypatch.setattr(record, "LONGEST", 100)
    values = RNG.normal(size=1000) * 0.1
    for hit, first in ((500, 450), (10, 0), (990, 900)):
        loud = values.copy()
        loud[hit] = -9.0
        found, begins = record._strongest_stretch(measured(loud))
        np.testing.assert_array_equal(found, loud[first : first + 100])
        assert begins == pytest.approx(2.0 + first / RATE)
    found, begins = record._strongest_stretch(measured(values[:100]))
    assert (found.size, begins) == (100, 2.0)
    for size in (0.9e-100, 1.1e100):
        with pytest.raises(RequestError, match="too little or too much"):
            record._strongest_stretch(measured(np.array([0.0, size])))


def test_an_envelope_is_a_mean_over_five_periods_of_the_strongest_line():
    time = np.arange(5000) / RATE
    values = 0.2 * np.sin(2 * np.pi * 100 * time) + np.sin(2 * np.pi * 40 * time) + 9 * np.sin(2 * np.pi * 5 * time)
    assert record._block("mic", values, RATE) == round(5 * RATE / 40)
    assert record._block("mic", np.sin(2 * np.pi * 2000 * time), RATE) == 16
    assert record._block("mic", values[: 8 * 625], RATE) == 625
    with pytest.raises(RequestError, match="take at least 1 s"):
        record._block("mic", values[: 8 * 625 - 1], RATE)
    with pytest.raises(RequestError, match="too low for sound"):
        record._block("mic", values, 40.0)
    signal = RNG.normal(size=103) + 3.0
    rms = [np.sqrt(np.mean((signal[k : k + 10] - signal.mean()) ** 2)) for k in range(0, 100, 10)]
    np.testing.assert_allclose(record._envelope(signal, 10), rms)


def test_parts_that_may_be_linear_are_the_whole_a_ring_down_and_growth_and_decay_about_the_loudest():
    block, noise = 20, np.tile([1.0, -1.0], 10)
    # Growth by e^0.1 a block, 40 blocks as loud as it gets, decay by e^0.2 a block.
    envelope = np.concatenate([np.exp(0.1 * np.arange(-40, 0)), np.ones(40), np.exp(-0.2 * np.arange(1, 31))])
    values = np.concatenate([size * noise for size in envelope])
    found = list(record._candidates(values, block))
    assert found[0] == (slice(0, values.size), "whole")
    wanted = []
    for level in (0.35, 0.25, 0.15, 0.1):
        above = np.flatnonzero(envelope > level)
        parts = ((slice(0, above[0]), "growth"), (slice(above[-1] + 1, 110), "decay"))
        padded = np.pad(envelope, 1, mode="edge")
        smooth = (padded[:-2] + padded[1:-1] + padded[2:]) / 3
        for part, what in parts:
            if len(smooth[part]) >= 8 and smooth[part].max() >= 5 * smooth[part].min():
                wanted.append((slice(int(part.start) * block, int(part.stop) * block), what))
    assert found[1:] == wanted
    assert {what for _, what in wanted} == {"growth", "decay"}
    # A blow after a while: the record begins with it, where the last third is less than half as loud as the first.
    ring = np.concatenate([0.01 * np.tile(noise, 10), 5 * np.exp(-np.arange(2000) / 400) * np.tile(noise, 100)])
    assert next(record._candidates(ring, block)) == (slice(200, 2200), "whole")
    assert next(record._candidates(ring[::-1], block)) == (slice(0, 2200), "whole")


def test_exponentials_explain_a_part_where_they_leave_little_beside_noise_and_as_little_at_its_ends():
    values, noise = np.tile([1.0, -1.0], 1000), np.tile([1.0, 1.0, -1.0, -1.0], 500)
    for left, explained in ((0.019, True), (0.021, False)):
        rest = noise * np.where(np.arange(2000) < 1500, left, 1e-3)
        assert record._explained(values, rest, 20) == explained
    rest = noise * np.where(np.arange(2000) < 80, 0.5, 1e-3)
    assert record._explained(values, rest, 20)  # in 4 of 100 blocks
    assert not record._explained(values, noise * np.where(np.arange(2000) < 120, 0.5, 1e-3), 20)
    rest = noise * np.where(np.arange(2000) < 1000, 0.059, 0.03)
    assert record._explained(values, rest, 20)  # twice what is left of a tenth of the blocks is noise
    assert not record._explained(values, noise * np.where(np.arange(2000) < 1000, 0.061, 0.03), 20)
    # The last (or first) quarter may leave 1.25 times the rest before and a hundredth of its own envelope.
    for end, alike in ((0.0159, True), (0.0162, False)):
        rest = noise * np.where(np.arange(2000) < 1500, 0.01, end)
        limit = math.sqrt((1.25 * 0.01) ** 2 + 0.01**2)
        assert (end < limit) == alike
        assert record._ends_alike(values, rest, 20, at_end=True) == alike
        assert record._ends_alike(values, rest[::-1], 20, at_end=False) == alike
        assert record._ends_alike(values, rest, 20, at_end=False)


def exponentials(*rows: tuple[float, float, float, float]) -> Exponentials:
    f, df, s, ds = np.array(rows).T if rows else np.zeros((4, 0))
    return Exponentials(f, df, s, ds, np.ones(len(rows)), np.zeros(3))


def test_a_line_drifts_by_half_of_what_its_parts_differ_beyond_noise():
    first, second = exponentials((50.0, 9, 9, 9), (100.0, 0.3, -4.0, 0.1)), exponentials((100.8, 0.1, -5.0, 0.4))
    limit = 3 * math.hypot(0.3, 0.1)
    assert limit > 0.8
    assert record._drift(100.0, [first, second]) == (0.0, 0.0)
    second = exponentials((100.99, 0.1, -5.5, 0.4))
    assert record._drift(100.0, [first, second]) == pytest.approx((0.99 / 2, 1.5 / 2))
    assert record._drift(100.0, [first, exponentials((101.1, 0.1, -5.5, 0.4))]) == (0.0, 0.0)
    assert record._drift(100.0, [first, exponentials()]) == (0.0, 0.0)


def test_lines_of_small_vibration_have_uncertainties_of_noise_clock_steadiness_and_drift(monkeypatch):
    whole = Exponentials(*(np.array([each]) for each in (200.0, 0.02, -30.0, 0.4, 7.0)), np.zeros(3))  # pyright: ignore[reportCallIssue]
    halves = [exponentials((199.8, 0.01, -29.0, 0.1)), exponentials((200.4, 0.02, -33.0, 0.2))]
    asked = []

    def find(piece, rate, lowest):
        asked.append(piece.size)
        assert (rate, lowest) == (RATE, 20.0)
        return [whole, *halves][len(asked) - 1]

    monkeypatch.setattr(record, "find_exponentials", find)
    found = record._linear(np.arange(1000.0), RATE, slice(300, 800), 2.0, "growth")
    assert found is not None
    assert asked == [500, 300, 300]
    (line,) = found.lines
    assert (line.frequency_Hz, line.growth_rate_1_per_s, line.amplitude) == (200.0, -30.0, 7.0)
    assert line.frequency_uncertainty_Hz == pytest.approx(math.hypot(0.02, 200e-5, 0.3))
    omega = 2 * np.pi * 200
    assert line.growth_rate_uncertainty_1_per_s == pytest.approx(math.hypot(0.4, 1e-6 * omega, 2.0, 30e-5))
    assert (found.kind, found.from_s, found.until_s) == (RecordKind.LINEAR, 2.0 + 300 / RATE, 2.0 + 799 / RATE)
    assert found.values.size == 500
    assert found.reason == "the record grows exponentially up to there: small vibration before it saturates"


def line(
    f: float, df: float = 0.1, rate: float | None = None, drate: float | None = None, size: float = 1.0
) -> RecordLine:
    return RecordLine(
        frequency_Hz=f, frequency_uncertainty_Hz=df, growth_rate_1_per_s=rate, growth_rate_uncertainty_1_per_s=drate,
        amplitude=size,
    )  # fmt: skip


def test_a_line_is_explained_by_multiples_combinations_and_sidebands_of_stronger_ones():
    kept = [100.0, 271.0]
    for f, explained in (
        (300.4, True), (300.6, False), (109.0, True), (91.0, True), (111.0, False), (371.4, True), (171.4, True),
        (442.0, True), (4 * 100 + 2 * 271.0, True), (5 * 100 + 2 * 271.0, False), (7 * 100.0, True),
    ):  # fmt: skip
        assert record._explained_by(f, kept, 0.5) == explained, f


def test_a_record_saturates_where_it_stays_as_large_and_has_harmonics():
    time = np.arange(20000) / RATE
    pure = np.sin(2 * np.pi * 100 * time) + 1e-3 * RNG.normal(size=time.size)
    rich = pure + 0.2 * np.sin(2 * np.pi * 200 * time)
    block = record._block("mic", rich, RATE)
    assert record._saturates(rich, RATE, block)
    assert not record._saturates(pure, RATE, block)
    assert not record._saturates(rich * np.linspace(0.1, 1.0, time.size), RATE, block)
    assert record._saturates(rich * np.linspace(0.3, 1.0, time.size), RATE, block)


def test_measured_lines_go_with_simulated_ones_by_frequency_and_level():
    simulated = [line(100.0, size=4.0), line(130.0, size=4e-4), line(300.0, size=1.0)]
    found = pair_squeal([line(118.0, size=8.0), line(390.0, size=2.0), line(128.0, size=0.1)], simulated)
    # 118 Hz is nearer to 130 Hz, but 80 dB louder than that; within 30 % of each other.
    assert found == (0, None, 1)


# --- assignments and estimates ---------------------------------------------------------------------------------------


class Modes:
    """Modes at 100, 200 and 400 Hz times powers of two numbers, as `Eigenmodes` has them."""

    modes = tuple(SimpleNamespace(frequency_Hz=f) for f in (100.0, 200.0, 400.0))
    powers = np.array([[0.5, 0.0], [0.0, 0.5], [0.25, 0.25]])
    before = np.array([3.0, 5.0])

    def at(self, p: np.ndarray) -> Any:
        f = np.array([100.0, 200.0, 400.0]) * np.prod((p / self.before) ** self.powers, axis=1)
        rate = np.array([-3.0, 4.0, -5.0]) * p[0]
        slopes = 2j * np.pi * f[:, None] * self.powers / p
        slopes[:, 0] += np.array([-3.0, 4.0, -5.0])
        return SimpleNamespace(eigenvalues=rate + 2j * np.pi * f, gradients=slopes)


def test_numbers_are_fitted_to_frequencies_and_rates_by_their_uncertainties():
    scale = Scale.of(("a", "b"), Modes.before.tolist())
    truth = Modes().at(np.array([3.6, 4.0])).eigenvalues
    lines = [line(each.imag / (2 * np.pi), 0.1 * (k + 1), each.real, 0.3) for k, each in enumerate(truth)]
    del lines[1:2]
    found = fit_lines(lines, [0, 2], Modes(), scale)  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(scale.numbers(found.x), [3.6, 4.0], rtol=1e-9)
    assert found.freedom == 2
    # Inverse of JᵀJ of f₀, f₂, σ₀, σ₂ over their uncertainties.
    f = truth.imag / (2 * np.pi)
    rows = [
        f[0] * np.array([0.5, 0]) / 0.1,
        f[2] * np.array([0.25, 0.25]) / 0.3,
        np.array([-3 * 3.6, 0]) / 0.3,
        np.array([-5 * 3.6, 0]) / 0.3,
    ]
    np.testing.assert_allclose(found.covariance, np.linalg.inv(np.transpose(rows) @ rows), rtol=1e-6)
    moved = fit_lines([line(110.0), line(500.0, 0.2)], [0, 2], Modes(), scale)  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(moved.x, np.linalg.solve(Modes.powers[[0, 2]], np.log([1.1, 1.25])), rtol=1e-9)


def test_lines_are_assigned_in_order_at_the_least_cost():
    scale = Scale.of(("a", "b"), Modes.before.tolist())
    lines = [line(420.0, rate=-15.0, drate=1.0, size=3.0), line(105.0, rate=-9.0, drate=1.0), line(9000.0, size=0.5)]
    found = assign(lines, Modes(), scale, [True, False, True])  # pyright: ignore[reportArgumentType]
    assert found.modes == (2, 0, None)
    loose = [_loose(each) for each in lines[:2]]
    fitted = fit_lines(loose, [2, 0], Modes(), scale)  # pyright: ignore[reportArgumentType]
    missed = 25 * (0.5 / 3.0) ** 0.25
    assert found.cost == pytest.approx(missed + fitted.chi_square + np.sum((fitted.x / 0.5) ** 2))
    assert found.rival is None
    assert _left((2, None, 1), [1.0, 2.0, 4.0], [True, False, True]) == 2.0 + 6.0
    assert loose[0].frequency_uncertainty_Hz == pytest.approx(math.hypot(0.1, 4.2))
    assert loose[0].growth_rate_uncertainty_1_per_s == pytest.approx(math.hypot(1.0, 0.3 * 15 + 10))
    assert _loose(line(100.0)).growth_rate_uncertainty_1_per_s is None
    # Lines as one writes them, modes rising: in order, and within 0.4 of log frequency.
    choices = set(_choices(np.array([210.0, 100.0]), np.array([100.0, 140.0, 400.0])))
    assert choices == {(None, None), (None, 0), (None, 1)}  # ln 210/140 is 0.405
    choices = set(_choices(np.array([208.0, 100.0]), np.array([100.0, 140.0, 400.0])))
    assert choices == {(None, None), (None, 0), (None, 1), (1, None), (1, 0)}


def test_an_estimate_widens_by_its_misfit_and_names_what_is_open():
    scale = Scale.of(("a", "b", "damping.ratio"), [2.0, 5.0, 0.0])
    np.testing.assert_allclose(scale.numbers(np.array([0.1, -0.2, 3.0])), [2 * np.exp(0.1), 5 * np.exp(-0.2), 0.03])
    np.testing.assert_allclose(scale.slopes(np.array([0.1, -0.2, 3.0])), [2 * np.exp(0.1), 5 * np.exp(-0.2), 0.01])
    low, high = scale.bounds
    np.testing.assert_allclose([low, high], [[-np.log(20), -np.log(20), -1e-9], [np.log(20), np.log(20), 100.0]])
    ends = np.array([np.log(20) - 0.9e-3, -np.log(20) + 1.1e-3, 0.0])
    assert scale.at_bound(ends).tolist() == [True, False, False]
    jacobian = np.array([[10.0, 0.0, 0.0], [0.0, 1.0, 0.0], [3.0, 0.0, 20.0], [0.0, 0.0, 9.0], [1.0, 0.0, 4.0]])
    small = np.array([0.3, 0.0, 0.2, 0.1, 0.1])
    found = assess(small, jacobian, np.zeros(3), scale)
    assert (found.freedom, found.chi_square, found.factor_95) == (3, pytest.approx(0.15), PERCENT_95)
    np.testing.assert_allclose(np.abs(found.open), [[0, 1, 0]], atol=1e-12)
    assert found.determined.tolist() == [True, False, True]
    inner = np.linalg.inv((jacobian.T @ jacobian)[np.ix_([0, 2], [0, 2])])
    np.testing.assert_allclose(found.covariance[np.ix_([0, 2], [0, 2])], inner)
    assert found.covariance[1, 1] == pytest.approx(1.0)
    wide = assess(8 * small, jacobian, np.zeros(3), scale)
    np.testing.assert_allclose(wide.covariance[0, 0], inner[0, 0] * 9.6 / 3)
    assert wide.factor_95 == pytest.approx(3.18245, abs=1e-5)  # Student's t of 3 degrees of freedom
    assert (wide.chi_square_per_freedom, wide.missed) == (pytest.approx(3.2), False)
    np.testing.assert_allclose(wide.errors, np.sqrt(np.diag(wide.covariance)))
    exact = estimate(lambda x: (np.array([x[0] - 0.2]), np.array([[1.0, 0.0]])), Scale.of(("a", "b"), [1.0, 1.0]))
    assert exact.x[1] == pytest.approx(0.0, abs=1e-9)


def test_eigenvalues_are_those_of_the_modes_they_are_most_like_with_their_derivatives(monkeypatch):
    modes = Eigenmodes.__new__(Eigenmodes)
    modes._mass = np.array([2.0, 0.5])
    rights = np.array([[1.0, 0.1], [0.2, 1.0]])
    modes.modes = tuple(
        SimpleNamespace(right=np.array([*each, 0, 0]), label=f"mode {k}") for k, each in enumerate(rights)
    )  # pyright: ignore[reportAttributeAccessIssue]
    matrix = RNG.normal(size=(4, 4))
    springs = np.array([[50.0, 3.0], [-6.0, 90.0]])
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-springs, -np.diag([0.3, 0.1])]])
    derivatives = RNG.normal(size=(3, 4, 4))
    modes._evaluate = lambda numbers: (matrix, derivatives)
    found = modes.at(np.zeros(3))
    assert (found.eigenvalues.imag > 0).all()
    values, left, right = scipy.linalg.eig(matrix, left=True)
    for value, gradient in zip(found.eigenvalues, found.gradients, strict=True):
        k = int(np.argmin(np.abs(values - value)))
        wanted = [left[:, k].conj() @ d @ right[:, k] / (left[:, k].conj() @ right[:, k]) for d in derivatives]
        np.testing.assert_allclose(gradient, wanted)
        assert value == pytest.approx(values[k])
    assert found.eigenvalues[0].imag < found.eigenvalues[1].imag
    modes.modes = modes.modes[::-1]
    np.testing.assert_array_equal(modes.at(np.zeros(3)).eigenvalues, found.eigenvalues[::-1])
    assert modes.labels == ("mode 1", "mode 0")
    modes._evaluate = lambda numbers: (matrix * np.nan, derivatives)
    lost = modes.at(np.zeros(3))
    assert (lost.gradients.shape, np.isnan(lost.eigenvalues).all()) == ((2, 3), True)
    assert estimate_module.LEAST < 1e-9


# --- squeal ----------------------------------------------------------------------------------------------------------


def squeal_of(*frequencies: float, error: float = 0.01) -> SimulatedSqueal:
    return SimulatedSqueal(tuple(line(f, error) for f in frequencies), np.zeros(3), None)  # pyright: ignore[reportArgumentType]


def test_a_squeal_is_followed_bit_by_bit_and_its_lines_found_where_they_are_expected(monkeypatch):
    walked = []

    def simulate(at, signal, progress):
        walked.append(np.round(at, 9).tolist())
        return squeal_of(100.0 * (1 + at[0]), 210.0, 150.0)._replace(scene=at)

    monkeypatch.setattr(squeal_module, "simulate", simulate)
    run = Varied(lambda scene, x: x, Scale.of(("a", "b"), [1.0, 1.0]), "so", None)  # pyright: ignore[reportArgumentType]
    work = _Work(run, [line(101.0, 0.4), line(212.0, 0.3)])
    here = _Lines.of(np.array([0.0, 0.1]), [line(100.0, 0.3), line(210.0, 0.4)], squeal_of(100.0, 210.0))
    there = work.lines(here, np.array([0.12, 0.1]), np.array([112.0, 211.0]))
    assert there is not None
    assert walked == [[0.04, 0.1], [0.08, 0.1], [0.12, 0.1]]
    np.testing.assert_allclose(there.frequency, [112.0, 210.0])
    assert work.transients == 4
    np.testing.assert_allclose(work.spread(here), [0.5, 0.5])
    assert work.misfit(here) == pytest.approx((1.0**2 + 2.0**2) / 0.25)
    assert work.lines(here, np.array([3.1, 0.1]), here.frequency) is None
    assert work.lines(here, np.array([0.02, 0.1]), np.array([80.0, 210.0])) is None

    # With numbers far from the scene's own a transient may fail: the search ends there.
    def fails(*_):
        raise IntegrationError("so")

    with monkeypatch.context() as patch:
        patch.setattr(squeal_module, "simulate", fails)
        assert work.lines(here, np.array([0.02, 0.1]), here.frequency) is None
    # A derivative below three times its error is none, and is noted as what may be there.
    found = work.derivatives(here)
    np.testing.assert_allclose(found, [[100.0, 0.0], [0.0, 0.0]], atol=1e-9)
    assert (work.faint > 0).tolist() == [True, True]


def test_a_scene_is_started_on_a_motion(nominal):
    scene = started(nominal, ("X", "Tz"), np.array([1e-6, 2e-6]), np.array([3e-3, 4e-3]))
    assert scene.start.displacement == {"X": 1e-6, "Tz": 2e-6}
    assert scene.start.velocity == {"X": 3e-3, "Tz": 4e-3}


# --- what is reported ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (123456.0, 70.0, "1.2346e+05"),
        (123456.0, 1500.0, "1.23e+05"),
        (0.3, 0.2, "0.3"),
        (2 / 3, None, "0.666667"),
        (2 / 3, 1e-12, "0.6666666667"),
    ],
)
def test_a_number_has_one_digit_more_than_its_uncertainty_leaves(value, uncertainty, text):
    assert f"{value:.{study_module._digits(value, uncertainty)}g}" == text


def test_a_line_is_reported_with_its_mode_before_and_after():
    before, after = np.array([-1 + 600j, 2 + 1200j]), np.array([-3 + 660j, 4 + 1320j])
    found = study_module._mode_line(line(201.0, 0.5, -2.0, 0.25), 1, ("X", "Y"), before, after)
    assert (found.measured_Hz, found.uncertainty_Hz, found.mode) == (201.0, PERCENT_95 * 0.5, "Y")
    assert (found.before_Hz, found.after_Hz) == pytest.approx((1200 / (2 * np.pi), 1320 / (2 * np.pi)))
    assert (found.before_growth_rate_1_per_s, found.after_growth_rate_1_per_s) == (2.0, 4.0)
    assert (found.measured_growth_rate_1_per_s, found.growth_rate_uncertainty_1_per_s) == (-2.0, PERCENT_95 * 0.25)
    assert study_module._mode_line(line(201.0), None, ("X", "Y"), before, after).mode is None


@pytest.fixture
def transient(monkeypatch) -> dict[str, Any]:
    """A transient of two coordinates that saturates at 0.02 s, and what it is asked with."""
    time = np.arange(1001) / 1000.0
    asked: dict[str, Any] = {"signal": np.sin(2 * np.pi * 100 * time), "boundary": 0.0205}
    prepared = SimpleNamespace(
        model=SimpleNamespace(names=("Y", "X")), linear="linear",
        stability=SimpleNamespace(unstable=(SimpleNamespace(frequency_Hz=70.0), SimpleNamespace(frequency_Hz=90.0))),
    )  # fmt: skip
    last = SimpleNamespace(
        displacement=np.array([[9.0, 9.0], [5.0, 7.0]]), velocity=np.array([[8.0, 8.0], [0.3, -0.4]])
    )

    def follow(prepared, take, progress, what):
        take("first")
        take(last)

    def prepare(scene, runs):
        asked["runs"] = runs
        return prepared

    def to_dataset(chunks, scene, names, outcome):
        asked["chunks"], asked["names"] = chunks, names
        return {"time": SimpleNamespace(values=time)}

    def make_channels(saved, names, part):
        asked["part"], asked["names of signals"] = part, names
        return [SimpleNamespace(values=asked["signal"][part])]

    monkeypatch.setattr(squeal_module, "prepare", prepare)
    monkeypatch.setattr(squeal_module, "check_transient", lambda prepared: None)
    monkeypatch.setattr(squeal_module, "follow", follow)
    monkeypatch.setattr(squeal_module, "to_dataset", to_dataset)
    monkeypatch.setattr(squeal_module, "first_boundary_time", lambda history, stability, linear: asked["boundary"])
    monkeypatch.setattr(squeal_module, "SavedHistory", lambda path, data, scene: SimpleNamespace(sample_rate=1000.0))
    monkeypatch.setattr(squeal_module, "make_channels", make_channels)
    monkeypatch.setattr(squeal_module, "steady_at_start", lambda prepared: np.array([1.0, 2.0]))

    def saturated_lines(values, rate, clock):
        asked["rate and clock"] = rate, clock
        return (line(100.0),), ()

    monkeypatch.setattr(squeal_module, "saturated_lines", saturated_lines)
    return asked


def test_a_squeal_is_the_last_three_fifths_of_a_transient_and_goes_on_from_its_end(nominal, transient):
    found = squeal_module.simulate(nominal, "signal", lambda *_: None)
    assert found is not None
    first = math.ceil(1000 * (1 - 0.6 * 0.9795))
    assert (transient["runs"], transient["names"], transient["names of signals"]) == (True, ("Y", "X"), ["signal"])
    assert transient["part"] == slice(first, 1001)
    assert len(transient["chunks"]) == 2
    assert transient["rate and clock"] == (1000.0, 0.0)  # a simulation has no clock that is off
    np.testing.assert_array_equal(found.values, transient["signal"][first:])
    assert (found.lines, found.unstable_Hz) == ((line(100.0),), (70.0, 90.0))
    assert found.scene.start.displacement == {"Y": 4.0, "X": 5.0}
    assert found.scene.start.velocity == {"Y": 0.3, "X": -0.4}


def test_no_squeal_is_what_reaches_no_boundary_is_too_short_or_decays(nominal, transient, monkeypatch):
    def simulated() -> Any:
        return squeal_module.simulate(nominal, "signal", lambda *_: None)

    time = np.arange(1001) / 1000.0
    # From 0.412 s on the rms of the last third over that of the first is e^(−0.392 s of the rate).
    tone = np.sin(2 * np.pi * 100 * time)
    transient["signal"] = tone * np.exp(-math.log(1 / 0.31) / 0.392 * time)
    assert simulated() is not None
    transient["signal"] = tone * np.exp(-math.log(1 / 0.29) / 0.392 * time)
    assert simulated() is None
    transient["signal"] = tone
    for boundary, squeals in ((None, False), (0.8955, False), (0.8945, True)):  # of 63 samples and of 64
        transient["boundary"] = boundary
        assert (simulated() is not None) == squeals
    monkeypatch.setattr(squeal_module, "saturated_lines", lambda values, rate, clock: ((), ()))
    assert simulated() is None

    def fails(*_, **__):
        raise IntegrationError("so")

    # A scene that cannot be integrated is not one that is quiet: its reason reaches the user.
    monkeypatch.setattr(squeal_module, "follow", fails)
    with pytest.raises(IntegrationError, match="so"):
        simulated()


def test_a_squeal_that_has_not_settled_is_run_three_times_as_long(nominal, monkeypatch):
    ran = []

    def simulate(scene, signal, progress):
        ran.append(scene.simulate.duration)
        return answers.pop(0)

    monkeypatch.setattr(squeal_module, "simulate", simulate)
    for uncertainty, long in ((0.019, False), (0.021, True)):
        answers: list[Any] = [squeal_of(100.0, error=uncertainty), "longer"]
        ran.clear()
        found = squeal_module.settled(nominal, "signal", lambda *_: None)
        assert (found == "longer") == long
        assert ran == pytest.approx([0.4, 1.2][: 1 + long])
    answers = [None]
    assert squeal_module.settled(nominal, "signal", lambda *_: None) is None


def test_a_scene_squeals_where_starts_beyond_the_nearer_boundary_lead(nominal, monkeypatch):
    class Way:
        sizes, boundary_ratio = (0.4, 0.5, 0.6, 4.0), 2.0

        def start(self, size):
            return ("way", size)

    def motion(name: str) -> Any:
        state = np.array([[1.0 + len(name), 2.0], [3.0, 4.0]])
        return SimpleNamespace(name=name, same=lambda other: other.name == name, state=state)

    asked: dict[str, Any] = {}

    def find(family, tasks, how, progress):
        asked.update(tasks=tasks, how=how)
        progress("x", 1, 2)
        return [SimpleNamespace(motion=each) for each in (None, motion("loud"), motion("b"), motion("loud"))]

    stability: Any = SimpleNamespace(coordinates=("X", "Y", "Tz"), time=0.25)
    monkeypatch.setattr(squeal, "prepare", lambda scene: SimpleNamespace(stability=stability))
    monkeypatch.setattr(squeal, "at_one_time", lambda scene, time: (scene, time))
    monkeypatch.setattr(
        squeal, "build_model", lambda scene, coordinates=None: SimpleNamespace(names=("Y", "X"), of=scene)
    )
    monkeypatch.setattr(squeal, "linear_coordinates", lambda scene: ("X", "Y", "Tz"))
    monkeypatch.setattr(squeal, "analyse_stability", lambda model: stability)
    monkeypatch.setattr(squeal, "point_of", lambda k, stability: (k, stability))
    monkeypatch.setattr(squeal, "round_of", lambda stability, names: 0.7)
    monkeypatch.setattr(squeal, "start_of", lambda scene, names: (np.array([5.0, 6.0]), np.array([7.0, 8.0])))
    monkeypatch.setattr(squeal, "directions", lambda point, family: [Way(), Way()])
    monkeypatch.setattr(squeal, "find_attractors", find)
    monkeypatch.setattr(squeal.Family, "small_start", lambda self, point, model: ("small", model.of, self.names))
    seen = []
    found = squeal.scenes_that_squeal(nominal, lambda *given: seen.append(given))
    points, begun = zip(*asked["tasks"], strict=True)
    assert all(each == (0, stability) for each in points)
    own, small, *ways = begun
    assert (own.name, own.vibration.tolist(), own.velocity.tolist()) == ("own", [5.0, 6.0], [7.0, 8.0])
    assert small == ("small", (nominal, 0.25), ("X", "Y", "Tz"))
    assert ways == [("way", 0.6), ("way", 4.0)] * 2
    simulate = nominal.simulate
    assert asked["how"][:4] == (simulate.sample_rate, simulate.tolerance, 0.7, simulate.solver)
    assert [scene.start.displacement for scene in found] == [{"Y": 5.0, "X": 2.0}, {"Y": 2.0, "X": 2.0}]
    assert [scene.start.velocity for scene in found] == [{"Y": 3.0, "X": 4.0}] * 2
    assert seen == [("squeals of the scene", 1, 2)]


def test_a_history_is_read_like_a_record_between_two_times(monkeypatch, tmp_path):
    time = 2.0 + np.arange(11) / 10.0
    saved: Any = SimpleNamespace(data={"time": SimpleNamespace(values=time)}, sample_rate=10.0)
    values = np.arange(11.0)
    asked = []

    def make_channels(saved, names, part):
        asked.append((names, part))
        return [SimpleNamespace(units="m/s", values=values[part])]

    monkeypatch.setattr("drumsqueal.questions.fit.study.is_history", lambda path: path.name == "history")
    monkeypatch.setattr(study_module, "read_history", lambda path: saved)
    monkeypatch.setattr(study_module, "names_of", lambda asked, saved, option: (asked[0].split(","), []))
    monkeypatch.setattr(study_module, "make_channels", make_channels)
    monkeypatch.setattr(study_module, "check_count", lambda path, count: asked.append(count))
    path = tmp_path / "history"
    found = study_module.read_record(path, None, "a", first=2.3, last=2.7)
    assert asked == [5, (["a"], slice(3, 8))]
    assert (found.name, found.unit, found.sample_rate, found.start_s) == ("a", "m/s", 10.0, pytest.approx(2.3))
    np.testing.assert_array_equal(found.values, values[3:8])
    assert study_module.read_record(path, "b", "a").name == "b"
    assert asked[-1] == (["b"], slice(0, 11))
    with pytest.raises(RequestError, match="is a history, which has its own"):
        study_module.read_record(path, rate=5.0)
    with pytest.raises(RequestError, match="there are several such, b, c"):
        study_module.read_record(path, "b,c")
    values[:] = 4.0
    with pytest.raises(RequestError, match="a does not move in this history"):
        study_module.read_record(path, None, "a")
    monkeypatch.setattr(
        study_module, "read_measured", lambda path, channel, rate, first, last: (channel, rate, first, last)
    )
    assert study_module.read_record(tmp_path / "other", "b", rate=5.0, first=1.0, last=2.0) == ("b", 5.0, 1.0, 2.0)


def test_what_stays_of_numbers_that_act_as_one_is_their_sum_or_their_product(nominal, monkeypatch):
    """Of two stiffnesses 3e8 and 1e8 N/m only 3 : 1 in logarithms is held, which is their sum; a third is known."""
    monkeypatch.setattr(study_module, "unit_of", lambda key, scene: "1" if key == "c" else "N/m")
    written: Any = SimpleNamespace(unit=lambda key: "kN/mm", shown=lambda key, value: value / 1e6)
    held = np.array([3.0, 1.0]) / math.sqrt(10)
    free = np.array([[1.0, -3.0, 0.0]]) / math.sqrt(10)
    covariance = 4e-4 * np.outer([*held, 0], [*held, 0]) + np.diag([0, 0, 9e-4]) + free.T @ free

    def estimate_of(**more: Any) -> Any:
        known: dict[str, Any] = {"open": free, "missed": False, "covariance": covariance, "factor_95": 2.0}
        return SimpleNamespace(**(known | more))

    values = np.array([3e8, 1e8, 0.4])
    ((found),) = study_module._fixed(nominal, ("a", "b", "c"), values, estimate_of(), written)
    assert found.powers == {"a": pytest.approx(1.0), "b": pytest.approx(1 / 3)}
    spread = 2.0 * math.sqrt(np.array([1, 1 / 3]) @ covariance[:2, :2] @ [1, 1 / 3])
    assert found.relative_uncertainty == pytest.approx(spread)
    assert spread == pytest.approx(2 * 0.02 * math.sqrt(10) / 3)
    assert found.factors == {"a": pytest.approx(1.0), "b": pytest.approx(1.0)}
    assert (found.value, found.unit) == (pytest.approx(400.0), "kN/mm")
    assert found.uncertainty == pytest.approx(3e8 * spread / 1e6)
    monkeypatch.setattr(study_module, "unit_of", lambda key, scene: key)
    (product,) = study_module._fixed(nominal, ("a", "b", "c"), values, estimate_of(), written)
    assert (product.powers, product.value) == (found.powers, None)
    for none in ({"missed": True}, {"open": np.zeros((0, 3))}, {"open": np.eye(3)[:2]}):
        assert study_module._fixed(nominal, ("a", "b", "c"), values, estimate_of(**none), written) == ()
    assert study_module._fixed(nominal, ("a", "b", "c"), values * [1, 0, 1], estimate_of(), written) == ()
