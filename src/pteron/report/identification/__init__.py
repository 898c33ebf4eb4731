"""The report on an identification: a page to read, its numbers, the model file of real bodies."""

from pteron.public import publish as _publish
from pteron.report.identification.values import (
    Parameter as Parameter,
    parameter_rows as parameter_rows,
)
from pteron.report.identification.write import (
    Written as Written,
    model_path as model_path,
    numbers as numbers,
    write_identification as write_identification,
)
from pteron.report.typeset import measured as measured

_publish(__name__)
