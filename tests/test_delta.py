"""R-S-S legs against engines, energies and searches that share nothing with pteron."""

from itertools import product

import descriptions
import lagrange
import numpy as np
import pytest
import rod_machines
import tomlkit
import trees
from differences import gradient
from mechanisms import relative_error, with_elbows

import pteron

COUNT = 200
ENGINES = {"pinocchio": trees.Pinocchio, "mujoco": trees.MuJoCo}
PARAMETERS = {"delta": (25, 13), "mixed": (27, 15), "random delta 0": (25, 13)}
MODES = ["".join(signs) for signs in product("+-", repeat=3)]


@pytest.fixture(scope="module")
def robots(tmp_path_factory):
    folder = tmp_path_factory.mktemp("robots")
    found = {}
    for name, (document, _) in rod_machines.MACHINES.items():
        path = folder / f"{name}.toml"
        path.write_text(tomlkit.dumps(document), encoding="utf-8")
        found[name] = pteron.load(path)
    return found


def test_the_published_delta():
    robot = pteron.load("delta")
    machine = descriptions.describe(robot)
    tilt = np.radians(5.327998)
    for leg, azimuth in zip(machine.legs, np.radians([0, 120, 240]), strict=True):
        outwards = np.array([np.cos(azimuth), np.sin(azimuth), 0])
        np.testing.assert_allclose(leg.r, 0.33 * outwards, atol=1e-15)
        np.testing.assert_allclose(leg.s0, 0.125 * outwards, atol=1e-15)
        np.testing.assert_allclose(leg.first @ outwards, np.cos(tilt), rtol=1e-15)
        # The crank is level at that angle; a positive angle lifts its elbow.
        level = np.cos(tilt) * leg.first + np.sin(tilt) * leg.second
        np.testing.assert_allclose(level, outwards, atol=1e-15)
        assert leg.second[2] > 0.99
    home = [0.0, 0.0, -0.9]
    upper, lower = pteron.link_vectors(robot, home)
    elbows = np.array([leg.r for leg in machine.legs]) + upper
    assert (np.linalg.norm(elbows[:, :2], axis=-1) > 0.7).all()
    np.testing.assert_allclose(np.linalg.norm(upper, axis=-1), 0.42, rtol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(lower, axis=-1), 1.055, rtol=1e-15)
    cranks, rods, platform = [3.696, 0.9103248, 0.099792], [1.05, -0.553875], [2.916, 0.0, 0.0]
    inertias = [0.29230738224, 0.3781690625, 0.0228]
    values = [*3 * [*cranks, inertias[0]], *3 * [*rods, inertias[1]], *platform, inertias[2]]
    np.testing.assert_allclose(pteron.parameters(robot), values, rtol=1e-15)


def test_weights_are_held_by_lifting_torques():
    """Statics by hand: each leg holds a crank, its rods, and a third of the platform."""
    robot = pteron.load("delta")
    pose, rest = np.array([0.0, 0.0, -0.9]), np.zeros(3)
    rise = 1 / pteron.jacobian(robot, pose)[0, 2]  # of the platform per angle of all cranks
    angle = pteron.inverse_kinematics(robot, pose)[0] - np.radians(5.327998)
    elbow = 0.42 * np.cos(angle)
    crank = 0.2463 * np.cos(angle) - 0.027 * np.sin(angle)
    expected = 9.81 * (3.696 * crank + 1.05 * (elbow + rise) / 2 + 2.916 * rise / 3)
    assert expected > 0
    torques = pteron.inverse_dynamics(robot, pose, rest, rest)
    np.testing.assert_allclose(torques, expected, rtol=1e-13)


@pytest.mark.parametrize("name", rod_machines.MACHINES)
def test_joints_with_either_elbow(robots, name):
    poses, _, _ = rod_machines.states(name, descriptions.describe(robots[name]), 50, seed=3)
    for signs in ("+++", "---"):
        robot = with_elbows(robots[name], signs)
        machine = descriptions.describe(robot)
        joints = pteron.inverse_kinematics(robot, poses)
        for pose, found in zip(poses, joints, strict=True):
            points = descriptions.platform_points(machine, pose)
            for leg, c, q in zip(machine.legs, points, found, strict=True):
                if leg.crank:
                    away = (q - descriptions.crank_angle(leg, c) + np.pi) % (2 * np.pi) - np.pi
                else:
                    away = q - descriptions.leg_angles(leg, c)[0]
                assert abs(away) < 1e-13


