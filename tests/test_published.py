"""Machines whose makers, or writers about them, published their own numbers."""

import numpy as np
import pytest

import pteron

# A Tripteron router: github.com/Senki16/tripteron-cnc-router, 04_Calculations.

MILLIMETRES = np.array([[0, 0, 0], [90, 90, 90], [-90, -90, -90], [90, -90, 90]])
"""Home and three corners, where the router's free-body analysis was published."""

PRINTED = np.array(
    [
        [-80.91187278870954, -80.91187278868028, 157.8862200000283],
        [-81.3855698902187, -81.38556989001836, 156.2823155836013],
        [-79.38617876498388, -79.38617876494766, 161.99261989984007],
        [-81.38556989029689, -79.3861787648187, 155.03106784177908],
    ]
)
"""N, from 60 equations of equilibrium by least squares, which left them nine digits."""


def test_router_holds_its_tool():
    robot = pteron.load("tripteron-router")
    pose, rest = MILLIMETRES * 1e-3, np.zeros(3)
    forces = pteron.inverse_dynamics(robot, pose, rest, rest, wrench=[80.0, 80.0, -120.0])
    np.testing.assert_allclose(forces, PRINTED, rtol=0, atol=1e-9)


def test_router_at_home():
    robot = pteron.load("tripteron-router")
    home = np.zeros(3)
    np.testing.assert_allclose(pteron.inverse_kinematics(robot, home), 0.1, rtol=1e-15)
    upper, lower = pteron.link_vectors(robot, home)
    elbows = np.array([[0, 0, 1], [0, 0, 1], [0, 1, 0]])
    np.testing.assert_allclose(upper + lower, 0.24 * np.eye(3)[[1, 0, 0]], atol=1e-15)
    assert (np.sum(upper * elbows, axis=-1) > 0.2).all()


def test_router_s_links_are_where_it_printed_them():
    """Case 2 of its kinematics at t = 0: b1 .. b3 in mm, then angles of links in degrees."""
    robot = pteron.load("tripteron-router")
    pose = np.array([0.0, -0.04, 0.0])
    np.testing.assert_allclose(
        pteron.inverse_kinematics(robot, pose), [0.1, 0.06, 0.1], rtol=1e-14
    )
    along, towards = np.eye(3)[[1, 0, 0]], np.eye(3)[[2, 2, 1]]
    upper, lower = (
        np.degrees(np.arctan2(np.sum(link * towards, axis=-1), np.sum(link * along, axis=-1)))
        for link in pteron.link_vectors(robot, pose)
    )
    printed = [65.37568164783592, 59.99999999999999, 50.08032532232782]
    np.testing.assert_allclose(upper, printed, rtol=1e-13)
    printed = [-65.37568164783592, -59.99999999999999, -69.00496973837906]
    np.testing.assert_allclose(lower, printed, rtol=1e-13)


# A colinear Tripteron: github.com/oliof/RepRapFirmware,
# src/Movement/Kinematics/ColinearTripteronKinematics.cpp, with "M669 K12 A30 T0:120:240".


def test_colinear_tripteron_moves_as_its_firmware_says():
    robot = pteron.load("tripteron-colinear")
    tilt, towers = np.tan(np.radians(30)), np.radians([0, 120, 240])
    rows = np.column_stack([tilt * np.sin(towers), -tilt * np.cos(towers), np.ones(3)])
    pose = np.random.default_rng(1).uniform([-0.08, -0.08, 0], [0.08, 0.08, 0.2], (20, 3))
    joints = pteron.inverse_kinematics(robot, pose)
    np.testing.assert_allclose(joints, pose @ rows.T, rtol=0, atol=1e-15)
    np.testing.assert_allclose(pteron.jacobian(robot, pose[0]), rows, rtol=0, atol=1e-15)


# Deltas.


def only_pose(robot, joints):
    """Return the one pose of the robot's working mode."""
    poses = pteron.direct_kinematics(robot, joints)
    (pose,) = poses[~np.isnan(poses).any(axis=-1)]
    return pose


