"""Identification of a payload's inertia from logs of one machine with and without the payload."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.bodies.inertia import PlanarInertia, SpatialInertia, inertia_count
from pteron.bodies.parameters import LENGTH_POWERS
from pteron.errors import ModelError
from pteron.identification.estimators import Estimate, weighted_least_squares
from pteron.identification.faults import FaultIsolation, isolate_faults
from pteron.identification.fitting import (
    append_findings,
    check_columns,
    check_motion,
    check_recordings,
    convert_to_newtons,
    stack_balanced,
)
from pteron.identification.logs import Finding, Log
from pteron.identification.model import Model, Terms, identification_model
from pteron.identification.observation import Observations
from pteron.identification.plausibility import (
    CHANCE,
    excess_residual_cause,
    unphysical,
    unseen_names,
)
from pteron.identification.signals import Processing
from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.payload import with_payload
from pteron.reduction import BaseParameters
from pteron.renamed import former_attribute
from pteron.result import Result

if TYPE_CHECKING:
    from pteron.identification.result import Identification
from pteron.identification.payload_phases import observe_phases, read_phases

_MOST_UNSEEN = 0.5
"""Share of base parameters that residuals may hide before a payload is refused: chosen."""

_BOTH = frozenset(f"{name}_L" for name in LENGTH_POWERS)
"""Names of a payload's values: m_L, mgx_L, mgy_L, I_L, and those under a platform that tilts."""


