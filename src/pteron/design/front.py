"""The front of a search: the designs that no other one betters in every objective."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pteron.design.quantities import quantities
from pteron.design.task import Task
from pteron.kernels import Array
from pteron.manipulator import Manipulator

if TYPE_CHECKING:
    import polars as pl

_MISSES = "misses "


@dataclass(frozen=True, repr=False)
class Front:
    """The best designs that a search has found.

    Attributes
    ----------
    task : Task
        What was asked.
    table : polars.DataFrame
        A row for each design of the front: its variables, the quantities asked for, and what it
        misses, which is nothing; the best of the first objective comes first.
    evaluated : int
        How many designs it was found among.
    kept : int
        How many of them keep all that is asked.
    """

    task: Task
    table: pl.DataFrame
    evaluated: int
    kept: int

    def __repr__(self) -> str:
        """Return the front in a line."""
        return (
            f"<Front of {self.task.robot.name!r}: {len(self.table)} designs of {self.evaluated} "
            "evaluated>"
        )

    def __len__(self) -> int:
        """Return the number of its designs."""
        return len(self.table)

    @cached_property
    def values(self) -> Array:
        """The variables (K, V)."""
        return np.asarray(self.table.select([v.name for v in self.task.variables]).to_numpy())

    @cached_property
    def objectives(self) -> Array:
        """The objectives (K, M), in their units."""
        names = [o.quantity for o in self.task.spec.objectives]
        return np.asarray(self.table.select(names).to_numpy())

    def robot(self, index: int) -> Manipulator:
        """Return the machine of one of its designs."""
        return self.task.machine(self.values[index].tolist())

    @cached_property
    def chosen(self) -> dict[str, int]:
        """Which designs are told of: the best in each objective, and the compromise.

        The compromise is nearest to the best of all objectives at once, each measured by its range
        over the front; of one objective there is none.
        """
        signs = np.array([o.sign for o in self.task.spec.objectives])
        costs = self.objectives * signs
        found = {
            f"best-{o.quantity}": int(costs[:, k].argmin())
            for k, o in enumerate(self.task.spec.objectives)
        }
        spans = np.ptp(costs, axis=0)
        shares = (costs - costs.min(axis=0)) / np.where(spans > 0.0, spans, 1.0)
        if len(signs) > 1:
            found["compromise"] = int(np.linalg.norm(shares, axis=1).argmin())
        return found

    @property
    def headings(self) -> dict[str, str]:
        """What the table's columns are called with their units."""
        found = {}
        for v in self.task.variables:
            found[v.name] = f"{v.name} ({v.unit})" if v.unit else v.name
        for name in self.task.asked:
            unit = quantities()[name].unit
            found[name] = f"{name} ({unit})" if unit else name
        return found


def front_of(task: Task, designs: pl.DataFrame) -> Front:
    """Return the front of designs that were evaluated.

    Raises
    ------
    ModelError
        If none of them keeps all that is asked; the message says what is missed by least, and how.
    """
    from pteron.design.extras import non_dominated

    misses = [name for name in designs.columns if name.startswith(_MISSES)]
    total = np.nan_to_num(designs.select(misses).to_numpy(), nan=np.inf)
    kept = np.flatnonzero((total <= 0.0).all(axis=1))
    if not len(kept):
        raise _impossible(task, designs, misses, total)
    good = designs[kept]
    signs = np.array([o.sign for o in task.spec.objectives])
    costs = good.select([o.quantity for o in task.spec.objectives]).to_numpy() * signs
    costs = np.where(np.isfinite(costs), costs, np.inf)
    best = non_dominated(costs)
    order = np.lexsort(costs[best].T[::-1])
    best = best[order]
    # A design that was found twice counts once.
    first = np.append(True, (np.diff(costs[best], axis=0) != 0.0).any(axis=1))
    return Front(task, good[best[first]], len(designs), len(kept))


def _impossible(
    task: Task, designs: pl.DataFrame, misses: list[str], total: Array
) -> Exception:
    from pteron.errors import ModelError

    least = total.sum(axis=1).argmin()
    row = designs.row(int(least), named=True)
    told = []
    for k, name in enumerate(misses):
        alone = total[:, k].min() > 0.0
        if total[least, k] <= 0.0:
            continue
        if name == "misses workspace":
            what = "the workspace is not kept"
            design = task.machine([row[v.name] for v in task.variables])
            what += f" ({_worst_condition(task, design)})"
        else:
            asked = task.spec.requirements[k - 1]
            what = f"{asked.words} is missed: {row[asked.quantity]:.4g}"
        told.append(f"{what}, which no design keeps" if alone else what)
    at = ", ".join(f"{v.name} = {row[v.name]:.4g}" for v in task.variables)
    return ModelError(
        f"none of {len(designs)} designs keeps all that is asked; the nearest has {at}: "
        f"{'; '.join(told)}. Ask for less, or widen the ranges of the variables",
        subject=task.robot.name,
    )


def _worst_condition(task: Task, robot: Manipulator) -> str:
    """Return which condition a machine misses most in the workspace."""
    from pteron.design.design import Design

    design = Design(task, robot)
    if task.spec.workspace is None:
        poses = np.array([[*design.cube.center, *o[len(design.cube.center) :]] for o in task.orientations])
    else:
        poses = design.poses
    rows = task.conditions.rows(design.geometry, poses, design.side)
    rows = np.nan_to_num(rows, nan=0.0)
    at, row = np.unravel_index(int(rows.argmin()), rows.shape)
    pose = ", ".join(f"{x:.4g}" for x in poses[at])
    return f"{task.conditions.names[row]}, at pose [{pose}]"
