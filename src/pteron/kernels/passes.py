"""`optimise_function` rewrites a CasADi function to fewer operations; equations can be plain.

An equation says what it means: a lever times a force, a length times a sine, a sum over the legs.
The savings that a person would make by hand are made here, once, for every equation:

    0.04*a*x - 0.04*b*y        ->  0.04*(a*x - b*y)         a factor of several terms, taken out
    x + y - z  and  w - y - x  ->  s = x + y; s - z, w - s  a part of two sums (or two products)
    -(a - b)  and  b - a       ->  b - a                    one difference: signs stand outside
    a/2.5                      ->  0.4*a                    a number's quotient is a product
    a/x  and  b/x              ->  r = 1/x; a*r, b*r        one division: it takes longer

A graph whose operations take two operands does not show such savings; one of sums and products of
many (`terms`) does. Three passes over it are repeated for as long as they save something:

    flatten   a sum that is used once, in a sum, becomes part of it
    factor    the factor that most terms of a sum have is taken out of them, again and again
    share     the pair that most sums hold becomes a sum of its own, again and again

Products are flattened and shared like sums; divisions are saved last, for one operation more each.
This is the greedy algebraic elimination of common subexpressions of A. Hosangadi, F. Fallah and
R. Kastner, IEEE Transactions on CAD 25 (2006) 2012-2022. No product of sums is multiplied out and
nothing is divided that was not divided before, so that a result differs from the plain one by the
rounding of its terms only, as long as 1/x is no overflow.
"""

from __future__ import annotations

import heapq
from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import combinations

import casadi as ca

from pteron.kernels.kernel import count_operations
from pteron.kernels.terms import TermGraph, sign_of
from pteron.kernels.translation import to_function, to_term_graph


def optimise_function(function: ca.Function) -> ca.Function:
    """Return a function of the same inputs, outputs and values that takes less time.

    It has fewer operations, except that saving a division, which takes as long as several products,
    may cost one more. If nothing is saved, the given function is returned.

    Examples
    --------
    >>> import casadi as ca
    >>> from pteron.kernels import count_operations
    >>> a, b, x, y = (ca.SX.sym(name) for name in "abxy")
    >>> plain = ca.Function("plain", [a, b, x, y], [0.04 * a * x - 0.04 * b * y])
    >>> count_operations(plain), count_operations(optimise_function(plain))
    (5, 4)
    """
    original = to_term_graph(function)
    (graph, roots), best, least = original, original, _cost(*original)
    while True:
        for step in (_flatten_terms, _factor_sums, _share_pairs):
            graph, roots = step(graph, roots)
        cost = _cost(graph, roots)
        if cost >= least:
            break
        best, least = (graph, roots), cost
    shortest = to_function(*best, function)
    if count_operations(shortest) >= count_operations(function):
        best, shortest = original, function
    divided = _share_divisions(*best)
    return shortest if divided is None else to_function(*divided, function)


def _share_divisions(old: TermGraph, roots: list[int]) -> tuple[TermGraph, list[int]] | None:
    """Return the graph with one reciprocal for each repeated divisor; None if none repeats."""
    uses = old.uses(roots)
    if not any(old.is_kind("inverse", k) and uses[k] > 1 for k in uses):
        return None

    def rule(new: TermGraph, k: int, values: list[int]) -> int:
        """Return the new graph's node for node k: a reciprocal if k divides several times."""
        several = old.is_kind("inverse", k) and uses[k] > 1
        return new.reciprocal(values[0]) if several else old.copy_node(new, k, values)

    return old.rebuild(roots, rule)


def _cost(graph: TermGraph, roots: list[int]) -> int:
    """Return the number of operations that the roots need, negations not counted."""
    cost, alone = 0, {abs(root) for root in roots}
    order = graph.order(roots)
    for k in order:
        kind, operands = graph.kinds[k], graph.operands[k]
        if kind in ("sum", "product"):
            cost += len(operands) - 1
        elif operands and kind != "inverse":
            cost += 1
        if kind != "product" or all(graph.is_kind("inverse", v) for v in operands):
            alone.update(abs(v) for v in operands)
    return cost + sum(graph.is_kind("inverse", k) for k in order if k in alone)


def _flatten_terms(old: TermGraph, roots: list[int]) -> tuple[TermGraph, list[int]]:
    """Return the graph and roots with nested sums and products of a single use merged."""
    uses = old.uses(roots)

    def rule(new: TermGraph, k: int, values: list[int]) -> int:
        """Return the new graph's node for node k, with nested sums or products merged."""
        kind = old.kinds[k]
        if kind == "reciprocal" and uses[k] == 1:
            return new.inverse(values[0])
        if kind not in ("sum", "product"):
            return old.copy_node(new, k, values)
        parts: list[int] = []
        for v, operand in zip(old.operands[k], values, strict=True):
            inner = [operand]
            if uses[abs(v)] == 1 and new.is_kind(kind, operand):
                inner = list(new.operands[abs(operand)])
                if operand < 0 and kind == "sum":
                    inner = [-part for part in inner]
                elif operand < 0:
                    inner[0] = -inner[0]
            parts += inner
        return new.sum(parts) if kind == "sum" else new.product(parts)

    return old.rebuild(roots, rule)


