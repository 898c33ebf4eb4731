"""The protocol of platforms' equations: the page to read before writing a kind of platform.

From the pose x and its derivatives the equations give the motion of the platform's points, one a
leg, and the wrench required by the platform's own weight and inertia. A kind is a subclass of
`PlatformEquations`, in this folder and entered in `kinds.py`, or in a package as an entry point of
the group `pteron.platforms`; its `motion_name` is what robot files name. P is the platform's
reference point, phi the one angle of a platform that does not tilt, k the axis that it turns about.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import casadi as ca
import numpy as np

from pteron.bodies.inertia import PlanarInertia
from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    Moments,
    PointMotion,
    RotationMotion,
    mass_moment,
    moments_of,
    needed_wrench,
)
from pteron.bodies.spatial import SpatialMotion
from pteron.platforms.coordinates import are_angles


class Offset(NamedTuple):
    """s = a cos(phi) + b sin(phi) + constant, from P to a platform point; each (3, 1).

    `constant` is the part that phi does not rotate: along k, and the point's fixed offset.
    """

    a: Expression
    b: Expression
    constant: Expression


class PlatformMotion(NamedTuple):
    """The platform's state: the legs' points, their velocity matrices, its rotation and body."""

    points: tuple[PointMotion, ...]
    matrices: tuple[Expression, ...]
    """(6, m), one a leg: (c', omega) = matrix x'."""
    rotation: RotationMotion
    axes: Expression
    """(3, 3): columns x, y and z of the platform's frame at the joints of the legs."""
    body: BodyMotion
    """The motion of the platform itself as a body, with its rows in (p', omega)."""
    matrix: Expression
    """(6, m): (p', omega) = matrix x'."""
    spatial: SpatialMotion | None = None
    """The same for a platform that tilts."""
    point_twists: tuple[Expression, ...] = ()
    """(6, 6), one a leg, of a platform that tilts: (c', omega) from the twist (v, omega) of P."""
    angular: Expression | None = None
    """E (k, k): the quasi-velocities are the rates of the pose's lengths, then E times those of its
    k angles, and x' above stands for them. None where they are the pose's rates."""

    def pose_rows(self, rows: Expression) -> Expression:
        """Return the matrix (j, m) that applies to pose rates, from that for quasi-velocities."""
        if self.angular is None:
            return rows
        lengths = rows.shape[1] - self.angular.shape[0]
        return ca.horzcat(rows[:, :lengths], ca.mtimes(rows[:, lengths:], self.angular))

    def pose_forces(self, forces: Expression) -> Expression:
        """Return generalized forces (m, K) along the pose from those along quasi-velocities."""
        return self.pose_rows(forces.T).T

    def pose_rates(self, quasi: Expression) -> Expression:
        """Return pose rates (m, K) from quasi-velocities; not finite where angles are singular."""
        if self.angular is None:
            return quasi
        lengths = quasi.shape[0] - self.angular.shape[0]
        rates = ca.mtimes(self._angular_inverse, quasi[lengths:, :])
        return ca.vertcat(quasi[:lengths, :], rates)

    @property
    def twist_rows(self) -> Expression:
        """The Jacobian (6, m) of P's twist (v, omega) in the pose's rates."""
        return self.pose_rows(self.matrix)

    def velocity_of(self, twist: Expression) -> tuple[Expression, Expression]:
        """Return the pose rates (m, 1) nearest to a twist (6, 1), and the twist left over.

        The solution is that of least squares; the twist left over is infeasible for the platform.
        """
        square, projection = ca.mtimes(self.matrix.T, self.matrix), ca.mtimes(self.matrix.T, twist)
        quasi = projection if square.is_constant() else ca.mtimes(ca.inv_minor(square), projection)
        return self.pose_rates(quasi), twist - ca.mtimes(self.matrix, quasi)

    @property
    def angle_measure(self) -> Expression:
        """The determinant of the angles' matrix E: 0 in gimbal lock, 1 at best, no unit."""
        if self.angular is None:
            return ca.SX(1)
        a, b, c = ca.horzsplit(self.angular)
        return ca.dot(a, ca.cross(b, c))

    def quasi_forces(self, forces: Expression) -> Expression:
        """Return forces (m, K) along quasi-velocities from those along the pose."""
        if self.angular is None:
            return forces
        lengths = forces.shape[0] - self.angular.shape[0]
        moments = ca.mtimes(self._angular_inverse.T, forces[lengths:, :])
        return ca.vertcat(forces[:lengths, :], moments)

    @property
    def _angular_inverse(self) -> Expression:
        """The inverse of the angles' matrix E, (3, 3), by its adjugate."""
        a, b, c = ca.horzsplit(self.angular)
        adj = ca.horzcat(ca.cross(b, c), ca.cross(c, a), ca.cross(a, b))
        return adj.T / ca.dot(a, adj[:, 0])

    def rotation_at(self, point: PointMotion, fixed: Expression) -> RotationMotion:
        """Return the platform's rotation as seen from a leg's platform point."""
        return self.rotation._replace(hinge=point.position - fixed)


PlatformMoments = Any
"""`Moments`; `SpatialMoments` of a platform that tilts."""


class PlatformEquations(ABC):
    """The equations of a platform, for one state."""

    motion_name: ClassVar[str]
    """The motion that files name, such as "3T1R": translations T and rotations R."""
    coordinates: ClassVar[tuple[str, ...]]
    """The pose's coordinates, in order."""
    kinds: ClassVar[tuple[str, ...]] = PlanarInertia.kinds
    """The kinds of its inertial parameters."""
    freedom_text: ClassVar[str]
    """The platform's motion in words: a verb, and the name of the motion."""
    slides: ClassVar[bool] = False
    """Whether phi makes parts of the platform slide instead of turning it."""
    tilts: ClassVar[bool] = False
    """Whether it turns about more axes than one."""
    axis_angle: ClassVar[str | None] = None
    """The coordinate phi, about or along k; None where it has no angle, or others."""
    spin_angle: ClassVar[str | None] = None
    """The angle that turns it about k where all others are 0; None without."""
    arm_axes: ClassVar[str] = "xy"
    """The axes of its frame whose parts of a vector from P change as it turns: those across k."""
    angle_range: ClassVar[float] = np.pi
    """Largest size of an angle, rad, within which every orientation occurs."""
    point_unit: ClassVar[str] = "m"
    """The unit of its platform points: "m", or "m/rad" where phi makes them slide."""
    on_legs_alone: ClassVar[bool] = True
    """Whether the legs alone hold it, without a joint or a chain between it and the base."""
    has_center: ClassVar[bool] = False
    """Whether P is at `center`, which files give, on a joint with the base."""
    has_second_axis: ClassVar[bool] = False
    """Whether it turns about `axis`, then about `second_axis`, which files give."""
    hold_rotation: ClassVar[bool] = False
    """Whether its legs, at least one, hold the rotation that a platform that tilts does not make:
    the one about the normal of its two axes, which are perpendicular."""
    axis_distance: Expression | None = None
    """The distance of P from the base's axis that it turns about, m; None where it does not."""
    point_is_free: ClassVar[bool] = True
    """Whether P may be any point of the platform: no joint, plane or sliding part fixes it."""
    keeps_points_in_planes: ClassVar[bool] = False
    """Whether planes, in which its legs keep its points, fix its dependent coordinates."""
    wrench_columns: ClassVar[tuple[str, ...]] = ()
    """The names of the components of a wrench at P; none where they follow from the coordinates."""
    joints: ClassVar[tuple[str, ...]] = ()
    """The prismatic and revolute joints of a chain from base to platform, in order, by the names of
    their coordinates, dependent ones included; none where they are the pose's own."""

    def __init__(
        self,
        frame: Sequence[Expression],
        platform_points: Sequence[Expression],
        fixed_offsets: Sequence[Expression],
        quantities: Mapping[str, Any] | None = None,
    ) -> None:
        self.frame, self.points, self.fixed = frame, platform_points, fixed_offsets
        self.quantities = quantities or {}
        self.offsets = [
            self.offset(s, t) for s, t in zip(platform_points, fixed_offsets, strict=True)
        ]
        x0, y0, k = frame
        frame_axes = {"x": x0, "y": y0, "z": k}
        lengths = [frame_axes[name] for name in self.coordinates if name in frame_axes]
        self.directions = ca.SX.eye(3) if len(lengths) == 3 else ca.horzcat(ca.SX(3, 0), *lengths)
        """(3, l): unit vectors of the pose's l lengths; P is at directions @ lengths where the
        lengths determine its position."""

    def offset(self, s: Expression, t: Expression) -> Offset:
        """Return the offset of a platform point: s in the platform's frame, t its fixed offset."""
        x0, y0, k = self.frame
        return Offset(x0 * s[0] + y0 * s[1], y0 * s[0] - x0 * s[1], k * s[2] + t)

    def axes_by_angle(self) -> dict[str, Expression]:
        """Return the rotation axis (3, 1) of each angle, at angles zero, by the angle's name."""
        return {} if self.axis_angle is None else {self.axis_angle: self.frame[2]}

    @classmethod
    def angles(cls) -> list[int]:
        """Return the indices of the pose coordinates that are angles."""
        return np.flatnonzero(are_angles(cls.coordinates)).tolist()

    def change_to_platform_axes(
        self, pose: Expression
    ) -> tuple[PlatformEquations, Expression] | None:
        """Return the platform in its own axes, and these axes (3, 3); None if not cheaper.

        The result is None if that saves no operations.
        """
        return None

    def moments(self, rows: Sequence[Expression]) -> PlatformMoments:
        """Return the platform's mass moments from rows (1, K) of its parameters."""
        return moments_of(self.kinds, list(rows))

    @abstractmethod
    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion of platform and points at a pose, with its rates and second rates."""

    @abstractmethod
    def needs(
        self, motion: PlatformMotion, gravity: Expression, inertia: PlatformMoments
    ) -> Expression:
        """Return the generalized force (m, K) required at P to move the platform itself."""

    def needed_wrench(
        self, motion: PlatformMotion, gravity: Expression, inertia: PlatformMoments
    ) -> tuple[Expression, Expression]:
        """Return force and moment about P, (3, K) each, required to move the platform itself."""
        return needed_wrench(motion.body, inertia, gravity)

    def wrench_matrix(self, motion: PlatformMotion, gravity: Expression) -> Expression:
        """Return Om_e (m, k): the generalized force on the platform per unit of each parameter."""
        return -self.needs(motion, gravity, self.moments(ca.vertsplit(ca.SX.eye(len(self.kinds)))))

    @abstractmethod
    def mass_matrix(self, motion: PlatformMotion, inertia: PlatformMoments) -> Expression:
        """Return the platform's mass matrix (m, m) in its quasi-velocities."""

    def mass_moment(self, motion: PlatformMotion, inertia: PlatformMoments) -> Expression:
        """Return the platform's mass times centre of mass, (3, K), kg m, in the base frame."""
        return mass_moment(motion.body, inertia)

    def generalized_forces(self, motion: PlatformMotion, wrench: Expression) -> Expression:
        """Return the generalized forces (m, K) of wrenches with the rows `wrench_columns`."""
        return wrench

    def constraint(self, motion: PlatformMotion) -> Expression | None:
        """Return a measure, 1 at best, of constraints by the platform itself; None without.

        It is 1 at best, 0 where a freedom is unconstrained; None if the legs' couples constrain
        them.
        """
        return None

    def plane_wrenches(self, motion: PlatformMotion) -> Expression | None:
        """Return the unit wrenches (k, 6) about P by which planes hold points; None without."""
        return None

    def add_point_masses(
        self, inertia: PlatformMoments, masses: Sequence[Expression]
    ) -> PlatformMoments:
        """Return the platform's mass moments with point masses (1, K) added at its points."""
        m, hx, hy, i = inertia
        for s, mass in zip(self.points, masses, strict=True):
            m, hx, hy = m + mass, hx + s[0] * mass, hy + s[1] * mass
            i = i + (s[0] * s[0] + s[1] * s[1]) * mass
        return Moments(m, hx, hy, i)
