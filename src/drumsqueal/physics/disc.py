"""A uniform disc that lies flat on a plate, evenly loaded: it slides and spins against friction over its area, exactly.

The drum's speed of the operation is that of the plate along X (m/s), its preload the pressure (Pa). With a constant
coefficient force and torque are elliptic integrals (Farkas et al., Physical Review Letters 90 (2003) 248302).
"""

from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from drumsqueal.physics.bodies.body import Motion, dot
from drumsqueal.physics.effects.effect import Action, Observation, Touching
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.physics.effects.pressure import PressureLaw
from drumsqueal.physics.laws.friction_law import breakpoints
from drumsqueal.physics.quadrature.arc import sort_by_counting
from drumsqueal.precision import real

# Integrals over a disc that slides and spins, along lines through its instantaneous centre of rotation. On such a line
# all slip velocities are at right angles to it, and grow in proportion to the distance from that centre: friction has
# one direction on either side of it, and no integral meets the turn of the direction inside.

# The lines' angle is the Gudermannian of t, tan(χ/2) = tanh(t/2), and the trapezoidal rule is taken in t: however near
# the centre of rotation is to the rim, what is integrated is analytic for |Im t| < π/2, and the rule's error is
# some thousand times exp(−π²/_STEP), 5e-13; beyond the last line it leaves out 2 exp(−28), as much.
_STEP = 0.28
# Gauss points on each stretch of a line: two are exact where the coefficient of friction is constant.
_POINTS, _POINTS_CONSTANT = 16, 2


class _DiscNodes(NamedTuple):
    """Nodes (m,) on half of the disc, the other half being its mirror image about a line along X.

    Place x (m) along the line of each, from the foot of the perpendicular from the centre; cosine and sine of that
    line's angle, and the weight (m²), which counts both halves. The slip velocity is speed · (cosine, sine), with the
    speed (m/s) negative beyond the centre of rotation; at the other half its sine has the other sign.
    """

    place: Array
    cosine: Array
    sine: Array
    speed: Array
    weight: Array


def _disc_nodes(radius: Array, sliding: Array, spinning: Array, speeds: Array) -> _DiscNodes:
    """Nodes for a centre that slides at u ≥ 0 along X and a spin of ω ≥ 0, given by u and Rω (m/s), not both zero.

    A line at angle φ passes the disc's centre at h = (u/ω) sin φ. Where Rω ≥ u the lines are parametrised by φ = χ, and
    elsewhere by h = R sin χ. A line is cut at the centre of rotation, or at its middle where that is off the disc, and
    where the slip speed is one of those that cut the friction law (K,).
    """
    outside = sliding > spinning
    largest = jnp.where(outside, sliding, spinning)
    ratio = jnp.where(outside, spinning, sliding) / largest
    t = _STEP * np.arange(101)  # lines
    # cos χ = 1/cosh t, √(1 − ratio² sin² χ) and their quotient, which stays finite where both vanish.
    cosine, sine = 1 / np.cosh(t), np.tanh(t)
    quotient = jnp.sqrt(1 + (1 - ratio) * (1 + ratio) * np.sinh(t) ** 2)
    root = cosine * quotient
    half, lean = jnp.where(outside, cosine, root), jnp.where(outside, root, ratio * cosine)
    slope = jnp.where(outside, ratio, 1.0)
    middle = jnp.where(outside, 0.0, -lean)
    x, fraction = np.polynomial.legendre.leggauss(_POINTS if speeds.size else _POINTS_CONSTANT)
    signed = jnp.concatenate([-speeds, speeds])[:, None] / largest
    varies = slope > 0
    cuts = jnp.where(varies, (signed - lean) / jnp.where(varies, slope, 1.0), 0.0)
    ends = sort_by_counting(jnp.concatenate([jnp.stack([-half, middle, half]), jnp.clip(cuts, -half, half)]))[
        :, :, None
    ]
    low, high = ends[:-1], ends[1:]
    place = (low + high) / 2 + (high - low) / 2 * x
    level = lean[:, None] + slope * place
    # dA = |level| dx dφ, of which dφ = dχ, or cos χ/√(…) dχ where lines are parametrised by h; dχ = cos χ dt.
    step = _STEP * np.where(t == 0, 1.0, 2.0) * cosine * jnp.where(outside, 1 / quotient, 1.0)
    weight = (high - low) / 2 * fraction * step[:, None] * jnp.abs(level)
    angle = (jnp.where(outside, root, cosine), jnp.where(outside, ratio * sine, sine))
    lines = (jnp.broadcast_to(each[:, None], place.shape) for each in angle)
    across, along = (each.ravel() for each in lines)
    return _DiscNodes(radius * place.ravel(), across, along, largest * level.ravel(), radius**2 * weight.ravel())


