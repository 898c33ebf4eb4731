"""Position, velocity and acceleration: closed legs, inverses and differences, for every machine."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from differences import along, gradient
from hypothesis import given, settings, strategies as st
from mechanisms import CATALOG, MECHANISMS, NEAREST, gated, in_turn, random_machine, states
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.stats import ks_2samp

import pteron
from pteron.errors import DataError, ModelError, SingularPose

EVERY = in_turn(
    MECHANISMS,
    (
        *("quadrupteron", "quadrupteron-oblique +--+", "tripteron-oblique", "delta"),
        *("tripteron on a wall", "random 3T1R 0", "random RRR 0", "random PRR 0"),
    ),
)
TURNING = [name for name, robot in MECHANISMS.items() if robot.platform.turns]
COUNT = 100


@lru_cache
def bent_poses(robot, count=20, seed=3):
    """Return poses far enough from singular ones for differences; see `differences.STEP`."""
    return pteron.random_poses(robot, count, seed=seed, type_i=0.5, type_ii=0.15)


def platform_points(robot, poses):
    """Return c = p + R(phi) s0 (..., n, 3), by rotation matrices."""
    s0 = np.array([leg.platform_point for leg in robot.legs])
    frame = np.column_stack(robot.platform.frame)
    phi = poses[..., 3] if robot.platform.turns else np.zeros(poses.shape[:-1])
    turn = np.zeros((*phi.shape, 3, 3))
    turn[..., 0, 0] = turn[..., 1, 1] = np.cos(phi)
    turn[..., 1, 0], turn[..., 0, 1] = np.sin(phi), -np.sin(phi)
    turn[..., 2, 2] = 1.0
    return poses[..., None, :3] + s0 @ np.swapaxes(frame @ turn, -1, -2)


def column(robot, what):
    return np.array([getattr(leg, what) for leg in robot.legs])


def inner(a, b):
    return np.multiply(a, b).sum(axis=-1)


def twist(robot, velocities):
    """Return the platform's twist (omega, v) about P, (..., 6)."""
    found = np.zeros((*velocities.shape[:-1], 6))
    found[..., 3:] = velocities[..., :3]
    if robot.platform.turns:
        found[..., :3] = velocities[..., 3:] * robot.platform.axis
    return found


def apart(found, poses):
    """Return the difference of poses, that of angles within (-pi, pi]."""
    difference = found - poses
    difference[..., 3:] = np.angle(np.exp(1j * difference[..., 3:]))
    return difference


# Position.


@EVERY
def test_the_links_close_every_leg_on_the_side_of_sigma(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, COUNT)
    q = pteron.inverse_kinematics(robot, poses)
    upper, lower = pteron.kinematics.link_vectors(robot, poses)
    base, d = column(robot, "guide_point"), column(robot, "direction")
    for i, leg in enumerate(robot.legs):
        if leg.joint.unit == "m":
            base = (
                base
                + np.where(np.arange(robot.freedom)[:, None] == i, q[..., i, None, None], 0.0)
                * leg.e
            )
    np.testing.assert_allclose(base + upper + lower, platform_points(robot, poses), atol=2e-15)
    for vectors, length in ((upper, "upper_length"), (lower, "lower_length")):
        lengths = np.broadcast_to(column(robot, length), vectors.shape[:-1])
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=-1), lengths, rtol=2e-14)
    np.testing.assert_allclose(inner(upper, d), 0.0, atol=1e-15)
    assert (column(robot, "elbow") * inner(d, np.cross(upper + lower, upper)) > 0).all()
    for i, leg in enumerate(robot.legs):
        if leg.joint.unit == "rad":
            a, b = np.array(leg.zero_direction), np.cross(leg.direction, leg.zero_direction)
            angle = np.arctan2(upper[:, i] @ b, upper[:, i] @ a)
            np.testing.assert_allclose(q[:, i], angle, atol=1e-14)


@EVERY
def test_the_points_on_the_joint_axes_are_the_ends_of_the_links(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, 5)
    points = pteron.compile(robot, "joint_points")(poses)
    upper, lower = pteron.kinematics.link_vectors(robot, poses)
    ends = platform_points(robot, poses)
    for i, leg in enumerate(robot.legs):
        own = points[:, i][:, ~np.isnan(points[0, i]).any(axis=-1)]
        np.testing.assert_allclose(own[:, -1], ends[:, i], atol=1e-15)
        start = 0 if leg.joint.unit == "rad" else 1
        np.testing.assert_allclose(own[:, start + 1] - own[:, start], upper[:, i], atol=1e-15)
        np.testing.assert_allclose(ends[:, i] - own[:, start + 1], lower[:, i], atol=2e-15)


