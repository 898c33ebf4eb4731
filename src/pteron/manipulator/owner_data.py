"""`OwnerData`: the table `[owner]` of a machine's file, which Pteron keeps and does not read."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

from pteron.toml import raise_faults

_PLAIN = str | bool | int | float | datetime.date | datetime.time
"""Types of TOML's values; a datetime is a date."""


class OwnerData(Mapping[str, Any]):
    """Data of a machine's owner: a read-only mapping of what a TOML table can hold.

    It is no part of the machine: two machines that differ in it alone are equal. What it hands out
    are copies.

    Parameters
    ----------
    tables : mapping
        Strings, numbers, booleans, dates and times, in lists and tables too.

    Raises
    ------
    ModelError
        If it holds anything else; the message names each such key.

    Examples
    --------
    >>> from pteron.manipulator import OwnerData
    >>> OwnerData({"serial": "Q-07"})["serial"]
    'Q-07'
    """

    __slots__ = ("_tables",)

    def __init__(self, tables: Mapping[str, Any] = {}) -> None:
        raise_faults(list(_type_faults(tables, "owner")))
        self._tables = deepcopy(dict(tables))

    def __getitem__(self, key: str) -> Any:
        return deepcopy(self._tables[key])

    def __iter__(self) -> Iterator[str]:
        return iter(self._tables)

    def __len__(self) -> int:
        return len(self._tables)

    def __repr__(self) -> str:
        return f"OwnerData({self._tables!r})"


def _type_faults(content: object, place: str) -> Iterator[str]:
    """Yield a fault for each key in `content` whose value TOML cannot represent."""
    if isinstance(content, Mapping):
        for key, part in content.items():
            if isinstance(key, str):
                yield from _type_faults(part, f"{place}.{key}")
            else:
                yield f"{place}: the key {key!r} given, a string expected"
    elif isinstance(content, list | tuple):
        for i, part in enumerate(content, start=1):
            yield from _type_faults(part, f"{place}, item {i}")
    elif not isinstance(content, _PLAIN):
        yield (
            f"{place}: {type(content).__name__} given; a string, number, boolean, date, list or "
            "table expected"
        )
