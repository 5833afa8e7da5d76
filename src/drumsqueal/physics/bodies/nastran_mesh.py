"""Meshes of Nastran (.bdf), with what may change mass or places read, or refused by name and line."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.mesh_files import (
    FITTING,
    Block,
    Line,
    MeshFile,
    Reals,
    in_blocks,
    indices_of,
    read_included,
    read_lines,
    to_real,
    to_whole,
)

# Kinds by how many nodes there are. Of faces, corners alone are needed, and numbers behind them are no nodes.
SOLIDS = {
    "CTETRA": {4: "tetra", 10: "tetra10"},
    "CHEXA": {8: "hexahedron", 20: "hexahedron20"},
    "CPENTA": {6: "wedge", 15: "wedge15"},
    "CPYRAM": {5: "pyramid", 13: "pyramid13"},
    "CPYRA": {5: "pyramid", 13: "pyramid13"},
}
FACE_CORNERS = {
    **dict.fromkeys(("CTRIA3", "CTRIAR", "CTRIA6"), 3),
    **dict.fromkeys(("CQUAD4", "CQUADR", "CQUAD8", "CQUAD", "CQUAD9", "CSHEAR"), 4),
}
# Nastran counts the nodes in the middles of edges upwards; VTK has those of the top before the upright ones.
TO_VTK = {"hexahedron20": [*range(12), *range(16, 20), *range(12, 16)]}
BEAMS = re.compile(r"C(BAR|BEAM|BEAM3|ROD|TUBE|BEND|ONROD)$")
BEAM_PROPERTIES = re.compile(r"P(BAR|BARL|BEAM|BEAML|BEAM3|ROD|TUBE|BEND|BCOMP)$")
MASSLESS = re.compile(r"C(ELAS[1-4]|BUSH|BUSH1D|DAMP[1-5]|GAP|VISC|SEAMP|HBDY[EGP])$")
CHANGING = re.compile(
    r"CONM[12]|CMASS[1-4]|NSM|NSM1|NSML1?|NSMADD|DMIG|DMI|GENEL|CSUPER|CSUPEXT|SEBULK|SEEXCLD|SELOC|SEMPLN|GRIDB|"
    r"EGRID|GRIDG|CGEN|RELEASE|DTI|MODLIST|MFLUID|CAABSF"
)
COORDINATES = re.compile(r"CORD[12][RCS]$")
HARMLESS = re.compile(
    r"P[A-Z]+\d*|MAT[A-Z]*\d*|EIG[RLBCP]*|SPC[A-Z]*\d*|MPC[A-Z]*|RBE[123][A-Z]*|RBAR\d?|RROD|RJOINT|RTRPLT\d?|RSPLINE|RSSCON|"
    r"FORCE\d?|MOMENT\d?|PLOAD[X\d]*|GRAV|LOAD|SLOAD|TEMP[A-Z\d]*|DLOAD|RLOAD\d|TLOAD\d|DAREA|DPHASE|DELAY|LSEQ|RFORCE|"
    r"FREQ\d?|TSTEP[A-Z]*|TABLE[A-Z]*\d|TABD[A-Z]+\d|NLPARM|SUPORT\d?|ASET\d?|BSET\d?|CSET\d?|OMIT\d?|QSET\d?|USET\d?|"
    r"SPOINT|EPOINT|PARAM|SET\d?|DESVAR|DRESP\d|DCONSTR|DCONADD|DVPREL\d|DOPTPRM|BCONP|BLSEG|BFRIC|BSURFS?|BCTSET|BCTADD|"
    r"BCPROPS?|BGSET|BGADD|BGPARM|BCTPARA?M?|CREEP|ACCEL\d?|CONV[M]?|RADM|DEFORM|SNORM|CORD[A-Z\d]+|MDLPRM|NSTEP|TOPVAR|"
    r"OUTPUT|DUMMY|QBDY\d|QVOL|QHBDY|EIGRL|MONPNT\d|CAMPBLL|ROTOR[A-Z]*|RSPIN[A-Z]|AEROS?|LABEL|TITLE|SUBTITLE|ECHO"
)


class Card(NamedTuple):
    """A card's name and its fields."""

    line: Line
    name: str
    fields: list[str]

    def field(self, place: int) -> str:
        """A field by its place, 1 for the first behind the name; empty where the card ends before."""
        return self.fields[place - 1] if place <= len(self.fields) else ""

    def whole(self, place: int, default: int = 0) -> int:
        """A whole number in a field."""
        return to_whole(self.field(place) or str(default))

    def real(self, place: int) -> float:
        """A real number in a field."""
        return to_real(self.field(place))

    def refuse(self, reason: str) -> RequestError:
        """An error that names the card and where it is."""
        return RequestError(f"{self.line.where}: {self.name} {reason}")


