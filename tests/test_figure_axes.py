"""Every figure function draws on axes of another figure, `ax=`, and leaves the others alone."""

import inspect
import warnings

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import pteron
from pteron import plots
from pteron.maps import map_index, pose_grid
from pteron.motion import joint_guides, joint_points
from pteron.workspace import home_pose, reach_slice

T = np.linspace(0.0, 1.0, 40)
WAVES = np.sin(np.outer(T, [3.0, 6.0, 9.0, 12.0]))
USED = np.ones(40, dtype=bool)
ANGLES = np.linspace(-np.pi, np.pi, 91)
GRID_SIDES = np.linspace(-0.1, 0.1, 7), np.linspace(-0.1, 0.1, 5)


def five_bar_map(*names):
    grid = pose_grid("five-bar", {}, points=9)
    return map_index("five-bar", names, grid)


def slice_of_a_delta():
    robot = pteron.load("delta")
    return reach_slice(robot, home_pose(robot), "xz", points=31)


def measures():
    cut = slice_of_a_delta()
    return cut, np.where(cut.status < 1, 0.5, np.nan)


def points_and_guides(name):
    robot = pteron.load(name)
    pose = home_pose(robot)
    return joint_points(robot, pose), joint_guides(robot, pose)


MEASURED = np.ones(20, dtype=bool)
ARGUMENTS = {
    "autocorrelation_figure": lambda: (np.exp(-np.outer(np.arange(20), [0.1, 1.0])), np.ones(2)),
    "bode_figure": lambda: (
        np.logspace(0, 3, 40),
        1.0 / (1.0 + 1j * np.logspace(0, 3, 40))[:, None],
    ),
    "certainty_figure": lambda: (["m_1", "m_2"], np.array([30.0, 2.0]), np.array([False, True]), 2),
    "comparison_figure": lambda: (T, WAVES[:, 0], WAVES[:, 1], WAVES[:, 2], USED),
    "condition_figure": lambda: (*GRID_SIDES, 2.0 + np.add.outer(*GRID_SIDES[::-1])),
    "correlation_figure": lambda: (["m_1", "m_2"], np.array([[1.0, 0.3], [0.3, 1.0]])),
    "differences_figure": lambda: ("linear-delta", pteron.load("linear-delta")),
    "draw": lambda: ("delta",),
    "errors_figure": lambda: (np.array([3.0, 4.0]), np.array([30.0, 20.0]), np.array([1.0, 2.0])),
    "force_speed_figure": lambda: (WAVES, WAVES[:, ::-1]),
    "forces_figure": lambda: (T, WAVES),
    "front_figure": lambda: (np.eye(5)[:, :3], ["a", "b", "c"], ["m", "", "N"]),
    "fronts_figure": lambda: (
        {"delta": np.eye(5)[:, :2], "par4": np.eye(4)[:, :2]},
        ["a", "b"],
        ["", ""],
    ),
    "histogram_figure": lambda: (np.sin(np.arange(500.0)).reshape(-1, 2),),
    "joints_figure": lambda: (T, WAVES, WAVES),
    "map_figure": lambda: (five_bar_map("condition"), "condition"),
    "measure_figure": measures,
    "operations_figure": lambda: (["all", "base"], [809, 675]),
    "parameters_figure": lambda: (["m_1", "m_2"], [1.0, 2.0]),
    "poles_figure": lambda: ([0.5 + 0.1j, 0.2],),
    "poses_figure": lambda: ("five-bar", [home_pose("five-bar")] * 2),
    "power_figure": lambda: (T, WAVES),
    "reach_figure": lambda: (slice_of_a_delta(),),
    "regularity_figure": lambda: (ANGLES, np.cos(ANGLES), np.array([-np.pi / 2, np.pi / 2])),
    "residual_speed_figure": lambda: (WAVES[:, 0], WAVES[:, 1], USED),
    "residual_time_figure": lambda: (T, WAVES, np.ones((40, 4), dtype=bool)),
    "robot_figure": lambda: points_and_guides("five-bar"),
    "row_residuals_figure": lambda: (
        np.zeros((20, 1)),
        ["heights"],
        MEASURED[:, None],
        MEASURED,
        {"heights": 1e-5},
    ),
    "singularities_figure": lambda: (*GRID_SIDES, np.add.outer(*GRID_SIDES[::-1])),
    "tool_errors_figure": lambda: ("five-bar", np.zeros((3, 3)), np.full((3, 3), 1e-4)),
    "tracking_figure": lambda: (T, 1e-4 * WAVES[:, :3], ("x", "y", "z")),
    "trajectory_figure": lambda: (T, WAVES, WAVES),
}
NAMED = {
    "comparison_figure": {"leg": 1},
    "residual_speed_figure": {"leg": 1},
    "trajectory_figure": {"names": ("x", "y", "z", "phi")},
}
ONE_PANEL = {
    "autocorrelation_figure", "condition_figure", "correlation_figure", "errors_figure",
    "forces_figure", "fronts_figure", "histogram_figure", "operations_figure",
    "parameters_figure", "poles_figure", "power_figure", "reach_figure", "regularity_figure",
    "robot_figure", "singularities_figure", "map_figure", "measure_figure",
}  # fmt: skip


