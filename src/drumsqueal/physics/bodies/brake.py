"""Several shoes on one drum that bends: the coordinates of each, then those of the drum, which all of them have."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.coordinates import is_of_drum
from drumsqueal.physics.bodies.body import Motion, cartesian, scalars, whole
from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe

Each = TypeVar("Each")


class Share(eqx.Module):
    """Which coordinates of a brake are those of one shoe and of the drum under it, in the order of that shoe's own.

    `prefix` is what their names begin with in the brake, and `number` counts shoes from 0.
    """

    prefix: str = eqx.field(static=True)
    places: tuple[int, ...] = eqx.field(static=True)
    count: int = eqx.field(static=True)
    number: int = eqx.field(static=True)

    @property
    def name(self) -> str:
        """Name of the shoe."""
        return self.prefix.removesuffix(".")

    @property
    def of_states(self) -> list[int]:
        """The places of that shoe's own displacements and velocities among those of the brake, one after the other."""
        return [*self.places, *(self.count + place for place in self.places)]

    def taken(self, motion: Motion) -> Motion:
        """A motion of the brake as that shoe has it."""
        return scalars(whole(motion)[np.array(self.places)])

    def given(self, force: Motion) -> Array:
        """A generalised force on that shoe as one on the brake, (n,): zero elsewhere."""
        back = np.full(self.count, len(self.places))
        back[np.array(self.places)] = np.arange(len(self.places))
        return jnp.append(whole(force), 0.0)[back]

    def spread(self, matrix: Array, sides: int = 2) -> Array:
        """A matrix over that shoe's coordinates as one over the brake's, along the last one or two of its sides."""
        places, (*rows, _) = np.array(self.places), matrix.shape
        wide = jnp.zeros((*rows, self.count)).at[..., places].set(matrix)
        return wide if sides == 1 else jnp.zeros((self.count, self.count)).at[places].set(wide)

    def own(self, by_name: Mapping[str, Any]) -> dict[str, Any]:
        """What is known by the names of coordinates in the brake, by their names of that shoe's own."""
        mine = (name for name in by_name if is_of_drum(name) or name.startswith(self.prefix))
        return {name.removeprefix(self.prefix): by_name[name] for name in mine}


def share(prefixes: Sequence[str], names: Sequence[tuple[str, ...]]) -> tuple[tuple[str, ...], tuple[Share, ...]]:
    """Names of a brake's coordinates, of those of each shoe and the drum's, and which are whose."""
    own = [[name for name in each if not is_of_drum(name)] for each in names]
    drum = [name for name in names[0] if is_of_drum(name)]
    joint = [f"{prefix}{name}" for prefix, each in zip(prefixes, own, strict=True) for name in each] + drum
    place = {name: k for k, name in enumerate(joint)}
    shares = (
        Share(prefix, (*(place[f"{prefix}{name}"] for name in each), *(place[name] for name in drum)), len(joint), k)
        for k, (prefix, each) in enumerate(zip(prefixes, own, strict=True))
    )
    return tuple(joint), tuple(shares)


def whole_share(count: int) -> Share:
    """That of a shoe that is all there is."""
    return Share("", tuple(range(count)), count, 0)


class Brake(eqx.Module):
    """Shoes on one elastic drum, each over its own coordinates and the drum's; `shares` say which those are."""

    names: tuple[str, ...] = eqx.field(static=True)
    shares: tuple[Share, ...]
    shoes: tuple[ElasticShoe, ...]

    def _each(self, find: Callable[[ElasticShoe], Each]) -> list[tuple[Share, Each]]:
        return [(mine, find(shoe)) for mine, shoe in zip(self.shares, self.shoes, strict=True)]

    @property
    def mass(self) -> Array:
        """Diagonal of the mass matrix (n,), in kg and kg m², and 1 for each mode."""
        found = jnp.ones(len(self.names))
        for mine, mass in self._each(lambda shoe: shoe.mass):
            found = found.at[np.array(mine.places)].set(mass)
        return found

    @property
    def symmetric(self) -> tuple[bool, ...]:
        """No coordinate: the drum's back plate is on one side."""
        return (False,) * len(self.names)

    @property
    def outer_radius(self) -> Array:
        """R (m) of the drum's surface."""
        return self.shoes[0].outer_radius

    @property
    def area(self) -> Array:
        """Of all linings (m²)."""
        return jnp.sum(jnp.stack([shoe.area for shoe in self.shoes]))

    @property
    def velocity_with_drum(self) -> Motion:
        """Velocities of shoes that turn with a drum of 1 rad/s."""
        turning = (mine.given(following) for mine, following in self._each(lambda shoe: shoe.velocity_with_drum))
        return scalars(sum(turning, start=jnp.zeros(len(self.names))))

    @property
    def follows(self) -> bool:
        """Never taken to be so: one shoe may stick while another slips."""
        return False

    def characteristic_lengths(self) -> dict[str, float]:
        """How far 1 of each coordinate moves a lining (m)."""
        found: dict[str, float] = {}
        for mine, reach in self._each(lambda shoe: shoe.characteristic_lengths()):
            for own, far in reach.items():
                name = own if is_of_drum(own) else f"{mine.prefix}{own}"
                found[name] = max(far, found.get(name, 0.0))
        return found


class Placed(NamedTuple):
    """A shoe where it is on the drum: which coordinates are its own, and the angle (rad) of its lining's middle."""

    share: Share
    shoe: RigidShoe
    position: float

    @property
    def name(self) -> str:
        """Of the shoe, "" where there is one."""
        return self.share.name

    def displaced(self, q: Mapping[str, Any], x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
        """(u_x, u_y, u_z) of its points (m), both along the axes of the brake, of the brake's coordinates by name."""
        x, y = turned(x, y, -self.position)
        along_x, along_y, along_z = self.shoe.displaced(self.share.own(q), x, y, z)
        return *turned(along_x, along_y, self.position), along_z

    def of_drum(self, q: Mapping[str, Any], angle: Any, z: Any) -> tuple[Any, Any, Any]:
        """(u_x, u_y, u_z) of the drum's surface at angles (rad) and z (m), along the axes of the brake."""
        return cartesian(self.shoe.of_drum(self.share.own(q), angle - self.position, z), angle)


def turned(x: Any, y: Any, angle: float) -> tuple[Any, Any]:
    """A vector turned by an angle (rad)."""
    if angle == 0:
        return x, y
    return np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y


def placed(body: Any) -> tuple[Placed, ...]:
    """The shoes of a body, of which there may be one."""
    if not isinstance(body, Brake):
        return (Placed(whole_share(len(body.names)), body, 0.0),)
    return tuple(Placed(mine, shoe, float(shoe.position)) for mine, shoe in zip(body.shares, body.shoes, strict=True))
