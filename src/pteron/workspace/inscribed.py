"""The largest cube and the largest cylinder in the workspace at one orientation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy import ndimage  # type: ignore[import-untyped]

from pteron.errors import DataError, ModelError
from pteron.kernels import Array
from pteron.kinematics.evaluate import checked_one
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.shapes import PoseLike
from pteron.workspace.conditions import Condition, conditions, kept, rooms_left
from pteron.workspace.growth import Growth
from pteron.workspace.paving import paving
from pteron.workspace.proofs import Proof, prove
from pteron.workspace.regions import Box, Cylinder, Region

_COARSE = 0.5
"""Tolerance of the paving that says where to look."""

_POINTS = 32
"""Positions along the longest side of the lattice in which the search starts."""

_STARTS = 3
_EXCHANGES = 60


@dataclass(frozen=True)
class Inscribed:
    """A shape in the workspace, as large as was found.

    Attributes
    ----------
    center : array, shape (m,)
        The pose in its middle, m and rad.
    size : float
        Half the edge of a cube, or the radius of a cylinder, m.
    region : Box or Cylinder
        The shape.
    proof : Proof or None
        That all of it lies in the workspace; None where it was not asked for.
    """

    center: Array
    size: float
    region: Region
    proof: Proof | None = field(repr=False)

    @property
    def edge(self) -> float:
        """The edge of a cube, the diameter of a cylinder, m."""
        return 2.0 * self.size


def largest_cube(
    robot: RobotLike,
    pose: PoseLike,
    *,
    tolerance: float = 1e-3,
    proved: bool = True,
    given: tuple[Condition, ...] | None = None,
) -> Inscribed:
    """Return the largest cube in the workspace at the orientation of a pose, and its proof.

    Its edges are along the pose's coordinates; in a plane it is a square. A search by ordinary
    evaluation, from the best places of a lattice, finds it: no larger one is known, but that there
    is none is not proved. That all of it lies in the workspace is.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, in its working mode.
    pose : array, shape (m,)
        Gives the orientation, m and rad.
    tolerance : float
        By which share the cube may be smaller than the one that was found, so that it is proved.
    proved : bool
        Whether it is proved; else it is what the search found, so much smaller.
    given : tuple of Condition, optional
        What a pose must keep; by default `conditions(robot)`: reach and limits.

    Returns
    -------
    Inscribed

    Raises
    ------
    ModelError
        If there is none: no position is in reach at this orientation, or next to none.

    Examples
    --------
    >>> from pteron.workspace import largest_cube
    >>> found = largest_cube("tripteron-router", [0.1, 0.1, 0.1])
    >>> round(found.edge, 3), found.proof.holds
    (0.2, True)
    """
    robot = as_manipulator(robot)
    at = checked_one(robot, pose, "pose")
    count = len(robot.platform.lengths)
    template = np.array(list(np.ndindex(*(5,) * count))) / 2.0 - 1.0

    def region(center: Array, size: float) -> Region:
        half = np.zeros(len(at))
        half[:count] = size
        return Box(tuple(center - half), tuple(center + half))

    def gauge(ways: Array) -> Array:
        return np.asarray(np.abs(ways).max(axis=-1))

    return _largest(robot, at, template, gauge, region, tolerance, proved, given)


def largest_cylinder(
    robot: RobotLike,
    pose: PoseLike,
    *,
    ratio: float = 1.0,
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0),
    tolerance: float = 1e-3,
    proved: bool = True,
    given: tuple[Condition, ...] | None = None,
) -> Inscribed:
    """Return the largest cylinder of a shape in the workspace at an orientation, and its proof.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, in its working mode; not a planar one.
    pose : array, shape (m,)
        Gives the orientation, m and rad.
    ratio : float
        Its height over its diameter.
    axis : (float, float, float)
        Its direction.
    tolerance, proved, given
        As for `largest_cube`.

    Returns
    -------
    Inscribed

    Raises
    ------
    ModelError
        If there is none.
    DataError
        If the machine is planar, or the ratio not positive.
    """
    robot = as_manipulator(robot)
    at = checked_one(robot, pose, "pose")
    if robot.platform.planar:
        raise DataError("robot: a planar machine has no cylinder in its workspace; ask for a cube")
    if not ratio > 0.0:
        raise DataError(f"ratio: {ratio!r} given, a number above 0 expected")
    unit = np.array(Cylinder((0.0, 0.0, 0.0), 1.0, 1.0, axis).axis)
    across = np.linalg.svd(unit[None])[2][1:]
    turns = 2.0 * np.pi * np.arange(24) / 24
    ring = np.cos(turns)[:, None] * across[0] + np.sin(turns)[:, None] * across[1]
    heights = ratio * np.linspace(-1.0, 1.0, 5)
    surface = [share * ring + h * unit for h in heights for share in (1.0, 0.5)]
    surface.append(heights[:, None] * unit)

    def region(center: Array, size: float) -> Region:
        return Cylinder(tuple(center), size, 2.0 * ratio * size, axis)

    def gauge(ways: Array) -> Array:
        along = ways @ unit
        away = np.linalg.norm(ways - along[..., None] * unit, axis=-1)
        return np.asarray(np.maximum(away, np.abs(along) / ratio))

    template = np.concatenate(surface)
    return _largest(robot, at, template, gauge, region, tolerance, proved, given)


def _largest(
    robot: Manipulator,
    at: Array,
    template: Array,
    gauge: Callable[[Array], Array],
    region: Callable[[Array, float], Region],
    tolerance: float,
    proved: bool,
    given: tuple[Condition, ...] | None,
) -> Inscribed:
    """Return the largest shape; of size 1 its points that matter are `template` (T, k)."""
    asked = conditions(robot) if given is None else given
    count = template.shape[1]

    def whole(positions: Array) -> Array:
        poses = np.broadcast_to(at, (*positions.shape[:-1], len(at))).copy()
        poses[..., :count] = positions
        return poses

    search = Growth(lambda p: rooms_left(robot, asked, whole(p)), template, gauge)
    found = [search.improved(*place) for place in _starts(robot, at, asked, whole)]
    for _ in range(_EXCHANGES if found else 0):
        center, size = found.pop(max(range(len(found)), key=lambda k: found[k][1]))
        if size <= 0.0:
            break
        middle, least = whole(center), (1.0 - tolerance) * size
        shape = region(middle, least)
        proof = prove(robot, shape, given=asked) if proved else None
        if proof is None or proof.holds:
            return Inscribed(middle, least, shape, proof)
        if proof.counterexample is None:
            found.append((center, least))
        else:
            # A point that the template has not, perhaps in a gap between the sizes that were tried.
            search.learn(proof.counterexample[:count], center)
            found.append(search.improved(center, search.size_at(center, size)))
    raise ModelError(
        f"no shape of any size is found in the workspace at the orientation of pose {at.tolist()}",
        subject=robot.name,
    )


def _starts(
    robot: Manipulator,
    at: Array,
    asked: tuple[Condition, ...],
    whole: Callable[[Array], Array],
) -> list[tuple[Array, float]]:
    """Return the centres of the largest cubes of a lattice, and half their edges."""
    coarse = paving(robot, at, tolerance=_COARSE, given=asked)
    if not len(coarse.inner):
        return []
    boxes = np.concatenate([coarse.inner, coarse.boundary])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    step = float((high - low).max()) / (_POINTS - 1)
    sides = [np.arange(a, b + step, step) for a, b in zip(low, high, strict=True)]
    lattice = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1)
    inside = np.pad(kept(robot, asked, whole(lattice)), 1)
    depth = ndimage.distance_transform_cdt(inside, metric="chessboard")
    depth = depth[(slice(1, -1),) * depth.ndim].astype(float)
    found: list[tuple[Array, float]] = []
    for _ in range(_STARTS):
        best = np.unravel_index(depth.argmax(), depth.shape)
        if depth[best] <= 0.0:
            break
        found.append((lattice[best], 0.5 * step * float(depth[best])))
        near = tuple(slice(max(i - int(depth[best]), 0), i + int(depth[best]) + 1) for i in best)
        depth[near] = 0.0
    if not found:  # thinner than the lattice
        center = 0.5 * (coarse.inner[:, 0] + coarse.inner[:, 1])
        widest = (coarse.inner[:, 1] - coarse.inner[:, 0]).min(axis=1)
        found.append((center[widest.argmax()], 0.25 * float(widest.max())))
    return found
