"""What intervals prove: bounds, pavings, proofs, largest shapes, components, modes."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import lru_cache
from importlib.util import find_spec
from multiprocessing import get_context

import casadi as ca
import codac_bounds
import numpy as np
import pytest
from mechanisms import CATALOG, CLIENTS, MECHANISMS, gated, in_turn
from scipy.spatial.transform import Rotation

import pteron
from pteron.errors import DataError, ModelError
from pteron.kernels import TARGETS, Port, bounds, numeric
from pteron.kernels.bounds import UNBOUNDED, Bounded
from pteron.kernels.entries import TABLE
from pteron.kinematics import random_poses
from pteron.workspace import (
    Box,
    Cylinder,
    components,
    conditions,
    cube_bound,
    home_pose,
    largest_ball,
    largest_cube,
    largest_cylinder,
    largest_tilt,
    mode_contacts,
    mode_pavings,
    paving,
    prove,
    quadrature_volume,
    volumes_over_angles,
)
from pteron.workspace.conditions import keeps
from pteron.workspace.margins import distance_to_limits
from pteron.workspace.tilts import TiltedBall

MACHINES = {**CATALOG, **MECHANISMS}
SOME = ["quadrupteron-oblique", "delta", "3-rrr", "random 3T1R 0", "random PRR 0"]
EVERY = in_turn(SOME, SOME, share=2)
QUADRUPTERON = CATALOG["quadrupteron"]


@lru_cache
def middle(name):
    """Return a pose in reach."""
    return random_poses(MACHINES[name], 1, type_i=0.3, type_ii=0.0)[0]


@lru_cache
def paved(name, tolerance):
    return paving(MACHINES[name], middle(name), tolerance=tolerance)


def boxes_about(name, count=40):
    """Return boxes (count, 2, m) of widths from 0.1 mm to 0.1 m, and points (P, count, m) of them.

    Corners are among the points.
    """
    rng = np.random.default_rng(0)
    center = middle(name) + 0.1 * rng.normal(size=(count, len(middle(name))))
    half = 10.0 ** rng.uniform(-4.0, -1.0, (count, 1))
    low, high = center - half, center + half
    points = low + rng.uniform(size=(60, *low.shape)) * (high - low)
    return np.stack([low, high], axis=1), np.concatenate([points, [low, high]])


def x():
    return ca.SX.sym("x", 2)


def steinmetz(link):
    """Return a Tripteron whose legs reach three cylinders that cross at right angles."""
    legs = [
        replace(
            leg,
            direction=axis,
            slider_direction=axis,
            guide_point=(0.0, 0.0, 0.0),
            platform_point=(0.0, 0.0, 0.0),
            upper_length=link,
            lower_length=link,
            limits=None,
        )
        for leg, axis in zip(CATALOG["tripteron"].legs, np.eye(3), strict=True)
    ]
    return replace(CATALOG["tripteron"], legs=tuple(legs))


@pytest.fixture(scope="module")
def apart():
    """A process of its own, for what would change how this one rounds."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        yield pool


@pytest.mark.skipif(find_spec("codac") is None, reason="codac is not installed")
@pytest.mark.parametrize("name", codac_bounds.EXPRESSIONS)
def test_an_independent_interval_library_finds_the_same(name, apart):
    v = x()
    function = ca.Function("f", [v], [codac_bounds.EXPRESSIONS[name](ca, v[0], v[1])])
    kernel = TARGETS["intervals"]("f", function, (Port("x", (2,)),), (Port("y", ()),))
    rng = np.random.default_rng(1)
    low = rng.uniform(-2.0, 2.0, (50, 2))
    boxes = np.stack([low, low + 10.0 ** rng.uniform(-6.0, 0.0, (50, 1))], axis=1)
    found = kernel(boxes)
    assert found.defined.all()
    theirs = apart.submit(codac_bounds.natural, name, boxes.tolist()).result()
    mine = np.column_stack([found.low, found.high])
    np.testing.assert_allclose(mine, theirs, rtol=1e-13, atol=1e-13)


