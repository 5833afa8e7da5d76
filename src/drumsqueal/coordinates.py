"""Coordinates by their names: what kind of motion each is, and in which units. Knows no JAX.

The rigid motion of a shoe at its centre of gravity is X, Y, Z and the small rotations Tx, Ty, Tz. Where it bends, E1,
E2 and so on are the amplitudes of its mass-normalised free modes, by rising frequency; drum.E1 and so on are those of
a drum that bends, held at its hub. Where these end at E4, S5, S6 and so on are how the body yields besides, nearly
statically, to the lining's stiffness and to springs. Of several shoes, each has its name before them: leading.X,
leading.E1. A block or a disc has a few of the rigid ones.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from string import digits
from typing import NamedTuple

COORDINATES = ("X", "Y", "Z", "Tx", "Ty", "Tz")
"""The six coordinates of a rigid shoe: displacements in m, rotations in rad."""
DRUM = "drum."
"""What the names of a drum's coordinates begin with."""
MOST_SHOWN = 6  # coordinates that a table has columns for, and a legend room

_ROTATION, _ELASTIC = re.compile(r"(?:[\w-]+\.)?T[xyz]"), re.compile(r"(?:[\w-]+\.)?([ES])([1-9][0-9]*)")
_RIGID = re.compile(rf"(?:(?!drum\.)[\w-]+\.)?(?:{'|'.join(COORDINATES)})")


class CoordinateKind(NamedTuple):
    """What a coordinate is: its unit, the same in the name of a column, and the unit of its mass."""

    unit: str
    column_unit: str
    mass_unit: str


DISPLACEMENT = CoordinateKind("m", "m", "kg")
ROTATION = CoordinateKind("rad", "rad", "kg m²")
ELASTIC = CoordinateKind("m kg^0.5", "m_kg0.5", "1")


def kind_of(name: str) -> CoordinateKind:
    """What the coordinate of that name is: a displacement unless its name says otherwise."""
    if _ELASTIC.fullmatch(name):
        return ELASTIC
    return ROTATION if _ROTATION.fullmatch(name) else DISPLACEMENT


def is_rotation(name: str) -> bool:
    """Whether it is an angle."""
    return kind_of(name) is ROTATION


def is_elastic(name: str) -> bool:
    """Whether it is the amplitude of a shape in which a body bends."""
    return kind_of(name) is ELASTIC


def is_static(name: str) -> bool:
    """Whether that shape is no mode of the body, but one in which it yields beside its modes."""
    match = _ELASTIC.fullmatch(name)
    return match is not None and match[1] == "S"


def shape_names(modes: int, shapes: int, prefix: str = "") -> tuple[str, ...]:
    """Names of so many shapes of a body, the first of which are its modes."""
    return tuple(f"{prefix}{'E' if k <= modes else 'S'}{k}" for k in range(1, shapes + 1))


def is_of_drum(name: str) -> bool:
    """Whether it is that of the drum, not of a shoe."""
    return name.startswith(DRUM)


def shoe_of(name: str) -> str:
    """The name of the shoe that it is of, with a point; "" where there is one shoe, or for the drum's."""
    return "" if is_of_drum(name) else name[: name.rfind(".") + 1]


def number_of(name: str) -> int:
    """The number of an elastic mode of its body, from 1."""
    match = _ELASTIC.fullmatch(name)
    assert match is not None
    return int(match[2])


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
    """How a coordinate's displacement of the lining is called: R Tz for a rotation, R its characteristic length."""
    return f"R {name}" if is_rotation(name) else f"{name} at the lining" if is_elastic(name) else name


def units_of(names: Iterable[str], rate: str = "") -> str:
    """The units of several coordinates in one line, "m (X, Y), rad (Tz)"; of their rates with a rate such as "/s"."""
    members: dict[CoordinateKind, list[str]] = {}
    for name in names:
        members.setdefault(kind_of(name), []).append(name)
    return ", ".join(f"{kind.unit}{rate} ({listed(same)})" for kind, same in members.items())


def listed(names: Sequence[str]) -> str:
    """Names of coordinates in one line, "X, Y, E1 to E15, S16, S17": three shapes and more that follow each other."""
    rows = [list(row) for _, row in groupby(enumerate(names), lambda each: _row_of(*each))]
    return ", ".join(
        f"{row[0][1]} to {row[-1][1]}" if len(row) > 2 else ", ".join(name for _, name in row) for row in rows
    )


def _row_of(place: int, name: str) -> tuple[str, int]:
    return (name.rstrip(digits), number_of(name) - place) if is_elastic(name) else (name, place)


def place_of(name: str) -> int:
    """The place of a coordinate among all: a shoe's six rigid ones, its elastic ones by number, then the drum's."""
    if not is_elastic(name):
        return COORDINATES.index(name.rpartition(".")[2])
    # 10_000 beyond the places of all of a shoe's coordinates
    return 10_000 * is_of_drum(name) + len(COORDINATES) - 1 + number_of(name)


def in_order(names: Iterable[str]) -> tuple[str, ...]:
    """The names of coordinates, each once, in their order; those of several shoes as the shoes come first in it."""
    once = list(dict.fromkeys(names))
    shoes = list(dict.fromkeys(map(shoe_of, once)))
    return tuple(sorted(once, key=lambda name: (is_of_drum(name), shoes.index(shoe_of(name)), place_of(name))))


def is_coordinate(name: object) -> bool:
    """Whether a shoe or a drum may have a coordinate of that name."""
    return isinstance(name, str) and (_RIGID.fullmatch(name) is not None or is_elastic(name))


def largest_of(sizes: Mapping[str, float], most: int = MOST_SHOWN) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names of the largest sizes, as many as are shown, and the others; both in the order of all."""
    largest = sorted(sizes, key=lambda name: -sizes[name])[:most]
    return tuple(name for name in sizes if name in largest), tuple(name for name in sizes if name not in largest)
