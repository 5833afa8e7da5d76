"""Modal results of small files by hand: nodes, frequencies and shapes in SI, in order, and of unit modal mass."""

from pathlib import Path

import numpy as np
import pytest
import pyuff
from numpy.polynomial.legendre import legval2d

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.given_modes import ModalResults, find_given_modes, find_lining, read_modal_results
from drumsqueal.physics.bodies.solid_elements import rigid_motions

# Numbers that differ everywhere: four nodes, three modes in no order.
NODES = np.array([[10.0, -2.0, 0.5], [30.0, 4.0, -1.5], [-7.0, 11.0, 2.5], [5.0, 6.0, 8.0]])
HERTZ = np.array([700.0, 20.0, 350.0])
MASSES = np.array([4.0, 9.0, 0.25])
SHAPES = np.arange(1.0, 37.0).reshape(3, 4, 3) * np.array([1.0, -0.5, 0.1])[:, None, None]
RISING = [1, 2, 0]


def expected(length: float, mass: float) -> tuple[np.ndarray, ...]:
    """In m, Hz and kg^-½."""
    shapes = SHAPES / np.sqrt(MASSES * mass)[:, None, None]
    return NODES * length, HERTZ[RISING], shapes[RISING]


def compare(found, wanted, rtol=1e-14) -> None:
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=rtol)


@pytest.mark.parametrize(
    ("unit", "mass_unit", "length", "mass"),
    [("m", "auto", 1.0, 1.0), ("mm", "auto", 1e-3, 1e3), ("mm", "kg", 1e-3, 1.0), ("m", "t", 1.0, 1e3)],
)
def test_arrays_are_read_in_their_units(tmp_path, unit, mass_unit, length, mass):
    file = tmp_path / "modes.NPZ"
    with file.open("wb") as stream:
        np.savez(stream, nodes=NODES, frequencies=HERTZ, shapes=SHAPES, modal_mass=MASSES)
    compare(read_modal_results(file, unit, mass_unit), expected(length, mass))


def test_one_modal_mass_is_that_of_all_modes(tmp_path):
    np.savez(tmp_path / "m.npz", nodes=NODES, frequencies=HERTZ, shapes=SHAPES, modal_mass=4.0)
    found = read_modal_results(tmp_path / "m.npz", "m")
    np.testing.assert_allclose(found.shapes, (SHAPES / 2)[RISING], rtol=1e-15)
    with pytest.raises(RequestError, match=r"m\.npz does not state its units; add unit"):
        read_modal_results(tmp_path / "m.npz")


def universal(path: Path, labels=(31, 7, 12, 90), units=None, *, left_out=(), **of_mode) -> Path:
    """The same as a universal file, in two sets of nodes; nodes of a mode in reverse; `left_out` of the first mode."""
    sets = [
        {"type": 15, "node_nums": list(labels[k : k + 2]), **dict(zip("xyz", NODES[k : k + 2].T, strict=True))}
        for k in (0, 2)
    ]
    if units is not None:
        code = {"units_code": 9, "units_description": "".ljust(20), "temp_mode": 1, "temp": 1.0, "temp_offset": 0.0}
        sets.append({"type": 164, **code, "length": units[0], "force": units[1]})
    for k, shape in enumerate(SHAPES):
        kept = [n for n in range(3, -1, -1) if not (k == 0 and n in left_out)]
        r1, r2, r3 = shape[kept].T
        sets.append({
            "type": 55, "model_type": 1, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8, "data_type": 2,
            "load_case": 0, "mode_n": k + 1, "freq": HERTZ[k], "modal_m": MASSES[k],
            "node_nums": [labels[n] for n in kept], "r1": r1, "r2": r2, "r3": r3, **of_mode,
        })  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")
    return path


def test_nodes_of_a_universal_file_belong_to_their_displacements_by_number(tmp_path):
    order = np.argsort((31, 7, 12, 90))
    # Of a metre in 1000 units of the file and a newton in 10: a unit of mass is force over length, 0.1 over 0.001 kg.
    for units, length, mass in (((1e3, 10.0), 1e-3, 100.0), ((1.0, 1.0), 1.0, 1.0)):
        nodes, hertz, shapes = expected(length, mass)
        found = read_modal_results(universal(tmp_path / "m.unv", units=units))
        compare(found, (nodes[order], hertz, shapes[:, order]), rtol=2e-5)  # six digits in the file
    nodes, hertz, shapes = expected(1e-3, 1e3)
    compare(read_modal_results(universal(tmp_path / "m.uff"), "mm"), (nodes[order], hertz, shapes[:, order]), rtol=2e-5)


def test_a_node_that_a_mode_leaves_out_rests_in_it(tmp_path):
    found = read_modal_results(universal(tmp_path / "m.unv", left_out=(2,)), "m")
    first = SHAPES[0] * (np.arange(4) != 2)[:, None] / 2.0
    np.testing.assert_allclose(found.shapes[2], first[np.argsort((31, 7, 12, 90))], rtol=2e-5)


def test_units_that_a_file_states_may_be_given_if_they_are_the_same(tmp_path):
    file = universal(tmp_path / "m.unv", units=(1e3, 1.0))
    own = read_modal_results(file)
    compare(read_modal_results(file, "mm", "t"), own)
    with pytest.raises(RequestError, match=r'unit = "m", and dataset 164 of .* states 0\.001 m; leave unit out'):
        read_modal_results(file, "m")
    with pytest.raises(RequestError, match=r'mass_unit = "kg", .* states 1000 kg; leave mass_unit out'):
        read_modal_results(file, "mm", "kg")


