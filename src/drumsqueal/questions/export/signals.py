"""The signals that can go out, by name, each made of a history when it is asked for, with units and origin."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.coordinates import (
    COORDINATES,
    DRUM,
    is_elastic,
    is_of_drum,
    is_rotation,
    is_static,
    shoe_of,
    unit_of,
)
from drumsqueal.errors import RequestError, nearest
from drumsqueal.files.history_file import SavedHistory
from drumsqueal.findings.history import SIGNALS as ALWAYS
from drumsqueal.findings.history import TEMPERATURE, memory_of, signals_by_shoe, signals_of
from drumsqueal.findings.vibration import loudest_shoe
from drumsqueal.physics.bodies.brake import placed
from drumsqueal.physics.composition import coordinates_of, kept_coordinates
from drumsqueal.physics.model import body_of
from drumsqueal.scene import Scene

if TYPE_CHECKING:
    from drumsqueal.solve.linear.modes import Stability

DISPLACEMENT, VELOCITY, ACCELERATION, FLAG = "displacement", "velocity", "acceleration", "flag"
CENTRE_OF_GRAVITY, MIDDLE, LEADING_END, TRAILING_END = 1, 2, 3, 4
"""Points of the shoe by number, the ends as at positive speed; 0 is no point, for what belongs to the whole lining."""
OF_NEXT_SHOE = 10_000  # added to the numbers of points for each further shoe
LONGEST_SHORT = 10  # characters of a short name, for which universal files have room
# Lengths and forces multiplied in the units of a signal that is no motion: what formats with codes of units ask for.
NO_UNITS = (0, 0)
UNKNOWN = "eigenvalues_unknown"
SURFACE = "surface_velocity"
_GIVEN_LAW = "the friction law was given in Python and is not in the history"
_RATES = {DISPLACEMENT: "", VELOCITY: "/s", ACCELERATION: "/s^2"}  # what is added to the units of coordinates
# What the recorded signals measure: short name, quantity, powers of length and force in the units.
_RECORDED = {
    "brake_torque": ("torque", "moment", (1, 1)),
    "normal_force": ("force_n", "force", (0, 1)),
    "contact_fraction": ("contact", "fraction", NO_UNITS),
    "slip_reversed_fraction": ("reversed", "fraction", NO_UNITS),
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

# Velocities of the lining's surface: short name, meaning, point, whether along the drum and not radial, and at how many
# half arcs β/2. Ends are named by their angle: which one leads depends on the way the drum turns. Short and in ASCII,
# because universal files cut the line.
_LEADS, _TRAILS = "at theta = -beta/2", "at theta = +beta/2"
_SURFACE = {
    # Along the drum, where the slip is and the modes move that friction feeds.
    SURFACE: ("vel_middle", "velocity along the drum of the lining at its middle", MIDDLE, True, 0),
    f"{SURFACE}_radial": ("vel_radial", "radial velocity of the lining at its middle", MIDDLE, False, 0),
    f"{SURFACE}_leading": ("vel_lead", f"radial velocity {_LEADS}", LEADING_END, False, -1),
    f"{SURFACE}_leading_along": ("along_lead", f"velocity along the drum {_LEADS}", LEADING_END, True, -1),
    f"{SURFACE}_trailing": ("vel_trail", f"radial velocity {_TRAILS}", TRAILING_END, False, 1),
    f"{SURFACE}_trailing_along": ("along_trai", f"velocity along the drum {_TRAILS}", TRAILING_END, True, 1),
}


class Channel(NamedTuple):
    """One signal (n,): `quantity` is what it measures, in `units`.

    `short_name` has LONGEST_SHORT characters at most, and may be that of another, too. `point` numbers a point of the
    shoe; `direction` is 1 to 6 for x, y, z and the rotations about them at the centre of gravity, along the shoe's own
    axes, and 1 and 2 for radially and along the drum at the lining. Both are 0 for what has none. `length_force` are
    the powers of length and force in the units (time aside).
    """

    name: str
    short_name: str
    quantity: str
    units: str
    meaning: str
    values: NDArray[np.float64]
    point: int = 0
    direction: int = 0
    length_force: tuple[int, int] = NO_UNITS


class Channels(NamedTuple):
    """Signals that were sampled together at start + k / sample_rate (s, Hz), and what is to be known of them.

    `texts` has title, scene (TOML), versions, outcome, source and more by name. `stability` is what the eigenvalues
    say, None where they were not asked for or, as `texts` then says under "eigenvalues_unknown", are not to be had.
    `slow` is how many times slower than it was a sound is to be played.
    """

    start: float
    sample_rate: float
    channels: tuple[Channel, ...]
    texts: dict[str, str]
    scene: Scene
    stability: "Stability | None" = None
    slow: float = 1.0

    @property
    def time(self) -> NDArray[np.float64]:
        """Times of the samples (s), shape (n,)."""
        return self.start + np.arange(self.channels[0].values.size) / self.sample_rate

    @property
    def prediction(self) -> tuple[str, ...]:
        """A line for each oscillating mode of steady sliding: name, frequency, growth rate; or why there is none."""
        if self.stability is None:
            return (f"unknown: {self.texts[UNKNOWN]}",) if UNKNOWN in self.texts else ()
        return tuple(
            f"{mode.label} {mode.frequency_Hz:.6g} Hz {mode.growth_rate:+.6g}/s" for mode in self.stability.modes
        )


def names_of(
    asked: Sequence[str] | None, saved: SavedHistory, *, option: str = "--signals"
) -> tuple[list[str], list[str]]:
    """Names of the signals that are asked for, and of those left out with the reason; None asks for all that move.

    "displacement", "velocity" and "acceleration" stand for those of all coordinates that the scene moves. Raises
    RequestError, naming the `option`, for an unknown name, and for what the history does not hold.
    """
    moving, left_out = kept_coordinates(saved.scene), []
    if asked is None:
        groups = [kind for kind in _RATES if kind != ACCELERATION or not saved.given_law]
        surfaces = (f"{prefix}{name}" for prefix in saved.scene.prefixes for name in _SURFACE)
        asked = (*groups, *surfaces, *signals_of(saved.scene))
        left_out = [] if ACCELERATION in groups else [f"accelerations are left out: {_GIVEN_LAW}"]
    every = coordinates_of(saved.scene)
    names = list(dict.fromkeys(name for group in asked for name in _members(group, moving, every, option)))
    absent = next((name for name in names if name in TEMPERATURE and saved.scene.temperature is None), None)
    if absent is not None:
        raise RequestError(f"{option} {absent}: the scene of this history has no temperature; leave it out")
    if saved.given_law and any(name.startswith(ACCELERATION) for name in names):
        raise RequestError(f"{option}: there are no accelerations for this history: {_GIVEN_LAW}; leave them out")
    return names, left_out


def known_signals(coordinates: Sequence[str] = COORDINATES) -> list[str]:
    """Every name that may be asked for of a history of these coordinates, of signals and of groups of them."""
    every = [f"{kind}_{coordinate}" for kind in _RATES for coordinate in coordinates]
    prefixes = dict.fromkeys(shoe_of(name) for name in coordinates if not is_of_drum(name))
    surfaces = (f"{prefix}{name}" for prefix in prefixes for name in _SURFACE)
    return [*_RATES, *every, *surfaces, *SIGNALS, *signals_by_shoe(prefixes)]


def _members(name: str, moving: Sequence[str], coordinates: Sequence[str], option: str) -> list[str]:
    if name in _RATES:
        return [f"{name}_{coordinate}" for coordinate in moving]
    known = known_signals(coordinates)
    if name in known:
        return [name]
    near = nearest(name, known)
    most = (each for each in known if each.partition("_")[2] not in coordinates)
    meant = f"did you mean {near[0]}?" if near else f"there are {', '.join(most)}"
    raise RequestError(f"{option} {name}: there is no such signal; {meant}")


def default_signal(saved: SavedHistory) -> str:
    """The velocity along the drum of the lining at its middle: of several, of the `loudest_shoe`."""
    number = loudest_shoe(body_of(saved.scene), saved.coordinates, saved.data[VELOCITY].values)
    return f"{saved.scene.prefixes[number]}{SURFACE}"


def make_channels(saved: SavedHistory, names: Sequence[str], rows: slice) -> list[Channel]:
    """The named signals at these samples."""
    asked = saved._replace(data=saved.data.isel(time=rows))
    motions = {kind: asked.data[kind].values for kind in (DISPLACEMENT, VELOCITY)}
    if any(name.startswith(ACCELERATION) for name in names):
        motions[ACCELERATION] = _accelerations(asked)
    channels = []
    for name in names:
        kind, _, coordinate = name.partition("_")
        if kind in _RATES:
            values = motions[kind][:, saved.coordinates.index(coordinate)].copy()
            channels.append(_motion(kind, coordinate, saved.scene, values))
        elif name in signals_of(asked.scene):
            channels.append(_recorded(asked, name))
        else:
            channels.append(_surface(saved.scene, name, motions[VELOCITY]))
    return channels


def surface_velocity(
    scene: Scene, velocity: NDArray[np.float64], angle: float, *, along_drum: bool = False, shoe: int = 0
) -> NDArray[np.float64]:
    """Velocity (k,) in m/s of a lining's surface at an angle θ (rad) in the middle of its width (z = 0).

    Radial or along the drum, of velocities (k, m) of all coordinates; of the shoe of that number where there are some.
    """
    part = placed(body_of(scene))[shoe]
    own = part.share.own(dict(zip(coordinates_of(scene), velocity.T, strict=True)))
    radial, along, _ = part.shoe.displacement(own, angle)
    return along if along_drum else radial


def distinct(names: Sequence[str], most: int) -> list[str]:
    """The names in so many characters at most; one that is longer, or there already, ends with its number from 1."""
    found: list[str] = []
    for number, name in enumerate(names, start=1):
        ending = f"_{number}"
        found.append(name if len(name) <= most and name not in found else name[: most - len(ending)] + ending)
    return found


def _short(scene: Scene, short: str, prefix: str) -> str:
    """A short name such as vel_X; of several shoes with the shoe's number from 1 in it, vel2_X."""
    what, line, of = short.partition("_")
    number = scene.prefixes.index(prefix) + 1 if prefix else ""
    return f"{what}{number}{line}{of}"[:LONGEST_SHORT]


