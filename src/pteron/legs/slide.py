"""Data and equations shared by legs with a slider and one link, P-S-S and planar P-R-R.

The slider moves along e through the guide point r. A rod (P-S-S) has its length in space, a planar
link (P-R-R) in its plane; each subclass supplies what depends on this.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from random import Random
from typing import Any, NamedTuple

import casadi as ca

from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    Moments,
    PointMotion,
    RotationMotion,
    point_rows,
)
from pteron.bodies.vectors import Vector, shift_point
from pteron.legs.circles import random_fraction
from pteron.legs.drive import Drive
from pteron.legs.kind import SLIDER, LegKind, LegTransfer, ReachBound
from pteron.legs.leg import Joint, LegEquations, LegMotion, Needs, Reach, force_wrench
from pteron.legs.reading import Reading


@dataclass(frozen=True)
class SlideLeg(LegKind):
    """The data of a leg with a slider and one link; its subclasses define the link."""

    guide_point: Vector
    slider_direction: Vector
    platform_point: Vector
    lower_length: float
    slider_mass: float
    lower: Any
    elbow: int = 1
    limits: tuple[float, float] | None = None
    fixed_offset: Vector = (0.0, 0.0, 0.0)
    drive: Drive | None = None
    reading: Reading | None = field(default=None, kw_only=True)

    joint = SLIDER
    singular_text = "its link is at a right angle to its guide"

    @property
    def joint_axis(self) -> Vector:
        """The unit vector along which the slider moves."""
        return self.slider_direction

    def zero_at(self, zero: float) -> dict[str, Any]:
        """Return the `guide_point` for which the slider's coordinate counts from `zero`, m."""
        return {"guide_point": shift_point(self.guide_point, self.slider_direction, zero)}

    @property
    def reach_bound(self) -> ReachBound:
        """A cylinder about the slider's line that holds all platform points in reach, m."""
        return ReachBound(self.guide_point, self.slider_direction, self.size)

    @property
    def reach_text(self) -> str:
        """The link's length, as a clause for messages."""
        return f"its {self.names['l']} reaches {self.lower_length:.4g} m from the guide"

    @property
    def extents(self) -> dict[str, tuple[str, float, float, str]]:
        """The range of x, m, where the link usually has its centre of mass."""
        ends = "slider and platform, where its x is zero"
        return {"l": ("lower", -self.lower_length, 0.0, ends)}

    def transfers(self, gravity: Vector) -> tuple[LegTransfer, ...]:
        """Return how inertial parameters transfer between slider and link, with reasons."""
        entries = {
            ("m", "p"): (1, ()),
            ("m", "l"): (-1, ()),
            ("mgx", "l"): (1, ("ll",)),
            ("I", "l"): (-1, ("ll", "ll")),
        }
        return (
            LegTransfer(f"slider and {self.names['l']}{{}} carry the joint between them", entries),
        )

    @classmethod
    @abstractmethod
    def random_link(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> Sequence[Fraction]:
        """Return the link as a random rational vector (3,)."""

    @classmethod
    def draw_closure(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int]:
        """Return a random rational platform point, slider position plus link; the elbow's sign."""
        b, e, q = cls.random_link(values, rng), values["slider_direction"], random_fraction(rng)
        ahead = sum(x * y for x, y in zip(b, e, strict=True))
        return [x + q * y for x, y in zip(b, e, strict=True)], 1 if ahead > 0 else -1


class SlideState(NamedTuple):
    """Slider and link in motion."""

    w: Expression
    """c - r in the link's space: (3, 1), or (2, 1) in the plane."""
    q: Expression
    b: Expression
    """The link, as w."""
    divisor: Expression
    """b . e."""
    rate: Expression
    acceleration: Expression


class SlideEquations(LegEquations):
    """The equations of a leg with a slider and one link."""

    rides = ("l",)

    def __init__(
        self,
        guide_point: Expression,
        slider_direction: Expression,
        lower_length: Expression,
        elbow: Expression,
    ) -> None:
        self.r, self.e = guide_point, slider_direction
        self.ll, self.sigma = lower_length, elbow

    @abstractmethod
    def to_link_space(self, v: Expression) -> Expression:
        """Return a vector (3, K) as the link's space has it: as it is, or (2, K) in a plane."""

    @abstractmethod
    def to_base_frame(self, v: Expression) -> Expression:
        """Return a vector of the link's space, (2, K) or (3, K), in the base frame (3, K)."""

    @abstractmethod
    def link(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        at: SlideState,
        slider: Joint,
    ) -> tuple[BodyMotion, list[Joint], tuple[Expression, Expression] | None]:
        """Return the link's motion, the joints after the slider, the link's angular motion."""

    def _closure_terms(self, c: Expression) -> tuple[Expression, Expression, Expression]:
        """Return w = c - r, h = w . e, and ll^2 minus the squared distance of c to the guide."""
        w, e = self.to_link_space(c - self.r), self.to_link_space(self.e)
        h = ca.dot(w, e)
        perpendicular = w - h * e
        return w, h, self.ll * self.ll - ca.dot(perpendicular, perpendicular)

    def state(self, point: PointMotion) -> SlideState:
        """Return the vectors of slider and link, and the slider's rate and acceleration.

        (b . e) q' = b . c'. Differentiated, (b . e) q'' = b . c'' + b' . b'.
        """
        e, dw, ddw = (self.to_link_space(v) for v in (self.e, point.velocity, point.acceleration))
        w, h, square = self._closure_terms(point.position)
        divisor = self.sigma * ca.sqrt(square)  # b . e
        q = h - divisor
        b = w - q * e
        rate = ca.dot(b, dw) / divisor
        db = dw - rate * e
        return SlideState(w, q, b, divisor, rate, (ca.dot(b, ddw) + ca.dot(db, db)) / divisor)

    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        """Return the motion of slider, link and joints, from platform point and rotation."""
        at = self.state(point)
        b = self.to_base_frame(at.b)
        full = point_rows(b.T)
        row = full / at.divisor
        slider = Joint("P", self.e, self.r, row, at.rate, at.acceleration, "p", driven=True)
        tip = self.r + at.q * self.e
        body = BodyMotion(tip, ca.mtimes(self.e, row), at.acceleration * self.e)
        link, joints, turning = self.link(point, rotation, at, slider)
        return LegMotion(
            at.q,
            at.rate,
            at.acceleration,
            full,
            at.divisor,
            {"p": body, "l": link},
            (slider, *joints),
            (None, b),
            (None, turning),
            self.ll,
        )

    def exported_terms(self, point: PointMotion, rotation: RotationMotion) -> dict[str, Expression]:
        """Return intermediate quantities of the leg's equations by name, for exported code."""
        w, h, square = self._closure_terms(point.position)
        return {"w": w, "h": h, "square": square, "root": ca.sqrt(square), "b": self.state(point).b}

    def reach(self, c: Expression) -> Reach:
        """Return the reach margin: link length less the distance of c from the guide, m."""
        _, _, square = self._closure_terms(c)
        far = ca.sqrt(self.ll * self.ll - square)
        return Reach(self.ll - far, square, self.ll * self.ll, self.ll)

    def needs(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces that slider and link require at joint and platform point.

        With eta = m gamma_x / ll and mu = I / ll^2 of the link, alpha = eta + mu and t the tip, the
        tip needs mu t'' - alpha c'' + eta g; the platform point needs alpha (g - t''), besides a
        point mass m + eta + alpha.
        """
        at, slider, lower = self.state(point), inertia["p"], inertia["l"]
        e, ddc, weight = (self.to_link_space(v) for v in (self.e, point.acceleration, gravity))
        eta, mu = lower.hx / self.ll, lower.i / (self.ll * self.ll)
        alpha = eta + mu
        joint = (
            at.acceleration * (slider.m + mu)
            - ca.dot(e, ddc) * alpha
            + ca.dot(e, weight) * (eta - slider.m)
        )
        force = self.to_base_frame(ca.mtimes(weight - at.acceleration * e, alpha))
        return Needs(joint, force_wrench(force), lower.m + eta + alpha)
