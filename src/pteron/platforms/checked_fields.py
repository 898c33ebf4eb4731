"""Checks of a platform's fields, one by one and against each other: `checked_fields`."""

from __future__ import annotations

from typing import Any, get_args

from pteron.bodies.inertia import PlanarInertia, SpatialInertia
from pteron.bodies.vectors import Vector, interval, parallel, perpendicular, unit_vector, vector
from pteron.errors import ModelError
from pteron.platforms.kinds import XYZ, AngleOrder
from pteron.toml import refuse

BASE_Z: Vector = (0.0, 0.0, 1.0)


def checked_fields(given: Any) -> tuple[dict[str, Any], list[str]]:
    """Return the fields of a `Platform` as it holds them, and all that is wrong with them."""
    faults: list[str] = []
    sound = {"bars": tuple(given.bars), "geared": tuple(given.geared)}
    for check in (_axes, _limits, _tool, _joint):
        try:
            sound |= check(given)
        except ModelError as error:
            faults += error.faults
    motion = given.motion
    if given.slides and motion != "3T1R":
        faults.append(f"slides: a {motion} platform has no halves that slide; only 3T1R")
    if given.slides and any(bar.hinge[2] != 0.0 for bar in sound["bars"]):
        faults.append("bars: what slides moves across the axis; give 0 as hinge's third number")
    if sound["geared"] and not given.turns:
        faults.append(f"geared: a {motion} platform has no axis for a gear to turn about")
    if sound["bars"] and given.tilts:
        faults.append(f"bars: a {motion} platform tilts, and takes none")
    expected = SpatialInertia if given.tilts else PlanarInertia
    if not isinstance(given.inertia, expected):
        faults.append(
            f"inertia: {type(given.inertia).__name__} given, but a {motion} platform "
            f"{'tilts' if given.tilts else 'does not tilt'}: {expected.__name__} expected"
        )
    return sound, faults


def _axes(given: Any) -> dict[str, Any]:
    axis = unit_vector(given.axis, "axis")
    if given.x_axis is not None and given.motion == "2R":
        raise ModelError(
            "x_axis: a 2R platform's frame is the base frame at angles zero; leave it out"
        )
    if given.x_axis is not None:
        return {"axis": axis, "x_axis": perpendicular(given.x_axis, axis, "x_axis", "axis")}
    if axis == BASE_Z or given.motion == "2R":
        return {"axis": axis, "x_axis": None if given.motion == "2R" else (1.0, 0.0, 0.0)}
    raise ModelError(
        f"x_axis: missing; axis {list(axis)} is not the base frame's z, so x_axis must say "
        "where the platform frame's x points at phi = 0"
    )


def _limits(given: Any) -> dict[str, Any]:
    if given.limits is None:
        return {}
    if not given.angles:
        raise ModelError(f"limits: a {given.motion} platform has no angle to limit")
    if not given.tilts:
        return {"limits": interval(given.limits, "limits")}
    try:
        pairs = [tuple(pair) for pair in given.limits]
    except TypeError:
        pairs = []
    if len(pairs) != len(given.angles):
        raise ModelError(
            f"limits: {given.limits!r} given, one pair for each of {', '.join(given.angles)} "
            "expected, rad"
        )
    return {"limits": tuple(interval(p, f"limits[{i}]") for i, p in enumerate(pairs))}


def _tool(given: Any) -> dict[str, Any]:
    return {"tool": vector(given.tool, "tool")}


def _joint(given: Any) -> dict[str, Any]:
    """Return what a platform on a joint with the base has, and no other."""
    faults, found = [], {}
    if given.angle_order not in get_args(AngleOrder):
        faults.append(f'angles: {given.angle_order!r} is not "rpy" or "xyz"')
    elif given.angle_order != "rpy" and given.motion not in XYZ:
        faults.append(f'angles: a {given.motion} platform has no "xyz"; only 3T3R and 3R')
    wanted = {"center": given.motion in ("3R", "2R"), "second_axis": given.motion == "2R"}
    for name, needed in wanted.items():
        value = getattr(given, name)
        if (value is None) == needed:
            faults.append(
                f"{name}: missing; a {given.motion} platform turns about it"
                if needed
                else f"{name}: a {given.motion} platform has none; leave it out"
            )
        elif needed:
            check = vector if name == "center" else unit_vector
            found[name] = check(value, name)
    second = found.get("second_axis")
    if second and parallel(unit_vector(given.axis, "axis"), second):
        faults.append("second_axis: along axis, so that both angles turn alike; turn one")
    refuse(faults)
    return found
