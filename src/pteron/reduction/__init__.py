"""Base inertial parameters, by three methods, and the dynamic model reduced to them."""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
