"""One transient, work against precision: drumsqueal and what a good engineer would write by hand.

What each side does more than the other: `transient` also integrates the work of friction, and computes torque, forces,
extent of the contact and energies at every sample; bare states and peers do not. The peers know this one scene: its
effects are written out, its right-hand side has no seventh state, and numba compiles that for them ahead. SciPy and
CVODE call it from Python or C once an evaluation, as they must; numbalsoda calls it as a C function. diffrax's own loop
integrates drumsqueal's equations, as bare states, with the same measure of errors. One thread each.
"""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, cast

import diffrax
import numpy as np

from drumsqueal.physics.model import build_model
from drumsqueal.problem import diffrax_problem
from drumsqueal.simulation import Prepared, prepare, transient
from drumsqueal.solve.transient.integrate import integrate_many
from peers.parameters import parameters_of
from peers.reference import Reference, solve_reference, trajectory_error
from peers.solvers import CONTENDERS, MISSING

from .curves import Curve, cells, ratios
from .pictures import draw_one
from .record import Record
from .scenes import DURATION, SAMPLE_RATE, START, TIMES, growing_scene
from .turns import PATIENCE, take_turns

OURS, BARE, RIVAL = "drumsqueal, all of a run", "drumsqueal, bare states", "numbalsoda LSODA"
THEIRS = "diffrax's own loop"
ERRORS = 10.0 ** -np.arange(1, 9)
AHEAD = 10.0 ** -np.arange(2, 7)  # of numbalsoda's LSODA, at these errors
HALF_DECADES, DECADES = 10 ** -np.arange(2, 12.01, 0.5), 10.0 ** -np.arange(5, 13)
GRID_TOLERANCES = 10.0 ** -np.arange(4, 9)
ROUNDS, SLOW, SLOW_ROUNDS = 7, 0.3, 3  # what takes longer than SLOW (s) sits out the rounds after that many
LOOSE = 1e-2


class Runner(NamedTuple):
    """A configuration: states (samples, 6) at a tolerance, and the tolerances that span errors of 1e-1 to 1e-8."""

    name: str
    states: Callable[[float], np.ndarray]
    tolerances: np.ndarray


def measure(record: Record, folder: Path) -> None:
    """Measure, print, judge and draw."""
    record.say("one: " + (f"without {' and '.join(MISSING)}, not installed" if MISSING else "all peers are installed"))
    scene = growing_scene()
    parameters = parameters_of(scene)
    reference = solve_reference(parameters, START, TIMES)
    record.keep("one", "reference", "uncertainty", "1", reference.uncertainty)
    curves = compare([*_own(prepare(scene)), *_peers(parameters)], reference)
    for curve in curves:
        _keep(record, curve)
    _show(record, curves, reference.uncertainty)
    _judge(record, curves)
    draw_one(curves, reference.uncertainty, folder / "speed_one.png")


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

    start = {"displacement": START[:3], "velocity": START[3:]}
    problems = {t: diffrax_problem(model, start, DURATION, sample_rate=SAMPLE_RATE, tolerance=t) for t in HALF_DECADES}

    def by_diffrax(solver: diffrax.AbstractSolver, tolerance: float) -> np.ndarray:
        found = diffrax.diffeqsolve(solver=solver, **problems[tolerance])
        return np.concatenate(cast("Any", found.ys), axis=1)

    solvers = diffrax.Tsit5(), diffrax.Dopri8()
    return [
        Runner(OURS, whole, HALF_DECADES),
        Runner(BARE, bare, HALF_DECADES),
        *(Runner(f"{THEIRS}, {type(each).__name__}", partial(by_diffrax, each), HALF_DECADES) for each in solvers),
    ]


def _peers(parameters: np.ndarray) -> list[Runner]:
    runners = []
    for each in CONTENDERS:
        fine = HALF_DECADES[6:] if each.name.startswith("numbalsoda") else DECADES
        tolerances = GRID_TOLERANCES if "NumPy" in each.name else fine
        runners.append(
            Runner(each.name, lambda t, each=each: each.solve(parameters, START, TIMES, t).states, tolerances)
        )
    return runners


