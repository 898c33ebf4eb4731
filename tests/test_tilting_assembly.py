"""All poses of joint coordinates of machines whose platforms tilt."""

from functools import lru_cache

import numpy as np
import pytest
import tilting
from mechanisms import gated, scaled
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import pteron
from pteron.bodies.inertia import RodInertia, SpatialInertia
from pteron.errors import SingularPose
from pteron.kernels import numeric
from pteron.legs import UPS
from pteron.platforms import Platform

CASES = {
    "3T3R": ("3T3R", ("UPS", "PSS", "RSS"), "rpy"),
    "xyz": ("3T3R", ("UPS",), "xyz"),
    "3R": ("3R", ("RSS",), "xyz"),
    "2R": ("2R", ("UPS", "PSS"), "rpy"),
    "1T2R": ("1T2R", ("RPS", "PRS", "RRS"), "rpy"),
}

# P. Dietmaier, The Stewart-Gough platform of general geometry can have 40 real postures, 1998.
BASE = [
    (0.0, 0.0, 0.0),
    (1.107915, 0.0, 0.0),
    (0.549094, 0.756063, 0.0),
    (0.735077, -0.223935, 0.525991),
    (0.514188, -0.526063, -0.368418),
    (0.590473, 0.094733, -0.205018),
]
TOP = [
    (0.0, 0.0, 0.0),
    (0.542805, 0.0, 0.0),
    (0.956919, -0.528915, 0.0),
    (0.665885, -0.353482, 1.402538),
    (0.478359, 1.158742, 0.107672),
    (-0.137087, -0.235121, 0.353913),
]
LENGTHS = [1.0, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071]


@lru_cache
def drawn(name):
    motion, kinds, angles = CASES[name]
    robot, home = tilting.machine(motion, kinds, 11, angles)
    return robot, tilting.states(robot, home, 6)[0]


