"""Export to URDF: the opened mechanism, and a YAML file with the closures of its loops."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pteron.export.engines.formatting import (
    FORMATS,
    body_frame_points,
    from_parent,
    head,
    number,
    omission_notes,
)
from pteron.export.engines.inertia import SHARE
from pteron.export.engines.links import frame_texts, joint_drive, link_shape, links_of
from pteron.export.engines.parts import Tree, bodies_at_zero
from pteron.export.engines.shapes import add_shapes
from pteron.export.engines.tree import tree
from pteron.export.names import identifier
from pteron.export.writing import write_export
from pteron.kernels.code import render_template
from pteron.manipulator import RobotLike, as_manipulator
from pteron.shapes import PoseLike

_MOST = 1e6
"""Limit of effort (N, N m) or velocity where there is none: URDF requires one."""

_FAR = 1e3
"""Limit, m, of a joint that slides where there is none: URDF requires one."""


def export_urdf(
    robot: RobotLike, folder: str | Path = ".", *, home: PoseLike | None = None
) -> list[Path]:
    """Write the opened machine as URDF, and a YAML file with the closures of its loops.

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
    return write_export(folder, texts)


def urdf(opened: Tree) -> str:
    """Return the opened machine as URDF."""
    opened = add_shapes(opened)
    bodies = bodies_at_zero(opened)
    return render_template(
        "pteron.export",
        "robot.urdf.j2",
        **FORMATS,
        head=head(opened, "URDF"),
        notes=omission_notes(opened, ("viscous", "coulomb", "max_force", "max_speed")),
        share=SHARE,
        name=identifier(opened.robot),
        opened=opened,
        links=links_of(bodies),
        place_of=lambda link: frame_texts(
            from_parent(bodies, link.body) if link.first else np.eye(4)
        ),
        link_shape=link_shape,
        most=_MOST,
        far=_FAR,
        drive_of=lambda joint: joint_drive(opened, joint),
    )


def closure_yaml(opened: Tree) -> str:
    """Return the text of the closure file: pairs of points of the URDF's links that coincide."""
    return render_template(
        "pteron.export",
        "closure.yaml.j2",
        head=head(opened, "loops of the URDF"),
        name=identifier(opened.robot),
        opened=opened,
        body_frame_points=body_frame_points,
        real=_real,
    )


def _real(coordinate: float) -> str:
    """Return a number as text that YAML reads as a float: with a point, before an exponent too."""
    text = number(coordinate)
    head_, mark, tail = text.partition("e")
    return text if "." in head_ else f"{head_}.0{mark}{tail}"
