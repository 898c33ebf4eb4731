"""Exciting trajectories: periodic motions whose forces determine the base parameters well."""

from pteron.public import publish as _publish

_publish(__name__)
