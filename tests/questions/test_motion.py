"""The kind of a motion: Lyapunov exponents of systems that are known, and the command."""

import json
import re
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from along_y import OPTIONS, AlongY, brake_along_y
from drumsqueal import ConstantLaw, block_on_belt, find_cycle, load_scene, run
from drumsqueal.files.output_folder import to_json
from drumsqueal.findings import decay
from drumsqueal.findings.decay import Rest
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.schema import read_findings
from drumsqueal.findings.signals.growth import Exponents, lyapunov_exponents, orthonormalised
from drumsqueal.findings.signals.lines import Fundamentals, find_fundamentals, find_lines
from drumsqueal.findings.signals.regime import Cause, Regime, classify
from drumsqueal.questions.motion import study as study_module
from drumsqueal.questions.motion.answer import draw_section
from drumsqueal.questions.motion.study import (
    BLOCK,
    Doubt,
    MotionStudy,
    PoincareSection,
    _section,
    _settled,
    decide_attractor,
    describe_attractor,
    study_motion,
)

SAMPLES = 20  # an interval


def followed(rate, jacobian, state, interval, count, tangents):
    """Samples of a trajectory and how tangents grow, interval by interval: transition matrices by SciPy."""
    n = len(state)
    turned = np.linalg.qr(np.random.default_rng(0).normal(size=(n, tangents)))[0]
    records, logs = [], []

    def both(t, y):
        return np.concatenate([rate(t, y[:n]), (jacobian(t, y[:n]) @ y[n:].reshape(n, n)).ravel()])

    for _ in range(count):
        whole, times = np.concatenate([state, np.eye(n).ravel()]), np.linspace(0, interval, SAMPLES + 1)
        path = solve_ivp(both, (0, interval), whole, rtol=1e-7, atol=1e-9, t_eval=times).y
        records.append(path[:n, :-1].T)
        state = path[:n, -1]
        turned, grown = orthonormalised(path[n:, -1].reshape(n, n) @ turned)
        logs.append(grown)
    return np.concatenate(records), np.array(logs)


def lorenz(_, y):
    return np.array([10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]])


def of_lorenz(_, y):
    return np.array([[-10.0, 10.0, 0.0], [28 - y[2], -1.0, -y[0]], [y[1], y[0], -8 / 3]])


