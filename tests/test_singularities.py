"""Singularities: layouts that are singular everywhere, orientations, constraints, the nearest."""

from dataclasses import replace
from functools import lru_cache

import casadi as ca
import numpy as np
import pytest
from mechanisms import CATALOG, CLIENTS, NIGHTLY, gated, random_machine, scaled, unit
from scipy.spatial.transform import Rotation

import pteron
from pteron.equations.machine import Machine, numbers
from pteron.kernels import numeric
from pteron.workspace import free_of_singularities, nearest_singularities


def layout(directions, points):
    """Return a Quadrupteron with these directions and platform points, both (4, 3)."""
    legs = tuple(
        replace(leg, direction=d, slider_direction=None, platform_point=s)
        for leg, d, s in zip(CATALOG["quadrupteron"].legs, directions, points, strict=True)
    )
    return replace(CATALOG["quadrupteron"], legs=legs)


def fourfold(direction, point):
    """Return a layout with fourfold symmetry about k."""
    turns = [Rotation.from_rotvec([0.0, 0.0, 0.5 * np.pi * i]).as_matrix() for i in range(4)]
    return layout([t @ direction for t in turns], [t @ point for t in turns])


def test_fourfold_symmetry_is_refused_with_the_reason():
    robot = fourfold(np.array([0.0, 0.6, 0.8]), np.array([0.05, 0.0, 0.0]))
    found = pteron.kinematics.architecture(robot)
    assert found.singular
    assert found.proof == "exact arithmetic"
    assert "fourfold symmetry" in found.reason
    with pytest.raises(pteron.SingularPose, match="the layout has fourfold symmetry"):
        pteron.inverse_dynamics(robot, *np.zeros((3, 4)))
    rng = np.random.default_rng(0)
    found = pteron.kinematics.architecture(fourfold(unit(rng), rng.uniform(-0.06, 0.06, 3)))
    assert (found.singular, found.proof) == (True, "closed form")
    assert "fourfold symmetry" in found.reason
    bent = replace(robot.legs[0], platform_point=(0.0501, 0.0, 0.0))
    found = pteron.kinematics.architecture(replace(robot, legs=(bent, *robot.legs[1:])))
    assert (found.singular, found.reason, found.proof) == (False, "", "one pose")


POINTS = np.array([[0.04, 0.0, 0.0], [0.0, 0.05, 0.0], [-0.04, 0.01, 0.0], [0.0, -0.04, 0.02]])


@pytest.mark.parametrize(
    ("robot", "reason", "proof"),
    [
        (
            layout([[1, 0, 0], [0, 1, 0], [0.6, 0.8, 0], [0, 1, 0]], POINTS),
            "rows all lie across [0.0, 0.0, 1.0]",
            "exact arithmetic",
        ),
        (
            layout([[0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 1, 0]], 0.0 * POINTS),
            "platform points lie on one line",
            "closed form",
        ),
        (
            layout([[0, 0, 1], [0, 1, 0], [0, 0, 1], [1, 0, 0]], POINTS),
            "rows of legs 1 and 3 of J depend",
            "exact arithmetic",
        ),
        (
            replace(
                CATALOG["3-rrr"],
                legs=tuple(
                    replace(leg, platform_point=(x, 0.0, 0.0))  # one point, but for rounding
                    for leg, x in zip(CATALOG["3-rrr"].legs, (0.3, 0.1 + 0.2, 0.3), strict=True)
                ),
            ),
            "platform points lie on one line",
            "numerical",
        ),
    ],
    ids=["plane", "points", "legs", "planar"],
)
def test_other_layouts_are_refused_with_the_reason(robot, reason, proof):
    found = pteron.kinematics.architecture(robot)
    assert found.singular
    assert found.proof == proof
    assert found.type_ii < 1e-10
    assert reason in found.reason


