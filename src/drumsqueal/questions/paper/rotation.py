"""What Seo & Kang (2023) state about Figure 7: how the drum's speed acts on each mode, and why."""

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.questions.paper.curves import Curve, FrictionCurve
from drumsqueal.questions.paper.statement import (
    EXPONENT,
    MAJOR,
    NARROW,
    NO_PART,
    QUIET,
    SQUEALING,
    STRAIGHT,
    Statement,
    falls,
    off_line,
    state,
)


def slope_in_proportion(curve: FrictionCurve) -> Statement:
    """How the slope of the friction curve goes with the drum's speed."""

    def reading(speed: NDArray[np.float64]) -> tuple[str, str, float | None, str, float]:
        slope = np.interp(speed, curve.speed, curve.slope)
        size = float(np.abs(slope).max())
        measure = f"departure from a straight line over the largest, from {speed[0]:.3g} to {speed[-1]:.3g} rad/s"
        return measure, "", off_line(speed, slope) / size if size > 0 else None, "<", STRAIGHT

    narrow = curve.own_speed * np.linspace(*NARROW, curve.speed.size)
    law = "the paper's μt = α (μs − μk) exp(−αRΩ) is an exponential"
    says = "The slope μt grows in proportion as the drum slows down"
    return state("7", says, *reading(curve.speed), law).read_also(*reading(narrow))


def rotation_statements(curve: Curve, shoe: RigidShoe, friction: FrictionCurve) -> tuple[Statement, ...]:
    """Growth and decay along the drum's speed, and which way the lining moves in each mode."""
    spectrum, order = curve.spectrum, np.argsort(np.abs(curve.values))
    n = len(spectrum.names)
    energy = np.abs(spectrum.right[:, :n]) ** 2 * spectrum.mass[:, :, None]
    axial = energy[:, [spectrum.names.index(name) for name in QUIET]].sum(axis=1) / energy.sum(axis=1)
    part = max(float(axial[spectrum.eigenvalues == spectrum.of(name)[:, None]].max()) for name in SQUEALING)
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
    slow = np.abs(curve.values) <= abs(curve.nominal) * (1 + 1e-9)
    loud = max(QUIET, key=lambda name: curve.rate(name)[slow].max())
    return (
        falls(curve, "The slower the drum, the larger the growth rates of X, Y and Tz"),
        state(
            "7",
            "Friction across the sliding direction does not touch X, Y and Tz",
            "largest fraction of Z, Tx and Ty in their kinetic energy",
            "",
            part,
            "<",
            NO_PART,
            "",
        ),
        state(
            "7",
            "Friction damping makes Z, Tx and Ty decay at every speed",
            "largest growth rate of the three",
            "1/s",
            quiet[loudest],
            "<",
            0.0,
            loudest,
        ),
        state(
            "7",
            "At low speeds the squeal propensity of Z, Tx and Ty is suppressed",
            "decay rate of the least damped of them, least change from a speed to the next slower one",
            "1/s",
            float(rise.min()),
            ">",
            0.0,
            "" if rise.min() > 0 else creeps,
        ).read_also(
            f"largest growth rate of the three up to {abs(curve.nominal):.3g} rad/s",
            "1/s",
            float(curve.rate(loud)[slow].max()),
            "<",
            0.0,
            loud,
        ),
        _inverse_speed(curve, friction),
        *_directions(curve, shoe),
    )


def _inverse_speed(curve: Curve, friction: FrictionCurve) -> Statement:
    """How friction damping goes with the drum's speed, on which the coefficient of friction depends, too."""

    def reading(measure: str, coefficient: NDArray[np.float64] | float) -> tuple[str, str, float, str, float, str]:
        powers = {name: _power(curve, name, coefficient) for name in QUIET}
        furthest = max(abs(power + 1) for power in powers.values())
        listed = ", ".join(f"{name} {power:.3f}" for name, power in powers.items())
        return measure, "", furthest, "<", EXPONENT, listed

    whole = reading("power of Ω in the damping μ0 p0/(RΩ) of Z, Tx and Ty, its distance from −1", 1.0)
    says = "Friction damping is proportional to 1/Ω"
    return state("7", says, *whole).read_also(
        *reading("the same of the damping over μ0, which falls with the speed", friction.coefficient)
    )


