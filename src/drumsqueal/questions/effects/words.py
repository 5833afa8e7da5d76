"""What a study of effects found, in sentences."""

import math
from collections.abc import Sequence
from dataclasses import asdict

from drumsqueal.findings.answers import QUANTITIES, Answer, Change
from drumsqueal.findings.verdict import SMALL_ROTATION
from drumsqueal.questions.effects.reductions import NOTHING, Reduction
from drumsqueal.questions.effects.variants import Variant
from drumsqueal.scene import Profile, Scene
from drumsqueal.scene.quantities import ROUND_OFF, percent

SCATTER = 0.9  # fraction of the time; what is nearer to one is within what times scatter


def describe_verdict(
    within: float, variants: Sequence[Variant], needed: Sequence[Reduction], spared: tuple[Reduction, ...]
) -> str:
    """Which effects the scene needs, which it does not need, and what leaving these out saves."""
    accuracy = f"Within {percent(within)}"
    if not needed and not spared:
        return f"{accuracy}: this scene has no effect that could be left out."
    names = ", ".join(reduction.effect for reduction in needed)
    if not spared:
        return f"{accuracy} this scene needs all of its effects: {names}."
    left_out = ", ".join(
        each.effect if each.becomes == NOTHING else f"{each.effect} ({each.becomes} suffices)" for each in spared
    )
    final = next(variant for variant in reversed(variants) if variant.reductions == spared)
    time = _time(final.time_per_ms / variants[0].time_per_ms)
    needs = f"needs {names}, but not {left_out}" if names else f"needs none of its effects: not {left_out}"
    return f"{accuracy} this scene {needs}. {_what_changes(final.change)}, and the run takes {time}."


def _what_changes(change: Change | None) -> str:
    """What is compared, by name: what neither run has is not."""
    values = {} if change is None else asdict(change)
    compared = {QUANTITIES[field]: abs(value) for field, value in values.items() if value is not None}
    what = f"Without that, {', '.join(compared) or 'what could be compared'}"
    largest = max((value for value in compared.values() if math.isfinite(value)), default=0.0)
    return f"{what} do not change" if largest < ROUND_OFF else f"{what} change by {percent(largest)} at most"


def _time(fraction: float) -> str:
    """In one digit: times scatter."""
    return "as long" if SCATTER < fraction < 1 / SCATTER else f"about {percent(float(f'{fraction:.1g}'))} of the time"


def describe_limits(scene: Scene, whole: Answer | None, noise: Change | None, within: float) -> tuple[str, ...]:
    """What limits the verdict: what could not be compared, noise above the accuracy asked for, profiles."""
    found = []
    if whole is not None and not whole.carriers:
        found.append("The whole scene is at rest at the end: only its eigenvalues are compared.")
    elif whole is not None and whole.main is None:
        found.append("The frequency at the end is not compared: the record is too short, or the motion has no line.")
    if noise is None:
        found.append("The effect of the tolerance is unknown: there is no run at a tenth of it.")
    for field, value in ({} if noise is None else asdict(noise)).items():
        words = QUANTITIES[field]
        if value is not None and math.isinf(value):
            found.append(f"The {words} are not compared: at a tenth of the tolerance they are altogether different.")
        elif value is not None and abs(value) > within:
            found.append(f"A tenth of the tolerance changes the {words} by {percent(abs(value))}: less does not count.")
    if any(isinstance(schedule, Profile) for schedule in (scene.drum.speed, scene.contact.normal_load)):
        found.append("Growth rates and onset frequencies are those at t = 0: drum speed or load change.")
    return tuple(found)


def describe_runs(variants: Sequence[Variant]) -> tuple[str, ...]:
    """What the changes of a run do not show: why it failed, what else is unstable, that the model does not hold."""
    found, whole = [], variants[0].answer
    for variant in variants:
        answer = variant.answer
        if answer is None or whole is None:
            found.append(f"{variant.label}: {variant.ended}")
            continue
        if set(answer.unstable) != set(whole.unstable):
            found.append(f"{variant.label}: {_squeal(answer)} instead of {_squeal(whole)}")
        if answer.rotation > SMALL_ROTATION:
            turn = f"the shoe turns by {answer.rotation:.2g} rad, where the model no longer holds"
            found.append(f"{variant.label}: {turn}")
    return tuple(found)


def _squeal(answer: Answer) -> str:
    return f"squeal in {', '.join(answer.unstable)}" if answer.unstable else "no squeal"
