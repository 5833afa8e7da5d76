"""By how much a prediction changes with further shapes of what bends: what the shapes that are kept leave out."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from drumsqueal.errors import RequestError, SteadyStateError
from drumsqueal.findings.schema import Finding
from drumsqueal.physics.basis import MORE, further_shapes
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.model import Model, build_model
from drumsqueal.physics.up_to import CLOSE_FRACTION, MOST_STEPS, compare, is_cut_short, resolved
from drumsqueal.progress import Progress, silent
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import percent
from drumsqueal.solve.linear.modes import Stability, analyse_stability
from drumsqueal.solve.linear.steady import observe_steady


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
    torque, with_more = (_torque(*each) for each in ((linear, stability), (more, found)))
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


def _torque(model: Model, stability: Stability) -> float:
    return float(observe_steady(model, stability.steady_state)[1].brake_torque)


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
