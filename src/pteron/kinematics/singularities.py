"""Type-II singularities: where the actuators, held still, no longer hold the platform."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from pteron.equations.machine import closure_of
from pteron.errors import ModelError, SingularPose
from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator

_VANISHING = 1e-10
_SAMPLES = 64


@lru_cache(maxsize=256)
def is_singular_everywhere(robot: Manipulator) -> bool:
    """Say whether det J vanishes at every pose.

    So it does, for one, where the rows of all legs lie in a plane, and for P-R-R-R layouts with
    fourfold symmetry about k.

    Parameters
    ----------
    robot : Manipulator
        The machine.

    Returns
    -------
    bool
    """
    known = closure_of(robot).vanishes()
    if known is not None:
        return known
    from pteron.kinematics.sampling import random_poses

    try:
        poses = random_poses(robot, _SAMPLES, type_i=1e-3, type_ii=0.0)
    except ModelError:
        return False  # nowhere in reach, which is told where a pose is used
    return bool((np.abs(numeric(robot, "type_ii")(poses)[0]) <= _VANISHING).all())


def singular_orientations(robot: Manipulator) -> Array:
    """Return the orientations of the platform that are singular (type II) whatever the position.

    For P-R-R-R legs under a 3T1R platform det J is a multiple of A cos(phi) + B sin(phi): there are
    two singular orientations, 180 degrees apart.

    Parameters
    ----------
    robot : Manipulator
        The machine.

    Returns
    -------
    array, shape (2,) or (0,)
        The angles in rad, ascending, in (-pi, pi]; none where the platform does not turn, or where
        singularity depends on the position.

    Raises
    ------
    SingularPose
        If every pose is singular.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> np.degrees(pteron.singular_orientations(pteron.load("quadrupteron")))
    array([-90.,  90.])
    """
    if is_singular_everywhere(robot):
        raise singular_everywhere(robot)
    orientation = closure_of(robot).orientation
    if orientation is None:
        return np.empty(0)
    a, b = (float(value) for value in orientation)
    one = np.arctan2(b, a) + np.pi / 2
    wrapped = np.pi - (np.pi - np.array([one, one - np.pi])) % (2 * np.pi)
    return np.sort(wrapped)


def singular_everywhere(robot: Manipulator, index: tuple[int, ...] = ()) -> SingularPose:
    """Return what is said of such a machine, here and where a pose of it is used."""
    return SingularPose(
        "singular at every pose (type II): with the actuators held still the platform can move; "
        "change a leg's direction or platform point",
        kind="II",
        measure=0.0,
        index=index,
        subject=robot.name,
    )
