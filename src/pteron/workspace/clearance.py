"""Clearance: the distances between a machine's bodies, and the conditions that no two touch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from pteron.equations.clearance import meetings, pairs
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import Manipulator, Radii, RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import OnFailure, PoseLike
from pteron.workspace.conditions import Condition

_PLURALS = {
    "guide": "guides",
    "upper": "upper links or cranks",
    "lower": "last links",
    "leg": "legs",
    "platform": "platform",
}
"""Names of bodies in the plural, for warnings."""

Thickness = Radii | Mapping[str, float] | float
"""Radii, some of them by name, or one for all bodies, m."""


@dataclass(frozen=True, eq=False, repr=False)
class Clearance(Result):
    """Distances between bodies, pair by pair.

    Attributes
    ----------
    pairs : tuple of (str, str)
        The bodies by name, such as ``("leg 1 crank", "platform")``. Bodies that share a joint are
        left out.
    distances : array, shape (..., K)
        From surface to surface, m; negative where the capsules overlap, down to minus the sum of
        their radii.
    """

    ROWS = "distances:1"

    pairs: tuple[tuple[str, str], ...]
    distances: Array

    @property
    def least(self) -> Array:
        """The least distance of all pairs, shape (...), m; infinite where there is no pair."""
        return np.asarray(np.min(self.distances, axis=-1, initial=np.inf))

    @property
    def nearest(self) -> tuple[str, str] | None:
        """The pair that is nearest in any of the poses; None where none is in reach."""
        if not self.distances.size or np.isnan(self.distances).all():
            return None
        return self.pairs[int(np.nanargmin(self.distances)) % len(self.pairs)]


def clearance(
    robot: RobotLike,
    pose: PoseLike,
    radii: Thickness | None = None,
    *,
    on_failure: OnFailure = "raise",
) -> Clearance:
    """Return the least distance of each pair of bodies: capsules round their centre lines.

    Links, cranks, rods, guides within their joint's limits, and the platform's arms count. Parallel
    rods count as two where the robot's file gives their bar and `bar_length`.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    radii : Radii, mapping or float, optional
        Radii of the bodies, m: for each kind of body, or one radius for all. The machine's
        own where it is not given; without these the centre lines count.
    on_failure : {"raise", "nan"}
        Treatment of a pose out of reach.

    Returns
    -------
    Clearance

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    ModelError
        If a radius is negative.
    DataError
        If a name is none of ``guide``, ``upper``, ``lower`` and ``platform``.

    References
    ----------
    Ericson, *Real-Time Collision Detection*, 2005, section 5.1.9, for the distance of segments.

    Examples
    --------
    >>> from pteron.workspace import clearance
    >>> found = clearance("delta", [0.0, 0.0, -0.9], radii=0.01)
    >>> found.distances.shape, float(found.least.round(4)), found.nearest
    ((15,), 0.1965, ('leg 2 rod', 'leg 3 rod'))
    """
    robot = as_manipulator(robot)
    body_pairs = pairs(robot)
    distances: Array = evaluate_kernel(robot, "clearances", on_failure, pose)
    names = tuple((a.name, b.name) for a, b in body_pairs)
    radii_by_kind = _to_radii(robot, radii)
    touching = [
        getattr(radii_by_kind, a.kind) + getattr(radii_by_kind, b.kind) for a, b in body_pairs
    ]
    return Clearance(names, distances - np.array(touching))


def interference(robot: RobotLike, radii: Thickness | None = None) -> tuple[Condition, ...]:
    """Return the conditions that no two bodies touch, for pavings, proofs and largest shapes.

    There is one for each two kinds of bodies that may meet, such as cranks and rods.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    radii : Radii, mapping or float, optional
        As of `clearance`.

    Returns
    -------
    tuple of Condition

    Raises
    ------
    ModelError, DataError
        As `clearance`.

    Examples
    --------
    >>> from pteron.workspace import Box, conditions, interference, prove
    >>> given = (*conditions("five-bar"), *interference("five-bar", 0.005))
    >>> prove("five-bar", Box((-0.01, 0.15), (0.01, 0.16)), given=given).holds
    True
    """
    robot = as_manipulator(robot)
    radii_by_kind = _to_radii(robot, radii)
    return tuple(
        Condition(
            0,
            f"interference of {_PLURALS[a]} and {_PLURALS[b]}",
            "least_clearances",
            "distances",
            k,
            float(getattr(radii_by_kind, a) + getattr(radii_by_kind, b)),
        )
        for k, (a, b) in enumerate(meetings(robot))
    )


def _to_radii(robot: Manipulator, thickness: Thickness | None) -> Radii:
    """Return the radii of a machine's bodies, m: its file's, or a thickness for all or by name."""
    if thickness is None:
        return robot.radii or Radii()
    if isinstance(thickness, Radii):
        return thickness
    names = [field.name for field in fields(Radii)]
    if not isinstance(thickness, Mapping):
        return Radii(*([thickness] * len(names)))
    if unknown := [name for name in thickness if name not in names]:
        raise DataError(f"radii: {unknown[0]!r} is not one of {', '.join(names)}")
    return Radii(**thickness)
