"""The summary of a map of indices over poses: JSON data, rows for a pipe, a table for a person."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pteron.cli.pose_ranges import pose_text, span_text
from pteron.cli.terminal import percent, plain, show, significant, table
from pteron.errors import DataError
from pteron.json_values import fields_as_json, json_fields
from pteron.tolerances import ROUNDING

if TYPE_CHECKING:
    import rich.table

    from pteron.maps import Map
    from pteron.workspace import ReachVolume

_AXIS = "name unit least greatest count"
"""Keys of an axis in the data."""

_MARGIN_TITLE = "least distance of a leg from the end of its reach, or of a joint from its limit"
"""The meaning of the default index, longer than on pictures."""

_SUMMARY = "best best_pose worst worst_pose mean median"
"""Keys of an index in the data."""


def map_data(
    index_map: Map, volume: ReachVolume | None, warnings: list[str], out: str | None
) -> dict[str, Any]:
    """Return the data of `--json`: the grid, the reach, its causes, and each index."""
    grid = index_map.grid
    return {
        "robot": index_map.robot,
        "held": grid.fixed_coordinates,
        "varies": [fields_as_json(axis, _AXIS) for axis in grid.axes],
        "poses": grid.size,
        "in_reach": index_map.share,
        "causes": index_map.causes,
        "reach": volume
        and json_fields(
            box=volume.box,
            volume=volume.volume,
            standard_error=volume.standard_error,
            unit=volume.unit,
        ),
        "indices": [_index_data(index_map, index.name) for index in index_map.indices],
        "warnings": warnings,
        **({"files": [out]} if out is not None else {}),
    }


def _index_data(index_map: Map, name: str) -> dict[str, Any]:
    """Return an index's statistics over a map as JSON data; null where it is finite at no pose."""
    index = index_map.index(name)
    about = json_fields(index=index.name, title=index.title, unit=index.unit, better=index.better)
    try:
        summary = index_map.statistics(name)
    except DataError:
        undetermined = int(index_map.reachable.sum())
        return {
            **about,
            **dict.fromkeys(_SUMMARY.split()),
            "poses": 0,
            "undetermined": undetermined,
        }
    return about | fields_as_json(summary, _SUMMARY, "poses=count undetermined=infinite")


def map_rows(record: Mapping[str, Any]) -> Any:
    """Return the JSON data of a map as a table with a row for each index."""
    import polars as pl

    from pteron.platforms.coordinates import COORDINATES

    varied = (axis["name"] for axis in record["varies"])
    names = sorted([*record["held"], *varied], key=[*COORDINATES].index)
    rows = []
    for index in record["indices"]:
        row = {key: index[key] for key in ("index", "unit", "best", "worst", "mean", "median")}
        for side in ("best", "worst"):
            pose = index[f"{side}_pose"] or [None] * len(names)
            row |= {f"{side}_{name}": q for name, q in zip(names, pose, strict=True)}
        rows.append(row)
    return pl.DataFrame(rows, infer_schema_length=None)


def show_map(index_map: Map, volume: ReachVolume | None, record: Mapping[str, Any]) -> None:
    """Print for a person: the reach, what ends it, and each index."""
    from pteron.platforms.coordinates import are_angles, coordinate

    fixed = index_map.grid.fixed_coordinates
    constants = ", ".join(pose_text(name, coordinate) for name, coordinate in fixed.items())
    lines: list[str | rich.table.Table] = [
        f"[bold]{plain(index_map.robot)}[/bold]{f' at {constants}' if constants else ''}"
    ]
    if volume is not None:
        names = [name for name in index_map.grid.coordinates if coordinate(name).unit == "m"]
        box = zip(names, *volume.box.tolist(), strict=True)
        spans = ", ".join(span_text(name, low, high) for name, low, high in box)
        noun = "area" if volume.unit == "m^2" else "volume"
        angles = {n: angle for n, angle in fixed.items() if n not in names}
        at = ", ".join(pose_text(name, angle) for name, angle in angles.items())
        size = f"{noun} {volume.volume:.3g} {volume.unit}"
        lines.append(
            f"Workspace{f' at {at}' if at else ''}: {spans}; {size} "
            f"(standard error {volume.standard_error:.1g} {volume.unit})"
        )
    varying = ", ".join(span_text(a.name, a.least, a.greatest) for a in index_map.grid.axes)
    lines.append(
        f"Map: {varying}: {index_map.grid.size} poses, {percent(index_map.share)} in reach"
    )
    if index_map.causes:
        causes = sorted(index_map.causes.items(), key=lambda pair: -pair[1])
        text = ", ".join(f"{percent(share)} {text}" for text, share in causes)
        lines.append(f"The other poses: {text}")
    coordinates = index_map.grid.coordinates
    units = "m and rad" if are_angles(coordinates).any() else "m"
    where = f"at {' '.join(coordinates)} ({units})"
    index_table = table("index", "", "value", where, numbers=("value",))
    for index in record["indices"]:
        unit = f" ({index['unit']})" if index["unit"] else ""
        named = plain(f"{index['index']}{unit}")
        if index["best"] is None:
            index_table.add_row(named, "", "-", "no pose in reach has a value")
            continue
        if abs(index["best"] - index["worst"]) <= ROUNDING * abs(index["best"]):
            index_table.add_row(named, "", significant(index["best"]), "every pose in reach")
        else:
            for side in ("best", "worst"):
                pose = " ".join(f"{round(v, 4) + 0.0:.3g}" for v in index[f"{side}_pose"])
                first = named if side == "best" else ""
                index_table.add_row(first, side, significant(index[side]), pose)
            for side in ("mean", "median"):
                index_table.add_row("", side, significant(index[side]), "")
        if index["undetermined"]:
            share = index["undetermined"] / index_map.grid.size
            index_table.add_row("", "singular", "-", f"{percent(share)} of the poses")
    better = {"less": "smaller is better", "more": "larger is better"}
    titles = {"margin": _MARGIN_TITLE}
    legend = (
        f"{i['index']}: {titles.get(i['index'], i['title'])}, {better[i['better']]}"
        for i in record["indices"]
    )
    show(*lines, index_table, *map(plain, legend))
