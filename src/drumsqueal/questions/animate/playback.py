"""What an animation shows, frame by frame: a part of a history replayed slowly, or one period of a mode."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray
from jax import Array
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.findings.departure import levers
from drumsqueal.findings.history import COMPLETE
from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE, OUT_OF_PLANE, TX, TY, RigidShoe
from drumsqueal.physics.effects.pressure import Unilateral
from drumsqueal.physics.model import Model, build_model
from drumsqueal.questions.animate.section import largest_displacement, on_line, whole_shape
from drumsqueal.questions.animate.window import (
    FRAMES_PER_SECOND,
    MODE_FRAMES,
    SHARE,
    count_frames,
    find_magnification,
    find_window,
    main_frequency,
)
from drumsqueal.questions.run.figures.contact import SMALL, along_arc
from drumsqueal.questions.run.figures.view import MICRO
from drumsqueal.scene import COORDINATES, Scene
from drumsqueal.solve.linear.modes import Mode, Stability, while_sliding
from drumsqueal.solve.linear.steady import steady_sliding
from drumsqueal.terminal.placement import between

PARTS = 130  # of the arc
TICK = np.deg2rad(5.0)  # between marks on the drum
FASTEST = TICK / 3  # turn of the drum from frame to frame, beyond which it would seem to turn otherwise
PAD = 8  # samples beyond both ends keep the ends of the interpolation out of the picture
MOVES = 0.02  # of the largest motion, from which on a coordinate's curve is drawn
CURVE_POINTS = 1500

TOUCHING, SEPARATED, REVERSED, STUCK = range(4)
"""States of a part of the arc: touches and slips, has lifted off, slips backwards, sticks."""

Values = NDArray[np.float64]

_steady_sliding = jax.jit(steady_sliding)  # as one program, which the command line keeps


class _Section(NamedTuple):
    """Motion of the section that is drawn and of the faces, if they are, and the largest displacement (m) of all."""

    motion: Values
    faces: tuple[Values, Values] | None
    front: bool
    largest: float


class Arc(NamedTuple):
    """Contact of the parts of the arc between `edges` (rad): pressure and state (frames, parts).

    The pressure is in Pa, with `change` its departure from the preload; of a mode it is relative, from steady sliding.
    """

    edges: Values
    pressure: Values
    change: bool
    state: NDArray[np.int64]


class Playback(NamedTuple):
    """All that is drawn. The motion (frames, 3) is X, Y (m) and Tz (rad) of the section that is drawn.

    `faces` are the same of the front and the back face where those move otherwise, else None. `drum_turn` (frames,) is
    the drum's turn as drawn (rad), None where it is not. `curves` are displacements over `curve_time` (s) in µm at the
    drum's surface; `relative` says that their size, as that of a mode, means nothing.
    """

    title: str
    subject: str
    notes: tuple[str, ...]
    shoe: RigidShoe
    drum_sense: float
    time: Values
    motion: Values
    faces: tuple[Values, Values] | None
    magnification: float
    drum_turn: Values | None
    arc: Arc
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
    model = build_model(scene, coordinates=IN_PLANE)
    time: Values = history["time"].values
    states = np.concatenate([history[kind].values for kind in ("displacement", "velocity")], axis=1)
    steady = _steady(model)
    states[:, list(IN_PLANE)] -= steady
    main = main_frequency(model, time, states, start, end)
    start, end = find_window(time, main, start, end)
    frames = count_frames(end - start, main, slow)
    low, high = np.searchsorted(time, [start, end])
    near = slice(max(0, low - PAD), high + PAD)
    if time[near].size < PAD:
        raise RequestError(f"the history has {time[near].size} samples there, {PAD} are needed; run it for longer")

    shown, curve_time = np.linspace(start, end, frames), np.linspace(start, end, CURVE_POINTS)
    moved = between(time[near], states[near], shown)
    section = _section(model.shoe, moved[:, :6])
    factor = find_magnification(model.shoe, section.largest, magnification, (start, end))
    sticks = history["sticking"].sel(time=shown, method="nearest").values > 0
    arc = _contact(model, shown, np.concatenate([section.motion + steady, on_line(moved[:, 6:], 0.0)], axis=1), sticks)
    curves = _curves(between(time[near], states[near, :6], curve_time), model.shoe)
    drum, drum_factor = _drum_turn(model, shown, factor)
    periods = f", {(end - start) * main:.3g} periods of {main:.4g} Hz" if main else ""
    turn = "the drum's turn as well" if drum_factor == factor else f"the drum's turn {_digits(drum_factor)} times"
    share = factor * section.largest / float(model.shoe.thickness)
    notes = (
        f"{1e3 * start:.6g} to {1e3 * end:.6g} ms{periods}, at {_slowness(shown)} of real time",
        f"Displacement magnified {_digits(factor)} times (at most {_digits(MICRO * section.largest)} µm, drawn as "
        f"{share:.2g} of the thickness), {turn}",
        *_section_notes(section, curves),
    )
    title = scene.title if history.attrs["outcome"] == COMPLETE else f"{scene.title} (incomplete run)"
    return Playback(
        title, "motion in section", notes, model.shoe, _sense(model, start), shown, section.motion, section.faces,
        factor, drum, arc, curve_time, curves, relative=False,
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
    model = while_sliding(build_model(scene, coordinates=IN_PLANE))[0]
    period = 1 / mode.frequency_Hz
    frames = count_frames(period, mode.frequency_Hz, slow, MODE_FRAMES, closed=True)
    shape = whole_shape(stability.coordinates, mode)

    def over(phases: Values) -> Values:
        return np.real(shape * np.exp(2j * np.pi * phases)[:, None])

    phases = np.arange(frames) / frames
    moved = over(phases)
    section = _section(model.shoe, moved, front=COORDINATES.index(mode.name) in OUT_OF_PLANE)
    factor = SHARE * float(model.shoe.thickness) / section.largest
    curve_phases = np.linspace(0.0, 1.0, CURVE_POINTS)
    curves = _curves(over(curve_phases), model.shoe)
    rate = f"{mode.growth_rate:+.4g}".replace("-", "−")
    notes = (
        f"{mode.frequency_Hz:.6g} Hz, growth rate {rate} 1/s, which is left out; "
        f"one period, at {_slowness(period * phases)} of real time",
        f"The size is arbitrary: the largest displacement is drawn as {SHARE:.2g} of the thickness. "
        "The drum's turn is left out, too",
        *_section_notes(section, curves),
    )
    return Playback(
        scene.title, f"mode {mode.label}", notes, model.shoe, _sense(model, 0.0), period * phases, section.motion,
        section.faces, factor, None, _mode_contact(model, section.motion), period * curve_phases,
        curves, relative=True,
    )  # fmt: skip


def _steady(model: Model) -> Values:
    """X, Y, Tz of steady sliding; zero where the drum is at rest at first, as a transient begins there."""
    if while_sliding(model)[1] > 0:
        return np.zeros(3)
    return np.asarray(_steady_sliding(model))


def _section(shoe: RigidShoe, states: Values, *, front: bool = False) -> _Section:
    """What the displacements (frames, 6) are in section, at mid-width or at the front face."""
    motion = on_line(states, float(shoe.width) / 2 if front else 0.0)
    faces = _faces(shoe, states)
    largest = max(largest_displacement(shoe, each) for each in (motion, *(faces or ())))
    return _Section(motion, faces, front, largest)


def _faces(shoe: RigidShoe, states: Values) -> tuple[Values, Values] | None:
    """Motion of the front and the back face where the shoe tilts so far that one sees it."""
    half = float(shoe.width) / 2
    tilted = half * np.abs(states[:, [TX, TY]]).max()
    if not tilted > MOVES * largest_displacement(shoe, on_line(states, 0.0)):
        return None
    return on_line(states, half), on_line(states, -half)


def _contact(model: Model, time: Values, states: Values, sticks: NDArray[np.bool_]) -> Arc:
    """Contact at every frame, of states (frames, 6) of X, Y, Tz and their rates, and whether the lining sticks."""
    edges = _edges(model)
    level, slip, preload = (np.asarray(part) for part in _evaluated(model, time, states, edges))
    state = np.full(level.shape, TOUCHING)
    if model.contact.friction is not None:
        state[slip > 0] = REVERSED
        state[sticks] = STUCK
    if isinstance(model.lining.law, Unilateral):
        state[level < 0] = SEPARATED
    departure = level - preload[:, None]
    change = float(np.abs(departure).max()) < SMALL * float(preload.max())
    pressure = departure if change else np.asarray(model.lining.law.pressure(jnp.asarray(level)))
    return Arc(edges, pressure, change, state)


def _mode_contact(model: Model, motion: Values) -> Arc:
    """Change of the pressure, relative to its largest, with the motion (frames, 3) of a mode, where it touches."""
    edges = _edges(model)
    steady = np.concatenate([np.asarray(_steady_sliding(model)), np.zeros(3)])
    states = steady + np.pad(motion, ((1, 0), (0, 3)))  # before all, steady sliding itself
    level = np.asarray(_evaluated(model, np.zeros(len(states)), states, edges)[0])
    lifted = (level[0] < 0) & isinstance(model.lining.law, Unilateral)
    change = np.where(lifted, 0.0, level[1:] - level[0])
    state = np.broadcast_to(np.where(lifted, SEPARATED, TOUCHING), change.shape)
    return Arc(edges, change / (np.abs(change).max() or 1.0), True, state)


def _edges(model: Model) -> Values:
    half = float(model.shoe.half_angle)
    return np.linspace(-half, half, PARTS + 1)


def _evaluated(model: Model, time: Values, states: Values, edges: Values) -> tuple[Array, Array, Array]:
    """Level, slip and preload in the middle of each part."""
    return along_arc(model, jnp.asarray(time), jnp.asarray(states), jnp.asarray((edges[1:] + edges[:-1]) / 2))


def _drum_turn(model: Model, time: Values, factor: float) -> tuple[Values, float]:
    """Turn of the drum as drawn (rad), and how far it is magnified: as the displacement, unless it would blur."""
    speed = np.asarray(jax.vmap(model.operation.at)(jnp.asarray(time)).drum_speed)
    turn = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(time))])
    quickest = float(np.abs(np.diff(turn)).max())
    drawn = factor if factor * quickest <= FASTEST else FASTEST / quickest
    return drawn * turn, drawn


def _sense(model: Model, time: float) -> float:
    return float(np.sign(float(model.operation.at(time).drum_speed)))


def _curves(displacement: Values, shoe: RigidShoe) -> dict[str, Values]:
    """The displacements (points, 6) that are worth a curve, in µm at the drum's surface, by their labels."""
    values = MICRO * levers(COORDINATES, shoe) * displacement
    sizes = np.ptp(values, axis=0)
    shown = [k for k in range(6) if sizes[k] >= MOVES * sizes.max()]
    return {COORDINATES[k]: values[:, k] for k in shown}


def _section_notes(section: _Section, curves: dict[str, Values]) -> tuple[str, ...]:
    """What the section is of, and what it leaves out, for motion out of the plane."""
    notes = []
    if section.faces is not None:
        where = (
            "Section: the front face (z = b/2); " if section.front else "Section at mid-width; the front face solid, "
        )
        notes.append(f"{where}the back face dashed")
    if "Z" in curves:
        notes.append("Z, along the drum's axis, is not drawn")
    return ("; ".join(notes),) if notes else ()


def _slowness(time: Values) -> str:
    return f"1/{_digits(1 / FRAMES_PER_SECOND / (time[1] - time[0]))}"


def _digits(number: float) -> str:
    """A number of four digits, without powers of ten unless it is very large or small."""
    return f"{float(f'{number:.4g}'):.9g}"