def _motion(kind: str, coordinate: str, scene: Scene, values: NDArray[np.float64]) -> Channel:
    name, units, prefix = f"{kind}_{coordinate}", unit_of(coordinate) + _RATES[kind], shoe_of(coordinate)
    own = coordinate.removeprefix(prefix).replace(DRUM, DRUM[0])
    short = _short(scene, f"{kind[: 4 if kind == DISPLACEMENT else 3]}_{own}", prefix)
    if is_elastic(coordinate):  # of no point and in no direction, and in units that no format has a code for
        rate = "" if kind == DISPLACEMENT else f"{kind} of the "
        what = "shape" if is_static(coordinate) else "mode"
        return Channel(name, short, "modal amplitude", units, f"{rate}amplitude of {what} {coordinate}", values)
    meaning = f"{kind}{' of rotation' if is_rotation(coordinate) else ''} {coordinate} at the centre of gravity"
    number, place = scene.prefixes.index(prefix), COORDINATES.index(own)
    return Channel(name, short, kind, units, meaning, values, CENTRE_OF_GRAVITY + number * OF_NEXT_SHOE, place + 1)


def _surface(scene: Scene, name: str, velocity: NDArray[np.float64]) -> Channel:
    prefix = shoe_of(name)
    number = scene.prefixes.index(prefix)
    short, meaning, point, along_drum, half_arcs = _SURFACE[name.removeprefix(prefix)]
    angle = half_arcs * scene.shoes[number].arc_angle / 2
    values = surface_velocity(scene, velocity, angle, along_drum=along_drum, shoe=number)
    meaning = f"{prefix.removesuffix('.')}: {meaning}" if prefix else meaning
    point += number * OF_NEXT_SHOE
    return Channel(name, _short(scene, short, prefix), VELOCITY, "m/s", meaning, values, point, 2 if along_drum else 1)