def test_every_figure_function_is_tried():
    public = {name for name in plots.__all__ if name.endswith("_figure")} - {"save_figure"}
    assert public | {"draw"} == set(ARGUMENTS)
    for name in ARGUMENTS:
        parameter = inspect.signature(getattr(plots, name)).parameters["ax"]
        assert (parameter.kind, parameter.default) == (parameter.KEYWORD_ONLY, None)


@pytest.mark.parametrize("name", sorted(ARGUMENTS))
def test_a_picture_is_drawn_on_axes_of_another_figure(name):
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    right.plot([0.0, 1.0], [0.0, 1.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn = getattr(plots, name)(*ARGUMENTS[name](), **NAMED.get(name, {}), ax=left)
        figure.draw_without_rendering()
    assert drawn.get_figure(root=True) is figure
    own = [axes for axes in drawn.get_axes() if axes is not right]
    assert own
    if name in ONE_PANEL:
        assert left in figure.axes
    # All of it is on the left half, and what was on the right is as it was.
    boxes = [axes.get_tightbbox() for axes in own]
    assert max(box.x1 for box in boxes if box) < 0.58 * figure.bbox.width
    assert len(right.lines) == 1
    assert right in figure.axes
    assert not right.get_legend()


def test_three_dimensions_are_drawn_on_axes_of_three_or_of_two():
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    space = figure.add_subplot(1, 2, 1, projection="3d")
    flat = figure.add_subplot(1, 2, 2)
    plots.draw("delta", ax=space)
    plots.draw("delta", ax=flat)
    assert space in figure.axes
    assert flat not in figure.axes
    assert [axes.name for axes in figure.axes] == ["3d", "3d"]
    figure.draw_without_rendering()


def test_a_subfigure_takes_several_panels():
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    first, second = figure.subfigures(1, 2)
    assert plots.trajectory_figure(T, WAVES, names=("x", "y", "z", "phi"), ax=first) is first
    assert len(first.axes) == 2
    assert not second.axes
    for name in ("power_figure", "draw", "poses_figure", "map_figure"):
        page = Figure(figsize=(9.0, 4.5), layout="constrained")
        place, other = page.subfigures(1, 2)
        assert getattr(plots, name)(*ARGUMENTS[name](), ax=place) is place
        assert place.axes
        assert not other.axes
        page.draw_without_rendering()


def test_axes_without_a_grid_are_refused():
    axes = Figure().add_axes((0.1, 0.1, 0.8, 0.8))
    plots.power_figure(T, WAVES, ax=axes)
    with pytest.raises(pteron.DataError, match="ax: not in a grid; make it by subplots"):
        plots.joints_figure(T, WAVES, WAVES, ax=axes)


def test_figures_work_with_pyplots_axes():
    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots()
    try:
        assert plots.power_figure(T, WAVES, ax=axes) is figure
        assert axes.lines
    finally:
        pyplot.close(figure)
