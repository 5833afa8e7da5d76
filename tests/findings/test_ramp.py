"""Run-up and coast-down: growth integrated along the way, squeals with their speeds, hysteresis."""

import dataclasses
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest
import xarray
from rich.console import Console
from scipy.optimize import brentq

from drumsqueal.findings import ramp as ramp_module
from drumsqueal.findings.ramp import (
    CampbellLine,
    Passage,
    PassageGrowth,
    Ramp,
    find_passages,
    growth_against_boundary,
    predicted_squeal,
    ramp_sentences,
)
from drumsqueal.findings.saturation import SpectralLine
from drumsqueal.findings.signals.growth import modal_amplitudes
from drumsqueal.findings.squeals import (
    Hysteresis,
    Squeal,
    SquealEnd,
    find_hysteresis,
    find_spans,
    instant_at,
    sustained_until,
)
from drumsqueal.findings.vibration import Vibration, amplitudes_at_boundary, changes
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from drumsqueal.physics.model import Model, build_model
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.questions.run.answer import print_findings
from drumsqueal.scene import load_scene
from drumsqueal.simulation import Result, run
from drumsqueal.solve.linear import passage as passage_module
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.linear.passage import (
    MOST_PIECES,
    Along,
    corners_of,
    follow_operation,
    modes_along,
    point_in_time,
)
from drumsqueal.solve.motion import integrate

RAMP = Path(__file__).parents[2] / "scenarios" / "ramp.toml"
FOLD, CRITICAL = 47.9433, 10.6123  # rad/s: the last stable cycle and the Hopf point of the damped brake, docs/onset.md


def curve(s):
    """A coefficient whose slope −0.3 + 0.3 s changes its sign at 1 m/s."""
    return 0.5 - 0.3 * s + 0.15 * s * s


def block(times, speeds, stiffness: float = 1.0) -> Model:
    model = block_on_belt(curve, stiffness=stiffness)
    operation = Operation(PiecewiseLinear(np.array(times), np.array(speeds)), Constant(1.0))
    return dataclasses.replace(model, operation=operation)


def along_of(model: Model, until: float) -> Along:
    (along,) = modes_along(follow_operation(model, until), corners_of(model, until))
    return along


def test_growth_along_the_way_is_the_integral_in_closed_form():
    # λ = −μ'(V)/2 of a unit mass under a unit load, so that ∫ Re λ dt = −T (μ(V₁) − μ(V₀)) / (2 (V₁ − V₀)) on each
    # ramp, and the amplitude of a frequency that changes goes with ω^−½.
    until, speeds = 300.0, [2.0, 0.2, 1.5]
    along = along_of(block([0.0, 200.0, 300.0], speeds), until)
    parts = [
        -time * (curve(after) - curve(before)) / (2 * (after - before))
        for time, before, after in zip((200.0, 100.0), speeds, speeds[1:], strict=False)
    ]
    corner = int(np.flatnonzero(along.time == 200.0)[0])
    turned = [np.log(along.modes[0].eigenvalue.imag / along.modes[k].eigenvalue.imag) / 2 for k in (corner, -1)]
    # The rate is linear in time on each ramp: Simpson's rule is exact, and so is the change of shape between two
    # instants; round-off was found.
    assert along.growth[corner] == pytest.approx(parts[0] + turned[0], abs=1e-6)
    assert along.growth[-1] == pytest.approx(sum(parts) + turned[1], abs=1e-6)
    # Half-way through the second ramp, between two instants that were followed.
    half = (1.5 - 0.2) * 0.51 + 0.2
    wanted = parts[0] - 51.0 * (curve(half) - curve(0.2)) / (2 * (half - 0.2))
    wanted += np.log(along.modes[0].eigenvalue.imag / np.sqrt(1 - (0.15 - 0.15 * half) ** 2)) / 2
    assert along.growth_at(np.array([251.0]))[0] == pytest.approx(wanted, abs=1e-4)


