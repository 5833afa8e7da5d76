"""Seo & Kang (2023) recomputed: Figures 4 to 11, and a number that decides each statement of the text.

The brake is that of "Dynamic Instability of Rigid Shoe Modes in a Drum Brake System", Lubricants 2023, 11(12), 496.
Eigenvalues are lines in the figures; marks on them are what transients of the nonlinear model did: growth rates and
frequencies measured before lift-off and slip reversal, and the strongest line of the motion that they grow into.

    python seo_kang_2023.py out/paper

writes the figures, the data behind them (paper.csv) and the statements (statements.csv, statements.json) into a folder,
in about a minute. `drumsqueal paper` does the same, for another brake too (`--set`). In Python, `study()` gives the
statements, curves and transients, and `draw` a figure of them.

The paper names the quantity on each axis but not its range, save for the stiffness (0 to 100 %): the ranges are ours.
"""

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from importlib.metadata import version
from itertools import combinations
from math import degrees
from pathlib import Path
from platform import python_version
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Column, Table
from rich.text import Text

from drumsqueal import (
    EigenvalueSet,
    IntegrationError,
    RequestError,
    RunFindings,
    Scene,
    analyse_stability,
    build_model,
    run,
    seo_kang_brake,
    silent,
    spectra_of,
)

Floats = NDArray[np.float64]
SQUEALING, QUIET = ("X", "Y", "Tz"), ("Z", "Tx", "Ty")  # modes in the plane of the shoe, and out of it
COORDINATES: tuple[str, ...] = ("X", "Y", "Z", "Tx", "Ty", "Tz")
POINTS = 121  # on each line
CONSTANT_FRICTION = 0.4  # μ of Figure 6
DISTURBANCE = 3.0  # times p0/k_c, the displacement at which the mean pressure is lost
MORE = 1.05  # times the damping with which the last mode neither grows nor decays

# What the words of the paper are taken to mean.
STRAIGHT = 0.01  # of the largest value: what is nearer to a straight line is linear
ALIKE = 0.01  # of the frequency axis: what is nearer looks the same
APART = 0.1  # of the higher frequency: modes that are further from each other are not about to meet
NO_PART = 1e-9  # of a mode's kinetic energy
EXPONENT = 0.05  # a power of the speed within this of -1 is "proportional to 1/Ω"
MAJOR = 0.5  # of the mean square motion of the lining
DRASTIC = 0.25  # of the value at the smallest angle
MINOR = 0.5  # of the change that is called drastic
MEASURED = 0.01  # of a growth rate, by which a transient may miss an eigenvalue
GROWN = 1  # times the motion at first: more has grown
LIFTED = 0.01  # of the lining: more out of contact in the steady-state response is squeal
NARROW = (0.4, 1.0)  # of the scene's speed: a shorter axis, from 2 to 5 rad/s


# --- curves ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Axis:
    """What a figure varies: the number's key, between which fractions of the scene's value, and how it is shown.

    `factor` turns SI into the unit of the axis, 0 shows percent of the scene's value. `transients` are the fractions of
    the scene's value at which the nonlinear model is run.
    """

    figure: str
    key: str
    low: float
    high: float
    label: str
    unit: str
    factor: float
    transients: tuple[float, ...]

    def shown(self, value: Floats | float, nominal: float) -> Floats:
        """Values (SI) in the unit of the axis."""
        return np.asarray(value) * (self.factor or 100 / nominal)


AXES = (
    Axis("5", "contact.stiffness", 0.0, 1.0, "Contact stiffness", "%", 0, (0.25, 0.5, 0.75, 1.0)),
    Axis("6", "contact.stiffness", 0.0, 1.0, "Contact stiffness", "%", 0, (0.25, 0.5, 1.0)),
    Axis("7", "drum.speed", 0.1, 3.0, "Drum speed", "rad/s", 1, (0.3, 0.6, 1.0, 2.0, 3.0)),
    Axis("8", "contact.normal_load", 0.025, 2.0, "Normal load", "N", 1, (0.5, 1.0, 1.5, 2.0)),
    Axis("9", "shoe.arc_angle", 0.7, 1.3, "Contact arc angle", "deg", degrees(1), (0.75, 0.875, 1.0, 1.125, 1.25)),
    Axis("10", "shoe.outer_radius", 0.7, 1.3, "Outer radius", "mm", 1e3, (0.75, 0.875, 1.0, 1.125, 1.25)),
    Axis("11", "shoe.width", 0.5, 1.5, "Shoe width", "%", 0, (0.6, 0.8, 1.0, 1.2, 1.4)),
)


@dataclass(frozen=True)
class Curve:
    """One figure's eigenvalues: `values` (m,) of the number in SI, the scene's own value, and the spectra."""

    axis: Axis
    values: Floats
    nominal: float
    spectrum: EigenvalueSet

    @property
    def shown(self) -> Floats:
        """The values in the unit of the figure's axis."""
        return self.axis.shown(self.values, self.nominal)

    def rate(self, name: str) -> Floats:
        """Growth rate (m,) of a coordinate's mode in 1/s."""
        return self.spectrum.of(name).real

    def frequency_Hz(self, name: str) -> Floats:
        """Frequency (m,) of a coordinate's mode in Hz."""
        return self.spectrum.of(name).imag / (2 * np.pi)


@dataclass(frozen=True)
class FrictionCurve:
    """Figure 4: drum speed Ω (rad/s), coefficient of friction μ at the slip speed RΩ, and its slope dμ/ds (s/m)."""

    speed: Floats
    coefficient: Floats
    slope: Floats
    own_speed: float  # of the scene


def check_brake(scene: Scene) -> None:
    """Raise RequestError for a scene that the paper's figures cannot be drawn of."""
    numbers = scene.numbers()
    missing = next((axis.key for axis in AXES if axis.key not in numbers), None)
    if missing is not None:
        raise RequestError(f"{missing} changes over time; the figures of the paper vary it: give it one value")
    if scene.friction is None:
        raise RequestError("the scene has no friction; the figures of the paper are about it: add the table friction")
    if any(table is not None for table in (scene.shoe.elastic, scene.drum.elastic, scene.drum.mesh)):
        raise RequestError("the shoe of the paper is rigid; leave the table shoe.elastic out")
    if scene.simulate.coordinates != "auto" and set(scene.simulate.coordinates) != set(COORDINATES):
        raise RequestError('the figures of the paper show all six coordinates; set simulate.coordinates to "auto"')
    if not all(numbers[key] for key in ("drum.speed", "contact.stiffness", "contact.normal_load")):
        raise RequestError(
            "drum.speed, contact.stiffness and contact.normal_load must not be 0 for the paper's figures"
        )