@EVERY
def test_bounds_hold_at_every_pose_of_a_box(name):
    robot = MACHINES[name]
    boxes, points = boxes_about(name)
    for what in ("room", "type_ii", "joint_coordinates"):
        (found,), values = bounds(robot, what, boxes).values(), numeric(robot, what)(points)[0]
        there = ~np.isnan(values)
        room = 1e-12 * (1.0 + np.abs(values[there]))
        low, high, defined = (
            np.broadcast_to(part, values.shape)[there]
            for part in (found.low, found.high, found.defined)
        )
        assert (low - room <= values[there]).all(), what
        assert (values[there] <= high + room).all(), what
        assert there[np.broadcast_to(found.defined, values.shape)].all(), what
        assert defined.any(), what


def with_elbow_limits(name):
    """Return a machine of the catalog whose elbows have limits that home keeps."""
    robot = CATALOG[name]
    legs = tuple(replace(leg, elbow_limits=(0.2, 2.9)) for leg in robot.legs)
    return replace(robot, name=f"{name} with elbow limits", legs=legs)


BOUNDED = {
    **{name: CATALOG[name] for name in ("delta", "par4", "3-rpr", "tripteron-oblique")},
    **{f"{n}, elbows": with_elbow_limits(n) for n in ("quadrupteron", "five-bar", "3-rrr")},
}


@pytest.mark.parametrize(
    "name", gated(BOUNDED, ["quadrupteron, elbows", "five-bar, elbows"], CLIENTS)
)
def test_every_function_of_the_pose_is_bounded(name):
    """Limits of elbows included, whose slopes have signs; but for functions of singular values."""
    robot, count = BOUNDED[name], 0
    home = home_pose(robot)
    box = np.array([home - 1e-5, home + 1e-5])
    poses = box[0] + np.random.default_rng(0).random((20, robot.freedom)) * (box[1] - box[0])
    for what in TABLE:
        try:
            function = pteron.compile(robot, what)
        except ModelError:  # the machine has no such function, or it is of base parameters
            continue
        if [port.name for port in function.inputs] != ["pose"]:
            continue
        names = [port.name for port in function.outputs]
        values = dict(zip(names, results(function(poses)), strict=True))
        for output, found in bounds(robot, what, box).items():
            there = np.isfinite(values[output])
            room = 1e-9 * (1.0 + np.abs(values[output][there]))
            low, high, defined = (
                np.broadcast_to(part, values[output].shape)[there]
                for part in (found.low, found.high, found.defined)
            )
            assert (low - room <= values[output][there]).all(), (what, output)
            assert (values[output][there] <= high + room).all(), (what, output)
            assert defined.all() or what in UNBOUNDED, (what, output)
            count += 1
    assert count > 20


def results(outputs):
    """Return a kernel's outputs as a tuple, also where it has one."""
    return outputs if isinstance(outputs, tuple) else (outputs,)


def test_bounds_come_as_near_as_the_square_of_the_width():
    v = x()
    function = Bounded(ca.Function("f", [v], [v[0] * v[1] - v[0] ** 3]), (Port("f", ()),))
    excess = []
    for half in (0.1, 0.01):
        low = np.array([[1.0 - half, 2.0 - half]])
        high = low + 2.0 * half
        least, most, _ = function(low, high, [0])
        grid = np.stack(np.meshgrid(*np.linspace(low[0], high[0], 101).T), axis=-1)
        values = grid[..., 0] * grid[..., 1] - grid[..., 0] ** 3
        excess.append(float(most[0, 0] - least[0, 0]) - np.ptp(values))
    assert 0.0 <= excess[1] <= 0.02 * excess[0]


