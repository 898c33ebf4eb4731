"""Conversion of values, and of chosen attributes of objects, to what JSON can hold."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, is_dataclass
from typing import Any


def json_ready(data: Any) -> Any:
    """Return data with NumPy numbers as Python's, and None for non-finite numbers."""
    if isinstance(data, dict):
        return {key: json_ready(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [json_ready(value) for value in data]
    data = data.item() if hasattr(data, "item") else data
    return None if isinstance(data, float) and not math.isfinite(data) else data


def json_text(data: Any) -> str:
    """Return data as JSON text; non-finite numbers become null."""
    return json.dumps(json_ready(data), indent=1, allow_nan=False) + "\n"


def fields_as_json(owner: object, *names: str) -> dict[str, Any]:
    """Return an object's attributes of these names as a dictionary of plain data.

    A name may hold several words, each "attribute" or "key=attribute", where the key replaces the
    attribute's name. Arrays and tuples become lists; objects with `as_dict` are converted by it.
    """
    pairs = (name.rpartition("=") for name in " ".join(names).split())
    return {key or name: _data(getattr(owner, name)) for key, _, name in pairs}


def json_fields(**fields: object) -> dict[str, Any]:
    """Return keyword arguments as a dictionary of plain data: arrays become lists."""
    return {key: _data(value) for key, value in fields.items()}


def _data(value: Any) -> Any:
    """Return a value as JSON can hold it: arrays as lists, dataclasses as dictionaries."""
    if hasattr(value, "tolist") or hasattr(value, "as_dict"):
        return value.tolist() if hasattr(value, "tolist") else value.as_dict()
    if isinstance(value, list | tuple):
        return [_data(element) for element in value]
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else value
