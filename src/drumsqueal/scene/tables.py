"""The tables of a scene as frozen, checked models: every value an SI float once it is in."""

import math
import sys
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    StrictBool,
    model_serializer,
    model_validator,
)
from pydantic_core import core_schema

from drumsqueal.scene.coordinates import COORDINATES, in_order, is_coordinate, is_elastic, is_rotation
from drumsqueal.scene.quantities import KeyPath, SceneError, example, parse_quantity
from drumsqueal.scene.usual import Usual

_OTHERS = f"{', '.join(COORDINATES)}, and E1, E2, ... of an elastic shoe"
_ROUND_OFF = 4 * sys.float_info.epsilon  # of a length: three quotients and a root leave less
_MOST_POINTS = 100_000  # of a profile
_BYTES_PER_POINT = 56  # in every file that holds the scene: two numbers with all their digits, each in a line
_MOST_SAMPLES = 10**8
BYTES_PER_SAMPLE = 200  # of the history: six displacements, six velocities and a dozen signals
BYTES_PER_MODE = 16  # more for each free mode


class Reader(ABC):
    """What reads a field of a table, as pydantic metadata; `example` is a value of it as a file could have it."""

    example = "..."

    @abstractmethod
    def read(self, value: Any, /) -> Any:
        """Read what was written; raises SceneError."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Let pydantic read the field by `read`."""
        return core_schema.no_info_plain_validator_function(self.read)


@dataclass(frozen=True)
class Quantity(Reader):
    """A number with a unit: reads strings with a unit and holds the value to its limits."""

    unit: str
    above: float | None = None
    least: float | None = None
    most: float | None = None

    @property
    def example(self) -> str:
        """A value in its unit."""
        return example(self.unit)

    def read(self, value: Any) -> float:
        """Read one value to an SI float; raises SceneError."""
        number = parse_quantity(value, self.unit)
        unit = f" {self.unit}" if self.unit else ""
        if self.above is not None and not number > self.above:
            raise SceneError(f"the value must be above {self.above:g}{unit}")
        if self.least is not None and number < self.least:
            raise SceneError(f"the value must not be below {self.least:g}{unit}")
        if self.most is not None and number > self.most:
            raise SceneError(f"the value must not be above {self.most:g}{unit}")
        return number


@dataclass(frozen=True)
class Resolution(Quantity):
    """A quantity that says how finely is computed: it can be set, and is no physical number of the brake."""


