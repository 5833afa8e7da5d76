"""The command line: `drumsqueal run SCENE -o DIR`, and so `stability`, `effects` and `accuracy`.

What computes is imported inside the commands, once the scene has been read: JAX must find its environment prepared,
and a mistake in a scene is told at once.
"""

import sys
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console

from drumsqueal.compilation import prepare_environment
from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.output_folder import (
    ACCURACY_FILES,
    EFFECT_FILES,
    HISTORY,
    RESUME,
    RUN_FILES,
    check_output,
    claim_output,
)
from drumsqueal.quantities import parse_quantity, printable
from drumsqueal.scene import SceneError, load_scene

app = typer.Typer(add_completion=False, no_args_is_help=True, rich_markup_mode="rich", pretty_exceptions_enable=False)
FAILED, WRONG = 1, 2  # exit status
INTERRUPTED = "interrupted before anything was written"
UsageError: type[typer.BadParameter] = typer.BadParameter.__mro__[1]  # any misuse; it has no public name of its own


def _folder(text: str) -> Path:
    if not text:  # which would be the folder one is in
        raise typer.BadParameter("the name of the folder is empty")
    return Path(text)


def _output(default: str) -> Any:
    """The option -o of a command whose results go to out/`default` without it."""
    told = f"Folder of the results (default: out/{default})."
    return typer.Option("-o", "--output", metavar="DIR", parser=_folder, help=told)


SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).", show_default=False)]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Replace a value of the scene, e.g. drum.speed=3. Repeatable."),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace results that are there already.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with a run that was cut off.")]


@app.callback()
def _main() -> None:
    """Friction-induced vibration of a drum-brake shoe in time, beside the eigenvalues that predict it."""


@app.command(name="run")
def run_command(
    scene: SceneFile,
    output: Annotated[Path | None, _output("SCENE")] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    resume: Resume = False,
) -> None:
    """Predict, integrate, compare: writes DIR/history.nc, DIR/summary.json and figures (DIR is out/SCENE by default).

    Example: drumsqueal run scenarios/nominal.toml -o out/nominal --set drum.speed="48 rpm"
    """
    if resume and overwrite:
        raise UsageError("--resume goes on with what is there, --overwrite replaces it; leave one of them out")
    loaded = load_scene(scene, settings or ())
    # A file "...toml" is called "..", which would lead out of the folder out.
    folder = output if output is not None else Path("out") / (scene.stem if scene.stem.strip(".") else "scene")
    check_output(folder, RUN_FILES, overwrite=overwrite or resume)
    stop_if_interrupted()
    from drumsqueal.job import run_into
    from drumsqueal.resumption import find_point
    from drumsqueal.simulation import check_sample_rate, prepare

    stop_if_interrupted()
    since = find_point(folder, loaded) if resume else None
    prepared = prepare(loaded)
    check_sample_rate(prepared)
    stop_if_interrupted()
    claim_output(folder, RUN_FILES, but=(HISTORY, RESUME) if resume else ())
    run_into(folder, prepared, _console(), since)


@app.command(name="stability")
def stability_command(
    scene: SceneFile,
    settings: Settings = None,
    json_file: Annotated[
        str | None, typer.Option("--json", metavar="FILE", help="Write the result as JSON; - for standard output.")
    ] = None,
) -> None:
    """Find steady sliding, its eigenvalues and modes.

    Example: drumsqueal stability scenarios/nominal.toml --set drum.speed=2 --json -
    """
    loaded = load_scene(scene, settings or ())
    stop_if_interrupted()
    from drumsqueal.report import print_stability
    from drumsqueal.simulation import prepare
    from drumsqueal.summary import describe_stability, to_json

    stop_if_interrupted()
    stability = prepare(loaded).stability
    if json_file is None:
        print_stability(_console(), stability)
        return
    text = to_json(describe_stability(stability))
    if json_file == "-":
        sys.stdout.write(text)
        return
    try:
        Path(json_file).write_text(text, encoding="utf-8")
    except OSError as error:
        raise RequestError(f"--json {json_file}: cannot be written ({error.strerror or error})") from None


