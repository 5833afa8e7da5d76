"""The tables of a shoe and of a drum that are given by solid meshes or modal results of the user's own.

What follows from their files is found here, too.
"""

import functools
import hashlib
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, ValidationError

from drumsqueal.errors import RequestError
from drumsqueal.scene.quantities import KeyPath, Quantity, Resolution, SceneError, Table

SIZES = ("outer_radius", "thickness", "width", "arc_angle")
"""Keys of a shoe that its mesh gives."""
CENTRED = 2e-3  # of its width: how far the middle of a lining may be from z = 0
MATCHED = 1e-3  # of radius and width: how far the surface of a drum may be from that of the lining
HELD = 3  # nodes of the clamped set at least

Name = Annotated[str, Field(strict=True, min_length=1, max_length=1000)]


class MeshMaterial(Table):
    """What a named set of elements is of."""

    set: Name
    """Name of the set of elements."""
    young: Annotated[float, Quantity("Pa", above=0)]
    """Young's modulus."""
    poisson: Annotated[float, Quantity("", least=0, most=0.49, usual="0.3")]
    """Poisson's ratio."""
    density: Annotated[float, Quantity("kg/m^3", above=0)]
    """Mass over volume."""


class GivenByFile(Table, ABC):
    """What a file of the user's own gives.

    `sha256` is that of the file's content, which is looked at where it is given.
    """

    file: Annotated[Name, AfterValidator(os.path.abspath)]
    """Its path, from the folder of the scene."""
    sha256: Name | None = None
    """Digest of the file's content; written by the program."""

    @abstractmethod
    def _content(self) -> tuple[Any, str]:
        """What is in the file, and the digest of its content; raises SceneError."""

    def read(self) -> Any:
        """What is in the file; raises SceneError."""
        return self._content()[0]

    def checked(self) -> Self:
        """The same with the digest of the file; raises SceneError where that is another than was given."""
        _, found = self._content()
        if self.sha256 not in (None, found):
            reason = "the content of the file is not what it was; leave sha256 out to take it as it is now"
            raise SceneError(reason, ("sha256",), self.sha256)
        return self.model_copy(update={"sha256": found})

    def _status(self) -> tuple[int, int]:
        """Time and size of the file, by which another content is noticed."""
        try:
            status = Path(self.file).stat()
        except OSError as error:
            reason = f"the file cannot be read ({error.strerror}); give its path from the folder of the scene"
            raise SceneError(reason, ("file",), self.file) from None
        return status.st_mtime_ns, status.st_size


class SolidMeshFile(GivenByFile, ABC):
    """A file of tetrahedra or hexahedra, the unit of its lengths, and materials of sets of its elements."""

    unit: Literal["m", "dm", "cm", "mm", "um", "in", "ft"]
    """Of the lengths in the file."""
    mass_unit: Literal["auto", "kg", "t"] = "auto"
    """Of point masses in the file; "auto" takes kg with m and t with mm."""
    material: tuple[MeshMaterial, ...] = ()
    """Materials of sets of elements."""

    def _content(self) -> tuple[Any, str]:
        """The mesh, a `SolidMesh`, and the digest of its file with those that it includes."""
        read = self.file, self.unit, self.mass_unit, self._status()
        if _read(*read)[2] != _statuses(_read(*read)[0].files):
            _read.cache_clear()
            _cylinder.cache_clear()
        return _read(*read)[:2]

    def checked(self) -> Self:
        """As of every file; raises SceneError also where it has no such sets."""
        sets = [each.set for each in self.material]
        for k, each in enumerate(self.material):
            if each.set in sets[:k]:
                raise SceneError("this set has two materials; leave one of them out", ("material", k, "set"), each.set)
            _named(self.read().elements_of, each.set, ("material", k, "set"))
        return super().checked()

    def cylinder(self, key: str, *, whole_circle: bool = False) -> Any:
        """The `CylinderSurface` of the faces that a key names; raises SceneError, also of one in a wrong unit."""
        self.read()
        find = functools.partial(_cylinder, self.file, self.unit, self.mass_unit, self._status(), whole_circle)
        surface = _named(find, getattr(self, key), (key,))
        radii = (3e-3, 5.0)  # m: ten times beyond what drum brakes have, lengths are in another unit
        if not radii[0] <= surface.radius <= radii[1]:
            size = f"the radius of the surface is then {surface.radius:.6g} m, and drum brakes have 0.03 to 0.5 m"
            raise SceneError(f"{size}; write the unit in which the file has its lengths", ("unit",), self.unit)
        return surface


class ShoeMesh(SolidMeshFile):
    """The mesh of a shoe, and the named set of faces that touches the drum.

    Elements in none of the materials' sets are of the shoe's own density and elasticity.
    """

    lining: Name
    """Name of the set of faces that touches the drum."""

    def sizes(self) -> dict[str, float]:
        """Radius, mean thickness, width (m) and arc angle (rad) of the lining and the shoe; raises SceneError."""
        surface = self.cylinder("lining")
        _check_centred(surface, ("lining",), self.lining)
        thickness = float(self.read().volumes.sum()) / (surface.radius * surface.arc * surface.width)
        return dict(zip(SIZES, (surface.radius, thickness, surface.width, surface.arc), strict=True))


