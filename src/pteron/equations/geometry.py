"""The geometry that the equations see: of one machine, in numbers, or of a topology, in symbols."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from pteron.manipulator import Manipulator

Expression = Any
"""A CasADi SX matrix; CasADi has no types that a checker could read."""

SYMBOLS_PER_LEG = 18
"""r, d, e, a and s0 (three each), lu, ll and sigma."""


@dataclass(frozen=True)
class LegGeometry:
    """What the equations need of a leg; see the table of symbols in `pteron.manipulator.Leg`.

    The links move in the plane perpendicular to d. Vectors of that plane are written in its axes a
    and d x a, as two-vectors, wherever that is enough.
    """

    r: Expression
    d: Expression
    e: Expression
    s0: Expression
    lu: Expression
    ll: Expression
    sigma: Expression
    d_bar: Expression
    """d / (d . e): the slider coordinate is rho = d_bar . (c - r), Eq. (4) generalised."""
    plane: Expression
    """(3, 2): the axes a and d x a of the leg's plane."""
    e_plane: Expression
    """(2, 1): the part of e in the plane; zero where the slider moves along d."""

    @property
    def plane_rows(self) -> Expression:
        """(2, 3): u = plane_rows (c - r), the part of c - r - rho e in the plane, Eq. (5)."""
        return self.plane.T - ca.mtimes(self.e_plane, self.d_bar.T)


@dataclass(frozen=True)
class Geometry:
    """What the equations need of a machine: its legs, the platform's frame, gravity.

    `x0`, `y0` and `k` are the platform frame's axes at phi = 0 in the base frame; `turns` says
    whether the pose has an angle.
    """

    legs: tuple[LegGeometry, ...]
    x0: Expression
    y0: Expression
    k: Expression
    gravity: Expression
    turns: bool

    @property
    def freedom(self) -> int:
        """Number of pose coordinates, m = n."""
        return len(self.legs)

    @property
    def unit(self) -> Expression:
        """The size that most coordinates of the platform points have, or 1.

        Written as multiples of it they cost fewest operations: a factor of 1 is none.
        """
        sizes: list[float] = []
        for leg in self.legs:
            for value in ca.vertsplit(leg.s0[:2]):
                if value.is_constant() and float(value) != 0.0:
                    sizes.append(abs(float(value)))
        return max(sizes, key=sizes.count) if self.turns and sizes else 1.0

    @classmethod
    def of(cls, robot: Manipulator) -> Geometry:
        """Return the geometry of one machine, in numbers."""
        legs = []
        for leg in robot.legs:
            d, e = ca.SX(leg.direction), ca.SX(leg.e)
            plane = _plane(d, plane_axis(d, *pole(leg.direction)))
            aligned = leg.e == leg.direction
            legs.append(
                LegGeometry(
                    r=ca.SX(leg.guide_point),
                    d=d,
                    e=e,
                    s0=ca.SX(leg.platform_point),
                    lu=ca.SX(leg.upper_length),
                    ll=ca.SX(leg.lower_length),
                    sigma=ca.SX(leg.elbow),
                    d_bar=d if aligned else d / ca.dot(d, e),
                    plane=plane,
                    e_plane=ca.SX.zeros(2) if aligned else ca.mtimes(plane.T, e),
                )
            )
        x0, y0, k = (ca.SX(axis) for axis in robot.platform.frame)
        return cls(tuple(legs), x0, y0, k, ca.SX(robot.gravity), robot.platform.turns)

    @classmethod
    def symbols(cls, legs: int, turns: bool) -> tuple[Geometry, Expression]:
        """Return the geometry of a topology in symbols, and the symbols as one vector.

        The vector holds, for each leg, r, d, e, a, s0, lu, ll and sigma; then x0, y0, k, gravity.
        a is a unit vector perpendicular to d, such as `plane_axis` gives.
        """
        vectors = [ca.SX.sym(f"leg{i + 1}", SYMBOLS_PER_LEG) for i in range(legs)]
        frame = ca.SX.sym("frame", 12)
        parts = tuple(
            LegGeometry(
                r=v[0:3],
                d=v[3:6],
                e=v[6:9],
                s0=v[12:15],
                lu=v[15],
                ll=v[16],
                sigma=v[17],
                d_bar=v[3:6] / ca.dot(v[3:6], v[6:9]),
                plane=_plane(v[3:6], v[9:12]),
                e_plane=ca.mtimes(_plane(v[3:6], v[9:12]).T, v[6:9]),
            )
            for v in vectors
        )
        geometry = cls(parts, frame[0:3], frame[3:6], frame[6:9], frame[9:12], turns)
        return geometry, ca.vertcat(*vectors, frame)


def geometry_values(robot: Manipulator) -> list[float]:
    """Return the numbers of a machine for the vector of `Geometry.symbols`."""
    g = Geometry.of(robot)
    values: list[float] = []
    for leg in g.legs:
        parts = (leg.r, leg.d, leg.e, leg.plane[:, 0], leg.s0, leg.lu, leg.ll, leg.sigma)
        values += [float(v) for part in parts for v in ca.vertsplit(ca.densify(part))]
    frame = (g.x0, g.y0, g.k, g.gravity)
    return values + [float(v) for part in frame for v in ca.vertsplit(ca.densify(part))]


def pole(direction: Sequence[float]) -> tuple[int, int]:
    """Return the largest component of a unit vector and its sign, which `plane_axis` asks for."""
    i = max(range(3), key=lambda j: abs(direction[j]))
    return i, 1 if direction[i] > 0 else -1


def plane_axis(d: Expression, i: int, sign: int) -> Expression:
    """Return a unit vector a perpendicular to d, without a root; d along axis i gives axis i + 1.

    It is the image of axis i + 1 under the reflection that takes axis i to -sign d. `sign` is that
    of d's component i, so that the denominator is at least 1.
    """
    unit = ca.SX.eye(3)
    v = d + sign * unit[:, i]
    j = (i + 1) % 3
    return unit[:, j] - (v[j] / (1 + sign * d[i])) * v


def _plane(d: Expression, a: Expression) -> Expression:
    return ca.horzcat(a, ca.cross(d, a))


def times(constant: Expression, expression: Expression) -> Expression:
    """Return constant times expression, with a negative number's sign taken out of the product.

    So 0.04 cos(phi) and -0.04 cos(phi) share their product: CasADi turns a + (-b) into a - b.
    """
    if constant.is_constant() and float(constant) < 0.0:
        return -(-constant * expression)
    return constant * expression


def along(vector: Expression, expression: Expression) -> Expression:
    """Return a constant three-vector times an expression, component by component (see `times`)."""
    return ca.vertcat(*(times(vector[i], expression) for i in range(3)))


def weighted_sum(weights: Expression, terms: Sequence[Expression]) -> Expression:
    """Return the sum of weight times term; equal weights, but for sign, share one product."""
    shared: dict[float, Expression] = {}
    total = ca.SX(*terms[0].shape)
    for weight, term in zip(ca.vertsplit(weights), terms, strict=True):
        if not weight.is_constant():
            total = total + weight * term
        elif weight != 0:
            value = abs(float(weight))
            signed = term if weight > 0 else -term
            shared[value] = shared[value] + signed if value in shared else signed
    for value, sum_of_terms in shared.items():
        total = total + value * sum_of_terms
    return total