def _recorded(saved: SavedHistory, name: str) -> Channel:
    prefix = shoe_of(name)
    short, quantity, powers = _RECORDED[name.removeprefix(prefix)]
    units, meaning = signals_of(saved.scene)[name]
    values = np.asarray(saved.data[name].values, dtype=np.float64)
    bad = int(np.count_nonzero(~np.isfinite(values)))
    if bad:
        raise RequestError(f"{saved.path}: {name} has no number at {bad} samples; choose others with --signals")
    return Channel(name, _short(saved.scene, short, prefix), quantity, units, meaning, values, length_force=powers)


def _accelerations(saved: SavedHistory) -> NDArray[np.float64]:
    """Of all coordinates (k, m); zero where one was left out."""
    from drumsqueal.physics.model import build_model
    from drumsqueal.solve.transient.sticking import accelerations

    model = build_model(saved.scene)
    data, kept = saved.data, [saved.coordinates.index(name) for name in model.names]
    wide = np.zeros((data.sizes["time"], len(saved.coordinates)))
    q, v = (data[name].values[:, kept] for name in (DISPLACEMENT, VELOCITY))
    wide[:, kept] = accelerations(
        model, data["time"].values, q, v, data["sticking"].values > 0, memory_of(data, model.remembered)
    )
    return wide
