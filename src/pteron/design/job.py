"""The file of a task for `choose_machine`, with the checks across its tables."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Self

import numpy as np
from pydantic import Field, PrivateAttr, field_validator, model_validator

from pteron.bodies.tables import Three, TomlTable, key
from pteron.design.kinds import KINDS
from pteron.design.load_tables import Names, default_table
from pteron.design.requirement_tables import (
    AccuracyTable,
    BodyFloorsTable,
    BoundTable,
    DriveListsTable,
    KindSearchTable,
    LimitsTable,
    LinksTable,
    LoadTable,
    ProcessTable,
    RequiredMotionTable,
    StiffnessTable,
    ToolCycleTable,
)
from pteron.design.workspace_tables import CellTable, KeepOutTable, ToolWorkspaceTable
from pteron.errors import DataError, shorten
from pteron.toml import read_toml, to_model

_ABSENT = "no such file; it should describe what a machine must do"
"""The message where the file is missing."""

_HEAVIEST = 2000.0
"""Payload, kg, from which it was probably given in grams."""

_FARTHEST = 5.0
"""Distance of the payload's centre of mass from P, m, from which it was probably given in mm."""

_SLOWEST, _FASTEST = 0.002, 20.0
"""Mean speed of a cycle, m/s, below and above which times were probably given in another unit."""

_SHARPEST = 1000.0
"""Acceleration, m/s^2, from which it was probably given in mm/s^2."""

_LONGEST = 60.0
"""Rest after a cycle over its duration, and in s, beyond which it was probably given in ms."""

OBJECTIVES = {
    "price": "",
    "rated_power": "W",
    "moving_mass": "kg",
    "energy": "J",
    "cycle_time": "s",
    "footprint": "m^2",
    "height": "m",
}
"""The objectives that a machine can be chosen for, less being better, with units."""


def _expect_names_once(names: list[str], known: Collection[str]) -> list[str]:
    """Return the names; raise where a name is not among `known` or occurs twice."""
    for k, name in enumerate(names):
        if name not in known:
            raise ValueError(f"{shorten(name)} is none of {', '.join(known)}")
        if name in names[:k]:
            raise ValueError(f"{shorten(name)} given twice")
    return names


