"""The TOML text of a machine, as a string, on request with comments that explain every key."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any, get_args

import tomlkit
from pydantic.fields import FieldInfo

from pteron.bodies.tables import PlanarBody, TomlTable
from pteron.errors import ModelError
from pteron.legs import LegKind
from pteron.legs.installed import kind_named, kind_names
from pteron.manipulator.leg_tables import leg_table
from pteron.manipulator.tables import (
    DistributionTable,
    HomeTable,
    MachineTable,
    TemplateTable,
    platform_table,
)

_WIDTH = 110
"""Width of comments that have lines of their own."""

_COLUMN = 46
"""The last column in which comments begin; those of longer lines stand above them."""

_UNITS = "SI units: m, kg, kg m, kg m^2, m/s^2, rad."

_CONVENTIONS = (
    f"{_UNITS} Vectors are in the base frame where nothing else is said; directions have length 1.",
    "A line #key = value may be left out: it shows the key's default, or an example.",
)


def robot_text(
    document: Mapping[str, Any], *, explained: bool = False, about: Sequence[str] = ()
) -> str:
    """Return the TOML text of a machine's file from its tables, with comments if `explained`.

    With `explained`, comments describe every key, also absent ones; for legs of one kind only at
    the first. `about` are comments at the top of the file.
    """
    head = [*about, *([*_CONVENTIONS, _bodies()] if explained else [f"For Pteron. {_UNITS}"])]
    lines = [f"# {line}" for text in head for line in wrap(text, _WIDTH - 2)]
    machine_keys = {
        k: content
        for k, content in document.items()
        if k not in ("home", "distribution", "template", "owner", "platform", "legs")
    }
    lines += ["", *_block("", MachineTable, machine_keys, explained)]
    for name, table in (
        ("home", HomeTable),
        ("distribution", DistributionTable),
        ("template", TemplateTable),
    ):
        if name in document:
            lines += ["", *_block(name, table, document[name], explained)]
    if "owner" in document:
        lines += ["", tomlkit.dumps({"owner": document["owner"]}).rstrip()]
    carried = document["platform"]
    model = platform_table(carried["motion"])
    lines += ["", *_block("platform", model, carried, explained)]
    kinds_explained: set[str] = set()
    for i, leg in enumerate(document["legs"], start=1):
        kind = leg["type"]
        heading, *leg_lines = _block(
            "[legs]", leg_table(_kind_of(kind)), leg, explained and kind not in kinds_explained
        )
        lines += ["", f"{heading} # {i}", *leg_lines]
        kinds_explained.add(kind)
    return "\n".join(lines) + "\n"


def _kind_of(name: str) -> type[LegKind]:
    """Return the class of a kind of leg by its name; raise if it is not installed."""
    kind = kind_named(name)
    if kind is None:
        raise ModelError(
            f"type: no kind of leg {name!r} is installed as an entry point of the group "
            f"pteron.legs; those that are: {', '.join(kind_names())}"
        )
    return kind


def _bodies() -> str:
    """Return a comment that lists the keys of a planar body with their descriptions."""
    fields = PlanarBody.model_fields.items()
    return f"A body's keys: {'; '.join(f'{key}, {field.description}' for key, field in fields)}."


def _block(
    name: str, model: type[TomlTable], table: Mapping[str, Any], explained: bool
) -> list[str]:
    """Return the TOML lines of the table `name`, and of the lists of tables in it."""
    fields, lines, inner = _fields_of(model, table), [f"[{name}]"] if name else [], []
    entries = []
    for key, content in table.items():
        if isinstance(content, list) and content and isinstance(content[0], Mapping):
            part = get_args(fields[key].annotation)[0]
            for subtable in content:
                inner += [
                    "",
                    *_block(f"[{f'{name}.' * bool(name)}{key}]", part, subtable, explained),
                ]
        else:
            entries.append((f"{key} = {_toml(content)}", fields.get(key)))
    if explained:
        entries += [
            (f"#{key} = {_toml(_example(field, table))}", field)
            for key, field in fields.items()
            if key not in table and (field.examples or field.default is not None)
            if not field.is_required()
        ]
        return [*lines, *_comment_lines(entries), *inner]
    return [*lines, *(text for text, _ in entries), *inner]


def _fields_of(model: type[TomlTable], table: Mapping[str, Any]) -> dict[str, FieldInfo]:
    """Return the fields of `model` by key, by the name that `table` has for it."""
    fields = {}
    for key, field in model.model_fields.items():
        names = getattr(field.validation_alias, "choices", [key])
        fields[next((name for name in names if name in table), key)] = field
    return fields


def _example(field: FieldInfo, table: Mapping[str, Any]) -> Any:
    """Return an example value for a key that is absent from a table."""
    like = field.json_schema_extra
    if isinstance(like, Mapping) and like["like"] in table:
        return table[str(like["like"])]
    return field.examples[0] if field.examples else field.default


def _comment_lines(entries: list[tuple[str, FieldInfo | None]]) -> list[str]:
    """Return TOML lines with comments on their keys: behind short lines, above long ones."""
    lines = []
    column = max((len(text) for text, _ in entries if len(text) <= _COLUMN), default=0)
    for text, field in entries:
        about = field.description or "" if field is not None else ""
        if len(text) > column:
            lines += [*(f"# {line}" for line in wrap(about, _WIDTH - 2)), text]
            continue
        first, *further_lines = wrap(about, _WIDTH - column - 4) or [""]
        lines += [
            f"{text:{column}}  # {first}",
            *(f"{'':{column}}  # {line}" for line in further_lines),
        ]
    return lines


def _toml(content: Any) -> str:
    """Return a value as TOML text on one line."""
    if isinstance(content, Mapping):
        return "{ " + ", ".join(f"{key} = {_toml(part)}" for key, part in content.items()) + " }"
    if isinstance(content, Sequence) and not isinstance(content, str):
        return f"[{', '.join(map(_toml, content))}]"
    return str(tomlkit.item(content).as_string())
