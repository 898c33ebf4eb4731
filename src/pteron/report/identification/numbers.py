"""An identification's numbers, for programs: what `identification.json` holds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pteron.identification import Identification

__all__ = ["numbers"]


def numbers(result: Identification) -> dict[str, Any]:
    """Return the numbers of an identification as plain data, null where one is not finite."""
    found = _finite(result.as_dict())
    assert isinstance(found, dict)
    return found


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    if isinstance(data, np.generic):
        data = data.item()
    return None if isinstance(data, float) and not math.isfinite(data) else data
