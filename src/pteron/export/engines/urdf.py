"""URDF of the opened mechanism, and a closure file that says which points are one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pteron.atomic import write_texts
from pteron.export.engines.formatting import (
    FORMATS,
    from_parent,
    head,
    left_out,
    number,
    row,
    within,
)
from pteron.export.engines.inertia import SHARE
from pteron.export.engines.links import link_shape, links_of, placed
from pteron.export.engines.parts import Tree, TreeBody, TreeJoint, at_zero
from pteron.export.engines.shapes import dressed
from pteron.export.engines.tree import tree
from pteron.export.names import identifier
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
    return rendered(
        "pteron.export",
        "robot.urdf.j2",
        **FORMATS,
        head=head(opened, "URDF"),
        notes=left_out(opened, ("viscous", "coulomb", "max_force", "max_speed")),
        share=SHARE,
        name=identifier(opened.robot),
        opened=opened,
        links=links_of(bodies),
        place_of=lambda link: placed(from_parent(bodies, link.body) if link.first else np.eye(4)),
        link_shape=link_shape,
        joint_of=lambda link: _joint(opened, link.body, link.joint),
    )


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


def closure_yaml(opened: Tree) -> str:
    """Return the closure file: which points of the URDF's links are one."""
    return rendered(
        "pteron.export",
        "closure.yaml.j2",
        head=head(opened, "loops of the URDF"),
        name=identifier(opened.robot),
        opened=opened,
        within=within,
        real=_real,
    )


def _real(value: float) -> str:
    """Return a number that YAML takes for one: with a point, also before an exponent."""
    text = number(value)
    head_, mark, tail = text.partition("e")
    return text if "." in head_ else f"{head_}.0{mark}{tail}"
