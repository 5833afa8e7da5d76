"""The signals that can go out, by name, each made of a history when it is asked for."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError, nearest
from drumsqueal.files.saved_history import SavedHistory
from drumsqueal.findings.history import SIGNALS as ALWAYS
from drumsqueal.findings.history import TEMPERATURE, memory_of, signals_of
from drumsqueal.findings.vibration import ROTATIONS
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.composition import kept_coordinates
from drumsqueal.questions.export.channels import (
    ACCELERATION,
    DISPLACEMENT,
    FLAG,
    NO_UNITS,
    VELOCITY,
    Channel,
)
from drumsqueal.questions.export.points import CENTRE_OF_GRAVITY, LEADING_END, MIDDLE, TRAILING_END
from drumsqueal.scene import COORDINATES, Scene

SURFACE = "surface_velocity"
_GIVEN_LAW = "the friction law was given in Python and is not in the history"
_UNITS = {DISPLACEMENT: ("m", "rad"), VELOCITY: ("m/s", "rad/s"), ACCELERATION: ("m/s^2", "rad/s^2")}
_SHORT = {DISPLACEMENT: "disp", VELOCITY: "vel", ACCELERATION: "acc"}
# What the recorded signals measure: short name, quantity, powers of length and force in the units.
_RECORDED = {
    "brake_torque": ("torque", "moment", (1, 1)),
    "normal_force": ("force_n", "force", (0, 1)),
    "contact_fraction": ("contact", "share", NO_UNITS),
    "slip_reversed_fraction": ("reversed", "share", NO_UNITS),
    "smallest_pressure": ("p_min", "pressure", (-2, 1)),
    "friction_power": ("p_friction", "power", (1, 1)),
    "sticking": ("sticking", FLAG, NO_UNITS),
    "implicit": ("implicit", FLAG, NO_UNITS),
    "kinetic_energy": ("e_kinetic", "energy", (1, 1)),
    "potential_energy": ("e_potent", "energy", (1, 1)),
    "energy_balance_error": ("e_error", "energy", (1, 1)),
    "lining_temperature": ("temp", "temperature", NO_UNITS),
}


SIGNALS = ALWAYS | TEMPERATURE


class _SurfacePoint(NamedTuple):
    """A velocity of the lining's surface: along e_r or e_θ, at an angle of so many half arcs β/2."""

    short_name: str
    meaning: str
    point: int
    along_drum: bool
    half_arcs: int


# By the angle: which end leads depends on the way the drum turns. Short and in ASCII, for universal files cut the line.
_LEADS, _TRAILS = "at theta = -beta/2", "at theta = +beta/2"
_SURFACE = {
    # Along the drum: there slip is, and there move the modes that friction feeds.
    SURFACE: _SurfacePoint("vel_middle", "velocity along the drum of the lining at its middle", MIDDLE, True, 0),
    f"{SURFACE}_radial": _SurfacePoint("vel_radial", "radial velocity of the lining at its middle", MIDDLE, False, 0),
    f"{SURFACE}_leading": _SurfacePoint("vel_lead", f"radial velocity {_LEADS}", LEADING_END, False, -1),
    f"{SURFACE}_leading_along": _SurfacePoint("along_lead", f"velocity along the drum {_LEADS}", LEADING_END, True, -1),
    f"{SURFACE}_trailing": _SurfacePoint("vel_trail", f"radial velocity {_TRAILS}", TRAILING_END, False, 1),
    f"{SURFACE}_trailing_along": _SurfacePoint(
        "along_trai", f"velocity along the drum {_TRAILS}", TRAILING_END, True, 1
    ),
}


def names_of(
    asked: Sequence[str] | None, saved: SavedHistory, *, option: str = "--signals"
) -> tuple[list[str], list[str]]:
    """Names of the signals that are asked for, and of those left out with the reason; None asks for all that move.

    "displacement", "velocity" and "acceleration" stand for those of all coordinates that the scene moves. Raises
    RequestError, naming the `option`, for an unknown name, and for what the history does not hold.
    """
    moving = kept_coordinates(saved.scene)
    if asked is None:
        groups = [kind for kind in _UNITS if kind != ACCELERATION or not saved.given_law]
        signals = (*groups, *_SURFACE, *signals_of(saved.scene))
        names = [name for group in signals for name in _members(group, moving, option)]
        return names, [] if ACCELERATION in groups else [f"accelerations are left out: {_GIVEN_LAW}"]
    names = list(dict.fromkeys(name for group in asked for name in _members(group, moving, option)))
    absent = next((name for name in names if name in TEMPERATURE and saved.scene.temperature is None), None)
    if absent is not None:
        raise RequestError(f"{option} {absent}: the scene of this history has no temperature; leave it out")
    if saved.given_law and any(name.startswith(ACCELERATION) for name in names):
        raise RequestError(f"{option}: there are no accelerations for this history: {_GIVEN_LAW}; leave them out")
    return names, []