def test_singular_orientations_are_the_roots_of_det_j_for_1000_layouts():
    rng = np.random.default_rng(1)
    d = rng.normal(size=(1000, 4, 3))
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    s = rng.uniform(-0.06, 0.06, (1000, 4, 3))
    # The closed form as it is compiled, for all layouts in one call.
    robot = CATALOG["quadrupteron"]
    machine, vector = Machine.symbolic(robot)
    coefficients = ca.Function("coefficients", [vector], [ca.vertcat(*machine.closure.orientation)])
    given = np.tile(numbers(robot), (1000, 1))
    legs = given[:, :-12].reshape(1000, 4, -1)
    assert legs.shape[-1] == 21
    legs[..., 3:6] = legs[..., 6:9] = d
    legs[..., -6:-3] = s
    a, b = np.array(coefficients(given.T))
    one = np.arctan2(b, a) + 0.5 * np.pi
    found = np.sort(np.pi - (np.pi - np.array([one, one - np.pi])) % (2.0 * np.pi), axis=0).T
    for k in range(0, 1000, 100):
        angles = pteron.kinematics.singular_orientations(layout(d[k], s[k]))
        np.testing.assert_allclose(angles, found[k], atol=1e-9)

    def determinant(phi):
        """det [d, d . (k x R s)], (1000, ...) at angles (1000, ...)."""
        c, n = np.cos(phi)[..., None], np.sin(phi)[..., None]
        x, y = (s[:, None, :, i] for i in (0, 1))
        levers = d[:, None, :, 1] * (x * c - y * n) - d[:, None, :, 0] * (x * n + y * c)
        rows = np.broadcast_to(d[:, None], (*levers.shape, 3))
        return np.linalg.det(np.concatenate([rows, levers[..., None]], axis=-1))

    grid = np.linspace(-np.pi, np.pi, 90, endpoint=False) + np.zeros((1000, 1))
    values = determinant(grid)
    size = np.abs(values).max(axis=1, keepdims=True)
    assert np.abs(determinant(found) / size).max() < 1e-10
    # Two roots found, and two in all: as many as changes of sign.
    changes = np.signbit(values) != np.signbit(np.roll(values, 1, axis=1))
    assert (changes.sum(axis=1) == 2).all()


def rods_determinant(robot, pose):
    """Return det of the wrenches of all single rods on the platform and its parts, joints held."""
    p, axes = robot.platform.placement(pose)
    links, points = (numeric(robot, w)(pose) for w in ("link_vectors", "platform_points"))
    k = np.array(robot.platform.axis)
    hinges = [tuple(leg.platform_point) for leg in robot.legs]
    parts = list(dict.fromkeys(hinges)) if robot.platform.turns else []
    rows = []
    for leg, rod, c, hinge in zip(robot.legs, links[1], points[0], hinges, strict=True):
        b = rod / np.linalg.norm(rod)
        for side in (0.05, -0.05):
            end = c + side * np.array(leg.bar)
            about = [0.0] * len(parts)
            if parts:
                pin = p + np.array(hinge) @ axes
                about[parts.index(hinge)] = b @ np.cross(k, end - pin)
            rows.append([*b, *np.cross(end - p, b), *about])
    return np.linalg.det(rows)


@pytest.mark.parametrize("name", ["delta", "orthoglide", "h4"])
def test_the_single_rods_hold_what_type_ii_and_constraint_measures_say(name):
    """With joints held the rods' wrenches vanish where either does, and are their product."""
    robot = CATALOG[name]
    poses = pteron.random_poses(robot, 8, seed=2, type_ii=0.02)
    product = numeric(robot, "type_ii")(poses)[0] * pteron.kinematics.constraint_measure(
        robot, poses
    )
    rods = [rods_determinant(robot, pose) for pose in poses]
    share = np.array(rods) / product
    np.testing.assert_allclose(share, share[0], rtol=1e-9)


def test_constraints_of_revolute_joints_are_the_layouts():
    for name in ("tripteron-oblique", "quadrupteron-oblique"):
        robot = CATALOG[name]
        found = pteron.kinematics.constraint_measure(robot, pteron.random_poses(robot, 5))
        assert np.ptp(found) < 1e-14
        assert found[0] > 0.5
    random = random_machine(0, "PRSS")
    assert pteron.kinematics.architecture(random).holds is None, "bars that are not told"
    loose = random_machine(0, "RRRR")
    assert pteron.kinematics.architecture(loose).holds is False, (
        "bars that turn on hinges of their own"
    )


