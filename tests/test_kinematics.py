"""Position, velocity and acceleration: the paper's lemma, its inverses, and differences."""

from dataclasses import replace
from functools import lru_cache

import casadi as ca
import mechanisms
import numpy as np
import pytest
from differences import along, gradient
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import CATALOG, MECHANISMS, random_machine
from scipy.spatial.transform import Rotation
from scipy.stats import ks_2samp

import pteron
from pteron.equations.geometry import Geometry
from pteron.equations.screws import jacobian_by_screws, joint_screws
from pteron.errors import ModelError, SingularPose

EVERY = pytest.mark.parametrize("name", MECHANISMS)
TURNING = [name for name, robot in MECHANISMS.items() if robot.platform.turns]
COUNT = 100

states = lru_cache(mechanisms.states)


def bent_poses(robot, count=20, seed=3):
    """Return poses far enough from singular ones for differences; see `differences.STEP`."""
    return pteron.random_poses(robot, count, seed=seed, bend=0.5, hold=0.3)


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


def closing_vectors(robot, poses):
    """Return u = c - r - rho e (..., n, 3)."""
    rho = pteron.inverse_kinematics(robot, poses)
    joint1 = column(robot, "guide_point") + rho[..., None] * column(robot, "e")
    return platform_points(robot, poses) - joint1


def inner(a, b):
    return (a * b).sum(axis=-1)


@EVERY
def test_the_links_close_the_triangle_on_the_side_of_sigma(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, COUNT)
    upper, lower = pteron.link_vectors(robot, poses)
    d, u = column(robot, "direction"), closing_vectors(robot, poses)
    np.testing.assert_allclose(upper + lower, u, atol=1e-15)
    np.testing.assert_allclose(inner(u, d), 0.0, atol=1e-15)
    for vector, length in ((upper, "upper_length"), (lower, "lower_length")):
        lengths = np.broadcast_to(column(robot, length), vector.shape[:-1])
        np.testing.assert_allclose(np.linalg.norm(vector, axis=-1), lengths, rtol=1e-14)
        np.testing.assert_allclose(inner(vector, d), 0.0, atol=1e-15)
    assert (column(robot, "elbow") * inner(upper, np.cross(d, u)) > 0).all()


@EVERY
def test_equations_1_and_2_with_their_four_factors(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, COUNT)
    d, u = column(robot, "direction"), closing_vectors(robot, poses)
    lu, ll, sigma = (column(robot, x) for x in ("upper_length", "lower_length", "elbow"))
    n = np.linalg.norm(u, axis=-1)
    factors = (n + lu + ll) * (-n + lu + ll) * (n - lu + ll) * (n + lu - ll)
    direction = u / n[..., None]
    across = (sigma * np.sqrt(factors))[..., None] * np.cross(d, direction)
    l_u = ((n**2 + lu**2 - ll**2)[..., None] * direction + across) / (2 * n)[..., None]
    l_l = ((n**2 + ll**2 - lu**2)[..., None] * direction - across) / (2 * n)[..., None]
    upper, lower = pteron.link_vectors(robot, poses)
    # Near a stretched leg the root magnifies the rounding of u, by 1 / sine <= 1 / 0.3.
    np.testing.assert_allclose(upper, l_u, atol=1e-14)
    np.testing.assert_allclose(lower, l_l, atol=1e-14)


@pytest.mark.parametrize("name", CATALOG)
def test_every_choice_of_elbows_is_another_working_mode_with_the_same_sliders(name):
    robot = CATALOG[name]
    modes = pteron.working_modes(robot)
    poses, _, _ = states(robot, 5)
    uppers = [pteron.link_vectors(mode, poses)[0] for mode in modes]
    assert len(modes) == 2 ** len(robot.legs)
    for i, mode in enumerate(modes):
        np.testing.assert_array_equal(
            pteron.inverse_kinematics(mode, poses), pteron.inverse_kinematics(robot, poses)
        )
        assert replace(mode, legs=robot.legs) == robot
        for other in uppers[:i]:
            # Sine 0.3 of an elbow's angle leaves R2 over a centimetre from its mirror image.
            assert np.abs(uppers[i] - other).max(axis=(-2, -1)).min() > 0.01
    assert robot in modes


