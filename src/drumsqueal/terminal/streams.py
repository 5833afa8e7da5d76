"""Standard streams and a width of lines that everything can be printed to, whatever the program was started with."""

import io
import os
import re
import sys

NARROWEST = 24  # columns of the window, to which running text is folded at most


def prepare_streams() -> None:
    """Open what is closed, replace letters that the encoding lacks, and leave out of COLUMNS what is no width.

    A closed standard output fails when something is printed, as a full disk does: `--quiet` prints nothing. What goes
    to a closed standard error is lost. Neither number is left to a file that is opened later.
    """
    for number, way in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, way)  # takes the lowest number that is free
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w", encoding="utf-8", closefd=False))
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # standard error does so by itself
    width = os.environ.pop("COLUMNS", "")
    if re.fullmatch(r"0*[1-9][0-9]{0,4}", width):
        os.environ["COLUMNS"] = str(max(int(width), NARROWEST))
