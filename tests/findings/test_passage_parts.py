"""Instants, passages of modes, tones and places of rest, against sums written out."""

import math
from types import SimpleNamespace
from typing import Any, cast

import jax
import numpy as np
import pytest
import scipy

from drumsqueal.findings import decay, ramp
from drumsqueal.findings.growth_phase import FrequencyDrift, OverTime
from drumsqueal.findings.ramp import PassageGrowth, find_passages, growth_against_boundary, unstable_spans
from drumsqueal.findings.signals.spectra import find_harmonics, find_tones
from drumsqueal.findings.squeals import Drive, _rate_at, _same, drives_of, instants_at, name_of_key, unit_of_key
from drumsqueal.findings.verdict import _within_the_boundaries, hertz, rate_text, shift_words
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from findings.fakes import AREA, record, two_shoes, vibration_of

# --- instants --------------------------------------------------------------------------------------------------------


def test_a_profile_changes_by_its_slope_from_the_left_at_a_corner():
    profile = PiecewiseLinear([1.0, 1.5, 3.5], [2.0, 5.0, 1.0])
    times = [0.5, 1.0, 1.2, 1.5, 1.6, 3.5, 4.0]
    assert [_rate_at(profile, time) for time in times] == pytest.approx([0, 6, 6, 6, -2, -2, 0])
    assert _rate_at(Constant(4.0), 1.0) == 0.0
    assert Drive(profile, 10.0).at(1.25) == pytest.approx((35.0, 60.0))


def test_an_instant_has_the_load_of_all_linings_and_what_drives_each():
    found = instants_at(two_shoes(), [2.5, 4.0])
    first = found[0]
    assert first.time_s == 2.5
    assert first.drum_speed_rad_per_s == pytest.approx(-2.75)
    assert first.drum_speed_rate_rad_per_s2 == pytest.approx(0.5)
    assert first.normal_load_N == pytest.approx(AREA[0] * 675 + AREA[1] * 700)
    assert first.normal_load_rate_N_per_s == pytest.approx(AREA[0] * 450)
    assert set(first.driven) == {"drum.speed", "shoe.0.contact.normal_load", "shoe.1.contact.normal_load"}
    assert first.value("shoe.1.contact.normal_load") == pytest.approx(AREA[1] * 700)
    assert first.rate("shoe.0.contact.normal_load") == pytest.approx(AREA[0] * 450)
    assert found[1].normal_load_rate_N_per_s == 0


def test_what_is_the_same_on_all_shoes_is_one_drive_and_forces_are_counted_on_each():
    push, other = PiecewiseLinear([0.0, 1.0], [0.0, 50.0]), Constant(7.0)
    loads = {"preload": Constant(2.0), "further": (Constant(4.0),)}
    operation = Operation(Constant(3.0), **loads, pushes=(push, other, push), pushed_shoes=(0, 0, 1))
    sides = [(None, SimpleNamespace(body=SimpleNamespace(area=area))) for area in (0.5, 0.25)]
    found = drives_of(cast("Any", SimpleNamespace(operation=operation, sides=sides)))
    assert set(found) == {"drum.speed", "contact.normal_load", "shoe.force.0.size", "shoe.0.force.1.size"}
    assert found["contact.normal_load"].at(0.0) == (1.0, 0.0)
    assert found["shoe.0.force.1.size"].schedule is other
    assert not _same(Drive(push), Drive(PiecewiseLinear([0.0, 0.5, 1.0], [0.0, 26.0, 50.0])))
    assert _same(Drive(push), Drive(PiecewiseLinear([0.0, 0.5, 1.0], [0.0, 25.0, 50.0])))


def test_what_changes_has_a_name_and_a_unit():
    loads = ("contact.normal_load", "shoe.1.contact.normal_load")
    names = ("drum.speed", *loads, "shoe.force.2.size", "shoe.3.force.0.size")
    assert list(map(name_of_key, names)) == ["drum speed", "load", "load of shoe 1", "force 2", "force 0 of shoe 3"]
    assert [unit_of_key(name) for name in names[:2]] == ["rad/s", "N"]


# --- passages --------------------------------------------------------------------------------------------------------


