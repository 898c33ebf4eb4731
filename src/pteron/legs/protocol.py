"""Breaches of the protocol of `legs.leg`, for which the constructor of a machine raises."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.bodies.motion import Expression, PointMotion, RotationMotion, Turn
from pteron.bodies.vectors import Vector
from pteron.legs.kind import LegKind
from pteron.legs.leg import LegMotion
from pteron.tolerances import ROUNDING

_TRIAL_POINTS = 200
"""Number of random platform points tried; the first in reach is used."""


def breaches(leg: LegKind, axes: Sequence[Vector]) -> tuple[str, ...]:
    """Return how a leg breaches the protocol of legs, one line each; () where it conforms.

    `axes` are the axes, perpendicular to each other, about which the platform turns relative to the
    leg.
    """
    if not leg.size > 0.0 and not leg.follows_angle:
        return (
            f"a {leg.type} leg has no size, {leg.size:g} m, to measure its reach by: give its kind "
            'a quantity of role "length", or a `size`',
        )
    return _chain_breaches(leg, tuple(axes)) if (type(leg), len(axes)) not in _SOUND else ()


_SOUND: set[tuple[type[LegKind], int]] = set()
"""Kinds of legs whose chains conform, with the platform's number of axes: a cache, since a design's
search makes thousands of machines and a chain does not depend on a leg's numbers."""


@lru_cache(maxsize=64)
def _chain_breaches(leg: LegKind, axes: tuple[Vector, ...]) -> tuple[str, ...]:
    """Return faults of a leg's bodies and driven joint, one line each; () if none in reach."""
    motion = _motion(leg, axes)
    if motion is None:
        return ()  # nowhere in reach, which is reported where a pose is used
    chain_breaches = (*_body_breaches(leg, motion), *_driven_joint_breaches(leg, motion))
    if not chain_breaches:
        _SOUND.add((type(leg), len(axes)))
    return chain_breaches


def point_in_reach(leg: LegKind, seed: int = 0) -> NDArray[np.float64] | None:
    """Return a random point (3,), m, in the reach of a leg; None if no trial succeeds."""
    equations, bound = leg.equations(), leg.reach_bound
    center, radius = (leg.guide_point, 1.0) if bound is None else (bound.point, bound.radius)
    rng = np.random.default_rng(seed)
    for point in center + radius * rng.uniform(-1.0, 1.0, (_TRIAL_POINTS, 3)):
        if _numbers(equations.reach(ca.SX(ca.DM(point))).discriminant) > 0.0:
            return np.asarray(point)
    return None


def _motion(leg: LegKind, axes: Sequence[Vector]) -> LegMotion | None:
    """Return the leg's motion at rest at a random point in its reach; None without such a point."""
    point, zero = point_in_reach(leg), ca.SX(3, 1)
    if point is None:
        return None
    turns = tuple(Turn(ca.SX(list(axis)), ca.SX(0), ca.SX(0)) for axis in axes)
    at_rest = PointMotion(ca.SX(ca.DM(point)), zero, zero)
    return leg.equations().motion(at_rest, RotationMotion(turns, ca.SX(0.3)))


def _body_breaches(leg: LegKind, motion: LegMotion) -> Iterator[str]:
    """Yield the faults of leg bodies that are not carried by exactly one joint of the chain."""
    named = Counter(joint.body for joint in motion.chain if joint.body)
    for letter in sorted({*leg.bodies, *motion.bodies, *named}):
        name = f'body "{letter}"' + (f" ({leg.names[letter]})" if letter in leg.names else "")
        if letter not in motion.bodies or letter not in leg.bodies:
            where = "its keys" if letter not in leg.bodies else "`LegMotion.bodies`"
            yield f"the {name} of a {leg.type} leg is not among {where}; name it there too"
        elif named[letter] != 1:
            yield (
                f"the {name} of a {leg.type} leg is carried by {named[letter]} joints of its "
                "chain, and reactions count it as often; name it in the `body` of one"
            )


def _driven_joint_breaches(leg: LegKind, motion: LegMotion) -> Iterator[str]:
    """Yield the faults of the driven joint of a leg's chain."""
    row = _numbers(motion.row / motion.divisor)
    size = np.abs(row).max()
    if not size > 0.0:
        yield f"a {leg.type} leg moves nothing: no motion of its platform point moves its joint"
        return
    driven = [joint for joint in motion.chain if joint.driven]
    if len(driven) != 1:
        yield (
            f"{len(driven)} joints of a {leg.type} leg's chain are marked as driven; mark the one "
            "whose motion is the leg's coordinate (`Joint.driven`)"
        )
        return
    if not np.abs(_numbers(driven[0].row) - row).max() <= ROUNDING * size:
        yield (
            f"the driven joint of a {leg.type} leg does not move as its coordinate does: "
            "`Joint.row` is not `LegMotion.row` over its divisor"
        )


def _numbers(row: Expression) -> NDArray[np.float64]:
    """Return the values of a constant row (1, n) as floats (n,)."""
    return np.asarray(ca.DM(ca.evalf(ca.densify(row)))).ravel()
