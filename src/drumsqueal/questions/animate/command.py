"""`drumsqueal animate HISTORY` and `drumsqueal animate SCENE --mode Y`."""

import math
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.errors import RequestError
from drumsqueal.files.claims import claim_folder, claim_results
from drumsqueal.files.output_folder import HISTORY, history_file
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.scene import COORDINATES, load_scene
from drumsqueal.scene.shipped import find_scene
from drumsqueal.terminal.completion import complete_source, words
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    Settings,
    Since,
    Until,
    UsageError,
    read_file,
    read_time,
)
from drumsqueal.terminal.reply import Reply

AUTO = "auto"
SCENE_AS_RUN = "--set changes a scene; a history is of the scene that was run: leave one of them out"


def animate_command(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="HISTORY|SCENE",
            help="History or its folder; with --mode also a scene.",
            show_default=False,
            autocompletion=complete_source,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            parser=read_file,
            help="File, .gif or .mp4 (default: beside the history, or out/SCENE-MODE.gif).",
        ),
    ] = None,
    mode: Annotated[
        str | None,
        typer.Option(
            "--mode",
            metavar="MODE",
            help="Show this mode of a scene, or of a run's scene, such as Y.",
            autocompletion=words(*COORDINATES),
        ),
    ] = None,
    since: Since = None,
    until: Until = None,
    slow: Annotated[
        str, typer.Option("--slow", metavar="FACTOR", help="How many times slower than it was; auto: in 6 s.")
    ] = AUTO,
    magnify: Annotated[
        str, typer.Option("--magnify", metavar="FACTOR", help="Magnify the displacement; auto: 30 % of the thickness.")
    ] = AUTO,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Shoe and drum in section, moving slowly: a history or a mode.

    Shows the last periods of a history, or one period of a mode. Displacement is magnified; colours along the arc tell
    the pressure, and what lifts off, slips backwards or sticks.

    Example: drumsqueal animate scenarios/nominal.toml --mode Y
    """
    slowness, magnification = _factor(slow, "--slow"), _factor(magnify, "--magnify")
    if mode is not None:
        _refuse_with_mode({"--from": since, "--until": until, "--magnify": None if magnify == AUTO else magnify})
        _animate_mode(source, mode, settings or [], output, slowness, overwrite, quiet, json_file)
        return
    if settings:
        raise UsageError(SCENE_AS_RUN)
    if source.suffix == ".toml":
        raise RequestError(f"{source} is a scene: name one of its modes with --mode, or give a history that it left")
    first, last = read_time(since, "--from"), read_time(until, "--until")
    history = history_file(source)
    file = output or history.with_suffix(".gif")
    reply = Reply.with_file(file, (history,), quiet, json_file, overwrite=overwrite)
    claim_results(history.parent)
    stop_if_interrupted()
    from drumsqueal.files.saved_history import read_history
    from drumsqueal.questions.animate.file import check_animation_name
    from drumsqueal.questions.animate.job import animate_history

    stop_if_interrupted()
    check_animation_name(file)
    saved = read_history(source)
    stop_if_interrupted()
    reply.send(animate_history(file, saved, first, last, slowness, magnification, reply.console))


def _animate_mode(
    source: Path,
    mode: str,
    settings: list[str],
    output: Path | None,
    slowness: float | None,
    overwrite: bool,
    quiet: bool,
    json_file: str | None,
) -> None:
    """Animate a mode of a scene file or, where the source is a history or its folder, of the scene that was run."""
    file_name = f"{mode.replace(' ', '').replace('/', '')}.gif"
    # A folder here is a run's, whose scene need not be the shipped one of that name.
    read = history_file(source) if source.is_dir() else find_scene(str(source))
    if read.suffix == Path(HISTORY).suffix:
        if settings:
            raise UsageError(SCENE_AS_RUN)
        stop_if_interrupted()
        from drumsqueal.files.saved_history import read_history

        claim_results(read.parent)
        saved = read_history(read)
        if saved.given_law:
            told = "its friction law was given in Python and is not in it, so that its modes are not known"
            raise RequestError(f"{read}: {told}; name a scene file")
        scene, file = saved.scene, output or read.with_name(f"mode-{file_name}")
    else:
        scene, file = load_scene(read, settings), output or Path("out") / f"{source.stem}-{file_name}"
    if output is None and not file.parent.exists():
        claim_folder(file.parent)  # `out`, which is made, and goes again where nothing comes of it
    reply = Reply.with_file(file, (read,), quiet, json_file, overwrite=overwrite)
    stop_if_interrupted()
    from drumsqueal.questions.animate.file import check_animation_name
    from drumsqueal.questions.animate.job import animate_mode

    check_animation_name(file)
    reply.send(animate_mode(file, scene, mode, slowness, reply.console))


def _factor(text: str, option: str) -> float | None:
    """A positive number, None for "auto"."""
    if text == AUTO:
        return None
    try:
        factor = float(text)
    except ValueError:
        factor = 0.0
    if not (factor > 0 and math.isfinite(factor)):
        raise RequestError(f"{option} {text}: write auto, or a positive number such as 1000")
    return factor


def _refuse_with_mode(given: dict[str, str | None]) -> None:
    for option, value in given.items():
        if value is not None:
            raise UsageError(f"{option} is for histories; a mode has neither a time nor a size of its own")
