"""Numbers of a scene that bring its predicted lines onto measured ones, with their uncertainty."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray
from pydantic import computed_field

from drumsqueal.errors import RequestError
from drumsqueal.files.history_file import SavedHistory, read_history
from drumsqueal.files.output_folder import is_history
from drumsqueal.findings.columns import Column, to_digits, to_uncertainty
from drumsqueal.findings.history import time_window
from drumsqueal.findings.schema import Finding, Findings, Held, InMemory, SceneInFile
from drumsqueal.findings.signals.regime import listed
from drumsqueal.physics.composition import kept_coordinates
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.compare.measured import read_measured
from drumsqueal.questions.compare.record import Measured, check_count
from drumsqueal.questions.export.signals import SURFACE, make_channels, names_of
from drumsqueal.questions.fit.estimate import (
    FAR,
    PART,
    PERCENT_95,
    POOR,
    Assignment,
    Eigenmodes,
    Estimate,
    Scale,
    assign,
    fit_lines,
)
from drumsqueal.questions.fit.record import CLOCK, RecordKind, RecordLine, RecordReading, read_lines
from drumsqueal.questions.fit.squeal import Varied, fit_squeals
from drumsqueal.questions.sensitivity.stabilising import numbers_of, variable_numbers
from drumsqueal.questions.sensitivity.study import at_one_time
from drumsqueal.scene import Scene, load_with_tables
from drumsqueal.scene.variation import Written, unit_of
from drumsqueal.simulation import prepare


class FittedNumber(Finding):
    """A number of the scene before and after, in SI and in the `unit` of the scene file ("": SI).

    `uncertainty` is half the 95 % confidence interval of the fitted one and `standard_uncertainty` its standard error;
    both are None where the record does not determine it, and it then is as near to the scene's own as the lines allow.
    """

    key: Annotated[str, Column("number", meaning="dotted key of the scene")]
    unit: Annotated[str, Column("unit", missing="SI", meaning="unit of the scene file")]
    scene_value: Annotated[float, Column("scene", "~4")]
    fitted_value: Annotated[float, Column("fitted", "~4", within="uncertainty")]
    uncertainty: Annotated[float | None, Column("±", "~2", "half the 95 % confidence interval")]
    standard_uncertainty: float | None
    determined: Annotated[bool, Column("deter-\nmined", ">", "whether the record determines the number")]
    scene_value_SI: float
    fitted_value_SI: float
    uncertainty_SI: float | None
    at_bound: bool = False
    columns: ClassVar = "key", "scene_value", "fitted_value", "uncertainty", "unit", "relative_change", "determined"

    @computed_field
    @property
    def relative_change(self) -> Annotated[float | None, Column("change", "+.2f", unit="%", factor=100)]:
        """Fitted over the scene's value, less 1; None where that is zero."""
        return self.fitted_value_SI / self.scene_value_SI - 1 if self.scene_value_SI else None


class FittedLine(Finding):
    """A measured line with what the scene predicts before and after; uncertainties are half the 95 % intervals.

    `mode` is the mode it is taken for; None of a line of saturated squeal, and where it is `used` for nothing. Growth
    rates are None where the record does not show them.
    """

    measured_Hz: Annotated[float, Column("measured", ".2f")]
    uncertainty_Hz: Annotated[float, Column("±", "~2", "half the 95 % confidence interval", unit="")]
    mode: Annotated[str | None, Column("mode", optional=True)] = None
    before_Hz: Annotated[float | None, Column("scene", ".2f")] = None
    after_Hz: Annotated[float | None, Column("fitted", ".2f")] = None
    measured_growth_rate_1_per_s: Annotated[float | None, Column("growth", "+.2f", optional=True)] = None
    growth_rate_uncertainty_1_per_s: Annotated[float | None, Column("±", "~2", unit="", optional=True)] = None
    before_growth_rate_1_per_s: Annotated[float | None, Column("scene", "+.2f", optional=True)] = None
    after_growth_rate_1_per_s: Annotated[float | None, Column("fitted", "+.2f", optional=True)] = None
    columns: ClassVar = "mode", ...

    @computed_field
    @property
    def used(self) -> bool:
        """Whether the fit takes it."""
        return self.after_Hz is not None


