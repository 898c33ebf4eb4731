"""What is told of a search: a page in Markdown, its figures as plain data, and files of robots."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pteron.design.design import Design
from pteron.design.differences import (
    Change,
    geometry_changes,
    mass_changes,
    quantity_changes,
    stroke_words,
)
from pteron.design.front import Front
from pteron.design.proofs import ProvedCube, proved, workspace_share
from pteron.design.task import Task
from pteron.manipulator import Manipulator
from pteron.manipulator.names import LONGEST_NAME
from pteron.manipulator.saving import text_of

if TYPE_CHECKING:
    import polars as pl

    from pteron.workspace import Proof


@dataclass(frozen=True)
class Told:
    """One machine of a search, with what is proved of it.

    Attributes
    ----------
    name : str
        "start", "best-cube", "compromise", ...
    design : Design
        The machine.
    cube : ProvedCube or None
        The largest cube, where the search seeks one and it is proved.
    workspace : tuple of Proof
        Of the required workspace, one for each orientation; none where none is required.
    """

    name: str
    design: Design
    cube: ProvedCube | None
    workspace: tuple[Proof, ...]

    @property
    def changes(self) -> list[Change]:
        """Quantities, geometry and masses that are others than at the start."""
        task, robot = self.design.task, self.design.robot
        return [
            *quantity_changes(self.design),
            *geometry_changes(task, robot),
            *mass_changes(task, robot),
        ]

    @property
    def proofs(self) -> list[str]:
        """What is proved, a sentence each."""
        lines = []
        if self.design.task.seeks_cube:
            lines.append("cube: not proved" if self.cube is None else f"cube {self.cube.words}")
        shares = (workspace_share(self.design, proof) for proof in self.workspace)
        return [
            *lines,
            *(
                f"workspace{'' if share == 1.0 else f', {100.0 * share:g} % of it,'} {proof}"
                for share, proof in zip(shares, self.workspace, strict=True)
            ),
        ]


@dataclass(frozen=True)
class Summary:
    """A front with the designs that are told of, and the machine that it began with."""

    front: Front

    @cached_property
    def start(self) -> Told:
        """The machine to begin with."""
        return _told("start", Design(self.front.task, self.front.task.robot))

    @cached_property
    def chosen(self) -> list[Told]:
        """The best designs in each objective, and the compromise; one of several names once."""
        task, names = self.front.task, dict[int, str]()
        for name, at in self.front.chosen.items():
            names[at] = f"{names[at]}, {name}" if at in names else name
        return [
            _told(name, _design(task, self.front.robot(at), name)) for at, name in names.items()
        ]

    def robots(self) -> dict[str, str]:
        """Return the chosen machines as texts of files, by the files' names."""
        return {
            f"{name}.toml": text_of(told.design.robot)
            for told in self.chosen
            for name in told.name.split(", ")
        }

    def table(self) -> pl.DataFrame:
        """Return the front as a file has it, units in the headings."""
        shown = self.front.table.select(list(self.front.headings))
        return shown.rename(self.front.headings)

    def data(self) -> dict[str, Any]:
        """Return everything as plain data, SI units."""
        front = self.front
        return {
            "robot": front.task.robot.name,
            "evaluated": front.evaluated,
            "kept": front.kept,
            "variables": [
                vars(v) | {"places": [p.path for p in v.places]} for v in front.task.variables
            ],
            "objectives": [o.quantity for o in front.task.spec.objectives],
            "start": _data(self.start),
            "chosen": {told.name: _data(told) for told in self.chosen},
            "front": front.table.select(list(front.headings)).to_dicts(),
        }

    def page(self) -> str:
        """Return the report in Markdown: what changed, in words with units, and what is proved."""
        front = self.front
        lines = [
            f"# Designs of {front.task.robot.name}",
            "",
            f"{front.evaluated} designs were evaluated; {front.kept} keep all that is asked, and "
            f"{len(front)} of these are bettered by no other in every objective. A link of another "
            + (
                "length is drawn out along itself: its mass grows with the length."
                if front.task.spec.masses == "per length"
                else "length keeps its inertia."
            ),
            "",
            "## To begin with",
            "",
            *(f"- {line}" for line in [*self.start.proofs, *_strokes(self.start)]),
        ]
        for told in self.chosen:
            lines += ["", f"## {told.name.replace('-', ' ').capitalize()}", ""]
            lines += ["| what | to begin with | now | change |", "| --- | ---: | ---: | ---: |"]
            lines += [
                f"| {c.what} | {c.told(c.before)} | {c.told(c.after)} | {c.by} |"
                for c in told.changes
            ]
            lines += ["", *(f"- {line}" for line in [*told.proofs, *_strokes(told)])]
        return "\n".join(lines) + "\n"


def _design(task: Task, robot: Manipulator, name: str) -> Design:
    ending = f"-{name.split(', ')[0]}"
    return Design(task, replace(robot, name=robot.name[: LONGEST_NAME - len(ending)] + ending))


def _told(name: str, design: Design) -> Told:
    found = proved(design)
    return Told(name, found.design, found.cube, found.workspace)


def _strokes(told: Told) -> list[str]:
    region = "the workspace" if told.design.task.spec.workspace is not None else "the cube"
    if region == "the cube" and told.design.cube.edge <= 0.0:
        return []
    return [f"{line}, over {region}" for line in stroke_words(told.design)]


def _data(told: Told) -> dict[str, Any]:
    task = told.design.task
    found: dict[str, Any] = {name: told.design.quantity(name) for name in task.asked}
    found["changes"] = [vars(change) for change in told.changes] if told.name != "start" else []
    if told.cube is not None:
        found["proved_cube"] = {
            "center": told.cube.center.tolist(),
            "edge": told.cube.edge,
            "boxes": sum(proof.boxes for proof in told.cube.proofs),
        }
    found["workspace_proved"] = [proof.holds for proof in told.workspace]
    found["workspace_share"] = [workspace_share(told.design, proof) for proof in told.workspace]
    return found
