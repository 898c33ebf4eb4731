"""Notes on a fit, and advice on motions that show more of its values: sentences for people.

Notes say what was done and found; advice says what to do next.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pteron.identification.estimators import Estimate
from pteron.identification.faults.fault import describe_held_forces
from pteron.identification.model import Model
from pteron.identification.unknowns import Unknowns
from pteron.manipulator import Manipulator, parameter_data, parameters
from pteron.reduction import BaseParameters

_SLOWLY = (
    "It shows where joints move slowly: pteron excite ROBOT --stribeck --out motion.csv writes "
    "motion-slow.csv too; record it, and give its log with the others."
)

_EQUAL = 1e-3
"""Difference of the legs' parameters, relative, that is rounding of a drawing's numbers."""


def advice_on_hidden_values(
    base: BaseParameters, hidden: Sequence[str], *, clean: bool
) -> list[str]:
    """Return advice on base parameters that a motion does not show: shared legs, or more motion.

    Sharing is advised only for a log that is `clean`: fewer parameters absorb less of a fault.
    """
    robot, advice = base.robot, []
    if clean and not any(len(p.legs) > 1 for p in base.parameters) and _has_equal_legs(robot):
        advice.append(
            "The legs are equal in the file: --shared identifies one set of parameters for all of "
            "them, which the same motion determines better."
        )
    return [
        *advice,
        f"Not determined by this motion and left near the drawing: {', '.join(hidden)}. pteron "
        "excite ROBOT --out motion.csv writes a motion that determines more; --speed and "
        "--acceleration make it faster.",
    ]


def _has_equal_legs(robot: Manipulator) -> bool:
    """Return whether all legs have the same kind and the same inertial parameters as drawn."""
    groups: dict[tuple[str, str], list[float]] = {}
    for parameter, size in zip(parameter_data(robot), parameters(robot).tolist(), strict=True):
        if parameter.legs:
            groups.setdefault((parameter.kind, parameter.body), []).append(size)
    legs = len(robot.legs)
    return all(
        len(group) == legs and np.ptp(group) <= _EQUAL * np.max(np.abs(group))
        for group in groups.values()
    )


def advice_on_weak_values(model: Model, weak: Sequence[str]) -> list[str]:
    """Return advice on motions that show more of weak values: slow ones for Stribeck's friction."""
    kinds = dict(zip(model.names, model.kinds, strict=True))
    falling = [name for name in weak if kinds[name] == "stribeck"]
    others = [name for name in weak if name not in falling]
    advice = []
    if others:
        advice.append(
            f"To determine {', '.join(others)} better, record a motion of pteron excite ROBOT "
            "--out motion.csv, faster (--speed, --acceleration) and longer (--periods)."
        )
    if falling:
        advice.append(f"This motion hardly determines {', '.join(falling)}. {_SLOWLY}")
    return advice


def notes_on_fit(model: Model, estimate: Estimate, rotors: dict[str, float]) -> list[str]:
    """Return notes on convergence, known rotors, and terms that others absorb."""
    notes, units = [], {term.name: term.unit for term in model.all_terms}
    if not estimate.converged:
        notes.append(
            f"The estimator {estimate.method} has not converged in {estimate.iterations} "
            "iterations: values and intervals may be wrong; choose another estimator, or record "
            "longer."
        )
    notes += [
        f"{name} = {mass:.6g} {units[name]} is known from the file, and not part of the bodies."
        for name, mass in rotors.items()
    ]
    for name, shares in model.joins.items():
        notes.append(f"{name} is contained in {' and '.join(shares) or 'no value: no effect'}.")
    return notes


def notes_on_unknowns(unknowns: Unknowns, model: Model, *, default: bool, half: bool) -> list[str]:
    """Return notes on the delay and the speeds of Stribeck's friction that were fitted.

    `default` says that the delay was corrected by default; the faults of the log report it, unless
    it is `half` a sample, which is no fault.
    """
    notes = []
    if default and half:
        notes.append(
            f"{describe_held_forces(unknowns.delay)}; this is corrected (--delay 0 leaves it in)."
        )
    elif unknowns.delay_deviation and not default:
        notes.append(
            f"The forces are {1e3 * unknowns.delay:.3g} ms "
            f"(+- {2e3 * unknowns.delay_deviation:.1g}) late for the positions; this is corrected."
        )
    if unknowns.speeds is not None:
        low, high = unknowns.speed_intervals()
        joints = [leg.joint for leg in model.robot.legs]
        seen = np.isfinite(unknowns.speeds)
        parts = [
            f"{unknowns.speeds[i]:.3g} ({low[i]:.3g} to {high[i]:.3g}) {joint.unit}/s"
            for i, joint in enumerate(joints)
            if seen[i]
        ]
        if parts:
            notes.append(f"Friction falls with these speeds (95 %): {', '.join(parts)}.")
        hidden = [name for name, s in zip(model.robot.force_names, seen, strict=True) if not s]
        if hidden:
            notes.append(f"Friction is not seen to fall at {', '.join(hidden)}. {_SLOWLY}")
    return notes
