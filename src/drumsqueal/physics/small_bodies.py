"""Bodies simpler than the shoe, with known solutions, and their models: its equations, methods and events.

A block rubs on a moving belt at one point, as in most small models of friction-induced vibration: X is along the belt
and Y into it, the drum's speed of the operation is the belt's V along X (m/s), its preload the load (N) at q = 0.
Sources of these models: Leine et al., Nonlinear Dynamics 16 (1998) 41; Hoffmann et al., Journal of Sound and Vibration
257 (2002) 1.

A uniform disc lies flat on a plate, evenly loaded: it slides and spins against friction over its area, exactly. The
drum's speed is that of the plate along X (m/s), its preload the pressure (Pa). With a constant coefficient force and
torque are elliptic integrals (Farkas et al., Physical Review Letters 90 (2003) 248302).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from drumsqueal.physics.bodies.body import Motion, Scalar, dot
from drumsqueal.physics.effects.damping import Damping
from drumsqueal.physics.effects.effect import AbstractContact, Action, Effect, Observation
from drumsqueal.physics.effects.forcing import ConstantForce, Forcing
from drumsqueal.physics.effects.friction import Friction, SlipDirection, Tangential, UnitVelocity
from drumsqueal.physics.effects.operation import Constant, OperatingPoint, Operation
from drumsqueal.physics.effects.pressure import (
    Bonded,
    HardeningLining,
    LinearLining,
    NormalLaw,
    PressureLaw,
    Unilateral,
)
from drumsqueal.physics.effects.springs import Springs
from drumsqueal.physics.friction_law import FrictionLaw, as_law, breakpoints, with_breakpoints
from drumsqueal.physics.model import Model
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
    velocity_with_drum: ClassVar[Motion] = (1.0, 0.0, 0.0)
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


class DiscContact(AbstractContact):
    """F = −∫ μ(|V|) p V/|V| dA with V = u + ω e_z × r."""

    body: Disc
    law: PressureLaw
    friction: Friction | None
    units: ClassVar[tuple[str, str, str]] = "m/s", "Pa", "N/m³"

    def fastest_slip(self, moment: OperatingPoint, v: Motion) -> Array:
        """|u| + R |ω| (m/s), reached on the rim."""
        ux, uy, rim = self._motion(moment, v)
        squared = ux * ux + uy * uy
        sliding = jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1.0)), 0.0)
        return sliding + jnp.abs(rim)

    def pressure_range(self, moment: OperatingPoint, q: Motion) -> tuple[Array, Array]:
        """The pressure (Pa), twice: it is even."""
        del q
        return moment.preload, moment.preload

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Force and torque of friction and their power."""
        del q
        force = self._friction(moment, v)
        return Action(force, dot(force, v), -dot(force, self._slip(moment, v)))

    def observe(self, moment: OperatingPoint, q: Motion, v: Motion) -> Observation:
        """Forces at one instant; in place of a brake torque the force that holds the plate back (N)."""
        del q
        force = self._friction(moment, v)
        heat, along = -jnp.asarray(dot(force, self._slip(moment, v))), force[0]
        load, none = moment.preload * self.body.area, jnp.zeros(())
        return Observation(along, load, none + 1, none, moment.preload, heat, none)

    def _slip(self, moment: OperatingPoint, v: Motion) -> Motion:
        """The motion relative to the plate's."""
        return v[0] - moment.drum_speed, v[1], v[2]

    def _motion(self, moment: OperatingPoint, v: Motion) -> tuple[Array, Array, Array]:
        """Slip velocity of the centre along X and Y, and that of the rim from the spin, Rω (m/s)."""
        zero = jnp.zeros(())
        return v[0] - moment.drum_speed + zero, v[1] + zero, self.body.radius * v[2] + zero

    def _friction(self, moment: OperatingPoint, v: Motion) -> tuple[Array, Array, Array]:
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


