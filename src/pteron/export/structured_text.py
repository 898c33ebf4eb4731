"""Export of IEC 61131-3 Structured Text: one function block a file, which cannot stop the PLC.

Inputs beyond a range are refused before anything is computed; `guards` rules out all other causes
of a stop. Where a guard fails the outputs stay as they were.
"""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from pteron.controllers import Custom
from pteron.equations.machine import closure_of
from pteron.errors import ModelError
from pteron.export.command_units import Output
from pteron.export.descriptions import banner
from pteron.export.exported_function import ExportedFunction
from pteron.export.functions import FunctionChoice, choice_list, exported_functions
from pteron.export.guards import INPUT_POWER, Names, Statements, element, power
from pteron.export.names import prefix_of
from pteron.export.tools import tool_lines
from pteron.export.writing import write_export
from pteron.kernels import Graph, Port
from pteron.kernels.code import render_template
from pteron.manipulator import Manipulator, RobotLike, as_manipulator

_BLOCKS = ("inverse_kinematics", "inverse_dynamics")
"""Functions exported by default."""

_LREAL = 300
"""Power of ten that no number may exceed: LREAL ends at 1.8E+308."""

_WIDTH = 96
"""Width of comments."""

_STATUSES = (("Usable", 3), ("Reachable", 1), ("Regular", 2))
"""The conditions in the order in which they are tested, and the status where one fails."""


