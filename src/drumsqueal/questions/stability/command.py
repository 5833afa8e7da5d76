"""`drumsqueal stability SCENE`."""

from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.scene import load_scene
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, SceneFile, Settings
from drumsqueal.terminal.reply import Reply


def stability_command(
    scene: SceneFile,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Find steady sliding, its eigenvalues and modes.

    Example: drumsqueal stability scenarios/nominal.toml --set drum.speed=2 --json -
    """
    loaded = load_scene(scene, settings or ())
    reply = Reply(quiet, json_file, overwrite=overwrite, apart_from=(scene,))
    stop_if_interrupted()
    from drumsqueal.questions.run.summary import describe_stability
    from drumsqueal.questions.run.tables import print_stability
    from drumsqueal.simulation import prepare

    stop_if_interrupted()
    stability = prepare(loaded).stability
    print_stability(reply.console, stability)
    reply.send(describe_stability(stability))
