"""Computed torque control: the drives' forces for accelerations corrected by the joints' errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pteron.controllers.feedback import Feedback


@dataclass(frozen=True)
class ComputedTorque(Feedback):
    """F are the drive forces for q'' = q''_d + K_p e + K_d e' in the measured state.

    With the true model the errors e = q_d - q obey e'' + K_d e' + K_p e = 0, each joint
    independently. The pose is that of the measured joints, by Newton's method from the last one;
    the model is evaluated at the middle of the sampling period. Friction is that of the wanted
    rates.

    Parameters
    ----------
    period : float
        Time between two samples, for which forces are held, s.
    bandwidth : float or one for each joint, optional
        Rate at which an error decays, rad/s; by default 0.1 / period.
    damping : float or one for each joint
        Damping ratio of an error; 1 is the least without overshoot.
    proportional, derivative : float or one for each joint, optional
        The gains themselves, 1/s^2 and 1/s.

    Raises
    ------
    DataError
        If a number is not above zero, or one of the gains is given alone.

    Examples
    --------
    >>> import pteron
    >>> from pteron.controllers import ComputedTorque
    >>> law = ComputedTorque(period=1e-3, bandwidth=100.0).law(pteron.load("five-bar"))
    >>> law.gains.round(1)
    array([9055.9, 9055.9,  185.8,  185.8,    0. ])
    """

    @property
    def law_name(self) -> str:
        """The name of the control law, "computed_torque"."""
        return "computed_torque"

    of_accelerations: ClassVar[bool] = True
