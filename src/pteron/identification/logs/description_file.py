"""The TOML file beside a log that describes it: how it is found, read, written and completed."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from pteron.atomic import write_text
from pteron.errors import DataError, shorten
from pteron.identification.logs.description import Description
from pteron.legs.kind import ActuatedJoint
from pteron.toml import read_toml, table_keys, to_model

_ABSENT = "no such file; it should describe a log"
"""The message where there is no such file."""

_OF_A_MANIPULATOR = {"platform", "legs"}
"""Keys by which a file is known to describe a machine, not a log."""

_WHOLE = ("csv", "payload")
"""Tables of the file that become one value each of the description."""

_MOST = 8
"""Refusals of a log, at most, whose advice is followed in turn to complete its file."""


OF_FOLDER = "logs.toml"
"""Name of the description of all logs in a folder that have none of their own."""


def find_description(log_path: str | Path) -> Path | None:
    """Return the TOML file beside a log, of the same stem, else the folder's `logs.toml`, or None.

    A manipulator's file is no description of a log, whatever it is called.
    """
    beside = Path(log_path).with_suffix(".toml")
    return next(
        (path for path in (beside, beside.with_name(OF_FOLDER)) if _describes_log(path)), None
    )


def _describes_log(path: Path) -> bool:
    """Return whether a file exists and does not describe a manipulator."""
    if not path.is_file():
        return False
    try:
        document = read_toml(path, DataError, _ABSENT)
    except DataError:
        return True  # what is wrong with it is told where it is read
    return not document.keys() >= _OF_A_MANIPULATOR


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
    source = shorten(str(path), bare=True, longest=1000)
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
        for subkey, setting in entries.items():
            if table in _WHOLE and (table, subkey) != ("payload", "column"):
                flat.setdefault(table, {})[subkey] = setting
            else:
                flat[f"{table}.{subkey}"] = setting
    return to_model(Description, flat, source, DataError)


def write_description(description: Description, path: str | Path) -> Path:
    """Write a description to a TOML file that `read_description` reads back without loss.

    Raises
    ------
    OutputError
        If the file cannot be written; one that was there is left as it was.
    """
    return write_text(path, description_text(description))


def description_text(description: Description) -> str:
    """Return the text of the TOML file of a description."""
    import tomlkit

    tables: dict[str, dict[str, Any]] = {}
    for key, setting in _plain(description).items():
        table, _, subkey = key.partition(".")
        tables.setdefault(table, {}).update({subkey: setting} if subkey else setting)
    document = tomlkit.document()
    document.add(tomlkit.comment("A log for Pteron: its columns, their units, what is known."))
    for name, entries in tables.items():
        document.add(name, tomlkit.item(entries))
    return tomlkit.dumps(document)


def collect_undeclared(
    first: DataError,
    about: Description,
    opened: Callable[[Description], object],
    joint: ActuatedJoint,
) -> DataError:
    """Return one error that names all facts about a log that its description lacks.

    An error ends with the lines to add to the description. These are added, and the log is opened
    again by `opened`, until there is no error or one without such lines. Columns with unusual names
    get the unit of a `joint`, for the user to check.
    """
    source, reasons, error = "", [], first
    for _ in range(_MOST):
        text, _, lines = str(error).partition("\n")
        added = _tables(lines)
        # What may be the log of another machine is not to be declared away.
        if not added or "log of another machine" in text:
            break
        source, _, reason = text.partition(": ")
        reasons.append(re.split(r" \(found|; ", reason)[0].removesuffix(":"))
        about = _add_tables(about, added)
        try:
            opened(about)
        except DataError as next_one:
            error = next_one
            continue
        break
    if len(reasons) < 2:
        return first
    if about.joint_columns and not (about.joint_unit or about.joint_angle_unit):
        about = _add_tables(about, {"joints": {"unit": joint.unit}})
    if about.force_columns and not about.column_force_unit:
        about = _add_tables(about, {"forces": {"unit": joint.force_unit}})
    numbered = "; ".join(f"({i}) {reason}" for i, reason in enumerate(reasons, start=1))
    lines = description_text(about).partition("\n\n")[2]
    return DataError(
        f"{source}: {len(reasons)} things are not told: {numbered}. Check these lines, their "
        f"units too, and put them into its TOML file, or into {OF_FOLDER} for all logs of its "
        f"folder:\n{lines}"
    )


def _tables(lines: str) -> dict[str, Any]:
    """Return the TOML tables of an error message's last lines; empty if they are not TOML."""
    try:
        return tomllib.loads(lines)
    except tomllib.TOMLDecodeError:
        return {}


def _add_tables(about: Description, added: dict[str, Any]) -> Description:
    """Return a description with further tables."""
    tables = _plain(about)
    for table, entries in added.items():
        if table == "csv":
            tables["csv"] = tables.get("csv", {}) | entries
        else:
            tables |= {f"{table}.{key}": setting for key, setting in entries.items()}
    return to_model(Description, tables, "", DataError)


def _plain(about: Description) -> dict[str, Any]:
    """Return a description as plain data, with the keys of its file."""
    return dict(
        TypeAdapter(Description).dump_python(about, mode="json", by_alias=True, exclude_none=True)
    )