@dataclass(frozen=True, eq=False, repr=False)
class Payload(Result):
    """The inertia of a payload, about the platform's point P, the origin of the platform's frame.

    Attributes
    ----------
    mass : float or None
        kg. None, here and below, where the forces do not show it.
    first_moment : tuple of float or None
        Mass times the position of the centre of mass, kg m; a 3T platform does not feel it. Along
        x, y and z under a platform that tilts.
    inertia : float, tuple of float or None
        About the platform's axis through P, kg m^2; a 3T platform does not feel it. Ixx, Ixy, Ixz,
        Iyy, Iyz and Izz about P under a platform that tilts.
    names : tuple of str
        The k values that the forces show: ``m_L, mgx_L, mgy_L, I_L``, or some of them; of ten under
        a platform that tilts.
    covariance : array, shape (k, k)
        The covariance of these values, SI units.
    estimate : Estimate
        The fit of all values: base parameters, friction and offsets first, the payload last.
    residual : array, shape (n,)
        Standard deviation of each actuator's residuals, N or N m, referred to unfiltered samples.
    fault_isolation : FaultIsolation
        Faults of the logs or the machine that the residuals show, with their effects.
    findings : tuple of Finding
        Oddities of the logs, such as uneven time stamps.
    """

    mass: float | None
    first_moment: tuple[float, ...] | None
    inertia: float | tuple[float, ...] | None
    names: tuple[str, ...]
    covariance: Array = field(repr=False)
    estimate: Estimate = field(repr=False)
    residual: Array
    fault_isolation: FaultIsolation = field(repr=False)
    findings: tuple[Finding, ...] = ()

    trial = former_attribute("trial", "fault_isolation")

    @property
    def values(self) -> Array:
        """The values that the forces show (k,)."""
        return np.array([self.estimate.value(name) for name in self.names])

    @property
    def deviations(self) -> Array:
        """Standard deviations (k,) of these values."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def center_of_mass(self) -> tuple[float, ...] | None:
        """Position of the centre of mass in the platform's frame, m."""
        if not self.mass or self.first_moment is None:
            return None
        return tuple(moment / self.mass for moment in self.first_moment)

    @property
    def central_inertia(self) -> tuple[float, ...] | None:
        """Its inertia about its own centre of mass, in the order of `inertia`, kg m^2."""
        if not self.mass or self.first_moment is None or self.inertia is None:
            return None
        about = np.ravel(self.inertia)
        kind = PlanarInertia if len(about) == 1 else SpatialInertia
        x, y, z = (*(moment / self.mass for moment in self.first_moment), 0.0)[:3]
        shares = list(kind.shares_of_point(x, y, z).values())[-len(about) :]
        return tuple((about - self.mass * np.array(shares)).tolist())

    def add_to(self, robot: RobotLike) -> Manipulator:
        """Return the machine with the payload, as `set_payload` of exported code makes it.

        These are `mass`, `center_of_mass` and `central_inertia`; what the forces do not show is 0.

        Raises
        ------
        DataError
            If the forces do not show its mass, or it is negative.
        ModelError
            If no real body has its inertia.
        """
        return with_payload(robot, *self.arguments(robot))

    def arguments(self, robot: RobotLike) -> tuple[float, tuple[float, ...], tuple[float, ...]]:
        """Return mass, centre of mass and central inertia, 0 where the forces do not show them.

        `with_payload` takes them, and so does `set_payload` of exported code.
        """
        mass = np.nan if self.mass is None else self.mass
        center = (*(self.center_of_mass or ()), 0.0, 0.0, 0.0)[:3]
        count = inertia_count(as_manipulator(robot).platform.inertia.kinds)
        return mass, center, self.central_inertia or (0.0,) * count

    def call(self, robot: RobotLike) -> str:
        """Return the call of exported C that sets the payload, and the command-line option."""
        mass, center, inertia = (
            ", ".join(f"{x:.9g}" for x in np.ravel(part)) for part in self.arguments(robot)
        )
        option = "@".join((mass, center, inertia)).replace(" ", "")
        return (
            f"set_payload({{{mass}}}, {{{center}}}, {{{inertia}}}, parameters, loaded_parameters) "
            f"in exported C; --payload {option} on the command line"
        )

    @property
    def real(self) -> bool:
        """Whether a real body has these values: in a plane m > 0 and I m >= (m gamma)^2."""
        if self.mass is None or self.first_moment is None or self.inertia is None:
            return self.mass is not None and self.mass > 0.0
        kind = SpatialInertia if isinstance(self.inertia, tuple) else PlanarInertia
        try:
            kind.of_values([self.mass, *self.first_moment, *np.ravel(self.inertia).tolist()])
        except ModelError:
            return False
        return True

    @property
    def is_significant(self) -> bool:
        """Whether the values differ significantly from zero (Wald's test, 0.1 %)."""
        chosen = [self.estimate.names.index(name) for name in self.names]
        return self.estimate.wald(self.values, chosen) > float(
            scipy.stats.chi2.isf(CHANCE, len(chosen))
        )

    @property
    def has_valid_errors(self) -> bool:
        """Whether the stated errors of the values hold: there is no fault that lowers the grade."""
        return not self.fault_isolation.matters

    def summary(self) -> str:
        """Return the payload, for people, as lines of text."""
        lines = ["Payload, about P in the platform's frame:"]
        for name, size, deviation in zip(self.names, self.values, self.deviations, strict=True):
            unit = self.estimate.units[self.estimate.names.index(name)]
            lines.append(f"  {name:<6} {size:+.5g} +- {deviation:.2g} {unit}")
        if self.center_of_mass is not None:
            center = ", ".join(f"{x:+.5g}" for x in self.center_of_mass)
            lines.append(f"Centre of mass: ({center}) m.")
        spatial = any(name[:2] in ("Ix", "Iy", "Iz") for name in self.names)
        kinds = (SpatialInertia if spatial else PlanarInertia).kinds
        hidden = [f"{kind}_L" for kind in kinds if f"{kind}_L" not in self.names]
        if hidden:
            lines.append(f"Not felt by the actuators: {', '.join(hidden)}.")
        lines.append(self._opinion())
        lines += [fault.message for fault in self.fault_isolation.faults if fault.matters]
        if not self.has_valid_errors:
            lines.append("The stated errors do not allow for that.")
        lines += [f"Note: {finding.message}" for finding in self.findings]
        residuals = ", ".join(f"{size:.2g}" for size in self.residual)
        lines.append(
            f"Residuals of the actuator forces: {residuals} (standard deviations, N or N m)."
        )
        return "\n".join(lines)

    def _opinion(self) -> str:
        """Return a sentence that states whether the payload is significant and a real body."""
        if not self.is_significant:
            return "No payload is felt: the values are zero within their certainty."
        if self.real:
            return "A real body has these values."
        if self.mass is not None and self.mass < -3.0 * self.deviations[0]:
            return "The mass is negative: is what was called with payload the one without it?"
        return "No real body has these values: record longer, or faster."

    def as_dict(self) -> dict[str, Any]:
        """Return the payload as plain data, without the other values of the fit."""
        return json_fields(
            mass=self.mass,
            first_moment=self.first_moment,
            inertia=self.inertia,
            center_of_mass=self.center_of_mass,
            central_inertia=self.central_inertia,
            names=self.names,
            standard_deviations=self.deviations,
            covariance=self.covariance,
            felt=self.is_significant,
            real=self.real,
            residual=self.residual,
            trial=self.fault_isolation,
            findings=self.findings,
        )

    carried_by = former_attribute("carried_by", "add_to")
    felt = former_attribute("felt", "is_significant")
    allowed_for = former_attribute("allowed_for", "has_valid_errors")