def known_signals() -> list[str]:
    """Every name that may be asked for, of signals and of groups of them."""
    every = [f"{kind}_{coordinate}" for kind in _UNITS for coordinate in COORDINATES]
    return [*_UNITS, *every, *_SURFACE, *SIGNALS]


def _members(name: str, moving: Sequence[str], option: str) -> list[str]:
    if name in _UNITS:
        return [f"{name}_{coordinate}" for coordinate in moving]
    known = known_signals()
    if name in known:
        return [name]
    near = nearest(name, known)
    meant = f"did you mean {near[0]}?" if near else f"there are {', '.join((*_UNITS, *_SURFACE, *SIGNALS))}"
    raise RequestError(f"{option} {name}: there is no such signal; {meant}")


def make_channels(saved: SavedHistory, names: Sequence[str], rows: slice) -> list[Channel]:
    """The named signals at these samples."""
    asked = saved._replace(data=saved.data.isel(time=rows))
    accelerated = None
    channels = []
    for name in names:
        kind, _, coordinate = name.partition("_")
        if kind == ACCELERATION and accelerated is None:
            accelerated = _accelerations(asked)
        if kind in _UNITS:
            recorded = accelerated if kind == ACCELERATION else asked.data[kind].values
            assert recorded is not None
            channels.append(_motion(kind, coordinate, recorded))
        elif name in _SURFACE:
            channels.append(_surface(asked, name))
        else:
            channels.append(_recorded(asked, name))
    return channels


def surface_velocity(
    scene: Scene, velocity: NDArray[np.float64], angle: float, *, along_drum: bool = False
) -> NDArray[np.float64]:
    """Velocity (k,) in m/s of the lining's surface at an angle θ (rad) in the middle of its width (z = 0).

    Radial or along the drum, of velocities (k, m) of all coordinates.
    """
    radial, along, _ = RigidShoe(**scene.shoe.model_dump()).displacement(
        dict(zip(COORDINATES, velocity.T, strict=True)), angle
    )
    return along if along_drum else radial


def _motion(kind: str, coordinate: str, recorded: NDArray[np.float64]) -> Channel:
    i = COORDINATES.index(coordinate)
    rotation = coordinate in ROTATIONS
    what = f"{kind} of rotation" if rotation else kind
    meaning = f"{what} {coordinate} at the centre of gravity"
    return Channel(
        f"{kind}_{coordinate}",
        f"{_SHORT[kind]}_{coordinate}",
        kind,
        _UNITS[kind][rotation],
        meaning,
        recorded[:, i].copy(),
        CENTRE_OF_GRAVITY,
        i + 1,
    )


def _surface(saved: SavedHistory, name: str) -> Channel:
    where = _SURFACE[name]
    angle = where.half_arcs * saved.scene.shoe.arc_angle / 2
    values = surface_velocity(saved.scene, saved.data["velocity"].values, angle, along_drum=where.along_drum)
    direction = 2 if where.along_drum else 1
    return Channel(name, where.short_name, VELOCITY, "m/s", where.meaning, values, where.point, direction)


def _recorded(saved: SavedHistory, name: str) -> Channel:
    short, quantity, powers = _RECORDED[name]
    units, meaning = SIGNALS[name]
    values = np.asarray(saved.data[name].values, dtype=np.float64)
    bad = int(np.count_nonzero(~np.isfinite(values)))
    if bad:
        raise RequestError(f"{saved.path}: {name} has no number at {bad} samples; choose others with --signals")
    return Channel(name, short, quantity, units, meaning, values, length_force=powers)


def _accelerations(saved: SavedHistory) -> NDArray[np.float64]:
    """Of all coordinates (k, m); zero where one was left out."""
    from drumsqueal.physics.model import build_model
    from drumsqueal.solve.transient.accelerations import accelerations

    model = build_model(saved.scene)
    data, kept = saved.data, [COORDINATES.index(name) for name in kept_coordinates(saved.scene)]
    wide = np.zeros((data.sizes["time"], len(COORDINATES)))
    q, v = (data[name].values[:, kept] for name in (DISPLACEMENT, VELOCITY))
    wide[:, kept] = accelerations(
        model, data["time"].values, q, v, data["sticking"].values > 0, memory_of(data, model.remembered)
    )
    return wide
