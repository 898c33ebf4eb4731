"""The protocol of legs: read this page before writing another kind.

A leg makes one actuated joint follow one point of the platform. It knows the platform only through
the motion of that point, c, and the platform's rotation: its row of the Jacobian multiplies
(c', omega). A kind of leg is two classes in one file of this folder:

- a frozen dataclass under `LegKind` (`legs.kind`): the leg's data with its TOML keys and bodies
  (`keys`), and what of its geometry the equations need (`quantities`);
- a class under `LegEquations`: built from these quantities, in numbers or in symbols, it answers a
  motion of c and of the platform's rotation with that of its joint and its bodies (`motion`), says
  how far it reaches (`reach`) and where c lies for a given joint (`locus`).

Two lines make a kind of them: `MyLeg.equations_class = MyEquations`, and
`pteron.legs.KINDS[MyLeg.type] = MyLeg`, after which files may name the kind.

A machine whose legs break this protocol is refused when it is made (`legs.protocol`).

That is all: Jacobian, dynamics, regressor, energies, limits, drawings, logs, exported code and
files for other engines follow.
`examples/new_leg.py` is a complete kind of leg. More may be overridden: `needs`, a cheaper form of
the same forces; `exported_terms`, names in exported code; and of the data `conditions`, what must
hold between its fields, `sign_edges`, the signs of its branches if they are not `elbow` alone,
`passive_joints`, those that have limits, `zero_at`, the geometry that moves the zero of its
coordinate, `unlikely_values`, warnings about its numbers, and `transfers`, the mass transfers that
explain base parameters in symbols.

All vectors are in the base frame, columns (3, 1). An expression has no branch on a value: the side
of an elbow is a quantity, +1 or -1.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self

import casadi as ca

from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    HeldPlane,
    Moments,
    PointMotion,
    RotationMotion,
    needed_wrench,
)
from pteron.renamed import adopt_former_methods, former_name


class Joint(NamedTuple):
    """One joint of a leg's chain, from the base to the platform."""

    kind: Literal["P", "R"]
    axis: Expression
    """Unit vector, (3, 1)."""
    point: Expression
    """A point on the axis, (3, 1)."""
    row: Expression
    """(1, 6): d rate / d (c', omega)."""
    rate: Expression
    acceleration: Expression
    body: str = ""
    """The letter of the body that it carries; none where the next joint follows at once, and at
    the platform, where the leg's loop is cut."""
    driven: bool = False
    """Whether it is the actuated joint: one of the chain is, wherever it stands."""
    gear: Expression = 1
    """Its coordinate over the motion that it transmits: of a shaft, its angle per phi."""
    seat: Expression | None = None
    """The point where it transmits forces and moments, (3, 1), if that is not on its axis."""


class LegMotion(NamedTuple):
    """A leg in motion, as its platform point and the platform's rotation drive it."""

    coordinate: Expression
    """q, m or rad."""
    rate: Expression
    acceleration: Expression
    row: Expression
    """(1, 6), with `divisor`: q' = row (c', omega) / divisor. Kept apart, since forces need no
    division by it: it vanishes where the leg is singular (type I)."""
    divisor: Expression
    bodies: dict[str, BodyMotion]
    """Letters are "p" (slider), "u" (upper link or crank), "l" (lower link or rod). A lower link's
    reference point is the platform point, and its x points there from the joint."""
    chain: tuple[Joint, ...]
    """The joints from the base to the platform, all of them: their screws times their rates are the
    platform's twist. Their points, in this order, are what is drawn."""
    links: tuple[Expression | None, Expression | None] = (None, None)
    """l_u and l_l, where the leg has them."""
    turning: tuple[tuple[Expression, Expression] | None, ...] = (None, None)
    """Rate and acceleration of the angles of upper and lower link about the leg's axis d, where
    that describes their motion."""
    row_size: Expression | None = None
    """The norm in space of the force that `row` is, where it is known without computation: the
    length of the link that `row` lies along."""
    thrust: Expression | None = None
    """The direction (3, 1) of that force at the driven body's end, where it is another there."""

    @property
    def actuated_joint(self) -> Joint:
        """The actuated joint of the leg's chain."""
        return next(joint for joint in self.chain if joint.driven)

    @property
    def pushes(self) -> bool:
        """Whether the leg transmits a force to its platform point, and not a moment alone."""
        return not self.row[:3].is_zero()

    @property
    def wrench_size(self) -> Expression:
        """The norm of the force in `row`, or of its moment where it has no force."""
        if self.row_size is not None:
            return self.row_size
        return ca.norm_2(self.row[:3] if self.pushes else self.row[3:])