def test_a_crank_has_the_angle_nearest_to_the_middle_of_its_limits():
    robot = CATALOG["delta"]
    poses, _, _ = states(robot, 20)
    expected = pteron.inverse_kinematics(robot, poses)
    for turns in (-2, 1, 3):
        limits = tuple(2 * np.pi * turns + np.array([-1.0, 1.0]))
        legs = (replace(robot.legs[0], limits=limits), *robot.legs[1:])
        moved = replace(robot, legs=legs)
        found = pteron.inverse_kinematics(moved, poses)
        np.testing.assert_allclose(found - expected, [[2 * np.pi * turns, 0, 0]] * 20, atol=1e-14)
        back = pteron.direct_kinematics(moved, expected)
        assert (np.nanmin(np.abs(back - poses[:, None]).max(-1), axis=-1) < 1e-13).all()


@pytest.mark.parametrize("name", gated(NEAREST, ["delta", "tripteron-oblique"]))
def test_every_choice_of_elbows_is_another_working_mode(name):
    robot = CATALOG[name]
    modes = pteron.working_modes(robot)
    poses, _, _ = states(robot, 5)
    uppers = [pteron.kinematics.link_vectors(mode, poses)[0] for mode in modes]
    assert len(modes) == 2 ** len(robot.legs)
    assert robot in modes
    for i, mode in enumerate(modes):
        assert replace(mode, legs=robot.legs) == robot
        for other in uppers[:i]:
            # Measure 0.3 leaves R2 over a centimetre from its mirror image.
            assert np.abs(uppers[i] - other).max(axis=(-2, -1)).min() > 0.01


@EVERY
def test_direct_kinematics_inverts_inverse_kinematics(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, COUNT)
    joints = pteron.inverse_kinematics(robot, poses)
    found = pteron.direct_kinematics(robot, joints)
    sliders = all(leg.joint.unit == "m" for leg in robot.legs)
    assert found.shape == (COUNT, 1 if sliders and robot.freedom == 3 else 2, robot.freedom)
    distance = np.abs(found - poses[:, None]).max(axis=-1)
    np.testing.assert_allclose(np.nanmin(distance, axis=-1), 0.0, atol=1e-12)
    real = ~np.isnan(found).any(axis=-1)
    assert (real == ~np.isnan(found).all(axis=-1)).all()
    back = pteron.inverse_kinematics(robot, found[real])
    expected = np.broadcast_to(joints[:, None], (*real.shape, robot.freedom))[real]
    # The other pose may be near a singular one, which magnifies rounding.
    np.testing.assert_allclose(back, expected, atol=1e-9)
    np.testing.assert_allclose(pteron.direct_kinematics(robot, joints, on_failure="raise"), found)


def test_all_branches_are_the_poses_of_all_working_modes():
    robot = CATALOG["delta"]
    poses, _, _ = states(robot, COUNT)
    joints = pteron.inverse_kinematics(robot, poses)
    own = pteron.direct_kinematics(robot, joints)
    every = pteron.direct_kinematics(robot, joints, all_branches=True)
    assert np.isnan(own).any()
    assert np.isfinite(every).all(), "where one sphere's end is real, so is the other's"
    assert (every[:, 0, 2] < every[:, 1, 2]).all(), "in the order of z"
    modes = pteron.working_modes(robot)
    for k in (0, 1):
        back = np.array(
            [pteron.inverse_kinematics(m, every[:, k], on_failure="nan") for m in modes]
        )
        assert (np.nanmin(np.abs(back - joints).max(-1), axis=0) < 1e-9).all()