def delta(base, platform, crank, rod):
    """Return a Delta in metres whose legs are at azimuths -90, 30 and 150 degrees, angles down."""
    legs = []
    for azimuth in np.radians([-90, 30, 150]):
        out = np.array([np.cos(azimuth), np.sin(azimuth), 0])
        legs.append(
            pteron.RSS(
                guide_point=base * out,
                direction=np.cross([0, 0, 1], out),
                zero_direction=out,
                platform_point=platform * out,
                upper_length=crank,
                lower_length=rod,
                upper=pteron.PlanarInertia.of_body(0.1, (crank / 2, 0.0), 0.1 * crank**2 / 3),
                lower=pteron.RodInertia.of_body(0.1, (-rod / 2,), 0.1 * rod**2 / 3),
                elbow=-1,
            )
        )
    platform = pteron.Platform("3T", pteron.PlanarInertia.of_body(0.1, (0.0, 0.0), 1e-4))
    return pteron.Manipulator("delta", platform, tuple(legs))


def test_the_tutorial_s_delta():
    """The tutorial of forums.trossenrobotics.com, "Delta robot kinematics": sides of triangles.

    z is asserted in github.com/firepick1/FireREST, www/js/DeltaModel.js, by the tutorial's code.
    """
    across = 2 * np.sqrt(3)
    robot = delta(0.4573 / across, 0.115 / across, 0.112, 0.232)
    np.testing.assert_allclose(
        only_pose(robot, np.zeros(3)), [0, 0, -0.096859015], rtol=0, atol=5e-10
    )


FLEXPICKER = [
    ([0, 0, 0], [0, 0, -1064.4517]),
    ([10, 20, 30], [108.1354, -180.3484, -1243.5413]),
    ([-20.5, -20.5, -20.5], [0, 0, -900.3195]),
    ([47.5, -11.6, 21.4], [300.4598, 499.9385, -1099.8281]),
    ([0, 0, 60], [619.5159, -357.6777, -1040.1298]),
]
"""Degrees and mm: github.com/Pieces98/Deltarobot_Kinematics, README.md, after R. L. Williams II,
"The Delta Parallel Robot: Kinematics Solutions"."""


@pytest.mark.parametrize(("degrees", "millimetres"), FLEXPICKER)
def test_the_flexpicker(degrees, millimetres):
    robot = delta(0.567 / (2 * np.sqrt(3)), 0.076 / np.sqrt(3), 0.524, 1.244)
    found = 1e3 * only_pose(robot, np.radians(degrees))
    np.testing.assert_allclose(found, millimetres, rtol=0, atol=5e-5)
    joints = pteron.inverse_kinematics(robot, 1e-3 * np.array(millimetres))
    np.testing.assert_allclose(np.degrees(joints), degrees, rtol=0, atol=1e-5)


def test_the_rl5_1450_with_level_cranks():
    """The source gives the angle at which cranks are level: then the rods reach 0.625 m inwards."""
    for name, rest in (("delta", []), ("delta-4", [0.5])):
        robot = pteron.load(name)
        level = np.array([*3 * [np.radians(5.327998)], *rest])
        pose = [0, 0, -np.sqrt(1.055**2 - (0.330 + 0.420 - 0.125) ** 2), *rest]
        np.testing.assert_allclose(only_pose(robot, level), pose, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["delta", "delta-4"])
def test_the_rl5_1450_goes_there_and_back(name):
    robot = pteron.load(name)
    pose = pteron.random_poses(robot, 200, type_i=0.2, type_ii=0.1, seed=2)
    joints = pteron.inverse_kinematics(robot, pose)
    found = pteron.direct_kinematics(robot, joints)
    off = np.abs(found - pose[:, None, :]).max(axis=-1)
    assert np.nanmin(off, axis=-1).max() < 1e-12


def test_the_omnid_is_within_its_limits_where_it_works():
    """github.com/omnid/nuhal, include/common/parameters.h: cranks, workspace and moved mass."""
    robot = pteron.load("delta-omnid")
    heights = np.column_stack([np.zeros((2, 2)), [0.28, 0.45]])
    joints = np.degrees(pteron.inverse_kinematics(robot, heights))
    assert (joints > -5).all()
    assert (joints < 80).all()
    moved = robot.platform.inertia.mass + sum(
        body.mass for leg in robot.legs for body in leg.bodies.values()
    )
    np.testing.assert_allclose(moved, 0.9, rtol=1e-15)
