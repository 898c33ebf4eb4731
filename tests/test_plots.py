"""Pictures: they show the numbers they are given, and their SVG is the same on every run."""

import itertools
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from mechanisms import CATALOG, CLIENTS, MECHANISMS, NIGHTLY, gated, random_machine
from mpl_toolkits.mplot3d.art3d import Line3D, Poly3DCollection
from PIL import Image
from scipy.spatial.transform import Rotation

import pteron
from pteron.motion import joint_guides, joint_points
from pteron.plots import (
    LEG_COLORS,
    WIDTHS,
    Ability,
    condition_figure,
    draw,
    force_speed_figure,
    forces_figure,
    front_figure,
    joints_figure,
    measure_figure,
    operations_figure,
    parameters_figure,
    poses_figure,
    power_figure,
    reach_figure,
    regularity_figure,
    resize,
    robot_figure,
    save_figure,
    singularities_figure,
    svg,
    svg_file,
    trajectory_figure,
)
from pteron.plots.canvas import PAPER, blank
from pteron.plots.space_axes import upright_rotation
from pteron.workspace import home_pose, reach_slice

IN_SPACE = ["tripteron", "quadrupteron turned", "delta", "random PRR 0", "par4", "delta-4"]
IN_A_PLANE = ["five-bar", "3-prr"]
MACHINES = {**CATALOG, **MECHANISMS}


def machine(name):
    robot = MACHINES[name]
    pose = pteron.random_poses(robot, 1, seed=2)[0]
    points, guides = joint_points(robot, pose), joint_guides(robot, pose)
    return robot_figure(points, guides, gravity=np.array(robot.gravity), angle="φ = 10°")


def reach(name):
    robot = MECHANISMS[name]
    center = pteron.random_poses(robot, 1, seed=2, type_i=0.8)[0]
    path = np.linspace(center[:3], center[:3] + 0.05, 9)
    return reach_figure(reach_slice(robot, center, points=31), path=path)


def measure(name):
    robot = MECHANISMS[name]
    cut = reach_slice(robot, home_pose(robot), "xz", points=31)
    x, z = np.meshgrid(cut.first, cut.second)
    values = np.where(cut.status < 1, 0.5 + 0.4 * np.cos(x + z), np.nan)
    return measure_figure(cut, values, path=np.zeros((3, 3)))


def forces(name):
    n = MECHANISMS[name].freedom
    time = np.linspace(0.0, 1.0, 50)
    return forces_figure(time, np.sin(np.outer(time, np.arange(1, n + 1))), turning_point=0.5)


def regularity():
    angles = np.linspace(-np.pi, np.pi, 91)
    singular = np.array([-np.pi / 2, np.pi / 2])
    return regularity_figure(angles, np.cos(angles), singular, home=0.1, used=(-0.4, 0.4))


def drives(units=("N", "N", "N m")):
    t = np.linspace(0.0, 2.0 * np.pi, 50)
    speeds, forces = np.sin(np.outer(t, [1, 2, 3])), 20.0 * np.cos(np.outer(t, [1, 2, 3]))
    return force_speed_figure(
        speeds,
        forces,
        units=[("m/s" if unit == "N" else "rad/s", unit) for unit in units],
        abilities=[Ability(1.2, 30.0, 15.0), Ability(None, 500.0, None), Ability(None, None, None)],
        rms=(np.full(3, 0.7), np.full(3, 14.0)),
    )


def powers():
    t = np.linspace(0.0, 1.0, 50)
    return power_figure(t, np.sin(np.outer(t, [1, 2, 3])))


def courses():
    t = np.linspace(0.0, 1.0, 9)
    wave = np.sin(np.outer(t, [1, 2, 3, 4]))
    return trajectory_figure(t, wave, 2.0 * wave, names=("x", "y", "z", "phi"))


def values():
    found, drawn = np.array([1.0, 2.0, 0.1]), np.array([1.0, 2.6, 0.2])
    return parameters_figure(
        ["m_1", "m_2", "mgx_1"],
        found,
        intervals=[0.1, 0.5, np.nan],
        units=["kg", "kg", "kg m"],
        reference=drawn,
    )


