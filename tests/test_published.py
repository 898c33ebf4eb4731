"""Machines whose makers published their own calculations."""

from pathlib import Path

import numpy as np

import pteron

ROUTER = Path(__file__).with_name("data") / "tripteron-router.toml"

MILLIMETRES = np.array([[0, 0, 0], [90, 90, 90], [-90, -90, -90], [90, -90, 90]])
"""Home and three corners, where the router's free-body analysis was published."""

PRINTED = np.array(
    [
        [-80.91187278870954, -80.91187278868028, 157.8862200000283],
        [-81.3855698902187, -81.38556989001836, 156.2823155836013],
        [-79.38617876498388, -79.38617876494766, 161.99261989984007],
        [-81.38556989029689, -79.3861787648187, 155.03106784177908],
    ]
)
"""N, from 60 equations of equilibrium by least squares, which left them nine digits."""


def test_router_holds_its_tool():
    robot = pteron.load(ROUTER)
    pose, rest = MILLIMETRES * 1e-3, np.zeros(3)
    forces = pteron.inverse_dynamics(robot, pose, rest, rest, wrench=[80.0, 80.0, -120.0])
    np.testing.assert_allclose(forces, PRINTED, rtol=0, atol=1e-9)


def test_router_at_home():
    robot = pteron.load(ROUTER)
    home = np.zeros(3)
    np.testing.assert_allclose(pteron.inverse_kinematics(robot, home), 0.1, rtol=1e-15)
    upper, lower = pteron.link_vectors(robot, home)
    elbows = np.array([[0, 0, 1], [0, 0, 1], [0, 1, 0]])
    np.testing.assert_allclose(upper + lower, 0.24 * np.eye(3)[[1, 0, 0]], atol=1e-15)
    assert (np.sum(upper * elbows, axis=-1) > 0.2).all()
