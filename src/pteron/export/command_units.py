"""Units of the drives' commands (forces, motor torques, per cent) and of their joint readings."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import casadi as ca

from pteron.arguments import expect_one_of
from pteron.bodies.motion import Expression
from pteron.equations.laws import LAWS
from pteron.errors import ModelError
from pteron.kernels import Program
from pteron.legs import Drive
from pteron.manipulator import Manipulator
from pteron.manipulator.readings import has_readings, reading_scales, reading_zeros

Output = Literal["force", "torque", "percent"]
"""Units of commands: forces at the joints, torques of the motors, or per cent of rated torque."""

DRIVEN = ("drive_forces", "feed_forward", "joint_feed_forward", *LAWS)
"""The functions whose forces are those of the drives."""

NAMES = {"force": "forces", "torque": "motor_torques", "percent": "percent_of_rated"}
"""Names of the outputs in these units."""

_NEEDS = {"force": (), "torque": ("ratio",), "percent": ("ratio", "rated_torque")}
"""Keys of the drive that each output needs."""


def factors(robot: Manipulator, output: Output) -> tuple[float, ...]:
    """Return the factor (n,) from each joint's force to the unit of its drive's command.

    A motor whose angle is `ratio` times the joint's coordinate gives force / ratio: friction and
    the rotor's inertia are at the joint already.

    Raises
    ------
    ModelError
        If a leg's drive does not say what is needed; it names the first leg and key.
    """
    expect_one_of(get_args(Output), ModelError, output=output)
    scales = []
    for i, leg in enumerate(robot.legs, start=1):
        drive = leg.drive or Drive()
        for key in _NEEDS[output]:
            if getattr(drive, key) is None:
                raise ModelError(
                    f'leg {i}: drive.{key}: missing, but output "{output}" needs it of every leg; '
                    f"{_HINTS[key]}"
                )
        factor = 1.0 if output == "force" else 1.0 / drive.gear
        scales.append(
            factor * (100.0 / (drive.rated_torque or 1.0) if output == "percent" else 1.0)
        )
    return tuple(scales)


_HINTS = {
    "ratio": "it is how far the motor turns per metre or radian of the joint, 1 for direct drives",
    "rated_torque": "it stands on the motor's plate, N m",
}


def convert_forces(function: Program, robot: Manipulator, output: Output) -> Program:
    """Return a program whose forces are in the units of the drives' commands."""
    if output == "force":
        return function
    symbols, ports = function.function.sx_in(), list(function.outputs)
    results = function.function.call(symbols)
    place = next(k for k, port in enumerate(ports) if port.name == NAMES["force"])
    ports[place] = replace(ports[place], name=NAMES[output])
    scale = ca.reshape(ca.DM(factors(robot, output)), results[place].shape)
    results[place] = results[place] * scale
    return Program.from_expressions(function.name, symbols, function.inputs, results, ports)


_PER_READING = {
    **dict.fromkeys(("joint_rates", "joint_accelerations", "actuated", "jacobian"), -1),
    "motor_rates": -1,
    **dict.fromkeys(("forces", "regressor"), 1),
}
"""Outputs and inputs that the scale of a joint's reading multiplies, with its power."""


def convert_joints(function: Program, robot: Manipulator) -> Program:
    """Return a program whose joints, rates and forces are those of the drives' readings."""
    if not has_readings(robot):
        return function
    zeros, scales = ca.DM(reading_zeros(robot)), ca.DM(reading_scales(robot))

    def scale_joints(expression: Expression, power: int) -> Expression:
        """Return a vector by joints, or a matrix whose columns are joints, with scales in it."""
        if expression.shape[1] == len(robot.legs) and expression.shape[0] > 1:
            return ca.mtimes(expression, ca.diag(scales**power))
        return expression * ca.reshape(scales**power, *expression.shape)

    symbols, taken, results = function.function.sx_in(), [], []
    for port, symbol in zip(function.inputs, symbols, strict=True):
        place = port.name in ("joints", "motors")
        power = 1 if place else -_PER_READING.get(port.name, 0)
        zero = ca.reshape(zeros, *symbol.shape) if place else 0.0
        taken.append(zero + scale_joints(symbol, power) if power else symbol)
    for port, expression in zip(function.outputs, function.function.call(taken), strict=True):
        if port.name == "joints":
            results.append(scale_joints(expression - ca.reshape(zeros, *expression.shape), -1))
        else:
            power = _PER_READING.get(port.name, 0)
            results.append(scale_joints(expression, power) if power else expression)
    ports = function.inputs, results, function.outputs
    return Program.from_expressions(function.name, symbols, *ports)


def command_meaning(robot: Manipulator, output: Output) -> str:
    """Return the meaning of the drives' commands, with unit and origin."""
    drives = [leg.drive or Drive() for leg in robot.legs]
    ratios = _join_values([drive.gear for drive in drives])
    if output == "torque":
        return f"torques of the motors, N m: forces at the joints over the ratios {ratios}"
    rated = _join_values([drive.rated_torque or 0.0 for drive in drives])
    return f"per cent of the motors' rated torques, {rated} N m, by the ratios {ratios}"


def _join_values(numbers: list[float]) -> str:
    """Return values as text: a single value if all are equal, else a list with commas."""
    return f"{numbers[0]:g}" if len(set(numbers)) == 1 else ", ".join(f"{v:g}" for v in numbers)
