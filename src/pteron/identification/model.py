"""The model that identification fits: forces linear in base parameters and further terms.

Further terms are friction of actuated and passive joints, offsets, a payload and motors' rotors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np

from pteron.arguments import checked_arguments, expect_one_of
from pteron.bodies.parameters import unit_of
from pteron.equations.friction import PassiveJoint, passive_joints
from pteron.errors import ModelError
from pteron.identification.felt_forces import felt_part
from pteron.identification.observation import scale_columns
from pteron.identification.signals import States
from pteron.identification.signals.states import FullMotion
from pteron.kernels import Array
from pteron.kinematics import random_poses
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.reduction import BaseParameters, base_parameters, base_regressor
from pteron.renamed import former_attribute
from pteron.tolerances import ROUNDING

Passive = Literal["none", "shared", "each"]
"""Viscous friction in the passive joints: none, one coefficient a kind of joint, or one each."""

_PROBES = 200
"""Random states at which columns are tested for dependence."""


@checked_arguments
@dataclass(frozen=True)
class Terms:
    """Terms of the model beside the base parameters.

    Parameters
    ----------
    coulomb, viscous, offset : bool
        Friction of each actuated joint, Fc sign(q') + Fv q', and a constant force.
    passive : {"none", "shared", "each"}
        Viscous friction in the passive joints of the legs.
    payload : bool
        The platform's inertial parameters once more, where a payload is carried.
    rotors : bool
        The inertia of each motor, reflected through its drive: J_m = J r^2 with J of the rotor and
        r in rad/m (kg), or in rad/rad at a crank (kg m^2). Its column is q'': at a crank it joins
        I_u, on a level guide the mass of its slider, m_p; on any other guide, where gravity pulls
        at m_p but not at a rotor, m_p and the offset. `Model.joins` and the expressions say so.
    stribeck : float, sequence of n floats or "auto", optional
        Friction of each actuated joint that falls as it moves faster (Stribeck), with this speed:
        Fs sign(q') exp(-(q' / speed)^2); m/s or rad/s. "auto" lets `identify` find the speeds.
        None, the default, for none.
    """

    coulomb: bool = True
    viscous: bool = True
    offset: bool = True
    passive: Passive = "none"
    payload: bool = False
    rotors: bool = False
    stribeck: float | tuple[float, ...] | Literal["auto"] | None = None

    def __post_init__(self) -> None:
        if self.stribeck is not None and self.stribeck != "auto":
            speeds = np.atleast_1d(np.array(self.stribeck, dtype=float))
            if not (speeds.size and np.isfinite(speeds).all() and (speeds > 0.0).all()):
                raise ModelError(f"stribeck: {self.stribeck} given, speeds above 0 expected")
            checked = tuple(speeds.tolist())
            object.__setattr__(self, "stribeck", checked if len(checked) > 1 else checked[0])
        expect_one_of(get_args(Passive), ModelError, passive=self.passive)


class Term(NamedTuple):
    """A term beside the base parameters: its kind, its name and how it is written, and its unit."""

    kind: Literal[
        "coulomb", "viscous", "offset", "passive", "rotor", "payload", "stribeck", "further"
    ]
    name: str
    letter: str
    subscript: str
    unit: str


@dataclass(frozen=True)
class Model:
    """A machine's forces as `matrix(states) @ values`.

    Attributes
    ----------
    base : BaseParameters
        The inertial parameters, and sums of them, that come first among the values.
    terms : Terms
        The terms that follow them.
    joins : dict
        Terms whose columns depend on others at every state, and the share of each that goes with
        those it joins: they are no values of their own.
    speeds : tuple of n floats, optional
        Speeds of Stribeck's friction, where `Terms` ask for them to be found; infinite where
        friction does not fall. Without them the model has none of that friction.
    """

    base: BaseParameters
    terms: Terms
    joins: dict[str, dict[str, float]] = field(default_factory=dict)
    speeds: tuple[float, ...] | None = None

    @property
    def merged_terms(self) -> tuple[str, ...]:
        """Terms that join others."""
        return tuple(self.joins)

    @property
    def robot(self) -> Manipulator:
        """The machine."""
        return self.base.robot

    @cached_property
    def all_terms(self) -> tuple[Term, ...]:
        """The terms, those that join others too."""
        joints = list(enumerate((leg.joint for leg in self.robot.legs), start=1))
        slides = {i: joint.unit == "m" for i, joint in joints}
        terms: list[Term] = []
        if self.terms.coulomb:
            terms += [Term("coulomb", f"Fc{i}", "F", f"c{i}", j.force_unit) for i, j in joints]
        if self.terms.viscous:
            units = {i: "N s/m" if slides[i] else "N m s" for i in slides}
            terms += [Term("viscous", f"Fv{i}", "F", f"v{i}", units[i]) for i in slides]
        if self.terms.offset:
            terms += [
                Term("offset", f"offset{i}", "offset", f"{i}", j.force_unit) for i, j in joints
            ]
        for index, (joint, *_) in self._passive.items():
            unit = "N s/m" if joint.kind == "P" else "N m s"
            terms.append(Term("passive", f"F{'_'.join(index)}", "F", ",".join(index), unit))
        if self.terms.rotors:
            units = {i: "kg" if slides[i] else "kg m^2" for i in slides}
            terms += [Term("rotor", f"J_m{i}", "J", f"m{i}", units[i]) for i in slides]
        if self.stribeck_speeds is not None:
            terms += [Term("stribeck", f"Fs{i}", "F", f"s{i}", j.force_unit) for i, j in joints]
        if self.terms.payload:
            for kind in self.robot.platform.inertia.kinds:
                letter, axes = ("m\u03b3", kind[2:]) if kind[1:2] == "g" else (kind[0], kind[1:])
                place = ",".join(part for part in (axes, "L") if part)
                terms.append(Term("payload", f"{kind}_L", letter, place, unit_of(kind)))
        return tuple(terms)

    @property
    def stribeck_speeds(self) -> Array | None:
        """The speed of each joint with which friction falls (n,), where the model has that."""
        speeds = self.speeds if self.terms.stribeck == "auto" else self.terms.stribeck
        return None if speeds is None else np.broadcast_to(speeds, (len(self.robot.legs),))

    def with_speeds(self, speeds: Array) -> Model:
        """Return the model with identified Stribeck speeds (n,)."""
        return _independent(Model(self.base, self.terms, speeds=tuple(speeds.tolist())))

    @cached_property
    def kept_terms(self) -> tuple[Term, ...]:
        """The terms that are values of their own, after the base parameters."""
        return tuple(term for term in self.all_terms if term.name not in self.merged_terms)

    @cached_property
    def joining_terms(self) -> tuple[Term, ...]:
        """The terms whose values others absorb."""
        return tuple(term for term in self.all_terms if term.name in self.merged_terms)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the values, the base parameters first."""
        return (*self.base.names, *(term.name for term in self.kept_terms))

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the values: "base", or that of the term."""
        return (*("base" for _ in self.base.names), *(term.kind for term in self.kept_terms))

    @cached_property
    def units(self) -> tuple[str, ...]:
        """SI units of the values."""
        base = (self.base.parameters[column].unit for column in self.base.kept)
        return (*base, *(term.unit for term in self.kept_terms))

    @property
    def expressions(self) -> tuple[str, ...]:
        """The values in words: base parameters as sums, the others by name."""
        texts = [*self.base.expressions(), *self.names[self.base.rank :]]
        return self.with_joins(texts, {name: name for name in self.joins})

    def with_joins(
        self, texts: Sequence[str], names: Mapping[str, str], *, minus: str = "-", gap: str = " "
    ) -> tuple[str, ...]:
        """Return expressions of the values, with the terms that they absorb appended by name."""
        sums = list(texts)
        for name, shares in self.joins.items():
            for joined, share in shares.items():
                sign, size = minus if share < 0.0 else "+", abs(share)
                times = "" if abs(size - 1.0) < 1e-9 else f"{size:.4g}{gap}"
                sums[self.names.index(joined)] += f" {sign} {times}{names[name]}"
        return tuple(sums)

    def share_of(self, name: str, size: float) -> Array:
        """Return what a term of this value adds to the values (p,) that absorb it."""
        added = np.zeros(len(self.names))
        for joined, share in self.joins.get(name, {name: 1.0}).items():
            added[self.names.index(joined)] = share * size
        return added

    def known_values(self, known: Mapping[str, float]) -> Array:
        """Return the part of the values (p,) that terms of known values contribute, by name.

        A term that joins others adds to those.
        """
        parts = [self.share_of(name, size) for name, size in known.items()]
        return np.asarray(np.sum([np.zeros(len(self.names)), *parts], axis=0))

    def joint_values(self, kind: str, beta: Array) -> Array | None:
        """Return the values (n,) of a kind of term; 0 where others absorb it, None without it.

        A term that joins others is in their values already.
        """
        terms = [term for term in self.all_terms if term.kind == kind]
        known = dict(zip(self.names, beta.tolist(), strict=True))
        return np.array([known.get(term.name, 0.0) for term in terms]) if terms else None

    def matrix(self, states: States) -> Array:
        """Return the regressor (R, n, p) of states: N or N m per unit of each value."""
        names = (*self.base.names, *(term.name for term in self.all_terms))
        columns = [k for k, name in enumerate(names) if name not in self.joins]
        return np.ascontiguousarray(self._all_columns(states)[..., columns])

    @cached_property
    def _passive(self) -> dict[tuple[str, ...], list[PassiveJoint]]:
        """The passive joints of each coefficient, by its subscripts."""
        if self.terms.passive == "none":
            return {}
        coefficients: dict[tuple[str, ...], list[PassiveJoint]] = {}
        kinds = [leg.type for leg in self.robot.legs]
        for joint in passive_joints(self.robot):
            index: tuple[str, ...] = ("v", f"{joint.kind}{joint.number}")
            if joint.leg is not None and self.terms.passive == "each":
                index = (*index, f"{joint.leg}")
            elif joint.leg is not None:
                kind = kinds[joint.leg - 1]
                if kinds.count(kind) < len(kinds):
                    alike = [str(i) for i, other in enumerate(kinds, start=1) if other == kind]
                    index = ("v", f"{index[1]}({','.join(alike)})")
            coefficients.setdefault(index, []).append(joint)
        return coefficients

    def _all_columns(self, states: States) -> Array:
        """Return the regressor (N, n, p) of all terms, before columns are selected."""
        robot, terms = self.robot, self.terms
        n = len(robot.legs)
        motion = states.pose, states.velocity, states.acceleration
        parts = [base_regressor(robot, self.base, *motion)]
        if terms.coulomb:
            parts.append(diagonal(np.sign(states.joint_rates)))
        if terms.viscous:
            parts.append(diagonal(states.joint_rates))
        if terms.offset:
            parts.append(np.broadcast_to(np.eye(n), (len(states), n, n)))
        if terms.passive != "none":
            columns = evaluate_unchecked(robot, "passive_friction", states.pose, states.velocity)
            places = {joint: k for k, joint in enumerate(passive_joints(robot))}
            for joints in self._passive.values():
                chosen = [places[joint] for joint in joints]
                parts.append(columns[..., chosen].sum(axis=-1, keepdims=True))
        if terms.rotors:
            parts.append(diagonal(states.joint_accelerations))
        if (speeds := self.stribeck_speeds) is not None:
            rates = states.joint_rates
            parts.append(diagonal(np.sign(rates) * np.exp(-((rates / speeds) ** 2))))
        if terms.payload:
            carried = evaluate_unchecked(robot, "regressor", *motion)
            carried = carried[..., -len(robot.platform.inertia.kinds) :]
            parts.append(carried * (states.payload != 0)[:, None, None])
        return np.concatenate(parts, axis=-1)

    left_out = former_attribute("left_out", "merged_terms")
    per_joint = former_attribute("per_joint", "joint_values")


def identification_model(
    robot: RobotLike, terms: Terms | None = None, *, base: BaseParameters | None = None
) -> Model:
    """Return the model of a machine for identification.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its inertial parameters play no part.
    terms : Terms, optional
        Terms beside the base parameters; friction and offset of each joint by default.
    base : BaseParameters, optional
        Another choice of base parameters, such as that of legs which share theirs.

    Returns
    -------
    Model
        Terms whose columns depend on others at every state are left out, and named.

    Examples
    --------
    >>> import pteron
    >>> from pteron.identification import identification_model
    >>> model = identification_model(pteron.load("tripteron"))
    >>> model.names[-9:-5], model.units[-9:-5]
    (('Fc1', 'Fc2', 'Fc3', 'Fv1'), ('N', 'N', 'N', 'N s/m'))
    """
    robot = as_manipulator(robot)
    model = Model(base or base_parameters(robot), terms or Terms())
    stribeck = model.terms.stribeck
    speeds = np.atleast_1d(1.0 if stribeck in (None, "auto") else stribeck)
    if speeds.size not in (1, len(robot.legs)):
        raise ModelError(
            f"stribeck: {speeds.size} speeds given, one expected or {len(robot.legs)}, one for "
            f"each joint of {robot.name}"
        )
    return _independent(model)


def _independent(model: Model) -> Model:
    """Return a model without the terms whose columns depend on others at every state."""
    names = model.names
    probes = _probes(model.robot)
    felt = felt_part(model.robot, probes.pose, model._all_columns(probes))
    flat = felt.reshape(-1, len(names))
    columns, lengths = scale_columns(flat)
    factor: Array = np.linalg.qr(columns)[1]
    # The diagonal of R is what is left of each column once those before it are taken out of it.
    remainders = np.abs(np.diag(factor))
    dependent = [k for k in range(model.base.rank, len(names)) if remainders[k] < ROUNDING]
    independent = [k for k in range(len(names)) if k not in dependent]
    joins = {}
    for k in dependent:
        shares = np.linalg.lstsq(factor[:, independent], factor[:, k], rcond=None)[0]
        coefficients = shares * lengths[k] / lengths[independent]
        joins[names[k]] = {
            names[j]: float(share)
            for j, share, size in zip(independent, coefficients, shares, strict=True)
            if abs(size) > ROUNDING
        }
    return replace(model, joins=joins)


@lru_cache(maxsize=8)
def _probes(robot: Manipulator) -> States:
    """Return states at random, with payload."""
    rng = np.random.default_rng(0)
    pose = random_poses(robot, _PROBES, seed=rng)
    velocity, acceleration = rng.normal(size=pose.shape), 10.0 * rng.normal(size=pose.shape)
    # Every other one carries a payload, else its columns would be those of the platform.
    motion = FullMotion.from_platform(robot, pose, velocity, acceleration)
    return States.from_motion(np.zeros(_PROBES), motion, np.arange(_PROBES) % 2)


def diagonal(joint_values: Array) -> Array:
    """Return diagonal matrices (R, n, n) of joints' values (R, n)."""
    return np.asarray(joint_values[..., None] * np.eye(joint_values.shape[-1]))


@dataclass(frozen=True, kw_only=True)
class ExtendedModel(Model):
    """A model with so many columns more, which have no units and numbers for names.

    `columns` returns all columns (R, n, p + count) at states.
    """

    count: int
    columns: Callable[[States], Array]

    @cached_property
    def kept_terms(self) -> tuple[Term, ...]:
        """The terms of the model, and the further ones."""
        further = (Term("further", str(k), "", "", "") for k in range(self.count))
        return (*super().kept_terms, *further)

    def matrix(self, states: States) -> Array:
        """Return all columns (R, n, p + count)."""
        return self.columns(states)


def extend_model(model: Model, count: int, columns: Callable[[States], Array]) -> Model:
    """Return a model with `count` further columns; `columns` makes all (R, n, p + count)."""
    about = model.base, model.terms, model.joins, model.speeds
    return ExtendedModel(*about, count=count, columns=columns)
