"""The command line: `drumsqueal run SCENE -o DIR` and the other commands, by the panels of the help.

What computes is imported inside the commands, once the scene has been read: JAX must find its environment prepared,
and a mistake in a scene is reported at once.
"""

import errno
import functools
import inspect
import os
import sys
import traceback
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, NoReturn, TextIO, cast

import typer
from rich.markup import escape

from drumsqueal.compilation import check_address_space, hidden_from_xarray, note_unkept_programs, prepare_environment
from drumsqueal.errors import IntegrationError, NothingToDoError, RequestError
from drumsqueal.files import output_folder as files
from drumsqueal.files.claims import claims_released, command_name
from drumsqueal.files.output_folder import UnwrittenError
from drumsqueal.questions.commands import onset, results, simulate
from drumsqueal.scene import Scene, load_scene
from drumsqueal.scene.quantities import SceneError, printable
from drumsqueal.scene.shoes import OWN, key_of_one
from drumsqueal.terminal.options import UsageError
from drumsqueal.terminal.reply import clear_notice, make_console


def take_each(name: str, command: Callable[..., None], values: Mapping[str, Any]) -> None:
    """Call a command, once for each shoe where those are problems of their own, with folders of theirs.

    Keys and folders of all shoes are looked at before the first. Raises RequestError also for results of several shoes
    in one JSON file, and SceneError of a wrong scene.
    """
    scene = values.get("scene")
    if not isinstance(scene, Path) or "settings" not in values:
        command(**values)
        return
    settings = values["settings"] or []
    loaded = load_scene(scene, settings)
    if not loaded.several or loaded.elastic_table("drum")[1] is not None:
        command(**values)
        return
    if values.get("json_file") is not None:
        choices = " or ".join(f"--set shoe={each}" for each in loaded.shoe_names)
        raise RequestError(f"--json: the drum does not bend, so each shoe has results of its own; add {choices}")
    _check_keys(loaded, values)
    folder = values.get("output") or files.folder_of(name, scene.stem)
    folders = {shoe: folder / shoe for shoe in loaded.shoe_names}
    there = [shoe for shoe in folders if folders[shoe].exists()]
    resume = bool(values.get("resume"))
    written = "branch" if name == "cycle" and values.get("along") else name
    for each in folders.values() if "output" in values else ():
        files.check_output(each, files.files_of(written, each), overwrite=resume or bool(values.get("overwrite")))
    console = make_console(quiet=bool(values.get("quiet")))
    alone = "The drum does not bend, so the shoes do not feel each other: each is a problem of its own."
    console.print(alone, soft_wrap=True)
    complete = []
    for shoe, own in folders.items():
        console.print(f"\n{shoe} shoe", style="bold")
        changed: dict[str, Any] = {"settings": [*settings, f"shoe={shoe}"]}
        changed |= {"output": own} if "output" in values else {}
        changed |= {"resume": shoe in there or not there} if resume else {}  # one may not have begun
        try:
            command(**{**values, **changed})
        except NothingToDoError as error:
            complete.append(error)
            if len(complete) == len(folders):
                raise
            console.print(printable(f"Passed over: {error}"), soft_wrap=True)


def _check_keys(scene: Scene, values: Mapping[str, Any]) -> None:
    """Raise RequestError for ranges of a number that is not the same one for all shoes."""
    ranges = ("vary", "along")  # arguments that begin with a key of the scene
    for option in ranges:
        given = values.get(option) or ()
        for text in (given,) if isinstance(given, str) else given:
            for key in text.partition("=")[0].split(","):
                for k, name in enumerate(scene.shoe_names):
                    _check_key(scene, f"--{option} {text}", key.strip(), k, name)


def _check_key(scene: Scene, where: str, key: str, k: int, name: str) -> None:
    """The same for one shoe, whose own numbers are asked for of that shoe alone."""
    alone = key_of_one(key, k, name)
    if alone != key:
        reason = f"this is of the {name} shoe, and with a drum that does not bend each shoe is a problem of its own"
        raise RequestError(f"{where}: {reason}; take it by --set shoe={name}, and write {alone}=...")
    if key.partition(".")[0] in OWN and scene.key_of(k, key) != key:
        one_by_one = " or ".join(f"--set shoe={each}" for each in scene.shoe_names)
        raise RequestError(f"{where}: the {name} shoe has its own, {scene.key_of(k, key)}; take one, by {one_by_one}")


app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich", pretty_exceptions_enable=False)
FAILED, WRONG = 1, 2  # exit status
DEBUG = "--debug"  # the first argument, which is there also where the others cannot be read
_UNNAMED = {
    errno.ENOSPC: "standard output: {}",
    errno.EBADF: "standard output is closed; open it, or print nothing with --quiet",
    errno.ENOENT: "the folder that the command was started in: {}",
}
"""What an error of the system means that names no file."""
COMPLETION = "_DRUMSQUEAL_COMPLETE"  # set by the shell where it asks what could come next
GROUPS: dict[str, dict[str, Callable[..., None]]] = {
    "Simulate": {
        "scenes": simulate.scenes_command,
        "check": simulate.check_command,
        "run": simulate.run_command,
        "motion": simulate.motion_command,
    },
    "Onset of squeal": {
        "stability": onset.stability_command,
        "onset": onset.onset_command,
        "cycle": onset.cycle_command,
        "sweep": onset.sweep_command,
        "matrix": onset.matrix_command,
        "sensitivity": onset.sensitivity_command,
        "paper": onset.paper_command,
    },
    "Quality": {"effects": simulate.effects_command, "accuracy": simulate.accuracy_command},
    "Report, view, listen, export, compare with measurements": {
        "report": results.report_command,
        "animate": results.animate_command,
        "export": results.export_command,
        "compare": results.compare_command,
        "fit": results.fit_command,
    },
}
"""The commands in the order of the help, by the panel they stand in."""


