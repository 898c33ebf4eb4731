"""The report of a search: a page in Markdown, its figures as data, and the designs' files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pteron.design.cycle_loads import best_motors
from pteron.design.design import Design
from pteron.design.differences import (
    Change,
    geometry_changes,
    mass_changes,
    quantity_changes,
    stroke_words,
)
from pteron.design.front import Front
from pteron.design.proofs import Proved, is_sampled, place_words, prove_design, workspace_share
from pteron.design.task import Task
from pteron.manipulator import Manipulator
from pteron.manipulator.machine_record import machine_record
from pteron.manipulator.names import LONGEST_NAME
from pteron.manipulator.saving import text_of
from pteron.motion import MotorFit
from pteron.renamed import former_attribute
from pteron.result import Result

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, eq=False, repr=False)
class ReportedDesign(Proved):
    """One machine of a search, with the proofs about it.

    Attributes
    ----------
    name : str
        "start", "best-cube", "compromise", ...
    """

    ROWS = "changes"

    name: str

    @property
    def changes(self) -> list[Change]:
        """Quantities, geometric numbers and masses that differ from the initial machine's."""
        task, robot = self.design.task, self.design.robot
        geometry, masses = geometry_changes(task, robot), mass_changes(task, robot)
        return [*quantity_changes(self.design), *geometry, *masses]

    @property
    def proofs(self) -> list[str]:
        """The proved statements about cube and workspace, a sentence each."""
        lines, task = [], self.design.task
        if task.seeks_cube:
            lines.append("cube: not proved" if self.cube is None else f"cube {self.cube.words}")
        if task.floats:
            lines.append(self._place)
        sampled = is_sampled(task, self.workspace)
        for proof in self.workspace[-1:] if sampled else self.workspace:
            share = workspace_share(self.design, proof)
            part = "" if share == 1.0 else f", {100.0 * share:g} % of it,"
            ranges = "" if task.spec.workspace is None else task.spec.workspace.range_words
            if sampled:
                ranges = f", at {len(self.workspace)} sampled orientations of its ranges alone"
            lines.append(f"workspace{part.rstrip(',')}{ranges}{',' * bool(part or ranges)} {proof}")
        return lines

    @property
    def _place(self) -> str:
        """A sentence on where the workspace that floats lies in this design."""
        design = self.design
        if not self.workspace:
            largest = f", at most at {design.scale:.3g} times its size" if design.scale else ""
            return f"workspace: it fits nowhere{largest}"
        return f"workspace centred at {place_words(design.cube.center)}"

    @cached_property
    def _reasons(self) -> dict[str, str]:
        """The reason why each quantity is undefined; empty where it is defined."""
        names = self.design.task.quantity_names
        return {name: self.design.missing_reason(name) for name in names}

    @property
    def missing_quantities(self) -> list[str]:
        """A line for each undefined quantity: its name and the reason."""
        reasons = self._reasons.items()
        return [f"{name}: none, because {reason}" for name, reason in reasons if reason]

    lacking = former_attribute("lacking", "missing_quantities")

    @property
    def covers(self) -> list[str]:
        """Lines that name, for each quantity, the samples or proof behind it; then the motors."""
        design, task = self.design, self.design.task
        texts: dict[str, list[str]] = {}
        for name in (name for name, reason in self._reasons.items() if not reason):
            amount = design.quantity(name)
            text = Change(name, amount, amount, task.unit(name)).format_value(amount)
            texts.setdefault(design.cover(name), []).append(f"{name} {text}")
        lines = [f"{', '.join(parts)}: {cover}" for cover, parts in texts.items()]
        if task.motors and self._reasons.get("motor_margin") == "":
            minimums = (r.least for r in task.spec.requirements if r.quantity == "motor_margin")
            least = max((minimum for minimum in minimums if minimum is not None), default=1.0)
            lines += map(_motor_words, best_motors(design.cycle_loads, task.motors, least))
        return [*self.missing_quantities, *lines]

    def lines(self) -> list[str]:
        """Return lines of text on proofs, the poses behind each quantity, and joint travel."""
        design, lines = self.design, [*self.proofs, *self.covers]
        region = "the workspace" if design.task.spec.workspace is not None else "the cube"
        if (design.task.seeks_place and design.cube.edge <= 0.0) or not design.is_reachable:
            return lines
        return [*lines, *(f"{line}, over {region}" for line in stroke_words(design))]

    def as_dict(self) -> dict[str, Any]:
        """Return the machine, its quantities and its proofs as plain data, SI units."""
        design, names = self.design, self.design.task.quantity_names
        center = design.cube.center.tolist() if design.task.floats and self.workspace else None
        changes = [] if self.name == "start" else [vars(change) for change in self.changes]
        contents = {
            "machine": machine_record(design.robot),
            **{name: design.quantity(name) for name in names},
            "known": {name: self._reasons[name] or design.cover(name) for name in names},
            **({"workspace_center": center} if design.task.floats else {}),
            "changes": changes,
        }
        if self.cube is not None:
            boxes = sum(proof.boxes for proof in self.cube.proofs)
            cube = {"center": self.cube.center.tolist(), "edge": self.cube.edge, "boxes": boxes}
            contents["proved_cube"] = cube
        if design.task.has_ranges:
            contents["orientations_proved"] = (
                "sampled" if is_sampled(design.task, self.workspace) else "all"
            )
        contents["workspace_proved"] = [proof.holds for proof in self.workspace]
        contents["workspace_share"] = [workspace_share(design, proof) for proof in self.workspace]
        return contents


