"""The machine of the viewer as plain data that `picture.js` draws: bodies, arrows, a slice."""

from __future__ import annotations

from typing import Any

import numpy as np

from pteron.errors import PteronError
from pteron.kernels import Array
from pteron.kinematics import joint_screws
from pteron.manipulator import Manipulator
from pteron.motion import JointPoints, joint_guides, joint_points
from pteron.motion.enlarged_points import enlarged_points
from pteron.report.motion_frames import moving_parts, picture_points, still_parts
from pteron.report.typeset import significant
from pteron.viewer.boundary import is_allowed
from pteron.viewer.state import ViewerState

_SCREW, _FORCE = 0.09, 0.3
"""Half the length of the arrow along a joint's axis, and the length of the largest force's, as
shares of the machine's size."""

_SCREW_RADIUS, _SLIDING_RADIUS, _FORCE_RADIUS, _BENT_RADIUS = 0.0035, 0.006, 0.009, 0.005
"""Radii of arrows, as such shares; a torque's is thinner than any bar."""

_MOST = 2.0
"""Longest arrow of a force, over the one of the force that the scale is made for."""

_BEND, _TURN, _WHOLE = 0.085, np.pi, 1.75 * np.pi
"""Radius of a torque's bent arrow as such a share, how far it goes round for the torque that the
scale is made for, and at most, rad."""

_BENDS = 25
"""Points of a bent arrow."""

_POSES = 40
"""Most poses that the picture's size is made for."""

_NEAR = 0.6
"""Distance of these from the home pose, over that of random ones."""

Arrow = tuple[Any, str | int, float]
"""Points from start to tip, colour by name or by leg from 0, radius over the machine's size."""


class ViewerPicture:
    """The picture of a machine in a working mode; guides span the joints of poses (K, m).

    The compared machine stands there too, so many times as far from the first one.
    """

    def __init__(
        self, robot: Manipulator, poses: Array, compared: tuple[Manipulator, float] | None
    ) -> None:
        self._robot, self._compared = robot, compared
        self._guides = joint_guides(robot, poses)
        home = joint_points(robot, poses[0])
        near = poses[0] + _NEAR * (poses[:: max(1, len(poses) // _POSES)] - poses[0])
        around = joint_points(robot, near[is_allowed(robot, near)])
        lines = [line.reshape(-1, 3) for line in (*around.links, around.reference, around.tool)]
        cloud = np.vstack(lines)
        paths = np.vstack([*home.links, *(guide.path for guide in self._guides)])
        self.size = float(np.ptp(paths, axis=0).max())
        self.still = still_parts(robot, self._guides, home)
        self.cloud = picture_points(robot, cloud)

    def moment(
        self, state: ViewerState, forces: Array, scale: Array, *, screws: bool
    ) -> dict[str, Any]:
        """Return the machine's picture in a state; arrow lengths are forces (n,) over a scale."""
        points = joint_points(state.robot, state.pose)
        return {
            "now": moving_parts(self._robot, points),
            "ghost": self._ghost(points, state.pose),
            "forces": self._forces(points, forces, scale),
            "arrows": self._screws(state, points) if screws else [],
            "tip": picture_points(self._robot, points.tool),
        }

    def _ghost(self, points: JointPoints, pose: Array) -> dict[str, Any] | None:
        """Return the compared machine's picture at a pose; None if it does not reach it."""
        if self._compared is None:
            return None
        robot, times = self._compared
        try:
            moved = enlarged_points(points, joint_points(robot, pose), times)
        except PteronError:
            return None
        return moving_parts(self._robot, moved)

    def legend(self, scale: Array) -> str:
        """Return the legend of the force arrows, with their scale (n,)."""
        square = self.still["grid"] / (_FORCE * self.size)
        stands = {"N": (square, "the length of a square"), "N m": (1.0, "half a turn")}
        units = [leg.joint.force_unit for leg in self._robot.legs]
        sizes = dict(zip(units, scale, strict=True))
        scales = [
            f"{words} stands for {significant(share * sizes[unit])} {unit}"
            for unit, (share, words) in stands.items()
            if unit in sizes
        ]
        bent = ", round its axis the way it turns" if "N m" in sizes else ""
        return f"arrows: what each drive gives{bent}; {', '.join(scales)}"

    def _arrow(self, points: Array, color: str | int, radius: float) -> Arrow:
        """Return an arrow through points (2, 3), in the picture's frame."""
        return picture_points(self._robot, points), color, radius

    def _screws(self, state: ViewerState, points: JointPoints) -> list[Arrow]:
        """Return the axes of all joints; those of sliding joints are thicker, in another colour."""
        try:
            screws = joint_screws(state.robot, state.pose)
        except PteronError:
            return []
        arrows, length = list[Arrow](), _SCREW * self.size
        for i, guide in enumerate(self._guides):
            for j, screw in enumerate(screws[i]):
                at = points.links[i][0] if guide.is_prismatic and j == 0 else points.chain[i, j]
                turns = bool(np.linalg.norm(screw[:3]) > 0.5)
                axis = screw[:3] if turns else screw[3:]
                if np.isfinite([*at, *axis]).all() and axis.any():
                    way = length * axis / np.linalg.norm(axis)
                    look = ("ink", _SCREW_RADIUS) if turns else ("warning", _SLIDING_RADIUS)
                    arrows.append(self._arrow(np.array([at - way, at + way]), *look))
        return arrows

    def _forces(self, points: JointPoints, forces: Array, scale: Array) -> list[Arrow]:
        """Return the drives' forces; a torque's arrow goes round its axis, from the crank on.

        A ram's begins at its base joint, along it.
        """
        arrows = list[Arrow]()
        shares = np.nan_to_num(forces) / scale
        for i, (line, guide) in enumerate(zip(points.links, self._guides, strict=True)):
            leg_vector = line[-1] - line[0]
            axis = leg_vector / np.linalg.norm(leg_vector) if points.rams[i] else guide.axis
            if self._robot.legs[i].joint.force_unit == "N m":
                angle = np.clip(_TURN * shares[i], -_WHOLE, _WHOLE)
                path = line[0] + _BEND * self.size * _round(axis, line[1] - line[0], angle)
                arrows.append(self._arrow(path, i, _BENT_RADIUS))
            else:
                way = _FORCE * self.size * np.clip(shares[i], -_MOST, _MOST) * axis
                arrows.append(self._arrow(np.array([line[0], line[0] + way]), i, _FORCE_RADIUS))
        return arrows


def _round(axis: Array, arm: Array, angle: float) -> Array:
    """Return unit vectors (K, 3) on an arc about an axis, from an arm's direction on."""
    normal = np.cross(axis, arm)
    if np.linalg.norm(normal) < 1e-6 * np.linalg.norm(arm):  # an arm along the axis has no side
        normal = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    normal /= np.linalg.norm(normal)
    turns = np.linspace(0.0, angle, _BENDS)[:, None]
    directions: Array = np.cos(turns) * np.cross(normal, axis) + np.sin(turns) * normal
    return directions
