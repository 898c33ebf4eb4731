"""Position error and compliance of the tool, as the parts of drives and of all else.

The parts are computed once for a machine; from them follow error and compliance with any drives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pteron.design.requirement_tables import AccuracyTable
from pteron.design.worst_cases import worst_position_errors
from pteron.indices import (
    ALUMINIUM,
    STEEL,
    Elasticity,
    Material,
    Section,
    Tolerances,
    pose_error,
    stiffness,
)
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.manipulator.dimensions import Stock

MATERIALS = {"steel": STEEL, "aluminium": ALUMINIUM, "carbon": Material(120e9, 5e9)}
"""Moduli of the stock's materials; carbon is fibre in resin, mostly along the tube."""

_SOFT, _HARD = 1e4, 1e7
"""Two stiffnesses of drives, N/m or N m/rad, between which compliance is linear."""


def tolerances(accuracy: AccuracyTable, joints: float | Sequence[float]) -> Tolerances:
    """Return `Tolerances` of the parts in `accuracy`, with these joint errors, m or rad."""
    return Tolerances(joints, 0.0, accuracy.point, accuracy.length, accuracy.angle)


def joint_errors(accuracy: AccuracyTable, ratios: Array, backlash: Array) -> Array:
    """Return joint errors, m or rad: half an encoder count plus half the backlash.

    `ratios` are motor radians per joint unit, `backlash` is at the joint, m or rad.
    """
    return np.asarray(
        np.pi / accuracy.counts_per_turn / ratios + 0.5 * accuracy.backlash * backlash
    )


def unit_errors(accuracy: AccuracyTable, robot: Manipulator, poses: Array) -> tuple[Array, Array]:
    """Return tool errors (N,) at poses: per unit of joint error, and those of the parts, m."""
    joints = greatest_errors(accuracy, robot, poses, Tolerances(joints=1.0))
    if not accuracy.has_part_errors:
        return joints, np.zeros_like(joints)
    return joints, greatest_errors(accuracy, robot, poses, tolerances(accuracy, 0.0))


def greatest_errors(
    accuracy: AccuracyTable, robot: Manipulator, poses: Array, errors: Tolerances
) -> Array:
    """Return the tool's error at poses, (N,), m: worst case or standard deviation.

    `accuracy.counted` selects which.
    """
    if accuracy.counted == "worst":
        return worst_position_errors(robot, poses, errors)
    return np.asarray(pose_error(robot, poses, errors).position)


def errors_with(
    accuracy: AccuracyTable, units: tuple[Array, Array], ratios: Array, backlash: Array
) -> Array:
    """Return the tool's greatest error, m, for each of O choices of drives: (O,).

    `units` are errors as `unit_errors` returns them.
    """
    joint = joint_errors(accuracy, ratios, backlash)[:, None] * units[0]
    total = joint + units[1] if accuracy.counted == "worst" else np.hypot(joint, units[1])
    return np.asarray(total.max(axis=1))


def link_sections(robot: Manipulator, stocks: Mapping[str, str]) -> dict[str, Section]:
    """Return the cross-sections of links made of bar stock; `stocks` has its name by link."""
    sections = {}
    for key, name in stocks.items():
        stock = Stock.parse(name)
        wall = 0.5 * (stock.outer - stock.inner)
        tube = Section.tube(stock.outer, wall, MATERIALS[name.split("-")[0]])
        rods = getattr(robot.legs[0], "rods", 1) if key == "lower" else 1
        parts = (tube.axial, tube.bending, tube.sideways, tube.torsion)
        sections[key] = Section(*(rods * part for part in parts))
    return sections


def elasticity(sections: Mapping[str, Section], actuators: float | Sequence[float]) -> Elasticity:
    """Return the `Elasticity` of links with these sections and drives of stiffness `actuators`."""
    several = actuators if isinstance(actuators, float) else tuple(actuators)
    return Elasticity(several, sections.get("upper"), sections.get("lower"))


def compliances(
    robot: Manipulator, poses: Array, sections: Mapping[str, Section]
) -> tuple[Array, Array]:
    """Return greatest compliances (N,) at poses: with rigid drives, m/N; slope by drives'.

    The first result, m/N, is for rigid drives; the second is the derivative by the drives'
    compliance.
    """
    soft, hard = (
        np.asarray(1.0 / stiffness(robot, poses, elasticity(sections, k)).least)
        for k in (_SOFT, _HARD)
    )
    by_drive = (soft - hard) / (1.0 / _SOFT - 1.0 / _HARD)
    return np.maximum(hard - by_drive / _HARD, 0.0), by_drive


def compliance_with(compliances: tuple[Array, Array], actuators: Array) -> Array:
    """Return the greatest compliance over poses, m/N, for each of O drive stiffnesses: (O,)."""
    return np.asarray((compliances[0] + compliances[1] / actuators[:, None]).max(axis=1))
