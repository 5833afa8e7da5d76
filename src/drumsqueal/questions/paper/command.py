"""`drumsqueal paper -o DIR`."""

from pathlib import Path
from typing import Annotated

from drumsqueal.files.output_folder import PAPER_FILES
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.scene.seo_kang import seo_kang_brake
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, Settings, output_option
from drumsqueal.terminal.reply import Reply


def paper_command(
    output: Annotated[Path | None, output_option("paper")] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Redraw Figures 4 to 11 of Seo & Kang; check its statements.

    Transients are laid over the figures of the paper (2023), and each of its statements is decided by a
    number, or by one for each reading that the text leaves open.

    Writes the figures, paper.csv with their data, and statements.csv and statements.json into DIR.

    Example: drumsqueal paper -o out/paper
    """
    scene = seo_kang_brake(settings or ())
    folder = output if output is not None else Path("out") / "paper"
    reply = Reply.beside(folder, PAPER_FILES, (), quiet, json_file, overwrite=overwrite)
    stop_if_interrupted()
    from drumsqueal.questions.paper.curves import check_brake
    from drumsqueal.questions.paper.job import study_into
    from drumsqueal.simulation import check_sample_rate, prepare

    stop_if_interrupted()
    check_brake(scene)
    check_sample_rate(prepare(scene))
    reply.clear()
    reply.send(study_into(folder, scene, reply.console))
