"""The last link of P-R-U-R and R-P-U-R legs: from a universal joint to a revolute joint at c.

The link is perpendicular to the platform's second axis b, about which it turns against the
platform; b turns about the first axis a, which is fixed in the base: l_l = h a + m n, n = a x b.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Self

import casadi as ca

from pteron.bodies.inertia import SpatialInertia
from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    PointMotion,
    RotationMotion,
    point_rows,
    solid_body,
)
from pteron.bodies.vectors import Vector
from pteron.errors import ModelError
from pteron.legs.jets import (
    Jet,
    angular_motion,
    platform_vector,
    point_jet,
)
from pteron.legs.kind import LegKind
from pteron.legs.leg import CoordinateLocus, Joint, LegEquations, Reach
from pteron.legs.planar_links import LinkRotation

TINY = 1e-300
"""Least divisor of a measure that is 0: out of reach both may be."""


class UniversalLinkLeg(LegKind):
    """The data of a leg that ends in such a link, under a 3T2R platform."""

    lower_length: float
    second_elbow: int
    lower: SpatialInertia
    platform_axes: tuple[Vector, ...]
    """a and b at angles zero, which the manipulator sets."""

    def with_platform_rotation(self, axes: Sequence[Vector], center: Vector | None) -> Self:
        """Return the leg with its platform's two axes; raise if the platform has not two."""
        if len(axes) != 2 or center is not None:
            raise ModelError(
                f"a {self.type} leg holds its platform against turning about the normal of two "
                'axes; make the platform\'s motion "3T2R", or give it another leg'
            )
        return replace(self, platform_axes=tuple(axes))

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return the platform's axes at angles zero; the leg withholds the turn about n alone."""
        return self.platform_axes

    def equations(self, values: Any = None) -> LegEquations:
        """Return the leg's equations, for its platform's axes at angles zero."""
        axes = ca.horzcat(*(ca.SX(list(axis)) for axis in self.platform_axes))
        return super().equations(values).with_axes(axes)


class LinkState(NamedTuple):
    """The last link in motion."""

    link: Jet
    """l_l."""
    h: Jet
    m: Jet


Root = Callable[[Expression], Expression]


class NestedClosure(NamedTuple):
    """A closure with two roots, one inside the other."""

    radicands: tuple[Expression, Expression]
    """m^2, the inner one first."""
    margin: Expression
    """The reach margin, m."""
    square: Expression
    """The squared type-I measure; 0 where a radicand is negative and its root taken for 0."""


class HeldClosure(NamedTuple):
    """The closure of both links from a given beginning."""

    sign: Expression
    """The sign of the root: that of its link's part along n."""
    square: Expression
    """The root's radicand, m^2."""
    rest: Expression
    """m^2: the square of the other link's part across n, less that of its length."""


