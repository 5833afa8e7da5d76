"""Models of bodies simpler than the shoe, with known solutions: its equations, methods and events."""

import jax.numpy as jnp
from jax.typing import ArrayLike

from drumsqueal.physics.bodies.block import Block
from drumsqueal.physics.bodies.disc import Disc
from drumsqueal.physics.effects.damping import Damping
from drumsqueal.physics.effects.disc_contact import DiscContact
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.friction_direction import Direction, Tangential, UnitVelocity
from drumsqueal.physics.effects.operation import Operation
from drumsqueal.physics.effects.point_contact import PointContact
from drumsqueal.physics.effects.pressure import Bonded
from drumsqueal.physics.effects.schedule import Constant
from drumsqueal.physics.effects.springs import Springs
from drumsqueal.physics.laws.custom_friction import as_law, with_breakpoints
from drumsqueal.physics.laws.friction_law import FrictionLaw
from drumsqueal.physics.model import Model
from drumsqueal.precision import real


def block_on_belt(
    law: FrictionLaw,
    *,
    mass: ArrayLike = 1.0,
    stiffness: ArrayLike = 1.0,
    damping: ArrayLike = 0.0,
    load: ArrayLike = 1.0,
    belt_speed: ArrayLike = 0.0,
    direction: Direction | None = None,
) -> Model:
    """m ẍ + c ẋ + k x = −μ(|s|) N sgn(s), s = ẋ − V: mass in kg, k in N/m, c in N s/m, load N in N, V in m/s."""
    spring, dashpot = real(stiffness).reshape(1, 1), real(damping).reshape(1, 1)
    others = (Springs(spring), Damping(dashpot))
    block = Block(real(mass).reshape(1))
    contact = PointContact(block, Bonded(0.0), Friction(as_law(law), Tangential() if direction is None else direction))
    operation = Operation(Constant(belt_speed), Constant(load))
    return Model(operation, contact, others, block.mass, spring)


def sprung_block_on_belt(
    law: FrictionLaw,
    *,
    mass: ArrayLike,
    springs: ArrayLike,
    contact_stiffness: ArrayLike,
    load: ArrayLike = 1.0,
    belt_speed: ArrayLike = 1.0,
) -> Model:
    """A block that also moves into the belt, N = p0 + k3 y, by which friction follows its normal motion.

    `mass` (2,) in kg and `springs` (2, 2) in N/m belong to x and y; the contact spring k3 (N/m) comes on top. Source:
    Hoffmann et al., Journal of Sound and Vibration 257 (2002) 1.
    """
    block = Block(mass)
    contact = PointContact(block, Bonded(contact_stiffness), Friction(as_law(law), Tangential()))
    operation = Operation(Constant(belt_speed), Constant(load))
    stiffness = real(springs) + jnp.diag(jnp.stack([jnp.zeros(()), real(contact_stiffness)]))
    return Model(operation, contact, (Springs(springs),), block.mass, stiffness)


def disc_on_plate(
    law: FrictionLaw,
    *,
    radius: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
    load: ArrayLike = 1.0,
    plate_speed: ArrayLike = 0.0,
) -> Model:
    """A uniform disc under an even load (N), on a plate that moves along X (m/s); radius in m, mass in kg.

    Source: Farkas et al., Physical Review Letters 90 (2003) 248302.
    """
    disc = Disc(radius, mass)
    contact = DiscContact(disc, Friction(with_breakpoints(as_law(law)), UnitVelocity()))
    operation = Operation(Constant(plate_speed), Constant(load / disc.area))
    return Model(operation, contact, (), disc.mass, jnp.zeros((3, 3)))
