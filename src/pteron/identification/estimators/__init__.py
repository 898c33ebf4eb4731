"""Estimators, one a file: each takes equations and returns an estimate."""

from collections.abc import Callable

from pteron.identification.equations import Equations
from pteron.identification.estimators.essential import Essential, essential_parameters
from pteron.identification.estimators.estimate import Estimate
from pteron.identification.estimators.huber import huber
from pteron.identification.estimators.ordinary import ordinary
from pteron.identification.estimators.ridge import Ridge, ridge
from pteron.identification.estimators.total import total
from pteron.identification.estimators.weighted import weighted
from pteron.identification.estimators.whiteness import Whiteness

__all__ = [
    "ESTIMATORS",
    "Essential",
    "Estimate",
    "Ridge",
    "Whiteness",
    "essential_parameters",
    "huber",
    "ordinary",
    "ridge",
    "total",
    "weighted",
]

ESTIMATORS: dict[str, Callable[[Equations], Estimate]] = {
    "ordinary": ordinary,
    "weighted": weighted,
    "huber": huber,
    "total": total,
}
"""The estimators that need nothing but equations, by name."""
