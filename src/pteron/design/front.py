"""The Pareto front of a search: the designs that no other dominates in the objectives."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pteron.design.design import Design
from pteron.design.evolution import distinct_front, lexicographic_best, pareto_front
from pteron.design.proofs import counterexamples
from pteron.design.rows import MISSES, places, violations
from pteron.design.spec import FAILED
from pteron.design.task import Task
from pteron.errors import ModelError
from pteron.html_table import Overview, frame_overview
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.renamed import FormerTable, former_attribute
from pteron.result import Result

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, eq=False, repr=False)
class Front(Result):
    """The best designs that a search has found.

    Attributes
    ----------
    task : Task
        The task of the search.
    designs : polars.DataFrame
        A row for each design of the front: its variables, the quantities asked for, and misses of
        requirements, which are 0; the best of the first objective comes first.
    evaluated : int
        Number of designs that were evaluated.
    kept : int
        Number of these that keep all that is asked.
    """

    task: Task
    designs: pl.DataFrame
    evaluated: int
    kept: int

    @property
    def table(self) -> FormerTable:
        """The table of designs; called, it returns the designs with units in the headings."""
        return FormerTable("Front", self.designs, self._headed_designs)

    def _headed_designs(self) -> pl.DataFrame:
        """Return the table of designs with units in the column headings."""
        return self.designs.select(list(self.headings)).rename(self.headings)

    def summary(self) -> str:
        """Return the counts of evaluated, feasible and Pareto-optimal designs in a line of text."""
        return (
            f"{self.task.robot.name}: {self.evaluated} designs evaluated, {self.kept} meet all "
            f"requirements, {len(self)} on the Pareto front (less than 0.1 % apart is equal)"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the counts, the objectives' names and the designs as plain data, SI units."""
        return {
            "evaluated": self.evaluated,
            "kept": self.kept,
            "objectives": [o.quantity for o in self.task.spec.objectives],
            "front": self.designs.select(list(self.headings)).to_dicts(),
        }

    def _overview(self) -> Overview:
        """Return the overview for notebooks: the counts of designs and the table."""
        title, _, about = self.summary().partition(": ")
        return frame_overview(title, about, self.table())

    def __repr__(self) -> str:
        """Return the machine's name and the counts of designs in one line."""
        return (
            f"<Front of {self.task.robot.name!r}: {len(self.designs)} designs of {self.evaluated} "
            "evaluated>"
        )

    def __len__(self) -> int:
        """Return the number of designs on the front."""
        return len(self.designs)

    @cached_property
    def values(self) -> Array:
        """The design variables (K, V) of the front's K designs."""
        return self.task.points(self.designs)

    @cached_property
    def objectives(self) -> Array:
        """The objectives' values (K, M) of the front's K designs, in their units."""
        names = [o.quantity for o in self.task.spec.objectives]
        return np.asarray(self.designs.select(names).to_numpy())

    def robot(self, index: int) -> Manipulator:
        """Return the machine of the design in row `index` of the front."""
        return self.task.machine(self.values[index].tolist())

    @cached_property
    def selection(self) -> dict[str, int]:
        """Row indices of the designs in a report: best in each objective, and the compromise.

        Where several are equally good in an objective, the others decide, in their order. The
        compromise is the design nearest to the best value of all objectives at once, each
        objective scaled by its range over the front; with one objective there is none.
        """
        costs, objectives = self.task.costs(self.designs), self.task.spec.objectives
        best_designs = {}
        for k, objective in enumerate(objectives):
            order = [k, *(j for j in range(len(objectives)) if j != k)]
            best_designs[f"best-{objective.quantity}"] = lexicographic_best(costs, order)
        spans = np.ptp(costs, axis=0)
        shares = (costs - costs.min(axis=0)) / np.where(spans > 0.0, spans, 1.0)
        if len(objectives) > 1:
            best_designs["compromise"] = int(np.linalg.norm(shares, axis=1).argmin())
        return best_designs

    chosen = former_attribute("chosen", "selection")

    @property
    def headings(self) -> dict[str, str]:
        """Headings of the table of designs, by column name: the name with its unit."""
        headings = {}
        for v in self.task.variables:
            headings[v.name] = f"{v.name} ({v.unit})" if v.unit else v.name
        for name in self.task.quantity_names:
            unit = self.task.unit(name)
            headings[name] = f"{name} ({unit})" if unit else name
        return headings | {name: f"{name} (m)" for name in places(self.task)}


