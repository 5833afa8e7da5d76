"""Disturbances, where they lead, and which of the motions after them are one attractor."""

import math
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drumsqueal.dynamics.saturated import Saturated
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.schema import Finding, Held, Number
from drumsqueal.findings.vibration import amplitudes_apart

SMALL_START = "small"  # the name of the small perturbation


class VelocityPerturbation(Finding):
    """A disturbance that was tried: a velocity from steady sliding (m/s, rad/s) along `mode` (its label), either way.

    With it the fastest point of the lining's surface moves at `speed_m_per_s` and the shoe has the kinetic energy
    `energy_J`. Free vibration from it would come to `boundary_ratio` times the nearer contact boundary, lift-off or
    slip reversal, by the linear model.
    """

    mode: str
    forwards: bool
    velocity: dict[str, float]
    speed_m_per_s: float
    energy_J: float
    boundary_ratio: float


class SteadyResponse(Finding):
    """A steady-state response, by the last part of a transient: half its peak-to-peak values and rms (m, rad).

    `frequency_Hz` is that of the line with most kinetic energy, of the coordinate `line_of`. Of the motions at which
    contact is lost and slip reversed it has these fractions. `drift` is the relative change of the rms velocity at its
    end, `fluctuation` by how much the rms of a coordinate comes and goes. `state` (2, n) is vibration and velocity at
    its end.
    """

    start: str
    amplitude: dict[str, float]
    rms: dict[str, float]
    frequency_Hz: float | None
    line_of: str | None
    kinetic_energy_J: float
    share_of_contact_loss: Number
    share_of_slip_reversal: Number
    drift: Number
    fluctuation: float = 0.0
    state: Any = Held

    @classmethod
    def after(cls, start: str, ended: Saturated, names: Sequence[str]) -> "SteadyResponse":
        """That of a transient over the named coordinates."""
        amplitude, rms = (dict(zip(names, each.tolist(), strict=True)) for each in (ended.amplitude, ended.rms))
        return SteadyResponse(
            start=start,
            amplitude=amplitude,
            rms=rms,
            frequency_Hz=ended.frequency_Hz,
            line_of=ended.line,
            kinetic_energy_J=ended.kinetic_energy,
            share_of_contact_loss=ended.boundary_ratios[0],
            share_of_slip_reversal=ended.boundary_ratios[1],
            drift=ended.drift,
            fluctuation=ended.fluctuation,
            state=np.array([ended.vibration, ended.velocity]),
        )

    def same(self, other: "SteadyResponse") -> bool:
        """Whether two motions at one value are one attractor, as far as they fluctuate."""
        fluctuation = Criteria.fluctuations * max(self.fluctuation, other.fluctuation)
        fluctuation = min(fluctuation, Criteria.most_fluctuation)
        if amplitudes_apart(self.rms, other.rms) > max(Criteria.same_rms, fluctuation):
            return False
        if self.frequency_Hz is None or other.frequency_Hz is None or fluctuation > Criteria.same_rms:
            return True  # of an irregular motion now one line is the strongest, now another
        return bool(abs(np.log(self.frequency_Hz / other.frequency_Hz)) < Criteria.same_frequency)

    def comes_to(self, known: Sequence["SteadyResponse"]) -> bool:
        """Whether it is one that is known, no less steady than that, and comes no farther from it."""
        for each in known:
            if not self.same(each):
                continue
            ahead = np.log(each.kinetic_energy_J / self.kinetic_energy_J) / 2
            nearer = ahead * self.drift > 0 or abs(ahead) < max(Criteria.close, each.fluctuation)
            unsteady = max(abs(self.drift), self.fluctuation)
            if nearer and unsteady < max(Criteria.steady_drift, Criteria.faster * each.fluctuation):
                return True
        return False

    def like(self, other: "SteadyResponse") -> bool:
        """Whether two motions, at one value or at neighbouring ones, are alike in size and frequency."""
        return self.apart(other) < 1

    def apart(self, other: "SteadyResponse") -> float:
        """How much less alike in size and frequency they are, over what counts as alike."""
        frequencies = (self.frequency_Hz or math.nan, other.frequency_Hz or math.nan)
        return how_unlike((self.kinetic_energy_J, other.kinetic_energy_J), frequencies)


