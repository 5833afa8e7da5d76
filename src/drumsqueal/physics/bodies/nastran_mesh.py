"""Meshes of Nastran (.bdf), with what may change mass or places read, or refused by name and line."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies import mesh_files as files
from drumsqueal.physics.bodies.mesh_files import Element, FileLine, MeshFile, PointMass, Reals, Skin

SOLIDS = {"CTETRA": "tetra", "CHEXA": "hexahedron", "CPENTA": "wedge", "CPYRAM": "pyramid", "CPYRA": "pyramid"}
SIZES = {"tetra": (4, 10), "hexahedron": (8, 20), "wedge": (6, 15), "pyramid": (5, 13)}
# Of faces, corners alone are needed, and numbers behind them are no nodes.
SURFACES = {
    **dict.fromkeys(("CTRIA3", "CTRIAR", "CTRIA6"), "triangle"),
    **dict.fromkeys(("CQUAD4", "CQUADR", "CQUAD8", "CQUAD", "CQUAD9", "CSHEAR"), "quad"),
}
# Nastran counts the nodes in the middles of edges upwards; VTK has those of the top before the upright ones.
TO_VTK = {"hexahedron20": [*range(12), *range(16, 20), *range(12, 16)]}
BEAMS = re.compile(r"C(BAR|BEAM|BEAM3|ROD|TUBE|BEND|ONROD|WELD|SEAM)$")
BEAM_PROPERTIES = re.compile(r"P(BAR|BARL|BEAM|BEAML|BEAM3|ROD|TUBE|BEND|BCOMP|BMSECT|BRSECT)$")
# Fields of the density in a material, of the materials in a property of one thickness, of which the first given has the
# mass, and of the material of the first ply, behind which its thickness is, with how many fields are from ply to ply.
DENSITIES = {"MAT1": 5, "MAT2": 8, "MAT8": 8}
PLATES = {"PSHELL": (2, 4, 6), "PSHEAR": (2,)}
PLIES = {"PCOMP": (9, 4), "PCOMPG": (10, 8)}
# Elements that may have a thickness of their own at each node, where, and the field that is 1 if it is a share of that
# of the property.
OWN_THICKNESS = {
    **dict.fromkeys(("CTRIA3", "CTRIAR", "CQUAD4", "CQUADR"), (range(11, 15), 10)),
    "CTRIA6": (range(11, 14), 14),
    "CQUAD8": (range(11, 15), 17),
}
CHANGING = re.compile(
    r"NSM|NSM1|NSML1?|NSMADD|DMIG|DMI|GENEL|CSUPER|CSUPEXT|SEBULK|SEEXCLD|SELOC|SEMPLN|GRIDB|"
    r"EGRID|GRIDG|CGEN|RELEASE|DTI|MODLIST|MFLUID|CAABSF"
)
COORDINATES = re.compile(r"CORD[12][RCS]$")
HARMLESS = re.compile(
    r"C(ELAS[1-4]|BUSH|BUSH1D|FAST|DAMP[1-5]|GAP|VISC|SEAMP|HBDY[EGP])|PLOTEL|"
    r"P[A-Z]+\d*|MAT[A-Z]*\d*|EIG[RLBCP]*|SPC[A-Z]*\d*|MPC[A-Z]*|RBE[123][A-Z]*|RBAR\d?|RROD|RJOINT|RTRPLT\d?|RSPLINE|RSSCON|"
    r"FORCE\d?|MOMENT\d?|PLOAD[X\d]*|GRAV|LOAD|SLOAD|TEMP[A-Z\d]*|DLOAD|RLOAD\d|TLOAD\d|DAREA|DPHASE|DELAY|LSEQ|RFORCE|"
    r"FREQ\d?|TSTEP[A-Z]*|TABLE[A-Z]*\d|TABD[A-Z]+\d|NLPARM|SUPORT\d?|ASET\d?|BSET\d?|CSET\d?|OMIT\d?|QSET\d?|USET\d?|"
    r"SPOINT|EPOINT|PARAM|SET\d?|DESVAR|DRESP\d|DCONSTR|DCONADD|DVPREL\d|DOPTPRM|BCONP|BLSEG|BFRIC|BSURFS?|BCTSET|BCTADD|"
    r"BCPROPS?|BGSET|BGADD|BGPARM|BCTPARA?M?|CREEP|ACCEL\d?|CONV[M]?|RADM|DEFORM|SNORM|CORD[A-Z\d]+|MDLPRM|NSTEP|TOPVAR|"
    r"OUTPUT|DUMMY|QBDY\d|QVOL|QHBDY|EIGRL|MONPNT\d|CAMPBLL|ROTOR[A-Z]*|RSPIN[A-Z]|AEROS?|LABEL|TITLE|SUBTITLE|ECHO"
)


class Card(NamedTuple):
    """A card's name and its fields."""

    line: FileLine
    name: str
    fields: list[str]

    def field(self, place: int) -> str:
        """A field by its place, 1 for the first behind the name; empty where the card ends before."""
        return self.fields[place - 1] if place <= len(self.fields) else ""

    def whole(self, place: int, default: int = 0) -> int:
        """A whole number in a field."""
        return files.to_whole(self.field(place) or str(default))

    def reals(self, place: int) -> Reals:
        """Three real numbers from a field on."""
        return np.array([files.to_real(self.field(place + k)) for k in range(3)])

    def refuse(self, reason: str) -> RequestError:
        """An error that names the card and where it is."""
        return self.line.refuse(f"{self.name} {reason}")