class UniversalLinkEquations(LegEquations):
    """The equations of such a leg; those of its first links are its subclasses'."""

    rides = ("l",)
    first_link, second_link = "lower link", "ram"
    """The links whose lengths the inner and the outer root depend on."""

    def __init__(self, guide_point: Expression, lower_length: Expression, **signs: Expression):
        self.r, self.ll = guide_point, lower_length
        self.sigma, self.kappa = signs["elbow"], signs["second_elbow"]
        self.a, self.b = ca.SX(3, 1), ca.SX(3, 1)

    def with_axes(self, axes: Expression) -> Self:
        """Return the equations for the platform's axes a and b now, the columns of (3, 2)."""
        changed = object.__new__(type(self))
        vars(changed).update(vars(self), a=axes[:, 0], b=axes[:, 1])
        return changed

    def with_rotation(self, rotation: RotationMotion) -> Self:
        """Return the equations for the axes that a platform's rotation has now."""
        return self if rotation.axes is None else self.with_axes(rotation.axes)

    def vectors(self, point: PointMotion, rotation: RotationMotion) -> tuple[Jet, Jet, Jet]:
        """Return w = c - r, b and n in motion."""
        b = platform_vector(self.b, rotation)
        return point_jet(point, self.r), b, b.transform(ca.skew(self.a))

    def link_across(self, w: Jet, n: Jet) -> LinkState:
        """Return the link whose part along a, h, is that of w, as where the rest is across a."""
        h = w.transform(self.a.T)
        m = h.complement(self.ll, self.kappa)
        return LinkState(h.multiply(self.a) + m * n, h, m)

    def last_parts(
        self, point: PointMotion, rotation: RotationMotion, at: LinkState, first: LinkRotation
    ) -> tuple[BodyMotion, list[Joint]]:
        """Return the link's motion, and the joints from the universal joint on.

        `first` is the rotation about a of what carries the universal joint.
        """
        a, b, link = self.a, self.b, at.link
        turn = platform_vector(b, rotation)
        omega, growth = angular_motion(rotation)
        none = ca.SX(1, 3)
        alpha = LinkRotation(ca.horzcat(none, a.T), ca.dot(a, omega), ca.dot(a, growth))
        beta = LinkRotation(
            ca.horzcat(none, b.T), ca.dot(b, omega), ca.dot(b, growth) + ca.dot(turn.rate, omega)
        )
        theta = LinkRotation(
            *(
                (at.m.value * x - at.h.value * y) / (self.ll * self.ll)
                for x, y in zip(at.h.parts[1:], at.m.parts[1:], strict=True)
            )
        )
        turning = alpha.rate * a + theta.rate * b
        growing = alpha.acceleration * a + theta.acceleration * b + theta.rate * turn.rate
        row = ca.mtimes(a, alpha.row) + ca.mtimes(b, theta.row)
        reference = point.position, point_rows(ca.SX.eye(3)), point.acceleration
        body = solid_body(reference, (link.value / self.ll, b), row, turning, growing)
        center = point.position - link.value
        return body, [
            Joint("R", a, center, *alpha.relative_to(first)),
            Joint("R", b, center, *theta, "l"),
            Joint("R", b, point.position, *beta.relative_to(theta)),
        ]

    def force(self, first: Expression, link: Expression) -> tuple[Expression, Expression]:
        """Return the force f (3, 1) through the universal joint's centre, and its row (1, 6).

        It is the wrench that passive joints transmit, f = (a x l_u) x (b x l_l), `first` being l_u.
        """
        f = ca.cross(ca.cross(self.a, first), ca.cross(self.b, link))
        return f, ca.horzcat(f.T, -ca.cross(link, f).T)

    @abstractmethod
    def closure(self, c: Expression, root: Root) -> NestedClosure:
        """Return the nested closure at c (3, 1); `root` returns the square root of a number."""

    def reach(self, c: Expression) -> Reach:
        """Return the reach: what the links' lengths have left under both roots, m."""
        (inner, outer), margin, square = self.closure(c, clipped_root)
        beyond = ca.fmin(ca.fmin(inner, outer), 0)  # where it is not 0 the square is
        return Reach(margin, beyond + square, ca.SX(1), self.ll)

    def edges(self, c: Expression) -> dict[str, Expression]:
        """Return both radicands, m^2, by the link whose length is too short where one is negative.

        The second counts only where the first is not negative.
        """
        inner, outer = self.closure(c, clipped_root).radicands
        return {self.first_link: inner, self.second_link: outer}

    def radicands(self, c: Expression) -> tuple[Expression, ...]:
        """Return the radicands of both roots, the one of the inner root first."""
        return self.closure(c, ca.sqrt).radicands

    @abstractmethod
    def first_end(self, q: Expression) -> tuple[Expression, Expression]:
        """Return where the link before this one begins (3, 1), and its length, with q held."""

    def held_closure(self, u: Expression, length: Expression) -> HeldClosure:
        """Return what u = l_u + l_l satisfies: the last link's part along n has the root."""
        h, along_b = ca.dot(self.a, u), ca.dot(self.b, u)
        return HeldClosure(self.kappa, self.ll * self.ll - h * h, along_b * along_b - length**2)

    def locus(self, q: Expression) -> CoordinateLocus:
        """Return the locus of c: both links together lead there from the first one's beginning."""
        start, length = self.first_end(q)

        def closure(c: Expression, any_branch: bool) -> Expression:
            """Return |u - l|^2 - l'^2 for the links' lengths l and l', l with the root's sign."""
            u = c - start
            sign, square, rest = self.held_closure(u, length)
            part = ca.dot(ca.cross(self.a, self.b), u)
            even = square + part * part + rest
            if any_branch:
                return even * even - 4 * square * part * part
            return even - 2 * sign * ca.sqrt(square) * part

        return CoordinateLocus(q, closure=closure)


def turn_about(axis: Expression, vector: Jet, square: Expression) -> LinkRotation:
    """Return the rotation about a fixed axis of a vector of fixed length across it."""
    swing = ca.cross(axis, vector.value).T / square
    return LinkRotation(*(ca.mtimes(swing, part) for part in vector.parts[1:]))


def clipped_root(square: Expression) -> Expression:
    """Return the root of a number; 0 where it is below zero."""
    return ca.sqrt(ca.fmax(square, 0))
