"""Pictures: each function takes arrays or results and returns a matplotlib Figure.

Physics is asked elsewhere; nothing here touches pyplot's global state.
"""

from pteron.plots.certainty import certainty_figure, correlation_figure
from pteron.plots.colors import LEG_COLORS
from pteron.plots.comparison import comparison_figure, errors_figure
from pteron.plots.forces import forces_figure
from pteron.plots.jacobian import regularity_figure
from pteron.plots.reach import reach_figure
from pteron.plots.residuals import (
    autocorrelation_figure,
    histogram_figure,
    residual_speed_figure,
    residual_time_figure,
)
from pteron.plots.robot import outline, robot_figure
from pteron.plots.svg import svg

__all__ = [
    "LEG_COLORS",
    "autocorrelation_figure",
    "certainty_figure",
    "comparison_figure",
    "correlation_figure",
    "errors_figure",
    "forces_figure",
    "histogram_figure",
    "outline",
    "reach_figure",
    "regularity_figure",
    "residual_speed_figure",
    "residual_time_figure",
    "robot_figure",
    "svg",
]
