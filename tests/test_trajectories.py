"""Trajectories: smooth, through their poses, within every limit, and refused where impossible."""

import json
from dataclasses import replace
from functools import lru_cache

import numpy as np
import polars as pl
import pytest
from differences import along as derivative
from mechanisms import CATALOG, CLIENTS, MECHANISMS, NIGHTLY, gated, random_machine, states
from phase_plane import random_limits, random_poses, shortest_duration, size_of
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.controllers import ComputedTorque
from pteron.legs.motor_limits import speed_lines
from pteron.motion import (
    FourierSeries,
    Motion,
    check_motion,
    cycle_path,
    fourier_motion,
    jerk_limited,
    limits_of,
    line_path,
    peaks,
    pick_and_place,
    point_to_point,
    polynomial_motion,
    replay,
    return_path,
    shortest,
    simulate,
    time_optimal,
    with_payload,
)
from pteron.motion.trajectories.time_polynomials import polynomial
from pteron.tables import Table
from pteron.workspace import home_pose

MACHINES = {
    **MECHANISMS,
    **{name: CATALOG[name] for name in ("linear-delta", "par4", "five-bar", "3-rrr", "3-prr")},
    "delta-4": CATALOG["delta-4"],
    "sliding": random_machine(0, "PRSSI"),
    "off axis": replace(
        CATALOG["quadrupteron"],
        platform=replace(CATALOG["quadrupteron"].platform, tool=(0.03, -0.02, 0.01)),
    ),
}
TOOLS = (
    "quadrupteron",
    "delta",
    "par4",
    "five-bar",
    "3-rrr",
    "quadrupteron turned",
    "random PRR 0",
)


@pytest.mark.parametrize("name", gated(TOOLS, ["delta", "par4", "3-rrr", "random PRR 0"]))
def test_a_payload_is_the_weight_and_the_inertia_of_a_point_at_the_tool(name):
    # Power: what the drives give more is what the point mass takes, d/dt of its energy.
    robot = MACHINES[name]
    robot = replace(robot, platform=replace(robot.platform, tool=(0.03, -0.02, 0.05)))
    pose, velocity, acceleration = states(robot, 20, seed=4)
    more = [
        pteron.inverse_dynamics(machine, pose, velocity, acceleration)
        for machine in (with_payload(robot, 1.7), robot)
    ]
    rates = pteron.kinematics.joint_rates(robot, pose, velocity).actuated
    given = ((more[0] - more[1]) * rates).sum(axis=-1)

    def tool(times):
        poses = pose + times * velocity + 0.5 * times**2 * acceleration
        p, axes = robot.platform.placement(poses)
        return p + robot.platform.tool @ axes

    step = 1e-3
    v = derivative(lambda t: np.array([tool(k) for k in t]), step)
    a = derivative(
        lambda t: np.array([derivative(lambda u, k=k: [tool(k + w) for w in u], step) for k in t]),
        step,
    )
    taken = 1.7 * ((a - robot.gravity) * v).sum(axis=-1)
    np.testing.assert_allclose(given, taken, rtol=1e-6, atol=1e-6 * np.abs(taken).max())


def test_a_payload_that_is_none_or_impossible():
    robot = MACHINES["quadrupteron"]
    assert with_payload(robot, 0.0) == robot
    for wrong in (-1.0, np.nan, np.inf):
        with pytest.raises(pteron.DataError, match=r"payload: .* kg or more"):
            with_payload(robot, wrong)
    for wrong in ("heavy", None):
        with pytest.raises(pteron.DataError, match=r"^mass: .* a number expected"):
            with_payload(robot, wrong)
    slides = MACHINES["sliding"]
    assert with_payload(slides, 1.0).platform.inertia.mass == slides.platform.inertia.mass + 1.0
    askew = replace(slides, platform=replace(slides.platform, tool=(0.1, 0.0, 0.0)))
    with pytest.raises(pteron.ModelError, match=r"0\.1 m off the axis"):
        with_payload(askew, 1.0)


DRIVE = pteron.legs.Drive(
    coulomb=1.5, viscous=6.0, offset=0.4, rotor_inertia=0.02, ratio=5.0, max_speed=2.0
)
STRIBECK = replace(DRIVE, stribeck=pteron.legs.Stribeck(0.7, 0.02))


def driven(robot, drive=DRIVE, **more):
    """Return the machine with these drives."""
    return replace(robot, legs=[replace(leg, drive=replace(drive, **more)) for leg in robot.legs])


# The searches for home poses would take most of the time.
HOMES = {
    "3-prr": (0.0, 0.0, -0.087),
    "3-rrr-point": (0.3, 0.25),
    "delta-redundant": (0.0, 0.0, -0.635),
    "3-rrr": (0.0, 0.0, 0.0),
    "3-upu": (0.0, 0.0, 0.4),
    "delta": (0.0, 0.0, -1.0),
    "delta-4": (0.0, 0.0, -1.0, 0.0),
    "delta-omnid": (0.0, 0.0, 0.36),
    "five-bar": (0.0, 0.138),
    "h4": (0.0, 0.129, -0.345, 0.0),
    "linear-delta": (0.0, 0.0, 0.1),
    "3-rpr": (0.0, 0.0, 0.0),
    "orthoglide": (-0.04, -0.04, -0.04),
    "par4": (0.0, 0.0, -0.45, 0.0),
    "quadrupteron": (0.0, 0.0, 0.0, 0.0),
    "quadrupteron-oblique": (0.01, 0.03, -0.06, 0.0),
    "tripteron": (-0.01, -0.01, -0.01),
    "tripteron-colinear": (0.0, 0.0, 0.1),
    "tripteron-oblique": (-0.02, -0.09, -0.05),
    "tripteron-router": (0.01, 0.01, 0.01),
}


@lru_cache
def home(name):
    return np.array(HOMES[name]) if name in HOMES else home_pose(MACHINES[name])


