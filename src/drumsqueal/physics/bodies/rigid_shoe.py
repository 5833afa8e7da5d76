"""The rigid shoe, a curved plate (an annular sector with its centre of gravity on the x axis).

Source of all formulas: Seo & Kang, Lubricants 2023, 11(12), 496, equations (1) to (10) and (23) to (28).
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike
from numpy.typing import NDArray

from drumsqueal.coordinates import COORDINATES, is_rotation
from drumsqueal.physics.bodies.body import Motion, Scalar, cartesian
from drumsqueal.physics.quadrature.surface import Densities, Level, Nodes
from drumsqueal.precision import real

IN_PLANE, OUT_OF_PLANE = ("X", "Y", "Tz"), ("Z", "Tx", "Ty")


class Six(NamedTuple):
    """One scalar for each coordinate of the shoe."""

    X: Scalar = 0.0
    Y: Scalar = 0.0
    Z: Scalar = 0.0
    Tx: Scalar = 0.0
    Ty: Scalar = 0.0
    Tz: Scalar = 0.0


class RigidShoe(eqx.Module):
    """Annular sector of outer radius R, thickness h, width b, arc angle β and density ρ (SI units, rad).

    The six coordinates q = (X, Y, Z, Tx, Ty, Tz) are the displacement and the small rotation at the centre of gravity,
    in m and rad; `names` are those of them that are kept, the others rest. θ = 0 is the x axis; the lining covers
    |θ| ≤ β/2 and |z| ≤ b/2 on the outer radius.
    """

    outer_radius: Array = eqx.field(converter=real)
    thickness: Array = eqx.field(converter=real)
    width: Array = eqx.field(converter=real)
    arc_angle: Array = eqx.field(converter=real)
    density: Array = eqx.field(converter=real)
    names: tuple[str, ...] = eqx.field(static=True, default=COORDINATES)

    def widen(self, kept: Motion) -> Six:
        """All six from the kept coordinates: literal zeros elsewhere, which cost nothing when compiled."""
        return Six(**{name: kept[k] for k, name in enumerate(self.names)})

    def keep(self, six: Six) -> Motion:
        """The kept coordinates of all six."""
        return tuple(getattr(six, name) for name in self.names)

    @property
    def symmetric(self) -> tuple[bool, ...]:
        """Which coordinates move every line across the lining alike: those in the plane."""
        return tuple(name in IN_PLANE for name in self.names)

    def radial_moment(self, power: int) -> Array:
        """∫ r^power dr from R − h to R (m^(power + 1))."""
        inner = self.outer_radius - self.thickness
        return (self.outer_radius ** (power + 1) - inner ** (power + 1)) / (power + 1)

    @property
    def half_angle(self) -> Array:
        """β/2 (rad)."""
        return self.arc_angle / 2

    @property
    def area(self) -> Array:
        """Lining area R β b (m²)."""
        return self.outer_radius * self.arc_angle * self.width

    @property
    def centroid(self) -> Array:
        """Distance c of the centre of gravity from the drum's axis (m), equation (2).

        c = 4 (h² − 3hR + 3R²) / (3 β (2R − h)) · sin(β/2)
        """
        R, h = self.outer_radius, self.thickness
        return 4 * (h**2 - 3 * h * R + 3 * R**2) / (3 * self.arc_angle * (2 * R - h)) * _sine(self.half_angle)

    @property
    def mass(self) -> Array:
        """Diagonal of the mass matrix (n,), in kg and kg m²."""
        return jnp.stack(self.keep(self.inertia))  # pyright: ignore[reportArgumentType]

    @property
    def inertia(self) -> Six:
        """Mass m and moments of inertia I1, I2, I3 of all six, in kg and kg m²; equations (26) to (28).

        The products of inertia vanish by symmetry. With c_k, s_k the integrals of cos² and sin² over the arc:
        I1 = ρ (b s ∫r³ + β b³/12 ∫r), I2 = ρ (b (c ∫r³ − 4 c sin(β/2) ∫r² + c² β ∫r) + β b³/12 ∫r),
        I3 = ρ b (β ∫r³ − 4 c sin(β/2) ∫r² + c² β ∫r).
        """
        beta, b, c, rho = self.arc_angle, self.width, self.centroid, self.density
        first, second, third = (self.radial_moment(k) for k in (1, 2, 3))
        cosine_squared, sine_squared = self._squares()
        across = beta * b**3 / 12 * first
        offset = c**2 * beta * first - 4 * c * _sine(self.half_angle) * second
        body = rho * beta * b * first
        return Six(
            body,
            body,
            body,
            rho * (b * sine_squared * third + across),
            rho * (b * (cosine_squared * third + offset) + across),
            rho * b * (beta * third + offset),
        )

    def _squares(self) -> tuple[Array, Array]:
        """∫cos²θ dθ and ∫sin²θ dθ over the arc (rad)."""
        return (self.arc_angle + _sine(self.arc_angle)) / 2, (self.arc_angle - _sine(self.arc_angle)) / 2

    def radial_resultant(self) -> Motion:
        """∫ φ^r dA: the generalised force of unit pressure is its negative (m², m³ for rotations)."""
        return self.keep(Six(X=2 * _sine(self.half_angle) * self.outer_radius * self.width))

    def tangential_resultant(self) -> Motion:
        """∫ φ^θ dA: the generalised force of unit traction along θ (m², m³ for rotations)."""
        chord = 2 * _sine(self.half_angle) * self.outer_radius * self.width
        return self.keep(Six(Y=chord, Tz=self.outer_radius * self.area - self.centroid * chord))

    def radial_stiffness(self) -> Array:
        """∫ φ^r φ^r dA, shape (n, n): the full-contact stiffness per unit contact stiffness (SI units)."""
        cosine_squared, sine_squared = self._squares()
        R, b, c = self.outer_radius, self.width, self.centroid
        along, across = R * b, R * b**3 / 12
        coupled = -c * along * sine_squared
        entries = {
            ("X", "X"): along * cosine_squared,
            ("Y", "Y"): along * sine_squared,
            ("Y", "Tz"): coupled,
            ("Tz", "Y"): coupled,
            ("Tz", "Tz"): c**2 * along * sine_squared,
            ("Tx", "Tx"): across * sine_squared,
            ("Ty", "Ty"): across * cosine_squared,
        }
        return jnp.array([[entries.get((i, j), 0.0) for j in self.names] for i in self.names])

    @property
    def velocity_with_drum(self) -> Motion:
        """Velocities of a shoe that turns with a drum of 1 rad/s: Tz about the drum's axis, and Y = c."""
        return self.keep(Six(Y=self.centroid, Tz=1.0))

    @property
    def follows(self) -> bool:
        """Whether Y and Tz are kept, in which the shoe turns with the drum."""
        return {"Y", "Tz"} <= set(self.names)

    def slides(self, *, axially: bool) -> tuple[bool, ...]:
        """Which coordinates move the lining along the drum or, if asked, also along its axis: all but Z, or all."""
        return tuple(axially or name != "Z" for name in self.names)

    def radial(self, q: Motion) -> Level:
        """u_r of the lining (m)."""
        return _radial(self.widen(q), self.centroid)

    def along(self, v: Motion, turning: Scalar = 0.0) -> Level:
        """u_θ of the lining (m), or of velocities V_θ (m/s), equation (13), on a drum that turns (rad/s)."""
        return _along(self.widen(v), self.outer_radius, self.centroid, turning)

    def axial(self, v: Motion) -> Level:
        """u_z of the lining (m), or its rate."""
        return _axial(self.widen(v), self.outer_radius, self.centroid)

    def bound(self, level: Level) -> Array:
        """A bound of the size of a level on the lining: |constant| + |cosine| + |sine|, at the edges of the width."""
        return level.bound(self.width / 2)

    def ends_and_extremes(self, level: Level, *, spatial: bool) -> tuple[Array, Array, Array, Array]:
        """Values at both ends of the arc, least and largest ones on it, along each line where extremes can be."""
        lines = jnp.array([-0.5, 0.5]) * self.width if spatial else jnp.zeros(1)
        a, b, c = (jnp.asarray(x) for x in level.on_line(lines)[:3])
        squared = b * b + c * c
        swing = jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1.0)), 0.0)
        cosine = jnp.cos(self.half_angle)
        middle, tilt = a + b * cosine, c * jnp.sin(self.half_angle)
        first, last = middle - tilt, middle + tilt
        # An extreme lies where cos and sin line up, cos θ = ±b/swing, if that is on the arc.
        low = jnp.where(-b > cosine * swing, a - swing, jnp.minimum(first, last))
        high = jnp.where(b > cosine * swing, a + swing, jnp.maximum(first, last))
        return first, last, low, high

    def displacement(
        self, q: Mapping[str, ArrayLike], angle: ArrayLike, z: ArrayLike = 0.0, radius: ArrayLike | None = None
    ) -> tuple:
        """(u_r, u_θ, u_z) at angles θ (rad), z (m) and a radius (m; the lining's unless given).

        `q` has coordinates by name (m, rad), zero where not named, or their rates: numbers and arrays of NumPy or of
        JAX, which broadcast with the points.
        """
        trigonometry = jnp if isinstance(angle, Array) else np
        cosine, sine = trigonometry.cos(angle), trigonometry.sin(angle)
        return tuple(level.value(cosine, sine, z) for level in self._levels(q, radius))

    def of_drum(self, q: Mapping[str, ArrayLike], angle: ArrayLike, z: ArrayLike = 0.0) -> tuple:
        """The same of the drum's surface: it is rigid."""
        del q, angle, z
        return 0.0, 0.0, 0.0

    def over_drum(self, q: Mapping[str, ArrayLike], angle: ArrayLike, z: ArrayLike = 0.0) -> tuple:
        """The same of the lining relative to the drum's surface."""
        pairs = zip(self.displacement(q, angle, z), self.of_drum(q, angle, z), strict=True)
        return tuple(lining - drum for lining, drum in pairs)

    def displaced(self, q: Mapping[str, Any], x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
        """(u_x, u_y, u_z) of points of the shoe (m, from the drum's axis), of coordinates by name."""
        angle = np.arctan2(y, x)
        return cartesian(self.displacement(q, angle, z, np.hypot(x, y)), angle)

    def shapes_at(self, point: Array, radius: Scalar = 0.0) -> Array:
        """Displacements (u_x, u_y, u_z) of a point (3,) in m, on the shoe or held by a rigid arm, shape (3, n).

        One column a coordinate, for 1 m or 1 rad of it. Whatever the radius of a patch, all of it turns alike.
        """
        del radius
        x, y, z = point[0] - self.centroid, point[1], point[2]
        rows = Six(X=1.0, Ty=z, Tz=-y), Six(Y=1.0, Tx=-z, Tz=x), Six(Z=1.0, Tx=y, Ty=-x)
        return jnp.stack([jnp.stack([each + jnp.zeros(()) for each in self.keep(row)]) for row in rows])

    def largest(self, q: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bounds of |u_r| and |u_θ|, over the whole circle, of coordinates or their rates (time,) by name."""
        half_width = float(self.width) / 2
        radial, along, _ = self._levels(q)
        return _bound(radial, half_width), _bound(along, half_width)

    def surface(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Displacements u_r and u_θ of points of the lining (points, n), of 1 m or 1 rad of each coordinate."""
        angle, z = self._lining_points()
        shapes = [self.over_drum({name: 1.0}, angle, z) for name in self.names]
        radial, along = ([np.broadcast_to(shape[k], angle.shape) for shape in shapes] for k in (0, 1))
        return np.stack(radial, axis=1), np.stack(along, axis=1)

    @property
    def _across(self) -> tuple[float, ...]:
        """Where across the lining (in widths) its displacement is largest."""
        return (0.0,) if all(self.symmetric) else (-0.5, 0.0, 0.5)

    def _lining_points(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Angles (rad) and places across (m) of points spread over the lining."""
        # 65 points along the lining give the largest of a constant, a cosine and a sine to 3e-4.
        both = np.linspace(-1, 1, 65) * float(self.half_angle), np.array(self._across) * float(self.width)
        angle, z = np.meshgrid(*both, indexing="ij")
        return angle.ravel(), z.ravel()

    def characteristic_lengths(self) -> dict[str, float]:
        """R (m) for a rotation, 1 for a displacement, of all six coordinates."""
        return {name: float(self.outer_radius) if is_rotation(name) else 1.0 for name in COORDINATES}

    def _levels(self, q: Mapping[str, Any], radius: Any = None) -> tuple[Level, Level, Level]:
        """u_r, u_θ, u_z on a radius (m) of coordinates by name; of NumPy where all is."""
        lengths = (self.outer_radius if radius is None else radius, self.centroid)
        R, c = (float(x) if isinstance(x, Array) and not isinstance(x, Tracer) else x for x in lengths)
        six = Six(**q)
        return _radial(six, c), _along(six, R, c), _axial(six, R, c)

    def tractions(self, nodes: Nodes, load: Array, drag: Array | None, lateral: Array | None) -> Densities:
        """Forces on the lining (N) and moments without Tz's (N m) at the nodes.

        The force in the plane is (x, y) = −load e_r + drag e_θ.
        """
        cosine, sine, z, _ = nodes
        x, y = -load * cosine, -load * sine
        if drag is not None:
            x, y = x - drag * sine, y + drag * cosine
        if z is None:
            return {"x": x, "y": y}
        if lateral is None:
            return {"x": x, "y": y, "moment_x": -z * y, "moment_y": z * x}
        R, c = self.outer_radius, self.centroid
        moment_x, moment_y = -z * y + R * sine * lateral, z * x - (R * cosine - c) * lateral
        return {"x": x, "y": y, "z": lateral, "moment_x": moment_x, "moment_y": moment_y}

    def resultant(self, total: Densities) -> Motion:
        """Generalised force from the sums of the tractions; that of Tz is R ∫F_θ dA − c ∫y dA."""
        spin = self.outer_radius * total["drag"] if "drag" in total else 0.0
        moment_z = spin - self.centroid * total["y"]
        lateral, moment_x, moment_y = (total.get(key, 0.0) for key in ("z", "moment_x", "moment_y"))
        return self.keep(Six(total["x"], total["y"], lateral, moment_x, moment_y, moment_z))


def _sine(angle: Any) -> Any:
    return np.sin(angle) if isinstance(angle, np.ndarray | np.generic) else jnp.sin(angle)


# The displacement of a point at θ and z on the radius R: its coefficients are the shape functions.


def _radial(q: Six, c: Any) -> Level:
    """u_r = (X + z Ty) cos θ + (Y − z Tx − c Tz) sin θ, equation (10)."""
    return Level(0.0, q.X, q.Y - c * q.Tz, q.Ty, -1.0 * q.Tx)


def _along(q: Six, R: Any, c: Any, turning: Scalar = 0.0) -> Level:
    """u_θ = R Tz − (X + z Ty) sin θ + (Y − z Tx − c Tz) cos θ, equation (9)."""
    return Level(R * (q.Tz - turning), q.Y - c * q.Tz, -1.0 * q.X, -1.0 * q.Tx, -1.0 * q.Ty)


def _axial(q: Six, R: Any, c: Any) -> Level:
    """u_z = Z + R Tx sin θ − (R cos θ − c) Ty."""
    return Level(q.Z + c * q.Ty, -R * q.Ty, R * q.Tx)


def _bound(level: Level, half_width: float) -> NDArray[np.float64]:
    """Largest size of a level over the whole circle, or somewhat more: its slopes may peak elsewhere."""
    slopes = np.hypot(level.cosine_slope, level.sine_slope)
    return np.abs(level.constant) + np.hypot(level.cosine, level.sine) + half_width * slopes


# The rigid motion of a shoe that is given as a solid mesh: its inertia, about principal axes of its own.


_TURNS = ("Tx", "Ty", "Tz")


class RigidMesh(RigidShoe):
    """A shoe of which only the lining is a sector's: mass m (kg), centre (3,) in m, moments (3,) about `axes` (3, 3).

    X, Y and Z are displacements of the centre along x, y and z; Tx, Ty and Tz are rotations about the principal axes,
    the columns of `axes`, which are those nearest to x, y and z: so the mass matrix is diagonal.
    """

    m: Array = eqx.field(converter=real, kw_only=True)
    centre: Array = eqx.field(converter=real, kw_only=True)
    moments: Array = eqx.field(converter=real, kw_only=True)
    axes: Array = eqx.field(converter=real, kw_only=True)

    @property
    def centroid(self) -> Array:
        """How far the centre of gravity is from the drum's axis along x (m)."""
        return self.centre[0]

    @property
    def inertia(self) -> Six:
        """Mass and principal moments of inertia."""
        return Six(self.m, self.m, self.m, *self.moments)

    @property
    def velocity_with_drum(self) -> Motion:
        """Velocities of a shoe that turns with a drum of 1 rad/s."""
        return self.keep(Six(-self.centre[1], self.centre[0], 0.0, *self.axes[2]))

    def displacement(
        self, q: Mapping[str, ArrayLike], angle: ArrayLike, z: ArrayLike = 0.0, radius: ArrayLike | None = None
    ) -> tuple:
        """(u_r, u_θ, u_z) at angles (rad), z and a radius (m; the lining's unless given), of coordinates by name."""
        of_jax = isinstance(angle, Array)
        trigonometry = jnp if of_jax else np
        centre, axes, R = (each if of_jax else np.asarray(each) for each in (self.centre, self.axes, self.outer_radius))
        radius = R if radius is None else radius
        cosine, sine = trigonometry.cos(angle), trigonometry.sin(angle)
        arm = radius * cosine - centre[0], radius * sine - centre[1], z - centre[2]
        turn: list[Any] = [sum(q[name] * axes[k, j] for j, name in enumerate(_TURNS) if name in q) for k in range(3)]
        x, y, axial = (
            q.get(name, 0.0) + turn[k - 2] * arm[k - 1] - turn[k - 1] * arm[k - 2] for k, name in enumerate("XYZ")
        )
        return x * cosine + y * sine, y * cosine - x * sine, axial

    def shapes_at(self, point: Array, radius: Scalar = 0.0) -> Array:
        """Displacements (u_x, u_y, u_z) of a point (3,) in m for 1 m or 1 rad of each coordinate, (3, n)."""
        del radius
        turned = jnp.cross(self.axes.T, point - self.centre).T
        every: dict[str, Array] = dict(
            zip(("X", "Y", "Z", *_TURNS), jnp.concatenate([jnp.eye(3), turned], axis=1).T, strict=True)
        )
        return jnp.stack([every[name] for name in self.names], axis=1)
