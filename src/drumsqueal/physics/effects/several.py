"""What acts on several shoes: the effects on each over its own coordinates, and the contacts of all of them."""

import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from drumsqueal.physics.bodies.body import Motion, Scalar
from drumsqueal.physics.bodies.brake import Brake, Share
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.effect import BY_SHOE, AbstractContact, Action, Effect, Observation
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.physics.effects.pressure import PressureLaw


class OnOne(Effect):
    """An effect on one of several shoes."""

    effect: Effect
    share: Share

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Its force on the brake."""
        action = self.effect.act(moment.of_shoe(self.share.number), self.share.taken(q), self.share.taken(v))
        return action._replace(force=self.share.given(action.force))

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Scalar:
        """Its energy (J)."""
        return self.effect.potential_energy(moment.of_shoe(self.share.number), self.share.taken(q))


class Contacts(AbstractContact):
    """The contacts of several shoes with one drum.

    Those of shoes that are built alike are one tree whose leaves have one more axis, so that one program serves them in
    turn: `groups`, and which shoes are in each.
    """

    groups: tuple[Contact, ...]
    members: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    shares: tuple[Share, ...]
    names: tuple[str, ...] = eqx.field(static=True)

    @classmethod
    def of(cls, contacts: list[Contact], shares: tuple[Share, ...], names: tuple[str, ...]) -> "Contacts":
        """Put contacts that are built alike together."""
        kinds: list[list[int]] = []
        for k, contact in enumerate(contacts):
            same = next((kind for kind in kinds if _alike(contacts[kind[0]], contact)), None)
            if same is None:
                kinds.append([k])
            else:
                same.append(k)
        groups = tuple(jax.tree.map(lambda *leaves: jnp.stack(leaves), *[contacts[k] for k in kind]) for kind in kinds)
        return cls(groups, tuple(map(tuple, kinds)), shares, names)  # pyright: ignore[reportCallIssue]

    @property
    def each(self) -> list[Contact]:
        """The contact of each shoe, over its own coordinates and the drum's."""
        found = {}
        for group, members in zip(self.groups, self.members, strict=True):
            found |= {k: jax.tree.map(lambda leaf, j=j: _part(leaf, j), group) for j, k in enumerate(members)}
        return [found[k] for k in range(len(self.shares))]

    @property
    def cell_axes(self) -> int:
        """Along how many axes a lining is cut into cells, at most."""
        return max(group.cell_axes for group in self.groups)

    @property
    def body(self) -> Brake:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The shoes and the drum."""
        shoes: list[Any] = [contact.body for contact in self.each]
        return Brake(self.names, self.shares, tuple(shoes))

    @property
    def law(self) -> PressureLaw:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Raises TypeError: each shoe has its own, `laws`."""
        raise TypeError("several shoes have a law each; ask for laws")

    @property
    def laws(self) -> tuple[PressureLaw, ...]:
        """That of every shoe."""
        return tuple(contact.law for contact in self.each)

    @property
    def friction(self) -> Friction | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """That of the first shoe which rubs: whether there is any, and its direction; None where none rubs."""
        return next((contact.friction for contact in self.each if contact.friction is not None), None)

    @property
    def radius(self) -> Scalar:
        """R (m)."""
        return _part(self.groups[0].body.outer_radius, 0)

    def with_friction(self, friction: Friction | None) -> "Contacts":
        """The same contacts with other friction."""
        return self.mapped(lambda contact: contact.with_friction(friction))

    def mapped(self, change: Callable[[Contact], Contact]) -> "Contacts":
        """The same with each contact changed."""
        return Contacts.of([change(contact) for contact in self.each], self.shares, self.names)

    @property
    def slides(self) -> tuple[bool, ...]:
        """Which coordinates have a slip velocity on a lining whose friction knows of it."""
        found = np.zeros(len(self.names), dtype=bool)
        for mine, contact in zip(self.shares, self.each, strict=True):
            if contact.friction is not None:
                found[np.array(mine.places)] |= contact.slides
        return tuple(found.tolist())

    def _by_shoe(self, find: Callable[..., Any], moment: OperatingPoint, *motions: Motion) -> list[Any]:
        """What a method of a contact finds for each shoe."""
        found: dict[int, Any] = {}
        for group, members in zip(self.groups, self.members, strict=True):
            own = [(moment.of_shoe(k), *(self.shares[k].taken(motion) for motion in motions)) for k in members]
            moments, *moved = jax.tree.map(lambda *leaves: jnp.stack([*map(jnp.asarray, leaves)]), *own)
            results = jax.lax.map(lambda each: find(each[0], *each[1:]), (group, moments, *moved))
            found |= {k: jax.tree.map(lambda leaf, j=j: leaf[j], results) for j, k in enumerate(members)}
        return [found[k] for k in range(len(self.shares))]

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """The forces of all contacts on the shoes, and the opposite ones on the drum."""
        actions = self._by_shoe(lambda contact, *at: _whole(contact.act(*at)), moment, q, v)
        force = sum((mine.given(each.force) for mine, each in zip(self.shares, actions, strict=True)))
        return Action(force, sum(each.power for each in actions), sum(each.heat for each in actions))  # pyright: ignore

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Scalar:
        """U of all (J)."""
        return sum(self._by_shoe(Contact.potential_energy, moment, q))

    def observe(self, moment: OperatingPoint, q: Motion, v: Motion) -> Observation:
        """All contacts taken together: fractions are of the area of all linings, the smallest pressure is on any."""
        found: list[Observation] = self._by_shoe(Contact.observe, moment, q, v)
        areas = [contact.body.area for contact in self.each]
        own = tuple(getattr(each, name) for each in found for name in BY_SHOE)
        total = jax.tree.map(lambda *parts: functools.reduce(jnp.add, parts), *found)
        fractions = {
            name: sum(area * getattr(each, name) for area, each in zip(areas, found, strict=True)) / sum(areas)
            for name in ("contact_fraction", "slip_reversed_fraction")
        }
        smallest = functools.reduce(jnp.minimum, (each.smallest_pressure for each in found))
        return total._replace(**fractions, smallest_pressure=smallest, by_shoe=own)

    def fastest_slip(self, moment: OperatingPoint, v: Motion) -> Array:
        """The largest bound of all that rub; of all where none does."""
        found = self._by_shoe(Contact.fastest_slip, moment, v)
        rubs = [each for each, contact in zip(found, self.each, strict=True) if contact.friction is not None]
        return functools.reduce(jnp.maximum, rubs or found)

    def kinks(self, moment: OperatingPoint, q: Motion, v: Motion) -> Array:
        """Those of all contacts."""
        return jnp.concatenate(self._by_shoe(Contact.kinks, moment, q, v))

    def pressure_range(self, moment: OperatingPoint, q: Motion) -> tuple[Array, Array]:
        """Smallest and largest pressure on any lining (Pa)."""
        low, high = zip(*self._by_shoe(Contact.pressure_range, moment, q), strict=True)
        return functools.reduce(jnp.minimum, low), functools.reduce(jnp.maximum, high)


def _alike(first: Contact, second: Contact) -> bool:
    """Whether the same program serves both."""
    shapes = [[jnp.shape(leaf) for leaf in jax.tree.leaves(each)] for each in (first, second)]
    return jax.tree.structure(first) == jax.tree.structure(second) and shapes[0] == shapes[1]


def _part(leaf: Any, place: int) -> Any:
    # Not by JAX outside of programs, where it would compile one for each shape.
    return leaf[place] if isinstance(leaf, Tracer) else np.asarray(leaf)[place]


def _whole(action: Action) -> Action:
    return jax.tree.map(jnp.asarray, action)
