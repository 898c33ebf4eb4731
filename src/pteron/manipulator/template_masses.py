"""Masses of a machine that are unchanged from its template in the catalog."""

from __future__ import annotations

from collections.abc import Iterator
from math import isclose
from typing import Any

from pteron.manipulator.files import catalog, contents, load
from pteron.manipulator.manipulator import Manipulator
from pteron.tolerances import SAME


def template_masses(robot: Manipulator) -> str:
    """Return a warning that masses equal those of a catalog machine; '' if none do.

    All links of the first leg, and perhaps the platform, must have the masses or the mass per
    length of a machine of the catalog. Machines with a name of the catalog are exempt; `pteron new`
    gives other names.
    """
    if robot.name in catalog():
        return ""
    kinds = [leg.type for leg in robot.legs]
    motion = f'motion = "{robot.platform.motion}"'.encode()
    templates = [load(name) for name in catalog() if motion in contents(name)[0]]
    if any(template.legs == robot.legs for template in templates):
        return ""
    for template in templates:
        name, links = template.name, list(_links(robot, template))
        if [leg.type for leg in template.legs] != kinds or not links:
            continue
        if len(links) < len(robot.legs[0].extents):
            continue  # one link alone may have the same round number by chance
        mass = robot.platform.inertia.mass
        if isclose(mass, template.platform.inertia.mass, rel_tol=SAME):
            links.append(f"the platform's {mass:.4g} kg")
        return f"masses are still those of {name}: {', '.join(links)}: are they this machine's?"
    return ""


def _links(robot: Manipulator, template: Manipulator) -> Iterator[str]:
    """Yield text for each link of the first leg whose mass or section equals the template's."""
    leg: Any = robot.legs[0]
    template_leg: Any = template.legs[0]
    for letter, (key, low, high, _) in leg.extents.items():
        if letter not in template_leg.extents:
            continue
        _, least, most, _ = template_leg.extents[letter]
        mass, former = leg.bodies[letter].mass, template_leg.bodies[letter].mass
        if isclose(mass, former, rel_tol=SAME):
            yield f"{key} {mass:.4g} kg"
        elif isclose(mass / (high - low), former / (most - least), rel_tol=SAME):
            yield f"{key} {mass:.4g} kg (its section)"