def export_st(
    robot: RobotLike,
    functions: FunctionChoice | None = None,
    folder: str | Path = ".",
    *,
    specialised: bool | None = None,
    wrench: bool = False,
    output: Output = "force",
    base: str | Path | None = None,
) -> list[Path]:
    """Write function blocks in Structured Text for a machine, a file each.

    A block has the function's inputs and outputs as arrays of LREAL (SI units, radians), and
    `Valid` and `Status` beside them: 0 where the outputs are those of the inputs, 1 where a leg
    does not reach, 2 at a singularity, 3 where an input is no usable number. It never takes the
    root of a negative number nor divides by zero; where it is not valid the outputs hold their last
    values.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its name becomes the prefix of the blocks and the files.
    functions : sequence of str
        As for `export_c`; by default inverse kinematics and inverse dynamics, and `feed_forward`
        and `joint_feed_forward` of a machine with drives. For direct kinematics, `"closure_poses"`
        is written, whose poses a leg may not reach, or `"direct_step"` where they have no closed
        form. Angles are computed by ATAN2, which some controllers have in a library only.
    folder : path
        Where; made if it is missing.
    specialised : bool, optional
        Whether the machine's inertial parameters are folded in, instead of being an input that
        `set_payload` returns; by default they are, unless `"set_payload"` is asked for. All other
        numbers, such as gains and those of drives, are folded in always.
    wrench : bool
        Whether inverse and forward dynamics take a wrench on the platform too.
    output : {"force", "torque", "percent"}
        As for `export_c`: what the functions of drives return.
    base : path, optional
        As for `export_c`: the identification.json whose values the code has.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ModelError
        If a function's name is unknown, or `output` is; if a drive lacks what the output needs.
    DataError
        If `base` is no identification of this machine.
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
    robot = as_manipulator(robot)
    # A block is valid or not as a whole; but of two assembly modes one alone may be in reach.
    direct = "closure_poses" if closure_of(robot).closed_form else "direct_step"
    names = None if functions is None else choice_list(functions)
    if names is not None:
        controllers = [function.law_name for function in names if isinstance(function, Custom)]
        if controllers:
            raise ModelError(
                f"functions: {controllers[0]}, a Custom controller, can be exported as C alone: "
                "export_c"
            )
        names = [direct if name == "direct_kinematics" else name for name in names]
    if specialised is None:
        specialised = not {"set_payload", "set_payload_base"}.intersection(map(str, names or ()))
    exported = exported_functions(
        robot,
        names,
        usual=_BLOCKS,
        specialised=specialised,
        wrench=wrench,
        output=output,
        base=base,
        tables=False,
    )
    prefix = _pascal_case(prefix_of(robot))
    blocks = {f"{prefix}_{_pascal_case(f.name)}": f for f in exported}
    return write_export(
        folder, {f"{name}.st": _block(robot, name, f) for name, f in blocks.items()}
    )


def _block(robot: Manipulator, name: str, code: ExportedFunction) -> str:
    """Return the Structured Text of a function block, with its comments."""
    comments = [*banner(robot, "Structured Text"), "", code.summary]
    comments.append(f"{code.operations} arithmetic operations.")
    if code.name.startswith("set_payload"):
        comments += tool_lines(robot)
    if any(node.operation == "atan2" for node in code.graph.nodes):
        comments.append("It calls ATAN2(y, x), which some controllers have in a library only.")
    return function_block(
        name, code.graph, code.inputs, code.outputs, comments, code.meanings, code.names
    )


def _pascal_case(name: str) -> str:
    """Return a snake_case name in PascalCase."""
    return "".join(part.capitalize() for part in name.split("_"))


def function_block(
    name: str,
    graph: Graph,
    inputs: Sequence[Port],
    outputs: Sequence[Port],
    comments: Sequence[str] = (),
    descriptions: Mapping[str, str] | None = None,
    labels: Mapping[int, str] | None = None,
    *,
    largest: float = _LREAL,
) -> str:
    """Return a FUNCTION_BLOCK that computes a graph, in ASCII if all texts passed in are.

    `comments` are lines for its head, `descriptions` say what ports mean, `labels` what nodes are
    called (the others are t1, t2 and so on); `largest` is the power of ten of the largest LREAL.
    Arrays count from 0; matrices keep their rows. What is NaN in every state is never written. A
    constant that LREAL does not hold is a ValueError.
    """
    names = Names(
        [name, "Valid", "Status", *dict(_STATUSES), *(port.name for port in (*inputs, *outputs))]
    )
    body = Statements(graph, inputs, names, labels or {}, largest)
    flags = [
        flag for flag, _ in _STATUSES if flag in body.flags or (flag == "Usable" and body.used)
    ]
    tests = [f"(ABS({used}) <= {power(INPUT_POWER)})" for used in body.used]
    said = descriptions or {}
    return render_template(
        "pteron.export",
        "block.st.j2",
        name=name,
        comment=_comment(name, comments, flags),
        inputs=_declare_ports(inputs, said),
        outputs=_declare_ports(outputs, said),
        variables=_declare_variables(flags, "BOOL") + _declare_variables(body.temporaries, "LREAL"),
        flags=flags,
        usable=_wrap_text(f"Usable := {' AND '.join(tests)};") if tests else [],
        statements=body.lines,
        results=[
            f"{element(port, j)} := {body.number(k)};"
            for port, nodes in zip(outputs, graph.outputs, strict=True)
            for j, k in enumerate(nodes)
            if body.names[k]
        ],
        statuses=_STATUSES,
    )


def _comment(name: str, comments: Sequence[str], flags: Collection[str]) -> list[str]:
    """Return the lines of the comment at the head."""
    reasons = {
        "Usable": f"3 where an input is not a number of at most {power(INPUT_POWER)};",
        "Reachable": "1 where it is out of reach: a radicand is negative;",
        "Regular": "2 where it is singular: a divisor is zero, or a number too large;",
    }
    lines = [
        name,
        *comments,
        "",
        "No input can make it trap. Where Valid is FALSE the outputs hold their last valid values.",
        "Status is",
        *(text for flag, text in reasons.items() if flag in flags),
        "0 elsewhere, and there alone Valid is TRUE.",
    ]
    return [part for line in lines for part in _wrap_text(_harmless(line), "") or [""]]


def _harmless(text: str) -> str:
    """Return a text that cannot end or open a comment."""
    return text.replace("(*", "( *").replace("*)", "* )")


def _declare_ports(ports: Sequence[Port], descriptions: Mapping[str, str]) -> list[str]:
    """Return the declarations of ports as LREAL or arrays of it, with descriptions as comments."""
    lines = []
    for port in ports:
        ranges = ", ".join(f"0..{count - 1}" for count in port.shape)
        kind = f"ARRAY[{ranges}] OF LREAL" if ranges else "LREAL"
        text = f"{port.name} : {kind};"
        if descriptions.get(port.name):
            text += f" (* {_harmless(descriptions[port.name])} *)"
        lines += _wrap_text(text)
    return lines


def _declare_variables(names: Sequence[str], kind: str) -> list[str]:
    """Return the declaration of variables of one type."""
    return _wrap_text(f"{', '.join(names)} : {kind};") if names else []


def _wrap_text(text: str, indent: str = "    ") -> list[str]:
    """Return a text in as few lines as hold it, the later ones indented."""
    return textwrap.wrap(
        text, _WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )
