"""The bodies that parameters describe: their scale, whether they are real, what they are near."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.manipulator import Manipulator, parameter_names, parameters
from pteron.reduction import BaseParameters
from pteron.reduction.sharing import share

_ROUNDING = 1e-12
_SMALL_PLATFORM = 0.25
"""A platform whose points are all at P is taken as this fraction of a link, for its scale."""

_MARGIN = 1e-3
_LEAST_MARGIN = 1e-6
"""How far inside its cone a body is kept, relative to its mass; a uniform rod is 0.067 inside."""


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


@dataclass(frozen=True)
class Target:
    """Minimise |matrix @ z - right| over the scaled free parameters z = free / scale.

    Attributes
    ----------
    scale : array, shape (columns,)
        Units of z: a mass of each body, and its length.
    margins : array, shape (sliders + bodies,)
        How far inside its cone each body is kept.
    """

    kind: Literal["CAD", "nothing"]
    scale: Array
    margins: Array
    matrix: Array
    right: Array


def cad_target(bodies: Bodies, cad: Array) -> Target:
    """Return the distance to CAD parameters (N,), each kind by the body's mass and length."""
    free = bodies.mean(cad)
    heads = np.concatenate([free[: bodies.sliders], free[bodies.sliders :: 4]])
    # An array from a drawing may hold any mass; a scale must be positive.
    typical = float(np.abs(heads).mean()) or 1.0
    scale = bodies.scale(np.maximum(np.abs(heads), 0.01 * typical))
    z = free / scale
    # A CAD model thinner than the margin stays its own nearest model.
    margins = np.clip(0.5 * bodies.least(z), _LEAST_MARGIN, _MARGIN)
    return Target("CAD", scale, margins, np.eye(len(z)), z)


def plain_target(bodies: Bodies, base: BaseParameters, values: Array) -> Target:
    """Return the deviation from uniform rods and a uniform disc, all of about one mass.

    Shapes are relative to the body's own mass, so that no mass is guessed: with c and k of a rod
    (1/2, 1/3) or a disc (0, 1/2), in lengths of the body, the sum over bodies of
    (m - mean)^2 + (hx - c m)^2 + hy^2 + (I - k m)^2. It is strictly convex, so that the answer
    is one, also where the forces leave a parameter entirely free (the platform's inertia of a
    Tripteron); an analytic centre would not exist there.
    """
    masses = [abs(v) for v, name in zip(values, base.names, strict=True) if name.startswith("m_")]
    typical = float(np.mean(masses)) if masses and np.mean(masses) > 0.0 else 1.0
    count = bodies.sliders + len(bodies.lengths)
    scale = bodies.scale(np.full(count, typical))
    rows = np.eye(len(scale))
    heads = [*range(bodies.sliders), *range(bodies.sliders, len(scale), 4)]
    for head, name in zip(heads, bodies.names, strict=True):
        rows[head, heads] -= 1.0 / count
        if name.startswith("p"):
            continue
        # The lower link's frame has its origin on R3 and x away from R2.
        center = {"u": 0.5, "l": -0.5, "e": 0.0}[name[0]]
        rows[head + 1, head] = -center
        rows[head + 3, head] = -0.5 if name == "e" else -1.0 / 3.0
    return Target("nothing", scale, np.full(count, _MARGIN), rows, np.zeros(len(scale)))