def along(rates, growth=None, time=None) -> Any:
    time = np.arange(float(len(rates))) if time is None else np.asarray(time)
    modes = [SimpleNamespace(unstable=rate > 0, growth_rate=rate, frequency_Hz=100.0) for rate in rates]
    growth = np.zeros(len(rates)) if growth is None else np.asarray(growth)

    def growth_at(times):
        return np.interp(times, time, growth)

    return SimpleNamespace(label="X", time=time, modes=modes, growth=growth, steady=None, growth_at=growth_at)


def test_a_mode_is_unstable_between_its_roots_or_the_ends():
    roots = [SimpleNamespace(label=label, value=value) for label, value in [("X", 1.3), ("Y", 1.1), ("X", 3.7)]]
    branches: Any = SimpleNamespace(critical=roots)
    assert unstable_spans(along([-1, -1, 2, 2, -1]), branches) == [(1.3, 3.7)]
    assert unstable_spans(along([1, 1, 2, 2, -1]), branches) == [(0.0, 3.7)]
    assert unstable_spans(along([-1, -1, 2, 2, 3]), branches) == [(1.3, 4.0)]
    assert unstable_spans(along([-1, -1, -1, 2, -1, 2]), branches) == [(3.0, 3.7), (5.0, 5.0)]
    assert unstable_spans(along([-1, -1]), branches) == []


def test_growth_is_held_against_what_leads_to_the_boundary(monkeypatch):
    monkeypatch.setattr(ramp, "amplitudes_at_boundary", lambda *_: np.exp([1.0, 2.0, 4.0, np.nan]))
    model: Any = None
    times, growth, room = growth_against_boundary(along([1] * 4, [0.0, 2.0, 3.0, 7.0]), 0.5, 2.0, model)
    assert (times[0], times[-1], len(times)) == (0.5, 2.0, 41)
    np.testing.assert_allclose(np.diff(times), np.repeat([0.5 / 20, 1 / 20], 20))
    np.testing.assert_allclose(growth, np.interp(times, range(4), [0.0, 2.0, 3.0, 7.0]) - 1.0)
    np.testing.assert_allclose(room, np.interp(times, range(3), [1.0, 2.0, 4.0]))
    assert growth_against_boundary(along([1] * 4), 2.5, 3.0, model)[2].tolist() == [np.inf] * 21


def test_a_mode_begins_with_its_mean_amplitude_over_eight_periods_about_the_sliding_that_moves(monkeypatch):
    """The record is a mode of 100 Hz that decays, a second one, and steady sliding that drifts with the operation."""
    values = np.array([-3 + 2j * math.pi * 100, -5 + 2j * math.pi * 130])
    shapes = np.random.default_rng(8).normal(size=(2, 2, 2)) @ [1, 0.4j]
    right = np.vstack([shapes, shapes * values])
    left = np.linalg.inv(np.hstack([right, right.conj()])).conj().T
    modes = [
        SimpleNamespace(eigenvalue=values[j], frequency_Hz=(100.0, 130.0)[j], left=left[:, j], name=j) for j in (1, 0)
    ]
    of_point = SimpleNamespace(modes=[*modes, SimpleNamespace(eigenvalue=values[0].conj())])
    asked = []
    monkeypatch.setattr(ramp, "point_in_time", lambda model, time: asked.append((model, time)) or of_point)
    knots, slope, offset = np.array([0.0, 0.03, 0.1, 0.14, 0.2]), np.array([8.0, -3.0]), np.array([0.7, 0.2])
    # The mode is the one whose eigenvalue is nearest to that of the followed one at the nearest instant.
    nearest = [values[1], values[1], values[0] + 40j, values[1], values[1]]
    followed: Any = SimpleNamespace(
        time=knots, steady=offset + knots[:, None] * slope, modes=[SimpleNamespace(eigenvalue=each) for each in nearest]
    )
    time = np.arange(2001) / 10_000.0
    size = np.exp(np.outer(time, values)) * [0.6, 0.9]
    moves = (size @ right.T).real
    vibration, _ = vibration_of(
        record(time, offset + time[:, None] * slope + moves[:, :2], slope + moves[:, 2:], ("X", "Y")), ("X", "Y"),
        np.array([5.0, -4.0]),
    )  # fmt: skip
    for first, window in ((0.0853, slice(453, 1254)), (0.08, slice(400, 1201))):
        found, amplitude = ramp._start(followed, first, vibration, "model")  # pyright: ignore[reportArgumentType]
        assert (found.name, asked.pop()) == (0, ("model", first))
        assert amplitude == pytest.approx(np.abs(size[window, 0]).mean(), rel=1e-9)
    found, amplitude = ramp._start(followed, 0.0, vibration, "model")  # pyright: ignore[reportArgumentType]
    assert (found.name, amplitude) == (1, pytest.approx(0.9))  # of the first sample alone
    found, amplitude = ramp._start(followed, 0.0001, vibration, "model")  # pyright: ignore[reportArgumentType]
    assert amplitude == pytest.approx(np.abs(size[: 1 + 308 + 1, 1]).mean(), rel=1e-9)  # 4 × 10 kHz / 130 Hz