class Combination(Finding):
    """What the record fixes of numbers that it does not tell apart: a product of powers, or a sum.

    The product of the numbers, each to its exponent in `powers`, is known to `relative_uncertainty`, half its 95 %
    interval, near the fitted values. Of numbers with one unit `factors` are those of the sum that stays instead, and
    `value` and `uncertainty` (95 %) are its, in the `unit` of the scene file ("": SI).
    """

    powers: dict[str, float]
    relative_uncertainty: float
    factors: dict[str, float] | None = None
    value: float | None = None
    uncertainty: float | None = None
    unit: str = ""


class Fit(Findings):
    """Numbers of a scene fitted to a measured record; `scene` is the one before, `fitted_scene` the one after.

    The `record_kind` is "linear" for small vibration, whose lines are compared with the eigenvalues, and "saturated"
    for squeal, whose lines are compared with those of transients. `observations` counts frequencies and growth rates.
    `chi_square_per_freedom` is that of the lines, of a freedom of at least 1, and None where there are no more
    observations than numbers and the lines are met; uncertainties are scaled by its root where it exceeds 1.
    `open_combinations` are those of the numbers that the record does not determine: exponents by key, along which the
    product of powers may change, and `fixed` what it determines of these numbers all the same. `ambiguous` says which
    other assignment of lines to modes, or which other squeal, fits as well. Where the lines are `missed` by more than
    ten times their uncertainty nothing is determined, and the fit has failed.
    """

    printed_by = "drumsqueal.questions.fit.answer.print_fit"

    file: str
    channel: str
    record_kind: RecordKind
    reason: str
    from_s: float
    until_s: float
    sample_rate_Hz: float
    numbers: tuple[FittedNumber, ...]
    lines: tuple[FittedLine, ...]
    observations: int
    chi_square_per_freedom: float | None
    freedom: int
    open_combinations: tuple[dict[str, float], ...]
    fixed: tuple[Combination, ...] = ()
    missed: bool = False
    ambiguous: str | None = None
    transients: int = 0
    verdict: str = ""
    notes: tuple[str, ...] = ()
    fitted_scene: SceneInFile
    reading: InMemory[RecordReading] = Held
    written: InMemory[Any] = Held

    @property
    def determined(self) -> tuple[FittedNumber, ...]:
        """The numbers that the record determines."""
        return tuple(number for number in self.numbers if number.determined)


EQUAL = 1e-3  # of 1, within which a factor of a sum is one
CONFIDENCE = "95 % confidence, if every other number of the scene is exact"


def with_uncertainty(value: float, uncertainty: float | None, unit: str) -> str:
    """A value and its 95 % interval, where it is known, with the unit of the scene file."""
    unit = f" {unit}" if unit else ""
    if uncertainty is None:
        return f"{to_digits(value, 3)}{unit}"
    return f"{to_uncertainty(value, uncertainty)} ± {to_digits(uncertainty, 2)}{unit}"


def describe_fit(fit: Fit) -> str:
    """The result in one or two sentences."""
    if fit.missed:
        return f"The fit has failed: it {why_missed(fit)}."
    how = "eigenvalues" if fit.record_kind is RecordKind.LINEAR else "lines of the scene's squeal"
    used = [line for line in fit.lines if line.used]
    (before, rates_before), (after, rates_after) = (_furthest(used, which) for which in ("before", "after"))
    if rates_before:
        before, after = f"{before} in frequency and {rates_before} in growth rate", f"{after} and {rates_after}"
    was = f"the {how}, up to {before} off before, are now within {after} of the measured lines"
    known = [
        f"{each.key} = {with_uncertainty(each.fitted_value, each.uncertainty, each.unit)}" for each in fit.determined
    ]
    left = [number.key for number in fit.numbers if not number.determined]
    sums = "".join(f" {_sum(each)}." for each in fit.fixed if each.factors is not None)
    if not known:
        sure = f" (±: {CONFIDENCE})" if fit.fixed else ""
        return f"The record determines none of {', '.join(left)} alone{sure}; {was}.{sums}"
    text = f"The record gives {listed(known)} ({CONFIDENCE}); {was}."
    return f"{text} Not determined: {', '.join(left)}.{sums}" if left else text


def why_missed(fit: Fit) -> str:
    """Why a fit has failed whose lines are missed, after its name."""
    miss = f"misses the lines by {_misses(fit)} times their uncertainty, up to"
    used = [line for line in fit.lines if line.used]
    frequency, rate = _furthest(used, "after")
    by = f"{frequency} in frequency and {rate} in growth rate" if rate else frequency
    why = "other numbers of the scene differ, too, or the record is of another brake"
    return f"{miss} {by}, so that nothing is determined: {why}"


