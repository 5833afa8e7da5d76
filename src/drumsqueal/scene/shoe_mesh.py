"""The table of a shoe that is given as a solid mesh of the user's own, and what follows from its file."""

import functools
import hashlib
import os
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from drumsqueal.errors import RequestError
from drumsqueal.scene.quantities import SceneError
from drumsqueal.scene.readers import Quantity
from drumsqueal.scene.table import Table

SIZES = ("outer_radius", "thickness", "width", "arc_angle")
"""Keys of a shoe that its mesh gives."""
CENTRED = 2e-3  # of its width: how far the middle of a lining may be from z = 0

Name = Annotated[str, Field(strict=True, min_length=1, max_length=1000)]


class MeshMaterial(Table):
    """What a named set of elements is of: Young's modulus in Pa, Poisson's ratio and density in kg/m^3."""

    set: Name
    young: Annotated[float, Quantity("Pa", above=0)]
    poisson: Annotated[float, Quantity("", least=0, most=0.49, usual="0.3")]
    density: Annotated[float, Quantity("kg/m^3", above=0)]


class ShoeMesh(Table):
    """A file of tetrahedra or hexahedra, the unit of its lengths, and the named set of faces that touches the drum.

    Elements in none of the materials' sets are of the shoe's own density and elasticity. `sha256` is that of the file's
    content, which is looked at where it is given.
    """

    file: Annotated[Name, AfterValidator(os.path.abspath)]
    unit: Literal["m", "dm", "cm", "mm", "um", "in", "ft"]
    lining: Name
    material: tuple[MeshMaterial, ...] = ()
    sha256: Name | None = None

    def read(self) -> Any:
        """The mesh, a `SolidMesh`; raises SceneError."""
        return self._content()[0]

    def checked(self) -> "ShoeMesh":
        """The same with the digest of the file; raises SceneError where it is another than was given."""
        _, found = self._content()
        if self.sha256 not in (None, found):
            reason = "the content of the mesh file is not what it was; leave sha256 out to take it as it is now"
            raise SceneError(reason, ("sha256",), self.sha256)
        return self.model_copy(update={"sha256": found})

    def _content(self) -> tuple[Any, str]:
        """The mesh and the digest of its file."""
        try:
            status = Path(self.file).stat()
        except OSError as error:
            reason = f"the mesh cannot be read ({error.strerror}); give its path from the folder of the scene"
            raise SceneError(reason, ("file",), self.file) from None
        return _read(self.file, self.unit, (status.st_mtime_ns, status.st_size))

    def sizes(self) -> dict[str, float]:
        """Radius, mean thickness, width (m) and arc angle (rad) of the lining and the shoe; raises SceneError."""
        from drumsqueal.physics.bodies.lining_surface import find_surface

        mesh = self.read()
        try:
            surface = find_surface(mesh, self.lining)
        except RequestError as error:
            raise SceneError(str(error), ("lining",), self.lining) from None
        if abs(surface.z0) > CENTRED * surface.width:
            reason = (
                f"the middle of the lining is at z = {surface.z0:.4g} m; move the mesh along the drum's axis so that "
                "it is at z = 0"
            )
            raise SceneError(reason, ("lining",), self.lining)
        thickness = mesh.volume / (surface.radius * surface.arc * surface.width)
        return dict(zip(SIZES, (surface.radius, thickness, surface.width, surface.arc), strict=True))


@functools.lru_cache(maxsize=8)
def _read(file: str, unit: str, status: tuple[int, int]) -> tuple[Any, str]:
    """The mesh and the digest of its file, as of the time and the size that it then had."""
    del status
    from drumsqueal.physics.bodies.solid_mesh import read_solid_mesh  # where there is a mesh, and not with every start

    try:
        return read_solid_mesh(file, unit), hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except RequestError as error:
        raise SceneError(str(error), ("file",)) from None
