"""The displacement from steady sliding, and how far it comes towards lift-off and slip reversal.

Below these contact boundaries a motion is nearly linear.
"""

import dataclasses
import operator
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from drumsqueal.coordinates import is_rotation
from drumsqueal.findings.signals.growth import modal_amplitudes
from drumsqueal.findings.signals.spectra import Spectrum, amplitude_spectrum
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.brake import placed
from drumsqueal.physics.effects.operation import Constant, OperatingPoint, Operation, PiecewiseLinear
from drumsqueal.physics.effects.pressure import level_under
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import Mode, Stability
from drumsqueal.solve.linear.passage import values_at
from drumsqueal.solve.linear.steady import observe_steady, sliding_or_none
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.solve.transient.state import COUPLING_FRACTION

if TYPE_CHECKING:
    import xarray


LIFTED_FRACTION = 0.1  # of the lining
_PUSHED: deque[tuple[tuple[Any, list[Any]], tuple[Any, Any]]] = deque(maxlen=8)  # models, and how these are pressed

Columns = Mapping[str, NDArray[np.float64]]


def boundary_ratios(model: Model, vibration: NDArray[np.float64], velocity: NDArray[np.float64]) -> tuple[float, float]:
    """The largest fraction of contact loss and of slip reversal in a motion, by the speed and the load at t = 0.

    `vibration` from steady sliding (m, rad) and `velocity` are (time, n) in the order of `model.names`.
    """
    lost, back = boundary_ratios_by_shoe(model, vibration, velocity).max(axis=1).tolist()
    return lost, back