def _misses(fit: Fit) -> str:
    """By how many times their uncertainty lines miss, where that is too much; else nothing."""
    chi = fit.chi_square_per_freedom
    return f"{math.sqrt(chi):.{0 if chi > FAR**2 else 1}f}" if chi is not None and chi > POOR**2 else ""


def _off(line, which: str) -> float:
    return getattr(line, which) / line.measured_Hz - 1


def _furthest(lines: Sequence[FittedLine], which: str) -> tuple[str, str]:
    """The largest deviations of frequency and, where they are fitted, of growth rate; else nothing."""
    frequency = _percent(max(abs(_off(line, f"{which}_Hz")) for line in lines))
    rates = [
        abs(getattr(line, f"{which}_growth_rate_1_per_s") - line.measured_growth_rate_1_per_s)
        for line in lines
        if line.mode is not None and line.measured_growth_rate_1_per_s is not None
    ]
    return frequency, f"{to_digits(max(rates), 2)} 1/s" if rates else ""


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.2g} %" if fraction >= 1e-5 else "0.001 %"


def describe_notes(fit: Fit) -> tuple[str, ...]:
    """What limits the fit: what tests it, what is open, poor, ambiguous, or not used."""
    notes = []
    if not fit.missed:
        notes += [
            *_tested(fit),
            *map(_open, _combinations(fit)),
            *(_product(each) for each in fit.fixed if each.factors is None),
        ]
        if _misses(fit):
            miss = f"the lines still miss by {_misses(fit)} times their uncertainty: other numbers differ, too,"
            notes.append(f"{miss} or the model lacks something; the uncertainties are widened by that factor")
        notes += _too_wide(fit)
        if fit.ambiguous:
            notes.append(fit.ambiguous)
    # A search for squeal that misses 2e-3 of a frequency is reported.
    short_of = [line for line in fit.lines if line.used and abs(_off(line, "after_Hz")) > 2e-3]
    if fit.record_kind is RecordKind.SATURATED and short_of:
        missed = ", ".join(f"{line.measured_Hz:.1f}" for line in short_of)
        notes.append(f"the search stopped short of {missed} Hz: the squeal jumps to another motion on the way there")
    bound = [number.key for number in fit.numbers if number.at_bound]
    if bound:
        notes.append(f"{', '.join(bound)}: at the end of what is tried, 20 times or a twentieth of the scene's value")
    unused = [f"{line.measured_Hz:.1f}" for line in fit.lines if not line.used]
    if unused:
        like = "near no mode" if fit.record_kind is RecordKind.LINEAR else "like none of the simulated squeal"
        notes.append(f"not used, {like}: {', '.join(unused)} Hz")
    if fit.reading is not None and fit.reading.left_out_Hz:
        left = ", ".join(f"{f:.1f}" for f in fit.reading.left_out_Hz[:6])
        notes.append(f"harmonics, combinations and faint lines, which are of no mode: {left} Hz")
    return tuple(notes)


def _tested(fit: Fit) -> list[str]:
    """That nothing tests a fit of as many numbers as observations."""
    count, varied = fit.observations, len(fit.numbers)
    if fit.chi_square_per_freedom is not None:
        return []
    several = "frequencies and growth rates" if fit.record_kind is RecordKind.LINEAR else "lines"
    what = "frequency" if count == 1 else several
    gave = f"{count} {what} for {varied} number{'s' if varied > 1 else ''}: nothing tests the fit"
    if not fit.determined:
        return [gave]
    return [f"{gave}; where another number of the scene is wrong, the error may be many times the ±"]


def _too_wide(fit: Fit) -> list[str]:
    """Numbers whose interval has become too wide."""
    explained = {key for each in _combinations(fit) for key in each} | {n.key for n in fit.numbers if n.at_bound}
    wide = [number.key for number in fit.numbers if not number.determined and number.key not in explained]
    if not wide or fit.chi_square_per_freedom is None:
        return []
    why = "the lines are missed by more than their uncertainty, which widens that of a number too far"
    return [f"{', '.join(wide)}: not determined, for {why}"]


def _combinations(fit: Fit) -> list[dict[str, float]]:
    """The open combinations, each with the numbers that take part in it alone."""
    found = []
    for each in fit.open_combinations:
        largest = max(map(abs, each.values()))
        # 0.1 of a combination's largest exponent, from which a number is named in it
        found.append({key: value / largest for key, value in each.items() if abs(value) > 0.1 * largest})
    return found


