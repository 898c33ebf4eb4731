"""The thresholds of verdicts, each with its reason; docs/verdicts.md has them in a table.

They are absolute: none depends on the best that a machine itself can do.
"""

from __future__ import annotations

# `pteron check`: how well drives hold the platform

ROUNDING_OF_FILES = 1e-4
"""Rounding of coordinates, m, that a verdict has to survive: a file in tenths of a millimetre."""

SMALL_MACHINES = 1e-3
"""Share of the length L of unit rows that counts as rounding where it is less: a machine of 10 mm
is not written to tenths of a millimetre. At a thousandth a similar figure is within what a drawing
of three digits tells."""

INACCURATE = 10.0
"""Times the rounding of files up to which the distance to singular coordinates is a warning: 1 mm
of parts, joints with play and a base that bends add up to it in machines of 1 m."""

LEAST_SINGULAR_VALUE = 0.02
"""Least singular value of the unit rows at home below which drives hold the platform badly: leg
forces are 50 times a load in the worst direction, and a leg's error of 0.1 mm moves the platform by
5 mm. The machines of the catalog have 0.34 to 1.3."""

HOLDING_FORCE = 10.0
"""Force along one leg that holds the weight at home, over the weight, above which it is a warning:
legs that lean 84 degrees off the load. The machines of the catalog have up to 0.7."""

HOLDING_FORCE_NEAR = 100.0
"""The same, of the poses about home: within them a singularity is passed or nearly so."""

NEARBY = (0.05, 0.1)
"""Half widths of the poses about home that are looked at: share of the longest leg, and rad. It is
about a third of the travel of an ordinary hexapod."""

# `pteron check`: legs that look swapped, crossed or unlike the others

SAME_PLACE = 0.005
"""Distance of points that count as images of one another, as a share of the greatest distance from
the axis: rounding to 0.1 mm in a machine of 20 mm, and 2 mm in one of 0.4 m."""

CROSSING = 0.02
"""Distance between the centre lines of two links, away from their ends, over the length of the
shorter one, up to which they cross: links are thicker than a fiftieth of their length."""

ENDS = 0.1
"""Share of a link at each of its ends that does not count as crossing: there legs meet at joints
that they share or nearly so."""

# `pteron check`: masses

STOUT_LINK = 0.15
"""Diameter over length of a solid steel rod with a link's mass and length from which it is doubted,
if it is heavier than the platform too. Links of the catalog's machines have up to 0.14, or carry a
platform that is heavier."""


def rounding_tolerance(length: float) -> float:
    """Return the rounding error of coordinates, m, in a machine of this characteristic length."""
    return min(ROUNDING_OF_FILES, SMALL_MACHINES * length)
