"""Does a brake whose modes all decay stay quiet in the nonlinear model, too? From its own start, and from a kick."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.departure import Departure, beyond_edges
from drumsqueal.physics.composition import kept_coordinates
from drumsqueal.scene import Profile, Scene
from drumsqueal.simulation import prepare, run_whole

KICK = 3.0  # times the displacement p0/k_c at which the pressure is lost
SQUEALS = {
    "periodic": "with a periodic motion",
    "quasi-periodic": "with a quasi-periodic motion",
    "irregular": "with an irregular motion",
}
LAST = 0.1  # of the record, which tells how a motion ends


class Decay(NamedTuple):
    """One transient: from where, whether it decays, and its motion at the end over that at the beginning.

    It decays if it has become smaller and its last tenth touches no edge of contact, for below the edges the
    eigenvalues rule; it does not if it has settled to a motion beyond them. None where that cannot be told; `outcome`
    says in words how it ends.
    """

    start: str
    decays: bool | None
    motion_ratio: float | None
    outcome: str


def nonlinear_decay(scene: Scene, on_start: Callable[[str], None] | None = None) -> tuple[Decay, Decay]:
    """Transients of a scene from its own start and from a kick of 3 p0/k_c; `on_start` is told which begins.

    Raises SceneError for a scene that cannot be run and KeyboardInterrupt between two chunks.
    """
    told = on_start or (lambda _: None)
    found = []
    for start, each in (("its own start", scene), (f"a kick of {KICK:g} p0/k_c", kicked(scene))):
        told(start)
        found.append(_run(start, each))
    return found[0], found[1]


def kicked(scene: Scene) -> Scene:
    """The scene with a start beyond the edges of contact: Y and Tz or, if neither is kept, whatever is."""
    shoe, load = scene.shoe, scene.contact.normal_load
    most = max(load.value) if isinstance(load, Profile) else load
    size = KICK * most / (shoe.outer_radius * shoe.arc_angle * shoe.width) / max(scene.contact.stiffness, 1.0)
    kept = kept_coordinates(scene)
    moved = [name for name in kept if name in ("Y", "Tz")] or list(kept)
    start = {name: size / shoe.outer_radius if name.startswith("T") else size for name in moved}
    return scene.with_values({"start": {"displacement": start, "velocity": {}}})


def _run(start: str, scene: Scene) -> Decay:
    prepared = prepare(scene)
    try:
        result = run_whole(prepared)
    except IntegrationError as error:
        return Decay(start, None, None, f"failed: {error}")
    ratio = result.comparison.motion_ratio
    if ratio is None:
        return Decay(start, None, None, "nothing was started")
    departure = Departure(result.history, result.stability)
    beyond = beyond_edges(result.history, result.stability, prepared.linear)
    last = slice(departure.time.size - max(1, round(LAST * departure.time.size)), None)
    if ratio < 1 and not np.any(beyond[last]):
        return Decay(start, True, ratio, "decays below the edges of contact")
    saturation = result.comparison.saturation
    kind = "unknown" if saturation is None else saturation.regime.kind
    if kind in SQUEALS:
        assert saturation is not None
        line = "" if saturation.main is None else f", mostly at {saturation.main.frequency_Hz:.0f} Hz"
        return Decay(start, False, ratio, f"squeals on, {SQUEALS[kind]}{line}")
    return Decay(start, None, ratio, f"has not settled within {departure.time[-1]:g} s; a longer run may tell")
