"""What Seo & Kang (2023) state about their figures, each as a number that decides whether it holds.

Figure 7 is in `rotation`.
"""

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.bodies.body import Shoe
from drumsqueal.questions.paper.curves import CONSTANT_FRICTION, Curve, FrictionCurve
from drumsqueal.questions.paper.rotation import rotation_statements
from drumsqueal.questions.paper.statement import (
    ALIKE,
    APART,
    DRASTIC,
    GROWN,
    LIFTED,
    MEASURED,
    MINOR,
    QUIET,
    SQUEALING,
    STRAIGHT,
    Statement,
    falls,
    largest,
    largest_rise,
    listed,
    off_line,
)
from drumsqueal.questions.paper.transients import Point
from drumsqueal.solve.linear.modes import DRIFT_FRACTION, OSCILLATING_FRACTION, UNDAMPED_FRACTION


def check_statements(
    shoe: Shoe,
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
        *rotation_statements(curves["7"], shoe, friction),
        _load(curves["8"]),
        *_angle(curves["9"]),
        falls(curves["10"], "A larger radius lowers the growth rates of X, Y and Tz"),
        falls(curves["11"], "A larger width lowers the growth rates of X, Y and Tz"),
        _growth(points),
        _squeal_frequency(points["5"][-1]),
        _no_squeal(*disturbed),
    )


def _friction_falls(curve: FrictionCurve) -> Statement:
    (first, last), (slow, fast) = curve.coefficient[[0, -1]], curve.speed[[0, -1]]
    return Statement("4", "The coefficient of friction falls with the speed").read(
        "largest slope dμ/ds over the speeds",
        float(curve.slope.max()),
        "<",
        0.0,
        "s/m",
        f"from {first:.3g} at {slow:.3g} to {last:.3g} at {fast:.3g} rad/s",
    )


def _stiffness(curve: Curve) -> tuple[Statement, ...]:
    frequencies = {name: curve.frequency_Hz(name) for name in curve.spectrum.names}
    rates = {name: curve.rate(name) for name in SQUEALING}
    fall_of = {name: largest_rise(-frequency) for name, frequency in frequencies.items()}
    falling, fall = largest(fall_of)
    held, held_fall = largest({name: each for name, each in fall_of.items() if name != "Z"})
    start = curve.shown[int(np.argmax(frequencies[falling]))]
    at_zero = dict(zip(curve.spectrum.names, curve.spectrum.own[0].imag, strict=True))
    least = OSCILLATING_FRACTION * np.abs(curve.spectrum.own[0]).max()
    oscillating = sorted(name for name, frequency in at_zero.items() if frequency > least)
    still = [name for name, frequency in frequencies.items() if frequency[-1] == 0]
    growth = min(float(rate[1:].min()) for rate in rates.values())
    nominal = listed({name: rate[-1] for name, rate in rates.items()}, "+.1f")
    without = f"without it X {rates['X'][0]:+.3g} and Tz {rates['Tz'][0]:+.3g} 1/s"
    loudest, other = largest({name: curve.rate(name)[1:].max() for name in QUIET})
    gap, pair, place = _closest(curve)
    return (
        Statement("5", "Every frequency rises with the contact stiffness")
        .read(
            "largest fall of one, from any stiffness to a higher one",
            fall,
            "<",
            1e-6,  # what stays at zero does not fall
            "Hz",
            f"{falling} from {start:.3g} % on" if fall > 0 else "",
        )
        .read("the same without Z, on which no contact stiffness acts", held_fall, "<", 1e-6, "Hz", held),
        Statement("5", "Without contact stiffness X and Tz oscillate, and no other mode").read(
            "modes that differ from this",
            float(len({*oscillating} ^ {"X", "Tz"})),
            "<",
            0.5,
            detail=", ".join(f"{name} {frequencies[name][0]:.0f} Hz" for name in oscillating),
        ),
        Statement("5", "With contact stiffness every mode has a frequency").read(
            "lowest frequency at 100 %",
            min(float(frequency[-1]) for frequency in frequencies.values()),
            ">",
            0.0,
            "Hz",
            f"{', '.join(still)} has none: no contact stiffness acts on it" if still else "",
        ),
        Statement("5", "With contact stiffness X, Y and Tz are unstable").read(
            "least growth rate of the three, above 0 %", growth, ">", 0.0, "1/s", f"at 100 %: {nominal}; {without}"
        ),
        Statement("5", "No other mode is unstable").read(
            "largest growth rate of Z, Tx and Ty, above 0 %", other, "<", 0.0, "1/s", loudest
        ),
        Statement("5", "The unstable modes do not couple: no two frequencies meet").read(
            "least distance of two frequencies of X, Y and Tz over the higher",
            gap,
            ">",
            APART,
            detail=f"{pair} at {place:.3g} %",
        ),
    )


def _closest(curve: Curve) -> tuple[float, str, float]:
    """Least distance of two frequencies of the squealing modes over the higher one, which, and where (percent)."""
    found = []
    for one, other in combinations(SQUEALING, 2):
        gap = _relative(curve.frequency_Hz(one), curve.frequency_Hz(other))
        found.append((float(gap.min()), f"{one} and {other}", float(curve.shown[int(np.argmin(gap))])))
    return min(found)


def _relative(one: NDArray[np.float64], two: NDArray[np.float64]) -> NDArray[np.float64]:
    """Difference over the larger of two frequencies; 0 where both are 0."""
    return np.abs(one - two) / np.maximum(np.maximum(one, two), np.finfo(float).tiny)


