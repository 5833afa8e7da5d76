"""A part of what was found: a frozen model of numbers."""

from pydantic import BaseModel, ConfigDict, Field


class Finding(BaseModel):
    """A part of what was found. Keys that are not named are left aside: a newer version may add some."""

    model_config = ConfigDict(frozen=True, arbitrary_types_allowed=True)


Held = Field(default=None, exclude=True)
"""The default of a field that figures need and the file does not hold: it is None where findings were read."""
