"""PD control with gravity compensation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pteron.controllers.feedback import Feedback


@dataclass(frozen=True)
class PDGravity(Feedback):
    """F = K_p e + K_d e' + J^-T g + f_0: springs and dampers at the joints, and gravity balanced.

    e = q_d - q is the joints' error, g the gravity forces at the measured pose, f_0 the drives'
    offsets. Without dry friction it holds any pose exactly; in motion the joints lag behind.

    Parameters
    ----------
    period : float
        Time between two samples, for which forces are held, s.
    bandwidth : float or one for each joint, optional
        Rate at which an error decays, rad/s; by default 0.2 / period, as springs alone hold the
        joints in motion. It gives the gains, together with the joints' masses (`joint_masses`).
    damping : float or one for each joint
        1 is the least without overshoot.
    proportional, derivative : float or one for each joint, optional
        The gains themselves: N/m and N s/m at a slider, N m/rad and N m s/rad at a crank.

    Raises
    ------
    DataError
        If a number is not above zero, or one of the gains is given alone.

    Examples
    --------
    >>> from pteron.controllers import PDGravity
    >>> PDGravity(bandwidth=-5.0)
    Traceback (most recent call last):
    pteron.errors.DataError: bandwidth: -5.0 given, a number above 0 expected
    """

    share: ClassVar[float] = 0.2

    @property
    def law_name(self) -> str:
        """The name of the control law, "pd_gravity"."""
        return "pd_gravity"