def test_what_is_undefined_is_told():
    """A root and a quotient: in all of a box, in a part of it, nowhere; and a jump of the angle."""
    v = x()
    outputs = [
        ca.sqrt(v[0]),
        1.0 / v[0],
        ca.atan2(v[1], v[0]),
        ca.if_else(v[0] < 0, ca.SX.nan(), 0),
        ca.SX.nan(),
        ca.sqrt(v[0] * v[0] - v[1] * v[1]),
    ]
    function = ca.Function("f", [v], [ca.vertcat(*outputs)])
    kernel = TARGETS["intervals"]("f", function, (Port("x", (2,)),), (Port("y", (6,)),))
    found = kernel(
        [[[1.0, -1.0], [4.0, 1.0]], [[-1.0, -1.0], [4.0, 1.0]], [[-4.0, -1.0], [-1.0, 1.0]]]
    )
    assert found.defined[:, :5].tolist() == [
        [True, True, True, True, False],
        [False, False, True, False, False],
        [False, True, True, False, False],
    ]
    np.testing.assert_allclose(found.low[0, :4], [1.0, 0.25, -np.pi / 4, 0.0], atol=1e-14)
    np.testing.assert_allclose(found.low[1, :4], [0.0, -np.inf, -np.pi, 0.0], atol=1e-14)
    np.testing.assert_allclose(found.high[1, :4], [2.0, np.inf, np.pi, 0.0], atol=1e-14)
    assert np.isnan(found.low[2, [0, 3]]).all()
    assert np.isnan(found.low[:, 4]).all()
    huge = kernel([[1e200, 2e200], [1e200, 2e200]])  # inf - inf: nothing is known
    assert not huge.defined[5]
    with pytest.raises(DataError, match=r"^x: a box's least value is above its greatest"):
        kernel([[1.0, 0.0], [0.0, 0.0]])


def test_a_kernel_of_intervals_is_compiled_as_any_other():
    kernel = pteron.compile("delta", "room", "intervals")
    box = np.array([[0.0, 0.0, -0.95], [0.01, 0.01, -0.94]])
    found = kernel(box)
    value = pteron.compile("delta", "room")(box.mean(axis=0))
    assert (found.low <= value).all()
    assert (value <= found.high).all()
    with pytest.raises(ModelError, match="bounds are on functions of the pose"):
        bounds("delta", "joint_rates", box)
    endless = bounds("delta", "room", [[-np.inf] * 3, [np.inf] * 3])["room"]
    assert (endless.low <= found.low).all()


@EVERY
def test_conditions_say_what_reach_and_limits_say(name):
    robot, (_, points) = MACHINES[name], boxes_about(name)
    reached = np.minimum(numeric(robot, "reach")(points)[0], distance_to_limits(robot, points))
    serves = (reached >= 0.0).all(axis=-1)
    assert (keeps(robot, conditions(robot), points) == serves).all()
    assert 0.05 < serves.mean() < 0.95


@EVERY
def test_random_poses_agree_with_the_paving(name):
    found = paved(name, 0.3)
    low, high = found.box
    rng = np.random.default_rng(2)
    # Half of them where there is something to tell.
    about = np.concatenate([found.inner, found.boundary])
    least, most = low.copy(), high.copy()
    moving = [found.robot.coordinates.index(axis) for axis in found.axes]
    least[moving], most[moving] = about[:, 0].min(axis=0), about[:, 1].max(axis=0)
    poses = np.concatenate(
        [rng.uniform(a, b, (10_000, len(low))) for a, b in ((low, high), (least, most))]
    )
    where, serves = found.locate(poses), keeps(found.robot, found.conditions, poses)
    assert serves[where == 1].all()
    assert not serves[where == -1].any()
    assert (where == 1).mean() > 0.05
    assert found.complete
    assert found.gap <= 0.3
    volumes = (np.prod(b[:, 1] - b[:, 0], axis=1).sum() for b in (found.inner, found.boundary))
    np.testing.assert_allclose(np.cumsum([*volumes]), [found.inner_volume, found.outer_volume])


