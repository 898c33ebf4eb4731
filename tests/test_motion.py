"""Motions: exact derivatives, limits that hold between the samples, and where the joints are."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from differences import along
from hypothesis import given, settings, strategies as st
from mechanisms import (
    BATCH_SHAPES,
    CATALOG,
    MECHANISMS,
    NEAREST,
    gated,
    in_turn,
    random_machine,
    states,
)
from scipy.spatial.transform import Rotation

import pteron
from pteron.motion import joint_guides, joint_points, pick_and_place, scaled_to_reach
from pteron.motion.trajectories.cycle import Cycle, quintic
from pteron.workspace import home_pose, pose_margins

NAMES = [
    *("quadrupteron", "tripteron", "delta", "quadrupteron turned", "delta on a wall"),
    *("tripteron, no gravity", "random 3T1R 0", "random PRR 0"),
]


def with_tool(name, tool, **changes):
    """Return a machine of the catalog with its tool's centre point elsewhere."""
    robot = CATALOG[name]
    return replace(robot, platform=replace(robot.platform, tool=tool), **changes)


MACHINES = {
    **{name: MECHANISMS[name] for name in (*NAMES, *NEAREST)},
    **{name: CATALOG[name] for name in ("linear-delta", "delta-4", "par4", "five-bar", "3-prr")},
    "3-rrr with a tool": with_tool("3-rrr", (0.03, -0.02, 0.01)),
    "h4 with a tool": with_tool("h4", (0.05, 0.02, -0.1)),
    "upright five-bar": replace(CATALOG["five-bar"], gravity=(3.0, -9.0, 2.0)),
    "sliding": random_machine(0, "PRSSI"),
}
SOME = ("quadrupteron", "tripteron, no gravity", "delta on a wall", "random PRR 0", "delta-4")
SOME += ("3-rrr with a tool", "h4 with a tool", "upright five-bar", "sliding")
FAMILIES = in_turn(MACHINES, SOME)
LEAST = 0.2
POINT = ("platform_point", "fixed_offset")


@lru_cache
def home(name):
    return home_pose(MACHINES[name])


@lru_cache
def cycle(name):
    return pick_and_place(MACHINES[name], home(name), least=LEAST)


@given(st.floats(-0.5, 1.5), st.floats(0.0, 0.4), st.floats(0.6, 1.0))
@settings(deadline=None)
def test_the_quintic_is_its_derivatives_integral(tau, begin, end):
    # The third derivative jumps at both ends: differences reach across them only to O(step).
    step = 1e-4
    times = tau + np.arange(-4, 5) * step
    if np.abs(times[:, None] - [begin, end]).min() < step:
        return
    s, ds, dds = quintic(np.array(tau), begin, end)
    assert 0.0 <= s <= 1.0
    assert along(lambda t: quintic(tau + t, begin, end)[0], step) == pytest.approx(ds, abs=1e-9)
    assert along(lambda t: quintic(tau + t, begin, end)[1], step) == pytest.approx(dds, abs=1e-7)


def test_the_quintic_rests_at_both_ends():
    for s, tau in ((0.0, [-1.0, 0.2]), (1.0, [0.8, 3.0])):
        found = np.array(quintic(np.array(tau), 0.2, 0.8))
        np.testing.assert_allclose(found, [[s, s], [0, 0], [0, 0]], atol=1e-13)


@FAMILIES
def test_a_cycles_derivatives_are_exact(name):
    found = cycle(name)
    robot = MACHINES[name]
    turn = found.turn / found.scale
    path = Cycle(robot.platform, home(name), found.across, found.up, turn, found.scale)
    tau = np.random.default_rng(3).uniform(size=200)
    knots = np.array([0.0, 0.075, 0.2, 0.3, 0.425, 0.5])
    knots = np.concatenate([knots, 1.0 - knots])
    tau = tau[np.abs(tau[:, None] - knots).min(axis=1) > 5e-4]
    assert len(tau) > 150
    _, first, second = path.at(tau)
    for order, expected in enumerate((first, second)):

        def function(offsets, order=order):
            grid = tau + offsets[:, None]
            return path.at(grid.ravel())[order].reshape(*grid.shape, robot.freedom)

        np.testing.assert_allclose(along(function, 1e-4), expected, atol=1e-9 * 10**order)
    at = found.time / found.duration
    for mine, theirs, order in zip(
        (found.pose, found.velocity, found.acceleration), path.at(at), range(3), strict=True
    ):
        np.testing.assert_allclose(mine, theirs / found.duration**order, rtol=1e-12, atol=1e-12)


