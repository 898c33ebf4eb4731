"""Poses to rotations and back, twists and velocities, against SciPy and differences."""

import numpy as np
import pytest
import tilting
from mechanisms import CATALOG, TILTED, gated
from scipy.spatial.transform import Rotation

import pteron
from pteron.errors import DataError, SingularPose

CASES = [("3T3R", "xyz"), ("3R", "rpy"), ("2R", "rpy"), ("1T2R", "rpy"), "quadrupteron-oblique"]
MORE = [("3T3R", "rpy"), ("3R", "xyz"), "tripteron", "3-rpr", "five-bar"]
SPREAD = {"3T3R": 1.4, "3R": 1.4, "2R": 2.0, "1T2R": 0.2}


@pytest.fixture(params=gated([*CASES, *MORE], CASES), ids=str)
def drawn(request):
    """Return a machine, poses anywhere, which no leg need reach, and velocities."""
    rng = np.random.default_rng(6)
    if isinstance(request.param, str):
        robot = CATALOG[request.param]
        poses = rng.uniform(-1.0, 1.0, (20, robot.freedom))
    else:
        motion, angles = request.param
        kind = "RPS" if motion == "1T2R" else "UPS"
        robot, home = tilting.machine(motion, (kind,), 3, angles)
        poses = home + SPREAD[motion] * rng.uniform(-1.0, 1.0, (20, robot.freedom))
    return robot, poses, rng.normal(size=poses.shape)


def test_positions_and_rotations_are_poses_and_back(drawn):
    robot, poses, _ = drawn
    position = pteron.kinematics.position_of(robot, poses)
    matrix = pteron.rotation_of(robot, poses)
    np.testing.assert_allclose(np.linalg.det(matrix), 1.0, atol=1e-13)
    turned = Rotation.from_matrix(matrix)
    quaternion = turned.as_quat(canonical=True)
    own = pteron.rotation_of(robot, poses, form="quaternion")
    # Either sign where the scalar vanishes.
    np.testing.assert_allclose(np.abs((own * quaternion).sum(-1)), 1.0, atol=1e-13)
    zero = Rotation.from_matrix(np.array(robot.platform.frame))
    azimuth, tilt, torsion = pteron.rotation_of(robot, poses, form="tilt-torsion").T
    turns = np.stack([azimuth, tilt, torsion - azimuth], axis=-1)
    again = (zero.inv() * Rotation.from_euler("ZYZ", turns)).as_matrix()
    np.testing.assert_allclose(again, matrix, atol=1e-13)
    for form, rotation in (
        ("matrix", matrix),
        ("quaternion", -3.0 * quaternion),
        ("tilt-torsion", np.stack([azimuth, tilt, torsion], axis=-1)),
    ):
        np.testing.assert_allclose(
            pteron.pose_of(robot, position, rotation, form=form), poses, atol=1e-12
        )


def test_twists_are_velocities_and_back(drawn):
    robot, poses, velocities = drawn
    found = pteron.twist(robot, poses, velocities)
    step = 1e-6
    ends = [poses + side * step * velocities for side in (1.0, -1.0)]
    (p1, p0), (r1, r0) = (
        [part(robot, end) for end in ends]
        for part in (pteron.kinematics.position_of, pteron.rotation_of)
    )
    turned = Rotation.from_matrix(r1 @ np.swapaxes(r0, -1, -2)).as_rotvec()
    np.testing.assert_allclose(found[:, :3], (p1 - p0) / (2 * step), atol=1e-8)
    np.testing.assert_allclose(found[:, 3:], turned / (2 * step), atol=1e-8)
    np.testing.assert_allclose(
        pteron.kinematics.velocity_of(robot, poses, found), velocities, atol=1e-11
    )
    near = pteron.random_poses(robot, 3) if not robot.platform.tilts else poses[:3]
    rows = pteron.kinematics.twist_jacobian(robot, near, on_failure="nan")
    rates = np.einsum("bij,bj->bi", rows, pteron.twist(robot, near, velocities[:3]))
    expected = pteron.jacobian(robot, near, on_failure="nan") @ velocities[:3, :, None]
    np.testing.assert_allclose(rates, expected[..., 0], atol=1e-11)


def test_what_a_motion_cannot_have_is_refused_with_by_how_much():
    wrist = tilting.machine("3R", ("UPS",), 3)[0]
    at, level = np.array(wrist.platform.center), np.array(wrist.platform.frame).T
    with pytest.raises(DataError, match=r"3R platform cannot have them: 0\.01 m from"):
        pteron.pose_of(wrist, at + np.array([0.0, 0.006, 0.008]), level)
    with pytest.raises(DataError, match=r"cannot move so at this pose: 0\.5 m/s are"):
        pteron.kinematics.velocity_of(wrist, [0.1, 0.2, 0.3], [0.0, 0.3, 0.4, 1.0, 2.0, 3.0])
    turned = Rotation.from_rotvec([0.0, 0.2, 0.0]).as_matrix()
    with pytest.raises(DataError, match=r"3T platform cannot have them: 0\.2 rad"):
        pteron.pose_of("tripteron", [0.0, 0.0, 0.0], turned)
    with pytest.raises(DataError, match=r"rotation\[1\]: no rotation"):
        pteron.pose_of(wrist, at, [level, level[:, ::-1]])
    table, ankle = TILTED["ball-table"], TILTED["ankle"]
    with pytest.raises(
        DataError, match=r"1T2R platform cannot have them: 0\.01 m from the nearest"
    ):
        pteron.pose_of(table, [0.0, 0.01, 0.12], np.eye(3))
    with pytest.raises(DataError, match=r"1T2R platform cannot move so .*: 0\.3 m/s are"):
        pteron.kinematics.velocity_of(table, [0.12, 0.0, 0.0], [0.3, 0.0, 0.1, 0.0, 0.0, 0.0])
    with pytest.raises(DataError, match=r"2R platform cannot have them: 0\.3 rad from"):
        pteron.pose_of(ankle, [0.0, 0.0, 0.0], [0.0, 0.0, 0.3], form="tilt-torsion")
    found = pteron.pose_of(wrist, [at, at + 1.0], level, on_failure="nan")
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()


def test_singular_angles_are_not_the_machines():
    robot, _ = tilting.machine("3R", ("UPS",), 3)
    pose = np.array([0.2, np.pi / 2, 0.3])
    center = robot.platform.center
    found = pteron.pose_of(robot, center, pteron.rotation_of(robot, pose))
    np.testing.assert_allclose(found, [0.0, np.pi / 2, 0.1], atol=1e-12)
    assert np.isfinite(pteron.inverse_dynamics(robot, pose, 0 * pose, 0 * pose)).all()
    for call in (
        lambda: pteron.kinematics.velocity_of(robot, pose, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
        lambda: pteron.forward_dynamics(robot, pose, 0 * pose, 0 * pose),
    ):
        with pytest.raises(SingularPose, match="angles are singular where pitch is") as caught:
            call()
        assert caught.value.kind == "angles"
