"""What the links and joints of a design bear: stress, buckling, frequencies, sag, joint loads.

Loads are those at rest with the payload, of the required accelerations and speeds in any direction,
and of the process force: bounded from above over all directions at each pose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from pteron.design.kinds import slides
from pteron.design.requirement_tables import LimitsTable, LinksTable
from pteron.indices.compliance import natural_frequencies
from pteron.indices.elasticity import Elasticity
from pteron.indices.strength import AXIAL, BENDING, TORSION, LinkLoads, Tube, link_loads
from pteron.kernels import Array
from pteron.legs import LegKind
from pteron.manipulator import Manipulator
from pteron.parts.joints import JointPart

_TYPICAL = 1e5
"""Stiffness of drives, N/m or N m/rad, with which self-stresses are shared among the legs."""

_TOGETHER = 1e-6
"""Distance, m, within which joints are one universal or ball joint."""

_KINDS = {1: "revolute", 2: "universal"}
"""Kind of a joint by its number of axes; "ball" of more."""

HELD_AT_END = 2.0
"""Effective length for buckling, over the length, of a link that is held at one end."""


@dataclass(frozen=True)
class Demand:
    """What motions and forces a structure must bear, at every pose and in every direction.

    Parameters
    ----------
    speed, acceleration : float
        Of P, m/s and m/s^2.
    turning : array, shape (a,)
        Acceleration of each angle of the pose, rad/s^2.
    force : float
        On the tool in any direction, N.
    """

    speed: float
    acceleration: float
    turning: Array
    force: float


class Joint(NamedTuple):
    """A joint of a leg, of one or several axes at one point, and the load on one of its parts."""

    leg: int
    """Index from 0."""
    link: str
    """Key of the link whose outer end it is; "base" of the first one."""
    kind: str
    """One of the kinds of parts: ball, universal, revolute or guide."""
    parts: int
    """Number of equal parts side by side."""
    force: Array
    """(B,): N on each part."""
    moment: Array
    """(B,): N m."""


class Structure:
    """The loads on a machine's structure at poses (B, m), bounded over all directions."""

    def __init__(
        self, robot: Manipulator, poses: Array, demand: Demand, tubes: Mapping[str, Tube]
    ) -> None:
        self.robot, self.poses, self.tubes = robot, poses, tubes
        self._cases = _Cases(robot, demand)
        sections = {key: tube.section for key, tube in tubes.items()}
        spacing = tubes["lower"].spacing
        elastic = Elasticity(
            _TYPICAL,
            sections.get("upper"),
            sections["lower"],
            spacing if np.isfinite(spacing) else None,
        )
        self.loads: LinkLoads = link_loads(robot, poses, *self._cases.states(len(poses)), elastic)

    @cached_property
    def _tubes(self) -> tuple[Tube, Tube]:
        """The tubes of upper and lower links; a leg without upper links has them alike."""
        return self.tubes.get("upper", self.tubes["lower"]), self.tubes["lower"]

    @cached_property
    def _section_bounds(self) -> tuple[Array, Array]:
        """Middle and spread (B, n, 2, 2, 6) of the section forces over all directions."""
        return self._cases.bounds(self.loads.sections)

    @cached_property
    def _pair_force(self) -> Array:
        """Force (B, n), N, by which the couple of a pair of rods loads each of them."""
        middle, spread = self._cases.bounds(self.loads.couples)
        return np.asarray((np.abs(middle) + spread) / self._tubes[1].spacing)

    @cached_property
    def stress_share(self) -> Array:
        """Greatest stress (B,) in any link as a share of its material's strength.

        Bending between the ends by the link's own mass is that of a beam on two hinges.
        """
        middle, spread = self._section_bounds
        most = np.abs(middle) + spread
        across = self.loads.sections[..., 0, 1:3] - self.loads.sections[..., 1, 1:3]
        bending = np.linalg.norm(most[..., BENDING], axis=-1).max(axis=-1)
        own = np.linalg.norm(
            np.sum([np.abs(part) for part in self._cases.bounds(across)], axis=0), axis=-1
        )
        bending = bending + own * self.loads.lengths / 8.0
        shares = []
        for k, tube in enumerate(self._tubes):
            axial = most[:, :, k, :, AXIAL].max(axis=-1) / tube.count
            axial = axial + (self._pair_force if k else 0.0)
            modulus = tube.second_moment / (0.5 * tube.outer)
            normal = axial / tube.area + bending[:, :, k] / (tube.count * modulus)
            shear = most[:, :, k, :, TORSION].max(axis=-1) / (2.0 * tube.count * modulus)
            shares.append(np.sqrt(normal**2 + 3.0 * shear**2) / tube.material.strength)
        return np.asarray(np.nanmax(np.stack(shares, axis=-1), axis=(1, 2)))

    @cached_property
    def buckling_factor(self) -> Array:
        """Least ratio (B,) of Euler's buckling load to the compression of a link."""
        middle, spread = self._section_bounds
        factors = []
        for k, tube in enumerate(self._tubes):
            pressed = (spread - middle)[:, :, k, :, AXIAL].max(axis=-1) / tube.count
            pressed = pressed + (self._pair_force if k else 0.0)
            effective = 1.0 if k else HELD_AT_END
            lengths = effective * self.loads.lengths[:, :, k]
            limit = tube.buckling_load(1.0) / lengths**2
            factors.append(limit / np.maximum(pressed, 1e-9))
        return np.asarray(np.nanmin(np.stack(factors, axis=-1), axis=(1, 2)))

    @cached_property
    def link_frequency(self) -> Array:
        """Least bending frequency (B,), Hz, of a link between its joints."""
        rates = [
            tube.bending_frequency(1.0) / self.loads.lengths[:, :, k] ** 2
            for k, tube in enumerate(self._tubes)
        ]
        return np.asarray(np.nanmin(np.stack(rates, axis=-1), axis=(1, 2)))

    def frequency(self, actuators: Array) -> Array:
        """Return the first natural frequency (B,), Hz, with these actuator stiffnesses (n,)."""
        machine = natural_frequencies(self.robot, self.poses, self.loads.compliance(actuators))
        return np.minimum(machine[:, 0], self.link_frequency)

    def sag(self, actuators: Array) -> Array:
        """Return the tool's displacement (B,), m, at rest by all weights."""
        return np.asarray(np.linalg.norm(self.loads.tool_displacement(actuators)[:, 0], axis=-1))

    def sags(self, stiffnesses: Array) -> Array:
        """Return the greatest sag (O,), m, at any pose for each of O stiffnesses of all drives."""
        drives = self.loads.tool_by_actuators[:, 0].sum(axis=1)
        fixed = self.loads.tool_by_links[:, 0]
        by_stiffness = fixed + drives / stiffnesses[:, None, None]
        return np.asarray(np.linalg.norm(by_stiffness, axis=-1).max(axis=1))

    @cached_property
    def holding(self) -> Array:
        """Greatest actuator force (B, n) at rest, N or N m, with the process force."""
        middle, spread = self._cases.at_rest(self.loads.actuators)
        return np.asarray(np.abs(middle) + spread)

    @cached_property
    def joints(self) -> list[list[Joint]]:
        """The joints of each leg that are not a drive's own, with their loads at the B poses."""
        middle, spread = self._cases.bounds(self.loads.joints)
        most = np.abs(middle) + spread
        force, moment = (np.linalg.norm(most[..., p], axis=-1) for p in (slice(3), slice(3, 6)))
        legs = []
        for i, leg in enumerate(self.robot.legs):
            links = iter(["base", *(key for key, *_ in leg.extents.values())])
            found = []
            for first, kind in _groups(self.loads.points[0, i], leg, self.robot):
                link = "base" if kind == "guide" else next(links, "platform")
                if kind == "driven":
                    continue
                count, forces, moments = 1, force[:, i, first], moment[:, i, first]
                if kind == "ball":
                    count, moments = getattr(leg, "rods", 1), 0.0 * moments
                    forces = forces / count + (self._pair_force[:, i] if count > 1 else 0.0)
                found.append(Joint(i, link, kind, count, forces, moments))
            legs.append(found)
        return legs

    @cached_property
    def actuators(self) -> Array:
        """Greatest actuator force (B, n), rotors apart, of all motions and forces, N or N m."""
        middle, spread = self._cases.bounds(self.loads.actuators)
        return np.asarray(np.abs(middle) + spread)

    @cached_property
    def process(self) -> Array:
        """Greatest part (B, n) of the actuator forces that the process force causes, N or N m."""
        return self._cases.at_rest(self.loads.actuators)[1]

    @cached_property
    def slenderness(self) -> tuple[float, float]:
        """Least and greatest length of a link over its diameter."""
        ratios = self.loads.lengths / [tube.outer for tube in self._tubes]
        return float(np.nanmin(ratios)), float(np.nanmax(ratios))

    def joint_share(self, parts: Sequence[Sequence[JointPart]]) -> Array:
        """Return the greatest load (B,) of a joint as a share of what its part may bear."""
        shares = [
            part.load_share(joint.force, joint.moment)
            for joints, chosen in zip(self.joints, parts, strict=True)
            for joint, part in zip(joints, chosen, strict=True)
        ]
        return np.asarray(np.max([np.zeros(len(self.poses)), *shares], axis=0))


