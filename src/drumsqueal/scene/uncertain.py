"""Numbers of a scene that are not known exactly: the table `uncertain`, a distribution for each, in SI.

Quantiles are by scipy.special: those of scipy.stats load for 0.4 s longer, take 200 times as long where a distribution
is truncated, and differ in the last digit, which would change the samples of a seed.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.coordinates import is_coordinate
from drumsqueal.errors import nearest
from drumsqueal.scene.quantities import SceneError, as_first, parse_quantity

# A sample is a quantile at one of 2³² places, each in the middle of its interval: so no sample lies farther out than
# 6.4 deviations, and whether a distribution can reach a value that the scene does not take is a plain question.
PLACES = 2**32


@dataclass(frozen=True)
class Uniform:
    """Every value from `low` to `high` equally likely."""

    low: float
    high: float

    def quantile(self, fraction: ArrayLike) -> NDArray[np.float64]:
        """The value at a cumulative probability (0 to 1)."""
        return self.low + np.asarray(fraction) * (self.high - self.low)


@dataclass(frozen=True)
class Normal:
    """Normal with a mean and a standard deviation, truncated to what lies from `low` to `high` where these are given.

    Density φ((x − mean)/deviation)/deviation, divided by what the truncation leaves.
    """

    mean: float
    deviation: float
    low: float | None = None
    high: float | None = None

    def quantile(self, fraction: ArrayLike) -> NDArray[np.float64]:
        """The value at a cumulative probability (0 to 1)."""
        from scipy.special import ndtri  # a quarter of a second, which reading a scene does not need

        below, left = self.kept()
        values = self.mean + self.deviation * ndtri(below + np.asarray(fraction) * left)
        # Rounding alone could lead out of the limits.
        return np.clip(values, self.low, self.high) if (self.low, self.high) != (None, None) else values

    def kept(self) -> tuple[float, float]:
        """The probability below `low`, and that from `low` to `high`, of the whole distribution."""
        from scipy.special import ndtr

        below = 0.0 if self.low is None else float(ndtr((self.low - self.mean) / self.deviation))
        above = 1.0 if self.high is None else float(ndtr((self.high - self.mean) / self.deviation))
        return below, above - below


@dataclass(frozen=True)
class LogNormal:
    """The logarithm is normal: two thirds lie from median/geometric_deviation to median × geometric_deviation.

    Truncated to what lies from `low` to `high` where these are given.
    """

    median: float
    geometric_deviation: float
    low: float | None = None
    high: float | None = None

    def quantile(self, fraction: ArrayLike) -> NDArray[np.float64]:
        """The value at a cumulative probability (0 to 1)."""
        with np.errstate(over="ignore"):  # what reaches infinity is refused where it is read
            values = np.exp(self._logarithm().quantile(fraction))
        return np.clip(values, self.low, self.high) if (self.low, self.high) != (None, None) else values

    def kept(self) -> tuple[float, float]:
        """The probability below `low`, and that from `low` to `high`, of the whole distribution."""
        return self._logarithm().kept()

    def _logarithm(self) -> Normal:
        low = None if self.low is None or self.low <= 0 else float(np.log(self.low))
        high = None if self.high is None else float(np.log(self.high))
        return Normal(float(np.log(self.median)), float(np.log(self.geometric_deviation)), low, high)


Distribution = Uniform | Normal | LogNormal
KINDS: Mapping[str, type[Distribution]] = {"uniform": Uniform, "normal": Normal, "lognormal": LogNormal}


def reach(distribution: Distribution) -> tuple[float, float]:
    """The smallest and the largest possible value."""
    outermost = 0.5 / PLACES
    low, high = distribution.quantile([outermost, 1 - outermost])
    return float(low), float(high)


def describe(distribution: Distribution) -> dict[str, Any]:
    """The distribution as it would stand in a scene file, in SI."""
    kind = next(name for name, each in KINDS.items() if isinstance(distribution, each))
    return {"distribution": kind} | {key: value for key, value in asdict(distribution).items() if value is not None}


def read_distributions(table: Any, units: Mapping[str, str]) -> dict[str, Distribution] | None:
    """Read the table `uncertain` of numbers with these SI units by dotted key; raises SceneError.

    Keys are quoted ("drum.speed" = ...) or not (drum.speed = ...).
    """
    if table is None:
        return None
    if not isinstance(table, Mapping):
        raise SceneError('this must be a table of distributions; write [uncertain] with keys such as "drum.speed"')
    found = {}
    for key, written in flat(table):
        if key in found:
            raise SceneError("this key is there twice, with quotes and without; leave one of them out", (key,))
        kind = _kind(key)
        if kind not in units:
            raise SceneError(_unknown(key, units), (key,))
        if isinstance(written, Uniform | Normal | LogNormal):
            written = describe(written)
        found[key] = _read(key, written, units[kind])
    return found or None


def _kind(key: str) -> str:
    """The key that has the same unit: that of the first of a list, and of a start without whose coordinate it is."""
    table, kind, coordinate = [*key.split(".", 2), "", ""][:3]
    if table == "start" and is_coordinate(coordinate):
        key = f"start.{kind}.{coordinate.rpartition('.')[2]}"
    return as_first(key)


def flat(table: Mapping[str, Any], within: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and what stands there: drum.speed = {...} makes tables in tables, "drum.speed" = {...} does not."""
    for name, value in table.items():
        inside = value.values() if isinstance(value, Mapping) and "distribution" not in value else ()
        if inside and all(isinstance(each, Mapping | Distribution) for each in inside):
            yield from flat(value, f"{within}{name}.")
        else:
            yield f"{within}{name}", value


