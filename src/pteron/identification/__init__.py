"""From a recorded motion to the parameters of the machine that made it, and how far to trust them.

`identify` does all of it. Its parts can be used by themselves: `logs` reads, `signals` turns
samples into states, `equations_of` stacks the regressor, `estimators` solve, `consistency` finds
real bodies, `excitation` makes the motions worth recording.
"""

from pteron.identification.consistency import Bounds, Consistency, consistent_model
from pteron.identification.drive_gains import DriveGains, identify_drive_gains
from pteron.identification.equations import Equations, equations_of, stacked
from pteron.identification.estimators import (
    Essential,
    Estimate,
    Ridge,
    essential_parameters,
    huber,
    ordinary,
    ridge,
    total,
    weighted,
)
from pteron.identification.estimators.column_errors import column_errors
from pteron.identification.estimators.likelihood import maximum_likelihood
from pteron.identification.excitation import (
    Excitation,
    FourierMotion,
    Limits,
    optimal_excitation,
    random_excitation,
)
from pteron.identification.fitting import METHODS
from pteron.identification.identify import identify
from pteron.identification.logs import Log, open_log, read_log, write_log
from pteron.identification.model import Model, Terms, identification_model
from pteron.identification.payload import Payload, identify_payload
from pteron.identification.prediction import Prediction
from pteron.identification.result import Identification
from pteron.identification.signals import Processing, States, Treatment, treatment_of
from pteron.identification.verdict import Verdict

__all__ = [
    "METHODS",
    "Bounds",
    "Consistency",
    "DriveGains",
    "Equations",
    "Essential",
    "Estimate",
    "Excitation",
    "FourierMotion",
    "Identification",
    "Limits",
    "Log",
    "Model",
    "Payload",
    "Prediction",
    "Processing",
    "Ridge",
    "States",
    "Terms",
    "Treatment",
    "Verdict",
    "column_errors",
    "consistent_model",
    "equations_of",
    "essential_parameters",
    "huber",
    "identification_model",
    "identify",
    "identify_drive_gains",
    "identify_payload",
    "maximum_likelihood",
    "open_log",
    "optimal_excitation",
    "ordinary",
    "random_excitation",
    "read_log",
    "ridge",
    "stacked",
    "total",
    "treatment_of",
    "weighted",
    "write_log",
]
