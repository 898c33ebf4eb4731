"""Margins of a motion to its limits, each at the instant where it is least."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pteron.equations.drives import drives_of
from pteron.equations.machine import closure_of
from pteron.errors import ModelError
from pteron.identification.excitation.limits import (
    PER_JOINT,
    Limits,
    joint_clearances,
    joint_limits,
    joint_sizes,
    unit_of,
)
from pteron.identification.excitation.movement import Movement
from pteron.identification.signals.states import FullMotion, home
from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.kinematics.limits import limited_joints
from pteron.kinematics.sampling import holding_measures
from pteron.kinematics.singularities import best_holding
from pteron.manipulator import Manipulator
from pteron.result import Result
from pteron.workspace.margins import joint_distances

_REFINED = 33
"""Samples between the neighbours of the tightest sample, by which its time is refined."""


@dataclass(frozen=True, eq=False, repr=False)
class Margin(Result):
    """The least margin of a motion to one limit.

    Attributes
    ----------
    limit : str
        The name of the limit, a field of `Limits`.
    least : float
        Distance to the limit at the tightest instant, in `unit`; below 0 it is violated.
    leg : int or None
        The leg with this margin, counted from 1; None for the platform's orientation.
    time : float
        The tightest instant, s.
    unit : str
        The unit of `least`.
    """

    limit: str
    least: float
    leg: int | None
    time: float
    unit: str


@dataclass(frozen=True, eq=False, repr=False)
class Margins(Result):
    """The least margin to every limit that is in force.

    Attributes
    ----------
    each : tuple of Margin
        One for each limit.
    samples : int
        Instants of the motion at which limits are evaluated; more near the tightest ones.
    """

    ROWS = "each"

    each: tuple[Margin, ...]
    samples: int

    @property
    def kept(self) -> bool:
        """Whether no limit is violated."""
        return all(margin.least >= 0.0 for margin in self.each)

    def __iter__(self) -> Iterator[Margin]:
        return iter(self.each)

    def __getitem__(self, limit: str) -> Margin:
        return {margin.limit: margin for margin in self.each}[limit]


def margins(motion: Movement, limits: Limits, samples: int = 4000) -> Margins:
    """Return the least margins of a motion to its limits.

    Parameters
    ----------
    motion : FourierMotion or another movement
        The motion; a `FourierMotion`, a `LedMotion` or a `RepeatedCycle`.
    limits : Limits
        The limits.
    samples : int
        Instants, evenly over the motion, at which every limit is evaluated.

    Examples
    --------
    >>> import pteron
    >>> from pteron.identification.excitation import Limits, margins, random_excitation
    >>> motion = random_excitation(pteron.load("tripteron"), harmonics=2, seed=1)
    >>> margins(motion, Limits()).kept
    True
    """
    times, step = np.linspace(0.0, motion.duration, samples, retstep=True)
    least_margins, robot = [], motion.robot
    coarse = _margins_of(robot, limits, motion.states(times))
    for name, of_limit in coarse.items():
        tightest = times[int(of_limit.min(axis=-1).argmin())]
        near = tightest + np.linspace(-step, step, _REFINED)
        of_limit = _margins_of(robot, limits, motion.states(near))[name]
        k, leg = np.unravel_index(int(of_limit.argmin()), of_limit.shape)
        # An angle of the platform counts for every leg alike.
        of_platform = name == "passive_clearance" and robot.platform.limits is not None
        has_owner = name != "type_ii" and not (of_platform and np.ptp(of_limit[k]) == 0.0)
        owner, unit = int(leg) + 1 if has_owner else None, unit_of(robot, name, int(leg))
        when = float(near[k] % motion.duration)
        least_margins.append(Margin(name, float(of_limit[k, leg]), owner, when, unit))
    return Margins(tuple(least_margins), samples)


def relative_margins(motion: Movement, limits: Limits, times: Array) -> dict[str, Array]:
    """Return the margins at times (T,), each over its limit's size: (T, n), or (T, 1)."""
    robot = motion.robot
    # Half its range for a joint, 1 for the two measures, else the limit itself.
    sizes = {name: joint_limits(limits, name, robot) for name in PER_JOINT}
    sizes["joint_clearance"] = joint_sizes(robot)
    absolute = _margins_of(robot, limits, motion.states(times))
    relative = {}
    for name, margin in absolute.items():
        size = np.broadcast_to(sizes.get(name, 1.0), margin.shape[1:])
        # A limit that is infinite has its whole margin.
        relative[name] = np.divide(
            margin, size, out=np.full(margin.shape, np.inf), where=np.isfinite(size)
        )
    return relative


