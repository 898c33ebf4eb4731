"""Certificates of the number of base parameters: the method and the evidence that it rests on.

Base parameters are the combinations of inertial parameters that motion tells apart: as many as the
rank of the regressor.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass
from typing import Any

from pteron.result import Result

ROUNDING = 1e-13
"""Largest singular value, relative to the greatest, that counts as rounding, which is 1e-16 to
1e-14. A rank that drops a larger one is called unclear."""


@dataclass(frozen=True)
class NumericalRank:
    """A rank in floating point, and the singular values between which it was decided."""

    rank: int
    smallest_kept: float
    """Relative to the largest."""
    largest_dropped: float

    @property
    def clear(self) -> bool:
        """Whether every singular value that was dropped is rounding."""
        return self.largest_dropped <= ROUNDING

    def __str__(self) -> str:
        smallest, largest = f"{self.smallest_kept:.1e}", f"{self.largest_dropped:.1e}"
        return f"{self.rank} (smallest singular value kept {smallest}, largest dropped {largest})"


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(Result, ABC):
    """Base class of the certificates: method, number of base parameters, number of columns.

    Attributes
    ----------
    method : str
        "exact", "svd" or "qr".
    rank : int
        The number of base parameters.
    columns : int
        The number of columns they were found among.
    """

    method: str
    rank: int
    columns: int

    @abstractmethod
    def summary(self) -> str:
        """Return the certificate in a few sentences."""

    def as_dict(self) -> dict[str, Any]:
        """Return the certificate as plain data."""
        return asdict(self)


_UNCLEAR = (
    f"WHAT WAS DROPPED IS MORE THAN ROUNDING ({ROUNDING:.0e}): it may be a weak effect, of which "
    "method exact can tell. "
)


@dataclass(frozen=True, eq=False, repr=False)
class NumericalCertificate(Certificate):
    """The rank as floating-point arithmetic sees it.

    Attributes
    ----------
    states : int
        Random states stacked.
    tolerance : float
        Relative to the largest singular value (svd) or column (qr).
    smallest_kept, largest_dropped : float
        The two values, relative to the largest, between which the rank was decided. A column that
        was dropped for its length counts by that, relative to the longest.
    residual : float
        Largest relative misfit of the dependent columns by the kept ones.
    """

    states: int
    tolerance: float
    smallest_kept: float
    largest_dropped: float
    residual: float

    @property
    def gap(self) -> float:
        """Ratio of the smallest singular value kept to the largest one dropped."""
        return self.smallest_kept / max(self.largest_dropped, 1e-300)

    def summary(self) -> str:
        """Return the certificate in a few sentences."""
        return (
            f"Numerical rank {self.rank} of {self.columns} columns ({self.method}, {self.states} "
            "random states, rows and columns scaled). Smallest value kept "
            f"{self.smallest_kept:.1e}, largest dropped {self.largest_dropped:.1e}, "
            f"relative to the largest: a gap of {self.gap:.0e}. "
            f"Residual of the grouping {self.residual:.0e}. "
            + _UNCLEAR * (self.largest_dropped > ROUNDING)
            + "It confirms a rank, it proves none."
        )


@dataclass(frozen=True, eq=False, repr=False)
class ExactCertificate(Certificate):
    """The rank in exact arithmetic.

    Attributes
    ----------
    primes : tuple of int
        The primes modulo which the regressor was eliminated, for the machine's own guides.
    states : int
        Random states stacked for each prime. A minor of size `rank` is not zero: the rank is at
        least that.
    null_vectors : int
        Relations found: columns - rank.
    rational_configurations : int
        Random configurations with rational links at which every null vector, in fractions,
        annihilates the regressor exactly; the guide points follow from them. Zero where the
        geometry holds roots, or where some relations are due to special guide points.
    modular_configurations : int
        Further random configurations, modulo a prime that was not used to find them, at which every
        null vector does so.
    degree : int
        Bound on the degree of a null vector's product with the regressor.
    false_acceptance : float
        Bound on the probability that a vector which does not annihilate the regressor passes them
        all (Schwartz, Zippel).
    transfers : int
        How many of the null vectors are mass transfers, known in symbols of the geometry.
    unexplained : tuple of str
        The columns whose relations are due to this machine's special geometry instead.
    coefficients : str
        "rational", "algebraic" or "floating point": what the groupings are known as.
    recognised, approximated, lost, nearly : tuple of str
        How the machine's floats were made exact; see `ExactGeometry`.
    numerical : NumericalRank or None
        Where the exact numbers are not quite the machine's floats, or a relation is nearly met, and
        states in reach could be found: the rank that the singular values of the regressor show.
    """

    primes: tuple[int, ...]
    states: int
    null_vectors: int
    rational_configurations: int
    modular_configurations: int
    degree: int
    false_acceptance: float
    transfers: int
    unexplained: tuple[str, ...]
    coefficients: str
    recognised: tuple[str, ...]
    approximated: tuple[str, ...]
    lost: tuple[str, ...]
    nearly: tuple[str, ...]
    numerical: NumericalRank | None

    @property
    def numerical_rank(self) -> int | None:
        """The rank in floating point, where it was asked for."""
        return None if self.numerical is None else self.numerical.rank

    def summary(self) -> str:
        """Return the certificate in a few sentences."""
        checked = (
            f"{self.rational_configurations} rational configurations in fractions and at "
            if self.rational_configurations
            else ""
        )
        lines = [
            f"Exact rank {self.rank} of {self.columns} columns of the regressor, proved:",
            f"at least {self.rank}: a square submatrix of that size, at {self.states} states, has "
            f"a nonzero determinant, computed exactly modulo {len(self.primes)} primes of "
            f"{max(self.primes).bit_length()} bits;",
            f"at most {self.rank}: the regressor times {self.null_vectors} independent vectors is "
            f"zero, exactly, at {checked}{self.modular_configurations} configurations modulo "
            "another prime; a wrong vector would pass with a probability below "
            f"{self.false_acceptance:.0e}.",
            f"{self.transfers} of the vectors are exchanges of mass between bodies that share a "
            f"point. Coefficients in the sums: {self.coefficients} numbers; units: powers of m.",
        ]
        if self.unexplained:
            lines.append(
                f"The grouping of {', '.join(self.unexplained)} is explained by this machine's "
                "special geometry, not by an exchange of mass."
            )
        lines += _sentence_of_list("Taken as exact", self.recognised)
        lines += _sentence_of_list("Approximated", self.approximated)
        if self.numerical is not None:
            comparison = f"the rank of the machine is {self.numerical}"
            if self.numerical.rank != self.rank:
                lines.append(
                    "The exact rank is that of the machine in these exact numbers, but IN FLOATING "
                    f"POINT {comparison}: a special relation may be lost."
                )
            elif not self.numerical.clear:
                lines.append(
                    f"In floating point {comparison}: WHAT WAS DROPPED IS MORE THAN ROUNDING "
                    f"({ROUNDING:.0e}), so that floating point does not confirm the rank."
                )
            else:
                lines.append(f"In floating point {comparison}: the same.")
        lines += _sentence_of_list("Not kept exactly", self.lost)
        lines += _sentence_of_list("Nearly special, and perhaps meant to be", self.nearly)
        return "\n".join(lines)


def _sentence_of_list(head: str, items: tuple[str, ...]) -> list[str]:
    """Return a line of a heading and its items; nothing without items."""
    return [f"{head}: {'; '.join(items)}."] if items else []