def how_unlike(
    energies: Sequence[float] | NDArray[np.float64], frequencies: Sequence[float] | NDArray[np.float64]
) -> float:
    """How far two motions are apart in kinetic energy and frequency (NaN: none), over what counts as alike."""
    sizes = [math.log(max(each, np.finfo(np.float64).tiny)) for each in energies]
    apart = abs(sizes[0] - sizes[1]) / Criteria.alike_energy
    if any(map(math.isnan, frequencies)):
        return apart
    return max(apart, abs(math.log(frequencies[0] / frequencies[1])) / Criteria.alike_frequency)


class Response(Finding):
    """Where a start led at a value, after how long (s), and the motion that it squeals with or where it rests.

    `disturbance` says which one along a mode it was, or `from_value` the value at which the motion was known from which
    it goes on; None for others. `rests_at` is the displacement (m, rad) from steady sliding of another equilibrium.
    `saturated` is how the transient ended.
    """

    start: str
    leads_to: Kind
    simulated_s: float
    outcome: str
    disturbance: VelocityPerturbation | None = None
    from_value: float | None = None
    motion: SteadyResponse | None = None
    rests_at: dict[str, float] = Field(default_factory=dict)
    value: float = Field(default=np.nan, exclude=True)
    saturated: Any = Held

    @classmethod
    def of(
        cls,
        value: float,
        start: str,
        leads_to: Kind,
        ended: Saturated,
        seconds: float,
        names: Sequence[str],
        **more: Any,
    ) -> Self:
        """That of a transient over the named coordinates."""
        place = ended.rest.elsewhere if leads_to is Kind.RESTS else None
        return cls(
            start=start,
            leads_to=leads_to,
            simulated_s=seconds,
            outcome=ended.outcome,
            motion=SteadyResponse.after(start, ended, names) if leads_to.squeals else None,
            rests_at={} if place is None else dict(zip(names, place.tolist(), strict=True)),
            value=value,
            saturated=ended,
            **more,
        )  # fmt: skip

    @property
    def lasts(self) -> bool:
        """Whether motion is left, or still grows."""
        return self.leads_to.squeals or self.leads_to is Kind.GROWS


class Disturbance(VelocityPerturbation):
    """The smallest disturbance that leads to a motion, of those along the modes.

    It lies between the largest that leads elsewhere and the smallest that leads there, both along `mode`, either way,
    and the numbers are those halfway; the uncertainties are half of what lies between. `leads_to` is the motion.
    """

    speed_uncertainty_m_per_s: float
    energy_uncertainty_J: float
    leads_to: SteadyResponse


class Attractor(SteadyResponse):
    """A steady-state response with all starts that led to it, by name.

    `after_small` says whether the small perturbation did, `disturbance` is the smallest along a mode of those that did,
    None where none of them did, and `from_values` are those from which it was continued. `smallest_disturbance` is the
    smallest that leads there, None where none was found or looked for.
    """

    starts: tuple[str, ...]
    after_small: bool
    disturbance: VelocityPerturbation | None = None
    from_values: tuple[float, ...] = ()
    smallest_disturbance: Disturbance | None = None

    @classmethod
    def of(cls, led: Sequence[Response], smallest: Sequence[Disturbance]) -> Self:
        """That of all responses with one motion."""
        motion = led[0].motion
        assert motion is not None
        disturbances = sorted(
            (each.disturbance for each in led if each.disturbance is not None),
            key=lambda disturbance: disturbance.energy_J,
        )
        return cls(
            **dict(motion),
            starts=tuple(each.start for each in led),
            after_small=any(each.start == SMALL_START for each in led),
            disturbance=next(iter(disturbances), None),
            from_values=tuple(dict.fromkeys(each.from_value for each in led if each.from_value is not None)),
            smallest_disturbance=next((each for each in smallest if each.leads_to.same(motion)), None),
        )


def unpaired(there: Sequence[SteadyResponse], here: Sequence[SteadyResponse]) -> list[SteadyResponse]:
    """The motions at a value that go over into none at its neighbour: the most alike first, each in one pair."""
    alike = sorted(((a.apart(b), j, k) for j, a in enumerate(there) for k, b in enumerate(here) if a.like(b)))
    found: dict[int, int] = {}
    for _, j, k in alike:
        if j not in found and k not in found.values():
            found[j] = k
    return [motion for j, motion in enumerate(there) if j not in found]
