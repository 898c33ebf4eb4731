"""HTML reports: all about a machine on one page, or one of its motions.

`write_report` has all that Pteron knows of a machine; `write_motion_page` shows one motion of it.
"""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.report.write import (
        write_motion_page as write_motion_page,
        write_report as write_report,
    )

_publish(__name__, checked=True)