def constant_friction(scene: Scene) -> dict[str, Any]:
    """What makes the friction of a scene that of Figure 6."""
    return {} if scene.friction is None else {"friction": scene.friction.constant(CONSTANT_FRICTION)}


def paper_curves(scene: Scene) -> dict[str, Curve]:
    """Eigenvalues along every figure's axis, by figure."""
    falling = curves_along(scene, [axis for axis in AXES if axis.figure != "6"])
    constant = curves_along(scene.with_values(constant_friction(scene)), [axis for axis in AXES if axis.figure == "6"])
    return {axis.figure: (falling | constant)[axis.figure] for axis in AXES}


def curves_along(scene: Scene, axes: Sequence[Axis]) -> dict[str, Curve]:
    """Eigenvalues along some axes, all other numbers being the scene's: one call, as it compiles one program."""
    own = {key: value for key, value in scene.numbers().items() if isinstance(value, float)}
    grids = [own[axis.key] * np.linspace(axis.low, axis.high, POINTS) for axis in axes]
    pairs = list(zip(axes, grids, strict=True))
    numbers = {
        key: np.concatenate([grid if axis.key == key else np.full(POINTS, value) for axis, grid in pairs])
        for key, value in own.items()
    }
    whole, curves = spectra_of(scene, numbers), {}
    for k, (axis, grid) in enumerate(pairs):
        rows = slice(k * POINTS, (k + 1) * POINTS)
        curves[axis.figure] = Curve(axis, grid, own[axis.key], whole.part(rows))
    return curves


def friction_curve(scene: Scene) -> FrictionCurve:
    """The friction law over the drum speeds of Figure 7."""
    (axis,) = (axis for axis in AXES if axis.figure == "7")
    own = abs(float(scene.numbers()["drum.speed"]))  # pyright: ignore[reportArgumentType] (checked by check_brake)
    speed = own * np.linspace(axis.low, axis.high, POINTS)
    law = build_model(scene).contact.friction.law  # pyright: ignore[reportOptionalMemberAccess] (as above)
    with_slope = jax.vmap(jax.value_and_grad(lambda slip: jnp.asarray(law.coefficient(slip), dtype=float)))
    coefficient, slope = with_slope(jnp.asarray(scene.shoe.outer_radius * speed))
    return FrictionCurve(speed, np.asarray(coefficient), np.asarray(slope), own)


# --- transients ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Point:
    """One transient: the figure it belongs to, the value (SI) of the number varied, and what it did.

    `comparison` is None where there is no transient, and `why_not` then says why.
    """

    figure: str
    key: str
    value: float
    scene: Scene
    comparison: RunFindings | None = None
    why_not: str = "the transient was not run"

    @property
    def modes(self) -> tuple:
        """What was measured of each mode."""
        return () if self.comparison is None else self.comparison.modes

    @property
    def saturation(self) -> Any:
        """The motion that it grows into, or None."""
        return None if self.comparison is None else self.comparison.saturation


def points_of_figures(scene: Scene) -> list[Point]:
    """The points of all figures, not yet run. Raises SceneError for a value that makes no brake."""
    points = []
    for axis in AXES:
        for fraction in axis.transients:
            value = float(scene.numbers()[axis.key]) * fraction  # pyright: ignore[reportArgumentType] (as above)
            changes: dict[str, Any] = {axis.key: value} if fraction != 1 else {}
            if axis.figure == "6":
                changes |= constant_friction(scene)
            points.append(Point(axis.figure, axis.key, value, scene.with_values(changes)))
    return points


def disturbed_points(scene: Scene) -> tuple[Point, Point]:
    """Two starts beyond the contact boundary of a brake that is linearly stable, not yet run.

    One is stable by constant friction, the other by structural damping, a twentieth more than the least that makes
    every mode decay; its ratio is then the point's value.
    """
    modes = analyse_stability(build_model(scene, coordinates=COORDINATES)).modes
    known = 0.0 if scene.damping is None else float(scene.damping.ratio)
    ratio = known + MORE * max(0.0, *(mode.growth_rate / abs(mode.eigenvalue) for mode in modes))
    constant = disturbed(scene.with_values(constant_friction(scene)))
    damped = disturbed(scene.with_values({"damping": {"ratio": ratio}}))
    return Point("6", "start", DISTURBANCE, constant), Point("5", "damping.ratio", ratio, damped)


def disturbed(scene: Scene) -> Scene:
    """The scene with a start beyond the contact boundary, in the two coordinates in which the drum drags the shoe."""
    shoe, contact = scene.shoe, scene.contact
    pressure = float(contact.normal_load) / (shoe.outer_radius * shoe.arc_angle * shoe.width)  # pyright: ignore[reportArgumentType]
    assert contact.stiffness is not None  # as of a lining that is measured
    size = DISTURBANCE * pressure / contact.stiffness
    return scene.with_values({"start": {"displacement": {"Y": size, "Tz": size / shoe.outer_radius}, "velocity": {}}})


def run_points(points: Sequence[Point], progress: Callable[[str, float, float | None], None]) -> list[Point]:
    """Run the transients of points, a scene that several share once. Raises SceneError for one that cannot be run."""
    scenes = {point.scene.to_toml(): point.scene for point in points}
    ran: dict[str, RunFindings | str] = {}
    for number, (text, scene) in enumerate(scenes.items()):

        def show(_: str, reached: float, duration: float | None, number: int = number) -> None:
            progress(f"transient {number + 1} of {len(scenes)}", number + reached / (duration or 1.0), len(scenes))

        show("", 0, None)
        try:
            found = run(scene, show).findings
            outcome = found.outcome
        except IntegrationError as error:  # nothing was computed
            found, outcome = None, str(error)
        if outcome.startswith("interrupted"):
            raise KeyboardInterrupt
        ran[text] = outcome if found is None or outcome != "complete" else found
    results = [(point, ran[point.scene.to_toml()]) for point in points]
    return [
        replace(point, why_not=result) if isinstance(result, str) else replace(point, comparison=result, why_not="")
        for point, result in results
    ]


