"""CasADi expressions made executable ("kernels"): by CasADi, Numba, C, JAX, fractions, intervals.

Batches of states, threads and the cache of compiled code are handled in this package only.
"""

from pteron.public import publish as _publish

# The others serve the floors above, in inner loops.

_publish(__name__, checked=("bounded_function", "bounds", "compile"))
