"""What Seo & Kang (2023) state about their figures, each as a number that decides whether it holds.

Figures 4 to 6 and what the transients show are here; `rotation` has Figure 7, `design` Figures 8 to 11.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.compare import RunFindings
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.questions.paper.curves import CONSTANT_FRICTION, Curve, FrictionCurve
from drumsqueal.questions.paper.design import design_statements
from drumsqueal.questions.paper.rotation import rotation_statements, slope_in_proportion
from drumsqueal.questions.paper.statement import (
    ALIKE,
    APART,
    GROWN,
    LIFTED,
    MEASURED,
    QUIET,
    SQUEALING,
    Statement,
    largest_rise,
    state,
)
from drumsqueal.questions.paper.transients import Point
from drumsqueal.solve.linear.modes import DRIFT_FRACTION, OSCILLATING_FRACTION, UNDAMPED_FRACTION


def check_statements(
    shoe: RigidShoe,
    friction: FrictionCurve,
    curves: Mapping[str, Curve],
    points: Mapping[str, tuple[Point, ...]],
    disturbed: tuple[Point, Point],
) -> tuple[Statement, ...]:
    """Check every statement against curves and transients, in the order of the figures."""
    return (
        _friction_falls(friction),
        *_stiffness(curves["5"]),
        *_constant(curves["5"], curves["6"]),
        slope_in_proportion(friction),
        *rotation_statements(curves["7"], shoe, friction),
        *design_statements(curves),
        *_nonlinear(points, *disturbed),
    )


def _friction_falls(curve: FrictionCurve) -> Statement:
    steepest = f"from {curve.coefficient[0]:.3g} at {curve.speed[0]:.3g} to {curve.coefficient[-1]:.3g} at "
    return state(
        "4",
        "The coefficient of friction falls with the speed",
        "largest slope dμ/ds over the speeds",
        "s/m",
        float(curve.slope.max()),
        "<",
        0.0,
        f"{steepest}{curve.speed[-1]:.3g} rad/s",
    )


def _stiffness(curve: Curve) -> tuple[Statement, ...]:
    at_zero = curve.spectrum.own[0]
    oscillating = {
        name
        for name, value in zip(curve.spectrum.names, at_zero, strict=True)
        if value.imag > OSCILLATING_FRACTION * np.abs(at_zero).max()
    }
    falls = {name: largest_rise(-curve.frequency_Hz(name)) for name in curve.spectrum.names}
    falling = max(falls, key=lambda name: falls[name])
    where = curve.shown[int(np.argmax(curve.frequency_Hz(falling)))]
    held = {name: fall for name, fall in falls.items() if name != "Z"}
    last = {name: float(curve.frequency_Hz(name)[-1]) for name in curve.spectrum.names}
    still = [name for name, value in last.items() if value == 0]
    rates = {name: curve.rate(name) for name in SQUEALING}
    nominal = _rates({name: rate[-1] for name, rate in rates.items()})
    weakest = min(SQUEALING, key=lambda name: rates[name][1:].min())
    others = {name: float(curve.rate(name)[1:].max()) for name in QUIET}
    loudest = max(others, key=lambda name: others[name])
    gap, pair, place = _closest(curve)
    return (
        state(
            "5",
            "Every frequency rises with the contact stiffness",
            "largest fall of one, from any stiffness to a higher one",
            "Hz",
            falls[falling],
            "<",
            1e-6,  # what stays at zero does not fall
            f"{falling} from {where:.3g} % on" if falls[falling] > 0 else "",
        ).read_also(
            "the same without Z, on which no contact stiffness acts",
            "Hz",
            max(held.values()),
            "<",
            1e-6,
            max(held, key=lambda name: held[name]),
        ),
        state(
            "5",
            "Without contact stiffness X and Tz oscillate, and no other mode",
            "modes that differ from this",
            "",
            float(len(oscillating ^ {"X", "Tz"})),
            "<",
            0.5,
            ", ".join(f"{name} {_hertz(curve.frequency_Hz(name)[0])}" for name in sorted(oscillating)),
        ),
        state(
            "5",
            "With contact stiffness every mode has a frequency",
            "lowest frequency at 100 %",
            "Hz",
            min(last.values()),
            ">",
            0.0,
            f"{', '.join(still)} has none: no contact stiffness acts on it" if still else "",
        ),
        state(
            "5",
            "With contact stiffness X, Y and Tz are unstable",
            "least growth rate of the three, above 0 %",
            "1/s",
            float(rates[weakest][1:].min()),
            ">",
            0.0,
            f"at 100 %: {nominal}; without it X {rates['X'][0]:+.3g} and Tz {rates['Tz'][0]:+.3g} 1/s",
        ),
        state(
            "5",
            "No other mode is unstable",
            "largest growth rate of Z, Tx and Ty, above 0 %",
            "1/s",
            others[loudest],
            "<",
            0.0,
            loudest,
        ),
        state(
            "5",
            "The unstable modes do not couple: no two frequencies meet",
            "least distance of two frequencies of X, Y and Tz over the higher",
            "",
            gap,
            ">",
            APART,
            f"{pair} at {place:.3g} %",
        ),
    )


def _constant(falling: Curve, constant: Curve) -> tuple[Statement, ...]:
    values = constant.spectrum.eigenvalues
    largest = np.abs(values).max(axis=1, keepdims=True)
    oscillates = np.abs(values.imag) > OSCILLATING_FRACTION * largest
    growing = values.real > np.where(oscillates, UNDAMPED_FRACTION, DRIFT_FRACTION) * largest
    top = max(float(falling.frequency_Hz(name).max()) for name in falling.spectrum.names)
    apart = {
        name: float(np.abs(falling.frequency_Hz(name) - constant.frequency_Hz(name)).max()) / top
        for name in falling.spectrum.names
    }
    furthest = max(apart, key=lambda name: apart[name])
    own = {name: _relative(falling.frequency_Hz(name), constant.frequency_Hz(name)) for name in SQUEALING + QUIET}
    changed = max(own, key=lambda name: own[name].max())
    return (
        state(
            "6",
            f"With constant friction (μ = {CONSTANT_FRICTION:g}) no mode is unstable",
            "eigenvalues that grow, at all stiffnesses",
            "",
            float(growing.sum()),
            "<",
            0.5,
            f"largest real part {values.real[oscillates].max():.1g} 1/s where it oscillates, round-off",
        ),
        state(
            "6",
            "With constant friction the frequencies are much as with falling friction",
            "largest difference over the highest frequency of all, as it looks in the figure",
            "",
            apart[furthest],
            "<",
            ALIKE,
            furthest,
        ).read_also(
            "largest difference over the mode's own frequency",
            "",
            float(own[changed].max()),
            "<",
            ALIKE,
            f"{changed} at {falling.shown[int(np.argmax(own[changed]))]:.3g} %",
        ),
    )


def _nonlinear(points: Mapping[str, tuple[Point, ...]], constant: Point, damped: Point) -> tuple[Statement, ...]:
    errors = [
        (abs(mode.growth_rate_error), f"{mode.label}, {point.key} {point.value:.4g}", mode)
        for each in points.values()
        for point in each
        for mode in (point.comparison.modes if point.comparison else ())
        if mode.unstable and mode.growth_rate_error is not None
    ]
    worst = max(errors, default=None, key=lambda error: error[0])
    scatter = worst[2].measured_growth if worst is not None else None
    shift = nearest = None
    nominal = points["5"][-1].comparison
    if nominal is not None and nominal.saturation is not None and nominal.saturation.main is not None:
        shift, nearest = nominal.saturation.frequency_shift, nominal.saturation
    ratio = None if constant.comparison is None else constant.comparison.motion_ratio
    lifted = None if damped.comparison is None else _lifted(damped.comparison)
    return (
        state(
            "5-11",
            "Near steady sliding the motion grows as its eigenvalue says",
            "largest relative error of a growth rate measured in a transient",
            "",
            None if worst is None else worst[0],
            "<",
            MEASURED,
            ""
            if worst is None or scatter is None
            else f"{worst[1]}, measured to ± {scatter.standard_error / abs(scatter.rate_1_per_s):.2g}; "
            f"{len(errors)} measured",
        ),
        state(
            "5",
            "The squealing frequency may differ from that of the onset",
            "relative difference of the saturated motion's main frequency",
            "",
            None if shift is None else abs(shift),
            ">",
            ALIKE,
            ""
            if nearest is None or nearest.main is None
            else f"{nearest.main.frequency_Hz:.0f} Hz, {shift:+.1%} from {nearest.nearest_mode}",
        ),
        state(
            "6",
            "Without linear instability there is no squeal",
            "motion at the end over that at first, after a large disturbance, with constant friction",
            "",
            ratio,
            "<",
            GROWN,
            f"start at {constant.value:g} p0/k_c",
        ).read_also(
            "fraction of the lining out of contact in the end, after that disturbance, where structural damping makes "
            "every mode decay",
            "",
            lifted,
            "<",
            LIFTED,
            _response(damped),
        ),
    )


def _lifted(comparison: RunFindings) -> float:
    """Mean fraction of the lining out of contact in the steady-state response."""
    saturation = comparison.saturation
    return 0.0 if saturation is None else 1.0 - saturation.contact_fraction


def _response(damped: Point) -> str:
    """The steady-state response of the damped brake."""
    damping = f"damping ratio {damped.value:.2g}"
    saturation = damped.comparison.saturation if damped.comparison else None
    if saturation is None or saturation.main is None:
        return damping
    return f"{damping}; {saturation.regime.kind}, {saturation.main.frequency_Hz:.0f} Hz"


def _closest(curve: Curve) -> tuple[float, str, float]:
    """Least distance of two frequencies of the squealing modes over the higher one, which, and where (percent)."""
    found = []
    for i, first in enumerate(SQUEALING):
        for second in SQUEALING[i + 1 :]:
            one, two = curve.frequency_Hz(first), curve.frequency_Hz(second)
            gap = _relative(one, two)
            found.append((float(gap.min()), f"{first} and {second}", float(curve.shown[int(np.argmin(gap))])))
    return min(found)


def _relative(one: NDArray[np.float64], two: NDArray[np.float64]) -> NDArray[np.float64]:
    """Difference over the larger of two frequencies; 0 where both are 0."""
    return np.abs(one - two) / np.maximum(np.maximum(one, two), np.finfo(float).tiny)


def _rates(rates: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {rate:+.1f}" for name, rate in rates.items())


def _hertz(frequency: float) -> str:
    return f"{frequency:.0f} Hz"