def tool(robot, pose):
    """Return where the tool's centre point is."""
    p, axes = robot.platform.placement(np.asarray(pose))
    return p + robot.platform.tool @ axes


@FAMILIES
def test_a_cycle_keeps_its_limits_between_the_samples(name):
    robot, found = MACHINES[name], cycle(name)
    dense = pick_and_place(
        robot, home(name), scale=found.scale, direction=found.across, samples=20_011
    )
    kept = pose_margins(robot, dense.pose)
    assert kept.type_i.min() >= LEAST
    assert kept.type_ii.min() >= LEAST
    assert kept.joints.min() >= 0.0
    if any(robot.platform.tool[:2]):
        return  # P is faster, or slower, than the tool
    peak = np.linalg.norm(dense.acceleration[:, : len(robot.platform.lengths)], axis=-1).max()
    assert 10.0 * (1.0 - 1e-5) < peak < 10.0 * (1.0 + 1e-9)


@FAMILIES
def test_a_cycle_is_the_largest_that_fits(name):
    robot, found = MACHINES[name], cycle(name)
    assert 0.0 < found.scale <= 1.0
    if found.scale < 1.0:
        larger = pick_and_place(
            robot, home(name), scale=found.scale + 0.005, direction=found.across, samples=2001
        )
        kept = pose_margins(robot, larger.pose)
        # The joints' clearance is kept to a hair's breadth, the others to the least margin.
        tightest = min(kept.type_i.min(), kept.type_ii.min()) - LEAST
        assert min(tightest, kept.joints.min()) < 1e-3


@FAMILIES
def test_a_cycle_goes_up_across_down_and_back(name):
    robot, found = MACHINES[name], cycle(name)
    offset = tool(robot, found.pose) - tool(robot, home(name))
    heights, widths = offset @ found.up, offset @ found.across
    assert np.ptp(heights) == pytest.approx(0.025 * found.scale)
    assert np.ptp(widths) == pytest.approx(0.305 * found.scale)
    assert heights.sum() / len(heights) > heights[0], "it lifts before it goes across"
    third = np.cross(found.up, found.across)
    np.testing.assert_allclose(offset @ third, 0.0, atol=1e-15)
    np.testing.assert_allclose(found.pose, found.pose[::-1], atol=2e-15)
    for ends in (found.velocity, found.acceleration):
        np.testing.assert_allclose(ends[[0, 240, -1]], 0.0, atol=1e-12)
    if robot.platform.turns:
        assert np.ptp(found.pose[:, -1]) == pytest.approx(np.pi / 3 * found.scale)
    axis, pull = np.array(robot.platform.axis), np.array(robot.gravity)
    if robot.platform.planar:
        assert axis @ found.across == axis @ found.up == 0.0
        pull = pull - (pull @ axis) * axis
    if pull.any():
        np.testing.assert_allclose(found.up, -pull / np.linalg.norm(pull), atol=1e-15)
    else:
        expected = np.cross(axis, found.across) if robot.platform.planar else axis
        np.testing.assert_allclose(found.up, expected, atol=1e-15)


@pytest.mark.parametrize("name", gated(NEAREST, ["delta", "quadrupteron-oblique"]))
def test_a_turned_machine_makes_the_turned_cycle(name):
    rotation = Rotation.random(rng=8).as_matrix()
    robot, first = MACHINES[name], cycle(name)
    middle = np.array(home(name))
    middle[:3] = rotation @ middle[:3]
    turned = pteron.turned(robot, rotation)
    ahead = rotation @ first.across
    second = pick_and_place(turned, middle, direction=ahead, scale=first.scale)
    np.testing.assert_allclose(second.pose[:, :3], first.pose[:, :3] @ rotation.T, atol=1e-12)
    np.testing.assert_allclose(second.pose[:, 3:], first.pose[:, 3:], atol=1e-15)
    forces = [
        pteron.inverse_dynamics(machine, motion.pose, motion.velocity, motion.acceleration)
        for machine, motion in ((robot, first), (turned, second))
    ]
    np.testing.assert_allclose(*forces, atol=1e-9)