# --- statements ------------------------------------------------------------------------------------------------------


class Verdict(StrEnum):
    """What the numbers say of a statement."""

    CONFIRMED = "confirmed"
    NOT_CONFIRMED = "not confirmed"
    DEPENDS = "depends on a reading that the text does not fix"
    NOT_DECIDED = "not decided"


@dataclass(frozen=True)
class Reading:
    """One reading of a statement: a number that decides it (None where it is not known), and what it must fulfil.

    The condition is a bound, a limit and a unit, as in "> 0 1/s"; `detail` says where.
    """

    measure: str
    value: float | None
    condition: str
    detail: str = ""

    @property
    def margin(self) -> float | None:
        """Distance from the limit, positive on the side on which the statement holds."""
        bound, limit, *_ = self.condition.split()
        if self.value is None or not np.isfinite(self.value):
            return None
        return float(self.value - float(limit) if bound == ">" else float(limit) - self.value)

    @property
    def holds(self) -> bool | None:
        """Whether the number is on the right side of its limit."""
        return None if self.margin is None else self.margin > 0

    def row(self) -> dict[str, Any]:
        """All of it, by name."""
        bound, limit, *unit = self.condition.split()
        where = {"measure": self.measure, "unit": " ".join(unit), "value": self.value, "bound": bound}
        return where | {"limit": float(limit), "detail": self.detail, "holds": self.holds, "margin": self.margin}


@dataclass(frozen=True)
class Statement:
    """One statement of the paper, in our words, and the readings that the text leaves open."""

    figure: str
    statement: str
    readings: tuple[Reading, ...]

    @property
    def verdict(self) -> Verdict:
        """Confirmed or not where all readings agree."""
        held = {reading.holds for reading in self.readings}
        if None in held:
            return Verdict.NOT_DECIDED
        if len(held) > 1:
            return Verdict.DEPENDS
        return Verdict.CONFIRMED if held == {True} else Verdict.NOT_CONFIRMED


def says(figure: str, statement: str, *readings: tuple) -> Statement:
    """A statement about a figure, with the measure, number, condition and detail of each reading."""
    return Statement(figure, statement, tuple(Reading(*reading) for reading in readings))


def check_statements(
    shoe: Any,
    friction: FrictionCurve,
    curves: Mapping[str, Curve],
    points: Mapping[str, Sequence[Point]],
    disturbed: Sequence[Point],
) -> list[Statement]:
    """Every statement with its numbers, in the order of the figures."""
    return [
        on_friction(friction),
        *on_stiffness(curves["5"]),
        *on_constant_friction(curves["5"], curves["6"]),
        *on_speed(curves["7"], shoe, friction),
        on_load(curves["8"]),
        *on_angle(curves["9"]),
        falls(curves["10"], "A larger radius lowers the growth rates of X, Y and Tz"),
        falls(curves["11"], "A larger width lowers the growth rates of X, Y and Tz"),
        *on_transients(points, *disturbed),
    ]


# fmt: off
def on_friction(curve: FrictionCurve) -> Statement:
    """Figure 4."""
    (first, last), (slow, fast) = curve.coefficient[[0, -1]], curve.speed[[0, -1]]
    where = f"from {first:.3g} at {slow:.3g} to {last:.3g} at {fast:.3g} rad/s"
    return says("4", "The coefficient of friction falls with the speed",
        ("largest slope dμ/ds over the speeds", float(curve.slope.max()), "< 0 s/m", where))


def on_stiffness(curve: Curve) -> Iterator[Statement]:
    """Figure 5."""
    frequencies = {name: curve.frequency_Hz(name) for name in COORDINATES}
    rates = {name: curve.rate(name) for name in SQUEALING}
    falls_by = {name: largest_rise(-frequency) for name, frequency in frequencies.items()}
    falling, fall = largest(falls_by)
    begins = f"{falling} from {curve.shown[int(np.argmax(frequencies[falling]))]:.3g} % on" if fall > 0 else ""
    held, held_fall = largest({name: each for name, each in falls_by.items() if name != "Z"})
    yield says("5", "Every frequency rises with the contact stiffness",  # what stays at zero does not fall
        ("largest fall of one, from any stiffness to a higher one", fall, "< 1e-06 Hz", begins),
        ("the same without Z, on which no contact stiffness acts", held_fall, "< 1e-06 Hz", held))

    least = 1e-9 * np.abs(curve.spectrum.own[0]).max() / (2 * np.pi)  # less is round-off
    at_zero = {name: each[0] for name, each in sorted(frequencies.items()) if each[0] > least}
    yield says("5", "Without contact stiffness X and Tz oscillate, and no other mode",
        ("modes that differ from this", float(len({*at_zero} ^ {"X", "Tz"})), "< 0.5", listed(at_zero, ".0f", "Hz")))

    lowest = min(float(frequency[-1]) for frequency in frequencies.values())
    still = ", ".join(name for name, frequency in frequencies.items() if frequency[-1] == 0)
    yield says("5", "With contact stiffness every mode has a frequency",
        ("lowest frequency at 100 %", lowest, "> 0 Hz", still and f"{still} has none: no contact stiffness acts on it"))

    growth = min(float(rate[1:].min()) for rate in rates.values())
    nominal = listed({name: rate[-1] for name, rate in rates.items()}, "+.1f")
    without = f"without it X {rates['X'][0]:+.3g} and Tz {rates['Tz'][0]:+.3g} 1/s"
    yield says("5", "With contact stiffness X, Y and Tz are unstable",
        ("least growth rate of the three, above 0 %", growth, "> 0 1/s", f"at 100 %: {nominal}; {without}"))

    loudest, other = largest({name: curve.rate(name)[1:].max() for name in QUIET})
    yield says("5", "No other mode is unstable",
        ("largest growth rate of Z, Tx and Ty, above 0 %", other, "< 0 1/s", loudest))

    gap, pair, place = closest(curve)
    measure = "least distance of two frequencies of X, Y and Tz over the higher"
    yield says("5", "The unstable modes do not couple: no two frequencies meet",
        (measure, gap, f"> {APART}", f"{pair} at {place:.3g} %"))


