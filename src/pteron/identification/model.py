"""The model that is linear in what is identified: base parameters, friction, offsets, payload."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from pteron.errors import ModelError
from pteron.identification.signals import States
from pteron.kernels import Array, numeric
from pteron.kinematics import random_poses
from pteron.manipulator import BODY_PARAMETERS, Manipulator, parameter_names, parameter_units
from pteron.reduction import BaseParameters, base_parameters, base_regressor

Joints = Literal["none", "shared", "each"]
"""Viscous friction in the passive joints: none, one coefficient a kind of joint, or one each."""

_PROBES = 200
_DEPENDENT = 1e-9
"""What is left of a column, relative to it, once those before it are taken out of it."""


@dataclass(frozen=True)
class Terms:
    """What the model has beside the base parameters.

    Parameters
    ----------
    coulomb, viscous, offset : bool
        Friction of each slider, Fc sign(rho') + Fv rho', and a constant force.
    joints : {"none", "shared", "each"}
        Viscous friction in the passive joints R1 to R4.
    payload : bool
        The platform's four parameters once more, where a payload is carried.
    rotors : bool
        The inertia of each slider's motor, reflected through its drive: J_m = J r^2 (kg) with J of
        the rotor and r in rad/m. Its column is rho'': on a level guide it joins the mass of its
        slider, m_p; on any other guide, where gravity pulls at m_p but not at a rotor, it joins
        m_p and the offset. `Model.joins` and the expressions say so.
    """

    coulomb: bool = True
    viscous: bool = True
    offset: bool = True
    joints: Joints = "none"
    payload: bool = False
    rotors: bool = False

    def __post_init__(self) -> None:
        if self.joints not in get_args(Joints):
            raise ModelError(f"joints: {self.joints!r} is not one of {', '.join(get_args(Joints))}")


@dataclass(frozen=True)
class Model:
    """A machine's forces as `matrix(states) @ values`.

    Attributes
    ----------
    base : BaseParameters
        Which inertial parameters, and sums of them, come first among the values.
    terms : Terms
        What follows them.
    joins : dict
        Terms whose columns depend on others at every state, and the share of each that goes with
        those it joins: they are no values of their own.
    """

    base: BaseParameters
    terms: Terms
    joins: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Terms that join others."""
        return tuple(self.joins)

    @property
    def robot(self) -> Manipulator:
        """The machine."""
        return self.base.robot

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the values, the base parameters first."""
        extra = (name for name, _ in self._extras if name not in self.left_out)
        return (*self.base.names, *extra)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """SI units of the values."""
        robot = self.robot
        of_kind = {
            name.rstrip("0123456789"): unit
            for name, unit in zip(parameter_names(robot), parameter_units(robot), strict=True)
        }
        base = (of_kind[name.rstrip("0123456789(),")] for name in self.base.names)
        return (*base, *(unit for name, unit in self._extras if name not in self.left_out))

    @property
    def expressions(self) -> tuple[str, ...]:
        """What each value is: base parameters as sums, the others by name."""
        found = [*self.base.expressions(), *self.names[self.base.rank :]]
        for name, shares in self.joins.items():
            for kept, share in shares.items():
                sign, size = ("-", -share) if share < 0.0 else ("+", share)
                times = "" if abs(size - 1.0) < 1e-9 else f"{size:.4g} "
                found[self.names.index(kept)] += f" {sign} {times}{name}"
        return tuple(found)

    def share_of(self, name: str, value: float) -> Array:
        """Return what a term that joins others adds to the values (p,), such as a known rotor."""
        added = np.zeros(len(self.names))
        for kept, share in self.joins.get(name, {name: 1.0}).items():
            added[self.names.index(kept)] = share * value
        return added

    def matrix(self, states: States) -> Array:
        """Return the regressor (R, n, p) of states, each column in N per unit of its value."""
        return np.ascontiguousarray(self._everything(states)[..., self._kept])

    @property
    def _kept(self) -> list[int]:
        names = (*self.base.names, *(name for name, _ in self._extras))
        return [k for k, name in enumerate(names) if name not in self.left_out]

    @property
    def _extras(self) -> list[tuple[str, str]]:
        """The terms' names and units, before dependent ones are left out."""
        legs = range(1, len(self.robot.legs) + 1)
        found: list[tuple[str, str]] = []
        if self.terms.coulomb:
            found += [(f"Fc{i}", "N") for i in legs]
        if self.terms.viscous:
            found += [(f"Fv{i}", "N s/m") for i in legs]
        if self.terms.offset:
            found += [(f"offset{i}", "N") for i in legs]
        kinds = ("R1", "R2", "R3")
        if self.terms.joints == "each":
            found += [(f"Fv_{kind}_{i}", "N m s") for i in legs for kind in kinds]
        elif self.terms.joints == "shared":
            found += [(f"Fv_{kind}", "N m s") for kind in kinds]
        if self.terms.joints != "none" and self.robot.platform.turns:
            found.append(("Fv_R4", "N m s"))
        if self.terms.rotors:
            found += [(f"J_m{i}", "kg") for i in legs]
        if self.terms.payload:
            units = ("kg", "kg m", "kg m", "kg m^2")
            found += list(zip((f"{p}_L" for p in BODY_PARAMETERS), units, strict=True))
        return found

    def _everything(self, states: States) -> Array:
        robot, terms = self.robot, self.terms
        n = len(robot.legs)
        motion = states.pose, states.velocity, states.acceleration
        parts = [base_regressor(robot, self.base, *motion)]
        if terms.coulomb:
            parts.append(_diagonal(np.sign(states.slider_rates)))
        if terms.viscous:
            parts.append(_diagonal(states.slider_rates))
        if terms.offset:
            parts.append(np.broadcast_to(np.eye(n), (len(states), n, n)))
        if terms.joints != "none":
            joints = numeric(robot, "passive_friction")(states.pose, states.velocity)
            each = joints[..., : 3 * n]
            if terms.joints == "shared":
                each = each.reshape(*each.shape[:-1], n, 3).sum(axis=-2)
            parts += [each, joints[..., 3 * n :]]
        if terms.rotors:
            parts.append(_diagonal(states.slider_accelerations))
        if terms.payload:
            carried = numeric(robot, "regressor")(*motion)[..., -len(BODY_PARAMETERS) :]
            parts.append(carried * (states.payload != 0)[:, None, None])
        return np.concatenate(parts, axis=-1)


def identification_model(
    robot: Manipulator, terms: Terms | None = None, *, base: BaseParameters | None = None
) -> Model:
    """Return the model of a machine for identification.

    Parameters
    ----------
    robot : Manipulator
        The machine; its inertial parameters play no part.
    terms : Terms, optional
        What it has beside the base parameters; friction and offset of each slider by default.
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
    model = Model(base or base_parameters(robot), terms or Terms())
    columns = model._everything(_probes(robot))
    flat = columns.reshape(-1, columns.shape[-1])
    lengths = np.linalg.norm(flat, axis=0)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    names = model.names
    factor: Array = np.linalg.qr(flat / lengths)[1]
    # The diagonal of R is what is left of each column once those before it are taken out of it.
    rest = np.abs(np.diag(factor))
    dependent = [k for k in range(model.base.rank, len(names)) if rest[k] < _DEPENDENT]
    kept = [k for k in range(len(names)) if k not in dependent]
    joins = {}
    for k in dependent:
        shares = np.linalg.lstsq(factor[:, kept], factor[:, k], rcond=None)[0]
        scaled = shares * lengths[k] / lengths[kept]
        joins[names[k]] = {
            names[j]: float(share)
            for j, share, size in zip(kept, scaled, shares, strict=True)
            if abs(size) > _DEPENDENT
        }
    return Model(model.base, model.terms, joins)


def _probes(robot: Manipulator) -> States:
    """Return states at random, with payload."""
    rng = np.random.default_rng(0)
    pose = random_poses(robot, _PROBES, seed=rng)
    velocity, acceleration = rng.normal(size=pose.shape), 10.0 * rng.normal(size=pose.shape)
    rates = numeric(robot, "joint_rates")(pose, velocity)[..., 0]
    seconds = numeric(robot, "joint_accelerations")(pose, velocity, acceleration)[..., 0]
    # Every other one carries a payload, else its columns would be those of the platform.
    payload = np.arange(_PROBES) % 2
    return States(np.zeros(_PROBES), rates, rates, seconds, pose, velocity, acceleration, payload)


def _diagonal(values: Array) -> Array:
    """Return (R, n, n): a column for each slider."""
    return np.asarray(values[..., None] * np.eye(values.shape[-1]))
