"""One design of a search: a machine with its quantities, such as workspace, margins and forces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from pteron.design.quantities import quantities
from pteron.design.region import workspace_poses
from pteron.design.task import Task
from pteron.equations.drives import drive_numbers
from pteron.equations.machine import numbers
from pteron.kernels import Array
from pteron.kinematics.sampling import joint_limits, search_ball
from pteron.manipulator import Manipulator, parameters
from pteron.renamed import former_attribute
from pteron.workspace.fit import UNKNOWN, Fit, largest_fit
from pteron.workspace.samples import cube, shape_samples

_IN_CUBE = 5
"""Sample poses along each edge of the largest cube, where that stands for the workspace."""


class DriveMotion(NamedTuple):
    """Joint rates and drives' forces at the workspace's corners."""

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
    known : Fit, optional
        Its largest cube, where that is proved.
    least : float
        The least row of the conditions over the required workspace that a proof has shown.
    """

    task: Task
    robot: Manipulator
    known: Fit | None = None
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
    def cube(self) -> Fit:
        """The largest cube: found, and proved where it is known."""
        if self.known is not None:
            return self.known
        return self.cube_without(np.empty((0, self.robot.freedom)))

    def cube_without(self, failing: Array) -> Fit:
        """Return the largest cube that holds none of the poses (F, m), which are known to fail."""
        task, ball = self.task, search_ball(self.robot)
        shape = cube(len(ball[0]))
        return largest_fit(task.conditions, self.geometry, task.orientations, ball, failing, shape)

    @cached_property
    def poses(self) -> Array:
        """Poses of the required workspace, or of the cube where none is required, (N, m)."""
        return self._region(None)

    def _region(self, samples: int | None) -> Array:
        spec = self.task.spec
        if spec.workspace is not None:
            return workspace_poses(spec.workspace, self.task.orientations, samples)
        shape = cube(len(self.cube.center))
        lattice = shape_samples(shape, self.task.orientations, samples or _IN_CUBE)
        return lattice.at(self.cube.center, self.cube.edge)

    @cached_property
    def joints(self) -> Array:
        """Joint coordinates (N, n) over these poses, m or rad."""
        return self.values("joint_coordinates")

    @cached_property
    def drive_motion(self) -> DriveMotion:
        """Joint rates (K, n) and drives' forces at the corners, in both directions of each axis."""
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
            np.einsum("kij,lj->kli", jacobians, velocity).reshape(-1, self.robot.joint_count),
            forces,
        )

    @cached_property
    def _sides(self) -> dict[float, float]:
        """The least row of the conditions over the required workspace, by the measure's sign."""
        found = {}
        for side in self.task.conditions.sides:
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
    def margin(self) -> float:
        """The least row of the conditions over the workspace; below 0 where one fails."""
        if self.task.spec.workspace is None:
            return self.cube.margin
        return min(max(self._sides.values()), self.least)

    reserve = former_attribute("reserve", "margin")
    start_strokes = former_attribute("start_strokes", "reference_strokes")

    def quantity(self, name: str) -> float:
        """Return one of its quantities; NaN where it has none."""
        if self.task.spec.workspace is None and self.cube.edge <= 0.0 and name != "cube":
            own = quantities()[name].of_machine
            return own(self.robot) if own is not None else float("nan")
        return float(quantities()[name].of(self))

    @cached_property
    def strokes(self) -> Array:
        """The travel of each joint (n,) over these poses, m or rad."""
        return np.asarray(np.ptp(self.joints, axis=0))

    @property
    def reference_strokes(self) -> Array:
        """Travels (n,) over which `stroke` is a share: the limits' width, or those at the start."""
        widths = np.ptp(joint_limits(self.task.robot), axis=0)
        endless = np.isinf(widths)
        return np.where(endless, _start(self.task).strokes, widths) if endless.any() else widths


@lru_cache(maxsize=8)
def _start(task: Task) -> Design:
    return Design(task, task.robot)