@pytest.mark.parametrize(
    ("amplitude", "squeal", "outcome", "needed", "predicted"),
    [
        (math.exp(-2), None, PassageGrowth.REACHES, 2.5, 2.5 / 1.0),
        (math.exp(-6), None, PassageGrowth.TOO_LITTLE, 7.0, None),
        (math.exp(0.5), None, PassageGrowth.BEYOND_ALREADY, None, None),
        (1e-15, None, PassageGrowth.NOT_EXCITED, None, None),
        (math.exp(-2), (0.0, 2.0), PassageGrowth.SQUEALS_ALREADY, None, None),
        (math.exp(-2), (0.0, 0.9), PassageGrowth.REACHES, 2.5, 2.5),
    ],
)
def test_a_mode_reaches_the_boundary_where_it_has_grown_by_the_room_that_is_left(
    monkeypatch, amplitude, squeal, outcome, needed, predicted
):
    times = np.linspace(0.0, 4.0, 9)
    room = np.where(times < 1, 0.0, np.where(times <= 3, 0.5, 1.0))
    monkeypatch.setattr(ramp, "_start", lambda *_: (SimpleNamespace(frequency_Hz=90.0), amplitude))
    monkeypatch.setattr(ramp, "growth_against_boundary", lambda *_: (times, 1.0 * times, room))
    monkeypatch.setattr(ramp, "instant_at", lambda model, time: instants_at(two_shoes(), [time])[0])
    squeals: Any = () if squeal is None else (
        SimpleNamespace(sets_in=SimpleNamespace(time_s=squeal[0]), ends=SimpleNamespace(time_s=squeal[1])),
    )  # fmt: skip
    vibration: Any = None
    found = ramp._passage(along([1, 1]), 1.0, 4.0, squeals, vibration, vibration)
    assert (found.outcome, found.amplitude, found.growth_available) == (outcome, amplitude, 4.0)
    assert (found.unstable_from.time_s, found.unstable_until.time_s) == (1.0, 4.0)
    assert found.growth_needed == (None if needed is None else pytest.approx(needed))
    assert (found.predicted and found.predicted.time_s) == (None if predicted is None else pytest.approx(predicted))


def test_a_squeal_is_that_of_the_mode_which_was_to_be_the_first(monkeypatch):
    def passage(name, span, outcome, needed=None, available=1.0, predicted=None):
        instants = instants_at(two_shoes(), [*span, predicted or 0.0])
        return ramp.Passage(
            mode=name, unstable_from=instants[0], unstable_until=instants[1], frequency_Hz=90.0, amplitude=1.0,
            growth_available=available, outcome=outcome, growth_needed=needed,
            predicted=instants[2] if predicted else None,
        )  # fmt: skip

    made = {
        "late": passage("late", (2.0, 5.0), PassageGrowth.REACHES, 1.0, 2.0, 4.0),
        "first": passage("first", (1.0, 5.0), PassageGrowth.REACHES, 1.0, 2.0, 3.0),
        "lacks": passage("lacks", (0.0, 5.0), PassageGrowth.TOO_LITTLE, 1.5, 1.0),
        "lacks more": passage("lacks more", (0.5, 5.0), PassageGrowth.TOO_LITTLE, 3.0, 1.0),
        "none": passage("none", (0.6, 5.0), PassageGrowth.NOT_EXCITED),
    }
    monkeypatch.setattr(ramp, "unstable_spans", lambda along, branches: [(0.0, 0.0)])
    monkeypatch.setattr(ramp, "_passage", lambda along, *_: made[along])
    squeals: Any = [SimpleNamespace(sets_in=each) for each in instants_at(two_shoes(), [3.1, 4.5, 0.7, 0.8, 0.9])]
    nothing: Any = None
    found = find_passages(list(made), nothing, tuple(squeals), nothing, nothing)  # pyright: ignore[reportArgumentType]
    assert [each.mode for each in found] == ["lacks", "lacks more", "none", "first", "late"]
    assert [each.measured and each.measured.time_s for each in found] == [0.7, 0.8, None, 3.1, 4.5]


