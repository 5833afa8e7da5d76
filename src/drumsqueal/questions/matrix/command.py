"""`drumsqueal matrix TABLE -o DIR`."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.files.output_folder import MATRIX_FILES
from drumsqueal.terminal.completion import words
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, Resume, UsageError, output_option, read_file
from drumsqueal.terminal.reply import Reply

_CLUSTER = "Compute in several processes: local, or the address of a Dask scheduler, e.g. tcp://host:8786."


def matrix_command(
    table: Annotated[
        Path, typer.Argument(metavar="TABLE", parser=read_file, help="Table of scenes (TOML).", show_default=False)
    ],
    output: Annotated[Path | None, output_option("TABLE-matrix")] = None,
    cluster: Annotated[
        str | None, typer.Option("--cluster", metavar="WHERE", help=_CLUSTER, autocompletion=words("local"))
    ] = None,
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
    if resume and overwrite:
        raise UsageError("--resume continues what is there, --overwrite replaces it; leave one of them out")
    from drumsqueal.questions.matrix.table import read_matrix

    plan = read_matrix(table)
    folder = output if output is not None else Path("out") / f"{table.stem}-matrix"
    reply = Reply.next_to(folder, MATRIX_FILES, (table,), quiet, json_file, overwrite=overwrite or resume)
    from drumsqueal.questions.matrix.answer import matrix_into
    from drumsqueal.questions.sweep.cluster import check_cluster, connected
    from drumsqueal.questions.sweep.filling import here
    from drumsqueal.terminal.runner import shown_progress

    if cluster is None:
        matrix_into(reply, plan, here, resume=resume)
        return
    check_cluster(cluster)
    with ExitStack() as stack:
        with shown_progress(reply.console) as progress:
            workers = stack.enter_context(connected(cluster, progress))
        matrix_into(reply, plan, workers.results, resume=resume)
