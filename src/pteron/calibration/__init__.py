"""Calibration of a machine's geometry from measurements, with what they cannot show said aloud.

`read_measurements` reads logs, `calibrate` does all the rest; `Measurements` are its data,
`Calibration` its result.
"""

from pteron.calibration.calibrate import calibrate
from pteron.calibration.measured_log import read_measurements
from pteron.calibration.measurements import Measurements, Place, Plane, Setup
from pteron.calibration.observability import Observability
from pteron.calibration.result import Calibration, Finding, HeldOut, Value, Verdict
from pteron.calibration.unknowns import TOLERANCES

__all__ = [
    "TOLERANCES",
    "Calibration",
    "Finding",
    "HeldOut",
    "Measurements",
    "Observability",
    "Place",
    "Plane",
    "Setup",
    "Value",
    "Verdict",
    "calibrate",
    "read_measurements",
]
