"""Hexapods have all their poses: as many as a dense search finds, in under 10 ms a machine.

1000 random machines of 6 U-P-S legs with joint coordinates that a pose has: general ones, with
base and platform plane, with platform points that coincide in pairs (6-3), and turned as a whole;
besides, Dietmaier's machine with its 40 real poses. The dense search, Newton's steps from 4000
poses, goes over 20 of each. Times are those of one machine at a time, and of a batch of joint
coordinates. `--quick` takes 4 machines of each, and searches for one.
"""

from __future__ import annotations

import time
from collections import Counter

import numpy as np
from measuring import quick

import pteron
from pteron.bodies.inertia import RodInertia, SpatialInertia
from pteron.kernels import Array, numeric
from pteron.legs import UPS
from pteron.platforms import Platform

_BASE = """
0 0 0, 1.107915 0 0, 0.549094 0.756063 0, 0.735077 -0.223935 0.525991,
0.514188 -0.526063 -0.368418, 0.590473 0.094733 -0.205018"""
_TOP = """
0 0 0, 0.542805 0 0, 0.956919 -0.528915 0, 0.665885 -0.353482 1.402538,
0.478359 1.158742 0.107672, -0.137087 -0.235121 0.353913"""
_LENGTHS = [1.0, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071]
_STARTS = 4000
_SAME = 1e-6


def hexapod(base: Array, top: Array) -> pteron.Manipulator:
    """Return a machine of 6 U-P-S legs between points of the base and of the platform."""
    upper, lower = (RodInertia.of_body(1.0, (x,), 0.1) for x in (0.1, -0.1))
    legs = tuple(
        UPS(tuple(r), tuple(s), upper, lower, (0.1, 5.0))
        for r, s in zip(np.array(base).tolist(), np.array(top).tolist(), strict=True)
    )
    body = SpatialInertia(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    return pteron.Manipulator("hexapod", Platform("3T3R", body), legs, (0.0, 0.0, -9.81))


def drawn(kind: str, rng: np.random.Generator) -> tuple[pteron.Manipulator, Array]:
    """Return a random machine and a pose of it."""
    base, top = rng.normal(size=(6, 3)), 0.6 * rng.normal(size=(6, 3))
    if kind == "plane":
        base[:, 2] = top[:, 2] = 0.0
    if kind == "6-3":
        top[1::2] = top[::2]
    pose = np.concatenate([rng.normal(size=3), rng.uniform(-1.0, 1.0, 3)])
    robot = hexapod(base, top)
    if kind == "turned":
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        robot = pteron.turned(robot, turn * np.linalg.det(turn))
    return robot, pose


def searched(robot: pteron.Manipulator, joints: Array, rng: np.random.Generator) -> int:
    """Return how many poses Newton's steps find from many."""
    step = numeric(robot, "newton_step")
    at = np.concatenate(
        [1.5 * rng.normal(size=(_STARTS, 3)), rng.uniform(-np.pi, np.pi, (_STARTS, 3))], axis=-1
    )
    with np.errstate(all="ignore"):
        for _ in range(60):
            at = step(joints, at)[0]
        at = at[np.isfinite(at).all(axis=-1)]
        at = at[step(joints, at)[1] < 1e-13]
    place, axes = robot.platform.at(at)
    known = np.concatenate([place, axes.reshape(-1, 9)], axis=-1)
    count = 0
    while len(known):
        count += 1
        known = known[np.abs(known - known[0]).max(axis=-1) > _SAME]
    return count


def main() -> None:
    """Print counts and times."""
    most, looked = (4, 1) if quick() else (1000, 20)
    rng = np.random.default_rng(0)
    robot = hexapod(
        *(np.fromstring(part.replace(",", " "), sep=" ").reshape(6, 3) for part in (_BASE, _TOP))
    )
    poses = pteron.direct_kinematics(robot, _LENGTHS)
    back = np.abs(pteron.inverse_kinematics(robot, poses) - _LENGTHS).max()
    print(f"Dietmaier's machine: {len(poses)} of 40 poses, lengths back to {back:.0e} m")
    print("machines   kind       ms each   real poses: machines, worst error, search agrees")
    for kind in ("general", "plane", "6-3", "turned"):
        counts: Counter[int] = Counter()
        spent, worst, agree = 0.0, 0.0, 0
        for k in range(most):
            robot, pose = drawn(kind, rng)
            joints = pteron.inverse_kinematics(robot, pose)
            poses = pteron.direct_kinematics(robot, joints)  # its programs are built
            begin = time.process_time()
            poses = pteron.direct_kinematics(robot, joints)
            spent += time.process_time() - begin
            poses = poses[np.isfinite(poses[:, 0])]
            counts[len(poses)] += 1
            worst = max(worst, np.abs(poses - pose).max(axis=-1).min(initial=np.inf))
            if k < looked:
                agree += searched(robot, joints, rng) == len(poses)
        told = " ".join(f"{n}:{counts[n]}" for n in sorted(counts))
        each = 1e3 * spent / most
        print(f"{most:8d}   {kind:8s} {each:9.2f}   {told}; {worst:.0e}; {agree}/{looked}")
    robot, pose = drawn("general", rng)
    states = pose + 0.3 * rng.normal(size=(16 if quick() else 512, 6))
    joints = pteron.inverse_kinematics(robot, states)
    begin = time.process_time()
    poses = pteron.direct_kinematics(robot, joints)
    spent = time.process_time() - begin
    print(f"in a batch of {len(joints)}: {1e3 * spent / len(joints):.2f} ms each")


if __name__ == "__main__":
    main()