PICTURES = {
    "machine": (machine, "quadrupteron turned"),
    "plane": (machine, "3-rrr"),
    "reach": (reach, "quadrupteron"),
    "measure": (measure, "delta"),
    "forces": (forces, "tripteron"),
    "regularity": (regularity,),
    "drives": (drives,),
    "powers": (powers,),
    "courses": (courses,),
    "values": (values,),
    "operations": (lambda: operations_figure(["all", "base"], [809, 675]),),
}


DRAWN = gated(PICTURES, ["machine", "measure", "drives", "values", "operations"])


@pytest.mark.parametrize("picture", DRAWN)
def test_svg_is_the_same_each_time_and_refers_to_nothing(picture):
    make, *arguments = PICTURES[picture]
    figure = make(*arguments)
    assert isinstance(figure, Figure)
    first = svg(figure, name="one", title="What <it> is")
    assert svg(make(*arguments), name="one", title="What <it> is") == first
    root = ElementTree.fromstring(first.replace("xlink:href", "href"))
    assert root.tag == "svg"
    assert root.find("title").text == "What <it> is"
    names = [element.get("id") for element in root.iter() if element.get("id")]
    assert len(set(names)) == len(names)
    assert all(name.startswith("one-") for name in names)
    for target in re.findall(r'href="([^"]*)"', first) + re.findall(r"url\(([^)]*)\)", first):
        assert target.startswith("#one-")
        assert target[1:] in names
    for word in ("http", "src=", "<metadata", "<?xml", "<!", "Date"):
        assert word not in first


def test_pictures_with_other_names_share_no_identifier():
    first, second = (
        set(re.findall(r'id="([^"]*)"', svg(regularity(), name=n, title=""))) for n in "ab"
    )
    assert first
    assert not first & second


class Counted(Line2D):
    """A line that counts how often it is drawn."""

    times = 0

    def draw(self, renderer):
        Counted.times += 1
        super().draw(renderer)


def test_an_svg_is_drawn_once_and_laid_out_as_matplotlib_does():
    def picture(kind):
        figure = kind(figsize=(3.0, 2.0), layout="constrained")
        axes = figure.add_subplot(xlabel="time (s)", ylabel="a long label\nof two lines")
        axes.plot([0.0, 1.0], [0.0, 1e6])
        return figure, axes

    figure, axes = picture(type(blank(1.0, 1.0)))
    axes.add_line(Counted([0.0, 1.0], [1e6, 0.0]))
    Counted.times = 0
    svg_file(figure)
    assert Counted.times == 1
    plain, same = picture(Figure)
    plain.savefig(BytesIO(), format="svg")
    np.testing.assert_array_equal(axes.get_position().bounds, same.get_position().bounds)


@CLIENTS
def test_pictures_need_no_pyplot():
    script = "import sys, pteron.plots; print('matplotlib.pyplot' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\n"


def lines(figure):
    """Return the points of the lines, m, and their colours."""
    axes = figure.axes[0]
    if axes.name == "3d":
        found = [a for a in axes.get_children() if isinstance(a, Line3D)]
        return [(np.array(a.get_data_3d()).T, a.get_color()) for a in found]
    return [(1e-3 * np.array(a.get_data()).T, a.get_color()) for a in axes.lines]


@pytest.mark.parametrize("name", IN_SPACE + IN_A_PLANE)
def test_the_drawn_links_have_their_lengths_and_their_legs_colour(name):
    robot = MACHINES[name]
    drawn = lines(machine(name))
    for leg, color in zip(robot.legs, LEG_COLORS, strict=False):
        own = [points for points, c in drawn if c == color and len(points) == 2]
        lengths = [np.linalg.norm(points[1] - points[0]) for points in own]
        known = [q.value[0] for q in leg.quantities if q.role == "length"]
        if leg.bar is not None:  # two rods, and the bars between their ends
            *known, rod = known
            assert lengths[-2] == pytest.approx(lengths[-1])
            known = [*known, rod, rod, *lengths[-2:]]
            one, other = (np.diff(points, axis=0) for points in own[-4:-2])
            np.testing.assert_allclose(one, other, atol=1e-15)
        if known:  # a shaft has no length
            np.testing.assert_allclose(lengths, known, rtol=1e-12)
        if len(known) == 2:  # both meet in the elbow
            np.testing.assert_allclose(own[0][1], own[1][0], atol=1e-15)


