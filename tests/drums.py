"""A drum that bends for the paper's shoe, and brakes with several such shoes."""

from collections.abc import Mapping
from typing import Any

from drumsqueal.scene import Scene, scene_from_dict

CUP = {
    "thickness": 0.012,
    "width": 0.06,
    "back_plate": 0.008,
    "hub_radius": 0.05,
    "young": 120e9,
    "poisson": 0.26,
    "density": 7200.0,
}
"""A drum of cast iron, but for up to which frequency its modes are kept."""


def several(nominal: Scene, places: Mapping[str, float], cup: Mapping[str, Any] | None = None, **tables: Any) -> Scene:
    """The paper's brake with a shoe at each of these places (rad) by its name, the first of them started.

    `arc_angle` is of all shoes; other tables take the place of the paper's.
    """
    data = nominal.model_dump(exclude_none=True)
    shoe, drum = data.pop("shoe"), data["drum"] | ({} if cup is None else {"elastic": cup})
    shoe["arc_angle"] = tables.pop("arc_angle", shoe["arc_angle"])
    shoes = [{**shoe, "name": name, "position": place} for name, place in places.items()]
    start = {"velocity": {f"{next(iter(places))}.Y": 1e-3}}
    return scene_from_dict({**data, "shoe": shoes, "drum": drum, "start": start, **tables})