def test_growth_counts_from_where_a_mode_turns_unstable():
    # Its rate t − 1 is negative up to 1 s: what it has lost by then, half an e-fold, is no debt of what comes after.
    time = np.linspace(0.0, 3.0, 7)
    modes: Any = tuple(SimpleNamespace(growth_rate=t - 1, right=np.array([1.0, 4j])) for t in time)
    along = Along("X", time, modes, np.zeros((7, 1)), time**2 / 2 - time)
    model = block([0.0, 3.0], [6.0, 3.0])
    times, growth, room = growth_against_boundary(along, 1.0, 3.0, model)
    assert (times[0], times[-1]) == (1.0, 3.0)
    np.testing.assert_allclose(growth, (times - 1) ** 2 / 2, atol=1e-12)  # the cubic through a parabola is exact
    # Slip reverses where the amplitude of the velocity, 4 rad/s of the displacement's, is the speed of the belt.
    speeds = np.interp(times, [0.0, 3.0], [6.0, 3.0])
    # Its logarithm is linear between instants that are h = 0.5 s apart: off by (h/V)²/8 at most.
    np.testing.assert_allclose(room, np.log(speeds / 4), atol=0.5**2 / 8 / 3**2)


def test_a_passage_is_predicted_where_growth_reaches_the_boundary(monkeypatch):
    # λ = 0.15 (1 − V) of a unit mass on a belt that slows down from 1.4 to 0.8 m/s in 600 s: from V = 1 on it grows by
    # 75 (1 − V)², and its slip reverses at an amplitude V.
    speeds, until = [1.4, 0.8], 600.0
    model = block([0.0, until], speeds)
    instants = np.linspace(0.0, until, 61)
    known = np.interp(instants, [0.0, until], speeds)
    modes: Any = [
        SimpleNamespace(eigenvalue=rate + 1j, growth_rate=rate, unstable=rate > 0, right=np.array([1.0, 1j]))
        for rate in 0.15 * (1 - known)
    ]
    along = Along("X", instants, tuple(modes), curve(known)[:, None], 75 * ((1 - known) ** 2 - 0.4**2))
    branches: Any = SimpleNamespace(critical=[SimpleNamespace(value=400.0, label="X")])
    # At V = 1 it is an oscillator of 1 rad/s: x − i ẋ turns on a circle of its amplitude.
    neutral = SimpleNamespace(eigenvalue=1j, frequency_Hz=1 / (2 * np.pi), left=np.array([0.5, 0.5j]))
    monkeypatch.setattr(ramp_module, "point_in_time", lambda *_: SimpleNamespace(modes=(neutral,)))
    time = np.arange(0.0, until, 0.2)
    stability: Any = SimpleNamespace(coordinates=("X",), steady_state=np.array([curve(1.4)]))
    slopes = np.gradient(curve(known), instants)

    def passage(size: float, *squeals: Squeal):
        steady, moving = (np.interp(time, instants, each) for each in (curve(known), slopes))
        q, v = steady + size * np.cos(time), moving - size * np.sin(time)
        both = {"displacement": (("time", "coordinate"), q[:, None]), "velocity": (("time", "coordinate"), v[:, None])}
        history = xarray.Dataset(both, {"time": time, "coordinate": ["X"]})
        (found,) = find_passages([along], branches, squeals, Vibration(history, stability), model)
        assert found.unstable_from.time_s == pytest.approx(400.0)
        assert found.amplitude == pytest.approx(size, rel=1e-6, abs=1e-16)
        assert found.growth_available == pytest.approx(75 * 0.2**2, rel=1e-9)
        return found

    found = passage(0.1)
    reached: Any = brentq(lambda v: 75 * (1 - v) ** 2 - np.log(v / 0.1), 0.8, 1.0)
    assert found.outcome is PassageGrowth.REACHES
    assert found.predicted is not None
    # ln of the boundary is linear between instants that are 0.01 m/s apart: 2e-5 of an e-fold.
    assert found.predicted.drum_speed_rad_per_s == pytest.approx(reached, rel=1e-5)
    # It is that of the first of the instants looked at, 0.5 s or 5e-4 m/s apart, at which there is enough.
    assert found.growth_needed == pytest.approx(np.log(reached / 0.1), abs=7e-4)
    faint = passage(0.01)
    assert (faint.outcome, faint.predicted) == (PassageGrowth.TOO_LITTLE, None)
    assert faint.growth_needed == pytest.approx(np.log(0.8 / 0.01), abs=1e-4)
    # What is there already, what is not there, and what leads to the squeal that sets in on the way.
    assert passage(1.1).outcome is PassageGrowth.BEYOND_ALREADY
    assert passage(0.0).outcome is PassageGrowth.NOT_EXCITED
    for begins, ends, outcome, leads in (
        (300.0, 500.0, PassageGrowth.SQUEALS_ALREADY, False),
        (300.0, 390.0, PassageGrowth.REACHES, False),
        (450.0, 600.0, PassageGrowth.REACHES, True),
    ):
        with_squeal = passage(0.1, squeal(model, begins, ends))
        assert with_squeal.outcome is outcome
        assert (with_squeal.measured is not None) == leads


