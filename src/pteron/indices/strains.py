"""Strains of actuators and links: the rows by which internal forces deform a machine's legs.

A row is a force or moment at a section over the root of the rigidity there, so that the elastic
energy of internal forces w is half the square of all rows, and displacements follow by virtual
work. `compliance` and `strength` use them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pteron.indices.elasticity import Elasticity, Section
from pteron.indices.internal_forces import (
    BalancedLoads,
    Equations,
    force_units,
    platform_wrench,
    wrench_shift,
)
from pteron.kernels import Array
from pteron.manipulator import Manipulator

_GAUSS = 0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0)
"""Gauss points along a beam: products of forces are cubic along it at most, so that two are
exact."""

FREE = 1e-12
"""Compliance to a self-stress, as a share of the largest, below which it counts as none."""


class Strain(NamedTuple):
    """Strains at sections of one link: `parts` times the wrench that the section transmits."""

    leg: int
    link: int
    """0: the upper link, 1: the lower."""
    parts: Array
    """(B, r, 6): of force and moment."""
    points: Array
    """(B, r, 3): the sections, about which the moments are."""


class Strains(NamedTuple):
    """All strains of a machine's legs at B poses, and the rows that give them from the forces."""

    links: list[Strain]
    rows: Array
    """(B, N, 6 n): first those of the n actuators, then those of `links` in their order."""
    actuators: Array
    """(n,): the stiffness of each actuator, N/m or N m/rad."""


def strains_of(
    elasticity: Elasticity, robot: Manipulator, balance: Equations, links: list[Array]
) -> Strains:
    """Return the strains of all elastic actuators and links at the poses of `balance`."""
    springs, sections = elasticity.leg_springs(robot)
    starts, ways, axes, couples = links
    batch, n = couples.shape[:2]
    strains = []
    for i in range(n):
        rods = bool(np.isfinite(couples[:, i]).all())
        for k, section in enumerate(sections[i]):
            if section is None or np.isnan(ways[:, i, k]).any():
                continue
            start, way = starts[:, i, k], ways[:, i, k]
            if rods and k == 1:
                parts = _rod_strains(section, start, way, couples[:, i], elasticity.rod_distance)
            else:
                parts = _beam_strains(section, start, way, axes[:, i, k])
            strains.append(Strain(i, k, *parts))
    actuators = np.array(springs)
    rows = [balance.driven_rows / np.sqrt(actuators)[:, None]]
    for strain in strains:
        every = np.zeros((batch, strain.parts.shape[1], 6 * n))
        arms = balance.ends[:, strain.leg, None] - strain.points
        columns = slice(6 * strain.leg, 6 * strain.leg + 6)
        every[..., columns] = np.einsum("bri,brij->brj", strain.parts, wrench_shift(arms))
        rows.append(every)
    return Strains(strains, np.concatenate(rows, axis=1), actuators)


def energy_matrix(strains: Strains) -> Array:
    """Return W (B, 6 n, 6 n): internal forces w of the legs have the elastic energy w^T W w / 2."""
    return np.asarray(strains.rows.mT @ strains.rows)


def _rod_strains(
    section: Section, start: Array, way: Array, couple: Array, distance: float | None
) -> tuple[Array, Array]:
    """Return parts (B, r, 6) and points (B, r, 3) of a rod, or of a pair of rods with a couple."""
    length = np.linalg.norm(way, axis=-1)
    n = way / length[:, None]
    parts = np.zeros((len(way), 2, 6))
    parts[:, 0, :3] = n * np.sqrt(length / section.axial)[:, None]
    if distance is not None and couple.any():
        # The couple is |bar x n| times their distance, times half the difference of their forces.
        size = np.linalg.norm(couple, axis=-1)
        unit = couple / size[:, None]
        spacing = distance * size / length
        parts[:, 1, 3:] = unit * (2.0 * np.sqrt(length / section.axial) / spacing)[:, None]
    return parts, np.stack([start + 0.5 * way, start + way], axis=1)


def link_axes(way: Array, axis: Array) -> tuple[Array, Array, Array]:
    """Return unit vectors (..., 3) along links, across them in their planes, and normal to these.

    A link bends in its leg's plane about `axis`.
    """
    x = way / np.linalg.norm(way, axis=-1, keepdims=True)
    z = axis - (axis * x).sum(axis=-1, keepdims=True) * x
    size = np.linalg.norm(z, axis=-1, keepdims=True)
    # A shaft's axis is along it: it has no plane, and any direction will do.
    with np.errstate(invalid="ignore"):
        other = np.cross(x, np.eye(3)[np.nan_to_num(np.abs(x)).argmin(axis=-1)])
    z = np.where(size > 1e-6, z, other)
    z = z / np.linalg.norm(z, axis=-1, keepdims=True)
    return x, np.cross(z, x), z


def _beam_strains(section: Section, start: Array, way: Array, axis: Array) -> tuple[Array, Array]:
    """Return parts (B, 8, 6) and points (B, 8, 3) of a beam at its two Gauss points."""
    length = np.linalg.norm(way, axis=-1)
    x, y, z = link_axes(way, axis)
    parts = np.zeros((len(way), 4, 6))
    for row, (v, columns, rigidity) in enumerate(
        (
            (x, slice(3), section.axial),
            (x, slice(3, 6), section.torsion),
            (y, slice(3, 6), section.sideways),
            (z, slice(3, 6), section.bending),
        )
    ):
        parts[:, row, columns] = v * np.sqrt(0.5 * length / rigidity)[:, None]
    points = [np.repeat((start + share * way)[:, None], 4, axis=1) for share in _GAUSS]
    return np.concatenate([parts, parts], axis=1), np.concatenate(points, axis=1)


def least_energy_forces(robot: Manipulator, balanced: BalancedLoads, energy: Array) -> Array:
    """Return the leg forces (B, 6 n, K) of balanced loads, their self-stress of least energy."""
    forces, stresses = balanced.forces, balanced.stresses
    if not stresses.shape[-1]:
        return forces
    energies, directions = np.linalg.eigh(stresses.mT @ energy @ stresses)
    energy_scale = (force_units(robot) ** 2 * np.diagonal(energy, axis1=-2, axis2=-1)).sum(axis=-1)
    resisting = energies > FREE * energy_scale[:, None]
    energy_inverse = directions @ (directions / np.where(resisting, energies, np.inf)[:, None]).mT
    return np.asarray(forces - stresses @ energy_inverse @ (stresses.mT @ energy @ forces))


def unit_loads(robot: Manipulator, balance: Equations, arm: Array) -> tuple[Array, Array]:
    """Return unit loads at a point as wrenches about P (B, 6, K) and pose forces (B, m, K)."""
    batch, m = len(arm), robot.freedom
    if robot.platform.wrench_in_base_axes:
        load = wrench_shift(arm)
        return load, balance.loads @ load
    wrench = np.broadcast_to(np.eye(m), (batch, m, m)).copy()  # a row for each unit load
    force = platform_wrench(robot, wrench, np.zeros(3))[..., :3]
    moment = np.cross(arm[:, None], force)
    if robot.platform.angles:
        axis = np.array(robot.platform.axis)
        wrench[..., robot.platform.angular] += moment @ axis[:, None]
        # `platform_wrench` has the part about the axis from the wrench.
        moment = moment - (moment @ axis)[..., None] * axis
    return platform_wrench(robot, wrench, moment).mT, wrench.mT
