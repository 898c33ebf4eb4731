"""Export to Pinocchio: the opened mechanism as a model, and the constraints that close its loops.

Pinocchio's constrained dynamics has no coupled joints. The inertia of a body that a gear turns with
the platform is therefore added to the platform's, times the square of the gear's ratio.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pteron.errors import ModelError
from pteron.export.engines.formatting import FORMATS, from_parent, head, number, omission_notes
from pteron.export.engines.parts import Tree, TreeBody, bodies_at_zero
from pteron.export.engines.tree import tree
from pteron.export.names import identifier
from pteron.export.writing import write_export
from pteron.extras import install_command
from pteron.kernels.code import render_template
from pteron.manipulator import RobotLike, as_manipulator
from pteron.shapes import PoseLike


def export_pinocchio(
    robot: RobotLike, folder: str | Path = ".", *, home: PoseLike | None = None
) -> list[Path]:
    """Write a Python file whose `build()` returns a Pinocchio model with its loop constraints.

    The file needs Pinocchio and NumPy only. `build` returns the model, its constraints and their
    data, the matrix of the motors, and the coordinates at the home pose. Joints have the
    names and coordinates of the machine's logs; a point of each leg is held to the platform in
    three directions.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its platform must not slide (`slides`), whose halves need coupled joints.
    folder : path
        Where the file goes; it is made if it is missing.
    home : array, shape (m,), optional
        The pose at which passive joints are zero, m and rad; see `export_mjcf`.

    Returns
    -------
    list of Path
        The one file written, named after the machine: a module of Python.

    Raises
    ------
    ModelError
        If the machine's platform slides.
    DataError, UnreachablePose
        If `home` is no pose, or out of reach.
    OutputError
        If the file cannot be written.

    Examples
    --------
    >>> import pteron, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = pteron.export.export_pinocchio(pteron.load("five-bar"), folder)
    >>> [path.name for path in files]
    ['five_bar_pinocchio.py']
    """
    robot = as_manipulator(robot)
    name = identifier(robot).replace("-", "_")
    name = f"robot_{name}" if name[0].isdigit() else name
    return write_export(folder, {f"{name}_pinocchio.py": pinocchio_source(tree(robot, home))})


def pinocchio_model(robot: RobotLike, *, home: PoseLike | None = None) -> Any:
    """Return the Pinocchio model and its constraints, as the exported file's `build()` does.

    Parameters
    ----------
    robot, home
        See `export_pinocchio`.

    Returns
    -------
    ClosedModel
        A named tuple: model, constraints, constraint_datas, motors (n, nv), home (nq,).

    Raises
    ------
    ModelError
        If Pinocchio is not installed, or the machine's platform slides.

    Examples
    --------
    >>> import pteron
    >>> closed = pteron.export.pinocchio_model(pteron.load("delta"))
    >>> closed.model.nv, len(closed.constraints), closed.motors.shape
    (12, 3, (3, 12))
    """
    robot = as_manipulator(robot)
    try:
        import pinocchio  # type: ignore[import-not-found,unused-ignore]  # noqa: F401
    except ImportError as error:
        absent = isinstance(error, ModuleNotFoundError) and error.name == "pinocchio"
        raise ModelError(
            f"Pinocchio {'is not installed' if absent else f'cannot be imported ({error})'}; "
            f"{install_command('oracles')}, or pip install pin"
        ) from None
    source = pinocchio_source(tree(robot, home))
    # The text of the exported file is run, so that both return the same.
    module: dict[str, Any] = {"__name__": f"{identifier(robot)}_pinocchio"}
    exec(compile(source, f"<{robot.name} for Pinocchio>", "exec"), module)
    return module["build"]()


def pinocchio_source(opened: Tree) -> str:
    """Return the text of the Python file."""
    robot = opened.robot
    coupled = [body for body in opened.bodies if body.joints[0].follows is not None]
    if any(body.joints[0].is_prismatic for body in coupled):
        raise ModelError(
            "the halves of its platform slide by phi, which takes coupled joints, and Pinocchio's "
            "constrained dynamics have none; export it as MJCF, SDF or URDF",
            subject=robot.name,
        )
    every = bodies_at_zero(opened)
    armature = {motor.joint: motor.ratio**2 * motor.drive.inertia for motor in opened.motors}
    notes = omission_notes(opened, ("inertia",))
    if coupled:
        notes.append(
            "What gears turn is in the platform's inertia: the square of its ratio times its own."
        )
    return render_template(
        "pteron.export",
        "robot.pinocchio.j2",
        **FORMATS,
        head=head(opened, "Python for Pinocchio"),
        notes=notes,
        name=identifier(robot),
        opened=opened,
        bodies=_merge_gears(every),
        armature=armature,
        joints={joint.name: joint for joint in opened.joints},
        place_of=lambda body: from_parent(every, body)[:3],
        symmetric=lambda body: body.tensor[np.tril_indices(3)],
        bound=_bound,
        list=_list,
    )


def _merge_gears(bodies: Sequence[TreeBody]) -> list[TreeBody]:
    """Return the bodies without geared ones, whose inertia is added to that of their parents."""
    links = []
    for k, body in enumerate(bodies):
        if body.joints[0].follows is not None:
            continue
        gears = [b for b in bodies if b.parent == k and b.joints[0].follows is not None]
        for gear in gears:
            follows = gear.joints[0].follows
            assert follows is not None
            body = _with_gear(body, gear, 1.0 + follows[1])
        links.append(body)
    return links


def _with_gear(body: TreeBody, gear: TreeBody, ratio: float) -> TreeBody:
    """Return a body merged with a balanced one at its origin that turns `ratio` times as fast.

    Only the moment about z acts, and it is exact.
    """
    mass = body.mass + gear.mass
    center = (body.mass * body.center + gear.mass * gear.center) / mass
    offset = (gear.center - body.center) @ body.axes[:, :2]
    about = body.moments[2] + ratio**2 * gear.moments[2]
    about += body.mass * gear.mass / mass * float(offset @ offset)
    moments = np.array([0.6, 0.7, 1.0]) * about
    return replace(body, mass=mass, center=center, moments=moments)


def _bound(limit: float | None, infinite: str) -> str:
    """Return a joint limit as a literal; the text for infinity if there is no limit."""
    return infinite if limit is None else number(limit)


def _list(array: Any) -> str:
    """Return an array's values, flattened, as literals with commas."""
    return ", ".join(map(number, np.ravel(array)))