def _unknown(key: str, units: Mapping[str, str]) -> str:
    table, _, inner = key.removeprefix("shoe.").partition(".")
    tables = {each.partition(".")[0] for each in units}
    if f"shoe.0.{inner}" in units and table not in tables:  # a shoe's name, as in leading.thickness
        of_one = f"shoe.{inner}, or " if f"shoe.{inner}" in units else ""
        return f"unknown key; did you mean {of_one}of several shoes shoe.0.{inner}, shoe.1.{inner} and so on?"
    same_name = [each for each in units if each.rsplit(".", 1)[1] == key.rsplit(".", 1)[-1]]
    near = sorted(same_name, key=lambda each: not each.startswith(f"{table}.")) or nearest(key, units)
    return f"unknown key; did you mean {near[0]}?" if near else f"unknown key; the keys here are {', '.join(units)}"


def _read(key: str, written: Any, unit: str) -> Distribution:
    if not isinstance(written, Mapping):
        example = '{ distribution = "normal", mean = ..., deviation = ... }'
        raise SceneError(f"this must be a distribution, such as {example}", (key,), written)
    kinds = " or ".join(f'"{name}"' for name in KINDS)
    if "distribution" not in written:
        raise SceneError(f"the key is missing; write distribution = {kinds}", (key, "distribution"))
    name = written["distribution"]
    if not isinstance(name, str) or name not in KINDS:
        raise SceneError(f"write {kinds}", (key, "distribution"), name)
    kind = KINDS[name]
    known = [field.name for field in fields(kind)]
    for given in written:
        if given != "distribution" and given not in known:
            near = nearest(str(given), known)
            message = f"did you mean {near[0]}?" if near else f"this distribution has {', '.join(known)}"
            raise SceneError(f"unknown key; {message}", (key, str(given)))
    numbers = {}
    for field in fields(kind):
        if field.name in written:
            try:
                numbers[field.name] = _number(field.name, written[field.name], unit, numbers)
            except SceneError as error:
                raise error.under((key, field.name), written[field.name]) from None
        elif field.default is not None:  # low and high of a distribution that may go on for ever are None
            raise SceneError(f"the key is missing; this distribution has {', '.join(known)}", (key, field.name))
    distribution = kind(**numbers)
    _check(key, distribution)
    return distribution


def _number(name: str, written: Any, unit: str, known: Mapping[str, float]) -> float:
    """A parameter of a distribution of numbers with this unit; a deviation in per cent is one of the mean."""
    if name == "deviation" and isinstance(written, str) and written.rstrip().endswith(("%", "percent")):
        return parse_quantity(written, "") * abs(known["mean"])
    return parse_quantity(written, "" if name == "geometric_deviation" else unit)


def _check(key: str, distribution: Distribution) -> None:
    """Raise SceneError for parameters that make no distribution."""
    for name, least, message in (
        ("deviation", 0, "the deviation must be above 0"),
        ("median", 0, "the median must be above 0"),
        ("geometric_deviation", 1, "the geometric deviation is a factor, such as 1.1, and must be above 1"),
    ):
        value = getattr(distribution, name, None)
        if value is not None and not value > least:
            raise SceneError(message, (key, name), value)
    if distribution.low is not None and distribution.high is not None and not distribution.low < distribution.high:
        raise SceneError(f"high must be above low, {distribution.low!r}", (key, "high"), distribution.high)
    if isinstance(distribution, LogNormal) and distribution.high is not None and distribution.high <= 0:
        raise SceneError(
            "a lognormal quantity is never below 0; write a larger value", (key, "high"), distribution.high
        )
    least_left = 1e-6  # probability that a truncation must leave: of less, the quantiles are rounded off
    if not isinstance(distribution, Uniform) and distribution.kept()[1] < least_left:
        left = f"low and high leave {distribution.kept()[1]:.2g} of the distribution"
        raise SceneError(f"{left}; they must leave at least {least_left:g}", (key,))
    if not all(np.isfinite(reach(distribution))):
        raise SceneError("the distribution reaches beyond all numbers; make it narrower", (key,))
