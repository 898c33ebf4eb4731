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
