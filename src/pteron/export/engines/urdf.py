"""URDF of the opened mechanism, and a closure file that says which points are one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pteron.atomic import write_texts
from pteron.export.engines.formatting import (
    BASE_COLOR,
    COLORS,
    PLATFORM_COLOR,
    frame,
    head,
    inverse,
    left_out,
    material,
    number,
    row,
    small,
    within,
)
from pteron.export.engines.inertia import SHARE, between_joints
from pteron.export.engines.link_shapes import LinkShape, link_shape, placed
from pteron.export.engines.parts import BASE, Tree, TreeBody, TreeJoint, at_zero
from pteron.export.engines.shapes import dressed
from pteron.export.engines.tree import tree
from pteron.export.names import identifier
from pteron.kernels import Array
from pteron.kernels.code import rendered
from pteron.manipulator import RobotLike, as_manipulator
from pteron.shapes import PoseLike

_MOST = 1e6
"""Stands for no limit of effort (N, N m) or velocity, which URDF requires."""

_FAR = 1e3
"""Stands for no limit of a joint that slides, m."""


def export_urdf(
    robot: RobotLike, folder: str | Path = ".", *, home: PoseLike | None = None
) -> list[Path]:
    """Write the opened machine as URDF, and a closure file, YAML, that says how its loops close.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    folder : path
        Where the files go; it is made if it is missing.
    home : array, shape (m,), optional
        The pose at which passive joints are zero, m and rad; see `export_mjcf`.

    Returns
    -------
    list of Path
        The URDF and the closure file, named after the machine. The latter has `closures`, pairs of
        points (m) in frames of links; `motors`; `home`, all joints' coordinates with the loops
        closed; and `gravity`.

    Raises
    ------
    DataError, UnreachablePose
        If `home` is no pose, or out of reach.
    OutputError
        If a file cannot be written.

    Examples
    --------
    >>> import pteron, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = pteron.export.export_urdf(pteron.load("delta"), folder)
    >>> [path.name for path in files]
    ['delta.urdf', 'delta.closure.yaml']
    """
    robot = as_manipulator(robot)
    opened, name = tree(robot, home), identifier(robot)
    texts = {f"{name}.urdf": urdf(opened), f"{name}.closure.yaml": closure_yaml(opened)}
    return write_texts(folder, texts)


def urdf(opened: Tree) -> str:
    """Return the opened machine as URDF."""
    opened = dressed(opened)
    bodies = at_zero(opened)
    links: list[dict[str, Any]] = []
    for body in bodies:
        links += _links(opened, bodies, body)
    name = identifier(opened.robot)
    legs = [(f"leg{k}", COLORS[(k - 1) % len(COLORS)]) for k in range(1, len(opened.motors) + 1)]
    return rendered(
        "pteron.export",
        "robot.urdf.j2",
        head=head(opened, "URDF"),
        notes=left_out(opened, ("viscous", "coulomb", "max_force", "max_speed")),
        closure=f"{name}.closure.yaml",
        gravity=", ".join(map(number, opened.robot.gravity)),
        name=name,
        colors=[("base", BASE_COLOR), ("platform", PLATFORM_COLOR), *legs],
        share=SHARE,
        base=[link_shape(shape, None) for _, shape in opened.base],
        links=links,
        visual=_visual,
    )


def _links(opened: Tree, bodies: Sequence[TreeBody], body: TreeBody) -> list[dict[str, Any]]:
    """Return a body's links with their joints: those between joints at one place are light."""
    parent, before = "base", np.eye(4)
    if body.parent != BASE:
        parent, before = bodies[body.parent].name, frame(bodies[body.parent])
    place, turn = placed(inverse(before) @ frame(body))
    found: list[dict[str, Any]] = []
    for k, joint in enumerate(body.joints):
        last = k == len(body.joints) - 1
        mass, moments = body.mass, body.moments
        if not last:
            mass, moments = between_joints(mass, moments)
        link = {
            "name": body.name if last else f"{joint.name}_link",
            "parent": parent,
            "place": place,
            "turn": turn,
            "joint": _joint(opened, body, joint),
            "mass": small(mass),
            "center": row(within(body, body.center)) if last else "0 0 0",
            "moments": [small(moment) for moment in moments],
            "looks": [link_shape(shape, body) for shape in body.shapes] if last else [],
            "material": material(body),
        }
        found.append(link)
        parent, place, turn = str(link["name"]), "0 0 0", "0 0 0"
    return found


def _joint(opened: Tree, body: TreeBody, joint: TreeJoint) -> dict[str, Any]:
    """Return a joint's texts."""
    kind, limits = ("prismatic" if joint.slides else "revolute"), joint.limits
    if limits is None and not joint.slides:
        kind = "continuous"
    low, high = limits or (-_FAR, _FAR)
    drives = [motor for motor in opened.motors if motor.joint == joint.name]
    effort = speed = _MOST
    dynamics = ""
    for motor in drives:
        drive, ratio = motor.drive, abs(motor.ratio)
        effort = ratio * drive.max_force if drive.max_force else _MOST
        speed = drive.max_speed / ratio if drive.max_speed else _MOST
        if drive.viscous or drive.coulomb:
            damping, friction = number(ratio**2 * drive.viscous), number(ratio * drive.coulomb)
            dynamics = f'damping="{damping}" friction="{friction}"'
    limit = f'effort="{number(effort)}" velocity="{number(speed)}"'
    if kind != "continuous":
        limit = f'lower="{number(low)}" upper="{number(high)}" {limit}'
    follows = joint.follows
    return {
        "name": joint.name,
        "type": kind,
        "axis": row(joint.axis @ body.axes),
        "limit": limit if drives or kind != "continuous" else "",
        "dynamics": dynamics,
        "mimic": None if follows is None else (follows[0], number(follows[1])),
    }


def _visual(shape: LinkShape, name: str) -> str:
    sizes = {
        "sphere": f'<sphere radius="{shape.radius}"/>',
        "cylinder": f'<cylinder radius="{shape.radius}" length="{shape.length}"/>',
        "box": f'<box size="{shape.side} {shape.side} {shape.length}"/>',
    }
    origin = f'<origin xyz="{shape.place}" rpy="{shape.turn}"/>'
    geometry = f"<geometry>{sizes[shape.kind]}</geometry>"
    return f'<visual>{origin}{geometry}<material name="{name}"/></visual>'


def closure_yaml(opened: Tree) -> str:
    """Return the closure file: which points of the URDF's links are one."""
    name = identifier(opened.robot)
    closings = []
    for closing in opened.closings:
        one, other = opened.bodies[closing.one], opened.bodies[closing.other]
        closings.append(
            {
                "name": closing.name,
                "one": one.name,
                "end": _list(within(one, closing.point)),
                "other": other.name,
                "seat": _list(within(other, closing.point)),
            }
        )
    return rendered(
        "pteron.export",
        "closure.yaml.j2",
        head=head(opened, "loops of the URDF"),
        urdf=f"{name}.urdf",
        name=name,
        closings=closings,
        motors=[
            {"name": motor.name, "joint": motor.joint, "ratio": _real(motor.ratio)}
            for motor in opened.motors
        ],
        home=[(joint.name, _real(joint.home)) for joint in opened.joints],
        gravity=_list(np.array(opened.robot.gravity)),
    )


def _real(value: float) -> str:
    """Return a number that YAML takes for one: with a point, also before an exponent."""
    text = number(value)
    head_, mark, tail = text.partition("e")
    return text if "." in head_ else f"{head_}.0{mark}{tail}"


def _list(values: Array) -> str:
    return ", ".join(map(_real, values))
