"""A function as a graph of sums of many terms and products of many factors, for `passes`.

A graph of pairs, a + (b + c), hides parts that two sums, and factors that several terms, have in
common.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from itertools import chain
from math import isfinite
from typing import Any

Node = tuple[Any, ...]
"""("input", port, element), ("constant", c) with c >= 0, ("sum", *values), ("product", *nodes),
("inverse", node), ("reciprocal", node) or, for every other operation, (its name, *values)."""

Rule = Callable[["TermGraph", int, list[int]], int]
"""Makes, in a new graph, the value of a node of an old one from its operands' new values."""


class TermGraph:
    """Nodes, each of them once, numbered from 1. A value is a node's number or minus that.

    Sums and products come in a normal form, by which the same value is the same node: sorted, equal
    terms and constants collected, the first term of a sum positive, signs out of products.
    """

    def __init__(self) -> None:
        self.nodes: list[Node] = [()]
        self.kinds: list[str] = [""]
        self.operands: list[tuple[int, ...]] = [()]
        """The values that each node is made of."""
        self.numbers: dict[Node, int] = {}
        self._constants: dict[int, float] = {}
        self._orders: dict[tuple[int, ...], list[int]] = {}

    def add(self, *node: Any) -> int:
        """Return the number of a node (kind, operands), added unless an equal node exists."""
        number = self.numbers.get(node)
        if number is None:
            number = self.numbers[node] = len(self.nodes)
            kind = node[0]
            self.nodes.append(node)
            self.kinds.append(kind)
            self.operands.append(() if kind in ("input", "constant") else node[1:])
            if kind == "constant" and isfinite(node[1]):
                self._constants[number] = node[1]
        return number

    def replace(self, k: int, *node: Any) -> None:
        """Replace node k, in place, by a node of equal value."""
        self.nodes[k], self.operands[k] = node, node[1:]
        self._orders.clear()

    def constant(self, c: float) -> int:
        """Return the signed node number of a constant."""
        return -self.add("constant", -c) if c < 0 else self.add("constant", c)

    def constant_of(self, operand: int) -> float | None:
        """Return the constant that a signed node is.

        The result is None if the node depends on inputs or is not finite.
        """
        c = self._constants.get(abs(operand))
        return c if c is None or operand > 0 else -c

    def sum(self, operands: Iterable[int]) -> int:
        """Return the signed node number of a sum of signed nodes."""
        terms = list(operands)
        sizes = set(map(abs, terms))
        if len(sizes) < len(terms) or not self._constants.keys().isdisjoint(sizes):
            terms = self._collect_terms(terms)
        if len(terms) == 1:
            return terms[0]
        terms.sort(key=abs)
        if terms[0] > 0:
            return self.add("sum", *terms)
        return -self.add("sum", *[-term for term in terms])

    def _collect_terms(self, operands: list[int]) -> list[int]:
        """Return a sum's signed terms with like terms and constants collected."""
        constant = 0.0
        counts: dict[int, int] = {}
        for operand in operands:
            k, sign = (operand, 1) if operand > 0 else (-operand, -1)
            c = self._constants.get(k)
            if c is None:
                counts[k] = counts.get(k, 0) + sign
            else:
                constant += sign * c
        terms = []
        for k, count in counts.items():
            if count:
                many = abs(count) > 1
                size = self.product([k, self.constant(float(abs(count)))]) if many else k
                terms.append(size if count > 0 else -size)
        if constant or not terms:
            terms.append(self.constant(constant))
        return terms

    def product(self, operands: Iterable[int]) -> int:
        """Return the signed node number of a product of signed nodes."""
        operand_list = list(operands)
        factors = sorted(map(abs, operand_list))
        turned = sum([operand < 0 for operand in operand_list]) % 2
        if not self._constants.keys().isdisjoint(factors):
            constant = -1.0 if turned else 1.0
            for k in map(abs, operand_list):
                constant *= self._constants.get(k, 1.0)
            factors = [k for k in factors if k not in self._constants]
            if constant == 0.0 or not factors:
                return self.constant(constant)
            if abs(constant) != 1.0:
                factors = sorted([*factors, self.constant(abs(constant))])
            turned = constant < 0
        elif not factors:
            return self.constant(1.0)
        number = factors[0] if len(factors) == 1 else self.add("product", *factors)
        return -number if turned else number

    def quotient(self, a: int, b: int) -> int:
        """Return the signed node number of the quotient a / b."""
        c = self.constant_of(a)
        if c is not None and abs(c) == 1.0:
            return self.reciprocal(b) * int(c)
        return self.product([a, self.inverse(b)])

    def reciprocal(self, operand: int) -> int:
        """Return the signed node number of 1/x as an operation that others may share."""
        c = self.constant_of(operand)
        return (
            self.constant(1.0 / c) if c else sign_of(operand) * self.add("reciprocal", abs(operand))
        )

    def inverse(self, operand: int) -> int:
        """Return the signed node number of 1/x as a factor: shared if the graph has it."""
        c = self.constant_of(operand)
        if c:
            return self.constant(1.0 / c)
        there = self.numbers.get(("reciprocal", abs(operand)))
        return sign_of(operand) * (there or self.add("inverse", abs(operand)))

    def is_kind(self, kind: str, operand: int) -> bool:
        """Return whether an operand, a node's index with a sign, is of this kind: "sum" ..."""
        return self.kinds[abs(operand)] == kind

    def order(self, roots: Iterable[int]) -> list[int]:
        """Return the numbers of the nodes that the roots depend on, operands first."""
        start = tuple(map(abs, roots))
        if start in self._orders:
            return self._orders[start]
        order: dict[int, None] = {}
        stack = list(start)
        while stack:
            last = stack.pop()
            if last < 0:  # what -last is made of is there
                order[-last] = None
            elif last not in order:
                waiting = [k for k in map(abs, self.operands[last]) if k not in order]
                if waiting:
                    stack.append(-last)
                    stack += waiting
                else:
                    order[last] = None
        self._orders[start] = ordered = list(order)
        return ordered

    def uses(self, roots: Iterable[int]) -> Counter[int]:
        """Return how often each node is used, as an operand or a root."""
        roots = list(roots)
        operands = chain.from_iterable([self.operands[k] for k in self.order(roots)])
        return Counter(map(abs, chain(roots, operands)))

    def rebuild(self, roots: Iterable[int], rule: Rule) -> tuple[TermGraph, list[int]]:
        """Return the graph that `rule` builds node by node from this one, and the new roots."""
        new = TermGraph()
        new_values: dict[int, int] = {}
        for k in self.order(roots):
            new_values[k] = new_value = rule(new, k, [new_values[v] for v in self.operands[k]])
            new_values[-k] = -new_value
        return new, [new_values[v] for v in roots]

    def copy_node(self, new: TermGraph, k: int, operands: list[int]) -> int:
        """Return the signed number of node k copied into the graph `new` with these operands."""
        kind = self.kinds[k]
        if kind in ("sum", "product"):
            return new.sum(operands) if kind == "sum" else new.product(operands)
        if kind in ("inverse", "reciprocal"):
            return new.inverse(operands[0]) if kind == "inverse" else new.reciprocal(operands[0])
        return new.add(kind, *operands) if operands else new.add(*self.nodes[k])


def sign_of(value: float) -> int:
    """Return 1 for a positive number, else -1."""
    return 1 if value > 0 else -1