def test_limits_bound_the_cycle():
    robot = MECHANISMS["quadrupteron"]
    tight = replace(robot, legs=tuple(replace(leg, limits=(-0.05, 0.04)) for leg in robot.legs))
    scale, _ = scaled_to_reach(tight, home_pose(tight))
    assert scale < cycle("quadrupteron").scale
    found = pick_and_place(tight, home_pose(tight), samples=5001)
    joints = pteron.inverse_kinematics(tight, found.pose)
    assert joints.min() >= -0.05
    assert joints.max() <= 0.04
    assert max(-0.05 - joints.min(), joints.max() - 0.04) > -2e-3, "a limit is what bounds it"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"scale": 0.0}, "scale: 0.0 given"),
        ({"duration": -1.0}, "duration: -1.0 given"),
        ({"peak": float("nan")}, "peak: nan given"),
        ({"samples": 1}, "samples: 1 given"),
        ({"direction": [0.0, 0.0, 2.0]}, "no horizontal part"),
        ({"direction": [0.0, 0.0, 0.0]}, "no horizontal part"),
    ],
)
def test_a_cycle_that_cannot_be_is_refused(arguments, complaint):
    with pytest.raises(pteron.DataError, match=complaint):
        pick_and_place(MECHANISMS["tripteron"], [0.0, 0.0, 0.0], **arguments)


def test_a_direction_that_a_plane_has_not_is_refused():
    with pytest.raises(pteron.DataError, match="no horizontal part in the machine's plane"):
        pick_and_place(MACHINES["upright five-bar"], home("upright five-bar"), direction=[0, 0, 1])


def test_no_cycle_fits_at_a_singular_pose_or_out_of_reach():
    with pytest.raises(pteron.ModelError, match="choose a better pose"):
        pick_and_place(MECHANISMS["quadrupteron"], [0.0, 0.0, 0.0, np.pi / 2])
    with pytest.raises(pteron.UnreachablePose, match=r"leg 2 misses it by 4\.61 m"):
        pick_and_place(MECHANISMS["tripteron"], [5.0, 0.0, 0.0])


@FAMILIES
def test_lines_lead_from_the_base_to_the_platform(name):
    robot = MACHINES[name]
    pose, _, _ = states(robot, 50)
    points = joint_points(robot, pose)
    for i, (leg, line) in enumerate(zip(robot.legs, points.links, strict=True)):
        np.testing.assert_allclose(line[:, -1], points.platform_points[:, i], atol=1e-15)
        start = np.tile(leg.guide_point, (50, 1))
        if leg.joint.noun == "slider":
            start += np.multiply.outer(points.coordinates[:, i], leg.joint_axis)
        np.testing.assert_allclose(line[:, 0], start, atol=1e-15)
        links = np.diff(line, axis=1)
        if leg.plane_normal is not None:  # places along the normal do not count
            links = links @ robot.platform.directions.T
        lengths = [q.value[0] for q in leg.quantities if q.role == "length"]
        found = np.linalg.norm(links, axis=-1)
        if lengths:  # a telescopic shaft has none
            np.testing.assert_allclose(found, np.tile(lengths, (50, 1)), rtol=1e-12)
        assert found.shape[1] == max(len(lengths), 1)
        if len(lengths) < 2:
            continue
        upper, lower = np.diff(line, axis=1).transpose(1, 0, 2)
        np.testing.assert_allclose(upper @ leg.direction, 0.0, atol=1e-14)
        side = np.cross(upper, lower) @ leg.direction
        # u x (elbow side) points along sigma d; l_u x l_l has the opposite sign.
        assert (np.sign(side) == -leg.elbow).all()


@FAMILIES
def test_guides_lead_where_the_joints_go(name):
    robot = MACHINES[name]
    poses, _, _ = states(robot, 50)
    points = joint_points(robot, poses)
    for i, (leg, guide) in enumerate(zip(robot.legs, joint_guides(robot, poses), strict=True)):
        assert guide.is_prismatic == (leg.joint.noun == "slider")
        np.testing.assert_array_equal(guide.axis, leg.joint_axis)
        if leg.joint.noun == "shaft":  # it turns where it is
            np.testing.assert_array_equal(guide.path, [leg.guide_point])
            continue
        ends = points.links[i][:, 0 if guide.is_prismatic else 1]
        if leg.limits is None:
            steps = np.linalg.norm(np.diff(guide.path, axis=0), axis=-1)
            away = np.linalg.norm(ends[:, None] - guide.path, axis=-1).min(axis=-1)
            assert away.max() <= steps.max()
        center = guide.path[0] if guide.is_prismatic else np.array(leg.guide_point)
        across = np.cross if guide.is_prismatic else np.dot
        np.testing.assert_allclose(across(guide.path - center, guide.axis), 0.0, atol=1e-12)
        if leg.limits is not None:
            reached = guide.path[[0, -1]] - leg.guide_point
            size = leg.lever if not guide.is_prismatic else np.abs(leg.limits)
            np.testing.assert_allclose(np.linalg.norm(reached, axis=-1), size, rtol=1e-12)


