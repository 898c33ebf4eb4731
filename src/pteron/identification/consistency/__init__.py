"""Physically possible bodies with identified base parameters: positive masses, valid inertias."""

from pteron.public import publish as _publish

_publish(__name__)
