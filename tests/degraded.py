"""Machines of which one leg is made useless, or singular with another, at every pose."""

from collections.abc import Callable
from dataclasses import replace

import mechanisms
import numpy as np

import pteron

KINDS = [
    *("PPP", "RRR", "SSS", "PRS", "RPP", "SSP"),  # 3T
    *("PPPP", "RRRR", "SSSS", "PPSS", "RRRU", "PRSU", "SSPU", "PRSSI", "SSSSI"),  # 3T1R
    *("CC", "LL", "CL", "CS", "LP", "CP", "CR", "LS"),  # 2T
    *("CCC", "LLL", "CCL", "CCU", "CLU", "CPR", "LPP", "CSS", "CPU", "LRS"),  # 2T1R
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


def across_the_plane(robot, rng):
    """Turn a P-R-R-R leg of a planar machine so that it pushes across its plane."""
    found = [i for i, leg in enumerate(robot.legs) if leg.type == "PRRR"]
    if not found or not robot.platform.planar:
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


def out_of_reach(robot, rng):
    """Move one leg's guide point so far away that no pose is in reach."""
    leg = robot.legs[0]
    return _with(robot, 0, replace(leg, guide_point=tuple(np.array(leg.guide_point) + 50.0)))


FAULTS = (
    *(coincident, across_the_plane, in_line, alongside, in_a_plane, mirrored),
    *(no_gear, two_shafts, out_of_reach),
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