# --- tones -----------------------------------------------------------------------------------------------------------


def test_noise_shows_a_tone_in_one_record_of_a_thousand():
    rng, found = np.random.default_rng(2), []
    for _ in range(60):
        noise = rng.normal(size=4096)
        found += [find_tones(noise, 1000.0, segment=each).peaks.frequency_Hz.size for each in (0.25, 9.0)]
    assert sum(found) <= 2


@pytest.mark.parametrize(("segment", "least"), [(0.25, 0.2), (9.0, 0.09)])
def test_a_tone_that_stands_out_of_noise_is_found(segment, least):
    """The threshold is that of χ² over its median, here for white noise of which the floor is known."""
    time = np.arange(4096) / 1000.0
    noise = np.random.default_rng(4).normal(size=time.size)
    tones = find_tones(noise + 1.0 * np.sin(2 * np.pi * 123.4 * time), 1000.0, segment=segment)
    assert tones.peaks.frequency_Hz == pytest.approx([123.4], abs=0.5)
    assert tones.peaks.amplitude == pytest.approx([1.0], rel=0.1)
    samples = min(round(segment * 1000), 4096)
    assert tones.segments == (1 if samples == 4096 else 1 + int((4096 - samples) / (samples / 2)))
    # Mean squared amplitude of unit white noise, 4 Σw²/(Σw)², and the χ² of so many segments.
    mean = 4 * 1.5 / samples
    count = tones.segments / (1 + 2 / 36) if tones.segments > 1 else 1.0
    rare = scipy.special.gammainccinv(count, 1e-3 / (4 * (samples // 2 + 1))) / count
    middle = np.median(tones.threshold)
    assert math.sqrt(mean * rare) < middle < 1.45 * math.sqrt(mean * rare)


def test_lines_are_harmonics_of_the_strongest_that_is_near():
    f = np.array([100.0, 200.4, 250.0, 500.3, 43.0, 1000.2])
    a = np.array([1.0, 0.5, 2.0, 0.1, 5.0, 30.0])
    found = find_harmonics(f, a, 1.0)
    assert [None if each is None else (each.order, each.fundamental) for each in found] == [
        None, (2, 0), None, (2, 2), None, None,
    ]  # fmt: skip
    assert find_harmonics(np.array([19.0, 38.0]), np.ones(2), 1.0) == [None, None]
    assert find_harmonics(np.array([20.0, 40.0]), np.ones(2), 1.0)[1] == (2, 0)


# --- rest ------------------------------------------------------------------------------------------------------------

MASS, MATRIX = np.array([2.0, 0.5]), np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-90, 20, -3, 1], [35, -150, 2, -4.0]])


@jax.tree_util.register_static
class Linear:
    def state_matrix(self):
        return MATRIX


def resting_model(**more: Any) -> Any:
    operation = SimpleNamespace(constant=True)
    known: dict[str, Any] = {"forced": False, "remembering": (), "operation": operation, "mass": MASS}
    return SimpleNamespace(**(known | {"names": ("X", "Y")} | more))


def motion(start, matrix=MATRIX, count=400, step=1e-3, constant=0.0):
    turn = scipy.linalg.expm(matrix * step)
    states = [np.asarray(start, dtype=float)]
    for _ in range(count):
        states.append(turn @ states[-1])
    states = np.array(states)
    return states[:, :2] + constant, states[:, 2:]


