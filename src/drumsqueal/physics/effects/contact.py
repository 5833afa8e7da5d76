"""Distributed contact between lining and drum: pressure, and the friction that rides on it.

Source: Seo & Kang 2023, equations (8) to (14) and (20); separation and the exact contact boundaries are ours.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.body import Motion
from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.effects.effect import AbstractContact, Action, Observation
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.physics.effects.pressure import PressureLaw
from drumsqueal.physics.friction_law import breakpoints, kinks
from drumsqueal.physics.quadrature.arc import NODES_LONG_ARC, ArcSurface
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.physics.quadrature.surface import Boundaries, Densities, Level, Nodes, Surface


class Levels(NamedTuple):
    """Levels whose roots are the boundaries: of the normal law (Pa), V_θ and V_z (m/s; None where not needed)."""

    pressure: Level
    slip: Level | None
    axial: Level | None


class ContactField(NamedTuple):
    """Contact at the nodes: level of the normal law and pressure N (Pa), slip V_θ, V_z (m/s), tractions (Pa)."""

    nodes: Nodes
    level: Array
    pressure: Array
    slip: Array | None
    axial: Array | None
    along: Array | None
    across: Array | None


class Contact(AbstractContact):
    """Pressure and friction over the lining, integrated exactly between its contact boundaries."""

    body: RigidShoe
    law: PressureLaw
    friction: Friction | None
    surface: Surface

    @property
    def radius(self) -> Array:
        """R (m): the drum's speed times it is that of its surface."""
        return self.body.outer_radius

    @property
    def _knows_axial(self) -> bool:
        return self.friction is not None and self.friction.direction.knows_axial

    @property
    def cell_axes(self) -> int:
        """Along how many axes the lining is cut into cells."""
        return self.surface.axes if isinstance(self.surface, Cells) else 0

    def fastest_slip(self, moment: OperatingPoint, v: Motion) -> Array:
        """A bound on the slip speed (m/s): the sum of those of V_θ and V_z."""
        levels = [self.body.along(v, moment.drum_speed), *([self.body.axial(v)] if self._knows_axial else [])]
        return sum((self.body.bound(level) for level in levels), start=jnp.zeros(()))

    def in_plane(self) -> "Contact":
        """The same contact for steady sliding, which is the same on every line across, so that one line serves."""
        if isinstance(self.body, ElasticShoe):  # whose lines differ; nothing slips backwards
            body = self.body.in_plane()
            return dataclasses.replace(self, body=body, surface=dataclasses.replace(body.cells, slips=False))
        return dataclasses.replace(self, surface=ArcSurface(NODES_LONG_ARC, compact=True))

    def on_cells(self, along: float, across: float, more: int = 0) -> "Contact":
        """The same contact of a bending shoe with so many times the cells, and `more` nodes along each side of one."""
        assert isinstance(self.surface, Cells)
        assert isinstance(self.body, ElasticShoe)
        cells = self.surface.finer(along, across, more)
        return dataclasses.replace(self, body=self.body.on_cells(cells), surface=cells)

    def levels(self, moment: OperatingPoint, q: Motion, v: Motion) -> Levels:
        """The levels at the present state."""
        level = self._pressure_level(moment, q)
        if self.friction is None:
            return Levels(level, None, None)
        axial = self.body.axial(v) if self.surface.spatial and self._knows_axial else None
        return Levels(level, self.body.along(v, moment.drum_speed), axial)

    def _integrated(
        self, levels: Levels, densities: Callable[[Levels, Any], Any], *, lifted: bool, rarely: bool = False
    ) -> Densities:
        """The integrals of densities over the lining, or over what presses, exact between its contact boundaries."""
        law = None if self.friction is None or levels.slip is None else self.friction.law
        cuts = (jnp.zeros(0), jnp.zeros(0)) if law is None else (breakpoints(law), kinks(law))
        pressed, knots = self.law.boundaries(levels.pressure), self.law.knots(levels.pressure)
        boundaries = Boundaries(pressed, levels.slip, levels.axial, *cuts, lifted, rarely, knots)
        if isinstance(self.surface, Cells) and self.surface.slopes:
            return self.surface.forces(self.body, boundaries, levels, densities)
        return self.surface.integrate(self.body, boundaries, partial(densities, levels))

    def _field(self, moment: OperatingPoint, levels: Levels, nodes: Nodes) -> ContactField:
        """Evaluate the contact at quadrature nodes."""
        level, slip, axial = levels
        value = level.at(nodes)
        pressure = self.law.pressure(value)
        if self.friction is None or slip is None:
            return ContactField(nodes, value, pressure, None, None, None, None)
        tangential = slip.at(nodes)
        lateral = None if axial is None else axial.at(nodes)
        along, across = self.friction.traction(moment, pressure, tangential, lateral)
        return ContactField(nodes, value, pressure, tangential, lateral, along, across)

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Q_i = ∫(−N φ_i^r + F_θ φ_i^θ + F_z φ_i^z) dA, equation (20), and the power beyond the stored energy."""
        left, kept = None, moment
        if self.cell_axes:  # where friction is apart from pressure: one product, not one at each node
            left, kept = moment.friction_left, moment._replace(friction_left=None)

        def densities(levels: Levels, nodes: Nodes) -> Densities:
            field = self._field(kept, levels, nodes)
            drag, lateral = (None if each is None else each * nodes.weight for each in (field.along, field.across))
            forces = self.body.tractions(nodes, field.pressure * nodes.weight, drag, lateral)
            found = {**forces, **self._drag_densities(field)}
            if moment.preload_rate is not None:
                radial = self.body.radial(q).at(nodes)
                found["by preload"] = self.law.stored_by_preload(moment.preload, radial) * nodes.weight
            return found

        total = self._integrated(self.levels(moment, q, v), densities, lifted=moment.preload_rate is not None)
        if left is not None:
            total |= {name: left * total[name] for name in ("along", "axial", "drag", "heat") if name in total}
        power = jnp.zeros(())
        if "drag" in total:
            power = self.body.outer_radius * total["drag"] * moment.drum_speed - total["heat"]
        if moment.preload_rate is not None:
            power = power + moment.preload_rate * total["by preload"]
        return Action(self.body.resultant(total), power, total.get("heat", 0.0))

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Array:
        """U = ∫∫ p du dA from the reference on: its force is −∫ N φ^r dA (J)."""
        levels = Levels(self._pressure_level(moment, q), None, None)

        def densities(_: Levels, nodes: Nodes) -> Densities:
            return {"energy": self.law.stored(moment.preload, self.body.radial(q).at(nodes)) * nodes.weight}

        return self._integrated(levels, densities, lifted=True)["energy"]

    def observe(self, moment: OperatingPoint, q: Motion, v: Motion) -> Observation:
        """Integrals and extremes that describe the contact at one instant."""
        levels = self.levels(moment, q, v)
        smallest = self.law.pressure(self._pressure_range(moment, q)[0])

        def densities(levels: Levels, nodes: Nodes) -> Densities:
            field, weight = self._field(moment, levels, nodes), nodes.weight
            touching = self.law.touches(field.level)
            found = {"normal": field.pressure * weight, "touching": jnp.where(touching, weight, 0.0)}
            if field.slip is not None:
                forward = touching & (field.slip * jnp.sign(moment.drum_speed) > 0)
                found |= {"reversed": jnp.where(forward, weight, 0.0), **self._drag_densities(field)}
            return found

        total = self._integrated(levels, densities, lifted=False, rarely=True)
        zero, area = jnp.zeros(()), self.body.area
        return Observation(
            brake_torque=self.body.outer_radius * total.get("drag", zero),
            normal_force=total["normal"],
            contact_fraction=total["touching"] / area,
            slip_reversed_fraction=total.get("reversed", zero) / area,
            smallest_pressure=smallest,
            friction_power=total.get("heat", zero),
            sticking=zero,
        )

    def pressure_range(self, moment: OperatingPoint, q: Motion) -> tuple[Array, Array]:
        """Smallest and largest pressure on the lining (Pa)."""
        low, high = self._pressure_range(moment, q)
        return self.law.pressure(low), self.law.pressure(high)

    def along_arc(self, moment: OperatingPoint, q: Any, v: Any, theta: Any, z: Any = None) -> tuple[Array, Array]:
        """Pressure N (Pa) and slip velocity V_θ (m/s) at angles θ (rad) of a line z (m), or of the middle line."""
        line = 0.0 if z is None else z
        states = (dict(zip(self.body.names, each, strict=True)) for each in (q, v))
        radial, along = (self.body.over_drum(state, theta, line)[k] for k, state in enumerate(states))
        pressure = self.law.pressure(self.law.level(moment.preload) + self.law.stiffness * radial)
        return pressure, along - self.body.outer_radius * moment.drum_speed

    def _pressure_level(self, moment: OperatingPoint, q: Motion) -> Level:
        """That of the normal law, p0 + k_c u_r of the linear one."""
        return self.body.radial(q).scaled(self.law.stiffness, self.law.level(moment.preload))

    def _drag_densities(self, field: ContactField) -> Densities:
        """Drag of friction F_θ (N) and its heat −F·V (W) at the nodes; nothing without friction."""
        if field.along is None or field.slip is None:
            return {}
        heat = field.along * field.slip
        if field.across is not None and field.axial is not None:
            heat = heat + field.across * field.axial
        return {"drag": field.along * field.nodes.weight, "heat": -heat * field.nodes.weight}

    def kinks(self, moment: OperatingPoint, q: Motion, v: Motion) -> Array:
        """Levels at the ends of the arc, and their extremes on it: a boundary comes or goes where one is zero.

        With the direction of slip free on the lining, friction has no kink where its part along θ reverses.
        """
        levels = self.levels(moment, q, v)
        slip = None if levels.axial is not None else levels.slip
        found = [level for level in (self.law.boundaries(levels.pressure), slip) if isinstance(level, Level)]
        across = self.surface.spatial
        ends = (jnp.stack(jnp.broadcast_arrays(*self.body.ends_and_extremes(each, spatial=across))) for each in found)
        return jnp.concatenate([jnp.zeros(0), *(each.ravel() for each in ends)])

    def _pressure_range(self, moment: OperatingPoint, q: Motion) -> tuple[Array, Array]:
        """Extremes of that over the lining."""
        level = self._pressure_level(moment, q)
        *_, low, high = self.body.ends_and_extremes(level, spatial=self.surface.spatial)
        return jnp.min(low), jnp.max(high)