@EVERY
def test_direct_kinematics_inverts_inverse_kinematics(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, COUNT)
    sliders = pteron.inverse_kinematics(robot, poses)
    found = pteron.direct_kinematics(robot, sliders)
    assert found.shape == (COUNT, 2 if robot.platform.turns else 1, robot.freedom)
    distance = np.abs(found - poses[:, None]).max(axis=-1)
    np.testing.assert_allclose(np.nanmin(distance, axis=-1), 0.0, atol=1e-13)
    real = ~np.isnan(found).any(axis=-1)
    assert (real == ~np.isnan(found).all(axis=-1)).all()
    back = pteron.inverse_kinematics(robot, found[real])
    expected = np.broadcast_to(sliders[:, None], (*real.shape, robot.freedom))[real]
    np.testing.assert_allclose(back, expected, atol=1e-14)


@pytest.mark.parametrize("name", TURNING)
def test_each_column_of_direct_kinematics_is_one_assembly_mode(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, COUNT)
    regularity = pteron.compile(robot, "regularity")
    mode = np.where(regularity(poses) > 0, 0, 1)
    assert set(mode) == {0, 1}, "the poses must be of both modes"
    found = pteron.direct_kinematics(robot, pteron.inverse_kinematics(robot, poses))
    np.testing.assert_allclose(found[np.arange(COUNT), mode], poses, atol=1e-13)
    signs = []
    for branch, sign in ((0, 1), (1, -1)):
        real = found[:, branch][~np.isnan(found[:, branch]).any(axis=-1)]
        assert len(real) > 0
        assert (sign * regularity(real) > 0).all()
        signs.append(set(np.sign(np.linalg.det(pteron.jacobian(robot, real)))))
    assert signs in ([{1.0}, {-1.0}], [{-1.0}, {1.0}])
    assert (np.abs(found[..., 3][~np.isnan(found[..., 3])]) <= np.pi).all()


@pytest.mark.parametrize("name", TURNING)
def test_the_assembly_modes_meet_at_the_singular_orientations(name):
    robot = MECHANISMS[name]
    for angle in pteron.singular_orientations(robot):
        poses = pteron.random_poses(robot, 50, seed=7, hold=0.0)
        poses[:, 3] = angle
        sliders = pteron.inverse_kinematics(robot, poses, on_failure="nan")
        in_reach = ~np.isnan(sliders[:, 0])
        assert in_reach.any()
        found = pteron.direct_kinematics(robot, sliders[in_reach])
        difference = found - poses[in_reach, None]
        difference[..., 3] = np.angle(np.exp(1j * difference[..., 3]))
        # A double root keeps half of the digits: sqrt(1e-14).
        np.testing.assert_allclose(difference, 0.0, atol=5e-7)


def test_half_a_turn_is_pi_and_not_minus_pi():
    robot = CATALOG["quadrupteron"]
    positions = states(robot, 400)[0][:, :3]
    poses = np.column_stack([positions, np.full(400, np.pi)])
    sliders = pteron.inverse_kinematics(robot, poses, on_failure="nan")
    in_reach = ~np.isnan(sliders[:, 0])
    angles = pteron.direct_kinematics(robot, sliders[in_reach])[..., 3]
    assert in_reach.sum() > 3
    assert (angles > -np.pi).all()
    # The closures' rounding, over the platform points' 0.04 m.
    np.testing.assert_allclose(np.abs(angles).max(axis=-1), np.pi, atol=1e-14)


@pytest.mark.parametrize("shift", [0.0, 1.0, 1e3])
@pytest.mark.parametrize("name", TURNING)
def test_the_assembly_modes_meet_wherever_the_base_frame_lies(name, shift):
    offset = shift * np.array([0.6, -1.0, 0.7])
    legs = tuple(
        replace(leg, guide_point=tuple(np.array(leg.guide_point) + offset))
        for leg in MECHANISMS[name].legs
    )
    robot = replace(MECHANISMS[name], legs=legs)
    poses = pteron.random_poses(robot, 100, seed=7, hold=0.0)
    for angle in pteron.singular_orientations(robot):
        for closeness in (0.0, 1e-8, -1e-8):
            poses[:, 3] = angle + closeness
            sliders = pteron.inverse_kinematics(robot, poses, on_failure="nan")
            in_reach = ~np.isnan(sliders[:, 0])
            assert in_reach.any()
            found = pteron.direct_kinematics(robot, sliders[in_reach])
            difference = found - poses[in_reach, None]
            difference[..., 3] = np.angle(np.exp(1j * difference[..., 3]))
            # A double root keeps half of the digits, of the sizes that the closures add up.
            size = 0.1 + shift
            np.testing.assert_allclose(difference, 0.0, atol=2e-6 * np.sqrt(size / 0.1))


