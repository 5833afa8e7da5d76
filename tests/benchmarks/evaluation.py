"""What one evaluation of the forces costs: three coordinates against six, below the edges and beyond them.

Run it with `python tests/benchmarks/evaluation.py`. Evaluations follow one another within one kernel, as they do in a
transient, and each waits for the one before. All contenders take turns in one process, so that a noisy machine slows
them alike, and of each the fastest round counts. Compilation is timed apart. The error of each contact force stands
beside its time: it is the largest over the states, relative to p0 times the area (moments: times R), against the same
rule with three times the nodes (the tests compare that with adaptive quadrature written independently).
"""

import dataclasses
import time
from pathlib import Path
from typing import NamedTuple

import drumsqueal.precision  # noqa: F401 (double precision, before JAX computes)

# isort: split
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.physics.bodies.body import Motion, scalars
from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.kernel import compiled, one_kernel
from drumsqueal.physics.laws.friction_law import FrictionLaw
from drumsqueal.physics.model import Model, build_model
from drumsqueal.physics.quadrature.arc import ArcSurface
from drumsqueal.physics.quadrature.area import AreaSurface
from drumsqueal.scene import COORDINATES, load_scene

SCENE = Path(__file__).parents[2] / "scenarios" / "nominal.toml"
ROUNDS, STATES = 15, 64
# Amplitude of the velocity (m/s) over ω q and of the displacement (m, rad) of X, Y, Z, Tx, Ty, Tz, as in the growth
# phase and as in the saturated motion of the scene; out of the plane a tenth of it.
SHAPE = np.array([2.5e-6, 5e-5, 1e-6, 1e-5, 1e-5, 1e-4])
FREQUENCY = 2 * np.pi * np.array([4400.0, 1100.0, 300.0, 300.0, 1100.0, 1100.0])
SIZES = {"below the edges": 0.02, "beyond them": 1.0}


class Cut(eqx.Module):
    """A friction law that says it has a kink at a slip speed: the lining is split, whether it has edges or not."""

    law: FrictionLaw
    speed: Array

    def coefficient(self, slip_speed: Array) -> Array:
        """That of the law."""
        return self.law.coefficient(slip_speed)

    def breakpoints(self) -> Array:
        """The one slip speed."""
        return self.speed[None]


class Contender(NamedTuple):
    """A model and the states that it is evaluated at (states, n)."""

    coordinates: str
    regime: str
    model: Model
    q: Array
    v: Array


@compiled
def evaluate(model: Model, q: Array, v: Array, times: Array) -> Array:
    """Sum of all forces over the states, run through `times` times; to fetch a state takes some ns of it."""
    return one_kernel(_chain, model, q, v, times)


def _chain(model: Model, q: Array, v: Array, times: Array) -> Array:
    def one(k: Array, total: Array) -> Array:
        # A difference beyond the last digit, so that an evaluation waits for the one before.
        force, power = model.act(0.0, q[k] + 1e-40 * total, v[k])
        return total + force + power

    def all_states(_: Array, total: Array) -> Array:
        return jax.lax.fori_loop(0, len(q), one, total)

    return jax.lax.fori_loop(0, times, all_states, jnp.zeros(q.shape[1]))


@eqx.filter_jit
def forces(model: Model, q: Array, v: Array) -> Array:
    """The contact's force at each state."""
    wide = jax.vmap(lambda q, v: jnp.stack([*map(jnp.asarray, _contact(model, q, v))]))
    return wide(q, v)


def _contact(model: Model, q: Array, v: Array) -> Motion:
    return model.contact.act(model.operation.at(0.0), scalars(q), scalars(v)).force


def contenders() -> list[Contender]:
    """Three and six coordinates of the scene, at states of both regimes."""
    scene = load_scene(SCENE)
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, (STATES, 6))
    found = []
    for regime, size in SIZES.items():
        q, v = size * SHAPE * np.sin(phase), size * SHAPE * FREQUENCY * np.cos(phase)
        for names in (IN_PLANE, COORDINATES):
            model, kept = build_model(scene, coordinates=names), [COORDINATES.index(name) for name in names]
            found.append(Contender(str(len(kept)), regime, model, jnp.asarray(q[:, kept]), jnp.asarray(v[:, kept])))
    return found


def error_of(contender: Contender) -> float:
    """Largest error of the contact force over the states, against the model's own rule made finer."""
    model = contender.model
    finer = ArcSurface(24) if isinstance(model.lining.surface, ArcSurface) else AreaSurface(16, 12, 24, 5)
    assert model.contact.friction is not None
    drum = model.shoe.outer_radius * jnp.abs(model.operation.at(0.0).drum_speed)
    friction = dataclasses.replace(model.contact.friction, law=Cut(model.contact.friction.law, drum))
    sharp = dataclasses.replace(model, contact=dataclasses.replace(model.lining, surface=finer, friction=friction))
    difference = forces(contender.model, contender.q, contender.v) - forces(sharp, contender.q, contender.v)
    scale = float(model.operation.at(0.0).preload * model.shoe.area) * np.array([1.0] * 3 + [0.1] * 3)
    return float(np.max(np.abs(np.asarray(difference)) / scale))


def measure() -> list[tuple[Contender, float, float, float]]:
    """Each contender with seconds to compile, seconds an evaluation, and its error."""
    everyone, rows = contenders(), []
    repeats, compiling, some = [], [], 20
    for each in everyone:
        before = time.perf_counter()
        jax.block_until_ready(evaluate(each.model, each.q, each.v, jnp.asarray(some)))
        once = time.perf_counter()
        jax.block_until_ready(evaluate(each.model, each.q, each.v, jnp.asarray(some)))
        again = time.perf_counter() - once
        compiling.append(once - before - again if each.regime == next(iter(SIZES)) else 0.0)  # one program for both
        repeats.append(jnp.asarray(max(1, round(0.05 * some / again))))  # some 50 ms a round, for the call takes 0.1
    best = [np.inf] * len(everyone)
    for _ in range(ROUNDS):
        for k, each in enumerate(everyone):
            before = time.perf_counter()
            jax.block_until_ready(evaluate(each.model, each.q, each.v, repeats[k]))
            best[k] = min(best[k], (time.perf_counter() - before) / int(repeats[k]) / STATES)
    for each, seconds, first in zip(everyone, best, compiling, strict=True):
        rows.append((each, first, seconds, error_of(each)))
    return rows


def main() -> None:
    """Print the table."""
    table = Table(title="One evaluation of the forces", box=box.SIMPLE_HEAD)
    for heading in ("motion", "coordinates", "time µs", "ratio", "error", "compiling s"):
        table.add_column(heading, justify="left" if heading == "motion" else "right")
    plane: dict[str, float] = {}
    for each, first, seconds, error in measure():
        plane.setdefault(each.regime, seconds)
        ratio = seconds / plane[each.regime]
        table.add_row(
            each.regime,
            each.coordinates,
            f"{1e6 * seconds:.3g}",
            f"{ratio:.3g}",
            f"{error:.1e}",
            f"{first:.1f}" if first > 0 else "the same program",
        )
    Console().print(table)


if __name__ == "__main__":
    main()
