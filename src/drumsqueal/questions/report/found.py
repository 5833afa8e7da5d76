"""What the page of a run is made from: summary.json as it was written, checked key by key."""

import json
import math
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from drumsqueal.errors import RequestError
from drumsqueal.files.ordinary import read_ordinary
from drumsqueal.files.output_folder import HISTORY, ONSET_SUMMARY, ONSET_TABLE, SUMMARY
from drumsqueal.scene import Scene, SceneError, scene_from_dict

LARGEST = 100 * 2**20  # bytes of a summary or a table; those of the longest runs and studies have less than 1 MB


Positive = Annotated[float, Field(gt=0)]


class _Found(BaseModel):
    """Keys that are not named here are left aside: a newer version may add some."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class PredictedMode(_Found):
    """An eigenvalue that oscillates, with ζ = −Re λ/|λ|."""

    name: str
    frequency_Hz: Positive
    growth_rate_1_per_s: float
    damping_ratio: float
    unstable: bool

    @property
    def abaqus_damping_ratio(self) -> float:
        """−2 Re λ/|Im λ|, some twice of ζ."""
        return -2 * self.growth_rate_1_per_s / (math.tau * self.frequency_Hz)


class Prediction(_Found):
    """The eigenvalue problem."""

    eigenvalues: list[tuple[float, float]]
    modes: list[PredictedMode]
    pressure_range_Pa: tuple[float, float]

    @property
    def labels(self) -> list[str]:
        """The names of the modes, with a number for every further one of a name."""
        names = [mode.name for mode in self.modes]
        earlier = [names[:k].count(name) for k, name in enumerate(names)]
        return [f"{name} ({count + 1})" if count else name for name, count in zip(names, earlier, strict=True)]


class MeasuredMode(_Found):
    """A mode, as predicted and as the transient showed it."""

    label: str
    unstable: bool
    predicted_frequency_Hz: Positive
    measured_frequency_Hz: float | None
    frequency_error: float | None
    frequency_resolution_Hz: float | None
    predicted_growth_rate_1_per_s: float
    measured_growth_rate_1_per_s: float | None
    growth_rate_standard_error_1_per_s: float | None
    growth_rate_error: float | None
    note: str


class Growth(_Found):
    """The growth phase."""

    linear_until_s: float
    edge_reached_s: float | None
    modes: list[MeasuredMode]


class Regime(_Found):
    """The kind of motion after growth."""

    kind: str
    reason: str
    resolution_Hz: float | None


class Line(_Found):
    """A line of the spectrum."""

    coordinate: str
    frequency_Hz: Positive


class Saturation(_Found):
    """The motion after growth."""

    start_s: float
    regime: Regime
    amplitude: dict[str, float]
    main: Line | None
    nearest_mode: str | None
    frequency_shift: float | None
    contact_fraction: float
    slip_reversed_fraction: float


class Frequency(_Found):
    """How the frequency came to be what it is."""

    mode: str
    onset_Hz: Positive
    saturated_Hz: Positive
    shift: float
    predicted_by_contact_loss_Hz: float
    predicted_by_contact_loss_shift: float


class Accuracy(_Found):
    """The energy balance, and the error of the contact's quadrature."""

    energy_balance_error_J: float
    energy_balance_error_over_kinetic_energy: float
    energy_balance_error_over_friction_work: float
    quadrature_error_over_normal_force: float | None = None


class Integration(_Found):
    """Steps of the integration."""

    steps: int
    rejected_steps: int
    implicit_share: float


class Sticking(_Found):
    """When the whole lining sticks."""

    share: float
    to_the_end_from_s: float | None


class Summary(_Found):
    """What is read of summary.json."""

    outcome: str
    verdict: str | None
    prediction: Prediction
    growth: Growth | None
    saturation: Saturation | None
    frequency: Frequency | None
    accuracy: Accuracy | None
    integration: Integration | None
    sticking: Sticking | None
    model: dict[str, list[str]]
    scene: dict[str, Any]
    versions: dict[str, str]


RUN, ONSET = "run", "onset"
Read = TypeVar("Read", bound=_Found)


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


def read_summary(path: Path, kind: type[Read]) -> Read:
    """Read a summary. Raises RequestError where it is none, or of a version that wrote other keys."""
    try:
        data = json.loads(read_ordinary(path, LARGEST))
        return kind.model_validate(data)
    except OSError as error:
        raise RequestError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the whole of it"
        by = _version(data)
        told = f"{path}: {place}: {first['msg'][0].lower()}{first['msg'][1:]}; it was written by {by} of drumsqueal"
        raise RequestError(f"{told}: run the scene anew with this one, or use that one") from None
    except (ValueError, RecursionError):
        raise RequestError(f"{path} is damaged: this is no JSON; run the scene anew") from None


def scene_of(path: Path, tables: dict[str, Any]) -> Scene:
    """The scene that a summary holds. Raises RequestError where this version does not take it."""
    try:
        return scene_from_dict(_without_none(tables))
    except SceneError as error:
        told = f"{path}: the scene in it is not one that this version of drumsqueal takes ({error})"
        raise RequestError(f"{told}; run the scene anew") from None


def _version(data: Any) -> str:
    versions = data.get("versions") if isinstance(data, dict) else None
    version = versions.get("drumsqueal") if isinstance(versions, dict) else None
    return f"version {version[:20]}" if isinstance(version, str) else "an unknown version"


def _without_none(data: Any) -> Any:
    """TOML, and so a scene, has no null."""
    if isinstance(data, dict):
        return {key: _without_none(value) for key, value in data.items() if value is not None}
    return data
