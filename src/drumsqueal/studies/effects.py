"""Which effects does a scene need, and what does each cost? Every one is left out or reduced, run, timed and compared.

Differences below the noise mean nothing: the whole scene is also run at a tenth of its tolerance, and what that moves
is the least that counts.
"""

import math
from typing import NamedTuple

from drumsqueal.interrupts import noted_interrupts
from drumsqueal.scene import Scene
from drumsqueal.studies.answers import QUANTITIES, Change
from drumsqueal.studies.reductions import Reduction, reduce, reductions_of
from drumsqueal.studies.variants import Bench, OnProgress, OnVariant, Variant

WITHIN = 0.01
TOGETHER = "together"
ROUND_OFF = 1e-9  # a relative change below it is told as none
MANY = 10.0  # a share from which it is told in times instead of per cent
WORTH_WHILE = 0.9  # share of the time; more is within what times scatter


class EffectStudy(NamedTuple):
    """All runs, the effects the scene needs `within` a relative accuracy, those it can do without, and what is left.

    `noise` is what a tenth of the tolerance changes, None if that run failed. The first of the variants is the whole
    scene, the second the one for the noise.
    """

    scene: Scene
    within: float
    noise: Change | None
    variants: tuple[Variant, ...]
    needed: tuple[Reduction, ...]
    spared: tuple[Reduction, ...]
    reduced: Scene


def study_effects(
    scene: Scene, within: float = WITHIN, *, on_variant: OnVariant | None = None, on_progress: OnProgress | None = None
) -> EffectStudy:
    """Leave out or reduce each effect of a scene and see what it costs and changes: `study_effects(scene).reduced`.

    Then all that the scene can do without `within` that relative accuracy is left out together; where that goes too
    far, the effect that counts most comes back until it does not. `on_variant` is called with each run as it ends,
    `on_progress` with its label and the time (s) it has reached. Raises SceneError for a scene that cannot be run,
    IntegrationError when the whole scene fails, and KeyboardInterrupt between two chunks.
    """
    with noted_interrupts():
        bench = Bench(scene, on_variant or (lambda _: None), on_progress or (lambda *_: None))
        reductions = reductions_of(scene)
        alone = [(reduction, bench.run(str(reduction), (reduction,))) for reduction in reductions]
        spared = [(reduction, run) for reduction, run in alone if agrees(run.change, bench.noise, within)]
        while len(spared) > 1:
            together = bench.run(TOGETHER, tuple(reduction for reduction, _ in spared))
            if agrees(together.change, bench.noise, within):
                break
            spared.remove(max(spared, key=lambda pair: pair[1].largest_change))
        variants = bench.timed_again()
    left_out = tuple(reduction for reduction, _ in spared)
    needed = tuple(reduction for reduction in reductions if reduction not in left_out)
    reduced = reduce(scene, left_out)
    return EffectStudy(scene, within, bench.noise, variants, needed, left_out, reduced)


def agrees(change: Change | None, noise: Change | None, within: float) -> bool:
    """Whether no quantity changes by more than `within` or, where that is more, by the noise; a failed run does not."""
    if change is None:
        return False
    limits = [max(within, abs(least or 0.0)) for least in noise or (None,) * len(change)]
    return all(abs(value or 0.0) <= limit for value, limit in zip(change, limits, strict=True))


def verdict(study: EffectStudy) -> str:
    """Say in plain words which effects the scene needs, what it can do without, and what that saves."""
    within = f"Within {percent(study.within)}"
    if not study.needed and not study.spared:
        return f"{within}: there is nothing in this scene that could be left out."
    needed = ", ".join(reduction.effect for reduction in study.needed)
    if not study.spared:
        return f"{within} this scene needs all of its effects: {needed}."
    whole = study.variants[0]
    final = next(variant for variant in reversed(study.variants) if variant.reductions == study.spared)
    largest, share = final.largest_change, final.time_per_ms / whole.time_per_ms
    changes = "nothing" if largest < ROUND_OFF else f"the answer by {percent(largest)} at most"
    saves = f"takes {percent(share)} of the time" if share < WORTH_WHILE else "saves no time worth mentioning"
    return (
        f"{within} this scene needs {needed or 'none of its effects'} and can do without: "
        f"{', '.join(map(str, study.spared))}. That changes {changes} and {saves}."
    )


def reservations(study: EffectStudy) -> tuple[str, ...]:
    """Say what limits the verdict: noise above the accuracy asked for, runs that failed."""
    found = []
    for field, words in QUANTITIES.items():
        least = None if study.noise is None else getattr(study.noise, field)
        if least is not None and abs(least) > study.within:
            known = "not known at all" if math.isinf(least) else f"known to {percent(abs(least))} only"
            found.append(
                f"{words}: {known}, for a tenth of the tolerance changes so much; smaller changes do not count"
            )
    found += [f"{variant.label}: {variant.outcome}" for variant in study.variants if variant.answer is None]
    return tuple(found)


def percent(share: float, sign: str = "") -> str:
    """A share in words of two digits, with a sign if `sign` is "+": 1 %, +32 %, 0.0013 %, 35 times."""
    if abs(share) < ROUND_OFF:
        return "0 %"
    if math.isinf(share):
        return "something that is lost altogether"
    if abs(share) >= MANY:
        return f"{share:{sign}.2g} times"
    digits = ".2g" if abs(share) < 0.0995 else ".0f"  # no exponent for hundreds
    return f"{100 * share:{sign}{digits}} %"
