"""Reachy Mini's kinematics beside its own, the package `reachy-mini-rust-kinematics`.

Random poses of the head; inverse kinematics of both, then direct kinematics, of which the peer does
one damped Newton step a call, from the pose of the call before. Times are of single calls.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
from measuring import Array, Contestant, a_call, compiled, contest, quick

import pteron
from pteron.kernels import numeric

STEPS = 1000
"""Most calls of the peer's Newton step for one pose, begun beside it."""

SETTLED = 1e-12
"""Change of a frame by a step, m and shares, below which the peer has settled."""

BESIDE = 1e-4
"""m and rad from the pose that is sought to where steps begin."""

GOAL = 1e-9
"""rad and m."""


def main() -> None:
    """Print the largest differences, and the times side by side."""
    if find_spec("reachy_mini_rust_kinematics") is None:
        print("left out, the package reachy-mini-rust-kinematics is not installed")
        return
    robot = pteron.load("reachy-mini")
    own = peer(robot)
    poses = pteron.random_poses(robot, 100 if quick() else 1000)
    frames = np.broadcast_to(np.eye(4), (len(poses), 4, 4)).copy()
    frames[:, :3, :3] = pteron.rotation_of(robot, poses)
    frames[:, :3, 3] = pteron.kinematics.position_of(robot, poses)
    joints = pteron.inverse_kinematics(robot, poses)
    given = frames.tolist()
    theirs = np.array([own.inverse_kinematics(frame) for frame in given])
    inverse = float(np.abs((theirs - joints + np.pi) % (2.0 * np.pi) - np.pi).max())
    print(f"{len(poses)} poses: joints within {inverse:.1e} rad", end=", ")
    ends = np.array([followed(own, *pair) for pair in zip(given, joints.tolist(), strict=True)])
    settled = np.isfinite(ends).all(axis=(-1, -2))
    step = numeric(robot, "direct_step")
    found = poses[settled] + BESIDE
    for _ in range(5):
        found = step(joints[settled], found)[0]
    back = pteron.pose_of(robot, ends[settled, :3, 3], nearest_rotations(ends[settled]))
    direct = float(np.abs(found - poses[settled]).max())
    theirs = np.abs(back - poses[settled]).max(axis=-1)
    print(
        f"{len(theirs)} poses where its steps settle: pteron's within {direct:.1e} m and rad of "
        f"the pose, its own {theirs.max():.1e}, {(theirs < GOAL).sum()} of them within {GOAL:.0e}"
    )
    contestants = [
        Contestant("its own, inverse", a_call(own.inverse_kinematics, [given]), 0.0),
        Contestant(
            "pteron, inverse", a_call(compiled(robot, pteron.inverse_kinematics), [poses]), inverse
        ),
        Contestant("its own, a step", a_call(own.forward_kinematics, [joints.tolist()]), 0.0),
        Contestant("pteron, a direct step", a_call(step, [joints, poses]), 0.0),
    ]
    for name, times in contest(contestants, 3 if quick() else 30).items():
        print(f"{name:<28}{1e6 * np.median(times):>8.2f} us a call")
    if not max(inverse, direct) < GOAL:
        raise SystemExit("the two differ")


def peer(robot: pteron.Manipulator) -> Any:
    """Return the peer's model; a motor's frame has z along its axis, x where its horn is at 0."""
    from reachy_mini_rust_kinematics import ReachyMiniRustKinematics

    first: Any = robot.legs[0]
    model = ReachyMiniRustKinematics(first.upper_length, first.lower_length)
    legs: tuple[Any, ...] = robot.legs
    for leg in legs:
        motor = np.eye(4)
        across = np.cross(leg.direction, leg.zero_direction)
        motor[:3, :3] = np.array([leg.zero_direction, across, leg.direction]).T
        motor[:3, 3] = leg.guide_point
        model.add_branch(leg.platform_point, motor.tolist(), float(leg.elbow))
    return model


def followed(own: Any, frame: list[list[float]], joints: list[float]) -> Array:
    """Return where the peer's steps settle from a frame beside that of the joints, or NaN."""
    start = np.array(frame)
    start[:3, 3] += BESIDE
    own.reset_forward_kinematics(start.tolist())
    last = start
    for _ in range(STEPS):
        found = np.array(own.forward_kinematics(joints))
        if np.abs(found - last).max() < SETTLED:
            return found
        last = found
    return np.full((4, 4), np.nan)


def nearest_rotations(frames: Array) -> Array:
    """Return rotations, of frames whose matrices have drifted by rounding."""
    left, _, right = np.linalg.svd(frames[:, :3, :3])
    return np.asarray(left @ right)


if __name__ == "__main__":
    main()
