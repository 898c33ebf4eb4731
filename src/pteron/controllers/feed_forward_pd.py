"""PD control of the joints, with the wanted motion's inverse dynamics as feed-forward."""

from __future__ import annotations

from dataclasses import dataclass

from pteron.controllers.feedback import Feedback


@dataclass(frozen=True)
class FeedForwardPD(Feedback):
    """F = K_p e + K_d e' + what the drives need for the wanted motion, friction included.

    e = q_d - q is the joints' error. The model is evaluated on the wanted motion alone, in the
    middle of the period for which the forces are held; no direct kinematics are needed.

    Parameters
    ----------
    period : float
        Time between two samples, for which forces are held, s.
    bandwidth : float or one for each joint, optional
        Rate at which an error decays, rad/s; by default 0.1 / period. It gives the gains, together
        with the joints' masses (`joint_masses`).
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
    >>> from pteron.controllers import FeedForwardPD
    >>> FeedForwardPD(proportional=[4e4, 4e4, 4e4], derivative=[400.0, 0.0, 400.0])
    Traceback (most recent call last):
    pteron.errors.DataError: derivative: 0.0 given for joint 2, a number above 0 expected
    """

    @property
    def law_name(self) -> str:
        """The name of the control law, "feed_forward_pd"."""
        return "feed_forward_pd"
