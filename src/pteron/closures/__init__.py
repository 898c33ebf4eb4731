"""Solvers of the closure equations of a machine; `closures.closure` has their base class."""

from collections.abc import Sequence

from pteron.closures.closure import Closure
from pteron.closures.constant_rows import ConstantRows
from pteron.closures.redundant_loci import RedundantLoci
from pteron.closures.three_loci import ThreeLoci
from pteron.closures.tilting_loci import TiltingLoci
from pteron.closures.turning_loci import TurningLoci
from pteron.closures.two_loci import TwoLoci
from pteron.legs.leg import LegEquations
from pteron.platforms import PlatformEquations
from pteron.public import publish as _publish

KINDS: tuple[type[Closure], ...] = (
    *(RedundantLoci, ConstantRows, ThreeLoci, TwoLoci, TurningLoci, TiltingLoci),
)
"""The kinds of closures; the first that fits a machine's legs and platform serves it."""


def kind_for(
    legs: Sequence[type[LegEquations]], platform: type[PlatformEquations]
) -> type[Closure] | None:
    """Return the first closure class that fits these legs and platform; None if none fits."""
    return next((kind for kind in KINDS if kind.fits(legs, platform)), None)


__all__ = ["KINDS", "Closure", "kind_for"]

_publish(__name__)
