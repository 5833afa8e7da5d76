"""Which kind of motion does a scene or a model settle to? Steady, periodic, quasi-periodic or chaotic, with evidence.

It is run until it has settled, and on for a while. Recurrence and lines of the recorded part are analysed, and motions
that start next to it show how nearby motions separate. These decide together with fundamental frequencies: on every
attractor of an autonomous flow but an equilibrium one exponent is zero; on a torus of k fundamental frequencies (k = 1:
a limit cycle) k exponents are zero and the others negative; on a chaotic attractor the largest is positive. Where the
evidence contradicts itself, or where an exponent's sign is not known, the kind is not determined.

Source: J.-P. Eckmann and D. Ruelle, "Ergodic theory of chaos and strange attractors", Reviews of Modern Physics 57,
1985.
"""

import math
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from typing import Any, cast, overload

import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import computed_field

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.decay import decay_to_rest, slowest
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.saturation import size_of_motion
from drumsqueal.findings.schema import Finding, Findings, Held
from drumsqueal.findings.signals.growth import SURE, Exponents, fit_growth, lyapunov_exponents, orthonormalised
from drumsqueal.findings.signals.lines import Fundamentals, Lines, find_fundamentals, find_lines, multiples_of
from drumsqueal.findings.signals.regime import Regime, classify, listed, written_frequencies
from drumsqueal.findings.vibration import Vibration, boundary_ratios
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.scene import Scene
from drumsqueal.simulation import check_constant, constant_transient
from drumsqueal.solve import motion
from drumsqueal.solve.motion import pulling, smallest_recorded
from drumsqueal.solve.transient.flow import neighbours, state_size
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.solve.transient.runge_kutta import AUTO

LATER = 2.0  # the regime is read from the later half of a record
LONGER, MOST_LONGER = 2.0, 10.0  # times the record: a rate that is all noise does not say which would resolve it
LEAST_FOLDS = 1e-6  # change of a disturbance over the whole record, below which it is the integration's own
NUMBERS = ("no", "one", "two", "three", "four")


class Doubt(StrEnum):
    """Why an attractor is not determined."""

    REGIME = "no stationary motion that was recorded for long enough"
    NO_EXPONENTS = "record too short for Lyapunov exponents"
    NO_ZERO = "no Lyapunov exponent is zero"
    POSITIVE = "a Lyapunov exponent is positive, but the lines are sharp"
    NOT_POSITIVE = "irregular, but no Lyapunov exponent is positive"
    FEWER_ZEROS = "fewer Lyapunov exponents are zero than there are fundamental frequencies"
    MORE_ZEROS = "more Lyapunov exponents are zero than there are fundamental frequencies"
    UNKNOWN_SIGN = "the uncertainty of a Lyapunov exponent is too large to know its sign"


@dataclass(frozen=True)
class ClassifiedAttractor:
    """The kind of an attractor and the numbers that decided it.

    `frequencies_Hz` are the fundamental frequencies by recurrence and lines, with `uncertainties_Hz`. `zero`,
    `positive` and `negative` count the exponents that are so beyond doubt, None where there are none. `doubt` is the
    reason why the kind is not determined, and `record_needed_s` the record (s) that it then takes at least; None where
    nothing decays, and no record may decide.
    """

    kind: Kind
    frequencies_Hz: tuple[float, ...] = ()
    uncertainties_Hz: tuple[float, ...] = ()
    zero: int | None = None
    positive: int | None = None
    negative: int | None = None
    doubt: Doubt | None = None
    record_needed_s: float | None = None


