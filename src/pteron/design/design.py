"""One design of a search: a machine with its workspace, margins, forces and other quantities."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pteron.design.placement import best_place
from pteron.design.quantities import COVERS
from pteron.design.regions import placed_pose, workspace_poses, workspace_region
from pteron.design.spec import ROUNDING
from pteron.design.task import Task
from pteron.design.workspace_tables import WorkspaceTable
from pteron.design.worst_cases import worst_forces, worst_speeds
from pteron.equations.machine import numbers
from pteron.errors import PteronError
from pteron.kernels import Array, sharing_programs
from pteron.kinematics.sampling import joint_limits, search_ball
from pteron.manipulator import Manipulator, parameters
from pteron.motion import Motion, Sizing, size
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.workspace import Box, Region
from pteron.workspace.fit import UNKNOWN, Fit, largest_fit
from pteron.workspace.shape_samples import cube, shape_samples
from pteron.workspace.tilts import OrientedRegion

_STARTS = 8
"""Number of worst sample poses that local refinement starts from."""

_ROUNDS = 4
"""Halvings of the refinement's step."""

_IN_CUBE = 5
"""Sample poses along each edge of the largest cube, where that stands for the workspace."""


@dataclass(frozen=True, eq=False, repr=False)
class Design(Result):
    """A machine of a search, with quantities that are computed lazily.

    Attributes
    ----------
    task : Task
        The search.
    robot : Manipulator
        The machine.
    known : Fit, optional
        Its largest cube, or the place of its workspace, where that is proved.
    least : float
        The least row of the conditions over the required workspace that a proof has shown.
    refined : bool
        Whether worst values are sought about the worst sampled poses too; else at these alone.
    """

    SHOWN = "robot quantities"

    task: Task
    robot: Manipulator
    known: Fit | None = None
    least: float = np.inf
    refined: bool = True

    def __repr__(self) -> str:
        """Return the names of the task's machine and of the design in one line."""
        return f"<Design of {self.task.robot.name!r}: {self.robot.name}>"

    @property
    def quantities(self) -> dict[str, float]:
        """The quantities of the search, by name; NaN where undefined."""
        return {name: self.quantity(name) for name in self.task.quantity_names}

    @cached_property
    def geometry(self) -> Array:
        """The machine's geometric numbers (G,), in the order of `equations.machine.numbers`."""
        return np.array(numbers(self.robot))

    def values(self, what: str, poses: Array | None = None) -> Array:
        """Return the kernel `what`'s first output at poses (N, m); by default `self.poses`."""
        function = self.task.function(what)
        numbers = {"geometry": self.geometry, "parameters": parameters(self.robot)}
        fixed = {name: part for name, part in numbers.items() if name in function.fixed}
        outputs = function(self.poses if poses is None else poses, **fixed)
        return np.asarray(outputs[0] if isinstance(outputs, tuple) else outputs)

    @cached_property
    def cube(self) -> Fit:
        """The largest cube of feasible poses, or the place of a workspace that floats.

        Found by search, or proved.
        """
        if self.known is not None:
            return self.known
        return self.placed_without(np.empty((0, self.robot.freedom)), thorough=False)

    @property
    def placed_anywhere(self) -> Design:
        """The design with a workspace that floats placed thoroughly; itself without."""
        if not self.task.place_quantities:
            return self
        none = np.empty((0, self.robot.freedom))
        return replace(self, known=self.placed_without(none, thorough=True))

    def placed_without(self, failing: Array, *, thorough: bool) -> Fit:
        """Return the largest cube, or the best place, that excludes infeasible poses (F, m)."""
        fit = self.cube_without(failing) if len(failing) else self._largest_cube
        if not self.task.place_quantities or fit.edge < self.task.shape[1]:
            return fit
        return best_place(self, fit, failing, thorough=thorough)

    @cached_property
    def _largest_cube(self) -> Fit:
        """The largest cube, or floating workspace, of feasible poses, by search."""
        return self.cube_without(np.empty((0, self.robot.freedom)))

    def cube_without(self, failing: Array) -> Fit:
        """Return the largest cube of feasible poses that excludes the infeasible poses (F, m)."""
        task, (shape, _) = self.task, self.task.shape
        angles, poses = self.robot.platform.angular, task.orientations
        sampled = (failing[:, None, angles] == poses[:, angles]).all(axis=-1).any(axis=-1)
        poses = np.vstack([poses, failing[~sampled]])
        ball = search_ball(self.robot)
        return largest_fit(task.conditions, self.geometry, poses, ball, failing, shape)

    @cached_property
    def workspace(self) -> WorkspaceTable | None:
        """The required workspace, None if none; one that floats has its best centre."""
        table = self.task.spec.workspace
        return table.with_center(self.cube.center) if table is not None and table.floats else table

    @cached_property
    def poses(self) -> Array:
        """Poses of the required workspace, or of the cube where none is required, (N, m)."""
        return self.lattice(self._samples)

    @cached_property
    def fine_poses(self) -> Array:
        """Sample poses (N, m) at half the spacing, for quantities with many local extremes."""
        return self.lattice(2 * self._samples - 1)

    @property
    def _samples(self) -> int:
        """The number of sample poses along an edge of the workspace or of the largest cube."""
        return _IN_CUBE if self.workspace is None else self.workspace.samples

    def lattice(self, count: int) -> Array:
        """Return a grid of poses (N, m) in the workspace, or the cube, `count` along each side."""
        if self.workspace is not None:
            return workspace_poses(self.workspace, self.task.orientations, count)
        shape = cube(len(self.cube.center))
        lattice = shape_samples(shape, self.task.orientations, count)
        return lattice.shape_poses(self.cube.center, self.cube.edge)

    @cached_property
    def joints(self) -> Array:
        """Joint coordinates (N, n) at `self.poses`, m or rad."""
        return self.values("joint_coordinates")

    @cached_property
    def loaded_robot(self) -> Manipulator:
        """The machine with the task's payload on its platform."""
        payload = self.task.spec.payload
        return self.robot if payload is None else payload.add_to(self.robot)

    def forces(self, poses: Array) -> Array:
        """Return the greatest drive forces (N, n) at poses over all directions, N or N m."""
        motion = self.task.spec.motion
        return worst_forces(self.loaded_robot, poses, motion.speed, motion.acceleration)

    def speeds(self, poses: Array) -> Array:
        """Return the greatest joint speeds (N, n) at poses over all directions, m/s or rad/s."""
        return worst_speeds(self.robot, poses, self.task.spec.motion.speed)

    def region(self, pose: Array) -> Region:
        """Return the workspace, or the cube, as a region at a pose's orientation, or at all."""
        if self.workspace is not None:
            return self.task.oriented_region(workspace_region(self.workspace, pose))
        half = 0.5 * self.cube.edge
        return Box(*(placed_pose(pose, self.cube.center + side * half) for side in (-1.0, 1.0)))

    def worst(
        self, of: Callable[[Design, Array], Array], sign: float, *, fine: bool = False
    ) -> float:
        """Return the maximum of `of(design, poses)` over the workspace; the minimum if sign = -1.

        The function is evaluated at the sampled poses, then at ever closer neighbours of the worst
        of them; the result is NaN if it is NaN at a sampled pose.
        """
        poses = self.fine_poses if fine else self.poses
        signed = sign * of(self, poses)
        if np.isnan(signed).any():
            return np.nan
        starts = np.argsort(signed, kind="stable")[-_STARTS:]
        worst, most = poses[starts], signed[starts]
        regions = [self.region(pose) for pose in worst]
        low, high = np.stack([region.box for region in regions], axis=1)
        offsets = _neighbours((high > low).any(axis=0), self.robot.platform.angular)
        step = (high - low) / self._samples
        for _ in range(_ROUNDS if self.refined else 0):
            step = step / 2.0
            around = np.clip(worst[:, None] + step[:, None] * offsets, low[:, None], high[:, None])
            for region, pose, neighbours in zip(regions, worst, around, strict=True):
                if isinstance(region, OrientedRegion):
                    region.onto_cone(neighbours)
                neighbours[~region.holds(neighbours)] = pose
            nearby = sign * of(self, around.reshape(-1, self.robot.freedom))
            nearby = np.nan_to_num(nearby, nan=-np.inf).reshape(len(worst), -1)
            best = nearby.argmax(axis=1)
            here = np.arange(len(worst))
            better = nearby[here, best] > most
            worst = np.where(better[:, None], around[here, best], worst)
            most = np.maximum(most, nearby[here, best])
        return sign * float(most.max())

    @cached_property
    def cycles(self) -> tuple[Motion, ...]:
        """The motions of the task's cycles, placed about the middle of the workspace."""
        spec, middle = self.task.spec, self.task.stated_poses[0].copy()
        lengths = len(self.robot.platform.lengths)
        ends = None if self.workspace is None else np.array(self.workspace.ends)
        if ends is not None:
            middle[:lengths] = ends.mean(axis=0)
        elif any(cycle.scale for cycle in spec.cycles):
            middle[:lengths] = self.cube.center
        return tuple(
            table.motion(self.robot, middle, spec.motion.acceleration) for table in spec.cycles
        )

    @cached_property
    def cycle_loads(self) -> Sizing:
        """The loads on the drives (a `Sizing`) over all cycles in sequence, with the payload.

        A cycle that may be done anywhere is evaluated at all its places and turns in the workspace.
        """
        cycles, pose = self.task.spec.cycles, self.task.stated_poses[0]
        anywhere = self.workspace is not None and any(cycle.anywhere for cycle in cycles)
        return size(
            self.loaded_robot,
            self.cycles,
            dwell=[cycle.dwell for cycle in cycles],
            places=workspace_region(self.workspace, pose) if anywhere and self.workspace else None,
        )

    @cached_property
    def _sides(self) -> dict[float, float]:
        """The least condition over the workspace (< 0: infeasible), by type-II sign."""
        rows_by_side = {}
        for side in self.task.conditions.sides:
            rows = self.task.conditions.rows(self.geometry, self.poses, side)
            least = float(np.nanmin(rows))
            # A row that is NaN fails, though not as clearly as one that says by how much.
            rows_by_side[side] = min(least, UNKNOWN) if np.isnan(rows).any() else least
        return rows_by_side

    @property
    def side(self) -> float:
        """The sign (1 or -1) of the type-II singularity measure in the workspace."""
        if self.workspace is None or self.task.floats:
            return self.cube.side
        return max(self._sides, key=self._sides.__getitem__)

    @property
    def scale(self) -> float:
        """Largest factor by which the workspace that floats can be scaled in this design."""
        return self.cube.edge / self.task.shape[1]

    @property
    def margin(self) -> float:
        """The least condition over the workspace; below 0 where a pose is infeasible.

        If a workspace that floats does not fit, it is the share of the workspace that does not fit,
        negative.
        """
        if self.workspace is None:
            return self.cube.margin
        if self.task.floats and self.scale < 1.0 - ROUNDING:
            return self.scale - 1.0 + (min(self.cube.margin, 0.0) if self.scale == 0.0 else 0.0)
        return min(self._sides[self.side], self.least)

    reserve = former_attribute("reserve", "margin")
    carrying = former_attribute("carrying", "loaded_robot")
    lack = former_attribute("lack", "missing_reason")
    reached = former_attribute("reached", "is_reachable")
    sizing = former_attribute("sizing", "cycle_loads")

    start_strokes = former_attribute("start_strokes", "reference_strokes")

    def quantity(self, name: str) -> float:
        """Return the value of the quantity `name`; NaN where undefined, see `missing_reason`."""
        return self._quantities(name)[0]

    def missing_reason(self, name: str) -> str:
        """Return the reason why the quantity `name` is undefined; empty where it is defined."""
        return self._quantities(name)[1]

    def cover(self, name: str) -> str:
        """Return in words the number of sample poses, or the proof, that the quantity rests on."""
        kind = self.task.quantities[name].cover
        times, places = 0, str(len(self.fine_poses if kind == "fine" else self.poses))
        if kind == "cycles":
            times = sum(2 * len(motion.time) - 1 for motion in self.cycles)
            several = () if name == "cycle_time" else self.cycle_loads.places
            places = f", at {len(several)} places and turns" if several else ""
        words = COVERS[kind].format(times=times, places=places)
        floor = dict(self.task.floors).get(name)
        return f"{words}; the proof is of at least {floor:.12g}" if floor else words

    @property
    def is_reachable(self) -> bool:
        """Whether all sample poses of the workspace, or the cube, are in reach."""
        return bool(np.isfinite(self.joints).all())

    @cached_property
    def _known_quantities(self) -> dict[str, tuple[float, str]]:
        """Values computed so far, by quantity name: (value, reason if undefined)."""
        return {}

    def _quantities(self, name: str) -> tuple[float, str]:
        """Return (value, reason if undefined) of the quantity `name`, computed at most once."""
        if name not in self._known_quantities:
            self._known_quantities[name] = self._evaluate_quantity(name)
        return self._known_quantities[name]

    def _evaluate_quantity(self, name: str) -> tuple[float, str]:
        """Compute (value, reason if undefined) of the quantity `name`."""
        quantity = self.task.quantities[name]
        if quantity.of_machine is not None:
            return self._evaluate_machine(quantity.of_machine)
        if name in ("cube", "scale"):
            return float(quantity.of(self)), ""
        nowhere = self.cube.edge <= 0.0 if self.task.seeks_place else False
        if nowhere and (self.workspace is None or self.task.floats):
            return np.nan, "there is no cube" if self.workspace is None else "it fits nowhere"
        try:
            with sharing_programs(self.task.robot):
                amount = float(quantity.of(self))
        except PteronError as error:
            where = "in a cycle, " if quantity.cover == "cycles" else ""
            return np.nan, f"{where}{error}"
        if not np.isnan(amount):
            return amount, ""
        out = int((~np.isfinite(self.joints).all(axis=-1)).sum())
        where = f"{out} of {len(self.poses)} sampled poses are out of reach"
        return np.nan, where if out else "it has none at some sampled pose: a singularity"

    def _evaluate_machine(self, of_machine: Callable[[Manipulator], float]) -> tuple[float, str]:
        """Return (`of_machine(robot)`, ''); (NaN, the reason) if it raises or is not finite."""
        try:
            amount = float(of_machine(self.robot))
        except PteronError as error:
            return np.nan, str(error)
        return amount, "" if np.isfinite(amount) else f"its function gives {amount}"

    @cached_property
    def strokes(self) -> Array:
        """The travel of each joint (n,) over `self.poses`, m or rad."""
        return np.asarray(np.ptp(self.joints, axis=0))

    @property
    def reference_strokes(self) -> Array:
        """Reference travels (n,), m or rad: the limits' width, else the initial machine's."""
        widths = np.ptp(joint_limits(self.task.robot), axis=0)
        endless = np.isinf(widths)
        return np.where(endless, _start(self.task).strokes, widths) if endless.any() else widths


def _neighbours(varies: NDArray[np.bool_], angular: NDArray[np.bool_]) -> Array:
    """Return steps (S, m), each -1, 0 or 1, to neighbours in places or in angles, not in both."""
    steps = np.zeros((0, len(varies)))
    for free in (varies & ~angular, varies & angular):
        part = np.zeros((3 ** int(free.sum()), len(varies)))
        part[:, free] = list(product((-1.0, 0.0, 1.0), repeat=int(free.sum())))
        steps = np.vstack([steps, part])
    return steps


@lru_cache(maxsize=8)
def _start(task: Task) -> Design:
    """Return the design of the task's initial machine, cached by task."""
    return Design(task, task.robot)
