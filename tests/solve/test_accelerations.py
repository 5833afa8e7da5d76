"""Accelerations at recorded states: equation (29) by hand, the velocities they belong to, and a lining that sticks."""

import numpy as np

from drumsqueal.physics.composition import kept_coordinates
from drumsqueal.physics.model import build_model
from drumsqueal.scene import COORDINATES, load_scene
from drumsqueal.simulation import run
from drumsqueal.solve.transient.sticking import accelerations

R, H, B, BETA, RHO, KC, LOAD, SPEED = 0.1, 0.02, 0.0365, np.deg2rad(130), 7820.0, 0.35e11, 2000.0, 5.0
SPRINGS = 7e8  # N/m, both


def test_below_the_boundaries_they_are_those_of_equation_29(nominal):
    """In the plane, by Gauss quadrature over the arc and over the shoe's section."""
    angle, weight = np.polynomial.legendre.leggauss(40)
    angle, weight = angle * BETA / 2, weight * BETA / 2
    radius, across = np.polynomial.legendre.leggauss(20)
    radius, across = R - H / 2 + radius * H / 2, across * H / 2
    volume = RHO * B * np.outer(across * radius, weight)
    mass = volume.sum()
    x, y = np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))
    c = (volume * x).sum() / mass
    masses = np.array([mass, mass, (volume * ((x - c) ** 2 + y**2)).sum()])
    radial = np.stack([np.cos(angle), np.sin(angle), -c * np.sin(angle)])
    tangential = np.stack([-np.sin(angle), np.cos(angle), R - c * np.cos(angle)])
    area = R * B * weight
    slope = 0.2 * np.exp(-R * SPEED)  # α (μ_s − μ_k) e^(−αRΩ) with α = 1 s/m
    damping = -slope * LOAD / (R * BETA * B) * (tangential * area) @ tangential.T
    stiffness = KC * ((radial - (0.3 + slope) * tangential) * area) @ radial.T
    stiffness += np.diag([SPRINGS, 0, SPRINGS * R**2])
    random = np.random.default_rng(1)
    # Far below the boundaries of 7 µm and 0.5 m/s; the friction curve bends by α v = 1e-6, and round-off of 2000 N is
    # 1e-12.
    q, v = random.normal(size=(700, 3)) * [1e-9, 1e-9, 1e-8], random.normal(size=(700, 3)) * [1e-6, 1e-6, 1e-5]
    found = accelerations(build_model(nominal), np.zeros(700), q, v, np.zeros(700))
    wanted = -(v @ damping.T + q @ stiffness.T) / masses
    assert np.all(np.abs(found - wanted).max(axis=0) < 1e-5 * np.abs(wanted).max(axis=0))


def test_beyond_the_boundaries_velocities_are_their_integral(nominal):
    far = {"start.displacement": {"Y": 2e-5, "Tz": 2e-4}, "simulate.sample_rate": 1.6e6, "simulate.duration": 0.002}
    scene = nominal.with_values(far | {"simulate.tolerance": 1e-9})
    history = run(scene).history
    assert history["contact_fraction"].min() < 0.9
    assert history["slip_reversed_fraction"].max() > 0
    kept = [COORDINATES.index(name) for name in kept_coordinates(scene)]
    q, v = (history[name].values[:, kept] for name in ("displacement", "velocity"))
    found = accelerations(build_model(scene), history["time"].values, q, v, history["sticking"].values)
    inner = found[1:-1]
    simpson = (found[:-2] + 4 * inner + found[2:]) / (3 * 1.6e6)
    error = np.abs(v[2:] - v[:-2] - simpson) / np.abs(v).max(axis=0)
    # Simpson's error is (ωh)^5/90, 1e-10 of a velocity at 7.4 kHz and more at its multiples. Where a boundary of
    # contact or of slip is born the slope has a kink, and the error goes like h²: 9e-5 here, 2e-3 at a quarter of the
    # rate.
    assert np.median(error) < 1e-9
    assert error.max() < 3e-4


def test_a_lining_that_sticks_goes_with_the_drum():
    scene = load_scene("scenarios/stop.toml")
    model = build_model(scene)
    c = float(model.shoe.centroid)
    turning = np.array([0.0, c, 1.0])  # X, Y, Tz of a shoe that turns with the drum
    for time, speed, rate in ((0.15, 2.5, -5 / 0.3), (0.31, 0.0, 0.0)):
        q = np.array([1e-7, 2e-7, 3e-7])
        found = accelerations(model, [time], [q], [speed * turning], [1.0])[0]
        # Round-off of forces of 2000 N on an inertia of 1e-3 kg m².
        np.testing.assert_allclose(found, rate * turning, rtol=1e-9, atol=1e-8)
        slips = accelerations(model, [time], [q], [speed * turning * 0.9], [0.0])[0]
        assert np.abs(slips - rate * turning).max() > 1
