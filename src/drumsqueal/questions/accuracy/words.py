"""What a study of accuracy found, in sentences."""

from __future__ import annotations

from dataclasses import astuple
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drumsqueal.questions.accuracy.study import AccuracyStudy


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
        "Implicit methods, quadratures and smoothing run only as far as the reference, which is too short for "
        "features.",
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
