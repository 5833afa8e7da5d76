"""The time history: what a transient recorded, as an xarray Dataset."""

import importlib.metadata
import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from drumsqueal.coordinates import COORDINATES, is_of_drum, shoe_of, units_of
from drumsqueal.errors import Ending, Outcome, RequestError
from drumsqueal.physics.composition import coordinates_of
from drumsqueal.physics.effects.effect import BY_SHOE
from drumsqueal.scene import Scene
from drumsqueal.solve.transient.integrate import Chunk

if TYPE_CHECKING:
    import xarray

# name: (what is added to the units of displacements, what it is), of each coordinate
MOTION = {
    "displacement": ("", "displacement and rotation of the shoe at its centre of gravity"),
    "velocity": ("/s", "rates of displacement and rotation"),
}
# name: (units, what it is)
SIGNALS = {
    "brake_torque": ("N m", "torque of friction that brakes the drum, R times the integral of its tangential traction"),
    "normal_force": ("N", "integral of the contact pressure over the lining"),
    "contact_fraction": ("1", "fraction of the lining that touches the drum"),
    "slip_reversed_fraction": ("1", "fraction of the lining that touches the drum and moves faster than it"),
    "smallest_pressure": ("Pa", "smallest contact pressure on the lining"),
    "friction_power": ("W", "power that friction turns into heat"),
    "sticking": ("1", "1 while the whole lining moves with the drum, held by friction, 0 while it slips"),
    "implicit": ("1", "1 where the implicit method was called for, 0 elsewhere; it is so for 500 samples at a time"),
    "kinetic_energy": ("J", "kinetic energy of the shoe"),
    "potential_energy": ("J", "energy stored in lining, supports and preload, relative to q = 0"),
    "energy_balance_error": ("J", "change of stored energy less the work that friction, damping and loads fed in"),
}
TEMPERATURE = {"lining_temperature": ("K", "rise of the lining's temperature over that of its surroundings")}
RUNNING = Outcome(Ending.CUT_OFF, "incomplete: the run was killed")


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that make the numbers."""
    return {"python": platform.python_version()} | {
        name: importlib.metadata.version(name)
        for name in ("drumsqueal", "jax", "jaxlib", "diffrax", "equinox", "numpy", "scipy", "xarray")
    }


def signals_of(scene: Scene) -> dict[str, tuple[str, str]]:
    """Signals that the history of a scene has besides the motion: units and meaning by name."""
    return SIGNALS | signals_by_shoe(scene.prefixes) | ({} if scene.temperature is None else TEMPERATURE)


def signals_by_shoe(prefixes: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Signals of each of several shoes, whose names begin with these prefixes; none where there is one, without."""
    return {
        f"{prefix}{name}": (SIGNALS[name][0], f"{prefix.removesuffix('.')}: {SIGNALS[name][1]}")
        for prefix in prefixes
        if prefix
        for name in BY_SHOE
    }


def memory_of(history: "xarray.Dataset", names: Sequence[str]) -> np.ndarray | None:
    """What effects remembered (time, m), by the names that these give it; None where there are no names."""
    return np.stack([history[name].values for name in names], axis=1) if names else None


def to_dataset(chunks: Sequence[Chunk], scene: Scene, kept: Sequence[str], outcome: Outcome) -> "xarray.Dataset":
    """Put the chunks of one run, over the kept coordinates, into one Dataset; left-out coordinates are zero.

    Dimensions time (s) and coordinate (all names of the scene's body). The scene as it was run, the versions and the
    outcome are in the attributes.
    """
    parts = [columns(chunk, kept, coordinates_of(scene)) for chunk in chunks]
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    steps, rejected = (sum(getattr(chunk, name) for chunk in chunks) for name in ("steps", "rejected_steps"))
    return _dataset(joined, scene, outcome, steps, rejected)


def empty_dataset(scene: Scene) -> "xarray.Dataset":
    """The same of a run that has not begun: no samples, no steps, no outcome."""
    wide, narrow = np.empty((0, len(coordinates_of(scene)))), np.empty(0)
    signals = ("time", *signals_of(scene))
    return _dataset(dict.fromkeys(MOTION, wide) | dict.fromkeys(signals, narrow), scene, RUNNING, 0, 0)


