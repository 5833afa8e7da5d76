"""Many starts of brakes or bodies of one composition: each transient goes on until it is clear where it leads."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.model import Model
from drumsqueal.questions.onset.attractors import CONSTANT, LASTING, PERSISTENT, find_attractors, round_seconds
from drumsqueal.questions.onset.family import Family, How, Start
from drumsqueal.questions.onset.motions import Leads, Response, SteadyResponse
from drumsqueal.questions.sweep.body import BodyPlan
from drumsqueal.questions.sweep.points import COMPUTED, LEADS, OPEN, Columns, blank, note_motion
from drumsqueal.solve.linear.branches import Point
from drumsqueal.solve.linear.modes import Stability, analyse_stability

# Next to an unstable cycle motion dwells, and may look settled. Where the amplitude of one round more differs by more
# than this, it must last; samples alone make amplitudes uncertain by 0.3 %.
SURE = 5e-3


Vectors = Mapping[int, tuple[NDArray[np.float64], NDArray[np.float64]]]


def round_of(stability: Stability, moving: Sequence[str]) -> float:
    """How long a round is (s): a hundred periods of the slowest mode, or until the one that decays slowest has."""
    point = point_of(0, stability)
    longest = round_seconds([point], tuple(moving))
    modes = [mode for mode in stability.modes if mode.name in moving]
    if not modes:
        return longest
    # A round lasts until what decays has fallen to e^-3, and 20 periods of the slowest mode for its frequency.
    enough = 3.0 / max(min(abs(mode.growth_rate) for mode in modes), 1e-300)
    return min(longest, max(enough, 20 / min(mode.frequency_Hz for mode in modes)))


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
    seconds = dict.fromkeys(models, 0.0)
    before: dict[int, SteadyResponse] = {}

    def progress(*_: object) -> None:
        look()

    for rounds in (PERSISTENT, 2, LASTING):  # rounds: of one, no change can be seen
        doubtful = []
        for response in find_attractors(family, tasks, how, rounds=rounds, progress=progress):
            k, motion = int(response.start), response.motion
            seconds[k] += response.simulated_s
            brief = motion is not None and motion.fluctuation < CONSTANT and rounds != LASTING
            if motion is not None and brief and not (k in before and _is_same(before[k], motion)):
                before[k] = motion
                doubtful.append((points[k], Start(response.start, *motion.state)))
                continue
            _note(columns, k, response, coordinates, family.moving)
            columns["simulated"][k] = np.nan if response.leads_to is Leads.FAILED else seconds[k]
        tasks = doubtful


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


def _is_same(first: SteadyResponse, second: SteadyResponse) -> bool:
    """Whether the amplitude of a motion is still the same, by the coordinate with its main line."""
    name = first.line_of
    return name == second.line_of and (name is None or abs(second.amplitude[name] / first.amplitude[name] - 1) < SURE)


def point_of(k: int, found: Stability) -> Point:
    """A stability as the linear point of number k."""
    return Point(float(k), found.steady_state, found.modes, found.eigenvalues, "", found.matrix, found.vibrations)


def _note(columns: Columns, k: int, response: Response, coordinates: Sequence[str], names: tuple[str, ...]) -> None:
    leads = response.leads_to
    columns["leads_to"][k] = LEADS.index(leads)
    note_motion(columns, k, response.saturated, coordinates, names, settled=leads not in OPEN)
    if leads is Leads.DECAYS:
        columns["attractor"][k] = 0
