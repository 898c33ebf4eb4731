"""Pictures: functions of arrays, machines or results that return a matplotlib Figure; and films.

Nothing here touches pyplot's global state.
"""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
