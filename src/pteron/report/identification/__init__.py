"""The report on identified dynamics: an HTML page, its numbers, and the machine's file.

The file is that of the machine with bodies that can exist, where the values allow any.
"""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
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

_publish(__name__)
