"""Simulation of a machine with its drives: under a controller, given forces, or free."""

from pteron.public import publish as _publish

_publish(__name__)
