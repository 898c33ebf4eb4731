"""Conversion of values, and of chosen attributes of objects, to what JSON can hold."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, is_dataclass
from typing import Any


def json_ready(data: Any) -> Any:
    """Return data for JSON: NumPy's numbers as Python's, None (null) for non-finite ones."""
    if isinstance(data, dict):
        return {key: json_ready(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [json_ready(value) for value in data]
    data = data.item() if hasattr(data, "item") else data
    return None if isinstance(data, float) and not math.isfinite(data) else data


def json_text(data: Any) -> str:
    """Return data as the text of a JSON file."""
    return json.dumps(json_ready(data), indent=1, allow_nan=False) + "\n"


def fields_as_json(owner: object, *names: str) -> dict[str, Any]:
    """Return attributes of an object as plain data, by their names.

    A name may hold several words, each "attribute" or "key=attribute", where the key is another.
    Arrays and tuples become lists; what has an `as_dict` is asked for it.
    """
    pairs = (name.rpartition("=") for name in " ".join(names).split())
    return {key or name: _data(getattr(owner, name)) for key, _, name in pairs}


def json_fields(**fields: object) -> dict[str, Any]:
    """Return values as plain data, by their keys; see `fields_as_json` for what becomes of them."""
    return {key: _data(value) for key, value in fields.items()}


def _data(value: Any) -> Any:
    """Return a value as JSON can hold it: arrays as lists, objects by their fields."""
    if hasattr(value, "tolist") or hasattr(value, "as_dict"):
        return value.tolist() if hasattr(value, "tolist") else value.as_dict()
    if isinstance(value, list | tuple):
        return [_data(element) for element in value]
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else value
