"""`drumsqueal stability SCENE`."""

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
    """Which modes of steady sliding are unstable, by eigenvalues?

    Example: drumsqueal stability scenarios/nominal.toml --set drum.speed=2 --json -
    """
    loaded = load_scene(scene, settings or ())
    reply = Reply(quiet, json_file, overwrite=overwrite, apart_from=(scene,))
    from drumsqueal.findings.brake import PredictionOfBrake, describe_brake
    from drumsqueal.findings.prediction import predict, resolution_in_words, resolution_of
    from drumsqueal.physics.inventory import bending_in_words
    from drumsqueal.questions.stability.answer import print_eigenvalues, print_sliding
    from drumsqueal.simulation import prepare
    from drumsqueal.terminal.tables import print_notes

    with reply.progress() as progress:
        prepared = prepare(loaded, progress=progress)
    print_eigenvalues(reply.console, prepared.stability)
    with reply.progress() as progress:
        progress("looking for the friction at which the brake locks", 0.0, None)
        brake = describe_brake(loaded, prepared.linear, prepared.stability)
    print_sliding(reply.console, prepared.stability, brake)
    for bending in bending_in_words(loaded):
        reply.console.print(bending, soft_wrap=True)
    with reply.progress() as progress:
        resolution = resolution_of(loaded, prepared.linear, prepared.stability, progress)
    print_notes(reply.console, resolution_in_words(resolution))
    found = predict(prepared.stability, resolution)
    reply.send(found if brake is None else PredictionOfBrake(**dict(found), brake=brake))
