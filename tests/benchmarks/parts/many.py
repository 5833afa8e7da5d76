"""256 transients over drum speeds, from a drum at rest: drumsqueal against numbalsoda, in one and two workers.

The lining of the first sticks, that of the second sticks now and then, and where numbalsoda fails nothing is compared.
All sample the same 51 times (1 kHz), so that little is handed over. Each side is warm: compiled, its threads, processes
or workers of Dask waiting. drumsqueal also integrates the work of friction; the peers also count their evaluations.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from drumsqueal.physics.model import Model, build_model
from drumsqueal.solve.transient.integrate import integrate_many
from peers.batch import solve_batch, warm_processes
from peers.parameters import parameters_of
from peers.reference import trajectory_error
from peers.solvers import MISSING

from .curves import Curve, cells
from .pictures import draw_many
from .record import Record
from .scenes import START, growing_scene
from .turns import scatter, take_turns

SPEEDS, DURATION, SAMPLE_RATE = np.linspace(0.0, 8.0, 256), 0.05, 1e3
TIMES = np.arange(round(DURATION * SAMPLE_RATE) + 1) / SAMPLE_RATE
OURS, RIVAL, SHARP = "drumsqueal", "numbalsoda LSODA", "numbalsoda DOP853"
ROUNDS, FACTOR, BOTH = 5, 2.0, 2
# They span median errors of some 1e-3 to 1e-6; the third ones are alike, and serve where one of each has to do.
TOLERANCES = {OURS: (1e-3, 1e-4, 1e-5, 1e-7), RIVAL: (1e-7, 1e-8, 1e-9, 1e-11)}
ALIKE, SHARPEST = 2, 1e-12
ERRORS = 10.0 ** -np.arange(2, 7)
QUANTILES = {"median error": 0.5, "error of 9 in 10": 0.9}
MORE, MOST = 1024, 100_000  # transients: measured, and what that comes to
AT_ONCE = 16  # transients a task of Dask


def measure(record: Record, folder: Path) -> None:
    """Measure, print, judge and draw."""
    if RIVAL.split()[0] in MISSING:
        record.aim("many", "at least 2 times numbalsoda in two processes", "numbalsoda is not installed", None)
        return
    scene = growing_scene()
    parameters = parameters_of(scene)
    with ExitStack() as stack:
        pools = {k: stack.enter_context(warm_processes((RIVAL, SHARP), parameters, START, k)) for k in (1, BOTH)}

        def rival(workers: int, tolerance: float, speeds: np.ndarray, name: str = RIVAL) -> np.ndarray:
            return solve_batch(pools[workers], name, parameters, START, speeds, TIMES, tolerance).states

        def ours(workers: int, tolerance: float, speeds: np.ndarray) -> np.ndarray:
            return integrate_all(speeds, tolerance, workers)

        sharp = rival(BOTH, SHARPEST, SPEEDS, SHARP)
        ours(BOTH, TOLERANCES[OURS][0], SPEEDS[:BOTH])  # compiles, also what sticks and what is implicit
        sides = {OURS: ours, RIVAL: rival}
        curves = compare(record, sides, sharp)
        _judge(record, curves)
        grow(record, sides)
    median, most = (list(each.values()) for each in curves.values())
    draw_many(dict(zip(QUANTILES, (median, most), strict=True)), len(SPEEDS), folder / "speed_many.png")


def integrate_all(speeds: np.ndarray, tolerance: float, threads: int) -> np.ndarray:
    """States (speeds, times, 6)."""
    models, zero = models_of(speeds), np.zeros((len(speeds), 3))
    start = np.tile(START, (len(speeds), 1))
    options = {"duration": DURATION, "sample_rate": SAMPLE_RATE, "tolerance": tolerance, "threads": threads}
    batches = list(integrate_many(models, zero, start[:, :3], start[:, 3:], **options))
    return np.concatenate([np.concatenate([b.vibration, b.velocity], axis=2) for b in batches], axis=1)


_MODELS: dict[float, Model] = {}


def models_of(speeds: np.ndarray) -> list[Model]:
    """One a speed, built once, as the peers' parameters are."""
    scene = growing_scene()
    for speed in speeds:
        if speed not in _MODELS:
            _MODELS[speed] = build_model(scene, {"drum.speed": speed})
    return [_MODELS[speed] for speed in speeds]


Side = Callable[[int, float, np.ndarray], np.ndarray]


