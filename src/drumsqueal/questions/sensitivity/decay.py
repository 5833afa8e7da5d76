"""Does a brake whose modes all decay stay quiet in the nonlinear model, too, from its own start?"""

from typing import cast

import numpy as np
from pydantic import computed_field

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.boundaries import mean_pressures
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.schema import Finding
from drumsqueal.findings.vibration import Vibration, beyond_boundaries, moments_at
from drumsqueal.physics.bodies.body import Shoe
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.scene import Scene
from drumsqueal.simulation import prepare, run_whole

DISTURBANCE = 3.0  # times the displacement p0/k_c at which the mean pressure is lost
LAST = 0.1  # of the record, which shows how a motion ends


class Decay(Finding):
    """One transient: from where, how it ends, and its motion at the end over that at the beginning.

    It decays if it has become smaller and its last tenth has neither lift-off nor slip reversal, for then the
    eigenvalues rule; it squeals if it has settled to a motion of this `kind`, mostly at `frequency_Hz`. `duration_s`
    was run, and `reason` says why it failed.
    """

    start: str = "its own start"
    outcome: Kind
    motion_ratio: float | None = None
    duration_s: float | None = None
    kind: Kind | None = None
    frequency_Hz: float | None = None
    reason: str | None = None

    @computed_field
    @property
    def decays(self) -> bool | None:
        """Whether it decays; None where that is not known."""
        return {Kind.DECAYS: True, Kind.SQUEALS: False}.get(self.outcome)


def disturbed(scene: Scene) -> Scene:
    """The scene with a start beyond the contact boundary: of what moves with the drum or, if that rests, of all."""
    model = build_model(scene)
    size, body = DISTURBANCE * _deepest(model), cast("Shoe", model.body)  # of several shoes, all of them
    following = [name for name, rate in zip(body.names, body.following, strict=True) if rate != 0]
    start = {name: size / body.lever(name) for name in following or body.names}
    return scene.with_values({"start": {"displacement": start, "velocity": {}}})


def _deepest(model: Model) -> float:
    """How far (m) the mean pressure presses a lining in, at any time and of any shoe."""
    corners = model.operation.corners
    times = np.zeros(1) if corners is None else np.append(0.0, np.asarray(corners))
    pressures = mean_pressures(model, moments_at(model.operation, times))
    most = zip(pressures, model.contact.laws, strict=True)
    return max(float(np.max(pressure)) / max(float(law.stiffness), 1.0) for pressure, law in most)


def nonlinear_decay(scene: Scene, progress: Progress = silent) -> Decay:
    """The transient of a scene from its own start. Raises SceneError for a scene that cannot be run."""
    prepared = prepare(scene)
    try:
        result = run_whole(prepared, progress)
    except IntegrationError as error:
        return Decay(outcome=Kind.FAILED, reason=str(error))
    ratio = result.findings.motion_ratio
    if ratio is None:
        return Decay(outcome=Kind.NOT_STARTED)
    vibration = Vibration(result.history, result.stability)
    beyond = beyond_boundaries(result.history, result.stability.contact_fractions, prepared.linear)
    last = slice(vibration.time.size - max(1, round(LAST * vibration.time.size)), None)
    found = Decay(outcome=Kind.DECAYS, motion_ratio=ratio, duration_s=float(vibration.time[-1]))
    if ratio < 1 and not np.any(beyond[last]):
        return found
    saturation = result.findings.saturation
    if saturation is None or not saturation.regime.kind.squeals:
        return found.model_copy(update={"outcome": Kind.UNDECIDED})
    frequency = None if saturation.main is None else saturation.main.frequency_Hz
    settled = {"outcome": Kind.SQUEALS, "kind": saturation.regime.kind, "frequency_Hz": frequency}
    return found.model_copy(update=settled)
