"""The machine as nodes of a viser scene: made once, and moved with every pose.

Nothing is added for a new pose: the nodes that there are get other positions. All bars are one
node, and so are all balls and all blocks, so that a pose costs a few messages and draw calls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pteron.errors import PteronError
from pteron.kernels import Array
from pteron.kinematics import joint_screws
from pteron.manipulator import Manipulator
from pteron.motion import Guide, JointPoints, joint_guides, joint_points
from pteron.motion.enlarged_points import enlarged_points
from pteron.plots.canvas import GRID, INK, LEG_COLORS, MUTED, REACH
from pteron.plots.machine_drawing import grid_step
from pteron.viewer.meshes import Mesh, ball, cube, cylinder
from pteron.viewer.solids import (
    Copies,
    arrows,
    machine_size,
    moving_solids,
    quaternion,
    rgb,
    still_solids,
)
from pteron.viewer.state import ViewerState

if TYPE_CHECKING:
    import viser

_SCREW = 0.09
"""Half the length of the arrow along a joint's axis, as a share of the machine's size."""

_FORCE = 0.3
"""Length of the arrow of the largest force, as such a share."""

_FORCE_RADIUS = 0.011
"""Radius of arrows, as such a share."""

_MOST = 2.0
"""Longest arrow, over the one of the force that the scale is made for."""

_DOWN = 0.2
"""Length of the arrow of gravity, as a share of the machine's size."""

_NONE = 1e-9
"""m/s^2 below which there is no gravity."""

_TURNING, _SLIDING = (0.0035, INK), (0.0095, "#d9a400")
"""Radius and colour of joints' screws: those that slide are thicker than their guides."""

_FAR = 1.9
"""Distance of the camera, in sizes of the machine."""


