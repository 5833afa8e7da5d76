"""`drumsqueal paper -o DIR`."""

from pathlib import Path
from typing import Annotated

from drumsqueal.cli.options import Overwrite, Settings, make_console, output_option
from drumsqueal.files.output_folder import PAPER_FILES, check_output, claimed
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.scene.seo_kang import seo_kang_brake


def paper_command(
    output: Annotated[Path | None, output_option("paper")] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
) -> None:
    """Redraw Figures 4 to 11 of Seo & Kang (2023) with transients laid over them, and check what the paper states.

    Writes the figures, paper.csv with their data, and statements.csv and statements.json into DIR.

    Example: drumsqueal paper -o out/paper
    """
    scene = seo_kang_brake(settings or ())
    folder = output if output is not None else Path("out") / "paper"
    check_output(folder, PAPER_FILES, overwrite=overwrite)
    stop_if_interrupted()
    from drumsqueal.jobs.paper import study_into
    from drumsqueal.simulation import check_sample_rate, prepare
    from drumsqueal.studies.paper.curves import check_brake

    stop_if_interrupted()
    check_brake(scene)
    check_sample_rate(prepare(scene))
    with claimed(folder, PAPER_FILES):
        study_into(folder, scene, make_console())
