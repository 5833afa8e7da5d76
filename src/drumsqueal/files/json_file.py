"""Plain data and findings as JSON."""

from pathlib import Path
from typing import Any

import pydantic_core

from drumsqueal.files.output_folder import write_whole


def to_json(data: Any) -> str:
    """JSON text of plain data or of findings, with a final line break; null for a number that is not finite."""
    return pydantic_core.to_json(data, indent=2, ensure_ascii=True, inf_nan_mode="null").decode() + "\n"


def write_json(data: Any, path: Path) -> None:
    """Write data to a file, whole or not at all. Raises OSError."""
    write_whole(path, to_json(data).encode())
