"""The summary of a map of indices over poses: JSON data, rows for a pipe, a table for a person."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pteron.cli.pose_ranges import pose_text, span_text
from pteron.cli.terminal import percent, plain, show, table
from pteron.errors import DataError
from pteron.json_values import picked

if TYPE_CHECKING:
    import rich.table

    from pteron.maps import Map
    from pteron.workspace import ReachVolume

_ALIKE = 1e-9
"""Relative difference below which the best and the worst value are one."""

_AXIS = "name unit least greatest count"
"""Keys of an axis in the data."""

_SUMMARY = "best best_pose worst worst_pose mean median"
"""Keys of an index in the data."""


def map_data(
    found: Map, volume: ReachVolume | None, warnings: list[str], out: str | None
) -> dict[str, Any]:
    """Return the data of `--json`: the grid, the reach, its causes, and each index."""
    grid = found.grid
    return {
        "robot": found.robot,
        "held": grid.held,
        "varies": [picked(axis, _AXIS) for axis in grid.axes],
        "poses": grid.size,
        "in_reach": found.share,
        "causes": found.causes,
        "reach": volume and picked(volume, "box volume standard_error unit"),
        "indices": [_index_data(found, index.name) for index in found.indices],
        "warnings": warnings,
        **({"files": [out]} if out is not None else {}),
    }


def _index_data(found: Map, name: str) -> dict[str, Any]:
    from pteron.maps.map import ALL

    index = ALL[name]
    about = picked(index, "index=name title unit better")
    try:
        summary = found.summary(name)
    except DataError:
        undetermined = int(found.reachable.sum())
        return {
            **about,
            **dict.fromkeys(_SUMMARY.split()),
            "poses": 0,
            "undetermined": undetermined,
        }
    return about | picked(summary, _SUMMARY, "poses=count undetermined=infinite")


def map_rows(data: Mapping[str, Any]) -> Any:
    """Return a table of the indices, a row each."""
    import polars as pl

    from pteron.platforms.coordinates import COORDINATES

    names = sorted([*data["held"], *(a["name"] for a in data["varies"])], key=[*COORDINATES].index)
    rows = []
    for one in data["indices"]:
        row = {key: one[key] for key in ("index", "unit", "best", "worst", "mean", "median")}
        for side in ("best", "worst"):
            pose = one[f"{side}_pose"] or [None] * len(names)
            row |= {f"{side}_{name}": value for name, value in zip(names, pose, strict=True)}
        rows.append(row)
    return pl.DataFrame(rows, infer_schema_length=None)


def show_map(found: Map, volume: ReachVolume | None, data: Mapping[str, Any]) -> None:
    """Print for a person: the reach, what ends it, and each index."""
    from pteron.platforms.coordinates import are_angles, coordinate

    held = ", ".join(pose_text(name, value) for name, value in found.grid.held.items())
    lines: list[str | rich.table.Table] = [
        f"[bold]{plain(found.robot)}[/bold]{f' at {held}' if held else ''}"
    ]
    if volume is not None:
        names = [name for name in found.grid.coordinates if coordinate(name).unit == "m"]
        box = zip(names, *volume.box.tolist(), strict=True)
        spans = ", ".join(span_text(name, low, high) for name, low, high in box)
        noun = "area" if volume.unit == "m^2" else "volume"
        angles = {n: angle for n, angle in found.grid.held.items() if n not in names}
        at = ", ".join(pose_text(name, angle) for name, angle in angles.items())
        size = f"{noun} {volume.volume:.4g} {volume.unit}"
        lines.append(
            f"Reach{f' at {at}' if at else ''}: {spans}; {size} "
            f"(standard error {volume.standard_error:.1g})"
        )
    varying = ", ".join(span_text(a.name, a.least, a.greatest) for a in found.grid.axes)
    lines.append(f"Map: {varying}: {found.grid.size} poses, {percent(found.share)} in reach")
    if found.causes:
        told = sorted(found.causes.items(), key=lambda pair: -pair[1])
        lines.append("; ".join(f"{percent(share)} {text}" for text, share in told))
    made = table("index", "", "value", "where", numbers=("value",))
    for one in data["indices"]:
        unit = f" ({one['unit']})" if one["unit"] else ""
        named = plain(f"{one['index']}{unit}")
        if one["best"] is None:
            made.add_row(named, "", "-", "determined at no pose in reach")
            continue
        if abs(one["best"] - one["worst"]) <= _ALIKE * abs(one["best"]):
            made.add_row(named, "", f"{one['best']:.4g}", "everywhere in reach")
        else:
            for side in ("best", "worst"):
                pose = " ".join(f"{value + 0.0:.4g}" for value in one[f"{side}_pose"])
                made.add_row(named if side == "best" else "", side, f"{one[side]:.4g}", pose)
            for side in ("mean", "median"):
                made.add_row("", side, f"{one[side]:.4g}", "")
        if one["undetermined"]:
            share = one["undetermined"] / found.grid.size
            made.add_row("", "singular", "-", f"{percent(share)} of the poses")
    made.caption = f"Where: {' '.join(found.grid.coordinates)}, m" + (
        " and rad" if are_angles(found.grid.coordinates).any() else ""
    )
    show(*lines, made)
