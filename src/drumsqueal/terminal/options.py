"""What the commands share: arguments and options, and how their values are read."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from drumsqueal.errors import RequestError
from drumsqueal.scene.quantities import QuantityError, parse_quantity
from drumsqueal.scene.shipped import find_scene
from drumsqueal.terminal.completion import complete_scene, complete_setting, words

UsageError: type[typer.BadParameter] = typer.BadParameter.__mro__[1]  # any misuse; it has no public name of its own
LONGEST = 1000.0  # s, of what an option may ask to record or compute


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


SceneFile = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE",
        parser=find_scene,
        help="Scene file (TOML), or the name of a shipped scene.",
        show_default=False,
        autocompletion=complete_scene,
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a value of the scene, e.g. drum.speed=3. Repeatable.",
        autocompletion=complete_setting,
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
    wrong = f'{option} {text}: write a time up to {LONGEST:g} s, such as "5 s"'
    return _read(text, "s", wrong, lambda time: 0 < time <= LONGEST)


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