def read_nastran(path: Path) -> MeshFile:
    """Read the bulk data; raises RequestError."""
    source, bulk = files.Source(path, _cut), _Bulk()
    for card in _cards(_bulk(source.lines())):
        with files.reading(card.refuse):
            bulk.take(card)
    return bulk.finish(source)


def _cut(lines: Iterator[FileLine]) -> Iterator[tuple[FileLine, str | None]]:
    """Lines without comments, and the names of files that they include."""
    for line in lines:
        text = line.text.partition("$")[0].rstrip()
        if not re.match(r"\s*INCLUDE\b", text, flags=re.IGNORECASE):
            if text.strip() and not text.startswith(("//", "#")):
                yield line._replace(text=text), None
            continue
        name = line.text.strip()[len("INCLUDE") :].strip()
        quote = name[:1]
        while quote in ("'", '"') and quote not in name[1:]:  # a long name goes on in the next line
            more = next(lines, None)
            if more is None:
                raise line.refuse(f"INCLUDE has no end of its quoted name; add {quote}")
            name += more.text.strip()
        yield line, name[1:].partition(quote)[0] if quote in ("'", '"') else name.partition("$")[0].strip()


def _bulk(lines: Iterator[FileLine]) -> Iterator[FileLine]:
    """What is behind BEGIN BULK, or all where there is none, and before ENDDATA."""
    every = [*lines]
    starts = [k for k, line in enumerate(every) if re.match(r"\s*BEGIN\s", line.text + " ", flags=re.IGNORECASE)]
    for line in every if not starts else ():
        if line.text.split()[0].upper() == "CEND":
            raise line.refuse("CEND ends the executive control, and BEGIN BULK is missing; add it before the bulk data")
    for k in starts:
        if k != starts[0] or not re.fullmatch(r"BEGIN(\s+BULK)?", every[k].text.strip(), flags=re.IGNORECASE):
            raise every[k].refuse(f"{every[k].text.strip()}: one block BEGIN BULK is read; write one")
    for line in every[starts[0] + 1 if starts else 0 :]:
        if re.match(r"\s*ENDDATA\b", line.text, flags=re.IGNORECASE):
            return
        yield line


def _cards(lines: Iterator[FileLine]) -> Iterator[Card]:
    """Cards of small, large and free fields, with the lines that continue them."""
    card: Card | None = None
    behind = ""  # the last field of the line before, which the first of its continuation repeats
    before: FileLine | None = None
    for line in lines:
        name, fields, last = _fields(line)
        _check_mark(before, behind, name)
        if name.startswith("="):
            raise line.refuse("fields that repeat those of another card (=) are not read; write them out")
        if name and name[0] not in "+*":
            if card is not None:
                yield card
            card = Card(line, name.rstrip("*_").upper(), fields)  # meshio writes CHEXA_ of 20 nodes
        elif card is None:
            raise line.refuse("the line continues a card, and there is none before it")
        elif name[1:] and behind[1:] and name[1:] not in (behind, behind[1:]):
            raise line.refuse(f"the line {name} continues another card than that before it; move it there")
        elif len(card.fields) % 8 == 4 and name[:1] != "*":
            raise line.refuse("the line continues one of large fields, and must begin with *")
        else:
            card.fields.extend(fields)
        before, behind = line, last
    _check_mark(before, behind, "")
    if card is not None:
        yield card