def _factor_sums(old: TermGraph, roots: list[int]) -> tuple[TermGraph, list[int]]:
    """Return the graph and roots with common factors of each sum's terms taken out."""
    uses = old.uses(roots)

    def rule(new: TermGraph, k: int, values: list[int]) -> int:
        """Return the new graph's node for node k; a sum has its common factors taken out."""
        if not old.is_kind("sum", k):
            return old.copy_node(new, k, values)
        terms = []
        for v, operand in zip(old.operands[k], values, strict=True):
            # A product that others use is computed anyhow: taking it apart saves nothing.
            is_split = uses[abs(v)] == 1 and new.is_kind("product", operand)
            terms.append(
                (sign_of(operand), new.operands[abs(operand)] if is_split else (abs(operand),))
            )
        return _sum_of_products(new, terms)

    return old.rebuild(roots, rule)


def _sum_of_products(graph: TermGraph, terms: list[tuple[int, tuple[int, ...]]]) -> int:
    """Return the node of a sum of (sign, factors) terms, common factors taken out."""
    while True:
        counts = Counter(f for _, factors in terms if len(factors) > 1 for f in set(factors))
        if max(counts.values(), default=0) < 2:
            return graph.sum(sign * graph.product(factors) for sign, factors in terms)
        best = max(counts, key=lambda f: (counts[f], f))
        others, quotients = [], []
        for sign, factors in terms:
            if len(factors) > 1 and best in factors:
                place = factors.index(best)
                quotients.append((sign, factors[:place] + factors[place + 1 :]))
            else:
                others.append((sign, factors))
        factored = graph.product([best, _sum_of_products(graph, quotients)])
        terms = [*others, (sign_of(factored), (abs(factored),))]


def _share_pairs(graph: TermGraph, roots: list[int]) -> tuple[TermGraph, list[int]]:
    """Return the graph and roots with one node for each operand pair that several nodes share."""
    order = graph.order(roots)
    for kind in ("sum", "product"):
        _name_pairs(graph, kind, [k for k in order if graph.is_kind(kind, k)])
    return graph.rebuild(roots, graph.copy_node)


def _name_pairs(graph: TermGraph, kind: str, owners: Sequence[int]) -> None:
    """Replace each operand pair that several nodes share by one node, in place."""
    lists = {k: list(graph.operands[k]) for k in owners}
    holders: dict[tuple[int, int], dict[int, None]] = defaultdict(dict)
    for k, operands in lists.items():
        for a, b in combinations(operands, 2):
            holders[_pair(a, b)][k] = None
    heap = [(-len(holding), pair) for pair, holding in holders.items() if len(holding) > 1]
    heapq.heapify(heap)
    while heap:
        count, pair = heapq.heappop(heap)
        # What the heap says may be out of date: an owner may have lost the pair to another one.
        signs = {k: sign for k in holders[pair] if (sign := _sign_of(pair, lists[k]))}
        if len(signs) < -count:
            holders[pair] = dict.fromkeys(signs)
            if len(signs) > 1:
                heapq.heappush(heap, (-len(signs), pair))
            continue
        if all(graph.is_kind("inverse", v) for v in pair):
            continue  # 1/(a b) is one more operation than a division by each
        name = next((k for k in signs if len(lists[k]) == 2), None)
        if name is None:
            name = graph.add(kind, *pair)
            lists[name] = list(pair)
        name_sign = _sign_of(pair, lists[name])
        for k, sign in signs.items():
            if k == name:
                continue
            for v in pair:
                lists[k].remove(sign * v)
            pair_value = sign * name_sign * name
            for v in lists[k]:
                holding = holders[_pair(v, pair_value)]
                holding[k] = None
                if len(holding) > 1:
                    heapq.heappush(heap, (-len(holding), _pair(v, pair_value)))
            lists[k].append(pair_value)
    for k, operands in lists.items():
        graph.replace(k, kind, *operands)


def _pair(a: int, b: int) -> tuple[int, int]:
    """Return a pair of operands in a canonical form, equal for both negated."""
    a, b = (a, b) if abs(a) < abs(b) else (b, a)
    return (a, b) if a > 0 else (-a, -b)


def _sign_of(pair: tuple[int, int], values: list[int]) -> int:
    """Return 1 if the operands contain the pair, -1 if they contain its negatives, else 0."""
    a, b = pair
    if a == b:
        return int(values.count(a) > 1)
    if a in values and b in values:
        return 1
    return -1 if -a in values and -b in values else 0