def test_a_motion_that_the_linear_model_leads_is_near(monkeypatch):
    monkeypatch.setattr(decay, "least_energy", lambda model: 1e-30)
    assert decay.find_rest(resting_model(), np.zeros(2), MATRIX, [motion([1e-3, 2e-3, 0.1, -0.2])], 1e-3).near
    # About a place where nothing pulls it departs by all that the springs would pull, as it rests there.
    monkeypatch.setattr(
        decay, "_find_equilibrium", lambda *_: decay.Rest(near=False, elsewhere=np.ones(2), linear=-1.0)
    )
    away = motion([1e-6, 2e-6, 1e-5, -2e-5], constant=np.array([0.3, -0.2]))  # pyright: ignore[reportArgumentType]
    found = decay.find_rest(resting_model(), np.zeros(2), MATRIX, [away], 1e-3)
    assert found.elsewhere is not None
    for more in ({"forced": True}, {"remembering": ("T",)}, {"operation": SimpleNamespace(constant=False)}):
        assert decay.find_rest(resting_model(**more), np.zeros(2), MATRIX, [away], 1e-3).near


def test_the_momentum_is_that_of_the_linear_springs_to_the_fourth_order(monkeypatch):
    """With large samples the departure from the linear impulse must stay far below half of it."""
    monkeypatch.setattr(decay, "least_energy", lambda model: 1e-30)
    monkeypatch.setattr(decay.Criteria, "led", 1e-5)
    assert decay.find_rest(resting_model(), np.zeros(2), MATRIX, [motion([1, 2, 5, -9], step=0.01)], 0.01).near
    monkeypatch.setattr(decay.Criteria, "led", 1e-9)
    monkeypatch.setattr(decay, "_find_equilibrium", lambda *_: pytest.fail("it moves"))
    assert not decay.find_rest(resting_model(), np.zeros(2), MATRIX, [motion([1, 2, 5, -9], step=0.01)], 0.01).near


def test_an_equilibrium_is_one_that_newton_finds_from_both_ends(monkeypatch):
    springs = -MATRIX[2:, :2] * np.sqrt(MASS)[:, None]
    seen, steady, place = [], np.array([5.0, 6.0]), np.array([0.3, -0.2])
    linear = Linear()
    answers = iter([place, place * (1 + 1e-8), place, place * (1 + 1e-3), place * 1e-9, place * 1e-9])

    def near(model, start, own, load):
        seen.append((start, own, load))
        return steady + next(answers), linear

    monkeypatch.setattr(decay, "sliding_near", near)
    ends = np.array([[0.1, 0.2], [0.4, -0.3]])
    found = decay._find_equilibrium(resting_model(), steady, springs, ends)
    assert found.elsewhere == pytest.approx(place)
    assert found.linear == pytest.approx(np.linalg.eigvals(MATRIX).real.max())
    stiffness = -MATRIX[2:, :2] * MASS[:, None]
    for (start, own, load), end in zip(seen, ends, strict=True):
        np.testing.assert_allclose(start, steady + end)
        np.testing.assert_allclose(own, np.abs(np.diag(stiffness)))
        np.testing.assert_allclose(load, np.abs(stiffness @ ends[1]))
    assert decay._find_equilibrium(resting_model(), steady, springs, ends).elsewhere is None
    assert decay._find_equilibrium(resting_model(), steady, springs, ends).elsewhere is None


def test_rates_are_of_the_root_of_the_mean_squares():
    assert decay.rate_of_halves(4.0, 1.0, 2.0) == pytest.approx(-math.log(2))
    assert decay.rate_of_halves(0.0, 1.0, 2.0) == 0.0
    assert [decay.falls_as_small(rate, -4.0) for rate in (-2.1, -1.9, 3.0)] == [True, False, False]


# --- words -----------------------------------------------------------------------------------------------------------


def within(ratio: float | None, rates, unstable=("X",), divergence: float | None = None, moved_by="") -> str:
    modes = [
        SimpleNamespace(predicted_growth_rate_1_per_s=rate, unstable=rate > 0, excited=excited)
        for rate, excited in rates
    ]
    prediction = SimpleNamespace(unstable=unstable, divergence=divergence)
    found: Any = SimpleNamespace(
        motion_ratio=ratio, recorded_s=0.5, moved_by=moved_by, modes=modes, prediction=prediction
    )
    return _within_the_boundaries(found)