@lru_cache
def around(name, count=4):
    """Return poses (count, m) about a machine's home pose, within its reach."""
    robot = MACHINES[name]
    size = np.array([0.25 if c == "phi" else 0.02 for c in robot.coordinates])
    steps = np.random.default_rng(5).uniform(-1.0, 1.0, (count, robot.freedom))
    return home(name) + size * steps


def sides(robot, motion, finer=10):
    """Return joints' speeds, accelerations and the drives' forces at so many times the samples."""
    fine = motion.at(np.linspace(0.0, motion.duration, finer * (len(motion.time) - 1) + 1))
    return (
        pteron.kinematics.joint_rates(robot, *fine[:2]).actuated,
        pteron.kinematics.joint_accelerations(robot, *fine).actuated,
        pteron.drive_forces(robot, *fine),
    )


def used(robot, motion, limits, finer=10):
    """Return the largest share of a limit that a motion takes, between its samples too."""
    sizes = (np.abs(part).max(axis=0) for part in sides(robot, motion, finer))
    kept = limits.speed, limits.acceleration, limits.force
    return max(float((size / limit).max()) for size, limit in zip(sizes, kept, strict=True))


PATHS = ("quadrupteron", "3-rrr", "random PRR 0", "sliding", "par4")


@lru_cache
def paths(name):
    """Return a cornered path with its way back, and that of a pick-and-place cycle."""
    robot = MACHINES[name]
    lines = return_path(line_path(robot, around(name), 0.005))
    return lines, cycle_path(pick_and_place(robot, home(name)))


@pytest.mark.parametrize("law", ["quintic", "seventh"])
def test_a_polynomial_rests_at_both_ends(law):
    progress = polynomial(law)
    tau = np.linspace(0.01, 0.99, 50)
    for order in range(2):
        found = derivative(lambda t, k=order: np.array([progress(tau + u)[k] for u in t]), 1e-4)
        np.testing.assert_allclose(found, progress(tau)[order + 1], atol=1e-9)
    np.testing.assert_allclose(
        progress(np.array([-1.0, 0.0, 1.0, 2.0])), [[0, 0, 1, 1], [0] * 4, [0] * 4], atol=1e-12
    )
    begin = derivative(lambda t: np.array([progress(0.1 * np.abs(u))[2] for u in t]), 1e-3)
    assert law == "quintic" or abs(float(begin)) < 1e-12


@CLIENTS
@pytest.mark.parametrize("name", PATHS)
def test_a_path_is_smooth_in_what_it_has_gone(name):
    for path in paths(name):
        step = 1e-4 * path.length
        s = np.random.default_rng(1).uniform(4.0 * step, path.length - 4.0 * step, 300)
        apart = np.abs(s[:, None] - path.rests).min(axis=1) > 5.0 * step
        s = s[apart]
        for order in range(2):
            found = derivative(
                lambda t, k=order, s=s, path=path: np.array([path.at(s + u)[k] for u in t]), step
            )
            exact = path.at(s)[order + 1]
            errors = np.abs(found - exact).max(axis=1) / np.abs(exact).max()
            # The third derivative jumps at a few places: differences reach across them.
            assert np.quantile(errors, 0.9) < 1e-7
            assert errors.max() < 2e-3
        ends = path.at(np.array(path.rests))[0]
        np.testing.assert_allclose(ends[0], ends[-1], atol=1e-12)


def test_a_path_goes_straight_between_its_corners_and_rounds_them():
    robot = MACHINES["off axis"]
    poses = home("quadrupteron") + np.array(
        [[0, 0, 0, 0], [0.04, 0, 0, 0.3], [0.04, 0.04, 0, 0.3], [0.04, 0.04, 0.04, 0.3]]
    )

    def tool(pose):
        p, axes = robot.platform.placement(pose)
        return p + robot.platform.tool @ axes

    stops = line_path(robot, poses)
    np.testing.assert_allclose(stops.at(np.array(stops.rests))[0], poses, atol=1e-12)
    s = np.linspace(*stops.rests[:2], 50)
    a, b = tool(poses[0]), tool(poses[1])
    np.testing.assert_allclose(np.cross(tool(stops.at(s)[0]) - a, b - a), 0.0, atol=1e-14)
    rounded = line_path(robot, poses, 0.01)
    assert rounded.rests == (0.0, rounded.length)
    fine = tool(rounded.at(np.linspace(0.0, rounded.length, 20001))[0])
    # A right angle without a turn on either side is passed at 0.265 times the cut.
    missed = np.linalg.norm(fine - tool(poses[2]), axis=-1).min()
    assert missed == pytest.approx(0.01 * 6.0 / 32.0 * np.sqrt(2.0), rel=1e-4)
    # All corners' cuts end in the middle of a line at most, and a way back is a rest.
    assert line_path(robot, poses, 1.0).rests == (0.0, pytest.approx(rounded.length, abs=1e-12))
    assert len(line_path(robot, poses[[0, 1, 0, 2]], 0.01).rests) == 3


@pytest.mark.parametrize("name", ["quadrupteron", "par4"])
def test_a_cycles_path_is_that_of_the_cycle(name):
    robot = MACHINES[name]
    cycle = pick_and_place(robot, home(name), samples=101)
    path = cycle_path(cycle)
    fine = path.at(np.linspace(0.0, path.length / 2.0, 20001))[0]
    for pose in cycle.pose[:51]:
        k = int(np.linalg.norm(fine - pose, axis=-1).argmin())
        a, b = fine[max(k - 1, 0)], fine[min(k + 1, 20000)]
        way = (b - a) / np.linalg.norm(b - a)
        off = pose - a - (pose - a) @ way * way
        assert np.linalg.norm(off) < 1e-6


MOUNTINGS = {"upright": (0, 0, -9.81), "hanging": (0, 0, 9.81), "on its side": (6.0, -7.8, 0)}


