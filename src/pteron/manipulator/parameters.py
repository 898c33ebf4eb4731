"""The inertial parameters as one vector, in the paper's order (Eq. 16), stated here once.

Sliders m_p1..m_pn; for each upper link m, m gamma_x, m gamma_y, I; for each lower link the same;
the platform the same: N = 9 n + 4, which is 40 for the Quadrupteron and 31 for the Tripteron.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.errors import ModelError
from pteron.manipulator.inertia import PlanarInertia
from pteron.manipulator.manipulator import Manipulator

__all__ = ["BODY_PARAMETERS", "parameter_names", "parameter_units", "parameters", "with_parameters"]

BODY_PARAMETERS = ("m", "mgx", "mgy", "I")
"""The four parameters of a body in planar motion: mass, first moments, moment of inertia."""

_UNITS = {"m": "kg", "mgx": "kg m", "mgy": "kg m", "I": "kg m^2"}


def parameter_names(robot: Manipulator) -> tuple[str, ...]:
    """Return the names of the N inertial parameters, in the paper's order (Eq. 16).

    Parameters
    ----------
    robot : Manipulator
        The machine.

    Returns
    -------
    tuple of str
        ``m_p1`` ..., ``m_u1, mgx_u1, mgy_u1, I_u1`` ..., ``m_l1`` ..., ``m_e, mgx_e, mgy_e, I_e``:
        slider (p), upper (u) and lower (l) link of each leg, platform (e). ``mgx`` is m gamma_x.

    Examples
    --------
    >>> import pteron
    >>> names = pteron.parameter_names(pteron.load("quadrupteron"))
    >>> len(names), names[4:8]
    (40, ('m_u1', 'mgx_u1', 'mgy_u1', 'I_u1'))
    """
    legs = range(1, len(robot.legs) + 1)
    sliders = [f"m_p{i}" for i in legs]
    links = [f"{p}_{link}{i}" for link in "ul" for i in legs for p in BODY_PARAMETERS]
    return (*sliders, *links, *(f"{p}_e" for p in BODY_PARAMETERS))


def parameter_units(robot: Manipulator) -> tuple[str, ...]:
    """Return the SI unit of each parameter, in the order of `parameter_names`."""
    return tuple(_UNITS[name.split("_")[0]] for name in parameter_names(robot))


def parameters(robot: Manipulator) -> NDArray[np.float64]:
    """Return the values of the N inertial parameters, in the order of `parameter_names`.

    Parameters
    ----------
    robot : Manipulator
        The machine.

    Returns
    -------
    array, shape (N,)
        kg, kg m and kg m^2.
    """
    values = [leg.slider_mass for leg in robot.legs]
    for leg in robot.legs:
        values.extend(leg.upper.values)
    for leg in robot.legs:
        values.extend(leg.lower.values)
    values.extend(robot.platform.inertia.values)
    return np.array(values)


def with_parameters(robot: Manipulator, values: ArrayLike) -> Manipulator:
    """Return the same machine with other inertial parameters.

    Parameters
    ----------
    robot : Manipulator
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
    vector = np.asarray(values, dtype=float)
    names = parameter_names(robot)
    if vector.shape != (len(names),):
        raise ModelError(f"parameters: shape {vector.shape} given, ({len(names)},) expected")
    n = len(robot.legs)
    sliders, bodies = vector[:n].tolist(), vector[n:].reshape(-1, 4).tolist()
    inertias = [
        _inertia(body, names[n + 4 * b].removeprefix("m_")) for b, body in enumerate(bodies)
    ]
    legs = []
    for i, leg in enumerate(robot.legs):
        try:
            legs.append(
                replace(leg, slider_mass=sliders[i], upper=inertias[i], lower=inertias[n + i])
            )
        except ModelError as error:
            raise ModelError(f"parameters of leg {i + 1}: {error}") from None
    platform = replace(robot.platform, inertia=inertias[-1])
    return replace(robot, legs=tuple(legs), platform=platform)


def _inertia(values: Sequence[float], body: str) -> PlanarInertia:
    mass, hx, hy, inertia = values
    try:
        return PlanarInertia(mass, (hx, hy), inertia)
    except ModelError as error:
        raise ModelError(f"parameters of body {body}: {error}") from None