def _check_mark(line: FileLine | None, mark: str, following: str) -> None:
    """Raise RequestError of a last field that may be a value, as no line behind it begins with it as its mark."""
    if line is not None and mark and mark[0] not in "+*" and following[1:] != mark:
        reason = f"{mark} stands where a line has the mark of its continuation, and the next line does not repeat it"
        raise line.refuse(f"{reason}; write a value in a next line that begins with + or *, or begin the mark with +")


def _fields(line: FileLine) -> tuple[str, list[str], str]:
    """Name, as many fields as there can be, and the mark of a continuation; set apart by commas, tabs or columns."""
    text, name, cut = line.text, line.text.split(",")[0].split("\t")[0][:8].strip(), None
    wide = name.endswith("*") or name.startswith("*")
    count, width = (4, 16) if wide else (8, 8)
    if "," in text:
        cut = text.split(",")
    elif "\t" in text:
        pieces = [each.strip() for each in text.split("\t")]
        cut = pieces if not any(" " in each or len(each) > width for each in pieces) else None
    if cut is None:
        text = text.expandtabs(8)
        cut = [text[:8], *(text[8 + width * k : 8 + width * (k + 1)] for k in range(count))]
        cut.append("+" + re.sub(r"^[+*]", "", text[72:80].strip()))  # in these columns there is never a value
    name, *rest = (each.strip() for each in cut)
    if len(rest) > count + 1:  # a long line of free fields
        return name, rest, ""
    rest += [""] * (count + 1 - len(rest))
    return name, rest[:count], rest[count]


