"""Rows of a table of designs: quantities, and by how much each requirement is missed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from pteron.design.design import Design
from pteron.design.proofs import prove_design
from pteron.design.spec import FAILED, ROUNDING
from pteron.design.task import Task
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kernels.one_thread import one_thread

if TYPE_CHECKING:
    import polars as pl

MISSES = "misses "
"""Prefix of the columns with violations."""


def evaluate_design(
    task: Task, point: Sequence[float], *, proofs: bool = False, thorough: bool = False
) -> dict[str, float]:
    """Return quantities and violations of a design (V,), by column name.

    "misses workspace" is by how much the least condition is below 0, and "misses 1 links" the
    relative violation of the first requirement, on `links`; both are 0 if satisfied. With `proofs`
    the cube is the proved one, and a workspace that is not proved counts as violated. A workspace
    that floats is placed near where it could be largest or, if `thorough`, anywhere.
    """
    try:
        design = Design(task, task.machine(point))
        if thorough:
            design = design.placed_anywhere
        if proofs:
            design = prove_design(design).design
        row = {name: design.quantity(name) for name in task.quantity_names}
        row |= zip(places(task), design.cube.center.tolist() if task.floats else (), strict=True)
        margin = design.margin
    except ModelError:
        row, margin = dict.fromkeys((*task.quantity_names, *places(task)), float("nan")), -FAILED
    misses = {f"{MISSES}workspace": 0.0 if margin >= -ROUNDING else -margin}
    for k, requirement in enumerate(task.spec.requirements, start=1):
        misses[f"{MISSES}{k} {requirement.quantity}"] = requirement.violation(
            row[requirement.quantity], FAILED
        )
    return row | misses


def places(task: Task) -> list[str]:
    """Return names of the columns for the centre of a workspace that floats.

    The list is empty if the workspace is fixed.
    """
    return [f"center {name}" for name in task.robot.platform.lengths] if task.floats else []


def design_table(
    task: Task, designs: ArrayLike, *, proofs: bool = False, thorough: bool = False
) -> pl.DataFrame:
    """Return a table of designs (N, V), a row each: variables, quantities and violations."""
    import polars as pl

    points = np.asarray(designs)
    with one_thread():
        depth = {"proofs": proofs, "thorough": thorough}
        rows = [evaluate_design(task, row, **depth) for row in points.tolist()]
    columns = {v.name: points[:, k].tolist() for k, v in enumerate(task.variables)}
    return pl.DataFrame(columns | {name: [row[name] for row in rows] for name in rows[0]})


def violations(designs: pl.DataFrame) -> Array:
    """Return a table's violations (N, C) of the workspace (column 0) and of each requirement."""
    names = [name for name in designs.columns if name.startswith(MISSES)]
    return np.asarray(designs.select(names).to_numpy())
