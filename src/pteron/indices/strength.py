"""Loads on links and joints, and the tool's deflection, for several load cases at each pose."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pteron.dynamics import inverse_dynamics
from pteron.indices.elasticity import Elasticity, Material, Section
from pteron.indices.internal_forces import (
    Equations,
    balance_loads,
    wrench_shift,
)
from pteron.indices.sensitivities import tool_arm
from pteron.indices.strains import (
    Strain,
    Strains,
    energy_matrix,
    least_energy_forces,
    link_axes,
    strains_of,
    unit_loads,
)
from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import Manipulator

_SAME = 1e-9
"""Distance of two points, as a share of a link's length, below which they are one."""

AXIAL, TORSION, BENDING = 0, 3, slice(4, 6)
"""Components of `LinkLoads.sections`: axial force (tension above 0), moments."""


@dataclass(frozen=True)
class Tube:
    """What a link is made of: `count` parallel round tubes, or rods.

    Parameters
    ----------
    outer, inner : float
        Diameters, m; the inner one of a rod is 0.
    material : Material
        With its strength.
    count : int
        Number of parallel tubes.
    spacing : float
        Between the tubes of a pair, m.
    """

    outer: float
    inner: float
    material: Material
    count: int = 1
    spacing: float = math.inf

    @property
    def area(self) -> float:
        """Cross-sectional area of one tube, m^2."""
        return math.pi / 4.0 * (self.outer**2 - self.inner**2)

    @property
    def second_moment(self) -> float:
        """Second moment of area of one tube, m^4."""
        return math.pi / 64.0 * (self.outer**4 - self.inner**4)

    @property
    def section(self) -> Section:
        """The stiffnesses of all tubes together."""
        one = Section.tube(self.outer, 0.5 * (self.outer - self.inner), self.material)
        parts = (one.axial, one.bending, one.sideways, one.torsion)
        return Section(*(self.count * part for part in parts))

    def bending_frequency(self, length: float) -> float:
        """Return the first natural frequency, Hz, of one tube between two hinges `length` m apart.

        It is pi / (2 L^2) sqrt(E I / (rho A)).
        """
        rigidity = self.material.young * self.second_moment
        mass = self.material.density * self.area
        return 0.5 * math.pi / length**2 * math.sqrt(rigidity / mass)

    def buckling_load(self, length: float, effective: float = 1.0) -> float:
        """Return Euler's buckling load of one tube, N; 1 as `effective` length: between hinges."""
        rigidity = self.material.young * self.second_moment
        return math.pi**2 * rigidity / (effective * length) ** 2


class LinkLoads(NamedTuple):
    """Loads of K cases at B poses in the legs of a machine, and what gives way under them.

    NaN stands for links and joints that a leg has not.
    """

    sections: Array
    """(B, K, n, 2, 2, 6): of each leg's upper and lower link at its start and its end: axial force
    (tension above 0), shear in the leg's plane and across it, N; torsion, and the moments about
    the two other axes, N m."""
    couples: Array
    """(B, K, n): the couple of a pair of rods, N m; 0 elsewhere."""
    lengths: Array
    """(B, n, 2): of the links, m."""
    joints: Array
    """(B, K, n, j, 6): force and moment that each joint transmits, in base axes, N and N m."""
    points: Array
    """(B, n, j, 3): the joints, m."""
    actuators: Array
    """(B, K, n): forces of the actuators, N or N m."""
    tool_by_links: Array
    """(B, K, d): displacement of the tool under the case by the links' elasticity, m."""
    tool_by_actuators: Array
    """(B, K, n, d): the displacement by that of each actuator times its stiffness."""
    unit_links: Array
    """(B, c, c): compliance at P by the links, as `stiffness` defines it."""
    unit_actuators: Array
    """(B, n, c): actuator forces of unit loads at P: the compliance by the actuators is the sum of
    their products over their stiffness."""
    tool_links: Array
    """(B, d, d): compliance of the tool's position to forces on it, by the links, m/N."""
    tool_actuators: Array
    """(B, n, d): actuator forces of unit forces on the tool."""

    def tool_displacement(self, actuators: Array) -> Array:
        """Return the tool's displacement (B, K, d), m, with these actuator stiffnesses (n,)."""
        parts = self.tool_by_actuators / actuators[:, None]
        return np.asarray(self.tool_by_links + parts.sum(axis=-2))

    def compliance(self, actuators: Array) -> Array:
        """Return the compliance (B, c, c) at P with these actuator stiffnesses (n,)."""
        rows = self.unit_actuators / np.sqrt(actuators)[:, None]
        return np.asarray(self.unit_links + rows.mT @ rows)

    def tool_compliance(self, stiffnesses: Array) -> Array:
        """Return the tool's greatest compliance (O, B), m/N, for O stiffnesses of all drives."""
        drives = self.tool_actuators.mT @ self.tool_actuators
        every = self.tool_links + drives / stiffnesses[:, None, None, None]
        return np.asarray(np.linalg.eigvalsh(every)[..., -1])


