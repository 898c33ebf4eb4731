"""One design: the machine that values of the variables make, and what it is worth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pteron.design.cube import Cube, largest
from pteron.design.exchange import cube_samples
from pteron.design.quantities import quantities
from pteron.design.region import workspace_poses
from pteron.equations.drives import drive_numbers
from pteron.equations.machine import numbers
from pteron.kernels import Array
from pteron.kinematics.sampling import search_ball
from pteron.manipulator import Manipulator, parameters

if TYPE_CHECKING:
    from pteron.design.task import Task

_IN_CUBE = 5
"""Poses along each edge of the cube, where that is the workspace."""

UNKNOWN = -1e-6
"""What stands for a row that is NaN, or of which no proof says whether it is kept."""


class DriveMotion(NamedTuple):
    """What joints and drives do at the workspace's corners."""

    rates: Array
    forces: Array


@dataclass(frozen=True)
class Design:
    """A machine of a search, and its quantities, each worked out when it is asked for.

    Attributes
    ----------
    task : Task
        The search.
    robot : Manipulator
        The machine.
    known : Cube, optional
        Its largest cube, where that is proved.
    least : float
        The least row of the conditions over the required workspace that a proof has shown.
    """

    task: Task
    robot: Manipulator
    known: Cube | None = None
    least: float = np.inf

    @cached_property
    def geometry(self) -> Array:
        """Its numbers (G,), in the order of `equations.machine.numbers`."""
        return np.array(numbers(self.robot))

    def values(self, what: str) -> Array:
        """Return a function's first output at these poses."""
        function = self.task.function(what)
        own = {"geometry": self.geometry, "parameters": parameters(self.robot)}
        given = {name: value for name, value in own.items() if name in function.fixed}
        found = function(self.poses, **given)
        return np.asarray(found[0] if isinstance(found, tuple) else found)

    @cached_property
    def cube(self) -> Cube:
        """The largest cube: found, and proved where it is known."""
        if self.known is not None:
            return self.known
        return self.cube_without(np.empty((0, self.robot.freedom)))

    def cube_without(self, failing: Array) -> Cube:
        """Return the largest cube that holds none of the poses (F, m), which are known to fail."""
        ball = search_ball(self.robot)
        task = self.task
        return largest(task.conditions, self.geometry, task.orientations, ball, failing)

    @cached_property
    def poses(self) -> Array:
        """Poses of the required workspace, or of the cube where none is required, (N, m)."""
        return self._region(None)

    def _region(self, samples: int | None) -> Array:
        spec = self.task.spec
        if spec.workspace is not None:
            return workspace_poses(spec.workspace, self.task.orientations, samples)
        count = samples or _IN_CUBE
        lattice = cube_samples(self.task.orientations, len(self.cube.center), count)
        return lattice.at(self.cube.center, self.cube.edge)

    @cached_property
    def joints(self) -> Array:
        """Joint coordinates (N, n) over these poses, m or rad."""
        return self.values("joint_coordinates")

    @property
    def start_strokes(self) -> Array:
        """Each joint's way (n,) by which `stroke` is measured, m or rad."""
        first = self.task.first
        own = first.joints.max(axis=0) - first.joints.min(axis=0)
        limits = [leg.limits for leg in first.robot.legs]
        return np.array(
            [
                way if pair is None else pair[1] - pair[0]
                for way, pair in zip(own, limits, strict=True)
            ]
        )

    @cached_property
    def drive_motion(self) -> DriveMotion:
        """Joint rates (K, n) and drives' forces at the corners, along each axis, both ways."""
        motion = self.task.spec.motion
        corners = self._region(2)
        lengths = len(self.robot.platform.lengths)
        axes = np.eye(self.robot.freedom)[:lengths]
        ways = [
            (motion.speed * way, side * motion.acceleration * axis)
            for way, axis, side in product((*axes, *-axes), axes, (1.0, -1.0))
        ]
        velocity, acceleration = (np.array(part) for part in zip(*ways, strict=True))
        poses = np.repeat(corners, len(ways), axis=0)
        states = [np.tile(part, (len(corners), 1)) for part in (velocity, acceleration)]
        jacobians = self.task.function("jacobian")(corners, geometry=self.geometry)
        forces = self.task.function("drive_forces")(
            poses,
            *states,
            geometry=self.geometry,
            parameters=parameters(self.robot),
            drives=drive_numbers(self.robot),
        )
        return DriveMotion(
            np.einsum("kij,lj->kli", jacobians, velocity).reshape(-1, self.robot.freedom), forces
        )

    @cached_property
    def _sides(self) -> dict[float, float]:
        """The least row of the conditions over the required workspace, by the measure's sign."""
        found = {}
        for side in (1.0, -1.0):
            rows = self.task.conditions.rows(self.geometry, self.poses, side)
            least = float(np.nanmin(rows))
            # A row that is NaN fails, though not as clearly as one that says by how much.
            found[side] = min(least, UNKNOWN) if np.isnan(rows).any() else least
        return found

    @property
    def side(self) -> float:
        """The sign of the type-II measure in the workspace."""
        if self.task.spec.workspace is None:
            return self.cube.side
        return max(self._sides, key=self._sides.__getitem__)

    @property
    def reserve(self) -> float:
        """The least row of the conditions over the workspace; below 0 where one fails."""
        if self.task.spec.workspace is None:
            return self.cube.reserve
        return min(max(self._sides.values()), self.least)

    def quantity(self, name: str) -> float:
        """Return one of its quantities; NaN where it has none."""
        if self.task.spec.workspace is None and self.cube.edge <= 0.0 and name != "cube":
            own = quantities()[name].of_machine
            return own(self.robot) if own is not None else float("nan")
        return float(quantities()[name].of(self))
