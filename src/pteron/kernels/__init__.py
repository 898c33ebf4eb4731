"""CasADi expressions made executable ("kernels"): by CasADi, Numba, C, JAX, fractions, intervals.

Batches of states, threads and the cache of compiled code live here and only here.
"""

from pteron.public import publish as _publish

# The others serve the floors above, in inner loops.

_publish(__name__, checked=("bounded_function", "bounds", "compile"))
