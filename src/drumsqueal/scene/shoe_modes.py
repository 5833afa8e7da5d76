"""The table of a shoe that is given by the modal results of the user's own code, and what follows from its file."""

import functools
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from drumsqueal.errors import RequestError
from drumsqueal.scene.mesh import CENTRED, SIZES, GivenByFile, off_the_middle
from drumsqueal.scene.quantities import KeyPath, SceneError

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
        if abs(surface.z0) > CENTRED * surface.width:
            raise SceneError(off_the_middle(surface), ("file",))
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
            nodes, away = nearest_nodes(results.nodes, _row(point))
            if away[0] > NEAR:
                nearest = ", ".join(f"{each:.6g}" for each in results.nodes[nodes[0]])
                reason = (
                    f"the nearest node of the modes is {1e3 * away[0]:.3g} mm away, at [{nearest}] m; take it, or "
                    f"export a node within {1e3 * NEAR:g} mm of the point"
                )
                raise SceneError(reason, path, point)

    def _content(self) -> tuple[Any, str]:
        """The results, `ModalResults`."""
        return _read(self.file, self.unit, self.mass_unit, self._status())


def _row(point: tuple[float, ...]) -> Any:
    import numpy as np

    return np.array([point])


@functools.lru_cache(maxsize=8)
def _read(file: str, unit: str, mass_unit: str, status: tuple[int, int]) -> tuple[Any, str]:
    """The results and the digest of their file, as of the time and the size that it then had."""
    del status
    from drumsqueal.physics.bodies.given_modes import read_modal_results  # where there are any, not with every start

    try:
        return read_modal_results(file, unit, mass_unit), hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except RequestError as error:
        raise SceneError(str(error), ("file",)) from None


def with_what_modes_give(shoe: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a shoe with the sizes that its modal results give, and numbers for what is not used with them.

    Raises SceneError.
    """
    if shoe.get("mesh") is not None:
        raise SceneError("a shoe is given by a mesh or by modes; leave out one of the two tables", ("modes",))
    elastic = shoe.get("elastic")
    if isinstance(elastic, Mapping):
        for key in UNUSED_ELASTIC:
            _check_left_out(elastic, key, UNUSED_ELASTIC[key], ("elastic", key))
        elastic = {**elastic, **UNUSED_ELASTIC}
    bends = {} if elastic is None else {"elastic": elastic}
    try:
        modes = ShoeModes.model_validate(shoe["modes"])
    except ValidationError:  # which is told of the table itself, and of no missing sizes
        return {**shoe, **bends, **UNUSED, **dict(zip(SIZES, (0.1, 0.01, 0.03, 1.0), strict=True))}
    try:
        modes = modes.checked()
        sizes = modes.sizes()
    except SceneError as error:
        raise error.under(("modes",)) from None
    given = {**UNUSED, **sizes}
    for key, value in given.items():
        _check_left_out(shoe, key, value, (key,))
    return {**shoe, **bends, **given, "modes": modes}


def _check_left_out(table: Mapping[str, Any], key: str, found: float, path: KeyPath) -> None:
    if table.get(key, found) != found:
        raise SceneError("the file of shoe.modes gives it; leave it out", path, table[key])
