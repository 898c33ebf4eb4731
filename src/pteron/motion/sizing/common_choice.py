"""`choose_common`: one motor and one ratio for all legs of a machine that are alike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import scipy  # type: ignore[import-untyped]

from pteron.arguments import expect
from pteron.legs import LegKind
from pteron.manipulator import RobotLike, as_manipulator
from pteron.motion.sizing.drive_loads import HOLDING, Sizing, best_ratio, mean_squares
from pteron.motion.sizing.gearing import Span
from pteron.motion.sizing.motor_choice import (
    Fit,
    fast_span,
    fit_at,
    order,
    serving_span,
)
from pteron.motion.sizing.motors import Motor

_ALIKE = 1e-2
"""Relative difference of dimensions up to which legs are alike: more than those of one drawing
have when they are built and measured."""

_SAME = 1e-9
"""Relative difference below which ratios are the same."""


@dataclass(frozen=True)
class CommonFit:
    """A motor at several legs over a cycle, behind the same ratio at each.

    Attributes
    ----------
    legs : tuple of int
        From 1.
    motor : Motor
        The motor.
    span : Span
        The ratios at which it serves at all of them.
    ratio : float
        The one among them at which the largest of the legs' root mean square torques is least,
        rad/m or rad/rad.
    fits : tuple of Fit
        The motor at each leg, at this ratio.
    """

    legs: tuple[int, ...]
    motor: Motor
    span: Span
    ratio: float
    fits: tuple[Fit, ...]

    @property
    def worst(self) -> Fit:
        """The leg where its least margin is smallest."""
        return min(self.fits, key=lambda fit: fit.margin)


def alike_legs(robot: RobotLike) -> tuple[tuple[int, ...], ...]:
    """Return the legs, from 1, that are alike, in groups of two or more.

    They are of one kind and have links of the same lengths: what makes one drive fit all of them.

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
    own = [_dimensions(leg) for leg in robot.legs[: robot.joint_count]]
    groups: list[list[int]] = []
    for i, leg in enumerate(own):
        for group in groups:
            first = own[group[0]]
            same = robot.legs[i].type == robot.legs[group[0]].type and leg.keys() == first.keys()
            if same and all(math.isclose(leg[k], first[k], rel_tol=_ALIKE) for k in leg):
                group.append(i)
                break
        else:
            groups.append([i])
    return tuple(tuple(i + 1 for i in group) for group in groups if len(group) > 1)


def _dimensions(leg: LegKind) -> dict[str, float]:
    """Return a leg's lengths and other numbers, by their keys."""
    roles = ("length", "number", "count")
    keys = [name for name, key in leg.every_key().items() if key.role in roles]
    given = {name: getattr(leg, name) for name in keys}
    return {name: float(value) for name, value in given.items() if value is not None}


def choose_common(
    sizing: Sizing, motors: Sequence[Motor], *, margin: float = 1.0
) -> tuple[CommonFit, ...]:
    """Return how each motor suits the legs that are alike, with one ratio for all of them.

    A machine is built with the same drive at legs that are alike, though its cycle does not ask
    the same of each. The best is first, as `choose` has it.

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
    expect(1.0 <= margin < math.inf, "margin", margin, "a number of 1 or more")
    found = []
    for legs in alike_legs(sizing.robot):
        fits = [_common(sizing, legs, motor, margin) for motor in motors]
        found += sorted(fits, key=lambda one: order(one.motor, one.span, one.worst.margin))
    return tuple(found)


def _common(sizing: Sizing, legs: tuple[int, ...], motor: Motor, margin: float) -> CommonFit:
    span = fast = Span(0.0, math.inf)
    for leg in legs:
        fast = fast.within(fast_span(sizing, leg, motor, margin))
        span = span.within(serving_span(sizing, leg, motor, margin))
    least, greatest = span if span else fast
    ratio = min(max(_best_ratio(sizing, legs, motor.rotor_inertia), least), greatest)
    if not math.isfinite(ratio):  # the joints only hold: any ratio from the least on serves
        ratio = least or 1.0
    fits = tuple(fit_at(sizing, leg, motor, span, ratio) for leg in legs)
    return CommonFit(legs, motor, span, ratio, fits)


def _best_ratio(sizing: Sizing, legs: tuple[int, ...], rotor_inertia: float) -> float:
    """Return the ratio at which the largest root mean square torque of all legs is least."""
    own = [best_ratio(sizing, leg, rotor_inertia) for leg in legs]
    moving = [ratio for ratio in own if math.isfinite(ratio)]
    if not moving:
        return math.inf
    least, most = min(moving), max(moving)
    if len(moving) < len(own):  # where a leg only holds, more is better
        most *= HOLDING
    if most - least <= _SAME * most:
        return most

    def largest(log: float) -> float:
        ratio = math.exp(log)
        return max(float(mean_squares(sizing, leg, ratio, rotor_inertia).max()) for leg in legs)

    # The largest of convex functions of i^2, which all fall before these bounds and rise behind.
    bounds = math.log(least), math.log(most)
    found = scipy.optimize.minimize_scalar(
        largest, bounds=bounds, method="bounded", options={"xatol": _SAME}
    )
    return math.exp(found.x)
