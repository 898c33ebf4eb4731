"""Contradictions between a search's file and its machine."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pteron.design.regions import workspace_poses
from pteron.design.spec import Spec
from pteron.design.workspace_tables import WorkspaceTable
from pteron.errors import PteronError
from pteron.indices import INDICES
from pteron.kinematics.unlikely_values import unlikely_values
from pteron.manipulator import Manipulator
from pteron.motion import limits_of
from pteron.workspace.tilts import has_level_axes


def spec_faults(spec: Spec, robot: Manipulator) -> Iterator[str]:
    """Yield sentences on contradictions between a search and its machine."""
    if spec.pose is not None and len(spec.pose) != robot.freedom:
        yield f"pose: {len(spec.pose)} numbers given, {' '.join(robot.coordinates)} expected"
    if spec.angles is not None and robot.platform.axis_angle is None:
        turns = "tilts: give its orientation in pose, or tilt and angles in [workspace]"
        turns = turns if robot.platform.angles else "does not turn"
        yield f"angles: given, but the platform of {robot.name} {turns}; leave it out"
    yield from (f"workspace: {fault}" for fault in _workspace_faults(spec, robot))
    angles = np.array(spec.angles or ())[:, None]
    for warning in unlikely_values(robot, robot.platform.angles[:1], angles):
        yield f"angles: {warning}"
    names = set(spec.quantity_names) - spec.user_quantities.keys()
    if not robot.platform.lengths:
        if spec.workspace is None:
            yield f"workspace: missing; {robot.name} only turns, and needs one with tilt or angles"
        for name in sorted(names & _OF_PLACES):
            yield f"{name}: about places, but {robot.name} only turns"
    units = {leg.joint.force_unit for leg in robot.legs}
    for name in sorted(names & {"force", "speed", "cycle_force", "cycle_speed"}):
        if len(units) > 1:
            yield (
                f"{name}: the joints of {robot.name} have unlike units; ask for drive_load, whose "
                "limits the machine's file gives"
            )
    for name in sorted(names & INDICES.keys()):
        if INDICES[name].turning and not robot.platform.angles:
            yield f"{name}: about turning, but the platform of {robot.name} does not turn"
    if "drive_load" in names and not _has_drive_limits(robot):
        yield f"drive_load: no drive of {robot.name} has max_force or max_speed; ask for force"
    named = [o.quantity for o in spec.objectives]
    for name in sorted({name for name in named if named.count(name) > 1}):
        yield f"objectives: {name} given more than once"
    yield from _missing_tables(spec, robot, names)
    yield from _loads(spec, robot)


def _workspace_faults(spec: Spec, robot: Manipulator) -> Iterator[str]:
    """Yield sentences on contradictions between a search's workspace and its machine."""
    lengths, workspace = robot.platform.lengths, spec.workspace
    if workspace is None:
        return
    yield from _range_faults(spec, workspace, robot)
    if workspace.lengths not in (None, len(lengths)):
        names = " ".join(lengths) or "none"
        yield f"{workspace.lengths} coordinates given, {names} of {robot.name} expected"
    elif workspace.shape == "cylinder" and len(lengths) < 3:
        yield f"a cylinder given, but {robot.name} moves in a plane; give a box"
    else:
        middle = np.zeros((1, robot.freedom))
        center = middle[0, : len(lengths)]
        placed = workspace.with_center(center) if workspace.floats else workspace
        yield from unlikely_values(
            robot, robot.coordinates, workspace_poses(placed, middle, samples=2)
        )


def _range_faults(spec: Spec, workspace: WorkspaceTable, robot: Manipulator) -> Iterator[str]:
    """Yield sentences on ranges of orientations that contradict a search's machine or pose."""
    platform, ranges = robot.platform, workspace.angles or {}
    for name in sorted(ranges.keys() - set(platform.angles)):
        names = ", ".join(platform.angles) or "none"
        yield f"angles: {name} given, but the angles of {robot.name} are {names}"
    if ranges and spec.angles is not None:
        yield "angles: given here and before the tables; give one of them"
    if workspace.tilt is None:
        return
    if not platform.tilts or not has_level_axes(platform):
        yield f"tilt: {robot.name} does not tilt to every side; give the ranges of its angles"
    elif ranges.keys() & set(platform.angles[:2]):
        yield f"tilt: given with a range of {' or '.join(platform.angles[:2])}; give one of them"
    elif spec.pose is not None and any(spec.pose[len(platform.lengths) :][:2]):
        yield "tilt: it is about the level platform; leave its tilt out of pose"


_OF_PLACES = {"cube", "scale", "speed", "force", "drive_load"}
_OF_PLACES |= {"stiffness", "deflection", "accuracy"}
"""Quantities of machines that move to places."""

_NEEDS = {
    "accuracy": "errors",
    "stiffness": "elasticity",
    "deflection": "elasticity",
    "motor_margin": "motors",
}
"""Tables that quantities need."""


def _has_drive_limits(robot: Manipulator) -> bool:
    """Return whether some drive of the machine has a force or speed limit."""
    limits = limits_of(robot)
    return bool(np.isfinite([limits.force, limits.speed]).any())


def _missing_tables(spec: Spec, robot: Manipulator, names: set[str]) -> Iterator[str]:
    """Yield sentences on tables that the named quantities need and the search lacks."""
    for name, table in _NEEDS.items():
        if name in names and getattr(spec, table) is None:
            yield f"{name}: needs a table [{table}]"
    if "deflection" in names and spec.elasticity and spec.elasticity.force is None:
        yield "deflection: needs a force, N, in [elasticity]"
    moving = sorted(name for name in names if name.startswith("cycle_") or name == "motor_margin")
    if moving and not spec.cycles:
        yield f"{', '.join(moving)}: needs [[cycles]], a motion to drive"
    if "cycle_time" in names and not _has_drive_limits(robot):
        yield (
            f"cycle_time: no drive of {robot.name} has max_force or max_speed in its file, which "
            "say how fast it can be"
        )
    floats = spec.workspace is not None and spec.workspace.floats
    if floats and "cube" in names:
        yield "cube: not with a workspace that floats; ask for scale, or give it a center"
    if not floats and "scale" in names:
        yield "scale: of a workspace that floats; leave out its center, or low and high"


def _loads(spec: Spec, robot: Manipulator) -> Iterator[str]:
    """Yield sentences on payload, cycles or numbers for each leg that contradict the machine."""
    if spec.payload is not None:
        try:
            spec.payload.add_to(robot)
        except PteronError as error:
            yield f"payload: {error}"
    for i, cycle in enumerate(spec.cycles, start=1):
        counts = {len(point) for point in cycle.points or ()}
        if not counts <= {len(robot.platform.lengths), robot.freedom}:
            names = " ".join(robot.coordinates[: len(robot.platform.lengths)])
            yield f"cycles, item {i}: points of {sorted(counts)} numbers given, {names} expected"
        for point in cycle.points or ():
            for warning in unlikely_values(robot, robot.coordinates[: len(point)], np.array(point)):
                yield f"cycles, item {i}: {warning}"
    numbers = {
        "errors: encoder": spec.errors and spec.errors.encoder,
        "errors: backlash": spec.errors and spec.errors.backlash,
        "elasticity: actuators": spec.elasticity and spec.elasticity.actuators,
    }
    for name, entries in numbers.items():
        if entries and len(entries) not in (1, robot.joint_count):
            yield f"{name}: {len(entries)} numbers given, 1 or {robot.joint_count} expected"
