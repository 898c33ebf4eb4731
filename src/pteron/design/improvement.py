"""Refinement of a design: one objective improves under all requirements.

Objectives of the machine alone, and the size of a cube, are improved by gradients, others by Nelder
and Mead's method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from pteron.design.design import Design
from pteron.design.placement import nelder_mead, sampled_cost
from pteron.design.proofs import counterexamples, prove_design
from pteron.design.spec import ROUNDING
from pteron.design.task import Task
from pteron.design.variables import geometry_slopes, slopes_of
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kinematics.sampling import search_ball
from pteron.workspace.exchange import POINTS, SemiInfiniteProgram, improve_unknowns
from pteron.workspace.shape_samples import Samples, fixed_samples, shape_samples

_EXCHANGES = 8
"""Most times that counterexamples of the result's proof join its conditions."""

_SPARE = 1e-4
"""Share by which a workspace that floats is kept larger than it must be: then all of it is proved,
and not all but its rim."""

_MOST = 6
"""Most variables for which Nelder and Mead's method seeks the largest cube of each design: it takes
longer than all else with more."""

_TOLERANCE = 1e-4
"""Tolerance of the unknowns, as shares of their ranges."""

_FIRST = 5
"""Points along a cube's edge in the first program."""


_EVALUATIONS, _FIRST_STEP = 12, 0.1
"""Evaluations for each unknown of an objective without gradients, twice, and the first step of each
as a share of its range."""


def improve_design(
    task: Task, point: Sequence[float], objective: int, *, hold: bool = True
) -> list[float]:
    """Return variables (V,) of a design with a better objective; `point` itself if none is found.

    The other objectives become no worse, unless `hold` is False.
    The unknowns are the variables, and the cube's centre and edge. Requirements on quantities of
    the machine alone are linearised; quantities that depend on poses are not constrained, so the
    caller evaluates the design again. If the proof of the workspace or the cube fails, the search
    is repeated with the counterexample among its conditions.
    """
    spec, start = task.spec, np.array(point)
    target = spec.objectives[objective]
    try:
        design = Design(task, task.machine(point))
        if task.quantities[target.quantity].cover not in ("machine", "proved"):
            return _improve_sampled(design.placed_anywhere, start, objective, hold)
        design = prove_design(design).design
        slopes = _Slopes(task, design, start)
        target_slopes = slopes.slopes_of_quantity(target.quantity)
        if target_slopes is None or not target_slopes.any() or design.margin < -ROUNDING:
            return list(point)
        geometry = geometry_slopes(task.robot, task.variables, point)
    except ModelError:  # at the end of what can be made
        return list(point)
    lengths = len(task.robot.platform.lengths)
    seeks = task.seeks_place
    shape, least = task.shape
    fit, reach = np.zeros(lengths + 1), np.zeros((lengths + 1, 2))
    if seeks:
        center, radius = search_ball(design.robot)
        fit = np.append(design.cube.center, design.cube.edge)
        reach = np.append(center, radius)[:, None] + [-radius, radius]
        reach[-1, 0] = min((1.0 + _SPARE) * least, fit[-1])
    z0 = np.append(start, fit)
    program = SemiInfiniteProgram(
        task.conditions,
        design.cube.side if seeks else design.side,
        z0,
        design.geometry,
        geometry,
        target.sign * target_slopes,
        np.vstack([task.ranges.T, reach]),
        shape,
        task.orientations if seeks else task.orientations[:0],
        tuple(slopes.bounds(objective, z0, hold)),
    )
    first, dense = (_condition_samples(design, lengths, count) for count in (_FIRST, POINTS))
    for _ in range(_EXCHANGES):
        z = improve_unknowns(program, first, dense)
        variables: list[float] = z[: len(start)].tolist()
        missed = counterexamples(Design(task, task.machine(variables)), z[len(start) : -1], z[-1])
        if not len(missed.inside):
            break
        first = first.join(missed)
    if hold:
        return variables
    try:
        return _improve_sampled(
            Design(task, task.machine(variables)), np.array(variables), objective, False
        )
    except ModelError:
        return variables


