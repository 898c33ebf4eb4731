"""A test that a kind of platform keeps the protocol of `platforms.motion`: run `faults` on one.

It compares derivatives, and power with energy, along one random motion of the pose.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from pteron.bodies.agreement import TIME, mismatched_names, rate_of
from pteron.bodies.motion import Expression
from pteron.platforms import Platform
from pteron.platforms.coordinates import COORDINATES
from pteron.platforms.motion import PlatformEquations, PlatformMotion

_POINTS = 3
"""Number of platform points, drawn at random; frame, planes and parameters are the given ones."""

_SMALL = 0.3
"""Size of the motion, SI units: a tripod does not tilt by much."""


def faults(platform: Platform, seed: int = 0) -> tuple[str, ...]:
    """Return how a platform breaches the protocol of platforms, one line each; () if not.

    Examples
    --------
    >>> import pteron
    >>> from pteron.platforms.conformance import faults
    >>> faults(pteron.load("quadrupteron").platform)
    ()
    """
    kind = platform.kind
    unknown = [name for name in kind.coordinates if name not in COORDINATES]
    if unknown:
        return (f"coordinates: {', '.join(unknown)}: none of `platforms.coordinates`",)
    rng = np.random.default_rng(seed)

    def drawn(*shape: int) -> Expression:
        """Return a CasADi matrix of this shape of normally distributed random numbers."""
        return ca.SX(ca.DM(rng.normal(size=shape)))

    def points(flat: bool) -> list[Expression]:
        """Return random points (3, 1), with z = 0 if `flat`."""
        high = 0.0 if flat else 1.0  # what slides moves across the axis
        return [ca.SX(ca.DM(rng.normal(size=3) * (1.0, 1.0, high))) for _ in range(_POINTS)]

    frame = [ca.SX(ca.DM(list(axis))) for axis in platform.frame]
    held_points = [ca.SX(ca.DM(list(plane.platform_point))) for plane in platform.planes]
    platform_points = held_points or points(platform.slides)
    equations = kind(frame, platform_points, points(False), platform.expressions())
    x, dx, ddx = (_SMALL * drawn(len(kind.coordinates)) for _ in range(3))
    rates = dx + ddx * TIME
    motion = equations.motion(x + dx * TIME + ddx * TIME**2 / 2, rates, ddx)
    inertia = ca.vertsplit(ca.SX(ca.DM(rng.uniform(0.5, 1.5, len(kind.kinds)))))
    quasi = motion.pose_rows(ca.SX.eye(len(kind.coordinates))) @ rates
    return (
        *_motion_faults(motion, quasi),
        *_force_faults(equations, motion, quasi, drawn(3), inertia),
    )


def _motion_faults(motion: PlatformMotion, rates: Expression) -> Iterator[str]:
    """Yield the faults of a platform's axes, points and matrices against exact derivatives."""
    omega = sum((turn.rate * turn.axis for turn in motion.rotation.turns), ca.SX(3, 1))
    turned = ca.mtimes(ca.skew(omega), motion.axes)
    pairs = {"axes: do not turn with the angular velocity": (rate_of(motion.axes), turned)}
    for k, turn in enumerate(motion.rotation.turns, start=1):
        pairs[f"turn {k}: acceleration is not the derivative of rate"] = (
            turn.acceleration,
            rate_of(turn.rate),
        )
    for k, (point, matrix) in enumerate(zip(motion.points, motion.matrices, strict=True), start=1):
        pairs |= {
            f"point {k}: velocity is not the derivative of position": (
                point.velocity,
                rate_of(point.position),
            ),
            f"point {k}: acceleration is not the derivative of velocity": (
                point.acceleration,
                rate_of(point.velocity),
            ),
            f"matrix {k}: its product with x' is not (c', omega)": (
                ca.mtimes(matrix, rates),
                ca.vertcat(point.velocity, omega),
            ),
        }
    pairs["matrix: its product with x' is not (p', omega)"] = (
        ca.mtimes(motion.matrix, rates),
        ca.vertcat(rate_of(motion.body.position), omega),
    )
    yield from mismatched_names(pairs)


def _force_faults(
    equations: PlatformEquations,
    motion: PlatformMotion,
    rates: Expression,
    gravity: Expression,
    rows: list[Expression],
) -> Iterator[str]:
    """Yield the faults of a platform's forces and mass matrix against its energy."""
    inertia = equations.moments(rows)
    mass = equations.mass_matrix(motion, inertia)
    energy = 0.5 * ca.bilin(mass, rates, rates)
    energy -= ca.dot(gravity, equations.mass_moment(motion, inertia))
    needs = equations.needs(motion, gravity, inertia)
    masses = [ca.SX(k + 1.0) for k in range(len(motion.points))]
    extra_needs = (
        equations.needs(motion, gravity, equations.add_point_masses(inertia, masses)) - needs
    )
    pairs = zip(motion.points, motion.matrices, masses, strict=True)
    mass_forces = sum(ca.mtimes(a[:3, :].T, m * (c.acceleration - gravity)) for c, a, m in pairs)
    yield from mismatched_names(
        {
            "mass_matrix: not symmetric": (mass, mass.T),
            "needs: its power is not the rate of the energy": (
                ca.dot(needs, rates),
                rate_of(energy),
            ),
            "add_point_masses: not what masses on the points need": (extra_needs, mass_forces),
        }
    )
