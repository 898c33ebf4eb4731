"""Calibration of a machine's geometry from measurements, with a report of what they cannot show.

`plan` chooses the poses to measure, `read_measurements` reads a log of them, and `calibrate` finds
the geometry: a `Calibration`.
"""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.calibration.calibrate import calibrate as calibrate
    from pteron.calibration.measured_log import read_measurements as read_measurements
    from pteron.calibration.measurements import (
        Measurements as Measurements,
        Place as Place,
        ReferencePlane as ReferencePlane,
        Setup as Setup,
    )
    from pteron.calibration.observability import Observability as Observability
    from pteron.calibration.plan import Plan as Plan, plan as plan
    from pteron.calibration.result import (
        Calibration as Calibration,
        CalibrationFinding as CalibrationFinding,
        HeldOut as HeldOut,
        HiddenOrder as HiddenOrder,
        Value as Value,
    )
    from pteron.calibration.unknowns import TOLERANCES as TOLERANCES
    from pteron.verdict import Verdict as Verdict

_publish(__name__, checked=True)