def on_constant_friction(falling: Curve, constant: Curve) -> Iterator[Statement]:
    """Figure 6, next to Figure 5."""
    spectrum = constant.spectrum
    most = spectrum.eigenvalues.real[spectrum.oscillating].max()
    round_off = f"largest real part {most:.1g} 1/s where it oscillates, round-off"
    yield says("6", f"With constant friction (μ = {CONSTANT_FRICTION:g}) no mode is unstable",
        ("eigenvalues that grow, at all stiffnesses", float(spectrum.growing.sum()), "< 0.5", round_off))

    pairs = {name: (falling.frequency_Hz(name), constant.frequency_Hz(name)) for name in SQUEALING + QUIET}
    top = max(float(before.max()) for before, _ in pairs.values())
    furthest, apart = largest({name: np.abs(before - after).max() / top for name, (before, after) in pairs.items()})
    own = {name: distance(*pair) for name, pair in pairs.items()}
    changed, change = largest({name: each.max() for name, each in own.items()})
    where = f"{changed} at {falling.shown[int(np.argmax(own[changed]))]:.3g} %"
    look = "largest difference over the highest frequency of all, as it looks in the figure"
    yield says("6", "With constant friction the frequencies are much as with falling friction",
        (look, apart, f"< {ALIKE}", furthest),
        ("largest difference over the mode's own frequency", change, f"< {ALIKE}", where))


def on_speed(curve: Curve, shoe: Any, friction: FrictionCurve) -> Iterator[Statement]:
    """Figure 7."""
    law = "the paper's μt = α (μs − μk) exp(−αRΩ) is an exponential"
    yield says("7", "The slope μt grows in proportion as the drum slows down",
        bow_of_slope(friction, friction.speed, law),
        bow_of_slope(friction, friction.own_speed * np.linspace(*NARROW, friction.speed.size)))
    yield falls(curve, "The slower the drum, the larger the growth rates of X, Y and Tz")

    spectrum, n = curve.spectrum, len(COORDINATES)
    energy = np.abs(spectrum.right[:, :n]) ** 2 * spectrum.mass[:, :, None]
    axial = energy[:, [COORDINATES.index(name) for name in QUIET]].sum(axis=1) / energy.sum(axis=1)
    part = max(float(axial[spectrum.eigenvalues == spectrum.of(name)[:, None]].max()) for name in SQUEALING)
    yield says("7", "Friction across the sliding direction does not touch X, Y and Tz",
        ("largest fraction of Z, Tx and Ty in their kinetic energy", part, f"< {NO_PART}"))

    loudest, growth = largest({name: curve.rate(name).max() for name in QUIET})
    yield says("7", "Friction damping makes Z, Tx and Ty decay at every speed",
        ("largest growth rate of the three", growth, "< 0 1/s", loudest))

    speed = np.abs(curve.values)
    order = np.argsort(speed)  # from slow to fast the growth rate of the least damped one should rise
    least_damped = np.where(~spectrum.drifting & (axial > 0.5), spectrum.eigenvalues.real, -np.inf).max(axis=1)[order]
    rise = float(np.diff(least_damped).min())
    last, _ = largest({name: curve.rate(name)[order[0]] for name in QUIET})
    creeps = "" if spectrum.of(last)[order[0]].imag else ", which no longer oscillates there"
    turn = "" if rise > 0 else f"below {speed[order][np.argmin(least_damped)]:.3g} rad/s: {last}{creeps}"
    slow = speed <= abs(curve.nominal) * (1 + 1e-9)
    loudest, growth = largest({name: curve.rate(name)[slow].max() for name in QUIET})
    change = "decay rate of the least damped of them, least change from a speed to the next slower one"
    up_to = f"largest growth rate of the three up to {abs(curve.nominal):.3g} rad/s"
    yield says("7", "At low speeds the squeal propensity of Z, Tx and Ty is suppressed",
        (change, rise, "> 0 1/s", turn), (up_to, growth, "< 0 1/s", loudest))

    yield says("7", "Friction damping is proportional to 1/Ω",
        power("power of Ω in the damping μ0 p0/(RΩ) of Z, Tx and Ty, its distance from −1", curve, 1.0),
        power("the same of the damping over μ0, which falls with the speed", curve, friction.coefficient))
    yield says("7", "X, Y and Tz move the lining mainly along the sliding direction",
        *moves(curve, shoe, SQUEALING, "θ"))
    yield says("7", "Z, Tx and Ty move the lining mainly across the sliding direction",
        *moves(curve, shoe, QUIET, "z"))


def on_load(curve: Curve) -> Statement:
    """Figure 8."""
    rates = {name: curve.rate(name) for name in SQUEALING}
    bent, away = largest({name: off_line(curve.values, rate) / np.abs(rate).max() for name, rate in rates.items()})
    if not all(np.all(np.diff(rate) > 0) for rate in rates.values()):
        bent, away = "they do not rise", 1.0
    return says("8", "The growth rates of X, Y and Tz rise linearly with the load",
        ("deviation from a straight line over the largest growth rate", away, f"< {STRAIGHT}", bent))


def on_angle(curve: Curve) -> Iterator[Statement]:
    """Figure 9."""
    rates = {name: curve.rate(name) for name in SQUEALING}
    change = {name: float(rate[-1] - rate[0]) for name, rate in rates.items()}
    fractions = {name: change[name] / abs(float(rate[0])) for name, rate in rates.items()}
    measure = f"relative change from {curve.shown[0]:.0f} to {curve.shown[-1]:.0f}°"
    yield says("9", "A larger arc angle lowers the growth rate of Y drastically",
        (measure, fractions["Y"], f"< {-DRASTIC}", f"Y {change['Y']:+.3g} 1/s"))

    in_rate, in_percent = (
        max(abs(of[name]) for name in ("X", "Tz")) / abs(of["Y"]) if change["Y"] else None for of in (change, fractions)
    )
    own = "larger change of the two in percent of its own value over that of Y"
    yield says("9", "A larger arc angle changes the growth rates of X and Tz little",
        ("larger change of the two in 1/s over that of Y", in_rate, f"< {MINOR}", listed(change, "+.3g", "1/s")),
        (own, in_percent, f"< {MINOR}", listed(fractions, "+.0%")))
    yield falls(curve, "A larger arc angle lowers the growth rates of X, Y and Tz")