def read_nastran(path: Path) -> MeshFile:
    """Read the bulk data; raises RequestError."""
    files = [path]
    bulk = _Bulk()
    for card in _cards(_bulk(_lines(read_lines(path), files, (path,)))):
        try:
            bulk.take(card)
        except RequestError:
            raise
        except ValueError as error:
            raise card.refuse(f"cannot be read: {error}") from None
    return bulk.finish(tuple(dict.fromkeys(files)))


def _lines(lines: list[Line], files: list[Path], opened: tuple[Path, ...]) -> Iterator[Line]:
    """Lines without comments; those of an included file stand where it is asked for."""
    rest = iter(lines)
    for line in rest:
        text = line.text.partition("$")[0].rstrip()
        if not re.match(r"\s*INCLUDE\b", text, flags=re.IGNORECASE):
            if text.strip() and not text.startswith(("//", "#")):
                yield line._replace(text=text)
            continue
        name = line.text.strip()[len("INCLUDE") :].strip()
        quote = name[:1]
        while quote in ("'", '"') and quote not in name[1:]:  # a long name goes on in the next line
            more = next(rest, None)
            if more is None:
                raise RequestError(f"{line.where}: INCLUDE has no end of its quoted name; add {quote}")
            name += more.text.strip()
        name = name[1:].partition(quote)[0] if quote in ("'", '"') else name.partition("$")[0].strip()
        found = read_included(name, line, opened)
        files.extend(each.path for each in found[:1])
        yield from _lines(found, files, (*opened, *(each.path for each in found[:1])))


def _bulk(lines: Iterator[Line]) -> Iterator[Line]:
    """What is behind BEGIN BULK, or all where there is none, and before ENDDATA."""
    every = [*lines]
    starts = [k for k, line in enumerate(every) if re.match(r"\s*BEGIN\s", line.text + " ", flags=re.IGNORECASE)]
    for k in starts:
        if k != starts[0] or not re.fullmatch(r"BEGIN(\s+BULK)?", every[k].text.strip(), flags=re.IGNORECASE):
            raise RequestError(f"{every[k].where}: {every[k].text.strip()}: one block BEGIN BULK is read; write one")
    for line in every[starts[0] + 1 if starts else 0 :]:
        if re.match(r"\s*ENDDATA\b", line.text, flags=re.IGNORECASE):
            return
        yield line


def _cards(lines: Iterator[Line]) -> Iterator[Card]:
    """Cards of small, large and free fields, with the lines that continue them."""
    card: Card | None = None
    behind = ""  # the last field of the line before, which the first of its continuation repeats
    for line in lines:
        name, fields, last = _fields(line)
        if name.startswith("="):
            raise RequestError(
                f"{line.where}: fields that repeat those of another card (=) are not read; write them out"
            )
        if name and name[0] not in "+*":
            if card is not None:
                yield card
            card = Card(line, name.rstrip("*_").upper(), fields)  # meshio writes CHEXA_ of 20 nodes
        elif card is None:
            raise RequestError(f"{line.where}: the line continues a card, and there is none before it")
        else:
            if name[1:] and behind[1:] and name[1:] != behind[1:]:
                raise RequestError(
                    f"{line.where}: the line {name} continues another card than that before it; move it there"
                )
            if len(card.fields) % 8 == 4 and name[:1] != "*":
                raise RequestError(f"{line.where}: the line continues one of large fields, and must begin with *")
            card.fields.extend(fields)
        behind = last if last[:1] in ("+", "*") else f"+{last}"
    if card is not None:
        yield card


