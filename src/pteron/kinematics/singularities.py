"""Type-II singularities: where the sliders, held still, no longer hold the platform."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from pteron.equations.closure import closure, singularity
from pteron.equations.geometry import Geometry
from pteron.errors import SingularPose
from pteron.kernels import Array
from pteron.manipulator import Manipulator

__all__ = ["is_singular_everywhere", "singular_orientations"]

_VANISHING = 1e-10
"""Relative size below which the coefficients of det J count as zero: far above their rounding
(1e-16) and far below what any layout meant to work would have."""


@lru_cache(maxsize=256)
def is_singular_everywhere(robot: Manipulator) -> bool:
    """Say whether det J vanishes at every pose.

    So it does where all slider directions lie in a plane, and for layouts with fourfold symmetry
    about k.

    Parameters
    ----------
    robot : Manipulator
        The machine.

    Returns
    -------
    bool
    """
    geometry = Geometry.of(robot)
    c = closure(geometry)
    rows = np.array([[float(x) for x in leg.direction] for leg in robot.legs])
    sizes = np.linalg.svd(rows, compute_uv=False)
    if sizes[-1] <= _VANISHING * sizes[0]:
        return True
    if c.null is None:
        return False
    a, b = (float(value) for value in singularity(geometry))
    # Of what cannot vanish by cancellation, else noise would be measured against noise.
    null = np.abs(np.array(ca.evalf(c.null))).max()
    bars = np.linalg.norm(np.array(ca.evalf(c.rows)), axis=1)
    offsets = np.linalg.norm([leg.platform_point for leg in robot.legs], axis=1)
    return bool(np.hypot(a, b) <= _VANISHING * null * bars.max() * offsets.max())


def singular_orientations(robot: Manipulator) -> Array:
    """Return the orientations of the platform that are singular (type II).

    det J of a 3T1R manipulator depends on phi only and is a multiple of A cos(phi) + B sin(phi), so
    that there are two singular orientations, 180 degrees apart, whatever the position.

    Parameters
    ----------
    robot : Manipulator
        The machine.

    Returns
    -------
    array, shape (2,) or (0,)
        The angles in rad, ascending, in (-pi, pi]; none for 3T, whose Jacobian is constant.

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
        raise SingularPose(EVERYWHERE.format(name=robot.name), kind="II", closeness=0.0, index=())
    if not robot.platform.turns:
        return np.empty(0)
    a, b = (float(value) for value in singularity(Geometry.of(robot)))
    one = np.arctan2(b, a) + np.pi / 2
    wrapped = np.pi - (np.pi - np.array([one, one - np.pi])) % (2 * np.pi)
    return np.sort(wrapped)


EVERYWHERE = (
    "{name}: singular at every pose (type II): with the sliders held still the platform can move; "
    "change a leg's direction or platform point"
)
"""What is said of such a machine, here and where a pose of it is used."""
