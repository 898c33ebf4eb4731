"""Export to SDF, for Gazebo and others: the whole machine, its loops closed by ball joints."""

from __future__ import annotations

from pathlib import Path

from pteron.export.engines.formatting import FORMATS, frame, head, omission_notes
from pteron.export.engines.inertia import SHARE
from pteron.export.engines.links import frame_texts, joint_drive, link_shape, links_of
from pteron.export.engines.parts import Tree
from pteron.export.engines.shapes import add_shapes
from pteron.export.engines.tree import tree
from pteron.export.names import identifier
from pteron.export.writing import write_export
from pteron.kernels.code import render_template
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
    return write_export(folder, {f"{identifier(robot)}.sdf": sdf(tree(robot, home))})


def sdf(opened: Tree) -> str:
    """Return a machine as SDF."""
    opened = add_shapes(opened)
    return render_template(
        "pteron.export",
        "robot.sdf.j2",
        **FORMATS,
        head=head(opened, "SDF"),
        notes=omission_notes(opened, ("viscous", "coulomb", "max_force", "max_speed")),
        share=SHARE,
        name=identifier(opened.robot),
        opened=opened,
        links=links_of(opened.bodies),
        frame=frame,
        frame_texts=frame_texts,
        link_shape=link_shape,
        drive_of=lambda joint: joint_drive(opened, joint),
    )