def _fields(line: Line) -> tuple[str, list[str], str]:
    """Name, as many fields as there can be, and the mark of a continuation; set apart by commas, tabs or columns."""
    text, name, cut = line.text, line.text.split(",")[0].split("\t")[0][:8].strip(), None
    wide = name.endswith("*") or name.startswith("*")
    count = 4 if wide else 8
    if "," in text:
        cut = [each.strip() for each in text.split(",")]
    elif "\t" in text:
        pieces = [each.strip() for each in text.split("\t")]
        cut = pieces if not any(" " in each or len(each) > (16 if wide else 8) for each in pieces) else None
    if cut is None:
        text, width = text.expandtabs(8), 16 if wide else 8
        cut = [text[:8], *(text[8 + width * k : 8 + width * (k + 1)] for k in range(count)), text[72:80]]
        cut = [each.strip() for each in cut]
    name, *rest = cut
    if len(rest) > count + 1:  # a long line of free fields
        return name, rest, ""
    rest += [""] * (count + 1 - len(rest))
    return name, rest[:count], rest[count]


class _Bulk:
    """What the cards of bulk data amount to."""

    def __init__(self) -> None:
        self.grids: dict[int, Card] = {}
        self.systems: dict[int, tuple[Card, int]] = {}  # a card, and the place of its number: two stand on one CORD1
        self.default: Card | None = None
        self.elements: dict[str, list[Card]] = {}
        self.beams: list[Card] = []
        self.stiff: list[Card] = []
        self.unknown: dict[str, Card] = {}
        self.known: dict[int, Reals] = {}
        self.opened: list[int] = []

    def take(self, card: Card) -> None:
        """Take in one card; raises RequestError where it may change a mesh in a way that is not read."""
        name = card.name
        if name == "GRID":
            old = self.grids.setdefault(card.whole(1), card)
            if [old.whole(2), *map(old.real, (3, 4, 5))] != [card.whole(2), *map(card.real, (3, 4, 5))]:
                raise card.refuse(f"{card.field(1)} has another place already ({old.line.where}); number nodes anew")
        elif name == "GRDSET":
            self.default = card
        elif COORDINATES.match(name):
            for place in (1, 5) if name[4] == "1" and card.field(5) else (1,):
                old, at = self.systems.setdefault(card.whole(place), (card, place))
                if (old.name, old.fields[at - 1 :]) != (name, card.fields[place - 1 :]):
                    raise card.refuse(f"{card.field(place)} is given otherwise ({old.line.where}); number systems anew")
        elif name in SOLIDS or name in FACE_CORNERS:
            self.elements.setdefault(name, []).append(card)
        elif BEAMS.match(name):
            self.beams.append(card)
        elif BEAM_PROPERTIES.match(name):
            self.stiff.append(card)
        elif CHANGING.fullmatch(name):
            raise card.refuse("may change mass, places or sets and is not read; write a mesh without it")
        elif name.startswith("C") and not MASSLESS.match(name) and not HARMLESS.fullmatch(name):
            raise card.refuse(f"is not read, and mass may be missing; leave it out, or mesh it in {FITTING}")
        elif not MASSLESS.match(name) and not HARMLESS.fullmatch(name) and name != "PLOTEL":
            self.unknown.setdefault(name, card)

    def finish(self, files: tuple[Path, ...]) -> MeshFile:
        """The mesh in its place."""
        for card in self.beams:
            if self.stiff or card.name == "CONROD":
                raise card.refuse("is a bar with a section, and a mass that is not read; leave it out")
        index = {number: place for place, number in enumerate(self.grids)}
        blocks, owners, members = [], [], {}
        for cards in self.elements.values():
            for block, properties in _blocks(cards, index):
                blocks.append(block)
                owners += properties
        for place, owner in enumerate(owners):
            members.setdefault(f"PID {owner}", []).append(place)
        points = [self._place(number) for number in self.grids]
        return MeshFile(
            np.array(points).reshape(-1, 3),
            blocks,
            {},
            {name: in_blocks(found, blocks) for name, found in members.items()},
            {},
            files,
            tuple(
                f"{card.line.where}: {card.name} is not known here and was passed over"
                for card in self.unknown.values()
            ),
        )

    def _place(self, number: int) -> Reals:
        """Where a grid is in the basic system."""
        if number not in self.known:
            card = self.grids[number]
            system = card.field(2) or ("" if self.default is None else self.default.field(2))
            try:
                given = np.array([card.real(place) for place in (3, 4, 5)])
                self.known[number] = self._from(to_whole(system or "0"), given, card)
            except RequestError:
                raise
            except ValueError as error:
                raise card.refuse(f"cannot be read: {error}") from None
        return self.known[number]

    def _from(self, system: int, given: Reals, asked: Card) -> Reals:
        """A place in the basic system, from coordinates in another."""
        if system == 0:
            return given
        if system in self.opened:
            raise asked.refuse(f"is in the system {system}, which is given by itself; correct it")
        if system not in self.systems:
            raise asked.refuse(f"is in the system {system}, which no CORD1R, 1C, 1S, 2R, 2C or 2S gives; add it")
        card, first = self.systems[system]
        self.opened.append(system)
        if card.name[4] == "1":
            grids = [card.whole(first + k) for k in (1, 2, 3)]
            if lost := set(grids) - set(self.grids):
                raise card.refuse(f"is given by the grid {min(lost)}, which is not there; add it")
            corners = [self._place(number) for number in grids]
        else:
            each = (np.array([card.real(place + k) for k in range(3)]) for place in (3, 6, 9))
            corners = [self._from(card.whole(2), place, card) for place in each]
        self.opened.pop()
        origin, up, aside = corners
        across = np.cross(up - origin, aside - origin)
        if not np.linalg.norm(across):
            raise card.refuse("has three points on one line, which give no axes; correct them")
        axes = np.stack([np.cross(across, up - origin), across, up - origin])
        return origin + _cartesian(card.name[5], given) @ (axes / np.linalg.norm(axes, axis=1)[:, None])


