"""Laws of control: identities, the machine under them, and their code for a controller."""

import ctypes
import subprocess
from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from controlled import controlled
from mechanisms import CATALOG, NIGHTLY, gated, random_machine, relative_error, several, states

import pteron
from pteron.controllers import (
    CONTROLLERS,
    Adaptive,
    ComputedTorque,
    FeedForwardPD,
    PDGravity,
    joint_masses,
)
from pteron.equations.drives import drive_numbers
from pteron.equations.machine import Machine
from pteron.equations.mixed import mixed_forces
from pteron.errors import DataError, ModelError
from pteron.motion import Motion, pick_and_place
from pteron.workspace import home_pose


def with_drives(robot, friction=1.0):
    """Return a machine whose drives differ; their friction times a factor."""
    legs = [
        replace(
            leg,
            drive=pteron.legs.Drive(
                *(friction * (0.3 + 0.1 * i), friction * 0.5, 0.2 - 0.1 * i),
                *(1e-6, 40.0 + i),
                rest_speed=0.05,
            ),
        )
        for i, leg in enumerate(robot.legs)
    ]
    return replace(robot, legs=tuple(legs))


MACHINES = {
    **{name: CATALOG[name] for name in ("quadrupteron", "delta", "par4", "five-bar")},
    "quadrupteron-oblique": CATALOG["quadrupteron-oblique"],
    "random PRSU": random_machine(0, "PRSU"),
}
FEW = ("five-bar", "delta", "random PRSU")
LAWS = tuple(CONTROLLERS)


@cache
def cycle(name):
    """Return the standard pick-and-place cycle: 25, 305 and 25 mm where that fits, 10 m/s^2."""
    return pick_and_place(MACHINES[name], home_pose(MACHINES[name]), samples=2001)


def times(matrices, vectors):
    return (matrices @ vectors[..., None])[..., 0]


# Identities.


@pytest.mark.parametrize("name", gated(FEW, FEW[2:]))
def test_two_velocities_meet_as_christoffels_symbols_say(name):
    """J^T F = M a + C(x, v) w + g, with J a + J' w the joints' acceleration."""
    robot = MACHINES[name]
    machine, n = Machine.numeric(robot), robot.freedom
    pose, v, a = states(robot, 20)
    w = np.random.default_rng(1).normal(size=v.shape)
    symbols = [ca.SX.sym(letter, n) for letter in "xvwa"]
    x, *joints = symbols
    values = ca.DM(pteron.parameters(robot))
    function = ca.Function("mixed", symbols, [mixed_forces(machine, x, *joints, ca.SX(values))])
    J = pteron.jacobian(robot, pose)
    rate = (
        pteron.kinematics.joint_accelerations(robot, pose, v + s * w, 0 * a).actuated
        for s in (1, -1)
    )
    drift = 0.25 * (next(rate) - next(rate))  # J' w is half of what is bilinear
    push = times(J, a) + drift
    found = np.array(function(pose.T, times(J, v).T, times(J, w).T, push.T)).T
    C = pteron.coriolis_matrix(robot, pose, v)
    expected = times(pteron.mass_matrix(robot, pose), a) + times(C, w)
    expected += pteron.gravity_forces(robot, pose)
    assert relative_error(times(np.swapaxes(J, -1, -2), found), expected) < 1e-10


