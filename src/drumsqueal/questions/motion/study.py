"""Which kind of motion does a scene settle to? Steady, periodic, quasi-periodic or chaotic, with all evidence.

The scene is run until it has settled, and on for a while. The recorded part is asked for its recurrence and its lines;
motions beside it say how nearby motions separate.
"""

import math
import time as clock
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import computed_field
from scipy.interpolate import CubicHermiteSpline

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.boundaries import boundary_ratios
from drumsqueal.findings.decay import decay_to_rest, slowest
from drumsqueal.findings.history import COMPLETE, to_dataset
from drumsqueal.findings.part import Finding, Held
from drumsqueal.findings.saturation import size_of_motion
from drumsqueal.findings.schema import Findings
from drumsqueal.findings.signals.fundamentals import Fundamentals, find_fundamentals
from drumsqueal.findings.signals.growth import fit_growth
from drumsqueal.findings.signals.lines import Lines, find_lines
from drumsqueal.findings.signals.lyapunov import Exponents, lyapunov_exponents, orthonormalised
from drumsqueal.findings.signals.regime import PERIODS_NEEDED, STEADY, Regime, classify
from drumsqueal.findings.vibration import Vibration
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.motion.attractor import Attractor, Kind, decide_attractor, describe_attractor
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.simulation import Prepared, check_sample_rate, follow, prepare, steady_at_start
from drumsqueal.solve.linear.modes import Mode
from drumsqueal.solve.transient.flow import neighbours, state_size
from drumsqueal.solve.transient.integrate import Chunk

DURATION = 5.0  # s
LONGEST_START = 5.0  # s given to the start, settled or not
BLOCK, PARTS = 0.25, 10  # s, of which two are compared, each in parts
SETTLED_CHANGE, SURE = 1e-3, 3.0  # of the rms over two blocks; or in standard errors of its trend
UNCLEAR = 0.02  # of the rms: a trend less certain than that, as where growth ends, tells nothing
INTERVAL = 5e-3  # s from one orthonormalisation of the tangents to the next
TANGENTS = 4
MOST_FOR_LINES = 150_000  # samples
FLOOR = 3e-3
AT_MOST = 600.0  # s of computing
FEWEST_INTERVALS = 100
LEAST_FOLLOWED = FEWEST_INTERVALS * INTERVAL  # s
CUT_OFF = "Lyapunov exponents were not determined: the study was cut off before nearby motions had been followed"


class Section(Finding):
    """Displacement of the coordinate `other` and velocity of `across` where the latter goes up through its mean.

    `values` (points, 2) in SI; `size` is the peak-to-peak value of both over the whole motion.
    """

    across: str = ""
    other: str = ""
    points: int = 0
    size: tuple[float, float] = (0.0, 0.0)
    values: Any = Held


class MotionStudy(Findings):
    """The attractor that a motion is on and what decided it.

    `recorded_from_s` is when the record begins, `settled` whether the motion had settled by then. `lines` and
    `fundamentals` are None at rest; `exponents` None where they were not determined, and `not_determined` says what was
    not, and why.
    """

    attractor: Attractor
    reason: str
    recorded_from_s: float
    settled: bool
    recorded_for_s: float
    regime: Regime
    section: Section
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


def checked(scene: Scene) -> Scene:
    """Return the scene, or raise SceneError where its drum speed or load change: its motion is of no one kind."""
    for keys, value in ((("drum", "speed"), scene.drum.speed), (("contact", "normal_load"), scene.contact.normal_load)):
        if isinstance(value, Profile):
            raise SceneError("this changes with time, and the motion with it; give one value to ask for its kind", keys)
    if scene.temperature is not None:
        raise SceneError(
            "the lining warms up, and its motion is of no one kind; leave the temperature out (temperature=none)",
            ("temperature",),
        )
    return scene


