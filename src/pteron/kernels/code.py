"""Straight-line code from a graph of operations, for the printers of C, Python and Structured Text.

Tables say how each operation is written in a language; `statements` writes a line for each node.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np

from pteron.kernels.exponential import exponential_function
from pteron.kernels.graph import CONSTANT, INPUT, STORE, Graph, graph_of
from pteron.kernels.kernel import Port
from pteron.kernels.sincos import LIMIT, reduced_sincos

if TYPE_CHECKING:
    import jinja2

C = {
    "add": "{0} + {1}",
    "sub": "{0} - {1}",
    "mul": "{0} * {1}",
    "div": "{0} / {1}",
    "neg": "-{0}",
    "sqrt": "sqrt({0})",
    "sin": "sin({0})",
    "cos": "cos({0})",
    "exp": "exp({0})",
    "atan2": "atan2({0}, {1})",
    "fabs": "fabs({0})",
    "floor": "floor({0})",
    "fmin": "fmin({0}, {1})",
    "fmax": "fmax({0}, {1})",
    "less": "({0} < {1})",
    "less_equal": "({0} <= {1})",
    "equal": "({0} == {1})",
    "unequal": "({0} != {1})",
    "not": "({0} == 0)",
    "and": "(({0} != 0) & ({1} != 0))",
    "or": "(({0} != 0) | ({1} != 0))",
    "select": "({0} ? {1} : 0)",
}
"""Operations in C; comparisons give truth values, by which `select` takes its argument or zero."""

PYTHON = C | {"select": "({1} if {0} else 0.0)"}
"""Operations in Python, for a namespace that has sqrt, sin and so on."""


def single_precision(printed: Mapping[str, str]) -> dict[str, str]:
    """Return operations' C text with math.h's float functions (sqrtf for sqrt ...)."""
    return {op: re.sub(r"^(\w+)\(", r"\1f(", text) for op, text in printed.items()}


def c_constant(number: float, dtype: str = "float64") -> str:
    """Return a number as a floating-point literal of C, in brackets if it has a sign."""
    if np.isnan(number):
        return "NAN"
    text = f"{np.float32(number)!s}" if dtype == "float32" else repr(float(number))
    if not any(sign in text for sign in ".en"):
        text += ".0"
    text += "F" if dtype == "float32" else ""
    return f"({text})" if text.startswith("-") else text


def names_of(
    graph: Graph,
    inputs: Callable[[int, int], str],
    constant: Callable[[float], str],
) -> list[str]:
    """Return the text of each graph node in code: an input, a literal, or a variable t1, t2 ..."""
    names: list[str] = []
    numbers = count(1)
    for node in graph.nodes:
        if node.operation == INPUT:
            names.append(inputs(node.arguments[0], node.arguments[1]))
        elif node.operation == CONSTANT:
            names.append(constant(node.value))
        else:
            names.append(f"t{next(numbers)}")
    return names


def statements(
    graph: Graph,
    nodes: Iterable[int],
    names: Sequence[str],
    printed: Mapping[str, str],
    form: str,
) -> list[str]:
    """Return a code statement for each graph node; `form` has {0} for its name, {1} its value."""
    lines = []
    for k in nodes:
        node = graph.nodes[k]
        if node.operation not in printed:
            raise ValueError(f"operation {node.operation} has no printer")
        text = printed[node.operation].format(*(names[i] for i in node.arguments))
        # A compiler does not keep a volatile variable in a register.
        stated = form.replace("const ", "volatile ", 1) if node.operation == STORE else form
        lines.append(stated.format(names[k], text))
    return lines


def used_inputs(graph: Graph) -> list[tuple[int, int]]:
    """Return the (input, element) index pairs that the graph reads, sorted."""
    places = (node.arguments for node in graph.nodes if node.operation == INPUT)
    return sorted((port, element) for port, element in places)


@dataclass(frozen=True)
class Language:
    """The notation of one language for a module that evaluates batches; see `module_values`."""

    printed: Mapping[str, str]
    """Operations, to which math functions of numbers that are not vectors belong."""
    form: str
    """A statement: {0} the name, {1} the value."""
    near_form: str
    """The same where numbers are of double precision."""
    constant: Callable[[float], str]
    pair: str
    """The statement that finds sine and cosine number {0} of {1}."""
    parts: Mapping[str, str]
    """The names of the sine and the cosine number {0}."""
    cell: str
    """An element of a block: {0} its row."""
    stored: str
    """The statement that puts {1} in row {0} of the results; `returned` in element {1} of {0}."""
    returned: str


def module_values(
    name: str, graph: Graph, inputs: Sequence[Port], outputs: Sequence[Port], language: Language
) -> dict[str, Any]:
    """Return the template values of a module's code: statements for a state and a block.

    In a block each input element has a row, followed by rows for each angle's sine and cosine,
    computed before the main loop; statements that depend on shared inputs alone run once.
    """
    nodes, operations = graph.nodes, graph.operations()
    printed, form = language.printed, language.form
    used = [(i, j) for i, j in used_inputs(graph) if not inputs[i].shared]
    rows = {pair: row for row, pair in enumerate(used)}
    of_angle: dict[int, list[int]] = {}
    for k in operations:
        if nodes[k].outlying:
            of_angle.setdefault(nodes[k].arguments[0], []).append(k)
    shared = [k for k in operations if nodes[k].shared]
    state_nodes = [k for k in operations if not nodes[k].shared and not nodes[k].outlying]
    results = [
        (port, j, k)
        for port, places in zip(outputs, graph.outputs, strict=True)
        for j, k in enumerate(places)
    ]

    names = names_of(graph, lambda i, j: f"{inputs[i].name}[{j}]", language.constant)
    one_state = []
    for number, (angle, functions) in enumerate(of_angle.items(), 1):
        one_state.append(language.pair.format(number, names[angle]))
        for k in functions:
            names[k] = language.parts[nodes[k].operation].format(number)
    one_state += statements(graph, shared + state_nodes, names, printed, form)
    one_state += [
        language.returned.format(f"{port.name}_out", j, names[k]) for port, j, k in results
    ]

    def input_name(i: int, j: int) -> str:
        """Return the expression of element j of input i in the module's language."""
        return f"{inputs[i].name}[{j}]" if inputs[i].shared else language.cell.format(rows[i, j])

    names = names_of(graph, input_name, language.constant)
    once = statements(graph, shared, names, printed, form)
    angles = []
    for row, (angle, functions) in zip(count(len(rows), 2), of_angle.items(), strict=False):
        sine, cosine = language.cell.format(row), language.cell.format(row + 1)
        angles.append((names[angle], sine, cosine))
        for k in functions:
            names[k] = sine if nodes[k].operation == "sin" else cosine
    body = statements(graph, state_nodes, names, printed, form)
    body += [language.stored.format(row, names[k]) for row, (_, _, k) in enumerate(results)]

    return arithmetic(language.near_form) | {
        "name": name,
        "inputs": inputs,
        "outputs": outputs,
        "one": one_state,
        "shared": once,
        "angles": angles,
        "body": body,
        "rows": [(row, inputs[i], j) for (i, j), row in rows.items()],
        "runs": [(row, inputs[i], j, width) for row, i, j, width in _runs(used)],
        "results": [(row, port, j) for row, (port, j, _) in enumerate(results)],
    }