def structure_figures(
    structure: Structure,
    parts: Sequence[Sequence[JointPart]],
    limits: LimitsTable,
    links: LinksTable,
) -> dict[str, tuple[float, float, bool]]:
    """Return figure, bound, and whether it is the least permitted one, by name.

    These are the limits that do not depend on the drives.
    """
    shortest, longest = structure.slenderness
    return {
        "stress over strength": (float(structure.stress_share.max()), limits.stress, False),
        "buckling factor": (float(structure.buckling_factor.min()), limits.buckling, True),
        "joint load over rating": (
            float(structure.joint_share(parts).max()),
            limits.joints,
            False,
        ),
        "length of a link over its diameter": (shortest, links.slenderness[0], True),
        "slenderness of a link": (longest, links.slenderness[1], False),
    }


def _groups(points: Array, leg: LegKind, robot: Manipulator) -> list[tuple[int, str]]:
    """Return for each joint of a leg the index of its first axis, and its kind.

    Axes at one point are one joint. The driven joint of a crank is carried by its gear ("driven");
    that of a ram is inside it.
    """
    groups: list[list[int]] = []
    for k in map(int, np.flatnonzero(np.isfinite(points).all(axis=-1))):
        together = groups and np.linalg.norm(points[k] - points[groups[-1][0]]) < _TOGETHER
        groups[-1].append(k) if together else groups.append([k])
    planar, rods = robot.platform.plane_normal is not None, hasattr(leg, "rods")
    found: list[tuple[int, str]] = []
    for at, axes in enumerate(groups):
        if at == 0 and slides(leg):
            found.append((axes.pop(0), "guide"))
        elif at == 0 and leg.joint.unit == "rad":
            found.append((axes.pop(0), "driven"))
        elif at == 1 and leg.joint.unit == "m" and not slides(leg):
            axes.pop(0)  # the ram's own guide
        if axes:
            kind = "revolute" if planar else "ball" if rods else _KINDS.get(len(axes), "ball")
            found.append((axes[0], kind))
    return found


