"""What a sweep found: how often each mode squeals and where most, how likely that is and what decides it, and where
starts lead: the fraction of the disturbances that squeal, and of those that lead to each attractor."""

import math
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
import xarray
from numpy.typing import ArrayLike, NDArray

from drumsqueal.dynamics.attractor import how_unlike
from drumsqueal.findings.columns import Column
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.schema import Finding, Findings, Held, Number
from drumsqueal.findings.signals.regime import rest_words
from drumsqueal.questions.sweep.points import (
    COMPUTED,
    LEADS,
    NONE,
    OUTCOMES,
    TRENDS,
    Points,
    Starting,
    modes_in,
    names_in,
    names_of,
    squealing,
    undecided,
)
from drumsqueal.scene.plan import Plan
from drumsqueal.solve.motion import pulling

NOT_SETTLED = "not settled"

# How likely something is of which samples are known: a fraction, and the interval that holds the probability.


class Chance(Finding):
    """So many of all samples: their fraction, and Wilson's interval of 95 % for the probability.

    (p + z²/2n ± z √(p(1 − p)/n + z²/4n²))/(1 + z²/n), z = 1.96; NaN for what is no sample.
    Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """

    count: int
    total: int
    share: Annotated[Number, Column("probability", ".2f", unit="%", factor=100, in_cells=True)]
    low: Annotated[Number, Column("95 % from", ".2f", unit="%", factor=100, in_cells=True)]
    high: Annotated[Number, Column("to", ".2f", unit="%", factor=100, in_cells=True)]

    @property
    def percent(self) -> str:
        """The fraction in words."""
        return "none known" if not self.total else f"{100 * self.share:.3g} %"

    @property
    def in_words(self) -> str:
        """The fraction and its interval."""
        return self.percent if math.isnan(self.low) else f"{self.percent} ({self.interval} at 95 %)"

    @property
    def interval(self) -> str:
        """The interval in words."""
        return f"{100 * self.low:.3g} to {100 * self.high:.3g} %"


def chance(count: int, total: int) -> Chance:
    """The probability of what happened so many times; NaN without samples."""
    if total == 0:
        return fraction(count, total)
    from scipy.stats import binomtest

    interval = binomtest(count, total).proportion_ci(0.95, "wilson")  # confidence
    low, high = float(interval.low), float(interval.high)
    return Chance(count=count, total=total, share=count / total, low=low, high=high)


def fraction(count: int, total: int) -> Chance:
    """The fraction of points that are no random samples: without an interval."""
    share = count / total if total else math.nan
    return Chance(count=count, total=total, share=share, low=math.nan, high=math.nan)


class BasinAttractor(Finding):
    """A squeal that disturbances lead to, and the chance of it.

    Frequency (Hz), mean kinetic energy (J) and amplitude, half the peak-to-peak value of each coordinate (m, rad), are
    medians over the starts that lead there; `start` is the first of these, by the keys that were varied.
    """

    number: int
    chance: Chance
    frequency_Hz: Number
    kinetic_energy_J: float
    amplitude: dict[str, float]
    start: dict[str, float]


class RestingPlace(Finding):
    """An equilibrium elsewhere than at steady sliding, in which starts come to rest, and the chance of it.

    `place` is its displacement from steady sliding (m, rad); `start` is the first that leads there.
    """

    number: int
    chance: Chance
    place: dict[str, float]
    start: dict[str, float]


class Basin(Finding):
    """Where starts lead: the chance of squeal and of decay to steady sliding, and each squeal by falling energy.

    The chances are of the starts of which it is clear where they lead; `unclear` counts the others, `elsewhere` those
    that lead to neither. `rests` are the equilibria in which starts come to rest elsewhere. Motions whose kinetic
    energies differ by less than a factor of 1.6 and whose frequencies by less than 5 % are one attractor; there are
    none of either where the brake is varied, too. `starts` (N, keys) are in SI, in the order of `keys`, and `attractor`
    (N,) has the number of the squeal that each leads to, or after these of the place where it rests, 0 for steady
    sliding, −1 for none of them. `coordinate` is the one that has most kinetic energy in most of the squeals, `notes`
    say what limits all this, and `data` are all results.
    """

    keys: tuple[str, ...]
    coordinate: str
    squeal: Chance
    decay: Chance
    attractors: tuple[BasinAttractor, ...]
    rests: tuple[RestingPlace, ...] = ()
    elsewhere: dict[str, int]
    unclear: int
    starts: Any = Held
    attractor: Any = Held
    notes: tuple[str, ...] = ()
    data: Any = Held

    def __repr__(self) -> str:
        """One line."""
        motions = ", ".join(f"{each.frequency_Hz:.4g} Hz {each.chance.percent}" for each in self.attractors)
        if not self.squeal.total:
            return f"Basin: {self.clear_of_none}"
        unclear = "".join(f", {each.chance.percent} rest {rest_words(each.place)}" for each in self.rests)
        unclear += f", {self.unclear} unclear" if self.unclear else ""
        notes = "".join(f"; {each}" for each in self.notes)
        return (
            f"Basin of {self.squeal.total} starts: {self.squeal.in_words} squeal ({motions or 'none'}){unclear}{notes}"
        )

    @property
    def clear_of_none(self) -> str:
        """That no start says anything."""
        return f"of none of the {self.unclear} starts it is clear where it leads, so that no fraction is known"