class Passive(NamedTuple):
    """A passive joint with limits, and its coordinate."""

    noun: str
    """Its name in messages: "elbow"."""
    unit: str
    value: Expression
    least: float
    most: float
    lever: float
    """Metres that the leg moves per unit of it."""
    only_most: bool = False
    """Whether it is never below zero, and only its greatest value a limit."""


class Needs(NamedTuple):
    """The forces required to move a leg's bodies, one column for each of the K of parameters."""

    joint: Expression
    """(1, K): at the actuated joint."""
    point: Expression
    """(6, K): a force on the platform point, and a moment on the platform."""
    mass: Expression
    """(1, K): a point mass at the platform point, which the platform's inertia includes."""

    @classmethod
    def zeros(cls, columns: int) -> Needs:
        """Return the required forces of a leg without bodies: zeros with this number of columns."""
        return cls(ca.SX(1, columns), ca.SX(6, columns), ca.SX(1, columns))


def force_arm(row: Expression) -> Expression | None:
    """Return the vector (3, 1) from the platform point to the line of the force of a row (1, 6).

    The result is None for a force through the platform point.
    """
    force, moment = row[:3].T, row[3:].T
    return None if moment.is_zero() else ca.cross(force, moment) / ca.dot(force, force)


def force_wrench(force: Expression) -> Expression:
    """Return the wrench (6, K) of forces (3, K) that act at the platform point."""
    return ca.vertcat(force, ca.SX(3, force.shape[1]))


class Reach(NamedTuple):
    """Whether, and how well, a leg reaches a point."""

    margin: Expression
    """Metres to the edge of its reach, in the plane in which its links move; negative beyond it."""
    discriminant: Expression
    """The radicand of its closure: below 0 out of reach."""
    scale: Expression
    """The discriminant over `scale` is the square of the type-I measure."""
    spread: Expression
    """Metres; where it vanishes the elbow is indeterminate. Any length where that cannot happen."""

    @property
    def type_i(self) -> Expression:
        """The type-I measure, no unit: 0 where the leg is singular, 1 at best, NaN out of reach.

        A division by it loses as many digits as it has leading zeros.
        """
        return ca.sqrt(self.discriminant / self.scale)


class PlaneLocus(NamedTuple):
    """The locus of c for a given joint, a plane: normal . c = offset."""

    normal: Expression
    offset: Expression
    size: Expression
    """The size of the offset's terms, to which its rounding is relative."""


class SphereLocus(NamedTuple):
    """The locus of c for a given joint, a sphere: |c - center| = radius."""

    center: Expression
    radius: Expression


class CircleLocus(NamedTuple):
    """The locus of c for a given joint of a planar leg: a circle, of its part in the plane."""

    center: Expression
    """(3, 1); only its part in the plane counts."""
    radius: Expression


class CoordinateLocus(NamedTuple):
    """The locus of c for a given joint of a leg that has none of the simple ones."""

    joint: Expression
    plane: PlaneLocus | None = None
    """A plane that holds c in either branch of the leg."""
    closure: Callable[[Expression, bool], Expression] | None = None
    """A function of c (3, 1) that vanishes on the locus, for the inner root's sign and either of
    the outer one's; with True, for either sign of both."""


class AngleLocus(NamedTuple):
    """The platform's angle for a given joint of a leg that follows it; c may be anywhere."""

    angle: Expression


Locus = PlaneLocus | SphereLocus | CircleLocus | CoordinateLocus | AngleLocus


