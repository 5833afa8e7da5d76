"""The shoe that bends, on a drum that may bend: the rigid shoe's coordinates, and one for each elastic mode.

u = rigid motion + Σ ψ_j η_j with the mass-normalised modes (ω_j, ψ_j) of the free shoe. Rigid motions and modes are
orthogonal, so the mass matrix stays diagonal, with 1 for each mode; the stiffness gains ω_j². Contact sees how the
lining moves relative to the drum: in it, a mode of the drum counts as −ψ_j.
"""

import dataclasses
import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from drumsqueal.coordinates import COORDINATES, is_elastic, is_of_drum
from drumsqueal.physics.bodies.body import Motion, Scalar, scalars
from drumsqueal.physics.bodies.drum_modes import ElasticDrum
from drumsqueal.physics.bodies.mode_shapes import Sector, shapes_at, shapes_held_at
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe, Six
from drumsqueal.physics.quadrature.cells import CellDensities, Cells, Sampled, Spread, cells_for
from drumsqueal.physics.quadrature.lines import LineCells, lines_for, lines_of, onto_lines
from drumsqueal.physics.quadrature.surface import Densities, Nodes
from drumsqueal.precision import real

_SURFACES: dict[bytes, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}
"""What `ElasticShoe.surface` found."""


class ElasticShoe(RigidShoe):
    """An annular sector with its free modes: `names` are X to Tz, as far as kept, the kept modes E1, E2, …, the drum's.

    `frequencies` ω_j (m,) in rad/s and `shapes` ψ_j (m, 3, …), coefficients as in `free_modes.py`, are those of the
    shoe's kept modes; a mode's coordinate η_j is in m kg^½. `sampled` (n, N) are u_r, u_θ and u_z of the lining
    relative to the drum at the nodes of the cells for 1 of each coordinate, and `weights` (N,) the area (m²) that
    belongs to each node.
    """

    frequencies: Array = eqx.field(converter=real, kw_only=True)
    shapes: Array = eqx.field(converter=real, kw_only=True)
    sampled: tuple[Array, ...] = eqx.field(converter=lambda each: tuple(map(real, each)), kw_only=True)
    weights: Array = eqx.field(converter=real, kw_only=True)
    even: tuple[bool, ...] = eqx.field(static=True, kw_only=True)
    cells: Cells = eqx.field(kw_only=True)
    drum: ElasticDrum | None = eqx.field(kw_only=True)
    position: Array = eqx.field(converter=real, kw_only=True)
    rigid: RigidShoe = eqx.field(kw_only=True)

    @classmethod
    def of(
        cls,
        rigid: RigidShoe,
        elastic: tuple[str, ...],
        frequencies: Array,
        shapes: Array,
        even: tuple[bool, ...],
        drum: ElasticDrum | None = None,
        cells: Cells | None = None,
        position: Scalar = 0.0,
    ) -> "ElasticShoe":
        """Add modes to a rigid shoe, of which the plane z = 0 mirrors the `even` ones, and those of a drum under it.

        The cells may be given, and the angle (rad) on the drum at which the middle of the lining is.
        """
        if cells is None:
            degrees = max(shapes.shape[-1], 0 if drum is None else drum.shapes.shape[-1])
            cells = lines_for(degrees) if drum is None and all(rigid.symmetric + even) else cells_for(degrees)
        angle, z, weights, _ = cells.nodes(rigid)
        return cls(
            rigid.outer_radius,
            rigid.thickness,
            rigid.width,
            rigid.arc_angle,
            rigid.density,
            rigid.names + elastic + (() if drum is None else drum.names),
            frequencies=frequencies,
            shapes=shapes,
            sampled=_over_drum_each(rigid, shapes, drum, position, angle, z),
            weights=weights,
            even=even,
            cells=cells,
            drum=drum,
            position=position,
            rigid=rigid,
        )

    def on_cells(self, cells: Cells) -> "ElasticShoe":
        """The same shoe, its lining known at the nodes of other cells."""
        return ElasticShoe.of(
            self.rigid, self._own, self.frequencies, self.shapes, self.even, self.drum, cells, self.position
        )

    @property
    def _own(self) -> tuple[str, ...]:
        """Names of the shoe's own modes."""
        return tuple(name for name in self.names if is_elastic(name) and not is_of_drum(name))

    @property
    def _modes(self) -> int:
        """How many modes there are, those of the drum among them."""
        return sum(map(is_elastic, self.names))

    def in_plane(self) -> "ElasticShoe":
        """The same shoe on lines, for motion that the plane z = 0 mirrors: other coordinates neither move nor feel it.

        No shape is evaluated anew: within cells they are polynomials of that order.
        """
        if isinstance(self.cells, LineCells):
            return self
        lines = lines_of(self.cells)
        kept = np.array(self.symmetric, dtype=float)[:, None]
        sampled = tuple(kept * onto_lines(self.cells, lines, each) for each in self.sampled)
        return dataclasses.replace(self, cells=lines, sampled=sampled, weights=lines.nodes(self.rigid).weight)

    def widen(self, kept: Motion) -> Six:
        """The six rigid coordinates."""
        return Six(**{name: kept[k] for k, name in enumerate(self.names) if name in COORDINATES})

    def keep(self, six: Six) -> Motion:
        """The kept coordinates of all six, and zeros for the modes."""
        rigid = [getattr(six, name) + jnp.zeros(()) for name in self.names if name in COORDINATES]
        return scalars(jnp.stack([*rigid, *[jnp.zeros(())] * self._modes]))

    @property
    def centroid(self) -> Array:
        """Distance of the centre of gravity from the drum's axis along x (m)."""
        return self.rigid.centroid

    @property
    def inertia(self) -> Six:
        """Mass and moments of inertia of all six, in kg and kg m²."""
        return self.rigid.inertia

    @property
    def velocity_with_drum(self) -> Motion:
        """Velocities of a shoe that turns with a drum of 1 rad/s."""
        return self.keep(self.widen(self.rigid.velocity_with_drum))

    @property
    def symmetric(self) -> tuple[bool, ...]:
        """Which coordinates the plane z = 0 mirrors: no mode of a drum, whose back plate is on one side."""
        return self.rigid.symmetric + self.even + (False,) * (self._modes - len(self.even))

    @property
    def mass(self) -> Array:
        """Diagonal of the mass matrix (n,), in kg and kg m², and 1 for each mode."""
        rigid = [getattr(self.inertia, name) for name in self.names if name in COORDINATES]
        return jnp.stack([*rigid, *[jnp.ones(())] * self._modes])

    def elastic_stiffness(self, *, of_drum: bool = True) -> Array:
        """diag(ω_j²) of the modes (n, n), zero elsewhere; without those of the drum where another shoe has them."""
        drum = jnp.zeros(0) if self.drum is None else self.drum.frequencies * of_drum
        frequencies = jnp.concatenate([jnp.zeros(len(self.names) - self._modes), self.frequencies, drum])
        return jnp.diag(frequencies**2)

    def radial_resultant(self) -> Motion:
        """∫ φ^r dA: the generalised force of unit pressure is its negative."""
        return scalars(self.sampled[0] @ self.weights)

    def tangential_resultant(self) -> Motion:
        """∫ φ^θ dA: the generalised force of unit traction along θ."""
        return scalars(self.sampled[1] @ self.weights)

    def radial_stiffness(self) -> Array:
        """∫ φ^r φ^r dA, shape (n, n): the full-contact stiffness per unit contact stiffness."""
        return (self.sampled[0] * self.weights) @ self.sampled[0].T

    def radial(self, q: Motion) -> Sampled:
        """u_r of the lining (m)."""
        return Sampled(self._at_nodes(0, q))

    def along(self, v: Motion, turning: Scalar = 0.0) -> Sampled:
        """u_θ of the lining (m), or of velocities V_θ (m/s) on a drum that turns (rad/s)."""
        return Sampled(self._at_nodes(1, v) - self.outer_radius * turning)

    def axial(self, v: Motion) -> Sampled:
        """u_z of the lining (m), or its rate."""
        return Sampled(self._at_nodes(2, v), odd=True)

    def _at_nodes(self, direction: int, motion: Motion) -> Array:
        shapes = self.sampled[direction]
        if isinstance(motion, tuple):
            return sum((each * shapes[k] for k, each in enumerate(motion)), start=jnp.zeros(shapes.shape[1]))
        return motion @ shapes

    def bound(self, level: Sampled) -> Array:
        """A bound of the size of a level on the lining."""
        return self.cells.bound(level)

    def ends_and_extremes(self, level: Sampled, *, spatial: bool) -> tuple[Array, ...]:
        """Least and largest values at the nodes of the cells and on their sides."""
        del spatial
        reached = self.cells.with_sides(level)
        return jnp.min(reached), jnp.max(reached)

    def shapes_at(self, point: Array, radius: Scalar = 0.0) -> Array:
        """Displacements (u_x, u_y, u_z) of a point (3,) in m, which rigid arms hold to a patch of a radius, (3, n)."""
        own = [self.rigid.shapes_at(point), shapes_held_at(self.shapes, _sector(self), *point, radius=radius)]
        return jnp.concatenate([*own, jnp.zeros((3, self._modes - len(self.even)))], axis=1)

    def displacement(
        self, q: Mapping[str, ArrayLike], angle: ArrayLike, z: ArrayLike = 0.0, radius: ArrayLike | None = None
    ) -> tuple:
        """(u_r, u_θ, u_z) at angles θ (rad), z (m) and a radius (m; the lining's unless given).

        `q` has coordinates by name, zero where not named, or their rates: numbers and arrays of NumPy or of JAX, which
        broadcast with the points. What is of the drum moves no point of the shoe.
        """
        found = self.rigid.displacement({name: q[name] for name in q if name in COORDINATES}, angle, z, radius)
        at = jnp.broadcast_arrays if isinstance(angle, Array) else np.broadcast_arrays
        if moving := [j for j, name in enumerate(self._own) if name in q]:
            shapes, sector = _shapes_and_sector(self, self.shapes, angle)
            places = at(sector.outer_radius if radius is None else radius, angle, z)
            sizes = [q[self._own[j]] for j in moving]
            found = _with_modes(found, sizes, shapes_at(shapes[np.array(moving)], sector, *places))
        return found

    def of_drum(self, q: Mapping[str, ArrayLike], angle: ArrayLike, z: ArrayLike = 0.0) -> tuple:
        """The same of the drum's surface, which moves by its own modes."""
        found = super().of_drum(q, angle, z)
        moving = [] if self.drum is None else [j for j, name in enumerate(self.drum.names) if name in q]
        if self.drum is None or not moving:
            return found
        at = jnp.broadcast_arrays if isinstance(angle, Array) else np.broadcast_arrays
        sizes, places = [q[self.drum.names[j]] for j in moving], at(_on_drum(angle, self.position), z)
        return _with_modes(found, sizes, self.drum.shapes_at(places[0], places[1], np.array(moving)))

    def surface(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """As of the rigid shoe, relative to the drum; shapes are evaluated once for all coordinates, and all who ask.

        Studies ask for each mode at each point: of two bending shoes on a bending drum that took minutes.
        """
        parts = self.rigid, self.shapes, self.drum, self.position
        told = repr(self.names).encode() + b"".join(np.asarray(leaf).tobytes() for leaf in jax.tree.leaves(parts))
        key = hashlib.sha256(told).digest()
        if key not in _SURFACES:
            while len(_SURFACES) >= 8:  # shoes, of some megabytes each
                _SURFACES.pop(next(iter(_SURFACES)), None)
            shapes = _over_drum_each(*parts, *self._lining_points())
            shapes.setflags(write=False)
            _SURFACES[key] = shapes[0].T, shapes[1].T
        return _SURFACES[key]

    def largest(self, q: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Largest |u_r| and |u_θ| on the lining, of coordinates or their rates (time,) by name."""
        columns = np.stack(np.broadcast_arrays(*(q.get(name, np.zeros(())) for name in self.names)), axis=-1)
        found = np.zeros((2, *columns.shape[:-1]))
        block = 4096  # instants at a time, of a record whose largest displacement on the lining is sought
        for k, shapes in enumerate(self.surface()):
            for first in range(0, len(columns), block):
                rows = slice(first, first + block)
                found[k, rows] = np.abs(columns[rows] @ shapes.T).max(axis=-1)
        return found[0], found[1]

    @property
    def _across(self) -> tuple[float, ...]:
        """Everywhere: a mode that the plane z = 0 mirrors changes across the lining, too."""
        return (-0.5, -0.25, 0.0, 0.25, 0.5)

    def characteristic_lengths(self) -> dict[str, float]:
        """R (m) for a rotation, 1 for a displacement, max √(ψ_r² + ψ_θ²) for a mode that is kept."""
        largest = np.hypot(*self.surface()).max(axis=0).tolist()
        return dict(zip(self.names, largest, strict=True)) | super().characteristic_lengths()

    def tractions(self, nodes: Nodes, load: Array, drag: Array | None, lateral: Array | None) -> CellDensities:
        """Forces on the lining (N) along r, θ and z, spread onto the nodes of the cells."""
        del nodes
        forces = {"radial": -load, "along": drag, "axial": lateral}
        return {name: Spread(force, odd=name == "axial") for name, force in forces.items() if force is not None}

    def resultant(self, total: Densities) -> Motion:
        """Generalised force of the tractions: the shape functions at the nodes times the forces there."""
        directions = ("radial", "along", "axial")
        # A product of matrices compiles within a kernel as long as no other sum is behind it.
        parts = [self.sampled[k] @ total[name] for k, name in enumerate(directions) if name in total]
        return scalars(sum(parts[1:], start=parts[0]))


def _with_modes(found: tuple, sizes: Sequence[Any], shapes: Any) -> tuple:
    """u_r, u_θ, u_z with those of modes of some sizes, of shapes (..., 3, m), added."""
    return tuple(each + sum(size * shapes[..., k, j] for j, size in enumerate(sizes)) for k, each in enumerate(found))


def _sector(shoe: RigidShoe) -> Sector:
    return Sector(shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle)


def _shapes_and_sector(rigid: RigidShoe, shapes: Array, angle: Any) -> tuple[Any, Sector]:
    """Shapes and sizes of JAX, or of NumPy where the angles are."""
    sector = _sector(rigid)
    return (shapes, sector) if isinstance(angle, Array) else (np.asarray(shapes), Sector(*map(float, sector)))


def _on_drum(angle: Any, position: Scalar) -> Any:
    """Angles on the drum (rad) of angles on a lining whose middle is at a position, of NumPy where these are."""
    return angle + (position if isinstance(angle, Array) else float(position))


def _over_drum_each(
    rigid: RigidShoe, shapes: Array, drum: ElasticDrum | None, position: Scalar, angle: Any, z: Any
) -> Any:
    """u_r, u_θ, u_z of the lining relative to the drum (3, n, N) at points, for 1 of each coordinate."""
    xp = jnp if isinstance(angle, Array) else np
    own, sector = _shapes_and_sector(rigid, shapes, angle)
    each = [rigid.displacement({name: 1.0}, angle, z) for name in rigid.names]
    levels = [[xp.broadcast_to(xp.asarray(shape[k]), angle.shape) for shape in each] for k in range(3)]
    columns = [xp.stack([xp.stack([*parts, angle])[:-1] for parts in levels])]  # of a shoe that may have no such name
    radius = xp.full_like(angle, 1.0) * sector.outer_radius
    columns.append(xp.moveaxis(shapes_at(own, sector, radius, angle, z), 0, -1))
    if drum is not None:
        columns.append(-xp.moveaxis(drum.shapes_at(_on_drum(angle, position), z), 0, -1))
    return xp.concatenate(columns, axis=1)
