"""The brake of Seo & Kang (2023) as a scene of the package: it is there without the example files."""

from collections.abc import Iterable
from typing import Any

from drumsqueal.scene import Scene, scene_from_dict
from drumsqueal.scene.file import apply_setting

TABLE_1: dict[str, Any] = {
    "title": "Seo & Kang 2023",
    "shoe": {
        "outer_radius": "100 mm",
        "thickness": "20 mm",
        "width": "36.5 mm",
        "arc_angle": "130 deg",
        "density": "7820 kg/m^3",
    },
    "support": {"upper_stiffness": "1e8 N/m", "lower_stiffness": "6e8 N/m"},
    "contact": {"stiffness": "0.35e11 N/m^3", "normal_load": "2000 N"},
    "friction": {"law": "exponential", "static": 0.5, "kinetic": 0.3, "decay": "1 s/m"},
    "drum": {"speed": "5 rad/s"},
    # Not in the table: a small perturbation of all three modes of the plane, and time for it to grow and settle.
    "start": {"displacement": {"Y": "1e-7 m", "Tz": "1e-6 rad"}},
    "simulate": {"duration": "0.4 s", "sample_rate": "50 kHz"},
}
"""Table 1, and the friction curve of Figure 4, of Seo & Kang, Lubricants 2023, 11(12), 496."""


def seo_kang_brake(settings: Iterable[str] = ()) -> Scene:
    """The brake of the paper, with a start and a duration for its transients; `settings` as in `load_scene`.

    Raises SceneError for settings that make no scene.
    """
    tables = TABLE_1
    for setting in settings:
        tables = apply_setting(tables, setting)
    return scene_from_dict(tables)
