"""PD control with gravity compensation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pteron.controllers.feedback import Feedback


@dataclass(frozen=True)
class PDGravity(Feedback):
    """F = K_p e + K_d e' + J^-T g + f_0: what holds the machine, and springs at its joints.

    g and the drives' offsets f_0 are those of the measured pose. It holds any pose exactly where
    nothing is dry, and needs no accelerations; in motion the joints lag behind.

    Parameters
    ----------
    period : float
        Time between two samples, for which forces are held, s.
    bandwidth : float or one for each joint, optional
        Rate at which an error goes, rad/s; by default 0.2 / period, since springs alone are to hold
        the joints in motion. Times the joints' masses, see `joint_masses`, it gives the gains.
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
    def what(self) -> str:
        """The name of its law."""
        return "pd_gravity"
