"""The task of a design search: its file, checked against the machine that it begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pteron.design.quantities import DesignQuantity, quantities
from pteron.design.regions import oriented_region, sampled_orientations, workspace_shape
from pteron.design.spec import FloorsTable, Spec
from pteron.design.spec_faults import spec_faults
from pteron.design.user_quantities import code_digest
from pteron.design.variables import Variable, move_variables, variables_of
from pteron.errors import DataError, ModelError, warn_unlikely
from pteron.kernels import Array, Kernel, compile
from pteron.manipulator import Manipulator, load
from pteron.manipulator.saving import text_of
from pteron.maps.plan import RESULTS
from pteron.motion import Motor, read_motors
from pteron.motion.payload import payload_warning
from pteron.renamed import former_attribute
from pteron.toml import joined_faults
from pteron.workspace import Region
from pteron.workspace.conditions import conditions
from pteron.workspace.shape_samples import Shape, cube
from pteron.workspace.smooth_conditions import SmoothConditions, smooth_conditions

if TYPE_CHECKING:
    import polars as pl

_DEFINITION = (
    "worst values about the sampled poses too, workspaces that float placed for the objective"
)
"""Where quantities are taken, in a search's plan: one that took them elsewhere is not resumed."""


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
    motors : tuple of Motor
        The motors to choose from, if it lists any.
    """

    spec: Spec
    robot: Manipulator
    variables: tuple[Variable, ...]
    motors: tuple[Motor, ...] = ()

    @classmethod
    def from_spec(cls, spec: Spec) -> Task:
        """Return the task of a design search: the specification with machine, variables, motors.

        Raises
        ------
        ModelError
            If there is no such machine.
        DataError
            If the search does not suit the machine; all its faults are listed.
        """
        robot = load(spec.robot)
        faults = list(spec_faults(spec, robot))
        variables: tuple[Variable, ...] = ()
        motors: tuple[Motor, ...] = ()
        try:
            variables = variables_of(robot, spec.variables)
        except ModelError as error:
            faults = [*error.faults, *faults]
        try:
            motors = () if spec.motors is None else read_motors(spec.motors.file)
        except DataError as error:
            faults.append(f"motors: {error}")
        if faults:
            raise DataError(joined_faults(faults), subject=spec.source)
        payload = spec.payload
        if payload and (text := payload_warning(robot, payload.mass, payload.center)):
            warn_unlikely(text)
        return cls(spec, robot, variables, motors)

    def __getstate__(self) -> dict[str, Any]:
        # It crosses to other processes, which compile for themselves.
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def plan(self) -> dict[str, Any]:
        """Plain data that results depend on: specification, machine, versions.

        Stored rows are reused only while this data is unchanged.
        """
        spec = self.spec.model_dump(mode="json", exclude={"robot"}, exclude_none=True)
        spec = {key: part for key, part in spec.items() if part != [] or key == "requirements"}
        plan: dict[str, Any] = {"robot": text_of(self.robot), "spec": spec, "pteron": RESULTS}
        plan["definition of its quantities"] = _DEFINITION
        if self.motors:
            plan["motors"] = [vars(motor) for motor in self.motors]
        if quantities := self.spec.user_quantities:
            plan["user's quantities"] = {name: code_digest(q) for name, q in quantities.items()}
        return plan

    @cached_property
    def quantities(self) -> dict[str, DesignQuantity]:
        """All design quantities by name: the package's and the user's own."""
        return quantities() | self.spec.user_quantities

    @cached_property
    def floors(self) -> FloorsTable:
        """Required singularity measures of every pose: the greater of floors and requirements."""
        measures = dict(self.spec.floors)
        for requirement in self.spec.requirements:
            if (
                requirement.quantity in measures
                and requirement.least is not None
                and requirement.least < 1.0
            ):
                measures[requirement.quantity] = max(
                    measures[requirement.quantity], requirement.least
                )
        return FloorsTable(**measures)

    @property
    def floats(self) -> bool:
        """Whether the required workspace has no fixed place, but is placed anew in every design."""
        return self.spec.workspace is not None and self.spec.workspace.floats

    @cached_property
    def shape(self) -> tuple[Shape, float]:
        """The shape to be enlarged in each design, and the required edge, m; 0 for none.

        The shape is the workspace if that floats, else the cube.
        """
        count = len(self.robot.platform.lengths)
        if self.spec.workspace is not None and self.floats:
            return workspace_shape(self.spec.workspace, count)
        return cube(count), 0.0

    @cached_property
    def conditions(self) -> SmoothConditions:
        """The feasibility conditions at a pose, as functions of the machine's geometry."""
        floors = self.floors
        required = conditions(self.robot, type_i=floors.type_i, type_ii=floors.type_ii)
        return smooth_conditions(self.robot, required)

    @cached_property
    def orientations(self) -> Array:
        """Poses (A, m) with sampled orientations of the search; their positions do not count."""
        return sampled_orientations(self.spec.workspace, self.robot.platform, self.stated_poses)

    @cached_property
    def stated_poses(self) -> Array:
        """Poses (B, m) with the orientations that the file states; ranges are about them."""
        spec, angular = self.spec, self.robot.platform.angular
        pose = np.zeros(len(angular)) if spec.pose is None else np.array(spec.pose)
        if spec.angles is None:
            return pose[None]
        return np.where(angular, np.array(spec.angles)[:, None], pose)

    @property
    def has_ranges(self) -> bool:
        """Whether the workspace has ranges of orientations, all of which are to be proved."""
        return self.spec.workspace is not None and self.spec.workspace.has_ranges

    def oriented_region(self, places: Region, share: float = 1.0) -> Region:
        """Return a region of places at all orientations of the ranges, these scaled by `share`."""
        return oriented_region(places, self.spec.workspace, self.robot.platform, share)

    @property
    def quantity_names(self) -> tuple[str, ...]:
        """The quantities that objectives and requirements name, each once."""
        return self.spec.quantity_names

    asked = former_attribute("asked", "quantity_names")
    of = former_attribute("of", "from_spec")

    @property
    def seeks_cube(self) -> bool:
        """Whether the largest feasible cube of each design is computed."""
        return "cube" in self.quantity_names or self.spec.workspace is None

    @property
    def seeks_place(self) -> bool:
        """Whether each design has a shape to be placed: the largest cube, or the workspace."""
        return self.seeks_cube or self.floats

    @cached_property
    def place_quantities(self) -> tuple[str, ...]:
        """The quantities for which a workspace that floats is placed: those that depend on it.

        There are none where its place is fixed, or is where it could be largest, for `scale`.
        """
        names = self.quantity_names if self.floats and "scale" not in self.quantity_names else ()
        return tuple(n for n in names if self.quantities[n].cover not in ("machine", "proved"))

    @property
    def ranges(self) -> Array:
        """Lower and upper bounds of the design variables, (2, V)."""
        return np.array([(v.low, v.high) for v in self.variables]).T

    @property
    def start(self) -> Array:
        """The design variables of the initial machine (V,), clipped to their bounds."""
        return np.clip([v.start for v in self.variables], *self.ranges)

    def costs(self, designs: pl.DataFrame) -> Array:
        """Return the costs (N, M) of a table of designs: objectives, negated if maximised."""
        signs = [o.sign for o in self.spec.objectives]
        names = [o.quantity for o in self.spec.objectives]
        return np.asarray(designs.select(names).to_numpy() * signs)

    def points(self, designs: pl.DataFrame) -> Array:
        """Return the design variables (N, V) from a table of designs."""
        return np.asarray(designs.select([v.name for v in self.variables]).to_numpy())

    def unit(self, name: str) -> str:
        """Return the unit of the quantity `name`, for this machine's joints."""
        joint = self.robot.legs[0].joint
        force, speed = joint.force_unit, f"{joint.unit}/s"
        units = {"force": force, "cycle_force": force, "speed": speed, "cycle_speed": speed}
        return units.get(name, self.quantities[name].unit)

    def function(self, what: str) -> Kernel:
        """Return the compiled kernel `what` of the machine's topology; geometry is an input."""
        return compile(self.robot, what, grade="general")

    def machine(self, point: Sequence[float]) -> Manipulator:
        """Return the machine with the design variables `point` (V,).

        Raises
        ------
        ModelError
            If there can be none.
        """
        stretch = self.spec.masses == "per length"
        return move_variables(self.robot, self.variables, point, stretch=stretch)
