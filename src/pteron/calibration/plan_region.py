"""The region of a plan's poses: a box or a disc that is proved to be in reach and regular."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.errors import ModelError
from pteron.kernels import numeric
from pteron.kinematics import random_poses
from pteron.kinematics.sampling import holding_measures
from pteron.manipulator import Manipulator
from pteron.workspace import Box, Cylinder, prove

Array = NDArray[np.float64]

_SHARE = 0.3
"""Least measures that are proved in the box, over those at its centre: nearer to a singularity the
tolerances of a machine that is not quite as drawn lead far away, or across."""

_MOST = 20_000
"""Undecided boxes at which a proof is given up."""

_HALVINGS = 6
"""Bisections in the search for the size of the box."""

_WIDENINGS = 4
"""Times that each of its sides may then grow by half."""

_ABOVE = 0.005
"""Height above a plane to which a probe is lifted between two places, m."""


def proved_box(robot: Manipulator, center: Array, flat: bool = False) -> Box:
    """Return a box of poses around one that is proved to serve, with margins to singularities.

    Its sides are as those of the least box that holds random poses; `flat` keeps it within 5 mm
    above the centre, level: the ways of a probe.

    Raises
    ------
    ModelError
        If there is none.
    """
    floors = _floors(robot, center)
    drawn = random_poses(robot, 400)
    sides = np.maximum(np.abs(drawn - center).max(axis=0), 1e-9)
    thin = np.zeros(robot.freedom)
    if flat:
        sides[upright_index(robot)] = 0.0
        sides[robot.platform.angular] = 0.0
        thin[upright_index(robot)] = _ABOVE
    least, most = 0.0, 1.0
    proved: Box | None = None
    for _ in range(_HALVINGS):
        share = 0.5 * (least + most)
        box = Box(tuple(center - share * sides), tuple(center + share * sides + thin))
        if prove(robot, box, type_i=floors[0], type_ii=floors[1], most=_MOST).holds:
            least, proved = share, box
        else:
            most = share
    if proved is None:
        raise _no_region(robot, center)
    return _widen_box(robot, proved, sides, floors)


def _floors(robot: Manipulator, center: Array) -> tuple[float, float]:
    """Return the least type-I and holding measures that a region about a pose must keep."""
    type_i = numeric(robot, "reach")(center)[1]
    measures = [abs(float(numeric(robot, name)(center)[0])) for name in holding_measures(robot)]
    floors = _SHARE * float(type_i.min()), _SHARE * min(measures)
    if not np.isfinite(floors).all():
        raise _no_region(robot, center)
    return floors


def _no_region(robot: Manipulator, center: Array) -> ModelError:
    """Return the error that no box of poses around a centre is proved to be usable."""
    return ModelError(
        f"no box of poses around {np.round(center, 4).tolist()} is proved to be in reach, "
        "within limits and away from singularities; move the plane, or the machine's limits",
        subject=robot.name,
    )


def proved_level(robot: Manipulator, center: Array) -> Box | Cylinder:
    """Return the larger of a proved box and a proved disc on a level, both `_ABOVE` high.

    Raises
    ------
    ModelError
        If there is none.
    """
    box = proved_box(robot, center, flat=True)
    if robot.coordinates[:3] != ("x", "y", "z"):
        return box
    floors = _floors(robot, center)
    middle = center.copy()
    middle[2] += 0.5 * _ABOVE
    height = 2.0 * (middle[2] - center[2])
    sides = (box.box[1] - box.box[0])[:2]
    # Corners of the box are in reach: the disc through them is the greatest that may be.
    least, most = 0.0, float(np.linalg.norm(sides))
    for _ in range(_HALVINGS):
        radius = 0.5 * (least + most)
        disc = Cylinder(tuple(middle), radius, height)
        if prove(robot, disc, type_i=floors[0], type_ii=floors[1], most=_MOST).holds:
            least = radius
        else:
            most = radius
    larger = np.pi * least**2 > sides.prod()
    return Cylinder(tuple(middle), least, height) if larger else box


def _widen_box(robot: Manipulator, box: Box, sides: Array, floors: tuple[float, float]) -> Box:
    """Return a proved box, each side in turn widened while the box stays proved."""
    for k in np.flatnonzero(sides):
        for _ in range(_WIDENINGS):
            low, high = box.box
            growth = 0.5 * (high[k] - low[k])
            if high[k] - low[k] >= 2.0 * sides[k]:
                break
            low[k], high[k] = low[k] - 0.5 * growth, high[k] + 0.5 * growth
            wider = Box(tuple(low), tuple(high))
            type_i, type_ii = floors
            if not prove(robot, wider, type_i=type_i, type_ii=type_ii, most=_MOST // 4).holds:
                break
            box = wider
    return box


def upright_index(robot: Manipulator) -> int:
    """Return the index of the coordinate that is nearest to vertical."""
    lengths = np.flatnonzero(~robot.platform.angular)
    return int(lengths[np.abs(robot.platform.directions[:, 2]).argmax()])
