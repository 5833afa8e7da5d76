"""What the shell offers after a tab: scenes, the keys of --set, --along and --vary, and the words of other options."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import typer

from drumsqueal.coordinates import DRUM
from drumsqueal.scene import COORDINATES, load_scene, number_units, setting_choices, setting_keys
from drumsqueal.scene.quantities import SceneError
from drumsqueal.scene.shipped import find_scene, shipped_names

FREE_MODES = 9  # that are offered: how many there are takes seconds to find
SIGNALS = (
    *("displacement", "velocity", "acceleration"),
    *(f"{kind}_{name}" for kind in ("displacement", "velocity", "acceleration") for name in COORDINATES),
    "surface_velocity",
    "surface_velocity_radial",
    "surface_velocity_leading",
    "surface_velocity_leading_along",
    "surface_velocity_trailing",
    "surface_velocity_trailing_along",
    "brake_torque",
    "normal_force",
    "contact_fraction",
    "slip_reversed_fraction",
    "smallest_pressure",
    "friction_power",
    "sticking",
    "implicit",
    "kinetic_energy",
    "potential_energy",
    "energy_balance_error",
    "lining_temperature",
)
"""The signals that `export` knows, which to ask takes it seconds to load."""


def complete_scene(incomplete: str) -> list[str]:
    """Scene files that begin so, and the names of shipped scenes."""
    return _offered(incomplete, ".toml")


def complete_source(incomplete: str) -> list[str]:
    """Histories that begin so, scene files, and the names of shipped scenes."""
    return _offered(incomplete, ".nc", ".toml")


def _offered(incomplete: str, *endings: str) -> list[str]:
    """Files with these endings, and the names of shipped scenes.

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
    files = [f"{written}{path.name}" for path in found if path.suffix in endings]
    return files if slash else files + complete_name(start)


def complete_name(incomplete: str) -> list[str]:
    """The names of shipped scenes."""
    return [name for name in shipped_names() if name.startswith(incomplete)]


def complete_setting(incomplete: str) -> list[str]:
    """Every key that --set takes and, behind it, the words that it takes."""
    key, equals, word = incomplete.partition("=")
    if equals:
        return [f"{key}={choice}" for choice in setting_choices(key) if choice.startswith(word)]
    return [f"{key}=" for key in setting_keys() if key.startswith(incomplete)]


def complete_mode(ctx: typer.Context, incomplete: str) -> list[str]:
    """The names of modes: those of the rigid motion and, of a shoe or a drum that bends, the first of its own."""
    known = COORDINATES
    with suppress(SceneError):
        scene = load_scene(find_scene(str(ctx.params.get("source") or "")), ctx.params.get("settings") or ())
        known = tuple(f"{prefix}{name}" for prefix in scene.prefixes for name in COORDINATES)
        bends = [(prefix, shoe.elastic) for prefix, shoe in zip(scene.prefixes, scene.shoes, strict=True)]
        for prefix, elastic in (*bends, (DRUM, scene.elastic_table("drum")[1])):
            known += tuple(f"{prefix}E{k + 1}" for k in range(FREE_MODES * (elastic is not None)))
    return words(*known)(incomplete)


def words(*known: str) -> Callable[[str], list[str]]:
    """What completes one of these words."""
    return lambda incomplete: [word for word in known if word.startswith(incomplete)]


def complete_signals(incomplete: str) -> list[str]:
    """Signals for NAME,NAME..."""
    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in words(*SIGNALS)(last)]


def complete_range(ctx: typer.Context, incomplete: str) -> list[str]:
    """Every number of the scene, or of any while it is not known, for KEY=FROM..TO."""
    return [f"{key}=" for key in _numbers(ctx) if key.startswith(incomplete)]


def complete_list(ctx: typer.Context, incomplete: str) -> list[str]:
    """The same for KEY,KEY..."""
    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{key}" for key in _numbers(ctx) if key.startswith(last)]


def _numbers(ctx: typer.Context) -> tuple[str, ...]:
    # What stands before an option that still wants its value is not read yet.
    try:
        named = ctx.params.get("scene") or next((find_scene(word) for word in ctx.args if word[:1] != "-"), None)
        scene = load_scene(named or "", ctx.params.get("settings") or ())
    except SceneError:  # it is not named yet, or has mistakes
        return tuple(number_units())
    return tuple(key for key, value in scene.numbers().items() if isinstance(value, float))