def van_der_pol(*speeds, damping=1.0):
    """Oscillators beside each other, each as many times faster than the first: a torus of as many frequencies."""
    times = np.array(speeds)

    def rate(_, y):
        x, v = y[0::2], y[1::2]
        return np.column_stack([times * v, times * (damping * (1 - x**2) * v - x)]).ravel()

    def jacobian(_, y):
        matrix = np.zeros((y.size, y.size))
        for k, speed in enumerate(times):
            x, v = y[2 * k : 2 * k + 2]
            matrix[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = speed * np.array(
                [[0.0, 1.0], [-2 * damping * x * v - 1, damping * (1 - x**2)]]
            )
        return matrix

    return rate, jacobian


KNOWN: dict[str, Any] = {  # rate and Jacobian, start, interval (s) and how many
    "lorenz": ((lorenz, of_lorenz), [1.0, 1.0, 20.0], 0.5, 400),
    "cycle": (van_der_pol(1.0), [2.0, 0.0], 1.0, 270),
    "two": (van_der_pol(1.0, 2**0.5), [2.0, 0.0, 2.0, 0.5], 1.0, 270),
    "three": (van_der_pol(1.0, 2**0.5, 5**0.5), [2.0, 0.0, 2.0, 0.5, 1.0, 1.0], 1.0, 270),
    "slow": (van_der_pol(1.0, 2**0.5, damping=0.02), [2.0, 0.0, 2.0, 0.0], 1.0, 510),
}


@cache
def known(name):
    """The record, 20 samples an interval, and the growth of four tangents."""
    (rate, jacobian), start, interval, count = KNOWN[name]
    return followed(rate, jacobian, np.array(start), interval, count, min(4, len(start)))


def test_lyapunov_exponents_of_lorenz():
    found = lyapunov_exponents(known("lorenz")[1], 0.5)
    # 0.9056, 0 and −14.572 (J. C. Sprott, Chaos and Time-Series Analysis, 2003); their sum is the divergence, −41/3.
    wanted = np.array([0.9056, 0.0, -14.572])
    # Round-off decides which trajectory it is: those of 24 starts scatter by 0.0092, 0.0047 and 0.0089, and their
    # standard errors, of ten blocks and hence spread by a quarter, are 0.029 and from 0.012 to 0.051 for the first.
    error = np.abs(found.exponent_1_per_s - wanted)
    assert np.all(error < 5 * np.array([0.0092, 0.0047, 0.0089]))
    assert np.all(error < 3 * found.standard_error_1_per_s + 1e-3)
    assert 0.007 < found.standard_error_1_per_s[0] < 0.06
    assert found.exponent_1_per_s.sum() == pytest.approx(-41 / 3, abs=1e-4)
    assert found.chaotic
    # What comes together as surely as that parts is no chaos.
    assert not found._replace(exponent_1_per_s=-np.abs(found.exponent_1_per_s)).chaotic


def test_a_limit_cycle_is_not_chaotic():
    found = lyapunov_exponents(known("cycle")[1], 1.0)
    # Zero along the motion; the other is −1.0594 (the mean divergence over its period of 6.6633).
    assert found.exponent_1_per_s[0] == pytest.approx(0.0, abs=0.02)
    assert found.exponent_1_per_s[1] == pytest.approx(-1.0594, abs=0.02)
    assert not found.chaotic


@pytest.mark.thorough(but=["lorenz-0.6-kinds0", "cycle-0.15-kinds1"])  # tori: recurrence and lines decide, see below
@pytest.mark.parametrize(
    ("name", "lowest", "kinds"),
    [
        # 20 periods of the lowest frequency in the later half. Lorenz's mean drifts: it changes sides at random.
        ("lorenz", 0.6, {40: Doubt.REGIME, 400: Kind.CHAOTIC}),
        ("cycle", 0.15, {60: Doubt.REGIME, 270: Kind.PERIODIC}),
        ("two", 0.15, {60: Doubt.REGIME, 270: Kind.QUASI_PERIODIC}),
        ("three", 0.15, {100: Doubt.REGIME, 270: Kind.QUASI_PERIODIC}),
        # A disturbance decays at 0.02 1/s, and below 5/180 s = 0.028 1/s nothing can be distinguished from zero.
        ("slow", 0.5, {200: Doubt.MORE_ZEROS, 510: Kind.QUASI_PERIODIC}),
    ],
)
def test_known_attractors_are_recognised_in_the_record_that_was_asked_for_and_never_taken_for_others(
    name, lowest, kinds
):
    record, logs = known(name)
    interval = KNOWN[name][2]
    for count, wanted in kinds.items():
        late = record[count * SAMPLES // 2 : count * SAMPLES]
        rate = SAMPLES / interval
        regime = classify(late, rate, scale=np.ones(late.shape[1]), lowest_frequency=lowest)
        fundamentals = find_fundamentals(find_lines(late, rate, floor=3e-3))
        found = decide_attractor(
            regime, fundamentals, lyapunov_exponents(logs[:count], interval), count * interval, 0.0
        )
        assert (found.doubt or found.kind) == wanted
        if found.doubt:
            assert found.record_needed_s is not None
            assert count * interval < found.record_needed_s <= max(kinds) * interval


def test_the_standard_error_is_that_of_independent_growth():
    random = np.random.default_rng(7)
    means = [lyapunov_exponents(random.normal(1.0, 2.0, (1000, 1)), 0.5) for _ in range(200)]
    scatter = np.std([found.exponent_1_per_s[0] for found in means])
    told = np.mean([found.standard_error_1_per_s[0] for found in means])
    assert told == pytest.approx(4 / np.sqrt(900), rel=0.1)  # 200 draws of ten blocks: 2 % of a standard error
    assert told == pytest.approx(scatter, rel=0.2)  # 5 % for the scatter of 200


def test_too_few_intervals_are_refused():
    with pytest.raises(ValueError, match="growth is too short"):
        lyapunov_exponents(np.ones((5, 1)), 1.0)


# What the evidence makes of the kind


def exponents(*values: float, error: float = 0.5) -> Exponents:
    """Exponents of 4.5 s, known to 0.5 1/s by their standard errors: zero is what is below 5/4.5 = 1.1."""
    k = len(values)
    return Exponents(np.array(values), np.full(k, error), np.array([0.5, 5.0]), np.zeros((2, k)))


def regime(kind, *fundamentals: float, needed: float | None = None) -> Regime:
    return Regime(
        kind=kind,
        cause=Cause.TOO_SLOW,
        base_frequencies_Hz=fundamentals,
        recurrence_error=0.1,
        amplitude_drift=0.0,
        base_uncertainties_Hz=tuple(1e-3 for _ in fundamentals),
        record_needed_s=needed,
    )


TORUS = regime("quasi-periodic", 900.0, 70.0)
CYCLE = regime("periodic", 900.0)


@pytest.mark.parametrize(
    ("found", "exponents", "wanted", "needed", "why"),
    [
        (CYCLE, exponents(0.2, -5.0), Kind.PERIODIC, None, "One Lyapunov exponent is zero"),
        (CYCLE, exponents(9.0, 0.1), Doubt.POSITIVE, 10.0, "as in chaos"),
        (CYCLE, exponents(-3.0, -5.0), Doubt.NO_ZERO, 10.0, "none of −3.0 ± 1.5 and −5.0 ± 1.5 1/s is"),
        # Zero or a decay rate: 3 × 0.8 = 2.4 would have to fall to 1.5, so (2.4/1.5)² = 2.6 times the record.
        (CYCLE, exponents(0.1, -1.5, -9.0, error=0.8), Doubt.UNKNOWN_SIGN, 12.8, "of −1.5 ± 2.4 1/s is too large"),
        # 0.5 is below 5/4.5, and would stand out by a factor of two in 20 s.
        (CYCLE, exponents(0.0, -0.5, error=0.1), Doubt.MORE_ZEROS, 22.2, "two of +0.0 ± 1.1 and −0.5 ± 1.1"),
        # Nothing is seen to decay: no record follows from that.
        (CYCLE, exponents(0.2, -0.5, error=0.5), Doubt.MORE_ZEROS, None, "damps the motion, no record decides"),
        # So slow a decay, and known so well, that 2 × 1.11/10⁻⁴ records would show it.
        (CYCLE, exponents(0.0, -1e-4, error=1e-6), Doubt.MORE_ZEROS, 1.11e5, "a record of at least 120000 s"),
        # A zero that is not known as well as the decay rate beside it.
        (CYCLE, exponents(-1.0, -7.0, error=2.1), Doubt.UNKNOWN_SIGN, 10.0, "−1.0 ± 6.3 and −7.0 ± 6.3 1/s"),
        (TORUS, exponents(0.2, -0.3, -5.0), Kind.QUASI_PERIODIC, None, "Two Lyapunov exponents are zero"),
        (TORUS, exponents(0.2, -5.0), Doubt.FEWER_ZEROS, 10.0, "Two fundamental frequencies (900.000 and 70.000 Hz)"),
        (TORUS, exponents(9.0, 0.1), Doubt.POSITIVE, 10.0, "as in chaos"),
        (TORUS, exponents(0.2, -5.0, error=10.0), Doubt.UNKNOWN_SIGN, 10.0, "too large to distinguish zero from decay"),
        # Few periods of a slow frequency: 20 of them in the later half.
        (
            regime("quasi-periodic", 900.0, 2.0),
            exponents(0.2, -5.0),
            Doubt.FEWER_ZEROS,
            20.0,
            "at most one can be zero",
        ),
        (TORUS, None, Doubt.NO_EXPONENTS, 10.0, "no Lyapunov exponents are known"),
        (CYCLE, None, Kind.PERIODIC, None, "The record is too short"),  # recurrence is enough
        (regime("irregular"), exponents(9.0, 0.1, -5.0), Kind.CHAOTIC, None, "separate exponentially"),
        (regime("irregular"), exponents(9.0, -5.0, -8.0), Doubt.NO_ZERO, 10.0, "has a Lyapunov exponent of zero"),
        (regime("irregular"), exponents(1.4, -5.0), Doubt.NOT_POSITIVE, 10.0, "does not show chaos"),
        (regime("undecided"), exponents(9.0, 0.1, -5.0), Kind.CHAOTIC, None, "separate exponentially"),
        (regime("undecided"), exponents(0.1, -5.0), Doubt.REGIME, 10.0, "The record is too short"),
        (regime("undecided", needed=2.0), exponents(0.1, -5.0), Doubt.REGIME, 10.0, "The record is too short"),
        (regime("undecided", 40.0), exponents(0.1, -5.0), Doubt.REGIME, 10.0, "The record is too short"),
        (regime("undecided", needed=7.0), exponents(9.0, 0.1, -5.0), Doubt.REGIME, 14.0, "The record is too short"),
        (regime("steady"), None, Kind.STEADY, None, "The record is too short"),
    ],
)
def test_contradictions_leave_the_kind_open_and_say_which_record_would_do(found, exponents, wanted, needed, why):
    told = decide_attractor(found, None, exponents, 5.0, 0.5)
    assert (told.doubt or told.kind) == wanted
    assert (told.kind is Kind.UNDECIDED) == isinstance(wanted, Doubt)
    assert told.record_needed_s == (None if needed is None else pytest.approx(needed, rel=1e-2))
    reason = describe_attractor(told, found, exponents)
    assert why in reason
    assert ("--duration" in reason) == (needed is not None)
    more = describe_attractor(told, found, exponents, 60.0)
    assert ("--at-most" in more) == (needed is not None)


def test_where_no_exponents_can_be_followed_recurrence_and_lines_decide():
    assert decide_attractor(TORUS, None, None, 5.0, None).kind is Kind.QUASI_PERIODIC


@pytest.mark.parametrize(("slow", "kind"), [(70.0, Kind.PERIODIC), (7.0, Kind.UNDECIDED)])
def test_weak_lines_show_that_frequencies_lock_where_the_cycle_was_recorded_often_enough(slow, kind):
    fundamentals = Fundamentals(np.array([slow]), np.array([1e-3]), np.ones((1, 1), dtype=np.int64), 1.0)
    found = decide_attractor(regime("quasi-periodic", 900.0, slow), fundamentals, exponents(0.2, -5.0), 5.0, 0.5)
    assert found.kind is kind
    assert found.record_needed_s == (None if kind is Kind.PERIODIC else pytest.approx(40 / slow))


def test_an_exponent_that_is_sure_but_too_small_for_the_record_is_no_chaos():
    steady = Exponents(np.array([0.9]), np.array([0.1]), np.array([0.5, 5.0]), np.zeros((2, 1)))
    assert not steady.chaotic  # e^4 in all, as a torus may do


@pytest.mark.parametrize(
    ("size", "settles"),
    [
        (lambda t: 1.0 + 0 * t, True),
        (lambda t: np.exp(1e-2 * t), False),  # 5e-3 over both blocks
        (lambda t: np.exp(-1e-2 * t), False),
        (lambda t: 1 / (1 + np.exp(-40 * (t - 0.25))), False),  # growth that ends within them
    ],
)
def test_settled_is_what_has_no_trend(size, settles):
    time = np.arange(10_000) / 20_000
    wave = size(time) * np.cos(2 * np.pi * 1000.0 * time)
    chunk: Any = SimpleNamespace(velocity=np.column_stack([wave, 0 * wave]))
    assert _settled([chunk], 20_000.0, BLOCK) is settles
    shorter: Any = SimpleNamespace(velocity=chunk.velocity[:9000])
    assert not _settled([shorter], 20_000.0, BLOCK)


def test_the_section_is_where_the_main_coordinate_rises_through_its_mean():
    time, rate = np.arange(5000) / 50_000, 2 * np.pi * 310.0  # 31 periods, 161 samples each
    angle = rate * time + 0.7
    shapes = np.column_stack([0.1 * np.cos(angle), 2.0 + np.sin(angle)])
    speeds = rate * np.column_stack([-0.1 * np.sin(angle), np.cos(angle)])
    made_up: Any = SimpleNamespace(time=time, displacement=shapes, velocity=speeds, coordinates=("X", "Y"))
    found = _section(made_up, np.ones(2), ("X", "Y"))
    points = found.values
    assert (found.across, found.other) == ("Y", "X")
    assert found.points == len(points) == 31
    assert found.size == pytest.approx((0.2, 2 * rate), rel=1e-3)  # peaks lie between samples: (π/161)²/2
    # Hermite cubics err by (ω h)⁴/384 = 6e-9 of the displacement and ten times that of the velocity.
    np.testing.assert_allclose(points[:, 0], 0.1, rtol=1e-6)
    np.testing.assert_allclose(points[:, 1], rate, rtol=1e-6)


@pytest.mark.parametrize(("spread", "span"), [(1e-6, 0.1), (0.5, 0.6)])
def test_the_axes_of_a_section_span_what_moves(spread, span):
    angle = 2 * np.pi * np.arange(48) / 48  # its extremes among them
    points = np.column_stack([2e-6 + 1e-6 * spread * np.cos(angle), 0.3 + 0.2 * spread * np.sin(angle)])
    section = PoincareSection(across="Y", other="X", points=48, size=(2e-6, 0.4), values=points)
    study: Any = SimpleNamespace(title="Made up", section=section, scene=load_scene("scenarios/nominal.toml"))
    figure = draw_section(study)
    assert figure is not None
    limits = figure.axes[0].get_xlim(), figure.axes[0].get_ylim()
    # A tenth of the motion's 2 µm and 0.4 m/s, or 1.2 times the points' own spread.
    assert np.ptp(limits[0]) == pytest.approx(2 * span)
    assert np.ptp(limits[1]) == pytest.approx(0.4 * span)


RISING = '{at=[0, "0.1 m", 0], direction=[1, 0, 0], size={time=[0, 1], value=[0, "1 kN"]}}'


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--duration", "5 m"],
            '--duration 5 m: write a time up to 1000 s, such as "5 s" ("m" (meter)',
        ),
        (["--duration", "5 +"], "--duration 5 +: write a time"),
        (["--duration", "2000 s"], "--duration 2000 s: write a time up to 1000 s"),
        (["--duration", "-1"], "--duration -1: write a time"),
        (["--at-most", "0"], "--at-most 0: write a time"),
        (["--set", 'drum.speed={time=["0 s", "1 s"], value=["5 rad/s", "4 rad/s"]}'], "not a profile over time"),
        (
            ["--set", "steady.state=self-consistent", "--set", f"shoe.force=[{RISING}]"],
            "shoe.force.0.size: limit cycles and attractors take a constant value",
        ),
    ],
)
def test_wrong_requests_are_told_in_one_line(drumsqueal, tmp_path, arguments, message):
    folder = tmp_path / "out"
    status, out, error = drumsqueal("motion", "scenarios/damped.toml", "-o", str(folder), *arguments)
    assert status == 2
    assert message in error
    assert error.count("\n") == 1
    assert not out
    assert not folder.exists()


