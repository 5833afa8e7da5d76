"""How long a run will take on this machine: short pieces of it are timed, below the contact boundaries and at them.

It is processor time that is taken, so that what else the machine does counts little.
"""

import math
import time
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import IntegrationError
from drumsqueal.progress import Progress, silent
from drumsqueal.simulation import Prepared, start_of, steady_at_start
from drumsqueal.solve.transient.integrate import integrate
from drumsqueal.solve.transient.state import CHUNK_SAMPLES

PIECES = (4, 20, 100, CHUNK_SAMPLES)  # samples
LONG_ENOUGH = 0.3  # s; a piece that takes longer is not made five times as long
REPEATS = 3
BEYOND = 1.5  # of the way to a contact boundary, where the second pieces begin


class Pace(NamedTuple):
    """What a chunk of the transient takes: computing time (s) and evaluations of the forces, NaN if not counted."""

    seconds: float
    evaluations: float


class RunTime(NamedTuple):
    """An estimate: of the integration (s) and its evaluations, and what compiling took (s); None where it failed.

    `below` and `beyond` are the pace below the contact boundaries and, where the run gets there, beyond.
    """

    seconds: float | None
    evaluations: float | None
    compile_seconds: float
    below: Pace | None
    beyond: Pace | None


def estimate(
    prepared: Prepared, edge_time: float | None, at_the_boundaries: NDArray[np.float64], progress: Progress = silent
) -> RunTime:
    """Time pieces from the start and from a state (2n,) at a contact boundary, and add them up to a run.

    It is below these until `edge_time` (s; None: all along) and beyond them from then on. A lining that sticks
    takes other programs, which are not timed.
    """
    simulate = prepared.scene.simulate
    chunks = simulate.duration * simulate.sample_rate / CHUNK_SAMPLES
    own = np.concatenate(start_of(prepared.scene, prepared.model.names))
    compiling = math.nan
    fraction = 1.0 if edge_time is None else min(1.0, edge_time / simulate.duration)
    try:
        compiling = _timed(prepared, own, PIECES[0], progress)[0]
        below = _pace(prepared, own, progress)
        further = BEYOND * at_the_boundaries if np.any(at_the_boundaries) else own
        beyond = _pace(prepared, further, progress) if fraction < 1 else None
    except IntegrationError:
        return RunTime(None, None, compiling, None, None)
    paces = [(fraction, below)] + ([(1 - fraction, beyond)] if beyond is not None else [])
    seconds = chunks * sum(part * pace.seconds for part, pace in paces)
    evaluations = chunks * sum(part * pace.evaluations for part, pace in paces)
    return RunTime(seconds, evaluations, compiling, below, beyond)


def _pace(prepared: Prepared, state: NDArray[np.float64], progress: Progress) -> Pace:
    """The pace of a whole chunk, from pieces of it that are long enough to be timed; a piece observes a whole chunk."""
    found: list[tuple[int, float, float]] = []
    for samples in PIECES:
        timed = [_timed(prepared, state, samples, progress)]
        while len(timed) < REPEATS and timed[0][0] < LONG_ENOUGH:
            timed.append(_timed(prepared, state, samples, progress))
        found.append((samples, *min(timed)))  # whatever else the machine does makes it longer, never shorter
        if found[-1][1] > LONG_ENOUGH:
            break
    if len(found) == 1 or found[-1][0] == CHUNK_SAMPLES:
        factor = CHUNK_SAMPLES / found[-1][0]
        return Pace(found[-1][1] * factor, found[-1][2] * factor)
    (few, little, some), (many, much, more) = list(pairwise(found))[-1]
    further = (CHUNK_SAMPLES - many) / (many - few)
    return Pace(much + further * max(much - little, 0.0), more + further * (more - some))


def _timed(prepared: Prepared, state: NDArray[np.float64], samples: int, progress: Progress) -> tuple[float, float]:
    """Computing time (s) and evaluations of so many samples from a displacement and velocity (2n,)."""
    progress(f"timing {samples} samples", 0.0, None)
    model, simulate = prepared.model, prepared.scene.simulate
    n = len(model.names)
    begun = time.process_time()
    pieces = integrate(
        model,
        steady_at_start(prepared),
        state[:n],
        state[n:],
        duration=samples / simulate.sample_rate,
        sample_rate=simulate.sample_rate,
        tolerance=simulate.tolerance,
        solver=simulate.solver,
    )
    evaluations = sum(chunk.evaluations for chunk in pieces)
    return time.process_time() - begun, evaluations
