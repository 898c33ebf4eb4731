"""Estimators: each takes observations (regressor and forces) and returns an `Estimate`."""

from collections.abc import Callable as _Callable

from pteron.identification.estimators.essential import (
    Essential as Essential,
    essential_parameters as essential_parameters,
)
from pteron.identification.estimators.estimate import (
    Estimate as Estimate,
    Whiteness as Whiteness,
    whiteness as whiteness,
)
from pteron.identification.estimators.instrumental import (
    halves as halves,
    instrumental as instrumental,
)
from pteron.identification.estimators.least_squares import (
    huber as huber,
    ordinary as ordinary,
    weighted_least_squares as weighted_least_squares,
)
from pteron.identification.estimators.likelihood import maximum_likelihood as maximum_likelihood
from pteron.identification.estimators.qr import QrFactor as QrFactor, qr_factor as qr_factor
from pteron.identification.estimators.reduction import (
    Reduced as Reduced,
    independent_columns as independent_columns,
)
from pteron.identification.estimators.total import column_errors as column_errors, total as total
from pteron.identification.observation import Observations as _Observations
from pteron.public import publish as _publish

ESTIMATORS: dict[str, _Callable[[_Observations], Estimate]] = {
    "ordinary": ordinary,
    "weighted": weighted_least_squares,
    "huber": huber,
    "total": total,
}
"""The estimators that need nothing but observations, by name."""

_publish(__name__)
