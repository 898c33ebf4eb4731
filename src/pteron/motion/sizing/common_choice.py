"""`choose_common`: one motor and one ratio for all legs of a machine that are alike."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pteron.legs import LegKind
from pteron.manipulator import RobotLike, as_manipulator
from pteron.motion.sizing.drive_loads import Sizing
from pteron.motion.sizing.motor_choice import CommonFit, rank_motors
from pteron.motion.sizing.motors import Motor

_ALIKE = 1e-2
"""Relative difference of dimensions up to which legs are alike: more than those of one drawing
have when they are built and measured."""


def alike_legs(robot: RobotLike) -> tuple[tuple[int, ...], ...]:
    """Return groups of identical legs, as leg numbers from 1; groups have two or more.

    Identical legs are of one kind with links of the same lengths, so that one drive fits all of
    them.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    tuple of tuple of int

    Examples
    --------
    >>> from pteron.motion import alike_legs
    >>> alike_legs("delta"), alike_legs("tripteron-oblique")
    (((1, 2, 3),), ())
    """
    robot = as_manipulator(robot)
    dimensions = [_dimensions(leg) for leg in robot.legs[: robot.joint_count]]
    groups: list[list[int]] = []
    for i, leg in enumerate(dimensions):
        for group in groups:
            first = dimensions[group[0]]
            same = robot.legs[i].type == robot.legs[group[0]].type and leg.keys() == first.keys()
            if same and all(math.isclose(leg[k], first[k], rel_tol=_ALIKE) for k in leg):
                group.append(i)
                break
        else:
            groups.append([i])
    return tuple(tuple(i + 1 for i in group) for group in groups if len(group) > 1)


def _dimensions(leg: LegKind) -> dict[str, float]:
    """Return a leg's lengths and other numeric parameters, by their keys."""
    roles = ("length", "number", "angle", "count")
    keys = [name for name, key in leg.every_key().items() if key.role in roles]
    settings = {name: getattr(leg, name) for name in keys}
    return {name: float(number) for name, number in settings.items() if number is not None}


def choose_common(
    sizing: Sizing, motors: Sequence[Motor], *, margin: float = 1.0
) -> tuple[CommonFit, ...]:
    """Return how each motor suits each group of identical legs, with a common gear ratio.

    A machine is built with the same drive at identical legs, though its cycle loads them
    differently. The best motor is first, in the order of `choose`.

    Parameters
    ----------
    sizing : Sizing
        What the cycle asks of the joints.
    motors : sequence of Motor
        Those to choose from; `read_motors` reads them from a file.
    margin : float
        What a motor must be able to do, over what the cycle asks; 1 or more.

    Returns
    -------
    tuple of CommonFit
        One for each group of `alike_legs` and motor, group by group.

    Raises
    ------
    DataError
        If the margin is not a number of 1 or more.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import Motor, choose_common, pick_and_place, size
    >>> robot = pteron.load("tripteron")
    >>> found = size(robot, pick_and_place(robot, [0.0, 0.0, 0.0], scale=0.5, duration=0.5))
    >>> fit = choose_common(found, [Motor("200 W", 3e-5, 0.64, 1.9, 600.0)])[0]
    >>> fit.legs, round(fit.ratio)
    ((1, 2, 3), 295)
    """
    return tuple(rank_motors(sizing, alike_legs(sizing.robot), motors, margin))
