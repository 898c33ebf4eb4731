"""What depends on one shared input alone, taken out of a function and done once for all states."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.kernels.functions import Program


def hoisted(program: Program, name: str) -> tuple[Program, ca.Function]:
    """Return a program that takes numbers instead of one input, and what makes them of it.

    The numbers are the largest subexpressions of that input alone, so that function(..., x, ...) =
    first(..., second(x), ...). Ports keep their names and their order.
    """
    function = program.function
    place = function.name_in().index(name)
    symbols = function.sx_in()
    slots: dict[int, tuple[Expression, bool]] = {}
    numbers: dict[int, tuple[Expression, Expression]] = {}
    outputs = [[ca.SX(0)] * function.nnz_out(i) for i in range(function.n_out())]

    def outside(slot: int) -> Expression:
        """Return a value as the first function sees it."""
        value, alone = slots[slot]
        if not alone or value.is_constant():
            return value
        key = int(value.element_hash())
        if key not in numbers:
            numbers[key] = value, ca.SX.sym(f"n{len(numbers)}")
        return numbers[key][1]

    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_INPUT:
            slots[target[0]] = symbols[source[0]].nonzeros()[source[1]], source[0] == place
        elif code == ca.OP_CONST:
            slots[target[0]] = ca.SX(function.instruction_constant(k)), True
        elif code == ca.OP_OUTPUT:
            outputs[target[0]][target[1]] = outside(source[0])
        else:
            alone = all(slots[i][1] for i in source)
            values = [slots[i][0] if alone else outside(i) for i in source]
            make = ca.SX.unary if len(source) == 1 else ca.SX.binary
            slots[target[0]] = make(code, *values), alone
    kept = list(numbers.values())
    inputs = list(symbols)
    inputs[place] = ca.vertcat(*(symbol for _, symbol in kept))
    results = [
        ca.SX(function.sparsity_out(i), ca.vertcat(*values)) for i, values in enumerate(outputs)
    ]
    first = ca.Function(function.name(), inputs, results, function.name_in(), function.name_out())
    ports = list(program.inputs)
    ports[place] = replace(ports[place], shape=(len(kept),))
    made = ca.Function(name, [symbols[place]], [ca.densify(ca.vertcat(*(v for v, _ in kept)))])
    return replace(program, function=first, inputs=tuple(ports)), made
