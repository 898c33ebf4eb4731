"""The numbers of `readings` as HTML for the viewer's panel, with units, colours and words."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from jinja2 import Template

from pteron.manipulator.readings import has_readings, to_readings
from pteron.plots.leg_curves import LEG_COLORS
from pteron.report.quantities import nouns, readable
from pteron.report.typeset import format_fixed, template
from pteron.viewer.readings import Level, Readings, level
from pteron.viewer.state import ViewerState

_COLORS: dict[Level, tuple[str, str]] = {
    "far": ("#d9efe3", "#0b5a34"),
    "near": ("#fbe8c6", "#7a4b00"),
    "close": ("#f8d7d4", "#8c1d14"),
}
"""Colours of background and text, of enough contrast for every eye; words say the same."""

_WORDS: dict[Level, str] = {"far": "far", "near": "near", "close": "very near"}
"""The words for a margin."""

PLACES = 2
"""Decimal places of a force."""


def readout(state: ViewerState, numbers: Readings) -> str:
    """Return the numbers of a state as HTML."""
    legs, joint = state.robot.legs, numbers.clearances.argmin()
    ends = [i for i, leg in enumerate(legs) if not leg.has_constant_measure]
    leg = min(ends, key=lambda i: float(numbers.type_i[i]), default=0)
    forces = (
        "\u2013" if np.isnan(force) else f"{format_fixed(force, PLACES)} {leg.joint.force_unit}"
        for leg, force in zip(legs, numbers.forces, strict=True)
    )
    units = [leg.joint.unit for leg in legs]
    cells = [map(readable, numbers.joints, units)]
    limited = not np.isnan(numbers.shares).all()
    margins = {
        **({f"leg {leg + 1} to a type-I singularity": float(numbers.type_i[leg])} if ends else {}),
        "to a type-II singularity": numbers.type_ii,
        f"leg {joint + 1} to a joint's limit": float(numbers.clearances[joint]),
    }
    headings = ["leg", nouns([leg.joint for leg in legs]), "drive"]
    if has_readings(state.robot):
        headings.insert(2, "reads")
        cells.append(map(readable, to_readings(state.robot, numbers.joints), units))
    return _template().render(
        colors=_COLORS,
        headings=[*headings, "of its most"] if limited else headings,
        legs=list(
            zip(
                LEG_COLORS,
                zip(*cells, forces, strict=True),
                map(_share, numbers.shares),
                strict=False,
            )
        ),
        limited=limited,
        strokes=_strokes(state, numbers),
        condition=numbers.condition,
        margins=[(name, at, level(at), _WORDS[level(at)]) for name, at in margins.items()],
        fault=numbers.fault,
    )


def _strokes(state: ViewerState, numbers: Readings) -> list[float]:
    """Return where each ram stands between its shortest and its longest, %; [] for other legs."""
    rams = [(leg.has_constant_measure, leg.limits) for leg in state.robot.legs]
    shares = [
        100.0 * float((length - limits[0]) / (limits[1] - limits[0]))
        for length, (is_ram, limits) in zip(numbers.joints, rams, strict=True)
        if is_ram and limits
    ]
    return shares if len(shares) == len(rams) else []


@cache
def _template() -> Template:
    """Return the template of the panel's numbers, loaded once."""
    return template("readout.html.j2", "viewer")


def _share(share: float) -> dict[str, Any] | None:
    """Return a drive's share of its limit, with its level and a text."""
    if np.isnan(share):
        return None
    how: Level = "far" if share <= 0.8 else "near" if share <= 1.0 else "close"
    words = {"far": "", "near": " near", "close": " too much"}[how]
    return {"value": share, "level": how, "words": words}
