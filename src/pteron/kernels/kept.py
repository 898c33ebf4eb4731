"""Programs (CasADi functions of a machine) kept on disk, to be read instead of built again.

Reading takes 1 ms, building 100 ms or more. A program's name on disk is a digest of its machine, of
the function and options asked for, and of the source of all that it depends on. A machine with a
leg from outside this package, whose source is not known, has its programs built at each start.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca

from pteron.kernels import cache
from pteron.kernels.kernel import Port

_PACKAGE = Path(__file__).parent.parent

EQUATIONS = ("bodies", "closures", "equations", "kernels", "legs", "manipulator", "platforms")
"""The packages that a program depends on, to the last bit."""


@dataclass(frozen=True)
class Program:
    """A named CasADi function of one state, with the names and shapes of its arguments (ports)."""

    name: str
    function: ca.Function
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]


def kept(key: tuple[Any, ...], build: Callable[[], Program]) -> Program:
    """Return the program of a key: the one on disk, or one that is built now, and then kept."""
    name = name_of("program", *key)
    text = None if name is None else cache.find_text(name)
    found = None if text is None else _read(text)
    if found is None:
        found = build()
        if name is not None:
            cache.keep_text(name, _written(found))
    return found


def name_of(*key: Any, sources: tuple[str, ...] = EQUATIONS) -> str | None:
    """Return the name under which the text of a key is kept, see `cache`; None for a foreign leg.

    It changes with the source of each of the packages `sources`.
    """
    told = _told(key)
    return None if told is None else cache.digest(told, _source(sources), ca.__version__)


def _read(text: str) -> Program | None:
    try:
        data = json.loads(text)
        ports = (
            tuple(
                Port(p["name"], tuple(p["shape"]), p["shared"], tuple(p["columns"])) for p in part
            )
            for part in (data["inputs"], data["outputs"])
        )
        return Program(data["name"], ca.Function.deserialize(data["function"]), *ports)
    except (ValueError, KeyError, TypeError, RuntimeError):
        return None


def _written(given: Program) -> str:
    ports = {
        name: [asdict(port) for port in part]
        for name, part in (("inputs", given.inputs), ("outputs", given.outputs))
    }
    return json.dumps({"name": given.name, "function": given.function.serialize(), **ports})


def _told(value: Any) -> str | None:
    """Return a text that differs for values that differ; None where there may be no such text."""
    if value is None or isinstance(value, bool | int | float | str):
        return repr(value)
    if isinstance(value, tuple):
        parts = [_told(part) for part in value]
        return None if None in parts else f"({', '.join(map(str, parts))})"
    kind = type(value)
    if not is_dataclass(value) or not kind.__module__.startswith("pteron."):
        return None
    parts = [_told(getattr(value, field.name)) for field in fields(value)]
    return None if None in parts else f"{kind.__module__}.{kind.__qualname__}{parts}"


@lru_cache
def _source(packages: tuple[str, ...]) -> str:
    total = hashlib.sha256()
    for path in sorted(file for name in packages for file in (_PACKAGE / name).rglob("*.py")):
        total.update(path.read_bytes())
    return total.hexdigest()
