"""What a sweep computes: the variables of sweep.nc, along the numbers of a grid, random samples or starts of a body."""

import hashlib
import itertools
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import StrEnum
from typing import Any, NamedTuple

import jax
import numpy as np
import xarray
from numpy.typing import NDArray

from drumsqueal.coordinates import COORDINATES, is_static, unit_of, units_of
from drumsqueal.dynamics.saturated import Saturated
from drumsqueal.errors import NoSteadySliding, RequestError
from drumsqueal.findings.history import versions
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.physics.composition import coordinates_of
from drumsqueal.physics.friction_law import static_coefficient
from drumsqueal.physics.model import Model
from drumsqueal.questions.sweep.matrix_plan import MatrixPlan
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.plan import Plan, draw
from drumsqueal.scene.uncertain import Uniform, describe
from drumsqueal.scene.variation import Variation

Box = Mapping[str, Mapping[str, tuple[Any, Any]]]
"""Ranges of `displacement` and `velocity` by coordinate: {"velocity": {"X": (-1.0, 1.0)}}."""
TABLES = ("displacement", "velocity")
SUCH_AS = 'write it as {"velocity": {"X": (-1.0, 1.0)}}'


class BodyPlan(NamedTuple):
    """So many starts of a model, drawn uniformly from the ranges of each number, measured from steady sliding.

    Transients have the sample rate (Hz), tolerance and method. Keys are displacement.X, velocity.X and so on.
    """

    model: Model
    distributions: Mapping[str, Uniform]
    draws: int
    seed: int
    sample_rate: float
    tolerance: float
    solver: str
    variations: tuple[Variation, ...] = ()
    given: Mapping[str, Variation] = {}

    eigenvalues = False
    transient = True
    dimensions = ("sample",)

    @property
    def keys(self) -> tuple[str, ...]:
        """What changes."""
        return tuple(self.distributions)

    @property
    def starts(self) -> tuple[str, ...]:
        """Those that are the start of the transients: all."""
        return self.keys

    @property
    def about(self) -> dict[str, str]:
        """The model as text: two with the same numbers and forces have the same one."""
        numbers = b"".join(np.asarray(leaf, dtype=np.float64).tobytes() for leaf in jax.tree.leaves(self.model))
        return {
            "title": "basins of attraction",
            "model": hashlib.sha256(numbers + program_of(self.model).encode()).hexdigest(),
        }

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of starts."""
        return (self.draws,)

    @property
    def points(self) -> int:
        """Number of starts."""
        return self.draws

    def values(self, first: int, stop: int) -> NDArray[np.float64]:
        """The starts (SI) from number `first` to `stop`, (stop − first, number of keys); each depends on the seed."""
        return draw(list(self.distributions.values()), self.seed, first, stop)

    def listed(self, _key: str, value: float) -> float:
        """A value in the unit in which it is listed."""
        return value

    def unit(self, key: str) -> str:
        """The SI unit of a key."""
        table, name = key.split(".")
        return unit_of(name) + ("/s" if table == "velocity" else "")

    def start(self, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Displacement from steady sliding and velocity (n,) at a point."""
        drawn = dict(zip(self.keys, values.tolist(), strict=True))
        displacement, velocity = (
            np.array([drawn.get(f"{table}.{name}", 0.0) for name in self.model.names]) for table in TABLES
        )
        return displacement, velocity

    def describe(self) -> dict[str, Any]:
        """What is drawn, as plain data: two plans with the same model and description have the same points."""
        drawn = {key: describe(each) | {"unit": self.unit(key)} for key, each in self.distributions.items()}
        how = {"sample_rate": self.sample_rate, "tolerance": self.tolerance, "solver": self.solver}
        return how | {"random": self.draws, "seed": self.seed, "distributions": drawn}


def program_of(model: Model) -> str:
    """What a model computes, with all constants, as text: a function has the name of another, but not its program."""

    def seen(q: jax.Array, v: jax.Array) -> Any:
        memory = model.first_memory
        rates, kinks = model.rates(0.0, q, v, memory), model.kinks(0.0, q, v, memory)
        friction = getattr(model.contact, "friction", None)
        return rates, kinks, None if friction is None else static_coefficient(friction.law)

    at = np.zeros(len(model.names))
    return f"{model.names} {jax.jit(seen).lower(at, at).as_text()}"


