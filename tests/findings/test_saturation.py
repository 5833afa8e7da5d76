"""The motion after growth: what counts as motion, which modes take part, what is known of an approach."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.findings import decay, saturation
from drumsqueal.findings.decay import Slowest, is_decaying, slowest
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.saturation import (
    Approach,
    FinalMotion,
    _approach,
    _by_approach,
    _taking_part,
    describe_motion,
    describe_saturation,
    size_of_motion,
)
from drumsqueal.findings.signals.regime import Cause, Regime
from findings.fakes import NAMES, record, two_shoes, vibration_of

RNG = np.random.default_rng(5)
TIME = 1.0 + np.arange(4000) / 2000.0


def seen_by(stability: dict[str, Any], q: np.ndarray, v: np.ndarray | None = None) -> tuple[Any, Any]:
    steady = np.linspace(0.1, 0.6, 6)
    return vibration_of(record(TIME, q + steady, q if v is None else v, NAMES), NAMES, steady, **stability)


def test_motion_is_what_takes_the_largest_pressure_away_or_else_the_largest_of_the_record():
    q = RNG.normal(size=(4000, 6)) * [1.0, 2.0, 0.0, 3.0, 4.0, 5.0]
    vibration, stability = seen_by({"pressure_range": (-5.0, 600.0)}, q)
    found = size_of_motion(vibration, stability, two_shoes())
    np.testing.assert_allclose(found, 600.0 / 3.0e7 / np.array([1.0, 0.17, 1.0, 1.0, 0.19, 0.4]))
    # Neither without pressure nor without stiffness is there any to lose.
    largest = np.maximum(np.abs(q).max(axis=0), np.finfo(float).tiny)
    np.testing.assert_allclose(size_of_motion(vibration, stability, two_shoes(stiffness=(0.0, 0.0))), largest)
    still, stability = seen_by({"pressure_range": (-5.0, -1.0)}, q)
    np.testing.assert_allclose(size_of_motion(still, stability, two_shoes()), largest)


def test_a_motion_has_half_its_range_its_energies_and_the_line_that_holds_most():
    frequencies, sizes = np.array([100.0, 150.0, 50.0, 240.0, 75.0, 90.0]), 1e-3 * np.array([1, 2, 0, 3, 5, 0.4])
    turn = 2 * np.pi * frequencies * TIME[:, None]
    q = sizes * np.cos(turn)
    q[:1000] *= 9.0  # before the part
    mass = np.array([2.0, 0.03, 3.0, 0.1, 0.05, 1.0])
    vibration, stability = seen_by(
        {"mass": mass, "pressure_range": (0, 1e3)}, q, -2 * np.pi * frequencies * sizes * np.sin(turn)
    )
    found = describe_motion(vibration, slice(1000, None), stability, two_shoes())
    # At 240 Hz phases repeat after 25 samples: 1 − cos(π/25) is 0.8 %.
    assert found.amplitude == pytest.approx(dict(zip(NAMES, sizes, strict=True)), rel=8e-3)
    energies = mass * (frequencies * sizes) ** 2  # at 75 Hz there are 112.5 periods
    assert found.kinetic_fraction == pytest.approx(dict(zip(NAMES, energies / energies.sum(), strict=True)), rel=1e-2)
    assert {line.coordinate: line.frequency_Hz for line in found.lines} == pytest.approx(
        {name: f for name, f in zip(NAMES, frequencies, strict=True) if name != "b.X"}, abs=0.05
    )
    assert found.main is not None
    assert found.main.coordinate == NAMES[int(np.argmax(energies))]
    # What moves by less than a millionth of what counts as motion is at rest.
    least = 1e-6 * 1e3 / 3.0e7 / 0.4  # of the drum's, which has the smallest lever
    for factor, rests in ((0.9, True), (1.1, False)):
        quiet = 0 * q
        quiet[2000, 5] = 2 * factor * least
        vibration, stability = seen_by({"mass": mass, "pressure_range": (0, 1e3)}, quiet)
        motion = describe_motion(vibration, slice(None), stability, two_shoes())
        assert (motion == FinalMotion(motion.amplitude, {}, (), None)) == rests
        assert motion.amplitude["drum.E1"] == pytest.approx(factor * least)


def test_modes_take_part_whose_coordinate_moves_the_unstable_ones_before_all():
    q = np.zeros((4000, 6))
    q[7, 1] = q[9, 3] = 1.0

    def modes(*unstable: bool) -> Any:
        return tuple(SimpleNamespace(name=n, unstable=u) for n, u in zip(("a.X", "a.Tz", "b.Y"), unstable, strict=True))

    for unstable, wanted in (
        ((True, False, False), (1, 2)),
        ((False, True, False), (1,)),
        ((True, True, True), (1, 2)),
    ):
        given = modes(*unstable)
        vibration, stability = seen_by({"modes": given}, q)
        assert _taking_part(vibration, stability) == tuple(given[k] for k in wanted)


def approach(needed: float | None) -> Approach:
    return Approach(
        frequency_Hz=8.0, amplitude={"X": 1.0}, rate_1_per_s=-3.0, largest_multiplier=0.7, distance=0.2, residual=1e-9,
        record_needed_s=needed,
    )  # fmt: skip


def test_a_motion_that_comes_to_a_periodic_one_is_periodic_unless_the_record_is_too_short_to_show_it():
    before = Regime(kind=Kind.IRREGULAR, cause=Cause.DRIFTS, recurrence_error=0.3, amplitude_drift=-0.2)
    numbers = {"frequency_Hz": 8.0, "rate_1_per_s": -3.0, "distance": 0.2, "residual": 1e-9}
    found = _by_approach(before, approach(None))
    assert (found.kind, found.cause, found.numbers) == (Kind.PERIODIC, Cause.APPROACHES, numbers)
    assert (found.period_s, found.base_frequencies_Hz, found.record_needed_s) == (0.125, (8.0,), None)
    assert (found.recurrence_error, found.amplitude_drift) == (0.3, -0.2)
    found = _by_approach(before, approach(7.0))
    assert (found.kind, found.cause, found.record_needed_s) == (Kind.UNDECIDED, Cause.NEARS, 7.0)
    assert found.numbers == numbers | {"record_needed_s": 7.0}
    assert (found.period_s, found.base_frequencies_Hz, found.recurrence_error) == (None, (), 0.3)


@pytest.mark.parametrize(
    ("kind", "turns", "orbit", "needed", "asked", "expected"),
    [
        (Kind.PERIODIC, 50.0, 999.0, None, True, (Kind.PERIODIC, Cause.APPROACHES, (999.0,))),
        (
            Kind.PERIODIC,
            50.0,
            999.0,
            7.0,
            True,
            (Kind.PERIODIC, Cause.REPEATS, (20.0,)),
        ),  # the record shows it
        (Kind.PERIODIC, 2.0, 999.0, None, True, (Kind.PERIODIC, Cause.APPROACHES, (999.0,))),
        (
            Kind.PERIODIC,
            2.0,
            500.1,
            None,
            True,
            (Kind.PERIODIC, Cause.REPEATS, (500.0,)),
        ),  # and is no other one
        (Kind.PERIODIC, 1.001, 999.0, None, False, (Kind.PERIODIC, Cause.REPEATS, (1000.0 / 1.001,))),
        (Kind.PERIODIC, 0.999, 999.0, None, False, (Kind.PERIODIC, Cause.REPEATS, (1000.0 / 0.999,))),
        (Kind.QUASI_PERIODIC, None, 999.0, 7.0, True, (Kind.UNDECIDED, Cause.NEARS, ())),
        (Kind.STEADY, None, 999.0, None, False, (Kind.STEADY, Cause.REPEATS, ())),
    ],
)
def test_what_repeats_only_after_several_turns_is_asked_for_a_motion_that_repeats_sooner(
    monkeypatch, kind, turns, orbit, needed, asked, expected
):
    """What decays beside a cycle of 7599 Hz made the motion of a brake repeat best after fifty turns, at 152 Hz."""
    bases = () if turns is None else (1000.0 / turns,)
    period = None if turns is None else turns / 1000.0
    found_orbit = approach(needed).model_copy(update={"frequency_Hz": orbit})
    regime, tried = Regime(kind=kind, cause=Cause.REPEATS, period_s=period, base_frequencies_Hz=bases), []
    monkeypatch.setattr(saturation, "classify", lambda *_, **__: regime)
    monkeypatch.setattr(saturation, "decay_to_rest", lambda regime, *_: regime)
    main = saturation.SpectralLine("b.Y", 1000.0, 1.0)
    monkeypatch.setattr(saturation, "describe_motion", lambda *_: FinalMotion({}, {}, (main,), main))
    monkeypatch.setattr(saturation, "_approach", lambda *given: tried.append(given[3]) or found_orbit)
    fractions = dict.fromkeys(("contact_fraction", "slip_reversed_fraction"), 0 * TIME)
    q, v = RNG.normal(size=(2, 4000, 6))
    history = record(TIME, q, v, NAMES, **fractions)
    more: Any = {"pressure_range": (0.0, 1.0), "modes": ()}
    vibration, stability = vibration_of(history, NAMES, np.zeros(6), **more)
    model = two_shoes()
    found = describe_saturation(history, vibration, stability, model, 1.0, (model, "auto", 1e-6))
    assert found is not None
    assert tried == [1000.0] * asked
    assert (found.regime.kind, found.regime.cause, found.regime.base_frequencies_Hz) == expected
    assert (found.approaches is not None) == (found.regime.cause in (Cause.APPROACHES, Cause.NEARS))


def test_an_approach_is_sought_from_the_states_of_the_coordinates_that_were_integrated(monkeypatch):
    q, v = RNG.normal(size=(2, 4000, 6))
    history = record(TIME, q, v, NAMES).assign_attrs(steps=np.int64(417))
    vibration, stability = vibration_of(history, NAMES, np.arange(6.0))
    monkeypatch.setattr(saturation, "find_approach", lambda given: given)
    monkeypatch.setattr(saturation, "changes", lambda model, time: time[0] > 2.0)
    model: Any = SimpleNamespace(forced=False, remembering=(), names=("b.Y", "a.X"))
    given: Any = (history, vibration, slice(100, 1500), 55.0, stability, model, "dopri8", 1e-7)
    found: Any = _approach(*given)
    np.testing.assert_array_equal(found.states, np.hstack([q[100:1500, [3, 0]], v[100:1500, [3, 0]]]))
    assert (found.duration_s, found.sample_rate, found.steps) == (TIME[-1], pytest.approx(2000.0), 417)
    assert (found.frequency_Hz, found.model, found.solver, found.tolerance) == (55.0, model, "dopri8", 1e-7)
    np.testing.assert_array_equal(found.steady, [3.0, 0.0])
    assert _approach(*given[:2], slice(2500, None), *given[3:]) is None  # where speed or load change  # pyright: ignore[reportCallIssue]
    for name, value in (("forced", True), ("remembering", ("temperature",))):
        assert _approach(*given[:5], SimpleNamespace(**{**vars(model), name: value}), *given[6:]) is None  # pyright: ignore[reportArgumentType, reportCallIssue]


def test_what_decays_slowest_is_a_mode_or_else_the_overdamped_motion():
    modes: Any = [
        SimpleNamespace(label=f"X {rate}", growth_rate=rate, frequency_Hz=f) for rate, f in ((-4.0, 90.0), (-2.0, 70.0))
    ]
    stability: Any = SimpleNamespace(divergence=None, modes=modes, eigenvalues=np.array([-2 + 9j, -2 - 9j]))
    assert slowest(stability, modes) == Slowest("X -2.0", -2.0, 70.0)
    assert slowest(stability, ()) is None
    growing: Any = SimpleNamespace(label="Y", growth_rate=-0.9e-9 * 50, frequency_Hz=50.0)
    assert slowest(stability, [*modes, growing]) is None
    growing.growth_rate = -1.1e-9 * 50
    assert slowest(stability, [*modes, growing]) == Slowest("Y", -1.1e-9 * 50, 50.0)
    stability.modes, stability.eigenvalues = (), np.array([-30.0 + 0j, -4.0, -7.0])
    assert slowest(stability, ()) == Slowest("the overdamped motion", -4.0, pytest.approx(4.0 / (2 * np.pi)))  # pyright: ignore[reportArgumentType]
    # Not what oscillates in coordinates that nothing moves, whether it decays or grows.
    stability.eigenvalues = np.array([-30.0, -4.0, -0.1 + 9j, -0.1 - 9j, 5 + 7j, 5 - 7j])
    assert slowest(stability, ()) == Slowest("the overdamped motion", -4.0, pytest.approx(4.0 / (2 * np.pi)))  # pyright: ignore[reportArgumentType]
    stability.eigenvalues = np.array([-30.0 + 0j, -2e-8])
    assert slowest(stability, ()) is None
    stability.divergence = 1.0
    stability.modes = modes
    assert slowest(stability, modes) is None


@pytest.mark.parametrize(
    ("fraction", "rate", "decays"),
    [
        (0.09, -1e-9, True), (0.09, 0.0, False), (0.11, -4.9, False), (0.11, -5.1, True), (0.89, -5.1, True),
        (0.91, -50.0, False), (0.05, 3.0, False),
    ],
)  # fmt: skip
def test_a_motion_decays_by_its_rate_within_the_boundaries(fraction, rate, decays):
    assert is_decaying(fraction, rate, -10.0) == decays


def test_a_record_is_looked_at_from_where_it_came_below_the_boundaries_and_by_its_halves(monkeypatch):
    ratio = np.where(np.arange(4000) < 2600, 0.95, 0.3)
    ratio[2700] = 0.4
    monkeypatch.setattr(decay, "boundary_ratio", lambda *_: ratio)
    vibration, _ = seen_by({}, RNG.normal(size=(4000, 6)))
    # 1400 samples at 2 kHz are 20 periods of 28.6 Hz.
    assert decay._below_boundaries(vibration, slice(500, 3999), Slowest("X", -1.0, 29.0), two_shoes()) == (
        slice(2600, 3999), 0.4
    )  # fmt: skip
    assert decay._below_boundaries(vibration, slice(500, 4000), Slowest("X", -1.0, 28.0), two_shoes()) == (
        slice(500, 4000), 0.95
    )  # fmt: skip
    assert decay._below_boundaries(vibration, slice(2650, 2690), Slowest("X", -1.0, 1.0), two_shoes())[1] == 0.3
    mass = np.array([2.0, 0.03, 3.0, 0.1, 0.05, 1.0])
    velocity = RNG.normal(size=(4000, 6))
    vibration, _ = seen_by({}, 0 * velocity, velocity)
    before, after = (float((part**2).mean(axis=0) @ mass) for part in (velocity[700:900], velocity[900:1101]))
    found = decay._rate(vibration, slice(700, 1101), mass)
    assert found == pytest.approx(np.log(after / before) / (401 / 2000.0))
