"""Statements in Structured Text for a graph of operations, guarded so that none can stop a PLC.

A PLC may stop on the square root of a negative number, on a division by zero and on an overflow.
So a radicand and a divisor are compared before they are used, and where a product might leave the
range of LREAL, so is its larger factor. A comparison that fails puts a harmless number in place and
clears a flag.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain, count

import numpy as np

from pteron.kernels import Graph, Port
from pteron.kernels.code import used_inputs
from pteron.kernels.graph import CONSTANT, INPUT

_PRINTED = {
    "add": "{0} + {1}",
    "sub": "{0} - {1}",
    "mul": "{0} * {1}",
    "div": "{0} / {1}",
    "neg": "-{0}",
    "sqrt": "SQRT({0})",
    "sin": "SIN({0})",
    "cos": "COS({0})",
    "exp": "EXP({0})",
    "atan2": "ATAN2({0}, {1})",
    "fabs": "ABS({0})",
    "fmin": "MIN({0}, {1})",
    "fmax": "MAX({0}, {1})",
}
"""Operations in Structured Text; `guards` write the others."""

INPUT_POWER, _DIVISOR, _FACTOR = 6, -20, 30
"""Powers of ten: no input and no factor is larger, no divisor smaller."""

_EXPONENT = "69.0"
"""Largest exponent that EXP is given: e to it is below 10^`_FACTOR`."""

_ZERO = "0.0"
"""Zero as LREAL."""

_GUARDS = {
    "sqrt": ("{0} >= 0.0", "1.0", "Reachable"),
    "exp": (f"{{0}} <= {_EXPONENT}", "1.0", "Regular"),
    "atan2": ("({0} <> 0.0) OR ({1} <> 0.0)", _ZERO, "Regular"),
}
"""Operations that are done only where a test holds: the test, the value elsewhere, and the flag
that is false there."""


def _sum_bound(sizes: Sequence[float]) -> float:
    """Return log10 of the largest possible sum, from log10 of the magnitudes of its terms."""
    most = max(sizes)
    if most == -math.inf:
        return most
    return most + math.log10(sum(10.0 ** (size - most) for size in sizes))


_BOUNDS: dict[str, Callable[[Sequence[float]], float]] = {
    **dict.fromkeys(("add", "sub"), _sum_bound),
    "mul": sum,
    "sqrt": lambda sizes: max(sizes[0] / 2, 0.0),
    "exp": lambda _: _FACTOR,
    **dict.fromkeys(("sin", "cos", "atan2", "less"), lambda _: math.log10(4.0)),
    "select": lambda sizes: sizes[1],
}
"""The power of ten that an operation's value cannot exceed, from those of its arguments; of others
it is the greatest of these."""


class Names:
    """The names in use, which differ in more than case."""

    def __init__(self, names: Iterable[str]) -> None:
        self._taken = {name.lower() for name in names}

    def new(self, text: str) -> str:
        """Return an unused identifier made of a text, with a number appended if it is taken."""
        name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")
        numbered = (f"{name}_{number}" for number in count(2))
        identifier = next(n for n in chain([name], numbered) if n.lower() not in self._taken)
        self._taken.add(identifier.lower())
        return identifier


class Statements:
    """The statements of a graph, guarded; `largest` is the power of ten of the largest LREAL."""

    def __init__(
        self,
        graph: Graph,
        inputs: Sequence[Port],
        names: Names,
        labels: Mapping[int, str],
        largest: float,
    ) -> None:
        self.graph = graph
        self.used = [element(inputs[i], j) for i, j in used_inputs(graph)]
        self.lines: list[str] = []
        self.flags: set[str] = set()
        self.temporaries: list[str] = []
        self.names: list[str] = []
        """Each node as text; empty for NaN."""
        self._spare, self._largest = names, largest
        self._labels = {k: names.new(labels[k]) for k in sorted(labels)}
        self._sizes: list[float] = []
        self._divisors: dict[int, str] = {}
        for k, node in enumerate(graph.nodes):
            self._sizes.append(self._size(k))
            if node.operation == INPUT:
                self.names.append(element(inputs[node.arguments[0]], node.arguments[1]))
            elif node.operation == CONSTANT:
                self.names.append(_literal(node.value))
            else:
                self.names.append(self._state(k))

    def number(self, k: int) -> str:
        """Return a node that is a number as text."""
        if not self.names[k] or self.graph.nodes[k].operation == "less":
            raise ValueError("NaN and truth values have their place in a selection alone")
        return self.names[k]

    def _state(self, k: int) -> str:
        """Append the statement of a node, and return the expression for its value."""
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
        expression = _PRINTED[node.operation].format(*arguments)
        if node.operation in _GUARDS:
            test, otherwise, flag = _GUARDS[node.operation]
            self._guard(test.format(*arguments), name, expression, otherwise, flag)
        else:
            self.lines.append(f"{name} := {expression};")
        return name

    def _select(self, k: int) -> str:
        """Append the statement of a selection between NaN and a number; return its variable."""
        test, chosen = self.graph.nodes[k].arguments
        if self.graph.nodes[test].operation != "less":
            raise ValueError("a selection without a comparison")
        if not self.names[chosen]:
            self.flags.add("Reachable")
            self._choose(self.names[test], ["Reachable := FALSE;"])
            return _ZERO
        name = self._name(k)
        self._choose(
            self.names[test], [f"{name} := {self.number(chosen)};"], [f"{name} := {_ZERO};"]
        )
        return name

    def _name(self, k: int) -> str:
        """Return the variable that node `k` is assigned to: its label, or a new temporary."""
        name = self._labels.get(k)
        if name is None:
            return self._temporary("t")
        self.temporaries.append(name)
        return name

    def _size(self, k: int) -> float:
        """Return the power of ten that bounds a node's value; append the guards it needs."""
        size = self._bound(k)
        while size > self._largest:
            arguments = [
                i
                for i in self.graph.nodes[k].arguments
                if self._sizes[i] > _FACTOR and self.graph.nodes[i].operation != CONSTANT
            ]
            if not arguments:
                raise ValueError("a constant is too large for LREAL arithmetic")
            worst = max(arguments, key=lambda i: self._sizes[i])
            name = self._temporary("bounded")
            test = f"ABS({self.names[worst]}) <= {power(_FACTOR)}"
            self._guard(test, name, self.names[worst], _ZERO, "Regular")
            self.names[worst], self._sizes[worst] = name, _FACTOR
            size = self._bound(k)
        return size

    def _bound(self, k: int) -> float:
        """Return the power of ten that a node cannot exceed, by the bounds of its arguments."""
        node = self.graph.nodes[k]
        if node.operation == INPUT:
            return INPUT_POWER
        if node.operation == CONSTANT:
            return _magnitude(node.value)
        sizes = [self._sizes[i] for i in node.arguments]
        if node.operation == "div":
            divisor = self.graph.nodes[node.arguments[1]]
            constant = divisor.operation == CONSTANT and divisor.value != 0.0
            return sizes[0] - (_magnitude(divisor.value) if constant else _DIVISOR)
        return _BOUNDS.get(node.operation, max)(sizes)

    def _divisor(self, k: int) -> str:
        """Return a node as a divisor, with its guard where it needs one."""
        node = self.graph.nodes[k]
        if node.operation == CONSTANT and node.value != 0.0:
            return self.names[k]
        if k not in self._divisors:
            self._divisors[k] = self._temporary("divisor")
            test = f"ABS({self.names[k]}) >= {power(_DIVISOR)}"
            self._guard(test, self._divisors[k], self.names[k], "1.0", "Regular")
        return self._divisors[k]

    def _temporary(self, stem: str) -> str:
        """Return a new temporary variable whose name begins with a stem, and declare it."""
        self.temporaries.append(self._spare.new(stem))
        return self.temporaries[-1]

    def _guard(self, test: str, name: str, expression: str, otherwise: str, flag: str) -> None:
        """Append an assignment guarded by a test; else a substitute and a cleared flag."""
        self.flags.add(flag)
        self._choose(
            test, [f"{name} := {expression};"], [f"{name} := {otherwise};", f"{flag} := FALSE;"]
        )

    def _choose(self, test: str, then: Sequence[str], otherwise: Sequence[str] = ()) -> None:
        """Add an IF statement with the lines of both branches."""
        self.lines += [f"IF {test} THEN", *(f"    {line}" for line in then)]
        if otherwise:
            self.lines += ["ELSE", *(f"    {line}" for line in otherwise)]
        self.lines.append("END_IF;")


def element(port: Port, j: int) -> str:
    """Return an element of a port as text."""
    if not port.shape:
        return port.name
    return f"{port.name}[{', '.join(str(i) for i in np.unravel_index(j, port.shape))}]"


def power(exponent: int) -> str:
    """Return a power of ten as an LREAL literal."""
    return f"1.0E{exponent:+d}"


def _magnitude(number: float) -> float:
    """Return the power of ten of a number; of NaN, which is never computed with, that of 0."""
    return math.log10(abs(number)) if abs(number) > 0.0 else -math.inf


def _literal(number: float) -> str:
    """Return an LREAL literal, in brackets if it has a sign; for NaN there is none."""
    if math.isnan(number):
        return ""
    digits, _, exponent = repr(float(number)).partition("e")
    text = digits if "." in digits else f"{digits}.0"
    text += f"E{int(exponent)}" if exponent else ""
    return f"({text})" if text.startswith("-") else text
