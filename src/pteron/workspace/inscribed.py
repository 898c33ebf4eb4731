"""The largest cube and the largest cylinder in the workspace at one orientation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from pteron.arguments import expect, expect_share
from pteron.equations.machine import numbers
from pteron.errors import ModelError, PteronError
from pteron.kernels import Array
from pteron.kinematics.evaluate import finite_pose
from pteron.kinematics.sampling import search_ball
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace.conditions import Condition, conditions
from pteron.workspace.fit import Fit, largest_fit, proved_fit
from pteron.workspace.home import home_poses
from pteron.workspace.proofs import Proof, expect_space, prove
from pteron.workspace.regions import Box, Cylinder, Region
from pteron.workspace.shape_samples import Shape, cube
from pteron.workspace.smooth_conditions import smooth_conditions
from pteron.workspace.volume import bounding_box, expect_places

_STARTS = 3
"""Number of places of the search grid from which the shape is enlarged."""

_SHARES = 40
"""Greatest number of times that a shape is made smaller by the tolerance until it is proved."""


@dataclass(frozen=True, eq=False, repr=False)
class Inscribed(Result):
    """The largest shape in the workspace, by a search, with its proof.

    Attributes
    ----------
    center : array, shape (m,)
        The pose in its middle, m and rad.
    size : float
        Half the edge of a cube, or the radius of a cylinder, m.
    region : Box or Cylinder
        The shape.
    proof : Proof or None
        The proof that all of it lies in the workspace; None where it was not asked for.
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
    evaluation, from the best places of a lattice, finds it. It is proved that all of it lies in the
    workspace; it is not proved that there is no larger one.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, in its working mode.
    pose : array, shape (m,)
        Gives the orientation, m and rad.
    tolerance : float
        Share by which the cube may be made smaller than the one that was found, to be proved.
    proved : bool
        Whether to prove it; else the cube that was found is made smaller by `tolerance`.
    given : tuple of Condition, optional
        The conditions on a pose; by default `conditions(robot)`: reach and limits.

    Returns
    -------
    Inscribed

    Raises
    ------
    ModelError
        If none is found: no position is in reach at this orientation, or hardly any.

    Examples
    --------
    >>> from pteron.workspace import largest_cube
    >>> found = largest_cube("tripteron-router", [0.1, 0.1, 0.1])
    >>> round(found.edge, 3), found.proof.holds
    (0.2, True)
    """
    robot = as_manipulator(robot)
    reference = finite_pose(robot, pose, "pose")
    count = len(robot.platform.lengths)

    def region(center: Array, size: float) -> Region:
        """Return the box of poses with a center (m,) and a half edge, m, in its positions."""
        half = np.zeros(len(reference))
        half[:count] = size
        return Box(tuple(center - half), tuple(center + half))

    return _largest_shape(robot, reference, cube(count), region, tolerance, proved, given)


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
        If the machine does not move in x, y and z, the ratio is not positive, or the tolerance is
        no share between 0 and 1.
    """
    robot = as_manipulator(robot)
    reference = finite_pose(robot, pose, "pose")
    expect_space(robot, "robot")
    expect(ratio > 0.0, "ratio", repr(ratio), "a number above 0")
    unit = np.array(Cylinder((0.0, 0.0, 0.0), 1.0, 1.0, axis).axis)
    normals = np.linalg.svd(unit[None])[2][1:]
    turns = 2.0 * np.pi * np.arange(24) / 24
    ring = np.cos(turns)[:, None] * normals[0] + np.sin(turns)[:, None] * normals[1]
    heights = ratio * np.linspace(-1.0, 1.0, 5)
    rim = np.concatenate([ring + h * unit for h in heights])

    def region(center: Array, size: float) -> Region:
        """Return the cylinder with a center (m,) and a radius, m."""
        return Cylinder(tuple(center), size, 2.0 * ratio * size, axis)

    def gauge(vectors: Array) -> Array:
        """Return the radius (...), m, of the least cylinder of this shape with vectors (..., 3)."""
        heights = vectors @ unit
        radii = np.linalg.norm(vectors - heights[..., None] * unit, axis=-1)
        return np.asarray(np.maximum(radii, np.abs(heights) / ratio))

    half = np.array(region(np.zeros(3), 1.0).box[1])
    return _largest_shape(
        robot, reference, Shape(half, gauge, rim), region, tolerance, proved, given
    )


def _largest_shape(
    robot: Manipulator,
    reference: Array,
    shape: Shape,
    region: Callable[[Array, float], Region],
    tolerance: float,
    proved: bool,
    own_conditions: tuple[Condition, ...] | None,
) -> Inscribed:
    """Return the largest shape of a kind at the orientation of a pose; `proved` proves it."""
    expect_places(robot, "it only turns; ask for its `largest_tilt`")
    expect_share("tolerance", tolerance)
    required = conditions(robot) if own_conditions is None else own_conditions
    smooth, geometry = smooth_conditions(robot, required), np.array(numbers(robot))
    lengths = len(robot.platform.lengths)

    def inscribed_shape(fit: Fit, proof: Proof | None) -> Inscribed:
        """Return a fit as a shape with its proof."""
        center = np.append(fit.center, reference[lengths:])
        return Inscribed(center, 0.5 * fit.edge, region(center, 0.5 * fit.edge), proof)

    def fit_in_ball(ball: tuple[Array, float], failing: Array) -> Fit:
        """Return the largest shape in a ball (center, radius in m) without failing positions."""
        return largest_fit(smooth, geometry, reference[None], ball, failing, shape, _STARTS)

    def search(failing: Array) -> Fit:
        """Return the largest shape without failing positions, at home's side or in the box."""
        fit = fit_in_ball(_ball_at_home(robot), failing)
        if fit.edge > 0.0:
            return fit
        # A grid for all orientations may miss the small part that one of them leaves.
        low, high = bounding_box(robot, reference)
        return fit_in_ball((0.5 * (low + high), 0.5 * float((high - low).max())), failing)

    def proofs(fit: Fit) -> tuple[Proof, ...]:
        """Return the proof that a fit's region keeps the conditions."""
        return (prove(robot, inscribed_shape(fit, None).region, given=required),)

    if proved:
        shares = (1.0 - tolerance) ** np.arange(1, _SHARES + 1)
        proved_shape = proved_fit(search, proofs, shape, shares.tolist(), len(reference))
        if proved_shape is not None:
            return inscribed_shape(proved_shape[0], *proved_shape[1])
    else:
        fit = search(np.empty((0, len(reference))))
        if fit.edge > 0.0:
            return inscribed_shape(replace(fit, edge=(1.0 - tolerance) * fit.edge), None)
    raise ModelError(
        "no shape of any size is found in the workspace at the orientation of pose "
        f"{reference.tolist()}",
        subject=robot.name,
    )


def _ball_at_home(robot: Manipulator) -> tuple[Array, float]:
    """Return centre (k,) and radius, m, of the places to search: on home's side of the base.

    Machines of rams alone reach the mirror images of their poses, on the other side, too.
    """
    if any(len(leg.branches) > 1 for leg in robot.legs):
        return search_ball(robot)
    try:
        poses = home_poses(robot)
    except PteronError:  # some pose is in reach, but none that would do as home
        return search_ball(robot)
    if poses.mirror is None:
        return search_ball(robot)
    count = len(robot.platform.lengths)
    home, mirror = (np.array(pose[:count]) for pose in (poses.pose, poses.mirror))
    return home, 0.5 * float(np.linalg.norm(home - mirror))
