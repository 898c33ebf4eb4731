"""Zeros of a printer from measured places of its tool."""

import numpy as np

import pteron
from pteron.calibration import Calibration, Measurements, calibrate

robot = pteron.load("linear-delta")
poses = pteron.random_poses(robot, 40, seed=2)
readings = pteron.inverse_kinematics(robot, poses) + np.array([0.001, 0.0, -0.002])
measurements = Measurements.from_readings(robot, readings, poses=poses)
calibration: Calibration = calibrate(robot, measurements, free=["zeros"])
built: pteron.Manipulator = calibration.robot
print(calibration.verdict.grade, built.name, len(calibration.findings))
