"""The formats that a history is exported to, by name, and how it is told from a measured record; loads nothing yet."""

import importlib.util
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from drumsqueal.errors import RequestError, missing_extra
from drumsqueal.files.output_folder import history_file
from drumsqueal.ordinary import open_ordinary
from drumsqueal.progress import Progress

if TYPE_CHECKING:
    from drumsqueal.questions.export.signals import Channels


class Format(NamedTuple):
    """A format: the suffix of its files, what `writes` them (module:function), and the package and extra that it needs.

    `predicts` says whether there is room in it for the eigenvalues, `others` what else its files may end in.
    """

    suffix: str
    writes: str
    package: str = ""
    extra: str = ""
    predicts: bool = True
    others: tuple[str, ...] = ()

    @property
    def endings(self) -> tuple[str, ...]:
        """How the name of a file of this format may end: as the default does, or as in other programs."""
        return self.suffix, *self.others

    def writer(self) -> "Callable[[Channels, Path, Progress], str]":
        """The function that writes a file, calling a hook for progress, and returns a note on it ("" for none)."""
        return pkgutil.resolve_name(f"drumsqueal.questions.export.{self.writes}")


FORMATS = {
    "csv": Format(".csv", "export:write_csv", predicts=False, others=(".txt",)),
    "mat": Format(".mat", "export:write_mat"),
    "npz": Format(".npz", "export:write_npz"),
    "parquet": Format(".parquet", "export:write_parquet", "pyarrow", "parquet"),
    "uff58": Format(".uff", "uff58:write_uff58", others=(".unv", ".u58")),
    "wav": Format(".wav", "export:write_wav", predicts=False),
}


def find_format(name: str) -> Format:
    """Return a format by its name or the ending of its files, such as uff.

    Raises RequestError for an unknown one, and where its extra is not installed.
    """
    found = FORMATS.get(name) or next((each for each in FORMATS.values() if f".{name}" in each.endings), None)
    if found is None:
        raise RequestError(f"--to {name}: there is no such format; write one of {', '.join(FORMATS)}")
    if found.package and importlib.util.find_spec(found.package) is None:
        raise missing_extra(f"--to {name}", found.extra)
    return found


def is_history(path: Path) -> bool:
    """Whether there is an HDF5 file, as every history is, or a folder with one."""
    file = history_file(path)
    try:
        with open_ordinary(file, file.stat().st_size) as start:
            return start.read(4) == b"\x89HDF"  # how the files begin
    except (OSError, ValueError):  # reported where the file is read
        return False
