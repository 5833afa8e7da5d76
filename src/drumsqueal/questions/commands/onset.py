"""The commands on the onset of squeal: `stability`, `onset`, `cycle`, `sweep`, `matrix`, `sensitivity`, `paper`."""

import importlib.util
import sys
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.files.output_folder import folder_of
from drumsqueal.scene import Scene, load_scene, load_with_tables
from drumsqueal.scene.file import seo_kang_brake
from drumsqueal.scene.plan import Plan, grid, sample
from drumsqueal.scene.variation import POINTS, SYNTAX, read_variation
from drumsqueal.terminal.options import (
    Cluster,
    JsonFile,
    Overwrite,
    Quiet,
    Resume,
    SceneFile,
    Settings,
    UsageError,
    check_resume,
    complete_list,
    complete_range,
    output_option,
    read_file,
    read_fraction,
    words,
)
from drumsqueal.terminal.reply import Answer, Reply, answer
from drumsqueal.terminal.tables import print_notes, print_table


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
    from drumsqueal.questions.stability import print_eigenvalues, print_sliding
    from drumsqueal.scene.usual import unusual
    from drumsqueal.simulation import prepare

    print_notes(reply.console, unusual(loaded))
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


_ALONG = (
    f"The parameter that is varied and its range, in SI units or with units; N values, {POINTS} without xN. "
    'Put a range with spaces in quotes: --along "drum.speed=10 rpm..400 rpm x20".'
)


def onset_command(
    scene: SceneFile,
    along: Annotated[str, typer.Option(metavar=SYNTAX, help=_ALONG, autocompletion=complete_range)],
    output: Annotated[Path | None, output_option("SCENE-onset")] = None,
    within: Annotated[
        str, typer.Option(metavar="FRACTION", help="Find the ends of the bistable range to this fraction of the range.")
    ] = "0.1 %",
    smallest_disturbance: Annotated[
        bool,
        typer.Option(
            "--smallest-disturbance",
            help="Also find the smallest disturbance along a mode that starts squeal at each bistable value.",
        ),
    ] = False,
    cycles: Annotated[
        bool,
        typer.Option(
            "--cycles",
            help="Also follow the limit cycles, stable and unstable, and draw them into the figure.",
        ),
    ] = False,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Where does it squeal, and where only after a large disturbance?

    Finds the critical values of the eigenvalues, runs transients from small and large disturbances at each value, and
    continues each attractor at the neighbouring values. Writes onset.csv, onset.json and onset.png into DIR.

    Example: drumsqueal onset scenarios/damped.toml -o out/onset --along drum.speed=1..60
    """
    loaded = load_scene(scene, settings or ())
    variation = read_variation(along, loaded)
    fraction = read_fraction(within, "--within")
    reply = Reply.with_folder("onset", output, (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.findings.prediction import resolution_in_words, resolution_of
    from drumsqueal.questions.cycle.study import checked_range
    from drumsqueal.questions.onset.answer import ONSET
    from drumsqueal.questions.onset.found import OnsetStudy
    from drumsqueal.questions.onset.study import compare, predict

    if cycles:
        checked_range(loaded, variation)
    with reply.progress() as shown:  # what cannot be studied is reported before there is a folder
        predicted = predict(loaded, variation, shown)
        resolution = resolution_of(loaded, progress=shown)
    print_notes(reply.console, resolution_in_words(resolution))
    study = partial(compare, predicted, fraction, smallest_disturbance=smallest_disturbance, cycles=cycles)
    answer(reply, ONSET, lambda progress, keep: cast("OnsetStudy", study(progress=progress, keep=keep)))


def cycle_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-cycle")] = None,
    along: Annotated[
        str | None,
        typer.Option(
            metavar="KEY=FROM..TO",
            help="Follow the cycles along a parameter of the scene instead, in SI units or with units, as in "
            "drum.speed=1..40.",
            autocompletion=complete_range,
        ),
    ] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Find limit cycles, stable or unstable, and their folds.

    Period, amplitudes and Floquet multipliers of the periodic motion itself.

    Writes cycle.json, cycle.nc (one period) and cycle.png into DIR; with --along, which follows the cycles along a
    parameter through folds, branch.csv, branch.json and branch.png.

    Example: drumsqueal cycle scenarios/damped.toml -o out/cycle --along drum.speed=1..40
    """
    loaded = load_scene(scene, settings or ())
    variation = None if along is None else read_variation(along, loaded, points=None)
    results, folder = "cycle" if variation is None else "branch", output or folder_of("cycle", scene.stem)
    reply = Reply.with_folder(results, folder, (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.cycle.answer import BRANCHES, CYCLES
    from drumsqueal.questions.cycle.study import checked, checked_range, find_cycle, follow_cycles, found_some
    from drumsqueal.questions.stability import print_bistable
    from drumsqueal.simulation import constant_transient

    # What cannot be done is reported before there is a folder.
    stability = constant_transient(checked(loaded)).stability
    if variation is None:
        answer(reply, CYCLES, lambda progress, _: find_cycle(loaded, progress=progress))
        print_bistable(reply.console, loaded, stability, scene, settings or (), squeals=True)
    else:
        checked_range(loaded, variation)
        follow = partial(follow_cycles, loaded, variation)
        answer(reply, BRANCHES, lambda progress, keep: found_some(follow(progress=progress, keep=keep)))


def sweep_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-sweep")] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar=SYNTAX,
            help="Values of a parameter, e.g. drum.speed=1..40x20; with --random a range, e.g. drum.speed=1..40. "
            "Repeatable.",
            autocompletion=complete_range,
        ),
    ] = None,
    random: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Number of random samples from the scene's table [uncertain] and from the ranges of --vary.",
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="S", help="Seed of the samples (default: 0).")] = None,
    transient: Annotated[
        bool, typer.Option("--transient", help="Also integrate every point: amplitude and frequency of the response.")
    ] = False,
    cluster: Cluster = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    resume: Resume = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """For which parameters does the brake squeal, and how likely?

    Computes growth rates, and with --transient amplitudes and frequencies, over a grid or for uncertain parameters.
    With --transient the start may vary, too, as start.velocity.Y: then it counts which disturbances squeal.

    Writes sweep.nc, sweep.json and figures into DIR.

    Example: drumsqueal sweep scenarios/damped.toml --vary drum.speed=1..40x20 -o out/map
    """
    check_resume(resume=resume, overwrite=overwrite)
    plan = _plan(load_scene(scene, settings or ()), vary or [], random, seed, transient)
    reply = Reply.with_folder("sweep", output, (scene,), quiet, json_file, overwrite=overwrite or resume)
    from drumsqueal.questions.sweep.answer import sweep_into
    from drumsqueal.questions.sweep.cluster import source_of
    from drumsqueal.questions.sweep.file import find_sweep
    from drumsqueal.questions.sweep.study import check_plan

    check_plan(plan)
    if resume:
        plan = find_sweep(reply.folder, plan)
    with source_of(cluster, reply) as source:
        sweep_into(reply, plan, source, resume=resume)


