"""Export to MJCF, for MuJoCo: the whole machine, its loops closed, with its drives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.dynamics import inverse_dynamics
from pteron.export.engines.formatting import (
    FORMATS,
    body_frame_points,
    from_parent,
    head,
    omission_notes,
    row,
    small,
)
from pteron.export.engines.parts import BASE, BodyShape, Tree, TreeBody
from pteron.export.engines.shapes import add_shapes
from pteron.export.engines.tree import tree
from pteron.export.names import identifier
from pteron.export.writing import write_export
from pteron.kernels import Array
from pteron.kernels.code import render_template
from pteron.manipulator import RobotLike, as_manipulator
from pteron.shapes import PoseLike
from pteron.tolerances import SAME

STEP = 2e-4
"""The file's step of integration, s."""

STIFFNESS = 0.2
"""The rate at which the loops' constraints pull gaps back, times the step."""


def export_mjcf(
    robot: RobotLike, folder: str | Path = ".", *, home: PoseLike | None = None
) -> list[Path]:
    """Write a machine for MuJoCo: bodies, looks, closed loops, drives, and a keyframe.

    All loops are closed by `connect` constraints, and gears by constraints of joints. The actuated
    joints have the names and the coordinates of the machine's logs; a drive's inertia, viscous and
    dry friction are the joint's armature, damping and frictionloss, its greatest force the
    actuator's control range.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    folder : path
        Where the file goes; it is made if it is missing.
    home : array, shape (m,), optional
        The pose in which the machine opens, m and rad; where it is left out that with all joints in
        the middle of their ranges, or the best of random ones.

    Returns
    -------
    list of Path
        The one file written, named after the machine.

    Raises
    ------
    DataError, UnreachablePose
        If `home` is no pose, or out of reach.
    OutputError
        If the file cannot be written.

    Examples
    --------
    >>> import pteron, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = pteron.export.export_mjcf(pteron.load("delta"), folder)
    >>> [path.name for path in files]
    ['delta.xml']
    """
    robot = as_manipulator(robot)
    return write_export(folder, {f"{identifier(robot)}.xml": mjcf(tree(robot, home))})


def mjcf(opened: Tree, *, step: float = STEP) -> str:
    """Return a machine as MJCF, for an integration by this step, s."""
    opened = add_shapes(opened)
    children: list[list[int]] = [[] for _ in opened.bodies]
    roots: list[int] = []
    for k, body in enumerate(opened.bodies):
        (roots if body.parent == BASE else children[body.parent]).append(k)
    return render_template(
        "pteron.export",
        "robot.mjcf.j2",
        **FORMATS,
        head=head(opened, "MJCF"),
        notes=_notes(opened),
        name=identifier(opened.robot),
        step=step,
        rate=STIFFNESS / step,
        opened=opened,
        children=children,
        roots=roots,
        sites=_sites(opened),
        motors={joint.name: None for joint in opened.joints}
        | {motor.joint: motor for motor in opened.motors},
        hold=_hold(opened),
        local=lambda body, points: points if body is None else body_frame_points(body, points),
        same=lambda shape: np.ptp(shape.ends, axis=0).max() < SAME,
        half=lambda shape: float(np.linalg.norm(shape.ends[1] - shape.ends[0])) / 2.0,
        moments=_moments,
        frame_texts=lambda body: _frame_texts(opened, body),
        **_scene(opened),
    )


def _notes(opened: Tree) -> list[str]:
    """Return notes on data that MJCF cannot represent, and on shaft-driven joints."""
    written = ("inertia", "viscous", "coulomb", "offset", "max_force")
    said = [
        f"{motor.name} turns {motor.joint}; its actuator's gear is the shaft's ratio."
        for motor in opened.motors
        if motor.name != motor.joint
    ]
    return [*said, *omission_notes(opened, written)]


def _frame_texts(opened: Tree, body: TreeBody) -> tuple[str, str]:
    """Return a body's position and quaternion (w x y z) in its parent's frame, as texts."""
    there = from_parent(opened.bodies, body)
    x, y, z, w = scipy.spatial.transform.Rotation.from_matrix(there[:3, :3]).as_quat(canonical=True)
    return row(there[:3, 3]), row([w, x, y, z])


def _moments(body: TreeBody) -> list[str]:
    """Return a body's moments of inertia, and its products if there are any."""
    return list(map(small, [*body.moments, *(body.products if body.products.any() else ())]))


def _hold(opened: Tree) -> Array:
    """Return the controls (n,) that hold the machine at home, clipped to the drives' limits."""
    zeros = np.zeros(opened.robot.freedom)
    forces = inverse_dynamics(opened.robot, opened.home, zeros, zeros, on_failure="nan")
    forces = forces + [motor.drive.offset for motor in opened.motors]
    most = np.array([motor.drive.max_force or np.inf for motor in opened.motors])
    return np.asarray(np.clip(np.nan_to_num(forces), -most, most))


def _sites(opened: Tree) -> list[list[tuple[str, Array]]]:
    """Return each body's sites: the two sides of every closing, and the tool's centre point."""
    sites: list[list[tuple[str, Array]]] = [[] for _ in opened.bodies]
    for closing in opened.closings:
        sites[closing.one].append((f"{closing.name}_end", closing.point))
        sites[closing.other].append((f"{closing.name}_seat", closing.point))
    p, axes = opened.robot.platform.placement(opened.home)
    sites[opened.platform].append(("tool", p + np.array(opened.robot.platform.tool) @ axes))
    return sites


def _scene(opened: Tree) -> dict[str, Any]:
    """Return the poses of floor, light and camera."""
    shapes: list[BodyShape] = [shape for body in opened.bodies for shape in body.shapes]
    points = np.vstack([shape.ends for shape in [*shapes, *(shape for _, shape in opened.base)]])
    gravity = np.array(opened.robot.gravity)
    weight = float(np.linalg.norm(gravity))
    up = -gravity / weight if weight else np.array([0.0, 0.0, 1.0])
    low, high = points.min(axis=0), points.max(axis=0)
    center, extent = (low + high) / 2.0, float(np.linalg.norm(high - low))
    floor = center + (float((points @ up).min()) - center @ up - 0.08 * opened.size) * up
    normal = opened.robot.platform.plane_normal
    if normal is not None and abs(normal @ up) < 0.5:
        toward = np.array(normal)
    else:
        side = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
        side /= np.linalg.norm(side)
        toward = 0.75 * side + 0.55 * np.cross(up, side) + 0.45 * up
    toward /= np.linalg.norm(toward)
    right = np.cross(up, toward)
    right /= np.linalg.norm(right)
    return {
        "up": up,
        "center": center,
        "extent": extent,
        "floor": floor,
        "camera": center + 1.2 * extent * toward,
        "view": np.array([right, np.cross(toward, right)]),
        "light": center + 2.0 * extent * up,
        "shine": -(up + 0.4 * right + 0.3 * toward),
    }