def read_box(box: Box, read: Callable[[str, Sequence[Any]], tuple[float, float]]) -> dict[str, Uniform]:
    """The ranges of a box by key, velocity.X and so on, whose ends `read` takes for numbers in SI.

    Raises RequestError for what is no box, and where `read` does.
    """
    if not isinstance(box, Mapping):
        raise RequestError(f"box: {SUCH_AS}; got {box!r}")
    for table, ranges in box.items():
        if table not in TABLES:
            raise RequestError(f"box: {table!r} is neither displacement nor velocity")
        if not isinstance(ranges, Mapping):
            raise RequestError(f"box: {table}: say which coordinate has this range; {SUCH_AS}; got {ranges!r}")
    if not any(box.values()):
        raise RequestError(f"box: there are no ranges; {SUCH_AS}")
    found = {}
    for key, ends in ((f"{table}.{name}", ends) for table, ranges in box.items() for name, ends in ranges.items()):
        if isinstance(ends, str) or not isinstance(ends, Sequence) or len(ends) != 2:
            raise RequestError(f"box: {key}: give it two values, such as (-1.0, 1.0); got {ends!r}")
        low, high = read(key, ends)
        if not (math.isfinite(high - low) and low < high):
            raise RequestError(f"box: {key}: the first value must be below the second, got {low:g} and {high:g}")
        found[key] = Uniform(low, high)
    return found


def in_si(names: Sequence[str]) -> Callable[[str, Sequence[Any]], tuple[float, float]]:
    """How the ends of a range are read for a body with these coordinates, of which nothing is known but SI."""

    def read(key: str, ends: Sequence[Any]) -> tuple[float, float]:
        if key.split(".", 1)[1] not in names:
            raise RequestError(f"box: {key}: this body has the coordinates {', '.join(names)}")
        try:
            low, high = map(float, ends)
        except (TypeError, ValueError):
            raise RequestError(f"box: {key}: its two values must be numbers in SI; got {ends!r}") from None
        return low, high

    return read


# Outcome of a point: why its numbers are NaN.
COMPUTED, NOT_YET, AT_REST, NOT_FOUND, NOT_FINITE, NOT_TAKEN, FOLDED, FAILED, NOT_SETTLED, STILL_FALLS, LOCKED = range(
    11
)
OUTCOMES = {
    COMPUTED: "computed",
    NOT_YET: "not computed yet",
    AT_REST: "no steady sliding: the drum is at rest",
    NOT_FOUND: "no self-consistent steady sliding was found",
    NOT_FINITE: "the linear model is not finite",
    NOT_TAKEN: "the scene does not take these values",
    FOLDED: "no transient: the sample rate is below twice the highest frequency",
    FAILED: "no transient: its integration failed",
    NOT_SETTLED: "it is not clear where a disturbance leads",
    STILL_FALLS: "a disturbance still falls when the procedure ends",
    LOCKED: "no steady sliding: friction exceeds the limit of self-locking, see drumsqueal stability",
}
NOWHERE = {
    NoSteadySliding.AT_REST: AT_REST,
    NoSteadySliding.BELT_AT_REST: AT_REST,
    NoSteadySliding.SELF_LOCKING: LOCKED,
    NoSteadySliding.NOT_FOUND: NOT_FOUND,
    NoSteadySliding.PULLED_OFF: NOT_FOUND,
    NoSteadySliding.NOT_HELD: NOT_FOUND,
    NoSteadySliding.NOT_FINITE: NOT_FINITE,
}
TRENDS = (Kind.GROWS, Kind.DECAYS, Kind.SETTLED, Kind.AT_REST, Kind.FAILED, Kind.RESTS)
NONE = -1  # of a coordinate or a trend: there is none
Starting = Plan | BodyPlan
Points = Starting | MatrixPlan
"""What is computed at which points."""
LEADS = (Kind.DECAYS, Kind.SQUEALS, Kind.GROWS, Kind.NEUTRAL, Kind.RUNS_AWAY, Kind.UNDECIDED, Kind.FAILED, Kind.RESTS)


class CellVerdict(StrEnum):
    """What is known of a cell, in the order of the numbers in matrix.nc: the last one is −1."""

    QUIET = "quiet"
    SQUEALS = "squeals"
    NOT_CLEAR = "not clear"
    UNDECIDED = "undecided at its end"
    NOT_COMPUTED = "not computed"


CELL_VERDICTS = tuple(CellVerdict)


