"""Which effects does a scene need, and what does each cost? Every one is left out or reduced, run, timed and compared.

Differences below the noise mean nothing: the whole scene is also run at a tenth of its tolerance, and what that moves
is the least that counts.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple
from typing import Any

from pydantic import Field

from drumsqueal.findings.answers import Change
from drumsqueal.findings.schema import Findings, Held, InMemory, SceneInFile
from drumsqueal.findings.vibration import unit_of
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.effects.reductions import Reduction, reduce, reductions_of
from drumsqueal.questions.effects.variants import Bench, Variant
from drumsqueal.questions.effects.words import describe_limits, describe_runs, describe_verdict
from drumsqueal.scene import Scene

WITHIN = 0.01
TOGETHER = "together"


class EffectStudy(Findings):
    """All runs, the effects the scene needs `within` a relative accuracy, those it does not need, and what is left.

    `reduced_scene` is None until all runs are made. `noise` is what a tenth of the tolerance changes, an estimate from
    one run, and None where there is none. The first of the variants is the whole scene; `runs` has a row for each.
    """

    within: float
    runs: tuple[dict[str, Any], ...]
    verdict: str = ""
    remarks: tuple[str, ...] = ()
    reduced_scene: SceneInFile | None = None
    variants: InMemory[tuple[Variant, ...]] = Field(default=(), exclude=True)
    noise: Change | None = Held
    needed: tuple[Reduction, ...] = Field(default=(), exclude=True)
    spared: tuple[Reduction, ...] = Field(default=(), exclude=True)

    def needs(self, variant: Variant) -> bool:
        """Whether the variant leaves out a single effect, which the scene needs."""
        return len(variant.reductions) == 1 and variant.reductions[0] in self.needed


def study_effects(
    scene: Scene,
    within: float = WITHIN,
    *,
    progress: Progress = silent,
    keep: Callable[[EffectStudy], None] = lambda _: None,
) -> EffectStudy:
    """Leave out or reduce each effect of a scene: `study_effects(scene).reduced_scene` has those that it needs.

    Then all that the scene does not need `within` that relative accuracy (0 to 1) is left out together; where that
    goes too far, the effect that counts most comes back until it does not. `keep` takes what is known after each run.
    Raises ValueError for another accuracy, SceneError for a scene that cannot be run, and IntegrationError when the
    whole scene fails.
    """
    if not 0 < within < 1:
        raise ValueError(f"the accuracy must be between 0 and 1, got {within}")
    reductions, ran = reductions_of(scene), list[Variant]()
    runs = 2 + len(reductions)  # and then some of them together

    def report(variant: Variant) -> None:
        ran.append(variant)
        keep(EffectStudy(scene=scene, within=within, runs=tuple(_rows(ran)), variants=tuple(ran)))

    def show(label: str, reached: float = 0.0, duration: float | None = None) -> None:
        progress(f"{len(ran) + 1} of {runs}: {label}" if len(ran) < runs else label, reached, duration)

    bench = Bench(scene, report, show)
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
    limits = describe_limits(scene, variants[0].answer, bench.noise, within)
    return EffectStudy(
        scene=scene,
        within=within,
        runs=tuple(_rows(variants, needed)),
        verdict=describe_verdict(within, variants, needed, tuple(spared)),
        remarks=(*describe_runs(variants), *limits),
        reduced_scene=reduce(scene, spared),
        variants=variants,
        noise=bench.noise,
        needed=needed,
        spared=tuple(spared),
    )


def excess_of(change: Change | None, noise: Change | None, within: float) -> float:
    """The largest change of any quantity over its limit, `within` or the noise where that is more; infinite if failed.

    A quantity that the noise takes away altogether has no limit.
    """
    if change is None:
        return math.inf
    values = astuple(change)
    limits = [max(within, abs(least or 0.0)) for least in (astuple(noise) if noise else (None,) * len(values))]
    pairs = zip(values, limits, strict=True)
    return max((abs(value or 0.0) / limit for value, limit in pairs if math.isfinite(limit)), default=0.0)


def _rows(variants: Sequence[Variant], needed: Sequence[Reduction] | None = None) -> list[dict[str, Any]]:
    """One row a run: cost, eigenvalues, the motion at the end, and relative changes from the whole scene."""
    rows = [_row(variant, variants[0]) for variant in variants]
    for row, variant in zip(rows, variants, strict=True):
        if needed is not None and len(variant.reductions) == 1:
            row["needed"] = "yes" if variant.reductions[0] in needed else "no"
    return rows


def _row(variant: Variant, whole: Variant) -> dict[str, Any]:
    row: dict[str, Any] = {
        "run": variant.label,
        "left_out": "; ".join(map(str, variant.reductions)),
        "outcome": variant.ended,
        "computing_ms_per_simulated_ms": _number(variant.time_per_ms),
        "evaluations_per_simulated_ms": _number(variant.evaluations_per_ms),
    }
    answer = variant.answer
    if answer is not None and whole.answer is not None:
        for label, mode in answer.modes.items():
            row[f"frequency_{label}_Hz"] = mode.frequency_Hz
            row[f"growth_rate_{label}_1_per_s"] = mode.growth_rate
        for name in whole.answer.amplitude:
            row[f"end_amplitude_{name}_{unit_of(name)}"] = answer.amplitude.get(name, 0.0)
        row["end_frequency_Hz"] = None if answer.main is None else answer.main.frequency_Hz
    if variant.change is not None:
        row |= {f"change_of_{field}": _number(value) for field, value in asdict(variant.change).items()}
    return row


def _number(value: float | None) -> float | None:
    """An empty cell for what is not known; an infinite change, of what one of two runs lacks, is written inf."""
    return None if value is None or math.isnan(value) else value
