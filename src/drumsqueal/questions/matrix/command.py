"""`drumsqueal matrix TABLE -o DIR`."""

from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.files.output_folder import FILES
from drumsqueal.terminal.options import (
    Cluster,
    JsonFile,
    Overwrite,
    Quiet,
    Resume,
    check_resume,
    output_option,
    read_file,
)
from drumsqueal.terminal.reply import Reply


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
    from drumsqueal.questions.matrix.answer import matrix_into
    from drumsqueal.questions.sweep.cluster import source_of

    with source_of(cluster, reply) as source:
        matrix_into(reply, plan, source, resume=resume)
