"""What the commands share: arguments and options, and how their values are read."""

import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from drumsqueal.coordinates import DRUM
from drumsqueal.errors import RequestError
from drumsqueal.scene import COORDINATES, load_scene, number_units, setting_choices, setting_keys
from drumsqueal.scene.file import find_scene, shipped_names
from drumsqueal.scene.quantities import QuantityError, SceneError, parse_quantity

# What the shell offers after a tab: scenes, the keys of --set, --along and --vary, and the words of other options.


SIGNALS = (
    *("displacement", "velocity", "acceleration"),
    *(f"{kind}_{name}" for kind in ("displacement", "velocity", "acceleration") for name in COORDINATES),
    *("surface_velocity", "surface_velocity_radial"),
    *(f"surface_velocity_{end}{along}" for end in ("leading", "trailing") for along in ("", "_along")),
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


def complete_files(*endings: str) -> Callable[[str], list[str]]:
    """What completes files with these endings, and the names of shipped scenes.

    Nothing where a folder begins so, too: the shell then goes on by itself, and knows better how to enter one.
    """

    def offered(incomplete: str) -> list[str]:
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

    return offered


def complete_name(incomplete: str) -> list[str]:
    """The names of shipped scenes."""
    return [name for name in shipped_names() if name.startswith(incomplete)]


def _complete_setting(incomplete: str) -> list[str]:
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
            # 9 that are offered: how many there are takes seconds to find
            known += tuple(f"{prefix}E{k + 1}" for k in range(9 * (elastic is not None)))
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


UsageError: type[typer.BadParameter] = typer.BadParameter.__mro__[1]  # any misuse; it has no public name of its own


def read_folder(text: str) -> Path:
    """A folder's name."""
    if not text:  # which would be the folder one is in
        raise typer.BadParameter("the name of the folder is empty")
    return Path(text)


def read_file(text: str) -> Path:
    """A file's name."""
    if not text:
        raise typer.BadParameter("the name of the file is empty")
    return Path(text)


def output_option(default: str) -> Any:
    """The option -o of a command whose results go to out/`default` without it."""
    text = f"Folder of the results (default: out/{default})."
    return typer.Option("-o", "--output", metavar="DIR", parser=read_folder, help=text)


def file_option(text: str) -> Any:
    """The option -o of a command that writes one file."""
    return typer.Option("-o", "--output", metavar="FILE", parser=read_file, help=text)


SceneFile = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE",
        parser=find_scene,
        help="Scene file (TOML), or the name of a shipped scene.",
        autocompletion=complete_files(".toml"),
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a value of the scene, e.g. drum.speed=3. Repeatable.",
        autocompletion=_complete_setting,
    ),
]
Since = Annotated[str | None, typer.Option("--from", metavar="TIME", help='Start of the part, e.g. "0.1 s".')]
Until = Annotated[str | None, typer.Option("--until", metavar="TIME", help='End of the part, e.g. "200 ms".')]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing results.")]
Resume = Annotated[bool, typer.Option("--resume", help="Continue a run that was interrupted.")]
Cluster = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="WHERE",
        help="Compute in several processes: local, or the address of a Dask scheduler, e.g. tcp://host:8786.",
        autocompletion=words("local"),
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only errors.")]
JsonFile = Annotated[
    str | None,
    typer.Option("--json", metavar="FILE", help="Write the result as JSON instead of printing; - for standard output."),
]


def check_resume(*, resume: bool, overwrite: bool) -> None:
    """Raise UsageError where both are asked for."""
    if resume and overwrite:
        raise UsageError("--resume continues what is there, --overwrite replaces it; leave one of them out")


def read_fraction(text: str, option: str) -> float:
    """A fraction between 0 and 1 from "1 %" or "0.01"."""
    wrong = f'{option} {text}: write a fraction between 0 and 100 %, such as "1 %" or 0.01'
    return _read(text, "", wrong, lambda fraction: 0 < fraction < 1)


def read_time(text: str | None, option: str) -> float | None:
    """A time (s) from "20 ms" or "0.02", which may lie before zero; None where it was not given."""
    return None if text is None else _read(text, "s", f'{option} {text}: write a time such as "0.1 s"', math.isfinite)


def read_duration(text: str, option: str) -> float:
    """A duration (s) from "20 ms" or "0.02"."""
    longest = 1000.0  # s, of what an option may ask to record or compute
    wrong = f'{option} {text}: write a time up to {longest:g} s, such as "5 s"'
    return _read(text, "s", wrong, lambda time: 0 < time <= longest)


def read_rate(text: str | None, option: str) -> float | None:
    """A rate (Hz), positive, from "20 kHz" or "20000"; None where it was not given."""
    wrong = f'{option} {text}: write a rate such as "20 kHz"'
    return None if text is None else _read(text, "Hz", wrong, lambda rate: 0 < rate < math.inf)


def _read(text: str, unit: str, wrong: str, fits: Callable[[float], bool]) -> float:
    """A number in an SI unit that fits; `wrong` is the message where the text is none."""
    try:
        value = float(text)
    except ValueError:
        try:
            value = parse_quantity(text, unit)
        except QuantityError as error:
            raise RequestError(f"{wrong} ({error.fault})") from None
    if not fits(value):
        raise RequestError(wrong)
    return value
