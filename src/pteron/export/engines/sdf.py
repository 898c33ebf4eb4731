"""SDF, for Gazebo and others: the whole machine, its loops closed by ball joints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pteron.atomic import write_texts
from pteron.export.engines.formatting import (
    BASE_COLOR,
    COLORS,
    PLATFORM_COLOR,
    frame,
    head,
    left_out,
    number,
    row,
    small,
    within,
)
from pteron.export.engines.inertia import SHARE, between_joints
from pteron.export.engines.link_shapes import LinkShape, link_shape, placed
from pteron.export.engines.parts import BASE, Tree, TreeBody, TreeJoint
from pteron.export.engines.shapes import dressed
from pteron.export.engines.tree import tree
from pteron.export.names import identifier
from pteron.kernels.code import rendered
from pteron.manipulator import RobotLike, as_manipulator
from pteron.shapes import PoseLike


def export_sdf(
    robot: RobotLike, folder: str | Path = ".", *, home: PoseLike | None = None
) -> list[Path]:
    """Write a machine as SDF: a world with the closed machine in it.

    SDF has joints between any two links: ball joints close the loops. The file's pose is the home
    pose, at which all joints are at zero.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    folder : path
        Where the file goes; it is made if it is missing.
    home : array, shape (m,), optional
        The pose in which the machine stands, m and rad; see `export_mjcf`.

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
    ...     files = pteron.export.export_sdf(pteron.load("delta"), folder)
    >>> [path.name for path in files]
    ['delta.sdf']
    """
    robot = as_manipulator(robot)
    return write_texts(folder, {f"{identifier(robot)}.sdf": sdf(tree(robot, home))})


def sdf(opened: Tree) -> str:
    """Return a machine as SDF."""
    opened = dressed(opened)
    closings = []
    for closing in opened.closings:
        one, other = opened.bodies[closing.one], opened.bodies[closing.other]
        # A joint's place is told in the frame of its child.
        point = row(within(one, closing.point))
        closings.append(
            {"name": f"{closing.name}_ball", "one": one.name, "other": other.name, "point": point}
        )
    return rendered(
        "pteron.export",
        "robot.sdf.j2",
        head=head(opened, "SDF"),
        notes=left_out(opened, ("viscous", "coulomb", "max_force", "max_speed")),
        share=SHARE,
        name=identifier(opened.robot),
        gravity=row(opened.robot.gravity),
        base=[link_shape(shape, None) for _, shape in opened.base],
        base_color=BASE_COLOR,
        links=[link for body in opened.bodies for link in _links(opened, body)],
        closings=closings,
        visual=_visual,
    )


def _links(opened: Tree, body: TreeBody) -> list[dict[str, Any]]:
    """Return a body's links with their joints: those between joints at one place are light."""
    parent = "base" if body.parent == BASE else opened.bodies[body.parent].name
    pose = " ".join(placed(frame(body)))
    found: list[dict[str, Any]] = []
    for k, joint in enumerate(body.joints):
        last = k == len(body.joints) - 1
        mass, moments = body.mass, body.moments
        if not last:
            mass, moments = between_joints(mass, moments)
        link = {
            "name": body.name if last else f"{joint.name}_link",
            "parent": parent,
            "pose": pose,
            "joint": _joint(opened, body, joint),
            "mass": small(mass),
            "center": row(within(body, body.center)) if last else "0 0 0",
            "moments": [small(moment) for moment in moments],
            "looks": [link_shape(shape, body) for shape in body.shapes] if last else [],
            "color": COLORS[(body.color - 1) % len(COLORS)] if body.color else PLATFORM_COLOR,
        }
        found.append(link)
        parent = str(link["name"])
    return found


def _joint(opened: Tree, body: TreeBody, joint: TreeJoint) -> dict[str, Any]:
    """Return a joint's texts; its limits are told from the home pose."""
    limit, dynamics = [], []
    if joint.limits is not None:
        low, high = (number(bound - joint.home) for bound in joint.limits)
        limit += [f"<lower>{low}</lower>", f"<upper>{high}</upper>"]
    for motor in opened.motors:
        if motor.joint != joint.name:
            continue
        drive, ratio = motor.drive, abs(motor.ratio)
        if drive.max_force:
            limit.append(f"<effort>{number(ratio * drive.max_force)}</effort>")
        if drive.max_speed:
            limit.append(f"<velocity>{number(drive.max_speed / ratio)}</velocity>")
        if drive.viscous or drive.coulomb:
            dynamics.append(f"<damping>{number(ratio**2 * drive.viscous)}</damping>")
            dynamics.append(f"<friction>{number(ratio * drive.coulomb)}</friction>")
    follows = joint.follows
    return {
        "name": joint.name,
        "type": "prismatic" if joint.slides else "revolute",
        "axis": row(joint.axis @ body.axes),
        "home": number(joint.home),
        "limit": "".join(limit),
        "dynamics": "".join(dynamics),
        "mimic": None if follows is None else (follows[0], number(follows[1])),
    }


def _visual(shape: LinkShape, count: int, color: str) -> str:
    sizes = {
        "sphere": f"<sphere><radius>{shape.radius}</radius></sphere>",
        "cylinder": f"<cylinder><radius>{shape.radius}</radius><length>{shape.length}</length>"
        "</cylinder>",
        "box": f"<box><size>{shape.side} {shape.side} {shape.length}</size></box>",
    }
    return (
        f'<visual name="look{count}"><pose>{shape.place} {shape.turn}</pose>'
        f"<geometry>{sizes[shape.kind]}</geometry>"
        f"<material><ambient>{color}</ambient><diffuse>{color}</diffuse></material></visual>"
    )