def _open(combination: dict[str, float]) -> str:
    keys = list(combination)
    if len(keys) == 1:
        return f"{keys[0]} is not determined: the lines hardly depend on it, and fit with its other values as well"
    return f"{listed(keys)} are not told apart: the lines fit with other values of these as well"


def _product(fixed: Combination) -> str:
    """What is known of numbers with different units, which have no sum."""
    terms = " × ".join(key if power == 1 else f"{key}^{power:.2g}" for key, power in _by_size(fixed.powers))
    return f"{terms} is known to ± {to_digits(100 * fixed.relative_uncertainty, 2)} %, near the fitted values"


def _sum(fixed: Combination) -> str:
    """What is known of numbers that act together, with their unit."""
    assert fixed.factors is not None
    assert fixed.value is not None
    is_sum = all(abs(factor - 1) < EQUAL for factor in fixed.factors.values())
    terms = [
        f"{'-' if factor < 0 else '+'} {key if abs(abs(factor) - 1) < EQUAL else f'{abs(factor):.2g} {key}'}"
        for key, factor in _by_size(fixed.factors)
    ]
    counts = "Only their sum counts: " if is_sum else "Near these values only this counts: "
    value = with_uncertainty(fixed.value, fixed.uncertainty, fixed.unit)
    return f"{counts}{' '.join(terms).removeprefix('+ ')} = {value}"


def _by_size(factors: dict[str, float]) -> list[tuple[str, float]]:
    """The largest first; of equals, which round-off tells apart, the one that was asked for first."""
    groups: list[list[str]] = []
    for key in sorted(factors, key=lambda key: -abs(factors[key])):
        if groups and abs(abs(factors[groups[-1][-1]]) - abs(factors[key])) < EQUAL:
            groups[-1].append(key)
        else:
            groups.append([key])
    asked = list(factors)
    return [(key, factors[key]) for group in groups for key in sorted(group, key=asked.index)]


# Rms difference of overtones from which something else differs: 0.3 dB where the numbers are found, 1.4 dB where one
# that is not varied is off by 23 %.
HINT_DB = 0.7


class _Result(NamedTuple):
    """An estimate, the lines as they are to be reported, and what else is to be said."""

    estimate: Estimate
    lines: tuple[FittedLine, ...]
    observations: int
    ambiguous: str | None = None
    transients: int = 0
    notes: tuple[str, ...] = ()
    rivals: tuple[Estimate, ...] = ()
    known: bool = True

    @property
    def determined(self) -> NDArray[np.bool_]:
        """Which numbers (k,) the record determines: a rival has them within their uncertainty, too.

        None where it is not `known` which motion the record is.
        """
        if not self.known:
            return np.zeros_like(self.estimate.determined)
        wide = self.estimate.factor_95 * self.estimate.errors
        alike = [np.abs(other.x - self.estimate.x) <= wide for other in self.rivals]
        return self.estimate.determined & np.all(alike, axis=0)


def fit_scene(
    scene: Scene | Path | str,
    measured: Measured | Path | str,
    vary: Sequence[str],
    *,
    kind: str | None = None,
    channel: str | None = None,
    signal: str | None = None,
    file: Path | str = "",
    written: Written | None = None,
    progress: Progress = silent,
) -> Fit:
    """Fit numbers of a scene, named by dotted key in `vary`, to the lines of a measured record.

    Small vibration is compared with the eigenvalues, in frequency and growth rate; squeal that has saturated with
    transients of the scene, in the frequencies of `signal` (None: of the velocity of the lining's middle along the
    drum, of several shoes of the first). Which of the two a record, or a part of it, holds is seen
    from the record, unless `kind` states "linear" or "saturated". Weighted least squares in the logarithms of the
    numbers; combinations that the record does not determine stay at the scene's values. A `measured` file is read as
    `read_measured` does, or is a history, of which `channel` names the signal. Raises RequestError for numbers that
    cannot be varied, for another `kind` and for records without lines, and SceneError for a scene without steady
    sliding.
    """
    if not isinstance(scene, Scene):
        written = written or Written(*load_with_tables(scene))
        scene = written.scene
    signal = signal or surface_signal(scene)
    changed, keys = check_request(scene, vary, kind, signal)
    if not isinstance(measured, Measured):
        file, measured = file or measured, read_record(Path(measured), channel, signal)
    progress("lines of the record", 0.0, None)
    asked = None if kind is None else RecordKind(kind)
    reading = read_lines(measured, asked)
    numbers = numbers_of(changed)
    scale = Scale.of(keys, [numbers[key] for key in keys])
    if reading.kind is RecordKind.LINEAR:
        progress("fitting eigenvalues", 0.0, None)
        result = _fit_linear(changed, keys, scale, reading)
    else:

        def change(at: Scene, x: NDArray[np.float64]) -> Scene:
            return at.with_values(dict(zip(keys, scale.numbers(x).tolist(), strict=True)))

        run = Varied(change, scale, signal, progress)
        result = _fit_saturated(changed, keys, run, reading, measured.sample_rate)
    return _report(scene, keys, scale, reading, result, measured, str(file), written or Written(scene))


