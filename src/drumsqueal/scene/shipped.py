"""The shipped scenes: in a wheel among its files, in a clone in the folder next to src."""

import tomllib
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from drumsqueal.errors import nearest
from drumsqueal.scene.quantities import SceneError


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
