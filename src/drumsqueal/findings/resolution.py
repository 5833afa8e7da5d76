"""By how much a prediction changes with further shapes of what bends: what the shapes that are kept leave out."""

from collections.abc import Iterator
from typing import NamedTuple

from drumsqueal.errors import RequestError, SteadyStateError
from drumsqueal.findings.schema import Finding
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.model import Model, build_model
from drumsqueal.physics.up_to import CLOSE, CLOSE_FRACTION, MORE, up_to_of
from drumsqueal.progress import Progress, silent
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import percent
from drumsqueal.solve.linear.modes import Mode, Stability, analyse_stability, nearest_modes
from drumsqueal.solve.linear.steady import observe_steady


class Resolution(Finding):
    """What changes with shapes up to `with_up_to_Hz` in place of `up_to_Hz`, the least of those of several bodies.

    Of modes up to `below_Hz`: the largest changes of a growth rate, against 1 1/s or 1 % of it, and of a frequency;
    `torque_fraction` of the steady brake torque. `verdict_changes` says that other modes are unstable then.
    """

    up_to_Hz: float
    with_up_to_Hz: float
    below_Hz: float
    mode: str
    growth_rate_1_per_s: float
    frequency_Hz: float
    torque_fraction: float
    verdict_changes: bool
    suffices: bool


class _Pair(NamedTuple):
    """A mode, and what it is with further shapes."""

    mode: Mode
    other: Mode

    @property
    def growth(self) -> float:
        return abs(self.other.growth_rate - self.mode.growth_rate)

    @property
    def unlike(self) -> float:
        """The change of the growth rate, in what is close."""
        return self.growth / max(CLOSE, CLOSE_FRACTION * abs(self.mode.growth_rate))


def resolution_of(scene: Scene, linear: Model, stability: Stability, progress: Progress = silent) -> Resolution | None:
    """Compare a scene's eigenvalues and steady torque with those of further shapes; None where nothing bends.

    None, too, where all coordinates are listed, or so many shapes are not found.
    """
    # Of modal results, all modes that there are may be kept already.
    bending = [(k, one) for k, one in enumerate(scene.alone) if one.shoe.elastic and one.shoe.modes is None]
    kept = {scene.key_of(k, "shoe.elastic"): up_to_of(one, "shoe") for k, one in bending}
    if scene.elastic_table("drum")[1] is not None:
        kept[scene.elastic_table("drum")[0]] = up_to_of(scene, "drum")
    if not kept or scene.simulate.coordinates != "auto":
        return None
    progress("looking at what further shapes change", 0.0, None)
    try:
        wider = scene.with_values({f"{key}.up_to": MORE * up_to for key, up_to in kept.items()})
        more = build_model(wider, coordinates=linear_coordinates(wider))
        found = analyse_stability(more)
    except (RequestError, SteadyStateError):
        return None
    lowest = min(kept.values())
    below = max((mode.frequency_Hz for mode in stability.unstable), default=lowest)
    nearest = nearest_modes(stability.modes, found.modes)
    pairs = [_Pair(stability.modes[i], found.modes[j]) for i, j in nearest]
    pairs = [each for each in pairs if each.mode.frequency_Hz <= below]
    worst = max(pairs, key=lambda each: each.unlike, default=None)
    known = {j for _, j in nearest}
    new = [m for j, m in enumerate(found.modes) if j not in known and m.unstable and m.frequency_Hz <= below]
    changes = bool(new) or any(each.mode.unstable != each.other.unstable for each in pairs)
    torque, with_more = (_torque(*each) for each in ((linear, stability), (more, found)))
    fraction = abs(with_more / torque - 1) if torque else 0.0
    return Resolution(
        up_to_Hz=lowest,
        with_up_to_Hz=MORE * lowest,
        below_Hz=below,
        mode=worst.mode.label if worst else "",
        growth_rate_1_per_s=worst.growth if worst else 0.0,
        frequency_Hz=max((abs(each.other.frequency_Hz - each.mode.frequency_Hz) for each in pairs), default=0.0),
        torque_fraction=fraction,
        verdict_changes=changes,
        suffices=not changes and fraction <= CLOSE_FRACTION and (worst is None or worst.unlike <= 1),
    )


def resolution_at_start(scene: Scene, progress: Progress = silent) -> Resolution | None:
    """The same of a scene as it stands, None also where it has no steady sliding."""
    linear = build_model(scene, coordinates=linear_coordinates(scene))
    try:
        return resolution_of(scene, linear, analyse_stability(linear), progress)
    except SteadyStateError:
        return None


def _torque(model: Model, stability: Stability) -> float:
    return float(observe_steady(model, stability.steady_state)[1].brake_torque)


def resolution_in_words(found: Resolution | None) -> Iterator[str]:
    """What the shapes that are kept leave out, and what would do."""
    if found is None:
        return
    to, more, below = (f"{each / 1e3:.4g} kHz" for each in (found.up_to_Hz, found.with_up_to_Hz, found.below_Hz))
    change = (
        f"With shapes up to {more} in place of {to}, growth rates of modes below {below} change by "
        f"{found.growth_rate_1_per_s:.2g} 1/s at most ({found.mode}), frequencies by {found.frequency_Hz:.2g} Hz, "
        f"the steady torque by {percent(found.torque_fraction)}"
    )
    if found.suffices:
        yield f"{change}: up_to = {to} is enough."
        return
    verdict = "; with these, other modes are unstable: the verdict depends on up_to" if found.verdict_changes else ""
    yield f"{change}{verdict}. Raise up_to to {more}, or until growth rates change by less than 1 1/s or 1 %."
