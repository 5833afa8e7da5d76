"""Mesh files of other codes: two bricks of known volume in every way of writing them, and what is refused by name."""

import os
from pathlib import Path

import meshio
import numpy as np
import pytest

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.elements import REFERENCES
from drumsqueal.physics.bodies.solid_mesh import SECOND_ORDER, SolidMesh, read_solid_mesh

# A brick of 2 by 3 by 5 and one of 1 by 3 by 5 next to it along x: 30 and 15.
PLACES = {
    1 + i + 3 * j + 6 * k: (x, y, z)
    for k, z in enumerate((0.0, 5.0))
    for j, y in enumerate((0.0, 3.0))
    for i, x in enumerate((0.0, 2.0, 3.0))
}
BACK, PAD = (1, 2, 5, 4, 7, 8, 11, 10), (2, 3, 6, 5, 8, 9, 12, 11)
LINING = (3, 6, 12, 9)
EXACT = 1e-11  # coordinates in large fields have 13 digits, and volumes are products of three


def joined(*fields) -> str:
    return ", ".join(map(str, fields)) + "\n"


def inp_nodes(card="*NODE", places=PLACES, form="{!r}") -> str:
    return card + "\n" + "".join(joined(number, *map(form.format, place)) for number, place in places.items())


NODES = inp_nodes()
BACKING = "*ELEMENT, TYPE=C3D8, ELSET=BACK\n" + joined(11, *BACK)
LINED = "*ELEMENT, TYPE=C3D8, ELSET=PAD\n" + joined(12, *PAD)
SETS = "*NSET, NSET=LINING\n" + joined(*LINING)
INP = "*HEADING\nbricks\n" + NODES + BACKING + LINED + SETS
MOVED = {number: (x - 1, y, z) for number, (x, y, z) in PLACES.items()}
TURNED = {number: (y, 4 - x, z) for number, (x, y, z) in PLACES.items()}
CAE = f"""*Heading
*Part, name=SHOE
{NODES}{BACKING}{LINED}*Nset, nset=Rub, internal
{joined(*LINING)}*Solid Section, elset=BACK, material=STEEL
1.,
*End Part
*Assembly, name=Assembly
*Instance, name=SHOE-1, part=SHOE
MOVE*End Instance
*Node
1, 50., 0., 0.
*Nset, nset=REFERENCE
1,
*Elset, elset=_S, internal, instance=SHOE-1
12,
*Surface, type=ELEMENT, name=LINING
_S, S4
*Nset, nset=NAMED
SHOE-1.1, SHOE-1.RUB
*Nset, nset=TWO, instance=SHOE-1, generate
1, 2, 1
*End Assembly
*Material, name=STEEL
*Density
7.8e-9,
*Step
*Frequency
4,
*Boundary
TWO, 1, 3
*Unheard Of, in=A STEP
*End Step
"""
IN_INSTANCE = CAE.replace(NODES + BACKING + LINED, "").replace("MOVE", "MOVE" + NODES + BACKING + LINED).replace(
    "*Nset, nset=Rub, internal\n" + joined(*LINING), "").replace(
    "*End Instance\n", "*Nset, nset=Rub, internal\n" + joined(*LINING) + "*End Instance\n")  # fmt: skip
SKIN = (
    "*ELEMENT, TYPE={}, ELSET=SKIN\n21, 3, 6, 12, 9\n*{} SECTION, ELSET=SKIN, MATERIAL=STEEL\n{}\n"
    "*MATERIAL, NAME=STEEL\n*DENSITY\n8.,\n"
)
INPS = {
    "plain": INP,
    "byte order mark and CRLF": "\ufeff" + INP.replace("\n", "\r\n"),
    "CR": INP.replace("\n", "\r"),
    "lower case, tabs and blanks": INP.lower().replace(", ", " ,\t"),
    "continued keyword lines": INP.replace("*NSET, ", "*NSET,\n** between\n").replace(", ELSET=PAD", ",\n ELSET=PAD"),
    "comments behind blanks": " ** bricks\n"
    + INP.replace("*NSET, ", "*NSET,\n\t** between\n").replace("\n12, ", "\n  **\n12, "),
    "sets of nodes on *NODE": "*HEADING\n"
    + inp_nodes("*NODE, NSET=ALL", {k: v for k, v in PLACES.items() if k not in LINING})
    + inp_nodes("*NODE, NSET=LINING", {k: PLACES[k] for k in LINING}) + BACKING + LINED,
    "D exponents": INP.replace(NODES, inp_nodes(form="{:.3E}").replace("E+", "D+").replace("*NODD", "*NODE")),
    "elements over several lines": INP.replace("1, 2, 5, 4, ", "1, 2, 5, 4,\n").replace("2, 3, 6, ", "2,\n3, 6,\n"),
    "numbers twice": INP.replace("12, 2, 3,", "11, 2, 3,"),
    "elements twice": INP + BACKING.replace("11, ", "901, ", 1).replace("ELSET=BACK", "ELSET=STEEL"),
    "turned within": INP + "*ELEMENT, TYPE=C3D8R, ELSET=STEEL\n" + joined(901, *BACK[4:], *(BACK[:4]))
    .replace("7, 8, 11, 10, 1, 2, 5, 4", "2, 5, 4, 1, 8, 11, 10, 7"),
    "continuum shells, heat transfer": INP.replace("C3D8, ELSET=B", "SC8R, ELSET=B").replace("=C3D8", "=DC3D8"),
    "system of coordinates": INP.replace(NODES, "*SYSTEM\n1., 0., 0.\n" + inp_nodes(places=MOVED) + "*SYSTEM\n"),
    "turned system": INP.replace(NODES, "*SYSTEM\n4., 0., 0., 4., 1., 0.\n0., 0., 0.\n" + inp_nodes(places=TURNED)),
    "system in the plane": INP.replace(NODES, "*SYSTEM\n4., 0., 0., 4., 1., 0.\n" + inp_nodes(places=TURNED)),
    "cylindrical nodes": INP.replace(NODES, inp_nodes("*NODE, SYSTEM=C", {
        k: (float(np.hypot(x, y)), float(np.degrees(np.arctan2(y, x))), z) for k, (x, y, z) in PLACES.items()})),
    "*TRANSFORM turns no places": INP + "*TRANSFORM, NSET=LINING\n0., 1., 0., -1., 0., 0.\n",
    "ranges with holes, in a step": INP.replace(
        SETS, "*STEP\n*NSET, NSET=LINING, GENERATE\n3, 9, 3\n12, 99, 3\n*END STEP\n"),
    "one instance of a part": CAE.replace("MOVE", ""),
    "a mesh in an instance": IN_INSTANCE.replace("MOVE", ""),
    "two parts, one of them used": "*PART, NAME=OLD\n" + INP + "*END PART\n" + CAE.replace("MOVE", ""),
    "sets before elements before nodes": "*HEADING\n" + SETS + LINED + BACKING + NODES,
    "shells without density, and those for stresses": INP + SKIN.format("S4R", "SHELL", "4.,").replace("8.,", "0.,")
    + SKIN.format("S4", "SHELL", "1E-6").replace("SKIN", "FOIL").replace("STEEL", "TIN"),
    "stiffness without a material": INP + SKIN.format("S4", "SHELL GENERAL", "4.,").replace(", MATERIAL=STEEL", "", 1),
    "shells that are each for stresses": INP + SKIN.format("S4", "SHELL", "1.6E-4"),
    "faces without a section, shells without mass": INP
    + SKIN.format("SFM3D4", "SURFACE", "") + SKIN.format("R3D4", "SHELL", "4.,"),
    "shells and solids that are coupled": INP + "*SHELL TO SOLID COUPLING, CONSTRAINT NAME=C\nA, B\n",
    "a surface of shells": INP.replace(SETS, "*ELEMENT, TYPE=S4R, ELSET=SKIN\n21, 3, 6, 12, 9\n"
                                       "*SHELL SECTION, ELSET=SKIN\n1E-6,\n*SURFACE, NAME=LINING\nSKIN, SPOS\n"),
    "faces of three and of four corners": INP + "*ELEMENT, TYPE=R3D3, ELSET=LINING\n21, 1, 2, 5\n"
    "*ELEMENT, TYPE=R3D4, ELSET=LINING\n22, 3, 6, 12, 9\n",
    "a set of springs in another": INP.replace(SETS, "*ELEMENT, TYPE=SPRINGA, ELSET=PIN\n77, 1, 2\n"
                                               "*ELSET, ELSET=MORE\nPIN, PAD\n" + SETS),
    "all faces of a set": INP.replace(SETS, "*SURFACE, NAME=LINING, TYPE=ELEMENT\n12, S4\n"),
    "springs and curves of Gmsh": INP + "*ELEMENT, TYPE=SPRINGA, ELSET=PIN\n77, 1, 2\n*SPRING, ELSET=PIN\n\n1.,\n"
    "*ELEMENT, TYPE=T3D2, ELSET=LINE1\n78, 1, 2\n*RIGID BODY, ELSET=PIN, REF NODE=1, DENSITY=0.E+00\n"
    "*STEP\n*MATRIX GENERATE, MASS=YES\n*END STEP\n",
}  # fmt: skip