@pytest.mark.parametrize(
    ("name", "what"),
    several(
        [
            *((name, what) for name in FEW for what in ("feed_forward_pd", "computed_torque")),
            *(("five-bar", what) for what in ("adaptive", "adaptive_drives")),
            ("delta", "adaptive_drives"),
        ],
        [
            ("delta", "feed_forward_pd"),
            ("random PRSU", "computed_torque"),
            *(("five-bar", what) for what in ("adaptive", "adaptive_drives")),
        ],
    ),
)
def test_without_errors_a_law_gives_what_the_motion_needs(name, what):
    """In the middle of the period, to which the wanted acceleration's change leads."""
    robot = with_drives(MACHINES[name])
    pose, velocity, acceleration = states(robot, 12)
    law = CONTROLLERS[what].law(robot)
    joints = pteron.inverse_kinematics(robot, pose)
    rates = pteron.kinematics.joint_rates(robot, pose, velocity).actuated
    third = 50.0 * acceleration[::-1]
    memory = law.memory(pose + 1e-4, velocity)
    begins = 0 if what == "feed_forward_pd" else robot.freedom
    last = slice(begins, begins + robot.freedom)
    memory[:, last] = acceleration - 1e-3 * third
    forces, kept = law(pose, velocity, acceleration, joints, rates, memory)
    h = 0.5e-3
    middle = (
        pose + h * velocity + h**2 / 2 * acceleration + h**3 / 6 * third,
        velocity + h * acceleration + h**2 / 2 * third,
        acceleration + h * third,
    )
    assert relative_error(forces, pteron.drive_forces(robot, *middle, smooth=True)) < 1e-9
    np.testing.assert_array_equal(kept[:, last], acceleration)
    if what != "feed_forward_pd":
        np.testing.assert_allclose(kept[:, : robot.freedom], middle[0], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", gated(FEW, FEW[:1]))
def test_pd_with_gravity_compensation_holds_any_pose(name):
    robot = with_drives(MACHINES[name])
    pose = states(robot, 20)[0]
    rest, law = np.zeros_like(pose), PDGravity().law(robot)
    joints = pteron.inverse_kinematics(robot, pose)
    forces, memory = law(pose, rest, rest, joints, rest, law.memory(pose - 1e-3, rest))
    np.testing.assert_allclose(memory, pose, rtol=0, atol=1e-12)
    held = pteron.drive_accelerations(robot, pose, rest, forces)
    assert np.abs(held).max() < 1e-9
    # Springs and dampers at the joints, from where they are wanted to be.
    stiffness, damping = np.split(law.gains, 2)
    pushed, _ = law(pose, rest, rest, joints, rest + 0.5, memory)
    np.testing.assert_allclose(pushed - forces, 0 * rest - 0.5 * damping, rtol=1e-9)
    wanted = pose + 1e-3
    pulled, _ = law(wanted, rest, rest, joints, rest, memory)
    error = pteron.inverse_kinematics(robot, wanted) - joints
    np.testing.assert_allclose(pulled - forces, stiffness * error, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "friction"),
    [("five-bar", False), ("five-bar", True), pytest.param("delta", True, marks=NIGHTLY)],
)
def test_adaptive_control_takes_energy_at_the_rate_of_its_damping(name, friction):
    """V = z_x^T M z_x / 2 + |eta - eta_true|^2 / 2 falls by z^T K z: Slotine and Li's proof.

    The wanted motion rests, so that its middle is where it is. Friction, which takes energy too, is
    left out.
    """
    plant = with_drives(MACHINES[name], friction=0.0) if friction else MACHINES[name]
    model = pteron.with_parameters(plant, 1.1 * pteron.parameters(plant))
    pose, velocity, _ = states(plant, 12)
    wanted, rest = pose + 1e-3, np.zeros_like(pose)
    law = Adaptive(friction=friction, uncertainty=1e6).law(model)
    n = plant.freedom
    slope, damping = law.gains[:n], law.gains[n : 2 * n]
    joints = pteron.inverse_kinematics(plant, pose)
    rates = pteron.kinematics.joint_rates(plant, pose, velocity).actuated
    start = law.memory(pose, velocity)
    forces, memory = law(wanted, rest, rest, joints, rates, start)
    error = pteron.inverse_kinematics(plant, wanted) - joints
    aim, push = slope * error, -slope * rates
    z = aim - rates

    J = pteron.jacobian(plant, pose)
    inverse = np.linalg.inv(J)
    v, w = velocity, times(inverse, aim)
    drift = (
        pteron.kinematics.joint_accelerations(plant, pose, v + s * w, rest).actuated
        for s in (1.0, -1.0)
    )
    a = times(inverse, push - 0.25 * (next(drift) - next(drift)))
    rotors = np.diag([leg.drive.inertia if leg.drive else 0.0 for leg in plant.legs])
    M = pteron.mass_matrix(plant, pose) + np.swapaxes(J, -1, -2) @ rotors @ J
    moved = pteron.drive_accelerations(plant, pose, v, forces)
    zx, change = w - v, a - moved
    C = pteron.coriolis_matrix(plant, pose, v)
    # J' z_x by which the motors' part of M changes.
    turned = (
        pteron.kinematics.joint_accelerations(plant, pose, v + s * zx, rest).actuated
        for s in (1.0, -1.0)
    )
    turning = 0.25 * (next(turned) - next(turned))
    kinetic = (zx * times(M, change)).sum(-1) + (zx * times(C, zx)).sum(-1)
    kinetic += (z * times(rotors, turning)).sum(-1)

    true = Adaptive(friction=friction, uncertainty=1e6).law(plant)
    count = law.estimates(start).shape[-1]
    matrix = law.gains[2 * n + 1 + count : -1].reshape(count, count).T
    off = true.estimates(true.memory(pose, velocity)) - law.estimates(start)
    learnt = (memory - start)[:, -count:] / 1e-3
    power = -(np.linalg.solve(matrix, off.T).T * learnt).sum(-1)
    lost = (damping * z**2).sum(-1)
    np.testing.assert_allclose(kinetic + power, -lost, rtol=0, atol=1e-9 * lost.max())


