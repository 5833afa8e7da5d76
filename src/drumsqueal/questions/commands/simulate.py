"""The commands that simulate, `scenes`, `check`, `run`, `motion`, and on the quality of it: `effects`, `accuracy`."""

import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from drumsqueal.files.output_folder import HISTORY, RESUME, folder_of, write_whole
from drumsqueal.findings.columns import Column
from drumsqueal.scene import SceneError, load_scene, setting_choices
from drumsqueal.scene.file import shipped_path, shipped_scenes
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    Resume,
    SceneFile,
    Settings,
    UsageError,
    check_resume,
    complete_name,
    output_option,
    read_duration,
    read_fraction,
    words,
)
from drumsqueal.terminal.reply import Reply, answer, answer_without_folder
from drumsqueal.terminal.tables import print_cells, print_notes


def scenes_command(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="The scene to copy.", autocompletion=complete_name)
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Where to copy it to (default: ./NAME.toml).")
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """List the shipped scenes, or copy one to start from.

    Example: drumsqueal scenes damped -o out.toml
    """
    if name is None and output is not None:
        raise UsageError(f"-o {output} is where a scene is copied to; name the scene, too")
    source = None if name is None else shipped_path(name)
    target = output or (source and Path(source.name))
    if source is None or target is None:
        reply = Reply(quiet, json_file, overwrite=overwrite)
        shown = [{"name": each.name, "title": each.title, "shows": each.shows} for each in shipped_scenes()]
        answer_without_folder(reply, _print_scenes, lambda _: shown)
    else:
        reply = Reply.with_file(target, (source,), quiet, json_file, overwrite=overwrite)
        write_whole(target, source.read_bytes())
        copied = {"name": source.stem, "file": str(target)}
        text = printable(f"Copied the scene {source.stem}")
        answer_without_folder(reply, lambda console, _: console.print(text), lambda _: copied)


def _print_scenes(console: Console, scenes: Sequence[dict[str, str]]) -> None:
    """Print name, title and what it shows of every scene; into a pipe, a line each and no more."""
    if not console.is_terminal:
        name, title = (max(map(len, texts)) for texts in ([s["name"] for s in scenes], [s["title"] for s in scenes]))
        for scene in scenes:
            console.print(f"{scene['name']:<{name}}  {scene['title']:<{title}}  {scene['shows']}")
        return
    columns = map(Column, ("name", "title", "what it shows"))
    print_cells(console, "Shipped scenes", columns, (tuple(scene.values()) for scene in scenes))
    console.print("`drumsqueal scenes NAME` copies one; every command also takes the name itself.", style="dim")


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
    from drumsqueal.questions.check import check_scene, print_check
    from drumsqueal.questions.stability import print_bistable
    from drumsqueal.scene.usual import unusual

    loading = time.process_time() - begun
    try:
        found = answer_without_folder(
            reply, print_check, lambda progress: check_scene(loaded, loading, measure=measure, progress=progress)
        )
    except SceneError:  # which a number in a wrong unit may have brought about
        print_notes(reply.console, unusual(loaded))
        raise
    print_bistable(reply.console, loaded, found.prepared.stability, scene, settings or ())


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
    folder = output or folder_of("run", scene.stem if scene.stem.strip(".") else "scene")
    reply = Reply.with_folder("run", folder, (scene,), quiet, json_file, overwrite=overwrite or resume)
    from drumsqueal.scene.usual import unusual

    print_notes(reply.console, unusual(loaded))
    from drumsqueal.questions.run.drawing import second_process

    with second_process() as second:  # which loads while this one does
        from drumsqueal.files.history_file import find_point
        from drumsqueal.findings.prediction import resolution_in_words, resolution_of
        from drumsqueal.questions.run.answer import run_into
        from drumsqueal.questions.stability import print_bistable
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


