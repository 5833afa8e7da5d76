"""Which kind of motion does a scene or a model settle to? Steady, periodic, quasi-periodic or chaotic, with evidence.

It is run until it has settled, and on for a while. Recurrence and lines of the recorded part are analysed, and motions
that start next to it show how nearby motions separate.
"""

import math
import time as clock
from collections.abc import Callable
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
from drumsqueal.findings.signals.growth import Exponents, fit_growth, lyapunov_exponents, orthonormalised
from drumsqueal.findings.signals.lines import Fundamentals, Lines, find_fundamentals, find_lines, multiples_of
from drumsqueal.findings.signals.regime import Regime, classify
from drumsqueal.findings.vibration import Vibration, boundary_ratios
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.motion.attractor import ClassifiedAttractor, decide_attractor, describe_attractor
from drumsqueal.scene import Scene
from drumsqueal.simulation import check_constant, constant_transient
from drumsqueal.solve import motion
from drumsqueal.solve.motion import pulling, smallest_recorded
from drumsqueal.solve.transient.flow import neighbours, state_size
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.solve.transient.runge_kutta import AUTO

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
    explained_share: float | None = None
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
            explained_share=None if fundamentals is None else fundamentals.explained,
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