class Scene:
    """The picture of one machine in one working mode."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Manipulator,
        poses: Array,
        compared: tuple[Manipulator, float] | None = None,
    ) -> None:
        """Make the nodes; the guides without limits are as long as the poses (K, m) need.

        The compared machine stands there too, in grey, so many times as far from the first one.
        """
        self._compared = compared
        self._server, self._robot = server, robot
        self._guides = joint_guides(robot, poses)
        points = joint_points(robot, poses[0])
        self.size = machine_size(points, self._guides)
        self._nodes: dict[str, Any] = {}
        low, high = _box(points, self._guides)
        self._center = 0.5 * (low + high)
        self._add_still(points, low, high)
        moving = moving_solids(points, self._guides, self.size)
        self._add_copies("bars", cylinder(), moving.bars)
        self._add_copies("balls", ball(), moving.balls)
        if len(moving.blocks.positions):
            self._add_copies("blocks", cube(), moving.blocks)
        for k, face in enumerate(moving.faces):
            self._add_mesh(f"face{k}", face, REACH, 0.5)
        count = robot.joint_count * points.chain.shape[-2]
        for name, most in (("screws", count), ("forces", robot.joint_count)):
            none = np.zeros((most, 3))
            shafts, heads = arrows(none, none, [1.0] * most, [INK] * most)
            self._add_copies(name, cylinder(), shafts, visible=False)
            self._add_copies(f"{name}-heads", cylinder(0.0), heads, visible=False)
        if compared is not None:
            self._add_copies("compared-bars", cylinder(), _in_grey(moving.bars))
            self._add_copies("compared-balls", ball(), _in_grey(moving.balls))
            self._show_compared(points, poses[0])
        self._aim(points)

    def show(self, state: ViewerState, forces: Array, scale: Array) -> None:
        """Show a state of the machine; arrows are as long as forces (n,) over a scale (n,)."""
        points = joint_points(state.robot, state.pose)
        moving = moving_solids(points, self._guides, self.size)
        self._place("bars", moving.bars)
        self._place("balls", moving.balls)
        if "blocks" in self._nodes:
            self._place("blocks", moving.blocks)
        for k, (corners, _) in enumerate(moving.faces):
            if f"face{k}" in self._nodes:
                self._nodes[f"face{k}"].vertices = corners.astype(np.float32)
        self._show_compared(points, state.pose)
        if self._nodes["screws"].visible:
            self._place_arrows("screws", *self._screws(state, points))
        if self._nodes["forces"].visible:
            self._place_arrows("forces", *self._force_arrows(points, forces, scale))

    def _show_compared(self, points: JointPoints, pose: Array) -> None:
        """Show the compared machine in a pose, if it reaches it."""
        if self._compared is None:
            return
        robot, times = self._compared
        names = "compared-bars", "compared-balls"
        try:
            moved = enlarged_points(points, joint_points(robot, pose), times)
        except PteronError:
            for name in names:
                self._nodes[name].visible = False
            return
        solids = moving_solids(moved, self._guides, self.size)
        for name, copies in zip(names, (solids.bars, solids.balls), strict=True):
            self._place(name, copies)
            self._nodes[name].visible = True

    def set_visible(self, name: str, visible: bool) -> None:
        """Show or hide the joint axes ("screws") or the force arrows ("forces")."""
        for one in (name, f"{name}-heads"):
            self._nodes[one].visible = visible

    def show_slice(self, meshes: Sequence[tuple[Mesh, str]]) -> None:
        """Show surfaces, each with its colour, in place of those before."""
        for name in [name for name in self._nodes if name.startswith("slice")]:
            self._nodes.pop(name).remove()
        for k, (mesh, color) in enumerate(meshes):
            if len(mesh[1]):
                self._add_mesh(f"slice{k}", mesh, color, 0.35)

    def remove(self) -> None:
        """Take the machine out of the picture."""
        for node in self._nodes.values():
            node.remove()
        self._nodes.clear()

    @property
    def up(self) -> Array:
        """The direction that is upwards in the picture, a unit vector."""
        robot = self._robot
        if robot.platform.planar:
            return np.array(robot.platform.frame[1])
        gravity = np.array(robot.gravity)
        up = -gravity if gravity.any() else np.array(robot.platform.frame[2])
        return np.asarray(up / np.linalg.norm(up))

    def _aim(self, points: JointPoints) -> None:
        """Set the camera that a tab begins with: from before and above, or at a right angle."""
        up = self.up
        self._server.scene.set_up_direction(up)
        if points.plane is not None:
            way = np.array(self._robot.platform.axis) - 1e-3 * up
        else:
            side = points.axes[0] - (points.axes[0] @ up) * up
            side = side / np.linalg.norm(side) if np.linalg.norm(side) > 0.1 else _across(up)
            way = -0.75 * np.cross(up, side) + 0.45 * side + 0.4 * up
        camera = self._server.initial_camera
        camera.look_at = self._center
        camera.position = self._center + _FAR * self.size * way / np.linalg.norm(way)
        camera.up = up
        camera.fov = float(np.radians(45.0))

    def _add_still(self, points: JointPoints, low: Array, high: Array) -> None:
        corner = low - 0.04 * self.size * (1.0 - np.abs(self.up))
        if points.plane is not None:
            corner = low - 0.08 * self.size * points.plane.sum(axis=0)
        still = still_solids(points, self._guides, self.size, corner)
        self._add_copies("still-bars", cylinder(), still.bars)
        self._add_copies("still-balls", ball(), still.balls)
        for k, face in enumerate(still.faces):
            self._add_mesh(f"base{k}", face, MUTED, 0.18)
        self._add_grid(points, low, high)
        gravity = np.array(self._robot.gravity)
        if points.plane is not None:
            gravity = gravity @ points.plane.T @ points.plane
        if np.linalg.norm(gravity) > _NONE:
            way = _DOWN * self.size * gravity / np.linalg.norm(gravity)
            start = corner - 1.2 * way - 0.06 * self.size * _across(way / np.linalg.norm(way))
            shafts, heads = arrows(start[None], way[None], [0.004 * self.size], [MUTED])
            self._add_copies("gravity", cylinder(), shafts)
            self._add_copies("gravity-head", cylinder(0.0), heads)
            self._add_label("g", "g", start - 0.3 * way)
        for axis, name in zip(np.eye(3), "xyz", strict=True):
            self._add_label(f"base-{name}", name, corner + 0.16 * self.size * axis)
        taken: list[Array] = []
        for i, (line, guide) in enumerate(zip(points.links, self._guides, strict=True), start=1):
            way = line[0] - points.reference
            beside = way - (way @ guide.axis) * guide.axis
            ends = list(guide.path if guide.slides else line[:1])
            # Of two sliders on one rail each has its number at the end that is nearer, if it can.
            if sum(np.allclose(guide.path[0], other.path[0]) for other in self._guides) > 1:
                ends = [
                    ends[k] for k in np.linalg.norm(np.subtract(ends, line[0]), axis=1).argsort()
                ]
            end = next((p for p in ends if not any(np.allclose(p, q) for q in taken)), ends[0])
            taken.append(end)
            away = beside / (np.linalg.norm(beside) or 1.0)
            self._add_label(f"leg{i}", str(i), end + 0.06 * self.size * away)

    def _add_grid(self, points: JointPoints, low: Array, high: Array) -> None:
        """Put a grid under the machine, or behind it in its plane."""
        normal = np.array(self._robot.platform.axis) if points.plane is not None else self.up
        step = grid_step(points, self._guides)
        span = step * np.ceil(1.3 * self.size / step)
        depth = min(float(low @ normal), float(high @ normal)) - 0.03 * self.size
        center = self._center + (depth - self._center @ normal) * normal
        first = points.plane[0] if points.plane is not None else _across(normal)
        rows = np.array([first, np.cross(normal, first), normal])
        self._nodes["grid"] = self._server.scene.add_grid(
            "/machine/grid",
            width=float(span),
            height=float(span),
            cell_size=step,
            section_size=step,
            section_color=rgb(GRID),
            cell_color=rgb(GRID),
            plane_opacity=0.0,
            shadow_opacity=0.0,
            fade_distance=100.0 * self.size,
            wxyz=quaternion(rows.T),
            position=center,
        )

    def _add_copies(self, name: str, mesh: Mesh, copies: Copies, *, visible: bool = True) -> None:
        self._nodes[name] = self._server.scene.add_batched_meshes_simple(
            f"/machine/{name}",
            *mesh,
            batched_wxyzs=copies.turns,
            batched_positions=copies.positions,
            batched_scales=copies.scales,
            batched_colors=_linear(copies.colors),
            lod="off",
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            visible=visible,
        )

    def _add_mesh(self, name: str, mesh: Mesh, color: str, opacity: float) -> None:
        self._nodes[name] = self._server.scene.add_mesh_simple(
            f"/machine/{name}",
            *mesh,
            color=rgb(color),
            opacity=opacity,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )

    def _add_label(self, name: str, text: str, position: Array) -> None:
        self._nodes[f"label-{name}"] = self._server.scene.add_label(
            f"/machine/label-{name}", text, position=position
        )

    def _place(self, name: str, copies: Copies) -> None:
        node = self._nodes[name]
        node.batched_positions = copies.positions.astype(np.float32)
        node.batched_wxyzs = copies.turns.astype(np.float32)
        node.batched_scales = copies.scales.astype(np.float32)
        if len(node.batched_colors) != len(copies.colors):
            node.batched_colors = _linear(copies.colors)

    def _place_arrows(self, name: str, shafts: Copies, heads: Copies) -> None:
        for one, copies in ((name, shafts), (f"{name}-heads", heads)):
            self._place(one, copies)
            self._nodes[one].batched_colors = _linear(copies.colors)

    def _screws(self, state: ViewerState, points: JointPoints) -> tuple[Copies, Copies]:
        """Return the axes of all joints as arrows; those of sliding joints in another colour."""
        try:
            screws = joint_screws(state.robot, state.pose)
        except PteronError:
            screws = np.full((*points.chain.shape[:2], 6), np.nan)
        turning = np.linalg.norm(screws[..., :3], axis=-1) > 0.5
        axes = np.where(turning[..., None], screws[..., :3], screws[..., 3:])
        starts = points.chain.copy()
        for i, guide in enumerate(self._guides):
            if guide.slides:
                starts[i, 0] = points.links[i][0]
        length = _SCREW * self.size
        units = axes / np.linalg.norm(axes, axis=-1, keepdims=True)
        ways = np.where(np.isnan(starts), np.nan, 2.0 * length * units)
        looks = [_TURNING if turns else _SLIDING for turns in turning.ravel()]
        radii, colors = [self.size * radius for radius, _ in looks], [color for _, color in looks]
        flat = (starts - length * units).reshape(-1, 3)
        return arrows(flat, ways.reshape(-1, 3), radii, colors)

    def _force_arrows(
        self, points: JointPoints, forces: Array, scale: Array
    ) -> tuple[Copies, Copies]:
        """Return the drives' forces as arrows; a torque's is along its axis, as a screw turns.

        A ram's begins at its base joint, along it.
        """
        shares = np.clip(np.nan_to_num(forces) / scale, -_MOST, _MOST)
        starts = np.array([line[0] for line in points.links])
        rams = np.array(points.rams)[:, None]
        along = np.array([line[-1] - line[0] for line in points.links])
        along = along / np.linalg.norm(along, axis=-1, keepdims=True)
        axes = np.where(rams, along, np.array([guide.axis for guide in self._guides]))
        ways = _FORCE * self.size * shares[:, None] * axes
        radii = [_FORCE_RADIUS * self.size] * len(starts)
        return arrows(starts, ways, radii, LEG_COLORS[: len(starts)])


def _box(points: JointPoints, guides: Sequence[Guide]) -> tuple[Array, Array]:
    everything = np.vstack([*points.links, *(guide.path for guide in guides)])
    return everything.min(axis=0), everything.max(axis=0)


def _in_grey(copies: Copies) -> Copies:
    return replace(
        copies, colors=np.tile(np.array(rgb(MUTED), dtype=np.uint8), (len(copies.colors), 1))
    )


def _linear(colors: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return colours (K, 3) as intensities of light, which is what copies of a mesh take."""
    return np.round(255.0 * (colors / 255.0) ** 2.2).astype(np.uint8)


def _across(direction: Array) -> Array:
    """Return a unit vector at a right angle to a direction, near x or y."""
    near = np.eye(3)[0] if abs(direction[0]) < 0.9 else np.eye(3)[1]
    found = near - (near @ direction) * direction
    return np.asarray(found / np.linalg.norm(found))
