"""How wrong is a scene's transient, and what would it cost to be ten times better?

Every method and tolerance, and every way to integrate the contact, runs the whole scene, is timed, and is compared: its
trajectory with an independent reference, what users quote with the tightest run, its energy with conservation.
"""

import math
import os
import platform
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple
from pathlib import Path
from typing import Any

from pydantic import Field

from drumsqueal.errors import Ending
from drumsqueal.findings.compare import RelativeChange
from drumsqueal.findings.schema import Findings, Held, InMemory
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.accuracy.bench import NONE, Benchmark, Measurement, Reference, check_solvers, contenders_of
from drumsqueal.scene import Scene

PATIENCE = 10.0  # s; once a run takes longer, the dearer ones of its line are not made
TOO_SLOW = f"the run before it took more than {PATIENCE:g} s"


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    lines = information.read_text(encoding="utf-8", errors="replace").splitlines() if information.exists() else []
    named = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor())


class AccuracyStudy(Findings):
    """All measurements, the reference, the ends of the growth phase and of the comparison (s), and what was found.

    `runs` has a row for each measurement, `simulate` the settings that meet the target. `separation` is when nearby
    trajectories have come apart (None: not within the record), `scatter` what ten times the tightest tolerance changes
    in the features, `cheapest` the choice of method and tolerance that meets the target in the fewest evaluations, and
    `ten_times_better` the one that meets a tenth of it; None where there is none.
    """

    printed_by = "drumsqueal.questions.accuracy.answer.print_study"
    target: float
    runs: tuple[dict[str, Any], ...]
    verdict: str = ""
    remarks: tuple[str, ...] = ()
    simulate: dict[str, Any] | None = None
    machine: str = Field(default_factory=platform.machine)
    processor: str = Field(default_factory=_processor)
    cores: int | None = Field(default_factory=os.cpu_count)
    reference: InMemory[Reference] = Held
    growth_end: float = Field(default=math.nan, exclude=True)
    separation: float | None = Held
    scatter: RelativeChange = Field(default=NONE, exclude=True)
    measurements: InMemory[tuple[Measurement, ...]] = Field(default=(), exclude=True)
    cheapest: InMemory[Measurement | None] = Held
    ten_times_better: InMemory[Measurement | None] = Held


def study_accuracy(
    scene: Scene,
    target: float = 1e-4,
    *,
    solvers: Sequence[str] = (),
    progress: Progress = silent,
    keep: Callable[[AccuracyStudy], None] = lambda _: None,
) -> AccuracyStudy:
    """Measure what accuracy costs in time for a scene: `study_accuracy(scene).cheapest` meets the target.

    `solvers` are further ones to try, such as "diffrax.Kvaerno5", and `keep` takes what is known after each
    measurement. Raises ValueError for a target outside 0 to 1 and a solver that there is not, SceneError for a scene
    that cannot be run, and IntegrationError when the tightest run fails.
    """
    if not 0 < target < 1:
        raise ValueError(f"the target must be between 0 and 1, got {target}")
    check_solvers(scene, solvers)
    bench = Benchmark(scene, progress)
    lines = list(contenders_of(bench.prepared.model, solvers))
    measurements: list[Measurement] = []
    for line in lines:
        slowest = 0.0
        for contender in line:
            what = f"{len(measurements) + 1} of {sum(map(len, lines))}: {contender.name}"
            progress(what, 0.0, None)
            if slowest > PATIENCE:
                found = Measurement(contender, Ending.SKIPPED, reason=TOO_SLOW)
            else:
                found = bench.measure(contender, what)
                slowest = max([slowest, *found.seconds])
            measurements.append(found)
            keep(AccuracyStudy(scene=scene, target=target, runs=tuple(map(_row, measurements))))
    cheapest = _cheapest(bench, measurements, target)
    chosen = cheapest and {"tolerance": cheapest.contender.tolerance, "solver": cheapest.contender.solver}
    study = AccuracyStudy(
        scene=scene,
        target=target,
        runs=tuple(map(_row, measurements)),
        simulate=chosen and scene.simulate.model_dump(mode="json") | chosen,
        reference=bench.reference,
        growth_end=bench.growth_end,
        separation=bench.separation,
        scatter=bench.scatter,
        measurements=tuple(measurements),
        cheapest=cheapest,
        ten_times_better=_cheapest(bench, measurements, target / 10),
    )
    return study.model_copy(update={"verdict": describe_verdict(study), "remarks": describe_limits(study)})


def _cheapest(bench: Benchmark, measurements: Sequence[Measurement], target: float) -> Measurement | None:
    """The choice of method and tolerance that meets a target in the fewest evaluations.

    Nearly all time goes into them, and unlike time they can be counted.
    """
    floor = bench.reference.uncertainty(bench.growth_end)
    enough = [each for each in measurements if _meets(each, target, floor, bench.scatter)]
    return min(enough, key=lambda each: each.evaluations, default=None)


