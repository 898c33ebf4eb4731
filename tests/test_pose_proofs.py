"""Every pose of joint coordinates, proved by intervals: what is listed, and what is left open."""

import numpy as np
import pytest
import tilting
from mechanisms import CATALOG, TILTED, gated, random_machine, several
from test_multipteron import drawn

import pteron
from pteron.errors import DataError, ModelError, PteronError
from pteron.kernels import numeric
from pteron.kernels.programs import numeric_program
from pteron.workspace import proved_poses
from pteron.workspace.enclosing import enclosing_box

LOADED = CATALOG | TILTED
FIVE = "PRUR", "RPUR", "five freedoms, mixed"


def some_joints(name, seed=0):
    """Return a machine of the catalog, a pose in reach and its joint coordinates."""
    robot = LOADED[name]
    (pose,) = pteron.random_poses(robot, 1, seed=seed, type_i=0.05)
    return robot, pose, pteron.inverse_kinematics(robot, pose)


def expect_same(robot, proved, listed):
    """Assert that two lists of poses are the same, in whatever order, up to full turns."""
    listed = listed[np.isfinite(listed).all(axis=-1)]
    assert len(proved) == len(listed)
    away = np.where(
        robot.wraps,
        np.abs(np.angle(np.exp(1j * (proved[:, None] - listed)))),
        np.abs(proved[:, None] - listed),
    ).max(axis=-1)
    assert (away.min(axis=0) < 1e-8).all()
    assert (away.min(axis=1) < 1e-8).all()


SMALL = {"quadrupteron", "3-rrr", "delta", "hexapteron", "agile-eye", "ankle-offset", "3-upu"}
QUICK = SMALL | {"3-prr", "3-rpr", "five-bar", "h4", "linear-delta", "orthoglide", "par4"}
QUICK |= {"ankle", "quadrupteron-oblique", "spherical-3-rrr", "tripteron", "wrist", "stewart"}


@pytest.mark.parametrize("all_branches", [False, True])
@pytest.mark.parametrize("name", gated(sorted(QUICK - {"h4"}), SMALL))
def test_in_all_reach_it_is_the_list_of_direct_kinematics(name, all_branches):
    robot, _, joints = some_joints(name)
    proved = proved_poses(robot, joints, all_branches=all_branches)
    assert proved.is_complete
    expect_same(
        robot, proved.poses, pteron.direct_kinematics(robot, joints, all_branches=all_branches)
    )


@pytest.mark.parametrize(
    ("name", "seed", "share"),
    several(
        [("PRUR", 0, 0.2), ("RPUR", 1, 0.2), *((name, k, 1.0) for name in FIVE for k in range(5))],
        [("PRUR", 0, 0.2), ("RPUR", 1, 0.2)],
    ),
)
def test_poses_of_five_freedoms_about_one_are_proved(name, seed, share):
    robot, home = drawn(name, seed)
    pose = tilting.states(robot, home, 1, seed)[0][0]
    joints = pteron.inverse_kinematics(robot, pose)
    size = np.mean([leg.size for leg in robot.legs])
    half = share * np.where(robot.platform.angular, np.radians(30.0), 0.2 * size)
    box = np.array([pose - 0.9 * half, pose + 1.1 * half])
    proved = proved_poses(robot, joints, box)
    assert proved.is_complete
    assert np.abs(proved.poses - pose).max(axis=-1).min() < 1e-8
    np.testing.assert_allclose(
        pteron.inverse_kinematics(robot, proved.poses) - joints, 0.0, atol=1e-7
    )
    listed = pteron.direct_kinematics(robot, joints)
    expect_same(robot, proved.poses, listed[((listed > box[0]) & (listed < box[1])).all(axis=-1)])


def test_joints_that_no_pose_has_are_proved_to_have_none():
    robot, _, joints = some_joints("delta")
    box = [[-0.4, -0.4, -1.3], [0.4, 0.4, -0.4]]
    assert len(proved_poses(robot, joints, box).poses) <= 1
    far = proved_poses(
        robot, [joints[0] + np.pi, *joints[1:]], [[-0.1, -0.1, -0.7], [0.1, 0.1, -0.6]]
    )
    assert far.is_complete
    assert far.poses.shape == (0, 3)


def test_a_pose_on_the_wall_between_two_halves_is_one():
    robot, pose, joints = some_joints("3-rrr")
    half = np.array([0.05, 0.05, 0.3])
    proved = proved_poses(robot, joints, [pose - half, pose + half])
    expect_same(robot, proved.poses, pose[None])


def test_a_singular_pose_is_left_open():
    robot = LOADED["3-rpr"]
    near = pteron.workspace.nearest_singularities(robot, robot.home or [0.0, 0.0, 0.0])
    singular = next(at.pose for at in near if at.kind == "II")
    joints = pteron.inverse_kinematics(robot, singular)
    half = np.array([0.02, 0.02, 0.1])
    proved = proved_poses(robot, joints, [singular - half, singular + half])
    assert not proved.is_complete
    low, high = proved.undecided[:, 0], proved.undecided[:, 1]
    assert ((low <= singular + 1e-4) & (singular - 1e-4 <= high)).all(axis=-1).any()


def test_a_search_that_ends_early_says_so():
    robot, _, joints = some_joints("stewart")
    proved = proved_poses(robot, joints, most_boxes=100)
    assert not proved.is_complete


@pytest.mark.parametrize(
    ("name", "joints", "box", "error", "message"),
    [
        ("delta", [[0.1, 0.1, 0.1]] * 2, None, DataError, "joints: one row of 3 is expected"),
        ("delta", [0.1, 0.1, np.nan], None, DataError, "finite"),
        ("delta", [0.1] * 3, [[0, 0, 0]], DataError, r"shape \(2, 3\)"),
        ("delta", [0.1] * 3, [[0, 0, 0], [0, 1, 1]], DataError, "not below"),
        ("par4", [0.1] * 4, [[0, 0, 0, 0], [0, 1, 1, np.inf]], DataError, "finite"),
        ("delta-4", [0.1] * 4, None, ModelError, "box: missing"),
        ("3-rrr-point", [0.1] * 3, None, ModelError, "3 legs for 2 coordinates"),
    ],
)
def test_nonsense_is_refused_in_a_line(name, joints, box, error, message):
    with pytest.raises(PteronError, match=message) as raised:
        proved_poses(name, joints, box)
    assert isinstance(raised.value, error)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("name", ["pentapteron", "5-rpur", "agile-eye", "stewart", "3-rrr", "h4"])
def test_closures_vanish_at_poses_and_nowhere_else(name):
    robot, pose, joints = some_joints(name, 1)
    for errors in numeric(robot, "closure_errors")(joints, pose)[:2]:
        assert np.abs(errors).max() < 1e-12
    off = pose + 1e-3
    for errors in numeric(robot, "closure_errors")(joints, off)[:2]:
        assert np.abs(errors).min() > 1e-9 * np.abs(errors).max()
    assert [port.name for port in numeric_program(robot, "closure_errors").outputs] == [
        "errors",
        "any_branch",
    ]


def test_the_box_about_a_sliding_platforms_reach_grows_with_its_angle():
    # Its halves part by as much as phi says, while a turned point stays as far from the center.
    slides = random_machine(5, "RRRRI")
    assert slides.platform.slides
    for robot, grows in ((slides, True), (LOADED["quadrupteron"], False)):
        phi = np.where(robot.platform.angular, 1.0, 0.0)
        sides = [np.ptp(enclosing_box(robot, -half * phi, half * phi), axis=0) for half in (3, 4)]
        assert (sides[1] > sides[0] + 1e-3).any() == grows
