"""Independent columns of a regressor that is given as numbers: base parameters of any robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.errors import DataError
from pteron.identification.estimators.qr import qr_factor
from pteron.identification.observation import Observations
from pteron.kernels import Array
from pteron.result import Result
from pteron.tolerances import EXACT

TOLERANCE = 1e-8
"""Independent part of a column of length one, relative to the first, that counts as rounding."""


@dataclass(frozen=True, eq=False, repr=False)
class Reduced(Result):
    """The independent columns of a regressor, and the others as combinations of them.

    Attributes
    ----------
    kept, dependent : tuple of int
        The columns.
    names, dependent_names : tuple of str
        Names of these columns.
    shares : array, shape (kept, dependent)
        Dependent column j is the kept ones times shares[:, j]: the value of kept column k is its
        own plus shares[k, j] of each dependent one.
    gap : float
        Independent part of the weakest kept column, over that of the strongest dependent one. At
        less than 1000 or so the rank is a matter of the tolerance.
    """

    kept: tuple[int, ...]
    dependent: tuple[int, ...]
    names: tuple[str, ...]
    dependent_names: tuple[str, ...]
    shares: Array
    gap: float

    @property
    def expressions(self) -> tuple[str, ...]:
        """Expression of each value, such as "I1 + 0.25 m2"."""
        texts = []
        for name, row in zip(self.names, self.shares, strict=True):
            text = name
            for other, share in zip(self.dependent_names, row.tolist(), strict=True):
                if share:
                    size = "" if abs(abs(share) - 1.0) < TOLERANCE else f"{abs(share):.6g} "
                    text += f" {'-' if share < 0.0 else '+'} {size}{other}"
            texts.append(text)
        return tuple(texts)

    def values(self, parameters: Array) -> Array:
        """Return the values (kept,) of the independent columns for parameters of all columns."""
        independent, joined = parameters[list(self.kept)], parameters[list(self.dependent)]
        return np.asarray(independent + self.shares @ joined)


def independent_columns(observations: Observations, *, tolerance: float = TOLERANCE) -> Reduced:
    """Return the independent columns of observations, by a QR factor with pivots.

    The columns, scaled to length one, are taken in the order of what they have of their own; those
    with less than `tolerance`, relative to the first, depend on the others. This is numerical, and
    concerns the states in the observations: a motion that does not show a parameter makes its
    column dependent too. For machines of Pteron's own, `base_parameters` decides exactly.

    Raises
    ------
    DataError
        If no column is left.

    References
    ----------
    M. Gautier, "Numerical calculation of the base inertial parameters of robots", Journal of
    Robotic Systems 8(4), 1991.
    """
    triangle_factor = qr_factor(observations)
    # Columns that vanish but for rounding would be independent once they are scaled.
    acts = triangle_factor.scale > EXACT * triangle_factor.scale.max()
    _, factor, order = scipy.linalg.qr(
        triangle_factor.factor * acts, mode="economic", pivoting=True
    )
    sizes = np.abs(np.diag(factor))
    rank = int((sizes > tolerance * sizes[0]).sum())
    if not rank:
        raise DataError(f"{observations.source}: every column of the regressor is zero")
    shares = scipy.linalg.solve_triangular(factor[:rank, :rank], factor[:rank, rank:])
    shares = np.where(np.abs(shares) > 1e2 * tolerance, shares, 0.0)
    scale = np.where(acts, triangle_factor.scale, 0.0)
    shares = shares * scale[order[rank:]] / scale[order[:rank], None]
    # In the order in which they were given
    first, dependent_order = np.argsort(order[:rank]), np.argsort(order[rank:])
    independent, dependent = order[:rank][first].tolist(), order[rank:][dependent_order].tolist()
    below = sizes[rank] if rank < len(sizes) else 0.0
    return Reduced(
        tuple(independent),
        tuple(dependent),
        tuple(observations.names[k] for k in independent),
        tuple(observations.names[k] for k in dependent),
        shares[np.ix_(first, dependent_order)],
        float(sizes[rank - 1] / below) if below else float("inf"),
    )