@pytest.mark.parametrize("name", gated(TURNING, ["quadrupteron-oblique +--+", "random 3T1R 0"]))
def test_each_column_of_direct_kinematics_is_one_assembly_mode(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, COUNT)
    measure = pteron.compile(robot, "type_ii")
    mode = np.where(measure(poses) > 0, 0, 1)
    assert set(mode) == {0, 1}, "the poses must be of both modes"
    found = pteron.direct_kinematics(robot, pteron.inverse_kinematics(robot, poses))
    np.testing.assert_allclose(found[np.arange(COUNT), mode], poses, atol=1e-13)
    signs = []
    for branch, sign in ((0, 1), (1, -1)):
        real = found[:, branch][~np.isnan(found[:, branch]).any(axis=-1)]
        assert len(real) > 0
        assert (sign * measure(real) > 0).all()
        signs.append(set(np.sign(np.linalg.det(pteron.jacobian(robot, real)))))
    assert signs in ([{1.0}, {-1.0}], [{-1.0}, {1.0}])
    assert (np.abs(found[..., 3][~np.isnan(found[..., 3])]) <= np.pi).all()


def test_half_a_turn_is_pi_and_not_minus_pi():
    robot = CATALOG["quadrupteron"]
    positions = states(robot, 400)[0][:, :3]
    poses = np.column_stack([positions, np.full(400, np.pi)])
    joints = pteron.inverse_kinematics(robot, poses, on_failure="nan")
    in_reach = ~np.isnan(joints[:, 0])
    angles = pteron.direct_kinematics(robot, joints[in_reach])[..., 3]
    assert in_reach.sum() > 3
    assert (angles > -np.pi).all()
    # The closures' rounding, over the platform points' 0.04 m.
    np.testing.assert_allclose(np.abs(angles).max(axis=-1), np.pi, atol=1e-14)


@pytest.mark.parametrize("shift", [0.0, 1e3])
@pytest.mark.parametrize("name", ["quadrupteron", "quadrupteron turned", "random 3T1R 0"])
def test_the_assembly_modes_meet_wherever_the_base_frame_lies(name, shift):
    offset = shift * np.array([0.6, -1.0, 0.7])
    legs = tuple(
        replace(leg, guide_point=tuple(np.array(leg.guide_point) + offset))
        for leg in MECHANISMS[name].legs
    )
    robot = replace(MECHANISMS[name], legs=legs)
    poses = pteron.random_poses(robot, 100, seed=7, type_ii=0.0)
    for angle in pteron.kinematics.singular_orientations(robot):
        for away in (0.0, 1e-8, -1e-8):
            poses[:, 3] = angle + away
            joints = pteron.inverse_kinematics(robot, poses, on_failure="nan")
            in_reach = ~np.isnan(joints[:, 0])
            assert in_reach.any()
            found = pteron.direct_kinematics(robot, joints[in_reach])
            # A double root keeps half of the digits, of the sizes that the closures add up.
            tolerance = 2e-6 * np.sqrt((0.1 + shift) / 0.1)
            np.testing.assert_allclose(apart(found, poses[in_reach, None]), 0.0, atol=tolerance)


@EVERY
def test_direct_kinematics_is_nan_where_no_pose_is(name):
    robot = MECHANISMS[name]
    joints = pteron.inverse_kinematics(robot, states(robot, 10)[0])
    far = joints.copy()
    if robot.platform.turns:
        # Along the null vector no translation helps, and the platform's points are 0.1 m long.
        rows = column(robot, "direction")
        far += np.linalg.svd(rows / inner(rows, column(robot, "e"))[:, None])[0][:, 3]
    else:
        # Out of the others' reach, or at an angle with which other joints are unlike these.
        far[:, 0] += 5.0 if robot.legs[0].joint.unit == "m" else 3.0
    found = pteron.direct_kinematics(robot, far, on_failure="nan")
    if robot.legs[0].joint.unit == "m":
        assert np.isnan(found).all()
    back = pteron.inverse_kinematics(robot, found, on_failure="nan")
    real = ~np.isnan(found).any(axis=(-1))
    turn = np.where([leg.joint.unit == "rad" for leg in robot.legs], 2 * np.pi, np.inf)
    with np.errstate(invalid="ignore"):
        error = (back - far[:, None])[real]
        error -= np.where(np.isfinite(turn), turn * np.round(error / turn), 0.0)
    np.testing.assert_allclose(error, 0.0, atol=1e-6)


@settings(deadline=None, derandomize=True, max_examples=8)
@given(st.integers(0, 10**6), st.sampled_from(["PPPP", "PPP", "RRR", "PRP", "RPR"]))
def test_direct_kinematics_of_machines_with_nothing_special(seed, kinds):
    robot = random_machine(seed, kinds)
    try:
        poses = pteron.random_poses(robot, 3, seed=seed, type_i=0.3, type_ii=0.2)
    except ModelError:
        return
    found = pteron.direct_kinematics(robot, pteron.inverse_kinematics(robot, poses))
    distance = np.nanmin(np.abs(found - poses[:, None]).max(axis=-1), axis=-1)
    # The closures' rows may lean on each other: their condition number is up to about 100.
    np.testing.assert_allclose(distance, 0.0, atol=1e-11)


