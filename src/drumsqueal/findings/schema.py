"""What every command finds, as frozen models: made once, written as JSON, read back by the same class."""

import json
import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetPydanticSchema,
    PlainSerializer,
    ValidationError,
    WithJsonSchema,
    computed_field,
)
from pydantic_core.core_schema import any_schema

from drumsqueal.errors import RequestError
from drumsqueal.findings.history import versions
from drumsqueal.ordinary import read_ordinary
from drumsqueal.scene import Scene, SceneError, scene_from_dict
from drumsqueal.scene.variation import Variation
from drumsqueal.shown import abridged, as_html, as_text, headed


class Finding(BaseModel):
    """A part of what was found. Keys that are not named are left aside: a newer version may add some.

    Printed, and in a notebook, the whole of what a command found looks as the command prints it.
    """

    model_config = ConfigDict(frozen=True, arbitrary_types_allowed=True)
    printed_by: ClassVar[str] = ""
    """The function, of a console and this, that prints it; see `shown`."""

    def __repr__(self) -> str:
        """Title and verdict of the whole of what a command found; of a part its fields, the long ones cut."""
        fields = type(self).model_fields
        verdict = getattr(self, "verdict", None) or ""
        if self.printed_by or verdict:
            return headed(self, getattr(self, "title", ""), verdict)
        return abridged(self, {name: getattr(self, name) for name, field in fields.items() if not field.exclude})

    def __str__(self) -> str:
        """What its command prints."""
        return as_text(self) if self.printed_by else repr(self)

    def _repr_html_(self) -> str | None:
        return as_html(self) if self.printed_by else None


Held: Any = Field(default=None, exclude=True)
"""The default of a field that figures need and the file does not hold: it is None where findings were read."""
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Number = Annotated[float, BeforeValidator(lambda value: math.nan if value is None else value)]
"""NaN where the file has null."""


def _scene(value: Any) -> Any:
    return scene_from_dict(_without_none(value)) if isinstance(value, dict) else value


SceneInFile = Annotated[
    Scene,
    BeforeValidator(_scene),
    PlainSerializer(lambda scene: scene.model_dump(mode="json")),
    WithJsonSchema({"type": "object", "description": "The tables of a scene file, in SI."}),
]
"""A scene as a field of findings."""


class Findings(Finding):
    """What a command found: the scene as it was run, the versions, and what each question adds."""

    scene: SceneInFile
    versions: dict[str, str] = Field(default_factory=versions)

    @computed_field
    @property
    def title(self) -> str:
        """The title of the scene."""
        return self.scene.title


T = TypeVar("T")
InMemory = Annotated[T, GetPydanticSchema(lambda _source, _handler: any_schema())]
"""The type of such a field that pydantic is not to look into."""
Found = TypeVar("Found", bound=BaseModel)


def read_findings(path: Path, kind: type[Found]) -> Found:
    """Read the findings in a file. Raises RequestError where it holds none, or of a version that wrote other keys."""
    data: Any = None
    try:
        # 100 MB; files of the findings of the longest runs and studies have less than 1 MB
        data = json.loads(read_ordinary(path, 100 * 2**20))
        found = kind.model_validate(data)
    except OSError as error:
        raise RequestError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValidationError as error:
        first = error.errors()[0]
        cause = first.get("ctx", {}).get("error")
        if isinstance(cause, SceneError):
            fault = f"{path}: the scene in it is not one that this version of drumsqueal takes ({cause})"
            raise RequestError(f"{fault}; run the scene again") from None
        place = ".".join(str(part) for part in first["loc"]) or "the whole of it"
        raise _of_another_version(path, data, f"{place}: {first['msg'][0].lower()}{first['msg'][1:]}") from None
    except (ValueError, RecursionError):
        raise RequestError(f"{path} is damaged: this is not JSON; run the scene again") from None
    # What has a default where it is made must be there where it is read.
    missing = [name for name, field in kind.model_fields.items() if not field.exclude and name not in data]
    if missing:
        raise _of_another_version(path, data, f"{missing[0]}: field required")
    return found


def _of_another_version(path: Path, data: Any, fault: str) -> RequestError:
    versions = data.get("versions") if isinstance(data, dict) else None
    version = versions.get("drumsqueal") if isinstance(versions, dict) else None
    by = f"version {version[:20]}" if isinstance(version, str) else "an unknown version"
    return RequestError(
        f"{path}: {fault}; it was written by {by} of drumsqueal: run the scene again with this one, or use that one"
    )


def _without_none(data: Any) -> Any:
    """TOML, and so a scene, has no null."""
    if isinstance(data, dict):
        return {key: _without_none(value) for key, value in data.items() if value is not None}
    return data


# The number of a scene that a study varies, as its file holds it.


class Parameter(Finding):
    """The number by its dotted key, its values in SI, the unit in which they were given, and what that is in SI."""

    key: str
    unit: str
    values: tuple[float, ...] = Field(min_length=2)
    given_unit: str = ""
    given_unit_in_SI: float = Field(default=1.0, gt=0)

    @classmethod
    def of(cls, variation: Variation) -> Self:
        """That of a variation."""
        key, unit, values, given, size = variation
        return cls(key=key, unit=unit, values=values, given_unit=given, given_unit_in_SI=size)

    @property
    def variation(self) -> Variation:
        """The same as the command line reads it."""
        return Variation(self.key, self.unit, self.values, self.given_unit, self.given_unit_in_SI)