def hexapod(base, top):
    rods = (RodInertia.of_body(1.0, (x,), 0.1) for x in (0.1, -0.1))
    upper, lower = rods
    legs = tuple(
        UPS(tuple(r), tuple(s), upper, lower, (0.1, 5.0)) for r, s in zip(base, top, strict=True)
    )
    body = SpatialInertia(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    return pteron.Manipulator("hexapod", Platform("3T3R", body), legs, (0.0, 0.0, -9.81))


def counts(poses):
    return np.isfinite(poses).all(axis=-1).sum(axis=-1)


def same(one, other, angular):
    apart = one - other
    apart[..., angular] = (apart[..., angular] + np.pi) % (2.0 * np.pi) - np.pi
    return np.abs(apart).max(axis=-1)


@pytest.mark.parametrize("name", gated(CASES, ["3T3R"]))
def test_direct_inverts_inverse(name):
    robot, x = drawn(name)
    joints = pteron.inverse_kinematics(robot, x)
    poses = pteron.direct_kinematics(robot, joints)
    angular = robot.platform.angular
    whole = ~np.isnan(poses[..., 0])
    back = pteron.inverse_kinematics(robot, poses[whole])
    given = np.broadcast_to(joints[:, None], (*whole.shape, joints.shape[-1]))[whole]
    np.testing.assert_allclose(np.exp(1j * back), np.exp(1j * given), atol=1e-10)
    assert (np.abs(poses[whole][:, angular]) <= np.pi).all()
    mode = pteron.kinematics.assembly_mode(robot, x)
    rows = np.take_along_axis(poses, mode[:, None, None], axis=1)[:, 0]
    assert (same(rows, x, angular) < 1e-10).all()
    for side in (poses[..., -1], poses[..., 0]):
        assert (np.diff(np.isnan(side).astype(int), axis=-1) >= 0).all()
    assert (np.diff(poses[..., -1], axis=-1)[whole[:, 1:]] > -1e-8).all()


@pytest.mark.parametrize("name", gated(CASES, ["3T3R"]))
def test_poses_are_counted_another_way(name):
    """By Newton's steps from many poses."""
    robot, x = drawn(name)
    joints = pteron.inverse_kinematics(robot, x[0])
    poses = pteron.direct_kinematics(robot, joints, all_branches=True)
    step = numeric(robot, "newton_step")
    rng = np.random.default_rng(1)
    found = []
    lengths = len(robot.platform.lengths)
    at = np.concatenate(
        [
            x[0, :lengths] + 1.5 * rng.normal(size=(400, lengths)),
            rng.uniform(-np.pi, np.pi, (400, len(robot.platform.angles))),
        ],
        axis=-1,
    )
    assert np.isnan(step(joints, np.full_like(x[0], np.nan))[1])
    with np.errstate(all="ignore"):
        for _ in range(40):
            at = step(joints, at)[0]
    at = at[np.isfinite(at).all(axis=-1)]
    good = at[step(joints, at)[1] < 1e-12]
    for pose in good:
        place, axes = robot.platform.placement(pose)
        known = np.append(place, axes)
        if not any(np.abs(known - other).max() < 1e-6 for other in found):
            found.append(known)
    assert len(found) == counts(poses)


@pytest.mark.parametrize("name", gated(["ankle", "wrist", "ball-table"], ["ankle"]))
@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_a_machine_of_another_size_has_the_same_poses(name, factor):
    """In mm or km; of a 2R platform the angle of its axes has no size."""
    robot = pteron.load(name)
    other, scale = scaled(robot, factor), np.where(robot.platform.angular, 1.0, factor)
    for pose in pteron.random_poses(robot, 4, seed=1):
        modes, theirs = (
            pteron.kinematics.assembly_modes(machine, pteron.inverse_kinematics(machine, at))
            for machine, at in ((robot, pose), (other, pose * scale))
        )
        modes, theirs = (part[np.isfinite(part).all(axis=-1)] for part in (modes, theirs))
        assert len(modes) == len(theirs) > 0
        np.testing.assert_allclose(theirs / scale, modes, rtol=0, atol=1e-9)


def test_dietmaiers_machine_has_forty_poses():
    poses = pteron.direct_kinematics(hexapod(BASE, TOP), LENGTHS)
    assert counts(poses) == 40
    back = pteron.inverse_kinematics(hexapod(BASE, TOP), poses)
    np.testing.assert_allclose(back, np.broadcast_to(LENGTHS, back.shape), atol=1e-12)


@pytest.mark.parametrize("kind", gated(["general", "plane", "6-3", "turned"], ["6-3"]))
def test_every_regular_pose_is_found(kind):
    """Real poses come in pairs, and no more than the machine may have."""
    rng = np.random.default_rng(4)
    base, top = rng.normal(size=(6, 3)), 0.6 * rng.normal(size=(6, 3))
    if kind == "plane":
        base[:, 2] = top[:, 2] = 0.0
    if kind == "6-3":
        top = np.roll(np.repeat(top[::2], 2, axis=0), 1, axis=0)
    pose = np.concatenate([rng.normal(size=3), rng.uniform(-1.0, 1.0, 3)])
    robot = hexapod(base.tolist(), top.tolist())
    if kind == "turned":
        turn = tilting.rotation(rng)
        still = robot
        robot = pteron.turned(robot, turn)
        joints = pteron.inverse_kinematics(still, pose)
        before = counts(pteron.direct_kinematics(still, joints))
        assert counts(pteron.direct_kinematics(robot, joints)) == before
        return
    poses = pteron.direct_kinematics(robot, pteron.inverse_kinematics(robot, pose))
    count = counts(poses)
    assert count % 2 == 0
    assert 2 <= count <= (16 if kind == "6-3" else 40)
    assert np.nanmin(same(poses, pose, robot.platform.angular)) < 1e-10
    if kind == "plane":  # each pose has its mirror image
        np.testing.assert_allclose(
            np.sort(poses[:count, 2]), np.sort(-poses[:count, 2]), atol=1e-10
        )


@pytest.mark.parametrize("name", gated(CASES, ["3R"]))
def test_joints_that_no_pose_has(name):
    robot, x = drawn(name)
    joints = pteron.inverse_kinematics(robot, x[0])
    none = joints.copy()
    none[0] = 6.0 * joints[0] if robot.legs[0].joint.unit == "m" else np.nan
    poses = pteron.direct_kinematics(robot, np.stack([none, joints]), on_failure="nan")
    assert np.isnan(poses[0]).all()
    assert counts(poses[1]) >= 1
    empty = pteron.direct_kinematics(robot, np.empty((0, len(robot.legs))))
    assert empty.shape == (0, *poses.shape[1:])


@pytest.mark.parametrize("name", gated(CASES, ["2R", "1T2R"]))
def test_a_motion_keeps_its_mode(name):
    robot, x = drawn(name)
    way = x[0] + np.linspace(0.0, 0.05, 12)[:, None] * np.ones(len(x[0]))
    joints = pteron.inverse_kinematics(robot, way)
    np.testing.assert_allclose(pteron.follow(robot, joints, way[0]), way, atol=1e-10)
    elbows = [leg.elbow for leg in robot.legs]
    assert (pteron.kinematics.working_mode(robot, way, joints) == elbows).all()


def test_two_poses_that_all_but_meet_are_told_apart():
    """Along joints that lead to a singular pose both modes are found until they meet."""
    robot, x = drawn("3R")
    joints = pteron.inverse_kinematics(robot, x[0])
    before = counts(pteron.direct_kinematics(robot, joints))
    share = np.linspace(1.0, 2.0, 501)[:, None]
    scaled = joints * np.where([True, False, False], share, 1.0)
    found = counts(pteron.direct_kinematics(robot, scaled, on_failure="nan"))
    assert before == found[0]
    assert (found % 2 == 0).all()  # none is lost before it meets another
    assert len(set(found.tolist())) > 1


def half_turned(shift, turn, rng):
    """Return the pose of a platform after a displacement's inverse and a half turn."""
    axis = tilting.unit(rng.normal(size=3))
    half = 2.0 * np.outer(axis, axis) - np.eye(3)
    place = 2.0 * (np.eye(3) - np.outer(axis, axis)) @ rng.normal(size=3)
    rotation = half @ turn.T
    return rotation, place - rotation @ shift


def moving_hexapod(kind, rng):
    """Return a hexapod, and a pose from which it moves with its rams held."""
    base, top = rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
    turn, shift = tilting.rotation(rng), rng.normal(size=3)
    rotation = tilting.rotation(rng)
    if kind == "line-symmetric":
        top = base[[3, 5, 4, 0, 2, 1]] @ turn.T + shift
        rotation, shift = half_turned(shift, turn, rng)
    elif kind == "translation":
        line = rng.normal(size=3)
        top = (base + np.outer(rng.normal(size=6), line)) @ rotation
    else:  # about the line of two guide points and two platform points, on which five legs end
        top = np.repeat(top[::2], 2, axis=0)
        rotation = Rotation.align_vectors(base[5:] - base[4], top[2:3] - top[0])[0].as_matrix()
        shift = base[4] + 0.3 * (base[5] - base[4]) - rotation @ top[0]
    robot = hexapod(base.tolist(), top.tolist())
    return robot, pteron.pose_of(robot, shift, rotation)


MOVING = ["line-symmetric", "translation", "about a line"]


@pytest.mark.parametrize("kind", gated(MOVING, MOVING[:1]))
def test_a_platform_that_moves_with_its_joints_held_has_no_list_of_poses(kind):
    rng = np.random.default_rng(8)
    robot, pose = moving_hexapod(kind, rng)
    told = pteron.kinematics.architecture(robot).self_motions
    assert [kind in text for text in told] == ([True] if kind != "about a line" else [])
    joints, at, along = pteron.inverse_kinematics(robot, pose), pose, np.zeros(6)
    for _ in range(40):
        axes = np.linalg.svd(pteron.jacobian(robot, at))[2]
        along = axes[-1] * (np.sign(axes[-1] @ along) or 1.0)
        at = at + 0.01 * along
        for _ in range(6):
            inverse = np.linalg.pinv(pteron.jacobian(robot, at), rcond=1e-4)
            at = at - inverse @ (pteron.inverse_kinematics(robot, at) - joints)
        assert np.abs(pteron.inverse_kinematics(robot, at) - joints).max() < 1e-12
    assert np.linalg.norm(at - pose) > 0.2
    other = pteron.inverse_kinematics(robot, pose + 0.1)
    with pytest.raises(SingularPose, match="self-motion") as caught:
        pteron.direct_kinematics(robot, np.stack([other, joints]))
    assert caught.value.index == (1,)
    assert counts(pteron.direct_kinematics(robot, other)) >= 2
    turned = pteron.turned(robot, tilting.rotation(rng))
    assert pteron.kinematics.architecture(turned).self_motions == told
    with pytest.raises(SingularPose, match="self-motion"):
        pteron.direct_kinematics(turned, joints)


def test_a_pose_that_is_singular_but_alone_is_listed():
    robot, rng = hexapod(BASE, TOP), np.random.default_rng(2)
    start, way = rng.normal(size=(2, 6))

    def measure(share):
        return np.linalg.det(pteron.jacobian(robot, start + share * way))

    pose = start + brentq(measure, 0.0, 1.0, xtol=1e-16) * way
    poses = pteron.direct_kinematics(robot, pteron.inverse_kinematics(robot, pose))
    assert np.nanmin(np.linalg.norm((poses - pose)[:, :3], axis=-1)) < 1e-6
    assert pteron.kinematics.architecture(robot).self_motions == ()
