"""Drives as part of the machine: their law, its inverse, files, and what identification says."""

from dataclasses import replace

import numpy as np
import pytest
from logs_of_motions import Friction, log_of, motion
from mechanisms import CATALOG, in_turn, random_machine, states

import pteron
from pteron import ModelError
from pteron.identification import identify
from pteron.kernels import program
from pteron.legs import Drive, Stribeck

MACHINES = {
    **{name: CATALOG[name] for name in ("quadrupteron", "delta-4", "par4", "five-bar")},
    "random PRSU": random_machine(0, "PRSU"),
}
EVERY = in_turn(MACHINES, ["delta-4", "five-bar", "random PRSU"], share=1)


def driven(robot):
    """Return a machine whose drives differ; the last leg has none."""
    legs = [
        replace(
            leg,
            drive=Drive(
                coulomb=2.0 + i,
                viscous=5.0 - i,
                offset=0.3 * i - 0.4,
                rotor_inertia=3e-5,
                ratio=200.0 - 30.0 * i,
                rest_speed=0.02 * (i + 1),
                stribeck=Stribeck(1.0, 0.05 * (i + 1)) if i % 2 else None,
            ),
        )
        for i, leg in enumerate(robot.legs[:-1])
    ]
    return replace(robot, legs=(*legs, robot.legs[-1]))


def law(robot, rates, accelerations, side):
    """Return what drives take, joint by joint, (..., n)."""
    found = np.zeros(rates.shape)
    for i, leg in enumerate(robot.legs):
        if (d := leg.drive) is None:
            continue
        v = rates[..., i]
        dry = d.coulomb
        if d.stribeck:
            dry = dry + d.stribeck.force * np.exp(-((v / d.stribeck.speed) ** 2))
        found[..., i] = dry * side(v, d) + d.viscous * v + d.offset
        found[..., i] += d.ratio**2 * d.rotor_inertia * accelerations[..., i]
    return found


@EVERY
@pytest.mark.parametrize("smooth", [False, True])
def test_drives_give_the_forces_of_the_bodies_and_their_own(name, smooth):
    robot = driven(MACHINES[name])
    motion = states(robot, 100)
    rates = pteron.kinematics.joint_rates(robot, *motion[:2]).actuated
    seconds = pteron.kinematics.joint_accelerations(robot, *motion).actuated

    def side(v, drive):
        return np.tanh(v / drive.rest_speed) if smooth else np.sign(v)

    own = law(robot, rates, seconds, side)
    rigid = pteron.inverse_dynamics(robot, *motion)
    found = pteron.drive_forces(robot, *motion, smooth=smooth)
    np.testing.assert_allclose(found - rigid, own, rtol=0, atol=1e-12 * np.abs(found).max())
    push = np.random.default_rng(1).normal(size=motion[0].shape)
    loaded = pteron.drive_forces(robot, *motion, push, smooth=smooth)
    np.testing.assert_allclose(
        loaded - found,
        pteron.inverse_dynamics(robot, *motion, push) - rigid,
        rtol=0,
        atol=1e-12 * np.abs(found).max(),
    )


@EVERY
def test_accelerations_come_back_from_what_the_drives_give(name):
    robot = driven(MACHINES[name])
    pose, velocity, acceleration = states(robot, 100)
    push = np.random.default_rng(1).normal(size=pose.shape)
    forces = pteron.drive_forces(robot, pose, velocity, acceleration, push, smooth=True)
    found = pteron.drive_accelerations(robot, pose, velocity, forces, push)
    np.testing.assert_allclose(found, acceleration, rtol=0, atol=1e-10 * np.abs(acceleration).max())


