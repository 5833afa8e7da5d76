"""The formats by name: suffix, module, and the extra that a format needs. Loads none of them."""

import importlib
import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from drumsqueal.errors import RequestError, missing_extra
from drumsqueal.questions.export.channels import Channels


class Format(NamedTuple):
    """A format: the suffix of its files, the module that writes it, and the package and extra that it needs, if any.

    `predicts` says whether there is room in it for the eigenvalues, `others` what else its files may end in.
    """

    suffix: str
    module: str
    package: str = ""
    extra: str = ""
    predicts: bool = True
    others: tuple[str, ...] = ()

    @property
    def endings(self) -> tuple[str, ...]:
        """How the name of a file of this format may end: as one that is given none, or as others are wont to."""
        return self.suffix, *self.others

    def writer(self) -> Callable[[Channels, Path], str]:
        """The function that writes a file, and returns what is to be said of it on the terminal ("" for nothing)."""
        return importlib.import_module(f"drumsqueal.questions.export.{self.module}").write


FORMATS = {
    "csv": Format(".csv", "as_csv", predicts=False, others=(".txt",)),
    "mat": Format(".mat", "as_mat"),
    "npz": Format(".npz", "as_npz"),
    "parquet": Format(".parquet", "as_parquet", "pyarrow", "parquet"),
    "uff58": Format(".uff", "as_uff58", "pyuff", "nvh", others=(".unv", ".u58")),
    "wav": Format(".wav", "as_wav", predicts=False),
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