def decide_attractor(
    regime: Regime,
    fundamentals: Fundamentals | None,
    exponents: Exponents | None,
    record_s: float,
    exponents_need_s: float | None,
) -> ClassifiedAttractor:
    """Decide the kind of attractor from a record (s), of whose later half are regime and fundamental frequencies.

    `exponents_need_s` is the shortest record (s) that gives exponents, None where none does: there the regime decides.
    """
    found = _read_regime(regime, fundamentals, record_s)
    if exponents is not None:
        value, sure = exponents.exponent_1_per_s, exponents.significant
        counts = int(exponents.zero.sum()), int((sure & (value > 0)).sum()), int((sure & (value < 0)).sum())
        found = replace(found, zero=counts[0], positive=counts[1], negative=counts[2])
    if _drifts(regime) and found.positive and found.zero:  # the mean of a chaotic motion wanders
        found = replace(found, kind=Kind.IRREGULAR)
    doubt = _doubt(found, exponents, expected=exponents_need_s is not None)
    if doubt is not None:
        needed = max(
            LATER * (regime.record_needed_s or 0.0),
            LATER * Criteria.periods / min(found.frequencies_Hz, default=math.inf),
        )
        if needed <= record_s:  # enough, by what it needs, and yet it did not do
            needed = LONGER * record_s
        if doubt is not Doubt.REGIME and exponents is not None:
            needed = max(needed, _factor(found, exponents) * float(exponents.time_s[-1]), exponents_need_s or 0.0)
            if doubt is Doubt.MORE_ZEROS and not _fading(exponents).any():
                needed = None
        return replace(found, kind=Kind.UNDECIDED, doubt=doubt, record_needed_s=needed)
    return replace(found, kind=Kind.CHAOTIC) if found.positive else found


def _drifts(regime: Regime) -> bool:
    """Whether a regime is unknown though its record holds enough periods."""
    return regime.kind is Kind.UNDECIDED and regime.amplitude_drift is not None and regime.record_needed_s is None


def _read_regime(regime: Regime, fundamentals: Fundamentals | None, record_s: float) -> ClassifiedAttractor:
    """What recurrence and lines say alone."""
    frequencies, known = regime.base_frequencies_Hz, regime.base_uncertainties_Hz
    if regime.kind is Kind.UNDECIDED:
        return ClassifiedAttractor(Kind.UNDECIDED, frequencies, known)
    kind = regime.kind
    if kind is Kind.QUASI_PERIODIC and fundamentals is not None and fundamentals.frequency_Hz.size:
        frequencies, known = tuple(fundamentals.frequency_Hz.tolist()), tuple(fundamentals.uncertainty_Hz.tolist())
        if len(frequencies) == 1:  # weaker lines than the regime's show that the frequencies are locked
            long_enough = record_s / LATER * frequencies[0] >= Criteria.periods
            kind = Kind.PERIODIC if long_enough else Kind.UNDECIDED
    return ClassifiedAttractor(kind, frequencies, known or (0.0,) * len(frequencies))


def _doubt(found: ClassifiedAttractor, exponents: Exponents | None, *, expected: bool) -> Doubt | None:
    """The first contradiction in the evidence, None where there is none."""
    if not found.kind.squeals:
        return Doubt.REGIME if found.kind is Kind.UNDECIDED else None
    if exponents is None or found.zero is None or found.negative is None:
        return Doubt.NO_EXPONENTS if expected and found.kind is not Kind.PERIODIC else None  # recurrence is enough
    followed, frequencies = exponents.exponent_1_per_s.size, len(found.frequencies_Hz)
    unknown = ~(exponents.significant | exponents.zero)
    if found.negative and not found.zero and not unknown.any():
        return Doubt.NO_ZERO
    if found.kind is Kind.IRREGULAR:
        return None if found.positive else Doubt.NOT_POSITIVE
    if found.positive:
        return Doubt.POSITIVE
    if found.zero + unknown.sum() < min(frequencies, followed):
        return Doubt.FEWER_ZEROS
    if found.zero < min(frequencies, followed) or unknown[: frequencies + 1].any() or not _separated(exponents):
        return Doubt.UNKNOWN_SIGN
    return Doubt.MORE_ZEROS if found.zero > frequencies else None