@pytest.mark.parametrize("name", IN_A_PLANE)
def test_a_planar_machine_is_drawn_in_its_plane(name):
    axes = machine(name).axes[0]
    assert axes.name == "rectilinear"
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (mm)", "y (mm)")
    turned = Rotation.random(rng=4).as_matrix()
    robot = MACHINES[name]
    pose = pteron.random_poses(robot, 1, seed=2)[0]
    other = pteron.turned(replace(robot, gravity=(0.0, -9.81, 0.0)), turned)
    points, guides = joint_points(other, pose), joint_guides(other, pose)
    found = robot_figure(points, guides, gravity=np.array(other.gravity))
    # The plane's own axes are the picture's, wherever the plane is in space; gravity points down.
    for (mine, _), (theirs, _) in zip(lines(machine(name)), lines(found), strict=False):
        np.testing.assert_allclose(mine, theirs, atol=1e-12)
    words = [text.get_text() for text in found.axes[0].texts]
    assert "g" in words
    assert "g" not in [text.get_text() for text in axes.texts], "along the normal"


@pytest.mark.parametrize(("name", "drawn"), [("h4", True), ("delta", False)])
def test_the_tool_is_drawn_where_it_is_not_at_p(name, drawn):
    robot = CATALOG[name]
    pose = pteron.random_poses(robot, 1, seed=2)[0]
    points = joint_points(robot, pose)
    way = np.array([points.reference, points.tool])
    found = lines(robot_figure(points, joint_guides(robot, pose)))
    assert any(line.shape == way.shape and np.array_equal(line, way) for line, _ in found) == drawn


@pytest.mark.parametrize("name", IN_SPACE)
def test_the_drawn_machine_is_not_distorted(name):
    figure = machine(name)
    axes = figure.axes[0]
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    aspect = np.asarray(axes._box_aspect)
    ratio = np.ptp(limits, axis=1) / aspect
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
    texts = [text.get_text() for text in axes.texts]
    n = MACHINES[name].freedom
    assert [text for text in texts if text.isdigit()] == [str(i + 1) for i in range(n)]
    assert {"x", "y", "z", "g"} < set(texts)
    sliders = sum(leg.joint.noun == "slider" for leg in MACHINES[name].legs)
    assert sum(isinstance(a, Poly3DCollection) for a in axes.get_children()) > sliders


def test_gravity_points_down_in_the_picture():
    for seed in range(5):
        robot = random_machine(seed, "PPPP")
        gravity = np.array(robot.gravity)
        rotation = upright_rotation(-gravity)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        np.testing.assert_allclose(
            rotation @ gravity, [0.0, 0.0, -np.linalg.norm(gravity)], atol=1e-14
        )
    np.testing.assert_allclose(upright_rotation(np.array([0.0, 0.0, 2.0])), np.eye(3), atol=1e-15)


def test_forces_are_drawn_as_given():
    time = np.linspace(0.0, 2.0, 30)
    values = np.random.default_rng(0).normal(size=(30, 4))
    axes = forces_figure(time, values).axes[0]
    curves = [line for line in axes.lines if len(line.get_xdata()) == 30]
    assert [curve.get_color() for curve in curves] == list(LEG_COLORS[:4])
    for curve, force in zip(curves, values.T, strict=True):
        np.testing.assert_array_equal(curve.get_xdata(), time)
        np.testing.assert_array_equal(curve.get_ydata(), force)
    assert len({str(curve.get_linestyle()) + str(curve._dash_pattern) for curve in curves}) == 4
    assert "N" in axes.get_ylabel()
    assert "s" in axes.get_xlabel()


def test_plain_lists_serve_and_what_does_not_fit_is_told():
    three = [[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]]
    for make in (forces_figure, power_figure):
        assert len(make([0.0, 1.0], three).legends[0].get_texts()) >= 3
        with pytest.raises(pteron.DataError, match=r"shape \(2, 3\) given, \(3, (n|3)\) expected"):
            make([0.0, 1.0, 2.0], three)
        with pytest.raises(pteron.DataError, match="numbers"):
            make([0.0, 1.0], [["a", "b"], ["c", "d"]])
    with pytest.raises(pteron.DataError, match=r"shape \(2, 3\) given, \(2, 4\) expected"):
        forces_figure([0.0, 1.0], three, robot="quadrupteron")
    with pytest.raises(pteron.DataError, match="a column for each leg"):
        forces_figure([0.0, 1.0], 3.0)


