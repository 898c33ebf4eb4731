"""The constraint measure: how far the legs' couples are from leaving a rotation unconstrained.

A leg whose end can turn about some axes only exerts couples perpendicular to these, whether its
joint is held or not. Where the legs' couples no longer span the turns that the platform must not
make, it is free to make them: a constraint singularity (Zlatanov, Bonev and Gosselin, "Constraint
singularities of parallel mechanisms", ICRA 2002).
"""

from __future__ import annotations

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.bodies.vectors import Vector
from pteron.closures.determinants import determinant
from pteron.equations.machine import Machine, State
from pteron.tolerances import ROUNDING


def constraint_rows(machine: Machine, state: State) -> Expression | None:
    """Return couples' rows (K, u) on the rotations that they constrain; None if unknown.

    The columns are the platform's rotations: all three if it does not turn, those perpendicular to
    its axis k if it does or if the machine is planar. Further columns are rotations about k of
    platform parts that do not turn with it, such as the side bars of an H4.
    """
    robot = machine.robot
    x0, y0, k = machine.platform.frame
    axis = robot.platform.turning_axis
    is_one_axis = axis is not None or robot.platform.plane_normal is not None
    columns = ca.horzcat(x0, y0) if is_one_axis else ca.SX.eye(3)
    couples: list[Expression] = []
    parts: list[Vector | None] = []
    for leg, motion in zip(robot.legs, state.legs, strict=True):
        leg_couples = leg.couples(motion, axis)
        if leg_couples is None:
            return None
        couples += leg_couples
        parts += [
            leg.platform_point if axis is not None and _may_act_along(m, k) else None
            for m in leg_couples
        ]
    # A part on which one couple acts yields to it.
    unpaired = [i for i, part in enumerate(parts) if part is not None and parts.count(part) == 1]
    couples = [m for i, m in enumerate(couples) if i not in unpaired]
    parts = [part for i, part in enumerate(parts) if i not in unpaired]
    if not couples:
        return ca.SX(0, columns.shape[1])
    rows = ca.mtimes(ca.horzcat(*couples).T, columns)
    for shared_part in dict.fromkeys(part for part in parts if part is not None):
        couples_about_k = [
            ca.dot(m, k) if part == shared_part else 0
            for m, part in zip(couples, parts, strict=True)
        ]
        rows = ca.horzcat(rows, ca.vertcat(*couples_about_k))
    return rows


def _may_act_along(couple: Expression, axis: Expression) -> bool:
    """Return whether a couple has, or may have, a component along the axis."""
    share = ca.dot(couple, axis)
    return not share.is_constant() or abs(float(share)) > ROUNDING


def constraint_measure(machine: Machine, state: State) -> Expression:
    """Return the constraint measure, no unit: 1 in size at best, 0 at a constraint singularity.

    It is the volume that the couples span, each of length 1 or less, divided by the largest
    possible volume: det R, signed, for as many couples as rotations, else sqrt(det R^T R).
    """
    measure = machine.platform.constraint(state.platform)
    if measure is not None:
        return measure
    rows = constraint_rows(machine, state)
    if rows is None:
        return ca.SX.nan()
    count, turns = rows.shape
    if count < turns:
        return ca.SX(0)
    if count == turns:
        return determinant(rows)
    volume = ca.fmax(determinant(ca.mtimes(rows.T, rows)), 0)
    return ca.sqrt(volume) / (count / turns) ** (0.5 * turns)
