"""How far a motion comes towards the edges, contact loss and slip reversal, below which it is nearly linear."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.physics.bodies.rigid_shoe import TX, TY, TZ, X, Y
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.point_contact import PointContact
from drumsqueal.physics.effects.pressure import Unilateral
from drumsqueal.physics.model import Model

Columns = list[NDArray[np.float64]]


def edge_shares(model: Model, departure: NDArray[np.float64], velocity: NDArray[np.float64]) -> tuple[float, float]:
    """The largest share of contact loss and of slip reversal in a motion, by the speed and the load at t = 0.

    `departure` from steady sliding (m, rad) and `velocity` are (time, n) in the order of `model.names`.
    """
    moment = model.operation.at(0.0)
    lost = pressure_share(model, wide(model, departure), moment.preload)
    back = slip_share(model, wide(model, velocity), moment.drum_speed)
    return float(np.max(lost)), float(np.max(back))


def wide(model: Model, columns: NDArray[np.float64]) -> Columns:
    """All six coordinates (time,) of a motion (time, n), zero where left out."""
    zero = np.zeros(len(columns))
    return [columns[:, model.coordinates.index(i)] if i in model.coordinates else zero for i in range(6)]


def pressure_share(model: Model, q: Columns, preload: ArrayLike) -> NDArray[np.float64]:
    """k_c max|u_r − u_r*| over the mean pressure p0 (time,), q six departures (time,); 0 without separation.

    The maximum is a bound over the whole circle: where the steady pressure is uniform nothing has lifted off below 1.
    """
    contact = model.contact
    assert isinstance(contact, Contact | PointContact)
    if not isinstance(contact.law, Unilateral):
        return np.zeros(q[0].size)
    if isinstance(contact, PointContact):
        depth = np.abs(q[Y])
    else:
        shoe = contact.shoe
        c, half_width = float(shoe.centroid), float(shoe.width) / 2
        depth = np.hypot(q[X], q[Y] - c * q[TZ]) + half_width * np.hypot(q[TX], q[TY])
    return _over(float(contact.law.stiffness) * depth, np.asarray(preload))


def slip_share(model: Model, v: Columns, drum_speed: ArrayLike) -> NDArray[np.float64]:
    """max|u̇_θ| over R|Ω| (time,), v six velocities (time,); 0 without friction, and bounded in the same way."""
    contact = model.contact
    assert isinstance(contact, Contact | PointContact)
    if contact.friction is None:
        return np.zeros(v[0].size)
    speed = np.abs(np.asarray(drum_speed))
    if isinstance(contact, PointContact):
        return _over(np.abs(v[X]), speed)
    shoe = contact.shoe
    c, half_width, radius = float(shoe.centroid), float(shoe.width) / 2, float(shoe.outer_radius)
    tangential = np.abs(radius * v[TZ]) + np.hypot(v[X], v[Y] - c * v[TZ]) + half_width * np.hypot(v[TX], v[TY])
    return _over(tangential, radius * speed)


def _over(size: NDArray[np.float64], limit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Size over limit; any motion at all is infinitely far beyond a limit of zero."""
    size, limit = np.broadcast_arrays(size, limit)
    beyond = np.where(size > 0, np.inf, 0.0)
    return np.divide(size, limit, out=beyond, where=limit > 0)