def test_singular_orientations_are_marked():
    figure = regularity()
    axes = figure.axes[0]
    words = [text.get_text() for text in axes.texts]
    assert [word for word in words if "singular" in word] == [
        "singular, \u221290.0°",
        "singular, 90.0°",
    ]
    near = regularity_figure(np.linspace(-3.0, 3.0, 9), np.ones(9), np.radians([-60, 20, 30]))
    marks = [text for text in near.axes[0].texts if "°" in text.get_text()]
    assert [mark.get_text() for mark in marks] == ["\u221260°", "20°", "30°"]
    assert marks[1].xyann != marks[2].xyann, "neighbours stand in two rows"
    curve = max(axes.lines, key=lambda line: len(line.get_xdata()))
    assert curve.get_ydata().min() >= 0.0
    np.testing.assert_allclose(
        curve.get_ydata(), np.abs(np.cos(np.radians(curve.get_xdata()))), atol=1e-12
    )


@pytest.mark.parametrize(
    ("name", "plane"),
    [
        ("delta-4", "xz"),
        pytest.param("h4", "yz", marks=NIGHTLY),
        pytest.param("quadrupteron", "xy", marks=NIGHTLY),
        ("3-rrr", "xy"),
    ],
)
def test_a_map_of_the_reach_has_no_gaps(name, plane):
    robot = CATALOG[name]
    cut = reach_slice(robot, home_pose(robot), plane)
    figure = reach_figure(cut)
    figure.canvas.draw()
    axes, picture = figure.axes[0], np.asarray(figure.canvas.buffer_rgba())[::-1].astype(int)
    box = axes.get_window_extent()
    rows, columns = (
        np.arange(int(low) + 3, int(high) - 2) for low, high in (box.intervaly, box.intervalx)
    )
    red, green, blue, _ = np.moveaxis(picture[np.ix_(rows, columns)], -1, 0)
    # The home pose's dot has a white rim.
    i, j = ("xyz".index(letter) for letter in plane)
    x, y = axes.transData.transform(1e3 * cut.center[[i, j]])
    away = np.hypot(columns - x, rows[:, None] - y) > 10.0
    white = np.array([int(PAPER[k : k + 2], 16) for k in (1, 3, 5)]).sum()
    assert (white - red - green - blue)[away].min() > 10


def test_a_thread_of_reach_leaves_no_dots():
    robot = CATALOG["3-rrr"]
    # Through the tip of a cusp of the reach, which is thinner than the grid.
    extent = (-0.145, 0.108, -0.134, 0.142)
    cut = reach_slice(robot, [0.0, 0.0, 0.0], extent=extent, points=121)
    lines = measure_figure(cut, np.where(cut.status == 0, 0.5, np.nan)).axes[0].collections
    (rims,) = [line.get_paths()[0].to_polygons(closed_only=False) for line in lines[-1:]]
    assert rims
    assert min(np.ptp(rim, axis=0).max() for rim in rims) > 20.0


def test_a_map_keeps_its_aspect():
    for figure, plane in ((reach("quadrupteron"), "xy"), (measure("delta"), "xz")):
        axes = figure.axes[0]
        assert axes.get_aspect() == 1.0
        assert axes.get_xlabel() == f"{plane[0]} (mm)"
        assert axes.get_ylabel() == f"{plane[1]} (mm)"


def test_legs_of_other_units_have_axes_of_their_own_and_far_limits_are_left_out():
    upper, lower = drives().axes
    assert upper.get_ylabel() == "force (N)"
    assert lower.get_ylabel() == "torque (N m)"
    # 500 N would make what is used, 20 N, small; 30 N is in sight.
    assert 30.0 < upper.get_ylim()[1] < 60.0
    boxed = [line.get_ydata() for line in upper.lines if line.get_color() == LEG_COLORS[0]]
    assert {30.0, -30.0, 15.0, -15.0} <= {float(y[0]) for y in boxed if len(set(y)) == 1}