@pytest.mark.parametrize("name", TURNING)
def test_direct_kinematics_is_nan_where_the_closures_are_not_real(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, 10)
    rows = column(robot, "direction")
    null = np.linalg.svd(rows / inner(rows, column(robot, "e"))[:, None])[0][:, 3]
    sliders = pteron.inverse_kinematics(robot, poses)
    # Along the null vector no translation helps, and the platform's points are 0.1 m long.
    assert np.isnan(pteron.direct_kinematics(robot, sliders + null)).all()
    assert np.isfinite(pteron.direct_kinematics(robot, sliders)).any(axis=(-2, -1)).all()


@EVERY
def test_direct_kinematics_is_nan_where_the_links_do_not_reach(name):
    robot = MECHANISMS[name]
    poses = states(robot, 10)[0].copy()
    poses[:, :3] += 5.0
    sliders = pteron.compile(robot, "inverse_kinematics")(poses)
    assert np.isnan(pteron.direct_kinematics(robot, sliders)).all()


@settings(deadline=None, derandomize=True, max_examples=15)
@given(st.integers(0, 10**6), st.booleans())
def test_direct_kinematics_of_machines_with_nothing_special(seed, turns):
    robot = random_machine(seed, turns)
    try:
        poses = pteron.random_poses(robot, 3, seed=seed, bend=0.3, hold=0.3)
    except ModelError:
        return
    found = pteron.direct_kinematics(robot, pteron.inverse_kinematics(robot, poses))
    distance = np.nanmin(np.abs(found - poses[:, None]).max(axis=-1), axis=-1)
    # The closures' rows may lean on each other: their condition number is up to about 10.
    np.testing.assert_allclose(distance, 0.0, atol=1e-12)


@EVERY
def test_the_jacobian_against_differences_of_inverse_kinematics(name):
    robot = MECHANISMS[name]
    poses = bent_poses(robot)
    found = gradient(lambda x: pteron.inverse_kinematics(robot, x), poses)
    # Rounding of the sliders (1e-16) over the step (5e-5).
    np.testing.assert_allclose(pteron.jacobian(robot, poses), found, atol=3e-11)


@EVERY
def test_the_jacobian_by_screws(name):
    robot = MECHANISMS[name]
    pose = ca.SX.sym("x", robot.freedom)
    by_screws = ca.Function("J", [pose], [jacobian_by_screws(Geometry.of(robot), pose)])
    for x in states(robot, 20)[0]:
        np.testing.assert_allclose(pteron.jacobian(robot, x), by_screws(x).full(), atol=1e-14)


@EVERY
def test_joint_screws_times_rates_are_the_platforms_twist_for_every_leg(name):
    robot = MECHANISMS[name]
    poses, velocities, _ = states(robot, COUNT)
    screws = pteron.joint_screws(robot, poses)
    rates = pteron.joint_rates(robot, poses, velocities)
    joints = np.concatenate([rates.sliders[..., None], rates.revolute], axis=-1)
    assert screws.shape == (COUNT, robot.freedom, 5 if robot.platform.turns else 4, 6)
    found = np.einsum("bnj,bnjc->bnc", joints, screws)
    twist = np.zeros((COUNT, 1, 6))
    twist[:, 0, 3:] = velocities[:, :3]
    if robot.platform.turns:
        twist[:, 0, :3] = velocities[:, 3:] * robot.platform.axis
    # Rates reach 1e2 rad/s, through 1/D.
    np.testing.assert_allclose(found, np.broadcast_to(twist, found.shape), atol=1e-12)


