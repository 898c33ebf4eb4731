"""Poses at which a machine is singular (type II), found without its type-II measure."""

from dataclasses import replace

import descriptions
import mechanisms
import numpy as np

from pteron.kernels import numeric

KINDS = [
    *("PPP", "RRR", "SSS", "PRS", "RPP"),  # 3T
    *("PPPP", "RRRR", "SSSS", "PPSS", "RRRU", "PRSU", "PRSSI"),  # 3T1R
    *("CC", "LL", "CL", "CS", "CR", "LP", "LS", "CP"),  # 2T
    *("TTT", "TCL", "CCC", "LLL", "CCL", "CCU", "CPR", "CSS", "LRS", "CSU", "LRU"),  # 2T1R
]
"""The letters are those of `random_machine`."""

LINES = 100
STEPS = 60
HALVINGS = 80
DISTANCES = (1e-8, 1e-5, 1e-3)


def crossed(robot, rng, bend=0.2):
    """Return a pose, singular to the last digit, between two random ones, or None.

    Along a line of poses the determinant of the Jacobian, by formulas of the tests' own, changes
    its sign, in reach and with every leg's type-I measure at least `bend`.
    """
    machine = descriptions.describe(robot)
    poses = spread(robot, rng, LINES)
    ends = np.stack([poses, rng.permutation(poses)])
    t = np.linspace(0.0, 1.0, STEPS)[:, None, None]
    lines = (1.0 - t) * ends[0] + t * ends[1]
    signs = determinants(machine, lines, bend)
    found = np.argwhere(signs[1:] * signs[:-1] < 0.0)
    if not len(found):
        return None
    k, i = found[rng.integers(len(found))]
    low, high = lines[k, i], lines[k + 1, i]
    side = signs[k, i]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        value = determinants(machine, middle[None], bend)[0]
        if not np.isfinite(value):
            return None
        low, high = (middle, high) if value * side > 0.0 else (low, middle)
    return low


def spread(robot, rng, count):
    """Return random poses around zero, which random machines reach."""
    turns = "phi" in robot.coordinates
    size = np.array([0.25] * (robot.freedom - turns) + [np.pi] * turns)
    return size * rng.uniform(-1.0, 1.0, (count, robot.freedom))


def determinants(machine, poses, bend):
    """Return det J of poses (..., m), NaN where a leg is not in reach or hardly bent."""
    flat = poses.reshape(-1, machine.freedom)
    jacobians, bends = descriptions.jacobians(machine, flat)
    reached = bends >= bend
    found = np.full(len(flat), np.nan)
    found[reached] = np.linalg.det(jacobians[reached])
    return found.reshape(poses.shape[:-1])


def across_the_plane(robot, rng):
    """Return the planar machine with a rod of a leg in space across its plane at pose zero."""
    i = next(i for i, leg in enumerate(robot.legs) if leg.type in ("PSS", "RSS"))
    old, k = robot.legs[i], np.array(robot.platform.axis) * rng.choice([1, -1])
    point = {"platform_point": old.platform_point, "fixed_offset": old.fixed_offset}
    c = np.array(robot.platform.frame).T @ old.platform_point + old.fixed_offset
    if old.type == "PSS":
        leg = mechanisms.rod_leg(rng, k, c, **point)
    else:
        d = mechanisms.unit(rng)
        crank = old.upper_length * mechanisms.unit(rng, d)
        leg = replace(
            old,
            direction=d,
            bar_direction=None,
            zero_direction=mechanisms.unit(rng, d),
            guide_point=c - crank - old.lower_length * k,
            elbow=int(-np.sign(np.cross(crank, k) @ d)),
        )
    legs = (*robot.legs[:i], leg, *robot.legs[i + 1 :])
    return replace(robot, legs=legs)


def size_of(robot):
    """Return the machine's size, m: the mean of its legs'."""
    return float(np.mean([leg.size for leg in robot.legs if leg.size > 0.0]))


def around(robot, pose, distance, rng, count):
    """Return random poses at a distance, m; a radian counts as the machine's size."""
    steps = rng.normal(size=(count, robot.freedom))
    steps *= distance / np.linalg.norm(steps, axis=-1, keepdims=True)
    if "phi" in robot.coordinates:
        steps[:, -1] /= size_of(robot)
    return pose + steps


def found(robot, rng):
    """Yield machines and poses at which they are singular: the machine, and one made so at zero."""
    pose = crossed(robot, rng)
    if pose is not None:
        yield robot, pose
    if robot.platform.planar and any(leg.type in ("PSS", "RSS") for leg in robot.legs):
        yield across_the_plane(robot, rng), np.zeros(robot.freedom)


def slopes(robot, pose, rng, count=100):
    """Return the type-II measure at a singular pose, and the most of it over the distance to it.

    Distances are shares of the machine's size.
    """
    measure = numeric(robot, "type_ii")
    most = 0.0
    for distance in DISTANCES:
        poses = around(robot, pose, distance * size_of(robot), rng, count)
        sizes = np.abs(measure(poses)[0])
        most = max(most, float(np.nanmax(sizes)) / distance)
    return abs(float(measure(pose)[0])), most
