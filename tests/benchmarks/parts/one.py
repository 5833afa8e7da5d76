"""One transient, work against precision: drumsqueal and what a good engineer would write by hand.

What each side does more than the other: `transient` also integrates the work of friction, and computes torque, forces,
extent of the contact and energies at every sample; bare states and peers do not. The peers know this one scene: its
effects are written out, its right-hand side has no seventh state, and numba compiles that for them ahead. SciPy and
CVODE call it from Python or C once an evaluation, as they must; numbalsoda calls it as a C function. One thread each.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np

from drumsqueal.physics.model import build_model
from drumsqueal.simulation import Prepared, prepare, transient
from drumsqueal.solve.transient.batch import integrate_many
from peers.parameters import parameters_of
from peers.reference import Reference, solve_reference, trajectory_error
from peers.solvers import CONTENDERS, MISSING, Contender

from .curves import Curve, ratio_cells, ratios
from .pictures import draw_one
from .record import Record
from .scenes import DURATION, SAMPLE_RATE, START, TIMES, growing_scene

OURS, BARE = "drumsqueal, all of a run", "drumsqueal, bare states"
ERRORS = 10.0 ** -np.arange(1, 9)
HALF_DECADES, DECADES = 10 ** -np.arange(2, 12.01, 0.5), 10.0 ** -np.arange(5, 13)
GRID_TOLERANCES = 10.0 ** -np.arange(4, 9)
ROUNDS, SLOW, SLOW_ROUNDS = 7, 0.3, 3  # what takes longer than SLOW (s) sits out the rounds after that many
PATIENCE = 5.0  # s; what takes longer is not repeated, nor asked for a smaller tolerance


class Runner(NamedTuple):
    """A contender: states (samples, 6) at a tolerance, and the tolerances that span errors of 1e-1 to 1e-8."""

    name: str
    states: Callable[[float], np.ndarray]
    tolerances: np.ndarray
    compiling: float


class Course(NamedTuple):
    """What was measured of a runner: per tolerance its error (NaN: failed or not run) and the seconds of each round."""

    runner: Runner
    errors: list[float]
    seconds: list[list[float]]

    def curve(self) -> Curve:
        """Medians over the rounds."""
        times = [median(each) if each else np.nan for each in self.seconds]
        return Curve(self.runner.name, self.runner.tolerances, np.array(self.errors), np.array(times))


def measure(record: Record, folder: Path) -> None:
    """Measure, print, judge and draw."""
    if "numbalsoda" not in MISSING:
        record.say("one: a line that begins with [lsoda] is numbalsoda's own, where it fails")
    record.say("one: " + (f"without {' and '.join(MISSING)}, not installed" if MISSING else "all peers are installed"))
    scene = growing_scene()
    parameters = parameters_of(scene)
    reference = solve_reference(parameters, START, TIMES)
    prepared = _prepare(record)
    _compile_forces(record, parameters)
    runners = [*_own(prepared), *(_peer(each, parameters) for each in CONTENDERS)]
    courses = take_turns(runners, reference)
    for course in courses:
        _keep(record, course)
    curves = [course.curve() for course in courses]
    record.keep("one", "reference", "uncertainty", "1", reference.uncertainty)
    _say_what_was_left_out(record, courses)
    _show(record, curves, reference.uncertainty)
    _judge(record, curves)
    draw_one(curves, reference.uncertainty, folder / "speed_one.png")


def _prepare(record: Record) -> Prepared:
    """Models, steady sliding and eigenvalues: before the transient, as the peers' parameters are."""
    seconds = []
    for _ in range(4):
        before = time.perf_counter()
        prepared = prepare(growing_scene())
        seconds.append(time.perf_counter() - before)
    record.keep("one", OURS, "compiling what prepares", "s", seconds[0] - median(seconds[1:]))
    record.keep("one", OURS, "preparing", "s", seconds[1:])
    record.say(f"prepare(scene): {1e3 * median(seconds[1:]):.3g} ms, and {seconds[0]:.3g} s when compiled; timed apart")
    return prepared