class Variable(NamedTuple):
    """A variable of the file: its dimensions in addition to those of the points, its type, units, meaning, flags."""

    dimensions: tuple[str, ...]
    kind: str
    units: str
    meaning: str
    flags: tuple[tuple[int, str], ...] = ()

    @property
    def fill(self) -> float:
        """What stands there before anything is computed."""
        return np.nan if self.kind == "f8" else NOT_YET if self.flags == tuple(OUTCOMES.items()) else NONE

    def attributes(self) -> dict[str, Any]:
        """Units and meaning, by the CF conventions."""
        found: dict[str, Any] = {"units": self.units, "long_name": self.meaning}
        if self.flags:
            found["flag_values"] = np.array([value for value, _ in self.flags], self.kind)
            found["flag_meanings"] = " ".join(meaning.replace(":", "").replace(" ", "_") for _, meaning in self.flags)
        return found


_NAMES = ((NONE, "none"),)  # and those of the coordinates, of which a whole brake may have more than 127
OUTCOME = "outcome"
ALWAYS = {
    OUTCOME: Variable((), "i1", "1", "what became of the point, and why its numbers are NaN", tuple(OUTCOMES.items())),
}
LINEAR = {
    "growth_rate": Variable(("mode",), "f8", "1/s", "real part of the eigenvalue of each oscillating mode"),
    "frequency": Variable(("mode",), "f8", "Hz", "imaginary part of the eigenvalue over 2 pi"),
    "unstable": Variable(("mode",), "i1", "1", "1 where the mode grows, 0 where not, -1 where there is no such mode"),
    "mode_coordinate": Variable(("mode",), "i2", "1", "the mode's largest coordinate, weighted by mass", _NAMES),
    "mode_number": Variable(
        ("mode",),
        "i2",
        "1",
        "which mode of the scene itself it continues by its shape, from 0 by rising frequency, or -1",
    ),
    "mode_in_plane": Variable(("mode",), "i1", "1", "1 where the mode moves in the plane alone, 0 out of it, or -1"),
    "largest_growth_rate": Variable((), "f8", "1/s", "the largest growth rate of any mode; NaN where none oscillates"),
    "squeal": Variable((), "i1", "1", "1 where any mode grows, 0 where none does, -1 where it is not known"),
    "divergence_rate": Variable((), "f8", "1/s", "largest real eigenvalue that grows, 0 where there is none"),
    "contact_fraction": Variable((), "f8", "1", "fraction of the lining that touches the drum in steady sliding"),
    "smallest_pressure": Variable((), "f8", "Pa", "smallest steady contact pressure"),
    "largest_pressure": Variable((), "f8", "Pa", "largest steady contact pressure"),
}
_KINDS = ((NONE, "none"), *enumerate(TRENDS))
TRANSIENT = {
    "amplitude": Variable(
        ("coordinate",),
        "f8",
        "",  # those of the coordinates
        "half the peak-to-peak value in the last half of the scene's duration that was integrated last",
    ),
    "main_frequency": Variable(
        (), "f8", "Hz", "of the line with most kinetic energy there, decaying or not; NaN: none"
    ),
    "main_coordinate": Variable((), "i2", "1", "the coordinate that has this line", _NAMES),
    "settled": Variable(
        (), "i1", "1", "1 where it is clear where the motion leads, 0 where not yet, -1 where there is no transient"
    ),
    "simulated": Variable((), "f8", "s", "how long the transient was integrated"),
    "trend": Variable((), "i1", "1", "what the motion does there", _KINDS),
    "separation_ratio": Variable((), "f8", "1", "largest motion over the one at which the lining begins to lift off"),
    "reversal_ratio": Variable((), "f8", "1", "largest motion over the one at which slip begins to reverse"),
    "kinetic_energy": Variable((), "f8", "J", "mean kinetic energy there"),
    "rest": Variable(("coordinate",), "f8", "", "from steady sliding to where it rests elsewhere; NaN: it does not"),
}
STARTS = {
    "leads_to": Variable((), "i1", "1", "where the start leads", ((NONE, "none"), *enumerate(LEADS))),
    "attractor": Variable(
        (), "i2", "1", "0: steady sliding; 1 and so on: squeal, by falling energy, then rests; -1: none"
    ),
}
CELLS = {
    "squeal": Variable(
        (),
        "i1",
        "1",
        "of a noise matrix: 0 quiet, 1 squeals, 2 not clear, 3 undecided at its end",
        ((NONE, "none"), *enumerate(CELL_VERDICTS[:NONE])),
    ),
    "unstable": Variable((), "i1", "1", "1 where a mode grows at the start of the procedure"),
    "growth_rate": Variable((), "f8", "1/s", "the largest growth rate there"),
    "velocity": Variable(
        (), "f8", "m/s", "rms velocity of the shoe in the squeal after a small disturbance, or else in the loudest"
    ),
    "frequency": Variable((), "f8", "Hz", "of its line with most kinetic energy"),
    "time": Variable((), "f8", "s", "middle of the 50 ms in which a procedure is loudest"),
    "speed": Variable((), "f8", "rad/s", "drum speed then"),
    "after": Variable((), "i1", "1", "0: after the smallest disturbance, 1: after a large one only"),
    "along": Variable((), "i2", "1", "the mode along which the large disturbance was", _NAMES),
    "small_velocity": Variable((), "f8", "m/s", "rms velocity of the squeal after a small disturbance"),
    "small_frequency": Variable((), "f8", "Hz", "of its line with most kinetic energy"),
}
FORCE = {"smallest_force": Variable((), "f8", "N", "smallest normal force of a block that cannot lift off; else inf")}
Columns = dict[str, np.ndarray]


