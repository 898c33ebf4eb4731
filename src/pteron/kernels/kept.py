"""Programs (CasADi functions of a machine) and results kept on disk, to be read next time.

Reading takes 1 ms, building 100 ms or more. A name on disk is a digest of the machine, of what is
asked for, and of the source of all that it depends on. Of a machine with a leg from outside this
package, whose source is not known, nothing is kept.
"""

from __future__ import annotations

import hashlib
import json
import pickle
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Self, TypeVar

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.kernels import cache
from pteron.kernels.kernel import Port
from pteron.kernels.passes import optimised

_PACKAGE = Path(__file__).parent.parent

EQUATIONS = ("bodies", "closures", "equations", "kernels", "legs", "manipulator", "platforms")
"""The packages that a program depends on, to the last bit."""

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Program:
    """A named CasADi function of one state, with the names and shapes of its arguments (ports)."""

    name: str
    function: ca.Function
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]

    @classmethod
    def of(
        cls,
        name: str,
        symbols: Sequence[Expression],
        inputs: Sequence[Port],
        results: Sequence[Expression],
        outputs: Sequence[Port],
    ) -> Self:
        """Return the program of expressions of its inputs' symbols; ports name and shape both."""
        names = [port.name for port in inputs], [port.name for port in outputs]
        return cls(name, ca.Function(name, symbols, results, *names), (*inputs,), (*outputs,))

    @classmethod
    def of_named(
        cls,
        name: str,
        given: Mapping[str, Expression],
        found: Mapping[str, Expression],
        shared: Collection[str] = (),
    ) -> Self:
        """Return the same of expressions by name, a column as a vector, matrices by rows."""
        inputs = [Port(key, value.shape[:1], key in shared) for key, value in given.items()]
        outputs = [Port(key, shape_of(value)) for key, value in found.items()]
        dense = ca.cse([ca.densify(value).T for value in found.values()])
        return cls.of(name, list(given.values()), inputs, dense, outputs)

    @property
    def text(self) -> str:
        """The program as it is written on disk; equal programs have equal texts."""
        return _written(self)

    def optimised(self) -> Self:
        """Return the program after the passes that save operations."""
        return replace(self, function=optimised(self.function))


def shape_of(value: Expression) -> tuple[int, ...]:
    """Return the shape of an expression: a column is a vector, and of one element a number."""
    rows, columns = value.shape
    return (rows, columns) if columns > 1 else (rows,) if rows > 1 else ()


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


def kept_result(
    key: tuple[Any, ...],
    packages: tuple[str, ...],
    find: Callable[[], _Result],
    *,
    keeps: Callable[[_Result], bool] = lambda _: True,
) -> _Result:
    """Return the result of a key: the one on disk, or one that is found now, and then kept.

    It depends on the source of `packages`, or of modules at the top, and of all equations. It is
    pickled: the cache is the user's alone and holds code that is run. What `keeps` is false of is
    not kept.
    """
    name = name_of(*key, sources=(*EQUATIONS, *packages))
    text = None if name is None else cache.find_text(name)
    if text is not None:
        with suppress(Exception):
            found: _Result = pickle.loads(text.encode("latin-1"))
            return found
    found = find()
    if name is not None and keeps(found):
        cache.keep_text(name, pickle.dumps(found).decode("latin-1"))
    return found


def name_of(*key: Any, sources: tuple[str, ...] = EQUATIONS) -> str | None:
    """Return the name under which the text of a key is kept, see `cache`; None for a foreign leg.

    It changes with the source of each of the packages, or modules at the top, `sources`.
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


def _source(packages: tuple[str, ...]) -> str:
    return " ".join(_digest(name) for name in sorted(packages))


@lru_cache
def _digest(name: str) -> str:
    """Return a digest of the source of a package, or of a module, with its templates and data."""
    total, module = hashlib.sha256(), (_PACKAGE / name).with_suffix(".py")
    files = [module] if module.is_file() else sorted((_PACKAGE / name).rglob("*.*"))
    for path in files:
        if path.suffix in (".py", ".j2", ".toml"):
            total.update(path.read_bytes())
    return total.hexdigest()