@pytest.mark.parametrize(
    "name", gated(pteron.catalog(), ["sprint-z3", "ball-table", "ankle-offset", "5-rpur"])
)
def test_a_standard_cycle_has_no_cusp_however_the_machine_is_mounted(name):
    for mounting, gravity in MOUNTINGS.items():
        robot = replace(pteron.load(name), gravity=gravity)
        for scale in (0.01, 0.3):
            path = cycle_path(pick_and_place(robot, home_pose(name), scale=scale))
            s = np.linspace(0.0, path.length / 2.0, 4001)
            weights = np.where(robot.platform.angular, 0.1, 1.0)
            _, first, second = (part * weights for part in path.at(s))
            tangents = first / np.linalg.norm(first, axis=-1, keepdims=True)
            turns = np.arccos(np.clip((tangents[40:] * tangents[:-40]).sum(axis=-1), -1.0, 1.0))
            # In one per cent of the way out the path turns by less than half a right angle.
            assert np.degrees(turns.max()) < 35.0, mounting
            bends = np.linalg.norm(second, axis=-1) * path.length / 2.0
            assert bends.max() < 80.0, mounting


@pytest.mark.parametrize(
    ("name", "drive"),
    [
        ("delta", DRIVE),
        ("random PRR 0", DRIVE),
        ("3-rrr", STRIBECK),
        *(
            pytest.param(*case, marks=NIGHTLY)
            for case in (
                ("quadrupteron-oblique +--+", DRIVE),
                ("3-rrr", DRIVE),
                ("quadrupteron-oblique +--+", STRIBECK),
                ("delta", STRIBECK),
                ("random PRR 0", STRIBECK),
            )
        ),
    ],
)
def test_a_motion_takes_the_shortest_time_within_the_limits(name, drive):
    robot = driven(MACHINES[name], drive)
    path = line_path(robot, around(name), 0.01)
    free = polynomial_motion(
        robot, path, duration=1.0, limits=limits_of(replace(robot), speed=np.inf)
    )
    _, accelerations, forces = sides(robot, free)
    for limits in (
        limits_of(robot, acceleration=3.0 * np.abs(accelerations).max(), speed=100.0),
        limits_of(robot, force=1.5 * np.abs(forces).max(axis=0) + 1.0, speed=100.0),
        limits_of(robot, speed=np.abs(sides(robot, free)[0]).max(axis=0)),
    ):
        found = polynomial_motion(robot, path, limits=limits)
        assert used(robot, found, limits) <= 1.0 + 1e-8
        # Samples are whole steps: a step less is too short.
        faster = Motion(
            found.time * 0.99, found.pose, found.velocity / 0.99, found.acceleration / 0.99**2
        )
        # Dry friction counts in full, at rest and moving.
        assert used(robot, faster, limits) > (1.0 if drive is DRIVE else 0.97)
        with pytest.raises(pteron.DataError, match=r"too short: leg .* its limit is .* shortest"):
            polynomial_motion(robot, path, limits=limits, duration=0.9 * found.duration)


def test_peaks_are_those_of_the_motion():
    robot = driven(MACHINES["random 3T1R 0"])
    motion = polynomial_motion(
        robot, line_path(robot, around("random 3T1R 0"), 0.01), duration=0.5, law="seventh"
    )
    found = peaks(robot, motion.pose, motion.velocity, motion.acceleration, limits_of(robot))
    sizes = [np.abs(part).max(axis=0) for part in sides(robot, motion, finer=1)]
    np.testing.assert_allclose(
        [peak.size for peak in found if peak.leg], np.concatenate(sizes), rtol=1e-10
    )
    assert [peak.limit for peak in found[:4]] == [2.0] * 4
    tool = np.linalg.norm(motion.velocity[:, :3], axis=-1).max()
    assert found[-2].size == pytest.approx(tool, rel=1e-12)


@pytest.mark.parametrize("name", gated(CATALOG, ["five-bar"]))
def test_the_fastest_motion_keeps_every_limit_and_is_never_slower(name):
    robot = driven(CATALOG[name]) if sum(map(ord, name)) % 2 else CATALOG[name]
    cycle = pick_and_place(robot, home(name))
    rates, _, forces = (np.abs(part).max(axis=0) for part in sides(robot, cycle, finer=1))
    limits = limits_of(robot, force=1.3 * forces + 1.0, speed=1.3 * rates + 0.1)
    path = cycle_path(cycle)
    fastest = time_optimal(robot, path, limits)
    assert used(robot, fastest, limits) <= 1.0 + 1e-8
    assert fastest.duration < polynomial_motion(robot, path, limits=limits).duration
    assert fastest.duration < shortest(robot, cycle.cycle.at, limits).duration
    assert fastest.duration < 1.03 * fastest.bound
    np.testing.assert_allclose(fastest.pose[[0, -1]], cycle.pose[[0, -1]], atol=1e-9)
    for part in (fastest.velocity, fastest.acceleration):
        np.testing.assert_allclose(part[[0, -1]], 0.0, atol=1e-6)


STRENGTHS = {"five-bar": 1.2, "3-rrr": 1.5, "delta": 1.3}


@pytest.mark.parametrize("name", gated(STRENGTHS, ["five-bar"]))
def test_a_force_keeps_its_limit_where_a_joint_reverses_between_samples(name):
    """There dry friction changes its sign: what was against the motion helps it."""
    robot, pose = CATALOG[name], home(name)
    still = np.zeros(robot.freedom)
    held = max(float(np.abs(pteron.inverse_dynamics(robot, pose, still, still)).max()), 1.0)
    robot = driven(robot, pteron.legs.Drive(coulomb=0.3 * held, viscous=0.02 * held))
    path = cycle_path(pick_and_place(robot, pose))
    slow = polynomial_motion(robot, path, duration=1.0)
    forces = np.abs(pteron.drive_forces(robot, slow.pose, slow.velocity, slow.acceleration))
    limits = limits_of(robot, force=STRENGTHS[name] * forces.max(axis=0))
    fastest = time_optimal(robot, path, limits)
    assert used(robot, fastest, limits, finer=100) <= 1.0 + 1e-8
    slowed = shortest(robot, pick_and_place(robot, pose).cycle.at, limits)
    assert used(robot, slowed, limits, finer=100) <= 1.0 + 1e-8
    rates = sides(robot, fastest, finer=1)[0]
    assert (rates[1:] * rates[:-1] < 0.0).any()


