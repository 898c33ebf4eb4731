"""The choice of a calibration's unknowns, and the tolerances that are assumed of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import get_args

import numpy as np

from pteron.calibration.guess import Block, Unknown
from pteron.calibration.measurements import TOOL, Measurements
from pteron.calibration.variations import AXIAL, Group, Variation, axial_variations, variations
from pteron.errors import DataError
from pteron.manipulator import Manipulator

GROUPS: tuple[str, ...] = tuple(group for group in get_args(Group) if group not in AXIAL)
"""The groups of unknowns that a user's `free` may name."""

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

_WIDE = {"m": 10.0, "rad": 10.0}
"""Tolerances of frames, marks, planes and anchors that are not known: practically none."""


def blocks_of(
    robot: Manipulator,
    measured: Measurements,
    free: Sequence[str] | None = None,
    prior: Mapping[str, float] | None = None,
) -> tuple[Block, ...]:
    """Return the unknowns of a calibration, in blocks.

    Parameters
    ----------
    robot : Manipulator
        The machine as drawn.
    measured : Measurements
        What was measured; marks, planes, anchors and a frame that are not known are sought too.
    free : sequence of str, optional
        Groups, or names of single values, or `radius` and `angles`, the places of the legs' guide
        points about the platform's axis; by default all groups but, where no scale is measured,
        `scales`.
    prior : mapping, optional
        Standard deviations by group or by name, in place of ordinary tolerances; inf: none.

    Raises
    ------
    DataError
        If a name is none of the machine's.
    """
    given = dict(prior or {})
    asked = list(free) if free is not None else _default(measured)
    own = variations(robot)
    n = len(robot.legs)
    joint = [
        Unknown(f"zeros[{i + 1}]", "zeros", leg.joint.unit, 0.0) for i, leg in enumerate(robot.legs)
    ]
    scale = [Unknown(f"scales[{i + 1}]", "scales", "", 0.0) for i in range(n)]
    axial = axial_variations(robot)
    names = {v.name for v in (*own, *axial)} | {u.name for u in (*joint, *scale)}
    known = {*GROUPS, *AXIAL, *names}
    wrong = [name for name in (*asked, *given) if name not in known | {"zeros, rad"}]
    if wrong:
        raise DataError(
            f"free, prior: {', '.join(map(repr, wrong))}: no group or value of this machine; "
            f"groups are {', '.join((*GROUPS, *AXIAL))}, values like {own[0].name}"
        )
    for name, value in given.items():
        if not value > 0.0:
            raise DataError(f"prior: {name} = {value:g}: a standard deviation above 0 expected")
    found: list[tuple[str, str, list[Unknown], tuple[Variation, ...], tuple[int, ...]]] = []
    chosen = tuple(v for v in own if v.group in asked or v.name in asked)
    chosen += tuple(v for v in axial if v.group in asked or v.name in asked)
    if chosen:
        unknowns = [
            Unknown(v.name, v.group, v.unit, _tolerance(v.name, v.group, v.unit, given))
            for v in chosen
        ]
        found.append(("geometry", "", unknowns, chosen, ()))
    for kind, all_of in (("zeros", joint), ("scales", scale)):
        legs = tuple(i for i, u in enumerate(all_of) if kind in asked or u.name in asked)
        if legs:
            unknowns = [
                Unknown(
                    all_of[i].name,
                    kind,
                    all_of[i].unit,
                    _tolerance(all_of[i].name, kind, all_of[i].unit, given),
                )
                for i in legs
            ]
            found.append((kind, "", unknowns, (), legs))
    if "tool" in asked and TOOL in measured.marks:
        found.append(
            ("mark", TOOL, _three("tool", _tolerance("tool", "tool", "m", given), "tool"), (), ())
        )
    found += [(*part, (), ()) for part in _surroundings(measured)]
    blocks, start = [], 0
    for kind, name, unknowns, changes, legs in found:
        stop = start + len(unknowns)
        blocks.append(Block(kind, name, slice(start, stop), tuple(unknowns), changes, legs))
        start = stop
    if not blocks:
        raise DataError("free: nothing is free; name a group")
    return tuple(blocks)


def _default(measured: Measurements) -> list[str]:
    return [
        group
        for group in GROUPS
        if group != "tool"
        or not np.isnan(measured.positions).all()
        or not np.isnan(measured.heights).all()
    ]


def _tolerance(name: str, group: str, unit: str, given: Mapping[str, float]) -> float:
    where = f"{group}, rad" if group == "zeros" and unit == "rad" else group
    return float(given.get(name, given.get(where, given.get(group, TOLERANCES[where]))))


def _three(name: str, tolerance: float, group: str = "setup") -> list[Unknown]:
    return [Unknown(f"{name}.{axis}", group, "m", tolerance) for axis in "xyz"]


def _surroundings(measured: Measurements) -> Iterator[tuple[str, str, list[Unknown]]]:
    """Yield the blocks of what measurements refer to and nobody knows."""
    setup, wide = measured.setup, _WIDE
    used = set(measured.marks), set(measured.planes), set(measured.anchors)
    for name, mark in setup.marks.items():
        if not mark.known and name in used[0]:
            yield "mark", name, _three(f"marks.{name}", wide["m"])
    for name, plane in setup.planes.items():
        if not plane.known and name in used[1]:
            told = f"planes.{name or 'plane'}"
            tilts = [Unknown(f"{told}.tilt {k}", "setup", "rad", wide["rad"]) for k in (1, 2)]
            yield "plane", name, [*tilts, Unknown(f"{told}.offset", "setup", "m", wide["m"])]
    for name, anchor in setup.anchors.items():
        if not anchor.known and name in used[2]:
            yield "anchor", name, _three(f"anchors.{name}", wide["m"])
    if not setup.frame_known:
        turns = [Unknown(f"instrument about {a}", "setup", "rad", wide["rad"]) for a in "xyz"]
        yield "frame", "", [*_three("instrument", wide["m"]), *turns]
