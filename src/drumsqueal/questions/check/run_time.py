"""How long a run will take on this machine: short pieces of it are timed, below the contact boundaries and at them.

It is processor time that is taken, so that what else the machine does counts little.
"""

import time

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
Vector = NDArray[np.float64]


def estimate(
    prepared: Prepared, boundary: float | None, at_the_boundaries: Vector, progress: Progress = silent
) -> tuple[float, float] | None:
    """Estimate computing time (s) and evaluations of a run, NaN if not counted; None where the integration fails.

    Pieces from the start are added up until the time `boundary` (s; None: all along), and pieces from a state (2n,) at
    a contact boundary from then on. A lining that sticks takes other programs, which are not timed.
    """
    simulate = prepared.scene.simulate
    own = np.concatenate(start_of(prepared.scene, prepared.model.names))
    below = 1.0 if boundary is None else min(1.0, boundary / simulate.duration)
    try:
        _timed(prepared, own, PIECES[0], progress)  # compiles
        pace = below * _pace(prepared, own, progress)
        if below < 1:
            further = BEYOND * at_the_boundaries if np.any(at_the_boundaries) else own
            pace = pace + (1 - below) * _pace(prepared, further, progress)
    except IntegrationError:
        return None
    seconds, evaluations = simulate.duration * simulate.sample_rate / CHUNK_SAMPLES * pace
    return float(seconds), float(evaluations)


def _pace(prepared: Prepared, state: Vector, progress: Progress) -> Vector:
    """Computing time (s) and evaluations (2,) of a whole chunk, from pieces of it that are long enough to be timed.

    A piece observes a whole chunk.
    """
    found: list[Vector] = []
    for samples in PIECES:
        timed = [_timed(prepared, state, samples, progress)]
        while len(timed) < REPEATS and timed[0][0] < LONG_ENOUGH:
            timed.append(_timed(prepared, state, samples, progress))
        found.append(np.array(min(timed)))  # whatever else the machine does makes it longer, never shorter
        if found[-1][0] > LONG_ENOUGH:
            break
    last = PIECES[len(found) - 1]
    if len(found) == 1 or last == CHUNK_SAMPLES:
        return found[-1] * (CHUNK_SAMPLES / last)
    more = found[-1] - found[-2]
    return found[-1] + (CHUNK_SAMPLES - last) / (last - PIECES[len(found) - 2]) * np.array([max(more[0], 0.0), more[1]])


def _timed(prepared: Prepared, state: Vector, samples: int, progress: Progress) -> tuple[float, float]:
    """Computing time (s) and evaluations of so many samples from a displacement and velocity (2n,)."""
    progress(f"timing {samples} samples", 0.0, None)
    simulate = prepared.scene.simulate
    begun = time.process_time()
    pieces = integrate(
        prepared.model,
        steady_at_start(prepared),
        *np.split(state, 2),
        duration=samples / simulate.sample_rate,
        sample_rate=simulate.sample_rate,
        tolerance=simulate.tolerance,
        solver=simulate.solver,
    )
    evaluations = sum(chunk.evaluations for chunk in pieces)
    return time.process_time() - begun, evaluations