@EVERY
def test_the_joints_motion_tells_what_the_drives_must_give_and_the_pose(name):
    """From poses 1 mm and 1 mrad away, as the last one of a motion is."""
    robot = driven(MACHINES[name])
    motion = states(robot, 100)
    joints = pteron.inverse_kinematics(robot, motion[0])
    rates = pteron.kinematics.joint_rates(robot, *motion[:2]).actuated
    seconds = pteron.kinematics.joint_accelerations(robot, *motion).actuated
    kernel = pteron.compile(robot, "joint_feed_forward")
    assert [p.name for p in kernel.inputs] == [
        *("joints", "joint_rates", "joint_accelerations", "pose")
    ]
    forces, found = kernel(joints, rates, seconds, motion[0] + 1e-3)
    expected = pteron.drive_forces(robot, *motion, smooth=True)
    np.testing.assert_allclose(found, motion[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    lost, _ = kernel(joints, rates, seconds, motion[0] + 20.0)
    right = (np.abs(lost - expected) < 1e-6 * np.abs(expected).max()).all(axis=-1)
    assert (np.isnan(lost).any(axis=-1) | right).all()


@EVERY
def test_a_machine_without_drives_needs_its_bodies_forces_alone(name):
    robot = MACHINES[name]
    motion = states(robot, 20)
    for smooth in (False, True):
        found = pteron.drive_forces(robot, *motion, smooth=smooth)
        expected = pteron.inverse_dynamics(robot, *motion)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * np.abs(expected).max())


def test_rotors_have_kinetic_energy():
    """Lagrange's equations of T = (x'^T M x' + q'^T D q') / 2: the motors turn with the joints."""
    robot = CATALOG["delta"]
    legs = [replace(leg, drive=Drive(rotor_inertia=2e-4, ratio=30.0)) for leg in robot.legs]
    robot = replace(robot, legs=tuple(legs))
    pose, velocity, acceleration = (part[0] for part in states(robot, 1))

    def momentum(time):
        at = pose + velocity * time + 0.5 * acceleration * time**2
        rows = pteron.jacobian(robot, at)
        return rows.T @ (0.18 * rows @ (velocity + acceleration * time))

    def energy(at):
        rates = pteron.jacobian(robot, at) @ velocity
        return 0.09 * rates @ rates

    step = 1e-4
    rise = (momentum(step) - momentum(-step)) / (2 * step)
    slope = [(energy(pose + e) - energy(pose - e)) / (2 * step) for e in step * np.eye(3)]
    own = pteron.drive_forces(robot, pose, velocity, acceleration)
    own -= pteron.inverse_dynamics(robot, pose, velocity, acceleration)
    # d/dt (dT/dx') - dT/dx = J^T F, to what differences leave
    expected = np.linalg.solve(pteron.jacobian(robot, pose).T, rise - slope)
    np.testing.assert_allclose(own, expected, rtol=1e-5)


def test_dry_friction_is_smooth_at_rest_and_by_sign_beyond():
    robot = replace(
        CATALOG["tripteron"],
        legs=tuple(
            replace(leg, drive=Drive(coulomb=3.0, rest_speed=0.01))
            for leg in CATALOG["tripteron"].legs
        ),
    )
    rest = np.zeros(3)
    speeds = np.array([0.0, 1e-5, 0.01, 0.05, 10.0, 1e6])
    velocity = np.outer(speeds, np.ones(3))
    base = pteron.inverse_dynamics(robot, rest, velocity, rest)
    smooth = pteron.drive_forces(robot, rest, velocity, rest, smooth=True) - base
    sharp = pteron.drive_forces(robot, rest, velocity, rest) - base
    rates = pteron.kinematics.joint_rates(robot, rest, velocity).actuated
    scale = np.abs(base).max(axis=-1, keepdims=True)
    assert (np.abs(smooth - 3.0 * np.tanh(rates / 0.01)) <= 1e-12 * (3.0 + scale)).all()
    assert (np.abs(sharp - 3.0 * np.sign(rates)) <= 1e-12 * (3.0 + scale)).all()


@EVERY
def test_base_parameters_are_enough_for_what_the_drives_must_give(name):
    robot = driven(MACHINES[name])
    motion = states(robot, 10)
    base = pteron.base_parameters(robot)
    moving = (
        pteron.kinematics.joint_rates(robot, *motion[:2]).actuated,
        pteron.kinematics.joint_accelerations(robot, *motion).actuated,
    )
    joints = pteron.inverse_kinematics(robot, motion[0])
    push = np.random.default_rng(1).normal(size=motion[0].shape)
    expected = pteron.drive_forces(robot, *motion, push, smooth=True)
    close = {"rtol": 0, "atol": 1e-11 * np.abs(expected).max()}
    for grade in ("specialised", "parametric"):
        given = {"base": base, "wrench": True, "grade": grade}
        found = pteron.compile(robot, "feed_forward", **given)(*motion, push)
        np.testing.assert_allclose(found, expected, **close)
        kernel = pteron.compile(robot, "joint_feed_forward", **given)
        found, _ = kernel(joints, *moving, motion[0] + 1e-3, push)
        np.testing.assert_allclose(found, expected, **close)


def test_machines_with_other_drives_share_their_programs():
    robot = MACHINES["quadrupteron"]
    for what in ("inverse_dynamics", "feed_forward"):
        assert program(robot, what) is program(driven(robot), what)
    values = [part[0] for part in states(robot, 1)]
    kernel = pteron.compile(driven(robot), "feed_forward")
    expected = pteron.drive_forces(driven(robot), *values, smooth=True)
    np.testing.assert_allclose(kernel(*values), expected, rtol=1e-12)


@EVERY
@pytest.mark.filterwarnings("ignore::pteron.UnlikelyValue")  # a random offset
def test_drives_are_saved_and_loaded(name, tmp_path):
    robot = driven(MACHINES[name])
    assert pteron.load(pteron.save(robot, tmp_path / "robot.toml")) == robot


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("{ coulomb = -1.0 }", "leg 1: drive.coulomb: -1 given, 0 or more expected"),
        ("{ ratio = 0.0 }", "leg 1: drive.ratio: 0 given, another number than 0 expected"),
        ("{ max_force = 0.0 }", "leg 1: drive.max_force: 0 given, a number above 0 expected"),
        ("{ colomb = 1.0 }", "leg 1: drive.colomb: unknown key"),
        (
            "{ stribeck = { force = -1.0, speed = 0.1 } }",
            "leg 1: drive.stribeck.force: -1 given, 0 or more expected",
        ),
        ("3.0", "leg 1: drive: 3.0 given"),
    ],
)
def test_a_drive_that_cannot_be_is_told_by_its_key(given, words, tmp_path):
    path = pteron.save(MACHINES["quadrupteron"], tmp_path / "robot.toml")
    first, *rest = path.read_text().split("[[legs]] # 2")
    path.write_text(f"{first}drive = {given}\n\n[[legs]] # 2{''.join(rest)}")
    with pytest.raises(ModelError) as caught:
        pteron.load(path)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["quadrupteron", "delta"])
def test_the_identified_machine_alone_predicts_the_log(name):
    robot = CATALOG[name]
    size = {"size": 0.15} if name == "delta" else {}
    result = identify(robot, log_of(robot, **size), held_out=log_of(robot, seed=1, **size))
    found, friction = result.machine, Friction.of(len(robot.legs))
    drives = [leg.drive for leg in found.legs]
    np.testing.assert_allclose([d.coulomb for d in drives], friction.coulomb, rtol=1e-2)
    np.testing.assert_allclose([d.viscous for d in drives], friction.viscous, rtol=1e-2)
    state = motion(robot, np.arange(500) / 100.0, seed=2, **size)
    rates = pteron.kinematics.joint_rates(robot, *state[:2]).actuated
    true = pteron.inverse_dynamics(robot, *state) + friction.forces(rates)
    left = pteron.drive_forces(found, *state) - true
    assert np.sqrt((left**2).mean()) < 1e-2 * np.sqrt((true**2).mean())
