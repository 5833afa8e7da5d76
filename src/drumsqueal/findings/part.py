"""A part of what was found: a frozen model of numbers."""

import math
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

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
