"""What an exciting trajectory must keep at every instant, and how far a motion stays from it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pteron.equations.machine import closure_of
from pteron.errors import DataError, ModelError
from pteron.identification.excitation.fourier import FourierMotion, State, states
from pteron.identification.signals.states import home
from pteron.kernels import Array
from pteron.kinematics.evaluate import unchecked
from pteron.kinematics.singularities import best_type_ii
from pteron.manipulator import Manipulator
from pteron.workspace.limits import limited_joints
from pteron.workspace.reserve import clearances

UNITS = {
    "type_i": "",
    "type_ii": "",
    "joint_clearance": "{unit}",
    "passive_clearance": "",
    "speed": "{unit}/s",
    "acceleration": "{unit}/s^2",
    "force": "{force_unit}",
}
"""The limits by name, and the units of their margins: those of the joint."""

PER_JOINT = ("speed", "acceleration", "force")
"""Those that may be given for each joint."""

_REFINED = 33
"""Samples between the neighbours of the tightest sample, for its exact place."""


@dataclass(frozen=True)
class Limits:
    """What a trajectory must keep at every instant.

    Attributes
    ----------
    speed : float or sequence of n floats
        Largest speed of the joints, m/s or rad/s.
    acceleration : float or sequence of n floats
        Largest acceleration of the joints, m/s^2 or rad/s^2.
    force : float or sequence of n floats, optional
        Largest actuator force, N or N m, by the machine's nominal inertia without friction; None
        for no limit.
    type_i : float
        Least type-I measure of each leg, in (0, 1): the distance from stretched and folded legs.
    type_ii : float
        Least share, in (0, 1), of the best type-II measure that the machine has: the distance from
        poses where the actuators do not hold the platform. Without meaning where J is constant.
    joint_clearance : float
        Least distance of the actuated joints from their limits, m or rad; without effect on a joint
        that has none.
    passive_clearance : float
        Least distance of the passive joints and of phi from their limits, over half their ranges,
        in [0, 1).

    Raises
    ------
    DataError
        If a number is not what it should be; the message names it.

    Examples
    --------
    >>> from pteron.identification.excitation import Limits
    >>> Limits(speed=[0.5, 0.5, 1.0, 0.5]).speed
    (0.5, 0.5, 1.0, 0.5)
    """

    speed: float | Sequence[float] = 1.0
    acceleration: float | Sequence[float] = 10.0
    force: float | Sequence[float] | None = None
    type_i: float = 0.25
    type_ii: float = 0.3
    joint_clearance: float = 0.005
    passive_clearance: float = 0.02

    def __post_init__(self) -> None:
        for name in PER_JOINT:
            given = getattr(self, name)
            if given is None and name == "force":
                continue
            several = isinstance(given, list | tuple | np.ndarray)
            values = tuple(_number(name, value) for value in (given if several else (given,)))
            if not values or min(values) <= 0.0:
                raise DataError(f"limits: {name} {given} given, numbers above 0 expected")
            object.__setattr__(self, name, values if several else values[0])
        for name in ("type_i", "type_ii"):
            value = _number(name, getattr(self, name))
            if not 0.0 < value < 1.0:
                raise DataError(f"limits: {name} {value:g} given, between 0 and 1 expected")
        if _number("joint_clearance", self.joint_clearance) < 0.0:
            raise DataError(
                f"limits: joint_clearance {self.joint_clearance:g} given, 0 or more expected"
            )
        if not 0.0 <= _number("passive_clearance", self.passive_clearance) < 1.0:
            raise DataError(
                f"limits: passive_clearance {self.passive_clearance:g} given, at least 0 and below "
                "1 expected"
            )


def per_joint(limits: Limits, name: str, robot: Manipulator) -> Array:
    """Return a limit of each joint (n,), infinite where there is none."""
    given = getattr(limits, name)
    values = np.atleast_1d(np.array(np.inf if given is None else given, dtype=float))
    if values.size not in (1, robot.freedom):
        raise DataError(
            f"limits: {values.size} numbers for {name}, one expected or {robot.freedom}, one for "
            f"each joint of {robot.name}"
        )
    return np.broadcast_to(values, (robot.freedom,)).copy()


def joint_sizes(robot: Manipulator) -> Array:
    """Return half the range (n,) of each joint, m or rad; 1 where it has no limits."""
    ranges = [leg.limits or (-1.0, 1.0) for leg in robot.legs]
    return np.array([0.5 * (high - low) for low, high in ranges])


def unit_of(robot: Manipulator, name: str, leg: int) -> str:
    """Return the unit of a limit's margin, for the joint of a leg, counted from 0."""
    joint = robot.legs[leg].joint
    return UNITS[name].format(unit=joint.unit, force_unit=joint.force_unit)


def _number(name: str, value: object) -> float:
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise DataError(f"limits: {name} {value!r} given, a number expected") from None
    if not math.isfinite(number):
        raise DataError(f"limits: {name} {number} given, a finite number expected")
    return number