@dataclass(frozen=True)
class Profile:
    """A value prescribed over time: linear between its points, constant before the first and after the last.

    `time` in s, strictly increasing, and `value` in SI have the same length, 2 to 100000 points. Raises SceneError.
    """

    time: tuple[float, ...]
    value: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the points."""
        object.__setattr__(self, "time", _numbers(self.time, Quantity("s"), ("time",)))
        object.__setattr__(self, "value", _numbers(self.value, Quantity(""), ("value",)))
        if len(self.time) != len(self.value):
            raise SceneError(f"{len(self.time)} times but {len(self.value)} values; write one value for every time")
        if len(self.time) < 2:
            raise SceneError(f"{len(self.time)} points; write 2 to {_MOST_POINTS}, or a plain value if it is constant")
        for index in range(1, len(self.time)):
            before, after = self.time[index - 1], self.time[index]
            if not after > before:
                raise SceneError(f"the times must increase; write one after {before!r} s", ("time", index), after)


Schedule = float | Profile


def _numbers(values: Any, quantity: Quantity, path: KeyPath = ()) -> tuple[float, ...]:
    if not isinstance(values, list | tuple):
        raise SceneError("this must be a list of values, one for every point", path, values)
    if len(values) > _MOST_POINTS:
        size = f"{len(values)} points would take about {len(values) * _BYTES_PER_POINT / 1e6:.3g} MB"
        raise SceneError(f"{size} in every file that holds the scene; write at most {_MOST_POINTS}", path)
    numbers = []
    for index, value in enumerate(values):
        try:
            numbers.append(quantity.read(value))
        except SceneError as error:
            raise error.under((*path, index), value) from None
    return tuple(numbers)


@dataclass(frozen=True)
class Quantities(Reader):
    """A list of numbers with a unit, one for every point of a curve."""

    quantity: Quantity
    example: str

    def read(self, values: Any) -> tuple[float, ...]:
        """Read a list to SI floats; raises SceneError."""
        return _numbers(values, self.quantity)


@dataclass(frozen=True)
class Scheduled(Quantity):
    """A quantity that may also be a profile, written as { time = [...], value = [...] }."""

    def read(self, value: Any) -> Any:
        """Read one value to an SI float or to a Profile in SI; raises SceneError."""
        if isinstance(value, Profile):
            value = {"time": value.time, "value": value.value}
        if not isinstance(value, Mapping):
            return super().read(value)
        if set(value) != {"time", "value"}:
            raise SceneError("a profile has the keys time and value, and only these: { time = [...], value = [...] }")
        return Profile(value["time"], _numbers(value["value"], Quantity(self.unit, least=self.least), ("value",)))


@dataclass(frozen=True)
class Point(Reader):
    """A point x, y, z in the axes of the shoe, in m."""

    example = '["40 mm", "95 mm", "0 mm"]'

    def read(self, values: Any) -> tuple[float, ...]:
        """Read three lengths; raises SceneError."""
        return _three(values, Quantity("m"), self.example)


@dataclass(frozen=True)
class Direction(Reader):
    """A unit vector x, y, z in the axes of the shoe, from a vector of any length but zero."""

    example = "[0.0, 1.0, 0.0]"

    def read(self, values: Any) -> tuple[float, ...]:
        """Read three numbers and divide them by their length; raises SceneError."""
        vector = _three(values, Quantity(""), self.example)
        largest = max(map(abs, vector))
        if largest == 0:
            raise SceneError(f"a direction must not be zero; write one such as {self.example}")
        # What was normalised once stays as it is to the last bit, so that a scene survives its file.
        if abs(math.hypot(*vector) - 1) <= _ROUND_OFF:
            return vector
        scaled = [each / largest for each in vector]  # the length of very small numbers would be rounded off
        return tuple(each / math.hypot(*scaled) for each in scaled)


def _three(values: Any, quantity: Quantity, example: str) -> tuple[float, ...]:
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise SceneError(f"this must be a list of three, along x, y and z, such as {example}")
    return _numbers(values, quantity)


@dataclass(frozen=True)
class PerCoordinate(Reader):
    """A table of coordinate names, in `length_unit`, for rotations in `angle_unit`, for elastic modes in `modal_unit`.

    Elastic modes are normalised to a generalised mass of 1, so that their coordinates are in m kg^0.5.
    """

    length_unit: str
    angle_unit: str
    modal_unit: str

    def unit(self, coordinate: str) -> str:
        """The SI unit for a coordinate."""
        if is_elastic(coordinate):
            return self.modal_unit
        return self.angle_unit if is_rotation(coordinate) else self.length_unit

    def read(self, table: Any) -> dict[str, float]:
        """Read a table to SI floats; raises SceneError."""
        if not isinstance(table, Mapping):
            raise SceneError(f'this must be a table of coordinates such as {{ Y = "1e-5 {self.length_unit}" }}')
        numbers = {}
        for name, value in table.items():
            if not is_coordinate(name):
                raise SceneError(f"unknown coordinate; the coordinates are {_OTHERS}", (str(name),))
            try:
                numbers[name] = parse_quantity(value, self.unit(name))
            except SceneError as error:
                raise error.under((name,), value) from None
        return numbers


def _coordinates(value: Any) -> Any:
    # Kept in their own order, so that two ways to write one choice are one scene.
    if isinstance(value, str) and value == "auto":
        return value
    if not isinstance(value, list | tuple) or not value:
        raise SceneError('write "auto", or a list of coordinates such as ["X", "Y", "Tz"]')
    for index, name in enumerate(value):
        if not is_coordinate(name):
            raise SceneError(f"unknown coordinate; the coordinates are {_OTHERS}", (index,), name)
        if name in value[:index]:
            raise SceneError("this coordinate is named twice; leave one out", (index,), name)
    return in_order(value)


def _without_controls(title: str) -> str:
    # No NetCDF attribute takes a null character, and the other control characters act on whatever shows them.
    for place, letter in enumerate(title, start=1):
        if unicodedata.category(letter) == "Cc" and letter not in "\t\n\r":
            raise SceneError(f"letter {place} is the control character U+{ord(letter):04X}; leave it out")
    return title


Title = Annotated[str, Field(strict=True, max_length=1000), AfterValidator(_without_controls)]
Length = Annotated[float, Quantity("m", above=0)]
LEAST_TOLERANCE, MOST_TOLERANCE = 1e-12, 1e-1  # less is round-off
Stiffness = Annotated[float, Quantity("N/m", least=0)]
Coefficient = Annotated[float, Quantity("", least=0)]


class Table(BaseModel):
    """A table of a scene: frozen, and without room for unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", revalidate_instances="always")


