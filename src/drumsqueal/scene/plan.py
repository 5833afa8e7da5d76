"""Which points a sweep has: every combination of values, or samples of uncertain parameters. Knows no JAX."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import NothingToDoError, RequestError
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.uncertain import PLACES, Distribution, Uniform, describe, reach
from drumsqueal.scene.variation import Variation, unit_of

MOST_POINTS = 10**7
_START = "start."


class Plan(NamedTuple):
    """The points of a sweep of a scene: a grid, or for `draws` above 0 as many samples that depend on the seed alone.

    `variations` has the values of each number of a grid; `distributions` what each is sampled from, independently.
    Points are counted from 0, the last number of a grid running fastest. `transient` asks for the nonlinear motion,
    too. `given` has the ranges as they were written, by their keys: results are listed in their units, the others in
    SI.
    """

    scene: Scene
    variations: tuple[Variation, ...]
    distributions: Mapping[str, Distribution]
    draws: int
    seed: int
    transient: bool
    given: Mapping[str, Variation] = {}

    @property
    def keys(self) -> tuple[str, ...]:
        """Dotted keys of what changes."""
        return tuple(self.distributions) if self.draws else tuple(each.key for each in self.variations)

    @property
    def starts(self) -> tuple[str, ...]:
        """Those that are the start of the transients, not the brake: how large a disturbance is."""
        return tuple(key for key in self.keys if key.startswith(_START))

    @property
    def eigenvalues(self) -> bool:
        """Whether each point has its own."""
        return True

    @property
    def about(self) -> dict[str, str]:
        """What is swept, as text, for the file of the results."""
        return {"title": self.scene.title, "scene": self.scene.to_toml()}

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each number of a grid, or the number of samples."""
        return (self.draws,) if self.draws else tuple(len(each.values) for each in self.variations)

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Names of what the results lie along: the keys of a grid, or "sample"."""
        return ("sample",) if self.draws else self.keys

    @property
    def points(self) -> int:
        """How many there are."""
        return math.prod(self.shape)

    def values(self, first: int, stop: int) -> NDArray[np.float64]:
        """The numbers (SI) at the points from `first` to `stop`, (stop − first, number of keys).

        A sample is a quantile at a probability that the seed and the number of the sample decide, by PCG64.
        """
        if not self.draws:
            places = np.unravel_index(np.arange(first, stop), self.shape)
            return np.stack([np.array(each.values)[at] for each, at in zip(self.variations, places, strict=True)], 1)
        return draw(list(self.distributions.values()), self.seed, first, stop)

    @property
    def ends(self) -> dict[str, tuple[float, float]]:
        """The first and the last value of each number (SI), or how far its samples reach."""
        ends = {each.key: (each.first, each.last) for each in self.variations}
        return ends | {key: reach(each) for key, each in self.distributions.items()}

    def listed(self, key: str, value: float) -> float:
        """A value (SI) of a number, in the unit in which its range was written."""
        return self.given[key].listed(value) if key in self.given else value

    def unit(self, key: str) -> str:
        """That unit, or the SI one; "1" for a plain number."""
        return (self.given[key].shown_unit if key in self.given else unit_of(key, self.scene)) or "1"

    def scene_at(self, values: Sequence[float]) -> Scene:
        """The scene with these numbers; raises SceneError where it does not take them."""
        return self.scene.with_values(dict(zip(self.keys, map(float, values), strict=True)))

    def describe(self) -> dict[str, Any]:
        """What is swept, in SI, as plain data: two plans with the same scene and description have the same points."""
        how: dict[str, Any] = {"transient": self.transient}
        if self.draws:
            drawn = {
                key: describe(each) | {"unit": unit_of(key, self.scene) or "1"}
                for key, each in self.distributions.items()
            }
            return how | {"random": self.draws, "seed": self.seed, "distributions": drawn}
        return how | {"vary": {each.key: [each.first, each.last, len(each.values)] for each in self.variations}}


def draw(distributions: Sequence[Distribution], seed: int, first: int, stop: int) -> NDArray[np.float64]:
    """Samples from number `first` to `stop` of independent distributions (stop − first, number of them), by PCG64."""
    bits = np.random.PCG64(seed).advance(first * len(distributions))
    # Of the 64 bits of a sample, the upper 32 decide its place.
    places = np.asarray(bits.random_raw((stop - first) * len(distributions))) >> np.uint64(32)
    fractions = ((places + 0.5) / PLACES).reshape(stop - first, len(distributions))
    return np.stack([each.quantile(fractions[:, k]) for k, each in enumerate(distributions)], 1)


def grid(scene: Scene, variations: Sequence[Variation], *, transient: bool = False) -> Plan:
    """Every combination of the values. Raises RequestError for none, and for too many points, and SceneError."""
    if not variations:
        raise RequestError("there is nothing to sweep; add --vary drum.speed=1..40x20, or --random 1000")
    given = {each.key: each for each in variations}
    plan = Plan(scene.with_values({"uncertain": None}), tuple(variations), {}, 0, 0, transient, given)
    return _checked(plan, [each.key for each in variations])


def sample(
    scene: Scene, variations: Sequence[Variation], draws: int, *, seed: int = 0, transient: bool = False
) -> Plan:
    """Samples from the scene's table `uncertain` and, uniformly, from the ranges, which go first. Raises as `grid`."""
    uniform = {each.key: Uniform(min(each.values), max(each.values)) for each in variations}
    uncertain = {key: each for key, each in (scene.uncertain or {}).items() if transient or not key.startswith(_START)}
    distributions = {**uncertain, **uniform}
    if not distributions:
        message = "no number here is uncertain; add one to the table [uncertain], or --vary drum.speed=1..40"
        raise NothingToDoError(f"--random {draws}: {message}")
    check_number_of_samples(draws, seed)
    given = {each.key: each for each in variations}
    plan = Plan(scene.with_values({"uncertain": None}), (), distributions, draws, seed, transient, given)
    return _checked(plan, [each.key for each in variations])