def test_a_transient_is_too_short_where_its_fastest_growth_would_not_show():
    growth = "0.5 s are too short to compare: the fastest growth would be by a factor of"
    assert within(1.0, [(2.0, True), (4.0, True)]) == f"{growth} {math.exp(2.0):.4g}"
    assert within(1.0, [(2.0, True), (8.0, False)]) == f"{growth} {math.exp(1.0):.4g}"
    assert within(1.0, [(2.0, True)], divergence=3.0) == f"{growth} {math.exp(1.5):.4g}"
    assert within(1.0, [], (), divergence=3.0) == f"{growth} {math.exp(1.5):.4g}"
    assert within(1.0, [(2.0, True), (4.7, True)]) == "the transient does not grow within 0.5 s"
    assert within(1.0, [(8.0, False)]).startswith("the start excites none of the unstable modes")
    assert within(1.0, [(-2.0, True)], ()) == "the transient agrees: nothing grows within 0.5 s"
    assert within(1.11, [(2.0, True)]).startswith("the motion grows 1.11 times")
    assert within(None, []) == "nothing was started, and the transient reaches no contact boundary"
    assert "the load moves the shoe" in within(None, [], moved_by="load")


def test_a_shift_is_a_ratio_less_one():
    drift = FrequencyDrift(
        mode="X", coordinate="X", onset_Hz=200.0, saturated_Hz=150.0, predicted_by_contact_loss_Hz=160.0,
        predicted_with_friction_Hz=250.0, predicted_by_root_of_contact_share_Hz=100.0,
        over_time=OverTime(time_s=(), frequency_Hz=()), ridge=None,
    )  # fmt: skip
    shifts = drift.shift, drift.predicted_by_contact_loss_shift, drift.predicted_with_friction_shift
    assert shifts == pytest.approx((-0.25, -0.2, 0.25))
    assert (shift_words(-0.25), shift_words(0.25), shift_words(4e-4)) == ("25.0 % below", "25.0 % above", "at")
    assert (hertz(999.4), hertz(999.6), hertz(1234.0)) == ("999 Hz", "1 kHz", "1.23 kHz")
    assert (rate_text(-3.0, 100.0), rate_text(1e-12, 100.0)) == ("−3.000", "0")


def test_modes_that_never_move_are_left_aside(monkeypatch):
    def following(label: str, names: str, *rates: float) -> Any:
        modes = [
            SimpleNamespace(name=name, frequency_Hz=10.0 * k, growth_rate=rate)
            for k, (name, rate) in enumerate(zip(names, rates, strict=True))
        ]
        return SimpleNamespace(label=label, modes=modes, time=np.arange(len(modes)) / 4)

    branches = [following("one", "XY", 1.0, -2.0), following("other", "YX", 3.0, 4.0)]
    seen = {}
    monkeypatch.setattr(ramp, "follow_operation", lambda model, until: seen.update(until=until))
    monkeypatch.setattr(ramp, "corners_of", lambda model, until: [0.0, until])
    monkeypatch.setattr(ramp, "modes_along", lambda found, corners: branches)
    monkeypatch.setattr(ramp, "find_squeals", lambda history, vibration, stability, model, modes: ())
    monkeypatch.setattr(ramp, "find_hysteresis", lambda squeals, model, until: ())
    monkeypatch.setattr(ramp, "changing_keys", lambda model: {"drum.speed": None})
    monkeypatch.setattr(
        ramp, "find_passages", lambda modes, *_: seen.update(modes=[each.label for each in modes]) or ()
    )
    extremes = np.array([[1.0, 2.0], [3.0, 2.0]])  # Y stays where it is
    vibration: Any = SimpleNamespace(time=np.array([0.0, 7.0]), coordinates=("X", "Y"), extremes=lambda: extremes)
    model: Any = SimpleNamespace(forced=False)
    found = ramp.find_ramp(model, vibration, model, model)
    assert seen == {"until": 7.0, "modes": ["one"]}
    (line,) = found.lines
    assert (line.mode, line.name, line.time_s) == ("one", "X", (0.0, 0.25))
    assert (line.frequency_Hz, line.growth_rate_1_per_s) == ((0.0, 10.0), (1.0, -2.0))
    seen.clear()
    assert ramp.find_ramp(model, vibration, model, SimpleNamespace(forced=True)).passages == ()  # pyright: ignore[reportArgumentType]
    assert "modes" not in seen