@pytest.mark.parametrize("corner", [1e-6, 1e-4, 2e-4, 5e-4, 1e-2])
def test_small_corners_take_the_time_of_the_phase_plane(corner):
    robot = MACHINES["tripteron"]
    poses = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0]]
    limits = limits_of(robot, acceleration=15.0)
    path = line_path(robot, poses, corner)
    fastest, exact = time_optimal(robot, path, limits), shortest_duration(robot, path, limits, 60)
    assert 0.99 * exact < fastest.bound <= exact * (1.0 + 1e-5)
    assert exact < fastest.duration < 1.015 * exact
    assert sides(robot, fastest)[1].max() <= 15.0 * (1.0 + 1e-8)
    # A polynomial time law stops at small corners, where passing them takes longer.
    stops = polynomial_motion(robot, line_path(robot, poses), limits=limits).duration
    rounded = polynomial_motion(robot, path, limits=limits).duration
    assert rounded < (1.002 if corner < 1e-3 else 1.3) * stops


@pytest.mark.parametrize("name", gated(pteron.catalog(), ["five-bar"]))
def test_random_paths_take_the_time_of_the_phase_plane(name):
    pytest.importorskip("numba")
    generator = np.random.default_rng(sum(map(ord, name)))
    robot = pteron.load(name)
    pose = home_pose(robot)
    hold = max(float(np.abs(pteron.inverse_dynamics(robot, pose, 0 * pose, 0 * pose)).max()), 1.0)
    robot = driven(robot, pteron.legs.Drive(0.03 * hold, 0.05 * hold, rotor_inertia=1e-5))
    poses = random_poses(robot, pose, generator)
    limits = random_limits(robot, line_path(robot, poses, 0.1 * size_of(robot)), generator)
    for corner in (1e-6, 1e-3 * size_of(robot), 0.1 * size_of(robot)):
        path = line_path(robot, poses, corner)
        fastest, exact = time_optimal(robot, path, limits), shortest_duration(robot, path, limits)
        assert fastest.bound <= exact * (1.0 + 1e-4)
        assert 0.999 * exact < fastest.duration < 1.02 * exact


def test_samples_too_far_apart_for_the_path_are_refused():
    robot = MACHINES["tripteron"]
    poses = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]
    path = line_path(robot, poses, 0.02)
    limits = limits_of(robot, acceleration=15.0)
    with pytest.raises(pteron.DataError, match=r"step: between samples 0\.2 s apart .* by \d.* mm"):
        polynomial_motion(robot, path, duration=1.0, step=0.2)
    with pytest.raises(pteron.DataError, match=r"step: .* leaves its path"):
        time_optimal(robot, path, limits, step=0.1)
    with pytest.raises(pteron.DataError, match=r"step: .* leaves its path"):
        jerk_limited(robot, poses[0], poses[2], 500.0, limits, step=0.1)
    # Without a step there are enough of them; a line needs few.
    motion = polynomial_motion(robot, line_path(robot, poses, 1e-4), duration=0.6)
    assert polynomial_motion(robot, line_path(robot, poses[:2]), duration=1.0, step=0.2)
    for line in (motion, time_optimal(robot, path, limits)):
        fine = line.at(np.linspace(0.0, line.duration, 10 * len(line.time)))[0]
        corner = np.minimum(np.abs(fine[:, 1]), np.abs(fine[:, 0] - 0.1))
        apart = np.abs(fine[:, :2] - [0.1, 0.0]).max(axis=1) > 0.0201
        assert corner[apart].max() < 2e-5
    with pytest.raises(pteron.DataError, match=r"step: 0\.0 given"):
        time_optimal(robot, path, limits, step=0.0)


def axis_move(**drive):
    """Return a Tripteron that moves along its first slider alone, and the mass that this moves."""
    robot = MACHINES["tripteron, no gravity"]
    robot = driven(robot, pteron.legs.Drive(**drive)) if drive else robot
    path = line_path(robot, [[-0.05, 0.0, 0.0], [0.1, 0.0, 0.0]])
    return robot, path, pteron.mass_matrix(robot, [0.0, 0.0, 0.0])[0, 0]


def test_the_fastest_motion_of_one_slider_is_the_textbook_s():
    robot, path, _ = axis_move()
    bang = time_optimal(robot, path, limits_of(robot, acceleration=20.0), step=1e-4)
    assert bang.bound == pytest.approx(2.0 * np.sqrt(0.15 / 20.0), rel=1e-6)
    cruise = time_optimal(robot, path, limits_of(robot, acceleration=20.0, speed=1.0), step=1e-4)
    assert cruise.bound == pytest.approx(0.15 / 1.0 + 1.0 / 20.0, rel=1e-3)
    finer = time_optimal(robot, path, limits_of(robot, acceleration=20.0), step=1e-5)
    assert 1.0 < finer.duration / finer.bound < 1.0015
    tool = time_optimal(robot, path, limits_of(robot, tool_acceleration=20.0), step=1e-4)
    assert 0.998 < tool.bound / bang.bound <= 1.0