def test_modes_of_something_else_do_not_count(tmp_path):
    """Forced responses beside normal modes, strains in the place of displacements, and none at all."""
    file = universal(tmp_path / "m.unv")
    whole = read_modal_results(file, "m")
    for other in ({"analysis_type": 5, "freq_step_n": 1}, {"spec_data_type": 3}):
        odd = universal(tmp_path / "odd.unv", **other)
        with pytest.raises(RequestError, match=r"odd\.unv holds no normal modes \(dataset 55\)"):
            read_modal_results(odd, "m")
        (tmp_path / "both.unv").write_text(file.read_text() + odd.read_text())
        compare(read_modal_results(tmp_path / "both.unv", "m"), whole)
    text = universal(tmp_path / "lost.unv").read_text().split("    -1\n")
    del text[3:5]  # the second set of nodes
    (tmp_path / "lost.unv").write_text("    -1\n".join(text))
    with pytest.raises(RequestError, match="2 nodes of its modes have no place, the first is 12"):
        read_modal_results(tmp_path / "lost.unv", "m")


def test_a_lining_is_the_rectangle_of_its_outermost_nodes_and_they_have_its_area():
    """Nine by four of them with unlike distances, a little off the middle, over others farther in."""
    theta, z = np.radians([-50, -41, -30, -18, -5, 9, 22, 37, 50]), np.array([-11.0, -4.0, 6.0, 13.0]) * 1e-3
    angle, across = (each.ravel() for each in np.meshgrid(theta, z, indexing="ij"))
    on = np.stack([0.12 * np.cos(angle), 0.12 * np.sin(angle), across], axis=1)
    nodes = np.concatenate([on * [0.8, 0.8, 1.0], on])
    lining = find_lining(nodes)
    np.testing.assert_array_equal(lining.nodes, np.arange(len(on)) + len(on))
    arc, width = np.radians(100.0), 0.024
    assert lining.surface[:4] == pytest.approx((0.12, arc, width, 1e-3), rel=1e-12)
    assert lining.area.sum() == pytest.approx(arc * width, rel=1e-12)
    # Triangles of a rectangle of nodes have half of it each; a corner of the lining has a third of one or of two.
    of_first = (theta[1] - theta[0]) * (z[1] - z[0])
    assert lining.area[0] / of_first in (pytest.approx(1 / 6), pytest.approx(1 / 3))
    inner = lining.area.reshape(len(theta), len(z))[1:-1, 1:-1]
    assert np.all(inner > 0.5 * np.outer(np.diff(theta)[1:], np.diff(z)[1:]).min())
    # Half as many elements as distances, for these have nodes in the middle of their sides.
    assert lining.surface.edges == pytest.approx((arc / np.radians(13) / 2, width / 7e-3 / 2), rel=0.16)


def test_elastic_modes_have_polar_shapes_on_the_lining_and_the_rigid_ones_the_inertia():
    """Nodes of two masses, and two modes that are polynomials of θ and z on the lining."""
    theta, z = np.linspace(-0.8, 0.8, 17), np.linspace(-0.02, 0.02, 5)
    angle, across = (each.ravel() for each in np.meshgrid(theta, z, indexing="ij"))
    shell = [np.stack([r * np.cos(angle), r * np.sin(angle), across], axis=1) for r in (0.1, 0.13)]
    nodes = np.concatenate(shell)
    each = np.repeat([0.3, 0.4], len(angle)) / len(angle)  # 0.7 kg, more of it on the lining
    rigid = rigid_motions(nodes).reshape(-1, 6)
    rigid = rigid @ np.linalg.inv(np.linalg.cholesky(rigid.T @ (np.repeat(each, 3)[:, None] * rigid))).T
    xi, zeta = angle / 0.8, across / 0.02
    fields = [(-2.0 * (1.5 * xi**2 - 0.5) - 1.5, 1.1 * xi, 0.4 * zeta), (3.0 * xi * zeta + 4.0 * xi**2, 0.3, -0.9 * xi)]
    shapes = [mode.reshape(-1, 3) for mode in rigid.T]
    for u_r, u_theta, u_z in fields:
        cosine, sine = np.cos(angle), np.sin(angle)
        cartesian = [u_r * cosine - u_theta * sine, u_r * sine + u_theta * cosine, u_z + 0 * angle]
        of_lining = np.stack(cartesian, axis=1)
        shapes.append(np.concatenate([-0.3 * of_lining, of_lining]))
    hertz = np.array([0, 0, 1e-3, 1e-3, 2e-3, 0.01, 900.0, 1500.0])
    results = ModalResults(nodes, hertz, np.stack(shapes))
    found = find_given_modes(results, 2e3)
    assert found.frequencies.tolist() == [900.0, 1500.0]
    for k, (field, sign) in enumerate(zip(fields, (-1, 1), strict=True)):
        for own, wanted in zip(found.coefficients[k], field, strict=True):
            np.testing.assert_allclose(legval2d(xi, zeta, own), sign * wanted + 0 * xi, atol=1e-9)
    np.testing.assert_allclose(found.shapes[0], -shapes[6])
    np.testing.assert_allclose(found.motion_at([nodes[3] + 1e-4])[0].T, [-shapes[6][3], shapes[7][3]])
    assert found.mass == pytest.approx(0.7, rel=1e-9)
    centre = each @ nodes / 0.7
    np.testing.assert_allclose(found.centre, centre, atol=1e-9)
    away = nodes - centre
    tensor = each @ np.sum(away**2, axis=1) * np.eye(3) - away.T @ (each[:, None] * away)
    np.testing.assert_allclose(np.sort(found.moments), np.linalg.eigvalsh(tensor), rtol=1e-8)
    assert find_given_modes(results, 1e3).frequencies.tolist() == [900.0]