def test_the_masses_at_the_joints_bound_the_frequencies():
    for name in MACHINES:
        robot = MACHINES[name]
        masses = joint_masses(robot)
        pose = states(robot, 50)[0]
        J = pteron.jacobian(robot, pose)
        mobility = J @ np.linalg.solve(pteron.mass_matrix(robot, pose), np.swapaxes(J, -1, -2))
        squares = np.einsum("kii->k", mobility * masses)
        assert np.median(squares) <= robot.freedom
        motors = with_drives(robot)
        assert (joint_masses(motors) > masses).all()


# The machine under a law.


@pytest.mark.parametrize("damping", [0.5, 1.0])
@pytest.mark.parametrize("name", gated(FEW, FEW[1:2]))
def test_computed_torque_gives_errors_the_poles_that_were_chosen(name, damping):
    robot, period, w = MACHINES[name], 2.5e-4, 80.0
    home = home_pose(robot)
    rest = np.zeros((2, robot.freedom))
    still = Motion(np.array([0.0, 0.05]), np.tile(home, (2, 1)), rest, rest)
    away = home + 1e-5 * np.arange(1, robot.freedom + 1)
    law = ComputedTorque(period, bandwidth=w, damping=damping).law(robot)
    found = controlled(robot, law, still, period, away).joint_errors
    t = period * np.arange(len(found))
    s = -w * (damping + np.emath.sqrt(damping**2 - 1.0))
    decay = (1 - np.real(s) * t) * np.exp(np.real(s) * t)
    if damping < 1.0:
        decay = np.imag(np.conj(s) * np.exp(s * t)) / np.imag(np.conj(s))
    expected = np.outer(decay, found[0])
    assert np.abs(found - expected).max() < 1e-3 * np.abs(found[0]).max()


@pytest.mark.parametrize("name", gated(["quadrupteron", *FEW], ["quadrupteron", "delta"]))
def test_computed_torque_tracks_the_cycle_to_5_um_at_1_khz(name):
    robot = with_drives(MACHINES[name]) if name == "delta" else MACHINES[name]
    run = controlled(robot, ComputedTorque(1e-3).law(robot), cycle(name), 1e-3)
    assert run.largest(robot) < 5e-6


@pytest.mark.parametrize("name", ["quadrupteron", "five-bar"])
def test_computed_torque_tracks_the_cycle_to_1_um_at_4_khz(name):
    robot, period = MACHINES[name], 2.5e-4
    run = controlled(robot, ComputedTorque(period).law(robot), cycle(name), period)
    assert run.largest(robot) < 0.1e-6


def wrong(robot, seed, share=0.2):
    """Return a machine whose bodies are all heavier or lighter by a share, at random."""
    rng = np.random.default_rng(seed)
    data = pteron.manipulator.parameter_data(robot)
    factors = {owner: 1 + share * rng.choice([-1, 1]) for owner in sorted({p.owner for p in data})}
    values = pteron.parameters(robot) * [factors[p.owner] for p in data]
    return pteron.with_parameters(robot, values)


@pytest.mark.parametrize(
    "name",
    gated([name for name in MACHINES if not name.startswith("random")], ["five-bar"]),
)
def test_adaptive_control_learns_what_the_cycle_shows(name):
    """Errors fall ten times within six cycles, where all bodies are off by 20 %."""
    robot, motion = MACHINES[name], cycle(name)
    plant = wrong(robot, 1)
    law = Adaptive(motion=motion).law(robot)
    run = controlled(plant, law, motion.repeat(6), 1e-3)
    largest = run.largest(robot, 6)
    assert 10 * largest[-1] < largest[0]
    count = law.base.rank
    assert np.linalg.norm(run.memories[:, -count:], axis=-1).max() < law.gains[-1]
    room = np.abs(law.base.values() - law.base.values(wrong(robot, 1))).max()
    assert np.abs(law.estimates(run.memories) - law.base.values()).max() < 10 * room


