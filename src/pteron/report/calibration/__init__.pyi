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
