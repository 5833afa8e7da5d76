"""The kind of a motion: Lyapunov exponents of systems that are known, and the command."""

import json
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drumsqueal import load_scene, run
from drumsqueal.comparison import decay
from drumsqueal.figures.motion import draw_section
from drumsqueal.signals import Bases, Regime
from drumsqueal.signals.lyapunov import Exponents, lyapunov_exponents, orthonormalised
from drumsqueal.studies import motion as study_module
from drumsqueal.studies.motion import _section, _settled, _told, study_motion


def exponents_of(rate, jacobian, state, interval, count, tangents):
    """Exponents along a trajectory, its transition matrices by SciPy from the variational equation."""
    n = len(state)
    turned, logs = np.eye(n)[:, :tangents], []

    def both(t, y):
        return np.concatenate([rate(t, y[:n]), (jacobian(t, y[:n]) @ y[n:].reshape(n, n)).ravel()])

    for k in range(count):
        end = solve_ivp(
            both, (k * interval, (k + 1) * interval), np.concatenate([state, np.eye(n).ravel()]), rtol=1e-7, atol=1e-9
        ).y[:, -1]
        state = end[:n]
        turned, grown = orthonormalised(end[n:].reshape(n, n) @ turned)
        logs.append(grown)
    return lyapunov_exponents(np.array(logs), interval)


def lorenz(_, y):
    return np.array([10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]])


def of_lorenz(_, y):
    return np.array([[-10.0, 10.0, 0.0], [28 - y[2], -1.0, -y[0]], [y[1], y[0], -8 / 3]])


def test_lyapunov_exponents_of_lorenz():
    found = exponents_of(lorenz, of_lorenz, np.array([1.0, 1.0, 20.0]), 0.5, 800, 3)
    # 0.9056, 0 and −14.572 (J. C. Sprott, Chaos and Time-Series Analysis, 2003); their sum is the divergence, −41/3.
    wanted = np.array([0.9056, 0.0, -14.572])
    assert np.all(np.abs(found.exponent_1_per_s - wanted) < 3 * found.standard_error_1_per_s + 1e-3)
    assert found.standard_error_1_per_s[0] < 0.03
    assert found.exponent_1_per_s.sum() == pytest.approx(-41 / 3, abs=1e-4)
    assert found.chaotic


def test_a_limit_cycle_is_not_chaotic():
    def rate(_, y):  # van der Pol
        return np.array([y[1], (1 - y[0] ** 2) * y[1] - y[0]])

    def jacobian(_, y):
        return np.array([[0.0, 1.0], [-2 * y[0] * y[1] - 1, 1 - y[0] ** 2]])

    found = exponents_of(rate, jacobian, np.array([2.0, 0.0]), 1.0, 200, 2)
    # Zero along the motion; the other is −1.0594 (the mean divergence over its period of 6.6633).
    assert found.exponent_1_per_s[0] == pytest.approx(0.0, abs=0.02)
    assert found.exponent_1_per_s[1] == pytest.approx(-1.0594, abs=0.02)
    assert not found.chaotic


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


def exponents(largest: float, second: float = -5.0) -> Exponents:
    """Two exponents of five seconds, known to 0.5 1/s."""
    return Exponents(np.array([largest, second]), np.full(2, 0.5), np.array([0.5, 5.0]), np.zeros((2, 2)))


def regime(kind, *bases: float) -> Regime:
    return Regime(kind, None, bases, 0.1, 0.0, "As told.", tuple(1e-3 for _ in bases))


@pytest.mark.parametrize(
    ("found", "bases", "exponents", "kind", "why"),
    [
        (regime("periodic", 900.0), 1, None, "periodic", "As told."),
        (regime("periodic", 900.0), 1, exponents(0.2), "periodic", "no chaos"),
        (regime("periodic", 900.0), 1, exponents(9.0), "unknown", "one of the two is wrong"),
        (regime("quasi-periodic", 900.0, 70.0), 2, exponents(9.0), "unknown", "one of the two is wrong"),
        (regime("irregular"), 2, exponents(9.0), "chaotic", "separate exponentially"),
        (regime("irregular"), 2, exponents(1.4), "irregular", "not above zero beyond doubt"),
        # Two standard errors above zero, and nothing has grown by e^5: neither is chaos.
        (regime("quasi-periodic", 900.0, 70.0), 1, exponents(0.2), "periodic", "its frequencies are locked"),
        (regime("quasi-periodic", 900.0, 70.0), 2, exponents(0.2), "quasi-periodic", "1 of the exponents is zero"),
        (regime("quasi-periodic", 900.0, 70.0), 2, exponents(0.2, -0.3), "quasi-periodic", "no chaos. As told."),
    ],
)
def test_lines_and_exponents_tell_the_kind_together(found, bases, exponents, kind, why):
    made_up = Bases(np.full(bases, 70.0), np.full(bases, 1e-3), np.ones((1, bases), dtype=np.int64), 1.0, True)
    told, reason = _told(found, made_up, exponents)
    assert told == kind
    assert why in reason


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
    assert _settled([chunk], 20_000.0) is settles
    assert not _settled([SimpleNamespace(velocity=chunk.velocity[:9000])], 20_000.0)  # pyright: ignore[reportArgumentType]


