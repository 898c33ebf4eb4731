"""Columns of the regressor for faults of a log or of a machine, such as delayed forces.

A small fault adds to the forces its size times a column that follows from the fit: a delay of the
forces adds its time times minus their derivative. `FaultColumns` puts these behind the model's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pteron.equations.friction import passive_joints
from pteron.identification.faults.fault import FaultName
from pteron.identification.faults.fitted_motion import FittedMotion, lengths_of
from pteron.identification.model import Model, diagonal, extend_model, identification_model
from pteron.identification.signals import States
from pteron.identification.signals.filters import lowpass
from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.manipulator import Manipulator

_STRIBECK = (0.05, 0.15, 0.4)
"""Speeds at which friction may fall, over each joint's root mean square: all are tried."""

_EIGHTHS = tuple(f"the {k} eighth" for k in ("1st", "2nd", "3rd", *(f"{n}th" for n in range(4, 9))))
"""Parts of a log in which the platform may carry another mass."""

_LENGTH = 0.01
"""Usual error of a length, over the legs' size: a larger one is more likely another fault."""

_ZERO_OF_SLIDE, _ZERO_OF_CRANK = 0.02, 0.05
"""Usual errors of a zero: a share of the leg's size, and rad (3 degrees, a tooth of a belt's
pulley)."""

_RATIO = 0.05
"""Usual error of a ratio, as by a pulley with a tooth more."""

_NEGLIGIBLE = 1e-3
"""Errors of ratios, of lengths over the legs' size, and of zeros, rad, that every machine has: the
bias of smoothed positions next to singularities looks like up to 0.7 of them."""

_LIGHT = 0.1
"""Payload, as a share of the platform's mass, that is negligible: it varies with time as freely as
the bias of positions next to singularities, which looks like up to 0.09 of it."""

_DRY = ("coulomb", "stribeck")
"""Kinds of terms that jump where a joint reverses."""


class Tolerance(NamedTuple):
    """The usual size of a fault, 0 if unknown, and the size up to which it is negligible."""

    usual: float = 0.0
    negligible: float = 0.0


_UNKNOWN = Tolerance()


@dataclass(frozen=True)
class Family:
    """A family of fault columns: how one fault changes the forces.

    Parameters
    ----------
    name : str
        The fault.
    unit : str
        Unit of the sizes that columns are multiplied by.
    sizes : callable
        Returns their labels, k of them, for a model.
    columns : callable
        Returns the columns (R, n, k) at a motion.
    of_machine : bool
        Whether the machine itself has the fault, so that feed-forward should know it; else only the
        log has it.
    positive : bool
        Whether sizes below zero are none of this fault.
    largest : float
        Sizes beyond it are another fault, told badly.
    speed : float, optional
        Speed with which friction falls, over the usual one.
    exact : bool
        Whether its columns have sizes as large as they may be, not to first order.
    tolerance : Tolerance
        The sizes that such a fault usually has.
    free : bool
        Whether its sizes vary with time as they like, so that it must explain all that noise does
        not: part of other faults' residuals it always explains.
    of_path : bool
        Whether its columns are made of derivatives by time, of states one after the other.
    effect : callable, optional
        Returns how the machine's forces change, where that is otherwise than those of the log: by a
        clock that is off all inertia is, and with it the mass that weighs.
    """

    name: FaultName
    unit: str
    sizes: Callable[[Model], Sequence[str]]
    columns: Callable[[FittedMotion], Array]
    of_machine: bool = True
    positive: bool = False
    largest: float = np.inf
    speed: float | None = None
    exact: bool = False
    tolerance: Tolerance = _UNKNOWN
    free: bool = False
    of_path: bool = False
    effect: Callable[[FittedMotion], Array] | None = None

    def deviation_columns(self, motion: FittedMotion) -> Array:
        """Return the forces (R, n, k), per unit of the fault, that a model without it lacks."""
        return (self.effect or self.columns)(motion)


def _forces(model: Model) -> Sequence[str]:
    """Return the names of the machine's drive forces."""
    return model.robot.force_names


def _load(m: FittedMotion) -> Array:
    """Return the forces (R, n) of the rigid bodies, without friction and payload."""
    return m.forces(of=["base"])


def _stribeck(share: float, m: FittedMotion) -> Array:
    """Return columns (R, n, n) of Stribeck friction, at a share of the usual speed."""
    return diagonal(m.direction * np.exp(-((m.states.joint_rates / (share * m.usual)) ** 2)))


