"""The abstract base of all controllers: gains and a sampling period; `law` serves one machine."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from pteron.controllers.joint_numbers import PerJoint, joint_array, period_of, positive_numbers
from pteron.controllers.law import Law
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.reduction import BaseParameters
from pteron.renamed import adopt_former_methods, former_attribute


@dataclass(frozen=True)
class Controller(ABC):
    """A controller as data, its gains and sampling period; `law` makes the `Law` for a machine.

    Parameters
    ----------
    period : float
        Time between two samples, for which forces are held, s.
    bandwidth : float or one for each joint, optional
        Rate at which an error decays, rad/s; by default 0.1 / period.
    """

    period: float = 1e-3
    bandwidth: PerJoint | None = None

    @property
    @abstractmethod
    def law_name(self) -> str:
        """The name of the control law, among `pteron.kernels.FUNCTIONS`."""

    what = former_attribute("what", "law_name")

    def __init_subclass__(cls) -> None:
        adopt_former_methods(cls, what="law_name")

    share: ClassVar[float] = 0.1
    """The default bandwidth, times the period: it allows for a delay of one sample, and for joints
    that are lighter elsewhere."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "period", period_of(self.period))
        for name in self.positive:
            object.__setattr__(self, name, positive_numbers(name, getattr(self, name)))

    positive: ClassVar[tuple[str, ...]] = ("bandwidth",)
    """The fields that are numbers above 0, one or one for each joint, or None."""

    def base(self, model: Manipulator) -> BaseParameters | None:
        """Return the base parameters of a machine that the controller estimates; None if none."""
        return None

    def bandwidths(self, model: Manipulator) -> Array:
        """Return the bandwidth of each joint (n,), rad/s."""
        usual = self.share / self.period
        return joint_array(model, "bandwidth", usual if self.bandwidth is None else self.bandwidth)

    @abstractmethod
    def gains(self, model: Manipulator) -> Array:
        """Return the controller's gain vector (G,) for a machine, as its law takes it.

        Parameters
        ----------
        model : Manipulator
            The machine as the controller knows it.

        Returns
        -------
        array, shape (G,)
            SI units; `pteron.equations.control.GAINS` has their order.

        Raises
        ------
        DataError
            If there are not as many numbers as joints.
        """

    def law(self, model: RobotLike) -> Law:
        """Return the control law of this controller for a machine.

        Parameters
        ----------
        model : Manipulator, name or path
            The machine as the controller knows it; what it controls may be another one.

        Returns
        -------
        Law

        Raises
        ------
        DataError
            If there are not as many gains as joints.
        """
        model = as_manipulator(model)
        return Law(self.law_name, model, self.gains(model), self.base(model))
