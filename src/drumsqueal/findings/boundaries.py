"""How far a motion comes towards lift-off and slip reversal, below which it is nearly linear."""

import functools
from collections.abc import Mapping, Sequence

import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from drumsqueal.physics.bodies.body import scalars
from drumsqueal.physics.effects.effect import at_rest
from drumsqueal.physics.effects.operation import Moment, Profile
from drumsqueal.physics.effects.several import Contacts
from drumsqueal.physics.model import Model
from drumsqueal.programs import Program
from drumsqueal.solve.linear.modes import Mode
from drumsqueal.solve.linear.passage import value_at
from drumsqueal.solve.linear.steady import steady_sliding

LIFTED_FRACTION = 0.1  # of the lining

Columns = Mapping[str, NDArray[np.float64]]


def boundary_ratios(model: Model, vibration: NDArray[np.float64], velocity: NDArray[np.float64]) -> tuple[float, float]:
    """The largest fraction of contact loss and of slip reversal in a motion, by the speed and the load at t = 0.

    `vibration` from steady sliding (m, rad) and `velocity` are (time, n) in the order of `model.names`.
    """
    moment = model.operation.at(0.0)
    q, v = (dict(zip(model.names, columns.T, strict=True)) for columns in (vibration, velocity))
    lost, back = pressure_fraction(model, q, moment), slip_fraction(model, v, moment.drum_speed)
    return float(np.max(lost)), float(np.max(back))


def mean_pressure(model: Model, moment: Moment) -> ArrayLike:
    """The mean pressure on the lining (Pa) at a moment, or at the moments of a record (time,); the smallest of several.

    p0, which the load spreads evenly; of a shoe that is pushed, normal force over lining area in steady sliding.
    """
    return functools.reduce(np.minimum, mean_pressures(model, moment))


def mean_pressures(model: Model, moment: Moment) -> tuple[ArrayLike, ...]:
    """The same for every shoe.

    That of steady sliding is found at the corners of what changes with time, and linear between them.
    """
    if not model.pushed:
        return tuple(preload for preload, _ in moment.preloads)
    changing = [np.asarray(each.time) for each in model.operation.schedules if isinstance(each, Profile)]
    corners = np.unique(np.concatenate([[0.0], *changing]))
    found = np.array([np.asarray(_means_of_steady_sliding(model.frozen(time))) for time in corners.tolist()])
    known = np.isfinite(found).all(axis=1)  # a drum that hardly turns may lock the shoe: no steady sliding then
    if not known.any():
        return (np.inf,) * found.shape[1]
    return tuple(np.interp(np.asarray(moment.time), corners[known], each[known]) for each in found.T)


@Program
def _means_of_steady_sliding(model: Model) -> Array:
    q = scalars(steady_sliding(model))
    contact, moment = model.contact.in_plane() if model.planar else model.contact, model.operation.at(0.0)
    if isinstance(contact, Contacts):
        return contact.mean_pressures(moment, q)
    return contact.observe(moment, q, at_rest(q)).normal_force[None] / model.body.area


def pressure_fraction(model: Model, q: Columns, moment: Moment) -> NDArray[np.float64]:
    """k_c max|u_r − u_r*| over the mean pressure (time,), q displacements (time,) by name; 0 without separation.

    The maximum is a bound over the whole circle: where the steady pressure is uniform nothing has lifted off below 1.
    """
    depth, _ = model.body.largest(q)
    return _over(float(model.contact.lifting_stiffness) * depth, np.asarray(mean_pressure(model, moment)))


def slip_fraction(model: Model, v: Columns, drum_speed: ArrayLike) -> NDArray[np.float64]:
    """max|u̇_θ| over R|Ω| (time,), v velocities (time,) by name; 0 without friction, and bounded in the same way."""
    _, along = model.body.largest(v)
    if model.contact.friction is None:
        return np.zeros(along.shape)
    return _over(along, float(model.contact.radius) * np.abs(np.asarray(drum_speed)))


def amplitude_at_boundary(model: Model, mode: Mode, steady: NDArray[np.float64], time: float) -> float:
    """The amplitude at which a mode alone reaches a contact boundary, lift-off or slip reversal; infinite without any.

    In m or rad of the coordinate that names it, about steady sliding q* (n,) by load and speed at a time (s).
    Where part of the lining is off the drum in steady sliding already, or one end is hardly pressed, as that next to
    the pin of a shoe that is pushed, another tenth must leave or touch it.
    """
    into, along = model.body.surface()
    stiffness, (pressure,) = surface_stiffness(model), surface_pressure(model, steady[None], [time])
    rates = mode.right[steady.size :]
    lifts = _over_size(pressure, stiffness * np.abs(into @ mode.right[: steady.size]))
    lifted = float(
        lifts.min() if pressure.min() > 0 and not model.pushed else np.quantile(lifts, LIFTED_FRACTION, method="lower")
    )
    if model.contact.friction is None:
        return lifted
    sliding = np.full(len(along), float(model.contact.radius) * value_at(model.operation.drum_speed, time))
    return min(lifted, float(_over_size(sliding, np.abs(along @ rates)).min()))


def surface_stiffness(model: Model) -> NDArray[np.float64]:
    """Of a contact that can be lost (N/m³) at the points of `Body.surface`; zero where it cannot."""
    found = [(side.contact.lifting_stiffness, len(side.body.surface()[0])) for _, side in model.sides]
    return np.concatenate([np.full(points, float(stiffness)) for stiffness, points in found])


def surface_pressure(model: Model, steady: NDArray[np.float64], time: Sequence[float]) -> NDArray[np.float64]:
    """The level of pressure (Pa) at the points of `Body.surface` (time, points) in steady sliding q* (time, n).

    By the loads at each time (s). Negative where the lining is off the drum. Of a contact that cannot be lost, the
    load's share alone.
    """
    into, _ = model.body.surface()
    counts = [len(side.body.surface()[0]) for _, side in model.sides]
    loads = np.array([[value_at(preload, each) for preload in model.operation.preloads] for each in time])
    return np.repeat(loads, counts, axis=1) + surface_stiffness(model) * (steady @ into.T)


def _over_size(limit: NDArray[np.float64], size: NDArray[np.float64]) -> NDArray[np.float64]:
    """|limit| over size; infinite where there is no motion."""
    return np.divide(np.abs(limit), size, out=np.full(limit.shape, np.inf), where=size > 0)


def _over(size: NDArray[np.float64], limit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Size over limit; any motion at all is infinitely far beyond a limit of zero."""
    size, limit = np.broadcast_arrays(size, limit)
    beyond = np.where(size > 0, np.inf, 0.0)
    return np.divide(size, limit, out=beyond, where=limit > 0)