@pytest.mark.thorough
def test_what_decays_to_rest_is_steady():
    scene = load_scene("scenarios/damped.toml", ["drum.speed=55"])
    # Y decays slowest, at −43.0 1/s, from 0.05 of the pressure's loss: below a millionth of it after a quarter second.
    study = study_motion(scene, 0.1)
    assert study.kind == "steady"
    assert "Y slowest at −43.02 1/s" in study.reason
    assert study.settled
    assert study.recorded_from_s < 1
    assert not study.not_determined


@pytest.mark.thorough
def test_of_a_model_the_exponents_are_those_of_its_cycle():
    # x″ + 0.05 x′ + x = 1 + 0.4 x′³ − 0.5 x′⁵, 0.16 Hz.
    model = block_on_belt(lambda s: 1.0 - 0.4 * (s - 1) ** 3 + 0.5 * (s - 1) ** 5, damping=0.05, belt_speed=1.0)
    start: Any = {"displacement": {"X": 1.5}}
    study = study_motion(model, start, 3500.0, sample_rate=2.0)
    cycle = find_cycle(model, start, 600.0, sample_rate=20.0)
    assert study.kind == "periodic"
    assert study.settled
    assert study.base_frequencies_Hz == pytest.approx([cycle.frequency_Hz], rel=1e-6)
    assert study.lyapunov_exponents_1_per_s is not None
    along, across = study.lyapunov_exponents_1_per_s
    assert along == pytest.approx(0.0, abs=1e-4)  # round-off over 500 periods
    assert across == pytest.approx(np.log(cycle.largest) / cycle.period_s, rel=1e-3)
    assert "0.159117 Hz" in study.reason
    assert "lining" not in study.reason + cycle.verdict
    # From a small start it decays: the cycle is one of two attractors.
    small: Any = {"displacement": {"X": 0.3}}
    assert study_motion(model, small, 3500.0, sample_rate=2.0).kind == "steady"


