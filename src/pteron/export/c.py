"""C99 for a controller: one header and one source, with a test program and a CMakeLists.txt.

No allocation, no static state, one exit a function, nothing but math.h. Comparisons are those of
C99's macros, which are quiet for NaN: a plain `<` sets off the trap for invalid operations.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pteron import atomic
from pteron.errors import ModelError
from pteron.export.c_templates import CHECK, CMAKE, HEADER, HELPERS, TEST
from pteron.export.functions import FUNCTIONS, Exported, Table, chosen
from pteron.export.text import banner, described
from pteron.kernels import Array, Port
from pteron.kernels.code import C, c_constant, single_precision, statements
from pteron.manipulator import Manipulator

__all__ = ["Real", "export_c"]

Real = Literal["double", "float"]


def export_c(
    robot: Manipulator,
    functions: Sequence[str] = FUNCTIONS,
    folder: str | Path = ".",
    *,
    real: Real = "double",
    specialised: bool = False,
) -> list[Path]:
    """Write C99 for a machine: its functions, a test program and a CMakeLists.txt.

    Every function takes and fills arrays in the order and the units of the library's own (SI,
    radians; matrices by rows) and returns a status: 0, or 1 where a leg does not reach (or the pose
    is NaN), or 2 where a result is not finite (singular, or an input was not). The outputs are
    always defined: what cannot be computed is NaN. Roots and divisions are guarded, so that no
    floating-point trap is set off by a pose out of reach or singular; infinities and numbers beyond
    1e30 may overflow.

    Parameters
    ----------
    robot : Manipulator
        The machine; its name becomes the prefix of the functions and the files.
    functions : sequence of str
        Names of what `compile` accepts, or `"inverse_dynamics_base"`, from the cheapest base
        parameters. By default inverse and direct kinematics, Jacobian, inverse dynamics from the
        inertial parameters and from base parameters, forward dynamics and the regressor.
    folder : path
        Where; made if it is missing.
    real : {"double", "float"}
        The type of the numbers.
    specialised : bool
        Whether the machine's inertial parameters are folded in, for fewest operations, instead of
        being an argument. The constant tables of them are left out then.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ModelError
        If a function's name is unknown, or `real` is.
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
    if real not in ("double", "float"):
        raise ModelError(f'real: {real!r} is neither "double" nor "float"')
    exported = chosen(robot, functions, specialised=specialised)
    writer = _Writer(robot, exported, real)
    name = writer.prefix
    texts = {
        f"{name}.h": writer.header(),
        f"{name}.c": writer.source(),
        f"test_{name}.c": writer.test(),
        "CMakeLists.txt": CMAKE.format(name=name),
    }
    target = atomic.make_folder(folder)
    return [atomic.write_text(target / file, text) for file, text in texts.items()]


def prefix_of(robot: Manipulator) -> str:
    """Return the machine's name as an identifier of C."""
    name = re.sub(r"[^a-z0-9]+", "_", robot.name.lower()).strip("_")
    return name if name and not name[0].isdigit() else f"robot_{name}".rstrip("_")


