"""What is computed of each cell of a noise matrix: where a small start and large disturbances lead, or how loud the
loudest moment of a procedure is."""

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import SteadyStateError
from drumsqueal.findings.boundaries import pressure_fraction, slip_fraction
from drumsqueal.findings.decay import BEYOND, NEARLY_LINEAR
from drumsqueal.findings.signals.spectra import amplitude_spectrum, spectral_peaks
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress
from drumsqueal.questions.matrix.table import WINDOW, MatrixPlan
from drumsqueal.questions.onset.attractors import Family, How, Start, find_attractors
from drumsqueal.questions.onset.found import Leads, Row
from drumsqueal.questions.onset.kicks import directions
from drumsqueal.questions.sweep.points import COMPUTED, FAILED, FOLDED, NOWHERE, Columns, blank
from drumsqueal.questions.sweep.starts import point_of, round_of
from drumsqueal.scene import COORDINATES, Scene
from drumsqueal.solve.linear.branches import Point
from drumsqueal.solve.linear.modes import Stability, analyse_stability
from drumsqueal.solve.transient.batch import integrate_many

SMALL = "small"
QUIET, SQUEALS, UNCLEAR = 0, 1, 2
TURNS = 0.02  # of the largest drum speed: below it the drum all but stands, and what slips back is no squeal


class Cell(NamedTuple):
    """A scene at the start of its procedure, with its models and where it slides."""

    scene: Scene
    model: Model
    stability: Stability
    family: Family
    point: Point

    @property
    def starts(self) -> list[Start]:
        """A small start, and a large disturbance along each mode."""
        large = (each.start(each.sizes[-1]) for each in directions(self.point, self.family, (1,)))
        return [self.family.small_start(self.point, self.model), *large]


class Loudest(NamedTuple):
    """The loudest squeal after a start: rms velocity (m/s), frequency (Hz), and when (s) and at which speed (rad/s)."""

    start: str
    velocity: float
    frequency: float
    time: float = math.nan
    speed: float = math.nan


def compute_cells(plan: MatrixPlan, first: int, stop: int, threads: int | None, look: Callable[[], None]) -> Columns:
    """Every variable of the cells from number `first` to `stop`."""
    columns = blank(plan, stop - first)
    for k in range(stop - first):
        look()
        scene, procedure = plan.scene_at(first + k)
        cell = _prepared(procedure.over(scene), columns, k)
        if cell is None:
            continue
        columns["growth_rate"][k] = max((mode.growth_rate for mode in cell.stability.modes), default=np.nan)
        columns["unstable"][k] = bool(cell.stability.unstable)
        found, unclear, failed = (_through if procedure.time else _lasting)(cell, threads, lambda *_: look())
        columns["outcome"][k] = FAILED if failed else COMPUTED
        columns["squeal"][k] = SQUEALS if found else UNCLEAR if unclear or failed else QUIET
        _note(columns, k, found)
    return columns


def _prepared(scene: Scene, columns: Columns, k: int) -> Cell | None:
    """The models of a scene; None, with the reason in the columns, where it does not slide or its samples fold."""
    model = build_model(scene)
    try:
        stability = analyse_stability(build_model(scene, coordinates=linear_coordinates(scene)))
    except SteadyStateError as error:
        columns["outcome"][k] = NOWHERE[error.reason]
        return None
    if scene.simulate.sample_rate < 2 * stability.highest_frequency_Hz:
        columns["outcome"][k] = FOLDED
        return None
    family = Family(lambda _: model, model.names, stability.coordinates)
    return Cell(scene, model, stability, family, point_of(0, stability))


def _how(cell: Cell, threads: int | None) -> How:
    simulate, seconds = cell.scene.simulate, round_of(cell.stability, cell.model.names)
    return How(simulate.sample_rate, simulate.tolerance, seconds, simulate.solver, threads)


def _lasting(cell: Cell, threads: int | None, progress: Progress) -> tuple[list[Loudest], bool, bool]:
    """The squeals at constant speed and load by the start that leads to each, whether any is unclear, or failed."""
    tasks = [(cell.point, start) for start in cell.starts]
    responses = list(find_attractors(cell.family, tasks, _how(cell, threads), progress=progress))
    row = Row.at(cell.point, *responses, asked=True)
    found = [
        Loudest(each.start, _rms(cell.model, each.motion.kinetic_energy_J), each.motion.frequency_Hz or math.nan)
        for each in row.starts
        if each.motion is not None
    ]
    leads = {each.leads_to for each in row.starts}
    return found, bool(leads & {Leads.UNDECIDED, Leads.GROWS, Leads.RUNS_AWAY}), Leads.FAILED in leads


