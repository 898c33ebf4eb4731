"""HTML reports: all about a machine on one page, or one of its motions.

`write_report` has all that Pteron knows of a machine; `write_motion_page` shows one motion of it.
"""

from pteron.arguments import check_arguments
from pteron.report.write import write_motion_page, write_report

__all__ = ["write_motion_page", "write_report"]
check_arguments(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
