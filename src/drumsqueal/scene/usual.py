"""What drum brakes have, from bicycles to heavy trucks, and what a number far from that was probably meant to be.

The ranges are wide on purpose: they are there for numbers in a wrong unit, not for a brake that is unusual.
"""

import functools
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from drumsqueal.scene.quantities import RPM, as_first, dotted

if TYPE_CHECKING:
    from drumsqueal.scene import Scene
    from drumsqueal.scene.tables import ShoeTable


class Usual(NamedTuple):
    """A range in SI with its unit, how numbers in it are written, and other units in which one may be meant."""

    low: float
    high: float
    unit: str
    written: str
    meant: tuple[tuple[str, float], ...] = ()


_LENGTH = (("mm", 1e-3), ("cm", 1e-2))
_PER_CENT = (("%", 1e-2),)
_STIFFNESS = (("N/mm", 1e3), ("kN/mm", 1e6))
# Moulded lining 1500 kg/m^3, aluminium 2700 kg/m^3, cast iron 7200 kg/m^3, steel 7850 kg/m^3.
_DENSITY = Usual(1000, 10_000, "kg/m^3", "1000 to 10000 kg/m^3", (("g/cm^3", 1e3),))
# Moulded plates 1 GPa, aluminium 70 GPa, cast iron 120 GPa, steel 210 GPa.
_YOUNG = Usual(1e9, 5e11, "Pa", "1 to 500 GPa", (("GPa", 1e9), ("MPa", 1e6)))
_POISSON = Usual(0.05, 0.45, "", "0.05 to 0.45", _PER_CENT)
_PATCH = Usual(1e-4, 0.1, "m", "0.1 to 100 mm", _LENGTH)
_DEGREE = 0.017453292519943295  # rad

USUAL = {
    # Hub brakes of bicycles have drums of 70 mm across, trucks of 410 to 460 mm, and off-road machines more.
    "shoe.outer_radius": Usual(0.03, 0.5, "m", "30 to 500 mm", _LENGTH),
    # A bare plate, or platform, web and lining taken together.
    "shoe.thickness": Usual(0.002, 0.1, "m", "2 to 100 mm", _LENGTH),
    # Bicycles 15 to 30 mm, cars 30 to 60 mm, rear axles of trucks up to 250 mm.
    "shoe.width": Usual(0.01, 0.4, "m", "10 to 400 mm", _LENGTH),
    # One of two shoes covers 180 deg at most; linings are 60 to 140 deg long.
    "shoe.arc_angle": Usual(20 * _DEGREE, 180 * _DEGREE, "rad", "20 to 180 deg", (("deg", _DEGREE),)),
    "shoe.density": _DENSITY,
    "shoe.elastic.young": _YOUNG,
    "shoe.elastic.poisson": _POISSON,
    **{
        f"drum.{table}.{key}": usual
        for table in ("elastic", "mesh")
        for key, usual in (("density", _DENSITY), ("young", _YOUNG), ("poisson", _POISSON))
    },
    # Cast iron 12 mm over 60 mm for cars, 20 mm over 250 mm for trucks; pressed steel from 3 mm.
    "drum.elastic.thickness": Usual(0.002, 0.05, "m", "2 to 50 mm", _LENGTH),
    "drum.elastic.width": Usual(0.01, 0.4, "m", "10 to 400 mm", _LENGTH),
    "drum.elastic.back_plate": Usual(0.002, 0.05, "m", "2 to 50 mm", _LENGTH),
    "drum.elastic.hub_radius": Usual(0.01, 0.3, "m", "10 to 300 mm", _LENGTH),
    # From a return spring (10 N/mm) to a pin that is as good as rigid; 0 stands for none.
    "shoe.spring.0.stiffness": Usual(1e4, 1e12, "N/m", "1e4 to 1e12 N/m", _STIFFNESS),
    # From a return spring in grease to 2 % of loss in such a pin at 1 kHz; 0 stands for none.
    "shoe.spring.0.damping": Usual(1e-2, 1e7, "N*s/m", "0.01 to 1e7 N s/m"),
    # From what a pointed abutment touches to half a wide shoe; 0 stands for the point.
    "shoe.spring.0.radius": _PATCH,
    "shoe.force.0.radius": _PATCH,
    # Fingers on a lever give 10 N at a shoe's tip, an air chamber on an S-cam 100 kN.
    "shoe.force.0.size": Usual(1, 3e5, "N", "1 N to 300 kN", (("kN", 1e3),)),
    # From a return spring (10 N/mm) to solid steel between the shoe and the back plate; 0 stands for none.
    "support.upper_stiffness": Usual(1e4, 1e11, "N/m", "1e4 to 1e11 N/m", _STIFFNESS),
    "support.lower_stiffness": Usual(1e4, 1e11, "N/m", "1e4 to 1e11 N/m", _STIFFNESS),
    # Fingers on a lever give 50 N, an air chamber of 30 square inches on an S-cam 100 kN a shoe.
    "contact.normal_load": Usual(10, 3e5, "N", "10 N to 300 kN", (("kN", 1e3),)),
    # A car at 200 km/h turns its wheels at 180 rad/s, a scooter with small ones at 100 km/h at 140 rad/s.
    "drum.speed": Usual(0, 300, "rad/s", "up to 300 rad/s (2865 rpm)", (("rpm", RPM), ("deg/s", _DEGREE))),
    # Bare steel parts 0.0005, bolted and lined ones a few per cent.
    "damping.ratio": Usual(0, 0.1, "", "0 to 0.1 (10 %)", _PER_CENT),
}
"""By dotted key; those of the laws of friction and of the contact stand beside their keys."""

