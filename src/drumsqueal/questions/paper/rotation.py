"""What Seo & Kang (2023) state about Figure 7: how the drum's speed acts on each mode, and why."""

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.bodies.body import Shoe
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
    largest,
    listed,
    off_line,
)


def rotation_statements(curve: Curve, shoe: Shoe, friction: FrictionCurve) -> tuple[Statement, ...]:
    """Growth and decay along the drum's speed, and which way the lining moves in each mode."""
    spectrum, n = curve.spectrum, len(curve.spectrum.names)
    energy = np.abs(spectrum.right[:, :n]) ** 2 * spectrum.mass[:, :, None]
    axial = energy[:, [spectrum.names.index(name) for name in QUIET]].sum(axis=1) / energy.sum(axis=1)
    part = max(float(axial[spectrum.eigenvalues == spectrum.of(name)[:, None]].max()) for name in SQUEALING)
    loudest, growth = largest({name: curve.rate(name).max() for name in QUIET})
    return (
        _slope_in_proportion(friction),
        falls(curve, "The slower the drum, the larger the growth rates of X, Y and Tz"),
        Statement("7", "Friction across the sliding direction does not touch X, Y and Tz").read(
            "largest fraction of Z, Tx and Ty in their kinetic energy", part, "<", NO_PART
        ),
        Statement("7", "Friction damping makes Z, Tx and Ty decay at every speed").read(
            "largest growth rate of the three", growth, "<", 0.0, "1/s", loudest
        ),
        _suppressed_when_slow(curve, axial > 0.5),
        _inverse_speed(curve, friction),
        *_directions(curve, shoe),
    )


def _slope_in_proportion(curve: FrictionCurve) -> Statement:
    """How the slope of the friction curve goes with the drum's speed."""
    law = "the paper's μt = α (μs − μk) exp(−αRΩ) is an exponential"
    statement = Statement("7", "The slope μt grows in proportion as the drum slows down")
    narrow = curve.own_speed * np.linspace(*NARROW, curve.speed.size)
    for speed, detail in ((curve.speed, law), (narrow, "")):
        slope = np.interp(speed, curve.speed, curve.slope)
        size = float(np.abs(slope).max())
        measure = f"deviation from a straight line over the largest, from {speed[0]:.3g} to {speed[-1]:.3g} rad/s"
        statement = statement.read(
            measure, off_line(speed, slope) / size if size > 0 else None, "<", STRAIGHT, detail=detail
        )
    return statement


def _suppressed_when_slow(curve: Curve, out_of_plane: NDArray[np.bool_]) -> Statement:
    """How the decay of the modes out of the plane goes with the drum's speed: from slow to fast, rates should rise."""
    spectrum, order = curve.spectrum, np.argsort(np.abs(curve.values))
    held = ~spectrum.drifting & out_of_plane
    least_damped = np.where(held, spectrum.eigenvalues.real, -np.inf).max(axis=1)[order]
    rise = float(np.diff(least_damped).min())
    turn = np.abs(curve.values)[order][np.argmin(least_damped)]
    slowest = {name: spectrum.of(name)[order[0]] for name in QUIET}
    last, _ = largest({name: value.real for name, value in slowest.items()})
    creeps = f"below {turn:.3g} rad/s: {last}{'' if slowest[last].imag else ', which no longer oscillates there'}"
    slow = np.abs(curve.values) <= abs(curve.nominal) * (1 + 1e-9)
    loudest, growth = largest({name: curve.rate(name)[slow].max() for name in QUIET})
    change = "decay rate of the least damped of them, least change from a speed to the next slower one"
    return (
        Statement("7", "At low speeds the squeal propensity of Z, Tx and Ty is suppressed")
        .read(change, rise, ">", 0.0, "1/s", "" if rise > 0 else creeps)
        .read(
            f"largest growth rate of the three up to {abs(curve.nominal):.3g} rad/s", growth, "<", 0.0, "1/s", loudest
        )
    )


def _inverse_speed(curve: Curve, friction: FrictionCurve) -> Statement:
    """How friction damping goes with the drum's speed, on which the coefficient of friction depends, too."""
    statement = Statement("7", "Friction damping is proportional to 1/Ω")
    for measure, over in (
        ("power of Ω in the damping μ0 p0/(RΩ) of Z, Tx and Ty, its distance from −1", 1.0),
        ("the same of the damping over μ0, which falls with the speed", friction.coefficient),
    ):
        powers = {name: _power(curve, name, over) for name in QUIET}
        furthest = max(abs(power + 1) for power in powers.values())
        statement = statement.read(measure, furthest, "<", EXPONENT, detail=listed(powers, ".3f"))
    return statement


def _power(curve: Curve, name: str, over: NDArray[np.float64] | float) -> float:
    """Exponent of the drum speed in a coordinate's damping, C_kk over a factor, by a straight line in logarithms."""
    k = curve.spectrum.names.index(name)
    damping = curve.spectrum.damping[:, k, k] / over
    if np.any(damping <= 0):
        return np.inf
    return float(np.polyfit(np.log(np.abs(curve.values)), np.log(damping), 1)[0])


def _directions(curve: Curve, shoe: Shoe) -> list[Statement]:
    """Along which direction of the surface the lining moves; the paper contrasts u_θ and u_z alone."""
    statements = []
    for names, says, symbol, index in (
        (SQUEALING, "X, Y and Tz move the lining mainly along the sliding direction", "θ", 1),
        (QUIET, "Z, Tx and Ty move the lining mainly across the sliding direction", "z", 2),
    ):
        fractions = _lining_motion(curve, shoe, names)
        whole = {name: float(each[index]) for name, each in fractions.items()}
        surface = {name: float(each[index] / (each[1] + each[2])) for name, each in fractions.items()}
        of_all = f"least fraction of u_{symbol}² in the mean square motion of the lining"
        of_surface = f"least fraction of u_{symbol}² in u_θ² + u_z²"
        statements.append(
            Statement("7", says)
            .read(of_all, min(whole.values()), ">", MAJOR, detail=listed(whole, ".2f"))
            .read(of_surface, min(surface.values()), ">", MAJOR, detail=listed(surface, ".3f"))
        )
    return statements


def _lining_motion(curve: Curve, shoe: Shoe, names: tuple[str, ...]) -> dict[str, NDArray[np.float64]]:
    """Fractions of u_r², u_θ² and u_z² in the mean square motion of the lining, of each coordinate's mode at 1 Ω.

    Over Gauss nodes of the lining; u_r, u_θ and u_z as in Seo & Kang, equations (8) to (12).
    """
    spectrum, k = curve.spectrum, int(np.argmin(np.abs(curve.values - curve.nominal)))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    angle, z = np.meshgrid(nodes * float(shoe.half_angle), nodes * float(shoe.width) / 2, indexing="ij")
    weight, fractions = np.outer(weights, weights), {}
    for name in names:
        column = int(np.argmin(np.abs(spectrum.eigenvalues[k] - spectrum.of(name)[k])))
        q = dict(zip(spectrum.names, spectrum.right[k, : len(spectrum.names), column], strict=True))
        squares = np.array([np.sum(weight * np.abs(u) ** 2) for u in shoe.displacement(q, angle, z)])
        fractions[name] = squares / squares.sum()
    return fractions