def test_viscous_friction_is_bounded_tightly():
    # M v' = F - f - c v, then M v' = -F - f - c v: the switch is where the ways meet.
    robot, path, _ = axis_move(viscous=60.0, coulomb=4.0, rotor_inertia=0.1)
    limits = limits_of(robot, force=[60.0, 1e6, 1e6])
    fastest = time_optimal(robot, path, limits, step=1e-4)
    assert used(robot, fastest, limits) <= 1.0 + 1e-8
    poses = np.linspace([-0.05, 0.0, 0.0], [0.1, 0.0, 0.0], 20001)
    zero = np.zeros_like(poses)
    push = np.broadcast_to([1.0, 0.0, 0.0], poses.shape)
    mass = pteron.inverse_dynamics(robot, poses, zero, push)[:, 0] + 0.1
    square = pteron.inverse_dynamics(robot, poses, push, zero)[:, 0]
    h = 0.15 / 20000
    ahead, back = np.zeros(20001), np.zeros(20001)
    for k in range(20000):
        gain = (60.0 - 4.0 - 60.0 * np.sqrt(ahead[k]) - square[k] * ahead[k]) / mass[k]
        ahead[k + 1] = ahead[k] + 2.0 * h * gain
        j = 20000 - k
        loss = (60.0 + 4.0 + 60.0 * np.sqrt(back[j]) + square[j] * back[j]) / mass[j]
        back[j - 1] = back[j] + 2.0 * h * loss
    rate = np.sqrt(np.minimum(ahead, back))
    exact = (2.0 * h / (rate[1:] + rate[:-1])).sum()
    assert 0.99 < fastest.bound / exact <= 1.0
    assert 1.0 <= fastest.duration / exact < 1.012


FALLS = pteron.legs.Drive(rotor_inertia=0.1, curve=((0.0, 60.0), (0.4, 60.0), (1.2, 0.0)))
SUPPLIED = pteron.legs.Drive(
    rotor_inertia=1e-3, ratio=10.0, winding=pteron.legs.Winding(1.5, 0.5, 15.0)
)


@pytest.mark.parametrize("drive", [FALLS, SUPPLIED], ids=["curve", "winding"])
def test_the_fastest_motion_of_one_slider_is_what_its_motor_can_do(drive):
    """By SciPy: from either end as hard as the motor can, the switch is where the ways meet."""
    robot, path, mass = axis_move(coulomb=4.0)
    legs = [replace(robot.legs[0], drive=replace(drive, coulomb=4.0))]
    robot = replace(robot, legs=(*legs, *(replace(leg, drive=None) for leg in robot.legs[1:])))
    fastest = time_optimal(robot, path, limits_of(robot), step=1e-4)
    mass, square = mass + 0.1, pteron.inverse_dynamics(robot, [0, 0, 0], [1, 0, 0], [0, 0, 0])[0]

    def push(v):
        return np.interp(v, *np.array(FALLS.curve).T) if drive is FALLS else 50.0 - v * 50.0 / 3.0

    def brake(v):
        return push(v) if drive is FALLS else 50.0 + v * 50.0 / 3.0

    def reached(force, friction):
        """Return the speeds (2001,) over the way at which a force pushes all the time."""
        found = solve_ivp(
            lambda _, y: [y[1], (force(y[1]) + friction - square * y[1] ** 2) / mass], (0.0, 1.0),
            np.zeros(2), rtol=1e-10, atol=1e-12, dense_output=True,
        )  # fmt: skip
        time = np.linspace(0.0, 1.0, 100_001)
        way, speed = found.sol(time)
        return np.interp(np.linspace(0.0, 0.15, 20_001), way, speed)

    speeds = np.minimum(reached(push, -4.0), reached(brake, 4.0)[::-1])
    exact = (2.0 * 0.15 / 20_000 / (speeds[1:] + speeds[:-1])).sum()
    assert 0.99 < fastest.bound / exact <= 1.0
    assert 1.0 <= fastest.duration / exact < 1.012


def of_motor(robot, motion, finer=10):
    """Return the largest share of what curve and winding allow: R i + k w of the supply's V."""
    rates, _, forces = sides(robot, motion, finer)
    shares = [0.0]
    for rate, force, drive in zip(
        rates.T, forces.T, [leg.drive for leg in robot.legs], strict=True
    ):
        if drive.curve:
            shares.append((np.abs(force) / np.interp(np.abs(rate), *np.array(drive.curve).T)).max())
        if drive.winding:
            own, gear = drive.winding, drive.ratio
            volts = own.resistance * force / (gear * own.torque_constant)
            volts += own.torque_constant * gear * rate
            shares.append((np.abs(volts) / own.voltage).max())
    return max(shares)


def with_motors(name):
    """Return a machine whose motors have a curve or a winding that suit its cycle, and this."""
    robot = MACHINES[name]
    cycle = pick_and_place(robot, home(name), least=0.1)
    rates, _, forces = (float(np.abs(part).max()) for part in sides(robot, cycle, finer=1))
    curve = (0.0, 1.5 * forces), (0.5 * rates, 1.5 * forces), (1.5 * rates, 0.0)
    volts = 5.0 * 1.8 * rates
    winding = pteron.legs.Winding(5.0 * volts / (1.6 * forces), 1.0, volts)
    own = {"coulomb": 0.02 * forces, "viscous": 0.05 * forces / rates, "rotor_inertia": 1e-7}
    drives = [
        pteron.legs.Drive(ratio=5.0, **own, **({"winding": winding} if i % 2 else {"curve": curve}))
        for i in range(robot.joint_count)
    ]
    legs = [replace(leg, drive=drive) for leg, drive in zip(robot.legs, drives, strict=True)]
    return replace(robot, legs=tuple(legs)), cycle


ASKED = ("quadrupteron-oblique +--+", "random PRR 0", "sliding", "delta", "3-rrr", "par4")


