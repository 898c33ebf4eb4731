"""Performance of a machine at a pose: indices, stiffness, pose errors and joint reactions."""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
