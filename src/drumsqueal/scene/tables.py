"""The tables of a scene as frozen, checked models."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    StrictBool,
    field_validator,
    model_serializer,
    model_validator,
)

from drumsqueal.scene.mesh import FOUND, SIZES, DrumMesh, ShoeMesh, ShoeModes, with_what_its_file_gives
from drumsqueal.scene.quantities import (
    Direction,
    KeyPath,
    PerCoordinate,
    Point,
    Quantities,
    Quantity,
    Resolution,
    SceneError,
    Schedule,
    Scheduled,
    Table,
    check_rising,
    listed_coordinates,
    without_controls,
)
from drumsqueal.scene.usual import Usual

MOST_POINTS = 50  # of a measured curve of friction, where the contact is cut, or of pressure
BYTES_PER_SAMPLE = 200  # of the history: six displacements, six velocities and a dozen signals
BYTES_PER_MODE = 16  # more for each free mode


Title = Annotated[str, Field(strict=True, max_length=1000), AfterValidator(without_controls)]
Length = Annotated[float, Quantity("m", above=0)]
LEAST_TOLERANCE, MOST_TOLERANCE = 1e-12, 1e-1  # less is round-off
Stiffness = Annotated[float, Quantity("N/m", least=0)]
Coefficient = Annotated[float, Quantity("", least=0)]


def check_points(curve: Mapping[str, tuple[float, ...]], cure: str = "") -> None:
    """Raise SceneError unless a measured curve has as many of the second key as of the first, 2 to `MOST_POINTS`."""
    (place, places), (value, values) = curve.items()
    count = len(places)
    if count != len(values):
        reason = f"{len(values)} {value}s for {count} {place}s; write one for every {place}"
        raise SceneError(reason, (value,), values)
    if not 2 <= count <= MOST_POINTS:
        reason = f"{count} point{'s' if count != 1 else ''}; write 2 to {MOST_POINTS}{cure}"
        raise SceneError(reason, (place,), places)


class Elasticity(Table):
    """The shoe's own elasticity: by its free modes, and by how it yields besides in the modes of the brake."""

    young: Annotated[float, Quantity("Pa", above=0)]
    """Young's modulus."""
    poisson: Annotated[float, Quantity("", least=0, most=0.49, usual="0.3")]
    """Poisson's ratio. Quadratic elements lock near 0.5, so it may be 0.49 at most."""
    up_to: Annotated[float | Literal["auto"], Resolution("Hz", above=0)] = "auto"
    """Up to which frequency motion is resolved; "auto" for as far as growth rates stay within 1 1/s or 1 %."""


class DrumElasticity(Table):
    """The drum's own elasticity: a cup, clamped at its hub.

    A ring from the shoe's outer radius outwards, |z − offset| ≤ width/2, and a back plate from z = offset + width/2
    outwards, which reaches from the hub to the ring's outer radius.
    """

    thickness: Length
    """Of the ring, which begins at the shoe's outer radius."""
    width: Length
    """Of the ring along the drum's axis."""
    back_plate: Length
    """Thickness of the plate that joins ring and hub."""
    hub_radius: Length
    """Radius at which the plate is clamped."""
    offset: Annotated[float, Quantity("m")] = 0.0
    """How far the middle of the ring is from that of the lining, along the axis."""
    young: Annotated[float, Quantity("Pa", above=0)]
    """Young's modulus."""
    poisson: Annotated[float, Quantity("", least=0, most=0.49, usual="0.26")]
    """Poisson's ratio."""
    density: Annotated[float, Quantity("kg/m^3", above=0)]
    """Mass over volume."""
    up_to: Annotated[float | Literal["auto"], Resolution("Hz", above=0)] = "auto"
    """Up to which frequency motion is resolved; "auto" for as far as growth rates stay within 1 1/s or 1 %."""