@CLIENTS
def test_volumes_enclose_the_quadrature_and_closed_forms():
    found = paving(QUADRUPTERON, np.zeros(4), tolerance=0.05)
    sum_ = quadrature_volume(QUADRUPTERON, np.zeros(4), lines=40)
    assert found.inner_volume <= sum_.volume <= found.outer_volume
    assert sum_.error < 0.02 * sum_.volume
    # Three crossing cylinders of radius r: 8 (2 - sqrt 2) r^3.
    three = paving(steinmetz(0.15), np.zeros(3), tolerance=0.1)
    assert three.inner_volume <= 8.0 * (2.0 - np.sqrt(2.0)) * 0.3**3 <= three.outer_volume
    # Sliders of 0.2 m are all that bounds the router: a cube.
    cube = paving("tripteron-router", np.full(3, 0.1), tolerance=0.1)
    assert cube.inner_volume <= 0.008 <= cube.outer_volume
    assert largest_cube("tripteron-router", np.full(3, 0.1)).edge <= 0.2 <= cube_bound(cube)


def test_a_turned_cube_may_exceed_the_bound_of_cubes_along_the_axes_by_root_three_at_most():
    robot = CATALOG["tripteron-router"]
    quarter = Rotation.from_euler("z", 45.0, degrees=True).as_matrix()
    turned = pteron.turned(robot, quarter)
    edge = largest_cube(robot, np.full(3, 0.1)).edge  # along the router's axes, turned with it
    found = paving(turned, quarter @ np.full(3, 0.1), tolerance=0.05)
    bound = cube_bound(found)
    assert 0.2 / np.sqrt(2.0) < bound < 0.9 * edge
    assert edge <= min(np.sqrt(3.0) * bound, np.cbrt(found.outer_volume))


def test_a_reach_without_end_is_refused_and_nowhere_is_proved():
    robot = CATALOG["linear-delta"]
    legs = tuple(replace(leg, limits=None) for leg in robot.legs)
    endless = replace(robot, legs=legs)
    with pytest.raises(ModelError, match="the reach has no end that is known"):
        paving(endless, [0.0, 0.0, 0.3])
    within = [[-0.1, -0.1, 0.2], [0.1, 0.1, 0.3]]
    assert paving(endless, [0.0, 0.0, 0.3], within=within, tolerance=0.5).complete
    far = [[1.0, 1.0, 1.0, 0.0], [1.1, 1.1, 1.1, 1.0]]
    none = paving(QUADRUPTERON, np.zeros(4), within=far)
    assert (none.outer_volume, none.unit, none.gap, none.complete) == (0.0, "m^3 rad", 0.0, True)
    for wrong in ({"tolerance": 0.0}, {"within": [[-np.inf] * 3, [1.0] * 3]}, {"given": ()}):
        with pytest.raises(DataError):
            paving(QUADRUPTERON, np.zeros(4), **wrong)


def test_the_boundary_names_legs_and_causes():
    found = paved("3-rrr", 0.3)
    ends = {str(c): found.boundary_of(c) for c in found.conditions}
    assert {name for name, boxes in ends.items() if len(boxes)} >= {
        *("leg 1: stretched", "leg 2: crank at its least", "leg 3: stretched"),
    }
    c = next(c for c in found.conditions if str(c) == "leg 1: stretched")
    low, high = found.corners(ends[str(c)])
    margin = numeric(found.robot, "reach")(0.5 * (low + high))[0]
    assert np.abs(margin[:, 0]).max() <= np.linalg.norm(high - low, axis=1).max()


