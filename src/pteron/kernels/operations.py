"""The arithmetic of a CasADi function, counted from its instructions."""

from __future__ import annotations

import casadi as ca

__all__ = ["count_operations"]

_FREE = frozenset({ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_ASSIGN})


def count_operations(function: ca.Function) -> int:
    """Return the arithmetic operations of one evaluation of an SX function.

    + - * / negation, square root, sine, cosine and the like count one each; inputs, outputs, moves
    and constants are free. Shared subexpressions count once, if `casadi.cse` was applied.
    """
    return sum(function.instruction_id(k) not in _FREE for k in range(function.n_instructions()))