def _separated(exponents: Exponents) -> bool:
    """Whether the exponents that are zero are known well enough to be none of the decay rates."""
    value, error = exponents.exponent_1_per_s, SURE * exponents.standard_error_1_per_s
    negative = exponents.significant & (value < 0)
    lowest = np.min((value - error)[exponents.zero], initial=np.inf)
    return bool(lowest > np.max((value + error)[negative], initial=-np.inf))


def _fading(exponents: Exponents) -> NDArray[np.bool_]:
    """Which exponents (k,) are those of disturbances that decay, however slowly, beyond noise and round-off."""
    least = np.maximum(SURE * exponents.standard_error_1_per_s, LEAST_FOLDS / exponents.averaged_s)
    return exponents.exponent_1_per_s < -least


def _factor(found: ClassifiedAttractor, exponents: Exponents) -> float:
    """How many times the record has to be so long for the exponents that should not be zero to differ from it."""
    size = np.maximum(np.abs(exponents.exponent_1_per_s), LEAST_FOLDS / exponents.averaged_s)
    noise = (SURE * exponents.standard_error_1_per_s / size) ** 2  # which falls as the root of the record
    times = np.maximum(2 * exponents.resolution_1_per_s / size, noise)
    times = np.where(_fading(exponents), times, np.minimum(times, MOST_LONGER))
    should_be_zero = np.argsort(size)[: max(1, len(found.frequencies_Hz))]
    open_ = ~exponents.significant
    open_[should_be_zero] = False
    return max(LONGER, float(np.max(times[open_], initial=0.0)))


def describe_attractor(
    found: ClassifiedAttractor,
    regime: Regime,
    exponents: Exponents | None,
    limited_to_s: float | None = None,
    *,
    options: bool = True,
) -> str:
    """Why the attractor is of this kind, or why that is not determined and which record it takes.

    `limited_to_s` is the computing time (s) that cut the record or the exponents short, None where nothing did.
    `options` names the options of the command that set both.
    """
    if found.doubt is None:
        return " ".join((*_evidence(found, exponents), *(() if _drifts(regime) else (regime.reason,))))
    if found.doubt is Doubt.REGIME or exponents is None:
        missing = "Lines alone do not decide, and no Lyapunov exponents are known. "
        text = f"{missing if found.doubt is Doubt.NO_EXPONENTS else ''}{regime.reason}"
    else:
        text = _contradiction(found, exponents)
    if found.record_needed_s is None:
        return f"{text} No disturbance is seen to decay: where nothing damps the motion, no record decides."
    needed = _rounded_up(found.record_needed_s)
    record = f'{needed} s (--duration "{needed} s")' if options else f"{needed} s"
    if limited_to_s is not None:
        record += f" and more computing time than {limited_to_s:g} s{' (--at-most)' * options}"
    return f"{text} This needs a record of at least {record}."


def _evidence(found: ClassifiedAttractor, exponents: Exponents | None) -> tuple[str, ...]:
    if exponents is None or found.zero is None:
        return ()
    (largest,) = written_exponents(exponents)[:1]
    if found.kind is Kind.CHAOTIC:
        return (f"The largest Lyapunov exponent is {largest} 1/s: nearby motions separate exponentially.",)
    zeros = f"{NUMBERS[found.zero].capitalize()} Lyapunov exponent{' is' if found.zero == 1 else 's are'} zero"
    return (
        f"{zeros} within the uncertainty, as {_frequencies(found)} require{'s' * (len(found.frequencies_Hz) == 1)}.",
    )