# SAE J866 sorts linings from below 0.15 to above 0.55; wet ones have less, rusted and sintered ones more.
STATIC = Usual(0.05, 1.2, "", "0.05 to 1.2", _PER_CENT)
SLIDING = Usual(0.05, 1.0, "", "0.05 to 1", _PER_CENT)


def unusual(scene: "Scene") -> Iterator[str]:
    """What no drum brake has, a sentence each: the key, its value, the usual range and what may be meant.

    A value of 0, which takes an effect out, is not unusual.
    """
    yield from _turned_too_far(scene)
    found = (said for k, one in enumerate(scene.alone) for said in _unusual(one, functools.partial(scene.key_of, k)))
    yield from dict.fromkeys(found)  # what several shoes share is said once


def _turned_too_far(scene: "Scene") -> Iterator[str]:
    """Positions beyond a full turn, which are degrees without their unit."""
    shoes: Any = scene.shoes if scene.several else ()
    for k, shoe in enumerate(shoes):
        if abs(shoe.position) > math.tau:
            yield (
                f"shoe.{k}.position = {shoe.position:g} rad is more than a full turn, {math.tau:.4g} rad; "
                f"did you mean {shoe.position:g} deg?"
            )


def _unusual(scene: "Scene", key_of: Callable[[str], str]) -> Iterator[str]:
    """That of the brake of one shoe; `key_of` makes the keys those of the whole scene."""
    numbers = scene.numbers()
    tables = (("friction", scene.friction), ("contact", scene.contact))
    own = {f"{name}.{key}": each for name, table in tables if table for key, each in table.usual.items()}
    for key, usual in (USUAL | own).items():
        for path, values in numbers.items():
            if as_first(path) not in (key, f"{key}.value"):
                continue
            for index, value in enumerate(values if isinstance(values, tuple) else (values,)):
                if value != 0 and not usual.low <= abs(value) <= usual.high:
                    place = key_of(path)
                    yield _remark(dotted((place, index)) if isinstance(values, tuple) else place, value, usual)
                    break  # of a profile, the first one
    yield from _far_away(scene.shoe, key_of)
    static, kinetic = numbers.get("friction.static"), numbers.get("friction.kinetic")
    if isinstance(static, float) and isinstance(kinetic, float) and static < kinetic:
        above = f"{key_of('friction.kinetic')} = {kinetic:g}"
        yield (
            f"{key_of('friction.static')} = {static:g} is below {above}: friction then rises with the slip speed, and "
            "brakes have it the other way round; did you mean to exchange them?"
        )


def _far_away(shoe: "ShoeTable", key_of: Callable[[str], str]) -> Iterator[str]:
    for name, points in (("spring", shoe.spring), ("force", shoe.force)):
        for k, point in enumerate(points):
            distance = math.hypot(*point.at)
            # No point of a shoe is further from the middle of the drum than twice its radius.
            if distance > 2 * shoe.outer_radius:
                place = f"{key_of(f'shoe.{name}.{k}.at')} is {distance:.4g} m from the middle of the drum"
                yield f"{place}, whose radius is {shoe.outer_radius:.4g} m: the point is far from the shoe."


def _remark(place: str, value: float, usual: Usual) -> str:
    unit = f" {usual.unit}" if usual.unit else ""
    message = f"{place} = {value:g}{unit} is far from what drum brakes have, {usual.written}"
    for other, size in usual.meant:
        if usual.low < abs(value) * size <= usual.high:
            return f"{message}; did you mean {value:g} {other}?"
    return f"{message}."