# Velocity and acceleration.


@EVERY
def test_the_jacobian_against_differences_of_inverse_kinematics(name):
    robot = MECHANISMS[name]
    poses = bent_poses(robot)
    found = gradient(lambda x: pteron.inverse_kinematics(robot, x), poses)
    # Rounding of the joints (1e-16) over the step (5e-5); a crank's angle is rounded 10 times more.
    tolerance = 3e-11 * max(1.0, np.abs(found).max())
    np.testing.assert_allclose(pteron.jacobian(robot, poses), found, atol=tolerance)


@EVERY
def test_the_jacobian_by_a_wrench_reciprocal_to_the_passive_joints(name):
    """Eq. (9): what no passive joint takes up, the actuated one must hold."""
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, 20)
    J, screws = pteron.jacobian(robot, poses), pteron.kinematics.joint_screws(robot, poses)
    twists = twist(robot, np.eye(robot.freedom))
    for row, chain in zip(
        J.reshape(-1, robot.freedom), screws.reshape(-1, *screws.shape[2:]), strict=True
    ):
        actuated, *passive = chain[~np.isnan(chain).any(axis=-1)]
        sizes, rows = np.linalg.svd(np.array(passive))[1:]
        reciprocal = rows[int((sizes > 1e-6).sum()) :]
        wrench = reciprocal.T @ (reciprocal @ actuated)
        np.testing.assert_allclose(
            row, twists @ wrench / (wrench @ actuated), rtol=0, atol=1e-12 * np.abs(row).max()
        )


@EVERY
def test_joint_screws_times_rates_are_the_platforms_twist_for_every_leg(name):
    robot = MECHANISMS[name]
    poses, velocities, _ = states(robot, COUNT)
    screws = pteron.kinematics.joint_screws(robot, poses)
    rates = pteron.kinematics.joint_rates(robot, poses, velocities)
    joints = np.concatenate([rates.actuated[..., None], rates.passive], axis=-1)
    lacking = np.isnan(screws).any(axis=-1)
    np.testing.assert_array_equal(np.isnan(joints), lacking)
    found = np.einsum("bnj,bnjc->bnc", np.where(lacking, 0.0, joints), np.nan_to_num(screws))
    expected = np.broadcast_to(twist(robot, velocities)[:, None], found.shape)
    # Rates reach 1e2 rad/s, through the type-I measure.
    np.testing.assert_allclose(found, expected, atol=1e-12)
    J = pteron.jacobian(robot, poses)
    np.testing.assert_allclose(
        rates.actuated, (J @ velocities[..., None])[..., 0], rtol=1e-12, atol=1e-13
    )


@EVERY
def test_link_jacobians_against_differences_of_points_and_links(name):
    robot = MECHANISMS[name]
    poses = bent_poses(robot)
    jacobians = pteron.kinematics.link_jacobians(robot, poses)
    starts = [leg.joint.unit == "m" for leg in robot.legs]

    def base_points(x):
        points = pteron.compile(robot, "joint_points")(x)
        return points[..., np.arange(len(starts)), np.array(starts, dtype=int), :]

    points = base_points, lambda x: platform_points(robot, x)
    for which, (matrix, point) in enumerate(zip(jacobians, points, strict=True)):
        # Differences of coordinates, 0.5 m and rounded, over the step 5e-5.
        np.testing.assert_allclose(matrix[..., :3, :], gradient(point, poses), atol=1e-10)
        links = pteron.kinematics.link_vectors(robot, poses)[which]
        slope = gradient(lambda x, k=which: pteron.kinematics.link_vectors(robot, x)[k], poses)
        omega = matrix[..., 3:, :]
        turned = np.swapaxes(np.cross(np.swapaxes(omega, -1, -2), links[..., None, :]), -1, -2)
        # Magnified by 1 / measure at the elbow.
        np.testing.assert_allclose(turned, slope, atol=1e-9)
        # A link turns about d alone, a rod across itself.
        for i, leg in enumerate(robot.legs):
            rod = which == 1 and leg.joint.unit == "rad"
            lost = np.array(links[:, i, None]) if rod else omega[:, i].swapaxes(-1, -2)
            other = omega[:, i].swapaxes(-1, -2) if rod else leg.direction
            size = inner(lost, other) if rod else np.cross(lost, other)
            np.testing.assert_allclose(size, 0.0, atol=1e-12)