@pytest.mark.parametrize(
    "name",
    gated(["five-bar", "3-rrr", "delta", "tripteron-oblique"], ["five-bar"]),
)
def test_no_sampled_singular_pose_is_nearer_than_the_nearest(name):
    robot = CATALOG[name]
    pose = pteron.random_poses(robot, 3, seed=3, type_ii=0.05 if name != "five-bar" else 0.3)[2]
    found = [one for one in nearest_singularities(robot, pose) if one.by == "translation"]
    assert [one.distance for one in found] == sorted(one.distance for one in found)
    lengths = len(robot.platform.lengths)
    for one in found:
        assert abs(one.measure) <= 1e-10
        assert one.distance == pytest.approx(np.linalg.norm((one.pose - pose)[:lengths]))
        np.testing.assert_array_equal(one.pose[lengths:], pose[lengths:])

        def vanishing(poses, one=one):
            squares = numeric(robot, "squared_type_i")(poses)[0]
            if one.kind == "I":
                others = np.delete(squares, one.leg - 1, axis=-1)
                return np.where((others >= 0).all(axis=-1), squares[..., one.leg - 1], np.nan)
            what = {"II": "type_ii", "constraint": "constraint"}[one.kind]
            return np.where((squares >= 0).all(axis=-1), numeric(robot, what)(poses)[0], np.nan)

        rng = np.random.default_rng(4)
        around = rng.normal(size=(20000, lengths))
        around /= np.linalg.norm(around, axis=-1, keepdims=True)
        around *= one.distance * (1.0 - 1e-6) * rng.random((20000, 1)) ** (1.0 / lengths)
        poses = pose + np.pad(around, ((0, 0), (0, robot.freedom - lengths)))
        values = vanishing(poses) * vanishing(pose)
        assert (values[~np.isnan(values)] > 0.0).all()
        if one.kind == "II":  # near it the distance to first order is met
            near = one.pose + 1e-4 * (pose - one.pose)
            metres = numeric(robot, "type_ii_distances")(near)[0]
            assert metres == pytest.approx(1e-4 * one.distance, rel=1e-3)


SEEN = [
    ([0.21395636506464263, 0.7560125047188176, -0.6566581245477972], 0.280),
    ([0.09612123458, -0.17823451618, -1.02350944585], 0.721),
]
"""Poses of the Delta, and how near a type-II pose is known: where its surface ends at the reach."""


def turned(pose):
    """Return a pose turned by 120 degrees about z."""
    c, s = -0.5, 0.5 * np.sqrt(3.0)
    return np.array([c * pose[0] - s * pose[1], s * pose[0] + c * pose[1], *pose[2:]])


@CLIENTS
@pytest.mark.parametrize(
    ("pose", "known", "most"),
    [(*SEEN[1], 1000), *(pytest.param(*seen, 4000, marks=NIGHTLY) for seen in SEEN)],
)
def test_singular_poses_at_the_edge_of_the_reach_are_found(pose, known, most):
    robot = CATALOG["delta"]
    found = nearest_singularities(robot, pose, most=most)
    (two,) = [one for one in found if one.kind == "II"]
    assert two.distance < known
    assert (0.6 if most > 1000 else 0.1) * two.distance < two.lower_bound < two.distance
    assert abs(two.measure) <= 1e-10
    assert (numeric(robot, "squared_type_i")(two.pose)[0] > -1e-9).all()
    # What symmetry makes equal is told alike, leg by leg.
    again = nearest_singularities(robot, turned(pose), most=1000)
    for kind in ("I", "II", "constraint"):
        sizes = [[one.distance for one in told if one.kind == kind] for told in (found, again)]
        np.testing.assert_allclose(*sizes, rtol=2e-3)


@CLIENTS
def test_a_sheet_that_is_in_reach_in_a_corner_only_is_found():
    """Leg 4 folds within the reach of legs 1 and 2 only where both of them fold too."""
    robot = CATALOG["h4"]
    pose = [-0.0448, 0.4134, 0.2349, -0.0691]
    found = nearest_singularities(robot, pose, most=1000)
    (folded,) = [one for one in found if (one.kind, one.leg) == ("I", 4)]
    assert folded.distance == pytest.approx(0.41254, abs=1e-5)
    squares = numeric(robot, "squared_type_i")(folded.pose)[0]
    np.testing.assert_allclose(squares[[0, 1, 3]], 0.0, atol=1e-9)  # as near as counts as in reach
    assert squares[2] > 0.01