def _cartesian(kind: str, given: Reals) -> Reals:
    """x, y, z from r, θ, z of a system C, or from r, θ off its z axis, φ about it of a system S (degrees)."""
    if kind == "R":
        return given
    first, second = given[0], np.radians(given[1])
    if kind == "C":
        return np.array([first * np.cos(second), first * np.sin(second), given[2]])
    about = np.radians(given[2])
    return first * np.array([np.sin(second) * np.cos(about), np.sin(second) * np.sin(about), np.cos(second)])


def _blocks(cards: list[Card], index: dict[int, int]) -> Iterator[tuple[Block, list[int]]]:
    """Elements of one name, those of as many nodes together, and their properties."""
    found: dict[str, list[tuple[list[int], int, int]]] = {}
    for card in cards:
        nodes, number, name = [each for each in card.fields[2:] if each], card.whole(1), card.name
        if name in FACE_CORNERS:
            nodes = card.fields[2 : 2 + FACE_CORNERS[name]]
            kind = "triangle" if len(nodes) == 3 else "quad"
        else:
            kind = SOLIDS[name].get(len(nodes), "")
        if not kind or "" in card.fields[2 : 2 + len(nodes)] or len(nodes) < 3:
            size = " or ".join(map(str, SOLIDS.get(name, {FACE_CORNERS.get(name): ""})))
            raise card.refuse(
                f"{number} has {len([each for each in nodes if each])} nodes, and {size} are read; add the others"
            )
        try:
            numbers = [to_whole(each) for each in nodes]
        except ValueError as error:
            raise card.refuse(f"cannot be read: {error}") from None
        cell = indices_of(numbers, index, card.line.where, number)
        found.setdefault(kind, []).append((cell, number, card.whole(2, number)))
    for kind, rows in found.items():
        cells = np.array([row[0] for row in rows])[:, TO_VTK.get(kind, slice(None))]
        name = cards[0].name
        numbers = np.array([row[1] for row in rows])
        yield Block(kind, cells, numbers, name, name in FACE_CORNERS), [row[2] for row in rows]