def _naming_the_scene(name: str, command: Callable[..., None]) -> Callable[..., None]:
    """The command, once for each problem of a scene, naming the file where it turns out to be wrong after reading."""

    @functools.wraps(command)
    def named(**values: Any) -> None:
        if command is not simulate.scenes_command:  # which does without JAX
            check_address_space()
            note_unkept_programs()
        try:
            with_dask = command in (onset.sweep_command, onset.matrix_command)
            with nullcontext() if with_dask else hidden_from_xarray():
                take_each(name, command, values)
        except SceneError as error:
            file = values.get("scene", values.get("source"))
            if file is None or (error.path and error.path[0] not in Scene.model_fields):
                raise
            raise SceneError(str(error), (f"{file} with --set" if values["settings"] else str(file),)) from None

    return named


def help_text(command: Callable[..., None]) -> str:
    """The docstring of a command as its help: paragraphs without the line breaks of the source, an example by itself.

    Brackets are text, not markup.
    """
    paragraphs = inspect.cleandoc(command.__doc__ or "").split("\n\n")
    joined = (" ".join(paragraph.split()) for paragraph in paragraphs)
    return escape("\n\n".join(each.replace("Example: ", "Example:\n  ", 1) for each in joined))


for _group, _commands in GROUPS.items():
    for _name, _command in _commands.items():
        # With more arguments `effects` reads --within 1 % without quotes.
        _settings = {"allow_extra_args": True} if _name == "effects" else None
        _added = app.command(_name, help=help_text(_command), rich_help_panel=_group, context_settings=_settings)
        _added(_naming_the_scene(_name, _command))


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"drumsqueal {version('drumsqueal')}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit."),
    ] = False,
    debug: Annotated[bool, typer.Option(DEBUG, help="Show where an unexpected error came from.")] = False,
) -> None:
    """Does this drum brake squeal, at what frequency and amplitude, and do eigenvalues and transient agree?"""


def command_tree() -> Any:
    """The command with its subcommands, ready to be called.

    A flag takes no value, and its help names no type; brackets in the help are text."""
    tree = cast(Any, typer.main.get_command(app))
    for command in (tree, *tree.commands.values()):
        for parameter in command.get_params(typer.Context(command)):
            if getattr(parameter, "is_flag", False):
                parameter.metavar = ""
            parameter.help = escape(parameter.help or "")
    return tree


def main() -> None:
    """Run the command line and turn every error into one line and an exit status."""
    prepare_environment()
    try:
        command = command_tree()
        if COMPLETION in os.environ:
            command.main(prog_name="drumsqueal", complete_var=COMPLETION)
        # Not main(): that would turn Ctrl-C into a return value, which looks like success.
        with claims_released(), command.make_context("drumsqueal", sys.argv[1:]) as context:
            command.invoke(context)
    except typer.Exit as done:  # after --help and --version
        sys.exit(done.exit_code)
    except (SceneError, RequestError) as error:
        _give_up(str(error), WRONG)
    except UsageError as error:
        message, name = error.format_message(), command_name()
        asked = f"drumsqueal {name}" if any(name in commands for commands in GROUPS.values()) else "drumsqueal"
        _give_up(message and f"{message} (see {asked} --help)", WRONG)
    except KeyboardInterrupt:
        _give_up("interrupted before anything was written", FAILED)
    except BrokenPipeError:  # whoever read has seen enough, as `head` does
        _drop(sys.stdout)
        _drop(sys.stderr)
        sys.exit(FAILED)
    except (IntegrationError, UnwrittenError) as error:
        _give_up(str(error), FAILED)
    except OSError as error:
        if error.filename is None and error.errno in (errno.ENOSPC, errno.EBADF):
            _drop(sys.stdout)
        cause, named = error.strerror or str(error), f"{error.filename}: {{}}"
        _give_up((named if error.filename else _UNNAMED.get(error.errno or 0, "{}")).format(cause), FAILED)
    except MemoryError as error:
        _give_up(f"failed: there is too little memory ({error or 'none is left'})", FAILED)
    except Exception as error:
        if DEBUG in sys.argv[1:2]:
            traceback.print_exc()
        _give_up(f"failed unexpectedly, {type(error).__name__}: {error}", FAILED)


def _drop(stream: TextIO) -> None:
    """What is left to be flushed goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _give_up(message: str, status: int) -> NoReturn:
    if message:
        clear_notice()
        line = printable(" ".join(message.split()))
        try:
            make_console(stderr=True).print(f"drumsqueal: {line}", soft_wrap=True)
            sys.stderr.flush()
        except OSError:  # nobody reads it, but the status is
            _drop(sys.stderr)
    sys.exit(status)
