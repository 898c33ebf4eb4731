"""Stability margins of a controlled machine, and choice of gains for required margins."""

from pteron.public import publish as _publish

_publish(__name__)
