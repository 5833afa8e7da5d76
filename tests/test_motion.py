"""The kind of a motion: Lyapunov exponents of systems that are known, and the command."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drumsqueal.signals.lyapunov import lyapunov_exponents, orthonormalised


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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--duration", "5 m"], "--duration 5 m: write a time"),
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