def _contradiction(found: ClassifiedAttractor, exponents: Exponents) -> str:
    """The contradiction of a motion whose exponents were followed."""
    shown, count = written_exponents(exponents), len(found.frequencies_Hz)
    unknown = [
        text
        for text, sure, zero in zip(shown, exponents.significant, exponents.zero, strict=True)
        if not (sure or zero)
    ]
    zeros = f"{NUMBERS[count]} Lyapunov exponent{'s' * (count != 1)} of zero"
    needs = f"{_frequencies(found)} require{'s' * (count == 1)} {zeros}"
    needs = needs[:1].upper() + needs[1:]
    match found.doubt:
        case Doubt.NO_ZERO:
            return f"An attractor that moves has a Lyapunov exponent of zero, but none of {listed(shown)} 1/s is."
        case Doubt.POSITIVE:
            return f"{needs} and none above it, but the largest is {shown[0]} 1/s, as in chaos."
        case Doubt.NOT_POSITIVE:
            return f"The motion is irregular, but its largest Lyapunov exponent, {shown[0]} 1/s, does not show chaos."
        case Doubt.FEWER_ZEROS:
            most = (found.zero or 0) + len(unknown)
            return f"{needs}, but of {listed(shown)} 1/s at most {NUMBERS[most]} can be zero."
        case Doubt.MORE_ZEROS:
            return (
                f"{needs}, but {NUMBERS[found.zero or 0]} of {listed(shown)} 1/s cannot be distinguished from zero: "
                "there is another frequency, or a disturbance decays too slowly for this record."
            )
        case _:
            which = listed(unknown or shown[: (found.zero or 0) + 1])
            return f"{needs}, but the uncertainty of {which} 1/s is too large to distinguish zero from decay."


def written_exponents(exponents: Exponents) -> list[str]:
    """Each exponent with the uncertainty that decides on its sign (1/s), to the digits that this one has."""
    shown = []
    for value, error in zip(exponents.exponent_1_per_s, exponents.uncertainty_1_per_s, strict=True):
        digits = max(0, 1 - math.floor(math.log10(error)))
        shown.append(f"{value:+.{digits}f} ± {error:.{digits}f}".replace("-", "−"))
    return shown


def _rounded_up(seconds: float) -> str:
    """A time to two digits that is not shorter."""
    digits = 1 - math.floor(math.log10(seconds))
    return f"{math.ceil(seconds * 10.0**digits * (1 - 1e-9)) / 10.0**digits:g}"


def _frequencies(found: ClassifiedAttractor) -> str:
    count = len(found.frequencies_Hz)
    listed = written_frequencies(found.frequencies_Hz, found.uncertainties_Hz, 6)
    return f"{NUMBERS[count]} fundamental frequenc{'y' if count == 1 else 'ies'} ({listed})"


LONGEST_START = 5.0  # s given to the start, settled or not
BLOCK = 0.25  # s, of which two are compared
INTERVAL = 5e-3  # s from one orthonormalisation of the tangents to the next
FEWEST_INTERVALS = 100
CUT_OFF = "Lyapunov exponents were not determined: the study was cut off before nearby motions had been followed"


class PoincareSection(Finding):
    """Displacement of the coordinate `other` and velocity of `across` where the latter goes up through its mean.

    `values` (points, 2) in SI; `size` is the peak-to-peak value of both over the whole motion.
    """

    across: str = ""
    other: str = ""
    points: int = 0
    size: tuple[float, float] = (0.0, 0.0)
    values: Any = Held


class SettledMotion(Finding):
    """The attractor that a motion is on and what decided it.

    `recorded_from_s` is when the record begins, `settled` whether the motion had settled by then. `lines` and
    `fundamentals` are None at rest; `exponents` None where they were not determined, and `not_determined` says what was
    not, and why.
    """

    printed_by = "drumsqueal.questions.motion.answer.print_study"
    attractor: ClassifiedAttractor
    reason: str
    recorded_from_s: float
    settled: bool
    recorded_for_s: float
    regime: Regime
    section: PoincareSection
    not_determined: tuple[str, ...]
    coordinates: tuple[str, ...]
    base_frequencies_Hz: tuple[float, ...] | None = None
    base_uncertainties_Hz: tuple[float, ...] | None = None
    explained_fraction: float | None = None
    resolution_Hz: float | None = None
    lyapunov_exponents_1_per_s: tuple[float, ...] | None = None
    lyapunov_standard_errors_1_per_s: tuple[float, ...] | None = None
    lyapunov_uncertainties_1_per_s: tuple[float, ...] | None = None
    chaotic: bool | None = None
    lines: Lines | None = Held
    fundamentals: Fundamentals | None = Held
    exponents: Exponents | None = Held

    @computed_field
    @property
    def kind(self) -> Kind:
        """The kind of the attractor."""
        return self.attractor.kind