def test_a_profile_that_comes_back_within_the_record_changes():
    # The corner lies between the samples at both ends; before it begins and after it has ended nothing changes.
    model: Any = SimpleNamespace(operation=Operation(PiecewiseLinear([1.0, 2.0, 3.0], [5.0, 9.0, 5.0]), Constant(1.0)))
    spans = [(0.0, 4.0), (0.0, 1.0), (3.0, 9.0), (0.0, 1.1), (1.5, 2.5)]
    assert [changes(model, np.array(span)) for span in spans] == [True, False, False, True, True]


@pytest.mark.thorough
def test_the_way_of_a_changing_frequency_is_followed():
    # A slope of ±0.9 per m/s of a unit oscillator: its frequency falls from 1 to √(1 − 0.45²) and rises again.
    model = block_on_belt(lambda s: 0.5 - 0.45 * s * s, damping=1.0)
    operation = Operation(PiecewiseLinear(np.array([0.0, 100.0]), np.array([0.05, 1.0])), Constant(1.0))
    along = along_of(dataclasses.replace(model, operation=operation), 100.0)
    rates = np.array([mode.eigenvalue for mode in along.modes])
    wanted = -0.5 * 100.0 + 0.45 * 100.0 * (1.0**2 - 0.05**2) / (2 * 0.95) * 1.0
    shape = -np.log(rates[-1].imag / rates[0].imag) / 2
    assert abs(shape) > 0.06
    assert along.growth[-1] == pytest.approx(wanted + shape, abs=1e-3)


def test_a_transient_grows_by_the_integral():
    # The difference of two transients, one of which is started, is free of the way that the equilibrium moves.
    until, size = 60.0, 1e-4
    model = block([0.0, until], [1.4, 0.2], stiffness=100.0)
    how: Any = {"sample_rate": 40.0, "tolerance": 1e-9}
    moved, still = (integrate(model, {"displacement": [x]}, until, **how) for x in (size, 0.0))
    state = np.hstack([moved.displacement - still.displacement, moved.velocity - still.velocity])[-1:]
    (mode,) = point_in_time(model, until).modes
    grown = np.log(2 * np.abs(modal_amplitudes(mode.left[:, None], state)[0, 0]) / size)
    along = along_of(model, until)
    assert along.growth[-1] > 1.5
    # The equilibrium moves by 1e-4 m/s, a part of the belt's speed which the eigenvalues leave aside: 1e-3 of a fold.
    assert grown == pytest.approx(float(along.growth[-1]), rel=5e-3)


@pytest.mark.thorough
def test_a_measured_curve_of_many_points_is_not_followed_from_one_to_the_next():
    times = np.linspace(0.0, 60.0, 2000)
    model = block(times, 1.4 - 0.02 * times + 1e-4 * np.sin(7 * times), stiffness=100.0)
    followed = follow_operation(model, 60.0)
    assert len(followed.points) < 3 * MOST_PIECES
    wanted = -30.0 * (curve(0.2) - curve(1.4)) / -1.2
    (along,) = modes_along(followed, corners_of(model, 60.0))
    assert along.growth[-1] == pytest.approx(wanted, abs=2e-3)