class ProvedRows:
    """Designs' rows after proofs, which replace rows from sample points.

    `prove` takes values of designs (N, V), and returns their rows, each as far as it is proved.
    """

    def __init__(self, task: Task, prove: Callable[[list[list[float]]], pl.DataFrame]) -> None:
        self._task, self._prove = task, prove
        self._rows: dict[bytes, tuple[Any, ...]] = {}

    def replace_rows(self, designs: pl.DataFrame) -> pl.DataFrame:
        """Return the table of designs in which proved designs have the values of their proofs."""
        keys = self._keys(designs)
        if self._rows.keys().isdisjoint(keys):
            return designs
        rows = [self._rows.get(k, row) for k, row in zip(keys, designs.rows(), strict=True)]
        return type(designs)(rows, schema=designs.schema, orient="row")

    def front(self, parts: Callable[[], Iterable[pl.DataFrame]]) -> Front:
        """Return the Pareto front of designs that come in tables, after proving every design on it.

        A proof can reduce the values of a design, which changes the front; the new front is then
        proved too.
        """
        while True:
            front = front_of_parts(self._task, map(self.replace_rows, parts()))
            points = front.values.tolist()
            keys = self._keys(front.designs)
            unproved = [v for v, key in zip(points, keys, strict=True) if key not in self._rows]
            if not unproved:
                return front
            proved = self._prove(unproved)
            self._rows |= zip(self._keys(proved), proved.rows(), strict=True)

    def _keys(self, designs: pl.DataFrame) -> list[bytes]:
        """Return the cache keys of designs: the bytes of their variables."""
        return [np.ascontiguousarray(row).tobytes() for row in self._task.points(designs)]


def front_of_parts(task: Task, parts: Iterable[pl.DataFrame]) -> Front:
    """Return the Pareto front of designs that come in tables; only the front stays in memory."""
    import polars as pl

    best: pl.DataFrame | None = None
    nearest: pl.DataFrame | None = None
    evaluated = feasible = 0
    for part in parts:
        missed = _misses_of(task, part)
        good = part.filter(missed == 0.0)
        evaluated, feasible = evaluated + len(part), feasible + len(good)
        if len(good):
            both = good if best is None else pl.concat([best, good])
            best = both[pareto_front(task.costs(both))]
        elif best is None:
            near = part[[int(missed.argmin())]]
            both = near if nearest is None else pl.concat([nearest, near])
            nearest = both[[int(_misses_of(task, both).argmin())]]
    if best is None:
        assert nearest is not None  # there is at least one design
        raise _impossible(task, nearest, evaluated)
    return Front(task, best[distinct_front(task.costs(best))], evaluated, feasible)


def _misses_of(task: Task, designs: pl.DataFrame) -> Array:
    """Return by how much each design violates the task's requirements, summed, (N,).

    Each undefined objective adds the constant `FAILED`.
    """
    missed = violations(designs).sum(axis=1)
    return np.asarray(missed + FAILED * (~np.isfinite(task.costs(designs))).sum(axis=1))


def _impossible(task: Task, nearest: pl.DataFrame, evaluated: int) -> ModelError:
    """Return the error for a search without feasible design: what the nearest design violates."""
    row = nearest.row(0, named=True)
    design = Design(task, task.machine([row[v.name] for v in task.variables]))
    reasons = []
    for name in (name for name in nearest.columns if name.startswith(MISSES) and row[name] > 0.0):
        if name == f"{MISSES}workspace":
            what = "the workspace" if task.spec.workspace else "a cube"
            if task.floats and 0.0 < design.scale < 1.0:
                reasons.append(f"{what} fits nowhere, {design.scale:.3g} times its size does")
            else:
                reasons.append(f"{what} is not kept ({_worst_condition(design)})")
        else:
            requirement = task.spec.requirements[int(name.split()[1]) - 1]
            reasons.append(
                f"{requirement.words} is missed, {_value(design, requirement.quantity, row)}"
            )
    for objective in task.spec.objectives:
        if not np.isfinite(row[objective.quantity]):
            reasons.append(f"{objective.quantity}: {_value(design, objective.quantity, row)}")
    at = ", ".join(f"{v.name} = {row[v.name]:.4g}" for v in task.variables)
    return ModelError(
        f"none of {evaluated} designs meets all requirements; the nearest, {at}: "
        f"{'; '.join(reasons)}. Relax the requirements, or widen the ranges of the variables",
        subject=task.robot.name,
    )


def _value(design: Design, name: str, row: dict[str, Any]) -> str:
    """Return the value of a design's quantity as text, or the reason why it is undefined."""
    if np.isfinite(row[name]):
        return f"with {row[name]:.4g} {design.task.unit(name)}".rstrip()
    return f"for there is none: {design.missing_reason(name)}"


def _worst_condition(design: Design) -> str:
    """Return as text the most violated condition of a design in the workspace, and its pose."""
    task = design.task
    if task.spec.workspace is None or task.floats:
        center = design.cube.center
        poses = task.orientations.copy()
        poses[:, : len(center)] = center
    else:
        known = counterexamples(design, np.zeros(len(task.robot.platform.lengths)), 0.0)
        poses = np.vstack([design.poses, known.poses])
    rows = np.nan_to_num(task.conditions.rows(design.geometry, poses, design.side))
    at, row = np.unravel_index(int(rows.argmin()), rows.shape)
    pose = ", ".join(f"{x:.4g}" for x in poses[at])
    return f"{task.conditions.names[row]}, at pose [{pose}]"
