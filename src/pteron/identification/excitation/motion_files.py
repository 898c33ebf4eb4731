"""Files of an exciting motion: tables for a controller, and TOML files to describe their logs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pteron.atomic import write_files
from pteron.errors import OutputError
from pteron.identification.excitation.layout import MotionLayout
from pteron.identification.excitation.movement import Movement
from pteron.identification.logs import Description, find_description
from pteron.identification.logs.description_file import description_text
from pteron.tables import check_output, table_bytes

_ENDINGS = "-held-out", "-slow"
"""Endings of the files beside the motion's: cycles held out for validation, and slow passages."""


def motion_paths(path: str | Path, layout: MotionLayout | None = None) -> tuple[Path, Path, Path]:
    """Return the paths of a motion, held-out cycles and slow passages, if all can be written.

    Raises
    ------
    OutputError
        If they cannot: a folder is missing, an ending unknown, or the TOML file beside one is a
        folder or describes a machine.
    """
    dialect = None if layout is None else layout.dialect
    first = check_output(path, dialect)
    held_out, slow = (check_output(first.with_stem(first.stem + e), dialect) for e in _ENDINGS)
    for table in (first, held_out, slow):
        toml = table.with_suffix(".toml")
        if toml.is_dir():
            raise OutputError(f"{toml}: is a folder; name another file")
        if toml.is_file() and find_description(table) != toml:
            raise OutputError(f"{toml}: describes a machine, and is kept; name another file")
    return first, held_out, slow


def write_motions(
    motions: Mapping[Path, tuple[Movement, Description]], layout: MotionLayout, rate: float
) -> list[Path]:
    """Write motions and the descriptions of their logs, all of them or none.

    Each is sampled `rate` times a second.
    """
    files: dict[Path, bytes] = {}
    for path, (movement, description) in motions.items():
        files[path] = table_bytes(layout.frame(movement, rate), path, layout.dialect)
        files[path.with_suffix(".toml")] = description_text(description).encode()
    return write_files(files)