class LegEquations(ABC):
    """The equations of one leg, for one state."""

    kinds: ClassVar[Mapping[str, tuple[str, ...]]]
    """The kinds of parameters of each body, by letter: those of the leg's `bodies`."""
    rides: ClassVar[tuple[str, ...]] = ()
    """The bodies whose reference point is the platform point: their mass may be the platform's."""
    row_is_constant: ClassVar[bool] = False
    """Whether dq/dc does not depend on the pose, nor q on phi; see `closures`."""
    constant_row: Expression
    """dq/dc, (3, 1), where it is constant."""
    holds: HeldPlane | None = None
    """The plane that it keeps its platform point in, of a leg that does so by itself."""

    def __init_subclass__(cls) -> None:
        adopt_former_methods(
            cls,
            along="change_frame",
            named="exported_terms",
            riding="point_mass_needs",
            within_limits="limit_margins",
        )

    @abstractmethod
    def motion(self, point: PointMotion, rotation: RotationMotion) -> LegMotion:
        """Return the motion of the leg's joints and bodies, from platform point and rotation."""

    @abstractmethod
    def reach(self, c: Expression) -> Reach:
        """Return the leg's reach margins at the platform point c (3, 1), m."""

    def change_frame(self, axes: Expression, origin: Expression) -> LegEquations | None:
        """Return the leg's equations in other axes, the columns of (3, 3), or None if dearer there.

        The result is None for legs with directions, whose equations are cheaper in the base frame.
        """
        return None

    def with_axes(self, axes: Expression) -> Self:
        """Return the equations for the axes (3, k) now of the k angles by which the platform tilts.

        `reach`, `edges`, `limit_margins` and `locus` of legs that depend on the orientation are
        those at these axes.
        """
        return self

    def lever(self, length: Expression) -> Expression:
        """Return metres per unit of the leg's joint; 1 for a slider.

        `length` is the platform's characteristic length, m per rad.
        """
        return ca.SX(1)

    def edges(self, c: Expression) -> dict[str, Expression]:
        """Return expressions, by name, that are not negative where the leg reaches c (3, 1), m.

        The leg reaches c where none is negative; the names distinguish the causes.
        """
        return {"reach": self.reach(c).discriminant}

    def radicands(self, c: Expression) -> tuple[Expression, ...]:
        """Return the radicands of the closure's roots at c (3, 1), each after those inside it.

        Exact arithmetic takes the states at which all of these roots exist.
        """
        return (self.reach(c).discriminant,)

    def limit_margins(
        self, c: Expression, q: Expression, low: float, high: float
    ) -> dict[str, Expression]:
        """Return expressions, by name, that are not negative while the joint's q is in its limits.

        `low` and `high` are the limits, q the joint coordinate (m or rad) at the platform point c,
        which the leg reaches. The expressions need not be distances.
        """
        return {"least": q - low, "most": high - q}

    @abstractmethod
    def locus(self, q: Expression) -> Locus:
        """Return the locus of the platform point c while the actuated joint is held at q."""

    def exported_terms(self, point: PointMotion, rotation: RotationMotion) -> dict[str, Expression]:
        """Return intermediate quantities of the leg's equations by name, for exported code."""
        return {}

    def needs(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces at joint and platform point required to move the leg's bodies.

        A kind of leg may override it with a cheaper form of `needs_of_bodies`, with forces at its
        joint in `Needs.joint` and masses at its platform point in `Needs.mass`; the conformance
        test compares both.
        """
        return self.needs_of_bodies(point, rotation, gravity, inertia)

    def needs_of_bodies(
        self,
        point: PointMotion,
        rotation: RotationMotion,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces required to move the leg's bodies, summed body by body, Eq. (13).

        F_b is the wrench of weight and inertia on a body; the required wrench is -F_b. Eq. (13)
        sums J_b^T F_b, J_b being the body's Jacobian by (c', omega).
        """
        if not inertia:
            return Needs.zeros(1)
        motion = self.motion(point, rotation)
        columns = next(iter(inertia.values())).m.shape[1]
        total = ca.SX(6, columns)
        for letter, body in motion.bodies.items():
            force, moment = needed_wrench(body, inertia[letter], gravity)  # -F_b
            total = total + ca.mtimes(body.velocity_row.T, force)  # Eq. (13), J_b^T F_b of one body
            if body.axes is not None:
                total = total + ca.mtimes(body.turning_row.T, moment)
        return Needs(ca.SX(1, columns), total, ca.SX(1, columns))

    def point_mass_needs(self, point: PointMotion, gravity: Expression, mass: Expression) -> Needs:
        """Return the force required to move masses (1, K) fixed at the platform point."""
        none = ca.SX(1, mass.shape[1])
        force = ca.mtimes(point.acceleration - gravity, mass)
        return Needs(none, force_wrench(force), none)


def __getattr__(name: str) -> Any:
    return former_name(__name__, name)
