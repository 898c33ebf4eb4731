"""Where a machine can work: margins, home pose, reach, volume and joint ranges."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from mechanisms import (
    CATALOG,
    CLIENTS,
    MECHANISMS,
    NIGHTLY,
    fourfold,
    gated,
    random_machine,
    states,
    with_limits,
)

import pteron
from pteron.kinematics.singularities import best_type_ii
from pteron.workspace import (
    BEYOND_LIMITS,
    REACHABLE,
    bounding_box,
    home_pose,
    joint_ranges,
    pose_margins,
    reach_slice,
    reach_volume,
)

NAMES = [
    *("quadrupteron", "tripteron-oblique", "delta", "quadrupteron turned", "delta on a wall"),
    *("random 3T1R 0", "random RRR 0", "random PRR 0"),
]
FAMILY = ["linear-delta", "par4", "delta-4", "five-bar", "3-rrr", "3-prr"]
MACHINES = {name: {**CATALOG, **MECHANISMS}[name] for name in [*NAMES, *FAMILY]}
GATE = ("quadrupteron", "delta", "random PRR 0", "par4", "five-bar", "3-rrr")
EVERY = pytest.mark.parametrize("name", gated(NAMES, GATE))
FAMILIES = pytest.mark.parametrize("name", gated(MACHINES, GATE))
CONES = {"delta with cones": ("delta", 0.75), "h4 with cones": ("h4", 0.6)}
PLANES = ("xy", "xz", "yz")


@lru_cache
def home(name):
    return home_pose(machine(name))


def machine(name):
    """Return a machine, perhaps with cones for its rods: they leave corners and thin edges."""
    if name not in CONES:
        return MACHINES[name]
    name, angle = CONES[name]
    held = {"platform_cone": pteron.legs.Cone((0.0, 0.0, 1.0), angle)}
    legs = CATALOG[name].legs
    return replace(CATALOG[name], legs=tuple(replace(leg, **held) for leg in legs))


def steinmetz(link):
    """Return a Tripteron whose legs reach three cylinders that cross at right angles."""
    robot = MECHANISMS["tripteron"]
    legs = [
        replace(
            leg,
            direction=axis,
            slider_direction=None,
            guide_point=leg.platform_point,
            upper_length=link,
            lower_length=link,
            limits=None,
        )
        for leg, axis in zip(robot.legs, np.eye(3), strict=True)
    ]
    return replace(robot, legs=tuple(legs))


@EVERY
def test_measures_are_sines_and_volumes(name):
    robot = MECHANISMS[name]
    pose, _, _ = states(robot, 50)
    found = pose_margins(robot, pose)
    l_u, l_l = pteron.kinematics.link_vectors(robot, pose)
    d = np.array([leg.direction for leg in robot.legs])
    # The sine between the links, seen along d: a rod may leave the plane.
    sines = np.abs((np.cross(l_u, l_l) * d).sum(axis=-1))
    sines /= [leg.upper_length * leg.lower_length for leg in robot.legs]
    np.testing.assert_allclose(found.type_i, sines, atol=1e-7)
    jacobian = pteron.jacobian(robot, pose)
    if robot.platform.turns:
        # A leg's share of the moments is a constant for the whole machine.
        jacobian = jacobian * [1, 1, 1, 20]
    rows = jacobian / np.linalg.norm(jacobian[..., :3], axis=-1, keepdims=True)
    determinants = np.abs(np.linalg.det(rows))
    best = pteron.random_poses(robot, 50000, seed=5, type_i=0.0, type_ii=0.0)
    measure = np.abs(pteron.compile(robot, "type_ii")(np.concatenate([pose, best])))
    determinants *= measure[0] / determinants[0] / measure.max()
    np.testing.assert_allclose(found.type_ii, determinants, rtol=0.03)
    everything = np.c_[found.type_i, found.joints, found.type_ii]
    np.testing.assert_array_equal(found.least, everything.min(axis=-1))


@pytest.mark.parametrize("name", ["3-rrr", "par4", "linear-delta", "random PRR 0"])
def test_no_pose_is_better_than_the_best(name):
    robot = MACHINES[name]
    wide = pteron.random_poses(robot, 50_000, seed=3, type_i=0.0, type_ii=0.0, limits=False)
    share = np.abs(pteron.compile(robot, "type_ii")(wide)) / best_type_ii(robot)
    assert 0.96 < share.max() <= 1.0


def test_limits_leave_the_best_as_it_is():
    robot = MACHINES["par4"]
    tight = replace(robot, platform=replace(robot.platform, limits=(-0.2, 0.2)))
    assert best_type_ii(tight) == best_type_ii(robot)


def test_clearance_is_the_share_of_the_half_range_to_the_nearer_limit():
    robot = with_limits(MECHANISMS["tripteron"], -0.1, 0.3)
    pose = np.array([[0.1, -0.1, 0.3], [0.2, 0.0, -0.15]])
    joints = pteron.inverse_kinematics(MECHANISMS["tripteron"], pose, on_failure="nan")
    found = pose_margins(robot, pose).joints
    reached = ~np.isnan(joints)
    expected = 1.0 - np.abs(joints - 0.1) / 0.2
    np.testing.assert_allclose(found[reached], expected[reached], atol=1e-12)


@pytest.mark.parametrize("name", ["tripteron", "delta"])
def test_out_of_reach_the_margin_is_negative_and_says_by_how_much(name):
    robot, far = MECHANISMS[name], [0.0, 0.0, 2.0]
    with pytest.raises(pteron.UnreachablePose) as caught:
        pteron.inverse_kinematics(robot, far)
    found = pose_margins(robot, far)
    share = caught.value.shortfall / robot.legs[caught.value.leg - 1].size
    assert found.type_i[caught.value.leg - 1] == pytest.approx(-share)
    assert found.least < 0.0


def left(robot, poses):
    """Return the least margin, and of a machine that turns what is left of half a turn."""
    least = pose_margins(robot, poses).least
    turned = np.abs(poses[..., -1]) / np.pi if robot.platform.turns else 0.0
    return np.minimum(least, 1.0 - turned)


@FAMILIES
def test_home_has_the_best_margin(name):
    robot = MACHINES[name]
    best = left(robot, home(name))
    others = pteron.random_poses(robot, 5000, seed=99, type_i=0.0, type_ii=0.0)
    # These two have several best places, and their home in the middle between them.
    share = 0.9 if name in ("linear-delta", "3-rrr") else 0.98
    assert best >= share * left(robot, others).max() > 0.4
    pteron.inverse_kinematics(robot, home(name))  # raises out of reach
    np.testing.assert_array_equal(home_pose(robot), home(name))


@pytest.mark.parametrize(
    ("name", "along"),
    [("delta", 2), ("linear-delta", 2), ("par4", 2), ("delta-4", 2), ("five-bar", 1), ("3-rrr", 0)],
)
def test_home_is_on_the_axis_of_symmetry_in_round_numbers(name, along):
    pose = home(name)
    np.testing.assert_array_equal(np.delete(pose, along), 0.0)
    assert pose[along] == pytest.approx(round(pose[along], 3), abs=1e-12)


def test_home_respects_the_joints_limits():
    aside = with_limits(MECHANISMS["quadrupteron"], 0.02, 0.05)
    found = home_pose(aside)
    joints = pteron.inverse_kinematics(aside, found)
    assert not np.allclose(home("quadrupteron"), found)
    assert (joints > 0.02).all()
    assert (joints < 0.05).all()


@CLIENTS
def test_machines_without_a_home_are_refused():
    robot = MECHANISMS["quadrupteron"]
    short = replace(
        robot, legs=tuple(replace(leg, upper_length=0.03, lower_length=0.03) for leg in robot.legs)
    )
    with pytest.raises(pteron.ModelError, match="no pose is in reach of all legs"):
        home_pose(short)
    with pytest.raises(pteron.ModelError, match="widen limits"):
        home_pose(with_limits(robot, 2.0, 3.0))
    with pytest.raises(pteron.SingularPose, match="singular at every pose"):
        home_pose(fourfold())


def planes(robot):
    return PLANES[:1] if robot.platform.planar else PLANES


@pytest.mark.parametrize(
    ("name", "plane"),
    [
        pytest.param(
            name,
            plane,
            marks=() if name in GATE[::2] and plane == "xy" else NIGHTLY,
        )
        for name in MACHINES
        for plane in planes(MACHINES[name])
    ],
)
def test_a_slices_status_is_what_inverse_kinematics_says(name, plane):
    robot = MACHINES[name]
    center = home(name)
    cut = reach_slice(robot, center, plane, points=41)
    i, j = ("xyz".index(letter) for letter in plane)
    poses = np.tile(center, (41, 41, 1))
    poses[..., i], poses[..., j] = np.meshgrid(cut.first, cut.second)
    joints = pteron.inverse_kinematics(robot, poses, on_failure="nan")
    reached = ~np.isnan(joints).any(axis=-1)
    np.testing.assert_array_equal(reached, cut.status <= REACHABLE)
    assert reached.any()
    assert not reached.all()
    low, high = np.array([leg.limits or (-np.inf, np.inf) for leg in robot.legs]).T
    within = ((joints >= low) & (joints <= high)).all(axis=-1)
    np.testing.assert_array_equal(cut.status == REACHABLE, within)
    np.testing.assert_array_equal(cut.status == BEYOND_LIMITS, reached & ~within)
    inside = np.abs(cut.margin) > 1e-9
    np.testing.assert_array_equal((cut.margin > 0.0)[inside], (cut.status == REACHABLE)[inside])
    failing = np.argwhere(cut.status > REACHABLE)
    for b, a in failing[:: max(len(failing) // 20, 1)]:
        with pytest.raises(pteron.UnreachablePose) as caught:
            pteron.inverse_kinematics(robot, poses[b, a])
        assert caught.value.shortfall <= -cut.margin[b, a] + 1e-12
        assert cut.leg_margins[b, a, cut.status[b, a] - 1] == cut.leg_margins[b, a].min()


def test_a_leg_margin_is_the_distance_to_its_type_i_singularity():
    robot = MECHANISMS["tripteron"]
    cut = reach_slice(robot, [0.0, 0.0, 0.0], points=21)
    x, y = np.meshgrid(cut.first, cut.second)
    poses = np.stack([x, y, 0.0 * x], axis=-1)
    for i, leg in enumerate(robot.legs):
        u = poses + np.array(leg.platform_point) - leg.guide_point
        n = np.linalg.norm(u - np.multiply.outer(u @ leg.direction, leg.direction), axis=-1)
        lengths = leg.upper_length, leg.lower_length
        expected = np.minimum(sum(lengths) - n, n - abs(lengths[0] - lengths[1]))
        np.testing.assert_allclose(cut.leg_margins[..., i], expected, atol=1e-12)


def test_slices_that_cannot_be_are_refused():
    robot = MECHANISMS["tripteron"]
    with pytest.raises(pteron.DataError, match='\'zx\' is not one of "xy", "xz", "yz"'):
        reach_slice(robot, [0.0, 0.0, 0.0], "zx")
    with pytest.raises(pteron.DataError, match="'xz' is not one of \"xy\""):
        reach_slice(CATALOG["five-bar"], home("five-bar"), "xz")
    with pytest.raises(pteron.DataError, match="points: 1 given"):
        reach_slice(robot, [0.0, 0.0, 0.0], points=1)
    with pytest.raises(pteron.DataError, match="center"):
        reach_slice(robot, [0.0, np.nan, 0.0])
    far = with_limits(robot, 5.0, 6.0)
    with pytest.raises(pteron.ModelError, match="no position is in reach"):
        reach_slice(far, [0.0, 0.0, 0.0])


def test_a_reach_without_an_end_is_refused():
    robot = MECHANISMS["tripteron"]
    along = np.ones(3) / np.sqrt(3.0)
    legs = [replace(leg, slider_direction=along, limits=None) for leg in robot.legs]
    endless = replace(robot, legs=tuple(legs))
    pose = pteron.random_poses(endless, 1)[0]
    with pytest.raises(pteron.ModelError, match=r"has no end: .* give the legs limits"):
        bounding_box(endless, pose)
    assert np.ptp(bounding_box(with_limits(endless, -0.5, 0.5), pose), axis=0).max() < 3.0


@pytest.mark.parametrize("name", gated([*MACHINES, *CONES], ["five-bar"]))
def test_the_box_holds_the_reach_and_touches_it(name):
    robot = machine(name)
    box = bounding_box(robot, home(name))
    rng = np.random.default_rng(5)
    poses = np.tile(home(name), (200_000, 1))
    middle, half = box.mean(axis=0), np.ptp(box, axis=0) / 2.0
    k = len(robot.platform.lengths)
    poses[:, :k] = rng.uniform(middle - 1.3 * half, middle + 1.3 * half, (len(poses), k))
    found = pose_margins(robot, poses)
    good = poses[np.c_[found.type_i, found.joints].min(axis=-1) >= 0.0, :k]
    assert len(good) > 100
    assert (good >= box[0] - 1e-6).all()
    assert (good <= box[1] + 1e-6).all()
    assert (np.ptp(good, axis=0) > 0.6 * np.ptp(box, axis=0)).all()


def test_the_volume_of_three_crossing_cylinders():
    # Three cylinders of radius R that cross at right angles share 8 (2 - sqrt 2) R^3 (Steinmetz).
    robot = steinmetz(0.15)
    exact = 8.0 * (2.0 - np.sqrt(2.0)) * 0.3**3
    found = reach_volume(robot, [0.1, 0.05, -0.02])
    np.testing.assert_allclose(found.box, [[-0.3] * 3, [0.3] * 3], atol=1e-6)
    assert abs(found.volume - exact) < 3.0 * found.standard_error
    assert found.standard_error < 0.01 * exact
    assert found.unit == "m^3"


def test_a_planar_machine_reaches_an_area():
    # Two circles of radius R = 180 mm, whose centres are 118 mm apart, share a lens.
    robot = CATALOG["five-bar"]
    legs = tuple(replace(leg, limits=None) for leg in robot.legs)
    radius, half = 0.18, 0.059
    exact = 2.0 * radius**2 * np.arccos(half / radius) - 2.0 * half * np.sqrt(radius**2 - half**2)
    found = reach_volume(replace(robot, legs=legs), [0.0, 0.1])
    assert abs(found.volume - exact) < 3.0 * found.standard_error
    assert found.unit == "m^2"
    tall = np.sqrt(radius**2 - half**2)
    np.testing.assert_allclose(found.box, np.outer([-1, 1], [radius - half, tall]), atol=1e-6)


def test_the_volume_shrinks_with_the_limits():
    robot = steinmetz(0.15)
    found = reach_volume(with_limits(robot, -0.05, 0.1), [0.0, 0.0, 0.0])
    # The cube [-0.05, 0.1]^3 lies in all cylinders.
    np.testing.assert_allclose(found.box, [[-0.05] * 3, [0.1] * 3], atol=1e-9)
    assert found.volume == pytest.approx(0.15**3, rel=1e-9)
    with pytest.raises(pteron.DataError, match="count: 0 given"):
        reach_volume(robot, [0.0, 0.0, 0.0], count=0)


def test_joint_ranges_are_the_extremes():
    robot = MECHANISMS["quadrupteron"]
    poses = pteron.random_poses(robot, 60, seed=4).reshape(3, 20, 4)
    joints = pteron.inverse_kinematics(robot, poses)
    found = joint_ranges(robot, poses)
    np.testing.assert_array_equal(found.least, joints.min(axis=(0, 1)))
    np.testing.assert_array_equal(found.greatest, joints.max(axis=(0, 1)))
    assert found.limits == tuple(leg.limits for leg in robot.legs)
    low, high = np.array(found.limits).T
    np.testing.assert_array_equal(found.within, (found.least >= low) & (found.greatest <= high))
    assert not joint_ranges(with_limits(robot, -1e-3, 1e-3), poses).within.any()


def test_joint_ranges_without_limits_or_poses():
    robot = random_machine(7, "PRR")
    poses = pteron.random_poses(robot, 5)
    found = joint_ranges(robot, poses)
    assert found.limits == (None, None, None)
    assert found.within.all()
    with pytest.raises(pteron.DataError, match="none given"):
        joint_ranges(robot, np.empty((0, 3)))
    with pytest.raises(pteron.UnreachablePose):
        joint_ranges(robot, [[9.0, 0.0, 0.0]])
