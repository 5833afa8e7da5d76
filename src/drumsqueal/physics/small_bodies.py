"""Models of bodies simpler than the shoe, with known solutions: its equations, methods and events."""

from collections.abc import Callable, Mapping, Sequence

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.block import Block, PointContact
from drumsqueal.physics.disc import Disc, DiscContact
from drumsqueal.physics.effects.damping import Damping
from drumsqueal.physics.effects.effect import Effect
from drumsqueal.physics.effects.forcing import ConstantForce, Forcing
from drumsqueal.physics.effects.friction import Friction, SlipDirection, Tangential, UnitVelocity
from drumsqueal.physics.effects.operation import Constant, Operation
from drumsqueal.physics.effects.pressure import Bonded, Hardening, Linear, Unilateral
from drumsqueal.physics.effects.springs import Springs
from drumsqueal.physics.laws.custom_friction import as_law, with_breakpoints
from drumsqueal.physics.laws.friction_law import FrictionLaw
from drumsqueal.physics.model import Model
from drumsqueal.precision import real

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
    normal = Linear(contact_stiffness) if contact_hardening is None else Hardening(contact_stiffness, contact_hardening)
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
