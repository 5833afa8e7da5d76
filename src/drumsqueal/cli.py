"""The command line: `drumsqueal run SCENE -o DIR`, `drumsqueal stability SCENE`.

What computes is imported inside the commands, once the scene has been read: JAX must find its environment prepared,
and a mistake in a scene is told at once.
"""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from drumsqueal.compilation import prepare_environment
from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.output_folder import check_output, claim_output
from drumsqueal.scene import SceneError, load_scene

app = typer.Typer(add_completion=False, no_args_is_help=True, rich_markup_mode="rich", pretty_exceptions_enable=False)
FAILED, WRONG = 1, 2  # exit status
UsageError: type[typer.BadParameter] = typer.BadParameter.__mro__[1]  # any misuse; it has no public name of its own

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).", show_default=False)]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Replace a value of the scene, e.g. drum.speed=3. Repeatable."),
]


@app.callback()
def _main() -> None:
    """Friction-induced vibration of a drum-brake shoe in time, beside the eigenvalues that predict it."""


@app.command(name="run")
def run_command(
    scene: SceneFile,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="DIR", help="Folder of the results.")] = None,
    settings: Settings = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace results that are there already.")] = False,
) -> None:
    """Predict, integrate, compare: writes DIR/history.nc, DIR/summary.json and figures (DIR is out/SCENE by default).

    Example: drumsqueal run scenarios/nominal.toml -o out/nominal --set drum.speed="48 rpm"
    """
    loaded = load_scene(scene, settings or ())
    folder = output if output is not None else Path("out") / scene.stem
    check_output(folder, overwrite=overwrite)
    from drumsqueal.job import run_into
    from drumsqueal.simulation import check_sample_rate, prepare

    prepared = prepare(loaded)
    check_sample_rate(prepared)
    claim_output(folder)
    run_into(folder, prepared, Console(highlight=False))


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
    from drumsqueal.report import print_stability
    from drumsqueal.simulation import prepare
    from drumsqueal.summary import describe_stability, to_json

    stability = prepare(loaded).stability
    if json_file is None:
        print_stability(Console(highlight=False), stability)
        return
    text = to_json(describe_stability(stability))
    if json_file == "-":
        sys.stdout.write(text)
        return
    try:
        Path(json_file).write_text(text, encoding="utf-8")
    except OSError as error:
        raise RequestError(f"--json {json_file}: cannot be written ({error.strerror or error})") from None


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())


def main() -> None:
    """Run the command line and turn every error into one line and an exit status."""
    errors = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    prepare_environment()
    try:
        app(standalone_mode=False)
    except (SceneError, RequestError) as error:
        errors.print(f"drumsqueal: {_one_line(error)}")
        sys.exit(WRONG)
    except UsageError as error:
        message = error.format_message()
        if message:
            errors.print(f"drumsqueal: {_one_line(ValueError(message))} (see drumsqueal --help)")
        sys.exit(WRONG)
    except (IntegrationError, OSError) as error:
        errors.print(f"drumsqueal: {_one_line(error)}")
        sys.exit(FAILED)
    except (KeyboardInterrupt, typer.Abort):
        errors.print("drumsqueal: interrupted before anything was computed")
        sys.exit(FAILED)
