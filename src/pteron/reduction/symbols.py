"""Coefficients of base parameters in symbols of the geometry, such as 1/ll1^2 (mass transfers)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from sympy import Integer, Symbol, sqrt, sympify
from sympy.polys.matrices import DomainMatrix

from pteron.bodies.parameters import Parameter
from pteron.reduction.exact_geometry import ExactGeometry
from pteron.reduction.surds import Surd
from pteron.reduction.transfers import MassTransfer


def named_values(geometry: ExactGeometry, *, shared: bool = True) -> dict[str, Any]:
    """Return the value of each geometric symbol: a SymPy symbol, minus one, or zero.

    Values that agree but for their sign share the symbol of the first leg that has them, so that
    relations which hold because of it are seen; where they are not `shared`, each has its own.
    """
    named: dict[str, Any] = {}
    first: dict[Fraction | str, tuple[str, Surd]] = {}
    for name, length in geometry.symbols().items():
        if length.q == 0:
            named[name] = Integer(0)
            continue
        bearer, first_value = first.setdefault(length.square if shared else name, (name, length))
        sign = 1 if (first_value.q > 0) == (length.q > 0) else -1
        named[name] = sign * Symbol(bearer)
    return named


def algebraic_values(geometry: ExactGeometry) -> dict[str, Any]:
    """Return the values of the geometric symbols as exact SymPy numbers."""
    return {name: sympify(surd.q) * sqrt(surd.s) for name, surd in geometry.symbols().items()}


def symbolic_shares(
    columns: Sequence[Parameter],
    base_columns: Sequence[int],
    mass_transfers: Sequence[MassTransfer],
    extra: Sequence[Mapping[int, Any]],
    symbols: Mapping[str, Any],
) -> dict[int, dict[int, Any]]:
    """Return the shares of the dependent columns on the kept ones, as SymPy expressions.

    Parameters
    ----------
    columns : sequence of Parameter
        The columns.
    base_columns : sequence of int
        The columns kept.
    mass_transfers : sequence of MassTransfer
        The transfers.
    extra : sequence of mapping
        Null vectors that no transfer explains, by column, as numbers.
    symbols : mapping
        What is put for the geometry: SymPy symbols, or exact numbers.
    """
    dropped = [j for j in range(len(columns)) if j not in base_columns]
    order = [*dropped, *base_columns]
    vectors: list[Mapping[int, Any]] = [
        {columns.index(column): share for column, share in transfer.evaluate(symbols).items()}
        for transfer in mass_transfers
    ]
    rows = [[sympify(vector.get(j, 0)) for j in order] for vector in (*vectors, *extra)]
    matrix = DomainMatrix.from_list_sympy(len(rows), len(order), rows, extension=True).to_field()
    reduced, pivots = matrix.rref()
    if pivots != tuple(range(len(dropped))):
        raise AssertionError("the transfers do not give the dependent columns")
    solved = reduced.to_Matrix()
    return {
        j: {
            k: -solved[row, len(dropped) + place]
            for place, k in enumerate(base_columns)
            if solved[row, len(dropped) + place] != 0
        }
        for row, j in enumerate(dropped)
    }
