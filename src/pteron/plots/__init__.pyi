from pteron.plots.bode import bode_figure as bode_figure, poles_figure as poles_figure
from pteron.plots.calibration import (
    differences_figure as differences_figure,
    row_residuals_figure as row_residuals_figure,
    tool_errors_figure as tool_errors_figure,
)
from pteron.plots.certainty import (
    autocorrelation_figure as autocorrelation_figure,
    certainty_figure as certainty_figure,
    correlation_figure as correlation_figure,
    histogram_figure as histogram_figure,
)
from pteron.plots.comparison import (
    comparison_figure as comparison_figure,
    errors_figure as errors_figure,
    residual_speed_figure as residual_speed_figure,
    residual_time_figure as residual_time_figure,
)
from pteron.plots.drives import (
    Ability as Ability,
    force_speed_figure as force_speed_figure,
    power_figure as power_figure,
)
from pteron.plots.films import Film as Film, film as film
from pteron.plots.forces import forces_figure as forces_figure
from pteron.plots.front import front_figure as front_figure, fronts_figure as fronts_figure
from pteron.plots.index_maps import map_figure as map_figure
from pteron.plots.jacobian_maps import (
    condition_figure as condition_figure,
    singularities_figure as singularities_figure,
)
from pteron.plots.leg_curves import (
    LEG_COLORS as LEG_COLORS,
)
from pteron.plots.machine_drawing import grid_step as grid_step
from pteron.plots.machine_figures import (
    draw as draw,
    poses_figure as poses_figure,
    robot_figure as robot_figure,
)
from pteron.plots.map_films import map_film as map_film
from pteron.plots.printing import (
    WIDTHS as WIDTHS,
    resize as resize,
    save_figure as save_figure,
    svg as svg,
    svg_file as svg_file,
)
from pteron.plots.reach import measure_figure as measure_figure, reach_figure as reach_figure
from pteron.plots.row_figures import (
    operations_figure as operations_figure,
    parameters_figure as parameters_figure,
)
from pteron.plots.singular_orientations import regularity_figure as regularity_figure
from pteron.plots.tracking import tracking_figure as tracking_figure
from pteron.plots.trajectories import (
    joints_figure as joints_figure,
    trajectory_figure as trajectory_figure,
)
