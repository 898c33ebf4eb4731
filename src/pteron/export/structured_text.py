"""Structured Text of IEC 61131-3 from a graph: a function block that never traps.

A controller may stop on the square root of a negative number, on a division by zero and on an
overflow, so none of them can happen here. Inputs beyond a range are refused before anything is
computed; a radicand and a divisor are compared before they are used; and where the sizes of the
factors do not rule out that a product leaves the range of LREAL, the larger factor is compared
too. A comparison that fails puts a harmless number in place, clears a flag, and the outputs stay
as they were.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from pteron.kernels.code import used_inputs
from pteron.kernels.graph import CONSTANT, INPUT, Graph
from pteron.kernels.kernel import Port

__all__ = ["function_block"]

_PRINTED = {
    "add": "{0} + {1}",
    "sub": "{0} - {1}",
    "mul": "{0} * {1}",
    "div": "{0} / {1}",
    "neg": "-{0}",
    "sqrt": "SQRT({0})",
    "sin": "SIN({0})",
    "cos": "COS({0})",
    "atan2": "ATAN2({0}, {1})",
    "fabs": "ABS({0})",
    "fmin": "MIN({0}, {1})",
    "fmax": "MAX({0}, {1})",
}

_INPUT, _DIVISOR, _FACTOR, _LREAL = 6, -20, 30, 300
"""Powers of ten: inputs and factors are not larger, divisors not smaller, no number larger."""

_WIDTH = 100

_FLAGS = ("Reachable", "Regular")

_ZERO = "0.0"

_WORDS = """
    abs abstract acos action add and andn any array asin at atan atan2 begin bool by byte cal
    calc calcn case char concat configuration constant continue cos date date_and_time delete
    dint div do dt dword else elsif en end_action end_case end_class end_configuration end_for
    end_function end_function_block end_if end_interface end_method end_namespace end_program
    end_property end_repeat end_resource end_step end_struct end_transition end_type end_union
    end_var end_while eno eq exit exp expt extends f_edge false final find for from function
    function_block functionblock ge goto gt if implements initial_step insert int interface
    internal interval jmp ldate ldt le left len limit lint ln log lower_bound lreal lt ltime
    ltod lword max method mid min mod move mul mux namespace ne neg non_retain not null of on or
    orn overlap overload override persistent pointer priority private program property protected
    public r r1 r_edge read_only read_write real ref reference repeat replace resource ret
    retain return right rol ror s s1 sel shl shr sin single sint sizeof sqrt ss st step string
    struct sub super tan task then this time time_of_day to tod transition true trunc type udint
    uint ulint union until upper_bound using usint var var_access var_config var_external
    var_global var_in_out var_input var_inst var_output var_stat var_temp wchar while with word
    wstring xor