def names_of(plan: Points) -> tuple[str, ...]:
    """Names of the coordinates of the results: those of the scene that has most of them at either end of each number.

    A body that bends may have more modes between the ends; these are left out, and so are its other shapes, which are
    others at each point. Of a noise matrix those of all its scenes, and of each shoe alone, which a cell may be.
    """
    if isinstance(plan, BodyPlan):
        return plan.model.names
    if isinstance(plan, MatrixPlan):
        scenes = (each for scene in plan.scenes for each in (scene, *scene.alone))
        return tuple(dict.fromkeys(name for each in scenes for name in coordinates_of(each)))
    if coordinates_of(plan.scene) == COORDINATES:  # rigid, whatever its numbers
        return COORDINATES
    ends = {key: each for key, each in plan.ends.items() if key.startswith(("shoe.", "drum.elastic.", "drum.mesh."))}
    corners = (dict(zip(ends, values, strict=True)) for values in itertools.product(*ends.values()))
    return max((_coordinates_at(plan.scene, each) for each in ({}, *corners)), key=len)


def _coordinates_at(scene: Scene, values: Mapping[str, float]) -> tuple[str, ...]:
    """Names of the coordinates there; none where the scene cannot be had, as far out in a distribution."""
    try:
        return tuple(name for name in coordinates_of(scene.with_values(values)) if not is_static(name))
    except (SceneError, RequestError, ArithmeticError):
        return ()


def names_in(sweep: xarray.Dataset, which: str = "mode_coordinate") -> tuple[str, ...]:
    """Names of the coordinates that a variable of results counts."""
    return tuple(sweep[which].attrs["flag_meanings"].split()[1:])


def modes_in(sweep: xarray.Dataset) -> dict[str, NDArray[np.bool_]]:
    """Where each mode is (points, mode), by its label: the coordinate that it mostly has, and "X (2)" for another.

    Modes are what continues one of the scene itself; what continues none goes by its coordinate.
    """
    number, coordinate = sweep["mode_number"].values, sweep["mode_coordinate"].values
    alone = (number < 0) & (coordinate >= 0)
    places = [number == k for k in np.unique(number[number >= 0])]
    places += [alone & (coordinate == k) for k in np.unique(coordinate[alone])]
    mostly = [int(np.bincount(coordinate[here]).argmax()) for here in places]
    found: dict[str, NDArray[np.bool_]] = {}
    for k in sorted(range(len(places)), key=mostly.__getitem__):
        name, before = names_in(sweep)[mostly[k]], mostly[:k].count(mostly[k])
        found[f"{name} ({before + 1})" if before else name] = places[k]
    return found


def variables_of(plan: Points) -> dict[str, Variable]:
    """The variables of a sweep, by name."""
    names = names_of(plan)
    if isinstance(plan, MatrixPlan):
        found = ALWAYS | CELLS
    else:
        found = ALWAYS | (LINEAR if plan.eigenvalues else {}) | (TRANSIENT if plan.transient else {})
        found |= STARTS if plan.starts else {}
        found |= FORCE if isinstance(plan, BodyPlan) else {}
    flags = (*_NAMES, *enumerate(names))
    found = {name: each._replace(flags=flags) if each.flags == _NAMES else each for name, each in found.items()}
    moved = {name: found[name]._replace(units=units_of(names)) for name in ("amplitude", "rest") if name in found}
    return found | moved