class MotionStudy(SettledMotion, Findings):
    """A `SettledMotion` of a scene, with the scene: what `study_motion(scene)` returns."""


@overload
def study_motion(
    scene: Scene,
    duration: float = ...,
    *,
    at_most: float = ...,
    progress: Progress = ...,
    keep: Callable[[MotionStudy], None] = ...,
) -> MotionStudy: ...


@overload
def study_motion(
    scene: Model,
    start: motion.Start,
    duration: float,
    *,
    sample_rate: float,
    tolerance: float = ...,
    solver: str = ...,
    at_most: float = ...,
    progress: Progress = ...,
    keep: Callable[[SettledMotion], None] = ...,
) -> SettledMotion: ...


def study_motion(  # pyright: ignore[reportInconsistentOverload]
    scene: Scene | Model,
    start: motion.Start | float | None = None,
    duration: float | None = None,
    *,
    sample_rate: float = 0.0,
    tolerance: float = 1e-6,
    solver: str = AUTO,
    at_most: float = 600.0,
    progress: Progress = silent,
    keep: Callable[[Any], None] = lambda _: None,
) -> SettledMotion | MotionStudy:
    """Determine which kind of motion a scene settles to: `study_motion(scene).kind`, `.fundamentals`, `.exponents`.

    It runs until the trend of every coordinate's rms over half a second is below 1e-3 or within three standard errors
    (five seconds at most), then for `duration` (s), of whose later half lines are found, then once more from there with
    nearby motions. Where recurrence, lines and exponents contradict each other, the kind is not determined and
    `.attractor.record_needed_s` is the duration that it takes at least. `at_most` limits the computing time (s) of
    each of both; what was cut short or not determined is in `not_determined`. `keep` takes what is known
    before nearby motions are followed.

    `study_motion(model, start, duration, sample_rate=...)` takes a model with the start and the sample rate (Hz) that
    `integrate` takes. In place of half a second and five seconds it then takes 500 and 5000 periods of its slowest
    mode. Raises SceneError for a scene that cannot be run or whose drum speed or load change, ValueError for such a
    model, and IntegrationError when nothing was computed.

    ```pycon
    >>> def block(speed):
    ...     law = drumsqueal.ExponentialLaw(0.5, 0.3, 2.0)
    ...     return drumsqueal.block_on_belt(law, belt_speed=speed, damping=0.1)
    >>> motion = drumsqueal.study_motion(block(0.5), {"displacement": {"X": 0.1}}, 600.0, sample_rate=20.0)
    >>> str(motion.kind), round(float(motion.fundamentals.frequency_Hz[0]), 4)
    ('periodic', 0.1574)
    ```
    """
    if isinstance(scene, Scene):
        length = start if isinstance(start, int | float) else 5.0 if duration is None else duration
        longest = _whole_samples(LONGEST_START + length, scene.simulate.sample_rate)
        transient = constant_transient(check_constant(scene).with_values({"simulate.duration": longest}))
        study = _Study(transient, length, at_most, 1.0, progress)
        return study.find(partial(MotionStudy, scene=scene), keep)
    length = duration or 0.0
    how = {"duration": length, "sample_rate": sample_rate, "tolerance": tolerance, "solver": solver}
    transient = motion.constant_transient(scene, cast("motion.Start", start or {}), **how)
    # 1000 Hz is typical of a brake, which these times are for; of a model they are as many periods of its slowest mode
    slower = 1000.0 / min((mode.frequency_Hz for mode in transient.stability.oscillations), default=1000.0)
    how["duration"] = _whole_samples(LONGEST_START * slower + length, sample_rate)
    return _Study(transient._replace(how=how), length, at_most, slower, progress).find(SettledMotion, keep)


