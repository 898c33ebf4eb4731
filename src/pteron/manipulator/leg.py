"""One leg: an actuated slider and two links that carry a point of the platform."""

from __future__ import annotations

from dataclasses import dataclass

from pteron.errors import ModelError
from pteron.manipulator.inertia import PlanarInertia
from pteron.manipulator.vectors import Vector, dot, numbers, positive, unit_vector, vector

__all__ = ["Leg"]

_LEAST_SLIDE = 1e-6


@dataclass(frozen=True)
class Leg:
    """A P-R-R-R leg that carries one point of the platform.

    The slider moves along `slider_direction` through `guide_point`; the revolute axes R1, R2 and R3
    all have `direction`. Vectors are in the base frame, except `platform_point`.

    Parameters
    ----------
    guide_point : vector
        r, the point of the guide where the slider coordinate is zero, m.
    direction : unit vector
        d, of the revolute axes.
    platform_point : vector
        s0, from P to the platform point, in the platform frame, m.
    upper_length, lower_length : float
        Lengths of the upper link (R1 to R2) and of the lower link (R2 to R3), m.
    slider_mass : float
        m_p, kg.
    upper, lower : PlanarInertia
        Inertia of the two links; see `PlanarInertia` for their reference points.
    slider_direction : unit vector, optional
        e; d where it is not given.
    elbow : {1, -1}
        sigma, the side of the elbow.
    slider_limits : (float, float), optional
        Least and greatest slider coordinate, m.
    """

    guide_point: Vector
    direction: Vector
    platform_point: Vector
    upper_length: float
    lower_length: float
    slider_mass: float
    upper: PlanarInertia
    lower: PlanarInertia
    slider_direction: Vector | None = None
    elbow: int = 1
    slider_limits: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        direction = unit_vector(self.direction, "direction")
        e = self.slider_direction
        if e is not None:
            e = unit_vector(e, "slider_direction")
            if abs(dot(direction, e)) < _LEAST_SLIDE:
                raise ModelError(
                    f"slider_direction: {list(e)} is perpendicular to direction {list(direction)}, "
                    "so that the slider cannot move the leg's plane; tilt one against the other"
                )
        if self.elbow not in (1, -1):
            raise ModelError(f"elbow: {self.elbow!r} is neither 1 nor -1")
        checked = {
            "guide_point": vector(self.guide_point, "guide_point"),
            "direction": direction,
            "platform_point": vector(self.platform_point, "platform_point"),
            "upper_length": positive(self.upper_length, "upper_length", "m"),
            "lower_length": positive(self.lower_length, "lower_length", "m"),
            "slider_mass": positive(self.slider_mass, "slider.mass", "kg"),
            "slider_direction": e,
            "elbow": int(self.elbow),
            "slider_limits": _limits(self.slider_limits),
        }
        for key, value in checked.items():
            object.__setattr__(self, key, value)

    @property
    def e(self) -> Vector:
        """The slider's direction, also where it was left to its default."""
        return self.slider_direction or self.direction


def _limits(limits: tuple[float, float] | None) -> tuple[float, float] | None:
    if limits is None:
        return None
    low, high = numbers(limits, "slider_limits", 2)
    if low >= high:
        raise ModelError(
            f"slider_limits: {low:g} m is not below {high:g} m; give [least, greatest]"
        )
    return (low, high)
