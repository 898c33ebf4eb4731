"""Plausibility of identified values: warnings of values that cannot be this machine's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.identification.consistency import Consistency
from pteron.identification.consistency.bodies import bodies_of
from pteron.identification.estimators import Estimate
from pteron.identification.model import Model
from pteron.identification.observation import Observations
from pteron.identification.recordings import Recording
from pteron.identification.signals import Preprocessing
from pteron.kernels import Array
from pteron.kinematics import random_poses
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.manipulator import Manipulator, parameters
from pteron.reduction import BaseParameters, base_regressor
from pteron.tolerances import SAME

_PROBES = 50
"""Random poses at which kinetic energy must be positive: an energy that is negative at a tenth of
the poses is missed once in 200 times."""

_NO_FORCES = 1e4
"""Standard deviation of a base parameter, over its usual size, beyond which the forces are not the
machine's."""

_FAR_ABOVE = 5.0
"""Residuals, over the forces' noise, from which the model is not the machine's: friction that the
model does not know, and elasticity, leave up to three times the noise in logs of built machines."""

_FAR = 0.5
"""Difference from the drawn machine, over a base parameter's usual size, from which a warning is
given."""

_TOLD = 0.3
"""Largest difference of the bodies' forces from a multiple of the drawn ones, over them, for that
multiple to be reported: bodies up to 30 % denser or lighter than drawn differ by less."""

_APART = 1.5
"""Least common factor, or its inverse, that is a wrong scale rather than a bad drawing."""

_LEAST_SHARE = 0.02
"""Least usual size of a parameter, as a share of its body's mass and length: a centre of mass is
seldom nearer to the middle of a link than a fiftieth of its length."""

_CERTAIN = 3.0
"""Standard deviations by which energy is certainly below zero: by chance once in 700 times."""

_NOTABLE = 0.1
"""Energy below zero, over that of the machine as drawn, from which it counts: without noise the
slightest is certain."""

_PUSHED = 0.05
"""Share of the forces from which friction that pushes counts, likewise."""

_FELT = 1e-4
"""Share of the forces from which friction below zero is reported: rounding has a sign."""

_FRICTION = ("coulomb", "viscous", "passive")
"""Terms of friction, which brakes."""

_POSITIVE = ("coulomb", "viscous", "passive", "rotor")
"""Terms that no machine has below zero."""

CHANCE = 1e-3
"""Probability below which infeasible values, or a payload's, are not chance."""

CLEAR = 5.0
"""Distance of a scale from one, in standard deviations, from which it is reported."""

WANTED = 0.05
"""Share of the forces, or of the weight, that a log must be able to show."""

_USUAL_ERROR = 0.02
"""Error of a payload's mass, or of a rotor's inertia, that is usual: kitchen scales and data sheets
are as good."""


def plausibility_warnings(
    model: Model,
    estimate: Estimate,
    known: Array,
    consistency: Consistency | None,
    cad: Manipulator | None,
    factor: float = 1.0,
) -> list[str]:
    """Return warnings of values that predict forces well and yet belong to another machine.

    `known` (p,) is the part of the values that is none of the bodies, such as rotors; `consistency`
    are the real bodies that were found, and `cad` is the machine as it is drawn.
    """
    warnings = []
    if has_negative_inertia(model, estimate.values, estimate.covariance):
        warnings.append("With these values the machine has negative inertia: forces do not belong.")
    if consistency is not None and consistency.p_value < CHANCE:
        warnings.append(
            f"No real bodies have these values: they are {consistency.distance:.2g} standard "
            "deviations away. Look at what the model takes for granted: geometry, working mode, "
            "units, legs that share parameters."
        )
    if cad is not None:
        drawn = parameters(cad)
        base = model.base
        usual = usual_sizes(base, drawn)
        base_values = (estimate.values - known)[: base.rank]
        off = np.abs(base_values - base.grouping @ drawn)
        far = (off > _FAR * usual) & (off > 5.0 * estimate.deviations[: base.rank])
        worst = [k for k in np.argsort(-off / np.maximum(usual, 1e-300)) if far[k]][:3]
        if worst and factor == 1.0:
            names = ", ".join(
                f"{base.names[k]} ({base_values[k]:.3g}, drawn {base.grouping[k] @ drawn:.3g})"
                for k in worst
            )
            warnings.append(
                f"Far from the drawn machine: {names}. If the bodies are not that different, look "
                "at geometry, working mode and units: other ones can explain forces as well."
            )
    return warnings


