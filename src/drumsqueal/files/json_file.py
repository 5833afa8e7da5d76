"""Plain data as JSON text."""

import json
import math
from typing import Any


def to_json(data: Any) -> str:
    """JSON text with a final line break; a number that is not finite becomes null, for JSON has none."""
    return json.dumps(_finite(data), indent=2, allow_nan=False) + "\n"


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data
