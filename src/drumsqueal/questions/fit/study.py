"""Numbers of a scene that bring its predicted lines onto measured ones, with their uncertainty."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.files.history_file import SavedHistory, read_history
from drumsqueal.findings.columns import to_digits
from drumsqueal.findings.history import time_window
from drumsqueal.physics.composition import kept_coordinates
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.compare.measured import read_measured
from drumsqueal.questions.compare.record import Measured, check_count
from drumsqueal.questions.export.signals import SURFACE, make_channels, names_of
from drumsqueal.questions.fit.choice import fit_squeals
from drumsqueal.questions.fit.estimate import (
    PART,
    PERCENT_95,
    Assignment,
    Eigenmodes,
    Estimate,
    Scale,
    assign,
    fit_lines,
)
from drumsqueal.questions.fit.found import (
    Combination,
    Fit,
    FittedLine,
    FittedNumber,
    describe_fit,
    describe_notes,
)
from drumsqueal.questions.fit.record import CLOCK, RecordKind, RecordLine, RecordReading, read_lines
from drumsqueal.questions.fit.squeal import Varied
from drumsqueal.questions.sensitivity.stabilising import numbers_of, variable_numbers
from drumsqueal.questions.sensitivity.study import at_one_time
from drumsqueal.scene import Scene, load_with_tables
from drumsqueal.scene.quantities import parse_quantity
from drumsqueal.scene.variation import Written, unit_of
from drumsqueal.simulation import prepare

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
    from drumsqueal.questions.formats import is_history

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
    known = {
        "measured_Hz": line.frequency_Hz,
        "uncertainty_Hz": PERCENT_95 * line.frequency_uncertainty_Hz,
        "measured_growth_rate_1_per_s": line.growth_rate_1_per_s,
        "growth_rate_uncertainty_1_per_s": PERCENT_95 * (line.growth_rate_uncertainty_1_per_s or 0.0),
    }
    if k is None:
        return FittedLine(**known)  # pyright: ignore[reportArgumentType]
    return FittedLine(
        **known,  # pyright: ignore[reportArgumentType]
        mode=labels[k],
        before_Hz=before[k].imag / math.tau,
        after_Hz=after[k].imag / math.tau,
        before_growth_rate_1_per_s=before[k].real,
        after_growth_rate_1_per_s=after[k].real,
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
        unit, size = _unit(key, scene, written)
        shown = _rounded(values[k] / size, wide / size if determined else None)
        # An open number is as it was but for round-off of the lines.
        same = bool(abs(values[k] - scale.before[k]) <= (0.0 if determined else CLOCK * abs(scale.before[k])))
        if not same:
            texts[key] = f"{_plain(shown)} {unit}" if unit else float(shown)
        numbers.append(
            FittedNumber(
                key=key,
                unit=unit,
                scene_value=float(f"{scale.before[k] / size:.14g}"),
                fitted_value=float(shown) if not same else float(f"{scale.before[k] / size:.14g}"),
                uncertainty=wide / size if determined else None,
                standard_uncertainty=standard / size if determined else None,
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


def _unit(key: str, scene: Scene, written: Written) -> tuple[str, float]:
    """The unit of a number in the scene file, "" for SI, and what that is in SI."""
    unit = written.unit(key)
    return unit, parse_quantity(f"1 {unit}", unit_of(key, scene)) if unit else 1.0


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
    units = {_unit(key, scene, written) for key in named}
    if len(units) > 1 or len({unit_of(key, scene) for key in named}) > 1:
        return (found,)
    ((unit, size),) = units
    # Σ c dp = Σ c p dx is to go as Σ h dx.
    factors = held / values[parts]
    largest = max(factors.tolist(), key=abs)
    factors, slope = factors / largest, 1 / largest
    total = {
        "factors": dict(zip(named, factors.tolist(), strict=True)),
        "value": float(factors @ values[parts] / size),
        "uncertainty": abs(slope) * spread / size,
        "unit": unit,
    }
    return (found.model_copy(update=total),)


def _rounded(value: float, uncertainty: float | None) -> str:
    """A number with one digit more than its uncertainty leaves."""
    digits = 6
    if uncertainty and value:
        digits = math.ceil(-math.log10(min(uncertainty / abs(value), 1.0))) + 1
    return f"{value:.{min(max(digits, 3), 10)}g}"


def _plain(text: str) -> str:
    """1.30e+08 as 1.3e8."""
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa}e{int(exponent)}" if e else mantissa
