"""Inverse dynamics against Lagrange's equations, Pinocchio and MuJoCo; cranks: `test_delta`."""

import lagrange
import numpy as np
import pytest
import trees
from mechanisms import CATALOG, MECHANISMS, relative_error, states

import pteron

COUNT = 200
ENGINES = {"pinocchio": trees.Pinocchio, "mujoco": trees.MuJoCo}
WITH_SLIDERS = [
    name for name, robot in MECHANISMS.items() if "p" in {b for g in robot.legs for b in g.bodies}
]
CHOSEN = [*(name for name in CATALOG if name in WITH_SLIDERS), "random 3T1R 0", "random RPP 0"]


@pytest.mark.parametrize("name", WITH_SLIDERS)
def test_lagrange(name):
    robot = MECHANISMS[name]
    forces = lagrange.inverse_dynamics(robot)
    motion = states(robot, COUNT, seed=11)
    expected = np.array([forces(*state) for state in zip(*motion, strict=True)])
    assert relative_error(pteron.inverse_dynamics(robot, *motion), expected) < 1e-11


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", CHOSEN)
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
    assert relative_error(pteron.inverse_dynamics(robot, *motion), np.array(expected)) < 1e-11
