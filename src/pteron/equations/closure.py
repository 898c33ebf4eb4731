"""The sliders' closure d_bar . (c - r) = rho: what the direct problem and J^-T have in common.

For 3T1R the n = 4 rows d_bar leave one left null vector N (N^T D = 0), and every solution of
D^T F = w is F = P w + lambda N with P = D (D^T D)^-1. So the Jacobian, [ D | j ], never needs a
numerical elimination: its only denominator is N . j, which depends on phi alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from pteron.equations.geometry import Expression, Geometry, times, weighted_sum
from pteron.equations.platforms import Turn, offset_in_units, resting_offset


@dataclass(frozen=True)
class Closure:
    """Constants of the closure, for n legs and the platform's freedom m = n."""

    rows: Expression
    """D, (n, 3): the rows d_bar."""
    right_inverse: Expression
    """P, (n, 3), with D^T P = 1."""
    null: Expression
    """N, (n, 1), with N^T D = 0; None for 3T, as are the two that follow."""
    cosines: Expression
    """(n, 1): j_i = cosines_i cos(phi) + sines_i sin(phi) is the Jacobian's fourth column."""
    sines: Expression


def closure(geometry: Geometry) -> Closure:
    """Return the constants of the sliders' closure."""
    rows = ca.vertcat(*(leg.d_bar.T for leg in geometry.legs))
    if not geometry.turns:
        return Closure(rows, _adjugate(rows).T / _det3(rows), None, None, None)
    normal = ca.mtimes(rows.T, rows)
    right_inverse = ca.mtimes(rows, _adjugate(normal)) / _det3(normal)
    null = ca.vertcat(*((-1) ** i * _det3(_without(rows, i)) for i in range(4)))
    if null.is_constant():
        null = null / ca.norm_inf(null)
    offsets = [resting_offset(geometry, i) for i in range(4)]
    bars = [leg.d_bar for leg in geometry.legs]
    cosines = ca.vertcat(*(ca.dot(d, b) for d, (_, b, _) in zip(bars, offsets, strict=True)))
    sines = ca.vertcat(*(-ca.dot(d, a) for d, (a, _, _) in zip(bars, offsets, strict=True)))
    return Closure(rows, right_inverse, null, cosines, sines)


def singularity(geometry: Geometry) -> tuple[Expression, Expression]:
    """Return (A, B) of N . j = A cos(phi) + B sin(phi), zero where the pose is singular (type II).

    det J is a constant times it. For 3T the Jacobian is constant: (det D, 0).
    """
    c = closure(geometry)
    if c.null is None:
        return _det3(c.rows), ca.SX(0)
    return ca.dot(c.null, c.cosines), ca.dot(c.null, c.sines)


def regularity(geometry: Geometry, pose: Expression) -> Expression:
    """Return N . j over its largest value: 1 at best, 0 at a type-II singularity.

    It is the cosine of the angle from the orientation where the sliders hold the platform best. For
    3T it is det D over the product of its rows' lengths.
    """
    a, b = singularity(geometry)
    if not geometry.turns:
        rows = ca.vertsplit(closure(geometry).rows)
        return a / (ca.norm_2(rows[0]) * ca.norm_2(rows[1]) * ca.norm_2(rows[2]))
    return (a * ca.cos(pose[3]) + b * ca.sin(pose[3])) / ca.sqrt(a * a + b * b)


