"""The report on a calibration: a page to read, its numbers, and the machine as it was found."""

from pteron.public import publish as _publish

_publish(__name__)
