"""Condition numbers of a motion's base regressor: how well its forces show the parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.identification.excitation.fourier import FourierMotion
from pteron.identification.observation import triangle
from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.reduction import BaseParameters
from pteron.result import Result

_ROWS = 100
"""Rows that are decomposed at a time: so few that the linear algebra library stays in one thread;
several, on a machine that is busy, can take a hundred times as long."""


@dataclass(frozen=True, eq=False, repr=False)
class Conditioning(Result):
    """Condition numbers: how well a motion's forces tell the base parameters apart.

    Attributes
    ----------
    scaled : float
        2-norm condition number of the stacked base regressor with columns of length 1 (see
        `scaled_condition`): without units.
    unscaled : float
        Condition number of the regressor as it is, in SI units.
    nominal : float
        The same with every column times the machine's own value of its base parameter, so that all
        columns are forces; infinite, and no measure of anything, if a value is 0.
    logdet : float
        log det of the information matrix of one sample on average, W^T W / T; the larger the
        smaller the volume of the confidence ellipsoid. Other units only add a constant.
    """

    scaled: float
    unscaled: float
    nominal: float
    logdet: float


def scaled_condition(matrix: Array) -> float:
    """Return the 2-norm condition number of a matrix with its columns divided by their lengths.

    The entries of a regressor have as many units as there are parameters; to compare them, each
    column (R,) is divided by its Euclidean norm. Of all scalings of the columns this one has a
    condition number within sqrt(p) of the least.

    Parameters
    ----------
    matrix : array, shape (R, p)
        At least as many rows as columns.

    Returns
    -------
    float
        1 at best; infinite if a column is zero, or the columns are dependent.

    References
    ----------
    A. van der Sluis, Condition numbers and equilibration of matrices, Numer. Math. 14, 1969.

    Examples
    --------
    >>> import numpy as np
    >>> from pteron.identification.excitation import scaled_condition
    >>> round(scaled_condition(np.array([[1.0, 0.0], [0.0, 1000.0]])), 12)
    1.0
    """
    lengths = np.linalg.norm(matrix, axis=0)
    if not lengths.all():
        return float("inf")
    return _condition(matrix / lengths)


def conditioning(
    motion: FourierMotion, base: BaseParameters, samples: int | None = None
) -> Conditioning:
    """Return the condition numbers of a motion.

    Parameters
    ----------
    motion : FourierMotion
        The motion.
    base : BaseParameters
        The base parameters of its machine.
    samples : int, optional
        Instants, evenly over one period; by default 40 in a period of the highest harmonic.

    Raises
    ------
    ModelError
        If `base` belongs to a machine of another layout.
    """
    return condition_numbers(information_root(motion, base, samples), base.values(motion.robot))


def information_root(
    motion: FourierMotion, base: BaseParameters, samples: int | None = None
) -> Array:
    """Return the triangular root R (p, p) of R^T R = W^T W / T, W being the stacked regressor.

    Scaling columns commutes with it: R has the condition numbers of W, and its columns are as long
    as those of W are on average. NaN where the machine does not reach.
    """
    count = samples or 40 * motion.harmonics
    matrix = stacked_regressor(motion, base, motion.uniform_times(count))
    if not np.isfinite(matrix).all():
        return np.full((base.rank, base.rank), np.nan)
    pieces = (matrix[start : start + _ROWS] for start in range(0, len(matrix), _ROWS))
    return np.asarray(triangle(pieces, base.rank) / np.sqrt(count))


def condition_numbers(root: Array, base_values: Array) -> Conditioning:
    """Return the condition numbers of `information_root`, for base parameters of these values."""
    if not np.isfinite(root).all():
        return Conditioning(np.inf, np.inf, np.inf, -np.inf)
    lengths = np.linalg.norm(root, axis=0)
    scaled = scaled_condition(root)
    logdet = -float("inf")
    if np.isfinite(scaled):
        # Equilibrated first: the columns' sizes differ by more than the digits would bear.
        singular = np.linalg.svd(root / lengths, compute_uv=False)
        logdet = float(2.0 * (np.log(singular).sum() + np.log(lengths).sum()))
    return Conditioning(scaled, _condition(root), _condition(root * base_values), logdet)


def condition_with_penalty(root: Array, short: Array) -> float:
    """Return the condition number of columns scaled to length 1, with a penalty for short ones.

    `root` is the triangular factor of the regressor. Each column of length l multiplies the number
    by sqrt(1 + (s / l)^2), s being its element of `short` (p,): a motion that hardly moves a body
    makes its column short, which the scaled condition number alone does not show.
    """
    lengths = np.linalg.norm(root, axis=0)
    if not np.isfinite(lengths).all() or not lengths.all():
        return float("inf")
    return scaled_condition(root) * float(np.hypot(1.0, short / lengths).prod())


def stacked_regressor(motion: FourierMotion, base: BaseParameters, times: Array) -> Array:
    """Return the base regressors at times (T,), stacked: (T n, rank)."""
    state = motion.states(times)
    path = state.pose, state.velocity, state.acceleration
    regressors: Array = evaluate_unchecked(motion.robot, "base_regressor", *path, base=base)
    return regressors.reshape(-1, base.rank)


def _condition(matrix: Array) -> float:
    """Return the condition number of a matrix; infinity where its rank is deficient."""
    singular = np.linalg.svd(matrix, compute_uv=False)
    if len(matrix) < matrix.shape[1] or singular[-1] <= np.finfo(float).eps * singular[0]:
        return float("inf")
    return float(singular[0] / singular[-1])
