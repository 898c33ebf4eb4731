"""Simulation: energies, two integrators, limits, delays, loads, and why one ends."""

from dataclasses import replace

import mechanisms
import numpy as np
import pytest
from claimed_machines import FREE
from mechanisms import CLIENTS

import pteron
from pteron.controllers import FeedForwardPD
from pteron.errors import DataError
from pteron.kernels import numeric
from pteron.motion import (
    Motion,
    Sensors,
    advance,
    check_motion,
    longest_step,
    pick_and_place,
    simulate,
)
from pteron.workspace import home_pose

DRIVE = pteron.legs.Drive(coulomb=3.0, viscous=10.0, offset=0.5, rotor_inertia=0.1, rest_speed=0.01)


def driven(robot, drive=DRIVE):
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))


def energy(robot, pose, velocity):
    return pteron.kinetic_energy(robot, pose, velocity) + pteron.potential_energy(robot, pose)


@mechanisms.CLIENTS
@pytest.mark.parametrize("name", mechanisms.gated(FREE, ["five-bar"]))
def test_free_motion_keeps_its_energy(name, monkeypatch):
    """For 2 s, or until a leg's margin is below 5 % of its longest reach; 100 random states."""
    monkeypatch.delenv("PTERON_KERNELS")
    robot = pteron.load(name)
    pose = pteron.random_poses(robot, 100, seed=1)
    velocity = 0.5 * np.random.default_rng(1).normal(size=pose.shape)
    least = 0.05 * np.array([leg.size for leg in robot.legs])
    begun, kinetic = energy(robot, pose, velocity), pteron.kinetic_energy(robot, pose, velocity)
    worst = np.zeros(100)
    going = (numeric(robot, "reach")(pose)[0] > least).all(axis=-1)
    for k in range(2000):
        ahead, fast, _, served = advance(robot, pose, velocity, np.zeros_like(pose), 1e-4, 10)
        going &= served & (numeric(robot, "reach")(ahead)[0] > least).all(axis=-1)
        pose[going], velocity[going] = ahead[going], fast[going]
        if k % 10 == 0 or not going.any():
            kinetic = np.fmax(kinetic, pteron.kinetic_energy(robot, pose, velocity))
            worst = np.fmax(worst, np.abs(energy(robot, pose, velocity) - begun))
        if not going.any():
            break
    assert (worst <= 1e-9 * kinetic).all()
    assert worst.max() > 0.0


@mechanisms.CLIENTS
@pytest.mark.parametrize("name", mechanisms.gated(["quadrupteron", "delta", "3-prr"], ["3-prr"]))
def test_the_steps_of_c_and_of_the_virtual_machine_are_the_same_bits(name, monkeypatch):
    robot = driven(pteron.load(name))
    rng = np.random.default_rng(0)
    pose = pteron.random_poses(robot, 40, seed=2)
    velocity, forces, wrench = rng.normal(size=(3, *pose.shape))
    forces = 10.0 * forces  # some joints come to rest, some do not
    given = pose, velocity, forces, 1e-3, 7, wrench
    slow = advance(robot, *given)
    monkeypatch.delenv("PTERON_KERNELS")
    compiled = advance(robot, *given)
    for one, other in zip(compiled, slow, strict=True):
        np.testing.assert_array_equal(one, other)
    for k in range(3):  # a machine by itself moves as it does among others
        alone = advance(robot, pose[k], velocity[k], forces[k], 1e-3, 7, wrench[k])
        for one, many in zip(alone, compiled, strict=True):
            np.testing.assert_array_equal(one, many[k])


