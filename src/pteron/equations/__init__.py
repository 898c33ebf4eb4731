"""The paper, as CasADi expressions: each equation once, for one pose, in three-vectors.

Nothing here knows of batches, files or errors, and nothing branches on a value. Geometry may be
numbers or symbols (`Geometry.of`, `Geometry.symbols`), so that the same lines serve this machine,
every machine of its topology, and exact arithmetic. Equation numbers are the paper's.
"""
