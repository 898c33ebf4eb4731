"""Faults that logs cannot show: those that spoil another motion before residuals tell them."""

from __future__ import annotations

import numpy as np

from pteron.identification.faults.columns import Family, FaultColumns
from pteron.identification.faults.cycle import ReferenceCycle
from pteron.identification.faults.fault import FaultName
from pteron.identification.faults.fitted_motion import FittedMotion
from pteron.identification.observation import Observations, scale_columns
from pteron.identification.plausibility import CLEAR, WANTED
from pteron.kernels import Array

_INDEPENDENT = 1e-3
"""Share of a column, independent of the model's columns, from which both can be told apart."""

_NOISELESS = 1e-9
"""Least noise of a force, over that of the noisiest one; a smaller one counts as this."""

_RESONANCE = 10.0
"""Frequency, Hz, of a joint's inertia on drives that give as usual."""

_FRICTION = 0.05
"""Friction of passive joints, or that grows with the load, over the load, as is usual."""

_HARMFUL = 2.0
"""Error of another motion's forces, percent, from which a fault that makes it is named as hidden:
up to 3 % is trusted, and a fault may be larger than usual."""


def hidden_faults(
    columns: FaultColumns, observations: Observations, noise: Array, other: ReferenceCycle
) -> list[FaultName]:
    """Return the faults that these logs cannot reveal, given the noise (n,) of the forces.

    A delay of the clock and the scale of one force are returned if their column is a linear
    combination of the model's columns up to the noise. Zeros, ratios, lengths, elasticity and
    friction are returned if an error of usual size hardly changes the residuals, but changes the
    forces of another motion, `other`, by more than `_HARMFUL`.
    """
    motion = columns.motion(other.states, np.full(len(other.states), 0.5))
    weights = 1.0 / np.maximum(noise, _NOISELESS * noise.max() + 1e-300)
    flat = (weights[:, None] * observations.matrix).reshape(-1, observations.matrix.shape[-1])
    p = len(columns.model.names)
    known, lengths = scale_columns(flat[:, :p])
    basis, triangle = np.linalg.qr(known)
    back = np.linalg.pinv(triangle) / lengths[:, None]
    hidden: dict[FaultName, None] = {}
    for family, place in zip(columns.families, columns.places, strict=True):
        fault_columns = flat[:, place]
        taken_in = basis.T @ fault_columns
        unexplained = fault_columns - basis @ taken_in
        if family.name in ("clock", "scale"):
            size = float(np.linalg.norm(unexplained))
            independent = size > _INDEPENDENT * float(np.linalg.norm(fault_columns))
            if not (independent and WANTED * size > CLEAR):
                hidden[family.name] = None
        elif len(other.states) > 0 and (usual := _usual_sizes(family, motion)) is not None:
            error = motion.matrix @ (back @ taken_in)
            if family.of_machine and not family.of_path:
                error = error - family.deviation_columns(motion)
            if _largest_error(unexplained, error, usual, other, motion) > _HARMFUL:
                hidden[family.name] = None
    return list(hidden)


def _usual_sizes(family: Family, motion: FittedMotion) -> Array | None:
    """Return the usual sizes of a fault (k,); None if it has none."""
    load = motion.forces(of=["base"]).std(axis=0)
    if family.name == "elasticity":
        compliance = motion.states.joint_accelerations.std(axis=0) / np.maximum(load, 1e-300)
        return np.asarray(compliance / (2.0 * np.pi * _RESONANCE) ** 2)
    if family.name in ("load", "passive"):
        sizes = np.abs(family.columns(motion)).mean(axis=(0, 1))
        return np.asarray(_FRICTION * load.mean() / np.maximum(sizes, 1e-300))
    if not family.tolerance.usual:
        return None
    return np.full(len(family.sizes(motion.model)), family.tolerance.usual)


def _largest_error(
    unexplained: Array, error: Array, usual: Array, other: ReferenceCycle, motion: FittedMotion
) -> float:
    """Return another motion's error of forces, percent, by a usual fault that is not detectable.

    `unexplained` (N, k) are a fault's columns over the noise, without what the model's take in;
    `error` (R, n, k) is that of the other motion's forces per unit of its sizes, and `usual` (k,)
    are their standard deviations. A size is told from zero at `CLEAR` standard deviations.
    """
    columns = unexplained * (usual / CLEAR)
    seen, directions = np.linalg.eigh(columns.T @ columns)
    spread = usual[:, None] * directions / np.sqrt(1.0 + np.maximum(seen, 0.0))
    size = np.sqrt(((error @ spread) ** 2).sum(axis=-1))
    return float(other.share(size, motion.matrix @ motion.values).max())
