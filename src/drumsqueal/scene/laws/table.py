"""A measured friction curve, smooth between its points."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import model_validator

from drumsqueal.scene.quantities import Quantities, Quantity, check_rising
from drumsqueal.scene.tables import FrictionTable, check_points
from drumsqueal.scene.usual import SLIDING, Usual


class TableFriction(FrictionTable):
    """μ through the points (speed in m/s, coefficient), monotone between two of them, constant beyond the ends.

    The interpolant is that of F. N. Fritsch and J. Butland, SIAM Journal on Scientific and Statistical Computing 5
    (1984) 300, with ends as in SciPy's PchipInterpolator: μ' is continuous between the ends, beyond which it is zero.
    """

    name = "measured curve"
    usual: ClassVar = {"speed": Usual(0, 100, "m/s", "up to 100 m/s", (("mm/s", 1e-3),)), "coefficient": SLIDING}

    law: Literal["table"]
    speed: Annotated[tuple[float, ...], Quantities(Quantity("m/s", least=0), '["0 m/s", "0.2 m/s", "1 m/s"]')]
    """Slip speeds, rising, 2 to 50 of them."""
    coefficient: Annotated[tuple[float, ...], Quantities(Quantity("", least=0), "[0.45, 0.41, 0.36]")]
    """μ at these."""

    @model_validator(mode="after")
    def _is_a_curve(self) -> "TableFriction":
        cure = ', or law = "constant" if the coefficient is the same at every speed'
        check_points({"speed": self.speed, "coefficient": self.coefficient}, cure)
        check_rising(self.speed, "speed", "the speeds must increase; write one above {!r} m/s")
        return self

    @staticmethod
    def prepared(xp: Any, **numbers: Any) -> dict[str, Any]:
        """The points, and the slopes of the curve there (s/m)."""
        return numbers | {"slope": slopes(numbers["speed"], numbers["coefficient"], xp)}

    @staticmethod
    def mu(slip_speed: Any, xp: Any, *, speed: Any, coefficient: Any, slope: Any) -> Any:
        """μ at slip speeds s ≥ 0 (m/s)."""
        held = xp.clip(slip_speed, speed[0], speed[-1])
        left = xp.sum(held[..., None] >= speed[1:-1], axis=-1)
        width = speed[left + 1] - speed[left]
        ends, leaning = (coefficient[left], coefficient[left + 1]), (slope[left], slope[left + 1])
        return cubic((held - speed[left]) / width, width, ends, leaning)

    @staticmethod
    def cuts(xp: Any, *, speed: Any, **numbers: Any) -> tuple[Any, Any]:
        """Its points, where one cubic ends and another begins, and both ends, where the slope of the curve jumps.

        In space a cut at every point would take the error of the forces from 3e-8 of the load to 2e-12, and the program
        twice to many times as long to compile.
        """
        del numbers
        moving = xp.where(speed > 0, speed, speed[1])  # at rest slip reverses; a cut twice over costs an empty piece
        return moving, xp.stack([moving[0], moving[-1]])


def cubic(fraction: Any, width: Any, ends: tuple[Any, Any], slopes: tuple[Any, Any]) -> Any:
    """The cubic with these values and slopes at both ends of a piece, at a fraction of its width."""
    rest = 1 - fraction
    value = ends[0] * rest * rest * (1 + 2 * fraction) + ends[1] * fraction * fraction * (3 - 2 * fraction)
    return value + width * fraction * rest * (slopes[0] * rest - slopes[1] * fraction)


def slopes(speed: Any, value: Any, xp: Any) -> Any:
    """Slopes at the points (K,) of the monotone interpolant: a weighted harmonic mean of those of both sides."""
    width = speed[1:] - speed[:-1]
    secant = (value[1:] - value[:-1]) / width
    if len(secant) == 1:
        return xp.concatenate([secant, secant])
    before, after = width[1:] + 2 * width[:-1], 2 * width[1:] + width[:-1]
    product = secant[:-1] * secant[1:]
    total = before * secant[:-1] + after * secant[1:]
    rising = product > 0
    inner = xp.where(rising, (before + after) * product / xp.where(rising, total, 1.0), 0.0)
    first = _end_slope(width[0], width[1], secant[0], secant[1], xp)
    last = _end_slope(width[-1], width[-2], secant[-1], secant[-2], xp)
    return xp.concatenate([xp.reshape(first, 1), inner, xp.reshape(last, 1)])


def _end_slope(width: Any, next_width: Any, secant: Any, next_secant: Any, xp: Any) -> Any:
    """The slope of the parabola through three points at the first of them, held to what keeps the curve monotone."""
    slope = ((2 * width + next_width) * secant - width * next_secant) / (width + next_width)
    turned = (xp.sign(secant) != xp.sign(next_secant)) & (xp.abs(slope) > 3 * xp.abs(secant))
    return xp.where(xp.sign(slope) != xp.sign(secant), 0.0, xp.where(turned, 3 * secant, slope))
