"""Estimators: each takes observations (regressor and forces) and returns an `Estimate`."""

from collections.abc import Callable

from pteron.identification.estimators.essential import Essential, essential_parameters
from pteron.identification.estimators.estimate import Estimate, Whiteness, whiteness
from pteron.identification.estimators.instrumental import halves, instrumental
from pteron.identification.estimators.least_squares import huber, ordinary, weighted
from pteron.identification.estimators.likelihood import maximum_likelihood
from pteron.identification.estimators.qr import QrFactor, qr_factor
from pteron.identification.estimators.reduction import Reduced, reduced
from pteron.identification.estimators.total import column_errors, total
from pteron.identification.observation import Observations

__all__ = [
    "ESTIMATORS",
    "Essential",
    "Estimate",
    "QrFactor",
    "Reduced",
    "Whiteness",
    "column_errors",
    "essential_parameters",
    "halves",
    "huber",
    "instrumental",
    "maximum_likelihood",
    "ordinary",
    "qr_factor",
    "reduced",
    "total",
    "weighted",
    "whiteness",
]

ESTIMATORS: dict[str, Callable[[Observations], Estimate]] = {
    "ordinary": ordinary,
    "weighted": weighted,
    "huber": huber,
    "total": total,
}
"""The estimators that need nothing but observations, by name."""


def __dir__() -> list[str]:
    return sorted(__all__)