def matrix_command(
    table: Annotated[Path, typer.Argument(metavar="TABLE", parser=read_file, help="Table of scenes (TOML).")],
    output: Annotated[Path | None, output_option("TABLE-matrix")] = None,
    cluster: Cluster = None,
    overwrite: Overwrite = False,
    resume: Resume = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Which of many scenes squeal, and how loud?

    A table combines scenes, loads, speeds, frictions, and procedures such as a stop or a run-up. Each is tried after a
    small and after large disturbances.

    Writes matrix.nc, matrix.json, matrix.csv and matrix.png into DIR.

    Example: drumsqueal matrix noise.toml -o out/noise
    """
    check_resume(resume=resume, overwrite=overwrite)
    from drumsqueal.questions.sweep.matrix_plan import read_matrix

    plan = read_matrix(table)
    reply = Reply.with_folder("matrix", output, (table,), quiet, json_file, overwrite=overwrite or resume)
    from drumsqueal.questions.sweep.answer import matrix_into
    from drumsqueal.questions.sweep.cluster import source_of

    with source_of(cluster, reply) as source:
        matrix_into(reply, plan, source, resume=resume)


def _plan(scene: Scene, vary: list[str], random: int | None, seed: int | None, transient: bool) -> Plan:
    if random is not None:
        ranges = [read_variation(text, scene, option="--vary", points=None, starts=True) for text in vary]
        return sample(scene, ranges, random, seed=seed or 0, transient=transient)
    if seed is not None:
        raise RequestError(f"--seed {seed} is the seed of --random; add --random, or leave --seed out")
    if not vary and scene.uncertain:
        cure = "add --random 1000 to sample what is uncertain, or --vary drum.speed=1..40x20"
        raise RequestError(f"there is nothing to sweep; {cure}")
    return grid(
        scene, [read_variation(text, scene, option="--vary", starts=True) for text in vary], transient=transient
    )


VALUES = 6  # of a range without xN
_AT = (
    "Where else --until stable must make it quiet: a range of speeds, loads or another number, N values, "
    f"{VALUES} without xN. Repeat it for every combination."
)


def sensitivity_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-sensitivity")] = None,
    until: Annotated[
        str | None,
        typer.Option(
            metavar="stable",
            help="Also find what makes the brake stable, and quiet after disturbances: each number alone, and "
            "together.",
            autocompletion=words("stable"),
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY,KEY...",
            help="What --until stable may change (default: the design, not speed, load and radius). Repeatable.",
            autocompletion=complete_list,
        ),
    ] = None,
    at: Annotated[list[str] | None, typer.Option(metavar=SYNTAX, help=_AT, autocompletion=complete_range)] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """What should be changed to make the brake quiet?

    Differentiates every growth rate with respect to every parameter of the scene.

    Writes sensitivity.csv, sensitivity.json, sensitivity.png and, with --until stable, quiet.png, and quiet.toml: the
    changed scene, if no disturbance that was tried makes it squeal. It is quiet at the scene's speed and load, and
    where --at asks for it.

    Example: drumsqueal sensitivity scenarios/damped.toml -o out/quiet --until stable
    """
    if until not in (None, "stable"):
        raise UsageError(f"--until {until}: write --until stable, or leave it out")
    if vary and until is None:
        raise UsageError("--vary names what --until stable may change; add --until stable")
    if at and until is None:
        raise UsageError("--at names where --until stable must make it quiet; add --until stable")
    loaded, tables = load_with_tables(scene, settings or ())
    keys = [key.strip() for part in vary for key in part.split(",")] if vary else None
    ranges = [read_variation(text, loaded, option="--at", points=VALUES) for text in at or ()]
    reply = Reply.with_folder("sensitivity", output, (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.sensitivity.answer import not_found, sensitivity_answer
    from drumsqueal.questions.sensitivity.study import check_request, study_sensitivity

    # What cannot be done is reported before there is a folder.
    check_request(loaded, keys, until_stable=until is not None, at=ranges)
    study = partial(study_sensitivity, loaded, until_stable=until is not None, keys=keys, at=ranges, tables=tables)
    how = sensitivity_answer(until_stable=until is not None)
    found = answer(reply, how, lambda progress, keep: study(progress=progress, keep=keep))
    if found.quiet is not None and not found.quiet.succeeded:
        raise IntegrationError(not_found(found))


EXAMPLE = "examples/seo_kang_2023.py"  # in a wheel among its files, in a clone in the folder next to src


@cache
def example() -> Any:
    """The example as a module."""
    installed = Path(str(files("drumsqueal"))) / EXAMPLE
    path = installed if installed.is_file() else Path(__file__).parents[4] / EXAMPLE
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    sys.modules[path.stem] = module = importlib.util.module_from_spec(spec)  # where its dataclasses look for it
    spec.loader.exec_module(module)
    return module


def paper_command(
    output: Annotated[Path | None, output_option("paper")] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Redraw Figures 4 to 11 of Seo & Kang; check its statements.

    Draws results of transients over the figures of the paper (2023). A number decides each of its statements, or one
    number for each reading that the text leaves open.

    Writes the figures, paper.csv with their data, and statements.csv and statements.json into DIR.

    Example: drumsqueal paper -o out/paper
    """
    scene = seo_kang_brake(settings or ())
    reply = Reply.with_folder("paper", output or Path("out") / "paper", (), quiet, json_file, overwrite=overwrite)
    from drumsqueal.simulation import check_transient, prepare

    paper = example()
    paper.check_brake(scene)  # what cannot be done is reported before there is a folder
    check_transient(prepare(scene))
    words = partial(paper.print_study, print_table=print_table)  # in a window of any width
    how = Answer(words=words, summary="statements.json", tables=paper.TABLES, figures=paper.FIGURES, data=paper.summary)
    answer(reply, how, lambda progress, keep: paper.study(scene, progress, keep))
