"""How far a motion comes towards lift-off and slip reversal, below which it is nearly linear."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.physics.effects.operation import Moment, PiecewiseLinear
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import Mode
from drumsqueal.solve.linear.passage import values_at
from drumsqueal.solve.linear.steady import observe_steady, sliding_or_none

LIFTED_FRACTION = 0.1  # of the lining

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


def boundary_fractions(model: Model, q: Columns, v: Columns, moment: Moment) -> NDArray[np.float64]:
    """How far a motion comes towards contact loss and towards slip reversal, on each shoe (2, shoe, time).

    k_c max|u_r − u_r*| over the mean pressure, 0 without separation, and max|u̇_θ| over R|Ω|, 0 without friction, of
    displacements and velocities (time,) by name. The maxima are bounds over the whole circle: where the steady pressure
    is uniform nothing has lifted off below 1, and nothing slips backwards. A shoe that nothing presses has no contact
    to lose, unless nothing presses any.
    """
    lost, back = [], []
    for (mine, side), mean in zip(model.sides, mean_pressures(model, moment), strict=True):
        (into, _), (_, along) = (side.body.largest(mine.own(motion)) for motion in (q, v))
        sliding = float(side.contact.radius) * np.abs(np.asarray(moment.drum_speed))
        # A number where no kept coordinate moves the lining that way.
        into, mean, along, sliding = np.broadcast_arrays(*map(np.atleast_1d, (into, mean, along, sliding)))
        lost.append((float(side.contact.lifting_stiffness) * into, mean))
        back.append(np.zeros(along.shape) if side.contact.friction is None else _over(along, sliding))
    depth, pressure = np.swapaxes(np.array(lost), 0, 1)
    return np.stack([np.where(idle_shoes(model, moment.time), 0.0, _over(depth, pressure)), np.stack(back)])


def idle_shoes(model: Model, time: ArrayLike) -> NDArray[np.bool_]:
    """Which shoes have no contact to lose at times (shoe, time): a load of zero beside another that is none."""
    times = np.atleast_1d(np.asarray(time, dtype=np.float64))
    pressed = np.array([values_at(preload, times) for preload in model.operation.preloads]) > 0
    return ~pressed & pressed.any(axis=0)


def mean_pressures(model: Model, moment: Moment) -> list[NDArray[np.float64]]:
    """The mean pressure on each lining (Pa) at a moment, or at the moments of a record (time,).

    p0, which the load spreads evenly; of shoes that are pushed, normal force over lining area in steady sliding. That
    is found at the corners of what changes with time, and linear between them.
    """
    if not model.pushed:
        return [np.asarray(preload) for preload, _ in moment.preloads]
    changing = [np.asarray(each.time) for each in model.operation.schedules if isinstance(each, PiecewiseLinear)]
    corners = np.unique(np.concatenate([[0.0], *changing]))
    forces = np.array([_normal_forces(model.frozen(time)) for time in corners.tolist()])
    known = np.isfinite(forces).all(axis=1)  # a drum that hardly turns may lock the shoe: no steady sliding then
    means = forces[known].T / [[float(side.body.area)] for _, side in model.sides]
    time = np.asarray(moment.time)
    return [np.interp(time, corners[known], mean) if mean.size else np.asarray(np.inf) for mean in means]


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
    pressures, idle = surface_pressures(model, steady, time), idle_shoes(model, time)
    for (mine, side), pressure, resting in zip(model.sides, pressures, idle, strict=True):
        into, along = side.body.surface()
        moved, rates = (part[:, np.array(mine.places)] for part in np.split(shapes, 2, axis=1))
        lifts = _over_size(pressure, float(side.contact.lifting_stiffness) * np.abs(moved @ into.T))
        whole = (pressure.min(axis=1) > 0) & (not model.pushed)
        tenth = np.quantile(lifts, LIFTED_FRACTION, axis=1, method="lower")
        found.append(np.where(resting, np.inf, np.where(whole, lifts.min(axis=1), tenth)))
        if side.contact.friction is not None:
            found.append(_over_size(float(side.contact.radius) * speeds, np.abs(rates @ along.T).max(axis=1)))
    return np.min(found, axis=0)


def surface_pressures(model: Model, steady: NDArray[np.float64], time: Sequence[float]) -> list[NDArray[np.float64]]:
    """The level of pressure (Pa) at the points of each shoe's `surface` (time, points) in steady sliding q* (time, n).

    By the loads at each time (s). Negative where the lining is off the drum. Of a contact that cannot be lost, the
    load's share alone.
    """
    found = []
    for (mine, side), preload in zip(model.sides, model.operation.preloads, strict=True):
        into, _ = side.body.surface()
        loads = values_at(preload, time)[:, None]
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
