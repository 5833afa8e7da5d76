"""The right-hand side in plain scalar code, any number of nodes a piece: the reference, and the first thing one writes.

Deliberately apart from the fast one: library sines and exponentials, angles instead of directions, an explicit sort.
"""

from collections.abc import Callable
from functools import cache
from math import atan2, cos, exp, sin, sqrt

import numpy as np
from numba import njit  # pyright: ignore[reportMissingImports]

from . import parameters as p

RightHandSide = Callable[[np.ndarray, np.ndarray, np.ndarray], None]


@njit
def _root(constant: float, cosine: float, sine: float, sign: float, missing: float) -> float:
    """Root θ (rad) of constant + cosine cos θ + sine sin θ, within (−missing, missing), or `missing`."""
    discriminant = cosine * cosine + sine * sine - constant * constant
    if discriminant <= 0:
        return missing
    swing = sign * sqrt(discriminant)
    angle = atan2(-constant * sine + cosine * swing, -constant * cosine - sine * swing)
    return angle if abs(angle) < missing else missing


@cache
def scalar_right_hand_side(nodes: int) -> RightHandSide:
    """Compile ẏ = f(y, parameters) → rate with so many Gauss nodes a piece; y is scaled."""
    points, weights = np.polynomial.legendre.leggauss(nodes)

    @njit
    def right_hand_side(state, parameters, rate):
        a = parameters
        qx, qy, qt = state[0] * a[p.SCALE], state[1] * a[p.SCALE + 1], state[2] * a[p.SCALE + 2]
        vx, vy, vt = state[3] * a[p.SCALE + 3], state[4] * a[p.SCALE + 4], state[5] * a[p.SCALE + 5]
        half = a[p.HALF_ANGLE]
        pressure_cosine, pressure_sine = a[p.STIFFNESS] * qx, a[p.STIFFNESS] * (qy - a[p.CENTROID] * qt)
        slip_constant, slip_cosine, slip_sine = a[p.RADIUS] * vt - a[p.DRUM], vy - a[p.CENTROID] * vt, -vx
        bounds = np.empty(6)
        bounds[0], bounds[5] = -half, half
        bounds[1] = _root(a[p.PRELOAD], pressure_cosine, pressure_sine, 1.0, half)
        bounds[2] = _root(a[p.PRELOAD], pressure_cosine, pressure_sine, -1.0, half)
        bounds[3] = _root(slip_constant, slip_cosine, slip_sine, 1.0, half)
        bounds[4] = _root(slip_constant, slip_cosine, slip_sine, -1.0, half)
        bounds.sort()
        x = y = spin = 0.0
        for piece in range(5):
            middle, width = (bounds[piece] + bounds[piece + 1]) / 2, (bounds[piece + 1] - bounds[piece]) / 2
            if width <= 0 or a[p.PRELOAD] + pressure_cosine * cos(middle) + pressure_sine * sin(middle) <= 0:
                continue
            for node in range(nodes):
                angle = middle + width * points[node]
                cosine, sine = cos(angle), sin(angle)
                load = weights[node] * width * (a[p.PRELOAD] + pressure_cosine * cosine + pressure_sine * sine)
                slip = slip_constant + slip_cosine * cosine + slip_sine * sine
                friction = a[p.KINETIC] + a[p.DIFFERENCE] * exp(-a[p.DECAY] * abs(slip))
                drag = -np.sign(slip) * friction * load
                x += -load * cosine - drag * sine
                y += -load * sine + drag * cosine
                spin += drag
        line = a[p.RADIUS] * a[p.WIDTH]
        moment = line * (a[p.RADIUS] * spin - a[p.CENTROID] * y)
        rate[0], rate[1], rate[2] = vx, vy, vt
        rate[3] = (line * x + a[p.BALANCE] - a[p.SUPPORT] * qx) * a[p.INVERSE_MASS]
        rate[4] = (line * y + a[p.BALANCE + 1]) * a[p.INVERSE_MASS + 1]
        rate[5] = (moment + a[p.BALANCE + 2] - a[p.TORSION] * sin(qt) * cos(qt)) * a[p.INVERSE_MASS + 2]
        for k in range(6):
            rate[k] *= a[p.INVERSE_SCALE + k]
        a[p.EVALUATIONS] += 1

    return right_hand_side
