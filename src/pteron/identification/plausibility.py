"""Whether values can be those of the machine, whatever the forces say: plausibility checks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pteron.identification.consistency import Consistency
from pteron.identification.consistency.bodies import bodies_of
from pteron.identification.estimators import Estimate
from pteron.identification.model import Model
from pteron.identification.signals import Preprocessing
from pteron.kernels import Array
from pteron.kinematics import random_poses
from pteron.kinematics.evaluate import unchecked
from pteron.manipulator import Manipulator, parameters
from pteron.reduction import BaseParameters, base_regressor

_PROBES = 50

_NO_FORCES = 1e4
_MOST_UNSEEN = 0.5
"""Share of the base parameters that a motion may leave unseen."""

_FAR_ABOVE = 5.0
"""What a fit leaves of the forces, over their noise, where the model is not the machine's."""

_FAR = 0.5
"""Difference from the drawn machine, as a share of what a parameter is made of, that is doubted."""

_LEAST_SHARE = 0.02
"""Share of a body's mass and length that a parameter is usually made of, at least."""

_BEYOND_DOUBT = 3.0
"""Standard deviations by which energy is below zero where the data say so."""

_CHANCE = 1e-3
"""Probability below which infeasible values are not chance."""


def doubts(
    model: Model,
    estimate: Estimate,
    known: Array,
    consistency: Consistency | None,
    cad: Manipulator | None,
) -> list[str]:
    """Return what held-out forces cannot show: values may be right for the wrong machine.

    `known` (p,) is what of the values is no part of the bodies, such as rotors; `consistency` are
    the real bodies that were found, and `cad` is the machine as it is drawn.
    """
    found = []
    if has_negative_inertia(model, estimate.values, estimate.covariance):
        found.append("With these values the machine has negative inertia: forces do not belong.")
    if consistency is not None and consistency.p_value < _CHANCE:
        found.append(
            f"No real bodies have these values: they are {consistency.distance:.2g} standard "
            "deviations away. Look at what the model takes for granted: geometry, working mode, "
            "units, legs that share parameters."
        )
    if cad is not None:
        drawn = parameters(cad)
        base = model.base
        usual = usual_sizes(base, drawn)
        values = (estimate.values - known)[: base.rank]
        off = np.abs(values - base.grouping @ drawn)
        far = (off > _FAR * usual) & (off > 5.0 * estimate.deviations[: base.rank])
        worst = [k for k in np.argsort(-off / np.maximum(usual, 1e-300)) if far[k]][:3]
        if worst:
            names = ", ".join(
                f"{base.names[k]} ({values[k]:.3g}, drawn {base.grouping[k] @ drawn:.3g})"
                for k in worst
            )
            found.append(
                f"Far from the drawn machine: {names}. If the bodies are not that different, look "
                "at geometry, working mode and units: other ones can explain forces as well."
            )
    return found


def left_over(estimate: Estimate, preprocessing: Sequence[Preprocessing]) -> str:
    """Return what may explain a fit that leaves far more of the forces than their noise."""
    noise = np.max([one.force_noise for one in preprocessing], axis=0)
    ratio = float((estimate.noise / np.maximum(noise, np.finfo(float).tiny)).max())
    if ratio < _FAR_ABOVE:
        return ""
    return (
        f"the model leaves {ratio:.0f} times the noise of the forces, as where friction is left "
        "out, a force stands out, or it is the log of another machine"
    )


def has_negative_inertia(model: Model, values: Array, covariance: Array) -> bool:
    """Say whether values (p,) give a machine whose kinetic energy is negative beyond doubt."""
    # x''^T M x'' is positive for every real machine, whatever its CAD says.
    robot, rng = model.robot, np.random.default_rng(0)
    pose = random_poses(robot, _PROBES, seed=rng, type_i=0.3, type_ii=0.1)
    acceleration = rng.normal(size=pose.shape)
    rest = np.zeros_like(pose)
    needed = base_regressor(robot, model.base, pose, rest, acceleration)
    still = base_regressor(robot, model.base, pose, rest, rest)
    jacobians = unchecked(robot, "jacobian", pose)
    rows = np.einsum("rnp,rnm,rm->rp", needed - still, jacobians, acceleration)
    rank = model.base.rank
    known = covariance[:rank, :rank]
    spread = np.sqrt(np.maximum(np.einsum("rp,pq,rq->r", rows, known, rows), 0.0))
    return bool((rows @ values[:rank] < -_BEYOND_DOUBT * spread).mean() > 0.5)


def unseen(model: Model, deviations: Array) -> tuple[tuple[str, ...], bool]:
    """Return the base parameters that a log cannot show, and whether they are too many.

    Their standard deviation, among the (p,) of all values, is larger than what they are made of.
    One that is 10 000 times larger is too many: its actuator's forces are no forces of the machine.
    """
    base = model.base
    share = deviations[: base.rank] / usual_sizes(base, parameters(model.robot))
    hidden = share > 1.0
    names = tuple(name for name, flag in zip(base.names, hidden, strict=True) if flag)
    return names, bool(hidden.mean() > _MOST_UNSEEN or share.max() > _NO_FORCES)


def usual_sizes(base: BaseParameters, drawn: Array) -> Array:
    """Return the sizes (rank,) of what base parameters are made of, for CAD parameters (N,).

    What is drawn as zero, such as m gamma_y of a straight link, is not that exactly: it counts as a
    share of the body's mass and length.
    """
    bodies = bodies_of(base)
    masses = bodies.mean(np.abs(drawn))[bodies.masses]
    least = _LEAST_SHARE * bodies.sharing @ bodies.scale(masses)
    return np.asarray(np.abs(base.grouping) @ np.maximum(np.abs(drawn), least))
