"""Checksums (SHA-256) of a map's files and chunks, by which damage to them is noticed.

A map holds an index of performance over a grid of poses.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def checksum(about: Any, arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the SHA-256 of a JSON value and of arrays with their names, types and shapes.

    The order of the arrays does not count, and all NaNs count as equal, whatever their bits.
    """
    total = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
    for name, array_like in sorted(arrays.items()):
        array = np.ascontiguousarray(array_like)
        if array.dtype.kind == "f":
            array = np.where(np.isnan(array), np.nan, array)
        total.update(f"\0{name} {array.dtype.str} {array.shape}\0".encode())
        total.update(array.data)
    return total.hexdigest()
