"""The inertia of a body that moves in a plane: mass, first moment and moment of inertia."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pteron.errors import ModelError
from pteron.manipulator.vectors import number, numbers, positive

__all__ = ["PlanarInertia"]

_ROUNDING = 1e-12


@dataclass(frozen=True)
class PlanarInertia:
    """Inertia of a link or of the platform about its reference point, in its own frame.

    The reference point of an upper link is on R1, with x towards R2; that of a **lower link is on
    R3, the platform's end**, with x pointing from R2 to R3, so that a usual lower link has a
    negative first moment along x; that of the platform is P.

    Parameters
    ----------
    mass : float
        Mass m, kg.
    first_moment : tuple of float
        (m gamma_x, m gamma_y), kg m: mass times the position of the centre of mass.
    inertia : float
        Moment of inertia I about the rotation axis **through the reference point**, kg m^2.

    Raises
    ------
    ModelError
        If no real body has this inertia: the mass must be positive and I m >= (m gamma)^2.

    Examples
    --------
    >>> link = PlanarInertia.of_body(0.32, (0.0847, 0.01), 0.003099648)
    >>> link.first_moment
    (0.027104, 0.0032)
    """

    mass: float
    first_moment: tuple[float, float]
    inertia: float

    def __post_init__(self) -> None:
        mass = positive(self.mass, "mass", "kg")
        hx, hy = numbers(self.first_moment, "first_moment", 2)
        inertia = number(self.inertia, "inertia")
        least = (hx * hx + hy * hy) / mass
        if inertia < least * (1.0 - _ROUNDING) or inertia <= 0.0:
            raise ModelError(
                f"inertia: {inertia:g} kg m^2 belongs to no real body; with this mass and centre "
                f"of mass, and about the reference point, it must be above {least:g} kg m^2"
            )
        object.__setattr__(self, "mass", mass)
        object.__setattr__(self, "first_moment", (hx, hy))
        object.__setattr__(self, "inertia", inertia)

    @classmethod
    def of_body(cls, mass: float, center_of_mass: Sequence[float], inertia: float) -> PlanarInertia:
        """Build the inertia from the centre of mass (m) instead of the first moment (kg m)."""
        mass = positive(mass, "mass", "kg")
        x, y = numbers(center_of_mass, "center_of_mass", 2)
        return cls(mass, (mass * x, mass * y), inertia)

    @property
    def center_of_mass(self) -> tuple[float, float]:
        """Position of the centre of mass in the body's frame, m."""
        return (self.first_moment[0] / self.mass, self.first_moment[1] / self.mass)

    @property
    def values(self) -> tuple[float, float, float, float]:
        """(m, m gamma_x, m gamma_y, I), the order of the paper's Eq. (16)."""
        return (self.mass, *self.first_moment, self.inertia)
