"""What the commands share: arguments, options, and the console they print to."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from drumsqueal.errors import RequestError
from drumsqueal.scene.quantities import parse_quantity

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
    told = f"Folder of the results (default: out/{default})."
    return typer.Option("-o", "--output", metavar="DIR", parser=read_folder, help=told)


SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).", show_default=False)]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Replace a value of the scene, e.g. drum.speed=3. Repeatable."),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace results that are there already.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with a run that was cut off.")]


def read_share(text: str, option: str) -> float:
    """A share between 0 and 1 from "1 %" or "0.01"."""
    try:
        share = parse_quantity(text if "%" in text else float(text), "")
    except ValueError:  # of which SceneError is one
        share = 0.0
    if not 0 < share < 1:
        raise RequestError(f'{option} {text}: write a share between 0 and 100 %, such as "1 %" or 0.01')
    return share


def read_time(text: str, option: str) -> float:
    """A time (s), not negative, from "20 ms" or "0.02"."""
    try:
        time = float(parse_quantity(text if text.strip()[-1:].isalpha() else float(text), "s"))
    except ValueError:  # of which SceneError is one
        time = -1.0
    if not time >= 0:
        raise RequestError(f'{option} {text}: write a time such as "20 ms", or a number in s')
    return time


def make_console(*, stderr: bool = False) -> Console:
    """A console that shows text as it is: what users write is neither markup nor the name of an emoji."""
    return Console(stderr=stderr, highlight=False, markup=False, emoji=False)