@pytest.mark.thorough
@pytest.mark.parametrize("speed", [0.5, 5.0])
def test_a_mode_reaches_the_boundary_at_the_amplitude_that_is_named(nominal, speed):
    # At 0.5 rad/s the slip reverses first, at 5 rad/s the lining lifts off.
    model = build_model(nominal.with_values({"drum.speed": speed}))
    stability = analyse_stability(model)
    (mode,) = (each for each in stability.modes if each.name == "Y")
    (limit,) = amplitudes_at_boundary(model, [mode], np.zeros((1, 3)), [0.0])
    turning = np.exp(2j * np.pi * np.arange(64) / 64)

    observe = jax.jit(jax.vmap(lambda state: model.observe(0.0, state[:3], state[3:])))

    def passed(size: float) -> bool:
        seen = observe(np.real(size * turning[:, None] * mode.right))
        return bool(np.min(seen.contact_fraction) < 1 - 1e-9 or np.max(seen.slip_reversed_fraction) > 1e-9)

    # A phase of 64 misses the largest value by 1e-3 at most, the 65 points along the lining by 3e-4.
    assert not passed(0.999 * limit)
    assert passed(1.003 * limit)


# --- squeals in synthetic records ------------------------------------------------------------------------------------


def flags(size: int, *parts: tuple[int, int]) -> np.ndarray:
    found = np.zeros(size, dtype=bool)
    for first, stop in parts:
        found[first:stop] = True
    return found


@pytest.mark.parametrize(
    ("beyond", "sticks", "wanted"),
    [
        ([], [], []),
        ([(100, 300)], [], [(100, 299, SquealEnd.DIES_OUT)]),
        ([(0, 300)], [], [(0, 299, SquealEnd.DIES_OUT)]),
        ([(800, 1000)], [], [(800, 999, SquealEnd.RECORD)]),
        ([(995, 1000)], [], [(995, 999, SquealEnd.RECORD)]),
        ([(100, 300), (340, 500), (560, 700)], [], [(100, 499, SquealEnd.DIES_OUT), (560, 699, SquealEnd.DIES_OUT)]),
        ([(100, 105)], [], []), ([(100, 119)], [], []), ([(100, 120)], [], [(100, 119, SquealEnd.DIES_OUT)]),
        # A pause of 50 samples ends no squeal, neither before more of it nor before the end of the record or sticking.
        ([(100, 300), (350, 400), (450, 470)], [], [(100, 469, SquealEnd.DIES_OUT)]),
        ([(100, 300), (351, 400)], [], [(100, 299, SquealEnd.DIES_OUT), (351, 399, SquealEnd.DIES_OUT)]),
        ([(600, 950)], [], [(600, 949, SquealEnd.RECORD)]),
        ([(600, 949)], [], [(600, 948, SquealEnd.DIES_OUT)]),
        ([(600, 850)], [(900, 1000)], [(600, 849, SquealEnd.STICKS)]),
        ([(600, 849)], [(900, 1000)], [(600, 848, SquealEnd.DIES_OUT)]),
        ([(100, 200)], [(250, 300), (340, 390)], [(100, 389, SquealEnd.DIES_OUT)]),
        ([(100, 200)], [(200, 251)], [(100, 199, SquealEnd.STICKS)]),
        # Stick and slip in turn; sticking that goes on to the end, or for long, is rest.
        ([(200, 210)], [(210, 240), (250, 280), (290, 320)], [(200, 319, SquealEnd.DIES_OUT)]),
        ([(600, 880)], [(900, 1000)], [(600, 879, SquealEnd.STICKS)]),
        ([(100, 200), (500, 600)], [(210, 480)], [(100, 199, SquealEnd.STICKS), (500, 599, SquealEnd.DIES_OUT)]),
        ([(400, 600)], [(0, 300)], [(400, 599, SquealEnd.DIES_OUT)]),
        ([], [(0, 1000)], []),
    ],
)  # fmt: skip
def test_squeals_are_found_where_they_were_put(beyond, sticks, wanted):
    assert find_spans(flags(1000, *beyond), flags(1000, *sticks), 50, 20) == wanted