@pytest.mark.parametrize("name", gated(ASKED, ["random PRR 0"]))
def test_no_motion_asks_more_than_the_motor_gives_at_its_speed(name):
    robot, cycle = with_motors(name)
    limits = limits_of(robot)
    assert not np.isfinite(limits.force).any()
    path = cycle_path(cycle)
    planned = (
        polynomial_motion(robot, path),
        shortest(robot, cycle.cycle.at, limits),
        time_optimal(robot, path),
    )
    for motion in planned:
        assert 0.98 < of_motor(robot, motion) <= 1.0 + 1e-8
    start, end = cycle.pose[0], cycle.pose[len(cycle.pose) // 2]
    quick = limits_of(robot, acceleration=1e3, speed=1e3)
    assert of_motor(robot, jerk_limited(robot, start, end, 1e6, quick)) <= 1.0 + 1e-8
    # A little faster is refused, and by whom it is refused is told.
    with pytest.raises(pteron.DataError, match=r"leg \d takes .* its limit at that speed is"):
        polynomial_motion(robot, path, duration=0.97 * planned[0].duration)
    fast = cycle.at(np.linspace(0.0, cycle.duration, 1001))
    told = {peak.leg: peak for peak in peaks(robot, *fast, limits) if peak.name == "force_at_speed"}
    assert set(told) == set(range(1, robot.joint_count + 1))
    rates, _, forces = sides(robot, Motion(np.linspace(0.0, 1.0, 1001), *fast), finer=1)
    most = np.interp(np.abs(rates[:, 0]), *np.array(robot.legs[0].drive.curve).T)
    assert told[1].share == pytest.approx((np.abs(forces[:, 0]) / most).max(), rel=1e-9)


@CLIENTS
@pytest.mark.parametrize("name", gated(ASKED, ["random PRR 0"]))
def test_a_plan_leaves_a_simulated_motor_within_what_it_gives(name):
    """A controller that follows the plan asks for no more; 1.3 times as fast it does."""
    robot, cycle = with_motors(name)
    path = cycle_path(cycle)
    planned = polynomial_motion(
        robot, path, duration=1.03 * polynomial_motion(robot, path).duration
    )
    parts = planned.pose, 1.3 * planned.velocity, 1.3**2 * planned.acceleration
    for motion, kept in ((planned, True), (Motion(planned.time / 1.3, *parts), False)):
        found = simulate(robot, motion, ComputedTorque(), limits=False)
        assert found.stopped is None
        assert (found.saturated_share == 0.0).all() == kept
        assert (np.abs(found.error).max() < 1e-4) == kept


def test_a_hollow_curve_is_kept_by_less_and_a_time_that_it_allows_is_not_refused():
    hollow = pteron.legs.Drive(curve=((0.0, 60.0), (0.3, 30.0), (0.6, 15.0), (3.0, 15.0)))
    robot, path, _ = axis_move(curve=hollow.curve)
    found = polynomial_motion(robot, path)
    assert of_motor(robot, found) <= 1.0 + 1e-8
    shorter = next(share for share in np.arange(0.5, 1.0, 0.01) if fits(robot, path, share, found))
    assert shorter < 0.95
    rng, speeds = np.random.default_rng(0), np.linspace(0.0, 6.0, 2001)
    for _ in range(300):
        points = np.sort(rng.uniform(0.0, 3.0, 4)), np.sort(rng.uniform(0.0, 9.0, 4))[::-1]
        drive = pteron.legs.Drive(curve=tuple(np.transpose(points).tolist()))
        most = np.interp(speeds, *points)
        lines = [one.force - one.fall * speeds for one in speed_lines(drive)]
        assert (np.min(lines, axis=0) <= most + 1e-9).all()
        assert np.min(lines, axis=0)[0] == pytest.approx(most[0])
        if (np.diff(np.diff(points[1]) / np.diff(points[0])) < 0.0).all():
            within = speeds <= points[0][-1]
            np.testing.assert_allclose(np.min(lines, axis=0)[within], most[within], atol=1e-9)


def fits(robot, path, share, found):
    """Say whether a share of a motion's time is taken; what is taken keeps what motors give."""
    try:
        faster = polynomial_motion(robot, path, duration=share * found.duration)
    except pteron.DataError:
        return False
    assert of_motor(robot, faster) <= 1.0 + 1e-6
    return True


def test_joints_with_limited_jerk_take_the_textbooks_time():
    robot = MACHINES["tripteron"]
    ends = [-0.05, 0.0, 0.0], [0.1, 0.0, 0.0]
    limits = limits_of(robot, speed=0.5, acceleration=5.0)
    found = jerk_limited(robot, *ends, 100.0, limits)
    assert found.duration == pytest.approx(0.15 / 0.5 + 0.5 / 5.0 + 5.0 / 100.0, abs=1e-3)


@pytest.mark.parametrize("name", ["quadrupteron", "delta", "3-rrr", "delta-4", "random PRR 0"])
def test_joints_with_limited_jerk_keep_their_limits(name):
    robot = driven(MACHINES[name], max_force=150.0)
    ends = around(name)[[0, 2]]
    limits = limits_of(robot, speed=1.0, acceleration=20.0)
    found = jerk_limited(robot, *ends, 500.0, limits)
    assert used(robot, found, limits) <= 1.0 + 1e-8
    np.testing.assert_allclose(found.pose[[0, -1]], ends, atol=1e-9)
    accelerations = sides(robot, found, finer=1)[1]
    jerks = np.diff(accelerations, axis=0) / np.diff(found.time)[:, None]
    assert np.abs(jerks).max() <= 500.0 * (1.0 + 1e-6)
    for part in (found.velocity, found.acceleration):
        np.testing.assert_allclose(part[[0, -1]], 0.0, atol=1e-9)


def test_a_fourier_series_has_its_own_derivatives_and_repeats():
    rng = np.random.default_rng(2)
    series = FourierSeries((0.0, 0.0, 0.0), *(0.01 * rng.normal(size=(2, 3, 3))), 1.5)
    motion = fourier_motion(MACHINES["tripteron"], series)
    time = rng.uniform(0.0, 1.5, 50)
    for order in range(2):
        found = derivative(lambda t, k=order: np.array([series.at(time + u)[k] for u in t]), 1e-3)
        np.testing.assert_allclose(found, series.at(time)[order + 1], rtol=1e-9, atol=1e-9)
    assert motion.repeat(2).duration == 3.0
    with pytest.raises(pteron.DataError, match=r"shapes .* expected"):
        FourierSeries((0.0,), ((1.0, 2.0),), ((1.0,),), 1.0)
    with pytest.raises(pteron.DataError, match="period"):
        FourierSeries((0.0,), ((1.0,),), ((1.0,),), 0.0)


def test_a_table_is_replayed_by_poses_or_by_joints():
    robot = MACHINES["3-rrr"]
    poses = around("3-rrr")
    motion = polynomial_motion(robot, line_path(robot, poses, 0.01), duration=0.8, law="seventh")
    joints = pteron.inverse_kinematics(robot, motion.pose)
    columns = {"t": motion.time}
    pose = columns | dict(zip(robot.coordinates, motion.pose.T, strict=True))
    crank = columns | dict(zip(robot.joint_names, joints.T, strict=True))
    whole = pose | {
        f"{order}{c}": values
        for order, part in (("d", motion.velocity), ("dd", motion.acceleration))
        for c, values in zip(robot.coordinates, part.T, strict=True)
    }
    for cells, digits in ((whole, 1e-15), (pose, 1e-4), (crank, 1e-4)):
        found = replay(robot, Table("a table", pl.DataFrame(cells)), start=poses[0])
        np.testing.assert_allclose(found.pose, motion.pose, atol=1e-9)
        np.testing.assert_allclose(found.velocity, motion.velocity, atol=digits)
        scale = np.abs(motion.acceleration).max()
        np.testing.assert_allclose(
            found.acceleration, motion.acceleration, atol=digits * scale * 10
        )
    with pytest.raises(pteron.DataError, match="start: the table holds joint coordinates"):
        replay(robot, Table("a table", pl.DataFrame(crank)))
    back = pl.DataFrame(pose)[[0, 2, 1, 3]]
    with pytest.raises(pteron.DataError, match=r"row 3, column t: 0\.001 s after 0\.002 s"):
        replay(robot, Table("a table", back))


def test_a_way_that_fails_is_refused_where_it_first_does():
    quadrupteron, five = MACHINES["quadrupteron"], MACHINES["five-bar"]
    with pytest.raises(
        pteron.UnreachablePose, match=r"0\.09\d* m along its 0\.4 m.*of leg 2"
    ) as error:
        point_to_point(quadrupteron, [0.0] * 4, [0.4, 0.0, 0.0, 0.0], duration=1.0)
    assert error.value.leg == 2
    assert error.value.shortfall > 0.1
    with pytest.raises(
        pteron.SingularPose, match=r"0, 1\.5708\]: comes to a singularity .*type II"
    ):
        point_to_point(quadrupteron, [0.0] * 4, [0.0, 0.0, 0.0, 2.0], duration=1.0)
    # The limits of the cranks come later on this way than the singularity.
    with pytest.raises(pteron.SingularPose, match=r"0\.0535\d* m along"):
        point_to_point(five, [0.0, 0.138], [0.0, -0.1], duration=1.0)
    with pytest.raises(
        pteron.UnreachablePose, match=r"leg 2: its crank passes its limits, -0\.258"
    ):
        point_to_point(five, [0.0, 0.138], [0.12, 0.0], duration=1.0)
    h4 = CATALOG["h4"]
    turned = home("h4") + np.array([0.0, 0.0, 0.0, 1.5])
    with pytest.raises(pteron.UnreachablePose, match=r"\]: phi comes to 1\.5 rad, its limits are"):
        point_to_point(h4, home("h4"), turned, duration=1.0)
    told = pytest.raises(pteron.UnreachablePose, match=r"out of the reach.*is it in millimetres")
    with pytest.warns(pteron.UnlikelyValue, match="are these mm"), told:
        point_to_point(five, [0.0, 138.0], [0.0, 100.0], duration=1.0)


def test_a_way_is_followed_between_its_samples():
    # Three samples far apart: between two of them the platform turns by a half and back.
    robot = MACHINES["quadrupteron"]
    time = np.array([0.0, 1.0, 2.0])
    rest = np.zeros((3, 4))
    gone = rest.copy()
    gone[1, 3] = 12.0
    with pytest.raises(pteron.SingularPose, match=r"the motion, at 0\.\d+ s"):
        check_motion(robot, Motion(time, rest, gone, rest))
    gone[1] = [1.2, 0.0, 0.0, 0.0]
    with pytest.raises(pteron.UnreachablePose, match=r"the motion, at \d\.\d+ s.* reach of leg 4"):
        check_motion(robot, Motion(time, rest, gone, rest))


def test_drives_that_cannot_hold_the_machine_are_told():
    robot = driven(MACHINES["delta"], max_force=20.0)
    ends = [0.0, 0.0, -0.9], [0.0, 0.2, -0.9]
    with pytest.raises(
        pteron.ModelError, match=r"leg \d: its drive gives 20 N m, but .* alone take"
    ):
        point_to_point(with_payload(robot, 5.0), *ends)
    with pytest.raises(pteron.ModelError, match="alone take"):
        time_optimal(with_payload(robot, 5.0), line_path(robot, ends))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda r, a, b: point_to_point(r, a, b), "neither a duration nor a limit"),
        (lambda r, a, b: point_to_point(r, a, b, duration=0.0), "duration: 0.0 given"),
        (lambda r, a, b: point_to_point(r, a, b, duration=1.0, law="cubic"), "law: 'cubic'"),
        (lambda r, a, b: point_to_point(r, a, b, duration=1.0, step=-1), "step: -1 given"),
        (lambda r, a, b: point_to_point(r, a, b, duration=1e9), "10000000 are served"),
        (lambda r, a, b: point_to_point(r, a, a, duration=1.0), "2 is the same as 1"),
        (lambda r, a, b: line_path(r, [a]), r"shape \(1, 3\) given"),
        (lambda r, a, b: line_path(r, [a, b], -0.1), "corner: -0.1 given"),
        (lambda r, a, b: limits_of(r, speed=[1.0, 2.0]), "2 numbers given, one expected or 3"),
        (lambda r, a, b: limits_of(r, force=-1.0), "force: -1.0 given"),
        (lambda r, a, b: limits_of(r, tool_speed="fast"), "tool_speed: 'fast' given"),
        (lambda r, a, b: time_optimal(r, line_path(r, [a, b])), "nothing limits the acceleration"),
        (lambda r, a, b: jerk_limited(r, a, b, 10.0), "jerk and acceleration of every joint"),
        (
            lambda r, a, b: jerk_limited(r, a, a, 10.0, limits_of(r, acceleration=1.0)),
            "at start's already",
        ),
    ],
)
def test_what_makes_no_motion_is_refused(wrong, told):
    with pytest.raises(pteron.DataError, match=told):
        wrong(MACHINES["tripteron"], [0.0, 0.0, 0.0], [0.05, 0.0, 0.0])