def _whole_samples(duration: float, rate: float) -> float:
    return math.ceil(duration * rate * (1 - 1e-12)) / rate


class _Study:
    """A transient that is recorded for a duration (s) once it has settled, and then followed with nearby motions.

    Computing takes `at_most` (s) for each of both. Times in seconds are `slower` times longer than for a brake.
    `limits` holds what was cut short or not determined, and why.
    """

    def __init__(
        self, transient: motion.Transient, duration: float, at_most: float, slower: float, progress: Progress
    ) -> None:
        if not duration > 0:
            raise ValueError(f"the duration must be positive, got {duration}")
        self.transient, self.duration, self.at_most, self.progress = transient, duration, at_most, progress
        self.block, self.interval, self.longest_start = BLOCK * slower, INTERVAL * slower, LONGEST_START * slower
        self.rate, self.limits = transient.how["sample_rate"], []

    def find(self, begin: Callable[..., SettledMotion], keep: Callable[[Any], None]) -> Any:
        """Record and judge; `begin` makes the findings, and `keep` takes them before nearby motions are followed."""
        model, stability = self.transient.model, self.transient.stability
        settled, start, chunks = self.record()
        vibration = Vibration.of(chunks, stability)
        if isinstance(model.contact, Contact):
            scale = size_of_motion(vibration, stability, model)
        else:
            scale = np.maximum(vibration.largest(), np.finfo(np.float64).tiny)
        recorded = vibration.time.size / vibration.sample_rate
        modes = stability.unstable or stability.oscillations
        lowest = min((mode.frequency_Hz for mode in modes), default=2 * Criteria.periods / recorded) / 2
        # What is left of the start after settling would widen lines; tangents need the whole time.
        late = slice(vibration.time.size // 2, None)
        displacement = vibration.displacement
        regime = classify(displacement[late], vibration.sample_rate, scale=scale, lowest_frequency=lowest)
        regime = decay_to_rest(regime, vibration, late, stability, stability.modes, model)
        moving = np.ptp(displacement, axis=0) / 2 >= Criteria.steady * scale
        coordinates = tuple(name for name, moves in zip(vibration.coordinates, moving, strict=True) if moves)
        lines = fundamentals = None
        if coordinates and regime.kind is not Kind.STEADY:
            self.progress("lines", 0.0, None)
            part = displacement[late][-150_000:, moving]  # samples at most
            # 3e-3 of the strongest: weaker lines than the regime's show that frequencies are locked
            lines = find_lines(part, vibration.sample_rate, floor=3e-3)
            fundamentals = find_fundamentals(lines)
            if regime.kind is Kind.PERIODIC and fundamentals.frequency_Hz.size > 1:
                fundamentals = multiples_of(lines, regime.base_frequencies_Hz[0])
        if not settled and regime.kind is not Kind.STEADY:
            self.limits.append(f"the motion had not settled after {start:.3g} s")
        options = begin is not SettledMotion

        def judged(exponents: Exponents | None, least: float | None, limited: float | None = None) -> dict[str, Any]:
            attractor = decide_attractor(regime, fundamentals, exponents, recorded, least)
            reason = describe_attractor(attractor, regime, exponents, limited, options=options)
            numbers = {} if exponents is None else _numbers(exponents, attractor)
            return numbers | {"attractor": attractor, "reason": reason, "not_determined": tuple(self.limits)}

        found = begin(
            **judged(None, None),
            recorded_from_s=start,
            settled=settled,
            recorded_for_s=recorded,
            regime=regime,
            section=_section(vibration, stability.mass, coordinates),
            coordinates=coordinates,
            lines=lines,
            fundamentals=fundamentals,
            base_frequencies_Hz=None if fundamentals is None else tuple(fundamentals.frequency_Hz.tolist()),
            base_uncertainties_Hz=None if fundamentals is None else tuple(fundamentals.uncertainty_Hz.tolist()),
            explained_fraction=None if fundamentals is None else fundamentals.explained,
            resolution_Hz=None if lines is None else lines.resolution_Hz,
        )
        if lines is None:
            return found
        keep(found.model_copy(update={"not_determined": (*self.limits, CUT_OFF)}))
        why_not = _no_tangents(model, chunks)
        exponents = None if why_not else self.exponents(chunks[0])
        if why_not:
            self.limits.append(f"Lyapunov exponents were not determined: {why_not}")
        least = None if why_not else FEWEST_INTERVALS * self.interval
        reached = recorded if exponents is None else min(recorded, float(exponents.time_s[-1]))
        limited = self.at_most if reached < self.duration - 2 * self.interval else None
        return found.model_copy(update=judged(exponents, least, limited))

    def record(self) -> tuple[bool, float, list[Chunk]]:
        """Run until settled and on: whether it settled, when the record begins (s), and its chunks."""
        began, smallest = clock.monotonic(), np.inf
        kept: list[Chunk] = []
        start: float | None = None
        settled = False

        def take(chunk: Chunk) -> bool:
            nonlocal kept, start, settled, smallest
            smallest = min(smallest, smallest_recorded(self.transient.model, chunk.observation.normal_force))
            now = float(chunk.time[-1])
            kept.append(chunk)
            if start is None:
                kept = [each for each in kept if each.time[-1] > now - 2 * self.block - 1e-9]
                settled = _settled(kept, self.rate, self.block) or self._at_rest(kept)
                if settled or now >= self.longest_start - 1e-9:
                    start, kept = now, [chunk]
            elif now >= start + self.duration - 1e-9:
                return True
            if clock.monotonic() - began > self.at_most:
                self.limits.append(f"computing was limited to {self.at_most:g} s: the record ends at {now:.4g} s")
                return True
            return False

        try:
            self.transient.follow(take, self.progress, what="settling and recording")
        except IntegrationError as error:
            self.limits.append(f"the integration failed: {error}")
            if not kept:
                raise
        self.limits += filter(None, [pulling(smallest)])
        return settled, float(kept[0].time[0]) if start is None else start, kept

    def _at_rest(self, chunks: list[Chunk]) -> bool:
        """Whether what is left over the last two blocks is no motion, where every mode decays and nothing drives it."""
        model, stability = self.transient.model, self.transient.stability
        if model.forced or slowest(stability, stability.modes) is None:
            return False
        whole = chunks[-1].time[-1] - chunks[0].time[0] > self.block
        velocity = np.concatenate([chunk.velocity for chunk in chunks])
        vibration = np.concatenate([chunk.displacement for chunk in chunks]) - stability.steady_state
        return bool(whole and max(boundary_ratios(model, vibration, velocity)) < Criteria.steady)

    def exponents(self, first: Chunk) -> Exponents | None:
        """The largest Lyapunov exponents along the motion from the end of a chunk; None where that is too short."""
        model, interval, limits = self.transient.model, self.interval, self.limits
        size = np.asarray(state_size(model, first.displacement[-1], first.velocity[-1]))
        state = np.concatenate([first.displacement[-1], first.velocity[-1]]) / size
        tangents = np.linalg.qr(np.random.default_rng(0).normal(size=(size.size, min(4, size.size))))[0]
        logs, began = [], clock.monotonic()
        for k in range(round(self.duration / interval)):
            self.progress("nearby motions", k * interval, self.duration)
            state, moved = (np.asarray(each) for each in neighbours(model, size, state, tangents, interval))
            if not (np.all(np.isfinite(state)) and np.all(np.isfinite(moved))):
                limits.append(f"nearby motions were lost after {k * interval:.4g} s")
                break
            tangents, grown = orthonormalised(moved)
            logs.append(grown)
            if clock.monotonic() - began > self.at_most:
                followed = f"nearby motions were followed for {k * interval:.4g} s"
                limits.append(f"computing was limited to {self.at_most:g} s: {followed}")
                break
        if len(logs) < FEWEST_INTERVALS:
            least = f"{len(logs) * interval:.3g} s are too short, and {FEWEST_INTERVALS * interval:.4g} s the least"
            limits.append(f"Lyapunov exponents were not determined: {least}")
            return None
        return lyapunov_exponents(np.array(logs), interval)


def _numbers(exponents: Exponents, attractor: ClassifiedAttractor) -> dict[str, Any]:
    return {
        "exponents": exponents,
        "lyapunov_exponents_1_per_s": tuple(exponents.exponent_1_per_s.tolist()),
        "lyapunov_standard_errors_1_per_s": tuple(exponents.standard_error_1_per_s.tolist()),
        "lyapunov_uncertainties_1_per_s": tuple(exponents.uncertainty_1_per_s.tolist()),
        "chaotic": None if attractor.kind is Kind.UNDECIDED else exponents.chaotic,
    }


def _settled(chunks: list[Chunk], rate: float, block: float) -> bool:
    """Whether no coordinate's rms has a trend over the last two blocks (s)."""
    velocity = np.concatenate([chunk.velocity for chunk in chunks])
    samples = round(2 * block * rate)
    if velocity.shape[0] < samples:
        return False
    parts = np.array_split(velocity[-samples:], 20)
    size = np.array([part.std(axis=0) for part in parts])
    time = (np.arange(len(parts)) + 0.5) * 2 * block / len(parts)
    for column in size.T:
        if not np.all(column > 0):
            continue
        trend = fit_growth(time, column)
        change, error = (abs(x) * 2 * block for x in (trend.rate_1_per_s, trend.standard_error))
        if change > max(Criteria.trend, Criteria.trend_errors * error) or error > Criteria.unclear_trend:
            return False
    return True


def _no_tangents(model: Model, chunks: list[Chunk]) -> str:
    """Why nearby motions cannot be followed, empty where they can."""
    if not all(model.body.symmetric):
        return "the motion is in space, where nearby motions take too long"
    if model.forced:
        return "a harmonic force acts, and nearby motions are followed along steady drives only"
    if any(chunk.changes for chunk in chunks):
        return "the contact sticks, and there the motion has no derivative"
    return ""


def _section(vibration: Vibration, mass: NDArray[np.float64], coordinates: tuple[str, ...]) -> PoincareSection:
    """Find the points where the coordinate with most kinetic energy goes up through its mean."""
    if not coordinates:
        return PoincareSection()
    energy = mass * np.mean(vibration.velocity**2, axis=0)
    ranked = sorted(range(energy.size), key=lambda k: -energy[k])
    across, other = ranked[0], ranked[min(1, len(ranked) - 1)]
    time, q, v = vibration.time, vibration.displacement, vibration.velocity
    curve = scipy.interpolate.CubicHermiteSpline(time, q[:, across] - q[:, across].mean(), v[:, across])
    at = curve.roots(extrapolate=False)
    at = at[np.isfinite(at) & (curve(at, 1) > 0)]
    if not at.size:
        return PoincareSection()
    points = np.column_stack([scipy.interpolate.CubicHermiteSpline(time, q[:, other], v[:, other])(at), curve(at, 1)])
    size = float(np.ptp(q[:, other])), float(np.ptp(v[:, across]))
    names = vibration.coordinates
    return PoincareSection(across=names[across], other=names[other], points=len(points), size=size, values=points)
