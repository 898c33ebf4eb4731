"""The machine of the catalog that a file was made from, and what is still as in it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from pteron.bodies.inertia import carried_values, inertia_count
from pteron.manipulator.crank_direction import crank_direction_text
from pteron.manipulator.files import catalog, contents, load
from pteron.manipulator.joint_pairs import PLATES, joint_circle
from pteron.manipulator.manipulator import Manipulator
from pteron.tolerances import SAME

_MASSES = ("upper", "lower", "slider", "platform_mass")
"""Values compared with a template that the file does not name."""

_WEIGHTY = (*_MASSES, "platform_inertia")
"""Values on which forces and torques depend."""


@dataclass(frozen=True)
class TemplateValue:
    """A value, or an equal value of all legs, of a machine."""

    key: str
    """Its name in `[template] confirmed`."""
    numbers: tuple[Any, ...]
    text: str


def template_sentence(robot: Manipulator) -> str:
    """Return a sentence on the values that a machine still has from its template; '' if none.

    A file names its template in `[template]`. Of other files masses are compared with each machine
    of the catalog with the same kinds of legs: all links of the first leg must have its masses, or
    masses per length. Machines of the catalog are exempt.
    """
    if robot.name in catalog():
        return ""
    if robot.template is not None:
        kept = template_values(robot)
        advice = "change them, or list the keys in [template] confirmed"
        return _sentence(robot.template.kind, kept, advice) if kept else ""
    motion = f'motion = "{robot.platform.motion}"'.encode()
    templates = [load(name) for name in catalog() if motion in contents(name)[0]]
    if any(template.legs == robot.legs for template in templates):
        return ""
    for template in templates:
        kept = [value for value in _common(robot, template) if value.key in _MASSES]
        links = [value for value in kept if value.key in ("upper", "lower")]
        # One link alone may have the same round number by chance.
        if links and len(links) >= len(robot.legs[0].extents):
            return _sentence(template.name, kept, "are they this machine's?")
    return ""


def template_values(robot: Manipulator) -> list[TemplateValue]:
    """Return the values that a machine still has from the template of its file, unconfirmed."""
    template = robot.template
    if template is None or template.kind not in catalog():
        return []
    common = _common(robot, load(template.kind))
    return [value for value in common if value.key not in template.confirmed]


def _sentence(kind: str, kept: Sequence[TemplateValue], advice: str) -> str:
    """Return the sentence that lists values of a template."""
    weighty = any(value.key in _WEIGHTY for value in kept)
    reason = "forces and torques depend on these masses and inertias; " if weighty else ""
    return f"Still as in {kind}: {', '.join(value.text for value in kept)}; {reason}{advice}"


def _common(robot: Manipulator, template: Manipulator) -> list[TemplateValue]:
    """Return the values that two machines of the same kinds of legs have in common."""
    if [leg.type for leg in robot.legs] != [leg.type for leg in template.legs]:
        return []
    former = {value.key: value for value in _values(template)}
    return [
        value
        for value in _values(robot)
        if value.key in former and _same(value.numbers, former[value.key].numbers)
    ] + [*_grown_inertia(robot, template), *_sections(robot, template)]


def _same(values: Sequence[Any], others: Sequence[Any]) -> bool:
    """Return whether two values are equal but for the rounding of numbers."""
    return len(values) == len(others) and all(
        math.isclose(a, b, rel_tol=SAME, abs_tol=SAME * SAME) if isinstance(a, float) else a == b
        for a, b in zip(values, others, strict=True)
    )


def _values(robot: Manipulator) -> Iterator[TemplateValue]:
    """Yield the values of a machine that an owner measures or chooses."""
    first: Any = robot.legs[0]
    for plate in PLATES:
        circle = joint_circle(robot, plate)
        radius, angle = circle.radius, circle.pair_angle
        yield TemplateValue(f"{plate}_radius", (radius,), f"{plate}_radius {radius:.4g} m")
        if angle is not None:
            text = f"{plate}_pair {math.degrees(angle):.4g} deg"
            yield TemplateValue(f"{plate}_pair", (angle,), text)
    lengths = [(q.name, "m") for q in first.quantities if q.role == "length"]
    arcs = [(name, "rad") for name, key in first.keys.items() if key.role == "angle"]
    for name, unit in (*lengths, *arcs):
        numbers = tuple(getattr(leg, name, None) for leg in robot.legs)
        if None not in numbers:
            yield TemplateValue(name, numbers, f"{name} {numbers[0]:.4g} {unit}")
    if zero := crank_direction_text(robot):
        directions = tuple(part for leg in robot.legs for part in leg.crank_at_zero or ())
        yield TemplateValue("crank_zero", directions, f"crank_zero {zero}")
    if all(leg.limits is not None for leg in robot.legs):
        limits = [leg.limits or (0.0, 0.0) for leg in robot.legs]
        low, high = limits[0]
        text = f"limits {low:.4g} to {high:.4g} {first.joint.unit}"
        yield TemplateValue("limits", tuple(end for pair in limits for end in pair), text)
    cones = [getattr(leg, name, None) for leg in robot.legs for name in _cone_names(leg)]
    if angles := tuple(cone.angle for cone in cones if cone is not None):
        yield TemplateValue("cones", angles, f"cones {angles[0]:.4g} rad")
    if pairs := robot.platform.angle_limits:
        numbers = tuple(end for pair in pairs.values() for end in pair)
        yield TemplateValue("angles", numbers, f"limits of {', '.join(pairs)} (angles)")
    yield from _platform_values(robot)
    for name, key in first.every_key().items():
        if key.body:
            masses = tuple(leg.bodies[key.body].values[0] for leg in robot.legs)
            yield TemplateValue(name, masses, f"{name} {masses[0]:.4g} kg")
    drives = tuple(leg.drive for leg in robot.legs)
    if any(drive is not None for drive in drives):
        yield TemplateValue("drive", drives, "drive")


def _platform_values(robot: Manipulator) -> Iterator[TemplateValue]:
    """Yield mass and inertia of the platform, without a rider that the file names."""
    mass, *others = _own_inertia(robot)
    without = " without the rider" if robot.template and robot.template.rider else ""
    total = mass + sum(bar.mass for bar in robot.platform.bars)
    yield TemplateValue("platform_mass", (total,), f"platform_mass {total:.4g} kg{without}")
    if mass > 0.0:
        per_mass = tuple(number / mass for number in others)
        yield TemplateValue("platform_inertia", per_mass, f"platform_inertia{without} (per kg)")


def _grown_inertia(robot: Manipulator, template: Manipulator) -> Iterator[TemplateValue]:
    """Yield the platform's inertia if it is the template's, grown with the platform's radius."""
    circles = [joint_circle(machine, "platform").radius for machine in (robot, template)]
    (mass, *others), (former_mass, *formers) = map(_own_inertia, (robot, template))
    count = inertia_count(robot.platform.inertia.kinds)
    if min(*circles, mass) <= 0.0 or math.isclose(*circles, rel_tol=SAME):
        return
    growth = circles[0] / circles[1]
    powers = [1] * (len(others) - count) + [2] * count
    grown = [mass / former_mass * v * growth**k for v, k in zip(formers, powers, strict=True)]
    if _same([*others], grown):
        yield TemplateValue("platform_inertia", (), "platform_inertia (per kg and radius squared)")