def cycle(line):
    """Run `pteron cycle`; return its exit code, standard output, standard error."""
    result = CliRunner().invoke(app, ["cycle", *line.split()])
    return result.exit_code, result.stdout, result.stderr


def test_the_command_writes_a_cycle_that_forces_reads(tmp_path):
    out, again = tmp_path / "cycle.csv", tmp_path / "forces.csv"
    code, told, warned = cycle(
        f"tripteron --around 0 0 0 --optimal --force 60 --speed 1 1 2 --json --out {out}"
    )
    assert (code, warned) == (0, "")
    found = json.loads(told)
    robot = CATALOG["tripteron"]
    motion = replay(robot, out)
    assert (found["samples"], found["file"]) == (len(motion.time), str(out))
    assert found["duration"] == pytest.approx(motion.duration)
    assert found["duration"] < found["quintic_duration"]
    assert used(robot, motion, limits_of(robot, force=60.0, speed=[1.0, 1.0, 2.0])) <= 1.0 + 1e-8
    binding = {(peak["quantity"], peak["leg"]) for peak in found["peaks"] if peak["share"] > 0.98}
    assert binding
    assert all(leg in (1, 2, 3) for _, leg in binding)
    result = CliRunner().invoke(
        app, ["forces", "tripteron", "--drives", "--table", str(out), "--out", str(again)]
    )
    assert result.exit_code == 0
    frames = pl.read_csv(out), pl.read_csv(again)
    for name in robot.force_names:
        np.testing.assert_allclose(frames[0][name], frames[1][name], atol=1e-9)
    assert frames[0].columns[:4] == ["t", "x", "y", "z"]
    for rate, joint in (("drho1", "rho1"), ("ddrho1", "drho1")):
        slope = np.gradient(frames[0][joint].to_numpy(), frames[0]["t"].to_numpy())
        own = frames[0][rate].to_numpy()
        assert np.median(np.abs(slope - own)) < 1e-3 * np.abs(own).max()