def read(folder: Path, name: str, text: str | bytes, **others: str) -> SolidMesh:
    for key, content in {name: text, **{each.replace("_", "."): found for each, found in others.items()}}.items():
        (folder / key).write_bytes(content.encode() if isinstance(content, str) else content)
    return read_solid_mesh(folder / name, "m")


def check_bricks(mesh: SolidMesh, back="BACK", pad="PAD", lining="LINING") -> None:
    np.testing.assert_allclose(mesh.volumes[mesh.elements_of(back)], [30.0], rtol=EXACT)
    np.testing.assert_allclose(mesh.volumes[mesh.elements_of(pad)], [15.0], rtol=EXACT)
    assert len(mesh.cells) == 2
    elements, faces = mesh.faces_of(lining)
    corners = mesh.points[mesh.cells[elements[0], list(REFERENCES[mesh.kind].faces[faces[0]])]]
    assert len(elements) == 1
    np.testing.assert_allclose(corners[:, 0], 3.0, rtol=EXACT)
    np.testing.assert_allclose(
        [mesh.points.min(axis=0), mesh.points.max(axis=0)], [[0, 0, 0], [3, 3, 5]], atol=5 * EXACT
    )


@pytest.mark.parametrize("way", INPS)
def test_bricks_of_abaqus_are_the_same_in_every_way_of_writing_them(tmp_path, way):
    check_bricks(read(tmp_path, "mesh.inp", INPS[way]))


@pytest.mark.parametrize("text", [CAE, IN_INSTANCE])
def test_an_instance_is_moved_and_then_turned(tmp_path, text):
    # By (1, 0, 0), and then by 90 degrees about the z axis through (1, 0, 0): x to 3 becomes y to 3.
    mesh = read(tmp_path, "mesh.inp", text.replace("MOVE", "1., 0., 0.\n1., 0., 0., 1., 0., 1., 90.\n"))
    np.testing.assert_allclose(mesh.points.min(axis=0), [-2, 0, 0], atol=EXACT)
    np.testing.assert_allclose(mesh.points.max(axis=0), [1, 3, 5], rtol=EXACT)
    # Node 1 of the instance, and not that of the assembly, which is of no solid.
    assert len(mesh.nodes_of("NAMED")) == len(mesh.nodes_of("RUB")) + 1
    assert sorted(mesh.nodes_of("RUB").tolist()) == [k for k, point in enumerate(mesh.points[:12]) if point[1] > 2.5]
    assert len(mesh.faces_of("LINING")[0]) == 1


def test_files_that_a_file_includes_are_read_with_it(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "nodes.txt").write_text(NODES.partition("\n")[2])
    (tmp_path / "sub" / "both.inc").write_text("*NODE\n*INCLUDE, INPUT=nodes.txt\n" + BACKING)
    text = "*INCLUDE, INPUT=sub\\both.inc\n*ELEMENT, TYPE=C3D8, ELSET=PAD, INPUT=pad.txt\n" + SETS
    mesh = read(tmp_path, "mesh.inp", text, pad_txt=joined(12, *PAD))
    check_bricks(mesh)
    assert [path.name for path in mesh.files] == ["mesh.inp", "both.inc", "nodes.txt", "pad.txt"]


def bdf(name: str, *fields, wide=False, mark="+", blank="") -> str:
    """A card of small or large fields, whose further lines begin with the mark."""
    width, count, lines = (16, 4, []) if wide else (8, 8, [])
    for k in range(0, len(fields), count):
        head = (name + "*" * wide) if k == 0 else mark
        lines.append(
            f"{head:<8}" + "".join(f"{'' if each is None else each:<{width}}" for each in fields[k : k + count])
        )
    return (f"{blank}\n").join(each.rstrip() if not blank else f"{each:<72}" for each in lines) + "\n"


def wide(name: str, *fields) -> str:
    return bdf(name, *fields, wide=True, mark="*")


def bulk(grid=lambda number, place: bdf("GRID", number, None, *place), card=bdf, before="", after="") -> str:
    grids = "".join(grid(number, place) for number, place in PLACES.items())
    return (
        before
        + grids
        + card("CHEXA", 11, 1, *BACK)
        + card("CHEXA", 12, 2, *PAD)
        + card("CQUAD4", 21, 3, *LINING)
        + after
    )


def free(*fields) -> str:
    return ",".join("" if each is None else str(each) for each in fields) + "\n"


def digits(number) -> str:
    """As many as a large field holds."""
    return f"{number:.13g}"


def polar(number, place):
    x, y, z = place
    return wide("GRID", number, 7, *map(digits, (np.hypot(x, y), np.degrees(np.arctan2(y, x)), z)))


def spherical(number, place):
    # About x: off it by the angle θ, and around from y by φ.
    x, y, z = place
    r, theta, phi = np.linalg.norm(place), np.arctan2(np.hypot(y, z), x), np.arctan2(z, y)
    return wide("GRID", number, 7, *map(digits, (r, np.degrees(theta), np.degrees(phi))))


def local(number, place):
    # Of the system 5: its z along x, its x along y, its y along z; of the system 7, moved in it by 1 along its z.
    x, y, z = place
    return bdf("GRID", number, 7, y, z, x - 1)