def _constant(falling: Curve, constant: Curve) -> tuple[Statement, ...]:
    values = constant.spectrum.eigenvalues
    size = np.abs(values).max(axis=1, keepdims=True)
    oscillates = np.abs(values.imag) > OSCILLATING_FRACTION * size
    growing = values.real > np.where(oscillates, UNDAMPED_FRACTION, DRIFT_FRACTION) * size
    pairs = {name: (falling.frequency_Hz(name), constant.frequency_Hz(name)) for name in falling.spectrum.names}
    top = max(float(before.max()) for before, _ in pairs.values())
    furthest, apart = largest({name: np.abs(before - after).max() / top for name, (before, after) in pairs.items()})
    own = {name: _relative(*pairs[name]) for name in SQUEALING + QUIET}
    changed, change = largest({name: each.max() for name, each in own.items()})
    where = f"{changed} at {falling.shown[int(np.argmax(own[changed]))]:.3g} %"
    return (
        Statement("6", f"With constant friction (μ = {CONSTANT_FRICTION:g}) no mode is unstable").read(
            "eigenvalues that grow, at all stiffnesses",
            float(growing.sum()),
            "<",
            0.5,
            detail=f"largest real part {values.real[oscillates].max():.1g} 1/s where it oscillates, round-off",
        ),
        Statement("6", "With constant friction the frequencies are much as with falling friction")
        .read(
            "largest difference over the highest frequency of all, as it looks in the figure",
            apart,
            "<",
            ALIKE,
            detail=furthest,
        )
        .read("largest difference over the mode's own frequency", change, "<", ALIKE, detail=where),
    )


def _load(curve: Curve) -> Statement:
    rates = {name: curve.rate(name) for name in SQUEALING}
    bent, away = largest({name: off_line(curve.values, rate) / np.abs(rate).max() for name, rate in rates.items()})
    if not all(np.all(np.diff(rate) > 0) for rate in rates.values()):
        bent, away = "they do not rise", 1.0
    return Statement("8", "The growth rates of X, Y and Tz rise linearly with the load").read(
        "deviation from a straight line over the largest growth rate", away, "<", STRAIGHT, detail=bent
    )


def _angle(curve: Curve) -> tuple[Statement, ...]:
    rates = {name: curve.rate(name) for name in SQUEALING}
    change = {name: float(rate[-1] - rate[0]) for name, rate in rates.items()}
    fractions = {name: change[name] / abs(float(rate[0])) for name, rate in rates.items()}
    _, other = largest({name: abs(change[name]) for name in ("X", "Tz")})
    span = f"from {curve.shown[0]:.0f} to {curve.shown[-1]:.0f}°"
    changes = ", ".join(f"{name} {each:+.3g} 1/s" for name, each in change.items())
    own = max(abs(fractions[name] / fractions["Y"]) for name in ("X", "Tz")) if change["Y"] else None
    own_change = "larger change of the two in percent of its own value over that of Y"
    return (
        Statement("9", "A larger arc angle lowers the growth rate of Y drastically").read(
            f"relative change {span}", fractions["Y"], "<", -DRASTIC, detail=f"Y {change['Y']:+.3g} 1/s"
        ),
        Statement("9", "A larger arc angle changes the growth rates of X and Tz little")
        .read(
            "larger change of the two in 1/s over that of Y",
            other / abs(change["Y"]) if change["Y"] else None,
            "<",
            MINOR,
            detail=changes,
        )
        .read(own_change, own, "<", MINOR, detail=listed(fractions, "+.0%")),
        falls(curve, "A larger arc angle lowers the growth rates of X, Y and Tz"),
    )


def _growth(points: Mapping[str, tuple[Point, ...]]) -> Statement:
    errors = [
        (abs(mode.growth_rate_error), f"{mode.label}, {point.key} {point.value:.4g}", mode.measured_growth)
        for each in points.values()
        for point in each
        for mode in point.modes
        if mode.unstable and mode.growth_rate_error is not None
    ]
    worst, where, growth = max(errors, default=(None, "", None), key=lambda error: error[0])
    if growth is not None:
        scatter = growth.standard_error / abs(growth.rate_1_per_s)
        where = f"{where}, measured to ± {scatter:.2g}; {len(errors)} measured"
    return Statement("5-11", "Near steady sliding the motion grows as its eigenvalue says").read(
        "largest relative error of a growth rate measured in a transient", worst, "<", MEASURED, detail=where
    )


def _squeal_frequency(nominal: Point) -> Statement:
    shift, detail, saturation = None, "", nominal.saturation
    if saturation is not None and saturation.main is not None and saturation.frequency_shift is not None:
        shift = saturation.frequency_shift
        detail = f"{saturation.main.frequency_Hz:.0f} Hz, {shift:+.1%} from {saturation.nearest_mode}"
    return Statement("5", "The squealing frequency may differ from that of the onset").read(
        "relative difference of the saturated motion's main frequency",
        None if shift is None else abs(shift),
        ">",
        ALIKE,
        detail=detail,
    )


def _no_squeal(constant: Point, damped: Point) -> Statement:
    lifted, response = None if damped.comparison is None else 0.0, f"damping ratio {damped.value:.2g}"
    if damped.saturation is not None:
        lifted = 1.0 - damped.saturation.contact_fraction
        if damped.saturation.main is not None:
            response += f"; {damped.saturation.regime.kind}, {damped.saturation.main.frequency_Hz:.0f} Hz"
    return (
        Statement("6", "Without linear instability there is no squeal")
        .read(
            "motion at the end over that at first, after a large disturbance, with constant friction",
            None if constant.comparison is None else constant.comparison.motion_ratio,
            "<",
            GROWN,
            detail=f"start at {constant.value:g} p0/k_c",
        )
        .read(
            "fraction of the lining out of contact in the end, after that disturbance, where structural damping makes "
            "every mode decay",
            lifted,
            "<",
            LIFTED,
            detail=response,
        )
    )