def test_a_region_is_proved_or_a_pose_is_shown():
    cube = Box((-0.05, -0.05, -0.05, -0.4), (0.05, 0.05, 0.05, 0.4))
    # The type-II measure is a constant times cos(phi).
    most = abs(numeric(QUADRUPTERON, "type_ii")(np.zeros(4))[0])
    good = prove(QUADRUPTERON, cube, type_i=0.5, type_ii=most * np.cos(0.41))
    assert good.holds
    assert str(good).startswith("proved: every pose meets ")
    bad = prove(QUADRUPTERON, cube, type_ii=most * np.cos(0.39))
    assert bad.holds is False
    assert abs(bad.counterexample[3]) > 0.39
    assert [str(c) for c in bad.causes] == ["near type II"]
    wide = prove(QUADRUPTERON, Box.around([[0.0, 0.0, 0.0, 0.0], [0.0, 0.25, 0.0, 0.0]]))
    assert "stretched (it misses the pose by" in str(wide)
    assert not keeps(QUADRUPTERON, conditions(QUADRUPTERON), wide.counterexample)
    with pytest.raises(DataError, match="region: 3 coordinates given, x, y, z, phi expected"):
        prove(QUADRUPTERON, Box((0.0,) * 3, (0.0,) * 3))
    point = prove("3-rrr", Box((9.0, 0.0, 0.0), (9.0, 0.0, 0.0)))  # nothing of it varies
    assert point.counterexample.tolist() == [9.0, 0.0, 0.0]
    assert {c.cause for c in point.causes} == {"stretched"}


def test_a_region_that_touches_the_boundary_is_not_decided():
    # The router's sliders end at 0.1 m, to the last bit.
    found = prove("tripteron-router", Box((-0.05, -0.05, -0.05), (0.1, 0.05, 0.05)), most=200)
    assert found.holds is None
    assert found.undecided[1, 0] == 0.1
    assert [str(c) for c in found.causes] == ["leg 1: slider at its most"]
    assert "the region may touch the boundary" in str(found)


@CLIENTS
@pytest.mark.parametrize(
    ("attempt", "message"),
    [
        (lambda home: largest_tilt("stewart", home, radius=-0.5), "radius: -0.5 m given"),
        (lambda home: largest_tilt("stewart", home, radius=np.nan), "radius: nan m given"),
        (lambda home: largest_tilt("stewart", home, tolerance=0.0), "tolerance: 0.0 given"),
        (lambda home: largest_ball("stewart", home, tilt=-0.1), "tilt: -0.1 rad given"),
        (
            lambda home: largest_ball("stewart", home, tilt=0.1, tolerance=1.5),
            "tolerance: 1.5 given, a share above 0 and below 1 expected",
        ),
        (
            lambda home: TiltedBall(tuple(home), 9.0, -0.1, (0, 1, 2), (3, 4)),
            "tilt: -0.1 rad given",
        ),
        (lambda home: largest_cube("delta", home[:3], tolerance=-1.0), "tolerance: -1.0 given"),
        (lambda home: paving("five-bar", [0.0, 0.3], tolerance=np.nan), "tolerance: nan given"),
        (lambda home: prove("delta", NoPose()), "holds no pose"),
    ],
)
def test_a_proof_that_examines_nothing_is_refused(attempt, message):
    with pytest.raises(DataError, match=message):
        attempt(home_pose("stewart"))


class NoPose:
    """A region without a pose."""

    box = np.array([[0.0, 0.0, -0.9], [0.1, 0.1, -0.8]])

    def holds(self, poses):
        return np.zeros(poses.shape[:-1], dtype=bool)

    def misses(self, low, high):
        return np.ones(len(low), dtype=bool)


@pytest.mark.parametrize("name", ["wrist", "ankle", "sprint-z3", "five-bar", "3-rrr"])
def test_a_cylinder_is_refused_where_a_pose_has_not_three_lengths(name):
    home = home_pose(name)
    if len(home) == 3:  # a cylinder's middle has at least three numbers
        with pytest.raises(DataError, match="a cylinder is a set of places in x, y and z"):
            prove(name, Cylinder(tuple(home), 0.1, 0.1))
    with pytest.raises(DataError, match="a cylinder is a set of places in x, y and z"):
        largest_cylinder(name, home)