def friction_below_zero(model: Model, observations: Observations, fit: Estimate) -> tuple[str, ...]:
    """Return a sentence on friction significantly below zero; empty if there is none."""
    high = fit.intervals()[1]
    felt = (high < 0.0) & _values_that_contribute(observations, fit, _FELT)
    chosen = np.flatnonzero(np.isin(model.kinds, _FRICTION) & felt)
    if not len(chosen):
        return ()
    negative = ", ".join(
        f"{fit.names[k]} = {fit.values[k]:.2g} (+- {high[k] - fit.values[k]:.1g}) {fit.units[k]}"
        for k in chosen
    )
    return (
        f"Friction is below zero beyond its interval, which is impossible: {negative}. Without any "
        "friction one in 40 is so by chance; otherwise an effect acts that the model lacks, and "
        "the intervals are too short.",
    )


def common_factor(
    model: Model,
    estimate: Estimate,
    known: Array,
    drawn: Manipulator | None,
    observations: Observations,
) -> float:
    """Return the factor between the identified and the drawn bodies' forces; 1 if unclear.

    It is that of least squares. Forces that differ by more than drawings do have no factor; `known`
    (p,) is the rotors' part of the values.
    """
    if drawn is None:
        return 1.0
    base = model.base
    rigid = observations.matrix[..., : base.rank].reshape(-1, base.rank)
    as_drawn = rigid @ (base.grouping @ parameters(drawn) + known[: base.rank])
    forces = rigid @ estimate.values[: base.rank]
    power = float(as_drawn @ as_drawn)
    if not power > 0.0:
        return 1.0
    factor = float(forces @ as_drawn) / power
    spread = float(np.linalg.norm(forces - factor * as_drawn))
    if factor <= 0.0 or spread > _TOLD * float(np.linalg.norm(forces)):
        return 1.0
    return 1.0 if 1.0 / _APART < factor < _APART else factor


class Factor(NamedTuple):
    """The factor of all forces, and its standard deviation."""

    value: float
    deviation: float

    @property
    def is_detectable(self) -> bool:
        """Whether a factor of practical size would be significant."""
        return CLEAR * self.deviation < WANTED

    def times(self, number: float) -> Factor:
        """Return the factor of the forces multiplied by a number."""
        return Factor(number * self.value, abs(number) * self.deviation)

    @property
    def wrong(self) -> bool:
        """Whether the factor differs from 1 significantly, by more than known values may err."""
        return abs(self.value - 1.0) > max(CLEAR * self.deviation, _USUAL_ERROR)

    @property
    def chance(self) -> float:
        """p-value of the estimated factor if the true factor is 1."""
        return float(2.0 * scipy.stats.norm.sf(abs(self.value - 1.0) / max(self.deviation, 1e-300)))


def known_values(
    model: Model, recordings: Sequence[Recording], rotors: Mapping[str, float]
) -> dict[str, float]:
    """Return the known values by name: those of a declared payload and of rotors.

    A rotor's is known as the model has it: where legs share their bodies' inertia one rotor joins
    them, and of the others the values are their differences from it.
    """
    part = model.known_values(rotors)
    by_name = {name: float(part[model.names.index(name)]) for name in rotors if name in model.names}
    for recording in recordings:
        if (payload := recording.head().description.payload) is not None:
            kinds = model.robot.platform.inertia.kinds
            by_name |= zip((f"{kind}_L" for kind in kinds), payload.values, strict=True)
    least = SAME * max(map(abs, rotors.values()), default=0.0)
    return {n: size for n, size in by_name.items() if n in model.names and abs(size) > least}


def factor_of_forces(model: Model, fit: Estimate, known: Mapping[str, float]) -> Factor | None:
    """Return the common factor of all forces from known values; None without these."""
    if not known:
        return None
    places = [model.names.index(name) for name in known]
    true = np.array(list(known.values()))
    weights = np.linalg.pinv(fit.covariance[np.ix_(places, places)], hermitian=True) @ true
    power = float(weights @ true)
    if not power > 0.0:
        return None
    return Factor(float(weights @ fit.values[places]) / power, power**-0.5)