def blank(plan: Points, points: int) -> Columns:
    """Every variable of so many points, nothing computed."""
    most = len(names_of(plan))  # a mode a coordinate, at most
    return {
        name: np.full((points, *(most for _ in each.dimensions)), each.fill, each.kind)
        for name, each in variables_of(plan).items()
    }


def axes(plan: Points) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, Any]]]:
    """What does not depend on the results: values of a grid or of the samples, names of modes and coordinates."""
    if isinstance(plan, MatrixPlan):
        return {}
    columns: dict[str, tuple[str, Iterable[float]]] = {each.key: (each.key, each.values) for each in plan.variations}
    if plan.draws:
        columns = {key: ("sample", drawn) for key, drawn in zip(plan.keys, plan.values(0, plan.draws).T, strict=True)}
    found: dict[str, Any] = {}
    for key, (dimension, values) in columns.items():
        listed = np.array([plan.listed(key, float(value)) for value in values])
        found[key] = ((dimension,), listed, {"units": plan.unit(key), "long_name": key})
    if plan.eigenvalues:
        ranks = {"long_name": "modes of a point by rising frequency; mode_coordinate names them"}
        found["mode"] = (("mode",), np.arange(len(names_of(plan)), dtype="i2"), ranks)
    if plan.transient:
        found["coordinate"] = (("coordinate",), np.array(names_of(plan), dtype=object), {})
    return found


def attributes(plan: Points) -> dict[str, str]:
    """The scene, what is swept, and the versions, as text."""
    return plan.about | {
        "sweep": json.dumps(plan.describe()),
        "versions": json.dumps(versions()),
    }


def to_dataset(plan: Points, columns: Columns, outcome: str) -> xarray.Dataset:
    """Put the results of all points into one Dataset."""
    data = {}
    for name, each in variables_of(plan).items():
        values = columns[name].reshape(*plan.shape, *columns[name].shape[1:])
        data[name] = ((*plan.dimensions, *each.dimensions), values, each.attributes())
    return xarray.Dataset(data, axes(plan), attributes(plan) | {"outcome": outcome})


def squealing(sweep: xarray.Dataset) -> NDArray[np.bool_]:
    """At which points the steady-state response of the transient is squeal.

    The motion has settled and is sustained. What changes by less than a tenth below the contact boundary, where all
    modes decay, decays slowly. Where starts are varied it is known where each leads.
    """
    if "leads_to" in sweep:
        return sweep["leads_to"].values == LEADS.index(Kind.SQUEALS)
    below = np.maximum(sweep["separation_ratio"].values, sweep["reversal_ratio"].values) < Criteria.beyond
    sustained = (sweep["trend"].values == TRENDS.index(Kind.SETTLED)) & (sweep["settled"].values == 1)
    return sustained & ~(below & (sweep["squeal"].values == 0))


def undecided(sweep: xarray.Dataset) -> NDArray[np.bool_]:
    """At which points the motion has not settled: it may go on as it is, grow or decay."""
    return sweep["settled"].values == 0


def note_motion(
    columns: Columns, k: int, motion: Saturated, coordinates: Sequence[str], names: Sequence[str], *, settled: bool
) -> None:
    """Put down how a transient over the coordinates with these names ended, and whether it is clear where it leads."""
    columns["trend"][k] = TRENDS.index(motion.trend)
    if motion.failed:
        columns["outcome"][k] = FAILED
        return
    columns["settled"][k] = settled
    known = [name in coordinates for name in names]
    places = [coordinates.index(name) for name in names if name in coordinates]
    columns["amplitude"][k] = 0.0  # of coordinates that the transient leaves out
    columns["amplitude"][k, places] = np.asarray(motion.amplitude)[known]
    if motion.rest.elsewhere is not None:
        columns["rest"][k] = 0.0
        columns["rest"][k, places] = np.asarray(motion.rest.elsewhere)[known]
    columns["kinetic_energy"][k] = motion.kinetic_energy
    if "smallest_force" in columns:
        columns["smallest_force"][k] = motion.smallest_force
    columns["separation_ratio"][k], columns["reversal_ratio"][k] = motion.boundary_ratios
    if motion.frequency_Hz is not None and motion.line is not None:
        columns["main_frequency"][k] = motion.frequency_Hz
        columns["main_coordinate"][k] = coordinates.index(motion.line) if motion.line in coordinates else NONE