def surface_signal(scene: Scene) -> str:
    """The signal that is compared where none is named: squeal has the same lines on all shoes."""
    return f"{scene.prefixes[0]}{SURFACE}"


def check_request(
    scene: Scene, vary: Sequence[str], kind: str | None = None, signal: str | None = None
) -> tuple[Scene, tuple[str, ...]]:
    """The scene with a damping ratio if that is varied, and the keys of the numbers to fit.

    Raises RequestError for keys, a kind or a signal that cannot be, and SceneError for a scene without steady sliding.
    """
    if not vary:
        raise RequestError("--vary: name at least one number to fit, such as --vary contact.stiffness")
    changed, keys = variable_numbers(scene, vary)
    if kind is not None and kind not in list(RecordKind):
        raise RequestError(f"--as {kind}: write --as {' or --as '.join(RecordKind)}, or leave it out")
    names, _ = names_of(
        [signal or surface_signal(scene)], SavedHistory(Path(), xarray.Dataset(), scene), option="--signal"
    )
    if len(names) != 1:
        raise RequestError(f"--signal {signal}: there are several such, {', '.join(names)}; take one of them")
    prepare(changed)
    return changed, keys


def read_record(
    path: Path,
    channel: str | None = None,
    signal: str = SURFACE,
    *,
    rate: float | None = None,
    first: float | None = None,
    last: float | None = None,
) -> Measured:
    """Read a channel of a measured file or, where it is a history or the folder of one, a signal of that.

    `first` and `last` (s) are the part to take, `rate` (Hz) is that of a file without one. Raises RequestError.
    """
    if not is_history(path):
        return read_measured(path, channel, rate=rate, first=first, last=last)
    if rate is not None:
        raise RequestError(f"--rate: {path} is a history, which has its own; leave it out")
    saved = read_history(path)
    names, _ = names_of([channel or signal], saved, option="--channel")
    if len(names) != 1:
        raise RequestError(f"--channel {channel}: there are several such, {', '.join(names)}; take one of them")
    time = saved.data["time"].values
    ends = (float(time[0]), float(time[-1]))
    since, until = time_window(str(path), ends, 1 / saved.sample_rate, first, last)
    part = slice(int(np.searchsorted(time, since - 1e-9)), int(np.searchsorted(time, until + 1e-9, side="right")))
    check_count(path, part.stop - part.start)
    (found,) = make_channels(saved, names, part)
    if not np.ptp(found.values) > 0:
        raise RequestError(f"{path}: {names[0]} does not move in this history; take another with --channel")
    return Measured(names[0], found.units, saved.sample_rate, float(time[part.start]), found.values, ())


def _fit_linear(scene: Scene, keys: Sequence[str], scale: Scale, reading: RecordReading) -> _Result:
    """Eigenvalues onto the lines of small vibration."""
    frozen = at_one_time(scene, prepare(scene).stability.time)
    modes, lines = Eigenmodes(frozen, keys), reading.lines
    kept = kept_coordinates(scene)
    found = assign(lines, modes, scale, [mode.name in kept for mode in modes.modes])
    pairs = [(line, k) for line, k in zip(lines, found.modes, strict=True) if k is not None]
    if not pairs:
        near = ", ".join(f"{each.label} {each.frequency_Hz:.0f} Hz {each.growth_rate:+.0f} 1/s" for each in modes.modes)
        heard = ", ".join(f"{line.frequency_Hz:.0f} Hz {line.growth_rate_1_per_s or 0.0:+.0f} 1/s" for line in lines)
        why = f"no measured line ({heard}) is near a mode of the scene in frequency and growth rate ({near})"
        raise RequestError(f"{why}; correct the scene")
    estimate = fit_lines([line for line, _ in pairs], [k for _, k in pairs], modes, scale)
    before, after = modes.at(scale.before).eigenvalues, modes.at(scale.numbers(estimate.x)).eigenvalues
    rows = [_mode_line(line, k, modes.labels, before, after) for line, k in zip(lines, found.modes, strict=True)]
    return _Result(estimate, tuple(rows), 2 * len(pairs), _rival(found, lines, modes.labels))


