"""Errors of forces in a pick-and-place cycle or another motion, by a fit and the faults it shows.

They are in percent of the forces' standard deviations.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from pteron.identification.estimators import Estimate
from pteron.identification.faults.columns import FaultColumns
from pteron.identification.faults.cycle import Extent, ReferenceCycle
from pteron.identification.faults.search import FoundFault
from pteron.identification.signals import States
from pteron.kernels import Array


def expected_errors(
    columns: FaultColumns,
    states: list[States],
    other: ReferenceCycle,
    estimate: Estimate,
    plain: Estimate,
    found_faults: Sequence[FoundFault],
) -> tuple[Array, Array, list[Array]]:
    """Return errors of a cycle's forces, percent: by covariance, by all faults, and by each (n,).

    The first two are those of the `other` motion where it has larger ones; NaN without a cycle.
    """
    cycle = ReferenceCycle.from_mean_pose(columns.model.robot, Extent.from_states(states))
    uncertain, spoiled, each = _cycle_errors(columns, cycle, estimate, plain, found_faults)
    if cycle is not None and len(other.states) > 0:
        # What a cycle spares another motion of the same range may show.
        elsewhere = _cycle_errors(columns, other, estimate, plain, found_faults)
        uncertain, spoiled = np.fmax(uncertain, elsewhere[0]), np.fmax(spoiled, elsewhere[1])
    return uncertain, spoiled, each


def _cycle_errors(
    columns: FaultColumns,
    cycle: ReferenceCycle | None,
    estimate: Estimate,
    plain: Estimate,
    found_faults: Sequence[FoundFault],
) -> tuple[Array, Array, list[Array]]:
    """Return errors of a cycle's forces, percent: by covariance, by all faults, and by each (n,).

    NaN without a cycle.
    """
    if cycle is None:
        nothing = np.full(len(estimate.noise), np.nan)
        return nothing, nothing, [nothing for _ in found_faults]
    motion = columns.motion(cycle.states, np.full(len(cycle.states), 0.5))
    matrix = motion.matrix
    p = matrix.shape[-1]
    forces = [matrix @ plain.values]
    for fault in found_faults:
        with_fault = matrix @ fault.fit.values[:p]
        for family, sizes in (*fault.others, (fault.family, fault.sizes)):
            if family.of_machine and (cycle.in_order or not family.of_path):
                with_fault = with_fault + family.deviation_columns(motion) @ sizes
        forces.append(with_fault)
    each = [cycle.share(b - a, forces[0]) for a, b in pairwise(forces)]
    spoiled = cycle.share(forces[-1] - forces[0], forces[0])
    # A fault that is not named adds to the residuals, and so to the covariance.
    covariance = found_faults[-1].fit.covariance[:p, :p] if found_faults else estimate.covariance
    variance = np.einsum("rnp,pq,rnq->rn", matrix, covariance, matrix, optimize=True)
    uncertain = cycle.share(np.sqrt(np.maximum(variance, 0.0)), forces[0])
    return uncertain, spoiled, each