class _Bulk:
    """What the cards of bulk data amount to."""

    def __init__(self) -> None:
        self.grids: dict[int, Card] = {}
        self.systems: dict[int, tuple[Card, int]] = {}  # a card, and the place of its number: two stand on one CORD1
        self.default = ""
        self.elements: list[Card] = []
        self.beams: list[Card] = []
        self.stiff = False
        self.bushes: set[str] = set()  # their properties
        self.heavy: dict[str, tuple[Card, str]] = {}  # properties with a mass of their own, and that
        self.unknown: dict[str, Card] = {}
        self.materials: dict[int, Card] = {}
        self.properties: dict[int, Card] = {}  # of surface elements
        self.masses: dict[int, Card] = {}
        self.scale: Card | None = None  # of all masses
        self.known: dict[int, Reals] = {}  # grids
        self.frames: dict[int, tuple[Reals, Reals]] = {}
        self.opened: list[int] = []

    def take(self, card: Card) -> None:
        """Take in one card; raises RequestError where it may change a mesh in a way that is not read."""
        name = card.name
        if name == "GRID":
            old = self.grids.setdefault(card.whole(1), card)
            if old.whole(2) != card.whole(2) or np.any(old.reals(3) != card.reals(3)):
                raise card.refuse(f"{card.field(1)} has another place already ({old.line.where}); number nodes anew")
        elif name == "GRDSET":
            self.default = card.field(2)
        elif COORDINATES.match(name):
            for place in (1, 5) if name[4] == "1" and card.field(5) else (1,):
                old, at = self.systems.setdefault(card.whole(place), (card, place))
                if (old.name, old.fields[at - 1 :]) != (name, card.fields[place - 1 :]):
                    raise card.refuse(f"{card.field(place)} is given otherwise ({old.line.where}); number systems anew")
        elif name in SOLIDS or name in SURFACES:
            self.elements.append(card)
        elif BEAMS.match(name):
            self.beams.append(card)
        elif BEAM_PROPERTIES.match(name):
            self.stiff = True
        elif name in ("CONM2", "CMASS2"):
            old = self.masses.setdefault(card.whole(1), card)
            if (old.name, old.fields) != (name, card.fields):
                raise card.refuse(f"{card.field(1)} is given otherwise ({old.line.where}); number elements anew")
        elif re.fullmatch(r"CONM1|CMASS[134]", name):
            raise card.refuse("is a mass that is not read; write CONM2, or CMASS2 for each of components 1, 2 and 3")
        elif mass := _own_mass(card):
            self.heavy[f"PID {card.whole(1)}"] = card, mass
        elif CHANGING.fullmatch(name):
            raise card.refuse("may change mass, places or sets and is not read; write a mesh without it")
        elif HARMLESS.fullmatch(name):
            self.bushes |= {f"PID {card.whole(2, card.whole(1))}"} if name in ("CBUSH", "CBUSH1D", "CFAST") else set()
            self.materials |= {card.whole(1): card} if name in DENSITIES else {}
            self.properties |= {card.whole(1): card} if name in PLATES or name in PLIES else {}
            if name == "PARAM" and card.field(1).upper() == "WTMASS" and files.to_real(card.field(2)) != 1:
                self.scale = card
        elif name.startswith("C"):
            raise card.refuse(f"is not read, and mass may be missing; leave it out, or mesh it in {files.FITTING}")
        else:
            self.unknown.setdefault(name, card)

    def finish(self, source: files.Source) -> MeshFile:
        """The mesh in its place."""
        for card in self.beams:
            if self.stiff or card.name in ("CONROD", "CWELD", "CSEAM"):
                what = "weld" if card.name in ("CWELD", "CSEAM") else "bar"
                raise card.refuse(f"is a {what} with a section, and a mass that is not read; leave it out")
        index = {number: place for place, number in enumerate(self.grids)}
        elements, sets = [], {}
        for card in self.elements:
            with files.reading(card.refuse):
                sets.setdefault(f"PID {card.whole(2, card.whole(1))}", []).append(len(elements))
                elements.append(_element(card, index))
        for own, (card, mass) in self.heavy.items():
            if own in self.bushes | sets.keys():
                raise card.refuse(f"{card.field(1)} gives its elements a mass of {mass}, which is not read; write 0")
        points = np.array([self._place(number) for number in self.grids]).reshape(-1, 3)
        notes = (
            f"{card.line.where}: {card.name} is not known here and was passed over" for card in self.unknown.values()
        )
        skins = [
            Skin(card.refuse, str(number), held, self._plies(card, held))
            for number, card in self.properties.items()
            if (held := sets.get(f"PID {number}"))
        ]
        masses = [*self._point_masses(index)]
        elements += [Element("vertex", [], number, card.name) for number, card in self.masses.items()]
        return MeshFile(points, elements, {}, sets, {}, source.files, tuple(notes), skins, masses)

    def _plies(self, card: Card, held: list[int]) -> list[tuple[float, float | None]]:
        """Thickness and density of each ply of a property."""
        with files.reading(card.refuse):
            if card.name in PLATES:
                materials = (card.whole(place) for place in PLATES[card.name])
                return [(self._thickness(card, held), self._density(next(filter(None, materials), 0)))]
            at, step = PLIES[card.name]
            sides = 2 if "SYM" in card.field(8).upper() else 1
            material, thickness, plies = "", "", []
            for k in range(at, len(card.fields) + 1, step):
                if card.field(k) or card.field(k + 1):  # a ply repeats what it leaves out of that before
                    material, thickness = card.field(k) or material, card.field(k + 1) or thickness
                    plies.append((sides * files.to_real(thickness), self._density(files.to_whole(material or "0"))))
        return plies

    def _thickness(self, card: Card, held: list[int]) -> float:
        """The largest that a property or one of its elements gives: an element's own is in the place of the other."""
        found = [files.to_real(card.field(3))]
        for element in (self.elements[k] for k in held if self.elements[k].name in OWN_THICKNESS):
            places, flag = OWN_THICKNESS[element.name]
            unit = found[0] if element.whole(flag) == 1 else 1.0
            found += [unit * files.to_real(element.field(place)) for place in places]
        return max(found)

    def _density(self, material: int) -> float | None:
        """That of a material by its number, 0 for none; None where the file does not give it."""
        if material not in self.materials:
            return None if material else 0.0
        return files.to_real(self.materials[material].field(DENSITIES[self.materials[material].name]))

    def _point_masses(self, index: dict[int, int]) -> Iterator[PointMass]:
        """At each grid that of CONM2, and that of CMASS2 if it is the same along x, y and z."""
        if self.masses and self.scale is not None:
            raise self.scale.refuse("WTMASS scales masses, which is not read; write masses that need no factor")
        sums: dict[tuple[str, int], tuple[Card, Reals]] = {}
        for card in self.masses.values():
            with files.reading(card.refuse):
                node, along = _conm2(card) if card.name == "CONM2" else _cmass2(card)
            if node not in index:
                raise card.refuse(
                    f"{card.field(1)} is at the grid {node}, which the file does not give a place; add it"
                )
            first, known = sums.get((card.name, node), (card, np.zeros(3)))
            sums[card.name, node] = first, known + along
        for (_, node), (card, along) in sums.items():
            # Each direction may be several masses, and in fields of eight columns these are rounded in the sixth digit.
            if not np.allclose(along, along[0], rtol=1e-5, atol=0):
                masses = "{:.6g}, {:.6g} and {:.6g}".format(*along)
                why = f"is at the grid {node}, where masses along its components 1, 2 and 3 are {masses}"
                raise card.refuse(f"{card.field(1)} {why}, and must be equal; write CONM2, or CMASS2 for all three")
            yield PointMass(card.refuse, card.field(1), index[node], float(along[0]))

    def _place(self, number: int) -> Reals:
        """Where a grid is in the basic system."""
        if number not in self.known:
            card = self.grids[number]
            with files.reading(card.refuse):
                self.known[number] = self._from(
                    files.to_whole(card.field(2) or self.default or "0"), card.reals(3), card
                )
        return self.known[number]

    def _from(self, system: int, given: Reals, asked: Card) -> Reals:
        """A place in the basic system, from coordinates in another."""
        if system == 0:
            return given
        if system in self.opened:
            raise asked.refuse(f"is in the system {system}, which is given by itself; correct it")
        if system not in self.systems:
            raise asked.refuse(f"is in the system {system}, which no CORD1R, 1C, 1S, 2R, 2C or 2S gives; add it")
        if system not in self.frames:
            self.opened.append(system)
            self.frames[system] = self._frame(*self.systems[system])
            self.opened.pop()
        origin, axes = self.frames[system]
        return origin + files.cartesian(self.systems[system][0].name[5], given) @ axes

    def _frame(self, card: Card, first: int) -> tuple[Reals, Reals]:
        """Origin and axes (rows) of a system, in the basic one."""
        if card.name[4] == "1":
            grids = [card.whole(first + k) for k in (1, 2, 3)]
            if lost := {*grids} - {*self.grids}:
                raise card.refuse(f"is given by the grid {min(lost)}, which is not there; add it")
            corners = [self._place(number) for number in grids]
        else:
            corners = [self._from(card.whole(2), card.reals(place), card) for place in (3, 6, 9)]
        origin, up, aside = corners
        return origin, np.roll(files.triad(up - origin, aside - origin, card.refuse), -1, axis=0)