@pytest.mark.parametrize(
    ("how", "why"),
    [
        ({"duration": 0.0}, "duration must be positive"),
        ({"sample_rate": 0.1}, "sample_rate must be at least"),
        ({"start": {"velocity": {"Y": 1.0}}}, "no coordinate of this model"),
    ],
)
def test_a_motion_of_a_model_that_cannot_be_studied_is_refused(how, why):
    with pytest.raises(ValueError, match=why):
        study_motion(
            block_on_belt(ConstantLaw(0.3), belt_speed=1.0),
            **({"start": {}, "duration": 10.0, "sample_rate": 20.0} | how),
        )


@pytest.mark.thorough
def test_a_motion_that_decays_below_the_boundaries_has_not_failed_to_settle():
    disturbance = ["drum.speed=55", "start.displacement={Y=5e-4}", "simulate.duration=0.25"]
    found = run(load_scene("scenarios/damped.toml", disturbance)).findings
    assert found.edge_reached_s == 0
    assert found.saturation is not None
    assert found.saturation.regime.kind == "steady"
    rate = re.search("rms velocity changes by (−[0-9.]+) 1/s", found.saturation.regime.reason)
    assert rate is not None
    # The last 0.15 s, all in Y; its periods are not whole in the halves: 1e-2 radians of 211 periods.
    assert float(rate[1].replace("−", "-")) == pytest.approx(-43.02, rel=2e-3)
    assert "decays to steady sliding, within the contact boundaries and where every mode decays" in found.verdict