def _elasticity(m: FittedMotion) -> Array:
    """Return columns (R, n, n) by which elastic drives let joints lag behind their motors."""
    # The motor, where friction mostly is, is ahead of its joint by what the load deflects: the
    # joint is that much behind what was measured.
    load = _load(m)
    pace = (len(load) - 1) / float(np.ptp(m.states.time))
    if m.cutoff is not None and 2.0 * m.cutoff < pace:
        # Noise of the accelerations would be in both, the residuals and the column.
        load = lowpass(load, pace, m.cutoff)
    rate = m.rate(load)
    return m.lag_slopes([load, rate, m.rate(rate)])


def _drift(m: FittedMotion) -> Array:
    """Return columns (R, n, 2 n) of Coulomb friction and offset that grow with time."""
    later = m.along[:, None]
    return np.concatenate([diagonal(later * d) for d in (m.direction, m.direction**0)], axis=-1)


def _payload(m: FittedMotion) -> Array:
    """Return the forces (R, n, k) of 1 kg at the platform's point in each eighth of the log."""
    s, kinds = m.states, m.model.robot.platform.inertia.kinds
    regressor = evaluate_unchecked(m.model.robot, "regressor", s.pose, s.velocity, s.acceleration)
    of_mass = regressor[..., regressor.shape[-1] - len(kinds) + kinds.index("m")]
    count = len(_EIGHTHS)
    eighth = np.clip(((m.along + 0.5) * count).astype(int), 0, count - 1)
    return np.asarray(of_mass[..., None] * np.eye(count)[eighth][:, None, :])


def _weight(m: FittedMotion) -> Array:
    """Return the forces' column (R, n, 1) of the bodies' and payload's weight."""
    standstill = {
        name: np.zeros_like(getattr(m.states, name))
        for name in ("joint_rates", "joint_accelerations", "velocity", "acceleration")
    }
    at_rest = replace(m, states=replace(m.states, **standstill))
    return at_rest.forces(of=["base", "payload"])[..., None]


def _passive_legs(model: Model) -> Sequence[str]:
    """Return the part of the machine to which each passive joint belongs."""
    return [
        "the platform" if j.leg is None else f"leg {j.leg}" for j in passive_joints(model.robot)
    ]


def _passive(m: FittedMotion) -> Array:
    """Return columns (R, n, k) of friction in the passive joints."""
    s = m.states
    return np.asarray(evaluate_unchecked(m.model.robot, "passive_friction", s.pose, s.velocity))


DELAY = Family(
    "delay",
    "s",
    lambda m: ["delay"],
    lambda m: -m.rate(m.forces(without=_DRY))[..., None],
    of_machine=False,
)

_OTHERS = (
    Family("gravity", "rad", lambda m: ["tilt", "tilt"], FittedMotion.tilt_slopes, largest=0.2),
    Family(
        "clock",
        "",
        lambda m: ["weight"],
        _weight,
        largest=3.0,
        effect=lambda m: _load(m)[..., None],
    ),
    *(
        Family("stribeck", "N", _forces, partial(_stribeck, share), positive=True, speed=share)
        for share in _STRIBECK
    ),
    Family("elasticity", "m/N", _forces, _elasticity, positive=True, of_path=True),
    Family("drift", "N", lambda m: [*_forces(m), *_forces(m)], _drift),
    Family("load", "", _forces, lambda m: diagonal(m.direction * np.abs(_load(m))), positive=True),
    Family("passive", "N m s", _passive_legs, _passive, positive=True),
)

_ROTORS = Family(
    "rotors",
    "kg",
    lambda m: [f"at {name}" for name in m.robot.force_names],
    lambda m: diagonal(m.states.joint_accelerations),
    positive=True,
    exact=True,
)


def families_of(model: Model) -> tuple[Family, ...]:
    """Return the families of faults that are searched for, one for each actuator where they differ.

    Motors' inertia is tried where the model has none and no other value takes it in, as a ram's.
    """
    count = model.robot.joint_count
    with_rotors = replace(model.terms, rotors=True)
    rotors = []
    if not model.terms.rotors:
        terms = identification_model(model.robot, with_rotors, base=model.base).kept_terms
        rotors = [_ROTORS] * any(term.kind == "rotor" for term in terms)
    drives = (_scale(i) for i in range(count))
    joints = (family for i in range(count) for family in (_ratio((i,)), _zero(model.robot, i)))
    legs = range(len(model.robot.legs))
    geometry = (_geometry(model.robot, some) for some in (*((i,) for i in legs), legs))
    light = Tolerance(negligible=_LIGHT * model.robot.platform.inertia.mass)
    payload = Family("payload", "kg", lambda m: _EIGHTHS, _payload, tolerance=light, free=True)
    known = (*drives, _ratio(range(count)), *joints, *geometry)
    return (DELAY, *known, *_OTHERS, payload, *rotors)


