"""`view`: a machine in the browser, in 3-D, moved by sliders or by hand, with its forces."""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.viewer.view import Viewer as Viewer, view as view

_publish(__name__, checked=True)
