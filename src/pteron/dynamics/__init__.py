"""The public functions of dynamics: forces, accelerations, mass matrix, energies, regressor.

They take a machine and arrays of states, check them, and return arrays.
"""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
