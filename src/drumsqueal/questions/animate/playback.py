"""What an animation shows, frame by frame: a part of a history replayed slowly, or one period of a mode."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy
import xarray
from numpy.typing import NDArray

from drumsqueal.coordinates import largest_of
from drumsqueal.errors import Ending, RequestError
from drumsqueal.findings.history import time_window
from drumsqueal.findings.signals.spectra import amplitude_spectrum, spectral_peaks
from drumsqueal.findings.vibration import FEWEST_FOR_SPECTRUM, characteristic_lengths
from drumsqueal.physics.bodies.brake import Placed, placed
from drumsqueal.physics.composition import coordinates_of
from drumsqueal.physics.effects.pressure import Bonded, tangent_under
from drumsqueal.physics.model import Model, build_model
from drumsqueal.questions.animate.section import largest_displacement
from drumsqueal.questions.run.figures.contact import SMALL, along_arc
from drumsqueal.questions.run.figures.view import MICRO, REST
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import percent
from drumsqueal.solve.linear.modes import Mode, Stability, while_sliding
from drumsqueal.solve.linear.steady import steady_sliding
from drumsqueal.terminal.style import between

FRAMES_PER_SECOND = 25  # 40 ms a frame, which GIF, counting in hundredths of a second, holds exactly
FRAMES, MODE_FRAMES = 150, 50  # unless a speed is asked for
FEWEST_A_PERIOD, MOST = 8, 750  # frames; with fewer a period, the picture would show another motion than there was
LOOKED_AT = 0.05  # s, in which the main line is looked for
FRACTION = 0.3  # of the shoe's thickness that the largest displacement takes in the picture
TICK = np.deg2rad(5.0)  # between marks on the drum
FASTEST = TICK / 3  # turn of the drum from frame to frame, beyond which it would seem to turn otherwise
PAD = 8  # samples beyond both ends keep the ends of the interpolation out of the picture
MOVES = 0.02  # of the largest motion, from which on a coordinate's curve is drawn
CURVE_POINTS = 1500

TOUCHING, SEPARATED, REVERSED, STUCK = range(4)
"""States of a part of the arc: touches and slips, has lifted off, slips backwards, sticks."""

Values = NDArray[np.float64]


class Arc(NamedTuple):
    """Contact of the parts of the arc between `edges` (rad): pressure and state (frames, parts).

    The pressure is in Pa, with `change` its difference from the preload; of a mode it is relative, from steady sliding.
    """

    edges: Values
    pressure: Values
    change: bool
    state: NDArray[np.int64]


class Playback(NamedTuple):
    """All that is drawn. The motion (frames,) is that of the coordinates, by name; the section is at z (m).

    `parts` are the shoes, with the contact of each in `arcs`.

    `faces` are the places of the front and the back face where those move otherwise, else None. `drum_turn` (frames,)
    is the drum's turn as drawn (rad), None where it is not. `curves` are displacements over `curve_time` (s) in µm at
    the drum's surface; `relative` says that their size, as that of a mode, means nothing.
    """

    title: str
    subject: str
    notes: tuple[str, ...]
    parts: tuple[Placed, ...]
    drum_sense: float
    time: Values
    motion: dict[str, Values]
    z: float
    faces: tuple[float, float] | None
    magnification: float
    drum_turn: Values | None
    arcs: tuple[Arc, ...]
    curve_time: Values
    curves: dict[str, Values]
    relative: bool


def play_history(
    history: xarray.Dataset,
    scene: Scene,
    *,
    start: float | None = None,
    end: float | None = None,
    slow: float | None = None,
    magnification: float | None = None,
) -> Playback:
    """Replay a history from `start` to `end` (s), `slow` times slower than it was, its displacement magnified.

    Without these: the last three periods of the main line in 150 frames, magnified so that the largest displacement
    from steady sliding is drawn as 30 % of the shoe's thickness. Raises RequestError where nothing moves, where the
    times are not the history's, and where a period would have fewer than 8 frames.
    """
    model = build_model(scene, coordinates=coordinates_of(scene))
    names, n = list(model.names), len(model.names)
    time: Values = history["time"].values
    both = [history[kind].sel(coordinate=names).values for kind in ("displacement", "velocity")]
    # A transient of a drum that is at rest at first begins at zero.
    at_rest = while_sliding(model)[1] > 0
    states, steady = np.concatenate(both, axis=1), np.zeros(n) if at_rest else np.asarray(steady_sliding(model))
    states[:, :n] -= steady
    main = _main_frequency(model, time, states, start, end)
    start, end = _find_window(time, main, start, end)
    frames = _count_frames(end - start, main, slow)
    low, high = np.searchsorted(time, [start, end])
    near = slice(max(0, low - PAD), high + PAD)
    if time[near].size < PAD:
        raise RequestError(f"the history has {time[near].size} samples there, {PAD} are needed; run it for longer")

    shown, curve_time = np.linspace(start, end, frames), np.linspace(start, end, CURVE_POINTS)
    moved = between(time[near], states[near], shown)
    motion = dict(zip(names, moved[:, :n].T, strict=True))
    parts = placed(model.body)
    faces, largest = _faces(model, motion, 0.0)
    thickness = min(float(part.shoe.thickness) for part in parts)
    factor = _find_magnification(thickness, largest, magnification, (start, end))
    sticks = history["sticking"].sel(time=shown, method="nearest").values > 0
    arcs = _contact(model, shown, moved + np.append(steady, np.zeros(n)), sticks)
    curves = _curves(model, between(time[near], states[near, :n], curve_time))
    drum, drum_factor = _drum_turn(model, shown, factor)
    periods = f", {(end - start) * main:.3g} periods of {main:.4g} Hz" if main else ""
    turn = "as well" if drum_factor == factor else f"{_digits(drum_factor)} times"
    fraction = factor * largest / thickness
    notes = (
        f"{1e3 * start:.6g} to {1e3 * end:.6g} ms{periods}, at {_slowness(shown)} of real time",
        f"Displacement magnified {_digits(factor)} times (at most {_digits(MICRO * largest)} µm, drawn as "
        f"{percent(fraction)} of the thickness), the drum's rotation {turn}",
        *_section_notes(parts, 0.0, faces, curves),
    )
    title = scene.title if history.attrs["ending"] == Ending.COMPLETE else f"{scene.title} (incomplete run)"
    return Playback(
        title, "motion in section", notes, parts, _sense(model, start), shown, motion, 0.0, faces,
        factor, drum, arcs, curve_time, curves, relative=False,
    )  # fmt: skip


def find_mode(stability: Stability, label: str) -> Mode:
    """The mode of that label. Raises RequestError where there is none."""
    found = {mode.label: mode for mode in stability.modes}
    if label not in found:
        there = f"it has {', '.join(found)}" if found else "no mode of it oscillates"
        raise RequestError(f"--mode {label}: the scene has no such mode; {there}")
    return found[label]


def play_mode(scene: Scene, stability: Stability, mode: Mode, *, slow: float | None = None) -> Playback:
    """Play one period of a mode about steady sliding, without its growth: q = Re(q̂ exp(iωt)); the size is arbitrary.

    Without `slow` it has 50 frames. The section of a mode out of the plane is that of the front face, z = b/2. Raises
    RequestError for fewer than 8 frames.
    """
    model = while_sliding(build_model(scene, coordinates=stability.coordinates))[0]
    period = 1 / mode.frequency_Hz
    frames = _count_frames(period, mode.frequency_Hz, slow, MODE_FRAMES, closed=True)
    names, shape = stability.coordinates, mode.right[: len(stability.coordinates)]

    def over(phases: Values) -> Values:
        return np.real(shape * np.exp(2j * np.pi * phases)[:, None])

    phases = np.arange(frames) / frames
    moved = over(phases)
    motion = dict(zip(names, moved.T, strict=True))
    parts, flat = placed(model.body), model.body.symmetric[model.names.index(mode.name)]
    z = 0.0 if flat else _half_width(parts)
    faces, largest = _faces(model, motion, z)
    factor = FRACTION * min(float(part.shoe.thickness) for part in parts) / largest
    curve_phases = np.linspace(0.0, 1.0, CURVE_POINTS)
    curves = _curves(model, over(curve_phases))
    rate = f"{mode.growth_rate:+.4g}".replace("-", "−")
    notes = (
        f"{mode.frequency_Hz:.6g} Hz, growth rate {rate} 1/s, which is left out; "
        f"one period, at {_slowness(period * phases)} of real time",
        f"The size is arbitrary: the largest displacement is drawn as {percent(FRACTION)} of the thickness. "
        "The drum's rotation is left out, too",
        *_section_notes(parts, z, faces, curves),
    )
    return Playback(
        scene.title, f"mode {mode.label}", notes, parts, _sense(model, 0.0), period * phases, motion, z, faces,
        factor, None, _mode_contact(model, moved, z), period * curve_phases, curves, relative=True,
    )  # fmt: skip


def _main_frequency(model: Model, time: Values, states: Values, start: float | None, end: float | None) -> float | None:
    """Frequency (Hz) of the strongest line of the coordinate with most kinetic energy near what is shown, if any."""
    # No less than 50 ms, where there are: the frequency of a few periods alone would be inaccurate.
    if end is None:
        end = float(time[-1]) if start is None else min(start + LOOKED_AT, float(time[-1]))
    begin = end - LOOKED_AT if start is None else min(start, end - LOOKED_AT)
    part = slice(*np.searchsorted(time, [begin - 1e-12, end + 1e-12]).tolist())
    if time[part].size < FEWEST_FOR_SPECTRUM:
        return None
    energy = np.asarray(model.mass) * np.var(states[part, len(model.names) :], axis=0)
    record = states[part, int(np.argmax(energy))]
    if not np.ptp(record) > REST:
        return None
    spectrum = amplitude_spectrum(record, (time.size - 1) / float(time[-1] - time[0]))
    peaks = spectral_peaks(spectrum, count=1, floor=0.5)
    return float(peaks.frequency_Hz[0]) if peaks.frequency_Hz.size else None


def _find_window(time: Values, main: float | None, start: float | None, end: float | None) -> tuple[float, float]:
    """First and last time (s) shown: the last three periods unless asked otherwise. Raises RequestError."""
    first, last = float(time[0]), float(time[-1])
    since, until = time_window("the history", (first, last), (last - first) / max(time.size - 1, 1), start, end)
    span = last - first if main is None else min(3 / main, last - first)  # periods of the main line
    if start is None and not (end is None and main is None):
        since = max(first, until - span)
    if end is None:
        until = min(last, since + span)
    return since, until


def _count_frames(
    span: float, main: float | None, slow: float | None, usual: int = FRAMES, *, closed: bool = False
) -> int:
    """Number of frames; a closed loop does not show its first frame twice. Raises RequestError for too few or many."""
    periods = span * main if main else 1.0
    fewest = int(np.ceil(FEWEST_A_PERIOD * periods)) + (not closed)
    if slow is None:
        if fewest > MOST:
            raise RequestError(
                f"these {span:.4g} s hold {periods:.0f} periods of {main:.4g} Hz, and at most {MOST} frames show "
                f"{MOST // FEWEST_A_PERIOD} of them; choose a shorter part with --from and --until"
            )
        return max(usual, fewest)
    frames = round(span * slow * FRAMES_PER_SECOND) + (not closed)
    if not fewest <= frames <= max(MOST, fewest):
        least, most = ((count - (not closed)) / FRAMES_PER_SECOND / span for count in (fewest, max(MOST, fewest)))
        raise RequestError(
            f"--slow {slow:g}: that makes {frames} frames of {span:.4g} s; {FEWEST_A_PERIOD} a period are needed and "
            f"{max(MOST, fewest)} are the most: take {np.ceil(least):.0f} to {np.floor(most):.0f}, or other times"
        )
    return frames


def _find_magnification(thickness: float, largest: float, wanted: float | None, window: tuple[float, float]) -> float:
    """Factor at which the largest displacement (m) is drawn, if none is wanted as a fraction of the thickness (m).

    Raises RequestError where nothing moves, and where it would be drawn further than the shoe is thick.
    """
    if not largest > REST:
        raise RequestError(f"nothing moves from {window[0]:.6g} to {window[1]:.6g} s; give other times")
    if wanted is None:
        exact = FRACTION * thickness / largest
        step = 10.0 ** (np.floor(np.log10(exact)) - 1)
        return float(np.floor(exact / step) * step)  # two digits, for the note in the picture
    if wanted * largest > thickness:
        raise RequestError(
            f"--magnify {wanted:g}: the displacement would be drawn larger than the shoe is thick; "
            f"take at most {thickness / largest:.4g}"
        )
    return wanted


def _half_width(parts: tuple[Placed, ...]) -> float:
    return max(float(part.shoe.width) for part in parts) / 2


def _faces(model: Model, motion: dict[str, Values], z: float) -> tuple[tuple[float, float] | None, float]:
    """Where front and back face are (m), if they move otherwise than the middle, and the largest displacement (m).

    The latter is that of all that is drawn of a motion (frames,): the section at z (m), and these faces.
    """
    parts, flat = placed(model.body), dict(zip(model.names, model.body.symmetric, strict=True))
    half, tilt = _half_width(parts), {name: values for name, values in motion.items() if not flat[name]}
    tilted = max(abs(largest_displacement(parts, tilt, at)) for at in (half, -half))
    faces = (half, -half) if tilted > MOVES * largest_displacement(parts, motion) else None
    return faces, max(largest_displacement(parts, motion, at) for at in (z, *(faces or ())))


def _contact(model: Model, time: Values, states: Values, sticks: NDArray[np.bool_]) -> tuple[Arc, ...]:
    """Contact of each lining at every frame, of states (frames, 2n), and whether the lining sticks.

    The pressure is a change from the preload where that is small on all of them.
    """
    each = [_evaluated(side, time, states[:, mine.of_states]) for mine, side in model.sides]
    changes = [float(np.abs(level - preload[:, None]).max()) for _, level, _, preload in each]
    change = max(changes) < SMALL * max(float(preload.max()) for *_, preload in each)
    arcs = []
    for (_, side), (edges, level, slip, preload) in zip(model.sides, each, strict=True):
        state = np.full(level.shape, TOUCHING)
        if side.contact.friction is not None:
            state[slip > 0] = REVERSED
            state[sticks] = STUCK
        lifted = (level < 0) & (float(side.contact.lifting_stiffness) > 0)
        state[lifted] = SEPARATED
        pressure = level - preload[:, None] if change else np.where(lifted, 0.0, level)
        arcs.append(Arc(edges, pressure, change, state))
    return tuple(arcs)


def _mode_contact(model: Model, motion: Values, z: float) -> tuple[Arc, ...]:
    """Change of the pressure, relative to its largest, with the motion (frames, n) of a mode, where it touches."""
    n, found = len(model.names), []
    steady = np.append(np.asarray(steady_sliding(model)), np.zeros(n))
    states = steady + np.pad(motion, ((1, 0), (0, n)))  # before all, steady sliding itself
    for mine, side in model.sides:
        time, own = np.zeros(len(states)), states[:, mine.of_states]
        edges, pressure, _, _ = _evaluated(side, time[:1], own[:1], z)
        lifted = (pressure[0] < 0) & (float(side.contact.lifting_stiffness) > 0)
        # A mode has no size: the slope of the pressure counts, and where the lining moves.
        unit = dataclasses.replace(side, contact=dataclasses.replace(side.contact, law=Bonded(1.0)))
        moved = _evaluated(unit, time, own, z)[1]
        change = tangent_under(side.contact.law.normal, np.maximum(pressure[0], 0.0)) * (moved[1:] - moved[0])
        change = np.where(lifted, 0.0, change)
        found.append((edges, change, np.broadcast_to(np.where(lifted, SEPARATED, TOUCHING), change.shape)))
    largest = max(float(np.abs(change).max()) for _, change, _ in found) or 1.0
    return tuple(Arc(edges, change / largest, True, state) for edges, change, state in found)


def _evaluated(model: Model, time: Values, states: Values, z: float = 0.0) -> tuple[Values, Values, Values, Values]:
    """Edges of the parts of the arc, and level, slip and preload in the middle of each, on a line z (m)."""
    half = float(model.shoe.half_angle)
    edges = np.linspace(-half, half, 130 + 1)
    middles = (edges[1:] + edges[:-1]) / 2
    level, slip, preload = along_arc(model, *(jnp.asarray(each) for each in (time, states, middles, z)))
    return edges, np.asarray(level), np.asarray(slip), np.asarray(preload)


def _drum_turn(model: Model, time: Values, factor: float) -> tuple[Values, float]:
    """Turn of the drum as drawn (rad), and how far it is magnified: as the displacement, unless it would blur."""
    speed = np.asarray(jax.vmap(model.operation.at)(jnp.asarray(time)).drum_speed)
    turn = scipy.integrate.cumulative_trapezoid(speed, time, initial=0)
    quickest = float(np.abs(np.diff(turn)).max())
    drawn = factor if factor * quickest <= FASTEST else FASTEST / quickest
    return drawn * turn, drawn


def _sense(model: Model, time: float) -> float:
    return float(np.sign(float(model.operation.at(time).drum_speed)))


def _curves(model: Model, displacement: Values) -> dict[str, Values]:
    """The displacements (points, n) that are worth a curve, in µm at the drum's surface, by their coordinates."""
    values = MICRO * characteristic_lengths(model.names, model.body) * displacement
    sizes = np.ptp(values, axis=0)
    moving = {name: size for name, size in zip(model.names, sizes.tolist(), strict=True) if size >= MOVES * sizes.max()}
    return {name: values[:, model.names.index(name)] for name in largest_of(moving)[0]}


def _section_notes(
    parts: tuple[Placed, ...], z: float, faces: tuple[float, float] | None, curves: dict[str, Values]
) -> tuple[str, ...]:
    """What the section is of, and what it leaves out, for motion out of the plane."""
    notes = []
    if faces is not None and z > 0:
        notes.append("Section: the front face (z = b/2); the back face dashed")
    elif faces is not None:
        notes.append("Section at mid-width; the front face solid, the back face dashed")
    front = _half_width(parts)
    for name in curves:
        if largest_displacement(parts, {name: np.ones(1)}, front) == 0:
            notes.append(f"{name}, along the drum's axis, is not drawn")
    return ("; ".join(notes),) if notes else ()


def _slowness(time: Values) -> str:
    return f"1/{_digits(1 / FRAMES_PER_SECOND / (time[1] - time[0]))}"


def _digits(number: float) -> str:
    """A number of four digits, without powers of ten unless it is very large or small."""
    return f"{float(f'{number:.4g}'):.9g}"
