"""Differences of a design from the machine that a search began with, in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pteron.design.design import Design
from pteron.design.proofs import start_design
from pteron.design.task import Task
from pteron.manipulator import Manipulator
from pteron.manipulator.manipulator import legs_text
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.tolerances import ROUNDING

_SMALL = 1e-2
"""Length from which on a tenth of a millimetre is fine enough, m."""


@dataclass(frozen=True, eq=False, repr=False)
class Change(Result):
    """One number before and after.

    Attributes
    ----------
    what : str
        Name of the number.
    before, after : float
        Its values.
    unit : str
        Unit of both; empty where they have none.
    """

    what: str
    before: float
    after: float
    unit: str

    @property
    def words(self) -> str:
        """The change as a clause: "upper length of legs 2 and 4 154.0 mm -> 246.0 mm (+59.7 %)"."""
        what, start, end, change = self.cells
        return f"{what} {start} -> {end} ({change})"

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """The quantity's name, both values with their unit, and the relative change."""
        start, end = self.format_value(self.before), self.format_value(self.after)
        return self.what, start, end, self.relative_change

    @property
    def relative_change(self) -> str:
        """Relative change in %; the difference where the value was zero or changes its sign."""
        if math.isnan(self.before) or math.isnan(self.after):
            return ""
        if abs(self.before) > ROUNDING and self.before * self.after > 0.0:
            text = f"{100.0 * (self.after / self.before - 1.0):+.1f} %"
            return "none" if float(text[:-2]) == 0.0 else text
        if abs(self.after - self.before) <= ROUNDING:
            return "none"
        sign = "+" if self.after > self.before else "-"
        return f"{sign}{self.format_value(abs(self.after - self.before))}"

    by = former_attribute("by", "relative_change")
    shown = former_attribute("shown", "format_value")

    told = former_attribute("told", "format_value")

    def format_value(self, number: float) -> str:
        """Return a value with its unit; lengths in millimetres."""
        if math.isnan(number):
            return "none"
        if self.unit == "m":
            return f"{1000.0 * number + 0.0:{'.1f' if abs(number) >= _SMALL else '.3g'}} mm"
        return f"{number:.4g} {self.unit}".rstrip()


def geometry_changes(task: Task, robot: Manipulator) -> list[Change]:
    """Return changes of geometric numbers from the task's machine to `robot`, equal legs joined.

    A factor of numbers with more than two sizes, as of a platform's points, is one change.
    """
    legs_by_change: dict[tuple[str, float, float, str], list[int]] = {}
    factors: list[Change] = []
    for variable in task.variables:
        sizes = {round(abs(place.read(task.robot)), 9): place for place in variable.places}
        if variable.by == "factor" and len(sizes) > 2:
            largest = sizes[max(sizes)]
            factor = largest.read(robot) / largest.read(task.robot)
            factors.append(Change(f"factor of {variable.name}", 1.0, factor, ""))
            continue
        for place in variable.places:
            drawn, designed = place.read(task.robot), place.read(robot)
            if abs(designed - drawn) > ROUNDING:
                part = "" if place.part is None else f" {'xyz'[place.part]}"
                what = f"{place.key.replace('_', ' ')}{part}"
                unit = "m" if place.role in ("length", "point") else ""
                key = what, round(drawn, 9), round(designed, 9), unit
                legs_by_change.setdefault(key, []).append(place.leg)
    return factors + [
        Change(f"{what} of {legs_text(legs)}", drawn, designed, unit)
        for (what, drawn, designed, unit), legs in legs_by_change.items()
    ]


def mass_changes(task: Task, robot: Manipulator) -> list[Change]:
    """Return the changes of body masses from the task's machine to `robot`, equal legs joined."""
    legs_by_change: dict[tuple[str, float, float], list[int]] = {}
    for i, (leg, other) in enumerate(zip(task.robot.legs, robot.legs, strict=True), start=1):
        for (letter, body), new in zip(leg.bodies.items(), other.bodies.values(), strict=True):
            drawn, designed = body.values[0], new.values[0]
            if abs(designed - drawn) > ROUNDING:
                legs_by_change.setdefault(
                    (leg.names[letter], drawn, round(designed, 9)), []
                ).append(i)
    return [
        Change(f"mass of {name} of {legs_text(legs)}", drawn, designed, "kg")
        for (name, drawn, designed), legs in legs_by_change.items()
    ]


def quantity_changes(design: Design) -> list[Change]:
    """Return the changes of objectives and required quantities from the initial machine on."""
    task = design.task
    return [
        Change(name, start_design(task).quantity(name), design.quantity(name), task.unit(name))
        for name in task.quantity_names
    ]


def stroke_words(design: Design) -> list[str]:
    """Return a line of text for each joint: its travel in the workspace or cube, its limits."""
    low, high = design.joints.min(axis=0), design.joints.max(axis=0)
    lines = []
    for i, (leg, a, b) in enumerate(zip(design.robot.legs, low, high, strict=True), start=1):
        unit, scale = ("mm", 1000.0) if leg.joint.unit == "m" else ("rad", 1.0)
        limits = (
            ", which has no limits"
            if leg.limits is None
            else f" of its limits {scale * leg.limits[0]:.4g} to {scale * leg.limits[1]:.4g} {unit}"
        )
        lines.append(
            f"{leg.joint.noun} of leg {i}: {scale * a:.4g} to {scale * b:.4g} {unit}{limits}"
        )
    return lines
