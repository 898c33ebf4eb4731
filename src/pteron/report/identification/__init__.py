"""The report on identified dynamics: an HTML page, its numbers, and the machine's file.

The file is that of the machine with bodies that can exist, where the values allow any.
"""

from pteron.public import publish as _publish

_publish(__name__)
