"""The command line: `drumsqueal run SCENE -o DIR` and the other commands, one module each.

What computes is imported inside the commands, once the scene has been read: JAX must find its environment prepared,
and a mistake in a scene is told at once.
"""

import sys
from typing import NoReturn

import typer

from drumsqueal.cli.accuracy import accuracy_command
from drumsqueal.cli.animate import animate_command
from drumsqueal.cli.cycle import cycle_command
from drumsqueal.cli.effects import effects_command
from drumsqueal.cli.export import export_command
from drumsqueal.cli.motion import motion_command
from drumsqueal.cli.onset import onset_command
from drumsqueal.cli.options import UsageError, make_console
from drumsqueal.cli.paper import paper_command
from drumsqueal.cli.report import report_command
from drumsqueal.cli.run import run_command
from drumsqueal.cli.sensitivity import sensitivity_command
from drumsqueal.cli.stability import stability_command
from drumsqueal.cli.sweep import sweep_command
from drumsqueal.compilation import prepare_environment
from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.scene.quantities import SceneError, printable

app = typer.Typer(add_completion=False, no_args_is_help=True, rich_markup_mode="rich", pretty_exceptions_enable=False)
FAILED, WRONG = 1, 2  # exit status
INTERRUPTED = "interrupted before anything was written"

app.command(name="run")(run_command)
app.command(name="stability")(stability_command)
app.command(name="effects", context_settings={"allow_extra_args": True})(effects_command)
app.command(name="cycle")(cycle_command)
app.command(name="accuracy")(accuracy_command)
app.command(name="onset")(onset_command)
app.command(name="motion")(motion_command)
app.command(name="sensitivity")(sensitivity_command)
app.command(name="paper")(paper_command)
app.command(name="sweep")(sweep_command)
app.command(name="report")(report_command)
app.command(name="animate")(animate_command)
app.command(name="export")(export_command)


@app.callback()
def _main() -> None:
    """Friction-induced vibration of a drum-brake shoe in time, beside the eigenvalues that predict it."""


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
        make_console(stderr=True).print(f"drumsqueal: {_one_line(message)}", soft_wrap=True)
    sys.exit(status)
