"""Comparison of a store's plan, all that its results depend on, with that of a run to resume it."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pteron.errors import OutputError, shorten

RESULTS = "0.1.0"
"""The first version of Pteron whose maps and searches give the same numbers as this one: their
stores can be resumed. It is raised where a number of them changes."""

_LONG = 40
"""Characters of a text that a message shows whole."""

_MANY = 2
"""Most differences that are listed of each part of a plan."""


def expect_same(path: str | Path, stored: Any, plan: Mapping[str, Any]) -> None:
    """Raise OutputError, listing the differences, if a store's plan is not the run's.

    Plans are plain JSON data: the store's, and that of the run. Texts that are TOML, as a robot's
    is, are compared by their keys.
    """
    if not isinstance(stored, Mapping):
        raise OutputError(f"{path}: holds no plan of results; name another place, or remove it")
    differences: list[str] = []
    for key in {**plan, **stored}:
        lines = list(_differences(str(key), stored.get(key), plan.get(key)))
        differences += lines[:_MANY]
        if len(lines) > _MANY:
            differences.append(f"and {len(lines) - _MANY} more of the {shorten(key, bare=True)}")
    if differences:
        raise OutputError(
            f"{path}: holds results of another plan ({'; '.join(differences)}); name another "
            "place, or remove it"
        )


def _differences(name: str, stored: Any, plan: Any) -> Iterator[str]:
    """Yield a line for every number or text in which two plans differ."""
    label = f"{name}."
    if name == "robot":
        stored, plan = _machine(stored), _machine(plan)
        label = f"robot {shorten(plan.get('name'), bare=True)}: "
    if isinstance(stored, Mapping) and isinstance(plan, Mapping):
        for key in {**plan, **stored}:
            yield from _differences(f"{label}{key}", stored.get(key), plan.get(key))
    elif _is_table_list(stored) and _is_table_list(plan) and len(stored) == len(plan):
        for k, both in enumerate(zip(stored, plan, strict=True), start=1):
            yield from _differences(f"{name}[{k}]", *both)
    # True is 1 and -0.0 is 0.0, but not as they are written.
    elif json.dumps(stored, default=str) != json.dumps(plan, default=str):
        yield _difference_text(name, stored, plan)


def _machine(text: Any) -> Mapping[str, Any]:
    """Return the tables of a machine's file; for another text, a table with its name."""
    try:
        return tomllib.loads(text)
    except (TypeError, AttributeError, ValueError, RecursionError):
        return {"name": text}


def _is_table_list(part: Any) -> bool:
    """Return whether a part of a plan is a list with tables."""
    return isinstance(part, list) and any(isinstance(element, Mapping) for element in part)


def _difference_text(name: str, stored: Any, plan: Any) -> str:
    """Return the text of a difference between the store's plan and the run's."""
    texts = ["none" if plan_value is None else shorten(plan_value) for plan_value in (stored, plan)]
    name = shorten(name, bare=True, longest=2 * _LONG)
    if any(len(text) > _LONG for text in texts):
        return f"another {name}"
    return f"{name} {texts[0]}, not {texts[1]}"
