"""The catalog's Delta is the published one, and holds its weight."""

import descriptions
import numpy as np

import pteron


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
    upper, lower = pteron.kinematics.link_vectors(robot, home)
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