class DrumMesh(SolidMeshFile):
    """The mesh of a drum: the named sets of the faces that the lining rubs on, and of what is clamped at the hub.

    Elements in none of the materials' sets are of `young`, `poisson` and `density`.
    """

    surface: Name
    """Name of the set of faces that the lining rubs on."""
    clamped: Name
    """Name of the set of nodes or faces that is clamped at the hub."""
    young: Annotated[float, Quantity("Pa", above=0)]
    """Young's modulus of elements in no set."""
    poisson: Annotated[float, Quantity("", least=0, most=0.49, usual="0.26")]
    """Poisson's ratio of these."""
    density: Annotated[float, Quantity("kg/m^3", above=0)]
    """Mass over volume of these."""
    up_to: Annotated[float | Literal["auto"], Resolution("Hz", above=0)] = "auto"
    """Up to which frequency motion is resolved; "auto" for as far as growth rates stay within 1 1/s or 1 %."""

    def check_fits(self, radius: float, width: float) -> None:
        """Raise SceneError unless linings of a radius (m), |z| ≤ width/2 (m), rub within the surface."""
        surface = self.cylinder("surface", whole_circle=True)
        if abs(surface.radius - radius) > MATCHED * radius:
            reason = (
                f"the surface has a radius of {surface.radius:.6g} m, and shoe.outer_radius is {radius:.6g} m; they "
                "must be equal: check drum.mesh.unit, or change one of them"
            )
            raise SceneError(reason, ("surface",), self.surface)
        if surface.width / 2 - abs(surface.z0) < (1 - MATCHED) * width / 2:
            low, high = (surface.z0 + side * surface.width / 2 for side in (-1, 1))
            reason = (
                f"the surface is at z = {low:.4g} to {high:.4g} m, and the lining at {-width / 2:.4g} to "
                f"{width / 2:.4g} m would reach beyond it; move the mesh along the drum's axis, or take a wider surface"
            )
            raise SceneError(reason, ("surface",), self.surface)

    def checked(self) -> Self:
        """As of every mesh; raises SceneError also of a wrong surface or hub."""
        found = super().checked()
        found.cylinder("surface", whole_circle=True)
        mesh = found.read()
        held = _named(mesh.nodes_of, found.clamped, ("clamped",))
        if len(held) < HELD:
            reason = f"fewer than {HELD} nodes do not hold the drum; name the faces of the hub, or all their nodes"
            raise SceneError(reason, ("clamped",), found.clamped)
        rubbed = (mesh.nodes_of_face(*each) for each in zip(*mesh.faces_of(found.surface), strict=True))
        if any(set(nodes.tolist()) <= set(held.tolist()) for nodes in rubbed):
            reason = f"faces of the surface {found.surface} are in it, and what the lining rubs on cannot be clamped"
            raise SceneError(f"{reason}; name the faces of the hub alone", ("clamped",), found.clamped)
        return found


def _check_centred(surface: Any, *place: Any) -> None:
    """Raise SceneError, for a path and the value there, unless a lining lies about z = 0."""
    if abs(surface.z0) > CENTRED * surface.width:
        move = "move the mesh along the drum's axis so that it is at z = 0"
        raise SceneError(f"the middle of the lining is at z = {surface.z0:.4g} m; {move}", *place)


def _named(find: Callable[[str], Any], name: str, path: KeyPath) -> Any:
    """What is found by the name of a set; raises SceneError with the way to the name."""
    try:
        return find(name)
    except RequestError as error:
        raise SceneError(str(error), path, name) from None


@functools.lru_cache(maxsize=8)
def _read(file: str, unit: str, mass_unit: str, status: tuple[int, int]) -> tuple[Any, str, tuple]:
    """The mesh, the digest of all that it was read from, and of when the files are."""
    del status
    from drumsqueal.physics.bodies.solid_mesh import read_solid_mesh  # where there is a mesh, and not with every start

    try:
        mesh = read_solid_mesh(file, unit, mass_unit)
    except RequestError as error:
        raise SceneError(str(error), ("file",)) from None
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in mesh.files))
    return mesh, digest.hexdigest(), _statuses(mesh.files)


def _statuses(files: tuple[Path, ...]) -> tuple:
    """Times and sizes of files, None of one that is no more."""
    found = (path.stat() if path.is_file() else None for path in files)
    return tuple(each and (each.st_mtime_ns, each.st_size) for each in found)


@functools.lru_cache(maxsize=8)
def _cylinder(file: str, unit: str, mass_unit: str, status: tuple[int, int], whole_circle: bool, name: str) -> Any:
    from drumsqueal.physics.bodies.lining_surface import find_surface

    return find_surface(_read(file, unit, mass_unit, status)[0], name, whole_circle=whole_circle)


