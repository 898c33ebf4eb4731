"""Machines of which one leg is made useless, or singular with another, at every pose."""

from collections.abc import Callable
from dataclasses import replace

import mechanisms
import numpy as np

import pteron
from pteron.export import tree
from pteron.indices import reactions
from pteron.motion import check_path, line_path
from pteron.workspace import Box, free_of_singularities, home_pose, paving, pose_margins, prove

KINDS = [
    *("PPP", "RRR", "SSS", "PRS", "RPP", "SSP"),  # 3T
    *("PPPP", "RRRR", "SSSS", "PPSS", "RRRU", "PRSU", "SSPU", "PRSSI", "SSSSI"),  # 3T1R
    *("CC", "LL", "CL", "CS", "LP", "CP", "CR", "LS"),  # 2T
    *("TTT", "TCL", "CCC", "LLL", "CCL", "CCU", "CLU", "CPR", "LPP", "CSS", "CPU", "LRS"),  # 2T1R
]
"""The letters are those of `random_machine`."""


def _with(robot, i, leg):
    legs = list(robot.legs)
    legs[i] = leg
    return replace(robot, legs=tuple(legs))


def _pair(robot):
    """Return two legs that are no shafts, the first a planar one in a planar machine."""
    found = [i for i, leg in enumerate(robot.legs) if not leg.follows_angle]
    found.sort(key=lambda i: robot.legs[i].plane_normal is None)
    return found[0], found[-1]


def coincident(robot, rng):
    """Put one leg on another."""
    i, j = _pair(robot)
    return _with(robot, j, robot.legs[i])


def mirrored(robot, rng):
    """Put one leg on another, with its elbow on the other side."""
    i, j = _pair(robot)
    leg = robot.legs[i]
    return _with(robot, j, replace(leg, elbow=-leg.elbow)) if leg.type == "PRRR" else None


def alongside(robot, rng):
    """Make one leg a parallel of another, on a platform that does not turn."""
    i, j = _pair(robot)
    if robot.platform.motion != "3T":
        return None
    leg, shift = robot.legs[i], rng.uniform(-0.05, 0.05, 3)
    point, guide = (
        tuple(np.array(v) + np.array(robot.platform.frame).T @ shift if base else v + shift)
        for v, base in ((leg.platform_point, False), (leg.guide_point, True))
    )
    return _with(robot, j, replace(leg, platform_point=point, guide_point=guide))


def across_legs(robot):
    """Return the P-R-R-R legs of a planar machine."""
    return [i for i, leg in enumerate(robot.legs) if leg.type == "PRRR" and robot.platform.planar]


def across_the_plane(robot, rng):
    """Turn a P-R-R-R leg of a planar machine so that it pushes across its plane."""
    found = across_legs(robot)
    if not found:
        return None
    leg = robot.legs[found[0]]
    return _with(robot, found[0], replace(leg, direction=robot.platform.axis))


def in_a_plane(robot, rng):
    """Turn one of three P-R-R-R legs into the plane of the others, under a 3T platform."""
    if robot.platform.motion != "3T" or any(leg.type != "PRRR" for leg in robot.legs):
        return None
    a, b = (np.array(robot.legs[i].direction) for i in (0, 1))
    d = a + rng.uniform(-1.0, 1.0) * b
    d /= np.linalg.norm(d)
    return _with(robot, 2, replace(robot.legs[2], direction=tuple(d), slider_direction=None))


def in_line(robot, rng):
    """Put all platform points on one line along the axis, to rounding."""
    if not robot.platform.turns or any(leg.follows_angle for leg in robot.legs):
        return None
    x, y, _ = robot.legs[0].platform_point
    legs = [
        replace(leg, platform_point=(x * (1.0 + 1e-16 * i), y, leg.platform_point[2]))
        for i, leg in enumerate(robot.legs)
    ]
    return replace(robot, legs=tuple(legs))


