"""Conformance test of a closure against `closures.closure`, on a machine that it serves."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pteron.bodies.agreement import mismatched_names
from pteron.bodies.motion import Expression
from pteron.closures import kind_for
from pteron.closures.closure import plain_rows
from pteron.legs.kind import LegKind
from pteron.platforms import Platform


def faults(
    legs: Sequence[LegKind], platform: Platform, pose: ArrayLike, seed: int = 0
) -> tuple[str, ...]:
    """Return the faults of the closure of legs and platform, one line each; () if none.

    Parameters
    ----------
    legs : sequence of LegKind
        As a manipulator has them.
    platform : Platform
        Their platform.
    pose : array, shape (m,)
        A pose that all legs reach, away from singularities.
    seed : int
        Seed of the random forces and rates that are tried.

    Raises
    ------
    ModelError
        If there are not as many legs as coordinates.

    Examples
    --------
    >>> import pteron
    >>> from pteron.closures.conformance import faults
    >>> robot = pteron.load("delta")
    >>> faults(robot.legs, robot.platform, [0.1, 0.0, -0.9])
    ()
    """
    equations = tuple(leg.equations() for leg in legs)
    points = [ca.SX(ca.DM(list(leg.platform_point))) for leg in legs]
    fixed = [ca.SX(ca.DM(list(leg.fixed_offset))) for leg in legs]
    frame = [ca.SX(ca.DM(list(axis))) for axis in platform.frame]
    platform_equations = platform.kind(frame, points, fixed)
    kind = kind_for([type(leg) for leg in equations], type(platform_equations))
    if kind is None:
        return ("no closure fits these legs under this platform",)
    closure = kind(equations, platform_equations)
    x = ca.SX(ca.DM(np.asarray(pose, dtype=float)))
    zero_rates = 0 * x
    motion = platform_equations.motion(x, zero_rates, zero_rates)
    leg_points = zip(equations, motion.points, fixed, strict=True)
    state = [leg.motion(c, motion.rotation_at(c, t0)) for leg, c, t0 in leg_points]
    joints = ca.vertcat(*(leg.coordinate for leg in state))
    divisors = ca.vertcat(*(leg.divisor for leg in state))
    jacobian = plain_rows(motion, state) / ca.repmat(divisors, 1, x.shape[0])
    rng = np.random.default_rng(seed)
    wrench, rates = (ca.SX(ca.DM(rng.normal(size=(n, 2)))) for n in jacobian.shape[::-1])
    pairs: dict[str, tuple[Expression, Expression]] = {
        "forces: J^T F is not the wrench": (
            ca.mtimes(jacobian.T, closure.forces(wrench, motion, state)),
            wrench,
        ),
        "rates: J x' is not the joints' rates": (
            ca.mtimes(jacobian, closure.rates(rates, motion, state)),
            rates,
        ),
    }
    if closure.closed_form:
        poses = closure.poses(joints)
        if poses.shape != (x.shape[0], closure.modes):
            return (f"poses: {poses.shape} for {x.shape[0]} coordinates, {closure.modes} modes",)
        columns = np.asarray(ca.DM(ca.evalf(poses)))
        nearest = np.nanargmin(np.abs(columns - np.asarray(ca.DM(x))).max(axis=0))
        pairs["poses: the pose is not among them"] = ca.SX(columns[:, int(nearest)]), x
    size = abs(float(ca.evalf(closure.measure(motion, state))))
    faulty = () if 0.0 < size <= 1.0 + 1e-9 else (f"measure: {size:g}, not in (0, 1]",)
    return (*mismatched_names(pairs), *faulty)
