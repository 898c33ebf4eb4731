"""The shortest time along a path by integration in the phase plane: an oracle of `time_optimal`.

Largest s'' forward, least s'' backward, node by node, with friction as it is (the root of s'^2, the
sign of the joint's motion) and the tool's acceleration as a circle. Coefficients are those of the
public functions of kinematics and dynamics. A node's limits hold over the interval behind it, so
that the error is of first order in the nodes' distances: two grids give its limit.
"""

from itertools import pairwise

import numpy as np

import pteron
from pteron.kinematics import joint_accelerations, joint_rates
from pteron.legs import Drive
from pteron.motion import check_path, limits_of, line_path, polynomial_motion
from pteron.motion.trajectories.tool import tool_path

try:
    from numba import njit
except ImportError:  # some hundred times slower
    njit = lambda function: function  # noqa: E731


def shortest_duration(robot, path, limits, nodes=400):
    """Return the shortest duration, s, of a motion along a path, without continuous acceleration.

    `nodes` are those of each piece between the path's knots; the second grid has twice as many.
    """
    rough, fine = (
        sum(_duration(robot, path, limits, begin, end, n) for begin, end in pairwise(path.rests))
        for n in (nodes, 2 * nodes)
    )
    return 2.0 * fine - rough


def _duration(robot, path, limits, begin, end, nodes):
    knots = [s for s in getattr(path, "knots", ()) if begin < s < end]
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, nodes + 1))
    pieces = [a + (b - a) * share[:-1] for a, b in pairwise([begin, *knots, end])]
    s = np.append(np.concatenate(pieces), end)
    rows, most, tool = _coefficients(robot, path, limits, s)
    squares = _integrate(s, *rows, most, *tool, limits.tool_acceleration)
    rates = np.sqrt(squares)
    return float((2.0 * np.diff(s) / (rates[1:] + rates[:-1])).sum())


def _coefficients(robot, path, limits, s):
    """Return rows a s'' + b s'^2 + c + v s' <= 1, the largest s'^2, and the tool's derivatives."""
    pose, first, second = path.at(s)
    zero = np.zeros_like(pose)
    q = joint_rates(robot, pose, first).actuated
    bend = joint_accelerations(robot, pose, first, second).actuated
    weight = pteron.inverse_dynamics(robot, pose, zero, zero)
    mass = pteron.inverse_dynamics(robot, pose, zero, first) - weight
    square = pteron.inverse_dynamics(robot, pose, first, second) - weight
    rows, none = [], np.zeros(len(s))
    for i, leg in enumerate(robot.legs):
        drive = leg.drive or Drive()
        dry = drive.coulomb
        still = drive.stribeck.force if drive.stribeck else 0.0
        lines = [(limits.force[i], 0.0, 0.0), *(limits.lines[i] if limits.lines else ())]
        for side in (1.0, -1.0):
            if np.isfinite(limits.acceleration[i]):
                part = side * q[:, i], side * bend[:, i], none, none
                rows.append([p / limits.acceleration[i] for p in part])
            sign = side * np.sign(q[:, i])
            friction = sign * (dry + still * (sign > 0.0))
            for force, fall, back in lines:
                if np.isfinite(force):
                    part = (
                        side * (mass[:, i] + drive.inertia * q[:, i]),
                        side * (square[:, i] + drive.inertia * bend[:, i]),
                        side * (weight[:, i] + drive.offset) + friction,
                        side * (drive.viscous + back) * q[:, i] + fall * np.abs(q[:, i]),
                    )
                    rows.append([p / force for p in part])
    _, tool, tool_bend = tool_path(robot.platform, pose, first, second)
    with np.errstate(divide="ignore"):
        most = np.minimum(
            (limits.speed / np.abs(q)).min(axis=1),
            limits.tool_speed / np.linalg.norm(tool, axis=1),
        )
    stacked = np.array(rows).reshape(-1, 4, len(s)).transpose(1, 2, 0)
    products = (tool * tool).sum(1), (tool * tool_bend).sum(1), (tool_bend**2).sum(1)
    return (
        tuple(np.ascontiguousarray(part) for part in stacked),
        np.minimum(most, 1e9) ** 2,
        products,
    )


