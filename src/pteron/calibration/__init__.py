"""Calibration of a machine's geometry from measurements, with a report of what they cannot show.

`plan` chooses the poses to measure, `read_measurements` reads a log of them, and `calibrate` finds
the geometry: a `Calibration`.
"""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