@dataclass(frozen=True)
class Load:
    """A wrench on the platform: a force at P, and a moment about k split by how it turns.

    The moment is `cosine` (unit cos phi) + `sine` (unit sin phi) + `moment`: a force f on a
    platform point has the moment (b . f) cos(phi) - (a . f) sin(phi), and only the sums over the
    legs of the two products meet the angle. Rows have K columns, as the parameters have.
    """

    force: Expression
    """(3, K)."""
    cosine: Expression
    sine: Expression
    moment: Expression

    @classmethod
    def of(cls, w: Expression) -> Load:
        """Return the load of a wrench (m, K): a force, and for 3T1R a moment."""
        none = ca.SX(1, w.shape[1])
        return cls(w[:3, :], none, none, w[3, :] if w.shape[0] > 3 else none)

    @classmethod
    def at_point(cls, geometry: Geometry, i: int, force: Expression) -> Load:
        """Return the load of a force (3, K) on the platform point of leg i."""
        none = ca.SX(1, force.shape[1])
        if not geometry.turns:
            return cls(force, none, none, none)
        a, b, _ = offset_in_units(geometry, i)
        return cls(force, _product(b, force), -_product(a, force), none)

    def __add__(self, other: Load) -> Load:
        return Load(
            self.force + other.force,
            self.cosine + other.cosine,
            self.sine + other.sine,
            self.moment + other.moment,
        )

    def wrench(self, turn: Turn | None) -> Expression:
        """Return the load as one matrix (m, K)."""
        if turn is None:
            return self.force
        return ca.vertcat(
            self.force, turn.cosine * self.cosine + turn.sine * self.sine + self.moment
        )


def _product(vector: Expression, force: Expression) -> Expression:
    """Return vector . force (1, K), the signs of a constant vector taken out of the products."""
    return sum(times(v, f) for v, f in zip(ca.vertsplit(vector), ca.vertsplit(force), strict=True))


def actuator_forces(geometry: Geometry, load: Load, turn: Turn | None) -> Expression:
    """Return F (n, K) with J^T F = w, the load, in closed form."""
    c = closure(geometry)
    forces = ca.vertsplit(load.force)
    if turn is None:
        return ca.vertcat(*(weighted_sum(row.T, forces) for row in ca.vertsplit(c.right_inverse)))
    inverse = c.right_inverse if not c.rows.is_constant() else _sparse_inverse(c.rows)
    particular = ca.vertcat(*(weighted_sum(row.T, forces) for row in ca.vertsplit(inverse)))
    cosines, sines = c.cosines / turn.unit, c.sines / turn.unit
    cosine = load.cosine - weighted_sum(ca.mtimes(cosines.T, inverse).T, forces)
    sine = load.sine - weighted_sum(ca.mtimes(sines.T, inverse).T, forces)
    a, b = ca.dot(c.null, cosines), ca.dot(c.null, sines)
    unbalanced = turn.cosine * cosine + turn.sine * sine + load.moment
    rest = unbalanced / (times(a, turn.cosine) + times(b, turn.sine))
    return particular + ca.vertcat(*(times(null, rest) for null in ca.vertsplit(c.null)))


def _sparse_inverse(rows: Expression) -> Expression:
    """Return a P with D^T P = 1 that loads three legs only: those that hold a force best."""
    best = max(range(4), key=lambda i: abs(float(_det3(_without(rows, i)))))
    held = _without(rows, best)
    inverse = ca.vertsplit(_adjugate(held).T / _det3(held))
    inverse.insert(best, ca.SX.zeros(1, 3))
    return ca.vertcat(*inverse)


def platform_acceleration(
    geometry: Geometry, b: Expression, cosine: Expression, sine: Expression
) -> Expression:
    """Return x (m, K) with J x = b, for the columns of b (n, K): the transposed problem."""
    c = closure(geometry)
    if c.null is None:
        return ca.mtimes(c.right_inverse.T, b)
    a0, b0 = singularity(geometry)
    angle = ca.mtimes(c.null.T, b) / (times(a0, cosine) + times(b0, sine))
    column = c.cosines * cosine + c.sines * sine
    return ca.vertcat(ca.mtimes(c.right_inverse.T, b - ca.mtimes(column, angle)), angle)


def _without(rows: Expression, i: int) -> Expression:
    return ca.vertcat(*(rows[j, :] for j in range(rows.shape[0]) if j != i))


def _det3(m: Expression) -> Expression:
    return ca.dot(m[0, :].T, ca.cross(m[1, :].T, m[2, :].T))


def _adjugate(m: Expression) -> Expression:
    """Return the adjugate of a 3x3 matrix: its columns are the cross products of its rows."""
    a, b, c = m[0, :].T, m[1, :].T, m[2, :].T
    return ca.horzcat(ca.cross(b, c), ca.cross(c, a), ca.cross(a, b))
