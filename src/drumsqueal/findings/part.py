"""A part of what was found: a frozen model of numbers."""

import math
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field


class Finding(BaseModel):
    """A part of what was found. Keys that are not named are left aside: a newer version may add some."""

    model_config = ConfigDict(frozen=True, arbitrary_types_allowed=True)


Held: Any = Field(default=None, exclude=True)
"""The default of a field that figures need and the file does not hold: it is None where findings were read."""
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Number = Annotated[float, BeforeValidator(lambda value: math.nan if value is None else value)]
"""NaN where the file has null."""
