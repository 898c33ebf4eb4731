"""Slotine and Li's adaptive control: it learns base parameters and, if asked, drives' numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from pteron.controllers.adaptation_scales import Moves, scales_of, typical_scales
from pteron.controllers.controller import Controller
from pteron.controllers.joint_masses import joint_masses
from pteron.controllers.joint_numbers import PerJoint, joint_array
from pteron.equations.control import ADAPTED
from pteron.equations.drives import drive_numbers
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.reduction import BaseParameters

_SHARE = 0.02
"""The default rate of adaptation, as a share of the bandwidth."""


@dataclass(frozen=True)
class Adaptive(Controller):
    """F = Y theta + K_d z, theta' = Gamma Y^T z: Slotine and Li's law; theta are base parameters.

    e = q_d - q is the joints' error, z = e' + bandwidth e, and Y theta is what the drives need for
    q'_r = q'_d + bandwidth e. Errors vanish though the masses are not known; the estimates need not
    become the true values, only what the motion asks of them. They stay bounded: no farther from
    the start, in the measure of Gamma, than where all parameters are off by `uncertainty`.

    Parameters
    ----------
    period : float
        Time between two samples, for which forces are held, s.
    bandwidth : float or one for each joint, optional
        Rate at which an error decays, rad/s; by default 0.1 / period.
    derivative : float or one for each joint, optional
        K_d, N s/m at a slider and N m s/rad at a crank; by default bandwidth times the joint's
        mass, see `joint_masses`.
    adaptation : float, optional
        Rate at which what the motion shows is learnt, rad/s; by default a fiftieth of the
        bandwidth, and less where something would be learnt faster than errors decay.
    uncertainty : float
        Share by which the parameters may be off; 0.5 is a half. A first moment that is zero counts
        as the mass times the body's radius of gyration.
    friction : bool
        Whether dry and viscous friction, offsets and motors' inertia are estimated too, or taken
        from the model.
    motion : Motion, optional
        What is to be learnt from: all that it shows is then learnt at one rate. By default a
        typical motion, well inside the workspace, at 0.5 m/s and 5 m/s^2.

    Raises
    ------
    DataError
        If a number is not above zero.

    Notes
    -----
    J.-J. E. Slotine, W. Li, "On the adaptive control of robot manipulators", The International
    Journal of Robotics Research 6 (1987) 49-59.

    Examples
    --------
    >>> import pteron
    >>> from pteron.controllers import Adaptive
    >>> law = Adaptive().law(pteron.load("five-bar"))
    >>> law.base.names
    ('I_u1', 'I_u2', 'mgx_l1', 'mgy_l1', 'mgx_l2', 'mgy_l2', 'm_e')
    """

    derivative: PerJoint | None = None
    adaptation: float | None = None
    uncertainty: float = 0.5
    friction: bool = False
    motion: Moves | None = field(default=None, compare=False, repr=False)

    positive: ClassVar[tuple[str, ...]] = ("bandwidth", "derivative", "adaptation", "uncertainty")

    @property
    def law_name(self) -> str:
        """The name of the control law: "adaptive_drives" with friction, else "adaptive"."""
        return "adaptive_drives" if self.friction else "adaptive"

    def base(self, model: Manipulator) -> BaseParameters:
        """Return the base parameters of a machine that the controller estimates."""
        return typical_scales(model).base

    def gains(self, model: Manipulator) -> Array:
        """Return the controller's gain vector (G,) for a machine; see `Controller.gains`."""
        # As Euler's method sees it, so that the error's poles are those of the bandwidth.
        slope = -np.expm1(-self.bandwidths(model) * self.period) / self.period
        derivative = slope * joint_masses(model)
        if self.derivative is not None:
            derivative = joint_array(model, "derivative", self.derivative)
        start = self.base(model).values(model)
        if self.friction:
            drives = drive_numbers(model)[: len(ADAPTED) * model.joint_count]
            start = np.concatenate([start, drives])
        rate = _SHARE * slope.min() if self.adaptation is None else self.adaptation
        scales = scales_of(model, self.motion)
        matrix, size = scales.adaptation_matrix(derivative, len(start), rate, float(slope.min()))
        bounds = [self.uncertainty * size]
        return np.concatenate([slope, derivative, [self.period], start, matrix.ravel("F"), bounds])