@njit
def _range(i, x, a, b, c, v, p, r, w, tool_limit):
    """Return the least and the greatest s'' at a node at x = s'^2."""
    low, high, root = -np.inf, np.inf, np.sqrt(x)
    for k in range(a.shape[1]):
        margin = 1.0 - b[i, k] * x - c[i, k] - v[i, k] * root
        if a[i, k] > 0.0:
            high = min(high, margin / a[i, k])
        elif a[i, k] < 0.0:
            low = max(low, margin / a[i, k])
        elif margin < 0.0:
            return 1.0, -1.0
    if np.isfinite(tool_limit) and p[i] > 1e-18:
        disc = (r[i] * x) ** 2 - p[i] * (w[i] * x * x - tool_limit**2)
        if disc < 0.0:
            return 1.0, -1.0
        low = max(low, (-r[i] * x - np.sqrt(disc)) / p[i])
        high = min(high, (-r[i] * x + np.sqrt(disc)) / p[i])
    return low, high


@njit
def _integrate(s, a, b, c, v, most, p, r, w, tool_limit):
    largest = np.zeros(len(s))
    for i in range(len(s) - 2, 0, -1):
        low, high = 0.0, most[i]
        step = 2.0 * (s[i + 1] - s[i])
        for _ in range(200):
            x = 0.5 * (low + high)
            least, greatest = _range(i, x, a, b, c, v, p, r, w, tool_limit)
            if least <= greatest and x + step * least <= largest[i + 1]:
                low = x
            else:
                high = x
            if high - low <= 1e-12 * high:
                break
        largest[i] = low
    squares = np.zeros(len(s))
    for i in range(len(s) - 1):
        _, greatest = _range(i, squares[i], a, b, c, v, p, r, w, tool_limit)
        squares[i + 1] = max(
            min(squares[i] + 2.0 * (s[i + 1] - s[i]) * greatest, largest[i + 1]), 0.0
        )
    return squares


def random_poses(robot, home, rng):
    """Return four random poses about home whose lines the machine can follow, rounded or not."""
    size, amplitude = size_of(robot), 0.15
    while amplitude > 1e-6:
        steps = np.where(robot.platform.angular, 2.0 * amplitude, amplitude * size)
        poses = home + steps * rng.uniform(-1.0, 1.0, (4, robot.freedom))
        try:
            for corner in (0.0, 0.1 * size):
                check_path(robot, line_path(robot, poses, corner))
        except pteron.PteronError:
            amplitude *= 0.85
        else:
            return poses
    raise RuntimeError(f"{robot.name}: no path about home")


def size_of(robot):
    """Return the greatest distance of a guide point from the base frame's origin, m."""
    return max(float(np.linalg.norm(leg.guide_point)) for leg in robot.legs)


def random_limits(robot, path, rng):
    """Return random limits, of the size of what the path takes in a second, two of five or so."""
    free = limits_of(robot, speed=np.inf, force=np.inf)
    motion = polynomial_motion(robot, path, duration=1.0, limits=free)
    states = motion.pose, motion.velocity, motion.acceleration
    slow = motion.pose, 0.01 * motion.velocity, 1e-4 * motion.acceleration
    rates, gains, forces, hold = (
        np.abs(part).max(axis=0)
        for part in (
            joint_rates(robot, *states[:2]).actuated,
            joint_accelerations(robot, *states).actuated,
            pteron.drive_forces(robot, *states),
            pteron.drive_forces(robot, *slow),
        )
    )
    _, tool, bend = (np.linalg.norm(p, axis=-1).max() for p in tool_path(robot.platform, *states))
    count = robot.joint_count
    chosen = {}
    while not {"acceleration", "force", "tool_acceleration"} & set(chosen):
        values = {
            "acceleration": gains * rng.uniform(0.3, 3.0, count) + 1e-3 * gains.max(),
            "force": 1.3 * hold + (forces + hold).max() * rng.uniform(0.2, 2.0, count),
            "speed": rates * rng.uniform(0.5, 1.5, count) + 0.01 * rates.max(),
            "tool_speed": tool * rng.uniform(0.5, 1.5),
            "tool_acceleration": bend * rng.uniform(0.3, 3.0),
        }
        shares = {"tool_speed": 0.3 * (tool > 1e-6), "tool_acceleration": 0.3 * (bend > 1e-3)}
        chosen = {
            name: value for name, value in values.items() if rng.random() < shares.get(name, 0.5)
        }
    return limits_of(robot, **chosen)