class Job(TomlTable):
    """A job that a machine must do, as its file has it."""

    workspace: ToolWorkspaceTable
    payload: LoadTable = default_table(LoadTable)
    cycles: list[ToolCycleTable] = Field(default_factory=list)
    motion: RequiredMotionTable = Field(
        default_factory=lambda: RequiredMotionTable.model_validate({})
    )
    gravity: Three = key(
        "m/s^2, in the frame of the workspace; [0, -9.81, 0] for a machine on a wall, "
        "[0, 0, 9.81] for one turned upside down",
        (0.0, 0.0, -9.81),
    )
    process: ProcessTable | None = None
    limits: LimitsTable = default_table(LimitsTable)
    accuracy: AccuracyTable | None = None
    stiffness: StiffnessTable | None = None
    cell: CellTable = default_table(CellTable)
    keep_out: list[KeepOutTable] = Field(default_factory=list)
    motors: DriveListsTable = default_table(DriveListsTable)
    links: LinksTable = default_table(LinksTable)
    floors: BodyFloorsTable = default_table(BodyFloorsTable)
    most: BoundTable = default_table(BoundTable)
    kinds: Names | None = key("to choose from; else all that can do it", None)
    objectives: Names = key(f"what is to be small: {', '.join(OBJECTIVES)}", ["price"])
    search: KindSearchTable = default_table(KindSearchTable)

    _folder: Path = PrivateAttr(Path())

    @field_validator("objectives")
    @classmethod
    def _known_objectives(cls, names: list[str]) -> list[str]:
        """Return the objectives' names; raise where one is unknown or occurs twice."""
        return _expect_names_once(names, OBJECTIVES)

    @field_validator("kinds")
    @classmethod
    def _known_kinds(cls, names: list[str] | None) -> list[str] | None:
        """Return the names of kinds of machine; raise where one is unknown or occurs twice."""
        return names and _expect_names_once(names, KINDS)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        """Return the job; raise an error that lists every contradiction between its tables."""
        faults = list(self._faults())
        if faults:
            raise ValueError("; ".join(faults))
        return self

    def _faults(self) -> Iterator[str]:
        """Yield sentences on the contradictions between the job's tables."""
        if not self.cycles and not self.motion.acceleration:
            yield "no [[cycles]] and no [motion] acceleration: nothing says what the motors must do"
        if self.free and "cycle_time" not in self.objectives and self.most.cycle_time is None:
            yield (
                'cycles: one without duration needs objectives = ["cycle_time"], or [most] '
                "cycle_time"
            )
        if "cycle_time" in self.objectives and not self.free:
            yield "objectives: cycle_time, but every cycle has its duration; leave one out"
        if self.workspace.poses is not None and len(set(self.workspace.poses)) == 1:
            yield (
                "workspace: poses: one pose given, at least two expected: what works at one pose "
                "is a fixture"
            )
        yield from self._unit_faults()
        for k, cycle in enumerate(self.cycles, start=1):
            yield from (f"cycles[{k}]: {text}" for text in self._cycle_faults(cycle))
        if 0 < sum(cycle.share is None for cycle in self.cycles) < len(self.cycles):
            yield "cycles: share given of some; give each its share, or none"
        if (self.cell.low is None) != (self.cell.high is None):
            yield "cell: low and high go together"
        elif self.cell.low is not None and not (np.array(self.cell.low) < self.cell.high).all():
            yield f"cell: low {list(self.cell.low)} is not below high {list(self.cell.high or ())}"
        elif self.cell.low is not None and self.workspace.center is None:
            yield (
                "cell: low and high need [workspace] center; of a workspace that floats give "
                "footprint and height"
            )
        else:
            yield from self._room_faults()

    def _unit_faults(self) -> Iterator[str]:
        """Yield sentences on numbers that are off by a factor of a thousand."""
        payload, motion = self.payload, self.motion
        if payload.mass > _HEAVIEST:
            yield f"payload: mass: {payload.mass:g} kg given: is this in grams?"
        if payload.center is not None and np.linalg.norm(payload.center) > _FARTHEST:
            yield f"payload: center: {list(payload.center)} m given: are these mm?"
        if motion.speed > _FASTEST:
            yield f"motion: speed: {motion.speed:g} m/s given: is this in mm/s?"
        if motion.acceleration > _SHARPEST:
            yield f"motion: acceleration: {motion.acceleration:g} m/s^2 given: is this in mm/s^2?"
        for k, cycle in enumerate(self.cycles, start=1):
            if cycle.duration is None or len({len(point) for point in cycle.points}) > 1:
                continue
            points = np.array(cycle.points)[:, : self.lengths]
            length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum() * (1 + cycle.back)
            speed = float(length) / cycle.duration
            if 0.0 < speed < _SLOWEST:
                yield (
                    f"cycles[{k}]: duration: {cycle.duration:g} s given for "
                    f"{1e3 * float(length):.4g} mm: is this in ms?"
                )
            if speed > _FASTEST:
                yield (
                    f"cycles[{k}]: duration: {cycle.duration:g} s given for "
                    f"{1e3 * float(length):.4g} mm, {speed:.3g} m/s"
                )
            if cycle.dwell > _LONGEST * cycle.duration + _LONGEST:
                yield f"cycles[{k}]: dwell: {cycle.dwell:g} s given: is this in ms?"

    def _room_faults(self) -> Iterator[str]:
        """Yield sentences on contradictions between the permitted space and the workspace."""
        cell, space = self.cell, self.workspace
        sides, margin = 2.0 * (space.half + cell.margin), cell.margin
        at, body = np.array(space.center or (0.0, 0.0, 0.0)), f"with {1e3 * margin:g} mm about it"
        if cell.footprint is not None and (sides[:2] > cell.footprint).any():
            footprint = " x ".join(f"{1e3 * x:g}" for x in cell.footprint)
            yield (
                f"cell: a footprint of {footprint} mm has no room for the workspace "
                f"{body}, {' x '.join(f'{1e3 * x:g}' for x in sides[:2])} mm"
            )
        if cell.height is not None and sides[2] > cell.height:
            yield (
                f"cell: a height of {1e3 * cell.height:g} mm has no room for the workspace "
                f"{body}, {1e3 * sides[2]:g} mm"
            )
        if cell.low is not None and cell.high is not None:
            low, high = at - space.half - margin, at + space.half + margin
            for i in np.flatnonzero((low < cell.low) | (high > cell.high)):
                yield (
                    f"cell: along {'xyz'[i]} it goes from {cell.low[i]:g} to {cell.high[i]:g} m, "
                    f"and the workspace {body} from {low[i]:g} to {high[i]:g} m"
                )
        for k, box in enumerate(self.keep_out, start=1):
            if space.meets(np.array(box.low) - at - margin, np.array(box.high) - at + margin):
                yield f"keep_out[{k}]: it is in the workspace {body}, where the tool must be"

    def _cycle_faults(self, cycle: ToolCycleTable) -> Iterator[str]:
        """Yield sentences on contradictions between a tool cycle and the workspace."""
        space, k = self.workspace, self.lengths
        sizes = {len(point) for point in cycle.points}
        known = {2: "x y", 3: "x y z"}[k]
        if len(sizes) > 1 or not sizes <= {k, k + 1, k + 3 * (k == 3)}:
            tilting = f", or {known} roll pitch yaw" if k == 3 else ""
            yield (
                f"points of {' and '.join(map(str, sorted(sizes)))} numbers given, {known} "
                f"expected, as of the workspace, or {known} turn{tilting}"
            )
            return
        if any(a == b for a, b in pairwise(cycle.points)):
            yield "two points that follow each other are the same"
        angles = np.array(cycle.points)[:, k:]
        if not angles.any():
            return
        low, high = float(angles[:, -1].min()), float(angles[:, -1].max())
        allowed = space.turn or (0.0, 0.0)
        if low < allowed[0] or high > allowed[1]:
            range_text = "not given" if space.turn is None else f"{list(space.turn)}"
            yield (
                f"it turns from {low:g} to {high:g} rad, and [workspace] turn is {range_text}; "
                f"at least [{min(low, 0.0):g}, {max(high, 0.0):g}] is needed"
            )
        tilt = float(np.arccos(np.cos(angles[:, :-1]).prod(axis=1)).max())
        if tilt > (space.tilt or 0.0) + 1e-9:
            range_text = "not given" if space.tilt is None else f"{space.tilt:g}"
            yield f"it tilts by {tilt:.4g} rad, and [workspace] tilt is {range_text}; give so much"

    @property
    def lengths(self) -> int:
        """The number of the workspace's length coordinates, 2 (x y) or 3 (x y z)."""
        if self.workspace.radius is not None:
            return 3
        return len(self.workspace.size or (self.workspace.poses or [()])[0])

    @property
    def free(self) -> bool:
        """Whether some cycle has no prescribed duration, so that it is run as fast as possible."""
        return any(cycle.duration is None for cycle in self.cycles)

    def file(self, name: str) -> Path:
        """Return the path of a file that the job names: beside the job's file if it is there."""
        beside = self._folder / name
        return beside if beside.exists() else Path(name)

    def requirement_lines(self) -> list[str]:
        """Return the job's requirements as lines of text."""
        space, lines = self.workspace, []
        lines.append(space.words)
        if space.turn is not None:
            lines.append(f"turn from {space.turn[0]:g} to {space.turn[1]:g} rad")
        if space.tilt is not None:
            lines.append(f"tilt of {space.tilt:g} rad in all directions")
        if space.directions is not None:
            lines.append(f"{len(space.directions)} directions of the platform")
        if any(self.payload.tool):
            lines.append(
                f"tool at {' x '.join(f'{1e3 * x:g}' for x in self.payload.tool)} mm from P"
            )
        if self.gravity != (0.0, 0.0, -9.81):
            lines.append(f"gravity {' '.join(f'{x:g}' for x in self.gravity)} m/s^2")
        if self.payload.mass:
            lines.append(f"payload {self.payload.mass:g} kg")
        for k, cycle in enumerate(self.cycles, start=1):
            time = "as fast as possible" if cycle.duration is None else f"in {cycle.duration:g} s"
            where = ", anywhere in the workspace" if cycle.anywhere else ""
            share = "" if cycle.share is None else f", {cycle.share:g} in a duty cycle"
            lines.append(f"{cycle.name or f'cycle {k}'} {time}{where}{share}")
        if self.motion.acceleration:
            speed = f"at up to {self.motion.speed:g} m/s in any direction"
            lines.append(f"{self.motion.acceleration:g} m/s^2 {speed}")
        if self.process is not None:
            lines.append(f"process force of {self.process.force:g} N in any direction")
        if self.accuracy is not None:
            lines.append(f"tool within {1e3 * self.accuracy.most:g} mm ({self.accuracy.counted})")
        if self.stiffness is not None:
            limit = f"{1e3 * self.stiffness.most:g} mm"
            lines.append(f"deflection of at most {limit} under {self.stiffness.force:g} N")
        if self.cell.footprint is not None:
            lines.append(f"footprint {' x '.join(f'{x:g}' for x in self.cell.footprint)} m")
        lines += [f"height {self.cell.height:g} m"] if self.cell.height is not None else []
        if self.cell.low is not None and self.cell.high is not None:
            lines.append(f"cell {_box(self.cell.low, self.cell.high)} m")
        lines += [f"no part of it in {_box(box.low, box.high)} m" for box in self.keep_out]
        floors = {
            "type_i": "type-I measure",
            "type_ii": "type-II measure",
            "clearance": "clearance (m)",
        }
        for name in sorted(self.floors.model_fields_set):
            lines.append(f"{floors[name]} at least {getattr(self.floors, name):g}")
        bounds = self.most.model_dump(exclude_none=True)
        lines += [f"{name.replace('_', ' ')} at most {bound:g}" for name, bound in bounds.items()]
        names = " and ".join(name.replace("_", " ") for name in self.objectives)
        return [*lines, f"smallest {names}"]


def read_job(path: str | Path) -> Job:
    """Read a job (what a machine must do) from a TOML file.

    Raises
    ------
    DataError
        If it cannot be read, has unknown keys or contradicts itself; all its faults are listed.
    """
    source = shorten(str(path), bare=True, longest=1000)
    job = to_model(Job, read_toml(path, DataError, _ABSENT), source, DataError)
    job._folder = Path(path).parent
    return job


def _box(low: Sequence[float], high: Sequence[float]) -> str:
    """Return the ranges of a box as text: "low..high x low..high"."""
    return " x ".join(f"{a:g}..{b:g}" for a, b in zip(low, high, strict=True))
