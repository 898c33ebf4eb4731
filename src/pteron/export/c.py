"""Export of C99 for a controller: a header and a source, with a test program and a CMakeLists.txt.

The code has no allocation, no static state, one exit a function, nothing but math.h. Comparisons
are C99's macros, which are quiet for NaN: a plain `<` raises the flag of invalid operations. In
double precision sines, cosines and exponentials are the library's own arithmetic, so that a
controller's code gives the bits that `simulate` has, on whatever machine it runs.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from pteron.errors import ModelError
from pteron.export.command_units import Output
from pteron.export.descriptions import banner
from pteron.export.exported_function import ExportedFunction
from pteron.export.functions import PLACES, FunctionChoice, exported_functions
from pteron.export.names import prefix_of
from pteron.export.writing import write_export
from pteron.kernels import Array
from pteron.kernels.code import (
    C,
    arithmetic,
    c_constant,
    names_of,
    render_template,
    single_precision,
    statements,
    used_inputs,
)
from pteron.kernels.graph import CONSTANT
from pteron.manipulator import Manipulator, RobotLike, as_manipulator

Real = Literal["double", "float"]
"""C's type of numbers."""

_WIDTH = 97
"""Width of comments."""


def export_c(
    robot: RobotLike,
    functions: FunctionChoice | None = None,
    folder: str | Path = ".",
    *,
    real: Real = "double",
    specialised: bool = False,
    wrench: bool = False,
    output: Output = "force",
    base: str | Path | None = None,
) -> list[Path]:
    """Write C99 for a machine: its functions, a test program and a CMakeLists.txt.

    Every function takes and fills arrays in the order and the units of the library's own (SI,
    radians; matrices by rows) and returns a status: 0, or 1 where a leg does not reach (or the pose
    is NaN), or 2 where a result is not finite (singular, or an input was not). The outputs are
    always defined: what cannot be computed is NaN. Roots and divisions are guarded, so that no
    floating-point trap is set off by a pose out of reach or singular; infinities and numbers
    whose powers leave the range of the type may overflow.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its name becomes the prefix of the functions and the files.
    functions : sequence of str or of controllers
        Names of what `compile` accepts, and `"inverse_dynamics_base"`, `"feed_forward_base"` or
        `"joint_feed_forward_base"`, from base parameters as `base_parameters` and `pteron
        identify` list them. By default inverse and direct kinematics, Jacobian, inverse dynamics
        from the inertial parameters and from base parameters, forward dynamics, the regressor and
        `"set_payload"`, whose parameters the others take while a payload is carried; for a machine
        with drives `"feed_forward"` and `"joint_feed_forward"` too. Where direct kinematics have no
        closed form, `"direct_step"` comes in their place. A controller stands for its law, with a
        table of its gains; a law's name has those that it has by default. A `Custom` controller is
        called as its function is, with tables of its parameters.
    folder : path
        The folder to write to; made if it is missing.
    real : {"double", "float"}
        The type of the numbers.
    specialised : bool
        Whether the machine's inertial parameters are folded in, for fewest operations, instead of
        being an argument. The constant tables of them are left out then.
    wrench : bool
        Whether inverse and forward dynamics take a wrench on the platform too, after the state.
    output : {"force", "torque", "percent"}
        What the functions of drives return: forces at the joints, torques of the motors (N m), or
        per cent of their rated torques, by each drive's `ratio` and `rated_torque`.
    base : path, optional
        The identification.json of `pteron identify`: its base parameters, friction and offsets are
        the values of the code, which then needs no real bodies.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ModelError
        If a function's name is unknown, or `real` or `output` is; if a drive lacks what the output
        needs.
    DataError
        If `base` is no identification of this machine.
    OutputError
        If the folder cannot be written.

    Examples
    --------
    >>> import pteron, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = pteron.export_c(pteron.load("quadrupteron"), ["inverse_kinematics"], folder)
    >>> sorted(path.name for path in files)
    ['CMakeLists.txt', 'quadrupteron.c', 'quadrupteron.h', 'test_quadrupteron.c']
    """
    robot = as_manipulator(robot)
    exported = exported_functions(
        robot, functions, specialised=specialised, wrench=wrench, output=output, base=base
    )
    return write_export(folder, c_texts(robot, exported, real))