def identify_payload(
    robot: RobotLike,
    without: Log,
    with_payload: Log | None = None,
    *,
    terms: Terms | None = None,
    processing: Processing | None = None,
    estimator: Callable[[Observations], Estimate] = weighted_least_squares,
    base: BaseParameters | None = None,
) -> Payload:
    """Return a payload's inertia from motions with and without it.

    F = W beta without payload and F = W beta + W_L theta_L with it, W_L being the platform's
    columns of the regressor, are solved as one system: friction and base parameters are the same
    in both, so that the machine's own parameters need not be known.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine: its geometry is used, its inertial parameters are not.
    without : Log
        A log without payload; or one whose payload column has both phases, 0 and 1.
    with_payload : Log, optional
        A log of the same machine with the payload, where the first has none.
    terms : Terms, optional
        Friction, offsets and other terms beside base parameters and payload.
    processing : Processing, optional
        Choices about the preprocessing; by default the data decide.
    estimator : callable
        Estimates the values from observations.
    base : BaseParameters, optional
        Another choice of base parameters, such as that of legs which share theirs.

    Raises
    ------
    LogError
        If a phase is missing, the forces are not in newtons, columns are swapped or have their sign
        flipped, or the motion does not show the values: all that `identify` refuses.

    References
    ----------
    W. Khalil, M. Gautier and P. Lemoine, "Identification of the payload inertial parameters of
    industrial manipulators", ICRA 2007: the logs with and without payload solved as one system.
    """
    robot = as_manipulator(robot)
    model = identification_model(robot, replace(terms or Terms(), payload=True), base=base)
    without = convert_to_newtons(without, robot)
    if with_payload is not None:
        with_payload = convert_to_newtons(with_payload, robot)
    fit = read_phases(without, with_payload, processing)
    check_recordings(robot, fit, (), processing or Processing())
    with append_findings(fit):
        parts, plans = observe_phases(model, fit, processing)
        observations = stack_balanced(parts)
        estimate = estimator(observations)
        if unphysical(model, observations, estimate) or excess_residual_cause(estimate, plans):
            check_columns(model, fit[0], plans[0])
        check_motion(model, estimate, plans, fit[0])
        hidden = unseen_names(model, estimate.deviations)
        cause = excess_residual_cause(estimate, plans)
        if cause and len(hidden) > _MOST_UNSEEN * model.base.rank:
            raise fit[0].log.fault("left over", cause)  # no verdict of a payload could say so
    return _payload_of_fit(
        model,
        estimate,
        isolate_faults(model, estimate, fit, plans),
        [recording.findings for recording in fit],
    )


def payload_in(fit: Identification) -> Payload | None:
    """Return the payload that `identify` found beside the machine; None without its mass."""
    if "m_L" not in fit.estimate.names:
        return None
    return _payload_of_fit(fit.model, fit.estimate, fit.fault_isolation, [fit.findings])


def _payload_of_fit(
    model: Model,
    estimate: Estimate,
    isolation: FaultIsolation,
    findings: Sequence[Sequence[Finding]],
) -> Payload:
    """Return the payload among the values of a fit."""
    names = tuple(name for name in estimate.names if name in _BOTH)
    chosen = [estimate.names.index(name) for name in names]

    def value_of_kinds(*kinds: str) -> tuple[float, ...] | None:
        """Return the payload's values of kinds like "m"; None unless the fit has each."""
        value_names = [f"{kind}_L" for kind in kinds]
        return tuple(map(estimate.value, value_names)) if set(value_names) <= set(names) else None

    kinds = model.robot.platform.inertia.kinds
    mass, tensor = value_of_kinds("m"), value_of_kinds(*(kind for kind in kinds if kind[0] == "I"))
    return Payload(
        mass=None if mass is None else mass[0],
        first_moment=value_of_kinds(*(kind for kind in kinds if kind[:2] == "mg")),
        inertia=tensor[0] if tensor and len(tensor) == 1 else tensor,
        names=names,
        covariance=estimate.covariance[np.ix_(chosen, chosen)],
        estimate=estimate,
        residual=estimate.noise,
        fault_isolation=isolation,
        findings=tuple(chain.from_iterable(findings)),
    )
