"""Motions of the platform, the forces that they need, and simulation of the machine."""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