def on_transients(points: Mapping[str, Sequence[Point]], constant: Point, damped: Point) -> Iterator[Statement]:
    """What takes the nonlinear model."""
    errors = [
        (abs(mode.growth_rate_error), f"{mode.label}, {point.key} {point.value:.4g}", mode.measured_growth)
        for of_figure in points.values() for point in of_figure for mode in point.modes
        if mode.unstable and mode.growth_rate_error is not None
    ]
    worst, where, growth = max(errors, default=(None, "", None), key=lambda error: error[0])
    if growth is not None:
        scatter = growth.standard_error / abs(growth.rate_1_per_s)
        where = f"{where}, measured to ± {scatter:.2g}; {len(errors)} measured"
    yield says("5-11", "Near steady sliding the motion grows as its eigenvalue says",
        ("largest relative error of a growth rate measured in a transient", worst, f"< {MEASURED}", where))

    shift, line, squeal = None, "", points["5"][-1].saturation
    if squeal is not None and squeal.main is not None and squeal.frequency_shift is not None:
        shift = abs(squeal.frequency_shift)
        line = f"{squeal.main.frequency_Hz:.0f} Hz, {squeal.frequency_shift:+.1%} from {squeal.nearest_mode}"
    yield says("5", "The squealing frequency may differ from that of the onset",
        ("relative difference of the saturated motion's main frequency", shift, f"> {ALIKE}", line))

    end = None if constant.comparison is None else constant.comparison.motion_ratio
    lifted, response = None if damped.comparison is None else 0.0, f"damping ratio {damped.value:.2g}"
    if damped.saturation is not None:
        lifted = 1.0 - damped.saturation.contact_fraction
        if damped.saturation.main is not None:
            response += f"; {damped.saturation.regime.kind}, {damped.saturation.main.frequency_Hz:.0f} Hz"
    after = "motion at the end over that at first, after a large disturbance, with constant friction"
    out = "fraction of the lining out of contact in the end, after that disturbance, where structural damping makes "
    yield says("6", "Without linear instability there is no squeal",
        (after, end, f"< {GROWN}", f"start at {constant.value:g} p0/k_c"),
        (f"{out}every mode decay", lifted, f"< {LIFTED}", response))
# fmt: on


def closest(curve: Curve) -> tuple[float, str, float]:
    """Least distance of two frequencies of the squealing modes over the higher one, which, and where (percent)."""
    found = []
    for one, other in combinations(SQUEALING, 2):
        gap = distance(curve.frequency_Hz(one), curve.frequency_Hz(other))
        found.append((float(gap.min()), f"{one} and {other}", float(curve.shown[int(np.argmin(gap))])))
    return min(found)


def distance(one: Floats, two: Floats) -> Floats:
    """Difference over the larger of two frequencies; 0 where both are 0."""
    return np.abs(one - two) / np.maximum(np.maximum(one, two), np.finfo(float).tiny)


def bow_of_slope(curve: FrictionCurve, speed: Floats, detail: str = "") -> tuple:
    """How far the slope of the friction curve is from a straight line over the drum's speed."""
    slope = np.interp(speed, curve.speed, curve.slope)
    size = float(np.abs(slope).max())
    measure = f"deviation from a straight line over the largest, from {speed[0]:.3g} to {speed[-1]:.3g} rad/s"
    return measure, off_line(speed, slope) / size if size > 0 else None, f"< {STRAIGHT}", detail


def power(measure: str, curve: Curve, over: Floats | float) -> tuple:
    """How far the exponent of the drum speed in the damping over a factor is from −1, of what is out of the plane."""
    powers = {name: exponent(curve, name, over) for name in QUIET}
    return measure, max(abs(each + 1) for each in powers.values()), f"< {EXPONENT}", listed(powers, ".3f")


def exponent(curve: Curve, name: str, over: Floats | float) -> float:
    """That of the drum speed in a coordinate's damping, C_kk over a factor, by a straight line in logarithms."""
    k = COORDINATES.index(name)
    damping = curve.spectrum.damping[:, k, k] / over
    if np.any(damping <= 0):
        return np.inf
    return float(np.polyfit(np.log(np.abs(curve.values)), np.log(damping), 1)[0])


def moves(curve: Curve, shoe: Any, names: Sequence[str], symbol: str) -> tuple[tuple, tuple]:
    """How much the lining moves along one direction of its surface; the paper contrasts u_θ and u_z alone."""
    squares = {name: lining_motion(curve, shoe, name) for name in names}
    index = "rθz".index(symbol)
    of_all = {name: float(each[index]) for name, each in squares.items()}
    of_surface = {name: float(each[index] / (each[1] + each[2])) for name, each in squares.items()}
    fraction, limit = f"least fraction of u_{symbol}² in", f"> {MAJOR}"
    return (
        (f"{fraction} the mean square motion of the lining", min(of_all.values()), limit, listed(of_all, ".2f")),
        (f"{fraction} u_θ² + u_z²", min(of_surface.values()), limit, listed(of_surface, ".3f")),
    )


def lining_motion(curve: Curve, shoe: Any, name: str) -> Floats:
    """Fractions of u_r², u_θ² and u_z² in the mean square motion of the lining, of a coordinate's mode at 1 Ω.

    Over Gauss nodes of the lining; u_r, u_θ and u_z as in equations (8) to (12) of the paper.
    """
    spectrum, k = curve.spectrum, int(np.argmin(np.abs(curve.values - curve.nominal)))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    angle, z = np.meshgrid(nodes * float(shoe.half_angle), nodes * float(shoe.width) / 2, indexing="ij")
    column = int(np.argmin(np.abs(spectrum.eigenvalues[k] - spectrum.of(name)[k])))
    q = dict(zip(COORDINATES, spectrum.right[k, : len(COORDINATES), column], strict=True))
    weight = np.outer(weights, weights)
    squares = np.array([np.sum(weight * np.abs(u) ** 2) for u in shoe.displacement(q, angle, z)])
    return squares / squares.sum()


def falls(curve: Curve, statement: str) -> Statement:
    """All three growth rates fall as the number of the figure rises (in size, for the drum's speed)."""
    order = np.argsort(np.abs(curve.values))
    shown = np.abs(curve.shown)[order]
    rates = {name: curve.rate(name)[order] for name in SQUEALING}
    measure = f"largest rise of one of them, from any of {len(shown)} values to a larger one"
    ends = ", ".join(f"{name} {rate[0]:.1f} to {rate[-1]:.1f}" for name, rate in rates.items())
    where = f"from {shown[0]:.3g} to {shown[-1]:.3g} {curve.axis.unit}: {ends}"
    return says(curve.axis.figure, statement, (measure, max(map(largest_rise, rates.values())), "< 0 1/s", where))