def test_a_squeal_is_sustained_until_it_falls_as_a_small_motion():
    # Of a mode that decays at 40 1/s the energy rises slowly, and falls at 80 1/s from 0.6 s on.
    model = block([0.0, 1.0], [2.0, 2.0])
    along = along_of(model, 1.0)
    decaying = along._replace(modes=tuple(m._replace(eigenvalue=-40 + 1j * m.eigenvalue.imag) for m in along.modes))
    time = np.linspace(0.2, 0.9, 701)
    energy = np.where(time < 0.6, 1 + time, 1.6 * np.exp(-80 * (time - 0.6)))
    assert sustained_until(time, energy, [decaying], 0.9) == pytest.approx(0.6, abs=2e-3)
    # What falls so from the first on is not sustained at all, with a beat as without; it may do so after it has landed
    # on a motion that lasts.
    beat = np.exp(-80 * time + 0.1 * np.sin(200 * time))
    for falling in (np.exp(-80 * time), beat):
        assert sustained_until(time, falling, [decaying], 0.9) == time[0]
    landed = np.exp(-80 * np.clip(time, None, 0.3) - 80 * np.clip(time - 0.4, 0, None))
    assert sustained_until(time, landed, [decaying], 0.9) == pytest.approx(0.4, abs=2e-3)
    # One that falls more slowly than that, and one that falls where a mode grows, is sustained to its end.
    assert sustained_until(time, np.exp(-20 * time), [decaying], 0.9) == 0.9
    growing = along._replace(modes=tuple(m._replace(eigenvalue=4 + 1j * m.eigenvalue.imag) for m in along.modes))
    assert sustained_until(time, energy, [growing], 0.9) == 0.9


def squeal(model: Model, first: float, last: float, gone: float | None = None) -> Squeal:
    """Return a squeal that is sustained to a time (s), and is gone at a later one."""
    begins, until = instant_at(model, first), instant_at(model, last)
    ends = until if gone is None else instant_at(model, gone)
    return Squeal(
        sets_in=begins,
        largest=begins,
        amplitude=1.0,
        line=None,
        sustained_until=until,
        ends=ends,
        end=SquealEnd.DIES_OUT,
    )


def test_hysteresis_is_what_squeals_one_way_only():
    # Down from 60 to 10 in 1 s, up to 60 in 2 s: squeal from 20 down, and up to 45; what is left of it decays to 55.
    model = block([0.0, 1.0, 3.0], [60.0, 10.0, 60.0])
    (found,) = find_hysteresis((squeal(model, 0.8, 2.4, gone=2.8),), model, 3.0)
    assert (found.key, found.squeals_while) == ("drum.speed", "rises")
    assert (found.low, found.high) == pytest.approx((20.0, 45.0))
    two = squeal(model, 0.8, 1.7), squeal(model, 1.7, 2.4)  # one after the other
    assert find_hysteresis(two, model, 3.0) == (found,)
    apart = find_hysteresis((squeal(model, 1.4, 1.8), squeal(model, 2.0, 2.2)), model, 3.0)
    assert [(each.low, each.high) for each in apart] == [pytest.approx((20.0, 30.0)), pytest.approx((35.0, 40.0))]
    # On the way up alone there is nothing to compare it with; nor where both ways squeal alike.
    assert find_hysteresis((squeal(model, 1.5, 2.4),), block([1.0, 3.0], [10.0, 60.0]), 3.0) == ()
    assert find_hysteresis((squeal(model, 0.6, 1.8),), model, 3.0) == ()


def test_an_instant_has_the_way_that_leads_to_it():
    model = block([0.0, 1.0, 3.0], [60.0, 10.0, 60.0])
    rates = [instant_at(model, time).drum_speed_rate_rad_per_s2 for time in (0.0, 0.5, 1.0, 1.001, 3.0, 3.1)]
    assert rates == pytest.approx([-50.0, -50.0, -50.0, 25.0, 25.0, 0.0])
    assert instant_at(model, 2.0).drum_speed_rad_per_s == pytest.approx(35.0)


