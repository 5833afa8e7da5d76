"""`drumsqueal sweep SCENE -o DIR`."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import SWEEP_FILES
from drumsqueal.scene import Scene, load_scene
from drumsqueal.scene.plan import Plan, grid, sample
from drumsqueal.scene.variation import SYNTAX, read_variation
from drumsqueal.terminal.completion import complete_range, words
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    Resume,
    SceneFile,
    Settings,
    UsageError,
    output_option,
)
from drumsqueal.terminal.reply import Reply

_VARY = "Values of a parameter, e.g. drum.speed=1..40x20; with --random a range, e.g. drum.speed=1..40. Repeatable."
_RANDOM = "Number of random samples from the scene's table [uncertain] and from the ranges of --vary."
_CLUSTER = "Compute in several processes: local, or the address of a Dask scheduler, e.g. tcp://host:8786."


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
    cluster: Annotated[
        str | None, typer.Option("--cluster", metavar="WHERE", help=_CLUSTER, autocompletion=words("local"))
    ] = None,
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
    if resume and overwrite:
        raise UsageError("--resume continues what is there, --overwrite replaces it; leave one of them out")
    plan = _plan(load_scene(scene, settings or ()), vary or [], random, seed, transient)
    folder = output if output is not None else Path("out") / f"{scene.stem}-sweep"
    reply = Reply.next_to(folder, SWEEP_FILES, (scene,), quiet, json_file, overwrite=overwrite or resume)
    from drumsqueal.questions.sweep.answer import sweep_into
    from drumsqueal.questions.sweep.cluster import check_cluster, connected
    from drumsqueal.questions.sweep.file import find_sweep
    from drumsqueal.questions.sweep.filling import here
    from drumsqueal.questions.sweep.study import check_plan
    from drumsqueal.terminal.runner import shown_progress

    check_plan(plan)
    if resume:
        plan = find_sweep(folder, plan)
    if cluster is None:
        sweep_into(reply, plan, here, resume=resume)
        return
    check_cluster(cluster)
    with ExitStack() as stack:
        with shown_progress(reply.console) as progress:
            workers = stack.enter_context(connected(cluster, progress))
        sweep_into(reply, plan, workers.results, resume=resume)


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
