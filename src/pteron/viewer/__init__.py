"""The viewer: a machine in the browser, in space, moved by sliders or by hand, with its forces."""

from pteron.arguments import check_arguments
from pteron.viewer.view import Viewer, view

__all__ = ["Viewer", "view"]
check_arguments(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
