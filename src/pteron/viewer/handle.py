"""The handle on the platform in the viewer: arrows that move it, and rings that turn it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.platforms.nearest_pose import pose_nearest_frame
from pteron.viewer.solids import axes_of, quaternion
from pteron.viewer.state import ViewerState

if TYPE_CHECKING:
    import viser

_ALONG = 0.5
"""Cosine to one of the pose's directions above which an axis has an arrow."""

_SIZE = 0.16
"""Length of the arrows, as a share of the machine's size."""


class Handle:
    """The handle of one machine; `pull` takes the pose (m,) to which it is dragged."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Manipulator,
        size: float,
        pull: Callable[[Array], None],
    ) -> None:
        platform = robot.platform
        self._robot, self._pull = robot, pull
        self._held = False
        self._pose = np.zeros(robot.freedom)
        self._frame = np.array(platform.frame)
        scene = server.scene
        self._mover: Any = None
        if platform.lengths:
            # Lengths count along the base frame's axes, or along some of the platform's at rest.
            whole = len(platform.lengths) == 3
            ways = np.eye(3) if whole else self._frame
            along = np.abs(ways @ platform.directions.T).max(axis=-1) > _ALONG
            self._mover = scene.add_transform_controls(
                "/machine/handle",
                scale=_SIZE * size,
                active_axes=(bool(along[0]), bool(along[1]), bool(along[2])),
                disable_rotations=True,
                depth_test=False,
                wxyz=quaternion(ways.T),
            )
            self._watch(self._mover, self._moved)
        self._turner: Any = None
        if platform.rotation_axes:
            self._turner = scene.add_transform_controls(
                "/machine/ring",
                scale=_SIZE * size,
                active_axes=(True, True, platform.tilts),
                disable_axes=True,
                disable_sliders=True,
                depth_test=False,
            )
            self._watch(self._turner, self._turned)

    def _watch(self, gizmo: Any, act: Callable[[], Array]) -> None:
        async def dragged(event: Any) -> None:
            self._held = event.phase != "end"
            if event.phase != "start":
                self._pull(act())

        gizmo.on_update(dragged)

    def _moved(self) -> Array:
        """Return the pose that the arrows are at."""
        pose = self._pose.copy()
        directions = self._robot.platform.directions
        pose[~self._robot.platform.angular] = directions @ self._mover.position
        return pose

    def _turned(self) -> Array:
        """Return the pose that the rings are turned to, its angles next to those before.

        A platform that cannot turn as they are follows as nearly as it can.
        """
        axes = axes_of(self._turner.wxyz)
        if self._robot.platform.tilts:
            return pose_nearest_frame(self._robot.platform, self._pose, axes)
        angle = float(np.arctan2(self._frame[1] @ axes[0], self._frame[0] @ axes[0]))
        pose, angular = self._pose.copy(), self._robot.platform.angular
        pose[angular] += (angle - pose[angular] + np.pi) % (2.0 * np.pi) - np.pi
        return pose

    def show(self, state: ViewerState) -> None:
        """Follow the platform; a handle that someone holds is left where the pointer is."""
        self._pose = state.pose
        if self._held:
            return
        position, axes = state.robot.platform.at(state.pose)
        if self._mover is not None:
            self._mover.position = position
        if self._turner is not None:
            self._turner.position = position
            self._turner.wxyz = quaternion(axes.T)

    def set_visible(self, visible: bool) -> None:
        """Show or hide it."""
        for gizmo in (self._mover, self._turner):
            if gizmo is not None:
                gizmo.visible = visible

    def remove(self) -> None:
        """Take it out of the picture."""
        for gizmo in (self._mover, self._turner):
            if gizmo is not None:
                gizmo.remove()