@FAMILIES
def test_the_platforms_parts_are_rigid_and_turn_about_its_axis(name):
    robot = MACHINES[name]
    pose, _, _ = states(robot, 20)
    points = joint_points(robot, pose)
    angle = pose[:, -1] if robot.platform.turns else np.zeros(20)
    turn = Rotation.from_rotvec(np.multiply.outer(angle, robot.platform.axis)).as_matrix()
    frame = np.array(robot.platform.frame)
    np.testing.assert_allclose(points.axes, np.einsum("bij,kj->bki", turn, frame), atol=1e-14)
    s0, t0 = (np.array([getattr(leg, key) for leg in robot.legs]) for key in POINT)
    hinges = points.reference[:, None]
    if robot.platform.slides:
        hinges = hinges + np.multiply.outer(angle, s0 @ frame)
    else:
        hinges = hinges + s0 @ points.axes
    np.testing.assert_allclose(points.platform_points, hinges + t0, atol=1e-14)
    np.testing.assert_allclose(points.tool - points.reference, robot.platform.tool @ points.axes)

    # Every place where a leg or a hinge is, is a hub or a corner of a part, and nothing else is.
    places = np.concatenate([hinges, hinges + t0] if robot.platform.turns else [hinges + t0], 1)
    first, *others = points.parts
    np.testing.assert_array_equal(first.hub, points.reference)
    known = np.concatenate(
        [part.corners for part in points.parts] + [part.hub[:, None] for part in points.parts], 1
    )
    apart = np.abs(places[:, :, None] - known[:, None]).max(axis=-1)
    assert apart.min(axis=2).max() < 1e-14
    corners = sum(part.corners.shape[1] for part in points.parts)
    assert apart[:, :, :corners].min(axis=1).max(initial=0.0) < 1e-14
    for part in others:
        still = part.corners - part.hub[:, None]
        np.testing.assert_allclose(still, np.broadcast_to(still[0], still.shape), atol=1e-14)


def test_the_parts_of_articulated_platforms():
    found = {
        name: [part.corners.shape[0] for part in joint_points(MACHINES[name], home(name)).parts]
        for name in ("quadrupteron", "delta-4", "par4", "five-bar")
    }
    # A bar of a Par4 leads to two legs; the plate of a Delta does not turn with its tool.
    assert found == {"quadrupteron": [4], "delta-4": [0, 3], "par4": [2, 2, 2], "five-bar": [0]}


def test_corners_go_round_the_platform():
    (part,) = joint_points(MECHANISMS["quadrupteron"], np.zeros(4)).parts
    first = int(part.corners[:, 0].argmax())
    round_from_x = np.roll(part.corners, -first, axis=0)
    np.testing.assert_allclose(
        round_from_x, 0.04 * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]), atol=1e-15
    )


@pytest.mark.parametrize("shape", BATCH_SHAPES)
def test_joint_points_take_batches(shape):
    robot = MECHANISMS["quadrupteron"]
    pose = np.random.default_rng(1).uniform(-0.05, 0.05, (*shape, 4))
    points = joint_points(robot, pose)
    assert points.chain.shape == (*shape, 4, 5, 3)
    assert points.platform_points.shape == (*shape, 4, 3)
    assert points.axes.shape == (*shape, 3, 3)
    assert points.reference.shape == (*shape, 3)
    assert points.coordinates.shape == (*shape, 4)


def test_joint_points_out_of_reach_are_refused():
    with pytest.raises(pteron.UnreachablePose, match="leg 1 misses it"):
        joint_points(MECHANISMS["tripteron"], [[0.0, 0.0, 0.0], [0.0, 9.0, 0.0]])
