"""The inertial parameters of a machine as one vector, in the paper's order (Eq. 16)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.bodies.inertia import Inertia
from pteron.bodies.parameters import PLATFORM, Parameter, parameter_list
from pteron.errors import ModelError
from pteron.manipulator.manipulator import Manipulator
from pteron.manipulator.robot_like import RobotLike, as_manipulator


def parameter_data(
    robot: RobotLike, groups: Sequence[tuple[int, ...]] | None = None
) -> tuple[Parameter, ...]:
    """Return kind, body, legs and unit of each inertial parameter of a machine.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    groups : sequence of tuple of int, optional
        Legs, counted from 1, that share one parameter set; every leg in one group. By default each
        leg has its own.

    Returns
    -------
    tuple of Parameter

    Examples
    --------
    >>> import pteron
    >>> p = pteron.manipulator.parameter_data(pteron.load("quadrupteron"))[5]
    >>> p.kind, p.body, p.legs, p.unit, p.name
    ('mgx', 'u', (1,), 'kg m', 'mgx_u1')
    """
    robot = as_manipulator(robot)
    kinds = tuple(tuple((b, i.kinds) for b, i in leg.bodies.items()) for leg in robot.legs)
    carried = robot.platform.total_inertia.kinds
    return _cached_parameter_list(kinds, carried, None if groups is None else tuple(groups))


@lru_cache(maxsize=64)
def _cached_parameter_list(
    kinds: tuple[tuple[tuple[str, tuple[str, ...]], ...], ...],
    platform: tuple[str, ...],
    groups: tuple[tuple[int, ...], ...] | None,
) -> tuple[Parameter, ...]:
    """Return the list of inertial parameters for these kinds of bodies, cached."""
    return parameter_list([dict(bodies) for bodies in kinds], platform, groups)


def parameter_names(robot: RobotLike) -> tuple[str, ...]:
    """Return the names of the N inertial parameters, in the paper's order (Eq. 16).

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    tuple of str
        ``m_p1`` ..., ``m_u1, mgx_u1, mgy_u1, I_u1`` ..., ``m_l1`` ..., ``m_e, mgx_e, mgy_e, I_e``:
        slider (p), upper link or crank (u) and lower link or rod (l) of each leg, platform (e).
        ``mgx`` is m gamma_x; a body that a leg has not is left out.

    Examples
    --------
    >>> import pteron
    >>> names = pteron.parameter_names(pteron.load("quadrupteron"))
    >>> len(names), names[4:8]
    (40, ('m_u1', 'mgx_u1', 'mgy_u1', 'I_u1'))
    """
    robot = as_manipulator(robot)
    return tuple(parameter.name for parameter in parameter_data(robot))


def parameter_units(robot: RobotLike) -> tuple[str, ...]:
    """Return the SI unit of each parameter, in the order of `parameter_names`."""
    robot = as_manipulator(robot)
    return tuple(parameter.unit for parameter in parameter_data(robot))


def parameters(robot: RobotLike) -> NDArray[np.float64]:
    """Return the values of the N inertial parameters, in the order of `parameter_names`.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    array, shape (N,)
        kg, kg m and kg m^2.
    """
    robot = as_manipulator(robot)
    legs = [leg.bodies for leg in robot.legs]
    listed = parameter_data(robot)
    bodies = (
        legs[p.legs[0] - 1][p.body] if p.legs else robot.platform.total_inertia for p in listed
    )
    return np.array([b.values[b.kinds.index(p.kind)] for p, b in zip(listed, bodies, strict=True)])


def with_parameters(robot: RobotLike, values: ArrayLike) -> Manipulator:
    """Return a machine with other inertial parameters, otherwise equal.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    values : array, shape (N,)
        The parameters in the order of `parameter_names`, SI units.

    Returns
    -------
    Manipulator
        The new machine.

    Raises
    ------
    ModelError
        If their number is wrong, or if they belong to no real bodies.
    """
    robot = as_manipulator(robot)
    try:
        vector = np.asarray(np.ma.filled(values, np.nan), dtype=float)
    except (TypeError, ValueError):
        raise ModelError("parameters: not an array of real numbers") from None
    listed = parameter_data(robot)
    if vector.shape != (len(listed),):
        raise ModelError(f"parameters: shape {vector.shape} given, ({len(listed)},) expected")
    blocks: dict[tuple[str, tuple[int, ...]], list[float]] = {}
    for p, parameter in zip(listed, vector.tolist(), strict=True):
        blocks.setdefault((p.body, p.legs), []).append(parameter)
    bodies: dict[tuple[str, tuple[int, ...]], Any] = {}
    for (body, owner), block in blocks.items():
        old: Inertia = (
            robot.legs[owner[0] - 1].bodies[body] if owner else robot.platform.total_inertia
        )
        try:
            bodies[body, owner] = old.of_values(block)
        except ModelError as error:
            name = body + "".join(map(str, owner))
            raise ModelError(f"parameters of body {name}: {error}") from None
    legs = tuple(
        leg.with_bodies({body: bodies[body, (i,)] for body in leg.bodies})
        for i, leg in enumerate(robot.legs, start=1)
    )
    platform = robot.platform.with_total_inertia(bodies[PLATFORM, ()])
    return replace(robot, legs=legs, platform=platform)
