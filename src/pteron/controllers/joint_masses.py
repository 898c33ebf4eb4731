"""The effective mass or inertia that each actuated joint moves, which scales feedback gains."""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache

import numpy as np

from pteron.dynamics import mass_matrix
from pteron.dynamics.joint_space import joint_mobilities, mass_with_rotors
from pteron.equations.drives import drives_of
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kinematics import jacobian, random_poses
from pteron.manipulator import Manipulator, RobotLike, as_manipulator

_POSES = 100
"""Random poses at which the masses are computed."""

_LEAST = (0.1, 0.01)
"""Least measures of type I and type II of these poses; the second where the first finds none."""

_SHARE = 0.1
"""Quantile of the masses at these poses that is returned."""


def joint_masses(robot: RobotLike) -> Array:
    """Return the effective mass (n,) that each joint's force moves while other joints are free.

    It is 1 / (J M^-1 J^T)_ii with the motors' inertia in M. If n joints have a stiffness of w^2
    times it, the squared natural frequencies have the mean w^2, so that none is above sqrt(n) w. It
    depends on the pose: at nine of ten random poses it is greater than the value returned.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, its motors included.

    Returns
    -------
    array, shape (n,)
        kg at a slider, kg m^2 at a crank.

    Raises
    ------
    ModelError
        If the legs have next to no common reach.

    Examples
    --------
    >>> import pteron
    >>> from pteron.controllers import joint_masses
    >>> joint_masses(pteron.load("five-bar")).round(5)
    array([0.0004 , 0.00042])
    """
    return _joint_masses(as_manipulator(robot))


@lru_cache(maxsize=64)
def _joint_masses(robot: Manipulator) -> Array:
    """Return the effective mass at each joint (n,), kg or kg m^2, read-only and cached."""
    poses = light_poses(robot)
    rows = jacobian(robot, poses)
    masses = mass_with_rotors(rows, mass_matrix(robot, poses), drives_of(robot).inertia)
    quantile: Array = np.quantile(1.0 / joint_mobilities(rows, masses), _SHARE, axis=0)
    quantile.setflags(write=False)
    return quantile


def light_poses(robot: Manipulator) -> Array:
    """Return random poses (K, m), away from singularities if possible."""
    for least in _LEAST:
        with suppress(ModelError):
            return random_poses(robot, _POSES, type_i=least, type_ii=least)
    return random_poses(robot, _POSES, type_i=0.0, type_ii=0.0)
