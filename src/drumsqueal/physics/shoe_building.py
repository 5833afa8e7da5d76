"""Bodies and surfaces of a model by its numbers and by a composition, which says without numbers what is in it.

The composition decides what is in the compiled program; `composition.py` reads it off a scene.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.coordinates import is_elastic, is_of_drum, number_of
from drumsqueal.physics.bodies.drum_modes import ElasticDrum
from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.bodies.rigid_shoe import RigidMesh, RigidShoe
from drumsqueal.physics.quadrature.arc import NODES, NODES_LONG_ARC, ArcSurface
from drumsqueal.physics.quadrature.area import AreaSurface
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.physics.quadrature.surface import Surface
from drumsqueal.scene import COORDINATES
from drumsqueal.scene.shoes import key_alone

GIVEN = "given in Python"  # in place of the name of a friction law


class Composition(NamedTuple):
    """Coordinates (by name) and effects of a model; hashable, so that it can be static."""

    coordinates: tuple[str, ...]
    long_arc: bool = False
    separation: bool = False
    friction_law: str | None = None
    friction_direction: str | None = None
    steady_state: str = "uniform-pressure"
    support: bool = False
    damping: bool = False
    temperature: bool = False
    forced: tuple[str, ...] = ()
    springs: int = 0
    pushes: int = 0
    planar: bool = True
    symmetric_modes: tuple[bool, ...] = ()
    mesh: bool = False
    shoes: tuple["ShoeComposition", ...] = ()


class ShoeComposition(NamedTuple):
    """What one of several shoes calls for: alone, and under which names its coordinates and its numbers stand."""

    number: int
    prefix: str
    own: tuple[str, ...]
    composition: Composition

    def of(self, coordinates: tuple[str, ...]) -> Composition:
        """Its composition over those of a brake's coordinates that are its own, or the drum's."""
        mine = (name for name in coordinates if is_of_drum(name) or name.startswith(self.prefix))
        return self.composition._replace(coordinates=tuple(name.removeprefix(self.prefix) for name in mine))

    def values(self, numbers: Mapping[str, Any]) -> dict[str, Any]:
        """The numbers of a brake by the keys that it has alone; `shoe.position` is its angle on the drum."""
        prefix = f"shoe.{self.number}."
        found = {key: each for key, each in numbers.items() if key.partition(".")[0] not in ("shoe", *self.own)}
        return found | {key_alone(key): each for key, each in numbers.items() if key.startswith(prefix)}


# Of bodies, among a model's numbers.
WAVENUMBERS, SHAPES = "shoe.elastic.wavenumbers", "shoe.elastic.shapes"
MESH = "shoe.mesh."
DRUM_WAVENUMBERS, DRUM_SHAPES = "drum.elastic.wavenumbers", "drum.elastic.shapes"
MODAL = ".elastic.shapes"  # with which the keys of both end, of several shoes, too


def build_shoe(composition: Composition, value: Mapping[str, Array]) -> RigidShoe:
    """The body over its kept coordinates, rigid unless one of them is elastic."""
    names = composition.coordinates
    sizes = (value[f"shoe.{key}"] for key in ("outer_radius", "thickness", "width", "arc_angle", "density"))
    own = tuple(name for name in names if name in COORDINATES)
    if composition.mesh:
        solid = {key: value[f"{MESH}{key}"] for key in ("centre", "moments", "axes")}
        rigid = RigidMesh(*sizes, names=own, m=value[f"{MESH}mass"], **solid)
    else:
        rigid = RigidShoe(*sizes, names=own)
        if len(own) == len(names) and "shoe.position" not in value:
            return rigid
    elastic = tuple(name for name in names if is_elastic(name) and not is_of_drum(name))
    kept = np.array([number_of(name) - 1 for name in elastic], dtype=int)
    frequencies, shapes = jnp.zeros(0), jnp.zeros((0, 3, 1, 1, 1))
    if elastic and composition.mesh:
        frequencies = 2 * jnp.pi * value[f"{MESH}frequencies"][kept]
        shapes = value[f"{MESH}shapes"][kept][:, :, None]  # alike at all radii: only the lining is known
    elif elastic:
        density = value["shoe.density"]
        frequencies = jnp.sqrt(value["shoe.elastic.young"] / density) * value[WAVENUMBERS][kept]
        shapes = value[SHAPES][kept] / jnp.sqrt(density)
    even = tuple(composition.symmetric_modes[k] for k in kept)
    drum = _drum(composition, value)
    # Trial shapes of a shoe at a place of a drum that is not here, the shapes of which may have more degrees.
    cells = Cells() if "shoe.position" in value and drum is None else None
    position = value.get("shoe.position", 0.0)
    return ElasticShoe.of(rigid, elastic, frequencies, shapes, even, drum, cells, position)


def _drum(composition: Composition, value: Mapping[str, Array]) -> ElasticDrum | None:
    """The modes of the drum that are kept; None where there are none."""
    names = tuple(name for name in composition.coordinates if is_of_drum(name))
    if not names:
        return None
    kept = np.array([number_of(name) - 1 for name in names])
    table = "drum.mesh" if "drum.mesh.young" in value else "drum.elastic"
    young, density, width, offset = (value[f"{table}.{key}"] for key in ("young", "density", "width", "offset"))
    frequencies = jnp.sqrt(young / density) * value[DRUM_WAVENUMBERS][kept]
    return ElasticDrum(names, frequencies, value[DRUM_SHAPES][kept] / jnp.sqrt(density), width, offset)


def along_points(composition: Composition, value: Mapping[str, Array], shoe: RigidShoe) -> tuple[Array, Array]:
    """d_j·φ_i(P_j) of the patches of springs and of forces, (count, n) each; the shapes there are compiled once."""
    keys = [f"shoe.spring.{k}" for k in range(composition.springs)]
    keys += [f"shoe.force.{k}" for k in range(composition.pushes)]
    if not keys:
        return jnp.zeros((0, len(shoe.names))), jnp.zeros((0, len(shoe.names)))
    at, directions = (jnp.stack([value[f"{key}.{what}"] for key in keys]) for what in ("at", "direction"))
    radii = jnp.stack([value.get(f"{key}.radius", jnp.zeros(())) for key in keys])  # none of a rigid shoe
    moved = jax.vmap(shoe.shapes_at)(at, radii)
    if composition.mesh:  # whose shapes are known at these points alone
        modes = [k for k, name in enumerate(shoe.names) if is_elastic(name) and not is_of_drum(name)]
        kept = np.array([number_of(shoe.names[k]) - 1 for k in modes], dtype=int)
        moved = moved.at[:, :, np.array(modes, dtype=int)].set(value[f"{MESH}points"][..., kept])
    along = jnp.einsum("kx,kxn->kn", directions, moved)
    return along[: composition.springs], along[composition.springs :]


def spring_matrix(composition: Composition, value: Mapping[str, Array], along: Array, what: str) -> Array:
    """Σ_j k_j g_j g_jᵀ (n, n) by the "stiffness" or the "damping" of springs; g_j are rows of `along` (k, n)."""
    strengths = jnp.stack([value[f"shoe.spring.{k}.{what}"] for k in range(composition.springs)])
    return jnp.sum(strengths[:, None, None] * along[:, :, None] * along[:, None, :], axis=0)


def surface_of(composition: Composition, shoe: RigidShoe) -> Surface:
    """Where the contact of a shoe is integrated: along lines, or over the lining."""
    if isinstance(shoe, ElasticShoe):
        return shoe.cells
    return ArcSurface(NODES_LONG_ARC if composition.long_arc else NODES) if all(shoe.symmetric) else AreaSurface()
