"""The eigenvalue problem of steady sliding as it is written down, and what further shapes would change in it.

It is what `stability --json` writes, and part of every run.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from pydantic import FiniteFloat

from drumsqueal.coordinates import is_rotation
from drumsqueal.errors import RequestError, SteadyStateError
from drumsqueal.findings.columns import Column
from drumsqueal.findings.kinds import Criteria
from drumsqueal.findings.schema import Finding, Positive
from drumsqueal.physics.basis import MORE, further_shapes
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.elasticity import CLOSE_FRACTION, MOST_STEPS, compare, is_cut_short, resolved
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import percent
from drumsqueal.solve.linear.modes import (
    Stability,
    analyse_stability,
    growing_without_oscillation,
    labels_of,
    without_oscillation,
)
from drumsqueal.solve.linear.steady import observe_steady


class PredictedMode(Finding):
    """A mode that oscillates, named by its largest mass-weighted coordinate, with ζ = −Re λ/|λ|."""

    name: str
    frequency_Hz: Annotated[Positive, Column("frequency", ".2f", "Im λ/2π", in_cells=True)]
    growth_rate_1_per_s: Annotated[FiniteFloat, Column("growth rate", "+.3f", "Re λ; positive grows", in_cells=True)]
    damping_ratio: Annotated[
        FiniteFloat, Column("damping ratio", "+.3f", "ζ = −Re λ/|λ|", unit="%", factor=100, in_cells=True)
    ]
    unstable: bool

    @property
    def abaqus_damping_ratio(self) -> float:
        """−2 Re λ/|Im λ|, some twice of ζ; negative where the mode is unstable."""
        return -2 * self.growth_rate_1_per_s / (math.tau * self.frequency_Hz)


class ShapeResolution(Finding):
    """What changes with shapes up to `with_up_to_Hz` in place of `up_to_Hz`, the least of those of several bodies.

    The others, up to `highest_up_to_Hz`, are raised by the same factor. Of modes up to `below_Hz`: the largest changes
    of a growth rate, against 1 1/s or 1 % of it, and of a frequency; `torque_fraction` of the steady brake torque.
    `verdict_changes` says that other modes are unstable then, and `search_ended` that "auto" looked no further. Beyond
    them `more_grow_from_Hz` is the lowest frequency of modes that grow with the further shapes alone, None of none.
    """

    up_to_Hz: float
    highest_up_to_Hz: float
    with_up_to_Hz: float
    below_Hz: float
    mode: str
    growth_rate_1_per_s: float
    frequency_Hz: float
    torque_fraction: float
    verdict_changes: bool
    suffices: bool
    search_ended: bool
    more_grow_from_Hz: float | None = None


class Prediction(Finding):
    """All eigenvalues (1/s), the modes, steady sliding (m, rad) and the range of its pressure (Pa).

    `resolution` says what further shapes of what bends would change; null where nothing bends.
    """

    eigenvalues: tuple[tuple[float, float], ...]
    modes: tuple[PredictedMode, ...]
    steady_state: dict[str, float]
    pressure_range_Pa: tuple[float, float]
    resolution: ShapeResolution | None = None

    @property
    def labelled(self) -> dict[str, PredictedMode]:
        """The modes by name, with a number for every further one of a name."""
        return dict(zip(labels_of([mode.name for mode in self.modes]), self.modes, strict=True))

    @property
    def unstable(self) -> list[str]:
        """The labels of the modes that grow."""
        return [label for label, mode in self.labelled.items() if mode.unstable]

    @property
    def without_oscillation(self) -> list[float]:
        """Eigenvalues (1/s) that are real."""
        return without_oscillation(np.array([complex(*value) for value in self.eigenvalues])).tolist()

    @property
    def divergence(self) -> float | None:
        """Largest real eigenvalue that grows without oscillation (1/s), None where there is none."""
        return growing_without_oscillation(np.array([complex(*value) for value in self.eigenvalues]))


def sliding_later(stability: Stability) -> str:
    """Why the prediction is not for t = 0."""
    why = "at t = 0 the drum is at rest or nothing pushes the shoe"
    return f"Steady sliding and its eigenvalues are those at t = {stability.time:g} s: {why}."


def turned_far(stability: Stability) -> Iterator[str]:
    """State where steady sliding turns the shoe further than the model holds."""
    turns = zip(stability.coordinates, stability.steady_state.tolist(), strict=True)
    name, angle = max(((n, q) for n, q in turns if is_rotation(n)), key=lambda each: abs(each[1]), default=("", 0.0))
    if abs(angle) > Criteria.small_rotation:
        yield (
            f"In steady sliding the shoe turns by {name} = {angle:.2g} rad, where small rotations, and so the model, "
            "no longer hold."
        )


def predict(stability: Stability, resolution: ShapeResolution | Exception | None = None) -> Prediction:
    """The prediction that steady sliding and its eigenvalues are; of an error no resolution is known."""
    modes = (
        PredictedMode(
            name=mode.name,
            frequency_Hz=mode.frequency_Hz,
            growth_rate_1_per_s=mode.growth_rate,
            damping_ratio=mode.damping_ratio,
            unstable=mode.unstable,
        )
        for mode in stability.modes
    )
    return Prediction(
        eigenvalues=tuple((value.real, value.imag) for value in stability.eigenvalues.tolist()),
        modes=tuple(modes),
        steady_state=dict(zip(stability.coordinates, stability.steady_state.tolist(), strict=True)),
        pressure_range_Pa=stability.pressure_range,
        resolution=resolution if isinstance(resolution, ShapeResolution) else None,
    )


def resolution_of(
    scene: Scene, linear: Model | None = None, stability: Stability | None = None, progress: Progress = silent
) -> ShapeResolution | RequestError | SteadyStateError | None:
    """Compare a scene's eigenvalues and steady torque with those of further shapes.

    Its own are found where they are not given. None where nothing bends or all coordinates are listed, and the error
    where something is not found.
    """
    # Of modal results, all modes that there are may be kept already.
    brake = resolved(scene)
    tables: Any = [
        (scene.key_of(k, "shoe.elastic"), shoe.elastic) for k, shoe in enumerate(brake.shoes) if not shoe.modes
    ]
    kept = {key: table.up_to for key, table in [*tables, brake.elastic_table("drum")] if table is not None}
    if not kept or scene.simulate.coordinates != "auto":
        return None
    progress("looking at what further shapes change", 0.0, None)
    try:
        linear = linear or build_model(scene, coordinates=linear_coordinates(scene))
        stability = stability or analyse_stability(linear)
        wider = scene.with_values({f"{key}.up_to": MORE * up_to for key, up_to in kept.items()})
        with further_shapes():
            more = build_model(wider, coordinates=linear_coordinates(wider))
        found = analyse_stability(more)
    except (RequestError, SteadyStateError) as error:
        return error
    own, there = ([mode.eigenvalue for mode in each.modes] for each in (stability, found))
    lowest = min(kept.values())
    below = max((mode.eigenvalue.imag for mode in stability.unstable), default=2 * np.pi * lowest)
    pairs, worst, stays = compare(own, there, below)
    grow = [there[j].imag for j in set(range(len(there))) - set(pairs.values()) if found.modes[j].unstable]
    changes = any(each <= below for each in grow) or any(
        stability.modes[i].unstable != found.modes[j].unstable for i, j in pairs.items()
    )
    torque, with_more = (
        float(observe_steady(model, each.steady_state)[1].brake_torque)
        for model, each in ((linear, stability), (more, found))
    )
    fraction = abs(with_more / torque - 1) if torque else 0.0
    return ShapeResolution(
        up_to_Hz=lowest,
        highest_up_to_Hz=max(kept.values()),
        with_up_to_Hz=MORE * lowest,
        below_Hz=below / (2 * np.pi),
        mode="" if worst is None else stability.modes[worst].label,
        growth_rate_1_per_s=0.0 if worst is None else abs(there[pairs[worst]].real - own[worst].real),
        frequency_Hz=max((abs(there[j].imag - own[i].imag) for i, j in pairs.items()), default=0.0) / (2 * np.pi),
        torque_fraction=fraction,
        verdict_changes=changes,
        suffices=bool(pairs) and not changes and fraction <= CLOSE_FRACTION and stays,
        search_ended=is_cut_short(scene),
        more_grow_from_Hz=min((each / (2 * np.pi) for each in grow if each > below), default=None),
    )


def resolution_in_words(found: ShapeResolution | RequestError | SteadyStateError | None) -> Iterator[str]:
    """What the shapes that are kept leave out, and what would do; why that is not known."""
    if found is None:
        return
    if not isinstance(found, ShapeResolution):
        yield f"What shapes up to {MORE:g} times up_to would change is not known, as they are not found: {found}"
        return
    if not found.mode:
        yield f"No mode is below {found.below_Hz / 1e3:.4g} kHz: raise up_to until some are."
        return
    ends = dict.fromkeys((found.up_to_Hz, found.highest_up_to_Hz))
    to, more = (" to ".join(f"{times * each / 1e3:.4g}" for each in ends) + " kHz" for times in (1.0, MORE))
    change = (
        f"With shapes up to {more} in place of {to}, growth rates of modes below {found.below_Hz / 1e3:.4g} kHz change "
        f"by {found.growth_rate_1_per_s:.2g} 1/s at most ({found.mode}), frequencies by {found.frequency_Hz:.2g} Hz, "
        f"the steady torque by {percent(found.torque_fraction)}"
    )
    beyond = ""
    if found.more_grow_from_Hz is not None:
        beyond = (
            f" With shapes up to {more} more modes grow, from {found.more_grow_from_Hz / 1e3:.4g} kHz on, and what a "
            "transient settles to may depend on up_to: only structural damping calms such modes."
        )
    if found.suffices:
        yield f"{change}: up_to = {to} is enough{' for these modes' * bool(beyond)}.{beyond}"
        return
    verdict = "; with these, other modes are unstable: the verdict depends on up_to" if found.verdict_changes else ""
    ended = f' "auto" looks no further than {MORE**MOST_STEPS:.2g} times the highest frequency of rigid bodies.'
    yield (
        f"{change}{verdict}. Raise up_to to {more}, or until growth rates change by less than 1 1/s or 1 %."
        f"{ended * found.search_ended}{beyond}"
    )
