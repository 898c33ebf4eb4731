"""`publish`, the last line of each package's `__init__.py`: it lists the package's public names.

These are the names that the file imports or defines, and others that are imported at first use.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping, Sequence
from importlib import import_module
from types import ModuleType
from typing import Any

from pteron.arguments import check_arguments
from pteron.renamed import former_name

_OTHERS = {"annotations", "TYPE_CHECKING"}
"""Names that an `__init__.py` imports for itself."""


def publish(
    package: str,
    *,
    modules: Sequence[str] = (),
    later: Mapping[str, Sequence[str]] | None = None,
    checked: bool | Collection[str] = False,
    classes: Collection[str] = (),
) -> None:
    """List a package's public names, for completion and ``import *``.

    An import that hands a name on says so to readers and type checkers alike: ``import size as
    size``. A name with an underscore is the file's own.

    Parameters
    ----------
    package : str
        Its `__name__`.
    modules : sequence of str
        Modules inside it that are public; they are imported at their first use.
    later : mapping of str to sequence of str, optional
        Names that are imported at their first use, by the module that has them.
    checked : bool or collection of str
        Whether the arguments of its functions are checked, or those of which.
    classes : collection of str
        Classes whose arguments are checked.
    """
    names = vars(sys.modules[package])
    places = {name: place for place, several in (later or {}).items() for name in several}
    own = (name for name in names.keys() - _OTHERS if not name.startswith("_"))
    listed = [name for name in own if not isinstance(names[name], ModuleType)]
    listed = names.setdefault("__all__", sorted([*listed, *modules, *places]))

    def __getattr__(name: str) -> Any:  # noqa: N807
        if name in modules:
            return import_module(f"{package}.{name}")
        if name in places:
            return getattr(import_module(places[name]), name)
        return former_name(package, name)

    names["__getattr__"] = __getattr__
    names["__dir__"] = lambda: sorted([*listed, *({"__version__"} & names.keys())])
    if checked or classes:
        check_arguments(package, None if checked is True else checked or (), classes=classes)