def test_the_power_of_all_is_the_sum():
    total, *legs = powers().axes[0].lines[1:]
    np.testing.assert_allclose(total.get_ydata(), sum(leg.get_ydata() for leg in legs))


def test_a_picture_in_a_file_of_its_own_is_whole():
    text = svg_file(powers())
    root = ElementTree.fromstring(text)
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert svg_file(powers()) == text
    assert "<metadata" not in text
    assert re.search(r"<path d=[^>]*fill: #ffffff", text.replace("\n", " ")), "on white"


def test_draw_is_the_picture_of_a_robot_in_a_pose():
    robot = CATALOG["five-bar"]
    home = home_pose(robot)
    guides = joint_guides(robot, home)
    expected = svg_file(robot_figure(joint_points(robot, home), guides, gravity=robot.gravity))
    assert svg_file(draw(robot)) == svg_file(draw(robot, [home])) == expected
    way = draw(robot, home, along=[home, np.add(home, [0.0, 0.01])])
    np.testing.assert_allclose(lines(way)[-1][0], [home, np.add(home, [0.0, 0.01])], atol=1e-12)
    with pytest.raises(pteron.DataError, match="2 given, 1 expected; poses_figure"):
        draw(robot, [home, home])
    with pytest.raises(pteron.UnreachablePose, match="leg 1"):
        draw(robot, np.add(home, [1.0, 0.0]))


def test_several_poses_are_seen_from_one_place():
    robot = CATALOG["delta"]
    home = home_pose(robot)
    poses = np.add(home, [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.05]])
    figure = poses_figure(robot, poses, titles=["a", "b", "c"], columns=2, along=poses)
    views = {(axes.get_xlim(), axes.get_ylim(), axes.get_zlim()) for axes in figure.axes}
    assert len(views) == 1
    assert [text.get_text() for text in figure.texts] == ["a", "b", "c"]
    modes = pteron.working_modes(CATALOG["five-bar"])
    flat = poses_figure(modes, home_pose(modes[0]))
    assert len(flat.axes) == len(modes)
    assert len({axes.get_xlim() + axes.get_ylim() for axes in flat.axes}) == 1
    for arguments, options in (
        ((robot, poses), {"titles": ["a"]}),
        ((robot, poses), {"columns": 0}),
        (([robot, robot], poses), {}),
        (([], poses), {}),
        ((robot, poses[:, :2]), {}),
    ):
        with pytest.raises(pteron.DataError, match="given"):
            poses_figure(*arguments, **options)


def test_every_chosen_design_of_a_front_has_a_mark():
    chosen = {f"design {k}": k for k in range(7)}
    figure = front_figure(np.eye(7)[:, :2], ["a", "b"], ["m", ""], chosen=chosen)
    told = [text.get_text() for text in figure.legends[0].get_texts()]
    assert told == ["designs of the front", *chosen]


def test_courses_stand_over_their_derivatives_and_units_beside_each_other():
    axes = courses().axes
    assert [one.get_ylabel() for one in axes] == [
        *("pose (m)", "pose (rad)", "velocity (m/s)", "velocity (rad/s)"),
    ]
    mixed = MACHINES["random RPP 0"]
    t = np.linspace(0.0, 1.0, 5)
    wave = np.outer(t, [1.0, 2.0, 3.0])
    found = joints_figure(t, wave, robot=mixed).axes
    assert [one.get_ylabel() for one in found] == ["joint (rad)", "joint (m)"]
    np.testing.assert_array_equal(found[1].lines[-1].get_ydata(), wave[:, 2])
    forces = forces_figure(t, wave, robot=mixed).axes
    assert [one.get_ylabel() for one in forces] == ["actuator torque (N m)", "actuator force (N)"]
    with pytest.raises(pteron.DataError, match=r"velocity: shape \(5, 2\) given, \(5, 3\)"):
        trajectory_figure(t, wave, wave[:, :2], names=("x", "y", "z"))
    with pytest.raises(pteron.DataError, match="0 courses given"):
        joints_figure(t, robot=mixed)


