"""Distributed contact between lining and drum: pressure, and the friction that rides on it.

Source: Seo & Kang 2023, equations (8) to (14) and (20); separation and the exact edges are ours.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.rigid_shoe import TX, TY, TZ, RigidShoe, X, Y, Z
from drumsqueal.physics.effects.action import Action, Six
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.physics.effects.pressure import PressureLaw, yielding
from drumsqueal.physics.effects.touching import Observation
from drumsqueal.physics.laws.friction_law import breakpoints, kinks
from drumsqueal.physics.quadrature.levels import Level
from drumsqueal.physics.quadrature.sums import Densities
from drumsqueal.physics.quadrature.surface import Edges, Nodes, Surface


class Levels(NamedTuple):
    """What makes the edges: p0 + k_c u_r (Pa), V_θ and V_z (m/s; None where they are not called for)."""

    pressure: Level
    slip: Level | None
    axial: Level | None


class ContactField(NamedTuple):
    """Contact at the nodes: pressure level p0 + k_c u_r and pressure N (Pa), slip V_θ, V_z (m/s), tractions (Pa)."""

    nodes: Nodes
    level: Array
    pressure: Array
    slip: Array | None
    axial: Array | None
    along: Array | None
    across: Array | None


class Contact(eqx.Module):
    """Pressure and friction over the lining, integrated exactly between its edges."""

    shoe: RigidShoe
    law: PressureLaw
    friction: Friction | None
    surface: Surface

    @property
    def slipping(self) -> tuple[bool, ...]:
        """Which coordinates slip: all but Z, where friction knows the sliding direction only."""
        axial = self.friction is not None and self.friction.direction.knows_axial
        return tuple(axial or i != Z for i in range(6))

    @property
    def following(self) -> Six:
        """Velocities of a shoe that turns with a drum of 1 rad/s: q̇6 = 1 about the drum's axis, q̇2 = c."""
        return tuple(self.shoe.centroid if i == Y else float(i == TZ) for i in range(6))

    @property
    def area(self) -> Array:
        """Area of the lining (m²)."""
        return self.shoe.area

    def with_friction(self, friction: Friction | None) -> "Contact":
        """The same contact with other friction."""
        return dataclasses.replace(self, friction=friction)

    def fastest_slip(self, moment: Moment, v: Six) -> Array:
        """A bound on the slip speed (m/s): |constant| + |cosine| + |sine| of V_θ and V_z, at the edges of the width."""
        axial = self._axial_level(v) if self.slipping[Z] else None
        half_width, bound = self.shoe.width / 2, jnp.zeros(())
        for level in (self._slip_level(moment, v), axial):
            if level is not None:
                slopes = abs(level.cosine_slope) + abs(level.sine_slope)
                bound = bound + abs(level.constant) + abs(level.cosine) + abs(level.sine) + half_width * slopes
        return bound

    def yielding(self, moment: Moment) -> Array:
        """How far the lining yields under its load (m): p0/k_c."""
        return yielding(self.law, moment.preload)

    def levels(self, moment: Moment, q: Six, v: Six) -> Levels:
        """What makes the edges, at the present state."""
        level = self._pressure_level(moment, q)
        if self.friction is None:
            return Levels(level, None, None)
        knows_axial = self.surface.spatial and self.friction.direction.knows_axial
        return Levels(level, self._slip_level(moment, v), self._axial_level(v) if knows_axial else None)

    def _integrated(self, levels: Levels, densities: Callable[[Nodes], Densities]) -> Densities:
        """The integrals of densities over the lining, exact between its edges."""
        law = None if self.friction is None or levels.slip is None else self.friction.law
        cuts = (jnp.zeros(0), jnp.zeros(0)) if law is None else (breakpoints(law), kinks(law))
        edges = Edges(self.law.edges(levels.pressure), levels.slip, levels.axial, *cuts)
        return self.surface.integrate(self.shoe, edges, densities)

    def _field(self, levels: Levels, nodes: Nodes) -> ContactField:
        """Evaluate the contact at quadrature nodes."""
        level, slip, axial = levels
        value = level.at(nodes.cosine, nodes.sine, nodes.z)
        pressure = self.law.pressure(value)
        if self.friction is None or slip is None:
            return ContactField(nodes, value, pressure, None, None, None, None)
        tangential = slip.at(nodes.cosine, nodes.sine, nodes.z)
        lateral = None if axial is None else axial.at(nodes.cosine, nodes.sine, nodes.z)
        along, across = self.friction.traction(pressure, tangential, lateral)
        return ContactField(nodes, value, pressure, tangential, lateral, along, across)

    def act(self, moment: Moment, q: Six, v: Six) -> Action:
        """Q_i = ∫(−N φ_i^r + F_θ φ_i^θ + F_z φ_i^z) dA, equation (20), and the power beyond the stored energy."""
        levels = self.levels(moment, q, v)

        def densities(nodes: Nodes) -> Densities:
            field = self._field(levels, nodes)
            found = {**self._force_densities(field), **self._drag_densities(field)}
            if moment.preload_rate is not None:
                found["compression"] = self._stored(moment, q, nodes)[1] * nodes.weight
            return found

        total = self._integrated(levels, densities)
        power = jnp.zeros(())
        if "drag" in total:
            power = self.shoe.outer_radius * total["drag"] * moment.drum_speed - total["heat"]
        if moment.preload_rate is not None:
            power = power + moment.preload_rate * total["compression"]
        return Action(self._resultant(total), power)

    def potential_energy(self, moment: Moment, q: Six) -> Array:
        """U = ∫(p0 e + ½ k_c e²) dA with e the compression: its force is −∫ N φ^r dA (J)."""
        levels = Levels(self._pressure_level(moment, q), None, None)
        return self._integrated(levels, lambda nodes: {"energy": self._stored(moment, q, nodes)[0] * nodes.weight})[
            "energy"
        ]

    def observe(self, moment: Moment, q: Six, v: Six) -> Observation:
        """Integrals and extremes that describe the contact at one instant."""
        levels = self.levels(moment, q, v)
        smallest = self.law.pressure(self._pressure_range(moment, q)[0])

        def densities(nodes: Nodes) -> Densities:
            field, weight = self._field(levels, nodes), nodes.weight
            touching = self.law.touches(field.level)
            found = {"normal": field.pressure * weight, "touching": jnp.where(touching, weight, 0.0)}
            if field.slip is not None:
                forward = touching & (field.slip * jnp.sign(moment.drum_speed) > 0)
                found |= {"reversed": jnp.where(forward, weight, 0.0), **self._drag_densities(field)}
            return found

        total = self._integrated(levels, densities)
        zero, area = jnp.zeros(()), self.shoe.area
        return Observation(
            brake_torque=self.shoe.outer_radius * total.get("drag", zero),
            normal_force=total["normal"],
            contact_fraction=total["touching"] / area,
            slip_reversed_fraction=total.get("reversed", zero) / area,
            smallest_pressure=smallest,
            friction_power=total.get("heat", zero),
            sticking=zero,
        )

    def pressure_range(self, moment: Moment, q: Six) -> tuple[Array, Array]:
        """Smallest and largest pressure on the lining (Pa)."""
        low, high = self._pressure_range(moment, q)
        return self.law.pressure(low), self.law.pressure(high)

    def along_arc(self, moment: Moment, q: Six, v: Six, theta: Array) -> tuple[Array, Array]:
        """Pressure N (Pa) and slip velocity V_θ (m/s) at angles θ (rad) of the middle line z = 0."""
        cosine, sine = jnp.cos(theta), jnp.sin(theta)
        pressure = self.law.pressure(self._pressure_level(moment, q).at(cosine, sine, None))
        return pressure, self._slip_level(moment, v).at(cosine, sine, None)

    def _pressure_level(self, moment: Moment, q: Six) -> Level:
        """p0 + k_c u_r, u_r = (q1 + z q5) cos θ + (q2 − z q4 − c q6) sin θ."""
        k = self.law.stiffness
        return Level(moment.preload, k * q[X], k * (q[Y] - self.shoe.centroid * q[TZ]), k * q[TY], -k * q[TX])

    def _slip_level(self, moment: Moment, v: Six) -> Level:
        """V_θ = R (q̇6 − Ω) − (q̇1 + z q̇5) sin θ + (q̇2 − z q̇4 − c q̇6) cos θ, equations (9) and (13)."""
        constant = self.shoe.outer_radius * (v[TZ] - moment.drum_speed)
        return Level(constant, v[Y] - self.shoe.centroid * v[TZ], -1.0 * v[X], -1.0 * v[TX], -1.0 * v[TY])

    def _axial_level(self, v: Six) -> Level:
        """V_z = q̇3 + R q̇4 sin θ − (R cos θ − c) q̇5."""
        R = self.shoe.outer_radius
        return Level(v[Z] + self.shoe.centroid * v[TY], -R * v[TY], R * v[TX])

    def _force_densities(self, field: ContactField) -> Densities:
        """Forces on the lining (N) and moments without Tz's (N m) at the nodes.

        Per unit area the force in the plane is (x, y) = −N e_r + F_θ e_θ.
        """
        R, c = self.shoe.outer_radius, self.shoe.centroid
        cosine, sine, z, weight = field.nodes
        load = field.pressure * weight
        x, y = -load * cosine, -load * sine
        if field.along is not None:
            drag = field.along * weight
            x, y = x - drag * sine, y + drag * cosine
        if z is None:
            return {"x": x, "y": y}
        if field.across is None:
            return {"x": x, "y": y, "moment_x": -z * y, "moment_y": z * x}
        lateral = field.across * weight
        moment_x, moment_y = -z * y + R * sine * lateral, z * x - (R * cosine - c) * lateral
        return {"x": x, "y": y, "z": lateral, "moment_x": moment_x, "moment_y": moment_y}

    def _drag_densities(self, field: ContactField) -> Densities:
        """Drag of friction F_θ (N) and its heat −F·V (W) at the nodes; nothing without friction."""
        if field.along is None or field.slip is None:
            return {}
        heat = field.along * field.slip
        if field.across is not None and field.axial is not None:
            heat = heat + field.across * field.axial
        return {"drag": field.along * field.nodes.weight, "heat": -heat * field.nodes.weight}

    def _resultant(self, total: Densities) -> Six:
        """Generalised force from the sums of the densities; that of Tz is R ∫F_θ dA − c ∫y dA."""
        spin = self.shoe.outer_radius * total["drag"] if "drag" in total else 0.0
        moment_z = spin - self.shoe.centroid * total["y"]
        lateral, moment_x, moment_y = (total.get(key, 0.0) for key in ("z", "moment_x", "moment_y"))
        return total["x"], total["y"], lateral, moment_x, moment_y, moment_z

    def _stored(self, moment: Moment, q: Six, nodes: Nodes) -> tuple[Array, Array]:
        """Stored energy per unit area (J/m²) and its derivative with respect to p0, the compression e (m)."""
        radial = self._radial_level(q).at(nodes.cosine, nodes.sine, nodes.z)
        preload = moment.preload
        compression = self.law.compression(preload, radial)
        return compression * (preload + self.law.stiffness * compression / 2), compression

    def _radial_level(self, q: Six) -> Level:
        """u_r, equation (10)."""
        return Level(0.0, 1.0 * q[X], q[Y] - self.shoe.centroid * q[TZ], 1.0 * q[TY], -1.0 * q[TX])

    def _pressure_range(self, moment: Moment, q: Six) -> tuple[Array, Array]:
        """Extremes of p0 + k_c u_r: at an end of the arc or where cos and sin line up, on an edge line z = ±b/2."""
        z = self.shoe.width / 2 * jnp.asarray([-1.0, 1.0])
        a, b, c = (jnp.asarray(x) for x in self._pressure_level(moment, q).on_line(z)[:3])
        squared = b * b + c * c
        swing = jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1.0)), 0.0)
        peak = jnp.arctan2(c, jnp.where((b == 0) & (c == 0), 1.0, b))
        half_angle, angle = self.shoe.half_angle, jnp.stack([-self.shoe.half_angle, self.shoe.half_angle])
        ends = a + b * jnp.cos(angle)[:, None] + c * jnp.sin(angle)[:, None]
        trough = jnp.where(peak > 0, peak - jnp.pi, peak + jnp.pi)
        low = jnp.where(jnp.abs(trough) <= half_angle, a - swing, jnp.min(ends, axis=0))
        high = jnp.where(jnp.abs(peak) <= half_angle, a + swing, jnp.max(ends, axis=0))
        return jnp.min(low), jnp.max(high)
