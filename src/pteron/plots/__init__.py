"""Pictures: each function takes arrays or results and returns a matplotlib Figure.

Physics is asked elsewhere; nothing here touches pyplot's global state.
"""

from pteron.plots.colors import LEG_COLORS
from pteron.plots.forces import forces_figure
from pteron.plots.jacobian import regularity_figure
from pteron.plots.reach import reach_figure
from pteron.plots.robot import outline, robot_figure
from pteron.plots.svg import svg

__all__ = [
    "LEG_COLORS",
    "forces_figure",
    "outline",
    "reach_figure",
    "regularity_figure",
    "robot_figure",
    "svg",
]
