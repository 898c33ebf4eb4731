"""Pteron: parallel manipulators whose legs carry points of the platform.

Kinematics, dynamics by virtual work, and base inertial parameters, for the Quadrupteron and the
Tripteron, Deltas, Par4 and H4, five-bars and other planar machines, hexapods and others that tilt,
and any mixture of their legs. Subpackages have workspaces, motions, control, identification,
calibration, design, pictures, reports and exports.
`robot` is a `Manipulator`; poses, velocities and accelerations have shape (..., m), joint
coordinates and actuator forces (..., n), in SI units and radians.
"""

from pteron.public import publish as _publish

__version__ = "0.3.0.dev0"

_publish(__name__, extras={"environments": "gymnasium"})