@dataclass(frozen=True)
class _Writer:
    robot: Manipulator
    exported: tuple[Exported, ...]
    real: Real

    @property
    def prefix(self) -> str:
        return prefix_of(self.robot)

    @property
    def _dtype(self) -> str:
        return "float32" if self.real == "float" else "float64"

    @property
    def _suffix(self) -> str:
        return "f" if self.real == "float" else ""

    def _number(self, value: float) -> str:
        if value != value:
            return f"(({self.real})NAN)"  # NAN itself is a float
        return c_constant(value, self._dtype)

    def _prototype(self, item: Exported) -> str:
        name = f"int {self.prefix}_{item.name}("
        restrict = f"{self.prefix.upper()}_RESTRICT"
        arguments = [
            f"const {self.real} *{restrict} {port.name}" for port in item.labelled.program.inputs
        ]
        arguments += [f"{self.real} *{restrict} {port.name}" for port in item.outputs]
        return name + (",\n" + " " * len(name)).join(arguments) + ")"

    def header(self) -> str:
        """Return the header."""
        guard = f"{self.prefix.upper()}_H"
        parts = []
        for item in self.exported:
            lines = [f"{item.summary}", ""]
            inputs = item.labelled.program.inputs
            lines += [_argument("in", port, described(port, item)) for port in inputs]
            lines += [_argument("out", port, described(port, item)) for port in item.outputs]
            lines += ["", f"{item.operations} arithmetic operations."]
            parts.append(_comment(lines) + self._prototype(item) + ";\n")
        tables = "".join(
            f"{_comment([table.comment])}"
            f"extern const {self.real} {self.prefix}_{table.name}[{len(table.values)}];\n\n"
            for table in self._tables()
        )
        return HEADER.format(
            banner=_comment(banner(self.robot, "C99")),
            guard=guard,
            upper=self.prefix.upper(),
            tables=tables,
            functions="\n".join(parts),
        )

    def source(self) -> str:
        """Return the source."""
        bodies = [self._body(item) for item in self.exported]
        text = "".join(bodies)
        helpers = [
            helper.format(real=self.real, f=self._suffix, p=self.prefix, **_limits(self))
            for name, helper in HELPERS.items()
            if f"{self.prefix}_{name}(" in text
        ]
        tables = []
        for table in self._tables():
            rows = [
                f"    {self._number(value)}{',' if k < len(table.values) - 1 else ''} /* {name} */"
                for k, (name, value) in enumerate(zip(table.names, table.values, strict=True))
            ]
            head = f"const {self.real} {self.prefix}_{table.name}[{len(table.values)}] = {{"
            tables.append("\n".join([head, *rows, "};", "", ""]))
        return "".join(
            [
                _comment(banner(self.robot, "C99")),
                f'#include "{self.prefix}.h"\n\n#include <math.h>\n\n',
                *tables,
                *(f"{helper}\n" for helper in helpers),
                "\n".join(bodies),
            ]
        )

    def _tables(self) -> list[Table]:
        return list({table.name: table for item in self.exported for table in item.tables}.values())

    def _body(self, item: Exported) -> str:
        graph, p = item.labelled.graph, self.prefix
        inputs = item.labelled.program.inputs
        names: list[str] = []
        for k, node in enumerate(graph.nodes):
            if node.operation == "input":
                names.append(f"{inputs[node.arguments[0]].name}[{node.arguments[1]}]")
            elif node.operation == "constant":
                names.append(self._number(node.value))
            else:
                names.append(item.labelled.names[k])
        f = self._suffix
        printed = single_precision(C) if f else dict(C)
        one, zero = self._number(1.0), self._number(0.0)
        printed["less"] = f"isless({{0}}, {{1}}) ? {one} : {zero}"
        printed["select"] = f"({{0}} > {zero}) ? {{1}} : {zero}"
        guarded = printed | {"sqrt": f"{p}_root({{0}})", "div": f"{p}_ratio({{0}}, {{1}})"}
        lines, radicands = [], []
        used: set[int] = set()
        for k in graph.operations():
            node = graph.nodes[k]
            for i in node.arguments:
                if graph.nodes[i].operation == "input":
                    used.add(graph.nodes[i].arguments[0])
            constant = node.operation == "div" and (
                graph.nodes[node.arguments[1]].operation == "constant"
            )
            table = printed if constant else guarded
            lines += statements(graph, [k], names, table, f"const {self.real} {{0}} = {{1}};")
            if node.operation in ("sqrt", "less") and not node.shared:
                radicands.append(names[node.arguments[0]])
        finite = []
        for port, nodes in zip(item.outputs, graph.outputs, strict=True):
            for j, k in enumerate(nodes):
                lines.append(f"{port.name}[{j}] = {names[k]};")
                if graph.nodes[k].operation != "constant":
                    finite.append(f"{p}_finite({port.name}[{j}])")
                if graph.nodes[k].operation == "input":
                    used.add(graph.nodes[k].arguments[0])
        unused = [port.name for i, port in enumerate(inputs) if i not in used]
        lines += [f"(void){name};" for name in unused]
        return (
            f"{self._prototype(item)}\n{{\n    int status = {p.upper()}_OK;\n"
            + "".join(f"    {line}\n" for line in lines)
            + (self._any_status(item) if item.several else self._status(radicands, finite))
            + "    return status;\n}\n"
        )

    def _any_status(self, item: Exported) -> str:
        """Return the status of a function with a pose a row: one that is real will do."""
        (port,) = item.outputs
        rows, columns = port.shape
        tests = [
            f"({self.prefix}_finite({port.name}[{columns * row}]) == 0)" for row in range(rows)
        ]
        return (
            f"    if ({_joined(tests)}) {{\n"
            f"        status = {self.prefix.upper()}_UNREACHABLE;\n    }}\n"
        )

    def _status(self, radicands: Sequence[str], finite: Sequence[str]) -> str:
        upper, zero = self.prefix.upper(), self._number(0.0)
        branches = []
        if radicands:
            reach = [f"(isgreaterequal({name}, {zero}) != 0)" for name in radicands]
            branches.append((f"!({_joined(reach)})", f"{upper}_UNREACHABLE"))
        if finite:
            branches.append(
                (f"!({_joined([f'({test} != 0)' for test in finite])})", f"{upper}_NOT_FINITE")
            )
        text = ""
        for k, (test, status) in enumerate(branches):
            word = "if" if k == 0 else "else if"
            text += f"    {word} ({test}) {{\n        status = {status};\n    }}\n"
        if len(branches) > 1:
            text += "    else {\n        /* all well */\n    }\n"
        return text

    def test(self) -> str:
        """Return a test program: states and results of the library, and a pose out of reach."""
        tolerance = self._number(1e-4 if self.real == "float" else 1e-10)
        calls, arrays = [], []
        for item in self.exported:
            for n, (values, results) in enumerate(item.examples):
                given = []
                for port, value in zip(item.labelled.program.inputs, values, strict=True):
                    name = f"{item.name}_{port.name}_{n}"
                    arrays.append(self._array(name, value))
                    given.append(name)
                block = [f"{self.real} {port.name}[{max(port.size, 1)}];" for port in item.outputs]
                outs = [port.name for port in item.outputs]
                status = 0 if all(np.isfinite(value).all() for value in results) else 1
                block.append(
                    f"const int status = {self.prefix}_{item.name}({', '.join([*given, *outs])});"
                )
                block.append(f'failed += check_status("{item.name}", status, {status});')
                for port, value in zip(item.outputs, results, strict=True):
                    if status == 0:
                        name = f"{item.name}_{port.name}_{n}"
                        arrays.append(self._array(name, value))
                        block.append(
                            f'failed += check("{item.name}", {port.name}, {name}, {port.size});'
                        )
                    else:
                        block.append(f"(void){port.name};")
                inner = "".join(f"        {line}\n" for line in block)
                calls.append(f"    {{\n{inner}    }}\n")
        return TEST.format(
            banner=_comment(banner(self.robot, "C99, its test program")),
            name=self.prefix,
            real=self.real,
            f=self._suffix,
            tolerance=tolerance,
            least=self._number(1e-3 if self.real == "float" else 1e-9),
            zero=self._number(0.0),
            arrays="".join(arrays),
            calls="".join(calls),
            checks=CHECK.format(
                real=self.real, f=self._suffix, tolerance=tolerance, zero=self._number(0.0)
            )
            if "check(" in "".join(calls)
            else "",
        )

    def _array(self, name: str, value: Array) -> str:
        numbers = [self._number(float(v)) for v in np.ravel(value)]
        rows = [", ".join(numbers[k : k + 4]) for k in range(0, len(numbers), 4)]
        inner = ",\n    ".join(rows)
        return f"static const {self.real} {name}[{len(numbers)}] = {{\n    {inner}}};\n"


def _limits(writer: _Writer) -> dict[str, str]:
    largest = 3.4028234e38 if writer.real == "float" else 1.7976931348623157e308
    return {
        "zero": writer._number(0.0),
        "least": writer._number(1e-30),
        "largest": writer._number(largest),
    }


def _argument(direction: str, port: Port, meaning: str) -> str:
    shape = " x ".join(map(str, port.shape)) or "1"
    order = ", by rows" if len(port.shape) > 1 else ""
    return f"{direction:<3} {port.name} ({shape}{order}){': ' if meaning else ''}{meaning}"


def _joined(tests: Sequence[str]) -> str:
    return "\n        && ".join(tests)


def _comment(lines: Sequence[str]) -> str:
    if len(lines) == 1:
        return f"/* {lines[0]} */\n"
    inner = "\n".join(f" * {line}".rstrip() for line in lines)
    return f"/*\n{inner}\n */\n"
