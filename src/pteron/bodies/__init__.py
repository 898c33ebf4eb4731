"""Rigid bodies: their inertia, inertial parameters and motion, and vectors in space."""

from pteron.public import publish as _publish

_publish(__name__)