def boundary_ratios_by_shoe(
    model: Model, vibration: NDArray[np.float64], velocity: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The same of each shoe (2, shoe)."""
    q, v = (dict(zip(model.names, columns.T, strict=True)) for columns in (vibration, velocity))
    return boundary_fractions(model, q, v, model.operation.at(0.0)).max(axis=2)


def boundary_fractions(model: Model, q: Columns, v: Columns, moment: OperatingPoint) -> NDArray[np.float64]:
    """How far a motion comes towards contact loss and towards slip reversal, on each shoe (2, shoe, time).

    max|u_r − u_r*| over the compression by the mean pressure, 0 without separation, and max|u̇_θ| over R|Ω|, 0 without
    friction, of displacements and velocities (time,) by name. The maxima are bounds over the whole circle: where the
    steady pressure is uniform nothing has lifted off below 1, and nothing slips backwards. A shoe that nothing presses
    has no contact to lose, unless nothing presses any.
    """
    lost, back = [], []
    for (mine, side), mean in zip(model.sides, mean_pressures(model, moment), strict=True):
        (into, _), (_, along) = (side.body.largest(mine.own(motion)) for motion in (q, v))
        sliding = float(side.contact.radius) * np.abs(np.asarray(moment.drum_speed))
        # A number where no kept coordinate moves the lining that way.
        into, mean, along, sliding = np.broadcast_arrays(*map(np.atleast_1d, (into, mean, along, sliding)))
        lost.append((float(side.contact.lifting_stiffness) * into, level_under(side.contact.law, mean)))
        back.append(np.zeros(along.shape) if side.contact.friction is None else _over(along, sliding))
    depth, pressure = np.swapaxes(np.array(lost), 0, 1)
    return np.stack([np.where(idle_shoes(model, moment.time), 0.0, _over(depth, pressure)), np.stack(back)])


def idle_shoes(model: Model, time: ArrayLike) -> NDArray[np.bool_]:
    """Which shoes have no contact to lose at times (shoe, time): a load of zero beside another that is none."""
    times = np.atleast_1d(np.asarray(time, dtype=np.float64))
    pressed = np.array([values_at(preload, times) for preload in model.operation.preloads]) > 0
    return ~pressed & pressed.any(axis=0)


def mean_pressures(model: Model, moment: OperatingPoint) -> list[NDArray[np.float64]]:
    """The mean pressure on each lining (Pa) at a moment, or at the moments of a record (time,).

    p0, which the load spreads evenly; of shoes that are pushed, normal force over lining area in steady sliding. That
    is found at the corners of what changes with time, and linear between them.
    """
    if not model.pushed:
        return [np.asarray(preload) for preload, _ in moment.preloads]
    corners, means = _pushed_pressures(model)
    time = np.asarray(moment.time)
    return [np.interp(time, corners, mean) if mean.size else np.asarray(np.inf) for mean in means]


def _pushed_pressures(model: Model) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (corners,) in s, and the mean pressure on each lining then (shoes, corners) in Pa.

    Found once for a model: studies ask for every mode of it, and to find where it slides takes a while where it bends.
    """
    parts, form = jax.tree.flatten(model)
    for known, found in _PUSHED:
        if known[0] == form and all(map(operator.is_, known[1], parts)):
            return found
    changing = [np.asarray(each.time) for each in model.operation.schedules if isinstance(each, PiecewiseLinear)]
    corners = np.unique(np.concatenate([[0.0], *changing]))
    forces = np.array([_normal_forces(model.frozen(time)) for time in corners.tolist()])
    slides = np.isfinite(forces).all(axis=1)  # a drum that hardly turns may lock the shoe: no steady sliding then
    found = corners[slides], forces[slides].T / [[float(side.body.area)] for _, side in model.sides]
    _PUSHED.append(((form, parts), found))
    return found


def _normal_forces(model: Model) -> tuple[float, ...]:
    """On each lining in steady sliding (N), NaN where there is none."""
    return observe_steady(model, sliding_or_none(model))[1].of_each("normal_force")


def amplitudes_at_boundary(
    model: Model, modes: Sequence[Mode], steady: NDArray[np.float64], time: Sequence[float]
) -> NDArray[np.float64]:
    """The amplitude (k,) at which each of some modes alone reaches a contact boundary, lift-off or slip reversal.

    In m or rad of the coordinate that names it, about steady sliding q* (k, n) by load and speed at a time (s) each;
    infinite without any boundary. Where part of a lining is off the drum in steady sliding already, or one end is
    hardly pressed, as that next to the pin of a shoe that is pushed, another tenth of that lining must leave or touch
    it.
    """
    found, shapes = [], np.array([mode.right for mode in modes])
    speeds = values_at(model.operation.drum_speed, time)
    levels, idle = surface_levels(model, steady, time), idle_shoes(model, time)
    for (mine, side), level, resting in zip(model.sides, levels, idle, strict=True):
        into, along = side.body.surface()
        moved, rates = (part[:, np.array(mine.places)] for part in np.split(shapes, 2, axis=1))
        lifts = _over_size(level, float(side.contact.lifting_stiffness) * np.abs(moved @ into.T))
        whole = (level.min(axis=1) > 0) & (not model.pushed)
        tenth = np.quantile(lifts, LIFTED_FRACTION, axis=1, method="lower")
        found.append(np.where(resting, np.inf, np.where(whole, lifts.min(axis=1), tenth)))
        if side.contact.friction is not None:
            found.append(_over_size(float(side.contact.radius) * speeds, np.abs(rates @ along.T).max(axis=1)))
    return np.min(found, axis=0)


def surface_levels(model: Model, steady: NDArray[np.float64], time: Sequence[float]) -> list[NDArray[np.float64]]:
    """The level (Pa) of the pressure on each shoe's `surface` (time, points) in steady sliding q* (time, n).

    By the loads at each time (s). Negative where the lining is off the drum. Of a contact that cannot be lost it is
    that of the load alone.
    """
    found = []
    for (mine, side), preload in zip(model.sides, model.operation.preloads, strict=True):
        into, _ = side.body.surface()
        loads = level_under(side.contact.law, values_at(preload, time))[:, None]
        found.append(loads + float(side.contact.lifting_stiffness) * (steady[:, np.array(mine.places)] @ into.T))
    return found


def _over_size(limit: NDArray[np.float64], size: NDArray[np.float64]) -> NDArray[np.float64]:
    """|limit| over size; infinite where there is no motion."""
    return np.divide(np.abs(limit), size, out=np.full(limit.shape, np.inf), where=size > 0)


def _over(size: NDArray[np.float64], limit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Size over limit; any motion at all is infinitely far beyond a limit of zero."""
    size, limit = np.broadcast_arrays(size, limit)
    beyond = np.where(size > 0, np.inf, 0.0)
    return np.divide(size, limit, out=beyond, where=limit > 0)


FEWEST_FOR_SPECTRUM = 16  # samples
PIECE = 2**14  # samples that are read at a time


def characteristic_lengths(coordinates: Sequence[str], body: Any) -> NDArray[np.float64]:
    """How far 1 of each coordinate moves the lining (n,): R (m) for rotations, 1 for displacements."""
    found = body.characteristic_lengths()
    return np.array([found.get(name, 1.0) for name in coordinates])  # of a mode that is left out it says nothing


def amplitudes_apart(one: Mapping[str, float], other: Mapping[str, float], mass: ArrayLike = 1.0) -> float:
    """By how much amplitudes (m, rad) of two motions differ: the largest of |ln| of their ratios.

    By `mass` (n,) each has its share of the motion. A share below that to which transients resolve a coordinate counts
    as that much: what is still, or coupled to nothing, moves by round-off, which distinguishes no motions.
    """
    shares = np.sqrt(mass) * np.array([[each[name] for name in one] for each in (one, other)])
    counted = np.log(np.maximum(shares, max(COUPLING_FRACTION * shares.max(), np.finfo(np.float64).tiny)))
    return float(np.max(np.abs(counted[0] - counted[1])))


class Vibration:
    """A history seen from steady sliding, over the stability's coordinates.

    It is read where it lies, on disk maybe, piece by piece or column by column: nothing but the times is held.
    """

    def __init__(self, history: "xarray.Dataset", stability: Stability) -> None:
        """Name the history and its steady state."""
        self._history, self._steady = history, np.asarray(stability.steady_state)
        recorded = history["coordinate"].values.tolist()
        self._index = [recorded.index(name) for name in stability.coordinates]
        self.coordinates = stability.coordinates
        self.time: NDArray[np.float64] = history["time"].values

    @classmethod
    def of(cls, chunks: Sequence[Chunk], stability: Stability) -> Self:
        """That of a transient's chunks, over the coordinates of the stability."""
        import xarray

        history = xarray.Dataset(
            {
                name: (("time", "coordinate"), np.concatenate([getattr(chunk, name) for chunk in chunks]))
                for name in ("displacement", "velocity")
            },
            {"time": np.concatenate([chunk.time for chunk in chunks]), "coordinate": list(stability.coordinates)},
        )
        return cls(history, stability)

    @property
    def displacement(self) -> NDArray[np.float64]:
        """All displacements (time, n), read anew."""
        return self.read("displacement")

    @property
    def velocity(self) -> NDArray[np.float64]:
        """All velocities (time, n), read anew."""
        return self.read("velocity")

    def column(self, coordinate: str, part: slice = slice(None), *, of: str = "displacement") -> NDArray[np.float64]:
        """Displacement, or velocity, of a coordinate (time,) in a part of the record."""
        return self.read(of, part, self.coordinates.index(coordinate))

    def read(self, name: str, part: slice = slice(None), k: int | slice = slice(None)) -> NDArray[np.float64]:
        """Displacement or velocity (time, n), or some of its columns, in a part of the record."""
        steady = self._steady[k]
        found = np.empty((self.time[part].size, *np.shape(steady)))
        for rows, piece in self._pieces(name, part):
            found[rows] = piece[:, k] - (steady if name == "displacement" else 0.0)
        return found

    def about(self, steady: NDArray[np.float64], part: slice) -> NDArray[np.float64]:
        """Displacements (time, n) in a part of the record, from another steady sliding (time, n) than that of t = 0."""
        return self.read("displacement", part) + self._steady - steady

    def pieces(self, part: slice = slice(None)) -> Iterator[tuple[slice, NDArray[np.float64], NDArray[np.float64]]]:
        """Rows of the part, displacement and velocity (rows, n) of it, piece by piece."""
        both = zip(self._pieces("displacement", part), self._pieces("velocity", part), strict=True)
        for (rows, displacement), (_, velocity) in both:
            yield rows, displacement - self._steady, velocity

    def _pieces(self, name: str, part: slice) -> Iterator[tuple[slice, NDArray[np.float64]]]:
        first, stop, _ = part.indices(self.time.size)
        for start in range(first, stop, PIECE):
            end = min(start + PIECE, stop)
            values = self._history[name].isel(time=slice(start, end)).values
            yield slice(start - first, end - first), values[:, self._index]

    @property
    def sample_rate(self) -> float:
        """Samples per second (Hz)."""
        return (self.time.size - 1) / float(self.time[-1] - self.time[0])

    def extremes(self, part: slice = slice(None)) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Smallest and largest displacement (n,) in a part of the record."""
        found = [(piece.min(axis=0), piece.max(axis=0)) for _, piece in self._pieces("displacement", part)]
        low, high = np.array([low for low, _ in found]).min(axis=0), np.array([high for _, high in found]).max(axis=0)
        return low - self._steady, high - self._steady

    def largest(self, part: slice = slice(None)) -> NDArray[np.float64]:
        """Largest size of the displacement (n,) in a part of the record."""
        return np.max(np.abs(self.extremes(part)), axis=0)

    def mean_square_velocity(self, part: slice = slice(None)) -> NDArray[np.float64]:
        """Mean of the squared velocity (n,) in a part of the record."""
        sums = [np.sum(piece**2, axis=0) for _, piece in self._pieces("velocity", part)]
        return np.sum(sums, axis=0) / self.time[part].size

    @property
    def largest_rotation(self) -> float:
        """Largest rotation of the record (rad)."""
        columns = [k for k, name in enumerate(self.coordinates) if is_rotation(name)]
        return float(self.largest()[columns].max(initial=0.0))

    @property
    def started(self) -> bool:
        """Whether the record begins away from steady sliding."""
        return any(np.any(self.read(name, slice(0, 1)) != 0) for name in ("displacement", "velocity"))

    def modal(self, mode: Mode, part: slice = slice(None)) -> NDArray[np.complex128]:
        """Complex amplitude 2 leftᴴ y of a mode (time,); its modulus is that of the named coordinate, in m or rad."""
        found = np.empty(self.time[part].size, dtype=np.complex128)
        for rows, displacement, velocity in self.pieces(part):
            found[rows] = 2 * modal_amplitudes(mode.left[:, None], np.hstack([displacement, velocity]))[:, 0]
        return found

    def spectra(self, part: slice, names: Sequence[str] | None = None) -> Iterator[tuple[str, Spectrum]]:
        """Displacement spectra of what moves in a part of the record (none if it is too short), of all or of some."""
        if self.time[part].size < FEWEST_FOR_SPECTRUM:
            return
        for name in self.coordinates if names is None else names:
            if np.ptp(self.column(name, part)) > 0:
                yield name, amplitude_spectrum(self.column(name, part), self.sample_rate)


def changes(model: Model, time: NDArray[np.float64]) -> bool:
    """Whether drum speed or load change within these times (s), also between two of them."""
    each_of = model.operation.schedules
    return any(np.ptp(_values(each, time[0], time[-1])) > 0 for each in each_of if isinstance(each, PiecewiseLinear))


def _values(profile: PiecewiseLinear, since: float, until: float) -> NDArray[np.float64]:
    """What a profile comes to within these times (s): at both and at the corners between."""
    time, value = np.asarray(profile.time), np.asarray(profile.value)
    return np.interp([since, *time[(time > since) & (time < until)], until], time, value)


def moved_by(model: Model, stability: Stability, until: float) -> str:
    """What pushes a shoe out of its steady sliding until a time (s), in words, such as "changing load"; else nothing.

    Drum speed, load and forces are changed in turn, each to the least and the most that it comes to. A shoe that the
    assembly balances at all times is not pushed.
    """
    schedules, shoes = model.operation.schedules, len(model.operation.preloads)
    kept = [np.asarray(each.at(stability.time)[0]) for each in schedules]
    if not (any(isinstance(each, PiecewiseLinear) for each in schedules) and any(model.moved_by_steady_sliding)):
        return ""
    middle, found = model.in_plane() if model.planar else model, []  # where steady sliding is
    q = np.asarray([stability.steady_state[stability.coordinates.index(name)] for name in model.names])
    for place, schedule in enumerate(schedules):
        if isinstance(schedule, PiecewiseLinear):
            values = _values(schedule, 0.0, until)
            rows = [np.repeat(value, 3) for value in kept]
            rows[place] = np.array([kept[place], values.min(), values.max()])
            forces, loads, pushes = np.asarray(_forces(middle, tuple(rows), q)), rows[1 : 1 + shoes], rows[1 + shoes :]
            largest = np.abs(loads).max() * float(model.body.area) + sum(np.abs(push).max() for push in pushes)
            if np.ptp(forces, axis=0).max() > 1e-10 * largest:  # of the load: forces that cancel leave so much at most
                found.append("drum speed" if place == 0 else "load" if place <= shoes else "force")
    return f"changing {' and '.join(dict.fromkeys(found))}" if found else ""


@Interpreted
def _forces(model: Model, rows: tuple[Array, ...], q: Array) -> Array:
    def force(values: tuple[Array, ...]) -> Array:
        operation = model.operation.replaced(map(Constant, values))
        return dataclasses.replace(model, operation=operation).act(0.0, q, jnp.zeros_like(q))[0]

    return jax.lax.map(force, tuple(jnp.asarray(row) for row in rows))


def boundary_ratio(vibration: Vibration, model: Model) -> NDArray[np.float64]:
    """How far the motion has come towards contact loss or slip reversal (time,).

    The largest of `boundary_fractions`, on any shoe.
    """
    fraction = np.empty(vibration.time.size)
    for rows, displacement, velocity in vibration.pieces():
        q, v = (dict(zip(vibration.coordinates, columns.T, strict=True)) for columns in (displacement, velocity))
        moments = moments_at(model.operation, vibration.time[rows])
        fraction[rows] = boundary_fractions(model, q, v, moments).max(axis=(0, 1))
    return fraction


@Interpreted
def moments_at(operation: Operation, times: Array) -> OperatingPoint:
    """The moments of a record (time,), as one."""
    return jax.vmap(operation.at)(times)


def first_boundary_time(history: "xarray.Dataset", stability: Stability, model: Model) -> float | None:
    """Time (s) of the first sample at which part of the lining has left the drum or slips backwards; None if never."""
    reached = beyond_boundaries(history, stability.contact_fractions, model)
    return float(history["time"].values[np.argmax(reached)]) if reached.any() else None


def beyond_boundaries(
    history: "xarray.Dataset", steady_contact: Sequence[ArrayLike], model: Model
) -> NDArray[np.bool_]:
    """At which samples (time,) part of a lining is off the drum or slips backwards.

    Read off what was recorded; `steady_contact` is the fraction of each lining that touches in steady sliding, of all
    samples or of each (time,). Where part of a lining is off the drum in steady sliding already, or next to the pin
    of a shoe that is pushed all but off, so that its contact boundary moves with every motion, another tenth of that
    lining must leave or touch it. A shoe that nothing pushes at first has yet to come on: what leaves the drum before
    the forces on it have risen to a tenth of their largest does not count.
    """
    time = history["time"].values
    reached = np.zeros(time.size, dtype=bool)
    fraction_round_off = 1e-12  # of a fraction of the lining, which is a sum over some hundred nodes
    for (mine, side), fraction, idle in zip(model.sides, steady_contact, idle_shoes(model, time), strict=True):
        if float(side.contact.lifting_stiffness) > 0:
            touching, steady = history[f"{mine.prefix}contact_fraction"].values, np.asarray(fraction)
            whole = (steady > 1 - fraction_round_off) & (not model.pushed)
            most = np.where(whole, fraction_round_off, LIFTED_FRACTION)
            reached |= (np.abs(touching - steady) > most) & ~_comes_on(model.operation, mine.number, time) & ~idle
    if model.contact.friction is not None:
        reached |= history["slip_reversed_fraction"].values > fraction_round_off
    return reached


def _comes_on(operation: Operation, shoe: int, time: NDArray[np.float64]) -> NDArray[np.bool_]:
    """At which samples (time,) a shoe that nothing pushes at first is not yet pressed on."""
    force = np.zeros(time.size)
    for number, each in zip(operation.pushed_shoes or [0] * len(operation.pushes), operation.pushes, strict=True):
        if number == shoe:
            force += np.abs(values_at(each, time))
    return (np.maximum.accumulate(force) < LIFTED_FRACTION * force.max()) & (force[0] == 0)


# Which of several shoes comes to move most: what is heard, compared and drawn of a record without being asked.


def loudest_shoe(body: Any, names: Sequence[str], velocity: NDArray[np.float64]) -> int:
    """The number of the shoe whose lining's middle moves most along the drum in the last part of a record.

    By the mean square of its velocity, of velocities (time, n) of named coordinates.
    """
    # The last 0.6 of the record, by which a start that decays has lost most of its motion.
    late = dict(zip(names, velocity[round(0.4 * len(velocity)) :].T, strict=True))
    along = (each.shoe.displacement(each.share.own(late), 0.0)[1] for each in placed(body))
    return int(np.argmax([np.mean(np.square(each)) for each in along]))