def test_a_ramp_in_sentences():
    # Down from 60 to 10 rad/s in 1 s, up to 60 in 2 s: at 0.8 s 20 rad/s falling, at 2 s 35 rising, at 2.4 s 45.
    model = block([0.0, 1.0, 3.0], [60.0, 10.0, 60.0])
    line = SpectralLine("Y", 950.4, 8e-4)
    dies = squeal(model, 0.8, 2.4, gone=2.8).model_copy(
        update={"largest": instant_at(model, 2.0), "line": line, "amplitude": 8e-4}
    )
    lasts, sticks = (
        squeal(model, first, 3.0).model_copy(update={"end": end})
        for first, end in ((0.0, SquealEnd.RECORD), (0.5, SquealEnd.STICKS))
    )
    reaches = Passage(
        mode="Y", unstable_from=instant_at(model, 0.6), unstable_until=instant_at(model, 2.0), frequency_Hz=950.0,
        amplitude=1e-6, growth_available=9.87, outcome=PassageGrowth.REACHES, growth_needed=6.54,
        predicted=instant_at(model, 0.75), measured=instant_at(model, 0.8),
    )  # fmt: skip
    short = reaches.model_copy(
        update={
            "mode": "X",
            "outcome": PassageGrowth.TOO_LITTLE,
            "predicted": None,
            "unstable_from": instant_at(model, 0.0),
        }
    )
    boundless = reaches.model_copy(update={"growth_needed": np.inf, "measured": None})
    other = {"key": "drum.speed", "low": 20.04, "high": 45.0, "squeals_while": "rises"}
    lines = (CampbellLine(mode="Y", name="Y", time_s=(0.0, 3.0), frequency_Hz=(1.0, 1.0), growth_rate_1_per_s=(0, 0)),)

    def said(passages, squeals=()) -> tuple[str, list[str]]:
        found = Ramp(
            keys=("drum.speed",), squeals=squeals, passages=passages, hysteresis=(Hysteresis(**other),), lines=lines
        )
        sentences = list(ramp_sentences(found, None))  # pyright: ignore[reportArgumentType] - for modes that bend
        assert sentences.pop() == (
            "Hysteresis: from 20 to 45 rad/s the brake squeals while the drum speed rises and is quiet while it falls."
        )
        return predicted_squeal(found), sentences

    assert said((reaches, short), (dies, lasts, sticks)) == (
        "squeal in Y from 0.6 s (30 rad/s, falling) to 2 s (35 rad/s, rising); "
        "X from 0 s (60 rad/s, falling) to 2 s (35 rad/s, rising)",
        [
            "Squeal sets in at 0.8 s (20 rad/s, falling) and dies out at 2.8 s (55 rad/s, rising), sustained until "
            "45 rad/s and largest at 35 rad/s (800 µm of Y, 950 Hz); it is there at t = 0 (60 rad/s) and lasts until "
            "the record ends, at 3 s (60 rad/s, rising); it sets in at 0.5 s (35 rad/s, falling) and lasts until the "
            "lining sticks to the drum, at 3 s (60 rad/s, rising).",
            "From its amplitude when it turns unstable, Y has to grow by 6.54 e-folds to reach a contact boundary: "
            "∫ Re λ dt comes to that after 0.15 s, at 0.75 s (22.5 rad/s, falling); the transient gets there at 0.8 s.",
            "From its amplitude at the start, X has to grow by 6.54 e-folds to reach a contact boundary, but gathers "
            "9.87 on the way, and the transient gets there at 0.8 s (20 rad/s, falling).",
        ],
    )
    always = boundless.model_copy(
        update={"unstable_from": instant_at(model, 0.0), "unstable_until": instant_at(model, 3.0)}
    )
    quiet = reaches.model_copy(update={"measured": None})
    assert said((quiet, always)) == (
        "squeal in Y from 0.6 s (30 rad/s, falling) to 2 s (35 rad/s, rising); Y throughout",
        [
            "From its amplitude when it turns unstable, Y has to grow by 6.54 e-folds to reach a contact boundary: "
            "∫ Re λ dt comes to that after 0.15 s, at 0.75 s (22.5 rad/s, falling); the transient does not squeal "
            "then.",
            "Y gathers 9.87 e-folds while it is unstable, but at the end of that no amplitude of it alone would reach "
            "a contact boundary.",
        ],
    )
    assert said(()) == ("no squeal", [])


