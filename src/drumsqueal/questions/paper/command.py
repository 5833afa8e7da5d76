"""`drumsqueal paper -o DIR`: what `examples/seo_kang_2023.py` finds, by the ways of a command."""

import functools
import importlib.util
import sys
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

from drumsqueal.files.output_folder import FILES
from drumsqueal.scene.shipped import seo_kang_brake
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, Settings, output_option
from drumsqueal.terminal.reply import Reply

EXAMPLE = "examples/seo_kang_2023.py"  # in a wheel among its files, in a clone in the folder next to src


@functools.cache
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
    folder = output if output is not None else Path("out") / "paper"
    reply = Reply.next_to(folder, FILES["paper"], (), quiet, json_file, overwrite=overwrite)
    from drumsqueal.simulation import check_transient, prepare
    from drumsqueal.terminal.reply import Answer, answer
    from drumsqueal.terminal.tables import print_table

    paper = example()
    paper.check_brake(scene)  # what cannot be done is reported before there is a folder
    check_transient(prepare(scene))
    words = functools.partial(paper.print_study, print_table=print_table)  # in a window of any width
    how = Answer(words=words, summary="statements.json", tables=paper.TABLES, figures=paper.FIGURES, data=paper.summary)
    answer(reply, how, lambda progress, keep: paper.study(scene, progress, keep))
