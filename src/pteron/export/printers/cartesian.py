"""Values of a configuration of Klipper's generic_cartesian: joints that are linear in the pose.

The formulas are those of klippy/kinematics/generic_cartesian.py, kinematic_stepper.py and
klippy/chelper/kin_generic.c.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from pteron.errors import ModelError
from pteron.export.printers.bed import tool_of
from pteron.export.printers.sections import (
    INSTEAD,
    reading_comment,
    rotation_distance,
    signed_number,
)
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics, jacobian
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.manipulator import Manipulator

ZERO = 5e-13
"""Size of coefficients below which they are left out: over a metre less than a picometre."""

_LEAST_DETERMINANT = 1e-5
"""The determinant below which Klipper (generic_cartesian.py) says that the steppers cannot move all
axes."""


def cartesian(robot: Manipulator) -> dict[str, Any]:
    """Return the template's values for `generic_cartesian`: each stepper a sum of x, y and z.

    Raises
    ------
    ModelError
        If Klipper would hold the directions for dependent.
    """
    rows = np.asarray(jacobian(robot, np.zeros(3)))
    tool = tool_of(robot)
    # The joints where the tool is at zero.
    offsets = 1000.0 * (
        np.asarray(evaluate_unchecked(robot, "joint_coordinates", np.zeros(3))) - rows @ tool
    )
    size = float(np.linalg.det(rows.T @ rows))
    if size < _LEAST_DETERMINANT:
        raise ModelError(
            f"{robot.name}: its directions are so close to a plane (det(J^T J) = {size:.1e}) that "
            f"Klipper, which asks for 1e-5, refuses them; {INSTEAD}"
        )
    box, comments = _box(robot, rows, offsets, tool)
    straight = ((np.abs(rows) > ZERO).sum(axis=1) == 1).all()
    homing = (
        "Each slider moves along one axis: its end stop is that axis' own."
        if straight
        else "The sliders move along oblique directions, but Klipper homes x, y and z: an end stop "
        "at a slider is none of an axis. Home with [homing_override] and SET_KINEMATIC_POSITION."
    )
    steppers = []
    for i, joint in enumerate(robot.joint_names):
        place = f"Its position is {joint} in mm {signed_number(-offsets[i])} mm."
        steppers.append(
            {
                "comments": (place, *reading_comment(robot, i, "rotation_distance")),
                "name": joint,
                "carriages": _sum(rows[i]),
                "turn": rotation_distance(robot, i),
            }
        )
    return {
        "kinematics": "generic_cartesian",
        "comments": (),
        "box": (homing, *comments),
        "carriages": dict(zip("xyz", box, strict=True)),
        "steppers": steppers,
    }


def _sum(row: Array) -> str:
    """Return a linear combination as kinematic_stepper.py reads it: no blanks, no exponents."""
    terms: list[str] = []
    for axis, coefficient in zip("xyz", row, strict=True):
        if abs(coefficient) <= ZERO:
            continue
        sign = "-" if coefficient < 0.0 else "+" if terms else ""
        text = f"{abs(coefficient):.15f}".rstrip("0").rstrip(".")
        terms.append(sign + (axis if text == "1" else f"{text}*{axis}"))
    return "".join(terms)


def _box(
    robot: Manipulator, rows: Array, offsets: Array, tool: Array
) -> tuple[list[tuple[str | None, str | None]], tuple[str, ...]]:
    """Return ranges of x, y and z, mm, within the joints' limits, and comments on them."""
    if any(leg.limits is None for leg in robot.legs):
        return [(None, None)] * 3, ("The machine's file has no limits of the joints.",)
    limits = 1000.0 * np.array([leg.limits for leg in robot.legs]) - offsets[:, None]
    middle = np.linalg.solve(rows, limits.mean(axis=1))
    # The largest cube about the middle; along axes that a slider has for itself, all of its way.
    half = np.ptp(limits, axis=1) / 2.0
    sides = np.full(3, (half / np.abs(rows).sum(axis=1)).min())
    for row, reach in zip(rows, half, strict=True):
        (moving,) = np.nonzero(np.abs(row) > ZERO)
        if len(moving) == 1 and (np.abs(rows[:, moving[0]]) > ZERO).sum() == 1:
            sides[moving[0]] = reach / abs(row[moving[0]])
    grid = middle + sides * np.array(list(product(np.linspace(-1.0, 1.0, 9), repeat=3)))
    reached = np.isfinite(inverse_kinematics(robot, grid / 1000.0 - tool, on_failure="nan")).all(
        axis=1
    )
    comments = ["This box keeps the joints' limits; Klipper checks the box and no leg's reach."]
    if not reached.all():
        share = 100.0 * (1.0 - reached.mean())
        comments.append(
            f"In {share:.0f} % of it a leg does not reach: make it smaller, by `pteron workspace`."
        )
    box = [(f"{m - s:.6g}", f"{m + s:.6g}") for m, s in zip(middle, sides, strict=True)]
    return [(least, most) for least, most in box], tuple(comments)