@pytest.mark.parametrize("what", LAWS)
@pytest.mark.parametrize("name", gated(["delta", "five-bar"], ["five-bar"]))
def test_coarse_encoders_and_forces_that_come_late_are_survived(name, what):
    """10 um or 10 urad a count, rates by differences, one sample of delay: by default gains."""
    robot = MACHINES[name]
    law, motion = CONTROLLERS[what].law(robot), cycle(name)
    plain = controlled(robot, law, motion, 1e-3).largest(robot)
    rough = controlled(robot, law, motion, 1e-3, grid=1e-5, late=1).largest(robot)
    assert rough < plain + 3e-4


def test_estimates_stay_within_their_room():
    robot = MACHINES["five-bar"]
    law = Adaptive(uncertainty=1e-3).law(robot)
    run = controlled(wrong(robot, 1), law, cycle("five-bar"), 1e-3)
    sizes = np.linalg.norm(run.memories[:, -law.base.rank :], axis=-1)
    np.testing.assert_allclose(sizes.max(), law.gains[-1], rtol=1e-12)


# Interfaces.


@pytest.mark.parametrize("what", gated(LAWS, [*LAWS][::2]))
def test_a_batch_is_its_samples(what):
    robot = MACHINES["delta"]
    pose, velocity, acceleration = states(robot, 6)
    law = CONTROLLERS[what].law(robot)
    joints, rates = pteron.inverse_kinematics(robot, pose) + 1e-4, velocity
    memory = law.memory(pose, velocity)
    forces, kept = law(pose, velocity, acceleration, joints, rates, memory)
    assert forces.shape == pose.shape
    assert kept.shape == memory.shape
    alone = law(*(v[3] for v in (pose, velocity, acceleration, joints, rates, memory)))
    np.testing.assert_array_equal(alone[0], forces[3])
    np.testing.assert_array_equal(alone[1], kept[3])
    grid = law(pose.reshape(2, 3, 3), velocity[0], acceleration[0], joints[:3], rates[0], memory[0])
    assert grid[0].shape == (2, 3, 3)
    far, _ = law(pose + 50.0, velocity, acceleration, joints, rates, memory)
    assert np.isnan(far).all()


def test_wrong_numbers_are_refused_in_one_line():
    cases = {
        "bandwidth: -5.0 given, a number above 0 expected": {"bandwidth": -5.0},
        "damping: 0 given for joint 2, a number above 0 expected": {"damping": [1, 0, 1]},
        "bandwidth: 'fast' given, a number above 0 expected": {"bandwidth": "fast"},
        "bandwidth: nan given, a number above 0 expected": {"bandwidth": np.nan},
        "bandwidth: [1] given for joint 1, a number above 0": {"bandwidth": [[1], [2, 3]]},
        "proportional: missing, but derivative is given": {"derivative": 3.0},
        "derivative: -1.0 given for joint 1": {"proportional": 1.0, "derivative": [-1.0]},
        "period: 1000 s given, at most 0.1 s expected; is it a rate in Hz? then give 0.001": {
            "period": 1000
        },
        "period: 0.0 given, seconds between two samples expected": {"period": 0.0},
    }
    for message, given in cases.items():
        with pytest.raises(DataError) as caught:
            PDGravity(**given)
        assert str(caught.value).startswith(message)
        assert "\n" not in str(caught.value)
    with pytest.raises(DataError, match="uncertainty: -1 given, a number above 0 expected"):
        Adaptive(uncertainty=-1)
    with pytest.raises(DataError, match="bandwidth: 2 numbers given, but delta has 3 joints"):
        ComputedTorque(bandwidth=[1.0, 2.0]).law(MACHINES["delta"])
    with pytest.raises(ModelError, match="robot: float given, a Manipulator expected"):
        ComputedTorque().law(1.0)
    motion = cycle("delta")
    for wrong, message in (
        (cycle("five-bar"), r"motion: poses of shape \(\d+, 2\) given, \(T, 3\) expected"),
        (replace(motion, velocity=0 * motion.velocity), "motion: the platform rests all along"),
    ):
        with pytest.raises(DataError, match=message):
            Adaptive(motion=wrong).law(MACHINES["delta"])
    law = ComputedTorque().law(MACHINES["delta"])
    with pytest.raises(DataError, match="computed_torque: it estimates nothing; use Adaptive"):
        law.estimates(law.memory(np.zeros(3), np.zeros(3)))