def check_number_of_samples(draws: int, seed: int) -> None:
    """Raise RequestError for what is no number of samples, and no seed."""
    if draws < 1:
        raise RequestError(f"--random {draws}: write a number of samples, such as 1000")
    if not 0 <= seed < 2**63:
        raise RequestError(f"--seed {seed}: write a whole number from 0 to 2**63 - 1")


def _checked(plan: Plan, given: list[str]) -> Plan:
    bytes_per_point, more_with_transient = 160, 80  # of the file, about
    twice = [key for key in given if given.count(key) > 1]
    if twice:
        raise RequestError(f"--vary {twice[0]}: this is varied twice; leave one of the two out")
    if plan.starts and not plan.transient:
        raise RequestError(f"--vary {plan.starts[0]}: eigenvalues do not depend on the start; add --transient")
    points = plan.points
    if points > MOST_POINTS:
        size = points * (bytes_per_point + plan.transient * more_with_transient)
        # One processor computes the linear part of some 1e7 points in an hour.
        needs = f"a file of about {_size(size)} and about {_time(points / 10**7)} of computing"
        more = ", transients aside" if plan.transient else ""
        limit = f"take at most {MOST_POINTS:.0e}".replace("e+0", "e")
        raise RequestError(f"{points:.3g} points would need {needs}{more}; {limit} points")
    ends = plan.ends
    tables: dict[str, list[str]] = {}
    for key in plan.keys:
        tables.setdefault(key if key in plan.starts else key.rpartition(".")[0], []).append(key)
    for keys in tables.values():
        # What two numbers of one table must fulfil together, they fulfil everywhere between if they do at every corner.
        # All four of each pair are among these: all numbers at their first values, one at its last, all at their last.
        first, last = ({key: ends[key][side] for key in keys} for side in (0, 1))
        for corner in (first, *({**first, key: last[key]} for key in keys if len(keys) > 1), last):
            if _refusal(plan.scene, corner) is not None:
                raise _comes_to(plan, corner)
    return plan


def _comes_to(plan: Plan, corner: dict[str, float]) -> RequestError:
    """The error of a corner that the scene does not take, by the numbers that it takes to fail."""
    for key in tuple(corner):
        others = {name: value for name, value in corner.items() if name != key}
        corner = others if _refusal(plan.scene, others) is not None else corner
    units = {key: f" {plan.unit(key)}" if plan.unit(key) != "1" else "" for key in corner}
    where = ", ".join(f"{key} = {plan.listed(key, value):.6g}{units[key]}" for key, value in corner.items())
    return RequestError(f"the sweep comes to {where}: {_refusal(plan.scene, corner)}")


def _refusal(scene: Scene, values: Mapping[str, float]) -> str | None:
    """Why a scene does not take some values; None where it does."""
    try:
        scene.with_values(values)
    except SceneError as error:
        return error.reason
    return None


def _size(size: float) -> str:
    unit = next((unit for unit in (10**6, 10**9, 10**12) if size < 1000 * unit), 10**15)
    names = {10**6: "MB", 10**9: "GB", 10**12: "TB", 10**15: "PB"}
    return f"{size / unit:.3g} {names[unit]}"


def _time(hours: float) -> str:
    return f"{hours / 8766:.3g} years" if hours > 8766 else f"{hours:.3g} hours"