def check_rest(robot: Manipulator, home: Array, limits: Limits) -> None:
    """Raise ModelError if the machine violates limits at rest in its home pose, naming one."""
    zero = np.zeros((1, len(home)))
    at_rest = FullMotion.from_platform(robot, home[None], zero, zero)
    for name, at_home in _margins_of(robot, limits, at_rest).items():
        leg = int(at_home[0].argmin())
        margin = at_home[0, leg]
        if margin > 0.0:
            continue
        whose = "the platform" if name == "type_ii" else f"leg {leg + 1}"
        setting = getattr(limits, name)
        if name == "force":
            limit_text, has = f"at most {setting}", joint_limits(limits, name, robot)[leg] - margin
        else:
            limit_text, has = f"at least {setting:g}", setting + margin
        raise ModelError(
            f"limits: {name} of {limit_text} {unit_of(robot, name, leg)}".rstrip()
            + f" is impossible: {whose} of {robot.name} has {has:.4g} at rest in the home pose, "
            "the best one; loosen it"
        )


@lru_cache(maxsize=64)
def _has_passive_limits(robot: Manipulator) -> bool:
    """Return whether any passive joint has limits."""
    joints = limited_joints(robot, np.array(home(robot)))
    return not all(joint.actuated for joint in joints)


def _margins_of(robot: Manipulator, limits: Limits, state: FullMotion) -> dict[str, Array]:
    """Return every limit's margins (T, n), or (T, k) to k singularities; -inf out of reach."""
    margins = {"type_i": evaluate_unchecked(robot, "reach", state.pose)[1] - limits.type_i}
    if closure_of(robot).vanishes() is None or robot.platform.angles:
        measures = [evaluate_unchecked(robot, n, state.pose) for n in holding_measures(robot)]
        shares = np.abs(np.stack(measures, axis=-1)) / best_holding(robot)
        margins["type_ii"] = shares - limits.type_ii
    if any(leg.limits for leg in robot.legs):
        clearances = joint_clearances(limits, robot)
        margins["joint_clearance"] = joint_distances(robot, state.joints) - clearances
    if _has_passive_limits(robot):
        passive = evaluate_unchecked(robot, "passive_room", state.pose)[0]
        margins["passive_clearance"] = passive - limits.passive_clearance
    margins["speed"] = joint_limits(limits, "speed", robot) - np.abs(state.rates)
    margins["acceleration"] = joint_limits(limits, "acceleration", robot) - np.abs(
        state.accelerations
    )
    if limits.force is not None:
        drives, zeros = drives_of(robot), np.zeros_like(state.pose)
        moving = evaluate_unchecked(robot, "inverse_dynamics", *state[:3])
        moving = moving + drives.inertia * state.accelerations + drives.viscous * state.rates
        static = evaluate_unchecked(robot, "inverse_dynamics", state.pose, zeros, zeros)
        needed = np.maximum(np.abs(moving + drives.offset), np.abs(static + drives.offset))
        # Dry friction counts in full, whichever way a joint moves.
        dry = drives.coulomb + drives.stribeck
        margins["force"] = joint_limits(limits, "force", robot) - dry - needed
    return {name: np.where(np.isnan(margin), -np.inf, margin) for name, margin in margins.items()}
