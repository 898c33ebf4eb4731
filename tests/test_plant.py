"""The benchmark's machine in MuJoCo, for two seconds: it is accurate, and it can be identified."""

import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from mechanisms import CLIENTS, several

import pteron
from pteron.identification import (
    Log,
    Processing,
    identification_model,
    observations_of,
    preprocessing_for_log,
    weighted_least_squares,
)

FOLDER = Path(__file__).parent.parent / "benchmarks" / "identification"


FRICTION = {
    "tripteron": ((6.0, 7.0, 8.0), (4.0, 5.0, 6.0), (0.1, 0.2, 0.3)),
    "delta": ((4.0, 3.0, 5.0), (1.0, 1.5, 1.2), (0.5, -0.3, 0.0)),
    "ball-table": ((0.015, 0.016, 0.017), (3e-3, 3.3e-3, 3.6e-3), (0.0, 1e-3, 2e-3)),
    "par4": ((0.2, 0.15, 0.25, 0.3), (0.05, 0.06, 0.04, 0.07), (0.02, -0.01, 0.0, 0.03)),
}


@lru_cache
def recorded(name, duration):
    pytest.importorskip("mujoco")
    sys.path.insert(0, str(FOLDER))
    try:
        import plant
    finally:
        sys.path.remove(str(FOLDER))
    robot = pteron.load(name)
    built = plant.as_built(robot)
    friction = plant.Friction(*FRICTION[name])
    recording = plant.simulate(
        built,
        plant.fourier_reference(robot, 0, speed=2.0, acceleration=20.0),
        friction,
        duration=duration,
        settle=0.5,
        drawn=robot,
    )
    return robot, built, friction, recording


@pytest.mark.parametrize(
    ("name", "duration"),
    several(
        [("tripteron", 2.5), *((name, 0.5) for name in ("delta", "par4", "ball-table"))],
        [("delta", 0.5)],
    ),
)
def test_its_forces_are_those_of_the_model(name, duration):
    _, built, friction, recording = recorded(name, duration)
    poses = pteron.follow(built, recording.joints, recording.poses[0])
    assert np.abs(poses - recording.poses).max() < 1e-6
    jacobian = pteron.jacobian(built, poses)
    velocity = np.linalg.solve(jacobian, recording.rates[..., None])[..., 0]
    drift = pteron.kinematics.joint_accelerations(
        built, poses, velocity, np.zeros_like(poses)
    ).actuated
    acceleration = np.linalg.solve(jacobian, (recording.accelerations - drift)[..., None])[..., 0]
    forces = pteron.inverse_dynamics(built, poses, velocity, acceleration)
    rates = recording.rates
    forces = forces + friction.coulomb * np.sign(rates) + np.array(friction.viscous) * rates
    moving = np.abs(rates) > 1e-3
    off = np.abs(forces + np.array(friction.offset) - recording.forces)[moving]
    assert np.sqrt((off**2).mean()) < 1e-4 * np.sqrt((recording.forces**2).mean())


@CLIENTS
def test_it_is_identified_through_its_sensors():
    robot, built, friction, recording = recorded("tripteron", 2.5)
    import plant

    seen = plant.measured(recording, encoder=1e-6, force=0.01, jitter=1e-5, seed=0)
    log = Log("plant", seen.time, seen.joints, seen.forces)
    model = identification_model(robot)
    treatment = preprocessing_for_log(robot, log, Processing(derivatives="central"))
    found = weighted_least_squares(observations_of(model, log, treatment))
    truth = np.r_[model.base.values(built), friction.coulomb, friction.viscous, friction.offset]
    errors = (found.values - truth) / found.deviations
    assert np.abs(errors).max() < 4.5
    assert np.sqrt((errors**2).mean()) < 1.6
