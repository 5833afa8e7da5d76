"""Many starts of brakes or bodies of one composition: each transient goes on until it is clear where it leads."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drumsqueal.dynamics.attractor import Response, SteadyResponse
from drumsqueal.dynamics.ensemble import Family, How, Start, find_surely, point_of, round_of
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.physics.model import Model
from drumsqueal.questions.sweep.body import BodyPlan
from drumsqueal.questions.sweep.points import COMPUTED, LEADS, Columns, blank, note_motion
from drumsqueal.solve.linear.modes import Stability, analyse_stability

Vectors = Mapping[int, tuple[NDArray[np.float64], NDArray[np.float64]]]


def follow_starts(
    columns: Columns,
    coordinates: Sequence[str],
    models: Mapping[int, Model],
    found: Mapping[int, Stability],
    starts: Vectors,
    how: How,
    look: Callable[[], None],
) -> None:
    """Run the starts of models of one composition by their points, and note in the columns where each leads."""
    some = next(iter(models))
    points = {k: point_of(k, found[k]) for k in models}
    family = Family(lambda value: models[int(value)], models[some].names, found[some].coordinates)
    tasks = [(points[k], Start(str(k), *starts[k])) for k in models]
    stages = (Criteria.persistent, 2, Criteria.lasting)  # rounds: of one, no change can be seen
    for response, seconds in find_surely(family, tasks, how, stages, _is_sure, progress=lambda *_: look()):
        k = int(response.start)
        _note(columns, k, response, coordinates, family.moving)
        columns["simulated"][k] = np.nan if response.leads_to is Kind.FAILED else seconds


def compute_starts(
    plan: BodyPlan, first: int, stop: int, threads: int | None = None, look: Callable[[], None] = lambda: None
) -> Columns:
    """Every variable of the starts of a body from number `first` to `stop`; their batch changes not a bit of them."""
    columns = blank(plan, stop - first)
    columns["outcome"][:] = COMPUTED
    stability, members = analyse_stability(plan.model), range(stop - first)
    seconds = round_of(stability, plan.model.names)
    starts = dict(enumerate(map(plan.start, plan.values(first, stop))))
    how = How(plan.sample_rate, plan.tolerance, seconds, plan.solver, threads)
    models, found = dict.fromkeys(members, plan.model), dict.fromkeys(members, stability)
    follow_starts(columns, plan.coordinates, models, found, starts, how, look)
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


def _note(columns: Columns, k: int, response: Response, coordinates: Sequence[str], names: tuple[str, ...]) -> None:
    leads = response.leads_to
    columns["leads_to"][k] = LEADS.index(leads)
    note_motion(columns, k, response.saturated, coordinates, names, settled=leads.clear or leads is Kind.RUNS_AWAY)
    if leads is Kind.DECAYS:
        columns["attractor"][k] = 0