def listed(numbers: Mapping[str, float], form: str, unit: str = "") -> str:
    """Numbers by name, in one format."""
    return ", ".join(f"{name} {number:{form}} {unit}".rstrip() for name, number in numbers.items())


def largest(numbers: Mapping[str, Any]) -> tuple[str, float]:
    """Name and number of the largest."""
    name = max(numbers, key=numbers.__getitem__)
    return name, float(numbers[name])


def largest_rise(y: Floats) -> float:
    """Largest rise of y from one entry to any later one; negative where it falls throughout."""
    return float(np.max(y[1:] - np.minimum.accumulate(y)[:-1]))


def off_line(x: Floats, y: Floats) -> float:
    """Largest distance of y from its least-squares straight line over x."""
    return float(np.abs(y - np.polynomial.Polynomial.fit(x, y, 1)(x)).max())


# --- the study, and its files ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Study:
    """The statements checked, and by figure ("5" to "11") the eigenvalues and transients that they rest on.

    `disturbed` are two transients that start beyond the contact boundary of a brake that is linearly stable, one by
    constant friction and one by damping.
    """

    scene: Scene
    statements: Sequence[Statement]
    friction: FrictionCurve
    curves: Mapping[str, Curve]
    points: Mapping[str, Sequence[Point]]
    disturbed: Sequence[Point]


def study(
    scene: Scene | None = None,
    progress: Callable[[str, float, float | None], None] = silent,
    keep: Callable[[Study], None] = lambda _: None,
) -> Study:
    """Recompute the figures and check the statements; another scene than the paper's is held against the same ones.

    `keep` takes the curves, before the transients are run. Raises RequestError and SceneError for a scene that cannot
    be varied so.
    """
    scene = seo_kang_brake() if scene is None else scene
    check_brake(scene)
    progress("eigenvalues", 0, None)
    curves, friction, shoe = paper_curves(scene), friction_curve(scene), build_model(scene).shoe

    def checked(points: Sequence[Point]) -> Study:
        *of_figures, constant, damped = points
        by_figure = {name: [each for each in of_figures if each.figure == name] for name in curves}
        statements = check_statements(shoe, friction, curves, by_figure, (constant, damped))
        return Study(scene, statements, friction, curves, by_figure, (constant, damped))

    points = [*points_of_figures(scene), *disturbed_points(scene)]
    keep(checked(points))
    return checked(run_points(points, progress))


def summary(of: Study) -> dict[str, Any]:
    """The scene as it was run, the versions, and the statements: what statements.json holds."""
    packages = "drumsqueal", "jax", "jaxlib", "diffrax", "equinox", "numpy", "scipy", "xarray"
    return {
        "scene": of.scene.model_dump(mode="json"),
        "versions": {"python": python_version()} | {name: version(name) for name in packages},
        "statements": [
            {
                "figure": each.figure,
                "statement": each.statement,
                "readings": [reading.row() for reading in each.readings],
                "verdict": each.verdict,
            }
            for each in of.statements
        ],
        "title": of.scene.title,
    }


def statements_table(of: Study) -> str:
    """One row a reading, with the verdict on its statement, as CSV."""
    heads = [
        (each, {"figure": each.figure, "statement": each.statement, "verdict": each.verdict}) for each in of.statements
    ]
    return pd.DataFrame([head | reading.row() for each, head in heads for reading in each.readings]).to_csv(index=False)


def paper_table(of: Study) -> str:
    """The curves and what the transients measured, as CSV."""
    law = of.friction
    rows: list[dict[str, Any]] = [
        {"figure": "4", "source": "friction law", "varied": "drum.speed", "value_SI": speed}
        | {"friction_coefficient": coefficient, "friction_slope_s_per_m": slope}
        for speed, coefficient, slope in zip(law.speed, law.coefficient, law.slope, strict=True)
    ]
    for figure, curve in of.curves.items():
        for name in COORDINATES:
            rows += [
                {"figure": figure, "source": "eigenvalue", "varied": curve.axis.key, "value_SI": value}
                | {"mode": name, "frequency_Hz": frequency, "growth_rate_1_per_s": rate}
                for value, frequency, rate in zip(curve.values, curve.frequency_Hz(name), curve.rate(name), strict=True)
            ]
        for point in of.points[figure]:
            rows += point_rows(point)
    return pd.DataFrame(rows).to_csv(index=False)


def point_rows(point: Point) -> list[dict[str, Any]]:
    """What one transient measured of each mode, and the motion that it grows into."""
    head = {"figure": point.figure, "source": "transient", "varied": point.key, "value_SI": point.value}
    if point.comparison is None:
        return [head | {"note": point.why_not}]
    rows: list[dict[str, Any]] = []
    for mode in point.modes:
        growth = mode.measured_growth
        rate, error = (None, None) if growth is None else (growth.rate_1_per_s, growth.standard_error)
        found = {"mode": mode.label, "frequency_Hz": mode.measured_frequency_Hz, "growth_rate_1_per_s": rate}
        rows.append(head | found | {"standard_error_1_per_s": error, "note": mode.note})
    head["source"], into = "saturated motion", point.saturation
    if into is None or into.main is None:
        linear = point.comparison.edge_reached_s is None
        why = "neither lift-off nor slip reversal" if linear else "too short to identify the steady-state response"
        return [*rows, head | {"note": why}]
    line = {"mode": into.nearest_mode, "frequency_Hz": into.main.frequency_Hz, "note": into.regime.kind}
    return [*rows, head | line | {"amplitude_of": into.main.coordinate, "amplitude_SI": into.main.amplitude}]


COUNTED = {  # one statement, and several
    Verdict.CONFIRMED: ("is confirmed", "are confirmed"),
    Verdict.NOT_CONFIRMED: ("is not confirmed", "are not confirmed"),
    Verdict.DEPENDS: (Verdict.DEPENDS, "depend on a reading that the text does not fix"),
    Verdict.NOT_DECIDED: ("is not decided", "are not decided"),
}