def test_instants_come_close_to_a_standstill_and_follow_no_curve_of_many_points(monkeypatch):
    monkeypatch.setattr(passage_module, "follow_modes", lambda model_at, values: values)
    found: Any = follow_operation(block([0.0, 4.0, 10.0], [2.0, -2.0, -1.0]), 10.0)
    # 24 intervals between corners; the drum stands still at 2 s, and a thousandth of the 4 s about it are looked at.
    assert {0.0, 2.0 - 4e-3, 2.0 + 4e-3, 4.0, 10.0} <= set(found)
    assert found.size == 24 + 24 + 1 + 2
    times = np.linspace(0.0, 60.0, 2000)
    assert follow_operation(block(times, 1.4 + 0.1 * np.sin(times)), 60.0).size == (MOST_PIECES - 1) * 2 + 1  # pyright: ignore[reportAttributeAccessIssue]
    assert point_in_time(block([0.0, 4.0], [2.0, -2.0]), 2.0).reason


# --- the shipped run-up and coast-down -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ramp() -> Result:
    """Return the shipped run-up and coast-down."""
    return run(load_scene(RAMP))


@pytest.mark.thorough
def test_squeal_sets_in_and_dies_out_where_folds_and_eigenvalues_let_it(ramp):
    found = ramp.findings.ramp
    (squeal,), (passage,) = found.squeals, found.passages
    # It sets in on the way down, below the Hopf point; it lives on beyond the fold for as long as it takes to pass it.
    assert squeal.sets_in.drum_speed_rate_rad_per_s2 == -15
    assert 3 < squeal.sets_in.drum_speed_rad_per_s < CRITICAL
    assert squeal.end is SquealEnd.DIES_OUT
    assert squeal.ends.drum_speed_rate_rad_per_s2 == 57
    assert FOLD < squeal.sustained_until.drum_speed_rad_per_s < FOLD + 3
    assert squeal.sustained_until.drum_speed_rad_per_s < squeal.ends.drum_speed_rad_per_s < 60
    # The largest motion is that of the last cycles before the fold: 815 µm and 939 Hz at 47 rad/s, docs/onset.md.
    assert squeal.largest.drum_speed_rad_per_s == pytest.approx(FOLD, abs=1)
    assert squeal.amplitude == pytest.approx(815e-6, rel=0.01)
    assert squeal.line.frequency_Hz == pytest.approx(939, abs=5)
    # The mode turns unstable, and stable again, at the Hopf point.
    speeds = [each.drum_speed_rad_per_s for each in (passage.unstable_from, passage.unstable_until)]
    assert speeds == pytest.approx([CRITICAL, CRITICAL], rel=1e-5)
    (hysteresis,) = found.hysteresis
    assert hysteresis.squeals_while == "rises"
    assert hysteresis.low == pytest.approx(squeal.sets_in.drum_speed_rad_per_s)
    assert hysteresis.high == pytest.approx(squeal.sustained_until.drum_speed_rad_per_s)


@pytest.mark.thorough
def test_growth_along_the_way_says_when_squeal_sets_in(ramp):
    (passage,) = ramp.findings.ramp.passages
    assert passage.mode == "Y"
    assert passage.outcome is PassageGrowth.REACHES
    assert passage.measured == ramp.findings.ramp.squeals[0].sets_in
    # 0.1 ms of 0.4 s was found; the boundary is reached once a period, 0.7 ms.
    assert passage.predicted.time_s == pytest.approx(passage.measured.time_s, abs=1e-3)
    assert passage.predicted.time_s - passage.unstable_from.time_s > 0.3
    # What is left of the start where the mode turns unstable is what ∫ Re λ dt leaves of it: to a per cent.
    (along,) = (
        each
        for each in modes_along(follow_operation(build_model(ramp.scene), 2.1), np.array([0.8, 1.8]))
        if each.label == "Y"
    )
    start = ramp.scene.start.displacement
    (mode,) = (each for each in ramp.stability.modes if each.name == "Y")
    state = np.array([start.get(name, 0.0) for name in ramp.stability.coordinates] + [0.0] * 6)
    left = 2 * abs(np.vdot(mode.left, state)) * np.exp(along.growth_at(np.array([passage.unstable_from.time_s]))[0])
    assert passage.amplitude == pytest.approx(left, rel=1e-2)


