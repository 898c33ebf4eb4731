"""The handle on the platform in the viewer: arrows that move it, and a ring that turns it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.viewer.solids import quaternion
from pteron.viewer.state import ViewerState

if TYPE_CHECKING:
    import viser

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
        # Lengths count along the base frame's axes, of a planar machine along its plane's.
        self._ways = self._frame if platform.planar else np.eye(3)
        self._mover = scene.add_transform_controls(
            "/machine/handle",
            scale=_SIZE * size,
            active_axes=(True, True, not platform.planar),
            disable_rotations=True,
            depth_test=False,
            wxyz=quaternion(self._ways.T),
        )
        self._watch(self._mover, self._moved)
        self._turner: Any = None
        if len(platform.rotation_axes) == 1:
            self._turner = scene.add_transform_controls(
                "/machine/ring",
                scale=_SIZE * size,
                active_axes=(True, True, False),
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
        """Return the pose that the ring is turned to, its angle next to the one before."""
        w, x, y, z = self._turner.wxyz
        first = np.array(
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
        )
        angle = float(np.arctan2(self._frame[1] @ first, self._frame[0] @ first))
        pose, angular = self._pose.copy(), self._robot.platform.angular
        pose[angular] += (angle - pose[angular] + np.pi) % (2.0 * np.pi) - np.pi
        return pose

    def show(self, state: ViewerState) -> None:
        """Follow the platform; a handle that someone holds is left where the pointer is."""
        self._pose = state.pose
        if self._held:
            return
        position, axes = state.robot.platform.at(state.pose)
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