@EVERY
def test_rates_of_links_are_those_of_their_jacobians(name):
    robot = MECHANISMS[name]
    poses, velocities, _ = states(robot, COUNT)
    rates = pteron.kinematics.joint_rates(robot, poses, velocities)
    d = column(robot, "direction")
    for matrix, found in zip(
        pteron.kinematics.link_jacobians(robot, poses),
        (rates.upper_links, rates.lower_links),
        strict=True,
    ):
        omega = np.einsum("bnij,bj->bni", matrix[..., 3:, :], velocities)
        own = ~np.isnan(found)
        np.testing.assert_allclose((found[..., None] * d)[own], omega[own], atol=1e-12)
    rods = np.array([leg.joint.unit == "rad" for leg in robot.legs])
    np.testing.assert_array_equal(
        np.isnan(rates.lower_links), np.broadcast_to(rods, (COUNT, len(rods)))
    )


@EVERY
def test_joint_accelerations_against_differences_of_rates_along_a_motion(name):
    robot = MECHANISMS[name]
    poses = bent_poses(robot)
    rng = np.random.default_rng(4)
    velocities, accelerations = rng.normal(size=poses.shape), 10 * rng.normal(size=poses.shape)
    found = pteron.kinematics.joint_accelerations(robot, poses, velocities, accelerations)

    def motion(t):
        t = t[:, None, None]
        return poses + t * velocities + t**2 / 2 * accelerations, velocities + t * accelerations

    for part in ("actuated", "upper_links", "lower_links", "passive"):
        expected = along(
            lambda t, p=part: getattr(pteron.kinematics.joint_rates(robot, *motion(t)), p), 2e-5
        )
        # Rates of 10 rad/s, rounded, over a step of 2e-5 s; accelerations of 10 to 1000 rad/s^2.
        np.testing.assert_allclose(getattr(found, part), expected, rtol=1e-8, atol=1e-7)


# Singularities and reach.


@EVERY
def test_the_type_1_measure_is_the_sine_between_the_links_about_d(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, COUNT)
    upper, lower = pteron.kinematics.link_vectors(robot, poses)
    volume = inner(column(robot, "direction"), np.cross(upper, lower))
    sizes = column(robot, "upper_length") * column(robot, "lower_length")
    measure = pteron.compile(robot, "reach")(poses)[1]
    np.testing.assert_allclose(measure, np.abs(volume) / sizes, rtol=1e-12)


@EVERY
def test_measure_and_margin_vanish_together_at_the_edge_of_reach(name):
    robot = MECHANISMS[name]
    reach = pteron.compile(robot, "reach")
    rng = np.random.default_rng(2)
    for pose in states(robot, 5)[0]:
        way = np.zeros(robot.freedom)
        way[:3] = rng.normal(size=3)
        way[:3] /= np.linalg.norm(way)
        steps = np.linspace(0.0, 4.0, 400)
        margins = reach(pose + steps[:, None] * way)[0].min(axis=-1)
        i = int(np.argmax(margins < 0))
        assert i > 0
        edge = brentq(
            lambda t, x=pose, w=way: reach(x + t * w)[0].min(), steps[i - 1], steps[i], xtol=1e-15
        )
        leg = int(reach(pose + edge * way)[0].argmin())
        # The measure is the root of what vanishes there; beyond, nothing is real.
        assert not reach(pose + (edge - 1e-13) * way)[1][leg] > 1e-5
        assert np.isnan(reach(pose + (edge + 1e-9) * way)[1][leg])
        # The margin is the least way to the edge, by what a leg's plane sees of an oblique slider.
        seen = [1 / abs(inner(g.e, g.direction)) if g.joint.unit == "m" else 1 for g in robot.legs]
        assert margins[0] <= max(seen) * edge * (1 + 1e-12)


