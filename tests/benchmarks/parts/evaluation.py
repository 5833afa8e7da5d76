"""What one evaluation of the forces costs: three coordinates against six, below the contact boundaries and beyond them.

Evaluations follow one another within one kernel, as they do in a transient, and each waits for the one before. All
configurations take turns, and of each the fastest round counts. Compilation is timed apart. The error of each contact
force stands beside its time: it is the largest over the states, relative to p0 times the area (moments: times R),
against the same rule with many more nodes (the tests compare that with adaptive quadrature written independently).
"""

import dataclasses
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import drumsqueal.precision  # noqa: F401 (double precision, before JAX computes)

# isort: split
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.bodies.body import Motion, scalars
from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.model import Model, build_model
from drumsqueal.physics.quadrature.arc import ArcSurface
from drumsqueal.physics.quadrature.area import AreaSurface
from drumsqueal.programs import compiled, one_kernel
from drumsqueal.scene import COORDINATES, load_scene
from drumsqueal.simulation import prepare, transient

from .record import Record
from .scenes import FREQUENCY, SCENARIOS, SHAPE, SIZES

ROUNDS, STATES = 15, 64
FINER = {"plane": ArcSurface(24), "space": AreaSurface(24, 16, 40, 5, always_split=True)}
SATURATED_STATES, LONGEST, LARGEST_ERROR = 400, 15e-6, 1e-8  # of motion in space; s and of the load, as asked for


class Configuration(NamedTuple):
    """A model and the states that it is evaluated at (states, n)."""

    coordinates: str
    motion: str
    model: Model
    q: Array
    v: Array


def measure(record: Record, folder: Path) -> None:
    """Measure, print and judge."""
    del folder
    everyone = list(configurations())
    rows, plane = [], {}
    for each, (compiling, seconds) in zip(everyone, take_turns(everyone), strict=True):
        error, best = error_of(each), min(seconds)
        name = f"{each.coordinates}, {each.motion}"
        record.keep("evaluation", name, "time of an evaluation", "s", seconds)
        record.keep("evaluation", name, "largest error over the load", "1", error)
        record.keep("evaluation", name, "compiling", "s", compiling)
        ratio = best / plane.setdefault(each.motion, best)
        scatter = np.median(seconds) / best
        rows.append([name, f"{1e6 * best:.3g}", f"{scatter:.2f}", f"{ratio:.3g}", f"{error:.1e}", f"{compiling:.1f}"])
    headings = ("motion", "fastest µs", "median over it", "over the plane", "error", "compiling s")
    record.show("One evaluation of the forces", headings, rows)
    wanted = f"saturated motion in space: {1e6 * LONGEST:g} µs at an error of {LARGEST_ERROR:g} of the load"
    met = best <= LONGEST and error <= LARGEST_ERROR
    record.aim("evaluation", wanted, f"{1e6 * best:.3g} µs, {error:.1e}", met, f"by {best / LONGEST:.2g} times")


def configurations() -> Iterator[Configuration]:
    """Three and six coordinates at the same states, and then six at those of a saturated motion."""
    scene = load_scene(SCENARIOS / "nominal.toml")
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, (STATES, 6))
    for motion, size in SIZES.items():
        q, v = size * SHAPE * np.sin(phase), size * SHAPE * FREQUENCY * np.cos(phase)
        for coordinates, names in (("plane", IN_PLANE), ("space", COORDINATES)):
            model, kept = build_model(scene, coordinates=names), [COORDINATES.index(name) for name in names]
            yield Configuration(coordinates, motion, model, jnp.asarray(q[:, kept]), jnp.asarray(v[:, kept]))
    start = {"start.displacement": {"Y": 5e-5, "Tx": 1e-5}, "simulate.duration": 0.05}
    scene = load_scene(SCENARIOS / "out_of_plane.toml").with_values(start)
    chunks = list(transient(prepare(scene)))
    states = (np.concatenate([getattr(each, name) for each in chunks]) for name in ("displacement", "velocity"))
    evenly = np.linspace(0, 2500, SATURATED_STATES).astype(int)
    q, v = (jnp.asarray(each[evenly]) for each in states)
    yield Configuration("space", "saturated motion", build_model(scene), q, v)


def take_turns(everyone: list[Configuration]) -> list[tuple[float, list[float]]]:
    """Seconds that each takes to compile, and an evaluation in each round."""
    some, repeats, compiling = 5, [], []
    for each in everyone:
        first, again = (_timed(each, some) for _ in range(2))
        compiling.append(max(first - again, 0.0))
        repeats.append(max(1, round(0.05 * some / again)))  # some 50 ms a round, for the call takes 0.1
    rounds = [[_timed(each, n) for each, n in zip(everyone, repeats, strict=True)] for _ in range(ROUNDS)]
    seconds = np.array(rounds) / (np.array(repeats) * [len(each.q) for each in everyone])
    return list(zip(compiling, seconds.T.tolist(), strict=True))


def _timed(each: Configuration, times: int) -> float:
    before = time.perf_counter()
    jax.block_until_ready(evaluate(each.model, each.q, each.v, jnp.asarray(times)))
    return time.perf_counter() - before


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


def error_of(configuration: Configuration) -> float:
    """Largest error of the contact force over the states, against the same rule with many more nodes."""
    return error_against(
        configuration, dataclasses.replace(configuration.model.lining, surface=FINER[configuration.coordinates])
    )


def error_against(configuration: Configuration, contact: Contact) -> float:
    """Largest difference of the contact force over the states from that of a finer contact, over the load."""
    model = configuration.model
    finer = dataclasses.replace(model, contact=contact)
    difference = forces(model, configuration.q, configuration.v) - forces(finer, configuration.q, configuration.v)
    reach = [model.shoe.characteristic_lengths()[name] for name in model.names]
    load = float(model.operation.at(0.0).preload * model.shoe.area)
    return float(np.max(np.abs(np.asarray(difference)) / reach) / load)


@eqx.filter_jit
def forces(model: Model, q: Array, v: Array) -> Array:
    """The contact's force at each state (states, 6)."""
    return jax.lax.map(lambda state: jnp.stack([*map(jnp.asarray, _contact(model, *state))]), (q, v))


def _contact(model: Model, q: Array, v: Array) -> Motion:
    return model.contact.act(model.operation.at(0.0), scalars(q), scalars(v)).force
