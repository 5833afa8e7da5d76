"""Plain data and findings as JSON."""

import json
import math
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from drumsqueal.files.output_folder import write_whole


def to_json(data: Any) -> str:
    """JSON text of plain data or of findings, with a final line break; null for a number that is not finite."""
    return json.dumps(_finite(data), indent=2, allow_nan=False) + "\n"


def write_json(data: Any, path: Path) -> None:
    """Write data to a file, whole or not at all. Raises OSError."""
    write_whole(path, to_json(data).encode())


def _finite(data: Any) -> Any:
    if isinstance(data, BaseModel):
        data = data.model_dump(mode="json")
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data