@app.command(name="effects", context_settings={"allow_extra_args": True})
def effects_command(
    context: typer.Context,
    scene: SceneFile,
    output: Annotated[Path | None, _output("SCENE-effects")] = None,
    within: Annotated[
        str, typer.Option("--within", metavar="SHARE", help="Accuracy that decides what is needed, such as 1 %.")
    ] = "1 %",
    settings: Settings = None,
    overwrite: Overwrite = False,
) -> None:
    """Leave out each effect of a scene: what does it cost, what does it change, which are needed?

    Writes effects.csv, effects.png and reduced.toml, the scene with what it needs, into DIR.

    Example: drumsqueal effects scenarios/nominal.toml -o out/effects --within 2%
    """
    if context.args == ["%"] and "%" not in within:  # what the shell makes of --within 1 %
        within = f"{within} %"
    elif context.args:
        raise UsageError(f"Got unexpected extra argument ({context.args[0]})")
    loaded = load_scene(scene, settings or ())
    accuracy = _share(within, "--within")
    folder = output if output is not None else Path("out") / f"{scene.stem}-effects"
    check_output(folder, EFFECT_FILES, overwrite=overwrite)
    stop_if_interrupted()
    from drumsqueal.effects_job import study_into
    from drumsqueal.simulation import check_sample_rate, prepare

    stop_if_interrupted()
    check_sample_rate(prepare(loaded))  # a scene that cannot be run is told before there is a folder
    claim_output(folder, EFFECT_FILES)
    study_into(folder, loaded, accuracy, _console())


@app.command(name="accuracy")
def accuracy_command(
    scene: SceneFile,
    output: Annotated[Path | None, _output("SCENE-accuracy")] = None,
    target: Annotated[
        str,
        typer.Option("--target", metavar="SHARE", help='Relative accuracy that is asked for, such as 1e-4 or "1 %".'),
    ] = "1e-4",
    settings: Settings = None,
    overwrite: Overwrite = False,
) -> None:
    """How wrong is a scene's transient, and what would ten times better cost?

    Runs methods, tolerances and quadratures against an independent reference. Writes accuracy.csv, three figures and
    simulate.toml, the cheapest settings that meet the target, into DIR.

    Example: drumsqueal accuracy scenarios/nominal.toml -o out/accuracy --target 1e-5
    """
    loaded = load_scene(scene, settings or ())
    wanted = _share(target, "--target")
    folder = output if output is not None else Path("out") / f"{scene.stem}-accuracy"
    check_output(folder, ACCURACY_FILES, overwrite=overwrite)
    stop_if_interrupted()
    from drumsqueal.accuracy_job import study_into
    from drumsqueal.simulation import check_sample_rate, prepare
    from drumsqueal.studies.accuracy import check_motion

    stop_if_interrupted()
    check_motion(loaded)
    check_sample_rate(prepare(loaded))
    claim_output(folder, ACCURACY_FILES)
    study_into(folder, loaded, wanted, _console())


def _share(text: str, option: str) -> float:
    """A share between 0 and 1 from "1 %" or "0.01"."""
    try:
        share = parse_quantity(text if "%" in text else float(text), "")
    except ValueError:  # of which SceneError is one
        share = 0.0
    if not 0 < share < 1:
        raise RequestError(f'{option} {text}: write a share between 0 and 100 %, such as "1 %" or 0.01')
    return share


def _console(*, stderr: bool = False) -> Console:
    """A console that shows text as it is: what users write is neither markup nor the name of an emoji."""
    return Console(stderr=stderr, highlight=False, markup=False, emoji=False)


def _one_line(message: str) -> str:
    return printable(" ".join(message.split()))


def main() -> None:
    """Run the command line and turn every error into one line and an exit status."""
    prepare_environment()
    try:
        # Not app(): that would turn Ctrl-C into a return value, which looks like success.
        command = typer.main.get_command(app)
        with command.make_context("drumsqueal", sys.argv[1:]) as context:
            command.invoke(context)
    except typer.Exit as done:  # after --help
        sys.exit(done.exit_code)
    except (SceneError, RequestError) as error:
        _give_up(str(error), WRONG)
    except UsageError as error:
        message = error.format_message()
        _give_up(message and f"{message} (see drumsqueal --help)", WRONG)
    except KeyboardInterrupt:
        _give_up(INTERRUPTED, FAILED)
    except (IntegrationError, OSError) as error:
        _give_up(str(error), FAILED)
    except Exception as error:
        _give_up(f"failed unexpectedly, {type(error).__name__}: {error}", FAILED)


def _give_up(message: str, status: int) -> NoReturn:
    if message:
        _console(stderr=True).print(f"drumsqueal: {_one_line(message)}", soft_wrap=True)
    sys.exit(status)
