"""Friction of the passive joints, and the platform's motion from that of the sliders."""

from functools import partial

import numpy as np
import pytest
from differences import along
from logs_of_motions import machine
from mechanisms import BATCH_SHAPES, MECHANISMS, relative_error, states

import pteron
from pteron.equations.friction import passive_joints
from pteron.kinematics.evaluate import evaluate_unchecked

SOME = [
    "quadrupteron turned",
    "quadrupteron-oblique +--+",
    "tripteron",
    "random 3T1R 1",
    "random 3T 0",
    "delta",
    "mixed",
    "linear-delta",
    "five-bar",
    "3-rrr",
    "delta-4",
    "par4",
]
each_mechanism = pytest.mark.parametrize("name", SOME)


def passive_rates(robot, pose, velocity):
    """Return the rates of what has a column: the passive joints of each leg, and the platform."""
    passive = pteron.kinematics.joint_rates(robot, pose, velocity).passive
    rates = [
        velocity[:, -1] if leg is None else passive[:, leg - 1, number - 1]
        for leg, number, _ in passive_joints(robot)
    ]
    return np.column_stack(rates)


@each_mechanism
def test_a_column_of_passive_friction_does_the_work_of_its_joint(name):
    robot = machine(name)
    pose, velocity, _ = states(robot, 50)
    columns = evaluate_unchecked(robot, "passive_friction", pose, velocity)
    rates = passive_rates(robot, pose, velocity)
    sliders = pteron.kinematics.joint_rates(robot, pose, velocity).actuated
    power = np.einsum("rnc,rn->rc", columns, sliders)
    assert columns.shape == (50, len(robot.legs), rates.shape[1])
    assert relative_error(power, rates**2) < 1e-11


@each_mechanism
def test_a_column_is_the_rate_times_its_slope_by_the_sliders(name):
    # F = q' dq'/drho': virtual work along any motion, not only along the present one.
    robot = machine(name)
    n = len(robot.legs)
    pose, velocity, _ = states(robot, 20)
    columns = evaluate_unchecked(robot, "passive_friction", pose, velocity)
    rates = passive_rates(robot, pose, velocity)
    sliders = pteron.kinematics.joint_rates(robot, pose, velocity).actuated
    invert = partial(evaluate_unchecked, robot, "platform_motion")
    for j in range(n):

        def moved(steps, j=j):
            changed = sliders + np.multiply.outer(steps, np.eye(n)[j])[:, None]
            found = [invert(pose, np.ascontiguousarray(row), row)[0] for row in changed]
            return np.array([passive_rates(robot, pose, row) for row in found])

        slope = along(moved, 0.1)
        assert relative_error(columns[:, j], rates * slope) < 1e-9


@each_mechanism
def test_motion_of_the_platform_inverts_that_of_the_sliders(name):
    robot = machine(name)
    pose, velocity, acceleration = states(robot, 100)
    rates = pteron.kinematics.joint_rates(robot, pose, velocity)
    accelerations = pteron.kinematics.joint_accelerations(robot, pose, velocity, acceleration)
    back = evaluate_unchecked(
        robot, "platform_motion", pose, rates.actuated, accelerations.actuated
    )
    assert relative_error(back[0], velocity) < 1e-10
    assert relative_error(back[1], acceleration) < 1e-10


@pytest.mark.parametrize("shape", BATCH_SHAPES)
def test_columns_broadcast(shape):
    robot = MECHANISMS["quadrupteron-oblique"]
    count = int(np.prod(shape))
    pose, velocity, _ = states(robot, max(count, 1))
    flat = evaluate_unchecked(robot, "passive_friction", pose, velocity)[:count]
    batch = pose[:count].reshape(*shape, 4), velocity[:count].reshape(*shape, 4)
    assert np.array_equal(
        evaluate_unchecked(robot, "passive_friction", *batch), flat.reshape(*shape, *flat.shape[1:])
    )


def test_a_joint_at_rest_asks_for_nothing():
    # The legs of a Tripteron that moves along one slider's direction alone: that leg is rigid.
    robot = MECHANISMS["tripteron"]
    pose, velocity, _ = states(robot, 10)
    direction = np.array(robot.legs[0].direction)
    columns = evaluate_unchecked(robot, "passive_friction", pose, velocity[:, :1] * direction)
    assert np.abs(columns[..., :3]).max() < 1e-14 * np.abs(columns).max()
    assert np.abs(columns[..., 3:]).max() > 1e-3
