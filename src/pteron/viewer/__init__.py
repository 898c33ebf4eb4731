"""`view`: a machine in the browser, in 3-D, moved by sliders or by hand, with its forces."""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