@pytest.mark.parametrize(
    "name",
    mechanisms.gated(["quadrupteron", "delta", "five-bar", "mixed", "elbows"], ["delta", "elbows"]),
)
def test_both_integrators_agree(name):
    if name == "mixed":
        robot = pteron.load("tests/data/mixed.toml")
    elif name == "elbows":
        robot = mechanisms.with_elbows(pteron.load("quadrupteron"), "-+-+")
    else:
        robot = pteron.load(name)
    robot, home = driven(robot), home_pose(robot)
    rest = np.zeros(robot.freedom)
    holding = pteron.drive_forces(robot, home, rest, rest, smooth=True)

    def forces(time):
        return holding + 2.0 * np.sin(40.0 * time)

    # No joint comes to rest: there the one sticks, and the other is smooth.
    fast = np.full(robot.freedom, 2.0 if name == "five-bar" else 0.5)
    moving = np.linalg.solve(pteron.jacobian(robot, home), fast)
    given = {"start": (home, moving), "forces": forces, "duration": 0.02, "payload": 0.3}
    fixed = simulate(robot, **given)
    adaptive = simulate(robot, method="dop853", tolerance=1e-12, **given)
    assert fixed.stopped is adaptive.stopped is None
    assert np.abs(fixed.pose - home).max() > 1e-5
    np.testing.assert_allclose(fixed.pose, adaptive.pose, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(fixed.velocity, adaptive.velocity, rtol=0.0, atol=1e-9)
    # The forces that give the accelerations that it had are those of the drives.
    loaded = pteron.motion.with_payload(robot, 0.3)
    state = fixed.pose, fixed.velocity, fixed.acceleration
    needed = pteron.drive_forces(loaded, *state, smooth=True)
    np.testing.assert_allclose(needed, fixed.forces, rtol=0.0, atol=1e-8)


def test_viscous_friction_shortens_the_steps_that_it_would_make_unstable():
    stiff = replace(DRIVE, viscous=2e5, rotor_inertia=0.0)
    robot = driven(pteron.load("delta"), stiff)
    home, rest = home_pose(robot), np.zeros(3)
    assert longest_step(pteron.load("delta"), home) == np.inf
    assert longest_step(robot, home) < 1e-5
    held = simulate(robot, start=(home, rest), duration=0.005)
    assert held.step < 1e-5
    assert np.abs(held.velocity).max() < 1.0  # at 0.1 ms it would diverge
    with pytest.raises(pteron.DataError, match="make viscous smaller"):
        simulate(driven(robot, replace(stiff, viscous=1e12)), start=(home, rest), duration=0.1)


class Held:
    """A controller that asks for the same forces, whatever it sees, and remembers what it saw."""

    def __init__(self, forces, period=1e-3):
        self.forces, self.period, self.seen = forces, period, []

    def law(self, model):
        self.model = model
        return self

    def memory(self, pose, velocity):
        return np.zeros(1)

    def __call__(self, pose, velocity, acceleration, joints, joint_rates, memory):
        self.seen.append((joints, joint_rates))
        return self.forces(memory[0]), memory + 1.0


def test_forces_are_limited_delayed_and_held():
    limited = replace(DRIVE, max_force=4.0)
    robot = driven(pteron.load("tripteron"), limited)
    home, rest = home_pose(robot), np.zeros(3)
    ramp = Held(lambda count: np.full(3, count))
    found = simulate(robot, None, ramp, start=(home, rest), duration=0.01, delay=0.0025)
    np.testing.assert_array_equal(found.asked[:, 0], np.arange(11.0))
    # A force acts 2.5 ms after it was asked for: right after a sample, that of three before.
    np.testing.assert_array_equal(found.forces[:, 0], np.clip(np.arange(11.0) - 3.0, 0.0, 4.0))
    np.testing.assert_allclose(found.saturated_share, 6.0 / 11.0)
    # What half a sample late does is between what none and a whole one do: masses hardly change.
    robot = pteron.load("tripteron")
    given = {"start": (home, rest), "duration": 0.005}
    early, half, late = (
        simulate(robot, None, ramp, delay=delay, **given).velocity[-1]
        for delay in (0.0, 5e-4, 1e-3)
    )
    np.testing.assert_allclose(half, 0.5 * (early + late), rtol=1e-3)
    assert np.abs(early - late).min() > 1e-4


def test_a_delay_beyond_the_end_holds_the_first_command():
    robot = driven(pteron.load("tripteron"))
    home, rest = home_pose(robot), np.zeros(3)
    ramp = Held(lambda count: np.full(3, count))
    found = simulate(robot, None, ramp, start=(home, rest), duration=0.01, delay=1e9)
    np.testing.assert_array_equal(found.forces, np.zeros((11, 3)))


@CLIENTS
def test_encoders_count_on_where_a_cranks_angle_jumps():
    """The same machine, its angles counted from elsewhere: they pass half a turn on the way."""
    robot, home = pteron.load("five-bar"), np.array([0.0, 0.138])
    robot = replace(robot, legs=tuple(replace(leg, limits=None) for leg in robot.legs))
    motion = pick_and_place(robot, home)
    # The angle at home is then half a turn less a milliradian.
    angles = pteron.inverse_kinematics(robot, home) - np.pi + 1e-3
    legs = []
    for leg, angle in zip(robot.legs, angles, strict=True):
        zero = np.array(leg.zero_direction)
        across = np.cross(leg.direction, zero)
        zero = np.cos(angle) * zero + np.sin(angle) * across
        legs.append(replace(leg, zero_direction=tuple(zero)))
    found = [
        simulate(machine, motion, FeedForwardPD(), sensors=Sensors(1e-5))
        for machine in (robot, replace(robot, legs=tuple(legs)))
    ]
    assert np.abs(np.diff(found[1].joints, axis=0)).max() > 6.0
    assert found[1].stopped is None
    for run in found:
        assert np.abs(run.error).max() < 1.2e-4


def test_what_a_controller_is_told():
    robot = driven(pteron.load("delta"))
    home, rest = home_pose(robot), np.zeros(3)
    holding = pteron.drive_forces(robot, home, rest, rest, smooth=True)
    held = Held(lambda _: holding + 1.0)
    found = simulate(robot, None, held, start=(home, rest), duration=0.02)
    joints, rates = (np.array(part) for part in zip(*held.seen, strict=True))
    np.testing.assert_array_equal(joints, found.joints)
    np.testing.assert_array_equal(rates, found.joint_rates)
    held.seen.clear()
    step = 1e-5
    found = simulate(
        robot, None, held, start=(home, rest), duration=0.02, sensors=Sensors(encoder=step)
    )
    joints, rates = (np.array(part) for part in zip(*held.seen, strict=True))
    np.testing.assert_allclose(joints / step, np.round(joints / step), atol=1e-6)
    assert 0.0 < np.abs(joints - found.joints).max() <= 0.5 * step * (1.0 + 1e-9)
    np.testing.assert_allclose(rates[1:], np.diff(joints, axis=0) / 1e-3, atol=1e-9)


def test_a_filter_of_rates_settles_where_they_are():
    robot = pteron.load("five-bar")
    home, still = home_pose(robot), np.zeros(2)
    slow = np.linalg.solve(pteron.jacobian(robot, home), [0.1, 0.1])
    held = Held(lambda _: pteron.drive_forces(robot, home, still, still))
    given = {"start": (home, slow), "duration": 0.1, "limits": False}
    found = simulate(robot, None, held, sensors=Sensors((1e-6, 0.0), cutoff=50.0), **given)
    told, true = np.array([rates for _, rates in held.seen]), found.joint_rates
    np.testing.assert_array_equal(told[:, 1], true[:, 1])  # without an encoder: known exactly
    assert 1e-6 < np.abs(told[1:, 0] - true[1:, 0]).max() < 0.05
    step = 1.0 - np.exp(-2.0 * np.pi * 50.0 * 1e-3)
    counts = np.array([joints[0] for joints, _ in held.seen])
    expected = told[:-1, 0] + step * (np.diff(counts) / 1e-3 - told[:-1, 0])
    np.testing.assert_allclose(told[1:, 0], expected, rtol=0.0, atol=1e-9)


def test_loads_change_on_the_way():
    robot = driven(pteron.load("par4"), replace(DRIVE, coulomb=0.01))
    home, rest = home_pose(robot), np.zeros(4)
    holding = pteron.drive_forces(robot, home, rest, rest, smooth=True)
    given = {"start": (home, rest), "forces": holding, "duration": 0.02}
    found = simulate(robot, payload=[(0.01, 0.5)], **given)
    assert not found.acceleration[:10].any()
    assert found.acceleration[10, 2] < -0.1
    np.testing.assert_array_equal(found.payload, [0.0] * 10 + [0.5] * 11)
    # The weight of what it carries, as a wrench, keeps its place.
    weight = np.append(-0.5 * np.array(robot.gravity), 0.0)
    held = simulate(robot, payload=[(0.01, 0.5)], wrench=lambda t: weight * (t > 0.0095), **given)
    assert np.abs(held.pose - home).max() < 1e-12


@mechanisms.CLIENTS
def test_a_simulation_says_why_it_ends():
    robot = pteron.load("quadrupteron")
    home, rest = home_pose(robot), np.zeros(4)
    for method in ("rk4", "dop853"):
        falling = simulate(robot, start=(home, rest), duration=2.0, method=method)
        assert "comes to the edge of its reach" in falling.stopped
        assert falling.stopped.startswith("at 0.2")
        assert 0.2 < falling.time[-1] < 0.3
        assert np.isfinite(falling.pose).all()
    holding = pteron.drive_forces(robot, home, rest, rest)
    pushed = Held(lambda _: holding + 5.0)
    low = pteron.inverse_kinematics(robot, home) - 0.01
    narrow = replace(
        robot,
        legs=tuple(
            replace(leg, limits=(q, q + 0.03)) for leg, q in zip(robot.legs, low, strict=True)
        ),
    )
    ended = simulate(narrow, None, pushed, start=(home, rest), duration=2.0)
    assert "the slider comes to its limit" in ended.stopped
    on = simulate(narrow, None, pushed, start=(home, rest), duration=2.0, limits=False)
    assert on.time[-1] > ended.time[-1]
    lost = simulate(robot, None, Held(lambda _: np.full(4, np.nan)), start=(home, rest), duration=1)
    assert "no forces are asked for" in lost.stopped
    assert len(lost.time) == 1
    wild = simulate(
        robot, None, Held(lambda k: 1e9 * (-1) ** k * np.ones(4)), start=(home, rest), duration=1
    )
    assert "at 0" in wild.stopped


def test_a_singularity_of_type_ii_ends_control_but_not_free_motion():
    robot = pteron.load("five-bar")
    home, measure = home_pose(robot), numeric(robot, "type_ii")
    poses = pteron.random_poses(robot, 4000, seed=0)
    beyond = poses[measure(poses)[0] * measure(home)[0] < 0.0][0]
    start = home, (beyond - home) / 0.05
    crossing = simulate(robot, start=start, duration=0.05)
    ended = simulate(robot, None, Held(lambda _: np.zeros(2)), start=start, duration=0.05)
    assert "type II" in ended.stopped
    assert len(crossing.time) > len(ended.time)


def test_a_table_of_it():
    robot = driven(pteron.load("five-bar"))
    found = simulate(robot, start=(home_pose(robot), np.zeros(2)), duration=0.005)
    table = found.table()
    assert table.columns == [
        *("t", "x", "y", "dx", "dy", "ddx", "ddy", "xref", "yref"),
        *("theta1", "theta2", "dtheta1", "dtheta2", "torque1", "torque2", "payload"),
    ]
    assert len(table) == 6
    np.testing.assert_array_equal(table["x"].to_numpy(), found.pose[:, 0])
    np.testing.assert_array_equal(found.error, found.pose - found.pose[0])


def test_mistakes_are_told_in_a_line():
    robot = pteron.load("tripteron")
    rest = np.zeros(3)
    start = (rest, rest)
    motion = pick_and_place(robot, rest, samples=11)
    told = {
        "duration: not given": {"start": start},
        "start: not given": {"duration": 1.0},
        "motion given, but no controller": {"motion": motion},
        "give one of them": {"controller": Held(lambda _: rest), "forces": rest, "start": start},
        "step: -1.0 given, a number above 0": {"start": start, "duration": 1.0, "step": -1.0},
        "delay: -1 given": {"start": start, "duration": 1.0, "delay": -1},
        '"rk4" or "dop853"': {"start": start, "duration": 1.0, "method": "euler"},
        "payload: -1.0 given": {"start": start, "duration": 1.0, "payload": -1.0},
        "in the order of time": {"start": start, "duration": 1.0, "payload": [(1, 2), (0, 1)]},
        r"wrench: shape \(2,\) given": {"start": start, "duration": 1.0, "wrench": [1.0, 2.0]},
        "at least a sample": {"start": start, "duration": 1e-5},
        "at most 10000000 are served": {"start": start, "duration": 1e12},
        "duration: '1' given, a number expected": {"start": start, "duration": "1"},
        "delay: None given, a number expected": {"start": start, "duration": 1.0, "delay": None},
        "start: .* given, 2 values": {"start": (rest,), "duration": 1.0},
        "start, pose: 2 poses given, 1 expected": {
            "start": (np.zeros((2, 3)), rest),
            "duration": 1.0,
        },
        r"wrench: \[nan, .* finite numbers": {
            "start": start,
            "duration": 1.0,
            "wrench": 3 * [np.nan],
        },
        r"forces\(0\): .* finite": {
            "start": start,
            "duration": 1.0,
            "forces": lambda _: rest / 0.0,
        },
        "payload: -2.0 given": {"start": start, "duration": 1.0, "payload": [(0, 1), (9, -2)]},
        "pairs of time and mass": {"start": start, "duration": 1.0, "payload": [(np.nan, 1)]},
        "payload: .* a sequence": {"start": start, "duration": 1.0, "payload": [(0, 1), (1,)]},
        "encoder: shape": {"start": start, "duration": 1.0, "sensors": Sensors((1e-6, 1e-6))},
        "controller: .* given, a Controls expected": {"motion": motion, "controller": Held},
        "times expected that ascend": {
            "motion": replace(motion, time=motion.time[::-1]),
            "controller": Held(lambda _: rest),
        },
        r"motion.pose\[0, 0\]: nan given": {
            "motion": replace(motion, pose=np.nan * motion.pose),
            "controller": Held(lambda _: rest),
        },
    }
    for message, given in told.items():
        with np.errstate(all="ignore"), pytest.raises(pteron.DataError, match=message):
            simulate(robot, **given)
    for wrong, message in ((2.5, "count: 2.5 given"), (-1, "count: -1 given")):
        with pytest.raises(pteron.DataError, match=message):
            advance(robot, rest, rest, rest, 1e-4, wrong)
    with pytest.raises(pteron.DataError, match="step: nan given"):
        advance(robot, rest, rest, rest, np.nan, 1)
    with pytest.raises(pteron.UnreachablePose):
        simulate(robot, start=([5.0, 0.0, 0.0], rest), duration=1.0)
    with pytest.raises(pteron.DataError, match="encoder: -1"):
        Sensors(encoder=-1.0)


def test_a_motion_between_its_samples():
    time = np.linspace(0.0, 1.0, 201)
    parts = (np.sin(3 * time), 3 * np.cos(3 * time), -9 * np.sin(3 * time))
    motion = Motion(time + 2.0, *(part[:, None] for part in parts))
    asked = np.linspace(0.0, 1.0, 977)
    exact = (np.sin(3 * asked), 3 * np.cos(3 * asked), -9 * np.sin(3 * asked))
    for part, expected, most in zip(
        motion.at(asked + 2.0), exact, (1e-14, 1e-12, 1e-8), strict=True
    ):
        np.testing.assert_allclose(part[:, 0], expected, rtol=0.0, atol=most)
    pose, velocity, acceleration = motion.at([1.0, 9.0])
    np.testing.assert_array_equal(pose[:, 0], motion.pose[[0, -1], 0])
    assert not velocity.any()
    assert not acceleration.any()
    cycle = pick_and_place(pteron.load("tripteron"), [0.0, 0.0, 0.0], duration=1.0, samples=101)
    twice = cycle.repeat(2)
    assert twice.duration == 2.0
    np.testing.assert_allclose(twice.at(1.25)[0], cycle.at(0.25)[0], atol=1e-12)
    with pytest.raises(pteron.DataError, match="cannot be repeated"):
        motion.repeat(2)
    with pytest.raises(pteron.DataError, match="a whole number of 1 or more"):
        cycle.repeat(1.5)


def test_a_motion_of_lists_and_of_wrong_shapes():
    rest = [[0, 0, 0], [0, 0, 0]]
    assert Motion([0, 1], rest, rest, rest).at(0.5)[0].tolist() == [0.0, 0.0, 0.0]
    alone = Motion([2], rest[:1], rest[:1], rest[:1])
    assert alone.at([1.0, 2.0])[1].tolist() == rest
    for wrong, message in (
        (([], [], [], []), r"motion.time: shape \(0,\) given"),
        (([0, 1], [0, 0], rest, rest), r"motion.pose: shape \(2,\) given, \(2, m\)"),
        (([0, 1], rest, rest[:1], rest), r"motion.velocity: shape \(1, 3\) given, \(2, 3\)"),
    ):
        with pytest.raises(pteron.DataError, match=message):
            Motion(*wrong)
    with pytest.raises(pteron.DataError, match="times expected that ascend"):
        check_motion(pteron.load("tripteron"), alone)


class Returning:
    """A controller that returns what it was given."""

    period = 1e-3

    def __init__(self, answer):
        self.answer = answer

    def law(self, model):
        return self

    def memory(self, pose, velocity):
        return np.empty(0)

    def __call__(self, *sample):
        return self.answer


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ((np.zeros(4), ()), r"controller: forces: shape \(4,\) given, \(\.\.\., 3\) expected"),
        ((0.0, ()), r"controller: forces: shape \(\) given"),
        ((np.zeros((2, 3)), ()), r"controller: forces: shape \(2, 3\) given, \(3,\) expected"),
        ((np.zeros(3, complex), ()), "controller: forces: not an array of real numbers"),
        (np.zeros(3), r"controller: .* returned, forces \(n,\) and the next memory expected"),
        (None, "controller: None returned"),
    ],
)
def test_what_a_controller_returns_wrongly_is_told(answer, told):
    rest = np.zeros(3)
    with pytest.raises(DataError, match=told):
        simulate("tripteron", None, Returning(answer), start=(rest, rest), duration=0.01)


def test_forces_that_are_not_finite_end_a_simulation_and_are_named():
    rest = np.zeros(3)
    for value in (np.nan, np.inf):
        controller = Returning((np.full(3, value), ()))
        result = simulate("tripteron", None, controller, start=(rest, rest), duration=0.01)
        assert "the controller returns some that are not finite numbers" in result.stopped
