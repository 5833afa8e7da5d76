"""The scenes of the package: those that are shipped, and the brake of Seo & Kang (2023), which needs no file.

Shipped scenes are in a wheel among its files, in a clone in the folder next to src.
"""

import tomllib
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from drumsqueal.errors import nearest
from drumsqueal.scene.quantities import SceneError

if TYPE_CHECKING:
    from drumsqueal.scene import Scene


class Shipped(NamedTuple):
    """A scene of the package: its name, its file, its title, and in a sentence or two what it shows."""

    name: str
    path: Path
    title: str
    shows: str


def shipped_names() -> tuple[str, ...]:
    """The names of all shipped scenes, such as nominal."""
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


def shipped_path(name: str) -> Path:
    """The file of a shipped scene. Raises SceneError for a name that none has."""
    if name not in shipped_names():
        meant = nearest(name, shipped_names())
        message = f"did you mean {meant[0]}?" if meant else f"there are {', '.join(shipped_names())}"
        raise SceneError(f"no shipped scene has this name; {message}", (name,))
    return _folder() / f"{name}.toml"


def find_scene(text: str) -> Path:
    """A scene file by its path or, where there is none, a shipped scene by its name; a folder may bear it, too."""
    path = Path(text)
    if text not in shipped_names() or (path.exists() and not path.is_dir()):
        return path
    return shipped_path(text)


def written(path: Path) -> str:
    """How a command names the file of a scene: one that is shipped by its name, if that finds it."""
    return path.stem if path.parent == _folder() and find_scene(path.stem) == path else str(path)


def shipped_scenes() -> tuple[Shipped, ...]:
    """All shipped scenes; what one shows is the comment at the head of its file."""
    return tuple(_read(name) for name in shipped_names())


def _read(name: str) -> Shipped:
    path = shipped_path(name)
    text, head = path.read_text(encoding="utf-8"), list[str]()
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        head.append(line.removeprefix("#").strip())
    return Shipped(name, path, tomllib.loads(text)["title"], " ".join(head))


def _folder() -> Path:
    folder = "scenarios"
    installed = Path(str(files("drumsqueal"))) / folder
    return installed if installed.is_dir() else Path(__file__).parents[3] / folder


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


def seo_kang_brake(settings: Iterable[str] = ()) -> "Scene":
    """The brake of the paper, with a start and a duration for its transients; `settings` as in `load_scene`.

    Raises SceneError for settings that make no scene.
    """
    # Not above: reading a scene asks for the names of the shipped ones.
    from drumsqueal.scene import scene_from_dict
    from drumsqueal.scene.file import apply_setting

    tables = TABLE_1
    for setting in settings:
        tables = apply_setting(tables, setting)
    return scene_from_dict(tables)
