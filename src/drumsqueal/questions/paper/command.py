"""`drumsqueal paper -o DIR`."""

from pathlib import Path
from typing import Annotated

from drumsqueal.files.output_folder import PAPER_FILES
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

    Draws results of transients over the figures of the paper (2023). A number decides each of its statements, or one
    number for each reading that the text leaves open.

    Writes the figures, paper.csv with their data, and statements.csv and statements.json into DIR.

    Example: drumsqueal paper -o out/paper
    """
    scene = seo_kang_brake(settings or ())
    folder = output if output is not None else Path("out") / "paper"
    reply = Reply.next_to(folder, PAPER_FILES, (), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.paper.answer import PAPER_ANSWER
    from drumsqueal.questions.paper.curves import check_brake
    from drumsqueal.questions.paper.study import study_paper
    from drumsqueal.simulation import check_transient, prepare
    from drumsqueal.terminal.runner import answer

    check_brake(scene)  # what cannot be done is reported before there is a folder
    check_transient(prepare(scene))
    answer(reply, PAPER_ANSWER, lambda progress, keep: study_paper(scene, progress=progress, keep=keep))
