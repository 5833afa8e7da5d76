"""What a page is made from: summary.json and onset.json as they were written, checked key by key."""

import csv
import io
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from drumsqueal.errors import RequestError
from drumsqueal.files.ordinary import read_ordinary
from drumsqueal.files.output_folder import HISTORY, ONSET_SUMMARY, ONSET_TABLE, SUMMARY
from drumsqueal.findings.history import COMPLETE
from drumsqueal.findings.schema import Findings
from drumsqueal.scene.variation import Variation

LARGEST = 100 * 2**20  # bytes of a summary or a table; those of the longest runs and studies have less than 1 MB


Positive = Annotated[float, Field(gt=0)]


class _Found(BaseModel):
    """Keys that are not named here are left aside: a newer version may add some."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class Parameter(_Found):
    """The number that was varied; its values in SI, the unit in which they were given, and what that is in SI."""

    key: str
    unit: str
    values: list[float] = Field(min_length=2)
    given_unit: str = ""
    given_unit_in_SI: float = Field(default=1.0, gt=0)

    @property
    def variation(self) -> Variation:
        """The same as the command line takes it."""
        return Variation(self.key, self.unit, tuple(self.values), self.given_unit, self.given_unit_in_SI)


class Critical(_Found):
    """A value at which a mode changes its stability."""

    value: float
    uncertainty: float
    label: str
    frequency_Hz: float
    destabilises: bool


class Range(_Found):
    """A range of values of one kind; an end without uncertainty is one of what was asked for."""

    kind: str
    first: float
    last: float
    first_uncertainty: float | None
    last_uncertainty: float | None


class Onset(Findings):
    """What is read of onset.json."""

    outcome: str = COMPLETE
    verdict: str | None
    reservations: list[str]
    parameter: Parameter
    critical_values: list[Critical]
    ranges: list[Range]
    kicked_range_sought_within: float
    smallest_kick_sought: bool
    coordinates: list[str]
    cycles: Any = None


RUN, ONSET = "run", "onset"


def what_is_in(folder: Path) -> str:
    """Whether a folder holds a run or a study of the onset. Raises RequestError where it holds neither, or both."""
    kinds = {RUN: (SUMMARY, HISTORY), ONSET: (ONSET_SUMMARY, ONSET_TABLE)}
    try:
        if not folder.is_dir():
            there = "a file, not a folder" if folder.exists() else "not there"
            raise RequestError(f"{folder} is {there}; name the folder that drumsqueal run or drumsqueal onset has left")
        held = [kind for kind, files in kinds.items() if any((folder / name).is_file() for name in files)]
    except (OSError, ValueError) as error:
        if isinstance(error, RequestError):
            raise
        raise RequestError(f"{folder}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if not held:
        told = f"{folder} holds neither a run ({SUMMARY}, {HISTORY}) nor a study of the onset ({ONSET_SUMMARY})"
        raise RequestError(f"{told}; name the folder that one of them has left")
    if len(held) > 1:
        raise RequestError(f"{folder} holds a run and a study of the onset; put one of them into a folder of its own")
    return held[0]


def read_rows(path: Path) -> list[dict[str, str]]:
    """The rows of onset.csv. Raises RequestError where a column that the page shows is missing."""
    try:
        text = io.StringIO(read_ordinary(path, LARGEST).decode(), newline="")
        reader = csv.DictReader(text, restkey="", restval="")
        rows, columns = list(reader), reader.fieldnames or ()
    except (OSError, ValueError, csv.Error) as error:
        raise RequestError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    wanted = (
        "kind",
        "asked",
        "largest_growth_rate_1_per_s",
        "small_start_leads_to",
        "strongest_frequency_Hz",
        "motions",
    )
    missing = [name for name in wanted if name not in columns]
    if missing:
        raise RequestError(f"{path}: it has no column {missing[0]}; study the onset anew with this version")
    return rows