def test_the_command_goes_lines_joints_and_tables(tmp_path):
    via, out = tmp_path / "via.csv", tmp_path / "line.csv"
    via.write_text("x,y,z\n0,0,0\n0.05,0,0\n0.05,0.05,0\n")
    code, told, warned = cycle(
        f"tripteron --via {via} --corner 0.01 --back --duration 1 --out {out}"
    )
    assert (code, warned) == (0, "")
    assert "1 s (1001 samples)" in told
    ends = pl.read_csv(out)[[0, 500, -1]].select("x", "y", "z").to_numpy()
    np.testing.assert_allclose(ends, [[0, 0, 0], [0.05, 0.05, 0], [0, 0, 0]], atol=1e-12)
    code, told, _ = cycle(f"tripteron --table {out} --payload 1 --json")
    assert (code, json.loads(told)["kind"]) == (0, "replay")
    code, told, _ = cycle(
        "tripteron --kind joints --from 0 0 0 --to -0.05 0.02 0 --jerk 200 --acceleration 5 --json"
    )
    assert (code, json.loads(told)["end"]) == (0, pytest.approx([-0.05, 0.02, 0.0]))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--to 0.05 0", "--to: 2 values given, 3 expected: x y z"),
        ("--to 0.05 0 0", "neither a duration nor a limit"),
        ("--to 0.05 0 0 --duration 0.01 --force 90", "its limit is 90 N; the shortest"),
        ("--to 0.05 0 0 --force much", "--force: 'much' is not a number"),
        ("--to 0.05 0 0 --force 50 --payload -1", "payload: -1.0 given, a mass of 0 kg or more"),
        ("--to 0.05 0 0 --optimal --duration 1", "--duration and --optimal given"),
        ("--to 50 0 0 --duration 1", "its slider passes its limits"),
        ("--kind adept --to 0.05 0 0", "--to: has no use in a motion of kind adept"),
        ("--kind line", "no way given"),
        ("--kind joints --to 0.05 0 0", "--jerk is missing"),
        ("--kind replay", "no motion given; give --table"),
        ("--table nowhere.csv", "nowhere.csv: no such file"),
        ("--rate 0", "--rate: 0 given"),
        ("--out motion.txt", "motion.txt: unknown ending"),
    ],
)
def test_the_command_refuses_in_one_line(line, words):
    start = "--from 0 0 0" if "--to" in line else ""
    code, told, error = cycle(f"tripteron {start} {line}")
    assert (code, told) == (2, "")
    assert words in error
    assert error.splitlines()[-1].startswith("Error: ")


def test_an_angle_that_jumps_by_a_turn_in_a_table_goes_on():
    t = np.linspace(0.0, 1.0, 201)
    phi = np.pi - 0.1 + 0.2 * t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    rest = {"t": t, "x": 0.0 * t, "y": 0.0 * t, "z": 0.0 * t}
    wrapped = np.mod(phi + np.pi, 2.0 * np.pi) - np.pi
    assert np.abs(np.diff(wrapped)).max() > 6.0
    one, other = (
        replay(MACHINES["quadrupteron"], Table("wave", pl.DataFrame(rest | {"phi": values})))
        for values in (phi, wrapped)
    )
    for part, most in (("pose", 1e-14), ("velocity", 1e-11), ("acceleration", 1e-7)):
        np.testing.assert_allclose(getattr(one, part), getattr(other, part), rtol=0.0, atol=most)
