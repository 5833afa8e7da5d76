"""The commands, by the panels of the help: what is asked for, read and claimed, before what computes is imported."""

from collections.abc import Sequence
from pathlib import Path

from drumsqueal.files.output_folder import FILES
from drumsqueal.terminal.reply import Reply


def reply_with(
    results: str,
    output: Path | None,
    read: Sequence[Path],
    quiet: bool,
    json_file: str | None,
    *,
    overwrite: bool,
    named: str = "",
) -> Reply:
    """The reply of a command that leaves such `results` in a folder: without `output` out/STEM-`results`.

    STEM is that of the first file that is `read`; with `named`, the folder is called by it.
    """
    folder = output if output is not None else Path("out") / (named or f"{read[0].stem}-{results}")
    return Reply.next_to(folder, FILES[results], read, quiet, json_file, overwrite=overwrite)