@EVERY
def test_the_type_2_measure_is_the_determinant_of_unit_forces(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, COUNT)
    measure = pteron.compile(robot, "type_ii")
    J = pteron.jacobian(robot, poses)
    if robot.platform.turns:
        points = np.array([leg.platform_point[:2] for leg in robot.legs])
        most = np.linalg.norm(points - points.mean(axis=0)) * (4 / 3) ** 1.5
    else:
        most = 1.0
    expected = np.linalg.det(J) / np.linalg.norm(J[..., :3], axis=-1).prod(axis=-1) / most
    np.testing.assert_allclose(np.abs(measure(poses)), np.abs(expected), rtol=1e-11)


@pytest.mark.parametrize("name", gated(TURNING, ["quadrupteron-oblique +--+", "random 3T1R 0"]))
def test_singular_orientations_do_not_depend_on_the_position(name):
    robot = MECHANISMS[name]
    angles = pteron.kinematics.singular_orientations(robot)
    assert angles.shape == (2,)
    assert angles[1] - angles[0] == pytest.approx(np.pi, abs=1e-14)
    rng = np.random.default_rng(5)
    poses = rng.uniform(-1, 1, (3, 50, 4))
    poses[..., 3] = [[angles[0]], [angles[1]], [angles.mean()]]
    determinants = np.linalg.det(pteron.jacobian(robot, poses))
    assert np.abs(determinants[:2]).max() < 1e-14
    assert np.abs(determinants[2]).min() > 1e-3
    assert np.ptp(determinants[2]) < 1e-14


def test_the_catalogs_quadrupteron_is_singular_at_right_angles():
    angles = pteron.kinematics.singular_orientations(CATALOG["quadrupteron"])
    np.testing.assert_allclose(np.degrees(angles), [-90.0, 90.0], rtol=1e-15)


@pytest.mark.parametrize("name", ["par4", "h4", "3-rrr", "3-prr", "delta-4", "sliding"])
def test_singular_orientations_at_a_position(name):
    robot = random_machine(0, "PRSSI") if name == "sliding" else CATALOG[name]
    assert pteron.kinematics.singular_orientations(robot).shape == (0,), "at every position"
    for pose in pteron.random_poses(robot, 5, seed=3, type_i=0.1, type_ii=0.01):
        angles = pteron.kinematics.singular_orientations(robot, pose[:-1])
        assert (np.diff(angles) > 0.0).all()

        def determinant(phi, pose=pose):
            poses = np.tile(pose, (len(phi), 1))
            poses[:, -1] = phi
            J = pteron.jacobian(robot, poses, on_failure="nan")
            reached = ~np.isnan(J).any(axis=(1, 2))
            found = np.full(len(phi), np.nan)
            found[reached] = np.linalg.det(J[reached])
            return found

        if len(angles):
            around = determinant(angles - 1e-7) * determinant(angles + 1e-7)
            assert (around[~np.isnan(around)] < 0.0).all()
        # Between them, and within reach, it has one sign.
        phi = np.linspace(-np.pi, np.pi, 999)
        part, sign = np.searchsorted(angles, phi), np.sign(determinant(phi))
        steps = np.flatnonzero((part[1:] == part[:-1]) & ~np.isnan(sign[1:] * sign[:-1]))
        np.testing.assert_array_equal(sign[steps + 1], sign[steps])


def test_singular_orientations_where_they_cannot_be():
    robot = CATALOG["par4"]
    assert pteron.kinematics.singular_orientations(robot, [0.0, 0.0, 9.0]).shape == (0,), (
        "out of reach"
    )
    assert pteron.kinematics.singular_orientations(CATALOG["delta"], [0.0, 0.0, -1.0]).shape == (0,)
    both = pteron.kinematics.singular_orientations(CATALOG["quadrupteron"], [0.1, 0.0, 0.0])
    np.testing.assert_array_equal(
        both, pteron.kinematics.singular_orientations(CATALOG["quadrupteron"])
    )
    with pytest.raises(DataError, match="position: shape"):
        pteron.kinematics.singular_orientations(robot, [0.0, 0.0, -0.4, 0.1])
    with pytest.raises(DataError, match="finite numbers expected"):
        pteron.kinematics.singular_orientations(robot, [0.0, np.nan, -0.4])
    # Where the rods of a Delta lie in a plane it is singular, however its shaft is turned.
    *legs, shaft = CATALOG["delta-4"].legs
    short = tuple(replace(leg, lower_length=0.55) for leg in legs)
    flat = replace(CATALOG["delta-4"], legs=(*short, shaft))
    measure = pteron.compile(flat, "type_ii")
    z = brentq(lambda z: float(measure([0.0, 0.0, z, 0.0])), -0.4, 0.4, xtol=1e-16)
    with pytest.raises(SingularPose, match="in every orientation"):
        pteron.kinematics.singular_orientations(flat, [0.0, 0.0, z])