def test_a_value_whose_interval_misses_its_reference_is_red():
    upper, lower = values().axes
    red = to_rgba("#b3261e")
    marks = [line for line in upper.lines if line.get_marker() == "o"]
    found = {line.get_xdata()[0]: to_rgba(line.get_markerfacecolor()) == red for line in marks}
    assert (found[1.0], found[2.0]) == (False, True)
    assert (upper.get_xlabel(), lower.get_xlabel()) == ("kg", "kg m")
    with pytest.raises(pteron.DataError, match=r"intervals: shape \(2,\) given, \(1,\)"):
        parameters_figure(["m"], [1.0], intervals=[1.0, 2.0])


def test_singularities_are_drawn_where_the_determinant_is_zero():
    robot = CATALOG["quadrupteron"]
    x, phi = np.linspace(-0.05, 0.05, 9), np.linspace(-3.0, 3.0, 601)
    poses = np.zeros((len(phi), len(x), 4))
    poses[..., 0], poses[..., 3] = np.meshgrid(x, phi)
    jacobians = pteron.jacobian(robot, poses, on_failure="nan")
    axes = singularities_figure(x, phi, np.linalg.det(jacobians), names=("x", "phi")).axes[0]
    inked = [c for c in axes.collections if len(c.get_edgecolor())]
    (red,) = [c for c in inked if np.allclose(c.get_edgecolor(), to_rgba("#b3261e"))]
    drawn = np.vstack([path.vertices for path in red.get_paths()])
    expected = np.degrees(pteron.kinematics.singular_orientations(robot))
    near = np.abs(drawn[:, 1, None] - expected).min(axis=1)
    assert near.max() < 0.1
    assert set(np.abs(drawn[:, 1, None] - expected).argmin(axis=1)) == {0, 1}


def test_a_condition_number_has_its_named_levels_where_it_takes_them():
    x, y = np.linspace(-0.1, 0.1, 201), np.linspace(-0.2, 0.2, 401)
    values = 1.0 + 100.0 * np.hypot(*np.meshgrid(x, y))
    values[:, 0] = np.inf
    axes = condition_figure(x, y, values).axes[0]
    assert {text.get_text() for text in axes.texts} <= {"1.5", "2", "3", "5", "10"}
    line = next(c for c in axes.collections if len(c.get_paths()) == 5)
    assert set(np.round(line.levels, 1)) == {1.5, 2.0, 3.0, 5.0, 10.0}
    for level, path in zip(line.levels, line.get_paths(), strict=True):
        np.testing.assert_allclose(np.hypot(*path.vertices.T), 10.0 * (level - 1.0), atol=0.1)
    with pytest.raises(pteron.DataError, match=r"shape \(3, 2\) given, \(401, 201\)"):
        condition_figure(x, y, np.ones((3, 2)))
    with pytest.raises(pteron.DataError, match="ascend"):
        condition_figure(x[::-1], y, values)


@pytest.mark.parametrize("picture", DRAWN)
def test_in_print_letters_are_legible_and_all_is_on_the_paper(picture):
    make, *arguments = PICTURES[picture]
    figure = resize(make(*arguments), "column")
    assert figure.get_size_inches()[0] == WIDTHS["column"]
    figure.canvas.draw()
    words = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert min(text.get_fontsize() for text in words) >= 6.0
    picture = np.asarray(figure.canvas.buffer_rgba())
    for edge in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
        assert edge.min() > 250, "something is cut"


@CLIENTS
def test_a_saved_figure_keeps_its_text_and_is_the_same_each_time(tmp_path):
    first = {}
    for ending in ("svg", "pdf", "png"):
        for name in "ab":
            path = save_figure(powers(), tmp_path / f"{name}.{ending}", width="column")
            first.setdefault(ending, path.read_bytes())
            assert path.read_bytes() == first[ending]
    assert b"power (W)</text>" in first["svg"]
    assert b"FontFile2" in first["pdf"], "letters, not drawings of them"
    with Image.open(tmp_path / "a.png") as image:
        assert image.size[0] == 300 * WIDTHS["column"]
        assert image.convert("RGBA").getpixel((0, 0)) == (255, 255, 255, 255)
    for path, words in (
        ("a.jpg", ".jpg ending, .svg, .pdf, .png expected"),
        ("no/a.svg", "cannot be written"),
    ):
        with pytest.raises(pteron.OutputError, match=words):
            save_figure(powers(), tmp_path / path)
    for width in ("colum", 0.0, -1, float("nan"), None):
        with pytest.raises(pteron.DataError, match=r'"column".* "page"'):
            resize(powers(), width)


