"""The abstract base of controllers with PD feedback: gains from bandwidth, damping and period."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pteron.controllers.controller import Controller
from pteron.controllers.joint_masses import joint_masses
from pteron.controllers.joint_numbers import PerJoint, joint_array
from pteron.equations.control import GAINS
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator


@dataclass(frozen=True)
class Feedback(Controller):
    """A controller with the feedback K_p e + K_d e' of the joints' errors e = q_d - q.

    By default the gains are such that the error of a single mass without friction obeys, at the
    samples, e'' + 2 damping bandwidth e' + bandwidth^2 e = 0 exactly.

    Parameters
    ----------
    period : float
        Time between two samples, for which forces are held, s.
    bandwidth : float or one for each joint, optional
        Rate at which an error decays, rad/s; by default 0.1 / period.
    damping : float or one for each joint
        Damping ratio: 1 is the least without overshoot.
    proportional, derivative : float or one for each joint, optional
        The gains themselves, in place of what bandwidth and damping give; both or none.
    """

    damping: PerJoint = 1.0
    proportional: PerJoint | None = None
    derivative: PerJoint | None = None

    positive: ClassVar[tuple[str, ...]] = ("bandwidth", "damping", "proportional", "derivative")
    of_accelerations: ClassVar[bool] = False
    """Whether the gains make accelerations, 1/s^2 and 1/s, and not forces."""

    def __post_init__(self) -> None:
        super().__post_init__()
        gains = {"proportional": self.proportional, "derivative": self.derivative}
        missing = [name for name, gain in gains.items() if gain is None]
        if len(missing) == 1:
            (other,) = gains.keys() - missing
            raise DataError(
                f"{missing[0]}: missing, but {other} is given; give both, or bandwidth and damping"
            )

    def gains(self, model: Manipulator) -> Array:
        """Return the controller's gain vector (G,) for a machine; see `Controller.gains`."""
        if self.proportional is not None and self.derivative is not None:
            pair = [
                joint_array(model, name, setting)
                for name, setting in (
                    ("proportional", self.proportional),
                    ("derivative", self.derivative),
                )
            ]
        else:
            poles = self.bandwidths(model), joint_array(model, "damping", self.damping)
            masses = 1.0 if self.of_accelerations else joint_masses(model)
            pair = [masses * gain for gain in pole_gains(*poles, self.period)]
        period = [self.period] if "period" in GAINS[self.law_name] else []
        return np.concatenate([*pair, period])


def pole_gains(bandwidth: Array, damping: Array, period: float) -> tuple[Array, Array]:
    """Return k_p (1/s^2) and k_d (1/s) that give a sampled double integrator chosen poles.

    With u = k_p e + k_d e' held for a period T, e'' = -u gives at the samples the poles z_1 and z_2
    if k_p = (1 - z_1) (1 - z_2) / T^2 and k_d = (3 - z_1 - z_2 - z_1 z_2) / (2 T); z = exp(s T).

    Examples
    --------
    >>> import numpy as np
    >>> [float(g.round(2)) for g in pole_gains(np.array(100.0), np.array(1.0), 1e-6)]
    [9999.0, 199.99]
    """
    root = np.emath.sqrt(np.asarray(damping) ** 2 - 1.0)
    # Without the loss of digits that 1 - z has for short periods.
    first, second = (-np.expm1(-bandwidth * (damping + sign * root) * period) for sign in (1, -1))
    product, total = np.real(first * second), np.real(first + second)
    return product / period**2, (total - 0.5 * product) / period
