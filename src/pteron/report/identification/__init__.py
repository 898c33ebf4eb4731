"""An identification as files: a page to read, its numbers, and the model of real bodies."""

from pteron.report.identification.folder import prepared_folder
from pteron.report.identification.model_file import model_path
from pteron.report.identification.numbers import numbers
from pteron.report.identification.parameters import Parameter, measured, parameter_rows
from pteron.report.identification.write import Written, write_identification

__all__ = [
    "Parameter",
    "Written",
    "measured",
    "model_path",
    "numbers",
    "parameter_rows",
    "prepared_folder",
    "write_identification",
]
