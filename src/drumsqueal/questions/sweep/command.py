"""`drumsqueal sweep SCENE -o DIR` and `drumsqueal matrix TABLE -o DIR`."""

from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import FILES
from drumsqueal.scene import Scene, load_scene
from drumsqueal.scene.plan import Plan, grid, sample
from drumsqueal.scene.variation import SYNTAX, read_variation
from drumsqueal.terminal.options import (
    Cluster,
    JsonFile,
    Overwrite,
    Quiet,
    Resume,
    SceneFile,
    Settings,
    check_resume,
    complete_range,
    output_option,
    read_file,
)
from drumsqueal.terminal.reply import Reply

_VARY = "Values of a parameter, e.g. drum.speed=1..40x20; with --random a range, e.g. drum.speed=1..40. Repeatable."
_RANDOM = "Number of random samples from the scene's table [uncertain] and from the ranges of --vary."


def sweep_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-sweep")] = None,
    vary: Annotated[
        list[str] | None, typer.Option("--vary", metavar=SYNTAX, help=_VARY, autocompletion=complete_range)
    ] = None,
    random: Annotated[int | None, typer.Option("--random", metavar="N", help=_RANDOM, show_default=False)] = None,
    seed: Annotated[int | None, typer.Option("--seed", metavar="S", help="Seed of the samples (default: 0).")] = None,
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
    folder = output if output is not None else Path("out") / f"{scene.stem}-sweep"
    reply = Reply.next_to(folder, FILES["sweep"], (scene,), quiet, json_file, overwrite=overwrite or resume)
    from drumsqueal.questions.sweep.answer import sweep_into
    from drumsqueal.questions.sweep.cluster import source_of
    from drumsqueal.questions.sweep.file import find_sweep
    from drumsqueal.questions.sweep.study import check_plan

    check_plan(plan)
    if resume:
        plan = find_sweep(folder, plan)
    with source_of(cluster, reply) as source:
        sweep_into(reply, plan, source, resume=resume)


def matrix_command(
    table: Annotated[
        Path, typer.Argument(metavar="TABLE", parser=read_file, help="Table of scenes (TOML).", show_default=False)
    ],
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
    folder = output if output is not None else Path("out") / f"{table.stem}-matrix"
    reply = Reply.next_to(folder, FILES["matrix"], (table,), quiet, json_file, overwrite=overwrite or resume)
    from drumsqueal.questions.sweep.cluster import source_of
    from drumsqueal.questions.sweep.matrix_answer import matrix_into

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