def _own_inertia(robot: Manipulator) -> list[float]:
    """Return the platform's inertial parameters less those of a rider that the file names."""
    inertia = robot.platform.inertia
    if not (robot.template and robot.template.rider):
        return list(inertia.values)
    mass, *center = robot.template.rider
    count = inertia_count(inertia.kinds)
    load = carried_values(type(inertia), mass, center, [0.0] * count)
    # What is left of the rounding of a file is nothing.
    pairs = zip(inertia.values, load, strict=True)
    return [0.0 if abs(a - b) <= SAME * abs(b) else a - b for a, b in pairs]


def _cone_names(leg: Any) -> list[str]:
    """Return the names of a leg's fields that hold cones."""
    return [name for name, key in leg.keys.items() if key.role == "cone"]


def _sections(robot: Manipulator, template: Manipulator) -> Iterator[TemplateValue]:
    """Yield the links of the first leg that have the template's mass per length, not its mass."""
    leg: Any = robot.legs[0]
    template_leg: Any = template.legs[0]
    for letter, (key, low, high, _) in leg.extents.items():
        if letter not in template_leg.extents:
            continue
        _, least, most, _ = template_leg.extents[letter]
        mass, former = leg.bodies[letter].mass, template_leg.bodies[letter].mass
        is_same = math.isclose(mass, former, rel_tol=SAME)
        if not is_same and math.isclose(mass / (high - low), former / (most - least), rel_tol=SAME):
            yield TemplateValue(key, (mass,), f"{key} {mass:.4g} kg (its mass per length)")
