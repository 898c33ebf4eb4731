"""Machines whose makers, or writers about them, published their own numbers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pteron


def outwards(azimuth):
    """Return the horizontal unit vector at an azimuth in degrees."""
    return np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.0])


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
    upper, lower = pteron.kinematics.link_vectors(robot, home)
    elbows = np.array([[0, 0, 1], [0, 0, 1], [0, 1, 0]])
    np.testing.assert_allclose(upper + lower, 0.24 * np.eye(3)[[1, 0, 0]], atol=1e-15)
    assert (np.sum(upper * elbows, axis=-1) > 0.2).all()


def test_router_s_links_are_where_it_printed_them():
    """Case 2 of its kinematics at t = 0: b1 .. b3 in mm, then angles of links in degrees."""
    robot = pteron.load("tripteron-router")
    pose = np.array([0.0, -0.04, 0.0])
    np.testing.assert_allclose(pteron.inverse_kinematics(robot, pose), [0.1, 0.06, 0.1], rtol=1e-14)
    along, towards = np.eye(3)[[1, 0, 0]], np.eye(3)[[2, 2, 1]]
    upper, lower = (
        np.degrees(np.arctan2(np.sum(link * towards, axis=-1), np.sum(link * along, axis=-1)))
        for link in pteron.kinematics.link_vectors(robot, pose)
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
    for azimuth in (-90, 30, 150):
        out = outwards(azimuth)
        legs.append(
            pteron.legs.RSS(
                guide_point=base * out,
                direction=np.cross([0, 0, 1], out),
                zero_direction=out,
                platform_point=platform * out,
                upper_length=crank,
                lower_length=rod,
                upper=pteron.bodies.PlanarInertia.of_body(
                    0.1, (crank / 2, 0.0), 0.1 * crank**2 / 3
                ),
                lower=pteron.bodies.RodInertia.of_body(0.1, (-rod / 2,), 0.1 * rod**2 / 3),
                elbow=-1,
            )
        )
    platform = pteron.platforms.Platform(
        "3T", pteron.bodies.PlanarInertia.of_body(0.1, (0.0, 0.0), 1e-4)
    )
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


LEVEL = np.radians(5.327998)
"""Where a crank of the RL5-1450 is level, by its source."""


def test_the_rl5_1450_with_level_cranks():
    """The rods then reach 0.330 + 0.420 - 0.125 m inwards."""
    pose = np.array([0, 0, -np.sqrt(1.055**2 - 0.625**2)])
    robot = pteron.load("delta")
    np.testing.assert_allclose(only_pose(robot, 3 * [LEVEL]), pose, rtol=0, atol=1e-12)
    joints = pteron.inverse_kinematics(pteron.load("delta-4"), [*pose, 0.5])
    np.testing.assert_allclose(joints, [LEVEL, LEVEL, LEVEL, 0.5], rtol=0, atol=1e-12)


def test_the_rl5_1450_goes_there_and_back():
    robot = pteron.load("delta")
    pose = pteron.random_poses(robot, 200, type_i=0.2, type_ii=0.2, seed=2)
    joints = pteron.inverse_kinematics(robot, pose)
    found = np.array([only_pose(robot, one) for one in joints])
    np.testing.assert_allclose(found, pose, rtol=0, atol=1e-12)


def test_the_omnid_has_its_limits_and_its_mass():
    """github.com/omnid/nuhal, include/common/parameters.h."""
    robot = pteron.load("delta-omnid")
    for leg in robot.legs:
        np.testing.assert_allclose(np.degrees(leg.limits), [-5, 80], rtol=1e-15)
    bodies = [body for leg in robot.legs for body in leg.bodies.values()]
    moved = sum(body.mass for body in [robot.platform.inertia, *bodies])
    np.testing.assert_allclose(moved, 0.9, rtol=1e-15)


# Sliders and rods.


def test_kossel_at_its_end_stops():
    """github.com/Klipper3d/klipper, config/printer-anycubic-kossel-2016.cfg: mm.

    position_endstop 273, arm_length 229.4, delta_radius 99.8.
    """
    robot = pteron.load("linear-delta")
    stops = 0.273 + np.sqrt(0.2294**2 - 0.0998**2)
    joints = pteron.inverse_kinematics(robot, [0, 0, 0.273])
    np.testing.assert_allclose(joints, stops, rtol=0, atol=1e-15)
    assert all(stops < leg.limits[1] < stops + 0.001 for leg in robot.legs)


def test_orthoglide_is_as_fast_as_it_was_designed_to_be():
    """Chablat and Wenger: a cube of 0.2 m, factors of speed from 1/2 to 2, a stroke of 0.257 m."""
    robot = pteron.load("orthoglide")
    length = robot.legs[0].lower_length
    assert f"{length:.2f}" == "0.31"
    low, high = -length / np.sqrt(6), length / np.sqrt(18)
    np.testing.assert_allclose(high - low, 0.2, rtol=1e-15)
    corners = pteron.jacobian(robot, [[0, 0, 0], 3 * [high], 3 * [low]])
    factors = 1 / np.linalg.svd(corners, compute_uv=False)
    expected = [[1, 1, 1], [4 / 5, 4 / 5, 2], [1 / 2, 2, 2]]
    np.testing.assert_allclose(factors, expected, rtol=1e-14)
    cube = np.stack(np.meshgrid(*3 * [np.linspace(low, high, 7)]), axis=-1).reshape(-1, 3)
    factors = 1 / np.linalg.svd(pteron.jacobian(robot, cube), compute_uv=False)
    assert factors.min() > 0.5 - 1e-14
    assert factors.max() < 2 + 1e-14
    joints = pteron.inverse_kinematics(robot, cube)
    assert {f"{stroke:.3f}" for stroke in np.ptp(joints, axis=0)} == {"0.257"}


# An articulated platform.


def test_par4_is_the_one_of_its_source():
    """github.com/ROBNUX/arm_kinematics_trajectory, robnux_kinematics_map/src/quattro_4.cpp.

    Its inverse kinematics with the parameters of quattro_bot/test/test_quattro4_rviz.cpp: its pose
    is the middle of a link, and its yaw that link's direction.
    """
    robot = pteron.load("par4")
    pose = pteron.random_poses(robot, 100, type_i=0.3, type_ii=0.1, seed=3)
    base, upper, lower, link, offset = 0.15, 0.2, 0.51, 0.127, 0.09
    middle, yaw = pose[:, :3] + [offset / 2, offset / 2, 0], pose[:, 3] + np.radians(135)
    half = link / 2 * np.column_stack([np.cos(yaw), np.sin(yaw), 0 * yaw])
    for i, (side, bar) in enumerate([(-1, offset), (-1, 0), (1, 0), (1, offset)]):
        x, y, z = (middle + side * half - [bar, bar, 0]).T
        c, s = np.cos((i - 1) * np.pi / 2), np.sin((i - 1) * np.pi / 2)
        a1 = (c * base - x) ** 2 + (s * base - y) ** 2 + z**2 + upper**2
        a2 = 2 * base * upper - 2 * upper * (c * x + s * y)
        a3 = 2 * z * upper
        q = np.pi - np.arcsin((lower**2 - a1) / np.hypot(a2, a3)) - np.arctan2(a2, a3)
        found = pteron.inverse_kinematics(robot, pose)[:, i]
        np.testing.assert_allclose(np.remainder(q - found + 1, 2 * np.pi), 1, rtol=0, atol=1e-12)


# Planar machines.


@pytest.mark.parametrize(
    ("link", "height", "right", "left"),
    [(1.0, np.sqrt(5 + 2 * np.sqrt(5)) / 2, 72, 108), (np.sqrt(0.5), 1.5, 90, 90)],
    ids=["pentagon", "little house"],
)
def test_five_bars_as_polygons(link, height, right, left):
    """A regular pentagon, and a square with a roof: FiveBarKinematicsTest.java in
    github.com/vfox100/all26, lib/src/test/java/org/team100/lib/kinematics/five_bar.
    """
    robot = pteron.load("five-bar")
    places = zip(robot.legs, (-0.5, 0.5), strict=True)
    legs = [
        replace(leg, guide_point=(x, 0.0, 0.0), upper_length=1.0, lower_length=link)
        for leg, x in places
    ]
    joints = np.degrees(pteron.inverse_kinematics(replace(robot, legs=legs), [0, height]))
    np.testing.assert_allclose(joints, [left, right], rtol=1e-14)


def test_a_3prr_at_round_sliders():
    """github.com/1at7/3PRR-robot, main.m: the pose is where its sliders are at 200, 220 and 240.

    Corners of the base 300 apart, of the platform 100, links of 100; it prints four decimals.
    """
    robot = pteron.load("3-prr")
    legs = [
        replace(
            leg,
            guide_point=np.array(leg.guide_point) / np.sqrt(3),
            platform_point=outwards(azimuth) * 0.1 / np.sqrt(3),
            lower_length=0.1,
            elbow=-1,
        )
        for leg, azimuth in zip(robot.legs, (210, 330, 90), strict=True)
    ]
    robot = replace(robot, legs=legs)
    joints = pteron.inverse_kinematics(robot, [-0.0225884, -0.0029059, 0.6446])
    np.testing.assert_allclose(joints, [0.2, 0.22, 0.24], rtol=0, atol=1e-6)


def test_the_3prr_s_home():
    """github.com/shalabymhd/3prr-parallel-robot, IDM_3PRR.m: d0, and links at 30 degrees."""
    robot = pteron.load("3-prr")
    home = np.zeros(3)
    joints = pteron.inverse_kinematics(robot, home)
    np.testing.assert_allclose(joints, np.sqrt(3) * 0.1, rtol=1e-14)
    _, lower = pteron.kinematics.link_vectors(robot, home)
    along = [leg.slider_direction for leg in robot.legs]
    np.testing.assert_allclose(np.sum(lower * along, axis=-1), 0.2 * np.cos(np.pi / 6), rtol=1e-14)


# Reachy Mini: pollen-robotics/reachy_mini, kinematics_data.json; the head level at z = 0.177 m.

REACHY_LEVEL = [0.6265471361608503, -0.6265425506844712, 0.6265402507582244]
REACHY_LEVEL += [-0.6265361796605952, 0.6265371961549016, -0.62653923545576]
"""rad; twelve digits of its geometry stand in the catalog's file."""


