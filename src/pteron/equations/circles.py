"""Lemma 1: two links that close a triangle are the intersection of two circles."""

from __future__ import annotations

import casadi as ca

from pteron.equations.geometry import Expression, LegGeometry


def squared_reach(leg: LegGeometry, u: Expression) -> Expression:
    """Return Delta, the product under the radical of Eqs. (1) and (2): below 0 out of reach.

    The paper's four factors pair into ((lu + ll)^2 - n^2) (n^2 - (lu - ll)^2): n^2 is enough.
    """
    n2 = ca.dot(u, u)
    longest, shortest = leg.lu + leg.ll, leg.lu - leg.ll
    return (longest * longest - n2) * (n2 - shortest * shortest)


def quarter_turn(v: Expression) -> Expression:
    """Return d x v for a vector v of the leg's plane, or for the columns of a matrix (2, K)."""
    return ca.vertcat(-v[1, :], v[0, :])


def link_vectors(leg: LegGeometry, u: Expression) -> tuple[Expression, Expression, Expression]:
    """Return l_u, l_l (Eqs. 1 and 2, or 6 and 7) and 1/D with D = (l_u x l_l) . d.

    All in the leg's plane. D = -sigma sqrt(Delta) / 2: twice the area of the links' triangle.
    """
    n2 = ca.dot(u, u)
    root = ca.sqrt(squared_reach(leg, u))
    share = 0.5 + (0.5 * (leg.lu * leg.lu - leg.ll * leg.ll)) / n2
    offset = (0.5 * leg.sigma) * (root / n2)
    l_u = share * u + offset * quarter_turn(u)
    return l_u, u - l_u, (-2 * leg.sigma) / root


def reach_margin(leg: LegGeometry, u: Expression) -> Expression:
    """Return by how many metres |u| lies within what the links reach; below 0 it lies outside."""
    n = ca.sqrt(ca.dot(u, u))
    return ca.fmin(leg.lu + leg.ll - n, n - ca.fabs(leg.lu - leg.ll))