@pytest.mark.parametrize("name", [n for n in MECHANISMS if n not in TURNING])
def test_a_translating_platform_has_no_singular_orientation(name):
    assert pteron.kinematics.singular_orientations(MECHANISMS[name]).shape == (0,)
    assert not pteron.kinematics.is_singular_everywhere(MECHANISMS[name])


def test_a_delta_whose_rods_lie_in_one_plane_is_singular():
    """At the height of its elbows the platform's rods hold no vertical force."""
    robot = CATALOG["delta"]
    legs = tuple(replace(leg, lower_length=0.55) for leg in robot.legs)
    robot = replace(robot, legs=legs)

    def measure(z):
        return float(pteron.compile(robot, "type_ii")([0.0, 0.0, z]))

    z = brentq(measure, -0.4, 0.4, xtol=1e-16)
    lower = pteron.kinematics.link_vectors(robot, [0.0, 0.0, z])[1]
    np.testing.assert_allclose(lower[:, 2], 0.0, atol=1e-14)
    rest = np.zeros(3)
    with pytest.raises(SingularPose, match=r"^pose: singular \(type II; measure") as caught:
        pteron.inverse_dynamics(robot, [0.0, 0.0, z], rest, rest)
    assert caught.value.kind == "II"
    assert caught.value.measure < 1e-9
    assert np.isfinite(pteron.forward_dynamics(robot, [0.0, 0.0, z], rest, rest)).all()


def fourfold(tilt):
    """A Quadrupteron with fourfold symmetry about k; `tilt` breaks it, by turning leg 1's d."""
    model = CATALOG["quadrupteron"]
    legs = []
    for i in range(4):
        turn = Rotation.from_rotvec([0.0, 0.0, i * np.pi / 2]).as_matrix()
        d, s0 = turn @ [0.6, 0.0, 0.8], turn @ [0.04, 0.01, 0.005]
        if i == 0:
            d = Rotation.from_rotvec([tilt, 0.0, 0.0]).as_matrix() @ d
        guide_point = s0 - 0.2 * np.cross(d, turn @ [1.0, 0.0, 0.0]) / 0.8
        leg = replace(model.legs[2], guide_point=guide_point, direction=d, platform_point=s0)
        legs.append(leg)
    return replace(model, name="fourfold", legs=tuple(legs))


def test_a_layout_with_fourfold_symmetry_is_singular_everywhere():
    robot = fourfold(0.0)
    rest = np.zeros(4)
    assert pteron.kinematics.is_singular_everywhere(robot)
    poses = np.random.default_rng(0).uniform(-1, 1, (20, 4))
    assert np.abs(np.linalg.det(pteron.jacobian(robot, poses))).max() < 1e-15
    assert pteron.inverse_kinematics(robot, rest).shape == (4,)
    calls = {
        "orientations": lambda: pteron.kinematics.singular_orientations(robot),
        "forces": lambda: pteron.inverse_dynamics(robot, rest, rest, rest),
        "regressor": lambda: pteron.regressor(robot, rest, rest, rest),
        "direct": lambda: pteron.direct_kinematics(robot, rest),
    }
    for call in calls.values():
        with pytest.raises(SingularPose, match="fourfold: singular at every pose") as caught:
            call()
        assert (caught.value.kind, caught.value.measure) == ("II", 0.0)
    for poses in (rest, np.zeros((3, 5, 4))):
        lost = pteron.inverse_dynamics(robot, poses, rest, rest, on_failure="nan")
        assert lost.shape == poses.shape
        assert np.isnan(lost).all()


@pytest.mark.parametrize("seed", range(3))
def test_being_singular_everywhere_does_not_depend_on_the_frame(seed):
    rotation = Rotation.random(rng=seed).as_matrix()
    assert pteron.kinematics.is_singular_everywhere(pteron.turned(fourfold(0.0), rotation))
    assert not pteron.kinematics.is_singular_everywhere(pteron.turned(fourfold(1e-6), rotation))