def test_every_figure_is_in_the_page_about_them():
    page = (Path(__file__).parent.parent / "docs" / "plots.md").read_text()
    figures = [name for name in pteron.plots.__all__ if name.endswith("_figure")]
    assert len(figures) > 20
    assert [name for name in (*figures, "draw", "film", "resize") if name not in page] == []


def titled(title):
    """Return a figure with a title, and a legend that is laid out before it is drawn."""
    figure = power_figure(np.linspace(0.0, 1.0, 5), np.ones((5, 3)))
    figure.suptitle(title)
    figure.axes[0].plot([0.0], [1.0], label=title)
    return figure


@pytest.mark.parametrize("width", gated([None, "column"], ["column"]))
def test_letters_that_another_font_has_are_drawn_in_it(tmp_path, width):
    plain, other = (titled(text) for text in ("Aa", "\N{MATHEMATICAL SCRIPT CAPITAL A}a"))
    for ending in ("png", "pdf", "svg"):
        save_figure(other, tmp_path / f"a.{ending}", width=width)  # warnings are errors
    assert len(other.findobj(Text)) > len([t for t in other.findobj(Text) if lone(t)])
    assert all(lone(text) for text in plain.findobj(Text))


def lone(text):
    """Say whether a text has one font."""
    return len(text.get_fontfamily()) == 1


@CLIENTS
@pytest.mark.parametrize("width", gated([None, "column"], ["column"]))
def test_letters_that_no_font_has_are_told_once(tmp_path, width):
    letters = "".join(map(chr, range(0xF0000, 0xF0020)))  # for private use, and used by nobody
    for ending in ("png", "pdf"):
        with pytest.warns(UserWarning, match="boxes stand for them") as told:
            save_figure(titled(f"a {letters}"), tmp_path / f"a.{ending}", width=width)
        assert len(told) == 1
        assert "\n" not in str(told[0].message)
        assert len(str(told[0].message)) < 260
    save_figure(titled(letters), tmp_path / "a.svg", width=width)
    assert letters in (tmp_path / "a.svg").read_text()


@pytest.mark.parametrize(("scale", "unit"), [(1e-12, "(10⁻¹² N)"), (1.0, "(N)"), (1e9, "(10⁹ N)")])
def test_a_scale_has_short_numbers_and_curves_that_coincide_are_told(scale, unit):
    t = np.linspace(0.0, 1.0, 20)
    figure = pteron.plots.forces_figure(t, scale * np.stack([np.sin(t), np.cos(t), np.cos(t)], 1))
    text = pteron.plots.svg(figure, name="f", title="Forces")
    assert f"actuator force {unit}" in text
    assert "leg 3 (on 2)" in text
    lines = [line for line in figure.axes[0].lines if line.get_label().startswith("leg")]
    assert lines[1].get_linestyle() == lines[2].get_linestyle() == "--"


@pytest.mark.parametrize("values", [[1e-10, 3e-10], [2.0, 3.0], [10.0, 1e6], [0.0, np.nan]])
def test_numbers_of_a_logarithmic_scale_stand_apart(values):
    errors = np.array(values)
    figure = pteron.plots.errors_figure(errors, np.array([80.0, 90.0]), errors / 10.0)
    pteron.plots.svg(figure, name="e", title="Errors")
    figure.draw_without_rendering()
    labels = figure.axes[0].get_xticklabels()
    boxes = [label.get_window_extent() for label in labels if label.get_text()]
    assert all(one.x1 < other.x0 for one, other in itertools.pairwise(boxes))


@pytest.mark.parametrize("power", [1000.0 + 1e-9 * np.eye(4, 3), np.full((4, 3), np.nan)])
def test_what_is_constant_or_not_known_is_drawn(power):
    for rows in (4, 1):
        figure = pteron.plots.power_figure(np.arange(float(rows)), power[:rows])
        pteron.plots.svg(figure, name="p", title="Power")
        low, high = figure.axes[0].get_ylim()
        assert high - low > 0.01