def no_gear(robot, rng):
    """Let a shaft's joint stand still while the platform turns."""
    i = next((i for i, leg in enumerate(robot.legs) if leg.follows_angle), None)
    return None if i is None else _with(robot, i, replace(robot.legs[i], ratio=0.0))


def two_shafts(robot, rng):
    """Replace another leg by a second shaft."""
    i = next((i for i, leg in enumerate(robot.legs) if leg.follows_angle), None)
    return None if i is None else _with(robot, i - 1, robot.legs[i])


def slanted(robot, rng):
    """Lean such a leg by less than its numbers tell."""
    found = across_legs(robot)
    if not found:
        return None
    k, x = np.array(robot.platform.axis), np.array(robot.platform.x_axis)
    return _with(robot, found[0], replace(robot.legs[found[0]], direction=tuple(k + 1e-11 * x)))


FAULTS = (
    *(coincident, across_the_plane, in_line, alongside, in_a_plane, mirrored),
    *(no_gear, two_shafts, slanted),
)


def makers(count, seed=0):
    """Yield (name, maker) of `count` machines; a maker returns the machine, or raises."""
    made = 0
    while made < count:
        for kinds in KINDS:
            robot = mechanisms.random_machine(seed, kinds)
            for fault in FAULTS:

                def make(robot=robot, fault=fault, seed=seed):
                    return fault(robot, np.random.default_rng(seed))

                if not _applies(make):
                    continue
                yield f"{robot.name}, {fault.__name__}", make
                made += 1
                if made == count:
                    return
        seed += 1


def _applies(make: Callable) -> bool:
    try:
        return make() is not None
    except pteron.PteronError:
        return True


def judged(make):
    """Return "refused" or "flagged", or what answers for the machine all the same."""
    try:
        robot = make()
    except pteron.ModelError:
        return "refused"
    layout = pteron.kinematics.architecture(robot)
    if not (layout.singular and layout.reason):
        return "not flagged"
    asked = (f"answered: {name}" for name, call in calls(robot) if not refused(call))
    return next(asked, "flagged")


def calls(robot):
    """Yield by name the calls that must not be answered of such a machine."""
    pose = pteron.random_poses(robot, 2, type_ii=0.0)
    rest = np.zeros_like(pose)
    box = Box(pose[0] - 1e-4, pose[0] + 1e-4)
    yield "random_poses", lambda: pteron.random_poses(robot, 2)
    yield "inverse_dynamics", lambda: pteron.inverse_dynamics(robot, pose, rest, rest)
    yield "drive_forces", lambda: pteron.drive_forces(robot, pose, rest, rest)
    yield "regressor", lambda: pteron.regressor(robot, pose, rest, rest)
    yield "reactions", lambda: reactions(robot, pose)
    yield "prove", lambda: prove(robot, box)
    yield "prove with a floor", lambda: prove(robot, box, type_ii=0.1)
    yield "paving", lambda: paving(robot, pose[0], within=box.box[:, : len(robot.platform.lengths)])
    yield "free_of_singularities", lambda: free_of_singularities(robot, box)
    yield "reserve", lambda: pose_margins(robot, pose)
    yield "home_pose", lambda: home_pose(robot)
    yield "check_path", lambda: check_path(robot, line_path(robot, pose))
    yield "direct_kinematics", lambda: pteron.direct_kinematics(robot, rest[0])
    yield "tree", lambda: tree(robot)
    yield "base_parameters", lambda: pteron.base_parameters(robot)


def refused(call):
    """Say whether a call is refused in the house's words, or answers that it does not hold."""
    try:
        found = call()
    except pteron.PteronError as error:
        return "\n" not in str(error)
    if hasattr(found, "holds"):
        return found.holds is not True
    if hasattr(found, "free"):
        return found.free is not True
    return hasattr(found, "type_ii") and bool((found.type_ii <= 1e-9).all())
