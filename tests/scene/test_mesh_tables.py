"""What the surfaces of meshes must be so that shoe and drum fit: to the last per mille, and said in one line."""

import hashlib
from types import SimpleNamespace
from typing import Any

import pytest

from drumsqueal.scene import SceneError
from drumsqueal.scene import mesh as module
from drumsqueal.scene.mesh import DrumMesh, ShoeMesh

MATERIAL: Any = {"young": 1e11, "poisson": 0.26, "density": 7200.0, "up_to": 5e3}
DRUM = DrumMesh.model_construct(file="d.inp", unit="mm", surface="RUB", clamped="HUB", **MATERIAL)
SHOE = ShoeMesh.model_construct(file="s.inp", unit="mm", lining="LINING")


def surface(monkeypatch, radius: float, width: float, z0: float, arc: float = 2.0) -> None:
    """Have the sets of faces be such a cylinder."""
    found = SimpleNamespace(radius=radius, width=width, z0=z0, arc=arc)
    monkeypatch.setattr(module, "_cylinder", lambda *_: found)
    monkeypatch.setattr(DrumMesh, "_status", lambda _: (0, 0))
    monkeypatch.setattr(ShoeMesh, "_status", lambda _: (0, 0))
    mesh = SimpleNamespace(volumes=SimpleNamespace(sum=lambda: 7e-5))
    monkeypatch.setattr(ShoeMesh, "read", lambda _: mesh)
    monkeypatch.setattr(DrumMesh, "read", lambda _: mesh)


def refusal(check) -> SceneError | None:
    try:
        check()
    except SceneError as error:
        return error
    return None


@pytest.mark.parametrize(
    ("radius", "width", "z0", "said"),
    [
        (0.1, 0.05, 0.0, None),
        (0.1, 0.05, 0.006, None),  # from −19 to 31 mm: the lining is 38 mm wide
        (0.1, 0.05, -0.006, None),
        (0.1, 0.05, 0.00601, None),  # by a thousandth of the lining less
        (0.1, 0.05, 0.00603, "at z = -0.01897 to 0.03103 m, and the lining at -0.019 to 0.019 m would reach beyond"),
        (0.1, 0.05, -0.00603, "at z = -0.03103 to 0.01897 m, and the lining at -0.019 to 0.019 m would reach beyond"),
        (0.10009, 0.05, 0.0, None),
        (0.09991, 0.05, 0.0, None),
        (0.10011, 0.05, 0.0, "has a radius of 0.10011 m, and shoe.outer_radius is 0.1 m"),
        (0.09989, 0.05, 0.0, "has a radius of 0.09989 m, and shoe.outer_radius is 0.1 m"),
    ],
)
def test_a_lining_rubs_within_the_surface_of_a_drum_of_its_radius(monkeypatch, radius, width, z0, said):
    surface(monkeypatch, radius, width, z0)
    found = refusal(lambda: DRUM.check_fits(0.1, 0.038))
    if said is None:
        assert found is None
    else:
        assert found is not None
        assert said in str(found)
        assert (found.path, found.value) == (("surface",), "RUB")


def test_a_shoes_sizes_are_those_of_its_lining_and_its_mean_thickness(monkeypatch):
    surface(monkeypatch, 0.11, 0.04, 7.9e-5, arc=1.9)
    found = SHOE.sizes()
    assert list(found) == ["outer_radius", "thickness", "width", "arc_angle"]
    assert list(found.values()) == pytest.approx([0.11, 7e-5 / (0.11 * 1.9 * 0.04), 0.04, 1.9], rel=1e-15)
    for z0 in (8.1e-5, -8.1e-5):  # two thousandths of the width are 80 µm
        surface(monkeypatch, 0.11, 0.04, z0)
        found = refusal(SHOE.sizes)
        assert found is not None
        assert f"the middle of the lining is at z = {z0:.4g} m" in str(found)
        assert (found.path, found.value) == (("lining",), "LINING")


@pytest.mark.parametrize(("radius", "fits"), [(2.9e-3, False), (3.1e-3, True), (4.9, True), (5.1, False)])
def test_a_radius_that_no_brake_has_is_one_in_another_unit(monkeypatch, radius, fits):
    surface(monkeypatch, radius, 0.04, 0.0)
    found = refusal(lambda: DRUM.cylinder("surface"))
    assert (found is None) is fits
    if found is not None:
        assert f"the radius of the surface is then {radius:.6g} m" in str(found)
        assert (found.path, found.value) == (("unit",), "mm")


def test_another_content_is_noticed_in_any_of_a_meshs_files(monkeypatch, tmp_path):
    """By its digest, and read anew where the time or the size of one of them is another."""
    files = tuple(tmp_path / name for name in ("a.inp", "b.inp"))
    for k, file in enumerate(files):
        file.write_text(f"content {k}")
    read = []

    def solid(*asked):
        read.append(asked)
        return SimpleNamespace(files=files)

    monkeypatch.setattr("drumsqueal.physics.bodies.solid_mesh.read_solid_mesh", solid)
    table = ShoeMesh.model_construct(file=str(files[0]), unit="mm", lining="LINING")
    module._read.cache_clear()
    try:
        digest = hashlib.sha256(b"content 0content 1").hexdigest()
        assert table.checked().sha256 == digest
        assert table.model_copy(update={"sha256": digest}).checked().sha256 == digest
        assert read == [(str(files[0]), "mm", "auto")]
        files[1].write_text("content two")
        with pytest.raises(SceneError, match="the content of the file is not what it was") as caught:
            table.model_copy(update={"sha256": digest}).checked()
        assert (caught.value.path, caught.value.value) == (("sha256",), digest)
        assert len(read) == 2
        files[0].unlink()
        with pytest.raises(SceneError, match=r"the file cannot be read \(No such file or directory\)") as caught:
            table.read()
        assert caught.value.path == ("file",)
    finally:
        module._read.cache_clear()
