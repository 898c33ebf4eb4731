"""IEC 61131-3 Structured Text for a PLC: one function block a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pteron import atomic
from pteron.export.c import prefix_of
from pteron.export.functions import Exported, chosen
from pteron.export.structured_text import function_block
from pteron.export.text import banner, described
from pteron.manipulator import Manipulator

__all__ = ["BLOCKS", "export_st"]

BLOCKS = ("inverse_kinematics", "inverse_dynamics")
"""What is exported unless a choice is given."""


def export_st(
    robot: Manipulator,
    functions: Sequence[str] = BLOCKS,
    folder: str | Path = ".",
    *,
    specialised: bool = True,
) -> list[Path]:
    """Write function blocks in Structured Text for a machine, a file each.

    A block has the function's inputs and outputs as arrays of LREAL (SI units, radians), and
    `Valid` and `Status` beside them: 0 where the outputs are those of the inputs, 1 where a leg
    does not reach, 2 at a singularity, 3 where an input is no usable number. It never takes the
    root of a negative number nor divides by zero; where it is not valid the outputs hold their last
    values.

    Parameters
    ----------
    robot : Manipulator
        The machine; its name becomes the prefix of the blocks and the files.
    functions : sequence of str
        As for `export_c`; by default inverse kinematics and inverse dynamics. For direct
        kinematics, `"closure_poses"` is written, whose poses a leg may not reach; it calls ATAN2,
        which some controllers have in a library only.
    folder : path
        Where; made if it is missing.
    specialised : bool
        Whether the machine's inertial parameters are folded in, instead of being an input.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ModelError
        If a function's name is unknown.
    OutputError
        If the folder cannot be written.

    Examples
    --------
    >>> import pteron, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = pteron.export_st(pteron.load("tripteron"), folder=folder)
    >>> [path.name for path in files]
    ['Tripteron_InverseKinematics.st', 'Tripteron_InverseDynamics.st']
    """
    # A block is valid or not as a whole; but of two assembly modes one alone may be in reach.
    names = [functions] if isinstance(functions, str) else functions
    closures = ["closure_poses" if name == "direct_kinematics" else name for name in names]
    exported = chosen(robot, closures, specialised=specialised)
    prefix = _camel(prefix_of(robot))
    texts = {f"{prefix}_{_camel(item.name)}": item for item in exported}
    target = atomic.make_folder(folder)
    return [
        atomic.write_text(target / f"{name}.st", _block(robot, name, item))
        for name, item in texts.items()
    ]


def _block(robot: Manipulator, name: str, item: Exported) -> str:
    inputs = item.labelled.program.inputs
    comments = [*banner(robot, "Structured Text"), "", item.summary]
    comments.append(f"{item.operations} arithmetic operations.")
    return function_block(
        name,
        item.labelled.graph,
        inputs,
        item.outputs,
        comments,
        {port.name: described(port, item) for port in (*inputs, *item.outputs)},
        item.labelled.names,
    )


def _camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))
