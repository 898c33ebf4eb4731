"""The TOML file beside a log: found, read and written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from pteron.atomic import write_text
from pteron.errors import DataError, shown
from pteron.identification.logs.description import Description
from pteron.toml import read_toml, table_keys, validated

_ABSENT = "no such file; it should describe a log"
_OF_A_MANIPULATOR = {"platform", "legs"}
_WHOLE = ("csv", "payload")
"""Tables that fill a value of their own."""


def find_description(log_path: str | Path) -> Path | None:
    """Return the TOML file beside a log, of the same stem, or None where there is none.

    A manipulator's file is no description of a log, whatever it is called.
    """
    path = Path(log_path).with_suffix(".toml")
    if not path.is_file():
        return None
    try:
        document = read_toml(path, DataError, _ABSENT)
    except DataError:
        return path  # what is wrong with it is told where it is read
    return None if document.keys() >= _OF_A_MANIPULATOR else path


def read_description(path: str | Path) -> Description:
    """Read the description of a log from a TOML file, in which every key is optional.

    Its tables: ``[csv]`` separator, decimal, encoding, header_lines; ``[time]`` column, unit or
    format; ``[joints]`` (``[sliders]`` in older files) columns, unit, angle_unit; ``[forces]``
    columns, unit, gains, limits; ``[pose]`` columns, length_unit, angle_unit; ``[payload]`` column,
    mass, center_of_mass or first_moment, inertia; ``[motion]`` period, start, end, assembly_mode;
    ``[drives]`` rotor_inertia, ratio.

    Raises
    ------
    DataError
        If there is no such file, or if it is not TOML, has unknown keys or values that cannot be;
        the message names each such key, and the valid ones.
    """
    source = shown(str(path), bare=True, longest=1000)
    document = read_toml(path, DataError, _ABSENT)
    if document.keys() >= _OF_A_MANIPULATOR:
        raise DataError(f"{source}: describes a manipulator; the description of a log was expected")
    if document.keys() >= {"joints", "sliders"}:
        raise DataError(f"{source}: [sliders] is the older name of [joints]; give one of them")
    tables, flat = table_keys(Description), dict[str, Any]()
    for key, entries in document.items():
        table = "joints" if key == "sliders" else key
        if table not in tables or not isinstance(entries, dict):
            flat[table] = entries
            continue
        for entry, value in entries.items():
            if table in _WHOLE and (table, entry) != ("payload", "column"):
                flat.setdefault(table, {})[entry] = value
            else:
                flat[f"{table}.{entry}"] = value
    return validated(Description, flat, source, DataError)


def write_description(description: Description, path: str | Path) -> Path:
    """Write a description to a TOML file that `read_description` reads back without loss.

    Raises
    ------
    OutputError
        If the file cannot be written; one that was there is left as it was.
    """
    return write_text(path, description_text(description))


def description_text(description: Description) -> str:
    """Return what `write_description` writes."""
    import tomlkit

    given = TypeAdapter(Description).dump_python(
        description, mode="json", by_alias=True, exclude_none=True
    )
    tables: dict[str, dict[str, Any]] = {}
    for key, value in given.items():
        table, _, entry = key.partition(".")
        tables.setdefault(table, {}).update({entry: value} if entry else value)
    document = tomlkit.document()
    document.add(tomlkit.comment("A log for Pteron: its columns, their units, what is known."))
    for name, entries in tables.items():
        document.add(name, tomlkit.item(entries))
    return tomlkit.dumps(document)