def _directions(curve: Curve, shoe: RigidShoe) -> tuple[Statement, Statement]:
    tangential, axial = _lining_motion(curve, shoe, SQUEALING), _lining_motion(curve, shoe, QUIET)
    across, along = min(axial, key=lambda k: axial[k][2]), min(tangential, key=lambda k: tangential[k][1])
    return (
        state(
            "7",
            "X, Y and Tz move the lining mainly along the sliding direction",
            "least fraction of u_θ² in the mean square motion of the lining",
            "",
            tangential[along][1],
            ">",
            MAJOR,
            ", ".join(f"{name} {fraction[1]:.2f}" for name, fraction in tangential.items()),
        ).read_also(
            *_of_surface(
                "θ", {name: fraction[1] / (fraction[1] + fraction[2]) for name, fraction in tangential.items()}
            )
        ),
        state(
            "7",
            "Z, Tx and Ty move the lining mainly across the sliding direction",
            "least fraction of u_z² in the mean square motion of the lining",
            "",
            axial[across][2],
            ">",
            MAJOR,
            ", ".join(f"{name} {fraction[2]:.2f}" for name, fraction in axial.items()),
        ).read_also(
            *_of_surface("z", {name: fraction[2] / (fraction[1] + fraction[2]) for name, fraction in axial.items()})
        ),
    )


def _of_surface(direction: str, fractions: dict[str, float]) -> tuple[str, str, float, str, float, str]:
    """The same fraction of the motion along the surface alone, u_θ and u_z, which the paper contrasts."""
    listed = ", ".join(f"{name} {fraction:.3f}" for name, fraction in fractions.items())
    return f"least fraction of u_{direction}² in u_θ² + u_z²", "", min(fractions.values()), ">", MAJOR, listed


def _power(curve: Curve, name: str, over: NDArray[np.float64] | float) -> float:
    """Exponent of the drum speed in a coordinate's damping, C_kk over a factor, by a straight line in logarithms."""
    k = curve.spectrum.names.index(name)
    damping = curve.spectrum.damping[:, k, k] / over
    if np.any(damping <= 0):
        return np.inf
    return float(np.polyfit(np.log(np.abs(curve.values)), np.log(damping), 1)[0])


def _lining_motion(curve: Curve, shoe: RigidShoe, names: tuple[str, ...]) -> dict[str, NDArray[np.float64]]:
    """Fractions of u_r², u_θ² and u_z² in the mean square motion of the lining, of each coordinate's mode at 1 Ω.

    Over Gauss nodes of the lining; u_r, u_θ and u_z as in Seo & Kang, equations (8) to (12).
    """
    spectrum, k = curve.spectrum, int(np.argmin(np.abs(curve.values - curve.nominal)))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    angle, z = np.meshgrid(nodes * float(shoe.half_angle), nodes * float(shoe.width) / 2, indexing="ij")
    weight = np.outer(weights, weights)
    fractions = {}
    for name in names:
        column = int(np.argmin(np.abs(spectrum.eigenvalues[k] - spectrum.of(name)[k])))
        q = spectrum.right[k, : len(spectrum.names), column]
        radial, tangential, axial = _surface_motion(q, angle, z, float(shoe.outer_radius), float(shoe.centroid))
        squares = np.array([np.sum(weight * np.abs(u) ** 2) for u in (radial, tangential, axial)])
        fractions[name] = squares / squares.sum()
    return fractions


def _surface_motion(q: NDArray, angle: NDArray, z: NDArray, radius: float, centroid: float) -> tuple[NDArray, ...]:
    x, y = q[0] + z * q[4], q[1] - z * q[3] - centroid * q[5]
    radial = x * np.cos(angle) + y * np.sin(angle)
    tangential = radius * q[5] - x * np.sin(angle) + y * np.cos(angle)
    return radial, tangential, q[2] + radius * np.sin(angle) * q[3] - (radius * np.cos(angle) - centroid) * q[4]
