"""The squeals of a scene that coexist: where transients from its own start and from large disturbances lead."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.model import build_model
from drumsqueal.progress import Progress
from drumsqueal.questions.onset.attractors import find_attractors
from drumsqueal.questions.onset.family import Family, How, Start
from drumsqueal.questions.onset.kicks import directions
from drumsqueal.questions.onset.motions import SteadyResponse
from drumsqueal.questions.sensitivity.study import at_one_time
from drumsqueal.questions.sweep.starts import point_of, round_of
from drumsqueal.scene import Scene
from drumsqueal.simulation import prepare, start_of
from drumsqueal.solve.linear.modes import analyse_stability

BOUNDARY = 1.0  # of the nearer contact boundary: a smaller disturbance leads where small vibration does


def scenes_that_squeal(scene: Scene, progress: Progress) -> tuple[Scene, ...]:
    """The scene once for each squeal that was found, with a start on that motion.

    Starts are its own, a small one, and velocities along each mode, either way, in sizes beyond the nearer contact
    boundary, as `drumsqueal onset` tries them.
    """
    frozen = at_one_time(scene, prepare(scene).stability.time)
    model = build_model(frozen)
    stability = analyse_stability(build_model(frozen, coordinates=linear_coordinates(frozen)))
    family, point = Family(lambda _: model, model.names, stability.coordinates), point_of(0, stability)
    starts = [Start("own", *start_of(scene, model.names)), family.small_start(point, model)]
    for way in directions(point, family):
        starts += [way.start(size) for size in way.sizes if size * way.boundary_ratio > BOUNDARY]
    simulate = scene.simulate
    how = How(simulate.sample_rate, simulate.tolerance, round_of(stability, model.names), simulate.solver)
    found: list[SteadyResponse] = []
    responses = find_attractors(family, [(point, start) for start in starts], how, progress=_shown(progress))
    for motion in (response.motion for response in responses):
        if motion is not None and not any(motion.same(other) for other in found):
            found.append(motion)
    return tuple(started(scene, model.names, *motion.state) for motion in found)


def started(scene: Scene, names: Sequence[str], displacement: ArrayLike, velocity: ArrayLike) -> Scene:
    """The scene with a start at a displacement from steady sliding and a velocity (n,) of the named coordinates."""
    start = {"displacement": displacement, "velocity": velocity}
    tables = {kind: dict(zip(names, np.asarray(each).tolist(), strict=True)) for kind, each in start.items()}
    return scene.with_values({"start": tables})


def _shown(progress: Progress) -> Progress:
    def report(*_: object) -> None:
        progress("squeals of the scene", 0.0, None)

    return report
