"""Coordinates by their names: what kind of motion each is, and in which units. Knows no JAX.

The rigid motion of a shoe at its centre of gravity is X, Y, Z and the small rotations Tx, Ty, Tz. Where it bends, E1,
E2 and so on are the amplitudes of its mass-normalised free modes, by rising frequency. A block or a disc has a few of
the rigid ones.
"""

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

COORDINATES = ("X", "Y", "Z", "Tx", "Ty", "Tz")
"""The six coordinates of a rigid shoe: displacements in m, rotations in rad."""
MOST_SHOWN = 6  # coordinates that a table has columns for, and a legend room

_ROTATION, _ELASTIC = re.compile("T[xyz]"), re.compile("E[1-9][0-9]*")


class Kind(NamedTuple):
    """What a coordinate is: its unit, the same in the name of a column, and the unit of its mass."""

    unit: str
    column_unit: str
    mass_unit: str


DISPLACEMENT = Kind("m", "m", "kg")
ROTATION = Kind("rad", "rad", "kg m²")
ELASTIC = Kind("m kg^0.5", "m_kg0.5", "1")


def kind_of(name: str) -> Kind:
    """What the coordinate of that name is: a displacement unless its name says otherwise."""
    if _ELASTIC.fullmatch(name):
        return ELASTIC
    return ROTATION if _ROTATION.fullmatch(name) else DISPLACEMENT


def is_rotation(name: str) -> bool:
    """Whether it is an angle."""
    return kind_of(name) is ROTATION


def is_elastic(name: str) -> bool:
    """Whether it is the amplitude of a free mode of a body that bends."""
    return kind_of(name) is ELASTIC


def unit_of(name: str, prefix: str = "") -> str:
    """The unit of a coordinate, m, rad or m kg^0.5, with a prefix such as µ."""
    return f"{prefix}{kind_of(name).unit}"


def column_unit(name: str) -> str:
    """The same as part of the name of a column: without blanks."""
    return kind_of(name).column_unit


def mass_unit(name: str) -> str:
    """The unit of a coordinate's mass."""
    return kind_of(name).mass_unit


def at_surface(name: str) -> str:
    """What a coordinate's displacement of the lining is called: R Tz for a rotation, of which R is the lever."""
    return f"R {name}" if is_rotation(name) else f"{name} at the lining" if is_elastic(name) else name


def units_of(names: Iterable[str], rate: str = "") -> str:
    """The units of several coordinates in one line, "m (X, Y), rad (Tz)"; of their rates with a rate such as "/s"."""
    members: dict[Kind, list[str]] = {}
    for name in names:
        members.setdefault(kind_of(name), []).append(name)
    return ", ".join(f"{kind.unit}{rate} ({_listed(kind, same)})" for kind, same in members.items())


def _listed(kind: Kind, names: list[str]) -> str:
    return f"{names[0]} to {names[-1]}" if kind is ELASTIC and len(names) > 2 else ", ".join(names)


def place_of(name: str) -> int:
    """The place of a coordinate among all of a shoe: the six rigid ones first, then the elastic ones by number."""
    return len(COORDINATES) - 1 + int(name[1:]) if is_elastic(name) else COORDINATES.index(name)


def name_at(place: int) -> str:
    """The coordinate that has this place."""
    return COORDINATES[place] if place < len(COORDINATES) else f"E{place - len(COORDINATES) + 1}"


def in_order(names: Iterable[str]) -> tuple[str, ...]:
    """The names of a shoe's coordinates, each once, in their order."""
    return tuple(sorted(set(names), key=place_of))


def is_coordinate(name: object) -> bool:
    """Whether a shoe may have a coordinate of that name."""
    return name in COORDINATES or (isinstance(name, str) and is_elastic(name))


def largest_of(sizes: Mapping[str, float], most: int = MOST_SHOWN) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names of the largest sizes, as many as are shown, and the others; both in the order of all."""
    largest = sorted(sizes, key=lambda name: -sizes[name])[:most]
    return tuple(name for name in sizes if name in largest), tuple(name for name in sizes if name not in largest)