@EVERY
def test_joint_screws_are_unit_screws_in_their_order(name):
    robot = MECHANISMS[name]
    pose = ca.SX.sym("x", robot.freedom)
    expressions = ca.Function("S", [pose], joint_screws(Geometry.of(robot), pose))
    poses, _, _ = states(robot, 5)
    found = pteron.joint_screws(robot, poses)
    d, e = column(robot, "direction"), column(robot, "e")
    np.testing.assert_array_equal(
        found[:, :, 0], np.broadcast_to(np.c_[0 * e, e], (5, *e.shape[:1], 6))
    )
    for j in (1, 2, 3):
        np.testing.assert_array_equal(found[:, :, j, :3], np.broadcast_to(d, (5, *d.shape)))
    if robot.platform.turns:
        np.testing.assert_array_equal(found[:, :, 4, :3] - robot.platform.axis, 0.0)
    s = platform_points(robot, poses) - poses[:, None, :3]
    np.testing.assert_allclose(found[:, :, 3, 3:], np.cross(s, d), atol=1e-15)
    lower = pteron.link_vectors(robot, poses)[1]
    np.testing.assert_allclose(found[:, :, 2, 3:], np.cross(s - lower, d), atol=1e-15)
    for x, screws in zip(poses, found, strict=True):
        for expected, leg in zip(expressions(x), screws, strict=True):
            np.testing.assert_allclose(leg, expected.full().T, atol=1e-15)


@pytest.mark.parametrize("name", TURNING)
def test_the_determinant_depends_on_phi_only(name):
    robot = MECHANISMS[name]
    rng = np.random.default_rng(5)
    poses = rng.uniform(-1, 1, (50, 4))
    same_angle = poses.copy()
    same_angle[:, :3] = rng.uniform(-1, 1, (50, 3))
    first = np.linalg.det(pteron.jacobian(robot, poses))
    np.testing.assert_allclose(first, np.linalg.det(pteron.jacobian(robot, same_angle)), atol=1e-15)
    assert np.ptp(first) > 1e-3


@pytest.mark.parametrize("name", TURNING)
def test_the_singular_orientations_are_those_without_a_determinant(name):
    robot = MECHANISMS[name]
    angles = pteron.singular_orientations(robot)
    assert angles.shape == (2,)
    assert angles[1] - angles[0] == pytest.approx(np.pi, abs=1e-14)
    poses = np.zeros((3, 4))
    poses[:2, 3], poses[2, 3] = angles, angles.mean()
    *vanishing, largest = np.linalg.det(pteron.jacobian(robot, poses))
    assert np.abs(vanishing).max() < 1e-14 * max(1.0, abs(largest))
    assert abs(largest) > 1e-3


def test_the_catalogs_quadrupteron_is_singular_at_right_angles():
    angles = pteron.singular_orientations(CATALOG["quadrupteron"])
    np.testing.assert_allclose(np.degrees(angles), [-90.0, 90.0], rtol=1e-15)


@pytest.mark.parametrize("name", [n for n in MECHANISMS if n not in TURNING])
def test_a_tripteron_has_no_singular_orientation(name):
    assert pteron.singular_orientations(MECHANISMS[name]).shape == (0,)
    assert not pteron.is_singular_everywhere(MECHANISMS[name])


def fourfold(tilt):
    """A Quadrupteron with fourfold symmetry about k; `tilt` breaks it, by turning leg 1's d."""
    model = CATALOG["quadrupteron"]
    legs = []
    for i in range(4):
        turn = Rotation.from_rotvec([0.0, 0.0, i * np.pi / 2]).as_matrix()
        d, s0 = turn @ [0.6, 0.0, 0.8], turn @ [0.04, 0.01, 0.005]
        if i == 0:
            d = Rotation.from_rotvec([tilt, 0.0, 0.0]).as_matrix() @ d
        legs.append(
            replace(
                model.legs[2],
                guide_point=s0 - 0.2 * np.cross(d, turn @ [1.0, 0.0, 0.0]) / 0.8,
                direction=d,
                platform_point=s0,
            )
        )
    return replace(model, name="fourfold", legs=tuple(legs))


def test_a_layout_with_fourfold_symmetry_is_singular_everywhere():
    robot = fourfold(0.0)
    rest = np.zeros(4)
    assert pteron.is_singular_everywhere(robot)
    poses = np.random.default_rng(0).uniform(-1, 1, (20, 4))
    assert np.abs(np.linalg.det(pteron.jacobian(robot, poses))).max() < 1e-15
    assert pteron.inverse_kinematics(robot, rest).shape == (4,)
    calls = {
        "orientations": lambda: pteron.singular_orientations(robot),
        "forces": lambda: pteron.inverse_dynamics(robot, rest, rest, rest),
        "regressor": lambda: pteron.regressor(robot, rest, rest, rest),
        "direct": lambda: pteron.direct_kinematics(robot, rest),
    }
    for call in calls.values():
        with pytest.raises(SingularPose, match="fourfold: singular at every pose") as caught:
            call()
        assert (caught.value.kind, caught.value.closeness) == ("II", 0.0)
    for poses in (rest, np.zeros((3, 5, 4))):
        lost = pteron.inverse_dynamics(robot, poses, rest, rest, on_failure="nan")
        assert lost.shape == poses.shape
        assert np.isnan(lost).all()