def c_texts(
    robot: Manipulator, exported: Sequence[ExportedFunction], real: Real = "double"
) -> dict[str, str]:
    """Return the files of `export_c` by their names: header, source, test, CMakeLists.txt."""
    variables, prefix = source_variables(robot, exported, real, "C99"), prefix_of(robot)
    rounding = float(np.finfo(np.float32 if real == "float" else np.float64).eps)
    variables["tolerance"] = _tolerance_of(rounding)
    files = {
        f"{prefix}.h": "header.h.j2",
        f"{prefix}.c": "source.c.j2",
        f"test_{prefix}.c": "test.c.j2",
        "CMakeLists.txt": "CMakeLists.txt.j2",
    }
    folder = "pteron.export"
    return {file: render_template(folder, name, **variables) for file, name in files.items()}


def source_variables(
    robot: Manipulator,
    exported: Sequence[ExportedFunction],
    real: Real,
    language: Literal["C99", "CUDA"],
) -> dict[str, Any]:
    """Return the variables of the templates of C and CUDA; ModelError if `real` is unknown."""
    if real not in get_args(Real):
        raise ModelError(f'real: {real!r} is neither "double" nor "float"')
    prefix, single = prefix_of(robot), real == "float"
    return {
        "banner": banner(robot, language),
        "prefix": prefix,
        "upper": prefix.upper(),
        "real": real,
        "f": "f" if single else "",
        "printer": CPrinter(prefix, real, device=language == "CUDA"),
        "tables": {t.name: t for function in exported for t in function.tables}.values(),
        "functions": exported,
        "largest": 3.4028234e38 if single else 1.7976931348623157e308,
        **arithmetic(),
    }


def _tolerance_of(rounding: float) -> Callable[[float], float]:
    """Return the function from a result's gain to its relative tolerance.

    Of a hexapod's thousand operations rounding sums up to some tens of units in the last place, and
    the gain magnifies it; the least is 1000 units.
    """
    return lambda gain: 1000.0 * rounding * max(gain, 1.0)


