"""`Identification`, the result of `identify`: values, the machine that has them, and a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pteron.html_table import Column, Overview
from pteron.identification.conditional_values import conditional_values
from pteron.identification.consistency import Consistency
from pteron.identification.estimators import Essential, Estimate
from pteron.identification.faults import FaultIsolation
from pteron.identification.logs import Finding
from pteron.identification.model import Model
from pteron.identification.prediction import Prediction
from pteron.identification.signals import Preprocessing
from pteron.identification.unknowns import Unknowns
from pteron.json_values import fields_as_json, json_fields
from pteron.kernels import Array
from pteron.legs import Drive, Stribeck
from pteron.manipulator import Manipulator
from pteron.manipulator.machine_record import machine_record
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.verdict import Verdict


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Result):
    """A machine as identified from logs.

    Attributes
    ----------
    robot : Manipulator
        The machine as it was drawn.
    model : Model
        Names, units and expressions of the values.
    estimate : Estimate
        The values, their standard deviations, and what was left of the forces.
    essential : Essential
        The values that the data can show, and the fit of these alone.
    consistency : Consistency or None
        Real bodies with these base parameters; None where Clarabel is not installed.
    consistency_share : float
        Root mean square difference of the real bodies' forces from those of the fit, over that of
        its residuals.
    fitted, held_out : tuple of Prediction
        Predictions of the recordings that were fitted, and of those that were not.
    preprocessing : tuple of Preprocessing
        Preprocessing of the fitted recordings.
    fault_isolation : FaultIsolation
        Faults of the log or the machine that the residuals show, and what they spoil.
    verdict : Verdict
        Whether the model can be trusted.
    unseen : tuple of str
        Base parameters that are less well known than their usual size.
    findings : tuple of Finding
        Oddities of the logs.
    notes : tuple of str
        Other notes, in sentences.
    rotors : tuple of (float, float), optional
        Inertia and ratio of each joint's motor, where they are known: no part of the real bodies.
    unknowns : Unknowns
        The delay, and the speeds with which friction falls, where they were asked for; the delay
        also where it is that of forces held from sample to sample.
    """

    ROWS = "estimate"

    robot: Manipulator
    model: Model
    estimate: Estimate
    essential: Essential
    consistency: Consistency | None
    consistency_share: float
    fitted: tuple[Prediction, ...]
    held_out: tuple[Prediction, ...]
    preprocessing: tuple[Preprocessing, ...]
    fault_isolation: FaultIsolation
    verdict: Verdict
    unseen: tuple[str, ...]
    findings: tuple[Finding, ...]
    notes: tuple[str, ...] = ()
    rotors: tuple[tuple[float, float], ...] | None = None
    unknowns: Unknowns = field(default_factory=Unknowns)

    trial = former_attribute("trial", "fault_isolation")

    def __repr__(self) -> str:
        """Return the result in a line."""
        grade, known = self.verdict.grade, len(self.estimate.values)
        return f"<Identification of {self.robot.name!r}: {known} values, {grade}>"

    def _overview(self) -> Overview:
        """Return the overview for notebooks: each value with its interval and the drawn value."""
        from pteron.identification.names_in_html import html_expressions

        drawn = [*self.model.base.values(self.robot).tolist()]
        drawn += [None] * (len(self.estimate.values) - len(drawn))
        low, high = self.estimate.intervals()
        rows = zip(
            html_expressions(self.model),
            self.estimate.values.tolist(),
            (f"{half:.2g}" for half in 0.5 * (high - low)),
            drawn,
            (unit.replace("^2", "\u00b2") for unit in self.estimate.units),
            strict=True,
        )
        columns = [Column("value", "long"), Column("identified", "number")]
        columns += [
            Column("\u00b1 95 %" + " (too short)" * self.has_understated_errors, "number"),
            Column("drawn", "number"),
            Column("unit"),
        ]
        about = f"identified, {self.verdict.grade}"
        return Overview(self.robot.name, about, columns, [*rows], self.verdict.reasons)

    def summary(self) -> str:
        """Return the verdict with its reasons and advice, for people, as lines of text."""
        return f"{self.robot.name}: {self.verdict.summary()}"

    @property
    def causes(self) -> tuple[str, ...]:
        """The faults of log and machine that show, in sentences, the likeliest cause first."""
        return self.fault_isolation.causes

    @property
    def has_understated_errors(self) -> bool:
        """Whether a fault shows that the stated errors of the values do not include."""
        return self.fault_isolation.understates

    @cached_property
    def machine(self) -> Manipulator | None:
        """The machine as identified, real bodies and drives, which alone predicts the log.

        None without real bodies. Friction that the fit had not is none of it.
        """
        if self.consistency is None:
            return None
        robot = self.consistency.robot
        drives = [leg.drive or Drive() for leg in robot.legs]
        if self.rotors is not None:
            motors = zip(drives, self.rotors, strict=True)
            drives = [d if r == d.gear else replace(d, ratio=r) for d, (_, r) in motors]
        reflected = zip(drives, self.reflected_inertia.tolist(), strict=True)
        inertia = [(mass - drive.screw_inertia) / drive.gear**2 for drive, mass in reflected]
        friction = self._friction(self.file_values)
        each = zip(robot.legs, drives, inertia, friction, strict=True)
        legs = [
            replace(leg, drive=replace(drive, rotor_inertia=j, **law))
            for leg, drive, j, law in each
        ]
        return replace(robot, legs=tuple(legs))

    @property
    def known_rotors(self) -> dict[str, float]:
        """The inertia that known rotors add at the joints, J r^2, by name; kg or kg m^2."""
        return reflected_inertia(self.rotors)

    @cached_property
    def values_without_rotors(self) -> Array:
        """The identified values (p,) less what known rotors add to each, in bodies or offsets."""
        return self.estimate.values - self.model.known_values(self.known_rotors)

    @cached_property
    def file_values(self) -> Array:
        """The values (p,) of the model file: real bodies', friction not below zero, less rotors.

        Where real bodies have other base parameters than the fit, or friction came out below zero,
        the other values follow by their covariance, so that forces stay as near as they can.
        """
        beta, rank = self.values_without_rotors, self.model.base.rank
        moved = self.consistency is not None and not self.consistency.feasible
        bodies = self.consistency.base_values if moved and self.consistency else beta[:rank]
        kinds = self.model.kinds
        known = np.isin(kinds, ("coulomb", "viscous", "stribeck"))
        if not moved and not (beta[known] < 0.0).any():
            return beta
        positive = np.flatnonzero(known).tolist()
        return conditional_values(beta, self.estimate.covariance, bodies, positive)

    @property
    def reflected_inertia(self) -> Array:
        """Inertia of the motors at the joints (n,), kg or kg m^2, as the fit found it.

        Known rotors count, with what the forces say beside them; what joins bodies is theirs.
        """
        known = [j * r**2 for j, r in self.rotors] if self.rotors else [0.0] * len(self.robot.legs)
        beside = self.model.joint_values("rotor", self.file_values)
        return np.maximum(np.array(known) + (0.0 if beside is None else beside), 0.0)

    @property
    def friction(self) -> tuple[dict[str, Any], ...]:
        """The friction of each joint as the fit found it, by the fields of `Drive`.

        It goes with `base_values`: on a guide that gravity pulls along, what rotors add to both is
        in both. The model file's is in `machine`.
        """
        return self._friction(self.estimate.values)

    def _friction(self, beta: Array) -> tuple[dict[str, Any], ...]:
        """Return the friction of each joint by values (p,), by the fields of `Drive`."""
        coulomb, viscous, falls = (
            self._terms_per_joint(kind, beta) for kind in ("coulomb", "viscous", "stribeck")
        )
        offset = self._terms_per_joint("offset", beta, least=-np.inf)
        speeds = self.model.stribeck_speeds
        laws = [
            Stribeck(force, speed) if force > 0.0 else None
            for force, speed in zip(falls, falls if speeds is None else speeds, strict=True)
        ]
        return tuple(
            {"coulomb": float(c), "viscous": float(v), "offset": float(o), "stribeck": law}
            for c, v, o, law in zip(coulomb, viscous, offset, laws, strict=True)
        )

    def _terms_per_joint(self, kind: str, beta: Array, least: float = 0.0) -> Array:
        """Return the values (n,) of a kind of term, at least `least`; 0 without the term.

        Friction and inertia below zero are noise: no joint pushes itself.
        """
        terms = self.model.joint_values(kind, beta)
        return np.maximum(np.zeros(len(self.robot.legs)) if terms is None else terms, least)

    @property
    def base_values(self) -> Array:
        """The identified base parameters (rank,)."""
        return self.estimate.values[: self.model.base.rank]

    @property
    def _export_values(self) -> tuple[Array, Array, Sequence[str]]:
        """Values (p,), inertia of rotors (n,) and expressions for code from base parameters.

        Values are those of the fit, with the rotors that join them. Where legs share what one rotor
        joins, others are lighter than that by the fit, and no drive has less inertia than none:
        then rotors are taken out of the values.
        """
        beside = self.model.joint_values("rotor", self.estimate.values)
        if self.rotors is None or beside is None or not (beside < 0.0).any():
            inertia = self._terms_per_joint("rotor", self.estimate.values)
            return self.estimate.values, inertia, self.model.expressions
        expressions = [*self.model.base.expressions(), *self.model.names[self.model.base.rank :]]
        return self.values_without_rotors, self.reflected_inertia, expressions

    def as_dict(self) -> dict[str, Any]:
        """Return everything but samples and residuals as plain data."""
        base = self.model.base
        exported, inertia, expressions = self._export_values
        return {
            "robot": self.robot.name,
            "machine": machine_record(self.robot),
            **json_fields(verdict=self.verdict),
            "expressions": [*expressions],
            **json_fields(kinds=self.model.kinds, left_out=self.model.merged_terms),
            "base_parameters": {
                "names": list(base.names),
                "expressions": list(base.expressions(digits=12)),
                "units": list(self.model.units[: base.rank]),
                "values": exported[: base.rank].tolist(),
                "shared": sorted({p.legs for p in base.parameters if len(p.legs) > 1}),
            },
            "drives": [
                {
                    **friction,
                    "stribeck": friction["stribeck"] and asdict(friction["stribeck"]),
                    "inertia": float(inertia),
                }
                for friction, inertia in zip(self._friction(exported), inertia, strict=True)
            ],
            **json_fields(estimate=self.estimate, unknowns=self.unknowns),
            "essential": json_fields(
                names=self.essential.names,
                dropped=self.essential.dropped,
                p_value=self.essential.p_value,
                level=self.essential.level,
            )
            | json_fields(
                values=self.essential.estimate.values,
                standard_deviations=self.essential.estimate.deviations,
            ),
            **json_fields(unseen=self.unseen),
            "real_bodies": self._consistency_data(),
            **json_fields(trial=self.fault_isolation, fitted=self.fitted, held_out=self.held_out),
            "preprocessing": [fields_as_json(how, *vars(how)) for how in self.preprocessing],
            "findings": [
                json_fields(
                    kind=finding.kind,
                    row=finding.row,
                    column=finding.column,
                    message=finding.message,
                )
                for finding in self.findings
            ],
            **json_fields(notes=self.notes),
        }

    def _consistency_data(self) -> dict[str, Any] | None:
        """Return what is known of the real bodies as plain data, None without them."""
        consistency = self.consistency
        return (
            None
            if consistency is None
            else {
                **json_fields(
                    feasible=consistency.feasible,
                    distance=consistency.distance,
                    p_value=consistency.p_value,
                    at_border=consistency.at_border,
                    cad_feasible=consistency.cad_feasible,
                ),
                **json_fields(cad_violations=consistency.cad_violations),
                "share_of_residual": self.consistency_share,
                **json_fields(parameters=consistency.parameters),
                "summary": consistency.summary().splitlines(),
            }
        )

    understated = former_attribute("understated", "has_understated_errors")


def reflected_inertia(rotors: tuple[tuple[float, float], ...] | None) -> dict[str, float]:
    """Return the inertia that rotors (inertia, ratio) add at the joints, J r^2, by name."""
    return {f"J_m{i}": inertia * r**2 for i, (inertia, r) in enumerate(rotors or (), start=1)}