def excess_residual_cause(estimate: Estimate, preprocessing: Sequence[Preprocessing]) -> str:
    """Return a cause for residuals far larger than the forces' noise; empty if they are not."""
    noise = np.max([how.force_noise for how in preprocessing], axis=0)
    ratio = float((estimate.noise / np.maximum(noise, np.finfo(float).tiny)).max())
    if ratio < _FAR_ABOVE:
        return ""
    return (
        f"the model leaves {ratio:.0f} times the noise of the forces, as where friction is left "
        "out, a force stands out, or it is the log of another machine"
    )


def has_negative_inertia(model: Model, beta: Array, covariance: Array) -> bool:
    """Return whether values (p,) give a machine whose kinetic energy is certainly negative."""
    return _negative_directions(model, beta, covariance) > 0


def unphysical(model: Model, observations: Observations, fit: Estimate) -> int:
    """Return the number of physically impossible properties of a fit's values.

    Directions of motion in which kinetic energy is negative, and joints that friction pushes, with
    more than 5 % of the forces.
    """
    pushed = np.isin(model.kinds, _POSITIVE) & (fit.values < -_CERTAIN * fit.deviations)
    pushed &= _values_that_contribute(observations, fit, _PUSHED)
    return _negative_directions(model, fit.values, fit.covariance) + int(pushed.sum())


def _values_that_contribute(
    observations: Observations, fit: Estimate, share: float
) -> NDArray[np.bool_]:
    """Return whether values (p,) contribute more than a share of the forces of an actuator."""
    effect = np.abs(fit.values) * np.sqrt((observations.matrix**2).mean(axis=0))
    size = np.sqrt((observations.forces**2).mean(axis=0))
    return np.asarray((effect > share * size[:, None]).any(axis=0))


def _negative_directions(model: Model, beta: Array, covariance: Array) -> int:
    """Return the number of directions in which kinetic energy is negative in most poses."""
    # x''^T M x'' is positive for every real machine, whatever its CAD says.
    robot, rng = model.robot, np.random.default_rng(0)
    drawn = model.base.grouping @ parameters(robot)
    pose = random_poses(robot, _PROBES, seed=rng)
    zero = np.zeros_like(pose)
    gravity_regressor = base_regressor(robot, model.base, pose, zero, zero)
    jacobians = evaluate_unchecked(robot, "jacobian", pose)
    rank = model.base.rank
    known = covariance[:rank, :rank]
    directions = [rng.normal(size=pose.shape), *(zero + axis for axis in np.eye(pose.shape[1]))]
    count = 0
    for direction in directions:
        needed = base_regressor(robot, model.base, pose, zero, direction)
        rows = np.einsum("rnp,rnm,rm->rp", needed - gravity_regressor, jacobians, direction)
        spread = np.sqrt(np.maximum(np.einsum("rp,pq,rq->r", rows, known, rows), 0.0))
        least = np.maximum(_CERTAIN * spread, _NOTABLE * np.abs(rows @ drawn))
        count += bool((rows @ beta[:rank] < -least).mean() > 0.5)
    return count


def unseen_names(model: Model, deviations: Array) -> tuple[str, ...]:
    """Return the base parameters whose deviations (p,) exceed their usual size."""
    return unseen_shares(model, deviations)[0]


def unseen_shares(model: Model, deviations: Array) -> tuple[tuple[str, ...], bool]:
    """Return the base parameters that a log cannot show, and whether it shows none at all.

    One whose deviation is 10 000 times its usual size says that its actuator's forces are no forces
    of the machine: then nothing is seen.
    """
    base = model.base
    share = deviations[: base.rank] / usual_sizes(base, parameters(model.robot))
    hidden = share > 1.0
    names = tuple(name for name, flag in zip(base.names, hidden, strict=True) if flag)
    return names, bool(share.max() > _NO_FORCES)


def usual_sizes(base: BaseParameters, drawn: Array) -> Array:
    """Return the usual sizes (rank,) of base parameters, for CAD parameters (N,).

    A parameter drawn as zero, such as m gamma_y of a straight link, is not that exactly: it counts
    as a share of the body's mass and length.
    """
    bodies = bodies_of(base)
    masses = bodies.mean(np.abs(drawn))[bodies.masses]
    least = _LEAST_SHARE * bodies.sharing @ bodies.scale(masses)
    return np.asarray(np.abs(base.grouping) @ np.maximum(np.abs(drawn), least))
