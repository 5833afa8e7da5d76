"""The right-hand side as fast as it can be made by hand: exact edges, branches, no trigonometry at the nodes.

A scalar code may branch, and does: without an edge the nodes come from a table, a separated piece is skipped, and an
edge that is not there costs a comparison. Where there are edges, a piece is turned to its own middle, of which sine and
cosine follow from those of its ends, and the offsets ±h x_j have short Taylor series. Up to an arc of 130°.
"""

from math import atan2, factorial, floor, sqrt

import numpy as np
from numba import njit  # pyright: ignore[reportMissingImports]

from . import parameters as p

# Gauss nodes on a piece of at most SHORT (rad, half its angle), and on a longer one: both fill the processor's lanes,
# and leave errors of the force below 1e-12 of p0 times the area.
FEW, MANY, SHORT = 8, p.NODES, 0.6
RULES = [np.polynomial.legendre.leggauss(count) for count in (FEW, MANY)]
POINTS, WEIGHTS = (np.concatenate([rule[k] for rule in RULES]) for k in range(2))
LOG2_E, LN2_HIGH, LN2_LOW = 1.4426950408889634, 0.6931471803691238, 1.9082149292705877e-10
S3, S5, S7, S9, S11, S13, S15, S17 = ((-1.0) ** k / factorial(2 * k + 1) for k in range(1, 9))
C2, C4, C6, C8, C10, C12, C14, C16 = ((-1.0) ** k / factorial(2 * k) for k in range(1, 9))
E2, E3, E4, E5, E6, E7, E8, E9, E10, E11, E12 = (1.0 / factorial(k) for k in range(2, 13))


@njit(fastmath=True, inline="always")
def _exponential(x):
    """e^x to round-off in arithmetic that vectorises (the library's is a call a node): 2^k times a Taylor series."""
    k = floor(x * LOG2_E + 0.5)
    r = x - k * LN2_HIGH - k * LN2_LOW
    tail = E6 + r * (E7 + r * (E8 + r * (E9 + r * (E10 + r * (E11 + r * E12)))))
    value = 1.0 + r * (1.0 + r * (E2 + r * (E3 + r * (E4 + r * (E5 + r * tail)))))
    return value * np.int64((np.int64(k) + 1023) << 52).view(np.float64)


@njit(fastmath=True)
def _piece(low, low_cosine, low_sine, high, high_cosine, high_sine, n0, nc, ns, v0, vc, vs, kinetic, difference, decay):
    """∫(−N cos θ − F sin θ), ∫(−N sin θ + F cos θ) and ∫F over a piece without edges; N, V: constant, cosine, sine."""
    half = (high - low) * 0.5
    if half <= 0.0:
        return 0.0, 0.0, 0.0
    sum_cosine, sum_sine = low_cosine + high_cosine, low_sine + high_sine
    inverse = 1.0 / sqrt(sum_cosine * sum_cosine + sum_sine * sum_sine)
    mc, ms = sum_cosine * inverse, sum_sine * inverse
    n1, n2 = nc * mc + ns * ms, ns * mc - nc * ms
    if n0 + n1 <= 0.0:
        return 0.0, 0.0, 0.0
    v1, v2 = vc * mc + vs * ms, vs * mc - vc * ms
    sign = 1.0 if v0 + v1 > 0.0 else -1.0
    rate = -decay * sign
    e0, e1, e2 = rate * v0, rate * v1, rate * v2
    x, y, spin = 0.0, 0.0, 0.0
    first, last = (0, FEW) if half <= SHORT else (FEW, FEW + MANY)
    for j in range(first, last):
        t = half * POINTS[j]
        u = t * t
        sine = S9 + u * (S11 + u * (S13 + u * (S15 + u * S17)))
        sine = t * (1.0 + u * (S3 + u * (S5 + u * (S7 + u * sine))))
        cosine = C8 + u * (C10 + u * (C12 + u * (C14 + u * C16)))
        cosine = 1.0 + u * (C2 + u * (C4 + u * (C6 + u * cosine)))
        load = WEIGHTS[j] * (n0 + n1 * cosine + n2 * sine)
        drag = load * (kinetic + difference * _exponential(e0 + e1 * cosine + e2 * sine))
        x += load * cosine - sign * drag * sine
        y += load * sine + sign * drag * cosine
        spin += drag
    x, y, spin = -half * x, -half * y, -sign * half * spin
    return x * mc - y * ms, x * ms + y * mc, spin


@njit(fastmath=True)
def _roots(constant, cosine, sine, discriminant, half_angle, end_cosine, end_sine):
    """Both roots as θ, cos θ, sin θ, in order; one that is not on the arc lies at its upper end."""
    root, inverse = sqrt(discriminant), 1.0 / (cosine * cosine + sine * sine)
    c1, s1 = (-constant * cosine - sine * root) * inverse, (-constant * sine + cosine * root) * inverse
    c2, s2 = (-constant * cosine + sine * root) * inverse, (-constant * sine - cosine * root) * inverse
    t1 = t2 = half_angle
    if c1 > end_cosine:
        t1 = atan2(s1, c1)
    else:
        c1, s1 = end_cosine, end_sine
    if c2 > end_cosine:
        t2 = atan2(s2, c2)
    else:
        c2, s2 = end_cosine, end_sine
    if t1 <= t2:
        return t1, c1, s1, t2, c2, s2
    return t2, c2, s2, t1, c1, s1


