"""Where many starts lead: the fraction of the disturbances that squeal, and of those that lead to each attractor."""

import math
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import xarray
from numpy.typing import NDArray

from drumsqueal.findings.columns import Column
from drumsqueal.findings.decay import SAME
from drumsqueal.findings.part import Finding, Held, Number
from drumsqueal.findings.signals.regime import rest_words
from drumsqueal.questions.onset.motions import Leads, how_unlike
from drumsqueal.questions.sweep.points import LEADS, NONE, Points, Starting, names_of, squealing
from drumsqueal.solve.pulling import pulling

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
    numbers = np.where(leads == LEADS.index(Leads.DECAYS), 0, NONE).astype(np.int16)
    squeals = np.flatnonzero(leads == LEADS.index(Leads.SQUEALS))
    firsts: list[int] = []
    for k in squeals[np.argsort(-energy[squeals], kind="stable")]:
        unlike = [how_unlike(energy[[first, k]], frequency[[first, k]]) for first in firsts]
        number = next((number for number, each in enumerate(unlike, 1) if each < 1), 0)
        if not number:
            firsts.append(int(k))
        numbers[k] = number or len(firsts)
    places: list[NDArray[np.float64]] = []
    for k in np.flatnonzero(leads == LEADS.index(Leads.RESTS)) if of_one_brake else ():
        place = _places(data)[k]
        number = next((number for number, each in enumerate(places) if _is_same(place, each)), len(places))
        places += [place] * (number == len(places))
        numbers[k] = len(firsts) + 1 + number
    return numbers


def starts_alone(plan: Points) -> bool:
    """Whether all points are of one brake."""
    return set(plan.keys) == set(plan.starts)


def _places(data: xarray.Dataset) -> NDArray[np.float64]:
    """Where each point rests elsewhere (points, coordinates)."""
    return data["rest"].values.reshape(-1, data["rest"].shape[-1])


def _is_same(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return bool(np.linalg.norm(one - other) <= SAME * np.linalg.norm(one))


def find_basin(data: xarray.Dataset, plan: Starting) -> Basin:
    """Count where the starts of a sweep lead."""
    leads = np.ravel(data["leads_to"].values)
    count = {each: int((leads == code).sum()) for code, each in enumerate(LEADS)}
    others = (Leads.NEUTRAL, Leads.RUNS_AWAY, Leads.RESTS)
    clear = sum(count[each] for each in (Leads.DECAYS, Leads.SQUEALS, *others))
    starts, numbers = plan.values(0, plan.points), np.ravel(data["attractor"].values)
    of = chance if plan.draws else fraction  # the points of a grid are no samples

    def each_of(which: Leads, make: Callable[..., Any]) -> tuple[Any, ...]:
        """What is made of each number that starts lead to; nothing where the brake is varied, too."""
        found = np.unique(numbers[leads == LEADS.index(which)]) if starts_alone(plan) else ()
        members = ((int(number), np.flatnonzero(numbers == number)) for number in found)
        return tuple(make(data, plan, number, mine, of(len(mine), clear)) for number, mine in members)

    return Basin(
        keys=plan.keys,
        coordinate=_main_coordinate(data, plan),
        squeal=of(count[Leads.SQUEALS], clear),
        decay=of(count[Leads.DECAYS], clear),
        attractors=each_of(Leads.SQUEALS, _attractor),
        rests=each_of(Leads.RESTS, _resting_place),
        elsewhere={each.value: count[each] for each in others if count[each]},
        unclear=plan.points - clear,
        starts=starts,
        attractor=numbers,
        notes=_notes(data),
        data=data,
    )


def _notes(data: xarray.Dataset) -> tuple[str, ...]:
    """What limits what was found."""
    smallest = float(data["smallest_force"].min()) if "smallest_force" in data else np.inf
    return tuple(filter(None, [pulling(smallest)]))


def _main_coordinate(data: xarray.Dataset, plan: Starting) -> str:
    main = np.ravel(data["main_coordinate"].values)[np.ravel(squealing(data))]
    return names_of(plan)[int(np.bincount(main[main >= 0], minlength=1).argmax())]


def _attractor(
    data: xarray.Dataset, plan: Starting, number: int, members: NDArray[np.intp], chance_of_it: Chance
) -> BasinAttractor:
    names = names_of(plan)
    amplitude = data["amplitude"].values.reshape(-1, len(names))[members]
    frequency = np.ravel(data["main_frequency"].values)[members]
    return BasinAttractor(
        number=number,
        chance=chance_of_it,
        frequency_Hz=float(np.median(frequency)),
        kinetic_energy_J=float(np.median(np.ravel(data["kinetic_energy"].values)[members])),
        amplitude=dict(zip(names, np.median(amplitude, axis=0).tolist(), strict=True)),
        start=_start(plan, members),
    )


def _resting_place(
    data: xarray.Dataset, plan: Starting, number: int, members: NDArray[np.intp], chance_of_it: Chance
) -> RestingPlace:
    place = dict(zip(names_of(plan), _places(data)[members[0]].tolist(), strict=True))
    return RestingPlace(number=number, chance=chance_of_it, place=place, start=_start(plan, members))


def _start(plan: Starting, members: NDArray[np.intp]) -> dict[str, float]:
    """The first of some starts, by the keys that were varied."""
    first = plan.values(int(members[0]), int(members[0]) + 1)[0]
    return dict(zip(plan.keys, first.tolist(), strict=True))
