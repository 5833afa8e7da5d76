"""What is computed of each cell of a noise matrix, and what was found: which squeal, how loud, after what disturbance.

A cell is computed from a small start and large disturbances, or in the loudest moment of a procedure.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import cache, partial
from operator import attrgetter
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray
from pydantic import Field

from drumsqueal.coordinates import DISPLACEMENT, kind_of, shoe_of
from drumsqueal.dynamics.attractor import SMALL_START
from drumsqueal.dynamics.ensemble import (
    Family,
    IntegratorOptions,
    Start,
    directions,
    find_attractors,
    point_of,
    round_of,
)
from drumsqueal.dynamics.saturated import strongest_line
from drumsqueal.errors import SteadyStateError
from drumsqueal.findings.columns import Column
from drumsqueal.findings.decay import falls_as_small, rate_of_halves
from drumsqueal.findings.history import versions
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.schema import Finding, Held, Number
from drumsqueal.findings.vibration import boundary_fractions
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress
from drumsqueal.questions.sweep.matrix_plan import PROCEDURE, SCENE, WINDOW, MatrixPlan
from drumsqueal.questions.sweep.points import (
    CELL_VERDICTS,
    COMPUTED,
    FAILED,
    FOLDED,
    NONE,
    NOT_SETTLED,
    NOWHERE,
    OUTCOMES,
    STILL_FALLS,
    CellVerdict,
    Columns,
    blank,
    names_in,
    names_of,
)
from drumsqueal.scene import Scene
from drumsqueal.solve.linear.branches import Point
from drumsqueal.solve.linear.modes import Stability, analyse_stability
from drumsqueal.solve.linear.passage import point_in_time
from drumsqueal.solve.transient.integrate import integrate_many
from drumsqueal.solve.transient.state import least_energy

OF_OUTCOME = {COMPUTED: CellVerdict.QUIET, STILL_FALLS: CellVerdict.UNDECIDED}  # where nothing squeals


class Cell(NamedTuple):
    """A scene at the start of its procedure, with its models and where it slides."""

    scene: Scene
    model: Model
    linear: Model
    stability: Stability
    family: Family
    point: Point

    @property
    def starts(self) -> list[Start]:
        """A small start, and a large disturbance along each mode."""
        large = (each.start(each.sizes[-1]) for each in directions(self.point, self.family, (1,)))
        return [self.family.small_start(self.point, self.model), *large]


class LoudestSqueal(NamedTuple):
    """The loudest squeal after a start: rms velocity (m/s), frequency (Hz), and when (s) and at which speed (rad/s)."""

    start: Start
    velocity: float
    frequency: float
    time: float = math.nan
    speed: float = math.nan


def compute_cells(plan: MatrixPlan, first: int, stop: int, threads: int | None, look: Callable[[], None]) -> Columns:
    """Every variable of the cells from number `first` to `stop`."""
    columns, names = blank(plan, stop - first), names_of(plan)
    for k in range(stop - first):
        look()
        scene, procedure = plan.scene_at(first + k)
        cell = _prepared(procedure.over(scene), columns, k)
        if cell is None:
            continue
        columns["growth_rate"][k] = max((mode.growth_rate for mode in cell.stability.modes), default=np.nan)
        columns["unstable"][k] = bool(cell.stability.unstable)
        found, outcome = (_through if procedure.time else _lasting)(cell, threads, lambda *_: look())
        columns["outcome"][k] = outcome
        verdict = CellVerdict.SQUEALS if found else OF_OUTCOME.get(outcome, CellVerdict.NOT_CLEAR)
        columns["squeal"][k] = CELL_VERDICTS.index(verdict)
        _note(columns, k, found, names, settled=not procedure.time)
    return columns


def _prepared(scene: Scene, columns: Columns, k: int) -> Cell | None:
    """The models of a scene; None, with the reason in the columns, where it does not slide or its samples fold."""
    model, linear = build_model(scene), build_model(scene, coordinates=linear_coordinates(scene))
    try:
        stability = analyse_stability(linear)
    except SteadyStateError as error:
        columns["outcome"][k] = NOWHERE[error.reason]
        return None
    if scene.simulate.sample_rate < 2 * stability.highest_frequency_Hz:
        columns["outcome"][k] = FOLDED
        return None
    family = Family(lambda _: model, model.names, stability.coordinates)
    return Cell(scene, model, linear, stability, family, point_of(0, stability))


def _lasting(cell: Cell, threads: int | None, progress: Progress) -> tuple[list[LoudestSqueal], int]:
    """The squeals at constant speed and load by the start that leads to each, and what became of the cell."""
    starts, simulate = {start.name: start for start in cell.starts}, cell.scene.simulate
    tasks, seconds = [(cell.point, start) for start in starts.values()], round_of(cell.stability, cell.model.names)
    how = IntegratorOptions(simulate.sample_rate, simulate.tolerance, seconds, simulate.solver, threads)
    responses = list(find_attractors(cell.family, tasks, how, progress=progress))
    found = [
        LoudestSqueal(
            starts[each.start], _rms(cell.model, each.motion.kinetic_energy_J), each.motion.frequency_Hz or math.nan
        )
        for each in responses
        if each.motion is not None
    ]
    leads = {each.leads_to for each in responses}
    if Kind.FAILED in leads:
        return found, FAILED
    unclear = not found and not all(each.clear for each in leads)
    return found, NOT_SETTLED if unclear else COMPUTED


def _through(cell: Cell, threads: int | None, progress: Progress) -> tuple[list[LoudestSqueal], int]:
    """The loudest squeal of a procedure from each start, in windows of 50 ms beyond a contact boundary.

    And what became of the cell: where nothing squeals, a disturbance may still fall when the procedure ends. The last
    window ends with the procedure and may overlap another.
    """
    starts, simulate = cell.starts, cell.scene.simulate
    steady = cell.family.shown(cell.stability.steady_state)
    loudest: list[LoudestSqueal | None] = [None] * len(starts)
    falls = [False] * len(starts)  # in the window that was looked at last
    slowest_rate = cache(partial(_slowest_rate, cell))
    ended = np.full(len(starts), np.inf)  # s, where one has failed; where the drum all but stands that does not matter
    # Samples (k, 1 + 2n): their times (s), displacements from steady sliding and velocities.
    held = [np.empty((0, 1 + 2 * len(steady)))] * len(starts)
    last = held[:]
    samples = round(WINDOW * simulate.sample_rate)

    def hear(k: int, record: NDArray[np.float64]) -> None:
        time, vibration, velocity = np.split(record, [1, 1 + len(steady)], axis=1)
        heard, falls[k] = _heard(cell.model, starts[k], time[:, 0], vibration, velocity, slowest_rate)
        loudest[k] = max((each for each in (loudest[k], heard) if each), key=attrgetter("velocity"), default=None)

    stream = integrate_many(
        [cell.model] * len(starts), np.array([steady] * len(starts)), np.array([each.vibration for each in starts]),
        np.array([each.velocity for each in starts]), duration=simulate.duration, sample_rate=simulate.sample_rate,
        tolerance=simulate.tolerance, solver=simulate.solver, threads=threads,
    )  # fmt: skip
    with closing(stream):
        for chunk in stream:
            progress("procedure", float(chunk.time[-1]), simulate.duration)
            for k in range(len(starts)):
                sound = np.isfinite(chunk.velocity[k]).all(axis=1)
                if not sound.all():
                    ended[k] = min(ended[k], chunk.time[sound.argmin()])
                fresh = np.column_stack([chunk.time, chunk.vibration[k], chunk.velocity[k]])[sound]
                held[k] = np.vstack([held[k], fresh])
                while len(held[k]) >= samples:
                    last[k], held[k] = held[k][:samples], held[k][samples:]
                    hear(k, last[k])
    for k, rest in enumerate(held):
        if len(rest) and len(last[k]):
            hear(k, np.vstack([last[k], rest])[-samples:])
    found = [each for each in loudest if each is not None]
    if any(_turns(cell.model, each) for each in ended):
        return found, FAILED
    return found, STILL_FALLS if any(falls) and not found else COMPUTED


def _slowest_rate(cell: Cell, time: float) -> float:
    """How fast the slowest mode grows or decays at the speed and the load of a time (s), |Re λ| (1/s); 0 for none."""
    modes = cell.family.modes(point_in_time(cell.linear, time))
    return min((abs(mode.growth_rate) for mode in modes), default=0.0)


def _turns(model: Model, time: float | NDArray) -> bool:
    """Whether the drum turns at all times (s) of a window, and does not all but stand."""
    schedule = model.operation.drum_speed
    fastest = np.abs(np.asarray(getattr(schedule, "value", 0.0))).max()
    # 0.02 of the largest drum speed: below it the drum all but stands, and what slips back is no squeal
    return bool(np.all(np.isfinite(time)) and np.abs(schedule.at(time)[0]).min() >= 0.02 * fastest)


def _heard(
    model: Model,
    start: Start,
    time: NDArray,
    vibration: NDArray,
    velocity: NDArray,
    slowest_rate: Callable[[float], float],
) -> tuple[LoudestSqueal | None, bool]:
    """The squeal in a window; None where the motion stays within the contact boundaries, or the drum all but stands.

    Nor is it squeal where the motion falls, relative to the drum's speed, more than half as fast as the slowest mode
    changes at the speed and the load of the window: that is a disturbance which decays, or one on its way to squeal.
    The other value is whether it falls so and is beyond a contact boundary in the second half of the window, too.
    """
    moments = model.operation.at(time)
    speed = np.broadcast_to(np.asarray(moments.drum_speed), time.shape)
    if not _turns(model, time):
        return None, False
    q, v = (dict(zip(model.names, columns.T, strict=True)) for columns in (vibration, velocity))
    beyond = boundary_fractions(model, q, v, moments).max(axis=(0, 1)) >= Criteria.beyond
    if not beyond.any():
        return None, False
    energies, middle = velocity**2 @ np.asarray(model.mass) / 2, len(time) // 2
    if 2 * energies.mean() < float(least_energy(model)):  # it rests, in whichever equilibrium
        return None, False
    before, after = (float(half.mean()) for half in np.array_split(energies / speed**2, 2))
    slowest = slowest_rate(float(time[middle]))
    if slowest and falls_as_small(rate_of_halves(before, after, float(time[-1] - time[0])), -slowest):
        return None, bool(beyond[middle:].any())
    rate = (len(time) - 1) / float(time[-1] - time[0])
    frequency, _ = strongest_line(velocity, np.asarray(model.mass), model.names, rate)
    loud = _rms(model, float(energies.mean()))
    return LoudestSqueal(start, loud, frequency or math.nan, float(time[middle]), float(speed[middle])), False


def _rms(model: Model, kinetic_energy: float) -> float:
    """√(2 T/m): the rms velocity (m/s) of the shoe, over its mass and over time, by the mean kinetic energy T (J).

    Of several shoes m is the mass of all of them: all at 1 m/s have 1 m/s, one of two alike alone 1/√2 m/s. Where the
    drum bends, its kinetic energy counts, too.
    """
    masses = zip(model.names, model.mass.tolist(), strict=True)
    by_shoe = {shoe_of(name): mass for name, mass in masses if kind_of(name) is DISPLACEMENT}
    return math.sqrt(2 * kinetic_energy / (sum(by_shoe.values()) or float(model.mass[0])))


def _note(columns: Columns, k: int, found: Sequence[LoudestSqueal], names: Sequence[str], *, settled: bool) -> None:
    """Put down the loudest squeal, the one after the small start, and whether only a large disturbance leads to any.

    Of a procedure, in which a large disturbance may still be louder than the squeal that it leads to, the one after the
    small start is the loudest if there is one. A mode is put down by its place among `names`.
    """
    if not found:
        return
    small = next((each for each in found if each.start.name == SMALL_START), None)
    loudest = max(found, key=attrgetter("velocity")) if settled or small is None else small
    columns["velocity"][k], columns["frequency"][k] = loudest.velocity, loudest.frequency
    columns["time"][k], columns["speed"][k] = loudest.time, loudest.speed
    columns["after"][k] = 0 if small else 1
    if small:
        columns["small_velocity"][k], columns["small_frequency"][k] = small.velocity, small.frequency
    if loudest.start.disturbance is not None and not _is_alike(small, loudest):
        mode = loudest.start.disturbance.mode.split()[0]
        columns["along"][k] = names.index(mode) if mode in names else NONE


def _is_alike(small: LoudestSqueal | None, loudest: LoudestSqueal) -> bool:
    """Whether the small start leads to a squeal as loud, at the same frequency."""
    if small is None:
        return False
    ratios = small.velocity / loudest.velocity, small.frequency / loudest.frequency
    limits = Criteria.same_rms, Criteria.same_frequency
    return all(abs(ratio - 1) < limit for ratio, limit in zip(ratios, limits, strict=True))


REFERENCE = 1e-9  # m/s, of velocity levels by ISO 1683


class CellFound(Finding):
    """A cell by its labels: whether it squeals, by transients and by eigenvalues, and its squeal.

    That is the loudest that was found; of a procedure the one after a small disturbance, if there is one.
    `small_frequency_Hz` and `small_velocity_m_per_s` are those of the squeal after a small disturbance, where there is
    one. `velocity_m_per_s` is the rms velocity of the shoe over its mass and over time, `level_dB` that over 1 nm/s
    (ISO 1683); of a procedure it is that of its loudest 50 ms, in the middle of which are `time_s` and
    `speed_rad_per_s`.
    `disturbance` is the smallest after which the cell squeals, `after` says of a large one that leads to the loudest
    also along which mode it was.
    """

    levels: dict[str, str]
    verdict: CellVerdict
    outcome: str
    unstable: bool | None
    growth_rate_1_per_s: Number
    frequency_Hz: Annotated[Number, Column("frequency", ".4g")]
    velocity_m_per_s: Number
    level_dB: Annotated[Number, Column("level", ".1f")]
    after: Annotated[str | None, Column("after a\ndisturbance", missing="")]
    time_s: Annotated[Number, Column("loudest\nat", ".3g", missing="", optional=True)]
    speed_rad_per_s: Annotated[Number, Column("drum\nspeed", ".3g", missing="", optional=True)]
    small_frequency_Hz: Number
    small_velocity_m_per_s: Number
    disturbance: Literal["small", "large"] | None = None
    columns: ClassVar = "frequency_Hz", "level_dB", "time_s", "speed_rad_per_s", "after"


class NoiseMatrix(Finding):
    """Every cell, how many squeal after a small disturbance and after a large one only, and how many are not clear.

    Cells that were not computed are counted in none of these.
    """

    printed_by = "drumsqueal.questions.sweep.answer.print_matrix"
    title: str
    axes: dict[str, list[str]]
    cells: tuple[CellFound, ...]
    squeal: int
    squeal_after_large_only: int
    not_clear: int
    versions: dict[str, str] = Field(default_factory=versions)
    data: Any = Held

    def __repr__(self) -> str:
        """One line."""
        return f"NoiseMatrix: {self.headline}"

    @property
    def headline(self) -> str:
        """How many cells squeal, are quiet, are not clear, and were not computed."""
        large = f", {self.squeal_after_large_only} of them after a large disturbance only" * bool(self.squeal)
        verdicts = [cell.verdict for cell in self.cells]
        quiet, missing = verdicts.count(CellVerdict.QUIET), verdicts.count(CellVerdict.NOT_COMPUTED)
        others = f", {self.not_clear} not clear" * bool(self.not_clear) + f", {missing} not computed" * bool(missing)
        are = "is" if quiet == 1 else "are"
        return f"{self.squeal} of {len(self.cells)} cells squeal{large}; {quiet} {are} quiet{others}"


def shown_axes(found: NoiseMatrix) -> tuple[str, list[str]]:
    """The axis of the columns, the first that has several levels, and those of the rows that have."""
    several = [name for name, labels in found.axes.items() if len(labels) > 1]
    columns = next((name for name in several if name not in (SCENE, PROCEDURE)), several[0] if several else SCENE)
    return columns, [name for name in several if name != columns]


def in_rows(found: NoiseMatrix) -> tuple[list[str], list[tuple[str, list[CellFound]]]]:
    """The labels of the columns, and of each row its label and cells."""
    across, down = shown_axes(found)
    rows: dict[str, list[CellFound]] = {}
    for cell in found.cells:
        rows.setdefault(", ".join(cell.levels[name] for name in down), []).append(cell)
    return found.axes[across], list(rows.items())


def shown_levels(found: NoiseMatrix, cell: CellFound) -> dict[str, str]:
    """The labels of a cell on the axes that have several levels."""
    across, down = shown_axes(found)
    return {name: cell.levels[name] for name in (*down, across) if len(found.axes[name]) > 1}


def find_matrix(data: xarray.Dataset, plan: MatrixPlan) -> NoiseMatrix:
    """Put the results of all cells into words and numbers."""
    columns = {str(name): np.ravel(each.values) for name, each in data.variables.items()}
    names = names_in(data, "along")
    cells = tuple(_cell(columns, plan, number, names) for number in range(plan.points))
    loud = [cell for cell in cells if cell.verdict is CellVerdict.SQUEALS]
    return NoiseMatrix(
        title=plan.title,
        axes={name: list(levels) for name, levels in plan.axes.items()},
        cells=cells,
        squeal=len(loud),
        squeal_after_large_only=sum(cell.disturbance == "large" for cell in loud),
        not_clear=sum(cell.verdict in (CellVerdict.NOT_CLEAR, CellVerdict.UNDECIDED) for cell in cells),
        data=data,
    )


def _cell(columns: dict[str, np.ndarray], plan: MatrixPlan, number: int, names: Sequence[str]) -> CellFound:
    here = {name: values[number].item() for name, values in columns.items()}
    velocity, disturbance = here["velocity"], ("small", "large", None)[here["after"]]  # which is −1 for none
    along = f", along {names[here['along']]}" if here["along"] >= 0 else ""
    louder = along and f"; the loudest: large{along}"
    return CellFound(
        levels=plan.levels(number),
        verdict=CELL_VERDICTS[here["squeal"]],
        outcome=OUTCOMES[here["outcome"]],
        unstable=None if here["unstable"] < 0 else bool(here["unstable"]),
        growth_rate_1_per_s=here["growth_rate"],
        frequency_Hz=here["frequency"],
        velocity_m_per_s=velocity,
        level_dB=20 * math.log10(velocity / REFERENCE) if velocity > 0 else math.nan,
        after=disturbance and f"{disturbance}{louder if disturbance == 'small' else along}",
        time_s=here["time"],
        speed_rad_per_s=here["speed"],
        small_frequency_Hz=here["small_frequency"],
        small_velocity_m_per_s=here["small_velocity"],
        disturbance=disturbance,
    )