def number_motions(data: xarray.Dataset, *, of_one_brake: bool = True) -> NDArray[np.int16]:
    """The number of the squeal that each point leads to: 1 has most kinetic energy; 0 decays, −1 leads elsewhere.

    From the largest energy down each motion belongs to the first one that it is like. The places where points rest
    elsewhere are counted on from there, in the order of the points; of many brakes each has its own, which are none.
    """
    leads = np.ravel(data["leads_to"].values)
    energy, frequency = (np.ravel(data[name].values) for name in ("kinetic_energy", "main_frequency"))
    numbers = np.where(leads == LEADS.index(Kind.DECAYS), 0, NONE).astype(np.int16)
    squeals = np.flatnonzero(leads == LEADS.index(Kind.SQUEALS))
    firsts: list[int] = []
    for k in squeals[np.argsort(-energy[squeals], kind="stable")]:
        unlike = [how_unlike(energy[[first, k]], frequency[[first, k]]) for first in firsts]
        number = next((number for number, each in enumerate(unlike, 1) if each < 1), 0)
        if not number:
            firsts.append(int(k))
        numbers[k] = number or len(firsts)
    places: list[NDArray[np.float64]] = []
    for k in np.flatnonzero(leads == LEADS.index(Kind.RESTS)) if of_one_brake else ():
        place = _over_points(data["rest"])[k]
        apart, size = (np.linalg.norm(place - each) for each in places), Criteria.same_place * np.linalg.norm(place)
        number = next((number for number, each in enumerate(apart) if each <= size), len(places))
        places += [place] * (number == len(places))
        numbers[k] = len(firsts) + 1 + number
    return numbers


def starts_alone(plan: Points) -> bool:
    """Whether all points are of one brake."""
    return set(plan.keys) == set(plan.starts)


def _over_points(sizes: xarray.DataArray) -> NDArray[np.float64]:
    """A variable of the coordinates at each point (points, coordinates)."""
    return sizes.values.reshape(-1, sizes.shape[-1])


def find_basin(data: xarray.Dataset, plan: Starting) -> Basin:
    """Count where the starts of a sweep lead."""
    leads = np.ravel(data["leads_to"].values)
    count = {each: int((leads == code).sum()) for code, each in enumerate(LEADS)}
    others = (Kind.NEUTRAL, Kind.RUNS_AWAY, Kind.RESTS)
    clear = sum(number for each, number in count.items() if each.clear or each in others)
    starts, names = plan.values(0, plan.points), names_of(plan)
    numbers, main, frequency, energy = (
        np.ravel(data[name].values) for name in ("attractor", "main_coordinate", "main_frequency", "kinetic_energy")
    )
    of = chance if plan.draws else fraction  # the points of a grid are no samples

    def each_of(which: Kind) -> Iterator[tuple[NDArray[np.intp], dict[str, Any]]]:
        """The starts that lead to each number, and its chance; nothing where the brake is varied, too."""
        for number in np.unique(numbers[leads == LEADS.index(which)]) if starts_alone(plan) else ():
            mine = np.flatnonzero(numbers == number)
            first = dict(zip(plan.keys, starts[mine[0]].tolist(), strict=True))
            yield mine, {"number": int(number), "chance": of(len(mine), clear), "start": first}

    def by_name(values: NDArray[np.float64]) -> dict[str, float]:
        return dict(zip(names, values.tolist(), strict=True))

    attractors = tuple(
        BasinAttractor(
            frequency_Hz=float(np.median(frequency[mine])),
            kinetic_energy_J=float(np.median(energy[mine])),
            amplitude=by_name(np.median(_over_points(data["amplitude"])[mine], axis=0)),
            **found,
        )
        for mine, found in each_of(Kind.SQUEALS)
    )
    rests = (
        RestingPlace(place=by_name(_over_points(data["rest"])[mine[0]]), **found) for mine, found in each_of(Kind.RESTS)
    )
    main = main[np.ravel(squealing(data)) & (main >= 0)]
    smallest = float(data["smallest_force"].min()) if "smallest_force" in data else np.inf
    return Basin(
        keys=plan.keys,
        coordinate=names[int(np.bincount(main, minlength=1).argmax())],
        squeal=of(count[Kind.SQUEALS], clear),
        decay=of(count[Kind.DECAYS], clear),
        attractors=attractors,
        rests=tuple(rests),
        elsewhere={each.value: count[each] for each in others if count[each]},
        unclear=plan.points - clear,
        starts=starts,
        attractor=numbers,
        notes=tuple(filter(None, [pulling(smallest)])),
        data=data,
    )


# Of all points.


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
    counts = {str(name): int(((trend == code) & ~unsettled).sum()) for code, name in enumerate(TRENDS)}
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
    if pairs.shape[1] < 4 or np.any(np.ptp(pairs, axis=1) == 0):
        return None
    return float(spearmanr(*pairs).statistic)  # pyright: ignore[reportAttributeAccessIssue]