def test_the_section_is_where_the_main_coordinate_rises_through_its_mean():
    time, rate = np.arange(5000) / 50_000, 2 * np.pi * 310.0  # 31 periods, 161 samples each
    angle = rate * time + 0.7
    shapes = np.column_stack([0.1 * np.cos(angle), 2.0 + np.sin(angle)])
    speeds = rate * np.column_stack([-0.1 * np.sin(angle), np.cos(angle)])
    made_up: Any = SimpleNamespace(time=time, displacement=shapes, velocity=speeds, coordinates=("X", "Y"))
    points, names, size = _section(made_up, np.ones(2), ("X", "Y"))
    assert names == ("Y", "X")
    assert len(points) == 31
    assert size == pytest.approx((0.2, 2 * rate), rel=1e-3)  # peaks lie between samples: (π/161)²/2
    # Hermite cubics err by (ω h)⁴/384 = 6e-9 of the displacement and ten times that of the velocity.
    np.testing.assert_allclose(points[:, 0], 0.1, rtol=1e-6)
    np.testing.assert_allclose(points[:, 1], rate, rtol=1e-6)


@pytest.mark.parametrize(("spread", "span"), [(1e-6, 0.1), (0.5, 0.6)])
def test_the_axes_of_a_section_span_what_moves(spread, span):
    angle = 2 * np.pi * np.arange(48) / 48  # its extremes among them
    points = np.column_stack([2e-6 + 1e-6 * spread * np.cos(angle), 0.3 + 0.2 * spread * np.sin(angle)])
    scene: Any = SimpleNamespace(title="Made up")
    study: Any = SimpleNamespace(scene=scene, section=points, section_of=("Y", "X"), section_size=(2e-6, 0.4))
    figure = draw_section(study)
    assert figure is not None
    limits = figure.axes[0].get_xlim(), figure.axes[0].get_ylim()
    # A tenth of the motion's 2 µm and 0.4 m/s, or 1.2 times the points' own spread.
    assert np.ptp(limits[0]) == pytest.approx(2 * span)
    assert np.ptp(limits[1]) == pytest.approx(0.4 * span)


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
        (["--set", 'drum.speed={time=["0 s", "1 s"], value=["5 rad/s", "4 rad/s"]}'], "this changes with time"),
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


def test_what_decays_to_rest_is_steady():
    scene = load_scene("scenarios/damped.toml", ["drum.speed=55"])
    # Y decays slowest, at −43.0 1/s, from 0.05 of the pressure's loss: below a millionth of it after a quarter second.
    study = study_motion(scene, 0.1)
    assert study.kind == "steady"
    assert "Y slowest at −43.02 1/s" in study.reason
    assert study.settled
    assert study.settled_s < 1
    assert not study.limits


def test_a_motion_that_decays_below_the_edges_has_not_failed_to_settle():
    kick = ["drum.speed=55", "start.displacement={Y=5e-4}", "simulate.duration=0.25"]
    found = run(load_scene("scenarios/damped.toml", kick)).comparison
    assert found.edge_reached_s == 0
    assert found.saturation is not None
    assert found.saturation.regime.kind == "steady"
    rate = re.search("rms velocity changes by (−[0-9.]+) 1/s", found.saturation.regime.reason)
    assert rate is not None
    # The last 0.15 s, all in Y; its periods are not whole in the halves: 1e-2 radians of 211 periods.
    assert float(rate[1].replace("−", "-")) == pytest.approx(-43.02, rel=2e-3)
    assert "decays to steady sliding, below the edges and where every mode decays" in found.verdict


@pytest.mark.parametrize(
    ("share", "rate", "largest", "kind"),
    [
        (0.05, -1.0, -20.0, "steady"),  # small: whatever falls
        (0.05, 1.0, -20.0, "unknown"),
        (0.5, -15.0, -20.0, "steady"),  # below the edges: as fast as half the linear rate
        (0.5, -5.0, -20.0, "unknown"),
        (2.0, -30.0, -20.0, "unknown"),  # beyond them the linear model tells nothing
        (0.05, -1.0, 20.0, "unknown"),  # where a mode grows what falls comes back
        (0.05, -1.0, 0.0, "unknown"),  # and where one neither grows nor decays something is left
        (1e-9, 3.0, -20.0, "steady"),  # round-off may grow
    ],
)
def test_only_what_the_linear_model_damps_decays_to_rest(monkeypatch, share, rate, largest, kind):
    time = np.arange(2000) / 10_000
    wave = np.exp(rate * time) * np.cos(2 * np.pi * 1000.0 * time)
    record: Any = SimpleNamespace(time=time, velocity=wave[:, None], sample_rate=10_000.0)
    monkeypatch.setattr(decay, "edge_share", lambda *_: np.full(time.size, share))
    monkeypatch.setattr(decay, "changes", lambda *_: False)
    stability: Any = SimpleNamespace(divergence=None, mass=np.ones(1))
    modes: Any = [SimpleNamespace(growth_rate=largest, frequency_Hz=1000.0, label="Y")]
    model: Any = SimpleNamespace(forced=False)
    found = decay.decay_to_rest(regime("unknown"), record, slice(None), stability, modes, model)
    assert found.kind == kind
    forced: Any = SimpleNamespace(forced=True)
    assert decay.decay_to_rest(regime("unknown"), record, slice(None), stability, modes, forced).kind == "unknown"


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
    found = json.loads(summary.read_text())
    assert found["lyapunov_exponents_1_per_s"] is None
    assert found["not_determined"][-1] == study_module.CUT_OFF
    assert found["base_frequencies_Hz"]
    assert len((folder / "motion.csv").read_text().splitlines()) > 1
    assert {path.name for path in folder.iterdir()} == {"motion.json", "motion.csv"}


@pytest.mark.slow
def test_the_damped_scene_is_periodic(drumsqueal, tmp_path):
    folder = tmp_path / "out"
    status, out, error = drumsqueal("motion", "scenarios/damped.toml", "-o", str(folder), "--duration", "1 s")
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
