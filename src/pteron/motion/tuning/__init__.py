"""Stability margins of a machine under a controller, and gains chosen for stated ones."""

from pteron.public import publish as _publish

_publish(__name__)