def _compile_forces(record: Record, parameters: np.ndarray) -> None:
    """What numba takes to compile the peers' right-hand side, in a process that has not."""
    code = (
        "import sys, time, numpy, numba; before = time.perf_counter(); "
        "from peers.right_hand_side import right_hand_side as forces; "
        f"forces(numpy.zeros(6), numpy.array({parameters.tolist()}), numpy.zeros(6)); "
        "sys.stdout.write(str(time.perf_counter() - before))"
    )
    command, here = [sys.executable, "-c", code], Path(__file__).parents[1]
    done = subprocess.run(command, cwd=here, check=True, capture_output=True, text=True)
    record.keep("one", "peers", "compiling the right-hand side, with its imports", "s", float(done.stdout))
    record.say(f"numba compiles the peers' right-hand side in {float(done.stdout):.3g} s; timed apart")


def _own(prepared: Prepared) -> list[Runner]:
    model = build_model(prepared.scene)

    def whole(tolerance: float) -> np.ndarray:
        simulate = prepared.scene.simulate.model_copy(update={"tolerance": float(tolerance)})
        chunks = list(transient(prepared._replace(scene=prepared.scene.model_copy(update={"simulate": simulate}))))
        return np.concatenate([np.concatenate([each.displacement, each.velocity], axis=1) for each in chunks])

    def bare(tolerance: float) -> np.ndarray:
        start = np.zeros(3), START[:3], START[3:]
        options = {"duration": DURATION, "sample_rate": SAMPLE_RATE, "tolerance": tolerance, "threads": 1}
        batches = list(integrate_many([model], *(each[None] for each in start), **options))
        return np.concatenate([np.concatenate([each.vibration[0], each.velocity[0]], axis=1) for each in batches])

    return [Runner(name, run, HALF_DECADES, _first(run)) for name, run in ((OURS, whole), (BARE, bare))]


def _first(run: Callable[[float], object]) -> float:
    """Seconds that the first call takes more than the second."""
    seconds = []
    for _ in range(2):
        before = time.perf_counter()
        run(1e-2)
        seconds.append(time.perf_counter() - before)
    return seconds[0] - seconds[1]


def _peer(contender: Contender, parameters: np.ndarray) -> Runner:
    def run(tolerance: float) -> np.ndarray:
        return contender.solve(parameters, START, TIMES, tolerance).states

    # Without the right-hand side, which all of them share and `_compile_forces` has timed.
    compiling = _first(lambda _: contender.warm_up(parameters, START))
    fine = HALF_DECADES[6:] if contender.name.startswith("numbalsoda") else DECADES
    return Runner(contender.name, run, GRID_TOLERANCES if "NumPy" in contender.name else fine, compiling)


def take_turns(runners: list[Runner], reference: Reference) -> list[Course]:
    """Round after round through all runners at all tolerances, so that a noisy machine slows them alike."""
    courses = [Course(each, [np.nan] * len(each.tolerances), [[] for _ in each.tolerances]) for each in runners]
    for round_number in range(ROUNDS):
        for k in range(max(len(each.tolerances) for each in runners)):
            for course in courses:
                if k < len(course.runner.tolerances) and _is_due(course, k, round_number):
                    _run(course, k, reference)
    return courses


def _is_due(course: Course, k: int, round_number: int) -> bool:
    if round_number == 0:
        return not any(sum(each[:1]) > PATIENCE for each in course.seconds[:k])
    first = course.seconds[k][:1]
    return bool(first) and (first[0] < SLOW or (round_number < SLOW_ROUNDS and first[0] < PATIENCE))


def _run(course: Course, k: int, reference: Reference) -> None:
    before = time.perf_counter()
    try:
        states = course.runner.states(course.runner.tolerances[k])
    except RuntimeError:
        states = None
    course.seconds[k].append(time.perf_counter() - before)
    if states is not None:
        # Below its uncertainty the reference does not tell errors apart.
        course.errors[k] = max(trajectory_error(states, reference.states), reference.uncertainty)