class Elasticity(Table):
    """The shoe's own elasticity: Young's modulus in Pa, Poisson's ratio, and up to which frequency (Hz) modes are kept.

    Quadratic elements lock where Poisson's ratio comes near 0.5, so it may be 0.49 at most.
    """

    young: Annotated[float, Quantity("Pa", above=0)]
    poisson: Annotated[float, Quantity("", least=0, most=0.49)]
    up_to: Annotated[float, Resolution("Hz", above=0)]


class PointSpring(Table):
    """A spring to the ground at a point P of the shoe, along the unit vector d: force −(k d·u(P) + c d·u̇(P)) d.

    P in m in the axes of the shoe, stiffness k in N/m, damping c in N s/m.
    """

    at: Annotated[tuple[float, ...], Point()]
    direction: Annotated[tuple[float, ...], Direction()]
    stiffness: Stiffness
    damping: Annotated[float, Quantity("N*s/m", least=0)] = 0.0


class PointForce(Table):
    """A force at a point P of the shoe along the unit vector d, in N; a negative one acts against d.

    P in m in the axes of the shoe; the size may follow a profile.
    """

    at: Annotated[tuple[float, ...], Point()]
    direction: Annotated[tuple[float, ...], Direction()]
    size: Annotated[Schedule, Scheduled("N")]


class Shoe(Table):
    """The shoe, an annular sector: lengths in m, arc angle in rad, density in kg/m^3.

    Springs and forces act at points of it; without `elastic` it is rigid.
    """

    outer_radius: Length
    thickness: Length
    width: Length
    arc_angle: Annotated[float, Quantity("rad", above=0)]
    density: Annotated[float, Quantity("kg/m^3", above=0)]
    elastic: Elasticity | None = None
    spring: tuple[PointSpring, ...] = ()
    force: tuple[PointForce, ...] = ()

    @property
    def sector(self) -> dict[str, Any]:
        """The numbers of the body alone: lengths, arc angle and density, by key."""
        return {key: value for key, value in self if isinstance(value, float)}

    @property
    def in_plane(self) -> bool:
        """Whether all springs and forces at points lie in the plane z = 0, with their directions."""
        return all(each.at[2] == 0 and each.direction[2] == 0 for each in (*self.spring, *self.force))

    @model_serializer(mode="wrap")
    def _write_what_is_there(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in write(self).items() if value not in (None, (), [])}

    @model_validator(mode="after")
    def _is_a_sector(self) -> "Shoe":
        if self.thickness >= self.outer_radius:
            limit = f"shoe.outer_radius, {self.outer_radius!r} m"
            raise SceneError(f"the thickness must be smaller than {limit}", ("thickness",), self.thickness)
        if self.arc_angle > math.tau:
            raise SceneError(
                "the arc angle must not be above 360 deg; a number without a unit is in rad",
                ("arc_angle",),
                self.arc_angle,
            )
        return self


class Support(Table):
    """The support springs, in N/m."""

    upper_stiffness: Stiffness
    lower_stiffness: Stiffness


class Contact(Table):
    """The lining: stiffness in N/m^3, normal load in N; without separation the contact also pulls."""

    stiffness: Annotated[float, Quantity("N/m^3", least=0)]
    normal_load: Annotated[Schedule, Scheduled("N", least=0)] = 0.0
    separation: StrictBool = True


class Friction(Table, ABC):
    """The friction of lining and drum: a law, μ as a function of the slip speed s, along a direction.

    A law is one file in `scene/laws`: a subclass with its keys and with what is asked for here. Its functions take the
    law's numbers by key, in SI, and the library they are in as `xp`: `numpy` or `jax.numpy`, traced. Whether one
    of the numbers may vanish where the brake is varied is read off the limits of its field.
    """

    name: ClassVar[str]
    """What it is called in sentences, such as "exponential law"."""
    usual: ClassVar[Mapping[str, Usual]]
    """What drum brakes have, for every number by its key."""

    direction: Literal["unit-velocity", "tangential"] = "unit-velocity"
    law: str

    @staticmethod
    @abstractmethod
    def mu(slip_speed: Any, xp: Any, **numbers: Any) -> Any:
        """μ at slip speeds s ≥ 0 (m/s), of any shape; at 0 its limit at slow slip."""

    @staticmethod
    @abstractmethod
    def cuts(xp: Any, **numbers: Any) -> tuple[Any, Any]:
        """Slip speeds (K,) and (L,) in m/s, rising, at which contact integrals are cut in the plane and in space.

        The former cut μ(s) into stretches, each resolved by sixteen Gauss nodes; of those the latter are where it has a
        kink or varies on a scale shorter than its slip speed. Each of them makes the program in space longer.
        """

    @staticmethod
    def prepared(xp: Any, **numbers: Any) -> dict[str, Any]:
        """The numbers that the other functions take: those of the scene, and what is worked out from them once."""
        del xp
        return numbers

    @classmethod
    def number_keys(cls) -> tuple[str, ...]:
        """The keys of its numbers."""
        return tuple(key for key in cls.model_fields if key not in ("law", "direction"))

    @classmethod
    def defaults(cls) -> dict[str, float]:
        """The numbers that may be left out, with what they are then."""
        fields = cls.model_fields
        return {key: fields[key].default for key in cls.number_keys() if not fields[key].is_required()}

    def at(self, slip_speed: float) -> float:
        """μ at a slip speed (m/s)."""
        numbers = {key: np.asarray(getattr(self, key)) for key in self.number_keys()}
        return float(self.mu(np.asarray(slip_speed), np, **self.prepared(np, **numbers)))

    def constant(self, coefficient: float) -> dict[str, Any]:
        """The table `friction` with the same μ at every slip speed in place of this law, along the same direction."""
        return {"law": "constant", "coefficient": coefficient, "direction": self.direction}


