"""`publish`, the last line of each package's `__init__.py`: it lists the package's public names.

The names of the package's stub, `__init__.pyi`, are imported at their first use: a program loads
what it calls, and no more.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Collection, Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import PurePath
from types import FunctionType, ModuleType
from typing import Any

from pteron.renamed import former_name

_OTHERS = {"annotations"}
"""Names that an `__init__.py` imports for itself."""


class _Package(ModuleType):
    """A package in which a module does not shadow the public function of the same name."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (isinstance(value, ModuleType) and name in vars(self)["__all__"]):
            super().__setattr__(name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to pickle the package module: by importing it by name."""
        return import_module, (self.__name__,)


def publish(
    package: str,
    *,
    checked: bool | Collection[str] = False,
    extras: Mapping[str, str] | None = None,
) -> None:
    """Define a package's public names, for completion and ``import *``.

    Public are the names that the file imports or defines, and those that its stub `__init__.pyi`
    imports, which are imported at their first use. Imports of names to be published have the form
    ``import size as size``, which readers and type checkers understand. Names with an underscore
    are private.

    Parameters
    ----------
    package : str
        Its `__name__`.
    checked : bool or collection of str
        Whether the arguments of its functions are checked, or those of which.
    extras : mapping of str to str, optional
        Names that need a module of an extra, and that module: without it they are not listed.
    """
    module = sys.modules[package]
    names = vars(module)
    places = _places(names)
    extras = extras or {}
    lacking = {name for name, needed in extras.items() if find_spec(needed) is None}
    own = (name for name in names.keys() - _OTHERS if not name.startswith("_"))
    listed = [name for name in own if not isinstance(names[name], ModuleType)]
    listed = names.setdefault("__all__", sorted({*listed, *places} - lacking))

    def public(name: str, value: Any) -> Any:
        """Publish a value under a name and return it; functions get argument checks if asked."""
        if isinstance(value, FunctionType) and (checked is True or name in (checked or ())):
            from pteron.arguments import with_checked_arguments  # NumPy

            value = with_checked_arguments(value)
            # Pickles and doctests look for a function where it says that it is from.
            setattr(sys.modules[value.__module__], value.__name__, value)
        names[name] = value
        return value

    def __getattr__(name: str) -> Any:  # noqa: N807
        if name not in places:
            return former_name(package, name)
        place, called = places[name]
        if place == package:
            try:
                return public(name, import_module(f"{package}.{called}"))
            except ImportError as error:
                if name not in extras:
                    raise
                raise AttributeError(f"{package}.{name}: {error}") from error
        return public(name, getattr(import_module(place), called))

    for name in listed:
        if name in names:
            public(name, names[name])
    names["__getattr__"] = __getattr__
    names["__dir__"] = lambda: sorted([*listed, *({"__version__"} & names.keys())])
    module.__class__ = _Package


def _places(names: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    """Return (module, original name) of each name that a package's stub imports."""
    stub = PurePath(names["__file__"]).with_suffix(".pyi")
    try:
        text = names["__loader__"].get_data(str(stub))
    except OSError:  # it imports all of its names at once
        return {}
    imports = (line for line in ast.parse(text).body if isinstance(line, ast.ImportFrom))
    return {
        alias.asname or alias.name: (str(line.module), alias.name)
        for line in imports
        for alias in line.names
    }
