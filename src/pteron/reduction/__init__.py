"""Base inertial parameters, by three methods, and the dynamic model reduced to them."""

from pteron.arguments import check_arguments
from pteron.reduction.certificate import (
    Certificate,
    ExactCertificate,
    NumericalCertificate,
)
from pteron.reduction.cheapest import cheapest_parameters
from pteron.reduction.find import base_parameters
from pteron.reduction.forms import FORMS, model_forms
from pteron.reduction.reduced import base_regressor
from pteron.reduction.result import BaseParameters

__all__ = [
    "FORMS",
    "BaseParameters",
    "Certificate",
    "ExactCertificate",
    "NumericalCertificate",
    "base_parameters",
    "base_regressor",
    "cheapest_parameters",
    "model_forms",
]
check_arguments(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
