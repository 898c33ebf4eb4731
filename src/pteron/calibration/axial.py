"""Places of guide points about the platform's axis, as printers' firmware counts them.

A radius that all legs share, and an angle for each: of the towers of a Delta.
"""

from __future__ import annotations

from pteron.calibration.variations import Variation
from pteron.manipulator import Manipulator

AXIAL = ("radius", "angles")
"""Groups of variations of guide points about the platform's axis."""


def axial_variations(robot: Manipulator) -> tuple[Variation, ...]:
    return ()
