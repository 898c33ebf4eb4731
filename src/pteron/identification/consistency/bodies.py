"""Which parameters belong to which body, at which scale, and whether a body can be real."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.manipulator import Manipulator, parameter_names, parameters
from pteron.reduction import BaseParameters
from pteron.reduction.sharing import share

__all__ = ["Bodies", "body_lengths", "bodies_of", "parameters_of", "real_bodies"]

_ROUNDING = 1e-12
_SMALL_PLATFORM = 0.25
"""A platform whose points are all at P is taken as this fraction of a link, for its scale."""


@dataclass(frozen=True)
class Bodies:
    """The free parameters, those that legs share counted once, and the bodies they describe.

    Attributes
    ----------
    columns : tuple of str
        Names of the free parameters: sliders first, then four for each body.
    sharing : array, shape (N, columns)
        parameters = sharing @ free parameters.
    lengths : array, shape (bodies,)
        A length of each body, m, that makes its parameters comparable: (m, h / s, I / s^2).
    """

    columns: tuple[str, ...]
    sharing: Array
    lengths: Array

    @cached_property
    def sliders(self) -> int:
        """How many of the free parameters are sliders' masses."""
        return sum(name.startswith("m_p") for name in self.columns)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the sliders, then of the bodies: ``p1`` ..., ``u1`` ..., ``l1`` ..., ``e``."""
        heads = (*self.columns[: self.sliders], *self.columns[self.sliders :: 4])
        return tuple(name.removeprefix("m_") for name in heads)

    def scale(self, masses: Array) -> Array:
        """Return the unit of each free parameter, from the bodies' masses (kg), sliders first."""
        links = masses[self.sliders :, None] * self.lengths[:, None] ** np.array([0, 1, 1, 2])
        return np.concatenate([masses[: self.sliders], links.ravel()])

    def mean(self, values: Array) -> Array:
        """Return the free parameters of given parameters (N,): their mean where legs share."""
        return np.asarray((self.sharing / self.sharing.sum(axis=0)).T @ values)

    def least(self, scaled: Array) -> Array:
        """Return how far inside each body is, sliders first, from scaled free parameters.

        The least eigenvalue of [[m, |h|], [|h|, I]]: no real body has a negative one.
        """
        m, hx, hy, inertia = scaled[self.sliders :].reshape(-1, 4).T
        inside = 0.5 * (m + inertia - np.sqrt(4 * hx * hx + 4 * hy * hy + (m - inertia) ** 2))
        return np.concatenate([scaled[: self.sliders], inside])


def body_lengths(robot: Manipulator) -> Array:
    """Return a length (2 n + 1,) of each upper link, lower link and the platform, m."""
    upper = [leg.upper_length for leg in robot.legs]
    lower = [leg.lower_length for leg in robot.legs]
    links = float(np.mean(upper + lower))
    radius = max(float(np.hypot(*leg.platform_point[:2])) for leg in robot.legs)
    platform = radius if radius > 1e-3 * links else _SMALL_PLATFORM * links
    return np.array([*upper, *lower, platform])


def bodies_of(base: BaseParameters) -> Bodies:
    """Return the bodies whose parameters `base` is made of."""
    robot = base.robot
    n = len(robot.legs)
    # The columns' names say which legs share: m_p(2,4) is one slider mass of legs 2 and 4.
    suffixes = [name.removeprefix("m_p") for name in base.columns if name.startswith("m_p")]
    groups = [
        [int(leg) for leg in suffix.strip("()").split(",")] if suffix else list(range(1, n + 1))
        for suffix in suffixes
    ]
    columns, sharing = share(robot, groups)
    assert columns == base.columns
    lengths = np.concatenate([np.zeros(n), np.repeat(body_lengths(robot), 4)])
    mean = (sharing / sharing.sum(axis=0)).T @ lengths
    return Bodies(columns, sharing, mean[len(groups) :: 4])


def parameters_of(robot: Manipulator, values: ArrayLike, what: str) -> Array:
    """Return parameters (N,) as a checked array."""
    vector = np.asarray(values, dtype=float)
    count = len(parameter_names(robot))
    if vector.shape != (count,):
        raise ModelError(f"{what}: shape {vector.shape} given, ({count},) expected")
    if not np.isfinite(vector).all():
        bad = parameter_names(robot)[int(np.flatnonzero(~np.isfinite(vector))[0])]
        raise ModelError(f"{what}: {bad} is {vector[~np.isfinite(vector)][0]}, not a number")
    return vector


def real_bodies(robot: Manipulator, values: ArrayLike | None = None) -> tuple[str, ...]:
    """Return what keeps parameters from belonging to real bodies; nothing where they do.

    A real body has m > 0, and in planar motion I > 0 and I m >= (m gamma)^2, since the moment of
    inertia about its centre of mass, I - (m gamma)^2 / m, is not negative.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    values : array, shape (N,), optional
        Parameters in the order of `pteron.parameter_names`; the machine's own, which are always
        those of real bodies, where they are left out.

    Returns
    -------
    tuple of str
        One line a body.

    Raises
    ------
    ModelError
        If their number is wrong or one is not finite.

    Examples
    --------
    >>> import pteron
    >>> from pteron.identification.consistency import real_bodies
    >>> robot = pteron.load("tripteron")
    >>> values = pteron.parameters(robot)
    >>> values[0] = -0.1
    >>> real_bodies(robot, values)
    ('p1: mass -0.1 kg is not positive',)
    """
    vector = parameters(robot) if values is None else parameters_of(robot, values, "parameters")
    n = len(robot.legs)
    names = [name.removeprefix("m_") for name in parameter_names(robot)[n::4]]
    lines = [
        f"p{i}: mass {mass:.4g} kg is not positive"
        for i, mass in enumerate(vector[:n], 1)
        if mass <= 0.0
    ]
    for name, (m, hx, hy, inertia) in zip(names, vector[n:].reshape(-1, 4), strict=True):
        if m <= 0.0:
            lines.append(f"{name}: mass {m:.4g} kg is not positive")
            continue
        least = (hx * hx + hy * hy) / m
        if inertia <= 0.0 or inertia < least * (1.0 - _ROUNDING):
            lines.append(
                f"{name}: inertia {inertia:.4g} kg m^2 is {least - inertia:.2g} below "
                f"{least:.4g}, the least with its mass and centre of mass"
            )
    return tuple(lines)