"""

_RESERVED = frozenset(_WORDS.split())
"""What no variable may be called: keywords, types, standard functions, in lower case."""


def function_block(
    name: str,
    graph: Graph,
    inputs: Sequence[Port],
    outputs: Sequence[Port],
    comments: Sequence[str] = (),
    descriptions: Mapping[str, str] | None = None,
    labels: Mapping[int, str] | None = None,
) -> str:
    """Return a function block that computes a graph, as Structured Text.

    Arrays count from 0; matrices keep their rows. The outputs change only where `Valid` is TRUE.
    `Status` says why not: 1, a radicand is negative (a leg does not reach); 2, a divisor is zero
    or a number too large (a singularity); 3, an input is not a number or is beyond 1.0E+6.

    Parameters
    ----------
    name : str
        Of the function block.
    graph : Graph
        What it computes.
    inputs, outputs : sequence of Port
        Names and shapes, in the graph's order.
    comments : sequence of str
        Lines for the header.
    descriptions : mapping of str to str, optional
        What to say of an input or output, by name.
    labels : mapping of int to str, optional
        Names for nodes of the graph; the others are t1, t2 and so on.

    Returns
    -------
    str
        The text of one FUNCTION_BLOCK, in ASCII if what is given is.

    Raises
    ------
    ValueError
        If a name cannot be one in Structured Text or stands for two things, if the ports do not
        fit the graph, or if a constant has no place in LREAL arithmetic.
    """
    names = _Names()
    for given in (name, "Valid", "Status", "Usable", "Reachable", "Regular"):
        names.keep(given)
    for port in (*inputs, *outputs):
        names.keep(port.name)
    for port, nodes in zip(outputs, graph.outputs, strict=True):
        if len(nodes) != port.size:
            raise ValueError(f"{port.name}: {len(nodes)} values for {port.size} elements")
    body = _Body(graph, inputs, names, labels or {})
    flags = ["Usable"] * bool(body.used) + [flag for flag in _FLAGS if flag in body.flags]
    lines = [*_header(name, comments, flags), f"FUNCTION_BLOCK {name}"]
    said = descriptions or {}
    lines += ["VAR_INPUT", *_ports(inputs, said), "END_VAR"]
    lines += ["VAR_OUTPUT", *_ports(outputs, said)]
    lines += ["    Valid : BOOL; (* whether the outputs are those of the inputs *)"]
    lines += ["    Status : UDINT; (* 0, or why not *)", "END_VAR"]
    if flags or body.temporaries:
        lines.append("VAR")
        declared = _listed(flags, "BOOL") + _listed(body.temporaries, "LREAL")
        lines += [f"    {line}" for line in declared]
        lines.append("END_VAR")
    lines += ["", *_checked(body), *_ending(flags, body, graph, outputs)]
    return "\n".join([*lines, "END_FUNCTION_BLOCK", ""])


class _Names:
    """The names in use, which differ in more than case."""

    def __init__(self) -> None:
        self.taken = set(_RESERVED)
        self._next: dict[str, int] = {}

    def keep(self, name: str) -> None:
        """Use a name as it is."""
        if _identifier(name) != name:
            raise ValueError(f"{name!r} cannot be a name in Structured Text")
        if name.lower() in self.taken:
            raise ValueError(f"{name!r} stands for something else in Structured Text")
        self.taken.add(name.lower())

    def numbered(self, stem: str, first: int = 1) -> str:
        """Return the next of stem1, stem2 and so on that is free."""
        number = self._next.get(stem, first)
        while f"{stem}{number}".lower() in self.taken:
            number += 1
        self._next[stem] = number + 1
        self.taken.add(f"{stem}{number}".lower())
        return f"{stem}{number}"

    def like(self, text: str) -> str:
        """Return the text as a name, with a number where it is taken."""
        name = _identifier(text)
        if name.lower() in self.taken:
            return self.numbered(f"{name}_", 2)
        self.taken.add(name.lower())
        return name


def _identifier(text: str) -> str:
    """Return a text as an identifier: no two underscores in a row, none at its end."""
    name = re.sub(r"_+", "_", re.sub(r"[^A-Za-z0-9]", "_", text)).rstrip("_")
    return name if name[:1].isalpha() or name[:1] == "_" else f"v{name}"


class _Body:
    """The statements of a graph, guarded."""

    def __init__(
        self, graph: Graph, inputs: Sequence[Port], names: _Names, labels: Mapping[int, str]
    ) -> None:
        self.graph = graph
        self.used = [_element(inputs[i], j) for i, j in used_inputs(graph)]
        self.lines: list[str] = []
        self.flags: set[str] = set()
        self.temporaries: list[str] = []
        self.names: list[str] = []
        """How each node is written."""
        self._spare = names
        self._labels = {k: names.like(labels[k]) for k in sorted(labels)}
        self._sizes: list[float] = []
        self._divisors: dict[int, str] = {}
        for k, node in enumerate(graph.nodes):
            self._sizes.append(self._size(k))
            if node.operation == INPUT:
                self.names.append(_element(inputs[node.arguments[0]], node.arguments[1]))
            elif node.operation == CONSTANT:
                self.names.append(_literal(node.value))
            else:
                self.names.append(self._state(k))

    def number(self, k: int) -> str:
        """Return how a node is written, which is a number."""
        if not self.names[k] or self.graph.nodes[k].operation == "less":
            raise ValueError("NaN and truth values have their place in a selection alone")
        return self.names[k]

    def _state(self, k: int) -> str:
        """Add the statement of a node, and return how the node is written from then on."""
        node = self.graph.nodes[k]
        if node.operation == "select":
            return self._select(k)
        arguments = [self.number(i) for i in node.arguments]
        if node.operation == "less":
            return f"{arguments[0]} < {arguments[1]}"
        if node.operation == "add" and _ZERO in arguments:
            return arguments[1 - arguments.index(_ZERO)]
        if node.operation == "div":
            arguments[1] = self._divisor(node.arguments[1])
        name = self._name(k)
        value = _PRINTED[node.operation].format(*arguments)
        if node.operation == "sqrt":
            self._guard(f"{arguments[0]} >= 0.0", name, value, "1.0", "Reachable")
        else:
            self.lines.append(f"{name} := {value};")
        return name

    def _select(self, k: int) -> str:
        """Add a selection: of NaN, which says that a leg does not reach, or of a number."""
        test, value = self.graph.nodes[k].arguments
        if self.graph.nodes[test].operation != "less":
            raise ValueError("a selection without a comparison")
        if not self.names[value]:
            least, most = (self.names[i] for i in self.graph.nodes[test].arguments)
            self.flags.add("Reachable")
            self.lines += [
                f"IF NOT ({least} >= {most}) THEN",
                "    Reachable := FALSE;",
                "END_IF;",
            ]
            return _ZERO
        name = self._name(k)
        self.lines += [
            f"IF {self.names[test]} THEN",
            f"    {name} := {self.number(value)};",
            "ELSE",
            f"    {name} := 0.0;",
            "END_IF;",
        ]
        return name

    def _name(self, k: int) -> str:
        name = self._labels.get(k)
        if name is None:
            return self._temporary("t")
        self.temporaries.append(name)
        return name

    def _size(self, k: int) -> float:
        """Return the power of ten that a node cannot exceed, after the guards that this takes."""
        size = self._bound(k)
        while size > _LREAL:
            arguments = [
                i
                for i in self.graph.nodes[k].arguments
                if self._sizes[i] > _FACTOR and self.graph.nodes[i].operation != CONSTANT
            ]
            if not arguments:
                raise ValueError("a constant is too large for LREAL arithmetic")
            largest = max(arguments, key=lambda i: self._sizes[i])
            name = self._temporary("bounded")
            test = f"ABS({self.names[largest]}) <= {_power(_FACTOR)}"
            self._guard(test, name, self.names[largest], "0.0", "Regular")
            self.names[largest], self._sizes[largest] = name, _FACTOR
            size = self._bound(k)
        return size

    def _bound(self, k: int) -> float:
        """Return the power of ten that a node cannot exceed, by the bounds of its arguments."""
        node = self.graph.nodes[k]
        if node.operation == INPUT:
            return _INPUT
        if node.operation == CONSTANT:
            return _magnitude(node.value)
        sizes = [self._sizes[i] for i in node.arguments]
        if node.operation in ("add", "sub"):
            most = max(sizes)
            if most == -math.inf:
                return most
            return most + math.log10(sum(10.0 ** (size - most) for size in sizes))
        if node.operation == "mul":
            return sum(sizes)
        if node.operation == "div":
            divisor = self.graph.nodes[node.arguments[1]]
            constant = divisor.operation == CONSTANT and divisor.value != 0.0
            return sizes[0] - (_magnitude(divisor.value) if constant else _DIVISOR)
        if node.operation == "sqrt":
            return max(sizes[0] / 2, 0.0)
        if node.operation in ("sin", "cos", "atan2", "less"):
            return math.log10(4.0)
        if node.operation == "select":
            return sizes[1]
        return max(sizes)

    def _divisor(self, k: int) -> str:
        """Return how a node is written as a divisor, with its guard where it needs one."""
        node = self.graph.nodes[k]
        if node.operation == CONSTANT and node.value != 0.0:
            return self.names[k]
        if k not in self._divisors:
            self._divisors[k] = self._temporary("divisor")
            test = f"ABS({self.names[k]}) >= {_power(_DIVISOR)}"
            self._guard(test, self._divisors[k], self.names[k], "1.0", "Regular")
        return self._divisors[k]

    def _temporary(self, stem: str) -> str:
        name = self._spare.numbered(stem)
        self.temporaries.append(name)
        return name

    def _guard(self, test: str, name: str, value: str, otherwise: str, flag: str) -> None:
        self.flags.add(flag)
        self.lines += [
            f"IF {test} THEN",
            f"    {name} := {value};",
            "ELSE",
            f"    {name} := {otherwise};",
            f"    {flag} := FALSE;",
            "END_IF;",
        ]


def _element(port: Port, j: int) -> str:
    """Return how an element of a port is written."""
    if not port.shape:
        return port.name
    return f"{port.name}[{', '.join(str(i) for i in np.unravel_index(j, port.shape))}]"


def _magnitude(value: float) -> float:
    """Return the power of ten of a number; of NaN, which is never computed with, that of 0."""
    return math.log10(abs(value)) if abs(value) > 0.0 else -math.inf


def _literal(value: float) -> str:
    """Return an LREAL literal, in brackets if it has a sign; for NaN there is none."""
    if math.isnan(value):
        return ""
    digits, _, exponent = repr(float(value)).partition("e")
    text = digits if "." in digits else f"{digits}.0"
    text += f"E{int(exponent)}" if exponent else ""
    return f"({text})" if text.startswith("-") else text


def _power(exponent: int) -> str:
    return f"1.0E{exponent:+d}"


def _header(name: str, comments: Sequence[str], flags: Collection[str]) -> list[str]:
    """Return the comment at the head."""
    reasons = {
        "Usable": f"3 where an input is not a number of at most {_power(_INPUT)};",
        "Reachable": "1 where it is out of reach: a radicand is negative;",
        "Regular": "2 where it is singular: a divisor is zero, or a number too large;",
    }
    lines = [
        name,
        *comments,
        "",
        "No input can make it trap. Where Valid is FALSE the outputs hold their last valid values.",
        "Status is",
        *(f"  {text}" for flag, text in reasons.items() if flag in flags),
        "  0 elsewhere, and there alone Valid is TRUE.",
    ]
    wrapped = [part for line in lines for part in _folded(_harmless(line))]
    return ["(*", *(f"    {line}".rstrip() for line in wrapped), "*)"]


def _folded(line: str) -> list[str]:
    indent = line[: len(line) - len(line.lstrip())]
    return textwrap.wrap(line, _WIDTH - 4, subsequent_indent=indent) or [""]


def _harmless(text: str) -> str:
    """Return a text that cannot end or open a comment."""
    return text.replace("(*", "( *").replace("*)", "* )")


def _ports(ports: Sequence[Port], descriptions: Mapping[str, str]) -> list[str]:
    lines = []
    for port in ports:
        ranges = ", ".join(f"0..{count - 1}" for count in port.shape)
        kind = f"ARRAY[{ranges}] OF LREAL" if ranges else "LREAL"
        lines.append(f"    {port.name} : {kind};")
        if port.name in descriptions:
            lines[-1] += f" (* {_harmless(descriptions[port.name])} *)"
    return lines


def _listed(names: Sequence[str], kind: str) -> list[str]:
    """Return the declaration of variables of one type."""
    if not names:
        return []
    return _packed([*(f"{name}," for name in names[:-1]), f"{names[-1]} : {kind};"])


def _packed(pieces: Sequence[str]) -> list[str]:
    """Return pieces in as few lines as hold them, the later ones indented."""
    lines = [pieces[0]]
    for piece in pieces[1:]:
        if len(lines[-1]) + 1 + len(piece) <= _WIDTH - 4:
            lines[-1] += f" {piece}"
        else:
            lines.append(f"    {piece}")
    return lines


def _checked(body: _Body) -> list[str]:
    """Return the arithmetic, inside the comparison that its inputs are numbers of some size."""
    lines = [f"{flag} := TRUE;" for flag in _FLAGS if flag in body.flags]
    if not body.used:
        return lines + body.lines
    tests = [f"(ABS({element}) <= {_power(_INPUT)})" for element in body.used]
    lines += _packed([f"Usable := {tests[0]}", *(f"AND {test}" for test in tests[1:])])
    lines[-1] += ";"
    if body.lines:
        lines += ["IF Usable THEN", *(f"    {line}" for line in body.lines), "END_IF;"]
    return lines


def _ending(flags: Sequence[str], body: _Body, graph: Graph, outputs: Sequence[Port]) -> list[str]:
    """Return what writes the outputs, all or none of them."""
    written = [
        f"    {_element(port, j)} := {body.number(k)};"
        for port, nodes in zip(outputs, graph.outputs, strict=True)
        for j, k in enumerate(nodes)
    ]
    lines = [f"Valid := {' AND '.join(flags) or 'TRUE'};"]
    lines += ["IF Valid THEN", *written, "    Status := 0;"]
    for flag, status in (("Usable", 3), ("Reachable", 1), ("Regular", 2)):
        if flag in flags:
            lines += [f"ELSIF NOT {flag} THEN", f"    Status := {status};"]
    return [*lines, "END_IF;"]
