"""What a shoe that bends costs: an evaluation by its modes and points, programs by its modes, a run with figures.

The modes are those of the nominal shoe in steel up to several frequencies, the points those at which the lining is
known: 4 lines of half the width times 7 in each cell along, in space 9 by 9 in each of 6 cells. States are seeded:
rigid motion as in `scenes.py`, and modes that move the lining by a micrometre together. Evaluations follow one another
within one kernel, as in `evaluation.py`; errors are against 4 times the cells with 3 more nodes along them.
"""

import dataclasses
import tempfile
import time
from pathlib import Path

import drumsqueal.precision  # noqa: F401 (double precision, before JAX computes)

# isort: split
import jax.numpy as jnp
import numpy as np

from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.composition import coordinates_of, kept_coordinates
from drumsqueal.physics.model import Model, build_model
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.physics.quadrature.lines import LineCells
from drumsqueal.scene import COORDINATES, Scene, load_scene
from drumsqueal.simulation import Prepared, prepare, transient

from .evaluation import Configuration, error_against, take_turns
from .record import Record
from .scenes import FREQUENCY, SCENARIOS, SHAPE, SIZES
from .start import seconds_of

UP_TO = (6e3, 12e3, 20e3, 30e3)  # Hz
TIMES_CELLS = (0.5, 1, 2, 4)
USUAL = 12e3
STATES = 64
LEVEL = 1e-6  # m, by which the modes move the lining together
FINER = 4, 2, 3  # times the cells along, times the lines across, more nodes along each cell
LARGEST_ERROR = 1e-6  # of the load, as asked for
COMPILED_IN, RUN_IN = 20.0, 60.0  # s, as asked for
STEEL = "shoe.elastic={young='210 GPa', poisson=0.3, up_to='12 kHz'}"


def measure(record: Record, folder: Path) -> None:
    """Measure, print and judge."""
    del folder
    _by_points(record)
    _by_modes(record)
    _whole_run(record)


def bending(up_to: float) -> Scene:
    """The nominal scene with the shoe's modes up to some frequency (Hz)."""
    elastic = {"young": 210e9, "poisson": 0.3, "up_to": up_to}
    return load_scene(SCENARIOS / "nominal.toml").with_values({"shoe.elastic": elastic})


def configuration(scene: Scene, names: tuple[str, ...], size: str, times_cells: float = 1) -> Configuration:
    """A model over these coordinates, its lining in so many times the cells along, and states of that size."""
    model = with_cells(build_model(scene, coordinates=names), times_cells)
    shoe = model.shoe
    assert isinstance(shoe, ElasticShoe)
    rigid = [COORDINATES.index(name) for name in names if name in COORDINATES]
    modes = names[len(rigid) :]
    lever = np.array([shoe.characteristic_lengths()[name] for name in modes])
    amplitude = SIZES[size] * np.concatenate([SHAPE[rigid], LEVEL / lever / np.sqrt(len(modes))])
    frequency = np.concatenate([FREQUENCY[rigid], np.asarray(shoe.frequencies)])
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, (STATES, len(names)))
    states = jnp.asarray(amplitude * np.sin(phase)), jnp.asarray(amplitude * frequency * np.cos(phase))
    return Configuration("plane" if isinstance(shoe.cells, LineCells) else "space", size, model, *states)


def with_cells(model: Model, along: float, across: float = 1, more: int = 0) -> Model:
    """The model with so many times the cells, see `Contact.on_cells`."""
    return dataclasses.replace(model, contact=model.lining.on_cells(along, across, more))


def cells_of(each: Configuration) -> Cells:
    """Those of its lining."""
    cells = each.model.lining.surface
    assert isinstance(cells, Cells)
    return cells


