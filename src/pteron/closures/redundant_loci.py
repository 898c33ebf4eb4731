"""The closure of more legs than coordinates, under a platform that does not tilt.

Held joints leave such a platform no pose unless their coordinates agree. The poses are those of as
many legs as there are coordinates, if the other legs meet them: `kinematics.redundant_assembly`.
"""

from __future__ import annotations

from collections.abc import Sequence

from pteron.bodies.motion import Expression
from pteron.closures.closure import Closure
from pteron.errors import ModelError
from pteron.legs.leg import LegEquations
from pteron.platforms.motion import PlatformEquations


class RedundantLoci(Closure):
    """More legs than coordinates, under a platform with one angle or none."""

    closed_form = False

    @classmethod
    def fits(cls, legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]) -> bool:
        """Return whether there are more legs than coordinates, and the platform does not tilt."""
        return len(legs) > len(platform.coordinates) and not platform.tilts

    @property
    def modes(self) -> int:
        """The greatest number of poses of as many legs as there are coordinates."""
        return 2 * len(self.platform.coordinates) if self.platform.angles() else 2

    def poses(self, joints: Expression) -> Expression:
        """Raise ModelError: these machines have no closed-form direct kinematics."""
        raise ModelError(
            "direct_kinematics: more legs than coordinates have no closed form of it; "
            '"direct_step" follows the pose from one that is near'
        )
