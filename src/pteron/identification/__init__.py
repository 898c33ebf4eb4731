"""Identification of a machine's parameters from a log of its motion, with a verdict on trust.

`identify` does all of it. Its parts can be used by themselves: `logs` reads, `signals` turns
samples into states, `observations_of` stacks the regressor, `estimators` solve, `consistency` finds
real bodies, `excitation` makes the motions worth recording. `estimate` takes a regressor of any
robot.
"""

from typing import TYPE_CHECKING

from pteron.arguments import check_arguments
from pteron.identification import consistency, estimators, excitation, logs, signals
from pteron.identification.consistency import Bounds, Consistency, consistent_model
from pteron.identification.drive_gains import DriveGains, identify_drive_gains
from pteron.identification.errors import LogError
from pteron.identification.estimators import (
    Essential,
    Estimate,
    Reduced,
    column_errors,
    essential_parameters,
    halves,
    huber,
    instrumental,
    maximum_likelihood,
    ordinary,
    reduced,
    total,
    weighted,
)
from pteron.identification.excitation import (
    Excitation,
    FourierMotion,
    Limits,
    optimal_excitation,
    random_excitation,
)
from pteron.identification.faults import FaultIsolation, IsolatedFault
from pteron.identification.fitting import METHODS
from pteron.identification.identify import identify
from pteron.identification.logs import Log, open_log, read_log, write_log
from pteron.identification.model import Model, Terms, identification_model
from pteron.identification.observation import Observations, observations_of, stacked
from pteron.identification.payload import Payload, identify_payload
from pteron.identification.prediction import Prediction
from pteron.identification.regressor import Fit, estimate
from pteron.identification.result import Identification
from pteron.identification.signals import Preprocessing, Processing, States, preprocessing_of
from pteron.identification.verdict import Verdict
from pteron.renamed import former_names

__all__ = [
    "Bounds",
    "Consistency",
    "DriveGains",
    "Essential",
    "Estimate",
    "Excitation",
    "FaultIsolation",
    "Fit",
    "FourierMotion",
    "Identification",
    "IsolatedFault",
    "Limits",
    "Log",
    "LogError",
    "METHODS",
    "Model",
    "Observations",
    "Payload",
    "Prediction",
    "Preprocessing",
    "Processing",
    "Reduced",
    "States",
    "Terms",
    "Verdict",
    "column_errors",
    "consistency",
    "consistent_model",
    "essential_parameters",
    "estimate",
    "estimators",
    "excitation",
    "halves",
    "huber",
    "identification_model",
    "identify",
    "identify_drive_gains",
    "identify_payload",
    "instrumental",
    "logs",
    "maximum_likelihood",
    "observations_of",
    "open_log",
    "optimal_excitation",
    "ordinary",
    "preprocessing_of",
    "random_excitation",
    "read_log",
    "reduced",
    "signals",
    "stacked",
    "total",
    "weighted",
    "write_log",
]
check_arguments(__name__, classes=("Bounds", "Terms"))

if not TYPE_CHECKING:
    __getattr__ = former_names(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
