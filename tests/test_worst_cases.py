"""Worst cases over all directions: no sampled motion or error exceeds them, and some come close."""

from dataclasses import replace

import numpy as np
import pytest

import pteron
from pteron.design.worst_cases import worst_forces, worst_position_errors, worst_speeds
from pteron.indices import Tolerances, pose_error
from pteron.workspace import home_pose

SPEED, ACCELERATION = 3.0, 20.0


def driven(name):
    """A machine with rotors and every kind of friction, and three poses near its home."""
    drive = pteron.legs.Drive(2.0, 3.0, 0.7, rotor_inertia=1e-4, ratio=50.0)
    robot = pteron.load(name)
    robot = replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))
    rng = np.random.default_rng(0)
    return robot, home_pose(robot) + 0.01 * rng.uniform(-1.0, 1.0, (3, robot.freedom)), rng


@pytest.mark.parametrize("name", ["five-bar", "delta"])
def test_no_direction_takes_more_and_one_takes_as_much(name):
    robot, poses, _ = driven(name)
    k = len(robot.platform.lengths)
    worst = worst_forces(robot, poses, SPEED, ACCELERATION)

    rng = np.random.default_rng(1)
    for leg in range(2):
        best, most = np.zeros(2 * k), 0.0
        for step in 0.6 ** np.arange(20):  # random steps, ever smaller ones, about the best
            x = best + step * rng.normal(size=(200, 2 * k))
            moves = np.zeros((2, len(x), robot.freedom))
            moves[..., :k] = x[:, :k], x[:, k:]
            moves /= np.maximum(1.0, np.linalg.norm(moves, axis=-1, keepdims=True))
            motion = moves * np.array([SPEED, ACCELERATION])[:, None, None]
            forces = np.abs(pteron.drive_forces(robot, poses[0], *motion)[:, leg])
            best, most = x[forces.argmax()], max(most, forces.max())
        assert 0.998 * worst[0, leg] < most <= worst[0, leg] * (1 + 1e-9)


@pytest.mark.parametrize("name", ["five-bar", "delta"])
def test_no_sampled_motion_or_error_exceeds_the_worst(name):
    robot, poses, rng = driven(name)
    k = len(robot.platform.lengths)
    moves = np.zeros((2, 500, robot.freedom))
    moves[..., :k] = rng.normal(size=(2, 500, k))
    moves /= np.linalg.norm(moves, axis=-1, keepdims=True)
    velocity, acceleration = moves[0] * SPEED, moves[1] * ACCELERATION
    forces = np.abs(pteron.drive_forces(robot, poses[:, None], velocity, acceleration)).max(axis=1)
    assert (forces <= worst_forces(robot, poses, SPEED, ACCELERATION)).all()
    speeds = np.abs(pteron.kinematics.joint_rates(robot, poses[:, None], velocity).actuated).max(
        axis=1
    )
    worst = worst_speeds(robot, poses, SPEED)
    assert (speeds <= worst).all()
    assert speeds.max() > 0.95 * worst.max()
    tolerances = Tolerances(joints=1e-4, backlash=1e-5, length=5e-5, point=3e-5)
    bound = worst_position_errors(robot, poses, tolerances)
    parts = pose_error(robot, poses, tolerances).parts[:, :k]
    at = rng.normal(size=(20, 3, k))
    for _ in range(10):  # towards the farthest corner of all errors
        at = np.einsum("nkp,snp->snk", parts, np.sign(np.einsum("nkp,snk->snp", parts, at)))
    reached = np.linalg.norm(at, axis=-1).max(axis=0)
    assert (reached <= bound).all()
    assert (reached > 0.99 * bound).all()