def _through(cell: Cell, threads: int | None, progress: Progress) -> tuple[list[Loudest], bool, bool]:
    """The loudest squeal of a procedure from each start, in windows of 50 ms beyond a contact boundary.

    That none is unclear, and whether any failed.
    """
    starts, simulate = cell.starts, cell.scene.simulate
    steady = cell.family.shown(cell.stability.steady_state)
    loudest: list[Loudest | None] = [None] * len(starts)
    slowest = max((mode.growth_rate for mode in cell.family.modes(cell.point)), default=0.0)
    ended = np.full(len(starts), np.inf)  # s, where one has failed; where the drum all but stands that does not matter
    held: list[list[tuple[NDArray, NDArray, NDArray]]] = [[] for _ in starts]
    stream = integrate_many(
        [cell.model] * len(starts), np.array([steady] * len(starts)), np.array([each.vibration for each in starts]),
        np.array([each.velocity for each in starts]), duration=simulate.duration, sample_rate=simulate.sample_rate,
        tolerance=simulate.tolerance, solver=simulate.solver, threads=threads,
    )  # fmt: skip
    samples = round(WINDOW * simulate.sample_rate)
    with closing(stream):
        for chunk in stream:
            progress("procedure", float(chunk.time[-1]), simulate.duration)
            for k, start in enumerate(starts):
                sound = np.isfinite(chunk.velocity[k]).all(axis=1)
                if not sound.all():
                    ended[k] = min(ended[k], chunk.time[sound.argmin()])
                held[k].append((chunk.time[sound], chunk.vibration[k][sound], chunk.velocity[k][sound]))
                while sum(len(part[0]) for part in held[k]) >= samples:
                    time, vibration, velocity = (np.concatenate(parts) for parts in zip(*held[k], strict=True))
                    window = slice(0, samples)
                    heard = _heard(cell.model, start.name, time[window], vibration[window], velocity[window], slowest)
                    loudest[k] = max((each for each in (loudest[k], heard) if each), key=_how_loud, default=None)
                    held[k] = [(time[samples:], vibration[samples:], velocity[samples:])]
    return [each for each in loudest if each is not None], False, any(_turns(cell.model, each) for each in ended)


def _turns(model: Model, time: float | NDArray) -> bool:
    """Whether the drum turns at all times (s) of a window, and does not all but stand."""
    schedule = model.operation.drum_speed
    fastest = np.abs(np.asarray(getattr(schedule, "value", 0.0))).max()
    return bool(np.all(np.isfinite(time)) and np.abs(schedule.at(time)[0]).min() >= TURNS * fastest)


def _how_loud(squeal: Loudest) -> float:
    return squeal.velocity


def _heard(
    model: Model, start: str, time: NDArray, vibration: NDArray, velocity: NDArray, linear: float
) -> Loudest | None:
    """The squeal in a window; None where the motion stays within the contact boundaries, or the drum all but stands.

    Nor is it squeal where the motion falls, relative to the drum's speed, more than half as fast as the mode that
    decays slowest (1/s): that is a disturbance which decays.
    """
    moments = model.operation.at(time)
    speed = np.broadcast_to(np.asarray(moments.drum_speed), time.shape)
    if not _turns(model, time):
        return None
    q, v = (dict(zip(model.names, columns.T, strict=True)) for columns in (vibration, velocity))
    beyond = [pressure_fraction(model, q, moments.preload), slip_fraction(model, v, speed)]
    if max(float(each.max()) for each in beyond) < BEYOND:
        return None
    energies = velocity**2 @ np.asarray(model.mass) / 2
    energy, sizes = float(energies.mean()), np.sqrt([half.mean() for half in np.array_split(energies / speed**2, 2)])
    if linear < 0 and np.log(sizes[1] / sizes[0]) < NEARLY_LINEAR * linear * (time[-1] - time[0]) / 2:
        return None
    middle = len(time) // 2
    return Loudest(start, _rms(model, energy), _line(model, time, velocity), float(time[middle]), float(speed[middle]))


def _line(model: Model, time: NDArray, velocity: NDArray) -> float:
    """Frequency (Hz) of the line with most kinetic energy."""
    rate, best = (len(time) - 1) / float(time[-1] - time[0]), (0.0, math.nan)
    for k, mass in enumerate(np.asarray(model.mass)):
        if np.ptp(velocity[:, k]) > 0:
            peaks = spectral_peaks(amplitude_spectrum(velocity[:, k], rate), count=1, floor=0.5)
            best = max(best, *zip((mass * peaks.amplitude**2).tolist(), peaks.frequency_Hz.tolist(), strict=True))
    return best[1]


def _rms(model: Model, kinetic_energy: float) -> float:
    """√(2 T/m): the rms velocity (m/s) of the shoe, over its mass and over time, by the mean kinetic energy T (J)."""
    mass = dict(zip(model.names, np.asarray(model.mass).tolist(), strict=True))
    return math.sqrt(2 * kinetic_energy / mass.get("Y", mass[model.names[0]]))


def _note(columns: Columns, k: int, found: Sequence[Loudest]) -> None:
    """Put down the loudest squeal and, where a small start squeals, that."""
    small = next((each for each in found if each.start == SMALL), None)
    if small is not None:
        columns["small_velocity"][k], columns["small_frequency"][k] = small.velocity, small.frequency
    if not found:
        return
    loudest = max(found, key=_how_loud)
    columns["velocity"][k], columns["frequency"][k] = loudest.velocity, loudest.frequency
    columns["time"][k], columns["speed"][k] = loudest.time, loudest.speed
    columns["after"][k] = 0 if small is not None else 1
    name = loudest.start.removeprefix("kick ").split(" ")[0]
    if name in COORDINATES:
        columns["along"][k] = COORDINATES.index(name)
