"""Which effects does a scene need, and what does each cost? Every one is left out or reduced, run, timed and compared.

Differences below the noise mean nothing: the whole scene is also run at a tenth of its tolerance, and what that moves
is the least that counts.
"""

import math
from typing import NamedTuple

from drumsqueal.findings.answers import QUANTITIES, Answer, Change
from drumsqueal.findings.verdict import SMALL_ROTATION
from drumsqueal.interrupts import noted_interrupts
from drumsqueal.questions.effects.reductions import NOTHING, Reduction, reduce, reductions_of
from drumsqueal.questions.effects.variants import Bench, OnProgress, OnVariant, Variant
from drumsqueal.scene import Profile, Scene

WITHIN = 0.01
TOGETHER = "together"
ROUND_OFF = 1e-9  # a relative change below it is told as none
MANY = 100.0  # a share above which it is told by its power of ten
SCATTER = 0.9  # share of the time; what is nearer to one is within what times scatter


class EffectStudy(NamedTuple):
    """All runs, the effects the scene needs `within` a relative accuracy, those it can do without, and what is left.

    `noise` is what a tenth of the tolerance changes, an estimate from one run, and None where there is none. The first
    of the variants is the whole scene.
    """

    scene: Scene
    within: float
    noise: Change | None
    variants: tuple[Variant, ...]
    needed: tuple[Reduction, ...]
    spared: tuple[Reduction, ...]
    reduced: Scene

    def needs(self, variant: Variant) -> bool:
        """Whether the variant leaves out a single effect, which the scene needs."""
        return len(variant.reductions) == 1 and variant.reductions[0] in self.needed


def study_effects(
    scene: Scene, within: float = WITHIN, *, on_variant: OnVariant | None = None, on_progress: OnProgress | None = None
) -> EffectStudy:
    """Leave out or reduce each effect of a scene and see what it costs and changes: `study_effects(scene).reduced`.

    Then all that the scene can do without `within` that relative accuracy (0 to 1) is left out together; where that
    goes too far, the effect that counts most comes back until it does not. `on_variant` is called with each run as it
    ends, `on_progress` with its label and the time (s) it has reached. Raises ValueError for another accuracy,
    SceneError for a scene that cannot be run, IntegrationError when the whole scene fails, and KeyboardInterrupt
    between two chunks.
    """
    if not 0 < within < 1:
        raise ValueError(f"the accuracy must be between 0 and 1, got {within}")
    with noted_interrupts():
        bench = Bench(scene, on_variant or (lambda _: None), on_progress or (lambda *_: None))
        reductions = reductions_of(scene)
        alone = {reduction.effect: bench.run(str(reduction), (reduction,)) for reduction in reductions}
        excess = {effect: excess_of(variant.change, bench.noise, within) for effect, variant in alone.items()}
        spared = [reduction for reduction in reductions if excess[reduction.effect] <= 1]
        label = TOGETHER
        while len(spared) > 1 and excess_of(bench.run(label, tuple(spared)).change, bench.noise, within) > 1:
            heaviest = max(spared, key=lambda reduction: excess[reduction.effect])
            spared.remove(heaviest)
            label = f"less {heaviest.effect}"
        variants = bench.timed_again()
    needed = tuple(reduction for reduction in reductions if reduction not in spared)
    return EffectStudy(scene, within, bench.noise, variants, needed, tuple(spared), reduce(scene, spared))


def excess_of(change: Change | None, noise: Change | None, within: float) -> float:
    """The largest change of any quantity over its limit, `within` or the noise where that is more; infinite if failed.

    A quantity that the noise takes away altogether has no limit.
    """
    if change is None:
        return math.inf
    limits = [max(within, abs(least or 0.0)) for least in noise or (None,) * len(change)]
    pairs = zip(change, limits, strict=True)
    return max((abs(value or 0.0) / limit for value, limit in pairs if math.isfinite(limit)), default=0.0)


