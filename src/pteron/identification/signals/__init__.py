"""States of the machine from the samples of a log, filtered without a shift in time.

Positions are smoothed and differentiated in joint space, where they were measured; poses,
velocities and accelerations of the platform follow from them by exact kinematics.
"""

from pteron.public import publish as _publish

_publish(__name__)
