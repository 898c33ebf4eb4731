"""Write the tables of keys into docs/robot-file.md, from what the keys' declarations say.

A table stands between `<!-- keys of NAME -->` and `<!-- end -->`; a test keeps them as this script
writes them.
"""

from __future__ import annotations

import re
from pathlib import Path

from pteron.bodies.tables import BarTable, GearedTable, PlanarBody, TomlTable
from pteron.legs import KINDS
from pteron.manipulator.leg_tables import leg_table
from pteron.manipulator.tables import (
    ConeTable,
    DistributionTable,
    DriveTable,
    ElasticTable,
    HomeTable,
    LuGreTable,
    MachineTable,
    PlatformTable,
    RadiiTable,
    ReadingTable,
    ScrewTable,
    StribeckTable,
    TiltingTable,
    ToolTable,
    WaveTable,
    WindingTable,
)

TABLES: dict[str, type[TomlTable]] = {
    "the machine": MachineTable,
    "radii": RadiiTable,
    "tools": ToolTable,
    "home": HomeTable,
    "distribution": DistributionTable,
    "platform": PlatformTable,
    "a platform that tilts": TiltingTable,
    "bars": BarTable,
    "geared": GearedTable,
    "a body": PlanarBody,
    "a cone": ConeTable,
    "a drive": DriveTable,
    "stribeck": StribeckTable,
    "lugre": LuGreTable,
    "elastic": ElasticTable,
    "winding": WindingTable,
    "screw": ScrewTable,
    "a wave": WaveTable,
    "reading": ReadingTable,
    **{name: leg_table(kind) for name, kind in KINDS.items()},
}
"""Subjects of the page's tables; those of legs by their type."""

_MARKED = re.compile(r"(<!-- keys of ([^>]*) -->\n).*?(<!-- end -->)", re.DOTALL)


def key_table(model: type[TomlTable]) -> str:
    """Return the keys of a table of the file in Markdown, what they are and their defaults."""
    lines = ["| key | what it is | default |", "| --- | --- | --- |"]
    for key, field in model.model_fields.items():
        default = "" if field.is_required() else "none"
        if field.default is not None and not field.is_required():
            value = field.default
            shown = list(value) if isinstance(value, tuple) else value
            default = f"`{str(shown).lower() if isinstance(shown, bool) else shown}`"
        about = (field.description or "a table of its own").replace("|", "\\|")
        lines.append(f"| `{key}` | {about} | {default} |")
    return "\n".join(lines) + "\n"


def filled(page: str) -> str:
    """Return the page with every table as the declarations have it."""
    return _MARKED.sub(lambda found: f"{found[1]}{key_table(TABLES[found[2]])}{found[3]}", page)


def write(page: Path) -> None:
    """Write the tables into the page."""
    text = page.read_text(encoding="utf-8")
    if filled(text) != text:
        page.write_text(filled(text), encoding="utf-8")
