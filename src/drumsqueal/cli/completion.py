"""What the shell offers after a tab: scenes, and the keys of --set, --along and --vary."""

from pathlib import Path

import typer

from drumsqueal.scene import load_scene, number_keys, setting_keys
from drumsqueal.scene.quantities import SceneError
from drumsqueal.scene.shipped import find_scene, shipped_names


def complete_scene(incomplete: str) -> list[str]:
    """Scene files that begin so, and the names of shipped scenes.

    Nothing where a folder begins so, too: the shell then goes on by itself, and knows better how to enter one.
    """
    written, slash, start = incomplete.rpartition("/")
    written += slash
    try:
        found = [path for path in sorted(Path(written or ".").iterdir()) if path.name.startswith(start)]
    except (OSError, ValueError):
        return []
    if start and any(path.is_dir() for path in found):
        return []
    files = [f"{written}{path.name}" for path in found if path.suffix == ".toml"]
    return files if slash else files + complete_name(start)


def complete_name(incomplete: str) -> list[str]:
    """The names of shipped scenes."""
    return [name for name in shipped_names() if name.startswith(incomplete)]


def complete_setting(incomplete: str) -> list[str]:
    """Every key that --set takes."""
    return [f"{key}=" for key in setting_keys() if key.startswith(incomplete)]


def complete_range(ctx: typer.Context, incomplete: str) -> list[str]:
    """Every number of the scene, or of any while it is not known, for KEY=FROM..TO."""
    return [f"{key}=" for key in _numbers(ctx) if key.startswith(incomplete)]


def complete_list(ctx: typer.Context, incomplete: str) -> list[str]:
    """The same for KEY,KEY..."""
    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{key}" for key in _numbers(ctx) if key.startswith(last)]


def _numbers(ctx: typer.Context) -> tuple[str, ...]:
    # What stands before an option that still wants its value is not read yet.
    named = ctx.params.get("scene") or next((find_scene(word) for word in ctx.args if word[:1] != "-"), None)
    try:
        scene = load_scene(named or "", ctx.params.get("settings") or ())
    except SceneError:  # it is not named yet, or has mistakes
        return number_keys()
    return tuple(key for key, value in scene.numbers().items() if isinstance(value, float))
