"""The paper, as CasADi expressions: each equation once, for one pose, generic over legs.

Nothing here knows of batches, files or errors, and nothing branches on a value. A machine's numbers
may be numbers or symbols (`Machine.of`, `Machine.symbols`), so that the same lines serve this
machine, every machine of its topology, and exact arithmetic. Equation numbers are the paper's.
"""
