"""HTML reports on a machine, and animations of a motion.

`write_report` writes a page with all properties of a machine; `write_motion_page` one of a motion.
"""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