def _motor_words(fit: MotorFit) -> str:
    """Return a sentence: the motor for a leg, its ratio and the margin (limit over need)."""
    return (
        f"drive of leg {fit.leg}: {fit.motor.name} at a ratio of {fit.ratio:.3g} has "
        f"{fit.margin:.3g} times the {fit.scarcest} that it needs, its tightest limit"
    )


@dataclass(frozen=True, eq=False, repr=False)
class FrontReport(Result):
    """A front with the designs that a report shows, and the machine that it began with."""

    front: Front

    def __repr__(self) -> str:
        """Return the machine's name and the names of the reported designs in one line."""
        return f"<FrontReport of {self.front.task.robot.name!r}: {', '.join(self.front.selection)}>"

    @cached_property
    def start(self) -> ReportedDesign:
        """The initial machine of the search as a reported design."""
        return _report_design("start", Design(self.front.task, self.front.task.robot))

    @cached_property
    def selection(self) -> list[ReportedDesign]:
        """The best design in each objective and the compromise.

        A design that is best in several objectives is listed once, under all names.
        """
        task, names = self.front.task, dict[int, str]()
        for name, at in self.front.selection.items():
            names[at] = f"{names[at]}, {name}" if at in names else name
        return [
            _report_design(name, _design(task, self.front.robot(at), name))
            for at, name in names.items()
        ]

    chosen = former_attribute("chosen", "selection")

    def robots(self) -> dict[str, str]:
        """Return the selected machines as TOML texts, by file name."""
        return {
            f"{name}.toml": text_of(reported.design.robot)
            for reported in self.selection
            for name in reported.name.split(", ")
        }

    def table(self) -> pl.DataFrame:
        """Return the Pareto front as a table, a row for each design, with units in the headings."""
        frame: pl.DataFrame = self.front.table()
        return frame

    def summary(self) -> str:
        """Return the report as Markdown text: the same as `page`."""
        return self.page()

    data = former_attribute("data", "as_dict")

    def as_dict(self) -> dict[str, Any]:
        """Return machine, variables, reported designs and front as plain data, SI units."""
        front, task = self.front.as_dict(), self.front.task
        return {
            "robot": task.robot.name,
            "machine": machine_record(task.robot),
            "evaluated": front["evaluated"],
            "kept": front["kept"],
            "variables": [vars(v) | {"places": [p.path for p in v.places]} for v in task.variables],
            "objectives": front["objectives"],
            "start": self.start.as_dict(),
            "chosen": {reported.name: reported.as_dict() for reported in self.selection},
            "front": front["front"],
        }

    def page(self) -> str:
        """Return the report in Markdown: changes with units, proofs, samples of each quantity."""
        front = self.front
        lines = [
            f"# Designs of {front.task.robot.name}",
            "",
            f"{front.evaluated} designs were evaluated; {front.kept} meet all requirements; "
            f"on the Pareto front, where values less than 0.1 % apart are equal: {len(front)}. A "
            "link of another "
            + (
                "length is drawn out along itself: its mass grows with the length."
                if front.task.spec.masses == "per length"
                else "length keeps its inertia."
            ),
            "",
            "## Requirements",
            "",
            *(f"- {line}" for line in front.task.spec.requirement_lines()),
            "",
            "## Initial machine",
            "",
            *(f"- {line}" for line in self.start.lines()),
        ]
        for reported in self.selection:
            lines += ["", f"## {reported.name.replace('-', ' ').capitalize()}", ""]
            lines += ["| quantity | initial | design | change |", "| --- | ---: | ---: | ---: |"]
            lines += [f"| {' | '.join(change.cells)} |" for change in reported.changes]
            lines += ["", *(f"- {line}" for line in reported.lines())]
        return "\n".join(lines) + "\n"


def _design(task: Task, robot: Manipulator, name: str) -> Design:
    """Return a design of `robot`, named after the machine and the report's `name`."""
    ending = f"-{name.split(', ')[0]}"
    return Design(task, replace(robot, name=robot.name[: LONGEST_NAME - len(ending)] + ending))


def _report_design(name: str, design: Design) -> ReportedDesign:
    """Prove a design and return it for the report under `name`."""
    return ReportedDesign(**vars(prove_design(design)), name=name)