def _by_points(record: Record) -> None:
    """How error and time go with the number of points at which the lining is known."""
    scene = bending(USUAL)
    plane, space = kept_coordinates(scene), coordinates_of(scene)
    kinds = [*((plane, n) for n in TIMES_CELLS), (space, 1)]
    sizes = [(*kind, size) for kind in kinds for size in SIZES]
    everyone = [configuration(scene, names, size, n) for names, n, size in sizes]
    rows, usual = [], 0.0
    for (_, times, _), each, (_, seconds) in zip(sizes, everyone, take_turns(everyone), strict=True):
        cells, error = cells_of(each), error_against(each, with_cells(each.model, *FINER).lining)
        name = f"{each.coordinates}, {cells.along} cells along, {cells.count} points, {each.motion}"
        record.keep("bending", name, "time of an evaluation", "s", seconds)
        record.keep("bending", name, "largest error over the load", "1", error)
        rows.append([name, f"{1e6 * min(seconds):.3g}", f"{np.median(seconds) / min(seconds):.2f}", f"{error:.1e}"])
        if times == 1:
            usual = max(usual, error)
    wanted = f"shoe that bends, by default: error of {LARGEST_ERROR:g} of the load"
    record.aim("bending", wanted, f"{usual:.1e}", usual <= LARGEST_ERROR, f"by {usual / LARGEST_ERROR:.2g} times")
    title = f"One evaluation of a shoe that bends, {len(plane)} coordinates in the plane and {len(space)} in space"
    record.show(title, ("lining", "fastest µs", "median over it", "error"), rows)


def _by_modes(record: Record) -> None:
    """How time goes with the number of modes, and what compiles."""
    scenes = {up_to: bending(up_to) for up_to in UP_TO}
    kinds = [(up_to, names(scene)) for names in (kept_coordinates, coordinates_of) for up_to, scene in scenes.items()]
    everyone = [configuration(scenes[up_to], names, size) for up_to, names in kinds for size in SIZES]
    taken, rows = take_turns(everyone), []
    longest: dict[str, float] = {}
    for k, (up_to, names) in enumerate(kinds):
        first = len(SIZES) * k
        each, times = everyone[first], [seconds for _, seconds in taken[first : first + len(SIZES)]]
        name = f"{len(names)} coordinates, {each.coordinates}"
        for size, seconds in zip(SIZES, times, strict=True):
            record.keep("bending", name, f"time of an evaluation, {size}", "s", seconds)
        compiling = _compiling(scenes[up_to], names)
        longest[each.coordinates] = max(longest.get(each.coordinates, 0.0), compiling)
        record.keep("bending", name, "compiling the transient", "s", compiling)
        fastest = [f"{1e6 * min(seconds):.3g}" for seconds in times]
        numbers = [f"{up_to / 1e3:.0f}", f"{cells_of(each).count}", *fastest]
        rows.append([name, *numbers, f"{taken[first][0]:.1f}", f"{compiling:.1f}"])
    headings = ("shoe", "modes up to kHz", "points", *(f"µs {size}" for size in SIZES), "forces: compiling s")
    record.show("A shoe that bends, by its modes", (*headings, "transient: compiling s"), rows)
    for where, seconds in longest.items():
        wanted = f"shoe that bends, transient in {where}: {COMPILED_IN:g} s to compile, however many modes"
        missed = f"by {seconds / COMPILED_IN:.2g} times"
        record.aim("bending", wanted, f"{seconds:.1f} s", seconds <= COMPILED_IN, missed)


def _compiling(scene: Scene, names: tuple[str, ...]) -> float:
    """Seconds to compile the transient, which is what its first samples take more than the ones after (s)."""
    short = {"simulate.coordinates": list(names), "simulate.duration": 4e-5}
    return first_samples(prepare(scene.with_values(short | {"start.displacement": {"Y": 1e-7}, "start.velocity": {}})))


def first_samples(prepared: Prepared) -> float:
    """Seconds by which a transient takes longer the first time than the second."""
    times = []
    for _ in range(2):
        before = time.perf_counter()
        for _ in transient(prepared):
            pass
        times.append(time.perf_counter() - before)
    return times[0] - times[1]


def _whole_run(record: Record) -> None:
    """The nominal scene with modes up to 12 kHz, from Enter to the figures: first with nothing kept, then again."""
    with tempfile.TemporaryDirectory() as scratch:
        arguments = ("run", str(SCENARIOS / "nominal.toml"), "--set", STEEL, "-o", "run", "--overwrite")
        for kind in ("cold", "warm"):
            seconds = seconds_of(Path(scratch), arguments)
            record.keep("bending", f"drumsqueal run, {kind}", "time", "s", seconds)
            wanted = f"nominal run of 0.4 s, modes up to 12 kHz, {kind}: {RUN_IN:g} s"
            record.aim("bending", wanted, f"{seconds:.0f} s", seconds <= RUN_IN, f"by {seconds - RUN_IN:.0f} s")