@pytest.mark.parametrize(
    ("fraction", "rate", "largest", "kind"),
    [
        (0.05, -1.0, -20.0, "steady"),  # small: whatever falls
        (0.04, -1.0, -20.0, "undecided"),  # but not what the linear model does not lead
        (0.05, 1.0, -20.0, "undecided"),
        (0.5, -15.0, -20.0, "steady"),  # below the edges: as fast as half the linear rate
        (0.5, -5.0, -20.0, "undecided"),
        (2.0, -30.0, -20.0, "undecided"),  # beyond them the linear model tells nothing
        (0.05, -1.0, 20.0, "undecided"),  # where a mode grows what falls comes back
        (0.05, -1.0, 0.0, "undecided"),  # and where one neither grows nor decays something is left
        (1e-9, 3.0, -20.0, "steady"),  # round-off may grow
    ],
)
def test_only_what_the_linear_model_damps_decays_to_rest(monkeypatch, fraction, rate, largest, kind):
    time = np.arange(2000) / 10_000
    wave = np.exp(rate * time) * np.cos(2 * np.pi * 1000.0 * time)
    record: Any = SimpleNamespace(
        time=time, mean_square_velocity=lambda part: np.mean(wave[part, None] ** 2, axis=0), sample_rate=10_000.0
    )
    monkeypatch.setattr(decay, "boundary_ratio", lambda *_: np.full(time.size, fraction))
    monkeypatch.setattr(decay, "changes", lambda *_: False)
    monkeypatch.setattr(decay, "find_rest", lambda *_: Rest(near=fraction != 0.04))
    record.pieces = lambda _: iter(())
    known = {"divergence": None, "mass": np.ones(1), "steady_state": np.zeros(1), "matrix": np.zeros((2, 2))}
    modes: Any = [SimpleNamespace(growth_rate=largest, frequency_Hz=1000.0, label="Y")]
    stability: Any = SimpleNamespace(**known, modes=modes)
    model: Any = SimpleNamespace(forced=False)
    found = decay.decay_to_rest(regime("undecided"), record, slice(None), stability, modes, model)
    assert found.kind == kind
    forced: Any = SimpleNamespace(forced=True)
    assert decay.decay_to_rest(regime("undecided"), record, slice(None), stability, modes, forced).kind == "undecided"
    # Overdamped it goes by the real eigenvalue that decays slowest.
    overdamped: Any = SimpleNamespace(**known, modes=(), eigenvalues=np.array([-4e3, largest]))
    found = decay.decay_to_rest(regime("undecided"), record, slice(None), overdamped, (), model)
    assert found.kind == kind
    # What is round-off may look like any motion, but what repeats is one.
    left = decay.decay_to_rest(regime("irregular"), record, slice(None), stability, modes, model)
    assert left.kind == ("steady" if fraction < 1e-6 and kind == "steady" else "irregular")
    assert decay.decay_to_rest(regime("periodic"), record, slice(None), stability, modes, model).kind == "periodic"


