"""Pictures: each function takes arrays or results and returns a matplotlib Figure.

Nothing here computes physics or touches pyplot's global state.
"""

from pteron.arguments import check_arguments
from pteron.plots.canvas import LEG_COLORS, svg, svg_file
from pteron.plots.certainty import (
    autocorrelation_figure,
    certainty_figure,
    correlation_figure,
    histogram_figure,
)
from pteron.plots.comparison import (
    comparison_figure,
    errors_figure,
    residual_speed_figure,
    residual_time_figure,
)
from pteron.plots.drives import Ability, force_speed_figure, power_figure
from pteron.plots.films import Film, film
from pteron.plots.forces import forces_figure, regularity_figure
from pteron.plots.front import front_figure
from pteron.plots.index_maps import map_figure
from pteron.plots.jacobian_maps import condition_figure, singularities_figure
from pteron.plots.machine_drawing import grid_step
from pteron.plots.machine_figures import draw, poses_figure, robot_figure
from pteron.plots.map_films import map_film
from pteron.plots.printing import WIDTHS, resized, save_figure
from pteron.plots.reach import measure_figure, reach_figure
from pteron.plots.row_figures import operations_figure, parameters_figure
from pteron.plots.tracking import tracking_figure
from pteron.plots.trajectories import joints_figure, trajectory_figure

__all__ = [
    "Ability",
    "Film",
    "LEG_COLORS",
    "WIDTHS",
    "autocorrelation_figure",
    "certainty_figure",
    "comparison_figure",
    "condition_figure",
    "correlation_figure",
    "draw",
    "errors_figure",
    "film",
    "force_speed_figure",
    "forces_figure",
    "front_figure",
    "grid_step",
    "histogram_figure",
    "joints_figure",
    "map_figure",
    "map_film",
    "measure_figure",
    "operations_figure",
    "parameters_figure",
    "poses_figure",
    "power_figure",
    "reach_figure",
    "regularity_figure",
    "resized",
    "residual_speed_figure",
    "residual_time_figure",
    "robot_figure",
    "save_figure",
    "singularities_figure",
    "svg",
    "tracking_figure",
    "trajectory_figure",
    "svg_file",
]
check_arguments(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
