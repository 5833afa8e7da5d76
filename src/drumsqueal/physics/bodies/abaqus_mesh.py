"""Meshes of Abaqus and CalculiX (.inp), with what may change mass, place or sets read, or refused by name and line."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.mesh_files import (
    FACES,
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

# Stress, heat, coupled and piezoelectric elements of the same shape have the same volume; continuum shells are bricks.
SOLID = re.compile(r"(?:(?:C|DC|DCC|Q)3D(4|10|8|20)|(?:SC|CSS)(8))[A-Z]*$")
SOLIDS = {4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20"}
FACE = re.compile(r"(STRI|DS|S|CPS|CPE|M3D|SFM3D|R3D)(\d+)[A-Z]*\d?$")
FACE_KINDS = {3: "triangle", 6: "triangle6", 4: "quad", 8: "quad8", 9: "quad9"}
WEIGH = ("STRI", "S", "M3D")
MASSLESS = re.compile(r"HEATCAP|SPRING|DASHPOT|CONN|GAP|DCOUP|ITS|JOINTC|R2D2|RAX2|RB[23]D2")
TRUSS = re.compile(r"T[23]D[23]")  # which Gmsh also writes for curves, without a section
TAKEN = {
    "NODE": "NSET SYSTEM INPUT",
    "ELEMENT": "TYPE ELSET INPUT",
    "NSET": "NSET GENERATE ELSET INSTANCE INTERNAL UNSORTED INPUT",
    "ELSET": "ELSET GENERATE INSTANCE INTERNAL UNSORTED INPUT",
    "SURFACE": "NAME TYPE INTERNAL INPUT",
    "SYSTEM": "",
    "PART": "NAME",
    "INSTANCE": "NAME PART",
}
SCOPES = ("ASSEMBLY", "INSTANCE", "END INSTANCE", "END ASSEMBLY", "PART", "END PART")
# Elements may stand before their nodes, and sets before both.
ORDER = (("SYSTEM", "NODE"), ("ELEMENT",), ("NSET", "ELSET"), ("SURFACE",))
# On these mass, places or sets may depend.
CHANGING = {
    *("MASS", "ROTARY INERTIA", "NONSTRUCTURAL MASS", "MASS ADJUST", "NGEN", "NFILL", "NMAP", "NCOPY", "ELGEN"),
    *("ELCOPY", "MODEL CHANGE", "IMPERFECTION", "IMPORT", "IMPORT NODESET", "IMPORT ELSET"),
    *(
        "SYMMETRIC MODEL GENERATION",
        "SUBSTRUCTURE PROPERTY",
        "SUPER ELEMENT",
        "MATRIX INPUT",
        "MATRIX ASSEMBLE",
        "USER ELEMENT",
        "UEL PROPERTY",
    ),
    *("REBAR", "REBAR LAYER", "STRINGER", "EMBEDDED ELEMENT", "PARAMETER"),
}
# On these they do not; a card is known by its first word.
HARMLESS = re.compile(
    r"ACOUSTIC|AMPLITUDE|ANISOTROPIC|ASSEMBLY|BASE|BOUNDARY|CFLUX|CHANGE|CLEARANCE|CLOAD|COHESIVE|CONDUCTIVITY|"
    r"CONNECTOR|CONSTRAINT|CONTACT|COUPLING|CREEP|CYCLIC|DAMAGE|DAMPING|DASHPOT|DEFORMATION|DENSITY|DEPVAR|DFLUX|"
    r"DIELECTRIC|DISPLAY|DISTRIBUTING|DISTRIBUTION|DLOAD|DSLOAD|DYNAMIC|EL|ELASTIC|ELECTRICAL|ELEMENT|END|ENERGY|"
    r"EQUATION|EXPANSION|FAIL|FASTENER|FIELD|FILE|FILM|FILTER|FREQUENCY|FRICTION|GAP|HEADING|HEATCAP|HOURGLASS|"
    r"HYPERELASTIC|HYPERFOAM|INCIDENT|INELASTIC|INITIAL|INTEGRATED|JOULE|KINEMATIC|LATENT|LAYER|MATERIAL|MONITOR|MPC|"
    r"MULLINS|NO|NODAL|NODE|NORMAL|ORIENTATION|OUTPUT|PHYSICAL|PIEZOELECTRIC|PLASTIC|POROUS|POTENTIAL|PRE-TENSION|"
    r"PREPRINT|PRINT|PROPERTY|RADIATE|RATE|REGULARIZATION|RELEASE|RESTART|RIGID|SECTION|SENSOR|SPECIFIC|SPRING|STATIC|"
    r"STEP|STRUCTURAL|SUBMODEL|SURFACE|TABLE|TEMPERATURE|TIE|TIME|TRANSFORM|TRANSVERSE|TRS|USER|VALUE|VALUES|VISCO|"
    r"VISCOELASTIC|WAVEFRONT|BIAXIAL|BRITTLE|CAP|COMBINED|CONCRETE|CONTROLS|CRUSHABLE|DRUCKER|EOS|FLUID|LOAD|MAGNETIC|"
    r"MOHR|ORNL|PERMEABILITY|PLANAR|SHEAR|SIMPLE|SWELLING|TENSION|UNIAXIAL|VISCOUS|VOLUMETRIC"
)


class Card(NamedTuple):
    """A keyword with its options, and its data lines as fields."""

    line: Line
    keyword: str
    options: dict[str, str]
    rows: list[list[str]]

    def refuse(self, reason: str) -> RequestError:
        """An error that names the card and where it is."""
        return RequestError(f"{self.line.where}: *{self.keyword} {reason}")


def read_abaqus(path: Path) -> MeshFile:
    """Read a flat mesh, or the one instance of a part; raises RequestError."""
    files = [path]
    deck = _Deck()
    cards = [*_of_one_part([*_cards(path, files)], deck)]
    for card in cards:
        _check_known(card)
    for kinds in ORDER:
        for card in cards:
            deck.take(card, kinds)
    sections = {card.options.get("ELSET", "").upper() for card in cards if card.keyword.endswith("SECTION")}
    return deck.finish(tuple(dict.fromkeys(files)), sections)


def _lines(given: list[Line], files: list[Path], opened: tuple[Path, ...]) -> Iterator[Line]:
    """Lines but comments; those of an included file stand where it is asked for.

    A keyword line that ends in a comma has the next one at its end.
    """
    lines = (each._replace(text=each.text.strip()) for each in given if not each.text.startswith("**"))
    for line in lines:
        while line.text.startswith("*") and line.text.endswith(","):
            more = next(lines, None)
            if more is None:
                break
            line = line._replace(text=line.text + more.text)
        keyword, options = _keyword(line) if line.text.startswith("*") else ("", {})
        if keyword != "INCLUDE":
            yield line
        elif set(options) == {"INPUT"}:
            yield from _included(options["INPUT"], line, files, opened)
        else:
            raise RequestError(f"{line.where}: *INCLUDE takes INPUT=file and nothing else")


def _included(name: str, asked: Line, files: list[Path], opened: tuple[Path, ...]) -> Iterator[Line]:
    lines = read_included(name, asked, opened)
    files.extend(each.path for each in lines[:1])
    return _lines(lines, files, (*opened, *(each.path for each in lines[:1])))


def _keyword(line: Line) -> tuple[str, dict[str, str]]:
    keyword, *options = (each.strip() for each in line.text[1:].split(","))
    pairs = (each.partition("=") for each in options if each)
    return " ".join(keyword.upper().split()), {k.strip().upper(): v.strip(' "') for k, _, v in pairs}


def _cards(path: Path, files: list[Path]) -> Iterator[Card]:
    """Each card with its data lines, those of INPUT= too; of a step, only those that make sets or change a mesh."""
    card, in_step = None, False
    for line in _lines(read_lines(path), files, (path,)):
        if line.text.startswith("*"):
            if card is not None:
                yield card
            keyword, options = _keyword(line)
            in_step = keyword == "STEP" or (in_step and keyword != "END STEP")
            ignored = in_step and keyword not in TAKEN and keyword not in CHANGING
            card = Card(line, "STEP" if ignored else keyword, options, [])
            if "INPUT" in options and not ignored:
                opened = tuple(dict.fromkeys((path, line.path)))
                card.rows.extend(_fields(each) for each in _included(options["INPUT"], line, files, opened))
        elif card is None:
            raise RequestError(f"{line.where}: the file begins with data; it must begin with a card, such as *HEADING")
        else:
            card.rows.append(_fields(line))
    if card is not None:
        yield card


def _fields(line: Line) -> list[str]:
    return [each.strip().strip('"') for each in line.text.rstrip().rstrip(",").split(",")]


def _of_one_part(cards: list[Card], deck: "_Deck") -> Iterator[Card]:
    """The cards of a flat file, or those of the part that has an instance, and of its assembly."""
    of_part, part = [], None
    for card in cards:
        part = card.options.get("NAME", "").upper() if card.keyword == "PART" else part
        of_part.append(part)
        part = None if card.keyword == "END PART" else part
    meshed = {name for card, name in zip(cards, of_part, strict=True) if card.keyword == "ELEMENT"}
    asked = [card for card in cards if card.keyword == "INSTANCE" and card.options.get("PART", "").upper() in meshed]
    if len(asked) > 1:
        names = ", ".join(card.options.get("NAME", "?") for card in asked)
        raise asked[1].refuse(f"is one of several of meshed parts ({names}); write one flat mesh, or one instance")
    for card in cards:
        if card.keyword == "INSTANCE" and card.options.get("PART", "").upper() not in (*of_part,):
            raise card.refuse("names no part that the file gives; write one flat mesh")
    if asked:
        deck.instance, deck.moved = asked[0].options.get("NAME", "").upper(), asked[0]
    kept = asked[0].options["PART"].upper() if asked else None
    for card, name in zip(cards, of_part, strict=True):
        if name is None or not asked or name == kept:
            yield card


def _check_known(card: Card) -> None:
    """Raise RequestError of a card or an option that may change a mesh in a way that is not read."""
    strange = sorted(set(card.options) - set(TAKEN.get(card.keyword, "").split()))
    if card.keyword in TAKEN and strange:
        raise card.refuse(f"has the option {strange[0]}, which is not read; leave it out or write a flat mesh")
    if card.keyword in CHANGING:
        raise card.refuse("may change mass, places or sets and is not read; write a mesh without it")
    first = card.keyword.partition(" ")[0]
    if card.keyword not in TAKEN and not card.keyword.endswith("SECTION") and not HARMLESS.fullmatch(first):
        raise card.refuse("is not known here, and may change mass, places or sets; leave it out if it does not")


class _Deck:
    """What the cards of a file amount to, those of some kinds after the others.

    Numbers and names are by scope: "" for the mesh, and "ASSEMBLY" for what an assembly has beside its instance.
    """

    def __init__(self) -> None:
        self.points: list[Reals] = []
        self.index: dict[str, dict[int, int]] = {"": {}, "ASSEMBLY": {}}
        self.blocks: list[Block] = []
        self.places: dict[int, list[int]] = {}  # of an element's number, among all elements
        self.count = 0
        self.nodes: dict[tuple[str, str], list[int]] = {}
        self.cells: dict[tuple[str, str], list[int]] = {}
        self.faces: dict[tuple[str, str], list[tuple[int, str, Card]]] = {}
        self.trusses: list[Card] = []
        self.frame: tuple[Reals, Rotation] | None = None
        self.scope, self.instance = "", ""
        self.moved: Card | None = None
        self.notes: list[str] = []

    def take(self, card: Card, kinds: tuple[str, ...]) -> None:
        """Take in one card if it is of these kinds; raises RequestError."""
        if card.keyword in SCOPES:
            self.scope = "ASSEMBLY" if card.keyword in ("ASSEMBLY", "END INSTANCE") else ""
            self.frame = None
        if card.keyword not in kinds:
            return
        try:
            getattr(self, f"_{card.keyword.lower()}")(card)
        except RequestError:
            raise
        except (ValueError, IndexError) as error:
            raise card.refuse(f"cannot be read: {error}") from None
        except KeyError as error:
            raise card.refuse(f"lacks {error.args[0]}; add it, such as {error.args[0]}=NAME") from None

    def finish(self, files: tuple[Path, ...], sections: set[str]) -> MeshFile:
        """The mesh in its place."""
        for card in self.trusses:
            if card.options.get("ELSET", "").upper() in sections:
                raise card.refuse(
                    f"TYPE={card.options['TYPE']} has a section, and a mass that is not read; leave it out"
                )
        points = np.array(self.points).reshape(-1, 3)
        cells = self._by_name(self.cells)
        return MeshFile(
            self._in_assembly(points),
            self.blocks,
            {name: np.array(found, dtype=int) for name, found in self._by_name(self.nodes).items()},
            {name: in_blocks(found, self.blocks) for name, found in cells.items()},
            {name: [*self._corners(found)] for name, found in self._by_name(self.faces).items()},
            files,
            tuple(self.notes),
        )

    def _system(self, card: Card) -> None:
        """Another frame for nodes that follow: origin, a point on x', and one in the plane x'y'."""
        flat = [[to_real(each) for each in row] + [0.0] * 6 for row in card.rows]
        given = [sum(bool(each) for each in row) for row in card.rows]
        self.frame = None
        if not card.rows:
            return
        origin, along = np.array(flat[0][:3]), np.array(flat[0][3:6])
        if len(card.rows[0]) <= 3 or not any(card.rows[0][3:]):
            self.frame = (origin, Rotation.identity()) if any(given) else None
            return
        if len(flat) == 1 and (along[2] != origin[2] or not np.any(along)):
            raise card.refuse("gives no third point, without which its axes are not known here; add the third point")
        across = np.array(flat[1][:3]) if len(flat) > 1 else origin + np.cross([0.0, 0.0, 1.0], along - origin)
        self.frame = origin, Rotation.from_matrix(_axes(along - origin, across - origin, card))

    def _node(self, card: Card) -> None:
        system, index = card.options.get("SYSTEM", "R").upper(), self.index[self.scope]
        if system not in ("R", "C"):
            raise card.refuse(f"SYSTEM={system} gives spherical coordinates, which are not read; write x, y, z")
        members = []
        for row in card.rows:
            number, place = to_whole(row[0]), np.array([to_real(each) for each in [*row[1:4], "", "", ""][:3]])
            if system == "C":
                angle = np.radians(place[1])
                place = np.array([place[0] * np.cos(angle), place[0] * np.sin(angle), place[2]])
            if self.frame is not None:
                place = self.frame[0] + self.frame[1].apply(place)
            if number in index and not np.array_equal(self.points[index[number]], place):
                raise card.refuse(f"numbers nodes anew: node {number} has another place already; write one flat mesh")
            members.append(index.setdefault(number, len(self.points)))
            self.points.append(place)
        if "NSET" in card.options:
            self._put(self.nodes, card.options["NSET"], members)

    def _element(self, card: Card) -> None:
        """Solids, faces, and what has no mass; anything else is refused by its type."""
        if "TYPE" not in card.options:
            raise card.refuse("has no TYPE; add it, such as *ELEMENT, TYPE=C3D10")
        name = card.options["TYPE"].upper()
        solid, face = SOLID.match(name), FACE.match(name)
        if TRUSS.match(name):
            self.trusses.append(card)
        kind = SOLIDS[int(solid[1] or solid[2])] if solid else None
        if face:
            kind = FACE_KINDS.get(6 if name == "STRI65" else int(face[2]))
        if kind is None and not MASSLESS.match(name) and not TRUSS.match(name):
            raise card.refuse(
                f"TYPE={name} is not read, and mass may be missing; leave it out, or mesh it in {FITTING}"
            )
        if kind is None:
            return
        if self.scope:
            raise card.refuse("stands in the assembly and not in a part, which is not read; write one flat mesh")
        count = int(re.sub(r"\D", "", kind) or {"tetra": 4, "hexahedron": 8, "triangle": 3, "quad": 4}[kind])
        rows = [*_whole_rows(card, count + 1)]
        cells = [indices_of(row[1:], self.index[""], card.line.where, row[0]) for row in rows]
        cells = np.array(cells, dtype=int).reshape(-1, count)
        numbers = np.array([row[0] for row in rows], dtype=int)
        self.blocks.append(Block(kind, cells, numbers, name, bool(face) and face[1] in WEIGH))
        places = range(self.count, self.count + len(rows))
        self.count += len(rows)
        for place, row in zip(places, rows, strict=True):
            self.places.setdefault(row[0], []).append(place)
        if card.options.get("ELSET"):
            self._put(self.cells, card.options["ELSET"], places)

    def _nset(self, card: Card) -> None:
        members = self._members(card)
        if "ELSET" in card.options:
            held = in_blocks(self._named(self.cells, card.options["ELSET"], card), self.blocks)
            flat = (block.cells[rows].ravel().tolist() for block, rows in zip(self.blocks, held, strict=True))
            members = [node for nodes in flat for node in nodes]
        self._put(self.nodes, card.options["NSET"], members)

    def _elset(self, card: Card) -> None:
        self._put(self.cells, card.options["ELSET"], self._members(card))

    def _surface(self, card: Card) -> None:
        kind, name = card.options.get("TYPE", "ELEMENT").upper(), card.options["NAME"]
        if kind == "NODE":
            self._put(self.nodes, name, [place for row in card.rows for place in self._member(row[0], card)])
        elif kind == "ELEMENT":
            each = ((row[1].upper() if len(row) > 1 else "", self._member(row[0], card)) for row in card.rows)
            self._put(self.faces, name, [(place, label, card) for label, places in each for place in places])
        else:
            self.notes.append(
                f"{card.line.where}: *SURFACE, TYPE={kind} is not of elements or nodes, and is no set here"
            )

    def _members(self, card: Card) -> list[int]:
        """What a set holds: numbers, ranges of them (GENERATE) or other sets."""
        if "GENERATE" in card.options:
            ranges = [[to_whole(each) for each in [*row, "1"][:3]] for row in card.rows]
            numbers = (number for first, last, step in ranges for number in range(first, last + 1, step))
            return [place for number in numbers for place in self._places(number, card, self._scope_of(card))]
        return [place for row in card.rows for each in row if each for place in self._member(each, card)]

    def _member(self, text: str, card: Card) -> list[int]:
        """A number or a set, that of the instance where its name stands before it."""
        own = text.upper().removeprefix(f"{self.instance}.")
        if own.isdigit():
            return self._places(int(own), card, self._scope_of(card) if own == text else "")
        return self._named(self.nodes if _is_of_nodes(card) else self.cells, text, card)

    def _scope_of(self, card: Card) -> str:
        return "" if "INSTANCE" in card.options else self.scope

    def _places(self, number: int, card: Card, scope: str) -> list[int]:
        """Where a node is, or the elements with a number, unless they are several; none where there is none."""
        if _is_of_nodes(card):
            return [self.index[scope][number]] if number in self.index[scope] else []
        found = self.places.get(number, [])
        several = {tuple(sorted(self._cell(place)[1])) for place in found} if len(found) > 1 else ()
        if len(several) > 1:
            raise card.refuse(
                f"names the element {number}, and {len(several)} elements have this number; number them anew"
            )
        return found

    def _cell(self, place: int) -> tuple[Block, list[int]]:
        for block in self.blocks:
            if place < len(block.cells):
                return block, block.cells[place].tolist()
            place -= len(block.cells)
        raise IndexError(place)

    def _named(self, sets: dict, name: str, card: Card) -> list:
        name = name.upper()
        own = name.removeprefix(f"{self.instance}.")
        for key in ((self._scope_of(card), name), ("", own)):
            if key in sets:
                return sets[key]
        raise card.refuse(f"names the set {name}, which no card before it gives; correct the name")

    def _put(self, sets: dict, name: str, members: Iterable) -> None:
        sets.setdefault((self.scope, name.upper()), []).extend(members)

    def _by_name(self, sets: dict) -> dict:
        """Sets by names alone; where the assembly has another of the same name, that of a part is INSTANCE.NAME."""
        found = {name: members for (scope, name), members in sets.items() if scope}
        for (scope, name), members in sets.items():
            if not scope:
                found[f"{self.instance}.{name}" if found.get(name, members) != members else name] = members
        return found

    def _in_assembly(self, points: Reals) -> Reals:
        """Points moved, and then turned about an axis, as the instance asks for."""
        if self.moved is None:
            return points
        rows = [[to_real(each) for each in row] for row in self.moved.rows]
        if len(rows) > 2 or any(len(row) not in size for row, size in zip(rows, ((1, 2, 3), (7,)), strict=False)):
            raise self.moved.refuse(
                "moves its part in a way that is not read: a translation of 3 and a rotation of 7 numbers are"
            )
        points = points + np.array([*rows[0], 0.0, 0.0][:3]) if rows else points
        if len(rows) == 2:
            start, end, angle = np.array(rows[1][:3]), np.array(rows[1][3:6]), np.radians(rows[1][6])
            axis = (end - start) / np.linalg.norm(end - start)
            points = start + Rotation.from_rotvec(angle * axis).apply(points - start)
        return points

    def _corners(self, faces: list[tuple[int, str, Card]]) -> Iterator[tuple[int, ...]]:
        """Corners of faces that are named S1 to S6, SPOS or SNEG; all of an element without a name."""
        for place, label, card in faces:
            block, cell = self._cell(place)
            table = FACES.get(block.shape)
            if table is None and label in ("", "SPOS", "SNEG", "S1", "S2"):
                yield tuple(cell[: 3 if block.shape == "triangle" else 4])
            elif table is not None and label in ("", *(f"S{k + 1}" for k in range(len(table)))):
                for face in table if not label else (table[int(label[1:]) - 1],):
                    yield tuple(cell[k] for k in face)
            else:
                raise card.refuse(f"names the face {label} of an element of type {block.name}, which has none such")


def _is_of_nodes(card: Card) -> bool:
    return card.keyword == "NSET" or card.options.get("TYPE", "").upper() == "NODE"


def _axes(first: Reals, second: Reals, card: Card) -> Reals:
    """Columns along the first vector, along what of the second is across it, and across both."""
    third = np.cross(first, second)
    if not np.linalg.norm(third):
        raise card.refuse("has three points on one line, which give no axes; correct them")
    axes = np.stack([first, np.cross(third, first), third], axis=1)
    return axes / np.linalg.norm(axes, axis=0)


def _whole_rows(card: Card, size: int) -> Iterator[list[int]]:
    """The numbers of one element after the other, whose data lines go on until it has all of its nodes."""
    row: list[int] = []
    for fields in card.rows:
        row += [to_whole(each) for each in fields if each]
        if len(row) == size:
            yield row
            row = []
        elif len(row) > size:
            raise card.refuse(
                f"gives element {row[0]} {len(row) - 1} nodes, and its type has {size - 1}; correct the line"
            )
    if row:
        raise card.refuse(f"gives element {row[0]} {len(row) - 1} nodes, and its type has {size - 1}; add the others")
