"""Inertia of bodies in space for physics engines, completed from the model's fewer parameters.

A body that moves in a plane acts by its mass, its centre of mass in the plane and one moment of
inertia; a slider by its mass alone; a rod without a spin. What is added here acts on no motion that
the mechanism can make:

- a link's or the platform's other two moments about its centre are 0.6 and 0.7 of the one that
  acts, and its centre lies in the plane of its reference point;
- a rod's moment about itself is 1e-10 of the one across it: the universal joint that carries it
  in the tree spins it, and the model's rod has no inertia of spin;
- a slider's mass is a cube's at its joint;
- what the platform carries without a mass of its own, a hinged bar or a geared part, takes a share
  of the platform's mass, and the platform's own first moment and inertia lose what that share has.

A body that turns about any axis keeps its own tensor, but for a trace where that is singular.
"""

from __future__ import annotations

import numpy as np

from pteron.bodies.inertia import Inertia, SpatialInertia
from pteron.kernels import Array

_ACROSS = (0.6, 0.7, 1.0)
"""A plane body's moments about its x, y and z, over that about z."""

_SPIN = 1e-10
"""A rod's moment about itself, over that across it."""

_LEAST = 1e-10
"""Least moment about the centre, as a share of mass times the square of the body's size: engines
take no body whose whole mass is at its centre."""

_TINY = 2e-14
"""Least moment of inertia that engines accept, kg m^2."""

SHARE = 1e-10
"""Share of a body's mass and moments that a link between its joints has."""


def central_inertia(inertia: Inertia) -> tuple[float, Array, float]:
    """Return a body's mass, its centre of mass (2,) in body axes and the central moment."""
    by_kind = dict(zip(inertia.kinds, inertia.values, strict=True))
    mass = by_kind["m"]
    center = np.array([by_kind.get(kind, 0.0) for kind in ("mgx", "mgy")]) / mass
    return mass, center, by_kind.get("I", 0.0) - mass * float(center @ center)


def plane_moments(mass: float, moment: float, lever: float) -> Array:
    """Return the moments (3,) of a body that turns about its z; `lever` is its size, m."""
    return np.array(_ACROSS) * max(moment, _LEAST * mass * lever**2, _TINY / min(_ACROSS))


def rod_moments(mass: float, moment: float, lever: float) -> Array:
    """Return the moments (3,) of a rod along its x."""
    transverse = max(moment, _LEAST * mass * lever**2, _TINY)
    return np.array([max(_SPIN * transverse, _TINY), transverse, transverse])


def spatial_moments(inertia: SpatialInertia, lever: float) -> tuple[Array, Array]:
    """Return moments and products (3,) about the centre of a body that turns about any axis."""
    m, c = inertia.mass, np.array(inertia.center_of_mass)
    tensor = inertia.tensor - m * (c @ c * np.eye(3) - np.outer(c, c))
    least = max(_LEAST * m * lever**2, _TINY)
    tensor += max(least - float(np.linalg.eigvalsh(tensor)[0]), 0.0) * np.eye(3)
    return np.diag(tensor).copy(), tensor[[0, 0, 1], [1, 2, 2]]


def cube_moments(mass: float, side: float) -> Array:
    """Return the moments (3,) of a cube."""
    return np.full(3, max(mass * side**2 / 6.0, _TINY))


def massless_inertia(mass: float, moments: Array) -> tuple[float, Array]:
    """Return the mass and the moments (3,) of a link between the joints of a body.

    It has none; but an engine takes 1 kg where a file says nothing, or refuses it.
    """
    return SHARE * mass, np.full(3, max(SHARE * float(moments.max()), _TINY))


def shared_masses(
    mass: float, moment: Array, inertia: float, places: Array
) -> tuple[Array, float, Array, float]:
    """Return masses (K,) split off a planar body for parts at places (K, 2), and the remainder.

    The parts' masses and what is left, mass (kg), first moment (2,) (kg m) and moment of inertia
    (kg m^2), are together the body that was given.
    """
    share = 0.05
    central = inertia - float(moment @ moment) / mass
    squares = (places**2).sum(axis=1)
    for _ in range(40):
        taken = np.full(len(places), share * mass)
        remaining = mass - float(taken.sum())
        first_moment, turning = moment - taken @ places, inertia - float(taken @ squares)
        if (
            remaining > 0.5 * mass
            and turning - float(first_moment @ first_moment) / remaining >= 0.5 * central
        ):
            break
        share *= 0.5
    return taken, remaining, first_moment, turning