def _meets(found: Measurement, target: float, floor: float, scatter: RelativeChange) -> bool:
    """Whether a choice of method and tolerance meets the target; features within twice their scatter do."""
    errors = found.errors
    if not found.contender.whole or errors is None or errors.trajectory is None:
        return False
    features = all(
        error is None or error <= max(target, 2 * (least or 0.0)) < math.inf
        for error, least in zip(astuple(errors.features), astuple(scatter), strict=True)
    )
    return features and max(errors.trajectory, floor, errors.energy) <= target


def _row(measurement: Measurement) -> dict[str, Any]:
    contender, errors = measurement.contender, measurement.errors
    row: dict[str, Any] = {
        "cause": contender.cause,
        "line": contender.line,
        "setting": contender.setting,
        "solver": contender.solver,
        "tolerance": contender.tolerance,
        "outcome": measurement.ended,
        "simulated_ms": measurement.simulated * 1e3,
        "time_per_simulated_ms": measurement.time_per_ms,
        "seconds": " ".join(f"{each:.6g}" for each in measurement.seconds),
        "first_call_extra_seconds": measurement.compile_seconds,
        "evaluations": measurement.evaluations,
    }
    if errors is not None:
        row |= {"error_trajectory": errors.trajectory, "error_beyond_edges": errors.beyond}
        row |= {f"error_{name}": value for name, value in asdict(errors.features).items()}
        row["error_energy_balance"] = errors.energy
    return row


def describe_limits(study: AccuracyStudy) -> tuple[str, ...]:
    """What the columns mean, how good the reference is, and what was not measured."""
    reference, end = study.reference, float(study.reference.time[-1])
    reached = min(end, study.growth_end)
    phase = "the growth phase" if end >= study.growth_end else "as far as the reference got in its time"
    beyond = f"; beyond the first contact boundary, until {end * 1e3:.4g} ms" if end > study.growth_end else ""
    found = [
        "Time and evaluations for a simulated millisecond: median, without compilation. Relative errors: of the "
        f"trajectory, the largest of any state over its largest value, until {reached * 1e3:.4g} ms ({phase}{beyond}); "
        "of the features (growth rates, onset frequencies, amplitude and frequency at the end) the largest, compared "
        "with the tightest run; of the energy balance over the kinetic energy. A dash: not counted, or not reached. "
        "Implicit methods, those of diffrax, quadratures and smoothing run only as far as the reference, which is too "
        "short for features.",
        "The reference is SciPy's DOP853 at 1e-13 on tanh-sinh quadrature. DOP853 at 1e-12 on Fejér quadrature "
        f"differs by {reference.uncertainty(reached):.0e} (drawn as the floor), LSODA at 1e-12 by "
        f"{reference.confirmed(reached):.0e}.",
    ]
    if study.separation is None:
        found.append("Nearby trajectories stay together over the whole record.")
    else:
        found.append(
            f"At {study.separation * 1e3:.4g} ms nearby trajectories are a hundred times further apart than at the "
            "start: from there on compare features, not points."
        )
    failed: dict[str, list[str]] = {}
    for each in study.measurements:
        if each.errors is None:
            failed.setdefault(each.ended, []).append(each.contender.name)
    return (*found, *(f"{'; '.join(names)}: {reason}." for reason, names in failed.items()))


def describe_verdict(study: AccuracyStudy) -> str:
    """The cheapest choice that meets the target, and what ten times better would cost."""
    best = study.cheapest
    floor = study.reference.uncertainty(study.growth_end)
    if best is None:
        limit = f" The reference itself is good to {floor:.0e}." if floor > study.target else ""
        return f"No run meets {study.target:.0e} in trajectory, features and energy together.{limit}"
    judged = "trajectory and energy (so short a record has no features)"
    if best.errors is not None and best.errors.largest_feature is not None:
        judged = "trajectory, features and energy"
        scatter = max(each or 0.0 for each in astuple(study.scatter))
        if 2 * scatter > study.target:
            judged += f" (features within twice their scatter of {scatter:.0e})"
    text = (
        f"Within {study.target:.0e} in {judged}, the cheapest is {best.contender.solver} at "
        f"tolerance {best.contender.tolerance:g}: {best.evaluations:.3g} evaluations, "
        f"{1e3 * best.time_per_ms * study.scene.simulate.duration:.3g} ms for {study.scene.simulate.duration:g} s."
    )
    better = study.ten_times_better
    if better is None:
        return f"{text} No run is ten times better."
    if better is best:
        return f"{text} It is even ten times better."
    ratio, chosen = better.evaluations / best.evaluations, better.contender
    return f"{text} Ten times better takes {ratio:.3g} times as many ({chosen.solver} at {chosen.tolerance:g})."