class AtPoint(Table):
    """What acts at a point P of the shoe, along the unit vector d."""

    at: Annotated[tuple[float, ...], Point()]
    """The point P in the axes of the shoe."""
    direction: Annotated[tuple[float, ...], Direction()]
    """A vector of any length along which it acts."""
    radius: Annotated[float | None, Quantity("m", least=0)] = None
    """Of the patch over which u(P) is a mean if the shoe bends; 0 is the point, by default a tenth of its thickness."""


class PointSpring(AtPoint):
    """A spring to the ground at a point P of the shoe, along the unit vector d: force −(k d·u(P) + c d·u̇(P)) d."""

    stiffness: Stiffness
    """k."""
    damping: Annotated[float, Quantity("N*s/m", least=0)] = 0.0
    """c."""


class PointForce(AtPoint):
    """A force at a point P of the shoe, along a direction."""

    size: Annotated[Schedule, Scheduled("N")]
    """The force; a negative one acts against the direction."""


class ShoeTable(Table):
    """The shoe, an annular sector.

    Springs and forces act at points of it; without `elastic` it is rigid. With `mesh` it is a solid mesh of the user's
    own, whose lining gives the lengths and the angle; the thickness is then its volume over the area of the lining.
    With `modes` it is what the modal results of another code hold, which give all but how many of them are kept.
    """

    outer_radius: Length
    """R, of the lining's surface and of the drum."""
    thickness: Length
    """From the lining's surface to the inner side; less than the radius."""
    width: Length
    """b, along the drum's axis."""
    arc_angle: Annotated[float, Quantity("rad", above=0)]
    """β, of the lining along the drum; 360 deg at most."""
    density: Annotated[float, Quantity("kg/m^3", above=0)]
    """Mass over volume."""
    elastic: Elasticity | None = None
    """Makes the shoe bend."""
    mesh: ShoeMesh | None = None
    """Its solid mesh in place of the sector."""
    modes: ShoeModes | None = None
    """The modal results of another code in place of the sector."""
    spring: tuple[PointSpring, ...] = ()
    """Springs at points."""
    force: tuple[PointForce, ...] = ()
    """Forces at points."""

    @property
    def sector(self) -> dict[str, Any]:
        """The numbers of the body alone: lengths, arc angle and density, by key."""
        return {key: value for key, value in self if isinstance(value, float)}

    @property
    def with_radii(self) -> "ShoeTable":
        """The same with the radius of each patch, also where none is written; without any where the shoe is rigid."""

        def on_patch(each: AtPoint) -> AtPoint:
            # 0.1 of the thickness: a pin or roller touches over millimetres, and a shoe is drawn no finer
            radius = 0.1 * self.thickness if each.radius is None else each.radius
            return each.model_copy(update={"radius": None if self.elastic is None else radius})

        lists = {"spring": self.spring, "force": self.force}
        return self.model_copy(update={key: tuple(map(on_patch, some)) for key, some in lists.items()})

    @property
    def solid(self) -> ShoeMesh | ShoeModes | None:
        """The file that gives the shoe; None of a sector."""
        return self.mesh or self.modes

    @property
    def found(self) -> tuple[str, ...]:
        """The dotted keys of its numbers that follow from its file, and are not written."""
        return FOUND if self.modes is not None else SIZES if self.mesh is not None else ()

    @property
    def in_plane(self) -> bool:
        """Whether all springs and forces at points lie in the plane z = 0, with their directions."""
        return all(each.at[2] == 0 and each.direction[2] == 0 for each in (*self.spring, *self.force))

    @model_serializer(mode="wrap")
    def _write_what_is_there(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        written = {k: each for k, each in write(self).items() if each not in (None, (), []) and k not in self.found}
        if self.modes is not None and "elastic" in written:
            written["elastic"] = {k: each for k, each in written["elastic"].items() if f"elastic.{k}" not in self.found}
        return written

    @model_validator(mode="before")
    @classmethod
    def _has_what_its_file_gives(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or (data.get("mesh") is None and data.get("modes") is None):
            return data
        return with_what_its_file_gives(data)

    @model_validator(mode="after")
    def _bends_as_its_modes(self) -> "ShoeTable":
        if self.modes is not None and self.elastic is not None:
            lists = (("spring", self.spring), ("force", self.force))
            points = [((name, k, "at"), each.at) for name, some in lists for k, each in enumerate(some)]
            up_to = self.elastic.up_to
            self.modes.check_reaches(0.0 if up_to == "auto" else up_to, points)
        return self

    @model_validator(mode="after")
    def _is_a_sector(self) -> "ShoeTable":
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
    """The support springs of the paper."""

    upper_stiffness: Stiffness
    """k1 of the potential ½ (k1 + k2) (X² + R² sin² Tz), equation (24) of the paper."""
    lower_stiffness: Stiffness
    """k2 of it."""


class ContactTable(Table):
    """The lining, which is pressed on the drum.

    Its pressure over compression u > 0 is a line, stiffness u, with `hardening` stiffness u + hardening u², or a
    measured curve.
    """

    # A law is a subclass of `NormalLaw` in `physics/effects/pressure.py`, over its keys here and their usual ranges.

    usual: ClassVar[Mapping[str, Usual]] = {
        # Modulus over thickness: rubbery linings 10 MPa over 20 mm, hard ones under pressure 10 GPa over 3 mm; the
        # paper's is 3.5e10 N/m^3.
        "stiffness": Usual(1e8, 1e13, "N/m^3", "1e8 to 1e13 N/m^3", (("N/mm^3", 1e9),)),
        # From a tenth more at 5 MPa, of hard linings, to what triples a soft one's stiffness at 1 kPa.
        "hardening": Usual(1e9, 1e20, "N/m^4", "1e9 to 1e20 N/m^4", (("N/mm^4", 1e12),)),
        # Rubbery linings under the pressure of a stop yield by 3 mm.
        "compression": Usual(0, 0.005, "m", "up to 5 mm", (("mm", 1e-3), ("um", 1e-6))),
        "pressure": Usual(0, 1e8, "Pa", "up to 100 MPa"),
    }
    """What drum brakes have."""

    stiffness: Annotated[float | None, Quantity("N/m^3", least=0)] = None
    """k_c, pressure over compression of the lining; with `hardening` its slope at u = 0, and above 0."""
    hardening: Annotated[float | None, Quantity("N/m^4", least=0)] = None
    """Of the pressure over the square of the compression; none if left out."""
    compression: Annotated[tuple[float, ...] | None, Quantities(Quantity("m", least=0), '["0 mm", "0.05 mm"]')] = None
    """Of a measured curve in place of both, rising from 0, 2 to 50 points."""
    pressure: Annotated[tuple[float, ...] | None, Quantities(Quantity("Pa", least=0), '["0 MPa", "1.2 MPa"]')] = None
    """At these, rising from 0; smooth between the points, and beyond the last one with the slope there."""
    normal_load: Annotated[Schedule, Scheduled("N", least=0)] = 0.0
    """Force that presses the lining on the drum, spread evenly; to be left out where forces push the shoe alone."""
    separation: StrictBool = True
    """Whether the lining can lift off; without it the contact also pulls, as in the linear model."""

    @property
    def linear(self) -> bool:
        """Whether its pressure is a line over the compression."""
        return not any(getattr(self, key) for key in self.usual if key != "stiffness")

    @model_serializer(mode="wrap")
    def _write_its_law(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: each for key, each in write(self).items() if each is not None}

    @model_validator(mode="after")
    def _has_one_law(self) -> "ContactTable":
        curve = [key for key in ("compression", "pressure") if getattr(self, key) is not None]
        numbers = [key for key in ("stiffness", "hardening") if getattr(self, key) is not None]
        if curve and numbers:
            reason = f"a curve takes the place of stiffness and hardening; remove {' and '.join(curve)}"
            whole = "--set 'contact={compression = [...], pressure = [...], normal_load = ...}' sets a curve as a whole"
            reason = f"{reason}, or {' and '.join(numbers)}: {whole}"
            raise SceneError(reason, (numbers[-1],), getattr(self, numbers[-1]))
        if len(curve) == 1:
            other = "pressure" if curve == ["compression"] else "compression"
            raise SceneError(f"{curve[0]} is one half of a curve; add the other", (other,))
        if not curve and self.stiffness is None:
            example = 'stiffness = "0.35e11 N/m^3"'
            reason = f"the key is missing; add it, such as {example}, or a curve's compression and pressure"
            raise SceneError(reason, ("stiffness",))
        if self.hardening is not None and self.stiffness == 0:
            reason = "a lining that hardens begins with a stiffness above 0; raise it, or remove contact.hardening"
            raise SceneError(reason, ("stiffness",), self.stiffness)
        return self

    @model_validator(mode="after")
    def _has_a_rising_curve(self) -> "ContactTable":
        if self.compression is None or self.pressure is None:
            return self
        curve = {"compression": self.compression, "pressure": self.pressure}
        check_points(curve)
        for (key, values), unit in zip(curve.items(), ("m", "Pa"), strict=True):
            if values[0] != 0:
                raise SceneError("a lining that is not compressed does not press; begin with 0", (key, 0), values[0])
            check_rising(values, key, f"the values of the curve must increase; write one above {{!r}} {unit}")
        return self


class FrictionTable(Table, ABC):
    """The friction of lining and drum: a law, μ as a function of the slip speed s, along a direction."""

    # A law is one file in `scene/laws`: a subclass with its keys and what is asked for here. Its functions take the
    # law's numbers by key, in SI, and the library they are in as `xp`: `numpy` or `jax.numpy`, traced. Whether one
    # of the numbers may vanish where the brake is varied is read off the limits of its field.

    name: ClassVar[str]
    """What it is called in sentences, such as "exponential law"."""
    usual: ClassVar[Mapping[str, Usual]]
    """What drum brakes have, for every number by its key."""

    direction: Literal["unit-velocity", "tangential"] = "unit-velocity"
    """Along the unit slip velocity, or along the drum alone."""
    law: str
    """How μ depends on the slip speed s."""

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
    """What turns; without `elastic` and `mesh` it is rigid."""

    speed: Annotated[Schedule, Scheduled("rad/s")]
    """Ω; its sign is the sense of rotation."""
    elastic: DrumElasticity | None = None
    """Makes the drum bend, as a cup."""
    mesh: DrumMesh | None = None
    """The drum's solid mesh in place of the cup."""

    @field_validator("mesh")
    @classmethod
    def _has_what_its_mesh_names(cls, mesh: DrumMesh | None) -> DrumMesh | None:
        return mesh and mesh.checked()

    @model_validator(mode="after")
    def _is_one_drum(self) -> "Drum":
        if self.elastic is not None and self.mesh is not None:
            raise SceneError("an elastic drum is a cup or a mesh; leave out [drum.elastic] or [drum.mesh]", ("mesh",))
        return self


class TemperatureTable(Table):
    """Temperature ϑ of the lining above its surroundings: C dϑ/dt = heat of friction − h ϑ, from ϑ = 0."""

    heat_capacity: Annotated[float, Quantity("J/K", above=0)]
    """C of the lining."""
    cooling: Annotated[float, Quantity("W/K", least=0)] = 0.0
    """h, to the surroundings."""
    fade: Annotated[float, Quantity("1/K", least=0)] = 0.0
    """By which friction falls: μ is multiplied by max(0, 1 − fade ϑ)."""


class DampingTable(Table):
    """Structural damping."""

    ratio: Coefficient
    """Fraction of critical damping of every mode of the frictionless brake."""


class ForcingTable(Table):
    """A harmonic force, amplitude sin(2π frequency t + phase), coordinate by coordinate."""

    amplitude: Annotated[dict[str, float], PerCoordinate("N", "N*m", "N/kg^0.5", '"10 N"')]
    """Of the force, for each coordinate."""
    frequency: Annotated[float, Quantity("Hz", above=0)]
    """Of the force."""
    phase: Annotated[float, Quantity("rad")] = 0.0
    """Of the force at t = 0."""

    @model_validator(mode="after")
    def _acts_on_something(self) -> "ForcingTable":
        if not any(self.amplitude.values()):
            raise SceneError('no coordinate has a force; write one such as { Y = "10 N" }', ("amplitude",))
        return self


class Steady(Table):
    """Which state counts as steady sliding."""

    state: Literal["uniform-pressure", "self-consistent"] = "uniform-pressure"
    """Whether the assembly balances every static force, as in the paper, or applies the load alone."""


class StartTable(Table):
    """The initial perturbation of steady sliding, coordinate by coordinate."""

    displacement: Annotated[dict[str, float], PerCoordinate("m", "rad", "m*kg^0.5", '"1e-6 m"')] = Field(
        default_factory=dict
    )
    """From steady sliding, for each coordinate."""
    velocity: Annotated[dict[str, float], PerCoordinate("m/s", "rad/s", "m*kg^0.5/s")] = Field(default_factory=dict)
    """For each coordinate."""


# Of diffrax those that solve ordinary differential equations and estimate their error.
Solver = Literal[
    "auto", "tsit5", "dopri5", "dopri8", "sdirk4",
    "diffrax.Bosh3", "diffrax.Dopri5", "diffrax.Dopri8", "diffrax.Heun", "diffrax.ImplicitEuler", "diffrax.Kvaerno3",
    "diffrax.Kvaerno4", "diffrax.Kvaerno5", "diffrax.Midpoint", "diffrax.Ralston", "diffrax.Tsit5",
]  # fmt: skip


class Simulate(Table):
    """The transient."""

    duration: Annotated[float, Quantity("s", above=0)]
    """Of the transient."""
    sample_rate: Annotated[float, Quantity("Hz", above=0)]
    """Of the history."""
    tolerance: Annotated[float, Quantity("", least=LEAST_TOLERANCE, most=MOST_TOLERANCE)] = 1e-6
    """Relative error of a step, of the amplitude that the energy of vibration gives a coordinate."""
    solver: Solver = "auto"
    """Explicit until friction is stiff, then implicit ("auto"), one Runge-Kutta method, or diffrax with a solver."""
    coordinates: Annotated[Literal["auto"] | tuple[str, ...], BeforeValidator(listed_coordinates)] = "auto"
    """Which coordinates move; "auto" leaves out those that nothing sets in motion."""

    @model_validator(mode="after")
    def _holds_whole_intervals(self) -> "Simulate":
        count = self.duration * self.sample_rate
        place: KeyPath = ("duration",)
        most_samples = 10**8
        if count > most_samples:
            size = f"{count:.3g} samples would make a history of about {count * BYTES_PER_SAMPLE / 1e9:.3g} GB"
            cure = f"shorten the duration or lower the sample rate to at most {most_samples:.0e} samples"
            raise SceneError(f"{size}; {cure}", place, self.duration)
        # Relative for short runs, and never so much that a real fraction of a sample passes in a long one.
        if abs(count - round(count)) > min(1e-6 * count, 1e-3):
            nearest = max(1, round(count)) / self.sample_rate
            rate = f"the sample rate of {self.sample_rate!r} Hz"
            fits = f"the nearest duration that fits is {nearest:.12g} s"
            raise SceneError(f"the duration must be a whole number of samples at {rate}; {fits}", place, self.duration)
        return self