def motion_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-motion")] = None,
    duration: Annotated[
        str, typer.Option(metavar="TIME", help="Duration of the record, after the motion has settled.")
    ] = "5 s",
    at_most: Annotated[str, typer.Option(metavar="TIME", help="Limit of the computing time.")] = "600 s",
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Is the motion periodic, quasi-periodic or chaotic?

    Recurrence, fundamental frequencies and Lyapunov exponents must agree; where they do not, the
    command reports how long a record is needed.

    Writes motion.json, motion.csv (spectral lines with their combinations) and figures into DIR.

    Example: drumsqueal motion scenarios/nominal.toml -o out/motion --duration "3 s"
    """
    loaded = load_scene(scene, settings or ())
    length, limit = read_duration(duration, "--duration"), read_duration(at_most, "--at-most")
    reply = Reply.with_folder("motion", output, (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.findings.kinds import Kind
    from drumsqueal.questions.motion.answer import MOTION
    from drumsqueal.questions.motion.study import study_motion
    from drumsqueal.questions.stability import print_bistable
    from drumsqueal.simulation import constant_transient

    stability = constant_transient(loaded).stability  # what cannot be done is reported before there is a folder
    study = partial(study_motion, loaded, length, at_most=limit)
    found = answer(reply, MOTION, lambda progress, keep: study(progress=progress, keep=keep))
    print_bistable(reply.console, loaded, stability, scene, settings or (), squeals=found.kind is not Kind.STEADY)


def effects_command(
    context: typer.Context,
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-effects")] = None,
    within: Annotated[str, typer.Option(metavar="FRACTION", help="Required accuracy, such as 1 %.")] = "1 %",
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Which effects does a scene need, and what does each cost?

    Leaves out each effect in turn, and compares growth rates, frequencies, amplitudes and computing time.

    Writes effects.csv, effects.png and reduced.toml, the scene with only the effects that it needs, into DIR.

    Example: drumsqueal effects scenarios/nominal.toml -o out/effects --within 2%
    """
    if context.args == ["%"] and "%" not in within:  # what the shell makes of --within 1 %
        within = f"{within} %"
    elif context.args:
        raise UsageError(f"Got unexpected extra argument ({context.args[0]})")
    loaded = load_scene(scene, settings or ())
    accuracy = read_fraction(within, "--within")
    reply = Reply.with_folder("effects", output, (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.effects.answer import EFFECTS_ANSWER
    from drumsqueal.questions.effects.study import study_effects
    from drumsqueal.simulation import check_transient, prepare

    check_transient(prepare(loaded))  # a scene that cannot be run is reported before there is a folder
    study = partial(study_effects, loaded, accuracy)
    answer(reply, EFFECTS_ANSWER, lambda progress, keep: study(progress=progress, keep=keep))


def accuracy_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-accuracy")] = None,
    target: Annotated[
        str, typer.Option(metavar="FRACTION", help='Required relative accuracy, such as 1e-4 or "1 %".')
    ] = "1e-4",
    solvers: Annotated[
        list[str] | None,
        typer.Option(
            "--solver",
            metavar="NAME",
            help="Further solver to try, e.g. diffrax.Kvaerno5. Repeatable.",
            autocompletion=words(*setting_choices("simulate.solver")),
        ),
    ] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """How large is the error, and what does a smaller one cost?

    Compares methods, tolerances and quadratures with an independent reference. Writes accuracy.csv, three figures and
    simulate.toml, the cheapest settings that meet the target, into DIR.

    Example: drumsqueal accuracy scenarios/nominal.toml -o out/accuracy --target 1e-5
    """
    loaded = load_scene(scene, settings or ())
    wanted = read_fraction(target, "--target")
    reply = Reply.with_folder("accuracy", output, (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.accuracy.answer import ACCURACY
    from drumsqueal.questions.accuracy.study import check_motion, check_solvers, study_accuracy
    from drumsqueal.simulation import check_transient, prepare

    check_motion(loaded)  # what cannot be done is reported before there is a folder
    check_transient(prepare(loaded))
    check_solvers(loaded, solvers or ())
    study = partial(study_accuracy, loaded, wanted, solvers=solvers or ())
    answer(reply, ACCURACY, lambda progress, keep: study(progress=progress, keep=keep))
