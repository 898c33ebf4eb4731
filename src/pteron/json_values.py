"""Values as JSON has them."""

from __future__ import annotations

import math
from typing import Any


def json_ready(data: Any) -> Any:
    """Return data as JSON has them: NumPy's numbers as Python's, null for what is not finite."""
    if isinstance(data, dict):
        return {key: json_ready(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [json_ready(value) for value in data]
    data = data.item() if hasattr(data, "item") else data
    return None if isinstance(data, float) and not math.isfinite(data) else data