@pytest.mark.parametrize("seed", range(5))
def test_being_singular_everywhere_does_not_depend_on_the_frame(seed):
    rotation = Rotation.random(rng=seed).as_matrix()
    assert pteron.is_singular_everywhere(pteron.turned(fourfold(0.0), rotation))
    assert not pteron.is_singular_everywhere(pteron.turned(fourfold(1e-6), rotation))


def test_the_symmetry_broken_is_singular_at_two_orientations():
    robot = fourfold(0.1)
    assert not pteron.is_singular_everywhere(robot)
    assert pteron.singular_orientations(robot).shape == (2,)
    assert np.isfinite(pteron.inverse_dynamics(robot, *states(robot, 10))).all()


def test_directions_in_one_plane_are_singular_everywhere():
    robot = CATALOG["tripteron"]
    d = (np.sqrt(0.5), np.sqrt(0.5), 0.0)
    flat = replace(robot, legs=(*robot.legs[:2], replace(robot.legs[2], direction=d)))
    assert pteron.is_singular_everywhere(flat)
    with pytest.raises(SingularPose, match="singular at every pose"):
        pteron.direct_kinematics(flat, np.zeros(3))


@pytest.mark.parametrize("name", ["tripteron", "tripteron -+-"])
def test_an_orthogonal_tripteron_is_isotropic_everywhere(name):
    robot = MECHANISMS[name]
    poses, _, _ = states(robot, COUNT)
    J = pteron.jacobian(robot, poses)
    np.testing.assert_array_equal(J, np.broadcast_to(np.eye(3), J.shape))


def test_a_tripteron_on_a_wall_is_isotropic_too():
    robot = MECHANISMS["tripteron on a wall"]
    J = pteron.jacobian(robot, states(robot, COUNT)[0])
    np.testing.assert_allclose(np.linalg.cond(J), 1.0, rtol=1e-14)


@EVERY
def test_link_jacobians_against_differences_of_points_and_angles(name):
    robot = MECHANISMS[name]
    poses = bent_poses(robot)
    upper, lower = pteron.link_jacobians(robot, poses)
    r, d, e = (column(robot, x) for x in ("guide_point", "direction", "e"))

    def joint1(x):
        return r + pteron.inverse_kinematics(robot, x)[..., None] * e

    # Differences of the points' coordinates, 0.5 m and rounded, over the step 5e-5.
    np.testing.assert_allclose(upper[..., :3, :], gradient(joint1, poses), atol=3e-11)
    points = gradient(lambda x: platform_points(robot, x), poses)
    np.testing.assert_allclose(lower[..., :3, :], points, atol=3e-11)

    for matrix, which in ((upper, 0), (lower, 1)):
        start = pteron.link_vectors(robot, poses)[which]

        def turned_by(x, which=which, start=start):
            link = pteron.link_vectors(robot, x)[which]
            return np.arctan2(inner(d, np.cross(start, link)), inner(start, link))

        rate = gradient(turned_by, poses)
        # As above, divided by the links' 0.15 m, and magnified by 1 / sine at the elbow.
        np.testing.assert_allclose(
            matrix[..., 3:, :], d[:, :, None] * rate[..., None, :], atol=1e-9
        )


@EVERY
def test_joint_rates_are_the_link_jacobians_times_the_velocity(name):
    robot = MECHANISMS[name]
    poses, velocities, _ = states(robot, COUNT)
    rates = pteron.joint_rates(robot, poses, velocities)
    upper, lower = pteron.link_jacobians(robot, poses)
    d = column(robot, "direction")
    for matrix, found in ((upper, rates.upper_links), (lower, rates.lower_links)):
        omega = np.einsum("bnij,bj->bni", matrix[..., 3:, :], velocities)
        np.testing.assert_allclose(found[..., None] * d, omega, atol=1e-12)
    J = pteron.jacobian(robot, poses)
    np.testing.assert_allclose(rates.sliders, (J @ velocities[..., None])[..., 0], atol=1e-14)


