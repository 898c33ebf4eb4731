"""Kinematics, dynamics, indices and control as CasADi expressions for one pose and any legs.

Nothing here knows of batches, files or errors, and nothing branches on a value. A machine's numbers
may be numbers or symbols (`Machine.numeric`, `Machine.symbolic`), so that the same lines serve one
machine, all machines of its topology, and exact arithmetic. Equation numbers are those of the paper
on the Quadrupteron's dynamics.
"""
