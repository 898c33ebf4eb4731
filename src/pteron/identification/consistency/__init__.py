"""Real bodies for identified base parameters: masses above zero, inertias that a body can have."""

from pteron.public import publish as _publish

_publish(__name__)
