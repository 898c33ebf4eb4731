"""A machine with its drives, simulated under a controller, under given forces, or free."""

from pteron.public import publish as _publish

_publish(__name__)