def test_the_symmetry_broken_is_singular_at_two_orientations():
    robot = fourfold(0.1)
    assert not pteron.kinematics.is_singular_everywhere(robot)
    assert pteron.kinematics.singular_orientations(robot).shape == (2,)
    poses = pteron.random_poses(robot, 10, type_i=0.3, type_ii=0.01)
    motion = np.random.default_rng(0).normal(size=(2, 10, 4))
    assert np.isfinite(pteron.inverse_dynamics(robot, poses, *motion)).all()


def test_directions_in_one_plane_are_singular_everywhere():
    robot = CATALOG["tripteron"]
    d = (np.sqrt(0.5), np.sqrt(0.5), 0.0)
    flat = replace(robot, legs=(*robot.legs[:2], replace(robot.legs[2], direction=d)))
    assert pteron.kinematics.is_singular_everywhere(flat)
    with pytest.raises(SingularPose, match="singular at every pose"):
        pteron.direct_kinematics(flat, np.zeros(3))


def test_an_orthogonal_tripteron_is_isotropic_everywhere():
    J = pteron.jacobian(CATALOG["tripteron"], states(CATALOG["tripteron"], COUNT)[0])
    np.testing.assert_array_equal(J, np.broadcast_to(np.eye(3), J.shape))
    robot = MECHANISMS["tripteron on a wall"]
    J = pteron.jacobian(robot, states(robot, COUNT)[0])
    np.testing.assert_allclose(np.linalg.cond(J), 1.0, rtol=1e-14)


# Random poses.


@EVERY
def test_random_poses_honour_the_measures(name):
    robot = MECHANISMS[name]
    poses = pteron.random_poses(robot, 60, seed=9, type_i=0.4, type_ii=0.15)
    assert poses.shape == (60, robot.freedom)
    least = pteron.compile(robot, "reach")(poses)[1].min()
    assert 0.4 <= least < 0.5, "the bound must be what bounds"
    assert np.abs(pteron.compile(robot, "type_ii")(poses)).min() >= 0.15


@pytest.mark.parametrize("name", ["delta", "quadrupteron", "random 3T 0"])
def test_random_poses_are_spread_as_those_of_a_wider_search(name):
    robot = MECHANISMS[name]
    found = pteron.random_poses(robot, 2000, seed=2)
    rng = np.random.default_rng(3)
    center = found[:, :3].mean(axis=0)
    size = np.ptp(found[:, :3], axis=0).max()
    wide = rng.uniform(-1.0, 1.0, (400_000, robot.freedom))
    wide *= np.array([size, size, size, np.pi][: robot.freedom])
    wide[:, :3] += center
    type_i = pteron.compile(robot, "reach")(wide)[1]
    type_ii = np.abs(pteron.compile(robot, "type_ii")(wide))
    expected = wide[(type_i >= 0.1).all(axis=-1) & (type_ii >= 0.1)]
    assert len(expected) > 200
    for one, other in zip(found.T, expected.T, strict=True):
        assert ks_2samp(one, other).pvalue > 1e-3


def test_random_poses_are_seeded():
    robot = CATALOG["quadrupteron"]
    np.testing.assert_array_equal(
        pteron.random_poses(robot, 3), pteron.random_poses(robot, 3, seed=0)
    )
    first = pteron.random_poses(robot, 10, seed=1)
    rng = np.random.default_rng(1)
    np.testing.assert_array_equal(first, pteron.random_poses(robot, 10, seed=rng))
    assert (first != pteron.random_poses(robot, 10, seed=rng)).all()
    assert (first != pteron.random_poses(robot, 10, seed=2)).all()


@pytest.mark.parametrize("count", [-1, -300, 2.5, "3", None, np.nan, True])
def test_a_count_of_poses_is_a_whole_number(count):
    with pytest.raises(DataError, match=r"^count: .* given, .* expected$"):
        pteron.random_poses(CATALOG["tripteron"], count)


def test_no_poses_may_be_asked_for():
    assert pteron.random_poses(CATALOG["delta"], 0).shape == (0, 3)
    assert pteron.random_poses(CATALOG["delta"], np.int64(2)).shape == (2, 3)


def test_random_poses_of_legs_that_have_no_common_reach():
    robot = CATALOG["tripteron"]
    far = replace(robot.legs[0], guide_point=(0.0, 10.0, 0.0))
    with pytest.raises(ModelError, match=r"tripteron: none of \d+ random poses is in reach"):
        pteron.random_poses(replace(robot, legs=(far, *robot.legs[1:])), 5)