@EVERY
def test_joint_accelerations_against_differences_of_rates_along_a_motion(name):
    robot = MECHANISMS[name]
    poses = bent_poses(robot)
    rng = np.random.default_rng(4)
    velocities, accelerations = rng.normal(size=poses.shape), 10 * rng.normal(size=poses.shape)
    rates, found = pteron.joint_rates(robot, poses, velocities, accelerations)
    alone = pteron.joint_rates(robot, poses, velocities)

    def motion(t):
        t = t[:, None, None]
        return poses + t * velocities + t**2 / 2 * accelerations, velocities + t * accelerations

    for part in ("sliders", "upper_links", "lower_links", "revolute"):
        np.testing.assert_array_equal(getattr(rates, part), getattr(alone, part))
        expected = along(lambda t, p=part: getattr(pteron.joint_rates(robot, *motion(t)), p), 2e-5)
        # Rates of 10 rad/s, rounded, over a step of 2e-5 s; accelerations of 10 to 1000 rad/s^2.
        np.testing.assert_allclose(getattr(found, part), expected, rtol=1e-9, atol=1e-8)


@EVERY
def test_random_poses_honour_bend_and_hold(name):
    robot = MECHANISMS[name]
    poses = pteron.random_poses(robot, 150, seed=9, bend=0.4, hold=0.5)
    assert poses.shape == (150, robot.freedom)
    upper, lower = pteron.link_vectors(robot, poses)
    lengths = column(robot, "upper_length") * column(robot, "lower_length")
    sine = np.linalg.norm(np.cross(upper, lower), axis=-1) / lengths
    assert sine.min() >= 0.4 - 1e-12
    assert sine.min() < 0.5, "the bound must be what bounds"
    if robot.platform.turns:
        quarter = poses + np.array([0, 0, 0, np.pi / 2])
        first, second = (np.linalg.det(pteron.jacobian(robot, x)) for x in (poses, quarter))
        ratio = np.abs(first) / np.hypot(first, second)
        assert 0.5 - 1e-12 <= ratio.min() < 0.6


@pytest.mark.parametrize("name", [*CATALOG, "random 3T1R 0", "random 3T 1"])
def test_random_poses_are_spread_as_those_of_a_wider_search(name):
    robot = MECHANISMS[name]
    found = pteron.random_poses(robot, 2000, seed=2)
    rng = np.random.default_rng(3)
    center = found[:, :3].mean(axis=0)
    size = np.ptp(found[:, :3], axis=0).max()
    wide = rng.uniform(-1.0, 1.0, (400_000, robot.freedom))
    wide *= np.array([size, size, size, np.pi][: robot.freedom])
    wide[:, :3] += center
    sine = pteron.compile(robot, "reach")(wide)[2]
    hold = np.abs(pteron.compile(robot, "regularity")(wide))
    expected = wide[(sine >= 0.1).all(axis=-1) & (hold >= 0.1)]
    assert len(expected) > 200
    for one, other in zip(found.T, expected.T, strict=True):
        assert ks_2samp(one, other).pvalue > 1e-3


def test_random_poses_are_seeded():
    robot = CATALOG["quadrupteron"]
    np.testing.assert_array_equal(
        pteron.random_poses(robot, 3), pteron.random_poses(robot, 3, seed=0)
    )
    first = pteron.random_poses(robot, 10, seed=1)
    np.testing.assert_array_equal(first, pteron.random_poses(robot, 10, seed=1))
    rng = np.random.default_rng(1)
    np.testing.assert_array_equal(first, pteron.random_poses(robot, 10, seed=rng))
    assert (first != pteron.random_poses(robot, 10, seed=rng)).all()
    assert (first != pteron.random_poses(robot, 10, seed=2)).all()


def test_random_poses_of_legs_that_have_no_common_reach():
    robot = CATALOG["tripteron"]
    far = replace(robot.legs[0], guide_point=(0.0, 10.0, 0.0))
    with pytest.raises(ModelError, match=r"tripteron: only 0 of .* bring the guide points nearer"):
        pteron.random_poses(replace(robot, legs=(far, *robot.legs[1:])), 5)
