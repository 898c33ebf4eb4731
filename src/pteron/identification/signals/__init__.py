"""States of the machine from a log's samples, with noise kept out and nothing shifted in time.

Positions are smoothed and differentiated in joint space, where they were measured; poses,
velocities and accelerations of the platform follow from them by exact kinematics.
"""

from pteron.public import publish as _publish

_publish(__name__)
