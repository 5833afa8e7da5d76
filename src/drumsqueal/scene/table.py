"""What every table of a scene is."""

from pydantic import BaseModel, ConfigDict


class Table(BaseModel):
    """A table of a scene: frozen, and without room for unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", revalidate_instances="always")
