"""Inverse dynamics against Lagrange's equations, Pinocchio and MuJoCo: 200 states a machine."""

import lagrange
import numpy as np
import pytest
import trees
from mechanisms import MECHANISMS, relative_error, states

import pteron

COUNT = 200
ENGINES = {"pinocchio": trees.Pinocchio, "mujoco": trees.MuJoCo}


@pytest.mark.parametrize("name", MECHANISMS)
def test_lagrange(name):
    robot = MECHANISMS[name]
    forces = lagrange.inverse_dynamics(robot)
    motion = states(robot, COUNT, seed=11)
    expected = np.array([forces(*state) for state in zip(*motion, strict=True)])
    assert relative_error(pteron.inverse_dynamics(robot, *motion), expected) < 1e-12


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", MECHANISMS)
def test_newton_euler_through_the_closure(name, engine):
    robot = MECHANISMS[name]
    tree = ENGINES[engine](robot)
    motion = states(robot, COUNT, seed=12)
    expected, closing = [], 0.0
    for state in zip(*motion, strict=True):
        forces, gap = trees.projected_forces(robot, tree, *state)
        expected.append(forces)
        closing = max(closing, gap)
    assert closing < 1e-13, "the engine's loops must close, in metres"
    assert relative_error(pteron.inverse_dynamics(robot, *motion), np.array(expected)) < 1e-12
