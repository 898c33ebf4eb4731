from pteron.report.write import (
    write_motion_page as write_motion_page,
    write_report as write_report,
)
