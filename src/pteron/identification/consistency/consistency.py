"""`Consistency`, the result of `consistent_model`: real bodies, and their distance from the fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.result import Result


@dataclass(frozen=True, eq=False, repr=False)
class Consistency(Result):
    """Real bodies that reproduce identified base parameters, or come closest to them.

    Attributes
    ----------
    robot : Manipulator
        The machine with these bodies; `pteron.save(result.robot, path)` writes its model file.
    parameters : array, shape (N,)
        Their parameters, in the order of `pteron.parameter_names`, SI units.
    base_values : array, shape (rank,)
        base.grouping @ parameters.
    names : tuple of str
        Names of the base parameters.
    feasible : bool
        Whether real bodies within the bounds have the identified base parameters exactly.
    distance : float
        Distance of the identified values from those of real bodies: the Mahalanobis distance, in
        standard deviations. Without a covariance a relative distance: each value's shift is
        divided by the size its parameters have.
    p_value : float
        Chance that noise alone puts them that far or farther (chi-square, `rank` degrees of
        freedom, which is more than the true probability); NaN without a covariance.
    shifts : array, shape (rank,)
        base_values - values in the standard deviation of each value; relative without covariance.
    metric : {"covariance", "relative"}
        The measure of distance and shifts.
    at_border : tuple of str
        Bodies that only just exist and bounds that hold: where the identified values are not
        feasible those that hold them back (by their multipliers), else those of this model.
    cad_feasible : bool
        Whether the CAD model itself has real bodies within the bounds.
    cad_violations : tuple of str
        What it does not keep.
    residual : float
        Largest error of base.grouping @ parameters against the values aimed at, relative to the
        size of each one's parameters.
    nearest_to : {"CAD", "nothing"}
        What the part that the forces do not show was pulled to.
    """

    robot: Manipulator
    parameters: Array = field(repr=False)
    base_values: Array = field(repr=False)
    names: tuple[str, ...] = field(repr=False)
    feasible: bool
    distance: float
    p_value: float
    shifts: Array = field(repr=False)
    metric: Literal["covariance", "relative"]
    at_border: tuple[str, ...]
    cad_feasible: bool
    cad_violations: tuple[str, ...]
    residual: float
    nearest_to: Literal["CAD", "nothing"]

    def summary(self) -> str:
        """Return the feasibility, the shifts and the violations as lines of text for people."""
        lines = []
        if self.feasible:
            lines.append("Fit: real bodies have the identified base parameters exactly.")
        else:
            unit, away = "", "away, relative to their size (no covariance was given)"
            if self.metric == "covariance":
                unit = " standard deviations"
                away = f"standard deviations away (p = {self.p_value:.2g})"
            lines.append(
                "Fit: no real bodies within the bounds have the identified base parameters; the "
                f"closest are {self.distance:.2g} {away}."
            )
            moved = np.abs(self.shifts)
            order = [k for k in np.argsort(-moved)[:5] if moved[k] > 0.01 * moved.max()]
            for k in order:
                lines.append(f"  {self.names[k]} moved by {self.shifts[k]:+.2g}{unit}")
        if self.at_border:
            lines.append(f"At the border: {', '.join(self.at_border)}.")
        if not self.cad_feasible:
            lines.append("CAD: the CAD model itself is not real or not within the bounds:")
            lines += [f"  {violation}" for violation in self.cad_violations]
            lines.append("  It served as a target only; this says nothing against the fit.")
        near = "as near as can be to the CAD model"
        if self.nearest_to == "nothing":
            near = "near uniform rods and a uniform disc"
        lines.append(f"What the forces do not show is {near}.")
        lines.append(f"Residual of the base parameters: {self.residual:.1e} (relative).")
        return "\n".join(lines)