def test_cylinders_are_proved_too():
    found = largest_cylinder("tripteron-router", np.full(3, 0.1))
    assert found.proof.holds
    assert 0.19 < found.edge <= 0.2
    tilted = Cylinder((0.0, 0.0, 0.0, 0.0), 0.03, 0.1, (1.0, 1.0, 1.0))
    assert prove(QUADRUPTERON, tilted).holds
    with pytest.raises(DataError, match="a cylinder is a set of places in x, y and z"):
        prove("3-rrr", Cylinder((0.0, 0.0, 0.0), 0.1, 0.1))
    with pytest.raises(DataError, match="must be finite"):
        replace(tilted, radius=np.inf)
    wrong = prove(QUADRUPTERON, replace(tilted, height=0.6))
    assert tilted.holds(wrong.counterexample) or wrong.region.holds(wrong.counterexample)
    rng = np.random.default_rng(3)
    low = rng.uniform(-0.1, 0.1, (2000, 4)) * [1.0, 1.0, 1.0, 0.0]
    high = low + 0.02 * np.array([1.0, 1.0, 1.0, 0.0])
    points = low + rng.uniform(size=(50, 2000, 1)) * (high - low)
    assert not tilted.holds(points)[:, tilted.misses(low, high)].any()


@pytest.mark.parametrize("name", ["quadrupteron", "five-bar"])
def test_the_largest_cube_is_proved_and_no_neighbour_is_larger(name):
    robot = CATALOG[name]
    pose = np.zeros(4) if name == "quadrupteron" else middle(name)
    found = largest_cube(robot, pose)
    assert found.proof.holds
    lengths = len(robot.platform.lengths)
    grid = np.array(list(np.ndindex(*(9,) * lengths))) / 4.0 - 1.0
    rng = np.random.default_rng(4)
    for shift in 0.02 * found.edge * rng.normal(size=(30, lengths)):
        poses = np.repeat(found.center[None], len(grid), axis=0)
        poses[:, :lengths] += shift + 1.01 * found.size * grid
        assert not keeps(robot, conditions(robot), poses).all()


@CLIENTS
def test_parts_that_are_apart_are_told_and_how_modes_meet():
    pavings = mode_pavings("linear-delta", [0.0, 0.0, 0.3], tolerance=2.0)
    parts = {elbows: components(found, smallest=0.05) for elbows, found in pavings.items()}
    assert parts[1, 1, 1].connected
    whole = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    boxes = np.array([whole / 2.0 - 0.5, whole / 4.0 + 0.75])
    inside = replace(
        pavings[1, 1, 1], box=whole, inner=boxes, boundary=boxes[:0], inner_volume=1.125
    )
    for smallest, count in ((0.0, 2), (0.5, 1)):
        found = components(inside, smallest=smallest)
        assert (len(found.parts), found.groups, found.connected) == (count, count, False)
    two = parts[1, 1, -1]
    assert (two.groups, two.connected) == (2, False)
    assert keeps(pavings[1, 1, -1].robot, pavings[1, 1, -1].conditions, two.parts[1].pose)
    contacts = mode_contacts({key: pavings[key] for key in [(1, 1, 1), (1, 1, -1), (-1, -1, -1)]})
    (one,) = contacts
    assert (one.leg, one.cause, one.proved) == (3, "at the edge of its reach", True)
    assert abs(numeric("linear-delta", "reach")(one.pose)[0][2]) < 1e-9
    three = mode_contacts(mode_pavings("3-rrr", np.zeros(3), tolerance=0.3))
    assert {(c.pose is None, c.proved) for c in three} == {(True, True), (False, True)}


def test_volumes_over_angles_are_those_of_each_orientation():
    found = volumes_over_angles("3-prr", np.zeros(3), [0.0, 2.0], tolerance=0.3)
    one = paving("3-prr", np.zeros(3), tolerance=0.3)
    assert (found.inner[0, 0], found.outer[0, 0]) == (one.inner_volume, one.outer_volume)
    whole = paving(
        "3-prr", np.zeros(3), tolerance=0.8, within=[[-0.5, -0.5, -0.1], [0.5, 0.5, 0.1]]
    )
    assert whole.unit == "m^2 rad"
    assert whole.inner_volume < 0.2 * found.outer[0, 0] * 1.05
    assert components(whole).connected
    with pytest.raises(ModelError, match="the platform does not turn"):
        volumes_over_angles("delta", [0.0, 0.0, -0.9], [0.0])