def compare(runners: list[Runner], reference: Reference) -> list[Curve]:
    """Round after round through all runners at all tolerances; the first call of each compiles."""

    def states(runner: Runner, tolerance: float) -> np.ndarray | None:
        try:
            return runner.states(tolerance)
        except RuntimeError:
            return None

    calls = {}
    for k in range(max(len(runner.tolerances) for runner in runners)):
        for runner in runners:
            if k == 0:
                states(runner, LOOSE)
            if k < len(runner.tolerances):
                calls[runner.name, k] = partial(states, runner, runner.tolerances[k])
    seconds, results = take_turns(calls, ROUNDS, _is_due)

    def error(key: tuple[str, int]) -> float:
        # Below its uncertainty the reference does not tell errors apart.
        found = results.get(key)
        return np.nan if found is None else max(trajectory_error(found, reference.states), reference.uncertainty)

    curves = []
    for name, _, tolerances in runners:
        keys = [(name, k) for k in range(len(tolerances))]
        curves.append(Curve(name, tolerances, np.array([error(key) for key in keys]), [seconds[key] for key in keys]))
    return curves


def _is_due(key: tuple[str, int], seconds: Mapping[tuple[str, int], list[float]]) -> bool:
    """What takes longer than PATIENCE is not repeated, nor asked for a smaller tolerance."""
    name, k = key
    done = seconds[key]
    if not done:
        return not any(sum(seconds[name, looser][:1]) > PATIENCE for looser in range(k))
    return done[0] < SLOW or (len(done) < SLOW_ROUNDS and done[0] < PATIENCE)


def _keep(record: Record, curve: Curve) -> None:
    for tolerance, error, seconds in zip(curve.tolerances, curve.errors, curve.seconds, strict=True):
        if seconds:
            record.keep("one", curve.name, "time", "s", seconds, f"tolerance {tolerance:.2g}")
            record.keep("one", curve.name, "error", "1", error, f"tolerance {tolerance:.2g}")
        if not seconds or np.isnan(error):
            why = "failed" if seconds else f"not run, after one over {PATIENCE:g} s"
            record.say(f"{curve.name}: {why} at tolerance {tolerance:.0e}")


def _show(record: Record, curves: list[Curve], uncertainty: float) -> None:
    headings = [f"{error:.0e}" for error in ERRORS]
    rows = [
        [each.name, *cells([1e3 * each.time_at(e) for e in ERRORS]), f"{each.scatter:.2f}", f"{each.best:.0e}"]
        for each in curves
    ]
    title = f"One transient of 0.1 s: fastest round (ms) at an error; the reference is good to {uncertainty:.0e}"
    record.show(title, ("error", *headings, "median/fastest", "best error"), rows)
    found = ratios(curves[1:], curves[0], ERRORS)
    rows = [[name, *cells(values)] for name, values in found.items()]
    record.show("Time over drumsqueal's at the same error", ("error", *headings), rows)


def _judge(record: Record, curves: list[Curve]) -> None:
    aims = [
        ("at least 2 times faster than SciPy and CVODE with numba", 2.0, ", numba", ERRORS[1:]),
        ("at least 100 times faster than SciPy with NumPy", 100.0, "NumPy", ERRORS),
        ("ahead of diffrax's own loop", 1.0, THEIRS, ERRORS),
        ("ahead of numbalsoda's LSODA from 1e-2 to 1e-6", 1.0, RIVAL, AHEAD),
    ]
    for wanted, factor, name, errors in aims:
        found = [
            (rival.time_at(e) / curves[0].time_at(e), e, rival.name)
            for rival in curves
            if name in rival.name
            for e in [*errors, *([rival.best] if "NumPy" in name else [])]
        ]
        found = [each for each in found if np.isfinite(each[0])]
        if not found:
            record.aim("one", wanted, "no such peer at hand", None)
            continue
        least, most = min(found), max(found)
        reached = f"{least[0]:.3g} ({least[2]} at {least[1]:.0e}) to {most[0]:.3g} times ({most[2]} at {most[1]:.0e})"
        record.aim("one", wanted, reached, least[0] >= factor, f"by {factor / least[0]:.2g} times")