@njit(fastmath=True)
def _split(a, n0, nc, ns, v0, vc, vs, pressure, slip):
    """The integrals of `_piece` over the arc, cut at its edges; the last two are the discriminants of the levels."""
    half, ec, es = a[p.HALF_ANGLE], a[p.COSINE_END], a[p.SINE_END]
    t1 = t2 = t3 = t4 = half
    c1 = c2 = c3 = c4 = ec
    s1 = s2 = s3 = s4 = es
    if pressure > 0.0:
        t1, c1, s1, t2, c2, s2 = _roots(n0, nc, ns, pressure, half, ec, es)
    if slip > 0.0:
        t3, c3, s3, t4, c4, s4 = _roots(v0, vc, vs, slip, half, ec, es)
    # Merge the two ordered pairs.
    if t3 < t1:
        t1, c1, s1, t3, c3, s3 = t3, c3, s3, t1, c1, s1
    if t4 < t2:
        t2, c2, s2, t4, c4, s4 = t4, c4, s4, t2, c2, s2
    if t3 < t2:
        t2, c2, s2, t3, c3, s3 = t3, c3, s3, t2, c2, s2
    x, y, spin = 0.0, 0.0, 0.0
    low, lc, ls = -half, ec, -es
    high, hc, hs = t1, c1, s1
    for k in range(5):
        if k == 1:
            high, hc, hs = t2, c2, s2
        elif k == 2:
            high, hc, hs = t3, c3, s3
        elif k == 3:
            high, hc, hs = t4, c4, s4
        elif k == 4:
            high, hc, hs = half, ec, es
        dx, dy, ds = _piece(
            low, lc, ls, high, hc, hs, n0, nc, ns, v0, vc, vs, a[p.KINETIC], a[p.DIFFERENCE], a[p.DECAY]
        )
        x, y, spin = x + dx, y + dy, spin + ds
        if high >= half:
            break
        low, lc, ls = high, hc, hs
    line = a[p.RADIUS] * a[p.WIDTH]
    return line * x, line * y, line * spin


@njit(fastmath=True)
def _whole(a, n0, nc, ns, v0, vc, vs):
    """The same over the whole arc without an edge, at the nodes of the table."""
    sign = 1.0 if v0 + vc > 0.0 else -1.0
    rate = -a[p.DECAY] * sign
    e0, e1, e2 = rate * v0, rate * vc, rate * vs
    kinetic, difference = sign * a[p.KINETIC], sign * a[p.DIFFERENCE]
    x, y, spin = 0.0, 0.0, 0.0
    for j in range(MANY):
        cosine, sine = a[p.TABLE + j], a[p.TABLE + MANY + j]
        load = a[p.TABLE + 2 * MANY + j] * (n0 + nc * cosine + ns * sine)
        drag = load * (kinetic + difference * _exponential(e0 + e1 * cosine + e2 * sine))
        x += load * cosine - drag * sine
        y += load * sine + drag * cosine
        spin += drag
    return -x, -y, -spin


@njit(fastmath=True)
def _has_boundary(constant, cosine, sine, discriminant, end_cosine, end_sine):
    """Whether a level vanishes on the arc: not if the ends have one sign and a possible extremum lies outside."""
    if discriminant <= 0.0:
        return False
    middle, tilt = constant + cosine * end_cosine, abs(sine * end_sine)
    if middle * middle <= tilt * tilt:
        return True
    # The extremum opposite in sign to the ends points along (cosine, sine) or against it; is it on the arc?
    towards = -cosine if middle > 0.0 else cosine
    return towards > end_cosine * sqrt(cosine * cosine + sine * sine)


@njit(fastmath=True)
def right_hand_side(state, parameters, rate):
    """M q̈ = Q(q, q̇) − Q(0, 0) − ∂U/∂q as ẏ = f(y), both scaled; counts itself in the parameters."""
    a = parameters
    qx, qy, qt = state[0] * a[p.SCALE], state[1] * a[p.SCALE + 1], state[2] * a[p.SCALE + 2]
    vx, vy, vt = state[3] * a[p.SCALE + 3], state[4] * a[p.SCALE + 4], state[5] * a[p.SCALE + 5]
    n0, nc, ns = a[p.PRELOAD], a[p.STIFFNESS] * qx, a[p.STIFFNESS] * (qy - a[p.CENTROID] * qt)
    v0, vc, vs = a[p.RADIUS] * vt - a[p.DRUM], vy - a[p.CENTROID] * vt, -vx
    ec, es = a[p.COSINE_END], a[p.SINE_END]
    pressure, slip = nc * nc + ns * ns - n0 * n0, vc * vc + vs * vs - v0 * v0
    if _has_boundary(n0, nc, ns, pressure, ec, es) or _has_boundary(v0, vc, vs, slip, ec, es):
        x, y, spin = _split(a, n0, nc, ns, v0, vc, vs, pressure, slip)
    else:
        x, y, spin = _whole(a, n0, nc, ns, v0, vc, vs)
    moment = a[p.RADIUS] * spin - a[p.CENTROID] * y
    u = qt * qt
    sine_cosine = qt * (1.0 - u * (2.0 / 3.0 - u * (2.0 / 15.0)))  # exact below 0.01 rad; beyond that contact is lost
    rate[0], rate[1], rate[2] = vx * a[p.INVERSE_SCALE], vy * a[p.INVERSE_SCALE + 1], vt * a[p.INVERSE_SCALE + 2]
    x = (x + a[p.BALANCE] - a[p.SUPPORT] * qx) * a[p.INVERSE_MASS]
    y = (y + a[p.BALANCE + 1]) * a[p.INVERSE_MASS + 1]
    moment = (moment + a[p.BALANCE + 2] - a[p.TORSION] * sine_cosine) * a[p.INVERSE_MASS + 2]
    rate[3], rate[4], rate[5] = x * a[p.INVERSE_SCALE + 3], y * a[p.INVERSE_SCALE + 4], moment * a[p.INVERSE_SCALE + 5]
    a[p.EVALUATIONS] += 1.0
