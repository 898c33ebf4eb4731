"""The report on an identification: a page to read, its numbers, the model file of real bodies."""

from pteron.report.identification.values import Parameter, measured, parameter_rows
from pteron.report.identification.write import Written, model_path, numbers, write_identification

__all__ = [
    "Parameter",
    "Written",
    "measured",
    "model_path",
    "numbers",
    "parameter_rows",
    "write_identification",
]


def __dir__() -> list[str]:
    return sorted(__all__)