@pytest.mark.thorough
def test_ctrl_c_keeps_the_lines(drumsqueal, tmp_path, monkeypatch):
    def pressed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(study_module, "neighbours", pressed)
    monkeypatch.setattr(study_module, "LONGEST_START", 0.05)
    folder = tmp_path / "out"
    status, out, error = drumsqueal("motion", "scenarios/damped.toml", "-o", str(folder), "--duration", "0.1 s")
    assert (status, out) == (1, "")
    summary = folder / "motion.json"
    assert error == f"drumsqueal: interrupted by the user; what was done until then is in {summary}\n"
    read = read_findings(summary, MotionStudy)
    assert json.loads(to_json(read)) == (found := json.loads(summary.read_text()))
    assert found["lyapunov_exponents_1_per_s"] is None
    assert found["not_determined"][-1] == study_module.CUT_OFF
    assert found["base_frequencies_Hz"]
    assert len((folder / "motion.csv").read_text().splitlines()) > 1
    assert {path.name for path in folder.iterdir()} == {"motion.json", "motion.csv"}


def test_the_command_finds_the_motion_of_a_brake_along_y(drumsqueal, tmp_path, monkeypatch, as_kept):
    """Disturbances of its cycle fall to a third in each of 1444 periods a second: less time than usual will do."""
    for name, less in {"BLOCK": 0.025, "INTERVAL": 2e-3, "FEWEST_INTERVALS": 20}.items():
        monkeypatch.setattr(study_module, name, less)
    scene = ("scenarios/damped.toml", *OPTIONS)
    status, out, error = drumsqueal("motion", *scene, "-o", str(tmp_path), "--duration", "0.05 s")
    assert (status, error) == (0, "")
    as_kept("motion", out, tmp_path)
    figures = {"motion_lines.png", "motion_section.png", "motion_exponents.png"}
    assert {path.name for path in tmp_path.iterdir()} == {"motion.json", "motion.csv"} | figures
    assert "The motion is periodic" in out
    found = read_findings(tmp_path / "motion.json", MotionStudy)
    frequency, _, multiplier = AlongY(brake_along_y()).cycle
    assert found.base_frequencies_Hz == pytest.approx([frequency], rel=1e-4)
    assert found.lyapunov_exponents_1_per_s is not None
    assert found.lyapunov_uncertainties_1_per_s is not None
    # Tangents begin anywhere: as they turn along the motion they grow by as much as the uncertainties say.
    known = (0.0, np.log(multiplier) * frequency)
    for exponent, wanted, off in zip(
        found.lyapunov_exponents_1_per_s, known, found.lyapunov_uncertainties_1_per_s, strict=True
    ):
        assert abs(exponent - wanted) < off < 200
    assert len((tmp_path / "motion.csv").read_text().splitlines()) > 1


@pytest.mark.slow
def test_the_damped_scene_is_periodic(drumsqueal, tmp_path):
    folder = tmp_path / "out"
    how = ("--duration", "1 s", "--at-most", "1000 s")  # which no machine takes
    status, out, error = drumsqueal("motion", "scenarios/damped.toml", "-o", str(folder), *how)
    assert (status, error) == (0, "")
    assert "The motion is periodic" in out
    found = json.loads((folder / "motion.json").read_text())
    assert found["base_frequencies_Hz"] == pytest.approx([1028.854], abs=0.01)
    # Along the cycle nothing grows, and the other directions decay.
    largest, second = found["lyapunov_exponents_1_per_s"][:2]
    assert abs(largest) < 3 * found["lyapunov_standard_errors_1_per_s"][0] + 0.5
    assert second < -5
    assert {path.name for path in folder.iterdir()} == {
        "motion.json", "motion.csv", "motion_lines.png", "motion_section.png", "motion_exponents.png"
    }  # fmt: skip
