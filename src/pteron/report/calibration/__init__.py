"""The report on a calibration: a page to read, its numbers, and the machine as it was found."""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.report.calibration.firmware import (
        FirmwareFit as FirmwareFit,
        firmware_fit as firmware_fit,
    )
    from pteron.report.calibration.values import (
        CalibrationRow as CalibrationRow,
        value_rows as value_rows,
    )
    from pteron.report.calibration.write import (
        Written as Written,
        numbers as numbers,
        write_calibration as write_calibration,
    )

_publish(__name__)
