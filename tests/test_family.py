"""Every kind of leg and platform against engines and energies that share nothing with pteron.

Machines of the catalog, and of each kind as many drawn at random as PTERON_MANY says.
"""

import os
from dataclasses import replace
from typing import NamedTuple

import descriptions
import mechanisms
import numpy as np
import pytest
import trees
from lagrange import Lagrange
from mechanisms import CATALOG, MIXTURES, gated, in_turn, random_machine, relative_error

import pteron

COUNT = 200
MANY = int(os.environ.get("PTERON_MANY", "1"))
ENGINES = {"pinocchio": trees.Pinocchio, "mujoco": trees.MuJoCo}

GATE = (
    *("quadrupteron", "tripteron-oblique", "linear-delta", "h4", "five-bar"),
    *(("PRS", 0), ("PRSU", 0), ("PRSSI", 0), ("CCL", 0), ("CPR", 0)),
)
"""Every closure under every platform, every kind of leg; see `mechanisms.GATE`."""

MIXED = ["PRS", "PRSU", "CL", "CCL"]
"""Every kind of leg, under every kind of platform that holds it."""


class Case(NamedTuple):
    """A machine, states of it, wrenches on its platform, and its dynamics by energies."""

    robot: pteron.Manipulator
    motion: tuple
    wrench: np.ndarray
    oracle: Lagrange


EVERY = in_turn(
    [*CATALOG, *((kinds, seed) for kinds in MIXTURES for seed in range(MANY))],
    GATE,
    share=3,
    argument="case",
    indirect=True,
    ids=lambda p: p if isinstance(p, str) else f"{p[0]}-{p[1]}",
)


@pytest.fixture(scope="module")
def case(request):
    if request.param in CATALOG:
        robot = CATALOG[request.param]
        motion = mechanisms.states(robot, COUNT)
    else:
        kinds, seed = request.param
        robot = random_machine(seed, kinds)
        motion = descriptions.states(descriptions.describe(robot), COUNT, seed)
    wrench = 10.0 * np.random.default_rng(1).normal(size=motion[0].shape)
    return Case(robot, motion, wrench, Lagrange(robot))


def error(found, expected):
    """Return the largest error of any state, relative to the state's largest entry."""
    assert np.shape(found) == expected.shape
    flat = len(expected), -1
    return relative_error(np.reshape(found, flat), expected.reshape(flat))


def loaded(forces, jacobian, wrench):
    """Return the actuator forces where a wrench helps them."""
    return forces - (np.linalg.pinv(jacobian.swapaxes(1, 2)) @ wrench[..., None])[..., 0]


@EVERY
def test_joints(case):
    machine, poses = descriptions.describe(case.robot), case.motion[0]
    away = pteron.inverse_kinematics(case.robot, poses)
    away -= descriptions.inverse_kinematics(machine, poses)
    cranks = [leg.crank for leg in machine.legs]
    away[:, cranks] = (away[:, cranks] + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(away).max() < 1e-12


@EVERY
def test_jacobian(case):
    poses = case.motion[0]
    assert error(pteron.jacobian(case.robot, poses), case.oracle.jacobian(poses)) < 1e-12


@EVERY
def test_forces(case):
    robot, motion, wrench, oracle = case
    expected = loaded(oracle.forces(*motion), oracle.jacobian(motion[0]), wrench)
    assert error(pteron.inverse_dynamics(robot, *motion, wrench), expected) < 1e-12


@EVERY
@pytest.mark.parametrize("engine", ENGINES)
def test_forces_of_an_engine(case, engine):
    robot, motion, wrench, _ = case
    if robot.platform.slides and engine == "pinocchio":
        pytest.skip("the halves of a platform that slides are coupled joints")
    # Wherever the file's home pose is: here at the first of the poses.
    model = ENGINES[engine](robot, motion[0][0], spin=False)
    forces, jacobian, gap = trees.projected(robot, model, *motion)
    assert gap < 1e-13, "the engine's loops must close, in metres"
    assert error(pteron.jacobian(robot, motion[0]), jacobian) < 1e-12
    expected = loaded(forces, jacobian, wrench)
    assert error(pteron.inverse_dynamics(robot, *motion, wrench), expected) < 1e-12


@EVERY
def test_accelerations_come_back_from_their_forces(case):
    robot, (pose, velocity, acceleration), wrench, _ = case
    forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration, wrench)
    found = pteron.forward_dynamics(robot, pose, velocity, forces, wrench)
    assert error(found, acceleration) < 1e-10


@EVERY
def test_regressor(case):
    robot, motion, _, oracle = case
    bare = replace(robot, platform=replace(robot.platform, bars=(), geared=()))
    np.testing.assert_allclose(pteron.parameters(bare), oracle.parameters, rtol=1e-14)
    assert error(pteron.regressor(robot, *motion), oracle.regressor(*motion)) < 1e-12


@EVERY
def test_energies(case):
    robot, (pose, velocity, _), _, oracle = case
    kinetic, potential = oracle.energies(pose, velocity)
    found = pteron.kinetic_energy(robot, pose, velocity)
    np.testing.assert_allclose(found, kinetic, rtol=1e-12)
    # The height of a bar's hinge adds a constant that no parameter of the platform holds.
    found = pteron.potential_energy(robot, pose)
    expected, atol = potential - potential[0], 1e-13 * np.abs(potential).max()
    np.testing.assert_allclose(found - found[0], expected, rtol=0, atol=atol)


@pytest.mark.parametrize("seed", range(MANY))
@pytest.mark.parametrize("kinds", gated(MIXTURES if MANY > 1 else MIXED, ("PRS", "CL")))
def test_forces_of_every_working_mode(kinds, seed):
    for mode in pteron.working_modes(random_machine(seed, kinds)):
        motion = descriptions.states(descriptions.describe(mode), 5, seed, least=0.02)
        forces = Lagrange(mode).forces(*motion)
        assert error(pteron.inverse_dynamics(mode, *motion), forces) < 1e-11
