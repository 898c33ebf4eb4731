"""`publish`, the last line of each package's `__init__.py`: it lists the package's public names.

What the file imports for type checkers alone is imported at its first use: a program loads what it
calls, and no more.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Collection
from importlib import import_module
from types import FunctionType, ModuleType
from typing import Any

from pteron.renamed import former_name

_OTHERS = {"annotations", "TYPE_CHECKING"}
"""Names that an `__init__.py` imports for itself."""


class _Package(ModuleType):
    """A package in which a module does not hide the public function that it is named after."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (isinstance(value, ModuleType) and name in vars(self)["__all__"]):
            super().__setattr__(name, value)


def publish(package: str, *, checked: bool | Collection[str] = False) -> None:
    """List a package's public names, for completion and ``import *``.

    These are the names that the file imports or defines: those under ``if TYPE_CHECKING:`` are
    imported at their first use, the others at once. An import that hands a name on says so to
    readers and type checkers alike: ``import size as size``. A name with an underscore is the
    file's own.

    Parameters
    ----------
    package : str
        Its `__name__`.
    checked : bool or collection of str
        Whether the arguments of its functions are checked, or those of which.
    """
    module = sys.modules[package]
    names = vars(module)
    places = _places(names["__loader__"].get_source(package))
    own = (name for name in names.keys() - _OTHERS if not name.startswith("_"))
    listed = [name for name in own if not isinstance(names[name], ModuleType)]
    listed = names.setdefault("__all__", sorted({*listed, *places}))

    def public(name: str, value: Any) -> Any:
        if isinstance(value, FunctionType) and (checked is True or name in (checked or ())):
            from pteron.arguments import checking  # NumPy

            value = checking(value)
            # Pickles and doctests look for a function where it says that it is from.
            setattr(sys.modules[value.__module__], value.__name__, value)
        names[name] = value
        return value

    def __getattr__(name: str) -> Any:  # noqa: N807
        if name not in places:
            return former_name(package, name)
        place, called = places[name]
        if place == package:
            return public(name, import_module(f"{package}.{called}"))
        return public(name, getattr(import_module(place), called))

    for name in listed:
        if name in names:
            public(name, names[name])
    names["__getattr__"] = __getattr__
    names["__dir__"] = lambda: sorted([*listed, *({"__version__"} & names.keys())])
    module.__class__ = _Package


def _places(source: str) -> dict[str, tuple[str, str]]:
    """Return the module of each name that is imported for type checkers, and its name there."""
    return {
        alias.asname or alias.name: (line.module or "", alias.name)
        for block in ast.parse(source).body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for line in block.body
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }
