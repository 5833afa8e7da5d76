"""`drumsqueal animate HISTORY` and `drumsqueal animate SCENE --mode Y`."""

import math
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.errors import RequestError
from drumsqueal.files.claims import claim_folder, claim_results
from drumsqueal.files.output_folder import HISTORY, history_file
from drumsqueal.progress import Progress
from drumsqueal.scene import load_scene
from drumsqueal.scene.shipped import find_scene
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    Settings,
    Since,
    Until,
    UsageError,
    complete_mode,
    complete_source,
    read_file,
    read_time,
)
from drumsqueal.terminal.reply import Reply

AUTO = "auto"
SOURCE = "History or its folder; with --mode also a scene."
OUTPUT = "File, .gif or .mp4 (default: next to the history, or out/SCENE-MODE.gif)."
MODE = "Show this mode of a scene, or of a run's scene, such as Y."


def animate_command(
    source: Annotated[
        Path,
        typer.Argument(metavar="HISTORY|SCENE", help=SOURCE, show_default=False, autocompletion=complete_source),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", parser=read_file, help=OUTPUT)
    ] = None,
    mode: Annotated[str | None, typer.Option("--mode", metavar="MODE", help=MODE, autocompletion=complete_mode)] = None,
    since: Since = None,
    until: Until = None,
    slow: Annotated[
        str, typer.Option("--slow", metavar="FACTOR", help="How many times slower than real time; auto: in 6 s.")
    ] = AUTO,
    magnify: Annotated[
        str, typer.Option("--magnify", metavar="FACTOR", help="Magnify the displacement; auto: 30 % of the thickness.")
    ] = AUTO,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Animate shoe and drum in section: a history or a mode.

    Shows the last periods of a history, or one period of a mode. Displacement is magnified; colours along the arc show
    the pressure, lift-off, slip reversal and sticking.

    Example: drumsqueal animate scenarios/nominal.toml --mode Y
    """
    slowness, magnification = _factor(slow, "--slow"), _factor(magnify, "--magnify")
    for option, value in {"--from": since, "--until": until, "--magnify": magnification}.items():
        if mode is not None and value is not None:
            raise UsageError(f"{option} is for histories; a mode has neither a time nor a size of its own")
    # With --mode a folder is a run's, whose scene need not be the shipped one of that name.
    read = history_file(source) if mode is None or source.is_dir() else find_scene(str(source))
    recorded = mode is None or read.suffix == Path(HISTORY).suffix
    if recorded and settings:
        raise UsageError("--set changes a scene; a history is of the scene that was run: leave one of them out")
    if mode is None and source.suffix == ".toml":
        raise RequestError(f"{source} is a scene: name one of its modes with --mode, or give a history of a run of it")
    first, last = read_time(since, "--from"), read_time(until, "--until")
    file = output or _default_file(source, read, mode, recorded=recorded)
    loaded = None if recorded else load_scene(read, settings or ())
    if output is None and not recorded and not file.parent.exists():
        claim_folder(file.parent)  # `out`, which is made, and goes again where nothing comes of it
    reply = Reply.with_file(file, (read,), quiet, json_file, overwrite=overwrite)
    if recorded:
        claim_results(read.parent)
    from drumsqueal.files.history_file import read_history
    from drumsqueal.questions.animate.animation import Animation, check_animation_name, print_animation, save_animation
    from drumsqueal.questions.animate.playback import find_mode, play_history, play_mode
    from drumsqueal.simulation import prepare
    from drumsqueal.terminal.reply import answer_without_folder

    check_animation_name(file)

    def find(progress: Progress) -> Animation:
        saved = read_history(read) if loaded is None else None
        if saved is not None and mode is None:
            asked = {"start": first, "end": last, "slow": slowness, "magnification": magnification}
            shown = play_history(saved.data, saved.scene, **asked)
            return save_animation(shown, file, progress)
        if saved is not None and saved.given_law:
            why = "its friction law was given in Python and is not in the file, so that its modes are not known"
            raise RequestError(f"{read}: {why}; name a scene file")
        scene = loaded if saved is None else saved.scene
        assert scene is not None
        assert mode is not None
        stability = prepare(scene).stability
        return save_animation(play_mode(scene, stability, find_mode(stability, mode), slow=slowness), file, progress)

    answer_without_folder(reply, print_animation, find)


def _default_file(source: Path, read: Path, mode: str | None, *, recorded: bool) -> Path:
    """The default file: in the folder of the history, or in `out`."""
    if mode is None:
        return read.with_suffix(".gif")
    name = f"{mode.replace(' ', '').replace('/', '')}.gif"
    return read.with_name(f"mode-{name}") if recorded else Path("out") / f"{source.stem}-{name}"


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