class _Cases:
    """The load cases of a demand: at rest, unit accelerations, speeds, and forces on the tool."""

    def __init__(self, robot: Manipulator, demand: Demand) -> None:
        platform = robot.platform
        m, k = robot.freedom, len(platform.lengths)
        self._pairs = list(combinations(range(k), 2)) if demand.speed else []
        axes = np.eye(m)
        accelerations = [demand.acceleration * axes[j] for j in range(k)]
        accelerations += [a * axis for a, axis in zip(demand.turning, axes[k:], strict=True) if a]
        velocities = [demand.speed * axes[j] for j in range(k if demand.speed else 0)]
        velocities += [demand.speed * (axes[i] + axes[j]) for i, j in self._pairs]
        d = sum(name.startswith("f") for name in platform.wrench_columns)
        forces = list(demand.force * np.eye(d)) if demand.force else []
        count = 1 + len(accelerations) + len(velocities) + len(forces)
        self._acceleration, self._velocity = np.zeros((2, count, m))
        self._force = np.zeros((count, d))
        ends = np.cumsum([1, k, len(accelerations) - k, k if demand.speed else 0])
        self._pushed = slice(1, ends[1])
        self._turned = slice(ends[1], ends[2])
        self._fast = slice(ends[2], ends[3])
        self._crossed = slice(ends[3], ends[3] + len(self._pairs))
        self._loaded = slice(ends[3] + len(self._pairs), count)
        self._acceleration[1 : ends[2]] = np.reshape(accelerations, (-1, m))
        self._velocity[ends[2] : ends[3] + len(self._pairs)] = np.reshape(velocities, (-1, m))
        self._force[self._loaded] = np.reshape(forces, (-1, d))

    def states(self, batch: int) -> tuple[Array, Array, Array]:
        """Return velocity, acceleration (B, K, m) and tool force (B, K, d) of all cases."""
        parts = self._velocity, self._acceleration, self._force
        velocity, acceleration, force = (np.tile(part, (batch, 1, 1)) for part in parts)
        return velocity, acceleration, force

    def at_rest(self, loads: Array) -> tuple[Array, Array]:
        """Return middle and spread (B, ...) of loads (B, K, ...) at rest with the tool's force."""
        changes = loads - loads[:, :1]
        return loads[:, 0], np.linalg.norm(changes[:, self._loaded], axis=1)

    def bounds(self, loads: Array) -> tuple[Array, Array]:
        """Return middle and spread (B, ...): loads (B, K, ...) of any direction lie between.

        Loads are affine in acceleration and force, so that their extremes are norms, and quadratic
        in the velocity: there the greatest eigenvalue bounds them.
        """
        middle, spread = self.at_rest(loads)
        changes = loads - loads[:, :1]
        spread = spread + np.linalg.norm(changes[:, self._pushed], axis=1)
        spread = spread + np.abs(changes[:, self._turned]).sum(axis=1)
        diagonal = np.moveaxis(changes[:, self._fast], 1, -1)
        if diagonal.shape[-1]:
            quadratic = np.zeros((*diagonal.shape, diagonal.shape[-1]))
            quadratic[..., range(diagonal.shape[-1]), range(diagonal.shape[-1])] = diagonal
            for at, (i, j) in enumerate(self._pairs):
                half = 0.5 * (
                    changes[:, self._crossed][:, at] - diagonal[..., i] - diagonal[..., j]
                )
                quadratic[..., i, j] = quadratic[..., j, i] = half
            known = np.asarray(np.isfinite(quadratic).all(axis=(-2, -1)))
            eigenvalues = np.linalg.eigvalsh(np.where(known[..., None, None], quadratic, 0.0))
            spread = spread + np.where(known, np.abs(eigenvalues).max(axis=-1), np.nan)
        return middle, spread
