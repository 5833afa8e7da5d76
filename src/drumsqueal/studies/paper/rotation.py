"""What Seo & Kang (2023) state about Figure 7: how the drum's speed acts on each mode, and why."""

import numpy as np
from numpy.typing import NDArray

from drumsqueal.bodies.rigid_shoe import RigidShoe
from drumsqueal.studies.paper.curves import Curve, FrictionCurve
from drumsqueal.studies.paper.statement import (
    EXPONENT,
    MAJOR,
    NO_PART,
    QUIET,
    SQUEALING,
    STRAIGHT,
    Statement,
    falls,
    off_line,
)


def slope_in_proportion(curve: FrictionCurve) -> Statement:
    """How the slope of the friction curve goes with the drum's speed."""
    size = float(np.abs(curve.slope).max())
    away = off_line(curve.speed, -curve.slope)
    return Statement(
        "7",
        "The slope μt grows in proportion as the drum slows down",
        "departure of μt from a straight line over its largest value",
        "",
        away / size if size > 0 else None,
        "<",
        STRAIGHT,
        "μt = α (μs − μk) exp(−αRΩ) is an exponential",
    )


def rotation_statements(curve: Curve, shoe: RigidShoe) -> tuple[Statement, ...]:
    """Growth and decay along the drum's speed, and which way the lining moves in each mode."""
    spectrum, order = curve.spectrum, np.argsort(np.abs(curve.values))
    n = len(spectrum.names)
    energy = np.abs(spectrum.right[:, :n]) ** 2 * spectrum.mass[:, :, None]
    axial = energy[:, [spectrum.names.index(name) for name in QUIET]].sum(axis=1) / energy.sum(axis=1)
    share = max(float(axial[spectrum.eigenvalues == spectrum.of(name)[:, None]].max()) for name in SQUEALING)
    quiet = {name: float(curve.rate(name).max()) for name in QUIET}
    loudest = max(quiet, key=lambda name: quiet[name])
    held = ~spectrum.drifting & (axial > 0.5)
    least_damped = np.where(held, spectrum.eigenvalues.real, -np.inf).max(axis=1)[order]
    speeds = np.abs(curve.values)[order]
    rise = np.diff(least_damped)  # from slow to fast it should rise towards zero
    turn = speeds[int(np.argmin(least_damped))]
    slowest = {name: spectrum.of(name)[order[0]] for name in QUIET}
    last = max(QUIET, key=lambda name: slowest[name].real)
    creeps = f"below {turn:.3g} rad/s: {last}{'' if slowest[last].imag else ', which no longer oscillates there'}"
    powers = {name: _power(curve, name) for name in QUIET}
    odd = max(QUIET, key=lambda name: abs(powers[name] + 1))
    return (
        falls(curve, "The slower the drum, the larger the growth rates of X, Y and Tz"),
        Statement(
            "7",
            "Friction across the sliding direction does not touch X, Y and Tz",
            "largest share of Z, Tx and Ty in their kinetic energy",
            "",
            share,
            "<",
            NO_PART,
            "",
        ),
        Statement(
            "7",
            "Friction damping makes Z, Tx and Ty decay at every speed",
            "largest growth rate of the three",
            "1/s",
            quiet[loudest],
            "<",
            0.0,
            loudest,
        ),
        Statement(
            "7",
            "The slower the drum, the faster Z, Tx and Ty decay, to the least damped of them",
            "least change of its decay, from one speed to the next slower",
            "1/s",
            float(rise.min()),
            ">",
            0.0,
            "" if rise.min() > 0 else creeps,
        ),
        Statement(
            "7",
            "Friction damping goes like 1/Ω",
            "power of Ω in the damping of Z, Tx and Ty, its distance from −1",
            "",
            abs(powers[odd] + 1),
            "<",
            EXPONENT,
            ", ".join(f"{name} {powers[name]:.3f}" for name in QUIET),
        ),
        *_directions(curve, shoe),
    )


def _directions(curve: Curve, shoe: RigidShoe) -> tuple[Statement, Statement]:
    tangential, axial = _lining_motion(curve, shoe, SQUEALING), _lining_motion(curve, shoe, QUIET)
    across, along = min(axial, key=lambda k: axial[k][2]), min(tangential, key=lambda k: tangential[k][1])
    return (
        Statement(
            "7",
            "X, Y and Tz move the lining mainly along the sliding direction",
            "least share of u_θ² in the mean square motion of the lining",
            "",
            tangential[along][1],
            ">",
            MAJOR,
            ", ".join(f"{name} {share[1]:.2f}" for name, share in tangential.items()),
        ),
        Statement(
            "7",
            "Z, Tx and Ty move the lining mainly across the sliding direction",
            "least share of u_z² in the mean square motion of the lining",
            "",
            axial[across][2],
            ">",
            MAJOR,
            ", ".join(f"{name} {share[2]:.2f}" for name, share in axial.items()),
        ),
    )


def _power(curve: Curve, name: str) -> float:
    """Exponent of the drum speed in a coordinate's damping, the diagonal of C, by a straight line in logarithms."""
    k = curve.spectrum.names.index(name)
    damping = curve.spectrum.damping[:, k, k]
    if np.any(damping <= 0):
        return np.inf
    return float(np.polyfit(np.log(np.abs(curve.values)), np.log(damping), 1)[0])


def _lining_motion(curve: Curve, shoe: RigidShoe, names: tuple[str, ...]) -> dict[str, NDArray[np.float64]]:
    """Shares of u_r², u_θ² and u_z² in the mean square motion of the lining, of each coordinate's mode at 1 Ω.

    Over Gauss nodes of the lining; u_r, u_θ and u_z as in Seo & Kang, equations (8) to (12).
    """
    spectrum, k = curve.spectrum, int(np.argmin(np.abs(curve.values - curve.nominal)))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    angle, z = np.meshgrid(nodes * float(shoe.half_angle), nodes * float(shoe.width) / 2, indexing="ij")
    weight = np.outer(weights, weights)
    shares = {}
    for name in names:
        column = int(np.argmin(np.abs(spectrum.eigenvalues[k] - spectrum.of(name)[k])))
        q = spectrum.right[k, : len(spectrum.names), column]
        radial, tangential, axial = _surface_motion(q, angle, z, float(shoe.outer_radius), float(shoe.centroid))
        squares = np.array([np.sum(weight * np.abs(u) ** 2) for u in (radial, tangential, axial)])
        shares[name] = squares / squares.sum()
    return shares


def _surface_motion(q: NDArray, angle: NDArray, z: NDArray, radius: float, centroid: float) -> tuple[NDArray, ...]:
    x, y = q[0] + z * q[4], q[1] - z * q[3] - centroid * q[5]
    radial = x * np.cos(angle) + y * np.sin(angle)
    tangential = radius * q[5] - x * np.sin(angle) + y * np.cos(angle)
    return radial, tangential, q[2] + radius * np.sin(angle) * q[3] - (radius * np.cos(angle) - centroid) * q[4]
