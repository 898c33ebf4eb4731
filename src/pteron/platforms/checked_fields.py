"""Checks of a platform's fields, one by one and against each other: `checked_fields`."""

from __future__ import annotations

from typing import Any, get_args

from pteron.bodies.inertia import PlanarInertia, SpatialInertia
from pteron.bodies.vectors import Vector, interval, parallel, perpendicular, unit_vector, vector
from pteron.errors import ModelError
from pteron.platforms.kinds import XYZ, AngleOrder
from pteron.toml import raise_faults

BASE_Z: Vector = (0.0, 0.0, 1.0)


def checked_fields(platform: Any) -> tuple[dict[str, Any], list[str]]:
    """Return the valid fields of a `Platform`, converted, and the faults of the others."""
    faults: list[str] = []
    sound = {"bars": tuple(platform.bars), "geared": tuple(platform.geared)}
    for check in (_axes, _limits, _tool, _joint):
        try:
            sound |= check(platform)
        except ModelError as error:
            faults += error.faults
    motion = platform.motion
    if platform.slides and motion != "3T1R":
        faults.append(f"slides: a {motion} platform has no halves that slide; only 3T1R")
    if platform.slides and any(bar.hinge[2] != 0.0 for bar in sound["bars"]):
        faults.append("bars: what slides moves across the axis; give 0 as hinge's third number")
    if sound["geared"] and not platform.turns:
        faults.append(f"geared: a {motion} platform has no axis for a gear to turn about")
    if sound["bars"] and platform.tilts:
        faults.append(f"bars: a {motion} platform tilts, and takes none")
    expected = SpatialInertia if platform.tilts else PlanarInertia
    if not isinstance(platform.inertia, expected):
        faults.append(
            f"inertia: {type(platform.inertia).__name__} given, but a {motion} platform "
            f"{'tilts' if platform.tilts else 'does not tilt'}: {expected.__name__} expected"
        )
    return sound, faults


def _axes(platform: Any) -> dict[str, Any]:
    """Return the platform's `axis` and `x_axis`, unit vectors; ModelError if they are not valid."""
    axis = unit_vector(platform.axis, "axis")
    if platform.x_axis is not None and platform.kind.has_second_axis:
        raise ModelError(
            f"x_axis: a {platform.motion} platform's frame is the base frame at angles zero; "
            "leave it out"
        )
    if platform.x_axis is not None:
        return {"axis": axis, "x_axis": perpendicular(platform.x_axis, axis, "x_axis", "axis")}
    if platform.kind.has_second_axis:
        return {"axis": axis, "x_axis": None}
    if axis == BASE_Z:
        return {"axis": axis, "x_axis": (1.0, 0.0, 0.0)}
    raise ModelError(
        f"x_axis: missing; axis {list(axis)} is not the base frame's z, so x_axis must say "
        "where the platform frame's x points at phi = 0"
    )


def _limits(platform: Any) -> dict[str, Any]:
    """Return the platform's angle limits after a check, rad: a pair, or one for each angle."""
    if platform.limits is None:
        return {}
    if not platform.angles:
        raise ModelError(f"limits: a {platform.motion} platform has no angle to limit")
    if not platform.tilts:
        return {"limits": interval(platform.limits, "limits")}
    try:
        pairs = [tuple(pair) for pair in platform.limits]
    except TypeError:
        pairs = []
    if len(pairs) != len(platform.angles):
        raise ModelError(
            f"limits: {platform.limits!r} given, one pair for each of {', '.join(platform.angles)} "
            "expected, rad"
        )
    return {"limits": tuple(interval(p, f"limits[{i}]") for i, p in enumerate(pairs))}


def _tool(platform: Any) -> dict[str, Any]:
    """Return the platform's field `tool`, checked as a vector."""
    return {"tool": vector(platform.tool, "tool")}


def _joint(platform: Any) -> dict[str, Any]:
    """Return the checked fields of a platform on a joint with the base; raise if misplaced."""
    faults, checked = [], {}
    if platform.angle_order not in get_args(AngleOrder):
        faults.append(f'angles: {platform.angle_order!r} is not "rpy" or "xyz"')
    elif platform.angle_order != "rpy" and platform.motion not in XYZ:
        faults.append(f'angles: a {platform.motion} platform has no "xyz"; only 3T3R and 3R')
    requirements = {
        "center": platform.kind.has_center,
        "second_axis": platform.kind.has_second_axis,
    }
    for name, needed in requirements.items():
        field_value = getattr(platform, name)
        if (field_value is None) == needed:
            faults.append(
                f"{name}: missing; a {platform.motion} platform turns about it"
                if needed
                else f"{name}: a {platform.motion} platform has none; leave it out"
            )
        elif needed:
            check = vector if name == "center" else unit_vector
            checked[name] = check(field_value, name)
    if platform.axis_offset is not None and not all(requirements.values()):
        faults.append(f"axis_offset: a {platform.motion} platform has none; leave it out")
    elif platform.axis_offset is not None:
        checked["axis_offset"] = vector(platform.axis_offset, "axis_offset")
    second = checked.get("second_axis")
    if second and parallel(axis := unit_vector(platform.axis, "axis"), second):
        faults.append("second_axis: along axis, so that both angles turn alike; turn one")
    elif second and platform.kind.hold_rotation:
        checked["second_axis"] = perpendicular(second, axis, "second_axis", "axis")
    raise_faults(faults)
    return checked