def link_loads(
    robot: Manipulator,
    poses: Array,
    velocity: Array,
    acceleration: Array,
    force: Array,
    elasticity: Elasticity,
) -> LinkLoads:
    """Return the loads in all links and joints, for K cases at each of B poses.

    Velocity and acceleration are (B, K, m), the force on the tool (B, K, d), N. Gravity and
    inertia forces of the bodies are included; along a link they are spread evenly. Where statics
    does not determine the forces, the elastic energy decides, with the stiffnesses of
    `elasticity`. Poses must be in reach and regular.
    """
    cases = velocity.shape[1]

    def at(case: int) -> Equations:
        """Return the equilibrium equations of a load case at all poses."""
        state = poses, velocity[:, case], acceleration[:, case]
        return Equations(*evaluate_kernel(robot, "reactions", "nan", *state))

    per_case = [at(case) for case in range(cases)]
    balance = per_case[0]
    outputs: tuple[Array, ...] = evaluate_kernel(robot, "beams", "nan", poses)
    links = list(outputs)
    strains = strains_of(elasticity, robot, balance, links)
    arms = tool_arm(robot, poses)
    right = np.stack([equations.right for equations in per_case], axis=-1)
    presumed = np.stack([equations.presumed_right for equations in per_case], axis=-1)
    at_point, at_tool = (unit_loads(robot, balance, arm) for arm in (np.zeros_like(arms), arms))
    d = force.shape[-1]
    right[:, : robot.freedom] -= at_tool[1][..., :d] @ force.mT
    presumed[:, :6] -= (at_tool[0][..., :d] @ force.mT)[:, : presumed.shape[1]]
    energy = energy_matrix(strains)
    unit_right = np.zeros((*right.shape[:2], 2 * at_point[0].shape[-1]))
    unit_presumed = np.zeros((*presumed.shape[:2], unit_right.shape[-1]))
    loads, applied = (np.concatenate(pair, axis=-1) for pair in zip(at_point, at_tool, strict=True))
    unit_right[:, : robot.freedom] = -applied
    unit_presumed[:, :6] = -loads[:, : presumed.shape[1]]
    driven = np.stack([equations.driven for equations in per_case], axis=1)
    if robot.redundancy:  # the drives' forces are as they are shared
        pushed = (at_tool[1][..., :d] @ force.mT).mT
        wrench = np.linalg.solve(balance.loads[:, None], pushed[..., None])[..., 0]
        states = poses[:, None], velocity, acceleration, wrench
        shared = inverse_dynamics(robot, *states, on_failure="nan")
        rows = np.concatenate([balance.rows, balance.driven_rows], axis=1)
        held = balance._replace(rows=rows)
        held_right = np.concatenate([right, (shared - driven).mT], axis=1)
        of_cases = least_energy_forces(
            robot, balance_loads(robot, held, held_right, presumed), energy
        )
        right, presumed = right[..., :0], presumed[..., :0]
    balanced = balance_loads(
        robot,
        balance,
        np.concatenate([right, unit_right], axis=-1),
        np.concatenate([presumed, unit_presumed], axis=-1),
    )
    forces = least_energy_forces(robot, balanced, energy)
    split = right.shape[-1], right.shape[-1] + at_point[0].shape[-1]
    balanced_cases, of_point, of_tool = np.split(forces, split, axis=-1)
    of_cases = of_cases if robot.redundancy else balanced_cases
    passed = np.stack([equations.passed for equations in per_case], axis=1)
    joints = _joint_wrenches(balance, of_cases, passed)
    return _link_loads(robot, strains, balance, links, joints, of_cases, of_point, of_tool, driven)