@pytest.mark.thorough
def test_the_verdict_reports_the_speeds_and_the_hysteresis(ramp):
    verdict = ramp.findings.verdict
    assert "predicts squeal in Y from 0.2925 s (10.6 rad/s, falling) to 0.9335 s (10.6 rad/s, rising)" in verdict
    assert "Squeal sets in at 0.701" in verdict
    assert "the brake squeals while the drum speed rises and is quiet while it falls" in verdict
    assert "at t = 0 s" not in verdict
    assert list(ramp_sentences(ramp.findings.ramp, ramp.scene))
    again = type(ramp.findings).model_validate_json(ramp.findings.model_dump_json())
    assert again.ramp == ramp.findings.ramp


@pytest.mark.thorough
def test_a_disturbance_that_decays_is_no_squeal(nominal):
    # Under constant friction all modes decay. A start of 40 µm is beyond the boundaries at first, and falls throughout.
    changes = {
        "friction": {"law": "constant", "coefficient": 0.3},
        "damping": {"ratio": 0.001},
        "drum.speed": {"time": [0, 0.2, 0.4], "value": [20, 25, 20]},
        "start": {"displacement": {"Y": 4e-5}, "velocity": {}},
        "simulate.duration": 0.4,
    }
    found = run(nominal.with_values(changes)).findings
    assert found.edge_reached_s == 0
    assert found.ramp is not None
    assert (found.ramp.squeals, found.ramp.hysteresis) == ((), ())
    assert "squeals" not in found.verdict


@pytest.mark.thorough
def test_a_mode_without_a_boundary_has_a_sentence_of_its_own(ramp):
    found = ramp.findings.ramp
    endless = {"growth_needed": np.inf, "outcome": PassageGrowth.TOO_LITTLE, "predicted": None, "measured": None}
    passage = found.passages[0].model_copy(update=endless)
    changed = found.model_copy(update={"squeals": (), "hysteresis": (), "passages": (passage,)})
    assert list(ramp_sentences(changed, ramp.scene)) == [
        "Y gathers 14 e-folds while it is unstable, but at the end of that no amplitude of it alone would reach a "
        "contact boundary."
    ]
    printed = StringIO()
    print_findings(Console(file=printed, width=100), ramp.findings.model_copy(update={"ramp": changed}))
    assert "inf" not in printed.getvalue().split("Growth integrated")[1].split("After growth")[0]


@pytest.mark.thorough
def test_a_load_that_rises_is_followed_in_newtons(nominal):
    # The growth rates rise in proportion to the load; with 0.5 % of damping Y is neutral at 1137 N at 5 rad/s.
    load = {"time": [0, 0.05, 0.3], "value": [500, 1100, 4000]}
    scene = nominal.with_values({"contact.normal_load": load, "damping": {"ratio": 0.005}, "simulate.duration": 0.3})
    found = run(scene).findings
    assert found.ramp is not None
    (squeal,), passage = found.ramp.squeals, found.ramp.passages[0]
    assert passage.unstable_from.normal_load_N == pytest.approx(1137, abs=2)
    assert passage.measured == squeal.sets_in
    assert passage.predicted is not None
    assert squeal.sets_in is not None
    assert passage.predicted.normal_load_N == pytest.approx(squeal.sets_in.normal_load_N, rel=1e-2)
    assert squeal.end is SquealEnd.RECORD
    assert " N, rising)" in found.verdict
