"""Kinematics, dynamics, indices and control as CasADi expressions for one pose and any legs.

The expressions contain no batches, files or errors, and no branch that depends on a value. The data
of a machine are numbers or symbols (`Machine.numeric`, `Machine.symbolic`), so that the same lines
serve one machine, all machines of its topology, and exact arithmetic. Equation numbers are those of
the paper on the Quadrupteron's dynamics.
"""
