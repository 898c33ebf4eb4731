"""The cache on disk of programs (CasADi functions of a machine) and results.

Reading takes 1 ms, building 100 ms or more. A name on disk is a digest of the machine, of the
requested function, and of the source that it depends on. Machines with a leg from outside this
package, whose source is unknown, are not cached.
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
from pteron.kernels.passes import optimise_function

_PACKAGE = Path(__file__).parent.parent

EQUATIONS = (
    *("bodies", "closures", "equations", "kernels", "legs", "manipulator", "platforms"),
    "tolerances",
)
"""The packages and modules that a program depends on, to the last bit."""

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Program:
    """A named CasADi function of one state, with the names and shapes of its arguments (ports)."""

    name: str
    function: ca.Function
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]

    @classmethod
    def from_expressions(
        cls,
        name: str,
        symbols: Sequence[Expression],
        inputs: Sequence[Port],
        results: Sequence[Expression],
        outputs: Sequence[Port],
    ) -> Self:
        """Return the program of CasADi expressions, with named and shaped inputs and outputs."""
        names = [port.name for port in inputs], [port.name for port in outputs]
        return cls(name, ca.Function(name, symbols, results, *names), (*inputs,), (*outputs,))

    @classmethod
    def from_named_expressions(
        cls,
        name: str,
        given: Mapping[str, Expression],
        found: Mapping[str, Expression],
        shared: Collection[str] = (),
    ) -> Self:
        """Return the program of named expressions; columns become vectors, matrices row-major."""
        inputs = [Port(key, element.shape[:1], key in shared) for key, element in given.items()]
        outputs = [Port(key, shape_of(element)) for key, element in found.items()]
        dense = ca.cse([ca.densify(element).T for element in found.values()])
        return cls.from_expressions(name, list(given.values()), inputs, dense, outputs)

    @property
    def text(self) -> str:
        """The program serialised as text; equal programs have equal texts."""
        return _serialise_program(self)

    def optimise(self) -> Self:
        """Return the program with an equal function of fewer operations."""
        return replace(self, function=optimise_function(self.function))


def shape_of(element: Expression) -> tuple[int, ...]:
    """Return an expression's array shape: () for a scalar, (k,) for a column, else two numbers."""
    rows, columns = element.shape
    return (rows, columns) if columns > 1 else () if rows == 1 else (rows,)


def cached_program(key: tuple[Any, ...], build: Callable[[], Program]) -> Program:
    """Return the program stored on disk under a key; build and store it if absent."""
    name = name_of("program", *key)
    text = None if name is None else cache.find_text(name)
    program = None if text is None else _parse_program(text)
    if program is None:
        program = build()
        if name is not None:
            cache.store_text(name, _serialise_program(program))
    return program


def cached_result(
    key: tuple[Any, ...],
    packages: tuple[str, ...],
    find: Callable[[], _Result],
    *,
    keeps: Callable[[_Result], bool] = lambda _: True,
) -> _Result:
    """Return the result stored on disk under a key; compute it by `find` and store it if absent.

    The key is complemented by the sources of `packages` (or top-level modules) and of all
    equations. Results are pickled: the cache is private to the user and holds executable code.
    Results for which `keeps` is false are not stored.
    """
    name = name_of(*key, sources=(*EQUATIONS, *packages))
    text = None if name is None else cache.find_text(name)
    if text is not None:
        with suppress(Exception):
            computed: _Result = pickle.loads(text.encode("latin-1"))
            return computed
    computed = find()
    if name is not None and keeps(computed):
        cache.store_text(name, pickle.dumps(computed).decode("latin-1"))
    return computed


def is_stored(key: tuple[Any, ...], packages: tuple[str, ...]) -> bool:
    """Return whether `cached_result` has a result on disk under this key."""
    name = name_of(*key, sources=(*EQUATIONS, *packages))
    return name is not None and cache.find_text(name) is not None


def name_of(*key: Any, sources: tuple[str, ...] = EQUATIONS) -> str | None:
    """Return the file name of a cache key, with a digest of sources; None if it has none.

    The name changes with the sources of the packages, or top-level modules, in `sources`.
    """
    canonical_key = _canonical_key(key)
    return (
        None
        if canonical_key is None
        else cache.digest(canonical_key, _source(sources), ca.__version__)
    )


def _parse_program(text: str) -> Program | None:
    """Return the program from its cached text; None if the text is not valid."""
    try:
        record = json.loads(text)
        ports = (
            tuple(
                Port(p["name"], tuple(p["shape"]), p["shared"], tuple(p["columns"])) for p in part
            )
            for part in (record["inputs"], record["outputs"])
        )
        return Program(record["name"], ca.Function.deserialize(record["function"]), *ports)
    except (ValueError, KeyError, TypeError, RuntimeError):
        return None


def _serialise_program(program: Program) -> str:
    """Return a program as JSON text for the cache."""
    ports = {
        name: [asdict(port) for port in part]
        for name, part in (("inputs", program.inputs), ("outputs", program.outputs))
    }
    return json.dumps({"name": program.name, "function": program.function.serialize(), **ports})


def _canonical_key(part_: Any) -> str | None:
    """Return a value as canonical text for a cache key; None if it has none (a foreign leg)."""
    if part_ is None or isinstance(part_, bool | int | float | str):
        return repr(part_)
    if isinstance(part_, tuple):
        parts = [_canonical_key(part) for part in part_]
        return None if None in parts else f"({', '.join(map(str, parts))})"
    kind = type(part_)
    if not is_dataclass(part_) or not kind.__module__.startswith("pteron."):
        return None
    compared = (field.name for field in fields(part_) if field.compare)
    parts = [_canonical_key(getattr(part_, name)) for name in compared]
    return None if None in parts else f"{kind.__module__}.{kind.__qualname__}{parts}"


def _source(packages: tuple[str, ...]) -> str:
    """Return the digests of the packages' source files, joined in a text."""
    return " ".join(_digest(name) for name in sorted(packages))


@lru_cache
def _digest(name: str) -> str:
    """Return the SHA-256 digest of the source files of a package or module."""
    total, module = hashlib.sha256(), (_PACKAGE / name).with_suffix(".py")
    files = [module] if module.is_file() else sorted((_PACKAGE / name).rglob("*.*"))
    for path in files:
        if path.suffix in (".py", ".j2", ".toml"):
            total.update(path.read_bytes())
    return total.hexdigest()
