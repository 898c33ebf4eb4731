from pteron.report.identification.values import (
    ReportedParameter as ReportedParameter,
    parameter_rows as parameter_rows,
)
from pteron.report.identification.write import (
    Written as Written,
    model_path as model_path,
    numbers as numbers,
    write_identification as write_identification,
)
from pteron.report.typeset import value_with_uncertainty as value_with_uncertainty
