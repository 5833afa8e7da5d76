"""Starts of one body, drawn from a box: the points of a basin, as a `Plan` has those of a sweep of scenes."""

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from numpy.typing import NDArray

from drumsqueal.coordinates import unit_of
from drumsqueal.errors import RequestError
from drumsqueal.physics.laws.friction_law import static_coefficient
from drumsqueal.physics.model import Model
from drumsqueal.scene.plan import draw
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
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates of the results."""
        return self.model.names

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