def compare(record: Record, sides: dict[str, Side], sharp: np.ndarray) -> dict[str, dict[str, Curve]]:
    """Work against precision in two workers, by quantile of the error and configuration."""
    keys = [(name, k) for k in range(len(TOLERANCES[OURS])) for name in sides]
    calls = {(name, k): partial(sides[name], BOTH, TOLERANCES[name][k], SPEEDS) for name, k in keys}
    seconds, states = take_turns(calls, ROUNDS)
    errors = {key: np.array([trajectory_error(*pair) for pair in zip(states[key], sharp, strict=True)]) for key in keys}
    rows = []
    for name, k in keys:
        setting, found, taken = f"tolerance {TOLERANCES[name][k]:.0e}", errors[name, k], seconds[name, k]
        failed = int(np.isnan(states[name, k]).any(axis=(1, 2)).sum())
        record.keep("many", name, "time", "s", taken, setting)
        record.keep("many", name, "failed", "1", failed, setting)
        rows.append([name, setting, *(f"{np.nanquantile(found, q):.1e}" for q in QUANTILES.values()), str(failed)])
        rows[-1] += [f"{len(SPEEDS) / min(taken):.3g}", f"{scatter(taken):.2f}"]
    title = (
        f"{len(SPEEDS)} transients of {1e3 * DURATION:.0f} ms in two workers; errors against DOP853 at {SHARPEST:.0e}"
    )
    rows.sort(key=lambda row: list(sides).index(row[0]))
    record.show(title, ("configuration", "", *QUANTILES, "failed", "transients/s", "median/fastest"), rows)

    def curve(name: str, quantile: float) -> Curve:
        own = range(len(TOLERANCES[name]))
        found = np.array([np.nanquantile(errors[name, k], quantile) for k in own])
        return Curve(name, np.array(TOLERANCES[name]), found, [seconds[name, k] for k in own])

    return {label: {name: curve(name, quantile) for name in sides} for label, quantile in QUANTILES.items()}


def _judge(record: Record, curves: dict[str, dict[str, Curve]]) -> None:
    """The throughput ratios at every error that both reach, and the worst of them for the target."""
    found = {
        label: [both[RIVAL].time_at(error) / both[OURS].time_at(error) for error in ERRORS]
        for label, both in curves.items()
    }
    rows = [[label, *cells(values)] for label, values in found.items()]
    record.show("Throughput over numbalsoda's at equal error", ("at", *(f"{e:.0e}" for e in ERRORS)), rows)
    every = [value for values in found.values() for value in values if np.isfinite(value)]
    wanted = f"at least {FACTOR:g} times {RIVAL} in two processes"
    if every:
        reached = f"{min(every):.3g} to {max(every):.3g} times"
        record.aim("many", wanted, reached, min(every) >= FACTOR, f"by {FACTOR / min(every):.2g} times")
    else:
        record.aim("many", wanted, "no error that both reach", None)


def grow(record: Record, sides: dict[str, Side]) -> None:
    """Time of a transient in one and two workers, also of Dask, and what it comes to for very many."""
    many = np.linspace(SPEEDS[0], SPEEDS[-1], MORE)
    models_of(many)
    with ExitStack() as stack:
        calls = {}
        for workers in (1, BOTH):
            for name, side in sides.items():
                calls[name, workers] = partial(side, workers, TOLERANCES[name][ALIKE], many)
            dask = stack.enter_context(dask_workers(workers))
            calls["drumsqueal, Dask", workers] = partial(dask, TOLERANCES[OURS][ALIKE], many)
        seconds, _ = take_turns(calls, 2)
    rows = []
    for (name, workers), taken in seconds.items():
        each = min(taken) / MORE
        record.keep("many", name, "time of a transient", "s", [every / MORE for every in taken], f"{workers} workers")
        gain = min(seconds[name, 1]) / min(taken)
        rows.append([name, str(workers), f"{1e3 * each:.3g}", f"{gain:.2f}", f"{MOST * each / 60:.3g}"])
    rows.sort(key=lambda row: row[0])
    title = f"{MORE} transients of {1e3 * DURATION:.0f} ms, and what {MOST:,} would take"
    record.show(title, ("configuration", "workers", "ms each", "gain", f"min for {MOST:,}"), rows)


@contextmanager
def dask_workers(workers: int) -> Iterator[Callable[[float, np.ndarray], np.ndarray]]:
    """Processes of Dask with a thread each, warm; what they are called with is split into small tasks."""
    from distributed import Client, LocalCluster

    path = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parents[1]), path])
    with LocalCluster(workers, threads_per_worker=1, dashboard_address=":0") as cluster, Client(cluster) as client:

        def integrate(tolerance: float, speeds: np.ndarray) -> np.ndarray:
            parts = np.array_split(speeds, max(len(speeds) // AT_ONCE, 1))
            work = client.map(partial(_part, tolerance), parts, pure=False)
            return np.concatenate(list(client.gather(work)))  # pyright: ignore[reportArgumentType, reportCallIssue]

        client.run(_part, TOLERANCES[OURS][0], SPEEDS[:BOTH])
        yield integrate
    os.environ["PYTHONPATH"] = path


def _part(tolerance: float, speeds: np.ndarray) -> np.ndarray:
    return integrate_all(speeds, tolerance, 1)
