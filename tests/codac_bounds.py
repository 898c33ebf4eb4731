"""What codac, an independent library of intervals, finds: in a process of its own.

It makes its process round all numbers upwards, for good: files would no longer be read as written.
"""

EXPRESSIONS = {
    "polynomial": lambda m, a, b: square(m, a) * b - 3.0 * b + a * b,
    "quotient": lambda m, a, b: (a - 2.0) / (square(m, b) + 0.5),
    "root": lambda m, a, b: m.sqrt(square(m, a) + square(m, b) + 0.1) - a,
    "waves": lambda m, a, b: m.sin(5.0 * a) * m.cos(b) + m.cos(a - 7.0 * b),
    "angle": lambda m, a, b: m.atan2(a, b + 3.0) + m.exp(-a),
}


def square(m, a):
    return m.sqr(a) if hasattr(m, "sqr") else a * a


def natural(name, boxes):
    """Return least and greatest value of an expression's natural form in boxes (B, 2, 2)."""
    import codac

    w = codac.VectorVar(2)
    function = codac.AnalyticFunction([w], EXPRESSIONS[name](codac, w[0], w[1]))
    found = []
    for low, high in boxes:
        box = codac.IntervalVector([list(side) for side in zip(low, high, strict=True)])
        one = function.eval(codac.EvalMode.NATURAL, box)
        found.append([one.lb(), one.ub()])
    return found
