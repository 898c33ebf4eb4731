"""`LimitRow`: each limit of a chosen machine with the worst value, its margin and its place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.design.kind_evaluator import KindEvaluator
from pteron.design.machine_space import tool_places
from pteron.design.rating import Rating
from pteron.design.structure import Structure
from pteron.dynamics import mass_matrix
from pteron.dynamics.joint_space import moved_inertias
from pteron.kernels import Array
from pteron.kinematics import jacobian
from pteron.manipulator import Manipulator
from pteron.result import Result

DENSE = 7
"""Poses along each side of the box in the final evaluation of a design."""

_KEPT = 2
"""Worst poses of each limit about which the search goes on."""


@dataclass(frozen=True, eq=False, repr=False)
class LimitRow(Result):
    """A limit of a chosen machine over its whole workspace.

    Attributes
    ----------
    name : str
        What is limited.
    value : float
        The worst value, in `unit`.
    limit : float
        What is permitted.
    upper : bool
        Whether that is the greatest permitted value, or the least.
    unit : str
        "m", "Hz", or "" of a ratio.
    margin : float
        How far the value is from the limit: 1 at the limit, above 1 within it.
    place : str
        Where it is worst.
    """

    name: str
    value: float
    limit: float
    upper: bool
    unit: str
    margin: float
    place: str

    def __repr__(self) -> str:
        """Return the name of the limit and its margin in one line."""
        return f"<LimitRow of {self.name!r}: margin {self.margin:.3g}>"

    @property
    def texts(self) -> tuple[str, str, str, str]:
        """Value, limit and margin as text with units, and the place."""
        scale, unit = (1e3, " mm") if self.unit == "m" else (1.0, f" {self.unit}".rstrip())
        value, limit = (f"{scale * number:.3g}{unit}" for number in (self.value, self.limit))
        bound = "at most" if self.upper else "at least"
        margin = f"{self.margin:.2f}" if self.margin < 100.0 else "over 100"
        return value, f"{bound} {limit}", margin, self.place


def limit_rows(evaluator: KindEvaluator, rating: Rating) -> list[LimitRow]:
    """Return the limits that an engineer asks of every machine, at the worst poses for each."""
    limits = evaluator.job.limits
    robot = evaluator.add_payload(rating.machine)
    time = evaluator.kind.numbers(rating.values).get("time")
    demand, tubes = evaluator.demand(time), evaluator.kind.tubes(rating.machine, rating.values)
    stiffness = np.array([option.stiffness for option in rating.options])
    drives = [leg.drive for leg in robot.legs]
    rated = np.array([drive.rated_force for drive in drives if drive is not None])
    rotors = np.array([drive.inertia for drive in drives if drive is not None])
    frequency = evaluator.cycle_frequency(time)

    def values_of(places: Array) -> Array:
        """Return the value of each limit (N, C) at N poses about the middle, worse if greater."""
        poses = rating.middle + places
        structure = Structure(robot, poses, demand, tubes)
        inertia = moved_inertias(jacobian(robot, poses), mass_matrix(robot, poses)) / rotors
        return np.column_stack(
            [
                (structure.holding / rated).max(axis=1),
                inertia.max(axis=1),
                -inertia.min(axis=1),
                structure.sag(stiffness),
                structure.stress_share,
                -structure.buckling_factor,
                structure.joint_share(rating.parts),
                -structure.frequency(stiffness),
            ]
        )

    worst, places = evaluator.worst(robot, lambda at: -values_of(at), DENSE, _KEPT)
    held, most, least, sag, stress, buckling, joints, natural = np.abs(worst)
    named = (
        ("holding torque / rated", held, limits.rated, "", True),
        ("load / rotor inertia, most", most, limits.inertia[1], "", True),
        ("load / rotor inertia, least", least, limits.inertia[0], "", False),
        ("sag by weights", sag, evaluator.sag, "m", True),
        ("stress / strength", stress, limits.stress, "", True),
        ("buckling load / force", buckling, limits.buckling, "", False),
        ("joint load / rating", joints, limits.joints, "", True),
        ("first frequency", natural, limits.frequency * frequency, "Hz", False),
    )
    rows = []
    for (name, value, limit, unit, upper), place in zip(named, places, strict=True):
        if not limit:
            continue
        margin = limit / max(value, 1e-12) if upper else value / limit
        words = place_text(robot, rating.middle, place)
        rows.append(LimitRow(name, float(value), float(limit), upper, unit, float(margin), words))
    return rows


def place_text(robot: Manipulator, middle: Array, place: Array) -> str:
    """Return the tool's place, mm from the middle of the workspace, and the angles, as text."""
    away = np.subtract(*tool_places(robot, np.array([middle + place, middle])))
    count = len(robot.platform.lengths)
    at = ", ".join(f"{1e3 * x:+.0f}" for x in away[:count])
    angles = zip(robot.coordinates[count:], np.degrees(place[count:]), strict=True)
    turned = "".join(f", {name} {angle:+.0f} deg" for name, angle in angles if abs(angle) > 0.5)
    return f"({at}) mm{turned}"
