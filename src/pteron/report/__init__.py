"""HTML reports: all about a machine on one page, or one of its motions.

`write_report` has all that Pteron knows of a machine; `write_motion_page` shows one motion of it.
"""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
