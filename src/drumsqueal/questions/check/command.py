"""`drumsqueal check SCENE`."""

import time

from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.scene import load_scene
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, SceneFile, Settings
from drumsqueal.terminal.reply import Reply


def check_command(
    scene: SceneFile,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Is a scene right, what follows from it, how long will it run?

    Finds mistakes, tells derived numbers with their units, what the start will come to, and what is odd, in words, and
    times short pieces of the transient. Writes nothing but the file of --json.

    Example: drumsqueal check scenarios/nominal.toml --set start.displacement.Y=1e-5
    """
    loaded = load_scene(scene, settings or ())
    reply = Reply(quiet, json_file, overwrite=overwrite, apart_from=(scene,))
    stop_if_interrupted()
    begun = time.process_time()
    from drumsqueal.questions.check.job import check
    from drumsqueal.questions.run.bistable import print_bistable

    loading = time.process_time() - begun
    stop_if_interrupted()
    found, data = check(loaded, reply.console, loading)
    print_bistable(reply.console, loaded, found.prepared.stability, scene, settings or ())
    reply.send(data)
