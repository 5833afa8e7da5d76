"""What Seo & Kang (2023) state about Figures 8 to 11: load, arc angle, radius and width."""

from collections.abc import Mapping

import numpy as np

from drumsqueal.questions.paper.curves import Curve
from drumsqueal.questions.paper.statement import DRASTIC, MINOR, SQUEALING, STRAIGHT, Statement, falls, off_line, state


def design_statements(curves: Mapping[str, Curve]) -> tuple[Statement, ...]:
    """Load, arc angle, radius and width."""
    return (
        _load(curves["8"]),
        *_angle(curves["9"]),
        falls(curves["10"], "A larger radius lowers the growth rates of X, Y and Tz"),
        falls(curves["11"], "A larger width lowers the growth rates of X, Y and Tz"),
    )


def _load(curve: Curve) -> Statement:
    away = {name: off_line(curve.values, curve.rate(name)) / np.abs(curve.rate(name)).max() for name in SQUEALING}
    rises = all(np.all(np.diff(curve.rate(name)) > 0) for name in SQUEALING)
    bent = max(away, key=lambda name: away[name])
    return state(
        "8",
        "The growth rates of X, Y and Tz rise linearly with the load",
        "departure from a straight line over the largest growth rate",
        "",
        float(away[bent]) if rises else 1.0,
        "<",
        STRAIGHT,
        bent if rises else "they do not rise",
    )


def _angle(curve: Curve) -> tuple[Statement, ...]:
    change = {name: float(curve.rate(name)[-1] - curve.rate(name)[0]) for name in SQUEALING}
    fractions = {name: change[name] / abs(float(curve.rate(name)[0])) for name in SQUEALING}
    span = f"from {curve.shown[0]:.0f} to {curve.shown[-1]:.0f}°"
    other = max(("X", "Tz"), key=lambda name: abs(change[name]))
    return (
        state(
            "9",
            "A larger arc angle lowers the growth rate of Y drastically",
            f"relative change {span}",
            "",
            fractions["Y"],
            "<",
            -DRASTIC,
            f"Y {change['Y']:+.3g} 1/s",
        ),
        state(
            "9",
            "A larger arc angle changes the growth rates of X and Tz little",
            "larger change of the two in 1/s over that of Y",
            "",
            abs(change[other] / change["Y"]) if change["Y"] else None,
            "<",
            MINOR,
            ", ".join(f"{name} {change[name]:+.3g} 1/s" for name in SQUEALING),
        ).read_also(
            "larger change of the two in percent of its own value over that of Y",
            "",
            max(abs(fractions[name] / fractions["Y"]) for name in ("X", "Tz")) if change["Y"] else None,
            "<",
            MINOR,
            ", ".join(f"{name} {fractions[name]:+.0%}" for name in SQUEALING),
        ),
        falls(curve, "A larger arc angle lowers the growth rates of X, Y and Tz"),
    )