def arithmetic(form: str = "const double {0} = {1};") -> dict[str, Any]:
    """Return code statements for sine, cosine and exponential, as template values."""
    template_values: dict[str, Any] = {"limit": LIMIT}
    for function in (reduced_sincos(), exponential_function()):
        name, graph = function.name(), graph_of(function)
        names = names_of(graph, lambda i, j: "argument", c_constant)
        template_values[name] = statements(graph, graph.operations(), names, C, form)
        template_values[f"{name}_results"] = [names[places[0]] for places in graph.outputs]
    return template_values


def _runs(used: Sequence[tuple[int, int]]) -> Iterator[tuple[int, int, int, int]]:
    """Yield (row, input, element, width) of groups of 4, 2 or 1 consecutive input elements."""
    row = 0
    while row < len(used):
        i, j = used[row]
        ahead = ([(i, j + k) for k in range(width)] for width in (4, 2, 1))
        width = next(len(run) for run in ahead if used[row : row + len(run)] == run)
        yield row, i, j, width
        row += width


def render_template(package: str, template: str, **values: Any) -> str:
    """Return the text of a template in the folder `templates` of a package."""
    return _environment(package).get_template(template).render(values)


@lru_cache(maxsize=4)
def _environment(package: str) -> jinja2.Environment:
    """Return the Jinja environment of a package's templates, cached."""
    import jinja2  # here, since `import pteron` does without

    return jinja2.Environment(
        loader=jinja2.PackageLoader(package),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