class Block(eqx.Module):
    """Masses (n,) in kg along X and, if it can move there, along Y; both stay in the plane."""

    mass: Array = eqx.field(converter=real)
    area: ClassVar[float] = 1.0  # the load is a force
    follows: ClassVar[bool] = True

    @property
    def names(self) -> tuple[str, ...]:
        """X, or X and Y."""
        return ("X", "Y")[: self.mass.shape[-1]]

    @property
    def symmetric(self) -> tuple[bool, ...]:
        """Both."""
        return (True,) * len(self.names)

    @property
    def velocity_with_drum(self) -> Motion:
        """Velocities of a block that moves with a belt of 1 m/s."""
        return (1.0, 0.0)[: len(self.names)]

    def slides(self, *, axially: bool) -> tuple[bool, ...]:
        """Which coordinates slip: X."""
        del axially
        return (True, False)[: len(self.names)]

    def largest(self, q: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """|Y| and |X|."""
        along = np.abs(q["X"])
        return np.abs(q.get("Y", np.zeros_like(along))), along

    def surface(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Y and X of its one point."""
        both = np.eye(2)[:, None, : len(self.names)]
        return both[1], both[0]


class PointContact(AbstractContact):
    """N by the law (p0 + k y of the linear one) and F = −μ(|s|) N sgn(s), s = ẋ − V.

    All is in N, N/m and m/s: the stiffness of the law is that of a spring.
    """

    body: Block
    law: PressureLaw
    friction: Friction | None
    units: ClassVar[tuple[str, str, str]] = "m/s", "N", "N/m"

    def fastest_slip(self, moment: OperatingPoint, v: Motion) -> Array:
        """|s| (m/s)."""
        return jnp.abs(_slip(moment, v))

    def kinks(self, moment: OperatingPoint, q: Motion, v: Motion) -> Array:
        """The level (N), which vanishes where the block lifts off and lands."""
        del v
        return self._level(moment, q).reshape(1) if isinstance(self.law, Unilateral) else jnp.zeros(0)

    def pressure_range(self, moment: OperatingPoint, q: Motion) -> tuple[Array, Array]:
        """The force N (N), twice."""
        load = self.law.pressure(self._level(moment, q))
        return load, load

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Friction along X, p0 − N along Y: the load and what answers it; and their power beyond the stored energy."""
        load, drag = self._forces(moment, q, v)
        power = drag * v[0]
        if moment.preload_rate is not None:
            by_preload = self.law.stored_by_preload(moment.preload, _depth(q) + jnp.zeros(()))
            power = power + moment.preload_rate * (by_preload - _depth(q))
        return Action((drag, moment.preload - load)[: len(q)], power, -drag * _slip(moment, v))

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Array:
        """U of the contact spring from q = 0 on, less p0 y (J)."""
        return self.law.stored(moment.preload, _depth(q) + jnp.zeros(())) - moment.preload * _depth(q)

    def observe(self, moment: OperatingPoint, q: Motion, v: Motion) -> Observation:
        """Forces at one instant; in place of a brake torque the force that holds the belt back (N)."""
        load, drag = self._forces(moment, q, v)
        slip, touches = _slip(moment, v), self.law.touches(self._level(moment, q))
        reversed_slip = touches & (slip * jnp.sign(moment.drum_speed) > 0)
        fraction, back = (jnp.where(each, 1.0, 0.0) for each in (touches, reversed_slip))
        return Observation(drag, load, fraction, back, load, -drag * slip, jnp.zeros(()))

    def _level(self, moment: OperatingPoint, q: Motion) -> Array:
        return self.law.level(moment.preload) + self.law.stiffness * _depth(q)

    def _forces(self, moment: OperatingPoint, q: Motion, v: Motion) -> tuple[Array, Array]:
        """N and F (N)."""
        load = self.law.pressure(self._level(moment, q))
        if self.friction is None:
            return load, jnp.zeros(())
        return load, self.friction.traction(moment, load, _slip(moment, v), None)[0]


def _slip(moment: OperatingPoint, v: Motion) -> Array:
    """s = ẋ − V (m/s)."""
    return v[0] - moment.drum_speed


def _depth(q: Motion) -> Scalar:
    """y (m), how far the block has moved into the belt."""
    return q[1] if len(q) > 1 else 0.0


Law = FrictionLaw | Callable[[Array], Array]
"""A friction law, or μ as a function of the slip speed (m/s)."""
Forces = Mapping[str, ArrayLike | tuple[ArrayLike, ...]]
"""Forces by coordinate: a constant one F in N (N m), or a harmonic one A sin(2πft + ψ) as (A, f) or (A, f, ψ).

A in N (N m), f in Hz, ψ in rad.
"""


def block_on_belt(
    law: Law,
    *,
    mass: ArrayLike = 1.0,
    stiffness: ArrayLike = 1.0,
    damping: ArrayLike = 0.0,
    load: ArrayLike = 1.0,
    belt_speed: ArrayLike = 0.0,
    forces: Forces | None = None,
    direction: SlipDirection | None = None,
) -> Model:
    """m ẍ + c ẋ + k x = −μ(|s|) N sgn(s) + F, s = ẋ − V: mass in kg, k in N/m, c in N s/m, load N in N, V in m/s.

    Forces F by coordinate, here X alone: `{"X": 0.2}` is constant (N), `{"X": (0.2, 1.5)}` harmonic with 1.5 Hz. Raises
    ValueError for a force on another coordinate.

    ```pycon
    >>> law = drumsqueal.ExponentialLaw(0.5, 0.3, 2.0)
    >>> block = drumsqueal.block_on_belt(law, belt_speed=1.0, damping=0.1)
    >>> mode, = drumsqueal.analyse_stability(block).modes
    >>> round(2 * mode.growth_rate, 6)  # −(c + N dμ/ds)/m = 0.4 exp(−2) − 0.1
    -0.045866
    ```
    """
    spring, dashpot = real(stiffness).reshape(1, 1), real(damping).reshape(1, 1)
    block = Block(real(mass).reshape(1))
    others = (Springs(spring), Damping(dashpot), *_pushing(block.names, forces))
    contact = PointContact(block, Bonded(0.0), Friction(as_law(law), Tangential() if direction is None else direction))
    operation = Operation(Constant(belt_speed), Constant(load))
    return Model(operation, contact, others, block.mass, spring)


def sprung_block_on_belt(
    law: Law,
    *,
    mass: ArrayLike | Sequence[float],
    springs: ArrayLike | Sequence[Sequence[float]],
    contact_stiffness: ArrayLike,
    contact_hardening: ArrayLike | None = None,
    load: ArrayLike = 1.0,
    belt_speed: ArrayLike = 1.0,
    damping: ArrayLike | Sequence[Sequence[float]] | None = None,
    forces: Forces | None = None,
    separation: bool = True,
) -> Model:
    """A block that also moves into the belt, N = max(0, p0 + k3 y), by which friction follows its normal motion.

    `mass` (2,) in kg, `springs` (2, 2) in N/m and `damping` (2, 2) in N s/m belong to X and Y, as `forces` by name do;
    the contact spring k3 (N/m) comes on top. Without `separation` the block cannot lift off: N = p0 + k3 y, which pulls
    where it is negative. With a `contact_hardening` h (N/m²) the spring's force over its compression u is k3 u + h u².
    Source: Hoffmann et al., Journal of Sound and Vibration 257 (2002) 1, who linearise.

    ```pycon
    >>> def growth(friction):  # two modes of 2 rad²/s² couple beyond μ = 0.5, the ratio of k12 to k3
    ...     law, springs = drumsqueal.ConstantLaw(friction), [[2.0, 0.5], [0.5, 1.0]]
    ...     block = drumsqueal.sprung_block_on_belt(law, mass=[1.0, 1.0], springs=springs, contact_stiffness=1.0)
    ...     return max(mode.growth_rate for mode in drumsqueal.analyse_stability(block).modes)
    >>> abs(growth(0.4)) < 1e-12, round(growth(0.6), 4)
    (True, 0.0789)
    ```
    """
    block = Block(real(mass))
    normal: NormalLaw = LinearLining(contact_stiffness)
    if contact_hardening is not None:
        normal = HardeningLining(contact_stiffness, contact_hardening)
    pressure = (Unilateral if separation else Bonded)(normal)
    contact = PointContact(block, pressure, Friction(as_law(law), Tangential()))
    operation = Operation(Constant(belt_speed), Constant(load))
    stiffness = real(springs) + jnp.diag(jnp.stack([jnp.zeros(()), normal.tangent(real(load))]))
    dashpots = () if damping is None else (Damping(real(damping)),)
    others = (Springs(real(springs)), *dashpots, *_pushing(block.names, forces))
    return Model(operation, contact, others, block.mass, stiffness)


def disc_on_plate(
    law: Law,
    *,
    radius: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
    load: ArrayLike = 1.0,
    plate_speed: ArrayLike = 0.0,
    forces: Forces | None = None,
) -> Model:
    """A uniform disc under an even load (N), on a plate that moves along X (m/s); radius in m, mass in kg.

    Nothing else acts on it but `forces` by coordinate (N, N m). Source: Farkas et al., Physical Review Letters 90
    (2003) 248302.

    ```pycon
    >>> disc = drumsqueal.disc_on_plate(drumsqueal.ConstantLaw(0.3))
    >>> motion = drumsqueal.integrate(disc, {"velocity": {"X": 0.3, "Tz": 0.4}}, 2.0, sample_rate=100.0)
    >>> [(round(time, 4), sticks) for time, sticks in motion.changes]  # sliding and spinning end together
    [(1.5126, True)]
    ```
    """
    disc = Disc(radius, mass)
    contact = DiscContact(disc, Bonded(0.0), Friction(with_breakpoints(as_law(law)), UnitVelocity()))
    operation = Operation(Constant(plate_speed), Constant(load / disc.area))
    return Model(operation, contact, _pushing(disc.names, forces), disc.mass, jnp.zeros((3, 3)))


def _pushing(names: Sequence[str], forces: Forces | None) -> tuple[Effect, ...]:
    """The effects of forces by coordinate. Raises ValueError for what is no coordinate and no force."""
    effects: list[Effect] = []
    for name, force in (forces or {}).items():
        if name not in names:
            raise ValueError(f"forces: {name!r} is no coordinate of this body; it has {', '.join(names)}")
        place = names.index(name)
        if not isinstance(force, tuple):
            effects.append(ConstantForce(jnp.zeros(len(names)).at[place].set(force)))
        elif len(force) in (2, 3):
            amplitude, frequency, phase = (*force, 0.0)[:3]
            effects.append(Forcing(real(amplitude).reshape(1), frequency, phase, (place,)))
        else:
            raise ValueError(
                f"forces: {name} must be a number (N) or (amplitude in N, frequency in Hz, phase in rad), got {force}"
            )
    return tuple(effects)
