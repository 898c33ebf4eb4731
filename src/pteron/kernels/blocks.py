"""C functions of a program for a few states side by side, one in each lane of a vector register."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from pteron.kernels.c import c_language
from pteron.kernels.code import names_of, statements
from pteron.kernels.exponential import straight
from pteron.kernels.graph import Graph, graph_of
from pteron.kernels.kept import Program
from pteron.kernels.kernel import Port

_ANGLES = {"sin": "sine", "cos": "cosine"}


@dataclass(frozen=True)
class Block:
    """The statements of a program's C for one lane k; `loop.c.j2` puts functions around them.

    The C code reads rows, one for each element of an input: `in` has the inputs of a state,
    `numbers` the machine's own, and `own` values that are computed from `numbers` once. An output
    whose name is a key of `later` replaces the output named there, in lanes that do not `slide`. If
    the block is `split`, these outputs are computed in a second part, which reads rows that the
    first part has `kept`; else there is one part.
    """

    name: str
    program: Program
    later: Mapping[str, str] | None = None
    split: bool = False

    @cached_property
    def varying(self) -> tuple[Port, ...]:
        """The inputs of a state."""
        return tuple(port for port in self.program.inputs if not port.shared)

    @cached_property
    def fixed(self) -> tuple[Port, ...]:
        """The inputs that are the machine's own numbers."""
        return tuple(port for port in self.program.inputs if port.shared)

    @cached_property
    def at(self) -> dict[str, int]:
        """The first row of each input among its kind, and of each output."""
        return {**_starts(self.varying), **_starts(self.fixed)}

    @cached_property
    def out(self) -> dict[str, int]:
        """The first row of each output."""
        return _starts([port for port in self.program.outputs if not self._is_late(port)])

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Numbers of rows: of inputs, of the machine's numbers, of `own`, and of outputs."""
        return {
            "in": max(1, sum(port.size for port in self.varying)),
            "numbers": max(1, sum(port.size for port in self.fixed)),
            "own": max(1, len(self._own)),
            "kept": max(1, len(self._kept)),
            "out": sum(port.size for port in self.program.outputs if not self._is_late(port)),
        }

    @cached_property
    def once(self) -> list[str]:
        """The statements that fill `own`."""
        names = self._names()
        lines = self._lines([k for k in self._graph.operations() if k in self._shared], names, "")
        return [*lines, *(f"own[{row}][k] = {names[k]};" for k, row in self._own.items())]

    def body(self, sincos: str) -> list[str]:
        """Return the statements for a state; `sincos` is C's function for sine and cosine."""
        graph, names = self._graph, self._names()
        for k, row in self._own.items():
            names[k] = f"own[{row}][k]"
        late = self._late if self.split else frozenset[int]()
        rest = [k for k in graph.operations() if k not in self._shared and k not in late]
        lines = self._lines(rest, names, sincos)
        lines += (f"kept[{row}][k] = {names[k]};" for k, row in self._kept.items())
        found = {row: names[k] for row, k in self._results(later=False)}
        if not self.split:
            found |= {
                row: f"slides ? {found[row]} : {names[k]}" for row, k in self._results(later=True)
            }
        return [*lines, *(f"out[{row}][k] = {value};" for row, value in found.items())]

    @cached_property
    def second(self) -> list[str]:
        """The statements of the second part."""
        names = self._names()
        for where, rows in (("own", self._own), ("kept", self._kept)):
            for k, row in rows.items():
                names[k] = f"{where}[{row}][k]"
        lines = self._lines(sorted(self._late), names, "sincos_")
        return [*lines, *(f"out[{row}][k] = {names[k]};" for row, k in self._results(later=True))]

    def _results(self, *, later: bool) -> list[tuple[int, int]]:
        """Return rows of `out` and their nodes, of one of the parts."""
        return [
            (self.out[(self.later or {}).get(port.name, port.name)] + i, k)
            for port, part in zip(self.program.outputs, self._graph.outputs, strict=True)
            if self._is_late(port) == later
            for i, k in enumerate(part)
        ]

    def _is_late(self, port: Port) -> bool:
        return port.name in (self.later or ())

    @property
    def has_angles(self) -> bool:
        """Whether there is a sine or a cosine of a value that depends on the state."""
        nodes = self._graph.nodes
        return any(n.operation in _ANGLES for k, n in enumerate(nodes) if k not in self._shared)

    @cached_property
    def _graph(self) -> Graph:
        return graph_of(straight(self.program.function), self.program.inputs)

    @cached_property
    def _shared(self) -> frozenset[int]:
        graph = self._graph
        return frozenset(k for k in graph.operations() if graph.nodes[k].shared)

    @cached_property
    def _late(self) -> frozenset[int]:
        """The nodes that only the later outputs need."""
        graph, needed = self._graph, {k for _, k in self._results(later=False)}
        late = set[int]()
        for k in reversed(graph.operations()):
            if k in needed:
                needed |= set(graph.nodes[k].arguments)
            elif k not in self._shared:
                late.add(k)
        return frozenset(late)

    @cached_property
    def _kept(self) -> dict[int, int]:
        """The rows of `kept`, by node: values of the first part that the second reads."""
        if not self.split:
            return {}
        graph = self._graph
        first = set(graph.operations()) - self._late - self._shared
        read = {i for k in self._late for i in graph.nodes[k].arguments}
        read |= {k for _, k in self._results(later=True)}
        return {k: row for row, k in enumerate(sorted(read & first))}

    @cached_property
    def _own(self) -> dict[int, int]:
        """The rows of `own`, by node: those that nodes that are not shared read."""
        graph = self._graph
        read = {k for part in graph.outputs for k in part}
        for k in graph.operations():
            if k not in self._shared:
                read |= set(graph.nodes[k].arguments)
        return {k: row for row, k in enumerate(sorted(read & self._shared))}

    def _names(self) -> list[str]:
        ports = self.program.inputs

        def name(i: int, j: int) -> str:
            where = "numbers" if ports[i].shared else "in"
            return f"{where}[{self.at[ports[i].name] + j}][k]"

        return names_of(self._graph, name, c_language("float64").constant)

    def _lines(self, chosen: Sequence[int], names: list[str], sincos: str) -> list[str]:
        """Return statements for nodes; those of sines and cosines share a call for an angle."""
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
    found, row = {}, 0
    for port in ports:
        found[port.name] = row
        row += port.size
    return found