def _conm2(card: Card) -> tuple[int, Reals]:
    """The grid of a CONM2, and its mass along each direction."""
    if card.whole(3) == -1 or any(map(files.to_real, card.fields[4:14])):
        raise card.refuse(f"{card.field(1)} has an offset or moments of inertia, and {files.ON_ROTATIONS}")
    return card.whole(2), np.full(3, files.to_mass(card.field(4) or "0", card.refuse))


def _cmass2(card: Card) -> tuple[int, Reals]:
    """The same of a CMASS2, which has a mass along one."""
    component = card.field(4)
    if component in ("4", "5", "6"):
        raise card.refuse(f"{card.field(1)} {files.ON_ROTATIONS}")
    if component not in ("1", "2", "3") or card.whole(5):
        raise card.refuse(f"{card.field(1)} is at a scalar point or between two nodes, which is not read")
    return card.whole(3), files.to_mass(card.field(2) or "0", card.refuse) * np.eye(3)[int(component) - 1]


def _own_mass(card: Card) -> str:
    """The mass that a property gives its elements beside that of their volume; empty for none."""
    # Which field of a property is a mass that no density gives, of each element or of its area.
    masses = {"PSHELL": 8, "PCOMP": 3, "PCOMPG": 3, "PSHEAR": 4, "PBUSH1D": 4, "PFAST": 11}
    fields = [each.upper() for each in card.fields]
    place = fields.index("M") + 2 if card.name == "PBUSH" and "M" in fields else masses.get(card.name)
    mass = card.field(place) if place else ""
    return mass if files.to_real(mass) else ""


def _element(card: Card, index: dict[int, int]) -> Element:
    """An element with its nodes in the order of VTK."""
    name, number, surface = card.name, card.whole(1), card.name in SURFACES
    kind = SURFACES.get(name) or SOLIDS[name]
    sizes = (files.SHAPES[kind][1],) if surface else SIZES[kind]
    given = sum(bool(each) for each in card.fields[2 : 2 + sizes[0] if surface else None])
    if given not in sizes or "" in card.fields[2 : 2 + given]:
        size = " or ".join(map(str, sizes))
        raise card.refuse(f"{number} has {given} nodes, and {size} are read; add the others")
    nodes = files.indices_of(map(files.to_whole, card.fields[2 : 2 + given]), index, card.line.where, number)
    kind = kind if given == files.SHAPES[kind][1] else f"{kind}{given}"
    return Element(kind, [nodes[k] for k in TO_VTK.get(kind, range(given))], number, name, surface)
