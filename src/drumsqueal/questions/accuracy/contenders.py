"""What a study of accuracy tries: methods and tolerances, quadratures, and friction smoothed about its reversal."""

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.laws.friction_law import FrictionLaw
from drumsqueal.physics.model import Model
from drumsqueal.physics.quadrature.arc import ArcSurface
from drumsqueal.physics.quadrature.area import AreaSurface
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.physics.quadrature.independent import FixedGrid
from drumsqueal.precision import real
from drumsqueal.solve.transient.runge_kutta import DEFAULT, SOLVERS, is_explicit

STEPPING, QUADRATURE, SMOOTHING = "time stepping", "contact quadrature", "smoothed friction"
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
NODES = (2, 4, 6, 8, 12, 16)  # along each piece of the arc, or each half of it in space, split at contact boundaries
CELLS_ALONG = (2, 4, 8, 12)  # of a lining that bends, with as many across in proportion
GRID = (20, 40, 80, 160, 320, 640)  # nodes of a grid that does not know the contact boundaries
WIDTHS = (1e-1, 1e-2, 1e-3, 1e-4)  # of the smoothing, over the speed of the drum's surface
OTHERS = 1e-6  # tolerance of those that are not about time stepping; at less a fixed grid does not get through
SPLIT, FIXED, CELLS, SMOOTHED = "split lining", "fixed grid", "cells", "smoothed"


class SmoothedDirection(eqx.Module):
    """F = −μ(|V|) N V/√(|V|² + ε²): friction without its jump where slip reverses; ε in m/s."""

    width: Array = eqx.field(converter=real)
    knows_axial: bool = eqx.field(static=True)

    def traction(
        self, law: FrictionLaw, pressure: Array, slip: Array, axial: Array | None
    ) -> tuple[Array, Array | None]:
        """Tractions along θ and z (Pa) at slip velocity V_θ, V_z (m/s; None for motion in the plane)."""
        squared = slip * slip if axial is None else slip * slip + axial * axial
        moving = squared > 0
        speed = jnp.where(moving, jnp.sqrt(jnp.where(moving, squared, 1.0)), 0.0)
        fraction = -law.coefficient(speed) * pressure / jnp.sqrt(squared + self.width**2)
        return fraction * slip, None if axial is None else fraction * axial


@dataclass(frozen=True)
class Contender:
    """One way to run a scene: the cause of error it is about, its line in the figure and its place on it."""

    cause: str
    line: str
    setting: float
    solver: str
    tolerance: float
    model: Model

    @property
    def whole(self) -> bool:
        """Whether it runs the whole record, for its features; others run as far as the reference goes."""
        return self.cause == STEPPING and is_explicit(self.solver)

    @property
    def name(self) -> str:
        """What it is, in a word or two."""
        nodes = " along" if self.line == CELLS else " nodes"
        unit = {STEPPING: "", QUADRATURE: nodes, SMOOTHING: " of RΩ"}[self.cause]
        return f"{self.line}, {self.setting:g}{unit}"


def contenders_of(model: Model, solvers: Sequence[str] = ()) -> Iterator[list[Contender]]:
    """The lines of the study, with further `solvers`, each from its cheapest contender to its dearest."""
    for solver in dict.fromkeys((*SOLVERS, *solvers)):
        yield [Contender(STEPPING, solver, tolerance, solver, tolerance, model) for tolerance in TOLERANCES]
    yield from _quadratures(model)
    friction = model.contact.friction
    if friction is not None:
        surface_speed = float(model.contact.radius * jnp.abs(model.operation.at(0.0).drum_speed))
        smoothed = []
        for width in WIDTHS:
            direction = SmoothedDirection(width * surface_speed, friction.direction.knows_axial)
            contact = dataclasses.replace(model.lining, friction=dataclasses.replace(friction, direction=direction))
            changed = dataclasses.replace(model, contact=contact)
            smoothed.append(Contender(SMOOTHING, SMOOTHED, width, "dopri8", OTHERS, changed))
        yield smoothed


def _quadratures(model: Model) -> Iterator[list[Contender]]:
    """Lines of nodes, split at the boundaries and not; of a lining that bends, cells: it has no other rule."""
    cells, spatial = model.lining.surface, model.lining.surface.spatial

    def contender(line: str, setting: int, contact: Contact) -> Contender:
        return Contender(QUADRATURE, line, setting, DEFAULT, OTHERS, dataclasses.replace(model, contact=contact))

    if isinstance(cells, Cells):
        yield [contender(CELLS, n, model.lining.on_cells(n / cells.along, n / cells.along)) for n in CELLS_ALONG]
        return
    split = {n: AreaSurface(n, max(2, n // 2), n) if spatial else ArcSurface(n) for n in NODES}
    for line, surfaces in ((SPLIT, split), (FIXED, {n: FixedGrid(n, spatial) for n in GRID})):
        yield [contender(line, n, dataclasses.replace(model.lining, surface=each)) for n, each in surfaces.items()]
