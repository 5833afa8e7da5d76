"""Many scenes: the stability of each and, where it is asked for, its steady-state response; and many starts.

Each transient goes on until it is clear where it leads.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drumsqueal.compilation import cores
from drumsqueal.coordinates import is_static
from drumsqueal.dynamics.attractor import Response, SteadyResponse
from drumsqueal.dynamics.ensemble import Family, IntegratorOptions, Start, find_surely, point_of, round_of
from drumsqueal.dynamics.saturated import Saturated, has_settled, rate_since, saturated_motions
from drumsqueal.errors import RequestError, SteadyStateError
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.physics.bodies.body import WRITTEN_OUT
from drumsqueal.physics.composition import compose, linear_coordinates, moved_coordinates, plane_of
from drumsqueal.physics.elasticity import pair_nearest, shaping_numbers
from drumsqueal.physics.model import Model, build_model
from drumsqueal.questions.sweep.matrix_cells import compute_cells
from drumsqueal.questions.sweep.matrix_plan import MatrixPlan
from drumsqueal.questions.sweep.points import (
    COMPUTED,
    FOLDED,
    LEADS,
    NONE,
    NOT_TAKEN,
    NOWHERE,
    BodyPlan,
    Columns,
    Points,
    blank,
    names_of,
    note_motion,
)
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.scene.plan import Plan
from drumsqueal.simulation import check_constant, start_of
from drumsqueal.solve.linear.branches import continued
from drumsqueal.solve.linear.family import BLOCK, analyse_many
from drumsqueal.solve.linear.modes import Stability, analyse_stability

Vectors = Mapping[int, tuple[NDArray[np.float64], NDArray[np.float64]]]


def follow_starts(
    columns: Columns,
    coordinates: Sequence[str],
    models: Mapping[int, Model],
    found: Mapping[int, Stability],
    starts: Vectors,
    how: IntegratorOptions,
    look: Callable[[], None],
) -> None:
    """Run the starts of models of one composition by their points, and note in the columns where each leads."""
    some = next(iter(models))
    points = {k: point_of(k, found[k]) for k in models}
    family = Family(lambda value: models[int(value)], models[some].names, found[some].coordinates)
    tasks = [(points[k], Start(str(k), *starts[k])) for k in models]
    stages = (Criteria.persistent, 2, Criteria.lasting)  # rounds: of one, no change can be seen
    for response, seconds in find_surely(family, tasks, how, stages, _is_sure, progress=lambda *_: look()):
        k, leads = int(response.start), response.leads_to
        settled = leads.clear or leads is Kind.RUNS_AWAY
        note_motion(columns, k, response.saturated, coordinates, family.moving, settled=settled)
        columns["leads_to"][k] = LEADS.index(leads)
        columns["simulated"][k] = np.nan if leads is Kind.FAILED else seconds
        if leads is Kind.DECAYS:
            columns["attractor"][k] = 0


def compute_starts(
    plan: BodyPlan, first: int, stop: int, threads: int | None = None, look: Callable[[], None] = lambda: None
) -> Columns:
    """Every variable of the starts of a body from number `first` to `stop`; their batch changes not a bit of them."""
    columns = blank(plan, stop - first)
    columns["outcome"][:] = COMPUTED
    stability, members = analyse_stability(plan.model), range(stop - first)
    seconds = round_of(stability, plan.model.names)
    starts = dict(enumerate(map(plan.start, plan.values(first, stop))))
    how = IntegratorOptions(plan.sample_rate, plan.tolerance, seconds, plan.solver, threads)
    models, found = dict.fromkeys(members, plan.model), dict.fromkeys(members, stability)
    follow_starts(columns, names_of(plan), models, found, starts, how, look)
    return columns


def _is_sure(response: Response, before: SteadyResponse | None) -> bool:
    """Whether a motion comes and goes, or its amplitude is still the same, by the coordinate with its main line."""
    motion = response.motion
    if motion is None or motion.fluctuation >= Criteria.constant:
        return True
    if before is None or before.line_of != motion.line_of:
        return False
    name = motion.line_of
    return name is None or abs(motion.amplitude[name] / before.amplitude[name] - 1) < Criteria.sure


MOST_ROUNDS = 16  # times the scene's duration that a transient may take to settle
# Points that are kept and told together; of one cell there are many transients, and one that bends may take seconds.
BATCH, BATCH_OF_BENDING, BATCH_OF_TRANSIENTS, BATCH_OF_CELLS = 8 * BLOCK, 4, 32, 1
PURE = 1e-6  # of a mode that moves in the plane, up to which what moves out of it is round-off


def batches(plan: Points) -> list[tuple[int, int]]:
    """The first point, and the one after the last, of the batches that work goes in."""
    if isinstance(plan, MatrixPlan):
        size = BATCH_OF_CELLS
    elif isinstance(plan, BodyPlan) or plan.transient:
        size = BATCH_OF_TRANSIENTS
    else:
        size = BATCH_OF_BENDING if len(linear_coordinates(plan.scene)) > WRITTEN_OUT else BATCH
    return [(first, min(first + size, plan.points)) for first in range(0, plan.points, size)]


def refusal(plan: Plan, k: int) -> str | None:
    """Why the scene does not take the values at point number k; None where it does."""
    try:
        compose(plan.scene_at(plan.values(k, k + 1)[0]))  # which finds the free modes of a shoe that bends, or too many
    except (SceneError, RequestError) as error:
        return str(error)
    return None


def check_plan(plan: Plan) -> None:
    """Raise RequestError where the scene takes the values of no point, SceneError where transients are impossible."""
    if all(refusal(plan, k) for k in range(plan.points)):
        raise RequestError(f"the scene takes none of these values; at the first point: {refusal(plan, 0)}")
    if not plan.transient:
        return
    if plan.starts:
        check_constant(plan.scene)
        if plan.scene.forcing is not None:
            cure = "a force keeps the brake moving wherever it starts; leave it out (forcing=none)"
            raise SceneError(cure, ("forcing",))
        return
    if not moved_coordinates(plan.scene):
        cure = "start something, such as displacement = { Y = 1e-7 }"
        raise SceneError(f"nothing moves in the transients; {cure}", ("start",))
    speed = plan.scene.drum.speed
    if isinstance(speed, Profile) and speed.value[0] == 0:
        cure = "the transients of a sweep start from steady sliding; give the drum a speed at t = 0"
        raise SceneError(cure, ("drum", "speed"))


def compute(
    plan: Points, first: int, stop: int, threads: int | None = None, look: Callable[[], None] = lambda: None
) -> Columns:
    """Every variable at the points from number `first` to `stop`; the batch they come in changes not a bit of them.

    `look` is called between two steps.
    """
    if isinstance(plan, MatrixPlan):
        return compute_cells(plan, first, stop, threads, look)
    if isinstance(plan, BodyPlan):
        return compute_starts(plan, first, stop, threads, look)
    columns, names = blank(plan, stop - first), names_of(plan)
    scenes: dict[int, Scene] = {}
    for k, values in enumerate(plan.values(first, stop)):
        try:
            scene = plan.scene_at(values)
            compose(scene)  # which finds the free modes of a shoe that bends, or too many
            scenes[k] = scene
        except (SceneError, RequestError):
            columns["outcome"][k] = NOT_TAKEN
    found, own = _analyse(plan, first, scenes), analyse_many([plan.scene])[0]
    for k, stability in found.items():
        if isinstance(stability, SteadyStateError):
            columns["outcome"][k] = NOWHERE[stability.reason]
        else:
            numbers = _numbers(plan, first + k, own, stability)
            _note_stability(columns, k, stability, numbers, names, plane_of(scenes[k]))
    if plan.transient:
        look()
        sound = {k: each for k, each in found.items() if isinstance(each, Stability)}
        follow = _follow_starts if plan.starts else _follow_scenes
        for members in _alike(columns, scenes, sound):
            follow(plan, columns, {k: scenes[k] for k in members}, sound, threads or cores(), look)
    return columns


def _analyse(plan: Plan, first: int, scenes: Mapping[int, Scene]) -> dict[int, Stability | SteadyStateError]:
    """Steady sliding and eigenvalues of each scene; those that differ in their start alone are one brake."""
    fixed = [place for place, key in enumerate(plan.keys) if key not in plan.starts]
    brakes = {k: tuple(plan.values(first + k, first + k + 1)[0, fixed]) for k in scenes}
    each = {brake: scenes[k] for k, brake in brakes.items()}
    found = dict(zip(each, analyse_many(list(each.values())), strict=True))
    return {k: found[brake] for k, brake in brakes.items()}


def _note_stability(
    columns: Columns,
    k: int,
    stability: Stability,
    numbers: Sequence[int],
    names: Sequence[str],
    planar: Sequence[str],
) -> None:
    known = ((mode, number) for mode, number in zip(stability.modes, numbers, strict=True) if mode.name in names)
    for rank, (mode, number) in enumerate(known):
        if rank == len(names):  # modes of one name, of a shoe with more free modes than at the ends of the sweep
            break
        columns["growth_rate"][k, rank] = mode.growth_rate
        columns["frequency"][k, rank] = mode.frequency_Hz
        columns["unstable"][k, rank] = mode.unstable
        columns["mode_coordinate"][k, rank] = names.index(mode.name)
        columns["mode_number"][k, rank] = number
        shape = {name: abs(part) for name, part in mode.shape(stability.coordinates).items()}
        inside, outside = (sum(shape[name] for name in shape if (name in planar) == way) for way in (True, False))
        columns["mode_in_plane"][k, rank] = 1 if outside < PURE * inside else 0 if inside < PURE * outside else NONE
    columns["largest_growth_rate"][k] = max((mode.growth_rate for mode in stability.modes), default=np.nan)
    columns["squeal"][k] = bool(stability.unstable)
    columns["divergence_rate"][k] = stability.divergence or 0.0
    columns["contact_fraction"][k] = stability.contact_fraction
    columns["smallest_pressure"][k], columns["largest_pressure"][k] = stability.pressure_range
    columns["outcome"][k] = COMPUTED


def _numbers(plan: Plan, point: int, own: Stability | SteadyStateError, there: Stability) -> list[int]:
    """Which mode of the scene itself each mode at a point is: none of other coordinates, as of other free modes.

    Free modes of other shapes change their order where two have one frequency: a coordinate is then another one.
    Where a body yields besides its modes, it does so in shapes of its own at each point: the way there is that of the
    scene's, at whose end its modes have next to the same eigenvalues.
    """
    none = [NONE] * len(there.modes)
    numbers, values = plan.scene.numbers(), plan.values(point, point + 1)[0]
    ends = {key: (numbers[key], value) for key, value in zip(plan.keys, values, strict=True) if key in numbers}
    reshaped = any(ends[key][0] != ends[key][1] for key in shaping_numbers(plan.scene) if key in ends)
    if isinstance(own, SteadyStateError) or _resolved(own) != _resolved(there) or reshaped:
        return none
    held = _resolved(own) != own.coordinates

    def model_at(part: float) -> Model:
        found = {key: low + part * (high - low) for key, (low, high) in ends.items()}
        scene = plan.scene if held else plan.scene.with_values(found)
        return build_model(scene, found if held else None, coordinates=linear_coordinates(scene))

    try:
        if not held:
            return continued(model_at, own, there)
        end = analyse_stability(model_at(1.0))
        known = pair_nearest(*([mode.eigenvalue for mode in each.modes] for each in (there, end)))
        followed = continued(model_at, own, end)
        return [followed[known[k]] if k in known else NONE for k in range(len(there.modes))]
    except (SceneError, RequestError, SteadyStateError):  # no way leads straight there
        return none


def _resolved(stability: Stability) -> tuple[str, ...]:
    """The coordinates that are the same in other scenes: without the shapes in which bodies yield besides modes."""
    return tuple(name for name in stability.coordinates if not is_static(name))


def _alike(columns: Columns, scenes: Mapping[int, Scene], found: Mapping[int, Stability]) -> list[list[int]]:
    """The points whose scenes call for the same effects, together; without those whose samples fold."""
    groups: dict[Any, list[int]] = {}
    for k, stability in found.items():
        if scenes[k].simulate.sample_rate < 2 * stability.highest_frequency_Hz:
            columns["outcome"][k] = FOLDED
        else:
            groups.setdefault(compose(scenes[k]), []).append(k)
    return list(groups.values())


def _follow_scenes(
    plan: Plan,
    columns: Columns,
    scenes: Mapping[int, Scene],
    found: Mapping[int, Stability],
    threads: int,
    look: Callable[[], None],
) -> None:
    """Integrate scenes that call for the same effects."""
    simulate = plan.scene.simulate
    models, coordinates = {k: build_model(scene) for k, scene in scenes.items()}, names_of(plan)
    names = next(iter(models.values())).names
    places = [found[next(iter(scenes))].coordinates.index(name) for name in names]
    displacement, velocity = start_of(plan.scene, names)
    how = IntegratorOptions(simulate.sample_rate, simulate.tolerance, simulate.duration, simulate.solver, threads)
    before: dict[int, Saturated | None] = dict.fromkeys(scenes)  # how the last round of what goes on ended
    for number in range(1, most_rounds(next(iter(scenes.values()))) + 1):
        look()
        motions = saturated_motions(
            [models[k] for k in before],
            [found[k].steady_state[places] for k in before],
            [displacement if motion is None else motion.vibration for motion in before.values()],
            [velocity if motion is None else motion.velocity for motion in before.values()],
            how,
            matrices=[found[k].over(names).matrix for k in before],
        )
        for k, motion in zip(tuple(before), motions, strict=True):
            settled = has_settled(motion, found[k], rate_since(before[k], motion, simulate.duration))
            note_motion(columns, k, motion, coordinates, names, settled=settled)
            columns["simulated"][k] = number * simulate.duration
            before[k] = motion
            if settled:
                del before[k]
        if not before:
            break


def _follow_starts(
    plan: Plan,
    columns: Columns,
    scenes: Mapping[int, Scene],
    found: Mapping[int, Stability],
    threads: int,
    look: Callable[[], None],
) -> None:
    """Run the starts of scenes that call for the same effects until it is clear where each leads.

    A round is as long for all of them: by the slowest mode of the scene itself.
    """
    simulate = plan.scene.simulate
    brakes = {id(found[k]): scene for k, scene in scenes.items()}  # whose starts alone differ has one stability
    built = {brake: build_model(scene) for brake, scene in brakes.items()}
    models = {k: built[id(found[k])] for k in scenes}
    own, names = analyse_many([plan.scene])[0], models[next(iter(models))].names
    seconds = round_of(own, names) if isinstance(own, Stability) else simulate.duration
    how = IntegratorOptions(simulate.sample_rate, simulate.tolerance, seconds, simulate.solver, threads)
    starts = {k: start_of(scene, names) for k, scene in scenes.items()}
    follow_starts(columns, names_of(plan), models, {k: found[k] for k in scenes}, starts, how, look)


def most_rounds(scene: Scene) -> int:
    """How many times its duration a transient may take to settle; once where time itself matters."""
    changes = any(isinstance(each, Profile) for each in scene.schedules().values())
    return 1 if changes or scene.forcing is not None else MOST_ROUNDS