def print_study(console: Console, of: Study, print_table: Callable[[Console, Table], None] = Console.print) -> None:
    """Print every statement with the numbers that decide it, then why those are not confirmed that are not."""
    columns = "fig.", "statement", Column("number", justify="right", no_wrap=True), "holds if", ""
    table = Table(*columns, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.title = "What Seo & Kang (2023) state"
    for each in of.statements:
        short = "depends" if each.verdict is Verdict.DEPENDS else each.verdict
        shown = Text(short, "" if each.verdict is Verdict.CONFIRMED else "bold")
        for k, reading in enumerate(each.readings):
            first = (each.figure, each.statement) if k == 0 else ("", "   or read otherwise")
            value = "-" if reading.value is None else f"{reading.value:.3g}"
            table.add_row(*first, value, reading.condition, shown if k == 0 else "")
    print_table(console, table)
    for verdict in (Verdict.NOT_CONFIRMED, Verdict.DEPENDS, Verdict.NOT_DECIDED):
        chosen = [each for each in of.statements if each.verdict is verdict]
        if chosen:
            console.print(f"{verdict.capitalize()}", style="bold")
        for each in chosen:
            console.print(f"Figure {each.figure}: {each.statement}", style="dim")
            for reading in each.readings:
                console.print(Padding(in_words(reading), (0, 0, 0, 2), style="dim", expand=False))
    counts = {verdict: sum(each.verdict is verdict for each in of.statements) for verdict in Verdict}
    parts = [f"{count} {COUNTED[verdict][count > 1]}" for verdict, count in counts.items() if count]
    told = " and ".join(part for part in (", ".join(parts[:-1]), parts[-1]) if part)
    console.print(f"Of {len(of.statements)} statements {told}.", style="bold")


def in_words(reading: Reading) -> str:
    """A reading with its number, and whether the statement holds in it."""
    unit = " ".join(reading.condition.split()[2:])
    number = "unknown" if reading.value is None else f"{reading.value:.3g} {unit}".rstrip()
    holds = {True: "holds", False: "does not hold", None: "is not decided"}[reading.holds]
    where = f" ({reading.detail})" if reading.detail else ""
    return f"{holds}: {reading.measure}{where} is {number}, limit {reading.condition}"


# --- figures ---------------------------------------------------------------------------------------------------------

# Of Okabe and Ito, which the colour-blind can distinguish.
COLOUR: dict[str, str] = dict(
    zip(COORDINATES, ("#0072B2", "#D55E00", "#B8A500", "#56B4E9", "#E69F00", "#009E73"), strict=True)
)
DARK, SMALL = "#333333", 7.0
STYLE: dict[Any, Any] = {"font.size": 8.0, "legend.fontsize": SMALL, "legend.frameon": False, "lines.linewidth": 0.9}
STYLE |= {"xtick.labelsize": SMALL, "ytick.labelsize": SMALL, "axes.linewidth": 0.6, "axes.formatter.useoffset": False}
STYLE |= {"axes.spines.top": False, "axes.spines.right": False}
MEASURED_AS: dict[str, Any] = {"marker": "D", "fillstyle": "none", "markersize": 5, "linestyle": ""}
GROWN_INTO: dict[str, Any] = {"marker": "x", "markersize": 6, "linestyle": "", "color": DARK}
GROWS: dict[str, Any] = {"marker": "o", "markersize": 5, "fillstyle": "none", "linestyle": "", "markeredgewidth": 0.7}


def new_figure(of: Study, subject: str) -> Figure:
    """An empty figure, headed by the brake and what is shown."""
    figure = Figure((170 / 25.4, 110 / 25.4), dpi=200, layout="constrained")
    figure.suptitle(f"{of.scene.title}: {subject}", fontsize=9, x=0.01, ha="left", parse_math=False, wrap=True)
    return figure


@rc_context(STYLE)
def draw_friction(of: Study) -> Figure:
    """Figure 4: coefficient of friction and its slope over the drum's speed."""
    curve = of.friction
    figure = new_figure(of, "Figure 4, the friction law (an input of the transients, not a result)")
    left, right = figure.subplots(1, 2)
    for axes, values, label, shift in (
        (left, curve.coefficient, "Coefficient of friction μ", 6),
        (right, curve.slope, "Slope dμ/ds at the slip speed RΩ (s/m)", -10),
    ):
        own = curve.own_speed, float(np.interp(curve.own_speed, curve.speed, values))
        axes.plot(curve.speed, values, color=DARK)
        axes.plot(*own, "o", color=COLOUR["Y"], markersize=4)
        note(axes, f"{curve.own_speed:g} rad/s", own, (6, shift))  # clear of the curve
        axes.set(xlabel="Drum speed (rad/s)", ylabel=label, xlim=(0, None))
    left.set_ylim(0, None)
    right.set_ylim(None, max(0.0, float(curve.slope.max())))
    return figure


@rc_context(STYLE)
def draw_stiffness(of: Study, number: str) -> Figure:
    """Figures 5 and 6: frequencies over the contact stiffness, and growth rate against frequency at 100 %."""
    curve, points = of.curves[number], of.points[number]
    of_constant = f", constant friction μ = {CONSTANT_FRICTION:g}" if number == "6" else ""
    figure = new_figure(of, f"Figure {number}, contact stiffness{of_constant}")
    left, right = figure.subplots(1, 2, width_ratios=[1.2, 1])
    for name in COORDINATES:
        frequency = curve.frequency_Hz(name) / 1e3
        left.plot(curve.shown, frequency, color=COLOUR[name])
        growing = np.flatnonzero(curve.rate(name) > 1e-6)[::10]
        left.plot(curve.shown[growing], frequency[growing], **GROWS, color=COLOUR[name])
    mark_frequencies(left, curve, points)
    left.set(xlabel="Contact stiffness (% of the scene's)", ylabel="Frequency (kHz)", ylim=(-0.15, None))
    draw_rates_at_the_end(right, of.curves["5"], curve, points[-1])
    legend(figure, COORDINATES, rings=number == "5", saturated=number == "5")
    return figure


def draw_rates_at_the_end(axes: Axes, falling: Curve, curve: Curve, last: Point) -> None:
    """Growth rate against frequency at 100 %; both figures on the scale of the falling friction."""
    axes.axhline(0, color=DARK, linewidth=0.6)
    for name in SQUEALING:
        place = curve.frequency_Hz(name)[-1] / 1e3, curve.rate(name)[-1]
        axes.vlines(place[0], 0, place[1], color=COLOUR[name], linewidth=1.2)
        axes.plot(*place, "o", color=COLOUR[name], markersize=2)
        label = f"{name} {place[1]:+.1f}" if abs(place[1]) > 1e-6 else f"{name} 0"
        note(axes, label, place, (0, 8), ha="center", color=COLOUR[name])
    for mode in last.modes:
        if mode.measured_growth is not None and mode.measured_frequency_Hz is not None:
            place = mode.measured_frequency_Hz / 1e3, mode.measured_growth.rate_1_per_s
            axes.plot(*place, **MEASURED_AS, color=COLOUR[mode.name])
    decays = ", ".join(f"{name} {curve.rate(name)[-1]:.0f}".replace("-", "−") for name in QUIET)
    axes.text(0.02, 0.02, f"{decays} 1/s: no transient", transform=axes.transAxes, fontsize=SMALL)
    if not last.comparison or last.comparison.edge_reached_s is None:
        axes.text(0.02, 0.9, "no mode grows, so none saturates", transform=axes.transAxes, fontsize=SMALL)
    top = max(1.0, *(float(falling.rate(name)[-1]) for name in SQUEALING))
    high = max(float(curve.frequency_Hz(name)[-1]) for name in SQUEALING) / 1e3
    axes.set(xlabel="Frequency at 100 % (kHz)", ylabel="Growth rate Re λ (1/s)")
    axes.set(xlim=(0, 1.12 * high), ylim=(-0.15 * top, 1.2 * top))


@rc_context(STYLE)
def draw_design(of: Study, number: str) -> Figure:
    """Figures 7 to 11: growth of the modes that squeal over one number, and the motion that it grows into.

    Figure 7 shows the decay of those that do not squeal, too.
    """
    curve, points = of.curves[number], of.points[number]
    figure = new_figure(of, f"Figure {number}, {curve.axis.label.lower()}")
    left, *middle, right = figure.subplots(1, 3 if number == "7" else 2)
    x, unit = np.abs(curve.shown), "% of the scene's" if curve.axis.unit == "%" else curve.axis.unit
    label = f"{curve.axis.label} ({unit})"
    left.axhline(0, color=DARK, linewidth=0.6)
    for name in SQUEALING:
        left.plot(x, curve.rate(name), color=COLOUR[name])
        right.plot(x, curve.frequency_Hz(name) / 1e3, color=COLOUR[name])
    for point in points:
        for mode in point.modes:
            if mode.measured_growth is not None and mode.name in SQUEALING:
                left.plot(
                    place_of(point, curve), mode.measured_growth.rate_1_per_s, **MEASURED_AS, color=COLOUR[mode.name]
                )
    left.set(xlabel=label, ylabel="Growth rate Re λ (1/s)")
    for axes in middle:
        for name in QUIET:
            axes.plot(x, -curve.rate(name), color=COLOUR[name])
        axes.set_title("no transient: all modes out of the plane decay", fontsize=SMALL)
        axes.set(xlabel=label, ylabel="Decay rate −Re λ (1/s)", xscale="log", yscale="log")
    mark_frequencies(right, curve, points)
    right.set(xlabel=label, ylabel="Frequency (kHz)", ylim=(0, None))
    legend(figure, COORDINATES if number == "7" else SQUEALING)
    return figure


def mark_frequencies(axes: Axes, curve: Curve, points: Sequence[Point]) -> None:
    """What transients measured: frequencies of growing modes, and of the motion that they grow into."""
    for point in points:
        x = place_of(point, curve)
        for mode in point.modes:
            if mode.measured_frequency_Hz is not None:
                axes.plot(x, mode.measured_frequency_Hz / 1e3, **MEASURED_AS, color=COLOUR[mode.name])
        if point.saturation is not None and point.saturation.main is not None:
            axes.plot(x, point.saturation.main.frequency_Hz / 1e3, **GROWN_INTO)


def place_of(point: Point, curve: Curve) -> float:
    """Where a transient is on the axis of its figure."""
    return abs(float(curve.axis.shown(point.value, curve.nominal)))


def note(axes: Axes, text: str, place: tuple[float, float], shift: tuple[float, float], **how: Any) -> None:
    """Small words beside a place, shifted by so many points."""
    axes.annotate(text, place, xytext=shift, textcoords="offset points", fontsize=SMALL, **how)


def legend(figure: Figure, names: Sequence[str], *, rings: bool = False, saturated: bool = True) -> None:
    """Modes by colour, then the marks; in two rows at most."""
    handles = [Line2D([], [], color=COLOUR[name], label=name) for name in names]
    if rings:
        handles.append(Line2D([], [], **GROWS, color=DARK, label="grows"))
    handles.append(Line2D([], [], **MEASURED_AS, color=DARK, label="measured in transients"))
    if saturated:
        handles.append(Line2D([], [], **GROWN_INTO, label="strongest line of the motion that it grows into"))
    columns = len(handles) if len(handles) <= 8 else -(-len(handles) // 2)
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.0, handletextpad=0.5)


FIGURES: dict[str, Callable[[Study], Figure]] = {
    "fig04_friction": draw_friction,
    "fig05_stiffness": partial(draw_stiffness, number="5"),
    "fig06_constant_friction": partial(draw_stiffness, number="6"),
    "fig07_speed": partial(draw_design, number="7"),
    "fig08_load": partial(draw_design, number="8"),
    "fig09_arc_angle": partial(draw_design, number="9"),
    "fig10_radius": partial(draw_design, number="10"),
    "fig11_width": partial(draw_design, number="11"),
}
TABLES: dict[str, Callable[[Study], str]] = {"paper.csv": paper_table, "statements.csv": statements_table}


def main(folder: Path) -> None:
    """Run the study, print its statements, and write its files into a folder."""
    console = Console(highlight=False, markup=False)
    folder.mkdir(parents=True, exist_ok=True)

    def write(of: Study) -> None:
        for name, make in TABLES.items():
            (folder / name).write_text(make(of), encoding="utf-8")
        (folder / "statements.json").write_text(json.dumps(summary(of), indent=2), encoding="utf-8")

    with console.status("eigenvalues") as status:  # Ctrl-C keeps the tables of the curves
        found = study(progress=lambda what, *_: status.update(what), keep=write)
    write(found)
    for name, draw in FIGURES.items():
        draw(found).savefig(folder / f"{name}.png")
    print_study(console, found)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/paper"))