def _mode_line(
    line: RecordLine,
    k: int | None,
    labels: Sequence[str],
    before: NDArray[np.complex128],
    after: NDArray[np.complex128],
) -> FittedLine:
    predicted: dict[str, Any] = {}
    if k is not None:
        for name, found in (("before", before[k]), ("after", after[k])):
            predicted |= {f"{name}_Hz": found.imag / math.tau, f"{name}_growth_rate_1_per_s": found.real}
        predicted["mode"] = labels[k]
    return FittedLine(
        measured_Hz=line.frequency_Hz,
        uncertainty_Hz=PERCENT_95 * line.frequency_uncertainty_Hz,
        measured_growth_rate_1_per_s=line.growth_rate_1_per_s,
        growth_rate_uncertainty_1_per_s=PERCENT_95 * (line.growth_rate_uncertainty_1_per_s or 0.0),
        **predicted,
    )


def _rival(found: Assignment, lines: Sequence[RecordLine], labels: Sequence[str]) -> str | None:
    """What else the lines could be, in words."""
    if found.rival is None:
        return None
    named = [
        f"{line.frequency_Hz:.1f} Hz as {labels[other] if other is not None else 'no mode'}"
        for line, own, other in zip(lines, found.modes, found.rival, strict=True)
        if own != other
    ]
    return f"another assignment of lines to modes fits as well: {', '.join(named)}"


def _fit_saturated(scene: Scene, keys: Sequence[str], run: Varied, reading: RecordReading, rate: float) -> _Result:
    """Lines of transients onto those of saturated squeal."""
    choice = fit_squeals(scene, run, reading, rate)
    found, used = choice.fitted, [line.frequency_Hz for line in choice.fitted.used]
    before, after = (dict(zip(used, each.tolist(), strict=True)) for each in (found.before, found.after))
    rows = [
        FittedLine(
            measured_Hz=line.frequency_Hz,
            uncertainty_Hz=PERCENT_95 * line.frequency_uncertainty_Hz,
            before_Hz=before.get(line.frequency_Hz),
            after_Hz=after.get(line.frequency_Hz),
        )
        for line in reading.lines
    ]
    apart = found.apart_dB or 0.0
    overtones = f"the measured overtones differ from those of the fitted squeal by {apart:.1f} dB"
    notes = []
    if choice.known and apart > HINT_DB:
        notes.append(f"{overtones}: other numbers of the scene differ, too, or the channel is not {run.signal}")
    for squeals, where in ((choice.squeals, "in the scene"), (choice.later, "at the numbers of the second search")):
        if squeals[1:]:
            notes.append(f"squeals that coexist {where}: {', '.join(f'{f:.0f}' for f in squeals)} Hz")
    ran = found.squeal.scene.simulate.duration
    if ran != scene.simulate.duration:
        notes.append(f"the transients ran for {ran:g} s, since squeal has not settled within the scene's duration")
    others = [
        f"the squeal of {other.before[0]:.0f} Hz, with {_listed(keys, run.scale.numbers(other.estimate.x))}"
        for other in choice.rivals
    ]
    ambiguous = f"another squeal of the scene fits as well: {'; '.join(others)}" if others else None
    if not choice.known:
        ambiguous = f"not determined, for which of the squeals that coexist the record is, is not known: {overtones}"
    return _Result(
        found.estimate,
        tuple(rows),
        len(used),
        ambiguous,
        choice.transients,
        tuple(notes),
        tuple(each.estimate for each in choice.rivals),
        choice.known,
    )


def _listed(keys: Sequence[str], numbers: NDArray[np.float64]) -> str:
    return ", ".join(f"{key} = {to_digits(value, 3)}" for key, value in zip(keys, numbers.tolist(), strict=True))