def verdict(study: EffectStudy) -> str:
    """Say in plain words which effects the scene needs, what it can do without, and what that saves."""
    within = f"Within {percent(study.within)}"
    if not study.needed and not study.spared:
        return f"{within}: there is nothing in this scene that could be left out."
    needed = ", ".join(reduction.effect for reduction in study.needed)
    if not study.spared:
        return f"{within} this scene needs all of its effects: {needed}."
    spared = ", ".join(
        each.effect if each.becomes == NOTHING else f"{each.effect} ({each.becomes} will do)" for each in study.spared
    )
    final = next(variant for variant in reversed(study.variants) if variant.reductions == study.spared)
    return (
        f"{within} this scene needs {needed or 'none of its effects'} and can do without {spared}. "
        f"{_what_changes(final.change)} and takes {_time(final.time_per_ms / study.variants[0].time_per_ms)}."
    )


def _what_changes(change: Change | None) -> str:
    """What is compared, by name: what neither run has is not."""
    values = {} if change is None else change._asdict()
    compared = {QUANTITIES[field]: abs(value) for field, value in values.items() if value is not None}
    largest = max((value for value in compared.values() if math.isfinite(value)), default=0.0)
    if largest < ROUND_OFF:
        return f"That changes nothing in {', '.join(compared) or 'what could be compared'}"
    return f"That changes {', '.join(compared)} by {percent(largest)} at most"


def _time(share: float) -> str:
    """In one digit: times scatter."""
    return "as long" if SCATTER < share < 1 / SCATTER else f"about {percent(float(f'{share:.1g}'))} of the time"


def reservations(study: EffectStudy) -> tuple[str, ...]:
    """Say what limits the verdict: what could not be compared, noise above the accuracy asked for, profiles."""
    found = []
    whole = study.variants[0].answer
    if whole is not None and not whole.carriers:
        found.append("The whole scene is at rest at the end: eigenvalues alone are compared.")
    elif whole is not None and whole.main is None:
        found.append("The record is too short, or the motion has no line: the frequency at the end is not compared.")
    if study.noise is None:
        found.append("What the tolerance is worth is not known: there is no run at a tenth of it.")
    for field, words in QUANTITIES.items():
        least = None if study.noise is None else getattr(study.noise, field)
        if least is not None and math.isinf(least):
            found.append(f"A tenth of the tolerance changes the {words} altogether: not compared.")
        elif least is not None and abs(least) > study.within:
            found.append(f"A tenth of the tolerance changes the {words} by {percent(abs(least))}: less does not count.")
    schedules = (study.scene.drum.speed, study.scene.contact.normal_load)
    if any(isinstance(schedule, Profile) for schedule in schedules):
        found.append("Growth rates and onset frequencies are those at t = 0: drum speed or load change.")
    return tuple(found)


def remarks(study: EffectStudy) -> tuple[str, ...]:
    """Say what the changes of a run do not tell: why it failed, what else is unstable, that the model does not hold."""
    found, whole = [], study.variants[0].answer
    for variant in study.variants:
        answer = variant.answer
        if answer is None or whole is None:
            found.append(f"{variant.label}: {variant.outcome}")
            continue
        if set(answer.unstable) != set(whole.unstable):
            found.append(f"{variant.label}: {_squeal(answer)} instead of {_squeal(whole)}")
        if answer.rotation > SMALL_ROTATION:
            turn = f"the shoe turns by {answer.rotation:.2g} rad, where the model no longer holds"
            found.append(f"{variant.label}: {turn}")
    return tuple(found)


def _squeal(answer: Answer) -> str:
    return f"squeal in {', '.join(answer.unstable)}" if answer.unstable else "no squeal"


def percent(share: float, sign: str = "") -> str:
    """A share in per cent, of two digits where it is small, with a sign if `sign` is "+": 1 %, +32 %, 0.0013 %."""
    if abs(share) < ROUND_OFF:
        return "0 %"
    digits = ".2g" if abs(share) < 0.0995 or abs(share) > MANY else ".0f"  # no exponent for hundreds
    return f"{100 * share:{sign}{digits}} %"