def test_reachy_minis_joint_angles_count_as_its_own():
    found = pteron.inverse_kinematics("reachy-mini", [0.0, 0.0, 0.177, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(found, REACHY_LEVEL, atol=1e-9)


# The hexapods of the Rubin Observatory: lsst-ts/ts_mthexapod, constants.py, micrometres.

PIVOTS = {"rubin-camera-hexapod": -2758400, "rubin-m2-hexapod": -703000}
STRUTS = {
    "rubin-camera-hexapod": (
        [
            *[[227600, 653800, -525000], [-227600, 653800, -525000], [-680000, -129700, -525000]],
            *[[-452300, -524000, -525000], [452300, -524000, -525000], [680000, -129700, -525000]],
        ],
        [
            *[[472800, 512200, -121400], [-472800, 512200, -121400], [-680000, 153300, -121400]],
            *[[-207200, -665500, -121400], [207200, -665500, -121400], [680000, 153300, -121400]],
        ],
    ),
    "rubin-m2-hexapod": (
        [
            *[[0, 1701800, 114300], [-1542350, -719210, 114300], [1542350, -719210, 114300]],
            *[[790, 1460490, 228600], [-1503370, 7660, 228600], [1503370, 7660, 228600]],
        ],
        [
            *[[0, 1701800, 607300], [-1542350, -719210, 607300], [1542350, -719210, 607300]],
            *[[493790, 1460490, 228600], [-1256870, -419290, 228600], [1256870, -419290, 228600]],
        ],
    ),
}


@pytest.mark.parametrize("name", [*STRUTS])
def test_rubins_struts_are_as_long_as_its_software_says(name):
    base, mirror = (np.array(points) * 1e-6 for points in STRUTS[name])
    pivot = np.array([0.0, 0.0, PIVOTS[name] * 1e-6])
    moves = np.random.default_rng(4).uniform(-1.0, 1.0, (1000, 6)) * np.repeat([0.01, 0.005], 3)
    turned = Rotation.from_euler("XYZ", moves[:, 3:]).as_matrix()
    # The mirror turns about the pivot, then moves.
    ends = (mirror - pivot) @ np.swapaxes(turned, -1, -2) + pivot + moves[:, None, :3]
    lengths = np.linalg.norm(ends - base, axis=-1)
    np.testing.assert_allclose(pteron.inverse_kinematics(name, moves), lengths, atol=1e-9)