def _report(
    scene: Scene,
    keys: Sequence[str],
    scale: Scale,
    reading: RecordReading,
    result: _Result,
    measured: Measured,
    file: str,
    written: Written,
) -> Fit:
    estimate = result.estimate
    values, slopes = scale.numbers(estimate.x), np.abs(scale.slopes(estimate.x))
    at_bound = scale.at_bound(estimate.x)
    numbers, texts = [], {}
    for k, key in enumerate(keys):
        standard = float(slopes[k] * estimate.errors[k])
        wide, determined = standard * estimate.factor_95, bool(result.determined[k])
        unit, shown = written.unit(key), written.shown(key, values[k])
        uncertainty = written.shown(key, wide) if determined else None
        digits, own = _digits(shown, uncertainty), float(f"{written.shown(key, scale.before[k]):.14g}")
        # An open number is as it was but for round-off of the lines.
        same = bool(abs(values[k] - scale.before[k]) <= (0.0 if determined else CLOCK * abs(scale.before[k])))
        if not same:
            texts[key] = written.in_digits(key, shown, digits)
        numbers.append(
            FittedNumber(
                key=key,
                unit=unit,
                scene_value=own,
                fitted_value=own if same else float(f"{shown:.{digits}g}"),
                uncertainty=uncertainty,
                standard_uncertainty=written.shown(key, standard) if determined else None,
                determined=determined,
                scene_value_SI=float(scale.before[k]),
                fitted_value_SI=float(values[k]),
                uncertainty_SI=wide if determined else None,
                at_bound=bool(at_bound[k]),
            )
        )
    changed = written.with_values(texts)
    fit = Fit(
        scene=scene,
        file=file,
        channel=measured.name,
        record_kind=reading.kind,
        reason=reading.reason,
        from_s=reading.from_s,
        until_s=reading.until_s,
        sample_rate_Hz=measured.sample_rate,
        numbers=tuple(numbers),
        lines=result.lines,
        observations=result.observations,
        chi_square_per_freedom=estimate.chi_square_per_freedom,
        freedom=estimate.freedom,
        open_combinations=tuple(dict(zip(keys, each.tolist(), strict=True)) for each in estimate.open),
        fixed=_fixed(scene, keys, values, estimate, written) if result.known and not result.rivals else (),
        missed=estimate.missed,
        ambiguous=result.ambiguous,
        transients=result.transients,
        fitted_scene=changed.scene,
        reading=reading,
        written=changed,
    )
    notes = (*describe_notes(fit), *result.notes, *measured.remarks)
    return fit.model_copy(update={"verdict": describe_fit(fit), "notes": notes})


def _fixed(
    scene: Scene, keys: Sequence[str], values: NDArray[np.float64], estimate: Estimate, written: Written
) -> tuple[Combination, ...]:
    """What stays of the numbers in open combinations, where that is one combination and the lines are not missed."""
    free = estimate.open
    parts = np.flatnonzero(np.linalg.norm(free, axis=0) > PART)
    if estimate.missed or parts.size < 2 or parts.size - len(free) != 1 or np.any(values[parts] == 0):
        return ()
    held = np.asarray(np.linalg.svd(free[:, parts])[2][-1], dtype=np.float64)
    held = held / max(held.tolist(), key=abs)
    spread = estimate.factor_95 * math.sqrt(max(held @ estimate.covariance[np.ix_(parts, parts)] @ held, 0.0))
    named = [keys[k] for k in parts.tolist()]
    found = Combination(powers=dict(zip(named, held.tolist(), strict=True)), relative_uncertainty=spread)
    if len({(written.unit(key), unit_of(key, scene)) for key in named}) > 1:
        return (found,)
    # Σ c dp = Σ c p dx is to go as Σ h dx.
    factors = held / values[parts]
    largest = max(factors.tolist(), key=abs)
    factors, slope = factors / largest, 1 / largest
    total = {
        "factors": dict(zip(named, factors.tolist(), strict=True)),
        "value": float(written.shown(named[0], factors @ values[parts])),
        "uncertainty": written.shown(named[0], abs(slope) * spread),
        "unit": written.unit(named[0]),
    }
    return (found.model_copy(update=total),)


def _digits(value: float, uncertainty: float | None) -> int:
    """One digit more than the uncertainty of a number leaves it."""
    digits = 6
    if uncertainty and value:
        digits = math.ceil(-math.log10(min(uncertainty / abs(value), 1.0))) + 1
    return min(max(digits, 3), 10)
