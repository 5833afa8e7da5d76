"""What the contact asks of a quadrature over the lining."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

from jax import Array

from drumsqueal.bodies.rigid_shoe import RigidShoe
from drumsqueal.quadrature.levels import Level
from drumsqueal.quadrature.sums import Densities


class Nodes(NamedTuple):
    """Quadrature nodes on the lining: cos θ, sin θ, z (m, None on the line z = 0) and weight (m²)."""

    cosine: Array
    sine: Array
    z: Array | None
    weight: Array


class Edges(NamedTuple):
    """The levels whose roots are edges: p0 + k_c u_r, V_θ, and V_z beside it (None: no edges of that kind).

    Where the pressure's level is negative the lining does not press; V_z is the same all across the lining.
    """

    pressure: Level | None
    slip: Level | None
    axial: Level | None


class Surface(Protocol):
    """A quadrature; `spatial` says whether it knows that the lining is wide."""

    @property
    def spatial(self) -> bool:
        """Whether the nodes differ across the lining."""
        ...

    def integrate(
        self, shoe: RigidShoe, edges: Edges, densities: Callable[[Nodes], Densities], *, smooth: bool
    ) -> Densities:
        """Sums over the lining of densities times weights; `smooth` says that they are so between the edges."""
        ...