def test_gains_may_be_given_joint_by_joint():
    robot = MACHINES["delta"]
    law = FeedForwardPD(proportional=[1.0, 2.0, 3.0], derivative=0.5).law(robot)
    np.testing.assert_array_equal(law.gains, [1.0, 2.0, 3.0, 0.5, 0.5, 0.5, 1e-3])
    assert law.gain_names == (
        *("proportional_1", "proportional_2", "proportional_3"),
        *("derivative_1", "derivative_2", "derivative_3", "period"),
    )
    for what, controller in CONTROLLERS.items():
        law = controller.law(robot)
        assert len(law.gain_names) == len(law.gains), what


# Code for a controller.


def test_exported_laws_are_the_librarys(tmp_path):
    robot, motion = with_drives(MACHINES["five-bar"]), cycle("five-bar")
    controllers = [
        *(PDGravity(bandwidth=80.0), FeedForwardPD(damping=0.7), ComputedTorque()),
        *(Adaptive(motion=motion), Adaptive(friction=True)),
    ]
    robot = replace(robot, name="machine")
    pteron.export_c(robot, controllers, tmp_path)
    subprocess.run(
        ["gcc", "-std=c99", "-O1", "-shared", "-fPIC", "machine.c", "-o", "machine.so", "-lm"],
        cwd=tmp_path,
        check=True,
    )
    loaded = ctypes.CDLL(str(tmp_path / "machine.so"))
    pose, velocity, acceleration = states(robot, 12)
    joints = pteron.inverse_kinematics(robot, pose + 1e-3)
    rng = np.random.default_rng(1)
    for controller in controllers:
        law = controller.law(robot)
        table = ctypes.c_double * len(law.gains)
        gains = np.array(table.in_dll(loaded, f"machine_{controller.law_name}_gains"))
        np.testing.assert_array_equal(gains, law.gains)
        shared = [gains]
        if law.base is None:
            shared.append(pteron.parameters(robot))
        shared.append(drive_numbers(robot))
        memory = law.memory(pose, velocity)
        memory = memory + 1e-3 * rng.normal(size=memory.shape)
        given = pose, velocity, acceleration, joints, velocity, memory
        for k, (forces, kept) in enumerate(zip(*law(*given), strict=True)):
            inputs = [np.ascontiguousarray(v[k]) for v in given] + shared
            outputs = np.empty(len(forces)), np.empty(len(kept))
            pointers = [ctypes.c_void_p(v.ctypes.data) for v in (*inputs, *outputs)]
            assert getattr(loaded, f"machine_{controller.law_name}")(*pointers) == 0
            np.testing.assert_allclose(outputs[0], forces, rtol=0, atol=1e-9)
            np.testing.assert_allclose(outputs[1], kept, rtol=0, atol=1e-9)


def test_a_law_needs_bodies_or_base_parameters():
    robot = MACHINES["five-bar"]
    with pytest.raises(ModelError, match='base: missing; "adaptive" needs base=base_parameters'):
        pteron.compile(robot, "adaptive")
    base = pteron.base_parameters(robot)
    law = ComputedTorque().law(robot)
    pose, velocity, acceleration = states(robot, 5)
    given = (pose, velocity, acceleration, pteron.inverse_kinematics(robot, pose), velocity)
    memory = law.memory(pose, velocity)
    found = pteron.compile(robot, "computed_torque", base=base)(*given, memory, law.gains)
    expected = law(*given, memory)
    assert relative_error(found[0], expected[0]) < 1e-11


@pytest.mark.parametrize("name", ["five-bar", "delta-4"])
def test_a_crank_that_has_gone_round_is_where_it_was(name):
    robot = pteron.load(name)
    home, rest = home_pose(robot), np.zeros(robot.freedom)
    joints = pteron.inverse_kinematics(robot, home)
    round_ones = np.array([leg.goes_round for leg in robot.legs])
    assert round_ones.any()
    law = FeedForwardPD().law(robot)
    memory = law.memory(home, rest)
    near, _ = law(home, rest, rest, joints + 0.01, rest, memory)
    for turns in (-1.0, 2.0):
        whole = joints + 0.01 + 2.0 * np.pi * turns * round_ones
        np.testing.assert_allclose(law(home, rest, rest, whole, rest, memory)[0], near, rtol=1e-9)