@pytest.mark.parametrize("name", rod_machines.MACHINES)
def test_the_pose_comes_back_from_its_joints(robots, name):
    robot = robots[name]
    poses, _, _ = rod_machines.states(name, descriptions.describe(robot), COUNT, seed=4)
    found = pteron.direct_kinematics(robot, pteron.inverse_kinematics(robot, poses))
    away = np.linalg.norm(found - poses[:, None], axis=-1)
    assert np.nanmin(away, axis=-1).max() < 1e-12


@pytest.mark.parametrize("name", rod_machines.MACHINES)
def test_jacobian(robots, name):
    robot = robots[name]
    poses, _, _ = rod_machines.states(name, descriptions.describe(robot), COUNT, seed=5)
    jacobian = pteron.jacobian(robot, poses)
    by_energies = lagrange.jacobian(robot)
    expected = np.array([by_energies(pose) for pose in poses])
    np.testing.assert_allclose(jacobian, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    differences = gradient(lambda at: pteron.inverse_kinematics(robot, at), poses)
    np.testing.assert_allclose(jacobian, differences, rtol=0, atol=1e-9 * np.abs(expected).max())


def by_lagrange(robot, motion):
    forces = lagrange.inverse_dynamics(robot)
    return np.array([forces(*state) for state in zip(*motion, strict=True)])


@pytest.mark.parametrize("name", rod_machines.MACHINES)
def test_inverse_dynamics_by_lagrange(robots, name):
    robot = robots[name]
    motion = rod_machines.states(name, descriptions.describe(robot), COUNT, seed=6)
    forces = pteron.inverse_dynamics(robot, *motion)
    assert relative_error(forces, by_lagrange(robot, motion)) < 1e-12


@pytest.mark.parametrize("signs", MODES)
@pytest.mark.parametrize("name", ["delta", "mixed"])
def test_inverse_dynamics_of_every_working_mode(robots, name, signs):
    robot = with_elbows(robots[name], signs)
    motion = rod_machines.states(name, descriptions.describe(robot), 10, seed=6)
    forces = pteron.inverse_dynamics(robot, *motion)
    assert relative_error(forces, by_lagrange(robot, motion)) < 1e-12


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", rod_machines.MACHINES)
def test_inverse_dynamics_by_an_engine(robots, name, engine):
    robot = robots[name]
    tree = ENGINES[engine](robot)
    motion = rod_machines.states(name, descriptions.describe(robot), COUNT, seed=7)
    states = zip(*motion, strict=True)
    expected, gaps = zip(*(trees.projected_forces(robot, tree, *s) for s in states), strict=True)
    assert max(gaps) < 1e-13, "the engine's loops must close, in metres"
    assert relative_error(pteron.inverse_dynamics(robot, *motion), np.array(expected)) < 1e-12


@pytest.mark.parametrize("name", PARAMETERS)
def test_regressor_and_base_parameters(robots, name):
    robot, (standard, base) = robots[name], PARAMETERS[name]
    motion = rod_machines.states(name, descriptions.describe(robot), COUNT, seed=8)
    by_energies = lagrange.regressor(robot)
    expected = np.array([by_energies(*state) for state in zip(*motion, strict=True)])
    found = pteron.regressor(robot, *motion)
    assert found.shape == (COUNT, 3, standard)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    singular = np.linalg.svd(expected.reshape(-1, standard), compute_uv=False)
    assert singular[base] < 1e-12 * singular[0] < 1e-6 * singular[base - 1]
    for method in ("exact", "svd", "qr"):
        assert pteron.base_parameters(robot, method=method).rank == base


@pytest.mark.parametrize("name", rod_machines.MACHINES)
def test_accelerations_come_back_from_their_forces(robots, name):
    robot = robots[name]
    motion = rod_machines.states(name, descriptions.describe(robot), COUNT, seed=9)
    pose, velocity, acceleration = motion
    wrench = 20.0 * np.random.default_rng(9).normal(size=pose.shape)
    forces = pteron.inverse_dynamics(robot, *motion, wrench=wrench)
    free = pteron.inverse_dynamics(robot, *motion)
    held = np.einsum("bnm,bn->bm", pteron.jacobian(robot, pose), free - forces)
    np.testing.assert_allclose(held, wrench, rtol=0, atol=1e-10)
    found = pteron.forward_dynamics(robot, pose, velocity, forces, wrench=wrench)
    np.testing.assert_allclose(found, acceleration, rtol=0, atol=1e-10)