@CLIENTS
def test_singular_poses_of_a_pose_beyond_its_joints_limits_are_found():
    """Limits do not count: where the sliders are below theirs the towers' corners are as near."""
    robot = CATALOG["linear-delta"]
    pose = np.array([0.11678455657516291, -0.04466611565050454, -0.3739021])
    low = [leg.limits[0] for leg in robot.legs]
    assert (pteron.inverse_kinematics(robot, pose) < low).any()
    for _ in range(3):
        found = nearest_singularities(robot, pose)
        (corner,) = [one for one in found if one.kind == "constraint"]
        assert corner.distance == pytest.approx(0.043808507038, abs=1e-11)
        assert 0.99 * corner.distance < corner.lower_bound <= corner.distance
        pose = turned(pose)


AWAY = {"delta": (0.1, -0.2, -0.8), "five-bar": (0.01, 0.03)}


@lru_cache
def found_of(name):
    return nearest_singularities(CATALOG[name], AWAY[name], most=2000)


@CLIENTS
@pytest.mark.parametrize("name", gated(AWAY, ["five-bar"]))
@pytest.mark.parametrize("scale", gated([1e-3, 1e3], [1e-3]))
def test_distances_do_not_depend_on_the_unit_of_length(name, scale):
    found = found_of(name)
    small = scaled(CATALOG[name], scale)
    again = nearest_singularities(small, scale * np.array(AWAY[name]), most=2000)
    assert [(one.kind, one.leg) for one in again] == [(one.kind, one.leg) for one in found]
    sizes = [np.array([one.distance for one in told]) for told in (again, found)]
    # As closely as it is searched: rounding leads to other boxes.
    np.testing.assert_allclose(sizes[0], scale * sizes[1], rtol=5e-3)


@pytest.mark.parametrize(
    "name",
    gated(["3-prr", "orthoglide", "linear-delta", "quadrupteron"], ["quadrupteron"]),
)
def test_no_singular_pose_is_nearer_than_proved(name):
    """In a ball of the proved radius no function changes its sign between neighbours in reach."""
    robot, rng = CATALOG[name], np.random.default_rng(8)
    lengths = len(robot.platform.lengths)
    for pose in pteron.random_poses(robot, 2, seed=6, type_i=0.05, type_ii=0.05):
        for one in nearest_singularities(robot, pose, most=1000):
            assert 0.0 < one.lower_bound <= one.distance
            moved = slice(0, lengths) if one.by == "translation" else slice(lengths, None)
            around = rng.normal(size=(10000, lengths if moved.start == 0 else 1))
            size = rng.random((10000, 1)) ** 0.5 / np.linalg.norm(around, axis=-1, keepdims=True)
            ways = np.zeros((2, 10000, robot.freedom))
            ways[0, :, moved] = around * size * one.lower_bound
            ways[1] = 0.97 * ways[0]
            ways[1, :, moved] += 0.02 * one.lower_bound * np.sign(around) * rng.random(size.shape)
            squares = numeric(robot, "squared_type_i")(pose + ways)[0]
            if one.kind == "I":
                values = squares[..., one.leg - 1].copy()
                squares[..., one.leg - 1] = 0.0
            else:
                what = {"II": "type_ii", "constraint": "constraint"}[one.kind]
                values = numeric(robot, what)(pose + ways)[0]
            reached = (squares >= 0.0).all(axis=(0, -1))
            assert reached.any()
            assert (values[0, reached] * values[1, reached] > 0.0).all()


@CLIENTS
def test_a_search_that_is_given_up_tells_its_bound():
    robot, pose = CATALOG["five-bar"], AWAY["five-bar"]
    whole = {(one.kind, one.leg): one for one in found_of("five-bar")}
    short = nearest_singularities(robot, pose, most=1)
    assert {(one.kind, one.leg) for one in short} == set(whole)
    for one in short:
        assert one.lower_bound <= whole[one.kind, one.leg].distance <= 1.05 * one.distance
    with pytest.raises(pteron.DataError, match="most: 0 given"):
        nearest_singularities(robot, pose, most=0)