class Disc(eqx.Module):
    """Radius R (m) and mass m (kg); its coordinates are X, Y (m) and the rotation Tz (rad) about its centre."""

    radius: Array = eqx.field(converter=real)
    weight: Array = eqx.field(converter=real)
    names: ClassVar[tuple[str, ...]] = ("X", "Y", "Tz")  # along the plate's motion, across it, and the spin
    symmetric: ClassVar[tuple[bool, ...]] = (True, True, True)
    following: ClassVar[Motion] = (1.0, 0.0, 0.0)
    follows: ClassVar[bool] = True

    @property
    def area(self) -> Array:
        """π R² (m²)."""
        return jnp.pi * self.radius**2

    @property
    def mass(self) -> Array:
        """Diagonal of the mass matrix over X, Y and Tz, (m, m, ½ m R²), shape (3,)."""
        return self.weight * jnp.stack([jnp.ones(()), jnp.ones(()), self.radius**2 / 2])

    def slides(self, *, axially: bool) -> tuple[bool, ...]:
        """All three."""
        del axially
        return True, True, True

    def largest(self, q: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Nothing into the plate; along it, on the rim."""
        along = np.hypot(q["X"], q["Y"]) + float(self.radius) * np.abs(q["Tz"])
        return np.zeros_like(along), along

    def surface(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Nothing into the plate; along it, of the centre and of the rim's two points across it."""
        across = float(self.radius) * np.array([0.0, 1.0, -1.0])
        along = np.stack([np.ones(3), np.zeros(3), -across], axis=1)
        return np.zeros_like(along), along


class DiscContact(Touching):
    """F = −∫ μ(|V|) p V/|V| dA with V = u + ω e_z × r."""

    body: Disc
    law: PressureLaw
    friction: Friction | None

    @property
    def units(self) -> tuple[str, str, str]:
        """Those of a plate."""
        return "m/s", "Pa", "N/m³"

    def fastest_slip(self, moment: Moment, v: Motion) -> Array:
        """|u| + R |ω| (m/s), reached on the rim."""
        ux, uy, rim = self._motion(moment, v)
        squared = ux * ux + uy * uy
        sliding = jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1.0)), 0.0)
        return sliding + jnp.abs(rim)

    def pressure_range(self, moment: Moment, q: Motion) -> tuple[Array, Array]:
        """The pressure (Pa), twice: it is even."""
        del q
        return moment.preload, moment.preload

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """Force and torque of friction and their power."""
        del q
        force = self._friction(moment, v)
        return Action(force, dot(force, v), -dot(force, self._slip(moment, v)))

    def observe(self, moment: Moment, q: Motion, v: Motion) -> Observation:
        """Forces at one instant; in place of a brake torque the force that holds the plate back (N)."""
        del q
        force = self._friction(moment, v)
        heat, along = -jnp.asarray(dot(force, self._slip(moment, v))), force[0]
        load, none = moment.preload * self.body.area, jnp.zeros(())
        return Observation(along, load, none + 1, none, moment.preload, heat, none)

    def _slip(self, moment: Moment, v: Motion) -> Motion:
        """The motion relative to the plate's."""
        return v[0] - moment.drum_speed, v[1], v[2]

    def _motion(self, moment: Moment, v: Motion) -> tuple[Array, Array, Array]:
        """Slip velocity of the centre along X and Y, and that of the rim from the spin, Rω (m/s)."""
        zero = jnp.zeros(())
        return v[0] - moment.drum_speed + zero, v[1] + zero, self.body.radius * v[2] + zero

    def _friction(self, moment: Moment, v: Motion) -> tuple[Array, Array, Array]:
        """Force along X and Y (N) and torque (N m) on the disc."""
        if self.friction is None:
            return jnp.zeros(()), jnp.zeros(()), jnp.zeros(())
        ux, uy, rim = self._motion(moment, v)
        slid, spun = ux * ux + uy * uy, rim * rim
        moves = slid + spun > 1e-280  # m²/s²: slower than its root is standing still
        # Of the square of one of the two speeds, added to that of the other: 1e-12 of the forces at most, and where the
        # other is zero they keep their derivatives.
        mixed = 1e-12
        slid, spun = (jnp.where(moves, each, 1.0) for each in (slid + mixed * spun, spun + mixed * slid))
        sliding, spinning = jnp.sqrt(slid), jnp.sqrt(spun)
        nodes = _disc_nodes(self.body.radius, sliding, spinning, breakpoints(self.friction.law))
        pressure = jnp.broadcast_to(moment.preload, nodes.speed.shape)
        traction, other = self.friction.traction(moment, pressure, nodes.speed * nodes.cosine, nodes.speed * nodes.sine)
        assert other is not None
        # The other half of the disc takes away what is at right angles to the sliding. Tractions are at right angles
        # to their line, so that the place on it is the lever's arm.
        drag = jnp.sum(traction * nodes.weight) / sliding
        turn = jnp.sum((traction * nodes.cosine + other * nodes.sine) * nodes.place * nodes.weight) / spinning
        drag, turn = jnp.where(moves, drag, 0.0), jnp.where(moves, turn, 0.0)
        return drag * ux, drag * uy, turn * rim