def _improve_sampled(design: Design, start: Array, objective: int, hold: bool) -> list[float]:
    """Return variables (V,) with a better objective that depends on poses.

    The unknowns are the variables and the place of a workspace that floats.
    """
    task, count = design.task, len(start)
    if design.margin < -ROUNDING or (task.seeks_cube and count > _MOST):
        return list(map(float, start))
    (low, high), (shape, least) = task.ranges, task.shape
    fit = replace(design.cube, edge=least) if task.floats else None
    targets, design = task.spec.objectives if hold else (), replace(design, refined=False)
    most = np.array([o.sign * design.quantity(o.quantity) for o in targets])
    most = np.append(most, np.full(len(task.spec.objectives) - len(most), np.inf))
    most[objective] = np.inf

    def cost(units: Array) -> float:
        """Return the objective at unknowns, as shares of ranges; infinite where infeasible."""
        known = fit and replace(fit, center=fit.center + least * shape.half * units[count:])
        try:
            variables = (low + np.clip(units[:count], 0.0, 1.0) * (high - low)).tolist()
            trial = Design(task, task.machine(variables), known, refined=False)
            return sampled_cost(trial, objective, most) if trial.margin >= 0.0 else np.inf
        except ModelError:
            return np.inf

    units = np.append((start - low) / (high - low), np.zeros(len(shape.half) if fit else 0))
    for share in (1.0, 0.5):  # again, since a simplex shrinks to a face of what is feasible
        step = share * np.where(units > 0.5, -_FIRST_STEP, _FIRST_STEP)
        units, _ = nelder_mead(cost, units, step, _EVALUATIONS * len(units), _TOLERANCE)
        units[:count] = np.clip(units[:count], 0.0, 1.0)
    return list(map(float, low + units[:count] * (high - low)))


def _condition_samples(design: Design, lengths: int, count: int) -> Samples:
    """Return sample poses at which conditions are imposed: in the workspace, the cube, or both."""
    task, parts = design.task, list[Samples]()
    if task.spec.workspace is not None and not task.floats:
        parts.append(fixed_samples(design.poses, lengths))
    if task.seeks_place:
        parts.append(shape_samples(task.shape[0], task.orientations, count))
    return reduce(Samples.join, parts)


@dataclass(frozen=True)
class _Slopes:
    """Derivatives of quantities with respect to the unknowns, at a design."""

    task: Task
    design: Design
    start: Array

    def slopes_of_quantity(self, name: str) -> Array | None:
        """Return a quantity's derivatives (V + k + 1,).

        None if not a function of geometry alone.
        """
        task, tail = self.task, len(self.task.robot.platform.lengths) + 1
        if name in ("cube", "scale"):
            edge = task.shape[1] if name == "scale" else 1.0
            return np.append(np.zeros(len(self.start) + tail - 1), 1.0 / edge)
        alone = task.quantities[name].of_machine
        if alone is None:
            return None
        slopes = slopes_of(
            lambda v: alone(task.machine(v.tolist())), task.variables, self.start.tolist()
        )
        return np.append(slopes, np.zeros(tail))

    def bounds(self, objective: int, z0: Array, hold: bool) -> list[tuple[Array, float]]:
        """Return linear bounds (row, offset) that keep the requirements, and other objectives."""
        bounds = []
        for k, target in enumerate(self.task.spec.objectives if hold else ()):
            row = self.slopes_of_quantity(target.quantity)
            if k != objective and row is not None:
                bounds.append((-target.sign * row, float(-target.sign * row @ z0)))
        for requirement in self.task.spec.requirements:
            row = self.slopes_of_quantity(requirement.quantity)
            if row is None:
                continue
            now = self.design.quantity(requirement.quantity)
            for bound, side in ((requirement.least, 1.0), (requirement.most, -1.0)):
                if bound is not None:
                    bounds.append((side * row, float(side * (row @ z0 + bound - now))))
        return bounds
