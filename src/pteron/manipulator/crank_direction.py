"""`crank_direction_text`: the direction of a machine's cranks at angle 0, in words."""

from __future__ import annotations

import numpy as np

from pteron.manipulator.manipulator import Manipulator

LEVEL = "horizontal"
"""The direction, in words, of cranks that point neither up nor down at 0."""


def crank_direction_text(robot: Manipulator) -> str:
    """Return as text the direction of cranks at angle 0: "5.33 deg below horizontal"; '' without.

    The text is empty without gravity, too.
    """
    down = np.array(robot.gravity)
    zeros = [leg.crank_at_zero for leg in robot.legs if leg.crank_at_zero is not None]
    if not zeros or not down.any():
        return ""
    sines = np.array(zeros) @ down / np.linalg.norm(down)
    angles = np.degrees(np.arcsin(np.clip(sines, -1.0, 1.0))).round(2) + 0.0
    if not angles.any():
        return LEVEL
    texts = dict.fromkeys(
        f"{abs(angle):g} deg {'below' if angle > 0.0 else 'above'} horizontal" if angle else LEVEL
        for angle in angles.tolist()
    )
    return ", ".join(texts)
