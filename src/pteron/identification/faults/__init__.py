"""Fault isolation: faults of logs or machine that a fit's residuals show, and their effects."""

from pteron.public import publish as _publish

_publish(__name__)
