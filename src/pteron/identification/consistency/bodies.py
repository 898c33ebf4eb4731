"""Rigid bodies of inertial parameters, scaled for cone programs; `real_bodies` checks them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from pteron.bodies.inertia import PlanarInertia, SpatialInertia
from pteron.bodies.parameters import PLATFORM, Parameter, body_places
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.manipulator import Manipulator, parameter_data, parameter_names, parameters
from pteron.reduction import BaseParameters
from pteron.reduction.sharing import share

_SMALL_PLATFORM = 0.25
"""Size of a platform whose points are all at P, as a share of a link's, for its scale."""

_MARGIN = 1e-3
"""Largest margin of a body inside its cone, relative to its mass; a uniform rod has 0.067."""

_LEAST_MARGIN = 1e-6
"""Least margin of a body, over its mass: for a CAD body that is next to none."""


@dataclass(frozen=True)
class Bodies:
    """The free parameters, those that legs share counted once, and the bodies they describe.

    All N parameters are `sharing` @ free parameters; `extents` (bodies, 2) are the least and
    greatest x of each body, m: its length makes its parameters comparable.
    """

    columns: tuple[Parameter, ...]
    sharing: Array
    extents: Array

    @cached_property
    def places(self) -> dict[str, dict[str, int]]:
        """Columns of the parameters of each body, by its name and their kind."""
        return body_places(self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies: ``p1`` ..., ``u1`` ..., ``l1`` ..., ``e``."""
        return tuple(self.places)

    @property
    def masses(self) -> list[int]:
        """The column of each body's mass."""
        return [place["m"] for place in self.places.values()]

    @cached_property
    def moments(self) -> tuple[Array, ...]:
        """The pseudo-inertia of each body as a linear function of the columns: (d, d, k).

        It is positive semidefinite where the body is real; see `_moments`.
        """
        unit = np.eye(len(self.columns))
        return tuple(
            np.array(_moments({kind: unit[column] for kind, column in place.items()}))
            for place in self.places.values()
        )

    def scale(self, masses: Array) -> Array:
        """Return the scale (k,) of each free parameter, from the bodies' masses (bodies,), kg."""
        lengths = self.extents[:, 1] - self.extents[:, 0]
        units = np.empty(len(self.columns))
        for mass, length, place in zip(masses, lengths, self.places.values(), strict=True):
            for column in place.values():
                units[column] = mass * length ** self.columns[column].length_power
        return units

    def mean(self, parameters: Array) -> Array:
        """Return the free parameters (k,) of all N; shared ones are the mean over the legs."""
        return np.asarray((self.sharing / self.sharing.sum(axis=0)).T @ parameters)

    def least(self, scaled: Array) -> Array:
        """Return each body's least eigenvalue of the pseudo-inertia (bodies,); real if positive."""
        return np.array([np.linalg.eigvalsh(each @ scaled)[0] for each in self.moments])


def _moments(parameters: Mapping[str, Any]) -> list[list[Any]]:
    """Return the matrix of a body, linear in its values by kind.

    A body that turns about any axis has its second moments (4, 4); one that turns in a plane
    [[I, 0, hx], [0, I, hy], [hx, hy, m]], whose least eigenvalue is that of [[m, |h|], [|h|, I]];
    one that does not turn has its mass.
    """
    if "Izz" in parameters:
        return SpatialInertia.second_moments(parameters)
    m, zero = parameters["m"], 0.0 * parameters["m"]
    if "I" not in parameters:
        return [[m]]
    hx, hy, inertia = (parameters.get(kind, zero) for kind in PlanarInertia.kinds[1:])
    return [[inertia, zero, hx], [zero, inertia, hy], [hx, hy, m]]


def bodies_of(base: BaseParameters) -> Bodies:
    """Return the bodies of a machine's base parameters, and how these are shared."""
    robot, columns = base.robot, base.parameters
    groups = list(dict.fromkeys(p.legs for p in columns if p.legs))
    _, sharing = share(robot, groups)
    # A telescope has no length: its parts count as long as a link.
    sizes = [leg.size / max(len(leg.extents), 1) for leg in robot.legs if leg.size > 0.0]
    counted = len(robot.platform.arm_axes)
    radius = max(float(np.linalg.norm(leg.platform_point[:counted])) for leg in robot.legs)
    mean = float(np.mean(sizes))
    half = 0.5 * (radius if radius > 1e-3 * mean else _SMALL_PLATFORM * mean)
    extents = {}
    for p in columns:
        known = [robot.legs[leg - 1].extents.get(p.body) for leg in p.legs]
        ends = [extent[1:3] for extent in known if extent is not None]
        default = (-half, half) if not p.legs else (-mean, 0.0) if p.body == "l" else (0.0, mean)
        extents[p.owner] = np.mean(ends, axis=0) if ends else np.array(default)
    return Bodies(columns, sharing, np.array(list(extents.values())))


def parameters_of(robot: Manipulator, parameters: ArrayLike, what: str) -> Array:
    """Return inertial parameters (N,) as an array; raise on a wrong shape or NaN."""
    vector = np.asarray(parameters, dtype=float)
    count = len(parameter_names(robot))
    if vector.shape != (count,):
        raise ModelError(f"{what}: shape {vector.shape} given, ({count},) expected")
    if not np.isfinite(vector).all():
        bad = parameter_names(robot)[int(np.flatnonzero(~np.isfinite(vector))[0])]
        raise ModelError(f"{what}: {bad} is {vector[~np.isfinite(vector)][0]}, not a number")
    return vector


def real_bodies(robot: Manipulator, values: ArrayLike | None = None) -> tuple[str, ...]:
    """Return the conditions that parameters violate as real bodies; empty if they are feasible.

    A real body has m > 0, and in planar motion I > 0 and I m >= (m gamma)^2, since the moment of
    inertia about its centre of mass, I - (m gamma)^2 / m, is not negative. Of one that turns about
    any axis no moment about the centre of mass is greater than the sum of the other two.

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
    ('p1: mass: -0.1 kg is not positive; give a value above 0 kg',)
    """
    vector = parameters(robot) if values is None else parameters_of(robot, values, "parameters")
    columns_info, lines = parameter_data(robot), []
    for name, place in body_places(columns_info).items():
        columns = list(place.values())
        first = columns_info[columns[0]]
        legs, platform = robot.legs, robot.platform
        kind = legs[first.legs[0] - 1].bodies[first.body] if first.legs else platform.total_inertia
        try:
            kind.of_values(vector[columns].tolist())
        except ModelError as error:
            lines.append(f"{name}: {error}")
    return tuple(lines)


@dataclass(frozen=True)
class Target:
    """Minimise |matrix @ z - right| over the scaled free parameters z = free / scale.

    `scale` is made of a mass of each body and its length; `margins` (bodies,) are how far inside
    its cone each body is kept.
    """

    kind: Literal["CAD", "nothing"]
    scale: Array
    margins: Array
    matrix: Array
    right: Array


def cad_target(bodies: Bodies, cad: Array) -> Target:
    """Return the target "nearest to CAD parameters" (N,), scaled by each body's mass and length."""
    free = bodies.mean(cad)
    heads = free[bodies.masses]
    # An array from a drawing may hold any mass; a scale must be positive.
    typical = float(np.abs(heads).mean()) or 1.0
    scale = bodies.scale(np.maximum(np.abs(heads), 0.01 * typical))
    z = free / scale
    # A CAD model thinner than the margin stays its own nearest model.
    margins = np.clip(0.5 * bodies.least(z), _LEAST_MARGIN, _MARGIN)
    return Target("CAD", scale, margins, np.eye(len(z)), z)


def plain_target(bodies: Bodies, base: BaseParameters, base_values: Array) -> Target:
    """Return the target "nearest to uniform rods and a uniform disc", all of about one mass.

    It sums (m - mean)^2 + (hx - c m)^2 + hy^2 + (I - k m)^2 over bodies, with c and k of a rod
    (1/2, 1/3) or a disc (0, 1/2), in lengths of the body: strictly convex, so that the answer is
    one, also where the forces leave a parameter entirely free (a Tripteron's platform's inertia).
    """
    parameters = (base.parameters[column] for column in base.kept)
    masses = [abs(v) for v, p in zip(base_values, parameters, strict=True) if p.kind == "m"]
    typical = float(np.mean(masses)) if masses and np.mean(masses) > 0.0 else 1.0
    heads, count = bodies.masses, len(bodies.names)
    scale = bodies.scale(np.full(count, typical))
    rows = np.eye(len(scale))
    for (low, high), (name, place) in zip(bodies.extents, bodies.places.items(), strict=True):
        head = place["m"]
        rows[head, heads] -= 1.0 / count
        if "mgx" in place:
            # A rod from one end of its extent to the other, or a disc about its reference point.
            rows[place["mgx"], head] = -0.5 * (low + high) / (high - low)
            if "I" in place:
                rows[place["I"], head] = -0.5 if name == PLATFORM else -1.0 / 3.0
            for kind in {"Ixx", "Iyy", "Izz"} & place.keys():  # a disc of some thickness
                rows[place[kind], head] = -0.5 if kind == "Izz" else -0.3
    return Target("nothing", scale, np.full(count, _MARGIN), rows, np.zeros(len(scale)))
