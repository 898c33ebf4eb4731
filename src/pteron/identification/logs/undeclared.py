"""All that a log's description lacks, told at once: lines for the TOML file beside it."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from typing import Any

from pydantic import TypeAdapter

from pteron.errors import DataError
from pteron.identification.logs.description import Description
from pteron.identification.logs.description_file import description_text
from pteron.legs.kind import ActuatedJoint
from pteron.toml import validated

_MOST = 8
"""Refusals that are gone through, at most."""


def told_at_once(
    first: DataError,
    about: Description,
    opened: Callable[[Description], object],
    joint: ActuatedJoint,
) -> DataError:
    """Return one error for all that is undeclared about a log.

    A refusal ends in the lines that would help. They are taken for granted, and the log is `opened`
    with them once more, until nothing is refused or a refusal has no such lines. Columns that are
    called as nobody else calls them get the unit of a `joint`, for the user to check.
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
        about = _with(about, added)
        try:
            opened(about)
        except DataError as next_one:
            error = next_one
            continue
        break
    if len(reasons) < 2:
        return first
    if about.joint_columns and not (about.joint_unit or about.joint_angle_unit):
        about = _with(about, {"joints": {"unit": joint.unit}})
    if about.force_columns and not about.column_force_unit:
        about = _with(about, {"forces": {"unit": joint.force_unit}})
    numbered = "; ".join(f"({i}) {reason}" for i, reason in enumerate(reasons, start=1))
    lines = description_text(about).partition("\n\n")[2]
    return DataError(
        f"{source}: {len(reasons)} things are not told: {numbered}. Check these lines, their "
        f"units too, and put them into its TOML file:\n{lines}"
    )


def _tables(lines: str) -> dict[str, Any]:
    """Return the tables that a refusal ends in; none if it ends otherwise."""
    try:
        return tomllib.loads(lines)
    except tomllib.TOMLDecodeError:
        return {}


def _with(about: Description, added: dict[str, Any]) -> Description:
    """Return a description with more tables, as its file has them."""
    whole = TypeAdapter(Description).dump_python(
        about, mode="json", by_alias=True, exclude_none=True
    )
    for table, entries in added.items():
        if table == "csv":
            whole["csv"] = whole.get("csv", {}) | entries
        else:
            whole |= {f"{table}.{key}": value for key, value in entries.items()}
    return validated(Description, whole, "", DataError)
