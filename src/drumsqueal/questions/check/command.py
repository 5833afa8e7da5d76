"""`drumsqueal check SCENE`."""

import time
from typing import Annotated

import typer

from drumsqueal.scene import SceneError, load_scene
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, SceneFile, Settings
from drumsqueal.terminal.reply import Reply


def check_command(
    scene: SceneFile,
    settings: Settings = None,
    measure: Annotated[
        bool, typer.Option("--measure", help="Time short pieces of the run, which compiles it.")
    ] = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Is a scene valid, and how long does its run take?

    Finds mistakes, derives numbers with their units, estimates growth from the eigenvalues, and warns of unusual
    numbers. With --measure also the computing time of a run, from short pieces of it. Writes only the file of --json.

    Example: drumsqueal check scenarios/nominal.toml --set drum.speed=2 --measure
    """
    loaded = load_scene(scene, settings or ())
    reply = Reply(quiet, json_file, overwrite=overwrite, apart_from=(scene,))
    begun = time.process_time()
    from drumsqueal.questions.check.answer import print_check
    from drumsqueal.questions.check.study import check_scene
    from drumsqueal.questions.run.bistable import print_bistable
    from drumsqueal.scene.usual import unusual
    from drumsqueal.terminal.reply import answer_without_folder
    from drumsqueal.terminal.tables import print_notes

    loading = time.process_time() - begun
    try:
        found = answer_without_folder(
            reply, print_check, lambda progress: check_scene(loaded, loading, measure=measure, progress=progress)
        )
    except SceneError:  # which a number in a wrong unit may have brought about
        print_notes(reply.console, unusual(loaded))
        raise
    print_bistable(reply.console, loaded, found.prepared.stability, scene, settings or ())
