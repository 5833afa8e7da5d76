"""Meshes of Abaqus and CalculiX (.inp), with what may change mass, place or sets read, or refused by name and line."""

import itertools
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies import mesh_files as files
from drumsqueal.physics.bodies.mesh_files import Element, FileLine, MeshFile, PointMass, Reals, Skin

# Stress, heat, coupled and piezoelectric elements of the same shape have the same volume; continuum shells are bricks.
TYPES = {
    r"(?:(?:C|DC|DCC|Q)3D|SC|CSS)(4|10|8|20)[A-Z]*$": {4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20"},
    r"(?:STRI|DS|S|CPS|CPE|M3D|SFM3D|R3D)(\d+)[A-Z]*\d?$": {
        3: "triangle", 6: "triangle6", 65: "triangle6", 4: "quad", 8: "quad8", 9: "quad9",
    },
    r"T[23]D([23])": {2: "line", 3: "line3"},  # trusses, which Gmsh also writes for curves, without a section
}  # fmt: skip
TAKEN = {
    "NODE": "NSET SYSTEM INPUT",
    "ELEMENT": "TYPE ELSET INPUT",
    "NSET": "NSET GENERATE ELSET INSTANCE INTERNAL UNSORTED INPUT",
    "ELSET": "ELSET GENERATE INSTANCE INTERNAL UNSORTED INPUT",
    "SURFACE": "NAME TYPE INTERNAL INPUT",
    "SYSTEM": "",
    "PART": "NAME",
    "INSTANCE": "NAME PART",
    "MASS": "ELSET ALPHA",
}
# On these mass, places or sets may depend.
CHANGING = re.compile(
    r"MASS ADJUST|NONSTRUCTURAL MASS|NGEN|NFILL|NMAP|NCOPY|ELGEN|ELCOPY|MODEL CHANGE|IMPERFECTION|"
    r"IMPORT( NODESET| ELSET)?|SYMMETRIC MODEL GENERATION|SUBSTRUCTURE PROPERTY|SUPER ELEMENT|MATRIX (INPUT|ASSEMBLE)|"
    r"USER ELEMENT|UEL PROPERTY|REBAR( LAYER)?|STRINGER|EMBEDDED ELEMENT|PARAMETER"
)
# On these they do not; a card is known by its first word.
HARMLESS = re.compile(
    r"ACOUSTIC|AMPLITUDE|ANISOTROPIC|ASSEMBLY|BASE|BOUNDARY|CFLUX|CHANGE|CLEARANCE|CLOAD|COHESIVE|CONDUCTIVITY|"
    r"CONNECTOR|CONSTRAINT|CONTACT|COUPLING|CREEP|CYCLIC|DAMAGE|DAMPING|DASHPOT|DEFORMATION|DENSITY|DEPVAR|DFLUX|"
    r"DIELECTRIC|DISPLAY|DISTRIBUTING|DISTRIBUTION|DLOAD|DSLOAD|DYNAMIC|EL|ELASTIC|ELECTRICAL|ELEMENT|END|ENERGY|"
    r"EQUATION|EXPANSION|FAIL|FASTENER|FIELD|FILE|FILM|FILTER|FREQUENCY|FRICTION|GAP|HEADING|HEATCAP|HOURGLASS|"
    r"HYPERELASTIC|HYPERFOAM|INCIDENT|INELASTIC|INITIAL|INTEGRATED|JOULE|KINEMATIC|LATENT|LAYER|MATERIAL|MONITOR|MPC|"
    r"MULLINS|NO|NODAL|NODE|NORMAL|ORIENTATION|OUTPUT|PHYSICAL|PIEZOELECTRIC|PLASTIC|POROUS|POTENTIAL|PRE-TENSION|"
    r"PREPRINT|PRINT|PROPERTY|RADIATE|RATE|REGULARIZATION|RELEASE|RESTART|RIGID|SECTION|SENSOR|SHELL|SPECIFIC|SPRING|STATIC|"
    r"STEP|STRUCTURAL|SUBMODEL|SURFACE|TABLE|TEMPERATURE|TIE|TIME|TRANSFORM|TRANSVERSE|TRS|USER|VALUE|VALUES|VISCO|"
    r"VISCOELASTIC|WAVEFRONT|BIAXIAL|BRITTLE|CAP|COMBINED|CONCRETE|CONTROLS|CRUSHABLE|DRUCKER|EOS|FLUID|LOAD|MAGNETIC|"
    r"MOHR|ORNL|PERMEABILITY|PLANAR|SHEAR|SIMPLE|SWELLING|TENSION|UNIAXIAL|VISCOUS|VOLUMETRIC"
)


class Keyword(NamedTuple):
    """A keyword with its options, and its data lines as fields."""

    line: FileLine
    keyword: str
    options: dict[str, str]
    rows: list[list[str]]

    @property
    def of_nodes(self) -> bool:
        """Whether its members are nodes, and not elements."""
        return self.keyword == "NSET" or self.upper("TYPE") == "NODE"

    def upper(self, option: str, default: str = "") -> str:
        """What an option says, in capitals."""
        return self.options.get(option, default).upper()

    def refuse(self, reason: str) -> RequestError:
        """An error that names the card and where it is."""
        return self.line.refuse(f"*{self.keyword} {reason}")


def read_abaqus(path: Path) -> MeshFile:
    """Read a flat mesh, or the one instance of a part; raises RequestError."""
    source = files.Source(path, _cut)
    cards, instance = _of_one_part([*_cards(source)])
    for card in cards:
        _check_known(card)
    deck = _Deck(instance)
    # Elements may stand before their nodes, and sets before both.
    for kinds in (("SYSTEM", "NODE"), ("ELEMENT",), ("NSET", "ELSET"), ("SURFACE", "MASS")):
        for card in cards:
            deck.take(card, kinds)
    return deck.finish(source, [card for card in cards if card.keyword.endswith("SECTION")], _densities(cards))


def _cut(lines: Iterator[FileLine]) -> Iterator[tuple[FileLine, str | None]]:
    """Lines but comments, and the names of files that they include.

    A keyword line that ends in a comma has the next one at its end.
    """
    lines = (each._replace(text=each.text.strip()) for each in lines)
    lines = (each for each in lines if not each.text.startswith("**"))
    for line in lines:
        while line.text.startswith("*") and line.text.endswith(",") and (more := next(lines, None)):
            line = line._replace(text=line.text + more.text)
        keyword, options = _keyword(line)
        if keyword == "INCLUDE" and {*options} != {"INPUT"}:
            raise line.refuse("*INCLUDE takes INPUT=file and nothing else")
        yield line, options["INPUT"] if keyword == "INCLUDE" else None


def _keyword(line: FileLine) -> tuple[str, dict[str, str]]:
    """A keyword and its options; none of a line of data."""
    if not line.text.startswith("*"):
        return "", {}
    keyword, *options = (each.strip() for each in line.text[1:].split(","))
    pairs = (each.partition("=") for each in options if each)
    return " ".join(keyword.upper().split()), {k.strip().upper(): v.strip(' "') for k, _, v in pairs}


def _cards(source: files.Source) -> Iterator[Keyword]:
    """Each card with its data lines, those of INPUT= too; of a step, only those that make sets or change a mesh."""
    card, in_step = None, False
    for line in source.lines():
        if not line.text.startswith("*"):
            if card is None:
                raise line.refuse("the file begins with data; it must begin with a card, such as *HEADING")
            card.rows.append(_fields(line))
            continue
        if card is not None:
            yield card
        keyword, options = _keyword(line)
        in_step = keyword == "STEP" or (in_step and keyword != "END STEP")
        ignored = in_step and keyword not in TAKEN and not CHANGING.fullmatch(keyword)
        card = Keyword(line, "STEP" if ignored else keyword, options, [])
        if "INPUT" in options and not ignored:
            card.rows.extend(_fields(each) for each in source.included(options["INPUT"], line))
    if card is not None:
        yield card


def _fields(line: FileLine) -> list[str]:
    return [each.strip().strip('"') for each in line.text.rstrip().rstrip(",").split(",")]


def _of_one_part(cards: list[Keyword]) -> tuple[list[Keyword], Keyword | None]:
    """The cards of a flat file, or those of the part that has an instance, of that, and of the assembly.

    A mesh may stand in the part or in its instance, and is moved by that in both cases.
    """
    of_part, part = [], None
    for card in cards:
        if card.keyword in ("PART", "INSTANCE"):
            part = card.upper("NAME" if card.keyword == "PART" else "PART")
        of_part.append(part)
        part = None if card.keyword in ("END PART", "END INSTANCE") else part
    meshed = {name for card, name in zip(cards, of_part, strict=True) if card.keyword == "ELEMENT"}
    instances = [card for card in cards if card.keyword == "INSTANCE"]
    asked = [card for card in instances if card.upper("PART") in meshed]
    if len(asked) > 1:
        names = ", ".join(card.options.get("NAME", "?") for card in asked)
        raise asked[1].refuse(f"is one of several of meshed parts ({names}); write one flat mesh, or one instance")
    parts = {card.upper("NAME") for card in cards if card.keyword == "PART"}
    for card in instances:
        if card.upper("PART") not in parts:
            raise card.refuse("names no part that the file gives; write one flat mesh")
    if not asked:
        return cards, None
    kept = (None, asked[0].upper("PART"))
    return [card for card, name in zip(cards, of_part, strict=True) if name in kept], asked[0]


def _densities(cards: list[Keyword]) -> dict[str, str]:
    """The first density of each material, by its name; 0 where it has none, "" where its field is empty."""
    found, name = {}, ""
    for card in cards:
        if card.keyword == "MATERIAL":
            name = card.upper("NAME")
            found[name] = "0"
        elif card.keyword == "DENSITY":
            found[name] = [*card.rows, [""]][0][0]
    return found


def _check_known(card: Keyword) -> None:
    """Raise RequestError of a card or an option that may change a mesh in a way that is not read."""
    strange = sorted({*card.options} - {*TAKEN.get(card.keyword, "").split()})
    if card.keyword in TAKEN and strange:
        raise card.refuse(f"has the option {strange[0]}, which is not read; leave it out or write a flat mesh")
    if card.keyword == "ROTARY INERTIA":
        raise card.refuse(files.ON_ROTATIONS)
    if CHANGING.fullmatch(card.keyword):
        raise card.refuse("may change mass, places or sets and is not read; write a mesh without it")
    for option in ("DENSITY", "MASS") if card.keyword != "STEP" else ():
        if not re.fullmatch(r"[+-]?0*\.?0*([ED][+-]?\d+)?", card.upper(option)):
            raise card.refuse(
                f"gives its elements a mass by {option}, which is not read; make them solid, or leave it out"
            )
    first = card.keyword.partition(" ")[0]
    if card.keyword not in TAKEN and not card.keyword.endswith("SECTION") and not HARMLESS.fullmatch(first):
        raise card.refuse("is not known here, and may change mass, places or sets; leave it out if it does not")


class _Deck:
    """What the cards of a file amount to, those of some kinds after the others.

    Numbers and names are by scope: "" for the mesh, and "ASSEMBLY" for what an assembly has beside its instance.
    """

    def __init__(self, instance: Keyword | None) -> None:
        self.instance, self.own = instance, f"{instance.upper('NAME') if instance else ''}."
        self.points: list[Reals] = []
        self.index: dict[str, dict[int, int]] = {"": {}, "ASSEMBLY": {}}
        self.elements: list[Element] = []
        self.places: dict[str, dict[int, list[int]]] = {"": {}, "ASSEMBLY": {}}  # of elements by their numbers
        self.nodes: dict[tuple[str, str], list[int]] = {}
        self.cells: dict[tuple[str, str], list[int]] = {}
        self.faces: dict[tuple[str, str], list[tuple[int, str, Keyword]]] = {}
        self.bare: dict[int, tuple[str, Keyword]] = {}  # scope and card of trusses and point masses, by their places
        self.masses: dict[tuple[str, int, int], PointMass] = {}  # by scope and number, and place of its node
        self.frame: tuple[Reals, Reals] | None = None
        self.scope = ""
        self.notes: list[str] = []

    def take(self, card: Keyword, kinds: tuple[str, ...]) -> None:
        """Take in one card if it is of these kinds; raises RequestError."""
        if card.keyword.split(" ")[-1] in ("ASSEMBLY", "INSTANCE", "PART"):
            self.scope = "ASSEMBLY" if card.keyword in ("ASSEMBLY", "END INSTANCE") else ""
            self.frame = None
        if card.keyword in kinds:
            try:
                with files.reading(card.refuse):
                    getattr(self, f"_{card.keyword.lower()}")(card)
            except KeyError as error:
                raise card.refuse(f"lacks {error.args[0]}; add it, such as {error.args[0]}=NAME") from None

    def finish(self, source: files.Source, sections: list[Keyword], densities: dict[str, str]) -> MeshFile:
        """The mesh in its place."""
        nodes, cells, skins = self._by_name(self.nodes), self._by_name(self.cells), []
        for section in sections:
            name = section.upper("ELSET")
            members = cells.get(name, ())
            for _, card in (self.bare[place] for place in members if place in self.bare):
                why = "has a section, and a mass that is not read; leave it out"
                raise card.refuse(f"TYPE={card.options['TYPE']} {why}")
            # Of these the section says how thick they are.
            if thick := [place for place in members if re.match(r"(STRI|S|M3D|CP[SE])\d", self.elements[place].name)]:
                with files.reading(section.refuse):
                    skins.append(Skin(section.refuse, f"of the set {name}", thick, _plies(section, densities)))
        for place, (_, card) in self.bare.items():
            element = self.elements[place]
            if element.kind == "vertex" and self._key(place) not in self.masses:
                raise card.refuse(f"TYPE=MASS: no *MASS gives the mass of element {element.number}; add it")
        points = np.array(self.points).reshape(-1, 3)
        if self.instance:
            with files.reading(self.instance.refuse):
                points = _moved(points, self.instance)
        faces = {name: [*self._corners(found)] for name, found in self._by_name(self.faces).items()}
        notes, masses = tuple(self.notes), [*self.masses.values()]
        return MeshFile(points, self.elements, nodes, cells, faces, source.files, notes, skins, masses)

    def _system(self, card: Keyword) -> None:
        """Another frame for nodes that follow: origin, a point on x', and one in the plane x'y'."""
        flat = np.array([[files.to_real(each) for each in [*row, *[""] * 6][:6]] for row in card.rows]).reshape(-1, 6)
        self.frame = None
        if not any(each for row in card.rows for each in row):
            return
        origin, along = flat[0, :3], flat[0, 3:]
        if not any(card.rows[0][3:]):
            self.frame = origin, np.eye(3)
            return
        if len(flat) == 1 and (along[2] != origin[2] or not np.any(along)):
            raise card.refuse("gives no third point, without which its axes are not known here; add the third point")
        aside = flat[1, :3] - origin if len(flat) > 1 else np.cross([0.0, 0.0, 1.0], along - origin)
        self.frame = origin, files.triad(along - origin, aside, card.refuse)

    def _node(self, card: Keyword) -> None:
        system, index = card.upper("SYSTEM", "R"), self.index[self.scope]
        if system not in ("R", "C"):
            raise card.refuse(f"SYSTEM={system} gives spherical coordinates, which are not read; write x, y, z")
        members = []
        for row in card.rows:
            number, given = files.to_whole(row[0]), [files.to_real(each) for each in [*row[1:4], "", "", ""][:3]]
            place = files.cartesian(system, np.array(given))
            if self.frame is not None:
                place = self.frame[0] + place @ self.frame[1]
            if number in index and not np.array_equal(self.points[index[number]], place):
                raise card.refuse(f"numbers nodes anew: node {number} has another place already; write one flat mesh")
            members.append(index.setdefault(number, len(self.points)))
            self.points.append(place)
        if "NSET" in card.options:
            self._put(self.nodes, card.options["NSET"], members)

    def _element(self, card: Keyword) -> None:
        """Solids, faces, and what has no mass; anything else is refused by its type."""
        if "TYPE" not in card.options:
            raise card.refuse("has no TYPE; add it, such as *ELEMENT, TYPE=C3D10")
        name = card.upper("TYPE")
        if name == "ROTARYI":
            raise card.refuse(f"TYPE=ROTARYI {files.ON_ROTATIONS}")
        kind = _kind_of(name)
        if kind is None:
            raise card.refuse(
                f"TYPE={name} is not read, and mass may be missing; leave it out, or mesh it in {files.FITTING}"
            )
        if kind and kind != "vertex" and self.scope:
            raise card.refuse("stands in the assembly and not in a part, which is not read; write one flat mesh")
        first = len(self.elements)
        parts = [self._at_its_node(card, row) for row in card.rows] if kind == "vertex" else [(self.scope, card)]
        for scope, part in parts if kind else ():
            for number, *nodes in _whole_rows(part, 1 + files.size_of(kind)):
                nodes = files.indices_of(nodes, self.index[scope], card.line.where, number)
                self.places[self.scope].setdefault(number, []).append(len(self.elements))
                self.elements.append(Element(kind, nodes, number, name, bool(re.match(r"(STRI|S|M3D)\d", name))))
        members = range(first, len(self.elements))
        if kind in ("line", "line3", "vertex"):
            self.bare |= dict.fromkeys(members, (self.scope, card))
        if card.options.get("ELSET"):
            self._put(self.cells, card.options["ELSET"], members)

    def _at_its_node(self, card: Keyword, row: list[str]) -> tuple[str, Keyword]:
        """The scope of the node of a point mass, which may be one of the instance, and the card of that row alone."""
        inside = row[-1].upper().startswith(self.own)
        row = [*row[:-1], row[-1][len(self.own) :]] if inside else row
        return "" if inside else self.scope, card._replace(rows=[row])

    def _key(self, place: int) -> tuple[str, int, int]:
        """By which a point mass that is given twice is known as one."""
        return self.bare[place][0], self.elements[place].number, self.elements[place].nodes[0]

    def _mass(self, card: Keyword) -> None:
        """The mass of each element of a set; the same one given again is one."""
        mass = files.to_mass([*card.rows, [""]][0][0], card.refuse)
        for place in self._named(self.cells, card.options["ELSET"], card):
            element = self.elements[place]
            if element.name != "MASS":
                raise card.refuse(f"names element {element.number} of type {element.name}, which is no point mass")
            found = PointMass(card.refuse, f"of element {element.number}", element.nodes[0], mass)
            old = self.masses.setdefault(self._key(place), found)
            if old.mass != mass:
                raise card.refuse(f"gives element {element.number} another mass than a card before; leave one out")

    def _nset(self, card: Keyword) -> None:
        members = self._members(card)
        if "ELSET" in card.options:
            held = self._named(self.cells, card.options["ELSET"], card)
            members = [node for place in held for node in self.elements[place].nodes]
        self._put(self.nodes, card.options["NSET"], members)

    def _elset(self, card: Keyword) -> None:
        self._put(self.cells, card.options["ELSET"], self._members(card))

    def _surface(self, card: Keyword) -> None:
        kind, name = card.upper("TYPE", "ELEMENT"), card.options["NAME"]
        if kind not in ("NODE", "ELEMENT"):
            note = f"*SURFACE, TYPE={kind} is not of elements or nodes, and is no set here"
            self.notes.append(f"{card.line.where}: {note}")
            return
        found = [(place, [*row, ""][1].upper(), card) for row in card.rows for place in self._member(row[0], card)]
        if kind == "NODE":
            self._put(self.nodes, name, [place for place, _, _ in found])
        else:
            self._put(self.faces, name, found)

    def _members(self, card: Keyword) -> list[int]:
        """What a set holds: numbers, ranges of them (GENERATE) or other sets."""
        if "GENERATE" in card.options:
            numbers = itertools.chain.from_iterable(_range(row) for row in card.rows)
            return [place for number in numbers for place in self._places(number, card, self._scope_of(card))]
        return [place for row in card.rows for each in row if each for place in self._member(each, card)]

    def _member(self, text: str, card: Keyword) -> list[int]:
        """A number or a set, that of the instance where its name stands before it."""
        own = text.upper().removeprefix(self.own)
        if own.isdecimal():
            return self._places(int(own), card, self._scope_of(card) if own == text else "")
        return self._named(self.nodes if card.of_nodes else self.cells, text, card)

    def _scope_of(self, card: Keyword) -> str:
        return "" if "INSTANCE" in card.options else self.scope

    def _places(self, number: int, card: Keyword, scope: str) -> list[int]:
        """Where a node is, or the elements with a number, unless they are several; none where there is none."""
        if card.of_nodes:
            return [self.index[scope][number]] if number in self.index[scope] else []
        found = self.places[scope].get(number, [])
        several = len({tuple(sorted(self.elements[place].nodes)) for place in found})
        if several > 1:
            raise card.refuse(f"names the element {number}, and {several} elements have this number; number them anew")
        return found

    def _named(self, sets: dict, name: str, card: Keyword) -> list:
        name = name.upper()
        for key in ((self._scope_of(card), name), ("", name.removeprefix(self.own))):
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
                found[self.own + name if found.get(name, members) != members else name] = members
        return found

    def _corners(self, faces: list[tuple[int, str, Keyword]]) -> Iterator[list[int]]:
        """Corners of faces that are named S1 to S6, SPOS or SNEG; all of an element without a name."""
        for place, label, card in faces:
            element = self.elements[place]
            table = files.FACES.get(element.shape)
            named = {f"S{k + 1}": (face,) for k, face in enumerate(table)} | {"": table} if table else {}
            if table is None and label in ("", "SPOS", "SNEG", "S1", "S2"):
                yield [*element.corners]
            elif label in named:
                yield from ([element.nodes[k] for k in face] for face in named[label])
            else:
                raise card.refuse(f"names the face {label} of an element of type {element.name}, which has none such")


def _kind_of(name: str) -> str | None:
    """The kind of a type of elements, "" of one without extent or mass; None where it is not read."""
    if name == "MASS" or re.match(r"HEATCAP|SPRING|DASHPOT|CONN|GAP|DCOUP|ITS|JOINTC|R2D2|RAX2|RB[23]D2", name):
        return "vertex" if name == "MASS" else ""
    found = ((re.match(pattern, name), kinds) for pattern, kinds in TYPES.items())
    return next((kinds.get(int(match[1])) for match, kinds in found if match), None)


def _plies(section: Keyword, densities: dict[str, str]) -> list[tuple[float, float | None]]:
    """Thickness and density of each layer of a section, of which a plane solid is of thickness 1 where none is given.

    A general section without a material gives stiffness alone. Raises ValueError.
    """
    if section.keyword == "SHELL GENERAL SECTION" and not {"MATERIAL", "COMPOSITE"} & section.options.keys():
        return []
    default = "1" if section.keyword == "SOLID SECTION" else ""
    layers = [([*section.rows, [""]][0][0] or default, section.upper("MATERIAL"))]
    if "COMPOSITE" in section.options:
        layers = [(row[0], [*row, "", ""][2].upper()) for row in section.rows]
    if any(option.endswith("THICKNESS") for option in section.options):
        raise section.refuse("gives a thickness that differs from place to place, which is not read; leave it out")
    known = {name: files.to_real(densities[name]) for _, name in layers if densities.get(name)}
    return [(files.to_real(thickness), known.get(name)) for thickness, name in layers]


def _range(row: list[str]) -> range:
    """The numbers of a line of GENERATE; raises ValueError."""
    given = [files.to_whole(each) for each in row]
    first, last, step = [*given, 1][:3] if len(given) in (2, 3) else (0, 0, 0)
    if step < 1 or last < first:
        reason = "is no range; GENERATE takes a first number, a last one not below it, and a step of 1 or more"
        raise ValueError(f"{', '.join(row)!r} {reason}, such as 1, 9, 2")
    return range(first, last + 1, step)


def _moved(points: Reals, instance: Keyword) -> Reals:
    """Points moved, and then turned about an axis, as an instance asks for."""
    rows = [np.array([files.to_real(each) for each in row]) for row in instance.rows]
    if len(rows) > 2 or any(len(row) not in size for row, size in zip(rows, ((1, 2, 3), (7,)), strict=False)):
        reason = "moves its part in a way that is not read: a translation of 3 and a rotation of 7 numbers are"
        raise instance.refuse(reason)
    points = points + np.array([*rows[0], 0.0, 0.0][:3]) if rows else points
    if len(rows) == 2:
        start, axis, angle = rows[1][:3], rows[1][3:6] - rows[1][:3], np.radians(rows[1][6])
        if not np.any(axis):
            raise instance.refuse("turns its part about two points in one place, which give no axis; correct them")
        points = start + Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).apply(points - start)
    return points


def _whole_rows(card: Keyword, size: int) -> Iterator[list[int]]:
    """The numbers of one element after the other, whose data lines go on until it has all of its nodes."""
    row: list[int] = []
    for fields in [*card.rows, None]:
        if len(row) == size:
            yield row
            row = []
        elif row and (fields is None or len(row) > size):
            mend = "add the others" if len(row) < size else "correct the line"
            raise card.refuse(f"gives element {row[0]} {len(row) - 1} nodes, and its type has {size - 1}; {mend}")
        row += [files.to_whole(each) for each in fields or () if each]