def study_motion(
    scene: Scene,
    duration: float = DURATION,
    *,
    at_most: float = AT_MOST,
    progress: Progress = silent,
    keep: Callable[[MotionStudy], None] = lambda _: None,
) -> MotionStudy:
    """Determine which kind of motion a scene settles to: `study_motion(scene).kind`, `.fundamentals`, `.exponents`.

    It runs until the trend of every coordinate's rms over half a second is below 1e-3 or within three standard errors
    (five seconds at most), then for `duration` (s), of which the later half is asked for lines, then once more from
    there with nearby motions. Where recurrence, lines and exponents contradict each other, the kind is not determined
    and `.attractor.record_needed_s` is the duration that it takes at least. `at_most` bounds the computing time (s) of
    each of both; what was cut short or not determined is in `not_determined`. `keep` takes what is known
    before nearby motions are followed. Raises SceneError for a scene that cannot be run or whose drum speed or load
    change, and IntegrationError when nothing was computed.
    """
    if not duration > 0:
        raise ValueError(f"the duration must be positive, got {duration}")
    rate = scene.simulate.sample_rate
    longest = math.ceil((LONGEST_START + duration) * rate * (1 - 1e-12)) / rate  # whole samples
    whole = checked(scene).with_values({"simulate.duration": longest})
    prepared = prepare(whole)
    check_sample_rate(prepared)
    limits: list[str] = []
    settled, start, chunks = _record(prepared, duration, at_most, progress, limits)
    history = to_dataset(chunks, whole, prepared.model.names, COMPLETE)
    vibration = Vibration(history, prepared.stability)
    rate, scale = vibration.sample_rate, size_of_motion(vibration, prepared.stability, prepared.linear)
    recorded = vibration.time.size / rate
    modes = prepared.stability.unstable or prepared.stability.modes
    able = _able(prepared)
    lowest = min((mode.frequency_Hz for mode in modes), default=2 * PERIODS_NEEDED / recorded) / 2
    # What is left of the start after settling would widen lines; tangents need the whole time.
    late = slice(vibration.time.size // 2, None)
    regime = classify(vibration.displacement[late], rate, scale=scale, lowest_frequency=lowest)
    regime = decay_to_rest(regime, vibration, late, prepared.stability, able, prepared.linear)
    moving = np.ptp(vibration.displacement, axis=0) / 2 >= STEADY * scale
    coordinates = tuple(name for name, moves in zip(vibration.coordinates, moving, strict=True) if moves)
    section = _section(vibration, prepared.stability.mass, coordinates)
    lines = fundamentals = None
    if coordinates and regime.kind != "steady":
        progress("lines", 0.0, None)
        lines = find_lines(vibration.displacement[late][-MOST_FOR_LINES:, moving], rate, floor=FLOOR)
        fundamentals = find_fundamentals(lines)
    if not settled and regime.kind != "steady":
        limits.append(f"the motion had not settled after {start:.3g} s")
    attractor = decide_attractor(regime, fundamentals, None, recorded, None)
    study = MotionStudy(
        scene=scene,
        attractor=attractor,
        reason=describe_attractor(attractor, regime, None),
        recorded_from_s=start,
        settled=settled,
        recorded_for_s=recorded,
        regime=regime,
        section=section,
        not_determined=tuple(limits),
        coordinates=coordinates,
        lines=lines,
        fundamentals=fundamentals,
        base_frequencies_Hz=None if fundamentals is None else tuple(fundamentals.frequency_Hz.tolist()),
        base_uncertainties_Hz=None if fundamentals is None else tuple(fundamentals.uncertainty_Hz.tolist()),
        explained_share=None if fundamentals is None else fundamentals.explained,
        resolution_Hz=None if lines is None else lines.resolution_Hz,
    )
    if lines is None:
        return study
    keep(study.model_copy(update={"not_determined": (*limits, CUT_OFF)}))
    why_not = _no_tangents(prepared, chunks)
    exponents = _exponents(prepared, chunks[0], duration, at_most, progress, limits) if not why_not else None
    if why_not:
        limits.append(f"Lyapunov exponents were not determined: {why_not}")
    attractor = decide_attractor(regime, fundamentals, exponents, recorded, None if why_not else LEAST_FOLLOWED)
    reached = min(recorded, recorded if exponents is None else float(exponents.time_s[-1]))
    limited = at_most if reached < duration - 2 * INTERVAL else None
    reason = describe_attractor(attractor, regime, exponents, limited)
    found = {"attractor": attractor, "reason": reason, "not_determined": tuple(limits)}
    return study.model_copy(update=found | _numbers(exponents, attractor))


def _numbers(exponents: Exponents | None, attractor: Attractor) -> dict[str, Any]:
    if exponents is None:
        return {}
    return {
        "exponents": exponents,
        "lyapunov_exponents_1_per_s": tuple(exponents.exponent_1_per_s.tolist()),
        "lyapunov_standard_errors_1_per_s": tuple(exponents.standard_error_1_per_s.tolist()),
        "lyapunov_uncertainties_1_per_s": tuple(exponents.uncertainty_1_per_s.tolist()),
        "chaotic": None if attractor.kind is Kind.NOT_DETERMINED else exponents.chaotic,
    }


def _record(
    prepared: Prepared, duration: float, at_most: float, progress: Progress, limits: list[str]
) -> tuple[bool, float, list[Chunk]]:
    """Run until settled and on: whether it settled, when the record begins (s), and its chunks."""
    rate, began = prepared.scene.simulate.sample_rate, clock.monotonic()
    kept: list[Chunk] = []
    start: float | None = None
    settled = False

    def take(chunk: Chunk) -> bool:
        nonlocal kept, start, settled
        now = float(chunk.time[-1])
        kept.append(chunk)
        if start is None:
            kept = [each for each in kept if each.time[-1] > now - 2 * BLOCK - 1e-9]
            settled = _settled(kept, rate) or _at_rest(prepared, kept)
            if settled or now >= LONGEST_START - 1e-9:
                start, kept = now, [chunk]
        elif now >= start + duration - 1e-9:
            return True
        if clock.monotonic() - began > at_most:
            limits.append(f"computing was limited to {at_most:g} s: the record ends at {now:.4g} s")
            return True
        return False

    try:
        follow(prepared, take, progress, what="settling and recording")
    except IntegrationError as error:
        limits.append(f"the integration failed: {error}")
        if not kept:
            raise
    return settled, float(kept[0].time[0]) if start is None else start, kept


def _settled(chunks: list[Chunk], rate: float) -> bool:
    """Whether no coordinate's rms has a trend over the last two blocks."""
    velocity = np.concatenate([chunk.velocity for chunk in chunks])
    samples = round(2 * BLOCK * rate)
    if velocity.shape[0] < samples:
        return False
    parts = np.array_split(velocity[-samples:], 2 * PARTS)
    size = np.array([part.std(axis=0) for part in parts])
    time = (np.arange(2 * PARTS) + 0.5) * BLOCK / PARTS
    for column in size.T:
        if not np.all(column > 0):
            continue
        trend = fit_growth(time, column)
        change, error = (abs(x) * 2 * BLOCK for x in (trend.rate_1_per_s, trend.standard_error))
        if change > max(SETTLED_CHANGE, SURE * error) or error > UNCLEAR:
            return False
    return True


def _able(prepared: Prepared) -> tuple[Mode, ...]:
    """The modes that the coordinates that move can show."""
    return tuple(mode for mode in prepared.stability.modes if mode.name in prepared.model.names)


def _at_rest(prepared: Prepared, chunks: list[Chunk]) -> bool:
    """Whether what is left over the last two blocks is no motion, where every mode decays and nothing drives it."""
    model = prepared.model
    if model.forced or slowest(prepared.stability, _able(prepared)) is None:
        return False
    whole = chunks[-1].time[-1] - chunks[0].time[0] > BLOCK
    velocity = np.concatenate([chunk.velocity for chunk in chunks])
    vibration = np.concatenate([chunk.displacement for chunk in chunks]) - steady_at_start(prepared)
    return bool(whole and max(boundary_ratios(model, vibration, velocity)) < STEADY)


def _no_tangents(prepared: Prepared, chunks: list[Chunk]) -> str:
    """Why nearby motions cannot be followed, empty where they can."""
    if not all(prepared.model.body.symmetric):
        return "the motion is in space, where nearby motions take too long"
    if prepared.model.forced:
        return "a harmonic force acts, and nearby motions are followed along steady drives only"
    if any(chunk.changes for chunk in chunks):
        return "the lining sticks, and there the motion has no derivative"
    return ""


def _exponents(
    prepared: Prepared, first: Chunk, duration: float, at_most: float, progress: Progress, limits: list[str]
) -> Exponents | None:
    """The largest Lyapunov exponents along the motion from where the record begins; None where that is too short."""
    model = prepared.model
    size = np.asarray(state_size(model, first.displacement[-1], first.velocity[-1]))
    state = np.concatenate([first.displacement[-1], first.velocity[-1]]) / size
    tangents = np.linalg.qr(np.random.default_rng(0).normal(size=(size.size, min(TANGENTS, size.size))))[0]
    logs, began = [], clock.monotonic()
    for k in range(round(duration / INTERVAL)):
        progress("nearby motions", k * INTERVAL, duration)
        state, moved = (np.asarray(each) for each in neighbours(model, size, state, tangents, INTERVAL))
        if not (np.all(np.isfinite(state)) and np.all(np.isfinite(moved))):
            limits.append(f"nearby motions were lost after {k * INTERVAL:.4g} s")
            break
        tangents, grown = orthonormalised(moved)
        logs.append(grown)
        if clock.monotonic() - began > at_most:
            limits.append(
                f"computing was limited to {at_most:g} s: nearby motions were followed for {k * INTERVAL:.4g} s"
            )
            break
    if len(logs) < FEWEST_INTERVALS:
        limits.append(
            f"Lyapunov exponents were not determined: {len(logs) * INTERVAL:.3g} s are too short, and "
            f"{LEAST_FOLLOWED:g} s the least"
        )
        return None
    return lyapunov_exponents(np.array(logs), INTERVAL)


def _section(vibration: Vibration, mass: NDArray[np.float64], coordinates: tuple[str, ...]) -> Section:
    """Find the points where the coordinate with most kinetic energy goes up through its mean."""
    if not coordinates:
        return Section()
    energy = mass * np.mean(vibration.velocity**2, axis=0)
    ranked = sorted(range(energy.size), key=lambda k: -energy[k])
    across, other = ranked[0], ranked[min(1, len(ranked) - 1)]
    time, q, v = vibration.time, vibration.displacement, vibration.velocity
    level = q[:, across] - q[:, across].mean()
    up = np.flatnonzero((level[:-1] < 0) & (level[1:] >= 0))
    if not up.size:
        return Section()
    path = CubicHermiteSpline(time, np.column_stack([level, q[:, other]]), v[:, [across, other]])
    at = time[up] - level[up] * (time[up + 1] - time[up]) / (level[up + 1] - level[up])
    for _ in range(3):  # Newton's method; samples are dense enough for the secant to begin with
        at = at - path(at)[:, 0] / path(at, 1)[:, 0]
    points = np.column_stack([path(at)[:, 1], path(at, 1)[:, 0]])
    size = float(np.ptp(q[:, other])), float(np.ptp(v[:, across]))
    names = vibration.coordinates
    return Section(across=names[across], other=names[other], points=len(points), size=size, values=points)
