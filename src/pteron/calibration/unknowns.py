"""The choice of a calibration's unknowns, and the tolerances that are assumed of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import get_args

from pteron.calibration.guess import Unknown, UnknownBlock, number_unknowns
from pteron.calibration.measurements import TOOL, Measurements
from pteron.equations.variations import AXIAL, Group, axial_variations, variations
from pteron.errors import DataError
from pteron.manipulator import Manipulator

GROUPS: tuple[str, ...] = tuple(group for group in get_args(Group) if group not in AXIAL)
"""The groups of unknowns that are free by default: `tool` only with positions or heights."""

TOLERANCES: dict[str, float] = {
    "lengths": 1e-3,
    "points": 1e-3,
    "directions": 0.0035,
    "zeros": 2e-3,
    "zeros, rad": 0.0087,
    "scales": 1e-3,
    "tool": 1e-3,
    "radius": 1e-3,
    "angles": 0.0035,
}
"""Ordinary tolerances, as standard deviations about the drawing: 1 mm, 0.2 degrees; zeros of 2 mm
and 0.5 degrees; 0.1 % of scale."""

_WIDE = 10.0
"""Tolerance of frames, marks, planes and anchors that are not known, m or rad: next to none."""


def blocks_of(
    robot: Manipulator,
    measured: Measurements,
    free: Sequence[str] | None = None,
    prior: Mapping[str, float] | None = None,
) -> tuple[UnknownBlock, ...]:
    """Return the unknowns of a calibration, in blocks.

    Parameters
    ----------
    robot : Manipulator
        The machine as drawn.
    measured : Measurements
        What was measured; marks, planes, anchors and a frame that are not known are sought too.
    free : sequence of str, optional
        Groups, or names of single values, or `radius` and `angles`, the places of the legs' guide
        points about the platform's axis; by default `GROUPS`, without `tool` where neither a
        position nor a height is measured.
    prior : mapping, optional
        Standard deviations by group or by name, in place of ordinary tolerances; inf: none.

    Raises
    ------
    DataError
        If a name is none of the machine's.
    """
    tolerances = dict(prior or {})
    placed = {"position", "height"} & set(measured.kinds)
    names_free = [g for g in GROUPS if g != "tool" or placed] if free is None else list(free)

    def unknown(name: str, group: str, unit: str) -> Unknown:
        """Return an unknown with its tolerance, by its name or its group, else by default."""
        where = f"{group}, rad" if group == "zeros" and unit == "rad" else group
        tolerance = tolerances.get(
            name, tolerances.get(where, tolerances.get(group, TOLERANCES[where]))
        )
        return Unknown(name, group, unit, float(tolerance))

    def free_indices(unknowns: Sequence[Unknown]) -> tuple[int, ...]:
        """Return the indices of the unknowns that are free by their group's name or their name."""
        return tuple(
            i for i, u in enumerate(unknowns) if u.group in names_free or u.name in names_free
        )

    varying = (*variations(robot), *axial_variations(robot))
    geometry = [unknown(v.name, v.group, v.unit) for v in varying]
    joints = list(enumerate((leg.joint for leg in robot.legs), start=1))
    zeros = [unknown(f"zeros[{i}]", "zeros", joint.unit) for i, joint in joints]
    scales = [unknown(f"scales[{i}]", "scales", "") for i, _ in joints]
    names = {u.name for u in (*geometry, *zeros, *scales)}
    known = {*GROUPS, *AXIAL, *names, "zeros, rad"}
    wrong = [name for name in (*names_free, *tolerances) if name not in known]
    if wrong:
        raise DataError(
            f"free, prior: {', '.join(map(repr, wrong))}: no group or value of this machine; "
            f"groups are {', '.join((*GROUPS, *AXIAL))}, values like {varying[0].name}"
        )
    for name, tolerance in tolerances.items():
        if not tolerance > 0.0:
            raise DataError(f"prior: {name} = {tolerance:g}: a standard deviation above 0 expected")
    blocks: list[UnknownBlock] = []
    if at := free_indices(geometry):
        free_geometry = tuple(geometry[i] for i in at)
        blocks.append(
            UnknownBlock("geometry", "", free_geometry, changes=tuple(varying[i] for i in at))
        )
    for kind, unknowns in (("zeros", zeros), ("scales", scales)):
        if at := free_indices(unknowns):
            blocks.append(UnknownBlock(kind, "", tuple(unknowns[i] for i in at), legs=at))
    if "tool" in names_free and TOOL in measured.marks:
        tolerance = float(tolerances.get("tool", TOLERANCES["tool"]))
        blocks.append(UnknownBlock("mark", TOOL, _point_unknowns("tool", tolerance, "tool")))
    blocks += _surrounding_blocks(measured)
    if not blocks:
        raise DataError("free: nothing is free; name a group")
    return number_unknowns(blocks)


def _point_unknowns(
    name: str, tolerance: float = _WIDE, group: str = "setup"
) -> tuple[Unknown, ...]:
    """Return the three coordinates of a point as unknowns, m."""
    return tuple(Unknown(f"{name}.{axis}", group, "m", tolerance) for axis in "xyz")


def _surrounding_blocks(measured: Measurements) -> Iterator[UnknownBlock]:
    """Yield the blocks of unknown marks, planes, anchors and frame."""
    setup = measured.setup
    for name, mark in setup.marks.items():
        if not mark.known and name in measured.marks:
            yield UnknownBlock("mark", name, _point_unknowns(f"marks.{name}"))
    for name, plane in setup.planes.items():
        if not plane.known and name in measured.planes:
            label = f"planes.{name or 'plane'}"
            tilts = [Unknown(f"{label}.tilt {k}", "setup", "rad", _WIDE) for k in (1, 2)]
            offset = Unknown(f"{label}.offset", "setup", "m", _WIDE)
            yield UnknownBlock("plane", name, (*tilts, offset))
    for name, anchor in setup.anchors.items():
        if not anchor.known and name in measured.anchors:
            yield UnknownBlock("anchor", name, _point_unknowns(f"anchors.{name}"))
    if not setup.frame_known:
        turns = [Unknown(f"instrument about {a}", "setup", "rad", _WIDE) for a in "xyz"]
        yield UnknownBlock("frame", "", (*_point_unknowns("instrument"), *turns))