def test_the_estimate_of_a_turn_is_about_the_axis_that_leads_there_soonest():
    robot = pteron.load("wrist")
    pose = np.array([0.1, -0.2, 0.3])
    measure, step = numeric(robot, "type_ii"), 1e-6
    turns = Rotation.from_rotvec(step * np.vstack([np.eye(3), -np.eye(3)])).as_matrix()
    at, axes = pteron.kinematics.position_of(robot, pose), pteron.rotation_of(robot, pose)
    ahead, behind = np.split(measure(pteron.pose_of(robot, at, turns @ axes))[0], 2)
    slope = np.linalg.norm(ahead - behind) / (2.0 * step)
    size = abs(measure(pose)[0])
    expected = min(size / slope, np.pi)
    assert expected < np.pi
    assert numeric(robot, "type_ii_distances")(pose)[1] == pytest.approx(expected, rel=1e-8)


@CLIENTS
def test_distances_in_closed_form_are_met():
    robot, pose = CATALOG["quadrupteron"], np.array([0.01, 0.0, 0.02, 0.3])
    found = nearest_singularities(robot, pose)
    (turn,) = [one for one in found if one.kind == "II"]
    assert (turn.by, turn.unit) == ("rotation", "rad")
    assert turn.distance == pytest.approx(0.5 * np.pi - 0.3, abs=1e-12)
    assert numeric(robot, "type_ii_distances")(pose)[1] == pytest.approx(turn.distance, abs=1e-12)
    # Its guides are along the axes, so that the reach margin is the distance.
    margin = numeric(robot, "reach")(pose)[0]
    moved = {one.leg: one.distance for one in found if one.by == "translation"}
    np.testing.assert_allclose([moved[i] for i in range(1, 5)], margin, rtol=1e-9)
    three = CATALOG["3-rrr"]
    pose = pteron.random_poses(three, 3, seed=3, type_ii=0.05)[2]
    turns = [one for one in nearest_singularities(three, pose) if one.by == "rotation"]
    (turn,) = [one for one in turns if one.kind == "II"]
    angles = pteron.kinematics.singular_orientations(three, pose[:2])
    ways = (angles - pose[2] + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(ways).min() == pytest.approx(turn.distance, abs=1e-9)


def test_regions_are_free_up_to_the_singular_orientation():
    robot = CATALOG["quadrupteron-oblique"]
    first = pteron.kinematics.singular_orientations(robot)
    edge = first[first > 0.0].min()
    low, high = np.full((2, 4), 0.01) * [[-1.0], [1.0]]
    low[3], high[3] = 0.0, edge - 1e-3
    found = free_of_singularities(robot, [low, high])
    assert found.free
    poses = np.random.default_rng(0).uniform(low, high, (1000, 4))
    assert np.abs(numeric(robot, "type_ii")(poses)[0]).min() >= found.measure > 0.0
    high[3] = edge + 1e-3
    reached = numeric(robot, "reach")(np.array([0.0, 0.0, 0.0, edge]))[0]
    if (reached > 0.02).all():
        found = free_of_singularities(robot, [low, high])
        assert found.free is False
        assert found.pose[3] == pytest.approx(edge, abs=1e-9)
    for end in ([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, np.pi / 2]):  # singular but for rounding
        assert (
            free_of_singularities("quadrupteron", [end, [0.0, 0.0, 0.0, np.pi / 2]]).free is False
        )


def test_a_region_is_free_or_holds_the_pose_that_is_returned():
    robot = CATALOG["3-prr"]
    home = np.array([0.0, 0.0, -0.1])
    size = np.array([0.04, 0.04, 0.3])
    near = free_of_singularities(robot, [home - size, home + size])
    assert near.free
    assert near.measure > 0.0
    far = np.array([home - 3 * size, home + 3 * size])
    found = free_of_singularities(robot, far)
    assert found.free is False
    assert ((far[0] <= found.pose) & (found.pose <= far[1])).all()
    assert abs(np.linalg.det(pteron.jacobian(robot, found.pose))) < 1e-8
    undecided = free_of_singularities(robot, far, most=1)
    assert undecided.free in (False, None)
    with pytest.raises(pteron.DataError, match="the least and the greatest pose expected"):
        free_of_singularities(robot, far[::-1])