SYSTEM = bdf("CORD2R", 5, 0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
IN_SYSTEM = bdf("CORD2R", 7, 5, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 1.0, 0.0, 1.0)
POLAR = bdf("CORD2C", 7, None, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
AT_GRIDS = bdf("GRID", 91, 0, 0.0, 0.0, 0.0) + bdf("GRID", 92, 0, 0.0, 0.0, 1.0) + bdf("GRID", 93, 0, 1.0, 0.0, 0.0)
BDFS = {
    "small fields": bulk(),
    "lower case": bulk().lower(),
    "CR": bulk().replace("\n", "\r"),
    "control sections, comments, what comes behind": "SOL 103\nCEND\nSUBCASE 1\nBEGIN  BULK\n"
    + bulk().replace("CHEXA ", "$ note\n\nCHEXA ").replace("+       ", "$ between\n+       ") + "ENDDATA\nCONM2   1\n",
    "blank continuation": bulk(card=lambda *f: bdf(*f, mark="")),
    "marks without +, and numbers of lines": bulk(
        card=lambda name, k, *f: bdf(name, k, *f, mark=f"+{k}", blank=k), after=f"{'PARAM   POST    0':<72}99\n"),
    "marks of free fields without +": bulk(card=lambda *f: free(*f[:9], "E") + "+E," + free(*f[9:])),
    "marked continuation": bulk(card=lambda name, k, *f: bdf(name, k, *f, mark=f"+E{k}", blank=f"+E{k}")),
    "large fields": bulk(lambda n, p: wide("GRID", n, None, *p), wide),
    "free fields": bulk(lambda n, p: free("GRID", n, None, *p),
                        lambda *f: free(*f[:9]) + (free("+", *f[9:]) if f[9:] else "")),
    "free fields with tabs": bulk(lambda n, p: free("GRID", n, None, *p).replace(",", ",\t"), free),
    "free large fields": bulk(lambda n, p: free("GRID*", n, None, *p[:2], "*") + free("*", p[2]), free),
    "long free lines": bulk(card=free),
    "tabs": bulk(lambda n, p: free("GRID", n, None, *p).replace(",", "\t"), lambda *f: bdf(*f).replace(" " * 8, "\t")),
    "tabs between columns": bulk(lambda n, p: bdf("GRID", n, None, *p).replace(f"{n:<8}", f"{n}\t", 1)),
    "exponents without a letter": bulk(lambda n, p: bdf("GRID", n, None, *(f"{100 * x:.1f}-2" for x in p))),
    "D exponents": bulk(lambda n, p: bdf("GRID", n, None, *(f"{x:.1f}D+0" for x in p))),
    "elements twice": bulk(after=bdf("CHEXA", 901, 9, *BACK)),
    "degrees of freedom turned": bulk(lambda n, p: bdf("GRID", n, None, *p, 5), before=SYSTEM),
    "a system within a system": bulk(local, after=IN_SYSTEM + SYSTEM),
    "cylindrical": bulk(polar, before=POLAR),
    "cylindrical by grids": bulk(polar, before=bdf("CORD1C", 8, 91, 93, 92, 7, 91, 92, 93), after=AT_GRIDS),
    "spherical": bulk(spherical, before=bdf("CORD2S", 7, 0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)),
    "a system for all": bulk(lambda n, p: polar(n, p).replace("7" + " " * 15, " " * 16, n > 9),
                             before=POLAR + bdf("GRDSET", None, 7)),
    "materials, springs, bars of nothing": bulk(
        after=bdf("PSOLID", 1, 1) + bdf("MAT1", 1, 7.0) + bdf("RBE2", 5, 1, 123, 2) + bdf("CELAS1", 5, 1, 1, 1, 2, 1)
        + bdf("CBAR", 6, 1, 1, 2) + bdf("PSHELL", 3, 1, 2.0, *[None] * 4, 0.0)
        + bdf("PSHELL", 9, 1, 2.0, *[None] * 4, 3.0)
        + bdf("CFAST", 7, 19, "PROP", 1, 2) + bdf("PFAST", 19, 0.3, None, 0, *[1.0] * 6)
        + bdf("CBUSH", 7, 8, 1, 2) + bdf("PBUSH", 8, "K", 1.0)),
}  # fmt: skip


@pytest.mark.parametrize("way", BDFS)
def test_bricks_of_nastran_are_the_same_in_every_way_of_writing_them(tmp_path, way):
    check_bricks(read(tmp_path, "mesh.bdf", BDFS[way]), "PID 1", "PID 2", "PID 3")


def test_bulk_data_is_included_from_where_it_is(tmp_path):
    first, second = bulk().split("CHEXA   12", 1)
    text = "BEGIN BULK\ninclude 'ba\nck.bdf' $ the backing\nINCLUDE rest.bdf\nENDDATA\n"
    mesh = read(tmp_path, "mesh.bdf", text, back_bdf=first, rest_bdf="CHEXA   12" + second)
    check_bricks(mesh, "PID 1", "PID 2", "PID 3")
    assert [path.name for path in mesh.files] == ["mesh.bdf", "back.bdf", "rest.bdf"]


NAMES = '$PhysicalNames\n4\n2 1 "LINING"\n3 2 "PAD"\n3 3 "BACK"\n3 4 "ALL"\n$EndPhysicalNames\n'


def msh22(elements, names=NAMES, numbered=lambda number: number) -> str:
    """Elements are (type, tags, nodes)."""
    out = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", names + "$Nodes", len(PLACES)]
    out += [" ".join(map(str, [numbered(number), *place])) for number, place in PLACES.items()]
    out += ["$EndNodes", "$Elements", len(elements)]
    out += [
        " ".join(map(str, [k, kind, len(tags), *tags, *map(numbered, cell)]))
        for k, (kind, tags, cell) in enumerate(elements, 1)
    ]
    return "\n".join(map(str, [*out, "$EndElements", ""]))


def written(rows) -> str:
    return "\n".join(" ".join(map(str, row)) for row in rows)


def msh41(blocks, names=NAMES) -> str:
    """Blocks are (dimension, entity, groups, type, nodes)."""
    out = [
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat",
        names + "$Entities",
        f"0 0 {sum(b[0] == 2 for b in blocks)} {sum(b[0] == 3 for b in blocks)}",
    ]
    out += [" ".join(map(str, [entity, *[0] * 6, len(groups), *groups, 0])) for _, entity, groups, *_ in blocks]
    out += ["$EndEntities", "$Nodes", "1 12 1 12", "3 1 0 12", *PLACES]
    out += [written(PLACES.values()), "$EndNodes", "$Elements", f"{len(blocks)} {len(blocks)} 1 {len(blocks)}"]
    for k, (dimension, entity, _, kind, cell) in enumerate(blocks, 1):
        out += [f"{dimension} {entity} {kind} 1", " ".join(map(str, [k, *cell]))]
    return "\n".join(map(str, [*out, "$EndElements", ""]))


BY_GROUP = [(3, (1, 1), LINING), (5, (2, 1), PAD), (5, (3, 2), BACK)]
MSHS = {
    "2.2": msh22(BY_GROUP),
    "2.2, CRLF": msh22(BY_GROUP).replace("\n", "\r\n"),
    "2.2, CR": msh22(BY_GROUP).replace("\n", "\r"),
    "2.2, volumes in two groups": msh22([*BY_GROUP, (5, (4, 1), PAD), (5, (4, 2), BACK)]),
    "2.2, with partitions and without an entity": msh22(
        [(3, (1,), LINING), (5, (2, 1, 1, 1), PAD), (5, (3, 2, 2, 1, -2), BACK)]),
    "2.2, numbers with holes": msh22(BY_GROUP, numbered=lambda number: 1000 - 7 * number),
    "4.1": msh41([(2, 1, [1], 3, LINING), (3, 1, [2], 5, PAD), (3, 2, [3], 5, BACK)]),
    "4.1, nodes with parameters": msh41([(2, 1, [1], 3, LINING), (3, 1, [2], 5, PAD), (3, 2, [3], 5, BACK)])
    .replace("3 1 0 12\n", "3 1 1 12\n")
    .replace(written(PLACES.values()), written([*place, 0.1, 0.2, 0.3] for place in PLACES.values())),
    "4.1, a volume in two groups": msh41([(2, 1, [1], 3, LINING), (3, 1, [2, 4], 5, PAD), (3, 2, [4, 3], 5, BACK)]),
    "4.1, one name for a surface and a volume": msh41(
        [(2, 1, [1], 3, LINING), (3, 1, [2], 5, PAD), (3, 2, [3], 5, BACK)], NAMES.replace("LINING", "PAD")),
}  # fmt: skip


@pytest.mark.parametrize("way", MSHS)
def test_bricks_of_gmsh_are_the_same_in_every_way_of_writing_them(tmp_path, way):
    check_bricks(read(tmp_path, "mesh.msh", MSHS[way]), lining="PAD" if "one name" in way else "LINING")


def test_a_volume_of_gmsh_in_no_group_is_of_the_whole(tmp_path):
    blocks = [(2, 1, [1], 3, LINING), (3, 1, [2], 5, PAD), (3, 2, [], 5, BACK)]
    check_bricks(read(tmp_path, "mesh.msh", msh41(blocks)), back="gmsh:geometrical 2")


@pytest.mark.parametrize("kind", ["tetra", "tetra10", "hexahedron", "hexahedron20", "hexahedron27"])
@pytest.mark.parametrize("how", ["gmsh", "gmsh22", "gmsh-text", "gmsh22-text", "abaqus", "nastran", "vtu"])
def test_what_another_code_writes_has_its_nodes_in_their_places(tmp_path, kind: str, how: str):
    # meshio writes the orders of nodes of each format by tables of its own. Each node is moved at random.
    if (how, kind) in (("abaqus", "hexahedron27"), ("nastran", "hexahedron27")):
        pytest.skip("the format, or our reader of it, has no such elements")
    second = SECOND_ORDER.get(kind, kind)
    places = REFERENCES[second].nodes
    places = places if kind == second else places[: REFERENCES[second].corners]
    count = len(places)
    places = 1 + places + np.random.default_rng(0).uniform(-0.08, 0.08, places.shape)
    tags: dict = {key: [np.array([1])] for key in ("gmsh:physical", "gmsh:geometrical")} if "gmsh" in how else {}
    form, _, text = how.partition("-")
    options: dict = {"binary": False} if text else {}
    name = {"abaqus": "mesh.inp", "nastran": "mesh.bdf", "vtu": "mesh.vtu"}.get(how, "mesh.msh")
    meshio.Mesh(places, [(kind, np.arange(count)[None])], cell_data=tags).write(
        tmp_path / name, file_format=form, **options
    )
    found = read_solid_mesh(tmp_path / name, "m")
    # meshio writes 12 digits in Nastran's fields, and all of them elsewhere.
    np.testing.assert_allclose(found.points[found.cells[0, :count]], places, rtol=1e-11)


THIN = bdf("MAT1", 1, 7.0, None, 0.3, 8.0)
# An element of each of these is there beside the bricks, or a card, and the message names it and its line.
BESIDE = {
    "mesh.inp": {
        "*ELEMENT, TYPE=COH3D8, ELSET=GLUE\n31, 1, 2, 5, 4, 7, 8, 11, 10\n": r"TYPE=COH3D8 is not read",
        "*ELEMENT, TYPE=AC3D8\n31, 1, 2, 5, 4, 7, 8, 11, 10\n": r"TYPE=AC3D8 is not read",
        "*ELEMENT, TYPE=C3D6\n31, 1, 2, 5, 7, 8, 11\n": r"TYPE=C3D6 is not read",
        "*ELEMENT, TYPE=B31\n31, 1, 2\n": r"TYPE=B31 is not read",
        "*ELEMENT, TYPE=U3\n31, 1, 2\n": r"TYPE=U3 is not read",
        "*ELEMENT, TYPE=C3D27\n31, 1\n": r"TYPE=C3D27 is not read, .* mesh it in .* hexahedra of 8 or 20",
        "*ELEMENT, TYPE=ROTARYI\n31, 1\n": r"TYPE=ROTARYI acts on rotations, which nodes of solids do not have",
        "*ROTARY INERTIA, ELSET=R\n1., 1., 1.\n": r"line 22: \*ROTARY INERTIA acts on rotations",
        "*ELEMENT, TYPE=MASS, ELSET=M\n31, 1\n": r"line 22: \*ELEMENT TYPE=MASS: no \*MASS gives the mass of elem",
        "*ELEMENT, TYPE=MASS, ELSET=M\n31, 1\n*MASS, ELSET=M\n-2.,\n": r"line 24: \*MASS has the mass -2\.; write a",
        "*ELEMENT, TYPE=MASS, ELSET=M\n31, 1\n*MASS, ELSET=M\n": r"line 24: \*MASS has the mass of an empty field",
        "*ELEMENT, TYPE=MASS, ELSET=M\n31, 77\n*MASS, ELSET=M\n2.,\n": r"element 31 has the node 77",
        "*ELEMENT, TYPE=MASS, ELSET=M\n31, 1\n*MASS, ELSET=PAD\n2.,\n": r"names element 12 of type C3D8, which is no",
        "*ELEMENT, TYPE=MASS, ELSET=M\n31, 1\n*MASS, ELSET=M\n2.,\n*MASS, ELSET=M\n3.,\n": r"another mass than a card",
        "*NODE\n91, 9., 0., 0.\n*ELEMENT, TYPE=MASS, ELSET=M\n31, 91\n*MASS, ELSET=M\n2.,\n":
            r"line 26: \*MASS of element 31 is at a node of no solid element",
        "*SHELL TO SOLID COUPLING, CONSTRAINT NAME=C\nA, B\n*ELEMENT, TYPE=S4R\n31, 1, 2, 8, 9\n":
            r"1 S4R that are no faces",
        SKIN.format("S4R", "SHELL", "4.,"): r"line 24: \*SHELL SECTION of the set SKIN gives 1 surface elements a "
            r"thickness of 4 m; their mass \(480 kg\) is not read: make them solid, or leave it out",
        SKIN.format("S4R", "SHELL", "4.,").partition("*MATERIAL")[0]: r"\(the file gives no density\) is not read",
        SKIN.format("M3D4", "MEMBRANE", ".5"): r"\*MEMBRANE SECTION of the set SKIN .*thickness of 0\.5 m.*\(60 kg\)",
        SKIN.format("CPS4", "SOLID", ""): r"\*SOLID SECTION of the set SKIN .*thickness of 1 m.*\(120 kg\)",
        SKIN.format("S4", "SHELL", "1., 3, STEEL\n2., 3, STEEL").replace("MATERIAL=STEEL", "COMPOSITE", 1):
            r"thickness of 3 m.*\(360 kg\)",
        SKIN.format("S4", "SHELL", "1., 3\n2., 3, STEEL").replace("MATERIAL=STEEL", "COMPOSITE", 1):
            r"thickness of 3 m.*\(the file gives no density\)",
        SKIN.format("S4", "SHELL", "1.").replace("8.,", ", 8."): r"thickness of 1 m.*\(the file gives no density\)",
        SKIN.format("S4", "SHELL", "1.").replace(", MATERIAL=STEEL", "", 1): r"\(the file gives no density\)",
        SKIN.format("S4", "SHELL", "1.").replace("MATERIAL=STEEL", "MATERIAL=STEEL, NODAL THICKNESS", 1):
            r"line 24: \*SHELL SECTION gives a thickness that differs",
        "*ELEMENT, TYPE=T3D2, ELSET=BAR\n31, 1, 2\n*SOLID SECTION, ELSET=BAR\n2.,\n": r"TYPE=T3D2 has a section",
        "*ELEMENT, TYPE=T3D2, ELSET=BAR\n31, 1, 2\n*ELSET, ELSET=BARS\nBAR\n*SOLID SECTION, ELSET=BARS\n2.,\n":
            r"TYPE=T3D2 has a section",
        "*NONSTRUCTURAL MASS, ELSET=PAD, UNITS=TOTAL MASS\n2.,\n": r"\*NONSTRUCTURAL MASS may change mass",
        "*NGEN\n1, 3, 1\n": r"\*NGEN may change",
        "*NCOPY, OLD SET=LINING, CHANGE NUMBER=100, SHIFT\n1., 0., 0.\n\n": r"\*NCOPY may change",
        "*ELGEN, ELSET=MORE\n11, 2, 1, 1\n": r"\*ELGEN may change",
        "*STEP\n*STATIC\n*MODEL CHANGE, REMOVE\nPAD,\n*END STEP\n": r"\*MODEL CHANGE may change",
        "*UNHEARD OF\n1.,\n": r"\*UNHEARD OF is not known here",
        "*ELSET, ELSET=MANY\nPAD, NOWHERE\n": r"names the set NOWHERE, which no card before it gives",
        "*ELSET, ELSET=MANY, FOO=BAR\n11\n": r"has the option FOO, which is not read",
        "*NSET, NSET=S, GENERATE\n5\n": r"line 22: \*NSET cannot be read: '5' is no range; GENERATE takes a first",
        "*ELSET, ELSET=S, GENERATE\n11, 12, 0\n": r"line 22: \*ELSET cannot be read: '11, 12, 0' is no range",
        "*ELSET, ELSET=S, GENERATE\n12, 11\n": r"'12, 11' is no range",
        "*ELSET, ELSET=S, GENERATE\n1, 2, 1, 11\n": r"'1, 2, 1, 11' is no range",
        "*ELSET, ELSET=S, GENERATE\n1,, 11\n": r"cannot be read: '' is not a whole number",
        "*ELSET, ELSET=S\n1²\n": r"names the set 1², which no card before it gives",
        "*SURFACE, NAME=S\nPAD, S7\n": r"the face S7 of an element of type C3D8",
        "*INCLUDE, INPUT=nowhere.inp\n": r"nowhere\.inp cannot be read \(No such file",
        "*INCLUDE, INPUT=\n": r"line 22: the line includes a file without a name",
        "*NODE, INPUT=\n": r"line 22: the line includes a file without a name",
        "*INCLUDE, INPUT=mesh.inp\n": r"mesh\.inp includes itself",
        "*ELEMENT, TYPE=S4R, ELSET=PLATE\n31, 1, 2, 8, 9\n": r"1 S4R that are no faces of its solid",
        "*ELEMENT, TYPE=C3D8\n31, 1, 2, 5, 4, 7, 8, 11\n": r"gives element 31 7 nodes, and its type has 8",
        "*ELEMENT, TYPE=C3D8\n31, 1, 2, 5, 4, 7, 8, 11, 10, 9\n": r"gives element 31 9 nodes, and its type has 8",
        "*NODE\n1, 1.2.3, 0, 0\n": r"\*NODE cannot be read: '1\.2\.3' is not a number",
        "*NODE\n91, 1E999, 0, 0\n*ELEMENT, TYPE=C3D8\n31, 1, 2, 5, 4, 7, 8, 11, 91\n":
            r"coordinates are no finite numbers, the first is of element 31",
        "*NODE, SYSTEM=S\n91, 1., 0, 0\n": r"SYSTEM=S gives spherical coordinates",
        "*Rigid Body, ref node=1, elset=PAD, density=7.8E-9\n1.,\n":
            r"line 22: \*RIGID BODY gives its elements a mass by DENSITY",
        "*SURFACE SECTION, ELSET=PAD, DENSITY=LAYER\n": r"\*SURFACE SECTION gives its elements a mass by DENSITY",
        "*FASTENER PROPERTY, NAME=SPOT, MASS=0.02\n5.,\n": r"\*FASTENER PROPERTY gives its elements a mass by MASS",
        "*INSTANCE, NAME=I, PART=NONE\n1., 0., 0.\n*END INSTANCE\n": r"names no part that the file gives",
    },
    "mesh.bdf": {
        bdf("CONM2", 31, 1, 0, 2.0, 0.5): r"line 18: CONM2 31 has an offset or moments of inertia, and acts on rot",
        bdf("CONM2", 31, 1, 0, 2.0, *[None] * 4, 0.1): r"CONM2 31 has an offset or moments of inertia",
        bdf("CONM2", 31, 1, -1, 2.0): r"CONM2 31 has an offset or moments of inertia",
        bdf("CONM2", 31, 1, 0, -2.0): r"CONM2 has the mass -2\.0; write a number of at least 0",
        bdf("CONM2", 31, 77, 0, 2.0): r"CONM2 31 is at the grid 77, which the file does not give a place",
        bdf("CONM2", 31, 1, 0, 2.0) + bdf("CONM2", 31, 2, 0, 2.0): r"CONM2 31 is given otherwise \(.*line 18\)",
        bdf("GRID", 91, None, 9.0, 0.0, 0.0) + bdf("CONM2", 31, 91, 0, 2.0): r"CONM2 31 is at a node of no solid",
        bdf("CONM2", 31, 1, 0, 2.0) + bdf("PARAM", "WTMASS", 0.1): r"line 19: PARAM WTMASS scales masses, which is not",
        bdf("CMASS2", 31, 2.0, 1, 1): r"line 18: CMASS2 31 is at the grid 1, where masses along its components 1, 2 "
            r"and 3 are 2, 0 and 0, and must be equal; write CONM2",
        "".join(bdf("CMASS2", 31 + k, 2.0 + k, 1, 1 + k) for k in range(3)): r"are 2, 3 and 4, and must be equal",
        bdf("PARAM", "WTMASS", 0.1) + bdf("CMASS2", 31, 2.0, 1, 1): r"line 18: PARAM WTMASS scales masses",
        bdf("CMASS2", 31, 2.0, 1, 5): r"CMASS2 31 acts on rotations",
        bdf("CMASS2", 31, 2.0, 1, 1, 2, 1): r"CMASS2 31 is at a scalar point or between two nodes",
        bdf("CMASS1", 31, 2, 1, 1): r"CMASS1 is a mass that is not read; write CONM2, or CMASS2",
        bdf("CWELD", 31, 9, 1, "ELPAT", 11, 12): r"CWELD is a weld with a section, and a mass that is not read",
        bdf("CFAST", 31, 9, "PROP", 1, 2) + bdf("PFAST", 9, 0.3, None, 0, *[1.0] * 6, 0.2):
            r"PFAST 9 gives .* mass of 0\.2",
        THIN + bdf("PSHELL", 3, 1, 4.0): r"line 19: PSHELL 3 gives 1 surface elements a thickness of 4 m; their mass "
            r"\(480 kg\) is not read: make them solid, or leave it out",
        bdf("PSHELL", 3, 1, 4.0): r"PSHELL 3 gives .*\(the file gives no density\) is not read",
        THIN + bdf("PSHEAR", 3, 1, 4.0): r"PSHEAR 3 gives .*\(480 kg\)",
        THIN + bdf("PSHELL", 3, 1) + bdf("CQUAD4", 32, 3, *LINING, *[None] * 4, *[2.0] * 4):
            r"PSHELL 3 gives 1 surface elements a thickness of 2 m",
        THIN + bdf("PSHELL", 3, 1, 1e-6) + bdf("CQUAD4", 32, 3, *LINING, *[None] * 4, *[2.0] * 4):
            r"thickness of 2 m; their mass \(240 kg\)",
        THIN + bdf("PSHELL", 3, 1, 0.5) + bdf("CQUAD4", 32, 3, *LINING, *[None] * 3, 1, *[3.0] * 4):
            r"thickness of 1\.5 m; their mass \(180 kg\)",
        THIN + bdf("PSHELL", 3, None, 2.0, 1): r"thickness of 2 m; their mass \(240 kg\)",
        THIN + bdf("PSHELL", 3, 1, 1.6E-4) + bdf("PSHELL", 4, 1, 1.7E-4) + bdf("CQUAD4", 32, 4, *LINING):
            r"PSHELL 4 gives 1 surface elements a thickness of 0\.00017 m; their mass \(0\.0204 kg\) is not read",
        THIN + bdf("PCOMP", 3, *[None] * 7, 1, 0.5, None, None, None, 1.5): r"thickness of 2 m; their mass \(240 kg\)",
        THIN + bdf("PCOMP", 3, *[None] * 6, "SYM", 1, 0.5): r"thickness of 1 m; their mass \(120 kg\)",
        THIN + bdf("PCOMPG", 3, *[None] * 7, 7, 1, 0.5, *[None] * 5, 8, 1, 0.25): r"0\.75 m; their mass \(90 kg\)",
        bdf("CPENTA", 31, 1, 1, 2, 5, 7, 8, 11): r"holds hexahedron, wedge; it must be all of one kind",
        bdf("CHEXA", 31, 1, *BACK[:7]): r"CHEXA 31 has 7 nodes, and 8 or 20 are read",
        bdf("CHEXA", 31, 1, *BACK[:7], 77): r"element 31 has the node 77",
        bdf("CHEXA1", 31, 1, *BACK): r"CHEXA1 is not read, and mass may be missing",
        bdf("CBEAM", 31, 1, 1, 2) + bdf("PBEAM", 1, 1, 2.0): r"CBEAM is a bar with a section",
        bdf("PSHELL", 3, 1, 2.0, 1, None, 1, None, "3.-1"): r"line 18: PSHELL 3 gives its elements a mass of 3\.-1",
        bdf("PSHELL", "+3", 1, 2.0, *[None] * 4, 0.1): r"PSHELL \+3 gives its elements a mass of 0\.1",
        bdf("PCOMP", 3, None, 0.3) + "+\n": r"PCOMP 3 gives its elements a mass of 0\.3",
        bdf("CBUSH", 31, 8, 1, 2) + bdf("PBUSH", 8, "K", 1.0, *[None] * 6, "M", 0.2): r"PBUSH 8 gives .* mass of 0\.2",
        bdf("CBUSH1D", 8, None, 1, 2) + bdf("PBUSH1D", 8, 1.0, None, 0.2): r"PBUSH1D 8 gives its elements a mass of 0",
        bdf("CBAR", 31, 1, 1, 2) + bdf("PBRSECT", 1, 1, "GS", 0.1): r"CBAR is a bar with a section",
        bdf("CQUAD4", 31, 1, 1, 2, 8, 9): r"1 CQUAD4 that are no faces of its solid",
        bdf("NSM", 1, "PSOLID", 1, 0.1): r"NSM may change mass",
        bdf("GRID", 91, 55, 0.0, 0.0, 0.0): r"GRID is in the system 55, which no CORD1R",
        bdf("GRID", 1, None, 0.0, 0.0, 1.0): r"GRID 1 has another place already",
        bdf("GRID", 91, None, "1.2.3", 0.0, 0.0): r"GRID cannot be read: '1\.2\.3' is not a number",
        bdf("GRID", 91, 5, 0.0, 0.0, 0.0) + bdf("CORD2R", 5, 5, *[0.0] * 9): r"system 5, which is given by itself",
        bdf("GRID", 91, 5, 0.0, 0.0, 0.0) + bdf("CORD1R", 5, 1, 2, 77): r"CORD1R is given by the grid 77, which is not",
        bdf("GRID", 91, 5, 0.0, 0.0, 0.0) + bdf("CORD1R", 5, 1, 2, 3): r"CORD1R has three points on one line",
        bdf("GRID", 91, None, 0.0, 0.0, 5.0, wide=True, mark=""): r"one of large fields, and must begin with \*",
        IN_SYSTEM + POLAR: r"CORD2C 7 is given otherwise \(.*line \d+\); number systems anew",
        "=,*1,==\n": r"fields that repeat those of another card",
        "GRID,91,,0.,0.,0.,,,,+B\n+A,1\n": r"\+A continues another card",
        "GRID*,91,,1.5,2.5,3.5\n": r"line 18: 3\.5 stands where a line has the mark of its continuation",
        "GRID*,91,,1.5,2.5,3.5\n*,4.5\n": r"line 18: 3\.5 stands where a line has the mark of its continuation",
        "GRID,91,,0.,0.,0.,,,,B\n+A,1\n": r"line 18: B stands where a line has the mark of its continuation",
        "BEGIN BULK\nBEGIN SUPER=1\n": r"BEGIN SUPER=1: one block BEGIN BULK is read",
        "INCLUDE\n": r"line 18: the line includes a file without a name",
        "INCLUDE '' $ rest.bdf\n": r"line 18: the line includes a file without a name",
        "INCLUDE 'nowhere.bdf'\n": r"nowhere\.bdf cannot be read",
    },
    "mesh.msh": {
        msh22([*BY_GROUP, (7, (4, 3), (1, 2, 5, 4, 9))]): r"holds hexahedron, pyramid; it must be all of one kind",
        msh22([*BY_GROUP, (92, (4, 3), BACK)]): r"cannot be read as \.msh.*elements of Gmsh's type 92",
        msh22([*BY_GROUP, (5, (4, 3), (*BACK[:7], 77))]): r"element 4 has the node 77",
        msh22(BY_GROUP).replace("2.2 0 8", "4.0 0 8"): r"is of Gmsh's format 4\.0; save it as 4\.1 or 2\.2",
        MSHS["4.1"].replace("4.1 0 8", "4 0 8"): r"is of Gmsh's format 4; save it as 4\.1 or 2\.2",
        MSHS["4.1"].replace("4.1 0 8", "4.1"): r"lacks the kind of file or the size of numbers",
        msh22(BY_GROUP)[:-20]: r"ends within \$Elements; it was cut short",
        msh22(BY_GROUP) + msh22(BY_GROUP): r"holds \$MeshFormat twice",
        msh22(BY_GROUP).replace("11 10\n", "11\n"): r"cannot be read as \.msh",
        MSHS["4.1"].replace("\n3 3 1 3\n", "\n2 3 1 3\n"): r"holds more numbers than its elements",
        msh22(BY_GROUP) + "$PartitionedEntities\n1\n$EndPartitionedEntities\n": r"a mesh in partitions",
    },
}  # fmt: skip


@pytest.mark.parametrize(("name", "text"), [(name, text) for name, cases in BESIDE.items() for text in cases])
def test_what_may_change_mass_places_or_sets_is_refused_by_name_and_line(tmp_path, name, text):
    whole = {"mesh.inp": INP, "mesh.bdf": bulk(), "mesh.msh": ""}[name]
    with pytest.raises(RequestError, match=BESIDE[name][text]) as caught:
        read(tmp_path, name, whole + text)
    assert str(tmp_path / name) in str(caught.value)
    assert str(caught.value).isprintable()


MASSES = {
    "mesh.inp": INP + "*ELEMENT, TYPE=MASS, ELSET=M\n31, 3\n32, 3\n*MASS, ELSET=M\n2.,\n"
    "*ELEMENT, TYPE=MASS, ELSET=TWICE\n31, 3\n*MASS, ELSET=TWICE, ALPHA=0.1\n2.,\n"
    "*ELEMENT, TYPE=MASS, ELSET=ONE\n33, 1\n*MASS, ELSET=ONE\n0.5,\n",
    "instance.inp": CAE.replace("MOVE", "1., 0., 0.\n").replace("*End Assembly\n", "*Element, type=MASS, elset=M\n"
    "1, SHOE-1.3\n*Mass, elset=M\n4.,\n*Element, type=MASS, elset=O\n2, Shoe-1.1\n*Mass, elset=O\n.5\n*End Assembly\n"),
    # The assembly's elements have numbers of the part's: 11 is a brick there, and 31 a mass.
    "both.inp": CAE.replace("MOVE", "").replace("*Nset, nset=Rub", "*Element, type=MASS, elset=P\n31, 1\n"
    "*Mass, elset=P\n0.3\n*Nset, nset=Rub").replace("*End Assembly\n", "*Element, type=MASS, elset=M\n"
    "11, SHOE-1.3\n12, 1\n31, SHOE-1.1\n*Elset, elset=A\n11\n*Mass, elset=A\n4.\n*Elset, elset=N\n12\n"
    "*Mass, elset=N\n0.\n*Elset, elset=B\n31\n*Mass, elset=B\n0.2\n*End Assembly\n"),
    "mesh.bdf": bulk(after=2 * bdf("CONM2", 31, 3, 0, 2.0) + bdf("CONM2", 32, 3, 7, 2.0, 0.0, 0.0, 0.0)
    + "".join(bdf("CMASS2", 33 + k, 0.5, 1, 1 + k) for k in range(3)) + bdf("PARAM", "WTMASS", 1.0)
    + bdf("GRID", 91, None, 9.0, 0.0, 0.0) + bdf("CONM2", 39, 91, 0, 0.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", MASSES)
def test_point_masses_are_read_at_their_nodes(tmp_path, name):
    mesh = read(tmp_path, name, MASSES[name])
    move = (1, 0, 0) if name == "instance.inp" else (0, 0, 0)
    found = {tuple(place): mass for place, mass in zip(mesh.points.tolist(), mesh.point_masses, strict=True) if mass}
    assert found == {tuple(np.add(PLACES[3], move)): 4.0, tuple(np.add(PLACES[1], move)): 0.5}
    counts = {"mesh.inp": {"MASS": 4}, "instance.inp": {"MASS": 2}, "both.inp": {"MASS": 4}}
    assert {kind: count for kind, count in mesh.counts.items() if "MASS" in kind or kind == "CONM2"} == counts.get(
        name, {"CONM2": 3, "CMASS2": 3}
    )
    assert len(mesh.faces_of("PID 3" if name == "mesh.bdf" else "LINING")[0]) == 1
    for unit, asked, factor in (("mm", "auto", 1e3), ("mm", "kg", 1.0), ("cm", "t", 1e3), ("m", "t", 1e3)):
        assert read_solid_mesh(tmp_path / name, unit, asked).point_masses.sum() == 4.5 * factor
    with pytest.raises(RequestError, match=r'line \d+: .*: no unit of mass follows from unit = "in"; add mass_unit = '):
        read_solid_mesh(tmp_path / name, "in")


def test_units_of_mass_are_known_ones_and_masses_of_zero_need_none(tmp_path):
    text = bulk(after=bdf("CONM2", 31, 3, 0, 0.0))
    read(tmp_path, "mesh.bdf", text)
    assert not read_solid_mesh(tmp_path / "mesh.bdf", "in").point_masses.any()
    with pytest.raises(RequestError, match=r"unit of mass is one of auto, kg, t, and not 'lb'"):
        read_solid_mesh(tmp_path / "mesh.bdf", "m", "lb")
    read(tmp_path, "mesh.bdf", text + bdf("CONM2", 32, 1, 0, 1.0))
    with pytest.raises(RequestError, match=r"CONM2.*32: no unit of mass follows"):
        read_solid_mesh(tmp_path / "mesh.bdf", "in")


def test_masses_along_three_directions_are_equal_but_for_rounding(tmp_path):
    thirds = "".join(bdf("CMASS2", 31 + k, 0.333333, 3, 1) for k in range(3))
    others = "".join(bdf("CMASS2", 41 + k, mass, 3, 2 + k) for k, mass in enumerate((1.0, 1.0)))
    assert read(tmp_path, "mesh.bdf", bulk(after=thirds + others)).point_masses.sum() == pytest.approx(1.0, rel=1e-5)
    with pytest.raises(
        RequestError, match=r"CMASS2 31 is at the grid 3, .* are 0\.999999, 1 and 1\.0001, and must be equal"
    ):
        read(tmp_path, "mesh.bdf", bulk(after=thirds + others.replace("42      1.0 ", "42      1.0001")))


def test_shares_of_a_thickness_are_none_in_themselves(tmp_path):
    # A tetrahedron with a shell on its face of 3 m²; the 1 behind three thicknesses makes them shares of another.
    text = "".join(bdf("GRID", number, None, *place) for number, place in PLACES.items())
    text += bdf("CTETRA", 11, 1, 1, 2, 4, 7) + bdf("MAT1", 1, 7.0, None, 0.3, 8.0)
    text += bdf("CTRIA6", 22, 3, 1, 2, 4, 5, 7, 8, *[None] * 2, 3.0, 3.0, 3.0, 1)
    read(tmp_path, "mesh.bdf", text + bdf("PSHELL", 3, 1, 1e-6))
    with pytest.raises(RequestError, match=r"thickness of 1\.5 m; their mass \(36 kg\)"):
        read(tmp_path, "mesh.bdf", text + bdf("PSHELL", 3, 1, 0.5))


def test_a_point_mass_of_an_assembly_is_at_no_node_of_its_instance_by_its_number_alone(tmp_path):
    text = CAE.replace("MOVE", "").replace(
        "*End Assembly\n", "*Element, type=MASS, elset=M\n1, 1\n*Mass, elset=M\n4.,\n*End Assembly\n"
    )
    with pytest.raises(RequestError, match=r"\*MASS of element 1 is at a node of no solid element"):
        read(tmp_path, "mesh.inp", text)


def test_what_decides_how_a_file_is_read_is_said(tmp_path):
    with pytest.raises(RequestError, match=r"mesh\.dat cannot be read as \.dat.*its ending decides how it is read"):
        read(tmp_path, "mesh.dat", bulk())
    with pytest.raises(RequestError, match=r"line 2: CEND ends the executive control, and BEGIN BULK is missing"):
        read(tmp_path, "mesh.bdf", "SOL 103\nCEND\n" + bulk())


def test_what_an_instance_cannot_be_turned_about_is_refused_with_its_line(tmp_path):
    for move, why in (
        ("1., 0., 0.\n1., 0., 0., 1., 0., 0., 90.\n", "in one place"),
        ("1., zero, 0.\n", "'zero' is not"),
    ):
        with pytest.raises(RequestError, match=rf"mesh\.inp, line 26: \*INSTANCE .*{why}"):
            read(tmp_path, "mesh.inp", CAE.replace("MOVE", move))


def test_a_card_without_elements_is_no_mesh(tmp_path):
    with pytest.raises(RequestError, match="holds no solid elements but no elements"):
        read(tmp_path, "mesh.inp", NODES + "*ELEMENT, TYPE=C3D8\n")


def test_sets_have_names_of_any_letters(tmp_path):
    text = INP.replace("LINING", "BELÄGE")
    for content in (text.encode("cp1252"), text.encode("utf-8"), text.encode("utf-16")):
        check_bricks(read(tmp_path, "mesh.inp", content), lining="BELÄGE")


def test_a_pipe_is_no_file_to_include(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RequestError, match=r"line 14: the mesh file .*pipe cannot be read \(.*a named pipe\)"):
        read(tmp_path, "mesh.inp", NODES + "*INCLUDE, INPUT=pipe\n")


@pytest.mark.parametrize(("name", "text"), [("mesh.inp", INP), ("mesh.bdf", bulk()), ("mesh.msh", MSHS["4.1"])])
def test_a_file_beyond_the_largest_size_is_not_read(tmp_path, monkeypatch, name, text):
    monkeypatch.setattr("drumsqueal.physics.bodies.mesh_files.MOST_BYTES", len(text) - 1)
    with pytest.raises(RequestError, match=rf"{name} cannot be read \(the file of 0 MB is larger than 0 MB\)"):
        read(tmp_path, name, text)


def test_elements_within_others_are_refused(tmp_path):
    middles = [*range(101, 113)]
    places = {k: (1.0 + k / 1000, 1.0, 1.0) for k in middles}
    within = inp_nodes(places=places) + "*ELEMENT, TYPE=C3D20\n" + joined(31, *BACK, *middles)
    with pytest.raises(RequestError, match=r"holds hexahedron, hexahedron20; it must be all of one kind"):
        read(tmp_path, "mesh.inp", INP + within)
    with pytest.raises(RequestError, match=r"the elements 31 and 32 between the same corners, with other nodes"):
        read(tmp_path, "mesh.inp", NODES + within + joined(32, *BACK, *middles[::-1][:-1], 1))
    within = "*NODE\n91, 3., 0., 1.\n92, 3., 3., 1.\n*ELEMENT, TYPE=C3D8\n" + joined(31, 2, 91, 92, 5, 8, 9, 12, 11)
    with pytest.raises(RequestError, match="faces of more than two elements, the first is of element 11"):
        read(tmp_path, "mesh.inp", INP + within)


def test_numbers_that_two_elements_have_name_no_element(tmp_path):
    text = INPS["numbers twice"] + "*ELSET, ELSET=SOME\n11\n"
    with pytest.raises(RequestError, match="names the element 11, and 2 elements have this number"):
        read(tmp_path, "mesh.inp", text)
    with pytest.raises(RequestError, match=r"is one of several of meshed parts \(SHOE-1, B\)"):
        read(tmp_path, "mesh.inp", CAE.replace("MOVE", "").replace("*Node\n", "*Instance, name=B, part=SHOE\n*Node\n"))


def test_what_is_passed_over_or_counted_once_is_said(tmp_path):
    twice = read(tmp_path, "mesh.inp", INPS["elements twice"])
    assert [note.partition(": ")[2] for note in twice.notes] == [
        "1 elements repeat others by their nodes, and count once"
    ]
    assert twice.numbers.tolist() == [11, 12]
    assert (twice.counts, twice.elements_of("STEEL").tolist()) == ({"C3D8": 2}, [0])
    bulky = read(tmp_path, "mesh.bdf", bulk(after="UNHEARD 1\n"))
    assert [note.partition(": ")[2] for note in bulky.notes] == [
        "UNHEARD is not known here and was passed over",
        "1 CQUAD4 on faces of solids are taken as faces, without mass of their own",
    ]
    meshio.Mesh(np.array([*PLACES.values()]), [("hexahedron", np.array([BACK, PAD]) - 1)]).write(tmp_path / "mesh.mesh")
    assert "compare the mass" in read_solid_mesh(tmp_path / "mesh.mesh", "m").notes[0]


def test_cells_that_meshio_drops_are_an_error(tmp_path):
    cells = np.array([BACK, PAD]) - 1
    meshio.Mesh(np.array([*PLACES.values()]), [("hexahedron", cells)]).write(tmp_path / "mesh.vtu", binary=False)
    text = (tmp_path / "mesh.vtu").read_text()
    with pytest.raises(RequestError, match=r"cannot be read as \.vtu.*type 11"):
        read(tmp_path, "mesh.vtu", text.replace("12\n12", "12\n11"))
    with pytest.raises(RequestError, match="elements have nodes that have no place"):
        read(tmp_path, "mesh.vtu", text.replace(str(cells[1, -1]), "77"))