def _link_loads(
    robot: Manipulator,
    strains: Strains,
    balance: Equations,
    links: list[Array],
    joints: Array,
    of_cases: Array,
    of_point: Array,
    of_tool: Array,
    driven: Array,
) -> LinkLoads:
    """Return `LinkLoads` from the leg forces (B, 6 n, K) of cases, and of unit loads."""
    starts, ways, axes, couples = links
    ends = [_transmitted(balance.points, joints, part) for part in (starts, starts + ways)]
    lengths = np.linalg.norm(ways, axis=-1)
    frame = np.stack(link_axes(ways, axes), axis=-2)[:, None]
    frame[..., 0, :] *= -1.0  # what the base's side exerts along the link compresses it
    local = [
        np.concatenate([_apply(frame, end[..., :3]), _apply(frame, end[..., 3:])], axis=-1)
        for end in ends
    ]
    unit = couples / np.maximum(np.linalg.norm(couples, axis=-1, keepdims=True), 1e-12)
    couple = np.einsum("bkni,bni->bkn", ends[1][:, :, :, 1, 3:], np.nan_to_num(unit))
    n = robot.joint_count
    actuators = (balance.driven_rows @ of_cases).mT + driven
    d = sum(name.startswith("f") for name in robot.platform.wrench_columns)
    of_tool = of_tool[..., :d]
    by_links = np.zeros((*actuators.shape[:2], d))
    row = n
    for strain in strains.links:
        count = strain.parts.shape[1]
        virtual = strains.rows[:, row : row + count] @ of_tool
        row += count
        real = _strain_of_cases(strain, starts, ways, ends)
        by_links += np.einsum("brd,bkr->bkd", virtual, real)
    virtual = balance.driven_rows @ of_tool
    by_actuators = np.einsum("bnd,bkn->bknd", virtual, actuators)
    unit_rows, tool_rows = (strains.rows[:, n:] @ of_unit for of_unit in (of_point, of_tool))
    return LinkLoads(
        np.stack(local, axis=-2),
        np.nan_to_num(couple),
        lengths,
        joints,
        balance.points,
        actuators,
        by_links,
        by_actuators,
        unit_rows.mT @ unit_rows,
        balance.driven_rows @ of_point,
        tool_rows.mT @ tool_rows,
        virtual,
    )


def _apply(frame: Array, vectors: Array) -> Array:
    """Return components (..., 3) of vectors (..., 3) along the rows of frames (..., 3, 3)."""
    return np.asarray((frame @ vectors[..., None])[..., 0])


def _joint_wrenches(balance: Equations, forces: Array, passed: Array) -> Array:
    """Return what each joint transmits (B, K, n, j, 6) with leg forces (B, 6 n, K)."""
    batch, n = balance.points.shape[:2]
    shifts = wrench_shift(balance.ends[:, :, None] - balance.points)
    legs = forces.reshape(batch, n, 6, -1)
    return np.asarray(np.einsum("bnjxy,bnyk->bknjx", shifts, legs) + passed)


def _transmitted(points: Array, joints: Array, ends: Array) -> Array:
    """Return the wrench (B, K, n, 2, 6) of the outermost joint at the links' ends (B, n, 2, 3)."""
    gaps = np.linalg.norm(points[:, :, None] - ends[..., None, :], axis=-1)
    gaps = np.nan_to_num(gaps, nan=np.inf)
    near = gaps <= gaps.min(axis=-1, keepdims=True) + _SAME
    last = near.shape[-1] - 1 - near[..., ::-1].argmax(axis=-1)
    batch, n = np.indices(last.shape[:2])
    chosen = np.stack([joints[batch, :, n, last[..., k]] for k in range(2)], axis=-2)
    return np.moveaxis(chosen, 2, 1)


def _strain_of_cases(strain: Strain, starts: Array, ways: Array, ends: list[Array]) -> Array:
    """Return the strains (B, K, r) of cases at a link's sections, own weight spread along it."""
    leg, link = strain.leg, strain.link
    start, way = starts[:, leg, link], ways[:, leg, link]
    first, last = (end[:, :, leg, link] for end in ends)
    # Shares of the link beyond each section, and the wrench there about it.
    to_end = (start + way)[:, None] - strain.points
    share = np.linalg.norm(to_end, axis=-1) / np.linalg.norm(way, axis=-1, keepdims=True)
    spread = share[:, None, :, None] * (first[..., :3] - last[..., :3])[:, :, None]
    force = last[:, :, None, :3] + spread
    arms = to_end[:, None]
    moment = (
        last[:, :, None, 3:] + np.cross(arms, last[:, :, None, :3]) + np.cross(0.5 * arms, spread)
    )
    wrenches = np.concatenate([force, moment], axis=-1)
    return np.asarray(np.einsum("bri,bkri->bkr", strain.parts, wrenches))
