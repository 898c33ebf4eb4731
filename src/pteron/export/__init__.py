"""Exports of a machine: code for controllers, files for physics engines, models for other tools."""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
