"""The public functions of kinematics: poses, joint coordinates, Jacobians, modes, singularities.

They take a machine and arrays of poses or joint coordinates, check them, and return arrays.
"""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