# What the modes hold, and nothing is worked out from.
UNUSED = {"density": 1.0}
UNUSED_ELASTIC = {"young": 1.0, "poisson": 0.0}
FOUND = (*SIZES, *UNUSED, *(f"elastic.{key}" for key in UNUSED_ELASTIC))
"""Dotted keys of a shoe that its modal results give."""


class ShoeModes(GivenByFile):
    """A universal file or .npz with nodes, frequencies and shapes of the free shoe."""

    unit: Literal["auto", "m", "mm"] = "auto"
    """Of the lengths in the file; "auto" takes what the file states."""
    mass_unit: Literal["auto", "kg", "t"] = "auto"
    """Of masses; "auto" takes what the file states, and else kg with m and t with mm."""

    def sizes(self) -> dict[str, float]:
        """Radius, thickness, width (m) and arc angle (rad) of the lining and the shoe, which is as thick as it is deep.

        Raises SceneError.
        """
        from drumsqueal.physics.bodies.given_modes import depth_of, find_inertia, find_lining

        results = self.read()
        try:
            surface = find_lining(results.nodes).surface
            find_inertia(results)
        except RequestError as error:
            raise SceneError(str(error), ("file",)) from None
        _check_centred(surface, ("file",))
        depth = depth_of(results.nodes)
        return dict(zip(SIZES, (surface.radius, depth, surface.width, surface.arc), strict=True))

    def check_reaches(self, up_to: float, points: Sequence[tuple[KeyPath, tuple[float, ...]]]) -> None:
        """Raise SceneError where modes up to a frequency (Hz), or how they move a point (m), are not in the file."""
        from drumsqueal.physics.bodies.given_modes import NEAR, elastic_modes, nearest_nodes

        results = self.read()
        highest = max(results.frequencies[elastic_modes(results)], default=0.0)
        if up_to > 1.01 * highest:  # times the file's highest frequency, how far modes may be asked for
            reason = f"the modes in the file end at {highest:.4g} Hz; lower it to that, or export more modes"
            raise SceneError(reason, ("elastic", "up_to"), up_to)
        for path, point in points:
            nodes, away = nearest_nodes(results.nodes, np.array([point]))
            if away[0] > NEAR:
                nearest = ", ".join(f"{each:.6g}" for each in results.nodes[nodes[0]])
                reason = (
                    f"the nearest node of the modes is {1e3 * away[0]:.3g} mm away, at [{nearest}] m; take it, or "
                    f"export a node within {1e3 * NEAR:g} mm of the point"
                )
                raise SceneError(reason, path, point)

    def _content(self) -> tuple[Any, str]:
        """The results, `ModalResults`."""
        return _read_modes(self.file, self.unit, self.mass_unit, self._status())


@functools.lru_cache(maxsize=8)
def _read_modes(file: str, unit: str, mass_unit: str, status: tuple[int, int]) -> tuple[Any, str]:
    """The results and the digest of their file, as of the time and the size that it then had."""
    del status
    from drumsqueal.physics.bodies.given_modes import read_modal_results  # where there are any, not with every start

    try:
        return read_modal_results(file, unit, mass_unit), hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except RequestError as error:
        raise SceneError(str(error), ("file",)) from None


def with_what_its_file_gives(shoe: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a shoe with the sizes that its mesh or its modal results give, and numbers for what these leave out.

    Raises SceneError.
    """
    of_modes, elastic = shoe.get("modes") is not None, shoe.get("elastic")
    if of_modes and shoe.get("mesh") is not None:
        raise SceneError("a shoe is given by a mesh or by modes; leave out one of the two tables", ("modes",))
    unused: dict[str, float] = UNUSED if of_modes else {}
    of_file = "the file of shoe.modes gives it"
    if of_modes and isinstance(elastic, Mapping):
        for key, value in UNUSED_ELASTIC.items():
            _check_left_out(elastic, key, value, of_file, ("elastic", key))
        shoe = {**shoe, "elastic": {**elastic, **UNUSED_ELASTIC}}
    table, kind = ("modes", ShoeModes) if of_modes else ("mesh", ShoeMesh)
    try:
        file = kind.model_validate(shoe[table])
    except ValidationError:  # which is told of the table itself, and of no missing sizes
        return {**shoe, **unused, **dict(zip(SIZES, (0.1, 0.01, 0.03, 1.0), strict=True))}
    try:
        file = file.checked()
        given = {**unused, **file.sizes()}
    except SceneError as error:
        raise error.under((table,)) from None
    for key, value in given.items():
        giver = of_file if of_modes else f"the mesh of the shoe gives it, {value:.6g} in SI"
        _check_left_out(shoe, key, value, giver, (key,))
    return {**shoe, table: file, **given}


def _check_left_out(table: Mapping[str, Any], key: str, found: float, giver: str, path: KeyPath) -> None:
    if table.get(key, found) != found:
        raise SceneError(f"{giver}; leave it out", path, table[key])