class Drum(Table):
    """The drum's speed in rad/s; its sign is the sense of rotation."""

    speed: Annotated[Schedule, Scheduled("rad/s")]


class Temperature(Table):
    """Temperature of the lining: heat capacity in J/K, cooling in W/K, and the fade of friction in 1/K."""

    heat_capacity: Annotated[float, Quantity("J/K", above=0)]
    cooling: Annotated[float, Quantity("W/K", least=0)] = 0.0
    fade: Annotated[float, Quantity("1/K", least=0)] = 0.0


class Damping(Table):
    """Structural damping: the fraction of critical damping of every mode."""

    ratio: Coefficient


class Forcing(Table):
    """A harmonic force, amplitude sin(2 pi frequency t + phase), coordinate by coordinate.

    Amplitudes in N, for rotations in N m, for elastic modes in N/kg^0.5.
    """

    amplitude: Annotated[dict[str, float], PerCoordinate("N", "N*m", "N/kg^0.5")]
    frequency: Annotated[float, Quantity("Hz", above=0)]
    phase: Annotated[float, Quantity("rad")] = 0.0

    @model_validator(mode="after")
    def _acts_on_something(self) -> "Forcing":
        if not any(self.amplitude.values()):
            raise SceneError('no coordinate has a force; write one such as { Y = "10 N" }', ("amplitude",))
        return self


class Steady(Table):
    """Which state counts as steady sliding."""

    state: Literal["uniform-pressure", "self-consistent"] = "uniform-pressure"


class Start(Table):
    """The initial perturbation of steady sliding, coordinate by coordinate: m and rad, m/s and rad/s.

    Of elastic modes in m kg^0.5 and m kg^0.5/s.
    """

    displacement: Annotated[dict[str, float], PerCoordinate("m", "rad", "m*kg^0.5")] = Field(default_factory=dict)
    velocity: Annotated[dict[str, float], PerCoordinate("m/s", "rad/s", "m*kg^0.5/s")] = Field(default_factory=dict)


class Simulate(Table):
    """The transient: duration in s, sample rate in Hz, relative tolerance, method, and the coordinates that move."""

    duration: Annotated[float, Quantity("s", above=0)]
    sample_rate: Annotated[float, Quantity("Hz", above=0)]
    tolerance: Annotated[float, Quantity("", least=LEAST_TOLERANCE, most=MOST_TOLERANCE)] = 1e-6
    solver: Literal["auto", "tsit5", "dopri5", "dopri8", "sdirk4"] = "auto"
    coordinates: Annotated[Literal["auto"] | tuple[str, ...], BeforeValidator(_coordinates)] = "auto"

    @model_validator(mode="after")
    def _holds_whole_intervals(self) -> "Simulate":
        count = self.duration * self.sample_rate
        place: KeyPath = ("duration",)
        if count > _MOST_SAMPLES:
            size = f"{count:.3g} samples would make a history of about {count * BYTES_PER_SAMPLE / 1e9:.3g} GB"
            cure = f"shorten the duration or lower the sample rate to at most {_MOST_SAMPLES:.0e} samples"
            raise SceneError(f"{size}; {cure}", place, self.duration)
        # Relative for short runs, and never so much that a real fraction of a sample passes in a long one.
        if abs(count - round(count)) > min(1e-6 * count, 1e-3):
            nearest = max(1, round(count)) / self.sample_rate
            rate = f"the sample rate of {self.sample_rate!r} Hz"
            fits = f"the nearest duration that fits is {nearest:.12g} s"
            raise SceneError(f"the duration must be a whole number of samples at {rate}; {fits}", place, self.duration)
        return self
