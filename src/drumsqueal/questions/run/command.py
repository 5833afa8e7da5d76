"""`drumsqueal run SCENE -o DIR`."""

from pathlib import Path
from typing import Annotated

from drumsqueal.files.output_folder import HISTORY, RESUME, files_of_run
from drumsqueal.scene import load_scene
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    Resume,
    SceneFile,
    Settings,
    check_resume,
    output_option,
)
from drumsqueal.terminal.reply import Reply


def run_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE")] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    resume: Resume = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Does the transient squeal as the eigenvalues predict?

    Predicts onset by complex eigenvalues, integrates the nonlinear transient, and compares growth, frequency and final
    motion. Writes history.nc, summary.json and figures into DIR.

    Example: drumsqueal run scenarios/nominal.toml -o out/fast --set drum.speed=8
    """
    check_resume(resume=resume, overwrite=overwrite)
    loaded = load_scene(scene, settings or ())
    # A file "...toml" is called "..", which would lead out of the folder out.
    folder = output if output is not None else Path("out") / (scene.stem if scene.stem.strip(".") else "scene")
    reply = Reply.next_to(folder, files_of_run(folder), (scene,), quiet, json_file, overwrite=overwrite or resume)
    from drumsqueal.scene.usual import unusual
    from drumsqueal.terminal.tables import print_notes

    print_notes(reply.console, unusual(loaded))
    from drumsqueal.questions.run.drawing import second_process

    with second_process() as second:  # which loads while this one does
        from drumsqueal.files.history_file import find_point
        from drumsqueal.findings.prediction import resolution_in_words, resolution_of
        from drumsqueal.questions.run.answer import run_into
        from drumsqueal.questions.run.bistable import print_bistable
        from drumsqueal.simulation import check_transient, prepare

        since = find_point(folder, loaded) if resume else None
        with reply.progress() as progress:
            prepared = prepare(loaded, runs=True, progress=progress)
        check_transient(prepared)
        with reply.progress() as progress:
            resolution = resolution_of(loaded, prepared.linear, prepared.stability, progress)
        print_notes(reply.console, resolution_in_words(resolution))
        with reply.replacing(but=(HISTORY, RESUME) if resume else ()):
            found = run_into(prepared, reply, since, second)
    squeals = found.saturation is not None and found.saturation.vibrates
    print_bistable(reply.console, loaded, prepared.stability, scene, settings or (), squeals=squeals)
    reply.send(found)