def _keep(record: Record, course: Course) -> None:
    name = course.runner.name
    record.keep("one", name, "compiling", "s", course.runner.compiling)
    for tolerance, error, seconds in zip(course.runner.tolerances, course.errors, course.seconds, strict=True):
        setting = f"tolerance {tolerance:.2g}"
        if seconds:
            record.keep("one", name, "time", "s", seconds, setting)
            record.keep("one", name, "error", "1", error, setting)


def _say_what_was_left_out(record: Record, courses: list[Course]) -> None:
    for course in courses:
        left = [f"{t:.0e}" for t, each in zip(course.runner.tolerances, course.seconds, strict=True) if not each]
        if left:
            record.say(f"{course.runner.name}: not run at tolerance {', '.join(left)}, after one over {PATIENCE:g} s")
        failed = [
            f"{t:.0e}"
            for t, error, each in zip(course.runner.tolerances, course.errors, course.seconds, strict=True)
            if each and np.isnan(error)
        ]
        if failed:
            record.say(f"{course.runner.name}: failed at tolerance {', '.join(failed)}")


def _show(record: Record, curves: list[Curve], uncertainty: float) -> None:
    ours = curves[0]
    record.show(
        f"One transient of 0.1 s: time at an error (ms); the reference is good to {uncertainty:.0e}",
        ("error", *(f"{error:.0e}" for error in ERRORS), ""),
        [[each.name, *ratio_cells(each, [1e3 * each.time_at(error) for error in ERRORS])] for each in curves],
    )
    found = ratios(curves[1:], ours, ERRORS)
    record.show(
        "Time over drumsqueal's at the same error",
        ("error", *(f"{error:.0e}" for error in ERRORS), ""),
        [[each.name, *ratio_cells(each, found[each.name])] for each in curves[1:]],
    )


def _judge(record: Record, curves: list[Curve]) -> None:
    ours, by_name = curves[0], {curve.name: curve for curve in curves}
    numba = [curve for curve in curves if curve.name.endswith("numba")]
    aims = [
        ("at least 2 times faster than SciPy and CVODE with numba", 2.0, numba),
        ("at least 100 times faster than SciPy with NumPy", 100.0, [each for each in curves if "NumPy" in each.name]),
        ("ahead of numbalsoda's LSODA", 1.0, [by_name[n] for n in ["numbalsoda LSODA"] if n in by_name]),
        ("beside numbalsoda's DOP853", None, [by_name[n] for n in ["numbalsoda DOP853"] if n in by_name]),
    ]
    for wanted, factor, rivals in aims:
        _aim(record, wanted, factor, rivals, ours)


def _aim(record: Record, wanted: str, factor: float | None, rivals: list[Curve], ours: Curve) -> None:
    """Judge by the smallest ratio over the rivals and over the errors that both reach, 1e-1 and a rival's best too."""
    found = []
    for rival in rivals:
        # NumPy on a grid reaches none of the smaller errors: it is met at the best error that it has.
        errors = [*ERRORS[1:], *([rival.best, 0.1] if "NumPy" in rival.name else [])]
        found += [(rival.time_at(e) / ours.time_at(e), e, rival.name) for e in errors]
    found = [each for each in found if np.isfinite(each[0])]
    if not found:
        record.aim("one", wanted, "no such peer at hand", None)
        return
    least, most = min(found), max(found)
    reached = f"{least[0]:.3g} ({least[2]} at {least[1]:.0e}) to {most[0]:.3g} times ({most[2]} at {most[1]:.0e})"
    if factor is None:
        record.aim("one", wanted, reached, None, "no target")
    else:
        record.aim("one", wanted, reached, least[0] >= factor, f"by {factor / least[0]:.2g} times")