@dataclass(frozen=True)
class CPrinter:
    """Writes numbers, comments and functions in C."""

    prefix: str
    real: Real
    device: bool = False
    """Whether it is CUDA, whose functions and constants are of the file that includes them."""

    @property
    def table(self) -> str:
        """The qualifiers before the type of a constant table or an exported function."""
        return "static __device__ " if self.device else ""

    @property
    def helper(self) -> str:
        """The qualifiers before the type of a helper function, which exported functions call."""
        return "static __device__ " if self.device else "static "

    def number(self, number: float) -> str:
        """Return a literal; `NAN` itself is a float."""
        number = float(number)
        if number != number:
            return f"(({self.real})NAN)"
        return c_constant(number, "float32" if self.real == "float" else "float64")

    def rows(self, array: Array) -> str:
        """Return literals, four a line."""
        texts = [self.number(number) for number in array.ravel()]
        rows = [", ".join(texts[k : k + 4]) for k in range(0, len(texts), 4)]
        return ",\n    ".join(rows)

    def comment(self, function: ExportedFunction) -> list[str]:
        """Return the lines over a function's declaration."""
        lines = [*textwrap.wrap(function.summary, _WIDTH), ""]
        for direction, ports in (("in", function.inputs), ("out", function.outputs)):
            for port in ports:
                shape = " x ".join(map(str, port.shape)) or "1"
                shape += ", by rows" if len(port.shape) > 1 else ""
                text = f"{direction:<3} {port.name} ({shape}): {function.meanings[port.name]}"
                lines += textwrap.wrap(text.rstrip(": "), _WIDTH, subsequent_indent="      ")
        return [*lines, "", f"{function.operations} arithmetic operations."]

    def prototype(self, function: ExportedFunction) -> str:
        """Return a function's declaration."""
        head = f"{self.table}int {self.prefix}_{function.name}("
        pointer = f"{self.real} *{self.prefix.upper()}_RESTRICT"
        arguments = [f"const {pointer} {port.name}" for port in function.inputs]
        arguments += [f"{pointer} {port.name}" for port in function.outputs]
        return head + (",\n" + " " * len(head)).join(arguments) + ")"

    def _operations(self) -> dict[str, str]:
        """Return the forms of operations in C, roots and quotients guarded."""
        replacements = {
            "sin": f"{self.prefix}_sincos({{0}}).sine",
            "cos": f"{self.prefix}_sincos({{0}}).cosine",
            "exp": f"{self.prefix}_exponential({{0}})",
        }
        printed = single_precision(C) if self.real == "float" else C | replacements
        unity, zero = self.number(1.0), self.number(0.0)
        return printed | {
            "less": f"isless({{0}}, {{1}}) ? {unity} : {zero}",
            "select": f"({{0}} > {zero}) ? {{1}} : {zero}",
            "sqrt": f"{self.prefix}_root({{0}})",
            "div": f"{self.prefix}_ratio({{0}}, {{1}})",
        }

    def body(self, function: ExportedFunction) -> tuple[list[str], list[tuple[str, str]]]:
        """Return the statements of a function, and its conditions with the failures they mean."""
        graph, nodes = function.graph, function.graph.nodes
        names = names_of(graph, lambda i, j: f"{function.inputs[i].name}[{j}]", self.number)
        names = [function.names.get(k, name) for k, name in enumerate(names)]
        guarded = self._operations()
        plain = guarded | {"div": C["div"]}
        lines, radicands = [], []
        for k in graph.operations():
            node = nodes[k]
            by_number = node.operation == "div" and nodes[node.arguments[1]].operation == CONSTANT
            form = f"const {self.real} {{0}} = {{1}};"
            lines += statements(graph, [k], names, plain if by_number else guarded, form)
            of_number = nodes[node.arguments[0]].operation == CONSTANT
            tests = ("sqrt",) if function.compares else ("sqrt", "less")
            if node.operation in tests and not (node.shared or of_number):
                radicands.append(names[node.arguments[0]])
        finite = []
        for port, places in zip(function.outputs, graph.outputs, strict=True):
            for j, k in enumerate(places):
                lines.append(f"{port.name}[{j}] = {names[k]};")
                if nodes[k].operation != CONSTANT:
                    finite.append(f"{self.prefix}_finite({port.name}[{j}])")
        used = {i for i, _ in used_inputs(graph)}
        placed = [i for i, port in enumerate(function.inputs) if port.name in PLACES]
        lines += [
            f"(void){port.name};"
            for i, port in enumerate(function.inputs)
            if i not in used and i not in placed
        ]
        # A number that no output depends on is tested too: the caller's pose is wrong.
        known = [
            f"({self.prefix}_finite({function.inputs[i].name}[{j}]) != 0)"
            for i in placed
            for j in range(function.inputs[i].size)
        ]
        failures = [(f"!({_join_conditions(known)})", "UNREACHABLE")] if known else []
        if function.several:
            failures.append((self._no_pose(function), "UNREACHABLE"))
            return lines, failures
        reached = [f"(isgreaterequal({name}, {self.number(0.0)}) != 0)" for name in radicands]
        failures += [(f"!({_join_conditions(reached)})", "UNREACHABLE")] if reached else []
        if finite:
            regular = _join_conditions(f"({test} != 0)" for test in finite)
            failures.append((f"!({regular})", "NOT_FINITE"))
        return lines, failures

    def _no_pose(self, function: ExportedFunction) -> str:
        """Return the condition that no row of an output is a pose of finite numbers."""
        (port,) = function.outputs
        rows, columns = port.shape
        tests = [f"({self.prefix}_finite({port.name}[{j}]) != 0)" for j in range(port.size)]
        poses = [tests[i * columns : (i + 1) * columns] for i in range(rows)]
        return _join_conditions(f"!({' && '.join(pose)})" for pose in poses)


def _join_conditions(tests: Iterable[str]) -> str:
    """Return the conjunction of C conditions, joined by line breaks."""
    return "\n        && ".join(tests)
