"""The lengths that rams' screws add where universal joints at both ends turn their pistons.

Lengths are told as if pistons did not spin, which a ball joint leaves free. A universal joint in
its place turns the piston with the platform, and the screw in the cylinder with it: the ram is
longer than its motor has counted, by its lead times the piston's turns.
"""

from __future__ import annotations

import numpy as np

from pteron.kinematics.evaluate import finite_rows
from pteron.kinematics.sampling import draw_poses
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.shapes import PerJoint, PoseLike

_POSES = 256
"""Random poses within limits over which the greatest length is taken."""


def screw_lengths(robot: RobotLike, pose: PoseLike) -> PerJoint:
    """Return the lengths that screws add to rams with universal joints at both ends.

    The joint at the platform has a first axis that is parallel to that of the joint at the base,
    `direction`, where the pose's angles are 0: there screws add nothing. Threads are right-handed.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.

    Returns
    -------
    array, shape (..., n)
        m: a motor that turns its screw for a length L is to go to L less this. 0 for legs without
        `screw_lead`. LinuxCNC's genhexkins goes to L and this: there `screw-lead` has the other
        sign.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import screw_lengths
    >>> screw_lengths(pteron.load("delta"), [0.0, 0.0, -0.9])
    array([0., 0., 0.])
    """
    robot = as_manipulator(robot)
    poses = finite_rows(robot, pose, "pose")
    lengths = np.zeros((*poses.shape[:-1], robot.joint_count))
    place, axes = robot.platform.placement(poses)
    start = robot.platform.placement(np.zeros(robot.freedom))[1]
    for i, leg in enumerate(robot.legs):
        if leg.screw_lead is None:
            continue
        base = np.array(leg.base_axis)
        way = place + np.array(leg.platform_point) @ axes - np.array(leg.guide_point)
        way /= np.linalg.norm(way, axis=-1, keepdims=True)
        # Across the ram the joints hold the cylinder by one of these, and the piston by the other.
        base_normal, piston_normal = np.cross(base, way), np.cross((start @ base) @ axes, way)
        sine = (way * np.cross(base_normal, piston_normal)).sum(axis=-1)
        spin = np.arctan2(sine, (base_normal * piston_normal).sum(axis=-1))
        lengths[..., i] = leg.screw_lead * spin / (2.0 * np.pi)
    return lengths


def screw_warnings(robot: Manipulator) -> tuple[str, ...]:
    """Return a warning of the length that screws may add to a machine's rams, if it has screws."""
    if all(leg.screw_lead is None for leg in robot.legs):
        return ()
    added = np.abs(screw_lengths(robot, draw_poses(robot, _POSES, np.random.default_rng(0))))
    leg = int(added.max(axis=0).argmax())
    return (
        "screw_lead: lengths are told as if no piston spun about its axis, which ball joints leave "
        "free; universal joints in their place would turn it, and add up to "
        f"{1e3 * added.max():.2g} mm (leg {leg + 1}): see pteron.workspace.screw_lengths",
    )
