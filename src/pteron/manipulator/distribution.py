"""`Distribution`: how a machine with more legs than coordinates shares out its drives' forces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pteron.legs import LegKind


@dataclass(frozen=True)
class Distribution:
    """The choice among drive forces that move a redundant machine's platform in the same way.

    Of all such forces F those are taken whose differences from a reference, each divided by its
    drive's strength, have the least sum of squares.

    Parameters
    ----------
    limits : bool
        Whether each force stays within its drive's `max_force`, where that is possible.
    reference : tuple of float, optional
        The drives' reference forces along +q, N or N m, such as a pretension; zero by default.
    strengths : tuple of float, optional
        The drives' strengths, N or N m; by default each drive's `max_force`, or else its rated
        force, or 1 where no drive has one.
    greatest : tuple of float, optional
        The drives' greatest forces, N or N m, if they are not those of the legs' drives.
    """

    limits: bool = False
    reference: tuple[float, ...] | None = None
    strengths: tuple[float, ...] | None = None
    greatest: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("reference", "strengths", "greatest"):
            numbers = getattr(self, name)
            if numbers is not None:
                object.__setattr__(self, name, tuple(float(number) for number in numbers))


def strengths_of(legs: Sequence[LegKind], distribution: Distribution | None) -> tuple[float, ...]:
    """Return the drives' strengths relative to the greatest; 1 for all where none is known."""
    strengths: Sequence[float | None] = _known_strengths(legs)
    if distribution is not None and distribution.strengths is not None:
        strengths = distribution.strengths
    known = [strength for strength in strengths if strength is not None]
    greatest = max(known, default=1.0)
    return tuple((strength or greatest) / greatest for strength in strengths)


def greatest_forces(
    legs: Sequence[LegKind], distribution: Distribution | None
) -> tuple[float, ...] | None:
    """Return the greatest forces that a distribution keeps to, N or N m; None without limits."""
    if distribution is None or not distribution.limits:
        return None
    drives = [leg.drive for leg in legs]
    return distribution.greatest or tuple(
        math.inf if drive is None or drive.max_force is None else drive.max_force
        for drive in drives
    )


def _known_strengths(legs: Sequence[LegKind]) -> list[float | None]:
    """Return each drive's greatest or rated force, N or N m; None where it has neither."""
    drives = [leg.drive for leg in legs]
    return [None if drive is None else drive.max_force or drive.rated_force for drive in drives]


def distribution_faults(
    legs: Sequence[LegKind], distribution: Distribution | None, redundancy: int
) -> list[str]:
    """Return the faults of a distribution, a line each; `redundancy` is n - m."""
    if redundancy == 0:
        if distribution is None:
            return []
        return ["distribution: as many legs as freedoms, whose forces are unique; remove it"]
    faults, shares = [], distribution or Distribution()
    for name in ("reference", "strengths", "greatest"):
        numbers = getattr(shares, name)
        if numbers is None:
            continue
        if len(numbers) != len(legs):
            faults.append(
                f"distribution.{name}: {len(numbers)} values given, {len(legs)} expected, one for "
                "each leg"
            )
        least = -math.inf if name == "reference" else 0.0
        if not all(math.isfinite(number) and number > least for number in numbers):
            above = "" if name == "reference" else " above 0"
            faults.append(
                f"distribution.{name}: {list(numbers)} given, finite numbers{above} expected"
            )
    if shares.strengths is None:
        faults += _unknown_strengths(legs)
    missing = [
        i for i, leg in enumerate(legs, start=1) if leg.drive is None or not leg.drive.max_force
    ]
    if shares.limits and shares.greatest is None and missing:
        faults.append(
            f"distribution.limits: max_force is missing in the drive of legs {_listed(missing)}"
        )
    return faults


def _unknown_strengths(legs: Sequence[LegKind]) -> list[str]:
    """Return, in a list or [], the fault that drives' forces cannot be compared."""
    strengths = _known_strengths(legs)
    missing = [i for i, strength in enumerate(strengths, start=1) if strength is None]
    units = {leg.joint.force_unit for leg in legs}
    if not missing or (len(missing) == len(legs) and len(units) == 1):
        return []
    return [
        f"distribution: the strength of the drives of legs {_listed(missing)} is unknown, so that "
        "forces cannot be shared by strength; give max_force in each drive, or "
        "distribution.strengths"
    ]


def _listed(numbers: Sequence[int]) -> str:
    """Return numbers as text: "1, 2, 3"."""
    return ", ".join(map(str, numbers))