@dataclass(frozen=True)
class Margin:
    """How near a motion comes to one limit.

    Attributes
    ----------
    limit : str
        The name of the limit, a field of `Limits`.
    least : float
        What is left of it at the tightest instant, in `unit`; below 0 it is violated.
    leg : int or None
        The leg it happens to, counted from 1; None for the platform's orientation.
    time : float
        When, s.
    unit : str
        The unit of `least`.
    """

    limit: str
    least: float
    leg: int | None
    time: float
    unit: str


@dataclass(frozen=True)
class Margins:
    """The least margin to every limit that is in force.

    Attributes
    ----------
    each : tuple of Margin
        One for each limit.
    samples : int
        Instants of the period that were looked at; near the tightest ones, many more.
    """

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


def margins(motion: FourierMotion, limits: Limits, samples: int = 4000) -> Margins:
    """Return how far a motion stays from its limits.

    Parameters
    ----------
    motion : FourierMotion
        The motion.
    limits : Limits
        What it is to keep.
    samples : int
        Instants, evenly over the period, at which every limit is looked at.

    Examples
    --------
    >>> import pteron
    >>> from pteron.identification.excitation import Limits, margins, random_excitation
    >>> motion = random_excitation(pteron.load("tripteron"), harmonics=2, seed=1)
    >>> margins(motion, Limits()).kept
    True
    """
    times = motion.uniform_times(samples)
    step = motion.period / samples
    found = []
    coarse = _margins_of(motion.robot, limits, states(motion, times))
    for name, values in coarse.items():
        tightest = times[int(values.min(axis=-1).argmin())]
        near = tightest + np.linspace(-step, step, _REFINED)
        values = _margins_of(motion.robot, limits, states(motion, near))[name]
        k, leg = np.unravel_index(int(values.argmin()), values.shape)
        found.append(
            Margin(
                name,
                float(values[k, leg]),
                None if name == "type_ii" else int(leg) + 1,
                float(near[k] % motion.period),
                unit_of(motion.robot, name, int(leg)),
            )
        )
    return Margins(tuple(found), samples)


def relative_margins(motion: FourierMotion, limits: Limits, times: Array) -> dict[str, Array]:
    """Return the margins at times (T,), each over its limit's size: (T, n), or (T, 1)."""
    robot = motion.robot
    # Half its range for a joint, 1 for the two measures, else the limit itself.
    sizes = {name: per_joint(limits, name, robot) for name in PER_JOINT}
    sizes["joint_clearance"] = joint_sizes(robot)
    found = _margins_of(robot, limits, states(motion, times))
    return {name: values / sizes.get(name, 1.0) for name, values in found.items()}


def check_rest(robot: Manipulator, home: Array, limits: Limits) -> None:
    """Refuse limits that the machine at rest in its home pose does not keep, naming the limit."""
    zero = np.zeros_like(home)
    rest = State(home, zero, zero, unchecked(robot, "joint_coordinates", home), zero, zero)
    rows = State(*(value[None] for value in rest))
    for name, values in _margins_of(robot, limits, rows).items():
        leg = int(values[0].argmin())
        left = values[0, leg]
        if left > 0.0:
            continue
        whose = "the platform" if name == "type_ii" else f"leg {leg + 1}"
        given = getattr(limits, name)
        if name == "force":
            wanted, has = f"at most {given}", per_joint(limits, name, robot)[leg] - left
        else:
            wanted, has = f"at least {given:g}", given + left
        raise ModelError(
            f"limits: {name} of {wanted} {unit_of(robot, name, leg)}".rstrip()
            + f" is impossible: {whose} of {robot.name} has {has:.4g} at rest in the home pose, "
            "the best one; loosen it"
        )


@lru_cache(maxsize=64)
def _limits_passive(robot: Manipulator) -> bool:
    """Return whether any passive joint has limits."""
    joints = limited_joints(robot, np.array(home(robot)))
    return not all(joint.actuated for joint in joints)


def _margins_of(robot: Manipulator, limits: Limits, state: State) -> dict[str, Array]:
    """Return every limit's margins (T, n) or (T, 1), -inf where the machine cannot be."""
    found = {"type_i": unchecked(robot, "reach", state.pose)[1] - limits.type_i}
    if closure_of(robot).vanishes() is None or robot.platform.turns:
        type_ii = np.abs(unchecked(robot, "type_ii", state.pose))[:, None]
        found["type_ii"] = type_ii / best_type_ii(robot) - limits.type_ii
    if any(leg.limits for leg in robot.legs):
        found["joint_clearance"] = clearances(robot, state.joints) - limits.joint_clearance
    if _limits_passive(robot):
        room = unchecked(robot, "passive_room", state.pose)[0]
        found["passive_clearance"] = room - limits.passive_clearance
    found["speed"] = per_joint(limits, "speed", robot) - np.abs(state.rates)
    found["acceleration"] = per_joint(limits, "acceleration", robot) - np.abs(state.accelerations)
    if limits.force is not None:
        motion = state.pose, state.velocity, state.acceleration
        forces = unchecked(robot, "inverse_dynamics", *motion)
        found["force"] = per_joint(limits, "force", robot) - np.abs(forces)
    return {name: np.where(np.isnan(values), -np.inf, values) for name, values in found.items()}
