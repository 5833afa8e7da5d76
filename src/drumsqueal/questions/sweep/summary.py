"""What a sweep found: how often each mode squeals and where most, how likely that is, and what decides it."""

import math
from typing import Annotated, Any

import numpy as np
import xarray
from numpy.typing import ArrayLike

from drumsqueal.findings.columns import Column
from drumsqueal.findings.schema import Finding, Findings, Held
from drumsqueal.questions.sweep.basin import Basin, Chance, chance, find_basin
from drumsqueal.questions.sweep.points import COMPUTED, OUTCOMES, TRENDS, modes_in, names_in, squealing, undecided
from drumsqueal.scene.plan import Plan

NOT_SETTLED = "not settled"
FEWEST = 4  # samples for a correlation


class UnstableMode(Finding):
    """At how many points a mode grows, and where most, by the numbers that are swept."""

    unstable_points: Annotated[int, Column("points", "d")]
    largest_growth_rate_1_per_s: Annotated[float, Column("most {unit}", "+.3f", missing="")]
    frequency_there_Hz: Annotated[float, Column("{unit} there", ".2f", unit="Hz", missing="")]
    where: dict[str, float]


class Responses(Finding):
    """How many transients squeal, have not settled after `longest_of_them_s`, or have each trend; largest amplitudes.

    Amplitudes are in the units of the coordinates: m, rad for rotations, m kg^0.5 for free modes.
    """

    points_with_squeal: int
    points_not_settled: int
    longest_of_them_s: float
    trends: dict[str, int]
    largest_amplitude: dict[str, float]


class ChanceStudy(Finding):
    """The probability of squeal, that of each mode, and what the growth rate depends on.

    A mode is one that continues one of the scene itself by its shape, whatever it is called at a sample.
    `correlations` has, for each number, Spearman's rank correlation with the largest growth rate: +1 where this only
    rises with it, −1 where it only falls; None where one of the two never changes. Below `noise` in size, 95 % of the
    correlations of numbers that do not matter lie. `left_out` samples have no eigenvalues; the probabilities are of the
    others.
    """

    squeal: Chance
    modes: dict[str, Chance]
    correlations: dict[str, float | None]
    noise: float
    left_out: int

    @property
    def known_correlations(self) -> dict[str, float]:
        """Those that are known, the largest first."""
        known = {key: value for key, value in self.correlations.items() if value is not None}
        return dict(sorted(known.items(), key=lambda each: -abs(each[1])))


class SweepStudy(Findings):
    """What is swept, in SI, and the units of the results; how many points had each outcome, squeal, or divergence.

    `modes` has those that grow anywhere, `chance` the probabilities of a random sweep, `transients` is None without
    them, and `basin` says where the starts lead, where they are varied. `data` are the results at all points, and
    `plan` is what was swept.
    """

    printed_by = "drumsqueal.questions.sweep.answer.print_study"
    sweep: dict[str, Any]
    units: dict[str, str]
    points: int
    outcomes: dict[str, int]
    points_with_squeal: int
    points_with_divergence: int
    modes: dict[str, UnstableMode]
    chance: ChanceStudy | None
    transients: Responses | None
    basin: Basin | None = None
    data: Any = Held
    plan: Any = Held

    @property
    def of_starts_alone(self) -> bool:
        """Whether one brake starts in many ways."""
        return set(self.plan.keys) == set(self.plan.starts)


def summarise(data: xarray.Dataset, plan: Plan) -> SweepStudy:
    """Summarise the results at all points of a sweep."""
    outcomes = data["outcome"].values
    return SweepStudy(
        scene=plan.scene,
        sweep=plan.describe(),
        units={key: plan.unit(key) for key in plan.keys},
        points=plan.points,
        outcomes={OUTCOMES[code]: int((outcomes == code).sum()) for code in OUTCOMES if np.any(outcomes == code)},
        points_with_squeal=int((data["squeal"].values == 1).sum()),
        points_with_divergence=int((data["divergence_rate"].values > 0).sum()),
        modes=_unstable_modes(data, plan),
        chance=study_chance(data) if plan.draws else None,
        transients=_responses(data) if plan.transient else None,
        basin=find_basin(data, plan) if plan.starts else None,
        data=data,
        plan=plan,
    )


def _unstable_modes(data: xarray.Dataset, plan: Plan) -> dict[str, UnstableMode]:
    unstable = data["unstable"].values == 1
    growth, frequency = data["growth_rate"].values, data["frequency"].values
    modes = {}
    for name, where in modes_in(data).items():
        here = unstable & where
        if not here.any():
            continue
        place = np.unravel_index(np.argmax(np.where(here, growth, -np.inf)), here.shape)
        point = [place[0]] * len(plan.keys) if plan.draws else place[:-1]
        modes[name] = UnstableMode(
            unstable_points=int(here.any(axis=-1).sum()),
            largest_growth_rate_1_per_s=float(growth[place]),
            frequency_there_Hz=float(frequency[place]),
            where={key: float(data[key].values[at]) for key, at in zip(plan.keys, point, strict=True)},
        )
    return modes


def _responses(data: xarray.Dataset) -> Responses:
    trend, unsettled = data["trend"].values, undecided(data)
    counts = {name: int(((trend == code) & ~unsettled).sum()) for code, name in enumerate(TRENDS)}
    counts[NOT_SETTLED] = int(unsettled.sum())
    done = data["outcome"].values == COMPUTED
    largest = np.max(data["amplitude"].values[done], axis=0, initial=0.0)
    return Responses(
        points_with_squeal=int(squealing(data).sum()),
        points_not_settled=counts[NOT_SETTLED],
        longest_of_them_s=float(np.max(data["simulated"].values[unsettled], initial=0.0)),
        trends={name: count for name, count in counts.items() if count},
        largest_amplitude=dict(zip(names_in(data, "main_coordinate"), largest.tolist(), strict=True)),
    )


def study_chance(sweep: xarray.Dataset) -> ChanceStudy | None:
    """Count squeal in the samples of a random sweep; None where none has eigenvalues."""
    known = sweep["squeal"].values >= 0
    total = int(known.sum())
    if total == 0:
        return None
    squeal, growth = sweep["squeal"].values[known], sweep["largest_growth_rate"].values[known]
    unstable = sweep["unstable"].values == 1
    modes = {
        name: chance(int(np.any((unstable & here)[known], axis=1).sum()), total)
        for name, here in modes_in(sweep).items()
    }
    keys = [str(name) for name, each in sweep.coords.items() if each.dims == ("sample",)]
    correlations = {key: rank_correlation(sweep[key].values[known], growth) for key in keys}
    return ChanceStudy(
        squeal=chance(int(squeal.sum()), total),
        modes=modes,
        correlations=correlations,
        noise=min(1.96 / math.sqrt(max(total - 1, 1)), 1.0),  # deviations that enclose it
        left_out=len(known) - total,
    )


def rank_correlation(first: ArrayLike, second: ArrayLike) -> float | None:
    """Spearman's rank correlation of two samples; None where one never changes, or where there are too few."""
    from scipy.stats import spearmanr

    pairs = np.stack([np.asarray(first, float), np.asarray(second, float)])
    pairs = pairs[:, np.isfinite(pairs).all(axis=0)]
    if pairs.shape[1] < FEWEST or np.any(np.ptp(pairs, axis=1) == 0):
        return None
    return float(spearmanr(*pairs).statistic)  # pyright: ignore[reportAttributeAccessIssue]
