"""The task of a design search: its file, checked against the machine that it begins with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from pteron.design.quantities import quantities
from pteron.design.region import workspace_poses
from pteron.design.spec import Spec
from pteron.design.variables import Variable, moved, variables_of
from pteron.errors import DataError, ModelError
from pteron.indices import INDICES
from pteron.kernels import Array, Kernel, compile
from pteron.kinematics.unlikely_values import unlikely_values
from pteron.manipulator import Manipulator, load
from pteron.manipulator.saving import text_of
from pteron.maps.plan import RESULTS
from pteron.toml import told
from pteron.workspace.conditions import conditions
from pteron.workspace.smooth_conditions import SmoothConditions, smooth_conditions


@dataclass(frozen=True, eq=False)
class Task:
    """A search: its file, the machine that it begins with, and the variables.

    Attributes
    ----------
    spec : Spec
        Its file.
    robot : Manipulator
        The machine to begin with.
    variables : tuple of Variable
        The variables.
    """

    spec: Spec
    robot: Manipulator
    variables: tuple[Variable, ...]

    @classmethod
    def of(cls, spec: Spec) -> Task:
        """Return the task of a search.

        Raises
        ------
        ModelError
            If there is no such machine.
        DataError
            If the search does not suit the machine; all its faults are listed.
        """
        robot = load(spec.robot)
        if not robot.platform.lengths:
            raise ModelError(
                f"a {robot.platform.motion} platform only turns, but a design is for places: it "
                "needs one that moves",
                subject=robot.name,
            )
        faults = list(_misfits(spec, robot))
        variables: tuple[Variable, ...] = ()
        try:
            variables = variables_of(robot, spec.variables)
        except ModelError as error:
            faults = [*error.faults, *faults]
        if faults:
            raise DataError(told(faults), subject=spec.source)
        return cls(spec, robot, variables)

    def __getstate__(self) -> dict[str, Any]:
        # It crosses to other processes, which compile for themselves.
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @property
    def plan(self) -> dict[str, Any]:
        """All that its results depend on: the spec, the machine, and the version of results."""
        spec = self.spec.model_dump(mode="json", exclude={"robot"})
        return {"robot": text_of(self.robot), "spec": spec, "pteron": RESULTS}

    @cached_property
    def conditions(self) -> SmoothConditions:
        """The conditions at every pose, as functions of the geometry."""
        floors = self.spec.floors
        given = conditions(self.robot, type_i=floors.type_i, type_ii=floors.type_ii)
        return smooth_conditions(self.robot, given)

    @cached_property
    def orientations(self) -> Array:
        """Poses (A, m) whose angles are those that the search asks for."""
        spec, angular = self.spec, self.robot.platform.angular
        pose = np.zeros(len(angular)) if spec.pose is None else np.array(spec.pose)
        if spec.angles is None:
            return pose[None]
        return np.where(angular, np.array(spec.angles)[:, None], pose)

    @property
    def asked(self) -> tuple[str, ...]:
        """The quantities that objectives and requirements name, each once."""
        spec = self.spec
        given = [*(o.quantity for o in spec.objectives), *(r.quantity for r in spec.requirements)]
        return tuple(dict.fromkeys(given))

    @property
    def seeks_cube(self) -> bool:
        """Whether the largest cube of each design is looked for."""
        return "cube" in self.asked or self.spec.workspace is None

    @property
    def ranges(self) -> Array:
        """Least and greatest value of each variable, (2, V)."""
        return np.array([(v.low, v.high) for v in self.variables]).T

    @property
    def start(self) -> Array:
        """The variables' values in the machine to begin with (V,), moved into their ranges."""
        return np.clip([v.start for v in self.variables], *self.ranges)

    def unit(self, name: str) -> str:
        """Return the unit of a quantity, for this machine's joints."""
        joint = self.robot.legs[0].joint
        return {"force": joint.force_unit, "speed": f"{joint.unit}/s"}.get(
            name, quantities()[name].unit
        )

    def function(self, what: str) -> Kernel:
        """Return a function of the machines' topology, whose geometry a call gives."""
        return compile(self.robot, what, grade="general")

    def machine(self, values: Sequence[float]) -> Manipulator:
        """Return the machine of a design.

        Raises
        ------
        ModelError
            If there can be none.
        """
        stretch = self.spec.masses == "per length"
        return moved(self.robot, self.variables, values, stretch=stretch)


def _misfits(spec: Spec, robot: Manipulator) -> Iterator[str]:
    """Yield the faults for which a search does not suit its machine."""
    if spec.pose is not None and len(spec.pose) != robot.freedom:
        yield f"pose: {len(spec.pose)} numbers given, {' '.join(robot.coordinates)} expected"
    if spec.angles is not None and len(robot.platform.angles) != 1:
        turns = "tilts: give its orientation in pose" if robot.platform.tilts else "does not turn"
        yield f"angles: given, but the platform of {robot.name} {turns}; leave it out"
    lengths = robot.platform.lengths
    if spec.workspace is not None and spec.workspace.lengths != len(lengths):
        yield (
            f"workspace: {spec.workspace.lengths} coordinates given, {' '.join(lengths)} of "
            f"{robot.name} expected"
        )
    elif spec.workspace is not None and spec.workspace.shape == "cylinder" and len(lengths) < 3:
        yield f"workspace: a cylinder given, but {robot.name} moves in a plane; give a box"
    elif spec.workspace is not None:
        corners = workspace_poses(spec.workspace, np.zeros((1, robot.freedom)), samples=2)
        for warning in unlikely_values(robot, robot.coordinates, corners):
            yield f"workspace: {warning}"
    for warning in unlikely_values(
        robot, robot.platform.angles[:1], np.array(spec.angles or ())[:, None]
    ):
        yield f"angles: {warning}"
    asked = {o.quantity for o in spec.objectives} | {r.quantity for r in spec.requirements}
    units = {leg.joint.force_unit for leg in robot.legs}
    for name in sorted(asked & {"force", "speed"}):
        if len(units) > 1:
            yield (
                f"{name}: the joints of {robot.name} have unlike units; ask for drive_load, whose "
                "limits the machine's file gives"
            )
    for name in sorted(asked & INDICES.keys()):
        if INDICES[name].turning and not robot.platform.angles:
            yield f"{name}: about turning, but the platform of {robot.name} does not turn"
    drives = [leg.drive for leg in robot.legs if leg.drive is not None]
    if "drive_load" in asked and not any(d.max_force or d.max_speed for d in drives):
        yield f"drive_load: no drive of {robot.name} has max_force or max_speed; ask for force"
    named = [o.quantity for o in spec.objectives]
    for name in sorted({name for name in named if named.count(name) > 1}):
        yield f"objectives: {name} given more than once"
    assert asked <= quantities().keys()  # the spec has checked them