def columns(chunk: Chunk, kept: Sequence[str], names: Sequence[str]) -> dict[str, np.ndarray]:
    """What every variable of a history of all the named coordinates gets from a chunk of those kept."""
    recorded = chunk.observation._asdict() | chunk._asdict() | dict(chunk.remembered)
    wide = {name: np.zeros((len(chunk.time), len(names))) for name in MOTION}
    for name, values in wide.items():
        values[:, [names.index(each) for each in kept]] = recorded[name]
    by_shoe = signals_by_shoe(dict.fromkeys(shoe_of(name) for name in names if not is_of_drum(name)))
    recorded |= dict(zip(by_shoe, chunk.observation.by_shoe, strict=True))
    return wide | {name: recorded[name] for name in ("time", *SIGNALS, *by_shoe, *chunk.remembered)}


def _dataset(
    values: Mapping[str, np.ndarray], scene: Scene, outcome: Outcome, steps: int, rejected_steps: int
) -> "xarray.Dataset":
    elastic = (
        "; E1, E2 and so on are the amplitudes of the shoe's mass-normalised free modes by rising frequency, and "
        "drum.E1 and so on those of the drum's; where these end at E4, S5, S6 and so on are those of the shapes "
        "in which it yields besides"
    )
    axes = (
        "x from the drum's axis through the middle of the lining, y at right angles to it the way the lining's middle "
        "sees the drum move at positive speed, z along the drum's axis; Tx, Ty, Tz are small rotations about x, y, z"
    )
    names = coordinates_of(scene)
    motion = {name: (units_of(names, rate), meaning) for name, (rate, meaning) in MOTION.items()}
    data = {
        name: (("time", "coordinate")[: values[name].ndim], values[name], {"units": units, "long_name": meaning})
        for name, (units, meaning) in (motion | signals_of(scene)).items()
    }
    coordinates = {
        "time": ("time", values["time"], {"units": "s", "axis": "T"}),
        "coordinate": ("coordinate", list(names), {"long_name": axes + elastic * (len(names) > len(COORDINATES))}),
    }
    attributes = {
        "title": scene.title,
        "scene": scene.to_toml(),
        "versions": json.dumps(versions()),
        "outcome": str(outcome),
        "ending": outcome.ending.value,
        "steps": steps,
        "rejected_steps": rejected_steps,
        "measured_from": "q = 0 of the model; a self-consistent steady state shows as an offset",
    }
    import xarray

    return xarray.Dataset(data, coordinates, attributes)


# The part of a record that `--from` and `--until` ask for, in every command that takes them.


def time_window(
    record: str, covered: tuple[float, float], interval: float, first: float | None, last: float | None
) -> tuple[float, float]:
    """From and until when (s), of a record which covers these times with so many seconds between samples.

    `first` and `last` are what `--from` and `--until` say, None for the ends of the record. Raises RequestError for a
    time that the record does not cover, and where nothing lies between the two.
    """
    begin, end = covered
    # Of a sampling interval, that a time may lie beyond the first and the last sample: a record of 3 s ends an interval
    # before 3 s, and times that are printed are rounded.
    slack = 1.001 * interval
    for option, time in (("--from", first), ("--until", last)):
        if time is not None and not begin - slack <= time <= end + slack:
            raise RequestError(f"{option} {time:.9g} s: {record} has {begin:.9g} to {end:.9g} s; take a time within it")
    since = begin if first is None else min(max(first, begin), end)
    until = end if last is None else min(max(last, begin), end)
    if not since < until:
        start = f"the start at {begin:.9g} s" if first is None else f"--from {first:.9g} s"
        stop = f"the end at {end:.9g} s" if last is None else f"--until {last:.9g} s"
        raise RequestError(f"{start} is not before {stop}; {record} has {begin:.9g} to {end:.9g} s")
    return since, until
