from pteron.reduction.certificate import (
    Certificate as Certificate,
    ExactCertificate as ExactCertificate,
    NumericalCertificate as NumericalCertificate,
)
from pteron.reduction.cheapest import cheapest_parameters as cheapest_parameters
from pteron.reduction.find import (
    base_parameters as base_parameters,
    base_regressor as base_regressor,
)
from pteron.reduction.forms import (
    FORMS as FORMS,
    GRAPHS as GRAPHS,
    model_forms as model_forms,
)
from pteron.reduction.result import BaseParameters as BaseParameters
