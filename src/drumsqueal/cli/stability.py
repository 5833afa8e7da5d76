"""`drumsqueal stability SCENE`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.cli.options import SceneFile, Settings, make_console
from drumsqueal.errors import RequestError
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.scene import load_scene


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
    from drumsqueal.files.summary import describe_stability, to_json
    from drumsqueal.jobs.run_tables import print_stability
    from drumsqueal.simulation import prepare

    stop_if_interrupted()
    stability = prepare(loaded).stability
    if json_file is None:
        print_stability(make_console(), stability)
        return
    text = to_json(describe_stability(stability))
    if json_file == "-":
        sys.stdout.write(text)
        return
    try:
        Path(json_file).write_text(text, encoding="utf-8")
    except OSError as error:
        raise RequestError(f"--json {json_file}: cannot be written ({error.strerror or error})") from None
