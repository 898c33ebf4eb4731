"""C functions of a program for a few states side by side, one in each lane of a vector register."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from pteron.kernels.c import c_language
from pteron.kernels.code import names_of, statements
from pteron.kernels.exponential import with_lowered_exponentials
from pteron.kernels.graph import Graph, graph_of
from pteron.kernels.kernel import Port
from pteron.kernels.lifetimes import with_short_lifetimes
from pteron.kernels.program_cache import Program

_ANGLES = {"sin": "sine", "cos": "cosine"}


@dataclass(frozen=True)
class Block:
    """The statements of a program's C for one lane k; `loop.c.j2` puts functions around them.

    The C code reads rows, one for each element of an input: `in` has the inputs of a state,
    `numbers` the machine's own, and `own` values that are computed from `numbers` once. An output
    whose name is a key of `later` replaces the output named there, in lanes that do not `slide`. If
    the block is `split`, these outputs are computed in a second part, which reads rows that the
    first part has `kept`; else there is one part. For a GPU, `needed` names the outputs that are
    computed, by statements in an order that needs few registers.
    """

    name: str
    program: Program
    later: Mapping[str, str] | None = None
    split: bool = False
    needed: Container[str] | None = None

    @cached_property
    def state_inputs(self) -> tuple[Port, ...]:
        """The program's inputs that differ from state to state."""
        return tuple(port for port in self.program.inputs if not port.shared)

    @cached_property
    def machine_inputs(self) -> tuple[Port, ...]:
        """The program's inputs that are parameters of the machine, the same for all its states."""
        return tuple(port for port in self.program.inputs if port.shared)

    @cached_property
    def first_rows(self) -> dict[str, int]:
        """The first row of each input in its array, by name (`in` or `numbers` in C)."""
        return {**_starts(self.state_inputs), **_starts(self.machine_inputs)}

    @cached_property
    def output_rows(self) -> dict[str, int]:
        """The first row of each output in the C array `out`, by name."""
        return _starts([port for port in self.program.outputs if not self._is_late(port)])

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Numbers of rows of the C arrays: `in`, `numbers`, `own`, `kept` and `out`."""
        return {
            "in": max(1, sum(port.size for port in self.state_inputs)),
            "numbers": max(1, sum(port.size for port in self.machine_inputs)),
            "own": max(1, len(self._machine_rows)),
            "kept": max(1, len(self._passed_rows)),
            "out": sum(port.size for port in self.program.outputs if not self._is_late(port)),
        }

    @cached_property
    def machine_statements(self) -> list[str]:
        """The C statements that fill `own`: values that only the machine's parameters determine."""
        names = self._names()
        lines = self._lines(
            [k for k in self._graph.operations() if k in self._shared_nodes], names, ""
        )
        return [*lines, *(f"own[{row}][k] = {names[k]};" for k, row in self._machine_rows.items())]

    def body(self, sincos: str) -> list[str]:
        """Return the C statements for one state.

        `sincos` names C's function for sine and cosine.
        """
        graph, names = self._graph, self._names()
        for k, row in self._machine_rows.items():
            names[k] = f"own[{row}][k]"
        late = self._late_nodes if self.split else frozenset[int]()
        state_nodes = [
            k for k in graph.operations() if k not in self._shared_nodes and k not in late
        ]
        lines = self._lines(state_nodes, names, sincos)
        lines += (f"kept[{row}][k] = {names[k]};" for k, row in self._passed_rows.items())
        expressions = {row: names[k] for row, k in self._results(later=False)}
        if not self.split:
            expressions |= {
                row: f"slides ? {expressions[row]} : {names[k]}"
                for row, k in self._results(later=True)
            }
        return [*lines, *(f"out[{row}][k] = {text};" for row, text in expressions.items())]

    @cached_property
    def second_part(self) -> list[str]:
        """The C statements of the second part: outputs computed later than the first part's."""
        names = self._names()
        for where, rows in (("own", self._machine_rows), ("kept", self._passed_rows)):
            for k, row in rows.items():
                names[k] = f"{where}[{row}][k]"
        lines = self._lines(sorted(self._late_nodes), names, "sincos_")
        return [*lines, *(f"out[{row}][k] = {names[k]};" for row, k in self._results(later=True))]

    def _results(self, *, later: bool) -> list[tuple[int, int]]:
        """Return (row of `out`, graph node) pairs of the second part if `later`, else of part 1."""
        return [
            (self.output_rows[(self.later or {}).get(port.name, port.name)] + i, k)
            for port, part in zip(self.program.outputs, self._graph.outputs, strict=True)
            if self._is_late(port) == later
            for i, k in enumerate(part)
        ]

    def _is_late(self, port: Port) -> bool:
        """Return whether an output belongs to the second part, computed later."""
        return port.name in (self.later or ())

    @property
    def has_angles(self) -> bool:
        """Whether the program takes sines or cosines of quantities that depend on the state."""
        nodes = self._graph.nodes
        return any(
            n.operation in _ANGLES for k, n in enumerate(nodes) if k not in self._shared_nodes
        )

    @cached_property
    def _graph(self) -> Graph:
        """The graph of the program's arithmetic, exponentials expanded into plain operations."""
        graph = graph_of(with_lowered_exponentials(self.program.function), self.program.inputs)
        if self.needed is None:
            return graph
        pairs = zip(self.program.outputs, graph.outputs, strict=True)
        outputs = tuple(part if port.name in self.needed else () for port, part in pairs)
        return with_short_lifetimes(replace(graph, outputs=outputs))

    @cached_property
    def _shared_nodes(self) -> frozenset[int]:
        """The graph nodes that depend on the machine's parameters alone."""
        graph = self._graph
        return frozenset(k for k in graph.operations() if graph.nodes[k].shared)

    @cached_property
    def _late_nodes(self) -> frozenset[int]:
        """The graph nodes on which only outputs of the second part depend."""
        graph, needed = self._graph, {k for _, k in self._results(later=False)}
        late = set[int]()
        for k in reversed(graph.operations()):
            if k in needed:
                needed |= set(graph.nodes[k].arguments)
            elif k not in self._shared_nodes:
                late.add(k)
        return frozenset(late)

    @cached_property
    def _passed_rows(self) -> dict[int, int]:
        """Rows of the C array `kept`, by graph node: first-part values that the second needs."""
        if not self.split:
            return {}
        graph = self._graph
        first = set(graph.operations()) - self._late_nodes - self._shared_nodes
        read = {i for k in self._late_nodes for i in graph.nodes[k].arguments}
        read |= {k for _, k in self._results(later=True)}
        return {k: row for row, k in enumerate(sorted(read & first))}

    @cached_property
    def _machine_rows(self) -> dict[int, int]:
        """Rows of the C array `own`, by graph node: machine-only values that states read."""
        graph = self._graph
        read = {k for part in graph.outputs for k in part}
        for k in graph.operations():
            if k not in self._shared_nodes:
                read |= set(graph.nodes[k].arguments)
        return {k: row for row, k in enumerate(sorted(read & self._shared_nodes))}

    def _names(self) -> list[str]:
        """Return the C expression of each graph node: an input's element, literal or variable."""
        ports = self.program.inputs

        def name(i: int, j: int) -> str:
            """Return the C expression of element j of input i."""
            where = "numbers" if ports[i].shared else "in"
            return f"{where}[{self.first_rows[ports[i].name] + j}][k]"

        return names_of(self._graph, name, c_language("float64").constant)

    def _lines(self, chosen: Sequence[int], names: list[str], sincos: str) -> list[str]:
        """Return the C statements that compute the `chosen` graph nodes; updates `names`."""
        graph, language = self._graph, c_language("float64")
        lines: list[str] = []
        pairs: dict[int, str] = {}
        for k in chosen:
            node = graph.nodes[k]
            if sincos and node.operation in _ANGLES:
                angle = node.arguments[0]
                if angle not in pairs:
                    pairs[angle] = f"a{len(pairs)}"
                    lines.append(f"const pair {pairs[angle]} = {sincos}({names[angle]});")
                    if sincos == "near_":
                        lines.append(f"far |= far_({names[angle]});")
                names[k] = f"{pairs[angle]}.{_ANGLES[node.operation]}"
            else:
                lines += statements(graph, [k], names, language.printed, language.form)
        return lines


def _starts(ports: Sequence[Port]) -> dict[str, int]:
    """Return each port's first row in an array in which all ports are stacked, by name."""
    starts, row = {}, 0
    for port in ports:
        starts[port.name] = row
        row += port.size
    return starts
