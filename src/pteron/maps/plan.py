"""What a store says it holds: it is resumed by the same plan, and no other's is mixed into it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pteron.errors import OutputError, shown

_LONG = 40


def expect_same(path: str | Path, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Refuse a store whose plan is another one.

    Parameters
    ----------
    path : str or Path
        The store.
    found, wanted : mapping
        Plain data, as JSON has them: what it says, and what it is to be continued with.

    Raises
    ------
    OutputError
        If they differ; the message says in what.
    """
    names = [name for name in {**wanted, **found} if found.get(name) != wanted.get(name)]
    if not names:
        return
    told = "; ".join(_told(name, found.get(name), wanted.get(name)) for name in names)
    raise OutputError(
        f"{path}: holds results of another plan ({told}); name another place, or remove it"
    )


def _told(name: str, found: Any, wanted: Any) -> str:
    texts = [shown(value) for value in (found, wanted)]
    if any(len(text) > _LONG for text in texts):
        return f"another {name}"
    return f"{name} {texts[0]}, not {texts[1]}"