def _ratio(joints: Sequence[int]) -> Family:
    """Return the family of wrong ratios: joints move more than logged, forces are smaller."""
    some = list(joints)

    def columns(m: FittedMotion) -> Array:
        """Return the slopes (T, n, 1) of the forces by the relative change of the joints' ratio."""
        force = diagonal(m.forces())[..., some].sum(axis=-1, keepdims=True)
        return np.asarray(m.ratio_slopes[..., some].sum(axis=-1, keepdims=True) - force)

    def sizes(model: Model) -> Sequence[str]:
        """Return the joint's name, or "all joints" if several share the ratio."""
        names = [model.robot.joint_names[i] for i in some]
        return names if len(names) == 1 else ["all joints"]

    about = Tolerance(_RATIO, _NEGLIGIBLE)
    return Family("ratio", "", sizes, columns, of_machine=False, largest=1.0, tolerance=about)


def length_tolerance(robot: Manipulator) -> Tolerance:
    """Return the usual and the negligible errors of a machine's lengths, m."""
    size = float(np.mean([leg.size for leg in robot.legs]))
    return Tolerance(_LENGTH * size, _NEGLIGIBLE * size)


def _zero(robot: Manipulator, i: int) -> Family:
    """Return the family of faults of a joint's zero position."""
    joint, leg = slice(i, i + 1), robot.legs[i]
    slides = leg.joint.unit == "m"
    usual = _ZERO_OF_SLIDE * leg.size if slides else _ZERO_OF_CRANK
    tolerance = Tolerance(usual, _NEGLIGIBLE * (leg.size if slides else 1.0))
    return Family(
        "zero",
        "",
        lambda model: model.robot.joint_names[joint],
        lambda m: m.zero_slopes[..., joint],
        of_machine=False,
        tolerance=tolerance,
    )


def _geometry(robot: Manipulator, legs: Sequence[int]) -> Family:
    """Return the family of faults of legs' lengths, m."""
    lengths = lengths_of(robot)
    places = [k for k, (leg, _) in enumerate(lengths) if leg in legs]
    labels = [f"leg {lengths[k][0] + 1}" for k in places]
    return Family(
        "geometry",
        "m",
        lambda m: labels,
        lambda m: m.length_slopes[..., places],
        tolerance=length_tolerance(robot),
    )


def _scale(i: int) -> Family:
    """Return the family of faults of a force channel's scale."""
    actuator = slice(i, i + 1)
    return Family(
        "scale",
        "",
        lambda model: _forces(model)[actuator],
        lambda m: diagonal(m.forces())[..., actuator],
        of_machine=False,
        largest=1.0,
    )


@dataclass(frozen=True)
class FaultColumns:
    """A model with further columns for faults.

    `values` (p,) are those of the fit, `begin` and `end` the times of the log, s; `usual` (n,),
    `stride` and `cutoff` are those of `FittedMotion`.
    """

    model: Model
    values: Array
    usual: Array
    begin: float
    end: float
    families: tuple[Family, ...]
    stride: int = 1
    cutoff: float | None = None

    @cached_property
    def places(self) -> tuple[slice, ...]:
        """Slice of each family's columns among all columns of the extended model."""
        counts = (len(family.sizes(self.model)) for family in self.families)
        ends = np.cumsum([len(self.model.names), *counts]).tolist()
        return tuple(slice(a, b) for a, b in pairwise(ends))

    @property
    def extended_model(self) -> Model:
        """The model with the columns of all faults appended."""
        count = self.places[-1].stop - len(self.model.names)
        return extend_model(self.model, count, self.matrix)

    def motion(self, states: States, share: Array, stride: int = 1) -> FittedMotion:
        """Return the motion that columns are made of, at shares (R,) of the log's time."""
        return FittedMotion(self.model, self.values, states, self.usual, share, stride, self.cutoff)

    def matrix(self, states: States) -> Array:
        """Return the columns (R, n, p + k) of the model and of all faults at states."""
        share = (states.time - self.begin) / (self.end - self.begin) - 0.5
        motion = self.motion(states, share, self.stride)
        columns = [family.columns(motion) for family in self.families]
        return np.concatenate([motion.matrix, *columns], axis=-1)
